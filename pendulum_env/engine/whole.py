"""Source for methods that ask a scene for more than its torques: its closed form, its series, its force's gradient."""

from __future__ import annotations

from collections.abc import Iterable
from functools import reduce
from operator import add
from typing import TYPE_CHECKING

from integrators import ForceGradient, Taylor
from integrators.steps.tracing import Traced
from pendulum_env.engine import subflows
from pendulum_env.engine.series import Recorder, by_time, series
from pendulum_env.engine.shape import joined
from pendulum_env.engine.source import arguments
from pendulum_env.physics.effects import Effect
from pendulum_env.physics.exact.flows import flow_of

if TYPE_CHECKING:
    from pendulum_env.engine.generate import _Writer


def timed(effects: Iterable[Effect]) -> list[Effect]:
    """Those whose torques depend on the time."""
    return [effect for effect in effects if effect.torque and "time" in arguments(effect.torque)]


def in_time(writer: _Writer) -> bool:
    """True if the torque at rest in one place depends on the time."""
    winds = [wind for effect in writer.scene.effects for wind in (effect.wind_x, effect.wind_y) if wind]
    return bool(timed(writer.torques)) or (writer.windy and any("time" in arguments(wind) for wind in winds))


def exact_flow(writer: _Writer) -> str:
    """The solution in closed form, with the heats that it knows."""
    flow = flow_of(writer.scene.effects)
    if flow is None:
        raise NotImplementedError("These effects together have no closed form.")
    named = {effect.name: effect for effect in writer.scene.effects}
    heats = [writer.heat_of(named[name]) for name in flow.heats]
    found = ", ".join(["q1", "v1", *(f"d_{heat}" if heat else "_" for heat in heats)])
    results = ", ".join(["q1", "v1", *(f"d_{name}" for name in writer.quadratures)])
    return writer.define("exact_flow", "t, q, v, h", [f"{found} = {writer.call(flow.function)}", f"return {results}"])


def taylor_series(writer: _Writer, method: Taylor) -> str:
    """Taylor coefficients of the motion and of the quadratures."""

    def rates(recorder: Recorder, torques: dict[str, Traced]) -> dict[str, Traced]:
        found: dict[str, Traced] = {}
        for name in writer.quadratures:
            work = name == "work"
            chosen = writer.drives if work else [effect for effect in writer.drags if writer.heat_of(effect) == name]
            terms = [torques[effect.name] for effect in chosen]
            if writer.slides and writer.heat_of(writer.dry_effect) == name:
                terms.append(-recorder.get("direction") * recorder.get(writer.dry))
            power = recorder.get("velocity") * reduce(add, terms)
            found[name] = power if work else -power
        return found

    dry = writer.dry if writer.slides else ""
    lines, called = series(method, writer.torques, rates, dry, writer.scene.periodic)
    writer.used += called
    return writer.define("series", "t, q, v", lines, (*writer.extra, "direction") if dry else writer.extra)


def stored(writer: _Writer) -> tuple[str, dict[str, tuple[str, ...]]] | None:
    """``store`` and the ``kick`` that goes with it, for splittings of forces of the place that book work; else None.

    Such methods keep their order only for what a kick changes by an amount that does not depend on the velocity, as
    work does. With torque = -dU/dq, work = -[U] + integral of dU/dt over the time; U(q) - U(start of the step) serves.
    """
    stores = [effect.store for effect in writer.drives if effect.store]
    if "velocity_free" not in writer.method.needs or "work" not in writer.quadratures:
        return None
    if len(stores) < len(writer.drives):
        return None
    pieces = [writer.define("store", "t, q", [f"return {writer.sum_of(writer.drives, 'store')}"])]
    moving = [function for function in stores if "time" in arguments(function)]
    gain = "0.0"
    if moving:
        before, found, called = by_time(moving, writer.scene.periodic)
        writer.used += called
        pieces.append(writer.define("store_by_time", "t, q", [*before, f"return {found}"]))
        more = joined(writer.extra)
        gain = f"h*(store_by_time(t, q, {more}) - store_by_time(t, start, {more}))"
    pieces.append(writer.define("kick", "t, q, v, a, h, start", [f"return v + h*a, {gain}"]))
    return "\n\n".join(pieces), {"kick": ("work",), "store": ("work",)}


def force_gradient(writer: _Writer, method: ForceGradient) -> tuple[list[str], dict[str, tuple[str, ...]]]:
    """Force, gradient and, where work rides along, both kinds of kick; and what these add to."""
    pieces = [writer.force(), writer.jacobian()]
    if not writer.quadratures:
        return pieces, {}
    plain, kicks = subflows.kick(writer, "kick")
    drive = writer.sum_of(writer.drives, "torque")
    by_angle = writer.sum_of(writer.drives, "by_angle")
    lines = [
        "v1 = v + h*(a + reach*a*slope)",
        f"drive = {drive}",
        f"rate = drive + 0.5*reach*(3.0*a*({by_angle}) - drive*slope)",
        "work = 0.5*h*(v + v1)*rate",
    ]
    moving = timed(writer.torques)
    for name, effects in (("drive", [e for e in moving if e in writer.drives]), ("force", moving)):
        if moving:
            periodic = writer.scene.periodic
            before, found, called = by_time([e.torque for e in effects], periodic) if effects else ([], "0.0", [])
            writer.used += called
            lines += [*before, f"{name}_by_time = {found}"]
    lines += ["work = work + 0.5*h*reach*(drive_by_time*a - drive*force_by_time)"] if moving else []
    lines.append("return v1, work")
    return [*pieces, plain, writer.define("gradient_kick", "t, q, v, a, slope, reach, h", lines)], {
        **kicks, "gradient_kick": kicks["kick"]
    }
