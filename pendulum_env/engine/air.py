"""Drag in a medium that moves against the pivot, as source: wind, or the pivot's own motion.

With the medium's velocity over the length ``(x, y)``, its parts along the bob's path and away from the pivot are
``along = x cos(theta) + y sin(theta)`` and ``across = x sin(theta) - y cos(theta)``. A drag acts on ``slip``, the
velocity relative to that, and depends on ``speed``, its size with ``across`` included. Of the power that it takes from
the bob, the force times the medium's velocity is the air's work, and the force times the relative velocity is heat.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from pendulum_env.engine.source import arguments
from pendulum_env.physics.effects import Effect
from pendulum_env.physics.elementary import cos, sin, sqrt

if TYPE_CHECKING:
    from pendulum_env.engine.generate import _Writer

LEAST = "1e-300"
"""What keeps a relative speed of zero from being divided by."""


def slipping(effect: Effect) -> bool:
    """True if an effect is a drag: acts against the medium."""
    return effect.torque is not None and "slip" in arguments(effect.torque)


def moving(effects: Iterable[Effect]) -> bool:
    """True if there is drag in a medium that moves."""
    found = tuple(effects)
    return any(effect.wind_x or effect.wind_y for effect in found) and any(map(slipping, found))


def motion(writer: _Writer) -> list[str]:
    """Lines that set along, across, slip and speed; none in a medium at rest."""
    if not writer.windy:
        return []
    writer.used += [sin, cos, sqrt]
    side = "side*" if writer.scene.periodic else ""
    lines = [f"sine = {side}sin(q)", f"cosine = {side}cos(q)"]
    along, across = [], []
    for name, to_along, to_across in (("wind_x", "cosine", "sine"), ("wind_y", "sine", "-cosine")):
        calls = [writer.call(getattr(effect, name)) for effect in writer.scene.effects if getattr(effect, name)]
        if calls:
            local = name.replace("wind", "air")
            lines.append(f"{local} = {' + '.join(calls)}")
            along.append(f"{local}*{to_along}")
            across.append(f"{local}*({to_across})")
    return [
        *lines, f"along = {' + '.join(along)}", f"across = {' + '.join(across)}", "slip = v - along",
        "speed = sqrt(slip*slip + across*across)",
    ]


def work(writer: _Writer, effect: Effect) -> str:
    """Power of the medium on the bob by one drag: its force times the medium's velocity."""
    assert effect.torque is not None
    return f"along*{writer.call(effect.torque)} + across*{writer.call(effect.torque, slip='(-across)')}"


def heat(writer: _Writer, effect: Effect) -> str:
    """Power that one drag turns into heat: its force against the relative velocity."""
    assert effect.torque is not None
    return f"-speed*{writer.call(effect.torque, slip='speed')}"


def derivatives(writer: _Writer) -> tuple[list[str], str, str]:
    """Of the drags' torques: lines before, that by angle, that by velocity; see :mod:`pendulum_env.physics.effects`."""
    lines, by_angle, by_velocity = [f"share = 1.0/(speed*speed + {LEAST})"], [], []
    for effect in filter(slipping, writer.drags):
        assert effect.torque is not None
        by_angle.append(writer.call(effect.torque, slip="across"))
        by_velocity.append(writer.call(effect.torque, slip="1.0"))
        if effect.by_speed is not None:
            bend = f"bend_{effect.name}"
            lines.append(f"{bend} = share*{writer.call(effect.by_speed)}")
            by_angle.append(f"{bend}*across*v")
            by_velocity.append(f"{bend}*slip")
    return lines, " + ".join(by_angle), " + ".join(by_velocity)


def faded(writer: _Writer, effect: Effect, duration: str) -> list[str]:
    """Lines of one drag's exact flow at a frozen angle: ``w``, the velocity after it, its heat and the air's work."""
    assert effect.fade is not None
    lines = ["slip = v - along", f"rest, decay = {writer.call(effect.fade, duration=duration, cross='across')}"]
    return [*lines, "w = along + rest", "lifted = across*across*decay"]
