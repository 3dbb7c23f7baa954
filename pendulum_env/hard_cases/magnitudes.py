"""Hard cases: very small and very large lengths, masses, gravities, angles and times.

In units of the length L, the time 1/omega0 and the mass m all pendulums are identical (Buckingham 1914, Phys. Rev. 4,
345), so a method has to give equal angles at equal omega0 t. Absolute numbers hidden in the code, such as a tolerance
or a smallest number, become visible.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial

import numpy as np

from integrators import Method
from pendulum_env.engine.rollout import Rollout
from pendulum_env.hard_cases.case import (
    ACCURATE,
    DIVERGED,
    WRONG,
    Bound,
    Case,
    Finding,
    also,
    always,
    demand,
    expected,
    followed,
    foreseen,
    graded,
    held,
    ran,
    ran_motion,
    right,
    run_of,
    stopped,
)
from pendulum_env.hard_cases.predicted import Motion
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import Gravity, Motor, PeriodicTorque, SmallAngleGravity
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.answer import Array
from pendulum_env.truth.bounds import rounding, rounding_factor

GROUP = "magnitudes"
TIME = 20.0
"""Duration of the swings times omega0."""
SHARE = 0.05
"""Torque of the motor in units of m g L."""


def pendulum(length: float = 1.0, mass: float = 1.0, gravity: float = 9.81, powered: bool = False,
             name: str = "magnitudes") -> Scene:
    """Return a pendulum scene; ``powered`` adds a motor with a torque proportional to m g L.

    With the motor on, the mass affects the motion.
    """
    motor = (Motor(max_torque=SHARE * mass * gravity * length),) if powered else ()
    return Scene(name, Body(length=length, mass=mass), effects=(Gravity(), *motor), gravity=gravity)


def scaled(run: Rollout) -> Array:
    """Return angle, velocity, energy, work and residual of a run in units of 1/omega0 and m g L."""
    weight = run.scene.gravity * run.scene.weight_moment
    return np.array([run.angle, run.velocity / run.scene.omega0, run.energy / weight, run.ledger.work / weight,
                     run.energy_residual / weight])


RIGHT = {
    powered: Motion(f"right at 1 m and 1 kg{', with a motor' if powered else ''}", pendulum(powered=powered),
                    "pendulum pushed by 0.05" if powered else "pendulum", 2.0, 0.3, TIME, marks=20, growth=20.0,
                    largest=2.0, pace=1.7, most=64)
    for powered in (False, True)
}
"""Without or with a motor -> motion at 1 m and 1 kg."""


@cache
def unit_run(method: Method, powered: bool) -> Rollout:
    """Return the run of a method on the pendulum of 1 m and 1 kg, with which scaled ones are compared; cached."""
    return ran_motion(RIGHT[powered], method, control=1.0)


@cache
def unit_finding(method: Method, powered: bool) -> Finding:
    """Judge a method's run on the pendulum of 1 m and 1 kg against the true motion."""
    run = unit_run(method, powered)
    return followed(RIGHT[powered], method, run.angle, run.velocity)


def similar(scene: Scene, method: Method) -> Finding:
    """Judge a method by its run on a pendulum of very small or large size.

    In dimensionless units this run must equal that on the pendulum of 1 m and 1 kg, which must be right.
    """
    powered = len(scene.effects) > 1
    run = ran_motion(replace(RIGHT[powered], scene=scene), method, control=1.0)
    bounds = right(unit_finding(method, powered))
    found = graded(scaled(run) - scaled(unit_run(method, powered)), rounding(method) * TIME,
                   "the motion depends on the unit of length, mass or time", of="the motion at 1 m and 1 kg")
    return also(found, *bounds)


FREE_SPEED = 1e6
"""Speed of the free rotation [rad/s], which is 1000 rad per step."""


def _free(method: Method) -> Finding:
    """Judge a method on a fast rotation without gravity, whose angle is theta0 + v t, for 0.2 s."""
    run = ran(FREE, method, dt=1e-3, steps=200, angle=0.3, velocity=FREE_SPEED)
    error = np.concatenate([run.velocity / FREE_SPEED - 1.0, run.energy / run.energy[0] - 1.0,
                            (run.angle - 0.3 - FREE_SPEED * run.time) / (FREE_SPEED * run.time[-1])])
    return graded(error, rounding(method), "the speed changes although no force acts")


