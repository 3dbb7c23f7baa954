"""Systems from bare functions, found out by trying them, and systems that count how often they are asked."""

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
"""Parts of the whole time at whose ends a bare function is probed for the velocity."""


def bare(acceleration: Acceleration, times: Sequence[Any], q: Any, v: Any) -> System:
    """A system from a function alone: the velocity's influence probed, derivatives by central differences.

    Probed near ``q`` and ``v``, at the first and the last time and evenly between.
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
        together = np.broadcast_shapes(np.shape(first), np.shape(q))
    except ValueError:
        together = np.shape(first)
    if together != np.shape(q):
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
    """False if the acceleration differs between four velocities here, or exists only for some of them."""
    found: list[Any] = []
    for w in (v, v + 0.7390851, -v - 1.2020569, v - v):
        try:
            with np.errstate(all="ignore"):
                found.append(acceleration(t, q, w))
        except (ArithmeticError, ValueError):
            found.append(math.nan)
    exists = [is_finite(a) for a in found]
    return not any(exists) or (all(exists) and all(bool(np.all(found[0] == a)) for a in found))


def counted(system: System, calls: list[int], also: Sequence[str] = ()) -> System:
    """The same system, which counts its evaluations, ``also`` of its other functions."""

    def counting(function: Callable[..., Any] | None) -> Any:
        if function is None:
            return None

        def asked(*arguments: Any) -> Any:
            calls[0] += 1
            return function(*arguments)

        return asked

    names = ("acceleration", "force", "mean_acceleration", "exact_flow", "taylor_coefficients", *also)
    return replace(system, **{name: counting(getattr(system, name)) for name in names})
