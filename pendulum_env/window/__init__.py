"""Window of ``render_mode="human"``, which shows an environment's frames and lets a person interact with it.

A person can pause, take single steps, slow down, change the integrator, drag the bob with the mouse, type a start
angle, stop times and save a picture; see :data:`pendulum_env.window.controls.KEYS`. pygame-ce is imported when the
first window opens.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pendulum_env.window.shown import Shown

if TYPE_CHECKING:
    from pendulum_env.window.live import Live

__all__ = ["Shown", "window_of"]


def window_of(*shown: Shown, **more: Any) -> Live:
    """Return the window of an environment, or of several pendulums side by side; it opens with the first frame.

    ``more`` are further arguments of :class:`pendulum_env.window.live.Live`.
    """
    from pendulum_env.window.live import Live

    return Live(*shown, **more)
