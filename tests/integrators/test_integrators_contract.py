"""One contract for every method of the registry and for user-defined methods."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from itertools import combinations

import mpmath
import mutants
import numpy as np
import pytest
from choice import EVERYWHERE, turn_of
from coefficients import COEFFICIENTS, checked, digest
from leading_error_truths import LEADING_ERRORS
from multistep_truths import principal_root
from nystrom_truths import NYSTROM
from readme_code import method_of_readme
from runge_kutta_truths import STABILITY, rounding
from splitting_truths import TRUTHS
from stored import stored

import integrators
from integrators import (
    METHODS,
    Embedded,
    ForceGradient,
    Method,
    MethodError,
    Multistep,
    Nystrom,
    RungeKutta,
    Splitting,
    System,
)
from integrators.analysis import (
    LeadingError,
    Term,
    amplification,
    area_order,
    damping_limit,
    dense_conditions,
    driven_pendulum,
    jacobian_determinant,
    leading_error,
    nystrom_conditions,
    observed_order,
    order_conditions,
    order_residuals,
    single_step,
    spectral_radius,
    stability_limit,
)
from integrators.families.adams import Adams
from integrators.families.splitting import DRAG, DRIFT, KICK
from integrators.families.taylor import coefficients
from integrators.method import NEEDS, exact

HALF = Fraction(1, 2)
TWO_STAGE = RungeKutta(
    name="two_stage",
    order=2,
    source="Butcher 2016, eq. 232a",
    summary="two stages, the second at 3/4",
    a=(exact(0, 0), exact("3/4", 0)),
    b=exact("1/3", "2/3"),
)
POSITION_VERLET = Splitting(
    name="position_verlet",
    order=2,
    source="Tuckerman, Berne & Martyna 1992, J. Chem. Phys. 97, 1990",
    summary="drift, kick, drift, the drag halved about the kick",
    flows=((DRIFT, HALF), (KICK, HALF), (DRAG, Fraction(1)), (KICK, HALF), (DRIFT, HALF)),
)
MADE_UP = {m.name: m for m in (TWO_STAGE, POSITION_VERLET, method_of_readme())}
EVERY = {**METHODS, **MADE_UP}


def rational_system(calls: list[str] | None = None, damped: bool = True) -> System:
    """Return a driven, damped, nonlinear problem in basic arithmetic, so bits do not depend on any library."""
    calls = [] if calls is None else calls
    drag = 0.375 if damped else 0.0

    def force(t, q):
        calls.append("force")
        return q * q * q / 6 - q + t / 4

    def acceleration(t, q, v):
        calls.append("acceleration")
        return q * q * q / 6 - q + t / 4 - drag * abs(v) * v

    def jacobian(t, q, v):
        calls.append("jacobian")
        return q * q / 2 - 1, -2 * drag * abs(v)

    def mean_acceleration(t, q, v, s):
        calls.append("acceleration")
        return (q * q * q + q * s * s) / 6 - q + t / 4 - drag * abs(v) * v

    def mean_jacobian(t, q, v, s):
        calls.append("jacobian")
        return (3 * q * q + s * s + 2 * q * s) / 6 - 1, -2 * drag * abs(v)

    series = coefficients(acceleration)

    def taylor_coefficients(*arguments):
        before = len(calls)
        found = series(*arguments)
        calls[before:] = ["series"]
        return found

    return System(
        acceleration,
        force=force,
        velocity_free=not damped,
        dissipative_flow=(lambda t, q, v, h: v / (1 + 0.375 * abs(v) * h)) if damped else None,
        jacobian=jacobian,
        mean_acceleration=mean_acceleration,
        mean_jacobian=mean_jacobian,
        taylor_coefficients=taylor_coefficients,
    )


def oscillator() -> System:
    """Return ``q'' = -q`` with all functions that a method may need, in mpmath numbers."""
    return System(
        lambda t, q, v: -q, force=lambda t, q: -q, velocity_free=True, jacobian=lambda t, q, v: (-1, 0),
        mean_acceleration=lambda t, q, v, s: -q, mean_jacobian=lambda t, q, v, s: (-1, 0),
        exact_flow=lambda t, q, v, h: (
            q * mpmath.cos(h) + v * mpmath.sin(h), v * mpmath.cos(h) - q * mpmath.sin(h)),
        taylor_coefficients=coefficients(lambda t, q, v: -q),
    )


def falling(calls: list[str]) -> System:
    """Return ``q'' = 1/4`` with its exact solution."""

    def flow(t, q, v, h):
        calls.append("exact_flow")
        return q + h * (v + h / 8), v + h / 4

    return System(lambda t, q, v: (q - q) + 0.25, exact_flow=flow)


def fits(method: Method, system: System) -> bool:
    return method.needs <= system.offers()


def rational_problem(method: Method, calls: list[str] | None = None) -> System:
    """Return the damped problem if the method can treat drag, or a free fall for a method that needs the solution."""
    if "exact_flow" in method.needs:
        return falling([] if calls is None else calls)
    return rational_system(calls, damped=fits(method, rational_system()))


def damping_of(name: str) -> str:
    """Return the drag under which a method's order is measured, if one kind is enough."""
    return ("linear", "quadratic")[turn_of(name, 2)]


