"""A pivot that is shaken vertically or horizontally."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from pendulum_env.physics.effects.effect import WEIGHT, Effect, Kind
from pendulum_env.physics.elementary import cos, sin
from pendulum_env.physics.surroundings import Surroundings
from pendulum_env.physics.units import si


def vertical_drive(
    time: float, tilt: float, side: float, vertical_push: float, vertical_rate: float, vertical_phase: float
) -> float:
    return vertical_push * cos(vertical_rate * time + vertical_phase) * side * sin(tilt)


def vertical_drive_by_angle(
    time: float, tilt: float, side: float, vertical_push: float, vertical_rate: float, vertical_phase: float
) -> float:
    return vertical_push * cos(vertical_rate * time + vertical_phase) * side * cos(tilt)


def vertical_drive_store(
    time: float, tilt: float, side: float, vertical_push: float, vertical_rate: float, vertical_phase: float
) -> float:
    return vertical_push * cos(vertical_rate * time + vertical_phase) * side * cos(tilt)


def vertical_drive_radial(
    time: float, tilt: float, side: float, vertical_sway: float, vertical_rate: float, vertical_phase: float,
    swing_pull: float,
) -> float:
    shaken = swing_pull * vertical_sway * vertical_rate
    return -shaken * cos(vertical_rate * time + vertical_phase) * side * cos(tilt)


def vertical_drive_wind(time: float, vertical_sway: float, vertical_rate: float, vertical_phase: float) -> float:
    return vertical_sway * sin(vertical_rate * time + vertical_phase)


def horizontal_drive(
    time: float, tilt: float, side: float, horizontal_push: float, horizontal_rate: float, horizontal_phase: float
) -> float:
    return horizontal_push * cos(horizontal_rate * time + horizontal_phase) * side * cos(tilt)


def horizontal_drive_by_angle(
    time: float, tilt: float, side: float, horizontal_push: float, horizontal_rate: float, horizontal_phase: float
) -> float:
    return -horizontal_push * cos(horizontal_rate * time + horizontal_phase) * side * sin(tilt)


def horizontal_drive_store(
    time: float, tilt: float, side: float, horizontal_push: float, horizontal_rate: float, horizontal_phase: float
) -> float:
    return -horizontal_push * cos(horizontal_rate * time + horizontal_phase) * side * sin(tilt)


def horizontal_drive_radial(
    time: float, tilt: float, side: float, horizontal_sway: float, horizontal_rate: float, horizontal_phase: float,
    swing_pull: float,
) -> float:
    shaken = swing_pull * horizontal_sway * horizontal_rate
    return shaken * cos(horizontal_rate * time + horizontal_phase) * side * sin(tilt)


def horizontal_drive_wind(
    time: float, horizontal_sway: float, horizontal_rate: float, horizontal_phase: float
) -> float:
    return horizontal_sway * sin(horizontal_rate * time + horizontal_phase)


class _Shaken(Effect):
    """Base class of the effects that shake the pivot: displacement ``b cos(Omega t + phase)`` along ``direction``.

    ``direction`` is the unit vector (right, up). ``along`` is "vertical" or "horizontal", with which the names of the
    parameters b, Omega and phase begin, as in ``vertical_amplitude``.
    """

    kind: ClassVar[Kind] = "drive"
    along: ClassVar[str]
    direction: ClassVar[tuple[float, float]]

    @property
    def motion(self) -> tuple[float, float, float]:
        """Return amplitude b [m], angular rate Omega [rad/s] and phase [rad] of the pivot's motion."""
        amplitude, rate, phase = (getattr(self, f"{self.along}_{name}") for name in ("amplitude", "rate", "phase"))
        return amplitude, rate, phase

    @property
    def needs(self) -> str:
        return WEIGHT

    def coefficients(self, scene: Surroundings) -> dict[str, float]:
        amplitude, rate, phase = self.motion
        return {
            f"{self.along}_push": self.push(scene),
            f"{self.along}_rate": rate,
            f"{self.along}_phase": phase,
            f"{self.along}_sway": amplitude * rate / scene.body.reach,
        }

    def push(self, scene: Surroundings) -> float:
        """Return the largest torque per inertia from the pivot's acceleration, ``mass_moment b Omega**2 / I`` [1/s²].
        """
        amplitude, rate, _ = self.motion
        return scene.mass_moment * amplitude * rate * rate / scene.inertia

    def pivot(self, time: float) -> tuple[float, float]:
        amplitude, rate, phase = self.motion
        away = amplitude * math.cos(rate * time + phase)
        return away * self.direction[0], away * self.direction[1]

    @property
    def sway(self) -> tuple[float, float]:
        amplitude = self.motion[0]
        return amplitude * self.direction[0], amplitude * self.direction[1]


