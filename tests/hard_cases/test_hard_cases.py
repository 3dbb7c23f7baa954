"""Hard cases: outcomes of each kind of method, with their sources.

A finite but wrong energy is a failure; a method that cannot simulate a case must report divergence.
"""

from __future__ import annotations

import math
from itertools import accumulate, groupby
from typing import Any

import numpy as np
import pytest
from choice import rolled
from scipy.optimize import root
from splitting_truths import TRUTHS
from step_limit_truths import DRAG_LIMIT, OSCILLATOR_LIMIT, drag_limit, oscillator_limit, regains
from stored import stored

import integrators
from integrators.analysis import amplification, leading_error, spectral_radius
from pendulum_env import SCENES, Scene
from pendulum_env.physics import exact
from pendulum_env.physics.effects import Gravity, LinearDrag, QuadraticDrag, SmallAngleGravity
from pendulum_env.truth.reference import reference

METHODS = tuple(integrators.METHODS)

STEPS = 6_000
"""Steps next to the limit 2: a method that is unstable there has diverged, but for those of SLOWLY_GROWING.

Of the others dprkn6 grows least, by 9.8e-4 a step, and has diverged after some 5040 steps.
"""
# They grow by no more than 4e-7 (omega0 h)⁸ a step, too little to diverge.
SLOWLY_GROWING = ("verner7", "verner8")
DAMPED = tuple(name for name in METHODS if not {"velocity_free", "exact_flow"} & integrators.get(name).needs)
BACKWARDS = tuple(name for name in METHODS if "reversible" in integrators.get(name).needs)
BOUNDED = tuple(name for name in METHODS if oscillator_limit(name) > 0.1)


def test_no_limit_of_the_literature_is_lost() -> None:
    """A new method may have no published limit; then its limits are computed from its coefficients."""
    assert {*stored("step_limits")} <= OSCILLATOR_LIMIT.keys() & DRAG_LIMIT.keys() & {*METHODS}


# --- 1. Release next to the top: the catalogue's first group, in test_stress.py; here what it does not look at --------


@pytest.mark.parametrize("method", METHODS)
def test_energy_of_a_release_from_the_top(method: str) -> None:
    """The tilt grows as cosh(omega0 t) with an error of (omega0 h)^p omega0 t; the energy error is its square."""
    offset, omega0, step = 1e-12, SCENES["vacuum"].omega0, 1e-3
    growth = math.acosh(0.1 / offset)
    r = rolled("vacuum", integrator=method, angle=math.pi - offset, velocity=0.0, dt=step, duration=growth / omega0,
               every=100)
    tilt = math.pi - exact.pendulum(r.time, math.pi - offset, 0.0, omega0)[0][-1]
    own = (omega0 * step) ** integrators.get(method).order * growth
    assert 0.05 < tilt < 0.15
    assert abs(r.energy_residual[-1]) <= (own * tilt * tilt + 1e-12) * r.energy[0]


@pytest.mark.parametrize("method", METHODS)
def test_the_other_side_of_the_top_is_its_mirror_image(method: str) -> None:
    runs = [rolled("vacuum", integrator=method, angle=side * math.pi, velocity=0.0, dt=1e-2, duration=15.0, every=10)
            for side in (1.0, -1.0)]
    assert np.ptp(runs[0].angle) > 3.0
    assert np.array_equal(runs[0].angle, -runs[1].angle)
    assert np.array_equal(runs[0].velocity, -runs[1].velocity)


@pytest.mark.parametrize("method", METHODS)
def test_at_rest_at_the_bottom_nothing_moves(method: str) -> None:
    still = rolled("vacuum", integrator=method, angle=0.0, velocity=0.0, dt=0.005, duration=1.0)
    assert not np.any(still.angle)
    assert not np.any(still.energy)


# --- 2. At the edge of the step --------------------------------------------------------------------------------------


