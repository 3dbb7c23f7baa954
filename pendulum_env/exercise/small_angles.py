"""Part 1 at small angles: forward Euler, its error in one step, halved steps; and the three Euler methods beside it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from integrators import Method, solve
from pendulum_env.exercise.motion import OWN, STEP, ExerciseMotion, finite, small
from pendulum_env.physics import exact

EULERS = ("forward_euler", "backward_euler", "symplectic_euler")
"""The methods of the exercise; Part 1 uses the first."""
ANGLE = math.radians(5.0)
"""Release angle [rad]."""
DURATION = 10.0
"""Length of a run [s]."""
HALVINGS = 3
"""How often the step is halved."""


@dataclass(frozen=True)
class OneStep:
    """Error of one forward Euler step that starts on the exact motion, and its leading term.

    Attributes:
        where: "top" (the angle's error, from rest at the release angle) or "bottom" (the velocity's error, from the
            lowest point).
        error: computed value minus exact value [rad or rad/s], as the errors of ``lab-pendulum compare``.
        leading: ``-dt²/2`` times the second derivative of the angle or the velocity there [rad or rad/s].
    """

    where: str
    error: float
    leading: float


@dataclass(frozen=True)
class Halved:
    """Forward Euler with one step length.

    Attributes:
        dt: step [s].
        steps: number of steps of the run.
        ratio: energy at the end over energy at the start [1].
        error: largest error of the angle in the first period [rad].
    """

    dt: float
    steps: int
    ratio: float
    error: float


@dataclass(frozen=True, eq=False)
class SmallAngles:
    """Numbers and runs at small angles.

    Attributes:
        omega: angular frequency [rad/s].
        runs: the runs of the three Euler methods, by name; with the student's own step, its run, too, as OWN.
        one_step: errors of single steps of forward Euler.
        halved: forward Euler with the step, half of it, and so on.
        halves: the runs to ``halved``.
    """

    omega: float
    runs: dict[str, ExerciseMotion]
    one_step: tuple[OneStep, ...]
    halved: tuple[Halved, ...]
    halves: tuple[ExerciseMotion, ...]

    @property
    def forward(self) -> ExerciseMotion:
        """The run of forward Euler."""
        return self.runs[EULERS[0]]

    @property
    def growth(self) -> float:
        """Relative growth of forward Euler's energy in one step, the mean over the run, without a unit."""
        return math.expm1(math.log(self.forward.ratio) / (len(self.forward.time) - 1))


def small_angles(omega: float, own: Method | None = None) -> SmallAngles:
    """Run the three Euler methods, and the student's own step, from 5 degrees for 10 s; forward Euler with halved
    steps, too. Raises MethodError if the own step does not stay finite.
    """
    runs = {name: small(omega, ANGLE, name, DURATION) for name in EULERS}
    halves = (runs[EULERS[0]], *(small(omega, ANGLE, EULERS[0], DURATION, STEP / 2**k) for k in range(1, HALVINGS + 1)))
    if own is not None:
        runs[OWN] = finite(lambda: small(omega, ANGLE, own, DURATION), DURATION)
    return SmallAngles(omega, runs, (at_top(omega), at_bottom(omega)),
                       tuple(halved(omega, run) for run in halves), halves)


def halved(omega: float, run: ExerciseMotion) -> Halved:
    """Return the energy ratio of a run and its largest error within the first period [rad]."""
    first = run.time <= math.tau / omega
    true, _ = exact.linear(run.time[first], ANGLE, 0.0, omega)
    return Halved(run.dt, len(run.time) - 1, run.ratio, float(np.max(np.abs(run.angle[first] - true))))


def at_top(omega: float) -> OneStep:
    """Return the angle's error in a step from rest at the release angle [rad]."""
    angle, _ = one_step(omega, ANGLE, 0.0)
    true, _ = exact.linear(STEP, ANGLE, 0.0, omega)
    return OneStep("top", angle - float(true), 0.5 * (omega * STEP) ** 2 * ANGLE)


def at_bottom(omega: float) -> OneStep:
    """Return the velocity's error in a step from the lowest point [rad/s]."""
    fastest = omega * ANGLE
    _, velocity = one_step(omega, 0.0, fastest)
    _, true = exact.linear(STEP, 0.0, fastest, omega)
    return OneStep("bottom", velocity - float(true), 0.5 * (omega * STEP) ** 2 * fastest)


def one_step(omega: float, angle: float, velocity: float) -> tuple[float, float]:
    """Return angle [rad] and velocity [rad/s] after one step of forward Euler."""
    run = solve(lambda _t, q, _v: -omega * omega * q, angle, velocity, [0.0, STEP], method=EULERS[0], h=STEP)
    return float(run.q[-1]), float(run.v[-1])
