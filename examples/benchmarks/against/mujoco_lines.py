"""Solvers of MuJoCo: a hinge with a point mass, fixed steps, ``mj_step`` with ``nstep`` between records.

Many trajectories are hinges in one model, which takes a seventh of the time of separate steps or of
``mujoco.rollout``. Contacts and constraints are switched off; the joint's damping is the linear drag.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from against.problem import RATE, RECORDS, Array, Problem, Solver

HINGE = (
    '<body><joint type="hinge" axis="0 1 0" damping="{gamma!r}"/>'
    '<inertial pos="0 0 -1" mass="1" diaginertia="2e-15 2e-15 2e-15"/></body>'
)
MODEL = (
    '<mujoco><compiler balanceinertia="false"/><option integrator="{integrator}" gravity="0 0 -{rate!r}">'
    '<flag contact="disable" constraint="disable"/></option><worldbody>{hinges}</worldbody></mujoco>'
)


def _line(integrator: str) -> Callable[[Problem], Solver]:
    def prepare(problem: Problem) -> Solver:
        import mujoco

        hinges = HINGE.format(gamma=problem.gamma) * problem.size
        text = MODEL.format(integrator=integrator, rate=RATE, hinges=hinges)
        model: Any = mujoco.MjModel.from_xml_string(text)
        data: Any = mujoco.MjData(model)

        def solve(steps: int, duration: float) -> Array:
            mujoco.mj_resetData(model, data)
            model.opt.timestep = duration / RECORDS / steps
            data.qpos[:], data.qvel[:] = problem.starts, 0.0
            angles = np.empty((RECORDS + 1, problem.size))
            angles[0] = data.qpos
            for row in angles[1:]:
                mujoco.mj_step(model, data, nstep=steps)
                row[:] = data.qpos
            return angles.T

        return solve

    return prepare


LINES: Mapping[str, Callable[[Problem], Solver]] = {
    f"MuJoCo {integrator}": _line(integrator) for integrator in ("Euler", "RK4", "implicitfast")
}
