"""Tests of the fuzzer: it repeats its cases, sees planted faults, and changes no file outside of its folder."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

FUZZER = Path(__file__).with_name("fuzz.py")
PLANTED = """
import runpy, sys
from pathlib import Path
from pendulum_env.lab import recording
{fault}
sys.argv = ["fuzz.py", "--cases", "40", "--seed", "4", "--only", "reader", "--seconds", "300"]
runpy.run_path({fuzzer!r}, run_name="__main__")
"""
FAULTS = {
    "an error that is not declared": "def read_file(name, options): raise KeyError(name)",
    "a write elsewhere": "def read_file(name, options): Path({trace!r}).write_text('written')",
    "a removal elsewhere": "def read_file(name, options): Path({kept!r}).unlink()",
    "a program": "import subprocess\ndef read_file(name, options): subprocess.run(['true'])",
}


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS)
def test_planted_faults_are_seen(fault: str, tmp_path: Path) -> None:
    kept, trace = tmp_path / "kept", tmp_path / "trace"
    kept.write_text("kept")
    text = FAULTS[fault].format(trace=str(trace), kept=str(kept)) + "\nrecording.read_file = read_file"
    done = subprocess.run([sys.executable, "-c", PLANTED.format(fault=text, fuzzer=str(FUZZER))], capture_output=True,
                          text=True, cwd=tmp_path)
    assert done.returncode == 1, done.stdout + done.stderr
    assert "--- case" in done.stdout
    assert "Escape" in done.stdout or fault == "an error that is not declared"
    assert [*tmp_path.iterdir()] == [kept]


@pytest.mark.slow
def test_some_cases(tmp_path: Path) -> None:
    said = [subprocess.run([sys.executable, FUZZER, "--cases", "60", "--seconds", "300", "--seed", "5"],
                           capture_output=True, text=True, cwd=tmp_path) for _ in range(2)]
    assert said[0].returncode == 0, said[0].stdout
    assert said[0].stdout == said[1].stdout == "60 cases with seed 5, 0 finds\n"
    assert not [*tmp_path.iterdir()]