def check_order(method: Method) -> None:
    """Check the order undamped and damped; for splittings, with order conditions for drag, in one way each."""
    few = method.name in EVERYWHERE or method.name not in METHODS
    for damped in (None, *(("linear", "quadratic") if few else (damping_of(method.name),))):
        if fits(method, driven_pendulum(damped)):
            assert observed_order(method, damped=damped) == pytest.approx(method.order, abs=0.1), damped


WITHOUT_CONDITIONS = ("energy-preserving", "exact", "Taylor")
"""Families without a table with order conditions; their orders are measured."""


def check_order_conditions(method: Method) -> None:
    """Check the order conditions up to the declared order and no further, for the result and embedded results."""
    if method.name == "symplectic_euler" or method.family in WITHOUT_CONDITIONS:
        with pytest.raises(MethodError, match=f"{method.name} (states no coefficients|is not a composition of kicks)"):
            order_residuals(method)
        return
    *zero, left = order_residuals(method)
    assert len(zero) == method.order
    assert max(zero) < 1e-35 if isinstance(method, (RungeKutta, Nystrom, Splitting, ForceGradient)) else not any(zero)
    assert left > 1e-9
    pairs = method.embedded if isinstance(method, (RungeKutta, Nystrom)) else ()
    for i, pair in enumerate(pairs, 1):
        conditions = (order_conditions(method.formulas[i], pair.order + 1) if isinstance(method, RungeKutta) else
                      nystrom_conditions(method, pair.order + 1, embedded=pair))
        assert max(abs(c.defect) for c in conditions if c.order <= pair.order) < Fraction(1, 10**35)
        assert max(abs(c.defect) for c in conditions if c.order > pair.order) > 1e-8


def check_dense_conditions(method: Method) -> None:
    """Check the order conditions of a Runge-Kutta method's dense output at all times of the step."""
    if method.dense is not None and method.tableau is not None:
        conditions = dense_conditions(method)
        assert {c.order for c in conditions} >= {*range(1, method.dense.order + 1)}
        assert max(abs(c.defect) for c in conditions if c.order <= method.dense.order) < Fraction(1, 10**30)


def check_areas(method: Method) -> None:
    if not fits(method, driven_pendulum()):
        return check_known_areas(method)
    states = [("1.1", "0.5", "0.3", "0.2"), ("-2.5", "1.5", "2", "-0.11"), ("3.1", "-4", "0", "0.3")]
    change = max(abs(jacobian_determinant(method, *state) - 1) for state in states)
    assert (change < 1e-30) == method.symplectic
    assert change < 1e-30 or change > 1e-20
    assert (area_order(method) == math.inf) == method.symplectic
    assert area_order(method) > method.order + 0.9


