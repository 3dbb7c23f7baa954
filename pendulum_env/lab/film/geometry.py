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
_SURE = 6.0  # standard errors from which a bend is none of chance
_BENDS = 0.005, 0.005  # squares and cubes of angles from which a bend matters
_STREAK = 0.003  # of a streak's length, to which its middle is known across the arc, by drawn films
_WHOLE_ARC = 1.7  # times by which readings share more over the whole arc, which tells the radius, than over 1/24 of it;
# about right for the radii of some twenty drawn films
_CLICK = 0.5  # pixels, to which a pivot is known that was clicked on or read off
_WIDE = 0.9  # rad from end to end, from which the third harmonic changes visibly with the amplitude
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
        angle, away = np.arctan2(x - circle.x, y - circle.y), np.hypot(x - circle.x, y - circle.y)
        error = _WHOLE_ARC * circle.error * _together(angle, away - circle.radius)
        radius = Measurement(circle.radius, error, "pixels")
    else:
        away = np.hypot(x - pivot[0], y - pivot[1])
        rms = float(away.std())
        radius = Measurement(float(away.mean()), math.hypot(_CLICK, rms / math.sqrt(len(away))), "pixels")
    angle = np.arctan2(x - pivot[0], y - pivot[1])
    along = np.stack([np.cos(angle), -np.sin(angle)], axis=1)
    error = np.sqrt(np.maximum(np.einsum("ni,nij,nj->n", along, covariance, along), 0.0)) / radius.value
    return Angles(np.unwrap(angle), error, pivot, radius, rms)


def _together(angle: FloatArray, away: FloatArray) -> float:
    """Return by how much readings that are ``away`` are less certain together than each for itself.

    Readings at the same place share what the wall and the compression do to them. Their means in 24 parts of the arc
    scatter more than independent readings would.
    """
    parts = np.digitize(angle, np.quantile(angle, np.linspace(0.0, 1.0, 25)[1:-1]))
    means = np.array([away[parts == part].mean() for part in np.unique(parts)])
    each = float(away.var()) / (len(away) / max(len(means), 1))
    ratio = float(means.var()) * len(means) / max(len(means) - 3, 1) / each if each > 0.0 else 1.0
    return math.sqrt(max(1.0, ratio))


def blurred(radius: Measurement, angle: FloatArray, streak: float) -> Measurement:
    """Return a radius with the error that streaks add: they move the bob across the arc, and where it is fast."""
    swung = 0.5 * float(np.ptp(angle))
    return Measurement(radius.value, math.hypot(radius.error, 2.0 * _STREAK * streak / swung**2), radius.unit)


def _columns(time: FloatArray, angle: FloatArray, omega: float) -> FloatArray:
    """Return the columns of harmonics 1 to 3 whose first changes as a square of time; of few readings, harmonic 1.

    Wide swings have 7 harmonics, of which the third changes, too.
    """
    if len(time) <= 24:
        return basis(time, omega)
    if len(time) <= 48:
        return basis(time, omega, 3)
    table = basis(time, omega, 3 if np.ptp(angle) < _WIDE else 7)
    return np.hstack([table, time[:, None] * table[:, [3, 4] if np.ptp(angle) < _WIDE else [3, 4, 7, 8]]])


def _windows(time: FloatArray, angle: FloatArray, error: FloatArray, omega: float
             ) -> list[tuple[FloatArray, FloatArray, float]]:
    """Return by windows: coefficients of :func:`_columns`, their covariance, how far the lesser side is seen [rad]."""
    span = _WINDOW * math.tau / omega
    found = []
    for begin in np.arange(float(time[0]), float(time[-1]), span):
        here = (time >= begin) & (time < begin + span)
        if here.sum() <= 24:
            continue
        table = _columns(time[here] - begin - 0.5 * span, angle[here], omega) / error[here, None]
        inverse = np.asarray(np.linalg.pinv(table.T @ table), dtype=np.float64)
        found.append((inverse @ (table.T @ (angle[here] / error[here])), inverse,
                      float(min(angle[here].max(), -angle[here].min()))))
    return found


