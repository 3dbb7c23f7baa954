"""Hard cases: the driven pendulum from period doubling to chaos, in which all errors grow exponentially.

theta'' + theta'/q + sin(theta) = g cos(2t/3) with q = 2 (Baker & Gollub 1996, Chaotic Dynamics, chapter 3; Taylor 2005,
Classical Mechanics, chapter 12, uses the same pendulum in other units). The state once per period of the drive is a
Poincaré map; the cases test this map, its derivatives, and how long the motion can be predicted.

The error of a step is like that of a force error ``C PACE (PACE h)**p``, see :func:`.bounds.error_constant`. At time t
it has grown to at most this force error times the integral over s of |D(t) D(s)⁻¹|, where D is the derivative of the
motion by its start (Alekseev 1961; Hairer, Norsett & Wanner 1993, I.14).

The reference numbers of this pendulum were computed without this package. The tests compute them again, with 40-digit
Taylor series or with scipy's DOP853 and the first variation.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from itertools import takewhile
from typing import Any, NamedTuple

import numpy as np

from integrators import Method
from pendulum_env.engine.machine import ANGLE, TURNS, TWO_PI, VELOCITY, Machine
from pendulum_env.hard_cases.case import (
    ACCURATE,
    LOOSE,
    STABLE,
    WRONG,
    Case,
    Finding,
    always,
    demand,
    every,
    follows,
    foreseen,
    graded,
    known,
    named,
    ran,
    sooner,
    then,
)
from pendulum_env.hard_cases.predicted import Motion
from pendulum_env.physics.presets import SCENES
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.answer import Array, Truth
from pendulum_env.truth.bounds import error_constant, rounding_factor


class Doubling(NamedTuple):
    """Period doubling: the drive at which an orbit loses stability to one of twice its period.

    Attributes:
        periods: periods of the drive after which the orbit repeats.
        strength: strength of the drive at the doubling, to nine digits.
        published: published strength to four places; in the first doubling cut off, not rounded.
        orbit: state of the orbit at phase 0 of the drive.
        range: change of the strength up to which the orbit exists.
        slope: derivative of ``1 + trace + determinant`` of the Poincaré map's Jacobian by the strength, three digits.
    """

    periods: int
    strength: float
    published: float
    orbit: Truth
    range: float
    slope: float


class Exponent(NamedTuple):
    """Largest Lyapunov exponent [1/s].

    Attributes:
        value, error: the exponent and its standard error.
        scatter: standard deviation of the exponent of one motion over SPAN periods.
    """

    value: float
    error: float
    scatter: float

    def spread(self, periods: float) -> float:
        """Return the standard deviation [1/s] of an exponent that is measured over a number of periods of the drive."""
        return self.scatter * math.sqrt(SPAN / periods)


SPAN = 2000
"""Periods of the drive in which the scatter of an exponent was measured."""
SERIES = "Taylor series of order 36 in 40 digits, 48 steps a period; with 60 steps of order 40 it differs by 1e-27"
PERIOD = 3.0 * math.pi
"""Period of the drive [s]."""

_PERIODS: tuple[tuple[float, float, float, float, float], ...] = (
    (-6.308406913972585, 1.2975114936381074, 0.01308886781304984, 0.05902932223002471, 10.22),
    (-11.80306078723289, -0.025693720483862564, 0.734791402044317, -0.26425468198283625, 168.8),
    (-18.87079953329635, 1.3523333717260089, 0.011173434335475393, 0.003596338998300461, 13.76),
    (-23.34074155023236, 0.038819571427760866, 0.14471098583954292, 0.056214297215453526, 428.0),
    (-31.497160984876825, 1.4054639926998886, -0.017528298392326242, -0.35879963970948925, 1002.0),
    (-34.51062851759178, 0.910785723200408, -13.196641139651081, -10.022154783038555, 4.635e+4),
    (-37.582549644417384, 0.5926650858819171, 0.8155239933120233, 0.008469969761446807, 2294.0),
    (-44.04084481922072, 1.4213398781121904, 0.0027450522033721594, 0.11713141929048113, 338.3),
    (-46.34751279878069, 1.4606858228242028, 4.326900273378264, 3.1304990904506247, 1.553e+4),
    (-46.968089980048035, 0.9946585598498597, 73.22718964348303, 55.90880683072325, 2.68e+5),
    (-50.13861009167862, 0.5611556808959864, 18.933780880559354, -42.04206791499303, 1.341e+5),
    (-56.605133667781175, 1.4251790096699903, 2.793778459236977, 4.7932520887678205, 1.615e+4),
    (-58.75995386478556, 1.5701262285904192, 192.13126149664004, 133.9984570979321, 6.819e+5),
    (-57.26882821548308, 2.2642717754278285, 1931.1835273328245, 262.3726232327217, 5.673e+6),
    (-49.122289572394685, 1.8822463258741782, -968.0460020135513, 933.591337549296, 3.915e+6),
    (-46.40291802895571, 1.459688300372425, -889.2843747635072, -661.301686820147, 3.226e+6),
)
_COLUMNS = np.array(_PERIODS).T

MOTION = Truth(PERIOD * np.arange(1.0, len(_PERIODS) + 1.0), _COLUMNS[0], _COLUMNS[1], 4e-15, SERIES)
"""Chaotic motion from rest at 0.2 rad at drive strength 1.5, after 1, 2, ... periods of the drive, to rounding."""
BY_START = _COLUMNS[2:4].T
"""Derivatives of the angle and velocity of ``MOTION`` by the starting angle [1, 1/s]."""
AMPLIFIED = tuple(_COLUMNS[4].tolist())
"""Integral of |D(t) D(s)⁻¹| over s from 0 to t [s], in the Frobenius norm, after 1, 2, ... periods of the drive.