def check_known_areas(method: Method) -> None:
    """Check changes of phase-space area on the oscillator, whose solution the method knows."""
    with mpmath.workdps(40):
        step = single_step(method, oscillator(), mpmath.mpf(0))
        (a, c), (b, d) = (step(0, q, 1 - q, mpmath.mpf("0.3")) for q in (1, 0))
        assert (abs(a * d - b * c - 1) < 1e-38) == method.symplectic


def check_contraction(method: Method) -> None:
    """Check that exact drag flows shrink areas by exactly exp(-gamma h)."""
    if "split" in method.needs:
        ratio = jacobian_determinant(method, "1.1", "0.5", "0.3", "0.2", damped="linear")
        with mpmath.workdps(40):
            assert abs(ratio - mpmath.exp(mpmath.mpf("-0.05"))) < 1e-38


def check_symmetry(method: Method) -> None:
    """Check that step(-h) undoes step(h); for multistep methods see also test_multistep.py."""
    if isinstance(method, Multistep) and method.past:
        return
    with mpmath.workdps(40):
        start = t, q, v, h = [mpmath.mpf(x) for x in ("0.3", "1.1", "0.5", "0.2")]
        problems = [each for each in map(driven_pendulum, (None, "linear")) if fits(method, each)]
        for problem in problems or [oscillator()]:
            step = single_step(method, problem, q)
            q1, v1 = step(t, q, v, h)
            q0, v0 = step(t + h, q1, v1, -h)
            back = max(abs(q0 - start[1]), abs(v0 - start[2]))
            assert (back < 1e-37) == method.symmetric
            assert back < 1e-37 or back > 1e-20


def check_evaluations(method: Method) -> None:
    """Check the number of evaluations: as declared, if implicit per Newton iteration and once more per stage.

    Evaluations that start a memory are added.
    """
    calls: list[str] = []
    steps = 10
    integrators.solve(rational_problem(method, calls), 0.5, 1.0, [0.0, 1.0], method=method, h=1.0 / steps)
    sweeps = calls.count("jacobian") if method.implicit else 0
    asked = len(calls) - sweeps
    assert asked == steps * method.evaluations + sweeps + method.beginning
    assert (sweeps > 0) == method.implicit
    assert sweeps <= 7 * (steps * method.evaluations + method.beginning)


def check_stability(method: Method) -> None:
    """Check A-stability (no growth in the left half-plane) and L-stability (fast parts vanish in one step)."""
    sizes = [0.0, *np.logspace(-2, 3, 21)]
    drags = sizes if fits(method, driven_pendulum("linear")) else [0.0]
    grows = any(spectral_radius(method, z, g) > 1.0 + 1e-10 for z in reversed(sizes) for g in drags)
    assert grows != method.a_stable
    if method.a_stable:
        far = 1e18 if isinstance(method, Multistep) else 1e9  # roots fall with a root of it
        left = max(spectral_radius(method, far), abs(float(amplification(method, 0.0, far)[1, 1])))
    assert (method.a_stable and left < 1e-6) == method.l_stable
    if isinstance(method, RungeKutta):
        assert (stability_limit(method) == damping_limit(method) == math.inf) == method.a_stable


def check_limits(method: Method) -> None:
    """Check that steps stay bounded up to the stability limits and grow beyond them."""
    cases = [(stability_limit(method), lambda z: spectral_radius(method, z))]
    if fits(method, driven_pendulum("linear")):
        cases.append((damping_limit(method), lambda g: spectral_radius(method, 0.0, g)))
    far = 30.0 if "reversible" in method.needs else 1e3  # backward sub-steps leave the range of floats
    for limit, radius in cases:
        for share in (0.01, 0.3, 0.6, 0.9, 0.999):
            assert radius(share * min(limit, far)) < 1.0 + 1e-10
        if limit == 0.0:
            assert leading_error(method).amplitude.coefficient > 0
        elif limit < math.inf:
            assert max(radius(limit * (1.0 + 10.0**-k)) for k in range(2, 9)) > 1.0 + 1e-8, "some gaps are narrow"


