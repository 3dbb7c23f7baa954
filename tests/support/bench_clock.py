"""A clock for live samples that a test sets: it passes while something sleeps, so that a minute takes no time."""

from __future__ import annotations

import time

import pytest


class BenchClock:
    """Time of the test's own [s]; ``passes`` is how far it goes on by itself at each look."""

    def __init__(self) -> None:
        self.time, self.passes = 1000.0, 1e-7

    def monotonic(self) -> float:
        self.time += self.passes
        return self.time

    def sleep(self, seconds: float) -> None:
        assert seconds >= 0.0
        self.time += seconds


@pytest.fixture
def bench_clock(monkeypatch: pytest.MonkeyPatch) -> BenchClock:
    clock = BenchClock()
    monkeypatch.setattr(time, "monotonic", clock.monotonic)
    monkeypatch.setattr(time, "sleep", clock.sleep)
    return clock
