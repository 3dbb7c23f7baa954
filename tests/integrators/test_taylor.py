"""Taylor series: recurrences against mpmath's expansions, methods against closed forms."""

from __future__ import annotations

import math
import pickle
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np
import pytest
from given_effects import Rub

import integrators
from integrators import MethodError, System, solve
from integrators.analysis import Term, damping_limit, driven_pendulum, leading_error, observed_order, stability_limit
from integrators.families import taylor
from integrators.families.taylor import coefficients
from integrators.steps.tracing import power as recorded_power
from pendulum_env import SCENES, Scene, rollout
from pendulum_env.engine.generate import program
from pendulum_env.engine.machine import fitting
from pendulum_env.physics.effects import Effect, Gravity, LinearDrag, QuadraticDrag
from pendulum_env.physics.elementary import exp, log, power, sin, tanh
from pendulum_env.physics.exact import pendulum

# --- the recurrences: q'' = f(t) for every operation, whose coefficients mpmath finds by differentiating --------------

FUNCTIONS: dict[str, tuple[Any, Any]] = {
    "sum and difference": (lambda x: 3 - x + x * 2 - (x - 5), lambda x: 8),
    "product": (lambda x: x * (2 + x) * x, lambda x: x * (2 + x) * x),
    "square": (lambda x: (1 + x * x) * (1 + x * x), lambda x: (1 + x * x) ** 2),
    "quotient": (lambda x: (2 - x) / (3 + x * x), lambda x: (2 - x) / (3 + x * x)),
    "reciprocal": (lambda x: 1 / (2 + x), lambda x: 1 / (2 + x)),
    "sine": (lambda x: taylor.sin(2 * x + x * x), lambda x: mpmath.sin(2 * x + x * x)),
    "cosine": (lambda x: taylor.cos(x / 3), lambda x: mpmath.cos(x / 3)),
    "exponential": (lambda x: taylor.exp(-x * x), lambda x: mpmath.exp(-x * x)),
    "logarithm": (lambda x: taylor.log(2 + x * x), lambda x: mpmath.log(2 + x * x)),
    "hyperbolic tangent": (lambda x: taylor.tanh(3 * x * x - x) + taylor.tanh(x),
                           lambda x: mpmath.tanh(3 * x * x - x) + mpmath.tanh(x)),
    "root": (lambda x: taylor.sqrt(1 + 3 * x), lambda x: mpmath.sqrt(1 + 3 * x)),
    "power": (lambda x: (2 + x) ** 2.5 + recorded_power(1 + x, -1.5), lambda x: (2 + x) ** 2.5 + (1 + x) ** -1.5),
    "whole powers": (lambda x: x**5 + (1 + x) ** -3 + x**0 + x**1, lambda x: x**5 + (1 + x) ** -3 + 1 + x),
    "modulus": (lambda x: abs(x - 7) * x + abs(x), lambda x: (7 - x) * x + x),
    "of NumPy": (lambda x: np.sin(x) * np.exp(x) + np.abs(x) + np.tanh(x),
                 lambda x: mpmath.sin(x) * mpmath.exp(x) + x + mpmath.tanh(x)),
    "of constants": (lambda x: taylor.sin(mpmath.mpf(2)) * x - -x, lambda x: mpmath.sin(2) * x + x),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_operation_has_its_recurrence(name: str) -> None:
    traced, truth = FUNCTIONS[name]
    with mpmath.workdps(50):
        t, order = mpmath.mpf("0.75"), 14
        found = coefficients(lambda t, q, v: traced(t))(t, t, t, order)
        wanted = mpmath.taylor(truth, t, order - 2)
        for k, value in enumerate(wanted):
            assert abs(found[k + 2] * (k + 1) * (k + 2) - value) < mpmath.mpf(10) ** (-22)  # that of mpmath.taylor


def test_the_motions_coefficients_are_those_of_its_solution() -> None:
    """For q'' = -q, q'' = v and q'' = 6 q**2 with the solution 1/(1 - t)**2, exactly in fractions."""
    one = Fraction(1)
    swing = coefficients(lambda t, q, v: -q)(0 * one, one, 2 * one, 9)
    assert swing == [Fraction((1, 2, -1, -2)[k % 4], math.factorial(k)) for k in range(10)]
    grown = coefficients(lambda t, q, v: v)(0 * one, one, one, 9)
    assert grown == [Fraction(1, math.factorial(k)) for k in range(10)]
    pole = coefficients(lambda t, q, v: 6 * q * q)(0 * one, one, 2 * one, 9)
    assert pole == [k + 1 for k in range(10)]


def test_the_sign_of_a_modulus_at_zero_is_that_of_its_rate() -> None:
    for sense in (1.0, -1.0):
        found = coefficients(lambda t, q, v, sense=sense: sense - abs(v) * v)(0.0, 0.0, 0.0, 9)
        truth = mpmath.taylor(lambda t: mpmath.log(mpmath.cosh(t)), 0, 9)
        assert found == pytest.approx([sense * float(x) for x in truth], abs=1e-15)


def test_components_may_be_coupled_in_any_way() -> None:
    """Two bodies on a spring, each component written out, agree with separate numbers."""

    def pair(t: Any, q: Any, v: Any) -> Any:
        apart = q[0] - q[1]
        return np.array([-taylor.sin(apart) - v[0], taylor.sin(apart) + q[1] ** 2])

    found = coefficients(pair)(0.0, np.array([1.0, 0.25]), np.array([0.5, -0.5]), 8)
    step = 1e-3
    ends = [sum(row * s**k for k, row in enumerate(found)) for s in (-step, step)]
    curved = (ends[0] + ends[1] - 2.0 * found[0]) / step**2
    assert curved == pytest.approx(np.asarray(pair(0, found[0], found[1]), dtype=float), abs=1e-5)
    assert all(row.shape == (2,) and row.dtype == np.float64 for row in found)


REFUSED = {
    "math": (lambda t, q, v: -math.sin(q), "a function that wants a value, such as one of math"),
    "mpmath": (lambda t, q, v: -mpmath.sin(q), "Symbol"),
    "comparison": (lambda t, q, v: -q if q > 0 else q, "a comparison"),
    "maximum": (lambda t, q, v: -max(q, 0.0), "a comparison"),
    "remainder": (lambda t, q, v: -(q % 2.0), "a division with remainder"),
    "tangent": (lambda t, q, v: -np.tan(q), "tan"),
    "exponent": (lambda t, q, v: -(2.0 ** q), "a power whose exponent is not a fixed number"),
    "moving exponent": (lambda t, q, v: -(abs(q) ** q), "a power whose exponent is not a fixed number"),
}


@pytest.mark.parametrize("kind", REFUSED)
@pytest.mark.parametrize("steps", [{"h": 0.1}, {"rtol": 1e-6}], ids=str)
def test_what_cannot_be_recorded_is_refused_by_name(kind: str, steps: Any) -> None:
    function, message = REFUSED[kind]
    with pytest.raises(MethodError, match=f"Taylor series need an acceleration that uses only .*, but .*{message}"):
        solve(function, 1.0, 0.5, [0.0, 1.0], method="taylor", **steps)
    solve(function, 1.0, 0.5, [0.0, 0.1], method="rk4", h=0.1)


# --- the methods -----------------------------------------------------------------------------------------------------


@pytest.mark.quick("5")
@pytest.mark.parametrize("order", [2, 5, *(pytest.param(order, marks=pytest.mark.slow) for order in (20, 30))])
def test_orders(order: int) -> None:
    method = integrators.get(f"taylor{order}")
    assert (method.name, method.order) == (f"taylor{order}", order)
    assert observed_order(method, damped="linear") == pytest.approx(order, abs=0.1)


@pytest.mark.parametrize("method", ["taylor2", "taylor13", "taylor24", "taylor30"])
def test_leading_errors_and_limits_are_those_of_the_series_of_exp(method: str) -> None:
    """The leading error is minus the first omitted term; |R| = 1 at the limits."""
    error = leading_error(method)
    order = integrators.get(method).order
    assert error.angle == Term(Fraction(-1, math.factorial(order + 1)), order + 1) == error.velocity
    with mpmath.workdps(120):
        for name, limit, direction in (
            ("stability", stability_limit(method), 1j), ("damping", damping_limit(method), -1)
        ):
            def excess(z: Any, direction: Any = direction) -> Any:
                return abs(sum((direction * z) ** k / mpmath.factorial(k) for k in range(order + 1))) - 1

            assert excess(mpmath.mpf("0.1")) * (1 if limit == 0.0 else -1) > 0, name
            if limit > 0.0:
                low, high = (mpmath.mpf(limit) * (1 + sign * mpmath.mpf("4e-16")) for sign in (-1, 1))
                assert excess(low) < 0 < excess(high), name


def test_low_orders_are_the_known_ones_on_the_oscillator() -> None:
    """Taylor series of orders 2, 3 and 4 have the stability of Runge-Kutta methods with as many stages."""
    for name, other in (("taylor2", "heun"), ("taylor3", "kutta3"), ("taylor4", "rk4")):
        ours, theirs = leading_error(name), leading_error(other)
        assert (ours.angle, ours.amplitude, ours.frequency) == (theirs.angle, theirs.amplitude, theirs.frequency)
        assert stability_limit(name) == stability_limit(other)


def test_names() -> None:
    assert integrators.get("taylor12") is integrators.get("taylor")
    assert pickle.loads(pickle.dumps(integrators.get("taylor7"))) == integrators.get("taylor7")
    for name in ("taylor1", "taylor31", "taylor0"):
        with pytest.raises(MethodError, match=r"^Taylor series have orders from 2 to 30 here, not (1|31|0)"):
            integrators.get(name)
    with pytest.raises(MethodError, match="no integrator 'taylorx'; did you mean taylor"):
        integrators.get("taylorx")


def test_the_system_says_what_it_offers() -> None:
    with pytest.raises(MethodError, match=r"taylor needs the Taylor coefficients .*heun.* fit"):
        solve(System(lambda t, q, v: -q), 1.0, 0.0, [0.0, 1.0], method="taylor", h=0.1)
    mine = System(lambda t, q, v: -q, taylor_coefficients=coefficients(lambda t, q, v: -q))
    found = solve(mine, 1.0, 0.0, [0.0, 1.0], method="taylor20", h=1.0)
    assert found.q[-1] == pytest.approx(math.cos(1.0), abs=2e-16)
    assert found.evaluations == 1


def test_thirty_digits_in_a_few_steps() -> None:
    with mpmath.workdps(40):
        zero, one = mpmath.mpf(0), mpmath.mpf(1)
        times, rtol = [zero, one * 3 / 4], one / 10**30
        found = solve(lambda t, q, v: 6 * q * q, one, 2 * one, times, method="taylor30", rtol=rtol)
        assert abs(found.q[-1] / 16 - 1) < 1e-27
        assert found.steps < 40


@pytest.mark.parametrize("name", ["taylor", "taylor20", "taylor5"])
def test_adaptive_errors_go_with_the_tolerance(name: str) -> None:
    omega0, errors = SCENES["vacuum"].omega0, []
    exponents = range(4, 12)
    for n in exponents:
        run = rollout("vacuum", integrator=name, angle=2.5, velocity=0.0, duration=5.0, dt=0.5, rtol=10.0**-n,
                      backend="python")
        errors.append(np.max(np.abs(run.angle - pendulum(run.time, 2.5, 0.0, omega0)[0])))
    assert -np.polyfit(exponents, np.log10(errors), 1)[0] == pytest.approx(1.0, abs=0.25)
    assert max(error * 10.0**n for n, error in zip(exponents, errors, strict=True)) < 1000


def test_steps_are_those_of_the_last_coefficients() -> None:
    """On 1/(1 - t)**2 the radius of convergence is the distance to the pole: q_k = (k + 1)/(1 - t)**(k + 2).

    With ``q_p h**p`` and ``v_p h**p`` at the tolerance, the ratio of h to the radius is constant (Jorba & Zou 2005,
    section 3.2), up to the controller's factor 0.9.
    """
    distances, tolerance = [], 1e-9
    series = coefficients(lambda t, q, v: 6 * q * q)

    def noted(t: float, q: float, v: float, order: int) -> Any:
        distances.append(1.0 - t)
        return series(t, q, v, order)

    system = System(lambda t, q, v: 6 * q * q, taylor_coefficients=noted)
    solve(system, 1.0, 2.0, [0.0, 0.999], method="taylor20", rtol=tolerance, atol=1e-300)
    left = np.array(list(dict.fromkeys(distances)))[3:-1]
    ratios = 1.0 - left[1:] / left[:-1]
    assert ratios == pytest.approx(np.mean(ratios), rel=1e-3)
    ratio = float(np.mean(ratios))
    # q_20 = 21 and v_20 = 462 at distance 1, where q = 1 and v = 2; at the end of a step they are 1/(1 - ratio)**2 and
    # **3 times that. The step was cut from a longer one, at whose end they were larger: hence the 2.5 %.
    size = math.hypot(21.0 * (1 - ratio) ** 2, 231.0 * (1 - ratio) ** 3) / math.sqrt(2.0)
    assert ratio == pytest.approx(0.9 * (tolerance / size) ** (1 / 20), rel=0.025)


def test_estimates_are_the_last_terms() -> None:
    from integrators import unroll
    from integrators.steps.estimates import embedded_orders, evaluations_tried, order_of_estimate

    method = integrators.get("taylor9")
    assert (embedded_orders(method), order_of_estimate(method), evaluations_tried(method)) == ((8,), 9, 1)
    problem = driven_pendulum("linear", math)
    found = problem.taylor_coefficients(0.25, 0.5, 1.0, 10)
    names: dict[str, Any] = {"series": taylor.series_of(problem.taylor_coefficients, 9)}
    exec(unroll(method, estimates=True), names)
    q, v, a, *errors = names["step"](0.25, 0.5, 1.0, -7.0, 0.1)
    assert a == -7.0, "what came in; no step asks for it"
    assert errors == pytest.approx([found[9] * 0.1**9, 10 * found[10] * 0.1**9], rel=1e-14)
    plain = solve(problem, 0.5, 1.0, [0.25, 0.35], method=method, h=0.2)
    assert (q, v) == pytest.approx((plain.q[-1], plain.v[-1]), abs=1e-16)


# --- in scenes -------------------------------------------------------------------------------------------------------


def test_scenes_have_the_coefficients_of_their_equation() -> None:
    """The generated series equals that of the equation written by hand with other names."""
    made = program(SCENES["lab"], integrators.get("taylor9"), ()).text
    names: dict[str, Any] = {"inline": lambda f: f, "entry": lambda f: f}
    exec(made, names)
    k = SCENES["lab"].coefficients
    for side, v in ((1.0, 0.7), (-1.0, -0.7)):
        found = names["series"](0.0, 0.4, v, *k.values(), side, 0.5)
        by_hand = coefficients(
            lambda t, q, v, side=side: -k["gravity_rate"] * side * taylor.sin(q) - k["quadratic_drag_rate"] * abs(v) * v
            - k["linear_drag_rate"] * v + 0.5 * k["motor_rate"]
        )(0.0, 0.4, v, 10)
        wanted = [*by_hand[2:-1], *(n * x for n, x in enumerate(by_hand[2:], start=2))]
        assert found == pytest.approx(wanted, rel=1e-13)


@pytest.mark.slow
def test_interpreted_and_compiled_give_the_same_bits() -> None:
    asked: dict[str, Any] = {"integrator": "taylor5", "angle": 2.0, "velocity": 0.3, "duration": 3.0, "dt": 0.1,
                             "control": 0.5}
    one, other = (rollout("lab", **asked, backend=backend) for backend in ("python", "compiled"))
    for quantity in ("angle", "velocity", "energy_residual"):
        assert getattr(one, quantity).tolist() == getattr(other, quantity).tolist()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["taylor", "taylor20"])
