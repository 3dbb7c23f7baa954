"""Scenes: the apparatus, the medium, the simulated effects, and the usual run."""

from __future__ import annotations

import dataclasses
import json
import math
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from keyword import iskeyword
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import Any, get_args

from pendulum_env.common.many import isfinite, sqrt
from pendulum_env.common.replacing import OutputError, replacing
from pendulum_env.common.results import Displayed
from pendulum_env.common.sources import ours
from pendulum_env.physics import data
from pendulum_env.physics.bodies import body_data
from pendulum_env.physics.body import Body, RigidBody
from pendulum_env.physics.consistency import check_functions, check_stiffness
from pendulum_env.physics.effects import Effect
from pendulum_env.physics.effects.effect import GRAVITY, WEIGHT, Kind
from pendulum_env.physics.equation import equation_text, latex
from pendulum_env.physics.flow import reynolds_number
from pendulum_env.physics.medium import VACUUM, Medium
from pendulum_env.physics.units import (
    Checked,
    SceneError,
    boolean,
    file_path,
    first_line,
    line,
    one_of,
    other_units,
    shown,
    si,
    total,
)


@dataclass(frozen=True)
class Run(Checked):
    """A scene's usual start, step and duration, used only as defaults where a run is given none."""

    angle: float = si(0.5, "rad", "release angle from the downward vertical")
    velocity: float = si(0.0, "rad/s", "release velocity")
    dt: float = si(0.01, "s", "integrator's step", above=0.0)
    duration: float = si(10.0, "s", "length of the run", above=0.0)


FORMAT = 1
"""Number of the form in which scenes are pickled; raised by one whenever their fields change."""
BOB: RigidBody = Body()
USUAL = Run()
"""Default body and default run of a scene."""
SLOWEST = 1e-9
"""Smallest omega0 of a pendulum under gravity [rad/s], a period of 200 years.

Work is a sum of terms of the size m g L omega0, and series contain omega0**30, which must not underflow.
"""

PARTS: tuple[tuple[str, type], ...] = (("body", RigidBody), ("medium", Medium), ("run", Run))
"""The parts of a scene that are dataclasses, by name."""


