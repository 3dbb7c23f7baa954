"""Hard cases: very small and very large lengths, masses, gravities, angles and times.

In units of the length L, the time 1/omega0 and the mass m all pendulums are identical (Buckingham 1914, Phys. Rev. 4,
345), so a method has to give equal angles at equal omega0 t. Absolute numbers hidden in the code, such as a tolerance
or a smallest number, become visible.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from integrators import Method
from pendulum_env.engine.rollout import Rollout
from pendulum_env.hard_cases.case import (
    ACCURATE,
    DIVERGED,
    WRONG,
    Bound,
    Case,
    Finding,
    Rule,
    Try,
    also,
    always,
    graded,
    ran,
    stopped,
)
from pendulum_env.hard_cases.predicted import Motion, expected, held, ran_motion, steps_and_error
from pendulum_env.physics import exact
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import Gravity, Motor, PeriodicTorque, SmallAngleGravity
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.piecewise import smooth
from pendulum_env.truth.steps import rounding_factor

Array = NDArray[np.float64]
GROUP = "magnitudes"
KNOWN: dict[tuple[str, str], str] = {}
"""(case, method) -> reason of a known failure, and what the method does instead."""

PRODUCT, STEPS = 0.1, 200
"""omega0 h, and number of steps."""
ULPS = 50.0
"""Rounding error allowed per step, in ulps; most of it comes from the rounding of the frequency."""
TIME, MARKS, PACE = 20.0, 20, 1.7
"""Duration of the swings times omega0, marks in it, and largest velocity over omega0."""
SHARE = 0.05
"""Torque of the motor in units of m g L."""


def rounding(method: Method) -> float:
    """Return a bound of the relative rounding error of a method's step, in units of its increments."""
    return ULPS * rounding_factor(method) * 2.0**-52


def _pendulum(length: float = 1.0, mass: float = 1.0, gravity: float = 9.81, powered: bool = False) -> Scene:
    """Return a pendulum scene; ``powered`` adds a motor with a torque proportional to m g L.

    With the motor on, the mass affects the motion.
    """
    motor = (Motor(max_torque=SHARE * mass * gravity * length),) if powered else ()
    return Scene("magnitudes", Body(length=length, mass=mass), effects=(Gravity(), *motor), gravity=gravity)


def _swing(scene: Scene, method: Method) -> Rollout:
    """Run a method on a scaled pendulum from 2 rad with the velocity 0.3 omega0, under full motor control."""
    powered = len(scene.effects) > 1
    return ran_motion(scene, UNIT[powered], MOTIONS[UNIT[powered]], method, control=1.0)


@cache
def unit_run(method: Method, powered: bool) -> Rollout:
    """Return the run of a method on the pendulum of 1 m and 1 kg, with which scaled ones are compared; cached."""
    return _swing(_pendulum(powered=powered), method)


@cache
def _pushed() -> tuple[Array, Array]:
    """Return the exact angle and velocity at the marks of the pendulum of 1 m and 1 kg under the motor's torque."""
    scene = _pendulum()
    state, gap = (2.0, 0.3 * scene.omega0), TIME / MARKS / scene.omega0
    rows = [state]
    for k in range(MARKS):
        state = smooth(lambda _t, q, _v: scene.omega0**2 * (SHARE - math.sin(q)), state, k * gap, (k + 1) * gap)
        rows.append(state)
    angle, velocity = np.array(rows).T
    return angle, velocity


@cache
def unit_finding(method: Method, powered: bool) -> Finding:
    """Judge a method's run on the pendulum of 1 m and 1 kg against the closed form, under a torque by integration."""
    scene, run = _pendulum(), unit_run(method, powered)
    ended = stopped(run)
    if ended is not None:
        return ended
    angle, velocity = _pushed() if powered else exact.pendulum(run.time, 2.0, 0.3 * scene.omega0, scene.omega0)
    error = np.maximum(np.abs(run.angle - angle), np.abs(run.velocity - velocity) / scene.omega0 / PACE)
    motion = MOTIONS[UNIT[powered]]
    return held(UNIT[powered], motion, method, error / motion.largest)


