"""Table of the combinations of effects whose motion over a step of any length has a closed form."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from pendulum_env.physics.exact.pendulum_step import pendulum_flow
from pendulum_env.physics.exact.spring_step import damped_fibre_flow, damped_spring_flow, fibre_flow, spring_flow


@dataclass(frozen=True)
class ExactFlow:
    """A closed form of a step: a plain function whose arguments have the names explained in
    :mod:`pendulum_env.physics.effects.effect`.

    Attributes:
        function: returns the angle (or tilt) and the velocity after ``duration``, then the heat of each effect named in
            ``heats``.
        heats: names of the dissipative effects.
    """

    function: Callable[..., tuple[float, ...]]
    heats: tuple[str, ...] = ()


FLOWS: Mapping[frozenset[str], ExactFlow] = MappingProxyType({
    frozenset({"gravity"}): ExactFlow(pendulum_flow),
    frozenset({"small_angle_gravity"}): ExactFlow(spring_flow),
    frozenset({"small_angle_gravity", "linear_drag"}): ExactFlow(damped_spring_flow, ("linear_drag",)),
    frozenset({"fibre"}): ExactFlow(fibre_flow),
    frozenset({"fibre", "linear_drag"}): ExactFlow(damped_fibre_flow, ("linear_drag",)),
})
"""Closed form of the motion, by the set of the names of all effects in a scene."""


def flow_of(effects: Iterable[Any]) -> ExactFlow | None:
    """Return the closed form of a step of a scene that has these effects; None if none is known."""
    return FLOWS.get(frozenset(effect.name for effect in effects if effect.kind != "inertia"))
