"""The free flight of a bob whose wire is slack, until the wire catches it again."""

from __future__ import annotations

import math
from typing import NamedTuple

from pendulum_env.physics.exact.base import in_floats, number


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
