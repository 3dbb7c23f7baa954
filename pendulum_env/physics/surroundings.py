"""What an effect may ask of the scene that it is in.

Effects and the numbers of the flow take their scene as :class:`Surroundings`, so that they need not import the scene,
which imports them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from pendulum_env.physics.body import Body
from pendulum_env.physics.medium import Medium


class Surroundings(Protocol):
    """A scene as its effects see it: :class:`pendulum_env.physics.scene.Scene` is one, and says what each is."""

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
        """Return the effects of one kind."""

    def has(self, name: str) -> bool:
        """Tell whether an effect of this name is in the scene."""


class Loss(Protocol):
    """A dissipative effect as the numbers of the flow see it."""

    @property
    def torque(self) -> Callable[..., float] | None: ...

    @property
    def dry(self) -> str: ...

    def coefficients(self, scene: Surroundings) -> dict[str, float]:
        """Return the numbers that the torque takes."""