def check_leading_error(method: Method) -> None:
    """Compare the exact leading error with steps taken in 80 digits, extrapolated to h = 0."""
    error = leading_error(method)
    terms = (error.angle, error.velocity, error.amplitude, error.frequency)
    with mpmath.workdps(80):
        halvings = (9, 10, 11) if method.order < 12 or isinstance(method, Multistep) else (3, 4, 5)
        measured = [measured_errors(method, error, mpmath.mpf(2) ** -k) for k in halvings]
        for term, one, half, quarter in zip(terms, *measured, strict=True):
            if term is None:
                assert abs(one) < 1e-70
            else:
                expected = mpmath.mpf(term.coefficient.numerator) / term.coefficient.denominator
                assert abs((one - 6 * half + 8 * quarter) / 3 / expected - 1) < 1e-4
    powers = [term.power for term in terms[:2] if term is not None]
    assert powers == [] if method.order == math.inf else min(powers) > method.order


def measured_errors(method: Method, error: LeadingError, h: mpmath.mpf) -> list[mpmath.mpf]:
    """Return errors of one step in angle, velocity, growth and frequency, in units of the leading terms."""
    zero, phi = mpmath.mpf(0), mpmath.pi / 5
    step = single_step(method, oscillator(), zero)
    (a, c), (b, d) = step(zero, zero + 1, zero, h), step(zero, zero, zero + 1, h)
    q, v = step(zero, mpmath.cos(phi), mpmath.sin(phi), h)
    det, trace = a * d - b * c, a + d
    if isinstance(method, Multistep):
        root = principal_root(method, oscillator(), h)
        det, trace = abs(root) ** 2, 2 * root.real
    measured = (
        (error.angle, q - mpmath.cos(h - phi), lambda k: mpmath.cos(k * mpmath.pi / 2 - phi)),
        (error.velocity, v + mpmath.sin(h - phi), lambda k: -mpmath.sin(k * mpmath.pi / 2 - phi)),
        (error.amplitude, mpmath.log(det) / 2 / h, lambda k: 1),
        (error.frequency, mpmath.atan2(mpmath.sqrt(4 * det - trace**2), trace) / h - 1, lambda k: 1),
    )
    return [x if term is None else x / h**term.power / derivative(term.power) for term, x, derivative in measured]


def check_numbers(method: Method) -> None:
    """Check floats, arrays and mpmath numbers; a batch of an explicit method has the bits of its members."""
    times = [0.25, 0.5, 1.25]
    starts = [(0.5, 1.0), (-1.25, 0.3), (0.1, -0.7)]
    system = rational_problem(method)
    alone = [integrators.solve(system, q, v, times, method=method, h=0.1) for q, v in starts]
    batch = integrators.solve(system, *np.array(starts).T, times, method=method, h=0.1)
    for many, single in ((batch.q, [s.q for s in alone]), (batch.v, [s.v for s in alone])):
        assert many.shape == (3, 3)
        assert many.dtype == np.float64
        assert np.max(np.abs(many - np.array(single).T)) <= (1e-14 if method.implicit else 0.0)
    with mpmath.workdps(40):
        q, v, *marks = (mpmath.mpf(x) for x in (*starts[0], *times))
        precise = integrators.solve(system, q, v, marks, method=method, h=mpmath.mpf("0.1"))
        allowed = 2e-15 + 10 * rounding(method, 0.1) + 2e-17 * len(getattr(method, "flows", ()))
        assert max(abs(precise.q - alone[0].q)) < allowed
        assert max(abs(precise.v - alone[0].v)) < allowed
        assert isinstance(precise.q[-1], mpmath.mpf)


