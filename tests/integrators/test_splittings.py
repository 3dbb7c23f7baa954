"""Splittings and compositions: published digits, order conditions, and their treatment of drag."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from splitting_truths import TRUTHS

import integrators
from integrators import METHODS, MethodError, Splitting, System, solve, unroll
from integrators.analysis import (
    amplification,
    damping_limit,
    driven_pendulum,
    leading_error,
    observed_order,
    overdamping_limit,
    splitting_order,
    stability_limit,
)
from integrators.analysis.conditions import trees, violations
from integrators.families.splitting import DRAG, DRIFT, KICK, PUSH
from integrators.tables.splittings import alternating, composed, mirrored, with_drag
from pendulum_env import SCENES, Scene, rollout
from pendulum_env.engine.machine import fitting
from pendulum_env.physics.effects import Gravity, LinearDrag, QuadraticDrag, SmallAngleGravity
from pendulum_env.truth.reference import reference

HALF, ONE = Fraction(1, 2), Fraction(1)
SPLITTINGS = {name: METHODS[name] for name in TRUTHS}
NYSTROM = [name for name, method in SPLITTINGS.items() if method.nystrom]
GENERAL = [name for name, method in SPLITTINGS.items() if not method.nystrom]
# Residuals of the order conditions for published digits: most have 20 correct places, these methods have fewer.
LOOSE = {"yoshida8b": 3e-18, "yoshida8c": 4e-13, "yoshida8d": 7e-13, "pefrl": 8e-17, "vefrl": 6e-17,
         "calvo_sanz_serna4": 6e-15, "blanes_moan_s6": 2e-16, "blanes_moan_s10": 2e-15, "blanes_moan_srkn6b": 2e-16,
         "blanes_moan_srkn11b": 7e-16, "blanes_moan_srkn14a": 4e-15}


def parts(method: Splitting, kind: str) -> list[Fraction]:
    """Return a splitting's kicks or drifts as they are published: without drags, with neighbours combined."""
    joined: list[tuple[str, Fraction]] = []
    for flow, fraction in method.flows:
        if flow != DRAG:
            same = bool(joined) and joined[-1][0] == flow
            joined[-1:] = [(flow, joined[-1][1] + fraction)] if same else [*joined[-1:], (flow, fraction)]
    return [fraction for flow, fraction in joined if flow == kind]


def test_truths_are_of_splittings():
    assert all(isinstance(method, Splitting) for method in SPLITTINGS.values())


@pytest.mark.parametrize("name", TRUTHS)
def test_coefficients_are_those_published(name):
    fractions = [x for kind in (KICK, DRIFT) for x in parts(SPLITTINGS[name], kind)]
    for text in TRUTHS[name].published:
        assert min(abs(x - Fraction(text)) for x in fractions) < LOOSE.get(name, 5e-19)


@pytest.mark.parametrize("name", TRUTHS)
def test_order_by_the_order_conditions(name):
    assert splitting_order(SPLITTINGS[name]) == SPLITTINGS[name].order


@pytest.mark.parametrize("name", [name for name in GENERAL if METHODS[name].order <= 6])
def test_order_with_drag_as_a_third_flow(name):
    """Checked in words of three letters; for orders 8 and 10 the contract observes the order."""
    assert splitting_order(METHODS[name], damped=True) == METHODS[name].order


@pytest.mark.parametrize("name", NYSTROM)
def test_methods_for_velocity_free_forces_would_lose_their_order_with_drag(name):
    method = METHODS[name]
    anyway = replace(method, nystrom=False, flows=with_drag(method.flows))
    assert splitting_order(anyway) < method.order
    assert observed_order(anyway, damped="quadratic") < method.order - 0.4
    with pytest.raises(MethodError, match=f"{name} needs forces free of the velocity, which this problem"):
        solve(driven_pendulum("linear"), mpmath.mpf(1), mpmath.mpf(0), [0, 1], method=method, h=0.1)
    for measure in (damping_limit, lambda m: amplification(m, 0.1, 0.1), lambda m: splitting_order(m, damped=True)):
        with pytest.raises(MethodError, match=f"{name} (needs forces free of the velocity|cannot treat drag)"):
            measure(method)


