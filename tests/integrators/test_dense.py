"""Dense output: orders, published polynomials, number types, costs and errors."""

from __future__ import annotations

import math
import pickle
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from functools import cache
from math import comb, perm
from typing import Any

import mpmath
import numpy as np
import pytest
import scipy.integrate
from choice import turn_of
from scipy.integrate._ivp.dop853_coefficients import A as DOP853_A

import integrators
from integrators import Embedded, Extension, MethodError, RungeKutta, System, solve, unroll
from integrators.analysis import dense_conditions, driven_pendulum, observed_dense_order, reference
from integrators.analysis.measured import SPAN
from integrators.analysis.measured import START as START_AT
from integrators.families.backward_differences import BackwardDifference
from integrators.families.structural import GeneralizedAlpha
from integrators.families.taylor import Taylor, coefficients
from integrators.method import exact
from integrators.solving.dense import Recorder, hermite
from integrators.tables.butcher import bernstein

METHODS = {name: m for name, m in integrators.METHODS.items() if name != "exact"}
"""Methods for any problem, without closed forms."""
TABLES = {name: m for name, m in METHODS.items() if isinstance(m, RungeKutta) and m.dense is not None}
PAIRS = [name for name, m in TABLES.items() if m.embedded]
START = (1.0, 0.5)


def swing(t, q, v):
    """Return a driven, damped, nonlinear problem in basic arithmetic."""
    return q * q * q / 6 - q + t / 4 - v / 8


SWING = System(
    swing, force=lambda t, q: swing(t, q, 0 * q), dissipative_flow=lambda t, q, v, h: v / (1 + h / 8),
    jacobian=lambda t, q, v: (q * q / 2 - 1, -0.125),
    mean_acceleration=lambda t, q, v, s: swing(t, q, v) + q * s * s / 6,
    mean_jacobian=lambda t, q, v, s: ((3 * q * q + s * s + 2 * q * s) / 6 - 1, -0.125),
    taylor_coefficients=coefficients(swing),
)


def problem(name):
    return SWING if METHODS[name].needs <= SWING.offers() else replace(
        SWING, acceleration=lambda t, q, v: swing(t, q, 0 * v), velocity_free=True, dissipative_flow=None)


# Orders ---------------------------------------------------------------------------------------------------------------


# The first step of these methods is one of a starting method, or begins with another acceleration than later steps.
SETTLING = [name for name, m in METHODS.items() if isinstance(m, (BackwardDifference, GeneralizedAlpha))]


@cache
def between():
    """Return times inside steps, and the motion there in 20 digits."""
    t = START_AT[0]
    places = t + SPAN * (np.arange(41) + 0.37) / 41.3
    return places, np.array([[float(x) for x in reference(None, 20, float(place - t))] for place in places]).T


@pytest.mark.parametrize("name", SETTLING)
def test_between_steps_that_have_settled_errors_stay_of_the_methods_order(name):
    """At 41 times inside steps, over a time in which the velocity keeps its sign."""
    t, q, v = START_AT
    places, truth = between()
    errors = []
    for steps in (48, 96):
        way = solve(driven_pendulum(None, math), q, v, [t, t + SPAN], method=name, h=SPAN / steps, dense=True)
        errors.append(np.max(np.abs(np.array(way(places)) - truth)))
    method = METHODS[name]
    assert np.log2(errors[0] / errors[1]) > min(method.order, method.dense_order + 1) - 0.25


# In one step of these methods the error of the angle is one power of h larger than that of the velocity.
BETTER = {"fine4": 4, "stoermer4": 4}
# These steps are too long for ab6 to show its order under quadratic drag.
LINEAR_ONLY = ("ab6",)


@pytest.mark.parametrize(("name", "theta"), [
    *((name, 0.3) for name in METHODS if name not in SETTLING),
    *((name, 0.7) for name in [*TABLES, "velocity_verlet"])])
def test_declared_orders_are_observed(name, theta):
    """Without drag, and under one kind of drag that depends on the method's name; polynomials of tables twice."""
    method = METHODS[name]
    for damped in (None, "linear" if name in LINEAR_ONLY else ("linear", "quadratic")[turn_of(name, 2)]):
        if method.needs <= driven_pendulum(damped).offers():
            found = observed_dense_order(method, theta, damped=damped)
            assert found == pytest.approx(BETTER.get(name, method.dense_order), abs=0.1), damped


