"""Least squares of a whole trajectory, survived over hundreds of cycles by fitting ever longer beginnings of it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pendulum_env.lab.fitting.model import ANGLE, GRAVITY, LENGTH, VELOCITY, ZERO, Model
from pendulum_env.lab.fitting.start import small_number
from pendulum_env.progress import Progress

Array = NDArray[np.float64]

FIRST, LONGER = 4.0, 4.0
"""Periods of the first beginning that is fitted, and how many times longer each next one is."""
NUDGE = 6e-6
"""Relative change of a parameter for central differences: the cube root of rounding."""
LEAST = 0.01
"""Least size of a damping's number, in those that take 1e-3 of the amplitude in a half swing; at 0, too, it moves."""
BEYOND = 10.0
"""Residual [rad] that stands where a trial trajectory has ended."""


@dataclass(frozen=True, eq=False)
class Solution:
    """Least squares of a model.

    Attributes:
        values: parameters, as ``model.names``.
        residual: data minus model [rad], at every time.
        jacobian: of the model's angles by the parameters, shape ``(times, names)``.
        velocity: of the model at every time [rad/s].
    """

    model: Model
    values: Array
    residual: Array
    jacobian: Array
    velocity: Array


def solve(model: Model, angle: Array, sigma: Array, start: Array, progress: Progress | None = None) -> Solution:
    """Minimise ``sum(((angle - model) / sigma)**2)`` from ``start``.

    Args:
        angle, sigma: readings and the standard deviation of each [rad], at ``model.time``.
    """
    from scipy.optimize import least_squares

    period = 2.0 * np.pi / model.scene_with(start).omega0
    windows, span = [], FIRST * period
    while span < model.time[-1]:
        windows.append(int(np.searchsorted(model.time, span)))
        span *= LONGER
    windows = [count for count in windows if count > 4 * len(model.names)] + [len(model.time)]
    values, tell = np.maximum(start, model.least), progress or (lambda _fraction, _what: None)
    for i, count in enumerate(windows):
        tell(i / len(windows), f"{'+'.join(model.damping) or 'no damping'}: {model.time[count - 1]:.3g} s")
        part, data, weight = model.until(count), angle[:count], 1.0 / sigma[:count]

        def misses(x: Array, part: Model = part, data: Array = data, weight: Array = weight) -> Array:
            return np.asarray(np.nan_to_num(part.angles(x)[0] - data, nan=BEYOND) * weight)

        def slopes(x: Array, part: Model = part, weight: Array = weight) -> Array:
            return jacobian(part, x) * weight[:, None]

        scale = sizes(model, values)
        found = least_squares(misses, values, slopes, bounds=(model.least - 1e-300, np.inf), x_scale=scale,
                              xtol=1e-12, ftol=1e-10, gtol=1e-10, max_nfev=60)
        values = found.x
    values = np.maximum(values, model.least)
    angles, velocity = model.motion(values)
    tell(1.0, "done")
    return Solution(model, values, angle - angles[0], jacobian(model, values), velocity[0])


def sizes(model: Model, values: Array) -> Array:
    """What is a large change of each parameter."""
    scene = model.scene_with(values)
    known = {ANGLE: 0.1, VELOCITY: 0.1 * scene.omega0, ZERO: 0.01, LENGTH: 1e-3 * scene.body.length,
             GRAVITY: 1e-3 * scene.gravity}
    given = dict(zip(model.names, values, strict=True))
    amplitude = max(math.hypot(given[ANGLE], given[VELOCITY] / scene.omega0), 1e-3)
    least = {name: LEAST * small_number(model.scene, name, amplitude) for name in model.numbers}
    return np.array([known.get(name, max(abs(x), least.get(name, 1e-12))) for name, x in given.items()])


def jacobian(model: Model, values: Array) -> Array:
    """Derivatives of the angles by the parameters, shape ``(times, names)``, by central differences in one batch.

    Next to a bound the difference is one-sided, of first order.
    """
    count = len(values)
    steps = NUDGE * np.maximum(np.abs(values), sizes(model, values))
    up, down = values + np.diag(steps), np.maximum(values - np.diag(steps), model.least)
    rows = model.angles(np.concatenate([up, down]))
    width = np.diagonal(up - down)
    return np.nan_to_num((rows[:count] - rows[count:]).T / width)
