"""Drag in a medium that moves against the pivot, as source: wind, or the pivot's own motion.

With the medium's velocity over the length ``(x, y)``, its parts along the bob's path and away from the pivot are
``along = x cos(theta) + y sin(theta)`` and ``across = x sin(theta) - y cos(theta)``. A drag acts on ``slip``, the
velocity relative to that, and depends on ``speed``, its size with ``across`` included. Of the power that it takes from
the bob, the force times the medium's velocity is the air's work, and the force times the relative velocity is heat.
"""

from __future__ import annotations

from pendulum_env.engine.problem import Problem, slipping
from pendulum_env.physics.effects import Effect

LEAST = "1e-300"
"""What keeps a relative speed of zero from being divided by."""


def motion(problem: Problem) -> list[str]:
    """Return the lines that set along, across, slip and speed; none in a medium at rest."""
    if not problem.windy:
        return []
    side = "side*" if problem.shape.periodic else ""
    lines = [f"sine = {side}sin(q)", f"cosine = {side}cos(q)"]
    along, across = [], []
    for name, to_along, to_across in (("wind_x", "cosine", "sine"), ("wind_y", "sine", "-cosine")):
        calls = [problem.call(getattr(effect, name)) for effect in problem.effects if getattr(effect, name)]
        if calls:
            local = name.replace("wind", "air")
            lines.append(f"{local} = {' + '.join(calls)}")
            along.append(f"{local}*{to_along}")
            across.append(f"{local}*({to_across})")
    return [
        *lines, f"along = {' + '.join(along)}", f"across = {' + '.join(across)}", "slip = v - along",
        "speed = sqrt(slip*slip + across*across)",
    ]


def work(problem: Problem, effect: Effect) -> str:
    """Return the power of the medium on the bob by one drag: its force times the medium's velocity."""
    assert effect.torque is not None
    return f"along*{problem.call(effect.torque)} + across*{problem.call(effect.torque, slip='(-across)')}"


def heat(problem: Problem, effect: Effect) -> str:
    """Return the power that one drag turns into heat: its force against the relative velocity."""
    assert effect.torque is not None
    return f"-speed*{problem.call(effect.torque, slip='speed')}"


def derivatives(problem: Problem) -> tuple[list[str], str, str]:
    """Return lines, and behind them the derivatives of the drags' torques by angle and by velocity.

    See :mod:`pendulum_env.physics.effects`.
    """
    lines, by_angle, by_velocity = [f"share = 1.0/(speed*speed + {LEAST})"], [], []
    for effect in filter(slipping, problem.drags):
        assert effect.torque is not None
        by_angle.append(problem.call(effect.torque, slip="across"))
        by_velocity.append(problem.call(effect.torque, slip="1.0"))
        if effect.by_speed is not None:
            bend = f"bend_{effect.name}"
            lines.append(f"{bend} = share*{problem.call(effect.by_speed)}")
            by_angle.append(f"{bend}*across*v")
            by_velocity.append(f"{bend}*slip")
    return lines, " + ".join(by_angle), " + ".join(by_velocity)


def faded(problem: Problem, effect: Effect, duration: str) -> list[str]:
    """Return the lines of one drag's exact flow at a frozen angle: the velocity ``w`` after it, its heat and work."""
    assert effect.fade is not None
    lines = ["slip = v - along", f"rest, decay = {problem.call(effect.fade, duration=duration, cross='across')}"]
    return [*lines, "w = along + rest", "lifted = across*across*decay"]
