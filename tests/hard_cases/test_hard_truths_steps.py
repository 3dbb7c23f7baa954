"""Reference numbers of the hard cases of long steps and stiff damping, against mpmath, scipy and explicit maps."""

from __future__ import annotations

import math
from dataclasses import replace

import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from step_limit_truths import OSCILLATOR_LIMIT, drag_limit, oscillator_limit, regains

from integrators import METHODS
from pendulum_env.hard_cases import case as case_module
from pendulum_env.hard_cases import step_limits as steps
from pendulum_env.hard_cases import stiff_damping as stiff
from pendulum_env.hard_cases.run import MOTIONS
from pendulum_env.physics import exact
from pendulum_env.physics.energy import beyond_sense
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.reference import reference

TIMES = stiff.STEP * np.array([0, 1, 2, 20, 100])
DAMPED = [name for name, method in METHODS.items() if "velocity_free" not in method.needs]


# --- growth ---------------------------------------------------------------------------------------------------------


# Eigenvalues on the oscillator: R(i z) is the truncated exponential if stages equal order, 1/(1 - i z) for backward
# Euler, of modulus 1 for the midpoint rule (Hairer & Wanner 1996, IV.2, IV.3); a step that preserves areas has the
# phase cos(phi) = 1 - z²/2 (Hairer, Lubich & Wanner 2006, I.5.2).
CUT_OFF = {"forward_euler": 1, "midpoint": 2, "heun": 2, "ralston": 2, "kutta3": 3, "ssp_rk3": 3, "rk4": 4, "rk4_38": 4}


@pytest.mark.quick("0.5", "2.01", "10.0")
@pytest.mark.parametrize("product", [*steps.PRODUCTS, steps.PERIODS])
def test_amplitudes_grow_as_published_eigenvalues_say(product: float) -> None:
    with mpmath.workdps(40):
        z = mpmath.mpf(product)
        logs = {name: mpmath.log(abs(sum((1j * z) ** k / mpmath.factorial(k) for k in range(order + 1))))
                for name, order in CUT_OFF.items()}
        turning = mpmath.acosh(abs(1 - z * z / 2)) if z > 2 else 0
        logs |= {"backward_euler": -mpmath.log(1 + z * z) / 2, "implicit_midpoint": 0, "discrete_gradient": 0,
                 "velocity_verlet": turning, "symplectic_euler": turning}
        wanted = {name: float(steps.STEPS * log) for name, log in logs.items()}
    for name, value in wanted.items():
        assert steps.growth(METHODS[name], product) == pytest.approx(value, rel=1e-9, abs=1e-9), name
    below = [name for name in METHODS if product <= oscillator_limit(name)]
    assert {"backward_euler", "implicit_midpoint", "gauss4", "radau5"} <= {*below}
    assert product > 2.0 or {"velocity_verlet", "rk4"} <= {*below}
    assert all(steps.growth(METHODS[name], product) < 1e-6 for name in below)
    if product >= 10.0:
        grown = {name for name, method in METHODS.items() if steps.growth(method, product) > 0.0}
        assert all(regains(name) for name in {*METHODS} - grown - {*below}), "others grow far beyond their limits"


@pytest.mark.parametrize("load", stiff.LINEAR_LOADS)
def test_drag_grows_where_published_limits_say_so(load: float) -> None:
    """Under drag alone, for methods without backward sub-steps, in which drag amplifies without a limit."""
    for name in DAMPED:
        if not stiff.backwards(METHODS[name]):
            grown = steps.growth(METHODS[name], 0.0, stiff.STEPS, load)
            assert (grown > 1e-9) == (load > drag_limit(name)), name


def test_what_leaves_all_sense() -> None:
    """At an amplitude of GONE the ledger's rule for divergence applies, for small angles and for the start at 1e4/s."""
    scene, start = steps.LINEAR, steps.START
    scale, half = scene.gravity * scene.weight_moment, 0.5 * scene.inertia * scene.omega0**2
    assert scale == pytest.approx(scene.inertia * scene.omega0**2)
    for size, beyond in ((1.0 - 1e-6, False), (1.0 + 1e-6, True)):
        end = (size * start * math.exp(steps.GONE)) ** 2
        assert beyond_sense(half * (end - start**2), scale, half * start**2, 0.0) == beyond
        energy = 0.5 * stiff.FAST**2
        assert beyond_sense(energy * (size * math.exp(stiff.GONE)) ** 2 - energy, 0.0, energy, 0.0) == beyond


