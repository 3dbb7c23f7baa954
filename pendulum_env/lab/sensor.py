"""A rotary motion sensor in software: recordings with a known truth, from a rollout."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pendulum_env.lab.checked import FloatArray
from pendulum_env.lab.recording import Recording, RecordingError
from pendulum_env.physics.units import Checked, choice, si
from pendulum_env.provenance import provenance
from pendulum_env.replacing import replacing

ZEROS = {"at_start": "the first reading is 0, wherever the bob stood", "bottom": "0 is straight down"}


class Motion(Protocol):
    """What is recorded: ``time`` [s], ``angle`` [rad] and ``velocity`` [rad/s], arrays of one length."""

    @property
    def time(self) -> FloatArray: ...
    @property
    def angle(self) -> FloatArray: ...
    @property
    def velocity(self) -> FloatArray: ...


@dataclass(frozen=True)
class VirtualSensor(Checked):
    """What a sensor makes of a motion: ``quantum * round((theta(t_k) - zero + noise_k) / quantum)`` at ``t_k``.

    ``t_k = k / rate + jitter u_k``, ``u_k`` uniform in [-1, 1]: the stamps are right, and uneven. ``noise_k`` is
    Gaussian. Raises SceneError for values out of range, and for a jitter that would swap stamps.
    """

    quantum: float = si(math.radians(0.25), "rad", "smallest step of a reading; 0 for none", least=0.0)
    rate: float = si(20.0, "Hz", "readings a second", above=0.0)
    jitter: float = si(0.0, "s", "largest deviation of a stamp from even ones", least=0.0)
    noise: float = si(0.0, "rad", "standard deviation of a reading before it is rounded", least=0.0)
    zero: str = choice("at_start", ZEROS, "where the sensor reads 0")

    def record(self, motion: Motion, seed: int = 0, hand: float = 0.0) -> Recording:
        """The motion as recorded, from its first time on.

        Args:
            motion: a rollout, or anything with its arrays, close enough for cubic interpolation.
            seed: of noise and jitter.
            hand: seconds before the motion begins in which the bob hangs still, is pulled aside and held.

        Raises RecordingError for a motion of fewer than 3 readings.
        """
        from scipy.interpolate import CubicHermiteSpline

        source = np.random.default_rng(seed)
        first, last = float(motion.time[0]), float(motion.time[-1])
        count = math.floor((last - first + hand) * self.rate * (1.0 + 1e-12)) + 1
        if count < 3:
            raise RecordingError(f"virtual sensor: expected at least 3 readings, {last - first:g} s give {count}")
        jitter = min(self.jitter, 0.45 / self.rate) * source.uniform(-1.0, 1.0, count)
        jitter[0] = 0.0
        stamps = np.arange(count) / self.rate + jitter
        stamps[-1] = min(stamps[-1], last - first + hand)
        curve = CubicHermiteSpline(motion.time - first, motion.angle, motion.velocity)
        angle = np.where(stamps < hand, motion.angle[0] * _pulled(stamps, hand), curve(np.maximum(stamps - hand, 0.0)))
        angle = angle - (float(angle[0]) if self.zero == "at_start" else 0.0)
        angle = angle + self.noise * source.standard_normal(count)
        read = self.quantum * np.round(angle / self.quantum) if self.quantum else angle
        return Recording(stamps, read, "virtual sensor", ("simulated: not a recording of a real pendulum",))

    def write(self, path: str | os.PathLike[str], motion: Motion, seed: int = 0, hand: float = 0.0) -> None:
        """The same as a sensor's text file: seconds and degrees behind a header; OutputError if that fails."""
        from pathlib import Path

        found = self.record(motion, seed, hand)
        facts = provenance(quantum=self.quantum, rate=self.rate, jitter=self.jitter, noise=self.noise, seed=seed)
        rows = zip(found.time, np.degrees(found.angle), strict=True)
        with replacing(Path(path)) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
            file.write("# Simulated: not a recording of a real pendulum\n")
            file.writelines(f"# {name}: {value}\n" for name, value in facts.items())
            file.write("Time (s)\tAngle (deg)\n")
            file.writelines(f"{time:.6f}\t{angle:.6g}\n" for time, angle in rows)


def _pulled(time: FloatArray, hand: float) -> FloatArray:
    """Share of the release angle that the hand has reached: still for a third, pulled for a third, then held."""
    share = np.clip(3.0 * time / hand - 1.0, 0.0, 1.0) if hand > 0.0 else np.ones_like(time)
    return np.asarray(share * share * (3.0 - 2.0 * share))
