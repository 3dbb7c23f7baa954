"""Hard cases: next to the top, where a tilt grows as cosh(omega0 t) and the angle loses its digits."""

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
"""[s]"""
ROUNDING = 1e-6
"""Relative error of the tilt that rounding may leave, amplified as the tilt is."""
SCENE = SCENES["vacuum"]


def _release(offset: float) -> Try:
    """Released at rest, ``offset`` [rad] from upright, until the tilt is about 0.1 rad."""

    def attempt(method: Method) -> Finding:
        angle, growth = math.pi - offset, math.acosh(max(0.1 / offset, 1.5))
        steps = math.ceil(growth / (SCENE.omega0 * STEP))
        run = ran(SCENE, method, dt=STEP, steps=steps, every=100, angle=angle, velocity=0.0)
        truth, _ = exact.pendulum(run.time, angle, 0.0, SCENE.omega0)
        error = (run.angle[-1] - truth[-1]) / (math.pi - truth[-1])
        return judged(run, error, (SCENE.omega0 * STEP) ** method.order * growth + ROUNDING, "it falls at another time")

    return attempt


def _float_pi(method: Method) -> Finding:
    """float(pi) is 1.2246e-16 below pi: the bob falls back, and has a tilt of 0.056 rad after 11 s."""
    run = ran(SCENE, method, dt=STEP, steps=11_000, every=1000, angle=math.pi, velocity=0.0)
    truth, _ = exact.pendulum(run.time, math.pi, 0.0, SCENE.omega0)
    error = (run.angle[-1] - truth[-1]) / (math.pi - truth[-1])
    own = (SCENE.omega0 * STEP) ** method.order * SCENE.omega0 * 11.0
    return judged(run, error, own + ROUNDING, "it falls at another time, or the other way")


def _upright(method: Method) -> Finding:
    """Upright to within half an ulp of pi the torque is 1.2e-16 of its largest, and nothing may move for 100 steps."""
    run = ran(SCENE, method, dt=STEP, steps=100, angle=math.pi, velocity=0.0)
    return judged(run, run.angle - math.pi, 1e-15, "it moves at once")


def _separatrix(method: Method) -> Finding:
    """From the bottom with 2 omega0: theta = 2 gd(omega0 t) = 4 atan(tanh(omega0 t/2)), which never turns over.

    The energy must come out right to leave it by the right way: the tilt 4 atan(exp(-omega0 t)) is compared while it
    is above 0.05 rad; errors that are made all the way, (omega0 h)^p omega0 t, grow in it as exp(omega0 t).
    """
    omega0 = SCENE.omega0
    time = math.log(1.0 / math.tan(0.05 / 4.0)) / omega0
    run = ran(SCENE, method, dt=STEP, steps=math.floor(time / STEP), angle=0.0, velocity=2.0 * omega0)
    truth = 4.0 * np.arctan(np.tanh(0.5 * omega0 * run.time))
    own = (omega0 * STEP) ** method.order * omega0 * time * math.exp(omega0 * time)
    return judged(run, run.angle - truth, own + 1e-12, "it leaves the separatrix early")


def _case(name: str, why: str, truth: str, attempt: Try, source: str = ELLIPTIC) -> Case:
    scene = replace(SCENE, name="vacuum")
    return Case(name, GROUP, why, truth, source, scene, always(ACCURATE), attempt)


OFFSETS = tuple(10.0**-k for k in range(3, 13))
"""Releases from upright [rad]."""

CASES = (
    *(
        _case(f"release {offset:.0e} rad from the top", "The angle has lost the tilt's digits, and it grows as cosh.",
              "the tilt when it is about 0.1 rad; allowed is the method's error of the growth, (omega0 h)^p omega0 t",
              _release(offset))
        for offset in OFFSETS
    ),
    _case("float(pi)", "float(pi) is not pi, and from it the bob falls to a side that is decided by 1.2e-16 rad.",
          "a tilt of 0.056 rad after 11 s, on the side of the float", _float_pi),
    _case("upright for a moment", "The sine of the start is 1.2e-16, which must not be rounded up.",
          "no angle changes by more than rounding in 0.1 s", _upright),
    _case("the separatrix", "Between swinging and going round, errors of the energy grow as exp(omega0 t).",
          "4 atan(tanh(omega0 t/2)) until 0.05 rad from the top", _separatrix,
          "the Gudermannian (Abramowitz & Stegun 1964, 4.3.117)"),
)
