"""Tests of drives that depend on time, against Newton's laws in many digits, closed forms, and the work that they do.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from itertools import product
from typing import Any, ClassVar

import gymnasium as gym
import mpmath as mp
import numpy as np
import pytest
from choice import rolled
from effect_checks import bound

from pendulum_env import SCENES, Scene, SceneError, rollout
from pendulum_env.physics.body import Body
from pendulum_env.physics.damping import with_damping
from pendulum_env.physics.effects import (
    BearingFriction,
    Effect,
    Gravity,
    HorizontalDrive,
    PeriodicTorque,
    SmallAngleGravity,
    VerticalDrive,
)

BODY = Body(length=0.4, mass=0.05)
ROD_MASS, FLOATS = 0.03, 0.25
SHAKEN: dict[str, tuple[Effect, ...]] = {
    "vertical": (VerticalDrive(0.03, 25.0, 0.4),),
    "horizontal": (HorizontalDrive(0.05, 9.0, -1.2),),
    "both": (VerticalDrive(0.03, 25.0, 0.4), HorizontalDrive(0.05, 9.0, -1.2)),
}
TORQUE = PeriodicTorque(0.03, 7.0, 0.3)
STATES = tuple(product((0.0, 0.37, 12.5), (-2.9, -0.4, 0.9, 3.1), (-3.0, 0.0, 8.0)))


@dataclass(frozen=True)
class Rod(Effect):
    """A thin rod from the pivot to the bob's centre, with its inertia and its weight, of which FLOATS is carried."""

    name: ClassVar[str] = "rod"
    kind: ClassVar[Any] = "inertia"
    equation: ClassVar[str] = ""

    def coefficients(self, scene: Scene) -> dict[str, float]:
        return {}

    def inertia(self, scene: Scene) -> float:
        return ROD_MASS * scene.body.length**2 / 3.0

    def mass_moment(self, scene: Scene) -> float:
        return 0.5 * ROD_MASS * scene.body.length

    def weight_moment(self, scene: Scene) -> float:
        return (1.0 - FLOATS) * self.mass_moment(scene)


def pivot(scene: Scene, t: Any) -> tuple[Any, Any]:
    """Return the pivot's position at a time, by the formula in the documentation of the parameters."""
    x = y = mp.mpf(0)
    for effect in scene.effects:
        if isinstance(effect, VerticalDrive):
            y += effect.vertical_amplitude * mp.cos(mp.mpf(effect.vertical_rate) * t + effect.vertical_phase)
        if isinstance(effect, HorizontalDrive):
            x += effect.horizontal_amplitude * mp.cos(mp.mpf(effect.horizontal_rate) * t + effect.horizontal_phase)
    return x, y


def total(scene: Scene, role: str, t: Any, q: Any, v: Any = 0) -> Any:
    """Return the sum of one function (``role``) over all effects of a scene, in mpmath."""
    functions = (getattr(effect, role) for effect in scene.effects)
    return mp.fsum(bound(function, scene)(q, v, time=t) for function in functions if function)


# --- one instant: Lagrange and Newton -------------------------------------------------------------------------------


@pytest.mark.quick("both-with a rod")
@pytest.mark.parametrize("rod", [(), (Rod(),)], ids=["point", "with a rod"])
@pytest.mark.parametrize("shaken", SHAKEN)
def test_the_acceleration_is_lagranges(shaken: str, rod: tuple[Effect, ...]) -> None:
    """The acceleration solves d/dt dL/dv = dL/dtheta, with L from the positions of bob and rod, in 40 digits.

    L is differentiated numerically. The rod's kinetic energy is quadratic along the rod, so Simpson's rule is exact.
    """
    with mp.workdps(40):
        scene = Scene(body=BODY, effects=(Gravity(), *SHAKEN[shaken], *rod))
        length, parts = mp.mpf(BODY.length), [(mp.mpf(1), mp.mpf(BODY.mass), mp.mpf(0))]
        parts += [(mp.mpf(k) / 2, ROD_MASS * mp.mpf(w) / 6, FLOATS) for k, w in enumerate((1, 4, 1))] if rod else []

        def lagrangian(t: Any, q: Any, v: Any) -> Any:
            px, py = (mp.diff(lambda s, i=i: pivot(scene, s)[i], t) for i in (0, 1))
            value = mp.mpf(0)
            for share, mass, borne in parts:
                vx, vy = px + share * length * mp.cos(q) * v, py + share * length * mp.sin(q) * v
                height = pivot(scene, t)[1] - share * length * mp.cos(q)
                value += mass * (vx * vx + vy * vy) / 2 - (1 - borne) * mass * mp.mpf(scene.gravity) * height
            return value

        for t, q, v in STATES[::5]:
            at = (mp.mpf(t), mp.mpf(q), mp.mpf(v))
            by = {n: mp.diff(lagrangian, at, n) for n in ((0, 1, 0), (0, 0, 2), (0, 1, 1), (1, 0, 1))}
            wanted = (by[0, 1, 0] - by[0, 1, 1] * v - by[1, 0, 1]) / by[0, 0, 2]
            assert abs(total(scene, "torque", t, q, v) - wanted) < 1e-12 * (1 + abs(wanted))


