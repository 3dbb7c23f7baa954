"""Hard cases: very many steps, where what a step does wrong, or rounds away, has time to add up.

Over n steps of z = omega0 h, a method of order p (Hairer, Lubich & Wanner 2006, Geometric Numerical Integration, I.1,
IX.8, X.3, XI.3; Brouwer 1937, Astron. J. 46, 149, of rounding)::

    energy of symplectic and of symmetric methods    off by z**p at most, and no more late than early
    energy of the others                             n z**(p+1), p odd, or n z**(p+2), p even: terms of the modified
                                                     equation whose order is odd are reversible, and lose nothing
    phase                                            n z z**p, and with a drift of the energy d half as much times d
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from integrators import Method, MethodError
from pendulum_env.engine.machine import ANGLE, INDEX, TURNS, TWO_PI, Machine
from pendulum_env.engine.rollout import Rollout
from pendulum_env.hard_cases.case import (
    ACCURATE,
    DIVERGED,
    NEWTON,
    STABLE,
    WRONG,
    Case,
    Finding,
    Rule,
    Try,
    graded,
    known,
    ran,
    stopped,
)
from pendulum_env.physics import exact
from pendulum_env.physics.presets import SCENES
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.steps import cancelling, error_constant, retraces

GROUP = "long runs"
KNOWN: dict[tuple[str, str], str] = {}
"""(case, method) -> why it fails, and what it does instead."""

SCENE = SCENES["vacuum"]
PRODUCT = 0.05
"""omega0 h."""
SHORT, LONG = 100_000, 100_000_000
MOST_WORK = 1e9
"""Force evaluations of a long run, some 10 s: a method to which LONG steps are dearer takes as many as these allow."""
ULPS = 50.0
POLE = 2.2
"""K'(sin 1/2): how far from the bottom the motion from 1 rad has a pole [1/omega0]."""
SMALL = 0.5
"""Errors above this are no small number: the order says no more of them."""
HLW = "Hairer, Lubich & Wanner 2006, Geometric Numerical Integration"


def steps_for(method: Method, steps: int, most: float = MOST_WORK) -> int:
    """So many steps, or as many as the work allows."""
    return int(min(steps, most / (method.evaluations * (NEWTON if method.implicit else 1.0))))


def rounding(method: Method) -> float:
    """Relative, of one sign in each step in units of its increments: coefficients rounded to doubles err alike."""
    return ULPS * cancelling(method) * 2.0**-52


def conserving(method: Method) -> bool:
    """True if nothing but rounding lets the energy drift."""
    return method.symplectic or method.symmetric


def weight(method: Method, power: int) -> float:
    """By how much its error may exceed z**power: pieces of a composition add up, and constants of multistep methods do
    not fall as 1/n! where the motion's derivatives grow as n!/POLE**n."""
    return max(1.0, 2.0 * error_constant(method) * math.factorial(method.order + 1) / POLE**power)


