"""What single and vector environments share: attributes that cannot be assigned, a spec for JSON, saved objects."""

from __future__ import annotations

import dataclasses
import enum
import os
from collections.abc import Iterable, Mapping
from copy import copy
from inspect import signature
from typing import Any

import numpy as np
from gymnasium.envs.registration import EnvSpec

from integrators import METHODS, Method
from pendulum_env.common.checks import MEANT
from pendulum_env.common.shown import Displayed
from pendulum_env.envs.limits import Registered
from pendulum_env.envs.randomize import plain_form
from pendulum_env.physics.bodies import BODIES, body_data
from pendulum_env.physics.body import RigidBody
from pendulum_env.physics.effects import EFFECTS, Effect
from pendulum_env.physics.medium import Medium
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.sensor import Sensor
from pendulum_env.physics.units import SceneError, nearest, shown

FORMAT = 8
"""Number of the form in which environments are pickled.

It is raised by one whenever their attributes change, or what their programs return: pickles hold the programs' texts.
"""


STATE = ("angle", "velocity", "theta", "state")
"""Names that people assign to change the present state; not attributes of environments."""


class Fixed:
    """Attribute of an environment, read from ``_name`` or from the scene's parameters, that refuses to be assigned.

    The value is built into the environment's program, so that another value would change nothing. Parameters of the
    scene are read in single environments; the environments of a vector may differ, and its ``get_attr`` has them all.
    """

    def __set_name__(self, owner: type, name: str) -> None:
        self.name, self.maker = name, getattr(owner, "MAKER", "gym.make")

    def __get__(self, environment: Any, kind: type | None = None) -> Any:
        if environment is None:
            return self
        kept = vars(environment)
        if f"_{self.name}" in kept:
            return kept[f"_{self.name}"]
        if self.maker == "gym.make" and "_scene" in kept:
            return parameter(kept["_scene"], self.name)
        raise AttributeError(f"{type(environment).__name__} has no attribute {self.name!r}.")

    def __set__(self, environment: Any, value: Any) -> None:
        if self.name == "omega0":
            raise AttributeError("omega0 cannot be assigned, as it follows from the scene; make a new environment with "
                                 f'another length or gravity, as {self.maker}("LabPendulum-v0", length=1.0).')
        raise AttributeError(f"{self.name} cannot be assigned, as it is built into the environment's program; make a "
                             f'new environment with {self.maker}("LabPendulum-v0", {self.name}={shown(value)}).')


class Absent:
    """Name of STATE or MEANT, which environments do not have, and which cannot be assigned: it would do nothing."""

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, environment: Any, kind: type | None = None) -> Any:
        if environment is None:
            return self
        raise AttributeError(f"{type(environment).__name__} has no attribute {self.name!r}.")

    def __set__(self, environment: Any, value: Any) -> None:
        hint = ("reset(options={'angle': 0.1, 'velocity': 0.0}) starts from another state [rad, rad/s]."
                if self.name in STATE else MEANT[self.name])
        raise AttributeError(f"{self.name} cannot be assigned, as environments have no such attribute: {hint}")


def fix(environment: type, more: Iterable[str]) -> None:
    """Make all keywords of an environment's class, all parameters of scenes and ``more`` attributes :class:`Fixed`.

    Names that are no attributes, of STATE and MEANT, become :class:`Absent`.
    """
    own = set(signature(environment).parameters) - {"parameters", "autoreset_mode"}
    sizes = {entry.name for part in (*BODIES.values(), Medium, *EFFECTS.values())
             for entry in dataclasses.fields(part)}
    fixed = (own | sizes | {"gravity", "body", "medium", "effects", "run", *more}) - {"name"}
    for name in fixed | {*STATE, *MEANT}:
        attribute: Fixed | Absent = Fixed() if name in fixed else Absent()
        attribute.__set_name__(environment, name)
        setattr(environment, name, attribute)


def parameter(scene: Scene, name: str) -> Any:
    """Return a parameter or part of a scene by its name; AttributeError if the scene has none of this name."""
    values: Mapping[str, Any] = scene.parameters()
    if name in values:
        return values[name]
    if name in ("body", "medium", "effects", "run"):
        return getattr(scene, name)
    raise AttributeError(f"The scene '{scene.name}' has no parameter {shown(name)}{nearest(name, values)}")


