"""Reference controllers, which map observations to actions, for comparison with learnt policies."""

from pendulum_env.controllers.swinging import RandomPolicy, SwingUp, swing_up

__all__ = ["RandomPolicy", "SwingUp", "swing_up"]
