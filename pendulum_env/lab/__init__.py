"""Read recordings of a real pendulum, measure them, and fit a scene to them."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from pendulum_env.lab.measures import Losses, losses  # at once, as the module has the name of the function

if TYPE_CHECKING:
    from pendulum_env.lab.amplitudes import AmplitudeSheet, measure_amplitudes
    from pendulum_env.lab.driven.fit import fit_driven
    from pendulum_env.lab.driven.log import DrivenLog
    from pendulum_env.lab.driven.result import DrivenFit, DrivenPrediction
    from pendulum_env.lab.film.track import FilmTrack, follow, track
    from pendulum_env.lab.fitting.fit import fit
    from pendulum_env.lab.fitting.posterior import Posterior
    from pendulum_env.lab.fitting.result import Fit
    from pendulum_env.lab.gates import GateSheet, measure_gate
    from pendulum_env.lab.kater import KaterSheet, measure_kater
    from pendulum_env.lab.lengths import LengthSheet, measure_lengths
    from pendulum_env.lab.measures import (
        Cycles,
        Measurement,
        corrected_periods,
        crossings,
        decay_rate,
        period,
        small_amplitude_period,
    )
    from pendulum_env.lab.noise import noise_level, quantum_level, scatter_level
    from pendulum_env.lab.recording import Recording, RecordingError
    from pendulum_env.lab.sensor import VirtualSensor
    from pendulum_env.lab.sheet import LabSheet, measure
    from pendulum_env.lab.simulated import simulated_recording
    from pendulum_env.lab.tracks import Circle, fit_circle, track_angle
    from pendulum_env.lab.turning import TurningPoints, turning_points

__all__ = [
    "AmplitudeSheet",
    "Circle",
    "Cycles",
    "DrivenFit",
    "DrivenLog",
    "DrivenPrediction",
    "FilmTrack",
    "Fit",
    "GateSheet",
    "KaterSheet",
    "LabSheet",
    "LengthSheet",
    "Losses",
    "Measurement",
    "Posterior",
    "Recording",
    "RecordingError",
    "TurningPoints",
    "VirtualSensor",
    "corrected_periods",
    "crossings",
    "decay_rate",
    "fit",
    "fit_circle",
    "fit_driven",
    "follow",
    "losses",
    "measure",
    "measure_amplitudes",
    "measure_gate",
    "measure_kater",
    "measure_lengths",
    "noise_level",
    "period",
    "quantum_level",
    "scatter_level",
    "simulated_recording",
    "small_amplitude_period",
    "track",
    "track_angle",
    "turning_points",
]

_LAZY = {
    "AmplitudeSheet": "pendulum_env.lab.amplitudes",
    "Circle": "pendulum_env.lab.tracks",
    "Cycles": "pendulum_env.lab.measures",
    "DrivenFit": "pendulum_env.lab.driven.result",
    "DrivenLog": "pendulum_env.lab.driven.log",
    "DrivenPrediction": "pendulum_env.lab.driven.result",
    "FilmTrack": "pendulum_env.lab.film",
    "Fit": "pendulum_env.lab.fitting.result",
    "GateSheet": "pendulum_env.lab.gates",
    "KaterSheet": "pendulum_env.lab.kater",
    "LabSheet": "pendulum_env.lab.sheet",
    "LengthSheet": "pendulum_env.lab.lengths",
    "Measurement": "pendulum_env.lab.measures",
    "Posterior": "pendulum_env.lab.fitting.posterior",
    "Recording": "pendulum_env.lab.recording",
    "RecordingError": "pendulum_env.lab.recording",
    "TurningPoints": "pendulum_env.lab.turning",
    "VirtualSensor": "pendulum_env.lab.sensor",
    "corrected_periods": "pendulum_env.lab.measures",
    "crossings": "pendulum_env.lab.measures",
    "decay_rate": "pendulum_env.lab.measures",
    "fit": "pendulum_env.lab.fitting.fit",
    "fit_circle": "pendulum_env.lab.tracks",
    "fit_driven": "pendulum_env.lab.driven.fit",
    "follow": "pendulum_env.lab.film",
    "measure": "pendulum_env.lab.sheet",
    "measure_amplitudes": "pendulum_env.lab.amplitudes",
    "measure_gate": "pendulum_env.lab.gates",
    "measure_kater": "pendulum_env.lab.kater",
    "measure_lengths": "pendulum_env.lab.lengths",
    "noise_level": "pendulum_env.lab.noise",
    "period": "pendulum_env.lab.measures",
    "quantum_level": "pendulum_env.lab.noise",
    "scatter_level": "pendulum_env.lab.noise",
    "simulated_recording": "pendulum_env.lab.simulated",
    "small_amplitude_period": "pendulum_env.lab.measures",
    "track": "pendulum_env.lab.film",
    "track_angle": "pendulum_env.lab.tracks",
    "turning_points": "pendulum_env.lab.turning",
}
"""Other public names, which are imported on first use, and their modules."""


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        return getattr(import_module(_LAZY[name]), name)
    raise AttributeError(f"module 'pendulum_env.lab' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
