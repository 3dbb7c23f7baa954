"""The parameters of a program as formulas of what a user sets: length, mass, gravity, and the effects' numbers.

Python computes the parameters of a program in the functions of bodies and effects. Here these functions run once with
numbers that record what is done with them, so that a page can compute the same parameters, in the same order of
operations and so to the same bits. Formulas that branch, or that call a function of :mod:`math`, are not recorded
fully; they are recognised by a comparison with Python at changed values, and the numbers that they need stay fixed.
"""

from __future__ import annotations

import copy
import operator
import random
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

from pendulum_env.engine.machine import numbers_of
from pendulum_env.physics.effects import LinearDrag, QuadraticDrag
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError

Values = Mapping[str, float]
OPERATIONS: Mapping[str, Callable[[float, float], float]] = {
    "+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv,
}
"""RecordedNumber operations; JavaScript and Python round them alike."""
TRIALS = 24
"""Number of drawn sets of values at which recorded formulas are compared with Python."""
FACTORS = (0.5, 2.0)
"""Range of the factors by which a trial changes each value."""
SIZES = ("length", "mass")
"""Sizes of a body that can be set."""


@dataclass(frozen=True)
class NumberSetting:
    """A number of a scene that can be set.

    Attributes:
        name: where it stands in the scene: "gravity", "body.length", or "effects.2.gamma" for that of the third effect.
        label: its name for users, such as "length".
        about: what it is.
        unit: its unit.
        value: its value in the scene.
        least: smallest value allowed; -inf for none.
        exclusive: True if the smallest value itself is not allowed.
        effect: name of its effect; "" for sizes of the body and for gravity.
    """

    name: str
    label: str
    about: str
    unit: str
    value: float
    least: float
    exclusive: bool
    effect: str = ""


@dataclass(frozen=True)
class Formulas:
    """Formulas of a program's parameters.

    Attributes:
        settings: the numbers that can be set.
        lines: operations ``(symbol, left, right)``; an operand is a number, or a text: "x0" for the first setting,
            "n0" for the result of the first line.
        results: names of the parameters -> a number or such a text.
    """

    settings: tuple[NumberSetting, ...]
    lines: tuple[tuple[str, Any, Any], ...]
    results: Mapping[str, Any]

    def values(self, given: Sequence[float]) -> dict[str, float]:
        """Return the parameters by name for values of all settings."""
        known: dict[Any, float] = {f"x{i}": value for i, value in enumerate(given)}
        for i, (symbol, left, right) in enumerate(self.lines):
            known[f"n{i}"] = OPERATIONS[symbol](known.get(left, left), known.get(right, right))
        return {name: known.get(result, result) for name, result in self.results.items()}

    def javascript(self, names: Sequence[str]) -> str:
        """Return the body of a JavaScript function of the array ``x`` of settings; it returns the parameters ``names``.
        """
        used = {self.results.get(name) for name in names}
        lines: list[str] = []
        for i, (symbol, left, right) in reversed([*enumerate(self.lines)]):
            if f"n{i}" in used:
                used |= {left, right}
                lines.insert(0, f"const n{i} = {_text(left)} {symbol} {_text(right)};")
        head = [f"const x{i} = x[{i}];" for i in range(len(self.settings))]
        results = ", ".join(_text(self.results[name]) for name in names)
        return "\n".join([*head, *lines, f"return [{results}];"])


def _recording(symbol: str, swapped: bool = False) -> Callable[[Any, Any], Any]:
    """Return a method of :class:`RecordedNumber`, such as ``__add__``, that records an operation of two numbers."""
    return lambda self, other: self.record(symbol, *((other, self) if swapped else (self, other)))


class RecordedNumber(float):
    """A number with its name, whose sums, differences, products and quotients are recorded in a list.

    It has its value, unlike :class:`integrators.steps.tracing.Symbol`, as the functions of bodies and effects compare
    their numbers.
    """

    name: str
    lines: list[tuple[str, Any, Any]]

    @classmethod
    def of(cls, value: float, name: str, lines: list[tuple[str, Any, Any]]) -> RecordedNumber:
        """Return a number with a name, which records its operations in ``lines``."""
        made = cls(value)
        made.name, made.lines = name, lines
        return made

    def record(self, symbol: str, left: Any, right: Any) -> RecordedNumber:
        """Return the result of an operation, of which this number is an operand, and record it."""
        value = OPERATIONS[symbol](float(left), float(right))
        self.lines.append((symbol, _name(left), _name(right)))
        return RecordedNumber.of(value, f"n{len(self.lines) - 1}", self.lines)

    __add__, __radd__ = _recording("+"), _recording("+", swapped=True)
    __sub__, __rsub__ = _recording("-"), _recording("-", swapped=True)
    __mul__, __rmul__ = _recording("*"), _recording("*", swapped=True)
    __truediv__, __rtruediv__ = _recording("/"), _recording("/", swapped=True)

    def __neg__(self) -> RecordedNumber:
        return self.record("-", -0.0, self)


def _name(value: Any) -> Any:
    """Return the name of a recorded number, or a plain number itself."""
    return value.name if isinstance(value, RecordedNumber) else float(value)


