"""The class of the page in a notebook. It needs anywidget, and is loaded when the first widget is made."""

from __future__ import annotations

from html import escape
from importlib import import_module

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

    def _ipython_display_(self) -> None:
        """Show the page below a line that says what belongs here: a notebook that does not run leaves it empty."""
        page = import_module("IPython.display")
        page.display(page.HTML("<small>The page below needs a running notebook. Without one, write a page by "
                     "<code>lab-pendulum web</code> and open it with this behind its address: "
                     f"<code>#{escape(self.link)}</code></small>"))
        data, more = self._repr_mimebundle_() or ({"text/plain": repr(self)}, {})
        page.display(data, metadata=more, raw=True)

    def spec(self, pendulum: int = 1) -> RunSpec:
        """Return the run of one of the pendulums, counted from 1, as :func:`pendulum_env.web.read_link` does."""
        return read_link(self.link, pendulum)
