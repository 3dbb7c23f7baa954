"""Stability functions, boundaries, oscillation errors and damped growth, against closed forms and mpmath."""

from __future__ import annotations

import math
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from implicit_truths import RATIONAL
from runge_kutta_truths import rounding

from integrators import METHODS, MethodError, Multistep, RungeKutta
from integrators.analysis import (
    amplification,
    leading_error,
    oscillation_errors,
    overdamping_limit,
    spectral_radii,
    spectral_radius,
    stability_boundary,
    stability_function,
    stability_limit,
)

TABLES = [name for name, method in METHODS.items() if isinstance(method, RungeKutta)]
DAMPED = [name for name, method in METHODS.items() if "velocity_free" not in method.needs]
W = np.array([-2.5 + 0j, -0.3 + 1.7j, 0.4 - 2.2j, 1e-3j])


def exponential(w: complex, order: int) -> complex:
    return sum(w**k / math.factorial(k) for k in range(order + 1))


# R in closed form (Hairer & Wanner 1996, IV.2 and IV.3); if stages equal order, R is exp truncated.
CLOSED = {
    **{name: lambda w, p=METHODS[name].order: exponential(w, p)
       for name in ("forward_euler", "midpoint", "heun", "ralston", "kutta3", "ssp_rk3", "rk4", "rk4_38")},
    "backward_euler": lambda w: 1 / (1 - w),
    "implicit_midpoint": lambda w: (1 + w / 2) / (1 - w / 2),
    "discrete_gradient": lambda w: (1 + w / 2) / (1 - w / 2),
    **{name: lambda w, sides=sides: np.divide(*(np.polyval([float(x) for x in side[::-1]], w) for side in sides))
       for name, sides in RATIONAL.items()},
}


@pytest.mark.parametrize("name", CLOSED)
def test_stability_functions(name):
    assert stability_function(name, W) == pytest.approx(np.array([CLOSED[name](w) for w in W]), rel=3e-15)
    assert stability_function(name, W.reshape(2, 2)).shape == (2, 2)


@pytest.mark.parametrize("name", TABLES)
def test_a_stability_function_is_the_steps_eigenvalue(name):
    """On the oscillator at w = i z and -i z the step has the eigenvalues R(w)."""
    eigenvalues = np.linalg.eigvals(amplification(name, 0.8))
    found = stability_function(name, [0.8j, -0.8j])
    assert sorted(found, key=lambda x: x.imag) == pytest.approx(
        sorted(eigenvalues, key=lambda x: x.imag), abs=1e-14 + 2.0 * rounding(METHODS[name], 0.8))


def test_a_pole_is_inf():
    assert stability_function("backward_euler", 1.0) == np.inf
    assert abs(stability_function("lobatto3c", -1e8)) < 1e-14


def test_boundaries():
    """Circles for forward and backward Euler, the imaginary axis for Gauss methods and the trapezoidal rule."""
    assert abs(stability_boundary("forward_euler") + 1.0) == pytest.approx(1.0, abs=1e-14)
    assert abs(stability_boundary("backward_euler") - 1.0) == pytest.approx(1.0, abs=1e-14)
    for name in ("implicit_midpoint", "trapezoid", "gauss4"):
        found = stability_boundary(name, 91)
        kept = found[np.isfinite(found) & (abs(found) < 100.0)]
        assert len(kept) > 80
        assert np.abs(kept.real).max() < 1e-9
    found = stability_boundary("rk4", 5)
    assert found.shape == (5, 4)
    assert np.abs(found - 2j * math.sqrt(2)).min() > 0.0
    ends = stability_boundary("rk4")
    assert ends.real.min() == pytest.approx(-2.785293563405282, abs=1e-6)


@pytest.mark.parametrize("name", TABLES)
def test_on_a_boundary_the_factor_is_one(name):
    found = stability_boundary(name, 37)
    near = found[np.isfinite(found) & (abs(found) < 20.0)]
    assert near.size >= 30
    assert abs(stability_function(name, near)) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("z", [1e-6, 0.01, 0.3, 1.0, 1.9])
def test_errors_of_oscillation_in_closed_form(z):
    """Eigenvalues by hand: Verlet's cosine is 1 - z²/2, Euler's 1 ± i z, the midpoint rule's (1 + iz/2)/(1 - iz/2)."""
    with mpmath.workdps(50):
        w = mpmath.mpf(z)
        turn = mpmath.atan(w) - w
        size = mpmath.sqrt(1 + w * w)
        verlet = 2 * mpmath.asin(w / 2) - w
        found = {"forward_euler": (size - 1, turn), "backward_euler": (1 / size - 1, turn),
                 **dict.fromkeys(("velocity_verlet", "symplectic_euler", "conformal_symplectic_euler"), (0, verlet)),
                 "implicit_midpoint": (0, 2 * mpmath.atan(w / 2) - w)}
        rk4 = sum((1j * w) ** k / mpmath.factorial(k) for k in range(5))
        found["rk4"] = (abs(rk4) - 1, mpmath.arg(rk4 * mpmath.exp(-1j * w)))
        for name, (growth, phase) in found.items():
            assert oscillation_errors(name, z)[0] == pytest.approx(float(growth), rel=3e-16), name
            assert oscillation_errors(name, z)[1] == pytest.approx(float(phase), rel=3e-16), name


