"""Readings that are not those of a swing: other quantities are refused, and jumps of a sensor's zero are corrected.

A refusal names the option that says which quantity the readings are. A zero jumps where, for example, a tracker loses
the bob and follows a point beside it.
"""

from __future__ import annotations

import math

import numpy as np

from pendulum_env.lab.checked import FloatArray, RecordingError
from pendulum_env.lab.fitting.statistics import bic, correlation_time
from pendulum_env.lab.noise import noise_level
from pendulum_env.lab.quantities import ANGLE, COUNTS, FORCE, GATE, STANDARD
from pendulum_env.lab.turning import Angles, all_turning_points

_TURN = 360.0
_WIDE = 3
"""Fewest swings in succession of more than a turn each, which no free pendulum makes; the first may be a release."""
_HEAVY = 0.05
"""Readings look like an acceleration if their mean differs from gravity by less than this share."""
_STEADY = 0.2
"""Largest relative scatter of the size of an acceleration with three axes."""
_CLEAR = 0.05
"""A swing counts if it moves by more than this share of the range of the readings."""


def refuse_other_numbers(name: str, values: FloatArray, column: int, unit: str) -> None:
    """Raise RecordingError if readings whose unit nobody names cannot be the angle of a swing in ``unit``.

    A swing is within a turn of the sensor's zero and turns back before it has made a whole turn. An acceleration stays
    about that of gravity, in m/s², g or mg.

    Args:
        name: name of the file.
        values: readings as written.
        column: number of their column, from 1.
        unit: unit that was inferred, "deg" or "rad".
    """
    if set(np.unique(values).tolist()) == {0.0, 1.0}:
        raise RecordingError(f"{name}: column {column} holds nothing but 0 and 1, as {GATE.name} does: {GATE.remedy}; "
                             f"for an angle give unit={unit}")
    low, high = float(values.min()), float(values.max())
    degrees = np.degrees(values * ANGLE.units[unit].size)
    far = float(np.abs(degrees).min()) > _TURN
    if far or _turns_over(degrees):
        why = "which are more than a turn from 0" if far else "which swing by more than a turn"
        raise RecordingError(f"{name}: readings from {low:g} to {high:g}, {why}, cannot be a swing's angle in {unit}; "
                             f"for counts of an encoder {COUNTS.remedy}; {_as_force(column)}; for an angle give "
                             f"unit={unit}")
    heavy = _gravity_in(float(values.mean()))
    if heavy and low * high > 0.0:
        raise RecordingError(f"{name}: readings from {low:g} to {high:g} about {float(values.mean()):.4g} may be an "
                             f"acceleration in {heavy} or an angle; {_as_force(column)}; for an angle give unit={unit}")


def refuse_axes_of_gravity(name: str, values: FloatArray) -> None:
    """Raise RecordingError if three untitled columns, from column 2 on, are the axes of an acceleration."""
    size = np.linalg.norm(values, axis=1)
    heavy = _gravity_in(float(size.mean())) if len(size) else ""
    if heavy and float(size.std()) < _STEADY * float(size.mean()):
        raise RecordingError(f"{name}: columns 2 to 4 are of the size {float(size.mean()):.4g}, as three axes of an "
                             f"acceleration in {heavy} are; write the titles t,ax,ay,az above them, or choose by "
                             "columns='time=1,angle=2' if one of them is an angle")


def _gravity_in(mean: float) -> str:
    """Return the unit in which a mean reading is that of gravity, "" if there is none."""
    return next((unit for unit, one in FORCE.units.items() if abs(abs(mean) * one.size / STANDARD - 1.0) < _HEAVY), "")


def _as_force(column: int) -> str:
    return f"for an acceleration choose by columns='time=1,acceleration={column}'"


def _turns_over(degrees: FloatArray) -> bool:
    """Return True if successive swings each cover more than a turn."""
    clear = max(_CLEAR * float(np.ptp(degrees)), 1e-300)
    turns, last, direction = [float(degrees[0])], float(degrees[0]), 0.0
    for value in degrees.tolist():
        if (value - last) * direction >= 0.0 and value != last:
            direction, last = (direction or math.copysign(1.0, value - last)), value
        elif abs(value - last) > clear:
            turns.append(last)
            direction, last = -direction, value
    size = np.abs(np.diff([*turns, last]))
    wide = np.concatenate([[0], (size > _TURN).astype(int), [0]])
    edges = np.flatnonzero(np.diff(wide))
    return bool(len(edges)) and int((edges[1::2] - edges[::2]).max()) >= _WIDE


