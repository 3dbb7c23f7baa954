"""Hard cases: torques with kinks and jumps, from quadratic drag and from dry friction, in which a bob sticks."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np

from integrators import Method, MethodError
from integrators.analysis import spectral_radius
from pendulum_env.engine.rollout import Rollout
from pendulum_env.hard_cases.case import (
    ACCURATE,
    EARTH,
    LOOSE,
    STABLE,
    WRONG,
    Case,
    Finding,
    always,
    demand,
    every,
    expected,
    followed,
    follows,
    foreseen,
    graded,
    let_go_at,
    ran,
    ran_motion,
    resolved,
    run_of,
    then,
    unit,
)
from pendulum_env.hard_cases.predicted import Motion
from pendulum_env.physics import exact
from pendulum_env.physics.body import Body
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
from pendulum_env.truth.bounds import order_bound

GROUP = "non-smooth"
ROUNDING = 1e-12
"""Error allowed for rounding [rad]."""


def _motion(name: str, scene: Scene, equation: str, start: float, time: float, marks: int, **settings: Any) -> Motion:
    """Return a motion from rest at an angle; by default splittings are judged by their order.

    Their flows contain dry friction.
    """
    usual: dict[str, Any] = {"growth": 10.0, "largest": max(start, 1.0), "most": 64, "lacks": frozenset({"split"})}
    return Motion(name, scene, equation, start, 0.0, time, marks, **(usual | settings))


# --- swings to rest -------------------------------------------------------------------------------------------------


def at_rest(share: float, run: Rollout) -> None:
    """Demand that the bob of a run is at rest after this share of its time."""
    late = run.time >= share * run.time[-1]
    demand(not np.any(run.velocity[late]), "it does not come to rest")
    demand(not np.ptp(run.angle[late]), "it creeps at rest")


RATIO, AMPLITUDE, HALVES = 0.08, 0.66, 4
"""Friction torque over m g L, initial angle [rad], and half swings until rest at 0.66 - 2 * 0.08 * 4 = 0.02 rad."""
WAYS = [2.0 * (AMPLITUDE - 2.0 * RATIO * k - RATIO) for k in range(HALVES)]
"""Way of each half swing [rad]; the last one is the shortest."""
LINEAR_REST = unit("small angles with dry friction", SmallAngleGravity(), CoulombFriction(RATIO * EARTH))
SMALL_REST = _motion("Coulomb friction to rest, small angles", LINEAR_REST, "linear, dry friction of 0.08", AMPLITUDE,
                     (HALVES + 1) * math.pi, 25, most=1024)


def linear_rest(method: Method) -> Finding:
    """Judge a method on a small swing to rest under dry friction: its motion, its rest and its heat.

    The heat is RATIO m g L times the distance travelled [rad].
    """
    run = ran_motion(SMALL_REST, method)
    at_rest(0.99, run)
    # A half swing has two ends, whose errors may be half as large again as those at the marks. The last half swing is
    # 0.2 rad of 2.72 rad, so that no method may be allowed that much.
    most = min(3.0 * HALVES * SMALL_REST.allowed(method) + ROUNDING, 0.25 * WAYS[-1])
    heat = graded(run.ledger.heat[-1] / (RATIO * EARTH) - sum(WAYS), most,
                  "its heat is not friction times the distance", size=sum(WAYS), of="the way in the heat")
    return every(heat, followed(SMALL_REST, method, run.angle, run.velocity))


COARSE = 0.5
"""omega0 h of swings to rest that are barely resolved; the run lasts ten times as many half swings as necessary."""
COARSE_REST = _motion("Coulomb friction to rest in coarse steps", LINEAR_REST, "linear, dry friction of 0.08",
                      AMPLITUDE, COARSE * 250, 250, most=1)


def coarse_rest(method: Method) -> Finding:
    """Judge a method in coarse steps on a small swing to rest under dry friction: its motion, and where it rests."""
    run = ran_motion(COARSE_REST, method)
    if not grows_in_coarse_steps(method):
        at_rest(0.9, run)
        demand(abs(run.angle[-1]) <= RATIO, "it rests at an angle where dry friction cannot hold it")
    if COARSE_REST.foretells(method):
        return followed(COARSE_REST, method, run.angle, run.velocity)
    off = run.angle[-1] - COARSE_REST.true()[0][-1], run.velocity[-1] / LINEAR_REST.omega0
    return graded(off, AMPLITUDE * order_bound(method, COARSE, HALVES * math.pi), size=AMPLITUDE,
                  of="the angle at rest, as a part of the amplitude")


def rests_coarsely(method: Method) -> frozenset[str]:
    """Return the outcomes allowed for a method in coarse steps under dry friction: those of its predicted error.

    Splittings, whose error is not predicted, may rest at another angle.
    """
    named = expected(COARSE_REST, method)
    return named if COARSE_REST.foretells(method) else named | {ACCURATE, STABLE}


def grows_in_coarse_steps(method: Method) -> bool:
    """Return True if a method's growth in half a swing of coarse steps exceeds the loss by dry friction."""
    try:
        return bool(spectral_radius(method, COARSE) ** (math.pi / COARSE) * (1.0 - 2.0 * RATIO / AMPLITUDE) > 1.0)
    except MethodError:
        return False


