"""Files of recordings as phones, loggers and video trackers write them, with known truth and by scipy alone.

Nothing here knows how such files are read: each format is written from what its program is known to write.
"""

from __future__ import annotations

import argparse
import math
import zipfile
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray
from old_workbook import old_workbook
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]
Truth = dict[str, float]
Form = str | Callable[[Any], str]
Source = np.random.Generator

GRAVITY = 9.81
STARTED = datetime(2025, 3, 4, 10, 11, 12, 345000)
GYROSCOPE = ("Time (s)", "Gyroscope x (rad/s)", "Gyroscope y (rad/s)", "Gyroscope z (rad/s)", "Absolute (rad/s)")
ACCELEROMETER = ("Time (s)", "Acceleration x (m/s^2)", "Acceleration y (m/s^2)", "Acceleration z (m/s^2)",
                 "Absolute acceleration (m/s^2)")
DEVICE = (("version", "1.1.16"), ("build", "1011602"), ("fileFormat", "1.18"), ("deviceModel", "SM-A515F"),
          ("deviceBrand", "samsung"), ("deviceManufacturer", "samsung"), ("deviceRelease", "13"),
          ("gyroscope Name", "LSM6DSL Gyroscope"), ("gyroscope Vendor", "STMicro"),
          ("gyroscope Range", "17.453293"), ("gyroscope Resolution", "6.1086525E-4"), ("gyroscope MinDelay", "2000"))


@dataclass(frozen=True)
class BenchFile:
    """One format: its name, its file name, what it records, and the function that writes it and returns the truth.

    The truth holds length [m], gravity [m/s²], gamma [1/s] (``theta'' = -(g/L) sin theta - gamma theta'``), amplitude
    [rad] at the release and the small-angle period without drag [s]; where it applies also zero, what the file says
    in SI units where the truth is 0, and scale, what one unit of the truth is in the file.
    """

    name: str
    suffix: str
    kind: str
    write: Callable[[Path, Source], Truth]
    ambiguous: str = ""


@dataclass(frozen=True)
class Swing:
    """A pendulum held at its amplitude until it is let go at ``rest`` [s]."""

    length: float
    gamma: float
    amplitude: float
    side: float
    rest: float
    duration: float
    solution: Callable[[Array], Array]

    def at(self, time: Array) -> tuple[Array, Array, Array]:
        """The angle [rad], its rate [rad/s] and its acceleration [rad/s²] at these times."""
        angle, rate = self.solution(np.maximum(time - self.rest, 0.0))
        turn = -GRAVITY / self.length * np.sin(angle) - self.gamma * rate
        return angle, rate, np.where(time < self.rest, 0.0, turn)

    def truth(self, **more: float) -> Truth:
        """What a reader of the file should find."""
        return {"length": self.length, "gravity": GRAVITY, "gamma": self.gamma, "amplitude": self.amplitude,
                "period": 2.0 * math.pi * math.sqrt(self.length / GRAVITY), **more}


def let_go(length: float, gamma: float, angle: float, duration: float, rest: float = 0.0) -> Swing:
    """The swing from this angle [rad], recorded for ``duration`` [s] in all."""

    def slope(_time: float, state: Array) -> list[float]:
        return [state[1], -GRAVITY / length * math.sin(state[0]) - gamma * state[1]]

    run = solve_ivp(slope, (0.0, duration - rest + 0.1), [angle, 0.0], method="DOP853", rtol=1e-8, atol=1e-10,
                    dense_output=True)
    between: Any = run.sol
    return Swing(length, gamma, abs(angle), math.copysign(1.0, angle), rest, duration, between)


def drawn(source: Source, *, rest: bool = False, degrees: tuple[float, float] = (10.0, 40.0)) -> Swing:
    """A swing of random length, drag, amplitude, side and duration."""
    length, gamma = source.uniform(0.3, 1.0), source.uniform(0.01, 0.05)
    angle = source.choice([-1.0, 1.0]) * math.radians(source.uniform(*degrees))
    return let_go(length, gamma, angle, source.uniform(30.0, 60.0), 1.0 if rest else 0.0)


def even(swing: Swing, rate: float) -> Array:
    """Times from 0 to the end [s]."""
    return np.arange(math.floor(swing.duration * rate) + 1) / rate


def shaken(swing: Swing, rate: float, source: Source, first: float = 0.0) -> Array:
    """Times as a phone stamps them, each a little early or late [s]."""
    time = even(swing, rate)
    return first + time + source.uniform(-0.06, 0.06, len(time)) / rate * (time > 0.0)


def angle_degrees(
    swing: Swing, time: Array, source: Source, *, noise: float = 0.05, quantum: float = 0.0, zero: float = 1.5,
) -> tuple[Array, float]:
    """The angle as a sensor gives it [degrees], its zero off by at most ``zero`` [degrees], and that zero [rad]."""
    offset = source.uniform(-zero, zero)
    seen = np.degrees(swing.at(time)[0]) + offset + noise * source.standard_normal(len(time))
    return quantum * np.round(seen / quantum) if quantum else seen, math.radians(offset)


def java(value: float) -> str:
    """A number as Java's pattern 0.000000000E0 writes it."""
    mantissa, power = f"{value:.9E}".split("E")
    return f"{mantissa}E{int(power)}"


def row(values: Sequence[Any], forms: Sequence[Form], sep: str) -> str:
    """One line of a table."""
    return sep.join(form(value) if callable(form) else format(value, form)
                    for value, form in zip(values, forms, strict=True))


def lines(columns: Sequence[Any], forms: Sequence[Form], sep: str = ",") -> list[str]:
    """The lines of a table."""
    return [row(values, forms, sep) for values in zip(*columns, strict=True)]


def save(path: Path, text: Sequence[str], *, end: str = "\n", encoding: str = "utf-8") -> None:
    """These lines as a file."""
    path.write_bytes((end.join(text) + end).encode(encoding))


def quoted(names: Sequence[str]) -> str:
    """A header as phyphox writes it."""
    return ",".join(f'"{name}"' for name in names)


# Angles