def middle_of(time: FloatArray, angle: FloatArray, error: FloatArray, omega: float) -> float | None:
    """Return the middle of a swing [rad]: the constant beside its harmonics, as of :func:`rest_of`; None without one.

    Unlike the middle of turning points, it is the same where one side is hidden.
    """
    found = [(c[0], v[0, 0]) for c, v, _ in _windows(time, angle, error, omega) if 0.0 < v[0, 0] < math.inf]
    if not found:
        return None
    values, variances = np.array(found).T
    away = np.abs(values - np.median(values))
    near = away <= 5.0 * np.maximum(np.sqrt(np.maximum(variances, np.median(variances))), np.median(away))
    return float(np.average(values[near], weights=1.0 / variances[near]))


class Bent(NamedTuple):
    """How a picture bends the angles of a pendulum, ``seen = scale (true + square true² + cube true³)``."""

    square: float
    cube: float
    amplitude: float

    @property
    def scale(self) -> float:
        """Size by which the angles' scale is off [relative]: a tilt by 1/c gives ``cube = (1/c - c)/6``, and the
        perspective of a near camera adds to it or takes from it."""
        return 5.0 * abs(self.cube)

    @property
    def error(self) -> float:
        """Error [rad] of which 1.96 are as large as the largest bend of an angle."""
        return math.hypot(0.5 * self.square * self.amplitude**2, 0.25 * self.cube * self.amplitude**3) / 1.96


def bent_of(time: FloatArray, angle: FloatArray, error: FloatArray, rest: FloatArray, omega: float) -> Bent | None:
    """Return how a camera that looks at an angle, or a lens, bends the swing; None if it does not show.

    A free pendulum's second harmonic is 0 and its third ``-A³/192 - ...``, exactly by the nome q of its elliptic
    functions (Jacobi 1829), in phase with the first; friction makes harmonics out of phase. What else is there, in
    phase, comes from the picture. ``rest``: what a smooth swing leaves of the angles, as of :func:`rest_of`.
    """
    rows, known = [], np.isfinite(rest)
    together = _together(angle[known], rest[known])
    for c, v, seen in _windows(time, angle, error, omega):
        first = complex(c[1], -c[2])
        size = abs(first)
        if seen < 0.9 * size:  # one side is hidden
            continue
        back = (first / size).conjugate()
        square = (complex(c[5], -c[6]) * back**2).real, math.sqrt(0.5 * (v[5, 5] + v[6, 6]))
        cube = (complex(c[7], -c[8]) * back**3).real - _third(size), math.sqrt(0.5 * (v[7, 7] + v[8, 8]))
        rows.append((2.0 * square[0] / size**2, 2.0 * square[1] / size**2, 4.0 * cube[0] / size**3,
                     4.0 * cube[1] / size**3, size))
    if len(rows) < 2:
        return None
    table = np.array(rows)
    values, sigmas = [], []
    for column in (0, 2):
        weight = table[:, column + 1] ** -2
        values.append(float(np.average(table[:, column], weights=weight)))
        sigmas.append(together * float(weight.sum() ** -0.5))
    shows = [abs(value) > max(_SURE * sigma, least) and sigma < 0.6 * least
             for value, sigma, least in zip(values, sigmas, _BENDS, strict=True)]
    if not any(shows):
        return None
    return Bent(values[0] if shows[0] else 0.0, values[1], float(table[:, 4].max()))


def _third(first: float) -> float:
    """Return the third harmonic [rad] of a free pendulum whose first is this [rad]: -8 q^1.5 / (3 (1 + q³))."""
    root = min(first / 4.0, 0.9)  # the lesser root s of 8 s / (1 + s²) = first, s = q^0.5
    root = (1.0 - math.sqrt(max(1.0 - root**2, 0.0))) / root if root > 0.0 else 0.0
    return -8.0 * root**3 / (3.0 * (1.0 + root**6))


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
        table = _columns(time[here] - middle, angle[here], omega) / own[:, None]
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
    factor = max(float(np.quantile(left, 0.95)) / 1.96, 0.3)
    return error * factor, factor


def alone(rest: FloatArray, factor: float) -> NDArray[np.bool_]:
    """Return a mask of the readings that are far off a smooth swing, more than six of the enlarged errors."""
    return np.asarray(np.abs(np.nan_to_num(rest)) > 6.0 * max(factor, 1e-12))
