"""Tests of the times of steps: the shortest of several timings in turn, each from the start, without compilation."""

from __future__ import annotations

import itertools

import pytest

from pendulum_env.engine import timing
from pendulum_env.engine.machine import ANGLE, INDEX, Machine
from pendulum_env.physics.presets import SCENES


@pytest.fixture
def watched(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, float, int]]:
    """Watch every call of a machine: its method, the angle from which it begins, and its steps; a call takes 2 ms."""
    calls: list[tuple[str, float, int]] = []
    advance = Machine.advance
    monkeypatch.setattr(timing, "perf_counter", lambda: 2e-3 * len(calls))

    def watching(machine: Machine, state: list[float], control: float, h: float, steps: int) -> int:
        calls.append((machine.method.name, state[ANGLE], steps))
        assert state[INDEX] == 0.0
        return advance(machine, state, control, h, steps)

    monkeypatch.setattr(Machine, "advance", watching)
    return calls


def machine(method: str) -> Machine:
    return Machine(SCENES["vacuum"], method, backend="python")


def test_a_time_is_the_mean_of_equal_runs(watched: list[tuple[str, float, int]]) -> None:
    seconds, steps = timing.run_time(machine("rk4"), 0.4, 0.0, 0.01, 5, runs=3)
    assert watched == [("rk4", 0.4, 5)] * 3
    assert seconds == pytest.approx(2e-3)
    assert steps == 5.0


def test_machines_are_warm_and_take_turns(watched: list[tuple[str, float, int]]) -> None:
    told: list[float] = []
    machines = {1: machine("rk4"), 2: machine("heun")}
    best = timing.step_times(machines, 0.4, 0.0, 0.01, 5, rounds=2, runs=2, tell=told.append)
    warm, turns = watched[:2], [name for name, _ in itertools.groupby(name for name, _, _ in watched[2:])]
    assert warm == [("rk4", 0.4, 1), ("heun", 0.4, 1)]
    assert turns == ["rk4", "heun"] * 2
    assert best == pytest.approx({1: 4e-4, 2: 4e-4})
    assert told == [0.0, 0.5]


def test_the_shortest_timing_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    ticks = itertools.accumulate([0.0, 3.0, 10.0, 1.0, 10.0, 2.0])
    monkeypatch.setattr(timing, "perf_counter", lambda: next(ticks))
    assert timing.step_times({"": machine("rk4")}, 0.4, 0.0, 0.01, 4, rounds=3) == {"": 0.25}
