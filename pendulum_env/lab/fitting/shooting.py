"""Least squares of a whole trajectory, survived over hundreds of cycles by fitting ever longer beginnings of it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.progress import Progress, told_by
from pendulum_env.lab.fitting.model import ANGLE, GRAVITY, LENGTH, SCALE, VELOCITY, ZERO, Model
from pendulum_env.lab.fitting.start import visible

Array = NDArray[np.float64]

FIRST, LONGER, LEAST_LONGER = 4.0, 8.0, 1.4
"""Periods of the first beginning that is fitted; how many times longer each next one is, at most and at least."""
ASTRAY, SMALL = 0.5, 0.02
"""A model has lost a swing where it is off by this share of the swing's amplitude; amplitudes below this share of the
largest count as that."""
PATIENCE = 2
"""Pieces in a row that may end beyond what the model follows, before the rest is fitted in one, roughly."""
NUDGE, ASIDE = 6e-6, 1e-7
"""Relative change of a parameter for central differences, the cube root of rounding, and for those on one side."""
BEYOND = 10.0
"""Residual [rad] that stands where a trial trajectory has ended."""
ROUGH, FINE = {"ftol": 1e-4, "xtol": 1e-6, "max_nfev": 20}, {"ftol": 1e-9, "xtol": 1e-10, "max_nfev": 60}
"""When the least squares of a beginning, and of the whole, are done."""


@dataclass(frozen=True, eq=False)
class Solution:
    """Least squares of a model.

    Attributes:
        values: parameters, as ``model.names``.
        residual: data minus model [rad], at every time.
        jacobian: of the model's angles by the parameters, shape ``(times, names)``.
        velocity: of the model at every time [rad/s].
        followed: time up to which the model follows the swings, by ``ASTRAY``; the last one if it follows all [s].
    """

    model: Model
    values: Array
    residual: Array
    jacobian: Array
    velocity: Array
    followed: float

    @property
    def lost(self) -> bool:
        """True if the model does not follow all swings: a phase slipped, or the amplitude is far off."""
        return self.followed < float(self.model.time[-1])


def solve(
    model: Model,
    angle: Array,
    sigma: Array,
    start: Array,
    progress: Progress | None = None,
    pause: int = 0,
) -> Solution:
    """Minimise ``sum(((angle - model) / sigma)**2)`` from ``start``.

    The fit begins with as much of the recording as the start follows, at least 4 periods, and goes on to what each fit
    follows beyond its own end; so no phase is ever off by half a turn where a longer piece is begun.

    Args:
        angle, sigma: readings and the standard deviation of each [rad], at ``model.time``.
        pause: readings that are fitted before any later ones. Where dry friction has stopped the bob, the angle that it
            rests at tells the friction very finely, but in many ways, so that the swing has to say first which.
    """
    tell, total = told_by(progress), len(model.time)
    values = np.maximum(start, model.least)
    period = math.tau / model.scene_with(values).omega0
    floor = max(int(np.searchsorted(model.time, FIRST * period)), 4 * len(model.names))
    done, most, beyond = 0, total, -1
    while True:
        reach = followed(model, values, angle, sigma)
        beyond = beyond + 1 if reach < floor else 0
        count = total if beyond > PATIENCE else min(total, most, max(reach, floor))
        count = pause if done < pause < count else count
        tell(0.9 * count / total, f"{model.title}: {model.time[count - 1]:.3g} s")
        how = FINE if count in (pause, total) and beyond <= PATIENCE else ROUGH
        values = _least_squares(model.until(count), angle[:count], sigma[:count], values, how)
        if count == total:
            break
        done, floor, most = count, math.ceil(LEAST_LONGER * count), math.ceil(LONGER * count)
    tell(1.0, model.title)
    return solution_at(model, values, angle, sigma)


def solution_at(model: Model, values: Array, angle: Array, sigma: Array) -> Solution:
    """What these values leave of the readings."""
    angles, velocity = model.motion(values)
    last = max(followed(model, values, angle, sigma, angles[0]) - 1, 0)
    return Solution(model, values, angle - angles[0], jacobian(model, values), velocity[0], float(model.time[last]))


def _least_squares(model: Model, angle: Array, sigma: Array, start: Array, how: Mapping[str, Any]) -> Array:
    """Parameters of the least squares within their bounds."""
    from scipy.optimize import least_squares

    seen: dict[bytes, Array] = {}

    def shown(x: Array) -> Array:
        if x.tobytes() not in seen:
            seen.clear()
            seen[x.tobytes()] = model.angles(x)[0]
        return seen[x.tobytes()]

    def misses(x: Array) -> Array:
        return np.asarray(np.nan_to_num(shown(x) - angle, nan=BEYOND) / sigma)

    def slopes(x: Array) -> Array:
        return jacobian(model, x, shown(x)) / sigma[:, None]

    found = least_squares(misses, start, slopes, bounds=(model.least, np.inf), x_scale=sizes(model, start),
                          method="dogbox", gtol=None, **how)
    return np.asarray(np.maximum(found.x, model.least))


def followed(model: Model, values: Array, angle: Array, sigma: Array, shown: Array | None = None) -> int:
    """How many of the readings, from the first on, the model with these values follows; ``shown``: its angles. One
    that is astray alone is a bad reading."""
    theirs = model.angles(values)[0] if shown is None else shown
    zero = values[model.names.index(ZERO)]
    size = _amplitude(model.time, angle - zero, math.tau / model.scene_with(values).omega0)
    off = np.nan_to_num(np.abs(angle - theirs), nan=BEYOND)
    astray = off > ASTRAY * np.maximum(size, SMALL * float(size.max())) + 10.0 * sigma
    both = astray[1:] & astray[:-1]
    return int(np.argmax(both)) if both.any() else len(angle)


def _amplitude(time: Array, angle: Array, period: float) -> Array:
    """Largest |angle| within a period or two around each time, linear between."""
    cells = np.floor(time / period).astype(np.intp)
    peaks = np.zeros(int(cells[-1]) + 3)
    np.maximum.at(peaks, cells + 1, np.abs(angle))
    near = np.maximum(np.maximum(peaks[:-2], peaks[2:]), peaks[1:-1])
    return np.asarray(near[cells])


def sizes(model: Model, values: Array) -> Array:
    """What is a large change of each parameter; a damping's number counts at least as that at which it is just seen."""
    scene, given = model.scene_with(values), dict(zip(model.names, values, strict=True))
    swing = max(abs(given[ANGLE]), abs(given[VELOCITY]) / scene.omega0, 1e-3)
    known = {ANGLE: 0.1, VELOCITY: 0.1 * scene.omega0, ZERO: 0.01, SCALE: 0.01, LENGTH: 1e-3 * scene.body.length,
             GRAVITY: 1e-3 * scene.gravity}
    least = dict(zip(model.numbers, visible(scene, model.numbers, swing), strict=True))
    return np.array([known.get(name, max(abs(x), least.get(name, 1e-12))) for name, x in given.items()])


def jacobian(model: Model, values: Array, shown: Array | None = None) -> Array:
    """Derivatives of the angles by the parameters, shape ``(times, names)``, by differences in one batch.

    Central ones of second order, next to a bound one-sided ones; all one-sided where the angles at the values
    themselves are given, ``shown``: half the work, for steps of a search.
    """
    count, size = len(values), np.maximum(np.abs(values), sizes(model, values))
    if shown is not None:
        rows = model.angles(values + np.diag(ASIDE * size))
        return np.nan_to_num((rows - shown).T / (ASIDE * size))
    steps = np.diag(NUDGE * size)
    up, down = values + steps, np.maximum(values - steps, model.least)
    rows = model.angles(np.concatenate([up, down]))
    return np.nan_to_num((rows[:count] - rows[count:]).T / np.diagonal(up - down))