@pytest.mark.parametrize("name", TABLES)
def test_tables_meet_their_conditions_and_no_further_ones(name):
    order = METHODS[name].dense_order
    conditions = dense_conditions(name, order + 1)
    assert max(c.defect for c in conditions if c.order <= order) < Fraction(1, 10**35)
    assert max(c.defect for c in conditions if c.order > order) > 1e-4


# Orders of dense output: as published for rk4 and the pairs except verner7; the number of stages for collocation.
ORDERS = {
    "rk4": 3, "bs3": 3, "dopri5": 4, "tsit5": 4, "dop853": 7, "verner6": 6, "verner7": 6, "verner8": 8, "verner9": 9,
    "gauss4": 2, "gauss6": 3, "gauss8": 4, "radau3": 2, "radau5": 3, "lobatto3c": 3,
}


def test_orders_are_those_of_the_literature():
    assert {name: METHODS[name].dense_order for name in ORDERS} == ORDERS
    assert ORDERS.keys() <= TABLES.keys()
    for name, method in METHODS.items():
        if isinstance(method, Taylor):
            assert method.dense_order == method.order
        elif name not in TABLES:
            assert method.dense_order == {1: 1, 2: 2, 3: 3, 4: 3}.get(method.order, 4)


def test_one_wrong_digit_breaks_a_condition():
    method = METHODS["verner9"]
    dense = method.dense
    last = list(dense.a[-1])
    last[7] += Fraction(1, 10**20)
    last[8] -= Fraction(1, 10**20)
    bad = replace(method, dense=replace(dense, a=(*dense.a[:-1], tuple(last))))
    assert max(c.defect for c in dense_conditions(bad)) > 1e-24


def test_conditions_are_for_tables():
    for name in ("velocity_verlet", "heun"):
        with pytest.raises(MethodError, match=f"{name}: its dense output is Hermite interpolation"):
            dense_conditions(name)


@pytest.mark.parametrize("name", ["gauss4", "gauss6", "gauss8", "radau3", "radau5"])
def test_collocation_polynomials_pass_through_the_stages(name):
    """``b_j(c_i) = a_ij`` holds for collocation methods (Hairer, Norsett & Wanner 1993, II.7)."""
    method = METHODS[name]
    for c, row in zip(method.c, method.a, strict=True):
        for points, a in zip(method.dense.b, row, strict=True):
            n = len(points)
            value = sum(p * comb(n, j) * c**j * (1 - c) ** (n - j) for j, p in enumerate(points, 1))
            assert abs(value - a) < Fraction(1, 10**50)


def test_lobatto3c_is_no_collocation_but_a_quadrature():
    method = METHODS["lobatto3c"]
    assert [points[-1] for points in method.dense.b] == list(method.b)
    assert method.a[0][0] != 0


# Published numbers ----------------------------------------------------------------------------------------------------


def powers(points):
    """Convert Bernstein coefficients to coefficients of theta, theta**2, ..."""
    n, row = len(points), (Fraction(0), *points)
    return [sum((-1) ** (k - j) * comb(n, k) * comb(k, j) * row[j] for j in range(k + 1)) for k in range(1, n + 1)]


def test_the_two_forms_of_a_polynomial():
    found = bernstein(*exact(1, "-3/2", "2/3"))
    assert found == exact("1/3", "1/6", "1/6")
    assert powers(found) == list(exact(1, "-3/2", "2/3"))


@pytest.mark.parametrize(("name", "theirs"), [("bs3", scipy.integrate.RK23), ("dopri5", scipy.integrate.RK45)])
def test_polynomials_are_those_of_scipy(name, theirs):
    ours = [[float(x) for x in powers(points)] for points in METHODS[name].dense.b]
    assert np.array(ours) == pytest.approx(theirs.P, rel=1e-14)


def test_stages_of_dop853_are_those_of_scipy():
    ours = [[float(x) for x in row] for row in METHODS["dop853"].dense.a[1:]]
    for mine, theirs in zip(ours, DOP853_A[13:], strict=True):
        assert mine == pytest.approx(theirs[: len(mine)], rel=3e-15, abs=1e-17)


