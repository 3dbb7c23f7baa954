"""One run in numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pendulum_env.engine.rollout import rollout
from pendulum_env.truth.reference import StudyError

UNITS = "times s, angles rad, velocities rad/s, energies, work and heat J"


def summary(point: Mapping[str, Any]) -> dict[str, Any]:
    """How a run ended, how far it went and how well its energy is accounted for.

    Args:
        point: keywords of :func:`pendulum_env.engine.rollout.rollout`, of one run.

    Returns a dict of

    - "end_time" [s], "end_angle" [rad], "end_velocity" [rad/s]: the last record;
    - "largest_angle" [rad], "largest_velocity" [rad/s]: of |angle| and |velocity| over the records;
    - "end_energy" [J]: at the end; "work", "heat" [J]: until then;
    - "largest_energy_residual" [J]: the largest |energy residual|, which is the integrator's own error;
    - "steps", "rejected": taken, and of an adaptive run tried in vain;
    - "stop_reason": "" if it ran to its end.

    Raises StudyError for arrays, which would be many runs; SceneError or MethodError as ``rollout`` does.
    """
    found = rollout(**point)
    if found.angle.ndim != 1:
        raise StudyError("A point of a sweep is one run: its angle, velocity and parameters are single numbers.")
    ledger, last = found.ledger, -1
    return {
        "end_time": float(found.stop_time),
        "end_angle": float(found.angle[last]),
        "end_velocity": float(found.velocity[last]),
        "largest_angle": float(np.max(np.abs(found.angle))),
        "largest_velocity": float(np.max(np.abs(found.velocity))),
        "end_energy": float(found.energy[last]),
        "work": float(np.asarray(ledger.work)[last]),
        "heat": float(np.asarray(ledger.heat)[last]),
        "largest_energy_residual": float(np.max(np.abs(found.energy_residual))),
        "steps": found.steps or round(float(found.stop_time) / found.dt),
        "rejected": found.rejected,
        "stop_reason": str(found.stop_reason),
    }
