"""Outcomes that were not written down, each with its reason: the one list of them."""

from __future__ import annotations

from collections.abc import Mapping

KNOWN_FAILURES: Mapping[tuple[str, str], str] = {}
"""(case, method) -> why it fails, and what it does instead."""
