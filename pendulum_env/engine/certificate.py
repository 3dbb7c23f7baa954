"""How far a run may be from the exact motion: the same run again at half the step, and what the two differ by.

Step doubling (Richardson; Hairer, Norsett & Wanner 1993, Solving Ordinary Differential Equations I, II.4), over the
whole run: where the error of a method of order p is ``C(t) h**p``, runs q with steps of h and Q of h/2 give::

    error of q = |q - Q| 2**p / (2**p - 1)

An adaptive run is compared with one at half the interval and TIGHTER tolerances, as its error goes with both.
It is the error of the method alone: what effects remember, such as gusts, is the same in both runs.

Rounding differs in both runs, so that their difference shows it, too, but not where it is alike in both, as that of a
coefficient, and it may be zero by chance. The estimate is never below this, u being the unit roundoff::

    u (|angle| + (sqrt(n) + omega0 t) (|tilt| + |velocity| reach))        reach = min(t, 1/omega0)

``sqrt(n)`` is the random walk of n steps' roundings, 1 with compensated sums; ``omega0 t`` what one rounding of the
frequency does to the phase; ``tilt`` the angle from the nearer of bottom and top. Where rounding rules, methods of many
sub-steps may round more at half the step: they are then estimated up to some 30 times too high.

Nothing is known, and the estimate is inf from there to the end, once the difference exceeds TRUST of the motion so far
(half the range of the angle, or the largest velocity over omega0) or, under torques that repeat with the turn, MOST
radians: a method that brings the bob to rest in both runs, or chaos, would else end with a small difference. Likewise
where a step is too long to see the motion at all: more than half a period of it, of a drive, or half a turn.
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
"""Part of the motion that two runs may differ by."""
MOST = 1.0
"""What they may differ by where torques repeat with the turn [rad]."""
TIGHTER = 32.0
"""The error of an adaptive run goes about with its tolerance: that of the other is then a few per cent of it."""
SLACK = 64.0
"""Differences of so many roundings are no sign of a wrong motion."""
ROUNDOFF = 2.0**-53

ENDLESS = ("speed_limit", "scale", "swing_pull")
"""Numbers that are inf in the run at half the step: it goes on for as long as it is finite."""


@dataclass(frozen=True)
class Yardstick:
    """What differences of two runs are measured by; numbers, or arrays of one for each run.

    Attributes:
        h: step of the run [s].
        omega0: small-angle angular frequency, 1 where there is no gravity [1/s].
        gain: ``2**p/(2**p - 1)``.
        most: what angles may differ by at most [rad]; below 0 where steps are too long to see a drive.
        periodic: torques repeat with the turn.
        walks: rounding adds up.
    """

    h: float
    omega0: Any
    gain: float
    most: Any
    periodic: bool
    walks: bool

    @classmethod
    def of(
        cls, scene: Scene, method: Method, h: float, numbers: Numbers, compensated: bool, adaptive: bool = False
    ) -> Yardstick:
        """For runs of a method; ``numbers`` are coefficients and "omega0", a float or an array each."""
        fastest = numbers["omega0"] if scene.omega0 else 0.0
        for effect in scene.effects:
            if effect.beat:
                fastest = np.maximum(fastest, np.abs(numbers[effect.beat]))
        seen = adaptive | (np.asarray(fastest) * h <= math.pi)
        most = np.where(seen, MOST if scene.periodic else math.inf, -1.0)
        gain = 1.0 if math.isinf(method.order) else 2.0**method.order / (2.0**method.order - 1.0)
        return cls(h, numbers["omega0"], gain, most if most.ndim else float(most), scene.periodic, not compensated)

    def __call__(
        self, index: Any, angles: tuple[Any, Any], velocities: tuple[Any, Any], span: Any, fastest: Any,
        smaller: Callable[[Any, Any], Any] = np.minimum, larger: Callable[[Any, Any], Any] = np.maximum,
        root: Callable[[Any], Any] = np.sqrt,
    ) -> tuple[Any, Any, Any]:
        """Estimates of angle [rad] and velocity [rad/s] after ``index`` steps, and whether they can be trusted.

        Args:
            angles, velocities: of the run, and of that at half the step.
            span, fastest: range of the run's angle so far, and its largest |velocity|.
            smaller, larger, root: for arrays; those of plain floats give the same bits.
        """
        angle, velocity = angles[0], velocities[0]
        tilt = without_half_turns(angle, half_turns(angle)) if self.periodic else angle
        reach = smaller(index * self.h, 1.0 / self.omega0)
        walk = (root(index) if self.walks else smaller(index, 1.0)) + self.omega0 * (index * self.h)
        least = ROUNDOFF * (abs(angle) + walk * (abs(tilt) + abs(velocity) * reach))
        least_v = ROUNDOFF * (walk * (abs(velocity) + abs(tilt) * self.omega0))
        found, found_v = (self.gain * abs(y[0] - y[1]) for y in (angles, velocities))
        motion = larger(0.5 * span, fastest / self.omega0)
        trusted = found <= smaller(larger(TRUST * motion, SLACK * least), self.most)
        if self.periodic:
            trusted = trusted & (fastest * self.h <= math.pi)
        return larger(found, least), larger(found_v, least_v), trusted


def endless(numbers: Numbers) -> dict[str, Any]:
    """Numbers of a scene for the run at half the step, which nothing but the finite range ends."""
    return {
        name: (np.full_like(value, math.inf) if isinstance(value, np.ndarray) else math.inf)
        if name in ENDLESS else value for name, value in numbers.items()
    }


def halved(numbers: Numbers) -> dict[str, Any]:
    """The same with what it takes of steps and tolerances: twice the steps, for what holds the same time."""
    found = endless(numbers)
    for name in HOLD:
        if name in found:
            found[name] = 2.0 * found[name]
    for name in ("rtol", "atol"):
        if name in found:
            found[name] = found[name] / TIGHTER
    if "rtol" in found:
        found["rtol"] = max(found["rtol"], FINEST)
    return found


def motion_of(state: Any) -> tuple[float, float]:
    """Unwrapped angle and velocity of a state."""
    return float(state[ANGLE]) + TWO_PI * float(state[TURNS]), float(state[VELOCITY])


def running(reduce: np.ufunc, first: NDArray[Any], rows: NDArray[Any]) -> NDArray[Any]:
    """What ``reduce`` makes of ``first`` and all rows up to each."""
    if len(rows) > len(first):
        return np.asarray(reduce.accumulate(np.concatenate((first[None], rows)))[1:])
    found = np.empty_like(rows)
    for i, row in enumerate(rows):
        first = reduce(first, row, out=found[i])
    return found


class Past:
    """What is known of runs before a stretch: the angle's range [rad], largest |velocity| [rad/s], whether to trust."""

    def __init__(self, angle: Array, velocity: Array) -> None:
        self.low, self.high, self.fastest = angle.copy(), angle.copy(), np.abs(velocity)
        self.trusted = np.ones(np.shape(angle), dtype=np.bool_)

    def begin(self, which: NDArray[np.intp], angle: Array, velocity: Array) -> None:
        """Forget the runs at these places, which begin anew."""
        self.low[which], self.high[which], self.fastest[which] = angle, angle, np.abs(velocity)
        self.trusted[which] = True

    def judged(
        self, yardstick: Yardstick, index: Array, angles: tuple[Array, Array], velocities: tuple[Array, Array]
    ) -> Array:
        """Estimates of angle and velocity, shape ``(rows, 2, runs)``, of arrays ``(rows, runs)``; then goes on.

        ``index``: steps taken, of shape ``(rows, 1)`` or ``(rows, runs)``.
        """
        with np.errstate(all="ignore"):
            low, high = running(np.minimum, self.low, angles[0]), running(np.maximum, self.high, angles[0])
            fastest = running(np.maximum, self.fastest, np.abs(velocities[0]))
            found, found_v, now = yardstick(index, angles, velocities, high - low, fastest)
            trusted = running(np.logical_and, self.trusted, now)
        if len(angles[0]):
            self.low, self.high, self.fastest, self.trusted = low[-1], high[-1], fastest[-1], trusted[-1]
        return np.where(trusted[:, None], np.stack((found, found_v), axis=1), math.inf)
