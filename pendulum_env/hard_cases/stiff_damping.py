"""Hard cases: damping far faster than the step, from 1e4 rad/s, and creep under it."""

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
    Case,
    Finding,
    Rule,
    Try,
    judged,
    ran,
)
from pendulum_env.physics import exact
from pendulum_env.physics.effects import Gravity, LinearDrag, QuadraticDrag, SmallAngleGravity
from pendulum_env.physics.energy import ABSURD
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.answer import Truth
from pendulum_env.truth.reference import reference
from pendulum_env.truth.steps import Equation, unlike_own

GROUP = "stiff damping"
ANGLE, FAST = 0.5, 1e4
"""Start [rad, rad/s]."""
STEP, STEPS = 0.01, 100
"""[s], and how many."""
LAYER = 20
"""Steps in which an L-stable method forgets the fast part: the slowest here, bdf2, leaves 0.21**20 of it."""
SHARE = 0.01
"""Error of the motion that counts as accurate where no order rules, its largest angle or velocity being 1."""
GONE = 0.5 * math.log(ABSURD + 1.0)
"""Log of the growth of an amplitude at which the residual is ABSURD times the energy at the start."""
BOUNDED = frozenset({STABLE, ACCURATE})


# --- kinds of methods -----------------------------------------------------------------------------------------------


def backwards(method: Method) -> bool:
    """True for splittings with sub-steps backwards, in which drag amplifies (Sheng 1989; Suzuki 1991)."""
    return "reversible" in method.needs


def growth(method: Method, product: float, gamma_h: float, steps: int) -> float:
    """Log of what an amplitude of the damped oscillator grows by in so many steps."""
    radius = spectral_radius(method, product, gamma_h)
    return steps * math.log(radius) if 0.0 < radius < math.inf else radius or -math.inf


def checked(finding: Finding, unlike: Callable[[], str]) -> Finding:
    """Return the finding, or WRONG with the reason that ``unlike`` gives for a run that did not stop."""
    why = unlike() if finding.outcome in (STABLE, ACCURATE) else ""
    return replace(finding, outcome=WRONG, note=why) if why else finding


# --- linear drag ----------------------------------------------------------------------------------------------------


def linear_scene(gamma_h: float) -> Scene:
    return Scene("linear drag", effects=(SmallAngleGravity(), LinearDrag(gamma=gamma_h / STEP)))


def _linear_rule(gamma_h: float) -> Rule:
    scene = linear_scene(gamma_h)

    def may(method: Method) -> frozenset[str]:
        grown = growth(method, scene.omega0 * STEP, gamma_h, STEPS)
        if grown > GONE + 3.0 or (method.explicit_first_stage and gamma_h > ABSURD + 1.0):
            return frozenset({DIVERGED})
        if method.l_stable or method.exact:
            return frozenset({ACCURATE})
        return BOUNDED if grown < 0.0 else BOUNDED | {DIVERGED}

    return may


def _flight(run: Rollout, angle: float) -> str:
    """Why a motion is impossible under drag from FAST [rad/s]; "" if it is possible."""
    if np.max(np.abs(run.velocity)) > 1.01 * FAST:
        return "it is faster than at its start"
    far = np.abs(run.angle - angle) > 1.01 * FAST * run.time + 1e-9
    return "it is further away than without drag" if np.any(far) else ""


def _linear(gamma_h: float) -> Try:
    scene = linear_scene(gamma_h)

    def attempt(method: Method) -> Finding:
        run = ran(scene, method, dt=STEP, steps=STEPS, angle=ANGLE, velocity=FAST)
        angle, velocity = exact.linear(run.time, ANGLE, FAST, scene.omega0, gamma_h / STEP)
        far = (run.angle - angle) / (ANGLE + FAST * STEP / gamma_h)
        error = np.maximum(np.abs(far), np.abs(run.velocity - velocity) / FAST)
        if method.exact:
            return judged(run, error, 1e-12, "it is not exact")
        finding = judged(run, error[LAYER:] if len(error) > LAYER else error, SHARE, _flight(run, ANGLE))
        problem = Equation((scene.omega0 * STEP) ** 2, gamma_h, small=True)
        return checked(finding, lambda: unlike_own(method, problem, run.angle, run.velocity * STEP))

    return attempt


# --- quadratic drag -------------------------------------------------------------------------------------------------


