"""Sweeps: runs of a function for all combinations of parameter values in a grid."""

from pendulum_env.study.sweep.study import Sweep, sweep

__all__ = ["Sweep", "sweep"]
