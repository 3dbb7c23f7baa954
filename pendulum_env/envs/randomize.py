"""Parameters of the scene that are drawn anew for every episode.

Draws are made from the environment's own random stream, before those of the start, with the same operations for one
environment and for many, so that environment i of a vector gets the values of the single environment.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.engine.elementwise import elementwise
from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.problem import program_parts
from pendulum_env.engine.random_streams import Streams
from pendulum_env.physics.elementary import exp, log
from pendulum_env.physics.random import normal
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, nearest, number, one_of, shown

Array = NDArray[np.float64]
Places = NDArray[np.intp]
Values = dict[str, Array]

UNIFORM, LOG, CHOICE = "uniform", "log", "choice"
WORDS = (UNIFORM, LOG, CHOICE)
"""First entries of a range of a parameter, which say how it is drawn."""
FORMS = '(low, high), ("log", low, high) or a list of values'
MOST_CORNERS, TRIALS = 64, 16
"""Largest number of combinations of ends of ranges, and number of random draws, that are checked beforehand."""
PATIENCE = 1000
"""Most draws of one episode before a distribution is refused, because hardly any of its draws is within the bounds."""


class OneStream:
    """The random stream of a single environment, in the form of :class:`pendulum_env.engine.random_streams.Streams`."""

    def __init__(self, generator: np.random.Generator) -> None:
        self._generator = generator

    def uniform(self, which: Places) -> Array:
        """Return a random number in [0, 1) for every entry of ``which``."""
        return np.array([self._generator.random() for _ in which])

    def generators(self, which: Places) -> Iterator[np.random.Generator]:
        """Yield the generator for every entry of ``which``; then drop its unused half of a 64-bit number."""
        for _ in which:
            yield self._generator
            state = self._generator.bit_generator.state
            if state.get("has_uint32"):
                self._generator.bit_generator.state = {**state, "has_uint32": 0, "uinteger": 0}


@dataclass(frozen=True)
class Range:
    """A parameter that is drawn from a uniform or log-uniform range, or from a list of values with equal chances.

    A range of zero width, and a list of one value, is a fixed value and takes no random number.
    """

    name: str
    kind: str
    values: tuple[float, ...]

    @classmethod
    def of(cls, name: str, given: Any) -> Range:
        """Return the range of the parameter ``name`` from a user's value; SceneError for an invalid one."""
        label = f"randomize: {name}"
        entries = given.tolist() if isinstance(given, np.ndarray) and given.ndim == 1 else given
        if not isinstance(entries, (list, tuple)) or not entries:
            raise SceneError(f"{label} must be {FORMS}, not {shown(given)}.")
        kind = UNIFORM if isinstance(entries, tuple) else CHOICE
        if isinstance(entries[0], str):
            kind, entries = one_of(entries[0], f"way to draw {name}", WORDS), entries[1:]
        values = tuple(number(value, label) for value in entries)
        if not values or (kind != CHOICE and len(values) != 2):
            raise SceneError(f"{label} must be {FORMS}, not {shown(given)}.")
        if kind != CHOICE and values[0] > values[1]:
            raise SceneError(f"{label} must have the lower end first, not {shown(given)}.")
        if kind == LOG and values[0] <= 0.0:
            raise SceneError(f"{label} must have ends above 0 to be drawn log-uniformly, not {shown(given)}.")
        return cls(name, kind, values)

    @property
    def names(self) -> tuple[str, ...]:
        """Name of the parameter, as a tuple."""
        return (self.name,)

    def ends(self) -> list[dict[str, float]]:
        """Return the ends of the range, or the smallest and largest value."""
        return [{self.name: value} for value in dict.fromkeys((min(self.values), max(self.values)))]

    def drawn(self, source: OneStream | Streams, which: Places, backend: Backend) -> Values:
        """Return the values of new episodes in the environments ``which``."""
        if self.fixed:
            return {self.name: np.full(len(which), self.values[0])}
        return {self.name: self.at(source.uniform(which), elementwise(exp, backend), np.array)}

    @property
    def fixed(self) -> bool:
        """Return True for a single value, which takes no random number."""
        return len({*self.values}) == 1

    def at(self, uniform: Any, exponential: Callable[[Any], Any], array: Callable[[Any], Any]) -> Any:
        """Return the values for an array of random numbers in [0, 1), with functions for this kind of array."""
        low, high = self.values[0], self.values[-1]
        if self.kind == CHOICE:
            return array(self.values)[(uniform * len(self.values)).astype(int).clip(0, len(self.values) - 1)]
        if self.kind == LOG:
            return (low * exponential(uniform * log(high / low))).clip(low, high)
        return (low + (high - low) * uniform).clip(low, high)


