"""A small study for tests, in a module of its own so that other processes can import it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pendulum_env import Study, rollout
from pendulum_env.physics.units import choice, count, flag, si


@dataclass(frozen=True)
class Speeds(Study):
    """Largest velocity of a swing without losses.

    By the energy it is 2 omega0 sin(A/2).
    """

    name = "speeds"
    columns: ClassVar = {"angle": "rad", "side": "", "largest": "rad/s"}

    most: float = si(2.0, "rad", "largest release angle", above=0.0)
    number: int = count(4, "number of angles", 1000)
    integrator: str = choice("rk4", ("rk4", "velocity_verlet"), "the method")
    both: bool = flag(False, "also from the other side")
    fails: int = count(None, "number of the angle that fails", 1000)

    def points(self) -> list[Mapping[str, Any]]:
        sides = ("right", "left") if self.both else ("right",)
        return [{"angle": float(angle), "side": side} for side in sides
                for angle in np.linspace(0.0, self.most, self.number + 1)[1:]]

    def run(self, point: Mapping[str, Any]) -> Mapping[str, Any]:
        angle = point["angle"] if point["side"] == "right" else -point["angle"]
        if self.fails and point["angle"] == self.points()[self.fails - 1]["angle"]:
            raise ValueError("as told")
        run = rollout("vacuum", angle=angle, velocity=0.0, duration=1.5, dt=0.005, integrator=self.integrator,
                      backend="python")
        return {"largest": float(np.abs(run.velocity).max())}

    def draw(self, found: Any) -> Any:
        from pendulum_env import plots

        figure, (axes,) = plots.figure()
        axes.plot(found.column("angle"), found.column("largest"), "o")
        return figure

    def text(self, found: Any) -> str:
        return f"The largest of all is {max(filter(None, found.column('largest'))):.4g} rad/s."
