"""The package's example recording, which is simulated, so that the true values of all fitted numbers are known."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

from pendulum_env.lab.recording import Recording
from pendulum_env.lab.sensor import VirtualSensor, text_of_recording
from pendulum_env.physics.effects import FiniteBob
from pendulum_env.physics.presets import SCENES
from pendulum_env.physics.scene import Scene

FILE = Path(__file__).parent / "data" / "simulated_lab.txt"
SCENE = {"mass": 0.010, "radius": 0.020, "gamma": 0.03}
"""Changes to the scene "lab": a light ball, for which linear and quadratic drag take about equal parts of the energy at
the start."""
RUN = {"angle": math.radians(35.0), "duration": 54.0, "dt": 0.005}
SHOWN = ("quantum", "rate", "jitter", "noise", "zero")
"""Fields of the sensor that the recipe in the file shows."""
SENSOR = VirtualSensor(quantum=math.radians(0.25), rate=20.0, jitter=0.004, noise=math.radians(0.05))
SEED = 1
HAND = 6.0


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


def simulated_text() -> str:
    """Return the text of the simulated recording's file, simulated anew from the settings in this module."""
    from pendulum_env.engine.rollout import rollout

    scene = true_scene()
    motion = rollout(scene, **RUN)  # type: ignore[arg-type]
    effects = ", ".join(effect.name for effect in scene.effects)
    known = {"length": scene.body.reach, **SCENE, "c": scene.coefficients["quadratic_drag_rate"]}
    run, sensor = keywords(RUN), keywords({name: getattr(SENSOR, name) for name in SHOWN})
    facts = {"scene": f"lab with {effects}: {', '.join(f'{name} {value:.6g}' for name, value in known.items())}",
             "motion": f"rollout(true_scene(), {run})",
             "sensor": f"VirtualSensor({sensor}).write(path, motion, seed={SEED}, hand={HAND})"}
    return text_of_recording(SENSOR.record(motion, SEED, HAND), "sensor", SENSOR.rate, facts)


def keywords(values: Mapping[str, object]) -> str:
    """Return named values as the text of a call's keyword arguments, such as ``angle=0.6, dt=0.005``."""
    return ", ".join(f"{name}={value!r}" for name, value in values.items())
