"""Sweeps: one run for each point of a grid of parameters."""

from pendulum_env.study.sweep.study import Sweep, sweep

__all__ = ["Sweep", "sweep"]
