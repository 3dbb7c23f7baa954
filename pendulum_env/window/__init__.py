"""Window of ``render_mode="human"``, which shows an environment's frames and lets a person interact with it.

A person can pause, take single steps, slow down, change the integrator, drag the bob with the mouse and type a start
angle; see :data:`pendulum_env.window.controls.KEYS`. pygame-ce is imported when the first window opens.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pendulum_env.window.shown import Shown

if TYPE_CHECKING:
    from pendulum_env.window.live import Live

__all__ = ["Shown", "window_of"]


def window_of(shown: Shown) -> Live:
    """Return the window of an environment; it opens when the first episode starts."""
    from pendulum_env.window.live import Live

    return Live(shown)
