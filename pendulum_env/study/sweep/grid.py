"""The points of a sweep, checked."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import Any

from pendulum_env.physics.units import SceneError, several, shown
from pendulum_env.study.sweep.journal import plain, text_of
from pendulum_env.truth.reference import StudyError

Point = dict[str, Any]


def points_of(grid: Any, shared: Mapping[str, Any]) -> list[Point]:
    """The points of a grid; StudyError for none, or what is no grid."""
    if isinstance(grid, Mapping):
        for name, values in grid.items():
            try:
                several(values, f"The grid's {name!r}", "values")
            except SceneError as error:
                raise StudyError(str(error)) from None
        found: list[Any] = [dict(zip(grid, values, strict=True)) for values in product(*grid.values())]
    else:
        try:
            found = [*several(grid, "grid", "points")]
        except SceneError:
            found = [grid]
    if not found or found == [{}]:
        raise StudyError("A sweep needs at least one point, not none.")
    for point in found:
        if not isinstance(point, Mapping):
            raise StudyError(f"A grid is a dict of lists, or a list of dicts; it cannot hold {shown(point)}.")
        for name in point:
            if name in shared:
                raise StudyError(f"{name} is a keyword of all points, and of one as well; leave one out.")
    return [plain(point, "A point") for point in found]


def keys_of(points: list[Point]) -> list[str]:
    """The text of each point; StudyError if two are alike."""
    seen: dict[str, int] = {}
    for i, point in enumerate(points):
        other = seen.setdefault(text_of(point, sort=True), i)
        if other != i:
            raise StudyError(f"Points {other + 1} and {i + 1} are alike, {shown(point)}; each can be there once.")
    return list(seen)
