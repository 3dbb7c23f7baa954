"""Every hard case, in one order."""

from __future__ import annotations

from pendulum_env.study.hard_cases import actions, fast_drive, near_top, non_smooth, step_limits, stiff_damping
from pendulum_env.study.hard_cases.case import Case, check_unique

GROUPS = (near_top, step_limits, stiff_damping, non_smooth, fast_drive, actions)
"""A file each."""
CASES: tuple[Case, ...] = check_unique(tuple(case for group in GROUPS for case in group.CASES))
"""The one registry: the command line, the tests and the documents read it."""
