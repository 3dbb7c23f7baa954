"""Logs of a driven pendulum: times, angles and the drive beside them (an action, a torque or a motor's current)."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pendulum_env.common.results import one_line
from pendulum_env.common.saved import Savable
from pendulum_env.lab.checked import FloatArray, RecordingError, check_origin, file_name, known, one_number
from pendulum_env.lab.columns import described, place_of
from pendulum_env.lab.containers import text_of
from pendulum_env.lab.driven.start import misfit
from pendulum_env.lab.noise import noise_level, quantum_level
from pendulum_env.lab.quantities import (
    ACTION,
    ANGLE,
    CURRENT,
    DISTANCE,
    RATE_OF_CHANGE,
    TIME,
    TORQUE,
    Quantity,
    pattern,
)
from pendulum_env.lab.table import TextTable
from pendulum_env.physics.angles import SEE

__all__ = ["DRIVES", "DrivenLog", "is_driven"]

LEAST = 30
"""Fewest readings of a log that can be fitted."""


class Drive(NamedTuple):
    """A kind of drive: the unit of its readings, whether they are measured, and the quantity of its column."""

    unit: str
    measured: bool
    quantity: Quantity


DRIVES: dict[str, Drive] = {
    "torque": Drive("N m", True, TORQUE), "current": Drive("A", True, CURRENT), "action": Drive("1", False, ACTION),
}
"""Kinds of drive by name. An action is the commanded share of the motor's largest torque, from -1 to 1."""

_COMMANDED = re.compile(r"(?<![a-z])(?:des|desired|set|ref|target|soll|cmd|goal)(?![a-z])", re.IGNORECASE)
"""Words in the titles of columns with set values, which were not measured."""
UNITS = {name: unit.size for name, unit in ANGLE.units.items()}
_ANGLE = pattern((*ANGLE.words, "*position*", "pos"))
_ANGLE_NAME = re.compile(r"angle|theta|θ|phi|φ|winkel", re.IGNORECASE)
_IN_BRACKETS = re.compile(r"[(\[]([^)\]]*)[)\]]")
_SIZES = {kind: {word: unit.size for unit in drive.quantity.units.values() for word in unit.words}
          for kind, drive in DRIVES.items()}
_COARSE = 0.05
"""Coarser steps are not radians, since no sensor reads in steps of 3 degrees."""
_CLEAR = 2.0
"""A unit of the angle is chosen if the other one fits the motion worse by this factor."""