def check_direction(method: Method) -> None:
    """Check that backward steps equal forward steps on the time-mirrored problem, bit for bit."""
    system = rational_problem(method)
    flow, solution = system.dissipative_flow, system.exact_flow
    mirrored = System(
        lambda t, q, v: system.acceleration(-t, q, -v),
        force=lambda t, q: system.force(-t, q),
        velocity_free=system.velocity_free,
        dissipative_flow=flow and (lambda t, q, v, h: -flow(-t, q, -v, -h)),
        jacobian=lambda t, q, v: (system.jacobian(-t, q, -v)[0], -system.jacobian(-t, q, -v)[1]),
        mean_acceleration=lambda t, q, v, s: system.mean_acceleration(-t, q, -v, s),
        mean_jacobian=lambda t, q, v, s: (
            system.mean_jacobian(-t, q, -v, s)[0], -system.mean_jacobian(-t, q, -v, s)[1]),
        taylor_coefficients=coefficients(lambda t, q, v: system.acceleration(-t, q, -v)),
        exact_flow=solution and (lambda t, q, v, h: tuple(np.array(solution(-t, q, -v, -h)) * (1, -1))),
    )
    back = integrators.solve(system, 0.5, 1.0, [0.0, -0.5, -1.0], method=method, h=0.1)
    forth = integrators.solve(mirrored, 0.5, -1.0, [0.0, 0.5, 1.0], method=method, h=0.1)
    assert back.t.tolist() == [0.0, -0.5, -1.0]
    assert back.q.tolist() == forth.q.tolist()
    assert back.v.tolist() == (-forth.v).tolist()


def check_description(method: Method) -> None:
    assert re.fullmatch("[a-z][a-z0-9_]*", method.name)
    assert all(re.fullmatch("[a-z][a-z0-9_]*", alias) for alias in method.aliases)
    assert re.search(r"[A-Z][a-z]+.* (1[6-9]|20)\d\d", method.source), "author and year"
    assert 10 < len(method.summary) < 100
    assert method.needs <= NEEDS.keys()
    families = (
        "Runge-Kutta", "splitting", "energy-preserving", "Nyström", "exact", "Taylor", "force gradient", "multistep",
        "structural dynamics",
    )
    assert method.family in families


CONTRACT: tuple[Callable[[Method], None], ...] = (
    check_order,
    check_order_conditions,
    check_dense_conditions,
    check_areas,
    check_contraction,
    check_symmetry,
    check_evaluations,
    check_stability,
    check_limits,
    check_leading_error,
    check_numbers,
    check_direction,
    check_description,
)


def is_long(check: Callable[[Method], None], method: Method) -> bool:
    """Whether steps in many digits take a second: of high order, or with equations to be solved."""
    return (check is check_order and (method.order >= 8 or (method.implicit and method.order > 1))) or (
        check is check_limits and method.order > 8)


@pytest.mark.parametrize(("name", "check"), [
    pytest.param(name, check, id=f"{name}-{check.__name__}",
                 marks=pytest.mark.slow if is_long(check, EVERY[name]) else ())
    for name in EVERY for check in CONTRACT])
def test_contract(name, check):
    check(EVERY[name])


FALSE = [
    (check_order, replace(METHODS["midpoint"], order=3)),
    (check_order, replace(TWO_STAGE, a=(exact(0, 0), exact("1/2", 0)))),
    (check_stability, replace(METHODS["rk4"], a_stable=True)),
    (check_stability, replace(METHODS["backward_euler"], l_stable=False)),
    (check_stability, replace(METHODS["trapezoid"], l_stable=True)),
    (check_order, replace(METHODS["ab3"], order=2)),
    (check_order_conditions, replace(METHODS["numerov"], order=5)),
    (check_stability, replace(METHODS["bdf3"], a_stable=True)),
    (check_description, replace(TWO_STAGE, source="folklore")),
]