def test_a_step_of_dop853_is_that_of_scipy():
    """The dense output within one step agrees with SciPy's."""
    other = scipy.integrate.DOP853(lambda t, y: [y[1], -math.sin(y[0])], 0.0, [1.0, 0.5], 0.5, first_step=0.5, rtol=1.0)
    other.step()
    assert other.t == 0.5
    theirs = other.dense_output()
    ours = solve(lambda t, q, v: -math.sin(q), 1.0, 0.5, [0.0, 0.5], method="dop853", h=0.5, dense=True)
    times = np.linspace(0.0, 0.5, 11)
    assert np.array(ours(times)) == pytest.approx(theirs(times), abs=5e-15)


# Stage (counted from one) -> coefficients from theta**2 on: Tsitouras 2011, table 2, multiplied out; Verner's website,
# as in SciML's OrdinaryDiffEq.
PUBLISHED = {
    ("tsit5", 1): "-2.763706197274826 2.9132554618219126 -1.0530884977290216",
    ("tsit5", 5): "37.50931341651104 -88.1789048947664 47.37952196281928",
    ("tsit5", 7): "1.5 -4.0 2.5",
    ("verner6", 1): "-940811006205413129/120948724610397495 88342864458754360181/3265615564480732365"
    " -99667000922033025307/2177077042987154910 7995049273203130972/217707704298715491"
    " -7303903485456272500/653123112896146473",
    ("verner6", 7): "-143250206750000/12603936879 461347522996000000/7827044801859 -13312037070125000/113435431911"
    " 266854670860000000/2609014933953 -255803940625000000/7827044801859",
    ("verner6", 12): "-15453125/1139292 1393796875/15380442 -2092203125/10253628 488281250/2563407 -488281250/7690221",
    ("verner8", 1): "-10.039154650554519 53.79210495862331 -165.0579057235472 298.026456543461 -311.91254487079004"
    " 174.60598526911716 -40.37066163211959",
    ("verner8", 10): "-14179.231640455684 138385.00931963572 -559415.549024087 1.1774237946992505e6"
    " -1.3540333227908213e6 806353.893882505 -194566.3328138133",
    ("verner8", 20): "-59.738843630388715 544.8870146891725 -2090.4303749263127 4194.418982707227 -4603.369436819628"
    " 2619.2014135592976 -604.9687555793671",
    ("verner9", 1): "-28.330488700617398 257.6535452078578 -1152.1544557434572 2909.390878345409 -4355.005172868188"
    " 3834.083497036262 -1835.419052683407 368.7958613829998",
    ("verner9", 21): "0.05176008760353718 -1.8973378625803488 17.622648207936294 -71.94907400242467 151.9871383765666"
    " -173.36864987478606 101.4806461521468 -23.927131084462175",
    ("verner9", 22): "31.321782556688 -355.6570858339106 1752.6852824895159 -4708.092293138363 7370.900776193489"
    " -6716.504964764566 3303.940398161186 -678.5938956640391",
}


@pytest.mark.parametrize(("name", "stage"), PUBLISHED)
def test_polynomials_are_the_published_ones(name, stage):
    ours = powers(METHODS[name].dense.b[stage - 1])
    assert abs(ours[0] - (stage == 1)) < Fraction(1, 10**36)
    for mine, text in zip(ours[1:], PUBLISHED[name, stage].split(), strict=True):
        theirs = Fraction(text)
        allowed = Fraction(1, 10**30) if "/" in text else Fraction(5, 10**15)
        assert abs(mine / theirs - 1) < allowed


