"""Hard cases: near the top, where a tilt grows as cosh(omega0 t) and the angle near pi loses digits."""

from __future__ import annotations

import math

from integrators import Method
from pendulum_env.hard_cases.case import ACCURATE, Case, Finding, always, foreseen, graded, ran
from pendulum_env.hard_cases.predicted import Motion
from pendulum_env.physics.presets import SCENES

GROUP = "near the top"
ELLIPTIC = "Jacobi's elliptic functions from the exact float (Whittaker & Watson 1927, 44)"
SCENE = SCENES["vacuum"]
FALL = 11.0
"""Time in which a bob at float(pi) falls to 0.056 rad from the top [s]."""
CLOSE = 4.3775
"""omega0 times the time to 0.05 rad from the top on the separatrix, log(1/tan(0.05/4))."""


def _released(name: str, angle: float, time: float, why: str, truth: str) -> Case:
    """Return the case of a release from rest at an angle near the top, for a time in units of 1/omega0."""
    motion = Motion(name, SCENE, "pendulum", angle, 0.0, time, growth=30.0, from_top=True, sensitive=True)
    return foreseen(GROUP, motion, why, truth, ELLIPTIC)


def _upright(method: Method) -> Finding:
    """Judge a method released at float(pi): in 100 steps the angle may not change by more than rounding."""
    run = ran(SCENE, method, dt=1e-3, steps=100, angle=math.pi, velocity=0.0)
    return graded(run.angle - math.pi, 1e-15, "it moves immediately", size=math.pi)


SEPARATRIX = Motion("the separatrix", SCENE, "pendulum", 0.0, 2.0, CLOSE, marks=4, growth=math.exp(CLOSE), pace=2.0,
                    most=256, sensitive=True)

CASES = (
    *(
        _released(f"release {offset:.0e} rad from the top", math.pi - offset, math.acosh(0.1 / offset),
                  "An angle near pi stores few digits of the tilt from the top, which grows as cosh(omega0 t).",
                  "the tilt when it is about 0.1 rad; the error is that of the method's formula")
        for offset in (10.0**-k for k in range(3, 13))
    ),
    _released("float(pi)", math.pi, FALL * SCENE.omega0,
              "float(pi) is not pi: the difference of 1.2e-16 rad decides to which side the bob falls.",
              "a tilt of 0.056 rad after 11 s, on the side of the float; the error is that of the formula"),
    Case("upright for a moment", GROUP, "The sine of the initial angle is 1.2e-16, which must not be rounded up.",
         "no angle changes by more than rounding in 0.1 s", ELLIPTIC, SCENE, always(ACCURATE), _upright),
    foreseen(GROUP, SEPARATRIX, "Between swinging and rotating, energy errors grow as exp(omega0 t).",
             "4 atan(tanh(omega0 t/2)) until 0.05 rad from the top; the error is that of the formula",
             "the Gudermannian (Abramowitz & Stegun 1964, 4.3.117)"),
)
