"""A simulated pendulum under a simulated rotary motion sensor, in real time."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field
from threading import Lock
from typing import Any, ClassVar

import numpy as np

from pendulum_env.bench.source import Chunk, FloatArray, Source
from pendulum_env.engine.rollout import rollout
from pendulum_env.physics.presets import find_scene
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.sensor import rounded
from pendulum_env.physics.units import setting, si

AHEAD = 1.0
"""Seconds of motion that are simulated at once."""


@dataclass(frozen=True, repr=False, eq=False)
class Virtual(Source):
    """The scene ``scene``, released from ``angle`` after ``wait`` seconds, or lifted and let go by :meth:`lift` and
    :meth:`release`; a reading is ``quantum * round((theta + noise) / quantum)``.
    """

    name: ClassVar[str] = "virtual"
    about: ClassVar[str] = "a simulated pendulum in real time; works everywhere"
    tested: ClassVar[str] = "a real browser"

    scene: Any = setting("lab", "scene that swings: a preset's name, dict, Scene or JSON file")
    integrator: str = setting("rk4", "method that integrates it")
    angle: float | None = si(None, "rad", "angle of release", optional=True, note="None for that of the scene's run")
    wait: float = si(1.0, "s", "time before the release; the bob is held at the angle", least=0.0,
                     note="inf to wait for a hand, as on the page")
    rate: float = si(100.0, "Hz", "readings per second", above=0.0)
    quantum: float = si(math.radians(0.09), "rad", "smallest step between readings, 360°/4000", least=0.0)
    noise: float = si(math.radians(0.02), "rad", "standard deviation of a reading", least=0.0)
    seed: int = setting(0, "seed of the noise")
    _state: dict[str, Any] = field(default_factory=dict, init=False)
    _lock: Any = field(default_factory=Lock, init=False)

    def open(self) -> None:
        """Begin: the bob is held at the angle of release."""
        scene: Scene = find_scene(self.scene)
        held = scene.run.angle if self.angle is None else self.angle
        self._state.update(scene=scene, held=held, read=0, began=time.monotonic(), free_from=self.wait,
                           random=np.random.default_rng(self.seed), ahead=np.empty(0), next=(held, 0.0))

    def lift(self, angle: float) -> None:
        """Hold the bob at an angle [rad] from now on, as a hand would."""
        with self._lock:
            self._state.update(held=float(angle), free_from=math.inf, ahead=np.empty(0))

    def release(self) -> None:
        """Let the bob go from where it is held, at rest."""
        with self._lock:
            self._state.update(free_from=self._state["read"] / self.rate, next=(self._state["held"], 0.0),
                               ahead=np.empty(0))

    def read(self, timeout: float = 0.1) -> Chunk:
        """Return the readings that are due."""
        kept = self._state
        until = time.monotonic() + timeout
        while (due := math.floor((time.monotonic() - kept["began"]) * self.rate)) <= kept["read"]:
            if time.monotonic() >= until:
                break
            time.sleep(min(1.0 / self.rate, timeout))
        with self._lock:
            count = max(due - kept["read"], 0)
            at = (kept["read"] + np.arange(count)) / self.rate
            free = at >= kept["free_from"]
            angle = np.full(count, kept["held"])
            angle[free] = self._moved(int(free.sum()))
            kept["read"] += count
        angle = angle + self.noise * kept["random"].standard_normal(count)
        if self.quantum:
            angle = rounded(angle, self.quantum)
        return Chunk(np.degrees(angle)[:, None], at)

    def _moved(self, count: int) -> FloatArray:
        """Return the next ``count`` angles [rad] of the free motion, at the times of readings."""
        kept = self._state
        while len(kept["ahead"]) < count:
            angle, velocity = kept["next"]
            steps = max(math.ceil(200.0 / self.rate), 1)
            motion = rollout(kept["scene"], integrator=self.integrator, angle=angle, velocity=velocity,
                             duration=max(AHEAD, 2.0 / self.rate), dt=1.0 / (self.rate * steps), every=steps,
                             diagnostics=(), warn=False)
            kept["ahead"] = np.concatenate([kept["ahead"], motion.angle[:-1]])
            kept["next"] = float(motion.angle[-1]), float(motion.velocity[-1])
        taken, kept["ahead"] = kept["ahead"][:count], kept["ahead"][count:]
        return np.asarray(taken)

    def close(self) -> None:
        """Do nothing; the simulation ends with its last reading."""
