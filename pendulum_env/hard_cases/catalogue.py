"""Every hard case, in one order."""

from __future__ import annotations

from pendulum_env.hard_cases import (
    actions,
    chaos,
    fast_drive,
    long_runs,
    magnitudes,
    near_top,
    non_smooth,
    reversal,
    step_limits,
    stiff_damping,
)
from pendulum_env.hard_cases.case import Case, check_unique

GROUPS = (near_top, step_limits, stiff_damping, non_smooth, fast_drive, chaos, long_runs, magnitudes, actions, reversal)
"""A file each."""
CASES: tuple[Case, ...] = check_unique(tuple(case for group in GROUPS for case in group.CASES))
"""The one registry: the command line, the tests and the documents read it."""
