"""One step of the small-angle pendulum in closed form, free or damped: plain functions, copied into generated programs.

For ``theta'' + gamma theta' + omega0**2 theta = 0``, with d = gamma/2 and ``z = (d**2 - omega0**2) h**2``::

    theta1 = e^(-d h) (theta (C + d h S) + theta' h S)        C = cosh(sqrt z)
    theta1' = e^(-d h) (theta' (C - d h S) - omega0**2 h theta S)     S = sinh(sqrt z)/sqrt z

C and S are entire functions of z; near critical damping they are computed by their series. Source: Landau & Lifshitz,
Mechanics (1976), section 25.
"""

from __future__ import annotations

from pendulum_env.physics.elementary import cos, exp, power, sin


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
