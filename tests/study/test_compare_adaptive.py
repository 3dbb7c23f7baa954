"""Tests of adaptive runs in the command `compare`: figures, the drift table's steps, refused options."""

from __future__ import annotations

import csv
import itertools
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

import integrators
from integrators import MethodError
from pendulum_env import SCENES, cli, plots, rollout
from pendulum_env.engine import timing
from pendulum_env.engine.generate import program
from pendulum_env.engine.kernels import interpreted
from pendulum_env.engine.machine import NOWHERE, UNSEEN, Machine
from pendulum_env.engine.shape import ADAPTED
from pendulum_env.engine.timing import step_times
from pendulum_env.physics import exact
from pendulum_env.study.compare import Comparison, compare, files
from pendulum_env.study.compare.drift import evaluations

pytestmark = pytest.mark.usefixtures("all_interpreted")

RUN: dict[str, Any] = {"angle": 2.0, "dt": 0.1, "duration": 3.0}


@pytest.fixture(scope="module")
def pairs():
    return compare("vacuum", "dop853,bs3", **RUN, rtol=1e-7, atol=1e-9)


def test_the_runs_are_those_of_rollout_and_meet_the_truth(pairs):
    for name, run in pairs.runs.items():
        alone = rollout("vacuum", integrator=name, velocity=0.0, rtol=1e-7, atol=1e-9, **RUN)
        np.testing.assert_array_equal(run.angle, alone.angle)
        true, _ = exact.pendulum(run.time, 2.0, 0.0, run.scene.omega0)
        assert 0.0 < np.abs(run.angle - true).max() < 2e-5
        assert run.tolerance == {"rtol": 1e-7, "atol": 1e-9}
        assert run.time.tolist() == pytest.approx([0.1 * i for i in range(31)], rel=1e-15)
    assert rollout("vacuum", **RUN).tolerance == {}


@pytest.mark.parametrize("name", ["bs3", "dop853", "tsit5", "verner7"])
@pytest.mark.parametrize("diagnostics", [(), ("energy",)])
def test_evaluations_are_those_that_are_made(name, diagnostics):
    """Compare with a run of the generated program whose force function counts its calls."""
    scene, method = SCENES["vacuum"], integrators.get(name)
    run = rollout(scene, integrator=name, velocity=0.0, rtol=1e-7, atol=1e-9, backend="python", **RUN)
    machine = Machine(scene, method, diagnostics, "python", 1e-7, 1e-9)
    made, calls = program(scene, method, diagnostics, True), [0]
    original = interpreted(made.text, made.title)["acceleration"]

    def counted(*arguments: float) -> float:
        calls[0] += 1
        return float(original(*arguments))

    advance = interpreted(made.text, made.title, {"acceleration": counted})["run"]
    state = machine.state(2.0, 0.0)
    advance(state, machine.parameters, 0.0, 0.1, 1, 30, math.inf, NOWHERE, UNSEEN)
    assert {word: int(state[machine.kept[word]]) for word in ADAPTED[1:]} == {
        "taken": run.steps, "rejected": run.rejected}
    assert evaluations(run) == calls[0]


def test_the_drift_table_says_steps_rejections_and_evaluations(pairs):
    assert [title in pairs.table.head for title in ("steps", "rejected", "evaluations")] == [True] * 3
    for row, run in zip(pairs.drift, pairs.runs.values(), strict=True):
        assert (row.steps, row.rejected, row.evaluations) == (run.steps, run.rejected, evaluations(run))
        assert row.steps >= 30
    assert pairs.drift[1].steps > 5 * pairs.drift[0].steps
    fixed = compare("vacuum", "rk4", **RUN)
    assert not {"steps", "rejected", "evaluations"} & set(fixed.table.head)
    assert fixed.drift[0].steps is None is evaluations(fixed.runs["rk4"])


def test_times_are_of_steps_taken(monkeypatch):
    machine = Machine(SCENES["vacuum"], "bs3", rtol=1e-7, atol=1e-9, backend="python")
    ticks = itertools.count()
    monkeypatch.setattr(timing, "perf_counter", lambda: 1e-3 * next(ticks))
    run = rollout("vacuum", integrator="bs3", velocity=0.0, rtol=1e-7, atol=1e-9, **RUN)
    assert step_times({0: machine}, 2.0, 0.0, 0.1, 30, rounds=7)[0] == pytest.approx(1e-3 / run.steps)


def test_titles_and_facts_give_the_tolerance_and_no_step(pairs):
    title = plots.describe(pairs.runs)
    assert "rtol = 1e-07, recorded every 0.1 s" in title
    assert "dt =" not in title
    assert "rtol = 1e-07, atol = 1e-09, steps that end at every 0.1 s" in pairs.text
    assert (json.loads(pairs.origin()["rtol"]), json.loads(pairs.origin()["atol"])) == (1e-7, 1e-9)
    mixed = {**pairs.runs, "rk4": rollout("vacuum", **RUN)}
    assert "every" not in plots.describe(mixed)
    assert "dt" not in plots.describe(mixed)
    fixed = compare("vacuum", "rk4", **RUN)
    assert "dt = 0.1 s" in fixed.text
    assert "rtol" not in fixed.origin()


def test_the_film_says_so(pairs, monkeypatch):
    seen = []
    monkeypatch.setattr(files, "side_by_side", lambda views, **_: seen.append(views[0][0].title))
    next(files.pictures(pairs, 1))
    assert seen == ["vacuum, rtol = 1e-07, atol = 1e-09, steps that end at every 0.1 s"]


@pytest.mark.parametrize(("methods", "options", "said"), [
    ("rk4,dop853", {"rtol": 1e-6}, "rk4 does not estimate its error"),
    ("dop853", {"atol": 1e-6}, "atol goes with rtol"),
    ("dop853", {"rtol": -1.0}, "rtol must be"), ("dop853", {"rtol": 1e-17}, "at least"),
])
def test_what_is_refused(methods, options, said):
    with pytest.raises(MethodError, match=said):
        compare("vacuum", methods, duration=1.0, **options)


def test_the_commands(tmp_path: Path) -> None:
    runner = CliRunner()
    done = runner.invoke(cli.app, [
        "record", "--scene", "vacuum", "-i", "dop853", "--rtol", "1e-8", "--duration", "0.2", "--size", "120",
        "--out", str(tmp_path / "film.gif")])
    assert done.exit_code == 0, done.exception
    with Image.open(tmp_path / "film.gif") as image:
        assert b'rtol' in image.info["comment"]
    done = runner.invoke(cli.app, ["record", "--rtol", "1e-8", "--out", str(tmp_path / "other.gif")])
    assert "rk4 does not estimate its error" in str(done.exception)
    assert not (tmp_path / "other.gif").exists()


def test_compare_writes_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Comparison, "pictures", lambda comparison: {})
    done = CliRunner().invoke(cli.app, [
        "compare", "--scene", "vacuum", "-i", "bs3", "-i", "dop853", "--rtol", "1e-7", "--duration", "2", "--no-film",
        "--out", str(tmp_path)])
    assert done.exit_code == 0, done.exception
    lines = (tmp_path / "drift.csv").read_text(encoding="utf-8").splitlines()
    assert "# rtol: 1e-07" in lines
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    assert all(int(row["steps"]) > 0 and int(row["force_evaluations"]) > int(row["steps"]) for row in rows)
