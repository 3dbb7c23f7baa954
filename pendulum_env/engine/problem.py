"""The class :class:`Problem`: an equation of motion with a method, from which a program is generated.

All torques and energies are divided by the moment of inertia. A problem holds no parameter values, which are arguments
of the generated program: scenes that differ only in parameter values have equal problems and share one program.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from types import FunctionType
from typing import Any

from integrators import Method
from pendulum_env.common.sources import ours
from pendulum_env.engine.reading import arguments
from pendulum_env.engine.shape import WATCHED, Shape
from pendulum_env.engine.source import Plain, with_callees
from pendulum_env.physics.effects import Effect, Gravity
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError

ARGUMENTS = {"time": "t", "angle": "q", "tilt": "q", "velocity": "v", "duration": "h"}
STILL = {"slip": "v", "speed": "abs(v)"}
"""Argument names of effects -> their source in a step, if they differ; STILL: further ones in a medium at rest."""

AT_REST = "0.0"
"""Source of the velocity of a bob at rest."""
WHOLE_ANGLE = "(q + 1.5707963267948966*(1.0 - side))"
"""Source of the angle from the bottom in periodic scenes; their ``q`` is that from the nearer of bottom and top."""

HALF_SINE = "sin(0.5*q)"
"""Source of the sine of half the angle where it is not wrapped."""


@dataclass(frozen=True)
class Problem:
    """A scene's equation of motion with a method and the requested diagnostics.

    Attributes:
        effects: the scene's effects, in its order; not compared, so that problems with equal ``parts`` are equal.
        parts: everything of the scene that enters a program's text; see :func:`program_parts`.
        method: the integration method.
        diagnostics: names of the quantities reported beside the motion.
        shape: names of arguments, quadratures and reported quantities of the program.
        windy: True if there is drag in a medium that moves.
        torques: the effects that have a torque; ``drives`` and ``drags`` are the driving and the dissipative ones among
            them. Dry friction has no torque.
        heats: name of a dissipative effect -> name of the quadrature (integral along a step) of its heat.
        refines: True for a program that also has one step of Newton's method for every implicit stage.
    """

    effects: tuple[Effect, ...] = field(compare=False)
    parts: tuple[Any, ...]
    method: Method
    diagnostics: tuple[str, ...]
    shape: Shape
    windy: bool
    torques: list[Effect] = field(compare=False)
    drives: list[Effect] = field(compare=False)
    drags: list[Effect] = field(compare=False)
    heats: dict[str, str] = field(compare=False)
    refines: bool = False

    @property
    def dry(self) -> Effect | None:
        """Return the scene's effect with dry friction, or None."""
        return next((effect for effect in self.effects if effect.dry), None)

    @property
    def flows(self) -> list[Effect]:
        """Return the effects whose torque, or its part that depends on the velocity, splitting methods solve exactly.

        They are the drags, and motors that turn slower under load.
        """
        return [effect for effect in self.torques if by_flow(effect)]

    @property
    def held(self) -> bool:
        """Return True if moving air works on a bob that dry friction holds, and this work is reported."""
        return self.shape.slides and self.windy and bool(self.shape.quadratures)

    @property
    def title(self) -> str:
        """Return a name of the program for file names and messages: effects, method and diagnostics."""
        names = "+".join(effect.name for effect in self.effects) or "nothing"
        shape = self.shape
        ending = "".join(f"-{word}" for word in ("adaptive", "even", "compensated") if getattr(shape, word))
        return f"{names}-{self.method.name}-{'+'.join(self.diagnostics) or 'bare'}{ending}"

    def heat_of(self, effect: Effect | None) -> str:
        """Return the name of the quadrature (integral along a step) of an effect's heat.

        It is "" if the effect has no heat or if the diagnostics do not include heat.
        """
        return "" if effect is None else self.heats.get(effect.name, "")

    # --- text -------------------------------------------------------------------------------------------------------

    def call(self, function: Plain, **renamed: str) -> str:
        """Write the source of a call of an effect's function.

        ``renamed`` maps names of its arguments to the source of other values.
        """
        whole = {"angle": WHOLE_ANGLE} if self.shape.periodic else {"side": "1.0", "half_sine": HALF_SINE}
        names = {**ARGUMENTS, **({} if self.windy else STILL), **whole, **renamed}
        return f"{function.__name__}({', '.join(names.get(name, name) for name in arguments(function))})"

    def sum_of(self, effects: Iterable[Effect], *roles: str, **renamed: str) -> str:
        """Write the source of a sum over effects.

        The term of an effect is the call of its first function among ``roles``, such as "torque"; the sum of no terms
        is "0.0". ``renamed`` is that of :meth:`call`.
        """
        having = ([getattr(effect, role) for role in roles if getattr(effect, role)] for effect in effects)
        return " + ".join(self.call(functions[0], **renamed) for functions in having if functions) or "0.0"

    def define(self, name: str, first: str, body: Sequence[str], extra: Sequence[str] | None = None) -> str:
        """Write the source of a function with the arguments ``first`` and ``extra``.

        By default ``extra`` holds the arguments that torque functions take beside time, angle and velocity.
        """
        more = "".join(f", {name}" for name in (self.shape.extra if extra is None else extra))
        return f"@inline\ndef {name}({first}{more}):\n" + "".join(f"    {line}\n" for line in body)


