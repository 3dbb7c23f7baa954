"""Policies, which map observations to actions: reference controllers, and policies that a program has learnt."""

from pendulum_env.controllers.evaluation import evaluate
from pendulum_env.controllers.policy import POLICIES, Policy, load
from pendulum_env.controllers.swinging import RandomPolicy, SwingUp, swing_up

__all__ = ["POLICIES", "Policy", "RandomPolicy", "SwingUp", "evaluate", "load", "swing_up"]
