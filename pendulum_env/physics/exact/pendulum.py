"""Closed forms of the undamped pendulum at any angle: elliptic functions, periods, the separatrix, free flight."""

from __future__ import annotations

import decimal
import math
from typing import Any, NamedTuple

import numpy as np

from pendulum_env.physics.exact.base import FloatArray, Real, array, in_floats, number, shaped
from pendulum_env.physics.units import SceneError

_PI = decimal.Decimal(
    "3.14159265358979323846264338327950288419716939937510582097494459230781640628620899862803482534211706798"
)


class _Orbit(NamedTuple):
    """An orbit of the undamped pendulum, as the arguments of the elliptic functions that give its angle.

    The angle theta follows from direction (theta/2 - pi turns) = atan2(k sn, dn) below the separatrix and = atan2(sn,
    cn) in rotation, at the phase ``rate * time + phase``, with the given modulus.
    """

    turns: int
    direction: float
    rotates: bool
    modulus: float
    complement: float  # 1 - modulus²
    rate: float
    phase: float
    bottom_speed: float


def _sin_cos(x: decimal.Decimal) -> tuple[decimal.Decimal, decimal.Decimal]:
    """Return sine and cosine of x by their series, to 78 digits."""
    term, sums, n = decimal.Decimal(1), [decimal.Decimal(1), decimal.Decimal(0)], 0
    while abs(term) > decimal.Decimal("1e-78"):
        n += 1
        term *= x / n
        sums[n % 2] += -term if n % 4 in (2, 3) else term
    return sums[1], sums[0]


def _orbit(angle: float, velocity: float, omega0: float) -> _Orbit:
    """Return the orbit of the undamped pendulum through a given angle and velocity.

    With s, c = sin, cos of theta/2 and u = theta'/(2 omega0), k² = s² + u². Near the separatrix
    1 - k² = c² - u² loses its digits, so s, c, u and k are computed in 80 digits and rounded once. The time from the
    bottom is (s/k) R_F(u²/k², c², 1) / omega0 in libration and rotation alike (Carlson 1995).
    """
    from scipy.special import elliprf

    with decimal.localcontext(decimal.Context(prec=80)):
        half, w = decimal.Decimal(angle) / 2, decimal.Decimal(omega0)
        u = abs(decimal.Decimal(velocity)) / (2 * w)
        turns = int((half / _PI).to_integral_value())
        s, c = _sin_cos(half - turns * _PI)
        square = s * s + u * u
        k, rotates = square.sqrt(), square > 1
        if not k:
            return _Orbit(turns, 1.0, False, 0.0, 1.0, omega0, 0.0, 0.0)
        if rotates:
            modulus, complement, sine, rate = 1 / k, (u - c) * (u + c) / square, s, k * w
        else:
            modulus, complement, sine, rate = k, (c - u) * (c + u), s / k, w
        bottom_speed, ratio = 2 * k * w, float(u / k)
    direction = math.copysign(1.0, velocity)
    phase = direction * float(sine) * float(elliprf(ratio * ratio, float(c) ** 2, 1.0))
    return _Orbit(
        turns, direction, rotates, float(modulus), float(complement), float(rate), phase, float(bottom_speed)
    )


def _agm(a: Any, b: Any) -> Any:
    """Return the arithmetic-geometric mean of a, b >= 0, not both 0: K(k) = pi / (2 agm(1, k'))."""
    for _ in range(64):
        if np.all(np.abs(a - b) <= 1e-15 * a):
            break
        a, b = 0.5 * (a + b), np.sqrt(a * b)
    return 0.5 * (a + b)


