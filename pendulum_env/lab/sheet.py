"""The lab sheet: the quantities of a free swing that students measure by hand, with errors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from pendulum_env.common.results import Plotted, one_line
from pendulum_env.lab.checked import Drop, RecordingError, check_half_turn, count, side
from pendulum_env.lab.measures import (
    FEWEST,
    SURE,
    Cycles,
    Losses,
    Measurement,
    corrected_periods,
    crossings,
    doubt_of_gravity,
    doubt_of_length,
    envelope_rate,
    losses,
    percent,
    period,
    small_amplitude_period,
)
from pendulum_env.lab.recording import Recording
from pendulum_env.lab.turning import CLEAR, TurningPoints, turning_points
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import FiniteBob, Gravity
from pendulum_env.physics.flow import regime, reynolds_number
from pendulum_env.physics.medium import air
from pendulum_env.physics.presets import find_scene
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, naming_keywords, number, shown

if TYPE_CHECKING:
    from pendulum_env.common.texts import Table

READ = 6
"""Number of amplitudes, spread over the run, in the lab sheet's short determination of the decay rate."""


@dataclass(frozen=True, eq=False, repr=False)
class LabSheet(Plotted):
    """The quantities measured on a free swing, with errors; :func:`measure` returns it.

    Attributes:
        recording: the measured recording, cut at the release and centred on the equilibrium.
        scene: the pendulum with its known parameters.
        known_length: the length that the caller gave [m], with an error of 0 if that was not given; None without one.
        told: names of the parameters that the caller gave.
        oscillations: number of oscillations that ``period`` is the mean of.
        period: mean period [s].
        points: turning points, one amplitude per half swing.
        decay: damping rate gamma of theta ~ exp(-gamma t/2) from all amplitudes [1/s].
        short_decay: the damping rate from 6 (READ) amplitudes spread evenly over the run, as read by hand [1/s].
        cycles: the period of every cycle, corrected to small amplitude; None if it cannot be calculated.
        losses: constant, linear and quadratic parts of the loss per half swing; None for too few amplitudes.
        left_out: sentences on quantities that could not be calculated, and why.
    """

    recording: Recording
    scene: Scene
    known_length: Measurement | None
    told: frozenset[str]
    oscillations: int
    period: Measurement
    points: TurningPoints
    decay: Measurement
    short_decay: Measurement
    cycles: Cycles | None
    losses: Losses | None
    left_out: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return one_line(self, f"{self.recording.source}, T = {self.period}")

    @cached_property
    def small_period(self) -> Measurement:
        """Period at small amplitude [s], the mean of the corrected periods of the oscillations that ``period`` is the
        mean of, see :meth:`Cycles.mean`; without ``cycles`` the mean period, corrected for the amplitudes.
        """
        if self.cycles is None:
            return small_amplitude_period(self.period, self.points.amplitude)
        return self.cycles.mean(self._averaged(self.cycles))

    @property
    def mean_amplitude(self) -> float:
        """Mean amplitude [rad] of the oscillations that ``period`` is the mean of; of all without ``cycles``."""
        if self.cycles is None:
            return float(np.mean(self.points.amplitude))
        return float(np.mean(self.cycles.amplitude[:self._averaged(self.cycles)]))

    def _averaged(self, cycles: Cycles) -> int:
        """Return the number of cycles that belong to the oscillations that ``period`` is the mean of: fewer if readings
        are missing.
        """
        return int(np.searchsorted(cycles.time, cycles.time[0] + (self.oscillations - 0.5) * self.period.value))

    @property
    def half_decays(self) -> tuple[Measurement, Measurement] | None:
        """Damping rates gamma from the first and from the last half of the amplitudes [1/s]; None for fewer than six.
        """
        middle = len(self.points.time) // 2
        if middle < 3:
            return None
        return envelope_rate(self.points, slice(middle)), envelope_rate(self.points, slice(middle, None))

    @property
    def omega0(self) -> Measurement:
        """Angular frequency of small swings, ``2 pi/T0`` [rad/s]."""
        small = self.small_period
        return Measurement(math.tau / small.value, math.tau * small.error / small.value**2, "rad/s")

    @property
    def length(self) -> Measurement:
        """Length of the point pendulum with the measured small-amplitude period, ``g T0²/(4 pi²)`` [m]."""
        small, square = self.small_period, self.scene.gravity / math.tau**2
        return Measurement(square * small.value**2, 2.0 * square * small.value * small.error, "m")

    @property
    def gravity(self) -> Measurement | None:
        """Gravity that follows from the small-amplitude period and the given length [m/s²]; None without a length.

        ``g = L (2 pi/T0)²`` for a point, and for other bodies in proportion, ``g (omega0/omega)²`` with the scene's g
        and its angular frequency omega of small swings. Its error is that of T0 and of the given length.
        """
        if self.known_length is None:
            return None
        own, value = self.omega0, self.scene.gravity * (self.omega0.value / self.scene.omega0) ** 2
        return Measurement(value, value * math.hypot(2.0 * own.error / own.value,
                                                     self.known_length.error / self.known_length.value), "m/s²")

    @property
    def quality(self) -> Measurement:
        """Quality factor ``Q = omega0/gamma`` from all amplitudes [1]; inf if the amplitudes do not decay."""
        rate, omega = self.decay, self.omega0
        if rate.value <= 0.0:
            return Measurement(math.inf, math.inf, "1")
        value = omega.value / rate.value
        return Measurement(value, value * math.hypot(omega.error / omega.value, rate.error / rate.value), "1")

    @property
    def reynolds(self) -> tuple[float, float] | None:
        """Reynolds numbers of the bob at the bottom, in the first and the last half swing; None without a given radius.

        ``2 rho V a/mu`` with ``V = 2 omega0 L sin(A/2)``, where A is the first or the last amplitude.
        """
        if "radius" not in self.told or self.scene.medium.empty:
            return None
        length = self.scene.body.reach if "length" in self.told else self.length.value
        first, last = (reynolds_number(2.0 * self.omega0.value * length * math.sin(0.5 * float(size)), self.scene.body,
                                       self.scene.medium) for size in self.points.amplitude[[0, -1]])
        return first, last

    @property
    def table(self) -> Table:
        """Table of the lab sheet: one row per measured quantity, with value, standard error and method."""
        from pendulum_env.common.texts import Table

        size, swings = np.degrees(self.points.amplitude), len(self.points.amplitude)
        read, cycles = min(READ, swings), self.cycles
        error = float(np.degrees(np.median(self.points.error)))
        places = max(0, -math.floor(math.log10(error))) if error > 0.0 else 4
        rows = [
            ("amplitude, first and last", f"{size[0]:.{places}f}°, {size[-1]:.{places}f}° (± {error:.1g}°)",
             f"{swings} half swings"),
            ("period T", str(self.period), f"mean of {self.oscillations} oscillations"),
            ("period at small amplitude T0", str(self.small_period),
             f"mean of {self.oscillations if cycles is None else self._averaged(cycles)} cycles, "
             f"{'' if cycles is None else 'each '}corrected by K(sin(A/2))"),
            *([] if cycles is None else [_single_cycles(cycles)]),
            ("omega0", str(self.omega0), "2 pi/T0"),
            ("length of a point pendulum", str(self.length), f"g T0²/(4 pi²) with g = {self.scene.gravity:g} m/s²"),
            *(() if self.gravity is None or self.known_length is None else (
                ("gravity", str(self.gravity), f"from T0 and the given length of {self.known_length.value:g} m"),)),
            (f"gamma, {read} readings", str(self.short_decay), f"ln(amplitude) of {read} spread over the run, "
             "A ~ exp(-gamma t/2)"),
            ("gamma, all", str(self.decay), f"ln(amplitude) of all {swings}"),
            ("quality factor", str(self.quality).removesuffix(" 1") if self.decay.value > 0.0 else "no decay seen",
             "omega0/gamma of all"),
        ]
        if self.losses is not None:
            where = f"loss per half swing at {math.degrees(self.losses.amplitude):.3g}°"
            rows += [(f"{law} part of the loss", percent(part) if law in self.losses.told else "not told apart", where)
                     for law, part in self.losses.shares.items()]
        if self.reynolds is not None:
            first, last = self.reynolds
            medium = self.scene.medium.name
            rows.append(("Reynolds number", f"{first:.0f} to {last:.0f}", f"of the bob at the bottom, in {medium}"))
        return Table(("quantity", "value", "how"), tuple(rows))

    @property
    def numbers(self) -> Table:
        """Table of the lab sheet for further calculation: quantity, value, standard error and unit in columns."""
        from pendulum_env.common.texts import Table

        size, error = np.degrees(self.points.amplitude), np.degrees(self.points.error)
        rows = [("first amplitude", size[0], error[0], "deg"), ("last amplitude", size[-1], error[-1], "deg"),
                *((name, one.value, one.error, one.unit) for name, one in (
                    ("period T", self.period), ("period at small amplitude T0", self.small_period),
                    ("omega0", self.omega0), ("length of a point pendulum", self.length),
                    *(() if self.gravity is None else (("gravity", self.gravity),)),
                    (f"gamma, {min(READ, len(size))} readings", self.short_decay), ("gamma, all", self.decay),
                    ("quality factor", self.quality)))]
        if self.losses is not None:
            rows += [(f"{law} part of the loss", 100.0 * part.value, 100.0 * part.error, "%")
                     for law, part in self.losses.told.items()]
        if self.reynolds is not None:
            rows += [(f"{which} Reynolds number", one, math.nan, "1")
                     for which, one in zip(("first", "last"), self.reynolds, strict=True)]
        return Table(("quantity", "value", "error", "unit"),
                     tuple((name, *("" if not math.isfinite(x) else f"{x:.9g}" for x in pair), unit)
                           for name, *pair, unit in rows))

    @property
    def text(self) -> str:
        """Summary of the lab sheet, the quantities measured on a free swing, in a few sentences."""
        lines = [
            f"{self.recording.source}: {self.oscillations} oscillations of {self.period}; at small amplitude "
            f"{self.small_period}, the period of a point pendulum of length {self.length} at "
            f"g = {self.scene.gravity:g} m/s²."
        ]
        if self.gravity is not None and self.known_length is not None:
            without = "" if self.known_length.error else ", without the error of the length (--length-error)"
            lines.append(f"With the given length of {self.known_length.value:g} m, g = {self.gravity}{without}.")
            lines += doubt_of_gravity(self.gravity.value, self.scene.gravity)
        if self.known_length is None:
            lines += doubt_of_length(self.small_period.value, self.length.value)
        drift = None if self.cycles is None else self.cycles.drift
        if drift is not None and abs(drift.value) > SURE * drift.error:
            lines.append(f"T0 drifts by {Measurement(1e3 * drift.value, 1e3 * drift.error, 'ms')} over the run: angles "
                         "look scaled or displaced; try lab-pendulum fit --free length,scale.")
        if self.cycles is not None and self.cycles.left_out:
            lines.append(f"T0 leaves out {self.cycles.left_out} of the cycles, because readings are missing in them.")
        if self.losses is not None:
            lines.append(f"From the envelope, {self.losses.text}.")
        if self.half_decays is not None:
            first, last = self.half_decays
            if abs(first.value - last.value) > 3.0 * math.hypot(first.error, last.error):
                lines.append(f"The decay is not exponential: the damping rate gamma is {first} in the first half of "
                             f"the swings and {last} in the second.")
        if self.reynolds is not None:
            lines.append(f"Reynolds number {self.reynolds[0]:.0f} of the bob in the first half swing: "
                         f"{regime(self.reynolds[0])}.")
        return "\n".join([*lines, *self.left_out])