def problem_of(
    scene: Scene, method: Method, diagnostics: tuple[str, ...] = ("energy",), adaptive: bool = False,
    compensated: bool = False, refines: bool = False, even: bool = False,
) -> Problem:
    """Return the Problem of a scene with a method, from which programs are generated.

    The diagnostic "error" is left out, because it needs a second run.

    Raises SceneError for the diagnostic "flow" in a medium with density but without viscosity, and for a body without a
    width across the flow.
    """
    if "flow" in diagnostics and scene.medium.density and not scene.medium.viscosity:
        raise SceneError(
            f"The diagnostic 'flow' needs a viscosity, but that of the medium '{scene.medium.name}' is 0; set it above "
            "0, or leave 'flow' out."
        )
    if "flow" in diagnostics and (reason := scene.body.lacks.get("flow")):
        raise SceneError(f"The diagnostic 'flow' has no meaning for the body '{scene.body.shape}', because {reason}; "
                         "leave 'flow' out.")
    diagnostics = tuple(name for name in diagnostics if name != "error")
    effects, windy = scene.effects, moving(scene.effects)
    torques = [effect for effect in effects if effect.torque]
    drives = [effect for effect in torques if effect.kind == "drive"]
    drags = [effect for effect in torques if effect.kind == "dissipative"]
    works = windy or bool(drives)
    accounts = not {"energy", "heat_by_effect"}.isdisjoint(diagnostics)
    losses = [effect.name for effect in effects if effect.kind == "dissipative"] if accounts else []
    heats = {name: f"heat_{name}" if "heat_by_effect" in diagnostics else "heat" for name in losses}
    quadratures = (*(("work",) if works and accounts else ()), *dict.fromkeys(heats.values()))
    parameters, side = tuple(scene.coefficients), ("side",) if scene.periodic else ()
    control = ("control",) if any(effect.controlled for effect in effects) else ()
    held = [name for effect in effects for name in effect.memory if name in _taken(effect)]
    dry = next((effect.dry for effect in effects if effect.dry), "")
    clip = next((effect.limit for effect in effects if effect.limit), "")
    slack = scene.body.suspension == "wire" and (windy or any(map(may_push, effects)))
    shape = Shape(
        parameters=parameters, place=(*parameters, *side), extra=(*parameters, *side, *control, *held),
        quadratures=quadratures, memory=() if adaptive else method.memory_with(quadratures),
        dry=dry, slides=bool(dry) and not method.sub_flows, periodic=scene.periodic,
        slack=slack, lenient=slack and scene.body.slack == "warn",
        weighed=slack and scene.periodic and not windy and [e.radial for e in effects if e.radial] == [Gravity.radial],
        ledger="energy" in diagnostics, by_effect="heat_by_effect" in diagnostics,
        adaptive=adaptive, compensated=compensated, even=even,
        watched=tuple(name for asked in diagnostics for name in WATCHED.get(asked, ())),
        remembered=tuple(name for effect in effects for name in effect.memory),
        clip=clip, drift=float(method.last_drift) if clip and method.last_drift else 0.0,
        drawn=tuple(name for effect in effects if effect.draws for name in effect.memory[-effect.draws:]),
    )
    return Problem(effects, program_parts(scene), method, diagnostics, shape, windy, torques, drives, drags, heats,
                   refines)


def program_parts(scene: Scene) -> tuple[Any, ...]:
    """Return everything of a scene that enters a generated program's text: its effects and options, but no numbers.

    In a notebook a user may define a function or a constant anew that the functions of an effect use.
    """
    effects = tuple(tuple(getattr(effect, role, None) for role in Effect.__annotations__) for effect in scene.effects)
    used = [one for roles in effects for one in roles if isinstance(one, FunctionType) and not ours(one)]
    further = tuple(with_callees(used)) if used else ()
    words = tuple(value for value in vars(scene.body).values() if isinstance(value, str))
    return effects, words, tuple(scene.coefficients), further


# --- questions about effects ----------------------------------------------------------------------------------------


def by_flow(effect: Effect) -> bool:
    """Return True if splitting methods solve an effect's torque, or its part that depends on the velocity, exactly."""
    return effect.torque is not None and (effect.kind == "dissipative" or effect.flow is not None)


def slipping(effect: Effect) -> bool:
    """Return True if an effect is a drag that acts on the velocity relative to the medium, such as air resistance."""
    return effect.torque is not None and "slip" in arguments(effect.torque)


def moving(effects: Iterable[Effect]) -> bool:
    """Return True if the effects include both a moving medium, such as a wind, and a drag in it."""
    effects = tuple(effects)
    return any(effect.wind_x or effect.wind_y for effect in effects) and any(map(slipping, effects))


def timed(effects: Iterable[Effect]) -> list[Effect]:
    """Return the effects whose torques depend on the time."""
    return [effect for effect in effects if effect.torque and "time" in arguments(effect.torque)]


def may_push(effect: Effect) -> bool:
    """Return True if an effect can push the bob towards the pivot, so that a wire may go slack.

    That is possible if its radial force depends on angle or time.
    """
    return effect.radial is not None and not {"angle", "tilt", "time"}.isdisjoint(arguments(effect.radial))


def _taken(effect: Effect) -> set[str]:
    """Return the names of the arguments that an effect's torque and wind functions take."""
    return {name for role in (effect.torque, effect.wind_x, effect.wind_y) if role for name in arguments(role)}
