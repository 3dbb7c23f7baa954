"""The oracle of steps in 40 digits knows every family by its table and detects steps that are slightly wrong.

For each family ``write_step`` is replaced by one with an error of a thousandth. The package then runs these steps, and
the oracle has to report a mismatch. The oracle itself is tested against scipy's DOP853 and steps computed by hand.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import islice
from typing import Any

import forty_digits
import mpmath
import numpy as np
import pytest
from choice import kind as alike
from forty_digits import MULTISTEP, ONE_STEP, Problem, mpf
from scipy.integrate import solve_ivp

from integrators import METHODS, Method
from integrators.steps.terms import Notation
from integrators.steps.unroll import unroll
from pendulum_env import Scene, rollout
from pendulum_env.auto import probes
from pendulum_env.auto.probes import Probe, ProbeMotions
from pendulum_env.engine.machine import fitting
from pendulum_env.physics.effects import Gravity, LinearDrag, QuadraticDrag, SmallAngleGravity
from pendulum_env.truth import long_runs
from pendulum_env.truth import reference as module
from pendulum_env.truth.answer import Truth
from pendulum_env.truth.long_runs import Pair
from pendulum_env.truth.reference import reference, true_motion


@pytest.fixture(autouse=True)
def forty() -> Iterator[None]:
    """Compute in 40 digits, whatever tests before have left."""
    with mpmath.workdps(40):
        yield


FAMILIES = dict.fromkeys(map(type, METHODS.values()))
NO_COEFFICIENTS = {
    **dict.fromkeys(("forward_euler", "backward_euler", "symplectic_euler", "symplectic_euler_position_first",
                     "conformal_symplectic_euler"), "all of them are 1"),
    "exact": "it has no table",
    "taylor": "those of its series come from the problem",
}
"""Method -> reason why its step contains no coefficients, so that only longer steps are tested."""

H, STEPS, START = 0.1, 4, (-1.0, 2.0)
OMEGA0 = math.sqrt(9.81)


@dataclass(frozen=True)
class Case:
    """A scene with its equation in units of 1/omega0."""

    effects: tuple[Any, ...]
    problem: Problem

    @property
    def scene(self) -> Scene:
        return Scene("for the oracle", effects=self.effects)


FREE, DAMPED = Problem(lambda t, q: -q), Problem(lambda t, q: -q, linear=0.8)
CASES = {
    "pendulum": Case((Gravity(),), Problem(lambda t, q: -forty_digits.sin(q))),
    "damped oscillator": Case((SmallAngleGravity(), LinearDrag(gamma=0.8 * OMEGA0)), DAMPED),
    "quadratic drag": Case((Gravity(), QuadraticDrag(c=0.4)), Problem(lambda t, q: -forty_digits.sin(q),
                                                                      quadratic=0.4)),
}
PAIRS = [(name, case) for case in CASES for name in fitting(CASES[case].scene)]
ONE_OF_A_KIND = frozenset(map(alike, METHODS))
"""The first methods whose programs are written in their way; the coefficients of others have digests of their own."""
SOME_AND_ALL = pytest.mark.parametrize("names", [
    pytest.param(ONE_OF_A_KIND, id="one of a kind"),
    pytest.param(frozenset(METHODS), id="all", marks=pytest.mark.slow)])


def own_steps(method: Method, problem: Problem, angle: float, velocity: float, h: float, steps: int) -> np.ndarray:
    """Return angle and velocity after 0, 1, ... steps of a method's table, in units of time of the problem."""
    start = mpf(angle), mpf(velocity)
    if method.exact:
        states = [problem.exact(mpf(0), *start, k * mpf(h)) for k in range(1, steps + 1)]
    else:
        states = [*islice(forty_digits.steps(method, problem, mpf(0), *start, mpf(h)), steps)]
    return np.array([(angle, velocity), *states], dtype=float).T


def seen(method: Method, case: Case) -> bool:
    """Return True if the oracle reports that the first steps do not follow the method's table."""
    unit = 1.0 / OMEGA0
    run = rollout(case.scene, integrator=method, angle=START[0], velocity=START[1] / unit, dt=H * unit,
                  duration=STEPS * H * unit, backend="python", warn=False)
    own = own_steps(method, case.problem, *START, H, STEPS)
    return not np.max(np.abs(np.array([run.angle, run.velocity * unit]) - own)) < 1e-11


# --- the oracle is right --------------------------------------------------------------------------------------------


def test_every_family_has_an_oracle() -> None:
    assert {kind.__name__ for kind in FAMILIES} == ONE_STEP.keys() | MULTISTEP.keys() | {"Exact"}


