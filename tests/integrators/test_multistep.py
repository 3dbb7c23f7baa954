"""Multistep methods: equations, limits, error constants, starting methods, and the use of the history."""

from __future__ import annotations

import math
import pickle
import re
import warnings
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from typing import Any

import gymnasium as gym
import mpmath
import numpy as np
import pytest
from multistep_truths import ANGLES, CONSTANTS, ERRORS, LIMITS

import integrators
from integrators import METHODS, MethodError, Multistep, System, solve, unroll
from integrators.analysis import (
    amplification,
    damping_limit,
    driven_pendulum,
    error_constant,
    leading_error,
    observed_order,
    order_conditions,
    reference,
    spectral_radius,
    stability_angle,
    stability_limit,
)
from integrators.analysis.linear import step_matrix
from integrators.families.adams import Adams
from integrators.families.backward_differences import BackwardDifference
from integrators.families.multistep import RK4, Started
from integrators.families.second_order import SecondOrder
from integrators.families.structural import GeneralizedAlpha, MeanForceAlpha
from integrators.method import exact
from integrators.tables.butcher import extrapolated_midpoint
from pendulum_env import SCENES, rollout
from pendulum_env.engine.machine import Machine

MANY = {name: method for name, method in METHODS.items() if isinstance(method, Multistep)}
DRAGGED = [name for name, method in MANY.items() if "velocity_free" not in method.needs]
START = (0.25, 0.5, 1.0)


def test_truths_are_of_methods_that_there_are() -> None:
    assert LIMITS.keys() == ERRORS.keys() <= MANY.keys()
    assert CONSTANTS.keys() <= LIMITS.keys()


# --- constants and limits -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", CONSTANTS)
def test_error_constants_are_the_published_ones(name: str) -> None:
    assert error_constant(name) == CONSTANTS[name]