def _text(operand: Any) -> str:
    """Return an operand as JavaScript."""
    return operand if isinstance(operand, str) else repr(float(operand))


def explicit(scene: Scene) -> Scene:
    """Return a scene whose linear and quadratic drag have numbers, where they were derived from geometry and medium.

    The motion keeps its bits.
    """
    effects = []
    for effect in scene.effects:
        if isinstance(effect, LinearDrag) and effect.gamma is None:
            effect = LinearDrag(gamma=scene.coefficients["linear_drag_rate"])
        elif isinstance(effect, QuadraticDrag) and effect.c is None:
            effect = QuadraticDrag(c=scene.coefficients["quadratic_drag_rate"])
        effects.append(effect)
    return replace(scene, effects=tuple(effects))


def settings_of(scene: Scene) -> tuple[NumberSetting, ...]:
    """Return the numbers of a scene that can be set."""
    body: Any = scene.body
    found = [_setting(body, entry, f"body.{entry.name}") for entry in fields(body) if entry.name in SIZES]
    found += [_setting(scene, entry, "gravity") for entry in fields(scene) if entry.name == "gravity"]
    for i, effect in enumerate(scene.effects):
        for entry in fields(effect):  # type: ignore[arg-type]
            if type(getattr(effect, entry.name)) is float:
                found.append(_setting(effect, entry, f"effects.{i}.{entry.name}", effect.name))
    return tuple(found)


def _setting(part: Any, entry: Any, name: str, effect: str = "") -> NumberSetting:
    about = entry.metadata
    bounds = about["check"].keywords
    above, least = bounds["above"], bounds["least"]
    lowest = above if above is not None else least if least is not None else float("-inf")
    return NumberSetting(name, entry.name, about.get("doc", ""), about.get("unit", ""), getattr(part, entry.name),
                         lowest, above is not None, effect)


def with_settings(scene: Scene, settings: Sequence[NumberSetting], values: Sequence[float]) -> Scene:
    """Return a scene with other values of its settings; raises SceneError for values that it cannot have."""
    body: dict[str, Any] = {}
    more: dict[str, Any] = {}
    effects = list(scene.effects)
    for setting, value in zip(settings, values, strict=True):
        place, _, name = setting.name.rpartition(".")
        if place == "body":
            body[name] = value
        elif place:
            number = int(place.removeprefix("effects."))
            effects[number] = replace(effects[number], **{name: value})  # type: ignore[type-var]
        else:
            more[name] = value
    shape: Any = scene.body
    return replace(scene, body=replace(shape, **body), effects=tuple(effects), **more)


def formulas_of(scene: Scene, names: Collection[str]) -> Formulas:
    """Return the formulas of a program's parameters ``names`` that belong to a scene.

    Settings on which a parameter depends in a way that is not recorded are left out, one after the other.
    """
    settings = settings_of(scene)
    while True:
        made = _recorded(scene, settings, names)
        wrong = _first_wrong(scene, made, names)
        if wrong is None:
            return made
        settings = tuple(setting for setting in settings if setting is not wrong)


def _recorded(scene: Scene, settings: tuple[NumberSetting, ...], names: Collection[str]) -> Formulas:
    """Return the formulas that the functions of a scene's body and effects record."""
    lines: list[tuple[str, Any, Any]] = []
    other = copy.copy(scene)
    for name in set(vars(other)) - {entry.name for entry in fields(other)}:
        del vars(other)[name]  # cached values
    parts = {"": other, "body": copy.copy(scene.body)}
    parts |= {f"effects.{i}": copy.copy(effect) for i, effect in enumerate(scene.effects)}
    for i, setting in enumerate(settings):
        place, _, name = setting.name.rpartition(".")
        object.__setattr__(parts[place], name, RecordedNumber.of(setting.value, f"x{i}", lines))
    object.__setattr__(other, "body", parts["body"])
    object.__setattr__(other, "effects", tuple(parts[f"effects.{i}"] for i in range(len(scene.effects))))
    results = {name: _name(value) for name, value in numbers_of(other).items() if name in names}
    return Formulas(settings, tuple(lines), results)


def _first_wrong(scene: Scene, made: Formulas, names: Collection[str]) -> NumberSetting | None:
    """Return the first setting at whose changed values the formulas differ from Python in any bit; None if none does.

    A setting that is 0, and whose change would give the scene's programs other parameters, counts as wrong, too.
    """
    draw = random.Random(1)
    usual = [setting.value for setting in made.settings]
    parameters = set(scene.coefficients)
    for setting in (*made.settings, None):
        for _ in range(TRIALS):
            values = [(value or 0.1) * draw.uniform(*FACTORS) if setting is None or one is setting else value
                      for one, value in zip(made.settings, usual, strict=True)]
            try:
                changed = with_settings(scene, made.settings, values)
            except SceneError:
                continue
            wanted = {name: value for name, value in numbers_of(changed).items() if name in names}
            if set(changed.coefficients) != parameters or _bits(made.values(values)) != _bits(wanted):
                return setting if setting is not None else made.settings[-1]
    return None


def _bits(values: Values) -> dict[str, str]:
    """Return every value as text that has all its bits."""
    return {name: value.hex() for name, value in values.items()}
