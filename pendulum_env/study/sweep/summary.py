"""Summary of one run in a few numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from pendulum_env.engine.rollout import rollout
from pendulum_env.truth.reference import StudyError

UNITS = "times s, angles rad, velocities rad/s, energies, work and heat J"
SUMMARY = {
    "angle": "rad", "velocity": "rad/s", "dt": "s", "duration": "s", "end_time": "s", "end_angle": "rad",
    "end_velocity": "rad/s", "largest_angle": "rad", "largest_velocity": "rad/s", "end_energy": "J", "work": "J",
    "heat": "J", "largest_energy_residual": "J",
}
"""Units of the numbers of a summary, and of keywords of ``rollout`` that are points of a sweep."""


def summary(point: Mapping[str, Any]) -> dict[str, Any]:
    """Run one rollout and return its end, its largest values, its energies and its energy residual.

    Args:
        point: dict of the keywords of :func:`pendulum_env.engine.rollout.rollout`, for a single run.

    Returns a dict of

    - "end_time" [s], "end_angle" [rad], "end_velocity" [rad/s]: time and state of the last record;
    - "largest_angle" [rad], "largest_velocity" [rad/s]: largest |angle| and |velocity| of all records;
    - "end_energy" [J]: energy at the end; "work", "heat" [J]: totals at the end;
    - "largest_energy_residual" [J]: largest |energy residual|, the error in the energy balance;
    - "steps", "rejected": numbers of steps taken, and of steps that an adaptive run rejected;
    - "stop_reason": why the run ended early, else "".

    Raises StudyError for arrays, which would be many runs; SceneError or MethodError as ``rollout`` does.
    """
    run = rollout(**point)
    if run.angle.ndim != 1:
        raise StudyError("Each point of a sweep is one run: angle, velocity and parameters must be single numbers.")
    ledger, last = run.ledger, -1
    return {
        "end_time": float(run.stop_time),
        "end_angle": float(run.angle[last]),
        "end_velocity": float(run.velocity[last]),
        "largest_angle": float(np.max(np.abs(run.angle))),
        "largest_velocity": float(np.max(np.abs(run.velocity))),
        "end_energy": float(run.energy[last]),
        "work": float(np.asarray(ledger.work)[last]),
        "heat": float(np.asarray(ledger.heat)[last]),
        "largest_energy_residual": float(np.max(np.abs(run.energy_residual))),
        "steps": run.steps or math.ceil(float(run.stop_time) / run.dt - 1e-6),
        "rejected": run.rejected,
        "stop_reason": str(run.stop_reason),
    }
