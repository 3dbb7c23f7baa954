"""Hard cases: drives faster than the swing, at the edge of stability, in jumps and in gusts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from integrators import Method
from pendulum_env.engine.machine import ANGLE, INDEX, VELOCITY, Machine
from pendulum_env.hard_cases.case import (
    ACCURATE,
    DIVERGED,
    STABLE,
    Case,
    Finding,
    Try,
    graded,
    judged,
    ran,
    resolved,
    sooner,
    stopped,
)
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import (
    Gravity,
    Gusts,
    LinearDrag,
    Motor,
    QuadraticDrag,
    SmallAngleGravity,
    VerticalDrive,
    Wind,
)
from pendulum_env.physics.medium import Medium
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.piecewise import smooth
from pendulum_env.truth.steps import left

Array = NDArray[np.float64]
GROUP = "fast drive"

# --- Kapitza's pendulum at the edges of stability --------------------------------------------------------------------

SHAKEN, SLOWNESS = 20.0, 0.05
"""The pivot's rate [rad/s] and omega0 over it."""
LOWER, UPPER = 0.07078795806129157, 0.45821858211327277
"""b/L between which upright is stable at this ratio: a_0(2 b/L) = -4 ratio² = b_1(2 b/L), Mathieu's characteristic
values, solved to 16 digits."""
PERIODS, PER_PERIOD, TILT = 8, 100, 1e-6
"""Length of the run, steps per period, and the tilt at its start [rad]."""
TERMS = 20_000
"""Of Hill's determinant on either side: it converges as TERMS**-3."""


@lru_cache(maxsize=16)
def half_trace(share: float) -> float:
    """Half the trace of the map over one of the pivot's periods next to the top, for b/L = ``share``.

    Near the top Mathieu's y'' + (a - 2 q cos 2 tau) y = 0 holds with a = -4 ratio², q = -2 b/L, tau = Omega t/2, whose
    half trace is cos(pi nu) = 1 - 2 D sin²(pi sqrt(a)/2), D the determinant of the rows (x_k, 1, x_k) with
    x_k = q/(4 k² - a) (Hill 1886; Whittaker & Watson 1927, 19.42).
    """
    a = -4.0 * SLOWNESS**2
    before, last, x = 1.0, 1.0, 0.0
    for k in range(-TERMS, TERMS + 1):
        x, old = 2.0 * share / (4.0 * k * k - a), x
        before, last = last, last - x * old * before
    return 1.0 + 2.0 * last * math.sinh(0.5 * math.pi * math.sqrt(-a)) ** 2


def returns(share: float) -> Array:
    """The tilt over its start after each period, from rest where the pivot is highest: T_n(half trace), Chebyshev's.

    There the motion is even in time, so that the diagonal of the map is twice half its trace, and its determinant 1.
    """
    mean = half_trace(share)
    found = [1.0, mean]
    for _ in range(PERIODS - 1):
        found.append(2.0 * mean * found[-1] - found[-2])
    return np.array(found)


def _kapitza(share: float) -> Case:
    scene = Scene("a pivot shaken fast", Body(length=1.0, mass=1.0), gravity=(SLOWNESS * SHAKEN) ** 2,
                  effects=(Gravity(), VerticalDrive(vertical_amplitude=share, vertical_rate=SHAKEN)))

    def attempt(method: Method) -> Finding:
        start, phase = math.pi - TILT, 2.0 * math.pi / PER_PERIOD
        run = ran(scene, method, dt=phase / SHAKEN, steps=PERIODS * PER_PERIOD, every=PER_PERIOD, angle=start,
                  velocity=0.0)
        ended = stopped(run)
        if ended is not None:
            return ended
        found, truth = (math.pi - run.angle) / (math.pi - start), returns(share)
        most = float(np.max(np.abs(truth)))
        allowed = (left(method, phase, 2.0 * math.pi * PERIODS**2) + 1e-8) * most
        lost = "" if np.max(np.abs(found)) <= 10.0 * most else "it leaves the top in another way"
        return judged(run, found - truth, allowed, lost)

    edge, limit = ("lower", LOWER) if share < 0.2 else ("upper", UPPER)
    where = "at" if share == limit else f"{abs(share / limit - 1.0):.0%} {'below' if share < limit else 'above'}"
    return Case(
        f"upright, {where} the {edge} edge", GROUP, "At an edge errors add up as the square of the time, and decide.",
        "the tilt after each period of the pivot is Chebyshev's T_n of half the trace of Mathieu's equation; allowed "
        "is 2 pi n² (Omega h)^p, at most a tenth; stable: no more than ten times the truth",
        "Hill 1886, Acta Math. 8, 1; Whittaker & Watson 1927, 19.42; edges: McLachlan 1947; DLMF 28.17",
        scene, lambda method: frozenset({ACCURATE} if method.order > 2 else {ACCURATE, STABLE}), attempt)


