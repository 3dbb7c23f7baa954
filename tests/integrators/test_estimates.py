"""Steps of embedded pairs with error estimates, against exact fractions and SciPy."""

from __future__ import annotations

import math
from fractions import Fraction
from functools import partial
from itertools import product

import mpmath
import numpy as np
import pytest

from integrators import METHODS, PAIRS, MethodError, Nystrom, unroll
from integrators.solving.adaptive import Tolerance
from integrators.steps.estimates import evaluations_tried, order_of_estimate

NAMES = [method.name for method in PAIRS]
EXPLICIT = [pytest.param(method, id=method.name) for method in PAIRS if not method.implicit]
IMPLICIT = [method.name for method in PAIRS if method.implicit]
START = (2.5, 0.3)


def swing(t, q, v):
    return -math.sin(q)


def problem(acceleration, **names):
    """Return the namespace of a step on a problem; methods for velocity-free forces get it without drag."""
    def jacobian(t, q, v):  # of swing() and of those with linear drag, by differences: Newton's method wants no more
        shift = 1e-6 * (q - q + 1)
        return tuple((acceleration(t, q + dq, v + dv) - acceleration(t, q - dq, v - dv)) / (2 * shift)
                     for dq, dv in ((shift, 0), (0, shift)))

    return {"acceleration": acceleration, "force": lambda t, q: acceleration(t, q, 0 * q), "jacobian": jacobian,
            "NAN": math.nan, **names}


def damped(gamma, t, q, v):
    return -math.sin(q) - gamma * v, 0.1 * v * v


def estimating_step(method, *, exact=False, **names):
    """Return ``step`` with estimates on a problem, with coefficients as fractions if requested."""
    namespace = problem(**names, Fraction=Fraction)
    number = {"number": lambda value: f"Fraction({value.numerator}, {value.denominator})"} if exact else {}
    exec(unroll(method, estimates=True, **number), namespace)
    return namespace["step"]


@pytest.mark.parametrize("method", EXPLICIT)
def test_errors_are_differences_to_the_embedded_results(method):
    """Exact in fractions, against the stages with the embedded weights; the result is that of the plain step."""

    free = "velocity_free" in method.needs

    def acceleration(t, q, v):
        return (q * q / 3 - q + t / 4 - (0 if free else v / 5)).limit_denominator(10**40)

    t, q, v, h = Fraction(1, 3), Fraction(1, 2), Fraction(-2, 7), Fraction(1, 4)

    def total(weights, values):
        return sum((x * y for x, y in zip(weights, values, strict=False)), Fraction(0))

    k, w = [], []
    for i, row in enumerate(method.a):
        w.append(v + h * total(method.av[i] if isinstance(method, Nystrom) else row, k))
        place = q + h * (method.c[i] * v + h * total(row, k) if isinstance(method, Nystrom) else total(row, w))
        k.append(acceleration(t + method.c[i] * h, place, w[-1]))
        w[-1] = w[-1].limit_denominator(10**40)

    def ends(weights):
        if isinstance(method, Nystrom):
            return [q + h * v + h * h * total(weights.bbar, k), v + h * total(weights.b, k)]
        return [q + h * total(weights.b, w), v + h * total(weights.b, k)]

    step = estimating_step(method, exact=True, acceleration=acceleration)
    q1, v1, a1, *errors = step(t, q, v, acceleration(t, q, v), h)
    found, truth = [q1, v1], ends(method)
    assert len(errors) == 2 * len(method.embedded)
    for i, pair in enumerate(method.embedded):
        found += errors[2 * i : 2 * i + 2]
        truth += [best - other for best, other in zip(ends(method), ends(pair), strict=True)]
    assert max(abs(x - y) for x, y in zip(found, truth, strict=True)) < Fraction(1, 10**34)
    assert abs(a1 - acceleration(t + h, q1, v1)) < Fraction(1, 10**34)


