"""Exact motions of hard cases by other ways than 40-digit series: closed forms, and SciPy piece by piece.

The tests compare them with those that ``pendulum_env/hard_cases/true_motions.json`` holds, and with mpmath.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np

from pendulum_env.hard_cases import fast_drive, non_smooth, switching
from pendulum_env.hard_cases.case import EARTH
from pendulum_env.physics.presets import SCENES
from pendulum_env.truth.answer import Array
from pendulum_env.truth.pieces import Force, by_hand, dormand_prince, in_turn, path

Exact = Callable[[Array], tuple[Any, Any]]
"""Exact angle [rad] and velocity [rad/s] at some times [s]."""


def traced(force: Force, limit: float, start: tuple[float, float], marks: Iterable[float]) -> tuple[Array, Array]:
    """Return angle and velocity under a hand-written force and dry friction at the times ``marks`` [s], from 0 on.

    ``limit`` is the largest acceleration by dry friction [rad/s²]; 0: no friction.
    """
    angle, velocity = np.array(path(by_hand(force, limit), dormand_prince, start, marks)).T
    return angle, velocity


# --- near the top ----------------------------------------------------------------------------------------------------


def gudermannian(time: Array) -> tuple[Any, Any]:
    """Return the exact angle and velocity on the separatrix: theta = 2 gd(omega0 t) = 4 atan(tanh(omega0 t/2))."""
    omega0 = SCENES["vacuum"].omega0
    return 4.0 * np.arctan(np.tanh(0.5 * omega0 * time)), 2.0 * omega0 / np.cosh(omega0 * time)


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


def airs(case: str) -> tuple[float, ...]:
    """Return the wind [m/s] in each control step of the case of gusts, or of a wind that reverses."""
    if case == fast_drive.GUSTY.name:
        gusts = fast_drive.WIND + gust_path(fast_drive.SEED, fast_drive.CONTROL, fast_drive.COUNT)
    else:
        gusts = gust_path(switching.SEED, fast_drive.CONTROL, switching.COUNT) * (switching.STORM / fast_drive.GUST)
    return tuple(gusts.tolist())


def blown(airs: tuple[float, ...]) -> tuple[Array, Array]:
    """Return the exact angle and velocity [rad, rad/s] after each control step in a wind [m/s] constant in each."""
    length, mass, area = fast_drive.LENGTH, fast_drive.MASS, fast_drive.AREA

    def within(air: float) -> Force:
        def force(_t: float, q: float, v: float) -> float:
            slip, across = length * v - air * math.cos(q), air * math.sin(q)
            drag = -area * math.hypot(slip, across) * slip
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
    return in_turn(map(under, torques), (switching.START, 0.0), switching.PHASE / switching.RATE)


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
