"""Outcomes that were not written down, each with its reason: the one list of them, from ``KNOWN`` of the groups."""

from __future__ import annotations

from collections.abc import Mapping

from pendulum_env.hard_cases.catalogue import GROUPS

KNOWN_FAILURES: Mapping[tuple[str, str], str] = {
    pair: why for group in GROUPS for pair, why in getattr(group, "KNOWN", {}).items()
}
"""(case, method) -> why it fails, and what it does instead."""
