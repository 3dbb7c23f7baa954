"""Protocols of a scene and of a dissipative effect, as effects and flow numbers use them.

They avoid an import of the scene's module, which imports the effects.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from pendulum_env.physics.body import Body
from pendulum_env.physics.medium import Medium


class Surroundings(Protocol):
    """The part of a scene that its effects use; :class:`pendulum_env.physics.scene.Scene` explains the values."""

    @property
    def name(self) -> str: ...

    @property
    def body(self) -> Body: ...

    @property
    def medium(self) -> Medium: ...

    @property
    def gravity(self) -> float: ...

    @property
    def effects(self) -> tuple[Any, ...]: ...

    @property
    def inertia(self) -> float: ...

    @property
    def weight_moment(self) -> float: ...

    @property
    def mass_moment(self) -> float: ...

    @property
    def omega0(self) -> float: ...

    @property
    def reynolds(self) -> float: ...

    @property
    def coefficients(self) -> dict[str, float]: ...

    def of_kind(self, kind: str) -> tuple[Any, ...]:
        """Return the scene's effects of one kind."""

    def has(self, name: str) -> bool:
        """Return True if the scene has an effect of this name."""


class Loss(Protocol):
    """The part of a dissipative effect that the numbers of the flow use."""

    @property
    def torque(self) -> Callable[..., float] | None: ...

    @property
    def dry(self) -> str: ...

    def coefficients(self, scene: Surroundings) -> dict[str, float]:
        """Return the coefficients that the effect's torque takes."""
