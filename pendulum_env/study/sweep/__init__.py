"""Many runs, one for each point of a grid."""

from pendulum_env.study.sweep.study import Sweep, sweep

__all__ = ["Sweep", "sweep"]
