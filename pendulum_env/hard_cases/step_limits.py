"""Hard cases: steps at and beyond their limits, up to many periods."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from integrators import Method
from integrators.analysis import amplification, spectral_radius
from pendulum_env.hard_cases.case import (
    ACCURATE,
    DIVERGED,
    NEWTON,
    STABLE,
    WRONG,
    Case,
    Finding,
    Rule,
    Try,
    judged,
    ran,
    stopped,
)
from pendulum_env.physics import exact
from pendulum_env.physics.energy import ABSURD
from pendulum_env.physics.presets import SCENES
from pendulum_env.truth.steps import FIRST, SAYS, Equation, order_error, own_steps, too_soon

GROUP = "step limits"
STEPS = 1000
"""On the small-angle scene."""
WORK = 20_000.0
"""Force evaluations on the scene with full gravity."""
LINEAR, FULL = SCENES["textbook"], SCENES["vacuum"]
UNIT = 2.0**-52
GREENE = 0.9716
"""K = (omega0 h)² of the standard map up to which its last circle stands."""
START = LINEAR.run.angle
GONE = 0.5 * math.log(ABSURD * (2.0 / START**2 + 1.0) + 1.0)
"""Log of an amplitude's growth at which ``A² - START²`` is ABSURD times ``2 + START²``: the residual is nonsense."""
HIDDEN = 12.0
"""Log of how much smaller than the motion its growing part may begin, as do what methods of many steps add to it."""

PUBLISHED = ("|eigenvalue| of the step on the oscillator (Hairer & Wanner 1996, IV.2 and V.1; Hairer, Lubich & Wanner "
             "2006, I.5.2)")
STANDARD_MAP = "Greene 1979, J. Math. Phys. 20, 1183; Meiss 1992, Rev. Mod. Phys. 64, 795"
DIFFUSION = "Chirikov 1979, Phys. Rep. 52, 263: p² grows by K²/2 a step, within a factor of 2 or 3"
EXACTLY = "Gonzalez 1996, theorem 2.2, for the energy; Jacobi's elliptic functions (Whittaker & Watson 1927, 44)"


# --- small angles ---------------------------------------------------------------------------------------------------


def growth(method: Method, product: float) -> float:
    """Log of what an amplitude grows by in STEPS steps of this omega0 h."""
    radius = spectral_radius(method, product)
    return STEPS * math.log(radius) if 0.0 < radius < math.inf else radius or -math.inf


def spread(method: Method, product: float) -> float:
    """By how much a bounded amplitude may vary: ``|M**n| <= cond(V) rho**n``, V the eigenvectors of the step.

    Where they are longer than the state, for methods of many steps, a factor of 2 above the first tenth of the run.
    """
    matrix = amplification(method, product)
    return float(np.linalg.cond(np.linalg.eig(matrix)[1])) if len(matrix) == 2 else 2.0


def in_time(method: Method, product: float, count: int) -> bool:
    """True if growth may have left all sense by the step after ``count``, and, of turning states, not much before.

    ``rho**n/cond(V) <= |M**n x|/|x| <= rho**n cond(V)``, on the left for complex eigenvalues, which share a modulus.
    """
    rate = growth(method, product) / STEPS
    matrix = amplification(method, product) if rate < math.inf else np.zeros(0)
    if len(matrix) != 2:
        return True
    wide = math.log(spread(method, product))
    turns = bool(np.iscomplex(np.linalg.eigvals(matrix)).all())
    return (GONE - wide) / rate - 1.0 <= count <= ((GONE + wide) / rate + 1.0 if turns else math.inf)


def _linear_rule(product: float) -> Rule:
    def may(method: Method) -> frozenset[str]:
        grown = growth(method, product)
        if method.exact:
            return frozenset({ACCURATE})
        if grown > GONE + HIDDEN:
            return frozenset({DIVERGED})
        return frozenset({STABLE, ACCURATE} if grown < 1.0 else {STABLE, ACCURATE, DIVERGED})

    return may


