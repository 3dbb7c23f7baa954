"""Systems made from bare functions by probing them, and systems that count evaluations."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from integrators.errors import shown
from integrators.families.energy_preserving import averaged
from integrators.families.taylor import coefficients
from integrators.method import Acceleration, MethodError, System
from integrators.solving.values import is_finite, misshapen

PROBES = 8
"""Number of parts into which the duration is divided; at their ends a function is probed for velocity dependence."""


def bare(acceleration: Acceleration, times: Sequence[Any], q: Any, v: Any) -> System:
    """Make a System from an acceleration alone.

    Whether it depends on the velocity is probed near ``q`` and ``v``, at the first and the last time and evenly between
    them. The derivatives are central differences. Raises MethodError if the acceleration is not callable, fails at the
    start, or returns values that are not finite or have the wrong shape.
    """
    if not callable(acceleration):
        raise MethodError("The problem must be a function a(t, q, v) or an integrators.System.")

    def jacobian(t: Any, q: Any, v: Any) -> tuple[Any, Any]:
        dq, dv = 1e-5 * (1 + abs(q)), 1e-5 * (1 + abs(v))
        return (
            (acceleration(t, q + dq, v) - acceleration(t, q - dq, v)) / (2 * dq),
            (acceleration(t, q, v + dv) - acceleration(t, q, v - dv)) / (2 * dv),
        )

    t, last = times[0], times[-1]
    try:
        with np.errstate(all="ignore"):
            first = acceleration(t, q, v)
    except (ArithmeticError, ValueError) as fault:
        raise MethodError(f"The acceleration fails at the start, t = {t}: {fault}.") from fault
    if not is_finite(first):
        raise MethodError(f"The acceleration at the start, t = {t}, must be finite numbers, not {shown(first)}.")
    try:
        shape = np.broadcast_shapes(np.shape(first), np.shape(q))
    except ValueError:
        shape = np.shape(first)
    if shape != np.shape(q):
        raise MethodError(misshapen(np.shape(first), np.shape(q)))
    moments = [t, *(t + (last - t) * k / PROBES for k in range(1, PROBES)), last]
    places = (q, q + 0.5772157)
    velocity_free = all(_ignores_velocity(acceleration, when, place, v) for when in moments for place in places)
    mean, by_end = averaged(acceleration)
    return System(
        acceleration, velocity_free=velocity_free, jacobian=jacobian, mean_acceleration=mean, mean_jacobian=by_end,
        taylor_coefficients=coefficients(acceleration),
    )


def _ignores_velocity(acceleration: Acceleration, t: Any, q: Any, v: Any) -> bool:
    """Return True if the acceleration at (t, q) is equal for four trial velocities, or not finite for all of them."""
    values: list[Any] = []
    for w in (v, v + 0.7390851, -v - 1.2020569, v - v):
        try:
            with np.errstate(all="ignore"):
                values.append(acceleration(t, q, w))
        except (ArithmeticError, ValueError):
            values.append(math.nan)
    exists = [is_finite(a) for a in values]
    return not any(exists) or (all(exists) and all(bool(np.all(values[0] == a)) for a in values))


def counted(system: System, calls: list[int], also: Sequence[str] = ()) -> System:
    """Return a copy of a system that counts calls of its forces and flows in ``calls[0]``.

    ``also`` names further functions to count.
    """

    def counting(function: Callable[..., Any] | None) -> Any:
        if function is None:
            return None

        def counting_call(*arguments: Any) -> Any:
            calls[0] += 1
            return function(*arguments)

        return counting_call

    names = ("acceleration", "force", "mean_acceleration", "exact_flow", "taylor_coefficients", *also)
    return replace(system, **{name: counting(getattr(system, name)) for name in names})
