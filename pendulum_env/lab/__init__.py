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
from .sensor import VirtualSensor
from .sheet import LabSheet, measure
from .simulated import simulated_recording
from .tracks import Circle, fit_circle, track_angle

__all__ = [
    "Circle",
    "Cycles",
    "LabSheet",
    "Losses",
    "Measurement",
    "Recording",
    "RecordingError",
    "TurningPoints",
    "VirtualSensor",
    "corrected_periods",
    "crossings",
    "decay_rate",
    "fit_circle",
    "losses",
    "measure",
    "noise_level",
    "period",
    "quantum_level",
    "scatter_level",
    "simulated_recording",
    "small_amplitude_period",
    "track_angle",
    "turning_points",
]
