"""Portable sin, cos, exp, log, power, tanh and atan2: identical bits interpreted and compiled, on any machine.

Every function is straight-line float arithmetic and conditional expressions: no call into a maths library, no
integers, no division by zero, nothing that raises. So Python and numba (without fastmath or contraction)
agree to the last bit, and a compiled loop over an array becomes SIMD code. A function copied into another program
needs only the functions of this file that it names. The square root, of numbers that are not negative, is the
processor's own instruction, which IEEE 754 rounds correctly everywhere.

Recurring devices: `(x + 6755399441055744.0) - 6755399441055744.0` (1.5 * 2**52) rounds x to the nearest
integer, ties to even, for |x| < 2**51; 1.5 * 2**53 and 1.5 * 2**54 in its place round to multiples of 2 and
4. `1e999` is infinity, `1e999 - 1e999` is nan.

Sources: W. J. Cody and W. Waite, Software Manual for the Elementary Functions (1980), for argument reduction;
Sun Microsystems, fdlibm 5.3 (1993), k_sin.c, k_cos.c and e_log.c, for the coefficients of sin, cos and log, and
s_atan.c for the polynomial of atan2 on [0, 7/16] (larger angles are first reduced by ``pi/4`` or ``pi/2``, with
``atan((y - x)/(y + x))`` or ``atan(-x/y)``);
T. J. Dekker, Numer. Math. 18, 224 (1971), for exact sums and products. The polynomials of exp, power
and tanh interpolate at Chebyshev nodes, computed with 120 digits.
"""

from math import sqrt as sqrt

__all__ = ["cos", "exp", "log", "power", "sin", "tanh"]  # formulas of effects call these; closed forms atan2, too


def _quadrant(x: float) -> tuple[float, float, float]:
    """Reduce x to (m, y, low) with x = k*pi/2 + y - low, |y| <= pi/4 and m = k modulo 4.

    m is in -2 ... 2, where -2 and 2 are equivalent. pi/2 is the sum of four parts of 24 bits and a tail, so that k*part
    is exact for |k| <= 2**29; y is nan beyond.
    """
    k = (x * 0.6366197723675814 + 6755399441055744.0) - 6755399441055744.0
    m = k - ((k + 27021597764222976.0) - 27021597764222976.0)
    a = (x - k * 1.570796251296997) - k * 7.549789415861596e-08
    p = k * 5.390302529957765e-15
    b = a - p
    q = k * 3.282003415807913e-22
    y = b - q
    low = k * 1.2706558760139879e-29 - (((a - b) - p) + ((b - y) - q))
    y = y if abs(x) <= 843314856.5 else 1e999 - 1e999
    return m, y, low


def sin_near_zero(y: float, low: float) -> float:
    """Return sin(y - low) for |y| <= pi/4."""
    z = y * y
    r = 2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)
    r = 8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * r)
    return y - (low * (1.0 - 0.5 * z) - z * y * (-1.66666666666666324348e-01 + z * r))


def cos_near_zero(y: float, low: float) -> float:
    """Return cos(y - low) for |y| <= pi/4."""
    z = y * y
    r = -2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)
    r = -1.38888888888741095749e-03 + z * (2.48015872894767294178e-05 + z * r)
    h = 0.5 * z
    c = 1.0 - h
    return c + (((1.0 - c) - h) + (z * z * (4.16666666666666019037e-02 + z * r) + y * low))


def sin_reduced(m: float, y: float, low: float) -> float:
    """Return the sine of an angle that ``_quadrant`` has reduced to m, y and low."""
    s = sin_near_zero(y, low)
    c = cos_near_zero(y, low)
    f = c if abs(m) == 1.0 else s
    return f if abs(m - 0.5) < 1.0 else -f


def sin(x: float) -> float:
    """Return the sine of x [rad], within 0.9 ulp for |x| <= 843314856.5, nearly 2**29 pi/2; nan beyond.

    Callers must keep x in that range, by wrapping the angle.
    """
    m, y, low = _quadrant(x)
    return sin_reduced(m, y, low)