def rotary_sensor(path: Path, source: Source) -> Truth:
    """A rotary motion sensor of 4000 steps a turn."""
    swing = drawn(source, rest=True)
    time = even(swing, 50.0)
    angle, zero = angle_degrees(swing, time, source, noise=0.02, quantum=0.09)
    save(path, ["Time (s)\tAngle (deg)", *lines((time, angle), (".2f", ".2f"), "\t")], end="\r\n")
    return swing.truth(zero=zero)


def encoder_changes(path: Path, source: Source) -> Truth:
    """An encoder that writes a row only when its count changes, until the bob hangs still."""
    length, gamma = source.uniform(0.3, 1.0), source.uniform(0.035, 0.05)
    degrees = source.uniform(10.0, 40.0)
    swing = let_go(length, gamma, source.choice([-1.0, 1.0]) * math.radians(degrees),
                   1.0 + 2.0 / gamma * math.log(degrees / 0.03), 1.0)
    time = even(swing, 4000.0)
    zero = source.uniform(-0.1, 0.1)
    count = np.round((np.degrees(swing.at(time)[0]) + zero) / 0.25).astype(int)
    kept = np.flatnonzero(np.diff(count, prepend=count[0] - 1))
    save(path, ["time (s),angle (deg)", *lines((time[kept], 0.25 * count[kept]), (".4f", ".2f"))])
    return swing.truth(zero=math.radians(zero))


def counter_first(path: Path, source: Source) -> Truth:
    """A table whose time is the second column and whose angle is the fourth."""
    swing = drawn(source)
    time = even(swing, 50.0)
    angle, zero = angle_degrees(swing, time, source, noise=0.1)
    mass = source.uniform(0.05, 0.2)
    energy = 0.5 * mass * (swing.length * (swing.at(time)[1] + 0.01 * source.standard_normal(len(time)))) ** 2
    gate = (np.abs(angle) < 1.0).astype(int)
    save(path, ["Counter,Time (s),KE (J),Angle (deg),GateState",
                *lines((np.arange(1, len(time) + 1), time, energy, angle, gate), ("d", ".3f", ".5f", ".2f", "d"))])
    return swing.truth(zero=zero)


def footer_and_cut(path: Path, source: Source) -> Truth:
    """Lines of text after the numbers, and a last line that was cut off while it was written."""
    swing = drawn(source)
    time = even(swing, 100.0)
    angle, zero = angle_degrees(swing, time, source)
    body = lines((time, angle), (".2f", ".3f"))
    cut = body[-1][:body[-1].index(",") + 2]
    text = "\n".join(["Time (s),Angle (deg)", *body[:-1], "", "--- end of measurement ---", "Operator: group 4",
                      "Remark: string, brass bob, released by hand", f"Values: {len(body)}", cut])
    path.write_bytes(text.encode())
    return swing.truth(zero=zero)


def iso_stamps(path: Path, source: Source) -> Truth:
    """Dates and clock times instead of seconds."""
    swing = drawn(source, rest=True)
    time = np.round(shaken(swing, 50.0, source), 3)
    angle, zero = angle_degrees(swing, time, source)
    stamps = [(STARTED + timedelta(seconds=float(now))).isoformat(timespec="milliseconds") for now in time]
    save(path, ["timestamp,angle (deg)", *lines((stamps, angle), ("s", ".2f"))])
    return swing.truth(zero=zero)


def clock_stamps(path: Path, source: Source) -> Truth:
    """Clock times without a date."""
    swing = drawn(source)
    time = np.round(shaken(swing, 50.0, source), 3)
    angle, zero = angle_degrees(swing, time, source)
    stamps = [(STARTED + timedelta(seconds=float(now))).strftime("%H:%M:%S.%f")[:-3] for now in time]
    save(path, ["Time,Angle (deg)", *lines((stamps, angle), ("s", ".2f"))])
    return swing.truth(zero=zero)


def degree_signs(path: Path, source: Source) -> Truth:
    """A degree sign behind every value."""
    swing = drawn(source, rest=True)
    time = even(swing, 40.0)
    angle, zero = angle_degrees(swing, time, source)
    save(path, ["Time (s),Angle", *lines((time, angle), (".3f", lambda value: f"{value:.2f}°"))])
    return swing.truth(zero=zero)


def bare_milliseconds(path: Path, source: Source) -> Truth:
    """What an Arduino prints: its milliseconds and the angle, without a header."""
    swing = drawn(source)
    time = even(swing, 100.0)
    stamps = np.round(1000.0 * time).astype(int) + source.integers(0, 2, len(time))
    angle, zero = angle_degrees(swing, stamps / 1000.0, source, noise=0.1)
    boot = int(source.integers(1500, 9000))
    save(path, lines((stamps + boot, angle), ("d", ".2f")), end="\r\n")
    return swing.truth(zero=zero)


def clock_back(path: Path, source: Source) -> Truth:
    """A logger whose clock is set back by 30 ms once."""
    swing = drawn(source, rest=True)
    time = even(swing, 100.0)
    angle, zero = angle_degrees(swing, time, source)
    moved = np.arange(len(time)) >= round(len(time) * source.uniform(0.4, 0.6))
    save(path, ["Time (s),Angle (deg)", *lines((time - 0.03 * moved, angle), (".3f", ".2f"))])
    return swing.truth(zero=zero)


def zero_jumps(path: Path, source: Source) -> Truth:
    """A tracker that lost the bob and found it again 8 degrees beside: the zero is that before the jump."""
    swing = drawn(source)
    time = even(swing, 30.0)
    angle, zero = angle_degrees(swing, time, source, noise=0.1)
    moved = np.arange(len(time)) >= round(len(time) * source.uniform(0.3, 0.7))
    save(path, ["t (s),theta (deg)", *lines((time, angle + 8.0 * moved), (".4f", ".3f"))])
    return swing.truth(zero=zero)


def lost_as_zero(path: Path, source: Source) -> Truth:
    """Runs of lost readings that are written as exactly 0."""
    swing = drawn(source, rest=True)
    time = even(swing, 100.0)
    angle, zero = angle_degrees(swing, time, source)
    for begin in source.choice(len(time) - 200, size=int(source.integers(4, 9)), replace=False) + 150:
        angle[begin:begin + int(source.integers(5, 26))] = 0.0
    save(path, ["Time (s),Angle (deg)", *lines((time, angle), (".2f", ".2f"))])
    return swing.truth(zero=zero)