def test_every_table_holds_to_its_last_digit() -> None:
    """Exact order conditions of all tables whose digits are not those that held before; slow tests take all."""
    held = checked()
    changed = [method for method in METHODS.values() if held.get(method.name) != digest(method)]
    for method in changed:
        check_order_conditions(method)
        check_dense_conditions(method)
    names = [method.name for method in changed if method.name in held]
    assert not names, f"the coefficients of {names} are others; delete them in {COEFFICIENTS.name} if that is meant"
    assert held.keys() <= METHODS.keys()


@pytest.mark.parametrize("name", ["rk4", "dopri5", "verner7", "dprkn8", "ruth3", "stoermer6"])
def test_a_digit_of_a_table_is_seen(name: str) -> None:
    """One part in 1e8 of the largest coefficient changes the digest, and breaks the conditions."""
    method = mutants.changed(METHODS[name], lambda x: x * (1 + Fraction(1, 10**8)))
    assert digest(METHODS[name]) == checked()[name] != digest(method)
    with pytest.raises(ValueError if name == "stoermer6" else AssertionError):  # its mutant is not even consistent
        check_order_conditions(method)


@pytest.mark.parametrize(("check", "method"), FALSE, ids=lambda value: getattr(value, "__name__", ""))
def test_contract_refuses_what_is_not_so(check, method):
    with pytest.raises(AssertionError):
        check(method)


@pytest.mark.parametrize(
    ("name", "flag", "check"),
    [
        ("symplectic_euler", "evaluations", check_evaluations),
        ("velocity_verlet", "evaluations", check_evaluations),
        ("rk4", "evaluations", check_evaluations),
        ("implicit_midpoint", "symplectic", check_areas),
        ("heun", "symplectic", check_areas),
        ("velocity_verlet", "symmetric", check_symmetry),
        ("symplectic_euler", "symmetric", check_symmetry),
    ],
)
def test_contract_measures_what_methods_derive(name, flag, check, monkeypatch):
    method = METHODS[name]
    wrong = not getattr(method, flag) if flag != "evaluations" else method.evaluations + 1
    monkeypatch.setattr(type(method), flag, wrong)
    with pytest.raises(AssertionError):
        check(method)


@pytest.mark.parametrize("name", LEADING_ERRORS)
def test_leading_error_is_the_literatures(name):
    found = leading_error(EVERY[name])
    terms = (found.angle, found.velocity, found.amplitude, found.frequency)
    expected = tuple(None if row is None else Term(Fraction(row[0]), row[1]) for row in LEADING_ERRORS[name])
    if name in STABILITY or name in NYSTROM or name == "sdirk2":
        assert [term.power for term in terms] == [term.power for term in expected]
        assert all(abs(x.coefficient / y.coefficient - 1) < 1e-12 for x, y in zip(terms, expected, strict=True))
    else:
        assert terms == expected


def test_no_leading_error_of_the_literature_is_lost():
    """A new method need not have one; if it has, ``python tests/support/regenerate.py`` notes that it must stay."""
    assert {*stored("leading_errors")} <= METHODS.keys() & (LEADING_ERRORS.keys() | TRUTHS.keys())


def test_no_two_methods_take_the_same_step():
    """On the damped nonlinear problem, undamped for methods without drag; equal methods must be aliases."""
    ends: dict[str, dict[str, np.ndarray]] = {"linear": {}, "none": {}}
    for damped, found in ends.items():
        problem = driven_pendulum(damped if damped == "linear" else None, functions=math)
        for name, method in EVERY.items():
            if fits(method, problem) and not (damped == "none" and fits(method, driven_pendulum("linear", math))):
                found[name] = np.array(single_step(method, problem)(0.25, 0.5, 1.0, 1.5))
        for one, other in combinations(found, 2):
            assert np.max(np.abs(found[one] - found[other])) > 1e-6, (one, other)
    left = [method for name, method in EVERY.items() if not any(name in found for found in ends.values())]
    assert all("exact_flow" in method.needs for method in left), "these err nowhere, which the others do"