# Rows of Verner's further stages, counted from one, to double precision.
STAGES = {
    ("verner6", 11): "0.038150081818627744 0 0 0.2502358252513705 0.3249441447817608 1.8224606658327962"
    " -67.7137233269262 66.03587911808127 -0.0363881087495127 0.106441599909888",
    ("verner7", 12): "0.0523222769159969 0 0 0.22495861826705715 0.017443709248776376 -0.007669379876829393"
    " 0.03435896044073285 -0.0410209723009395 0.025651133005205617 0 -0.0160443457",
    ("verner7", 13): "0.053053341257859085 0 0 0.12195301011401886 0.017746840737602496 -0.0005928372667681495"
    " 0.008381833970853752 -0.01293369259698612 0.009412056815253861 0 -0.005353253107275676 -0.06666729992455811",
    ("verner8", 21): "0.039390583455282506 0 0 0 0 0.3558516141234424 0.419738222595261 0.8720449778071941"
    " 0.8989520834876595 -0.6305806161059884 -1.1218872205954835 0.04298219512400197 0 0.013325575668739157"
    " 0.018762270539641482 -0.18594111329221055 0.17736142719246029 0 0 0",
    ("verner9", 26): "0.01424600411735646609 0 0 0 0 0 0 -0.3767107393295407 0.2252399780730421 0.1283603076292529"
    " 0.2230238705261692 0.5463127827750747 0.0552619079137578 0.1285613508749982 0.02857250681296407 0"
    " -0.02398761886357109 0.05556224458910509 -0.01740675650762074 -0.03815462365996979 0.01111878504898918 0 0 0 0",
}


@pytest.mark.parametrize(("name", "stage"), STAGES)
def test_further_stages_are_the_published_ones(name, stage):
    method = METHODS[name]
    ours = method.dense.a[stage - 1 - len(method.b)]
    assert [float(x) for x in ours] == pytest.approx([float(x) for x in STAGES[name, stage].split()], rel=2e-14)


@pytest.mark.parametrize("name", METHODS)
def test_curves_have_the_slope_of_the_motion_at_both_ends(name):
    """Holds for Hermite interpolation and pairs; for rk4 only at the start, for collocation at its nodes."""
    found = solve(problem(name), *START, [0.0, 0.25], method=name, h=0.25, dense=True)
    first, last = found.dense.curves
    n = len(first.by_q)
    slopes = (n * first.by_q[0] / 0.25, n * (first.by_q[-1] - first.by_q[-2]) / 0.25) if n > 1 else (math.nan,) * 2
    start, end = slopes[0] == pytest.approx(0.5, abs=1e-13), slopes[1] == pytest.approx(last.v, abs=1e-13)
    nodes = {name: (False, m.c[-1] == 1) for name, m in TABLES.items() if m.implicit}
    # The curves of a series end in the states, but their slopes are those of the series cut off.
    assert (start, end) == {"rk4": (True, False), "taylor": (True, False), **nodes}.get(name, (True, True))


# Costs ----------------------------------------------------------------------------------------------------------------

# Evaluations in addition to those of a plain step, with fixed steps and with a tolerance.
COSTS = {
    "rk4": (0, None), "bs3": (1, 0), "dopri5": (1, 0), "tsit5": (1, 0), "dop853": (4, 3), "verner6": (4, 3),
    "verner7": (3, 2), "verner8": (8, 7), "verner9": (10, 9),
    **dict.fromkeys(("gauss4", "gauss6", "gauss8", "radau3", "lobatto3c"), (0, None)),
    "radau5": (0, 0), "sdirk4": (0, 0),
}



@pytest.mark.parametrize("name", METHODS)
def test_states_stay_the_same_and_costs_are_counted(name):
    """Hermite interpolation evaluates the force once at the start, then at the end of each step."""
    calls = []
    system = problem(name)
    counted = replace(system, acceleration=lambda t, q, v: calls.append(t) or system.acceleration(t, q, v))
    arguments = (*START, [0.0, 0.5, 1.25])
    plain = solve(system, *arguments, method=name, h=0.1)
    dense = solve(counted, *arguments, method=name, h=0.1, dense=True)
    assert dense.q.tolist() == plain.q.tolist()
    assert dense.v.tolist() == plain.v.tolist()
    assert (dense.steps, dense.rejected) == (plain.steps, 0)
    more = plain.steps + 1 if METHODS[name].dense is None else COSTS.get(name, (0,))[0] * plain.steps
    assert dense.evaluations == plain.evaluations + more
    asked = len(calls)
    dense(np.linspace(0.0, 1.25, 7))
    assert len(calls) == asked, "everything is known when the solution is there"


