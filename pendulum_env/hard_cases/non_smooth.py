"""Hard cases: torques with kinks and jumps, from quadratic drag and from dry friction, in which a bob sticks."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators import Method, MethodError
from integrators.analysis import spectral_radius
from pendulum_env.engine.rollout import Rollout
from pendulum_env.hard_cases.case import (
    ACCURATE,
    LOOSE,
    STABLE,
    WRONG,
    Case,
    Finding,
    Rule,
    Try,
    always,
    every,
    graded,
    judged,
    ran,
    resolved,
    stopped,
)
from pendulum_env.hard_cases.predicted import (
    Motion,
    allowed,
    expected,
    followed,
    foretold,
    formula_first,
    held,
    ran_motion,
    unmet,
)
from pendulum_env.physics import exact
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import (
    CoulombFriction,
    Effect,
    Gravity,
    HorizontalDrive,
    PeriodicTorque,
    QuadraticDrag,
    SmallAngleGravity,
    VerticalDrive,
)
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.answer import Truth
from pendulum_env.truth.piecewise import Force, path
from pendulum_env.truth.steps import order_bound

Array = NDArray[np.float64]
GROUP = "non-smooth"
UNIT = Body(length=1.0, mass=1.0)
STEP = 0.01
"""Step of the swings to rest, times omega0."""
ROUNDING = 1e-12
"""Error allowed for rounding [rad]."""
EARTH = 9.81
"""Gravity [m/s²]."""


def unit(name: str, *effects: Effect, gravity: float = EARTH) -> Scene:
    """Return a scene with a bob of 1 kg at 1 m, in which torques equal angular accelerations."""
    return Scene(name, UNIT, effects=effects, gravity=gravity)


# --- swings to rest -------------------------------------------------------------------------------------------------


def rested(run: Rollout, since: float) -> str:
    """Return the fault of a run whose bob should be at rest from ``since`` [s] on; "" if it is at rest."""
    late = run.time >= since
    if not np.any(late):
        return ""
    if np.any(run.velocity[late]):
        return "it does not come to rest"
    return "it creeps at rest" if np.ptp(run.angle[late]) else ""


RATIO, AMPLITUDE, HALVES = 0.08, 0.66, 4
"""Friction torque over m g L, initial angle [rad], and half swings until rest at 0.66 - 2 * 0.08 * 4 = 0.02 rad."""
HALF_LEAST = 2.0 * (AMPLITUDE - 2.0 * RATIO * (HALVES - 1) - RATIO)
"""Way of the last half swing [rad], the shortest one."""
LINEAR_REST = unit("small angles with dry friction", SmallAngleGravity(), CoulombFriction(RATIO * EARTH))


def dry_swing(phase: Array) -> tuple[Array, Array]:
    """Return the exact angle and velocity/omega0 of a small swing under dry friction, at the phases omega0 t.

    The swing starts at AMPLITUDE. Half swing k is a cosine about (-1)^k RATIO; it lasts pi/omega0 and reduces the
    amplitude by 2 RATIO.
    """
    half = np.minimum(np.floor(phase / math.pi), HALVES)
    moving, size = half < HALVES, AMPLITUDE - 2.0 * RATIO * half
    side = 1.0 - 2.0 * (half % 2)
    within = np.where(moving, phase, 0.0) - math.pi * half
    angle = side * (RATIO + (size - RATIO) * np.cos(within))
    speed = -side * (size - RATIO) * np.sin(within)
    return np.where(moving, angle, side * size), np.where(moving, speed, 0.0)


def linear_rest(method: Method) -> Finding:
    """Judge a method on a small swing to rest under dry friction: its motion, its rest and its heat.

    The heat is RATIO m g L times the distance travelled [rad].
    """
    omega0, motion = LINEAR_REST.omega0, MOTIONS[SMALL_REST]
    run = ran_motion(LINEAR_REST, SMALL_REST, motion, method)
    ended = stopped(run)
    if ended is not None:
        return ended
    angle, speed = dry_swing(omega0 * run.time)
    distance = sum(2.0 * (AMPLITUDE - 2.0 * RATIO * k - RATIO) for k in range(HALVES))
    heat = run.ledger.heat[-1] / (RATIO * EARTH) - distance
    error = np.maximum(np.abs(run.angle - angle), np.abs(run.velocity / omega0 - speed)) / motion.largest
    wrong = rested(run, 0.99 * run.time[-1])
    if wrong:
        return Finding(WRONG, note=wrong)
    # A half swing has two ends, whose errors may be half as large again as those at the marks. The last half swing is
    # 0.2 rad of 2.72 rad, so that no method may be allowed that much.
    most = min(3.0 * HALVES * allowed(SMALL_REST, motion, method) + ROUNDING, 0.25 * HALF_LEAST)
    of_heat = graded(heat, most, "its heat is not friction times the distance", size=distance, of="the way in the heat")
    return every(of_heat, held(SMALL_REST, motion, method, error))


COARSE = 0.5
"""omega0 h of swings to rest that are barely resolved."""
FIRST = (AMPLITUDE - 2.0 * RATIO) / AMPLITUDE
"""Factor by which friction reduces the amplitude in the first half swing."""


def coarse_rest(method: Method) -> Finding:
    """Judge a method in coarse steps on a small swing to rest under dry friction: its motion, and where it rests.

    The run lasts ten times as many half swings as necessary.
    """
    motion = MOTIONS[COARSE_REST]
    run = ran_motion(LINEAR_REST, COARSE_REST, motion, method)
    ended = stopped(run)
    if ended is not None:
        return ended
    angle, speed = dry_swing(LINEAR_REST.omega0 * run.time)
    error = np.maximum(np.abs(run.angle - angle), np.abs(run.velocity / LINEAR_REST.omega0 - speed)) / motion.largest
    wrong = "" if abs(run.angle[-1]) <= RATIO else "it rests at an angle where dry friction cannot hold it"
    wrong = rested(run, 0.9 * run.time[-1]) or wrong
    if wrong and not grows_in_coarse_steps(method):
        return Finding(WRONG, note=wrong)
    if foretold(COARSE_REST, method):
        return held(COARSE_REST, motion, method, error)
    return graded(error[-1], AMPLITUDE * order_bound(method, COARSE, HALVES * math.pi), size=AMPLITUDE,
                  of="the angle at rest, as a part of the amplitude")


def rests_coarsely(method: Method) -> frozenset[str]:
    """Return the outcomes allowed for a method in coarse steps under dry friction: those of its predicted error.

    Splittings, whose error is not predicted, may rest at another angle.
    """
    named = expected(COARSE_REST, MOTIONS[COARSE_REST])(method)
    return named if foretold(COARSE_REST, method) else named | {ACCURATE, STABLE}


def grows_in_coarse_steps(method: Method) -> bool:
    """Return True if a method's growth in half a swing of coarse steps exceeds the loss by dry friction."""
    try:
        return bool(spectral_radius(method, COARSE) ** (math.pi / COARSE) * FIRST > 1.0)
    except MethodError:
        return False


