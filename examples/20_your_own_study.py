"""A study of one's own: the largest speed of the bob against the release angle, with table, figure, files and command.

    python 20_your_own_study.py --help
    python 20_your_own_study.py --largest 170 --angles 18

It needs points, what is computed at each, and a figure. Progress, Ctrl-C, --resume, the CSV and JSON files, pandas and
the notebook come from the class Study. Without losses the energy gives the speed at the bottom: 2 sqrt(g L) sin(A/2).
"""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pendulum_env import SCENES, Study, plots, rollout
from pendulum_env.physics.units import choice, count, si


@dataclass(frozen=True)
class LargestSpeed(Study):
    """Largest speed of the bob against the release angle."""

    name = "largest_speed"
    columns: ClassVar = {"angle": "rad", "speed": "m/s", "without_losses": "m/s"}

    scene: str = choice("lab", SCENES, "the scene")
    largest: float = si(3.0, "rad", "largest release angle", above=0.0)
    angles: int = count(12, "number of angles", 10_000)

    def points(self):
        return [{"angle": float(angle)} for angle in np.linspace(0.0, self.largest, self.angles + 1)[1:]]

    def run(self, point):
        scene, angle = SCENES[self.scene], point["angle"]
        swing = rollout(scene, angle=angle, velocity=0.0, duration=10.0 / scene.omega0)
        reach = scene.body.reach
        return {"speed": reach * float(np.abs(swing.velocity).max()),
                "without_losses": 2.0 * reach * scene.omega0 * abs(math.sin(angle / 2.0))}

    def draw(self, found):
        figure, (axes,) = plots.figure()
        angle = np.degrees(found.column("angle"))
        axes.plot(angle, found.column("without_losses"), color="0.6", label="without losses")
        axes.plot(angle, found.column("speed"), "o", label=self.scene)
        axes.set(xlabel="release angle [degrees]", ylabel="largest speed [m/s]", xlim=(0, 180), ylim=(0, None))
        axes.legend()
        return figure

    def text(self, found):
        lost = 1.0 - np.divide(found.column("speed"), found.column("without_losses"))
        assert self.scene != "lab" or 0.0 < np.nanmin(lost) <= np.nanmax(lost) < 0.01
        return f"The speed is {100 * np.nanmin(lost):.2g} to {100 * np.nanmax(lost):.2g} % below that without losses."


if __name__ == "__main__":
    from pendulum_env.cli.studies import run_command

    run_command(LargestSpeed)
