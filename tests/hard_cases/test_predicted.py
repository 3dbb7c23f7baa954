"""Predicted errors: the 40-digit arithmetic behind them, and runs whose errors are not as predicted."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import forty_digits
import mpmath
import mutants
import numpy as np
import pytest
from hard_truths import otherwise

from integrators import METHODS
from pendulum_env.engine.machine import offers
from pendulum_env.hard_cases import near_top, predicted
from pendulum_env.hard_cases.case import ACCURATE, STABLE, WRONG, Case, held
from pendulum_env.hard_cases.predicted import FILE
from pendulum_env.hard_cases.run import CASES, MOTIONS

NAME = "release 1e-03 rad from the top"
MOTION = MOTIONS[NAME]


def test_every_motion_has_its_predictions_and_no_other_is_stored() -> None:
    """A method that was added after the file was made is in no motion of it, and is bound by its order."""
    stored = json.loads(Path(FILE).read_text(encoding="utf-8"))
    assert stored.keys() == MOTIONS.keys()
    assert all(case.motion == MOTIONS[case.motion.name] for case in CASES if case.motion)
    known = {method for row in stored.values() for method in row}
    assert known <= METHODS.keys()
    for name, row in stored.items():
        fitting = {method for method in known if forty_digits.fits(MOTIONS[name], METHODS[method])}
        assert row.keys() == fitting, name
        for method, (steps, error) in row.items():
            assert steps >= 1, (name, method)
            assert error >= 0.0, (name, method)


def released(time: float) -> tuple[Any, Any]:
    """Return the exact state after a release from 2 rad: sin(q/2) = k sn(K - t), k = sin 1, by mpmath in 40 digits."""
    with mpmath.workdps(40):
        k = mpmath.sin(1)
        sn, cn = (mpmath.ellipfun(name, mpmath.ellipk(k * k) - time, m=k * k) for name in ("sn", "cn"))
        return tuple(forty_digits.mpf(mpmath.nstr(x, 38)) for x in (2 * mpmath.asin(k * sn), -2 * k * cn))


@pytest.mark.parametrize("method", ["rk4", "kahan_li8", "gauss4", "ab4", "bdf4", "stoermer5", "numerov", "chin4a",
                                    "taylor", "dprkn8", "hht_alpha", "hht_alpha_mean_force", "discrete_gradient"])
def test_steps_in_forty_digits_have_the_order_of_the_method(method: str) -> None:
    """The error over 1/omega0 from 2 rad falls with the order of the method."""
    short, end = replace(MOTION, angle=2.0, time=1.0, from_top=False), [released(1.0)]
    coarse, fine = (forty_digits.error(METHODS[method], short, end, count) for count in (16, 32))
    assert math.log2(coarse / fine) == pytest.approx(METHODS[method].order, abs=0.6)


@pytest.mark.slow
def test_the_exact_motion_is_that_of_the_elliptic_functions() -> None:
    (state,) = forty_digits.truth(replace(MOTION, angle=2.0, time=0.25))
    assert max(abs(x - y) for x, y in zip(state, released(0.25), strict=True)) < 1e-33


@pytest.mark.parametrize("name", MOTIONS)
def test_true_motions_are_those_of_closed_forms_and_of_other_integrations(name: str) -> None:
    """Errors are relative to the size of the motion; those of a linear equation are small for a small angle."""
    motion = MOTIONS[name]
    true, other = motion.true(), otherwise(motion)
    size = abs(math.pi - true[0][-1]) if motion.from_top else motion.largest
    rounding = 4.0 * np.max(np.spacing(np.abs(true[0]))) / size
    assert len(true[0]) == len(true[1]) == motion.marks + 1
    for found, wanted, scale in zip(true, other, (size, size * motion.scene.omega0 * motion.pace), strict=True):
        assert np.isnan(wanted).all() or np.max(np.abs(found - wanted)) < (1e-10 + rounding) * scale


@pytest.mark.parametrize(("factor", "outcome"), [(1.0, ACCURATE), (1.01, ACCURATE), (1.03, WRONG), (0.97, WRONG)])
def test_an_error_must_be_the_predicted_one(factor: float, outcome: str) -> None:
    method = METHODS["heun"]
    _, error = MOTION.steps_and_error(method)
    assert held(MOTION, method, factor * error).outcome == outcome


def test_a_large_predicted_error_is_no_accuracy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(predicted, "stored", lambda _file: {NAME: {"rk4": (100, 0.5)}})
    assert held(MOTION, METHODS["rk4"], 0.5).outcome == STABLE
    assert held(MOTION, METHODS["rk4"], 0.6).outcome == WRONG
    assert MOTION.allowed(METHODS["rk4"]) < 0.52


def test_a_method_without_a_prediction_is_judged_by_its_order() -> None:
    own = mutants.altered(METHODS["rk4"], name="own")
    case = next(case for case in near_top.CASES if case.name == NAME)
    assert case.tried(own).outcome == ACCURATE
    assert case.tried(mutants.altered(METHODS["forward_euler"], name="own", order=4)).outcome == WRONG


@pytest.mark.parametrize("case", [
    pytest.param(case, id=case.name, marks=[pytest.mark.slow] if case.long else [])
    for case in CASES if case.motion and case.motion.foretells(METHODS["rk4"])])
def test_a_case_notices_the_step_of_another_method(case: Case) -> None:
    """The step of Kutta's method of order 3 runs under the name rk4."""
    assert case.as_expected(METHODS["rk4"], case.tried(METHODS["rk4"]))
    assert mutants.noticed(case, mutants.lower("rk4"))


