"""The lab bench: recordings of a real pendulum and what is measured on them."""

from .measures import (
    Measurement,
    TurningPoints,
    crossings,
    decay_rate,
    period,
    small_amplitude_period,
    turning_points,
)
from .noise import noise_level, quantum_level, scatter_level
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
    "quantum_level",
    "scatter_level",
    "small_amplitude_period",
    "turning_points",
]
