"""What the student measured: a period or a recording, the length, the ball; and the angular frequency from them."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from os import PathLike
from typing import Any

import numpy as np

from pendulum_env.common.checks import warn
from pendulum_env.lab.amplitudes import AmplitudeSheet, measure_amplitudes
from pendulum_env.lab.hand import half_a_digit as last_digit
from pendulum_env.lab.kater import KaterSheet, measure_kater
from pendulum_env.lab.lengths import LengthSheet, measure_lengths
from pendulum_env.lab.measures import UNLIKELY, Measurement
from pendulum_env.lab.recording import Recording, RecordingError
from pendulum_env.lab.sheet import LabSheet, measure
from pendulum_env.lab.simulated import SCENE, simulated_recording
from pendulum_env.physics.body import Body
from pendulum_env.physics.presets import SCENES
from pendulum_env.physics.units import SceneError, number, other_units, shown

GRAVITY = Measurement(SCENES["exercise"].gravity, 0.03, "m/s²")
"""Gravitational acceleration of the exercise; the error covers all places on the Earth, from 9.78 to 9.83 m/s²."""
SHORTEST, LONGEST = 0.3, 10.0
"""Periods for which the exercise's step of 0.01 s and its run of 10 s make sense [s]."""
REMEDIES = {"recording": " --read rate=100 or time_unit=ms sets the time base.", "period": "",
            "length": " Lengths are in m from the pivot to the ball's centre."}
"""What may be wrong with a period that does not suit, by the measurement that it follows from."""
EDGES = re.compile(r"\s*(\d+\.?\d*|\.\d+)\s*m?\s*(?:(?:±|\+-|\+/-)\s*(\d+\.?\d*|\.\d+)\s*m?\s*)?")
"""Distance of the knife edges of a reversible pendulum, with its error or without."""
OSCILLATIONS = 6
"""Number of oscillations over which the period is averaged, if the recording has so many."""


@dataclass(frozen=True)
class Omega:
    """Angular frequency of small swings from one kind of measurement.

    Attributes:
        how: "recording", "period" or "length".
        value: angular frequency, with its error [rad/s].
        period: period of small swings, with its error [s].
    """

    how: str
    value: Measurement
    period: Measurement


@dataclass(frozen=True, eq=False)
class Given:
    """The measured values that the report starts from.

    Attributes:
        body: ball and wire; the exercise's, with the given changes.
        assumed: names of the sizes that were not given.
        frequencies: angular frequency from every measurement; the first one is used.
        gravity: gravitational acceleration that belongs to this frequency and the body's length [m/s²].
        recording: the recording as read.
        simulated: True if the recording is the simulated one of the package.
        sheet: quantities measured on the recording; its period is the mean of 5 to 6 oscillations.
        amplitude: mean amplitude of these oscillations [rad].
        recorded: angular frequency of the recorded pendulum.
        amplitudes: amplitudes read by hand, which the damping follows from; None without them.
        lengths: periods against lengths; None without them.
        kater: timings of a reversible pendulum; None without them.
    """

    body: Body
    assumed: frozenset[str]
    frequencies: tuple[Omega, ...]
    gravity: float
    recording: Recording
    simulated: bool
    sheet: LabSheet
    amplitude: float
    recorded: Omega
    amplitudes: AmplitudeSheet | None = None
    lengths: LengthSheet | None = None
    kater: KaterSheet | None = None

    @property
    def omega(self) -> Omega:
        """Angular frequency that the simulations use."""
        return self.frequencies[0]

    @classmethod
    def of(
        cls,
        *,
        recording: Recording | None = None,
        period: float | None = None,
        period_error: float | None = None,
        length: float | None = None,
        length_error: float | None = None,
        mass: float | None = None,
        radius: float | None = None,
    ) -> Given:
        """Check the measured values and return them with the angular frequency.

        The frequency comes from the recording, else from the period, else from length and g. An error that is not given
        is half a unit of the value's last digit. Without a recording, the simulated one of the package is used for the
        damping and the comparison.

        Args:
            recording: recording of a free swing.
            period, period_error: period of small swings, measured by hand [s].
            length, length_error: distance from the pivot to the ball's centre [m].
            mass, radius: mass [kg] and radius [m] of the ball.

        Warns of sizes that are unusual, but usual in another unit. Raises SceneError for values that contradict each
        other or are out of range, RecordingError for a recording without a swing below half a turn.
        """
        if recording is not None and period is not None:
            raise SceneError("--period and --recording both give the period; leave one of them out.")
        lasting = measured(period, period_error, "period", "s")
        long = measured(length, length_error, "length", "m")
        sizes = {"length": length, "mass": mass, "radius": radius}
        own = {name: number(value, name, above=0.0) for name, value in sizes.items() if value is not None}
        if lasting is not None:
            reasonable(lasting.value, "A period")
        simulated = recording is None
        swing = simulated_recording() if recording is None else recording
        ball = {"mass": SCENE["mass"], "radius": SCENE["radius"]} if simulated else own
        sheet = first_oscillations(swing, ball)
        recorded = Omega("recording", sheet.omega0, sheet.small_period)
        frequencies = [] if simulated else [recorded]
        if lasting is not None:
            frequencies.append(Omega("period", angular(lasting), lasting))
        body = Body(**{**exercise_ball(), **own})
        if long is not None or not frequencies:
            frequencies.append(from_length(long or half_a_digit(body.length, "m")))
        omega, gravity = frequencies[0].value.value, GRAVITY.value
        if length is None:
            own["length"] = GRAVITY.value / omega**2
        elif frequencies[0].how != "length":
            gravity = omega**2 * length
            if abs(gravity / GRAVITY.value - 1.0) > UNLIKELY:
                raise SceneError(
                    f"A period of {frequencies[0].period.value:.4g} s and a length of {length:g} m give g = "
                    f"{gravity:.4g} m/s², which cannot be: the length or the time base is wrong. Periods are in s, "
                    "lengths in m from the pivot to the ball's centre.")
        reasonable(frequencies[0].period.value, "A pendulum with a period", REMEDIES[frequencies[0].how])
        for sentence in other_units(Body(**{**exercise_ball(), **own}), gravity):
            warn(sentence)
        assumed = frozenset(name for name, value in sizes.items() if value is None)
        return cls(Body(**{**exercise_ball(), **own}), assumed, tuple(frequencies), gravity, swing, simulated, sheet,
                   sheet.mean_amplitude, recorded)


