"""Scenes and their parts read from plain data, such as JSON, with every name checked."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields
from typing import Any, TypeVar, cast

from pendulum_env.physics.bodies import body_from
from pendulum_env.physics.body import RigidBody
from pendulum_env.physics.effects import EFFECTS, Effect
from pendulum_env.physics.medium import Medium, medium_from
from pendulum_env.physics.units import SceneError, UnknownParameterError, nearest, several, shown

PROVENANCE = "provenance"
"""Key of a scene's file for free notes on where its numbers come from."""

Part = TypeVar("Part")


def parse(text: str, label: str) -> Any:
    """Return the data in the JSON text of a scene or a damping.

    Raises SceneError for text that is not JSON and for a name that occurs twice in an object; the message begins with
    ``label``, a few words that say which text this is.
    """

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        values = dict(pairs)
        if len(values) < len(pairs):
            names = [name for name, _ in pairs]
            twice = next(name for name in names if names.count(name) > 1)
            raise SceneError(f"{label} gives {shown(twice)} twice.")
        return values

    try:
        return json.loads(text, object_pairs_hook=once)
    except SceneError:
        raise
    except (ValueError, RecursionError) as error:
        raise SceneError(f"{label} is not JSON: {error}.") from None


def known(data: Any, kind: type, label: str) -> dict[str, Any]:
    """Return a dict of values as keyword arguments of the dataclass ``kind``, after a check of their names.

    Raises SceneError for data that is not a dict and for a name that the dataclass does not have; the message begins
    with ``label``, a few words that say which part of a scene this is.
    """
    if not isinstance(data, Mapping):
        raise SceneError(f"{label} must be given by a dict of its values, not {shown(data)}.")
    names = [f.name for f in fields(kind) if f.init]
    for name in data:
        if name not in names:
            raise SceneError(f"{label} has no value {shown(name)}{nearest(name, names)}")
    return dict(data)


def kind_name(kind: type) -> str:
    """Return the name of a part's class for an error message, that of the usual body for all bodies."""
    return "Body" if kind is RigidBody else kind.__name__


def part_of(value: Any, kind: type[Part], label: str) -> Part:
    """Return the body, the medium or the usual run of a scene, given as an instance, as a dict of its values or, for a
    medium only, by name.
    """
    if isinstance(value, kind):
        return value
    if kind is RigidBody and isinstance(value, Mapping):
        return cast(Part, body_from(value, label))
    if kind is Medium and isinstance(value, (str, Mapping)):
        return cast(Part, medium_from({"name": value} if isinstance(value, str) else value))
    if not isinstance(value, Mapping):
        raise SceneError(f"{label} must be a {kind_name(kind)} or given by a dict of its values, not {shown(value)}.")
    return kind(**known(value, kind, label))


def effect_of(entry: Any) -> Effect:
    """Return an effect from an instance, or from a dict with the effect's name under "effect"."""
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
    """Return a scene's effects as a tuple from a list of instances or dicts."""
    return tuple(effect_of(entry) for entry in listed(entries))


def listed(effects: Any) -> tuple[Any, ...]:
    """Return a scene's list of effects as a tuple, without a check of its entries; SceneError for a set, which has no
    order, and for a value that is not a list.
    """
    if isinstance(effects, (set, frozenset)):
        raise SceneError(f"A scene's effects must be a list of effects, not {shown(effects)}.")
    return several(effects, "A scene's effects", "effects")


# --- single numbers by name -----------------------------------------------------------------------------------------

Owners = Mapping[str, Any]
"""The parts and effects of a scene by the names used in ``part.parameter``."""


def homes(owners: Owners) -> dict[str, list[str]]:
    """Map the name of every parameter of a scene to the names of the parts and effects that have it.

    Left out are the fields ``name`` and the usual run, because its start, step and duration are only defaults.
    """
    places: dict[str, list[str]] = {}
    for owner, part in owners.items():
        for entry in fields(part):
            if owner != "run" and entry.name != "name":
                places.setdefault(entry.name, []).append(owner)
    return places


def numbers_by_name(owners: Owners) -> dict[str, Any]:
    """Return the value of every parameter of a scene by its name, or by ``part.parameter`` for a name that two parts
    share.
    """
    return {
        name if len(places) == 1 else f"{place}.{name}": getattr(owners[place], name)
        for name, places in homes(owners).items()
        for place in places
    }


def assigned(changes: Mapping[str, Any], owners: Owners, scene: str) -> dict[str, dict[str, Any]]:
    """Sort changes, given as ``parameter`` or ``part.parameter``, by the part or effect that they belong to.

    Raises UnknownParameterError for a name that no part has, SceneError for a name that two parts have or that is given
    twice.
    """
    changes_by_part: dict[str, dict[str, Any]] = {}
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
            raise SceneError(f"{' and '.join(places)} of the scene '{scene}' both have {name}; give it as {ways}.")
        if name in changes_by_part.setdefault(places[0], {}):
            raise SceneError(f"{name} of {places[0]} is given twice.")
        changes_by_part[places[0]][name] = value
    return changes_by_part
