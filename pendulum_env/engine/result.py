"""The result of a run of a scene: data, and nothing of how it was made or is shown."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from integrators import Method
from pendulum_env.physics.energy import Ledger
from pendulum_env.physics.scene import Scene

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Rollout:
    """A run: arrays of shape ``(times,)``, or ``(runs, times)`` if started from an array of angles.

    Attributes:
        time: [s], shape ``(times,)``: multiples of ``every`` steps, then the end. A single run that stopped early ends
            where it stopped.
        angle: unwrapped, from the downward vertical [rad].
        velocity: [rad/s].
        ledger: kinetic, potential, work, heat, residual [J].
        heat_by_effect: heat of each dissipative effect [J], where ``diagnostics`` asked for it.
        watched: what else ``diagnostics`` asked for: "tension" [N]; "reynolds", "keulegan_carpenter", "quality_factor".
        stop_reason: "" if it ran to its end, else "diverged", "speed_limit" or "slack"; a tuple of them for a batch,
            whose values at times after a stop are nan.
        stop_time: time of the last step that was taken [s]; an array of the starts' shape for a batch.
        scene, method, dt: what ran; of a batch with parameters of its own, the first run's scene.
        tolerance: "rtol" and "atol" of an adaptive run, whose steps of dt are taken in as many as these ask for; else
            empty. ``steps, rejected``: how many those were, and how many were tried in vain; 0 without a tolerance.
        lost_angle, lost_velocity: what rounding left out of ``angle`` and ``velocity``, for sums of both to more than
            double precision, where the summation was compensated; else None.
        error_estimate, velocity_error_estimate: how far ``angle`` and ``velocity`` may be from the exact motion [rad,
            rad/s], of their shape, where asked for; else None. inf from where nothing is known.
    """

    time: Array
    angle: Array
    velocity: Array
    ledger: Ledger
    stop_reason: str | tuple[str, ...]
    stop_time: float | Array
    scene: Scene
    method: Method
    dt: float
    heat_by_effect: Mapping[str, Array] = field(default_factory=dict)
    tolerance: Mapping[str, float] = field(default_factory=dict)
    steps: int = 0
    rejected: int = 0
    watched: Mapping[str, Array] = field(default_factory=dict)
    lost_angle: Array | None = None
    lost_velocity: Array | None = None
    error_estimate: Array | None = None
    velocity_error_estimate: Array | None = None

    @property
    def energy(self) -> Array:
        """Kinetic plus potential energy [J]."""
        return np.asarray(self.ledger.energy)

    @property
    def energy_residual(self) -> Array:
        """Energy that the integrator added or lost [J]."""
        return np.asarray(self.ledger.residual)
