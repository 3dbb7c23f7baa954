"""A scene in words: apparatus, medium, effects and what follows from them, with units."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from pendulum_env.physics.units import first_line

if TYPE_CHECKING:
    from pendulum_env.physics.scene import Scene


def describe(scene: Scene) -> str:
    """The scene's equation, its parts, its effects with what they change, and its usual run: a line each."""
    return "\n".join(_lines(scene))


def _lines(scene: Scene) -> Iterator[str]:
    yield f"{scene.name}: {scene.equation()}"
    yield f"body: {values(scene.body)}"
    yield f"medium: {scene.medium.name}{'' if scene.medium.empty else f', {values(scene.medium)}'}"
    yield f"inertia I = {scene.inertia:.6g} kg m^2 about the pivot; gravity {scene.gravity:.6g} m/s^2"
    if scene.omega0:
        yield f"small swings: omega0 = {scene.omega0:.6g} rad/s, period {2.0 * math.pi / scene.omega0:.6g} s"
    for effect in scene.effects:
        said = (first_line(type(effect)), values(effect), ", ".join(_changes(scene, effect)))
        yield f"{effect.name}: {'; '.join(filter(None, said))}"
    run = scene.run
    yield (
        f"usual run: from {math.degrees(run.angle):.6g} degrees at {run.velocity:.6g} rad/s, "
        f"{run.duration:.6g} s in steps of {run.dt:.6g} s"
    )


def values(part: Any) -> str:
    """The values of a part with their units, without its name and what is derived."""
    found = ((f, getattr(part, f.name)) for f in fields(part) if f.name != "name")
    return ", ".join(f"{f.name} {_value(value, f.metadata.get('unit', ''))}" for f, value in found if value is not None)


def _value(value: Any, unit: str) -> str:
    if isinstance(value, float):
        return f"{value:.6g}{'' if unit in ('', '1') else f' {unit}'}"
    return str(value).lower() if isinstance(value, bool) else str(value)


def _changes(scene: Scene, effect: Any) -> Iterator[str]:
    """What an effect adds to the moment of inertia and to the weight."""
    inertia, weight = effect.inertia(scene), effect.weight_moment(scene)
    if inertia:
        yield f"{inertia:+.4g} kg m^2 to the inertia, {100.0 * inertia / scene.inertia:.3g} % of it"
    if weight:
        yield f"{weight * scene.gravity:+.4g} N m to the weight's torque at 90 degrees"