class Joint:
    """Parameters that are drawn together from a fit: with its covariance, or one of the refits of its bootstrap.

    A draw with a value below its bound is drawn again.

    Args:
        scatter: names, values, covariance, lower bounds and refits; see
            :class:`pendulum_env.lab.fitting.intervals.Scatter`.

    Attributes:
        names, values, least: names, means and lower bounds of the parameters.
        rows: refits, shape ``(refits, len(names))``; None to draw ``values + normal @ spread``.
        spread: square root of the covariance, shape ``(len(names), len(names))``.
    """

    def __init__(self, scatter: Any) -> None:
        self.names: tuple[str, ...] = tuple(scatter.names)
        self.values, self.least = (np.asarray(x, dtype=np.float64) for x in (scatter.values, scatter.least))
        self.rows = None if scatter.rows is None else np.asarray(scatter.rows, dtype=np.float64)
        errors = np.sqrt(np.diag(scatter.covariance))
        scale = np.where(errors > 0.0, errors, 1.0)
        sizes, axes = np.linalg.eigh(np.asarray(scatter.covariance) / np.outer(scale, scale))
        self.spread = (axes * np.sqrt(np.maximum(sizes, 0.0))).T * scale

    def ends(self) -> list[dict[str, float]]:
        """Return no ends: a normal distribution has none."""
        return []

    def drawn(self, source: OneStream | Streams, which: Places, backend: Backend) -> Values:
        """Return the values of new episodes in the environments ``which``.

        Raises SceneError if hardly any draw is within the bounds.
        """
        drawn, left = np.empty((len(self.names), len(which))), np.arange(len(which))
        for _ in range(PATIENCE):
            if not left.size:
                return dict(zip(self.names, drawn, strict=True))
            row = self._row(source, which[left], backend)
            good = np.all(row >= self.least[:, None], axis=0)
            drawn[:, left[good]] = row[:, good]
            left = left[~good]
        raise SceneError(f"randomize: none of {PATIENCE} draws of {', '.join(self.names)} is within the bounds; the "
                         "fit's errors are too large.")

    def _row(self, source: OneStream | Streams, which: Places, backend: Backend) -> Array:
        """Return one draw for every environment of ``which``, shape ``(names, len(which))``, within bounds or not."""
        if self.rows is not None:
            places = (source.uniform(which) * len(self.rows)).astype(np.intp)
            return np.asarray(self.rows[np.minimum(places, len(self.rows) - 1)].T)
        row = np.repeat(self.values[:, None], len(which), axis=1)
        normals = elementwise(normal, backend)
        for along in self.spread:  # in a fixed order, so that one environment gets the same bits as many
            size = normals(1.0 - source.uniform(which), source.uniform(which))
            row = row + along[:, None] * size
        return row


