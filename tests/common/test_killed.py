"""Tests of kill -9 at any moment: finished results can be read, other files are undamaged, and the next run works."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from killing import JOBS, visible

import pendulum_env
from pendulum_env.common.replacing import MARK
from pendulum_env.study.sweep.journal import HEAD

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="processes are forked, and killed, on POSIX only")

QUICK = {"table": 4}
KILLS = {**QUICK, "records": 13, "scene": 4, "film": 4, "choice": 5, "journal": 4, "kernel": 8}
"""Jobs of killing.py, and the smallest number of file operations in each."""
COMMAND = "from pendulum_env.cli import main; main()"


@pytest.mark.slow
@pytest.mark.parametrize("job", [job if job in QUICK else pytest.param(job, marks=pytest.mark.slow) for job in KILLS])
def test_killed_before_each_operation_on_a_file(job: str, tmp_path: Path) -> None:
    program = Path(__file__).parents[1] / "support" / "killing.py"
    own = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run([sys.executable, program, job, tmp_path], capture_output=True, text=True, env=own)
    assert done.returncode == 0, done.stderr
    kills = int(done.stdout.split()[-1])
    print(f"\n{job}: killed {kills} times")
    assert kills >= KILLS[job]


def test_every_job_is_tried() -> None:
    assert KILLS.keys() == JOBS.keys()


# --- the commands ---------------------------------------------------------------------------------------------------


def command(*words: object) -> list[str]:
    return [sys.executable, "-W", "ignore", "-c", COMMAND, *map(str, words)]


def environment(tmp_path: Path, backend: str = "python") -> dict[str, str]:
    return {**os.environ, "LAB_PENDULUM_BACKEND": backend, "LAB_PENDULUM_CACHE": str(tmp_path / "cache")}


def run(words: list[str], own: dict[str, str]) -> None:
    done = subprocess.run(words, capture_output=True, text=True, env=own)
    assert done.returncode == 0, done.stdout + done.stderr


def killed(words: list[str], own: dict[str, str], when: Callable[[], Any], patience: float = 120.0) -> bool:
    """Start a command and kill it once ``when`` returns True; return False if it ended before."""
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=own)
    try:
        for _ in range(int(patience / 0.002)):
            if when() or process.poll() is not None:
                break
            time.sleep(0.002)
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    return process.returncode == -signal.SIGKILL


@pytest.mark.slow
@pytest.mark.parametrize("ending", [".mp4", ".gif"])
def test_record(ending: str, tmp_path: Path) -> None:
    """Kill the process while it films: the earlier film is unchanged, and the next run replaces it."""
    out, own = tmp_path / "out", environment(tmp_path)
    path = out / f"swing{ending}"
    out.mkdir()
    short = command("record", "--scene", "vacuum", "--duration", 0.2, "--size", 64, "--out", path)
    run(short, own)
    before = visible(out)
    assert list(before) == [path.name]
    long = command("record", "--scene", "vacuum", "--duration", 600, "--size", 64, "--out", path)
    parts = f".swing{MARK}*"
    assert killed(long, own, lambda: [part for part in out.glob(parts) if part.stat().st_size or ending == ".gif"])
    assert visible(out) == before
    for part in out.glob(parts):
        rest(part)
        os.utime(part, (1e9, 1e9))
    run(short, own)
    assert visible(out).keys() == before.keys()
    assert not [*out.glob(parts)]


def rest(path: Path) -> None:
    """Wait until no process writes to a file, because a film's encoder writes for a moment after its last picture."""
    last = -1.0
    while path.stat().st_mtime != last:
        last = path.stat().st_mtime
        time.sleep(0.5)


@pytest.mark.slow
def test_cost(tmp_path: Path) -> None:
    """Kill a study after its third and twelfth measurement; continued, it gives the results of an undisturbed study."""
    own = environment(tmp_path)
    words = ("cost", "--scene", "vacuum", "--integrators", "rk4,velocity_verlet", "--duration", 1, "--repeats", 1)
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    run(command(*words, "--out", whole), own)
    journal = broken / "cost.jsonl"
    for lines in (3, 12):
        resumed = ("--resume",) if journal.exists() else ()
        assert killed(command(*words, "--out", broken, *resumed), own,
                      lambda lines=lines: journal.exists() and journal.read_bytes().count(b"\n") > lines)  # type: ignore[misc]
        first, *rest = journal.read_text().splitlines(keepends=True)
        assert HEAD in json.loads(first)
        assert len([json.loads(line) for line in rest if line.endswith("\n")]) >= lines
        assert visible(broken).keys() == {journal.name}
    run(command(*words, "--out", broken, "--resume"), own)
    assert results(journal) == results(whole / "cost.jsonl")
    assert visible(broken).keys() == visible(whole).keys()


def results(journal: Path) -> list[str]:
    """Return all measurements of a study, each once, without times."""
    points = [json.loads(line)["point"] for line in journal.read_text().splitlines()[1:]]
    return sorted(json.dumps(point, sort_keys=True) for point in points)


@pytest.mark.slow
def test_compare(tmp_path: Path) -> None:
    """Kill the command as each new file appears: existing files are byte for byte those of a complete run."""
    own = {**environment(tmp_path), "SOURCE_DATE_EPOCH": "0"}
    words = command("compare", "--scene", "exercise", "--integrators", "rk4,forward_euler", "--duration", 1,
                    "--out", "out")
    (tmp_path / "whole").mkdir()
    assert subprocess.run(words, cwd=tmp_path / "whole", env=own, capture_output=True).returncode == 0
    whole = visible(tmp_path / "whole" / "out")
    for files in range(1, len(whole), 4):
        place = tmp_path / str(files)
        out = place / "out"
        place.mkdir()
        there = f"import os; os.chdir({str(place)!r}); os.execv({sys.executable!r}, {words!r})"
        in_place = [sys.executable, "-c", there]
        killed(in_place, own, lambda out=out, files=files: out.exists() and len(visible(out)) >= files)  # type: ignore[misc]
        found = visible(out)
        assert len(found) >= files
        assert {name for name, content in found.items() if untimed(content) != untimed(whole[name])} <= {"film.mp4"}


def untimed(content: bytes) -> bytes:
    """Return a file without the measured time of a step, the second last number in lines of the drift table."""
    if b"ns_per_step" not in content:
        return content
    return re.sub(rb",[0-9.]+,([a-z_]*)\r?$", rb",\1", content, flags=re.MULTILINE)


COMPILING = """
import sys, warnings
warnings.simplefilter("error")
from pendulum_env import rollout
print(rollout("lab", integrator="rk4", duration=1.0, backend="compiled").angle[-1].hex())
"""


@pytest.mark.slow
def test_compilation(tmp_path: Path) -> None:
    """Kill the process while it writes compiled code; the next run is correct and without warnings."""
    own, cache = environment(tmp_path, "compiled"), tmp_path / "cache"
    words = [sys.executable, "-c", COMPILING]
    moments = {"folder": "", "text": "kernel_*.py", "part": f".kernel_*{MARK}*.nbc", "code": "kernel_*.nbc"}
    for pattern in moments.values():
        killed(words, own, lambda pattern=pattern: cache.exists() and (not pattern or [*cache.glob(pattern)]))  # type: ignore[misc]
    expected = np.float64(pendulum_env.rollout("lab", integrator="rk4", duration=1.0, backend="python").angle[-1]).hex()
    for _ in range(2):
        done = subprocess.run(words, capture_output=True, text=True, env=own)
        assert (done.stdout.strip(), done.stderr) == (expected, "")
