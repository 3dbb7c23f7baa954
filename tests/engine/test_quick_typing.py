"""Programs whose types are looked up once, as in all tests, are the programs that users get."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from readme_code import ROOT

ASSEMBLY = """
import sys
sys.path.insert(0, "tests/support")
import quick_typing
if sys.argv[1] == "remembered":
    quick_typing.remember_types()
from pendulum_env import SCENES
from pendulum_env.engine.machine import Machine
machine = Machine(SCENES["lab"], "rk4", backend="compiled")
machine.advance(machine.state(0.5, 0.0), 0.375, 0.004, 10)
(assembly,) = machine.entry.inspect_asm().values()
print(len(quick_typing.KNOWN), "known")
print(assembly)
"""


@pytest.mark.slow
def test_remembered_types_leave_each_instruction_as_it_is(tmp_path: Path) -> None:
    known, assembly = zip(*(compiled(kind, tmp_path / kind).split("\n", 1) for kind in ("searched", "remembered")),
                          strict=True)
    assert assembly[0] == assembly[1]
    assert assembly[0].count("mul") > 50, "a whole program"
    assert known[0] == "0 known"
    assert int(known[1].split()[0]) > 20


def compiled(kind: str, cache: Path) -> str:
    """Return the assembly of a program that a process of its own compiles: numba numbers its functions alike then."""
    cache.mkdir(mode=0o700)
    return subprocess.run(
        [sys.executable, "-c", ASSEMBLY, kind], capture_output=True, text=True, check=True, cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT), "LAB_PENDULUM_CACHE": str(cache)},
    ).stdout
