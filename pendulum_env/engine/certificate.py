"""Error estimates of whole runs, computed from the difference to a second run with half the step.

This is step doubling (Richardson; Hairer, Norsett & Wanner 1993, Solving Ordinary Differential Equations I, II.4), over
the whole run. If the error of a method of order p is ``C(t) h**p``, a run q with steps h and a run Q with steps h/2
give::

    error of q = |q - Q| 2**p / (2**p - 1)

An adaptive run is compared with a run at half the interval and with tolerances divided by 32 (TIGHTER), because its
error depends on both. The estimate is the error of the method alone: the state of effects, such as gusts, is the same
in both runs.

Rounding differs between the runs, so that their difference shows it, too; but a rounding that both runs share, such as
that of a coefficient, does not show, and the difference may be zero by chance. Therefore the estimate is never below
the following bound, with the unit roundoff u::

    u (|angle| + (sqrt(n) + omega0 t) (|tilt| + |velocity| reach))        reach = min(t, 1/omega0)

``sqrt(n)`` is the random walk of the roundings of n steps, 1 with compensated sums; ``omega0 t`` is the effect of one
rounding of the frequency on the phase; ``tilt`` is the angle from the nearer of bottom and top. Where rounding
dominates, methods of many stages may round more at half the step: their estimates are then up to 30 times too high.

The estimate is inf from one time to the end of the run as soon as the difference exceeds a fifth (TRUST) of the
motion so far (half the range of the angle, or the largest velocity over omega0) or, in periodic scenes, 1 rad (MOST):
a method that brings the bob to rest in both runs, or chaos, could otherwise end with a small difference. It is also inf
if a step is too long to resolve the motion: longer than half a period of a swing or of a drive, or than half a turn.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators import Method
from integrators.solving.adaptive import FINEST
from pendulum_env.engine.machine import ANGLE, TURNS, TWO_PI, VELOCITY
from pendulum_env.engine.shape import HOLD
from pendulum_env.engine.wrap import half_turns, without_half_turns
from pendulum_env.physics.scene import Scene

Array = NDArray[np.float64]
Numbers = Mapping[str, Any]

ESTIMATE, VELOCITY_ESTIMATE = "error_estimate", "velocity_error_estimate"
TRUST = 0.2
"""Largest trusted difference of the two runs, as a fraction of the motion so far."""
MOST = 1.0
"""Largest trusted difference of the two angles in periodic scenes [rad]."""
TIGHTER = 32.0
"""Factor by which the second adaptive run has smaller tolerances; its error is then a few per cent of the first."""
SLACK = 64.0
"""Ignore differences below this multiple of the rounding bound."""
ROUNDOFF = 2.0**-53
"""Unit roundoff of double precision."""

ENDLESS = ("speed_limit", "scale", "swing_pull")
"""Limits that are inf in the run at half the step, so that only a non-finite state ends this run."""


def tilted(angle: Any) -> Any:
    """Return the angle from the nearer of bottom and top [rad]."""
    return without_half_turns(angle, half_turns(angle))


@dataclass(frozen=True)
class ErrorEstimator:
    """Computation of error estimates from the differences of a run and a second run at half the step.

    The attributes h, omega0, gain and most may be arrays with one entry per run of a batch.

    Attributes:
        h: step of the run [s].
        omega0: small-angle angular frequency, 1 where there is no gravity [1/s].
        gain: ``2**p/(2**p - 1)`` for a method of order p, the ratio of the error to the difference.
        most: largest trusted difference of the angles [rad]; below 0 if steps are too long to resolve a drive.
        periodic: True if the torques repeat after a whole turn.
        walks: True if rounding errors accumulate, False with compensated summation.
        roundoff: unit roundoff of the run's numbers.
    """

    h: float
    omega0: Any
    gain: float
    most: Any
    periodic: bool
    walks: bool
    roundoff: float = ROUNDOFF

    @classmethod
    def of(
        cls, scene: Scene, method: Method, h: Any, numbers: Numbers, compensated: bool, adaptive: bool = False,
        library: Any = np,
    ) -> ErrorEstimator:
        """Return the error estimator for a scene, a method and steps of ``h`` [s].

        ``numbers`` holds the scene's coefficients and "omega0", as floats or as arrays of a library with NumPy's
        functions, one entry per run.
        """
        fastest = numbers["omega0"] if scene.omega0 else 0.0
        for effect in scene.effects:
            if effect.beat:
                fastest = library.maximum(fastest, abs(numbers[effect.beat]))
        resolved = adaptive | (library.asarray(fastest) * h <= math.pi)
        most = library.where(resolved, MOST if scene.periodic else math.inf, -1.0)
        most = float(most) if library is np and not most.ndim else most
        gain = 1.0 if math.isinf(method.order) else 2.0**method.order / (2.0**method.order - 1.0)
        return cls(h, numbers["omega0"], gain, most, scene.periodic, not compensated)

    def __call__(
        self, index: Any, angles: tuple[Any, Any], velocities: tuple[Any, Any], span: Any, fastest: Any,
        smaller: Callable[[Any, Any], Any] = np.minimum, larger: Callable[[Any, Any], Any] = np.maximum,
        root: Callable[[Any], Any] = np.sqrt, tilt_of: Callable[[Any], Any] = tilted,
    ) -> tuple[Any, Any, Any]:
        """Return error estimates of a run's angle [rad] and velocity [rad/s], and True where they can be trusted.

        Args:
            index: number of steps taken.
            angles, velocities: pairs of the value in the run and the value in the run at half the step.
            span, fastest: range of the run's angle so far [rad], and its largest |velocity| [rad/s].
            smaller, larger, root: functions for minimum, maximum and square root; Python's own are faster for floats
                and give the same bits as numpy's.
            tilt_of: function that returns the angle from the nearer of bottom and top.
        """
        angle, velocity = angles[0], velocities[0]
        tilt = tilt_of(angle) if self.periodic else angle
        reach = smaller(index * self.h, 1.0 / self.omega0)
        walk = (root(index) if self.walks else smaller(index, 1.0)) + self.omega0 * (index * self.h)
        least = self.roundoff * (abs(angle) + walk * (abs(tilt) + abs(velocity) * reach))
        least_v = self.roundoff * (walk * (abs(velocity) + abs(tilt) * self.omega0))
        error, error_v = (self.gain * abs(y[0] - y[1]) for y in (angles, velocities))
        motion = larger(0.5 * span, fastest / self.omega0)
        trusted = error <= smaller(larger(TRUST * motion, SLACK * least), self.most)
        if self.periodic:
            trusted = trusted & (fastest * self.h <= math.pi)
        return larger(error, least), larger(error_v, least_v), trusted


def endless(numbers: Numbers) -> dict[str, Any]:
    """Return a scene's numbers with speed limit, energy check and slack check disabled by inf.

    A run with these numbers ends early only at a state that is not finite.
    """
    return {
        name: (np.full_like(value, math.inf) if isinstance(value, np.ndarray) else math.inf)
        if name in ENDLESS else value for name, value in numbers.items()
    }


def halved(given: Numbers) -> dict[str, Any]:
    """Return a scene's numbers for the second run, at half the step, of an error estimate.

    It has no speed limit, twice as many steps per control step, and tolerances divided by 32 (TIGHTER).
    """
    numbers = endless(given)
    for name in HOLD:
        if name in numbers:
            numbers[name] = 2.0 * numbers[name]
    for name in ("rtol", "atol"):
        if name in numbers:
            numbers[name] = numbers[name] / TIGHTER
    if "rtol" in numbers:
        numbers["rtol"] = max(numbers["rtol"], FINEST)
    return numbers


def motion_of(state: Any) -> tuple[float, float]:
    """Return the unwrapped angle [rad] and the velocity [rad/s] of a Machine's state vector."""
    return float(state[ANGLE]) + TWO_PI * float(state[TURNS]), float(state[VELOCITY])