def dead_channel(path: Path, source: Source) -> Truth:
    """Two sensors of which the first is not connected."""
    swing = drawn(source)
    time = even(swing, 50.0)
    angle, zero = angle_degrees(swing, time, source, quantum=0.09, noise=0.02)
    save(path, ["Time (s),Angle 1 (deg),Angle 2 (deg)",
                *lines((time, np.zeros(len(time)), angle), (".2f", ".2f", ".2f"))])
    return swing.truth(zero=zero)


def two_runs(path: Path, source: Source) -> Truth:
    """Two runs of one pendulum side by side, the shorter with empty fields at its end; the truth is of the first."""
    first = drawn(source, rest=True)
    second = let_go(first.length, first.gamma, -first.side * math.radians(source.uniform(10.0, 40.0)),
                    first.duration * source.uniform(0.5, 0.8))
    cells: list[list[str]] = []
    zero = math.radians(source.uniform(-1.0, 1.0))
    for swing in (first, second):
        time = even(swing, 20.0)
        angle = angle_degrees(swing, time, source, noise=0.02, zero=0.0)[0] + math.degrees(zero)
        cells.append(lines((time, 0.09 * np.round(angle / 0.09)), (".2f", ".2f")))
    cells[1] += [","] * (len(cells[0]) - len(cells[1]))
    save(path, ["Time (s) Run #1,Angle (deg) Run #1,Time (s) Run #2,Angle (deg) Run #2",
                *(f"{left},{right}" for left, right in zip(*cells, strict=True))], end="\r\n")
    return first.truth(zero=zero)


def german(path: Path, source: Source) -> Truth:
    """Decimal commas, semicolons and a German header."""
    swing = drawn(source, rest=True)
    time = even(swing, 50.0)
    angle, zero = angle_degrees(swing, time, source, quantum=0.09, noise=0.02)
    body = [line.replace(".", ",") for line in lines((time, angle), (".2f", ".2f"), ";")]
    save(path, ["Zeit (s);Winkel (°)", *body], end="\r\n", encoding="utf-8-sig")
    return swing.truth(zero=zero)


# Rates


def gyroscope(source: Source, *, rest: bool, rate: float = 100.0) -> tuple[list[Array], Truth]:
    """Times and the three rates of a phone on a rod, the swing on one axis and a little of it on the others."""
    swing = drawn(source, rest=rest)
    time = shaken(swing, rate, source, source.uniform(0.002, 0.02))
    main = int(source.integers(3))
    lean = source.uniform(-0.03, 0.03, 3)
    lean[main] = source.choice([-1.0, 1.0])
    lean /= np.linalg.norm(lean)
    bias = source.uniform(0.004, 0.03, 3) * source.choice([-1.0, 1.0], 3)
    omega = swing.at(time)[1]
    axes = [lean[i] * omega + bias[i] + 0.004 * source.standard_normal(len(time)) for i in range(3)]
    return [time, *axes], swing.truth(zero=float(bias[main]), scale=float(abs(lean[main])))


def phyphox_columns(source: Source, *, rest: bool) -> tuple[list[Array], Truth]:
    """The columns of phyphox's gyroscope."""
    columns, truth = gyroscope(source, rest=rest)
    return [*columns, np.sqrt(columns[1] ** 2 + columns[2] ** 2 + columns[3] ** 2)], truth


def events(time: Array) -> list[tuple[str, float, float, str]]:
    """When phyphox began and ended to measure."""
    found = []
    for name, now in (("START", 0.0), ("PAUSE", float(time[-1]) + 0.02)):
        moment = STARTED + timedelta(seconds=now)
        text = moment.isoformat(" ", timespec="milliseconds") + " UTC+01:00"
        found.append((name, now, (moment - datetime(1970, 1, 1, 1)).total_seconds(), text))
    return found


def phyphox_csv(path: Path, source: Source) -> Truth:
    """The gyroscope of phyphox as one CSV file."""
    columns, truth = phyphox_columns(source, rest=True)
    save(path, [quoted(GYROSCOPE), *lines(columns, [java] * 5)])
    return truth


