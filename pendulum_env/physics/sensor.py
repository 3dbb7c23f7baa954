"""The class :class:`Sensor`: how an angle sensor on the shaft reads, in recordings and in environments."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pendulum_env.physics.units import Checked, SceneError, choice, si

ZEROS = {"at_start": "the first reading is 0, whatever the angle of the bob", "bottom": "0 is straight down"}
MOST_WINDOW = 64
"""Largest number of readings over which a velocity is computed."""


def taken(angle: Any, zero: Any, scale: float, offset: float) -> Any:
    """Return the reading [rad] of a sensor with this scale and offset at an angle, before noise and rounding."""
    return scale * (angle - zero) + offset


def rounded(reading: Any, quantum: float) -> Any:
    """Return a reading rounded to a multiple of ``quantum`` above 0, halves to even; for less than 2**51 quanta."""
    return quantum * ((reading / quantum + 6755399441055744.0) - 6755399441055744.0)


@dataclass(frozen=True, repr=False, kw_only=True)
class Sensor(Checked):
    """An angle sensor on the shaft.

    It reads ``quantum round((scale (theta - zero) + offset + noise_k) / quantum)`` [rad] at every reading k.
    ``noise_k`` is Gaussian and independent from reading to reading. With the probability ``dropout`` a reading is lost,
    and the one before it stands in its place. An encoder with N counts per turn has the quantum ``2 pi / N``. ``zero``
    is the first angle for "at_start" and 0 for "bottom".

    Firmware has only readings, and computes the velocity from them: as the difference over the last ``window`` readings
    divided by their time or, with a ``corner`` frequency f, by the first-order filter
    ``v_k = v_(k-1) + (1 - exp(-2 pi f T)) ((x_k - x_(k-1)) / T - v_(k-1))`` with the time T between readings.

    Raises SceneError for values out of range.
    """

    quantum: float = si(0.0, "rad", "smallest step between readings; 0 for no rounding", least=0.0)
    rate: float | None = si(None, "Hz", "readings per second; None for one before each observation", above=0.0,
                            optional=True)
    noise: float = si(0.0, "rad", "standard deviation of a reading before rounding", least=0.0)
    scale: float = si(1.0, "1", "reading over angle, of a sensor that is not calibrated exactly", above=0.0)
    offset: float = si(0.0, "rad", "reading at the angle zero")
    dropout: float = si(0.0, "1", "probability that a reading is lost", least=0.0)
    zero: str = choice("bottom", ZEROS, "angle at which the sensor reads 0")
    window: float = si(1.0, "1", "number of readings from which the velocity is computed", least=1.0)
    corner: float | None = si(None, "Hz", "corner frequency of the velocity's filter; None for differences", above=0.0,
                              optional=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.dropout < 1.0:
            raise SceneError(f"dropout must be below 1, because some readings must arrive, not {self.dropout}.")
        if self.window % 1.0 or self.window > MOST_WINDOW:
            raise SceneError(f"window must be a whole number from 1 to {MOST_WINDOW}, not {self.window:g}.")
        if self.corner is not None and self.window != 1.0:
            raise SceneError("window and corner are two ways to compute the velocity; give one of them.")