def quadratic_scene(load: float, *effects: Any) -> Scene:
    """Quadratic drag with ``c v0 h = load``, and what else acts."""
    return Scene("quadratic drag", effects=(*effects, QuadraticDrag(c=load / (FAST * STEP))))


def _quadratic_rule(load: float, alone: bool) -> Rule:
    def may(method: Method) -> frozenset[str]:
        if math.isfinite(damping_limit(method)):  # below twice the load: drag grows by 2 c v with the velocity
            return frozenset({DIVERGED})
        if backwards(method) and load * method.furthest_back < -1.0:
            return frozenset({DIVERGED})
        if method.explicit_first_stage and load > ABSURD + 1.0:
            return frozenset({DIVERGED})
        if alone:
            return frozenset({ACCURATE}) if "split" in method.needs else BOUNDED
        return BOUNDED | {DIVERGED} if backwards(method) else BOUNDED  # from a kick drag runs further back than it came

    return may


def _alone(load: float) -> Try:
    """The velocity, v0/(1 + c v0 t): to rounding where drag's flow is exact."""
    scene = quadratic_scene(load)

    def attempt(method: Method) -> Finding:
        run = ran(scene, method, dt=STEP, steps=STEPS, angle=0.0, velocity=FAST)
        _, velocity = exact.drag_only(run.time, FAST, 0.0, load / (FAST * STEP))
        own = 1e-13 * (1 + len(method.sub_flows)) if "split" in method.needs else SHARE
        finding = judged(run, run.velocity / velocity - 1.0, own, _flight(run, 0.0))
        problem = Equation(0.0, load / (FAST * STEP), 2)
        return checked(finding, lambda: unlike_own(method, problem, run.angle, run.velocity * STEP))

    return attempt


@lru_cache(maxsize=4)
def falling_truth(load: float) -> Truth:
    return reference(quadratic_scene(load, Gravity()), 0.0, FAST, STEP * np.arange(STEPS + 1))


def _under_gravity(load: float) -> Try:
    scene = quadratic_scene(load, Gravity())

    def attempt(method: Method) -> Finding:
        run = ran(scene, method, dt=STEP, steps=STEPS, angle=0.0, velocity=FAST)
        truth = falling_truth(load).angle[: len(run.angle)]
        finding = judged(run, run.angle - truth, SHARE, _flight(run, 0.0))
        problem = Equation((scene.omega0 * STEP) ** 2, load / (FAST * STEP), 2)
        return checked(finding, lambda: unlike_own(method, problem, run.angle, run.velocity * STEP))

    return attempt


# --- creep ----------------------------------------------------------------------------------------------------------

CREEP = 2.0
"""So many times the slow rate lambda = omega0**2/gamma the creep is followed."""
HIGH = 2.0
"""Its start [rad]."""


def creep(slow_time: Any) -> Any:
    """``tan(theta/2) = tan(HIGH/2) exp(-lambda t)``, which solves theta' = -lambda sin(theta) [rad]."""
    return 2.0 * np.arctan(math.tan(0.5 * HIGH) * np.exp(-slow_time))


def _creep_scene(stiffness: float) -> Scene:
    """Under gamma = ``stiffness`` omega0."""
    free = Scene("creep", effects=(Gravity(),))
    return Scene("creep", effects=(Gravity(), LinearDrag(gamma=stiffness * free.omega0)))


def _creep_rule(stiffness: float, steps: int) -> Rule:
    product = CREEP / steps * stiffness
    gamma_h = product * stiffness

    def may(method: Method) -> frozenset[str]:
        if growth(method, product, gamma_h, steps) > GONE + 12.0:
            return frozenset({DIVERGED})
        if "split" not in method.needs:
            return frozenset({ACCURATE})
        if product > 50.0:  # a kick is worth (omega0 h)**2/2 m g L times its share squared, which drag turns to heat
            return frozenset({DIVERGED})
        return BOUNDED | {DIVERGED} if backwards(method) else BOUNDED

    return may


def _creep(stiffness: float, steps: int) -> Try:
    scene, slow_step = _creep_scene(stiffness), CREEP / steps

    def attempt(method: Method) -> Finding:
        slow = scene.omega0 / stiffness
        run = ran(scene, method, dt=slow_step / slow, steps=steps, angle=HIGH, velocity=-slow * math.sin(HIGH))
        own = slow_step * CREEP + 2.0 * stiffness**-2 * (1.0 + CREEP)
        falls = np.all(np.diff(run.angle) <= 1e-12) and run.angle[-1] >= -1e-12
        return judged(run, run.angle - creep(slow * run.time), own, "" if falls else "it does not creep down")

    return attempt