@pytest.mark.quick(
    "RungeKutta-one of a kind", "DiscreteGradient-one of a kind", "Adams-one of a kind", "Splitting-one of a kind"
)
@SOME_AND_ALL
@pytest.mark.parametrize("kind", FAMILIES, ids=lambda kind: kind.__name__)
def test_the_package_takes_the_steps_of_its_tables(kind: type[Method], names: frozenset[str]) -> None:
    tried = [(name, case) for name, case in PAIRS if type(METHODS[name]) is kind and name in names]
    assert {name for name, _ in tried} == {name for name in names if type(METHODS[name]) is kind}
    assert tried
    assert [pair for pair in tried if seen(METHODS[pair[0]], CASES[pair[1]])] == []


@pytest.mark.quick("damped oscillator")
@pytest.mark.parametrize("case", CASES)
def test_the_oracle_of_a_method_of_high_order_is_the_motion(case: str) -> None:
    problem = CASES[case].problem

    def rates(_: float, y: Any) -> tuple[Any, Any]:
        return y[1], problem.acceleration(0.0, float(y[0]), float(y[1]))

    motion = solve_ivp(rates, (0.0, 1.0), START, method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
    for name in ("verner9", "gauss8", "kahan_li8", "taylor", "quinlan_tremaine8", "dprkn12", "bdf6", "exact"):
        if name in fitting(CASES[case].scene) and not (name == "exact" and case == "quadratic drag"):
            count = 128 if name == "bdf6" else 1 if name == "exact" else 32
            own = own_steps(METHODS[name], problem, *START, 1.0 / count, count)
            rough = 1e-7 if name == "bdf6" else 4e-5 if case == "quadratic drag" and name == "kahan_li8" else 1e-9
            assert math.dist(own[:, -1], motion) < rough, name


def test_single_steps_by_hand() -> None:
    """Steps of q'' = -q - d v from (1, 0) with h = 1/2, in fractions."""
    free, damped = FREE, Problem(lambda t, q: -q, linear=1.0)
    by_hand = {
        ("forward_euler", free): (1.0, -0.5),
        ("symplectic_euler", damped): (0.75, -0.5),
        ("velocity_verlet", free): (0.875, -0.46875),
        ("implicit_midpoint", free): (15.0 / 17.0, -8.0 / 17.0),
        ("discrete_gradient", free): (15.0 / 17.0, -8.0 / 17.0),
        ("backward_euler", damped): (1.0 - 0.25 / 1.75, -0.5 / 1.75),
        ("newmark_linear", free): (22.0 / 25.0, -0.5 * (1.0 + 22.0 / 25.0) / 2.0),
        ("exact", free): (math.cos(0.5), -math.sin(0.5)),
    }
    for (name, problem), state in by_hand.items():
        own = own_steps(METHODS[name], problem, 1.0, 0.0, 0.5, 1)
        assert own[:, 1] == pytest.approx(state, abs=1e-14), name


# --- the oracle is independent --------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_oracle_never_writes_a_step(monkeypatch: pytest.MonkeyPatch) -> None:
    def steps(name: str, case: str) -> Any:
        return own_steps(METHODS[name], CASES[case].problem, *START, H, STEPS).tolist()

    before = [steps(*pair) for pair in PAIRS]

    def forbidden(*_: Any, **__: Any) -> Any:
        raise AssertionError("an oracle has asked the package for a step")

    for kind in FAMILIES:
        for name in ("write_step", "write_estimating_step", "write_starter"):
            monkeypatch.setattr(kind, name, forbidden, raising=False)
    monkeypatch.setattr("integrators.solve", forbidden)
    assert [steps(*pair) for pair in PAIRS] == before


# --- a step that is slightly another --------------------------------------------------------------------------------

Write = Callable[[Any, Notation], str]


def longer(write: Write) -> Write:
    """Return the source of steps that are a thousandth longer than declared."""
    return lambda self, notation: re.sub(
        r'(?m)^(def step\(.*\):\n    """.*"""\n)', r"\1    h = 1.001*h\n", write(self, notation))


def rougher(write: Write) -> Write:
    """Return the source of steps whose coefficients are all wrong by a thousandth."""
    return lambda self, notation: write(
        self, replace(notation, number=lambda x: notation.number(x * Fraction(1001, 1000))))


def swapped(monkeypatch: pytest.MonkeyPatch, method: Method, mutant: Callable[[Write], Write]) -> Method:
    """Return the method with another step and a new name, so that no cached program is used."""
    kind, before = type(method), unroll(method)
    monkeypatch.setattr(kind, "write_step", mutant(kind.write_step))
    same = unroll(method) == before
    assert same == (mutant is rougher and method.name in NO_COEFFICIENTS)
    return method if same else replace(method, name=f"{method.name}_{mutant.__name__}")


@pytest.mark.quick(
    "RungeKutta-rougher-one of a kind", "DiscreteGradient-rougher-one of a kind", "Adams-rougher-one of a kind",
    "Splitting-rougher-one of a kind"
)
@pytest.mark.parametrize(("mutant", "names"), [
    pytest.param(rougher, ONE_OF_A_KIND, id="rougher-one of a kind"),
    *(pytest.param(mutant, frozenset(METHODS), id=f"{mutant.__name__}-all", marks=pytest.mark.slow)
      for mutant in (rougher, longer))])
@pytest.mark.parametrize("kind", FAMILIES, ids=lambda kind: kind.__name__)
def test_the_oracles_see_every_step_that_is_slightly_another(
    kind: type[Method], mutant: Callable[[Write], Write], names: frozenset[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, case in PAIRS:
        if type(METHODS[name]) is kind and name in names:
            with monkeypatch.context() as patch:
                method = swapped(patch, METHODS[name], mutant)
                if method is not METHODS[name]:
                    assert seen(method, CASES[case]), (name, case)


@pytest.mark.quick("Exact", "Taylor", "SecondOrder", "DiscreteGradient", "BackwardDifference")
@pytest.mark.parametrize("kind", FAMILIES, ids=lambda kind: kind.__name__)
def test_references_see_every_family_that_steps_too_far(kind: type[Method], monkeypatch: pytest.MonkeyPatch) -> None:
    """Reference solutions stay unchanged, and the run deviates from them."""
    method = max((m for m in METHODS.values() if type(m) is kind), key=lambda m: m.order)
    drags = (Gravity(), QuadraticDrag(c=0.4)) if method.name in fitting(CASES["quadratic drag"].scene) else (Gravity(),)
    for scene in (CASES["pendulum"].scene, Scene("numerical", effects=drags)):
        def error(chosen: Method, truth: Truth, scene: Scene = scene) -> float:
            run = rollout(scene, integrator=chosen, angle=1.0, velocity=0.5, dt=0.005, every=50, duration=1.0,
                          backend="python", warn=False)
            return float(np.max(truth.distance(run.angle)))

        times = np.linspace(0.0, 1.0, 5)
        true = reference(scene, 1.0, 0.5, times)
        assert error(method, true) < 2e-4
        with monkeypatch.context() as patch:
            other = swapped(patch, method, longer)
            again = reference(scene, 1.0, 0.5, times)
            assert again.angle.tolist() == true.angle.tolist()
            assert error(other, again) > 1e-3


@pytest.mark.slow
def test_truths_that_take_steps_say_when_these_are_others(
    monkeypatch: pytest.MonkeyPatch, interpreted: None
) -> None:
    """Reference solutions computed by a method are checked by another one; the error estimate shows a wrong step."""
    scene, marks = Scene("lab", effects=(Gravity(), QuadraticDrag(c=0.4))), np.array([1.0, 2.0])
    times, probe = np.linspace(0.0, 2.0, 11), Probe(1.0, 0.0, (0.0,) * 10, (), 1.0, "by hand")

    def errors() -> list[float]:
        return [true_motion(scene, 1.0, 0.0, times).error_estimate,
                ProbeMotions(scene, 0.1).motion(probe, 1e-9).error_estimate,
                Pair(scene, 1.0, 0.0, marks, 0.5, "python", lambda *_: None).at(marks).error_estimate]

    assert max(errors()) < 1e-9
    first, second = long_runs.followers(scene)
    with monkeypatch.context() as patch:
        patch.setattr(module, "STEPPED", swapped(patch, METHODS["rk4"], longer))
        patch.setattr(probes, "CHECK", replace(METHODS["verner9"], name="verner9_longer"))
        patch.setattr(long_runs, "followers", lambda scene: (first, replace(second, name=f"{second.name}_longer")))
        assert type(METHODS["rk4"]) is type(METHODS["verner9"]) is type(second)
        stepped, probed, paired = errors()
        assert math.isnan(stepped)
        assert probed > 1e-5
        assert paired > 1e-5
    with monkeypatch.context() as patch:
        wrong = swapped(patch, first, longer)
        patch.setattr(long_runs, "followers", lambda scene: (wrong, second))
        assert errors()[2] > 1e-5