@pytest.mark.parametrize("name", TRUTHS)
def test_errors_and_limit_on_the_oscillator(name):
    truth, found = TRUTHS[name], leading_error(name)
    assert found.amplitude is None
    for term, (coefficient, power) in zip((found.angle, found.velocity, found.frequency), truth[1:4], strict=True):
        assert (float(term.coefficient), term.power) == (pytest.approx(coefficient, rel=1e-6), power)
    assert stability_limit(name) == pytest.approx(truth.limit, rel=1e-13)


CUBE = Fraction("1.2599210498948731647672106072782283505703")
CLOSED = {
    "forest_ruth": (DRIFT, 0, 1 / (2 - CUBE)),
    "suzuki4": (DRIFT, 1, 1 / (4 - Fraction("1.5874010519681994747517056392723082603915"))),
    "mclachlan_atela2": (DRIFT, 0, Fraction("0.7071067811865475244008443621048490392848")),
    "mclachlan_ss17": (DRIFT, 0, Fraction(25, 194)),
    "ruth3": (KICK, 2, Fraction(-1, 24)),
}


@pytest.mark.parametrize("name", CLOSED)
def test_closed_forms(name):
    """1/(2 - 2**(1/3)) and 1/(4 - 4**(1/3)) (Hairer, Lubich & Wanner 2006, II.4), sqrt(1/2), and fractions."""
    kind, place, value = CLOSED[name]
    assert abs(parts(METHODS[name], kind)[place] - value) < 1e-38


def test_mclachlan_s2_has_the_closed_form_of_omelyan():
    """1/2 - s/12 + 1/(6 s) with s**3 = 2 sqrt(326) + 36 (Omelyan, Mryglod & Folk 2002)."""
    with mpmath.workdps(45):
        s = mpmath.cbrt(2 * mpmath.sqrt(326) + 36)
        first = parts(METHODS["mclachlan_s2"], KICK)[0]
        assert abs(mpmath.mpf(first.numerator) / first.denominator - (mpmath.mpf(1) / 2 - s / 12 + 1 / (6 * s))) < 1e-39


DUPLICATES = {"candy_rozmus4": "forest_ruth", "kahan_li4": "suzuki4", "mclachlan_ss15": "suzuki_umeno8",
              "omelyan_babab": "mclachlan_s2", "stoermer_verlet": "velocity_verlet"}


def test_duplicates_are_aliases():
    assert {alias: integrators.ALIASES[alias] for alias in DUPLICATES} == DUPLICATES


# --- where drag goes -------------------------------------------------------------------------------------------------


def test_verlet_is_the_simplest_composition():
    verlet = METHODS["velocity_verlet"].flows
    assert with_drag(composed()) == with_drag(mirrored(KICK, (), ())) == verlet
    assert composed("1/4") == mirrored(KICK, ("1/8",), ("1/4",)) == (
        (KICK, ONE / 8), (DRIFT, ONE / 4), (KICK, 3 * ONE / 8), (DRIFT, HALF),
        (KICK, 3 * ONE / 8), (DRIFT, ONE / 4), (KICK, ONE / 8),
    )
    assert alternating(DRIFT, ("1/3",), ()) == ((DRIFT, ONE / 3), (KICK, ONE), (DRIFT, 2 * ONE / 3))


@pytest.mark.parametrize("name", GENERAL)
def test_drag_costs_no_evaluations_and_vanishes_where_there_is_none(name):
    method = METHODS[name]
    plain, damped, several = (
        unroll(method, hooks=hooks, exact_drag=exact).partition("def step")[2]
        for hooks, exact in (({}, True), ({"drag": ()}, True), ({"drag": ()}, False))
    )
    assert plain.count("force(") == damped.count("force(") == several.count("force(") == method.evaluations
    assert plain.count("v = v") == len(parts(method, KICK))
    assert damped.count("drag(") <= len(parts(method, KICK)) + 1
    assert several.count("drag(") == sum(kind == DRAG for kind, _ in method.flows) >= damped.count("drag(")


def test_pushes_are_never_joined():
    twice = Splitting(name="twice", order=1, source="none", summary="none",
                      flows=((PUSH, HALF), (PUSH, HALF), (DRIFT, HALF), (DRIFT, HALF)))
    assert unroll(twice).count("acceleration(") == 2
    assert unroll(twice).count("q = q") == 1


