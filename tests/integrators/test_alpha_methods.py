"""The alpha methods of structural dynamics against their published formulas, solved here in 40 digits."""

from __future__ import annotations

from typing import Any

import mpmath
import pytest

from integrators import System, solve

# The parameters as published: alpha = -1/10 of Hilber, Hughes & Taylor 1977, equation 2 with gamma and beta of
# equation 7; a spectral radius of 4/5 at infinity in Chung & Hulbert 1993, equations 17 and 25.
# Columns: alpha_m, alpha_f, beta, gamma.
PARAMETERS = {
    "hht_alpha": ("0", "1/10", "121/400", "3/5"),
    "generalized_alpha": ("1/3", "4/9", "25/81", "11/18"),
}
STEPS = 6
KINDS = ("hht", "generalized")


def force(t: Any, q: Any, v: Any) -> Any:
    """A pendulum with quadratic drag and a driving torque."""
    return -mpmath.sin(q) - mpmath.mpf("0.3") * abs(v) * v + mpmath.mpf("0.7") * mpmath.cos(2 * t)


def spring(t: Any, q: Any, v: Any) -> Any:
    """A linear force that does not depend on time."""
    return -2 * q - mpmath.mpf("0.3") * v


def slopes(acceleration: Any) -> Any:
    """The derivatives of a force by q and by v."""
    if acceleration is spring:
        return lambda t, q, v: (mpmath.mpf(-2), mpmath.mpf("-0.3"))
    return lambda t, q, v: (-mpmath.cos(q), -mpmath.mpf("0.6") * abs(v))


def published(name: str, acceleration: Any, q: Any, v: Any, h: Any, mean_force: bool) -> list[tuple[Any, Any]]:
    """Return the states of steps whose equation is solved for the new acceleration by the secant method."""
    alpha_m, alpha_f, beta, gamma = (mpmath.mpf(mpmath.mpmathify(x)) for x in PARAMETERS[name])
    t, states = mpmath.mpf(1), [(q, v)]
    a = acceleration(t, q, v)
    for _ in range(STEPS):
        def moved(new: Any, q: Any = q, v: Any = v, a: Any = a) -> tuple[Any, Any]:
            place = q + h * v + h**2 * ((mpmath.mpf(1) / 2 - beta) * a + beta * new)
            return place, v + h * ((1 - gamma) * a + gamma * new)

        def left_over(new: Any, t: Any = t, q: Any = q, v: Any = v, a: Any = a, moved: Any = moved) -> Any:
            q1, v1 = moved(new)
            if mean_force:
                right = (1 - alpha_f) * acceleration(t + h, q1, v1) + alpha_f * acceleration(t, q, v)
            else:
                middle = ((1 - alpha_f) * new + alpha_f * old for new, old in ((t + h, t), (q1, q), (v1, v)))
                right = acceleration(*middle)
            return (1 - alpha_m) * new + alpha_m * a - right

        a = mpmath.findroot(left_over, (a, a + mpmath.mpf("0.01")), solver="secant", tol=mpmath.mpf(10) ** -80)
        q, v = moved(a)
        t += h
        states.append((q, v))
    return states


def run(method: str, acceleration: Any, q: Any, v: Any, h: Any) -> list[tuple[Any, Any]]:
    """Return the states of the package's steps."""
    times = [1 + i * h for i in range(STEPS + 1)]
    # A limit of the step just above h keeps rounding from dividing a step into two.
    made = solve(System(acceleration, jacobian=slopes(acceleration)), q, v, times, method=method,
                 h=h * (1 + mpmath.mpf("1e-30")))
    return list(zip(made.q, made.v, strict=True))


def apart(some: list[tuple[Any, Any]], others: list[tuple[Any, Any]]) -> Any:
    """Return the largest difference of two motions."""
    return max(abs(x - y) for one, other in zip(some, others, strict=True) for x, y in zip(one, other, strict=True))


@pytest.mark.parametrize("kind", KINDS)
def test_steps_are_those_of_the_published_equation(kind: str) -> None:
    """Each kind obeys its own equation to 36 digits, and not that of the other kind."""
    name = f"{kind}_alpha"
    with mpmath.workdps(40):
        start = mpmath.mpf("0.5"), mpmath.mpf(1), mpmath.mpf(1) / 16
        for acceleration in (force, spring):
            place, mean = (published(name, acceleration, *start, kind) for kind in (False, True))
            assert apart(run(name, acceleration, *start), place) < mpmath.mpf("1e-36")
            assert apart(run(f"{name}_mean_force", acceleration, *start), mean) < mpmath.mpf("1e-36")
            if acceleration is spring:
                assert apart(place, mean) < mpmath.mpf("1e-36"), "linear forces: the two are one method"
            else:
                assert apart(place, mean) > mpmath.mpf("1e-6")


@pytest.mark.parametrize("kind", KINDS)
def test_floats_take_the_steps_of_40_digits(kind: str) -> None:
    name = f"{kind}_alpha"
    start = mpmath.mpf("0.5"), mpmath.mpf(1), mpmath.mpf(1) / 16
    with mpmath.workdps(40):
        truth = published(name, force, *start, True)
    floats = System(lambda t, q, v: float(force(t, q, v)),
                    jacobian=lambda t, q, v: tuple(map(float, slopes(force)(t, q, v))))
    for compensated in (False, True):
        made = solve(floats, 0.5, 1.0, [1.0 + i / 16 for i in range(STEPS + 1)], method=f"{name}_mean_force", h=1 / 16,
                     compensated=compensated)
        assert max(abs(made.q[i] - q) for i, (q, _) in enumerate(truth)) < 2e-15
        assert max(abs(made.v[i] - v) for i, (_, v) in enumerate(truth)) < 4e-15
