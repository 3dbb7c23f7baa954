"""Parts of a recording that are left out on request: after a time, between two times, below an amplitude."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.lab.checked import FloatArray, RecordingError, one_number
from pendulum_env.physics.units import shown

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