@pytest.mark.parametrize("name", PAIRS)
def test_tolerances_take_the_same_steps(name):
    for rtol in (1e-4, 1e-8):
        plain = solve(SWING, *START, [0.0, 3.0, 5.0], method=name, rtol=rtol, h=2.0)
        dense = solve(SWING, *START, [0.0, 3.0, 5.0], method=name, rtol=rtol, h=2.0, dense=True)
        assert dense.q.tolist() == plain.q.tolist()
        assert (dense.steps, dense.rejected) == (plain.steps, plain.rejected)
        assert dense.evaluations == plain.evaluations + COSTS[name][1] * plain.steps
        assert len(dense.dense.curves) == plain.steps + 1
    assert plain.rejected > 0


@pytest.mark.quick("1")
@pytest.mark.parametrize("parts", [1, 2, pytest.param(4, marks=pytest.mark.slow)])
def test_curves_through_several_states_of_a_step(parts: int) -> None:
    """Exact for polynomials of degree 3n + 2; the next one shows how its second derivative at one place bounds it."""
    degree, h, t = 3 * parts + 2, Fraction(3, 7), Fraction(2, 3)
    recorder, rule = Recorder(METHODS["dprkn12"], lambda t, q, v: q, Fraction(0)), hermite(parts)

    def value(powers: Sequence[Fraction], x: Fraction, order: int = 0) -> Fraction:
        """Return a derivative of a polynomial."""
        return sum((perm(k, order) * c * x ** (k - order) for k, c in enumerate(powers) if k >= order), Fraction(0))

    def through(powers: Sequence[Fraction]) -> Any:
        """Return the curve through the states of a polynomial of theta."""
        states = [tuple(value(powers, Fraction(j, parts), order) / h**order for order in range(3))
                  for j in range(parts + 1)]
        return recorder.joined(t, h, states, None)

    powers = [Fraction(k * k - 7, k + 1) for k in range(degree + 1)]
    curve = through(powers)
    for theta in (Fraction(1, 3), Fraction(8, 9), Fraction(1)):
        assert (*curve.at(theta), curve.slope(theta)) == tuple(value(powers, theta, k) / h**k for k in range(3))
    left_out = [Fraction(1)]
    for j in 3 * [*range(parts + 1)]:
        up, same = [Fraction(0), *left_out], [*left_out, Fraction(0)]
        left_out = [x - Fraction(j, parts) * y for x, y in zip(up, same, strict=True)]
    curve, places = through(left_out), [Fraction(k, 400) for k in range(401)]
    assert not any(curve.at(theta)[0] for theta in places)
    d = abs(value(left_out, rule.test, 2))
    for share, order in ((rule.of_q, 0), (rule.of_v, 1)):
        largest = max(abs(value(left_out, theta, order)) for theta in places)
        assert float(share * d) == pytest.approx(float(largest), rel=2e-3)


@pytest.mark.parametrize(("name", "most"), [("dprkn8", 2.5), ("dprkn12", 4.2)])
def test_dense_output_of_high_nystroem_pairs_costs_a_few_steps(name: str, most: float) -> None:
    for rtol in (1e-8, 1e-12):
        plain, dense = (solve(lambda t, q, v: -math.sin(q), *START, [0.0, 50.0], method=name, rtol=rtol, dense=dense)
                        .evaluations for dense in (False, True))
        assert 1.2 * plain < dense < most * plain


@pytest.mark.quick("0.0001-0.0")
@pytest.mark.parametrize(("rtol", "start"), [
    (1e-4, 0.0), (1e-12, 1e9), *(pytest.param(rtol, 0.0, marks=pytest.mark.slow) for rtol in (1e-8, 1e-14))])
