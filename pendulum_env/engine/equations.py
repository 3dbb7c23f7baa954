"""Generated source of the functions of an equation of motion, of the sub-flows of splittings, and of diagnostics.

The functions are acceleration, powers, derivatives, potential and others. A kick changes the velocity by a torque at a
fixed angle; a drag flow is the exact solution for drag alone, and for the part of a motor's torque that depends on the
velocity. Kicks and drag flows add up their work and heat. The diagnostics are "tension", the pull of the suspension on
the bob, and "flow", its Reynolds number and others.

In a medium that moves relative to the pivot, by wind or by motion of the pivot, let ``(x, y)`` be the medium's velocity
divided by the length. Its components along the bob's path and away from the pivot are
``along = x cos(theta) + y sin(theta)`` and ``across = x sin(theta) - y cos(theta)``. The drag acts on ``slip``, the
bob's velocity minus ``along``, and depends on ``speed``, the magnitude of the relative velocity with ``across``
included. The work of the medium is the drag times the medium's velocity; the heat is the drag times the relative
velocity.
"""

from __future__ import annotations

import math
from collections.abc import Collection

from pendulum_env.engine.problem import AT_REST, Problem, slipping, timed
from pendulum_env.engine.reading import arguments
from pendulum_env.engine.series import by_time
from pendulum_env.engine.shape import joined
from pendulum_env.physics.effects import Effect
from pendulum_env.physics.elementary import cos
from pendulum_env.physics.exact.flows import flow_of
from pendulum_env.physics.flow import natural_rate, reynolds_number
from pendulum_env.physics.scene import Scene

LEAST = "1e-300"
"""Small number, as source, that prevents division by a relative speed of zero."""


def air_motion(problem: Problem) -> list[str]:
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


def air_work(problem: Problem, effect: Effect) -> str:
    """Return the source of the power of the medium on the bob by one drag: drag times the medium's velocity."""
    assert effect.torque is not None
    return f"along*{problem.call(effect.torque)} + across*{problem.call(effect.torque, slip='(-across)')}"


def air_heat(problem: Problem, effect: Effect) -> str:
    """Return the source of the power that one drag turns into heat: minus drag times the relative velocity."""
    assert effect.torque is not None
    return f"-speed*{problem.call(effect.torque, slip='speed')}"


def air_derivatives(problem: Problem) -> tuple[list[str], str, str]:
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


def acceleration(problem: Problem, name: str = "acceleration", first: str = "t, q, v", *roles: str) -> str:
    """Write the source of ``acceleration``: the sum of all torques, divided by the moment of inertia.

    Dry friction, if there is any, has the sign that the argument ``direction`` of the generated function gives it.
    """
    shape, total = problem.shape, problem.sum_of(problem.torques, *roles, "torque")
    if shape.slides:
        total += f" - direction*{shape.dry}"
    return problem.define(name, first, [*air_motion(problem), f"return {total}"], problem.shape.forces)


def force(problem: Problem) -> str:
    """Write the source of ``force``: the sum of the torques, without drags, on a bob at rest."""
    still = [effect for effect in problem.torques if effect.kind != "dissipative"]
    return problem.define("force", "t, q", [f"return {problem.sum_of(still, 'torque', velocity=AT_REST)}"])


def rates(problem: Problem) -> str:
    """Write the source of ``rates``: acceleration, power of the drives, and heat that the drags produce per time."""
    shape, torques = problem.shape, problem.torques
    lines = [*air_motion(problem), *(f"torque_{e.name} = {problem.call(e.torque)}" for e in torques if e.torque)]
    total = " + ".join(f"torque_{e.name}" for e in torques) or "0.0"
    results = [total + (f" - direction*{shape.dry}" if shape.slides else "")]
    slips = [e for e in problem.drags if problem.windy and slipping(e)]
    for name in shape.quadratures:
        if name == "work":
            drives = [f"torque_{e.name}" for e in problem.drives]
            driving = [f"v*({' + '.join(drives)})"] if drives else []
            results.append(" + ".join([*driving, *(air_work(problem, e) for e in slips)]))
            continue
        terms = [f"torque_{e.name}" for e in problem.drags if problem.heat_of(e) == name and e not in slips]
        if shape.slides and problem.heat_of(problem.dry) == name:
            terms.append(f"-direction*{shape.dry}")
        heats = [f"-v*({' + '.join(terms)})"] if terms else []
        results.append(" + ".join([*heats, *(air_heat(problem, e) for e in slips if problem.heat_of(e) == name)]))
    return problem.define("rates", "t, q, v", [*lines, f"return {', '.join(results)}"], problem.shape.forces)


