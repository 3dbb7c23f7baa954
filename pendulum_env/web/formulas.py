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

import numpy as np

from integrators.steps.straight_line import Record
from integrators.steps.tracing import Operation, Symbol
from pendulum_env.common.many import Operator, Twinned, plain, power, twin_of
from pendulum_env.engine.machine import numbers_of
from pendulum_env.physics.effects import LinearDrag, QuadraticDrag
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError

Values = Mapping[str, float]
OPERATIONS: Mapping[str, tuple[str, Callable[..., float]]] = {
    "add": ("{} + {}", operator.add), "sub": ("{} - {}", operator.sub), "mul": ("{} * {}", operator.mul),
    "div": ("{} / {}", operator.truediv), "neg": ("-({})", operator.neg),
}
"""Recorded operation -> its form in JavaScript, and Python's function; both languages round them alike."""
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
        operations: the recorded operations; a leaf "setting" has the index of the setting as its value.
        results: names of the parameters -> indices of their operations.
    """

    settings: tuple[NumberSetting, ...]
    operations: tuple[Operation, ...]
    results: Mapping[str, int]

    def values(self, given: Sequence[float]) -> dict[str, float]:
        """Return the parameters by name for values of all settings."""
        known: list[float] = []
        for one in self.operations:
            operands = [known[place] for place in one.operands]
            known.append(OPERATIONS[one.name][1](*operands) if operands else
                         given[one.value] if one.name == "setting" else one.value)
        return {name: known[place] for name, place in self.results.items()}

    def javascript(self, names: Sequence[str]) -> str:
        """Return the body of a JavaScript function of the array ``x`` of settings; it returns the parameters ``names``.
        """
        used = {self.results[name] for name in names}
        lines: list[str] = []
        for place, one in reversed([*enumerate(self.operations)]):
            if place in used and one.operands:
                used.update(one.operands)
                lines.append(f"const n{place} = {OPERATIONS[one.name][0].format(*map(self._text, one.operands))};")
        results = ", ".join(self._text(self.results[name]) for name in names)
        return "\n".join([*reversed(lines), f"return [{results}];"])

    def _text(self, place: int) -> str:
        """Return an operation as JavaScript: a setting, a number, or the name of its result."""
        one = self.operations[place]
        return f"x[{one.value}]" if one.name == "setting" else f"n{place}" if one.operands else repr(float(one.value))


class RecordedNumber(Twinned):
    """A number with its value, and with a symbol that records sums, differences, products and quotients.

    The result of any other operation is its value alone, without a symbol.
    """

    __slots__ = ()

    def combined(self, operation: Operator, left: Any, right: Any) -> Any:
        if operation in (power, operator.pow):
            return float(operation(plain(left), plain(right))[0])
        return super().combined(operation, left, right)

    def mapped(self, function: np.ufunc) -> Any:
        if function is np.negative:
            return RecordedNumber(-self.values, -self.twin)
        return float(function(self.values)[0])

    def through(self, formula: Callable[..., Any], further: tuple[float, ...]) -> Any:
        return formula(float(self), *further)

    def __float__(self) -> float:
        return float(self.values[0])


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
    trace = Record()
    other = copy.copy(scene)
    for name in set(vars(other)) - {entry.name for entry in fields(other)}:
        del vars(other)[name]  # cached values
    parts = {"": other, "body": copy.copy(scene.body)}
    parts |= {f"effects.{i}": copy.copy(effect) for i, effect in enumerate(scene.effects)}
    for i, setting in enumerate(settings):
        place, _, name = setting.name.rpartition(".")
        number = RecordedNumber(np.array([setting.value]), trace.leaf("setting", i))
        object.__setattr__(parts[place], name, number)
    object.__setattr__(other, "body", parts["body"])
    object.__setattr__(other, "effects", tuple(parts[f"effects.{i}"] for i in range(len(scene.effects))))
    results = {name: twin_of(value) for name, value in numbers_of(other).items() if name in names}
    places = {name: value.place if isinstance(value, Symbol) else trace.leaf("steady", float(value)).place
              for name, value in results.items()}
    return Formulas(settings, tuple(trace.operations), places)


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