D(t) is the derivative of the state of ``MOTION`` at time t by the state at the start.
"""


def _orbit(angle: float, velocity: float, error: float) -> Truth:
    """Return a state on a periodic orbit as a reference; after one period it recurs to within ``error``."""
    return Truth(np.zeros(1), np.array([angle]), np.array([velocity]), error, "DOP853 brings it back")


DOUBLINGS = (
    Doubling(1, 1.0663728625, 1.0663, _orbit(-0.22147489973431525, 1.9596599331982114, 2e-8), 0.03, -35.3),
    Doubling(2, 1.0793139059, 1.0793, _orbit(-2.1149066599968838, 1.416524163977911, 2e-8), 0.005, -167.0),
)
"""Period doublings; published strengths from Taylor 2005, Classical Mechanics, table 12.1, and Baker & Gollub 1996."""

QUIET_STRENGTH, QUIET = 0.9, _orbit(-0.5602283290650862, 1.9335855133167923, 1e-11)
"""A drive strength at which the motion is periodic with the drive, and the state at phase 0 of the drive."""

EXPONENTS = {
    1.15: Exponent(0.09924, 0.00005, 0.00320),
    1.2: Exponent(0.13179, 0.00004, 0.00276),
    1.5: Exponent(0.11250, 0.00003, 0.00207),
}
"""Drive strength -> largest Lyapunov exponent.

Computed with ``python tests/support/exponents.py``: the mean over 2048 independent motions of 2000 periods each, by
RK4 and the first variation, and over 2048 others by two motions 1e-8 apart with SciPy's DOP853, see the README of
:mod:`pendulum_env.hard_cases`.
"""


GROUP = "chaos"
SCENE = SCENES["chaotic"]
DAMPING, STRENGTH = 0.5, 1.5
"""Damping 1/q [1/s], and drive strength of most cases."""
STEPS = 200
"""Steps per period of the drive of methods of order 4 and more."""
FINER = {1: 16, 2: 8, 3: 2}
"""Order -> number of times as many steps, so that the error of a step of low order is also small."""
PACE = 2.7
"""Bound of the speed [rad/s], and so of the rate at which forces change [1/s]."""
ROUNDING = 1e-6
"""Relative error of derivatives from central differences of runs 1e-5 apart."""
APART, NEAR = 1e-5, 1e-7
"""Displacements of the start for central differences."""
KNOWN_TO = 0.1
"""Largest error [rad] with which a motion counts as predictable, as a share of a radian."""
MEAN_OF, RARE = 5000, 4.0
"""Periods of a measured exponent, and the number of standard errors that none of a thousand measurements exceeds."""
DOUBTFUL = 0.02
"""Largest error of a method, as a share of an exponent, with which the exponent is measured."""
TOO_CRUDE = "its error is too large to predict even the first period"


def steps_of(method: Method) -> int:
    """Return the number of steps per period of the drive of a method."""
    return STEPS * FINER.get(named(method).order, 1)


def own(method: Method) -> float:
    """Return the constant force error [1/s²] whose effect equals that of a method's truncation errors."""
    return float(error_constant(method) * PACE * (PACE * PERIOD / steps_of(method)) ** method.order)


