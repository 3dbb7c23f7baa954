"""The recording that comes with the package: simulated, so that what a fit ought to find is known."""

from __future__ import annotations

import math
from dataclasses import fields
from pathlib import Path

from .recording import Recording
from .sensor import VirtualSensor, text_of_recording

FILE = Path(__file__).parent / "data" / "simulated_lab.txt"
SCENE = {"mass": 0.010, "radius": 0.020, "gamma": 0.03}
"""The scene "lab" with a light ball: linear and quadratic drag take about as much at the start."""
RUN = {"angle": math.radians(35.0), "duration": 54.0, "dt": 0.005}
SENSOR = VirtualSensor(quantum=math.radians(0.25), rate=20.0, jitter=0.004, noise=math.radians(0.05))
SEED = 1
HAND = 6.0


def simulated_recording() -> Recording:
    """A simulated recording of 60 s: a light ball on a rod in air, let go from 35 degrees after 6 s in a hand.

    As a rotary motion sensor of 0.25 degree writes it at uneven steps of about 0.05 s, zeroed where the bob hung
    still. What it was made from stands in the file's first lines and in this module.
    """
    return Recording.read(FILE)


def made_again() -> str:
    """The text of the file, from the scene and the sensor that it was made with."""
    from pendulum_env.engine.rollout import rollout

    given = ", ".join(f"{name}={value!r}" for name, value in {**SCENE, **RUN}.items())
    scene = f'rollout("lab", {given})'
    motion = rollout("lab", **SCENE, **RUN)  # type: ignore[arg-type]
    truth = ", ".join(f"{name} {value:.6g}" for name, value in motion.scene.coefficients.items() if "motor" not in name)
    sensor = ", ".join(f"{field.name}={getattr(SENSOR, field.name)!r}" for field in fields(SENSOR))
    facts = {"motion": scene, "truth": f"{truth}, length {motion.scene.parameters()['length']:g} m",
             "sensor": f"VirtualSensor({sensor}).write(path, motion, seed={SEED}, hand={HAND})"}
    return text_of_recording(SENSOR.record(motion, SEED, HAND), "sensor", SENSOR.rate, facts)
