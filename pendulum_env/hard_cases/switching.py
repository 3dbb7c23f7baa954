"""Hard cases: torques that change in every step, a wind that reverses, and dry friction that yields at one torque."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from integrators import Method
from pendulum_env.engine.machine import ANGLE, INDEX, VELOCITY, Machine
from pendulum_env.hard_cases.case import (
    DIVERGED,
    WRONG,
    Case,
    Finding,
    graded,
    judged,
    ran,
    resolved,
    sooner,
    stopped,
)
from pendulum_env.hard_cases.fast_drive import GUST, GUST_TIME, gust_path
from pendulum_env.hard_cases.predicted import Motion, expected, followed, unmet
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
from pendulum_env.physics.medium import Medium
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.piecewise import smooth
from pendulum_env.truth.steps import order_bound

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

LENGTH, MASS, RADIUS, DENSITY, C_D, LINEAR = 0.353, 0.0027, 0.02, 1.2, 0.45, 0.1
STORM, SEED, CONTROL, HELD, COUNT, TURNED = 6.0, 11, 0.1, 10, 40, 0.5
"""Standard deviation of the wind [m/s], seed, control step [s], steps in it, control steps, and initial angle [rad]."""
REVERSING = Scene("a wind that reverses", Body(length=LENGTH, mass=MASS, radius=RADIUS),
                  Medium("air", DENSITY, 1.8e-5), gravity=EARTH,
                  effects=(Gravity(), QuadraticDrag(drag_coefficient=C_D), LinearDrag(gamma=LINEAR),
                           Gusts(gust_speed=STORM, gust_time=GUST_TIME)))


@lru_cache(maxsize=1)
def blown() -> tuple[Array, Array]:
    """Return the reference angle and velocity after each control step in a wind that reverses."""
    gusts = gust_path(SEED, CONTROL, COUNT) * (STORM / GUST)
    state, rows = (TURNED, 0.0), [(TURNED, 0.0)]
    area = 0.5 * DENSITY * C_D * math.pi * RADIUS**2
    for k, air in enumerate(gusts.tolist()):

        def force(_t: float, q: float, v: float, air: float = air) -> float:
            slip, across = LENGTH * v - air * math.cos(q), air * math.sin(q)
            drag = -area * math.hypot(slip, across) * slip
            return drag / (MASS * LENGTH) - EARTH * math.sin(q) / LENGTH - LINEAR * slip / LENGTH

        state = smooth(force, state, k * CONTROL, (k + 1) * CONTROL)
        rows.append(state)
    angle, velocity = np.array(rows).T
    return angle, velocity


def _blown(method: Method) -> Finding:
    """Judge a method's motion in a wind that reverses every few control steps."""
    h, rate = CONTROL / HELD, REVERSING.omega0
    run = ran(REVERSING, method, dt=h, steps=HELD * COUNT, every=HELD, substeps=HELD, seed=SEED, angle=TURNED,
              velocity=0.0)
    ended = stopped(run)
    if ended is not None:
        return ended
    angle, velocity = blown()
    size = float(np.max(np.abs(angle)))
    # The rate of drag in the strongest wind is above omega0, and the slip changes its sign in many control steps.
    fast = max(rate, DENSITY * C_D * math.pi * RADIUS**2 * 3.0 * STORM / MASS)
    kinks = (fast * h) ** min(method.order, 3) * fast * CONTROL
    allowed = size * max(order_bound(method, fast * h, rate * CONTROL * COUNT), min(kinks, 0.1)) + 1e-11
    error = np.maximum(np.abs(run.angle - angle), np.abs(run.velocity - velocity) / rate)
    return judged(run, error, allowed, "it grows" if np.max(np.abs(run.angle)) > 10.0 * size else "")


# --- dry friction that yields at one torque -------------------------------------------------------------------------

LIMIT, SLOW = 0.8, 1e-6
"""Limit of dry friction [N m] and angular frequency of a torque of amplitude 1 N m [rad/s]; omega0 = 1/s."""
LET_GO, AFTER, STEP = 10.02, 5.0, 0.05
"""Time at which the torque reaches the limit, time to follow the bob after it, and step [s]."""
WEEK = Scene("dry friction under a torque that takes 11 days to rise", BODY, gravity=1.0,
             effects=(SmallAngleGravity(), PeriodicTorque(1.0, SLOW, -math.acos(LIMIT) - SLOW * LET_GO),
                      CoulombFriction(LIMIT)))


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
    run = ran(WEEK, method, dt=STEP, steps=math.ceil((LET_GO + AFTER) / STEP), angle=0.0, velocity=0.0)
    ended = stopped(run)
    if ended is not None:
        return ended
    before, after = run.time <= LET_GO, run.time > LET_GO + STEP
    if np.any(run.velocity[before]) or np.any(run.angle[before]):
        return Finding(WRONG, note="the bob starts to slide too early")
    if not np.all(run.velocity[after] > 0.0):
        return Finding(WRONG, note="the bob starts to slide too late")
    angle, velocity = yielded(run.time)
    error = np.maximum(np.abs(run.angle - angle), np.abs(run.velocity - velocity)) / (0.6 * SLOW)
    # Torques of the size of the limit are rounded, and so is the time at which they reach it.
    return graded(error, order_bound(method, STEP, AFTER) + 2.0**-52 / SLOW * AFTER**2,
                  "it slides differently" if np.max(error) > 1.0 else "")