@dataclass(frozen=True, eq=False, repr=False)
class DrivenLog(Savable):
    """A log of a driven pendulum: angles and the drive at the same times.

    Attributes:
        time: array [s], strictly increasing.
        angle: array [rad], from straight down, without jumps at whole turns.
        drive: array of the action [1], which holds until the next time, or of the measured torque [N m] or current [A].
        kind: "action", "torque" or "current".
        source: name of the file or other source, as in :class:`pendulum_env.lab.recording.Recording`.
        notes: one line for everything that was inferred or given.

    Raises RecordingError for arrays of different shapes, fewer than 30 readings, values that are not finite, times that
    do not increase, an unknown kind, an action beyond ±1 or a drive that never changes.
    """

    time: FloatArray
    angle: FloatArray
    drive: FloatArray
    kind: str = "action"
    source: str = "log"
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_origin(self, ("time", "angle", "drive"))
        known(self.kind, "kind", DRIVES)
        for name in ("time", "angle", "drive"):
            if getattr(self, name).ndim != 1 or not np.isfinite(getattr(self, name)).all():
                raise RecordingError(f"{self.source}: {name} must be an array of finite numbers in one dimension")
        if not len(self.time) == len(self.angle) == len(self.drive):
            found = f"{len(self.time)}, {len(self.angle)} and {len(self.drive)}"
            raise RecordingError(f"{self.source}: time, angle and drive must have one length, found {found}")
        if len(self.time) < LEAST:
            raise RecordingError(f"{self.source}: a driven log needs at least {LEAST} readings, found {len(self.time)}")
        back = np.flatnonzero(np.diff(self.time) <= 0.0)
        if len(back):
            first, then = self.time[back[0]], self.time[back[0] + 1]
            raise RecordingError(f"{self.source}: times must increase, but {then:g} s follows {first:g} s")
        if self.drive.max() == self.drive.min():
            raise RecordingError(f"{self.source}: the {self.kind} is {self.drive[0]:g} in every reading, which moves "
                                 "only the equilibrium, so the motor's part cannot be told from the sensor's zero; for "
                                 "a free swing leave the drive's column out")
        if self.kind == "action" and float(np.abs(self.drive).max()) > 1.0 + 1e-9:
            raise RecordingError(f"{self.source}: an action is a share of the motor's largest torque, within ±1, but "
                                 f"reaches {float(np.abs(self.drive).max()):.4g}; name the column by torque= or "
                                 "current=, or give factor=, which multiplies it")

    def __repr__(self) -> str:
        return one_line(self, f"{self.source}, {len(self.time)} readings in {self.time[-1] - self.time[0]:.4g} s")

    @property
    def unit(self) -> str:
        """Unit of the drive: "1", "N m" or "A"."""
        return DRIVES[self.kind].unit

    @cached_property
    def held(self) -> FloatArray:
        """Drive from each time to the next: the action itself, or the mean of both readings of a measured drive."""
        if not DRIVES[self.kind].measured:
            return self.drive
        return np.append(0.5 * (self.drive[1:] + self.drive[:-1]), self.drive[-1])

    @cached_property
    def quantum(self) -> float:
        """Smallest step between readings of the angle [rad]; 0 if they show none."""
        return quantum_level(self.angle)

    @cached_property
    def noise(self) -> float:
        """Standard deviation of a reading of the angle [rad], its rounding included."""
        return noise_level(self.time, self.angle)

    @property
    def text(self) -> str:
        """Summary of the log: readings, rate, resolution, drive, and inferred settings."""
        usual = float(np.median(np.diff(self.time)))
        quantum = f"{math.degrees(self.quantum):.4g} deg" if self.quantum else "none seen"
        return "\n  ".join((
            f"{self.source}: {len(self.time)} readings in {self.time[-1] - self.time[0]:.6g} s, {1.0 / usual:.6g} Hz",
            f"quantum: {quantum}; noise: {math.degrees(self.noise):.3g} deg",
            f"{self.kind}: {self.drive.min():.4g} to {self.drive.max():.4g} {self.unit.strip('1')}".strip(),
            *self.notes))

    def __str__(self) -> str:
        return self.text

    def between(self, first: float, last: float) -> DrivenLog:
        """Return the part of the log from time ``first`` to ``last`` [s]; RecordingError if it has too few readings."""
        keep = (self.time >= one_number(first, "first")) & (self.time <= one_number(last, "last"))
        note = f"part: {first:g} to {last:g} s"
        return replace(self, time=self.time[keep], angle=self.angle[keep], drive=self.drive[keep],
                       notes=(*self.notes, note))

    @classmethod
    def read(
        cls,
        path: str | os.PathLike[str],
        *,
        action: str | int | None = None,
        torque: str | int | None = None,
        current: str | int | None = None,
        time: str | int | None = None,
        angle: str | int | None = None,
        unit: str | None = None,
        factor: float = 1.0,
        part: str | None = None,
        until: float | None = None,
    ) -> DrivenLog:
        """Read a log from a text file, archive or sheet with columns of time, angle and action, torque or current.

        Columns that are not given are those that the header names, or the columns 1, 2 and 3 of a file without titles
        in which the drive is given. Everything that was inferred is listed in ``notes``.

        Args:
            path: the file.
            action, torque, current: column of the drive, by name or by number from 1; give at most one. An action is a
                share of the motor's largest torque; units of torque (N m, mN m, N cm) and current (A, mA) follow from
                the title.
            time, angle: columns of the time and of the angle, by name or by number from 1.
            unit: "deg" or "rad", the unit of the angle; None: the unit in the header or, without one there, the unit in
                which the motion is that of a pendulum.
            factor: factor for the drive, such as a motor's constant, or -1 for a motor whose positive direction is
                opposite to that of the angle.
            part: file in an archive or sheet of a workbook, where there are several.
            until: time in the file [s] after which readings are left out.

        Raises RecordingError for a file that cannot be read, without a drive or with several, with times that do not
        increase, and if the unit of the angle cannot be inferred.
        """
        name = file_name(path)
        size = one_number(factor, "factor")
        if size == 0.0:
            raise RecordingError("factor must not be 0")
        if unit is not None:
            known(unit, "unit", UNITS)
        text, notes = text_of(name, part)
        table, given = TextTable(name, text), {"action": action, "torque": torque, "current": current}
        kind, places, titles = _layout(table, given, time, angle)
        values, marks = table.values(places, "a time, an angle and a drive")
        whole = np.isfinite(values).all(axis=1)
        notes += [*table.notes, *marks]
        if not whole.all():
            notes.append(f"dropped: {np.count_nonzero(~whole)} rows without all numbers")
        times, angles, drives = values[whole].T
        units = TIME.units_in([titles[places[0]]])
        times = times * TIME.units[units.pop() if len(units) == 1 else "s"].size
        drive_size, why = _drive_unit(name, kind, titles[places[2]])
        shown_as = ", ".join(f"{what} {i + 1}{f' ({titles[i]})' if titles[i] else ''}"
                             for what, i in zip(("time", "angle", kind), places, strict=True))
        chosen = "as given" if given[kind] is not None else "as the header names them"
        notes.append(f"columns: {shown_as}, {chosen}{why}")
        if size != 1.0:
            notes.append(f"factor: {kind} multiplied by {size:g}")
        with np.errstate(over="ignore"):
            drives = drives * drive_size * size
        log = cls(times, angles, drives, kind, Path(name).name)
        log = log if until is None else log.between(-math.inf if len(times) == 0 else float(times[0]), until)
        angles, how = _in_radians(log, titles[places[1]], unit)
        return replace(log, angle=angles, notes=(*notes, *log.notes, how))