def jacobian(problem: Problem, name: str = "jacobian", first: str = "t, q, v", *roles: str) -> str:
    """Write the source of ``jacobian``: the derivatives of the acceleration by angle and by velocity."""
    still = [effect for effect in problem.torques if not (problem.windy and slipping(effect))]
    by_angle, by_velocity = problem.sum_of(still, *roles, "by_angle"), problem.sum_of(still, "by_velocity")
    lines: list[str] = []
    if problem.windy:
        more, angle, velocity = air_derivatives(problem)
        lines = [*air_motion(problem), *more]
        by_angle, by_velocity = f"{by_angle} + {angle}", f"{by_velocity} + {velocity}"
    return problem.define(name, first, [*lines, f"return {by_angle}, {by_velocity}"], problem.shape.forces)


def mean_acceleration(problem: Problem) -> str:
    """Write the source of the acceleration averaged over the angles from ``q - spread`` to ``q + spread``.

    Energy-conserving methods (average vector field) use it.
    """
    return acceleration(problem, "mean_acceleration", "t, q, v, spread", "mean")


def mean_jacobian(problem: Problem) -> str:
    """Write the source of the averaged acceleration's derivatives by the angle at the step's end and by the velocity.
    """
    return jacobian(problem, "mean_jacobian", "t, q, v, spread", "mean_by_end")


def exact_flow(problem: Problem) -> str:
    """Write the source of ``exact_flow``: the solution in closed form, with the heats of effects that have one."""
    flow = flow_of(problem.effects)
    if flow is None:
        raise NotImplementedError(
            "The effects of the scene have no common solution in closed form; choose a method other than the exact one."
        )
    named = {effect.name: effect for effect in problem.effects}
    heats = [problem.heat_of(named[name]) for name in flow.heats]
    values = ", ".join(["q1", "v1", *(f"d_{heat}" if heat else "_" for heat in heats)])
    results = ", ".join(["q1", "v1", *(f"d_{name}" for name in problem.shape.quadratures)])
    lines = [f"{values} = {problem.call(flow.function)}", f"return {results}"]
    return problem.define("exact_flow", "t, q, v, h", lines)


def potential(problem: Problem) -> str:
    """Write the source of ``potential``: the potential energy per moment of inertia at an angle."""
    holders = [effect for effect in problem.effects if effect.potential]
    first = "q, half_sine" if problem.shape.periodic else "q"
    return problem.define("potential", first, [f"return {problem.sum_of(holders, 'potential')}"], problem.shape.place)


def remember(problem: Problem) -> str:
    """Write the source of ``remember``, which advances the state variables of effects, such as gusts.

    The generated function is called once per control step.
    """
    shape = problem.shape
    lines = [f"{', '.join(f'{name}1' for name in effect.memory)}, = {problem.call(effect.advance)}"
             for effect in problem.effects if effect.advance]
    lines.append(f"return {', '.join(f'{name}1' for name in shape.remembered)},")
    return problem.define("remember", ", ".join((*shape.remembered, "control", "first", "span")), lines,
                          shape.parameters)


def in_time(problem: Problem) -> bool:
    """Return True if the sum of the torques on a bob at rest at a fixed angle depends on the time."""
    winds = [wind for effect in problem.effects for wind in (effect.wind_x, effect.wind_y) if wind]
    return bool(timed(problem.torques)) or (problem.windy and any("time" in arguments(wind) for wind in winds))


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
        lines = [*air_motion(problem), *lines] if shape.accounts else lines
        for effect in problem.drags:
            heat = problem.heat_of(effect)
            if not (effect.torque and heat):
                continue
            if problem.windy and slipping(effect):
                parts.setdefault(heat, []).append(f"h*({air_heat(problem, effect)})")
                parts.setdefault("work", []).append(f"h*({air_work(problem, effect)})")
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
    lines, sums = air_motion(problem), []

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
            lines += faded(problem, effect, duration)
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


