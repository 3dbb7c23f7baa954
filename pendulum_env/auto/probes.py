"""Probe episodes: runs with given starts and motor torques, in which the errors of methods are measured.

They are equal on every computer. Many random ones are run, and those most sensitive to errors are selected.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Mapping
from typing import NamedTuple

from pendulum_env.engine.machine import ANGLE, TURNS, TWO_PI, VELOCITY, Machine
from pendulum_env.engine.shape import DIVERGED
from pendulum_env.engine.spec import RunSpec
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError
from pendulum_env.tasks import TASKS
from pendulum_env.truth.probes import Probe

SEEDS = {True: 10, False: 12}
"""Number of random episodes for each start and kind of torque, with (True) and without (False) a motor."""
BEGUN = ("swing_up", "balance")
"""Tasks at whose starts probe episodes begin: hanging and upright."""
KEPT = 5
"""Number of the most sensitive random episodes to select, none with the same start and kind of torque as another."""
NUDGE = 1e-9
"""Size of the random displacements of one of two twin runs at every control step, to measure sensitivity [rad, omega0].
"""
LINEAR = 0.1
"""Distance of twin runs beyond which it no longer measures the growth of small errors [rad]."""
MOST_SUBSTEPS = 10**6
"""Largest number of steps in a control step of a probe episode."""
SCREEN, RESOLVED = "rk4", 0.4
"""The method that runs the twins, and its step as a share of the fastest time scale."""

Control = Callable[[random.Random, float, float], float]
"""Function of a random generator, the velocity [rad/s] and the last control that returns the next control."""


def _sign(source: random.Random) -> float:
    return 1.0 if source.random() < 0.5 else -1.0


def _held(source: random.Random, _velocity: float, before: float) -> float:
    """Return the largest motor torque with a random sign, which changes after about twenty control steps."""
    turned, side = source.random() < 0.05, _sign(source)
    return side if turned or not before else before


def _levels(source: random.Random, _velocity: float, before: float) -> float:
    """Return a random motor torque or none, which changes after a random time of about thirty control steps."""
    turned, still, level = source.random() < 0.03, source.random() < 0.3, 2.0 * source.random() - 1.0
    return (0.0 if still else level) if turned else before


RANDOM: Mapping[str, Control] = {
    "uniform": lambda source, _velocity, _before: 2.0 * source.random() - 1.0,
    "bang_bang": lambda source, _velocity, _before: _sign(source),
    "held": _held,
    "levels": _levels,
}
"""Random motor torques, as fractions of the largest, by name."""
NOTHING: Mapping[str, Control] = {"nothing": lambda _source, _velocity, _before: 0.0}
"""No motor torque."""
FIXED: Mapping[str, Control] = {
    **NOTHING,
    "pumping": lambda _source, velocity, _before: -1.0 if velocity < 0.0 else 1.0,
    "forwards": lambda _source, _velocity, _before: 1.0,
    "backwards": lambda _source, _velocity, _before: -1.0,
}
"""Motor torques without chance, by name; "pumping" adds the most energy."""


class Probes(NamedTuple):
    """Probe episodes of one scene, in which the errors of methods are measured.

    Attributes:
        plain: episodes with fixed starts and without random torques.
        chosen: episodes with random starts or torques, the most sensitive to small errors first.
    """

    plain: list[Probe]
    chosen: list[Probe]

    def up_to(self, growth: float) -> list[Probe]:
        """Select probe episodes in which a small error grows at most ``growth``-fold, the most sensitive first.

        They are all episodes without random torques, and the five (KEPT) most sensitive random ones, with at most one
        for each start and kind of torque.
        """
        plain, chosen = ([probe for probe in some if probe.growth <= growth] for some in self)
        first = {probe.name: probe for probe in reversed(chosen)}
        random_ones = sorted(first.values(), key=chosen.index)[:KEPT]
        return sorted((*random_ones, *plain), key=lambda probe: -probe.growth)


def probes(scene: Scene, dt: float, steps: int, tell: Callable[[float], None]) -> Probes:
    """Return probe episodes of a scene, which begin at its usual start and at those of two tasks (BEGUN).

    Their motor torques are fixed or random. The number of episodes in which small errors grow more than x-fold falls
    only as 1/x, because the bob may linger near the top. Therefore many episodes are run, and the most sensitive of
    them represent the others. ``tell`` is called with the fraction done.
    """
    machine = RunSpec.of(scene, SCREEN, diagnostics=(), backend="python", substeps=_screening(scene, dt)).machine()
    driven = any(effect.controlled for effect in scene.effects)
    fixed, kinds = (FIXED, RANDOM) if driven else (NOTHING, NOTHING)
    usual = "usual start", scene.run.angle, scene.run.velocity
    middles = [(name, float(TASKS[name].starts(0.5, 0.5, 1.0)[0]), 0.0) for name in BEGUN]
    plain = [_episode(machine, dt, steps, angle + 0.05 * (name in BEGUN), velocity, control, random.Random(0),
                      f"{name}, {kind}")
             for name, angle, velocity in (usual, *middles) for kind, control in fixed.items()]
    chosen: list[Probe] = []
    seeded = [usual, *middles] if driven or machine.drawn else middles
    for name, angle, velocity in seeded:
        for kind, control in kinds.items():
            for seed in range(SEEDS[driven]):
                source = random.Random(1 + seed)
                if name in BEGUN:
                    angle, velocity = map(float, TASKS[name].starts(
                        source.random(), source.random(), scene.omega0 or 1.0))
                chosen.append(_episode(machine, dt, steps, angle, velocity, control, source, f"{name}, {kind}"))
                tell(len(chosen) / (len(seeded) * len(kinds) * SEEDS[driven]))
    chosen.sort(key=lambda probe: -probe.growth)
    return Probes([*{(probe.angle, probe.velocity, probe.controls): probe for probe in plain}.values()], chosen)


def _screening(scene: Scene, dt: float) -> int:
    """Return the number of substeps that resolves the fastest time scale of a scene: swing, drive or drag."""
    values = scene.coefficients
    beats = [abs(values[effect.beat]) for effect in scene.effects if effect.beat]
    fastest = max(scene.omega0, abs(values.get("linear_drag_rate", 0.0)), *beats)
    needed = dt * fastest / RESOLVED
    if not needed <= MOST_SUBSTEPS:
        raise SceneError(
            f"dt = {dt:g} s is too long for integrator='auto': one control step of '{scene.name}' would need more than "
            f"{MOST_SUBSTEPS} substeps."
        )
    return max(1, math.ceil(needed))


def _episode(
    machine: Machine, dt: float, steps: int, angle: float, velocity: float, control: Control, source: random.Random,
    name: str,
) -> Probe:
    """Run an episode and a slightly disturbed twin run, and return it as a probe with the growth of the disturbance.

    The function ``control`` computes the torques from the undisturbed run's velocity. The run has at most ``steps``
    control steps, less if the episode ends early.
    """
    uniform = tuple(source.random() for _ in machine.drawn)
    one, other = (machine.state(angle, velocity, uniform) for _ in range(2))
    n, h, rate = machine.hold, dt / machine.hold, NUDGE * (machine.scene.omega0 or 1.0)
    controls: list[float] = []
    share, distance, signs = 0.0, NUDGE, random.Random(0)
    for _ in range(steps):
        share = control(source, one[VELOCITY], share)
        other[ANGLE] += NUDGE * _sign(signs)
        other[VELOCITY] += rate * _sign(signs)
        code = machine.advance(one, share, h, n) or machine.advance(other, share, h, n)
        if code == DIVERGED:
            break
        controls.append(share)
        if code:
            break
        distance = max(distance, abs(one[ANGLE] - other[ANGLE] + TWO_PI * (one[TURNS] - other[TURNS])))
    growth = distance / NUDGE if distance < LINEAR else math.inf
    return Probe(angle, velocity, tuple(controls), uniform, growth, name)