def test_adaptive_interpreted_and_compiled_give_the_same_bits(name: str) -> None:
    asked: dict[str, Any] = {"integrator": name, "angle": 2.0, "velocity": 0.3, "duration": 3.0, "dt": 0.3,
                             "control": 0.5, "rtol": 1e-9}
    one, other = (rollout("lab", **asked, backend=backend) for backend in ("python", "compiled"))
    assert (one.steps, one.rejected) == (other.steps, other.rejected)
    for quantity in ("angle", "velocity", "energy_residual"):
        assert getattr(one, quantity).tolist() == getattr(other, quantity).tolist()


def test_work_and_heat_are_series_too() -> None:
    scene = Scene(effects=(Gravity(), LinearDrag(gamma=0.5), QuadraticDrag(c=0.2)))
    asked: dict[str, Any] = {"angle": 0.0, "velocity": 3.0, "duration": 0.3, "backend": "python",
                             "diagnostics": ("energy", "heat_by_effect")}
    errors = [abs(rollout(scene, integrator="taylor5", dt=dt, **asked).energy_residual[-1]) for dt in (0.05, 0.025)]
    assert math.log2(errors[0] / errors[1]) > 4.85
    fine, other = (rollout(scene, integrator=name, dt=0.01, **asked) for name in ("taylor20", "verner9"))
    for name, heat in fine.heat_by_effect.items():
        assert heat[-1] == pytest.approx(other.heat_by_effect[name][-1], rel=1e-12)
    assert abs(fine.energy_residual[-1]) < 3e-15 * fine.energy[0]