class Function:
    """Parameters that a user's function returns, a dict of numbers, when it is called with a NumPy generator.

    Raises SceneError if the function returns something else in a trial call.
    """

    def __init__(self, function: Callable[[np.random.Generator], Mapping[str, float]]) -> None:
        self._function = function
        self.names: tuple[str, ...] = tuple(self._called(np.random.default_rng(0)))

    def ends(self) -> list[dict[str, float]]:
        """Return no ends: those of a function are unknown."""
        return []

    def drawn(self, source: OneStream | Streams, which: Places, backend: Backend) -> Values:
        """Return the values of new episodes in the environments ``which``, for which the function is called in turn."""
        rows = [self._called(generator) for generator in source.generators(which)]
        return {name: np.array([row[name] for row in rows]) for name in self.names}

    def _called(self, generator: np.random.Generator) -> dict[str, float]:
        """Return the checked result of one call of the function."""
        values = self._function(generator)
        if not isinstance(values, Mapping) or not values or not all(isinstance(name, str) for name in values):
            raise SceneError(f"The function given as randomize must return a dict of parameters, not {shown(values)}.")
        known = getattr(self, "names", tuple(values))
        if {*values} != {*known}:
            raise SceneError("The function given as randomize must return the same parameters in every call, not "
                             f"{', '.join(values)} after {', '.join(known)}.")
        return {name: number(value, f"randomize: {name}") for name, value in values.items()}


Draws = Range | Joint | Function
"""Parameters of the scene that are drawn together."""


class Randomization:
    """The parameters of a scene that are drawn at the start of every episode.

    Args:
        given: a dict from parameters to ranges, a fit, a function of a generator, or a list of these, as in
            ``gym.make(..., randomize=...)``.

    Attributes:
        names: names of the drawn parameters, in the order in which they are drawn.
        parts: parameters that are drawn together, in this order.

    Raises SceneError for anything else.
    """

    def __init__(self, given: Any) -> None:
        self.parts: list[Draws] = []
        for part in given if isinstance(given, (list, tuple)) else (given,):
            self.parts += parts_of(part)
        self.names = tuple(name for part in self.parts for name in part.names)
        if not self.names or len({*self.names}) < len(self.names):
            raise SceneError(f"randomize must name parameters, each of them once, not {shown(given)}.")

    def drawn(self, source: OneStream | Streams, which: Places, backend: Backend) -> Values:
        """Return the parameters of new episodes in the environments ``which``: name -> array of ``len(which)``.

        Raises SceneError for a function that returns something else, or a fit with hardly any draw within its bounds.
        """
        values: Values = {}
        for part in self.parts:
            values |= part.drawn(source, which, backend)
        return values

    def one(self, generator: np.random.Generator) -> dict[str, float]:
        """Return the parameters of a new episode of a single environment; see :meth:`drawn`."""
        values = self.drawn(OneStream(generator), np.zeros(1, dtype=np.intp), "python")
        return {name: float(value[0]) for name, value in values.items()}

    def scenes(self, scene: Scene) -> list[Scene]:
        """Return scenes with the values of :meth:`trials`, to be checked before episodes.

        Raises SceneError for a parameter that the scene does not have or that is not a number, and for draws that are
        invalid or that need another program.
        """
        check_parameters(self.names, scene, f"randomize: the scene '{scene.name}' has no parameter")
        return [self._checked(scene, values) for values in self.trials()]

    def trials(self) -> list[dict[str, float]]:
        """Return parameters at the ends of all ranges, and random draws."""
        ends = [ends for part in self.parts if (ends := part.ends())]
        corners = [dict(pair for one in choice for pair in one.items())
                   for choice in islice(product(*ends), MOST_CORNERS)] if ends else []
        extremes = [{name: value for one in ends for name, value in one[side].items()} for side in (0, -1)]
        source = np.random.default_rng(0)
        draws = [self.one(source) for _ in range(TRIALS)]
        return [{**draws[i % TRIALS], **corner} for i, corner in enumerate([*corners, *extremes, *({},) * TRIALS])]

    def _checked(self, scene: Scene, values: Mapping[str, float]) -> Scene:
        """Return the scene with these values; SceneError if they are invalid or need another program."""
        label = ", ".join(f"{name}={value:.6g}" for name, value in values.items())
        try:
            drawn = scene.replace(**values)
        except SceneError as error:
            raise SceneError(f"randomize: {label} cannot be drawn: {error}") from None
        if program_parts(drawn) != program_parts(scene):
            raise SceneError(f"randomize: {label} would need another program than the scene '{scene.name}', but all "
                             "episodes share one; give the scene itself values within the ranges.")
        return drawn