_MOST = 5
"""Largest number of jumps that are corrected."""
_SUDDEN = 8.0
"""A step is sudden if it exceeds its neighbours by this number of noise levels, and of usual excesses."""
_LEAST = 2
"""Fewest middles of three turning points on either side of a jump."""
_ALIKE = 0.25
"""After a correction, the middles on both sides of a jump differ by less than this share of it."""
_GAIN = 10.0
"""Fall of the Bayesian information criterion by which a step must improve a swing about it."""
_NEAR = 12
"""Number of middles on either side of a jump from which the zero on that side is computed, as their median."""


def without_jumps(time: FloatArray, angle: FloatArray) -> tuple[FloatArray, list[str]]:
    """Return the angles [rad] of a swing without jumps of its zero, and a note on each.

    At a jump, two successive readings differ by much more than those beside them predict, and the middles of successive
    turning points differ by as much before and after it. The medians of these middles give its size. It is subtracted
    only if a swing with a step has a lower Bayesian information criterion than one without, in the readings within half
    a period of it. The readings before the first jump stay as they are.
    """
    notes: list[str] = []
    for _ in range(_MOST):
        jump = _clearest(time, angle)
        if jump is None:
            break
        at, size = jump
        angle = _moved(angle, at, size)
        notes.append(f"zero: a jump of {np.degrees(size):.3g} degrees after {time[at]:.4g} s, subtracted from all "
                     "later readings (--no-jumps or jumps=False leaves it in)")
    return angle, notes


def _clearest(time: FloatArray, angle: FloatArray) -> tuple[int, float] | None:
    """Return the index of the reading before the largest jump of the zero and its size [rad]; None without any."""
    steps = np.diff(angle)
    if len(steps) < 8:
        return None
    extra = np.zeros(len(steps))
    extra[1:-1] = steps[1:-1] - 0.5 * (steps[:-2] + steps[2:])
    size = np.abs(extra)
    least = _SUDDEN * max(float(np.quantile(size, 0.75)), noise_level(time, angle))
    for at in np.argsort(-size)[:3].tolist():
        if size[at] > least:
            offset = _offset(time, _moved(angle, at, float(extra[at])), float(time[at]))
            if offset is None or abs(offset[0]) >= _ALIKE * size[at]:
                continue
            if _gained(time, angle, at, offset[1]) > _GAIN:
                return at, float(extra[at]) + offset[0]
    return None


def _offset(time: FloatArray, angle: FloatArray, moment: float) -> tuple[float, float] | None:
    """Return by how much the middles of turning points after a moment exceed those before it, and the duration of a
    half swing [s]; None for too few."""
    points = all_turning_points(Angles(time, angle))
    if len(points.time) < 2 * _LEAST + 4:
        return None
    middle = 0.25 * (points.angle[:-2] + 2.0 * points.angle[1:-1] + points.angle[2:])
    before, after = points.time[2:] < moment, points.time[:-2] > moment
    if min(np.count_nonzero(before), np.count_nonzero(after)) < _LEAST:
        return None
    return (float(np.median(middle[after][:_NEAR]) - np.median(middle[before][-_NEAR:])),
            float(np.median(np.diff(points.time))))


def _gained(time: FloatArray, angle: FloatArray, at: int, half: float) -> float:
    """Return by how much a step after the index ``at`` lowers the information criterion of the swing about it.

    The swing is an oscillation with half swings of ``half`` [s] whose amplitude changes linearly, and its third
    overtone. A step has two parameters, its size and its time.
    """
    near = np.flatnonzero(np.abs(time - time[at]) <= half)
    phase = math.pi / half * (time[near] - time[at])
    wave = np.exp(1j * phase)
    columns = np.stack([np.ones(len(near)), wave.real, wave.imag, phase * wave.real, phase * wave.imag,
                        (wave**3).real, (wave**3).imag, near > at], axis=1)
    left = [angle[near] - part @ np.linalg.lstsq(part, angle[near], rcond=None)[0]
            for part in (columns[:, :-1], columns)]
    without, with_step = (float(one @ one) for one in left)
    count = len(near)
    effective = count / correlation_time(left[1])
    return bic(without, count, 7, effective) - bic(with_step, count, 9, effective)


def _moved(angle: FloatArray, at: int, size: float) -> FloatArray:
    """Return angles of which those after the index ``at`` are lower by ``size``."""
    return np.concatenate([angle[:at + 1], angle[at + 1:] - size])
