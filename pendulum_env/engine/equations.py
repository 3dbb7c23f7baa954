"""Generated source of the functions of an equation of motion: acceleration, powers, derivatives, potential and others.
"""

from __future__ import annotations

from pendulum_env.engine import air
from pendulum_env.engine.problem import AT_REST, Problem, slipping, timed
from pendulum_env.engine.reading import arguments
from pendulum_env.physics.exact.flows import flow_of


def acceleration(problem: Problem, name: str = "acceleration", first: str = "t, q, v", *roles: str) -> str:
    """Write the source of ``acceleration``: the sum of all torques, divided by the moment of inertia.

    Dry friction, if there is any, has the sign that the argument ``direction`` of the generated function gives it.
    """
    shape, total = problem.shape, problem.sum_of(problem.torques, *roles, "torque")
    if shape.slides:
        total += f" - direction*{shape.dry}"
    return problem.define(name, first, [*air.motion(problem), f"return {total}"], problem.shape.forces)


def force(problem: Problem) -> str:
    """Write the source of ``force``: the sum of the torques, without drags, on a bob at rest."""
    still = [effect for effect in problem.torques if effect.kind != "dissipative"]
    return problem.define("force", "t, q", [f"return {problem.sum_of(still, 'torque', velocity=AT_REST)}"])


def rates(problem: Problem) -> str:
    """Write the source of ``rates``: acceleration, power of the drives, and heat that the drags produce per time."""
    shape, torques = problem.shape, problem.torques
    lines = [*air.motion(problem), *(f"torque_{e.name} = {problem.call(e.torque)}" for e in torques if e.torque)]
    total = " + ".join(f"torque_{e.name}" for e in torques) or "0.0"
    results = [total + (f" - direction*{shape.dry}" if shape.slides else "")]
    slips = [e for e in problem.drags if problem.windy and slipping(e)]
    for name in shape.quadratures:
        if name == "work":
            drives = [f"torque_{e.name}" for e in problem.drives]
            driving = [f"v*({' + '.join(drives)})"] if drives else []
            results.append(" + ".join([*driving, *(air.work(problem, e) for e in slips)]))
            continue
        terms = [f"torque_{e.name}" for e in problem.drags if problem.heat_of(e) == name and e not in slips]
        if shape.slides and problem.heat_of(problem.dry) == name:
            terms.append(f"-direction*{shape.dry}")
        heats = [f"-v*({' + '.join(terms)})"] if terms else []
        results.append(" + ".join([*heats, *(air.heat(problem, e) for e in slips if problem.heat_of(e) == name)]))
    return problem.define("rates", "t, q, v", [*lines, f"return {', '.join(results)}"], problem.shape.forces)


def jacobian(problem: Problem, name: str = "jacobian", first: str = "t, q, v", *roles: str) -> str:
    """Write the source of ``jacobian``: the derivatives of the acceleration by angle and by velocity."""
    still = [effect for effect in problem.torques if not (problem.windy and slipping(effect))]
    by_angle, by_velocity = problem.sum_of(still, *roles, "by_angle"), problem.sum_of(still, "by_velocity")
    lines: list[str] = []
    if problem.windy:
        more, angle, velocity = air.derivatives(problem)
        lines = [*air.motion(problem), *more]
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
