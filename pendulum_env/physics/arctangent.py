"""Portable arctangent of a point, with identical bits interpreted and compiled.

Source: Sun Microsystems, fdlibm 5.3 (1993), s_atan.c, for the polynomial on [0, 7/16]. Larger angles are first reduced
by ``pi/4`` or ``pi/2``, with ``atan((y - x)/(y + x))`` or ``atan(-x/y)``.
"""

__all__ = ["atan2"]


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
