"""What an effect is: its parameters, its torque, and what else is known of it.

``I theta'' = sum of torques``. An effect's functions are plain functions of floats, without decorators; they are
copied into the generated step, compiled or interpreted, so they may use only arithmetic, ``abs`` and
:mod:`pendulum_env.physics.elementary`. Their arguments are found by name: ``time`` [s], ``angle`` [rad],
``velocity`` [rad/s], ``control`` [1], ``duration`` [s], ``spread`` [rad], and the effect's own coefficients; and, for
what must be accurate next to the top, ``tilt`` and ``side`` in place of ``angle``: the angle from the nearer of bottom
and top, and +1 or -1, so that sin(angle) = side sin(tilt). All of them give values per moment of inertia, so that a
torque is an angular acceleration [rad/s²] and an energy is in J/(kg m²).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, ClassVar, Literal

from pendulum_env.physics.units import Checked

if TYPE_CHECKING:
    from pendulum_env.physics.scene import Scene

Kind = Literal["conservative", "dissipative", "drive"]
Function = Callable[..., float]


class Effect(Checked):
    """Base of all effects; subclasses are frozen dataclasses of their parameters.

    Attributes:
        name: how scenes, the command line and files call it.
        kind: "conservative" (has a potential), "dissipative" (makes heat) or "drive" (does work).
        damping: for dissipative effects, its name in ``damping="..."``.
        equation: its term in the equation of motion, as text with coefficients to fill in.
        source: where the formula is from.
        torque: the torque; None for dry friction, which is decided from the sum of all others.
        by_angle, by_velocity: derivatives of the torque, left out where they vanish.
        potential: ``torque = -d potential / d angle``.
        mean: for conservative effects whose torque depends on the angle, its mean over the angles from angle - spread
            to angle + spread, in closed form: minus the potential's difference over 2 spread. Left out where unknown.
        mean_by_end: the derivative of ``mean`` by angle plus that by spread.
        flow: exact solution of ``dv/dt = torque`` after ``duration`` at frozen angle, for dissipative effects.
        radial: pull of the bob on its suspension that the effect adds, per ``I/L`` [rad/s²].
        dry: name of the coefficient that bounds the torque of dry friction.
        periodic: False if the torque is not the same after a whole turn.
        exclusive: scenes may hold only one effect of the same (non-empty) group.
    """

    name: ClassVar[str]
    kind: ClassVar[Kind]
    damping: ClassVar[str] = ""
    equation: ClassVar[str]
    source: ClassVar[str]
    torque: ClassVar[Function | None] = None
    by_angle: ClassVar[Function | None] = None
    by_velocity: ClassVar[Function | None] = None
    potential: ClassVar[Function | None] = None
    mean: ClassVar[Function | None] = None
    mean_by_end: ClassVar[Function | None] = None
    flow: ClassVar[Function | None] = None
    radial: ClassVar[Function | None] = None
    dry: ClassVar[str] = ""
    periodic: ClassVar[bool] = True
    exclusive: ClassVar[str] = ""

    def coefficients(self, scene: Scene) -> dict[str, float]:
        """The numbers that the functions take, per moment of inertia; raises SceneError if they can't be had."""
        raise NotImplementedError

    def check(self, scene: Scene) -> None:
        """Raise SceneError if the effect contradicts the rest of the scene."""

    @classmethod
    def summary(cls) -> str:
        """First line of the docstring."""
        return (cls.__doc__ or cls.name).strip().splitlines()[0]
