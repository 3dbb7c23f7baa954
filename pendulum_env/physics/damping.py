"""The ``damping=`` keyword, which replaces the dissipative effects of a scene, and parameters typed as text."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import fields
from os import PathLike
from typing import Any

from pendulum_env.physics.data import effects_of, parse
from pendulum_env.physics.effects import DAMPINGS, Effect
from pendulum_env.physics.presets import find_scene
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, nearest, several, shown

KEPT, NONE = "scene", "none"
Damping = str | Mapping[str, Mapping[str, Any]]


def build_scene(
    scene: str | Scene | Mapping[str, object] | PathLike[str],
    damping: Damping = "scene",
    parameters: Mapping[str, Any] | None = None,
) -> Scene:
    """Return a scene with its damping replaced first, and then parts or single parameters changed.

    Only the resulting scene is checked, so parameters may supply a number that the damping needs.

    Args:
        scene: any value that :func:`pendulum_env.physics.presets.find_scene` takes.
        damping: any value that :func:`with_damping` takes.
        parameters: new values by name, as :meth:`pendulum_env.physics.scene.Scene.replace` takes them.

    Raises SceneError for unknown names, for a parameter of an effect that the damping removes or that the damping sets
    too, and for an invalid resulting scene.
    """
    if parameters is not None and not isinstance(parameters, Mapping):
        raise SceneError(f"parameters must be a dict of values by name, not {shown(parameters)}.")
    base, changes = find_scene(scene), dict(parameters or {})
    if isinstance(damping, str) and damping == KEPT:
        return base.replace(**changes)
    own = effects_of(changes.pop("effects", base.effects))
    effects = _damped(own, damping)
    remaining = _names(effects)
    removed = {name: effect.name for effect in own if effect not in effects for name in _names((effect,))}
    given = set()
    if isinstance(damping, Mapping):
        given = {name for which, numbers in damping.items() for name in (*numbers, *_full(DAMPINGS[which], numbers))}
    for name in changes:
        if name in given:
            twice = f"by damping={shown(damping)} and by {name}={shown(changes[name])}"
            raise SceneError(f"{name} is given twice, {twice}.")
        if name in removed and name not in remaining:
            raise SceneError(f"{name} belongs to {removed[name]}, which damping={shown(damping)} leaves out; "
                             "leave out the parameter too, or add that damping.")
    return base.replace(effects=effects, **changes)


def _names(effects: Iterable[Effect]) -> set[str]:
    """Return all names by which the parameters of the given effects can be set, ``name`` and ``effect.name``."""
    names = ([f.name for f in fields(effect)] for effect in effects)  # type: ignore[arg-type]
    return {name for effect, own in zip(effects, names, strict=True) for name in (*own, *_full(effect, own))}


def _full(effect: Effect | type[Effect], names: Iterable[str]) -> list[str]:
    """Return the names of an effect's parameters with the effect's name in front, as in "linear_drag.gamma"."""
    return [f"{effect.name}.{name}" for name in names]


def with_damping(scene: Scene, damping: Damping) -> Scene:
    """Return the scene with its dissipative effects replaced.

    Args:
        scene: any scene.
        damping: "scene" keeps the scene's own, "none" removes them. Otherwise names joined by "+", as in
            "linear+quadratic", or a dict with numbers, as in ``{"linear": {"gamma": 0.1}}``. A name without numbers
            keeps the scene's effect if the scene has it, and otherwise derives the numbers from geometry and medium.

    Raises SceneError for unknown names or numbers, and for a number that is missing and cannot be derived.
    """
    if not isinstance(scene, Scene):
        raise SceneError(f"scene must be a Scene, not {shown(scene)}.")
    return scene.with_effects(_damped(scene.effects, damping))


def _damped(effects: tuple[Effect, ...], damping: Damping) -> tuple[Effect, ...]:
    """Return a scene's effects with the dissipative ones replaced by those that ``damping`` names.

    ``damping`` is a value of the keyword ``damping=``, as :func:`with_damping` explains.
    """
    if isinstance(damping, str):
        if damping == KEPT:
            return effects
        names = [] if damping == NONE else [name.strip() for name in damping.split("+")]
        if len(set(names)) < len(names):
            raise SceneError(f"damping={shown(damping)} names one damping twice.")
        wanted: Mapping[str, Mapping[str, Any]] = {name: {} for name in names}
    elif isinstance(damping, Mapping):
        wanted = damping
    else:
        raise SceneError(f"damping must be a name or a dict of names with numbers, not {shown(damping)}.")
    own = {effect.damping: effect for effect in effects if effect.kind == "dissipative"}
    chosen = [_effect(name, numbers, own) for name, numbers in wanted.items()]
    return (*(effect for effect in effects if effect.kind != "dissipative"), *chosen)


def parse_damping(text: str) -> Damping:
    """Parse the text of a ``damping=`` option: a name, names joined by "+", values behind a colon, or JSON.

    ``"linear:gamma=0.1+sphere_drag:law=morrison"`` means ``{"linear": {"gamma": 0.1}, "sphere_drag": {"law":
    "morrison"}}``. Raises SceneError for text of another form.
    """
    if not isinstance(text, str):
        raise SceneError(f"A damping must be given as text, such as 'linear+quadratic', not {shown(text)}.")
    if text.lstrip().startswith("{"):
        damping: Damping = parse(text, f"The damping {shown(text)}")
        return damping
    if ":" not in text:
        return text
    wanted: dict[str, dict[str, Any]] = {}
    for part in re.split(r"\+(?=\s*[A-Za-z])", text):
        name, _, rest = part.partition(":")
        if name.strip() in wanted:
            raise SceneError(f"damping={shown(text)} names one damping twice.")
        wanted[name.strip()] = _values(
            filter(None, rest.split(",")), "A damping's value must be name=value, as in linear:gamma=0.1",
            f"damping={shown(text)}",
        )
    return wanted


def parse_settings(settings: Iterable[str]) -> dict[str, Any]:
    """Parse parameters of a scene typed as ``name=value``, such as ``length=0.5``, into keyword arguments.

    Raises SceneError for text of another form and for a name given twice.
    """
    return typed_values(several(settings, "settings", "texts"), "--set", "length=0.5")


def typed_values(pairs: Iterable[str], option: str, example: str) -> dict[str, Any]:
    """Parse the texts ``name=value`` given to a command-line option into a dict of values by name.

    ``option`` is the option's name, such as "--read", and ``example`` a valid text; both are for error messages. Raises
    SceneError for text of another form and for a name given twice.
    """
    return _values(pairs, f"{option} needs name=value, as in {option} {example}", option)


def _values(pairs: Iterable[str], form: str, giver: str) -> dict[str, Any]:
    """Parse texts of the form ``name=value`` into a dict of values by name.

    Raises SceneError for text of another form, with a message that begins with ``form``, and for a name given twice,
    with a message that begins with ``giver``.
    """
    values: dict[str, Any] = {}
    for pair in pairs:
        if not isinstance(pair, str):
            raise SceneError(f"{form}, not {shown(pair)}.")
        name, equals, value = pair.partition("=")
        if not equals:
            raise SceneError(f"{form}, not {shown(pair)}.")
        if name.strip() in values:
            raise SceneError(f"{giver} gives {name.strip()} twice.")
        values[name.strip()] = typed(value)
    return values


def typed(text: str) -> float | bool | str | None:
    """Convert text from the command line to a number, to True, False or None (typed as in JSON), or leave it as text.
    """
    words = {"true": True, "false": False, "null": None}
    try:
        return float(text)
    except ValueError:
        return words.get(text.strip(), text.strip())


def _effect(name: str, numbers: Any, own: Mapping[str, Effect]) -> Effect:
    """Return the dissipative effect for one entry of ``damping=``: the damping's name and a dict of its numbers.

    Without numbers, the effect is taken from ``own``, the scene's dissipative effects by damping name, if it is there.
    Raises SceneError for an unknown name or number.
    """
    if name in (KEPT, NONE):
        raise SceneError(f"damping='{name}' cannot be combined with numbers or with other dampings.")
    if name not in DAMPINGS:
        raise SceneError(f"There is no damping {shown(name)}{nearest(name, [KEPT, NONE, *DAMPINGS])}")
    if not isinstance(numbers, Mapping):
        raise SceneError(f"The numbers of damping '{name}' must be a dict, as in {{'linear': {{'gamma': 0.1}}}}.")
    allowed = [f.name for f in fields(DAMPINGS[name])]  # type: ignore[arg-type]
    for key in numbers:
        if key not in allowed:
            raise SceneError(f"The damping '{name}' has no number {shown(key)}{nearest(key, allowed)}")
    return own[name] if not numbers and name in own else DAMPINGS[name](**numbers)
