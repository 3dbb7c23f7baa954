"""Compare the readings of a tracked film with the truth of the drawn film."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from drawn_films import Truth
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares

Array = NDArray[np.float64]
GROSS = 8.0  # times the median distance from the line: such readings tell nothing of its offset and scale


@dataclass(frozen=True)
class Marks:
    """How good the readings are: angles in rad, ``angle(t) = offset + scale truth(t + early) + scatter``."""

    share: float  # readings among the frames in which the bob swings and is seen whole
    found: float  # the same, of readings within half a bob of the truth
    stray: int  # readings at no frame's time
    offset: float
    scale: float
    early: float  # s; a rolling shutter sees the bob when its row is read
    scatter: float  # rms about that line of the readings within half a bob of the truth
    worst: float  # largest distance from that line
    claimed: float  # median of the claimed errors; nan: none
    held: float  # share of readings whose 95 % interval about the line holds the truth; nan: no errors claimed
    period: float  # period of the readings over the true one


def mark(truth: Truth, time: ArrayLike, angle: ArrayLike, error: ArrayLike | None = None) -> Marks:
    """Return the marks of readings; those taken while a hand holds the bob count for nothing."""
    at, read = np.asarray(time, float), np.asarray(angle, float)
    if len(at) < 9:
        return Marks(0.0, 0.0, 0, *[math.nan] * 8)
    said = np.full(len(at), math.nan) if error is None else np.broadcast_to(np.asarray(error, float), at.shape)
    frame = np.abs(truth.time[None, :] - at[:, None]).argmin(axis=1)
    step = float(np.min(np.diff(truth.time)))
    there = np.abs(truth.time[frame] - at) < min(0.002, 0.4 * step)
    free = there & truth.free[frame]
    share = len(set(frame[free & truth.seen[frame]])) / int(np.count_nonzero(truth.seen))
    t, read, true, said = truth.time[frame][free], read[free], truth.angle[frame][free], said[free]
    keep = np.ones(len(read), bool)
    columns = np.stack([np.ones(len(t)), true, CubicSpline(truth.fine_time, truth.fine_angle)(t, 1)], axis=1)
    for _ in range(6):
        line = np.linalg.lstsq(columns[keep], read[keep], rcond=None)[0]
        away = read - columns @ line
        keep = np.abs(away) <= GROSS * max(float(np.median(np.abs(away))), 1e-6)
    away = read - columns @ line
    near = np.abs(away) <= 0.5 * truth.film.bob / truth.film.radius
    found = len(set(frame[free][near & truth.seen[frame[free]]])) / int(np.count_nonzero(truth.seen))
    scatter = float(np.sqrt(np.mean(away[near] ** 2))) if near.any() else math.nan
    held = float(np.mean(np.abs(away) <= 1.96 * said)) if error is not None else math.nan
    claimed = float(np.median(said)) if error is not None else math.nan
    return Marks(share, found, int(np.count_nonzero(~there)), float(line[0]), float(line[1]),
                 float(line[2] / line[1]), scatter,
                 float(np.max(np.abs(away))), claimed, held, _period(truth, t[keep], read[keep]))


def _period(truth: Truth, time: Array, angle: Array) -> float:
    """Return the period of the readings over the true one: the true motion, stretched in time, fitted to them."""
    motion = CubicSpline(truth.fine_time, truth.fine_angle)
    middle = 0.5 * (time[0] + time[-1])

    def away(p: Array) -> Array:
        return np.asarray(p[0] + p[1] * motion(middle + p[2] + (time - middle) * p[3]) - angle)

    return 1.0 / float(least_squares(away, [0.0, 1.0, 0.0, 1.0], x_scale=[0.1, 0.1, 0.01, 0.001]).x[3])
