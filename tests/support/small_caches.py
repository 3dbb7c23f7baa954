"""A cache folder of a test's own, and a small program to keep in it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

import integrators
from pendulum_env import SCENES
from pendulum_env.engine import kernels
from pendulum_env.engine.generate import Program, program

posix = pytest.mark.skipif(sys.platform == "win32", reason="folders have owners and modes on POSIX only")

TEXT = """
@inline
def square(x):
    return x*x


@entry
def run(x):
    return square(x) + {constant}
"""


def small(constant: float = 0.25) -> Program:
    """A program that compiles in no time: ``run(1.5)`` is 2.25 and the constant."""
    pendulum = program(SCENES["textbook"], integrators.get("symplectic_euler"))
    return replace(pendulum, text=TEXT.format(constant=constant), title=f"small {constant}")


Start = Callable[[Path], float]
"""What ``run(1.5)`` is in a process that starts now with this cache folder."""


@pytest.fixture
def start(monkeypatch: pytest.MonkeyPatch) -> Iterator[Start]:
    def started(folder: Path) -> float:
        kernels.forget()
        monkeypatch.setenv("LAB_PENDULUM_CACHE", str(folder))
        return float(kernels.functions(small(), "compiled")["run"](1.5))

    yield started
    kernels.forget()


def uncached(folder: Path, start: Start, reason: str) -> float:
    """What a process computes that warns, for this reason, that it has no cache; with a second program, but once."""
    with pytest.warns(UserWarning, match="cannot be cached") as caught:
        result = start(folder)
    assert kernels.functions(small(0.5), "compiled")["run"](1.5) == 2.75
    assert len(caught) == 1
    assert reason in str(caught[0].message)
    return result