class Stroboscope:
    """Poincaré map of the driven pendulum, computed with one method.

    A call with the state (angle [rad], velocity [rad/s]) at phase 0 of the drive returns the state one period later.

    Raises ArithmeticError if the run stops, which must not happen here.
    """

    def __init__(self, strength: float, method: Method, periods: int) -> None:
        self._steps = steps_of(method)
        self._machine = Machine(driven(strength), method, (), sooner(method, periods * self._steps))

    def __call__(self, state: Any) -> Array:
        machine, at = self._machine, self._machine.state(float(state[0]), float(state[1]))
        if machine.advance(at, 0.0, PERIOD / self._steps, self._steps):
            raise ArithmeticError("the run stopped although the motion is bounded")
        return np.array([at[ANGLE] + TWO_PI * at[TURNS], at[VELOCITY]])

    def derivative(self, state: Array, periods: int = 1) -> Array:
        """Return the Jacobian of the Poincaré map over some periods of the drive from a state on.

        It is computed by central differences.
        """
        jacobian = np.eye(2)
        for _ in range(periods):
            ends = [self(state + APART * unit) - self(state - APART * unit) for unit in np.eye(2)]
            jacobian, state = np.array(ends).T / (2.0 * APART) @ jacobian, self(state)
        return jacobian

    def orbit(self, near: Any, periods: int) -> tuple[Array, Array]:
        """Return a state on a periodic orbit of this many periods, and the Poincaré map's Jacobian over them.

        The state is found by Newton's method with the Jacobian at the starting guess ``near``.
        """
        state = np.array(near)
        slope = self.derivative(state, periods) - np.eye(2)
        for _ in range(12):
            end = state
            for _ in range(periods):
                end = self(end)
            change = np.linalg.solve(slope, [math.remainder(end[0] - state[0], TWO_PI), end[1] - state[1]])
            state = state - change
            if np.max(np.abs(change)) < 1e-7:
                break
        return state, self.derivative(state, periods)


def state_of(truth: Truth) -> Array:
    """Return angle and velocity of a reference solution at its first time as an array."""
    return np.array([truth.angle[0], truth.velocity[0]])


def driven(strength: float) -> Scene:
    """Return the scene of the chaotic pendulum with a drive torque of this strength, in units of m g L."""
    return SCENE.replace(drive_torque=strength)


def _areas(method: Method) -> Finding:
    """Judge a method by the sum of the Lyapunov exponents: the growth rate of areas in phase space.

    The rate is measured over one period of the drive from one start, and must be -1/q, the rate of damping.
    """
    jacobian = Stroboscope(STRENGTH, method, 4).derivative(np.array([0.2, 0.0]))
    area = float(np.linalg.det(jacobian))
    demand(area > 0.0, f"the map changes areas by the factor {area:.3g}, which must be positive")
    allowed = 0.0 if "split" in method.needs else own(method)
    return graded(math.log(area) / PERIOD + DAMPING, allowed + ROUNDING, size=DAMPING, of="the sum of the exponents")


def _quiet(method: Method) -> Finding:
    """Judge a method by the larger Lyapunov exponent of a periodic orbit.

    Both exponents are equal, as the orbit's multipliers are complex conjugates.
    """
    _, jacobian = Stroboscope(QUIET_STRENGTH, method, 20).orbit(state_of(QUIET), 1)
    largest = math.log(float(np.max(np.abs(np.linalg.eigvals(jacobian))))) / PERIOD
    return graded(largest + 0.5 * DAMPING, own(method) + ROUNDING, size=0.5 * DAMPING, of="the exponent")


def _doubling(truth: Doubling, method: Method) -> Finding:
    """Judge a method by the drive strength at which its motion doubles its period.

    At a doubling a multiplier is -1, so that 1 + trace + determinant of the Poincaré map's Jacobian is zero. The zero
    is computed by Newton's method, with the derivative by the strength from the reference solution.
    """
    if own(method) > LOOSE * truth.range:
        return Finding(STABLE, note="its error is too large for the range of drive strengths with this orbit")
    strength, state = truth.strength, state_of(truth.orbit)
    for _ in range(12):
        state, jacobian = Stroboscope(strength, method, 16 * truth.periods).orbit(state, truth.periods)
        change = (1.0 + float(np.trace(jacobian)) + float(np.linalg.det(jacobian))) / truth.slope
        strength -= change
        if abs(change) < 0.1 * ROUNDING or not abs(strength - truth.strength) < truth.range:
            break
    return graded(strength - truth.strength, own(method) + ROUNDING, "the period doubles at another drive strength",
                  size=truth.range, of="the range of drive strengths with this orbit")


