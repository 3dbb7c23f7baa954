"""The lab bench: recordings of a real pendulum and what is measured on them."""

from .measures import (
    Measurement,
    TurningPoints,
    crossings,
    decay_rate,
    noise_level,
    period,
    small_amplitude_period,
    turning_points,
)
from .recording import Recording, RecordingError

__all__ = [
    "Measurement",
    "Recording",
    "RecordingError",
    "TurningPoints",
    "crossings",
    "decay_rate",
    "noise_level",
    "period",
    "small_amplitude_period",
    "turning_points",
]
