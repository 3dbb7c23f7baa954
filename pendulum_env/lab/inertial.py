"""Inertial sensors of phones, accelerometers and gyroscopes: their axes, and the angle of the swing.

An accelerometer at the distance r from the pivot feels the specific force (acceleration without that of free fall)
``g cos(theta) + r theta'^2`` along the rod, towards the pivot, and ``g sin(theta) + r theta''`` across it. With
``theta'' = -(g/L) sin(theta)``, the second is ``g (1 - r/L) sin(theta)``: a phone that is itself the bob on a string
feels nothing across but its drag (Vogt & Kuhn 2012, Phys. Teach. 50, 439).

A gyroscope reads the angular velocity about the axis of the swing, which is integrated.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pendulum_env.lab.checked import FloatArray, RecordingError, gaps_of
from pendulum_env.lab.noise import noise_level
from pendulum_env.lab.turning import Angles, all_turning_points, extremes

GRAVITY = 9.81
"""Gravity with which the first estimates are made [m/s²]; a fit takes that of its scene."""
_NEAR_G = 0.25
"""The mean specific force differs from gravity by less than this share, if the readings are in its unit."""
_RESTING = 0.1
"""Standard deviation of the bias of a phone's accelerometer, with which the force at rest is estimated [m/s²]."""
_SWAYS = 0.1
"""The force across the rod is used if it varies by more than this share of the variation along it."""
_BINS = 16
"""Number of means of readings per period of the force, in which its extremes are sought."""
_LATE = 1.5
"""If an extreme comes later than this number of quarters of a period after the last one, one between was missed."""


class Mount(NamedTuple):
    """Direction and distance of an accelerometer on a pendulum.

    Attributes:
        tilt: angle of the reading's direction from that along the rod, towards the motion [rad]: 0 along it, pi/2
            across it; nan for the absolute value of the force.
        ratio: estimate of the distance of the sensor from the pivot, in units of the length of a point pendulum.
        distance: the distance, if it is known [m]; None if a fit must determine it.
        turned: True if a fit must determine the tilt, too, as the force across the rod varies.
    """

    tilt: float
    ratio: float
    distance: float | None = None
    turned: bool = False

    def force(
        self, angle: Any, velocity: Any, acceleration: Any, gravity: Any, distance: Any, tilt: Any
    ) -> Any:
        """Return the readings [m/s²] for a motion: angle [rad], its first two derivatives, gravity, distance and tilt.
        """
        along = gravity * np.cos(angle) + distance * velocity**2
        across = gravity * np.sin(angle) + distance * acceleration
        if math.isnan(self.tilt):
            return np.hypot(along, across)
        return np.cos(tilt) * along + np.sin(tilt) * across

    @property
    def rest(self) -> float:
        """Reading at the equilibrium, in units of gravity."""
        return 1.0 if math.isnan(self.tilt) else math.cos(self.tilt)


class Felt(NamedTuple):
    """Readings [m/s²] of an accelerometer in one direction, its mount, the angle of the swing [rad], and notes."""

    force: FloatArray
    mount: Mount
    angle: FloatArray
    notes: list[str]


