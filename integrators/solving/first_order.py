"""Function ``solve_first_order``: equations of first order, y' = f(t, y), by the methods that can treat them.

The methods of this package advance q and v of ``q'' = a(t, q, v)``. Runge-Kutta methods, Adams methods, backward
differentiation formulas and Taylor series do so as for the pair ``q' = v, v' = a``. If the acceleration does not depend
on q, what they compute for v of ``v' = f(t, v)`` is, operation by operation, their solution of ``y' = f(t, y)``: with
the same stages, steps, estimates, dense output and order. So y is v here. Its integral q is computed along, with the
same calls of f, and is left out of tolerances and results.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from integrators import html
from integrators.errors import shown
from integrators.families.taylor import coefficients
from integrators.method import Method, MethodError, System
from integrators.solving.dense import DenseOutput
from integrators.solving.events import Event, checked_events
from integrators.solving.probing import Differences, tried, with_arguments
from integrators.solving.solve import accepted, integrated, span_of
from integrators.solving.values import is_finite, state

SOME = "rk4, dopri5, dop853, gauss4, radau5, abm4, bdf4 and taylor"
"""Some methods for equations of first order, for messages."""


@dataclass(frozen=True, repr=False)
class FirstOrderSolution:
    """Solution ``y`` of an equation of first order at the times ``t``, laid out as SciPy's: ``y[i]`` is component i.

    The last axis of ``y`` is that of the times; for one number y it is the only one. They are arrays of float64 for
    floats and arrays, and object arrays for other numbers, such as mpmath's. ``steps`` counts the steps taken,
    ``rejected`` the steps that a tolerance rejected, and ``evaluations`` the calls of f, without those that probe it.
    With ``dense=True`` the solution is a function of time (``dense`` holds its curves, with y as the second of two).
    ``t_events`` and ``y_events`` are tuples with an array for
    each event function: the times at which it changed its sign, and the states there, one row for each. ``ended_by`` is
    the index of the event function that ended the solution; None if none did. ``lost_y`` is the rounding error of y
    that compensated summation has stored; None without it.
    """

    t: Any
    y: Any
    method: str
    steps: int
    rejected: int = 0
    evaluations: int = 0
    dense: DenseOutput | None = field(default=None, repr=False, compare=False)
    t_events: tuple[Any, ...] = ()
    y_events: tuple[Any, ...] = ()
    ended_by: int | None = None
    lost_y: Any = None

    def __repr__(self) -> str:
        return f"<FirstOrderSolution: {self.method}, {span_of(self.t)}, {self.steps} steps>"

    def _repr_html_(self) -> str:
        """Return a short table as HTML, which notebooks show."""
        return html.block(f"Solution by {self.method}", html.facts((
            ("times", span_of(self.t)),
            ("steps", f"{self.steps}{f', and {self.rejected} rejected' if self.rejected else ''}"),
            ("evaluations", str(self.evaluations)),
            ("y at the end", shown(self.y[..., -1]) if len(self.t) else ""),
            ("events", str(sum(map(len, self.t_events))) if self.t_events else ""),
        )))

    def __call__(self, t: Any) -> Any:
        """Return y at any time from the first to the last, or at an array of times, whose axes come last, as in ``y``.

        Raises MethodError for other times, and for a solution without dense output.
        """
        if self.dense is None:
            raise MethodError("This solution has no dense output; pass dense=True to solve_first_order.")
        return _times_last(self.dense(t)[1], np.ndim(t))


def solve_first_order(
    f: Callable[..., Any],
    times: Sequence[Any],
    y: Any,
    *,
    method: str | Method = "rk4",
    h: Any = None,
    rtol: Any = None,
    atol: Any = None,
    first_step: Any = None,
    max_step: Any = None,
    t_eval: Any = None,
    args: tuple[Any, ...] = (),
    dense: bool = False,
    compensated: bool = False,
    events: Callable[..., Any] | Event | Sequence[Callable[..., Any] | Event] | None = None,
) -> FirstOrderSolution:
    """Integrate ``y' = f(t, y)`` from ``y`` at ``times[0]`` through all ``times``.

    The arguments have the order of SciPy's ``solve_ivp(f, times, y)``; :func:`solve` takes the state before the times.
    By Runge-Kutta methods, explicit, embedded and implicit, Adams methods, backward differentiation formulas and Taylor
    series. Splitting methods, Nystrom methods and others that need the form ``q'' = a(t, q, v)`` are refused.

    Args:
        f: ``f(t, y)`` in units of y per time. It may return a list, an array that it uses again in its next call, or
            one number for all components; it must not change y.
        times: at least one time, strictly increasing or strictly decreasing; the solution has y at each of them.
        y: state at ``times[0]``: a float, a list or array of any shape, or another real number with arithmetic (of
            mpmath, Fraction, Decimal).
        h, rtol, first_step, max_step, t_eval, dense, compensated: as in :func:`solve`.
        method: a name of :data:`integrators.METHODS` or a Method.
        atol: a number or an array like y: the error of a step, as a root mean square over all components of y, stays
            below ``atol + rtol max(abs(y0), abs(y1))``.
        args: further arguments of f, the events and their actions: ``f(t, y, *args)``.
        events: functions ``g(t, y)``, or Events of them, as in :func:`solve`; an action is a function ``(t, y) -> y``.

    Raises:
        MethodError: as :func:`solve`, and for a method that cannot treat equations of first order;
        StepSizeError if steps become too short while trying to meet a tolerance.
    """
    chosen = accepted(method)
    if not chosen.first_order_form:
        raise MethodError(f"{chosen.name} is a method for q'' = a(t, q, v) and does not treat y' = f(t, y); {SOME} do.")
    y = state(y, "y")
    if not is_finite(y):
        raise MethodError(f"y must be finite numbers, not {shown(y)}.")
    function = with_arguments(f, args, "f", "t, y")
    found = integrated(
        method, lambda marks, q, v, double: _system(tried(function, "f", marks[0], double, y=v)), y - y, y, times, h=h,
        rtol=rtol, atol=atol, first_step=first_step, max_step=max_step, t_eval=t_eval, dense=dense,
        compensated=compensated, events=tuple(map(_of_motion, checked_events(events, args, "t, y"))), of_v=True)
    lost_y = None if found.lost_v is None else _times_last(found.lost_v, 1)
    return FirstOrderSolution(
        found.t, _times_last(found.v, 1), found.method, found.steps, found.rejected, found.evaluations, found.dense,
        found.t_events, found.v_events, found.ended_by, lost_y)


def _times_last(values: Any, count: int) -> Any:
    """Return states at times whose axes come first, ``count`` of them, as an array whose last axes they are."""
    return np.moveaxis(values, range(count), range(-count, 0)) if count else values


def _system(f: Callable[[Any, Any], Any]) -> System:
    """Return ``v' = f(t, v)`` as a system whose acceleration does not depend on q."""

    def acceleration(t: Any, q: Any, v: Any) -> Any:
        return f(t, v)

    return System(acceleration, jacobian=Differences(acceleration, by_q=False),
                  taylor_coefficients=coefficients(acceleration))


def _of_motion(event: Event) -> Event:
    """Return an event of (t, y) as one of (t, q, v), where v is y."""

    def function(t: Any, q: Any, v: Any) -> Any:
        return event.function(t, v)

    def action(t: Any, q: Any, v: Any) -> tuple[Any, Any]:
        assert event.action is not None
        return q, event.action(t, v)

    function.__name__ = event.name
    return Event(function, event.direction, event.terminal, None if event.action is None else action)
