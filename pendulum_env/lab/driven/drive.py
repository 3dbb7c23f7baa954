"""The drive of a log as it acts on the pendulum: held between readings, late by a delay, smoothed by a lag."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def mean_drive(time: Array, drive: Array, edges: Array, delay: float, lag: float) -> Array:
    """Return the mean drive over every interval between successive ``edges`` [s], in the unit of the readings.

    The drive u holds each reading until the next one, acts later by ``delay`` [s], and is smoothed by ``lag s' = u -
    s``. Before the first reading, u and s have the first value. The means are exact: u is constant between readings,
    and the integral of s is the integral of u minus lag times the increase of s.

    Args:
        time, drive: readings of the drive at times that increase [s].
        edges: times that increase [s], one more than there are intervals.
        delay: delay of the drive [s], below 0 if the readings come later than the torque that they measure.
        lag: time constant of the smoothing [s]; 0 for none.
    """
    at = edges - delay
    place = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 1)
    beyond = at - time[place]
    area = np.concatenate([[0.0], np.cumsum(drive[:-1] * np.diff(time))])
    whole = area[place] + drive[place] * beyond
    if lag > 0.0:
        state = lagged(time, drive, lag)
        fade = np.exp(-np.maximum(beyond, 0.0) / lag)
        whole -= lag * (drive[place] + (state[place] - drive[place]) * fade)
    return np.asarray(np.diff(whole) / np.diff(edges))


def lagged(time: Array, drive: Array, lag: float) -> Array:
    """Return s at every reading, the exact solution of ``lag s' = u - s`` for a drive u that holds between readings.

    The state s starts at the value of the first reading.
    """
    from scipy.signal import lfilter

    steps = np.diff(time)
    usual = float(np.mean(steps))
    if np.ptp(steps) < 1e-6 * usual:
        fade = float(np.exp(-usual / lag))
        state, _ = lfilter([1.0 - fade], [1.0, -fade], drive[:-1], zi=[fade * drive[0]])
        return np.concatenate([drive[:1], state])
    values, fades = [float(drive[0])], np.exp(-steps / lag).tolist()
    for u, fade in zip(drive[:-1].tolist(), fades, strict=True):
        values.append(u + (values[-1] - u) * fade)
    return np.array(values)
