"""``solve`` on arrays whose components are coupled by the forces: every method's order, and what is refused."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import permutations
from typing import Any

import mpmath
import numpy as np
import pytest
import scipy.linalg

import integrators
from integrators import METHODS, ForceGradient, Method, MethodError, Multistep, System, get, solve, solve_first_order
from integrators.families.splitting import DRIFT, KICK, Splitting

STIFFNESS = np.array([[2.5, -1.5], [-1.5, 3.5]])
"""Two unequal oscillators with a spring between them; the frequencies are irrational."""
TURN = np.array([[0.0, 0.75], [-0.75, 0.0]])
"""Coupling by velocities, like that of the Coriolis force or of a magnetic field."""
Q, V, END = np.array([0.3, -0.4]), np.array([0.25, 0.2]), 2.0


def springs(t: Any, q: Any, v: Any) -> Any:
    return -STIFFNESS @ q


def turning(t: Any, q: Any, v: Any) -> Any:
    return -STIFFNESS @ q + TURN @ v


def henon_heiles(t: Any, q: Any, v: Any) -> Any:
    """Return the acceleration of Hénon & Heiles 1964, Astron. J. 69, 73, with V = (x² + y²)/2 + x² y - y³/3."""
    x, y = q
    return np.array([-x - 2 * x * y, -y - x * x + y * y])


def linear_end(by_velocity: Any) -> Any:
    """Return the exact position at END of the linear problem with the stiffness and this matrix of the velocity."""
    whole = np.block([[np.zeros((2, 2)), np.eye(2)], [-STIFFNESS, by_velocity]])
    return (scipy.linalg.expm(END * whole) @ np.concatenate([Q, V]))[:2]


@cache
def henon_heiles_end() -> Any:
    """Return the position at END from mpmath's Taylor series in 25 digits."""
    with mpmath.workdps(25):
        path = mpmath.odefun(
            lambda t, y: [y[2], y[3], -y[0] - 2 * y[0] * y[1], -y[1] - y[0] ** 2 + y[1] ** 2],
            0, [mpmath.mpf(x) for x in (*Q.tolist(), *V.tolist())])
        return np.array([float(x) for x in path(END)[:2]])


PROBLEMS: dict[str, tuple[Callable[..., Any], Callable[[], Any]]] = {
    "springs": (springs, lambda: linear_end(np.zeros((2, 2)))),
    "turning": (turning, lambda: linear_end(TURN)),
    "Hénon-Heiles": (henon_heiles, henon_heiles_end),
}


def first_steps(method: Method) -> int:
    """Return the number of steps to begin with."""
    if isinstance(method, Multistep):
        return 8 if method.order < 6 else 16
    return 8 if isinstance(method, Splitting) and method.order == 8 else 2


def last_order(name: str, problem: str) -> float:
    """Return the observed order between the last two of several doublings of the number of steps.

    The doublings end at an error at which the order shows but rounding does not yet.
    """
    force, end = PROBLEMS[problem]
    method, truth = METHODS[name], end()
    target = max(10.0 ** -(0.9 * method.order + (2.6 if isinstance(method, Multistep) else 1.2)), 1e-11)
    steps, error = first_steps(method), math.inf
    while steps <= 4096:
        last = error
        error = float(np.max(np.abs(solve(force, Q, V, [0.0, END], method=name, h=END / steps).q[-1] - truth)))
        if error < target and last < math.inf:
            return math.log2(last / error)
        steps *= 2
    pytest.fail(f"{name} does not come within {target:.1g} of the truth; its last error is {error:.2g}")


