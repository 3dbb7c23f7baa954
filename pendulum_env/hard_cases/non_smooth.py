"""Hard cases: torques with kinks and jumps, where a bob stops, sticks and lets go."""

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
from pendulum_env.truth.steps import left

Array = NDArray[np.float64]
GROUP = "non-smooth"
UNIT = Body(length=1.0, mass=1.0)
STEP = 0.01
"""omega0 h of the swings to rest."""
ROUNDING = 1e-12
EARTH = 9.81


def unit(name: str, *effects: Effect, gravity: float = EARTH) -> Scene:
    """1 kg on 1 m, so that torques are per inertia."""
    return Scene(name, UNIT, effects=effects, gravity=gravity)


# --- swings to rest -------------------------------------------------------------------------------------------------


def rested(run: Rollout, since: float) -> str:
    """What is wrong with a rest that began at ``since`` [s] at the latest, or ""."""
    late = run.time >= since
    if not np.any(late):
        return ""
    if np.any(run.velocity[late]):
        return "it does not come to rest"
    return "it creeps at rest" if np.ptp(run.angle[late]) else ""


RATIO, AMPLITUDE, HALVES = 0.08, 0.66, 4
"""Friction torque over m g L, start [rad], half swings to the rest at 0.66 - 2 * 0.08 * 4 = 0.02 rad."""
LINEAR_REST = unit("small angles with dry friction", SmallAngleGravity(), CoulombFriction(RATIO * EARTH))


def dry_swing(phase: Array) -> tuple[Array, Array]:
    """Angle and velocity/omega0 at omega0 t from rest at AMPLITUDE: half swing k goes round (-1)^k RATIO by a cosine.

    Each takes the time pi/omega0 and 2 RATIO off the amplitude.
    """
    half = np.minimum(np.floor(phase / math.pi), HALVES)
    moving, size = half < HALVES, AMPLITUDE - 2.0 * RATIO * half
    side = 1.0 - 2.0 * (half % 2)
    within = np.where(moving, phase, 0.0) - math.pi * half
    angle = side * (RATIO + (size - RATIO) * np.cos(within))
    speed = -side * (size - RATIO) * np.sin(within)
    return np.where(moving, angle, side * size), np.where(moving, speed, 0.0)


def linear_rest(method: Method) -> Finding:
    """The whole path, the rest, and the heat: RATIO m g L times the way, which adds each half swing's two ends."""
    omega0, turns = LINEAR_REST.omega0, HALVES + 1
    run = ran(LINEAR_REST, method, dt=STEP / omega0, steps=round(turns * math.pi / STEP), angle=AMPLITUDE, velocity=0.0)
    angle, speed = dry_swing(omega0 * run.time)
    way = sum(2.0 * (AMPLITUDE - 2.0 * RATIO * k - RATIO) for k in range(HALVES))
    heat = run.ledger.heat[-1] / (RATIO * EARTH) - way
    error = max(np.max(np.abs(run.angle - angle)), np.max(np.abs(run.velocity / omega0 - speed)),
                abs(heat) / (2 * HALVES))
    allowed = AMPLITUDE * left(method, STEP, HALVES * math.pi) + ROUNDING
    return judged(run, error, allowed, rested(run, 0.99 * run.time[-1]) or "path, rest or heat is another")


COARSE = 0.5
"""omega0 h of swings to rest that are hardly resolved."""
FIRST = (AMPLITUDE - 2.0 * RATIO) / AMPLITUDE
"""What friction leaves of the amplitude in the first half swing."""


def coarse_rest(method: Method) -> Finding:
    """The rest alone, after ten times as many half swings as it takes."""
    steps = round(10 * HALVES * math.pi / COARSE)
    run = ran(LINEAR_REST, method, dt=COARSE / LINEAR_REST.omega0, steps=steps, angle=AMPLITUDE, velocity=0.0)
    rest, _ = dry_swing(np.array([math.inf]))
    beyond = "" if abs(run.angle[-1]) <= RATIO else "it rests beyond the band"
    return judged(run, run.angle[-1] - rest, AMPLITUDE * left(method, COARSE, HALVES * math.pi),
                  rested(run, 0.9 * run.time[-1]) or beyond)