def cos_reduced(m: float, y: float, low: float) -> float:
    """Return the cosine of an angle that ``_quadrant`` has reduced to m, y and low."""
    s = sin_near_zero(y, low)
    c = cos_near_zero(y, low)
    f = s if abs(m) == 1.0 else c
    return f if abs(m + 0.5) < 1.0 else -f


def cos(x: float) -> float:
    """Return the cosine of x [rad], within 0.9 ulp for |x| <= 843314856.5, nearly 2**29 pi/2; nan beyond.

    Callers must keep x in that range, by wrapping the angle.
    """
    m, y, low = _quadrant(x)
    return cos_reduced(m, y, low)


def _power_of_two(h: float) -> float:
    """Return 2**h for integers -538 <= h <= 512.

    A polynomial for (1.22 * 2**h)**(1/512), squared nine times, lies between 1.12 and 1.32 times 2**h. Adding and
    subtracting 2**52 times that value rounds it to one significant bit.
    """
    u = h * 0.001953125  # h / 512
    s = 1.0003765154191084 + u * (
        0.6929396694495557 + u * (0.2403987295933794 + u * (0.05731496566644198 + u * 0.009661234701532125))
    )
    s = s * s
    s = s * s
    s = s * s
    s = s * s
    s = s * s
    s = s * s
    s = s * s
    s = s * s
    s = s * s
    t = s * 4503599627370496.0  # 2**52
    return (s + t) - t


def _exp_of_sum(x: float, low: float) -> float:
    """Return exp(x + low), where ``low`` is a small correction to x, below an ulp of x.

    Computed as 2**k (1 + r + r*r*q(r)) with r = x + low - k ln 2, |r| <= ln(2)/2.
    """
    low = low if abs(x) < 750.0 else 0.0
    x = 710.0 if x > 710.0 else x
    x = -746.0 if x < -746.0 else x
    k = (x * 1.4426950408889634 + 6755399441055744.0) - 6755399441055744.0
    a = x - k * 0.6931471805598903
    b = k * 5.497923018708371e-14 - low
    r = a - b
    e = (a - r) - b
    z = r * r
    w = z * z
    q = w * w * ((2.75572736431103e-07 + r * 2.5105217004720745e-08) + z * 2.0914686968086876e-09) + w * (
        (0.0013888888888883748 + r * 0.00019841269874820627)
        + z * (2.4801587325547743e-05 + r * 2.7557255400206422e-06)
    )
    q = q + ((0.5 + r * 0.1666666666666667) + z * (0.04166666666666667 + r * 0.008333333333326136))
    f = 1.0 + (r + (z * q + e))
    h = (k + 13510798882111488.0) - 13510798882111488.0
    d = k - h
    s = _power_of_two(0.5 * h)
    return f * (1.0 + d * (0.75 + d * 0.25)) * s * s


def exp(x: float) -> float:
    """Return e**x within 0.9 ulp; inf above 709.78, subnormal and then 0 below -708.4."""
    return _exp_of_sum(x, 0.0)


