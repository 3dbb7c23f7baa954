"""Effects are tried before they are used: what they declare is compared with their torque."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from given_effects import scene_of

from pendulum_env import SCENES, Scene, rollout
from pendulum_env.lab import period
from pendulum_env.physics import consistency
from pendulum_env.physics.body import Body
from pendulum_env.physics.consistency import Declared, check_functions, compared, declared_by, states, stiffness_at_rest
from pendulum_env.physics.effects import EFFECTS, Effect, Fibre, Gravity
from pendulum_env.physics.units import SceneError, si

ROLES = ("by_angle", "by_velocity", "by_speed", "potential", "store", "mean", "mean_by_end", "flow")
DECLARED = [(name, role) for name in EFFECTS for role in ROLES
            if EFFECTS[name].torque and getattr(EFFECTS[name], role)]


def spoilt(function: Callable[..., float], factor: float) -> Callable[..., float]:
    """Return a function with other values and the same arguments."""
    def other(*given: float) -> float:
        return factor*function(*given)

    other.__signature__ = inspect.signature(function)  # type: ignore[attr-defined]
    return other


# --- the package's own effects ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", EFFECTS)
def test_effects_of_the_package_pass(name: str) -> None:
    """They are not tried when they are used; test_effects.py compares them in 40 digits."""
    scenes = [scene_of(name), *(scene for scene in SCENES.values() if scene.has(name))]
    for scene in scenes:
        for effect in scene.effects:
            check_functions(effect, scene.coefficients, scene.omega0)


@pytest.mark.parametrize(("name", "role"), DECLARED)
def test_each_of_their_functions_is_refused_when_it_is_wrong_by_a_thousandth(
    name: str, role: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = scene_of(name)
    effect = declared_by(scene.effects[0])
    monkeypatch.setattr(consistency, "declared_by", lambda one: one)
    wrong = effect._replace(**{role: spoilt(getattr(effect, role), 1.001)})
    with pytest.raises(SceneError, match=rf"{role}(_by_end)? of the effect {name} contradicts its torque: it is "):
        check_functions(wrong, scene.coefficients, scene.omega0)


def test_states_are_drawn_once_for_all() -> None:
    first, again = (list(states(("gust",), 3.0)) for _ in range(2))
    assert first == again
    assert len(first) == 60
    assert first[0]["angle"] == first[0]["velocity"] == 0.0
    assert max(abs(state["velocity"]) for state in first) > 10.0


# --- effects of one's own ---------------------------------------------------------------------------------------------


def hardening(angle: float, own_rate: float) -> float:
    return -own_rate*angle*(1.0 + angle*angle)


def spring_by_angle(angle: float, own_rate: float) -> float:
    return -own_rate*(1.0 + 3.0*angle*angle)


def spring_potential(angle: float, own_rate: float) -> float:
    return own_rate*(0.5*angle*angle + 0.25*angle*angle*angle*angle)


@dataclass(frozen=True)
class Spring(Effect):
    """A spring of one's own."""

    spring: float = si(0.1, "N m/rad", "torque over angle near the bottom")

    name = "own"
    kind = "conservative"
    periodic = False
    equation = "- {own_rate:.6g} theta (1 + theta^2)"
    source = "made up"
    torque = staticmethod(hardening)
    by_angle = staticmethod(spring_by_angle)
    potential = staticmethod(spring_potential)

    def coefficients(self, scene: Any) -> dict[str, float]:
        return {"own_rate": self.spring/scene.inertia}


def drag(velocity: float, own_rate: float) -> float:
    return -own_rate*velocity


def with_drag(**roles: Any) -> Effect:
    """Return a drag of one's own with further functions."""
    @dataclass(frozen=True)
    class Own(Effect):
        """A drag of one's own."""

        name, kind, equation, source = "own", "dissipative", "- {own_rate} theta'", "made up"
        torque = staticmethod(drag)

        def coefficients(self, scene: Any) -> dict[str, float]:
            return {"own_rate": 0.4}

    for role, value in roles.items():
        setattr(Own, role, staticmethod(value))
    return Own()