def _similar(scene: Scene) -> Try:
    """Return a function that judges a method by its run on a pendulum of very small or large size.

    In dimensionless units this run must equal that on the pendulum of 1 m and 1 kg, which must be right.
    """

    def attempt(method: Method) -> Finding:
        powered = len(scene.effects) > 1
        run, unit, right = _swing(scene, method), unit_run(method, powered), unit_finding(method, powered)
        ended = stopped(run)
        if ended is not None or right.outcome == WRONG:
            return ended or right
        scale, rate = (np.array([s.gravity * s.weight_moment for s in (scene, unit.scene)]),
                       np.array([scene.omega0, unit.scene.omega0]))
        difference = max(
            float(np.max(np.abs(run.angle - unit.angle))),
            float(np.max(np.abs(run.velocity / rate[0] - unit.velocity / rate[1]))),
            float(np.max(np.abs(run.energy / scale[0] - unit.energy / scale[1]))),
            float(np.max(np.abs(run.energy_residual / scale[0] - unit.energy_residual / scale[1]))),
        )
        found = graded(difference, rounding(method) * TIME, "the motion depends on the unit of length, mass or time",
                       of="the motion at 1 m and 1 kg")
        return also(found, *right.bounds)

    return attempt


FREE_SPEED = 1e6
"""Speed of the free rotation [rad/s]."""


def _free(method: Method) -> Finding:
    """Judge a method on a fast rotation without gravity, whose angle is theta0 + v t.

    The speed is 1e6 rad/s for 0.2 s, which is 1000 rad per step.
    """
    run = ran(FREE, method, dt=1e-3, steps=STEPS, angle=0.3, velocity=FREE_SPEED)
    ended = stopped(run)
    if ended is not None:
        return ended
    change = np.concatenate([run.velocity / FREE_SPEED - 1.0, run.energy / run.energy[0] - 1.0])
    error = np.concatenate([change, (run.angle - 0.3 - FREE_SPEED * run.time) / (FREE_SPEED * run.time[-1])])
    return graded(error, rounding(method), "the speed changes although no force acts")


def _small(scene: Scene, angle: float) -> Try:
    """Return a function that judges a method on a tiny swing, whose angle is ``angle`` cos(omega0 t).

    The square of the angle is negligible or underflows.
    """
    motion = MOTIONS[SMALL]

    def attempt(method: Method) -> Finding:
        run = ran_motion(scene, SMALL, replace(motion, angle=angle), method)
        ended = stopped(run)
        if ended is not None:
            return ended
        phase = scene.omega0 * run.time
        error = np.maximum(np.abs(run.angle / angle - np.cos(phase)),
                           np.abs(run.velocity / angle / scene.omega0 + np.sin(phase)))
        # Each addition to angle and velocity rounds to a multiple of 2**-1074.
        count, _ = steps_and_error(SMALL, motion, method)
        grain = 2.0**-1074 / angle * max(1.0, scene.omega0, 1.0 / scene.omega0) * count * motion.marks * 20.0
        grain *= rounding_factor(method)
        return held(SMALL, motion, method, error, grain)

    return attempt


def _lost_phase(method: Method) -> Finding:
    """Judge a method under a drive of 1e8 rad/s: it must stop as diverged when the phase exceeds 8.4e8 rad.

    The cosine of a larger phase cannot be computed. The run may stop earlier, because stages can lie beyond the end of
    the step, and no step resolves such a drive.
    """
    h = PRODUCT / LATE.omega0
    run = ran(LATE, method, dt=h, steps=STEPS, angle=0.1, velocity=0.0)
    ended = stopped(run)
    if ended is None:
        return Finding(WRONG, note="it continues although the phase of the drive is out of range")
    if ended.outcome == DIVERGED and ended.stop_time > RANGE / LATE_RATE + h:
        return Finding(WRONG, ended.stop_time, note="it stopped later than the phase of the drive was out of range")
    late = Bound("the time of the stop, from above", h, RANGE / LATE_RATE)
    return also(ended, late)


