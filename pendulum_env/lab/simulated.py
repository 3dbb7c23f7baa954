"""The package's example recording, which is simulated, so that the true values of all fitted numbers are known."""

from __future__ import annotations

from pathlib import Path

from pendulum_env.lab.recording import Recording
from pendulum_env.physics.effects import FiniteBob
from pendulum_env.physics.presets import SCENES
from pendulum_env.physics.scene import Scene

FILE = Path(__file__).parent / "data" / "simulated_lab.txt"
SCENE = {"mass": 0.010, "radius": 0.020, "gamma": 0.03}
"""Changes to the scene "lab": a light ball, for which linear and quadratic drag take about equal parts of the energy at
the start."""


def simulated_recording() -> Recording:
    """Return a simulated recording of 60 s: a light ball on a rod in air, released from 35 degrees after 6 s.

    Before the release, a hand pulls the ball aside. The readings are those of a rotary motion sensor with a resolution
    of 0.25 degree, at uneven steps of about 0.05 s, with the zero where the bob hung still. The first lines of the file
    describe the simulation; :func:`true_scene` returns the scene.
    """
    return Recording.read(FILE)


def true_scene() -> Scene:
    """Return the scene of the simulated recording: "lab" with a ball of finite size, 10 g and 4 cm in diameter."""
    lab = SCENES["lab"]
    return lab.with_effects((*lab.effects, FiniteBob())).replace(name="simulated", **SCENE)
