"""Hard cases: near the top, where a tilt grows as cosh(omega0 t) and the angle near pi loses digits."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from integrators import Method
from pendulum_env.hard_cases.case import ACCURATE, Case, Finding, Try, always, judged, ran
from pendulum_env.hard_cases.predicted import Motion, expected, followed
from pendulum_env.physics import exact
from pendulum_env.physics.presets import SCENES

Array = NDArray[np.float64]
GROUP = "near the top"
ELLIPTIC = "Jacobi's elliptic functions from the exact float (Whittaker & Watson 1927, 44)"
STEP = 1e-3
"""Step of the upright pendulum [s]."""
SCENE = SCENES["vacuum"]
OFFSETS = tuple(10.0**-k for k in range(3, 13))
"""Initial tilts from the top [rad]."""
FALL = 11.0
"""Time in which a bob at float(pi) falls to 0.056 rad from the top [s]."""
CLOSE = 4.3775
"""omega0 times the time to 0.05 rad from the top on the separatrix, log(1/tan(0.05/4))."""


def _released(offset: float) -> Motion:
    """Return the motion from rest ``offset`` [rad] from the top until the tilt is about 0.1 rad."""
    return Motion("pendulum", math.pi - offset, 0.0, math.acosh(0.1 / offset), growth=30.0, from_top=True,
                  sensitive=True)


MOTIONS = {
    **{f"release {offset:.0e} rad from the top": _released(offset) for offset in OFFSETS},
    "float(pi)": Motion("pendulum", math.pi, 0.0, FALL * SCENE.omega0, growth=30.0, from_top=True, sensitive=True),
    "the separatrix": Motion("pendulum", 0.0, 2.0, CLOSE, marks=4, growth=math.exp(CLOSE), pace=2.0, most=256,
                             sensitive=True),
}
"""Motions with predicted errors."""


def _elliptic(motion: Motion, time: Array) -> tuple[Array, Array]:
    """Return the exact angle and velocity of a motion from rest."""
    angle, velocity = exact.pendulum(time, motion.angle, 0.0, SCENE.omega0)
    return np.asarray(angle), np.asarray(velocity)


def _gudermannian(_motion: Motion, time: Array) -> tuple[Array, Array]:
    """Return the exact angle and velocity on the separatrix: theta = 2 gd(omega0 t) = 4 atan(tanh(omega0 t/2))."""
    phase = SCENE.omega0 * time
    return 4.0 * np.arctan(np.tanh(0.5 * phase)), 2.0 * SCENE.omega0 / np.cosh(phase)


def _upright(method: Method) -> Finding:
    """Judge a method released at float(pi): in 100 steps the angle may not change by more than rounding."""
    run = ran(SCENE, method, dt=STEP, steps=100, angle=math.pi, velocity=0.0)
    return judged(run, run.angle - math.pi, 1e-15, "it moves immediately", size=math.pi)


def _case(name: str, why: str, truth: str, attempt: Try | None = None, source: str = ELLIPTIC) -> Case:
    """Return a hard case of the group near the top, judged by its predicted error unless ``attempt`` is given."""
    scene, rule = replace(SCENE, name="vacuum"), always(ACCURATE)
    if attempt is None:
        motion, form = MOTIONS[name], _gudermannian if source != ELLIPTIC else _elliptic
        attempt = followed(scene, name, motion, lambda time: form(motion, time))
        rule = expected(name, motion)
    return Case(name, GROUP, why, truth, source, scene, rule, attempt, motion=name if name in MOTIONS else "")


CASES = (
    *(
        _case(f"release {offset:.0e} rad from the top",
              "An angle near pi stores few digits of the tilt from the top, which grows as cosh(omega0 t).",
              "the tilt when it is about 0.1 rad; the error is that of the method's formula")
        for offset in OFFSETS
    ),
    _case("float(pi)", "float(pi) is not pi: the difference of 1.2e-16 rad decides to which side the bob falls.",
          "a tilt of 0.056 rad after 11 s, on the side of the float; the error is that of the formula"),
    _case("upright for a moment", "The sine of the initial angle is 1.2e-16, which must not be rounded up.",
          "no angle changes by more than rounding in 0.1 s", _upright),
    _case("the separatrix", "Between swinging and rotating, energy errors grow as exp(omega0 t).",
          "4 atan(tanh(omega0 t/2)) until 0.05 rad from the top; the error is that of the formula",
          source="the Gudermannian (Abramowitz & Stegun 1964, 4.3.117)"),
)