STEEP_RATIO, STEEP_START = 0.11, 1.5
STEEP_REST = unit("dry friction", Gravity(), CoulombFriction(STEEP_RATIO * EARTH))


def steep_rest(method: Method) -> Finding:
    """Judge a method on a large swing to rest under dry friction, by its motion, turning points and angle at rest.

    Successive turning angles t0 and -t1 obey cos t1 - cos t0 = ratio (t0 + t1); the last one is the angle at rest.
    """
    turns, motion = exact.coulomb_turning_points(STEEP_START, STEEP_RATIO, 100), MOTIONS[LARGE_REST]
    run = ran_motion(STEEP_REST, LARGE_REST, motion, method)
    finding = _piecewise(LARGE_REST, STEEP_REST, steep_force, STEEP_RATIO * EARTH)(method)
    wrong = rested(run, 0.97 * float(run.time[-1]))
    if stopped(run) is not None or finding.outcome == WRONG:
        return finding
    if wrong:
        return Finding(WRONG, note=wrong)
    most = min(STEEP_START * allowed(LARGE_REST, motion, method) + ROUNDING, LOOSE * STEEP_RATIO)
    return every(graded(run.angle[-1] - turns[-1], most, "it rests at another angle", size=STEEP_RATIO,
                        of="the angle of rest, as a part of the band of friction"), finding)


