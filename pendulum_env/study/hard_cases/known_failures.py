"""Outcomes that were not written down, each with its reason: the one list of them."""

from __future__ import annotations

from collections.abc import Mapping

from pendulum_env.study.hard_cases import stiff_damping

KNOWN_FAILURES: Mapping[tuple[str, str], str] = {**stiff_damping.KNOWN}
"""(case, method) -> why it fails, and what it does instead."""
