"""A sweep of four points that adds two numbers."""

from __future__ import annotations

GRID = {"a": [1, 2, 3], "b": [10, 20]}

ROWS = [{"a": a, "b": b, "sum": a + b} for a in (1, 2, 3) for b in (10, 20)]


def add(point):
    return {"sum": point["a"] + point["b"]}
