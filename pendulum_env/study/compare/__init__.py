"""Comparison of several integrators on one scene from one start."""

from pendulum_env.study.compare.comparison import Comparison, compare
from pendulum_env.study.compare.drift import Drift, amplitude_and_phase
from pendulum_env.study.compare.files import write
from pendulum_env.truth.answer import Truth
from pendulum_env.truth.reference import true_motion

__all__ = ["Comparison", "Drift", "Truth", "amplitude_and_phase", "compare", "true_motion", "write"]
