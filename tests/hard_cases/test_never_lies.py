"""A run that cannot continue reports divergence, the place and a remedy, in every way to run.

Truths: forward Euler's energy on the oscillator grows by exactly 1 + z² per step; stability limits are those of the
literature; theta'' = k² theta grows as cosh(k t). The tests follow the remedies and check that they help.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from given_effects import Blow

import integrators
from pendulum_env import SCENES, Rollout, Scene, rollout
from pendulum_env.engine import limits
from pendulum_env.engine.each import Each
from pendulum_env.engine.limits import SHORT, beyond_limit, too_long
from pendulum_env.engine.machine import fitting
from pendulum_env.physics import flow
from pendulum_env.physics.effects import Effect, Gravity, LinearDrag, QuadraticDrag, SmallAngleGravity, SphereDrag

TOO_LONG, UNSOLVED = "are too long for", "Newton's method found no solution"
ENV = "LabPendulum-v0"
TEXTBOOK, VACUUM = SCENES["textbook"], SCENES["vacuum"]


@dataclass(frozen=True)
class Ended:
    """End of a run of any kind: steps taken, last state and residual, which have to be finite."""

    reason: str
    steps: float
    angle: float
    velocity: float
    residual: float

    def __post_init__(self) -> None:
        assert np.all(np.isfinite([self.angle, self.velocity, self.residual]))


def by_rollout(scene: Scene, start: tuple[float, float], h: float, most: int, **options: Any) -> Ended:
    r = rollout(scene, angle=start[0], velocity=start[1], dt=h, duration=most * h, **options)
    assert isinstance(r.stop_reason, str)
    return Ended(r.stop_reason, r.stop_time / h, r.angle[-1], r.velocity[-1], r.energy_residual[-1])


def by_batch(scene: Scene, start: tuple[float, float], h: float, most: int, **options: Any) -> Ended:
    """Return the end of the second of two runs in a batch; the first stays at rest and must not be affected."""
    r = rollout(scene, angle=np.array([0.0, start[0]]), velocity=np.array([0.0, start[1]]), dt=h, duration=most * h,
                **options)
    assert r.stop_reason[0] == ""
    assert not np.any(r.angle[0])
    last = np.flatnonzero(np.isfinite(r.angle[1]))[-1]
    assert np.all(np.isnan(r.angle[1, last + 1 :]))
    assert np.all(np.isnan(r.energy_residual[1, last + 1 :]))
    return Ended(r.stop_reason[1], r.stop_time[1] / h, *(float(x[1, last]) for x in (
        r.angle, r.velocity, r.energy_residual)))


def of_info(info: dict[str, Any], h: float, reason: str) -> Ended:
    return Ended(reason, info["time"] / h, info["angle"], info["velocity"], info["energy_residual"])


def by_env(scene: Scene, start: tuple[float, float], h: float, most: int, **options: Any) -> Ended:
    env = gym.make(ENV, scene=scene, dt=h, task="free", speed_limit=math.inf, max_episode_steps=most, **options)
    env.reset(options={"angle": start[0], "velocity": start[1]})
    for _ in range(most):
        _, _, terminated, truncated, info = env.step(np.zeros(1, np.float32))
        if terminated or truncated:
            break
    return of_info(info, h, info.get("stop_reason", ""))


def by_vector(scene: Scene, start: tuple[float, float], h: float, most: int, **options: Any) -> Ended:
    env = gym.make_vec(ENV, num_envs=2, scene=scene, dt=h, task="free", speed_limit=math.inf, **options)
    env.reset(options={"angle": np.array([0.0, start[0]]), "velocity": np.array([0.0, start[1]])})
    for _ in range(most):
        _, _, terminated, _, infos = env.step(np.zeros((2, 1), np.float32))
        if terminated[1]:
            break
    assert not terminated[0]
    reasons = infos.get("stop_reason", [None, ""])
    return of_info({name: values[1] for name, values in infos.items()}, h, reasons[1])


Way = Callable[..., Ended]
WAYS: tuple[Way, ...] = (by_rollout, by_batch, by_env, by_vector)
SINGLE: tuple[Way, ...] = (by_rollout, by_env)


# --- diverged --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("way", WAYS)
def test_finite_nonsense_stops_in_its_step(way: Way) -> None:
    """Forward Euler's energy E0 (1 + z²)^n counts as diverged when it exceeds E0 by 100 (m g L + E0)."""
    z, start = 0.5, 0.3
    energy = 0.5 * start * start  # over m g L
    steps = math.ceil(math.log(1.0 + 100.0 * (1.0 + energy) / energy) / math.log(1.0 + z * z))
    found = way(TEXTBOOK, (start, 0.0), z / TEXTBOOK.omega0, 200, integrator="forward_euler", backend="python")
    assert found.reason == "diverged"
    assert found.steps == pytest.approx(steps)
    scale = TEXTBOOK.body.mass * TEXTBOOK.gravity * TEXTBOOK.body.length
    assert found.residual == pytest.approx(scale * energy * ((1.0 + z * z) ** steps - 1.0), rel=1e-12)
    place = start * (1.0 + 1j * z) ** steps
    assert found.angle == pytest.approx(place.real, rel=1e-11)
    assert found.velocity == pytest.approx(-TEXTBOOK.omega0 * place.imag, rel=1e-11)