def test_quintics_meet_the_tolerance_too(rtol, start):
    """Pairs without polynomials take steps in which one quintic errs by up to a million tolerances (dprkn12)."""
    for name in ("dprkn8", "dprkn12", *(("fine5", "dprkn6", "rkn43") if rtol > 1e-9 else ())):
        ends = [start, start + 20.0]
        plain = solve(lambda t, q, v: -q, 1.0, 0.0, ends, method=name, rtol=rtol)
        found = solve(lambda t, q, v: -q, 1.0, 0.0, ends, method=name, rtol=rtol, dense=True, events=lambda t, q, v: q)
        assert (found.q.tolist(), found.steps) == (plain.q.tolist(), plain.steps)
        times = np.linspace(0.0, 20.0, 2001) + start
        after, allowed = times - start, 30 * rtol + (2e-7 if start else 0.0)
        assert np.max(np.hypot(found(times)[0] - np.cos(after), found(times)[1] + np.sin(after))) < 30 * rtol, name
        assert found.t_events[0] - start == pytest.approx((np.arange(6) + 0.5) * math.pi, abs=allowed)
        last = integrators.Event(lambda t, q, v: q, terminal=6)
        ended = solve(lambda t, q, v: -q, 1.0, 0.0, ends, method=name, rtol=rtol, events=last)
        assert ended.t[-1] == found.t_events[0][-1]
        assert ended.steps <= plain.steps


@pytest.mark.parametrize("options", [{"h": 0.1}, {"rtol": 1e-8}])
@pytest.mark.parametrize("name", ["dop853", "verner7", "gauss4", "kahan_li8"])
def test_coupled_components(name, options):
    """Two equal oscillators with a spring of stiffness 3/2 between them: frequencies 1 and 2."""
    if "rtol" in options and name not in PAIRS:
        return
    stiffness = np.array([[2.5, -1.5], [-1.5, 2.5]])
    arguments = (lambda t, q, v: -stiffness @ q, np.array([1.0, 0.0]), np.zeros(2), [0.0, 1.0, 4.0])
    plain = solve(*arguments, method=name, **options)
    dense = solve(*arguments, method=name, dense=True, **options)
    assert dense.q.tolist() == plain.q.tolist()
    assert (dense.steps, dense.rejected) == (plain.steps, plain.rejected)
    costs = COSTS.get(name, (1, None))["rtol" in options]
    assert dense.evaluations == plain.evaluations + costs * plain.steps + (name not in TABLES)
    times = np.linspace(0.0, 4.0, 33)
    q, v = dense(times)
    assert q.shape == v.shape == (33, 2)
    slow, fast = np.cos(times), np.cos(2 * times)
    assert q == pytest.approx(np.stack([slow + fast, slow - fast], axis=1) / 2, abs=2e-4 if name == "gauss4" else 3e-7)
    slow, fast = -np.sin(times), -2 * np.sin(2 * times)
    assert v == pytest.approx(np.stack([slow + fast, slow - fast], axis=1) / 2, abs=2e-4 if name == "gauss4" else 3e-7)


def test_the_slopes_of_an_adaptive_step_are_not_asked_for_twice():
    own = replace(METHODS["heun"], name="heun_euler", embedded=(Embedded(1, exact(1, 0)),))
    plain, dense = (solve(SWING, *START, [0.0, 3.0], method=own, rtol=1e-4, dense=on) for on in (False, True))
    assert dense.evaluations == plain.evaluations
    assert abs(dense(1.3)[0] - solve(SWING, *START, [0.0, 1.3], method="dop853", rtol=1e-10).q[-1]) < 1e-3


@pytest.mark.parametrize("name", TABLES)
def test_plain_steps_have_no_stages_for_it(name):
    method = METHODS[name]
    assert unroll(method) == unroll(replace(method, dense=None))


def test_a_stage_that_serves_dense_output_alone():
    """Heun's method with Euler's inside it, and a third stage in the middle of the step."""
    own = RungeKutta(
        name="own", order=2, source="Heun 1900", summary="with a third stage", b=exact("1/2", "1/2", 0),
        a=(exact(0, 0, 0), exact(1, 0, 0), exact("1/4", "1/4", 0)), embedded=(Embedded(1, exact(1, 0, 0)),),
        dense=Extension(1, (exact("1/4", "1/2"), exact(0, "1/2"), exact("1/4", 0)), "made up"),
    )
    assert observed_dense_order(own, 0.3) == pytest.approx(1.0, abs=0.1)
    for options, each in (({"h": 0.25}, 2), ({"rtol": 1e-3}, 2)):
        plain, dense = (solve(SWING, *START, [0.0, 1.0], method=own, dense=on, **options) for on in (False, True))
        assert plain.rejected == 0
        assert dense.evaluations == plain.evaluations + plain.steps
        assert plain.evaluations == each * plain.steps + ("rtol" in options) * 2