@dataclass(frozen=True)
class VerticalDrive(_Shaken):
    """A pivot shaken up and down: y = b cos(Omega t + phase).

    In the pivot's frame the torque is ``-mass_moment y'' sin(theta)``; per inertia, ``vertical_push cos(Omega t +
    phase) sin(theta)`` with ``vertical_push = mass_moment b Omega**2 / I`` [1/s²]. Energies are counted in that frame,
    and this torque's power is work. Near the bottom the drive feeds a swing at ``Omega = 2 omega0``; upright is stable
    above about ``(Omega b)**2 = 2 g L``. The phase ``Omega t`` has a relative error of 4e-16; beyond 8.4e8 rad the
    torque is nan and a run ends as "diverged". Steps must resolve Omega.
    """

    vertical_amplitude: float = si(0.01, "m", "amplitude of the pivot's vertical motion", least=0.0)
    vertical_rate: float = si(10.0, "rad/s", "angular rate of the pivot's vertical motion", least=0.0)
    vertical_phase: float = si(0.0, "rad", "phase of the pivot's vertical motion; 0 starts at its highest point")

    name: ClassVar[str] = "vertical_drive"
    along: ClassVar[str] = "vertical"
    direction: ClassVar[tuple[float, float]] = (0.0, 1.0)
    equation: ClassVar[str] = (
        "+ {vertical_push:.6g} cos({vertical_rate:.6g} t + {vertical_phase:.6g}) sin(theta)"
    )
    source: ClassVar[str] = "Stephenson 1908, Phil. Mag. 15, 233; Kapitza 1951, Zh. Eksp. Teor. Fiz. 21, 588"
    torque = staticmethod(vertical_drive)
    by_angle = staticmethod(vertical_drive_by_angle)
    store = staticmethod(vertical_drive_store)
    radial = staticmethod(vertical_drive_radial)
    wind_y = staticmethod(vertical_drive_wind)
    beat: ClassVar[str] = "vertical_rate"
    number_name: ClassVar[str] = "(Omega b)²/(2 g L)"

    def number(self, scene: Surroundings, amplitude: float) -> float:
        """Return Kapitza's number: above 1 the upright pendulum is stable; inf without gravity."""
        speed = scene.mass_moment * self.vertical_amplitude * self.vertical_rate / scene.inertia
        return 0.5 * (speed / scene.omega0) ** 2 if scene.omega0 else math.inf


@dataclass(frozen=True)
class HorizontalDrive(_Shaken):
    """A pivot shaken to and fro: x = b cos(Omega t + phase).

    In the pivot's frame the torque is ``-mass_moment x'' cos(theta)``; per inertia, ``horizontal_push cos(Omega t +
    phase) cos(theta)`` with ``horizontal_push = mass_moment b Omega**2 / I`` [1/s²]. Small swings of a point-like bob
    settle at ``(b/L) Omega**2 / sqrt((omega0**2 - Omega**2)**2 + (gamma Omega)**2)``. With a vertical drive of the same
    rate the pivot moves on an ellipse. Energies, the range of the phase and the steps are as in :class:`VerticalDrive`.
    """

    horizontal_amplitude: float = si(0.01, "m", "amplitude of the pivot's horizontal motion", least=0.0)
    horizontal_rate: float = si(10.0, "rad/s", "angular rate of the pivot's horizontal motion", least=0.0)
    horizontal_phase: float = si(0.0, "rad", "phase of the pivot's horizontal motion; 0 starts farthest to the right")

    name: ClassVar[str] = "horizontal_drive"
    along: ClassVar[str] = "horizontal"
    direction: ClassVar[tuple[float, float]] = (1.0, 0.0)
    equation: ClassVar[str] = (
        "+ {horizontal_push:.6g} cos({horizontal_rate:.6g} t + {horizontal_phase:.6g}) cos(theta)"
    )
    source: ClassVar[str] = "Landau & Lifshitz 1976, Mechanics, §5 problem 3 and §30"
    torque = staticmethod(horizontal_drive)
    by_angle = staticmethod(horizontal_drive_by_angle)
    store = staticmethod(horizontal_drive_store)
    radial = staticmethod(horizontal_drive_radial)
    wind_x = staticmethod(horizontal_drive_wind)
    beat: ClassVar[str] = "horizontal_rate"
    number_name: ClassVar[str] = "Omega² b/g"

    def number(self, scene: Surroundings, amplitude: float) -> float:
        """Return the ratio of the pivot's largest acceleration to that of gravity; inf without gravity."""
        return self.push(scene) / scene.omega0**2 if scene.omega0 else math.inf
