"""Closed forms of one step, and the combinations of effects that have one: plain functions, copied into programs.

The undamped pendulum at any angle: with ``X, Y = sin, cos(angle/2)`` and ``Z = velocity/(2 omega0)``,
``X**2 + Z**2 = k**2`` is constant, and X, Z, Y are k sn, k cn and dn of a phase that grows at the rate omega0. The
addition theorem advances them by ``S, C, D = sn, cn, dn(omega0 h)`` without any inverse function::

    X1 = (X C D + Z Y S)/N      Y1 = (Y D - X Z S C)/N      Z1 = (Z C - X Y S D)/N      N = 1 - (X S)**2

N is computed as ``C**2 + (Y S)**2``, and ``1 - k**2 = (Y - Z)(Y + Z)``, to avoid cancellation next to the top.
Source: Whittaker, Analytical Dynamics (1937), chapter 4; Abramowitz & Stegun (1964), 16.11, 16.12, 16.17.

The small-angle pendulum, free or damped: for ``theta'' + gamma theta' + omega0**2 theta = 0``, with d = gamma/2 and
``z = (d**2 - omega0**2) h**2``::

    theta1 = e^(-d h) (theta (C + d h S) + theta' h S)        C = cosh(sqrt z)
    theta1' = e^(-d h) (theta' (C - d h S) - omega0**2 h theta S)     S = sinh(sqrt z)/sqrt z

C and S are entire functions of z; near critical damping they are computed by their series. Source: Landau & Lifshitz,
Mechanics (1976), section 25.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from pendulum_env.physics.elementary import atan2, cos, exp, power, sin


def _cosine_like(z: float) -> float:
    """Return ``cosh(sqrt z)`` for -1 <= z <= 1, by its series; for negative z it is ``cos(sqrt(-z))``."""
    return 1.0 + z / 2.0 * (1.0 + z / 12.0 * (1.0 + z / 30.0 * (1.0 + z / 56.0 * (1.0 + z / 90.0 * (
        1.0 + z / 132.0 * (1.0 + z / 182.0 * (1.0 + z / 240.0 * (1.0 + z / 306.0))))))))


def _sine_like(z: float) -> float:
    """Return ``sinh(sqrt z)/sqrt z`` for -1 <= z <= 1, by its series; for negative z it is ``sin(sqrt(-z))/sqrt(-z)``.
    """
    return 1.0 + z / 6.0 * (1.0 + z / 20.0 * (1.0 + z / 42.0 * (1.0 + z / 72.0 * (1.0 + z / 110.0 * (
        1.0 + z / 156.0 * (1.0 + z / 210.0 * (1.0 + z / 272.0 * (1.0 + z / 342.0))))))))


def _swing(z: float) -> tuple[float, float]:
    """Return C = cosh(sqrt z) and S = sinh(sqrt z)/sqrt z for z <= 1, which describe one step of an oscillator.

    For negative z they are ``cos(sqrt(-z))`` and ``sin(sqrt(-z))/sqrt(-z)``.
    """
    near = max(-1.0, min(1.0, z))
    far = z < -1.0
    angle = power(-z if far else 1.0, 0.5)
    return cos(angle) if far else _cosine_like(near), sin(angle) / angle if far else _sine_like(near)


def _mean_fall(x: float) -> float:
    """Return ``(1 - exp(-2 x))/(2 x)``, the mean of exp(-2 x t) for t from 0 to 1, without cancellation near x = 0."""
    near = x if x < 1.0 else 1.0
    far = x if x > 1.0 else 1.0
    return exp(-near) * _sine_like(near * near) if x < 1.0 else (1.0 - exp(-2.0 * far)) / (2.0 * far)


def swung(angle: float, velocity: float, duration: float, rate: float) -> tuple[float, float]:
    """Return angle and velocity of ``theta'' = -rate theta`` after ``duration``; ``rate = omega0**2``."""
    C, S = _swing(-rate * duration * duration)
    return angle * C + velocity * duration * S, velocity * C - rate * duration * angle * S


def spring_flow(angle: float, velocity: float, duration: float, spring_rate: float) -> tuple[float, float]:
    """Return angle and velocity of the undamped small-angle pendulum after ``duration``; ``spring_rate = omega0**2``.
    """
    return swung(angle, velocity, duration, spring_rate)


def fibre_flow(angle: float, velocity: float, duration: float, fibre_rate: float) -> tuple[float, float]:
    """Return angle and velocity of an undamped torsion pendulum after ``duration``; ``fibre_rate = omega0**2``."""
    return swung(angle, velocity, duration, fibre_rate)


def _by_parts(x: float, y: float, z: float, slow: float) -> tuple[float, float, float]:
    """Return the means over a step of f, f s and f s**2 with ``f = exp(-x t)``, ``s = sinh(r t)/r``, ``r**2 = z``.

    They give the heat of the damped small-angle pendulum. t runs from 0 to 1; x = gamma h, y = (omega0 h)**2 and z =
    x**2/4 - y. Valid where x or y is not small, and the two decay rates are close.
    """
    over = z > 1.0
    r = power(z if over else 1.0, 0.5)
    rising, falling = exp(-2.0 * slow), exp(-2.0 * slow - 4.0 * r)
    C, S = _swing(z if z < 1.0 else 1.0)
    fall = exp(-x)
    double_C = 0.5 * (rising + falling) if over else fall * (2.0 * C * C - 1.0)
    double_S = 0.25 * (rising - falling) / r if over else fall * (C * S)
    edge = 0.25 * (rising - 2.0 * fall + falling) / (r * r) if over else fall * S * S
    first = _mean_fall(0.5 * x)
    second = (1.0 - double_C - x * double_S) / (4.0 * y if y > 0.5 else 1.0)
    third = (
        (double_S + x * second - first) / (2.0 * z if z < -0.5 else -1.0) if x < 1.0
        else (2.0 * second - edge) / (x if x > 1.0 else 1.0)
    )
    return first, second, third


def _mean_square(p: float, a: float, x: float, y: float) -> float:
    """Return the mean of ``w**2`` over a step of length 1 with ``w'' + x w' + y w = 0``, by a series.

    For small x and y it gives the heat of the damped small-angle pendulum. At the start, w is p and w' is a. The
    products ``w**2``, ``w w'`` and ``w'**2`` obey linear equations of their own, which give the series.
    """
    one, two, three = p * p, p * a, a * a
    total = one
    for k in range(44):
        n = k + 1.0
        one, two, three = (
            2.0 * two / n, (three - x * two - y * one) / n, (-2.0 * x * three - 2.0 * y * two) / n
        )
        total = total + one / (n + 1.0)
    return total


def swung_in_drag(
    angle: float, velocity: float, duration: float, rate: float, linear_drag_rate: float
) -> tuple[float, float, float]:
    """Return angle and velocity of ``theta'' = -rate theta - gamma theta'`` after ``duration >= 0``, and the heat.

    The heat is the integral of ``gamma theta'**2``; gamma is ``linear_drag_rate``.
    """
    h = duration
    d = 0.5 * linear_drag_rate
    z = (d * d - rate) * h * h
    x = d * h
    over = z > 1.0
    r = power(z if over else 1.0, 0.5)
    slow = rate * h * h / (r + x)
    risen = _mean_fall(r)
    C, S = _swing(z if z < 1.0 else 1.0)
    plus = 1.0 + slow * risen if over else C + x * S
    minus = exp(-2.0 * r) - slow * risen if over else C - x * S
    S = risen if over else S
    factor = exp(-slow) if over else exp(-x)
    a = -rate * angle - linear_drag_rate * velocity
    b = h * (a + d * velocity)
    y = rate * h * h
    first, second, third = _by_parts(2.0 * x, y, z, slow)
    square = velocity * velocity * (first + z * third) + 2.0 * velocity * b * second + b * b * third
    pull = rate * h * angle
    late, early = -0.5 * (slow * velocity + pull) / r, 0.5 * ((r + x) * velocity + pull) / r
    modes = late * late * _mean_fall(slow) + 2.0 * late * early * _mean_fall(x) + early * early * _mean_fall(r + x)
    square = modes if over & (r > 0.5 * x) else square
    small = (2.0 * x < 2.5) & (y < 1.0)
    square = _mean_square(velocity, h * a, 2.0 * x, y) if small else square
    return (
        factor * (angle * plus + velocity * h * S),
        factor * (velocity * minus - rate * h * angle * S),
        linear_drag_rate * h * square,
    )


def damped_spring_flow(
    angle: float, velocity: float, duration: float, spring_rate: float, linear_drag_rate: float
) -> tuple[float, float, float]:
    """Return the damped small-angle pendulum's angle and velocity after ``duration >= 0``, and the heat, exactly."""
    return swung_in_drag(angle, velocity, duration, spring_rate, linear_drag_rate)


