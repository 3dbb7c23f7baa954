"""Hard cases: the driven pendulum's way into chaos, where errors grow as fast as anything else that is not known.

theta'' + theta'/q + sin(theta) = g cos(2t/3) with q = 2 (Baker & Gollub 1996, Chaotic Dynamics, chapter 3; the same in
other units is the pendulum of Taylor 2005, Classical Mechanics, chapter 12). Its state once per period of the drive is
a map of the plane; all cases ask for that map, its derivatives, or how long it is known.

A method's error over one step is that of a force off by ``C PACE (PACE h)**p``, see
:func:`.steps.error_constant`; at the time t it has grown to no more than that times the integral over s of
|D(t) D(s)⁻¹|, D being the motion's derivative by its start (Alekseev 1961; Hairer, Norsett & Wanner 1993, I.14).
"""

from __future__ import annotations

import math
from itertools import takewhile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators import Method
from pendulum_env.engine.machine import ANGLE, TURNS, TWO_PI, VELOCITY, Machine
from pendulum_env.hard_cases.case import (
    ACCURATE,
    STABLE,
    WRONG,
    Case,
    Finding,
    Rule,
    Try,
    always,
    graded,
    known,
    ran,
    sooner,
    stopped,
)
from pendulum_env.physics.presets import SCENES
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.answer import Truth
from pendulum_env.truth.chaos import (
    AMPLIFIED,
    BY_START,
    DOUBLINGS,
    EXPONENTS,
    MOTION,
    PERIOD,
    QUIET,
    QUIET_STRENGTH,
    Doubling,
)
from pendulum_env.truth.steps import cancelling, error_constant

GROUP = "chaos"
KNOWN: dict[tuple[str, str], str] = {}
"""(case, method) -> why it fails, and what it does instead."""

SCENE = SCENES["chaotic"]
DAMPING, STRENGTH = 0.5, 1.5
"""1/q [1/s], and the drive of most cases."""
STEPS = 200
"""In a period of the drive."""
PACE = 2.7
"""Speeds stay below this [rad/s]: the fastest that forces change [1/s]."""
ROUNDING = 1e-6
"""What differences between runs 1e-5 apart leave of derivatives, relative."""
APART, NEAR = 1e-5, 1e-7
KNOWN_TO = 0.3
"""A motion is known while its error is below this [rad], of which the sine is linear to 2 %."""
TOO_CRUDE = "its horizon is before the end of the first period"

Array = NDArray[np.float64]


def own(method: Method) -> float:
    """The force [1/s²] that the method's order leaves unaccounted for."""
    return float(error_constant(method) * PACE * (PACE * PERIOD / STEPS) ** method.order)


class Stroboscope:
    """The map of a state (angle [rad], velocity [rad/s]) at the drive's phase 0 over one of its periods.

    Raises ArithmeticError where the run stops, which none of these may.
    """

    def __init__(self, strength: float, method: Method, periods: int) -> None:
        self._machine = Machine(driven(strength), method, (), sooner(method, periods * STEPS))

    def __call__(self, state: Any) -> Array:
        machine, at = self._machine, self._machine.state(float(state[0]), float(state[1]))
        if machine.advance(at, 0.0, PERIOD / STEPS, STEPS):
            raise ArithmeticError("the run stopped although nothing grows")
        return np.array([at[ANGLE] + TWO_PI * at[TURNS], at[VELOCITY]])

    def derivative(self, state: Any) -> Array:
        """Its Jacobian, by central differences."""
        ends = [self(state + APART * unit) - self(state - APART * unit) for unit in np.eye(2)]
        return np.array(ends).T / (2.0 * APART)

    def derivative_of(self, state: Array, periods: int) -> Array:
        """That over several periods."""
        jacobian = np.eye(2)
        for _ in range(periods):
            jacobian = self.derivative(state) @ jacobian
            state = self(state)
        return jacobian

    def orbit(self, near: Any, periods: int) -> tuple[Array, Array]:
        """A motion that repeats itself after so many periods, and the map's Jacobian there.

        By Newton's method with the Jacobian of the start.
        """
        state = np.array(near)
        slope = self.derivative_of(state, periods) - np.eye(2)
        for _ in range(12):
            end = state
            for _ in range(periods):
                end = self(end)
            change = np.linalg.solve(slope, [math.remainder(end[0] - state[0], TWO_PI), end[1] - state[1]])
            state = state - change
            if np.max(np.abs(change)) < 1e-7:
                break
        return state, self.derivative_of(state, periods)


def state_of(truth: Truth) -> Array:
    """The first state of a motion."""
    return np.array([truth.angle[0], truth.velocity[0]])