def push(angle: float, push_rate: float) -> float:
    return push_rate * angle


@dataclass(frozen=True)
class Push(Effect):
    """Torque that makes theta'' = k² theta, whose solution grows without bounds."""

    name = "push"
    kind = "drive"
    periodic = False
    equation = "{push_rate} theta"
    source = "made up"
    torque = staticmethod(push)

    def coefficients(self, scene: Scene) -> dict[str, float]:
        return {"push_rate": 400.0}


GROWING = Scene(effects=(Push(),))


@pytest.mark.quick("by_rollout-False", "by_env-True")
@pytest.mark.parametrize(("way", "adaptive"), [*((way, False) for way in WAYS), *((way, True) for way in SINGLE)])
def test_leaving_the_finite_range_keeps_the_last_finite_state(way: Way, adaptive: bool) -> None:
    """v = a k sinh(k t), until the work of a step, the gain of v²/2, exceeds 1e150, the largest allowed value.

    The run keeps the state of the step before.
    """
    h, k, a = 0.05, 20.0, 1e-3
    tolerance = {"rtol": 1e-11, "atol": 1e-13} if adaptive else {}
    found = way(GROWING, (a, 0.0), h, 2000, integrator="dop853", backend="python", **tolerance)
    velocity = a * k * np.sinh(k * h * np.arange(300))
    assert found.reason == "diverged"
    assert round(found.steps) == int(np.argmax(0.5 * np.diff(velocity**2) > 1e150))
    assert found.velocity == pytest.approx(a * k * math.sinh(k * h * found.steps), rel=1e-5)
    assert found.angle == pytest.approx(found.velocity / k, rel=1e-5)


# --- equations that were not solved, tolerances that were not met ----------------------------------------------------

UNSOLVED_RUN = (VACUUM, (3.0, 0.0), 1.0, 40)
UNSOLVED_WITH = "lobatto3c"


def remedies(message: str) -> tuple[float, str]:
    """Return step [s] and method that a warning suggests."""
    found = re.search(r"take steps of (\S+) s or less.*, or (\w+), which", message)
    assert found, message
    return float(found[1]), found[2]


@pytest.mark.quick("by_vector")
@pytest.mark.parametrize("way", WAYS)
def test_an_unsolved_equation_is_warned_of_and_its_remedies_help(way: Way) -> None:
    scene, start, h, most = UNSOLVED_RUN
    with pytest.warns(UserWarning, match=UNSOLVED) as said:
        found = way(scene, start, h, most, integrator=UNSOLVED_WITH, backend="python")
    assert found.reason == "diverged"
    (warning,) = [str(one.message) for one in said if UNSOLVED in str(one.message)]
    shorter, other = remedies(warning)
    steps = integrators.get(UNSOLVED_WITH)
    assert by_rollout(scene, (found.angle, found.velocity), shorter, 1, integrator=steps, backend="python").reason == ""
    assert by_rollout(scene, (found.angle, found.velocity), h, 1, integrator=other, backend="python").reason == ""