class Bank:
    """Parameters of the next episodes of a vector's environments, drawn for many at once.

    An episode takes random numbers at its start only, so that the parameters of the next one can be drawn at any time
    after it. The program's numbers of many scenes take hardly longer to compute than those of one: whenever one
    environment needs new parameters, they are drawn for all environments that have used theirs.
    """

    def __init__(self, size: int) -> None:
        self._columns: tuple[Values, Values] = {}, {}
        self._ready = np.zeros(size, dtype=np.bool_)

    def forget(self, which: Places) -> None:
        """Drop the parameters of environments whose random streams begin anew."""
        self._ready[which] = False

    def take(self, which: Places, draw: Callable[[Places], tuple[Values, Values]]) -> tuple[Values, Values]:
        """Return parameters and program's numbers of the next episodes of the environments ``which``.

        ``draw`` returns both for the environments with the given indices.
        """
        if not self._ready[which].all():
            empty = np.flatnonzero(~self._ready)
            for columns, drawn in zip(self._columns, draw(empty), strict=True):
                for name, column in drawn.items():
                    columns.setdefault(name, np.empty(len(self._ready)))[empty] = column
            self._ready[empty] = True
        self._ready[which] = False
        values, numbers = ({name: column[which] for name, column in columns.items()} for columns in self._columns)
        return values, numbers


    def saved(self) -> dict[str, Any]:
        """Return what was drawn ahead: "ready", and the dicts "values" and "numbers" of arrays by name."""
        values, numbers = ({name: column.copy() for name, column in columns.items()} for columns in self._columns)
        return {"ready": self._ready.copy(), "values": values, "numbers": numbers}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Take over what :meth:`saved` returned, which must fit."""
        values, numbers = ({name: column.copy() for name, column in saved[part].items()}
                           for part in ("values", "numbers"))
        self._columns, self._ready = (values, numbers), saved["ready"].copy()


def check_parameters(names: Iterable[Any], scene: Scene, refusal: str, more: Iterable[str] = ()) -> None:
    """Raise SceneError for names that are not those of numbers among the scene's parameters.

    The message begins with ``refusal`` and names the nearest parameter, or the nearest of ``more`` names.
    """
    known: dict[str, Any] = scene.parameters()
    parts = {"body": scene.body, "medium": scene.medium, **{effect.name: effect for effect in scene.effects}}
    for name in names:
        owner, _, own = name.rpartition(".") if isinstance(name, str) else ("", "", "")
        if name not in known and not (owner in parts and own != "name" and hasattr(parts[owner], own)):
            raise SceneError(f"{refusal} {shown(name)}{nearest(name, (*more, *known))}")
        if isinstance(known[name] if name in known else getattr(parts[owner], own), (str, bool)):
            raise SceneError(f"{refusal} {shown(name)}, which is not a number; make an environment with it.")


def parts_of(given: Any) -> Iterable[Draws]:
    """Return the parts of a randomisation from a user's value; SceneError for an invalid one."""
    if isinstance(given, Mapping):
        if not all(isinstance(name, str) for name in given):
            raise SceneError(f"randomize must have the names of parameters as keys, not {shown(given)}.")
        return [Range.of(name, value) for name, value in given.items()]
    if not isinstance(given, type) and (scatter := getattr(given, "scatter", None)) is not None:
        return [Joint(scatter)]
    if callable(given) and not isinstance(given, type):
        return [Function(given)]
    raise SceneError('randomize must be a dict such as {"length": (0.3, 0.4)}, a fit, a function of a generator or a '
                     f"list of these, not {shown(given)}.")


def randomization(given: Any) -> Randomization | None:
    """Return the randomisation of a user's value; None for None. Raises SceneError for an invalid value."""
    return None if given is None else Randomization(given)


def plain_form(given: Any) -> Any:
    """Return a user's value in a form that JSON preserves: lists that begin with the kind of range for tuples."""
    if isinstance(given, Mapping) and all(isinstance(name, str) for name in given):
        ranges = [Range.of(name, value) for name, value in given.items()]
        return {one.name: [one.kind, *one.values] for one in ranges}
    return [plain_form(part) for part in given] if isinstance(given, (list, tuple)) else given
