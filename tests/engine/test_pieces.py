"""Tests of long runs in pieces: equal bits, bounded work per piece, and Ctrl-C that ends compiled runs."""

from __future__ import annotations

import math
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from pendulum_env import SCENES, LabPendulumEnv, LabPendulumVectorEnv, Rollout, rollout
from pendulum_env.engine import machine as single
from pendulum_env.engine import pendulums, threads
from pendulum_env.engine.certificate import CertifiedMachine
from pendulum_env.engine.machine import INDEX, Machine
from pendulum_env.engine.pieces import FEW, GROWTH, LEAST, MOMENT, MOST, Pace

ANGLES = np.linspace(0.1, 2.0, 5)
SHORT: Mapping[str, Any] = {"duration": 1.0, "dt": 0.01, "every": 23, "backend": "python", "warn": False}
TOLERANT: Mapping[str, Any] = {"integrator": "dopri5", "rtol": 1e-8, "dt": 0.5}

BOTH: Mapping[str, Mapping[str, Any]] = {
    "ledger": {"scene": "lab"}, "each step": {"scene": "lab", "every": 1},
    "one record": {"scene": "driven", "every": 1000}, "gusts": {"scene": "windy", "substeps": 5},
    "dry friction": {"scene": "sticky_bearing"}, "history": {"scene": "lab", "integrator": "ab4"},
    "compensated": {"scene": "vacuum", "compensated": True},
    "speed limit": {"scene": "vacuum", "velocity": 2.0, "speed_limit": 3.5},
    "nonsense": {"scene": "vacuum", "integrator": "forward_euler", "dt": 0.3, "duration": 60.0},
    "errors": {"scene": "lab", "estimate_error": True},
}
"""Runs with fixed steps, for single runs and batches; some stop early."""
SINGLE: Mapping[str, Mapping[str, Any]] = {
    "adaptive": {"scene": "lab", **TOLERANT, "every": 1}, "rarely recorded": {"scene": "lab", **TOLERANT, "every": 3},
    "within one step": {"scene": "driven", **TOLERANT, "dt": 2.0},
    "gusts": {"scene": "windy", **TOLERANT, "every": 3, "substeps": 3},
    "heats": {"scene": "lab", **TOLERANT, "diagnostics": ("energy", "heat_by_effect", "tension")},
    "speed limit": {"scene": "vacuum", **TOLERANT, "velocity": 2.0, "every": 3, "speed_limit": 3.5},
    "errors": {"scene": "lab", **TOLERANT, "estimate_error": True},
}
"""Adaptive runs, alone and in batches, which pause within a step."""


def bits(run: Rollout) -> list[Any]:
    """Return the bytes of all results of a run."""
    names = ("time", "angle", "velocity", "energy", "energy_residual", "error_estimate", "lost_angle")
    columns = [None if (found := getattr(run, name)) is None else np.asarray(found).tobytes() for name in names]
    heats = [heat.tobytes() for heat in run.heat_by_effect.values()]
    return [*columns, *heats, run.stop_reason,
            *(np.asarray(found).tolist() for found in (run.stop_time, run.steps, run.rejected))]


