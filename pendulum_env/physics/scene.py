"""A scene: the apparatus, the medium, the effects it calls for, and its usual run."""

from __future__ import annotations

import dataclasses
import json
import math
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import EFFECTS, Effect
from pendulum_env.physics.flow import reynolds_number
from pendulum_env.physics.medium import VACUUM, Medium
from pendulum_env.physics.units import Checked, SceneError, UnknownParameterError, nearest, si, text


@dataclass(frozen=True)
class Run(Checked):
    """A scene's usual run: used as defaults only."""

    angle: float = si(0.5, "rad", "release angle from the downward vertical")
    velocity: float = si(0.0, "rad/s", "release velocity")
    dt: float = si(0.01, "s", "integrator's step", above=0.0)
    duration: float = si(10.0, "s", "length of the run", above=0.0)


BOB, USUAL = Body(), Run()
"""What a scene has unless it says otherwise."""

PARTS: tuple[tuple[str, type], ...] = (("body", Body), ("medium", Medium), ("run", Run))
"""Parts of a scene that are dataclasses of their own."""


@dataclass(frozen=True)
class Scene(Checked):
    """What is simulated: ``I theta'' = sum of the effects' torques``, and nothing that is not listed.

    Attributes:
        name: for titles and files.
        body: bob and suspension.
        medium: what it swings in.
        effects: the effects that the scene calls for.
        gravity: gravitational acceleration [m/s²].
        run: the usual run.

    Raises SceneError for values out of range, also those that follow (inertia, coefficients), and for contradictions:
    two effects of one kind, two gravities, a motor on a wire, drag that nothing determines.
    """

    name: str = "custom"
    body: Body = BOB
    medium: Medium = VACUUM
    effects: tuple[Effect, ...] = ()
    gravity: float = si(9.81, "m/s^2", "gravitational acceleration", least=0.0)
    run: Run = USUAL

    def __post_init__(self) -> None:
        super().__post_init__()
        text(self.name, "A scene's name")
        _check_parts(vars(self))
        object.__setattr__(self, "effects", checked_effects(self.effects))
        groups = [effect.exclusive or effect.name for effect in self.effects]
        for group in groups:
            if groups.count(group) > 1:
                raise SceneError(f"A scene can hold only one effect of the kind '{group}', not {groups.count(group)}.")
        self._check_numbers()

    def _check_numbers(self) -> None:
        """Raise SceneError if the effects contradict the scene, or what follows from its numbers is out of range."""
        try:
            weight, own = self.weight_moment, self.body.mass * self.body.length
            if weight <= 0.0 < own:
                raise SceneError(
                    f"The bob of {self.body.mass:g} kg would float in {self.medium.name}, where it displaces "
                    f"{self.medium.density * self.body.volume:g} kg; a pendulum has to hang."
                )
            if not sys.float_info.min <= self.inertia < math.inf:
                least, most = sys.float_info.min, sys.float_info.max
                raise SceneError(
                    f"The moment of inertia, mass times length squared, must be between {least:.3g} and {most:.3g} "
                    f"kg m^2, not {self.inertia!r}."
                )
            for effect in self.effects:
                effect.check(self)
            found = {"omega0": self.omega0, **self.coefficients}
        except ArithmeticError as error:
            raise SceneError(f"The coefficients of the scene '{self.name}' are out of range: {error}.") from None
        for name, value in found.items():
            if not math.isfinite(value):
                raise SceneError(f"The coefficient {name} of the scene '{self.name}' must be finite, not {value!r}.")

    # --- derived quantities -------------------------------------------------------------------------------------

    @property
    def inertia(self) -> float:
        """Moment of inertia about the pivot, of the bob at its centre and what the effects add [kg m²]."""
        return self.body.inertia + sum(effect.inertia(self) for effect in self.effects)

    @property
    def weight_moment(self) -> float:
        """Mass times distance from the pivot, as the weight has it: ``m L`` and what the effects add [kg m]."""
        return self.body.mass * self.body.length + sum(effect.weight_moment(self) for effect in self.effects)

    @property
    def mass_moment(self) -> float:
        """Mass times distance from the pivot of all that a moving pivot carries along [kg m]."""
        return self.body.mass * self.body.length + sum(effect.mass_moment(self) for effect in self.effects)

    @property
    def omega0(self) -> float:
        """Small-angle angular frequency ``sqrt(g weight_moment / I)`` [1/s]."""
        return math.sqrt(self.gravity * self.weight_moment / self.inertia)

    @property
    def bottom_velocity(self) -> float:
        """Velocity at the bottom in the usual run without losses [rad/s]."""
        height = 2.0 * math.sin(0.5 * self.run.angle) ** 2
        return math.sqrt(self.run.velocity**2 + 2.0 * self.omega0**2 * height)

    @property
    def reynolds(self) -> float:
        """Reynolds number of the bob at the bottom in the usual run; 0 in vacuum."""
        return reynolds_number(self.bottom_velocity * self.body.length, self.body, self.medium)

    @property
    def periodic(self) -> bool:
        """True if the torques are the same after a whole turn."""
        return all(effect.periodic for effect in self.effects)

    @property
    def coefficients(self) -> dict[str, float]:
        """Every number that the effects' functions take, per moment of inertia."""
        found: dict[str, float] = {}
        for effect in self.effects:
            for name, value in effect.coefficients(self).items():
                if name in found:
                    raise SceneError(f"Two effects of the scene '{self.name}' have a coefficient named {name}.")
                found[name] = value
        return found

    def of_kind(self, kind: str) -> tuple[Effect, ...]:
        """The effects of one kind: "conservative", "dissipative" or "drive"."""
        return tuple(effect for effect in self.effects if effect.kind == kind)

    def has(self, name: str) -> bool:
        """True if an effect of this name is in the scene."""
        return any(effect.name == name for effect in self.effects)

    def equation(self) -> str:
        """The equation of motion with its numbers, as text [rad, s]."""
        return equation_of(effect.equation.format(**effect.coefficients(self)) for effect in self.effects)

    # --- changes ------------------------------------------------------------------------------------------------

    def parameters(self) -> dict[str, float | str | None]:
        """Every single number that can be changed by name, as in ``gym.make(..., length=0.5)``."""
        return {"gravity": self.gravity, **_numbers((self.body, self.medium, *self.effects))}

    def replace(self, **changes: Any) -> Scene:
        """A scene with parts (``run=...``) or single parameters (``length=0.5``) changed.

        Parts are changed first, and only the result has to make sense. Raises SceneError for a name that the scene
        does not have.
        """
        values = {f.name: changes.pop(f.name, getattr(self, f.name)) for f in fields(self)}
        _check_parts(values)
        effects = checked_effects(values["effects"])
        known = ["gravity", *_numbers((values["body"], values["medium"], *effects))]
        for name in changes:
            if name not in known:
                raise UnknownParameterError(
                    f"unexpected keyword argument '{name}': the scene '{self.name}' has no parameter '{name}'"
                    f"{nearest(name, known)}"
                )

        def changed(part: Any) -> Any:
            own = {f.name for f in fields(part)} & set(changes)
            return dataclasses.replace(part, **{name: changes[name] for name in own}) if own else part

        parts = {name: changed(values[name]) for name in ("body", "medium")}
        return dataclasses.replace(self, **{**values, **parts, "effects": tuple(changed(effect) for effect in effects)})

    def with_effects(self, effects: Iterable[Effect]) -> Scene:
        """The same scene with other effects."""
        return dataclasses.replace(self, effects=tuple(effects))

    # --- as data ------------------------------------------------------------------------------------------------

    def to_dict(self) -> dict[str, Any]:
        """JSON-able form; ``Scene.from_dict`` restores an equal scene."""
        return {
            "name": self.name,
            "body": dataclasses.asdict(self.body),
            "medium": dataclasses.asdict(self.medium),
            "effects": [{"effect": effect.name, **dataclasses.asdict(effect)} for effect in self.effects],  # type: ignore[call-overload]
            "gravity": self.gravity,
            "run": dataclasses.asdict(self.run),
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Scene:
        """The scene that ``to_dict`` described; SceneError for unknown names, with the nearest one."""
        values = _known(data, cls, "A scene")
        for name, kind in PARTS:
            if name in values:
                values[name] = kind(**_known(values[name], kind, f"A scene's {name}"))
        if "effects" in values:
            values["effects"] = tuple(_effect(entry) for entry in _listed(values["effects"]))
        return cls(**values)

    def save(self, path: str | Path) -> None:
        """Write the scene as a JSON file."""
        Path(path).write_text(json.dumps(self.to_dict(), indent=2) + "\n", encoding="utf-8")

    @classmethod
    def load(cls, path: str | Path) -> Scene:
        """Read a scene's JSON file; SceneError says what is wrong with it."""
        try:
            data = json.loads(Path(path).read_text(encoding="utf-8"))
        except OSError as error:
            raise SceneError(f"The scene file {path} cannot be read: {error.strerror}.") from None
        except ValueError as error:
            raise SceneError(f"The scene file {path} is not JSON: {error}.") from None
        return cls.from_dict(data)


def checked_effects(effects: Any) -> tuple[Effect, ...]:
    """The effects as a tuple; SceneError if they are none."""
    found = _listed(effects)
    for effect in found:
        if not isinstance(effect, Effect):
            raise SceneError(f"A scene's effects must be Effect instances, not {effect!r}.")
    return found


def _listed(effects: Any) -> tuple[Any, ...]:
    if isinstance(effects, (str, bytes, Mapping)) or not isinstance(effects, Iterable):
        raise SceneError(f"A scene's effects must be a list of effects, not {effects!r}.")
    return tuple(effects)


def _check_parts(values: Mapping[str, Any]) -> None:
    for name, kind in PARTS:
        if not isinstance(values[name], kind):
            raise SceneError(f"A scene's {name} must be a {kind.__name__}, not {values[name]!r}.")


def _numbers(parts: Iterable[Any]) -> dict[str, Any]:
    """Values of the parts by name, names of parts left out."""
    return {f.name: getattr(part, f.name) for part in parts for f in fields(part) if f.name != "name"}


def equation_of(terms: Iterable[str]) -> str:
    """The equation of motion as text, from signed terms such as "- 9.81 sin(theta)"."""
    total = " ".join(filter(None, terms)).removeprefix("+ ") or "0"
    return f"theta'' = {'-' + total[2:] if total.startswith('- ') else total}"


def _known(data: Any, kind: type, what: str) -> dict[str, Any]:
    """``data`` as keyword arguments of a dataclass, unknown names refused."""
    if not isinstance(data, Mapping):
        raise SceneError(f"{what} must be given by a dict of its values, not {data!r}.")
    names = [f.name for f in fields(kind) if f.init]
    for name in data:
        if name not in names:
            raise SceneError(f"{what} has no value '{name}'{nearest(name, names)}")
    return dict(data)


def _effect(entry: Any) -> Effect:
    if not isinstance(entry, Mapping) or "effect" not in entry:
        raise SceneError(f"An effect must be given by a dict with its name under 'effect', not {entry!r}.")
    name = entry["effect"]
    if not isinstance(name, str) or name not in EFFECTS:
        raise SceneError(f"There is no effect '{name}'{nearest(name, EFFECTS)}")
    rest = {key: value for key, value in entry.items() if key != "effect"}
    return EFFECTS[name](**_known(rest, EFFECTS[name], f"The effect {name}"))
