"""Parameters that differ between environments: one scene for each, and the numbers that they run with."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.many import Many, in_groups, plain
from pendulum_env.engine.machine import numbers_of
from pendulum_env.engine.problem import program_parts
from pendulum_env.engine.validity import Validity
from pendulum_env.physics.damping import Damping, build_scene
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, UnknownParameterError, number

Array = NDArray[np.float64]
Places = NDArray[np.intp]
Numbers = dict[str, float]

FEW = 16
"""Environments whose scenes are built one by one, where more are built together."""
WHOLE = ("effects",)
"""Parameters that are a sequence themselves."""


def frequency(scene: Scene) -> float:
    """Small-angle angular frequency [1/s] that velocities are measured in; 1 where there is no gravity."""
    return scene.omega0 or 1.0


def checked_limit(value: Any, scene: Scene) -> float:
    """The velocity that ends an episode [rad/s], by default 100 omega0; SceneError unless above 0."""
    return limit_of(100.0 * frequency(scene) if value is None else value)


def limit_of(value: Any) -> float:
    """A velocity that ends a run [rad/s], inf for none; SceneError unless above 0."""
    endless = isinstance(value, (float, Many)) and value == math.inf
    return math.inf if endless else number(value, "speed_limit", above=0.0, unit="rad/s")


class Each:
    """The scenes of ``size`` environments.

    Args:
        scene, damping: as for one environment.
        speed_limit: as for one environment, or one for each.
        parameters: by name: a value for all, or a sequence of ``size``.
        what: the word for one of them in errors.
        validity: looks at each scene and the places of environments that have it.

    Attributes:
        scene: of the first environment, with its usual run.
        numbers: coefficients, OWN and LIMITS: a float where all agree, else an array of ``size``.

    Raises SceneError for what cannot be, with the index of the environment where it is one's own value.
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
    ) -> None:
        own = {name: values for name, value in parameters.items() if (values := _sequence(value, name, size, what))}
        limits = _sequence(speed_limit, "speed_limit", size, what)
        self._own = own
        first = {name: values[0] for name, values in own.items()}
        try:
            self.scene = build_scene(scene, damping, {**parameters, **first})
        except SceneError as error:
            if not own:
                raise
            given = {"given": error.given} if isinstance(error, UnknownParameterError) else {}
            raise type(error)(f"In {what} 0 of {size}: {error}", **given) from None
        if validity and not own:
            validity.look(self.scene, range(size))
        if not own and not limits:
            self.numbers: dict[str, float | Array] = {**_numbers(self.scene, speed_limit)}
            return
        self._size, self._what, self._parts = size, what, program_parts(self.scene)
        self._limits = limits or [speed_limit] * size
        validity = validity if own else None
        columns = self._together(limits, validity) or self._one_by_one(range(size), validity)
        self.numbers = {name: float(column[0]) if np.all(column == column[0]) else column
                        for name, column in columns.items()}

    def _together(self, limits: Sequence[Any], validity: Validity | None) -> dict[str, Array]:
        """Numbers of all environments, whose scenes go in groups, as one of Many, through what is written for one.

        A group of few goes one by one, and so does whoever may have to be warned of. Empty where something is wrong,
        or where code takes no Many: then all have to.
        """
        columns: dict[str, Array] = {}
        few, doubtful = [0], [0]

        def fill(places: Places) -> None:
            if len(places) < FEW:
                few.extend(places.tolist())
                doubtful.extend(places.tolist())
                return
            scene = self.scene.replace(**{name: Many(values[places]) for name, values in own.items()})
            if program_parts(scene) != self._parts:
                raise SceneError("These need another program.")
            for name, found in _numbers(scene, Many(ends[places]) if limits else self._limits[0]).items():
                columns.setdefault(name, np.empty(self._size))[places] = plain(found)
            if validity and not validity.clear(scene, places):
                doubtful.extend(places.tolist())

        try:
            own, ends = {name: _floats(values) for name, values in self._own.items()}, _floats(limits)
            in_groups(self._size, fill)
            for name, found in self._one_by_one(few, None).items():
                columns.setdefault(name, np.empty(self._size))[few] = found
            for place in sorted(doubtful):
                if validity and not validity.said:
                    validity.look(self.of(place), (place,))
        except Exception:
            return {}
        return columns

    def _one_by_one(self, places: Sequence[int], validity: Validity | None) -> dict[str, Array]:
        """Numbers of the environments at these places; SceneError, with its index, for one that cannot be."""
        found: dict[tuple[Any, ...], tuple[Scene, Numbers]] = {}
        rows = []
        for i in places:
            key = (self._limits[i], *(values[i] for values in self._own.values()))
            if key not in found:
                try:
                    found[key] = self._same_program(i)
                except SceneError as error:
                    raise SceneError(f"In {self._what} {i} of {self._size}: {error}") from None
            if validity:
                validity.look(found[key][0], (i,))
            rows.append(found[key][1])
        return {name: np.array([row[name] for row in rows]) for name in rows[0]}

    def _same_program(self, place: int) -> tuple[Scene, Numbers]:
        """Scene and numbers of the environment at this place; SceneError if its program is not that of the first."""
        scene = self.of(place)
        if program_parts(scene) != self._parts:
            names = ", ".join(name for name, values in self._own.items() if values[place] != values[0])
            raise SceneError(f"its {names} would need another program than that of the first, and all run the same.")
        return scene, _numbers(scene, self._limits[place])

    def corners(self) -> list[Scene]:
        """The first environment's scene, and those with the smallest and the largest value of each array."""
        places = {0: None}
        for values in self._own.values():
            if _are_numbers(values):
                places |= dict.fromkeys((values.index(min(values)), values.index(max(values))))
        return [self.of(place) for place in places] if self._own else [self.scene]

    def swiftest(self) -> list[Scene]:
        """:meth:`corners`, and the scene with the largest omega0."""
        omega0 = self.numbers["omega0"]
        return [*self.corners(), *([self.of(int(np.argmax(omega0)))] if isinstance(omega0, np.ndarray) else [])]

    def of(self, place: int) -> Scene:
        """The scene of the environment at this place."""
        return self.scene.replace(**{name: values[place] for name, values in self._own.items()})


def _numbers(scene: Scene, speed_limit: Any) -> Numbers:
    limit = checked_limit(speed_limit, scene)
    return {**numbers_of(scene), "omega0": frequency(scene), "speed_limit": limit}


def _are_numbers(values: Sequence[Any]) -> bool:
    return all(issubclass(kind, (int, float)) and kind is not bool for kind in {*map(type, values)})


def _floats(values: Sequence[Any]) -> Array:
    """Return numbers as an array; TypeError if one is no number."""
    if not _are_numbers(values):
        raise TypeError("Not all of these are numbers.")
    return np.array(values, dtype=np.float64)


def _sequence(value: Any, name: str, size: int, what: str) -> list[Any]:
    """Values of all environments; empty if there is but one for all."""
    if not isinstance(value, (list, tuple, np.ndarray)) or (isinstance(value, np.ndarray) and value.ndim == 0):
        return []
    if name in WHOLE:
        return []
    values = value.tolist() if isinstance(value, np.ndarray) else list(value)
    if len(values) != size or any(isinstance(entry, list) for entry in values):
        shape = np.shape(value) if isinstance(value, np.ndarray) else (len(values),)
        raise SceneError(f"{name} must be one number or one for each of {size} {what}s, not of the shape {shape}.")
    return values
