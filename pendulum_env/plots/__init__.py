"""Figures: the runs of several methods over time and in phase space, one style and one colour per method.

    axes = plots.angle({"rk4": run})                    # a figure of its own, off-screen
    plots.save(axes.figure, "angle.png", {"Title": "..."})

No function opens a window, uses pyplot's state or leaves a global setting changed.
"""

from pendulum_env.plots.energy import energy, energy_error
from pendulum_env.plots.motion import angle, deviation, phase, velocity
from pendulum_env.plots.series import DENSE
from pendulum_env.plots.style import WIDE, colours, figure, save, save_all, styled
from pendulum_env.plots.titles import describe, legend

__all__ = [
    "DENSE",
    "WIDE",
    "angle",
    "colours",
    "describe",
    "deviation",
    "energy",
    "energy_error",
    "figure",
    "legend",
    "phase",
    "save",
    "save_all",
    "styled",
    "velocity",
]
