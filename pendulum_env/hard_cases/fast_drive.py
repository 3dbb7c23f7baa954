"""Hard cases: fast drives: Kapitza's pendulum at the edges of stability, a torque that jumps, and gusts."""

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
from pendulum_env.truth.steps import order_bound

Array = NDArray[np.float64]
GROUP = "fast drive"

# --- Kapitza's pendulum at the edges of stability --------------------------------------------------------------------

SHAKEN, SLOWNESS = 20.0, 0.05
"""Angular frequency of the pivot [rad/s], and the ratio of omega0 to it."""
LOWER, UPPER = 0.07078795806129157, 0.45821858211327277
"""Amplitudes b/L of the pivot between which the upright position is stable, to 16 digits.

They solve a_0(2 b/L) = -4 ratio² = b_1(2 b/L) with Mathieu's characteristic values a_0 and b_1.
"""
PERIODS, PER_PERIOD, TILT = 8, 100, 1e-6
"""Periods of the run, steps per period, and initial tilt [rad]."""
TERMS = 20_000
"""Terms of Hill's determinant on either side; the error decreases as TERMS**-3."""


@lru_cache(maxsize=16)
def half_trace(share: float) -> float:
    """Return half the trace of the matrix that advances a small tilt near the top by one period of the pivot.

    ``share`` is the pivot's amplitude b/L, and Omega its angular frequency. The tilt y obeys Mathieu's equation y'' +
    (a - 2 q cos 2 tau) y = 0 with a = -4 ratio², q = -2 b/L, tau = Omega t/2. Half the trace is cos(pi nu) = 1 - 2 D
    sin²(pi sqrt(a)/2), where D is the determinant with the rows (x_k, 1, x_k), x_k = q/(4 k² - a) (Hill 1886; Whittaker
    & Watson 1927, 19.42).
    """
    a = -4.0 * SLOWNESS**2
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
    for _ in range(PERIODS - 1):
        tilts.append(2.0 * mean * tilts[-1] - tilts[-2])
    return np.array(tilts)


def _kapitza(share: float) -> Case:
    """Return the case of Kapitza's upright pendulum with the pivot amplitude b/L = ``share``."""
    scene = Scene("a pivot shaken fast", Body(length=1.0, mass=1.0), gravity=(SLOWNESS * SHAKEN) ** 2,
                  effects=(Gravity(), VerticalDrive(vertical_amplitude=share, vertical_rate=SHAKEN)))

    def attempt(method: Method) -> Finding:
        start, phase = math.pi - TILT, 2.0 * math.pi / PER_PERIOD
        run = ran(scene, method, dt=phase / SHAKEN, steps=PERIODS * PER_PERIOD, every=PER_PERIOD, angle=start,
                  velocity=0.0)
        ended = stopped(run)
        if ended is not None:
            return ended
        tilt, truth = (math.pi - run.angle) / (math.pi - start), returns(share)
        most = float(np.max(np.abs(truth)))
        allowed = (order_bound(method, phase, 2.0 * math.pi * PERIODS**2) + 1e-8) * most
        lost = "" if np.max(np.abs(tilt)) <= 10.0 * most else "it moves more than ten times as far from the top"
        return judged(run, tilt - truth, allowed, lost)

    edge, limit = ("lower", LOWER) if share < 0.2 else ("upper", UPPER)
    where = "at" if share == limit else f"{abs(share / limit - 1.0):.0%} {'below' if share < limit else 'above'}"
    return Case(
        f"upright, {where} the {edge} edge", GROUP,
        "Close to the limit of stability errors grow as the square of the time and may make a stable motion grow.",
        "the tilt after each period of the pivot is Chebyshev's T_n of half the trace of Mathieu's equation; the "
        "tolerance is 2 pi n² (Omega h)^p, at most a tenth; stable: at most ten times the true tilt",
        "Hill 1886, Acta Math. 8, 1; Whittaker & Watson 1927, 19.42; edges: McLachlan 1947; DLMF 28.17",
        scene, lambda method: frozenset({ACCURATE} if method.order > 2 else {ACCURATE, STABLE}), attempt)


