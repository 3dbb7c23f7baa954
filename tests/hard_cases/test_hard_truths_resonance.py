"""Reference numbers of the hard cases of resonance, against mpmath with its own products and equations."""

from __future__ import annotations

import math
from typing import Any

import mpmath
import numpy as np
import pytest

from integrators import METHODS, Splitting
from pendulum_env.hard_cases import resonance

SPLITTINGS = [name for name, method in METHODS.items() if isinstance(method, Splitting)]


def product(name: str, z: Any) -> Any:
    """Return the matrix of a splitting's step on the oscillator, as the product of its kicks and drifts."""
    matrix = mpmath.eye(2)
    for kind, part in METHODS[name].flows:
        share = z * part.numerator / part.denominator
        if kind == "drift":
            matrix = mpmath.matrix([[1, share], [0, 1]]) * matrix
        elif kind != "drag":
            matrix = mpmath.matrix([[1, 0], [-share, 1]]) * matrix
    return matrix


@pytest.mark.parametrize("name", SPLITTINGS)
def test_matrices_of_splittings_are_the_products_of_their_flows(name: str) -> None:
    for z, _ in resonance.TUNED:
        found = resonance.matrix_of(METHODS[name], z)
        assert found is not None
        matrix, error = found
        assert error < 1e-6 or np.max(np.abs(matrix)) > 1e3
        with mpmath.workdps(40):
            exact = product(name, mpmath.mpf(z))
            assert abs(mpmath.det(exact) - 1) < 1e-35 * (1.0 + np.max(np.abs(matrix))) ** 2
            off = max(abs(matrix[i, k] - exact[i, k]) for i in range(2) for k in range(2))
        assert off < error * (1.0 + np.max(np.abs(matrix)))


@pytest.mark.parametrize(("name", "z", "beyond"), [
    ("sofroniou_spaletta10", 3.1414622174809062, 7.24003788854e-8),
    ("blanes_moan_srkn11b", 3.1418755205418921, 9.86304548997e-8),
    ("blanes_moan_srkn14a", 3.1415189476514472, 1.7639971376e-7),
    ("kahan_li8", 3.1183075382609178, 2.57870298049e-4),
    ("blanes_moan_srkn6b", 3.1660014411024739, 2.85295587175e-6),
])
def test_the_trace_passes_minus_two_in_a_narrow_band(name: str, z: float, beyond: float) -> None:
    """The largest value of -1 - trace/2 next to half a period; the products of the cases lie within the bands."""
    def half_trace(x: Any) -> Any:
        matrix = product(name, x)
        return (matrix[0, 0] + matrix[1, 1]) / 2

    with mpmath.workdps(40):
        largest = mpmath.findroot(lambda x: mpmath.diff(half_trace, x), mpmath.mpf(z))
        assert abs(largest - z) < 1e-9
        assert -1 - half_trace(largest) == pytest.approx(beyond, rel=1e-9)
        inside = [tuned for tuned, _ in resonance.TUNED if half_trace(mpmath.mpf(tuned)) < -1]
        assert inside
        grown = max(mpmath.acosh(-half_trace(mpmath.mpf(tuned))) * resonance.SOME for tuned in inside)
    assert grown > 0.4


def test_matrices_of_runge_kutta_methods_have_published_eigenvalues() -> None:
    """The exponential series cut off after the order; 1/(1 - iz); the midpoint rule's Padé approximation."""
    z = resonance.TUNED[0][0]
    cut = {"forward_euler": 1, "heun": 2, "kutta3": 3, "rk4": 4}
    wanted = {name: sum((1j * z) ** k / math.factorial(k) for k in range(order + 1)) for name, order in cut.items()}
    wanted |= {"backward_euler": 1 / (1 - 1j * z), "implicit_midpoint": (1 + 0.5j * z) / (1 - 0.5j * z)}
    for name, value in wanted.items():
        found = resonance.matrix_of(METHODS[name], z)
        assert found is not None
        values = np.linalg.eigvals(found[0])
        assert min(abs(values - value)) < 1e-12, name


def test_the_forced_oscillation_has_the_textbook_amplitude_and_lag() -> None:
    """``F/sqrt((1 - W²)² + (c W)²)`` and ``atan2(c W, 1 - W²)`` for W = 2."""
    with mpmath.workdps(30):
        loss, push = mpmath.mpf(resonance.LOSS), mpmath.mpf(resonance.PUSH)
        size, lag = push / mpmath.sqrt(9 + 4 * loss * loss), mpmath.atan2(2 * loss, -3)
        times = np.array([0.0, 1.0, 2.5, 1e5])
        for t, q, v in zip(times, *resonance.steady(times), strict=True):
            assert abs(q - size * mpmath.cos(2 * mpmath.mpf(t) - lag)) < 1e-16
            assert abs(v + 2 * size * mpmath.sin(2 * mpmath.mpf(t) - lag)) < 1e-16


@pytest.mark.slow
def test_the_exponent_of_parametric_resonance() -> None:
    """By Taylor series of ``y'' + (1 - 4 b cos 2t) y = 0`` over a period, in 30 digits."""
    with mpmath.workdps(30):
        b = mpmath.mpf("6e-5")
        motion = mpmath.odefun(lambda t, y: [y[1], -(1 - 4 * b * mpmath.cos(2 * t)) * y[0]], 0, [1, 0])
        assert abs(mpmath.acosh(-motion(mpmath.pi)[0]) / resonance.EXPONENT - 1) < 1e-15
        assert abs(resonance.EXPONENT / (mpmath.pi * b) - 1) < 1e-8


def test_resonance_reaches_as_far_as_the_bound_says() -> None:
    """The rate sqrt(s² - d²) of a swing whose frequency is off by d, beside the bound of the relative error."""
    time = resonance.CYCLES * math.pi
    for name in ("rk4", "gauss4", "dop853", "kahan_li8"):
        off, s = resonance.detuned(METHODS[name]), resonance.SHAKEN
        lost = (s - math.sqrt(s * s - off * off)) * time if off < s else math.inf
        assert lost <= resonance.parametric_error(METHODS[name]), name