# Truth and numbers ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "within"),
    [("rk4", 5e-7), ("velocity_verlet", 4e-4), ("dopri5", 2e-10), ("gauss6", 7e-9), ("kahan_li8", 3e-11),
     ("verner9", 3e-15)],
)
def test_the_cosine_all_along(name, within):
    found = solve(lambda t, q, v: -q, 1.0, 0.0, [0.0, 2.0], method=name, h=0.05, dense=True)
    times = np.linspace(0.0, 2.0, 401)
    q, v = found(times)
    assert max(abs(q - np.cos(times))) < within
    assert max(abs(v + np.sin(times))) < within


@pytest.mark.parametrize("name", PAIRS)
@pytest.mark.parametrize("end", [20.0, -20.0])
def test_a_tolerance_is_kept_all_along(name, end):
    found = solve(lambda t, q, v: -q, 1.0, 0.0, [0.0, end], method=name, rtol=1e-7, dense=True)
    times = np.linspace(0.0, end, 500)
    q, v = found(times)
    assert max(np.hypot(q - np.cos(times), v + np.sin(times))) < 2e-5


@pytest.mark.parametrize("times", [[0.2, 0.9, 1.3], [-0.2, -0.9, -1.3], [0.3]])
@pytest.mark.parametrize("name", METHODS)
def test_the_ends_of_steps_are_met_to_the_bit(name, times):
    """Times are used as given, because 0.2 + (0.9 - 0.2) is not 0.9."""
    found = solve(problem(name), *START, times, method=name, h=0.1, dense=True)
    assert found.t.tolist() == times
    q, v = found(times)
    assert q.tolist() == found.q.tolist()
    assert v.tolist() == found.v.tolist()
    assert [found(t) for t in times] == list(zip(q, v, strict=True))


@pytest.mark.parametrize("name", METHODS)
def test_batches_have_the_values_of_their_members(name):
    starts = [(0.5, 1.0), (-1.25, 0.3), (0.1, -0.7)]
    times = np.array([[0.25, 0.3, 1.0], [0.61, 0.97, 0.26]])
    alone = [solve(problem(name), q, v, [0.25, 0.5, 1.0], method=name, h=0.125, dense=True)(times) for q, v in starts]
    q, v = solve(problem(name), *np.array(starts).T, [0.25, 0.5, 1.0], method=name, h=0.125, dense=True)(times)
    allowed = 1e-13 if METHODS[name].implicit else 0.0
    for many, single in ((q, [one[0] for one in alone]), (v, [one[1] for one in alone])):
        assert many.shape == (2, 3, 3)
        assert np.max(np.abs(many - np.moveaxis(single, 0, -1))) <= allowed


@pytest.mark.parametrize("options", [{"h": 0.1}, {"rtol": 1e-6}])
def test_backwards_is_forwards_on_the_mirrored_problem(options):
    mirrored = System(lambda t, q, v: swing(-t, q, -v))
    times = np.linspace(0.0, 1.0, 23)
    for name in ("dop853", "heun", "dopri5") if "h" in options else ("dop853", "tsit5"):
        back = solve(SWING, 0.5, 1.0, [0.0, -1.0], method=name, dense=True, **options)(-times)
        forth = solve(mirrored, 0.5, -1.0, [0.0, 1.0], method=name, dense=True, **options)(times)
        assert back[0].tolist() == forth[0].tolist()
        assert back[1].tolist() == (-forth[1]).tolist()


@pytest.mark.parametrize("name", ["verner9", "dop853", "kahan_li8", "radau5"])
def test_mpmath_numbers_keep_their_digits(name):
    """A short step, whose error is below double precision."""
    with mpmath.workdps(40):
        t, q, v = (mpmath.mpf(x) for x in (0.25, 0.5, 1.0))
        h = mpmath.mpf(2) ** -6
        found = solve(driven_pendulum(), q, v, [t, t + h], method=name, h=h / 32, dense=True)
        one, many = found(t + h / 3), found([[t + h / 3, t + h]])
        truth = reference(None, 40, float(h / 4))
        error = abs(found(t + h / 4)[0] - truth[0])
    assert isinstance(one[0], mpmath.mpf)
    assert many[0].shape == (1, 2)
    assert (many[0][0, 0], many[1][0, 0]) == one
    assert many[0][0, 1] == found.q[-1]
    assert error < 1e-17