def bumpy(angle: float, time: float, bump_rate: float) -> float:
    return bump_rate * exp(-angle * angle) * log(2.0 + sin(time)) * tanh(angle + time) + helper(angle)


def helper(angle: float) -> float:
    return -power(1.0 + angle * angle, 0.75)


def stepped(angle: float, step_rate: float) -> float:
    return step_rate if angle > 0.0 else -step_rate


@dataclass(frozen=True)
class Bump(Effect):
    """Effect that uses all allowed functions, one through another function."""

    name = "bump"
    kind = "drive"
    equation = "{bump_rate}"
    source = "made up"
    periodic = False
    torque = staticmethod(bumpy)

    def coefficients(self, scene: Scene) -> dict[str, float]:
        return {"bump_rate": 2.0}


@dataclass(frozen=True)
class Stepped(Effect):
    """Effect whose torque contains a branch, which Taylor series cannot record."""

    name = "stepped"
    kind = "drive"
    equation = "{step_rate}"
    source = "made up"
    torque = staticmethod(stepped)

    def coefficients(self, scene: Scene) -> dict[str, float]:
        return {"step_rate": 2.0}


def test_effects_of_ones_own_are_recorded_as_they_are() -> None:
    asked: dict[str, Any] = {"angle": 0.3, "velocity": 0.1, "duration": 1.0, "backend": "python"}
    scene = Scene(effects=(Bump(),))
    ours, theirs = (rollout(scene, integrator=name, dt=0.05, **asked) for name in ("taylor20", "verner9"))
    assert ours.angle == pytest.approx(theirs.angle, abs=1e-13)
    assert ours.ledger.work == pytest.approx(theirs.ledger.work, abs=1e-12)