# --- within the band of dry friction, and just beyond its edge ------------------------------------------------------


def never_moves(scene: Scene, angle: float, h: float, steps: int) -> Try:
    """Return a function that judges a method on a bob that dry friction holds at rest.

    No bit of angle, heat, work or energy residual may change.
    """

    def attempt(method: Method) -> Finding:
        run = ran(scene, method, dt=h, steps=steps, angle=angle, velocity=0.0)
        moved = float(np.ptp(run.angle)) + float(np.max(np.abs(run.velocity)))
        energies = max(np.max(np.abs(run.ledger.heat)), np.max(np.abs(run.ledger.work)))
        return judged(run, max(moved, energies, np.max(np.abs(run.energy_residual))), 0.0,
                      "it moves although dry friction holds it")

    return attempt


HAIR, EDGE = 1e-7, 0.1
"""Relative distance of a start from the edge of the band in which dry friction holds the bob, and the edge [rad]."""
EDGED = unit("small angles on the band's edge", SmallAngleGravity(), CoulombFriction(EDGE * EARTH))


def a_hair(method: Method) -> Finding:
    """Judge a method whose bob starts just beyond the band of angles in which dry friction holds it.

    From EDGE (1 + HAIR) the bob must slide by 2 EDGE HAIR, half a swing about EDGE, and stay there.
    """
    run = ran_motion(EDGED, A_HAIR, MOTIONS[A_HAIR], method)
    ended = stopped(run)
    if ended is not None:
        return ended
    phase, size = np.minimum(EDGED.omega0 * run.time, math.pi), EDGE * HAIR
    error = np.maximum(np.abs((run.angle - EDGE) / size - np.cos(phase)),
                       np.abs(run.velocity / EDGED.omega0 / size + np.sin(phase)))
    wrong = rested(run, 1.1 * math.pi / EDGED.omega0)
    # In each step the angle is rounded to 1e-9 of the way.
    return Finding(WRONG, note=wrong) if wrong else held(A_HAIR, MOTIONS[A_HAIR], method, error, 1e-7)


# --- breakaway under a rising torque --------------------------------------------------------------------------------

LIMIT, PUSH, SLOW = 0.8, 1.0, 0.02
"""Limit of dry friction and amplitude of the drive [N m], and angular frequency of the drive [rad/s]; omega0 = 1."""
LET_GO = math.asin(LIMIT / PUSH) / SLOW
"""Time at which PUSH sin(SLOW t) reaches LIMIT and the bob starts to slide [s]."""
RISING = unit("dry friction under a rising torque", SmallAngleGravity(),
                PeriodicTorque(PUSH, SLOW, -0.5 * math.pi), CoulombFriction(LIMIT), gravity=1.0)


def risen(time: Array) -> tuple[Array, Array]:
    """Return the exact motion of the oscillator under the torque PUSH sin(SLOW t), held by dry friction at first.

    The bob slides from rest at LET_GO [s] on, against the friction LIMIT.
    """
    since = np.maximum(time - LET_GO, 0.0)
    answer = PUSH / (1.0 - SLOW * SLOW)
    even, odd = LIMIT - answer * math.sin(SLOW * LET_GO), -answer * SLOW * math.cos(SLOW * LET_GO)
    angle = answer * np.sin(SLOW * time) - LIMIT + even * np.cos(since) + odd * np.sin(since)
    velocity = answer * SLOW * np.cos(SLOW * time) - even * np.sin(since) + odd * np.cos(since)
    return np.where(since > 0.0, angle, 0.0), np.where(since > 0.0, velocity, 0.0)