@pytest.mark.parametrize("name", IMPLICIT)
def test_errors_of_implicit_pairs_are_those_of_hairer_and_wanner(name):
    """Stages by mpmath's findroot; radau5's estimate by the inverse of its table (eqs. IV.8.18 and IV.8.19)."""
    method = METHODS[name]
    with mpmath.workdps(30):
        t, q, v, h = (mpmath.mpf(x) for x in ("0.3", "0.9", "-0.4", "0.7"))

        def acceleration(t, q, v):
            return mpmath.cos(t) - 40 * mpmath.sin(q) - 7 * v - v * v * v / 9

        size = len(method.b)
        table = mpmath.matrix([[mpmath.mpf(x.numerator) / x.denominator for x in row] for row in method.a])

        def motion(*k):
            w = [v + h * sum(table[i, j] * k[j] for j in range(size)) for i in range(size)]
            return [q + h * sum(table[i, j] * w[j] for j in range(size)) for i in range(size)], w

        def residuals(*k):
            places = zip(*motion(*k), strict=True)
            return [k[i] - acceleration(t + h * sum(table[i, :]), *place) for i, place in enumerate(places)]

        k = [*mpmath.findroot(residuals, [mpmath.mpf(0)] * size)]
        places, speeds = motion(*k)
        if name == "sdirk4":  # weights of both results, as printed in table IV.6.5
            low = [mpmath.mpf(x) / y for x, y in ((59, 48), (-17, 96), (225, 32), (-85, 12), (0, 1))]
            truth = [h * sum((table[size - 1, i] - low[i]) * x[i] for i in range(size)) for x in (speeds, k)]
        else:
            eigenvalues = mpmath.eig(table**-1, right=False)
            gamma = 1 / mpmath.re(min(eigenvalues, key=lambda x: abs(mpmath.im(x))))
            root = mpmath.sqrt(6)
            e = [gamma / 3 * x for x in (-13 - 7 * root, -13 + 7 * root, -1)]
            raw = [-gamma * h * slope - sum(x * (y - old) for x, y in zip(e, ends, strict=True))
                   for slope, old, ends in ((v, q, places), (acceleration(t, q, v), v, speeds))]
            by_q, by_v = -40 * mpmath.cos(q), -7 - v * v / 3
            matrix = mpmath.matrix([[1, -h * gamma], [-h * gamma * by_q, 1 - h * gamma * by_v]])
            truth = [*mpmath.lu_solve(matrix, mpmath.matrix(raw))]
        step = estimating_step(method, acceleration=acceleration)
        q1, v1, a1, *errors = step(t, q, v, acceleration(t, q, v), h)
    assert float(abs(q1 - places[-1]) + abs(v1 - speeds[-1])) < 1e-14
    assert float(abs(a1 - acceleration(t + h, q1, v1))) < 1e-13
    assert [float(x) for x in errors] == pytest.approx([float(x) for x in truth], rel=1e-8)


def test_the_estimate_of_radau5_is_that_of_scipys_code():
    radau = pytest.importorskip("scipy.integrate._ivp.radau")
    (pair,) = METHODS["radau5"].embedded
    weights = np.array(METHODS["radau5"].a, dtype=float).T @ (radau.E / radau.MU_REAL)
    assert float(pair.start) == pytest.approx(1 / radau.MU_REAL, rel=1e-15)
    ours = [float(theirs - own) for theirs, own in zip(pair.b, METHODS["radau5"].b, strict=True)]
    assert ours == pytest.approx(weights.tolist(), rel=1e-13)


def test_estimates_stay_bounded_in_stiff_problems():
    """On v' = -x (v - 1) with x h from 1e3 to 1e12 the estimated error is at most some differences of v to 1."""
    for name, x in product(IMPLICIT, (1e4, 1e8, 1e13)):
        step = estimating_step(METHODS[name], acceleration=lambda t, q, v, x=x: -x * (v - 1.0),
                               jacobian=lambda t, q, v, x=x: (0.0, -x))
        _, v1, _, error_q, error_v = step(0.0, 0.0, 1.5, -0.5 * x, 0.1)
        assert abs(v1 - 1.0) < 0.01
        assert 0.1 < abs(error_v) < 4.0
        assert abs(error_q) < 0.4


@pytest.mark.parametrize("method", PAIRS, ids=NAMES)
def test_the_step_is_the_plain_one_to_the_bit(method):
    """That of implicit methods to rounding, as the solutions of their stages begin at other places."""
    step = estimating_step(method, acceleration=swing)
    plain: dict = problem(swing)
    exec(unroll(method), plain)
    a0 = swing(0.0, *START)
    q1, v1, a1, *_ = step(0.0, *START, a0, 0.3)
    ends = plain["step"](0.0, *START, *[a0] * len(method.memory), 0.3)[:2]
    assert (q1, v1) == (pytest.approx(ends, rel=1e-14) if method.implicit else ends)
    assert a1 == swing(0.3, q1, v1)


