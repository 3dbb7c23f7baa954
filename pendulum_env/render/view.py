"""What a frame is drawn from: plain numbers, nothing of scenes, methods or environments."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pendulum_env.render.palette import rgb

Floats = NDArray[np.float64]
SUSPENSIONS = ("rod", "wire")
LEDGER = ("kinetic", "potential", "heat", "work", "residual")


@dataclass(frozen=True)
class Apparatus:
    """What hangs from the stand and does not change while it swings.

    Attributes:
        length: pivot to the bob's centre [m].
        bob_radius: of the bob, drawn to scale [m].
        suspension: "rod" or "wire".
        rod_radius: of the rod or wire [m]; drawn to scale, but never too thin to see.
        title: shown in the header.
        sway: how far the pivot goes from its place to either side, and up and down [m]; (0, 0) if it stands still.

    Raises ValueError for lengths that are not finite and above 0 (rod_radius and sway may be 0) or another suspension.
    """

    length: float
    bob_radius: float
    suspension: str = "rod"
    rod_radius: float = 0.0
    title: str = ""
    sway: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        for name, least in (("length", "above"), ("bob_radius", "above"), ("rod_radius", "at least")):
            value = getattr(self, name)
            if not math.isfinite(value) or value < 0 or (value == 0 and least == "above"):
                raise ValueError(f"{name} must be a finite number {least} 0 m, not {value!r}")
        if not all(0.0 <= far < math.inf for far in self.sway):
            raise ValueError(f"sway must be two finite numbers of at least 0 m, not {self.sway!r}")
        if self.suspension not in SUSPENSIONS:
            raise ValueError(f"suspension must be one of {', '.join(SUSPENSIONS)}, not {self.suspension!r}")


@dataclass(frozen=True, eq=False)
class PastSamples:
    """A run up to now: arrays of shape (n,), for instants that ascend in time; what is shown now is not among them.

    Attributes:
        time: [s].
        angle: from the downward vertical, counter-clockwise positive, unwrapped [rad].
        velocity: [rad/s].
        kinetic, potential, heat, work, residual: the ledger [J]; None where it is not kept.

    Raises ValueError for arrays of other lengths, or for times, angles or velocities that are not finite.
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


Past = PastSamples
"""Name of version 0.1."""


@dataclass(frozen=True, eq=False)
class Curves:
    """What stands behind a phase portrait: lines, arrays of shape (n, 2) of angles [rad] and velocities [rad/s].

    Attributes:
        orbit: lines of the motion from the run's start, without losses and drives.
        separatrix: lines between swings and whole turns.
        angle_reach, velocity_reach: the portrait shows so much to either side of 0 [rad, rad/s].
        periodic: False if angles are shown as they are, not wrapped into one turn.
        notes: what the orbit is, in several lengths, longest first.

    The portrait goes further where the past or the present does.

    Raises ValueError for reaches that are not finite and above 0.
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
    """One instant of a run.

    Attributes:
        time: [s].
        angle: from the downward vertical, counter-clockwise positive, unwrapped [rad].
        velocity: [rad/s].
        torque_share: the motor's torque over its largest, -1 to 1; None without a motor.
        kinetic, potential, heat: of the ledger [J]; an infinite energy is an overflowing bar.
        work: of the ledger [J]; None for no bar.
        residual: of the ledger [J]; None for no energy bars at all.
        trail: recent angles, oldest first [rad].
        caption: shown in the header, for example the method's name.
        energy_scale: the energy that fills the bars, for example the run's initial energy [J]; None takes the largest
            of this view's own sums, which makes bars of different frames incomparable.
        accent: "#RRGGBB" of bob, trail and caption mark; None leaves the choice to the frame.
        stopped: the run has ended and later times show this state; the frame says so.
        pivot: how far it is to the right and upwards of its place [m]; drawn where the apparatus has a sway.
        trail_pivots: the same at each angle of the trail [m]; empty if it stood still.
        past: what the panels "history", "phase" and "residual" show beside the present; None for nothing.
        curves: what the panel "phase" shows behind it.
        residual_scale: the residual that fills its panel [J]; None takes the largest of the past and the present.

    Raises ValueError for a number that is not finite (energies: NaN only), a share beyond 1, a bad colour or pivots
    that are not as many as the trail's angles.
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
    curves: Curves | None = None
    residual_scale: float | None = None

    def __post_init__(self) -> None:
        for name in ("time", "angle", "velocity"):
            _require(math.isfinite(getattr(self, name)), name, "finite", getattr(self, name))
        _require(all(map(_all_finite, (self.pivot, *self.trail_pivots))), "pivot", "finite", "one that is not")
        _require(len(self.trail_pivots) in (0, len(self.trail)), "trail_pivots", "empty or one for each angle",
                 f"{len(self.trail_pivots)} of them")
        _require(_all_finite(self.trail), "trail", "finite angles", "one that holds NaN or infinity")
        for name in ("kinetic", "potential", "heat", "work", "residual"):
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
    """Return the view at a share, 0 to 1, of the time from one view to a later one.

    The angle is the cubic with both angles and velocities (Hermite), the velocity that of the cubic; the energies and
    the pivot's place change linearly. The trail, the past and what does not change are the first one's.
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
    return all(map(math.isfinite, values))


def _require(met: bool, name: str, allowed: str, value: object) -> None:
    if not met:
        raise ValueError(f"{name} must be {allowed}, not {value}")