FREE = Scene("free rotation", effects=(Gravity(),), gravity=0.0)
TINY, LINEAR = Scene("tiny angles", effects=(Gravity(),)), Scene("tiny angles, linear", effects=(SmallAngleGravity(),))
ALWAYS = always(ACCURATE)
RANGE, LATE_RATE = 843314856.5, 1e8
"""Largest phase of a drive [rad], and angular frequency of a drive that soon reaches it [rad/s]."""
LATE = Scene("lost phase", effects=(Gravity(), PeriodicTorque(drive_torque=0.1, drive_rate=LATE_RATE)), gravity=1.0)
SIMILAR = (
    *((f"{length:g} m long", _pendulum(length)) for length in (1e-6, 1e-3, 1e3, 1e6)),
    *((f"a bob of {mass:g} kg", _pendulum(mass=mass, powered=True)) for mass in (1e-12, 1e-6, 1e6, 1e12)),
    *((f"g = {gravity:g} m/s2", _pendulum(gravity=gravity)) for gravity in (1e-12, 1e-6, 1e6)),
    ("1e-6 m, 1e-12 kg, 1e6 m/s2", _pendulum(1e-6, 1e-12, 1e6, powered=True)),
    ("200 years, g = 1e-17 m/s2", _pendulum(gravity=1e-17)),
)
ANGLES = (1e-9, 1e-100, 1e-200, 1e-300, 1e-308, 1e-310, 1e-315)
"""Amplitudes of tiny swings [rad]; from the third on their squares underflow, the last two are subnormal."""


RIGHT = "right at 1 m and 1 kg"
SMALL = "a tiny swing"
UNIT = {False: RIGHT, True: f"{RIGHT}, with a motor"}
"""Without or with a motor -> name of the motion at 1 m and 1 kg."""
MOTIONS = {
    **{UNIT[powered]: Motion("pendulum pushed by 0.05" if powered else "pendulum", 2.0, 0.3, TIME, marks=MARKS,
                             growth=20.0, largest=2.0, pace=PACE, most=64) for powered in UNIT},
    SMALL: Motion("linear", 1.0, 0.0, TIME, marks=4, goal=1e-3, most=128, sensitive=True),
}
"""Motions with predicted errors; that of a tiny swing is in units of its angle."""


def _case(name: str, scene: Scene, why: str, truth: str, source: str, attempt: Try,
          may: Rule = ALWAYS, motion: str = "") -> Case:
    """Return a hard case of the group of magnitudes."""
    return Case(name, GROUP, why, truth, source, scene, may, attempt, motion=motion)


CASES = (
    *(
        _case(name, scene, "Absolute tolerances or smallest numbers in the code would be wrong at such sizes.",
              "angle, velocity/omega0 and energy/(m g L) equal those of the pendulum of 1 m and 1 kg, to rounding, "
              "whose error is that of the method's formula",
              "dimensional analysis (Buckingham 1914, Phys. Rev. 4, 345)", _similar(scene),
              motion=UNIT[len(scene.effects) > 1])
        for name, scene in SIMILAR
    ),
    _case(RIGHT, _pendulum(),
          "The pendulums of all other sizes are compared with this run, so that it must be right.",
          "Jacobi's elliptic functions; the error is that of the method's formula",
          "Whittaker & Watson 1927, 44", lambda method: unit_finding(method, False), expected(RIGHT, MOTIONS[RIGHT]),
          RIGHT),
    _case("no gravity", FREE,
          "Without gravity there is no natural frequency, and the pendulum turns 160 times in a step.",
          "theta = theta0 + v t, with v and the energy constant", "Newton's first law", _free),
    *(
        _case(f"{angle:g} rad, {scene.effects[0].name}", scene,
              "The swing is so small that the squared angle, and finally the angle itself, underflows to 0.",
              "angle cos(omega0 t); the error is that of the method's formula",
              "the linear pendulum; sin(x) = x to x**3/6", _small(scene, angle),
              expected(SMALL, MOTIONS[SMALL]), SMALL)
        for scene in (TINY, LINEAR) for angle in ANGLES
    ),
    _case("a drive of lost phase", LATE,
          "The phase of a very fast drive becomes so large that a double cannot represent it accurately.",
          "reported divergence when the phase is 8.4e8 rad, the end of the range of the cosine",
          "the range of the reduction by three parts of pi/2 (Cody & Waite 1980)", _lost_phase,
          always(DIVERGED)),
)
