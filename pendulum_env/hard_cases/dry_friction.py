"""Dry friction's hard cases that have closed forms: swings to rest, a rest within the band, letting go."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from integrators import Method, MethodError
from integrators.analysis import spectral_radius
from pendulum_env.engine.rollout import Rollout
from pendulum_env.hard_cases.case import ACCURATE, DIVERGED, STABLE, WRONG, Finding, Try, judged, ran
from pendulum_env.physics import exact
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import CoulombFriction, Effect, Gravity, PeriodicTorque, SmallAngleGravity
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.own_error import left

Array = NDArray[np.float64]
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
