"""A simulated rotary motion sensor, which makes a recording of a rollout, so that the true motion is known."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from pendulum_env.common.provenance import provenance
from pendulum_env.common.replacing import replacing
from pendulum_env.lab.checked import FloatArray, RecordingError, numbers
from pendulum_env.lab.recording import Recording
from pendulum_env.physics.sensor import ZEROS, Sensor, rounded, taken
from pendulum_env.physics.units import SceneError, choice, file_path, number, one_of, shown, si, whole_number

MOST_SEED = 2**64 - 1
SIMULATED = "simulated: not a recording of a real pendulum"


class Moving(Protocol):
    """A motion to record: ``time`` [s], ``angle`` [rad] and ``velocity`` [rad/s], arrays of one length."""

    @property
    def time(self) -> FloatArray: ...
    @property
    def angle(self) -> FloatArray: ...
    @property
    def velocity(self) -> FloatArray: ...


@dataclass(frozen=True, repr=False)
class VirtualSensor(Sensor):
    """A :class:`pendulum_env.physics.sensor.Sensor` that records rollouts, with readings at the times ``t_k``.

    It reads ``quantum * round((scale (theta(t_k) - zero) + offset + noise_k) / quantum)``. The times are
    ``t_k = k / rate + jitter u_k``, with ``u_k`` uniform in [-1, 1] and k = 0, 1, ...; the first and the last time stay
    within the motion. The recorded time stamps are exact, but uneven. ``noise_k`` is Gaussian. ``zero`` is the angle at
    t_0 for "at_start", and 0 for "bottom". An encoder with N counts per turn has the quantum ``2 pi / N``.

    Raises SceneError for values out of range, such as a jitter of half a step or more, which would swap readings.
    """

    quantum: float = si(math.radians(0.25), "rad", "smallest step between readings; 0 for no rounding", least=0.0)
    rate: float = si(20.0, "Hz", "readings per second", above=0.0)
    jitter: float = si(0.0, "s", "largest deviation of a time stamp from even spacing", least=0.0)
    zero: str = choice("at_start", ZEROS, "angle at which the sensor reads 0")

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.jitter < 0.5 / self.rate:
            most = f"half a step, {0.5 / self.rate:g} s at {self.rate:g} Hz"
            raise SceneError(f"jitter must be below {most}, to keep readings in order, not {self.jitter!r}.")

    def record(self, motion: Moving, seed: int = 0, hand: float = 0.0) -> Recording:
        """Return a recording of a motion, with time 0 at the first reading.

        Args:
            motion: a single rollout, or another object with its arrays, at times close enough for cubic (Hermite)
                interpolation.
            seed: seed of noise and jitter, a whole number from 0.
            hand: duration [s] before the motion begins: for a third of it the bob hangs still at the bottom, for a
                third it is pulled aside by hand, then it is held.

        Raises RecordingError for a batch, for an object that is not a motion, and for fewer than 3 readings; SceneError
        for a seed or hand out of range.
        """
        source = np.random.default_rng(whole_number(seed, "seed", MOST_SEED, 0))
        hand = number(hand, "hand", least=0.0, unit="s")
        time, angle, velocity = _checked_motion(motion)
        end = float(time[-1] - time[0]) + hand
        most = end * self.rate * (1.0 + 1e-12)
        if not 2.0 <= most < 1e8:
            raise RecordingError(f"virtual sensor: {end:g} s at {self.rate:g} Hz must give 3 to 100 million readings")
        count = math.floor(most) + 1
        stamps = np.arange(count) / self.rate + self.jitter * source.uniform(-1.0, 1.0, count)
        stamps[0], stamps[-1] = 0.0, min(stamps[-1], end)
        free = np.minimum(np.maximum(stamps - hand, 0.0) + time[0], time[-1])
        true = np.where(stamps < hand, angle[0] * _pulled(stamps, hand), _between(time, angle, velocity, free))
        read = taken(true, true[0] if self.zero == "at_start" else 0.0, self.scale, self.offset)
        read = read + self.noise * source.standard_normal(count)
        if self.quantum:
            read = rounded(read, self.quantum)
        if self.dropout:
            kept = source.random(count) >= self.dropout
            kept[0] = True
            read = read[np.maximum.accumulate(np.where(kept, np.arange(count), 0))]
        return Recording(stamps, read + 0.0, "virtual sensor", (SIMULATED,))

    def write(
        self,
        path: str | os.PathLike[str],
        motion: Moving,
        form: str = "sensor",
        *,
        seed: int = 0,
        hand: float = 0.0,
    ) -> None:
        """Record a motion and write the recording to a text file that :meth:`Recording.read` can read.

        Args:
            path: the file.
            motion, seed, hand: arguments as of :meth:`record`.
            form: "sensor" (seconds and degrees, separated by tabs), "csv" (seconds and degrees, separated by commas) or
                "encoder" (the rate in the header, then one angle in degrees per line; only without jitter).

        Times are written to 1e-6 s and angles to 10 digits, after comments that describe the simulation. Raises
        the errors of :meth:`record`, SceneError for an unknown form and for the form "encoder" with jitter, OutputError
        if the file cannot be written.
        """
        target = file_path(path, "path")
        one_of(form, "form", FORMS)
        if form == "encoder" and self.jitter:
            raise SceneError(f"jitter must be 0 for the form 'encoder', which has no time stamps, not {self.jitter!r}.")
        recording = self.record(motion, seed, hand)
        facts = {"sensor": repr(self), "form": form, "seed": str(seed), "hand": str(hand), **_facts(motion)}
        text = text_of_recording(recording, form, self.rate, provenance(**facts))
        with replacing(target) as temporary:
            temporary.write_text(text, encoding="utf-8", newline="\n")


def text_of_recording(recording: Recording, form: str, rate: float, facts: Mapping[str, str]) -> str:
    """Return the text of the file of a simulated recording, with the named ``facts`` as comments in its first lines.

    ``form`` is "sensor", "csv" or "encoder", as in :meth:`VirtualSensor.write`; ``rate`` is the sampling rate [Hz].
    """
    comments = [f"# {SIMULATED}", *(f"# {name}: {' '.join(fact.split())}" for name, fact in facts.items())]
    return "\n".join([*comments, *FORMS[form](recording, rate), ""])


def _stamped(separator: str) -> Callable[[Recording, float], list[str]]:
    """Return a function that lists the lines of a recording's file, times and angles in columns, from a recording."""
    def lines(recording: Recording, rate: float) -> list[str]:
        rows = zip(recording.time.tolist(), np.degrees(recording.angle).tolist(), strict=True)
        title = separator.join(("Time (s)", "Angle (deg)"))
        return [title, *(f"{time:.6f}{separator}{angle:.10g}" for time, angle in rows)]

    return lines


