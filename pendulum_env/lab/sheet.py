"""The lab sheet: what is measured on a free swing by hand, with errors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from pendulum_env.lab.checked import RecordingError, count
from pendulum_env.lab.cycles import Cycles, corrected_periods
from pendulum_env.lab.losses import FEWEST, Losses, losses, percent
from pendulum_env.lab.measures import Measurement, crossings, decay_rate, period
from pendulum_env.lab.recording import Recording
from pendulum_env.lab.turning import CLEAR, TurningPoints, turning_points
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import FiniteBob, Gravity
from pendulum_env.physics.flow import regime, reynolds_number
from pendulum_env.physics.medium import air
from pendulum_env.physics.presets import find_scene
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import naming_keywords, shown

if TYPE_CHECKING:
    from pendulum_env.common.tables import Table

READ = 6
"""Amplitudes that the lab sheet reads off for the decay."""


@dataclass(frozen=True, eq=False)
class LabSheet:
    """Measured on a free swing; see :func:`measure`.

    Attributes:
        recording: as measured: from the release on, about its equilibrium.
        scene: what is known of the pendulum.
        told: names of its numbers that were told.
        oscillations: how many ``period`` is the mean of.
        period: [s].
        points: turning points, an amplitude per half swing.
        decay: damping rate gamma of theta ~ exp(-gamma t/2) from all amplitudes [1/s].
        first_decay: the same from the first few, see READ.
        cycles: the period of each cycle, corrected for its amplitude.
        losses: the law of the damping as the envelope shows it; None where the amplitudes are too few.
    """

    recording: Recording
    scene: Scene
    told: frozenset[str]
    oscillations: int
    period: Measurement
    points: TurningPoints
    decay: Measurement
    first_decay: Measurement
    cycles: Cycles
    losses: Losses | None

    @cached_property
    def small_period(self) -> Measurement:
        """Period at small amplitude, the mean of the corrected ones [s].

        The error: that of the crossings, that of the amplitudes, and, where the corrected period changes over the run
        by more than its error, that change over sqrt(12).
        """
        cycles, points = self.cycles, self.points
        value, number = float(cycles.period.mean()), len(cycles.period)
        size = points.amplitude
        amplitude = value * math.sqrt(float(np.sum(np.square(size * points.error / 8.0)))) / len(size)
        crossing = self.period.error * self.oscillations / number
        drift = cycles.drift
        slow = max(drift.value**2 - drift.error**2, 0.0) / 12.0 if math.isfinite(drift.error) else 0.0
        return Measurement(value, math.sqrt(crossing**2 + amplitude**2 + slow), "s")

    @property
    def omega0(self) -> Measurement:
        """``2 pi/T0`` [rad/s], of small swings."""
        small = self.small_period
        return Measurement(math.tau / small.value, math.tau * small.error / small.value**2, "rad/s")

    @property
    def length(self) -> Measurement:
        """``g T0²/(4 pi²)`` [m]: of the simple pendulum that swings as fast."""
        small, square = self.small_period, self.scene.gravity / math.tau**2
        return Measurement(square * small.value**2, 2.0 * square * small.value * small.error, "m")

    @property
    def quality(self) -> Measurement:
        """``Q = omega0/gamma`` of all amplitudes [1]; inf where they do not decay."""
        rate, omega = self.decay, self.omega0
        if rate.value <= 0.0:
            return Measurement(math.inf, math.inf, "1")
        value = omega.value / rate.value
        return Measurement(value, value * math.hypot(omega.error / omega.value, rate.error / rate.value), "1")

    @property
    def reynolds(self) -> tuple[float, float] | None:
        """Reynolds number at the bottom, of the first half swing and of the last; None where the radius was not told.

        ``2 rho V a/mu`` with ``V = 2 omega0 L sin(A/2)``, A the first and the last amplitude.
        """
        if "radius" not in self.told or self.scene.medium.empty:
            return None
        length = self.scene.body.length if "length" in self.told else self.length.value
        first, last = (reynolds_number(2.0 * self.omega0.value * length * math.sin(0.5 * float(size)), self.scene.body,
                                       self.scene.medium) for size in self.points.amplitude[[0, -1]])
        return first, last

    @property
    def table(self) -> Table:
        """Quantity, value with its standard error, and how it was measured."""
        from pendulum_env.common.tables import Table

        size, swings = np.degrees(self.points.amplitude), len(self.points.amplitude)
        read, cycles = min(READ, swings), self.cycles
        drift = f"{Measurement(1e3 * cycles.drift.value, 1e3 * cycles.drift.error, 'ms')} over the run"
        error = float(np.degrees(np.median(self.points.error)))
        rows = [
            ("amplitude, first and last", f"{size[0]:.4g}°, {size[-1]:.4g}° (± {error:.1g}°)", f"{swings} half swings"),
            ("period T", str(self.period), f"mean of {self.oscillations} oscillations"),
            ("period at small amplitude T0", str(self.small_period), "each cycle corrected by K(sin(A/2))"),
            ("T0, cycle by cycle", f"constant within {100.0 * cycles.spread:.2g} %",
             f"{len(cycles.time)} cycles" + (f"; {drift}" if math.isfinite(cycles.drift.error) else "")),
            ("omega0", str(self.omega0), "2 pi/T0"),
            ("length of a point pendulum", str(self.length), f"g T0²/(4 pi²) with g = {self.scene.gravity:g} m/s²"),
            ("gamma, first readings", str(self.first_decay), f"ln(amplitude) of the first {read}, A ~ exp(-gamma t/2)"),
            ("gamma, all", str(self.decay), f"ln(amplitude) of all {swings}"),
            ("quality factor", str(self.quality).removesuffix(" 1") if self.decay.value > 0.0 else "no decay seen",
             "omega0/gamma of all"),
        ]
        if self.losses is not None:
            where = f"loss per half swing at {math.degrees(self.losses.amplitude):.3g}°"
            rows += [(f"{law} part of the loss", percent(part), where) for law, part in self.losses.shares.items()]
        if self.reynolds is not None:
            first, last = self.reynolds
            medium = self.scene.medium.name
            rows.append(("Reynolds number", f"{first:.0f} to {last:.0f}", f"of the bob at the bottom, in {medium}"))
        return Table(("quantity", "value", "how"), tuple(rows))

    @property
    def text(self) -> str:
        """What was measured in a few sentences."""
        lines = [
            f"{self.recording.source}: {self.oscillations} oscillations of {self.period}; at small amplitude "
            f"{self.small_period}, that of a point pendulum of length {self.length} at "
            f"g = {self.scene.gravity:g} m/s²."
        ]
        if self.cycles.left_out:
            lines.append(f"Readings are missing in {self.cycles.left_out} of the stretches between crossings, which T0 "
                         "leaves out.")
        if self.losses is not None:
            lines.append(f"By the envelope, {self.losses.text}.")
        first, all_of = self.first_decay, self.decay
        if abs(first.value - all_of.value) > 3.0 * math.hypot(first.error, all_of.error):
            lines.append(f"The decay is not exponential: gamma is {first} at first and {all_of} over all.")
        if self.reynolds is not None:
            lines.append(f"Reynolds number {self.reynolds[0]:.0f} at first: {regime(self.reynolds[0])}.")
        return "\n".join(lines)


def measure(
    recording: Recording,
    *,
    n: int | None = None,
    scene: str | Scene | Mapping[str, object] | PathLike[str] | None = None,
    **parameters: Any,
) -> LabSheet:
    """Measure a free swing as a lab sheet asks, with errors.

    Period from the mean of n oscillations between interpolated zero crossings, amplitude per half swing, damping rate
    from the first six amplitudes and from all, omega0 corrected for the amplitude by the elliptic integral, length from
    g, quality factor, Reynolds number, and how the loss per half swing grows with the amplitude.

    Args:
        recording: as read; it is cut at the release and centred.
        n: oscillations that the period is the mean of, from the first; None for all.
        scene: what hangs there, in what, as ``gym.make`` takes it; by default a pendulum in air that is told only by
            ``parameters``.
        **parameters: what is known of it, such as ``length=0.65, radius=0.011``; the Reynolds number takes a radius,
            the length from the period where none is told.

    Raises RecordingError for what is no recording, or has no whole oscillation or fewer than three amplitudes about its
    equilibrium; SceneError for a scene or parameters that cannot be.
    """
    if not isinstance(recording, Recording):
        raise RecordingError(f"recording must be a Recording, as Recording.read makes it, not {shown(recording)}")
    taken = count(n, "oscillations")
    with naming_keywords(measure):
        known = apparatus(scene, parameters)
    swing = recording.released().centred()
    mean, points = period(swing, taken), turning_points(swing)
    if taken is None:
        ends = crossings(swing.time, swing.angle, level=CLEAR * swing.noise)
        taken = round(float(ends[-1] - ends[0]) / mean.value)
    told = frozenset(parameters) | frozenset(known.parameters() if scene is not None else ())
    return LabSheet(swing, known, told, taken, mean, points, decay_rate(swing), decay_rate(swing, READ),
                    corrected_periods(swing), losses(points) if len(points.time) >= FEWEST else None)


def apparatus(scene: str | Scene | Mapping[str, object] | PathLike[str] | None, told: Mapping[str, Any]) -> Scene:
    """The scene of a recording with the numbers ``told``; None: a pendulum in air of 20 °C, without damping.

    A bob whose radius is told is then one of finite size. Raises SceneError for a scene or numbers that cannot be.
    """
    if scene is not None:
        return find_scene(scene).replace(**told)
    sized = (FiniteBob(),) if "radius" in told else ()
    return Scene("recorded", Body(), air(20.0), (Gravity(), *sized)).replace(**told)