def is_driven(path: str | os.PathLike[str]) -> bool:
    """Return True if the header of a file names a time, an angle and just one drive; False for any other file."""
    try:
        name = file_name(path)
        _, places, titles = _layout(TextTable(name, text_of(name)[0]))
    except RecordingError:
        return False
    return all(titles[i] for i in places)


def _layout(
    table: TextTable, given: Mapping[str, Any] | None = None, time: Any = None, angle: Any = None
) -> tuple[str, tuple[int, int, int], list[str]]:
    """Return the kind of drive, the numbers, from 0, of the columns of time, angle and drive, and all titles.

    ``given`` are columns of the drive by its kind, ``time`` and ``angle`` are columns; None is inferred.
    """
    titles = [" ".join(title).strip() for title in table.titles]
    kind, drive = _drive_column(table, titles, {key: one for key, one in (given or {}).items() if one is not None})
    taken = [drive]
    for what, column in (("time", time), ("angle", angle)):
        taken.append(_column(table, titles, what, taken) if column is None else place_of(table, titles, column, what))
    drive, first, second = taken
    if len(set(taken)) < len(taken):
        raise RecordingError(f"{table.name}: time, angle and {kind} must be different columns, got "
                             f"{first + 1}, {second + 1}, {drive + 1}; {described(table, titles)}")
    return kind, (first, second, drive), titles


def _drive_column(table: TextTable, titles: list[str], given: Mapping[str, Any]) -> tuple[str, int]:
    """Return the kind of drive and the number of its column, from 0."""
    if len(given) > 1:
        raise RecordingError(f"{table.name}: give one of action, torque and current, not {' and '.join(given)}")
    for kind, column in given.items():
        return kind, place_of(table, titles, column, kind)
    found = [(kind, i) for kind, drive in DRIVES.items() for i, title in enumerate(titles)
             if drive.quantity.names(title)]
    best = [(kind, i) for kind, i in found if not _COMMANDED.search(titles[i])] or found
    if len(best) == 1:
        return best[0]
    if not best:
        raise RecordingError(f"{table.name}: expected an action, torque or current beside the angle, found none; "
                             f"{described(table, titles)} and action=, torque= or current= for the drive")
    names = " and ".join(f"{kind} in column {i + 1} ({titles[i]})" for kind, i in best)
    raise RecordingError(f"{table.name}: expected one drive, found {names}; choose one by "
                         f"{' or '.join(f'{kind}=' for kind in dict(best))}")