NODES = 8
"""Number of points of the midpoint rule for the energy loss in a quarter of a harmonic swing."""


def flow_numbers(scene: Scene) -> dict[str, float]:
    """Return a scene's numbers for the formulas of the pull on the suspension and of the flow past the bob.

    They are the parameters PULL and FLOW of :mod:`pendulum_env.engine.shape`. Values that need a period are 0 in a
    scene without gravity. ``reynolds_rate`` is the ratio of Reynolds number and relative angular velocity [s],
    ``stroke_rate`` that of Keulegan-Carpenter number and angular velocity at the bottom [s], ``natural_rate`` the
    frequency omega0 [1/s].
    """
    body, omega0 = scene.body, natural_rate(scene)
    reach = body.reach * body.reach / scene.inertia
    return {
        "swing_pull": scene.bob_mass * reach,
        "gravity_pull": scene.bob_weight * scene.gravity * body.reach / scene.inertia,
        "pull_scale": scene.inertia / body.reach,
        "reynolds_rate": reynolds_number(body.reach, body, scene.medium),
        "stroke_rate": math.pi * body.reach / (body.radius * omega0) if omega0 else 0.0,
        "natural_rate": omega0,
    }


def tension(problem: Problem) -> str:
    """Write the source of ``tension``, the pull T on the suspension divided by I/L [1/s²].

    ``T = M L v² + W g cos(theta) + ...``, where I is the moment of inertia, L the length, M the bob's mass with the
    medium that moves along, and W its mass less that of the displaced medium.
    """
    pulls = ["swing_pull*v*v", *(problem.call(e.radial) for e in problem.effects if e.radial)]
    pulls += [problem.call(e.torque, slip="(-across)") for e in problem.drags if problem.windy and e.at_bob and
              e.torque and slipping(e)]
    extra = (*problem.shape.extra, *problem.shape.pull[:2])
    return problem.define("tension", "t, q, v", [*air_motion(problem), f"return {' + '.join(pulls)}"], extra)


def flow_functions(problem: Problem) -> list[str]:
    """Write the source of the bob's relative speed, of its speed at the bottom, and of the quality factor.

    The quality factor is that of a harmonic swing that passes the bottom with this speed.
    """
    shape = problem.shape
    speed = "speed" if problem.windy else "abs(v)"
    relative = problem.define("relative_speed", "t, q, v", [*air_motion(problem), f"return {speed}"])
    half_sine = ("sin_near_zero(0.5*q, 0.0)",) if shape.periodic else ()  # of an angle that is wrapped
    lines = [f"return sqrt(v*v + 2.0*potential({joined(('q',), half_sine, shape.place)}))"]
    bottom = problem.define("bottom_speed", "q, v", lines, shape.place)
    lines, terms = ["u = u if u > 1e-150 else 1e-150"], []
    idle = dict.fromkeys(("control", *(name for effect in problem.drives for name in effect.memory)), "0.0")
    for k in range(NODES):
        cosine = cos(math.pi * (k + 0.5) / (2 * NODES))
        lines.append(f"u{k} = {cosine!r}*u")
        names = {**dict.fromkeys(("velocity", "slip", "speed"), f"u{k}"), **idle}
        torques = [problem.call(effect.torque, **names) for effect in problem.flows if effect.torque]
        if torques:
            terms.append(f"{cosine!r}*({' + '.join(torques)})")
    lines += [f"loss = {-2.0 / NODES!r}/u*({' + '.join(terms) or '0.0'})"]
    if shape.dry:
        lines.append(f"loss = loss + {4.0 / math.pi!r}*{shape.dry}/u")
    lines.append("return natural_rate/loss if loss > 0.0 else (1e999 if natural_rate > 0.0 else 0.0)")
    return [relative, bottom, problem.define("quality", "u", lines, (*shape.parameters, "natural_rate"))]