def _exponent(strength: float, method: Method) -> Finding:
    """Judge a method by its largest Lyapunov exponent.

    The exponent is the mean rate at which two motions separate, with their distance reset to 1e-8 after each period.
    """
    truth, periods, apart = EXPONENTS[strength], MEAN_OF, 1e-8
    if own(method) > DOUBTFUL * truth.value:
        return Finding(STABLE, note=f"its error is more than {DOUBTFUL:.0%} of the exponent")
    advance = Stroboscope(strength, method, 2 * periods)
    state, direction, log_growth = np.array([0.2, 0.0]), np.array([1.0, 0.0]), 0.0
    for i in range(-50, periods):
        near, far = advance(state), advance(state + apart * direction)
        size = float(np.hypot(*(far - near)))
        direction = (far - near) / size
        state = np.array([math.remainder(near[0], TWO_PI), near[1]])
        log_growth += math.log(size / apart) if i >= 0 else 0.0
    allowed = RARE * math.hypot(truth.error, truth.spread(periods)) + own(method)
    exponent = log_growth / (periods * PERIOD)
    return graded(exponent - truth.value, allowed, "neighbouring motions separate at another mean rate",
                  size=truth.value, of="the exponent")


def _first_period(name: str, strength: float, start: tuple[float, float]) -> Motion:
    """Return the motion over the first period of the drive, whose error is predicted; ``name`` is also its equation."""
    return Motion(name, driven(strength), name, *start, PERIOD, growth=AMPLIFIED[0], pace=PACE)


HORIZON = replace(_first_period("driven at 1.5", STRENGTH, (0.2, 0.0)), name="an honest horizon")


first_period = partial(follows, HORIZON)
"""Function that judges a method by its run over the first period of the drive."""


def _apart(method: Method) -> Finding:
    """Judge a method by the derivative of the motion by its starting angle, from two nearby starts.

    Only the periods count after which the allowed error is less than LOOSE of the derivative. The error of the motion
    itself after the first period must be that of the method's formula.
    """
    advance, findings = Stroboscope(STRENGTH, method, 2 * len(AMPLIFIED)), [first_period(method)]
    if own(method) * AMPLIFIED[0] > KNOWN_TO:
        return every(Finding(STABLE, note=TOO_CRUDE), *findings)
    above, below = np.array([0.2 + NEAR, 0.0]), np.array([0.2 - NEAR, 0.0])
    for amplified, by_start in zip(AMPLIFIED, BY_START, strict=True):
        above, below = advance(above), advance(below)
        error = (above - below) / (2.0 * NEAR) - by_start
        # The derivative grows like the error of the motion, and an error of the motion adds one of the derivative.
        # Central differences add NEAR² times the third power of the growth, and the rounding of both motions.
        cut = (NEAR * amplified) ** 2 + 1e-15 * rounding_factor(method) / NEAR
        allowed, size = (own(method) * amplified + cut) * amplified, float(np.hypot(*by_start))
        if allowed <= LOOSE * size:
            findings.append(graded(error, allowed, "neighbouring motions separate at another rate", size=size,
                                   of="the derivative by the start"))
    return every(*findings)


def _horizon(method: Method) -> Finding:
    """Judge a method by the angle after each period of the drive, while the motion is predictable.

    The motion is predictable while the method's amplified error is below KNOWN_TO. After that only the speed is
    checked, which stays below q (1 + g) because |v|' <= -|v|/q + 1 + g.
    """
    periods = len([*takewhile(lambda size: own(method) * size <= KNOWN_TO, AMPLIFIED)])
    advance, state = Stroboscope(STRENGTH, method, len(AMPLIFIED)), np.array([0.2, 0.0])
    note = f"predictable for {periods} periods" if periods else TOO_CRUDE
    findings = [] if periods else [Finding(STABLE, note=note)]
    for i, amplified in enumerate(AMPLIFIED):
        state = advance(state)
        demand(abs(state[1]) <= (1.0 + STRENGTH) / DAMPING, "it is faster than this drive allows", abs(state[1]))
        if i < periods:
            allowed = (own(method) + 1e-14) * amplified
            findings.append(graded(state[0] - MOTION.angle[i], allowed,
                                   "its error is larger than the amplified error of its order", note, of="a radian"))
    return every(*findings)


