"""Methods that advance the motion by its Taylor series, of orders 2 to 30, with fixed or adaptive steps.

``q1 = sum_k q_k h**k`` and ``v1 = sum_k v_k h**k`` up to ``k = order``. The coefficients come from
``System.taylor_coefficients``, a function that :func:`coefficients` derives from a plain acceleration by recording its
operations. With a tolerance, the last terms ``q_p h**p`` and ``v_p h**p`` of a step are the estimate of its error
(Jorba & Zou 2005, Experimental Mathematics 14, 99, section 3.2).

The series is summed from its last term to its first (Horner's rule).

The series is a polynomial of time, so that dense output of a step is the series itself, of full order, without further
evaluations.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import comb
from numbers import Real
from typing import Any, ClassVar

import numpy as np

from integrators.method import Acceleration, Method, MethodError, System
from integrators.steps.continuous import Extension
from integrators.steps.recurrences import RecurrenceWriter
from integrators.steps.terms import Notation, StepLines, Terms, definition, term, text_of, times_step
from integrators.steps.tracing import LEAST_FUNCTIONS, Symbol, Trace, cos, exp, log, power, sin, sqrt, tanh

LOWEST, HIGHEST, USUAL = 2, 30, 12
"""The lowest, the highest and the usual order of Taylor series.