class PortableSpec(EnvSpec):
    """Gymnasium's specification of an environment, whose ``to_json`` refuses what JSON cannot hold.

    Scenes, effects, media, registered methods, arrays and paths are kept as the dicts, names, lists and texts that make
    the same environment.

    Attributes:
        own_steps: number of control steps in the environment's duration, None without one.
    """

    own_steps = None  # no annotation, so that it is not a field of Gymnasium's class

    def __eq__(self, other: object) -> bool:
        """Return True for a specification with equal values, also of Gymnasium's class, as ``from_json`` returns it."""
        return isinstance(other, EnvSpec) and all(
            getattr(self, entry.name) == getattr(other, entry.name) for entry in dataclasses.fields(EnvSpec))

    __hash__ = None  # type: ignore[assignment]  # as Gymnasium's, because the keywords may change

    def to_json(self) -> str:
        """Return the specification as JSON; SceneError names an argument that JSON cannot hold.

        JSON does not tell a registered number of steps from an argument, which would count whatever the duration is, so
        that the number in the duration stands in its place.
        """
        for name, value in self.kwargs.items():
            if not _is_plain(value):
                raise SceneError(f"{name}={shown(value)} cannot be written as JSON; give it by the name of a method of "
                                 "the package, or a scene of the package's own effects.")
        numbers = copy(self)
        if self.own_steps is not None:
            if isinstance(self.max_episode_steps, Registered):
                numbers.max_episode_steps = self.own_steps
            if isinstance(self.kwargs.get("max_episode_steps"), Registered):
                numbers.kwargs = {**self.kwargs, "max_episode_steps": self.own_steps}
        return super(PortableSpec, numbers).to_json()


def _plain(value: Any) -> Any:
    """Return a value in the form that JSON can hold and that makes the same environment, unchanged if there is none."""
    if isinstance(value, Scene) and all(EFFECTS.get(effect.name) is type(effect) for effect in value.effects):
        return value.to_dict()
    if isinstance(value, Effect) and EFFECTS.get(value.name) is type(value):
        return {"effect": value.name, **dataclasses.asdict(value)}  # type: ignore[call-overload]
    if isinstance(value, Method) and METHODS.get(value.name) is value:
        return value.name
    if isinstance(value, RigidBody):
        return body_data(value)
    if isinstance(value, Sensor):
        return {entry.name: getattr(value, entry.name) for entry in dataclasses.fields(Sensor)}
    if isinstance(value, Medium):
        return dataclasses.asdict(value)
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, enum.Enum):
        return value.value
    if isinstance(value, Mapping):
        return {name: _plain(entry) for name, entry in value.items()}
    return [_plain(entry) for entry in value] if isinstance(value, (list, tuple)) else value


def _is_plain(value: Any) -> bool:
    """Return True if JSON holds a value without changing its meaning."""
    if isinstance(value, dict):
        return all(isinstance(name, str) and _is_plain(entry) for name, entry in value.items())
    return all(map(_is_plain, value)) if isinstance(value, (list, tuple)) else (
        value is None or isinstance(value, (str, int, float, bool)))


class Portable(Displayed):
    """Part of an environment's class that keeps its specification and its pickled form, and shows it in notebooks."""

    @property
    def spec(self) -> EnvSpec | None:
        """Specification with which Gymnasium made the environment; its ``to_json`` makes an equal one elsewhere."""
        kept: EnvSpec | None = vars(self).get("_made_by")
        return kept

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        if spec is not None:
            spec = PortableSpec(**{entry.name: getattr(spec, entry.name) for entry in dataclasses.fields(spec)
                                   if entry.init})
            spec.kwargs = {name: _plain(plain_form(value) if name == "randomize" else value)
                           for name, value in spec.kwargs.items()}
            spec.own_steps = vars(self).get("_own_steps")
        vars(self)["_made_by"] = spec

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes for a copy or a pickle, with the number of their form."""
        return {**vars(self), "format": FORMAT}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        """Set the attributes of a copied or unpickled environment; SceneError if another version has pickled it."""
        if state.get("format") != FORMAT:
            raise SceneError(f"This {type(self).__name__} was pickled by another version of the package, in the format "
                             f"{shown(state.get('format'))} and not {FORMAT}; make the environment anew.")
        vars(self).update((name, value) for name, value in state.items() if name != "format")