@pytest.mark.parametrize("product", [1.999, 2.001])
@pytest.mark.parametrize("method", METHODS)
def test_step_next_to_two_on_the_small_angle_scene(method: str, product: float) -> None:
    scene = SCENES["textbook"]
    h = product / scene.omega0
    r = rolled(scene, integrator=method, dt=h, duration=STEPS * h)
    radius = spectral_radius(method, product)
    if method in SLOWLY_GROWING or (method not in OSCILLATOR_LIMIT and 1.0 + 1e-10 < radius < 1.0 + 1e-4):
        assert r.stop_reason == ""
        assert r.energy[-1] / r.energy[0] == pytest.approx(radius ** (2 * STEPS), rel=1e-7)
    elif product > oscillator_limit(method) and not (regains(method) and radius < 1.0):
        assert r.stop_reason == "diverged"
        assert r.time[-1] < STEPS * h
    else:
        assert r.stop_reason == ""
        # q² - z q p + p² is conserved at worst (Hairer, Lubich & Wanner 2006, I.5), so |q| stays below q0 / k; other
        # matrices of determinant 1 make of it q0 (cos n phi + (a - d)/2 sin n phi/sin phi).
        bound = 1.0 / math.sqrt(1.0 - 0.25 * product * product) if product < 2.0 else 1.0
        if method not in OSCILLATOR_LIMIT:
            if isinstance(integrators.get(method), integrators.Multistep):
                pytest.skip(f"{method} has no bound of the literature: that of its other roots depends on its start")
            bound = largest_cosine(amplification(method, product))
        if method in TRUTHS:
            a, _, _, d = amplification(method, product).ravel()
            bound = math.sqrt(1.0 + ((a - d) / 2.0) ** 2 / (1.0 - ((a + d) / 2.0) ** 2))
        if method == "numerov":  # the motion is q0 cos n phi + b sin n phi, with b from the first step
            cos = (12.0 - 5.0 * product**2) / (12.0 + product**2)
            bound = math.hypot(1.0, (r.angle[1] / r.angle[0] - cos) / math.sqrt(1.0 - cos * cos))
        late = r.angle[100:] if regains(method) else r.angle  # after the parasitic solutions have decayed
        assert np.max(np.abs(late)) <= scene.run.angle * bound * (1.0 + 1e-6)


def largest_cosine(matrix: np.ndarray) -> float:
    """Return the largest angle of STEPS steps of a 2 x 2 matrix from an angle of 1."""
    state, most = np.array([1.0, 0.0]), 1.0
    for _ in range(STEPS):
        state = matrix @ state
        most = max(most, abs(float(state[0])))
    return most


# --- 3. Stiff damping ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", DAMPED)
def test_linear_drag_with_gamma_h_50(method: str) -> None:
    """Overdamped: theta follows exp(-omega0² t / gamma); methods beyond their real stability limit must diverge."""
    h, gamma = 0.01, 5000.0
    scene = Scene(effects=(SmallAngleGravity(), LinearDrag(gamma=gamma)))
    r = rolled(scene, integrator=method, angle=0.5, velocity=1.0, dt=h, duration=5.0)
    if gamma * h > drag_limit(method):
        assert r.stop_reason == "diverged"
        return
    if method in BACKWARDS:
        # Backward sub-steps amplify under drag; slow growth has the rate of the step's matrix.
        radius = spectral_radius(method, scene.omega0 * h, gamma * h)
        assert radius > 2.5 if r.stop_reason == "diverged" else radius < 1.02
        if r.stop_reason == "":
            assert abs(r.angle[-1] / r.angle[-101]) == pytest.approx(radius**100, rel=1e-6)
        return
    truth, _ = exact.linear(r.time, 0.5, 1.0, scene.omega0, gamma)
    assert r.stop_reason == ""
    assert np.max(r.energy) <= r.energy[0]
    if method == "backward_euler":
        assert np.max(np.abs(r.angle - truth)) < 3e-4
    else:
        # Splitting lets the bob fall for up to one step before drag acts (error omega0² h² v/h a step, not stiffly
        # accurate); implicit midpoint is A- but not L-stable, so the fast mode rings at ratio (2-50)/(2+50).
        assert np.max(np.abs(r.angle)) < 0.52
        assert np.all(np.abs(r.velocity) <= 1.0)


# Quadratic drag from 1000 rad/s with c = 1: the exact velocity is v0 / (1 + c v0 t), apart from gravity.
FAST = 1000.0
STIFF_STEP = 0.01
NOT_DIVERGING = tuple(name for name in METHODS if math.isinf(drag_limit(name)))
EXACT_DRAG = tuple(name for name in NOT_DIVERGING if "split" in integrators.get(name).needs)
RULE_OF_QUADRATURE = ("symplectic_euler_position_first", "conformal_symplectic_euler", "velocity_verlet")


