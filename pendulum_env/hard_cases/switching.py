"""Hard cases: torques that change in every step, a wind that reverses, and dry friction that yields at one torque."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from integrators import Method
from pendulum_env.hard_cases import fast_drive
from pendulum_env.hard_cases.case import WRONG, Case, Finding, stopped
from pendulum_env.hard_cases.predicted import Motion, driven, expected, followed, held, ran_motion, unmet
from pendulum_env.physics.body import Body
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
from pendulum_env.truth.piecewise import smooth

Array = NDArray[np.float64]
GROUP = "switching"
KNOWN: dict[tuple[str, str], str] = {}
"""(case, method) -> reason of a known failure, and what the method does instead."""
EARTH = 9.81
"""Gravity [m/s²]."""
RATE = math.sqrt(EARTH)
"""omega0 of a pendulum of 1 m on Earth [rad/s]."""
BODY = Body(length=1.0, mass=1.0)


# --- a torque that changes in every step ----------------------------------------------------------------------------

STRENGTH, DRAG = 2.0, 0.1
"""Largest torque over m g L, and coefficient of quadratic drag [1/rad]."""
PHASE, STEPS, START = 0.2, 60, 0.5
"""omega0 h, number of steps, and initial angle [rad]."""
THROWN = Scene("a motor of 2 m g L", BODY, gravity=EARTH,
               effects=(Gravity(), QuadraticDrag(c=DRAG), Motor(max_torque=STRENGTH * EARTH)))
FREE_OF_DRAG = THROWN.replace(effects=(Gravity(), Motor(max_torque=STRENGTH * EARTH)))


def shares(count: int) -> Array:
    """Return controls of random size and sign, one per step."""
    return np.random.default_rng(3).uniform(-1.0, 1.0, count)


@lru_cache(maxsize=4)
def thrown(drag: float) -> tuple[Array, Array]:
    """Return the exact angle [rad] and velocity/omega0 after each step under :func:`shares`, with quadratic drag."""
    state, h = (START, 0.0), PHASE / RATE
    rows = [state]
    for k, share in enumerate(shares(STEPS).tolist()):

        def force(_t: float, q: float, v: float, torque: float = STRENGTH * EARTH * share) -> float:
            return torque - EARTH * math.sin(q) - drag * abs(v) * v

        state = smooth(force, state, k * h, (k + 1) * h)
        rows.append(state)
    angle, velocity = np.array(rows).T
    return angle, velocity / RATE


RANDOM = {"full gravity": (FREE_OF_DRAG, 0.0), "quadratic drag": (THROWN, DRAG)}
"""Scenes under random torques by name, with their coefficient of drag."""
MOTIONS = {
    f"a random torque in each step, {name}": Motion(
        "pendulum" if drag == 0.0 else "quadratic drag of 0.1", START, 0.0, PHASE * STEPS, marks=STEPS, growth=1e3,
        largest=10.0, pace=3.0, most=1, torques=tuple(STRENGTH * shares(STEPS)), lacks=unmet(scene))
    for name, (scene, drag) in RANDOM.items()
}
"""Motions with predicted errors."""


def _thrown(name: str) -> Case:
    """Return the case of a torque that has another size and sign in each step; ``name`` is a key of RANDOM."""
    scene, drag = RANDOM[name]
    full = f"a random torque in each step, {name}"

    def truth(_time: Array) -> tuple[Array, Array]:
        angle, velocity = thrown(drag)
        return angle, velocity * RATE

    return Case(full, GROUP,
                "A torque of up to 2 m g L jumps at each step, so that forces of earlier steps say nothing about the "
                "next.", "numerical integration of each step; the error is that of the method's formula", PIECES,
                scene, expected(full, MOTIONS[full]), followed(scene, full, MOTIONS[full], truth), motion=full)


# --- a wind that reverses -------------------------------------------------------------------------------------------

STORM, SEED, COUNT = 6.0, 11, 40
"""Standard deviation of the wind [m/s], seed, and number of control steps."""
REVERSES = "a wind that reverses"
REVERSING = Scene(REVERSES, fast_drive.BODY, fast_drive.AIR, gravity=EARTH,
                  effects=(Gravity(), QuadraticDrag(drag_coefficient=fast_drive.C_D),
                           LinearDrag(gamma=fast_drive.LINEAR),
                           Gusts(gust_speed=STORM, gust_time=fast_drive.GUST_TIME)))


def airs() -> tuple[float, ...]:
    """Return the wind [m/s] in each control step of the case of a wind that reverses."""
    gusts = fast_drive.gust_path(SEED, fast_drive.CONTROL, COUNT) * (STORM / fast_drive.GUST)
    return tuple(gusts.tolist())


MOTIONS[REVERSES] = fast_drive.in_wind(REVERSES, REVERSING, COUNT)


# --- dry friction that yields at one torque -------------------------------------------------------------------------

LIMIT, SLOW = 0.8, 1e-6
"""Limit of dry friction [N m] and angular frequency of a torque of amplitude 1 N m [rad/s]; omega0 = 1/s."""
LET_GO, AFTER, MARKS = 10.02, 5.0, 10
"""Time at which the torque reaches the limit, time to follow the bob after it [s], and number of marks."""
PHASED = -math.acos(LIMIT) - SLOW * LET_GO
"""Phase of the torque, which is cos(SLOW t + PHASED) N m."""
YIELDS = "a torque that takes 11 days to rise"
WEEK = Scene("dry friction under a torque that takes 11 days to rise", BODY, gravity=1.0,
             effects=(SmallAngleGravity(), PeriodicTorque(1.0, SLOW, PHASED), CoulombFriction(LIMIT)))
MOTIONS[YIELDS] = Motion(YIELDS, 0.0, 0.0, LET_GO + AFTER, marks=MARKS, largest=AFTER * SLOW, goal=1e-5, most=64,
                         lacks=unmet(WEEK) | {"split"})


def yielded(time: Array) -> tuple[Array, Array]:
    """Return the exact angle and velocity of a bob that slides from LET_GO [s] on.

    The excess of the torque is ``0.6 s - 0.4 s² - 0.1 s³`` with s = SLOW times the time since then, and smaller terms.
    """
    since = np.maximum(time - LET_GO, 0.0)
    # theta'' + theta = excess, from rest: t -> t - sin(t), t² -> t² - 2 + 2 cos(t).
    angle = 0.6 * SLOW * (since - np.sin(since)) - 0.4 * SLOW**2 * (since**2 - 4.0 * np.sin(0.5 * since) ** 2)
    velocity = 0.6 * SLOW * 2.0 * np.sin(0.5 * since) ** 2 - 0.8 * SLOW**2 * (since - np.sin(since))
    return angle, velocity


def _yields(method: Method) -> Finding:
    """Judge a method by the step in which dry friction lets the bob go under a very slow torque, and by its motion."""
    run = ran_motion(WEEK, YIELDS, MOTIONS[YIELDS], method)
    ended = stopped(run)
    if ended is not None:
        return ended
    before, after = run.time <= LET_GO, run.time > LET_GO + run.dt
    if np.any(run.velocity[before]) or np.any(run.angle[before]):
        return Finding(WRONG, note="the bob starts to slide too early")
    if not np.all(run.velocity[after] > 0.0):
        return Finding(WRONG, note="the bob starts to slide too late")
    angle, velocity = yielded(run.time)
    error = np.maximum(np.abs(run.angle - angle), np.abs(run.velocity - velocity)) / MOTIONS[YIELDS].largest
    # Torques of the size of the limit are rounded, and so is the time at which they reach it.
    return held(YIELDS, MOTIONS[YIELDS], method, error, 2.0**-52 / SLOW * AFTER**2)


GRAIN, HOLDS, SLIDES = 2.0**-20, 25, 5
"""Growth of the torque per mark over its limit of 0.5 N m, marks until the limit, and marks after it."""
TURN = 1.0
"""Time between two marks [s]; omega0 = 1/s."""
EXCEEDS = "a torque that exceeds dry friction by one part in 1e6"
STAIRS = Scene("dry friction under a torque that rises in steps", BODY, gravity=1.0,
               effects=(SmallAngleGravity(), Motor(max_torque=1.0), CoulombFriction(0.5)))
MOTIONS[EXCEEDS] = Motion(EXCEEDS, 0.0, 0.0, TURN * (HOLDS + SLIDES), marks=HOLDS + SLIDES,
                          largest=SLIDES * GRAIN, goal=1e-5, most=64,
                          torques=tuple(0.5 + k * GRAIN for k in range(1 - HOLDS, SLIDES + 1)),
                          lacks=unmet(STAIRS) | {"split"})


def climbed() -> tuple[Array, Array]:
    """Return the exact angle [rad] and velocity [rad/s] at the start and at all marks.

    The bob is at rest until the torque exceeds the limit. In the k-th part of the time after that it turns about the
    angle k GRAIN, as the torque exceeds the limit by k GRAIN.
    """
    angle, speed, rows = 0.0, 0.0, [(0.0, 0.0)] * (HOLDS + 1)
    for k in range(1, SLIDES + 1):
        off = angle - k
        angle, speed = k + off * math.cos(TURN) + speed * math.sin(TURN), speed * math.cos(TURN) - off * math.sin(TURN)
        rows.append((angle, speed))
    states = np.array(rows) * GRAIN
    return states[:, 0], states[:, 1]


def _climbs(method: Method) -> Finding:
    """Judge a method by dry friction that holds the bob at exactly its limit, and yields one part in 2**20 above it."""
    found = driven(STAIRS, EXCEEDS, MOTIONS[EXCEEDS], method)
    if isinstance(found, Finding):
        return found
    angle, velocity = found
    if np.any(angle[: HOLDS + 1]) or np.any(velocity[: HOLDS + 1]):
        return Finding(WRONG, note="the bob slides although the torque is not above the limit")
    if not np.all(velocity[HOLDS + 1:] > 0.0):
        return Finding(WRONG, note="the bob stays although the torque is above the limit")
    error = np.abs(np.stack(found) - np.stack(climbed())) / MOTIONS[EXCEEDS].largest
    return held(EXCEEDS, MOTIONS[EXCEEDS], method, error, 1e-8)


# --- the cases ------------------------------------------------------------------------------------------------------

PIECES = "scipy's DOP853 at 3e-14 in each step (Hairer, Norsett & Wanner 1993, II.5)"
COULOMB = "Coulomb 1785; the driven oscillator in closed form (Landau & Lifshitz 1976, section 22)"

CASES = (
    *(_thrown(name) for name in RANDOM),
    Case(REVERSES, GROUP,
         "The wind changes its sign every few control steps, and with it the slip, where drag has a kink.",
         "numerical integration of each control step, with gusts computed independently; the error is that of the "
         "method's formula",
         "Uhlenbeck & Ornstein 1930; L'Ecuyer 1999; Hairer, Norsett & Wanner 1993, II.5", REVERSING,
         expected(REVERSES, MOTIONS[REVERSES]),
         followed(REVERSING, REVERSES, MOTIONS[REVERSES], lambda _: fast_drive.blown(airs()), SEED), motion=REVERSES),
    Case(YIELDS, GROUP,
         "In a step the torque rises by 3e-8 of the limit of dry friction, which must yield in the right one.",
         "no bit changes until the torque is 0.8 N m, then 6e-7 (t - sin t) rad; the error is that of the method's "
         "formula", COULOMB, WEEK, expected(YIELDS, MOTIONS[YIELDS]), _yields, motion=YIELDS),
    Case(EXCEEDS, GROUP,
         "The torque rises by 2^-20 N m every second and equals the limit of dry friction exactly in one of them.",
         "no bit changes up to the time of equality, from then on rotations about the angle of equilibrium; the error "
         "is that of the method's formula", COULOMB, STAIRS, expected(EXCEEDS, MOTIONS[EXCEEDS]), _climbs,
         motion=EXCEEDS),
)
