"""Tests of many numbers at once: the bits of Python's floats, and equal paths through every condition."""

from __future__ import annotations

import math
import operator
import random
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from pendulum_env.common.checks import SceneError, number
from pendulum_env.common.many import Many, PartedError, in_groups, isfinite, plain, sqrt
from pendulum_env.physics import elementary

SOURCE = random.Random(7)
VALUES = [SOURCE.choice((-1.0, 1.0)) * SOURCE.uniform(1.0, 2.0) * 2.0 ** SOURCE.randint(-300, 300) for _ in range(400)]
VALUES += [0.0, -0.0, math.inf, -math.inf, 5e-324, 1.7e308]
SIZES = [abs(value) for value in VALUES]
OPERATORS: tuple[Callable[[Any, Any], Any], ...] = (operator.add, operator.sub, operator.mul)


def same(found: Any, expected: list[float]) -> bool:
    return bool(plain(found).tobytes() == np.array(expected).tobytes())


@pytest.mark.parametrize("operation", OPERATORS)
@pytest.mark.parametrize("other", [3, 0.1, -2.5e-200])
def test_arithmetic_has_the_bits_of_floats(operation: Callable[[Any, Any], Any], other: float) -> None:
    with np.errstate(all="ignore"):
        assert same(operation(Many(np.array(VALUES)), other), [operation(value, other) for value in VALUES])
        assert same(operation(other, Many(np.array(VALUES))), [operation(other, value) for value in VALUES])
        pairs = list(zip(VALUES[:400], VALUES[200:], strict=False))
        one, two = (Many(np.array(side)) for side in zip(*pairs, strict=True))
        assert same(operation(one, two), [operation(*pair) for pair in pairs])


def test_quotients_powers_roots_and_signs_have_them_too() -> None:
    some = VALUES[:400]
    with np.errstate(all="ignore"):
        assert same(0.7 / Many(np.array(some)), [0.7 / value for value in some])
        assert same(Many(np.array(VALUES)) / 0.7, [value / 0.7 for value in VALUES])
        for exponent in (2, 3, 0.5, -1.5):
            bases = [abs(value) for value in some if abs(math.log(abs(value))) < 100.0]
            assert same(Many(np.array(bases)) ** exponent, [value**exponent for value in bases])
        exponents = [value for value in some if abs(value) < 30.0]
        assert same(1.7 ** Many(np.array(exponents)), [1.7**value for value in exponents])
    assert same(sqrt(Many(np.array(SIZES))), [math.sqrt(size) for size in SIZES])
    assert same(abs(Many(np.array(VALUES))), SIZES)
    assert same(-Many(np.array(VALUES)), [-value for value in VALUES])
    assert sqrt(2.0) == math.sqrt(2.0)


@pytest.mark.parametrize("function", [elementary.exp, elementary.log, elementary.sin,
                                      lambda x: elementary.power(abs(x), 0.677)])
def test_code_with_conditions_goes_on_in_groups(function: Callable[[Any], Any]) -> None:
    """Run functions of the package with a dozen conditions."""
    given = np.array([*np.random.default_rng(1).uniform(-40.0, 40.0, 300), 0.0, 1e-300, 710.5])
    found, done = np.full(given.size, math.nan), []

    def fill(places: np.ndarray) -> None:
        found[places] = plain(function(Many(given[places])))
        done.extend(places.tolist())

    in_groups(given.size, fill)
    assert sorted(done) == list(range(given.size))
    assert same(found, [function(value) for value in given.tolist()])


def test_a_condition_is_one_for_all_or_parts_them() -> None:
    many = Many(np.array([1.0, 2.0, 3.0]))
    assert all((many < 4, not many > 3.5, many != 0.0, many >= 0.5, many <= Many(many.values), many, isfinite(many)))
    with pytest.raises(PartedError) as parted:
        bool(many >= 2.0)
    assert parted.value.those.tolist() == [False, True, True]
    for ask in (lambda: isfinite(Many(np.array([1.0, math.inf]))), lambda: sqrt(Many(np.array([1.0, -1.0]))),
                lambda: 1.0 / Many(np.array([1.0, 0.0])), lambda: bool(Many(np.array([1.0, 0.0])))):
        with pytest.raises(PartedError):
            ask()
    assert not issubclass(PartedError, Exception), "an `except Exception` on the way would take one branch for all"


def test_what_one_number_would_be_refused_for_many_are() -> None:
    with pytest.raises(ZeroDivisionError):
        1.0 / Many(np.zeros(3))
    with pytest.raises(ZeroDivisionError):
        Many(np.ones(3)) / 0.0
    with pytest.raises(ValueError, match="math domain error"):
        sqrt(Many(-np.ones(3)))
    many = Many(np.array([0.5, 2.0]))
    assert number(many, "length", above=0.0) is many
    for values in ([0.5, 0.0], [0.5, math.nan], [0.5, math.inf]):
        with pytest.raises(SceneError, match="length must be a finite number above 0"):
            number(Many(np.array(values)), "length", above=0.0)


@pytest.mark.parametrize("function", [float, math.sin, math.isfinite, np.sin, np.float64, round])
def test_what_takes_floats_alone_refuses_many(function: Callable[[Any], Any]) -> None:
    """Check that functions for floats refuse Many, rather than use only a part of the numbers."""
    with pytest.raises(TypeError):
        function(Many(np.array([1.0, 2.0])))


def test_many_read_as_their_range() -> None:
    assert f"{Many(np.array([2.0, 0.5, 1.0])):.2g}" == "0.5 to 2"
