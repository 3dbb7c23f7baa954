"""Probe episodes: runs with given starts and motor torques, in which errors of methods are measured, and their truth.

They are equal on every computer. Many random ones are run, and those most sensitive to errors are selected.

Two independent methods compute every reference solution (:class:`ProbeMotions`), in pieces that end at every turning
point.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

import integrators
from pendulum_env.engine.generate import program
from pendulum_env.engine.kernels import interpreted
from pendulum_env.engine.machine import ANGLE, TURNS, TWO_PI, VELOCITY, Machine
from pendulum_env.engine.reading import arguments
from pendulum_env.engine.shape import DIVERGED
from pendulum_env.engine.spec import RunSpec
from pendulum_env.engine.wrap import half_turns, side_of, without_half_turns
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError
from pendulum_env.tasks import TASKS
from pendulum_env.truth.answer import Truth
from pendulum_env.truth.pieces import Advance, PieceError, SceneEquation, doubled, extrapolated, path, problem_of

CHECK = integrators.get("verner9")
"""Method that checks the results of Gragg's extrapolation."""

SMOOTH = 4.0
"""Factor by which pieces are longer in scenes whose torques have no kink at turning points."""


@dataclass(frozen=True)
class Probe:
    """Probe episode: a start and a sequence of controls, on which methods are compared.

    Attributes:
        angle, velocity: start [rad, rad/s].
        controls: control of each control step until the episode ends.
        uniform: uniform random numbers from which gusts start.
        growth: factor by which errors of random sign at each control step have grown at the end; inf if chaotic.
        name: description of the start and the torques.
    """

    angle: float
    velocity: float
    controls: tuple[float, ...]
    uniform: tuple[float, ...]
    growth: float
    name: str


class ProbeMotions:
    """Reference solutions of probe episodes (test runs with given controls) in a scene, at control steps ``dt`` [s]."""

    def __init__(self, scene: Scene, dt: float) -> None:
        self.scene, self.dt = scene, dt
        self._machine = Machine(scene, "rk4", (), "python")
        problem = problem_of(scene)
        kinked = problem.dry or any("speed" in arguments(effect.torque) for effect in scene.effects if effect.torque)
        self._problem: SceneEquation = problem if kinked else replace(problem, longest=SMOOTH * problem.longest)
        generated = program(scene, self._machine.method, ())
        self._memory = generated.shape.remembered
        self._remember = interpreted(generated.text, generated.title).get("remember")

    def motion(self, probe: Probe, error: float) -> Truth:
        """Return the reference solution of a probe episode at its control steps.

        Its error is the largest difference of the two methods so far. ``error`` is the error [rad] that the solution
        should have at the end of the episode; rounding may make it larger.
        """
        enough = error / (10.0 * probe.growth)
        rows = self._path(probe, extrapolated(enough))
        others = self._path(probe, doubled(self.scene, CHECK, enough))
        (q, v, turns), (other, _, others_turns) = (
            np.array(states[: min(len(rows), len(others))]).T for states in (rows, others))
        how = f"Gragg's extrapolation, checked by {CHECK.name}"
        solution = Truth(np.array([k * self.dt for k in range(len(q))]), q, v, 0.0, how, turns=turns)
        return replace(solution, error=np.maximum.accumulate(solution.distance(other, others_turns)))

    def _path(self, probe: Probe, advance: Advance) -> list[tuple[float, float, float]]:
        """Return the states of a probe episode (test run with given controls) at the start and its control steps.

        A state is the angle from the nearer of bottom and top, the velocity, and the turns. They are computed with the
        function ``advance``; the list ends early where that fails.
        """
        problem, machine, dt = self._problem, self._machine, self.dt
        start = machine.state(probe.angle, probe.velocity, probe.uniform)
        entries = dict(zip(machine.names, start, strict=True))
        q, turns, v = entries["angle"], entries["turns"], entries["velocity"]
        memory = {name: entries[name] for name in self._memory}
        rows = [(q, v, turns)]
        for k, share in enumerate(probe.controls):
            if self._remember is not None:
                first = 1.0 if k == 0 else 0.0
                values = self._remember(*memory.values(), share, first, dt, *self.scene.coefficients.values())
                memory = dict(zip(memory, values, strict=True))
            problem.hold({**memory, "control": share, "side": side_of(turns)})
            try:
                q, v = path(problem, advance, (q, v), ((k + 1) * dt,), k * dt)[0]
            except PieceError:
                break
            if self.scene.periodic:
                halves = half_turns(q)
                q, turns = without_half_turns(q, halves), turns + 0.5 * halves
            rows.append((q, v, turns))
        return rows


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
