"""Hard cases: very many steps, in which truncation and rounding errors accumulate.

Errors of a method of order p over n steps with z = omega0 h (Hairer, Lubich & Wanner 2006, Geometric Numerical
Integration, I.1, IX.8, X.3, XI.3; rounding: Brouwer 1937, Astron. J. 46, 149)::

    energy of symplectic and symmetric methods    at most z**p, and not growing
    energy of other methods                       n z**(p+1) for odd p, n z**(p+2) for even p: reversible terms of
                                                  the modified equation do not change the energy
    phase                                         n z z**p, plus n z d/2 for a relative energy drift d
"""

from __future__ import annotations

import math
from collections.abc import Callable
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
    Bound,
    Case,
    Finding,
    Try,
    also,
    bounded,
    demand,
    follows,
    foreseen,
    graded,
    known,
    ran,
    run_of,
    then,
)
from pendulum_env.hard_cases.predicted import Motion
from pendulum_env.physics import exact
from pendulum_env.physics.presets import SCENES
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.bounds import UNIT, error_constant, retraces, rounding, rounding_factor

GROUP = "long runs"
SCENE = SCENES["vacuum"]
PRODUCT = 0.05
"""omega0 h of all runs."""
SHORT, LONG = 100_000, 100_000_000
"""Numbers of steps of short and long runs."""
MOST_WORK = 1e9
"""Maximum number of force evaluations of a long run, about 10 s; expensive methods take fewer than LONG steps."""
POLE = 2.2
"""Distance in imaginary time from the bottom to a pole of the motion from 1 rad, K'(sin 1/2) [1/omega0]."""
SMALL = 0.1
"""Largest error for which the bound from a method's order is meaningful."""
FAST = 1000.0
"""Velocity of fast rotations [rad/s], which start at 0.3 rad."""
COUNTED = 0.5
"""Largest error [rad] with which turns count as counted."""
CEILING = "the order bounds the growth of a large error from above only"


def steps_for(method: Method, steps: int, most: float = MOST_WORK) -> int:
    """Return the number of steps for a method in a long run.

    It is ``steps``, or fewer if the method would need more than ``most`` force evaluations for them.
    """
    return int(min(steps, most / (method.evaluations * (NEWTON if method.implicit else 1.0))))


def conserving(method: Method) -> bool:
    """Return True if a method's energy error does not grow, except by rounding.

    This holds for symplectic and symmetric methods.
    """
    return method.symplectic or method.symmetric


def weight(method: Method, power: int) -> float:
    """Return the factor by which a method's error may exceed z**power, at least 1.

    Errors of the sub-steps of a composition add up, and error constants of multistep methods do not decrease as 1/n!
    while the derivatives of the motion grow as n!/POLE**n.
    """
    return max(1.0, 2.0 * error_constant(method) * math.factorial(method.order + 1) / POLE**power)