def _jacobi(
    phase: FloatArray, modulus: float, complement: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the elliptic functions sn, cn, dn of `phase`, from the modulus k and `complement` = k'² = 1 - k².

    Gauss's (descending Landen) transformation, written so that no term cancels as k -> 1: cn and dn have small relative
    errors down to k', and sn² + cn² = 1 is restored in each step. Source: Abramowitz & Stegun (1964) 16.12, with 1 - k1
    sn² = (1 - k1) + k1 cn².
    """
    if complement == 0.0:
        fall = np.exp(-np.abs(phase))
        sech = 2.0 * fall / (1.0 + fall * fall)
        return np.tanh(phase), sech, sech
    ladder, square, prime = [], modulus * modulus, math.sqrt(complement)
    base = phase * _agm(1.0, prime)
    while square > 1e-18:
        k1, rest = square / (1.0 + prime) ** 2, 2.0 * prime / (1.0 + prime)
        ladder.append((k1, rest))
        square, prime = k1 * k1, 2.0 * math.sqrt(prime) / (1.0 + prime)
    sn, cn, dn = np.sin(base), np.cos(base), np.ones_like(base)
    for k1, rest in reversed(ladder):
        opposite, adjacent = (1.0 + k1) * sn, cn * dn
        dn = (rest + k1 * cn * cn) / (1.0 + k1 * sn * sn)
        size = np.hypot(opposite, adjacent)
        sn, cn = opposite / size, adjacent / size
    return sn, cn, dn


@in_floats
def pendulum(time: Real, angle: float, velocity: float, omega0: float) -> tuple[Real, Real]:
    """Return angle and velocity of theta'' = -omega0² sin(theta) from any state: libration, rotation, separatrix.

    omega0 > 0 [rad/s]; (angle, velocity) is the state at time 0. With k² = sin²(angle/2) + (velocity/(2 omega0))²:
    sin(theta/2) = k sn for k < 1, sn for k > 1 (modulus 1/k), tanh for k = 1 (Gudermannian). The floats given are taken
    as exact, so that a release 1e-9 rad from the top falls at the right time. The error is that of rounding the phase:
    in angle and velocity / omega0 below 1e-15 (4 + omega0 |time|) in libration and 1e-15 (4 + angle turned) in
    rotation. Source: Whittaker, Analytical Dynamics (1937), chapter 4; Ochs, Eur. J. Phys. 32, 479 (2011).
    """
    t, w = array("time", time), number("omega0", omega0, "finite and > 0")
    orbit = _orbit(number("angle", angle), number("velocity", velocity), w)
    phase = orbit.rate * t + orbit.phase
    half_turns = np.zeros_like(phase)
    if orbit.rotates:
        half_period = math.pi / _agm(1.0, math.sqrt(orbit.complement))
        half_turns = np.rint(phase / half_period)
        phase = phase - half_turns * half_period
    sn, cn, dn = _jacobi(phase, orbit.modulus, orbit.complement)
    sine, cosine, speed = (sn, cn, dn) if orbit.rotates else (orbit.modulus * sn, dn, cn)
    turns = orbit.turns + orbit.direction * half_turns
    angles = 2.0 * (math.pi * turns + orbit.direction * np.arctan2(sine, cosine))
    return shaped(angles), shaped(orbit.direction * orbit.bottom_speed * speed)


@in_floats
def period(amplitude: Real, omega0: float) -> Real:
    """Return the period [s] of the undamped libration: 4 K(sin(q/2)) / omega0 = 2 pi / (omega0 agm(1, cos(q/2))).

    q = amplitude, |q| <= the float pi, which lies below pi; omega0 > 0 [rad/s]. Relative accuracy 4e-16
    throughout. Source: Gauss's mean, as in Carvalhaes & Suppes, Am. J. Phys. 76, 1150 (2008).
    """
    q, w = array("amplitude", amplitude), number("omega0", omega0, "finite and > 0")
    if np.any(np.abs(q) > math.pi):
        raise SceneError("amplitude must lie between -pi and pi")
    result: Real = shaped(2.0 * math.pi / (w * _agm(np.ones_like(q), np.cos(q / 2.0))))
    return result


@in_floats
def period_rotation(velocity: Real, omega0: float) -> Real:
    """Return the time [s] of one full turn of the undamped pendulum: 2 pi / agm(|v|, sqrt(v² - 4 omega0²)).

    v = velocity at the bottom, |v| > 2 omega0 > 0 [rad/s]. Source: as `period`, with modulus 2 omega0/|v|.
    """
    v, w = np.abs(array("velocity", velocity)), number("omega0", omega0, "finite and > 0")
    if np.any(v <= 2.0 * w):
        raise SceneError("velocity at the bottom must exceed 2 omega0, or the pendulum does not turn over")
    result: Real = shaped(2.0 * math.pi / _agm(v, np.sqrt(v - 2.0 * w) * np.sqrt(v + 2.0 * w)))
    return result


@in_floats
def small_amplitude_series(amplitude: Real) -> Real:
    """Return the series of the relative change of the period with the amplitude q, 2 K(sin(q/2))/pi - 1.

    dT/T = q²/16 + 11 q⁴/3072 + 173 q⁶/737280 + 22931 q⁸/1321205760; the next term is 1.39e-6 q¹⁰.
    Source: Nelson & Olsson, Am. J. Phys. 54, 112 (1986).
    """
    x = array("amplitude", amplitude) ** 2
    result: Real = shaped(x * (1 / 16 + x * (11 / 3072 + x * (173 / 737280 + x * (22931 / 1321205760)))))
    return result


class Flight(NamedTuple):
    """The end of a free flight: its time [s] since the wire went slack, the angle there [rad], within half a turn of
    the bottom, and the speed at which the wire stretches there [m/s], which it stops with a jerk."""

    time: float
    angle: float
    speed: float


@in_floats
def flight(length: float, gravity: float, angle: float, velocity: float) -> Flight | None:
    """Return where the wire catches a bob that flies freely in vacuum from an angle [rad] and a velocity [rad/s].

    From ``r0`` with the velocity ``v`` across the wire, ``|r0 + v t + g t**2/2| = L`` is ``g**2 t**2/4 - g v_z t +
    v**2 + g L cos(angle) = 0`` after division by ``t**2``, with the upward velocity ``v_z``. At a slack wire the last
    two terms, the tension times L/m, are at most 0. If they are 0, ``t = 4 v_z/g``.

    Args:
        length: length of the wire [m].
        gravity: gravitational acceleration [m/s²].
        angle, velocity: state at which the wire is slack.

    Returns None without gravity, or if the wire is taut, by more than a millionth of the weight. Raises SceneError for
    an argument that is not finite, a length that is not positive, a negative gravity, and where the result overflows.
    """
    length, gravity = number("length", length, "finite and > 0"), number("gravity", gravity, "finite and >= 0")
    angle, velocity = number("angle", angle), number("velocity", velocity)
    up, pull = length * velocity * math.sin(angle), length * length * velocity**2 + gravity * length * math.cos(angle)
    root = up * up - min(pull, 0.0)
    if not gravity > 0.0 or pull > 1e-6 * gravity * length or not root > 0.0:
        return None
    time = 2.0 * (up + math.sqrt(root)) / gravity
    if not time > 0.0:
        return None
    across, rise = length * velocity * math.cos(angle), up - gravity * time
    x, z = length * math.sin(angle) + across * time, -length * math.cos(angle) + (up - 0.5 * gravity * time) * time
    return Flight(time, math.atan2(x, -z), (x * across + z * rise) / math.hypot(x, z))
