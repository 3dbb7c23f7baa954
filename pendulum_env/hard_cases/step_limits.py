"""Hard cases: steps near and beyond the stability limit, up to many periods."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from integrators import Method
from integrators.analysis import amplification, spectral_radius
from pendulum_env.hard_cases.case import (
    ACCURATE,
    DIVERGED,
    LOOSE,
    NEWTON,
    STABLE,
    WRONG,
    Bound,
    Case,
    Finding,
    Rule,
    Try,
    also,
    bounded,
    every,
    judged,
    named,
    ran,
    stopped,
)
from pendulum_env.hard_cases.predicted import Motion, foretold, held, unmet
from pendulum_env.physics import exact
from pendulum_env.physics.energy import ABSURD
from pendulum_env.physics.presets import SCENES
from pendulum_env.truth.steps import FIRST, SAYS, Equation, order_error, own_steps, too_early

GROUP = "step limits"
STEPS = 1000
"""Number of steps in the small-angle scene."""
WORK = 20_000.0
"""Number of force evaluations in the scene with full gravity."""
LINEAR, FULL = SCENES["textbook"], SCENES["vacuum"]
UNIT = 2.0**-52
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
FORETOLD = 20
"""Number of steps whose errors are predicted, from the first one on."""

PUBLISHED = ("|eigenvalue| of the step on the oscillator (Hairer & Wanner 1996, IV.2 and V.1; Hairer, Lubich & Wanner "
             "2006, I.5.2)")
STANDARD_MAP = "Greene 1979, J. Math. Phys. 20, 1183; Meiss 1992, Rev. Mod. Phys. 64, 795"
DIFFUSION = "Chirikov 1979, Phys. Rep. 52, 263: p² grows by K²/2 a step, within a factor of 2 or 3"
EXACTLY = "Gonzalez 1996, theorem 2.2, for the energy; Jacobi's elliptic functions (Whittaker & Watson 1927, 44)"


CEILING = "the eigenvalues of a step bound the growth of a run from above only"
NO_THEOREM = "no theorem bounds this method's steps of full gravity, beyond the energy that a run may have"


# --- small angles ---------------------------------------------------------------------------------------------------


def small(product: float) -> str:
    """Return the name of the case in the small-angle scene with steps of ``product`` = omega0 h."""
    return f"{'a step of 100 periods' if product == PERIODS else f'omega0 h = {product:g}'}, small angles"


MOTIONS = {
    small(product): Motion("linear", 1.0, 0.0, product * FORETOLD, marks=FORETOLD, growth=10.0, most=1,
                           lacks=unmet(LINEAR)) for product in PRODUCTS
}
"""Motions with predicted errors, in units of the initial angle."""


def growth(method: Method, product: float) -> float:
    """Return the logarithm of an oscillation's growth by a method in STEPS steps of ``product`` = omega0 h."""
    radius = spectral_radius(named(method), product)
    return STEPS * math.log(radius) if 0.0 < radius < math.inf else radius or -math.inf


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


def _linear_rule(product: float) -> Rule:
    """Return the rule of allowed outcomes in the small-angle scene, for steps of ``product`` = omega0 h.

    The rule follows from the spectral radius of a method's step.
    """

    def may(method: Method) -> frozenset[str]:
        grown = growth(method, product)
        if method.exact:
            return frozenset({ACCURATE})
        if grown > GONE + HIDDEN:
            return frozenset({DIVERGED})
        return frozenset({STABLE, ACCURATE} if grown < 1.0 else {STABLE, ACCURATE, DIVERGED})

    return may


