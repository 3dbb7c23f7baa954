"""One step of the undamped pendulum at any angle in closed form: a plain function, copied into generated programs.

With ``X, Y = sin, cos(angle/2)`` and ``Z = velocity/(2 omega0)``, ``X**2 + Z**2 = k**2`` is constant, and X, Z, Y are
k sn, k cn and dn of a phase that grows at the rate omega0. The addition theorem advances them by
``S, C, D = sn, cn, dn(omega0 h)`` without any inverse function::

    X1 = (X C D + Z Y S)/N      Y1 = (Y D - X Z S C)/N      Z1 = (Z C - X Y S D)/N      N = 1 - (X S)**2

N is computed as ``C**2 + (Y S)**2``, and ``1 - k**2 = (Y - Z)(Y + Z)``, to avoid cancellation next to the top.
Source: Whittaker, Analytical Dynamics (1937), chapter 4; Abramowitz & Stegun (1964), 16.11, 16.12, 16.17.
"""

from __future__ import annotations

from pendulum_env.physics.arctangent import atan2
from pendulum_env.physics.elementary import cos, power, sin


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
