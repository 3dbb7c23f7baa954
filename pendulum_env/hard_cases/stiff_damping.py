"""Hard cases: damping far faster than the step, and slow creep under strong damping.

The runs with fast damping start with a velocity of 1e4 rad/s, and every step must err as predicted. With drag times
step = load, an L-stable method loses most of a velocity x at any load: ``x1 ~ sqrt(x/load)`` under quadratic drag.
Other A-stable methods have ``x1/x = 1 - O(1/load)`` under linear and ``1 - O(1/sqrt(load x))`` under quadratic drag: at
load 1e6 of linear drag, 100 steps of midpoint lose 4e-4 of the velocity, gauss4 loses 1.2e-3.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from integrators import Method
from integrators.analysis import damping_limit
from pendulum_env.engine.machine import offers
from pendulum_env.engine.rollout import Rollout
from pendulum_env.hard_cases.case import (
    ACCURATE,
    DIVERGED,
    REFUSED,
    STABLE,
    Case,
    Finding,
    Rule,
    Try,
    also,
    followed,
    graded,
    ran,
    ran_motion,
    right,
)
from pendulum_env.hard_cases.predicted import Motion
from pendulum_env.hard_cases.step_limits import growth
from pendulum_env.physics.effects import Gravity, LinearDrag, QuadraticDrag, SmallAngleGravity
from pendulum_env.physics.energy import ABSURD
from pendulum_env.physics.scene import Scene

GROUP = "stiff damping"
ANGLE, FAST = 0.5, 1e4
"""Initial angle [rad] and velocity [rad/s]."""
STEP, STEPS = 0.01, 100
"""Step [s], and number of steps."""
LAYER = 20
"""Steps in which L-stable methods damp the fast component; the slowest, bdf2, reduces it to 0.21**20."""
SHARE = 0.01
"""Tolerance, relative to the largest angle or velocity, if the step is too long for a bound from the order."""
GONE = 0.5 * math.log(ABSURD + 1.0)
"""Log of the growth of an amplitude at which the residual is ABSURD times the initial energy."""
FALLEN = 0.0016
"""Way under gravity and quadratic drag with c v0 h = 1e6 [rad]."""
BOUNDED = frozenset({STABLE, ACCURATE})


# --- fast damping ---------------------------------------------------------------------------------------------------


def backwards(method: Method) -> bool:
    """Return True for splittings with backward sub-steps, in which drag acts as growth (Sheng 1989; Suzuki 1991)."""
    return "reversible" in method.needs


def _flight(run: Rollout, angle: float) -> str:
    """Return the reason why a motion with the initial velocity FAST is impossible under drag; "" if it is possible."""
    if np.max(np.abs(run.velocity)) > 1.01 * FAST:
        return "it is faster than at its start"
    far = np.abs(run.angle - angle) > 1.01 * FAST * run.time + 1e-9
    return "it is further away than without drag" if np.any(far) else ""


def layered(name: str, scene: Scene, way: float, angle: float = 0.0) -> Motion:
    """Return the motion of 100 steps from an angle [rad] and the velocity FAST.

    Errors of the angle are relative to the ``way`` [rad], and those of the velocity to FAST. The solution of a method's
    equations leaves a thousand times the usual rounding.
    """
    rate = scene.omega0
    return Motion(name, scene, name, angle, FAST / rate, rate * STEP * STEPS, marks=STEPS, growth=1e3, largest=way,
                  pace=FAST / rate / way, most=1)


def _slowed(motion: Motion, judge: Callable[[Method, Rollout, Any, Any], Finding], method: Method) -> Finding:
    """Judge a method by its predicted error, and by ``judge``.

    ``judge`` takes the method, the run, and the true angle and velocity at each step.
    """
    run = ran_motion(motion, method)
    found = judge(method, run, *motion.true())
    if method.exact or not motion.foretells(method):
        return found
    return also(found, *right(followed(motion, method, run.angle, run.velocity)))


# --- linear drag ----------------------------------------------------------------------------------------------------


def linear_scene(gamma_h: float) -> Scene:
    """Return the scene of a linear pendulum with linear drag gamma, for steps h with this ``gamma h``."""
    return Scene("linear drag", effects=(SmallAngleGravity(), LinearDrag(gamma=gamma_h / STEP)))


def _linear_rule(gamma_h: float, method: Method) -> frozenset[str]:
    """Return the allowed outcomes of a method under linear drag with this ``gamma h``.

    The rule follows from a method's spectral radius and L-stability.
    """
    scene = linear_scene(gamma_h)
    grown = growth(method, scene.omega0 * STEP, STEPS, gamma_h)
    if grown > GONE + 3.0 or (method.explicit_first_stage and gamma_h > ABSURD + 1.0):
        return frozenset({DIVERGED})
    if method.l_stable or method.exact:
        return frozenset({ACCURATE})
    return BOUNDED if grown < 0.0 else BOUNDED | {DIVERGED}


def _linear(gamma_h: float) -> Case:
    """Return the case of linear drag with this ``gamma h``, against the exact damped oscillator."""
    scene, far = linear_scene(gamma_h), ANGLE + FAST * STEP / gamma_h
    motion = layered(f"linear drag, gamma h = {gamma_h:g}", scene, far, ANGLE)

    def judge(method: Method, run: Rollout, angle: Any, velocity: Any) -> Finding:
        error = np.maximum(np.abs(run.angle - angle) / far, np.abs(run.velocity - velocity) / FAST)
        if method.exact:
            return graded(error, 1e-12, "it is not exact")
        return graded(error[LAYER:], SHARE, _flight(run, ANGLE))

    return _case(motion, f"the damped oscillator. Accurate, required of L-stable methods: within 1 % after {LAYER} "
                 "steps",
                 "Landau & Lifshitz, Mechanics (1976), section 25; R(-gamma h) of each method (Hairer & Wanner 1996, "
                 "IV.3)", partial(_linear_rule, gamma_h), partial(_slowed, motion, judge))


# --- quadratic drag -------------------------------------------------------------------------------------------------


def quadratic_scene(load: float, *effects: Any) -> Scene:
    """Return a scene with quadratic drag c v² and further effects.

    The coefficient c makes the drag in one step h from the initial velocity v0 as large as ``load``: ``c v0 h = load``.
    """
    return Scene("quadratic drag", effects=(*effects, QuadraticDrag(c=load / (FAST * STEP))))


def _quadratic_rule(load: float, alone: bool, method: Method) -> frozenset[str]:
    """Return the allowed outcomes of a method under quadratic drag c v², with ``load`` = c v0 h.

    The initial velocity is v0 and the step h. ``alone`` is True if there is no gravity.
    """
    if math.isfinite(damping_limit(method)):  # all limits are below 2 load, the drag's derivative times h
        return frozenset({DIVERGED})
    if backwards(method) and load * method.furthest_back < -1.0:
        return frozenset({DIVERGED})
    if method.explicit_first_stage and load > ABSURD + 1.0:
        return frozenset({DIVERGED})
    if alone:
        return frozenset({ACCURATE}) if "split" in method.needs else BOUNDED
    return BOUNDED | {DIVERGED} if backwards(method) else BOUNDED  # after a kick, drag may run back too far


def _alone(load: float) -> Case:
    """Return the case of quadratic drag alone, with the velocity v0/(1 + c v0 t)."""
    way = math.log1p(load * STEPS) * FAST * STEP / load
    motion = layered(f"quadratic drag alone, c v0 h = {load:g}", quadratic_scene(load), way)

    def judge(method: Method, run: Rollout, _angle: Any, velocity: Any) -> Finding:
        own = 1e-13 * (1 + len(method.sub_flows)) if "split" in method.needs else SHARE
        return graded(run.velocity / velocity - 1.0, own, _flight(run, 0.0))

    return _case(motion, "v0/(1 + c v0 t), to rounding for exact drag flows. Accurate for other methods: within 1 %",
                 "Bernoulli's equation, separated; growth: Hairer & Wanner 1996, IV.12",
                 partial(_quadratic_rule, load, True), partial(_slowed, motion, judge))


def _under_gravity() -> Case:
    """Return the case of gravity and quadratic drag c v² with c v0 h = 1e6, against the reference solution."""
    motion = layered("quadratic drag and gravity, c v0 h = 1e6", quadratic_scene(1e6, Gravity()), FALLEN)

    def judge(method: Method, run: Rollout, angle: Any, _velocity: Any) -> Finding:
        way = float(np.max(np.abs(angle)))
        return graded(run.angle - angle, SHARE * way, _flight(run, 0.0), size=way)

    return _case(motion, "two high-order solutions that agree. Accurate: within 1 % of the way",
                 "Taylor series in 40 digits with adaptive steps, and truth/reference.py: Gragg 1965 and Dormand & "
                 "Prince's order 8",
                 partial(_quadratic_rule, 1e6, False), partial(_slowed, motion, judge))


# --- creep ----------------------------------------------------------------------------------------------------------

CREEP = 2.0
"""Duration of the creep, times its rate lambda = omega0**2/gamma."""
HIGH = 2.0
"""Initial angle of the creep [rad]."""


def creep(slow_time: Any) -> Any:
    """Return the angle [rad] of slow creep under strong drag, at ``slow_time`` = lambda t.

    It solves theta' = -lambda sin(theta): ``tan(theta/2) = tan(HIGH/2) exp(-lambda t)``.
    """
    return 2.0 * np.arctan(math.tan(0.5 * HIGH) * np.exp(-slow_time))


def _creep(stiffness: float, steps: int) -> Case:
    """Return the case of slow creep under strong drag, against the closed form.

    ``stiffness`` is gamma/omega0. The rule follows from a method's spectral radius and its kind.
    """
    omega0, slow_step = Scene("creep", effects=(Gravity(),)).omega0, CREEP / steps
    scene = Scene("creep", effects=(Gravity(), LinearDrag(gamma=stiffness * omega0)))
    product, slow = slow_step * stiffness, omega0 / stiffness

    def may(method: Method) -> frozenset[str]:
        if growth(method, product, steps, product * stiffness) > GONE + 12.0:
            return frozenset({DIVERGED})
        if "split" not in method.needs:
            return frozenset({ACCURATE})
        if product > 50.0:  # a kick adds up to (omega0 h)**2/2 m g L of energy, which becomes heat
            return frozenset({DIVERGED})
        return BOUNDED | {DIVERGED} if backwards(method) else BOUNDED

    def attempt(method: Method) -> Finding:
        run = ran(scene, method, dt=slow_step / slow, steps=steps, angle=HIGH, velocity=-slow * math.sin(HIGH))
        own = slow_step * CREEP + 2.0 * stiffness**-2 * (1.0 + CREEP)
        falls = np.all(np.diff(run.angle) <= 1e-12) and run.angle[-1] >= -1e-12
        return graded(run.angle - creep(slow * run.time), own, "" if falls else "it does not creep down", size=HIGH)

    return Case(f"creep, gamma h = {CREEP / steps * stiffness**2:g}", GROUP,
                "The fast component of the motion decays at once; the slow one must be right in steps that are too "
                "long to resolve the fast one.",
                "tan(theta/2) decays as exp(-lambda t), lambda = omega0²/gamma. Accurate: within lambda h lambda t. "
                "Stable: the bob always falls and stops at the bottom. In splittings it falls freely for a step before "
                "drag acts, gamma h/2 times too fast",
                "theta' = -lambda sin(theta), separated; the next term of the slow manifold is (omega0/gamma)**2 of it "
                "(Hairer & Wanner 1996, VI.3)", scene, _fitting(scene, may), attempt)


# --- the cases ------------------------------------------------------------------------------------------------------


def _fitting(scene: Scene, may: Rule) -> Rule:
    """Return a rule by which methods whose needs the scene does not meet must be refused."""
    offered = offers(scene)
    return lambda method: may(method) if method.needs <= offered else frozenset({REFUSED})


def _case(motion: Motion, truth: str, source: str, may: Rule, attempt: Try) -> Case:
    """Return a hard case of fast damping."""
    return Case(
        motion.name, GROUP,
        "Drag acts far faster than a step: explicit methods overshoot and grow, which must be reported as divergence.",
        f"{truth}. Stable: never faster than at its start, never further away than without drag; the error is that of "
        "the method's formula. Diverged: explicit methods beyond their stability limit, methods with backward "
        "sub-steps that amplify, and methods whose heat by the trapezoidal rule becomes absurd",
        source, motion.scene, _fitting(motion.scene, may), attempt, motion=motion)


LINEAR_LOADS, LOADS = (1.5, 10.0, 1e3, 1e6), (10.0, 1e3, 1e6)
"""Values of gamma h for linear drag, and of c v0 h for quadratic drag."""
CREEPS = ((1e2, 400), (1e4, 200))
"""gamma/omega0 and number of steps of each creep; gamma h is 50 and 1e6."""

CASES = (
    *map(_linear, LINEAR_LOADS), *map(_alone, LOADS), _under_gravity(),
    *(_creep(stiffness, steps) for stiffness, steps in CREEPS),
)

_UPWARDS = (
    "backward sub-steps amplify each kick to a jump of up to a radian, which the sine limits, and the heat is "
    "negative: the bob settles upright, or rises before it falls; the limit of gamma h is between 7 and 18"
)
_OVERSHOOT = (
    "its first acceleration is -gamma v0, which with the weight h²/3 moves the bob back by 1.2 v0 h in the first step; "
    "in the end it is gamma h v0 h/12 away from the truth"
)
KNOWN = {
    **{("creep, gamma h = 50", name): _UPWARDS
       for name in ("ruth3", "mclachlan_s5", "blanes_moan_s6", "mclachlan_sb3a5", "blanes_moan_srkn6b")},
    ("linear drag, gamma h = 10", "newmark_linear"): _OVERSHOOT,
    ("quadratic drag alone, c v0 h = 10", "newmark_linear"): _OVERSHOOT,
}
"""(case, method) -> reason of a known failure, and what the method does instead."""