def doubled(truth: Doubling) -> Motion:
    """Return the first period of an orbit at the drive at which its period doubles."""
    start = float(truth.orbit.angle[0]), float(truth.orbit.velocity[0])
    return _first_period(f"the doubling to {2 * truth.periods} periods", truth.strength, start)


def _doubles(truth: Doubling) -> Case:
    """Return the case of a period doubling."""
    motion = doubled(truth)
    return foreseen(
        GROUP, motion, "Close to a period doubling, the motion approaches its periodic orbit arbitrarily slowly.",
        f"a multiplier is -1 at g = {truth.strength:.8f}, published as {truth.published:g}; the error of the orbit's "
        "first period is that of the formula",
        "Taylor 2005, Classical Mechanics, table 12.1, and Floquet multipliers by DOP853, to 9 digits",
        partial(then, partial(follows, motion), partial(_doubling, truth)),
        known(own, LOOSE * truth.range, STABLE), truth.periods > 1)


def _claimed(method: Method) -> Finding:
    """Judge the ``error_estimate`` of a chaotic rollout after each period of the drive.

    True errors must be below ten times the estimate.
    """
    run = ran(driven(STRENGTH), method, dt=PERIOD / STEPS, steps=STEPS * len(AMPLIFIED), every=STEPS, angle=0.2,
              velocity=0.0, estimate_error=True)
    if run.error_estimate is None:
        return Finding(WRONG, note="the run has no error estimate")
    error = np.abs(run.angle[1:] - MOTION.angle)
    estimates = np.maximum.accumulate(run.error_estimate[1:])
    ratios = np.maximum.accumulate(error) / (10.0 * estimates)
    horizon = int(np.count_nonzero(np.isfinite(estimates)))
    return graded(ratios, 1.0, "the error is more than ten times the estimate",
                  f"{horizon} of {len(AMPLIFIED)} periods have an estimate", size=0.1, of="the estimated error",
                  why="an estimate from two runs gives the size of an error, within a factor of ten")


MATRICES = "40-digit Taylor series of the motion and its first variation; see pendulum_env.hard_cases.chaos"
PREDICTABLE = known(lambda method: own(method) * AMPLIFIED[0], KNOWN_TO, STABLE)
"""Rule of the allowed outcomes: ACCURATE if a method's angle is predictable after one period of the drive."""

CASES = (
    Case("areas shrink by exp(-t/q)", GROUP,
         "The sum of the Lyapunov exponents is known exactly, so that small errors in the growth of areas show.",
         "the Lyapunov exponents sum to -1/q, to rounding for methods with the exact flow of drag",
         "Liouville's theorem; Baker & Gollub 1996, 5.5", driven(STRENGTH), always(ACCURATE), _areas),
    Case("a quiet drive's exponents", GROUP,
         "A periodic orbit has to be located although neighbouring motions spiral around it.",
         "both exponents are -1/(2q) at g = 0.9", "conjugate multipliers of product exp(-T/q) (Floquet)",
         driven(QUIET_STRENGTH), always(ACCURATE), _quiet),
    *map(_doubles, DOUBLINGS),
    foreseen(GROUP, HORIZON, "The derivatives of the motion by its start grow a thousandfold within ten periods of the "
             "drive.", "the derivative by the starting angle after each period; the error of the motion is that of the "
             "formula", MATRICES, _apart, PREDICTABLE, name="neighbours part"),
    foreseen(GROUP, HORIZON, "Every error grows until the motion is unpredictable, sooner for less accurate methods.",
             "the motion in 40 digits while the method's amplified error is below 0.1 rad; then |v| <= q (1 + g); the "
             "error after the first period is that of the method's formula", MATRICES,
             partial(then, first_period, _horizon), PREDICTABLE),
    Case("no claims beyond the horizon", GROUP,
         "An error estimate from two runs could be small by chance although both runs are wrong.",
         "errors are below ten times error_estimate, which is inf when the motion is unpredictable", MATRICES,
         driven(STRENGTH), always(ACCURATE), _claimed, True),
    *(
        Case(f"the largest exponent at g = {strength:g}", GROUP,
             "Two chaotic motions that look right may separate from each other at a wrong rate.",
             f"{truth.value:.5f} +- {truth.error:.5f} 1/s, within {RARE:g} standard errors of {MEAN_OF} periods",
             "8 million periods by the first variation and by two motions; see pendulum_env.hard_cases.chaos",
             driven(strength), known(own, DOUBTFUL * truth.value, STABLE), partial(_exponent, strength), True)
        for strength, truth in EXPONENTS.items()
    ),
)
