"""Hard cases: torques with kinks and jumps, from quadratic drag and from dry friction, in which a bob sticks."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from integrators import Method, MethodError
from integrators.analysis import spectral_radius
from pendulum_env.engine.rollout import Rollout
from pendulum_env.hard_cases.case import (
    ACCURATE,
    DIVERGED,
    STABLE,
    WRONG,
    Case,
    Finding,
    Rule,
    Try,
    always,
    judged,
    ran,
    resolved,
    stopped,
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
    omega0, turns = LINEAR_REST.omega0, HALVES + 1
    run = ran(LINEAR_REST, method, dt=STEP / omega0, steps=round(turns * math.pi / STEP), angle=AMPLITUDE, velocity=0.0)
    angle, speed = dry_swing(omega0 * run.time)
    distance = sum(2.0 * (AMPLITUDE - 2.0 * RATIO * k - RATIO) for k in range(HALVES))
    heat = run.ledger.heat[-1] / (RATIO * EARTH) - distance
    error = max(np.max(np.abs(run.angle - angle)), np.max(np.abs(run.velocity / omega0 - speed)),
                abs(heat) / (2 * HALVES))
    allowed = AMPLITUDE * order_bound(method, STEP, HALVES * math.pi) + ROUNDING
    return judged(run, error, allowed, rested(run, 0.99 * run.time[-1]) or "its motion, rest or heat is wrong")


COARSE = 0.5
"""omega0 h of swings to rest that are barely resolved."""
FIRST = (AMPLITUDE - 2.0 * RATIO) / AMPLITUDE
"""Factor by which friction reduces the amplitude in the first half swing."""


def coarse_rest(method: Method) -> Finding:
    """Judge a method in coarse steps by the angle at which dry friction stops a small swing.

    The run lasts ten times as many half swings as necessary.
    """
    steps = round(10 * HALVES * math.pi / COARSE)
    run = ran(LINEAR_REST, method, dt=COARSE / LINEAR_REST.omega0, steps=steps, angle=AMPLITUDE, velocity=0.0)
    rest, _ = dry_swing(np.array([math.inf]))
    beyond = "" if abs(run.angle[-1]) <= RATIO else "it rests at an angle where dry friction cannot hold it"
    return judged(run, run.angle[-1] - rest, AMPLITUDE * order_bound(method, COARSE, HALVES * math.pi),
                  rested(run, 0.9 * run.time[-1]) or beyond)


def rests_coarsely(method: Method) -> frozenset[str]:
    """Return the outcomes allowed for a method in coarse steps under dry friction: ACCURATE and STABLE.

    DIVERGED is also allowed if the method's growth in half a swing exceeds the loss by friction.
    """
    try:
        grows = spectral_radius(method, COARSE) ** (math.pi / COARSE) * FIRST > 1.0
    except MethodError:
        grows = False
    return frozenset({ACCURATE, STABLE, DIVERGED} if grows else {ACCURATE, STABLE})


STEEP_RATIO, STEEP_START = 0.11, 1.5
STEEP_REST = unit("dry friction", Gravity(), CoulombFriction(STEEP_RATIO * EARTH))


def steep_rest(method: Method) -> Finding:
    """Judge a method on a large swing to rest under dry friction, by its turning points and its angle at rest.

    Successive turning angles t0 and -t1 obey cos t1 - cos t0 = ratio (t0 + t1); the last one is the angle at rest.
    """
    omega0, turns = STEEP_REST.omega0, exact.coulomb_turning_points(STEEP_START, STEEP_RATIO, 100)
    time = 1.15 * math.pi * len(turns) / omega0  # the period of 1.5 rad is 15 % longer than that of small swings
    run = ran(STEEP_REST, method, dt=STEP / omega0, steps=round(omega0 * time / STEP), angle=STEEP_START, velocity=0.0)
    swings = np.count_nonzero(np.diff(np.sign(run.velocity[run.velocity != 0.0])))
    wrong = rested(run, 0.97 * time) or "it rests at another angle"
    wrong = wrong if swings == len(turns) - 2 else f"it turns {swings} times instead of {len(turns) - 2}"
    error = run.angle[-1] - turns[-1] if swings == len(turns) - 2 else math.inf
    return judged(run, error, STEEP_START * order_bound(method, STEP, omega0 * time) + ROUNDING, wrong)


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
    step = 0.01
    run = ran(EDGED, method, dt=step / EDGED.omega0, steps=480, angle=EDGE * (1.0 + HAIR), velocity=0.0)
    phase, size = np.minimum(EDGED.omega0 * run.time, math.pi), EDGE * HAIR
    error = (run.angle - EDGE) / size - np.cos(phase)
    wrong = rested(run, 1.1 * math.pi / EDGED.omega0) or "it slides by a wrong distance"
    return judged(run, error, order_bound(method, step, math.pi) + 1e-6, wrong)


# --- breakaway under a rising torque --------------------------------------------------------------------------------

LIMIT, PUSH, SLOW = 0.8, 1.0, 0.02
"""Limit of dry friction and amplitude of the drive [N m], and angular frequency of the drive [rad/s]; omega0 = 1."""
LET_GO = math.asin(LIMIT / PUSH) / SLOW
"""Time at which PUSH sin(SLOW t) reaches LIMIT and the bob starts to slide [s]."""
RISING = unit("dry friction under a rising torque", SmallAngleGravity(),
                PeriodicTorque(PUSH, SLOW, -0.5 * math.pi), CoulombFriction(LIMIT), gravity=1.0)


def risen(time: Array) -> Array:
    """Return the exact angle of the oscillator under the torque PUSH sin(SLOW t), held by dry friction at first.

    The bob slides from rest at LET_GO [s] on, against the friction LIMIT.
    """
    since = np.maximum(time - LET_GO, 0.0)
    answer = PUSH / (1.0 - SLOW * SLOW)
    free = (LIMIT - answer * math.sin(SLOW * LET_GO)) * np.cos(since)
    free = free - answer * SLOW * math.cos(SLOW * LET_GO) * np.sin(since)
    return np.where(since > 0.0, answer * np.sin(SLOW * time) - LIMIT + free, 0.0)


def rising(method: Method) -> Finding:
    """Judge a method under a slowly rising torque on a bob held by dry friction.

    The bob must start to slide in the right step.
    """
    h, slope = 0.05, PUSH * SLOW * math.cos(SLOW * LET_GO)
    run = ran(RISING, method, dt=h, steps=math.ceil((LET_GO + 3.0) / h), angle=0.0, velocity=0.0)
    before, after = run.time <= LET_GO, run.time > LET_GO + h
    if np.any(run.velocity[before]) or np.any(run.angle[before]):
        return Finding(WRONG, note="the bob starts to slide too early")
    if not np.all(run.velocity[after] > 0.0):
        return Finding(WRONG, note="the bob starts to slide too late")
    return judged(run, run.angle - risen(run.time), slope * order_bound(method, h, 3.0) + ROUNDING,
                  "it slides differently")


# --- piece by piece --------------------------------------------------------------------------------------------------


def _against(scene: Scene, force: Force, limit: float, start: float, h: float, steps: int, every: int, rate: float,
             cap: int = 100) -> Try:
    """Return a function that judges a method under dry friction by an independent integration.

    That one integrates the hand-written ``force`` from one stop or turn to the next, see :mod:`piecewise`. States are
    compared after every ``every`` steps. ``limit`` is the limit of dry friction, ``start`` the initial angle
    [rad], ``rate`` the angular frequency of the motion [rad/s], and ``cap`` the highest order that kinks allow.
    """

    @lru_cache(maxsize=1)
    def truth() -> Truth:
        return path(force, limit, (start, 0.0), [h * k for k in range(0, steps + 1, every)])

    def attempt(method: Method) -> Finding:
        run = ran(scene, method, dt=h, steps=steps, every=every, angle=start, velocity=0.0)
        ended = stopped(run)
        if ended is not None:
            return ended
        true = truth()
        size, phase = float(np.max(np.abs(true.angle))), rate * h
        allowed = size * max(order_bound(method, phase, phase * steps), phase**cap * phase * steps) + ROUNDING
        error = np.maximum(np.abs(run.angle - true.angle), np.abs(run.velocity - true.velocity) / rate)
        creeps = limit > 0.0 and true.velocity[-1] == 0.0 and run.velocity[-1]
        lost = not np.max(np.abs(run.angle)) <= 2.0 * size or creeps
        return judged(run, error, allowed, "it is not this motion at all" if lost else "")

    return attempt


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


FALL = math.sqrt(EARTH)
"""Angular frequency of a pendulum of 1 m on Earth [rad/s]."""
PIECES = "scipy's DOP853 at 3e-14 from one zero of the velocity to the next (Hairer, Norsett & Wanner 1993, II.5-6)"
WAY = "the tolerance is (rate h)^p rate t of the largest angle, with the method's order p"
STUCK = "Coulomb 1785: at rest, friction balances all other torques up to its limit"
TableRow = tuple[str, str, str, str, Scene, Rule, Callable[[Method], Finding]]
ALWAYS = always(ACCURATE)

_TABLE: tuple[TableRow, ...] = (
    ("Coulomb friction to rest, small angles",
     "The torque jumps at each turning point, and after coming to rest the bob must never move again.",
     "cosines about -+0.08 rad, 0.16 rad smaller in each half swing of pi/omega0, heat in proportion to the distance, "
     "rest at 0.02 rad; the tolerance is (omega0 h)^p omega0 t", "Lapidus 1970, Am. J. Phys. 38, 1360", LINEAR_REST,
     ALWAYS, linear_rest),
    ("Coulomb friction to rest in coarse steps",
     "The zeros of the velocity must be located, although a step is as long as half a radian of the swing.",
     "permanent rest within 0.08 rad; accurate if the angle at rest is that of the cosines to (omega0 h)^p omega0 t, "
     "at most a tenth",
     "Lapidus 1970, Am. J. Phys. 38, 1360", LINEAR_REST, rests_coarsely, coarse_rest),
    ("Coulomb friction to rest, large angles",
     "The angle at rest follows from six successive turning points, so that their errors add up.",
     "the angle at rest, by cos t1 - cos t0 = ratio (t0 + t1) from one turning angle to the next, their number, and "
     "permanent rest", "energy integral; Simbach & Priest 2005, Am. J. Phys. 73, 1079", STEEP_REST, ALWAYS,
     steep_rest),
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
    ("a hair beyond the band",
     "Gravity exceeds the limit of dry friction by one part in 1e7, so that the bob must slide.",
     "half a cosine from 1e-8 rad beyond the edge to 1e-8 rad within, then permanent rest; the tolerance is "
     "(omega0 h)^p pi of this distance", "Lapidus 1970, Am. J. Phys. 38, 1360", EDGED, ALWAYS, a_hair),
    ("a slowly rising torque", "Dry friction must hold the bob for 46 s and let it slide from the right step on.",
     "no bit changes until arcsin(0.8)/0.02 s, then the driven oscillator; the tolerance is (omega0 h)^p omega0 t of "
     "the slope of the torque", "the driven oscillator in closed form (Landau & Lifshitz 1976, section 22)", RISING,
     ALWAYS, rising),
    ("sticking and sliding by turns", "13 stops and starts at times that are not known in advance.",
     f"piecewise integration; {WAY}", PIECES, TURNS, resolved,
     _against(TURNS, turns_force, LIMIT, 0.0, 0.02, 1000, 20, RATE)),
    ("let go by a shaken pivot", "Whether dry friction holds the bob depends on both time and angle.",
     f"piecewise integration; {WAY}", PIECES, SHAKEN, resolved,
     _against(SHAKEN, shaken_force, LIMIT, 0.3, 0.02, 600, 20, RATE)),
    ("quadratic drag to rest in dry friction",
     "Friction jumps and drag has a kink at each zero of the velocity, where methods of high order lose accuracy.",
     f"piecewise integration; {WAY}", PIECES, BOTH, resolved,
     _against(BOTH, swing_force, WITH_BOTH * EARTH, 1.5, STEP / FALL, 2800, 40, FALL)),
    ("dry friction, quadratic drag and a torque",
     "The torque has jumps and kinks in time, and the bob sticks and slides in turn.",
     f"piecewise integration; {WAY}", PIECES, MANY, resolved,
     _against(MANY, many_force, LIMIT, 0.0, 0.02, 1000, 20, RATE)),
    ("the kinks of quadratic drag",
     "The second derivative of the torque jumps at each zero of the velocity, within a step.",
     f"piecewise integration; {WAY}, p at most 3: each kink adds an error of c A² (omega0 h)³", PIECES, KINK, resolved,
     _against(KINK, swing_force, 0.0, 1.5, 0.02 / FALL, 800, 20, FALL, 3)),
)

CASES = tuple(Case(name, GROUP, why, truth, source, scene, may, attempt)
              for name, why, truth, source, scene, may, attempt in _TABLE)
KNOWN: dict[tuple[str, str], str] = {}
"""(case, method) -> reason of a known failure."""
