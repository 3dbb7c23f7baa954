"""Hard cases: very small and very large lengths, masses, gravities, angles and times.

Lengths in units of L, times in units of 1/omega0 and masses in units of m, every pendulum is the same (Buckingham
1914, Phys. Rev. 4, 345), so that a method has to give the same angles at the same omega0 t: anything absolute hidden
in it, as a tolerance or a smallest number, shows.
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
from pendulum_env.truth.steps import cancelling, error_constant

GROUP = "magnitudes"
KNOWN: dict[tuple[str, str], str] = {}
"""(case, method) -> why it fails, and what it does instead."""

PRODUCT, STEPS = 0.1, 200
"""omega0 h, and steps."""
ULPS = 50.0
"""Roundings of a step, amplified by what comes after: that the frequency is another double shows most."""
POLE = 1.7
"""K'(k) of the motion from 2 rad with 0.3 omega0, k**2 = 0.7306 [1/omega0]."""
KNOWN_TO = 1.0
"""An error that the order leaves beyond this says nothing of the angle [rad]."""
SHARE = 0.05
"""The motor's torque in units of m g L."""


def rounding(method: Method) -> float:
    """Relative, of a step."""
    return ULPS * cancelling(method) * 2.0**-52


def _pendulum(length: float = 1.0, mass: float = 1.0, gravity: float = 9.81, powered: bool = False) -> Scene:
    """``powered``: with a motor that is always on, by which the mass enters the motion; it scales with the weight."""
    motor = (Motor(max_torque=SHARE * mass * gravity * length),) if powered else ()
    return Scene("magnitudes", Body(length=length, mass=mass), effects=(Gravity(), *motor), gravity=gravity)


def _swing(scene: Scene, method: Method) -> Rollout:
    return ran(scene, method, dt=PRODUCT / scene.omega0, steps=STEPS, angle=2.0, velocity=0.3 * scene.omega0,
               control=1.0)


@cache
def unit_run(method: Method, powered: bool) -> Rollout:
    """The pendulum of 1 m, 1 kg."""
    return _swing(_pendulum(powered=powered), method)


def _error(method: Method) -> float:
    """Of the pendulum of 1 m and 1 kg [rad].

    Its velocity, 2 k cn, has poles POLE away from the bottom, so that the n-th derivative of the angle is
    2 (n - 1)!/POLE**n there; an error of the energy is one of the frequency, too, and adds up once more.
    """
    order = 0.0
    if math.isfinite(method.order):
        step = error_constant(method) * 2.0 * math.factorial(method.order) * (PRODUCT / POLE) ** (method.order + 1)
        order = step * STEPS * (1.0 + PRODUCT * STEPS)
    return order + rounding(method) * STEPS * PRODUCT


def _right(method: Method) -> Finding:
    """That pendulum against its closed form."""
    scene, run = _pendulum(), unit_run(method, False)
    ended = stopped(run)
    if ended is not None:
        return ended
    truth, _ = exact.pendulum(run.time, 2.0, 0.3 * scene.omega0, scene.omega0)
    wrong = "it is not this pendulum's motion" if _error(method) <= KNOWN_TO else ""
    return graded(run.angle - truth, min(_error(method), KNOWN_TO), wrong)


def _similar(scene: Scene) -> Try:
    """Angles, velocities over omega0 and energies over m g L are those of the pendulum of 1 m, 1 kg; and are right."""

    def attempt(method: Method) -> Finding:
        run = _swing(scene, method)
        unit = unit_run(method, len(scene.effects) > 1)
        ended = stopped(run)
        if ended is not None:
            return ended
        scale, rate = (np.array([s.gravity * s.weight_moment for s in (scene, unit.scene)]),
                       np.array([scene.omega0, unit.scene.omega0]))
        apart = max(
            float(np.max(np.abs(run.angle - unit.angle))),
            float(np.max(np.abs(run.velocity / rate[0] - unit.velocity / rate[1]))),
            float(np.max(np.abs(run.energy / scale[0] - unit.energy / scale[1]))),
            float(np.max(np.abs(run.energy_residual / scale[0] - unit.energy_residual / scale[1]))),
        )
        return graded(apart, rounding(method) * STEPS * PRODUCT, "it depends on the unit of length, mass or time")

    return attempt


FREE_SPEED = 1e6
"""[rad/s]"""


def _free(method: Method) -> Finding:
    """Without gravity, 1e6 rad/s for 0.2 s: theta = theta0 + v t, at 1000 rad a step."""
    run = ran(FREE, method, dt=1e-3, steps=STEPS, angle=0.3, velocity=FREE_SPEED)
    ended = stopped(run)
    if ended is not None:
        return ended
    change = np.concatenate([run.velocity / FREE_SPEED - 1.0, run.energy / run.energy[0] - 1.0])
    error = np.concatenate([change, (run.angle - 0.3 - FREE_SPEED * run.time) / (FREE_SPEED * run.time[-1])])
    return graded(error, rounding(method), "a speed that nothing changes changes")


