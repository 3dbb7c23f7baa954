"""Hard cases: the smallest and largest numbers of double precision as velocities, sizes, strengths and angles."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from integrators import Method
from integrators.analysis import damping_limit
from pendulum_env.engine.rollout import Rollout
from pendulum_env.hard_cases.case import (
    ACCURATE,
    DIVERGED,
    EARTH,
    REFUSED,
    STABLE,
    WRONG,
    Bound,
    Case,
    Finding,
    Rule,
    Try,
    also,
    always,
    demand,
    every,
    followed,
    foreseen,
    graded,
    ran,
    ran_motion,
    run_of,
    stopped,
    unit,
)
from pendulum_env.hard_cases.magnitudes import RIGHT, pendulum, similar
from pendulum_env.hard_cases.predicted import TRUTHS, Motion, stored
from pendulum_env.physics import exact
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import (
    BearingFriction,
    CoulombFriction,
    Effect,
    Gravity,
    LinearDrag,
    PeriodicTorque,
    QuadraticDrag,
    SphereDrag,
    VerticalDrive,
    Wind,
    WireDrag,
)
from pendulum_env.physics.medium import Medium
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError
from pendulum_env.truth.bounds import order_bound, rounding

GROUP = "extremes"
KNOWN = {
    ("linear drag of 1e300", "newmark_linear"):
        "its accelerations change sign in each step, as drag only makes their mean zero, so that the angle swings by "
        "g h²/(6 L) of the initial acceleration",
}
"""(case, method) -> reason of a known failure, and what the method does instead."""
RATE = math.sqrt(EARTH)
"""omega0 of a pendulum of 1 m [rad/s]."""


# --- pushed at the top ----------------------------------------------------------------------------------------------

GAP = 1.2246467991473532e-16
"""Distance of the angle float(pi) from the top [rad]."""
PUSHES = (1e-15, 1e-300)
"""Velocities at float(pi), towards the top [rad/s]. The bob passes the top if v/omega0 exceeds GAP, about."""
PRODUCT = 0.1
"""omega0 h of pushes at the top."""
FINER = {1: 64, 2: 4}
"""Order -> number of times as many steps, so that the error of a step of low order is also small."""
MASS, RADIUS, DENSITY, VISCOSITY = 0.01, 0.02, 1.2, 1.8e-5
"""Mass [kg] and radius [m] of the bob; density [kg/m³] and viscosity [Pa s] of the air."""
AIR = Medium("air", DENSITY, VISCOSITY)
THICKNESS = 0.002
"""Diameter of the rod [m]."""
GAMMA, DRAG = 0.5, 0.3
"""Rate of linear drag [1/s], and coefficient of quadratic drag [1/rad]."""
STRIDE = 20
"""Steps between two comparisons."""


def _falling(*drags: Effect) -> Scene:
    """Return a pendulum of 1 m in air with these kinds of damping."""
    return Scene("pushed at the top", Body(length=1.0, mass=MASS, radius=RADIUS, thickness=THICKNESS),
                 AIR, gravity=EARTH, effects=(Gravity(), *drags))


DAMPINGS: dict[str, tuple[Effect, ...]] = {
    "no damping": (),
    "linear drag": (LinearDrag(gamma=GAMMA),),
    "quadratic drag": (QuadraticDrag(c=DRAG),),
    "both drags": (LinearDrag(gamma=GAMMA), QuadraticDrag(c=DRAG)),
    "a bearing's friction": (BearingFriction(bearing_viscosity=GAMMA * MASS),),
    "a sphere's drag": (SphereDrag(law="schiller_naumann"),),
    "a wire's drag": (WireDrag(),),
}
"""Effects of each kind of damping."""


def _pushed(name: str, method: Method) -> Finding:
    """Judge a method on a bob that is pushed at the top, under one kind of damping.

    TRUTHS holds the distance from the top in units of GAP, and its rate over omega0, every STRIDE steps. The bob has to
    fall to the right side at the right time for each velocity of PUSHES.
    """
    finer, findings = FINER.get(method.order, 1), []
    for push in PUSHES:
        first = (1.0, -push / GAP / RATE)
        tilt, rate = (np.array([x, *rest]) for x, rest in zip(
            first, stored(TRUTHS)[f"pushed at the top, {name}, {push:g} rad/s"], strict=True))
        steps = STRIDE * (len(tilt) - 1)
        run = ran(_falling(*DAMPINGS[name]), method, dt=PRODUCT / RATE / finer, steps=steps * finer,
                  every=STRIDE * finer, angle=math.pi, velocity=push)
        found, speed = (math.pi - run.angle + GAP) / GAP, -run.velocity / RATE / GAP
        # While the tilt is below an ulp of pi, the angle shows nothing of it; the velocity does.
        seen = np.abs(tilt) * GAP > 1e-6
        size = np.abs(tilt) + np.abs(rate)
        missed = np.concatenate([(speed - rate) / size, ((found - tilt) / size)[seen]])
        own, phase = min((PRODUCT / finer) ** method.order, 1.0), PRODUCT * steps
        allowed = math.expm1((phase + 3.0) * own) + rounding(method) * phase * finer + 1e-9
        demand(found[-1] * tilt[-1] > 0.0, f"pushed with {push:g} rad/s, it falls to the other side",
               float(np.max(np.abs(missed))), allowed)
        findings.append(graded(missed, allowed, f"pushed with {push:g} rad/s, it falls at another time", of="the tilt"))
    return every(*findings)


STICKY = _falling(CoulombFriction(0.01 * MASS))


def _stuck(method: Method) -> Finding:
    """Judge a method on a bob that is pushed at the top under dry friction, which stops it within 1e-13 s.

    The way is less than v²/(2 limit) = 5e-29 rad, so that the angle must stay float(pi) to rounding.
    """
    runs = [ran(STICKY, method, dt=PRODUCT / RATE, steps=100, angle=math.pi, velocity=push) for push in PUSHES]
    demand(not any(np.any(run.velocity[1:]) for run in runs), "it does not come to rest in the first step")
    return graded([run.angle - math.pi for run in runs], 1e-15, "it falls although dry friction holds it", size=math.pi)


# --- sizes of 1e-300 and 1e300 --------------------------------------------------------------------------------------


_sized = partial(pendulum, powered=True, name="extreme sizes")
USUAL = _sized()


def _run(method: Method, **size: float) -> Rollout:
    """Run a method from rest on a pendulum with the size changed, under the full torque of its motor."""
    other = USUAL.replace(**size)
    return run_of(other, method, dt=0.1 / other.omega0, steps=200, angle=2.0, velocity=0.0, control=1.0)


def _refused(method: Method) -> Finding:
    """Judge a method on pendulums that a scene must refuse with a SceneError: omega0, m g L or work underflows."""
    for size in ({"gravity": 1e-300}, {"length": 1e150}, {"gravity": 1e-200, "mass": 1e-200}):
        try:
            _run(method, **size)
        except SceneError:
            continue
        return Finding(WRONG, note=f"it runs with {size}, in which numbers underflow")
    return Finding(ACCURATE)


def _unbearable(method: Method) -> Finding:
    """Judge a method on pendulums on which a run must diverge, because energy or work overflows."""
    sizes: tuple[dict[str, float], ...] = ({"gravity": 1e300}, {"length": 1e-150})
    return every(*(stopped(_run(method, **size))
                   or Finding(WRONG, note=f"it runs on with {size}, in which numbers overflow") for size in sizes))


# --- strengths of 1e-300 and 1e300 ----------------------------------------------------------------------------------

SMALL, LARGE = 1e-300, 1e300
"""Strengths of effects, in SI units."""
TILT, STEP, COUNT = 0.5, 0.01, 100
"""Initial angle [rad], step [s] and number of steps of runs with such strengths."""
STRENGTHS: dict[str, Callable[[float], Effect]] = {
    "linear drag": lambda x: LinearDrag(gamma=x),
    "quadratic drag": lambda x: QuadraticDrag(c=x),
    "dry friction": CoulombFriction,
    "a periodic torque": lambda x: PeriodicTorque(x, 1.0),
    "a shaken pivot": lambda x: VerticalDrive(x, 1.0),
}
"""Effects by name, as functions of their strength in SI units."""


_with = partial(unit, "extreme strengths", Gravity(), medium=AIR)


def _negligible(scene: Scene, method: Method) -> Finding:
    """Judge a method by a run with an effect of the strength 1e-300.

    Motion and energy must be those without the effect; a method that locates zeros of the velocity for dry friction
    divides its steps there, and may differ by the error of its order.
    """
    finer = 16 if method.order == 1 else 1
    settings: dict[str, Any] = {"dt": STEP / finer, "steps": COUNT * finer, "angle": TILT, "velocity": 0.0}
    run, divided = ran(scene, method, **settings), 0.0
    # The energy errs twice as much as the amplitude.
    high = 1.0 - math.cos(TILT)
    size = np.array([[TILT], [TILT], [2.0 * high]])
    if scene.has("coulomb_friction"):  # it divides a step at each zero of the velocity
        divided = order_bound(method, RATE * STEP / finer, RATE * STEP * COUNT)
        angle, velocity = exact.pendulum(run.time, TILT, 0.0, RATE)
        truth = angle, velocity / RATE, np.full(len(angle), high)
    else:
        free = ran(_with(), method, **settings)
        truth = free.angle, free.velocity / RATE, free.energy / EARTH
    error = np.array([run.angle, run.velocity / RATE, run.energy / EARTH]) - np.array(truth)
    return graded(error / size, divided + rounding(method) * COUNT * finer * RATE * STEP,
                  "an effect of the strength 1e-300 changes the motion")


def _overwhelmed(method: Method) -> frozenset[str]:
    """Return the outcomes allowed under drag of the strength 1e300, which holds the bob where it is.

    Methods with a stability limit must diverge; those for forces free of the velocity are refused. Splittings let the
    bob fall freely for a step before drag acts. Other methods are accurate, unless their equations cannot be solved,
    which must be reported.
    """
    if "velocity_free" in method.needs:
        return frozenset({REFUSED})
    if math.isfinite(damping_limit(method)):
        return frozenset({DIVERGED})
    return frozenset({ACCURATE, STABLE, DIVERGED} if "split" in method.needs else {ACCURATE, DIVERGED})


def _held(scene: Scene, tolerance: float, method: Method) -> Finding:
    """Judge a method on a bob that drag or dry friction of the strength 1e300 holds.

    The angle may change by ``tolerance`` [rad]. Stable: the bob falls slowly, as it does in splittings.
    """
    run = ran(scene, method, dt=STEP, steps=COUNT, angle=TILT, velocity=0.0)
    falls = np.all(np.diff(run.angle) <= 0.0) and run.angle[-1] >= 0.0
    return graded(run.angle - TILT, tolerance, "" if falls and tolerance else "it moves, although it is held",
                  size=TILT)


def _impossible(scene: Scene, method: Method) -> Finding:
    """Judge a method on a scene whose motion has no finite numbers: it must diverge."""
    run = run_of(scene, method, dt=STEP, steps=COUNT, angle=TILT, velocity=0.0)
    return stopped(run) or Finding(WRONG, note="it continues although its energy exceeds the largest number")


# --- a start with a million turns -----------------------------------------------------------------------------------

WOUND, BEYOND = 6283185.6, 0.2928204131505457
"""Initial angle [rad], and its exact distance from a million turns [rad]."""
SPEED = 3.0
"""Initial velocity [omega0]."""
MILLION = Motion("a start with a million turns", unit("a million turns at the start", Gravity()), "pendulum", BEYOND,
                 SPEED, 10.0, marks=10, growth=10.0, largest=30.0, pace=SPEED, most=64)
"""The motion without the turns."""


def _wound(method: Method) -> Finding:
    """Judge a method on a rotation from an angle of a million turns, whose digits end at 1e-9 rad.

    It must equal the rotation from the same angle without the turns, and be right.
    """
    far, near = ran_motion(replace(MILLION, angle=WOUND), method), ran_motion(MILLION, method)
    turned = float(np.ptp(MILLION.true()[0]))
    carried = rounding(method) * turned * (1.0 + 0.5 * turned)
    lost = np.maximum(np.abs(far.angle - WOUND - (near.angle - BEYOND)) - 2.0 * math.ulp(WOUND), 0.0)
    off = float(np.max(np.maximum(lost, np.abs(far.velocity - near.velocity) / RATE)))
    demand(off <= carried, "it depends on the turns at its start", off, carried)
    return also(followed(MILLION, method, near.angle, far.velocity), Bound("a radian", carried, 1.0))


# --- the cases ------------------------------------------------------------------------------------------------------

COULOMB = "Coulomb 1785: at rest, friction balances all other torques up to its limit"
RANGE = "the range of double precision (IEEE 754)"


ALWAYS = always(ACCURATE)


def _case(name: str, scene: Scene, why: str, truth: str, source: str, attempt: Try,
          may: Rule = ALWAYS) -> Case:
    """Return a hard case of the group of extremes without a predicted error."""
    return Case(name, GROUP, why, truth, source, scene, may, attempt)


CASES = (
    *(
        _case(f"pushed at the top, {name}", _falling(*drags),
              "Velocities of 1e-15 to 1e-300 rad/s decide to which side the bob falls, and their squares underflow.",
              "the tilt from the exact distance of float(pi) from the top, to the right side and until it is about 0.1 "
              "rad; the tolerance is (omega0 h)^p omega0 t of it",
              "scipy's DOP853 at 3e-14 for the tilt in units of its first value (Hairer, Norsett & Wanner 1993, II.5)",
              partial(_pushed, name))
        for name, drags in DAMPINGS.items()
    ),
    _case("pushed at the top, dry friction", STICKY,
          "Dry friction has to stop velocities of 1e-15 to 1e-300 rad/s within a part of the first step.",
          "rest from the first step on, at float(pi) to an ulp", COULOMB, _stuck),
    *(
        Case(name, GROUP, "Products of such numbers underflow or overflow unless they are taken in the right order.",
             "angle, velocity/omega0, and energy and work over m g L equal those of the pendulum of 1 m and 1 kg, to "
             "rounding, whose error is that of the method's formula",
             "dimensional analysis (Buckingham 1914, Phys. Rev. 4, 345)", scene, ALWAYS, partial(similar, scene),
             motion=RIGHT[True])
        for name, scene in (
            ("a bob of 1e-300 kg", _sized(mass=1e-300)), ("a bob of 1e300 kg", _sized(mass=1e300)),
            ("1e300 m, 1e-300 kg, 1e300 m/s2", _sized(length=1e300, mass=1e-300, gravity=1e300)),
            ("1e-150 m, 1e300 kg, 1e-150 m/s2", _sized(length=1e-150, mass=1e300, gravity=1e-150)))
    ),
    _case("too slow for double precision", USUAL, "Work and torque underflow, while angle and velocity do not.",
          "a SceneError for g = 1e-300 m/s2, for a length of 1e150 m, and for g = 1e-200 m/s2 with 1e-200 kg", RANGE,
          _refused),
    _case("too fast for double precision", USUAL, "Work and powers of omega0 overflow at every step.",
          "reported divergence for g = 1e300 m/s2; 1e-150 m", RANGE, _unbearable, always(DIVERGED)),
    *(
        _case(f"{name} of 1e-300", _with(strength(SMALL)),
              "Such an effect is far below rounding, but may divide by a quantity that underflows.",
              "the motion without the effect, to rounding", "the limit of a vanishing strength",
              partial(_negligible, _with(strength(SMALL))))
        for name, strength in STRENGTHS.items()
    ),
    *(
        _case(f"{name} of 1e300", _with(STRENGTHS[name](LARGE)),
              "A step is 1e298 times as long as the time in which drag acts.",
              "the angle stays, as the bob falls by less than 1e-149 rad. Stable: it falls slowly. Diverged: methods "
              "with a stability limit, and those whose equations cannot be solved", "theta' = -g sin(theta)/(L gamma)",
              partial(_held, _with(STRENGTHS[name](LARGE)), 1e-12), _overwhelmed)
        for name in ("linear drag", "quadratic drag")
    ),
    _case("dry friction of 1e300", _with(CoulombFriction(LARGE)), "Its sum with any other torque is lost in rounding.",
          "no bit changes", COULOMB, partial(_held, _with(CoulombFriction(LARGE)), 0.0)),
    *(
        _case(name, scene, "Its torque, energy or phase exceeds the largest number.",
              "reported divergence with the last finite state", RANGE, partial(_impossible, scene), always(DIVERGED))
        for name, scene in (
            ("a periodic torque of 1e300 N m", _with(PeriodicTorque(LARGE, 1.0))),
            ("a periodic torque of 1e300 rad/s", _with(PeriodicTorque(1.0, LARGE))),
            ("a pivot shaken by 1e300 m", _with(VerticalDrive(LARGE, 1.0))),
            ("a wind of 1e300 m/s", _with(QuadraticDrag(c=DRAG), Wind(LARGE))))
    ),
    foreseen(GROUP, MILLION, "An angle of a million turns has digits down to 1e-9 rad, and its turns must be taken off "
             "exactly.", "the error is that of the method's formula, the angle has all digits",
             "Jacobi's elliptic functions (Whittaker & Watson 1927, 44)", _wound),
)