def damped_fibre_flow(
    angle: float, velocity: float, duration: float, fibre_rate: float, linear_drag_rate: float
) -> tuple[float, float, float]:
    """Return the damped torsion pendulum's angle and velocity after ``duration >= 0``, and the heat, exactly."""
    return swung_in_drag(angle, velocity, duration, fibre_rate, linear_drag_rate)


def _descend(prime: float, square: float) -> tuple[float, float, float, float, float]:
    """Return one step of Gauss's transformation of an elliptic modulus k, with k' = sqrt(1 - k**2): the next k' and
    k**2, the next k, one minus it, and (1 + k')/2.
    """
    above = 1.0 + prime
    modulus = square / (above * above)
    return 2.0 * power(prime, 0.5) / above, modulus * modulus, modulus, 2.0 * prime / above, 0.5 * above


def _ascend(modulus: float, rest: float, sn: float, cn: float, dn: float) -> tuple[float, float, float]:
    """Return the elliptic functions sn, cn, dn for a modulus from those for the smaller ``modulus`` that one step of
    Gauss's transformation has given.

    ``rest`` is 1 - modulus.

    sn**2 + cn**2 = 1 is restored, because the rounding error would double in each step. All terms of dn are positive,
    so that dn and cn have small relative errors even where they are small.
    """
    scale = 1.0 / (1.0 + modulus * sn * sn)
    dn, cn, sn = (rest + modulus * cn * cn) * scale, cn * dn * scale, (1.0 + modulus) * sn * scale
    unit = 1.5 - 0.5 * (sn * sn + cn * cn)
    return sn * unit, cn * unit, dn