@pytest.mark.parametrize("problem", ["turning", "Hénon-Heiles", pytest.param("springs", marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", METHODS)
def test_every_method_has_its_order_on_coupled_components(name: str, problem: str) -> None:
    """A formula that takes each component by itself falls by at least one order, mostly to 2."""
    method = METHODS[name]
    if "exact_flow" in method.needs:
        with pytest.raises(MethodError, match="exact needs the motion itself in closed form"):
            solve(PROBLEMS[problem][0], Q, V, [0.0, END], method=name, h=0.1)
    elif problem == "turning" and method.needs & {"velocity_free", "split"}:
        with pytest.raises(MethodError, match=f"{name} needs .*forces free of the velocity"):
            solve(turning, Q, V, [0.0, END], method=name, h=0.1)
    else:
        observed = last_order(name, problem)
        slow_to_show = isinstance(method, Multistep) or method.order > 6
        assert observed > (0.75 * method.order if slow_to_show else method.order - 0.7)


def test_the_force_gradient_of_a_coupled_force_is_the_matrix_times_the_force() -> None:
    """One step of chin4a, with the matrix of derivatives written out."""
    h = 0.25

    def kick(b: float, c: float) -> Any:
        x, y = q
        f = henon_heiles(0.0, q, v)
        matrix = np.array([[-1 - 2 * y, -2 * x], [-2 * x, -1 + 2 * y]])
        return v + b * h * (f + c * h * h * matrix @ f)

    q, v = Q, V
    for kind, b, c in ((KICK, 1 / 6, 0), (DRIFT, 1 / 2, 0), (KICK, 2 / 3, 1 / 24), (DRIFT, 1 / 2, 0), (KICK, 1 / 6, 0)):
        q, v = (q + b * h * v, v) if kind == DRIFT else (q, kick(b, c))
    for compensated in (False, True):
        found = solve(henon_heiles, Q, V, [0.0, h], method="chin4a", h=h, compensated=compensated)
        assert found.q[-1] == pytest.approx(q, abs=1e-13)
        assert found.v[-1] == pytest.approx(v, abs=1e-13)


def test_the_force_gradient_of_independent_components_is_that_of_each() -> None:
    for given in (lambda t, q, v: -np.sin(q), System(lambda t, q, v: -np.sin(q), velocity_free=True,
                                                     jacobian=lambda t, q, v: (-np.cos(q), 0.0 * q))):
        many = solve(given, np.array([2.0, 0.0, 1e-6]), np.zeros(3), [0.0, 3.0], method="chin4a", h=0.1)
        for i, start in enumerate((2.0, 0.0, 1e-6)):
            one = solve(given, start, 0.0, [0.0, 3.0], method="chin4a", h=0.1)
            assert many.q[-1, i] == one.q[-1]
            assert many.evaluations == one.evaluations


# --- the discrete gradient and its other names ------------------------------------------------------------------------


def test_the_discrete_gradient_of_coupled_components_is_the_average_vector_field() -> None:
    """Simpson's rule is the exact mean of these quadratic forces on the way from q to q1."""
    h = 0.2
    end = Q
    for _ in range(200):
        mean = sum(w * henon_heiles(0.0, Q + s * (end - Q), V) for s, w in ((0.0, 1 / 6), (0.5, 2 / 3), (1.0, 1 / 6)))
        end = Q + h * V + h * h / 2 * mean
    for name in ("discrete_gradient", "average_vector_field"):
        found = solve(henon_heiles, Q, V, [0.0, h], method=name, h=h)
        assert found.q[-1] == pytest.approx(end, abs=1e-14)


OTHERS = ("gonzalez", "itoh_abe")


def sometimes(t: Any, q: Any, v: Any) -> Any:
    return -q - max(0.0, 0.3 - abs(t - 1.0)) * q[::-1]


COUPLED: dict[str, tuple[Callable[..., Any], Any]] = {
    "springs": (springs, Q),
    "one way, of seven": (lambda t, q, v: -q + np.eye(7)[6] * q[2], np.ones(7)),
    "velocities": (lambda t, q, v: -q + 0.1 * v[::-1], Q),
    "rows": (lambda t, q, v: -q - 0.1 * q[:, ::-1], np.ones((3, 2))),
    "sometimes": (sometimes, Q),
    "not at zero": (lambda t, q, v: -q - np.prod(q), np.zeros(3)),
    "only where it does not fail": (lambda t, q, v: -q - math.sqrt(1.2 - np.sum(q * q)), Q),
}


@pytest.mark.parametrize("problem", COUPLED)
@pytest.mark.parametrize("name", OTHERS)
def test_names_of_other_methods_of_several_freedoms_are_refused(name: str, problem: str) -> None:
    force, q = COUPLED[problem]
    message = (f"{name} is defined here for one degree of freedom, or an array of independent ones, and this "
               "acceleration couples components of q; use another method, such as discrete_gradient")
    for given in (force, System(force, mean_acceleration=lambda *_: 0, mean_jacobian=lambda *_: (0, 0))):
        with pytest.raises(MethodError, match=message):
            solve(given, q, 0.0 * q, [0.0, 2.0], method=name, h=0.1)


def test_every_coupling_of_two_components_is_found() -> None:
    for i, j in permutations(range(5), 2):
        with pytest.raises(MethodError, match="couples components of q"):
            solve(lambda t, q, v, i=i, j=j: -q - np.eye(5)[i] * q[j], np.ones(5), np.zeros(5), [0.0, 1.0],
                  method="gonzalez", h=0.1)


@pytest.mark.parametrize("name", OTHERS)
def test_names_of_one_freedom_take_numbers_and_independent_components(name: str) -> None:
    for q in (0.5, np.array(0.5), np.array([0.5]), np.array([0.5, 1.5, -2.5]), np.ones((2, 2))):
        found, wanted = (solve(lambda t, q, v: -np.sin(q), q, 0.0 * q, [0.0, 1.0], method=method, h=0.25).q
                         for method in (name, "discrete_gradient"))
        assert np.array_equal(found, wanted)
    found = solve(lambda t, q, v: -9.8, np.ones(2), np.zeros(2), [0.0, 1.0], method=name, h=0.25)
    assert found.q[-1] == pytest.approx([1.0 - 4.9] * 2)


def test_an_explicit_method_of_ones_own_with_derivatives_is_for_one_freedom() -> None:
    """Unless its class says otherwise, as that of chin4a does."""

    @dataclass(frozen=True, kw_only=True)
    class Elementwise(ForceGradient):
        one_freedom = Method.one_freedom

    chin = integrators.get("chin4a")
    assert isinstance(chin, ForceGradient)
    own = Elementwise(name="own", order=4, source="made up", summary="made up", flows=chin.flows)
    assert solve(lambda t, q, v: -q, Q, V, [0.0, 1.0], method=own, h=0.1).q[-1] == pytest.approx(
        math.cos(1.0) * Q + math.sin(1.0) * V, abs=1e-5)
    with pytest.raises(MethodError, match=r"own is defined here for one degree of freedom, .* such as rk4\."):
        solve(springs, Q, V, [0.0, 1.0], method=own, h=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["radau5", "sdirk4", "gauss4", "backward_euler", "bdf2", "discrete_gradient"])
def test_stiff_arrays_come_to_rest(method: str) -> None:
    """At rest the force is the rounding of its terms, and the equation of a stage has no solution but for that.

    The equations have the closed forms 1 - exp(-1000 t) and, for q, 1 - exp(-1000 t) (1 + 1000 t).
    """
    control = {"rtol": 1e-6} if method in ("radau5", "sdirk4") else {"h": 0.02}
    moved = solve(lambda t, q, v: -1e6*(q - 1.0) - 2e3*v, np.zeros(2), np.zeros(2), [0.0, 3.0], method=method,
                  **control)
    assert np.allclose(moved.q[-1], 1.0, rtol=0.0, atol=1e-6 if "rtol" in control else 1e-9)
    assert moved.steps < 500
    if get(method).first_order_form:
        settled = solve_first_order(lambda t, y: -1e3*(y - 1.0), [0.0, 3.0], np.zeros(2), method=method, **control)
        assert np.allclose(settled.y[:, -1], 1.0, rtol=0.0, atol=1e-9)
        assert settled.steps < 500