The usual order is the cheapest for a tolerance of 1e-10 (Jorba & Zou 2005, p = 1 - log(tol)/2).
"""


@dataclass(frozen=True, kw_only=True)
class Taylor(Method):
    """A method that advances by the Taylor series up to ``order``.

    Raises MethodError unless the order is from 2 to 30.
    """

    family: ClassVar[str] = "Taylor"

    def __post_init__(self) -> None:
        if not (isinstance(self.order, Real) and LOWEST <= self.order <= HIGHEST):
            raise MethodError(f"Taylor series have orders from {LOWEST} to {HIGHEST} here, not {self.order}.")
        super().__post_init__()

    @property
    def needs(self) -> frozenset[str]:
        return frozenset({"acceleration", "taylor"})

    @property
    def first_order_form(self) -> bool:
        return True

    @property
    def evaluations(self) -> int:
        """Number of evaluations of a Taylor step: one, of the Taylor series of the acceleration.

        It costs about ``order**2/2`` products for every product or sine in the acceleration.
        """
        return 1

    @property
    def symplectic(self) -> bool:
        return False

    @property
    def symmetric(self) -> bool:
        return False

    @property
    def embedded_orders(self) -> tuple[int, ...]:
        """The order of the Taylor series without its last term, which is the estimate of the error."""
        return (self.order - 1,)

    @property
    def dense(self) -> Extension:
        """The Taylor series as dense output: ``q(t + theta h) = q + h sum_k theta**k (q_k h**(k-1))``, likewise for v.

        The k-th "stage" of a step is the pair of coefficients of order k times ``h**(k-1)``; its polynomial is
        ``theta**k``, in Bernstein's form ``comb(j, k)/comb(p, k)``.
        """
        orders = range(1, self.order + 1)
        return Extension(
            self.order, tuple(tuple(Fraction(comb(j, k), comb(self.order, k)) for j in orders) for k in orders),
            source=self.source)

    @property
    def rounding(self) -> Fraction:
        """Zero, since a Taylor series method has no table with rounded coefficients."""
        return Fraction(0)

    def functions(self, system: System, like: Any) -> Mapping[str, Callable[..., Any]]:
        coefficients_ = system.taylor_coefficients
        return {} if coefficients_ is None else {"series": series_of(coefficients_, self.order)}

    def write_step(self, notation: Notation) -> str:
        return self._write(notation, estimates=False)

    def write_estimating_step(self, notation: Notation) -> str:
        return self._write(notation, estimates=True)

    def _write(self, notation: Notation, estimates: bool) -> str:
        p, quadratures, more = self.order, notation.quadratures, notation.more
        step = StepLines(notation) if estimates else notation.new_step()
        step.line(f"{', '.join(results_of_series(p, quadratures))} = series(t, q, v{more})")
        ends = [step.end("q", _series(["v", *(f"q{k}" for k in range(2, p + 1))])),
                step.end("v", _series([f"v{k}" for k in range(1, p + 1)]))]
        sums = [text_of(_series([f"{name}_{k}" for k in range(1, p + 1)]), notation.number) for name in quadratures]
        stages = self._stages(step) if notation.dense else []
        if not estimates:
            return step.source(self.title, ends, increments=[*sums, *stages])
        step.line(f"last = {'*'.join(['h'] * p)}")
        slopes = {name: name for name in ("a", *quadratures)}  # a series needs no slopes: it returns those it was given
        return step.source(self.title, ends, slopes, [*sums, f"last*q{p}", f"last*v{p}", *stages])

    def _stages(self, step: StepLines) -> list[str]:
        """Return the source texts of two tuples, ``q_k h**(k-1)`` and ``v_k h**(k-1)``: the stages of dense output."""
        orders = range(2, self.order + 1)
        for k in orders:
            step.line(f"power{k} = {'h' if k == 2 else f'power{k - 1}*h'}")
        return [f"({first}, {', '.join(f'power{k}*{y}{k}' for k in orders)})" for first, y in (("v", "q"), ("v1", "v"))]


def of_order(order: int, **changes: Any) -> Taylor:
    """Return the Taylor series method of this order; ``changes`` are other values of its attributes by name.

    Raises MethodError unless the order is from 2 to 30.
    """
    return Taylor(**{
        "name": f"taylor{order}", "order": order,
        "source": "Moore 1966, Interval Analysis; Jorba & Zou 2005, Experimental Mathematics 14, 99",
        "summary": f"Taylor series of order {order} by recurrences; also taylor2 to 30", **changes,
    })


TAYLOR = (of_order(USUAL, name="taylor", aliases=(f"taylor{USUAL}",)),)


def named_order(name: str) -> Taylor | None:
    """Return the method with a name such as "taylor20", or None for other names.

    Raises MethodError unless the order is from 2 to 30.
    """
    match = re.fullmatch("taylor([0-9]+)", name)
    return of_order(int(match[1])) if match else None


# --- the step --------------------------------------------------------------------------------------------------------


def results_of_series(order: int, quadratures: Sequence[str]) -> list[str]:
    """Return names for Taylor coefficients of q, v and the quadratures (integrals along the step), such as ``v1``.

    They name the results of ``series(t, q, v, *extra)``. Those of q begin with ``q2``, all others with order 1.
    """
    named = [("q", 2), ("v", 1), *((f"{name}_", 1) for name in quadratures)]
    return [f"{name}{k}" for name, first in named for k in range(first, order + 1)]


def _series(names: Sequence[str]) -> Terms:
    """Return the terms of ``h*(c_1 + h*(c_2 + h*(...)))``, a power series in h without its constant term."""
    total: Terms = ()
    for name in reversed(names):
        total = times_step(term(1, name) + total)
    return total


def series_of(coefficients_: Callable[[Any, Any, Any, int], Sequence[Any]], order: int) -> Callable[..., list[Any]]:
    """Return the function ``series`` that a Taylor step calls: the coefficients of q from order 2, of v from order 1.

    It is derived from a system's function ``taylor_coefficients``.
    """

    def series(t: Any, q: Any, v: Any) -> list[Any]:
        terms = coefficients_(t, q, v, order + 1)
        return [*terms[2:-1], *(k * x for k, x in enumerate(terms[2:], start=2))]

    return series


# --- coefficients of a plain function --------------------------------------------------------------------------------


def coefficients(acceleration: Acceleration) -> Callable[[Any, Any, Any, int], list[Any]]:
    """Return the function ``taylor_coefficients`` of a plain acceleration ``a(t, q, v)``, for any kind of numbers.

    The acceleration is called once for every array shape of q, with numbers that record the operations on them. The
    returned function raises MethodError if the acceleration uses other operations than
    :data:`integrators.steps.tracing.LEAST_FUNCTIONS`.
    """
    compiled: dict[tuple[tuple[int, ...], int], Callable[..., Any]] = {}

    def taylor_coefficients(t: Any, q: Any, v: Any, order: int) -> list[Any]:
        shape = np.shape(q)
        if (shape, order) not in compiled:
            compiled[shape, order] = _compiled(acceleration, shape, order)
        if shape == ():
            return [q, v, *compiled[shape, order](t, q, v)]
        flat = compiled[shape, order](t, *np.ravel(q).tolist(), *np.ravel(v).tolist())
        kind = object if np.asarray(q).dtype == object else float
        return [q, v, *np.array(flat, dtype=kind).reshape(order - 1, *shape)]

    return taylor_coefficients


def _compiled(acceleration: Acceleration, shape: tuple[int, ...], order: int) -> Callable[..., Any]:
    """Return a function that computes the Taylor coefficients of q from order 2 on, for arrays q of one shape.

    It takes t, all components of q and all components of v as single arguments, and returns the coefficients of all
    components in one list.
    """
    trace = Trace()
    t = trace.leaf("t")
    size = int(np.prod(shape))
    q, v = (_numbers([trace.leaf(name, i) for i in range(size)], shape) for name in "qv")
    try:
        result = acceleration(t, q, v)
        components = np.broadcast_to(np.asarray(result, dtype=object), shape).ravel() if shape else [result]
        lifted = [trace.lift(x) for x in components]
    except (TypeError, AttributeError, ValueError) as fault:
        raise MethodError(
            f"Taylor series need an acceleration that uses only {LEAST_FUNCTIONS}, but {fault}.") from fault
    slopes = [x for x in lifted if x is not None]
    if len(slopes) < len(lifted):
        raise MethodError(f"The acceleration must be numbers, not {result!r}.")
    add_twins(trace)
    writer = RecurrenceWriter(trace, slopes, lambda place: f"k{place}")
    writer.write(order - 1, order)
    names = [writer.of_motion("q", i, k) for k in range(2, order + 1) for i in range(size)]
    arguments = ["q", "v"] if size == 1 else [f"{name}{i}" for name in "qv" for i in range(size)]
    first = [f"zero = {arguments[-1]} - {arguments[-1]}", "one = zero + 1"]
    results = ", ".join("zero" if name == "0" else name for name in names)
    lines = [*first, *writer.lines, f"return ({results},)"]
    source = definition(f"series(t, {', '.join(arguments)})", "Coefficients.", lines)
    namespace: dict[str, Any] = {one.__name__: one for one in (sin, cos, tanh, exp, log, sqrt, power)}
    namespace |= {f"k{i}": x.value for i, x in enumerate(trace.operations) if x.name == "steady"}
    exec(compile(source, "<taylor coefficients>", "exec"), namespace)
    series: Callable[..., Any] = namespace["series"]
    return series


def _numbers(values: list[Symbol], shape: tuple[int, ...]) -> Any:
    """Return recorded numbers as an object array of this shape; for the shape () the only number itself."""
    if not shape:
        return values[0]
    array = np.empty(len(values), dtype=object)
    array[:] = values
    return array.reshape(shape)


def add_twins(trace: Trace) -> None:
    """Record the cosine of every recorded sine and vice versa, and the slope of every tanh: recurrences need them."""
    for operation in list(trace.operations):
        for one, other in (("sin", "cos"), ("cos", "sin"), ("tanh", "slope_of_tanh")):
            if operation.name == one:
                trace.apply(other, Symbol(trace, operation.operands[0]))


__all__ = ["TAYLOR", "Taylor", "coefficients", "cos", "exp", "log", "named_order", "of_order", "sin",
           "sqrt", "tanh"]
