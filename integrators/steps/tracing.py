"""Recording of a plain function's arithmetic as a list of elementary operations, for Taylor series.

The function is called with :class:`Symbol` numbers, which stand for values that are known later. They support
``+ - * /``, powers with fixed exponents, ``abs``, and the functions :func:`sin`, :func:`cos`, :func:`tanh`,
:func:`exp`, :func:`log` and :func:`sqrt` of this module; NumPy's functions of these names work too. Operations that
need the value at once, such as a comparison, raise :class:`TraceError`.
"""

from __future__ import annotations

import math
import numbers
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

LEAST_FUNCTIONS = ("+ - * /, powers of fixed exponents, abs, and sin, cos, tanh, exp, log and sqrt of "
                   "integrators.families.taylor")


class TraceError(TypeError):
    """Error raised for an operation on a recorded number that cannot be recorded, such as a comparison."""


@dataclass(frozen=True)
class Operation:
    """One recorded operation of a function, or one of its given numbers (a leaf).

    Attributes:
        name: such as "add" or "sin"; leaves are "t", "q", "v" and "steady".
        operands: indices of the operands in the list of operations; () for a leaf.
        steady: True if the result does not change along the motion.
        value: for a leaf "q" or "v" the index of the component, for "steady" the constant.
    """

    name: str
    operands: tuple[int, ...]
    steady: bool
    value: Any = None


@dataclass
class Trace:
    """List of the recorded operations of a function, operands before the operations that use them.

    Equal operations are recorded only once.
    """

    operations: list[Operation] = field(default_factory=list)
    places: dict[tuple[str, tuple[int, ...]], int] = field(default_factory=dict)

    def leaf(self, name: str, value: Any = None) -> Symbol:
        """Append a given number (a leaf) to the recorded operations and return it as a traced number.

        ``name`` is "t", "q" or "v" with the index of a component as ``value``, or "steady" with a constant.
        """
        self.operations.append(Operation(name, (), name == "steady", value))
        return Symbol(self, len(self.operations) - 1)

    def lift(self, value: Any) -> Symbol | None:
        """Return a constant or a traced number as a traced number of this trace; None if it is not a number."""
        if isinstance(value, Symbol):
            return value
        scalar = isinstance(value, numbers.Number) or (hasattr(value, "__sub__") and not hasattr(value, "__len__"))
        return self.leaf("steady", value) if scalar else None

    def apply(self, name: str, *operands: Symbol) -> Symbol:
        """Return an operation's result as a traced number; equal operations are recorded only once."""
        places = tuple(operand.place for operand in operands)
        key = (name, places)
        if key not in self.places:
            steady = all(self.operations[place].steady for place in places)
            self.operations.append(Operation(name, places, steady))
            self.places[key] = len(self.operations) - 1
        return Symbol(self, self.places[key])


def _binary(name: str, swapped: bool = False) -> Callable[[Symbol, Any], Any]:
    """Return a method of :class:`Symbol`, such as ``__add__``, that records an operation of two numbers."""

    def operator(self: Symbol, other: Any) -> Any:
        lifted = self.trace.lift(other)
        if lifted is None:
            return NotImplemented
        return self.trace.apply(name, *((lifted, self) if swapped else (self, lifted)))

    return operator


def _unary(name: str) -> Callable[[Symbol], Symbol]:
    """Return a method of :class:`Symbol`, such as ``__abs__``, that records an operation of one number."""
    return lambda self: self.trace.apply(name, self)


def _refused(operation: str) -> Callable[..., Any]:
    """Return a method of :class:`Symbol` that raises TraceError, for an operation that cannot be recorded."""

    def operator(self: Symbol, *others: Any) -> Any:
        raise TraceError(f"{operation} cannot be recorded")

    return operator


class Symbol:
    """A number whose value is known later; operations on it are recorded in a list, for Taylor series."""

    __slots__ = ("place", "trace")

    def __init__(self, trace: Trace, place: int) -> None:
        self.trace, self.place = trace, place

    __add__, __radd__ = _binary("add"), _binary("add", swapped=True)
    __sub__, __rsub__ = _binary("sub"), _binary("sub", swapped=True)
    __mul__, __rmul__ = _binary("mul"), _binary("mul", swapped=True)
    __truediv__, __rtruediv__ = _binary("div"), _binary("div", swapped=True)
    __neg__, __abs__ = _unary("neg"), _unary("abs")
    sin, cos, tanh, exp, log, sqrt = (_unary(name) for name in ("sin", "cos", "tanh", "exp", "log", "sqrt"))
    __lt__ = __le__ = __gt__ = __ge__ = _refused("a comparison")
    __eq__ = __ne__ = __bool__ = __lt__
    __floordiv__ = __mod__ = __rfloordiv__ = __rmod__ = _refused("a division with remainder")
    __float__ = __int__ = _refused("a function that wants a value, such as one of math,")
    __hash__ = None  # type: ignore[assignment]

    def __pos__(self) -> Symbol:
        return self

    def __pow__(self, exponent: Any) -> Symbol:
        if not isinstance(exponent, (int, float)) or not math.isfinite(exponent):
            raise TraceError("a power whose exponent is not a fixed number cannot be recorded")
        if isinstance(exponent, int) and abs(exponent) <= 32:
            if exponent <= 0:
                one = self.trace.leaf("steady", 1)
                return self.trace.apply("div", one, self.__pow__(-exponent)) if exponent < 0 else one
            if exponent == 1:
                return self
            half: Symbol = self.__pow__(exponent // 2)
            square = self.trace.apply("mul", half, half)
            return self.trace.apply("mul", square, self) if exponent % 2 else square
        if exponent == 0.5:
            return self.trace.apply("sqrt", self)
        result: Symbol = power(self, exponent)
        return result

    __rpow__ = _refused("a power whose exponent is not a fixed number")


def power(x: Any, y: Any) -> Any:
    """Record ``x**y`` for x > 0 and an exponent y that does not change along the motion; return the result."""
    if not isinstance(x, Symbol):
        return x**y
    exponent = x.trace.lift(y)
    if exponent is None or not x.trace.operations[exponent.place].steady:
        raise TraceError("a power whose exponent changes cannot be recorded")
    return x.trace.apply("power", x, exponent)


def _function(name: str, doc: str) -> Callable[[Any], Any]:
    """Return an elementary function such as ``sin`` for recorded numbers, floats and mpmath's numbers."""

    def function(x: Any) -> Any:
        return getattr(x, name)() if isinstance(x, Symbol) else _known(name, x)

    function.__name__ = function.__qualname__ = name
    function.__doc__ = f"{doc} of a traced number, of a float or of a number of mpmath."
    return function


def _known(name: str, x: Any) -> Any:
    """Return an elementary function's value at a float or mpmath number; raise TraceError for other numbers."""
    if isinstance(x, (int, float)):
        return getattr(math, name)(x)
    home = getattr(x, "context", None)
    if home is None or not hasattr(home, name):
        raise TraceError(f"there is no {name} for numbers of the kind {type(x).__name__}")
    return getattr(home, name)(x)


sin = _function("sin", "Return the sine")
cos = _function("cos", "Return the cosine")
tanh = _function("tanh", "Return the hyperbolic tangent")
exp = _function("exp", "Return the exponential")
log = _function("log", "Return the natural logarithm")
sqrt = _function("sqrt", "Return the square root")
