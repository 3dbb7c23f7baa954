"""Settings of sensors, delays, drawn parameters, tasks and motors that hold every pair of their values."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np

from pendulum_env import Sensor

ROUGH = Sensor(quantum=0.005, noise=0.01, dropout=0.2, window=3, zero="at_start", scale=1.1, offset=0.1)
AXES: dict[str, list[Any]] = {
    "observation": ["full", "angle", "encoder", "history"],
    "sensor": [None, {"quantum": 0.01}, ROUGH, Sensor(rate=100.0, noise=0.01), Sensor(rate=25.0, corner=5.0)],
    "observation_delay": [0.0, 0.02, 0.01, (0.0, 0.03)],
    "action_delay": [0.0, 0.04, 0.01, (0.01, 0.03)],
    "randomize": [None, {"length": (0.3, 0.4)}],
    "task": ["swing_up", "balance", "track"],
    "lag": [0.0, 0.05],
}
"""Keyword -> its values. Vectors are checked in all autoreset modes, too."""


def every_pair() -> list[tuple[int, ...]]:
    """Return combinations of places in AXES that hold every pair of values, chosen greedily among random ones."""
    source, sizes = np.random.default_rng(0), [len(axis) for axis in AXES.values()]
    places = [*combinations(range(len(AXES)), 2)]
    left = {(i, j, a, b) for i, j in places for a in range(sizes[i]) for b in range(sizes[j])}
    found = []
    while left:
        tries = [tuple(map(int, row)) for row in source.integers(0, sizes, (200, len(sizes)))]
        news = [{(i, j, row[i], row[j]) for i, j in places} & left for row in tries]
        best = max(range(len(tries)), key=lambda k: len(news[k]))
        found += [tries[best]] if news[best] else []
        left -= news[best]
    return found


def settings(places: tuple[int, ...]) -> dict[str, Any]:
    """Return the keywords of an environment for places in AXES."""
    own = {name: axis[place] for (name, axis), place in zip(AXES.items(), places, strict=True)}
    return {**own, "substeps": 2, "velocity_bound": 50.0, "backend": "python"}


PAIRS = {"-".join(map(str, places)): settings(places) for places in every_pair()}
"""Name -> keywords of an environment; together they hold every pair of values."""
