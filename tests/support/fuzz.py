"""Configurations at random: scene, damping, method, step, starts, parameters, actions; and what holds for each."""

from __future__ import annotations

import math
import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators import Method
from pendulum_env import SCENES, Scene, SceneError
from pendulum_env.engine.machine import DIAGNOSTICS, fitting
from pendulum_env.physics.damping import build_scene
from pendulum_env.physics.effects import DAMPINGS
from pendulum_env.tasks import TASKS

Array = NDArray[np.float64]
ROUNDING = 1e-13
"""Part of the energies that rounding may leave in a short run's residual."""
ASYMPTOTIC = 0.3
"""Up to this part of the fastest time scale a step's error is that of its order."""
ENDLESS = ("quality_factor", "error_estimate")
"""What may be inf."""


@dataclass(frozen=True)
class Drawn:
    """One configuration: keywords of an environment, its scene and method."""

    scene: Scene
    method: Method
    keywords: Mapping[str, Any]

    def __str__(self) -> str:
        return f"{self.scene.name}, {self.method.name}, {self.keywords}"


def drawn(source: random.Random) -> Drawn:
    """A configuration of an environment; parameters of scenes that make no sense are drawn again."""
    while True:
        name, damping = source.choice(list(SCENES)), source.choice(["scene", "scene", "none", *DAMPINGS])
        given = {key: _near(source, value) for key, value in SCENES[name].parameters().items()
                 if isinstance(value, float) and value and source.random() < 0.2}
        try:
            scene = build_scene(name, damping, given)
        except SceneError:
            continue
        method = source.choice(list(fitting(scene).values()))
        return Drawn(scene, method, {
            "scene": name, "damping": damping, "integrator": method.name, **given, "task": source.choice(list(TASKS)),
            "dt": 10.0 ** source.uniform(-3.5, -0.5), "substeps": source.randint(1, 4),
            "diagnostics": ("energy", *(name for name in source.sample(DIAGNOSTICS[1:-1], source.randint(0, 2))
                                        if name not in scene.body.lacks)),
            "speed_limit": source.choice([None, math.inf, 5.0]),
        })


def _near(source: random.Random, value: float) -> float:
    return value * float(2.0 ** source.uniform(-2.0, 2.0))


def actions(source: np.random.Generator, size: int) -> Array:
    """Shares of the motor for so many environments, extremes among them."""
    share = source.uniform(-1.0, 1.0, (size, 1))
    odd = source.random((size, 1)) < 0.2
    return np.where(odd, source.choice([-1.0, 0.0, 1.0, 1e308, -1e308, 5e-324], (size, 1)), share)


def own_rate(scene: Scene) -> float:
    """The largest rate of a scene itself [1/s]: of small swings, of drags and of drives."""
    squares = {"gravity_rate", "spring_rate"}
    rates = [abs(value) for name, value in scene.coefficients.items() if name.endswith("_rate") and name not in squares]
    return max([scene.omega0, *rates])


def smoothness(scene: Scene) -> float:
    """Up to which order methods keep theirs: dry friction jumps with the velocity's sign, other drags' slopes do."""
    lasting = {"linear_drag", "bearing_friction"}
    if any(effect.dry for effect in scene.effects):
        return 1.0
    return 2.0 if any(effect.name not in lasting for effect in scene.of_kind("dissipative")) else 30.0


def most_residual(
    scene: Scene, method: Method, steps: Any, h: float, rate: float, inertia: Any, velocity: Any, acceleration: Any,
    energies: Any,
) -> Any:
    """Return the largest energy residual that a method's order allows: ``E (k n (r h)**(p + 1) + rounding)``.

    A method of order p errs by O(h**(p + 1)) in each of n steps (Hairer, Norsett & Wanner 1993, II.3), in units of the
    fastest rate r (the largest of the scene's own rate, the velocity, the root of the acceleration, and the
    acceleration over the velocity) and of the energies E, those of velocity and acceleration included. k is at least
    1; for a multistep method at least the number of steps over which it reaches back, and for a splitting the sum of
    ``|w|**(p + 1)`` over its parts ``w h`` of the step, which may be longer than the step (Yoshida 1990). The bound is
    inf where these expansions in powers of h need not hold: beyond ASYMPTOTIC, and where a multistep method reaches
    back over more than 1/r.
    """
    order, reach = min(float(method.order), smoothness(scene)), 1 + len(method.memory)
    parts = [abs(float(flow[1])) for flow in getattr(method, "flows", ())]
    factor = max(reach, sum(part ** (order + 1.0) for part in parts))
    whole = energies + inertia * (velocity * velocity + acceleration)
    with np.errstate(over="ignore", invalid="ignore"):
        relative = acceleration / np.maximum(velocity, np.finfo(float).tiny)
        fastest = np.max(np.broadcast_arrays(rate, velocity, np.sqrt(acceleration), relative), axis=0) * h
        most = whole * (factor * steps * fastest ** (order + 1.0) + ROUNDING)
    return np.where((fastest < ASYMPTOTIC) & (fastest * reach < 1.0), most, np.inf)


def check_ledger(info: Mapping[str, Array], initial: Array, shown: Sequence[Any] | Array) -> None:
    """AssertionError unless energy - energy at the start = work - heat + residual, to the rounding of the sum."""
    energy, work, heat, residual = (info[name][shown] for name in ("energy", "work", "heat", "energy_residual"))
    start = initial[shown]
    size = abs(energy) + abs(start) + abs(work) + abs(heat)
    assert np.all(abs((energy - start) - (work - heat + residual)) <= 4.0 * np.finfo(float).eps * size)
