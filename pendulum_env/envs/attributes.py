"""What single and vector environments share: what follows from settings, fixed attributes, specs, saved objects."""

from __future__ import annotations

import dataclasses
import enum
import json
import os
from collections.abc import Callable, Iterable, Mapping
from copy import copy
from inspect import signature
from typing import Any

import numpy as np
from gymnasium.envs.registration import EnvSpec
from numpy.typing import NDArray

from integrators import METHODS, Method
from pendulum_env.common.checks import MEANT
from pendulum_env.common.results import Displayed
from pendulum_env.engine.elementwise import elementwise
from pendulum_env.engine.sensing import Plan
from pendulum_env.engine.spec import RunSpec
from pendulum_env.envs.limits import Registered, episode_steps
from pendulum_env.envs.randomize import randomization
from pendulum_env.envs.sensing import plan_of
from pendulum_env.envs.settings import FORMS, UNBOUNDED, EnvSettings, acting, settled, task_of, usual
from pendulum_env.films.look import checked_look
from pendulum_env.physics.bodies import BODIES, body_data
from pendulum_env.physics.body import RigidBody
from pendulum_env.physics.effects import EFFECTS, Effect
from pendulum_env.physics.medium import Medium
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.sensor import Sensor
from pendulum_env.physics.units import SceneError, naming_keywords, nearest, shown
from pendulum_env.tasks.task import Task, steps_of

FORMAT = 9
"""Number of the form in which environments are pickled.

It is raised by one whenever their attributes change, or what their programs return: pickles hold the programs' texts.
"""


ABSENT = {**MEANT, **dict.fromkeys(
    ("angle", "velocity", "theta", "state"),
    "reset(options={'angle': 0.1, 'velocity': 0.0}) starts from another state [rad, rad/s].")}
"""Names that people assign to change an environment, and what they should do; not attributes of environments."""


class Fixed:
    """Attribute of an environment, read from ``_name`` or from the scene's parameters, that refuses to be assigned.

    The value is built into the environment's program, so that another value would change nothing. Parameters of the
    scene are read in single environments; the environments of a vector may differ, and its ``get_attr`` has them all.
    The names of ABSENT are no attributes, and are refused because assigning them would do nothing.
    """

    def __set_name__(self, owner: type, name: str) -> None:
        self.name, self.maker = name, getattr(owner, "MAKER", "gym.make")

    def __get__(self, environment: Any, kind: type | None = None) -> Any:
        if environment is None:
            return self
        kept = {} if self.name in ABSENT else vars(environment)
        if f"_{self.name}" in kept:
            return kept[f"_{self.name}"]
        if self.name != "speed_limit" and self.name in vars(kept.get("_settings", self)):  # a vector has one for each
            return getattr(kept["_settings"], self.name)
        if self.maker == "gym.make" and "_scene" in kept:
            return parameter(kept["_scene"], self.name)
        raise AttributeError(f"{type(environment).__name__} has no attribute {self.name!r}.")

    def __set__(self, environment: Any, value: Any) -> None:
        if self.name in ABSENT:
            raise AttributeError(f"{self.name} cannot be assigned, as environments have no such attribute: "
                                 f"{ABSENT[self.name]}")
        if self.name == "omega0":
            raise AttributeError("omega0 cannot be assigned, as it follows from the scene; make a new environment with "
                                 f'another length or gravity, as {self.maker}("LabPendulum-v0", length=1.0).')
        raise AttributeError(f"{self.name} cannot be assigned, as it is built into the environment's program; make a "
                             f'new environment with {self.maker}("LabPendulum-v0", {self.name}={shown(value)}).')


def fix(environment: type, more: Iterable[str]) -> None:
    """Make all keywords of an environment's class, all parameters of scenes and ``more`` attributes :class:`Fixed`."""
    own = set(signature(environment).parameters) - {"parameters", "autoreset_mode"}
    sizes = {entry.name for part in (*BODIES.values(), Medium, *EFFECTS.values())
             for entry in dataclasses.fields(part)}
    fixed = (own | sizes | {"gravity", "body", "medium", "effects", "run", *more}) - {"name"}
    for name in fixed | {*ABSENT}:
        attribute = Fixed()
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
            try:
                json.dumps(value)
            except TypeError:
                raise SceneError(f"{name}={shown(value)} cannot be written as JSON; give it by the name of a method of "
                                 "the package, or a scene of the package's own effects.") from None
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
    if isinstance(value, (Sensor, Medium)):
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


class Portable(Displayed):
    """Part of an environment's class: what follows from its settings, its specification and its pickled form.

    Notebooks show it as HTML.
    """

    scene: Scene
    integrator: str
    dt: float
    substeps: int
    task: Task
    render_size: tuple[int, int]
    _settings: EnvSettings
    _spec: RunSpec

    def _set_up(self, given: EnvSettings, size: int | None = None, limit: int | None = None) -> Plan | None:
        """Set all attributes that follow from the settings alone; return the plan of readings and delays.

        ``size`` is the number of environments in a vector, ``limit`` its number of control steps in an episode.
        Raises SceneError, MethodError or EngineError for invalid
        settings.
        """
        self._settings = given
        integrator, dt = usual(given)
        task, draws = task_of(given), randomization(given.randomize)
        look = checked_look(given.render_theme, given.render_panels, given.diagnostics)
        own = task.steps(dt) if given.duration is None else steps_of(given.duration, dt)
        steps = episode_steps(own, limit)
        with naming_keywords(type(self)):
            spec = RunSpec.of_episodes(given, dt=dt, size=size, others=draws.scenes if draws else None,
                                       choose=lambda scenes: settled(given, scenes, integrator, dt, steps))
        plan = plan_of(given, spec.h, spec.hold)
        self._spec, self._look, self._own_steps, self._episode_steps = spec, look, own, steps
        self._scene, self._integrator, self._task = spec.scene, spec.integrator, task
        self._dt, self._substeps, self._h = dt, spec.hold, spec.h
        self._randomization, self._checks = draws, task.own
        self._rate, self._penalty = dt if given.reward_rate else 1.0, given.speed_penalty
        self._velocity_bound = given.velocity_bound
        self._bounded = given.velocity_bound < UNBOUNDED and (plan is None or plan.swift)
        self._acts = acting(given)
        self._delays: dict[str, Any] = {}
        self._turning = spec.turning_speed()
        return plan

    def _acted(self, shares: NDArray[np.float64], uniform: Callable[[], NDArray[np.float64]]) -> NDArray[np.float64]:
        """Return the actions that settings such as ``action_noise`` make of others; all are clipped to [-1, 1].

        ``uniform`` draws a random number in [0, 1) for each.
        """
        for function, value in self._acts:
            change = elementwise(function, self._spec.backend)
            shares = change(shares, np.full(len(shares), value), uniform(), uniform()).clip(-1.0, 1.0)
        return shares

    def _tell(self) -> None:
        """Emit the warnings before the first episode."""
        self._spec.tell()
        self._spec.tell_of_task(self._settings.task)

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
            spec.kwargs = {name: _plain(FORMS[name](value) if name in FORMS else value)
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
