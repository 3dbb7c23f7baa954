"""Part 2 with friction: Reynolds numbers, gamma from the recording's envelope, the damped run, and the comparison."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pendulum_env.exercise.given import Given
from pendulum_env.exercise.large_angles import ANGLE, DURATION
from pendulum_env.exercise.motion import STEP, Array, ExerciseMotion, large
from pendulum_env.exercise.small_angles import ANGLE as SMALL
from pendulum_env.lab.measures import Losses, Measurement, envelope_rate, period
from pendulum_env.lab.recording import RecordingError
from pendulum_env.lab.turning import TurningPoints, turning_points
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import Gravity, LinearDrag, SphereDrag
from pendulum_env.physics.flow import bottom_speed, quality_factor, reynolds_number
from pendulum_env.physics.medium import air
from pendulum_env.physics.scene import Scene

READINGS = 6
"""Number of amplitudes that gamma is determined from, spread over the recording."""
FAINT = 0.05
"""Share of its amplitude at which the damped run ends, if that is before two minutes."""
ROUND = 10.0
"""The damped run ends at a multiple of this time [s]."""
FIRST_SWINGS = 4.0
"""Number of swings in the enlarged plot of the energy."""
FINER = 20
"""Ratio of the usual step to that with which the energy of these swings is shown without the ripple of the method."""
COMPARED = 300.0
"""Longest part of a recording that is compared with the simulation [s]."""


@dataclass(frozen=True)
class Flow:
    """The flow past the ball at the bottom of a swing.

    Attributes:
        whose: "exercise" (the given or assumed ball), "recording" (the ball of the recording) or "readings" (the given
            or assumed ball, at amplitudes read by hand).
        amplitude: amplitude of the swing [rad].
        speed: speed of the ball at the bottom [m/s].
        reynolds: Reynolds number of the ball there [1].
        stokes: damping rate by Stokes' linear drag [1/s].
        sphere: rate of linear damping that takes as much energy as the drag C_d(Re) of a sphere [1/s].
        scene: the ball on its wire in air, without losses.
    """

    whose: str
    amplitude: float
    speed: float
    reynolds: float
    stokes: float
    sphere: float
    scene: Scene


@dataclass(frozen=True)
class Reason:
    """A reason why simulation and recording differ: its name, and the largest difference it makes [rad]."""

    name: str
    size: float


class Differing(ABC):
    """What was measured beside a simulation, and the size of their difference."""

    @property
    @abstractmethod
    def difference(self) -> Array:
        """Array of measured minus simulated values [rad]."""

    @property
    def rms(self) -> float:
        """Root mean square of the difference [rad]."""
        return float(np.sqrt(np.mean(self.difference**2)))

    @property
    def largest(self) -> float:
        """Largest difference [rad]."""
        return float(np.max(np.abs(self.difference)))


@dataclass(frozen=True, eq=False)
class Compared(Differing):
    """The simulation of the recorded swing beside the recording.

    Attributes:
        time, recorded, simulated: arrays of the times [s] and angles [rad] from the first turning point on.
        model: the simulated run; its time is 0 at the first turning point.
        gamma: its damping rate [1/s].
        start: time of the first turning point in the recording, from the release [s].
        amplitudes: time [s], recorded and simulated amplitude [rad], at the start, in the middle and at the end.
        cycles: number of oscillations that both periods are averaged over.
        period_recorded, period_simulated: mean periods [s].
        reasons: reasons of the differences, the largest first.
    """

    time: Array
    recorded: Array
    simulated: Array
    model: ExerciseMotion
    gamma: float
    start: float
    amplitudes: tuple[tuple[float, float, float], ...]
    cycles: int
    period_recorded: float
    period_simulated: float
    reasons: tuple[Reason, ...]

    @property
    def difference(self) -> Array:
        """Array of recorded minus simulated angle [rad]."""
        return self.recorded - self.simulated

    @property
    def lag(self) -> float:
        """Time by which the simulation is behind the recording at the end [s]; negative if it is ahead."""
        return self.cycles * (self.period_simulated - self.period_recorded)


@dataclass(frozen=True, eq=False)
class Readings(Differing):
    """Amplitudes read by hand beside the simulation of the same swing.

    Attributes:
        time: array of times since the first reading [s].
        angle, error: arrays of the read turning points [rad], of either side or all of one, and their errors [rad].
        simulated: array of the simulation's amplitudes at these times [rad].
        model: the simulated run; it starts at the first reading.
        gamma: its damping rate [1/s].
        reasons: reasons of the differences of the amplitudes, the largest first.
    """

    time: Array
    angle: Array
    error: Array
    simulated: Array
    model: ExerciseMotion
    gamma: float
    reasons: tuple[Reason, ...]

    @property
    def difference(self) -> Array:
        """Array of read minus simulated amplitude [rad]."""
        return np.abs(self.angle) - self.simulated

    @property
    def ends(self) -> tuple[int, ...]:
        """Indices of the first reading, of that in the middle, and of the last."""
        return 0, (len(self.time) - 1) // 2, len(self.time) - 1


@dataclass(frozen=True, eq=False)
class Recorded:
    """Numbers and runs with friction.

    Attributes:
        flows: Reynolds numbers at 30 and 5 degrees and at the recording's first and last amplitude.
        points: all amplitudes of the recording.
        readings: the 5 to 6 of them that gamma is determined from; the amplitudes read by hand, if there are any.
        gamma: damping rate from the readings [1/s].
        early, late: damping rate from the first and from the last third of all amplitudes [1/s].
        losses: parts of the loss per half swing; None for too few amplitudes.
        damped: run from 30 degrees with this gamma.
        fine: its first swings with a step of a FINER-th.
        compared: the comparison with the recording.
        by_hand: the comparison with amplitudes read by hand, which takes the place of ``compared`` where nothing was
            recorded; None otherwise, and if fewer than three readings are within COMPARED seconds.
    """

    flows: tuple[Flow, ...]
    points: TurningPoints
    readings: TurningPoints
    gamma: Measurement
    early: Measurement
    late: Measurement
    losses: Losses | None
    damped: ExerciseMotion
    fine: ExerciseMotion
    compared: Compared
    by_hand: Readings | None


def recorded(given: Given) -> Recorded:
    """Measure the damping of the recording, run the damped pendulum, and compare both.

    Raises RecordingError for a recording with fewer than three amplitudes.
    """
    points = given.sheet.points
    if len(points.time) < 3:
        raise RecordingError(f"{given.recording.source}: the damping needs at least 3 half swings, the recording has "
                             f"{len(points.time)}")
    readings = chosen(points, np.unique(np.linspace(0, len(points.time) - 1, READINGS).round().astype(np.intp)))
    gamma, third = envelope_rate(readings), max(3, len(points.time) // 3)
    theirs = gamma.value
    if given.amplitudes is not None:
        readings, gamma = given.amplitudes.points, given.amplitudes.decay
        theirs = theirs if given.simulated else gamma.value
    damping = max(gamma.value, 0.0)
    faint = 2.0 * math.log(1.0 / FAINT) / damping if damping > 0.0 else math.inf
    length = min(DURATION, ROUND * math.ceil(min(faint, DURATION) / ROUND))
    omega = given.omega.value.value
    first = min(FIRST_SWINGS * math.tau / omega, length)
    return Recorded(
        tuple(flows(given)), points, readings, gamma,
        envelope_rate(chosen(points, np.arange(third))),
        envelope_rate(chosen(points, np.arange(len(points.time) - third, len(points.time)))),
        given.sheet.losses, large(omega, ANGLE, length, damping), large(omega, ANGLE, first, damping, dt=STEP / FINER),
        compared(given, max(theirs, 0.0)), readings_beside(given, damping) if given.simulated else None,
    )


def chosen(points: TurningPoints, places: NDArray[np.intp]) -> TurningPoints:
    """Return the turning points with the given indices."""
    return TurningPoints(points.time[places], points.angle[places], points.error[places])


def flows(given: Given) -> list[Flow]:
    """Return the flow past the ball at the exercise's amplitudes, and at the first and the last of the recording, or of
    the amplitudes read by hand where nothing was recorded."""
    by_hand = given.amplitudes if given.simulated else None
    points = given.sheet.points if by_hand is None else by_hand.points
    first, last = (float(size) for size in points.amplitude[[0, -1]])
    own, other = given.body, given.sheet.scene.body
    mine = Scene("exercise", own, air(20.0), (Gravity(),), given.gravity)
    whose = "recording" if by_hand is None else "readings"
    if given.simulated and by_hand is None:
        length = given.gravity / given.recorded.value.value ** 2
        theirs = Scene("recording", Body(length, other.mass, other.radius), air(20.0), (Gravity(),), given.gravity)
    else:
        theirs = mine
    return [flow(mine, ANGLE, "exercise"), flow(mine, SMALL, "exercise"), flow(theirs, first, whose),
            flow(theirs, last, whose)]


def flow(scene: Scene, amplitude: float, whose: str) -> Flow:
    """Return the flow past a scene's ball at the bottom of a swing without losses."""
    speed = bottom_speed(scene, amplitude)
    stokes = scene.with_effects((Gravity(), LinearDrag())).coefficients["linear_drag_rate"]
    sphere = scene.omega0 / quality_factor(scene.with_effects((Gravity(), SphereDrag())), amplitude)
    return Flow(whose, amplitude, speed, reynolds_number(speed, scene.body, scene.medium), stokes, sphere,
                scene)