# --- a motor that changes sign each step ----------------------------------------------------------------------------

ANSWER = 0.05
"""Full torque over m g L, which is the equilibrium angle under full torque [rad]."""
PUSHED = Scene("small angles with a motor", Body(length=1.0, mass=1.0), gravity=9.81,
               effects=(SmallAngleGravity(), Motor(max_torque=ANSWER * 9.81)))
HOLD = 8
"""Steps per control step; multistep methods may need more."""


def pushed(shares: Array, phase: float, start: float = 0.0) -> tuple[Array, Array]:
    """Return the exact angle [rad] and velocity/omega0 of small swings after each control step, under given torques.

    ``shares`` are the fractions of the full torque, one per control step; ``phase`` is omega0 times the control step.
    The motion starts at rest at ``start`` [rad]. In each control step the state rotates about the equilibrium angle
    (Landau & Lifshitz 1976, section 22).
    """
    angle, speed, rows = start, 0.0, [(start, 0.0)]
    cosine, sine = math.cos(phase), math.sin(phase)
    for share in shares:
        centre = ANSWER * share
        offset = angle - centre
        angle, speed = centre + offset * cosine + speed * sine, speed * cosine - offset * sine
        rows.append((angle, speed))
    states = np.array(rows)
    return states[:, 0], states[:, 1]


def driven(method: Method, shares: Array, phase: float, start: float, hold: int) -> tuple[Array, Array, int]:
    """Return angle [rad] and velocity/omega0 after each control step of a method's run, and the stop code.

    ``hold`` is the number of steps per control step. The stop code is 0 for a complete run. After an early stop the
    first array is empty and the second holds the number of the step at which the run stopped.
    """
    machine = Machine(PUSHED, method, backend=sooner(method, hold * len(shares)))
    state, omega0 = machine.state(start, 0.0), PUSHED.omega0
    rows = [(start, 0.0)]
    for share in shares:
        code = machine.advance(state, float(share), phase / omega0 / hold, hold)
        rows.append((float(state[ANGLE]), float(state[VELOCITY]) / omega0))
        if code:
            return np.array([]), np.array([float(state[INDEX])]), code
    states = np.array(rows)
    return states[:, 0], states[:, 1], 0


def against_pushed(method: Method, shares: Array, phase: float, start: float, hold: int) -> Finding:
    """Judge a method's motion under piecewise constant torque against the closed form."""
    angle, speed, code = driven(method, shares, phase, start, hold)
    if code:
        return Finding(DIVERGED, stop_time=float(speed[0]) * phase / PUSHED.omega0 / hold)
    return answered(method, np.stack([angle, speed]), np.stack(pushed(shares, phase, start)), phase, hold)


def answered(method: Method, states: Array, truth: Array, phase: float, hold: int) -> Finding:
    """Judge angles and velocities/omega0 after control steps against the reference ``truth``.

    The relative tolerance is (omega0 h)^p omega0 t for a method of order p.
    """
    size = float(np.max(np.hypot(*truth))) + ANSWER
    allowed = size * order_bound(method, phase / hold, phase * (truth.shape[1] - 1)) + 1e-12
    return graded(states - truth, allowed, "it grows" if np.max(np.abs(states)) > 10.0 * size else "")


def _flipping(hold: int) -> Try:
    """Return a function that judges a method under full torque that changes sign at each control step.

    There are 200 control steps of omega0 dt = 0.1, of ``hold`` steps each.
    """
    shares = np.where(np.arange(200) % 2, -1.0, 1.0)
    return lambda method: against_pushed(method, shares, 0.1, 0.3, hold)


# --- gusts ----------------------------------------------------------------------------------------------------------

