"""Tests of the benchmark on the cost of effects: it contains all effects, and effects on the inertia cost nothing."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest
from readme_code import table

import integrators
from pendulum_env.engine.generate import program
from pendulum_env.engine.machine import fitting
from pendulum_env.physics.effects import EFFECTS
from pendulum_env.physics.presets import SCENES


@pytest.fixture
def benchmark(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "examples" / "benchmarks"))
    import effects as module
    yield module
    sys.modules.pop("effects"), sys.modules.pop("machine")


@pytest.mark.slow
def test_it_runs(benchmark: Any) -> None:
    """Time a step or two, interpreted: the table has a number where the method fits the effect, and none elsewhere."""
    rows = benchmark.pairs()
    found = benchmark.costs(rows, {"python": (1, 2, 2)}, None)
    assert list(found) == list(rows)
    for label, costs in found.items():
        fits = [all(method in fitting(scene) for scene in rows[label]) for method in benchmark.METHODS]
        assert [cost is not None for cost in costs] == fits
        assert benchmark.shown(costs[0], benchmark.text(rows[label][0]) == benchmark.text(rows[label][1]))
    assert all(costs[0] is not None for costs in found.values())


def test_every_effect_is_in_it_alone(benchmark: Any) -> None:
    rows = benchmark.pairs()
    assert [label.split(",")[0] for label in rows] == list(EFFECTS)
    for label, (have, lack) in rows.items():
        more = {effect.name for effect in have.effects} - {effect.name for effect in lack.effects}
        assert more == {label.split(",")[0]}


@pytest.mark.slow
def test_inertia_effects_run_the_same_program(benchmark: Any) -> None:
    """Check that effects on the inertia generate an identical program for every method that fits."""
    for label, (have, lack) in benchmark.pairs().items():
        inert = EFFECTS[label.split(",")[0]].kind == "inertia"
        for method in ("rk4", "velocity_verlet", "gauss4", "discrete_gradient"):
            if method in fitting(have):
                texts = [program(scene, integrators.get(method)).text for scene in (have, lack)]
                assert (texts[0] == texts[1]) == inert, (label, method)


def test_all_that_go_together_make_a_scene(benchmark: Any) -> None:
    """Check that the combined scene has one gravity and one law of the bob's drag."""
    names = {effect.name for effect in benchmark.everything().effects}
    others = EFFECTS.keys() - names
    assert {"small_angle_gravity", "linear_drag", "quadratic_drag"} <= others
    assert all(EFFECTS[name]().models for name in others)


def test_readme_has_rows_of_effects_that_there_are(benchmark: Any) -> None:
    """Check that the README lists existing effects only; ``effects.py --markdown`` prints all rows of one computer."""
    rows = [line.strip("| ").split(" | ") for line in table("cost of effects").splitlines()[2:]]
    timed = [row[0] for row in rows]
    used = {effect.name for name in ("lab", "water", "windy", "kapitza") for effect in SCENES[name].effects}
    assert used <= {label.split(",")[0] for label in timed[:-1]}
    assert timed == [label for label in (*benchmark.pairs(), "all that go together") if label in timed]
    for row in rows[:-1]:
        inert = EFFECTS[row[0].split(",")[0]].kind == "inertia"
        assert (set(row[1:]) == {"0 (same program)"}) == inert
