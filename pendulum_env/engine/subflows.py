"""Generated source of the sub-flows (kicks and drag flows) of splitting methods, with their work and heat.

A kick changes the velocity by a torque at a fixed angle; a drag flow is the exact solution for drag alone, and for
the part of a motor's torque that depends on the velocity.
"""

from __future__ import annotations

from collections.abc import Collection

from pendulum_env.engine import air
from pendulum_env.engine.problem import AT_REST, Problem, slipping, timed
from pendulum_env.engine.reading import arguments
from pendulum_env.engine.series import by_time
from pendulum_env.engine.shape import joined

Hooks = dict[str, tuple[str, ...]]
"""Name of a sub-flow's function -> the quadratures whose increments it returns after the velocity."""


def sub_flows(problem: Problem, called: Collection[str]) -> tuple[list[str], Hooks]:
    """Return the source of the sub-flows (kick, drag) that a step calls, and the quadratures that each of them changes.

    A kick that changes no quadrature, and drag in a scene without quadratures, is written directly into the step
    instead.
    """
    riding = bool(problem.shape.quadratures)
    if "gradient_kick" in called:
        return gradient_kicks(problem) if riding else ([], {})
    pieces: list[str] = []
    hooks: Hooks = {}
    name = next((name for name in ("kick", "push") if name in called), "")
    if name and (riding or problem.shape.dry):
        source, hooks = stored(problem) or kick(problem, name)
        pieces.append(source)
    if "drag" in called and problem.flows:
        source, adds = drag(problem)
        pieces.append(source)
        hooks = {**hooks, "drag": adds}
    return pieces, hooks


def kick(problem: Problem, name: str) -> tuple[str, Hooks]:
    """Write the source of the kick: the exact solution of ``v' = a`` at a fixed angle, with work and heat.

    Dry friction is part of the kick, and so is the heat of drag if ``name`` is "push" instead of "kick".
    """
    shape = problem.shape
    if shape.dry:
        lines = [f"v1, path, length = dry_glide(v, a, {shape.dry}, h)"]
    else:
        lines = ["v1 = v + h*a", "path = 0.5*h*(v + v1)"]
    parts: dict[str, list[str]] = {}
    if problem.drives and shape.accounts:
        velocity = {"velocity": AT_REST} if name == "kick" else {}
        parts["work"] = [f"path*({problem.sum_of(problem.drives, 'torque', **velocity)})"]
    if heat := problem.heat_of(problem.dry):
        parts.setdefault(heat, []).append(f"length*{shape.dry}")
    if name == "push":
        lines = [*air.motion(problem), *lines] if shape.accounts else lines
        for effect in problem.drags:
            heat = problem.heat_of(effect)
            if not (effect.torque and heat):
                continue
            if problem.windy and slipping(effect):
                parts.setdefault(heat, []).append(f"h*({air.heat(problem, effect)})")
                parts.setdefault("work", []).append(f"h*({air.work(problem, effect)})")
            else:
                parts.setdefault(heat, []).append(f"-h*v*{problem.call(effect.torque)}")
    ordered = tuple(quadrature for quadrature in shape.quadratures if quadrature in parts)
    results = ["v1", *(" + ".join(parts[quadrature]) for quadrature in ordered)]
    return problem.define(name, "t, q, v, a, h", [*lines, f"return {', '.join(results)}"]), {name: ordered}


