"""The ``damping=`` keyword: which dissipative effects replace the scene's own."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from pendulum_env.physics.effects import DAMPINGS, Effect
from pendulum_env.physics.presets import find_scene
from pendulum_env.physics.scene import Scene, checked_effects
from pendulum_env.physics.units import SceneError, nearest

KEPT, NONE = "scene", "none"
Damping = str | Mapping[str, Mapping[str, float]]


def build_scene(
    scene: str | Scene | Mapping[str, object], damping: Damping = "scene", parameters: Mapping[str, Any] | None = None
) -> Scene:
    """A scene with its damping replaced, and then parts or single parameters of the result.

    Only the result has to make sense: a number that the damping needs may come from the parameters.

    Args:
        scene: as :func:`pendulum_env.physics.presets.find_scene` takes it.
        damping: as :func:`with_damping` takes it.
        parameters: by name, as :meth:`pendulum_env.physics.scene.Scene.replace` takes them.

    Raises SceneError for unknown names, for a parameter of an effect that the damping removes, or that the damping
    gives too, and where the result makes no sense.
    """
    base, changes = find_scene(scene), dict(parameters or {})
    own = checked_effects(changes.pop("effects", base.effects))
    effects = _damped(own, damping)
    removed = {f.name: effect for effect in own if effect not in effects for f in fields(effect)}  # type: ignore[arg-type]
    kept = {f.name for effect in effects for f in fields(effect)}  # type: ignore[arg-type]
    given = {name for numbers in damping.values() for name in numbers} if isinstance(damping, Mapping) else set()
    for name in changes:
        if name in given:
            raise SceneError(f"{name} is given twice, by damping={damping!r} and by {name}={changes[name]!r}.")
        if name in removed and name not in kept:
            raise SceneError(f"{name} belongs to {removed[name].name}, which damping={damping!r} leaves out.")
    return base.replace(effects=effects, **changes)


def with_damping(scene: Scene, damping: Damping) -> Scene:
    """The scene with its dissipative effects replaced.

    Args:
        scene: any scene.
        damping: "scene" keeps its own, "none" removes them; else names joined by "+", as in "linear+quadratic", or
            a dict with numbers, as in ``{"linear": {"gamma": 0.1}}``. A name without numbers keeps the scene's
            numbers where it has that effect, and takes them from its geometry and medium elsewhere.

    Raises SceneError for unknown names or numbers, and where a number is needed and can't be derived.
    """
    return scene.with_effects(_damped(scene.effects, damping))


def _damped(effects: tuple[Effect, ...], damping: Damping) -> tuple[Effect, ...]:
    """The effects with the dissipative ones replaced."""
    if isinstance(damping, str):
        if damping == KEPT:
            return effects
        names = [] if damping == NONE else [name.strip() for name in damping.split("+")]
        if len(set(names)) < len(names):
            raise SceneError(f"damping={damping!r} names one damping twice.")
        wanted: Mapping[str, Mapping[str, float]] = {name: {} for name in names}
    elif isinstance(damping, Mapping):
        wanted = damping
    else:
        raise SceneError(f"damping must be a name or a dict of names with numbers, not {damping!r}.")
    own = {effect.damping: effect for effect in effects if effect.kind == "dissipative"}
    chosen = [_effect(name, numbers, own) for name, numbers in wanted.items()]
    return (*(effect for effect in effects if effect.kind != "dissipative"), *chosen)


def parse_damping(text: str) -> Damping:
    """``damping=`` as typed: a name, names joined by "+", numbers behind a colon, or JSON.

    ``"linear:gamma=0.1+quadratic"`` means ``{"linear": {"gamma": 0.1}, "quadratic": {}}``. Raises SceneError for a
    number that is none.
    """
    if text.lstrip().startswith("{"):
        try:
            found: Damping = json.loads(text)
        except ValueError as error:
            raise SceneError(f"The damping {text!r} is not JSON: {error}.") from None
        return found
    if ":" not in text:
        return text
    wanted: dict[str, dict[str, Any]] = {}
    for part in text.split("+"):
        name, _, rest = part.partition(":")
        numbers = wanted.setdefault(name.strip(), {})
        for pair in filter(None, rest.split(",")):
            key, equals, value = pair.partition("=")
            if not equals:
                raise SceneError(f"A damping's number is typed as name=value, as in linear:gamma=0.1, not {pair!r}.")
            numbers[key.strip()] = _typed(value.strip(), key.strip(), name.strip())
    return wanted


def _typed(text: str, key: str, damping: str) -> Any:
    """A damping's number as typed, or one of the words that it knows."""
    own = fields(DAMPINGS[damping]) if damping in DAMPINGS else ()  # type: ignore[arg-type]
    known = next((f.metadata["known"] for f in own if f.name == key and "known" in f.metadata), ())
    return next((value for value in known if str(value).lower() == text.lower()), text) if known else typed_number(
        text, key
    )


def typed_number(text: str, name: str) -> float:
    """A number as typed on the command line; SceneError if it is none."""
    try:
        return float(text)
    except ValueError:
        raise SceneError(f"{name} must be a number, not {text!r}.") from None


def _effect(name: str, numbers: Any, own: Mapping[str, Effect]) -> Effect:
    if name in (KEPT, NONE):
        raise SceneError(f"damping='{name}' stands alone, without numbers and with no other beside it.")
    if name not in DAMPINGS:
        raise SceneError(f"There is no damping '{name}'{nearest(name, [KEPT, NONE, *DAMPINGS])}")
    if not isinstance(numbers, Mapping):
        raise SceneError(f"The numbers of damping '{name}' must be a dict, as in {{'linear': {{'gamma': 0.1}}}}.")
    allowed = [f.name for f in fields(DAMPINGS[name])]  # type: ignore[arg-type]
    for key in numbers:
        if key not in allowed:
            raise SceneError(f"The damping '{name}' has no number '{key}'{nearest(key, allowed)}")
    return own[name] if not numbers and name in own else DAMPINGS[name](**numbers)
