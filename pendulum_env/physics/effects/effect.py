"""What an effect is: its parameters, its torque, and what else is known of it.

``I theta'' = sum of torques``. An effect's functions are plain functions of floats, without decorators; they are
copied into the generated step, compiled or interpreted, so they may use only arithmetic, ``abs`` and
:mod:`pendulum_env.physics.elementary`. Their arguments are found by name: ``time`` [s], ``angle`` [rad],
``velocity`` [rad/s], ``control`` [1], ``duration`` [s], ``spread`` [rad], the effect's own coefficients and what it
remembers; for what must be accurate next to the top, ``tilt`` and ``side`` in place of ``angle``: the angle from the
nearer of bottom and top, and +1 or -1, so that sin(angle) = side sin(tilt); and, for drag, ``slip`` and ``speed`` in
place of ``velocity``: the bob's velocity relative to the medium along its path, and its size across included, both
over the length [rad/s]. In a still medium, with a pivot at rest, these are ``velocity`` and its absolute value. A drag
is proportional to ``slip`` at a given ``speed``. All functions give values per moment of inertia, so that a torque is
an angular acceleration [rad/s²] and an energy is in J/(kg m²).

Effects of the kind "inertia" have no functions: they change the moment of inertia, the weight or both, and so the
coefficients of others. They cost nothing at run time.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from functools import lru_cache
from typing import ClassVar, Literal

from pendulum_env.physics.surroundings import Surroundings
from pendulum_env.physics.units import Checked

BOBS_DRAG = "the bob's drag"
"""What the laws of drag on the bob are models of."""

Kind = Literal["conservative", "dissipative", "drive", "inertia", "medium"]
Function = Callable[..., float]


@lru_cache(maxsize=256)
def _takes_control(function: Callable[..., object]) -> bool:
    return "control" in inspect.signature(function).parameters


class Effect(Checked):
    """Base of all effects; subclasses are frozen dataclasses of their parameters.

    Attributes:
        name: how scenes, the command line and files call it.
        kind: "conservative" (has a potential), "dissipative" (makes heat), "drive" (does work), "inertia" (changes
            what is moved or what hangs) or "medium" (moves the medium).
        damping: for dissipative effects, its name in ``damping="..."``.
        equation: its term in the equation of motion, as text with coefficients to fill in.
        source: where the formula is from.
        torque: the torque; None for dry friction, which is decided from the sum of all others.
        by_angle, by_velocity: derivatives of the torque, left out where they vanish; for a drag, ``by_velocity`` is
            that by ``velocity`` in a medium at rest.
        by_speed: for drags, ``speed`` times the derivative of the torque by ``speed`` at fixed ``slip``.
        potential: ``torque = -d potential / d angle``.
        mean: for conservative effects whose torque depends on the angle, its mean over the angles from angle - spread
            to angle + spread, in closed form: minus the potential's difference over 2 spread. Left out where unknown.
        mean_by_end: the derivative of ``mean`` by angle plus that by spread.
        flow: exact solution of ``dv/dt = torque`` after ``duration`` at frozen angle, for dissipative effects.
        fade: for drags with a ``flow``, the same in a moving medium: from ``slip``, ``cross`` (the velocity across the
            path) and ``duration`` to what is left of ``slip`` and to the integral of -torque/slip over the time [1].
        wind_x, wind_y: velocity of the medium seen from the pivot, to the right and upwards, over the length [1/s].
        memory: names of what the effect remembers.
        advance: what it remembers in a control step, as a tuple, from ``memory``'s names, ``control``, ``first`` (1.0
            in the first control step, else 0.0) and ``span``, the control step [s]: once, at its start.
        draws: how many of the last in ``memory`` start as whole random numbers from 1 to 4294944442.
        radial: pull of the bob on its suspension that the effect adds, per ``I/L`` [rad/s²]. May take ``gravity_pull``,
            g times the mass that hangs at the bob, per ``I/L``, and ``swing_pull``, the mass that moves there, per
            ``I/L**2``.
        dry: name of the coefficient that bounds the torque of dry friction.
        store: for drives, a function whose slope by angle, at fixed time and control, is minus the torque [1/s²].
        beat: name of the coefficient that is the angular rate of the torque in time [rad/s].
        periodic: False if the torque is not the same after a whole turn.
        exclusive: scenes may hold only one effect of the same (non-empty) group.
        detail: of several models of one thing, see ``models``, that with the higher number is the closer one.
        at_bob: False for the inertia, the weight or the drag of what is not the bob.
        needs_medium: True if there is no such effect in a vacuum.
        number_name: the dimensionless number that says when the effect matters.
        fitted: for dissipative effects, the parameter that a recorded decay can give, to which the torque is
            proportional; "" for those that have none.
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
    by_speed: ClassVar[Function | None] = None
    flow: ClassVar[Function | None] = None
    fade: ClassVar[Callable[..., tuple[float, float]] | None] = None
    wind_x: ClassVar[Function | None] = None
    wind_y: ClassVar[Function | None] = None
    memory: ClassVar[tuple[str, ...]] = ()
    advance: ClassVar[Callable[..., tuple[float, ...]] | None] = None
    draws: ClassVar[int] = 0
    radial: ClassVar[Function | None] = None
    store: ClassVar[Function | None] = None
    dry: ClassVar[str] = ""
    beat: ClassVar[str] = ""
    periodic: ClassVar[bool] = True
    exclusive: ClassVar[str] = ""
    detail: ClassVar[int] = 0
    at_bob: ClassVar[bool] = True
    needs_medium: ClassVar[bool] = False
    number_name: ClassVar[str] = ""
    fitted: ClassVar[str] = ""

    @property
    def controlled(self) -> bool:
        """True for what acts only as far as the control asks for it."""
        return any(_takes_control(function) for function in (type(self).torque, type(self).advance) if function)

    def coefficients(self, scene: Surroundings) -> dict[str, float]:
        """The numbers that the functions take, per moment of inertia; raises SceneError if they can't be had."""
        raise NotImplementedError

    def check(self, scene: Surroundings) -> None:
        """Raise SceneError if the effect contradicts the rest of the scene."""

    def inertia(self, scene: Surroundings) -> float:
        """What it adds to the moment of inertia about the pivot [kg m²]."""
        return 0.0

    def weight_moment(self, scene: Surroundings) -> float:
        """What it adds to the moment of the weight over g [kg m]: mass times distance from the pivot."""
        return 0.0

    def mass_moment(self, scene: Surroundings) -> float:
        """What it adds to mass times distance from the pivot, of all that a moving pivot has to carry along [kg m]."""
        return 0.0

    def number(self, scene: Surroundings, amplitude: float) -> float:
        """The dimensionless number of ``number_name`` in a swing of this amplitude [rad]; nan without one."""
        return math.nan

    def predicted(self, scene: Surroundings, amplitude: float) -> tuple[float, float]:
        """The textbook's relative change of the period, and of the amplitude in a half swing; nan where unknown.

        The period is that of small oscillations, but for what the effect itself makes of the amplitude.
        """
        return math.nan, math.nan

    def pivot(self, time: float) -> tuple[float, float]:
        """How far it has moved the pivot to the right and upwards at a time [m]."""
        return 0.0, 0.0

    @property
    def sway(self) -> tuple[float, float]:
        """The farthest that ``pivot`` goes to either side, and up and down [m]."""
        return 0.0, 0.0

    def outside(self, scene: Surroundings, speed: float) -> str:
        """Why its formula does not hold up to this velocity of the bob [m/s], and what it does then; "" if it does."""
        return ""

    @property
    def models(self) -> str:
        """What it is one of several models of, such as "the bob's drag"; "" if nothing else may stand in its place."""
        return self.exclusive

    @classmethod
    def trial(cls, scene: Surroundings) -> Effect | None:
        """The effect as the scene's geometry and medium alone determine it; None where these can't."""
        return None

    @classmethod
    def summary(cls) -> str:
        """First line of the docstring."""
        return (cls.__doc__ or cls.name).strip().splitlines()[0]
