"""Hard cases: near the top, where a tilt grows as cosh(omega0 t) and the angle near pi loses digits."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from integrators import Method
from pendulum_env.hard_cases.case import ACCURATE, Case, Finding, Try, always, judged, ran
from pendulum_env.physics import exact
from pendulum_env.physics.presets import SCENES

GROUP = "near the top"
ELLIPTIC = "Jacobi's elliptic functions from the exact float (Whittaker & Watson 1927, 44)"
STEP = 1e-3
"""Step [s]."""
ROUNDING = 1e-6
"""Relative error of the tilt allowed for rounding, which grows like the tilt."""
SCENE = SCENES["vacuum"]


def _release(offset: float) -> Try:
    """Return a function that judges a method released at rest ``offset`` [rad] from the top.

    The run lasts until the tilt is 0.1 rad.
    """

    def attempt(method: Method) -> Finding:
        angle, growth = math.pi - offset, math.acosh(max(0.1 / offset, 1.5))
        steps = math.ceil(growth / (SCENE.omega0 * STEP))
        run = ran(SCENE, method, dt=STEP, steps=steps, every=100, angle=angle, velocity=0.0)
        truth, _ = exact.pendulum(run.time, angle, 0.0, SCENE.omega0)
        error = (run.angle[-1] - truth[-1]) / (math.pi - truth[-1])
        return judged(run, error, (SCENE.omega0 * STEP) ** method.order * growth + ROUNDING, "it falls at another time")

    return attempt


def _float_pi(method: Method) -> Finding:
    """Judge a method released at rest at the angle float(pi), which lies 1.2246e-16 rad below pi.

    After 11 s the pendulum must have fallen to that side, by a tilt of 0.056 rad.
    """
    run = ran(SCENE, method, dt=STEP, steps=11_000, every=1000, angle=math.pi, velocity=0.0)
    truth, _ = exact.pendulum(run.time, math.pi, 0.0, SCENE.omega0)
    error = (run.angle[-1] - truth[-1]) / (math.pi - truth[-1])
    own = (SCENE.omega0 * STEP) ** method.order * SCENE.omega0 * 11.0
    return judged(run, error, own + ROUNDING, "it falls at another time, or to the other side")


def _upright(method: Method) -> Finding:
    """Judge a method released at float(pi): in 100 steps the angle may not change by more than rounding."""
    run = ran(SCENE, method, dt=STEP, steps=100, angle=math.pi, velocity=0.0)
    return judged(run, run.angle - math.pi, 1e-15, "it moves immediately")


def _separatrix(method: Method) -> Finding:
    """Judge a method on the separatrix: the motion from the bottom with 2 omega0, which never reaches the top.

    The angle is theta = 2 gd(omega0 t) = 4 atan(tanh(omega0 t/2)). Runs are compared until the tilt is 0.05 rad; errors
    of the size (omega0 h)^p omega0 t grow as exp(omega0 t).
    """
    omega0 = SCENE.omega0
    time = math.log(1.0 / math.tan(0.05 / 4.0)) / omega0
    run = ran(SCENE, method, dt=STEP, steps=math.floor(time / STEP), angle=0.0, velocity=2.0 * omega0)
    truth = 4.0 * np.arctan(np.tanh(0.5 * omega0 * run.time))
    own = (omega0 * STEP) ** method.order * omega0 * time * math.exp(omega0 * time)
    return judged(run, run.angle - truth, own + 1e-12, "it leaves the separatrix early")


def _case(name: str, why: str, truth: str, attempt: Try, source: str = ELLIPTIC) -> Case:
    """Return a hard case of the group near the top, in which every method must be accurate."""
    scene = replace(SCENE, name="vacuum")
    return Case(name, GROUP, why, truth, source, scene, always(ACCURATE), attempt)


OFFSETS = tuple(10.0**-k for k in range(3, 13))
"""Initial tilts from the top [rad]."""

CASES = (
    *(
        _case(f"release {offset:.0e} rad from the top",
              "An angle near pi stores few digits of the tilt from the top, which grows as cosh(omega0 t).",
              "the tilt when it is about 0.1 rad; the tolerance is the method's error (omega0 h)^p omega0 t",
              _release(offset))
        for offset in OFFSETS
    ),
    _case("float(pi)", "float(pi) is not pi: the difference of 1.2e-16 rad decides to which side the bob falls.",
          "a tilt of 0.056 rad after 11 s, on the side of the float", _float_pi),
    _case("upright for a moment", "The sine of the initial angle is 1.2e-16, which must not be rounded up.",
          "no angle changes by more than rounding in 0.1 s", _upright),
    _case("the separatrix", "Between swinging and rotating, energy errors grow as exp(omega0 t).",
          "4 atan(tanh(omega0 t/2)) until 0.05 rad from the top", _separatrix,
          "the Gudermannian (Abramowitz & Stegun 1964, 4.3.117)"),
)
