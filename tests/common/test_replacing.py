"""Tests of files that replace others: leftovers of killed processes, devices and pipes, and full disks."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from pendulum_env import SCENES, SceneError
from pendulum_env.common.replacing import FRESH, MARK, OutputError, replacing
from pendulum_env.study.sweep.journal import Journal

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="files have modes, and pipes names, on POSIX only")


# --- what a killed process leaves -----------------------------------------------------------------------------------


def left(path: Path, age: float) -> Path:
    part = path.with_name(f".{path.stem}{MARK}abcd0123{path.suffix}")
    part.write_text("half")
    os.utime(part, (time.time() - age,) * 2)
    return part


def test_what_was_left_is_removed_by_the_next_that_writes_the_file(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    old, fresh = left(path, FRESH + 1), tmp_path / f".table{MARK}fe540123.csv"
    fresh.write_text("half")
    others = [left(tmp_path / name, FRESH + 1) for name in ("table.png", "tab.csv", "other.csv")]
    names = ("-part-of", "-part-original", f"{MARK}original", f"{MARK}12345")
    mine = [tmp_path / f".table{name}.csv" for name in names]
    for each in mine:
        each.write_text("a user's own")
        os.utime(each, (1e9, 1e9))
    with replacing(path) as temporary:
        temporary.write_text("whole")
    assert path.read_text() == "whole"
    assert not old.exists()
    assert fresh.exists()
    assert all(each.exists() for each in mine)
    assert all(other.exists() for other in others)


def test_what_another_process_is_writing_is_left_alone(tmp_path: Path) -> None:
    """Check that a locked temporary file is kept, however old it is."""
    path = tmp_path / "film.mp4"
    with replacing(path) as slow:
        slow.write_text("by the slow one")
        os.utime(slow, (1e9, 1e9))
        with replacing(path) as quick:
            quick.write_text("by the quick one")
        assert path.read_text() == "by the quick one"
    assert path.read_text() == "by the slow one"
    assert [each.name for each in tmp_path.iterdir()] == ["film.mp4"]


@pytest.mark.parametrize("number", [errno.ENOSYS, errno.EOPNOTSUPP, errno.ENOLCK, errno.EINVAL])
def test_a_file_system_without_locks(number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without locks, a temporary file is removed only when it is old."""
    import fcntl

    def refuse(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(fcntl, "flock", refuse)
    path = tmp_path / "table.csv"
    perhaps = left(path, FRESH + 1)
    with replacing(path) as temporary:
        temporary.write_text("whole")
    assert path.read_text() == "whole"
    assert perhaps.exists()
    os.utime(perhaps, (1e9, 1e9))
    with replacing(path) as temporary:
        temporary.write_text("again")
    assert [each.name for each in tmp_path.iterdir()] == ["table.csv"]


# --- what may be replaced -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("linked", [False, True])
def test_what_is_no_file_stays(linked: bool, tmp_path: Path) -> None:
    """Check that a pipe, which stands for any device, is not replaced."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    path = tmp_path / "link" if linked else pipe
    if linked:
        path.symlink_to(pipe)
    with pytest.raises(OutputError, match="is not a regular file"), replacing(path):
        pass
    with pytest.raises(SceneError, match="is not a regular file"):
        SCENES["lab"].save(path)
    with pytest.raises(OutputError, match="is not a regular file"):
        Journal(path, {}, ())
    assert pipe.is_fifo()
    assert {each.name for each in tmp_path.iterdir()} == {"pipe", path.name}


def test_a_link_is_written_through(tmp_path: Path) -> None:
    target, link = tmp_path / "deep" / "target.txt", tmp_path / "link.json"
    target.parent.mkdir()
    link.symlink_to(target)
    for text in ("new", "again"):
        with replacing(link) as temporary:
            assert temporary.parent == target.parent.resolve()
            assert temporary.suffix == ".json"
            temporary.write_text(text)
        assert link.is_symlink()
        assert target.read_text() == text


def test_the_mode_is_that_of_the_old_file_or_the_umasks(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    before = os.umask(0o027)
    try:
        for mode in (0o640, 0o600, 0o664, 0o444):
            with replacing(path) as temporary:
                temporary.write_text("whole")
            if mode == 0o640:
                assert path.stat().st_mode & 0o777 == mode
            path.chmod(mode)
            with replacing(path) as temporary:
                temporary.write_text("again")
                assert not temporary.stat().st_mode & 0o777 & ~(0o600 | mode)
            assert path.stat().st_mode & 0o777 == mode
            path.unlink()
    finally:
        os.umask(before)


FULL_DISK = """
import resource, sys
from pendulum_env import rollout
from pendulum_env.common.provenance import OutputError
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]),) * 2)
try:
    rollout("vacuum", angle=[0.1, 0.2], duration=2.0, dt=0.01, backend="python", file=sys.argv[1], warn=False)
except OutputError as error:
    print(error)
"""


@pytest.mark.slow
@pytest.mark.parametrize("limit", [3000, *(pytest.param(limit, marks=pytest.mark.slow) for limit in (10, 9000))])
def test_records_on_a_disk_that_fills_up(limit: int, tmp_path: Path) -> None:
    """Check that the error names the file, and that the records written so far can be read."""
    path = tmp_path / "runs.npy"
    done = subprocess.run([sys.executable, "-c", FULL_DISK, path, str(limit)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(f"The file {path} cannot be written: {os.strerror(errno.EFBIG)}")
    assert not path.exists() or path.stat().st_size <= limit
    assert limit == 10 or np.load(path).dtype.names
