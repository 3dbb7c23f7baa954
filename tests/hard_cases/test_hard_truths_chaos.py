"""Reference numbers of chaos, long runs, magnitudes and reversal, computed again without the package."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import exponents
import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import integrators
from pendulum_env.hard_cases import chaos, long_runs, magnitudes, reversal
from pendulum_env.hard_cases.case import ACCURATE, REFUSED, STABLE, WRONG, Case
from pendulum_env.hard_cases.chaos import (
    AMPLIFIED,
    BY_START,
    DOUBLINGS,
    EXPONENTS,
    MOTION,
    QUIET,
    QUIET_STRENGTH,
    Doubling,
)
from pendulum_env.hard_cases.run import CASES

GROUPS = (chaos, long_runs, magnitudes, reversal)
PERIOD = 3.0 * math.pi


def case(name: str) -> Case:
    return next(case for case in CASES if case.name == name)


# --- the driven pendulum, by scipy and by mpmath ---------------------------------------------------------------------


def varied(strength: float, start: Any, times: Any) -> Any:
    """Return the state and its derivatives by both initial values, by Dormand & Prince's method of order 8."""

    def rates(t: float, y: Any) -> list[float]:
        cosine = math.cos(y[0])
        force = strength * math.cos(2.0 * t / 3.0) - 0.5 * y[1] - math.sin(y[0])
        return [y[1], force, y[3], -0.5 * y[3] - cosine * y[2], y[5], -0.5 * y[5] - cosine * y[4]]

    found = solve_ivp(rates, (0.0, times[-1]), [*start, 1, 0, 0, 1], method="DOP853", t_eval=times, rtol=1e-12,
                      atol=1e-13)
    return found.y.T


def multipliers(strength: float, state: tuple[float, float], periods: int) -> tuple[Any, Any]:
    """Return the eigenvalues of the map's derivative, and the distance between the state and its return."""
    end = varied(strength, state, [periods * PERIOD])[-1]
    apart = [math.remainder(end[0] - state[0], 2.0 * math.pi), end[1] - state[1]]
    return np.linalg.eigvals(end[2:].reshape(2, 2).T), np.max(np.abs(apart))


@pytest.mark.parametrize("doubling", DOUBLINGS, ids=lambda doubling: f"{doubling.periods} periods")
def test_the_slope_of_a_doubling_is_that_of_the_orbits_derivatives(doubling: Doubling) -> None:
    """A difference over the drive, at each of two drives from the orbit that Newton's method finds there."""
    sums = []
    for strength in (doubling.strength - 1e-4, doubling.strength + 1e-4):
        state = np.array([doubling.orbit.angle[0], doubling.orbit.velocity[0]])
        for _ in range(3):
            end = varied(strength, state, [doubling.periods * PERIOD])[-1]
            matrix = end[2:].reshape(2, 2).T
            apart = [math.remainder(end[0] - state[0], 2.0 * math.pi), end[1] - state[1]]
            state = state - np.linalg.solve(matrix - np.eye(2), apart)
        sums.append(1.0 + np.trace(matrix) + np.linalg.det(matrix))
    assert (sums[1] - sums[0]) / 2e-4 == pytest.approx(doubling.slope, rel=0.002)


def test_the_motion_at_1_5_by_another_method() -> None:
    times = np.linspace(0.0, 8 * PERIOD, 8 * 48 + 1)
    found = varied(1.5, (0.2, 0.0), times)
    rows = np.column_stack([MOTION.angle, MOTION.velocity, BY_START])
    assert times[::48][1:] == pytest.approx(MOTION[:8].time)
    for i, (row, amplified) in enumerate(zip(rows[:8], AMPLIFIED, strict=False), 1):
        assert found[48 * i, :4] == pytest.approx(row, abs=1e-9 * amplified, rel=1e-6)
    # Derivatives by the start have the determinant exp(-t/2), which gives their inverses.
    matrices = found[:, 2:].reshape(-1, 2, 2).transpose(0, 2, 1)
    adjugates = matrices[:, ::-1, ::-1].transpose(0, 2, 1) * [[1.0, -1.0], [-1.0, 1.0]]
    inverses = adjugates * np.exp(0.5 * times)[:, None, None]
    for i, amplified in enumerate(AMPLIFIED[:4], 1):
        grown = np.linalg.norm(matrices[48 * i] @ inverses[: 48 * i], axis=(1, 2))
        assert np.sum(grown) * PERIOD / 48 == pytest.approx(amplified, rel=1e-3)
    assert np.max(np.abs(found[:, 1])) < chaos.PACE


@pytest.mark.slow
def test_the_motion_at_1_5_in_25_digits() -> None:
    """The state is compared with mpmath's own Taylor series."""
    with mpmath.workdps(25):
        strength, rate = mpmath.mpf("1.5"), mpmath.mpf(2) / 3

        def rates(t: Any, y: Any) -> list[Any]:
            return [y[1], strength * mpmath.cos(rate * t) - y[1] / 2 - mpmath.sin(y[0])]

        motion = mpmath.odefun(rates, 0, [mpmath.mpf(0.2), mpmath.mpf(0)])
        for i in (1, 2):
            angle, velocity = motion(3 * mpmath.pi * i)
            assert float(angle) == MOTION.angle[i - 1]
            assert float(velocity) == MOTION.velocity[i - 1]