@pytest.mark.parametrize("order", [4, 9, 16])
def test_the_series_of_a_tanh_has_its_order(order: int) -> None:
    """``v' = -c tanh(v/w)`` is solved by ``sinh(v/w) = sinh(v0/w) exp(-c t/w)``; 60 digits, with c = 2 and w = 1/3."""
    with mpmath.workdps(60):
        c, w, start, end = mpmath.mpf(2), mpmath.mpf(1) / 3, mpmath.mpf(1), mpmath.mpf("0.25")
        truth = w * mpmath.asinh(mpmath.sinh(start / w) * mpmath.exp(-c * end / w))
        errors = [abs(solve(lambda t, q, v: -c * taylor.tanh(v / w), 0 * c, start, [0 * c, end], h=end / count,
                            method=f"taylor{order}").v[-1] - truth) for count in (40, 80)]
        assert float(mpmath.log(errors[0] / errors[1], 2)) == pytest.approx(order, abs=0.3)


def test_friction_with_a_tanh_falls_by_its_closed_form() -> None:
    """``sinh(v/w) = sinh(v0/w) exp(-c t/w)`` without gravity, from far in saturation through rest's neighbourhood."""
    found = Rub()
    run = rollout(Scene(effects=(found,)), integrator="taylor", angle=0.0, velocity=0.4, duration=1.2, dt=0.002,
                  backend="python")
    with mpmath.workdps(30):
        wanted = [float(found.rub_width * mpmath.asinh(
            mpmath.sinh(mpmath.mpf(0.4) / found.rub_width) * mpmath.exp(-found.rub_rate * t / found.rub_width)))
            for t in run.time.tolist()]
    assert run.velocity == pytest.approx(wanted, abs=1e-14)