def zipped(path: Path, members: Sequence[tuple[str, str]]) -> None:
    """These texts as a zip file that is the same whenever it is written."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in members:
            member = zipfile.ZipInfo(name, STARTED.timetuple()[:6])
            member.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(member, text.encode())


def phyphox_zip(path: Path, source: Source) -> Truth:
    """The gyroscope of phyphox as it is shared: a zip file with the table and two tables about the phone."""
    columns, truth = phyphox_columns(source, rest=False)
    table = "\n".join([quoted(GYROSCOPE), *lines(columns, [java] * 5), ""])
    device = "\n".join([quoted(("property", "value")), *(quoted(pair) for pair in DEVICE), ""])
    moments = [f'"{name}",{java(now)},{system:.3f},"{text}"' for name, now, system, text in events(columns[0])]
    head = quoted(("event", "experiment time", "system time", "system time text"))
    zipped(path, [("Raw Data.csv", table), ("meta/device.csv", device),
                  ("meta/time.csv", "\n".join([head, *moments, ""]))])
    return truth


def sheet(rows: Sequence[Sequence[str | float]]) -> str:
    """A worksheet of these rows."""
    found = []
    for i, values in enumerate(rows, 1):
        cells = [f'<c r="{"ABCDEFGH"[j]}{i}" t="inlineStr"><is><t>{escape(value)}</t></is></c>'
                 if isinstance(value, str) else f'<c r="{"ABCDEFGH"[j]}{i}"><v>{float(value)!r}</v></c>'
                 for j, value in enumerate(values)]
        found.append(f'<row r="{i}">{"".join(cells)}</row>')
    return ('<worksheet xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"><sheetData>'
            f'{"".join(found)}</sheetData></worksheet>')


def workbook(path: Path, sheets: Sequence[tuple[str, Sequence[Sequence[str | float]]]]) -> None:
    """A workbook of these sheets."""
    head = '<?xml version="1.0" encoding="UTF-8" standalone="yes"?>\n'
    main = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
    links = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
    package = "http://schemas.openxmlformats.org/package/2006"
    kind = "application/vnd.openxmlformats-officedocument.spreadsheetml"
    numbers = range(1, len(sheets) + 1)
    types = "".join(f'<Override PartName="/xl/worksheets/sheet{i}.xml" ContentType="{kind}.worksheet+xml"/>'
                    for i in numbers)
    names = "".join(f'<sheet name="{escape(name)}" sheetId="{i}" r:id="rId{i}"/>'
                    for i, (name, _) in enumerate(sheets, 1))
    targets = "".join(f'<Relationship Id="rId{i}" Type="{links}/worksheet" Target="worksheets/sheet{i}.xml"/>'
                      for i in numbers)
    parts = [
        ("[Content_Types].xml",
         f'<Types xmlns="{package}/content-types">'
         f'<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
         f'<Default Extension="xml" ContentType="application/xml"/>'
         f'<Override PartName="/xl/workbook.xml" ContentType="{kind}.sheet.main+xml"/>{types}</Types>'),
        ("_rels/.rels",
         f'<Relationships xmlns="{package}/relationships">'
         f'<Relationship Id="rId1" Type="{links}/officeDocument" Target="xl/workbook.xml"/></Relationships>'),
        ("xl/workbook.xml", f'<workbook xmlns="{main}" xmlns:r="{links}"><sheets>{names}</sheets></workbook>'),
        ("xl/_rels/workbook.xml.rels", f'<Relationships xmlns="{package}/relationships">{targets}</Relationships>'),
        *((f"xl/worksheets/sheet{i}.xml", sheet(rows)) for i, (_, rows) in enumerate(sheets, 1)),
    ]
    zipped(path, [(name, head + text) for name, text in parts])


def phyphox_xlsx(path: Path, source: Source) -> Truth:
    """The gyroscope of phyphox as an Excel workbook."""
    columns, truth = phyphox_columns(source, rest=True)
    workbook(path, [
        ("Raw Data", [GYROSCOPE, *zip(*columns, strict=True)]),
        ("Metadata Device", [("property", "value"), *DEVICE]),
        ("Metadata Time", [("event", "experiment time", "system time", "system time text"), *events(columns[0])]),
    ])
    return truth


def phyphox_xls(path: Path, source: Source) -> Truth:
    """The gyroscope of phyphox as a workbook of Excel 97, which it also exports."""
    columns, truth = phyphox_columns(source, rest=False)
    path.write_bytes(old_workbook([
        ("Raw Data", [GYROSCOPE, *zip(*(column.tolist() for column in columns), strict=True)]),
        ("Metadata Device", [("property", "value"), *DEVICE]),
    ]))
    return truth


def physics_toolbox(path: Path, source: Source) -> Truth:
    """The gyroscope of Physics Toolbox."""
    columns, truth = gyroscope(source, rest=False)
    save(path, ["time,wx,wy,wz", *lines(columns, (".6f", ".5f", ".5f", ".5f"))])
    return truth


def cart_rate(path: Path, source: Source) -> Truth:
    """The gyroscope of a course's smart cart, with the name of the run in the header."""
    swing = drawn(source, rest=True)
    time = even(swing, 50.0)
    bias, side = source.uniform(-0.02, 0.02), source.choice([-1.0, 1.0])
    rate = side * swing.at(time)[1] + bias + 0.01 * source.standard_normal(len(time))
    save(path, ["Time (s) Run #1,Rotation y (rad/s) Run #1", *lines((time, rate), (".2f", ".3f"))], end="\r\n")
    return swing.truth(zero=bias)


def absolute_rate(path: Path, source: Source) -> Truth:
    """The size of the angular velocity alone."""
    columns, truth = phyphox_columns(source, rest=False)
    save(path, [quoted(("Time (s)", "Absolute (rad/s)")), *lines((columns[0], columns[4]), (java, java))])
    return truth


# Accelerations


def felt(swing: Swing, time: Array, reach: float = 0.0) -> tuple[Array, Array]:
    """Return the forces that a phone feels across the rod, along the motion, and along the rod to the pivot [m/s²].

    It is ``reach`` [m] from the pivot, or at the bob; a swing on a rod has the length of the point pendulum of its
    period.
    """
    angle, rate, turn = swing.at(time)
    reach = reach or swing.length
    return GRAVITY * np.sin(angle) + reach * turn, GRAVITY * np.cos(angle) + reach * rate**2


def phone(swing: Swing, time: Array, source: Source, reach: float = 0.0) -> tuple[list[Array], float]:
    """The three axes of a phone that leans on the rod, with the bias and the noise of each, and the lean [rad]."""
    across, along = felt(swing, time, reach)
    lean = math.radians(source.uniform(-0.5, 0.5))
    ideal = (math.cos(lean) * across - math.sin(lean) * along, math.sin(lean) * across + math.cos(lean) * along,
             np.zeros(len(time)))
    return [axis + source.uniform(-0.03, 0.03) + 0.02 * source.standard_normal(len(time)) for axis in ideal], lean


def phyphox_acceleration(path: Path, source: Source) -> Truth:
    """The accelerometer of phyphox with gravity; the phone leans on the rod by the zero [rad]."""
    swing = drawn(source, rest=True)
    time = shaken(swing, 100.0, source, source.uniform(0.002, 0.02))
    axes, lean = phone(swing, time, source)
    size = np.sqrt(axes[0] ** 2 + axes[1] ** 2 + axes[2] ** 2)
    save(path, [quoted(ACCELEROMETER), *lines((time, *axes, size), [java] * 5)])
    return swing.truth(zero=lean)


def phone_on_a_rod(path: Path, source: Source) -> Truth:
    """The accelerometer of phyphox in its older words, of a phone on a rod above the end of it, with semicolons."""
    swing = drawn(source, rest=True)
    time = shaken(swing, 100.0, source, source.uniform(0.002, 0.02))
    reach = swing.length * source.uniform(0.4, 0.8)
    axes, _ = phone(swing, time, source, reach)
    order = [axes[i] * source.choice([-1.0, 1.0]) for i in source.permutation(3)]
    names = ("Time (s)", *(f"Acceleration {axis} (m/s²)" for axis in "xyz"))
    save(path, [";".join(f'"{name}"' for name in names), *lines((time, *order), [java] * 4, ";")])
    return swing.truth(reach=reach)