GRAIN, HOLDS, SLIDES = 2.0**-20, 50, 45
"""Growth of the torque per step over its limit of 0.5 N m, steps until the limit, and steps after it."""
TURN = 0.1
"""Step [s]; omega0 = 1/s."""
STAIRS = Scene("dry friction under a torque that rises in steps", BODY, gravity=1.0,
               effects=(SmallAngleGravity(), Motor(max_torque=1.0), CoulombFriction(0.5)))


def climbed() -> tuple[Array, Array]:
    """Return the exact angle and velocity, in units of GRAIN, after each step from the one that exceeds the limit on.

    In step k the bob turns about the angle k, as the torque exceeds the limit by k GRAIN.
    """
    angle, speed, rows = 0.0, 0.0, []
    for k in range(1, SLIDES + 1):
        off = angle - k
        angle, speed = k + off * math.cos(TURN) + speed * math.sin(TURN), speed * math.cos(TURN) - off * math.sin(TURN)
        rows.append((angle, speed))
    states = np.array(rows)
    return states[:, 0], states[:, 1]


def _climbs(method: Method) -> Finding:
    """Judge a method by dry friction that holds the bob at exactly its limit, and yields one part in 2**20 above it."""
    machine = Machine(STAIRS, method, backend=sooner(method, HOLDS + SLIDES))
    state, rows = machine.state(0.0, 0.0), []
    for k in range(1 - HOLDS, SLIDES + 1):
        if machine.advance(state, 0.5 + k * GRAIN, TURN, 1):
            return Finding(DIVERGED, stop_time=float(state[INDEX]) * TURN)
        rows.append((float(state[ANGLE]) / GRAIN, float(state[VELOCITY]) / GRAIN))
    states = np.array(rows).T
    if np.any(states[:, :HOLDS]):
        return Finding(WRONG, note="the bob slides although the torque is not above the limit")
    truth = np.stack(climbed())
    if not np.all(states[1, HOLDS:] > 0.0):
        return Finding(WRONG, note="the bob stays although the torque is above the limit")
    error = np.abs(states[:, HOLDS:] - truth) / float(np.max(truth))
    return graded(error, order_bound(method, TURN, TURN * SLIDES) + 1e-8, "it slides differently")


# --- the cases ------------------------------------------------------------------------------------------------------

PIECES = "scipy's DOP853 at 3e-14 in each step (Hairer, Norsett & Wanner 1993, II.5)"
COULOMB = "Coulomb 1785; the driven oscillator in closed form (Landau & Lifshitz 1976, section 22)"

CASES = (
    *(_thrown(name) for name in RANDOM),
    Case("a wind that reverses", GROUP,
         "The wind changes its sign every few control steps, and with it the slip, where drag has a kink.",
         "numerical integration of each control step, with gusts computed independently; the tolerance is (k h)^p "
         "omega0 t of the largest angle with the rate k of drag, p at most 3 at zeros of the slip",
         "Uhlenbeck & Ornstein 1930; L'Ecuyer 1999; Hairer, Norsett & Wanner 1993, II.5", REVERSING, resolved, _blown),
    Case("a torque that takes 11 days to rise", GROUP,
         "In a step the torque rises by 3e-8 of the limit of dry friction, which must yield in the right one.",
         "no bit changes until the torque is 0.8 N m, then 6e-7 (t - sin t) rad; the tolerance is (omega0 h)^p omega0 "
         "t of 6e-7 rad and the rounding of the torque", COULOMB, WEEK, resolved, _yields),
    Case("a torque that exceeds dry friction by one part in 1e6", GROUP,
         "The torque rises by 2^-20 N m in each step and equals the limit of dry friction exactly in one of them.",
         "no bit changes up to the step of equality, from the next on rotations about the angle of equilibrium",
         COULOMB, STAIRS, resolved, _climbs),
)
