"""The class of the page in a notebook. It needs anywidget, and is loaded when the first widget is made."""

from __future__ import annotations

import anywidget
import traitlets

from pendulum_env.engine.spec import RunSpec
from pendulum_env.web.document import ASSETS
from pendulum_env.web.links import read_link


class LabWidget(anywidget.AnyWidget):
    """The page in a notebook; :func:`pendulum_env.web.widget` makes it.

    Attributes:
        link: the present scene, numbers, methods and start, as in the page's links. Assign another link to change the
            page; what a person changes in the page changes the link.
        height: height of the page [CSS pixels].
    """

    _esm = ASSETS / "widget.js"
    page = traitlets.Unicode().tag(sync=True)
    link = traitlets.Unicode().tag(sync=True)
    height = traitlets.Int(900).tag(sync=True)

    def spec(self, pendulum: int = 1) -> RunSpec:
        """Return the run of one of the pendulums, counted from 1, as :func:`pendulum_env.web.read_link` does."""
        return read_link(self.link, pendulum)