@pytest.mark.parametrize("truth", DOUBLINGS, ids=lambda truth: str(truth.periods))
def test_a_multiplier_is_minus_one_where_the_period_doubles(truth: Doubling) -> None:
    found, apart = multipliers(truth.strength, chaos.state_of(truth.orbit), truth.periods)
    assert apart < truth.orbit.error
    assert min(abs(found + 1.0)) < 2e-7
    assert 0.0 <= truth.strength - truth.published < 1e-4


def test_below_the_doublings_neighbours_turn_round_the_orbit() -> None:
    found, apart = multipliers(QUIET_STRENGTH, chaos.state_of(QUIET), 1)
    assert apart < QUIET.error
    assert found.imag.all()
    assert np.log(np.abs(found)) / PERIOD == pytest.approx(-0.25, abs=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize("how", exponents.METHODS)
@pytest.mark.parametrize("strength", EXPONENTS)
def test_the_largest_exponent_as_a_mean_over_an_ensemble(strength: float, how: str) -> None:
    """512 motions by one, and 128 by the other, of the methods that computed the exponents, over 300 periods each."""
    motions = 512 if how == "first variation" else 128
    truth, found = EXPONENTS[strength], exponents.measured(how, strength, motions, 300, settle=40)
    assert found.value == pytest.approx(truth.value, abs=4.0 * math.hypot(found.error, truth.error))
    assert found.error == pytest.approx(truth.spread(300.0) / math.sqrt(motions), rel=0.2)
    assert found.least > 0.0


@pytest.mark.slow
def test_both_ways_to_an_exponent_agree_where_it_is_known() -> None:
    """At a drive of 0.9 all motions end on one orbit, whose exponents are both -1/(2q) = -0.25/s."""
    for how in exponents.METHODS:
        found = exponents.measured(how, QUIET_STRENGTH, 2, 10, settle=12)
        assert found.value == pytest.approx(-0.25, abs=0.02), how


# --- long runs -------------------------------------------------------------------------------------------------------


# |R(iz)|**2 - 1 to leading order: Hairer, Norsett & Wanner 1993, IV.2 and their tables' stability functions.
LOSSES = {
    "forward_euler": lambda z: z**2, "backward_euler": lambda z: -(z**2), "midpoint": lambda z: z**4 / 4,
    "heun": lambda z: z**4 / 4, "kutta3": lambda z: -(z**4) / 12, "rk4": lambda z: -(z**6) / 72,
    "dopri5": lambda z: -(z**6) / 3600, "radau5": lambda z: -(z**6) / 3600,
}


@pytest.mark.parametrize("name", LOSSES)
def test_energy_drifts_in_even_powers(name: str) -> None:
    z, n = long_runs.PRODUCT, 1000
    allowed = long_runs.drift(integrators.get(name), n)
    assert abs(LOSSES[name](z)) * n <= allowed
    assert allowed <= 4000.0 * abs(LOSSES[name](z)) * n


def test_a_method_takes_as_many_steps_as_its_work_allows() -> None:
    steps = {name: long_runs.steps_for(integrators.get(name), long_runs.LONG) for name in integrators.METHODS}
    assert steps["symplectic_euler"] == steps["rk4"] == 10**8
    assert steps["gauss4"] == 10**9 // 60
    assert min(steps.values()) > 5_000_000


# --- liars are caught ------------------------------------------------------------------------------------------------


def liar(name: str, **claims: Any) -> integrators.Method:
    return dataclasses.replace(integrators.get(name), name=f"{name}_claims", **claims)


@pytest.mark.parametrize(("name", "which", "claimed"), [
    ("an honest horizon", "rk4", 8), ("neighbours part", "rk4", 8), ("1e-06 m long", "rk4", None),
])
def test_who_claims_a_higher_order_is_wrong(name: str, which: str, claimed: int | None) -> None:
    method = integrators.get(which)
    assert case(name).tried(method).outcome == ACCURATE
    if claimed is not None:
        assert case(name).tried(liar(which, order=claimed)).outcome == WRONG


def test_who_does_not_retrace_is_not_accurate() -> None:
    name = "there and back, a swing of 2 rad"
    assert case(name).tried(integrators.get("velocity_verlet")).outcome == ACCURATE
    assert case(name).tried(integrators.get("heun")).outcome == STABLE
    assert case(name).tried(liar("heun", order=7)).outcome == WRONG


def test_an_unfit_method_is_refused() -> None:
    assert case("an honest horizon").tried(integrators.get("nystrom4")).outcome == REFUSED


# --- the groups ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("group", GROUPS, ids=lambda group: group.GROUP)
def test_a_group_is_in_the_catalogue_with_its_sources(group: Any) -> None:
    names = {one.name for one in group.CASES}
    assert {one.name for one in CASES if one.group == group.GROUP} == names
    assert all(one.why and one.truth and one.source for one in group.CASES)
    assert all(name in names and method in integrators.METHODS for name, method in getattr(group, "KNOWN", {}))