def drift(method: Method, steps: float) -> float:
    """Return a bound of the relative change of the energy that a method's order allows in a number of steps."""
    rest = rounding(method) * steps * PRODUCT
    if math.isinf(method.order):
        return rest
    if conserving(method):
        return float(weight(method, method.order) * PRODUCT**method.order) + rest
    power = 2 * (method.order // 2) + 2
    return float(steps * weight(method, power) * PRODUCT**power) + rest


def _run(method: Method, steps: int) -> Rollout:
    """Run a method from rest at 1 rad for a number of steps and return the run.

    About 3000 states are recorded, with an odd stride, so that all phases of the swing are sampled.
    """
    return ran(SCENE, method, dt=PRODUCT / SCENE.omega0, steps=steps, every=max(1, steps // 3000) | 1, angle=1.0,
               velocity=0.0)


FIRST = Motion("1e5 steps, phase", SCENE, "pendulum", 1.0, 0.0, 20.0, marks=20, growth=20.0, most=64)
"""The first three swings of the short runs, in longer steps, whose error is predicted."""


def _energy(wanted: int, method: Method) -> Finding:
    """Judge a method by the drift of its energy over ``wanted`` steps, or as many of them as it can take."""
    steps = steps_for(method, wanted)
    run = _run(method, steps)
    size = np.abs(run.energy_residual) / run.energy[0]
    allowed, tenth = drift(method, steps), len(size) // 10
    early, late = float(np.max(size[:tenth])), float(np.max(size[-tenth:]))
    note = "" if steps == wanted else f"only {steps:.2g} steps, because they are expensive"
    more = 0.01 * early + rounding(method) * steps * PRODUCT
    demand(not conserving(method) or late <= early + more,
           "the energy's error grows although the method conserves", late, early)
    if allowed > SMALL:
        gain, most = float(np.max(run.energy)) / run.energy[0] - 1.0, math.expm1(min(allowed, 100.0))
        return bounded(gain, most, note or "its allowed drift is not small", CEILING)
    found = graded(size, allowed, "the energy drifts faster than the order allows", note, of="the energy")
    return also(found, Bound("the energy, by growth of its error", more, 1.0)) if conserving(method) else found


def _phase_error(method: Method) -> float:
    """Return a bound of a method's angle error after SHORT steps [rad], including the effect of an energy drift."""
    turned = SHORT * PRODUCT
    lost = 0.0 if conserving(method) else 0.5 * drift(method, SHORT)
    order = 0.0 if method.exact else float(weight(method, method.order) * PRODUCT**method.order)
    return turned * (order + lost) + float(4.0 * rounding(method) * PRODUCT * turned**1.5)


def _phase(method: Method) -> Finding:
    """Judge a method by its angle over SHORT steps against Jacobi's elliptic functions (the exact solution)."""
    run = _run(method, SHORT)
    allowed = _phase_error(method)
    if allowed > SMALL:
        largest, most = float(np.max(np.abs(run.angle))), 1.1 * math.exp(min(drift(method, SHORT), 100.0))
        return bounded(largest, most, "its allowed phase error is not small", CEILING)
    truth, _ = exact.pendulum(run.time, 1.0, 0.0, SCENE.omega0)
    return graded(run.angle - truth, allowed, "its phase is off by more than the order allows")


def _rounded(starts: int, steps: int, method: Method) -> Finding:
    """Judge a method by its rounding errors: an ensemble of motions runs forwards and back with compensated sums.

    A symmetric method retraces its steps, so the rms change of the energy at the end is rounding. With compensated sums
    it comes from the increments, is smaller by about z, and has a random sign, so it grows as sqrt(steps). The change
    after ``steps`` is compared with that after ``steps/100``.
    """
    if not retraces(method):
        return Finding(STABLE, note="it does not retrace its steps, so rounding cannot be separated from its error")
    angles = np.random.default_rng(7).uniform(0.2, 2.8, starts)
    changes = []
    for count in (steps // 100, steps):
        go = partial(run_of, SCENE, method, dt=PRODUCT / SCENE.omega0, steps=count, every=count, compensated=True,
                     backend="auto")
        try:
            there = go(angle=angles, velocity=np.zeros(starts))
        except MethodError as error:
            return Finding(STABLE, note=str(error))
        back = go(angle=there.angle[:, -1], velocity=-there.velocity[:, -1])
        change = (back.energy[:, -1] - there.energy[:, 0]) / there.energy[:, 0]
        changes.append(float(np.sqrt(np.mean(change * change))))
    allowed = 4.0 * UNIT * rounding_factor(method) * (1.0 + PRODUCT * math.sqrt(2.0 * steps))
    ratio = changes[1] / max(changes[0], UNIT)
    # The expected ratio is sqrt(100).
    growth = Bound("growth in 100 times as many steps", 10.0, 10.0,
                   "the rms over 32 motions scatters by 12 %, so that the ratio of two is within a factor of 2")
    wrong = "it grows faster than the square root of the number of steps" if ratio > 20.0 else ""
    return also(graded(changes[1], allowed, wrong, f"{ratio:.2g} times in 100 times as many steps", of="the energy"),
                growth)


def turning_error(scene: Scene, each: float, steps: int, method: Method) -> float:
    """Return a bound of a method's angle error [rad] in a fast rotation, in steps of the angle ``each`` [rad].

    Gravity changes the speed by the fraction (omega0/speed)**2.
    """
    count, kick = steps_for(method, steps), (scene.omega0 / FAST) ** 2
    order = 0.0 if method.exact else float(each**method.order)
    lost = count * float(each ** (2 * (method.order // 2) + 2)) if order and not conserving(method) else 0.0
    return count * each * (rounding(method) + kick * (order + lost))


def _turned(scene: Scene, each: float, steps: int, method: Method) -> Finding:
    """Judge a method's fast rotation by the number of turns and by the final angle.

    The angle is measured from the nearer of bottom and top.
    """
    h, count = each / FAST, steps_for(method, steps)
    machine = Machine(scene, method, ())
    state = machine.state(0.3, FAST)
    if machine.advance(state, 0.0, h, count):
        return Finding(DIVERGED, stop_time=float(state[INDEX]) * h)
    turns, angle, allowed = float(state[TURNS]), float(state[ANGLE]), turning_error(scene, each, steps, method)
    demand(turns % 0.5 == 0.0 and abs(angle) <= 0.5 * math.pi * (1.0 + 1e-12),
           "turns is not a multiple of 0.5, or the angle is not wrapped", turns)
    wanted = exact.pendulum(count * h, 0.3, FAST, scene.omega0)[0] if scene.gravity else 0.3 + FAST * (count * h)
    error = abs((turns - float(wanted) / TWO_PI) * TWO_PI + angle)
    if allowed > COUNTED:
        return Finding(STABLE, error, allowed, "its allowed phase error is not small",
                       bounds=(Bound("a turn", allowed, TWO_PI, "the order says nothing of the phase"),))
    return graded(error, allowed, "its number of turns is wrong", f"{turns:.7g} turns", size=TWO_PI, of="a turn")


def _first_and(second: Try, bound: Callable[[Method], float], name: str, why: str, truth: str, source: str,
               long: bool = False) -> Case:
    """Return the case of a property after many steps, which is judged if the first swings err as predicted.

    A method must be ACCURATE if the ``bound`` of its error is at most SMALL; else STABLE or DIVERGED are allowed.
    """
    return foreseen(GROUP, FIRST, why, truth, source, partial(then, partial(follows, FIRST), second),
                    known(bound, SMALL, STABLE, DIVERGED), long, name)


def _energies(steps: int, name: str, why: str) -> Case:
    """Return the case of the energy after a number of steps."""
    return _first_and(
        partial(_energy, steps), lambda method: drift(method, steps_for(method, steps)), name, why,
        "error at most (omega0 h)^p for symplectic and symmetric methods, else n (omega0 h)^(p+1), even powers only; "
        "the error of the first swings is that of the formula",
        "Hairer, Lubich & Wanner 2006, Geometric Numerical Integration, IX.8 and XI.3", steps > SHORT)


def _turning(name: str, why: str, truth: str, source: str, scene: Scene, each: float, steps: int) -> Case:
    """Return the case of a fast rotation, whose angle must be right after many turns."""
    bound = partial(turning_error, scene, each, steps)
    return Case(name, GROUP, why, truth, source, scene, known(bound, COUNTED, STABLE, DIVERGED),
                partial(_turned, scene, each, steps), steps > SHORT)


CASES = (
    _energies(SHORT, "1e5 steps, energy", "The energy error of a step is repeated 100 000 times."),
    _first_and(_phase, _phase_error, FIRST.name, "The energy may be right while the phase of the motion is wrong.",
               "Jacobi's functions, to n (omega0 h)^(p+1) and the drift of the frequency with the energy; the error of "
               "the first swings is that of the formula",
               "Hairer, Lubich & Wanner 2006, Geometric Numerical Integration, X.3; Whittaker & Watson 1927, 44"),
    _turning("1e5 steps, 1.6e5 free turns",
             "The angle must not lose digits while the turns of a fast rotation are counted.",
             "theta = theta0 + v t without gravity, to the rounding of v t", "Newton's first law",
             SCENE.replace(gravity=0.0), 10.0, SHORT),
    _energies(LONG, "1e8 steps, energy", "Rounding errors accumulate as well as the method's own error."),
    _turning("a million turns under gravity",
             "A method can lose count of the turns of a fast rotation, as gravity changes the speed within each turn.",
             "Jacobi's elliptic functions, to the rounding of the angle", "Whittaker & Watson 1927, 44",
             SCENE, 0.1, 63_000_000),
    Case("1e5 steps there and back, compensated", GROUP,
         "With compensated sums only random rounding errors may remain, none that add up with one sign.",
         "rms energy change after n steps forwards and n back, with compensated sums: grows no faster than sqrt(n)",
         "Brouwer 1937, Astron. J. 46, 149; Hairer, McLachlan & Razakarivony 2008, BIT 48, 231", SCENE,
         lambda method: frozenset({ACCURATE if retraces(method) else STABLE}), partial(_rounded, 32, SHORT), True),
)