def toolbox_force(path: Path, source: Source) -> Truth:
    """The g-force meter of Physics Toolbox, in g, with the total force, of a phone just above the bob."""
    swing = drawn(source, degrees=(15.0, 40.0))
    time = shaken(swing, 100.0, source, source.uniform(0.002, 0.02))
    reach = swing.length * source.uniform(0.85, 0.95)
    axes = [-axis / 9.80665 for axis in phone(swing, time, source, reach)[0]]
    size = np.sqrt(axes[0] ** 2 + axes[1] ** 2 + axes[2] ** 2)
    save(path, ["time,gFx,gFy,gFz,TgF", *lines((time, *axes, size), (".6f", ".4f", ".4f", ".4f", ".3f"))])
    return swing.truth(reach=reach)


def absolute_acceleration(path: Path, source: Source) -> Truth:
    """The size of the acceleration alone, of a phone that is the bob."""
    swing = drawn(source, degrees=(20.0, 40.0))
    time = shaken(swing, 100.0, source, source.uniform(0.002, 0.02))
    axes, _ = phone(swing, time, source)
    size = np.sqrt(axes[0] ** 2 + axes[1] ** 2 + axes[2] ** 2)
    save(path, [quoted((ACCELEROMETER[0], ACCELEROMETER[4])), *lines((time, size), (java, java))])
    return swing.truth()


def across_acceleration(path: Path, source: Source) -> Truth:
    """The acceleration across a rod alone, halfway down."""
    swing = drawn(source)
    time = shaken(swing, 100.0, source, source.uniform(0.002, 0.02))
    reach, bias = swing.length * source.uniform(0.4, 0.6), source.uniform(-0.03, 0.03)
    across = felt(swing, time, reach)[0] + bias + 0.02 * source.standard_normal(len(time))
    save(path, [quoted((ACCELEROMETER[0], ACCELEROMETER[1])), *lines((time, across), (java, java))])
    return swing.truth(zero=bias, reach=reach)


def linear_acceleration(path: Path, source: Source) -> Truth:
    """The acceleration without g, as phyphox calls it, of a phone that is the bob."""
    swing = drawn(source)
    time = shaken(swing, 100.0, source, source.uniform(0.002, 0.02))
    _, rate, turn = swing.at(time)
    ideal = (swing.length * turn, swing.length * rate**2, np.zeros(len(time)))
    axes = [axis + 0.02 * source.standard_normal(len(time)) for axis in ideal]
    names = ("Time (s)", *(f"Linear Acceleration {axis} (m/s^2)" for axis in "xyz"))
    save(path, [quoted(names), *lines((time, *axes), [java] * 4)])
    return swing.truth()


def string_acceleration(path: Path, source: Source) -> Truth:
    """The acceleration along the string alone."""
    swing = drawn(source, degrees=(20.0, 40.0))
    time = shaken(swing, 100.0, source, source.uniform(0.002, 0.02))
    bias = source.uniform(-0.03, 0.03)
    along = felt(swing, time)[1] + bias + 0.02 * source.standard_normal(len(time))
    save(path, [quoted((ACCELEROMETER[0], ACCELEROMETER[2])), *lines((time, along), (java, java))])
    return swing.truth(zero=bias)


# Tracks and distances


def bob(swing: Swing, time: Array, noise: float, source: Source) -> tuple[Array, Array]:
    """The bob to the right of the pivot and above it, as a video shows it [m]."""
    angle = swing.at(time)[0]
    return (swing.length * np.sin(angle) + noise * source.standard_normal(len(time)),
            -swing.length * np.cos(angle) + noise * source.standard_normal(len(time)))


def bare_track(path: Path, source: Source) -> Truth:
    """Time, x and y in metres without a header, the pivot not at the origin."""
    swing = drawn(source)
    time = even(swing, 30.0)
    right, up = bob(swing, time, 0.001, source)
    x, y = right + source.uniform(-0.5, 0.5), up + source.uniform(-0.2, 1.2)
    save(path, lines((time, x, y), (".4f", ".4f", ".4f")))
    return swing.truth(scale=1.0)


def tracker_text(path: Path, source: Source, first: str = "#mass_A") -> Truth:
    """The table of a point mass as Tracker exports it."""
    swing = drawn(source, rest=first.startswith("#"))
    time = even(swing, 30.0)
    right, up = bob(swing, time, 0.001, source)
    x, y = right + source.uniform(-0.1, 0.1), up + source.uniform(0.0, 1.0)
    save(path, [first, "t\tx\ty", *lines((time, x, y), (java, java, java), "\t")], end="\r\n")
    return swing.truth(scale=1.0)


def tracker_text_plain(path: Path, source: Source) -> Truth:
    """The same with the bare name of the track in the first line, as newer versions of Tracker write it."""
    return tracker_text(path, source, "mass_A")


Xml = tuple[str, str, Any]


def xml_lines(name: str, properties: Sequence[Xml], depth: int) -> list[str]:
    """An object as Tracker writes it: its class and its properties, each with a name, a type and a value."""
    pad = "    " * depth
    found = [f'{pad}<object class="{name}">']
    for key, kind, value in properties:
        begin = f'{pad}    <property name="{key}" type="{kind}"'
        if kind == "object":
            found += [f"{begin}>", *xml_lines(value[0], value[1], depth + 1), f"{pad}    </property>"]
        elif kind in ("array", "collection"):
            found.append(f'{begin} class="{value[0]}">')
            for inner, text, item in value[1]:
                open_inner = f'{pad}        <property name="{inner}" type="{text}">'
                if text == "object":
                    found += [open_inner, *xml_lines(item[0], item[1], depth + 2), f"{pad}        </property>"]
                else:
                    found.append(f"{open_inner}{item}</property>")
            found.append(f"{pad}    </property>")
        else:
            found.append(f"{begin}>{escape(str(value))}</property>")
    return [*found, f"{pad}</object>"]


