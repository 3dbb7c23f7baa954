"""Figures of the runs of one or more methods, over time and in phase space, with one colour per method.

    axes = plots.angle({"rk4": run})                    # draws into a new off-screen figure
    plots.save(axes.figure, "angle.png", {"Title": "..."})

No function opens a window, uses pyplot's state or changes a global setting permanently.
"""

from pendulum_env.plots.energy import energy, energy_error, energy_residual
from pendulum_env.plots.motion import angle, deviation, phase, portraits, velocity
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
    "energy_residual",
    "figure",
    "legend",
    "phase",
    "portraits",
    "save",
    "save_all",
    "styled",
    "velocity",
]