STEEP_RATIO, STEEP_START = 0.11, 1.5
STEEP_REST = unit("dry friction", Gravity(), CoulombFriction(STEEP_RATIO * EARTH))
LARGE_REST = _motion("Coulomb friction to rest, large angles", STEEP_REST, "dry friction of 0.11", STEEP_START,
                     7.0 * 1.15 * math.pi, 40, most=1024)


def steep_rest(method: Method) -> Finding:
    """Judge a method on a large swing to rest under dry friction, by its motion, turning points and angle at rest.

    Successive turning angles t0 and -t1 obey cos t1 - cos t0 = ratio (t0 + t1); the last one is the angle at rest.
    """
    found, run = follows(LARGE_REST, method, partial(stays, LARGE_REST)), ran_motion(LARGE_REST, method)
    at_rest(0.97, run)
    most = min(STEEP_START * LARGE_REST.allowed(method) + ROUNDING, LOOSE * STEEP_RATIO)
    end = exact.coulomb_turning_points(STEEP_START, STEEP_RATIO, 100)[-1]
    return every(graded(run.angle[-1] - end, most, "it rests at another angle", size=STEEP_RATIO,
                        of="the angle of rest, as a part of the band of friction"), found)


# --- within the band of dry friction, and just beyond its edge ------------------------------------------------------


def never_moves(name: str, why: str, scene: Scene, angle: float, h: float, steps: int, during: str) -> Case:
    """Return the case of a bob that dry friction holds at rest: no bit of angle, heat, work or residual may change."""

    def attempt(method: Method) -> Finding:
        run = ran(scene, method, dt=h, steps=steps, angle=angle, velocity=0.0)
        moved = float(np.ptp(run.angle)) + float(np.max(np.abs(run.velocity)))
        energies = max(np.max(np.abs(run.ledger.heat)), np.max(np.abs(run.ledger.work)))
        return graded(max(moved, energies, np.max(np.abs(run.energy_residual))), 0.0,
                      "it moves although dry friction holds it")

    return Case(name, GROUP, why, f"no bit changes in {during}",
                "Coulomb 1785: at rest, friction balances all other torques up to its limit", scene, always(ACCURATE),
                attempt)


HAIR, EDGE = 1e-7, 0.1
"""Relative distance of a start from the edge of the band in which dry friction holds the bob, and the edge [rad]."""
EDGED = unit("small angles on the band's edge", SmallAngleGravity(), CoulombFriction(EDGE * EARTH))
A_HAIR = _motion("a hair beyond the band", EDGED, "linear, dry friction of 0.1", EDGE * (1.0 + HAIR), 4.8, 3,
                 growth=1.0, largest=EDGE * HAIR, goal=1e-4)


# --- breakaway under a rising torque --------------------------------------------------------------------------------

LIMIT, PUSH, SLOW = 0.8, 1.0, 0.02
"""Limit of dry friction and amplitude of the drive [N m], and angular frequency of the drive [rad/s]; omega0 = 1."""
LET_GO = math.asin(LIMIT / PUSH) / SLOW
"""Time at which PUSH sin(SLOW t) reaches LIMIT and the bob starts to slide [s]."""
RISING = unit("dry friction under a rising torque", SmallAngleGravity(), PeriodicTorque(PUSH, SLOW, -0.5 * math.pi),
              CoulombFriction(LIMIT), gravity=1.0)
RISES = _motion("a slowly rising torque", RISING, "linear, dry friction, a slowly rising torque", 0.0, LET_GO + 3.0,
                60, largest=3.0 * PUSH * SLOW * math.cos(SLOW * LET_GO))