def rising(method: Method) -> Finding:
    """Judge a method under a slowly rising torque on a bob held by dry friction.

    The bob must start to slide in the right step.
    """
    motion = MOTIONS[RISES]
    run = ran_motion(RISING, RISES, motion, method)
    ended = stopped(run)
    if ended is not None:
        return ended
    before, after = run.time <= LET_GO, run.time > LET_GO + run.dt
    if np.any(run.velocity[before]) or np.any(run.angle[before]):
        return Finding(WRONG, note="the bob starts to slide too early")
    if not np.all(run.velocity[after] > 0.0):
        return Finding(WRONG, note="the bob starts to slide too late")
    error = np.abs(np.stack([run.angle, run.velocity]) - np.stack(risen(run.time))) / motion.largest
    return held(RISES, motion, method, error, ROUNDING / motion.largest)


# --- piece by piece --------------------------------------------------------------------------------------------------


def _piecewise(name: str, scene: Scene, force: Force, limit: float) -> Try:
    """Return a function that judges a method under dry friction by an independent integration.

    That one integrates the hand-written ``force`` from one stop or turn to the next, see :mod:`piecewise`. ``limit`` is
    the limit of dry friction.
    """
    motion = MOTIONS[name]

    def attempt(method: Method) -> Finding:
        run = ran_motion(scene, name, motion, method)
        ended = stopped(run)
        if ended is not None:
            return ended
        true = traced(force, limit, motion, scene.omega0)
        if limit > 0.0 and true.velocity[-1] == 0.0 and run.velocity[-1]:
            return Finding(WRONG, note="it moves although dry friction holds it")
        speed = np.abs(run.velocity - true.velocity) / scene.omega0 / motion.pace
        return held(name, motion, method, np.maximum(np.abs(run.angle - true.angle), speed) / motion.largest)

    return attempt


@lru_cache(maxsize=16)
def traced(force: Force, limit: float, motion: Motion, omega0: float) -> Truth:
    """Return the reference solution of a motion at its marks."""
    gap = motion.time / motion.marks / omega0
    return path(force, limit, (motion.angle, motion.velocity * omega0), [gap * k for k in range(motion.marks + 1)])


DRAG, WITH_BOTH = 0.3, 0.05
"""Quadratic drag [1/rad], and dry friction over m g L."""
BOTH = unit("dry friction and quadratic drag", Gravity(), QuadraticDrag(c=DRAG), CoulombFriction(WITH_BOTH * EARTH))
KINK = unit("quadratic drag", Gravity(), QuadraticDrag(c=DRAG))
TORQUE, RATE, WEAK = 1.2, 1.3, 0.2
"""Drive torque [N m], its angular frequency [rad/s], and drag [1/rad], with omega0 = 1."""
TURNS = unit("dry friction under a torque", SmallAngleGravity(), PeriodicTorque(TORQUE, RATE), CoulombFriction(LIMIT),
               gravity=1.0)
MANY = unit("dry friction, quadratic drag and a torque", Gravity(), QuadraticDrag(c=WEAK),
              PeriodicTorque(TORQUE, RATE), CoulombFriction(LIMIT), gravity=1.0)
SHAKEN = unit("dry friction on a shaken pivot", Gravity(), HorizontalDrive(TORQUE / RATE**2, RATE, -0.5 * math.pi),
                CoulombFriction(LIMIT), gravity=1.0)
HELD_ACROSS = unit("dry friction holding a pivot shaken to and fro", HorizontalDrive(0.799 / 9.0, 3.0),
                     CoulombFriction(LIMIT), gravity=1.0)
HELD_UP = unit("dry friction holding a pivot shaken up and down", Gravity(), VerticalDrive(0.399 / 9.0, 3.0),
                 CoulombFriction(LIMIT), gravity=1.0)
LAUNCH = math.sqrt(3.5)
"""Velocity at the bottom over omega0: the wire goes slack at 120 degrees."""
WIRE = Scene("a wire", Body(length=1.0, mass=1.0, suspension="wire"), effects=(Gravity(),), gravity=EARTH)
HELD = unit("dry friction holding", Gravity(), CoulombFriction(0.5 * EARTH))


