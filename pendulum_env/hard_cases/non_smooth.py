"""Hard cases: torques with kinks and jumps, where a bob stops, sticks and lets go."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from integrators import Method
from pendulum_env.hard_cases.case import (
    ACCURATE,
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
from pendulum_env.hard_cases.dry_friction import (
    EARTH,
    EDGE,
    EDGED,
    HAIR,
    LIMIT,
    LINEAR_REST,
    RISING,
    ROUNDING,
    STEEP_REST,
    STEP,
    a_hair,
    coarse_rest,
    linear_rest,
    never_moves,
    rests_coarsely,
    rising,
    steep_rest,
    unit,
)
from pendulum_env.physics.effects import (
    CoulombFriction,
    Gravity,
    HorizontalDrive,
    PeriodicTorque,
    QuadraticDrag,
    SmallAngleGravity,
    VerticalDrive,
)
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.own_error import left
from pendulum_env.truth.piecewise import Force, path

Array = NDArray[np.float64]
GROUP = "non-smooth"


def _against(scene: Scene, force: Force, limit: float, start: float, h: float, steps: int, every: int, rate: float,
             cap: int = 100) -> Try:
    """Compared with :mod:`piecewise`; ``rate`` is the motion's [rad/s], ``cap`` the order that kinks leave."""

    @lru_cache(maxsize=1)
    def truth() -> tuple[Array, Array]:
        angle, velocity = path(force, limit, (start, 0.0), [h * k for k in range(every, steps + 1, every)])
        return np.append(start, angle), np.append(0.0, velocity)

    def attempt(method: Method) -> Finding:
        run = ran(scene, method, dt=h, steps=steps, every=every, angle=start, velocity=0.0)
        ended = stopped(run)
        if ended is not None:
            return ended
        angle, velocity = truth()
        size, phase = float(np.max(np.abs(angle))), rate * h
        allowed = size * max(left(method, phase, phase * steps), phase**cap * phase * steps) + ROUNDING
        error = np.maximum(np.abs(run.angle - angle), np.abs(run.velocity - velocity) / rate)
        lost = not np.max(np.abs(run.angle)) <= 2.0 * size or (limit > 0.0 and velocity[-1] == 0.0 and run.velocity[-1])
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
