"""The page in a notebook, as a widget whose link Python and the page share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from integrators import Method
from pendulum_env.web.document import SHOWN_METHODS, SHOWN_SCENES, page
from pendulum_env.web.links import link_of

if TYPE_CHECKING:
    from pendulum_env.web.lab_widget import LabWidget


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

    Its ``link`` is the present state of the page, and changes it when assigned; ``spec(n)`` is the run of the n-th
    pendulum.

    Raises ImportError without anywidget, SceneError and MethodError for what does not exist.
    """
    try:
        from pendulum_env.web.lab_widget import LabWidget
    except ImportError:
        raise ImportError("The widget needs anywidget: pip install 'lab-pendulum[notebook]'.") from None
    names = [method if isinstance(method, str) else method.name for method in integrators]
    text = link_of(scene, names, **start)
    made = page([scene, *SHOWN_SCENES], [*names, *SHOWN_METHODS], recording=recording)
    return LabWidget(page=made, link=text, height=height)
