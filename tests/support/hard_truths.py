"""Exact motions of hard cases by other ways than 40-digit series: closed forms, and SciPy piece by piece.

The tests compare them with those that ``pendulum_env/hard_cases/true_motions.json`` holds, and with mpmath.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np

from pendulum_env.hard_cases import chaos, extremes, fast_drive, non_smooth, resonance, switching
from pendulum_env.hard_cases.case import EARTH
from pendulum_env.hard_cases.chaos import DOUBLINGS
from pendulum_env.hard_cases.predicted import Motion
from pendulum_env.physics import exact
from pendulum_env.physics.presets import SCENES
from pendulum_env.truth.answer import Array
from pendulum_env.truth.pieces import SceneEquation, dormand_prince, path
from pendulum_env.truth.reference import reference

Force = Callable[[float, float, float], float]
"""``force(t, theta, theta')``, a hand-written acceleration without dry friction [rad/s²]."""
SHORT = 0.08
"""Longest piece of a motion under a hand-written force [s], in which the velocity changes its sign at most once."""


def by_hand(force: Force, limit: float = 0.0) -> SceneEquation:
    """Return the equation of motion of a hand-written force and of dry friction up to ``limit`` [rad/s²].

    Between zeros of the velocity ``theta'' = force(t, theta, theta') - limit sign(theta')`` is smooth; at a zero the
    bob stays at rest while ``|force(t, theta, 0)| <= limit`` (Coulomb 1785; Filippov 1988, Differential Equations with
    Discontinuous Righthand Sides, section 4).
    """
    return SceneEquation(lambda t, q, v, direction: force(t, q, v) - direction * limit, limit, SHORT, (), [], limit > 0)


def traced(force: Force, limit: float, start: tuple[float, float], marks: Iterable[float]) -> tuple[Array, Array]:
    """Return angle and velocity under a hand-written force and dry friction at the times ``marks`` [s], from 0 on.

    ``limit`` is the largest acceleration by dry friction [rad/s²]; 0: no friction.
    """
    angle, velocity = np.array(path(by_hand(force, limit), dormand_prince, start, marks)).T
    return angle, velocity


def in_turn(forces: Iterable[Force], start: tuple[float, float], gap: float) -> tuple[Array, Array]:
    """Return angle and velocity at the start, and after each of several smooth forces has acted for ``gap`` [s]."""
    rows = [start]
    for k, force in enumerate(forces):
        rows.append(dormand_prince(by_hand(force), k * gap, rows[-1], (k + 1) * gap))
    angle, velocity = np.array(rows).T
    return angle, velocity


# --- near the top ----------------------------------------------------------------------------------------------------


def gudermannian(time: Array) -> tuple[Any, Any]:
    """Return the exact angle and velocity on the separatrix: theta = 2 gd(omega0 t) = 4 atan(tanh(omega0 t/2))."""
    omega0 = SCENES["vacuum"].omega0
    return 4.0 * np.arctan(np.tanh(0.5 * omega0 * time)), 2.0 * omega0 / np.cosh(omega0 * time)


LIFT = 0.1
"""Tilt [rad] at which the comparison of a bob that is pushed at the top ends, about."""


def linear(v: float) -> float:
    """Return the acceleration by linear drag at a velocity."""
    return -extremes.GAMMA * v


def quadratic(v: float) -> float:
    """Return the acceleration by quadratic drag at a velocity."""
    return -extremes.DRAG * abs(v) * v


def sphere(v: float) -> float:
    """Return the acceleration by the drag of a sphere, 6 pi mu a v (1 + 0.15 Re^0.687)/m (Schiller & Naumann 1933)."""
    reynolds = extremes.DENSITY * abs(v) * 2.0 * extremes.RADIUS / extremes.VISCOSITY
    stokes = -6.0 * math.pi * extremes.VISCOSITY * extremes.RADIUS * v / extremes.MASS
    return stokes * (1.0 + 0.15 * math.pow(reynolds, 0.687))


def wire(v: float) -> float:
    """Return the acceleration by the drag of a rod of 1 m, a cylinder with C_d = 1 + 10 Re^(-2/3) (White 2006)."""
    layer = math.pow(extremes.VISCOSITY / extremes.DENSITY / extremes.THICKNESS, 2.0 / 3.0)
    skin = 1.5 * layer * math.pow(abs(v), 1.0 / 3.0)
    return -extremes.DENSITY * extremes.THICKNESS * (0.125 * abs(v) + skin) * v / extremes.MASS


DRAGS: dict[str, Callable[[float], float]] = {
    "no damping": lambda v: 0.0, "linear drag": linear, "quadratic drag": quadratic,
    "both drags": lambda v: linear(v) + quadratic(v), "a bearing's friction": linear, "a sphere's drag": sphere,
    "a wire's drag": wire,
}
"""Kind of damping -> hand-written acceleration at a velocity."""


def tilts(name: str, push: float, steps: int, every: int) -> tuple[Array, Array]:
    """Return the exact distance from the top in units of GAP, and its rate over omega0, every ``every`` steps.

    ``name`` is a kind of damping, and ``push`` the velocity towards the top [rad/s]. The tilt y obeys
    y'' = omega0² sin(y) + drag(y'). It is scaled by its first value, so that no number underflows.
    """
    drag, gap = DRAGS[name], extremes.GAP

    def force(_t: float, tilt: float, rate: float) -> float:
        return (EARTH * math.sin(gap * tilt) + drag(gap * rate)) / gap

    tilt, rate = in_turn([force] * (steps // every), (1.0, -push / gap), extremes.PRODUCT / extremes.RATE * every)
    return tilt, rate / extremes.RATE


def fallen(name: str, push: float) -> tuple[Array, Array]:
    """Return the motion of :func:`tilts` until the tilt is about LIFT, under the growth that linear drag leaves."""
    slow = -DRAGS[name](1e-12) / 1e-12 / extremes.RATE
    pace = math.hypot(1.0, 0.5 * slow) - 0.5 * slow  # rate of growth over omega0
    parts = math.ceil(math.log(LIFT / extremes.GAP) / (extremes.PRODUCT * pace) / extremes.STRIDE)
    return tilts(name, push, parts * extremes.STRIDE, extremes.STRIDE)


# --- fast drives -----------------------------------------------------------------------------------------------------

TERMS = 20_000
"""Terms of Hill's determinant on either side; the error decreases as TERMS**-3."""


def half_trace(share: float) -> float:
    """Return half the trace of the matrix that advances a small tilt near the top by one period of the pivot.

    ``share`` is the pivot's amplitude b/L, and Omega its angular frequency. The tilt y obeys Mathieu's equation y'' +
    (a - 2 q cos 2 tau) y = 0 with a = -4 ratio², q = -2 b/L, tau = Omega t/2. Half the trace is cos(pi nu) = 1 - 2 D
    sin²(pi sqrt(a)/2), where D is the determinant with the rows (x_k, 1, x_k), x_k = q/(4 k² - a) (Hill 1886; Whittaker
    & Watson 1927, 19.42).
    """
    a = -4.0 * fast_drive.SLOWNESS**2
    before, last, x = 1.0, 1.0, 0.0
    for k in range(-TERMS, TERMS + 1):
        x, old = 2.0 * share / (4.0 * k * k - a), x
        before, last = last, last - x * old * before
    return 1.0 + 2.0 * last * math.sinh(0.5 * math.pi * math.sqrt(-a)) ** 2


def returns(share: float) -> Array:
    """Return the tilt of Kapitza's pendulum relative to its start, after each period of the pivot.

    The pendulum starts at rest when the pivot is at its highest point; ``share`` is the pivot's amplitude b/L. The tilt
    is Chebyshev's polynomial T_n of half the trace, because the motion is even in time there and the determinant is 1.
    """
    mean = half_trace(share)
    tilts = [1.0, mean]
    for _ in range(fast_drive.PERIODS - 1):
        tilts.append(2.0 * mean * tilts[-1] - tilts[-2])
    return np.array(tilts)


def turned(centres: Iterable[float], phase: float, start: float = 0.0) -> tuple[Array, Array]:
    """Return the exact angle [rad] and velocity/omega0 of small swings from rest at ``start``, and after each torque.

    ``centres`` are the equilibrium angles [rad] under torques that last for ``phase``/omega0 each. The state rotates
    about them (Landau & Lifshitz 1976, section 22).
    """
    angle, speed, rows = start, 0.0, [(start, 0.0)]
    cosine, sine = math.cos(phase), math.sin(phase)
    for centre in centres:
        offset = angle - centre
        angle, speed = centre + offset * cosine + speed * sine, speed * cosine - offset * sine
        rows.append((angle, speed))
    states = np.array(rows)
    return states[:, 0], states[:, 1]


def pushed(shares: Array, phase: float, start: float = 0.0) -> tuple[Array, Array]:
    """Return the motion of :func:`turned` under fractions of the full torque, one per control step."""
    return turned(fast_drive.ANSWER * shares, phase, start)


def uniforms(state: Iterable[int]) -> Iterator[float]:
    """Yield uniform random numbers of the generator MRG32k3a, computed in integers.

    ``state`` holds three integers for each of its two recurrences (L'Ecuyer 1999, Operations Research 47, 159).
    """
    first, second = 2**32 - 209, 2**32 - 22853
    a, b, c, d, e, f = state
    while True:
        a, b, c = b, c, (1403580 * b - 810728 * a) % first
        d, e, f = e, f, (527612 * f - 1370589 * d) % second
        yield ((c - f) % first or first) / (first + 1)


def gust_path(seed: int, span: float, count: int) -> Array:
    """Return the gusts [m/s] in successive control steps of ``span`` [s], by the exact Ornstein-Uhlenbeck recursion.

    The random state comes from NumPy's generator with the seed, normal numbers from Box & Muller 1958. This is
    independent of the engine's implementation.
    """
    generator = np.random.default_rng(seed)
    draw = uniforms([int(generator.random() * 4294944442.0) + 1 for _ in range(6)])
    correlation, gust, gusts = math.exp(-span / fast_drive.GUST_TIME), 0.0, []
    for k in range(count):
        share = correlation if k else 0.0
        radius, turn = math.sqrt(-2.0 * math.log(next(draw))), 2.0 * math.pi * next(draw)
        gust = share * gust + fast_drive.GUST * math.sqrt(1.0 - share * share) * radius * math.cos(turn)
        gusts.append(gust)
    return np.array(gusts)


AREA = 0.5 * fast_drive.DENSITY * fast_drive.C_D * math.pi * fast_drive.RADIUS**2
"""Drag force over speed squared in the cases of wind [kg/m]."""


def airs(case: str) -> tuple[float, ...]:
    """Return the wind [m/s] in each control step of the case of gusts, or of a wind that reverses."""
    if case == fast_drive.GUSTY.name:
        gusts = fast_drive.WIND + gust_path(fast_drive.SEED, fast_drive.CONTROL, fast_drive.COUNT)
    else:
        gusts = gust_path(switching.SEED, fast_drive.CONTROL, switching.COUNT) * (switching.STORM / fast_drive.GUST)
    return tuple(gusts.tolist())


def blown(airs: tuple[float, ...]) -> tuple[Array, Array]:
    """Return the exact angle and velocity [rad, rad/s] after each control step in a wind [m/s] constant in each."""
    length, mass = fast_drive.LENGTH, fast_drive.MASS

    def within(air: float) -> Force:
        def force(_t: float, q: float, v: float) -> float:
            slip, across = length * v - air * math.cos(q), air * math.sin(q)
            drag = -AREA * math.hypot(slip, across) * slip
            return drag / (mass * length) - 9.81 * math.sin(q) / length - fast_drive.LINEAR * slip / length

        return force

    return in_turn(map(within, airs), (fast_drive.TURNED, 0.0), fast_drive.CONTROL)


# --- kinks and jumps -------------------------------------------------------------------------------------------------


def dry_swing(phase: Array) -> tuple[Array, Array]:
    """Return the exact angle and velocity/omega0 of a small swing under dry friction, at the phases omega0 t.

    The swing starts at AMPLITUDE. Half swing k is a cosine about (-1)^k RATIO; it lasts pi/omega0 and reduces the
    amplitude by 2 RATIO.
    """
    ratio, halves = non_smooth.RATIO, non_smooth.HALVES
    half = np.minimum(np.floor(phase / math.pi), halves)
    moving, size = half < halves, non_smooth.AMPLITUDE - 2.0 * ratio * half
    side = 1.0 - 2.0 * (half % 2)
    within = np.where(moving, phase, 0.0) - math.pi * half
    angle = side * (ratio + (size - ratio) * np.cos(within))
    speed = -side * (size - ratio) * np.sin(within)
    return np.where(moving, angle, side * size), np.where(moving, speed, 0.0)


def slides(time: Array) -> tuple[Any, Any]:
    """Return the exact motion from EDGE (1 + HAIR): half a swing about EDGE by 2 EDGE HAIR, then rest."""
    edge, omega0 = non_smooth.EDGE, non_smooth.EDGED.omega0
    phase, size = np.minimum(omega0 * time, math.pi), edge * non_smooth.HAIR
    return edge + size * np.cos(phase), -omega0 * size * np.sin(phase)


def risen(time: Array) -> tuple[Array, Array]:
    """Return the exact motion of the oscillator under the torque PUSH sin(SLOW t), held by dry friction at first.

    The bob slides from rest at LET_GO [s] on, against the friction LIMIT.
    """
    limit, push, slow, let_go = non_smooth.LIMIT, non_smooth.PUSH, non_smooth.SLOW, non_smooth.LET_GO
    since = np.maximum(time - let_go, 0.0)
    answer = push / (1.0 - slow * slow)
    even, odd = limit - answer * math.sin(slow * let_go), -answer * slow * math.cos(slow * let_go)
    angle = answer * np.sin(slow * time) - limit + even * np.cos(since) + odd * np.sin(since)
    velocity = answer * slow * np.cos(slow * time) - even * np.sin(since) + odd * np.cos(since)
    return np.where(since > 0.0, angle, 0.0), np.where(since > 0.0, velocity, 0.0)


def swing_force(t: float, q: float, v: float) -> float:
    """Return the acceleration of a pendulum under gravity and quadratic drag."""
    return -EARTH * math.sin(q) - non_smooth.DRAG * abs(v) * v


def turns_force(t: float, q: float, v: float) -> float:
    """Return the acceleration of a small-angle pendulum under a periodic torque."""
    return non_smooth.TORQUE * math.cos(non_smooth.RATE * t) - q


def many_force(t: float, q: float, v: float) -> float:
    """Return the acceleration of a pendulum under gravity, quadratic drag and a periodic torque."""
    return non_smooth.TORQUE * math.cos(non_smooth.RATE * t) - math.sin(q) - non_smooth.WEAK * abs(v) * v


def shaken_force(t: float, q: float, v: float) -> float:
    """Return the acceleration of a pendulum whose pivot moves as x = b sin(RATE t), under gravity.

    The pivot's acceleration, with the opposite sign, acts along cos(theta).
    """
    return non_smooth.TORQUE * math.sin(non_smooth.RATE * t) * math.cos(q) - math.sin(q)


def steep_force(t: float, q: float, v: float) -> float:
    """Return the acceleration of a pendulum under gravity."""
    return -EARTH * math.sin(q)


# --- torques that change ---------------------------------------------------------------------------------------------


def thrown(drag: float) -> tuple[Array, Array]:
    """Return the exact angle [rad] and velocity [rad/s] after each step under random torques, with quadratic drag."""

    def under(torque: float) -> Force:
        return lambda _t, q, v: torque - EARTH * math.sin(q) - drag * abs(v) * v

    torques = (switching.STRENGTH * EARTH * share for share in switching.shares(switching.STEPS).tolist())
    return in_turn(map(under, torques), (switching.START, 0.0), switching.PHASE / math.sqrt(EARTH))


def yielded(time: Array) -> tuple[Any, Any]:
    """Return the exact angle and velocity of a bob that slides from LET_GO [s] on, under a torque of 11 days.

    The excess of the torque is ``0.6 s - 0.4 s² - 0.1 s³`` with s = SLOW times the time since then, and smaller terms.
    """
    slow, since = switching.SLOW, np.maximum(time - switching.LET_GO, 0.0)
    # theta'' + theta = excess, from rest: t -> t - sin(t), t² -> t² - 2 + 2 cos(t).
    angle = 0.6 * slow * (since - np.sin(since)) - 0.4 * slow**2 * (since**2 - 4.0 * np.sin(0.5 * since) ** 2)
    velocity = 0.6 * slow * 2.0 * np.sin(0.5 * since) ** 2 - 0.8 * slow**2 * (since - np.sin(since))
    return angle, velocity


def climbed() -> tuple[Array, Array]:
    """Return the exact angle [rad] and velocity [rad/s] at the start and at all marks under a torque in steps.

    The bob is at rest until the torque exceeds the limit. In the k-th part of the time after that it turns about the
    angle k GRAIN, as the torque exceeds the limit by k GRAIN.
    """
    angle, speed = turned(range(1, switching.SLIDES + 1), switching.TURN)
    still = np.zeros(switching.HOLDS)
    return switching.GRAIN * np.concatenate([still, angle]), switching.GRAIN * np.concatenate([still, speed])


# --- every motion ----------------------------------------------------------------------------------------------------


def _swing(motion: Motion, time: Array) -> tuple[Any, Any]:
    """Return the motion of a pendulum under gravity alone, by Jacobi's elliptic functions."""
    omega0 = motion.scene.omega0
    return exact.pendulum(time, motion.angle, motion.velocity * omega0, omega0)


def _cosine(motion: Motion, time: Array) -> tuple[Any, Any]:
    """Return the motion of a linear pendulum from rest."""
    omega0 = motion.scene.omega0
    return motion.angle * np.cos(omega0 * time), -motion.angle * omega0 * np.sin(omega0 * time)


def _forced(force: Force, limit: float = 0.0) -> Callable[[Motion, Array], tuple[Any, Any]]:
    """Return a function that integrates a motion under a hand-written force and dry friction with SciPy."""
    return lambda motion, time: traced(force, limit, (motion.angle, motion.velocity * motion.scene.omega0), time)


def _slowed(motion: Motion, time: Array) -> tuple[Any, Any]:
    """Return the closed form or the reference solution of a motion under fast damping."""
    found = reference(motion.scene, motion.angle, motion.velocity * motion.scene.omega0, time)
    return found.angle, found.velocity


def _scaled(motion: Motion, states: tuple[Any, Any]) -> tuple[Any, Any]:
    """Return states with velocities in rad/s in place of omega0."""
    return states[0], motion.scene.omega0 * np.asarray(states[1])


def _on_orbit(motion: Motion, time: Array) -> tuple[Any, Any]:
    """Return the first period of the chaotic pendulum on an orbit that doubles its period."""
    strength = next(one.strength for one in DOUBLINGS if chaos.doubled(one).name == motion.name)
    return _forced(lambda t, q, v: strength * math.cos(t * (2.0 / 3.0)) - math.sin(q) - 0.5 * v)(motion, time)


def _flipped(motion: Motion, time: Array) -> tuple[Any, Any]:
    """Return a small swing under the torques of a motion."""
    return _scaled(motion, turned(motion.torques, motion.time / motion.marks, motion.angle))


OTHERWISE: dict[str, Callable[[Motion, Array], tuple[Any, Any]]] = {
    "the separatrix": lambda motion, time: gudermannian(time),
    "Coulomb friction to rest, small angles": lambda motion, time: _scaled(
        motion, dry_swing(motion.scene.omega0 * time)),
    "Coulomb friction to rest in coarse steps": lambda motion, time: _scaled(
        motion, dry_swing(motion.scene.omega0 * time)),
    "Coulomb friction to rest, large angles": _forced(steep_force, non_smooth.STEEP_RATIO * EARTH),
    "a hair beyond the band": lambda motion, time: slides(time),
    "a slowly rising torque": lambda motion, time: risen(time),
    "sticking and sliding by turns": _forced(turns_force, non_smooth.LIMIT),
    "let go by a shaken pivot": _forced(shaken_force, non_smooth.LIMIT),
    "quadratic drag to rest in dry friction": _forced(swing_force, non_smooth.WITH_BOTH * EARTH),
    "dry friction, quadratic drag and a torque": _forced(many_force, non_smooth.LIMIT),
    "the kinks of quadratic drag": _forced(swing_force),
    "gusts": lambda motion, time: blown(airs(motion.name)),
    "a wind that reverses": lambda motion, time: blown(airs(motion.name)),
    "torque changing sign each control step": _flipped,
    "torque changing sign each step": _flipped,
    "random actions": _flipped,
    "bang-bang": _flipped,
    "a random torque in each step, full gravity": lambda motion, time: thrown(0.0),
    "a random torque in each step, quadratic drag": lambda motion, time: thrown(switching.DRAG),
    "a torque that takes 11 days to rise": lambda motion, time: yielded(time),
    "a torque that exceeds dry friction by one part in 1e6": lambda motion, time: climbed(),
    "right at 1 m and 1 kg, with a motor": lambda motion, time: _forced(
        lambda _t, q, _v: motion.scene.omega0**2 * (0.05 - math.sin(q)))(motion, time),
    "a tiny swing": _cosine,
    "a torque at 2 omega0 for 1e5 periods": lambda motion, time: resonance.steady(time),
    "an honest horizon": lambda motion, time: (
        np.array([0.2, chaos.MOTION.angle[0]]), np.array([0.0, chaos.MOTION.velocity[0]])),
    **{chaos.doubled(one).name: _on_orbit for one in DOUBLINGS},
    **{fast_drive.edge(share): lambda motion, time, share=share: (
        math.pi - fast_drive.TILT * returns(share), np.full(len(time), math.nan)) for share in fast_drive.SHARES},
}
"""Name of a motion -> another way to its exact angle and velocity; others have the closed forms of their scenes."""


def otherwise(motion: Motion) -> tuple[Any, Any]:
    """Return the exact angle and velocity at the start and the marks of a motion, by another way than 40 digits."""
    time = motion.time / motion.scene.omega0 * np.arange(motion.marks + 1.0) / motion.marks
    way = _slowed if "drag" in motion.equation else _cosine if motion.equation == "linear" else _swing
    return OTHERWISE.get(motion.name, way)(motion, time)
