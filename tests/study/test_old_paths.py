"""Tests that module paths of version 0.1, as in old pickles and scripts, still give the present classes."""

from __future__ import annotations

from importlib import import_module

import pytest

RESULTS = (
    ("study.compare.comparison", "Comparison"), ("study.compare.drift", "Drift"), ("study.compare.truth", "Truth"),
    ("study.cost_points", "CostStudy"), ("study.growth", "Growth"), ("study.growth_laws", "Law"),
    ("study.hard_cases.case", "Finding"), ("study.hard_cases.run", "Matrix"), ("study.reference", "Reference"),
    ("study.stability", "Stability"), ("study.sweep", "Sweep"), ("study.verdicts", "Audit"),
    ("lab.fitting.choice", "Comparison"), ("lab.fitting.errors", "Errors"), ("lab.fitting.intervals", "Interval"),
    ("lab.fitting.result", "Fit"), ("lab.fitting.sampling", "Bootstrap"), ("lab.fitting.shooting", "Solution"),
    ("lab.sheet", "LabSheet"),
)
"""Modules of version 0.1 in pendulum_env, and a class of each."""
FUNCTIONS = (
    ("study.audit", "write"), ("study.cost", "write"), ("study.growth", "growth"), ("study.simplify", "simplify"),
    ("study.summary", "summary"), ("study.hard_cases.run", "write"), ("lab.report", "write"),
    ("study.cost_plot", "draw"), ("study.growth_plot", "draw"), ("study.demo", "demo"),
)
"""Modules of version 0.1, and a function of each that scripts may import."""


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize(("module", "name"), [*RESULTS, *FUNCTIONS])
def test_paths_of_the_first_version_give_what_they_gave(module: str, name: str) -> None:
    assert callable(getattr(import_module(f"pendulum_env.{module}"), name))
