"""Reference solutions of probe episodes, test runs with given controls on which methods are compared.

Two independent methods compute every solution in pieces that end at every turning point.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

import integrators
from pendulum_env.engine.generate import program
from pendulum_env.engine.kernels import interpreted
from pendulum_env.engine.machine import Machine
from pendulum_env.engine.reading import arguments
from pendulum_env.engine.wrap import half_turns, side_of, without_half_turns
from pendulum_env.physics.scene import Scene
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