# --- the cases ------------------------------------------------------------------------------------------------------

FASTER = "Drag acts far faster than a step: what explicit steps overshoot grows, and must be named."
SLOWLY = "The fast part is gone at once, and the slow one must come out right in steps that do not see the fast one."
RIGID = ("Stable: never faster than at its start, never further away than without drag, slowed down as the method's "
         "own equation says. Diverged: explicit methods beyond their interval, sub-steps back that amplify, and where "
         "heat by the trapezoidal rule is beyond sense")
LANDAU = "Landau & Lifshitz, Mechanics (1976), section 25; R(-gamma h) of each method (Hairer & Wanner 1996, IV.3)"
BERNOULLI = "Bernoulli's equation, separated; growth: Hairer & Wanner 1996, IV.12"
MANIFOLD = "theta' = -lambda sin(theta), separated; the next term of the slow manifold is (omega0/gamma)**2 of it " \
           "(Hairer & Wanner 1996, VI.3)"


def _case(name: str, why: str, truth: str, source: str, scene: Scene, may: Rule, attempt: Try) -> Case:
    offered = offers(scene)

    def of_fitting(method: Method) -> frozenset[str]:
        return may(method) if method.needs <= offered else frozenset({REFUSED})

    return Case(name, GROUP, why, truth, source, scene, of_fitting, attempt)


LINEAR_LOADS, LOADS = (1.5, 10.0, 1e3, 1e6), (10.0, 1e3, 1e6)
"""gamma h, and c v0 h."""
CREEPS = ((1e2, 400), (1e4, 200))
"""gamma/omega0, and in how many steps: gamma h is 50, then 1e6."""

CASES = (
    *(
        _case(f"linear drag, gamma h = {load:g}", FASTER,
              f"the damped oscillator; accurate, as L-stable methods must be: within 1 % after {LAYER} steps. {RIGID}",
              LANDAU, linear_scene(load), _linear_rule(load), _linear(load))
        for load in LINEAR_LOADS
    ),
    *(
        _case(f"quadratic drag alone, c v0 h = {load:g}", FASTER,
              f"v0/(1 + c v0 t), to rounding by exact drag flows; accurate by others: within 1 % always. {RIGID}",
              BERNOULLI, quadratic_scene(load), _quadratic_rule(load, True), _alone(load))
        for load in LOADS
    ),
    _case("quadratic drag and gravity, c v0 h = 1e6", FASTER,
          f"two high-order solutions that agree; accurate: within 0.01 rad. {RIGID}",
          "truth/reference.py: Gragg 1965 and Dormand & Prince's order 8, adapted to the layer",
          quadratic_scene(1e6, Gravity()), _quadratic_rule(1e6, False), _under_gravity(1e6)),
    *(
        _case(f"creep, gamma h = {CREEP / steps * stiffness**2:g}", SLOWLY,
              "tan(theta/2) falls as exp(-lambda t), lambda = omega0²/gamma; accurate within lambda h lambda t. "
              "Stable: it falls all the time and stops at the bottom, as splittings do, whose bob falls for a step "
              "before drag acts, gamma h/2 times too fast", MANIFOLD, _creep_scene(stiffness),
              _creep_rule(stiffness, steps), _creep(stiffness, steps))
        for stiffness, steps in CREEPS
    ),
)

_UPWARDS = (
    "sub-steps back amplify each kick, to a jump of a radian or less that the sine keeps from growing, and its heat is "
    "negative: it settles upright, or rises before it falls; its limit of gamma h is between 7 and 18 there"
)
_OVERSHOOT = (
    "its acceleration begins with the force's, -gamma v0, of which h²/3 is a way: the first step throws it back by 1.2 "
    "flights v0 h, and all of them together end gamma h v0 h/12 from the truth"
)
KNOWN = {
    **{("creep, gamma h = 50", name): _UPWARDS
       for name in ("ruth3", "mclachlan_s5", "blanes_moan_s6", "mclachlan_sb3a5", "blanes_moan_srkn6b")},
    ("linear drag, gamma h = 10", "newmark_linear"): _OVERSHOOT,
    ("quadratic drag alone, c v0 h = 10", "newmark_linear"): _OVERSHOOT,
}
"""(case, method) -> why it fails, and what it does instead."""
