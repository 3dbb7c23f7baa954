"""Hard cases: torques that change in every step, a wind that reverses, and dry friction that yields at one torque."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from integrators import Method
from pendulum_env.hard_cases import fast_drive
from pendulum_env.hard_cases.case import (
    EARTH,
    Case,
    Finding,
    demand,
    driven,
    followed,
    follows,
    foreseen,
    let_go_at,
    unit,
)
from pendulum_env.hard_cases.predicted import Motion
from pendulum_env.physics.effects import (
    CoulombFriction,
    Gravity,
    Gusts,
    LinearDrag,
    Motor,
    PeriodicTorque,
    QuadraticDrag,
    SmallAngleGravity,
)
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.answer import Array

GROUP = "switching"


# --- a torque that changes in every step ----------------------------------------------------------------------------

STRENGTH, DRAG = 2.0, 0.1
"""Largest torque over m g L, and coefficient of quadratic drag [1/rad]."""
PHASE, STEPS, START = 0.2, 60, 0.5
"""omega0 h, number of steps, and initial angle [rad]."""


def shares(count: int) -> Array:
    """Return controls of random size and sign, one per step."""
    return np.random.default_rng(3).uniform(-1.0, 1.0, count)


def _thrown(name: str, equation: str, *drags: QuadraticDrag) -> Case:
    """Return the case of a torque that has another size and sign in each step."""
    scene = unit("a motor of 2 m g L", Gravity(), *drags, Motor(max_torque=STRENGTH * EARTH))
    motion = Motion(f"a random torque in each step, {name}", scene, equation, START, 0.0, PHASE * STEPS, marks=STEPS,
                    growth=1e3, largest=10.0, pace=3.0, most=1, torques=tuple(STRENGTH * shares(STEPS)))
    return foreseen(GROUP, motion, "A torque of up to 2 m g L jumps at each step, so that forces of earlier steps say "
                    "nothing about the next.",
                    "numerical integration of each step; the error is that of the method's formula",
                    "Taylor series in 40 digits in each step, and scipy's DOP853 (Hairer, Norsett & Wanner 1993, II.5)")


# --- a wind that reverses -------------------------------------------------------------------------------------------

STORM, SEED, COUNT = 6.0, 11, 40
"""Standard deviation of the wind [m/s], seed, and number of control steps."""
REVERSES = fast_drive.in_wind(
    Scene("a wind that reverses", fast_drive.BODY, fast_drive.AIR, gravity=EARTH,
          effects=(Gravity(), QuadraticDrag(drag_coefficient=fast_drive.C_D), LinearDrag(gamma=fast_drive.LINEAR),
                   Gusts(gust_speed=STORM, gust_time=fast_drive.GUST_TIME))), COUNT)


# --- dry friction that yields at one torque -------------------------------------------------------------------------

LIMIT, SLOW = 0.8, 1e-6
"""Limit of dry friction [N m] and angular frequency of a torque of amplitude 1 N m [rad/s]; omega0 = 1/s."""
LET_GO, AFTER = 10.02, 5.0
"""Time at which the torque reaches the limit, and time to follow the bob after it [s]."""
PHASED = -math.acos(LIMIT) - SLOW * LET_GO
"""Phase of the torque, which is cos(SLOW t + PHASED) N m."""
YIELDS = Motion("a torque that takes 11 days to rise",
                unit("dry friction under a torque that takes 11 days to rise", SmallAngleGravity(),
                     PeriodicTorque(1.0, SLOW, PHASED), CoulombFriction(LIMIT), gravity=1.0),
                "a torque that takes 11 days to rise", 0.0, 0.0, LET_GO + AFTER, marks=10, largest=AFTER * SLOW,
                goal=1e-5, most=64, lacks=frozenset({"split"}))


GRAIN, HOLDS, SLIDES = 2.0**-20, 25, 5
"""Growth of the torque per mark over its limit of 0.5 N m, marks until the limit, and marks after it."""
TURN = 1.0
"""Time between two marks [s]; omega0 = 1/s."""
STAIRS = unit("dry friction under a torque that rises in steps", SmallAngleGravity(), Motor(max_torque=1.0),
              CoulombFriction(0.5), gravity=1.0)
EXCEEDS = Motion("a torque that exceeds dry friction by one part in 1e6", STAIRS,
                 "a torque that exceeds dry friction by one part in 1e6", 0.0, 0.0, TURN * (HOLDS + SLIDES),
                 marks=HOLDS + SLIDES, largest=SLIDES * GRAIN, goal=1e-5, most=64, lacks=frozenset({"split"}),
                 torques=tuple(0.5 + k * GRAIN for k in range(1 - HOLDS, SLIDES + 1)))


def _climbs(method: Method) -> Finding:
    """Judge a method by dry friction that holds the bob at exactly its limit, and yields one part in 2**20 above it."""
    angle, velocity = driven(EXCEEDS, method)
    demand(not (np.any(angle[: HOLDS + 1]) or np.any(velocity[: HOLDS + 1])),
           "the bob slides although the torque is not above the limit")
    demand(np.all(velocity[HOLDS + 1:] > 0.0), "the bob stays although the torque is above the limit")
    return followed(EXCEEDS, method, angle, velocity, 1e-8)


# --- the cases ------------------------------------------------------------------------------------------------------

COULOMB = "Coulomb 1785; the driven oscillator in closed form (Landau & Lifshitz 1976, section 22)"

CASES = (
    _thrown("full gravity", "pendulum"),
    _thrown("quadratic drag", "quadratic drag of 0.1", QuadraticDrag(c=DRAG)),
    foreseen(GROUP, REVERSES,
             "The wind changes its sign every few control steps, and with it the slip, where drag has a kink.",
             "numerical integration of each control step, with gusts computed independently; the error is that of the "
             "method's formula",
             "Uhlenbeck & Ornstein 1930; L'Ecuyer 1999; Hairer, Norsett & Wanner 1993, II.5",
             partial(follows, REVERSES, seed=SEED)),
    foreseen(GROUP, YIELDS,
             "In a step the torque rises by 3e-8 of the limit of dry friction, which must yield in the right one.",
             "no bit changes until the torque is 0.8 N m, then 6e-7 (t - sin t) rad; the error is that of the method's "
             "formula", COULOMB,
             # Torques of the size of the limit are rounded, and so is the time at which they reach it.
             partial(follows, YIELDS, fault=partial(let_go_at, LET_GO), grain=2.0**-52 / SLOW * AFTER**2)),
    foreseen(GROUP, EXCEEDS,
             "The torque rises by 2^-20 N m every second and equals the limit of dry friction exactly in one of them.",
             "no bit changes up to the time of equality, from then on rotations about the angle of equilibrium; the "
             "error is that of the method's formula", COULOMB, _climbs),
)