def _linear(product: float) -> Try:
    """Accurate: within (omega0 h)^p of the phase, and a tenth of the amplitude; bounded as the eigenvalues say."""

    def attempt(method: Method) -> Finding:
        run = ran(LINEAR, method, dt=product / LINEAR.omega0, steps=STEPS)
        ended = stopped(run)
        if ended is not None:
            count = len(run.time) - 1
            return ended if in_time(method, product, count) else replace(
                ended, outcome=WRONG, note=f"it stopped after {count} steps, which is not when it left all sense")
        phase = LINEAR.omega0 * run.time
        size = np.hypot(run.angle, run.velocity / LINEAR.omega0)
        allowed = spread(method, product) * math.exp(max(growth(method, product), 0.0)) * (1.0 + 1e-6)
        wrong = "it grows though its eigenvalues do not" if np.max(size) > allowed * np.max(size[: STEPS // 10]) else ""
        own = min(0.1, product**method.order * product * STEPS) if product < 1.0 else 0.1
        rounding = UNIT * (4.0 + float(phase[-1]))
        error = np.abs(run.angle / START - np.cos(phase))
        return judged(run, error, rounding if method.exact else own + rounding, wrong)

    return attempt


# --- full gravity ---------------------------------------------------------------------------------------------------


def is_standard_map(method: Method) -> bool:
    """True for one kick and drifts that make a whole step: the standard map, maybe seen from half a kick away."""
    return method.symplectic and method.order <= 2 and method.evaluations == 1 and not method.implicit


def _full_rule(of_standard_map: str) -> Rule:
    """``of_standard_map``: what they must do; of other methods no theorem tells, but of those that keep the energy."""

    def may(method: Method) -> frozenset[str]:
        if method.keeps_energy:
            return frozenset({ACCURATE})
        if is_standard_map(method):
            return frozenset({of_standard_map})
        return frozenset({STABLE, DIVERGED})

    return may


def _unlike(method: Method, product: float, angle: float, velocity: float) -> str:
    """Why the first steps are neither the method's own nor, where its order says so, the pendulum's; "" if they are."""
    h, omega0 = product / FULL.omega0, FULL.omega0
    run = ran(FULL, method, dt=h, steps=FIRST, angle=angle, velocity=velocity)
    own = own_steps(method, Equation(), angle, velocity / omega0, product, len(run.time) - 1)
    missed = own.missed(run.angle, run.velocity / omega0) if own is not None else 0.0
    if missed:
        return f"its first steps are not its table's, by {missed:.3g}"
    if product < 1.0 and velocity == 0.0:
        truth, _ = exact.pendulum(run.time, angle, 0.0, omega0)
        allowed, apart = order_error(method, angle, product, len(run.time) - 1), np.abs(run.angle - truth)
        known = allowed < SAYS
        if np.any(apart[known] > allowed[known] + 1e-12):
            return f"its first steps err by {np.max(apart[known]):.3g} rad, of which its order leaves less"
    return ""


def _full(product: float, angle: float, turning: float, count: int = 0) -> Try:
    """From rest under full gravity; ``turning`` [rad] bounds |v| h of the standard map, where one of its circles does.

    Without a theorem stable means what the package promises of every run: a residual of at most ABSURD times
    ``m g L + E0``. Verlet's velocity is half a kick behind that of the map: it starts where it runs through that orbit.
    ``count``: steps; by default as many as WORK pays for.
    """

    def attempt(method: Method) -> Finding:
        h, omega0 = product / FULL.omega0, FULL.omega0
        steps = count or max(200, math.floor(WORK / (method.evaluations * (NEWTON if method.implicit else 1.0))))
        kick = -0.5 * h * omega0 * omega0 * math.sin(angle)
        half = is_standard_map(method) and method.symmetric
        every = max(1, steps // STEPS)
        begun = kick if half else 0.0
        wrong = _unlike(method, product, angle, begun)
        if wrong:
            return Finding(WRONG, note=wrong)
        run = ran(FULL, method, dt=h, steps=steps, every=every, angle=angle, velocity=begun)
        ended = stopped(run)
        if ended is not None:
            early = too_soon(method, angle, begun / omega0, product, round(float(run.time[-1]) / h))
            return replace(ended, outcome=WRONG, note=early) if early else ended
        if method.keeps_energy:
            drift = np.max(np.abs(run.energy_residual)) / run.energy[0]
            own = 10.0 * UNIT * steps * (1.0 + product)
            if method.exact:
                truth, _ = exact.pendulum(run.time, angle, 0.0, omega0)
                drift, own = max(drift, np.max(np.abs(run.angle - truth))), own * omega0 * float(run.time[-1])
            return judged(run, drift, own, "it loses its energy or its phase")
        energy = 1.0 - math.cos(angle)
        bound = product * math.sqrt(2.0 * (ABSURD * (1.0 + energy) + energy))
        bound = min(bound, turning) if is_standard_map(method) else bound
        fastest = float(np.max(np.abs(run.velocity))) * h
        return Finding(STABLE if fastest <= bound else WRONG, fastest, bound, "|v| h [rad]")

    return attempt


# --- the cases ------------------------------------------------------------------------------------------------------

WHY = "The step is near or beyond what the method can resolve; growth must be named, not drawn as motion."
PRODUCTS = (0.5, 1.0, 1.5, 1.99, 2.01, 3.0, 5.0, 10.0, 20.0)
"""omega0 h on the small-angle scene."""
PERIODS = 200.0 * math.pi
"""omega0 h of a hundred periods."""

NO_GROWTH = (
    "theta0 cos(omega0 t): the amplitude stays. Accurate: within (omega0 h)^p of the phase and a tenth of theta0. "
    "Stable: bounded where no eigenvalue exceeds 1, and grown no more than they say where one does. Diverged: growth "
    "that leaves all sense must be named, at the step where it does"
)
KEPT = (
    "methods that keep the energy keep it to 10 ulp of each step, the exact one its phase too. Of others stable is "
    "what every run promises: a residual of no more than 100 (m g L + E0). The first steps are those of the method's "
    "table, at omega0 h < 1 the pendulum's within its order, and none stops before its weights let forces of m g L "
    "make it leave all sense"
)
CIRCLE = f"below the last circle of the standard map |v| h stays below a turn; {KEPT}"
BELOW = math.sqrt(GREENE) * 0.994
"""omega0 h below that circle's end."""


def _small(name: str, product: float) -> Case:
    place = replace(LINEAR)
    return Case(f"{name}, small angles", GROUP, WHY, NO_GROWTH, PUBLISHED, place, _linear_rule(product),
                _linear(product))


def _large(name: str, truth: str, source: str, rule: Rule, attempt: Try, long: bool = False) -> Case:
    return Case(f"{name}, full gravity", GROUP, WHY, truth, source, replace(FULL), rule, attempt, long)


CASES = (
    *(_small(f"omega0 h = {product:g}", product) for product in PRODUCTS),
    _small("a step of 100 periods", PERIODS),
    _large("omega0 h = 0.98", CIRCLE, f"{STANDARD_MAP}; {EXACTLY}", _full_rule(STABLE),
           _full(BELOW, 3.0, 2.0 * math.pi)),
    _large("omega0 h = 0.98 for a million steps", CIRCLE, f"{STANDARD_MAP}; {EXACTLY}", _full_rule(STABLE),
           _full(BELOW, 3.0, 2.0 * math.pi, 1_000_000), True),
    _large("omega0 h = 1.5", "no circle of the standard map is left at K = 2.25, and 1.5 rad lies outside its island: "
           f"|v| h grows as sqrt(n), which must be named; {KEPT}", f"{DIFFUSION}; {EXACTLY}", _full_rule(DIVERGED),
           _full(1.5, 1.5, math.inf)),
    _large("omega0 h = 20", f"a kick is worth up to 200 m g L, and a few must be named; {KEPT}",
           f"{DIFFUSION}; {EXACTLY}", _full_rule(DIVERGED), _full(20.0, 3.0, math.inf)),
    _large("a step of 100 periods", f"a kick is worth up to 200 000 m g L, and must be named; {KEPT}",
           f"{DIFFUSION}; {EXACTLY}", _full_rule(DIVERGED), _full(PERIODS, 3.0, math.inf)),
)
