"""Methods that advance the motion by its Taylor series, of orders 2 to 30, with fixed or adaptive steps.

``q1 = sum_k q_k h**k`` and ``v1 = sum_k v_k h**k`` up to ``k = order``. The coefficients come from
``System.taylor_coefficients``, a function that :func:`coefficients` derives from a plain acceleration by recording its
operations. With a tolerance, the last terms ``q_p h**p`` and ``v_p h**p`` of a step are the estimate of its error
(Jorba & Zou 2005, Experimental Mathematics 14, 99, section 3.2).

"taylor14" sums the series from its last term to its first (Horner's rule), so that nothing can be summed before the
last coefficient is known. "quick_taylor14" sums the last three terms apart from the others (Estrin 1960)::

    q1 = q_0 + h (q_1 + h (q_2 + (h (q_3 + ... + h q_(p-3)) + h**(p-4) (q_(p-2) + h (q_(p-1) + h q_p)))))

A processor sums the others while it computes the last coefficients: a step of one pendulum takes some 10 % less time.
Both ways to sum have rounding errors of the same size, but other ones, so that the last digits of results differ. The
power ``h**(p-4)`` must be a finite double, as ``h**p`` must be with a tolerance.

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
from integrators.steps.recurrences import Writer
from integrators.steps.terms import Notation, StepLines, Terms, definition, term, text_of, times_step
from integrators.steps.tracing import LEAST_FUNCTIONS, Symbol, Trace, cos, exp, log, power, sin, sqrt

LOWEST, HIGHEST, USUAL = 2, 30, 12
"""The lowest, the highest and the usual order of Taylor series.

The usual order is the cheapest for a tolerance of 1e-10 (Jorba & Zou 2005, p = 1 - log(tol)/2).
"""
BEFORE, APART = 2, 3
"""Numbers of terms of a quick Taylor series: the first BEFORE, the largest, are added last; the last APART are summed
apart.

If the sum of the last terms were added to that of all others, rounding errors would be up to 1.2 times as large.
"""


@dataclass(frozen=True, kw_only=True)
class Taylor(Method):
    """A method that advances by the Taylor series up to ``order``.

    Raises MethodError unless the order is from 2 to 30, with ``quick`` from 6 to 30.

    Attributes:
        quick: True if the last three terms are summed apart from the others, which takes less time.
    """

    family: ClassVar[str] = "Taylor"
    quick: bool = False

    def __post_init__(self) -> None:
        lowest = BEFORE + APART + 1 if self.quick else LOWEST
        if not (isinstance(self.order, Real) and lowest <= self.order <= HIGHEST):
            kind = "Quick Taylor series" if self.quick else "Taylor series"
            raise MethodError(f"{kind} have orders from {lowest} to {HIGHEST} here, not {self.order}.")
        super().__post_init__()

    @property
    def needs(self) -> frozenset[str]:
        return frozenset({"acceleration", "taylor"})

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
        if self.quick:
            step.line(f"raised = {'*'.join(['h'] * (p - APART - BEFORE + 1))}")
        written = _series_with_end_apart if self.quick else _series
        ends = [step.end("q", written(["v", *(f"q{k}" for k in range(2, p + 1))])),
                step.end("v", written([f"v{k}" for k in range(1, p + 1)]))]
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
        "summary": f"Taylor series of order {order} by recurrences; also taylor2 to 30; for one pendulum quick_taylor6 "
                   "to 30", **changes,
    })


def quick_of_order(order: int) -> Taylor:
    """Return the Taylor series method of this order that sums its last terms apart.

    Raises MethodError unless the order is from 6 to 30.
    """
    return of_order(
        order, name=f"quick_taylor{order}", quick=True,
        source="Moore 1966, Interval Analysis; Estrin 1960, Proceedings of the Western Joint Computer Conference, 33",
        summary=f"Taylor series of order {order}, whose last {APART} terms are summed apart, in less time")


TAYLOR = (of_order(USUAL, name="taylor", aliases=(f"taylor{USUAL}",)),)


QUICK = f"quick_taylor{USUAL}"
"""Name of the quick Taylor series of the usual order."""


def named_order(name: str) -> Taylor | None:
    """Return the method with a name such as "taylor20" or "quick_taylor20", or None for other names.

    "quick_taylor" is of the usual order, as "taylor" is.

    Raises MethodError unless the order is from 2 to 30, of a quick one from 6 to 30.
    """
    match = re.fullmatch("(quick_)?taylor([0-9]+)", QUICK if name == "quick_taylor" else name)
    return (quick_of_order if match[1] else of_order)(int(match[2])) if match else None


# --- the step --------------------------------------------------------------------------------------------------------


def results_of_series(order: int, quadratures: Sequence[str]) -> list[str]:
    """Return names for Taylor coefficients of q, v and the quadratures (integrals along the step), such as ``v1``.

    They name the results of ``series(t, q, v, *extra)``. Those of q begin with ``q2``, all others with order 1.
    """
    named = [("q", 2), ("v", 1), *((f"{name}_", 1) for name in quadratures)]
    return [f"{name}{k}" for name, first in named for k in range(first, order + 1)]


def _series(names: Sequence[str]) -> Terms:
    """Return the terms of ``h*(c_1 + h*(c_2 + h*(...)))``, a power series in h without its constant term."""
    return times_step(_nested(names))


def _nested(names: Sequence[str]) -> Terms:
    """Return the terms of ``c_1 + h*(c_2 + h*(...))``, a power series in h by Horner's rule."""
    total: Terms = ()
    for name in reversed(names):
        total = term(1, name) + times_step(total)
    return total


def _series_with_end_apart(names: Sequence[str]) -> Terms:
    """Return the same power series as ``h*(c_1 + h*(c_2 + (h*(c_3 + ...) + raised*(c_(m+1) + h*(...)))))``.

    ``raised`` is ``h**(m - 1)``; APART terms follow after ``c_m``.
    """
    (first, second), between, end = names[:BEFORE], names[BEFORE:-APART], names[-APART:]
    rest = times_step(_nested(between)) + term(1, "raised", _nested(end))
    return times_step(term(1, first) + times_step(term(1, second) + term(1, rest)))


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
    writer = Writer(trace, slopes, lambda place: f"k{place}")
    writer.write(order - 1, order)
    names = [writer.of_motion("q", i, k) for k in range(2, order + 1) for i in range(size)]
    arguments = ["q", "v"] if size == 1 else [f"{name}{i}" for name in "qv" for i in range(size)]
    first = [f"zero = {arguments[-1]} - {arguments[-1]}", "one = zero + 1"]
    results = ", ".join("zero" if name == "0" else name for name in names)
    lines = [*first, *writer.lines, f"return ({results},)"]
    source = definition(f"series(t, {', '.join(arguments)})", "Coefficients.", lines)
    namespace: dict[str, Any] = {"sin": sin, "cos": cos, "exp": exp, "log": log, "sqrt": sqrt, "power": power}
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
    """Record the cosine of every recorded sine and vice versa, as the recurrences of both need each other."""
    for operation in list(trace.operations):
        for one, other in (("sin", "cos"), ("cos", "sin")):
            if operation.name == one:
                trace.apply(other, Symbol(trace, operation.operands[0]))


__all__ = ["TAYLOR", "Taylor", "coefficients", "cos", "exp", "log", "named_order", "of_order", "quick_of_order", "sin",
           "sqrt"]
