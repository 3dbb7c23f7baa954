"""Refuse readings that cannot be the angle of a swing, with the option that says which quantity they are."""

from __future__ import annotations

import math

import numpy as np

from pendulum_env.lab.checked import FloatArray, RecordingError
from pendulum_env.lab.quantities import ANGLE, COUNTS, FORCE, GATE, STANDARD

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
