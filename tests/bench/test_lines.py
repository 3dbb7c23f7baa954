"""Lines of samples: separators, titles, JSON, units of times by the host's clock, and what goes wrong in lines.

The lines are written here, by hand or from a swing in closed form, with arrival times of a clock of the test's own.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest

from pendulum_env.bench import SourceError
from pendulum_env.bench.lines import LineReader

TIME = 0.01 * np.arange(200)
ANGLE = np.round(20.0 * np.exp(-0.05 * TIME) * np.cos(5.0 * TIME), 3)


def fed(lines: Iterable[str | bytes], step: float = 0.01, start: float = 100.0, **given: Any) -> tuple[Any, ...]:
    """Feed a reader one line after the other; return it, all times, all angles and the number of lost samples."""
    reader = LineReader(**given)
    chunks = [reader.feed(line if isinstance(line, bytes) else line.encode(), start + step * i)
              for i, line in enumerate(lines)]
    chunks.append(reader.end(start + step * len(chunks)))
    times = np.concatenate([chunk.time for chunk in chunks if chunk.time is not None and len(chunk.values)] or [[]])
    return reader, times, np.concatenate([chunk.values[:, 0] for chunk in chunks]), sum(c.lost for c in chunks)


def written(time: Any, angle: Any, form: str = "{0}\t{1}\r\n") -> list[str]:
    return [form.format(t, a) for t, a in zip(time, angle, strict=True)]


MILLI, MICRO = (1000.0 * TIME).round().astype(int), (1e6 * TIME).round().astype(int)
FORMS: dict[str, tuple[list[str], dict[str, Any]]] = {
    "tabs": (written(TIME, ANGLE), {}),
    "commas": (written(TIME, ANGLE, "{0},{1}\n"), {}),
    "spaces": (written(TIME, ANGLE, "  {0}   {1}\n"), {}),
    "a comma at the end": (written(TIME, ANGLE, "{0}, {1},\n"), {}),
    "decimal commas": ([line.replace(".", ",") for line in written(TIME, ANGLE, "{0};{1}\n")], {}),
    "decimal commas, given": ([line.replace(".", ",") for line in written(TIME, ANGLE, "{0} {1}\n")],
                              {"separator": " ", "decimal": ","}),
    "titles": (["Angle (deg);Time (s)\n", *written(ANGLE, TIME, "{0};{1}\n")], {}),
    "titles of a comment": (["# time, angle\n", *written(TIME, ANGLE, "{0}, {1}\n")], {}),
    "radians": (["t,theta (rad)\n", *written(TIME, np.radians(ANGLE), "{0},{1:.12g}\n")], {}),
    "radians, given": (written(TIME, np.radians(ANGLE), "{0},{1:.12g}\n"), {"unit": "rad"}),
    "degree signs": (written(TIME, ANGLE, "{0}\t{1}°\n"), {}),
    "old Macs": (written(TIME, ANGLE, "{0}\t{1}\r"), {}),
    "third column": (written(TIME, ANGLE, "7,{0},{1}\n"), {"columns": "time=2,angle=3"}),
    "column by name": (["n,clock,value\n", *written(TIME, ANGLE, "7,{0},{1}\n")], {"columns": "time=2,angle=3"}),
    "labels": (written(TIME, ANGLE, "time:{0},angle:{1}\n"), {}),
    "JSON": ([json.dumps({"device": "a", "angle": a, "t": t}) + "\n" for t, a in zip(TIME, ANGLE, strict=True)], {}),
    "lists of JSON": ([json.dumps([t, a]) + "\n" for t, a in zip(TIME, ANGLE, strict=True)], {}),
    "milliseconds": (written(MILLI, ANGLE), {}), "microseconds": (written(MICRO, ANGLE), {}),
    "microseconds that begin late": (written(MICRO + 123_456_789, ANGLE), {}),
    "milliseconds, named": (["Time (ms)\tAngle (deg)\n", *written(MILLI, ANGLE)], {}),
    "microseconds, given": (written(MICRO, ANGLE), {"time_unit": "us"}),
    "boot messages": (["ets Jul 29 2019 12:21:46\n", "rst:0x1 (POWERON_RESET),boot:0x13\n", "ready\n", "\n",
                       *written(TIME, ANGLE)], {}),
}


@pytest.mark.parametrize("name", FORMS)
def test_every_form_of_lines_gives_the_same_samples(name: str) -> None:
    lines, given = FORMS[name]
    reader, times, angles, lost = fed(lines, **given)
    np.testing.assert_allclose(times - times[0], TIME, atol=1e-9)
    np.testing.assert_allclose(angles, ANGLE, atol=1e-9)
    assert lost == 0
    assert reader.problem == ""


@pytest.mark.parametrize(("factor", "unit"), [(1.0, "s"), (1e3, "ms"), (1e6, "us")])
def test_the_growth_of_times_decides_on_their_unit_and_says_so(factor: float, unit: str) -> None:
    """A second of lines that waited in a buffer comes at once; it says nothing of the unit."""
    stamps = [f"{factor * t:.6f} {a}\n" for t, a in zip(np.arange(300) / 100, [*ANGLE, *ANGLE[:100]], strict=True)]
    reader, times, _, _ = fed(["".join(stamps[:100]), *stamps[100:]])
    np.testing.assert_allclose(times, np.arange(300) / 100, atol=1e-9)
    assert sum(note.startswith(f"time: in {unit}, as it grows by ") for note in reader.notes) == 1


def test_lines_without_a_time_leave_the_clock_to_the_host() -> None:
    reader = LineReader()
    chunk = reader.feed("".join(f"{a}\n" for a in ANGLE).encode(), 0.0)
    assert chunk.time is None
    np.testing.assert_array_equal(chunk.values[:, 0], ANGLE)
    assert "columns: 1; time: the computer's" in reader.notes


def test_counts_of_an_encoder() -> None:
    _, times, angles, _ = fed(written(MICRO, np.arange(200) - 100), counts=2400)
    np.testing.assert_allclose(angles, (np.arange(200) - 100) * 0.15, rtol=1e-12)
    assert len(times) == 200
    with pytest.raises(SourceError, match="--counts 2400"):
        fed(["Time (us)\tCounts\n", *written(MICRO, np.arange(200))])


def test_pieces_of_lines_are_put_together() -> None:
    """Whatever the pieces in which bytes arrive, the samples are the same."""
    data = "".join(written(TIME, ANGLE)).encode()
    for size in (1, 7, 64):
        reader = LineReader(time_unit="s")
        chunks = [reader.feed(data[i:i + size], 0.0) for i in range(0, len(data), size)]
        found = np.concatenate([chunk.values[:, 0] for chunk in chunks if len(chunk.values)])
        np.testing.assert_array_equal(found, ANGLE)


def test_a_torn_first_line_is_no_sample() -> None:
    """The last digits of 12.345 are a number, too."""
    _, times, angles, lost = fed(["5\t345.0\n", *written(TIME, ANGLE)], torn=True)
    assert len(times) == len(TIME)
    assert np.abs(angles).max() <= 20.0
    assert lost == 0
    reader = LineReader(time_unit="s")
    reader.feed("".join(written(TIME[:50], ANGLE[:50])).encode() + b"0.50\t12", 0.0)
    reader.broken()
    chunk = reader.feed(b"4\n0.51\t3.25\n", 0.5)
    np.testing.assert_array_equal(chunk.values, [[3.25]])


GARBAGE = ["\x00\xff\xfe3\t", "0.5\tx1\n", "0.5\n", "0.5\t1\t2\n", "0.5\tnan\n", "{\"t\": 1\n"]


@pytest.mark.parametrize("bad", GARBAGE)
def test_garbage_is_left_out_and_counted(bad: str) -> None:
    lines: list[str | bytes] = [*written(TIME, ANGLE)]
    lines[50] = bad.encode("latin-1") if bad.endswith("\n") else bad.encode("latin-1") + b"\n"
    _, times, angles, lost = fed(lines, time_unit="s")
    keep = np.arange(len(TIME)) != 50
    np.testing.assert_allclose(times, TIME[keep], atol=1e-12)
    np.testing.assert_array_equal(angles, ANGLE[keep])
    assert lost == 1


@pytest.mark.parametrize("stamp", ["0.05", "50.0", "0.49", "99999999"])
def test_a_garbled_time_costs_one_sample(stamp: str) -> None:
    lines = written(TIME, ANGLE)
    lines[50] = f"{stamp}\t3.0\n"
    _, times, _, lost = fed(lines, time_unit="s")
    assert len(times) + lost == len(TIME)
    assert lost == 1
    np.testing.assert_allclose(times, np.delete(TIME, 50), atol=1e-12)


def test_a_message_between_samples_is_no_loss() -> None:
    lines = written(TIME, ANGLE)
    reader, times, _, lost = fed([*lines[:50], "# counts missed: 3\n", "warm\n", *lines[50:]], time_unit="s")
    assert (len(times), lost) == (len(TIME), 0)
    assert reader.problem == ""


def test_a_device_that_begins_again_is_continued() -> None:
    """By the clock of the host: 1.5 s passed between the last line before the reset and the first one after it."""
    reader = LineReader(time_unit="ms")
    first = [reader.feed(line.encode(), 10.0 + 0.01 * i) for i, line in enumerate(written(MILLI, ANGLE))]
    again = [reader.feed(line.encode(), 10.0 + 1.99 + 1.5 + 0.01 * i)
             for i, line in enumerate(["Time (ms)\tAngle\n", *written(MILLI + 5, ANGLE)])]
    times = np.concatenate([c.time for c in (*first, *again) if c.time is not None and len(c.values)])
    assert (np.diff(times) > 0.0).all()
    assert len(times) == 400
    assert sum(c.lost for c in (*first, *again)) == 0
    assert math.isclose(times[200] - times[199], 1.51, abs_tol=1e-9)
    assert any("began again" in note for note in reader.notes)


def test_a_count_of_microseconds_that_overflows_is_continued() -> None:
    stamps = (MICRO + (2**32 - 500_000)) % 2**32
    reader, times, _, lost = fed(written(stamps, ANGLE), time_unit="us")
    np.testing.assert_allclose(times - times[0], TIME, atol=1e-9)
    assert lost == 0
    assert any("2^32" in note for note in reader.notes)


def test_a_gap_is_said_and_kept() -> None:
    late = np.where(np.arange(200) < 100, TIME, TIME + 30.0)
    reader, times, _, lost = fed(written(late, ANGLE), time_unit="s")
    np.testing.assert_allclose(times, late, atol=1e-12)
    assert lost == 0
    assert [note for note in reader.notes if note.startswith("gap: 30")]


REFUSED: dict[str, tuple[list[str], dict[str, Any], str]] = {
    "a counter in place of a time": (written(np.arange(500), np.tile(ANGLE, 3)[:500]), {}, "give --time-unit"),
    "no angle among titles": (["Time (s),Voltage\n", *written(TIME, ANGLE, "{0},{1}\n")], {}, "none of them an angle"),
    "neither column grows": (written(ANGLE, ANGLE), {}, "--columns time=2,angle=1"),
    "no such column": (written(TIME, ANGLE), {"columns": "time=1,angle=3"}, "There is no column '3'"),
    "no such title": (["t,angle\n", *written(TIME, ANGLE, "{0},{1}\n")], {"columns": "time=t,angle=angel"},
                      "did you mean angle"),
    "no kind": (written(TIME, ANGLE), {"columns": "1,2"}, "time=1,angle=2"),
    "twice one column": (written(TIME, ANGLE), {"columns": "time=1,angle=1"}, "different columns"),
    "commas twice": ([], {"separator": ",", "decimal": ","}, "different marks"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_read_is_refused_with_the_remedy(name: str) -> None:
    lines, given, words = REFUSED[name]
    with pytest.raises(SourceError, match=words):
        fed(lines, **given)


def test_a_stream_without_samples_says_what_it_sees() -> None:
    """As a port with another baud rate: bytes that are no text."""
    garbage = np.random.default_rng(1).integers(128, 255, 5000).astype(np.uint8).tobytes().replace(b"\x85", b"\n")
    reader = LineReader()
    for i in range(60):
        reader.feed(garbage[i * 50:i * 50 + 50] + b"\n", 0.01 * i)
    assert "lines came without a sample" in reader.problem
    endless = LineReader()
    for i in range(60):
        assert not len(endless.feed(b"\xfe" * 5000, 0.01 * i).values)
    assert "without a sample" in endless.problem


def test_bytes_at_random_never_break_the_reader() -> None:
    """Whatever comes, times increase, values are finite, and errors are sentences."""
    random = np.random.default_rng(7)
    pool = [b"0.1\t2.0\n", b"1e999 2\n", b"[1, 2]\n", b'{"t": 1e400, "angle": 2}\n', b"\n", b"\r", b"-,-;\n",
            b"inf nan\n"]
    for case in range(200):
        parts = [pool[i] if i < len(pool) else random.bytes(int(random.integers(1, 30)))
                 for i in random.integers(0, 2 * len(pool), 40)]
        said = ""
        try:
            _, times, angles, lost = fed(parts)
        except SourceError as error:
            said = str(error)
        assert said.isprintable(), case
        if said:
            continue
        assert (np.diff(times) > 0.0).all()
        assert np.isfinite(angles).all()
        assert lost >= 0