def color(red: int, green: int, blue: int) -> Xml:
    """A colour of a track."""
    return ("color", "object", ("java.awt.Color", [("red", "int", red), ("green", "int", green),
                                                   ("blue", "int", blue), ("alpha", "int", 255)]))


def tracker_project(path: Path, source: Source) -> Truth:
    """A project of Tracker: the bob in pixels, y down, with the scale, the origin and the time of a frame beside it."""
    tracker, core = "org.opensourcephysics.cabrillo.tracker.", "org.opensourcephysics.media.core."
    swing = drawn(source)
    begin, step = int(source.integers(0, 25)), 1000.0 / 30.0
    time = even(swing, 30.0)
    frames = begin + np.arange(len(time))
    scale = source.uniform(0.75, 1.0) * 620.0 / max(swing.length, 0.5)
    right, up = bob(swing, time, 0.5 / scale, source)
    pivot = (640.0 + source.uniform(-60.0, 60.0), source.uniform(10.0, 60.0))
    x, y = pivot[0] + scale * right, pivot[1] - scale * up
    seen = source.uniform(size=len(time)) > 0.01
    stick = source.uniform(60.0, 120.0)
    marks = [(f"[{n}]", "object", (tracker + "PointMass$FrameData", [("x", "double", float(a)),
                                                                    ("y", "double", float(b))]))
             for n, a, b in zip(frames[seen], x[seen], y[seen], strict=True)]
    count = int(frames[-1]) + 6
    shown: list[Xml] = [("visible", "boolean", "true")]
    axes = (tracker + "CoordAxes",
            [("name", "string", "axes"), color(200, 0, 200), ("footprint", "string", "Footprint.BoldSimpleAxes"),
             *shown, ("trail", "boolean", "false")])
    tape = (tracker + "TapeMeasure",
            [("name", "string", "calibration stick A"), color(0, 0, 255),
             ("footprint", "string", "Footprint.BoldDoubleTarget"), *shown, ("trail", "boolean", "false"),
             ("fixedtape", "boolean", "true"), ("fixedlength", "boolean", "true"), ("readonly", "boolean", "false"),
             ("stickmode", "boolean", "true"),
             ("framedata", "array", (f"[L{tracker}TapeMeasure$FrameData;", [
                 ("[0]", "object", (tracker + "TapeMeasure$FrameData", [
                     ("x1", "double", stick), ("y1", "double", 650.0), ("x2", "double", stick + 0.2 * scale),
                     ("y2", "double", 650.0)]))])),
             ("worldlengths", "array", ("[Ljava.lang.Double;", [("[0]", "double", 0.2)]))])
    mass = (tracker + "PointMass",
            [("mass", "double", 0.1), ("name", "string", "mass A"), color(255, 0, 0),
             ("footprint", "string", "Footprint.Diamond"), *shown, ("trail", "boolean", "true"),
             ("framedata", "array", (f"[L{tracker}PointMass$FrameData;", marks))])
    frame = (core + "ImageCoordSystem$FrameData",
             [("xorigin", "double", pivot[0] + source.uniform(-50.0, 50.0)),
              ("yorigin", "double", source.uniform(200.0, 700.0)), ("angle", "double", 0.0),
              ("xscale", "double", scale), ("yscale", "double", scale)])
    video = (core + "ImageVideo", [("path", "string", "pendulum/frame000.jpg"), ("delta_t", "double", step)])
    clip = (core + "VideoClip",
            [("video", "object", video), ("video_framecount", "int", count), ("startframe", "int", begin),
             ("stepsize", "int", 1), ("stepcount", "int", len(frames)), ("starttime", "double", 0.0),
             ("readout", "string", "frame"), ("playallsteps", "boolean", "true")])
    control = (core + "StepperClipControl",
               [("rate", "double", 1.0), ("delta_t", "double", step), ("frame", "int", len(frames) - 1)])
    coords = (core + "ImageCoordSystem",
              [("fixedorigin", "boolean", "true"), ("fixedangle", "boolean", "true"),
               ("fixedscale", "boolean", "true"), ("locked", "boolean", "false"),
               ("framedata", "array", (f"[L{core}ImageCoordSystem$FrameData;", [("[0]", "object", frame)]))])
    panel: list[Xml] = [
        ("semantic_version", "string", "5.1.5"), ("width", "double", 1280.0), ("height", "double", 720.0),
        ("videoclip", "object", clip), ("clipcontrol", "object", control), ("coords", "object", coords),
        ("length_unit", "string", "m"), ("mass_unit", "string", "kg"), ("units_visible", "boolean", "true"),
        ("tracks", "collection", ("java.util.ArrayList", [("item", "object", track) for track in (axes, tape, mass)])),
    ]
    save(path, ['<?xml version="1.0" encoding="UTF-8"?>', *xml_lines(tracker + "TrackerPanel", panel, 0)])
    return swing.truth(scale=scale)


def pixel_track(path: Path, source: Source) -> Truth:
    """Pixels, y down, with the pixels of a metre in the first line."""
    swing = drawn(source, rest=True)
    time = even(swing, 60.0)
    scale = round(source.uniform(0.75, 1.0) * 900.0 / max(swing.length, 0.5), 1)
    right, up = bob(swing, time, 0.5 / scale, source)
    x, y = 960.0 + source.uniform(-90.0, 90.0) + scale * right, source.uniform(20.0, 90.0) - scale * up
    save(path, [f"# scale: {scale:.1f} pixels per metre", "t (s),x (px),y (px)",
                *lines((time, x, y), (".4f", ".1f", ".1f"))])
    return swing.truth(scale=scale)


def sideways(path: Path, source: Source) -> Truth:
    """The sideways position alone; the zero is where the bob hangs [m]."""
    swing = drawn(source)
    time = even(swing, 60.0)
    zero = source.uniform(-0.4, 0.4)
    save(path, ["t,x (m)", *lines((time, zero + bob(swing, time, 0.0005, source)[0]), (".4f", ".4f"))])
    return swing.truth(zero=zero, scale=1.0)


