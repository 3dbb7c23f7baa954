"""What a fit found: numbers with standard errors, and the scene that has them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pendulum_env.lab.fitting.model import START, Model, unit_of
from pendulum_env.lab.fitting.shooting import Solution
from pendulum_env.lab.measures import Measurement
from pendulum_env.lab.recording import Recording
from pendulum_env.physics.scene import Scene

if TYPE_CHECKING:
    from pendulum_env.lab.fitting.choice import Comparison

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Fit:
    """Least squares of one model to a recording.

    Attributes:
        recording: as fitted: from the release on.
        solution: of the least squares.
        sigma: standard deviation of one reading that the fit was weighted with [rad].
        comparison: with the other models, where several were fitted.
    """

    recording: Recording
    solution: Solution
    sigma: float
    comparison: Comparison | None = None

    @property
    def model(self) -> Model:
        return self.solution.model

    @property
    def damping(self) -> str:
        """The dampings of the model, as ``damping=`` takes them."""
        return "+".join(self.model.damping) or "none"

    @property
    def names(self) -> tuple[str, ...]:
        """What was fitted, in the order of ``values`` and ``covariance``."""
        return self.model.names

    @property
    def values(self) -> Array:
        return self.solution.values

    @property
    def residual(self) -> Array:
        """Recording minus model [rad], at ``recording.time``."""
        return self.solution.residual

    @property
    def rms(self) -> float:
        """Root mean square of the residual [rad]."""
        return float(np.sqrt(np.mean(self.residual**2)))

    @property
    def degrees_of_freedom(self) -> int:
        return len(self.residual) - len(self.values)

    @cached_property
    def covariance(self) -> Array:
        """Covariance of ``values``: ``(J^T J)^-1`` times the residual's variance."""
        slopes = self.solution.jacobian
        variance = float(self.residual @ self.residual) / self.degrees_of_freedom
        return np.asarray(np.linalg.pinv(slopes.T @ slopes) * variance, dtype=np.float64)

    @cached_property
    def parameters(self) -> dict[str, Measurement]:
        """Each fitted number with its standard error and unit."""
        errors = np.sqrt(np.diag(self.covariance))
        return {name: Measurement(float(value), float(error), unit_of(self.model.scene, name))
                for name, value, error in zip(self.names, self.values, errors, strict=True)}

    @cached_property
    def scene(self) -> Scene:
        """The scene with the fitted numbers, whose usual run is the recorded one."""
        found = self.model.scene_with(self.values)
        angle, velocity = (self.parameters[name].value for name in START[:2])
        period = math.tau / found.omega0
        run = {"angle": angle, "velocity": velocity, "duration": float(self.recording.time[-1]), "dt": period / 100.0}
        return found.replace(name=f"fitted to {self.recording.source}", run={**found.to_dict()["run"], **run})
