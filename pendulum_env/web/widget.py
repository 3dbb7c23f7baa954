"""The page in a notebook, as a widget whose link Python and the page share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

try:
    import anywidget
    import traitlets
except ImportError:
    raise ImportError("The widget needs anywidget: pip install 'lab-pendulum[notebook]'.") from None

from integrators import Method
from pendulum_env.engine.spec import RunSpec
from pendulum_env.web.links import link_of, read_link
from pendulum_env.web.page import ASSETS, SHOWN_METHODS, SHOWN_SCENES, page


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


def widget(
    scene: str = SHOWN_SCENES[0], integrators: Sequence[str | Method] = ("forward_euler", "symplectic_euler"),
    *, recording: Any = None, height: int = 900, **start: Any,
) -> LabWidget:
    """Return the page as a widget, which a notebook shows when it ends a cell.

    Args:
        scene: name of the preset to begin with; the page has the usual scenes, too.
        integrators: names of one to four methods to begin with.
        recording: a Recording, which is drawn over the angles.
        height: height [CSS pixels].
        start: ``angle`` [rad], ``velocity`` [rad/s], ``dt`` [s], and numbers of the scene such as ``length`` or
            ``gamma``.

    Raises ImportError without anywidget, SceneError and MethodError for what does not exist.
    """
    names = [method if isinstance(method, str) else method.name for method in integrators]
    text = link_of(scene, names, **start)
    made = page([scene, *SHOWN_SCENES], [*names, *SHOWN_METHODS], recording=recording)
    return LabWidget(page=made, link=text, height=height)