@pytest.mark.parametrize("name", ["pefrl", "yoshida6a"])
def test_several_drags_in_symmetric_order_keep_the_order(name):
    """Linear and quadratic drag by exact flows, composed symmetrically as in the engine; their order suffices."""
    method, gamma, c = METHODS[name], 0.25, 0.375

    def strang(t, q, v, h):
        v = v * mpmath.exp(-gamma * h / 2)
        v = v / (1 + c * abs(v) * h)
        return v * mpmath.exp(-gamma * h / 2)

    def run(steps, exact_drag):
        force, one = (lambda t, q: 1.5 * mpmath.cos(2 * t) - mpmath.sin(q)), mpmath.mpf(1)
        scope = {"one": one, "force": force, "drag": strang}
        exec(unroll(method, hooks={"drag": ()}, exact_drag=exact_drag,
                    number=lambda x: f"(one*{x.numerator}/{x.denominator})"), scope)
        h, t, q, v = mpmath.mpf("0.75") / steps, mpmath.mpf("0.25"), mpmath.mpf("0.5"), mpmath.mpf(1)
        carried = [scope["begin"](t, q, v, h)] if method.memory else []
        for i in range(steps):
            q, v, *carried = scope["step"](t + i * h, q, v, *carried, h)
        return v

    with mpmath.workdps(40):
        for exact_drag, order in ((False, method.order), (True, 2)):
            ends = [run(steps, exact_drag) for steps in (16, 32, 64)]
            slope = mpmath.log(abs(ends[0] - ends[1]) / abs(ends[1] - ends[2]), 2)
            assert slope == pytest.approx(order, abs=0.15), exact_drag


def test_the_engine_keeps_the_order_under_several_drags():
    """Strong linear and quadratic drag without turning points: the error has order 4, not 2."""
    scene = Scene(effects=(Gravity(), LinearDrag(gamma=2.0), QuadraticDrag(c=1.0)))
    truth = reference(scene, 0.2, 4.0, [0.25])
    errors = []
    for steps in (8, 16):
        run = rollout(scene, integrator="pefrl", angle=0.2, velocity=4.0, dt=0.25 / steps, duration=0.25,
                      backend="python")
        errors.append(abs(run.velocity[-1] - truth.velocity[0]))
    assert truth.error_estimate < 1e-3 * errors[-1]
    assert math.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.2)


def test_drag_in_the_middle_of_whole_kicks_would_be_of_second_order():
    """Kicks cut in equal halves around their drags lose order, which shows why they are not cut so."""
    table = mirrored(DRIFT, parts(METHODS["pefrl"], DRIFT)[:2], parts(METHODS["pefrl"], KICK)[:1])
    cut = {KICK: ((KICK, HALF), (DRAG, ONE), (KICK, HALF)), DRIFT: ((DRIFT, ONE),)}
    flows = tuple((part, share * fraction) for kind, fraction in table for part, share in cut[kind])
    naive = replace(METHODS["pefrl"], name="naive", flows=flows)
    assert splitting_order(naive) == 4
    assert splitting_order(naive, damped=True) == 2


# --- what drag costs -------------------------------------------------------------------------------------------------


def damped_radius(method: Splitting, z: float, g: float) -> float:
    """Return the spectral radius of a splitting step from the product of its sub-flows' matrices."""
    matrix = np.eye(2)
    for kind, x in ((kind, float(fraction)) for kind, fraction in method.flows):
        flow = {KICK: [[1, 0], [-z * x, 1]], DRIFT: [[1, z * x], [0, 1]], DRAG: [[1, 0], [0, math.exp(-g * x)]]}
        matrix = np.array(flow[kind]) @ matrix
    return float(np.max(np.abs(np.linalg.eigvals(matrix))))


# The largest gamma h at omega0 h = 0.3, from matrices in steps of 0.1: backward sub-steps amplify under drag.
OVERDAMPING = {
    "ruth3": 8.3, "mclachlan_atela3": 5.8, "mclachlan_s4": 6.2, "mclachlan_s5": 11.9, "pefrl": 7.2, "vefrl": 6.1,
    "blanes_moan_s6": 17.2, "blanes_moan_s10": 15.7, "forest_ruth": 9.3, "suzuki4": 21.2, "mclachlan_ss5": 23.7,
    "yoshida6a": 8.2, "yoshida6b": 6.9, "yoshida6c": 6.4, "kahan_li6": 14.1, "mclachlan_ss9": 12.4, "yoshida8a": 1.9,
    "yoshida8b": 3.8, "yoshida8c": 2.3, "yoshida8d": 5.6, "yoshida8e": 3.7, "suzuki_umeno8": 11.5,
    "mclachlan_ss17": 9.7, "kahan_li8": 10.0, "tsitouras10": 12.9, "sofroniou_spaletta10": 29.8,
    "mclachlan_sb3a4": 5.3, "mclachlan_sb3a5": 13.6, "blanes_moan_srkn6b": 11.0,
    "mclachlan_atela2": math.inf, "mclachlan_s2": math.inf,
}