# --- the comparison -------------------------------------------------------------------------------------------------


def compared(given: Given, gamma: float) -> Compared:
    """Simulate the recorded swing with its measured frequency and damping from its first turning point, and compare."""
    swing, points = given.sheet.recording, given.sheet.points
    start, omega = float(points.time[0]), given.recorded.value.value
    part = (swing.time >= start) & (swing.time <= start + COMPARED)
    time, angle = swing.time[part] - start, swing.angle[part]
    model = large(omega, float(points.angle[0]), float(time[-1]), gamma)
    within = points.time - start <= time[-1]
    at, sizes = points.time[within] - start, points.amplitude[within]
    turns = turning_points(model)
    envelope = np.interp(at, np.concatenate([[0.0], turns.time]), np.concatenate([sizes[:1], turns.amplitude]))
    ends = sorted({0, (len(at) - 1) // 2, len(at) - 1})
    cycles, means = periods(time, angle, model)
    return Compared(
        time, angle, np.interp(time, model.time, model.angle), model, gamma, start,
        tuple((float(at[i]), float(sizes[i]), float(envelope[i])) for i in ends), cycles, *means,
        tuple(sorted(reasons(given, at, sizes, envelope), key=lambda one: -one.size)),
    )


@dataclass(frozen=True, eq=False)
class Part:
    """A part of a recording: arrays of time [s] and angle [rad]."""

    time: Array
    angle: Array


def periods(time: Array, angle: Array, model: ExerciseMotion) -> tuple[int, tuple[float, float]]:
    """Return the mean periods [s] of recording and simulation over the oscillations that both have, and their number.
    """
    whole = period(Part(time, angle))
    span = float(time[-1])
    for cycles in range(int(span / whole.value), 0, -1):
        try:
            return cycles, (period(Part(time, angle), cycles).value, period(model, cycles).value)
        except RecordingError:
            continue
    raise RecordingError("the comparison needs a full oscillation after the first turning point")


def reasons(given: Given, at: Array, sizes: Array, envelope: Array) -> list[Reason]:
    """Return the reasons of the differences with the largest difference that each makes [rad].

    ``sizes`` and ``envelope`` are the recorded and the simulated amplitudes [rad] at the times ``at`` [s]. A phase
    error phi changes the angle by up to ``amplitude phi``. The period grows as ``1 + A²/16``, so that a difference of
    the amplitudes adds up to a phase error ``Omega times the integral of (A_s² - A_r²)/16``; an error of Omega to
    ``t`` times it. The method is ahead by half a step from the start, because its velocity belongs to times half a step
    earlier, and its frequency is too large by the share ``(Omega dt)²/24``. The error of the start's time follows from
    the second differences of the times of the turning points.
    """
    omega = given.recorded.value
    slower = omega.value * (envelope**2 - sizes**2) / 16.0
    drift = np.concatenate([[0.0], np.cumsum(0.5 * (slower[1:] + slower[:-1]) * np.diff(at))])
    phase = omega.value * STEP
    ahead = 0.5 * phase + omega.value * at * phase**2 / 24.0
    scatter = float(np.sqrt(np.mean(np.diff(at, 2) ** 2) / 6.0)) if len(at) > 2 else 0.0
    return [
        Reason("law", float(np.max(np.abs(sizes - envelope)))),
        Reason("coupling", float(np.max(sizes * np.abs(drift)))),
        Reason("omega", float(np.max(sizes * omega.error * at))),
        Reason("method", float(np.max(sizes * ahead))),
        Reason("start", float(np.max(sizes)) * omega.value * scatter),
        Reason("reading", given.recording.noise),
    ]


# --- readings by hand -----------------------------------------------------------------------------------------------


def readings_beside(given: Given, gamma: float) -> Readings | None:
    """Simulate the swing that amplitudes were read from, with the measured frequency and the damping rate of these
    readings [1/s], from the first reading on; None without amplitudes, or with fewer than three within COMPARED."""
    if given.amplitudes is None:
        return None
    points, omega = given.amplitudes.points, given.omega.value.value
    part = points.time - points.time[0] <= COMPARED
    if np.count_nonzero(part) < 3:
        return None
    time, angle, error = points.time[part] - points.time[0], points.angle[part], points.error[part]
    model = large(omega, float(angle[0]), float(time[-1]) + math.tau / omega, gamma)
    at, sizes = crests(model)
    simulated = np.interp(time, at, sizes)
    size = np.abs(angle)
    reasons = (
        Reason("law", float(np.max(np.abs(given.amplitudes.best.at(points.time[part]) - simulated)))),
        Reason("gamma", float(np.max(0.5 * size * time)) * given.amplitudes.decay.error),
        Reason("first", float(error[0])),
        Reason("reading", float(np.median(error))),
    )
    return Readings(time, angle, error, simulated, model, gamma, tuple(sorted(reasons, key=lambda one: -one.size)))


def crests(run: ExerciseMotion) -> tuple[Array, Array]:
    """Return times [s] and amplitudes [rad] of a run's turning points, each the crest of the parabola through three
    steps; the first is the run's start, at rest."""
    size = np.abs(run.angle)
    k = np.flatnonzero((size[1:-1] >= size[:-2]) & (size[1:-1] > size[2:])) + 1
    slope, bend = 0.5 * (size[k + 1] - size[k - 1]), size[k + 1] - 2.0 * size[k] + size[k - 1]
    time = run.time[k] - run.dt * slope / bend
    return np.concatenate([run.time[:1], time]), np.concatenate([size[:1], size[k] - 0.5 * slope**2 / bend])
