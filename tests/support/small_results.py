"""One small result of every class that can be saved, made in milliseconds: by interpreted runs, or by hand."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np
from normal_posterior import normal_posterior

import integrators
from pendulum_env import SCENES, Recording, basins, compare, cost, growth, measure, rollout, section, stress, sweep
from pendulum_env.auto.calibrate import Choice
from pendulum_env.auto.choice import Ranking
from pendulum_env.auto.search import Candidate
from pendulum_env.controllers import Policy
from pendulum_env.envs.transfer import Difference, Transfer
from pendulum_env.lab import (
    DrivenFit,
    DrivenLog,
    Fit,
    GateSheet,
    Measurement,
    measure_amplitudes,
    measure_kater,
    measure_lengths,
)
from pendulum_env.lab.driven.problem import DrivenSolution
from pendulum_env.lab.driven.result import DrivenPrediction
from pendulum_env.lab.driven.windows import Window, Windows
from pendulum_env.lab.fitting.grade import Fault
from pendulum_env.lab.fitting.intervals import Bootstrap
from pendulum_env.lab.fitting.model import Model
from pendulum_env.lab.fitting.remedies import Remedy
from pendulum_env.lab.fitting.result import FitComparison
from pendulum_env.lab.fitting.shooting import FitSolution
from pendulum_env.lab.inertial import Mount
from pendulum_env.study.audit.verdicts import Audit, AuditRow, Simplification, Simplified
from pendulum_env.study.stability import stability

PYTHON: Mapping[str, Any] = {"duration": 0.5, "backend": "python"}
TIME = np.linspace(0.0, 10.0, 201)


@cache
def swing() -> Recording:
    return Recording(TIME, 0.2 * np.exp(-0.05 * TIME) * np.cos(5.0 * TIME), "swing", ("read in deg",),
                     radius=Measurement(0.4, math.nan, "m"))


@cache
def fit_by_hand() -> Fit:
    """A fit of the swing, with the closed form's numbers as if they had been fitted, compared with another."""
    def one(damping: tuple[str, ...], residual: float) -> Fit:
        scene = SCENES["lab"].replace(effects=[{"effect": "gravity"}, {"effect": "linear_drag", "gamma": 0.1}])
        names = ("angle", "velocity", "zero", "body.length", "linear_drag.gamma")
        slopes = np.stack([np.cos((k + 1) * TIME) for k in range(5)], axis=1)
        solution = FitSolution(Model(scene, damping, names, swing().time), np.array([0.2, 0.0, -0.0, 0.39, 0.1]),
                               residual * np.sin(17.0 * TIME), slopes, np.sin(TIME), 10.0)
        jump = Remedy("jump", "the zero jumps", "subtracted", Measurement(1.5, 0.1, "degrees"), 12.0,
                      0.026 * (TIME > 3.5), 3.5)
        return Fit(swing(), solution, 1e-3, faults=(Fault("held at first", False),), subtracted=(jump,))

    first, second = one(("linear",), 1e-3), one(("linear", "quadratic"), 2e-3)
    return Fit(swing(), first.solution, first.sigma, FitComparison((first, second), (0.0, math.inf)), 0.25,
               first.faults, subtracted=first.subtracted)


@cache
def driven_by_hand() -> DrivenFit:
    log = DrivenLog(TIME, 0.3 * np.sin(TIME), np.cos(TIME), "action", "log")
    windows = Windows((log,), 0.01, 5, (Window(0, 0, 0, 100), Window(0, 5, 100, 200)), (0.0, np.float64(5.0)))
    solution = DrivenSolution(np.array([20.0, 0.2, 0.4, 12.0, 0.02, 0.05, 0.03]), (0, 1, 2, 3, 4, 5, 6),
                              np.diag(np.arange(1.0, 8.0)) * 1e-4, np.float64(193.0), windows, ((0, 1.5, 2.5),),
                              np.zeros((2, 2)), 1e-3 * np.cos(TIME), (1e-3,), (0.0,))
    return DrivenFit((log,), solution, 9.81, "mass", 0.3)


@cache
def audit_by_hand() -> Audit:
    rows = (AuditRow("linear_drag", True, "Re", 12.5, -1e-3, 2e-2, math.nan, -0.0, 1e-300, 1.5, "matters", "a note"),
            AuditRow("wind", False))
    return Audit(SCENES["lab"], 0.3, 1e-2, rows, 1e-12, 4096, 1.19)


@cache
def simplification_by_hand() -> Simplification:
    return Simplification(audit_by_hand(), ("linear_drag",), (), 2.0, 1e-3, 1e-12, True, 5e-3)


def late(t: float, q: float, v: float) -> float:
    """An event."""
    return t - 0.125


def force(time: np.ndarray) -> Recording:
    return Recording(time, np.cos(5.0 * time), "phone", force=np.sin(5.0 * time), mount=Mount(0.1, -1.0, None, True))