@pytest.mark.quick("both")
@pytest.mark.parametrize("shaken", SHAKEN)
def test_the_pull_on_the_rod_and_the_wind_are_newtons(shaken: str) -> None:
    """The rod's force is mass times acceleration minus the weight, along the rod; across the rod there is no force."""
    with mp.workdps(40):
        scene = Scene(body=BODY, effects=(Gravity(), *SHAKEN[shaken]))
        for t, q, v in STATES:
            turning = total(scene, "torque", t, q, v)

            def place(s: Any, i: int, t: float = t, q: float = q, v: float = v, a: Any = turning) -> Any:
                angle = q + v * s + a * s * s / 2
                arm = (mp.sin(angle), -mp.cos(angle))[i]
                return pivot(scene, t + s)[i] + BODY.length * arm

            ax, ay = (mp.diff(lambda s, i=i: place(s, i), 0, 2) for i in (0, 1))
            ay += mp.mpf(scene.gravity)
            pull = -(ax * mp.sin(q) - ay * mp.cos(q)) / BODY.length
            across = ax * mp.cos(q) + ay * mp.sin(q)
            assert abs(across) < 1e-12
            assert abs(v * v + total(scene, "radial", t, q) - pull) < 1e-12 * (1 + abs(pull))
            for i, role in enumerate(("wind_x", "wind_y")):
                seen = -mp.diff(lambda s, i=i: pivot(scene, s)[i], t) / BODY.length
                assert abs(total(scene, role, t, q) - seen) < 1e-12


def test_numbers() -> None:
    """Compare dimensionless numbers with their formulas: (Omega b)²/(2 g L), Omega² b/g and torques over m g L."""
    scene = Scene(body=BODY, effects=(Gravity(), *SHAKEN["both"], TORQUE))
    vertical, horizontal, torque = scene.of_kind("drive")
    assert vertical.number(scene, 0.1) == pytest.approx((25.0 * 0.03) ** 2 / (2 * 9.81 * 0.4), rel=1e-14)
    assert horizontal.number(scene, 0.1) == pytest.approx(81.0 * 0.05 / 9.81, rel=1e-14)
    assert torque.number(scene, 0.1) == pytest.approx(0.03 / (0.05 * 9.81 * 0.4), rel=1e-14)
    assert all(math.isinf(effect.number(scene.replace(gravity=0.0), 0.1)) for effect in scene.effects[1:])


@pytest.mark.parametrize("viscosity", [1e-4, 0.004, 0.03])
def test_bearing_friction_is_the_damped_oscillator(viscosity: float) -> None:
    """Predicted and simulated period and loss per half swing are those of theta'' + (b/I) theta' + omega0² theta = 0.
    """
    scene = Scene(body=BODY, effects=(SmallAngleGravity(), BearingFriction(viscosity)))
    (_, bearing), gamma = scene.effects, viscosity / (0.05 * 0.4 * 0.4)
    slow = math.sqrt(9.81 / 0.4 - gamma * gamma / 4.0)
    assert bearing.number(scene, 0.1) == pytest.approx(gamma / math.sqrt(9.81 / 0.4), rel=1e-14)
    wanted = math.sqrt(9.81 / 0.4) / slow - 1.0, math.exp(-gamma * math.pi / (2.0 * slow)) - 1.0
    assert bearing.predicted(scene, 0.1) == pytest.approx(wanted, rel=1e-9)
    r = rolled(scene, integrator="dop853", angle=1.0, velocity=0.0, dt=math.pi / slow / 100, duration=math.pi / slow)
    assert r.angle[-1] == pytest.approx(-1.0 - wanted[1], rel=1e-12)
    assert r.velocity[-1] == pytest.approx(0.0, abs=1e-11)


def test_an_overdamped_bearing_has_no_period() -> None:
    scene = Scene(body=BODY, effects=(Gravity(), BearingFriction(1.0)))
    assert all(math.isnan(value) for value in scene.effects[1].predicted(scene, 0.1))


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(SceneError, match="wire cannot carry a periodic torque"):
        Scene(body=Body(suspension="wire"), effects=(Gravity(), PeriodicTorque()))
    with pytest.raises(SceneError, match="give a number"):
        with_damping(SCENES["lab"], "bearing")
    assert with_damping(SCENES["lab"], {"bearing": {"bearing_viscosity": 0.001}}).has("bearing_friction")
    full = with_damping(SCENES["sticky_bearing"], {"bearing": {"bearing_viscosity": 1e-4}, "coulomb": {}})
    assert [effect.name for effect in full.of_kind("dissipative")] == ["bearing_friction", "coulomb_friction"]


# --- long times -----------------------------------------------------------------------------------------------------