def _elliptic(phase: float, prime: float, square: float, rotates: bool) -> tuple[float, float, float, float]:
    """Return the elliptic functions sn, cn, dn of ``phase``, for modulus**2 = square and complementary modulus
    ``prime`` from 1e-140 to 1.

    If ``rotates`` (the pendulum goes over the top), half periods 2K are first subtracted from the phase, and the fourth
    result is their number; else the fourth result is 0.
    """
    p1, s1, k1, r1, g1 = _descend(prime, square)
    p2, s2, k2, r2, g2 = _descend(p1, s1)
    p3, s3, k3, r3, g3 = _descend(p2, s2)
    p4, s4, k4, r4, g4 = _descend(p3, s3)
    p5, s5, k5, r5, g5 = _descend(p4, s4)
    p6, s6, k6, r6, g6 = _descend(p5, s5)
    p7, s7, k7, r7, g7 = _descend(p6, s6)
    p8, s8, k8, r8, g8 = _descend(p7, s7)
    p9, s9, k9, r9, g9 = _descend(p8, s8)
    p10, s10, k10, r10, g10 = _descend(p9, s9)
    p11, s11, k11, r11, g11 = _descend(p10, s10)
    _, _, k12, r12, g12 = _descend(p11, s11)
    base = phase * (g1 * g2 * g3 * g4 * g5 * g6 * g7 * g8 * g9 * g10 * g11 * g12)
    halves = (base * 0.3183098861837907 + 6755399441055744.0) - 6755399441055744.0
    odd = abs(halves - ((halves + 13510798882111488.0) - 13510798882111488.0)) == 1.0
    halves = halves if rotates else 0.0
    turned = -1.0 if rotates and odd else 1.0
    sn, cn, dn = _ascend(k12, r12, turned * sin(base), turned * cos(base), 1.0)
    sn, cn, dn = _ascend(k11, r11, sn, cn, dn)
    sn, cn, dn = _ascend(k10, r10, sn, cn, dn)
    sn, cn, dn = _ascend(k9, r9, sn, cn, dn)
    sn, cn, dn = _ascend(k8, r8, sn, cn, dn)
    sn, cn, dn = _ascend(k7, r7, sn, cn, dn)
    sn, cn, dn = _ascend(k6, r6, sn, cn, dn)
    sn, cn, dn = _ascend(k5, r5, sn, cn, dn)
    sn, cn, dn = _ascend(k4, r4, sn, cn, dn)
    sn, cn, dn = _ascend(k3, r3, sn, cn, dn)
    sn, cn, dn = _ascend(k2, r2, sn, cn, dn)
    sn, cn, dn = _ascend(k1, r1, sn, cn, dn)
    return sn, cn, dn, halves