@pytest.mark.parametrize("z", [0.5, 1.0, 1.99])
def test_a_bounded_amplitude_varies_as_its_invariant_says(z: float) -> None:
    """Symplectic Euler conserves q² - z q p + p² (Hairer, Lubich & Wanner 2006, I.5)."""
    wanted = math.sqrt((1.0 + 0.5 * z) / (1.0 - 0.5 * z))
    assert steps.spread(METHODS["symplectic_euler"], z) == pytest.approx(wanted, rel=1e-9)
    assert steps.spread(METHODS["rk4"], z) == pytest.approx(1.0, rel=1e-9)


def test_when_growth_leaves_all_sense() -> None:
    """Forward Euler's amplitude grows by sqrt(1 + z²) per step; Verlet's growing part beyond z = 2 may start small."""
    euler = math.ceil(steps.GONE / math.log(math.hypot(1.0, 0.5)))
    late = [steps.in_time(METHODS["forward_euler"], 0.5, count) for count in (euler - 2, euler, euler + 2)]
    assert late == [False, True, False]
    assert not steps.in_time(METHODS["velocity_verlet"], 2.01, 1)
    assert steps.in_time(METHODS["velocity_verlet"], 2.01, 500)


# --- the standard map -----------------------------------------------------------------------------------------------


def fastest(angle: float, k: float, count: int) -> float:
    """Return the largest |p| of the standard map p' = p - k sin q, q' = q + p' from rest."""
    q, p, most = angle, 0.0, 0.0
    for _ in range(count):
        p -= k * math.sin(q)
        q = (q + p) % (2.0 * math.pi)
        most = max(most, abs(p))
    return most


def test_the_standard_map_is_bounded_below_its_last_circle_and_not_above() -> None:
    """From 1.5 rad at K = 2.25 the map reaches |v| = 200 rad/s, beyond the ledger's limit of divergence."""
    energy = 1.0 - math.cos(1.5)
    sense = 1.5 * math.sqrt(2.0 * (100.0 * (1.0 + energy) + energy))
    assert fastest(3.0, steps.GREENE * 0.994**2, 100_000) < 2.0 * math.pi
    assert fastest(1.5, 2.25, 20_000) > 1.5 * 200.0 / steps.FULL.omega0 > sense


def test_kinds_of_methods() -> None:
    def chosen(kind) -> set[str]:  # type: ignore[no-untyped-def]
        return {name for name in OSCILLATOR_LIMIT if kind(METHODS[name])}

    assert chosen(steps.is_standard_map) == {
        "symplectic_euler", "symplectic_euler_position_first", "conformal_symplectic_euler", "velocity_verlet"}
    assert chosen(lambda method: method.keeps_energy) == {"discrete_gradient", "exact"}
    assert chosen(lambda method: method.explicit_first_stage) == {
        "trapezoid", "newmark_linear", "hht_alpha", "generalized_alpha", "hht_alpha_mean_force",
        "generalized_alpha_mean_force"}


# --- stiff damping --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("load", stiff.LINEAR_LOADS)
def test_the_damped_oscillator(load: float) -> None:
    gamma, omega0 = load / stiff.STEP, stiff.linear_scene(load).omega0
    angle, velocity = exact.linear(TIMES, stiff.ANGLE, stiff.FAST, omega0, gamma)
    with mpmath.workdps(40):
        half = mpmath.mpf(gamma) / 2
        root = mpmath.sqrt(half**2 - mpmath.mpf(omega0) ** 2)
        fast, slow = -half - root, -mpmath.mpf(omega0) ** 2 / (half + root)
        b = (stiff.FAST - slow * stiff.ANGLE) / (fast - slow)
        a = stiff.ANGLE - b
        for i, t in enumerate(map(mpmath.mpf, TIMES)):
            parts = a * mpmath.exp(slow * t), b * mpmath.exp(fast * t)
            assert angle[i] == pytest.approx(float(sum(parts)), rel=1e-13)
            assert velocity[i] == pytest.approx(float(slow * parts[0] + fast * parts[1]), rel=1e-12)


@pytest.mark.quick("1000.0")
@pytest.mark.parametrize("load", stiff.LOADS)
def test_quadratic_drag_alone(load: float) -> None:
    """c t = 1/v - 1/v0 is the integral of dv/v², and c times the distance that of dv/v, by mpmath's quadrature."""
    c = load / (stiff.FAST * stiff.STEP)
    way, velocity = exact.drag_only(TIMES, stiff.FAST, 0.0, c)
    with mpmath.workdps(30):
        for i, t in enumerate(TIMES):
            span = mpmath.log(mpmath.mpf(velocity[i])), mpmath.log(stiff.FAST)
            passed = mpmath.quad(lambda x: mpmath.exp(-x), mpmath.linspace(*span, 9)) / c
            assert float(passed) == pytest.approx(t, rel=1e-12, abs=1e-16)
            assert way[i] == pytest.approx(float((span[1] - span[0]) / c), rel=1e-12, abs=1e-16)


