"""Hard cases: very small and very large lengths, masses, gravities, angles and times.

In units of the length L, the time 1/omega0 and the mass m all pendulums are identical (Buckingham 1914, Phys. Rev. 4,
345), so a method has to give equal angles at equal omega0 t. Absolute numbers hidden in the code, such as a tolerance
or a smallest number, become visible.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from integrators import Method
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
    graded,
    known,
    ran,
    stopped,
)
from pendulum_env.physics import exact
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import Gravity, Motor, PeriodicTorque, SmallAngleGravity
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.steps import error_constant, rounding_factor

GROUP = "magnitudes"
KNOWN: dict[tuple[str, str], str] = {}
"""(case, method) -> reason of a known failure, and what the method does instead."""

PRODUCT, STEPS = 0.1, 200
"""omega0 h, and number of steps."""
ULPS = 50.0
"""Rounding error allowed per step, in ulps; most of it comes from the rounding of the frequency."""
POLE = 1.7
"""Distance in imaginary time to a pole of the motion from 2 rad with 0.3 omega0, K'(k), k**2 = 0.7306 [1/omega0]."""
KNOWN_TO = 1.0
"""Largest error [rad] for which the bound from a method's order is meaningful."""
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
    return ran(scene, method, dt=PRODUCT / scene.omega0, steps=STEPS, angle=2.0, velocity=0.3 * scene.omega0,
               control=1.0)


@cache
def unit_run(method: Method, powered: bool) -> Rollout:
    """Return the run of a method on the pendulum of 1 m and 1 kg, with which scaled ones are compared; cached."""
    return _swing(_pendulum(powered=powered), method)


def _error(method: Method) -> float:
    """Return a bound of a method's angle error on the pendulum of 1 m and 1 kg [rad].

    The velocity, 2 k cn, has poles at the distance POLE from the bottom, so the n-th derivative of the angle is
    2 (n - 1)!/POLE**n there. An energy error also changes the frequency, so the phase error grows with time squared.
    """
    order = 0.0
    if math.isfinite(method.order):
        step = error_constant(method) * 2.0 * math.factorial(method.order) * (PRODUCT / POLE) ** (method.order + 1)
        order = step * STEPS * (1.0 + PRODUCT * STEPS)
    return order + rounding(method) * STEPS * PRODUCT


def _right(method: Method) -> Finding:
    """Judge a method's run on the pendulum of 1 m and 1 kg against the closed form (elliptic functions)."""
    scene, run = _pendulum(), unit_run(method, False)
    ended = stopped(run)
    if ended is not None:
        return ended
    truth, _ = exact.pendulum(run.time, 2.0, 0.3 * scene.omega0, scene.omega0)
    wrong = "its error is larger than its order allows" if _error(method) <= KNOWN_TO else ""
    return graded(run.angle - truth, min(_error(method), KNOWN_TO), wrong)


def _similar(scene: Scene) -> Try:
    """Return a function that judges a method by its run on a pendulum of very small or large size.

    In dimensionless units this run must equal that on the pendulum of 1 m and 1 kg.
    """

    def attempt(method: Method) -> Finding:
        run = _swing(scene, method)
        unit = unit_run(method, len(scene.effects) > 1)
        ended = stopped(run)
        if ended is not None:
            return ended
        scale, rate = (np.array([s.gravity * s.weight_moment for s in (scene, unit.scene)]),
                       np.array([scene.omega0, unit.scene.omega0]))
        difference = max(
            float(np.max(np.abs(run.angle - unit.angle))),
            float(np.max(np.abs(run.velocity / rate[0] - unit.velocity / rate[1]))),
            float(np.max(np.abs(run.energy / scale[0] - unit.energy / scale[1]))),
            float(np.max(np.abs(run.energy_residual / scale[0] - unit.energy_residual / scale[1]))),
        )
        return graded(difference, rounding(method) * STEPS * PRODUCT,
                      "the motion depends on the unit of length, mass or time")

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

    def attempt(method: Method) -> Finding:
        run = ran(scene, method, dt=PRODUCT / scene.omega0, steps=STEPS, angle=angle, velocity=0.0)
        ended = stopped(run)
        if ended is not None:
            return ended
        error = run.angle / angle - np.cos(PRODUCT * np.arange(STEPS + 1))
        order = 0.0 if math.isinf(method.order) else PRODUCT**method.order * PRODUCT * STEPS
        # Each addition to angle and velocity rounds to a multiple of 2**-1074.
        grain = 2.0**-1074 / angle * max(1.0, scene.omega0, 1.0 / scene.omega0) * STEPS * 20.0
        return graded(error, order + grain + rounding(method) * STEPS * PRODUCT, "it differs from angle cos(omega0 t)")

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
    return ended


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


def _case(name: str, scene: Scene, why: str, truth: str, source: str, attempt: Try,
          may: Rule = ALWAYS) -> Case:
    """Return a hard case of the group of magnitudes."""
    return Case(name, GROUP, why, truth, source, scene, may, attempt)


CASES = (
    *(
        _case(name, scene, "Absolute tolerances or smallest numbers in the code would be wrong at such sizes.",
              "angle, velocity/omega0 and energy/(m g L) equal those of the pendulum of 1 m and 1 kg, to rounding",
              "dimensional analysis (Buckingham 1914, Phys. Rev. 4, 345)", _similar(scene))
        for name, scene in SIMILAR
    ),
    _case("right at 1 m and 1 kg", _pendulum(),
          "The pendulums of all other sizes are compared with this run, so that it must be right.",
          "Jacobi's elliptic functions, to the error of the method's order near a pole of theirs",
          "Whittaker & Watson 1927, 44", _right,
          known(_error, KNOWN_TO, ACCURATE, STABLE)),
    _case("no gravity", FREE,
          "Without gravity there is no natural frequency, and the pendulum turns 160 times in a step.",
          "theta = theta0 + v t, with v and the energy constant", "Newton's first law", _free),
    *(
        _case(f"{angle:g} rad, {scene.effects[0].name}", scene,
              "The swing is so small that the squared angle, and finally the angle itself, underflows to 0.",
              "angle cos(omega0 t)", "the linear pendulum; sin(x) = x to x**3/6", _small(scene, angle))
        for scene in (TINY, LINEAR) for angle in ANGLES
    ),
    _case("a drive of lost phase", LATE,
          "The phase of a very fast drive becomes so large that a double cannot represent it accurately.",
          "reported divergence when the phase is 8.4e8 rad, the end of the range of the cosine",
          "the range of the reduction by three parts of pi/2 (Cody & Waite 1980)", _lost_phase,
          always(DIVERGED)),
)