def pendulum_flow(
    tilt: float, side: float, velocity: float, duration: float, gravity_rate: float
) -> tuple[float, float]:
    """Return the tilt and velocity of the undamped pendulum after ``duration``, which may be negative.

    ``tilt`` is the angle from the bottom (``side`` = 1) or from the top (``side`` = -1); the returned tilt is measured
    from the same point, with whole turns. abs(tilt) must be at most pi/2, so that what remains after whole half periods
    does not lead beyond the next bottom or top. ``gravity_rate = omega0**2``; values below 1e-200 count as 1e-200.
    """
    omega0 = power(gravity_rate if gravity_rate > 1e-200 else 1e-200, 0.5)
    small, large = sin(0.5 * tilt), cos(0.5 * tilt)
    X = small if side > 0.0 else large
    Y = large if side > 0.0 else -small
    Z = velocity / (2.0 * omega0)
    rest = (Y - Z) * (Y + Z)
    rotates = rest < 0.0
    square = X * X + Z * Z
    k = power(square, 0.5) if rotates else 1.0
    phase = omega0 * duration
    near = -300.0 if phase < -300.0 else (300.0 if phase > 300.0 else phase)
    phase = near if rest == 0.0 else phase
    prime = power(abs(rest), 0.5) / k
    prime = prime if prime > 1e-140 else 1e-140
    sn, cn, dn, halves = _elliptic(k * phase, prime, 1.0 / square if rotates else square, rotates)
    S = sn / k
    C = dn if rotates else cn
    D = cn if rotates else dn
    N = C * C + Y * S * (Y * S)
    X1 = (X * C * D + Z * Y * S) / N
    Y1 = (Y * D - X * Z * S * C) / N
    Z1 = (Z * C - X * Y * S * D) / N
    half = atan2(X1, Y1) if side > 0.0 else atan2(-Y1, X1)
    return 2.0 * half + 6.283185307179586 * (halves if Z > 0.0 else -halves), 2.0 * omega0 * Z1


@dataclass(frozen=True)
class ExactFlow:
    """A closed form of a step: a plain function whose arguments have the names explained in
    :mod:`pendulum_env.physics.effects.effect`.

    Attributes:
        function: returns the angle (or tilt) and the velocity after ``duration``, then the heat of each effect named in
            ``heats``.
        heats: names of the dissipative effects.
    """

    function: Callable[..., tuple[float, ...]]
    heats: tuple[str, ...] = ()


FLOWS: Mapping[frozenset[str], ExactFlow] = MappingProxyType({
    frozenset({"gravity"}): ExactFlow(pendulum_flow),
    frozenset({"small_angle_gravity"}): ExactFlow(spring_flow),
    frozenset({"small_angle_gravity", "linear_drag"}): ExactFlow(damped_spring_flow, ("linear_drag",)),
    frozenset({"fibre"}): ExactFlow(fibre_flow),
    frozenset({"fibre", "linear_drag"}): ExactFlow(damped_fibre_flow, ("linear_drag",)),
})
"""Closed form of the motion, by the set of the names of all effects in a scene."""


def flow_of(effects: Iterable[Any]) -> ExactFlow | None:
    """Return the closed form of a step of a scene that has these effects; None if none is known."""
    return FLOWS.get(frozenset(effect.name for effect in effects if effect.kind != "inertia"))