def _small(scene: Scene, angle: float, method: Method) -> Finding:
    """Judge a method on a tiny swing, whose angle is ``angle`` cos(omega0 t).

    The square of the angle is negligible or underflows.
    """
    motion = replace(SMALL, scene=scene, angle=angle)
    run = ran_motion(motion, method)
    phase = scene.omega0 * run.time
    error = np.maximum(np.abs(run.angle / angle - np.cos(phase)),
                       np.abs(run.velocity / angle / scene.omega0 + np.sin(phase)))
    # Each addition to angle and velocity rounds to a multiple of 2**-1074.
    count, _ = motion.steps_and_error(method)
    grain = 2.0**-1074 / angle * max(1.0, scene.omega0, 1.0 / scene.omega0) * count * motion.marks * 20.0
    return held(motion, method, error, grain * rounding_factor(method))


def _lost_phase(method: Method) -> Finding:
    """Judge a method under a drive of 1e8 rad/s: it must stop as diverged when the phase exceeds 8.4e8 rad.

    The cosine of a larger phase cannot be computed. The run may stop earlier, because stages can lie beyond the end of
    the step, and no step resolves such a drive.
    """
    h = 0.1 / LATE.omega0
    ended = stopped(run_of(LATE, method, dt=h, steps=200, angle=0.1, velocity=0.0))
    if ended is None:
        return Finding(WRONG, note="it continues although the phase of the drive is out of range")
    demand(ended.outcome != DIVERGED or ended.stop_time <= RANGE / LATE_RATE + h,
           "it stopped later than the phase of the drive was out of range", ended.stop_time)
    return also(ended, Bound("the time of the stop, from above", h, RANGE / LATE_RATE))


FREE = Scene("free rotation", effects=(Gravity(),), gravity=0.0)
TINY, LINEAR = Scene("tiny angles", effects=(Gravity(),)), Scene("tiny angles, linear", effects=(SmallAngleGravity(),))
SMALL = Motion("a tiny swing", LINEAR, "linear", 1.0, 0.0, TIME, marks=4, goal=1e-3, most=128, sensitive=True)
"""Motion of a tiny swing in units of its angle."""
RANGE, LATE_RATE = 843314856.5, 1e8
"""Largest phase of a drive [rad], and angular frequency of a drive that soon reaches it [rad/s]."""
LATE = Scene("lost phase", effects=(Gravity(), PeriodicTorque(drive_torque=0.1, drive_rate=LATE_RATE)), gravity=1.0)
CASES = (
    *(
        Case(name, GROUP, "Absolute tolerances or smallest numbers in the code would be wrong at such sizes.",
             "angle, velocity/omega0 and energy/(m g L) equal those of the pendulum of 1 m and 1 kg, to rounding, "
             "whose error is that of the method's formula",
             "dimensional analysis (Buckingham 1914, Phys. Rev. 4, 345)", scene, always(ACCURATE),
             partial(similar, scene), motion=RIGHT[len(scene.effects) > 1])
        for name, scene in (
            *((f"{length:g} m long", pendulum(length)) for length in (1e-6, 1e-3, 1e3, 1e6)),
            *((f"a bob of {mass:g} kg", pendulum(mass=mass, powered=True)) for mass in (1e-12, 1e-6, 1e6, 1e12)),
            *((f"g = {gravity:g} m/s2", pendulum(gravity=gravity)) for gravity in (1e-12, 1e-6, 1e6)),
            ("1e-6 m, 1e-12 kg, 1e6 m/s2", pendulum(1e-6, 1e-12, 1e6, powered=True)),
            ("200 years, g = 1e-17 m/s2", pendulum(gravity=1e-17)))
    ),
    foreseen(GROUP, RIGHT[False],
             "The pendulums of all other sizes are compared with this run, so that it must be right.",
             "Jacobi's elliptic functions; the error is that of the method's formula",
             "Whittaker & Watson 1927, 44", lambda method: unit_finding(method, False)),
    Case("no gravity", GROUP,
         "Without gravity there is no natural frequency, and the pendulum turns 160 times in a step.",
         "theta = theta0 + v t, with v and the energy constant", "Newton's first law", FREE, always(ACCURATE), _free),
    *(
        Case(f"{angle:g} rad, {scene.effects[0].name}", GROUP,
             "The swing is so small that the squared angle, and finally the angle itself, underflows to 0.",
             "angle cos(omega0 t); the error is that of the method's formula",
             "the linear pendulum; sin(x) = x to x**3/6", scene,
             partial(expected, SMALL), partial(_small, scene, angle), motion=SMALL)
        # From the third on the squares of these angles underflow, the last two are subnormal.
        for scene in (TINY, LINEAR) for angle in (1e-9, 1e-100, 1e-200, 1e-300, 1e-308, 1e-310, 1e-315)
    ),
    Case("a drive of lost phase", GROUP,
         "The phase of a very fast drive becomes so large that a double cannot represent it accurately.",
         "reported divergence when the phase is 8.4e8 rad, the end of the range of the cosine",
         "the range of the reduction by three parts of pi/2 (Cody & Waite 1980)", LATE, always(DIVERGED), _lost_phase),
)