# --- piece by piece --------------------------------------------------------------------------------------------------

DRAG, WITH_BOTH = 0.3, 0.05
"""Quadratic drag [1/rad], and dry friction over m g L."""
TORQUE, RATE, WEAK = 1.2, 1.3, 0.2
"""Drive torque [N m], its angular frequency [rad/s], and drag [1/rad], with omega0 = 1."""


def stays(motion: Motion, run: Rollout) -> None:
    """Demand that the bob of a run is at rest at the end if it is so in the true motion."""
    demand(motion.true()[1][-1] or not run.velocity[-1], "it moves although dry friction holds it")


def _pieces(why: str, motion: Motion) -> Case:
    """Return the case of a motion that is integrated from one zero of the velocity to the next."""
    return foreseen(GROUP, motion, why, "piecewise integration; the error is that of the method's formula",
                    "Taylor series in 40 digits from one zero of the velocity to the next, and scipy's DOP853 (Hairer, "
                    "Norsett & Wanner 1993, II.5-6)", partial(follows, motion, fault=partial(stays, motion)))


# --- a wire that goes slack -----------------------------------------------------------------------------------------

LAUNCH = math.sqrt(3.5)
"""Velocity at the bottom over omega0: the wire goes slack at 120 degrees."""
WIRE = Scene("a wire", Body(length=1.0, mass=1.0, suspension="wire"), effects=(Gravity(),), gravity=EARTH)
CATCHES = Motion("a wire that catches again", WIRE, "pendulum", 0.0, LAUNCH, 1.4, marks=2, growth=10.0, pace=LAUNCH)


def _slack(method: Method) -> Finding:
    """Judge a method by the time at which a wire goes slack, and by what the run says of its end."""
    from scipy.special import ellipkinc

    omega0, finer = WIRE.omega0, 16 if method.order == 1 else 1
    h, modulus = 0.01 / finer, 0.5 * LAUNCH
    run = run_of(WIRE, method, dt=h / omega0, steps=400 * finer, angle=0.0, velocity=LAUNCH * omega0)
    demand(run.stop_reason == "slack", f"the run ends by {run.stop_reason!r}, not by a slack wire")
    true = float(ellipkinc(math.asin(math.sin(math.pi / 3.0) / modulus), modulus * modulus))
    caught = 4.0 * math.sqrt(0.5 * EARTH) * math.sin(2.0 * math.pi / 3.0) / EARTH
    tolerance = 10.0 * order_bound(method, h, true) + ROUNDING
    if run.flight is None:
        return Finding(WRONG, note=f"it says: {run.ending}")
    return every(graded(omega0 * float(run.stop_time) - true, tolerance, "the wire goes slack at another time",
                        size=true, of="the time of slackness"),
                 graded(run.flight.time / caught - 1.0, 10.0 * tolerance, f"it says: {run.ending}",
                        of="the time of flight"))


# --- the cases ------------------------------------------------------------------------------------------------------

LAPIDUS = "Lapidus 1970, Am. J. Phys. 38, 1360"
TO_AND_FRO = "The torque on a bob at rest repeatedly comes within 0.2 % of the limit above which it slides."
FRICTION = CoulombFriction(LIMIT)

