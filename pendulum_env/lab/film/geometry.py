"""Angles of a bob about its pivot, from its places in a film, with their errors.

The pivot is the centre of the circle through the places (:func:`pendulum_env.lab.fit_circle`). An angle's error is the
part of a place's error along the arc over the radius. It is enlarged until the scatter of the readings about a smooth
swing agrees with it: compression and patterned walls make errors that one picture alone does not show.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pendulum_env.lab.checked import FloatArray, RecordingError
from pendulum_env.lab.film.finding import basis
from pendulum_env.lab.measures import Measurement
from pendulum_env.lab.tracks import fit_circle

_UNSURE = 0.1  # of the radius: a pivot with a larger standard error is refused
_WINDOW = 1.6  # periods in which a swing is compared with harmonics whose amplitudes change linearly


class Angles(NamedTuple):
    """Angles [rad] from straight down in the picture, to the right, their errors, and the circle."""

    angle: FloatArray
    error: FloatArray
    pivot: tuple[float, float]
    radius: Measurement
    rms: float


def angles_of(name: str, x: FloatArray, y: FloatArray, covariance: FloatArray, pivot: tuple[float, float] | None
              ) -> Angles:
    """Return the angles of places (x, y: down) about the pivot, by default the centre of the circle through them.

    ``covariance``: array (n, 2, 2). Raises RecordingError for an arc too short to find its pivot.
    """
    if pivot is None:
        circle = fit_circle(x, y)
        if not circle.error < _UNSURE * circle.radius:
            raise RecordingError(f"{name}: the arc of the bob is too short to find its pivot (± {circle.error:.3g} "
                                 f"pixels at a radius of {circle.radius:.4g}); give pivot=(x, y), in pixels from the "
                                 "top left")
        pivot, rms = (circle.x, circle.y), circle.rms
        error = circle.error * _together(x - circle.x, y - circle.y, circle.radius)
        radius = Measurement(circle.radius, error, "pixels")
    else:
        away = np.hypot(x - pivot[0], y - pivot[1])
        rms = float(away.std())
        radius = Measurement(float(away.mean()), rms / math.sqrt(len(away)), "pixels")
    angle = np.arctan2(x - pivot[0], y - pivot[1])
    along = np.stack([np.cos(angle), -np.sin(angle)], axis=1)
    error = np.sqrt(np.maximum(np.einsum("ni,nij,nj->n", along, covariance, along), 0.0)) / radius.value
    return Angles(np.unwrap(angle), error, pivot, radius, rms)


def _together(x: FloatArray, y: FloatArray, radius: float) -> float:
    """Return by how much the distances from a circle's centre are less certain together than each for itself.

    Readings at the same place share what the wall and the compression do to them. Their means in 24 parts of the arc
    scatter more than independent readings would.
    """
    angle, away = np.arctan2(x, y), np.hypot(x, y) - radius
    parts = np.digitize(angle, np.quantile(angle, np.linspace(0.0, 1.0, 25)[1:-1]))
    means = np.array([away[parts == part].mean() for part in np.unique(parts)])
    each = float(away.var()) / (len(away) / max(len(means), 1))
    return math.sqrt(max(1.0, float(means.var()) * len(means) / max(len(means) - 3, 1) / each)) if each > 0.0 else 1.0


def middle_of(time: FloatArray, angle: FloatArray, error: FloatArray, omega: float) -> float | None:
    """Return the middle of a swing [rad]: the constant beside its harmonics, as of :func:`rest_of`; None without one.

    Unlike the middle of turning points, it is the same where one side is hidden.
    """
    span = _WINDOW * math.tau / omega
    found = []
    for begin in np.arange(float(time[0]), float(time[-1]), span):
        here = (time >= begin) & (time < begin + span)
        if here.sum() < 24:
            continue
        table = basis(time[here] - begin - 0.5 * span, omega, 3) / error[here, None]
        inverse = np.linalg.pinv(table.T @ table)
        found.append((float((inverse @ (table.T @ (angle[here] / error[here])))[0]), float(inverse[0, 0])))
    if not found:
        return None
    values, variances = np.array(found).T
    near = np.abs(values - np.median(values)) <= 5.0 * np.sqrt(np.maximum(variances, np.median(variances)))
    return float(np.average(values[near], weights=1.0 / variances[near]))


def rest_of(time: FloatArray, angle: FloatArray, error: FloatArray, omega: float) -> FloatArray:
    """Return what harmonics 1 to 3 with slowly changing amplitudes leave of a swing, in units of its errors.

    Windows of 1.6 periods are fitted by weighted least squares, twice, the second time without readings far off. What
    is left is divided by the root of its share of freedom, so that its variance is 1 if the errors are right.
    """
    span = _WINDOW * math.tau / omega
    rest = np.full(len(time), np.nan)
    begin = float(time[0])
    while begin < time[-1]:
        end = begin + span
        if time[-1] - end < 0.5 * span:
            end = float(time[-1]) + 1.0
        here = np.flatnonzero((time >= begin) & (time < end))
        begin = end
        if len(here) < 12:
            continue
        own, middle = error[here], 0.5 * float(time[here[0]] + time[here[-1]])
        table = basis(time[here] - middle, omega, 3 if len(here) > 24 else 1) / own[:, None]
        value = angle[here] / own
        use = np.ones(len(here), dtype=bool)
        left = value
        for _ in range(3):
            solution = np.linalg.lstsq(table[use], value[use], rcond=None)[0]
            left = value - table @ solution
            level = 1.48 * float(np.median(np.abs(left[use])))
            use = np.abs(left) < 5.0 * max(level, 1e-12)
            if use.sum() < table.shape[1] + 4:
                use = np.ones(len(here), dtype=bool)
                break
        q = np.linalg.qr(table[use])[0]
        free = np.ones(len(here))
        free[use] = np.maximum(1.0 - np.einsum("ij,ij->i", q, q), 0.1)
        rest[here] = left / np.sqrt(free)
    return rest


def calibrated(error: FloatArray, rest: FloatArray) -> tuple[FloatArray, float]:
    """Return errors enlarged so that 95 % of what a smooth swing leaves is within 1.96 of them, and by what factor."""
    left = np.abs(rest[np.isfinite(rest)])
    if len(left) < 12:
        return error, 1.0
    factor = max(float(np.quantile(left, 0.95)) / 1.96, 0.5)
    return error * factor, factor


def alone(rest: FloatArray, factor: float) -> NDArray[np.bool_]:
    """Return a mask of the readings that are far off a smooth swing, more than six of the enlarged errors."""
    return np.asarray(np.abs(np.nan_to_num(rest)) > 6.0 * max(factor, 1e-12))
