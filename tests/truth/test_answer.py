"""Truth, the type of reference solutions: parts of it, distances over turns, and pickles of version 0.1."""

from __future__ import annotations

import math
import pickle

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


def test_references_pickled_with_the_first_version_are_truths() -> None:
    """Version 0.1 pickled reference solutions without times, with ``error_estimate`` in place of ``error``."""
    old = Truth.__new__(Truth)
    old.__setstate__({"angle": np.ones(2), "velocity": np.zeros(2), "error_estimate": 1e-9, "how": "by hand"})
    copy = pickle.loads(pickle.dumps(old))
    assert copy.error == copy.error_estimate == 1e-9
    assert copy.angle.tolist() == [1.0, 1.0]
    assert np.isnan(copy.time).all()
    assert (copy.how, copy.closed, copy.turns) == ("by hand", False, 0.0)