def furthest_back(method: str) -> float:
    """Return the largest backward time of drag flows within a step, in steps; 1 + c v h times it must be positive."""
    flows = groupby(integrators.get(method).flows, key=lambda flow: flow[0])
    return float(min(accumulate(sum(fraction for _, fraction in same) for kind, same in flows if kind == "drag")))


@pytest.mark.parametrize("method", DAMPED)
def test_quadratic_drag_at_1000_rad_per_second(method: str) -> None:
    """c |v| h = 10: explicit drag overshoots and must be reported as divergence; other methods keep dissipating.

    With an exact drag flow, a kick at time s contributes (s/t)² at time t: of gravity's omega0² t at most a third
    remains, and the test allows half.
    """
    scene = Scene(effects=(Gravity(), QuadraticDrag(c=1.0)))
    r = rolled(scene, integrator=method, angle=0.0, velocity=FAST, dt=STIFF_STEP, duration=1.0)
    if method not in NOT_DIVERGING or (method in BACKWARDS and FAST * STIFF_STEP * furthest_back(method) < -1.0):
        assert r.stop_reason == "diverged"
        return
    assert r.stop_reason == ""
    assert np.max(r.energy) <= r.energy[0]
    # BDF methods combine earlier gains of heat with both signs, so heat may decrease in a step that does not resolve.
    assert regains(method) or np.min(np.diff(r.ledger.heat)) >= 0.0
    if method in EXACT_DRAG:
        early = slice(1, 21)
        alone = exact.drag_only(r.time, FAST, 0.0, 1.0)[1]
        bound = 0.5 * scene.omega0**2 * r.time
        truth = reference(scene, 0.0, FAST, r.time).velocity
        assert np.all(np.abs(truth - alone)[early] <= bound[early])
        assert np.all(np.abs(r.velocity - alone)[early] <= bound[early])
        assert abs(r.energy_residual[-1]) < 1e-3 * r.energy[0]


@pytest.mark.parametrize("method", EXACT_DRAG)
def test_quadratic_drag_alone_is_exact_where_its_flow_is(method: str) -> None:
    r = rolled(Scene(effects=(QuadraticDrag(c=1.0),)), integrator=method, angle=0.0, velocity=FAST, dt=STIFF_STEP,
                duration=1.0)
    if FAST * STIFF_STEP * furthest_back(method) < -1.0:
        assert r.stop_reason == "diverged"
        return
    np.testing.assert_allclose(r.velocity, FAST / (1.0 + FAST * r.time), rtol=1e-13)


def test_backward_euler_under_quadratic_drag_keeps_its_distance_from_the_truth() -> None:
    """Backward Euler's velocity is too large by a bounded amount: 1/w is too small by at most c h ln(v0/w).

    w' = w/(1 + c h w') gives 1/w' - 1/w = c h - c h x/(1 + x) with x = c h w', and x/(1 + x) <= ln(1 + x) = ln(w/w').
    """
    r = rolled(Scene(effects=(QuadraticDrag(c=1.0),)), integrator="backward_euler", angle=0.0, velocity=FAST,
                dt=STIFF_STEP, duration=1.0)
    missing = 1.0 / FAST + r.time - 1.0 / r.velocity
    assert np.all(missing >= -1e-13)
    assert np.all(missing <= STIFF_STEP * np.log(FAST / r.velocity) + 1e-13)
    assert missing[-1] > 0.5 * STIFF_STEP * math.log(FAST / r.velocity[-1])


# Weight of the new state in the stage: v' - v = h a(stage), q' - q = h v(stage), stage = old + weight (new - old).
ONE_STAGE = {"backward_euler": 1.0, "implicit_midpoint": 0.5}


MORE_STAGES = tuple(
    name for name in METHODS if isinstance(method := integrators.get(name), integrators.RungeKutta) and method.implicit
    and name not in ONE_STAGE)
"""Multistep methods are in test_multistep.py; the discrete gradient has a test of its own here."""


