"""Every hard case, in one order."""

from __future__ import annotations

from pendulum_env.study.hard_cases import near_top, step_limits, stiff_damping
from pendulum_env.study.hard_cases.case import Case, check_unique

CASES: tuple[Case, ...] = check_unique((*near_top.CASES, *step_limits.CASES, *stiff_damping.CASES))
"""The one registry: the command line, the tests and the documents read it."""