def ultrasonic(path: Path, source: Source) -> Truth:
    """The distance to a bob that swings to and from the sensor; the zero is where the bob hangs [m]."""
    swing = drawn(source, rest=True, degrees=(10.0, 25.0))
    time = even(swing, 20.0)
    zero = swing.length * math.sin(swing.amplitude) + source.uniform(0.2, 0.5)
    away = 100.0 * (zero - bob(swing, time, 0.0015, source)[0])
    save(path, ["Time (s),Distance (cm)", *lines((time, away), (".2f", ".1f"))])
    return swing.truth(zero=zero, scale=100.0)


# Gates and periods


def blocks(swing: Swing, source: Source) -> tuple[Array, Array]:
    """When the bob begins and ends to block a gate that stands a few millimetres beside the bottom [s]."""
    width = source.uniform(0.008, 0.012)
    beside = source.choice([-1.0, 1.0]) * source.uniform(0.0015, 0.003)
    time = even(swing, 5000.0)
    inside = width / 2.0 - np.abs(swing.length * np.sin(swing.at(time)[0]) - beside)
    before = np.flatnonzero(np.sign(inside[:-1]) != np.sign(inside[1:]))
    at = time[before] + (time[1] - time[0]) * inside[before] / (inside[before] - inside[before + 1])
    at = at + 2e-5 * source.standard_normal(len(at))
    return at[0::2], at[1::2]


def gate_states(path: Path, source: Source) -> Truth:
    """A row whenever a gate at the bottom is blocked, 1, or free again, 0."""
    swing = drawn(source, rest=True, degrees=(15.0, 40.0))
    begin, end = blocks(swing, source)
    changes = np.sort(np.concatenate([begin, end]))
    states = np.arange(1, len(changes) + 1) % 2
    save(path, ["Time (s),GateState", *lines(([0.0, *changes], [0, *states]), (".6f", "d"))])
    return swing.truth()


def block_times(path: Path, source: Source) -> Truth:
    """The times at which a gate at the bottom was blocked, one a line and nothing else."""
    swing = drawn(source, degrees=(15.0, 40.0))
    save(path, lines((blocks(swing, source)[0],), (".4f",)))
    return swing.truth()


def whole_periods(begin: Array) -> Array:
    """From each blocking to the next but one, one after the other [s]."""
    return np.diff(begin[0::2])


def periods(path: Path, source: Source) -> Truth:
    """The periods that a gate found, one after the other."""
    swing = drawn(source, rest=True, degrees=(15.0, 40.0))
    save(path, ["Period (s)", *lines((whole_periods(blocks(swing, source)[0]),), (".4f",))])
    return swing.truth()


def period_by_amplitude(path: Path, source: Source) -> Truth:
    """A table of the first period after a release against the angle of it, which is read off a protractor."""
    length, gamma = source.uniform(0.3, 1.0), source.uniform(0.01, 0.05)
    table = []
    for degrees in range(5, 65, 5):
        angle = math.radians(degrees + 0.2 * source.standard_normal())
        begin = blocks(let_go(length, gamma, angle, 5.0), source)[0]
        table.append((degrees, whole_periods(begin)[0] + 0.0005 * source.standard_normal()))
    save(path, ["Amplitude (deg),Period (s)", *lines(tuple(zip(*table, strict=True)), ("d", ".4f"))])
    truth = let_go(length, gamma, 0.1, 0.1).truth()
    return {key: value for key, value in truth.items() if key != "amplitude"}


RUNS = ("The file holds two runs that are equally good: the angle may be that of run 1 or that of run 2, "
        "which was released elsewhere (the truth is of run 1; length and drag are those of both).")

# Loggers of one's own


def arduino_lines(path: Path, source: Source) -> Truth:
    """The output of an Arduino over its serial line, with words of its library before and between the readings."""
    swing = drawn(source)
    time = even(swing, 50.0)
    angle, zero = angle_degrees(swing, time, source)
    body = lines((np.round(1000.0 * time).astype(int) + 4321, angle), ("d", ".2f"))
    for at in sorted(source.choice(len(body) - 100, 6, replace=False) + 50, reverse=True):
        body.insert(int(at), str(source.choice(["WARNING: I2C timeout, retry", "Sensor reset.", "ok"])))
    save(path, ["Initializing...", "MPU6050 found at 0x68", *body], end="\r\n")
    return swing.truth(zero=zero)


def arduino_labels(path: Path, source: Source) -> Truth:
    """Lines for the serial plotter of Arduino, each value with its name."""
    swing = drawn(source)
    time = even(swing, 50.0)
    angle, zero = angle_degrees(swing, time, source)
    save(path, [f"millis:{1000.0 * now:.0f},angle_deg:{value:.2f}" for now, value in zip(time, angle, strict=True)])
    return swing.truth(zero=zero)


def motion_unit(path: Path, source: Source) -> Truth:
    """All axes of an MPU6050 on a rod, accelerations in g and rates in degrees/s, without units in the header."""
    swing = drawn(source, degrees=(15.0, 40.0))
    time = even(swing, 100.0)
    reach = swing.length * source.uniform(0.5, 0.9)
    force = [axis / 9.80665 for axis in phone(swing, time, source, reach)[0]]
    turn = [0.1 * source.standard_normal(len(time)) + bias for bias in source.uniform(-2.0, 2.0, 3)]
    turn[2] = turn[2] + np.degrees(swing.at(time)[1])
    save(path, ["t_ms,ax,ay,az,gx,gy,gz",
                *lines((1000.0 * time, *force, *turn), (".0f", ".4f", ".4f", ".4f", ".2f", ".2f", ".2f"))])
    return swing.truth(reach=reach)


def thousands(path: Path, source: Source) -> Truth:
    """Milliseconds with a comma after thousands, as a spreadsheet formats them, with a byte-order mark."""
    swing = drawn(source, rest=True)
    time = even(swing, 50.0)
    angle, zero = angle_degrees(swing, time, source)
    save(path, ["Time (ms);Angle (deg)", *lines((1000.0 * time, angle), (",.0f", ".2f"), ";")], end="\r\n",
         encoding="utf-8-sig")
    return swing.truth(zero=zero)