@pytest.mark.parametrize("name", METHODS)
def test_for_short_steps_errors_of_oscillation_are_the_leading_ones(name):
    z = 1e-4
    growth, phase = oscillation_errors(name, z)
    leading = leading_error(name)
    for value, term in ((growth, leading.amplitude), (phase, leading.frequency)):
        expected = 0.0 if term is None else float(term.coefficient) * z ** (term.power + 1)
        if abs(expected) > 1e-38:
            assert value == pytest.approx(expected, rel=1e-3)
        else:
            assert abs(value) < 1e-37


def test_beyond_the_limit_steps_no_longer_turn():
    """Verlet at z = 2.5: half the trace is -17/8, the eigenvalues are real, -4 and -1/4."""
    growth, phase = oscillation_errors("velocity_verlet", [[2.0, 2.5]])
    assert growth.tolist() == [[0.0, 3.0]]
    assert phase[0, 0] == pytest.approx(math.pi - 2.0, abs=1e-15)
    assert math.isnan(phase[0, 1])


@pytest.mark.parametrize("name", METHODS)
def test_amplitudes_stay_up_to_the_limit_and_grow_beyond(name):
    limit = stability_limit(name)
    if 0.0 < limit < math.inf:
        beyond = [limit * (1.0 + 10.0**-k) for k in range(4, 10)]
        places = [0.5 * limit, 0.999 * limit, *beyond]
        growth, _ = oscillation_errors(name, places)
        if isinstance(METHODS[name], Multistep):
            growth = np.round(spectral_radii(name, places) - 1.0, 9)
        assert growth[0] <= 0.0
        assert growth[1] <= 0.0
        assert max(growth[2:]) > 0.0, "the gap beyond some limits is narrow"


@pytest.mark.parametrize("name", DAMPED)
def test_damped_growth_is_the_steps_spectral_radius(name):
    z, g = np.array([0.0, 0.1, 0.5, 1.3, 1.3]), np.array([0.7, 0.0, 0.3, 0.9, 4.0])
    found = spectral_radii(name, z, g)
    flows = len(getattr(METHODS[name], "flows", ()))
    summed = 1e-13 * flows + 4.0 * rounding(METHODS[name], 4.0)
    for radius, *at in zip(found, z, g, strict=True):
        assert radius == pytest.approx(spectral_radius(name, *at), rel=1e-14 + summed)
    assert spectral_radii(name, z[:, None], g).shape == (5, 5)
    assert spectral_radii(name, 0.3).shape == ()


def test_damped_growth_in_closed_form():
    """Euler by its eigenvalues 1 + h lambda; conformal Euler by det = exp(-g) while it turns."""
    z, g = np.array([0.5, 0.5, 0.5]), np.array([0.2, 0.9, 2.3])
    root = np.sqrt(g * g / 4 - z * z + 0j)
    sides = np.array([-g / 2 + root, -g / 2 - root])
    assert spectral_radii("forward_euler", z, g) == pytest.approx(np.abs(1 + sides).max(axis=0), rel=1e-15)
    assert spectral_radii("backward_euler", z, g) == pytest.approx(np.abs(1 / (1 - sides)).max(axis=0), rel=1e-15)
    assert spectral_radii("conformal_symplectic_euler", 0.5, 0.2) == pytest.approx(math.exp(-0.1), rel=1e-15)


def test_overflow_counts_as_growth():
    assert spectral_radii("sofroniou_spaletta10", 1e12) == np.inf
    assert overdamping_limit("velocity_verlet", 0.3) == math.inf


def test_what_cannot_be_is_refused():
    for measure in (stability_function, oscillation_errors, spectral_radii):
        with pytest.raises(MethodError, match="did you mean rk4"):
            measure("rk5", 1.0)
    with pytest.raises(MethodError, match=r"velocity_verlet: only Runge-Kutta tables have a stability function"):
        stability_boundary("velocity_verlet")
    for bad in (0.0, -1.0, math.nan, math.inf, [0.1, 200.0]):
        with pytest.raises(MethodError, match="above 0, up to 100"):
            oscillation_errors("rk4", bad)
    with pytest.raises(MethodError, match="needs forces free of the velocity"):
        spectral_radii("okunbor_skeel6", 0.1, 0.1)
    assert spectral_radii("okunbor_skeel6", Fraction(1, 10)) == pytest.approx(1.0, abs=1e-15)