EDGES = [f"upright, {where} edge" for where in ("10% below the lower", "at the lower", "10% above the lower",
                                                "3% below the upper", "at the upper")]
FORCES = ("gravity", "small_angle_gravity")
TINY = [f"{size} rad, {force}" for size in ("1e-308", "1e-310", "1e-315") for force in FORCES]
SMALL_STEPS = "omega0 h = {}, small angles"
UNSEEN: dict[tuple[str, str], str] = {
    (case, method): reason for reason, method, cases in (
        ("its history needs 44 steps for each mark, in which the errors of both are below rounding",
         "quinlan_tremaine12", ["the separatrix", *EDGES[:4], "torque changing sign each control step", *TINY,
                                "random actions", "a wire that catches again"]),
        ("rounding exceeds the errors of both", "verner9",
         [*EDGES[3:], *TINY[4:], "sticking and sliding by turns", "quadratic drag to rest in dry friction",
          "dry friction, quadratic drag and a torque", "a random torque in each step, full gravity", "gusts",
          "a torque that exceeds dry friction by one part in 1e6", "Coulomb friction to rest in coarse steps"]),
        *(("rounding exceeds the errors of both", method, ["a random torque in each step, full gravity"])
          for method in ("sofroniou_spaletta10", "dprkn12")),
        ("rounding exceeds the errors of both", "dop853", [*TINY[4:], "a random torque in each step, full gravity"]),
        ("the errors of both agree to 2 %", "verner9", ["Coulomb friction to rest, small angles"]),
        ("the errors of both agree to 2 %", "dop853", ["the kinks of quadratic drag"]),
        ("the errors of both agree to 2 %", "velocity_verlet", ["bang-bang"]),
        ("the errors of both agree to 2 %", "yoshida6a", [SMALL_STEPS.format(0.5)]),
        ("each torque lasts one step, which both begin with the same starter", "bdf4",
         ["torque changing sign each step", *(f"a random torque in each step, {kind}" for kind in (
             "full gravity", "quadratic drag"))]),
        ("the swing is gone after the steps of the same starter", "bdf4",
         [SMALL_STEPS.format(10), SMALL_STEPS.format(20)]),
        ("the largest error is that of the first steps, which both begin with the same starter", "bdf4",
         [f"linear drag, gamma h = {load:g}" for load in (10.0, 1e3, 1e6)]),
        ("the first step of both leaves the velocity, with either sign", "gauss6",
         [f"linear drag, gamma h = {load:g}" for load in (1e3, 1e6)]),
        *(("both grow, so that either may stop as diverged", method, [SMALL_STEPS.format(size) for size in sizes])
          for method, sizes in (("bdf4", (0.5, 1, 1.5)), ("quinlan_tremaine12", (0.5,)), ("velocity_verlet", (2.01,)))),
        ("both grow, so that either may stop as diverged", "heun", ["torque changing sign each step"]),
    ) for case in cases
}
"""(case, method) -> why the case does not notice the step of lower order under the method's name."""


@pytest.mark.slow
@pytest.mark.parametrize("method", mutants.RELATIVES)
def test_every_case_of_accuracy_notices_the_lower_order(method: str) -> None:
    cases = [case for case in CASES if not case.long and case.motion and case.motion.foretells(METHODS[method])]
    assert len(cases) > 30
    missed = {(case.name, method) for case in cases if not mutants.noticed(case, mutants.lower(method))}
    assert missed == {pair for pair in UNSEEN if pair[1] == method}


@pytest.mark.slow
@pytest.mark.parametrize("method", mutants.RELATIVES)
def test_some_case_notices_every_mutant(method: str) -> None:
    cases = [case for case in CASES if not case.long and METHODS[method].needs <= offers(case.scene)]
    for mutant in mutants.mutants(method):
        assert any(mutants.noticed(case, mutant) for case in cases), mutant.fault
