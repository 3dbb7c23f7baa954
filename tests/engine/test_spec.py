"""Tests of RunSpec: every public function that runs a scene checks its arguments and warns through it."""

from __future__ import annotations

import ast
import warnings
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

import gymnasium as gym
import pytest
from syntax_trees import nodes_of

import pendulum_env
from pendulum_env import SceneError, compare, cost, film, growth, rollout
from pendulum_env.engine.settings import CommonSettings
from pendulum_env.engine.spec import RunSpec

pytestmark = pytest.mark.usefixtures("all_interpreted")

SHORT = {"duration": 0.1, "angle": 0.1}
ENVS = {
    "make": lambda folder, **given: gym.make(
        "LabPendulum-v0", **{"backend": "python", "task": "free", "disable_env_checker": True, **given}),
    "make_vec": lambda folder, **given: gym.make_vec(
        "LabPendulum-v0", **{"num_envs": 2, "backend": "python", "task": "free", **given}),
}
RUNS: dict[str, Callable[..., Any]] = {
    "rollout": lambda folder, **given: rollout(**SHORT, backend="python", **given),
    "batch": lambda folder, **given: rollout(duration=0.1, angle=[0.1, 0.2], backend="python", **given),
    "film": lambda folder, scene, **given: film(scene, folder / "x.gif", **SHORT, size=64, backend="python", **given),
    "compare": lambda folder, integrator="rk4", **given: compare(integrators=integrator, **SHORT, **given),
    "growth": lambda folder, integrator="rk4", **given: growth(
        integrators=integrator, angle=0.1, periods=1.0, backend="python", **given),
    "cost": lambda folder, integrator="rk4", **given: cost(
        integrators=integrator, **SHORT, steps=[0.05], repeats=1, backend="python", **given),
}
DOORS: dict[str, Callable[..., Any]] = {**ENVS, **RUNS}
STOKES: dict[str, Any] = {"scene": "water", "damping": "linear"}
"""Scene of a ball so large and fast that Stokes' law does not hold: Re reaches thousands."""


def warnings_of(call: Callable[[], object]) -> list[str]:
    """Return the texts of all warnings that a call gives."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        call()
    return [str(warning.message) for warning in caught]


@pytest.mark.parametrize("door", DOORS)
def test_a_formula_that_does_not_hold_is_warned_of_through_every_door(door: str, tmp_path: Path) -> None:
    texts = warnings_of(lambda: DOORS[door](tmp_path, **STOKES))
    assert any("formulas do not hold: linear_drag" in text for text in texts), texts


@pytest.mark.parametrize("door", DOORS)
def test_no_warning_where_none_is_wanted(door: str, tmp_path: Path) -> None:
    assert warnings_of(lambda: DOORS[door](tmp_path, **STOKES, warn=False)) == []


@pytest.mark.parametrize("warn", [True, False])
@pytest.mark.parametrize("door", DOORS)
def test_careful_refuses_what_is_warned_of(door: str, warn: bool, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="formulas do not hold: linear_drag"):
        DOORS[door](tmp_path, **STOKES, careful=True, warn=warn)
    assert list(tmp_path.iterdir()) == []
    assert warnings_of(lambda: DOORS[door](tmp_path, scene="vacuum", careful=True)) == []


@pytest.mark.parametrize("door", ["rollout", "batch"])
def test_a_control_without_a_motor_is_warned_of(door: str, tmp_path: Path) -> None:
    """Check that a control in a scene without a motor causes a warning, and that a film refuses it."""
    (text,) = warnings_of(lambda: DOORS[door](tmp_path, scene="vacuum", control=0.5))
    assert text.startswith("The scene 'vacuum' has no motor, so that control=0.5 does nothing; leave it out")
    assert warnings_of(lambda: DOORS[door](tmp_path, scene="vacuum", control=0.0)) == []
    assert warnings_of(lambda: DOORS[door](tmp_path, scene="lab", control=0.5)) == []


@pytest.mark.parametrize("door", DOORS)
@pytest.mark.parametrize("name", [entry.name for entry in fields(CommonSettings)])
def test_shared_keywords_are_checked_by_every_door(door: str, name: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=rf"{name} must be True or False, not 'maybe'"):
        DOORS[door](tmp_path, scene="vacuum", **{name: "maybe"})


def test_of_and_of_episodes_make_what_they_describe() -> None:
    spec = RunSpec.of("lab", "dop853", angle=0.3, duration=1.0, dt=0.02, rtol=1e-6, backend="python")
    machine = spec.machine()
    assert (machine.scene, machine.method.name) == (spec.scene, "dop853")
    assert machine.tolerance == {"rtol": 1e-6, "atol": 1e-6}
    assert spec.plan is not None
    assert (spec.plan.steps, spec.h, spec.shape) == (50, 0.02, ())
    many = RunSpec.of("lab", angle=[0.1, 0.2], length=[0.3, 0.4], backend="python").runs()
    assert (many.size, many.plan.count) == (2, 1 + many.plan.steps)


MAKERS = {"Machine", "Runs", "Batch", "CertifiedMachine", "CertifiedRuns", "CertifiedBatch"}
LOW_ROOMS = ("engine", "truth", "hard_cases")
"""Subpackages that may create machines without a RunSpec: engine, reference solutions and hard cases."""
WITHOUT = {("lab/driven/windows.py", "Batch"): "its windows differ in the coefficients of the equation itself",
           ("bench/sources/virtual.py", "Machine"): "its run has no end, and its start may be lifted at any time",
           ("auto/probes.py", "Machine"): "reference solutions of probe episodes, whose controls change in each step"}
"""Modules elsewhere that create one, each with its reason."""


@pytest.mark.slow
def test_what_runs_is_made_from_a_description() -> None:
    root = Path(pendulum_env.__file__).parent
    created = {
        (path.relative_to(root).as_posix(), node.func.id)
        for path in root.rglob("*.py") if path.relative_to(root).parts[0] not in LOW_ROOMS
        for node in nodes_of(path)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in MAKERS
    }
    assert created == set(WITHOUT)
