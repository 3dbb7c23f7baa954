"""Generated source of drag in a medium that moves relative to the pivot: wind, or motion of the pivot.

Let ``(x, y)`` be the medium's velocity divided by the length. Its components along the bob's path and away from the
pivot are ``along = x cos(theta) + y sin(theta)`` and ``across = x sin(theta) - y cos(theta)``. The drag acts on
``slip``, the bob's velocity minus ``along``, and depends on ``speed``, the magnitude of the relative velocity with
``across`` included. The work of the medium is the drag times the medium's velocity; the heat is the drag times the
relative velocity.
"""

from __future__ import annotations

from pendulum_env.engine.problem import Problem, slipping
from pendulum_env.physics.effects import Effect

LEAST = "1e-300"
"""Small number, as source, that prevents division by a relative speed of zero."""


def motion(problem: Problem) -> list[str]:
    """Return the source lines that compute ``along``, ``across``, ``slip`` and ``speed`` in a medium that moves.

    ``along`` and ``across`` are the components of the medium's velocity, ``slip`` and ``speed`` the bob's velocity
    relative to the medium; the module's docstring gives the equations. There are no lines for a medium at rest.
    """
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
    """Return the source of the power of the medium on the bob by one drag: drag times the medium's velocity."""
    assert effect.torque is not None
    return f"along*{problem.call(effect.torque)} + across*{problem.call(effect.torque, slip='(-across)')}"


def heat(problem: Problem, effect: Effect) -> str:
    """Return the source of the power that one drag turns into heat: minus drag times the relative velocity."""
    assert effect.torque is not None
    return f"-speed*{problem.call(effect.torque, slip='speed')}"


def derivatives(problem: Problem) -> tuple[list[str], str, str]:
    """Return source lines, and the derivatives of the sum of all drag torques by angle and by velocity.

    The derivatives are source expressions, with which an implicit method's Newton iteration is generated; the lines set
    the local names in them. See :mod:`pendulum_env.physics.effects`.
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
    """Return the source lines of the exact solution for one drag alone, at a fixed angle, in a medium that moves.

    The lines compute the velocity ``w`` after the time, and the heat and work of the drag.
    """
    assert effect.fade is not None
    lines = ["slip = v - along", f"rest, decay = {problem.call(effect.fade, duration=duration, cross='across')}"]
    return [*lines, "w = along + rest", "lifted = across*across*decay"]
