"""Every hard case, in one order, and the failures that are known."""

from __future__ import annotations

from collections.abc import Mapping

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
KNOWN_FAILURES: Mapping[tuple[str, str], str] = {
    pair: why for group in GROUPS for pair, why in getattr(group, "KNOWN", {}).items()
}
"""(case, method) -> why its outcome is not one that was written down, and what the method does instead."""
