"""Journals: of a run that was killed, cut off, or stopped by a full disk, whole lines are kept, and they alone read."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from pendulum_env import Recording
from pendulum_env.bench import SourceError, acquire
from pendulum_env.bench.journal import Journal, check_new
from pendulum_env.bench.sources import source_at
from pendulum_env.lab import RecordingError

TIME = 0.01 * np.arange(300)
ANGLE = np.round(20.0 * np.cos(5.0 * TIME), 4)


def journal(path: Path, notes: tuple[str, ...] = ()) -> Path:
    kept = Journal(path, source_at("virtual"))
    kept.write(TIME[:100], ANGLE[:100, None])
    for note in notes:
        kept.note(note)
    kept.write(TIME[100:], ANGLE[100:, None])
    kept.close()
    kept.close()
    return path


@pytest.mark.parametrize("name", ["swing.csv", "swing.txt"])
def test_a_journal_is_a_recording_with_its_notes(name: str, tmp_path: Path) -> None:
    path = journal(tmp_path / "new" / name, ("jitter: 3 ms", "lost: 1 sample", "lost: 2 samples, \x1b[2J<b>"))
    recording = Recording.read(path)
    np.testing.assert_allclose(recording.time, TIME, atol=1e-9)
    np.testing.assert_allclose(np.degrees(recording.angle), ANGLE, atol=1e-9)
    assert "unit: deg, as the header says" in recording.notes
    assert [note for note in recording.notes if note[:4] in ("jitt", "lost")] == [
        "jitter: 3 ms", "lost: 2 samples, \N{REPLACEMENT CHARACTER}[2J<b>"]
    head = path.read_text().splitlines()
    assert any(line.startswith("# Command: ") for line in head)
    assert "# source: Virtual()" in head


def test_wherever_a_journal_is_cut_off_no_part_of_a_number_is_read(tmp_path: Path) -> None:
    """The last lines are 2.980000 and 2.990000; "-1" of "-14.2" would be a reading."""
    data = journal(tmp_path / "a.txt").read_bytes()
    for cut in range(1, 60):
        part = tmp_path / "part.txt"
        part.write_bytes(data[:-cut])
        recording = Recording.read(part)
        whole = data[:-cut].count(b"\n") - data.split(b"Time (s)")[0].count(b"\n") - 1
        assert len(recording.time) == whole
        np.testing.assert_allclose(np.degrees(recording.angle), ANGLE[:whole], atol=1e-9)
        assert any(note.startswith("journal: its last line was cut off") for note in recording.notes) is (
            data[-cut - 1:-cut] != b"\n")


def test_blocks_of_zeros_after_a_power_failure_are_left_out(tmp_path: Path) -> None:
    data = journal(tmp_path / "a.txt").read_bytes()
    part = tmp_path / "part.txt"
    part.write_bytes(data[:-30] + bytes(4096) + b"7\t8\n")
    recording = Recording.read(part)
    assert 296 <= len(recording.time) <= 298
    np.testing.assert_allclose(np.degrees(recording.angle), ANGLE[:len(recording.time)], atol=1e-9)


def test_other_files_keep_their_last_line_without_an_end(tmp_path: Path) -> None:
    path = tmp_path / "other.txt"
    path.write_text("Time (s)\tAngle (deg)\n" + "\n".join(f"{t}\t{a}" for t, a in zip(TIME, ANGLE, strict=True)))
    assert len(Recording.read(path).time) == 300


def test_nothing_is_overwritten_unless_told(tmp_path: Path) -> None:
    path = tmp_path / "swing.csv"
    path.write_text("precious")
    for refused in (lambda: check_new(path, False), lambda: acquire("virtual", 0.1, out=path)):
        with pytest.raises(SourceError, match=r"exists already; .*--force"):
            refused()
    with pytest.raises(FileExistsError):
        Journal(path, source_at("virtual"))
    with pytest.raises(SourceError, match="is a folder"):
        check_new(tmp_path, True)
    # with force the old file stays until the first sample is there
    with pytest.raises(SourceError, match="port"):
        acquire("udp:99999", 0.1, out=path, force=True)
    kept = Journal(path, source_at("virtual"), force=True)
    assert path.read_text() == "precious"
    kept.write(TIME, ANGLE[:, None])
    kept.close()
    assert len(Recording.read(path).time) == 300


@contextmanager
def room_for(size: int) -> Iterator[None]:
    """Let no file of this process grow beyond a size, as on a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("size", [3000, 3007, 3011])
def test_a_full_disk_leaves_whole_lines(size: int, tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    kept = Journal(path, source_at("virtual"))

    def fill() -> None:
        for at, angle in zip(TIME, ANGLE, strict=True):
            kept.write(np.array([at]), np.array([[angle]]))

    with room_for(size), pytest.raises(OSError, match="too large"):
        fill()
    kept.close()
    assert path.read_bytes().endswith(b"\n")
    assert size - 30 < path.stat().st_size <= size
    recording = Recording.read(path)
    np.testing.assert_allclose(np.degrees(recording.angle), ANGLE[:len(recording.time)], atol=1e-9)


@pytest.mark.slow
def test_a_run_on_a_full_disk_keeps_what_came_and_says_so(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    acquire("virtual", 0.01, out=tmp_path / "first.txt", rate=2000.0)  # its program is cached while there is room
    with room_for(1500), pytest.warns(UserWarning, match="cannot be written further"):
        recording = acquire("virtual", 30.0, out=path, rate=2000.0)
    assert 20 < len(recording.time) < 200
    assert len(Recording.read(path).time) == len(recording.time)


KILLED = """
import sys, time
import numpy as np
from pendulum_env.bench import Chunk, Source, acquire

class Steady(Source):
    name, about, tested = "steady", "500 readings per second", "itself"
    def open(self): self.__dict__.update(began=time.monotonic(), count=0)
    def close(self): pass
    def read(self, timeout=0.1):
        time.sleep(0.005)
        due = int((time.monotonic() - self.began) * 500)
        at = np.arange(self.count, due) / 500
        self.__dict__["count"] = due
        return Chunk(np.cos(5 * at)[:, None], at)

acquire(Steady(), 60.0, out=sys.argv[1])
"""


@pytest.mark.slow
def test_a_killed_run_loses_less_than_a_second(tmp_path: Path) -> None:
    path = tmp_path / "swing.txt"
    process = subprocess.Popen([sys.executable, "-c", KILLED, str(path)])
    try:
        until = time.monotonic() + 60.0
        while not path.exists() or path.stat().st_size < 5000:
            assert time.monotonic() < until
            assert process.poll() is None
            time.sleep(0.01)
        began, early = time.monotonic(), path.read_bytes().count(b"\n")
        time.sleep(0.7)
    finally:
        process.send_signal(signal.SIGKILL)
        passed = time.monotonic() - began
        process.wait()
    recording = Recording.read(path)
    rows = path.read_bytes().count(b"\n")
    assert rows - early >= 500.0 * (passed - 1.0)
    assert len(recording.time) > 100
    np.testing.assert_allclose(np.diff(recording.time), 0.002, atol=2e-6)


def test_a_damaged_head_is_refused_by_a_sentence(tmp_path: Path) -> None:
    data = journal(tmp_path / "a.txt").read_bytes()
    part = tmp_path / "part.txt"
    part.write_bytes(data[:60])
    with pytest.raises(RecordingError):
        Recording.read(part)
    part.write_bytes(data[:60] + os.urandom(300))
    with pytest.raises(RecordingError):
        Recording.read(part)