def running(reduce: np.ufunc, first: NDArray[Any], rows: NDArray[Any]) -> NDArray[Any]:
    """Return running extremes: for every row, ``reduce`` (such as np.minimum) of ``first`` and all rows up to this row.
    """
    if len(rows) > len(first):
        return np.asarray(reduce.accumulate(np.concatenate((first[None], rows)))[1:])
    result = np.empty_like(rows)
    for i, row in enumerate(rows):
        first = reduce(first, row, out=result[i])
    return result


class MotionSoFar:
    """Angle range [rad] and largest |velocity| [rad/s] of runs so far; True where error estimates can be trusted."""

    def __init__(self, angle: Array, velocity: Array) -> None:
        self.low, self.high, self.fastest = angle.copy(), angle.copy(), np.abs(velocity)
        self.trusted = np.ones(np.shape(angle), dtype=np.bool_)

    def begin(self, which: NDArray[np.intp], angle: Array, velocity: Array) -> None:
        """Restart the angle range, largest velocity and trust of the runs ``which`` from these initial conditions."""
        self.low[which], self.high[which], self.fastest[which] = angle, angle, np.abs(velocity)
        self.trusted[which] = True

    def estimates(
        self, estimator: ErrorEstimator, index: Array, angles: tuple[Array, Array], velocities: tuple[Array, Array]
    ) -> Array:
        """Return error estimates of angle and velocity at every row (recorded time), shape ``(rows, 2, runs)``.

        The range, the largest |velocity| and the trust stored in this object are brought up to the last row. ``angles``
        and ``velocities`` are pairs of arrays ``(rows, runs)``: of the runs, and of the runs at half the step.
        ``index`` is the number of steps taken, of shape ``(rows, 1)`` or ``(rows, runs)``.
        """
        with np.errstate(all="ignore"):
            low, high = running(np.minimum, self.low, angles[0]), running(np.maximum, self.high, angles[0])
            fastest = running(np.maximum, self.fastest, np.abs(velocities[0]))
            error, error_v, now = estimator(index, angles, velocities, high - low, fastest)
            trusted = running(np.logical_and, self.trusted, now)
        if len(angles[0]):
            self.low, self.high, self.fastest, self.trusted = low[-1], high[-1], fastest[-1], trusted[-1]
        return np.where(trusted[:, None], np.stack((error, error_v), axis=1), math.inf)
