"""Checks of what measurements are given: numbers, arrays, series and words, each with a RecordingError."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.physics.arrays import float_array
from pendulum_env.physics.units import SceneError, number, shown, whole_number

FloatArray = NDArray[np.float64]

GAP = 5.0
"""Usual steps that make a gap."""


class RecordingError(ValueError):
    """A recording that can't be read, used or measured: where, what was expected and what was found."""


def one_number(value: Any, name: str, **limits: Any) -> float:
    """A finite number within limits, as :func:`pendulum_env.physics.units.number` has them; RecordingError for another.
    """
    try:
        return number(value, name, **limits)
    except SceneError as error:
        raise RecordingError(str(error)) from None


def numbers(values: Any, name: str) -> FloatArray:
    """An array of numbers as float64; RecordingError for anything else."""
    try:
        return float_array(values)
    except TypeError:
        raise RecordingError(f"{name} must be an array of numbers, got {shown(values)}") from None


def readings(time: Any, angle: Any) -> tuple[FloatArray, FloatArray]:
    """Times [s] and angles [rad]; RecordingError unless they are finite, and arrays of one length."""
    times, angles = numbers(time, "time"), numbers(angle, "angle")
    if times.ndim != 1 or times.shape != angles.shape:
        shapes = f"{times.shape} and {angles.shape}"
        raise RecordingError(f"time and angle must be arrays of one length, got shapes {shapes}")
    if not (np.isfinite(times).all() and np.isfinite(angles).all()):
        raise RecordingError("time and angle must be finite, got NaN or inf")
    return times, angles


def series_of(series: Any) -> tuple[FloatArray, FloatArray]:
    """The same of what has both, a recording or a rollout."""
    if not (hasattr(series, "time") and hasattr(series, "angle")):
        raise RecordingError(f"a series must have time and angle, as a recording or a rollout, got {shown(series)}")
    return readings(series.time, series.angle)


def gaps_of(time: FloatArray, least: float = 0.0) -> NDArray[np.intp]:
    """Numbers of the times before a gap: a step of more than GAP times the median one, and ``least`` [s]."""
    steps = np.diff(time)
    return np.flatnonzero(steps > max(GAP * float(np.median(steps)), least)) if len(steps) else np.empty(0, np.intp)


def count(n: Any, what: str) -> int | None:
    """A number of ``what``, from 1; None for all."""
    try:
        return None if n is None else whole_number(n, "n")
    except SceneError:
        raise RecordingError(f"n must be a whole number of {what} from 1, got {shown(n)}") from None


def known(value: Any, name: str, allowed: Iterable[str]) -> str:
    """A word that is allowed; RecordingError with the near one for another."""
    words = list(allowed)
    if isinstance(value, str) and value in words:
        return value
    near = difflib.get_close_matches(str(shown(value)), words, 1, 0.3)
    hint = f" (did you mean {near[0]!r}?)" if near else ""
    raise RecordingError(f"{name} must be {' or '.join(map(repr, words))}, got {shown(value)}{hint}")
