"""Numbers with many values (Many), which formulas written for one float accept, so that they run once for all values.

Arithmetic gives the same bits as Python's floats. Where a condition on the numbers holds for some of the values only,
:class:`PartedError` is raised, and :func:`in_groups` runs the formulas again for each group of values. ``float`` and
the functions of ``math`` refuse Many with a TypeError.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping
from itertools import repeat
from typing import Any

import numpy as np
from numpy.typing import NDArray

Places = NDArray[np.intp]
Operator = Callable[[Any, Any], Any]


class PartedError(BaseException):  # not an Exception, so that no code in between catches it
    """Signal that a condition on Many (a number with many values) holds for some of its values only.

    The array ``those`` is True where the condition holds. :func:`in_groups` catches the signal.
    """

    def __init__(self, those: NDArray[np.bool_]) -> None:
        super().__init__(f"A condition holds for {np.count_nonzero(those)} of {those.size} numbers.")
        self.those = those


def _both_ways(operation: Operator) -> tuple[Operator, Operator]:
    """Return an operator of Many for both sides: with Many on the left of another number, and with Many on the right.
    """

    def forward(one: Many, other: Any) -> Any:
        return one.combined(operation, one, other) if isinstance(other, KINDS) else NotImplemented

    def backward(one: Many, other: Any) -> Any:
        return one.combined(operation, other, one) if isinstance(other, KINDS) else NotImplemented

    return forward, backward


def _compared(comparison: Operator) -> Operator:
    """Return a comparison of Many with a number or Many, as one True or False for all values.

    The comparison raises PartedError if it holds for some of the values only.
    """

    def compare(one: Many, other: Any) -> Any:
        return alike(comparison(one.values, plain(other))) if isinstance(other, KINDS) else NotImplemented

    return compare


def quotient(one: Any, other: Any) -> Any:
    """Return ``one / other``; raises ZeroDivisionError if all values of ``other`` are 0, PartedError if some are."""
    if alike(np.equal(other, 0.0)):
        raise ZeroDivisionError("float division by zero")
    return one / other


def power(one: Any, other: Any) -> NDArray[np.float64]:
    """Return powers of Many's values, computed by Python, because numpy's may differ in the last bit."""
    if np.ndim(other) == 0:
        return np.array(list(map(pow, one.tolist(), repeat(float(other)))), dtype=np.float64)
    pairs = (np.asarray(values, dtype=np.float64).tolist() for values in np.broadcast_arrays(one, other))
    return np.array(list(map(pow, *pairs)), dtype=np.float64)


class Many:
    """A number with n values, one per environment or run: float64 of shape (n,), for formulas written for one float.

    A condition that holds for some of the values only raises PartedError.
    """

    __slots__ = ("values",)
    __array_ufunc__ = None
    __hash__ = object.__hash__

    def __init__(self, values: NDArray[np.float64]) -> None:
        self.values = values

    __add__, __radd__ = _both_ways(operator.add)
    __sub__, __rsub__ = _both_ways(operator.sub)
    __mul__, __rmul__ = _both_ways(operator.mul)
    __truediv__, __rtruediv__ = _both_ways(quotient)
    __pow__, __rpow__ = _both_ways(power)
    __lt__, __le__, __gt__, __ge__ = map(_compared, (operator.lt, operator.le, operator.gt, operator.ge))
    __eq__, __ne__ = map(_compared, (operator.eq, operator.ne))

    def combined(self, operation: Operator, left: Any, right: Any) -> Many:
        """Return the result of an operation of two numbers, of which at least one is this class's."""
        return Many(operation(plain(left), plain(right)))

    def mapped(self, function: np.ufunc) -> Many:
        """Return a function of NumPy of this number, such as ``np.sqrt``."""
        return Many(function(self.values))

    def through(self, formula: Callable[..., Any], further: tuple[float, ...]) -> Any:
        """Return a formula of this number and of further ones; see :func:`applied`."""
        return formula(self, *further)

    def refined(self, further: Any) -> Any:
        """Return this result of an iteration; see :func:`settled`."""
        return self

    def __neg__(self) -> Many:
        return self.mapped(np.negative)

    def __abs__(self) -> Many:
        return self.mapped(np.absolute)

    def __format__(self, form: str) -> str:
        return f"{self.values.min():{form}} to {self.values.max():{form}}"

    def __bool__(self) -> bool:
        return alike(self.values != 0.0)


class Twinned(Many):
    """A number with a value, at which conditions are decided, and a twin with which formulas compute as well.

    Attributes:
        values: the value, as an array of one number.
        twin: a JAX array, or a symbol that records what is done with it.
    """

    __slots__ = ("twin",)

    def __init__(self, values: Any, twin: Any) -> None:
        super().__init__(values)
        self.twin = twin

    def combined(self, operation: Operator, left: Any, right: Any) -> Any:
        twins = SAME.get(operation, operation)(twin_of(left), twin_of(right))
        return type(self)(operation(plain(left), plain(right)), twins)


SAME: Mapping[Operator, Operator] = {quotient: operator.truediv, power: operator.pow}
"""Operations of Many that have another name for twins."""


def twin_of(number: Any) -> Any:
    """Return the twin of a number that has one, and any other number unchanged."""
    return number.twin if isinstance(number, Twinned) else number


KINDS = (float, int, Many)
"""Types that an operator of Many accepts as its other argument."""


def alike(those: NDArray[np.bool_]) -> bool:
    """Return True if all of an array of booleans are True, False if none is; raises PartedError otherwise."""
    count = np.count_nonzero(those)
    if 0 < count < np.size(those):
        raise PartedError(those)
    return bool(count)


def plain(number: Any) -> Any:
    """Return the values of Many as an array, and any other number unchanged."""
    return number.values if isinstance(number, Many) else number


def sqrt(number: float) -> float:
    """Return the square root of a number, or of every value of Many; raises ValueError below zero."""
    if not isinstance(number, Many):
        return math.sqrt(number)
    if number < 0.0:
        raise ValueError("math domain error")
    return number.mapped(np.sqrt)


def applied(formula: Callable[..., float], number: float, *further: float) -> float:
    """Return a formula of a number, and of further floats, that is or calls an elementary function of this package.

    A class of numbers beside floats may compute it in its own way, by the method ``through`` of Many.
    """
    return number.through(formula, further) if isinstance(number, Many) else formula(number, *further)


def settled(root: float, further: float) -> float:
    """Return the result of an iteration that rounding keeps from falling, ``further`` being one more iterate.

    A class of numbers that have derivatives takes ``further``, whose derivatives have the smaller error.
    """
    return root.refined(further) if isinstance(root, Many) else root


def isfinite(number: float) -> bool:
    """Return True if a number, or every value of Many, is finite, else False; raises PartedError if only some are."""
    return alike(np.isfinite(number.values)) if isinstance(number, Many) else math.isfinite(number)


def in_groups(size: int, work: Callable[[Places], None]) -> None:
    """Call ``work`` on the indices 0 to ``size`` - 1 in as few groups (arrays of indices) as possible.

    If a condition in ``work`` holds for some of the indices only, so that it raises PartedError, ``work`` is called
    again for the indices with the condition and for those without.
    """
    left = [np.arange(size)]
    with np.errstate(all="ignore"):
        while left:
            places = left.pop()
            try:
                work(places)
            except PartedError as parted:
                left += [places[~parted.those], places[parted.those]]