# --- a motor that changes sign each step ----------------------------------------------------------------------------

ANSWER = 0.05
"""Full torque over m g L: the angle at which the motor holds the bob [rad]."""
PUSHED = Scene("small angles with a motor", Body(length=1.0, mass=1.0), gravity=9.81,
               effects=(SmallAngleGravity(), Motor(max_torque=ANSWER * 9.81)))
HOLD = 8
"""Steps in a control step, unless a method of several steps wants more."""


def pushed(shares: Array, phase: float, start: float = 0.0) -> tuple[Array, Array]:
    """Angle and velocity/omega0 after each control step of ``phase`` = omega0 dt, from rest at ``start`` [rad].

    In each the state goes round the angle that the torque holds, by a rotation (Landau & Lifshitz 1976, section 22).
    """
    angle, speed, rows = start, 0.0, [(start, 0.0)]
    cosine, sine = math.cos(phase), math.sin(phase)
    for share in shares:
        centre = ANSWER * share
        away = angle - centre
        angle, speed = centre + away * cosine + speed * sine, speed * cosine - away * sine
        rows.append((angle, speed))
    found = np.array(rows)
    return found[:, 0], found[:, 1]


def driven(method: Method, shares: Array, phase: float, start: float, hold: int) -> tuple[Array, Array, int]:
    """The same by a method, and how a run ended, a key of STOP_REASONS or 0."""
    machine = Machine(PUSHED, method, backend=sooner(method, hold * len(shares)))
    state, omega0 = machine.state(start, 0.0), PUSHED.omega0
    rows = [(start, 0.0)]
    for share in shares:
        code = machine.advance(state, float(share), phase / omega0 / hold, hold)
        rows.append((float(state[ANGLE]), float(state[VELOCITY]) / omega0))
        if code:
            return np.array([]), np.array([float(state[INDEX])]), code
    found = np.array(rows)
    return found[:, 0], found[:, 1], 0


def against_pushed(method: Method, shares: Array, phase: float, start: float, hold: int) -> Finding:
    """A method under piecewise constant torque, judged against its closed form."""
    angle, speed, code = driven(method, shares, phase, start, hold)
    if code:
        return Finding(DIVERGED, stop_time=float(speed[0]) * phase / PUSHED.omega0 / hold)
    return answered(method, np.stack([angle, speed]), np.stack(pushed(shares, phase, start)), phase, hold)


def answered(method: Method, found: Array, truth: Array, phase: float, hold: int) -> Finding:
    """Angles and velocities/omega0 after control steps, judged: (omega0 h)^p omega0 t of the truth's size."""
    size = float(np.max(np.hypot(*truth))) + ANSWER
    allowed = size * left(method, phase / hold, phase * (truth.shape[1] - 1)) + 1e-12
    return graded(found - truth, allowed, "it grows" if np.max(np.abs(found)) > 10.0 * size else "")


def _flipping(hold: int) -> Try:
    """Full torque one way and the other in turn, for 200 control steps of a tenth of omega0 t."""
    shares = np.where(np.arange(200) % 2, -1.0, 1.0)
    return lambda method: against_pushed(method, shares, 0.1, 0.3, hold)


# --- gusts ----------------------------------------------------------------------------------------------------------

LENGTH, MASS, RADIUS, DENSITY, C_D, LINEAR = 0.353, 0.0027, 0.02, 1.2, 0.45, 0.1
WIND, GUST, GUST_TIME = 3.0, 1.0, 0.5
"""Steady wind and standard deviation of gusts [m/s], their correlation time [s]."""
WINDY = Scene("gusts", Body(length=LENGTH, mass=MASS, radius=RADIUS), Medium("air", DENSITY, 1.8e-5), gravity=9.81,
              effects=(Gravity(), QuadraticDrag(drag_coefficient=C_D), LinearDrag(gamma=LINEAR), Wind(WIND),
                       Gusts(gust_speed=GUST, gust_time=GUST_TIME)))
SEED, CONTROL, HELD, COUNT, TURNED = 7, 0.1, 20, 50, 0.5
"""Seed, control step [s], steps in it, how many of them, and the start [rad]."""