def stored(problem: Problem) -> tuple[str, Hooks] | None:
    """Write the source of ``store`` and ``kick``, by which splitting methods compute the work of drives accurately.

    Methods for forces without velocity keep their order only for quantities that a kick changes by an amount
    independent of the velocity. The work of the drives is computed in such a form: with torque = -dU/dq, work = -[U] +
    integral of dU/dt over the time, where ``store`` is U, and U(q) - U(start of the step) serves in the kick. The
    result is None if the method does not need this form or a drive does not have it.
    """
    stores = [effect.store for effect in problem.drives if effect.store]
    if "velocity_free" not in problem.method.needs or "work" not in problem.shape.quadratures:
        return None
    if len(stores) < len(problem.drives):
        return None
    pieces = [problem.define("store", "t, q", [f"return {problem.sum_of(problem.drives, 'store')}"])]
    varying = [function for function in stores if "time" in arguments(function)]
    gain = "0.0"
    if varying:
        before, rate = by_time(varying, problem.shape.periodic)
        pieces.append(problem.define("store_by_time", "t, q", [*before, f"return {rate}"]))
        more = joined(problem.shape.extra)
        gain = f"h*(store_by_time(t, q, {more}) - store_by_time(t, start, {more}))"
    pieces.append(problem.define("kick", "t, q, v, a, h, start", [f"return v + h*a, {gain}"]))
    return "\n\n".join(pieces), {"kick": ("work",), "store": ("work",)}


def gradient_kicks(problem: Problem) -> tuple[list[str], Hooks]:
    """Write the source of two kicks, for methods that use both: the plain one, and the one with the force's gradient.
    """
    plain, kicks = kick(problem, "kick")
    drive = problem.sum_of(problem.drives, "torque")
    by_angle = problem.sum_of(problem.drives, "by_angle")
    lines = [
        "v1 = v + h*(a + reach*a*slope)",
        f"drive = {drive}",
        f"rate = drive + 0.5*reach*(3.0*a*({by_angle}) - drive*slope)",
        "work = 0.5*h*(v + v1)*rate",
    ]
    varying = timed(problem.torques)
    for name, effects in (("drive", [e for e in varying if e.kind == "drive"]), ("force", varying)):
        if varying:
            before, rate = by_time([e.torque for e in effects], problem.shape.periodic) if effects else ([], "0.0")
            lines += [*before, f"{name}_by_time = {rate}"]
    lines += ["work = work + 0.5*h*reach*(drive_by_time*a - drive*force_by_time)"] if varying else []
    lines.append("return v1, work")
    return [plain, problem.define("gradient_kick", "t, q, v, a, slope, reach, h", lines)], {
        **kicks, "gradient_kick": kicks["kick"]
    }


def drag(problem: Problem) -> tuple[str, tuple[str, ...]]:
    """Write the source of the exact solution for the drags alone; return it with the quadratures that it changes.

    Several drags are composed symmetrically. A motor's torque that depends on the velocity counts as a drag whose heat
    is work, negative where the motor brakes.
    """
    flows = problem.flows
    halves = [(effect, "0.5*h") for effect in flows[:-1]]
    lines, sums = air.motion(problem), []

    def add(name: str, value: str) -> None:
        """Add the term ``value`` to the increment of the quadrature ``name`` in the generated lines."""
        lines.append(f"d_{name} = {f'd_{name} + ' if name in sums else ''}{value}")
        sums.append(name)

    for effect, duration in (*halves, (flows[-1], "h"), *reversed(halves)):
        if effect.flow is None:
            raise NotImplementedError(
                f"{effect.name} has no exact flow, which a splitting method needs; use another method."
            )
        heat = problem.heat_of(effect)
        if problem.windy and slipping(effect):
            lines += air.faded(problem, effect, duration)
            if heat:
                add(heat, "0.5*(slip - rest)*(slip + rest) + lifted")
                add("work", "along*(w - v) + lifted")
        else:
            lines.append(f"w = {problem.call(effect.flow, duration=duration)}")
            if heat:
                add(heat, "0.5*(v - w)*(v + w)")
            elif effect.kind == "drive" and problem.shape.accounts:
                add("work", "0.5*(w - v)*(w + v)")
        lines.append("v = w")
    ordered = tuple(dict.fromkeys(sums))
    lines.append(f"return {', '.join(['v', *(f'd_{name}' for name in ordered)])}")
    return problem.define("drag", "t, q, v, h", lines), ordered