def drift(method: Method, steps: float) -> float:
    """Largest relative change of the energy that the method's order leaves."""
    rest = rounding(method) * steps * PRODUCT
    if math.isinf(method.order):
        return rest
    if conserving(method):
        return float(weight(method, method.order) * PRODUCT**method.order) + rest
    power = 2 * (method.order // 2) + 2
    return float(steps * weight(method, power) * PRODUCT**power) + rest


def _run(method: Method, steps: int) -> Rollout:
    """From 1 rad, recorded 3000 times, with an odd stride that meets every phase of the swing."""
    return ran(SCENE, method, dt=PRODUCT / SCENE.omega0, steps=steps, every=max(1, steps // 3000) | 1, angle=1.0,
               velocity=0.0)


def _known(allowed: Callable[[Method], float]) -> Rule:
    return known(allowed, SMALL, STABLE, DIVERGED)


def _energy_drift(wanted: int, method: Method) -> float:
    return drift(method, steps_for(method, wanted))


def _energy(wanted: int, method: Method) -> Finding:
    steps = steps_for(method, wanted)
    run = _run(method, steps)
    ended = stopped(run)
    if ended is not None:
        return ended
    size = np.abs(run.energy_residual) / run.energy[0]
    allowed, tenth = drift(method, steps), len(size) // 10
    early, late = float(np.max(size[:tenth])), float(np.max(size[-tenth:]))
    note = "" if steps == wanted else f"{steps:.2g} steps, for as much work as these cost"
    if conserving(method) and late > 1.01 * early + rounding(method) * steps * PRODUCT:
        return Finding(WRONG, late, early, "the energy's error grows although the method conserves")
    if allowed > SMALL:
        gain, most = float(np.max(run.energy)) / run.energy[0] - 1.0, math.expm1(min(allowed, 100.0))
        return Finding(STABLE if gain <= most else WRONG, gain, most, note or "its drift is no small number")
    return graded(size, allowed, "the energy drifts faster than the order allows", note)


def _phase_error(method: Method) -> float:
    """Of the angle after SHORT steps [rad]: in proportion to the time, and by a frequency that drifts."""
    turned = SHORT * PRODUCT
    lost = 0.0 if conserving(method) else 0.5 * drift(method, SHORT)
    order = 0.0
    if math.isfinite(method.order):
        order = float(weight(method, method.order) * PRODUCT**method.order)
    return turned * (order + lost) + float(4.0 * rounding(method) * PRODUCT * turned**1.5)


def _phase(method: Method) -> Finding:
    """The angle in SHORT steps against Jacobi's functions."""
    run = _run(method, SHORT)
    ended = stopped(run)
    if ended is not None:
        return ended
    allowed = _phase_error(method)
    if allowed > SMALL:
        largest, most = float(np.max(np.abs(run.angle))), 1.1 * math.exp(min(drift(method, SHORT), 100.0))
        return Finding(STABLE if largest <= most else WRONG, largest, most, "its phase is no longer known")
    truth, _ = exact.pendulum(run.time, 1.0, 0.0, SCENE.omega0)
    return graded(run.angle - truth, allowed, "its phase is off by more than the order allows")


def _rounded(starts: int, steps: int, method: Method) -> Finding:
    """There and back: how far from its start the energy ends, in rms over an ensemble, after a hundredth and all.

    A symmetric method retraces its steps, so that what is left is rounding; compensated, that of the increments, which
    are smaller than the state by about z, and have no preferred sign.
    """
    if not retraces(method):
        return Finding(STABLE, note="it does not retrace its steps, so that rounding cannot be told apart")
    angles = np.random.default_rng(7).uniform(0.2, 2.8, starts)
    found = []
    for count in (steps // 100, steps):
        go = partial(ran, SCENE, method, dt=PRODUCT / SCENE.omega0, steps=count, every=count, compensated=True,
                     backend="auto")
        try:
            there = go(angle=angles, velocity=np.zeros(starts))
        except MethodError as error:
            return Finding(STABLE, note=str(error))
        back = go(angle=there.angle[:, -1], velocity=-there.velocity[:, -1])
        change = (back.energy[:, -1] - there.energy[:, 0]) / there.energy[:, 0]
        found.append(float(np.sqrt(np.mean(change * change))))
    allowed = 4.0 * 2.0**-52 * cancelling(method) * (1.0 + PRODUCT * math.sqrt(2.0 * steps))
    grown = found[1] / max(found[0], 2.0**-52)
    # sqrt(100), and as much again for what rms of so many starts scatter.
    wrong = "it grows faster than the square root of the number of steps" if grown > 20.0 else ""
    return graded(found[1], allowed, wrong, f"{grown:.2g} times in 100 times as many steps")


@dataclass(frozen=True)
class Rotation:
    """Going round from 0.3 rad with ``speed`` [rad/s], ``each`` [rad] a step."""

    scene: Scene
    speed: float
    each: float
    steps: int

    def error(self, method: Method) -> float:
        """What the order leaves of the angle [rad]: gravity changes the speed by (omega0/speed)**2 of it."""
        count, kick = steps_for(method, self.steps), (self.scene.omega0 / self.speed) ** 2
        order = 0.0 if math.isinf(method.order) else float(self.each**method.order)
        lost = 0.0
        if order and not conserving(method):
            lost = count * float(self.each ** (2 * (method.order // 2) + 2))
        return count * self.each * (rounding(method) + kick * (order + lost))

    def attempt(self, method: Method) -> Finding:
        """Whole and half turns are counted, the rest is kept from the nearer of bottom and top."""
        h, count = self.each / self.speed, steps_for(method, self.steps)
        machine = Machine(self.scene, method, ())
        state = machine.state(0.3, self.speed)
        if machine.advance(state, 0.0, h, count):
            return Finding(DIVERGED, stop_time=float(state[INDEX]) * h)
        turns, angle, allowed, time = float(state[TURNS]), float(state[ANGLE]), self.error(method), count * h
        if turns % 0.5 or abs(angle) > 0.5 * math.pi * (1.0 + 1e-12):
            return Finding(WRONG, turns, note="turns are no whole or half number, or the angle is not wrapped")
        free = not self.scene.gravity
        wanted = 0.3 + self.speed * time if free else exact.pendulum(time, 0.3, self.speed, self.scene.omega0)[0]
        error = abs((turns - float(wanted) / TWO_PI) * TWO_PI + angle)
        if allowed > SMALL:
            return Finding(STABLE, error, allowed, "its phase is no longer known")
        return graded(error, allowed, "it counted other turns", f"{turns:.7g} turns")


def _case(name: str, why: str, truth: str, attempt: Try, source: str, may: Rule, scene: Scene = SCENE,
          long: bool = False) -> Case:
    return Case(name, GROUP, why, truth, source, scene, may, attempt, long)


FREE, ROUND = (
    Rotation(SCENE.replace(gravity=0.0), 1000.0, 10.0, SHORT), Rotation(SCENE, 1000.0, 0.1, 63_000_000)
)
ENERGY = "bounded by (omega0 h)^p where the method conserves, else drifting by n (omega0 h)^(p+1), even powers only"
BACK = "rms of the energy after n steps there and n back, compensated: no faster than sqrt(n)"
BROUWER = "Brouwer 1937, Astron. J. 46, 149; Hairer, McLachlan & Razakarivony 2008, BIT 48, 231"

CASES = (
    _case("1e5 steps, energy", "What a step loses is lost a hundred thousand times.", ENERGY,
          partial(_energy, SHORT), f"{HLW}, IX.8 and XI.3", _known(partial(_energy_drift, SHORT))),
    _case("1e5 steps, phase", "Energy may be right while the motion is elsewhere on its orbit.",
          "Jacobi's functions, to n (omega0 h)^(p+1) and the drift of the frequency with the energy", _phase,
          f"{HLW}, X.3; Whittaker & Watson 1927, 44", _known(_phase_error)),
    _case("1e5 steps, 1.6e5 free turns", "Turns have to be counted while the angle keeps its digits.",
          "theta = theta0 + v t without gravity, to the rounding of v t", FREE.attempt, "Newton's first law",
          _known(FREE.error), FREE.scene),
    _case("1e8 steps, energy", "Rounding adds up as well as the method's own error.", ENERGY, partial(_energy, LONG),
          f"{HLW}, IX.8 and XI.3", _known(partial(_energy_drift, LONG)), long=True),
    _case("a million turns under gravity", "Turns have to be counted while gravity changes the speed in each.",
          "Jacobi's functions, to the rounding of the angle turned", ROUND.attempt, "Whittaker & Watson 1927, 44",
          _known(ROUND.error), long=True),
    _case("1e5 steps there and back, compensated", "Rounding alone is left, and must walk, not march.", BACK,
          partial(_rounded, 32, SHORT), BROUWER, lambda m: frozenset({ACCURATE if retraces(m) else STABLE}), long=True),
)