def uniforms(state: Iterable[int]) -> Iterator[float]:
    """MRG32k3a in whole numbers, from the three of each recurrence (L'Ecuyer 1999, Operations Research 47, 159)."""
    first, second = 2**32 - 209, 2**32 - 22853
    a, b, c, d, e, f = state
    while True:
        a, b, c = b, c, (1403580 * b - 810728 * a) % first
        d, e, f = e, f, (527612 * f - 1370589 * d) % second
        yield ((c - f) % first or first) / (first + 1)


def gust_path(seed: int, span: float, count: int) -> Array:
    """Gusts [m/s] in successive control steps of ``span`` [s]: the exact Ornstein-Uhlenbeck recursion.

    The random state comes from NumPy's generator of the seed, normal numbers by Box & Muller 1958; written here once
    more and apart from what runs.
    """
    generator = np.random.default_rng(seed)
    draw = uniforms([int(generator.random() * 4294944442.0) + 1 for _ in range(6)])
    kept, gust, found = math.exp(-span / GUST_TIME), 0.0, []
    for k in range(count):
        share = kept if k else 0.0
        radius, turn = math.sqrt(-2.0 * math.log(next(draw))), 2.0 * math.pi * next(draw)
        gust = share * gust + GUST * math.sqrt(1.0 - share * share) * radius * math.cos(turn)
        found.append(gust)
    return np.array(found)


@lru_cache(maxsize=1)
def blown() -> tuple[Array, Array]:
    """Angle and velocity after each control step, gusts held in it: drag on the velocity relative to the air."""
    state, rows = (TURNED, 0.0), [(TURNED, 0.0)]
    area = 0.5 * DENSITY * C_D * math.pi * RADIUS**2
    for k, gust in enumerate(gust_path(SEED, CONTROL, COUNT)):

        def force(_t: float, q: float, v: float, air: float = WIND + gust) -> float:
            slip, across = LENGTH * v - air * math.cos(q), air * math.sin(q)
            drag = -area * math.hypot(slip, across) * slip * LENGTH
            inertia = MASS * LENGTH**2
            return (drag - MASS * 9.81 * LENGTH * math.sin(q)) / inertia - LINEAR * slip / LENGTH

        state = smooth(force, state, k * CONTROL, (k + 1) * CONTROL)
        rows.append(state)
    found = np.array(rows)
    return found[:, 0], found[:, 1]


def _gusts(method: Method) -> Finding:
    h = CONTROL / HELD
    run = ran(WINDY, method, dt=h, steps=HELD * COUNT, every=HELD, substeps=HELD, seed=SEED, angle=TURNED, velocity=0.0)
    ended = stopped(run)
    if ended is not None:
        return ended
    angle, velocity = blown()
    rate, size = WINDY.omega0, float(np.max(np.abs(angle)))
    allowed = size * left(method, rate * h, rate * CONTROL * COUNT) + 1e-11
    error = np.maximum(np.abs(run.angle - angle), np.abs(run.velocity - velocity) / rate)
    return judged(run, error, allowed, "it grows" if np.max(np.abs(run.angle)) > 10.0 * size else "")


SHARES = (0.9 * LOWER, LOWER, 1.1 * LOWER, 0.97 * UPPER, UPPER, 1.03 * UPPER)
"""b/L on both sides of the edges."""
ROTATIONS = "rotations about the angle that the torque holds (Landau & Lifshitz 1976, section 22)"

CASES = (
    *(_kapitza(share) for share in SHARES),
    Case("torque changing sign each control step", GROUP, "The force jumps at each control step, and its sum nearly "
         "cancels.", "a rotation for each control step; allowed is (omega0 h)^p omega0 t", ROTATIONS, PUSHED,
         resolved, _flipping(HOLD)),
    Case("torque changing sign each step", GROUP, "The force jumps at each step, so that no method has a past.",
         "a rotation for each step; allowed is (omega0 h)^p omega0 t", ROTATIONS, PUSHED, resolved,
         _flipping(1)),
    Case("gusts", GROUP, "The wind jumps at each control step, by up to its own size.",
         "scipy's DOP853 at 3e-14 in each control step, with a gust path of its own; allowed is (omega0 h)^p omega0 t "
         "of the largest angle", "Uhlenbeck & Ornstein 1930; L'Ecuyer 1999; Hairer, Norsett & Wanner 1993, II.5",
         WINDY, resolved, _gusts),
)
KNOWN: dict[tuple[str, str], str] = {}
"""(case, method) -> why it fails."""
