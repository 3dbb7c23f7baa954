"""Every hard case, in one order."""

from __future__ import annotations

from pendulum_env.study.hard_cases import actions, fast_drive, near_top, non_smooth, step_limits
from pendulum_env.study.hard_cases.case import Case, check_unique

CASES: tuple[Case, ...] = check_unique((
    *near_top.CASES, *step_limits.CASES, *non_smooth.CASES, *fast_drive.CASES, *actions.CASES,
))
"""The one registry: the command line, the tests and the documents read it."""
