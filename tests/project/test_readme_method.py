"""What the READMEs say of adding a method and of its analysis, done: its code and its numbers."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from keyword_table import WORKING, public
from readme_code import block, check_numbers, run

import integrators
from integrators import analysis
from pendulum_env import plots, rollout, sweep
from pendulum_env.plots import stability as figures
from pendulum_env.study.compare import compare
from pendulum_env.study.stability import stability
from pendulum_env.truth.reference import StudyError

pytestmark = pytest.mark.usefixtures("all_interpreted")

MARKS = ("adding a method", "analysis")
PUBLIC = dict(public())


def keyword_of_a_method(function: Any) -> str:
    """Return the name of the keyword that is declared as a name or a Method, "" where a function has none."""
    declared = inspect.signature(function).parameters.values()
    return next((one.name for one in declared if "str | Method" in str(one.annotation)), "")


TAKING = {label: keyword for label, function in PUBLIC.items() if (keyword := keyword_of_a_method(function))}
"""Public functions that accept a method's name, and the keyword that does."""
ANALYSES = [name for name in analysis.__all__ if keyword_of_a_method(getattr(analysis, name))]
"""Functions of integrators.analysis that accept a method's name."""
GIVEN: dict[str, tuple[Any, ...]] = {
    "amplification": (0.3,), "spectral_radius": (0.3,), "oscillation_errors": ([0.1, 1.0],),
    "spectral_radii": ([0.1, 1.0],), "stability_function": (-1.5 + 0.5j,),
    "overdamping_limit": (0.3,), "jacobian_determinant": (0.5, 1.0, 0.0, 0.1), "observed_dense_order": (0.5,),
}
"""Arguments of an analysis after the method."""


@pytest.fixture(scope="module")
def method(tmp_path_factory: pytest.TempPathFactory) -> integrators.RungeKutta:
    """The made-up method."""
    names = run(block(MARKS[0]), tmp_path_factory.mktemp("readme"))[0]
    (found,) = (value for value in names.values() if isinstance(value, integrators.Method))
    return found


@pytest.mark.parametrize("mark", MARKS)
def test_the_numbers_beside_the_code_are_what_it_prints(mark: str, tmp_path: Path) -> None:
    check_numbers(mark, 5, tmp_path)


def test_it_solves_in_every_number(method: integrators.RungeKutta) -> None:
    """Three stages of order 3: one step on q'' = -q is the series of cos and sin up to h**3."""
    h = 0.25
    found = integrators.solve(lambda t, q, v: -q, 1.0, 0.0, [0.0, h], method=method, h=h)
    assert found.q[-1] == pytest.approx(1 - h * h / 2, abs=1e-16)
    assert found.v[-1] == pytest.approx(-h + h**3 / 6, abs=1e-16)
    many = integrators.solve(lambda t, q, v: -q, np.array([1.0, 2.0]), np.zeros(2), [0.0, h], method=method, h=h)
    np.testing.assert_allclose(many.q[-1], [1 - h * h / 2, 2 - h * h], rtol=1e-15)
    assert "v3" in integrators.unroll(method)


def test_all_analysis_takes_it(method: integrators.RungeKutta) -> None:
    """R(w) = 1 + w + w**2/2 + w**3/6, as of every method of order 3 with three stages (Hairer & Wanner 1996, IV.2)."""
    assert all(condition.defect == 0 for condition in analysis.order_conditions(method))
    assert any(condition.defect for condition in analysis.order_conditions(method, 4))
    assert analysis.principal_error(method) > 0.0
    assert analysis.observed_order(method, damped="linear") == pytest.approx(3.0, abs=0.1)
    assert analysis.leading_error(method).angle == analysis.leading_error("kutta3").angle
    assert analysis.stability_limit(method) == pytest.approx(3**0.5, rel=1e-15)
    assert analysis.damping_limit(method) == pytest.approx(2.5127453266183286, rel=1e-15)
    assert analysis.stability_function(method, -1.5 + 0.5j) == pytest.approx(
        sum((-1.5 + 0.5j) ** k / f for k, f in enumerate((1, 1, 2, 6))), rel=1e-15)
    for measure in (analysis.oscillation_errors, analysis.spectral_radii):
        np.testing.assert_allclose(measure(method, [0.1, 1.0]), measure("kutta3", [0.1, 1.0]), rtol=1e-13)
    assert analysis.amplification(method, 0.3) == pytest.approx(analysis.amplification("kutta3", 0.3), abs=1e-15)
    assert analysis.spectral_radius(method, 0.3) == pytest.approx(analysis.spectral_radius("kutta3", 0.3), abs=1e-15)
    assert analysis.area_order(method) == pytest.approx(4.0, abs=0.05)
    assert np.nanmin(analysis.stability_boundary(method).real) == pytest.approx(-2.5127453, abs=1e-4)


@pytest.mark.parametrize("name", ANALYSES)
def test_every_analysis_accepts_the_object(name: str, method: integrators.RungeKutta) -> None:
    """A method of the same family tells whether the analysis is one for such methods: both are refused, or neither."""
    given = GIVEN.get(name, ())
    ends = []
    for one in ("kutta3", method):
        try:
            ends.append(type(getattr(analysis, name)(one, *given)))
        except integrators.MethodError as error:
            ends.append(type(error))
    assert ends[0] is ends[1]


@pytest.mark.parametrize("label", TAKING)
def test_every_public_function_accepts_the_object(
    label: str, method: integrators.RungeKutta, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    """In a call that works with a name, alone and, where several methods are accepted, in a list."""
    monkeypatch.chdir(tmp_path)
    keyword, working = TAKING[label], dict(WORKING.get(label, {}))
    several = keyword == "integrators" or "Sequence" in str(inspect.signature(PUBLIC[label]).parameters[keyword])
    assert PUBLIC[label](**{**working, keyword: [method] if several else method}) is not None


def test_runs_of_the_object_have_its_order_and_its_name(method: integrators.RungeKutta) -> None:
    errors = []
    for dt in (0.02, 0.01):
        run = rollout("vacuum", integrator=method, angle=1.0, velocity=0.0, dt=dt, duration=2.0, backend="python")
        truth = rollout("vacuum", integrator="verner9", angle=1.0, velocity=0.0, dt=dt, duration=2.0, backend="python")
        errors.append(abs(run.angle[-1] - truth.angle[-1]))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(3.0, abs=0.1)
    env = gym.make("LabPendulum-v0", integrator=method, backend="python")
    env.reset(seed=0)
    assert env.step(env.action_space.sample())[4]["energy"] > 0.0
    vector = gym.make_vec("LabPendulum-v0", num_envs=2, integrator=method, backend="python")
    assert vector.unwrapped.integrator == "quarters3"  # type: ignore[attr-defined]
    assert [row.method for row in compare("textbook", [method, "rk4"], duration=2.0).drift] == ["quarters3", "rk4"]
    found = stability([method, "rk4"])
    assert [row[0] for row in found.rows] == ["quarters3", "rk4"]
    assert len(figures.regions(found.methods).axes) == 2
    assert plots.colours(["quarters3"])


def test_a_sweep_refuses_the_object(method: integrators.RungeKutta) -> None:
    """Its points are JSON: the exception that the page names."""
    for refused in ({"grid": {"angle": [0.1]}, "integrator": method}, {"grid": {"integrator": [method, "rk4"]}}):
        with pytest.raises(StudyError, match=r"only JSON's types .*, not <RungeKutta: quarters3"):
            sweep(**{"scene": "vacuum", "duration": 0.01, **refused})  # type: ignore[arg-type]
