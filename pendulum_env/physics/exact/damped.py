"""Closed forms of damped motion: small angles and Euler's methods on them, turning points, drag alone, envelopes."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pendulum_env.physics.exact.base import FloatArray, Real, array, count, in_floats, motion, number, rise, shaped
from pendulum_env.physics.units import SceneError, shown

_EULER_EXPONENT = {"forward_euler": 1, "backward_euler": -1}


class _Oscillator(NamedTuple):
    """Coefficients of the exact motion of the damped oscillator x'' + 2 d x' + w² x = 0 over a time t.

    From x and v at time 0 follow x(t) = factor (plus x + rise v) and v(t) = factor (minus v - w² rise x). `factor`
    times `plus` is C + d S, times `minus` C - d S, and times `rise` S, all multiplied by exp(-d t), with C = cosh(s t),
    S = sinh(s t)/s, s² = d² - w².
    """

    factor: FloatArray
    plus: FloatArray
    minus: FloatArray
    rise: FloatArray


def oscillator_flow(time: FloatArray, w: float, d: float) -> _Oscillator:
    """Return the coefficients of the damped oscillator's motion over `time`, for natural frequency w and damping 2 d.
    """
    square = (w - d) * (w + d)
    with np.errstate(over="ignore", under="ignore"):
        if square > 0.0:
            n = math.sqrt(square)
            cosine, risen = np.cos(n * time), np.sin(n * time) / n
            return _Oscillator(np.exp(-d * time), cosine + d * risen, cosine - d * risen, risen)
        s = math.sqrt(-square)
        slow = w * (w / max(d + s, w)) if w else 0.0
        risen = rise(2.0 * s, time)
        fall = np.exp(-2.0 * s * time)
        return _Oscillator(np.exp(-slow * time), 1.0 + slow * risen, fall - slow * risen, risen)


@in_floats
def linear(time: Real, angle: float, velocity: float, omega0: float, gamma: float = 0.0) -> tuple[Real, Real]:
    """Return angle and velocity of theta'' + gamma theta' + omega0² theta = 0, under-, critically or overdamped.

    omega0 >= 0 [rad/s], gamma >= 0 [1/s]; (angle, velocity) is the state at time 0. There is no cancellation next to
    critical damping, and no overflow at late times. Source: Landau & Lifshitz, Mechanics (1976), § 25.
    """
    t, a, v = array("time", time), number("angle", angle), number("velocity", velocity)
    w, g = number("omega0", omega0, "finite and >= 0"), number("gamma", gamma, "finite and >= 0")
    flow = oscillator_flow(t, w, g / 2.0)
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        angles = flow.factor * (a * flow.plus + v * flow.rise)
        return motion(angles, flow.factor * (v * flow.minus - w * (w * a * flow.rise)))


@in_floats
def euler_energy_factor(omega0: float, h: float, method: str, steps: int = 1) -> float:
    """Return the exact factor of the small-angle pendulum's energy over `steps` Euler steps of h seconds.

    (1 + omega0² h²)^steps for "forward_euler", its inverse for "backward_euler": their amplification matrices
    have the eigenvalues 1 ± i omega0 h and 1/(1 ± i omega0 h). Source: Hairer, Lubich & Wanner, Geometric
    Numerical Integration (2006), I.1.
    """
    if not isinstance(method, str) or method not in _EULER_EXPONENT:
        raise SceneError(f"method must be one of {', '.join(_EULER_EXPONENT)}, not {shown(method)}")
    x = number("omega0", omega0, "finite and >= 0") * number("h", h)
    return math.exp(_EULER_EXPONENT[method] * count("steps", steps) * math.log1p(x * x))


def _released(angle: float) -> tuple[float, float]:
    """Return the size of a release angle and its sign, 1.0 or -1.0; SceneError for more than half a turn."""
    if abs(number("angle", angle)) > math.pi:
        raise SceneError(f"angle must lie between -pi and pi, not {angle}")
    return abs(angle), math.copysign(1.0, angle)


def _coulomb_excess(d: float, size: float, tau: float) -> float:
    """Return sin(d) sin(p)/p - tau with p = size - d, which is 0 where a half swing with dry friction ends.

    The half swing goes from the angle ``size`` to ``2 d - size``; tau is the friction torque over ``m g L``.
    """
    mean = size - d
    return math.sin(d) * (math.sin(mean) / mean if mean else 1.0) - tau


@in_floats
def coulomb_turning_points(angle: float, friction_ratio: float, n: int) -> FloatArray:
    """Return the turning angles of theta'' = -sin(theta) - tau sign(theta'), released at rest at `angle`.

    Returns an array [rad] of `angle` and up to n more. tau = friction_ratio = friction torque / (m g L) >= 0; |angle|
    <= pi. A half swing from t0 > 0 ends at -t1 with cos t1 - cos t0 = tau (t0 + t1), solved as sin(d) sin(p) / p = tau,
    p = t0 - d, t1 = t0 - 2 d, which avoids cancellation. The last angle is where the pendulum sticks, |sin(theta)| <=
    tau, if that comes within n. Source: the energy integral; Simbach & Priest, Am. J. Phys. 73, 1079 (2005).
    """
    from scipy.optimize import brentq

    size, sign = _released(angle)
    tau = number("friction_ratio", friction_ratio, "finite and >= 0")
    angles = [sign * size]
    for _ in range(count("n", n)):
        if abs(math.sin(size)) <= tau:
            break
        size -= 2.0 * float(brentq(_coulomb_excess, 0.0, size, args=(size, tau), xtol=1e-300, rtol=1e-15))
        sign = -sign
        angles.append(sign * size)
    return np.array(angles)


@in_floats
def coulomb_turning_points_linear(angle: float, friction_ratio: float, n: int) -> FloatArray:
    """Return the turning angles of theta'' = -theta - tau sign(theta'), released at rest at `angle`.

    Returns an array [rad]; arguments as in `coulomb_turning_points`. Each half swing takes 2 tau off the amplitude,
    until the pendulum sticks at |theta| <= tau.
    """
    a, tau = number("angle", angle), number("friction_ratio", friction_ratio, "finite and >= 0")
    half_swings = np.arange(count("n", n) + 1)
    sizes = abs(a) - 2.0 * tau * half_swings
    moving = np.concatenate(([True], sizes[:-1] > tau))
    angles: FloatArray = (math.copysign(1.0, a) * (1 - 2 * (half_swings % 2)) * sizes)[moving]
    return angles


def _drag_part(t: float, c: float) -> float:
    """Return ``exp(2 c t) (2 c sin(t) - cos(t)) + cos(t)``, a part of the turning angles under quadratic drag c.

    Without the last term it is 1 + 4 c² times an antiderivative of sin(t) exp(2 c t).
    """
    x = 2.0 * c * t
    return 2.0 * c * math.exp(x) * math.sin(t) - math.expm1(x) * math.cos(t)


def _drag_excess(t: float, size: float, c: float, lost: float) -> float:
    """Return (1 + 4 c²) times the integral of sin(x) exp(2 c x) from -size to t, which is 0 at the turning point t.

    The pendulum with quadratic drag c is released at rest at -size. ``lost`` is ``_drag_part(size, -c)``, the part of
    the lower end of the integral.
    """
    return _drag_part(t, c) - lost - 2.0 * math.sin((size + t) / 2.0) * math.sin((size - t) / 2.0)


@in_floats
def quadratic_turning_point(angle: float, c: float) -> float:
    """Return the next turning angle [rad] of theta'' = -omega0² sin(theta) - c |theta'| theta', at rest at `angle`.

    c >= 0 [1/rad], |angle| <= pi; omega0 does not matter. While theta falls, y = theta'² exp(-2 c theta) obeys
    dy/dtheta = -2 omega0² sin(theta) exp(-2 c theta), so exp(-2 c theta) (cos theta + 2 c sin theta) is equal at both
    ends; while theta rises, with -c in place of c. Source: Mungan & Lipscombe, Eur. J. Phys. 34, 1243 (2013).
    """
    from scipy.optimize import brentq

    size, sign = _released(angle)
    drag = number("c", c, "finite and >= 0")

    known = (size, drag, _drag_part(size, -drag))
    top = min(size, 350.0 / drag) if drag else size
    if _drag_excess(top, *known) <= 0.0:
        return -sign * top
    return -sign * float(brentq(_drag_excess, 0.0, top, args=known, xtol=1e-300, rtol=1e-15))


@in_floats
def drag_only(time: Real, velocity: float, gamma: float, c: float) -> tuple[Real, Real]:
    """Return the angle travelled and the velocity under theta'' = -gamma theta' - c |theta'| theta', without gravity.

    v = v0 exp(-gamma t) / (1 + c |v0| f), angle = sign(v0) log(1 + c |v0| f) / c, f = (1 - exp(-gamma t)) / gamma;
    gamma >= 0 [1/s] and c >= 0 [1/rad] may be 0. Raises SceneError for a negative time at or before which v was
    infinite. Source: Bernoulli's equation, separated.
    """
    t, v = array("time", time), number("velocity", velocity)
    g, drag = number("gamma", gamma, "finite and >= 0"), number("c", c, "finite and >= 0")
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        risen = rise(g, t)
        load = drag * abs(v) * risen
        if not np.all(load > -1.0):
            raise SceneError("time must come after the moment at which the velocity was infinite")
        angles = math.copysign(1.0, v) * np.log1p(load) / drag if drag else v * risen
        return motion(angles, v * np.exp(-g * t) / (1.0 + load))


@in_floats
def damped_amplitude(
    time: Real, amplitude: float, omega0: float, gamma: float = 0.0, c: float = 0.0, tau: float = 0.0
) -> Real:
    """Return the small-angle amplitude [rad] under weak linear, quadratic and Coulomb damping, together or one alone.

    dA/dt = -gamma A/2 - (4/(3 pi)) c omega0 A² - 2 tau/(pi omega0), averaged over a swing and solved in
    closed form (Riccati); alone: A0 exp(-gamma t/2), A0/(1 + (4/(3 pi)) c omega0 A0 t) and
    A0 - 2 tau t/(pi omega0). The amplitude is 0 once at rest. gamma >= 0 [1/s], c >= 0 [1/rad],
    tau = friction torque / inertia >= 0 [1/s²], omega0 > 0 [rad/s], time >= 0, amplitude A0 >= 0.
    Source: Nelson & Olsson, Am. J. Phys. 54, 112 (1986); together: Lelas & Pezer, arXiv:2502.07458 (2025).
    """
    t, a0 = array("time", time), number("amplitude", amplitude, "finite and >= 0")
    w, g = number("omega0", omega0, "finite and > 0"), number("gamma", gamma, "finite and >= 0")
    if np.any(t < 0.0):
        raise SceneError("time must be >= 0")
    quadratic = 4.0 / (3.0 * math.pi) * number("c", c, "finite and >= 0") * w
    constant = 2.0 / (math.pi * w) * number("tau", tau, "finite and >= 0")
    product, d = math.sqrt(constant * quadratic), g / 4.0
    if product > d:
        n = math.sqrt((product - d) * (product + d))
        t = np.minimum(t, math.atan2(n * a0, d * a0 + constant) / n)
    flow = oscillator_flow(t, product, d)
    left = (a0 * flow.minus - constant * flow.rise) / (flow.plus + quadratic * a0 * flow.rise)
    result: Real = shaped(np.maximum(left, 0.0))
    return result
