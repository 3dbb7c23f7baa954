"""What probe episodes ought to give: two independent methods, cut at every turning point."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

import integrators
from pendulum_env.engine.generate import program
from pendulum_env.engine.kernels import interpreted
from pendulum_env.engine.machine import Machine
from pendulum_env.engine.source import arguments
from pendulum_env.engine.wrap import half_turns, side_of, without_half_turns
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.answer import Truth
from pendulum_env.truth.pieces import Advance, PieceError, Problem, doubled, extrapolated, path, problem_of

CHECK = integrators.get("verner9")
"""The method that Gragg's extrapolation is compared with."""

SMOOTH = 4.0
"""Pieces are so many times longer where nothing has a kink at turning points."""

Rows = list[tuple[float, float, float]]
"""(angle from the nearer of bottom and top, velocity, turns) after each control step, the start first."""


@dataclass(frozen=True)
class Probe:
    """One episode.

    Attributes:
        angle, velocity: start [rad, rad/s].
        controls: one for each control step until the episode ends.
        uniform: what gusts start from.
        growth: what errors of one size and random sign, made at each control step, came to; inf if all is lost.
        name: of the start and the torques.
    """

    angle: float
    velocity: float
    controls: tuple[float, ...]
    uniform: tuple[float, ...]
    growth: float
    name: str


class ProbeMotions:
    """Motions of one scene under given torques."""

    def __init__(self, scene: Scene, dt: float) -> None:
        self.scene, self.dt = scene, dt
        self._machine = Machine(scene, "rk4", (), "python")
        problem = problem_of(scene)
        kinked = problem.dry or any("speed" in arguments(effect.torque) for effect in scene.effects if effect.torque)
        self._problem: Problem = problem if kinked else replace(problem, longest=SMOOTH * problem.longest)
        made = program(scene, self._machine.method, ())
        self._memory = made.shape.remembered
        self._remember = interpreted(made.text, made.title).get("remember")

    def motion(self, probe: Probe, error: float) -> Truth:
        """The motion, and at each control step the difference of two methods so far at most as its error.

        ``error``: what they may come to in the end [rad]; as far as rounding allows, which nothing else is done about.
        """
        enough = error / (10.0 * probe.growth)
        rows = self._path(probe, extrapolated(enough))
        others = self._path(probe, doubled(self.scene, CHECK, enough))
        (q, v, turns), (other, _, others_turns) = (
            np.array(found[: min(len(rows), len(others))]).T for found in (rows, others))
        how = f"Gragg's extrapolation, checked by {CHECK.name}"
        found = Truth(np.array([k * self.dt for k in range(len(q))]), q, v, 0.0, how, turns=turns)
        return replace(found, error=np.maximum.accumulate(found.distance(other, others_turns)))

    def _path(self, probe: Probe, advance: Advance) -> Rows:
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
