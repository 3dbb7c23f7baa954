"""Reference controllers: callables from observations to actions, to compare learnt ones with."""

from pendulum_env.controllers.policy import RandomPolicy
from pendulum_env.controllers.swinging import SwingUp, swing_up

__all__ = ["RandomPolicy", "SwingUp", "swing_up"]
