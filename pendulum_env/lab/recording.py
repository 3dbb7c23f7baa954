"""Recordings of a real pendulum: files read into time [s] and angle [rad], and everything inferred said."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pendulum_env.physics.units import SceneError, file_path, number, shown

from .checked import FloatArray, RecordingError, known_unit, numbers
from .measures import TurningPoints, equilibrium, extremes, noise_level, turning_points
from .table import Table, text_of

__all__ = ["Recording", "RecordingError"]

UNITS = {"deg": math.pi / 180, "rad": 1.0}


@dataclass(frozen=True, eq=False)
class Recording:
    """A recorded swing: ``time`` [s], strictly increasing, and ``angle`` [rad], unwrapped, from the
    equilibrium or wherever the sensor was zeroed; ``source`` names where it came from, ``notes`` say each
    thing that was inferred.

    Raises RecordingError for arrays of different shapes, fewer than 3 points, values that are not finite, or
    times that do not increase.
    """

    time: FloatArray
    angle: FloatArray
    source: str
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.source, str):
            raise RecordingError(f"source must be text, got {shown(self.source)}")
        if not isinstance(self.notes, tuple) or not all(isinstance(note, str) for note in self.notes):
            raise RecordingError(f"{self.source}: notes must be a tuple of texts, got {shown(self.notes)}")
        for name in ("time", "angle"):
            values = numbers(getattr(self, name), f"{self.source}: {name}")
            values.setflags(write=False)
            object.__setattr__(self, name, values)
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
    ) -> Recording:
        """Read a text file: columns time [s] and angle (further ones are ignored), or one angle a line.

        Columns are separated by tab, semicolon, comma or white space; decimal commas, CRLF, a byte-order mark
        and lines starting with # are accepted, and up to two header lines. A file with one column takes its
        rate from ``rate`` [Hz] or its header ("100 Hz", or a line of names, one with "rate" in it, above a
        line of values). ``unit`` is "deg" or "rad"; None: as the header says, otherwise degrees if any
        |angle| > 2 pi, radians if none. ``rate`` also replaces a time column; ``scale`` multiplies the angle.
        Rows with NaN and repeated times are dropped.

        Raises RecordingError, with the line number where one line is at fault.
        """
        _check_options(unit, rate, scale)
        try:
            name = str(file_path(path, "path"))
        except SceneError as error:
            raise RecordingError(str(error)) from None
        table = Table(name, text_of(name))
        time, angle, notes = table.columns(rate)
        lines = np.array([number for number, _ in table.rows])
        keep = np.isfinite(time) & np.isfinite(angle)
        notes += _dropped(lines[~keep], "without a finite time and angle")
        time, angle, lines = time[keep], angle[keep], lines[keep]
        back = np.flatnonzero(np.diff(time) < 0)
        if back.size:
            at = int(back[0])
            found = f"expected a time above {time[at]:g} s, found {time[at + 1]:g} s"
            raise RecordingError(f"{name}: line {lines[at + 1]}: {found}")
        again = np.flatnonzero(np.diff(time) == 0) + 1
        if 2 * len(again) > len(time):
            found = f"{len(again)} of {len(time)} repeat one (decimal commas need tab or ; between columns)"
            raise RecordingError(f"{name}: line {lines[again[0]]}: expected times that increase, {found}")
        notes += _dropped(lines[again], "that repeat a time")
        time, angle = np.delete(time, again), np.delete(angle, again)
        chosen, why = (unit, "as told") if unit is not None else table.unit(angle)
        notes.append(f"unit: {chosen}, {why}")
        notes += [f"scale: angle multiplied by {scale:g}"] if scale != 1.0 else []
        angle = angle * UNITS[chosen]
        unwrapped = np.unwrap(angle)
        jumps = np.count_nonzero(np.abs(np.diff(angle)) > math.pi)
        notes += [f"unwrapped: {jumps} jumps of more than half a turn"] if jumps else []
        return cls(time, (unwrapped if jumps else angle) * scale, Path(name).name, tuple(notes))

    def released(self) -> Recording:
        """The free swing alone: cut before the release, time zero at the turning point where it starts.

        That is the turning point before the first half swing of at least 0.9 times the largest (being pulled
        aside is half as long). A free swing takes as long down as up: where it takes over 1.1 times as long
        down, the hand still held the bob and the turning point after it is taken. A recording that starts
        there is returned as it is.

        Raises RecordingError if there is no half swing.
        """
        start = self._free()
        if start is None:
            raise RecordingError(f"{self.source}: expected a swing that turns back, found none above noise")
        step = float(np.median(np.diff(self.time)))
        if start == 0 and 0 <= self.time[0] < step:
            return self
        zero = float(turning_points(self).time[start - 1] if start else self.time[0])
        keep = self.time >= zero
        cut = f"release: time zero at {zero:g} s, {np.count_nonzero(~keep)} earlier points cut off"
        return replace(self, time=self.time[keep] - zero, angle=self.angle[keep], notes=(*self.notes, cut))

    def centred(self) -> Recording:
        """The angle about its equilibrium: the middle of the free swing's successive turning points
        (``measures.equilibrium``), or, below three of them, the resting value (median of the last tenth, if
        still).

        Raises RecordingError if there is neither.
        """
        start = self._free() or 0
        points = turning_points(self)
        points = TurningPoints(points.time[start:], points.angle[start:], points.error[start:])
        tail = self.angle[-max(3, len(self.angle) // 10) :]
        if len(points.angle) >= 3:
            offset, how = equilibrium(points), f"middle of {len(points.angle)} turning points"
        elif np.ptp(tail) <= 10 * noise_level(self.time, self.angle):
            offset, how = float(np.median(tail)), "resting value"
        else:
            found = f"found {len(points.angle)} and no rest at the end"
            raise RecordingError(f"{self.source}: expected 3 turning points of a free swing, {found}")
        if abs(offset) < 1e-9:
            return self
        said = f"equilibrium: {offset:.6g} rad subtracted ({how})"
        return replace(self, angle=self.angle - offset, notes=(*self.notes, said))

    def _free(self) -> int | None:
        """Number of the extreme (``measures.extremes``) where the free swing starts; None without one."""
        index = extremes(self.time, self.angle)
        size = np.abs(np.diff(self.angle[index]))
        if not len(size):
            return None
        first = int(np.argmax(size >= 0.9 * size.max()))
        turns = np.concatenate([self.time[index[:1]], turning_points(self).time])[first : first + 2]
        half = slice(index[first], index[first + 1] + 1)
        time, angle = self.time[half], self.angle[half] - self.angle[index[first : first + 2]].mean()
        middle = int(np.argmax(angle * angle[-1] > 0))
        across = slice(middle - 1, middle + 1)
        middle_time = time[across] @ np.abs(angle[across][::-1]) / np.abs(angle[across]).sum()
        return first + int(middle_time - turns[0] > 1.1 * (turns[1] - middle_time))


def _dropped(lines: NDArray[np.int_], why: str) -> list[str]:
    return [f"dropped: {len(lines)} lines {why} (the first: line {lines[0]})"] if len(lines) else []


def _check_options(unit: str | None, rate: float | None, scale: float) -> None:
    if unit is not None:
        known_unit(unit, UNITS)
    try:
        if rate is not None:
            number(rate, "rate", above=0.0)
    except SceneError:
        raise RecordingError(f"rate must be a positive number of samples a second, got {shown(rate)}") from None
    try:
        factor = number(scale, "scale")
    except SceneError:
        factor = 0.0
    if not factor:
        raise RecordingError(f"scale must be a finite number other than 0, got {shown(scale)}")
