"""A simulated pendulum under a simulated rotary motion sensor, in real time."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field
from threading import Lock
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from pendulum_env.bench.source import Chunk, FloatArray, Source, SourceError
from pendulum_env.physics.presets import find_scene
from pendulum_env.physics.sensor import rounded
from pendulum_env.physics.units import setting, si, whole_number

if TYPE_CHECKING:
    from pendulum_env.engine.machine import Machine

LONGEST_STEP = 0.005
"""Longest step of the integrator [s]; the scene's own if that is shorter."""
NAP = 0.002
"""Time between two looks at the clock [s]."""


@dataclass(frozen=True, repr=False, eq=False)
class Virtual(Source):
    """A scene released from ``angle`` after ``wait`` seconds, or lifted and let go by :meth:`lift` and :meth:`release`.

    A reading is ``quantum * round((theta + noise_k) / quantum)``, with Gaussian ``noise_k``.
    """

    name: ClassVar[str] = "virtual"
    about: ClassVar[str] = "a simulated pendulum in real time; works everywhere"
    tested: ClassVar[str] = "a real browser"
    own_clock: ClassVar[bool] = False

    scene: Any = setting("lab", "scene that swings: a preset's name or a scene's JSON file; in Python a dict or Scene")
    integrator: str = setting("rk4", "method that integrates it")
    angle: float | None = si(None, "rad", "angle of release", optional=True, note="None: that of the scene's usual run")
    wait: float | None = si(1.0, "s", "time before the release", least=0.0, optional=True,
                            note="None: until it is let go, as on the page")
    rate: float = si(100.0, "Hz", "readings per second", above=0.0)
    quantum: float = si(math.radians(0.09), "rad", "smallest step between readings, 360°/4000", least=0.0)
    noise: float = si(math.radians(0.02), "rad", "standard deviation of a reading", least=0.0)
    seed: int = setting(0, "seed of the noise and of gusts", lambda value, name: whole_number(value, name, least=0))
    _bob: dict[str, Any] = field(default_factory=dict, init=False, repr=False)
    _lock: Any = field(default_factory=Lock, init=False, repr=False)

    def open(self) -> None:
        """Begin: the bob is held at the angle of release."""
        from pendulum_env.engine.machine import Machine

        scene = find_scene(self.scene)
        held = scene.run.angle if self.angle is None else self.angle
        machine = Machine(scene, self.integrator, ())
        steps = max(math.ceil(1.0 / (self.rate * min(LONGEST_STEP, scene.run.dt)) - 1e-9), 1)
        machine.advance(machine.state(held, 0.0), 0.0, 1.0 / (self.rate * steps), 1)  # compiles before the clock runs
        with self._lock:
            self._bob.update(machine=machine, steps=steps, random=np.random.default_rng(self.seed), held=held, read=0,
                             state=None, free_from=math.inf if self.wait is None else self.wait,
                             began=time.monotonic())

    def lift(self, angle: float) -> None:
        """Hold the bob at an angle [rad] from now on, as a hand would."""
        with self._lock:
            self._bob.update(held=float(angle), free_from=math.inf, state=None)

    def release(self) -> None:
        """Let the bob go from where it is held, at rest."""
        with self._lock:
            if self._bob["free_from"] > (now := self._bob["read"] / self.rate):
                self._bob.update(free_from=now, state=None)

    def read(self, timeout: float = 0.1) -> Chunk:
        """Return the readings that are due; SourceError if the motion leaves the finite range."""
        until = time.monotonic() + timeout
        while self._due() <= 0 and (left := until - time.monotonic()) > 0.0:
            time.sleep(min(NAP, left))
        with self._lock:
            bob = self._bob
            at = (bob["read"] + np.arange(max(self._due(), 0))) / self.rate
            held = int(np.count_nonzero(at < bob["free_from"]))
            angle = np.concatenate([np.full(held, bob["held"]), self._moved(len(at) - held)])
            bob["read"] += len(at)
            angle = angle + self.noise * bob["random"].standard_normal(len(at))
        if self.quantum:
            angle = rounded(angle, self.quantum)
        return Chunk(np.degrees(angle)[:, None], at)

    def _due(self) -> int:
        """Return the number of readings whose time has come."""
        began, read = self._bob["began"], self._bob["read"]
        return int(math.floor((time.monotonic() - began) * self.rate) + 1 - read)

    def _moved(self, count: int) -> FloatArray:
        """Return the next ``count`` angles [rad] of the free motion, the first of which is that of the release."""
        from pendulum_env.engine.runs import RecordSchedule, recorded

        bob = self._bob
        if not count:
            return np.empty(0)
        machine: Machine = bob["machine"]
        first = bob["state"] is None
        if first:
            drawn = np.random.default_rng(self.seed).random(len(machine.drawn)).tolist()
            bob["state"] = machine.state(bob["held"], 0.0, drawn)
        # one record is the state before the first step: the angle at the release, or one that was read before
        plan = RecordSchedule(1.0 / (self.rate * bob["steps"]), (count - first) * bob["steps"], bob["steps"])
        rows, reason = recorded(machine, bob["state"], plan)
        if reason:
            raise SourceError(f"the simulated motion stopped: {reason}; choose another integrator or scene")
        angle, turns = (rows[:, machine.names.index(name)] for name in ("angle", "turns"))
        return np.asarray(angle + math.tau * turns)[int(not first):]

    def close(self) -> None:
        """Do nothing; the simulation ends with its last reading."""
