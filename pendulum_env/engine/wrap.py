"""Angles stored relative to the nearer of bottom and top, so that angles near bottom or top keep their last bits.

``theta = tilt + 2 pi turns``, where ``turns`` is a multiple of one half: it is whole near the bottom, and ends in .5
near the top. ``side`` is +1 below the horizontal and -1 above, so that ``sin(theta) = side sin(tilt)`` and
``cos(theta) = side cos(tilt)``.
"""

from __future__ import annotations

from typing import Any

from integrators.steps.compensated import added


def half_turns(angle: float) -> float:
    """Return the number of half turns nearest to an angle [rad], for less than 2**51 half turns."""
    return (angle * 0.3183098861837907 + 6755399441055744.0) - 6755399441055744.0


def without_half_turns(angle: float, halves: float) -> float:
    """Return ``angle - halves * pi`` [rad], with pi in three parts: products are exact up to 2**23 half turns."""
    return ((angle - halves * 3.141592651605606) - halves * 1.9841871583270443e-09) - halves * 1.034036596358821e-18


def split_turns(angle: Any, periodic: bool) -> tuple[Any, Any]:
    """Return an angle [rad], or an array of them, as the angle from the nearer of bottom and top, and the turns.

    Unless the torques are ``periodic``, the angle is unchanged, and the turns are 0.
    """
    if not periodic:
        return angle, 0.0
    halves: Any = half_turns(angle)
    return without_half_turns(angle, halves), 0.5 * halves


def without_half_turns_kept(angle: float, lost: float, halves: float) -> tuple[float, float]:
    """Return ``angle + lost - halves * pi`` [rad] as a rounded sum and its rounding remainder."""
    return added(angle - halves * 3.141592651605606, lost, -halves * 1.9841871583270443e-09,
                 -halves * 1.034036596358821e-18)


def left_out(angle: Any, tilt: Any, lost: Any, turns: Any) -> Any:
    """Return what rounding has left out of ``angle``: ``tilt + lost + 2 pi turns - angle`` [rad].

    ``tilt`` is the angle from the nearer of bottom and top, and ``lost`` the remainder that a compensated sum keeps
    beside it.
    """
    rest = tilt - (angle - turns * 6.283185303211212)
    return ((rest + turns * 3.9683743166540886e-09) + turns * 2.068073192717642e-18) + lost


def side_of(turns: float) -> float:
    """Return ``side``: +1.0 if ``turns`` is whole (bob below the horizontal), -1.0 if it ends in .5 (above).

    The result is exact for less than 2**50 turns.
    """
    return 1.0 - 4.0 * abs(turns - ((turns + 6755399441055744.0) - 6755399441055744.0))