def rests_coarsely(method: Method) -> frozenset[str]:
    """A method whose steps add more in half a swing than friction takes may also be lost, by name."""
    try:
        grows = spectral_radius(method, COARSE) ** (math.pi / COARSE) * FIRST > 1.0
    except MethodError:
        grows = False
    return frozenset({ACCURATE, STABLE, DIVERGED} if grows else {ACCURATE, STABLE})


STEEP_RATIO, STEEP_START = 0.11, 1.5
STEEP_REST = unit("dry friction", Gravity(), CoulombFriction(STEEP_RATIO * EARTH))


def steep_rest(method: Method) -> Finding:
    """cos t1 - cos t0 = ratio (t0 + t1) for successive turning angles t0 and -t1, the last of them the rest."""
    omega0, turns = STEEP_REST.omega0, exact.coulomb_turning_points(STEEP_START, STEEP_RATIO, 100)
    time = 1.15 * math.pi * len(turns) / omega0  # the period of 1.5 rad is 15 % longer than that of small swings
    run = ran(STEEP_REST, method, dt=STEP / omega0, steps=round(omega0 * time / STEP), angle=STEEP_START, velocity=0.0)
    swings = np.count_nonzero(np.diff(np.sign(run.velocity[run.velocity != 0.0])))
    wrong = rested(run, 0.97 * time) or "it rests elsewhere"
    wrong = wrong if swings == len(turns) - 2 else f"it turns {swings} times instead of {len(turns) - 2}"
    error = run.angle[-1] - turns[-1] if swings == len(turns) - 2 else math.inf
    return judged(run, error, STEEP_START * left(method, STEP, omega0 * time) + ROUNDING, wrong)


# --- within the band, and a hair beyond -----------------------------------------------------------------------------


def never_moves(scene: Scene, angle: float, h: float, steps: int) -> Try:
    """Not by a bit, without heat, work or residual."""

    def attempt(method: Method) -> Finding:
        run = ran(scene, method, dt=h, steps=steps, angle=angle, velocity=0.0)
        moved = float(np.ptp(run.angle)) + float(np.max(np.abs(run.velocity)))
        booked = max(np.max(np.abs(run.ledger.heat)), np.max(np.abs(run.ledger.work)))
        return judged(run, max(moved, booked, np.max(np.abs(run.energy_residual))), 0.0, "it moves within the band")

    return attempt


HAIR, EDGE = 1e-7, 0.1
"""Part of the band's edge [rad] by which a start is beyond it or within."""
EDGED = unit("small angles on the band's edge", SmallAngleGravity(), CoulombFriction(EDGE * EARTH))


def a_hair(method: Method) -> Finding:
    """From EDGE (1 + HAIR) it goes round EDGE once, by 2 EDGE HAIR, and stays."""
    step = 0.01
    run = ran(EDGED, method, dt=step / EDGED.omega0, steps=480, angle=EDGE * (1.0 + HAIR), velocity=0.0)
    phase, size = np.minimum(EDGED.omega0 * run.time, math.pi), EDGE * HAIR
    error = (run.angle - EDGE) / size - np.cos(phase)
    wrong = rested(run, 1.1 * math.pi / EDGED.omega0) or "it slides by another length"
    return judged(run, error, left(method, step, math.pi) + 1e-6, wrong)


# --- letting go -----------------------------------------------------------------------------------------------------

LIMIT, PUSH, SLOW = 0.8, 1.0, 0.02
"""Friction's limit and the drive's torque [N m], and the drive's rate while it rises [rad/s]; omega0 = 1."""
LET_GO = math.asin(LIMIT / PUSH) / SLOW
"""When PUSH sin(SLOW t) reaches LIMIT [s]."""
RISING = unit("dry friction under a rising torque", SmallAngleGravity(),
                PeriodicTorque(PUSH, SLOW, -0.5 * math.pi), CoulombFriction(LIMIT), gravity=1.0)


