"""Checks of the twin in JAX, run by test_twin.py in an environment that has JAX.

Values are compared with the compiled or interpreted run, derivatives with 40-digit arithmetic (mp_steps.py).
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from choice import FULL, chosen, kind, rolled
from mp_steps import Steps, derivative, slopes
from mpmath import mpf

import integrators
import pendulum_env.jax as twin
from pendulum_env import SCENES, Scene
from pendulum_env.engine.machine import fitting, numbers_of
from pendulum_env.study import PLAIN

jax.config.update("jax_enable_x64", True)
PLACES = {name: scene.with_effects(effect.smoothed(0.1) for effect in scene.effects) for name, scene in SCENES.items()}
"""All scenes, with dry friction smoothed over 0.1 rad/s."""
STEPS, FEW, FIRST = 200, 8, 3
NEAR = {"verner6": 1e-11, "verner8": 1e-12}
"""Method -> its bound on relative differences of values, where large coefficients of its table magnify rounding."""
SENSITIVE = {("gymnasium", "verner6"): 5e-11}
"""Scene and method -> bound, where a change of the start by its last digit alone moves the end by 1e-11."""


@pytest.fixture
def forgetting() -> Iterator[None]:
    """Compiled programs of many methods would fill the memory."""
    yield
    jax.clear_caches()


def pairs() -> Iterator[tuple[str, str]]:
    """Every method in a scene that its name chooses, and every scene with the plain method that its name chooses."""
    for method in integrators.METHODS:
        yield chosen([name for name, scene in PLACES.items() if method in fitting(scene)], method), method
    for name, scene in PLACES.items():
        yield name, chosen([method for method in fitting(scene) if method in PLAIN], name)


KINDS = list(dict.fromkeys(
    [*((scene, method) for scene, method in pairs() if kind(method) == method), *list(pairs())[-len(PLACES):]]))
"""Pairs for derivatives: every kind of method, which are all methods with LAB_PENDULUM_GRID=full, and every scene."""
ALL = [(name, method) for name, scene in PLACES.items() for method in fitting(scene)]
PAIRS = [*(ALL if FULL else KINDS), ("lab", "taylor14")]
"""Pairs for values; with LAB_PENDULUM_GRID=full, every scene with every method that fits."""
LIGHT = "exercise"
"""A scene with drag and few operations."""
OTHERS = [(LIGHT if method in fitting(PLACES[LIGHT]) else scene, method) for scene, method in dict.fromkeys(pairs())
          if method not in {method for _, method in PAIRS}]
"""The other methods, whose programs differ from those of PAIRS by numbers alone: their first steps, not compiled."""


@pytest.mark.usefixtures("forgetting")
@pytest.mark.parametrize(("scene", "method"), PAIRS)
def test_values_are_those_of_the_run_in_floats(scene: str, method: str) -> None:
    compare(scene, method, STEPS)


@pytest.mark.parametrize(("scene", "method"), OTHERS)
def test_values_of_the_first_steps_are_those_of_every_other_method(scene: str, method: str) -> None:
    with jax.disable_jit():
        compare(scene, method, FEW if integrators.get(method).memory_with(()) else FIRST)


def compare(scene: str, method: str, steps: int) -> None:
    place = PLACES[scene]
    h = place.run.dt
    share = 0.3 if any(effect.controlled for effect in place.effects) else 0.0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        run = rolled(place, integrator=method, dt=h, duration=steps * h, control=share)
    ours = twin.rollout(place, integrator=method, dt=h, steps=steps, control=share)
    assert ours.dtype == "float64"
    assert ours.stop_reason == run.stop_reason
    taken, bound = len(run.angle), SENSITIVE.get((scene, method), NEAR.get(method, 1e-12))
    for name in ("angle", "velocity"):
        truth = getattr(run, name)
        assert np.asarray(getattr(ours, name))[:taken] == pytest.approx(truth, rel=0, abs=bound * np.abs(truth).max())
    energy = np.abs(run.energy).max() + np.abs(run.ledger.work).max() + np.abs(run.ledger.heat).max()
    for name, truth in (("energy", run.energy), ("work", run.ledger.work), ("heat", run.ledger.heat),
                        ("energy_residual", run.energy_residual)):
        assert np.asarray(getattr(ours, name))[:taken] == pytest.approx(truth, rel=0, abs=bound * energy)


def calm(scene: Scene) -> Scene:
    """Return a scene without random effects, whose numbers only floats can draw."""
    return scene.with_effects(effect for effect in scene.effects if not effect.draws)


@pytest.mark.usefixtures("forgetting")
@pytest.mark.parametrize(("scene", "method"), KINDS)
def test_derivatives_are_those_of_forty_digits(scene: str, method: str) -> None:
    """By angle, velocity, step, every action and every parameter, of angle, velocity, work and heat after 8 steps."""
    place, one = calm(PLACES[scene]), integrators.get(method)
    h, start = place.run.dt, (place.run.angle, place.run.velocity + 0.3)
    actions = np.full(FEW, 0.25) if one.memory_with(()) else np.linspace(-0.4, 0.7, FEW)
    given = {name: float(value) for name, value in place.parameters().items() if isinstance(value, float) and value}
    steps = Steps(place, one, FEW)
    sums = list(steps.shape.quadratures)
    weights = dict(zip(sums, (0.7, 0.4), strict=False))

    def result(angle: Any, velocity: Any, h: Any, actions: Any, parameters: Any) -> Any:
        run = twin.rollout(place, integrator=one, angle=angle, velocity=velocity, dt=h, every=FEW, actions=actions,
                           parameters=parameters)
        inertia = _inertia(place, parameters)
        return (run.angle[-1] + 0.5 * run.velocity[-1]
                + sum(weight * getattr(run, name)[-1] / inertia for name, weight in weights.items()))

    def truth(angle: Any, velocity: Any, h: Any, controls: Any, numbers: Any) -> list[Any]:
        values = steps(angle, velocity, h, controls, numbers)
        return [values[0] + values[1] / 2 + sum(mpf(w) * value for w, value in zip(
            weights.values(), values[2:], strict=True))]

    ours = jax.jit(jax.grad(result, argnums=(0, 1, 2, 3, 4)))(
        *map(jnp.asarray, start), jnp.asarray(h), jnp.asarray(actions),
        {name: jnp.asarray(value) for name, value in given.items()})
    q, v, step, controls = mpf(start[0]), mpf(start[1]), mpf(h), [mpf(value) for value in actions]
    shared = mpf(actions[0])
    controls = [shared] * FEW if one.memory_with(()) else controls
    numbers = {name: mpf(value) for name, value in numbers_of(place, False).items()}
    wanted = [derivative(lambda x: truth(x, v, step, controls, numbers), q),
              derivative(lambda x: truth(q, x, step, controls, numbers), v),
              derivative(lambda x: truth(q, v, x, controls, numbers), step)]
    for mine, (true,) in zip(ours[:3], wanted, strict=True):
        assert float(mine) == pytest.approx(float(true), rel=1e-9, abs=1e-12)
    if "control" in steps.shape.extra or steps.shape.remembered:
        if one.memory_with(()):
            (true,) = derivative(lambda x: truth(q, v, step, [x] * FEW, numbers), shared)
            assert float(ours[3].sum()) == pytest.approx(float(true), rel=1e-9, abs=1e-12)
        else:
            for i in (0, FEW - 1):
                (true,) = derivative(lambda x, i=i: truth(q, v, step, [*controls[:i], x, *controls[i + 1:]], numbers),
                                     controls[i])
                assert float(ours[3][i]) == pytest.approx(float(true), rel=1e-9, abs=1e-12)
    by_number = {}
    for name in steps.shape.parameters:
        def moved(x: Any, name: str = name) -> list[Any]:
            return truth(q, v, step, controls, {**numbers, name: x})

        (by_number[name],) = derivative(moved, numbers[name])
    looked = 0
    for name, value in given.items():
        slope = slopes(place, name, value)
        if slope is None:
            continue
        terms = [float(by_number[one]) * slope[one][0] for one in by_number]
        bound = 1e-10 * sum(map(abs, terms)) + sum(abs(float(by_number[one])) * slope[one][1] for one in by_number)
        assert float(ours[4][name]) == pytest.approx(math.fsum(terms), rel=1e-9, abs=bound)
        looked += 1
    assert looked


def _inertia(scene: Scene, parameters: Any) -> Any:
    from pendulum_env.jax.parameters import numbers, with_parameters
    return numbers(with_parameters(scene, parameters))["inertia"]