def _significand(x: float) -> tuple[float, float]:
    """Return (m, e) with x = m * 2**e and sqrt(1/2) <= m < sqrt(2), for finite x > 0.

    For other x, m is any value but -1.
    """
    c = x < 1e-270
    e = -120.0 if c else 0.0
    x = x * 1.329227995784916e36 if c else x  # 2**120
    c = x < 1.4142135623730951
    e = e - 1000.0 if c else e + 1.0
    x = x * 1.0715086071862673e301 if c else x * 0.5  # 2**1000
    c = x >= 9.480751908109177e153  # sqrt(1/2) * 2**512, and so on down to 2**1
    e = e + 512.0 if c else e
    x = x * 7.458340731200207e-155 if c else x
    c = x >= 8.187737150746413e76
    e = e + 256.0 if c else e
    x = x * 8.636168555094445e-78 if c else x
    c = x >= 2.4061596916800453e38
    e = e + 128.0 if c else e
    x = x * 2.938735877055719e-39 if c else x
    c = x >= 1.3043817825332783e19
    e = e + 64.0 if c else e
    x = x * 5.421010862427522e-20 if c else x
    c = x >= 3037000499.97605
    e = e + 32.0 if c else e
    x = x * 2.3283064365386963e-10 if c else x
    c = x >= 46340.95001184158
    e = e + 16.0 if c else e
    x = x * 1.52587890625e-05 if c else x
    c = x >= 181.01933598375618
    e = e + 8.0 if c else e
    x = x * 0.00390625 if c else x
    c = x >= 11.313708498984761
    e = e + 4.0 if c else e
    x = x * 0.0625 if c else x
    c = x >= 2.8284271247461903
    e = e + 2.0 if c else e
    x = x * 0.25 if c else x
    c = x >= 1.4142135623730951
    e = e + 1.0 if c else e
    x = x * 0.5 if c else x
    return x, e


def log(x: float) -> float:
    """Return the natural logarithm of x within 0.9 ulp; -inf at 0, nan for negative x."""
    m, e = _significand(x)
    f = m - 1.0
    s = f / (2.0 + f)
    z = s * s
    w = z * z
    r = w * (3.999999999940941908e-01 + w * (2.222219843214978396e-01 + w * 1.531383769920937332e-01)) + z * (
        6.666666666666735130e-01
        + w * (2.857142874366239149e-01 + w * (1.818357216161805012e-01 + w * 1.479819860511658591e-01))
    )
    h = 0.5 * f * f
    v = e * 6.93147180369123816490e-01 - ((h - (s * (h + r) + e * 1.90821492927058770002e-10)) - f)
    v = v if x > 0.0 else 1e999 - 1e999
    v = -1e999 if x == 0.0 else v
    return x if x == 1e999 else v


def _product(a: float, b: float) -> tuple[float, float]:
    """Return a*b as a rounded product and its exact rounding error, for |a|, |b| < 2**996."""
    c = a * 134217729.0  # 2**27 + 1 splits a number into halves of 26 bits
    u = c - (c - a)
    c = b * 134217729.0
    v = c - (c - b)
    s = a - u
    t = b - v
    p = a * b
    return p, (((u * v - p) + u * t) + s * v) + s * t


def power(x: float, y: float) -> float:
    """Return x**y for x >= 0 within 0.9 ulp; power(x, 0) = 1, power(0, y > 0) = 0, nan for x < 0 and for any nan.

    Computed as exp(y log x), with the logarithm as a sum of two numbers with a relative error near 2**-68:
    log m = 2 s + s z (2/3 + z (2/5 + z q(z))), s = (m - 1)/(m + 1), z = s*s.
    """
    m, e = _significand(x)
    f = m - 1.0
    d = m + 1.0
    i = 1.0 / d
    s = f * i
    p, q = _product(s, d)
    t = (((f - p) - q) - s * (m - (d - 1.0))) * i  # s + t is (m - 1)/(m + 1); other sums: z+o, a+q, g+h, u+v
    z, o = _product(s, s)
    o = o + 2.0 * s * t
    w = z * z
    q = w * (
        0.15384606355892447 + z * 0.13334204464506105 + w * (0.11721731747176209 + z * 0.11567351729591345)
    )
    q = z * (0.285714285714286 + z * 0.22222222222140214 + (w * 0.18181818226283877 + z * q))
    a = 0.4 + q
    q = (0.4 - a) + q - 2.2204460492503132e-17
    g, h = _product(z, a)
    h = h + (o * a + z * q)
    a = 0.6666666666666666 + g
    q = (0.6666666666666666 - a) + g + (h + 3.700743415417188e-17)
    g, h = _product(z, a)
    h = h + (o * a + z * q)
    u, v = _product(s, g)
    v = v + (s * h + t * g)
    a = 2.0 * s  # from now on c + r is e ln 2 + 2 s + u + v
    b = e * 0.6931471805598903
    c = b + a
    r = (b - c) + a
    a = c + u
    r = r + ((c - a) + u) + ((2.0 * t + v) + e * 5.497923018708371e-14)
    c = a + r
    r = (a - c) + r
    y = 18446744073709551616.0 if y > 18446744073709551616.0 else y  # 2**64
    y = -18446744073709551616.0 if y < -18446744073709551616.0 else y
    p, q = _product(y, c)
    v = _exp_of_sum(p, q + y * r)
    v = v if x > 0.0 else 1e999 - 1e999
    b = 0.0 if y > 0.0 else 1e999
    v = b if x == 0.0 else v
    b = 1e999 if y > 0.0 else 0.0
    v = b if x == 1e999 else v
    v = v if y == y else y
    return 1.0 if y == 0.0 and x >= 0.0 else v