def test_the_discrete_gradient_solves_its_own_equation_at_the_stiff_start() -> None:
    """The mean force is the difference of potentials over that of angles; drag acts at the mean velocity."""
    scene = Scene(effects=(Gravity(), QuadraticDrag(c=1.0)))
    r = rolled(scene, integrator="discrete_gradient", angle=0.0, velocity=FAST, dt=STIFF_STEP, duration=0.3,
                backend="python")
    q, v = r.angle, r.velocity
    mean, rise = 0.5 * (v[1:] + v[:-1]), scene.omega0**2 * (np.cos(q[1:]) - np.cos(q[:-1]))
    assert np.min(np.abs(np.diff(q))) > 1e-3
    assert np.diff(q) == pytest.approx(STIFF_STEP * mean, rel=1e-12)
    wanted = rise / np.diff(q) - np.abs(mean) * mean
    assert np.all(np.abs(np.diff(v) - STIFF_STEP * wanted) <= 1e-13 * (np.abs(v[:-1]) + np.abs(v[1:]) + 1.0))


@pytest.mark.quick("1.0-3.0-0.0")
@pytest.mark.parametrize(("angle", "velocity"), [(3.0, 0.0), (1.0, 40.0)])
@pytest.mark.parametrize("product", [0.05, 1.0, 3.0])
def test_the_discrete_gradient_keeps_the_energy_at_any_step(product: float, angle: float, velocity: float) -> None:
    """Gonzalez 1996, theorem 2.2; for swings and rotations at steps at which other methods fail."""
    scene = SCENES["vacuum"]
    h = product / scene.omega0
    r = rolled(scene, integrator="discrete_gradient", angle=angle, velocity=velocity, dt=h, duration=3e3 * h, every=7)
    assert r.stop_reason == ""
    assert np.max(np.abs(r.energy_residual)) < 1e-13 * r.energy[0]


def test_the_discrete_gradient_books_every_joule_of_a_damped_and_driven_scene() -> None:
    """With drag, motor and dry friction with rests, energy, work and heat agree to rounding."""
    for name in ("lab", "sticky_bearing"):
        r = rolled(name, integrator="discrete_gradient", angle=2.0, velocity=0.0, control=0.5, dt=0.05, duration=50.0,
                    backend="python")
        assert r.ledger.heat[-1] > 0.01 * r.energy[0]
        assert np.max(np.abs(r.energy_residual)) < 1e-13 * r.energy[0]


@pytest.mark.parametrize("method", MORE_STAGES)
def test_implicit_methods_of_more_stages_solve_their_own_equations_at_the_stiff_start(method: str) -> None:
    """The stage equations are solved by MINPACK's hybrid method (Powell 1970), in units of the initial velocity."""
    scene = Scene(effects=(Gravity(), QuadraticDrag(c=1.0)))
    table = integrators.get(method)
    a, b = np.array(table.a, dtype=float), np.array(table.b, dtype=float)
    r = rolled(scene, integrator=method, angle=0.0, velocity=FAST, dt=STIFF_STEP, duration=3 * STIFF_STEP,
                backend="python")
    for q, v, q1, v1 in zip(r.angle, r.velocity, r.angle[1:], r.velocity[1:], strict=False):

        def stages(speeds: Any, q: float = q) -> Any:
            w = FAST * speeds
            return w, -np.abs(w) * w - scene.omega0**2 * np.sin(q + STIFF_STEP * (a @ w))

        def residual(speeds: Any, v: float = v) -> Any:
            w, k = stages(speeds)
            return (w - v - STIFF_STEP * (a @ k)) / FAST

        found = root(residual, np.full(len(b), 0.1 * v / FAST), tol=1e-14)
        assert np.max(np.abs(residual(found.x))) < 1e-12
        w, k = stages(found.x)
        assert q1 == pytest.approx(q + STIFF_STEP * (b @ w), abs=1e-9)
        assert v1 == pytest.approx(v + STIFF_STEP * (b @ k), abs=1e-8)


@pytest.mark.parametrize("method", ONE_STAGE)
def test_implicit_methods_solve_their_own_equation_at_the_stiff_start(method: str) -> None:
    """The solution is unique, because v (1 + weight c h |v|) is monotone; at c v h = 10 it is far from the motion.

    In one step from 1000 rad/s, backward Euler reaches 270, implicit midpoint, which is not L-stable, -283; exact is
    91.
    """
    scene = Scene(effects=(Gravity(), QuadraticDrag(c=1.0)))
    r = rolled(scene, integrator=method, angle=0.0, velocity=FAST, dt=STIFF_STEP, duration=1.0)
    weight, q, v = ONE_STAGE[method], r.angle, r.velocity
    stage_q, stage_v = (x[:-1] + weight * (x[1:] - x[:-1]) for x in (q, v))
    wanted = -np.abs(stage_v) * stage_v - scene.omega0**2 * np.sin(stage_q)
    size = np.abs(v[:-1]) + np.abs(v[1:]) + 1.0
    assert np.all(np.abs(np.diff(v) - STIFF_STEP * wanted) <= 1e-13 * size)
    assert np.all(np.abs(np.diff(q) - STIFF_STEP * stage_v) <= 1e-13 * (1.0 + np.abs(q[1:])))
    first = {"backward_euler": (math.sqrt(41.0) - 1.0) / 0.02, "implicit_midpoint": 200.0 * math.sqrt(21.0) - 1200.0}
    assert v[1] == pytest.approx(first[method], abs=scene.omega0**2 * STIFF_STEP)


