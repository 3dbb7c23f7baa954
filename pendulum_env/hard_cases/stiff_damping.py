"""Hard cases: damping far faster than the step, and slow creep under strong damping.

The runs with fast damping start with a velocity of 1e4 rad/s.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from integrators import Method
from integrators.analysis import damping_limit, spectral_radius
from pendulum_env.engine.machine import offers
from pendulum_env.engine.rollout import Rollout
from pendulum_env.hard_cases.case import (
    ACCURATE,
    DIVERGED,
    REFUSED,
    STABLE,
    WRONG,
    Bound,
    Case,
    Finding,
    Rule,
    Try,
    also,
    judged,
    named,
    ran,
)
from pendulum_env.hard_cases.predicted import Motion, foretold, held, unmet
from pendulum_env.physics import exact
from pendulum_env.physics.effects import Gravity, LinearDrag, QuadraticDrag, SmallAngleGravity
from pendulum_env.physics.energy import ABSURD
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.answer import Truth
from pendulum_env.truth.reference import reference
from pendulum_env.truth.steps import Equation, table_mismatch

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
BOUNDED = frozenset({STABLE, ACCURATE})


# --- kinds of methods -----------------------------------------------------------------------------------------------


def backwards(method: Method) -> bool:
    """Return True for splittings with backward sub-steps, in which drag acts as growth (Sheng 1989; Suzuki 1991)."""
    return "reversible" in method.needs


def growth(method: Method, product: float, gamma_h: float, steps: int) -> float:
    """Return the logarithm of a method's growth of the damped oscillator's amplitude in ``steps`` steps."""
    radius = spectral_radius(named(method), product, gamma_h)
    return steps * math.log(radius) if 0.0 < radius < math.inf else radius or -math.inf


def checked(finding: Finding, unlike: Callable[[], str]) -> Finding:
    """Return the result of a run, changed to WRONG if the function ``unlike`` returns a reason.

    ``unlike`` is called only for complete runs; it returns why the run is wrong, or "".
    """
    why = unlike() if finding.outcome in (STABLE, ACCURATE) else ""
    return replace(finding, outcome=WRONG, note=why) if why else finding


# --- linear drag ----------------------------------------------------------------------------------------------------


def linear_scene(gamma_h: float) -> Scene:
    """Return the scene of a linear pendulum with linear drag gamma, for steps h with this ``gamma h``."""
    return Scene("linear drag", effects=(SmallAngleGravity(), LinearDrag(gamma=gamma_h / STEP)))


def _linear_rule(gamma_h: float) -> Rule:
    """Return the rule of allowed outcomes under linear drag with this ``gamma h``.

    The rule follows from a method's spectral radius and L-stability.
    """
    scene = linear_scene(gamma_h)

    def may(method: Method) -> frozenset[str]:
        grown = growth(method, scene.omega0 * STEP, gamma_h, STEPS)
        if grown > GONE + 3.0 or (method.explicit_first_stage and gamma_h > ABSURD + 1.0):
            return frozenset({DIVERGED})
        if method.l_stable or method.exact:
            return frozenset({ACCURATE})
        return BOUNDED if grown < 0.0 else BOUNDED | {DIVERGED}

    return may


def layered(gamma_h: float) -> str:
    """Return the name of the case of linear drag with this ``gamma h``."""
    return f"linear drag, gamma h = {gamma_h:g}"


def _layer(gamma_h: float) -> Motion:
    """Return the motion under linear drag with this ``gamma h``; errors are relative to the way in the fast layer."""
    scene = linear_scene(gamma_h)
    far, rate = ANGLE + FAST * STEP / gamma_h, scene.omega0
    return Motion(f"linear drag of {gamma_h:g}", ANGLE, FAST / rate, rate * STEP * STEPS, marks=STEPS, largest=far,
                  pace=FAST / rate / far, most=1, lacks=unmet(scene))


MOTIONS = {layered(gamma_h): _layer(gamma_h) for gamma_h in (1.5, 10.0)}
"""Motions with predicted errors."""


def _flight(run: Rollout, angle: float) -> str:
    """Return the reason why a motion with the initial velocity FAST is impossible under drag; "" if it is possible."""
    if np.max(np.abs(run.velocity)) > 1.01 * FAST:
        return "it is faster than at its start"
    far = np.abs(run.angle - angle) > 1.01 * FAST * run.time + 1e-9
    return "it is further away than without drag" if np.any(far) else ""


def _linear(gamma_h: float) -> Try:
    """Return a function that judges a method under linear drag.

    The run is compared with the exact damped oscillator and with the steps that the method's table implies.
    """
    scene, name = linear_scene(gamma_h), layered(gamma_h)

    def attempt(method: Method) -> Finding:
        run = ran(scene, method, dt=STEP, steps=STEPS, angle=ANGLE, velocity=FAST)
        angle, velocity = exact.linear(run.time, ANGLE, FAST, scene.omega0, gamma_h / STEP)
        far = (run.angle - angle) / (ANGLE + FAST * STEP / gamma_h)
        error = np.maximum(np.abs(far), np.abs(run.velocity - velocity) / FAST)
        if method.exact:
            return judged(run, error, 1e-12, "it is not exact")
        bounds: tuple[Bound, ...] = ()
        if foretold(name, method):
            formula = held(name, MOTIONS[name], method, error)
            if formula.outcome == WRONG:
                return formula
            bounds = formula.bounds
        finding = also(judged(run, error[LAYER:] if len(error) > LAYER else error, SHARE, _flight(run, ANGLE)),
                       *bounds)
        problem = Equation((scene.omega0 * STEP) ** 2, gamma_h, small=True)
        return checked(finding, lambda: table_mismatch(named(method), problem, run.angle, run.velocity * STEP))

    return attempt


# --- quadratic drag -------------------------------------------------------------------------------------------------


def quadratic_scene(load: float, *effects: Any) -> Scene:
    """Return a scene with quadratic drag c v² and further effects.

    The coefficient c makes the drag in one step h from the initial velocity v0 as large as ``load``: ``c v0 h = load``.
    """
    return Scene("quadratic drag", effects=(*effects, QuadraticDrag(c=load / (FAST * STEP))))


def _quadratic_rule(load: float, alone: bool) -> Rule:
    """Return the rule of allowed outcomes under quadratic drag c v², with ``load`` = c v0 h.

    The initial velocity is v0 and the step h. ``alone`` is True if there is no gravity.
    """

    def may(method: Method) -> frozenset[str]:
        if math.isfinite(damping_limit(method)):  # all limits are below 2 load, the drag's derivative times h
            return frozenset({DIVERGED})
        if backwards(method) and load * method.furthest_back < -1.0:
            return frozenset({DIVERGED})
        if method.explicit_first_stage and load > ABSURD + 1.0:
            return frozenset({DIVERGED})
        if alone:
            return frozenset({ACCURATE}) if "split" in method.needs else BOUNDED
        return BOUNDED | {DIVERGED} if backwards(method) else BOUNDED  # after a kick, drag may run back too far

    return may


def _alone(load: float) -> Try:
    """Return a function that judges a method under quadratic drag alone, with the velocity v0/(1 + c v0 t)."""
    scene = quadratic_scene(load)

    def attempt(method: Method) -> Finding:
        run = ran(scene, method, dt=STEP, steps=STEPS, angle=0.0, velocity=FAST)
        _, velocity = exact.drag_only(run.time, FAST, 0.0, load / (FAST * STEP))
        own = 1e-13 * (1 + len(method.sub_flows)) if "split" in method.needs else SHARE
        finding = judged(run, run.velocity / velocity - 1.0, own, _flight(run, 0.0))
        problem = Equation(0.0, load / (FAST * STEP), 2)
        return checked(finding, lambda: table_mismatch(named(method), problem, run.angle, run.velocity * STEP))

    return attempt


@lru_cache(maxsize=4)
def falling_truth(load: float) -> Truth:
    """Return the reference solution under gravity and quadratic drag c v², with ``load`` = c v0 h."""
    return reference(quadratic_scene(load, Gravity()), 0.0, FAST, STEP * np.arange(STEPS + 1))


def _under_gravity(load: float) -> Try:
    """Return a function that judges a method under gravity and quadratic drag c v², with ``load`` = c v0 h.

    The run is compared with the reference solution and with the steps that the method's table implies.
    """
    scene = quadratic_scene(load, Gravity())

    def attempt(method: Method) -> Finding:
        run = ran(scene, method, dt=STEP, steps=STEPS, angle=0.0, velocity=FAST)
        truth = falling_truth(load).angle
        way = float(np.max(np.abs(truth)))
        finding = judged(run, run.angle - truth[: len(run.angle)], SHARE * way, _flight(run, 0.0), size=way)
        problem = Equation((scene.omega0 * STEP) ** 2, load / (FAST * STEP), 2)
        return checked(finding, lambda: table_mismatch(named(method), problem, run.angle, run.velocity * STEP))

    return attempt


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


def _creep_scene(stiffness: float) -> Scene:
    """Return a scene with gravity and linear drag of the rate gamma = ``stiffness`` omega0."""
    free = Scene("creep", effects=(Gravity(),))
    return Scene("creep", effects=(Gravity(), LinearDrag(gamma=stiffness * free.omega0)))


def _creep_rule(stiffness: float, steps: int) -> Rule:
    """Return the rule of allowed outcomes for slow creep under strong drag, in a number of steps.

    The rule follows from a method's spectral radius and its kind.
    """
    product = CREEP / steps * stiffness
    gamma_h = product * stiffness

    def may(method: Method) -> frozenset[str]:
        if growth(method, product, gamma_h, steps) > GONE + 12.0:
            return frozenset({DIVERGED})
        if "split" not in method.needs:
            return frozenset({ACCURATE})
        if product > 50.0:  # a kick adds up to (omega0 h)**2/2 m g L of energy, which becomes heat
            return frozenset({DIVERGED})
        return BOUNDED | {DIVERGED} if backwards(method) else BOUNDED

    return may


def _creep(stiffness: float, steps: int) -> Try:
    """Return a function that judges a method on slow creep under strong drag, against the closed form.

    ``stiffness`` is gamma/omega0.
    """
    scene, slow_step = _creep_scene(stiffness), CREEP / steps

    def attempt(method: Method) -> Finding:
        slow = scene.omega0 / stiffness
        run = ran(scene, method, dt=slow_step / slow, steps=steps, angle=HIGH, velocity=-slow * math.sin(HIGH))
        own = slow_step * CREEP + 2.0 * stiffness**-2 * (1.0 + CREEP)
        falls = np.all(np.diff(run.angle) <= 1e-12) and run.angle[-1] >= -1e-12
        wrong = "" if falls else "it does not creep down"
        return judged(run, run.angle - creep(slow * run.time), own, wrong, size=HIGH)

    return attempt


# --- the cases ------------------------------------------------------------------------------------------------------

FASTER = "Drag acts far faster than a step: explicit methods overshoot and grow, which must be reported as divergence."
SLOWLY = ("The fast component of the motion decays at once; the slow one must be right in steps that are too long to "
          "resolve the fast one.")
RIGID = ("Stable: never faster than at its start, never further away than without drag, slowed down as the method's "
         "table implies. Diverged: explicit methods beyond their stability limit, methods with backward sub-steps that "
         "amplify, and methods whose heat by the trapezoidal rule becomes absurd")
LANDAU = "Landau & Lifshitz, Mechanics (1976), section 25; R(-gamma h) of each method (Hairer & Wanner 1996, IV.3)"
BERNOULLI = "Bernoulli's equation, separated; growth: Hairer & Wanner 1996, IV.12"
MANIFOLD = "theta' = -lambda sin(theta), separated; the next term of the slow manifold is (omega0/gamma)**2 of it " \
           "(Hairer & Wanner 1996, VI.3)"


def _case(name: str, why: str, truth: str, source: str, scene: Scene, may: Rule, attempt: Try) -> Case:
    """Return a hard case of the group of stiff damping; methods whose needs are not met must be refused."""
    offered = offers(scene)

    def of_fitting(method: Method) -> frozenset[str]:
        return may(method) if method.needs <= offered else frozenset({REFUSED})

    motion = name if name in MOTIONS else ""
    return Case(name, GROUP, why, truth, source, scene, of_fitting, attempt, motion=motion)


LINEAR_LOADS, LOADS = (1.5, 10.0, 1e3, 1e6), (10.0, 1e3, 1e6)
"""Values of gamma h for linear drag, and of c v0 h for quadratic drag."""
CREEPS = ((1e2, 400), (1e4, 200))
"""gamma/omega0 and number of steps of each creep; gamma h is 50 and 1e6."""

CASES = (
    *(
        _case(layered(load), FASTER,
              f"the damped oscillator. Accurate, required of L-stable methods: within 1 % after {LAYER} steps. {RIGID}",
              LANDAU, linear_scene(load), _linear_rule(load), _linear(load))
        for load in LINEAR_LOADS
    ),
    *(
        _case(f"quadratic drag alone, c v0 h = {load:g}", FASTER,
              f"v0/(1 + c v0 t), to rounding for exact drag flows. Accurate for other methods: within 1 %. {RIGID}",
              BERNOULLI, quadratic_scene(load), _quadratic_rule(load, True), _alone(load))
        for load in LOADS
    ),
    _case("quadratic drag and gravity, c v0 h = 1e6", FASTER,
          f"two high-order solutions that agree. Accurate: within 1 % of the way. {RIGID}",
          "truth/reference.py: Gragg 1965 and Dormand & Prince's order 8, with adaptive steps",
          quadratic_scene(1e6, Gravity()), _quadratic_rule(1e6, False), _under_gravity(1e6)),
    *(
        _case(f"creep, gamma h = {CREEP / steps * stiffness**2:g}", SLOWLY,
              "tan(theta/2) decays as exp(-lambda t), lambda = omega0²/gamma. Accurate: within lambda h lambda t. "
              "Stable: the bob always falls and stops at the bottom. In splittings it falls freely for a step before "
              "drag acts, gamma h/2 times too fast", MANIFOLD, _creep_scene(stiffness),
              _creep_rule(stiffness, steps), _creep(stiffness, steps))
        for stiffness, steps in CREEPS
    ),
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
