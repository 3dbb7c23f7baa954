"""Reference controllers, which map observations to actions, for comparison with learnt policies."""

from pendulum_env.controllers.policy import RandomPolicy
from pendulum_env.controllers.swinging import SwingUp, swing_up

__all__ = ["RandomPolicy", "SwingUp", "swing_up"]