def swing_force(t: float, q: float, v: float) -> float:
    """Return the acceleration of a pendulum under gravity and quadratic drag."""
    return -EARTH * math.sin(q) - DRAG * abs(v) * v


def turns_force(t: float, q: float, v: float) -> float:
    """Return the acceleration of a small-angle pendulum under a periodic torque."""
    return TORQUE * math.cos(RATE * t) - q


def many_force(t: float, q: float, v: float) -> float:
    """Return the acceleration of a pendulum under gravity, quadratic drag and a periodic torque."""
    return TORQUE * math.cos(RATE * t) - math.sin(q) - WEAK * abs(v) * v


def shaken_force(t: float, q: float, v: float) -> float:
    """Return the acceleration of a pendulum whose pivot moves as x = b sin(RATE t), under gravity.

    The pivot's acceleration, with the opposite sign, acts along cos(theta).
    """
    return TORQUE * math.sin(RATE * t) * math.cos(q) - math.sin(q)


SMALL_REST, LARGE_REST = "Coulomb friction to rest, small angles", "Coulomb friction to rest, large angles"
BY_TURNS, SHAKEN_LOOSE = "sticking and sliding by turns", "let go by a shaken pivot"
TO_REST, ALL_THREE = "quadratic drag to rest in dry friction", "dry friction, quadratic drag and a torque"
KINKS = "the kinks of quadratic drag"
COARSE_REST, A_HAIR = "Coulomb friction to rest in coarse steps", "a hair beyond the band"
RISES, CATCHES = "a slowly rising torque", "a wire that catches again"


def _motion(equation: str, start: float, time: float, marks: int, scene: Scene, pace: float = 1.0) -> Motion:
    """Return a motion from rest at an angle.

    Splittings, whose flows contain dry friction, are judged by their order, and so are methods with mean forces on a
    shaken pivot, whose push they take in the middle of a step.
    """
    needs = unmet(scene) | (frozenset({"split"}) if scene is not KINK else frozenset())
    needs |= frozenset({"mean"}) if scene is SHAKEN else frozenset()
    return Motion(equation, start, 0.0, time, marks=marks, growth=10.0, largest=max(start, 1.0), pace=pace, most=64,
                  lacks=needs)


MOTIONS = {
    SMALL_REST: replace(
        _motion("linear, dry friction of 0.08", AMPLITUDE, (HALVES + 1) * math.pi, 25, LINEAR_REST), most=1024),
    LARGE_REST: replace(
        _motion("dry friction of 0.11", STEEP_START, 7.0 * 1.15 * math.pi, 40, STEEP_REST), most=1024),
    BY_TURNS: _motion("linear, dry friction, a torque", 0.0, 20.0, 50, TURNS, RATE),
    SHAKEN_LOOSE: _motion("dry friction, a shaken pivot", 0.3, 12.0, 30, SHAKEN, RATE),
    TO_REST: _motion("quadratic drag of 0.3, dry friction", 1.5, 28.0, 70, BOTH),
    ALL_THREE: _motion("quadratic drag of 0.2, dry friction, a torque", 0.0, 20.0, 50, MANY, RATE),
    KINKS: _motion("quadratic drag of 0.3", 1.5, 16.0, 40, KINK),
    COARSE_REST: replace(
        _motion("linear, dry friction of 0.08", AMPLITUDE, COARSE * 250, 250, LINEAR_REST), most=1),
    A_HAIR: replace(_motion("linear, dry friction of 0.1", EDGE * (1.0 + HAIR), 4.8, 3, EDGED), growth=1.0,
                    largest=EDGE * HAIR, goal=1e-4),
    RISES: replace(_motion("linear, dry friction, a slowly rising torque", 0.0, LET_GO + 3.0, 60, RISING),
                   largest=3.0 * PUSH * SLOW * math.cos(SLOW * LET_GO)),
    CATCHES: Motion("pendulum", 0.0, LAUNCH, 1.4, marks=2, growth=10.0, pace=LAUNCH, most=512,
                    lacks=unmet(WIRE)),
}
"""Motions with predicted errors."""