def _small(scene: Scene, angle: float) -> Try:
    """theta = angle cos(omega0 t) where the square of the angle is nothing, or is no number at all."""

    def attempt(method: Method) -> Finding:
        run = ran(scene, method, dt=PRODUCT / scene.omega0, steps=STEPS, angle=angle, velocity=0.0)
        ended = stopped(run)
        if ended is not None:
            return ended
        error = run.angle / angle - np.cos(PRODUCT * np.arange(STEPS + 1))
        order = 0.0 if math.isinf(method.order) else PRODUCT**method.order * PRODUCT * STEPS
        # Each addition to angle and velocity rounds to a whole number of 2**-1074.
        grain = 2.0**-1074 / angle * max(1.0, scene.omega0, 1.0 / scene.omega0) * STEPS * 20.0
        return graded(error, order + grain + rounding(method) * STEPS * PRODUCT, "it is not a small swing")

    return attempt


def _lost_phase(method: Method) -> Finding:
    """A torque of 1e8 rad/s on a swing: beyond 8.4e8 rad its cosine is not known, and the run has to say so.

    It may say so earlier: stages reach beyond the step's end, and no step resolves such a torque.
    """
    h = PRODUCT / LATE.omega0
    run = ran(LATE, method, dt=h, steps=STEPS, angle=0.1, velocity=0.0)
    ended = stopped(run)
    if ended is None:
        return Finding(WRONG, note="it goes on with a torque that is not known")
    if ended.outcome == DIVERGED and ended.stop_time > RANGE / LATE_RATE + h:
        return Finding(WRONG, ended.stop_time, note="it stopped after the phase was lost")
    return ended


FREE = Scene("free rotation", effects=(Gravity(),), gravity=0.0)
TINY, LINEAR = Scene("tiny angles", effects=(Gravity(),)), Scene("tiny angles, linear", effects=(SmallAngleGravity(),))
ALWAYS = always(ACCURATE)
RANGE, LATE_RATE = 843314856.5, 1e8
"""Largest phase of a drive [rad], and the rate of one that is soon there [rad/s]."""
LATE = Scene("lost phase", effects=(Gravity(), PeriodicTorque(drive_torque=0.1, drive_rate=LATE_RATE)), gravity=1.0)
SIMILAR = (
    *((f"{length:g} m long", _pendulum(length)) for length in (1e-6, 1e-3, 1e3, 1e6)),
    *((f"a bob of {mass:g} kg", _pendulum(mass=mass, powered=True)) for mass in (1e-12, 1e-6, 1e6, 1e12)),
    *((f"g = {gravity:g} m/s2", _pendulum(gravity=gravity)) for gravity in (1e-12, 1e-6, 1e6)),
    ("1e-6 m, 1e-12 kg, 1e6 m/s2", _pendulum(1e-6, 1e-12, 1e6, powered=True)),
    ("200 years, g = 1e-17 m/s2", _pendulum(gravity=1e-17)),
)
ANGLES = (1e-9, 1e-100, 1e-200, 1e-300, 1e-308, 1e-310, 1e-315)
"""[rad]: the square of the third is no number, the sixth and seventh are subnormal."""


def _case(name: str, scene: Scene, why: str, truth: str, source: str, attempt: Try,
          may: Rule = ALWAYS) -> Case:
    return Case(name, GROUP, why, truth, source, scene, may, attempt)


CASES = (
    *(
        _case(name, scene, "Tolerances, smallest numbers and units hide in methods as absolute numbers.",
              "angle, velocity/omega0 and energy/(m g L) of the pendulum of 1 m and 1 kg, to rounding",
              "dimensional analysis (Buckingham 1914, Phys. Rev. 4, 345)", _similar(scene))
        for name, scene in SIMILAR
    ),
    _case("right at 1 m and 1 kg", _pendulum(), "All others are compared with this one.",
          "Jacobi's functions, to the order's error next to a pole of theirs", "Whittaker & Watson 1927, 44", _right,
          known(_error, KNOWN_TO, ACCURATE, STABLE)),
    _case("no gravity", FREE, "There is no frequency to measure anything by, and 160 turns are in a step.",
          "theta = theta0 + v t, with v and the energy constant", "Newton's first law", _free),
    *(
        _case(f"{angle:g} rad, {scene.effects[0].name}", scene, "Squares, and at last the angle itself, underflow.",
              "angle cos(omega0 t)", "the linear pendulum; sin(x) = x to x**3/6", _small(scene, angle))
        for scene in (TINY, LINEAR) for angle in ANGLES
    ),
    _case("a drive of lost phase", LATE, "Far from 0 a double no longer holds the phase of a drive.",
          "named divergence when the phase is 8.4e8 rad, where the cosine's argument loses its range",
          "the range of the reduction by three parts of pi/2 (Cody & Waite 1980)", _lost_phase,
          always(DIVERGED)),
)