def measure(
    recording: Recording,
    *,
    n: int | None = None,
    scene: str | Scene | Mapping[str, object] | PathLike[str] | None = None,
    until: float | None = None,
    above: float | str | None = None,
    drop: Drop | None = None,
    length_error: float | None = None,
    **parameters: Any,
) -> LabSheet:
    """Measure the quantities of a lab sheet on a recorded free swing, with errors.

    These are the period as the mean of n oscillations between interpolated zero crossings, the amplitude of every half
    swing, the damping rate from six amplitudes and from all, omega0 corrected for the amplitude by the
    elliptic integral, the length from g, the quality factor, the Reynolds number, and how the loss per half swing grows
    with the amplitude.

    Args:
        recording: the recording as read; it is cut at the release and centred.
        n: number of oscillations for the mean period, from the first; None for all.
        scene: the pendulum and its surroundings, as for ``gym.make``; by default a pendulum in air with the given
            ``parameters``.
        until: time of the recording [s] after which readings are left out.
        above: share of the first amplitude, such as 0.05 or "5%", below which swings are left out.
        drop: times of the recording [s] between which readings are left out: "12.5:13.1", (12.5, 13.1), or several.
        length_error: error of the given length [m], for the error of the gravity that follows from it.
        **parameters: known parameters of the scene, such as ``length=0.65, radius=0.011``. A length gives the gravity.
            The Reynolds number needs a radius; without a given length, it uses the length from the period.

    Raises RecordingError if the argument is not a Recording, or has no full oscillation or fewer than three amplitudes;
    SceneError for an invalid scene or parameter.
    """
    if not isinstance(recording, Recording):
        raise RecordingError(f"recording must be a Recording, for example from Recording.read, not {shown(recording)}")
    taken = count(n, "oscillations")
    with naming_keywords(measure):
        known = apparatus(scene, parameters)
    if length_error is not None and "length" not in parameters:
        raise SceneError("length_error needs length; give the measured length.")
    error = 0.0 if length_error is None else number(length_error, "length_error", least=0.0, unit="m")
    if not known.gravity > 0.0:
        raise SceneError("gravity must be above 0 m/s^2, as the length follows from it and the period.")
    swing = recording.kept(until=until, drop=drop).released().kept(above=above).centred()
    mean, points = period(swing, taken), turning_points(swing)
    check_half_turn(points.amplitude, "the lab sheet needs")
    if taken is None:
        ends = crossings(swing.time, swing.angle, level=CLEAR * swing.noise)
        taken = round(float(ends[-1] - ends[0]) / mean.value)
    given = frozenset(parameters) | frozenset(known.parameters() if scene is not None else ())
    spread = np.unique(np.round(np.linspace(0, len(points.time) - 1, READ)).astype(np.intp))
    long = Measurement(float(parameters["length"]), error, "m") if "length" in parameters else None
    cycles, no_cycles = side("the periods of single cycles", lambda: corrected_periods(swing))
    parts, no_parts = side("the loss per half swing",
                           lambda: losses(points) if len(points.time) >= FEWEST else None)
    return LabSheet(swing, known, long, given, taken, mean, points, envelope_rate(points),
                    envelope_rate(points, spread), cycles, parts, tuple(filter(None, (no_cycles, no_parts))))


def _single_cycles(cycles: Cycles) -> tuple[str, str, str]:
    """Return the row of the lab sheet's table for the periods of single cycles."""
    drift, how = cycles.drift, f"{len(cycles.time)} cycles"
    if abs(drift.value) > SURE * drift.error:
        size = Measurement(1e3 * abs(drift.value), 1e3 * drift.error, "ms")
        how += f"; a line through them {'rises' if drift.value > 0.0 else 'falls'} by {size} over the run"
    elif math.isfinite(drift.error):
        how += "; they neither rise nor fall over the run"
    return "T0 of single cycles", f"within {100.0 * cycles.spread:.2g} % of their mean", how


def apparatus(scene: str | Scene | Mapping[str, object] | PathLike[str] | None, known: Mapping[str, Any]) -> Scene:
    """Return the pendulum of a recording as a scene with its ``known`` parameters.

    A ``scene`` of None stands for an undamped pendulum in air of 20 °C, with a bob of finite size if the radius is
    known. Raises SceneError for an invalid scene or parameter.
    """
    if scene is not None:
        return find_scene(scene).replace(**known)
    sized = (FiniteBob(),) if "radius" in known else ()
    return Scene("recorded", Body(), air(20.0), (Gravity(), *sized)).replace(**known)