def steep_force(t: float, q: float, v: float) -> float:
    """Return the acceleration of a pendulum under gravity."""
    return -EARTH * math.sin(q)


def _swinging(time: Array) -> tuple[Any, Any]:
    """Return the exact angle and velocity of the bob on a wire before it goes slack."""
    return exact.pendulum(time, 0.0, LAUNCH * WIRE.omega0, WIRE.omega0)


def _slack(method: Method) -> Finding:
    """Judge a method by the time at which a wire goes slack, and by what the run says of its end."""
    from scipy.special import ellipkinc

    omega0, finer = WIRE.omega0, 16 if method.order == 1 else 1
    h = 0.01 / finer
    run = ran(WIRE, method, dt=h / omega0, steps=400 * finer, angle=0.0, velocity=LAUNCH * omega0)
    if run.stop_reason != "slack":
        return Finding(WRONG, note=f"the run ends by {run.stop_reason!r}, not by a slack wire")
    modulus = 0.5 * LAUNCH
    true = float(ellipkinc(math.asin(math.sin(math.pi / 3.0) / modulus), modulus * modulus))
    caught = 4.0 * math.sqrt(0.5 * EARTH) * math.sin(2.0 * math.pi / 3.0) / EARTH
    error = omega0 * float(run.stop_time) - true
    tolerance = 10.0 * order_bound(method, h, true) + ROUNDING
    if run.flight is None:
        return Finding(WRONG, note=f"it says: {run.ending}")
    return every(graded(error, tolerance, "the wire goes slack at another time", size=true, of="the time of slackness"),
                 graded(run.flight.time / caught - 1.0, 10.0 * tolerance, f"it says: {run.ending}",
                        of="the time of flight"))


PIECES = "scipy's DOP853 at 3e-14 from one zero of the velocity to the next (Hairer, Norsett & Wanner 1993, II.5-6)"
STUCK = "Coulomb 1785: at rest, friction balances all other torques up to its limit"
TableRow = tuple[str, str, str, str, Scene, Rule, Callable[[Method], Finding]]
ALWAYS = always(ACCURATE)