@pytest.mark.slow
def test_it_is_said_once_and_not_at_all_where_nobody_wants_to_hear_it() -> None:
    scene, start, h, most = UNSOLVED_RUN
    for shape in ((), (2,)):
        rollout(scene, integrator=UNSOLVED_WITH, angle=np.full(shape, 3.0) if shape else 3.0, dt=h, duration=most * h,
                backend="python", warn=False)
    env = gym.make(ENV, scene=scene, dt=h, integrator=UNSOLVED_WITH, backend="python", task="free")
    env.reset(options={"angle": start[0]})
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        for _ in range(most):
            if env.step(np.zeros(1, np.float32))[2]:
                env.reset(options={"angle": start[0]})
    assert [UNSOLVED in str(one.message) for one in said] == [True]


def test_nonsense_of_an_implicit_method_is_not_blamed_on_its_equations() -> None:
    """The midpoint rule solves its equations at steps of five periods, and gains energy nevertheless."""
    r = rollout(VACUUM, integrator="implicit_midpoint", angle=3.0, dt=10.0, duration=300.0, backend="python")
    assert r.stop_reason == "diverged"


@pytest.mark.parametrize("way", SINGLE)
def test_no_step_short_enough_is_warned_of(way: Way) -> None:
    with pytest.warns(UserWarning, match=r"even the shortest step exceeds its tolerance; take a larger rtol"):
        found = way(Scene(effects=(Blow(),)), (0.0, 1.0), 0.3, 8, integrator="dop853", backend="python", rtol=1e-8)
    assert found.reason == "step_too_short"
    assert found.velocity == pytest.approx(1.0 / math.sqrt(1.0 - 0.3 * found.steps), rel=1e-5)


# --- steps beyond a method's limit -----------------------------------------------------------------------------------

# omega0 h and gamma h: Hairer & Wanner 1996, IV.2, of AB4 V.1; Hairer, Lubich & Wanner 2006, I.5.2.
LINEAR = {"rk4": 2.0 * math.sqrt(2.0), "kutta3": math.sqrt(3.0), "velocity_verlet": 2.0, "symplectic_euler": 2.0}
DRAG = {"forward_euler": 2.0, "rk4": 2.785293563405282, "heun": 2.0, "symplectic_euler": 2.0, "ab4": 0.3}


