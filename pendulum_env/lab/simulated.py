"""The recording that comes with the package: simulated, so that what a fit ought to find is known."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path

from pendulum_env.lab.recording import Recording
from pendulum_env.lab.sensor import VirtualSensor, text_of_recording
from pendulum_env.physics.effects import FiniteBob
from pendulum_env.physics.presets import SCENES
from pendulum_env.physics.scene import Scene

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
    still. What it was made from stands in the file's first lines, and :func:`true_scene` is the scene.
    """
    return Recording.read(FILE)


def true_scene() -> Scene:
    """What swings in the simulated recording: the scene "lab" with a ball of 10 g and 4 cm that has a size."""
    lab = SCENES["lab"]
    return lab.with_effects((*lab.effects, FiniteBob())).replace(name="simulated", **SCENE)


def made_again() -> str:
    """The text of the file, from the scene and the sensor that it was made with."""
    from pendulum_env.engine.rollout import rollout

    scene = true_scene()
    motion = rollout(scene, **RUN)  # type: ignore[arg-type]
    effects = ", ".join(effect.name for effect in scene.effects)
    known = {"length": scene.body.length, **SCENE, "c": scene.coefficients["quadratic_drag_rate"]}
    run, sensor = given(RUN), given({field.name: getattr(SENSOR, field.name) for field in fields(SENSOR)})
    facts = {"scene": f"lab with {effects}: {', '.join(f'{name} {value:.6g}' for name, value in known.items())}",
             "motion": f"rollout(true_scene(), {run})",
             "sensor": f"VirtualSensor({sensor}).write(path, motion, seed={SEED}, hand={HAND})"}
    return text_of_recording(SENSOR.record(motion, SEED, HAND), "sensor", SENSOR.rate, facts)


def given(values: Mapping[str, object]) -> str:
    """Keywords as a call has them."""
    return ", ".join(f"{name}={value!r}" for name, value in values.items())
