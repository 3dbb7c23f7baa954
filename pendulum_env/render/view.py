"""Input of frames: plain numbers that describe a pendulum and one instant of its motion."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pendulum_env.render.palette import rgb

Floats = NDArray[np.float64]
SUSPENSIONS = ("rod", "wire")
BAR, BALL, PLATE = "bar", "ball", "plate"
"""Kinds of parts of a pendulum's outline."""
LEDGER = ("kinetic", "potential", "heat", "work", "residual")


@dataclass(frozen=True)
class Apparatus:
    """A pendulum as it is drawn: the properties that do not change while it swings.

    Attributes:
        length: distance from the pivot to the bob's centre [m].
        bob_radius: radius of the bob [m], drawn to scale.
        suspension: "rod" or "wire".
        rod_radius: radius of the rod or wire [m], drawn to scale but always visible.
        title: text in the header.
        sway: largest displacement of the pivot to the sides, and up and down [m]; (0, 0) if the pivot does not move.
        swing: largest |angle| that has to fit into the picture, below pi / 2 [rad]: the pivot is then near the upper
            edge, and the pendulum about twice as long in the picture, with angles and proportions true. None for the
            pendulum's full circle.
        outline: parts of a compound pendulum, drawn to scale in place of bob and rod: "bar", "ball" or "plate", its two
            ends as distances below the pivot along the pendulum's axis (the same twice for a ball or a plate), and its
            radius or half its width [m].

    Raises ValueError for lengths that are not finite and above 0 (rod_radius and sway may be 0), an unknown
    suspension, an unknown part, or a swing that is not below pi / 2 or that a pendulum with a moving pivot or an
    outline has.
    """

    length: float
    bob_radius: float
    suspension: str = "rod"
    rod_radius: float = 0.0
    title: str = ""
    sway: tuple[float, float] = (0.0, 0.0)
    swing: float | None = None
    outline: tuple[tuple[str, float, float, float], ...] = ()

    @property
    def extent(self) -> float:
        """Distance from the pivot to the farthest point of the pendulum [m]."""
        if not self.outline:
            return self.length + self.bob_radius
        return max(max(abs(one), abs(two)) + (0.0 if kind == BAR else half) for kind, one, two, half in self.outline)

    @property
    def covers(self) -> bool:
        """True if a plate covers the pivot, and would cover the degree scale."""
        return any(kind == PLATE and abs(start) <= half for kind, start, _, half in self.outline)

    def __post_init__(self) -> None:
        for name, least in (("length", "above"), ("bob_radius", "above"), ("rod_radius", "at least")):
            value = getattr(self, name)
            if not math.isfinite(value) or value < 0 or (value == 0 and least == "above"):
                raise ValueError(f"{name} must be a finite number {least} 0 m, not {value!r}")
        if not all(0.0 <= far < math.inf for far in self.sway):
            raise ValueError(f"sway must be two finite numbers of at least 0 m, not {self.sway!r}")
        if self.swing is not None and (not 0.0 <= self.swing < math.pi / 2 or any(self.sway) or self.outline):
            raise ValueError("swing must be None or from 0 to below pi / 2, and None with a sway or an outline, "
                             f"not {self.swing!r}")
        for kind, *sizes in self.outline:
            if kind not in (BAR, BALL, PLATE) or not all(map(math.isfinite, sizes)):
                raise ValueError(f"a part of the outline must be {BAR}, {BALL} or {PLATE} with three finite numbers of "
                                 f"metres, not {(kind, *sizes)!r}")
        if self.suspension not in SUSPENSIONS:
            raise ValueError(f"suspension must be one of {', '.join(SUSPENSIONS)}, not {self.suspension!r}")


@dataclass(frozen=True, eq=False)
class PastSamples:
    """Samples of a run before the shown instant, as arrays of shape (n,) in ascending time.

    Attributes:
        time: [s].
        angle: from the downward vertical, counter-clockwise positive, unwrapped [rad].
        velocity: angular velocity [rad/s].
        kinetic, potential, heat, work, residual: entries of the energy ledger [J]; None where they are not known.

    Raises ValueError for arrays of different lengths, or for times, angles or velocities that are not finite.
    """

    time: Floats
    angle: Floats
    velocity: Floats
    kinetic: Floats | None = None
    potential: Floats | None = None
    heat: Floats | None = None
    work: Floats | None = None
    residual: Floats | None = None

    def __post_init__(self) -> None:
        for name in ("time", "angle", "velocity"):
            _require(bool(np.isfinite(getattr(self, name)).all()), f"the past's {name}", "finite", "nan or infinity")
        shapes = {np.shape(values) for values in vars(self).values() if values is not None}
        _require(shapes == {(len(self.time),)}, "the past's arrays", "of one length", sorted(shapes))


@dataclass(frozen=True, eq=False)
class Orbits:
    """Curves behind a phase portrait, as arrays of shape (n, 2) of angles [rad] and velocities [rad/s].

    Attributes:
        orbit: the motion from the run's start without losses and drives.
        separatrix: the boundary between swings and full rotations.
        angle_reach, velocity_reach: limits of the axes on both sides of 0 [rad, rad/s]; the portrait extends them
            where the motion exceeds them.
        periodic: True if angles are reduced to one turn.
        notes: names of the orbit in several lengths, longest first.

    Raises ValueError for limits that are not finite and above 0.
    """

    orbit: tuple[Floats, ...] = ()
    separatrix: tuple[Floats, ...] = ()
    angle_reach: float = math.pi
    velocity_reach: float = 1.0
    periodic: bool = True
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("angle_reach", "velocity_reach"):
            value = getattr(self, name)
            _require(0 < value < math.inf, name, "finite and above 0", value)