def test_the_phase_is_right_for_as_long_as_the_docstring_says() -> None:
    torque = PeriodicTorque.torque
    assert torque is not None
    for t in (0.1, 3e3, 7.77e6, 1.2e8):
        with mp.workdps(40):
            wanted = mp.cos(mp.mpf(6.9) * mp.mpf(t) + mp.mpf(0.3))
        assert abs(torque(t, 1.0, 6.9, 0.3) - wanted) <= 4e-16 * 6.9 * t + 2e-16
    assert math.isnan(torque(1.3e8, 1.0, 6.9, 0.3))


def test_a_run_beyond_the_range_of_the_phase_ends_by_name() -> None:
    scene = Scene(effects=(Gravity(), PeriodicTorque(1.0, 1e9)))
    assert rollout(scene, dt=0.1, duration=10.0, backend="python").stop_reason == "diverged"


@pytest.mark.slow
def test_the_phase_does_not_drift() -> None:
    """Without gravity, a sinusoidal torque gives v = (A/Omega) sin(Omega t), even after a million steps.

    Simpson's rule makes v larger by the fraction (Omega h)^4/2880. The phases are rounded by up to 4e-12 each at the
    end, which gives a random walk of 1e-11; a phase summed step by step would be wrong by 1e-7.
    """
    scene = Scene(body=Body(length=1.0, mass=1.0), effects=(PeriodicTorque(1.0, 1.7),))
    r = rollout(scene, integrator="rk4", angle=0.0, velocity=0.0, dt=0.006, duration=6000.0, every=7)
    wanted = np.sin(1.7 * r.time) / 1.7 * (1.0 + (1.7 * 0.006) ** 4 / 2880.0)
    assert np.max(np.abs(r.velocity - wanted)) < 3e-11


def test_an_environment_warns_of_steps_too_long_for_its_drive() -> None:
    """A step of 0.02 s at 100 rad/s is 2 rad of the drive's phase; at most 0.5 rad are allowed, so four substeps."""
    said = r"^A step of 0.02 s covers 2 rad of the phase of vertical_drive, .* steps of 0.005 s or less \(4 times"
    with pytest.warns(UserWarning, match=said):
        gym.make("LabPendulum-v0", scene="kapitza", task="free")
    with pytest.warns(UserWarning, match=r"covers 2.4 rad of the phase of vertical_drive"):
        gym.make_vec("LabPendulum-v0", num_envs=2, scene="kapitza", task="free", vertical_rate=[20.0, 120.0])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        gym.make("LabPendulum-v0", scene="kapitza", task="free", substeps=4)
        gym.make("LabPendulum-v0", scene="kapitza", task="free", integrator="dop853", rtol=1e-8)
        gym.make("LabPendulum-v0", scene="driven", task="free")


# --- steady response ------------------------------------------------------------------------------------------------

OMEGA0 = math.sqrt(9.81 / 0.4)


@pytest.mark.quick("torque-under-resonant", "pivot-under-fast", "torque-over-slow", "pivot-critical-resonant")
@pytest.mark.parametrize("ratio", [0.3, 1.0, 2.5], ids=["slow", "resonant", "fast"])
@pytest.mark.parametrize("damping", [0.4, 2.0, 5.0], ids=["under", "critical", "over"])
@pytest.mark.parametrize("drive", ["torque", "pivot"])
def test_the_steady_swing_is_the_driven_oscillators(drive: str, damping: float, ratio: float) -> None:
    """The steady amplitude is A/sqrt((omega0² - Omega²)² + (gamma Omega)²), as for the driven oscillator.

    The phase lag is atan2(gamma Omega, omega0² - Omega²). A is torque/I, or (b/L) Omega² for a shaken pivot. Angles are
    so small that cos(theta) is 1 to 1e-10. gamma is the bearing's. The run starts from rest.
    """
    omega, gamma = ratio * OMEGA0, damping * OMEGA0
    push, size = (PeriodicTorque(1e-3, omega, 0.7), 1e-3 / (0.05 * 0.4**2)) if drive == "torque" else (
        HorizontalDrive(1e-6, omega, 0.7), 1e-6 / 0.4 * omega**2)
    scene = Scene(body=BODY, effects=(SmallAngleGravity(), BearingFriction(gamma * BODY.inertia), push))
    slowest = 0.5 * (gamma - math.sqrt(max(gamma**2 - 4 * OMEGA0**2, 0.0)))
    r = rollout(scene, integrator="rk4", angle=0.0, velocity=0.0, dt=0.001, duration=40.0 / slowest)
    late = math.atan2(gamma * omega, OMEGA0**2 - omega**2)
    swing = size / math.hypot(OMEGA0**2 - omega**2, gamma * omega)
    last = slice(-200, None)
    wanted = swing * np.cos(omega * r.time[last] + 0.7 - late)
    assert np.max(np.abs(r.angle[last] - wanted)) < 1e-9 * swing
