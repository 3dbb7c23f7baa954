"""Structural types (protocols) of a scene and of a dissipative effect, for the effects and numbers of the flow.

They replace an import of the scene's module, which would be circular because that module imports the effects.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

from pendulum_env.physics.body import RigidBody
from pendulum_env.physics.medium import Medium


class Surroundings(Protocol):
    """Protocol of the attributes of a scene that effects use; :class:`pendulum_env.physics.scene.Scene` explains them.
    """

    @property
    def name(self) -> str: ...

    @property
    def body(self) -> RigidBody: ...

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
    def restoring(self) -> float: ...

    @property
    def omega0(self) -> float: ...

    @property
    def reynolds(self) -> float: ...

    @property
    def coefficients(self) -> Mapping[str, float]: ...

    def of_kind(self, kind: str) -> tuple[Any, ...]:
        """Return the scene's effects of one kind, such as "dissipative"."""

    def has(self, name: str) -> bool:
        """Return True if the scene has an effect of this name."""


class Loss(Protocol):
    """Protocol of the attributes of a dissipative effect from which quality factor and other numbers are calculated."""

    @property
    def torque(self) -> Callable[..., float] | None: ...

    @property
    def dry(self) -> str: ...

    @property
    def memory(self) -> tuple[str, ...]: ...

    def coefficients(self, scene: Surroundings) -> dict[str, float]:
        """Return the coefficients that the effect's torque takes."""
