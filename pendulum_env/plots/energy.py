"""Figures of the energy over time and of its numerical error, the residual of the energy balance."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from pendulum_env.plots.series import Span, peaks, swing, within
from pendulum_env.plots.style import logarithmic, looks
from pendulum_env.plots.titles import named, over_time
from pendulum_env.render.palette import FAINT_INK

if TYPE_CHECKING:
    from pendulum_env.engine.rollout import Rollout

APART = 30.0
"""The energy axis is logarithmic if energies differ by more than this factor."""
FLOOR, CEILING = 1e-3, 1e6
"""Lower and upper end of the logarithmic energy axis, as multiples of the initial energy. If all runs reach energies
above the upper end, the axis is linear."""
TAME = 0.1
"""Runs with relative energy errors up to this determine the linear axis of the energy residual."""
PERCENT = 1e-3
"""Smallest relative energy error that is given in percent."""
LEAST = 1e-17
"""Relative energy errors below this are not drawn."""
PREFIXES = ((0.1, 1.0, "J"), (1e-4, 1e-3, "mJ"), (1e-7, 1e-6, "µJ"), (0.0, 1e-9, "nJ"))
"""Units of the energy axis: smallest energy [J] for which a unit is used, size of the unit [J], and its name.

The energy is the initial one, or the largest one if the initial energy is 0."""


def energy(runs: Mapping[str, Rollout], *, span: Span | None = None, axes: Axes | None = None) -> Axes:
    """Draw kinetic plus potential energy against time [s], on a logarithmic axis if energies differ widely.

    A dashed line marks the initial energy. ``runs`` are rollouts by their labels, ``span`` is the time to show [s], and
    ``axes`` the axes to draw into, by default those of a new figure. Raises ValueError for runs that cannot be drawn.
    """
    with over_time(runs, span, axes) as (at, shown):
        parts = {key: within(run.time, shown) for key, run in runs.items()}
        values = {key: runs[key].energy[part] for key, part in parts.items()}
        initial = float(next(iter(runs.values())).energy[0])
        least_driven = min(float(np.max(own[np.isfinite(own)], initial=0.0)) for own in values.values())
        usable = initial if math.isfinite(initial) and initial > max(0.0, least_driven / CEILING) else 0.0
        everything = np.concatenate(list(values.values()))
        known = everything[np.isfinite(everything)]
        size = usable or float(np.max(known, initial=0.0)) or 1.0
        unit, name = next((unit, name) for least, unit, name in PREFIXES if size >= least)
        for key, look in looks(runs).items():
            at.plot(runs[key].time[parts[key]], values[key] / unit, label=named(key, runs[key]), **look.line)
        most, least = float((known / unit).max(initial=0.0)), float((known / unit).min(initial=math.inf))
        if usable and most > APART * max(least, 0.0):
            at.set_yscale("log")
            edges = usable / unit * FLOOR, usable / unit * CEILING
            at.set_ylim(max(0.7 * least, edges[0]), min(1.5 * most, edges[1]))
        else:
            at.set_ylim(0.0, 1.08 * most or 1.0)
        at.axhline(usable / unit, color=FAINT_INK, linewidth=0.9, linestyle=(0, (4, 3)), zorder=1.2)
        at.set_ylabel(f"energy [{name}]")
    return at


def energy_residual(runs: Mapping[str, Rollout], *, span: Span | None = None, axes: Axes | None = None) -> Axes:
    """Draw the energy residual of every run, with its sign, over the initial energy against time [s].

    The axis is linear and fits the methods that keep the energy within 10 % (TAME), so that one sees the energy of a
    symplectic method swing about the true one; other curves leave the axes. Without such a method the axis fits the
    smallest error. It is in percent if it reaches 0.1 % (PERCENT). An initial energy of 0 is replaced by 1 J. Arguments
    as of :func:`energy`. Raises ValueError for runs that cannot be drawn.
    """
    with over_time(runs, span, axes) as (at, shown):
        moving = any(float(run.energy[0]) for run in runs.values())
        parts = {key: within(run.time, shown) for key, run in runs.items()}
        shares = {key: run.energy_residual[parts[key]] / (abs(float(run.energy[0])) or 1.0)
                  for key, run in runs.items()}
        sizes = [float(np.max(np.abs(share[np.isfinite(share)]), initial=0.0)) for share in shares.values()]
        limit = max((size for size in sizes if size <= TAME), default=min(sizes))
        unit = 0.01 if moving and limit >= PERCENT else 1.0
        for key, look in looks(runs).items():
            at.plot(runs[key].time[parts[key]], shares[key] / unit, label=named(key, runs[key]), **look.line)
        if limit > 0.0:
            at.set_ylim(-1.15 * limit / unit, 1.15 * limit / unit)
        at.axhline(0.0, color=FAINT_INK, linewidth=0.9, linestyle=(0, (4, 3)), zorder=1.2)
        at.set_ylabel("energy residual" + (" [J]" if not moving else " / E$_0$" if unit == 1.0 else " / E$_0$ [%]"))
    return at


def energy_error(runs: Mapping[str, Rollout], *, span: Span | None = None, axes: Axes | None = None) -> Axes:
    """Draw the relative energy error of every run, |residual| / E0, on a logarithmic axis against time [s].

    The residual is the change of the energy, minus the work done on the pendulum, plus the heat. Without drives and
    dissipation it is the energy error. Over more than two swings, the largest value in each half swing is drawn. An
    initial energy of 0 is replaced by 1 J. Arguments as of :func:`energy`. Raises ValueError for runs that cannot be
    drawn.
    """
    with over_time(runs, span, axes) as (at, shown):
        many = shown[1] - shown[0] > 2.0 * swing(runs)
        moving = any(float(run.energy[0]) for run in runs.values())
        for key, look in looks(runs).items():
            run = runs[key]
            part = within(run.time, shown)
            time, error = run.time[part], np.abs(run.energy_residual[part]) / (abs(float(run.energy[0])) or 1.0)
            if many:
                time, error = peaks(time, error, run.velocity[part], 0.5 * swing(runs))
            at.plot(time, np.where(error >= LEAST, error, math.nan), label=named(key, run), **look.line)
        logarithmic(at)
        at.set_ylabel("|energy residual|" + (" / E$_0$" if moving else " [J]")
                      + ("\nlargest in each half swing" if many else ""))
    return at