def made(way: str, scene: Scene, method: str, h: float, **options: Any) -> list[str]:
    """Return the warnings of long steps when an environment or run is created, which runs for one step at most."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        if way == "env":
            gym.make(ENV, scene=scene, integrator=method, dt=h, backend="python", **options)
        elif way == "vector":
            gym.make_vec(ENV, num_envs=3, scene=scene, integrator=method, dt=h, backend="python", **options)
        else:
            rollout(scene, integrator=method, dt=h, duration=h, backend="python", angle=np.zeros(2) if way == "batch"
                    else 0.0, velocity=0.0, **options)
    return [str(one.message) for one in said if TOO_LONG in str(one.message)]


def run_of(scene: Scene, method: str, h: float, **options: Any) -> Rollout:
    return rollout(scene, integrator=method, dt=h, duration=2000 * h, backend="python", warn=False, **options)


@pytest.mark.parametrize("way", ["env", "vector", "rollout", "batch"])
def test_everything_that_runs_warns_beyond_a_limit_and_only_there(way: str) -> None:
    for method, limit in (("rk4", LINEAR["rk4"]), ("velocity_verlet", 2.0)):
        assert not made(way, TEXTBOOK, method, 0.99 * limit / TEXTBOOK.omega0)
        assert len(made(way, TEXTBOOK, method, 1.01 * limit / TEXTBOOK.omega0)) == 1
    assert not made("rollout", TEXTBOOK, "rk4", 1.0, warn=False)


@pytest.mark.parametrize("method", LINEAR)
def test_omega0_h_beyond_the_limit_and_what_helps(method: str) -> None:
    h = 1.02 * LINEAR[method] / TEXTBOOK.omega0
    assert not made("rollout", TEXTBOOK, method, 0.98 * LINEAR[method] / TEXTBOOK.omega0)
    (message,) = made("rollout", TEXTBOOK, method, h)
    shorter, other = remedies(message)
    assert h / 4 <= shorter < h
    for step, name in ((shorter, method), (h, other)):
        r = run_of(TEXTBOOK, name, step)
        assert r.stop_reason == ""
        assert np.max(np.abs(r.angle)) <= 1.5 * TEXTBOOK.run.angle
    assert run_of(TEXTBOOK, method, h).stop_reason == "diverged"


@pytest.mark.parametrize("method", DRAG)
def test_gamma_h_beyond_the_limit_and_what_helps(method: str) -> None:
    h = 0.01

    def scene(share: float) -> Scene:
        return Scene(effects=(SmallAngleGravity(), LinearDrag(gamma=share * DRAG[method] / h)))

    assert not made("rollout", scene(0.95), method, h)
    (message,) = made("rollout", scene(1.06), method, h)
    shorter, other = remedies(message)
    assert integrators.get(other).l_stable
    for step, name in ((shorter, method), (h, other)):
        r = run_of(scene(1.06), name, step, angle=0.5, velocity=1.0)
        assert np.max(np.abs(r.velocity)) <= 2.0
    assert run_of(scene(1.06), method, h, angle=0.5, velocity=1.0).stop_reason == "diverged"


def test_quadratic_drag_counts_by_the_speed_of_the_start() -> None:
    """The derivative of c v² is 2 c v; it is zero at rest."""
    scene = Scene(effects=(Gravity(), QuadraticDrag(c=1.0)))
    for speed, long in ((0.0, False), (0.98 * 139.26, False), (1.02 * 139.26, True)):
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            rollout(scene, integrator="rk4", angle=0.0, velocity=speed, dt=0.01, duration=0.01, backend="python")
        assert bool(said) == long


@pytest.mark.parametrize("speed", [-3.0, 0.5])
def test_the_slope_of_all_losses(speed: float) -> None:
    medium = SCENES["water"].medium
    scene = Scene(medium=medium, effects=(Gravity(), LinearDrag(gamma=0.3), QuadraticDrag(c=0.2)))
    assert flow.damping_rate(scene, speed) == pytest.approx(0.3 + 0.4 * abs(speed), rel=1e-6)
    sphere = Scene(medium=medium, effects=(Gravity(), SphereDrag()))
    body = sphere.body

    def loss(v: float) -> float:
        """Return the torque of the drag 1/2 rho C_d A V² over the inertia [1/s²]."""
        speed = v * body.length
        drag = flow.sphere_drag_coefficient(flow.reynolds_number(speed, body, medium))
        return 0.5 * medium.density * drag * math.pi * body.radius**2 * speed**2 * body.length / sphere.inertia

    wanted = (loss(1.01 * abs(speed)) - loss(0.99 * abs(speed))) / (0.02 * abs(speed))
    assert flow.damping_rate(sphere, speed) == pytest.approx(wanted, rel=1e-4)


ONE_KICK = tuple(name for name, m in integrators.METHODS.items()
                 if m.symplectic and not m.implicit and m.evaluations == 1 and not m.exact)


@pytest.mark.parametrize("method", ONE_KICK)
def test_kicks_of_full_gravity_beyond_the_last_circle(method: str) -> None:
    """Greene 1979: omega0 h = 0.9857; the small-angle scene has no such bound."""
    assert not made("rollout", VACUUM, method, 0.98 / VACUUM.omega0)
    assert made("rollout", VACUUM, method, 0.99 / VACUUM.omega0)
    assert not made("rollout", TEXTBOOK, method, 0.99 / TEXTBOOK.omega0)
    assert not made("rollout", VACUUM, "exact", 0.99 / VACUUM.omega0)


def test_each_environment_of_a_vector_counts() -> None:
    h = 0.9 * LINEAR["rk4"] / TEXTBOOK.omega0
    assert not made("vector", TEXTBOOK, "rk4", h, length=np.array([1.0, 2.0, 3.0]))
    assert made("vector", TEXTBOOK, "rk4", h, length=np.array([1.0, 0.5, 3.0]))
    between = {"length": np.array([0.8, 0.9, 2.0]), "gravity": np.array([5.0, 12.0, 20.0])}
    each = Each(TEXTBOOK, "scene", None, between, 3)
    assert max(scene.omega0 for scene in each.swiftest()) == pytest.approx(math.sqrt(12.0 / 0.9))


# --- presets ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SCENES)
def test_presets_at_their_usual_step_are_warned_of_only_where_they_diverge(name: str) -> None:
    """Only Adams-Bashforth methods of 4 and more steps are warned of, in `overdamped`, where gamma h = 0.457.

    Their limits are 0.3, 0.163 and 0.088 (Hairer & Wanner 1996, V.1).
    """
    scene, wrong = SCENES[name], []
    for method in fitting(scene).values():
        wrong += [method.name] if list(too_long(method, (scene,), scene.run.dt)) else []
    assert wrong == (["ab4", "ab5", "ab6"] if name == "overdamped" else [])
    for method in wrong:
        r = rollout(scene, integrator=method, duration=30.0, backend="python", warn=False)
        assert r.stop_reason == "diverged"


@pytest.mark.parametrize("z", [0.03, SHORT[0]])
@pytest.mark.parametrize("g", [0.0, 1e-3, SHORT[1]])
def test_short_steps_are_within_every_limit(z: float, g: float) -> None:
    """Warnings about short steps need no stability limits, so none is computed."""
    for method in integrators.METHODS.values():
        assert ("velocity_free" in method.needs and g) or not beyond_limit(method, z, g), method.name


def test_the_usual_environment_computes_no_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: Any) -> bool:
        raise AssertionError("a limit was computed")

    monkeypatch.setattr(limits, "beyond_limit", never)
    for scene in ("lab", "vacuum", "exercise", "sticky_bearing", "windy"):
        gym.make(ENV, scene=scene, backend="python")
    with pytest.raises(AssertionError, match="a limit was computed"):
        gym.make(ENV, scene="lab", dt=0.3, backend="python")


def test_auto_and_tolerances_choose_their_own_steps() -> None:
    assert not made("env", TEXTBOOK, "dop853", 2.0, rtol=1e-8)
    assert made("env", TEXTBOOK, "dop853", 2.0)


# --- scenes that no step can follow -----------------------------------------------------------------------------------


@pytest.mark.parametrize("gravity", [1e100, 1e300])
@pytest.mark.parametrize(("name", "options"), [
    ("rk4", {}), ("velocity_verlet", {}), ("dop853", {"rtol": 1e-6}), ("gauss4", {}),
])
def test_no_remedy_is_named_where_none_helps(gravity: float, name: str, options: dict[str, Any]) -> None:
    """A pendulum of length L swings on the time scale sqrt(L/g); a step of 1e48 of these has no remedy."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        run = rollout("vacuum", integrator=name, gravity=gravity, dt=0.01, duration=0.05, backend="python", **options)
    scale = math.sqrt(run.scene.body.length / gravity)
    message = str(caught[-1].message)
    assert run.stop_reason in ("diverged", "step_too_short")
    assert f"a time scale of {scale:.3g} s" in message
    assert "check the scene's parameters" in message
    assert not re.search(r"\btake\b|which is stable", message)


@pytest.mark.parametrize("z", [40.0, 1e3, 1e8])
def test_growth_in_steps_of_many_periods_is_seen(z: float) -> None:
    """In a step of z = omega0 h, rk4 multiplies a swing by about z**4/24, however many periods that step has."""
    message, = too_long(integrators.get("rk4"), (VACUUM,), z / VACUUM.omega0)
    assert "in a step" in message
    assert remedies(message)[0] <= math.sqrt(8.0) / VACUUM.omega0
    if z == 40.0:
        assert limits.growth_per_period(integrators.get("rk4"), z, 0.0) == pytest.approx(math.log(z**4 / 24), rel=1e-2)


def test_an_exact_method_is_no_map() -> None:
    """Closed forms evaluate one force per step, but they are no map of kicks: no step is too long for them."""
    assert not list(too_long(integrators.get("exact"), (VACUUM,), 100.0 / VACUUM.omega0))