def _encoder(recording: Recording, rate: float) -> list[str]:
    """Return the lines of an encoder's file: two header lines with the rate [Hz], then one angle [degrees] per line."""
    names = "start_deg, sample_rate, duration_sec"
    angles = np.degrees(recording.angle).tolist()
    values = f"{angles[0]:.10g}, {rate!r}, {recording.time[-1]:.10g}"
    return [names, values, *(f"{angle:.10g}" for angle in angles)]


FORMS: Mapping[str, Callable[[Recording, float], list[str]]] = {
    "sensor": _stamped("\t"), "encoder": _encoder, "csv": _stamped(","),
}
"""File format -> function of a recording and its rate [Hz] that returns the lines of the file below its comments."""


def _checked_motion(motion: Any) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the times, angles and velocities of a motion; RecordingError for anything that is not a single motion."""
    names = ("time", "angle", "velocity")
    if not all(hasattr(motion, name) for name in names):
        raise RecordingError(f"a motion must have time, angle and velocity, like a rollout, got {shown(motion)}")
    time, angle, velocity = (numbers(getattr(motion, name), f"motion.{name}") for name in names)
    if angle.ndim == 2:
        raise RecordingError(f"a sensor records one motion, got a batch of {len(angle)}: roll out a single start")
    if time.ndim != 1 or not time.shape == angle.shape == velocity.shape or len(time) < 2:
        shapes = f"{time.shape}, {angle.shape} and {velocity.shape}"
        raise RecordingError(f"time, angle and velocity must be arrays of one length from 2, got shapes {shapes}")
    if not all(np.isfinite(values).all() for values in (time, angle, velocity)) or not (np.diff(time) > 0).all():
        raise RecordingError("a motion must have finite values, at times that increase")
    return time, angle, velocity


def _between(time: FloatArray, angle: FloatArray, velocity: FloatArray, at: FloatArray) -> FloatArray:
    """Interpolate the angle at the times ``at`` by cubic Hermite polynomials in angle and velocity."""
    i = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 2)
    h = time[i + 1] - time[i]
    s = (at - time[i]) / h
    rise, start, end = angle[i + 1] - angle[i], h * velocity[i], h * velocity[i + 1]
    return np.asarray(angle[i] + s * (start + s * (3.0 * rise - 2.0 * start - end + s * (start + end - 2.0 * rise))))


def _pulled(time: FloatArray, hand: float) -> FloatArray:
    """Return the share of the release angle at times before the release, while a hand moves the bob.

    The bob hangs still for a third of the time, is pulled aside for a third, and is then held.
    """
    third = hand / 3.0
    share = np.clip((time - third) / third, 0.0, 1.0) if third > 1e-9 else np.ones_like(time)
    return np.asarray(share * share * (3.0 - 2.0 * share))


def _facts(motion: Any) -> dict[str, Any]:
    """Return scene, method, step and start of a rollout for a file's comments; for other objects, their type's name."""
    scene, method = getattr(motion, "scene", None), getattr(motion, "method", None)
    if scene is None or method is None:
        return {"motion": type(motion).__name__}
    start = {"angle": float(motion.angle[0]), "velocity": float(motion.velocity[0])}
    return {"integrator": method.name, "dt": motion.dt, **start, "scene": scene.to_dict()}
