"""Many numbers that pass as one through code that is written for one, so that it runs once for all of them.

Their arithmetic has the bits of Python's floats. Code branches on numbers, and many may differ in where they lead:
then :class:`PartedError` is raised, and :func:`in_groups` runs the code for each part. What else takes a float, such
as ``float`` and the functions of ``math``, refuses them with a TypeError.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Places = NDArray[np.intp]
Operator = Callable[[Any, Any], Any]


class PartedError(BaseException):  # not an Exception, so that no code in between catches it
    """A condition holds for some of many numbers, ``those``, and not for the others."""

    def __init__(self, those: NDArray[np.bool_]) -> None:
        super().__init__(f"A condition holds for {np.count_nonzero(those)} of {those.size} numbers.")
        self.those = those


def _both_ways(operation: Operator) -> tuple[Operator, Operator]:
    """Return an operator of Many with a number or Many on its right, and the same with a number on its left."""

    def forward(one: Many, other: Any) -> Any:
        return Many(operation(one.values, plain(other))) if isinstance(other, KINDS) else NotImplemented

    def backward(one: Many, other: Any) -> Any:
        return Many(operation(other, one.values)) if isinstance(other, KINDS) else NotImplemented

    return forward, backward


def _compared(comparison: Operator) -> Operator:
    """Return a comparison of Many with a number or Many, which has to come out alike for all."""

    def compare(one: Many, other: Any) -> Any:
        return alike(comparison(one.values, plain(other))) if isinstance(other, KINDS) else NotImplemented

    return compare


def _quotient(one: Any, other: Any) -> Any:
    """Return ``one / other``; ZeroDivisionError for zeros alone, PartedError for some."""
    if alike(np.equal(other, 0.0)):
        raise ZeroDivisionError("float division by zero")
    return one / other


def _power(one: Any, other: Any) -> NDArray[np.float64]:
    """Return powers as Python has them: numpy's may differ in the last bit."""
    return np.array([float(base) ** float(exponent) for base, exponent in np.broadcast(one, other)], dtype=np.float64)


class Many:
    """``values`` of float64, shape (n,). A condition on them raises PartedError unless it is one for all."""

    __slots__ = ("values",)
    __array_ufunc__ = None
    __hash__ = object.__hash__

    def __init__(self, values: NDArray[np.float64]) -> None:
        self.values = values

    __add__, __radd__ = _both_ways(operator.add)
    __sub__, __rsub__ = _both_ways(operator.sub)
    __mul__, __rmul__ = _both_ways(operator.mul)
    __truediv__, __rtruediv__ = _both_ways(_quotient)
    __pow__, __rpow__ = _both_ways(_power)
    __lt__, __le__, __gt__, __ge__ = map(_compared, (operator.lt, operator.le, operator.gt, operator.ge))
    __eq__, __ne__ = map(_compared, (operator.eq, operator.ne))

    def __neg__(self) -> Many:
        return Many(-self.values)

    def __abs__(self) -> Many:
        return Many(np.abs(self.values))

    def __format__(self, form: str) -> str:
        return f"{self.values.min():{form}} to {self.values.max():{form}}"

    def __bool__(self) -> bool:
        return alike(self.values != 0.0)


KINDS = (float, int, Many)
"""What an operator of Many takes beside them."""


def alike(those: NDArray[np.bool_]) -> bool:
    """Return True if a condition holds for all, False if for none; PartedError for some."""
    count = np.count_nonzero(those)
    if 0 < count < np.size(those):
        raise PartedError(those)
    return bool(count)


def plain(number: Any) -> Any:
    """Return the array of Many; any other number as it is."""
    return number.values if isinstance(number, Many) else number


def sqrt(number: float) -> float:
    """Return the square root of a number or of each of Many; ValueError below zero."""
    if not isinstance(number, Many):
        return math.sqrt(number)
    if number < 0.0:
        raise ValueError("math domain error")
    return Many(np.sqrt(number.values))


def isfinite(number: float) -> bool:
    """Return True for a finite number or Many that are all finite; PartedError where some are."""
    return alike(np.isfinite(number.values)) if isinstance(number, Many) else math.isfinite(number)


def in_groups(size: int, work: Callable[[Places], None]) -> None:
    """Call ``work`` with the places 0 to ``size`` - 1 in few groups, until each is done.

    Where ``work`` raises PartedError, those for which the condition holds and the others are groups of their own.
    """
    left = [np.arange(size)]
    with np.errstate(all="ignore"):
        while left:
            places = left.pop()
            try:
                work(places)
            except PartedError as parted:
                left += [places[~parted.those], places[parted.those]]
