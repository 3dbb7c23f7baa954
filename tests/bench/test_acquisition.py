"""Acquisition: zero and sign, losses, runs, flat memory, the computer's stamps and the rates of devices' clocks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bench_clock import BenchClock

from pendulum_env import Recording
from pendulum_env.bench import Chunk, Source, SourceError
from pendulum_env.bench.acquisition import MOST_SHOWN, Acquisition, Drift, Stamps


class Given(Source):
    """Chunks that a test gives, one for each read, then the end."""

    name, about, tested = "given", "chunks of a test", "itself"

    def __init__(self, *chunks: Chunk, clock: BenchClock | None = None, waits: Sequence[float] = ()) -> None:
        self.__dict__.update(chunks=[*chunks], clock=clock, waits=[*waits], opened=0)

    def open(self) -> None:
        self.__dict__["opened"] += 1

    def read(self, timeout: float = 0.1) -> Chunk | None:
        kept: dict[str, Any] = self.__dict__
        if kept["clock"] is not None and kept["waits"]:
            kept["clock"].time += kept["waits"].pop(0)
        return kept["chunks"].pop(0) if kept["chunks"] else None

    def close(self) -> None:
        self.__dict__["opened"] = 0


def chunk(time: Any, *columns: Any, lost: int = 0) -> Chunk:
    return Chunk(np.array(columns, dtype=float).T, None if time is None else np.array(time, dtype=float), lost)


def run(path: Path, *chunks: Chunk, **more: Any) -> tuple[Acquisition, Any]:
    """Record all chunks; return the acquisition and the rows of the file."""
    acquisition = Acquisition(Given(*chunks), **more)
    acquisition.open()
    acquisition.start(path)
    while acquisition.poll():
        pass
    acquisition.close()
    assert acquisition.source.__dict__["opened"] == 0
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    return acquisition, np.array([line.split("\t") for line in lines[1:]], dtype=float)


def test_zero_and_sign(tmp_path: Path) -> None:
    acquisition = Acquisition(Given(*(chunk([i], [7.0 + i]) for i in range(4))), sign=-1)
    acquisition.open()
    acquisition.set_zero()
    assert acquisition.zero == 0.0, "before a reading there is nothing to take"
    acquisition.poll()
    assert acquisition.status.reading == -7.0
    acquisition.set_zero()
    heard: list[tuple[list[float], list[float]]] = []
    for _ in range(3):
        acquisition.poll(heard=lambda at, values: heard.append((at.tolist(), values[:, 0].tolist())))
    assert heard == [([1.0], [-1.0]), ([2.0], [-2.0]), ([3.0], [-3.0])]
    acquisition.set_zero()
    assert acquisition.zero == 10.0


def test_only_angles_have_a_zero_to_set() -> None:
    acquisition = Acquisition(Given(chunk([0.0], [9.8], [0.1])))
    acquisition.open()
    acquisition.poll()
    acquisition.source.__dict__["quantity"] = "force"
    with pytest.raises(SourceError, match="Only an angle has a zero"):
        acquisition.set_zero()
    assert acquisition.zero == 0.0


def test_times_begin_with_the_run_and_runs_follow_each_other(tmp_path: Path) -> None:
    source = Given(*(chunk([100.0 + i, 100.5 + i], [i, i]) for i in range(8)))
    acquisition = Acquisition(source)
    acquisition.open()
    acquisition.poll()
    for name in ("first.txt", "second.txt"):
        acquisition.start(tmp_path / name)
        for _ in range(3):
            acquisition.poll()
        assert (acquisition.status.samples, acquisition.status.time) == (6, 2.5)
        assert acquisition.stop() == tmp_path / name
        assert not acquisition.status.recording
    for name in ("first.txt", "second.txt"):
        np.testing.assert_allclose(Recording.read(tmp_path / name).time, np.arange(6) / 2)
    assert acquisition.stop() is None


def test_a_run_ends_with_its_duration(tmp_path: Path) -> None:
    acquisition = Acquisition(Given(*(chunk(0.1 * np.arange(7 * i, 7 * i + 7), np.ones(7)) for i in range(3))))
    acquisition.open()
    for name, duration in (("a.txt", 1.0), ("b.txt", 0.6)):  # the second ends with the last sample of a chunk
        acquisition.start(tmp_path / name, duration=duration)
        while not acquisition.status.full:
            assert acquisition.poll()
        count = round(10 * duration) + 1
        assert (acquisition.status.samples, acquisition.status.time) == (count, pytest.approx(duration))
        acquisition.stop()
        assert len(Recording.read(tmp_path / name).time) == count
    acquisition.close()


def test_what_is_not_finite_or_not_later_is_lost_and_counted(tmp_path: Path) -> None:
    acquisition, rows = run(
        tmp_path / "a.txt", chunk([0, 1, 1, 0.5, 2], [0, 1, 2, 3, 4]), chunk([], []), chunk([1.5, 3], [5, 6], lost=4),
        chunk([math.nan, 4, 5], [7, math.inf, 8]), chunk([9], [math.nan]))
    np.testing.assert_allclose(rows, [[0, 0], [1, 1], [2, 4], [3, 6], [5, 8]])
    assert (acquisition.status.samples, acquisition.status.lost) == (5, 10)
    assert "lost: 10 samples" in acquisition.notes
    assert "lost: 10 samples" in Recording.read(tmp_path / "a.txt").notes


def test_an_angle_within_one_turn_is_continued(tmp_path: Path) -> None:
    """A sensor of 0 to 360 degrees, whose zero is near where the bob hangs; parts of chunks do not matter."""
    time = 0.01 * np.arange(500)
    true = 30.0 * np.sin(5.0 * time) + 1.0
    read = true % 360.0
    assert np.abs(np.diff(read)).max() > 300.0
    parts = np.split(np.arange(500), [1, 20, 21, 100, 350])
    _, rows = run(tmp_path / "a.txt", *(chunk(time[part], read[part]) for part in parts))
    np.testing.assert_allclose(rows[:, 1], true, atol=1e-8)


def test_memory_stays_flat_and_the_past_even() -> None:
    acquisition = Acquisition(Given(*(chunk(0.001 * np.arange(1000 * i, 1000 * i + 1000), np.zeros(1000))
                                      for i in range(50))))
    acquisition.open()
    acquisition.past.add(np.arange(0.0), np.arange(0.0))
    past = acquisition.past
    for i in range(50):
        past.add(0.001 * np.arange(1000 * i, 1000 * i + 1000), np.arange(1000.0))
    assert MOST_SHOWN / 2 <= len(past.time) <= MOST_SHOWN
    np.testing.assert_allclose(np.diff(past.time), 0.001 * past.every, atol=1e-12)


@pytest.mark.parametrize("jitter", [0.0, 1e-4, 2e-3])
def test_the_jitter_of_the_computers_stamps_is_measured(jitter: float) -> None:
    """Deviations of known size from even times."""
    random = np.random.default_rng(3)
    stamps = Stamps()
    for i in range(4000):
        stamps.of(1, 5.0 + 0.01 * i + jitter * random.standard_normal())
    assert stamps.note.startswith("jitter: ")
    found = 1e-3 * float(stamps.note.split()[1])
    assert math.isclose(found, jitter, rel_tol=0.05, abs_tol=1e-9)
    assert math.isclose(stamps.usual, 0.01, rel_tol=1e-3)


def test_samples_that_came_at_once_are_spread_over_the_time_since_the_last() -> None:
    stamps = Stamps()
    assert stamps.of(5, 2.0).tolist() == [2.0], "nobody knows when the first four came"
    np.testing.assert_allclose(stamps.of(4, 2.4), [2.1, 2.2, 2.3, 2.4])
    for i in range(40):
        stamps.of(1, 2.5 + 0.1 * i)
    usual = stamps.usual
    assert math.isclose(usual, 0.1, rel_tol=1e-6)
    np.testing.assert_allclose(stamps.of(2, 60.0), [60.0 - 1.5 * usual, 60.0])  # after a gap, near the usual rate
    assert math.isclose(stamps.usual, 0.1, rel_tol=0.02), "the gap is no step"


def test_the_computers_stamps_and_their_jitter_reach_the_recording(tmp_path: Path, bench_clock: BenchClock) -> None:
    random = np.random.default_rng(5)
    source = Given(*(chunk(None, [math.sin(0.05 * i)]) for i in range(2000)), clock=bench_clock,
                   waits=0.01 + 1e-3 * (random.random(2000) - 0.5))
    acquisition = Acquisition(source)
    acquisition.open()
    acquisition.start(tmp_path / "a.txt")
    while acquisition.poll():
        pass
    acquisition.close()
    recording = Recording.read(tmp_path / "a.txt")
    assert len(recording.time) == 2000
    note = next(note for note in recording.notes if note.startswith("jitter: "))
    # steps of independent deviations: their scatter over sqrt(2)
    assert math.isclose(float(note.split()[1]), 1e3 * float(np.std(np.diff(recording.time))) / math.sqrt(2),
                        rel_tol=0.01)


@pytest.mark.parametrize("off", [0.0, 5e-3, -40e-6, 3e-6])
def test_the_rate_of_a_devices_clock_is_found_within_its_error(off: float) -> None:
    """Readings reach the computer up to 10 ms late; an Uno's resonator may be wrong by 0.5 %."""
    random = np.random.default_rng(11)
    drift = Drift()
    for i in range(600):
        host = 0.1 * i
        assert math.isnan(drift.slope[0]), "not before a minute"
        drift.add(77.0 + (1.0 + off) * host, host + 0.01 * random.random())
    assert drift.note == ""
    for i in range(600, 700):
        drift.add(77.0 + (1.0 + off) * 0.1 * i, 0.1 * i + 0.01 * random.random())
    slope, error = drift.slope
    assert abs(slope - off) < 3.0 * error < 3e-5
    word = "agrees" if abs(off) < 3.0 * error else "fast" if off > 0.0 else "slow"
    assert word in drift.note


def test_the_rate_of_a_devices_clock_is_said(tmp_path: Path, bench_clock: BenchClock) -> None:
    device = 0.1 * np.arange(900) * 1.002
    source = Given(*(chunk([t], [math.sin(t)]) for t in device), clock=bench_clock, waits=[0.1] * 900)
    acquisition = Acquisition(source)
    acquisition.open()
    acquisition.start(tmp_path / "a.txt")
    while acquisition.poll():
        pass
    acquisition.close()
    recording = Recording.read(tmp_path / "a.txt")
    said = [note for note in recording.notes if note.startswith("clock: ")]
    assert len(said) == 1
    assert said[0].startswith("clock: the device's is fast by 2e+03 ±")
    np.testing.assert_allclose(recording.time, device, atol=1e-6)
