"""Recordings of a real pendulum: times [s], angles [rad], and notes on everything that was inferred from the file."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.results import Plotted, one_line
from pendulum_env.lab.checked import Drop, FloatArray, RecordingError, check_origin, file_name, kept, one_number, share
from pendulum_env.lab.inertial import Mount
from pendulum_env.lab.measures import Measurement
from pendulum_env.lab.noise import noise_level, quantum_level
from pendulum_env.lab.reading import ReadOptions, read_file
from pendulum_env.lab.turning import TurningPoints, all_turning_points, equilibrium, extremes
from pendulum_env.physics.units import shown

__all__ = ["Recording", "RecordingError"]

_HELD = 0.25  # of the first half swing: a bob that is held so long before its turning point is cut there
_EVEN = 0.01  # of the median step: time stamps whose steps vary by less count as even


class Filmed(NamedTuple):
    """How a swing was filmed: number of frames and of readings, frames per second [Hz], longest streak of the bob and
    distance (rms) of its places from the circle about the pivot [pixels], and the roll of the camera [rad].
    """

    frames: int
    readings: int
    rate: float
    streak: float
    off: float
    roll: float


@dataclass(frozen=True, eq=False, repr=False)
class Recording(Plotted):
    """A recorded swing: times and angles, with notes on how they were read; ``print`` shows a summary.

    Attributes:
        time: array [s], strictly increasing.
        angle: array [rad], unwrapped, from the equilibrium or from the sensor's zero.
        source: name of the file or other source, as one line of at most 100 printable characters: a longer one is
            shortened, and bytes that are not UTF-8 become U+FFFD.
        notes: one line for every setting that was inferred or given.
        release: time [s] of the cut at the release, on the clock of the uncut recording; None: not cut.
        zero: angle [rad] that was subtracted to put the equilibrium at 0; None: nothing was subtracted.
        rate: array of angular velocities [rad/s] of a gyroscope, from which the angles were integrated, and which a fit
            compares with the model; None if the angles were recorded.
        force: array of specific forces [m/s²] of an accelerometer, from which the angles were estimated, and which a
            fit compares with the model; None for other sensors.
        mount: direction and distance of an accelerometer; None for other sensors.
        displaced: True if the angles were calculated from a displacement, whose scale a fit determines.
        radius: radius of the circle of a track, in m if its unit is known, with its error; None without a track.
        error: array of standard errors [rad] of the angles, as of a filmed bob; None if they are not known.
        filmed: how it was filmed; None for other recordings.

    Raises RecordingError for arrays of different shapes, fewer than 3 points, values that are not finite, or
    times that do not increase.
    """

    time: FloatArray
    angle: FloatArray
    source: str
    notes: tuple[str, ...] = ()
    release: float | None = None
    zero: float | None = None
    rate: FloatArray | None = None
    force: FloatArray | None = None
    mount: Mount | None = None
    displaced: bool = False
    radius: Measurement | None = None
    error: FloatArray | None = None
    filmed: Filmed | None = None

    def __repr__(self) -> str:
        return one_line(self, f"{self.source}, {len(self.time)} readings in {self.time[-1] - self.time[0]:.4g} s")

    def __post_init__(self) -> None:
        beside = [name for name in ("rate", "force", "error") if getattr(self, name) is not None]
        check_origin(self, ("time", "angle", *beside))
        for name in ("release", "zero"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, one_number(getattr(self, name), f"{self.source}: {name}"))
        if self.time.ndim != 1 or self.time.shape != self.angle.shape:
            shapes = f"found shapes {self.time.shape} and {self.angle.shape}"
            raise RecordingError(f"{self.source}: expected time and angle of one length, {shapes}")
        for name in beside:
            own = getattr(self, name)
            if own.shape != self.time.shape or not np.isfinite(own).all():
                raise RecordingError(f"{self.source}: expected a finite {name} for each of {len(self.time)} times, "
                                     f"found shape {own.shape}")
        if (self.force is None) != (self.mount is None):
            raise RecordingError(f"{self.source}: force and mount must be given together")
        if self.mount is not None and not isinstance(self.mount, Mount):
            raise RecordingError(f"{self.source}: mount must be a Mount, got {shown(self.mount)}")
        if not isinstance(self.filmed, (Filmed, type(None))):
            raise RecordingError(f"{self.source}: filmed must be that of a recording by track(), or None")
        if not isinstance(self.displaced, bool) or not isinstance(self.radius, (Measurement, type(None))):
            raise RecordingError(f"{self.source}: displaced must be True or False, and radius a Measurement or None")
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
        part: str | None = None,
        run: int | None = None,
        until: float | None = None,
        drop: Drop | None = None,
        sensor: float | None = None,
        release: float | None = None,
        zero: float | None = None,
        jumps: bool = True,
    ) -> Recording:
        """Read a recording from a text file: columns of time [s] and angle, or time, x and y of a track, or one angle
        per line.

        Decimal commas, CRLF, a byte-order mark, lines starting with # and up to twelve header lines are accepted.
        Rows with NaN and repeated times are dropped. Settings that are not given are inferred, and listed in ``notes``.

        Args:
            path: the file.
            unit: "deg" or "rad"; None: as in the header, otherwise degrees if any |angle| > 2 pi or if the readings
                come in steps of more than 0.05, else radians.
            rate: readings per second [Hz], in place of a time column. For a file with one column, the header may give
                the rate ("100 Hz", or a line of names that include "rate" above a line of values).
            scale: factor applied to the angle, such as 0.99 for a sensor that reads 1 % too much; a negative factor
                reverses the direction.
            columns: (time, angle), (time, x, y) or, with a rate, (angle,), by name or by number from 1; "xy" for a
                track in the columns named x and y, or else in the first three; or a text such as "time=2,angle=5".
                None: the columns that the header names
                as a time and an angle (not an angular velocity), or as time, x and y; else the first two.
            separator: tab, ";", "," or " " (any white space); None: the first of these that splits a line into numbers.
            decimal: "." or ","; None: either.
            pivot: (x, y) of a track's pivot, in the unit of the track; None: the centre of the circle fitted to it.
            y_axis: "up" or "down", the direction in which the y of a track grows; None: the direction for which the bob
                is below the pivot where it is fastest. The angle is from straight down, positive to the right.
            time_unit: "s", "ms", "us", "ns", "min" or "h"; None: as in the header, otherwise seconds, or the only unit
                in which the period of the swing is between 0.2 and 20 s.
            part: file in a zip archive, sheet of a workbook, or point mass of a Tracker project, where there are
                several.
            run: number of the run, in a file whose titles name several; None: the first.
            until: time in the file [s] after which readings are left out.
            drop: times in the file [s] between which readings are left out: "12.5:13.1", (12.5, 13.1), or several.
            sensor: distance of an accelerometer from the pivot [m]; None: fitted.
            release: time in the file [s] at which the bob is free; earlier readings are cut, see :meth:`released`.
            zero: reading at the equilibrium, in the unit of the file (a track: rad), see :meth:`centred`.
            jumps: True subtracts jumps of the sensor's zero that stand out clearly, with a note on each; False leaves
                them in.

        Raises RecordingError for a file or setting that cannot be used, with the line number of a faulty line.
        """
        name = file_name(path)
        zero = None if zero is None else one_number(zero, "zero")
        file = read_file(name, ReadOptions(unit, rate, scale, columns, separator, decimal, pivot, y_axis, time_unit,
                                           part, run, sensor, until, drop, jumps))
        recording = cls(file.time, file.angle, Path(name).name, tuple(file.notes), rate=file.rate, force=file.force,
                        mount=file.mount, displaced=file.displaced, radius=file.radius, error=file.error)
        recording = recording if release is None else recording.released(release)
        return recording if zero is None else recording.centred(zero * file.unit)

    @property
    def readings(self) -> FloatArray:
        """Measured quantity, which a fit compares with the model: the angle [rad], its rate [rad/s] or a specific force
        [m/s²]."""
        return self.force if self.force is not None else self.angle if self.rate is None else self.rate

    @property
    def unit(self) -> str:
        """Unit of ``readings``: "rad", "rad/s" or "m/s^2"."""
        return "m/s^2" if self.force is not None else "rad" if self.rate is None else "rad/s"

    @property
    def indirect(self) -> bool:
        """True if the sensor measured another quantity than the angle, from which the angle was calculated."""
        return self.readings is not self.angle

    @cached_property
    def reading_quantum(self) -> float:
        """Smallest step between ``readings``, in their unit; 0 if they show none."""
        return quantum_level(self.readings) if self.indirect else self.quantum

    @cached_property
    def reading_noise(self) -> float:
        """Standard deviation of one of the ``readings``, in their unit, its rounding included."""
        return noise_level(self.time, self.readings) if self.indirect else self.noise

    @cached_property
    def quantum(self) -> float:
        """Smallest step between readings of the sensor [rad], 0 if the readings show none; see
        :func:`pendulum_env.lab.quantum_level`."""
        return quantum_level(self.angle)

    @cached_property
    def noise(self) -> float:
        """Standard deviation of one reading [rad], its rounding included; see :func:`pendulum_env.lab.noise_level`."""
        return noise_level(self.time, self.angle)

    @property
    def text(self) -> str:
        """Summary of the recording: points, duration, rate, resolution, noise, and the settings that were inferred."""
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
            *self._suggestions(),
        ]
        return "\n  ".join(lines)

    def __str__(self) -> str:
        return self.text

    def _suggestions(self) -> list[str]:
        """Return notes on the release and equilibrium that :meth:`released` and :meth:`centred` would use."""
        try:
            centred = self.released().centred()
        except RecordingError as error:
            return [f"release and equilibrium: not found ({str(error).removeprefix(f'{self.source}: ')})"]
        return [f"{note}, before it is measured" for note in centred.notes[len(self.notes) :]
                if note.startswith(("release", "equilibrium"))]

    def released(self, at: float | None = None) -> Recording:
        """Return the free swing: the recording cut at the release, with time 0 at the turning point where it starts.

        The start is the turning point before the first half swing of at least 0.9 times the largest (pulling the bob
        aside covers half as much). A free swing takes as long down as up; if the way down takes over 1.1 times as long,
        the hand still held the bob, and the next turning point is the start. A recording that already starts there, or
        was cut before, is returned unchanged.

        Args:
            at: time [s] at which to cut, in place of the start described above.

        Raises RecordingError if there is no half swing, or if fewer than 3 points remain after ``at``.
        """
        if at is not None:
            return self._cut(one_number(at, "release"), ", as given")
        if self.release is not None:
            return self
        start = self._free()
        if start is None:
            falls = bool(np.all(np.diff(np.abs(self.angle)) < 0.0) and len(set(np.sign(self.angle))) == 1)
            by_hand = ("; readings that only fall look like amplitudes that were noted by hand: lab-pendulum measure "
                       "--amplitudes reads these, in Python lab.measure_amplitudes, and a fit needs the readings "
                       "between them") if falls else ""
            raise RecordingError(f"{self.source}: expected a swing that turns back, found none above noise{by_hand}")
        step = float(np.median(np.diff(self.time)))
        first = float(self.time[extremes(self.time, self.angle)[0]])
        held = len(self._turns.time) > 0 and first - self.time[0] > _HELD * (float(self._turns.time[0]) - first)
        if start == 0 and not held and 0 <= self.time[0] < step:
            return self
        zero = self._turns.time[start - 1] if start else first if held else self.time[0]
        return self._cut(float(zero))

    def _cut(self, at: float, why: str = "") -> Recording:
        """Return the recording from time ``at`` [s] on, with time 0 there and a note on the cut."""
        keep = self.time >= at
        left = int(np.count_nonzero(keep))
        if left < 3:
            end = f"the recording ends at {self.time[-1]:g} s"
            raise RecordingError(f"{self.source}: release must leave at least 3 points, {at:g} s leaves {left} ({end})")
        note = f"release: time zero at {round(at, 4):g} s, {len(keep) - left} earlier points cut off{why}"
        return part_of(self, keep, note, at, release=at)

    def kept(
        self, *, until: float | None = None, drop: Drop | None = None, above: float | str | None = None
    ) -> Recording:
        """Return the recording without some of its readings.

        Args:
            until: time [s] after which readings are left out.
            drop: times [s] between which readings are left out: "12.5:13.1", (12.5, 13.1), or several of them.
            above: share of the first amplitude of the free swing, such as 0.05 or "5%"; readings after the last turning
                point beyond it are left out.

        Raises RecordingError for other values, and if fewer than 3 readings remain.
        """
        keep, notes = kept(self.source, self.time, until, drop)
        part = part_of(self, keep, "; ".join(notes)) if notes else self
        if above is None:
            return part
        least = share(above)
        swing = part.released().centred()
        size, first = swing._turns.amplitude, float(np.max(np.abs(swing.angle)))
        beyond = np.flatnonzero(np.isfinite(swing._turns.error) & (size >= least * first))
        if not len(beyond) or beyond[-1] == len(size) - 1:
            return part
        start = 0.0 if part.release is not None or swing.release is None else swing.release
        end = float(swing._turns.time[beyond[-1]]) + start
        left = int(np.count_nonzero(part.time > end))
        return part_of(part, part.time <= end, f"above: {left} readings after {end:.4g} s left out, where the "
                       f"amplitude is below {100.0 * least:g} % of the first")

    def centred(self, zero: float | None = None) -> Recording:
        """Return the recording with its angle measured from the equilibrium.

        The equilibrium is the middle of the free swing's turning points (``turning.equilibrium``) or, for fewer than
        three turning points, the resting value (the median of the last tenth, if the bob is still there). A recording
        that was centred before is returned unchanged.

        Args:
            zero: angle [rad] of the equilibrium, in place of the one described above.

        Raises RecordingError if there are neither three turning points nor a rest at the end.
        """
        if zero is not None:
            return self._about(one_number(zero, "zero"), "as given")
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
            count = f"found {len(points.angle)} and no rest at the end"
            raise RecordingError(f"{self.source}: expected 3 turning points of a free swing, {count}")
        return self if abs(offset) < 1e-9 else self._about(offset, how)

    def _about(self, zero: float, how: str) -> Recording:
        """Return the recording with ``zero`` [rad] subtracted from its angle, and a note on it."""
        note = f"equilibrium: {zero:.3g} rad subtracted ({how})"
        return replace(self, angle=self.angle - zero, notes=(*self.notes, note), zero=zero)

    @cached_property
    def _turns(self) -> TurningPoints:
        """All turning points of the recording; those hidden by gaps have an infinite error."""
        return all_turning_points(self)

    def _free(self) -> int | None:
        """Return the index in ``turning.extremes`` of the reading where the free swing starts; None without any swing.
        """
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


def part_of(
    recording: Recording, keep: NDArray[np.bool_], note: str, before: float = 0.0, **changes: float
) -> Recording:
    """Return a recording with only the readings in the mask ``keep``, and a further note.

    ``before`` is the time [s] that becomes 0, and ``changes`` are other attributes.
    """
    rate, force, error = (None if own is None else own[keep]
                          for own in (recording.rate, recording.force, recording.error))
    return replace(recording, time=recording.time[keep] - before, angle=recording.angle[keep], rate=rate, force=force,
                   error=error, notes=(*recording.notes, note), **changes)  # type: ignore[arg-type]


def with_readings(recording: Recording, readings: FloatArray, angle: FloatArray) -> Recording:
    """Return a recording with other readings and angles; its resolution stays that of the sensor."""
    changed = {"rate": readings} if recording.rate is not None else {"force": readings} if recording.indirect else {}
    other = replace(recording, angle=angle, **changed)  # type: ignore[arg-type]
    vars(other).update({name: getattr(recording, name) for name in ("quantum", "reading_quantum")})
    return other


def in_words(recording: Recording, reading: float) -> tuple[float, str]:
    """Return a reading in the unit of texts and figures, and that unit: degrees, degrees/s or m/s²."""
    if recording.force is not None:
        return reading, "m/s²"
    return math.degrees(reading), "degrees" if recording.rate is None else "degrees/s"