@dataclass(frozen=True)
class View:
    """State of a pendulum at one instant of a run, with all that a frame shows of it.

    Attributes:
        time: [s].
        angle: from the downward vertical, counter-clockwise positive, unwrapped [rad].
        velocity: angular velocity [rad/s].
        torque_share: the motor's torque over its largest torque, -1 to 1; None without a motor.
        kinetic, potential, heat: entries of the energy ledger [J]; an infinite energy is drawn as an overflowing bar.
        work: work of drives [J]; None for no bar.
        residual: residual of the energy balance [J]; None for no energy bars at all.
        trail: recent angles, oldest first [rad].
        caption: text in the header, for example the method's name.
        energy_scale: energy that corresponds to a full bar [J], for example the run's initial energy; None takes the
            largest sum of this view's energies, so that bars of different frames cannot be compared.
        accent: "#RRGGBB" of bob, trail and caption mark; None takes the frame's default.
        stopped: True if the run ended at this instant and later frames repeat it; the header says so.
        pivot: displacement of the pivot to the right and upwards [m]; drawn where the apparatus has a sway.
        trail_pivots: displacement of the pivot at each angle of the trail [m]; empty if the pivot does not move.
        past: samples before this instant for the panels "history", "phase" and "residual"; None for none.
        curves: curves behind the motion in the panel "phase"; None for none.
        residual_scale: limit of the axis of the panel "residual" [J]; None takes the next round number above the
            largest residual shown.

    Raises ValueError for a number that is not finite (energies may be infinite, but not NaN), a torque share beyond 1,
    an invalid colour, or a number of trail_pivots other than that of the trail's angles.
    """

    time: float
    angle: float
    velocity: float = 0.0
    torque_share: float | None = None
    kinetic: float = 0.0
    potential: float = 0.0
    heat: float = 0.0
    work: float | None = None
    residual: float | None = None
    trail: tuple[float, ...] = ()
    caption: str = ""
    energy_scale: float | None = None
    accent: str | None = None
    stopped: bool = False
    pivot: tuple[float, float] = (0.0, 0.0)
    trail_pivots: tuple[tuple[float, float], ...] = ()
    past: PastSamples | None = None
    curves: Orbits | None = None
    residual_scale: float | None = None

    def __post_init__(self) -> None:
        # A sum of finite numbers is finite, or so large that each has to be looked at.
        if not math.isfinite(self.time + self.angle + self.velocity + sum(self.trail) + sum(self.pivot)):
            for name in ("time", "angle", "velocity"):
                _require(math.isfinite(getattr(self, name)), name, "finite", getattr(self, name))
            _require(_all_finite(self.trail), "trail", "finite angles", "one that holds NaN or infinity")
            _require(_all_finite(self.pivot), "pivot", "finite", "one that is not")
        if self.trail_pivots:
            _require(all(map(_all_finite, self.trail_pivots)), "pivot", "finite", "one that is not")
            _require(len(self.trail_pivots) == len(self.trail), "trail_pivots", "empty or one for each angle",
                     f"{len(self.trail_pivots)} of them")
        if math.isnan(self.kinetic + self.potential + self.heat + (self.work or 0.0) + (self.residual or 0.0)):
            for name in LEDGER:
                value = getattr(self, name)
                _require(value is None or not math.isnan(value), name, "a number of joules", value)
        share = self.torque_share
        _require(share is None or abs(share) <= 1, "torque_share", "None or within -1 to 1", share)
        for name in ("energy_scale", "residual_scale"):
            scale = getattr(self, name)
            _require(scale is None or (math.isfinite(scale) and scale > 0), name, "None or finite and above 0 J", scale)
        if self.accent is not None:
            rgb(self.accent)


def between(first: View, last: View, share: float) -> View:
    """Return the view at an instant between two views, interpolated; ``share`` 0 is the first and 1 the last.

    The angle follows the cubic Hermite interpolant of both angles and velocities, the velocity its derivative. Energies
    and the pivot's displacement are interpolated linearly. All else is copied from the first view.
    """
    if share >= 1.0:
        return last
    h, s = last.time - first.time, share
    way = last.angle - first.angle
    angle = (first.angle + s * s * (3.0 - 2.0 * s) * way
             + h * s * (1.0 - s) * ((1.0 - s) * first.velocity - s * last.velocity))
    velocity = (6.0 * s * (1.0 - s) * way / h + (1.0 - s) * (1.0 - 3.0 * s) * first.velocity
                + s * (3.0 * s - 2.0) * last.velocity)
    energies = {name: a + s * (b - a) for name in LEDGER
                if (a := getattr(first, name)) is not None and (b := getattr(last, name)) is not None}
    x, y = (a + s * (b - a) for a, b in zip(first.pivot, last.pivot, strict=True))
    return replace(first, time=first.time + s * h, angle=angle, velocity=velocity, torque_share=last.torque_share,
                   pivot=(x, y), **energies)


def _all_finite(values: Iterable[float]) -> bool:
    """Return True if all values are finite."""
    return all(map(math.isfinite, values))


def _require(met: bool, name: str, allowed: str, value: object) -> None:
    """Raise ValueError with the name of an argument and its allowed values, unless the condition ``met`` is True."""
    if not met:
        raise ValueError(f"{name} must be {allowed}, not {value}")
