"""The lab bench: recordings of a real pendulum and what is measured on them."""

from .cycles import Cycles, corrected_periods
from .losses import Losses, losses
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
from .sheet import LabSheet, measure

__all__ = [
    "Cycles",
    "LabSheet",
    "Losses",
    "Measurement",
    "Recording",
    "RecordingError",
    "TurningPoints",
    "corrected_periods",
    "crossings",
    "decay_rate",
    "losses",
    "measure",
    "noise_level",
    "period",
    "quantum_level",
    "scatter_level",
    "small_amplitude_period",
    "turning_points",
]
