"""The class :class:`Each`: scenes of several environments with different parameter values, and the program's numbers.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.many import Many, in_groups, plain
from pendulum_env.engine.limits import Validity
from pendulum_env.engine.machine import numbers_of
from pendulum_env.engine.problem import program_parts
from pendulum_env.engine.starts import WHOLE, checked_limit, frequency
from pendulum_env.physics.damping import Damping, build_scene
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, UnknownParameterError

Array = NDArray[np.float64]
Places = NDArray[np.intp]
Numbers = dict[str, float]

FEW = 16
"""Size of a group of environments below which scenes are built one by one instead of together."""
CHUNK = 8192
"""Largest size of a group of environments whose episodes begin together; its arrays stay in the processor's cache."""


class Each:
    """The scenes of ``size`` environments with their own parameters.

    Args:
        scene, damping: as for one environment.
        speed_limit: as for one environment, or a sequence of ``size``.
        parameters: scene parameters by name: one value for all environments, or a sequence of ``size`` values.
        size: number of environments.
        what: the word for one environment in messages, such as "run".
        validity: check of the formulas, which is called for every scene; None for no check.
        watched: True if ``numbers`` must serve the diagnostics "tension" and "flow".

    Attributes:
        scene: scene of the first environment.
        numbers: parameters of the generated program by name: a float if all environments agree, else an array of
            ``size`` floats.
        episode: values of parameters that :meth:`take` set for the present episodes.

    Raises SceneError for invalid parameters, with the index of the environment if they differ.
    """

    def __init__(
        self,
        scene: str | Scene | Mapping[str, object],
        damping: Damping,
        speed_limit: Any,
        parameters: Mapping[str, Any],
        size: int,
        what: str = "environment",
        validity: Validity | None = None,
        watched: bool = True,
    ) -> None:
        own = {name: values for name, value in parameters.items() if (values := _sequence(value, name, size, what))}
        limits = _sequence(speed_limit, "speed_limit", size, what)
        self._own, self._watched, self._size, self._what = own, watched, size, what
        self._limits = limits
        self._shared_limit: tuple[Any, ...] = () if limits else (speed_limit,)
        self.episode: dict[str, Array] = {}
        first = {name: values[0] for name, values in own.items()}
        mixed = {name.rpartition(".")[2] for name, values in own.items() if any(values) and not all(values)}
        try:
            self.scene = build_scene(scene, damping, {**parameters, **first})
            if mixed:
                self.scene = self.scene.with_effects(effect.general(mixed) for effect in self.scene.effects)
        except SceneError as error:
            if not own:
                raise
            given = {"given": error.given} if isinstance(error, UnknownParameterError) else {}
            raise type(error)(f"In {what} 0 of {size}: {error}", **given) from None
        self._parts = program_parts(self.scene)
        if validity and not own:
            validity.look(self.scene, range(size))
        if not own and not limits:
            self.numbers: dict[str, float | Array] = {**self._numbers(self.scene, speed_limit)}
            return
        columns = self._columns(np.arange(size), {}, validity if own else None)
        self.numbers = {name: float(column[0]) if np.all(column == column[0]) else column
                        for name, column in columns.items()}

    @property
    def given(self) -> dict[str, Array]:
        """Parameters that were given as one number for each: name -> array ``(size,)``."""
        return {name: _floats(column) for name, column in self._own.items()}

    def _columns(
        self, which: Places, values: Mapping[str, Array], validity: Validity | None = None
    ) -> dict[str, Array]:
        """Return the program's numbers of the environments ``which`` by name, one number for each of them.

        ``values`` are other values of some parameters, arrays with one number for each of these environments. Scenes
        are built for whole groups of environments, with parameters of the class Many, numbers with one value for each.
        Small groups, and environments in which an effect's formula may not hold, are computed one by one; so are all
        if a value is invalid or if some code cannot handle Many.

        Raises SceneError with the index of the first environment whose values are invalid or need another program.
        """
        columns: dict[str, Array] = {}
        alone = {0} if validity else set[int]()

        def fill(first: int, group: Places) -> None:
            """Store the numbers of a group of environments, given by their places in ``which`` from ``first`` on."""
            group = group + first
            if len(group) < FEW:
                alone.update(group.tolist())
                return
            scene = self.scene.replace(**{name: Many(column[group]) for name, column in own.items()})
            if program_parts(scene) != self._parts:
                raise SceneError("These need another program.")
            for name, value in self._numbers(scene, Many(ends[group]) if self._limits else self._limit(0)).items():
                columns.setdefault(name, np.empty(len(which)))[group] = plain(value)
            if validity and not validity.clear(scene, which[group]):
                alone.update(group.tolist())

        try:
            own = {**{name: _floats(column)[which] for name, column in self._own.items() if name not in values},
                   **values}
            ends = _floats(self._limits)[which] if self._limits else np.empty(0)
            for first in range(0, len(which), CHUNK):
                in_groups(min(CHUNK, len(which) - first), partial(fill, first))
        except Exception:
            alone = {*range(len(which))}
        built: dict[tuple[Any, ...], tuple[Scene, Numbers]] = {}
        for i in sorted(alone):
            index = int(which[i])
            given = {name: float(column[i]) for name, column in values.items()}
            key = (self._limit(index), *(column[index] for column in self._own.values()), *given.values())
            if key not in built:
                try:
                    built[key] = self._same_program(index, given)
                except SceneError as error:
                    raise SceneError(f"In {self._what} {index} of {self._size}: {error}") from None
            scene, numbers = built[key]
            if validity:
                validity.look(scene, (index,))
            for name, value in numbers.items():
                columns.setdefault(name, np.empty(len(which)))[i] = value
        return columns

    def _same_program(self, index: int, given: Mapping[str, float]) -> tuple[Scene, Numbers]:
        """Return scene and program parameters of an environment with other values ``given`` of some parameters.

        Raises SceneError if its scene needs another generated program than that of environment 0, since all share one.
        """
        scene = self._scene_with(index, given)
        if program_parts(scene) != self._parts:
            names = ", ".join(given or (name for name, values in self._own.items() if values[index] != values[0]))
            raise SceneError(f"its {names} would need another program than that of the first, but all share one.")
        return scene, self._numbers(scene, self._limit(index))

    @property
    def alike(self) -> bool:
        """Return True if no parameter of the scene was given with one value for each environment."""
        return not self._own

    def corners(self) -> list[Scene]:
        """Return the scenes of environment 0 and of those with the extreme values of every parameter that differs."""
        places = {0: None}
        for values in self._own.values():
            if _are_numbers(values):
                places |= dict.fromkeys((values.index(min(values)), values.index(max(values))))
        return [self.of(index) for index in places] if self._own else [self.scene]

    def swiftest(self) -> list[Scene]:
        """Return the scenes of :meth:`corners` and the scene with the largest angular frequency omega0 of small swings.
        """
        omega0 = self.numbers["omega0"]
        return [*self.corners(), *([self.of(int(np.argmax(omega0)))] if isinstance(omega0, np.ndarray) else [])]

    def _limit(self, index: int) -> Any:
        """Return the speed limit of the environment with the index ``index``."""
        return self._limits[index] if self._limits else self._shared_limit[0]

    def _numbers(self, scene: Scene, speed_limit: Any) -> Numbers:
        """Return the numbers of one scene that a generated program for many environments takes, by name."""
        limit = checked_limit(speed_limit, scene)
        numbers = numbers_of(scene, self._watched or scene.body.suspension == "wire")
        return {**numbers, "omega0": frequency(scene), "speed_limit": limit}

    def own(self, index: int) -> Scene:
        """Return the scene with which the environment with index ``index`` was made."""
        return self._scene_with(index, {})

    def of(self, index: int) -> Scene:
        """Return the scene of the environment with index ``index``, in its present episode."""
        return self._scene_with(index, {name: float(values[index]) for name, values in self.episode.items()
                                        if not math.isnan(values[index])})

    # --- values for one episode -------------------------------------------------------------------------------------

    def vary(self, scenes: Iterable[Scene]) -> None:
        """Give every environment its own value of the program's numbers in which one of ``scenes`` differs from ours.

        These are scenes that later episodes may have, so that the program is made for them from the start.
        """
        for scene in scenes:
            for name, value in self._numbers(scene, self._limit(0)).items():
                own = self.numbers[name]
                if not isinstance(own, np.ndarray) and value != own:
                    self.numbers[name] = np.full(self._size, own)

    def take(
        self, which: Places, values: Mapping[str, Array], numbers: dict[str, Array] | None = None
    ) -> dict[str, Array]:
        """Give the environments ``which`` new values of parameters for their next episode; see :meth:`numbers_with`.

        ``numbers`` are the program's numbers for these values, where they are known already.

        ``episode`` then holds the values, by name, as arrays of ``size`` numbers; nan stands for the value that the
        environment was made with.
        """
        numbers = self.numbers_with(which, values) if numbers is None else numbers
        for name in {**self.episode, **values}:
            self.episode.setdefault(name, np.full(self._size, math.nan))[which] = values.get(name, math.nan)
        return numbers

    def numbers_with(self, which: Places, values: Mapping[str, Array]) -> dict[str, Array]:
        """Return the program's numbers of the environments ``which`` with other values of some parameters.

        ``values`` and the result map names to arrays with one number for each environment of ``which``.

        Raises SceneError, with the index of the environment, for values that are invalid or need another program.
        """
        return self._columns(which, values)

    def _scene_with(self, index: int, values: Mapping[str, float]) -> Scene:
        """Return the scene of one environment with other values of some parameters."""
        return self.scene.replace(**{**{name: column[index] for name, column in self._own.items()}, **values})


def _are_numbers(values: Sequence[Any]) -> bool:
    """Return True if all entries of a sequence are ints or floats, and none is a boolean."""
    return all(issubclass(kind, (int, float)) and kind is not bool for kind in {*map(type, values)})


def _floats(values: Sequence[Any]) -> Array:
    """Return a sequence of numbers as a float array; TypeError if an entry is not a number."""
    if not _are_numbers(values):
        raise TypeError("All values of a parameter must be numbers.")
    return np.array(values, dtype=np.float64)


def _sequence(value: Any, name: str, size: int, what: str) -> list[Any]:
    """Return a parameter's values of all environments as a list; empty if ``value`` is one value for all.

    Raises SceneError for a sequence whose length is not ``size``.
    """
    if not isinstance(value, (list, tuple, np.ndarray)) or (isinstance(value, np.ndarray) and value.ndim == 0):
        return []
    if name in WHOLE:
        return []
    values = value.tolist() if isinstance(value, np.ndarray) else list(value)
    if len(values) != size or any(isinstance(entry, list) for entry in values):
        shape = np.shape(value) if isinstance(value, np.ndarray) else (len(values),)
        raise SceneError(f"{name} must be one number or one for each of {size} {what}s, not of the shape {shape}.")
    return values
