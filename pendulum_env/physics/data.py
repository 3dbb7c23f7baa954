"""Scenes and their parts from plain data: what JSON holds, checked name by name."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any, TypeVar, cast

from pendulum_env.physics.effects import EFFECTS, Effect
from pendulum_env.physics.medium import Medium, medium_from
from pendulum_env.physics.units import SceneError, UnknownParameterError, nearest, several, shown

PROVENANCE = "provenance"
"""Key of a scene's file under which anything may say where it is from."""

Part = TypeVar("Part")


def parse(text: str, what: str) -> Any:
    """What JSON text holds; SceneError if it is none, or gives one name twice."""

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found = dict(pairs)
        if len(found) < len(pairs):
            names = [name for name, _ in pairs]
            twice = next(name for name in names if names.count(name) > 1)
            raise SceneError(f"{what} gives {shown(twice)} twice.")
        return found

    try:
        return json.loads(text, object_pairs_hook=once)
    except SceneError:
        raise
    except (ValueError, RecursionError) as error:
        raise SceneError(f"{what} is not JSON: {error}.") from None


def known(data: Any, kind: type, what: str) -> dict[str, Any]:
    """``data`` as keyword arguments of a dataclass; SceneError for names that it does not have."""
    if not isinstance(data, Mapping):
        raise SceneError(f"{what} must be given by a dict of its values, not {shown(data)}.")
    names = [f.name for f in fields(kind) if f.init]
    for name in data:
        if name not in names:
            raise SceneError(f"{what} has no value {shown(name)}{nearest(name, names)}")
    return dict(data)


def part_of(value: Any, kind: type[Part], what: str) -> Part:
    """A part of a scene from a dict of its values, or from a medium's name; itself if it is one."""
    if isinstance(value, kind):
        return value
    if kind is Medium and isinstance(value, (str, Mapping)):
        return cast(Part, medium_from({"name": value} if isinstance(value, str) else value))
    if not isinstance(value, Mapping):
        raise SceneError(f"{what} must be a {kind.__name__} or given by a dict of its values, not {shown(value)}.")
    return kind(**known(value, kind, what))


def effect_of(entry: Any) -> Effect:
    """An effect from a dict with its name under "effect"; itself if it is one."""
    if isinstance(entry, Effect):
        return entry
    if not isinstance(entry, Mapping) or "effect" not in entry:
        raise SceneError(f"An effect must be given by a dict with its name under 'effect', not {shown(entry)}.")
    name = entry["effect"]
    if not isinstance(name, str) or name not in EFFECTS:
        raise SceneError(f"There is no effect {shown(name)}{nearest(name, EFFECTS)}")
    rest = {key: value for key, value in entry.items() if key != "effect"}
    return EFFECTS[name](**known(rest, EFFECTS[name], f"The effect {name}"))


def effects_of(entries: Any) -> tuple[Effect, ...]:
    """The effects of a list that :func:`effect_of` reads."""
    return tuple(effect_of(entry) for entry in listed(entries))


def listed(effects: Any) -> tuple[Any, ...]:
    """Effects as a tuple; SceneError for what has no order, or no entries."""
    if isinstance(effects, (set, frozenset)):
        raise SceneError(f"A scene's effects must be a list of effects, not {shown(effects)}.")
    return several(effects, "A scene's effects", "effects")


def checked_effects(effects: Any) -> tuple[Effect, ...]:
    """The effects as a tuple; SceneError if they are none."""
    found = listed(effects)
    for effect in found:
        if not isinstance(effect, Effect):
            raise SceneError(f"A scene's effects must be Effect instances, not {shown(effect)}.")
    return found


# --- single numbers by name -----------------------------------------------------------------------------------------

Owners = Mapping[str, Any]
"""Parts of a scene by the names that they have in ``part.parameter``."""


def owners_of(parts: Mapping[str, Any], effects: Sequence[Effect]) -> dict[str, Any]:
    """All parts of a scene, effects among them."""
    return {**parts, **{effect.name: effect for effect in effects}}


def homes(owners: Owners) -> dict[str, list[str]]:
    """Each parameter's name -> the parts that have one; without parts' names, and without the run, which has starts."""
    found: dict[str, list[str]] = {}
    for owner, part in owners.items():
        for entry in fields(part):
            if owner != "run" and entry.name != "name":
                found.setdefault(entry.name, []).append(owner)
    return found


def numbers_by_name(owners: Owners) -> dict[str, Any]:
    """Every parameter's value, as ``part.parameter`` where two parts have one of that name."""
    return {
        name if len(places) == 1 else f"{place}.{name}": getattr(owners[place], name)
        for name, places in homes(owners).items()
        for place in places
    }


def assigned(changes: Mapping[str, Any], owners: Owners, scene: str) -> dict[str, dict[str, Any]]:
    """Changes by name, or as ``part.parameter``, sorted by the part that they belong to.

    Raises UnknownParameterError for a name that no part has, SceneError for one that two have or that is given twice.
    """
    found: dict[str, dict[str, Any]] = {}
    by_name = homes(owners)
    for given, value in changes.items():
        owner, dot, name = given.rpartition(".")
        if dot and owner in owners and name in {f.name for f in fields(owners[owner])}:
            places = [owner]
        elif not dot and name in by_name:
            places = by_name[name]
        else:
            every = [f"{place}.{f.name}" for place, part in owners.items() for f in fields(part)]
            raise UnknownParameterError(
                f"unexpected keyword argument {shown(given)}: the scene '{scene}' has no parameter {shown(given)}"
                f"{nearest(given, every if dot else ['gravity', *by_name])}", given
            )
        if len(places) > 1:
            ways = " or ".join(f"{place}.{name}" for place in places)
            raise SceneError(f"The scene '{scene}' has {name} in {' and '.join(places)}; say which, as {ways}.")
        if name in found.setdefault(places[0], {}):
            raise SceneError(f"{name} of {places[0]} is given twice.")
        found[places[0]][name] = value
    return found