BODY = Body(length=0.5, mass=0.2)
WEIGHT = 0.2*9.81*0.5


def without_slope(angle: float, own_rate: float) -> float:
    return -own_rate*math.sin(angle)


@pytest.mark.parametrize("own_slope", [True, False])
@pytest.mark.parametrize("effects", [(Gravity(),), ()])
@pytest.mark.parametrize("share", [8.0, 0.5, -0.5])
def test_the_stiffness_at_rest_is_that_of_the_torque(
    share: float, effects: tuple[Effect, ...], own_slope: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """``omega0**2 = (m g L + kappa)/I``; left out, the spring of 8 m g L left omega0 at a third of it."""
    monkeypatch.setattr(Spring, "by_angle", staticmethod(spring_by_angle) if own_slope else None)
    scene = Scene("sprung", BODY, effects=(*effects, Spring(share*WEIGHT)))
    beside = WEIGHT if effects or share < 0.0 else 0.0
    assert scene.omega0 == pytest.approx(math.sqrt((beside + share*WEIGHT)/(0.2*0.25)), rel=1e-11)


def test_omega0_is_that_of_the_motion() -> None:
    scene = Scene("sprung", BODY, effects=(Gravity(), Spring(8.0*WEIGHT)))
    run = rollout(scene, angle=1e-3, velocity=0.0, duration=10.0, dt=0.002, integrator="gauss4", backend="python")
    assert 2.0*math.pi/period(run).value == pytest.approx(scene.omega0, rel=1e-5)
    env = gym.make("LabPendulum-v0", scene=scene, backend="python", task="free")
    assert env.observation_space.shape == (3,)
    with pytest.warns(UserWarning, match="omega0"):
        rollout(scene, angle=0.1, duration=1.0, dt=0.25, integrator="rk4", backend="python")


def test_a_bottom_that_is_not_stable_leaves_the_weights_scale() -> None:
    scene = Scene("double well", BODY, effects=(Gravity(), Spring(-3.0*WEIGHT)))
    assert scene.omega0 == Scene("free", BODY, effects=(Gravity(),)).omega0


def test_a_spring_of_the_package_is_as_its_torque() -> None:
    scene = Scene("torsion", replace(BODY, suspension="rod"), effects=(Gravity(), Fibre(0.3)))
    found = stiffness_at_rest(Fibre(0.3), scene.coefficients, scene.inertia)
    assert found == pytest.approx(scene.springs, rel=1e-12)


def test_in_a_vector_each_has_its_own_stiffness() -> None:
    scene = Scene("sprung", BODY, effects=(Gravity(), Spring(0.1)))
    given = np.array([0.1, 3.0, 8.0])
    vec = gym.make_vec("LabPendulum-v0", num_envs=3, scene=scene, spring=given, task="free", backend="python")
    _, info = vec.reset(seed=1, options={"angle": 0.5, "velocity": 0.0})
    well = given*(0.5*0.25 + 0.25*0.0625)
    assert info["potential_energy"] == pytest.approx(WEIGHT*(1.0 - math.cos(0.5)) + well, rel=1e-9)


WRONG = {
    "potential": ({"potential": lambda angle, own_rate: own_rate*angle*angle}, "slope of the potential"),
    "sign of the potential": ({"potential": lambda angle, own_rate: -spring_potential(angle, own_rate)},
                              "slope of the potential"),
    "derivative": ({"by_angle": lambda own_rate: -own_rate}, "derivative by_angle"),
    "derivative by velocity": ({"by_velocity": lambda own_rate: own_rate}, "derivative by_velocity"),
    "mean": ({"mean": hardening}, "mean"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_function_is_refused_with_its_values(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    roles, named = WRONG[case]
    for role, function in roles.items():
        monkeypatch.setattr(Spring, role, staticmethod(function))
    with pytest.raises(SceneError) as caught:
        Scene("sprung", BODY, effects=(Gravity(), Spring()))
    assert str(caught.value).startswith(f"The {named} of the effect own contradicts its torque: it is ")
    assert " rad/s, where " in str(caught.value)


def exact(velocity: float, duration: float, own_rate: float) -> float:
    return velocity*math.exp(-own_rate*duration)


def test_flows_are_compared() -> None:
    """``v' = -0.4 v`` has ``v exp(-0.4 t)``, and not one step of Euler's method."""
    scene = Scene(effects=(Gravity(), with_drag(flow=exact, by_velocity=lambda own_rate: -own_rate)))
    assert scene.has("own")
    with pytest.raises(SceneError, match=r"The flow of the effect own contradicts its torque: it is .* the velocity "
                                         r"after 0\.1 s under the torque is "):
        Scene(effects=(Gravity(), with_drag(
            flow=lambda velocity, duration, own_rate: velocity*(1.0 - own_rate*duration))))


def test_a_declared_stiffness_is_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Spring, "restoring_stiffness", lambda self, scene: self.spring, raising=False)
    Scene("sprung", BODY, effects=(Gravity(), Spring(0.2)))
    monkeypatch.setattr(Spring, "restoring_stiffness", lambda self, scene: 2.0*self.spring)
    with pytest.raises(SceneError, match=r"restoring_stiffness of the effect own contradicts its torque: it is 0\.4 N m"
                                         r"/rad, where the torque's slope at rest gives 0\.2 N m/rad; leave it out"):
        Scene("sprung", BODY, effects=(Gravity(), Spring(0.2)))


FAILS: dict[str, tuple[Any, str]] = {
    "number": (3.0, r"torque of the effect own must be a function, not 3\.0"),
    "division": (lambda angle, own_rate: own_rate/angle, "torque of the effect own fails at angle 0, own_rate 2: "
                 "ZeroDivisionError"),
    "argument": (lambda angle, rate: rate, "torque of the effect own takes rate, which is neither a coefficient"),
    "nothing": (lambda angle: None, "torque of the effect own fails at angle 0: TypeError"),
    "infinite": (lambda own_rate: math.inf, "torque of the effect own must be finite: it is inf at the angle 0 rad"),
}


@pytest.mark.parametrize("case", FAILS)
def test_a_torque_that_fails_is_refused(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    torque, words = FAILS[case]
    monkeypatch.setattr(Spring, "kind", "drive")
    for role, function in (("torque", torque), ("by_angle", None), ("potential", None)):
        monkeypatch.setattr(Spring, role, function and staticmethod(function))
    with pytest.raises(SceneError, match=words):
        Scene(body=Body(length=1.0, mass=0.05), effects=(Gravity(), Spring()))


def test_coefficients_that_depend_on_their_own_stiffness_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Spring, "coefficients", lambda self, scene: {"own_rate": scene.omega0**2})
    with pytest.raises(SceneError, match="use omega0 or restoring, which depend on the stiffness of this effect; use"):
        Scene("sprung", BODY, effects=(Gravity(), Spring()))


def stepped(angle: float, velocity: float, own_rate: float) -> float:
    return own_rate*(1.0 if angle > 0.0 else -1.0)*abs(velocity)*velocity


def test_a_torque_with_kinks_and_jumps_is_accepted() -> None:
    """At them there is no slope; elsewhere there is one, which is compared."""
    effect = Declared("own", "drive", (), stepped, None, lambda angle, velocity, own_rate: (
        2.0*own_rate*(1.0 if angle > 0.0 else -1.0)*abs(velocity)), *[None]*6)
    values = {"own_rate": 2.0}
    for state in states((), 1.0):
        for _, declared, (value, error), _ in compared(effect, {**state, **values}):
            assert abs(declared - value) <= 1e-6*abs(value) + error


def test_an_effect_is_tried_once_for_its_parameters_and_those_of_the_package_never() -> None:
    consistency.check_declared.cache_clear()
    scene = Scene("sprung", BODY, effects=(Gravity(), Spring(0.2)))
    for changed in (0.2, 0.3, 0.2, 0.3):
        scene.replace(spring=changed)
    scene.with_effects((Gravity(),)).replace(length=0.4)
    assert consistency.check_declared.cache_info().misses == 2