def test_effects_with_branches_are_refused_by_name() -> None:
    scene = Scene(name="own", effects=(Gravity(), Stepped()))
    assert not {"taylor"} & set(fitting(scene))
    with pytest.raises(MethodError, match=r"which the scene 'own' does not offer; these fit: .*"
                                          r"The torque of stepped has no Taylor series: in it, a comparison cannot"):
        rollout(scene, integrator="taylor", backend="python")


def test_presets_have_a_series() -> None:
    """Except if drag acts in a moving medium, or by a law of C_d without a series at rest."""
    without = {name for name, scene in SCENES.items() if "taylor" not in fitting(scene)}
    assert {"driven", "water", "windy"} <= without
    assert not without & {"textbook", "vacuum", "exercise", "exercise_large", "lab", "sticky_bearing", "overdamped",
                          "chaotic", "kapitza", "clock_bob", "moon"}


# --- dense output: the series itself ----------------------------------------------------------------------------------

ORDERS = ("taylor2", "taylor5", "taylor", "taylor6", "taylor30")


@pytest.mark.parametrize("name", ORDERS)
def test_the_curve_of_a_step_is_the_series(name: str) -> None:
    """On the oscillator: ``q(t) = sum_k q_k t**k`` with the coefficients of the cosine, up to the order; v likewise."""
    order, h = integrators.get(name).order, 0.75
    found = solve(lambda t, q, v: -q, 1.0, 0.0, [0.0, h], method=name, h=1.0, dense=True)
    for t in np.linspace(0.0, h, 9)[1:-1]:
        terms = [(-1) ** (k // 2) * t**k / math.factorial(k) for k in range(order + 1)]
        assert found(t)[0] == pytest.approx(math.fsum(terms[::2]), abs=1e-15)
        assert found(t)[1] == pytest.approx(math.fsum((-1) * t**k / math.factorial(k) * (-1) ** ((k - 1) // 2)
                                                      for k in range(1, order + 1, 2)), abs=1e-15)
    assert found.evaluations == found.steps == 1


@pytest.mark.quick("1e-06-taylor5", "1e-12-taylor30")
@pytest.mark.parametrize("name", ORDERS)
@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12])
def test_dense_output_and_events_meet_the_tolerance(name: str, rtol: float) -> None:
    if integrators.get(name).order < 5 and rtol < 1e-6:
        return  # some ten thousand steps
    found = solve(lambda t, q, v: -q, 1.0, 0.0, [0.0, 3.0], method=name, rtol=rtol, dense=True,
                  events=lambda t, q, v: q)
    times = np.linspace(0.0, 3.0, 301)
    assert np.max(np.hypot(found(times)[0] - np.cos(times), found(times)[1] + np.sin(times))) < 30 * rtol
    assert found.t_events[0] == pytest.approx([math.pi / 2], abs=30 * rtol)
    assert solve(lambda t, q, v: -q, 1.0, 0.0, [0.0, 3.0], method=name, rtol=rtol).evaluations == found.evaluations


@pytest.mark.quick("{'dt': 0.5, 'rtol': 1e-11}-taylor20")
@pytest.mark.parametrize("name", ["taylor", "taylor20"])
@pytest.mark.parametrize("options", [{"dt": 0.05}, {"dt": 0.5, "rtol": 1e-11}], ids=str)
def test_rollouts_have_the_series_as_dense_output_too(name: str, options: dict[str, float]) -> None:
    run = rollout("vacuum", integrator=name, angle=1.0, velocity=0.0, duration=5.0, dense=True, events="turning",
                  backend="python", **options)  # type: ignore[arg-type]
    times = np.linspace(0.0, 5.0, 333)
    angle, velocity = pendulum(times, 1.0, 0.0, SCENES["vacuum"].omega0)
    assert run(times)[0] == pytest.approx(angle, abs=1e-10)
    assert run(times)[1] == pytest.approx(velocity, abs=3e-10)
    half = 2 * float(mpmath.ellipk(mpmath.sin(mpmath.mpf("0.5")) ** 2)) / SCENES["vacuum"].omega0
    assert run.t_events[0] == pytest.approx([half * k for k in range(1, len(run.t_events[0]) + 1)], abs=1e-10)


@pytest.mark.quick("lab")
@pytest.mark.parametrize("scene", ["lab", "chaotic", pytest.param("kapitza", marks=pytest.mark.slow)])
def test_driven_and_damped_rollouts_too(scene: str) -> None:
    run = rollout(scene, integrator="taylor", duration=1.0, dense=True, rtol=1e-10, backend="python")
    truth = rollout(scene, integrator="dop853", duration=1.0, rtol=1e-12, backend="python")
    assert run(truth.time)[0] == pytest.approx(truth.angle, abs=2e-8)


def test_a_rollouts_series_of_few_terms_has_its_order() -> None:
    """The error of the velocity between steps is O(h**5), as at their ends."""
    omega0 = SCENES["vacuum"].omega0
    run = rollout("vacuum", integrator="taylor4", angle=1.0, velocity=0.0, duration=1.0, dt=0.05, dense=True,
                  backend="python")
    times = np.linspace(0.0, 1.0, 333)
    assert run(times)[1] == pytest.approx(pendulum(times, 1.0, 0.0, omega0)[1], abs=omega0 * (0.05 * omega0) ** 5 / 5)


def test_arrays_of_one_component() -> None:
    found = solve(lambda t, q, v: -q, np.array([1.0]), np.array([0.0]), [0.0, 1.0], method="taylor", h=0.1)
    assert found.q[-1] == pytest.approx([math.cos(1)], abs=1e-15)
