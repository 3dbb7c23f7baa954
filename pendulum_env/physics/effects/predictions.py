"""What the textbook's formulas of small effects share."""

from __future__ import annotations

OSCILLATIONS = 3
"""Periods are means of so many, from the release on."""