@dataclass(frozen=True)
class Scene(Checked, Displayed):
    """A pendulum and the effects to simulate: ``I theta'' = sum of the effects' torques``, and no unlisted effect.

    Attributes:
        name: the scene's name, for titles and files.
        body: the rigid body on the pivot, such as a bob on a wire; :mod:`pendulum_env.physics.bodies` has others.
        medium: the fluid around the bob, or vacuum.
        effects: the effects to simulate.
        gravity: gravitational acceleration [m/s²].
        run: the usual run, which supplies defaults.

    Raises SceneError for values out of range, derived values (inertia, coefficients) included, and for contradictions:
    two effects of one kind, two gravities, drag in a vacuum, drag that nothing determines, a motor on a wire, a bob
    that floats, a body that its counterweight balances, an effect that has no meaning for the body.
    """

    name: str = "custom"
    body: RigidBody = BOB
    medium: Medium = VACUUM
    effects: tuple[Effect, ...] = ()
    gravity: float = si(9.81, "m/s^2", "gravitational acceleration", least=0.0)
    run: Run = USUAL

    def __post_init__(self) -> None:
        super().__post_init__()
        line(self.name, "A scene's name")
        for name, kind in PARTS:
            if not isinstance(getattr(self, name), kind):
                given = shown(getattr(self, name))
                raise SceneError(f"A scene's {name} must be a {data.kind_name(kind)}, not {given}.")
        object.__setattr__(self, "effects", data.listed(self.effects))
        for effect in self.effects:
            if not isinstance(effect, Effect):
                raise SceneError(f"A scene's effects must be Effect instances, not {shown(effect)}.")
            named(effect.name, f"The name of the effect {type(effect).__name__}")
            for name in effect.memory:
                named(name, f"A name in the memory of {effect.name}")
        groups = [effect.exclusive or effect.name for effect in self.effects]
        for group in groups:
            if groups.count(group) > 1:
                raise SceneError(f"A scene can hold only one effect of the kind '{group}', not {groups.count(group)}; "
                                 "leave out the others.")
        try:
            self._check_numbers()
        except SceneError as error:
            if mistaken := " ".join(other_units(self.body, self.gravity)):
                raise type(error)(f"{error} Perhaps a unit is mistaken: {mistaken}") from None
            raise

    def _check_numbers(self) -> None:
        """Raise SceneError if body and effects contradict each other or the scene, or if a number is out of range."""
        try:
            self.body.check()
            for effect in self.effects if self.body.lacks else ():
                if reason := self.body.lacks.get(effect.needs):
                    raise SceneError(f"{effect.name} has no meaning for the body '{self.body.shape}', because "
                                     f"{reason}.")
            lowest = 1e-12 * self.body.mass * self.body.reach
            if not self.body.moment > lowest and any(effect.needs == WEIGHT for effect in self.effects):
                place = "at the pivot, so that there is no restoring torque" if self.body.moment >= -lowest else (
                    "above the pivot, so that it hangs the other way up")
                raise SceneError(f"The centre of mass of the body '{self.body.shape}' is {place}; shift the pivot or a "
                                 "weight.")
            weight, own = self.weight_moment, self.body.moment
            if weight <= 0.0 < own:
                named = "bob" if self.body.shape == Body.shape else "body"
                raise SceneError(
                    f"The {named} of {self.body.mass:g} kg would float in {self.medium.name}, where it displaces "
                    f"{self.medium.density * self.body.volume:g} kg; a pendulum has to hang."
                )
            if not sys.float_info.min <= self.inertia < math.inf:
                least, most = sys.float_info.min, sys.float_info.max
                raise SceneError(
                    f"The moment of inertia, mass times length squared, must be between {least:.3g} and {most:.3g} "
                    f"kg m^2, not {self.inertia!r}."
                )
            for effect in self.effects:
                if effect.needs_medium and self.medium.empty:
                    raise SceneError(
                        f"There is no {effect.name} in {self.medium.name}; leave out this effect, or give the scene a "
                        "medium such as air."
                    )
                effect.check(self)
            pull = self.restoring
            pulled = (self.gravity > 0.0 and weight > 0.0) or self.springs > 0.0
            if pulled and not (pull >= sys.float_info.min and self.omega0 >= SLOWEST):
                raise SceneError(
                    f"Gravity of {self.gravity:g} m/s^2 is too weak here: omega0 is {self.omega0:.3g} rad/s and the "
                    f"torque m g L {pull:.3g} N m, which must be at least {SLOWEST:g} and {sys.float_info.min:.3g}, "
                    "because smaller numbers and their products lose digits. Take a stronger gravity, or 0 for none."
                )
            derived = {"omega0": self.omega0, **self.coefficients}
        except ArithmeticError as error:
            raise SceneError(f"The coefficients of the scene '{self.name}' are out of range, because a parameter is "
                             f"too large or too small: {error}.") from None
        for name, value in derived.items():
            if not isfinite(value):
                raise SceneError(f"The coefficient {name} of the scene '{self.name}' must be finite, not {value!r}; "
                                 "a parameter is out of range.")
        for effect in self.effects:
            if not ours(type(effect)):
                self._try(effect)

    def _try(self, effect: Effect) -> None:
        """Raise SceneError if the functions of a user's effect contradict its torque."""
        check_functions(effect, self.coefficients, self.omega0)
        if effect.kind == "conservative" and effect.torque and (
                type(effect).restoring_stiffness is not Effect.restoring_stiffness):
            weight = self.gravity * self.weight_moment if effect.exclusive == GRAVITY else 0.0
            check_stiffness(effect, weight + effect.restoring_stiffness(self), self.coefficients, self.inertia)

    def __getstate__(self) -> dict[str, Any]:
        """Return the scene's fields and the number of their form as the state to pickle or copy.

        Derived values are left out and computed anew.
        """
        return {**{f.name: getattr(self, f.name) for f in fields(self)}, "format": FORMAT}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        """Set the fields of a copied or unpickled scene; SceneError if another version has pickled it."""
        if state.get("format") != FORMAT:
            raise SceneError(f"This scene was pickled by another version of the package, in the format "
                             f"{shown(state.get('format'))} and not {FORMAT}; make the scene anew, and keep scenes as "
                             "scene.to_dict() in JSON, which other versions read.")
        vars(self).update((name, value) for name, value in state.items() if name != "format")

    # --- derived quantities -------------------------------------------------------------------------------------

    @cached_property
    def inertia(self) -> float:
        """Return the moment of inertia about the pivot: the body's, that of a bob as of a point mass, plus all effects'
        [kg m²].
        """
        return self.body.inertia + total(effect.inertia(self) for effect in self.effects)

    @cached_property
    def weight_moment(self) -> float:
        """Return mass times distance from the pivot as gravity sees it: ``m L`` plus the effects' contributions [kg m].
        """
        return self.body.moment + total(effect.weight_moment(self) for effect in self.effects)

    @cached_property
    def mass_moment(self) -> float:
        """Return mass times distance from the pivot of everything that a moving pivot accelerates [kg m]."""
        return self.body.moment + total(effect.mass_moment(self) for effect in self.effects)

    @property
    def bob_mass(self) -> float:
        """Return the mass that moves at the bob [kg], the bob's plus that of the fluid moved along; the suspension
        holds it on its circle. For other bodies it is the mass that pulls as much from the reach.
        """
        return self.body.end_mass + total(e.mass_moment(self) for e in self.effects if e.at_bob) / self.body.reach

    @property
    def bob_weight(self) -> float:
        """Return the body's weight over g, reduced by buoyancy, with which it pulls at the suspension [kg]."""
        lifts = total(e.weight_moment(self) for e in self.effects if e.at_bob)
        return self.body.mass + lifts / self.body.volume_distance

    @cached_property
    def springs(self) -> float:
        """Return the restoring torque per angle of fibres and springs near the bottom [N m/rad].

        Raises SceneError for an effect with coefficients that depend on this stiffness.
        """
        try:
            return total(effect.restoring_stiffness(self) for effect in self.effects)
        except RecursionError:
            raise SceneError(
                f"The coefficients of a conservative effect of the scene '{self.name}' use omega0 or restoring, which "
                "depend on the stiffness of this effect; use scene.gravity, weight_moment and inertia instead."
            ) from None

    @cached_property
    def restoring(self) -> float:
        """Return the restoring torque per angle near the bottom, ``g weight_moment`` plus that of springs [N m/rad].

        The weight counts in a scene without any conservative effect, too, but not beside a spring alone, and not of a
        centre of mass above the pivot, which gravity would turn down. Where springs push away from the bottom more
        strongly than the weight pulls back, the weight alone sets the scale.
        """
        if self.springs > 0.0 and not any(effect.exclusive == GRAVITY for effect in self.effects):
            return self.springs
        weight = self.gravity * max(0.0, self.weight_moment)
        whole = weight + self.springs
        return weight if self.springs < 0.0 and not whole > 0.0 else whole

    @cached_property
    def omega0(self) -> float:
        """Return the small-angle angular frequency ``sqrt(restoring / I)`` [1/s]."""
        return sqrt(self.restoring / self.inertia)

    @cached_property
    def bottom_velocity(self) -> float:
        """Return the angular velocity at the bottom in the usual run, without losses [rad/s]."""
        height = 2.0 * math.sin(0.5 * self.run.angle) ** 2
        return sqrt(self.run.velocity**2 + 2.0 * self.omega0**2 * height)

    @cached_property
    def reynolds(self) -> float:
        """Return the Reynolds number of the bob at the bottom in the usual run; 0 in vacuum."""
        return reynolds_number(self.bottom_velocity * self.body.reach, self.body, self.medium)

    @cached_property
    def periodic(self) -> bool:
        """Return True if all torques in the scene repeat when the angle grows by a whole turn."""
        return all(effect.periodic for effect in self.effects)

    @cached_property
    def coefficients(self) -> Mapping[str, float]:
        """Return all coefficients that the effects' functions take, by name, per moment of inertia; they cannot be
        changed.

        Raises SceneError if two effects have a coefficient of one name, or if a coefficient cannot be derived.
        """
        coefficients: dict[str, float] = {}
        for effect in self.effects:
            for name, value in effect.coefficients(self).items():
                named(name, f"The name of a coefficient of {effect.name}")
                if name in coefficients:
                    raise SceneError(f"Two effects of the scene '{self.name}' have a coefficient named {name}; "
                                     "rename one of them.")
                coefficients[name] = value
        return MappingProxyType(coefficients)

    def of_kind(self, kind: str) -> tuple[Effect, ...]:
        """Return the effects of one kind; SceneError, with the nearest kind, for an unknown kind of :class:`Effect`."""
        one_of(kind, "kind of effect", get_args(Kind))
        return tuple(effect for effect in self.effects if effect.kind == kind)

    def has(self, name: str) -> bool:
        """Return True if the scene has an effect of this name; SceneError for a name that is not text."""
        if not isinstance(name, str):
            raise SceneError(f"An effect's name must be text, not {shown(name)}.")
        return any(effect.name == name for effect in self.effects)

    def __repr__(self) -> str:
        return f"Scene({', '.join(self._changed())})"

    def equation(self, as_latex: bool = False) -> str:
        """Return the equation of motion with its numbers [rad, s], as text or as LaTeX without dollar signs.

        Raises SceneError where ``as_latex`` is not True or False.
        """
        text = equation_text(self.effects, self.coefficients)
        return latex(text) if boolean(as_latex, "as_latex") else text

    def describe(self) -> str:
        """Return a description of the scene in words and numbers with units, one line for each part and effect."""
        return "\n".join(_description(self))

    # --- changes ------------------------------------------------------------------------------------------------

    def parameters(self) -> dict[str, float | str | None]:
        """Return every parameter that can be changed by name, as in ``gym.make(..., length=0.5)``, with its value.

        A name that two effects share is listed, and changed, as ``effect.parameter``.
        """
        parts = {name: getattr(self, name) for name, _ in PARTS}
        effects = {effect.name: effect for effect in self.effects}
        return {"gravity": self.gravity, **data.numbers_by_name({**parts, **effects})}

    def replace(self, **changes: Any) -> Scene:
        """Return a scene with parts (``run=...``) or single parameters (``length=0.5``) changed.

        Parts may be given as dicts, as in ``to_dict``. A parameter's name may have the part or effect in front, as in
        ``replace(**{"linear_drag.gamma": 0.1})``; this is required where two effects share the name. Parts are changed
        first, and only the resulting scene is checked. Raises SceneError for a name that the scene does not have.
        """
        values = {f.name: changes.pop(f.name, getattr(self, f.name)) for f in fields(self)}
        for name, kind in PARTS:
            values[name] = data.part_of(values[name], kind, f"A scene's {name}")
        effects = data.effects_of(values["effects"])
        owners = {**{name: values[name] for name, _ in PARTS}, **{effect.name: effect for effect in effects}}
        mine = data.assigned(changes, owners, self.name)
        changed = {name: dataclasses.replace(owners[name], **own) for name, own in mine.items()}
        parts = {name: changed.get(name, values[name]) for name, _ in PARTS}
        new = tuple(changed.get(effect.name, effect) for effect in effects)
        return dataclasses.replace(self, **{**values, **parts, "effects": new})

    def with_effects(self, effects: Iterable[Effect]) -> Scene:
        """Return a copy of the scene with the given effects in place of its own."""
        return dataclasses.replace(self, effects=data.listed(effects))

    # --- as data ------------------------------------------------------------------------------------------------

    def to_dict(self) -> dict[str, Any]:
        """Return the scene as a dict that JSON can hold; ``Scene.from_dict`` restores an equal scene."""
        return {
            "name": self.name,
            "body": body_data(self.body),
            "medium": dataclasses.asdict(self.medium),
            "effects": [{"effect": effect.name, **dataclasses.asdict(effect)} for effect in self.effects],  # type: ignore[call-overload]
            "gravity": self.gravity,
            "run": dataclasses.asdict(self.run),
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Scene:
        """Return the scene of a dict from ``to_dict``.

        Missing values have their defaults; "provenance" is for readers and ignored. Raises SceneError for unknown
        names, with the nearest one.
        """
        if isinstance(values, Mapping):
            values = {name: value for name, value in values.items() if name != data.PROVENANCE}
        given = data.known(values, cls, "A scene")
        for name, kind in PARTS:
            if name in given:
                given[name] = data.part_of(given[name], kind, f"A scene's {name}")
        if "effects" in given:
            given["effects"] = data.effects_of(given["effects"])
        return cls(**given)

    def save(self, path: str | Path, provenance: Mapping[str, str] | None = None) -> None:
        """Write the scene as a JSON file, completely or not at all.

        ``provenance`` is a dict of texts, free notes on where the scene's numbers come from. Raises SceneError if the
        file cannot be written or ``provenance`` has another form.
        """
        place = file_path(path, "path")
        if not (provenance is None or isinstance(provenance, Mapping)):
            raise SceneError(f"provenance must be a dict of texts, not {shown(provenance)}.")
        facts = {} if provenance is None else {data.PROVENANCE: dict(provenance)}
        try:
            text = json.dumps({**self.to_dict(), **facts}, indent=2)
        except (TypeError, ValueError) as error:
            raise SceneError(f"provenance must hold values that JSON can store: {error}.") from None
        try:
            with replacing(place) as temporary:
                temporary.write_text(f"{text}\n", encoding="utf-8")
        except OutputError as error:
            raise SceneError(str(error)) from None
        except OSError as error:
            raise SceneError(f"The file {place} cannot be written: {error.strerror or error}.") from None

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Scene:
        """Read a scene from a JSON file; SceneError, with the reason, if that is not possible."""
        place = file_path(path, "path")
        label = f"The scene file {place}"
        try:
            text = place.read_text(encoding="utf-8")
        except OSError as error:
            raise SceneError(f"{label} cannot be read: {error.strerror}.") from None
        except ValueError as error:
            raise SceneError(f"{label} is not JSON: {error}.") from None
        return cls.from_dict(data.parse(text, label))


def named(name: Any, label: str) -> None:
    """Raise SceneError for a name that cannot be one in a program."""
    if not isinstance(name, str) or not name.isidentifier() or iskeyword(name):
        raise SceneError(f"{label} must be a name in Python, such as cubic_drag, not {shown(name)}.")


# --- in words ---------------------------------------------------------------------------------------------------


def _description(scene: Scene) -> Iterator[str]:
    """Yield the lines of the description of a scene in words and numbers, one line for each part and effect."""
    yield f"{scene.name}: {scene.equation()}"
    shape = "" if type(scene.body) is Body else f"{scene.body.shape}, "
    yield f"body: {shape}{_values(scene.body)}"
    yield f"medium: {scene.medium.name}{'' if scene.medium.empty else f', {_values(scene.medium)}'}"
    yield f"inertia I = {scene.inertia:.6g} kg m^2 about the pivot; gravity {scene.gravity:.6g} m/s^2"
    if scene.omega0:
        yield f"small swings: omega0 = {scene.omega0:.6g} rad/s, period {2.0 * math.pi / scene.omega0:.6g} s"
    for effect in scene.effects:
        notes = (first_line(type(effect)), _values(effect), ", ".join(_changes(scene, effect)))
        yield f"{effect.name}: {'; '.join(filter(None, notes))}"
    run = scene.run
    yield (
        f"usual run: from {math.degrees(run.angle):.6g} degrees at {run.velocity:.6g} rad/s, "
        f"{run.duration:.6g} s in steps of {run.dt:.6g} s"
    )


def _values(part: Any) -> str:
    """Return the values of a scene's part or effect as text with units; its name and values None are left out."""
    values = ((f, getattr(part, f.name)) for f in fields(part) if f.name != "name")
    return ", ".join(f"{f.name} {_value(x, f.metadata.get('unit', ''))}" for f, x in values if x is not None)


def _value(value: Any, unit: str) -> str:
    """Return the value of a scene's parameter as text, numbers to six digits and with their unit."""
    if isinstance(value, float):
        return f"{value:.6g}{'' if unit in ('', '1') else f' {unit}'}"
    return str(value).lower() if isinstance(value, bool) else str(value)


def _changes(scene: Scene, effect: Any) -> Iterator[str]:
    """Yield, as text, the contributions of an effect to a scene's moment of inertia and to the weight's torque."""
    inertia, weight = effect.inertia(scene), effect.weight_moment(scene)
    if inertia:
        yield f"{inertia:+.4g} kg m^2 to the inertia, {100.0 * inertia / scene.inertia:.3g} % of it"
    if weight:
        yield f"{weight * scene.gravity:+.4g} N m to the weight's torque at 90 degrees"