def largest(method: Multistep, rows: Any, w: Any) -> Any:
    """Return the largest modulus of the roots of the characteristic polynomial, in 40 digits."""
    count = max(map(len, rows))
    line = [mpmath.mpf(0)] * count
    for m, row in enumerate(rows):
        for k, x in enumerate(row):
            line[k] += w**m * x.numerator / x.denominator
    while line[0] == 0:
        line.pop(0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # some versions of mpmath ask for another order
        return max(abs(x) for x in mpmath.polyroots(line[::-1], maxsteps=500, extraprec=300))


@pytest.mark.parametrize("name", LIMITS)
def test_limits_are_where_roots_leave_the_unit_disc(name: str) -> None:
    method, (oscillation, drag) = MANY[name], LIMITS[name]
    cases = [(oscillation, stability_limit(name), method.characteristic,
              (lambda z: -z * z) if method.power == 2 else (lambda z: mpmath.mpc(0, z)))]
    if name in DRAGGED:
        cases.append((drag, damping_limit(name), method.characteristic_of_drag, lambda g: -g))
    with mpmath.workdps(40):
        for truth, found, rows, w in cases:
            assert found == pytest.approx(truth, rel=1e-13 if name != "bdf5" else 1e-11), "nearly a tangent there"
            if 0.0 < truth < math.inf:
                assert largest(method, rows, w(mpmath.mpf(truth) * (1 - mpmath.mpf("1e-9")))) < 1 + 1e-15
                assert largest(method, rows, w(mpmath.mpf(truth) * (1 + mpmath.mpf("1e-9")))) > 1 + 1e-12


@pytest.mark.parametrize("name", ANGLES)
def test_angles_of_stability_are_the_published_ones(name: str) -> None:
    assert math.degrees(stability_angle(name)) == pytest.approx(ANGLES[name], abs=0.005)


def test_explicit_methods_have_no_angle() -> None:
    assert stability_angle("ab2") == 0.0


@pytest.mark.parametrize("name", MANY)
@pytest.mark.parametrize("z", [0.01, 0.1, 3.0])
def test_steps_have_the_roots_of_their_polynomial(name: str, z: float) -> None:
    """The matrix of the step, memory included, has the eigenvalues of the characteristic polynomial."""
    method = MANY[name]
    with mpmath.workdps(40):
        w = -mpmath.mpf(z) ** 2 if method.power == 2 else mpmath.mpc(0, z)
        assert spectral_radius(name, z) == pytest.approx(float(largest(method, method.characteristic, w)), rel=1e-9)


def test_spectral_radii_at_infinity_are_the_stated_ones() -> None:
    """Chung & Hulbert 1993: all roots at -rho. Hilber, Hughes & Taylor 1977: -(1 + alpha)/(1 - alpha), twice."""
    for name, root, count in (("generalized_alpha", Fraction(-4, 5), 3), ("hht_alpha", Fraction(-9, 11), 2),
                              ("generalized_alpha_mean_force", Fraction(-4, 5), 3),
                              ("hht_alpha_mean_force", Fraction(-9, 11), 2)):
        row = MANY[name].characteristic[1]
        for k in range(count):
            assert sum(math.perm(j, k) * x * root ** (j - k) for j, x in enumerate(row) if j >= k) == 0
        assert spectral_radius(name, 1e5) == pytest.approx(-float(root), rel=1e-3), "a multiple root, in floats"


def test_leading_errors_in_words() -> None:
    assert leading_error("ab2").text == "error of the angle in a step: -5 h^3 theta'''/12; " + (
        "amplitude after a time t: times exp(+omega0^4 h^3 t/4); frequency: +5 (omega0 h)^2/12 of its value")
    assert "amplitude exact" in leading_error("numerov").text


@pytest.mark.parametrize("wrong", [lambda: error_constant("rk4"), lambda: stability_angle("numerov"),
                                   lambda: step_matrix(METHODS["ab2"]), lambda: damping_limit("numerov")])
def test_what_a_method_has_not_is_refused(wrong: Any) -> None:
    with pytest.raises(MethodError):
        wrong()


# --- the difference equations themselves ----------------------------------------------------------------------------


def path(name: str, steps: int, h: Any, damped: str | None = None) -> tuple[list[Any], System]:
    """Return the states (t, q, v) of a run in 40 digits, and the problem."""
    system = driven_pendulum(damped)
    t, q, v = (mpmath.mpf(x) for x in START)
    found = solve(system, q, v, [t + i * h for i in range(steps + 1)], method=name, h=h * (1 + mpmath.mpf("1e-30")))
    return list(zip(found.t, found.q, found.v, strict=True)), system


@pytest.mark.parametrize("name", MANY)
def test_steps_obey_the_published_equation(name: str) -> None:
    """After the starting steps; runs backwards obey it too if the method is symmetric, and otherwise do not."""
    method = MANY[name]
    with mpmath.workdps(40):
        h = mpmath.mpf(1) / 64
        steps = 8 + method.past + len(getattr(method, "alpha", ()))
        rows, system = path(name, steps, h, "linear" if name in DRAGGED else None)
        residual = residuals(method, rows, system, h)
        assert max(map(abs, residual)) < 1e-36
        if isinstance(method, SecondOrder):
            back = max(map(abs, residuals(method, rows[::-1], system, -h)))
            assert (back < 1e-36) == method.symmetric
            assert back < 1e-36 or back > 1e-20


def residuals(method: Multistep, rows: list[Any], system: System, h: Any) -> list[Any]:
    def c(x: Fraction) -> Any:
        return mpmath.mpf(x.numerator) / x.denominator

    f = [system.acceleration(*row) for row in rows]
    q, v = ([row[k] for row in rows] for k in (1, 2))
    found = []
    for n in range(method.past + len(getattr(method, "alpha", (1,))), len(rows)):
        if isinstance(method, SecondOrder):
            left = sum(c(x) * q[n - j] for j, x in enumerate(method.alpha))
            found.append((left - h * h * sum(c(x) * f[n - j] for j, x in enumerate(method.beta))) / h**2)
        elif isinstance(method, BackwardDifference):
            for y, slope in ((q, v), (v, f)):
                found.append(sum(c(x) * y[n - j] for j, x in enumerate(method.alpha)) / h - slope[n])
        elif isinstance(method, Adams) and not method.corrector:
            for y, slope in ((q, v), (v, f)):
                found.append((y[n] - y[n - 1]) / h - sum(c(x) * slope[n - 1 - j] for j, x in enumerate(method.b)))
        elif isinstance(method, Adams):
            t = rows[n][0]
            guess = [y[n - 1] + h * sum(c(x) * slope[n - 1 - j] for j, x in enumerate(method.b))
                     for y, slope in ((q, v), (v, f))]
            for y, slope, new in ((q, v, guess[1]), (v, f, system.acceleration(t, *guess))):
                total = sum(c(x) * slope[n - 1 - j] for j, x in enumerate(method.corrector[1:]))
                found.append((y[n] - y[n - 1]) / h - total - c(method.corrector[0]) * new)
        elif isinstance(method, GeneralizedAlpha) and not method.alpha_m and not method.alpha_f:
            found.append((v[n] - v[n - 1]) / h - c(1 - method.gamma) * f[n - 1] - c(method.gamma) * f[n])
            mean = c(Fraction(1, 2) - method.beta) * f[n - 1] + c(method.beta) * f[n]
            found.append((q[n] - q[n - 1] - h * v[n - 1]) / h**2 - mean)
        elif isinstance(method, GeneralizedAlpha) and n > 1:
            # The accelerations are not visible; they are computed from the angles, and give velocities and forces.
            b, g, part = c(method.beta), c(method.gamma), 1 - c(method.alpha_f)
            a = [f[0]]
            for k in range(1, n + 1):
                a.append(((q[k] - q[k - 1]) / h**2 - v[k - 1] / h - (mpmath.mpf(1) / 2 - b) * a[-1]) / b)
            found.append((v[n] - v[n - 1]) / h - (1 - g) * a[n - 1] - g * a[n])
            m = c(method.alpha_m)
            if isinstance(method, MeanForceAlpha):
                found.append((1 - m) * a[n] + m * a[n - 1] - part * f[n] - (1 - part) * f[n - 1])
                continue
            place = (rows[n - 1][0] + part * h, *(y[n - 1] + part * (y[n] - y[n - 1]) for y in (q, v)))
            found.append((1 - m) * a[n] + m * a[n - 1] - system.acceleration(*place))
    assert found
    return found


def test_names_that_are_other_methods_lead_there() -> None:
    """Newmark's average acceleration is the trapezoidal rule, and Verlet's steps obey Störmer's equation."""
    average = GeneralizedAlpha(name="average", order=2, source="-", summary="-", alpha_m=Fraction(0),
                               alpha_f=Fraction(0), beta=Fraction(1, 4), gamma=Fraction(1, 2))
    ends = [solve(driven_pendulum("quadratic", math), 0.5, 1.0, [0.25, 2.25], method=method, h=0.1)
            for method in (average, "newmark")]
    assert integrators.get("newmark").name == "trapezoid"
    assert ends[0].q[-1] == pytest.approx(ends[1].q[-1], abs=1e-14)
    assert ends[0].v[-1] == pytest.approx(ends[1].v[-1], abs=1e-14)
    with mpmath.workdps(40):
        h = mpmath.mpf(1) / 64
        rows, system = path("stoermer", 8, h)
        f = [system.acceleration(*row) for row in rows]
        for n in range(1, 8):
            assert abs(rows[n + 1][1] - 2 * rows[n][1] + rows[n - 1][1] - h * h * f[n]) < 1e-38


def test_summed_steps_round_less() -> None:
    """Quinlan & Tremaine 1990, section 4: the equation in angles, not summed, loses digits with every step."""
    method, h, steps = METHODS["quinlan_tremaine8"], 2.0**-6, 20_000
    assert isinstance(method, SecondOrder)
    found = solve(System(lambda t, q, v: -q, velocity_free=True), 1.0, 0.0, [0.0, steps * h], method=method, h=h)
    alpha, beta = ([float(x) for x in row] for row in (method.alpha, method.beta))
    q = [math.cos(i * h) for i in range(9)]
    for _ in range(steps - 8):
        q.append(sum(-alpha[j] * q[-j] - h * h * beta[j] * q[-j] for j in range(1, 9)))
    shift = -45767 / 7257600 * h**8 * steps * h
    truth = math.cos(steps * h * (1.0) + shift)
    assert abs(found.q[-1] - truth) < 1e-14
    assert abs(q[-1] - truth) > 5e-14


# --- quadratures ----------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("name", MANY)
def test_quadratures_have_the_order_of_the_method(name: str) -> None:
    """The work of the weight along the driven pendulum is the gain of cos q."""
    method = MANY[name]
    system = driven_pendulum()
    scope: dict[str, Any] = {
        "acceleration": system.acceleration, "jacobian": system.jacobian, "NAN": math.nan,
        "rates": lambda t, q, v: (system.acceleration(t, q, v), -v * mpmath.sin(q)),
    }

    def number(value: Fraction) -> str:
        key = f"c{value.numerator}_{value.denominator}".replace("-", "m")
        scope[key] = mpmath.mpf(value.numerator) / value.denominator
        return key

    errors = []
    with mpmath.workdps(60):
        exec(unroll(method, quadratures=("work",), number=number), scope)
        t0, q0, v0 = (mpmath.mpf(x) for x in START)
        truth = mpmath.cos(reference(None, 60)[0]) - mpmath.cos(q0)
        for steps in (256, 1024) if method.order < 8 else (128, 1024):
            h = mpmath.mpf("0.75") / steps
            memory = scope["begin"](t0, q0, v0, h)
            assert len(memory) == len(method.memory_with(("work",)))
            q, v, total = q0, v0, mpmath.mpf(0)
            for i in range(steps):
                q, v, *memory, gain = scope["step"](t0 + i * h, q, v, *memory, h)
                total += gain
            errors.append(abs(total - truth))
        order = float(mpmath.log(errors[0] / errors[1]) / mpmath.log(4 if method.order < 8 else 8))
    assert order > method.order - 0.1


# --- what begins them -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", [2, 4, 6])
def test_extrapolation_meets_the_order_conditions(order: int) -> None:
    table = extrapolated_midpoint(order)
    assert table.evaluations == 1 + (order // 2) ** 2
    conditions = order_conditions(table, order + 1)
    assert not any(c.defect for c in conditions if c.order <= order)
    assert any(c.defect for c in conditions if c.order > order)


@pytest.mark.slow
@pytest.mark.parametrize("order", [6, *(pytest.param(order, marks=pytest.mark.slow) for order in (10, 16))])
def test_extrapolation_shows_its_order(order: int) -> None:
    assert observed_order(extrapolated_midpoint(order), damped="linear", digits=70) == pytest.approx(order, abs=0.1)


@pytest.mark.parametrize("order", [0, 3])
def test_extrapolation_has_even_orders(order: int) -> None:
    with pytest.raises(MethodError, match="even order"):
        extrapolated_midpoint(order)


@pytest.mark.parametrize("name", [name for name, method in MANY.items() if isinstance(method, Started)])
def test_starters_are_good_enough(name: str) -> None:
    """The history enters a step divided by h: it must be as accurate as a step of the method itself."""
    method = MANY[name]
    assert isinstance(method, Started)
    longer = 2 if isinstance(method, SecondOrder) and len(method.alpha) > 3 else 0
    assert method.starter.order >= method.order + longer - method.forwards * (method.order == 6)
    assert method.starter.l_stable == method.forwards


def test_a_change_of_step_begins_anew() -> None:
    """The second interval has another step and the bits of a separate run."""
    for name in ("ab4", "bdf3", "numerov", "quinlan_tremaine8", "hht_alpha"):
        system = driven_pendulum(None, math)
        both = solve(system, 0.5, 1.0, [0.0, 1.0, 2.0, 2.75], method=name, h=0.1)
        late = solve(system, both.q[2], both.v[2], [2.0, 2.75], method=name, h=0.1)
        assert (both.q[-1], both.v[-1]) == (late.q[-1], late.v[-1]), name


def counted_run(name: str, times: Any, q: Any, h: Any) -> Any:
    """Return a run of the pendulum through these times."""
    m = mpmath if isinstance(q, mpmath.mpf) else math
    system = System(lambda t, q, v: -m.sin(q), velocity_free=True, jacobian=lambda t, q, v: (-m.cos(q), 0.0))
    return solve(system, q, 0 * q, times, method=name, h=h)


TENTHS = {
    "double": (float, [k / 10 for k in range(41)], 2.0**-45),
    "float32": (float, np.arange(41, dtype=np.float32) / np.float32(10), 2.0**-20),
    "mpmath": (mpmath.mpf, [mpmath.mpf(k) / 10 for k in range(41)], 2.0**-45),
}
"""Times of intervals that are equal but for rounding: a type for q, the times, and an error that rounding explains."""


@pytest.mark.parametrize("kind", TENTHS)
@pytest.mark.parametrize("name", MANY)
def test_rounded_times_do_not_restart_the_history(name: str, kind: str) -> None:
    """At none of 39 marks: as many evaluations as without marks, but for Newton's iterations, and the same end."""
    number, times, error = TENTHS[kind]
    stops = counted_run(name, times, number(1), 0.125)
    through = counted_run(name, [times[0], times[-1]], number(1), (times[-1] - times[0]) / 40 * (1 + 1e-12))
    assert (stops.steps, through.steps) == (40, 40)
    assert float(abs(stops.q[-1] - through.q[-1])) < error
    if not MANY[name].implicit:
        assert stops.evaluations == through.evaluations


@pytest.mark.parametrize("name", ["ab4", "bdf6", "numerov", "quinlan_tremaine8", "hht_alpha"])
def test_times_of_more_digits_keep_the_history_too(name: str) -> None:
    """In 40 digits; with a restart at each time bdf6 would be its starter, radau5."""
    with mpmath.workdps(40):
        times = [mpmath.mpf(k) / 10 for k in range(21)]
        stops = counted_run(name, times, mpmath.mpf(1), mpmath.mpf("0.125"))
        through = counted_run(name, [times[0], times[-1]], mpmath.mpf(1), mpmath.mpf("0.1") * (1 + mpmath.mpf("1e-12")))
        assert (stops.steps, through.steps) == (20, 20)
        assert abs(stops.q[-1] - through.q[-1]) < 1e-36


def test_decimals_and_fractions_keep_the_history() -> None:
    for number, digits in ((Decimal, Decimal(10) ** -26), (Fraction, Fraction(0))):
        system = System(lambda t, q, v: -q, velocity_free=True)
        times = [3 + number(k) / 7 for k in range(12)]
        h = number(1) / 6
        stops = solve(system, number(1), number(0), times, method="ab3", h=h)
        through = solve(system, number(1), number(0), [times[0], times[-1]], method="ab3", h=h * 6 / 7 + h / 10**9)
        assert (stops.steps, stops.evaluations) == (through.steps, through.evaluations)
        assert abs(stops.q[-1] - through.q[-1]) <= digits


UNEQUAL = [k / 10 + 0.01 * (k % 2) for k in range(12)]


@pytest.mark.parametrize(("name", "more"), [
    ("bdf6", " After each restart radau5 computes the first 5 steps."),
    ("ab4", " After each restart rk4 computes a new history."), ("hht_alpha", "")])
def test_many_restarts_give_a_warning(name: str, more: str) -> None:
    text = (f"{name} started its history anew 10 times in 11 steps, because the step length changed by more than the "
            f"rounding of the times.{more} Equally spaced times need no restart.")
    with pytest.warns(UserWarning, match=f"^{re.escape(text)}$") as caught:
        counted_run(name, UNEQUAL, 1.0, 1.0)
    assert len(caught) == 1
    with pytest.warns(UserWarning, match="started its history anew 4 times"):
        counted_run(name, UNEQUAL[:6], 1.0, 1.0)


def test_few_restarts_and_methods_without_a_history_give_no_warning() -> None:
    counted_run("bdf6", UNEQUAL[:5], 1.0, 1.0)
    counted_run("velocity_verlet", UNEQUAL, 1.0, 1.0)


def test_steps_that_differ_by_a_thousandth_are_not_rounded_ones() -> None:
    """Late float32 times of short steps: their rounding is a third of a step, too much for one history."""
    times = np.float32(1e5) + np.arange(20, dtype=np.float32) * np.float32(0.02)
    with pytest.warns(UserWarning, match="ab4 started its history anew"):
        counted_run("ab4", times, 1.0, 1.0)


def test_steps_that_differ_by_more_than_the_rounding_of_late_times_are_not_taken_as_equal() -> None:
    """From t = 1e6 each step is 2e-7 longer than the last, 2000 times the distance of two times in double precision.

    The motion is cos(t - 1e6). A history whose steps are taken as equal is a wrong one: errors are then above 1.5e-7.
    """
    times = 1e6 + np.concatenate([[0.0], np.cumsum(0.01 + 2e-7 * np.arange(1000))])
    for name in ("ab4", "abm4", "bdf4"):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that the history starts anew in each step
            found = solve(lambda t, q, v: -q, 1.0, 0.0, times, method=name, h=1.0)
        assert np.max(np.abs(found.q - np.cos(times - times[0]))) < 6e-8, name


@pytest.mark.parametrize("name", [name for name, method in MANY.items() if method.implicit])
def test_arrays_take_the_steps_of_numbers(name: str) -> None:
    """Stiff if the method can treat drag; coupled components are in test_solve.py."""
    gamma = 300.0 if name in DRAGGED else 0.0
    system = System(lambda t, q, v: -q - gamma * v, velocity_free=not gamma, jacobian=lambda t, q, v: (-1.0, -gamma))
    starts = np.array([[1.0, -0.5], [0.2, 3.0]])
    many = solve(system, *starts, [0.0, 1.0], method=name, h=0.1)
    for i, (q, v) in enumerate(starts.T):
        one = solve(system, q, v, [0.0, 1.0], method=name, h=0.1)
        assert many.q[-1, i] == pytest.approx(one.q[-1], abs=1e-13)
        assert many.v[-1, i] == pytest.approx(one.v[-1], abs=1e-12)


# --- in scenes ------------------------------------------------------------------------------------------------------

IN_SCENES = ("ab4", "abm4", "bdf3", "generalized_alpha")


def final(machine: Machine, *pieces: tuple[float, int], start: Any = None) -> list[float]:
    """Return angle from the nearer of bottom and top, turns and velocity after pieces of (control, steps)."""
    state = machine.state(1.0, 9.0) if start is None else start
    for control, steps in pieces:
        assert machine.advance(state, control, 0.02, steps) == 0
    return [float(x) for x in state[1:4]]


@pytest.mark.parametrize("name", IN_SCENES)
def test_the_memory_lasts_as_long_as_the_control(name: str) -> None:
    """Across the top, where half turns are subtracted; a new control restarts the memory from that state."""
    machine = Machine(SCENES["lab"], name, backend="python")
    assert final(machine, (0.5, 7), (0.5, 1), (0.5, 32)) == final(machine, (0.5, 40))
    state = machine.state(1.0, 9.0)
    machine.advance(state, 0.5, 0.02, 40)
    fresh = list(state)
    fresh[0] = 0.0
    changed = final(machine, (-0.5, 20), start=state)
    assert changed == final(machine, (-0.5, 20), start=fresh)
    assert changed[1] != 0.0, "it went over the top"


@pytest.mark.parametrize("name", ["stoermer4", "numerov", "quinlan_tremaine10"])
def test_turns_do_not_touch_the_memory(name: str) -> None:
    """Rotations at 9 rad/s agree with elliptic functions after ten turns, with turns subtracted on the way."""
    from pendulum_env.physics.exact import pendulum

    r = rollout("vacuum", integrator=name, angle=0.0, velocity=9.0, dt=0.005, duration=8.0, backend="python")
    truth, _ = pendulum(r.time, 0.0, 9.0, SCENES["vacuum"].omega0)
    assert r.angle[-1] > 20 * math.pi / 2
    assert r.angle[-1] == pytest.approx(truth[-1], abs=1e-5 if METHODS[name].order == 4 else 1e-10)


@pytest.mark.parametrize("name", IN_SCENES)
@pytest.mark.parametrize("how", ["state", "pickle"])
def test_runs_resume_in_the_middle_of_a_memory(name: str, how: str) -> None:
    def make() -> Any:
        return gym.make("LabPendulum-v0", integrator=name, substeps=2, backend="python").unwrapped

    env = make()
    env.reset(seed=1)
    action = np.array([0.4], dtype=np.float32)
    env.step(action)
    other = pickle.loads(pickle.dumps(env)) if how == "pickle" else make()
    if how == "state":
        other.reset(seed=5)
        other.set_state(env.get_state())
    for _ in range(6):
        ours, theirs = env.step(action), other.step(action)
        assert ours[4] == theirs[4]


@pytest.mark.slow
@pytest.mark.parametrize(("scene", "name"), [("vacuum", "ab3"), ("lab", "ab3"), ("lab", "bdf3")])
def test_batches_compiled_are_single_runs_interpreted(scene: str, name: str) -> None:
    angles = np.array([0.5, 2.0, 3.1])
    share = 0.3 if SCENES[scene].has("motor") else 0.0
    many = rollout(scene, integrator=name, angle=angles, velocity=4.0, control=share, dt=0.02, duration=3.0)
    for i, angle in enumerate(angles):
        one = rollout(scene, integrator=name, angle=angle, velocity=4.0, control=share, dt=0.02, duration=3.0,
                      backend="python")
        assert np.array_equal(many.angle[i], one.angle)
        assert np.array_equal(many.energy_residual[i], one.energy_residual)


def test_environments_say_where_a_method_hardly_runs() -> None:
    with pytest.warns(UserWarning, match="bdf4 restarts at every change of control, by 3 steps of radau5 forwards"):
        gym.make("LabPendulum-v0", integrator="bdf4", substeps=4, backend="python")
    with pytest.warns(UserWarning, match="ab2 restarts .* 1 step of rk4 backwards in time, .*only 1 substep; take"):
        gym.make_vec("LabPendulum-v0", num_envs=2, integrator="ab2", backend="python")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        gym.make("LabPendulum-v0", integrator="bdf4", substeps=12, backend="python")
        gym.make("LabPendulum-v0", scene="vacuum", task="free", integrator="bdf4", backend="python")
        gym.make("LabPendulum-v0", integrator="hht_alpha", backend="python")


# --- bad input ------------------------------------------------------------------------------------------------------


def test_dry_friction_is_refused() -> None:
    for name in MANY:
        with pytest.raises(MethodError, match="forces without dry friction"):
            Machine(SCENES["sticky_bearing"], name, backend="python")
    sticking = System(lambda t, q, v: -v, dissipative_flow=lambda t, q, v, h: v, one_way=True)
    with pytest.raises(MethodError, match="ab4 needs forces without dry friction"):
        solve(sticking, 1.0, 0.0, [0.0, 1.0], method="ab4", h=0.1)


def test_a_force_that_fails_in_the_past_is_named() -> None:
    """The root of t does not exist before the start, where ab4 computes its history."""
    with pytest.raises(MethodError, match="ab4 left the finite range in step 1"):
        solve(System(lambda t, q, v: math.sqrt(t)), 1.0, 0.0, [0.0, 1.0], method="ab4", h=0.1)
    assert solve(System(lambda t, q, v: math.sqrt(t), jacobian=lambda t, q, v: (0.0, 0.0)), 1.0, 0.0, [0.0, 1.0],
                 method="bdf4", h=0.1).v[-1] == pytest.approx(2 / 3, abs=0.01)


@pytest.mark.parametrize(
    ("method", "changes", "message"),
    [
        ("ab2", {"b": exact("3/2", "1/2")}, "the weights b sum to 2, not to 1"),
        ("abm4", {"corrector": exact(1, 1)}, "the weights corrector sum to 2, not to 1"),
        ("bdf2", {"alpha": exact(1, -1, 1)}, "must be 0 and sum_j -j alpha_j must be 1"),
        ("numerov", {"beta": exact("1/12", "5/6", "1/6")}, "must be 0, 0 and 2 sum"),
        ("hht_alpha", {"gamma": Fraction(1, 2)}, "gamma must be 1/2 - alpha_m [+] alpha_f"),
    ],
)
def test_malformed_tables_are_refused(method: str, changes: Any, message: str) -> None:
    with pytest.raises(MethodError, match=f"{method}: .*{message}"):
        replace(METHODS[method], **changes)


def test_a_method_of_ones_own_is_one_entry() -> None:
    """A user-defined method with the mean of two slopes has order 1 and error constant 1 by Taylor expansion."""
    own = Adams(name="own", order=1, source="-", summary="-", b=exact("1/2", "1/2"), starter=RK4)
    assert observed_order(own) == pytest.approx(1.0, abs=0.1)
    assert error_constant(own) == 1
    assert amplification(own, 0.1).shape == (4, 4)