CASES = (
    foreseen(GROUP, SMALL_REST,
             "The torque jumps at each turning point, and after coming to rest the bob must never move again.",
             "cosines about -+0.08 rad, 0.16 rad smaller in each half swing of pi/omega0, heat in proportion to the "
             "distance, rest at 0.02 rad; the error is that of the method's formula", LAPIDUS, linear_rest),
    foreseen(GROUP, COARSE_REST,
             "The zeros of the velocity must be located, although a step is as long as half a radian of the swing.",
             "permanent rest within 0.08 rad, unless the method grows faster than friction slows; the error is that of "
             "the method's formula", LAPIDUS, coarse_rest, rests_coarsely),
    foreseen(GROUP, LARGE_REST,
             "The angle at rest follows from six successive turning points, so that their errors add up.",
             "the angle at rest, by cos t1 - cos t0 = ratio (t0 + t1) from one turning angle to the next, their "
             "number, and permanent rest", "energy integral; Simbach & Priest 2005, Am. J. Phys. 73, 1079",
             steep_rest),
    never_moves("within the band", "Rounding errors must not make a bob creep that dry friction holds at rest.",
                unit("dry friction holding", Gravity(), CoulombFriction(0.5 * EARTH)), 0.4, 0.05, 5000, "250 s"),
    never_moves("within the band, pivot shaken to and fro", TO_AND_FRO,
                unit("dry friction holding a pivot shaken to and fro", HorizontalDrive(0.799 / 9.0, 3.0), FRICTION,
                     gravity=1.0), 0.0, 0.011, 1500, "1500 steps"),
    never_moves("within the band, pivot shaken up and down", TO_AND_FRO,
                unit("dry friction holding a pivot shaken up and down", Gravity(), VerticalDrive(0.399 / 9.0, 3.0),
                     FRICTION, gravity=1.0), math.asin(0.8 / 1.4), 0.011, 1500, "1500 steps"),
    never_moves("a hair within the band",
                "Gravity is one part in 1e7 below the limit of dry friction, so that the bob must stay at rest.",
                EDGED, EDGE * (1.0 - HAIR), 0.01, 300, "300 steps"),
    foreseen(GROUP, A_HAIR,
             "Gravity exceeds the limit of dry friction by one part in 1e7, so that the bob must slide.",
             "half a cosine from 1e-8 rad beyond the edge to 1e-8 rad within, then permanent rest; the error is that "
             "of the method's formula", LAPIDUS,
             # In each step the angle is rounded to 1e-9 of the way.
             partial(follows, A_HAIR, fault=partial(at_rest, 1.1 * math.pi / 4.8), grain=1e-7)),
    foreseen(GROUP, RISES, "Dry friction must hold the bob for 46 s and let it slide from the right step on.",
             "no bit changes until arcsin(0.8)/0.02 s, then the driven oscillator; the error is that of the method's "
             "formula", "the driven oscillator in closed form (Landau & Lifshitz 1976, section 22)",
             partial(follows, RISES, fault=partial(let_go_at, LET_GO), grain=ROUNDING / RISES.largest)),
    _pieces("13 stops and starts at times that are not known in advance.",
            _motion("sticking and sliding by turns", unit("dry friction under a torque", SmallAngleGravity(),
                                                          PeriodicTorque(TORQUE, RATE), FRICTION, gravity=1.0),
                    "linear, dry friction, a torque", 0.0, 20.0, 50, pace=RATE)),
    # Methods with mean forces take the push of the pivot in the middle of a step.
    _pieces("Whether dry friction holds the bob depends on both time and angle.",
            _motion("let go by a shaken pivot", unit("dry friction on a shaken pivot", Gravity(),
                                                     HorizontalDrive(TORQUE / RATE**2, RATE, -0.5 * math.pi),
                                                     FRICTION, gravity=1.0),
                    "dry friction, a shaken pivot", 0.3, 12.0, 30, pace=RATE, lacks=frozenset({"split", "mean"}))),
    _pieces("Friction jumps and drag has a kink at each zero of the velocity, where methods of high order lose "
            "accuracy.",
            _motion("quadratic drag to rest in dry friction", unit("dry friction and quadratic drag", Gravity(),
                                                                   QuadraticDrag(c=DRAG),
                                                                   CoulombFriction(WITH_BOTH * EARTH)),
                    "quadratic drag of 0.3, dry friction", 1.5, 28.0, 70)),
    _pieces("The torque has jumps and kinks in time, and the bob sticks and slides in turn.",
            _motion("dry friction, quadratic drag and a torque",
                    unit("dry friction, quadratic drag and a torque", Gravity(), QuadraticDrag(c=WEAK),
                         PeriodicTorque(TORQUE, RATE), FRICTION, gravity=1.0),
                    "quadratic drag of 0.2, dry friction, a torque", 0.0, 20.0, 50, pace=RATE)),
    foreseen(GROUP, CATCHES, "The wire goes slack within a step; the bob then flies, and the wire would catch it.",
             "the run ends when 3 cos(theta) = 2 - v0²/(g L), by the elliptic integral, and says that the wire would "
             "catch the bob after 4 v_z/g, to (omega0 h)^p omega0 t; before that, the error is that of the method's "
             "formula", "Newton's law for the tension; a parabola within a circle",
             partial(then, partial(follows, CATCHES), _slack), resolved),
    _pieces("The second derivative of the torque jumps at each zero of the velocity, within a step.",
            _motion("the kinks of quadratic drag", unit("quadratic drag", Gravity(), QuadraticDrag(c=DRAG)),
                    "quadratic drag of 0.3", 1.5, 16.0, 40, lacks=frozenset())),
)
