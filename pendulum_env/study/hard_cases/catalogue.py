"""Every hard case, in one order."""

from __future__ import annotations

from pendulum_env.study.hard_cases import chaos, long_runs, magnitudes, near_top, reversal, step_limits
from pendulum_env.study.hard_cases.case import Case, check_unique

CASES: tuple[Case, ...] = check_unique((
    *near_top.CASES, *step_limits.CASES, *chaos.CASES, *long_runs.CASES, *magnitudes.CASES, *reversal.CASES,
))
"""The one registry: the command line, the tests and the documents read it."""
