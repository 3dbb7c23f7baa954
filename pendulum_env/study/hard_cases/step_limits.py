"""Hard cases: steps at and beyond their limits, up to many periods."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from integrators import Method, MethodError
from integrators.analysis import spectral_radius
from pendulum_env.physics.presets import SCENES
from pendulum_env.study.hard_cases.case import (
    ACCURATE,
    DIVERGED,
    STABLE,
    WRONG,
    Case,
    Finding,
    Rule,
    Try,
    always,
    judged,
    ran,
    stopped,
)

GROUP = "step limits"
STEPS = 20_000
LINEAR, FULL = SCENES["textbook"], SCENES["vacuum"]
GONE = math.log(math.sqrt(2.0 * 100.5) / 0.1)
"""Log of the growth of an amplitude of 0.1 rad at which the energy's residual is 100 m g L and more."""
GREENE = 0.9716
"""K = (omega0 h)² of the standard map up to which its last circle stands (Greene 1979, J. Math. Phys. 20, 1183)."""
PUBLISHED = "|eigenvalue of the step| on the oscillator (Hairer & Wanner 1996, IV.2)"


def _growth(method: Method, product: float) -> float:
    """Log of what the amplitude grows by in STEPS at this omega0 h; 0 for methods that no matrix tells of."""
    try:
        return STEPS * math.log(max(spectral_radius(method, product), 1e-300))
    except MethodError:
        return 0.0


def _linear_rule(product: float) -> Rule:
    def may(method: Method) -> frozenset[str]:
        growth = _growth(method, product)
        if growth > GONE + 1.0:
            return frozenset({DIVERGED})
        return frozenset({STABLE, DIVERGED} if growth > 1e-6 else {STABLE, ACCURATE})

    return may


def _linear(product: float) -> Try:
    """The amplitude in truth is that of the start; accurate within (omega0 h)^p of the phase, where that is small."""

    def attempt(method: Method) -> Finding:
        h = product / LINEAR.omega0
        run = ran(LINEAR, method, dt=h, steps=STEPS)
        ended = stopped(run)
        if ended is not None:
            return ended
        start, tenth = LINEAR.run.angle, STEPS // 10
        early, late = (float(np.max(np.abs(part))) for part in (run.angle[:tenth], run.angle[-tenth:]))
        allowed = (1.0 + 1e-6) * math.exp(max(_growth(method, product), 0.0))
        wrong = "it grows though its eigenvalues do not" if late > allowed * early else ""
        error = np.abs(run.angle - start * np.cos(LINEAR.omega0 * run.time)) / start
        return judged(run, error, min(0.1, product**method.order * product * STEPS), wrong)

    return attempt


def _full(product: float, steps: int, bound: float) -> Try:
    """From 3 rad under full gravity; ``bound``: most of |v| h [rad], beyond which the motion is nonsense."""

    def attempt(method: Method) -> Finding:
        h = product / FULL.omega0
        run = ran(FULL, method, dt=h, steps=steps, every=10, angle=3.0, velocity=0.0)
        ended = stopped(run)
        if ended is not None:
            return ended
        fastest = float(np.max(np.abs(run.velocity))) * h
        return Finding(STABLE if fastest < bound else WRONG, fastest, bound, "|v| h [rad]")

    return attempt


def _is_standard_map(method: Method) -> bool:
    """True for kicks and drifts of whole steps, by themselves or seen from half a step away."""
    return method.symplectic and method.order <= 2 and method.evaluations == 1 and not method.implicit


def _below_greene(method: Method) -> frozenset[str]:
    return frozenset({STABLE}) if _is_standard_map(method) else frozenset({STABLE, DIVERGED})


def _many_periods(method: Method) -> frozenset[str]:
    return frozenset({STABLE, ACCURATE}) if method.a_stable else frozenset({STABLE, ACCURATE, DIVERGED})


def _case(name: str, truth: str, may: Rule, attempt: Try, full: bool = False, source: str = PUBLISHED) -> Case:
    why = "The step is near or beyond what the method can resolve; growth must be named, not drawn as motion."
    return Case(name, GROUP, why, truth, source, replace(FULL if full else LINEAR), may, attempt)


PRODUCTS = (0.5, 1.0, 1.5, 1.99, 2.01, 3.0, 5.0, 10.0, 20.0)
"""omega0 h on the small-angle scene."""
Maker = Callable[[float], Try]

CASES = (
    *(
        _case(f"omega0 h = {product:g}, small angles",
              "the amplitude neither grows nor shrinks; growth by the spectral radius must be named as divergence",
              _linear_rule(product), _linear(product))
        for product in PRODUCTS
    ),
    _case("a step of 100 periods, small angles", "bounded for A-stable methods, named divergence for the others",
          _many_periods, _linear(200.0 * math.pi)),
    _case("omega0 h = 0.98, full gravity", "the last circle of the standard map keeps |v| h below a turn",
          _below_greene, _full(math.sqrt(GREENE) * 0.994, 100_000, 2.0 * math.pi), True,
          "Greene 1979, J. Math. Phys. 20, 1183; Meiss 1992, Rev. Mod. Phys. 64, 795"),
    _case("omega0 h = 1.5, full gravity", "no circle of the standard map is left; what leaves all sense is named",
          always(STABLE, DIVERGED), _full(1.5, 100_000, 1.5 * math.sqrt(2.0 * 103.0) * 1.01), True,
          "Chirikov 1979, Phys. Rep. 52, 263"),
)
