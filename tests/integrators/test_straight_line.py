"""Recorded operations become source that computes the same bits, whatever their signs, brackets and repetitions."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from integrators.steps.straight_line import ATOM, Record, StraightLine

NUMBERS = st.floats(min_value=-4.0, max_value=4.0, allow_nan=False, allow_subnormal=False)
OPERATORS: tuple[Callable[[Any, Any], Any], ...] = (
    lambda x, y: x + y, lambda x, y: x - y, lambda x, y: x * y, lambda x, y: x / (y * y + 1.0), lambda x, y: -x,
    lambda x, y: x - (y + x), lambda x, y: x * -2.0, lambda x, y: x - -0.5, lambda x, y: x**2 - abs(y),
)


def written(choices: list[tuple[int, int, int]], *leaves: Any) -> Any:
    """Return the last two values of a chain of operations on the leaves, which are floats or recording numbers."""
    values = list(leaves)
    for operator, first, second in choices:
        values.append(OPERATORS[operator % len(OPERATORS)](values[first % len(values)], values[second % len(values)]))
    return values[-1], values[-2]


@given(st.lists(st.tuples(st.integers(0, 99), st.integers(0, 99), st.integers(0, 99)), min_size=2, max_size=12),
       NUMBERS, NUMBERS)
def test_the_source_computes_what_was_recorded(choices: list[tuple[int, int, int]], q: float, v: float) -> None:
    trace = Record()
    leaves = [trace.leaf(name) for name in "qv"]
    ends = written(choices, *leaves)
    writer = StraightLine(trace, {leaf.place: name for leaf, name in zip(leaves, "qv", strict=True)}, "qv", {},
                          lambda value: (repr(float(value)), ATOM))
    names: dict[str, Any] = {"q": q, "v": v}
    exec("\n".join(f"{name} = {text}" for name, text in writer.assignments(dict(zip("qv", ends, strict=True)))), names)
    for found, truth in zip((names["q"], names["v"]), written(choices, q, v), strict=True):
        assert found == truth or (math.isnan(found) and math.isnan(truth))


def test_a_value_that_is_needed_later_keeps_its_name() -> None:
    trace = Record()
    q, v, h = (trace.leaf(name) for name in "qvh")
    middle = q + h * v
    writer = StraightLine(trace, {q.place: "q", v.place: "v", h.place: "h"}, "qv", {"a": "a"},
                          lambda value: (repr(value), ATOM))
    force = trace.apply("a", middle)
    assert writer.assignments({"q": middle + h * (v + h * force), "v": v + h * force}) == [
        ("q", "q + h*v"), ("v", "v + h*a(q)"), ("q", "q + h*v")]
    assert writer.assignments({"q": v, "v": q}) == [("q, v", "v, q")]
