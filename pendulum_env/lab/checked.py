"""Checks of the arguments of measurements: numbers, arrays, series, words, and parts of a recording to leave out.

All raise RecordingError. The parts are those after a time, between two times, or below an amplitude.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.checks import float_array
from pendulum_env.common.texts import NOTE, clean
from pendulum_env.physics.angles import SEE
from pendulum_env.physics.units import SceneError, file_path, number, shown, whole_number

FloatArray = NDArray[np.float64]

GAP = 5.0
"""Time steps longer than this many median steps count as gaps in a recording."""


T = TypeVar("T")


class RecordingError(ValueError):
    """Error for a recording that cannot be read, used or measured; names the place, the expected and the actual value.

    The message is one line, whatever stands in the file or in its name.
    """

    def __init__(self, message: str) -> None:
        super().__init__(clean(message, None))


def file_name(path: Any) -> str:
    """Return the path of a file as text; RecordingError for what is no path."""
    try:
        return str(file_path(path, "path"))
    except SceneError as error:
        raise RecordingError(str(error)) from None


def one_number(value: Any, name: str, **limits: Any) -> float:
    """Return a number if it is finite and within the limits of :func:`pendulum_env.physics.units.number`.

    Raises RecordingError for any other value.
    """
    try:
        return number(value, name, **limits)
    except SceneError as error:
        raise RecordingError(str(error)) from None


def numbers(values: Any, name: str) -> FloatArray:
    """Return an array of numbers as float64; RecordingError for anything else."""
    try:
        return float_array(values)
    except TypeError:
        raise RecordingError(f"{name} must be an array of numbers, got {shown(values)}") from None


def check_origin(record: Any, arrays: Iterable[str]) -> None:
    """Clean the source and the notes of a frozen record, and make read-only float64 arrays of its named attributes.

    Raises RecordingError for a source or notes that are not texts, and for attributes that are not numbers.
    """
    if not isinstance(record.source, str):
        raise RecordingError(f"source must be text, got {shown(record.source)}")
    if not isinstance(record.notes, tuple) or not all(isinstance(note, str) for note in record.notes):
        raise RecordingError(f"{clean(record.source)}: notes must be a tuple of texts, got {shown(record.notes)}")
    object.__setattr__(record, "source", clean(record.source))
    object.__setattr__(record, "notes", tuple(clean(note, NOTE) for note in record.notes))
    for name in arrays:
        values = numbers(getattr(record, name), f"{record.source}: {name}")
        values.setflags(write=False)
        object.__setattr__(record, name, values)


def readings(time: Any, angle: Any) -> tuple[FloatArray, FloatArray]:
    """Return times [s] and angles [rad] as float64 arrays; RecordingError unless they are finite and of one length."""
    times, angles = numbers(time, "time"), numbers(angle, "angle")
    if times.ndim != 1 or times.shape != angles.shape:
        shapes = f"{times.shape} and {angles.shape}"
        raise RecordingError(f"time and angle must be arrays of one length, got shapes {shapes}")
    if not (np.isfinite(times).all() and np.isfinite(angles).all()):
        raise RecordingError("time and angle must be finite, got NaN or inf")
    return times, angles


def series_of(series: Any) -> tuple[FloatArray, FloatArray]:
    """Return the times [s] and angles [rad] of a recording, a rollout or another object with ``time`` and ``angle``.

    Raises RecordingError unless both are finite arrays of one length.
    """
    if not (hasattr(series, "time") and hasattr(series, "angle")):
        raise RecordingError("a series must have time and angle, like a recording or a rollout, "
                             f"got {shown(series)}")
    return readings(series.time, series.angle)


def gaps_of(time: FloatArray, least: float = 0.0) -> NDArray[np.intp]:
    """Return the indices of the readings before a gap: a time step above 5 (GAP) median steps and above ``least`` [s].
    """
    steps = np.diff(time)
    return np.flatnonzero(steps > max(GAP * float(np.median(steps)), least)) if len(steps) else np.empty(0, np.intp)


def count(n: Any, what: str, name: str = "n") -> int | None:
    """Check and return ``n``, the number of things to use, None for all; error messages call the things ``what``."""
    try:
        return None if n is None else whole_number(n, name)
    except SceneError:
        raise RecordingError(f"{name} must be a whole number of {what} from 1, got {shown(n)}") from None


def side(what: str, make: Callable[[], T]) -> tuple[T | None, str]:
    """Return a side quantity of a measurement or fit and "", or None and a sentence that it is left out, and why.

    A result must not be lost because something beside it cannot be calculated or drawn. SceneError is raised, as the
    caller's values are then wrong.
    """
    try:
        return make(), ""
    except SceneError:
        raise
    except (ValueError, ArithmeticError, LookupError, RuntimeError) as error:
        reason = str(error).strip().removesuffix(".") or type(error).__name__
        return None, f"Left out: {what}, because {reason}."


def known(value: Any, name: str, allowed: Iterable[str]) -> str:
    """Return a word if it is one of the allowed ones; RecordingError, which suggests the nearest word, for any other.
    """
    words = list(allowed)
    if isinstance(value, str) and value in words:
        return value
    near = difflib.get_close_matches(str(shown(value)), words, 1, 0.3)
    hint = f" (did you mean {near[0]!r}?)" if near else ""
    raise RecordingError(f"{name} must be {' or '.join(map(repr, words))}, got {shown(value)}{hint}")


def check_half_turn(angle: FloatArray, what: str) -> None:
    """Raise RecordingError if an angle [rad] is half a turn or more; ``what`` begins its sentence, as "a fit needs"."""
    largest = float(np.max(np.abs(angle)))
    if largest >= math.pi:
        raise RecordingError(
            f"{what} swings below half a turn, but the bob goes over the top: read as radians, {largest:.3g} is "
            f"{math.degrees(largest):.3g}°. If the readings are degrees, give unit=deg (--unit deg); if they "
            f"are angular velocities, columns=\"time=1,rate=2\" (--columns time=1,rate=2); {SEE}.")


def chosen(name: str, what: str, parts: Sequence[str], part: str | None, best: Sequence[str] = ()) -> str:
    """Return the part of a file to read: the given one, the only one, or the only one of the ``best``.

    ``what`` names the parts, as "sheet". Raises RecordingError if there is none, or several and none is given.
    """
    if part is not None:
        if part not in parts:
            raise RecordingError(f"{name}: there is no {what} {shown(part)}; there are {', '.join(parts) or 'none'}")
        return part
    if len(parts) == 1 or len(best) == 1:
        return (parts if len(parts) == 1 else best)[0]
    if not parts:
        raise RecordingError(f"{name}: expected a {what} with numbers, found none")
    raise RecordingError(f"{name}: expected one {what} with numbers, found {', '.join(parts)}; choose one by part=")


Drop = str | Sequence[float] | Sequence[str] | Sequence[Sequence[float]]
"""Times between which readings are left out: "12.5:13.1", (12.5, 13.1), or several of them."""


def kept(
    source: str, time: FloatArray, until: float | None, drop: Drop | None
) -> tuple[NDArray[np.bool_], list[str]]:
    """Return a mask of the readings that stay, and notes.

    Left out are the readings after ``until`` [s] and those between the times ``drop`` [s]. Raises RecordingError if
    fewer than 3 remain.
    """
    keep, notes = np.ones(len(time), dtype=np.bool_), []
    if until is not None:
        end = one_number(until, "until")
        keep &= time <= end
        notes.append(f"until: {np.count_nonzero(~keep)} readings after {end:g} s left out, as given")
    for first, last in () if drop is None else spans(drop):
        lost = keep & (time >= first) & (time <= last)
        keep &= ~lost
        notes.append(f"drop: {np.count_nonzero(lost)} readings from {first:g} to {last:g} s left out, as given")
    if notes and np.count_nonzero(keep) < 3:
        raise RecordingError(f"{source}: until and drop must leave at least 3 readings of {len(keep)}")
    return keep, notes


def spans(drop: Drop) -> list[tuple[float, float]]:
    """Return the pairs of times [s] of ``drop``; RecordingError unless they are numbers, the earlier first."""
    given = drop.split(",") if isinstance(drop, str) else drop
    parts: list[Any] = list(given) if isinstance(given, Sequence) else [given]
    if len(parts) == 2 and not any(isinstance(part, (str, Sequence)) for part in parts):
        parts = [parts]
    found = []
    for part in parts or [None]:
        try:
            first, last = (float(end) for end in (part.split(":") if isinstance(part, str) else part))
        except (TypeError, ValueError):
            first, last = 0.0, -1.0
        if not first <= last:
            raise RecordingError("drop must be two times in s, the earlier first, as in '12.5:13.1', or several of "
                                 f"them, got {shown(drop)}")
        found.append((first, last))
    return found


def share(above: float | str) -> float:
    """Return a share of the first amplitude, such as 0.05 or "5%"; RecordingError unless it is between 0 and 1."""
    text = above.strip() if isinstance(above, str) else ""
    try:
        value = float(text.removesuffix("%")) * (0.01 if text.endswith("%") else 1.0) if text else above
    except ValueError:
        value = above
    if isinstance(value, (int, float)) and not isinstance(value, bool) and 0.0 < value < 1.0:
        return float(value)
    raise RecordingError(f"above must be a share of the first amplitude between 0 and 1, as 0.05 or '5%', got "
                         f"{shown(above)}")
