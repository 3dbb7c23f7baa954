"""Source of a splitting's sub-flows, with what each adds to work and heat."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pendulum_env.engine import air
from pendulum_env.physics.effects.coulomb_friction import dry_glide

if TYPE_CHECKING:
    from pendulum_env.engine.generate import _Writer


def kick(writer: _Writer, name: str) -> tuple[str, dict[str, tuple[str, ...]]]:
    """``kick`` or ``push``: the flow of ``v' = a``, with sticking under dry friction; what it adds to, by name."""
    if writer.dry:
        writer.used.append(dry_glide)
        lines = [f"v1, path, length = dry_glide(v, a, {writer.dry}, h)"]
    else:
        lines = ["v1 = v + h*a", "path = 0.5*h*(v + v1)"]
    parts: dict[str, list[str]] = {}
    if writer.drives and writer.ledger:
        parts["work"] = [f"path*({writer.sum_of(writer.drives, 'torque')})"]
    if writer.dry and writer.heat_of(writer.dry_effect):
        parts.setdefault(writer.heat_of(writer.dry_effect), []).append(f"length*{writer.dry}")
    if name == "push":
        lines = [*air.motion(writer), *lines] if writer.ledger else lines
        for effect in writer.drags:
            if not (effect.torque and writer.heat_of(effect)):
                continue
            moved = writer.windy and air.slipping(effect)
            power = air.heat(writer, effect) if moved else f"-v*{writer.call(effect.torque)}"
            parts.setdefault(writer.heat_of(effect), []).append(f"h*({power})" if moved else f"-h*{power[1:]}")
            if moved:
                parts.setdefault("work", []).append(f"h*({air.work(writer, effect)})")
    ordered = tuple(quadrature for quadrature in writer.quadratures if quadrature in parts)
    results = ["v1", *(" + ".join(parts[quadrature]) for quadrature in ordered)]
    return writer.define(name, "t, q, v, a, h", [*lines, f"return {', '.join(results)}"]), {name: ordered}


def drag(writer: _Writer) -> tuple[str, tuple[str, ...]]:
    """The drags' exact flows, composed symmetrically where there are several, each with its own heat; what they add to.
    """
    halves = [(effect, "0.5*h") for effect in writer.drags[:-1]]
    lines, sums = air.motion(writer), []

    def add(name: str, value: str) -> None:
        lines.append(f"d_{name} = {f'd_{name} + ' if name in sums else ''}{value}")
        sums.append(name)

    for effect, duration in (*halves, (writer.drags[-1], "h"), *reversed(halves)):
        if effect.flow is None:
            raise NotImplementedError(f"{effect.name} has no exact flow for splitting methods.")
        heat = writer.heat_of(effect)
        if writer.windy and air.slipping(effect):
            lines += air.faded(writer, effect, duration)
            if heat:
                add(heat, "0.5*(slip - rest)*(slip + rest) + lifted")
                add("work", "along*(w - v) + lifted")
        else:
            lines.append(f"w = {writer.call(effect.flow, duration=duration)}")
            if heat:
                add(heat, "0.5*(v - w)*(v + w)")
        lines.append("v = w")
    ordered = tuple(dict.fromkeys(sums))
    lines.append(f"return {', '.join(['v', *(f'd_{name}' for name in ordered)])}")
    return writer.define("drag", "t, q, v, h", lines), ordered