def in_pieces_of(units: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Set the number of units of work of all pieces."""
    monkeypatch.setattr(Pace, "__init__", lambda self, _=0, share=1.0: vars(self).update(units=units, share=share))
    monkeypatch.setattr(Pace, "learn", lambda *_: None)


def cases() -> list[Any]:
    """Return the test cases: all single runs, then all batches."""
    single = {**BOTH, **{f"{name}, adaptive": case for name, case in SINGLE.items()}}
    batches = {f"{name}, batch": {**case, "angle": ANGLES} for name, case in BOTH.items()}
    batches |= {f"{name}, adaptive batch": {**case, "angle": ANGLES} for name, case in SINGLE.items()}
    return [
        pytest.param({**SHORT, "angle": 1.0, **case}, id=name,
                     marks=pytest.mark.slow if "adaptive batch" in name else ())
        for name, case in {**single, **batches}.items()]


@pytest.mark.quick("gusts, batch", "dry friction, batch", "speed limit, batch")
@pytest.mark.parametrize("case", cases())
@pytest.mark.filterwarnings("ignore")
def test_no_bit_depends_on_the_pieces(case: Mapping[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """Check that runs in pieces equal the run in one piece bit for bit."""
    in_pieces_of(MOST, monkeypatch)
    whole = bits(rollout(**case))
    for units in (1, 7, 50):
        in_pieces_of(units, monkeypatch)
        assert bits(rollout(**case)) == whole, units


@pytest.mark.quick("keywords1", "keywords4")
@pytest.mark.parametrize("keywords", [
    {"scene": "lab"}, {"scene": "windy"}, {"scene": "lab", "integrator": "ab4"}, {"speed_limit": 3.0},
    {"diagnostics": ("energy", "error")}, {"diagnostics": ()},
])
@pytest.mark.filterwarnings("ignore")
def test_no_bit_of_a_vector_step_depends_on_the_pieces(
    keywords: Mapping[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (8, 3, 1)).astype(np.float32)

    def steps(units: int) -> list[bytes]:
        in_pieces_of(units, monkeypatch)
        env = LabPendulumVectorEnv(3, dt=0.2, substeps=11, backend="python", **keywords)
        env.reset(seed=3)
        results = [env.step(action) for action in actions]
        numbers = [value for *_, info in results for value in info.values() if value.dtype == np.float64]
        return [array.tobytes() for result in results for array in result[:4]] + [array.tobytes() for array in numbers]

    whole = steps(MOST)
    assert all(steps(units) == whole for units in (1, 4))


# --- bounded work ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("cost", [1e-9, 1e-7, 1e-5, 1e-4])
def test_a_pace_fits_what_a_unit_costs(cost: float) -> None:
    """Check that no piece takes half a second if a unit takes ``cost`` seconds, and later 5 times as long."""
    pace, now = Pace(), cost
    for piece in range(20):
        now = 5.0 * cost if piece > 9 else cost
        assert LEAST <= pace.units <= min(MOST, FEW * GROWTH**piece)
        assert pace.units * now < 0.5
        before, seconds = pace.units, pace.units * now
        pace.learn(pace.units, seconds)
        assert pace.units <= GROWTH * before
    assert pace.units * now == pytest.approx(min(MOMENT, MOST * now), rel=1e-3)


def test_a_piece_cut_short_teaches_nothing() -> None:
    pace = Pace()
    pace.learn(FEW // 3, 1e-9)
    assert pace.units == FEW


@pytest.mark.parametrize(("tolerance", "h"), [({}, 0.001), ({"rtol": 1e-9}, 0.5), ({"rtol": 1e-9}, 50.0)])
def test_no_call_takes_more_steps_than_a_piece_has(
    tolerance: Mapping[str, float], h: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Check that a call of the program makes no more force evaluations than a piece of 30 steps or attempts."""
    in_pieces_of(30, monkeypatch)
    machine = Machine(SCENES["vacuum"], "dopri5", (), "python", **tolerance)
    entry, calls, most = machine.entry, [0], list[int]()
    force = entry.__globals__["acceleration"]

    def noted(*given: float) -> float:
        calls[0] += 1
        return float(force(*given))

    def counted(*given: Any) -> int:
        calls[:] = [0]
        code = entry(*given)
        most.append(calls[0])
        return int(code)

    monkeypatch.setitem(entry.__globals__, "acceleration", noted)
    machine.entry = counted
    steps = 200 if h < 50.0 else 1
    state = machine.state(1.0, 0.0)
    assert machine.advance(state, 0.0, h, steps) == 0
    assert state[INDEX] == steps
    assert len(most) > 5
    assert 150 < max(most) <= 30 * 8


# --- what an interruption leaves ------------------------------------------------------------------------------------


class Interrupted:
    """A function that raises KeyboardInterrupt after the work of call number ``at``; 0 for never."""

    def __init__(self, function: Callable[..., Any], at: int = 0) -> None:
        self.function, self.at = function, at

    def __call__(self, *given: Any) -> Any:
        result = self.function(*given)
        self.at -= 1
        if self.at == 0:
            raise KeyboardInterrupt
        return result


@pytest.mark.parametrize(("kind", "tolerance"), [(Machine, {}), (Machine, {"rtol": 1e-9}), (CertifiedMachine, {})])
@pytest.mark.parametrize("call", [3, 10])
def test_a_state_is_as_it_was(
    kind: type[Machine], tolerance: Mapping[str, float], call: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    in_pieces_of(20, monkeypatch)
    machine = kind(SCENES["lab"], "dopri5", ("energy", "error"), "python", **tolerance)
    state = machine.state(1.0, 0.0)
    machine.advance(state, 0.0, 0.01, 10)
    before = state.copy()
    machine.entry = Interrupted(machine.entry, call)
    with pytest.raises(KeyboardInterrupt):
        machine.advance(state, 0.0, 0.01, 200)
    assert state == before
    other = before.copy()
    machine.advance(state, 0.0, 0.01, 200)
    machine.advance(other, 0.0, 0.01, 200)
    assert state == other


def test_a_state_is_as_it_was_after_adaptive_steps_in_one_call(monkeypatch: pytest.MonkeyPatch) -> None:
    in_pieces_of(100, monkeypatch)
    machine = Machine(SCENES["lab"], "dopri5", ("energy",), "python", rtol=1e-9)
    state = machine.state(1.0, 0.0)
    before = state.copy()
    machine.entry = Interrupted(machine.entry, 1)
    with pytest.raises(KeyboardInterrupt):
        machine.advance(state, 0.0, 0.01, 10)
    assert state == before


def program_that_is_interrupted(module: Any, name: str, monkeypatch: pytest.MonkeyPatch) -> list[Interrupted]:
    """Wrap the function ``name`` of all programs that a module loads from now on in Interrupted; return their list."""
    wrapped, functions = list[Interrupted](), module.functions

    def own(*given: Any) -> dict[str, Any]:
        loaded = functions(*given)
        wrapped.append(Interrupted(loaded[name]))
        return {**loaded, name: wrapped[-1]}

    monkeypatch.setattr(module, "functions", own)
    return wrapped


@pytest.mark.parametrize("options", [{}, {"integrator": "bs3", "rtol": 1e-6}])
def test_a_vector_wants_a_reset(options: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    in_pieces_of(2, monkeypatch)
    programs = program_that_is_interrupted(pendulums, "step_blocks", monkeypatch)
    env = LabPendulumVectorEnv(3, substeps=20, backend="python", **options)
    env.reset(seed=0)
    programs[0].at = 3
    with pytest.raises(KeyboardInterrupt):
        env.step(np.zeros((3, 1), dtype=np.float32))
    with pytest.raises(gym.error.ResetNeeded):
        env.step(np.zeros((3, 1), dtype=np.float32))
    wanted = LabPendulumVectorEnv(3, substeps=20, backend="python", **options)
    for each in (env, wanted):
        each.reset(seed=0)
    found, again = (each.step(np.zeros((3, 1), dtype=np.float32)) for each in (env, wanted))
    assert found[4]["time"].tolist() == [0.02] * 3
    assert found[4]["angle"].tolist() == again[4]["angle"].tolist()


def test_threads_stop_with_the_one_that_is_interrupted() -> None:
    done: list[tuple[int, int]] = []

    def work(thread: int, first: int, last: int) -> None:
        assert last - first <= 10
        if thread == 0:
            raise KeyboardInterrupt
        time.sleep(0.01)
        done.append((first, last))

    with pytest.raises(KeyboardInterrupt):
        threads.spread(work, 10_000, 3, 10)
    finished = len(done)
    time.sleep(0.1)
    assert len(done) == finished < 500
    whole: list[int] = []
    threads.spread(lambda _, first, last: whole.extend(range(first, last)), 1000, 3, 7)
    assert sorted(whole) == [*range(1000)]


# --- Ctrl-C ---------------------------------------------------------------------------------------------------------


PATIENCE = 60.0
"""Allowed time for a process to end after SIGINT [s], on any machine; every job would take many minutes."""

JOBS: Mapping[str, tuple[str, str]] = {
    "run": ("rollout('vacuum', dt=1e-6, duration=1e-4)",
            "rollout('vacuum', angle=1., dt=1e-6, duration=5000., every=10**6)"),
    "batch": ("rollout('vacuum', angle=np.ones(600), dt=1e-3, duration=0.1, num_threads=2)",
              "rollout('vacuum', angle=np.ones(600), dt=1e-6, duration=5000., every=10**4, num_threads=2, file=FILE)"),
    "adaptive": ("rollout('vacuum', integrator='bs3', rtol=1e-6)",
                 "rollout('vacuum', angle=1., integrator='bs3', rtol=1e-13, dt=1e7, duration=1e7)"),
    "adaptive batch": ("rollout('vacuum', integrator='bs3', rtol=1e-6, angle=np.ones(600), num_threads=2)",
                       "rollout('vacuum', angle=np.ones(600), integrator='bs3', rtol=1e-13, dt=1e7, duration=1e7, "
                       "num_threads=2)"),
    "errors": ("rollout('vacuum', dt=1e-6, duration=1e-4)",
               "rollout('vacuum', angle=1., dt=1e-6, duration=5000., every=10**6, estimate_error=True)"),
    "compensated": ("rollout('vacuum', dt=1e-6, duration=1e-4, compensated=True)",
                    "rollout('vacuum', dt=1e-6, duration=5000., every=10**6, compensated=True)"),
    "step": ("env = gym.make('LabPendulum-v0', integrator='implicit_midpoint', substeps=10**9).unwrapped; env.reset()",
             "env.step(np.zeros(1, dtype=np.float32))"),
    "vector step": ("env = gym.make_vec('LabPendulum-v0', num_envs=600, substeps=10**9); env.reset(seed=0)",
                    "env.step(np.zeros((600, 1), dtype=np.float32))"),
    "adaptive vector step": ("env = gym.make_vec('LabPendulum-v0', num_envs=600, dt=1e7, integrator='bs3', rtol=1e-13, "
                             "observation_delay=1e7); env.reset(seed=0)",
                             "env.step(np.zeros((600, 1), dtype=np.float32))"),
}
"""Code that compiles a program, and code that would run it for many minutes."""

PROGRAM = """
import os, signal, sys, warnings
signal.signal(signal.SIGINT, signal.default_int_handler)  # shells start background jobs with SIGINT ignored
warnings.simplefilter("ignore")
os.environ["LAB_PENDULUM_BACKEND"] = "compiled"
import gymnasium as gym
import numpy as np
import pendulum_env
from pendulum_env import rollout
first, job, FILE = sys.argv[1:]
exec(first)
print("ready", flush=True)
try:
    exec(job)
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="SIGINT cannot be sent to one process")
@pytest.mark.parametrize("job", JOBS)
def test_ctrl_c_ends_it(job: str, tmp_path: Path) -> None:
    pytest.importorskip("numba")
    file = tmp_path / "runs.npy"
    process = subprocess.Popen([sys.executable, "-c", PROGRAM, *JOBS[job], file], stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        time.sleep(0.3)
        assert process.poll() is None
        sent = time.perf_counter()
        process.send_signal(signal.SIGINT)
        out, errors = process.communicate(timeout=PATIENCE)
        print(f"\n{job}: ended after {time.perf_counter() - sent:.2f} s")
    finally:
        process.kill()
        process.wait()
    assert out == "interrupted\n", errors
    if job == "batch":
        records = np.load(file)
        assert records["angle"].shape == (len(records), 600)
        assert np.isfinite(records["angle"]).all()
        assert records["time"].tolist() == pytest.approx([0.01 * i for i in range(len(records))])


def test_an_environment_goes_on_after_an_interruption(monkeypatch: pytest.MonkeyPatch) -> None:
    in_pieces_of(50, monkeypatch)
    programs = program_that_is_interrupted(single, "run", monkeypatch)
    env = LabPendulumEnv(substeps=2 * FEW, dt=1.0, backend="python")
    env.reset(seed=0)
    before, action = env.get_state(), np.ones(1, dtype=np.float32)
    programs[0].at = 4
    with pytest.raises(KeyboardInterrupt):
        env.step(action)
    assert env.get_state()["state"] == before["state"]
    assert env.step(action)[4]["time"] == pytest.approx(1.0)
    assert math.isfinite(env.step(action)[4]["angle"])
