"""Catalogue of all hard cases in a fixed order, and of the known failures."""

from __future__ import annotations

from collections.abc import Mapping

from pendulum_env.hard_cases import (
    actions,
    chaos,
    extremes,
    fast_drive,
    long_runs,
    magnitudes,
    near_top,
    non_smooth,
    resonance,
    reversal,
    step_limits,
    stiff_damping,
    switching,
)
from pendulum_env.hard_cases.case import Case, check_unique

GROUPS = (near_top, step_limits, stiff_damping, non_smooth, fast_drive, chaos, long_runs, magnitudes, actions, reversal,
          extremes, resonance, switching)
"""Modules of hard cases, one per group."""
CASES: tuple[Case, ...] = check_unique(tuple(case for group in GROUPS for case in group.CASES))
"""All hard cases; the command line, the tests and the documentation read this tuple."""
MOTIONS = {case.motion.name: case.motion for case in CASES if case.motion is not None}
"""Motions with predicted errors, by name."""
KNOWN_FAILURES: Mapping[tuple[str, str], str] = {
    pair: why for group in GROUPS for pair, why in getattr(group, "KNOWN", {}).items()
}
"""(case, method) -> reason why the outcome is not an allowed one, and what the method does instead."""