def driven(strength: float) -> Scene:
    """The scene with this drive, in units of m g L."""
    return SCENE.replace(drive_torque=strength)


def _areas(method: Method) -> Finding:
    """The sum of the Lyapunov exponents, which is the rate at which areas grow, over one period from one start."""
    jacobian = Stroboscope(STRENGTH, method, 4).derivative(np.array([0.2, 0.0]))
    area = float(np.linalg.det(jacobian))
    if area <= 0.0:
        return Finding(WRONG, note=f"an area became {area:.3g} times what it was")
    allowed = 0.0 if "split" in method.needs else own(method)
    return graded(math.log(area) / PERIOD + DAMPING, allowed + ROUNDING)


def _quiet(method: Method) -> Finding:
    """Below the first doubling the multipliers are conjugate, so that both exponents are half of the sum."""
    _, jacobian = Stroboscope(QUIET_STRENGTH, method, 20).orbit(state_of(QUIET), 1)
    largest = math.log(float(np.max(np.abs(np.linalg.eigvals(jacobian))))) / PERIOD
    return graded(largest + 0.5 * DAMPING, own(method) + ROUNDING)


def _doubling(truth: Doubling) -> Try:
    """The drive at which a multiplier is -1, so that 1 + trace + determinant = 0: followed with the truth's slope."""

    def attempt(method: Method) -> Finding:
        if own(method) > truth.range:
            return Finding(STABLE, note="its error is beyond the range of drives in which that orbit exists")
        strength, state = truth.strength, state_of(truth.orbit)
        for _ in range(12):
            state, jacobian = Stroboscope(strength, method, 16 * truth.periods).orbit(state, truth.periods)
            change = (1.0 + float(np.trace(jacobian)) + float(np.linalg.det(jacobian))) / truth.slope
            strength -= change
            if abs(change) < 0.1 * ROUNDING or not abs(strength - truth.strength) < truth.range:
                break
        return graded(strength - truth.strength, own(method) + ROUNDING, "it doubles its period at another drive")

    return attempt


def _exponent(strength: float) -> Try:
    """The mean rate at which two motions 1e-8 apart part, set back to that distance after each period."""
    truth, scatter = EXPONENTS[strength]
    periods, apart = 2000, 1e-8

    def attempt(method: Method) -> Finding:
        if own(method) > 0.5 * truth:
            return Finding(STABLE, note="its error is as large as the exponent")
        advance = Stroboscope(strength, method, 2 * periods)
        state, way, grown = np.array([0.2, 0.0]), np.array([1.0, 0.0]), 0.0
        for i in range(-50, periods):
            near, far = advance(state), advance(state + apart * way)
            size = float(np.hypot(*(far - near)))
            way = (far - near) / size
            state = np.array([math.remainder(near[0], TWO_PI), near[1]])
            grown += math.log(size / apart) if i >= 0 else 0.0
        allowed = 4.0 * scatter * math.sqrt(39_500 / periods) + own(method)
        found = grown / (periods * PERIOD)
        return graded(found - truth, allowed, "neighbours part at another mean rate")

    return attempt


def _first(method: Method) -> float:
    """Its error of the angle after one period [rad]."""
    return float(own(method) * AMPLIFIED[0])


def _periods(method: Method, most: float = math.inf) -> int:
    """After how many periods the method's error, or the growth of anything, has been amplified too far."""
    return len(list(takewhile(lambda size: own(method) * size <= KNOWN_TO and size < most, AMPLIFIED)))


def _apart(method: Method) -> Finding:
    """How far starts 2e-7 apart are after one, two, ... periods: the motion's derivative, while that is known."""
    known_for = _periods(method, 2e3)
    if not known_for:
        return Finding(STABLE, note=TOO_CRUDE)
    advance, worst = Stroboscope(STRENGTH, method, 2 * known_for), Finding(ACCURATE, 0.0, 1.0)
    above, below = np.array([0.2 + NEAR, 0.0]), np.array([0.2 - NEAR, 0.0])
    for amplified, by_start in zip(AMPLIFIED[:known_for], BY_START, strict=False):
        above, below = advance(above), advance(below)
        error = (above - below) / (2.0 * NEAR) - by_start
        # The derivative grows like the motion's error, and with a motion that is off by e is off by that much again;
        # central differences leave NEAR² of the third power of the growth, and the two motions round apart.
        cut = (NEAR * amplified) ** 2 + 1e-15 * cancelling(method) / NEAR
        allowed = (own(method) * amplified + cut) * amplified
        found = graded(error, allowed, "neighbours part at another rate")
        worst = max(worst, found, key=lambda one: one.error / one.tolerance)
    return worst