def _column(table: TextTable, titles: list[str], what: str, taken: list[int]) -> int:
    """Return the number, from 0, of the column of the time or angle; without titles, the first free one."""
    free = [i for i in range(table.width) if i not in taken]
    if not any(titles):
        return free[0] if free else 0
    fits = TIME.names if what == "time" else _is_angle
    best = [i for i in free if fits(titles[i]) and not RATE_OF_CHANGE.names(titles[i])]
    best = [i for i in best if not _COMMANDED.search(titles[i])] or best
    if what == "angle" and len(best) > 1:
        best = [i for i in best if _ANGLE_NAME.search(titles[i])] or best
    if len(best) == 1 or (what == "time" and best):
        return best[0]
    problem = f"found columns {', '.join(str(i + 1) for i in best)}" if best else "found none"
    raise RecordingError(f"{table.name}: expected one column of the {what}, {problem}; {described(table, titles)}")


def _is_angle(title: str) -> bool:
    """Return True if a title names an angle, or a position without a unit of length."""
    return bool(_ANGLE.search(title)) and not DISTANCE.units_in([title])


def _drive_unit(name: str, kind: str, title: str) -> tuple[float, str]:
    """Return the size of the unit of a drive's column, in N m, A or 1, and a note where the title has no unit."""
    found = _IN_BRACKETS.search(title)
    if not found:
        return 1.0, "" if kind == "action" else f"; {kind} in {DRIVES[kind].unit}, as the header names no unit"
    unit = re.sub(r"[\s.·*⋅]", "", found[1]).lower()
    if unit not in _SIZES[kind]:
        raise RecordingError(f"{name}: the {kind} is in {found[1]!r}, expected one of "
                             f"{', '.join(filter(None, _SIZES[kind]))}; give factor=, the size of the unit in "
                             f"{DRIVES[kind].unit}, and name the column by its number")
    return _SIZES[kind][unit], ""


def _in_radians(log: DrivenLog, title: str, given: str | None) -> tuple[FloatArray, str]:
    """Return a log's angles in radians, and a note on the unit: given, named by the title, or inferred from the motion.

    Without a unit in the title, the motion decides: a pendulum's ``theta'' = -k sin(theta) + ...`` fits in one unit
    only, unless all angles are small.
    """
    units = ANGLE.units_in([title])
    written = units.pop() if len(units) == 1 else None
    unit, why = given or written, "as given" if given else "as the header says"
    if unit is None:
        unit, why = _likely_unit(log)
    angle = log.angle * UNITS[unit]
    if float(np.ptp(angle)) <= math.tau * (1.0 + 1e-6) and (np.abs(np.diff(angle)) > math.pi).any():
        return np.unwrap(angle), f"unit: {unit}, {why}; whole turns added where the angle jumps"
    return angle, f"unit: {unit}, {why}"


def _likely_unit(log: DrivenLog) -> tuple[str, str]:
    """Return the unit in which the angles of a log are those of a pendulum, and why; RecordingError if both may be.

    If both units fit about equally well, angles within ±2 pi are read as radians, because few logs stay within 6.3
    degrees.
    """
    if quantum_level(log.angle) > _COARSE:
        return "deg", "inferred from the size of the steps of the angle (unit= overrides)"
    off = {unit: misfit(replace(log, angle=log.angle * size)) for unit, size in UNITS.items()}
    for unit, other in (("rad", "deg"), ("deg", "rad")):
        if off[unit] * _CLEAR < off[other]:
            share = off[other] / off[unit]
            how = "far" if not math.isfinite(share) else f"{share:.2g} times"
            return unit, f"inferred: in {other} a pendulum's motion would fit {how} worse (unit= overrides)"
    largest = float(np.abs(log.angle).max())
    if largest <= math.tau:
        return "rad", f"inferred: the largest |angle|, {largest:.4g}, is not above 2 pi (unit= overrides)"
    raise RecordingError(f"{log.source}: the angle, up to {largest:.4g}, may be in radians, of a bob that rotates, or "
                         f'in degrees; give unit="rad" or unit="deg"; {SEE}')