LENGTH, MASS, RADIUS, DENSITY, C_D, LINEAR = 0.353, 0.0027, 0.02, 1.2, 0.45, 0.1
WIND, GUST, GUST_TIME = 3.0, 1.0, 0.5
"""Steady wind and standard deviation of gusts [m/s], and correlation time of gusts [s]."""
WINDY = Scene("gusts", Body(length=LENGTH, mass=MASS, radius=RADIUS), Medium("air", DENSITY, 1.8e-5), gravity=9.81,
              effects=(Gravity(), QuadraticDrag(drag_coefficient=C_D), LinearDrag(gamma=LINEAR), Wind(WIND),
                       Gusts(gust_speed=GUST, gust_time=GUST_TIME)))
SEED, CONTROL, HELD, COUNT, TURNED = 7, 0.1, 20, 50, 0.5
"""Seed, control step [s], steps per control step, number of control steps, and initial angle [rad]."""


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
    correlation, gust, gusts = math.exp(-span / GUST_TIME), 0.0, []
    for k in range(count):
        share = correlation if k else 0.0
        radius, turn = math.sqrt(-2.0 * math.log(next(draw))), 2.0 * math.pi * next(draw)
        gust = share * gust + GUST * math.sqrt(1.0 - share * share) * radius * math.cos(turn)
        gusts.append(gust)
    return np.array(gusts)


@lru_cache(maxsize=1)
def blown() -> tuple[Array, Array]:
    """Return the reference angle and velocity after each control step of a pendulum in wind with gusts."""
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
    states = np.array(rows)
    return states[:, 0], states[:, 1]


def _gusts(method: Method) -> Finding:
    """Judge a method's motion in gusty wind against the reference solution."""
    h = CONTROL / HELD
    run = ran(WINDY, method, dt=h, steps=HELD * COUNT, every=HELD, substeps=HELD, seed=SEED, angle=TURNED, velocity=0.0)
    ended = stopped(run)
    if ended is not None:
        return ended
    angle, velocity = blown()
    rate, size = WINDY.omega0, float(np.max(np.abs(angle)))
    allowed = size * order_bound(method, rate * h, rate * CONTROL * COUNT) + 1e-11
    error = np.maximum(np.abs(run.angle - angle), np.abs(run.velocity - velocity) / rate)
    return judged(run, error, allowed, "it grows" if np.max(np.abs(run.angle)) > 10.0 * size else "")


SHARES = (0.9 * LOWER, LOWER, 1.1 * LOWER, 0.97 * UPPER, UPPER, 1.03 * UPPER)
"""Amplitudes b/L of the pivot on both sides of the stability edges."""
ROTATIONS = "rotations about the equilibrium angle (Landau & Lifshitz 1976, section 22)"

CASES = (
    *(_kapitza(share) for share in SHARES),
    Case("torque changing sign each control step", GROUP, "The force jumps at each control step, and its mean is "
         "nearly zero.", "a rotation for each control step; the tolerance is (omega0 h)^p omega0 t", ROTATIONS, PUSHED,
         resolved, _flipping(HOLD)),
    Case("torque changing sign each step", GROUP,
         "The force jumps at each step, so that forces of earlier steps say nothing about the next step.",
         "a rotation for each step; the tolerance is (omega0 h)^p omega0 t", ROTATIONS, PUSHED, resolved,
         _flipping(1)),
    Case("gusts", GROUP,
         "Gusts change the wind speed at random at each control step and not between, so that the force jumps.",
         "scipy's DOP853 at 3e-14 in each control step, with gusts computed independently; the tolerance is "
         "(omega0 h)^p omega0 t of the largest angle",
         "Uhlenbeck & Ornstein 1930; L'Ecuyer 1999; Hairer, Norsett & Wanner 1993, II.5",
         WINDY, resolved, _gusts),
)
KNOWN: dict[tuple[str, str], str] = {}
"""(case, method) -> reason of a known failure."""