def test_a_single_time_and_an_empty_array():
    found = solve(SWING, 1.0, 2.0, [3.0], h=0.1, dense=True)
    assert found(3.0) == (1.0, 2.0)
    assert found(np.zeros(0))[0].shape == (0,)


def test_solutions_with_it_are_data():
    found = solve(swing, *START, [0.0, 1.0], method="dop853", rtol=1e-8, dense=True)
    assert pickle.loads(pickle.dumps(found))(0.3) == found(0.3)
    assert "curves" not in repr(found)


# Errors ---------------------------------------------------------------------------------------------------------------


def test_a_solution_without_it_says_so():
    with pytest.raises(MethodError, match="has no dense output; pass dense=True"):
        solve(swing, *START, [0.0, 1.0], h=0.1)(0.5)


@pytest.mark.parametrize("end", [1.0, -1.0])
@pytest.mark.parametrize("bad", [1.1, -1.1, np.array([0.0, 1.1]), [[0.0], [-1.1]]])
def test_times_outside(end, bad):
    found = solve(swing, *START, [0.0, end], h=0.1, dense=True)
    if np.any(np.abs(np.asarray(bad)) > 1) and np.max(np.asarray(bad) * end) <= 0:
        bad = np.asarray(bad) - end
    with pytest.raises(MethodError, match=r"t = .* is not between .* first and last time, 0\.0 and -?1\.0"):
        found(bad)


@pytest.mark.parametrize(
    "bad", [math.nan, math.inf, "0.5", None, [0.1, math.nan], ["a"], [[0.1], [0.1, 0.2]], 1j, [1j]]
)
def test_times_that_are_none(bad):
    found = solve(swing, *START, [0.0, 1.0], h=0.1, dense=True)
    with pytest.raises(MethodError, match="t must be a finite time or an array of such times, not"):
        found(bad)


@pytest.mark.parametrize("options", [{"h": 1.0}, {"rtol": 1e-3, "h": 1.0}])
@pytest.mark.parametrize("kind", ["nan", "fails"])
def test_a_force_that_fails_where_only_dense_output_asks(kind, options):
    """The force fails at a stage of dop853 at a tenth of the step."""

    def acceleration(t, q, v):
        if abs(t - 0.1) > 1e-9:
            return -q
        return math.sqrt(-1.0) if kind == "fails" else math.nan

    system = System(acceleration)
    assert solve(system, *START, [0.0, 1.0], method="dop853", **options).steps == 1
    says = r"dense output of dop853 .* step of h = 1\.0 from t = 0\.0: .*(finite|domain)"
    with pytest.raises(MethodError, match=says):
        solve(system, *START, [0.0, 1.0], method="dop853", dense=True, **options)


@pytest.mark.parametrize(
    ("dense", "says"),
    [
        (Extension(1, (exact(1),), ""), "a polynomial for each stage"),
        (Extension(1, (exact(0), exact(1)), "", (exact(1, 1),)), "a polynomial for each stage"),
        (Extension(1, (exact(0), exact(1), exact(0)), "", (exact(1),)), "rows over all stages before"),
        (Extension(1, (exact(0), exact(0, 1)), ""), "of one degree"),
        (Extension(1, (exact("1/2"), exact("1/2")), ""), "must end in b"),
    ],
)
def test_tables_of_the_wrong_shape(dense, says):
    with pytest.raises(MethodError, match=f"midpoint: .*{says}"):
        replace(METHODS["midpoint"], dense=dense)


def test_a_table_of_ones_own():
    """A user-defined extension: the straight line of forward Euler's slope."""
    own = replace(METHODS["forward_euler"], dense=Extension(1, (exact(1),), "Euler 1768"))
    found = solve(swing, *START, [0.0, 1.0], method=own, h=1.0, dense=True)
    assert found(0.25) == (1.0 + 0.25 * 0.5, 0.5 + 0.25 * swing(0.0, *START))
    assert observed_dense_order(own, 0.3) == pytest.approx(1.0, abs=0.1)
    assert max(c.defect for c in dense_conditions(own)) == 0
