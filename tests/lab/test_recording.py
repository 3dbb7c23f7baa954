"""Test reading of sensor files: every format gives the same swing, inferred settings are noted, bad lines are named."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pendulum_env.lab import (
    Recording,
    RecordingError,
    decay_rate,
    period,
    small_amplitude_period,
    turning_points,
)

TIME = np.round(np.arange(0.0, 6.0, 0.05), 2)
DEGREES = np.round(30 * np.exp(-0.05 * TIME) * np.cos(4.0 * TIME), 2)
ROWS = list(zip(TIME.tolist(), DEGREES.tolist(), strict=True))
Write = Callable[[str | bytes], Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def to_file(content: str | bytes) -> Path:
        path = tmp_path / "swing.txt"
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return to_file


def table(
    separator: str = "\t", header: str = "", comma: bool = False, end: str = "\n", more: str = ""
) -> str:
    lines = [f"{t:.2f}{separator}{a:.2f}{more}" for t, a in ROWS]
    return header + end.join(line.replace(".", ",") if comma else line for line in lines) + end


FORMATS: dict[str, tuple[str | bytes, str]] = {
    "tab": (table(), "separator: tab"),
    "comma": (table(","), "separator: comma"),
    "comma and blank": (table(", "), "separator: comma"),
    "semicolon": (table(";"), "separator: semicolon"),
    "blanks": (table("   "), "separator: white space"),
    "one header line": (table(header="Time (s)\tAngle (deg)\n"), "header: 1 line"),
    "two header lines": (table(",", header="Run 1\ntime,angle\n"), "header: 2 lines"),
    "line of units": (table(",", header="time,angle\ns,°\n"), "unit: deg, as the header says"),
    "comment lines": (table(header="# time [s], angle [deg]\n\n"), "unit: deg, as the header says"),
    "decimal commas, tab": (table(comma=True), "separator: tab"),
    "decimal commas, semicolon": (table(";", comma=True), "separator: semicolon"),
    "decimal commas, blanks": (table(" ", comma=True), "separator: white space"),
    "comment among the rows": (table().replace("\n", "\n# in rad\n", 1), "separator: tab"),
    "CRLF": (table(end="\r\n"), "header: no lines"),
    "old Mac": (table(end="\r"), "header: no lines"),
    "byte-order mark": (b"\xef\xbb\xbf" + table(header="Time,Angle\n").encode(), "header: 1 line"),
    "mark before a number": (b"\xef\xbb\xbf" + table().encode(), "header: no lines"),
    "UTF-16": (table(header="t\tphi (°)\r\n").encode("utf-16"), "unit: deg, as the header says"),
    "Latin-1": (table(header="t\tphi (°)\r\n").encode("latin-1"), "unit: deg, as the header says"),
    "further columns": (table(more="\t1.5\t2"), "columns: the first two of 4 are read"),
    "closing separators": (table(",", more=",,"), "separator: comma"),
    "quoted": (table(",", header='"t","a"\n').replace("0.00,30.00", '"0.00","30.00"'), "header: 1 line"),
    "typographic minus": (table().replace("-", "\N{MINUS SIGN}"), "separator: tab"),
    "no final newline": (table().rstrip("\n"), "header: no lines"),
}


@pytest.mark.parametrize("form", FORMATS)
def test_every_format_gives_the_same_swing(write: Write, form: str) -> None:
    content, note = FORMATS[form]
    recording = Recording.read(write(content))
    np.testing.assert_array_equal(recording.time, TIME)
    np.testing.assert_array_equal(recording.angle, DEGREES * (math.pi / 180))
    assert note in recording.notes
    assert recording.source == "swing.txt"
    assert any(said.startswith("columns: ") for said in recording.notes) == (form == "further columns")
    assert not any(said.startswith(("dropped: ", "unit: rad")) for said in recording.notes)


ANGLES = "".join(f"{a:.2f}\n" for a in DEGREES)
LOGS: dict[str, tuple[str, dict[str, Any]]] = {
    "names and values": (f"trigger_start_deg, sample_rate, duration_sec\n30, 20, 6 \n{ANGLES}", {}),
    "rate in words": (f"angle in degrees at 20 Hz\n{ANGLES}", {}),
    "rate in a comment": (f"# sample rate = 20.0\n# deg\n{ANGLES}", {}),
    "rate given": (ANGLES, {"rate": 20.0}),
    "rate given against the header": (f"sample_rate, duration\n999, 6\n{ANGLES}", {"rate": 20.0}),
}


@pytest.mark.parametrize("form", LOGS)
def test_encoder_logs(write: Write, form: str) -> None:
    content, options = LOGS[form]
    recording = Recording.read(write(content), **options)
    np.testing.assert_allclose(recording.time, TIME, rtol=1e-15)
    np.testing.assert_array_equal(recording.angle, DEGREES * (math.pi / 180))
    assert f"rate: 20 Hz, as {'given' if options else 'the header says'}" in recording.notes


@pytest.mark.parametrize(
    ("header", "largest", "told", "unit", "said"),
    [
        ("t,angle (rad)\n", 10.0, None, "rad", "as the header says"),
        ("t,angle_rad,velocity (deg/s)\n", 3.0, None, "rad", "as the header says"),
        ("t,Winkel in Grad [°]\n", 3.0, None, "deg", "as the header says"),
        ("t,degrees,velocity (rad/s)\n", 3.0, None, "deg", "as the header says"),
        ("t,angle,velocity (deg/s)\n", 3.0, None, "rad", "inferred: .*3, is not above 2 pi"),
        ("", 6.28, None, "rad", "inferred: .*6.28, is not above 2 pi"),
        ("", 6.29, None, "deg", "inferred: .*6.29, is above 2 pi"),
        ("", 3.0, "deg", "deg", "as given"),
        ("t,degrees\n", 12.0, "rad", "rad", "as given"),
    ],
)
def test_unit_is_told_or_read_or_inferred(
    write: Write, header: str, largest: float, told: str | None, unit: str, said: str
) -> None:
    rows = "".join(f"{i},{-largest * i / 8},0\n" for i in range(9))
    recording = Recording.read(write(header + rows), unit=told)
    factor = {"deg": math.pi / 180, "rad": 1.0}[unit]
    np.testing.assert_allclose(recording.angle, -largest * factor * np.arange(9) / 8, rtol=1e-15)
    (note,) = [note for note in recording.notes if note.startswith("unit: ")]
    assert note.startswith(f"unit: {unit}, ")
    assert re.search(said, note)


def test_rate_and_scale_override_the_file(write: Write) -> None:
    path = write(table())
    recording = Recording.read(path, rate=100, scale=0.99)
    np.testing.assert_allclose(recording.time, np.arange(len(TIME)) / 100, rtol=1e-15)
    np.testing.assert_allclose(recording.angle, Recording.read(path).angle * 0.99, rtol=1e-15)
    assert "rate: 100 Hz, as given, in place of the time column" in recording.notes
    assert "scale: angle multiplied by 0.99" in recording.notes


def test_milliseconds_in_the_header(write: Write) -> None:
    recording = Recording.read(write("Time (ms),Angle (rad)\n0,0.1\n50,0.2\n100,0.3\n"))
    np.testing.assert_allclose(recording.time, [0.0, 0.05, 0.1])
    assert "time: in ms, as the header says" in recording.notes


def test_missing_values_and_repeated_times_are_dropped_and_said(write: Write) -> None:
    text = "0.0,0.1\n0.1,nan\n0.2,0.2\n0.2,0.9\nNaN,0.3\n0.3,\n0.4,inf\n\n0.5,0.3\n0.6,0.4\n"
    recording = Recording.read(write(text))
    assert recording.time.tolist() == [0.0, 0.2, 0.5, 0.6]
    assert recording.angle.tolist() == [0.1, 0.2, 0.3, 0.4]
    assert "dropped: 4 lines without a finite time and angle (the first: line 2)" in recording.notes
    assert "dropped: 1 lines that repeat a time (the first: line 4)" in recording.notes


def test_a_dropped_encoder_line_keeps_its_place_in_time(write: Write) -> None:
    recording = Recording.read(write("0.1\n0.2\nnan\n0.4\n"), rate=10)
    np.testing.assert_allclose(recording.time, [0.0, 0.1, 0.3])


def test_angles_are_unwrapped(write: Write) -> None:
    true = np.arange(0.0, 1000.0, 50.0)
    wrapped = (true + 180) % 360 - 180
    recording = Recording.read(write("".join(f"{i},{a}\n" for i, a in enumerate(wrapped))))
    np.testing.assert_allclose(recording.angle, np.radians(true), atol=1e-12)
    assert "unwrapped: 3 jumps of more than half a turn" in recording.notes


BAD_LINES = {
    "text": (
        "t,a\n0.0,0.1\n0.1,abc\n0.2,0.3\n0.3,0.2\n",
        "line 3: expected a time and an angle, found '0.1  abc'",
    ),
    "short": ("0.0,0.1\n0.1\n0.2,0.3\n0.3,0.2\n", "line 2: expected a time and an angle, found '0.1'"),
    "a line of one number": (
        "0.0,0.1\n0.1,0.2\n0.2,0.3\n0.3\n0.4,0.2",
        "line 4: expected a time and an angle, found '0.3'",
    ),
    "two dots": ("0.0 0.1\n0.1 0.3.1\n0.2 0.2\n0.3 0.1\n", "line 2: expected a time and an angle, found '0.1  0.3.1'"),
    "first": ("0.0,x\n0.1,0.2\n0.2,0.3\n0.3,0.4\n", "line 1: expected a header or numbers, found '0.0,x'"),
    "python number": ("0,1\n1,1_0\n2,1\n3,1\n", "line 2: expected a time and an angle, found '1  1_0'"),
    "log": ("rate 10 Hz\n1.0\n2.0\n3.0 4.0\n5.0\n", "line 4: expected one angle, found '3.0  4.0'"),
    "prose": ("one\ntwo\n" * 7, "line 13: expected numbers after at most 12 header lines, found 'one'"),
    "backwards": (
        "t,a\n\n0.0,0.1\n0.1,0.2\n0.05,0.3\n0.2,0.1\n",
        "line 5: expected a time above 0.1 s, found 0.05 s",
    ),
    "commas for both": (
        table(",", comma=True),
        "line 2: expected times that increase, 114 of 120 repeat one (decimal commas need tab or ;",
    ),
}


@pytest.mark.parametrize("case", BAD_LINES)
def test_a_bad_line_is_named(write: Write, case: str) -> None:
    content, message = BAD_LINES[case]
    path = write(content)
    with pytest.raises(RecordingError) as raised:
        Recording.read(path)
    assert str(raised.value).startswith(f"{path}: {message}")


BAD_FILES: dict[str, tuple[str | bytes, str]] = {
    "empty": ("", "the file is empty"),
    "blank": (" \n\n\t\n", "the file is empty"),
    "header only": ("time,angle\n", "found no numbers"),
    "two points": ("0,1\n1,2\n", "expected at least 3 points, found 2"),
    "all missing": ("0,nan\n1,nan\n2,nan\n", "expected at least 3 points, found 0"),
    "no rate": (ANGLES, "expected times, or a rate in the header, found neither"),
    "binary": (b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR" + bytes(range(256)), "found binary data"),
    "broken UTF-16": (b"\xff\xfe\x00", "found binary data"),
}


@pytest.mark.parametrize("case", BAD_FILES)
def test_a_file_that_is_no_recording(write: Write, case: str) -> None:
    content, message = BAD_FILES[case]
    with pytest.raises(RecordingError, match=r"swing\.txt: ") as raised:
        Recording.read(write(content))
    assert message in str(raised.value)


def test_a_missing_file_and_a_folder(tmp_path: Path) -> None:
    with pytest.raises(
        RecordingError, match=r"none\.txt: expected a file that can be read: no such file"
    ):
        Recording.read(tmp_path / "none.txt")
    with pytest.raises(RecordingError, match="expected a file that can be read: is a directory"):
        Recording.read(tmp_path)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"unit": "degrees"}, r"unit must be 'deg' or 'rad', got 'degrees' \(did you mean 'deg'\?\)"),
        ({"rate": 0.0}, "rate must be a positive number of samples per second, got 0.0"),
        ({"rate": math.nan}, "rate must be"),
        ({"scale": 0.0}, "scale must be a finite number other than 0, got 0.0"),
        ({"scale": math.inf}, "scale must be"),
    ],
)
def test_bad_options(write: Write, options: dict[str, Any], message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        Recording.read(write(table()), **options)


@pytest.mark.parametrize(
    ("time", "angle", "message"),
    [
        ([0.0, 1.0, 2.0], [0.0, 1.0], "made: expected time and angle of one length"),
        ([0.0, 1.0], [0.0, 1.0], "made: expected at least 3 points, found 2"),
        ([0.0, 1.0, 1.0], [0.0, 1.0, 2.0], "made: expected times that increase"),
        ([0.0, 1.0, 2.0], [0.0, math.nan, 2.0], "made: expected finite times and angles"),
    ],
)
def test_a_recording_checks_its_arrays(time: list[float], angle: list[float], message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        Recording(np.array(time), np.array(angle), "made")


def test_a_recording_can_not_be_changed() -> None:
    time = np.arange(5.0)
    recording = Recording(time, time, "made")
    time[0] = -1.0
    assert recording.time[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        recording.angle[0] = 1.0


OFFSET, SWING = 0.04, 0.6


def by_hand(hold: float, *, thrown: float = 0.0, noise: float = 0.001) -> tuple[Recording, float]:
    """Return a recording with a known offset, and the time of the first turning point of the free swing.

    The bob rests for 2 s, is pulled aside within 1.5 s, is held, and is released at rest or ``thrown`` s before its
    turning point.
    """
    time = np.arange(0.0, 60.0, 0.02)
    let_go = 3.5 + hold
    pull = SWING * np.clip((time - 2.0) / 1.5, 0, 1) ** 2 * (3 - 2 * np.clip((time - 2.0) / 1.5, 0, 1))
    wobble = 0.03 * np.sin(1.3 * (time - 3.5)) ** 2 * (time > 3.5) * (time < let_go)
    turn = let_go + thrown
    free = SWING * np.exp(-0.02 * (time - turn)) * np.cos(3.8 * (time - turn))
    held = (pull - wobble) * (math.cos(3.8 * thrown) if thrown else 1.0)
    angle = np.where(time < let_go, held, free) + OFFSET
    angle += noise * np.random.default_rng(7).standard_normal(len(time))
    return Recording(time, angle, "made"), turn


@pytest.mark.parametrize("hold", [1.0, 2.0, 4.7])
def test_the_hand_is_cut_off(hold: float) -> None:
    recording, let_go = by_hand(hold)
    free = recording.released()
    cut = len(recording.time) - len(free.time)
    start = recording.time[cut] - free.time[0]
    quarter = math.pi / 3.8 / 2
    assert min(abs(start - let_go), abs(start - let_go - 2 * quarter)) < 0.1 * quarter
    assert 0 <= free.time[0] < 0.02
    assert free.notes[-1] == f"release: time zero at {round(start, 4):g} s, {cut} earlier points cut off"
    assert decay_rate(free.centred()).value == pytest.approx(0.04, rel=0.02)


def test_a_thrown_bob_starts_at_its_turning_point() -> None:
    recording, turn = by_hand(0.0, thrown=0.15)
    free = recording.released()
    assert recording.time[-len(free.time)] - free.time[0] == pytest.approx(turn, abs=0.005)


def test_a_recording_without_a_hand_is_left_alone() -> None:
    time = np.arange(0.0, 30.0, 0.02)
    noise = 0.002 * np.random.default_rng(2).standard_normal(len(time))
    steady = Recording(time, 0.5 * np.cos(4 * time) + noise, "made")
    assert steady.released() is steady
    later = Recording(time + 12.3, steady.angle, "made").released()
    np.testing.assert_allclose(later.time, time, atol=1e-12)


def test_the_offset_is_taken_out() -> None:
    recording, _ = by_hand(2.0)
    for centred in (recording.centred(), recording.released().centred()):
        removed = recording.angle[-1] - centred.angle[-1]
        assert removed == pytest.approx(OFFSET, abs=3 * 0.001 / math.sqrt(8))
        assert centred.notes[-1].startswith(f"equilibrium: {removed:.3g} rad subtracted (middle of ")


def test_the_hand_does_not_shift_the_equilibrium() -> None:
    recording, let_go = by_hand(2.0)
    keep = recording.time < let_go + 5 * math.pi / 3.8
    short = Recording(recording.time[keep], recording.angle[keep], "made")
    assert recording.angle[0] - short.centred().angle[0] == pytest.approx(OFFSET, abs=0.003)


@pytest.mark.parametrize("hold", [1.0, 2.0, 4.7])
def test_release_and_centre_once_is_enough(hold: float) -> None:
    recording, _ = by_hand(hold)
    done = recording.released().centred()
    assert done.released() is done
    assert done.centred() is done
    other = recording.centred().released()
    np.testing.assert_allclose(other.angle, done.angle, atol=1e-5)


def test_an_overdamped_swing_is_centred_on_its_rest() -> None:
    time = np.arange(0.0, 20.0, 0.02)
    noise = 0.001 * np.random.default_rng(5).standard_normal(len(time))
    creeping = Recording(time, 0.5 * np.exp(-time) + OFFSET + noise, "made")
    centred = creeping.centred()
    assert creeping.angle[0] - centred.angle[0] == pytest.approx(OFFSET, abs=4e-4)
    assert centred.notes[-1].endswith("rad subtracted (resting value)")
    with pytest.raises(RecordingError, match="made: expected a swing that turns back, found none"):
        creeping.released()
    falling = Recording(time, np.exp(-0.05 * time), "made")
    with pytest.raises(
        RecordingError, match="made: expected 3 turning points of a free swing, found 0 and no"
    ):
        falling.centred()


DATA = os.environ.get("LAB_PENDULUM_DATA", "")
real = pytest.mark.skipif(not DATA, reason="LAB_PENDULUM_DATA names no folder of real recordings")


@real
def test_the_filmed_pendulum() -> None:
    raw = Recording.read(Path(DATA) / "video_decay_65cm.txt")
    assert len(raw.time) == 2330
    assert raw.time[-1] == pytest.approx(116.409, abs=1e-3)
    assert math.degrees(raw.angle[0]) == pytest.approx(40.22, abs=0.01)
    assert raw.released() is raw
    swing = raw.centred()
    points = turning_points(swing)
    assert len(points.time) == 2 * 71 - 1
    assert math.degrees(points.amplitude[0]) == pytest.approx(39, abs=0.5)
    assert math.degrees(points.amplitude[-1]) == pytest.approx(11, abs=0.5)
    small = small_amplitude_period(period(swing), points.amplitude)
    assert small.value == pytest.approx(1.634, abs=0.003)
    assert 9.81 * (small.value / (2 * math.pi)) ** 2 == pytest.approx(0.663, abs=0.002)


@real
def test_the_encoder() -> None:
    raw = Recording.read(Path(DATA) / "encoder_short_rod_45deg.txt", scale=0.99)
    assert len(raw.time) == 5000
    assert np.diff(raw.time) == pytest.approx(1e-3)
    assert math.degrees(raw.angle[0]) == pytest.approx(-45.27 * 0.99)
    swing = raw.released().centred()
    assert "release: time zero at 0.124" in swing.notes[-2]
    points = turning_points(swing)
    assert (np.diff(points.amplitude) < 0).all()
    small = small_amplitude_period(period(swing), points.amplitude[:-1])
    uniform_rod = 2 * math.pi * math.sqrt(2 * 0.124 / (3 * 9.81))
    assert small.value == pytest.approx(uniform_rod, rel=0.02)


@pytest.mark.parametrize("peak", [0.1, 0.5, 0.95])
def test_a_bob_that_is_held_for_a_second_is_released_where_it_starts(peak: float) -> None:
    """Wherever the noise of the hold is largest."""
    time = np.arange(0.0, 20.0, 1.0 / 30.0)
    angle = np.where(time < 1.0, 0.6, 0.6 * np.exp(-0.01 * (time - 1.0)) * np.cos(4.5 * (time - 1.0)))
    angle += 2e-3 * np.random.default_rng(3).standard_normal(len(time))
    angle[np.searchsorted(time, peak)] += 0.01
    free = Recording(time, angle, "held").released()
    assert free.release is not None
    assert free.release > 0.9 or free.release == pytest.approx(1.0 + math.pi / 4.5, abs=0.05)
