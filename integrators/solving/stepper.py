"""Interpreted step functions of a method on a system, in the system's number type."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from functools import lru_cache
from types import CodeType
from typing import Any

import numpy as np

from integrators.method import NEEDS, Method, MethodError, System
from integrators.registry import fitting
from integrators.solving.values import is_double
from integrators.steps import components, tracing
from integrators.steps.arrays import stage_solver
from integrators.steps.compensated import added, scaled, stepping
from integrators.steps.unroll import unroll

Step = Callable[..., tuple[Any, ...]]
Begin = Callable[[Any, Any, Any, Any], tuple[Any, ...]]
ELEMENTARY = ("sin", "cos", "exp", "log", "sqrt")
"""Elementary functions that a step's source may call."""


def stepper(
    method: Method, system: System, like: Any = 0.0, estimates: bool = False, dense: bool = False,
    compensated: bool = False,
) -> tuple[Step, Begin]:
    """Return a method's functions ``step(t, q, v, *memory, h)`` and ``begin(t, q, v, h) -> memory`` on a system.

    ``like`` is a value of the number type to be used, which decides how the coefficients are rounded. With
    ``estimates`` the step also returns its estimated errors, see :mod:`integrators.steps.estimates`; with ``dense`` its
    stages; with ``compensated`` it also takes and returns the rounding errors of q and v, see
    :mod:`integrators.steps.compensated`. Raises MethodError if the system does not meet a need of the method, or the
    method cannot be compensated.
    """
    _check_fit(method, system)
    arrays = isinstance(like, np.ndarray)
    array_step = method.array_step(system, dense, compensated, estimates) if arrays else None
    if array_step is not None:
        return stepping(array_step) if compensated else array_step, _nothing
    namespace: dict[str, Any] = {
        "acceleration": system.acceleration,
        "force": _force(system),
        "jacobian": system.jacobian,
        "mean_acceleration": system.mean_acceleration,
        "mean_jacobian": system.mean_jacobian,
        "exact_flow": system.exact_flow,
        "NAN": math.nan,
        "added": added,
        "scaled": scaled,
        **{name: getattr(np if arrays and is_double(like) else tracing, name) for name in ELEMENTARY},
    }
    hooks: dict[str, tuple[str, ...]] = {}
    if system.dissipative_flow is not None:
        hooks["drag"] = ()
        namespace["drag"] = system.dissipative_flow

    def constant(value: Fraction) -> str:
        """Store a coefficient in the problem's number type and precision, and return its name in the source."""
        name = f"c{value.numerator}_{value.denominator}".replace("-", "m")
        namespace[name] = (like - like + 1) * value.numerator / value.denominator
        return name

    options: Any = {"estimates": estimates, "dense": dense, "compensated": compensated}
    if not is_double(like):
        exec(unroll(method, hooks=hooks, number=constant, **options), namespace)
    else:
        long = method.tableau is not None or method.nystrom_tableau is not None  # sums of many terms, which gain by it
        few = np.size(like) if arrays and long and np.size(like) <= components.FEW else 0
        exec(_program(method, bool(hooks), few, **options), namespace)
        namespace |= components.functions(np.shape(like)) if few else {}
    if method.implicit and arrays:
        namespace["solve_stage"] = stage_solver(system)
    namespace |= method.functions(system, like)
    begin = namespace.get("begin", _nothing)
    single = len(method.memory) == 1
    return namespace["step"], (lambda t, q, v, h: (begin(t, q, v, h),)) if single else begin


def _nothing(t: Any, q: Any, v: Any, h: Any) -> tuple[Any, ...]:
    """Return the empty tuple: ``begin`` of a method that passes no values from one step to the next."""
    return ()


@lru_cache(maxsize=256)
def _program(method: Method, drag: bool, few: int, **options: Any) -> CodeType:
    """Return the code object of a method's generated step in double precision; cached.

    ``few`` is the number of an array's components that are written out; 0 for numbers and for long arrays.
    """
    source = unroll(method, hooks={"drag": ()} if drag else {}, **options)
    tree = components.written_out(source, few) if few else None
    return compile(source if tree is None else tree, f"<{method.name}>", "exec")


def _force(system: System) -> Callable[[Any, Any], Any]:
    """Return the velocity-free part f(t, q) of a system's acceleration, as a function."""
    if system.force is not None:
        return system.force
    return lambda t, q: system.acceleration(t, q, q - q)


def _check_fit(method: Method, system: System) -> None:
    """Raise MethodError if a system does not meet a method's needs; the message names them and methods that fit."""
    missing = method.needs - system.offers()
    if missing:
        wants = " and ".join(NEEDS.get(need, need) for need in sorted(missing))
        fits = ", ".join(list(fitting(system))[:6])
        raise MethodError(f"{method.name} needs {wants}, which this problem does not offer; {fits} fit.")
