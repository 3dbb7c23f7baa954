"""Hard cases: what each kind of method must do was written down, with its source, before the first run.

A finite but wrong energy is a failure like any other; where a method cannot cope it must say so by name.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import integrators
from pendulum_env import SCENES, Scene, rollout
from pendulum_env.physics import exact
from pendulum_env.physics.effects import CoulombFriction, Gravity, LinearDrag, QuadraticDrag, SmallAngleGravity

METHODS = tuple(integrators.METHODS)

# Largest omega0 h without growth on the undamped oscillator. Euler's: |1 + iz|² = 1 + z²; midpoint and Heun:
# |R(iz)|² = 1 + z⁴/4; RK4: 2 sqrt(2); symplectic Euler, Verlet: 2 (Hairer, Norsett & Wanner 1993, IV.2; Hairer,
# Lubich & Wanner 2006, I.5.2); implicit Euler and midpoint: A-stable.
OSCILLATOR_LIMIT = {
    "forward_euler": 0.0,
    "backward_euler": math.inf,
    "symplectic_euler": 2.0,
    "symplectic_euler_position_first": 2.0,
    "conformal_symplectic_euler": 2.0,
    "velocity_verlet": 2.0,
    "midpoint": 0.0,
    "heun": 0.0,
    "rk4": 2.0 * math.sqrt(2.0),
    "implicit_midpoint": math.inf,
}
# Largest gamma h without growth under linear drag alone: the real stability interval of explicit Runge-Kutta methods
# (Hairer & Wanner 1996, IV.2), 2 for a kick with explicit drag, none for exact flows and A-stable methods.
DRAG_LIMIT = {
    "forward_euler": 2.0,
    "backward_euler": math.inf,
    "symplectic_euler": 2.0,
    "symplectic_euler_position_first": math.inf,
    "conformal_symplectic_euler": math.inf,
    "velocity_verlet": math.inf,
    "midpoint": 2.0,
    "heun": 2.0,
    "rk4": 2.785293563405282,
    "implicit_midpoint": math.inf,
}
BOUNDED = tuple(name for name in METHODS if OSCILLATOR_LIMIT[name] > 0.1)


def test_every_method_has_its_expectations() -> None:
    assert set(OSCILLATOR_LIMIT) == set(DRAG_LIMIT) == set(METHODS)


# --- 1. Release 1e-9 rad from the top --------------------------------------------------------------------------------

# The tilt grows as cosh(omega0 t): 1e-9 becomes 0.1 after 19 / omega0. Truth: the elliptic functions, from the exact
# float. Allowed: the method's own relative error of the growth, (omega0 h)^p omega0 t, and the granularity of angles
# near pi, 4.4e-16 a step, against 1e-9.
FALL_STEP = 0.0005


@pytest.mark.parametrize("method", METHODS)
def test_release_from_the_top(method: str) -> None:
    angle = math.pi - 1e-9
    omega0 = SCENES["vacuum"].omega0
    r = rollout("vacuum", integrator=method, angle=angle, velocity=0.0, dt=FALL_STEP, duration=19.0 / omega0)
    truth, _ = exact.pendulum(r.time, angle, 0.0, omega0)
    tilt, wanted = math.pi - r.angle[-1], math.pi - truth[-1]
    own = (omega0 * FALL_STEP) ** integrators.get(method).order * 19.0
    assert tilt == pytest.approx(wanted, rel=1.5 * own + 1e-4)
    assert abs(r.energy_residual[-1]) <= (1.5 * own + 1e-9) * r.energy[0]
    assert r.stop_reason == ""


@pytest.mark.parametrize("method", METHODS)
def test_exactly_float_pi_and_the_bottom_are_followed(method: str) -> None:
    """float(pi) is 1.2e-16 below pi: it must fall, to the right; at rest at the bottom nothing may move."""
    fallen = rollout("vacuum", integrator=method, angle=math.pi, velocity=0.0, dt=0.005, duration=11.0)
    assert fallen.angle[-1] < math.pi - 0.01 or fallen.angle[-1] == math.pi
    still = rollout("vacuum", integrator=method, angle=0.0, velocity=0.0, dt=0.005, duration=11.0)
    assert not np.any(still.angle)
    assert not np.any(still.energy)


# --- 2. At the edge of the step --------------------------------------------------------------------------------------


@pytest.mark.parametrize("product", [1.999, 2.001])
@pytest.mark.parametrize("method", METHODS)
def test_step_next_to_two_on_the_small_angle_scene(method: str, product: float) -> None:
    scene = SCENES["textbook"]
    h = product / scene.omega0
    r = rollout(scene, integrator=method, dt=h, duration=20_000 * h)
    if product > OSCILLATOR_LIMIT[method]:
        assert r.stop_reason == "diverged"
        assert r.time[-1] < 20_000 * h
    else:
        assert r.stop_reason == ""
        # q² - z q p + p² is conserved at worst (Hairer, Lubich & Wanner 2006, I.5), so |q| stays below q0 / k.
        bound = 1.0 / math.sqrt(1.0 - 0.25 * product * product) if product < 2.0 else 1.0
        assert np.max(np.abs(r.angle)) <= scene.run.angle * bound * (1.0 + 1e-6)


STANDARD_MAP = ("symplectic_euler", "symplectic_euler_position_first", "conformal_symplectic_euler", "velocity_verlet")


@pytest.mark.parametrize("method", STANDARD_MAP)
def test_full_gravity_is_the_standard_map(method: str) -> None:
    """K = (omega0 h)²: below 0.9716 the golden circle stands and |v h| stays below a turn (Greene 1979); at K = 2.25
    nothing holds the orbit from 1.5 rad, which reaches |v| = 200 rad/s: nonsense that must be named."""
    scene = SCENES["vacuum"]
    below = 0.98 / scene.omega0
    inside = rollout(scene, integrator=method, angle=3.0, velocity=0.0, dt=below, duration=1e6 * below, every=1000)
    assert inside.stop_reason == ""
    assert np.max(np.abs(inside.velocity)) * below < 2.0 * math.pi
    beyond = 1.5 / scene.omega0
    # Verlet keeps its velocity half a kick behind: from this one it runs through the same orbit.
    start = -0.5 * beyond * scene.omega0**2 * math.sin(1.5) if method == "velocity_verlet" else 0.0
    lost = rollout(scene, integrator=method, angle=1.5, velocity=start, dt=beyond, duration=1e6 * beyond)
    assert lost.stop_reason == "diverged"
    assert np.all(np.isfinite(lost.energy_residual))


# --- 3. Stiff damping ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
def test_linear_drag_with_gamma_h_50(method: str) -> None:
    """Overdamped: theta follows exp(-omega0² t / gamma) in truth; methods beyond their real interval must diverge."""
    h, gamma = 0.01, 5000.0
    scene = Scene(effects=(SmallAngleGravity(), LinearDrag(gamma=gamma)))
    r = rollout(scene, integrator=method, angle=0.5, velocity=1.0, dt=h, duration=5.0)
    if gamma * h > DRAG_LIMIT[method]:
        assert r.stop_reason == "diverged"
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


@pytest.mark.parametrize("method", METHODS)
def test_quadratic_drag_at_1000_rad_per_second(method: str) -> None:
    """c |v| h = 10: explicit drag overshoots and must be named; the others follow v0 / (1 + c v0 t)."""
    scene = Scene(effects=(Gravity(), QuadraticDrag(c=1.0)))
    r = rollout(scene, integrator=method, angle=0.0, velocity=1000.0, dt=0.01, duration=1.0)
    if math.isfinite(DRAG_LIMIT[method]):
        assert r.stop_reason == "diverged"
        return
    assert r.stop_reason == ""
    assert np.max(r.energy) <= r.energy[0]
    assert np.min(np.diff(r.ledger.heat)) >= 0.0
    truth = exact.drag_only(r.time, 1000.0, 0.0, 1.0)[1]
    if "split" in integrators.get(method).needs:
        assert np.max(np.abs(r.velocity - truth)) < 12.0  # gravity, 9.81 rad/s² for a second, is the only difference
        assert abs(r.energy_residual[-1]) < 1e-3 * r.energy[0]


# --- 4. Dry friction to rest -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
def test_coulomb_friction_to_rest(method: str) -> None:
    """Turning angles from cos t1 - cos t0 = tau (t0 + t1) (Lapidus 1970), then rest for good, without creep."""
    tau = 0.05
    scene = Scene(effects=(Gravity(), CoulombFriction(friction_torque=tau * 9.81)))
    r = rollout(scene, integrator=method, angle=1.0, velocity=0.0, dt=0.0005, duration=15.0)
    turns = exact.coulomb_turning_points(1.0, tau, 100)
    assert np.all(r.velocity[-5000:] == 0.0)
    assert np.all(r.angle[-5000:] == r.angle[-1])
    own = (scene.omega0 * 0.0005) ** integrators.get(method).order
    assert r.angle[-1] == pytest.approx(turns[-1], abs=40.0 * own + 1e-8)
    assert r.ledger.heat[-1] == pytest.approx(r.energy[0] - r.energy[-1], rel=60.0 * own + 1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_within_the_band_it_never_moves(method: str) -> None:
    scene = Scene(effects=(Gravity(), CoulombFriction(friction_torque=0.5 * 9.81)))
    r = rollout(scene, integrator=method, angle=0.4, velocity=0.0, dt=0.05, duration=500.0)
    assert np.all(r.angle == 0.4)
    assert np.all(r.energy_residual == 0.0)


# --- 5. A million steps ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", BOUNDED)
def test_a_million_steps(method: str) -> None:
    """omega0 h = 0.05. Symplectic: the energy's error stays bounded (Hairer, Lubich & Wanner 2006, theorem IX.8.1), so
    its largest value in the last tenth is that of the first. RK4 loses z⁶/72 of the energy a step on the oscillator,
    R(iz) of the classical method; backward Euler divides it by 1 + z²."""
    z = 0.05
    scene = SCENES["textbook"] if method == "rk4" else SCENES["vacuum"]
    h = z / scene.omega0
    # An odd stride, so that the record meets every phase of the swing.
    r = rollout(scene, integrator=method, angle=1.0, velocity=0.0, dt=h, duration=1e6 * h, every=37)
    assert r.stop_reason == ""
    size = np.abs(r.energy_residual) / r.energy[0]
    tenth = len(size) // 10
    if integrators.get(method).symplectic:
        assert np.max(size) < 0.1
        assert np.max(size[-tenth:]) == pytest.approx(np.max(size[:tenth]), rel=0.01)
    elif method == "rk4":
        assert r.energy[-1] / r.energy[0] == pytest.approx(math.exp(-1e6 * z**6 / 72.0), rel=1e-5)
    else:
        assert method == "backward_euler"
        assert r.energy[-1] < 1e-12 * r.energy[0]
        assert np.max(np.diff(r.energy)) <= 1e-300  # rounding of subnormal numbers
