"""Tests of the lock on a sweep's journal, which allows one writer at a time."""

import errno
import os
import signal
import subprocess
import sys

import pytest
from small_sweep import GRID, ROWS, add

from pendulum_env import sweep
from pendulum_env.study.sweep.journal import Journal
from pendulum_env.truth.reference import StudyError


@pytest.mark.slow
def test_a_file_that_another_process_writes_is_refused(tmp_path):
    pytest.importorskip("fcntl")
    path = tmp_path / "sweep.jsonl"
    sweep(GRID, run=add, file=path)
    code = (
        "import sys; from pendulum_env.study.sweep.journal import Journal; journal = Journal(sys.argv[1], {}, ()); "
        "open(sys.argv[1]).close(); print('has it', flush=True); input()"
    )
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", code, str(path)], **pipes) as other:
        assert other.stdout.readline()
        with pytest.raises(StudyError, match="Another process is writing"):
            sweep(GRID, run=add, file=path, anew=True)
        other.communicate(b"\n")
    assert list(sweep(GRID, run=add, file=path).rows) == ROWS


@pytest.mark.slow
def test_a_forked_process_does_not_hold_the_file(tmp_path):
    """Workers of a pool may outlive a killed parent process; its journal can still be continued."""
    pytest.importorskip("fcntl")
    path = tmp_path / "sweep.jsonl"
    code = (
        "import os, sys, time; from pendulum_env.study.sweep.journal import Journal\n"
        "journal = Journal(sys.argv[1], {}, ())\n"
        "child = os.fork()\n"
        "if child == 0: os.close(1); time.sleep(60); os._exit(0)\n"
        "print(child, flush=True); time.sleep(0.2); os._exit(0)"
    )
    done = subprocess.run([sys.executable, "-c", code, path], stdout=subprocess.PIPE, check=True)
    child = int(done.stdout)
    try:
        Journal(path, {}, ()).close()
    finally:
        os.kill(child, signal.SIGKILL)


@pytest.mark.parametrize("number", [errno.ENOSYS, errno.EOPNOTSUPP, errno.ENOLCK, errno.EINVAL])
def test_a_file_system_without_locks(number, tmp_path, monkeypatch):
    fcntl = pytest.importorskip("fcntl")

    def refuse(*_):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(fcntl, "flock", refuse)
    assert list(sweep(GRID, run=add, file=tmp_path / "sweep.jsonl").rows) == ROWS


@pytest.mark.parametrize("line", [b"[" * 5000 + b"\n", b'{"sweep": []}\n', b'{"sweep": 3}\n'])
def test_a_journal_nested_too_deeply_or_without_facts_is_refused(line, tmp_path):
    (tmp_path / "sweep.json").write_bytes(line)
    with pytest.raises(StudyError, match="is not the journal of a sweep"):
        Journal(tmp_path / "sweep.json", {"scene": "lab"}, ("scene",))
    assert (tmp_path / "sweep.json").read_bytes() == line
