"""The class :class:`Rollout`: the result of a run of a scene, as plain data."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators import Method, MethodError
from integrators.solving.dense import DenseOutput
from pendulum_env.common.results import Plotted, one_line
from pendulum_env.physics.energy import Ledger
from pendulum_env.physics.exact.pendulum import Flight, flight
from pendulum_env.physics.scene import Scene

Array = NDArray[np.float64]

ESTIMATE, VELOCITY_ESTIMATE = "error_estimate", "velocity_error_estimate"
"""Names of a Rollout's error estimates, and of their columns in records."""


@dataclass(frozen=True, repr=False)
class Rollout(Plotted):
    """The result of a simulation: arrays of shape ``(times,)``, or ``(runs, times)`` for a batch.

    Attributes:
        time: times of the recorded states [s], shape ``(times,)``: every ``every`` steps, and the end. A single run
            that stopped early ends where it stopped, on a wire that went slack at the time of slack within a step.
        angle: unwrapped angle from the downward vertical [rad].
        velocity: angular velocity [rad/s].
        ledger: kinetic and potential energy, work, heat and energy residual [J].
        heat_by_effect: heat of every dissipative effect [J], with the diagnostic "heat_by_effect"; else empty.
        watched: values of the other diagnostics by name: "tension" [N]; "reynolds", "keulegan_carpenter",
            "quality_factor" [1].
        stop_reason: "" if the run reached its end, else "diverged", "speed_limit", "slack", "step_too_short" or
            "event"; a tuple of them for a batch, whose values at times after a stop are nan.
        stop_time: time of the end of the last step, or of slack or a terminal event within it [s]; for a batch an array
            with the shape of the initial conditions.
        scene, method: the simulated scene (for a batch with array parameters that of the first run) and the method.
        dt: the integrator's step [s].
        tolerance: "rtol" and "atol" of an adaptive run, which divides every step of dt as they require; else empty.
        steps, rejected: numbers of adaptive steps taken and rejected, for a batch arrays with the shape of the initial
            conditions; 0 without a tolerance.
        lost_angle, lost_velocity: rounding remainders of ``angle`` and ``velocity`` with compensated summation; the
            sums angle + lost_angle and velocity + lost_velocity are more precise than doubles; else None.
        error_estimate, velocity_error_estimate: estimated distances of ``angle`` and ``velocity`` from the exact motion
            [rad, rad/s], arrays of the shape of ``angle``, with ``estimate_error``; else None. inf where no estimate is
            possible.
        t_events, angle_events, velocity_events: with ``events``, for each event an array of its times [s] and of the
            states there; in a batch an object array with such an array for each run; else empty.
        dense: the motion between the steps, with ``dense=True``; call the Rollout to ask it.
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
    steps: int | NDArray[np.int64] = 0
    rejected: int | NDArray[np.int64] = 0
    watched: Mapping[str, Array] = field(default_factory=dict)
    lost_angle: Array | None = None
    lost_velocity: Array | None = None
    error_estimate: Array | None = None
    velocity_error_estimate: Array | None = None
    t_events: tuple[Any, ...] = ()
    angle_events: tuple[Any, ...] = ()
    velocity_events: tuple[Any, ...] = ()
    dense: DenseOutput | None = field(default=None, repr=False)

    def __repr__(self) -> str:
        shape = self.angle.shape
        many = f"{math.prod(shape[:-1])} runs of " if len(shape) > 1 else ""
        reason = self.stop_reason if isinstance(self.stop_reason, str) else ""
        end = f"{self.time[-1]:g} s" if self.time.size else "no time"
        return one_line(self, f"{self.scene.name}, {self.method.name}, {many}{end} in {self.time.size} times"
                        + (f", {reason}" if reason else ""))

    def __call__(self, time: Any) -> tuple[Any, Any]:
        """Return angle and velocity at a time of the run, or at an array of times [s].

        Raises MethodError for other times, and for a rollout without dense output.
        """
        if self.dense is None:
            raise MethodError("This rollout has no dense output; pass dense=True to rollout.")
        return self.dense(time)

    @property
    def ending(self) -> str:
        """Sentence on why and where a single run ended early; "" if it did not, and for a batch.

        For a wire that went slack it says where the wire would catch the bob again, see :attr:`flight`.
        """
        if not self.stop_reason or not isinstance(self.stop_reason, str):
            return ""
        where = f"at {float(self.stop_time):.4g} s"
        if self.stop_reason != "slack":
            return f"The run ended {where}: {self.stop_reason}."
        said = f"The wire goes slack {where}, at {math.degrees(float(self.angle[-1])):.4g}°."
        after = self.flight
        if after is None:
            return said
        return (f"{said} Flying freely, without air, the bob would be caught by the wire {after.time:.4g} s later, at "
                f"{math.degrees(after.angle):.4g}°, with a jerk of {after.speed:.3g} m/s. The run ends before.")

    @property
    def flight(self) -> Flight | None:
        """Free flight of a bob whose wire went slack, in vacuum, until the wire catches it with a jerk; else None.

        See :func:`pendulum_env.physics.exact.flight`. Neither the flight nor what follows the jerk is simulated. It is
        None for a pivot that moves.
        """
        if self.stop_reason != "slack" or any(any(effect.sway) for effect in self.scene.effects):
            return None
        return flight(self.scene.body.reach, self.scene.gravity, float(self.angle[-1]), float(self.velocity[-1]))

    @property
    def energy(self) -> Array:
        """Return the sum of kinetic and potential energy [J], an array of the shape of ``angle``."""
        return np.asarray(self.ledger.energy)

    @property
    def energy_residual(self) -> Array:
        """Return the energy that the integrator's error added (took away, if negative) [J], an array as ``angle``."""
        return np.asarray(self.ledger.residual)
