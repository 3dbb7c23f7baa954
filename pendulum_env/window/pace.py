"""When frames are due: simulated time against the clock. No clock in here."""

from __future__ import annotations

FRAME = 1.0 / 60.0
"""Time between frames, at least [s]."""
LATE = 0.1
"""A window that is so late does not catch up [s]."""


class Pace:
    """The schedule of a window. Steps follow each other without rounding errors adding up."""

    def __init__(self) -> None:
        self._due = self._next = -1e300

    def frames(self, now: float, span: float) -> list[tuple[float, float]]:
        """Frames of a step that takes ``span`` [s] of the clock from ``now`` on, or from the last step's end.

        Each is (share of the step, time when it is due): the last at the end of the step; more before it where the
        step is longer than FRAME; none where frames would follow each other faster.
        """
        start = self._due if self._due > now - LATE else now
        self._due = end = start + span
        if end < self._next:
            return []
        self._next = max(self._next, start) + FRAME if span < FRAME else end
        count = max(1, round(span / FRAME))
        return [(k / count, start + span * k / count) for k in range(1, count + 1)]

    @property
    def due(self) -> float:
        """When the last step ends."""
        return self._due

    def hold(self, now: float) -> None:
        """Time was held until now."""
        self._due = self._next = now