def risen(time: Array) -> Array:
    """Angle under PUSH sin(SLOW t) - LIMIT with omega0 = 1, from rest at LET_GO: the driven oscillator."""
    since = np.maximum(time - LET_GO, 0.0)
    answer = PUSH / (1.0 - SLOW * SLOW)
    free = (LIMIT - answer * math.sin(SLOW * LET_GO)) * np.cos(since)
    free = free - answer * SLOW * math.cos(SLOW * LET_GO) * np.sin(since)
    return np.where(since > 0.0, answer * np.sin(SLOW * time) - LIMIT + free, 0.0)


def rising(method: Method) -> Finding:
    h, slope = 0.05, PUSH * SLOW * math.cos(SLOW * LET_GO)
    run = ran(RISING, method, dt=h, steps=math.ceil((LET_GO + 3.0) / h), angle=0.0, velocity=0.0)
    before, after = run.time <= LET_GO, run.time > LET_GO + h
    if np.any(run.velocity[before]) or np.any(run.angle[before]):
        return Finding(WRONG, note="it lets go too early")
    if not np.all(run.velocity[after] > 0.0):
        return Finding(WRONG, note="it lets go too late")
    return judged(run, run.angle - risen(run.time), slope * left(method, h, 3.0) + ROUNDING, "it slides otherwise")


# --- piece by piece --------------------------------------------------------------------------------------------------


def _against(scene: Scene, force: Force, limit: float, start: float, h: float, steps: int, every: int, rate: float,
             cap: int = 100) -> Try:
    """Compared with :mod:`piecewise`; ``rate`` is the motion's [rad/s], ``cap`` the order that kinks leave."""

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
        allowed = size * max(left(method, phase, phase * steps), phase**cap * phase * steps) + ROUNDING
        error = np.maximum(np.abs(run.angle - true.angle), np.abs(run.velocity - true.velocity) / rate)
        creeps = limit > 0.0 and true.velocity[-1] == 0.0 and run.velocity[-1]
        lost = not np.max(np.abs(run.angle)) <= 2.0 * size or creeps
        return judged(run, error, allowed, "it is not the motion" if lost else "")

    return attempt


DRAG, WITH_BOTH = 0.3, 0.05
"""Quadratic drag [1/rad], dry friction over m g L."""
BOTH = unit("dry friction and quadratic drag", Gravity(), QuadraticDrag(c=DRAG), CoulombFriction(WITH_BOTH * EARTH))
KINK = unit("quadratic drag", Gravity(), QuadraticDrag(c=DRAG))
TORQUE, RATE, WEAK = 1.2, 1.3, 0.2
"""Drive [N m, rad/s] and drag [1/rad] with omega0 = 1."""
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
    return -EARTH * math.sin(q) - DRAG * abs(v) * v


def turns_force(t: float, q: float, v: float) -> float:
    return TORQUE * math.cos(RATE * t) - q


def many_force(t: float, q: float, v: float) -> float:
    return TORQUE * math.cos(RATE * t) - math.sin(q) - WEAK * abs(v) * v


def shaken_force(t: float, q: float, v: float) -> float:
    """The pivot is at x = b sin(RATE t), so that -x'' = b RATE² sin(RATE t) pulls the bob along cos(theta)."""
    return TORQUE * math.sin(RATE * t) * math.cos(q) - math.sin(q)


FALL = math.sqrt(EARTH)
"""omega0 of a length of 1 m [rad/s]."""
PIECES = "scipy's DOP853 at 3e-14 from one zero of the velocity to the next (Hairer, Norsett & Wanner 1993, II.5-6)"
WAY = "the method's order of the phase, (rate h)^p rate t of the largest angle"
STUCK = "Coulomb 1785: at rest the torque of friction is minus that of all others, up to its limit"
Entry = tuple[str, str, str, str, Scene, Rule, Callable[[Method], Finding]]
ALWAYS = always(ACCURATE)