def felt(
    time: FloatArray, forces: FloatArray, names: list[str], absolute: bool, distance: float | None
) -> Felt:
    """Return the force in one direction, which a fit compares with the motion, and a first estimate of the angle.

    With several axes, the direction is that of the mean force, along the rod. As the swing decays, this force alone
    determines the distance of the sensor, the amplitude and the length. If the force across the rod varies, a fit also
    determines the angle between the mean force and the rod, to which a bias of the axes contributes.

    Args:
        time: times [s].
        forces: readings of one to three axes [m/s²], with gravity, shape ``(readings, axes)``.
        names: titles of the axes.
        absolute: True if the only column is the absolute value of the force.
        distance: distance of the sensor from the pivot [m], or None.

    Raises RecordingError for forces without gravity, readings with gaps, less than two whole swings, and for a force
    across the rod alone without the distance.
    """
    if len(gaps_of(time)):
        raise RecordingError("the angle does not follow from accelerations with gaps; leave out the readings on one "
                             "side of the gap by until= or drop=")
    size = float(np.linalg.norm(forces.mean(axis=0)))
    if forces.shape[1] == 1 and size < _NEAR_G * GRAVITY:
        return _across_alone(time, forces[:, 0], names[0], distance)
    _check_gravity(size, names)
    if forces.shape[1] == 1:
        force = forces[:, 0] * np.sign(forces[:, 0].mean())
        how = f"axis: {names[0]}, {'the absolute force' if absolute else 'along the string, as it shows gravity'}"
        angle, ratio, count = _from_along(time, force, distance, absolute)
        return Felt(force[:count], Mount(math.nan if absolute else 0.0, ratio, distance), angle[:count],
                    [how, *_cut_note(time, count)])
    along, across, axis, sways = _directions(time, forces)
    shares = ", ".join(f"{share:.3f} {name}" for share, name in zip(axis, names, strict=True))
    try:
        angle, ratio, count = _from_along(time, along, distance, False)
    except RecordingError:
        if distance is None or not sways:
            raise
        return _across_alone(time, across, "the force across the rod", distance)
    where = ("across it, the phone feels a swing, too, as it is not at the bob: the tilt of the axis is fitted" if sways
             else "across it, the phone feels hardly anything, as it is close to the bob")
    return Felt(along[:count], Mount(0.0, ratio, distance, sways), angle[:count],
                [f"axis: along the rod, {shares}; {where}", *_cut_note(time, count)])


def _cut_note(time: FloatArray, count: int) -> list[str]:
    """Return a list with a note on the readings after the first ``count``, if there are any."""
    left = len(time) - count
    return [f"end: {left} readings after {time[count - 1]:.4g} s left out, as the swing is too small to be seen in the "
            "force along the string"] if left else []


def _check_gravity(size: float, names: list[str]) -> None:
    """Raise RecordingError unless the mean force is that of gravity."""
    if abs(size / GRAVITY - 1.0) < _NEAR_G:
        return
    what = " and ".join(names)
    if size < _NEAR_G * GRAVITY:
        raise RecordingError(
            f"the accelerations {what} are without gravity (their mean is {size:.2g} m/s²): they show only the product "
            "of the amplitude and the distance of the phone from the pivot, a small swing far from it or a large one "
            "near it, and a phone takes gravity out by an estimate that lags; record the acceleration with g")
    raise RecordingError(f"the mean of the accelerations {what} is {size:.4g} m/s², not that of gravity, 9.81 m/s²; "
                         "check their unit, or give scale=")


def _directions(time: FloatArray, forces: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, bool]:
    """Return the forces along the rod and across it, in the plane of the swing, the axis along it, a unit vector, and
    True if the force across it varies.

    Only readings between the first and the last turning point count, since a hand holds the bob before.
    """
    axis = _unit(forces.mean(axis=0))
    index = _extremes(time, forces @ axis)[0]
    swing = slice(*np.searchsorted(time, (index[1], index[-1])).tolist()) if len(index) > 4 else slice(None)
    axis = _unit(forces[swing].mean(axis=0))
    beside = forces - np.outer(forces @ axis, axis)
    _, _, rows = np.linalg.svd(beside[swing] - beside[swing].mean(axis=0), full_matrices=False)
    across = _unit(rows[0] - (rows[0] @ axis) * axis)
    spread = float((forces[swing] @ across).std())
    sways = spread > max(_SWAYS * float((forces[swing] @ axis).std()), 3.0 * noise_level(time, forces @ across))
    return np.asarray(forces @ axis), np.asarray(forces @ across), axis, sways


