"""Tests of batches of runs: every run equals the single run bit for bit, however the batch is run and recorded."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from choice import check_pairs, pairs

import integrators
from pendulum_env import SCENES, SceneError, rollout
from pendulum_env.engine.runs import RecordSchedule

ANGLES = np.array([[0.1, 1.0, 2.5], [3.0, 3.14, -7.0]])
DIAGNOSED: tuple[tuple[str, ...], ...] = ((), ("energy",), ("heat_by_effect",))
AXES = (list(SCENES), list(integrators.METHODS), DIAGNOSED, [1, 7])
PAIRS = pairs(AXES)


@pytest.mark.parametrize("case", PAIRS, ids=lambda case: "-".join(str(part) for part in case))
def test_each_run_is_the_single_run(case: Any) -> None:
    """Check that runs of a batch equal single runs, near the top and at a speed limit: values, stop times, reasons."""
    scene, method, diagnostics, every = case
    options: dict[str, Any] = {"integrator": method, "diagnostics": diagnostics, "every": every, "duration": 0.5,
                               "dt": 0.013, "velocity": 3.0, "speed_limit": 4.5, "backend": "python", "warn": False}
    batch = rollout(scene, angle=ANGLES, **options)
    assert batch.angle.shape == (*ANGLES.shape, len(batch.time))
    stopped = 0
    for i, place in enumerate(np.ndindex(ANGLES.shape)):
        single = rollout(scene, angle=float(ANGLES[place]), seed=i, **options)
        stopped += single.stop_reason != ""
        assert batch.stop_reason[i] == single.stop_reason
        assert batch.stop_time[place] == single.stop_time  # type: ignore[index]
        shared = np.isin(batch.time, single.time)
        count = int(shared.sum())
        assert np.array_equal(np.flatnonzero(shared), np.arange(count))
        for name in ("angle", "velocity", "energy", "energy_residual"):
            column, wanted = getattr(batch, name)[place], getattr(single, name)
            assert np.array_equal(column[:count], wanted[:count]), name
            assert np.all(np.isnan(column[count:])), name
        for name, heat in single.heat_by_effect.items():
            assert np.array_equal(batch.heat_by_effect[name][place][:count], heat[:count])
    assert scene != "vacuum" or stopped


def test_how_many_combinations() -> None:
    """Every pair of values, but of methods in scenes every kind: LAB_PENDULUM_GRID=full takes each method in each."""
    print(f"\n{len(PAIRS)} combinations of scene x method x diagnostics x stride; 6 runs each")
    check_pairs(PAIRS, AXES)


@pytest.mark.slow
def test_compiled_threads_and_blocks() -> None:
    angles = np.linspace(-3.0, 3.0, 2500)
    one, three = (rollout("lab", warn=False, angle=angles, duration=0.3, num_threads=count) for count in (1, 3))
    assert np.array_equal(one.angle, three.angle)
    for i in (0, 1023, 1024, 2499):
        single = rollout("lab", warn=False, angle=float(angles[i]), duration=0.3)
        assert np.array_equal(one.angle[i], single.angle)
        assert np.array_equal(one.energy_residual[i], single.energy_residual)


def test_parameters_of_each_run() -> None:
    lengths, masses = np.array([0.3, 0.5, 1.0]), [0.02, 0.04, 0.08]
    options: dict[str, Any] = {"angle": 0.4, "gamma": 0.1, "duration": 1.0, "backend": "python"}
    batch = rollout("lab", length=lengths, mass=masses, **options)
    for i in range(3):
        single = rollout("lab", length=float(lengths[i]), mass=masses[i], **options)
        assert np.array_equal(batch.angle[i], single.angle)
        assert np.array_equal(batch.energy[i], single.energy)


def test_records_in_a_file(tmp_path: Path) -> None:
    """Check that a record file holds the numbers of a run in memory, for NumPy to read, and check its JSON file."""
    both = ("energy", "heat_by_effect")
    options: dict[str, Any] = {"angle": ANGLES, "duration": 2.0, "every": 3, "diagnostics": both, "warn": False,
                               "backend": "python"}
    seen: list[float] = []
    stored = rollout("lab", file=tmp_path / "runs.npy", progress=lambda done, what: seen.append(done), **options)
    kept = rollout("lab", **options)
    for name in ("time", "angle", "velocity", "energy", "energy_residual"):
        assert np.array_equal(getattr(stored, name), getattr(kept, name)), name
    assert np.array_equal(stored.heat_by_effect["linear_drag"], kept.heat_by_effect["linear_drag"])
    records = np.load(tmp_path / "runs.npy", mmap_mode="r")
    assert records["angle"].shape == (len(kept.time), *ANGLES.shape)
    assert seen == sorted(seen)
    assert seen[-1] == 1.0
    facts = json.loads((tmp_path / "runs.npy.json").read_text())
    assert facts["integrator"] == "rk4"
    assert json.loads(facts["scene"]) == SCENES["lab"].to_dict()
    assert "Software" in facts


def test_a_bar_if_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[tuple[str, float]] = []

    @contextmanager
    def bar(title: str) -> Iterator[Any]:
        yield lambda done, what: shown.append((title, done))

    monkeypatch.setattr("pendulum_env.common.progress.progress_bar", bar)
    rollout("vacuum", angle=ANGLES, duration=0.2, backend="python")
    assert shown == []
    rollout("vacuum", angle=ANGLES, duration=0.2, backend="python", progress=True)
    assert shown[-1] == ("6 runs", 1.0)


@pytest.mark.slow
def test_a_broken_off_file_is_valid(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pendulum_env.engine.runs.CHUNK", 2000)

    def stop(done: float, what: str) -> None:
        if done > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        rollout("lab", warn=False, angle=ANGLES, duration=2.0, file=tmp_path / "runs.npy", progress=stop)
    records = np.load(tmp_path / "runs.npy")
    whole = rollout("lab", warn=False, angle=ANGLES, duration=2.0)
    assert 50 < len(records) < len(whole.time)
    assert np.array_equal(np.moveaxis(records["angle"], 0, -1), whole.angle[..., : len(records)])


@pytest.mark.parametrize("method", ["velocity_verlet", "rk4"])
def test_chunks_do_not_touch_a_bit(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = rollout("lab", integrator=method, angle=ANGLES, velocity=15.0, duration=1.0, backend="python")
    monkeypatch.setattr("pendulum_env.engine.runs.CHUNK", 300)
    parts = rollout("lab", integrator=method, angle=ANGLES, velocity=15.0, duration=1.0, backend="python")
    assert np.array_equal(whole.angle, parts.angle)


@pytest.mark.slow
def test_memory_is_what_is_recorded() -> None:
    """Check that the memory of a batch does not grow with the number of steps between records."""
    import tracemalloc

    peaks = []
    rollout("lab", angle=np.zeros(2000), duration=0.1)
    for every in (10, 20):
        tracemalloc.start()
        rollout("lab", angle=np.zeros(2000), dt=0.01, duration=0.1 * every, every=every)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] == pytest.approx(peaks[0], rel=0.05)


def test_a_plan_counts_what_it_marks() -> None:
    for steps in (1, 6, 7, 20):
        for every in (1, 3, 7):
            plan = RecordSchedule(0.1, steps, min(every, steps))
            assert plan.count == len(plan.marks)
            assert (plan.marks[0], plan.marks[-1]) == (0, steps)


BAD: dict[str, tuple[dict[str, Any], str]] = {
    "shapes": ({"angle": [1.0, 2.0], "length": [1.0, 1.0, 1.0]}, "must have one shape, not angle (2,), length (3,)"),
    "entry": ({"angle": [1.0, 2.0], "length": [1.0, -1.0]}, "In run 1 of 2: length must be a finite number above 0"),
    "empty": ({"angle": []}, "at least one number"),
    "file": ({"angle": [1.0, 2.0], "file": "runs.csv"}, "must end in .npy, not 'runs.csv'"),
    "one run": ({"angle": 1.0, "file": "runs.npy"}, "file= is for batches"),
    "threads": ({"angle": [1.0, 2.0], "num_threads": 0}, "num_threads must be a whole number from 1"),
    "too many": ({"angle": np.zeros(200_000), "duration": 100.0}, "raise every, shorten the run, or give a file"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_gives_one_clear_error(case: str) -> None:
    options, words = BAD[case]
    with pytest.raises(SceneError, match=re.escape(words)):
        rollout("vacuum", backend="python", **options)
