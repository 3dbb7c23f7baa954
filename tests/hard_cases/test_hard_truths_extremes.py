"""Reference numbers of the hard cases of extreme numbers, against mpmath with its own equations."""

from __future__ import annotations

from typing import Any

import hard_truths
import mpmath
import pytest

from pendulum_env.hard_cases import extremes as extreme
from pendulum_env.hard_cases.predicted import TRUTHS, stored

DRAGS: dict[str, Any] = {
    "no damping": lambda v: 0,
    "linear drag": lambda v: -v / 2,
    "quadratic drag": lambda v: -mpmath.mpf(3) / 10 * abs(v) * v,
    "both drags": lambda v: -v / 2 - mpmath.mpf(3) / 10 * abs(v) * v,
    "a bearing's friction": lambda v: -v / 2,
    # A sphere of 4 cm and 10 g, and a rod of 1 m and 2 mm across, in air of 1.2 kg/m³ and 1.8e-5 Pa s.
    "a sphere's drag": lambda v: -drag_of_sphere(v) / mpmath.mpf("0.01"),
    "a wire's drag": lambda v: -drag_of_rod(v) / mpmath.mpf("0.01"),
}


def drag_of_sphere(v: Any) -> Any:
    """Return ``C_d rho/2 pi a² v²`` with C_d = 24/Re (1 + 0.15 Re^0.687)."""
    if not v:
        return mpmath.mpf(0)
    reynolds = mpmath.mpf("1.2") * abs(v) * mpmath.mpf("0.04") / mpmath.mpf("1.8e-5")
    coefficient = 24 / reynolds * (1 + mpmath.mpf("0.15") * reynolds ** mpmath.mpf("0.687"))
    return coefficient * mpmath.mpf("0.6") * mpmath.pi * mpmath.mpf("0.02") ** 2 * abs(v) * v


def drag_of_rod(v: Any) -> Any:
    """Return the integral over s of ``s C_d rho/2 d (s v)²`` with C_d = 1 + 10 (s v d/nu)^(-2/3)."""
    density, thickness, nu = mpmath.mpf("1.2"), mpmath.mpf("0.002"), mpmath.mpf("1.8e-5") / mpmath.mpf("1.2")
    if not v:
        return mpmath.mpf(0)
    skin = 10 * (abs(v) * thickness / nu) ** (-mpmath.mpf(2) / 3)
    # The integrals of s³ and s^(7/3) over the length of 1 m are 1/4 and 3/10.
    return density / 2 * thickness * abs(v) * v * (mpmath.mpf(1) / 4 + skin * mpmath.mpf(3) / 10)


def test_distances_from_the_top_and_from_a_million_turns() -> None:
    with mpmath.workdps(50):
        assert float(mpmath.pi - float(mpmath.pi)) == extreme.GAP
        assert float(extreme.WOUND - 2 * 10**6 * mpmath.pi) == extreme.BEYOND


@pytest.mark.parametrize("push", extreme.PUSHES)
@pytest.mark.parametrize("name", ["no damping", "linear drag"])
def test_a_small_tilt_is_the_sum_of_two_exponentials(name: str, push: float) -> None:
    """``y'' = omega0² y - gamma y'`` while the tilt is below 1e-7 rad, where sin(y) = y to 1e-15."""
    tilt, rate = hard_truths.tilts(name, push, 300, 20)
    with mpmath.workdps(50):
        omega, gap = mpmath.sqrt(mpmath.mpf(9.81)), mpmath.pi - float(mpmath.pi)
        half = 0 if name == "no damping" else mpmath.mpf(1) / 4
        root = mpmath.sqrt(half * half + omega * omega)
        for k, (y, v) in enumerate(zip(tilt.tolist(), rate.tolist(), strict=True)):
            t = mpmath.mpf(20 * k) / 10 / omega
            start, slope = gap, -mpmath.mpf(push)
            wave = (slope + half * start) / root
            exact = mpmath.exp(-half * t) * (start * mpmath.cosh(root * t) + wave * mpmath.sinh(root * t))
            speed = mpmath.exp(-half * t) * (
                start * root * mpmath.sinh(root * t) + wave * root * mpmath.cosh(root * t)) - half * exact
            if abs(exact) < 1e-7:
                size = abs(exact) + abs(speed) / omega
                assert abs(y * extreme.GAP - exact) < 1e-11 * size
                assert abs(v * extreme.GAP - speed / omega) < 1e-11 * size


@pytest.mark.slow
@pytest.mark.parametrize("name", extreme.DAMPINGS)
def test_a_tilt_that_grows_obeys_the_equation_with_its_drag(name: str) -> None:
    """From a tilt of about 1e-4 rad on, by Taylor series in 20 digits."""
    assert DRAGS.keys() == extreme.DAMPINGS.keys()
    tilt, rate = hard_truths.tilts(name, extreme.PUSHES[0], 340, 20)
    first = next(k for k, y in enumerate(tilt) if abs(y) * extreme.GAP > 1e-4)
    with mpmath.workdps(20):
        omega = mpmath.sqrt(mpmath.mpf(9.81))
        start = [mpmath.mpf(tilt[first]) * extreme.GAP, mpmath.mpf(rate[first]) * extreme.GAP * omega]
        motion = mpmath.odefun(lambda t, y: [y[1], mpmath.mpf(9.81) * mpmath.sin(y[0]) + DRAGS[name](y[1])], 0, start)
        y, v = motion(mpmath.mpf(20 * (len(tilt) - 1 - first)) / 10 / omega)
        assert abs(tilt[-1] * extreme.GAP / y - 1) < 1e-11
        assert abs(rate[-1] * extreme.GAP * omega / v - 1) < 1e-11


@pytest.mark.quick("both drags-1e-15")
@pytest.mark.parametrize("push", extreme.PUSHES)
@pytest.mark.parametrize("name", extreme.DAMPINGS)
def test_the_stored_tilts_are_those_of_the_equation(name: str, push: float) -> None:
    kept, found = stored(TRUTHS)[f"pushed at the top, {name}, {push:g} rad/s"], hard_truths.fallen(name, push)
    for values, others in zip(kept, found, strict=True):
        assert values == pytest.approx(others[1:].tolist(), rel=1e-11)
    assert 0.01 < abs(kept[0][-1]) * extreme.GAP < 0.5