def nameless_axes(path: Path, source: Source) -> Truth:
    """Sensor Logger's file of a gyroscope, whose header names the axes but not what they are."""
    swing = drawn(source)
    time = shaken(swing, 100.0, source)
    noise = [0.004 * source.standard_normal(len(time)) for _ in range(3)]
    stamps = 1_700_000_000_000_000_000 + np.round(1e9 * time).astype(np.int64)
    save(path, ["time,seconds_elapsed,z,y,x", *lines((stamps, time, noise[0], swing.at(time)[1] + noise[1], noise[2]),
                                                     ("d", ".9f", ".9f", ".9f", ".9f"))])
    return swing.truth()


AXES = ("The header names three axes x, y and z: they are an angular velocity or an acceleration, which only the name "
        "of the file says.")
ACROSS = ("A force without gravity is either that across a rod, g (1 - r/L) sin(theta), which needs the distance r of "
          "the phone from the pivot, or an acceleration without g.")
LINEAR = ("Without gravity, a small swing of a phone far from the pivot and a large one of a phone near it are the "
          "same: the file shows only the product of amplitude and distance.")

BENCH_FILES: tuple[BenchFile, ...] = (
    BenchFile("rotary sensor", "rotary_sensor.txt", "angle", rotary_sensor),
    BenchFile("encoder changes", "encoder_changes.csv", "angle", encoder_changes),
    BenchFile("phyphox gyroscope csv", "gyroscope.csv", "rate", phyphox_csv),
    BenchFile("phyphox gyroscope zip", "gyroscope.zip", "rate", phyphox_zip),
    BenchFile("phyphox gyroscope xlsx", "gyroscope.xlsx", "rate", phyphox_xlsx),
    BenchFile("physics toolbox gyroscope", "physics_toolbox.csv", "rate", physics_toolbox),
    BenchFile("smart cart rotation", "cart_rotation.csv", "rate", cart_rate),
    BenchFile("phyphox acceleration", "acceleration.csv", "acceleration", phyphox_acceleration),
    BenchFile("acceleration along the string", "acceleration_string.csv", "acceleration", string_acceleration),
    BenchFile("bare track", "track_bare.csv", "track", bare_track),
    BenchFile("tracker text", "tracker_export.txt", "track", tracker_text),
    BenchFile("tracker text, bare name", "tracker_export_plain.txt", "track", tracker_text_plain),
    BenchFile("tracker project", "pendulum.trk", "track", tracker_project),
    BenchFile("pixel track", "track_pixels.csv", "track", pixel_track),
    BenchFile("sideways position", "sideways.csv", "track", sideways),
    BenchFile("ultrasonic distance", "ultrasonic.csv", "distance", ultrasonic),
    BenchFile("gate states", "gate_states.csv", "gate", gate_states),
    BenchFile("blocking times", "blocking_times.txt", "gate", block_times),
    BenchFile("periods", "periods.csv", "periods", periods),
    BenchFile("period against amplitude", "period_amplitude.csv", "periods", period_by_amplitude),
    BenchFile("counter first", "counter_first.csv", "angle", counter_first),
    BenchFile("footer and cut line", "footer_cut.csv", "angle", footer_and_cut),
    BenchFile("iso time stamps", "iso_stamps.csv", "angle", iso_stamps),
    BenchFile("clock times", "clock_stamps.csv", "angle", clock_stamps),
    BenchFile("degree signs", "degree_signs.csv", "angle", degree_signs),
    BenchFile("bare milliseconds", "bare_milliseconds.csv", "angle", bare_milliseconds),
    BenchFile("clock set back", "clock_back.csv", "angle", clock_back),
    BenchFile("zero jumps", "zero_jumps.csv", "angle", zero_jumps),
    BenchFile("lost as zero", "lost_as_zero.csv", "angle", lost_as_zero),
    BenchFile("dead channel", "dead_channel.csv", "angle", dead_channel),
    BenchFile("two runs", "two_runs.csv", "angle", two_runs, RUNS),
    BenchFile("german decimal commas", "winkel.csv", "angle", german),
    BenchFile("absolute rate", "absolute_rate.csv", "rate", absolute_rate),
    BenchFile("phone on a rod", "acceleration_rod.csv", "acceleration", phone_on_a_rod),
    BenchFile("physics toolbox g-force", "toolbox_force.csv", "acceleration", toolbox_force),
    BenchFile("absolute acceleration", "absolute_acceleration.csv", "acceleration", absolute_acceleration),
    BenchFile("acceleration across a rod", "acceleration_across.csv", "acceleration", across_acceleration, ACROSS),
    BenchFile("acceleration without g", "linear_acceleration.csv", "acceleration", linear_acceleration, LINEAR),
    BenchFile("phyphox gyroscope xls", "gyroscope.xls", "rate", phyphox_xls),
    BenchFile("arduino with words between", "arduino_words.txt", "angle", arduino_lines),
    BenchFile("arduino serial plotter", "arduino_plotter.txt", "angle", arduino_labels),
    BenchFile("motion unit without units", "mpu6050.csv", "acceleration", motion_unit),
    BenchFile("commas after thousands", "thousands.csv", "angle", thousands),
    BenchFile("nameless axes", "nameless_axes.csv", "rate", nameless_axes, AXES),
)


def written(name: str, folder: Path, seed: int = 5) -> tuple[Path, Truth]:
    """Writes a file of a format, drawn by a seed and the format's name; its path and its truth."""
    one = next(one for one in BENCH_FILES if one.name == name)
    path = folder / one.suffix
    return path, one.write(path, np.random.default_rng([seed, zlib.crc32(name.encode())]))


def main() -> None:
    """Writes all files of a seed into a folder and prints the name, the path and the truth of each."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    for number, bench in enumerate(BENCH_FILES):
        path = given.folder / bench.suffix
        truth = bench.write(path, np.random.default_rng([given.seed, number]))
        told = ", ".join(f"{key} {value:.6g}" for key, value in truth.items())
        print(f"{bench.name}: {path}: {told}{' (ambiguous)' if bench.ambiguous else ''}")


if __name__ == "__main__":
    main()