def _extremes(time: FloatArray, force: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the times and values of the alternating extremes of a force that swings, the first one at its beginning.

    Noise is reduced by means over a sixteenth of the force's period, whose loss of height is corrected to fourth order.
    """
    spectrum = np.abs(np.fft.rfft(force - force.mean()))
    cycles = int(np.argmax(spectrum[3:])) + 3 if len(spectrum) > 3 else 1
    size = max(len(force) // (_BINS * cycles), 1)
    count = len(force) // size
    means = [x[:count * size].reshape(count, size).mean(axis=1) for x in (time, force)]
    if size > 1 and count > 2:
        means[1][1:-1] -= np.diff(means[1], 2) * (1.0 - 1.0 / size**2) / 24.0
    series = Angles(*means)
    index, points = extremes(*means), all_turning_points(series)
    if not len(index):
        return np.empty(0), np.empty(0)
    return np.append(means[0][index[0]], points.time), np.append(means[1][index[0]], points.angle)


def _unit(vector: FloatArray) -> FloatArray:
    """Return a vector divided by its length."""
    return np.asarray(vector / np.linalg.norm(vector))


def _from_along(
    time: FloatArray, force: FloatArray, distance: float | None, absolute: bool
) -> tuple[FloatArray, float, int]:
    """Return the angle [rad] that follows from the force along the rod, the estimated ratio r/L, and the number of
    readings up to the last visible swing.

    The force is smallest, ``g cos(A)``, at the turning points and largest, ``g (1 + 2 (r/L) (1 - cos(A)))``, at the
    passages through the bottom. As the swing decays, both approach the force at rest, so their ratio gives r/L, and the
    smallest force the amplitude A. Between these points, the angle is that of the free pendulum of this amplitude,
    ``sin(theta/2) = sin(A/2) cd(u)`` (Jacobi's function), plus the rest of the force, divided by its slope at the
    turning points. Whether the swing begins on the left or on the right is not known.
    """
    from scipy.interpolate import PchipInterpolator
    from scipy.special import ellipj, ellipk

    at, size = _extremes(time, force)
    quarter = float(np.median(np.diff(at)[1:])) if len(at) > 2 else 0.0
    late = np.flatnonzero(np.diff(at)[1:] > _LATE * quarter)
    seen = int(late[0]) + 2 if len(late) else len(at)
    if seen < 8:
        raise RecordingError("expected at least two swings of the acceleration, whose force along the string is "
                             f"smallest at the turning points, found {seen} of its extremes")
    ends = len(late) > 0 or time[-1] > at[-1] + _LATE * quarter
    count = int(np.searchsorted(time, at[seen - 1] + quarter)) if ends else len(time)
    at, size = at[:seen], size[:seen]
    low_first = bool(size[0] < size[1])
    low = np.arange(len(at)) % 2 == (0 if low_first else 1)
    known = None if distance is None else distance / (GRAVITY * (4.0 * quarter / math.tau) ** 2)
    at[0] = max(at[0], 2.0 * at[1] - at[2])  # before, a hand held the bob
    resting, ratio = _resting(at, size, low, known, absolute)
    factor = 1.0 if not absolute else 1.0 - (1.0 - ratio) ** 2
    if not factor > 0.0:
        raise RecordingError("the absolute acceleration is smallest at the bottom, which is impossible for a phone on "
                             "a pendulum; give the three axes instead")
    amplitude = _envelope(time, at[low], (resting - size[low]) / (GRAVITY * factor))
    phase = np.interp(time, at, np.arange(len(at)), left=0.0)
    inside = (time >= at[0]) & (time <= at[-1])
    phase[inside] = PchipInterpolator(at, np.arange(len(at)))(time[inside])
    after = time > at[-1]
    phase[after] = len(at) - 1 + (time[after] - at[-1]) / quarter
    half = np.sin(0.5 * amplitude)
    _, cn, dn, _ = ellipj(ellipk(half**2) * (phase + (0.0 if low_first else 1.0)), half**2)
    angle = 2.0 * np.arcsin(half * cn / dn)
    along = np.cos(angle) * (1.0 + 2.0 * ratio) - 2.0 * ratio * np.cos(amplitude)
    model = GRAVITY * (np.hypot(along, (1.0 - ratio) * np.sin(angle)) if absolute else along)
    slope = GRAVITY * (1.0 + 2.0 * ratio) * factor * np.maximum(np.sin(amplitude), 1e-3)
    rest = np.where(time >= at[1], force - (model + resting - GRAVITY), 0.0)
    return np.asarray(angle + rest / slope), ratio, count


def _envelope(time: FloatArray, at: FloatArray, heights: FloatArray) -> FloatArray:
    """Return the amplitude [rad] at all times from ``1 - cos(A)`` at some turning points.

    Its logarithm is a polynomial in time, of the third degree for twelve turning points or more, since the force at
    single turning points is uncertain where the amplitude is small.
    """
    seen = np.clip(heights, 1e-6, 1.99)
    scale = float(np.ptp(at)) or 1.0
    fitted = np.polyfit((at - at[0]) / scale, np.log(seen), min(3, (len(at) - 1) // 4), w=seen)
    inside = np.clip(time, at[0], at[-1])
    return np.asarray(np.arccos(1.0 - np.clip(np.exp(np.polyval(fitted, (inside - at[0]) / scale)), 1e-6, 1.99)))


def _resting(
    at: FloatArray, size: FloatArray, low: Any, known: float | None, absolute: bool
) -> tuple[float, float]:
    """Return the force at rest [m/s²] and the ratio r/L, from the smallest and the largest forces of a decaying swing.

    ``known`` is the ratio, or None if it is to be estimated. The force at rest is taken to be that of gravity to
    0.1 m/s² (_RESTING).
    """
    from scipy.optimize import least_squares

    high, place = size[~low], at[~low]
    inner = (place > at[low][0]) & (place < at[low][-1]) & (place > at[1])
    high, below = high[inner], np.interp(place[inner], at[low], size[low])
    scatter = max(float(np.std(np.diff(size[low], 2))) / math.sqrt(6.0) if len(size[low]) > 4 else 0.0, 1e-3)

    def excess(ratio: float) -> float:
        return 2.0 / (2.0 - min(ratio, 1.9)) if absolute else 2.0 * ratio

    def misses(x: FloatArray) -> FloatArray:
        ratio = x[1] if known is None else known
        off = (high - x[0] - excess(ratio) * (x[0] - below)) / scatter
        return np.append(off, [(x[0] - GRAVITY) / _RESTING, (x[1] - 1.0) / 3.0])

    found = least_squares(misses, [max(GRAVITY, float(np.median(below))), 1.0 if known is None else known],
                          bounds=([0.0, 1e-3], [np.inf, 1.9 if absolute else 30.0]))
    return float(found.x[0]), float(found.x[1]) if known is None else known


def _across_alone(time: FloatArray, force: FloatArray, name: str, distance: float | None) -> Felt:
    """Return the readings of a force across the rod alone, ``g (1 - r/L) sin(theta)``, for a known distance r."""
    middle = force - float(np.median(force))
    points = all_turning_points(Angles(time, middle))
    if distance is None:
        raise RecordingError(
            f"{name!r} shows no gravity, so it is either across the rod, where the reading is g (1 - r/L) sin(theta), "
            "or an acceleration without g; the first is read if sensor= gives the distance r of the phone from the "
            "pivot in m, the second shows only the product of amplitude and distance: record it with g")
    if len(points.time) < 5:
        raise RecordingError(f"expected at least two swings of {name!r}, found {len(points.time)} turning points")
    length, amplitude = GRAVITY * (2.0 * float(np.median(np.diff(points.time))) / math.tau) ** 2, 0.0
    period = math.tau * math.sqrt(length / GRAVITY)
    for _ in range(20):
        share = GRAVITY * (1.0 - distance / length)
        if abs(share) < 0.02 * GRAVITY or float(np.median(np.abs(points.angle))) > 0.95 * abs(share):
            raise RecordingError(f"a phone {distance:g} m from the pivot of a pendulum of {length:.3g} m would feel at "
                                 f"most {abs(share):.2g} m/s² across the rod; check sensor= and the unit")
        amplitude = math.asin(float(np.median(np.abs(points.angle))) / abs(share))
        length = GRAVITY * (period / (1.0 + amplitude**2 / 16.0) / math.tau) ** 2
    angle = np.arcsin(np.clip(middle / share, -0.999, 0.999))
    return Felt(force, Mount(0.5 * math.pi, distance / length, distance), angle,
                [f"axis: {name}, across the rod, as it shows no gravity"])


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