def _horizon(method: Method) -> Finding:
    """The angle after each period until what the order leaves, amplified, is KNOWN_TO; then only its bounds.

    Speeds end below q (1 + g): |v|' <= -|v|/q + 1 + g.
    """
    known_for = _periods(method)
    advance, state = Stroboscope(STRENGTH, method, len(AMPLIFIED)), np.array([0.2, 0.0])
    words = f"known for {known_for} periods" if known_for else TOO_CRUDE
    worst = Finding(ACCURATE if known_for else STABLE, 0.0, 1.0, words)
    for i, amplified in enumerate(AMPLIFIED):
        state = advance(state)
        if not abs(state[1]) <= (1.0 + STRENGTH) / DAMPING:
            return Finding(WRONG, abs(state[1]), note="it is faster than the drive can make it")
        if i < known_for:
            allowed = (own(method) + 1e-14) * amplified
            found = graded(state[0] - MOTION.angle[i], allowed, "it left the motion before its own error had grown",
                           worst.note)
            worst = max(worst, found, key=lambda one: one.error / one.tolerance)
    return worst


def _claimed(method: Method) -> Finding:
    """``error_estimate`` at each period: what is known is known to a factor of 10, and nothing is known beyond."""
    run = ran(driven(STRENGTH), method, dt=PERIOD / STEPS, steps=STEPS * len(AMPLIFIED), every=STEPS, angle=0.2,
              velocity=0.0, estimate_error=True)
    ended = stopped(run)
    if ended is not None or run.error_estimate is None:
        return ended or Finding(WRONG, note="there is no estimate")
    error = np.abs(run.angle[1:] - MOTION.angle)
    claimed = np.maximum.accumulate(run.error_estimate[1:])
    lies = np.maximum.accumulate(error) / (10.0 * claimed)
    horizon = int(np.count_nonzero(np.isfinite(claimed)))
    return graded(lies, 1.0, "it claims more than it knows", f"claims {horizon} of {len(AMPLIFIED)} periods")


def _case(name: str, why: str, truth: str, attempt: Try, source: str, may: Rule, *, strength: float = STRENGTH,
          long: bool = False) -> Case:
    return Case(name, GROUP, why, truth, source, driven(strength), may, attempt, long)


MATRICES = "40-digit Taylor series of the motion and its first variation; see pendulum_env.truth.chaos"
TAYLOR = "Taylor 2005, Classical Mechanics, table 12.1, and Floquet multipliers by DOP853, to 9 digits"

CASES = (
    _case("areas shrink by exp(-t/q)", "The exponents' sum is known exactly whatever the motion does.",
          "the Lyapunov exponents sum to -1/q, to rounding where drag has its exact flow", _areas,
          "Liouville's theorem; Baker & Gollub 1996, 5.5", always(ACCURATE)),
    _case("a quiet drive's exponents", "An orbit that repeats has to be found, and its neighbours turn round it.",
          "both exponents are -1/(2q) at g = 0.9", _quiet, "conjugate multipliers of product exp(-T/q) (Floquet)",
          always(ACCURATE), strength=QUIET_STRENGTH),
    *(
        _case(f"the doubling to {2 * truth.periods} periods", "At a doubling transients die as slowly as one likes.",
              f"a multiplier is -1 at g = {truth.strength:.8f}, published as {truth.published:g}", _doubling(truth),
              TAYLOR, known(own, truth.range, STABLE), strength=truth.strength, long=truth.periods > 1)
        for truth in DOUBLINGS
    ),
    _case("neighbours part", "Derivatives by the start grow a thousandfold within ten periods.",
          "the derivative by the starting angle after each period", _apart, MATRICES, known(_first, KNOWN_TO, STABLE)),
    _case("an honest horizon", "Every error grows until nothing is known, sooner for cruder methods.",
          "the motion in 40 digits while the method's own error, amplified, is below 0.3 rad; then |v| <= q (1 + g)",
          _horizon, MATRICES, known(_first, KNOWN_TO, STABLE)),
    _case("no claims beyond the horizon", "An estimate from two runs could be small by chance when both are lost.",
          "errors are below ten times what error_estimate says, which is inf beyond the horizon", _claimed, MATRICES,
          always(ACCURATE), long=True),
    *(
        _case(f"the largest exponent at g = {strength:g}", "Chaos has to have the right rate, and not just any.",
              f"{value:.4f} +- {scatter:.4f} 1/s, within what 2000 periods scatter", _exponent(strength),
              "40 000 periods of the motion with its first variation; see pendulum_env.truth.chaos",
              known(own, 0.5 * value, STABLE),
              strength=strength, long=True)
        for strength, (value, scatter) in EXPONENTS.items()
    ),
)