@pytest.mark.parametrize("method", EXPLICIT)
def test_a_tried_step_asks_as_often_as_it_says(method):
    calls = []
    estimating_step(method, acceleration=lambda t, q, v: calls.append(t) or -q)(0.0, 1.0, 0.0, -1.0, 0.1)
    assert len(calls) == evaluations_tried(method)
    assert evaluations_tried(method) - method.evaluations == (method.name in ("verner7", "verner8", "verner9"))


def test_quadratures_ride_along_with_the_step_and_are_the_plain_ones():
    for method in PAIRS:
        gamma = 0.0 if "velocity_free" in method.needs else 0.1
        rates = partial(damped, gamma)
        plain, paired = problem(lambda *at: rates(*at)[0], rates=rates), problem(lambda *at: rates(*at)[0], rates=rates)  # noqa: B023
        exec(unroll(method, quadratures=("heat",)), plain)
        exec(unroll(method, quadratures=("heat",), estimates=True), paired)
        start = rates(0.0, *START)
        q1, v1, a1, rate, heat, *errors = paired["step"](0.0, *START, *start, 0.3)
        ends = plain["step"](0.0, *START, *[start[0]] * len(method.memory), 0.3)
        same = (*ends[:2], ends[-1])
        assert (q1, v1, heat) == (pytest.approx(same, rel=1e-14) if method.implicit else same)
        assert (a1, rate) == rates(0.3, q1, v1)
        assert len(errors) == 2 * len(method.embedded)


@pytest.mark.parametrize("name", ["tsit5", "dop853", "fine5"])
def test_compiled_steps_have_the_same_bits(name):
    numba = pytest.importorskip("numba")

    def acceleration(t, q, v):
        return q * q * q / 6.0 - q + t / 4.0 - 0.375 * abs(v) * v

    interpreted = estimating_step(METHODS[name], acceleration=acceleration)
    compiled = numba.njit(estimating_step(METHODS[name], acceleration=numba.njit(acceleration)))
    arguments = (0.25, 1.1, 0.5, acceleration(0.25, 1.1, 0.5), 0.2)
    assert compiled(*arguments) == interpreted(*arguments)


@pytest.mark.parametrize("method", PAIRS, ids=NAMES)
def test_the_estimate_goes_with_the_power_of_the_step_that_the_controller_reckons_with(method):
    tolerance = Tolerance(mpmath.mpf(1), mpmath.mpf(1))
    with mpmath.workdps(60):
        one = mpmath.mpf(1)
        names = problem(lambda t, q, v: mpmath.cos(2 * t) - mpmath.sin(q))
        namespace = {"mpf": mpmath.mpf, **names}
        exec(unroll(method, estimates=True, number=lambda x: f"(mpf({x.numerator})/{x.denominator})"), namespace)

        def size(h):
            a = names["acceleration"](0, one / 2, one)
            q1, v1, _, *errors = namespace["step"](0 * one, one / 2, one, a, h)
            squares = [tolerance.square(errors[i : i + 2], (one / 2, one), (q1, v1)) for i in range(0, len(errors), 2)]
            return squares[0] ** 0.5 if len(squares) == 1 else squares[0] / (squares[0] + squares[1] / 100) ** 0.5

        slope = mpmath.log(size(one / 2**9) / size(one / 2**10), 2)
    assert float(slope) == pytest.approx(order_of_estimate(method), abs=0.1)
    lower = {"dprkn6": 5, "dprkn8": 7, "dprkn12": 11, "radau5": 4}
    assert order_of_estimate(method) == lower.get(method.name, method.order)


def test_two_estimates_are_combined_as_in_scipys_code():
    """The error follows from the next step of SciPy's DOP853, ``0.9 h error**(-1/8)``."""
    integrate = pytest.importorskip("scipy.integrate")
    h, rtol, atol = 0.5, 1e-7, 1e-8
    peer = integrate.DOP853(lambda t, y: [y[1], -math.sin(y[0])], 0.0, START, 10.0, rtol=rtol, atol=atol, first_step=h)
    peer.step()
    assert peer.t == h
    q1, v1, _, *errors = estimating_step(METHODS["dop853"], acceleration=swing)(0.0, *START, swing(0.0, *START), h)
    found = Tolerance(rtol, atol).size(errors, START, (q1, v1))
    assert found == pytest.approx((0.9 * h / peer.h_abs) ** 8, rel=1e-8)


@pytest.mark.parametrize("name", ["rk4", "velocity_verlet", "implicit_midpoint"])
def test_methods_without_embedded_weights_have_none(name):
    with pytest.raises(MethodError, match=f"{name} has no embedded weights"):
        unroll(METHODS[name], estimates=True)
