"""Truth, the type of reference solutions: parts of it and distances over turns."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pendulum_env.truth.answer import Truth

TURNED = Truth(np.arange(3.0), np.array([0.1, 0.2, -0.1]), np.array([1.0, 0.0, -1.0]), np.array([1e-3, 2e-3, 3e-3]),
               "by hand", turns=np.array([0.0, 0.5, 1.0]))


def test_a_part_keeps_what_belongs_to_its_times() -> None:
    part = TURNED[1:]
    assert part.time.tolist() == [1.0, 2.0]
    assert np.asarray(part.error).tolist() == [2e-3, 3e-3]
    assert np.asarray(part.turns).tolist() == [0.5, 1.0]
    assert (part.how, part.closed) == ("by hand", False)
    plain = Truth(np.arange(2.0), np.ones(2), np.ones(2), 0.5, "by hand", closed=True)[::2]
    assert (plain.error, plain.turns, plain.closed, len(plain.angle)) == (0.5, 0.0, True, 1)


def test_the_error_estimate_is_the_largest_error() -> None:
    assert TURNED.error_estimate == 3e-3
    assert Truth(np.arange(2.0), np.ones(2), np.ones(2), 0.25, "by hand").error_estimate == 0.25


def test_what_is_known() -> None:
    nothing = np.full(2, math.nan)
    assert TURNED.known
    assert not Truth(np.arange(2.0), nothing, nothing, math.nan, "none").known


def test_distances_count_turns() -> None:
    unwrapped = np.array([0.1, 0.2 + math.pi, -0.1 + 2.0 * math.pi])
    assert TURNED.distance(unwrapped) == pytest.approx(0.0, abs=1e-15)
    assert TURNED.distance([0.1, 0.2, -0.1], TURNED.turns).tolist() == [0.0, 0.0, 0.0]
    assert TURNED.distance([0.1, 0.2, -0.1], 0.0) == pytest.approx([0.0, math.pi, 2.0 * math.pi])