def _linear(product: float) -> Try:
    """Return a function that judges a method in the small-angle scene, in steps of ``product`` = omega0 h.

    The largest error of the first steps must be that of the method's formula, and the growth is bounded by the
    eigenvalues of the step. The tolerance is (omega0 h)^p times the phase, at most a tenth of the amplitude.
    """
    name = small(product)

    def attempt(method: Method) -> Finding:
        run = ran(LINEAR, method, dt=product / LINEAR.omega0, steps=STEPS)
        ended = stopped(run)
        if ended is not None:
            count = len(run.time) - 1
            return ended if in_time(method, product, count) else replace(
                ended, outcome=WRONG, note=f"it stopped after {count} steps, not when its growth implies divergence")
        phase = LINEAR.omega0 * run.time
        size = np.hypot(run.angle, run.velocity / LINEAR.omega0)
        allowed = spread(method, product) * math.exp(max(growth(method, product), 0.0)) * (1.0 + 1e-6)
        grows = np.max(size) > allowed * np.max(size[: STEPS // 10])
        most: tuple[Bound, ...] = (Bound("growth", allowed, allowed, CEILING),)
        wrong = "it grows faster than its eigenvalues allow" if grows else ""
        own = min(0.1, product**method.order * product * STEPS) if product < 1.0 else 0.1
        rounding = UNIT * (4.0 + float(phase[-1]))
        error = np.abs(run.angle / START - np.cos(phase))
        if foretold(name, method):
            speed = np.abs(run.velocity / START / LINEAR.omega0 + np.sin(phase))
            formula = held(name, MOTIONS[name], method, np.maximum(error, speed)[: FORETOLD + 1])
            if formula.outcome == WRONG:
                return formula
            most = (*formula.bounds, *most)
        return also(judged(run, error, rounding if method.exact else own + rounding, wrong, of="the amplitude"), *most)

    return attempt


# --- full gravity ---------------------------------------------------------------------------------------------------


def is_standard_map(method: Method) -> bool:
    """Return True for a method whose step on the pendulum is the standard map: one kick and one drift.

    Verlet's method is included, whose velocity is half a kick behind.
    """
    return method.symplectic and method.order <= 2 and method.evaluations == 1 and not method.implicit


def _full_rule(of_standard_map: str) -> Rule:
    """Return the rule of allowed outcomes in the scene with full gravity.

    Methods that conserve energy must be accurate. Those whose step is the standard map must have the outcome
    ``of_standard_map``. For other methods there is no theorem; they may be stable or diverge.
    """

    def may(method: Method) -> frozenset[str]:
        if method.keeps_energy:
            return frozenset({ACCURATE})
        if is_standard_map(method):
            return frozenset({of_standard_map})
        return frozenset({STABLE, DIVERGED})

    return may


def _first_steps(method: Method, product: float, angle: float, velocity: float) -> Finding:
    """Judge the first steps of a method's run, which is WRONG or ACCURATE.

    They must agree with the method's table and, if its order implies it, with the pendulum's exact motion.
    """
    h, omega0 = product / FULL.omega0, FULL.omega0
    run = ran(FULL, method, dt=h, steps=FIRST, angle=angle, velocity=velocity)
    own = own_steps(named(method), Equation(), angle, velocity / omega0, product, len(run.time) - 1)
    missed = own.missed(run.angle, run.velocity / omega0) if own is not None else 0.0
    if missed:
        return Finding(WRONG, note=f"its first steps differ from its table by {missed:.3g}")
    if product < 1.0 and velocity == 0.0:
        truth, _ = exact.pendulum(run.time, angle, 0.0, omega0)
        allowed, errors = order_error(method, angle, product, len(run.time) - 1), np.abs(run.angle - truth)
        meaningful = allowed < SAYS
        if np.any(errors[meaningful] > allowed[meaningful] + 1e-12):
            worst = np.max(errors[meaningful])
            return Finding(WRONG, note=f"its first steps err by {worst:.3g} rad, more than its order allows")
        bound = Bound("the angle in the first steps", float(np.max(allowed, where=meaningful, initial=0.0)), angle)
        return Finding(ACCURATE, bounds=(bound,))
    return Finding(ACCURATE)


def _full(product: float, angle: float, turning: float, count: int = 0) -> Try:
    """Return a function that judges a method from rest at ``angle`` [rad], in steps of ``product`` = omega0 h.

    Gravity is not linearised. ``turning`` [rad] is the bound of |v| h that an invariant circle of the standard map
    implies; inf if there is none. For methods without a theorem, stable means a residual of at most ABSURD times
    ``m g L + E0``, which the package guarantees for every run. Verlet's method starts with half a kick, to follow the
    orbit of the standard map. ``count`` is the number of steps; by default WORK force evaluations.
    """

    def attempt(method: Method) -> Finding:
        h, omega0 = product / FULL.omega0, FULL.omega0
        steps = count or max(200, math.floor(WORK / (method.evaluations * (NEWTON if method.implicit else 1.0))))
        kick = -0.5 * h * omega0 * omega0 * math.sin(angle)
        half = is_standard_map(method) and method.symmetric
        stride = max(1, steps // STEPS)
        start_velocity = kick if half else 0.0
        first = _first_steps(method, product, angle, start_velocity)
        if first.outcome == WRONG:
            return first
        run = ran(FULL, method, dt=h, steps=steps, every=stride, angle=angle, velocity=start_velocity)
        ended = stopped(run)
        if ended is not None:
            early = too_early(named(method), angle, start_velocity / omega0, product, round(float(run.time[-1]) / h))
            return replace(ended, outcome=WRONG, note=early) if early else ended
        if method.keeps_energy:
            drift = np.max(np.abs(run.energy_residual)) / run.energy[0]
            own = 10.0 * UNIT * steps * (1.0 + product)
            found = judged(run, drift, own, "its energy is wrong", of="the energy")
            if method.exact:
                truth, _ = exact.pendulum(run.time, angle, 0.0, omega0)
                most = min(own * omega0 * float(run.time[-1]), LOOSE * angle)
                found = every(found, judged(run, run.angle - truth, most, "its phase is wrong", size=angle))
            return also(found, *first.bounds)
        energy = 1.0 - math.cos(angle)
        bound = product * math.sqrt(2.0 * (ABSURD * (1.0 + energy) + energy))
        bound = min(bound, turning) if is_standard_map(method) else bound
        fastest = float(np.max(np.abs(run.velocity))) * h
        return also(bounded(fastest, bound, "|v| h [rad]", NO_THEOREM), *first.bounds)

    return attempt


# --- the cases ------------------------------------------------------------------------------------------------------

WHY = "The step is near or beyond the method's stability limit; growth must be reported as divergence."
NO_GROWTH = (
    "theta0 cos(omega0 t), of constant amplitude; the error is that of the method's formula. "
    "Accurate: within (omega0 h)^p of the phase and a tenth of theta0. "
    "Stable: bounded if no eigenvalue exceeds 1, else growth no faster than the eigenvalues. Diverged: the run stops "
    "at the step at which its energy becomes absurd"
)
KEPT = (
    "methods that conserve energy do so to 10 ulp per step, the exact one also keeps its phase. For other methods, "
    "stable means a residual of at most 100 (m g L + E0). The first steps agree with the method's table and, at "
    "omega0 h < 1, with the pendulum within its order; no run may stop before forces of m g L can give it an absurd "
    "energy"
)
CIRCLE = f"inside the last invariant circle of the standard map |v| h stays below a turn; {KEPT}"
BELOW = math.sqrt(GREENE) * 0.994
"""omega0 h just below the value at which the last invariant circle breaks."""


def _small(product: float) -> Case:
    """Return a hard case of the small-angle scene with steps of ``product`` = omega0 h."""
    place = replace(LINEAR)
    return Case(small(product), GROUP, WHY, NO_GROWTH, PUBLISHED, place, _linear_rule(product),
                _linear(product), motion=small(product) if product in PRODUCTS else "")


def _large(name: str, truth: str, source: str, rule: Rule, attempt: Try, long: bool = False) -> Case:
    """Return a hard case of the scene with full (not linearised) gravity."""
    return Case(f"{name}, full gravity", GROUP, WHY, truth, source, replace(FULL), rule, attempt, long)


CASES = (
    *(_small(product) for product in (*PRODUCTS, PERIODS)),
    _large("omega0 h = 0.98", CIRCLE, f"{STANDARD_MAP}; {EXACTLY}", _full_rule(STABLE),
           _full(BELOW, 3.0, 2.0 * math.pi)),
    _large("omega0 h = 0.98 for a million steps", CIRCLE, f"{STANDARD_MAP}; {EXACTLY}", _full_rule(STABLE),
           _full(BELOW, 3.0, 2.0 * math.pi, 1_000_000), True),
    _large("omega0 h = 1.5",
           "the standard map has no invariant circle at K = 2.25, and 1.5 rad lies outside its island: "
           f"|v| h grows as sqrt(n), which must be reported; {KEPT}", f"{DIFFUSION}; {EXACTLY}", _full_rule(DIVERGED),
           _full(1.5, 1.5, math.inf)),
    _large("omega0 h = 20", f"a kick adds up to 200 m g L, and divergence must be reported after a few; {KEPT}",
           f"{DIFFUSION}; {EXACTLY}", _full_rule(DIVERGED), _full(20.0, 3.0, math.inf)),
    _large("a step of 100 periods", f"a kick adds up to 200 000 m g L, and divergence must be reported; {KEPT}",
           f"{DIFFUSION}; {EXACTLY}", _full_rule(DIVERGED), _full(PERIODS, 3.0, math.inf)),
)
