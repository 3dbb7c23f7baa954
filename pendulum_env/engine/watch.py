"""Generated source of the diagnostics "tension" (pull of the suspension on the bob) and "flow" (Reynolds number etc.).
"""

from __future__ import annotations

import math

from pendulum_env.engine import air
from pendulum_env.engine.problem import Problem, slipping
from pendulum_env.engine.shape import joined
from pendulum_env.physics.elementary import cos
from pendulum_env.physics.flow import natural_rate, reynolds_number
from pendulum_env.physics.scene import Scene

NODES = 8
"""Number of points of the midpoint rule for the energy loss in a quarter of a harmonic swing."""


def numbers(scene: Scene) -> dict[str, float]:
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
    return problem.define("tension", "t, q, v", [*air.motion(problem), f"return {' + '.join(pulls)}"], extra)


def flow(problem: Problem) -> list[str]:
    """Write the source of the bob's relative speed, of its speed at the bottom, and of the quality factor.

    The quality factor is that of a harmonic swing that passes the bottom with this speed.
    """
    shape = problem.shape
    speed = "speed" if problem.windy else "abs(v)"
    relative = problem.define("relative_speed", "t, q, v", [*air.motion(problem), f"return {speed}"])
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
