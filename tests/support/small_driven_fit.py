"""A driven bench of known numbers, logs of it, and a fit of them that takes half a second."""

from __future__ import annotations

import math
import os
from functools import lru_cache
from unittest.mock import patch

from driven_truth import recorded

from pendulum_env.lab import DrivenFit, DrivenLog, fit_driven

BENCH = {"stiffness": 20.0, "viscous": 0.2, "dry": 0.4, "drive": 12.0, "lag": 0.05, "delay": 0.02, "zero": 0.03,
         "mass": 0.3, "quantum": math.tau / 4096, "noise": 0.001, "rate": 50.0, "duration": 8.0, "torque_noise": 0.0}


def log_of(truth: dict[str, float], seed: int = 0, kind: str = "action", source: str = "") -> DrivenLog:
    """Return a log of a bench with these numbers, drawn by a seed."""
    found = recorded(truth, seed, kind)
    return DrivenLog(found["time"], found["angle"], found["drive"], kind, source or f"log {seed}")


@lru_cache
def small_driven_fit(*sources: str) -> DrivenFit:
    """Return the fit of one log for each name of a source, compiled where it can be: interpreted it takes minutes."""
    with patch.dict(os.environ):
        os.environ.pop("LAB_PENDULUM_BACKEND", None)
        logs = [log_of(BENCH, seed, source=source) for seed, source in enumerate(sources)]
        return fit_driven(logs, mass=BENCH["mass"])