def test_names_and_aliases_lead_to_one_method_each():
    for name, method in METHODS.items():
        assert integrators.get(name) is method
        assert method.name == name
    for alias, name in integrators.ALIASES.items():
        assert integrators.get(alias) is METHODS[name]
        assert alias not in METHODS
    assert len(integrators.ALIASES) == sum(len(method.aliases) for method in METHODS.values())
    assert integrators.get("leapfrog").name == "velocity_verlet"
    assert integrators.get("euler").name == "forward_euler"


@pytest.mark.parametrize(
    ("wrong", "near"),
    [("rk5", "rk4"), ("velocity_verlett", "velocity_verlet"), ("Heun", "heun"), ("eulr", "euler")],
)
def test_unknown_names_are_met_with_near_ones(wrong, near):
    with pytest.raises(MethodError, match=f"no integrator '{wrong}'.*did you mean .*{near}"):
        integrators.get(wrong)


@pytest.mark.parametrize("wrong", ["zzz", "", 3, None])
def test_names_like_nothing_are_met_with_the_list(wrong):
    with pytest.raises(MethodError, match=rf"there are {len(METHODS)}, such as forward_euler, "):
        integrators.get(wrong)


def test_fitting_lists_what_the_system_can_serve():
    bare = System(lambda t, q, v: -v)
    tables = [m for m in METHODS.values() if isinstance(m, (RungeKutta, Nystrom, Adams))]
    explicit = {m.name for m in tables if not m.implicit and "velocity_free" not in m.needs}
    assert {"symplectic_euler"} | explicit <= integrators.fitting(bare).keys()
    served = {"acceleration", "smooth", "reversible"}
    assert all(method.needs <= served for method in integrators.fitting(bare).values())
    free = {name for name, method in METHODS.items() if "velocity_free" in method.needs}
    solved = {name for name, method in METHODS.items() if "exact_flow" in method.needs}
    assert set(integrators.fitting(rational_system())) == set(METHODS) - free - solved
    assert set(integrators.fitting(rational_system(damped=False))) == set(METHODS) - solved
    assert solved <= set(integrators.fitting(falling([]))) < set(METHODS)
    sticking = replace(rational_system(), one_way=True)
    forward = {name for name, method in METHODS.items() if not method.needs & {"reversible", "smooth"}}
    assert set(integrators.fitting(sticking)) == forward - free - solved


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"a": (exact(0),)}, "a must be 2 rows of 2 numbers"),
        ({"a": (exact(0), exact(1))}, "a must be 2 rows of 2 numbers"),
        ({"b": exact("1/2", "1/3")}, "weights b sum to 5/6, not to 1"),
        ({"embedded": (Embedded(1, exact(1)),)}, "embedded weights must be 2 numbers, like b"),
        ({"embedded": (Embedded(1, exact(1, 1)),)}, "weights embedded sum to 2, not to 1"),
    ],
)
def test_malformed_tables_are_refused(changes, message):
    with pytest.raises(MethodError, match=f"two_stage: .*{message}"):
        replace(TWO_STAGE, **changes)


@pytest.mark.parametrize(
    ("flows", "message"),
    [
        ((("fall", HALF),), "unknown sub-flow 'fall'; choose from kick, drift, drag, push"),
        (((KICK, HALF), (DRIFT, Fraction(1)), (DRAG, Fraction(1))), "must each sum to 1, not to 1, 1/2, 1"),
        (((KICK, Fraction(1)), (DRIFT, Fraction(1))), "must each sum to 1, not to 1, 1, 0"),
    ],
)
def test_malformed_splittings_are_refused(flows, message):
    with pytest.raises(MethodError, match=message):
        replace(POSITION_VERLET, flows=flows)