@pytest.mark.parametrize("method", RULE_OF_QUADRATURE)
def test_splitting_under_resolved_quadratic_drag_has_the_error_of_its_order(method: str) -> None:
    """c v0 h = 0.01, with gravity. The velocity is almost exact, so the angle's error is that of a quadrature rule.

    Left end h (v0 - v)/2, right end minus that, midpoint -h² (v' - v0')/24 (Euler-Maclaurin).
    """
    scene, h = Scene(effects=(Gravity(), QuadraticDrag(c=1.0))), 1e-5
    r = rolled(scene, integrator=method, angle=0.0, velocity=FAST, dt=h, duration=0.1, every=10_000)
    truth = reference(scene, 0.0, FAST, [0.1])
    fall, slowing = FAST - truth.velocity[0], FAST**2 - truth.velocity[0] ** 2
    sizes = (0.5 * h * fall, -0.5 * h * fall, -h * h * slowing / 24.0)
    predicted = dict(zip(RULE_OF_QUADRATURE, sizes, strict=True))[method]
    error = r.angle[-1] - truth.angle[0]
    assert abs(predicted) > 100.0 * truth.error_estimate
    assert error == pytest.approx(predicted, rel=0.02)
    # Gravity acts for 0.1 s at an angle whose error is at most this.
    assert r.velocity[-1] == pytest.approx(truth.velocity[0], abs=0.1 * scene.omega0**2 * abs(predicted))


# --- 4. A million steps ----------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("method", BOUNDED)
def test_a_million_steps(method: str) -> None:
    """omega0 h = 0.05: the energy error of symplectic methods stays bounded, that of others follows |R(iz)|².

    Symplectic (Hairer, Lubich & Wanner 2006, theorem IX.8.1): the largest error in the last tenth is that of the first;
    so for the trapezoidal rule, the midpoint rule seen from half a step away (VI.8), and two symmetric methods with
    another conserved energy. Other methods lose energy on the oscillator as |R(iz)|² says, RK4 z⁶/72 per step to
    leading order, symmetric multistep methods none; backward Euler divides it by 1 + z².
    """
    z = 0.05
    chosen = integrators.get(method)
    bounded = chosen.symplectic or method in ("trapezoid", "discrete_gradient", "newmark_linear", "numerov")
    scene = SCENES["vacuum"] if bounded or method == "backward_euler" else SCENES["textbook"]
    h = z / scene.omega0
    # An odd stride samples every phase of the swing.
    r = rolled(scene, integrator=method, angle=1.0, velocity=0.0, dt=h, duration=1e6 * h, every=37)
    assert r.stop_reason == ""
    size = np.abs(r.energy_residual) / r.energy[0]
    tenth = len(size) // 10
    if chosen.family == "energy-preserving":
        assert np.max(size) < 1e-12
    elif chosen.family == "exact":
        assert np.max(size) < 1e-10, "rounding alike in every step"
    elif bounded:
        assert np.max(size) < 0.1
        assert np.max(size[-tenth:]) == pytest.approx(np.max(size[:tenth]), rel=0.01)
    elif method != "backward_euler":
        term = leading_error(method).amplitude
        assert (term is None) == chosen.symmetric
        lost = 2e6 * float(term.coefficient) * z ** (term.power + 1) if term else 0.0
        # Coefficients of up to 200 that cancel, rounded to double precision, move verner6 by 3e-14 a step.
        rounding = 5e-8 if method == "verner6" else 1e-9
        assert math.log(r.energy[-1] / r.energy[0]) == pytest.approx(lost, rel=0.02, abs=rounding)
    else:
        assert r.energy[-1] < 1e-12 * r.energy[0]
        assert np.max(np.diff(r.energy)) <= 1e-300  # rounding of subnormal numbers
