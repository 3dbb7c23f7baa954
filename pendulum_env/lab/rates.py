"""Angular velocities of gyroscopes: their axis, their sign and their integral, the angle of the swing."""

from __future__ import annotations

import numpy as np

from pendulum_env.lab.checked import FloatArray, RecordingError, gaps_of

_LOBE = 0.25
"""An angular velocity without sign changes its sign where it falls below this share of the peaks beside it."""


def along_axis(rates: FloatArray, names: list[str]) -> tuple[FloatArray, str]:
    """Return the angular velocity about the axis of the swing, and a note on that axis.

    The axis is the direction in which the readings of all axes scatter most (their first principal component). Each
    axis has a constant bias, which is left in.

    Args:
        rates: readings of one to three axes, shape ``(readings, axes)``.
        names: titles of the axes.
    """
    if rates.shape[1] == 1:
        return rates[:, 0], f"axis: {names[0]}"
    _, _, rows = np.linalg.svd(rates - rates.mean(axis=0), full_matrices=False)
    axis = rows[0] * np.sign(rows[0][np.argmax(np.abs(rows[0]))])
    shares = ", ".join(f"{share:.3f} {name}" for share, name in zip(axis, names, strict=True))
    return np.asarray(rates @ axis), f"axis: the direction of the largest swing, {shares}"


def with_sign(rate: FloatArray) -> FloatArray:
    """Return an absolute angular velocity with the sign of a swing, which changes at every turning point.

    A turning point is the smallest reading between two peaks, if it is below a quarter (_LOBE) of both.
    """
    smooth = np.convolve(np.pad(rate, 1, "edge"), np.ones(3) / 3.0, "valid")
    turns, peak, low, low_at = [], 0.0, np.inf, 0
    for i, value in enumerate(smooth):
        if value < low:
            low, low_at = value, i
        if low < _LOBE * peak and value > max(low / _LOBE, _LOBE * peak):
            turns.append(low_at)
            peak, low = value, value
        elif value > peak:
            peak, low = value, value
    signs = np.ones(len(rate))
    for at in turns:
        signs[at:] *= -1.0
    return signs * rate


def integrated(time: FloatArray, rate: FloatArray) -> FloatArray:
    """Return the angle [rad] of a swing whose angular velocity with a constant bias is known, about its equilibrium.

    The trapezoidal sums of the readings drift by the bias and by their errors. The drift is taken from the middles of
    successive turning points of the sum, as a line through their neighbours.

    Args:
        time: times [s].
        rate: angular velocities [rad/s].

    Raises RecordingError for less than two whole swings, and for a gap, across which the angle is not known.
    """
    if len(gaps_of(time)):
        raise RecordingError("an angular velocity with gaps cannot be integrated; leave out the readings on one side "
                             "of the gap by until= or drop=")
    bias = float(np.median(rate))
    for _ in range(3):
        turns = _passages(time, rate - bias)
        if len(turns) < 5:
            raise RecordingError(f"expected at least two swings of the angular velocity, found {len(turns)} of its "
                                 "zeros")
        sums = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(time) * (rate[1:] + rate[:-1]))])
        ends = np.interp(turns, time, sums)
        middles = 0.25 * (ends[:-2] + 2.0 * ends[1:-1] + ends[2:])
        bias = float(np.polyfit(turns[1:-1], middles, 1)[0])
    angle = sums - bias * time
    ends = np.interp(turns, time, angle)
    middles = 0.25 * (ends[:-2] + 2.0 * ends[1:-1] + ends[2:])
    return np.asarray(angle - np.interp(time, turns[1:-1], middles))


def _passages(time: FloatArray, rate: FloatArray) -> FloatArray:
    """Return the zeros of an angular velocity, one between each two peaks of opposite sign."""
    far = np.flatnonzero(np.abs(rate) > 0.1 * float(np.max(np.abs(rate))))
    changes = np.flatnonzero(rate[far[:-1]] * rate[far[1:]] < 0.0)
    zeros = []
    for i, j in zip(far[changes], far[changes + 1], strict=True):
        slope, start = np.polyfit(time[i:j + 1] - time[i], rate[i:j + 1], 1)
        zeros.append(time[i] - start / slope)
    return np.array(zeros)
