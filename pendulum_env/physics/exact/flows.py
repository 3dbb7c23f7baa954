"""Which effects together have a closed form that takes a step of any length, and its plain function: one table."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from pendulum_env.physics.exact.pendulum_step import pendulum_flow
from pendulum_env.physics.exact.spring_step import damped_spring_flow, spring_flow


@dataclass(frozen=True)
class ExactFlow:
    """A closed form: a plain function of an effect's arguments, as :mod:`pendulum_env.physics.effects.effect` says.

    Attributes:
        function: returns the angle (or tilt) and the velocity after ``duration``, then a heat for each of ``heats``.
        heats: names of the dissipative effects.
    """

    function: Callable[..., tuple[float, ...]]
    heats: tuple[str, ...] = ()


FLOWS: Mapping[frozenset[str], ExactFlow] = MappingProxyType({
    frozenset({"gravity"}): ExactFlow(pendulum_flow),
    frozenset({"small_angle_gravity"}): ExactFlow(spring_flow),
    frozenset({"small_angle_gravity", "linear_drag"}): ExactFlow(damped_spring_flow, ("linear_drag",)),
})
"""Names of all effects of a scene -> the closed form of its motion."""


def flow_of(effects: Iterable[Any]) -> ExactFlow | None:
    """The closed form of a scene with these effects; None where none is known."""
    return FLOWS.get(frozenset(effect.name for effect in effects if effect.kind != "inertia"))
