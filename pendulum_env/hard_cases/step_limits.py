"""Hard cases: steps near and beyond the stability limit, up to many periods."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from integrators import Method
from integrators.analysis import amplification, spectral_radius
from pendulum_env.engine.rollout import Rollout
from pendulum_env.hard_cases.case import (
    ACCURATE,
    DIVERGED,
    LOOSE,
    NEWTON,
    STABLE,
    Bound,
    Case,
    Finding,
    also,
    bounded,
    demand,
    every,
    follows,
    graded,
    held,
    named,
    right,
    run_of,
    stopped,
)
from pendulum_env.hard_cases.predicted import Motion
from pendulum_env.physics import exact
from pendulum_env.physics.energy import ABSURD
from pendulum_env.physics.presets import SCENES
from pendulum_env.truth.bounds import UNIT, too_early

GROUP = "step limits"
STEPS = 1000
"""Number of steps in the small-angle scene."""
WORK = 20_000.0
"""Number of force evaluations in the scene with full gravity."""
LINEAR, FULL = SCENES["textbook"], SCENES["vacuum"]
GREENE = 0.9716
"""Largest K = (omega0 h)² at which the standard map still has an invariant circle."""
START = LINEAR.run.angle
GONE = 0.5 * math.log(ABSURD * (2.0 / START**2 + 1.0) + 1.0)
"""Log of the growth of the amplitude A at which a run counts as diverged: A² - START² = ABSURD (2 + START²)."""
HIDDEN = 12.0
"""Log of the largest ratio of the motion to its growing part at the start, such as a parasitic solution."""
PRODUCTS = (0.5, 1.0, 1.5, 1.99, 2.01, 3.0, 5.0, 10.0, 20.0)
"""omega0 h in the small-angle scene."""
PERIODS = 200.0 * math.pi
"""omega0 h of a step of 100 periods."""
FORETOLD, FIRST = 20, 4
"""Numbers of steps from the first one on whose errors are predicted, for small angles and under full gravity."""
CEILING = "the eigenvalues of a step bound the growth of a run from above only"
NO_THEOREM = "no theorem bounds this method's steps of full gravity, beyond the energy that a run may have"


# --- small angles ---------------------------------------------------------------------------------------------------


def growth(method: Method, product: float, steps: int = STEPS, gamma_h: float = 0.0) -> float:
    """Return the logarithm of an oscillation's growth by a method in steps of ``product`` = omega0 h.

    ``gamma_h`` is the rate of linear drag times the step.
    """
    radius = spectral_radius(named(method), product, gamma_h)
    return steps * math.log(radius) if 0.0 < radius < math.inf else radius or -math.inf


def grown(method: Method, product: float, run: Rollout) -> tuple[float, float]:
    """Return the growth of a run's amplitude after its first tenth, and the largest that eigenvalues allow."""
    size, steps = np.hypot(run.angle, run.velocity / LINEAR.omega0), len(run.time) - 1
    most = spread(method, product) * math.exp(max(growth(method, product, steps), 0.0)) * (1.0 + 1e-6)
    return float(np.max(size) / np.max(size[: steps // 10])), most


def growth_rule(grown: float, *bounded: str) -> frozenset[str]:
    """Return the outcomes allowed for a method by the logarithm of its growth; ``bounded`` are those without growth."""
    if grown > GONE + HIDDEN:
        return frozenset({DIVERGED})
    return frozenset(bounded if grown < 1.0 else {*bounded, DIVERGED})


def spread(method: Method, product: float) -> float:
    """Return the factor by which the amplitude of bounded steps may vary.

    By the step's matrix M with the eigenvectors V and the spectral radius rho, ``|M**n| <= cond(V) rho**n``. The factor
    is cond(V), or 2 for multistep methods, whose eigenvectors are longer than the state.
    """
    matrix = amplification(named(method), product)
    return float(np.linalg.cond(np.linalg.eig(matrix)[1])) if len(matrix) == 2 else 2.0


def in_time(method: Method, product: float, count: int) -> bool:
    """Return True if a run may diverge after ``count`` steps, according to the eigenvalues of a step.

    For the step's matrix M with spectral radius rho and eigenvectors V,
    ``rho**n/cond(V) <= |M**n x|/|x| <= rho**n cond(V)``. The lower bound holds for complex eigenvalues only, which have
    equal moduli.
    """
    rate = growth(method, product) / STEPS
    matrix = amplification(named(method), product) if rate < math.inf else np.zeros(0)
    if len(matrix) != 2:
        return True
    wide = math.log(spread(method, product))
    turns = bool(np.iscomplex(np.linalg.eigvals(matrix)).all())
    return (GONE - wide) / rate - 1.0 <= count <= ((GONE + wide) / rate + 1.0 if turns else math.inf)


def _small(product: float) -> Case:
    """Return the case of the small-angle scene with steps of ``product`` = omega0 h.

    The largest error of the first steps must be that of the method's formula, and the growth is bounded by the
    eigenvalues of the step. The tolerance is (omega0 h)^p times the phase, at most a tenth of the amplitude.
    """
    motion = Motion(f"omega0 h = {product:g}, small angles", LINEAR, "linear", 1.0, 0.0, product * FORETOLD,
                    marks=FORETOLD, growth=10.0, most=1)  # the first steps, in units of the initial angle

    def may(method: Method) -> frozenset[str]:
        return frozenset({ACCURATE}) if method.exact else growth_rule(growth(method, product), STABLE, ACCURATE)

    def attempt(method: Method) -> Finding:
        run = run_of(LINEAR, method, dt=product / LINEAR.omega0, steps=STEPS)
        ended, count = stopped(run), len(run.time) - 1
        if ended is not None:
            demand(in_time(method, product, count), f"it stopped after {count} steps, not when its growth implies "
                   "divergence")
            return ended
        phase = LINEAR.omega0 * run.time
        grew, allowed = grown(method, product, run)
        error, most = np.abs(run.angle / START - np.cos(phase)), [Bound("growth", allowed, allowed, CEILING)]
        if motion.foretells(method):
            speed = np.abs(run.velocity / START / LINEAR.omega0 + np.sin(phase))
            most = [*right(held(motion, method, np.maximum(error, speed)[: FORETOLD + 1])), *most]
        own = min(0.1, product**method.order * product * STEPS) if product < 1.0 else 0.1
        tolerance = (0.0 if method.exact else own) + UNIT * (4.0 + float(phase[-1]))
        wrong = "it grows faster than its eigenvalues allow" if grew > allowed else ""
        return also(graded(error, tolerance, wrong, of="the amplitude"), *most)

    return Case(
        motion.name if product in PRODUCTS else "a step of 100 periods, small angles", GROUP, WHY,
        "theta0 cos(omega0 t), of constant amplitude; the error is that of the method's formula. "
        "Accurate: within (omega0 h)^p of the phase and a tenth of theta0. "
        "Stable: bounded if no eigenvalue exceeds 1, else growth no faster than the eigenvalues. Diverged: the run "
        "stops at the step at which its energy becomes absurd",
        "|eigenvalue| of the step on the oscillator (Hairer & Wanner 1996, IV.2 and V.1; Hairer, Lubich & Wanner 2006, "
        "I.5.2)", LINEAR, may, attempt, motion=motion if product in PRODUCTS else None)


# --- full gravity ---------------------------------------------------------------------------------------------------


def is_standard_map(method: Method) -> bool:
    """Return True for a method whose step on the pendulum is the standard map: one kick and one drift.

    Verlet's method is included, whose velocity is half a kick behind.
    """
    return method.symplectic and method.order <= 2 and method.evaluations == 1 and not method.implicit


def _full(name: str, product: float, angle: float, of_standard_map: str, truth: str, source: str, *,
          turning: float = math.inf, count: int = 0, motion: Motion | None = None) -> Case:
    """Return the case of full gravity, from rest at ``angle`` [rad] in steps of ``product`` = omega0 h.

    The first steps must err as predicted in a ``motion``. Methods that conserve energy must be accurate, and those
    whose step is the standard map must have the outcome ``of_standard_map``; ``turning`` [rad] is the bound of |v| h
    that an invariant circle implies for them. For other methods there is no theorem; they may be stable or diverge, and
    stable means a residual of at most ABSURD times ``m g L + E0``, which the package guarantees for every run. Verlet's
    method starts with half a kick, to follow the orbit of the standard map. ``count`` is the number of steps; by
    default WORK force evaluations.
    """
    h, omega0 = product / FULL.omega0, FULL.omega0

    def may(method: Method) -> frozenset[str]:
        if method.keeps_energy:
            return frozenset({ACCURATE})
        return frozenset({of_standard_map} if is_standard_map(method) else {STABLE, DIVERGED})

    def attempt(method: Method) -> Finding:
        bounds: tuple[Bound, ...] = ()
        if motion is not None and motion.foretells(method):
            bounds = right(follows(motion, method))
        steps = count or max(200, math.floor(WORK / (method.evaluations * (NEWTON if method.implicit else 1.0))))
        kick = -0.5 * h * omega0 * omega0 * math.sin(angle) if is_standard_map(method) and method.symmetric else 0.0
        run = run_of(FULL, method, dt=h, steps=steps, every=max(1, steps // STEPS), angle=angle, velocity=kick)
        ended = stopped(run)
        if ended is not None:
            early = too_early(named(method), angle, kick / omega0, product, round(float(run.time[-1]) / h))
            demand(not early, early)
            return ended
        if method.keeps_energy:
            own = 10.0 * UNIT * steps * (1.0 + product)
            found = graded(run.energy_residual / run.energy[0], own, "its energy is wrong", of="the energy")
            if method.exact:
                most = min(own * omega0 * float(run.time[-1]), LOOSE * angle)
                found = every(found, graded(run.angle - exact.pendulum(run.time, angle, 0.0, omega0)[0], most,
                                            "its phase is wrong", size=angle))
            return also(found, *bounds)
        energy = 1.0 - math.cos(angle)
        bound = product * math.sqrt(2.0 * (ABSURD * (1.0 + energy) + energy))
        bound = min(bound, turning) if is_standard_map(method) else bound
        return also(bounded(float(np.max(np.abs(run.velocity))) * h, bound, "|v| h [rad]", NO_THEOREM), *bounds)

    return Case(
        f"{name}, full gravity", GROUP, WHY,
        f"{truth}; methods that conserve energy do so to 10 ulp per step, the exact one also keeps its phase. For "
        "other methods, stable means a residual of at most 100 (m g L + E0). The first steps err as predicted, if "
        "omega0 h < 2; no run may stop before forces of m g L can give it an absurd energy",
        f"{source}; Gonzalez 1996, theorem 2.2, for the energy; Jacobi's elliptic functions (Whittaker & Watson 1927, "
        "44)", FULL, may, attempt, count > WORK, motion)


# --- the cases ------------------------------------------------------------------------------------------------------

WHY = "The step is near or beyond the method's stability limit; growth must be reported as divergence."
BELOW = math.sqrt(GREENE) * 0.994
"""omega0 h just below the value at which the last invariant circle breaks."""
CALM = Motion("omega0 h = 0.98, full gravity", FULL, "pendulum", 3.0, 0.0, BELOW * FIRST, marks=FIRST, growth=1e3,
              most=1)
WILD = Motion("omega0 h = 1.5, full gravity", FULL, "pendulum", 1.5, 0.0, 1.5 * FIRST, marks=FIRST, growth=1e3, most=1,
              explicit=True)
_inside = partial(
    _full, product=BELOW, angle=3.0, of_standard_map=STABLE, turning=2.0 * math.pi, motion=CALM,
    truth="inside the last invariant circle of the standard map |v| h stays below a turn",
    source="Greene 1979, J. Math. Phys. 20, 1183; Meiss 1992, Rev. Mod. Phys. 64, 795")
_outside = partial(
    _full, of_standard_map=DIVERGED,
    source="Chirikov 1979, Phys. Rep. 52, 263: p² grows by K²/2 a step, within a factor of 2 or 3")

CASES = (
    *(_small(product) for product in (*PRODUCTS, PERIODS)),
    _inside("omega0 h = 0.98"),
    _inside("omega0 h = 0.98 for a million steps", count=1_000_000),
    _outside("omega0 h = 1.5", 1.5, 1.5, motion=WILD,
             truth="the standard map has no invariant circle at K = 2.25, and 1.5 rad lies outside its island: |v| h "
             "grows as sqrt(n), which must be reported"),
    _outside("omega0 h = 20", 20.0, 3.0,
             truth="a kick adds up to 200 m g L, and divergence must be reported after a few"),
    _outside("a step of 100 periods", PERIODS, 3.0,
             truth="a kick adds up to 200 000 m g L, and divergence must be reported"),
)
