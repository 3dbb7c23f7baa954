"""Swings for false devices, and recordings acquired from sources."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from pendulum_env import rollout
from pendulum_env.bench.acquisition import Acquisition
from pendulum_env.bench.source import Source
from pendulum_env.lab import Recording

LENGTH, GAMMA, RELEASE = 0.353, 0.05, 0.3
"""Length [m], decay ``theta'' = ... - gamma theta'`` [1/s] and angle of release [rad] of the simulated swing."""


class Swing:
    """The motion of a scene, let go at 0 s: angles [rad] and velocities [rad/s] at any times up to ``duration``."""

    def __init__(self, duration: float) -> None:
        run = rollout("vacuum", integrator="rk4", damping={"linear": {"gamma": GAMMA}}, length=LENGTH, angle=RELEASE,
                      velocity=0.0, duration=duration, dt=0.002, every=5, diagnostics=(), warn=False)
        self.duration = duration
        self._curve = CubicHermiteSpline(run.time, run.angle, run.velocity)

    def angle(self, at: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(self._curve(np.clip(at, 0.0, self.duration)))

    def velocity(self, at: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(self._curve(np.clip(at, 0.0, self.duration), 1))

    def acceleration(self, at: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(self._curve(np.clip(at, 0.0, self.duration), 2))


def recorded(source: Source, path: Path, duration: float, *, longest: float = 30.0) -> Recording:
    """The recording of a run of ``duration`` on the source's clock, read from its journal."""
    acquisition = Acquisition(source)
    acquisition.open()
    try:
        acquisition.start(path)
        until = time.monotonic() + longest
        while acquisition.status.time < duration and time.monotonic() < until and acquisition.poll():
            pass
        acquisition.stop()
    finally:
        acquisition.close()
    return Recording.read(path)