@pytest.mark.parametrize("name", GENERAL)
def test_overdamping_limits(name):
    limit = overdamping_limit(name, 0.3)
    assert limit == OVERDAMPING[name] or 0 <= OVERDAMPING[name] - limit < 0.1
    assert (limit < math.inf) == ("reversible" in METHODS[name].needs) == (METHODS[name].order > 2)
    if limit < math.inf:
        assert damped_radius(METHODS[name], 0.3, 0.999 * limit) <= 1.0 + 1e-12
        assert damped_radius(METHODS[name], 0.3, 1.001 * limit) > 1.0 + 1e-12


@pytest.mark.parametrize("name", ["forest_ruth", "blanes_moan_s6", "kahan_li8"])
def test_beyond_the_limit_a_run_says_so(name):
    bare = Scene(effects=(SmallAngleGravity(),))
    h = 0.3 / bare.omega0
    for share, reason in ((0.9, ""), (1.2, "diverged")):
        scene = Scene(effects=(SmallAngleGravity(), LinearDrag(gamma=share * OVERDAMPING[name] / h)))
        run = rollout(scene, integrator=name, angle=0.5, velocity=0.0, dt=h, duration=4000 * h, backend="python")
        assert run.stop_reason == reason


def test_quadratic_drag_has_no_past_beyond_its_pole():
    """Backwards the speed v/(1 - c v t) diverges at t = 1/(c v): a step that reaches it must report divergence."""
    scene = Scene(effects=(QuadraticDrag(c=1.0),))
    for step, reason in ((0.002, "diverged"), (1e-4, "")):
        run = rollout(scene, integrator="yoshida8a", angle=0.0, velocity=1e3, dt=step, duration=0.02, backend="python")
        assert run.stop_reason == reason
    assert run.velocity[-1] == pytest.approx(1000.0 / (1.0 + 1000.0 * 0.02), rel=1e-12)


def test_scenes_say_what_they_cannot_offer():
    sticky, damped, free = (SCENES[name] for name in ("sticky_bearing", "lab", "vacuum"))
    assert set(SPLITTINGS) <= set(fitting(free))
    assert set(GENERAL) <= set(fitting(damped))
    assert not set(NYSTROM) & set(fitting(damped))
    assert set(fitting(sticky)) & set(SPLITTINGS) == {"mclachlan_atela2", "mclachlan_s2"}
    with pytest.raises(MethodError, match=r"kahan_li8 needs dissipation, if any, that can also run backwards"):
        rollout(sticky, integrator="kahan_li8")
    with pytest.raises(MethodError, match=r"okunbor_skeel6 needs forces free of the velocity"):
        rollout(damped, integrator="okunbor_skeel6")
    assert "velocity_free" not in System(lambda t, q, v: -v, one_way=True).offers()


# --- the conditions themselves ---------------------------------------------------------------------------------------


def test_trees_are_counted_as_in_the_literature():
    """Special Nyström trees of orders 1 to 8 (Hairer, Norsett & Wanner 1993, II.14)."""
    assert [len(trees(order)) for order in range(1, 9)] == [1, 1, 2, 3, 6, 10, 20, 36]


def test_conditions_are_for_splittings_of_exact_flows():
    with pytest.raises(MethodError, match="symplectic_euler is not a composition of kicks, drifts and exact drag"):
        violations(METHODS["symplectic_euler"], 1)
    verlet = METHODS["velocity_verlet"]
    assert splitting_order(verlet) == splitting_order(verlet, damped=True) == 2
    assert max(violations(verlet, 3)) == pytest.approx(1 / 6, rel=1e-14)
    assert splitting_order(replace(verlet, order=4)) == 2


def test_methods_for_velocity_free_forces_hold_no_drag():
    with pytest.raises(MethodError, match="pefrl: a method for velocity-free forces must not contain drags or pushes"):
        replace(METHODS["pefrl"], nystrom=True)
    with pytest.raises(MethodError, match="must each sum to 1, not to 1, 1, 0"):
        replace(METHODS["calvo_sanz_serna4"], nystrom=False)
