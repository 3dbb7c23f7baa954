"""Motion of the medium: a steady wind, and gusts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from pendulum_env.physics.effects.effect import Effect, Kind
from pendulum_env.physics.elementary import exp, sqrt
from pendulum_env.physics.flow import bottom_speed
from pendulum_env.physics.random import next_uniform, normal
from pendulum_env.physics.surroundings import Surroundings
from pendulum_env.physics.units import SceneError, si


def wind_x(wind_rate: float) -> float:
    return wind_rate


def gust_x(gust: float) -> float:
    return gust


def gust_advance(
    gust: float, gust_a0: float, gust_a1: float, gust_a2: float, gust_b0: float, gust_b1: float, gust_b2: float,
    first: float, span: float, gust_size: float, gust_decay: float,
) -> tuple[float, float, float, float, float, float, float]:
    remaining = 0.0 if first > 0.0 else exp(-gust_decay * span)
    c0, c1, c2, d0, d1, d2, one = next_uniform(gust_a0, gust_a1, gust_a2, gust_b0, gust_b1, gust_b2)
    a0, a1, a2, b0, b1, b2, two = next_uniform(c0, c1, c2, d0, d1, d2)
    return remaining * gust + gust_size * sqrt(1.0 - remaining * remaining) * normal(one, two), a0, a1, a2, b0, b1, b2


def _needs_medium(scene: Surroundings, subject: str) -> None:
    """Raise SceneError if the scene is in a vacuum, where no wind can blow; the message begins with ``subject``."""
    if scene.medium.empty:
        raise SceneError(
            f"{subject} needs a medium to move, such as air; the scene '{scene.name}' is in a vacuum."
        )


class _Moving(Effect):
    """Base class of the effects that move the medium: wind and gusts."""

    kind: ClassVar[Kind] = "medium"
    needs_medium: ClassVar[bool] = True
    number_name: ClassVar[str] = "wind / bob's speed"

    @property
    def needs(self) -> str:
        return "wind"

    def check(self, scene: Surroundings) -> None:
        _needs_medium(scene, self.summary().split(":")[0])

    @staticmethod
    def _ratio(speed: float, scene: Surroundings, amplitude: float) -> float:
        """Return the wind's speed divided by the bob's speed at the bottom, for a swing of this amplitude [rad]; inf
        for a bob that does not move.
        """
        fastest = bottom_speed(scene, amplitude)
        return abs(speed) / fastest if fastest else math.inf


@dataclass(frozen=True)
class Wind(_Moving):
    """A steady wind: every drag acts against the moving medium.

    The medium moves with ``wind_speed`` to the right, the side of positive angles. Drags then take the velocity
    relative to the medium, with the part across the bob's path. Of the power that drags take from the bob, the force
    times the wind is work and the rest is heat.
    """

    wind_speed: float = si(1.0, "m/s", "velocity of the medium, to the side of positive angles")

    name: ClassVar[str] = "wind"
    equation: ClassVar[str] = ""
    source: ClassVar[str] = "Batchelor 1967, An Introduction to Fluid Dynamics, section 3.1"
    wind_x = staticmethod(wind_x)

    def coefficients(self, scene: Surroundings) -> dict[str, float]:
        return {"wind_rate": self.wind_speed / scene.body.reach}

    def number(self, scene: Surroundings, amplitude: float) -> float:
        return self._ratio(self.wind_speed, scene, amplitude)


@dataclass(frozen=True)
class Gusts(_Moving):
    """Gusts: random wind that fluctuates about the steady one, with a correlation time.

    An Ornstein-Uhlenbeck process: normally distributed with standard deviation ``gust_speed`` and correlation
    exp(-t/gust_time). The wind is advanced exactly, once per control step, and constant within the step; the start is
    drawn from the stationary distribution. Random numbers by MRG32k3a, seeded with the run. The medium's own
    acceleration, which pushes the bob through its displaced and its added mass, is left out.
    """

    gust_speed: float = si(0.5, "m/s", "standard deviation of the wind", least=0.0)
    gust_time: float = si(0.5, "s", "correlation time of the wind", above=0.0)

    name: ClassVar[str] = "gusts"
    equation: ClassVar[str] = ""
    source: ClassVar[str] = "Uhlenbeck & Ornstein 1930, Phys. Rev. 36, 823; Gillespie 1996, Phys. Rev. E 54, 2084"
    memory: ClassVar[tuple[str, ...]] = ("gust", "gust_a0", "gust_a1", "gust_a2", "gust_b0", "gust_b1", "gust_b2")
    draws: ClassVar[int] = 6
    wind_x = staticmethod(gust_x)
    advance = staticmethod(gust_advance)

    def coefficients(self, scene: Surroundings) -> dict[str, float]:
        return {"gust_size": self.gust_speed / scene.body.reach, "gust_decay": 1.0 / self.gust_time}

    def number(self, scene: Surroundings, amplitude: float) -> float:
        return self._ratio(self.gust_speed, scene, amplitude)
