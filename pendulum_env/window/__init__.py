"""``render_mode="human"``: a window with the environment's frames, in which a person can take part.

Pause, single steps, slow motion, another integrator from the same state, the bob dragged by the mouse, a start angle
typed in: :data:`pendulum_env.window.controls.KEYS`. Importing this costs nothing; pygame-ce is imported when the first
window opens.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pendulum_env.envs.env import LabPendulumEnv
    from pendulum_env.envs.settings import Settings
    from pendulum_env.window.live import Live


def window_of(env: LabPendulumEnv, made: Settings) -> Live | None:
    """The window of an environment that asks for one; None for other render modes."""
    if made.render_mode != "human":
        return None
    from pendulum_env.window.live import Live

    return Live(env, made)