def by_hand(
    given: Given, amplitudes: str | None = None, lengths: str | PathLike[str] | None = None,
    kater: str | PathLike[str] | None = None, edges: str | None = None,
) -> Given:
    """Return the measured values with what was read by hand: amplitudes, periods against lengths, and the timings of a
    reversible pendulum with the distance of its knife edges in m, a text such as "0.9938" or "0.9938+-0.0002".

    Each is as :func:`pendulum_env.lab.measure_amplitudes`, ``measure_lengths`` and ``measure_kater`` read it;
    amplitudes along a ruler are at the length of the pendulum. Raises RecordingError for readings that cannot be used,
    SceneError for a reversible pendulum without the distance, or the distance without a pendulum.
    """
    if (kater is None) != (edges is None):
        raise SceneError("--kater and --knife-edges need each other: the timings of a reversible pendulum and the "
                         "distance between its knife edges in m.")
    read = None if amplitudes is None else measure_amplitudes(
        amplitudes, length=given.body.length, period=given.omega.period.value)
    table = None if lengths is None else measure_lengths(lengths)
    swung = None
    if kater is not None and edges is not None:
        found = EDGES.fullmatch(edges)
        if found is None:
            raise SceneError("--knife-edges must be a distance in m, with its error or without, as 0.9938 or "
                             f"0.9938+-0.0002, not {shown(edges)}")
        swung = measure_kater(kater, float(found[1]), edges_error=float(found[2] or last_digit([found[1]])))
    return replace(given, amplitudes=read, lengths=table, kater=swung)


def exercise_ball() -> dict[str, Any]:
    """Return the exercise's ball and wire as arguments of a Body."""
    body = SCENES["exercise"].body
    return {"length": body.reach, "mass": body.mass, "radius": body.radius, "suspension": body.suspension}


def measured(value: float | None, error: float | None, name: str, unit: str) -> Measurement | None:
    """Return a given value with its error, by default half a unit of its last digit; None if it is not given.

    Raises SceneError for numbers out of range, and for an error without a value.
    """
    if value is None:
        if error is not None:
            raise SceneError(f"--{name}-error needs --{name}; give the measured {name}.")
        return None
    checked = number(value, f"--{name}", above=0.0, unit=unit)
    if error is None:
        return half_a_digit(checked, unit)
    return Measurement(checked, number(error, f"--{name}-error", above=0.0, unit=unit), unit)


def half_a_digit(value: float, unit: str) -> Measurement:
    """Return a value with an error of half a unit of its last digit: 1.19 gets 0.005."""
    return Measurement(value, last_digit([repr(value)]), unit)


def reasonable(seconds: float, what: str, remedy: str = "") -> None:
    """Raise SceneError for a period [s] that the exercise's step and run do not suit; ``remedy`` ends its text."""
    if not SHORTEST <= seconds <= LONGEST:
        raise SceneError(f"{what} of {seconds:.4g} s does not suit the exercise, which takes steps of 0.01 s for 10 s; "
                         f"it must be from {SHORTEST:g} to {LONGEST:g} s.{remedy}")


def angular(one: Measurement) -> Measurement:
    """Return the angular frequency 2 pi/T [rad/s] of a period T [s], with its error."""
    return Measurement(math.tau / one.value, math.tau * one.error / one.value**2, "rad/s")


def from_length(length: Measurement) -> Omega:
    """Return the angular frequency sqrt(g/L) [rad/s] of a length L [m], with its error."""
    value = math.sqrt(GRAVITY.value / length.value)
    share = 0.5 * math.hypot(GRAVITY.error / GRAVITY.value, length.error / length.value)
    seconds = math.tau / value
    return Omega("length", Measurement(value, share * value, "rad/s"), Measurement(seconds, share * seconds, "s"))


def first_oscillations(recording: Recording, own: dict[str, Any]) -> LabSheet:
    """Return the quantities measured on a recording, with the periods of its first OSCILLATIONS.

    Raises RecordingError if nothing swings, or if the bob goes over the top, as in a recording in degrees that was read
    as radians.
    """
    free = recording.released()
    largest = float(np.ptp(free.angle)) / 2.0
    if largest >= math.pi:
        raise RecordingError(
            f"{recording.source}: the bob swings out to {math.degrees(largest):.4g}°, over the top. If these angles "
            "are in degrees, add --read unit=deg")
    whole = measure(recording, **own)
    return measure(recording, n=OSCILLATIONS, **own) if whole.oscillations > OSCILLATIONS else whole