_TABLE: tuple[TableRow, ...] = (
    (SMALL_REST,
     "The torque jumps at each turning point, and after coming to rest the bob must never move again.",
     "cosines about -+0.08 rad, 0.16 rad smaller in each half swing of pi/omega0, heat in proportion to the distance, "
     "rest at 0.02 rad; the error is that of the method's formula", "Lapidus 1970, Am. J. Phys. 38, 1360", LINEAR_REST,
     expected(SMALL_REST, MOTIONS[SMALL_REST]), linear_rest),
    (COARSE_REST,
     "The zeros of the velocity must be located, although a step is as long as half a radian of the swing.",
     "permanent rest within 0.08 rad, unless the method grows faster than friction slows; the error is that of the "
     "method's formula", "Lapidus 1970, Am. J. Phys. 38, 1360", LINEAR_REST,
     rests_coarsely, coarse_rest),
    (LARGE_REST,
     "The angle at rest follows from six successive turning points, so that their errors add up.",
     "the angle at rest, by cos t1 - cos t0 = ratio (t0 + t1) from one turning angle to the next, their number, and "
     "permanent rest", "energy integral; Simbach & Priest 2005, Am. J. Phys. 73, 1079", STEEP_REST,
     expected(LARGE_REST, MOTIONS[LARGE_REST]), steep_rest),
    ("within the band", "Rounding errors must not make a bob creep that dry friction holds at rest.",
     "no bit changes in 250 s", STUCK, HELD, ALWAYS,
     never_moves(HELD, 0.4, 0.05, 5000)),
    ("within the band, pivot shaken to and fro",
     "The torque on a bob at rest repeatedly comes within 0.2 % of the limit above which it slides.",
     "no bit changes in 1500 steps", STUCK, HELD_ACROSS, ALWAYS, never_moves(HELD_ACROSS, 0.0, 0.011, 1500)),
    ("within the band, pivot shaken up and down",
     "The torque on a bob at rest repeatedly comes within 0.2 % of the limit above which it slides.",
     "no bit changes in 1500 steps", STUCK, HELD_UP, ALWAYS, never_moves(HELD_UP, math.asin(0.8 / 1.4), 0.011, 1500)),
    ("a hair within the band",
     "Gravity is one part in 1e7 below the limit of dry friction, so that the bob must stay at rest.",
     "no bit changes in 300 steps", STUCK, EDGED, ALWAYS, never_moves(EDGED, EDGE * (1.0 - HAIR), 0.01, 300)),
    (A_HAIR,
     "Gravity exceeds the limit of dry friction by one part in 1e7, so that the bob must slide.",
     "half a cosine from 1e-8 rad beyond the edge to 1e-8 rad within, then permanent rest; the error is that of the "
     "method's formula", "Lapidus 1970, Am. J. Phys. 38, 1360", EDGED, expected(A_HAIR, MOTIONS[A_HAIR]), a_hair),
    (RISES, "Dry friction must hold the bob for 46 s and let it slide from the right step on.",
     "no bit changes until arcsin(0.8)/0.02 s, then the driven oscillator; the error is that of the method's formula",
     "the driven oscillator in closed form (Landau & Lifshitz 1976, section 22)", RISING,
     expected(RISES, MOTIONS[RISES]), rising),
    (BY_TURNS, "13 stops and starts at times that are not known in advance.",
     "piecewise integration; the error is that of the method's formula", PIECES, TURNS,
     expected(BY_TURNS, MOTIONS[BY_TURNS]),
     _piecewise(BY_TURNS, TURNS, turns_force, LIMIT)),
    (SHAKEN_LOOSE, "Whether dry friction holds the bob depends on both time and angle.",
     "piecewise integration; the error is that of the method's formula", PIECES, SHAKEN,
     expected(SHAKEN_LOOSE, MOTIONS[SHAKEN_LOOSE]), _piecewise(SHAKEN_LOOSE, SHAKEN, shaken_force, LIMIT)),
    (TO_REST,
     "Friction jumps and drag has a kink at each zero of the velocity, where methods of high order lose accuracy.",
     "piecewise integration; the error is that of the method's formula", PIECES, BOTH,
     expected(TO_REST, MOTIONS[TO_REST]),
     _piecewise(TO_REST, BOTH, swing_force, WITH_BOTH * EARTH)),
    (ALL_THREE,
     "The torque has jumps and kinks in time, and the bob sticks and slides in turn.",
     "piecewise integration; the error is that of the method's formula", PIECES, MANY,
     expected(ALL_THREE, MOTIONS[ALL_THREE]),
     _piecewise(ALL_THREE, MANY, many_force, LIMIT)),
    (CATCHES, "The wire goes slack within a step; the bob then flies, and the wire would catch it.",
     "the run ends when 3 cos(theta) = 2 - v0²/(g L), by the elliptic integral, and says that the wire would catch the "
     "bob after 4 v_z/g, to (omega0 h)^p omega0 t; before that, the error is that of the method's formula",
     "Newton's law for the tension; a parabola within a circle", WIRE, resolved,
     formula_first(followed(WIRE, CATCHES, MOTIONS[CATCHES], _swinging), _slack)),
    (KINKS,
     "The second derivative of the torque jumps at each zero of the velocity, within a step.",
     "piecewise integration; the error is that of the method's formula", PIECES, KINK, expected(KINKS, MOTIONS[KINKS]),
     _piecewise(KINKS, KINK, swing_force, 0.0)),
)

CASES = tuple(Case(name, GROUP, why, truth, source, scene, may, attempt, motion=name if name in MOTIONS else "")
              for name, why, truth, source, scene, may, attempt in _TABLE)
KNOWN: dict[tuple[str, str], str] = {}
"""(case, method) -> reason of a known failure."""
