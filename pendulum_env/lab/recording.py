"""Recordings of a real pendulum: time [s], angle [rad], and everything inferred said."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from pendulum_env.lab.checked import FloatArray, RecordingError, numbers, one_number
from pendulum_env.lab.noise import noise_level, quantum_level
from pendulum_env.lab.reading import Told, read_file
from pendulum_env.lab.turning import TurningPoints, all_turning_points, equilibrium, extremes
from pendulum_env.physics.units import SceneError, file_path, shown

__all__ = ["Recording", "RecordingError"]

_EVEN = 0.01  # of the usual step: stamps whose steps differ by less are even


@dataclass(frozen=True, eq=False)
class Recording:
    """A recorded swing; printed, it shows what it is and what was inferred.

    Attributes:
        time: [s], strictly increasing.
        angle: [rad], unwrapped, from the equilibrium or wherever the sensor was zeroed.
        source: names where it came from.
        notes: each thing that was inferred or told.
        release: time [s] at which it was cut, in the time of what it was cut from; None: it was not cut.
        zero: angle [rad] that was subtracted to put the equilibrium at 0; None: none was.

    Raises RecordingError for arrays of different shapes, fewer than 3 points, values that are not finite, or
    times that do not increase.
    """

    time: FloatArray
    angle: FloatArray
    source: str
    notes: tuple[str, ...] = ()
    release: float | None = None
    zero: float | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.source, str):
            raise RecordingError(f"source must be text, got {shown(self.source)}")
        if not isinstance(self.notes, tuple) or not all(isinstance(note, str) for note in self.notes):
            raise RecordingError(f"{self.source}: notes must be a tuple of texts, got {shown(self.notes)}")
        for name in ("time", "angle"):
            values = numbers(getattr(self, name), f"{self.source}: {name}")
            values.setflags(write=False)
            object.__setattr__(self, name, values)
        for name in ("release", "zero"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, one_number(getattr(self, name), f"{self.source}: {name}"))
        if self.time.ndim != 1 or self.time.shape != self.angle.shape:
            found = f"found shapes {self.time.shape} and {self.angle.shape}"
            raise RecordingError(f"{self.source}: expected time and angle of one length, {found}")
        if len(self.time) < 3:
            raise RecordingError(f"{self.source}: expected at least 3 points, found {len(self.time)}")
        if not (np.isfinite(self.time).all() and np.isfinite(self.angle).all()):
            raise RecordingError(f"{self.source}: expected finite times and angles, found NaN or inf")
        if not (np.diff(self.time) > 0).all():
            raise RecordingError(f"{self.source}: expected times that increase")

    @classmethod
    def read(
        cls,
        path: str | os.PathLike[str],
        *,
        unit: str | None = None,
        rate: float | None = None,
        scale: float = 1.0,
        columns: str | Sequence[str | int] | None = None,
        separator: str | None = None,
        decimal: str | None = None,
        pivot: Sequence[float] | None = None,
        y_axis: str | None = None,
        time_unit: str | None = None,
        release: float | None = None,
        zero: float | None = None,
    ) -> Recording:
        """Read a text file: columns of time [s] and angle, or of time, x and y of a track, or one angle a line.

        Decimal commas, CRLF, a byte-order mark and lines starting with # are accepted, and up to twelve header lines.
        Rows with NaN and repeated times are dropped. What is not told is inferred, and said in ``notes``.

        Args:
            path: the file.
            unit: "deg" or "rad"; None: as the header says, otherwise degrees if any |angle| > 2 pi or if the readings
                come in steps of more than 0.05, else radians.
            rate: readings a second [Hz], in place of a time column. A file with one column takes it from its header
                ("100 Hz", or a line of names, one with "rate" in it, above a line of values).
            scale: factor of the angle, such as 0.99 for a sensor that shows 1 % too much; negative turns it round.
            columns: (time, angle), (time, x, y) or, with a rate, (angle,), by name or by number from 1; "xy" for a
                track in the columns named x and y, or the first three. None: those that the header names so (a time,
                an angle that is no velocity; x and y), else the first two.
            separator: tab, ";", "," or " " (any white space); None: the first of these that splits a line in numbers.
            decimal: "." or ","; None: either.
            pivot: (x, y) that a track is about, in its unit; None: the centre of the circle that it keeps to.
            y_axis: "up" or "down", where the y of a track grows; None: so that the bob is below the pivot where it is
                fastest. The angle is from straight down, positive to the right.
            time_unit: "s", "ms", "us", "ns", "min" or "h"; None: as the header says, otherwise seconds.
            release: time in the file [s] at which the bob is free; all before is cut, as :meth:`released` does.
            zero: what the file reads at the equilibrium, in its unit (a track: rad), as :meth:`centred` subtracts it.

        Raises RecordingError, with the line number where one line is at fault.
        """
        try:
            name = str(file_path(path, "path"))
        except SceneError as error:
            raise RecordingError(str(error)) from None
        zero = None if zero is None else one_number(zero, "zero")
        found = read_file(name, Told(unit, rate, scale, columns, separator, decimal, pivot, y_axis, time_unit))
        made = cls(found.time, found.angle, Path(name).name, tuple(found.notes))
        made = made if release is None else made.released(release)
        return made if zero is None else made.centred(zero * found.unit)

    @cached_property
    def quantum(self) -> float:
        """Smallest step of a reading [rad], 0 if none is seen: :func:`pendulum_env.lab.quantum_level`."""
        return quantum_level(self.angle)

    @cached_property
    def noise(self) -> float:
        """Standard deviation of a reading [rad], of its quantum too: :func:`pendulum_env.lab.noise_level`."""
        return noise_level(self.time, self.angle)

    @property
    def text(self) -> str:
        """What is recorded, with which rate, quantum and noise, what was inferred, and what would be."""
        steps = np.diff(self.time)
        usual = float(np.median(steps))
        even = np.ptp(steps) < _EVEN * usual
        how = "even" if even else f"uneven: steps of {steps.min():.4g} to {steps.max():.4g} s"
        quantum = f"{math.degrees(self.quantum):.4g} deg" if self.quantum else "none seen"
        lines = [
            f"{self.source}: {len(self.time)} points in {self.time[-1] - self.time[0]:.6g} s",
            f"rate: {1.0 / usual:.6g} Hz, {how}",
            f"quantum: {quantum}; noise: {math.degrees(self.noise):.3g} deg",
            *self.notes,
            *self._to_come(),
        ]
        return "\n  ".join(lines)

    def __str__(self) -> str:
        return self.text

    def _to_come(self) -> list[str]:
        """What :meth:`released` and :meth:`centred` would do."""
        try:
            whole = self.released().centred()
        except RecordingError as error:
            return [f"release and equilibrium: not found ({str(error).removeprefix(f'{self.source}: ')})"]
        names = {"released": "release", "centred": "equilibrium"}
        new = whole.notes[len(self.notes) :]
        return [f"{note}, by {method}()" for method, name in names.items() for note in new if note.startswith(name)]

    def released(self, at: float | None = None) -> Recording:
        """The free swing alone: cut before the release, time zero at the turning point where it starts.

        That is the turning point before the first half swing of at least 0.9 times the largest (being pulled
        aside is half as long). A free swing takes as long down as up: where it takes over 1.1 times as long
        down, the hand still held the bob and the turning point after it is taken. A recording that starts
        there is returned as it is, and so is one that was cut before.

        Args:
            at: time [s] at which to cut, in place of all this.

        Raises RecordingError if there is no half swing, or not 3 points after ``at``.
        """
        if at is not None:
            return self._cut(one_number(at, "release"), ", as told")
        if self.release is not None:
            return self
        start = self._free()
        if start is None:
            raise RecordingError(f"{self.source}: expected a swing that turns back, found none above noise")
        step = float(np.median(np.diff(self.time)))
        if start == 0 and 0 <= self.time[0] < step:
            return self
        zero = float(self._turns.time[start - 1] if start else self.time[0])
        return self._cut(zero)

    def _cut(self, at: float, why: str = "") -> Recording:
        keep = self.time >= at
        left = int(np.count_nonzero(keep))
        if left < 3:
            end = f"the recording ends at {self.time[-1]:g} s"
            raise RecordingError(f"{self.source}: release must leave at least 3 points, {at:g} s leaves {left} ({end})")
        said = f"release: time zero at {at:g} s, {len(keep) - left} earlier points cut off{why}"
        return replace(self, time=self.time[keep] - at, angle=self.angle[keep], notes=(*self.notes, said), release=at)

    def centred(self, zero: float | None = None) -> Recording:
        """The angle about its equilibrium: the middle of the free swing's successive turning points
        (``turning.equilibrium``), or, below three of them, the resting value (median of the last tenth, if
        still). A recording that was centred before is returned as it is.

        Args:
            zero: angle [rad] of the equilibrium, in place of all this.

        Raises RecordingError if there is neither.
        """
        if zero is not None:
            return self._about(one_number(zero, "zero"), "as told")
        if self.zero is not None:
            return self
        start = self._free() or 0
        points = self._turns
        seen = np.flatnonzero(np.isfinite(points.error[start:])) + start
        points = TurningPoints(points.time[seen], points.angle[seen], points.error[seen])
        tail = self.angle[-max(3, len(self.angle) // 10) :]
        if len(points.angle) >= 3:
            offset, how = equilibrium(points), f"middle of {len(points.angle)} turning points"
        elif np.ptp(tail) <= 10 * self.noise:
            offset, how = float(np.median(tail)), "resting value"
        else:
            found = f"found {len(points.angle)} and no rest at the end"
            raise RecordingError(f"{self.source}: expected 3 turning points of a free swing, {found}")
        return self if abs(offset) < 1e-9 else self._about(offset, how)

    def _about(self, zero: float, how: str) -> Recording:
        said = f"equilibrium: {zero:.6g} rad subtracted ({how})"
        return replace(self, angle=self.angle - zero, notes=(*self.notes, said), zero=zero)

    @cached_property
    def _turns(self) -> TurningPoints:
        return all_turning_points(self)

    def _free(self) -> int | None:
        """Number of the extreme (``turning.extremes``) where the free swing starts; None without one."""
        index = extremes(self.time, self.angle)
        size = np.abs(np.diff(self.angle[index]))
        if not len(size):
            return None
        first = int(np.argmax(size >= 0.9 * size.max()))
        turns = np.concatenate([self.time[index[:1]], self._turns.time])[first : first + 2]
        half = slice(index[first], index[first + 1] + 1)
        time, angle = self.time[half], self.angle[half] - self.angle[index[first : first + 2]].mean()
        middle = int(np.argmax(angle * angle[-1] > 0))
        across = slice(middle - 1, middle + 1)
        middle_time = time[across] @ np.abs(angle[across][::-1]) / np.abs(angle[across]).sum()
        return first + int(middle_time - turns[0] > 1.1 * (turns[1] - middle_time))
