"""The lab bench: recordings of a real pendulum and what is measured on them."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .cycles import Cycles, corrected_periods
from .losses import Losses, losses
from .measures import Measurement, crossings, decay_rate, period, small_amplitude_period
from .noise import noise_level, quantum_level, scatter_level
from .recording import Recording, RecordingError
from .sensor import VirtualSensor
from .sheet import LabSheet, measure
from .simulated import simulated_recording
from .tracks import Circle, fit_circle, track_angle
from .turning import TurningPoints, turning_points

if TYPE_CHECKING:
    from .fitting.fit import fit
    from .fitting.result import Fit

__all__ = [
    "Circle",
    "Cycles",
    "Fit",
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
    "fit",
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

_LAZY = {"Fit": "pendulum_env.lab.fitting.result", "fit": "pendulum_env.lab.fitting.fit"}
"""What loads the engine, and is imported on first use."""


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        return getattr(import_module(_LAZY[name]), name)
    raise AttributeError(f"module 'pendulum_env.lab' has no attribute '{name}'")