def tanh(x: float) -> float:
    """Return the hyperbolic tangent of x within 0.9 ulp; x itself for a zero of either sign, nan for nan.

    With d = |x| up to ln(3)/2, where it is 1/2, it is t = d + d z p(z), z = d*d. Up to 1.05 the addition theorem gives
    T + (1 - T*T) t/(1 + T t) with d = |x| - c from c, where it is T = 21/32. Beyond, it is 1 - 2/(exp(2|x|) + 1).
    """
    a = abs(x)
    near = a < 0.5493061443340549
    middle = a < 1.05
    d = a if near else (a - 0.7861983203768756) + 2.811180981999074e-18
    d = d if middle else 0.0
    z = d * d
    w = z * z
    odd = -5.396825396744443e-02 + w * (
        -8.86323440880559e-03
        + w * (-1.4556629905694146e-03 + w * (-2.346517562312281e-04 + w * -2.0622177881442893e-05))
    )
    even = 1.3333333333332723e-01 + w * (
        2.1869488494143087e-02
        + w * (3.5921105237347512e-03 + w * (5.889417774572667e-04 + w * 8.51410513129533e-05))
    )
    t = d + d * (z * (-3.333333333333333e-01 + (z * even + w * odd)))
    top = 0.5693359375 * t if middle else -2.0
    bottom = 1.0 + 0.65625 * t if middle else exp(2.0 * a) + 1.0
    base = 0.65625 if middle else 1.0
    t = t if near else base + top / bottom
    t = t if x > 0.0 else -t
    return x if x == 0.0 else t


def atan2(y: float, x: float) -> float:
    """Return the polar angle of the point (x, y) [rad], in -pi ... pi, within 2 ulp; 0 at the origin."""
    a, b = abs(y), abs(x)
    middle = a > 0.4375 * b
    high = a > 2.4375 * b
    top = -b if high else (a - b if middle else a)
    bottom = a if high else (a + b if middle else b)
    t = top / (bottom if bottom > 0.0 else 1.0)
    z = t * t
    w = z * z
    odd = w * (
        -1.99999999998764832476e-01
        + w * (-1.11111104054623557880e-01 + w * (-7.69187620504482999495e-02 + w * (
            -5.83357013379057348645e-02 + w * -3.65315727442169155270e-02)))
    )
    even = z * (
        3.33333333333329318027e-01
        + w * (1.42857142725034663711e-01 + w * (9.09088713343650656196e-02 + w * (
            6.66107313738753120669e-02 + w * (4.97687799461593236017e-02 + w * 1.62858201153657823623e-02))))
    )
    base = 1.5707963267948966 if high else (0.7853981633974483 if middle else 0.0)
    low = 6.123233995736766e-17 if high else (3.061616997868383e-17 if middle else 0.0)
    result = base - ((t * (even + odd) - low) - t)
    result = result if x >= 0.0 else 3.141592653589793 - (result - 1.2246467991473532e-16)
    return result if y >= 0.0 else -result
