"""Test that settings of a file are inferred and noted, and that given settings win: columns, marks, units, release,
zero."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pendulum_env.lab import Recording, RecordingError

TIME = np.arange(0.0, 20.0, 0.05)
DEGREES = np.round(40.0 * np.exp(-0.02 * TIME) * np.cos(4.0 * TIME) + 3.0, 3)
Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def to_file(header: str, *columns: Any, mark: str = ",", decimal: str = ".", quote: str = "") -> Path:
        path = tmp_path / "swing.txt"
        rows = (mark.join(f"{quote}{x:.10g}{quote}".replace(".", decimal) for x in row)
                for row in zip(*columns, strict=True))
        path.write_text(header + "\n".join(rows) + "\n", encoding="utf-8")
        return path

    return to_file


OTHER = np.arange(float(len(TIME)))
LAYOUTS: dict[str, tuple[str, tuple[Any, ...], dict[str, Any], str]] = {
    "velocity before angle": (
        "Time (s),Velocity (deg/s),Angle (deg)\n", (TIME, OTHER, DEGREES), {},
        "1 (Time (s)), 3 (Angle (deg)), as the header"),
    "angle first": ("angle (deg),time (s)\n", (DEGREES, TIME), {}, "2 (time (s)), 1 (angle (deg)), as the header"),
    "line of units": ("Run,t,phi\n,s,°\n", (OTHER, TIME, DEGREES), {}, "2 (t s), 3 (phi °), as the header"),
    "a comment": ("# no, time, angle\n", (OTHER, TIME, DEGREES), {}, "2 (time), 3 (angle), as the header"),
    "given by number": ("", (DEGREES, OTHER, TIME), {"columns": (3, 1)}, "3, 1, as given"),
    "given by name": ("a,b,c\n", (OTHER, TIME, DEGREES), {"columns": ["B", "c"]}, "2 (b), 3 (c), as given"),
    "given by both": ("t,u,v\n", (TIME, OTHER, DEGREES), {"columns": ("t", 3)}, "1 (t), 3 (v), as given"),
    "angle alone": ("a,b\n", (OTHER, DEGREES), {"columns": ("b",), "rate": 20}, "2 (b), as given"),
    "given against the names": ("t,angle,b\n", (TIME, OTHER, DEGREES), {"columns": (1, 3)}, "1 (t), 3 (b), as given"),
}


@pytest.mark.parametrize("case", LAYOUTS)
@pytest.mark.parametrize("mark", [",", "\t", ";"])
def test_columns_are_named_or_told(write: Write, case: str, mark: str) -> None:
    header, columns, options, said = LAYOUTS[case]
    found = Recording.read(write(header.replace(",", mark), *columns, mark=mark), **options)
    np.testing.assert_allclose(found.time, TIME, atol=1e-12)
    np.testing.assert_allclose(np.degrees(found.angle), DEGREES, atol=1e-12)
    assert any(note.startswith(f"columns: {said}") for note in found.notes)


BAD_COLUMNS: dict[str, tuple[Any, dict[str, Any], str]] = {
    "unknown name": (("tiem", "a"), {}, "swing.txt: there is no column 'tiem'; did you mean time?"),
    "no number": ((0, 1), {}, "a column is given by its name, or a number from 1 to 3, not 0"),
    "too far": ((1, 4), {}, "a column is given by its name, or a number from 1 to 3, not 4"),
    "truth": ((True, 2), {}, "a number from 1 to 3, not True"),
    "twice": ((2, 2), {}, "columns must be different ones, got (2, 2)"),
    "four": ((1, 2, 3, 1), {}, "columns must be 'xy', or names or numbers of (time, angle), (time, x, y) or, with"),
    "none": ((), {}, "columns must be 'xy'"),
    "text": ("yx", {}, "columns must be 'xy'"),
    "no time": ((2,), {}, "columns must include the time unless rate= is given, got (2,)"),
}


@pytest.mark.parametrize("case", BAD_COLUMNS)
def test_columns_that_are_not_there(write: Write, case: str) -> None:
    columns, options, message = BAD_COLUMNS[case]
    with pytest.raises(RecordingError, match=re.escape(message)):
        Recording.read(write("time,a,b\n", TIME, DEGREES, OTHER), columns=columns, **options)


def test_names_are_asked_for_where_there_are_none(write: Write) -> None:
    with pytest.raises(RecordingError, match=r"there is no column 'time'; its columns have no names\."):
        Recording.read(write("", TIME, DEGREES), columns=("time", "angle"))


MARKS: dict[str, tuple[dict[str, Any], dict[str, Any], str]] = {
    "decimal commas in quotes": ({"decimal": ",", "quote": '"'}, {}, "decimal marks: commas"),
    "decimal commas": ({"mark": ";", "decimal": ","}, {}, "decimal marks: commas"),
    "given": ({"mark": ";", "decimal": ","}, {"separator": ";", "decimal": ","}, "separator: semicolon"),
    "white space, told": ({"mark": " ", "decimal": ","}, {"separator": " "}, "separator: white space"),
    "points, told": ({}, {"decimal": "."}, "separator: comma"),
}


@pytest.mark.parametrize("case", MARKS)
def test_marks_are_seen_or_told(write: Write, case: str) -> None:
    form, options, said = MARKS[case]
    found = Recording.read(write("t,a\n".replace(",", form.get("mark", ",")), TIME, DEGREES, **form), **options)
    np.testing.assert_allclose(np.degrees(found.angle), DEGREES, atol=1e-12)
    assert said in found.notes


def test_a_wrong_decimal_comma_is_read_and_said_or_refused(write: Write) -> None:
    path = write("", TIME, DEGREES, mark="\t")
    path.write_text(path.read_text().replace("0.1\t", "0,1\t", 1))
    found = Recording.read(path)
    np.testing.assert_allclose(found.time, TIME, atol=1e-12)
    assert "decimal marks: commas, and points: commas in 1 of 400 lines" in found.notes
    with pytest.raises(RecordingError, match="line 3: expected a time and an angle, found '0,1  "):
        Recording.read(path, decimal=".")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"separator": "|"}, "separator must be '\\t' or ';' or ',' or ' ', got '|'"),
        ({"decimal": "x"}, "decimal must be '.' or ',', got 'x'"),
        ({"separator": ",", "decimal": ","}, "separator and decimal must be different marks, got ',' for both"),
        ({"time_unit": "msec"}, "time_unit must be 's' or 'ms' or 'us' or 'ns' or 'min' or 'h', got 'msec'"),
        ({"time_unit": "ms", "rate": 20}, "rate and time_unit must not both be given"),
        ({"y_axis": "left"}, "y_axis must be 'up' or 'down', got 'left'"),
        ({"release": "x"}, "release must be a finite number, not 'x'."),
        ({"zero": math.inf}, "zero must be a finite number, not inf."),
        ({"release": 20.0}, "release must leave at least 3 points, 20 s leaves 0 (the recording ends at 19.95 s)"),
    ],
)
def test_bad_choices(write: Write, options: dict[str, Any], message: str) -> None:
    with pytest.raises(RecordingError, match=re.escape(message)):
        Recording.read(write("", TIME, DEGREES), **options)


UNITS: dict[str, tuple[str, Any, str]] = {
    "coarse steps": ("", np.round(3 * np.cos(4 * TIME) / 0.25) * 0.25, "deg, inferred: steps of 0.25 are too coarse"),
    "fine steps": ("", np.round(3 * np.cos(4 * TIME), 2), "rad, inferred: the largest |angle|, 3, is not above 2 pi"),
    "a radius is no unit": ("# radius 0.02, gradient\n", DEGREES, "deg, inferred"),
    "a comment of both": ("# 0.25 deg, or 0.0044 rad\nt,a\n", DEGREES, "deg, inferred"),
    "title before comment": ("# start 0.5 rad\nt,a (deg)\n", DEGREES / 100, "deg, as the header says"),
    "a comment alone": ("# all in radians\n", DEGREES / 100, "rad, as the header says"),
}


@pytest.mark.parametrize("case", UNITS)
def test_the_unit_is_not_mistaken(write: Write, case: str) -> None:
    header, angle, said = UNITS[case]
    found = Recording.read(write(header, TIME, angle))
    assert any(note.startswith(f"unit: {said}") for note in found.notes), found.notes


@pytest.mark.parametrize(("unit", "factor"), [("ms", 1e3), ("µs", 1e6), ("us", 1e6)])
def test_times_in_parts_of_a_second(write: Write, unit: str, factor: float) -> None:
    found = Recording.read(write(f"t [{unit}],angle [deg]\n", TIME * factor, DEGREES))
    np.testing.assert_allclose(found.time, TIME, atol=1e-9)


def test_gaps_are_said_with_place_and_length(write: Write) -> None:
    keep = ~((TIME > 3.01) & (TIME < 4.99)) & ~((TIME > 10.01) & (TIME < 10.34))
    found = Recording.read(write("t,deg\n", TIME[keep], DEGREES[keep]))
    assert "gaps: 2 longer than 5 median steps: 2 s after 3 s, 0.35 s after 10 s" in found.notes
    whole = Recording.read(write("t,deg\n", TIME, DEGREES))
    assert not any(note.startswith("gaps") for note in whole.notes)


def wrapped(degrees: Any) -> Any:
    return (degrees + 180.0) % 360.0 - 180.0


def test_turns_across_a_gap_are_not_made_up(write: Write) -> None:
    swing = 170.0 * np.cos(2.0 * TIME)
    keep = (TIME < 0.3) | (TIME > 1.4)
    found = Recording.read(write("t,deg\n", TIME[keep], swing[keep]))
    np.testing.assert_allclose(np.degrees(found.angle), swing[keep], atol=1e-7)
    assert "not unwrapped: 1 jump of more than half a turn, left as written, as they are only in gaps" in found.notes

    turning = wrapped(100.0 * TIME)
    keep = (TIME < 8.0) | (TIME > 12.0)
    found = Recording.read(write("t,deg\n", TIME[keep], turning[keep]))
    assert (np.diff(found.angle) > 0).all()
    assert "turns: unknown across 1 gap, the smallest number is assumed" in found.notes


def test_an_angle_of_more_than_a_turn_is_not_unwrapped(write: Write) -> None:
    counted = 200.0 * np.arange(len(TIME))
    found = Recording.read(write("t,deg\n", TIME, counted))
    np.testing.assert_allclose(np.degrees(found.angle), counted)
    (note,) = [note for note in found.notes if "unwrapped" in note]
    assert note == ("not unwrapped: 399 jumps of more than half a turn, left as written, "
                    "as the angle covers more than one turn")


def test_a_told_release_and_zero_stay(write: Write) -> None:
    found = Recording.read(write("t,deg\n", TIME, DEGREES), release=2.03, zero=3.0, scale=-1.0)
    keep = TIME >= 2.03
    np.testing.assert_allclose(found.time, TIME[keep] - 2.03, atol=1e-12)
    np.testing.assert_allclose(np.degrees(found.angle), 3.0 - DEGREES[keep], atol=1e-12)
    assert found.release == 2.03
    assert found.zero == pytest.approx(-math.radians(3.0))
    assert found.released() is found
    assert found.centred() is found
    assert found.notes[-2:] == ("release: time zero at 2.03 s, 41 earlier points cut off, as given",
                                "equilibrium: -0.0524 rad subtracted (as given)")
    again = found.released(1.0).centred(0.1)
    assert again.time[0] == pytest.approx(2.05 - 2.03 + 1.0 - 1.0, abs=0.05)
    assert (again.release, again.zero) == (1.0, 0.1)


def test_what_is_printed(write: Write) -> None:
    rng = np.random.default_rng(1)
    time = np.round(TIME + 0.01 * rng.uniform(-1, 1, len(TIME)), 4)
    swing = 40.0 * np.exp(-0.02 * time) * np.cos(4.0 * time) + 3.0
    path = write("Time (s),Angle (deg)\n", time, np.round(swing / 0.25) * 0.25)
    found = Recording.read(path, scale=0.99)
    lines = str(found).splitlines()
    assert lines[0] == f"swing.txt: 400 points in {time[-1] - time[0]:.6g} s"
    assert re.fullmatch(r"  rate: (19\.9|20|20\.0)\d* Hz, uneven: steps of 0\.03\d* to 0\.06\d* s", lines[1])
    assert re.fullmatch(r"  quantum: 0\.2475 deg; noise: 0\.0[67]\d* deg", lines[2])
    assert tuple(line.strip() for line in lines[3:6]) == found.notes[:3]
    assert "  scale: angle multiplied by 0.99" in lines
    subtracted = r"  equilibrium: 0\.05\d+ rad subtracted \(middle of \d+ turning points\), before it is measured"
    assert re.fullmatch(subtracted, lines[-1])
    assert str(found.centred()).splitlines()[-1] == lines[-1].removesuffix(", before it is measured")
    creeping = Recording(TIME, np.exp(-0.05 * TIME), "made")
    assert "rate: 20 Hz, even" in creeping.text
    assert "quantum: none seen" in creeping.text
    assert " not found (expected a swing that turns back, found none above noise; readings that only" in creeping.text


ODD_FILES: dict[str, tuple[bytes, str]] = {
    "HTML": (b"<html>\n<body>\n" + b"<p>4</p>\n" * 11, "line 13: expected numbers after at most 12 header lines"),
    "JSON": (b'{"angle": [1, 2]}', "found no numbers"),
    "compressed": (b"\x1f\x8b\x08\x00" + bytes(range(64)), "found binary data"),
    "spreadsheet": (b"PK\x03\x04\x14\x00\x06\x00" + bytes(range(64)), "found binary data"),
    "UTF-16 without mark": ("0,1\n1,2\n2,3\n".encode("utf-16-le"), "found binary data"),
    "one clock time": (b"10:00:01,1\n" * 20, "line 2: expected times that increase, 19 of 20 repeat one"),
    "second header": (b"t,a\n0,1\n1,2\nt,a\n2,3\n", "line 4: expected a time and an angle, found 't  a'"),
    "13 titles": (b"a\n" * 13 + b"0,1\n1,2\n", "line 13: expected numbers after at most 12 header lines, found 'a'"),
    "angle first": (
        b"30,0\n20,1\n10,2\n0,3\n",
        "line 2: expected a time above 30 s, found 20 s (if the angle is the first column, give columns=(2, 1))"),
    "thousands": (b"0\t1,000.5\n1\t2,3\n", "line 1: expected a header or numbers"),
    "time stands still": (b"1,1\n1,2\n1,3\n1,4\n", "line 2: expected times that increase, 3 of 4 repeat one"),
    "no angle": (b"t,angle\n0,\n1,\n2,\n", "expected at least 3 points, found 0"),
}


@pytest.mark.parametrize("case", ODD_FILES)
def test_odd_files_are_refused_with_a_reason(tmp_path: Path, case: str) -> None:
    content, message = ODD_FILES[case]
    path = tmp_path / "odd.txt"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=r"odd\.txt: ") as raised:
        Recording.read(path)
    assert message in str(raised.value)


def test_lines_after_the_last_reading_are_left_out_and_others_refused(tmp_path: Path) -> None:
    path = tmp_path / "long.txt"
    rows = "".join(f"{i / 1000:.3f},{i % 90}\n" for i in range(5_000))
    path.write_text(f"{rows}oops\nMean: 3.2\n")
    found = Recording.read(path)
    assert len(found.time) == 5_000
    assert "end: 2 lines without all numbers left out after the last reading" in found.notes
    path.write_text(f"{rows}oops\n{''.join(f'{50 + i},1{chr(10)}' for i in range(20))}")
    assert "text: 1 lines without numbers left out (first: line 5001)" in Recording.read(path).notes
    path.write_text(f"{rows}50.0,oops\n{''.join(f'{50 + i},1{chr(10)}' for i in range(1, 21))}")
    with pytest.raises(RecordingError, match=r"line 5001: expected a time and an angle, found '50\.0  oops'"):
        Recording.read(path)


TIMES: dict[str, tuple[str, float, dict[str, Any], str]] = {
    "Arduino's milliseconds": ("millis,angle (deg)\n", 1e3, {}, "time: in ms, as the header says"),
    "its microseconds": ("micros,angle (deg)\n", 1e6, {}, "time: in us, as the header says"),
    "nanoseconds": ("timestamp_ns,angle_deg\n", 1e9, {}, "time: in ns, as the header says"),
    "minutes": ("Time (min),angle (deg)\n", 1 / 60, {}, "time: in min, as the header says"),
    "given": ("", 1e3, {"time_unit": "ms"}, "time: in ms, as given"),
    "given against the header": ("t (s),angle (deg)\n", 1e3, {"time_unit": "ms"}, "time: in ms, as given"),
    "nothing given": ("", 1.0, {}, "time: in s, as the header names no unit (time_unit= overrides)"),
}


@pytest.mark.parametrize("case", TIMES)
def test_the_unit_of_time_is_named_or_told_and_said(write: Write, case: str) -> None:
    header, factor, options, said = TIMES[case]
    found = Recording.read(write(header, TIME * factor, DEGREES), **options)
    np.testing.assert_allclose(found.time, TIME, atol=1e-9)
    assert said in found.notes
