"""``render_mode="human"``: a window with the environment's frames, in which a person can take part.

Pause, single steps, slow motion, another integrator from the same state, the bob dragged by the mouse, a start angle
typed in: :data:`pendulum_env.window.controls.KEYS`. Importing this costs nothing; pygame-ce is imported when the first
window opens.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pendulum_env.window.shown import Shown

if TYPE_CHECKING:
    from pendulum_env.window.live import Live

__all__ = ["Shown", "window_of"]


def window_of(shown: Shown) -> Live:
    """Return the window of a running pendulum; it opens with the first start."""
    from pendulum_env.window.live import Live

    return Live(shown)
