"""The base class of effects: parameters, torque, and further functions and facts that methods and studies use.

``I theta'' = sum of torques``. An effect's functions are plain functions of floats, without decorators; they are
copied into the generated step, compiled or interpreted, so they may use only arithmetic, ``abs`` and
:mod:`pendulum_env.physics.elementary`. Their arguments are matched by name: ``time`` [s], ``angle`` [rad],
``velocity`` [rad/s], ``control`` [1], ``duration`` [s], ``spread`` [rad], the effect's own coefficients and the names
in its ``memory``. Two pairs replace these where needed. ``tilt`` and ``side`` replace ``angle`` where accuracy near the
top matters: the angle from the nearer of bottom and top, and +1 or -1, so that sin(angle) = side sin(tilt). A potential
may take ``half_sine`` = sin(tilt/2) in place of ``tilt``, which the observation needs, too. ``slip``
and ``speed`` replace ``velocity`` in drags: the bob's velocity relative to the medium along its path, and the size of
the whole relative velocity, with the part across the path, both over the length [rad/s]. In a still medium, with a
pivot at rest, these are ``velocity`` and its absolute value. A drag is proportional to ``slip`` at a given ``speed``.
All functions return values per moment of inertia, so that a torque is an angular acceleration [rad/s²] and an energy is
in J/(kg m²).

Before a user's effect is used, what it declares is compared with its torque (:mod:`pendulum_env.physics.consistency`).

Effects of the kind "inertia" have no functions: they change the moment of inertia, the weight or both, and so the
coefficients of others. They cost nothing at run time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from typing import ClassVar, Literal

from pendulum_env.physics.consistency import stiffness_at_rest
from pendulum_env.physics.surroundings import Surroundings
from pendulum_env.physics.units import Checked

BOBS_DRAG = "the bob's drag"
"""Group of all effects that model the drag on the bob; a scene needs only one of them."""

GRAVITY = "gravity"
"""Group of the effects of the weight; a scene has at most one of them."""
WEIGHT = "weight"
"""Value of :attr:`Effect.needs` for effects that act through the centre of mass."""

Kind = Literal["conservative", "dissipative", "drive", "inertia", "medium", "limit"]
Function = Callable[..., float]


class Effect(Checked):
    """Base of all effects; subclasses are frozen dataclasses of their parameters.

    Attributes:
        name: the effect's name in scenes, files and on the command line.
        kind: "conservative" (has a potential), "dissipative" (makes heat), "drive" (does work), "inertia" (changes
            the moment of inertia or the weight), "medium" (moves the medium) or "limit" (clips the velocity).
        damping: for dissipative effects, the name in ``damping="..."``.
        equation: the effect's term in the equation of motion, as text with coefficients to fill in.
        source: source of the formula.
        torque: the torque; None for dry friction, which depends on the sum of all other torques.
        by_angle, by_velocity: derivatives of the torque, left out where they vanish; for a drag, ``by_velocity`` is
            the derivative by ``velocity`` in a medium at rest.
        by_speed: for drags, ``speed`` times the derivative of the torque by ``speed`` at fixed ``slip``.
        potential: ``torque = -d potential / d angle``.
        mean: for conservative effects whose torque depends on the angle, the mean torque over the angles from
            angle - spread to angle + spread, in closed form: minus the potential's difference over 2 spread. Left out
            where unknown.
        mean_by_end: the derivative of ``mean`` by angle plus that by spread.
        flow: the exact solution after ``duration``, at fixed angle, of ``dv/dt = torque`` for a dissipative effect, and
            of ``dv/dt = torque - torque at rest`` for a drive whose torque depends on the velocity.
        fade: for drags with a ``flow``, that solution in a moving medium: a function of ``slip``, ``cross`` (the
            velocity across the path) and ``duration`` that returns the remaining ``slip`` and the integral of
            -torque/slip over time [1].
        wind_x, wind_y: velocity of the medium relative to the pivot, to the right and upwards, over the length [1/s].
        memory: names of the effect's internal state variables.
        advance: function that returns the new values of ``memory`` as a tuple, called once at the start of a control
            step with the names in ``memory``, ``control``, ``first`` (1.0 in the first control step, else 0.0) and
            ``span``, the duration of the control step [s].
        draws: how many of the last variables in ``memory`` start as whole random numbers from 1 to 4294944442.
        radial: pull of the bob on its suspension that the effect adds, per ``I/L`` [rad/s²]. May take ``gravity_pull``,
            g times the mass that hangs at the bob, per ``I/L``, and ``swing_pull``, the mass that moves there, per
            ``I/L**2``.
        dry: name of the coefficient that bounds the torque of dry friction.
        limit: name of the coefficient that bounds the velocity after every step [rad/s].
        store: for drives, a function whose slope by angle, at fixed time and control, is minus the torque [1/s²].
        beat: name of the coefficient that is the angular rate of the torque in time [rad/s].
        periodic: False if the torque changes when the angle grows by a whole turn.
        exclusive: a scene may hold only one effect of a (non-empty) group of this name.
        detail: rank among effects that model one thing, see ``models``; the higher number is the more accurate model.
        at_bob: False for inertia, weight or drag that does not act on the bob itself.
        needs_medium: True if the effect does not exist in a vacuum.
        number_name: the dimensionless number that tells when the effect matters.
        fitted: for dissipative effects, the parameter that can be fitted to a recorded decay and to which the torque is
            proportional; "" for effects without one.
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
    limit: ClassVar[str] = ""
    periodic: ClassVar[bool] = True
    exclusive: ClassVar[str] = ""
    detail: ClassVar[int] = 0
    at_bob: ClassVar[bool] = True
    needs_medium: ClassVar[bool] = False
    number_name: ClassVar[str] = ""
    fitted: ClassVar[str] = ""

    @property
    def controlled(self) -> bool:
        """Return True if the effect depends on the control, the action of an agent or controller, as a motor does."""
        codes = (function.__code__ for function in (type(self).torque, type(self).advance) if function)
        return any("control" in code.co_varnames[:code.co_argcount] for code in codes)

    @property
    def idle(self) -> bool:
        """Return True if the effect does nothing without control, as a motor that does not brake."""
        return False

    @property
    def needs(self) -> str:
        """Return the property of a body without which this effect has no meaning; "" if every body has it.

        The properties are "weight" (a centre of mass beside the axis), "volume", "wind" (parts that a wind pushes),
        "added" (fluid that moves along), "width" (an area across the flow), "cylinder" (a wire or rod), "bob" (a bob
        that counts as a point mass) and "sphere" (a single ball at the end). A body's ``lacks`` names the missing ones.
        """
        return ""

    def smoothed(self, width: float) -> Effect:
        """Return the effect with derivatives everywhere: of dry friction, one smoothed over ``width`` [rad/s]."""
        return self

    def general(self, mixed: Collection[str]) -> Effect:
        """Return this effect with functions that serve all members of a batch, by default the effect itself.

        ``mixed`` holds the names of parameters that are 0 in some members and not in others. An effect that leaves
        out a part where a parameter is 0 returns an effect with all parts.
        """
        return self

    def coefficients(self, scene: Surroundings) -> dict[str, float]:
        """Return the coefficients that this effect's functions take, by name, per moment of inertia.

        Raises SceneError if a coefficient cannot be derived from the scene.
        """
        raise NotImplementedError

    def check(self, scene: Surroundings) -> None:
        """Raise SceneError if this effect contradicts the rest of the scene."""

    def inertia(self, scene: Surroundings) -> float:
        """Return this effect's part of the moment of inertia about the pivot [kg m²]."""
        return 0.0

    def restoring_stiffness(self, scene: Surroundings) -> float:
        """Return this effect's restoring torque per angle near the bottom, except for the weight's [N m/rad].

        It is computed from the torque of a conservative effect, and 0 for others.
        """
        if self.kind != "conservative" or self.torque is None:
            return 0.0
        stiffness: float = stiffness_at_rest(self, self.coefficients(scene), scene.inertia)
        return stiffness - scene.gravity * scene.weight_moment if self.exclusive == GRAVITY else stiffness

    def weight_moment(self, scene: Surroundings) -> float:
        """Return this effect's part of the moment of the weight over g, mass times distance to the pivot [kg m]."""
        return 0.0

    def mass_moment(self, scene: Surroundings) -> float:
        """Return this effect's part of the mass times distance to the pivot that a moving pivot accelerates [kg m]."""
        return 0.0

    def number(self, scene: Surroundings, amplitude: float) -> float:
        """Return the dimensionless number that tells if this effect matters, for an amplitude [rad]; nan without one.
        """
        return math.nan

    def predicted(self, scene: Surroundings, amplitude: float) -> tuple[float, float]:
        """Return the textbook predictions of this effect's relative changes of the period, and of the amplitude per
        half swing; nan where unknown.

        The change of the period is that of small oscillations, plus the one due to the loss of amplitude.
        """
        return math.nan, math.nan

    def pivot(self, time: float) -> tuple[float, float]:
        """Return the displacement of the pivot by this effect, to the right and upwards, at a time [m]."""
        return 0.0, 0.0

    @property
    def sway(self) -> tuple[float, float]:
        """Return the largest displacement of the pivot by this effect, horizontal and vertical [m]."""
        return 0.0, 0.0

    def outside(self, scene: Surroundings, speed: float) -> str:
        """Return why this effect's formula is not valid at a speed of the bob [m/s], and that it is used nevertheless;
        "" where it is valid.
        """
        return ""

    def understated(self, scene: Surroundings, slip: float) -> float:
        """Return the true torque over the formula's, on a pendulum at rest in a uniform flow across it; 1 if exact.

        ``slip`` is the speed of the flow over the length, positive [1/s].
        """
        return 1.0

    @property
    def models(self) -> str:
        """Return the physical cause for which this effect is one of several alternative models, such as "the bob's
        drag"; "" if there is no alternative.
        """
        return self.exclusive

    @classmethod
    def trial(cls, scene: Surroundings) -> Effect | None:
        """Return this effect with parameters derived from the scene's geometry and medium; None if that is impossible.
        """
        return None

    @classmethod
    def summary(cls) -> str:
        """Return the first line of this effect's docstring."""
        return (cls.__doc__ or cls.name).strip().splitlines()[0]


OSCILLATIONS = 3
"""Number of oscillations, from the release on, over which predicted and measured periods are averaged."""


def lossy(scene: Surroundings, amplitude: float, loss: float, period: float = 0.0) -> tuple[float, float]:
    """Return the relative changes of period and amplitude that a loss of amplitude causes.

    With amplitude A [rad] and n = 3 (OSCILLATIONS), a loss of amplitude dA per half swing shortens the mean period of
    the first n oscillations at full gravity by the fraction ``(n A**2/8) dA/A`` (Nelson & Olsson 1986, Am. J. Phys. 54,
    112).
    ``loss`` is the share of the amplitude lost per half swing; ``period`` is a further relative change of the period of
    small oscillations.
    """
    fall = -(amplitude**2) / 8.0 * OSCILLATIONS * loss if scene.has("gravity") else 0.0
    return period + fall, -loss