SMALL: Mapping[str, Callable[[], Any]] = {
    "Rollout": lambda: rollout("lab", angle=1.0, events=[late], dense=True, diagnostics=["tension", "heat_by_effect"],
                               **PYTHON),
    "batch": lambda: rollout("lab", angle=[[0.5, 1.0], [1.5, 2.0]], length=[[0.3, 0.4], [0.5, 0.6]], events=["bottom"],
                             speed_limit=3.0, **PYTHON),
    "adaptive": lambda: rollout("vacuum", angle=[1.0, 2.0], integrator="dopri5", rtol=1e-6, **PYTHON),
    "compensated": lambda: rollout("vacuum", angle=1.0, compensated=True, **PYTHON),
    "estimated": lambda: rollout("vacuum", angle=[0.1, 0.2], estimate_error=True, **PYTHON),
    "slack": lambda: rollout("exercise", angle=2.0, velocity=2.0, **PYTHON),
    "Comparison": lambda: compare("vacuum", "rk4,heun", angle=1.0, duration=1.0, recording=swing()),
    "CostStudy": lambda: cost("vacuum", ["rk4", "heun"], steps=[0.1, 0.05], repeats=2, **PYTHON),
    "Growth": lambda: growth("vacuum", ["rk4", "taylor7"], periods=2.0, backend="python"),
    "Audit": audit_by_hand,
    "Simplification": simplification_by_hand,
    "Simplified": lambda: Simplified(SCENES["vacuum"], simplification_by_hand()),
    "Matrix": lambda: stress(["upright for a moment"], ["rk4", "heun"]),
    "Sweep": lambda: sweep([{"a": 1, "text": "x"}, {"a": 2.5, "text": "y/z"}, {"a": None, "text": ""}],
                           run=lambda point: {"twice": [point["a"], {"b": math.nan}]}, scene=SCENES["vacuum"]),
    "Section": lambda: section(points=40, runs=2, transient=2, steps=20, backend="python"),
    "Basins": lambda: basins("chaotic", size=2, transient=1, steps=20, backend="python"),
    "Stability": lambda: stability(["rk4", "heun"]),
    "Ranking": lambda: Ranking(Choice("rk4", 2, 1e-3, 0.02, 10, 1e-4, math.inf, 3.5, 0.0, 4, 8, 2.0, "shipped",
                                      (Candidate("heun", 5, 9e-4, 2.25),), ("a limit",))),
    "LabSheet": lambda: measure(swing()),
    "AmplitudeSheet": lambda: measure_amplitudes("0:30, 1.42:29.4, 2.84:28.8, 4.26:28.3"),
    "LengthSheet": lambda: measure_lengths(([0.3, 0.6, 0.9, 1.2], [1.1, 1.56, 1.9, 2.2])),
    "KaterSheet": lambda: measure_kater(([0.0, 0.1, 0.2], [2.0, 2.01, 2.02], [1.99, 2.01, 2.03]), 1.0),
    "GateSheet": lambda: GateSheet("gate", np.ones(3), np.full(3, np.nan), Measurement(1.0, 0.1, "s"),
                                   Measurement(0.99, 0.1, "s"), Measurement(0.24, 0.1, "m"), None, ("from periods",)),
    "Fit": fit_by_hand,
    "Bootstrap": lambda: Bootstrap(fit_by_hand(), np.ones((2, 5)), 3, 10),
    "DrivenLog": lambda: driven_by_hand().logs[0],
    "DrivenFit": driven_by_hand,
    "DrivenPrediction": lambda: DrivenPrediction(TIME, TIME, np.cos(TIME)),
    "Posterior": lambda: normal_posterior(fit_by_hand(), 60, 12),
    "Transfer": lambda: Transfer(np.array([1.0, -0.0]), np.array([0.5, 0.25]), (
        Difference("gravity", ("9.81", "5"), np.array([0.1, 0.2]), None, "not alone"),)),
    "Policy": lambda: Policy([(np.array([[0.5], [-1.0], [2.0]]), np.zeros(1))], np.array([1.0, 1.0, 0.1]),
                             {"task": "swing_up", "evaluation": {"return": {"mean": -539.67}, "seeds": [1, 2]}}),
    "Recording": swing,
    "accelerometer": lambda: force(TIME),
}
"""Name -> function that makes the result; the names are those of classes, and of further kinds of them."""


@cache
def small(name: str) -> Any:
    """Return the result of a name in SMALL, the same for all tests."""
    return SMALL[name]()


OWN = integrators.RungeKutta(name="mine/../of two stages", order=2, source="a notebook", summary="Heun's third",
                             a=((0, 0), ("2/3", 0)), b=("1/4", "3/4"))
"""A method that is not of the package, with a name that would be a path."""