@pytest.mark.parametrize("stiffness", [row[0] for row in stiff.CREEPS])
def test_the_slow_manifold(stiffness: float) -> None:
    """The formula solves theta' = -sin(theta); the full equation stays within the tolerance of the case."""
    with mpmath.workdps(30):
        def angle(s):  # type: ignore[no-untyped-def]
            return 2 * mpmath.atan(mpmath.tan(mpmath.mpf(stiff.HIGH) / 2) * mpmath.exp(-s))

        for s in (0, 0.7, 2):
            assert abs(mpmath.diff(angle, s) + mpmath.sin(angle(s))) < 1e-12
            assert float(angle(s)) == pytest.approx(float(stiff.creep(s)), rel=1e-15)
    # In slow time s = lambda t and u = dtheta/ds: (omega0/gamma)² u' = -u - sin(theta).
    found = solve_ivp(lambda _, y: (y[1], -(y[1] + math.sin(y[0])) * stiffness**2), (0.0, stiff.CREEP),
                      (stiff.HIGH, -math.sin(stiff.HIGH)), method="Radau", rtol=1e-10, atol=1e-12)
    apart = np.max(np.abs(found.y[0] - stiff.creep(found.t)))
    assert 1e-3 * stiffness**-2 < apart + 1e-9 < 2.0 * stiffness**-2 * (1.0 + stiff.CREEP) + 2e-9


@pytest.mark.slow
def test_fast_under_gravity() -> None:
    """The true motion is compared with scipy's Radau IIA, and with the reference solution of the scene."""
    load, motion = 1e6, MOTIONS["quadratic drag and gravity, c v0 h = 1e6"]
    omega0, c = motion.scene.omega0, load / (stiff.FAST * stiff.STEP)
    found = solve_ivp(lambda _, y: (y[1], -c * abs(y[1]) * y[1] - omega0**2 * math.sin(y[0])), (0.0, 1.0),
                      (0.0, stiff.FAST), method="Radau", rtol=1e-10, atol=1e-13, t_eval=TIMES)
    assert np.max(np.abs(motion.true()[0][[0, 1, 2, 20, 100]] - found.y[0])) < 1e-8
    truth = reference(motion.scene, 0.0, stiff.FAST, stiff.STEP * np.arange(stiff.STEPS + 1))
    assert np.max(np.abs(motion.true()[0] - truth.angle)) < 1e-10
    assert truth.error_estimate < 1e-10
    assert np.max(np.abs(truth.angle)) == pytest.approx(stiff.FALLEN, rel=0.01)


# --- mutants: a false run has to be noticed -------------------------------------------------------------------------


def _case(group, name: str):  # type: ignore[no-untyped-def]
    return next(case for case in group.CASES if case.name == name)


@pytest.mark.parametrize("method", ["gauss4", "radau5", "sdirk2", "bdf2", "backward_euler", "implicit_midpoint"])
def test_without_drag_nothing_slows_down_as_it_must(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    real = case_module.rollout
    still = Scene("without drag")
    case, chosen = _case(stiff, "quadratic drag alone, c v0 h = 1e+06"), METHODS[method]
    assert case.as_expected(chosen, case.tried(chosen))
    monkeypatch.setattr(case_module, "rollout", lambda _scene, **options: real(still, **options))
    for name in ("quadratic drag alone, c v0 h = 1e+06", "linear drag, gamma h = 1000"):
        case = _case(stiff, name)
        assert not case.as_expected(chosen, case.tried(chosen))


@pytest.mark.parametrize("method", ["velocity_verlet", "rk4", "gauss4", "midpoint", "nystrom4"])
def test_another_method_another_gravity_and_an_early_stop_are_noticed(
    method: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    real, chosen, case = case_module.rollout, METHODS[method], _case(steps, "omega0 h = 0.98, full gravity")
    assert case.as_expected(chosen, case.tried(chosen))

    def early(scene, **options):  # type: ignore[no-untyped-def]
        if options["duration"] <= steps.FIRST * options["dt"] * 1.001:
            return real(scene, **options)
        return replace(real(scene, **{**options, "duration": options["dt"], "every": 1}), stop_reason="diverged")

    for mutant in (lambda scene, **options: real(scene, **{**options, "integrator": METHODS["forward_euler"]}),
                   lambda scene, **options: real(replace(scene, gravity=5.0), **options), early):
        monkeypatch.setattr(case_module, "rollout", mutant)
        assert not case.as_expected(chosen, case.tried(chosen))
