"""Scenes that hypothesis draws."""

from __future__ import annotations

from dataclasses import Field, fields
from typing import Any

from hypothesis import strategies as st

from pendulum_env import Run, Scene, SceneError
from pendulum_env.physics.bodies import BODIES
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import EFFECTS
from pendulum_env.physics.medium import air


def values_of(entry: Field[Any]) -> st.SearchStrategy[Any]:
    """What a field may hold: numbers from its range, to 10; words; None where that means derived."""
    if "allowed" in entry.metadata:
        return st.sampled_from([{"true": True, "false": False}.get(word, word) for word in entry.metadata["allowed"]])
    limits = entry.metadata["check"].keywords
    least = -10.0 if limits["above"] is limits["least"] is None else 0.0 if limits["above"] is None else 1e-3
    numbers = st.floats(least, 10.0, allow_subnormal=False)
    return st.none() | numbers if entry.metadata["optional"] else numbers


def some(kind: type) -> st.SearchStrategy[Any]:
    """A part of a scene with any values, in any number of its fields; None if they contradict each other."""
    checked = {f.name: values_of(f) for f in fields(kind) if "check" in f.metadata}

    def made(values: dict[str, Any]) -> Any:
        try:
            return kind(**values)
        except SceneError:
            return None

    return st.fixed_dictionaries({}, optional=checked).map(made)


@st.composite
def scenes(draw: Any) -> Scene:
    """A scene of any body, and of those effects that do not contradict what was there before."""
    name, run = draw(st.text("abc def", min_size=1, max_size=9)), draw(some(Run)) or Run()
    try:
        scene = Scene(name, draw(st.sampled_from([*BODIES.values()]).flatmap(some)) or Body(), air(), run=run)
    except SceneError:
        scene = Scene(name, Body(), air(), run=run)
    for kind in draw(st.permutations(list(EFFECTS.values())))[: draw(st.integers(0, 6))]:
        try:
            scene = scene.with_effects((*scene.effects, draw(some(kind)) or kind()))
        except SceneError:
            continue
    return scene