_TABLE: tuple[Entry, ...] = (
    ("Coulomb friction to rest, small angles", "The torque jumps at each turning point, and a rest is for good.",
     "cosines about -+0.08 rad, 0.16 rad less in each half swing of pi/omega0, heat by the way, rest at 0.02 rad; "
     "allowed is (omega0 h)^p omega0 t", "Lapidus 1970, Am. J. Phys. 38, 1360", LINEAR_REST, ALWAYS, linear_rest),
    ("Coulomb friction to rest in coarse steps", "Each zero of the velocity is found within a step of half a radian.",
     "rest for good within 0.08 rad; accurate if it is where the cosines end, to (omega0 h)^p omega0 t, at most a "
     "tenth",
     "Lapidus 1970, Am. J. Phys. 38, 1360", LINEAR_REST, rests_coarsely, coarse_rest),
    ("Coulomb friction to rest, large angles", "Six turning points decide where it rests.",
     "the angle of rest, by cos t1 - cos t0 = ratio (t0 + t1) from one turning angle to the next, their number, and "
     "rest for good", "energy integral; Simbach & Priest 2005, Am. J. Phys. 73, 1079", STEEP_REST, ALWAYS, steep_rest),
    ("within the band", "Rounding must not let it creep.", "no bit changes in 250 s", STUCK, HELD, ALWAYS,
     never_moves(HELD, 0.4, 0.05, 5000)),
    ("within the band, pivot shaken to and fro", "The torque comes within 0.2 % of the limit, again and again.",
     "no bit changes in 1500 steps", STUCK, HELD_ACROSS, ALWAYS, never_moves(HELD_ACROSS, 0.0, 0.011, 1500)),
    ("within the band, pivot shaken up and down", "The torque comes within 0.2 % of the limit, again and again.",
     "no bit changes in 1500 steps", STUCK, HELD_UP, ALWAYS, never_moves(HELD_UP, math.asin(0.8 / 1.4), 0.011, 1500)),
    ("a hair within the band", "All torques cancel but for one part in 1e7.", "no bit changes in 300 steps", STUCK,
     EDGED, ALWAYS, never_moves(EDGED, EDGE * (1.0 - HAIR), 0.01, 300)),
    ("a hair beyond the band", "All torques cancel but for one part in 1e7, and it still has to slide.",
     "half a cosine from 1e-8 rad beyond the edge to 1e-8 rad within, then rest for good; allowed is (omega0 h)^p pi "
     "of that", "Lapidus 1970, Am. J. Phys. 38, 1360", EDGED, ALWAYS, a_hair),
    ("a slowly rising torque", "It must stick for 46 s, and let go within the right step.",
     "rest to the bit until arcsin(0.8)/0.02 s, then the driven oscillator; allowed is (omega0 h)^p omega0 t of the "
     "torque's slope", "the driven oscillator in closed form (Landau & Lifshitz 1976, section 22)", RISING, ALWAYS,
     rising),
    ("sticking and sliding by turns", "13 stops and starts at times that nobody knows before.",
     f"piecewise integration; {WAY}", PIECES, TURNS, resolved,
     _against(TURNS, turns_force, LIMIT, 0.0, 0.02, 1000, 20, RATE)),
    ("let go by a shaken pivot", "Whether it sticks depends on the time and on where it is.",
     f"piecewise integration; {WAY}", PIECES, SHAKEN, resolved,
     _against(SHAKEN, shaken_force, LIMIT, 0.3, 0.02, 600, 20, RATE)),
    ("quadratic drag to rest in dry friction", "A jump and a kink at each zero of the velocity.",
     f"piecewise integration; {WAY}", PIECES, BOTH, resolved,
     _against(BOTH, swing_force, WITH_BOTH * EARTH, 1.5, STEP / FALL, 2800, 40, FALL)),
    ("dry friction, quadratic drag and a torque", "A jump and a kink, and a torque that makes it stick and slide.",
     f"piecewise integration; {WAY}", PIECES, MANY, resolved,
     _against(MANY, many_force, LIMIT, 0.0, 0.02, 1000, 20, RATE)),
    ("the kinks of quadratic drag", "The second derivative jumps at each zero of the velocity, in midst of a step.",
     f"piecewise integration; {WAY}, p at most 3: each kink leaves c A² (omega0 h)³", PIECES, KINK, resolved,
     _against(KINK, swing_force, 0.0, 1.5, 0.02 / FALL, 800, 20, FALL, 3)),
)

CASES = tuple(Case(name, GROUP, why, truth, source, scene, may, attempt)
              for name, why, truth, source, scene, may, attempt in _TABLE)
KNOWN: dict[tuple[str, str], str] = {}
"""(case, method) -> why it fails."""
