"""Systems made from bare functions by probing them, a probe for coupled components, and systems that count."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from integrators.errors import shown
from integrators.families.energy_preserving import averaged
from integrators.families.taylor import coefficients
from integrators.method import Acceleration, Method, MethodError, System
from integrators.solving.values import is_finite, like, misshapen, own_copy
from integrators.steps.arrays import Derivative

PROBES = 8
"""Number of parts into which the duration is divided; a function is probed at their ends."""


ARGUMENTS = {"acceleration": "t, q, v", "force": "t, q", "dissipative_flow": "t, q, v, h", "jacobian": "t, q, v",
             "mean_acceleration": "t, q, v, s", "mean_jacobian": "t, q, v, s", "exact_flow": "t, q, v, h",
             "taylor_coefficients": "t, q, v, n"}
"""Name of a function of a System -> its arguments."""
SEVERAL = ("jacobian", "mean_jacobian", "exact_flow", "taylor_coefficients")
"""Functions of a System that return several values."""


def check_arguments(function: Callable[..., Any], name: str, arguments: str) -> None:
    """Raise MethodError for a function that does not take so many arguments as ``arguments`` lists, such as "t, q, v".
    """
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):  # functions written in C often have none
        return
    try:
        signature.bind(*arguments.split(", "))
    except TypeError as fault:
        raise MethodError(f"{name} must be a function of ({arguments}), not of {signature}: {fault}.") from None


def with_arguments(function: Any, args: Any, name: str = "The acceleration", arguments: str = "t, q, v") -> Any:
    """Return a function, or a System of functions, that passes ``args`` on after its own arguments; itself for none.

    Raises MethodError if ``args`` is no tuple or list, or the function does not take so many arguments.
    """
    if not isinstance(args, (tuple, list)):
        raise MethodError(f"args must be a tuple of further arguments, such as args=(k,), not {shown(args)}.")
    if not args:
        return function
    if isinstance(function, System):
        return replace(function, **{key: with_arguments(getattr(function, key), args, key, ARGUMENTS[key])
                                    for key in ARGUMENTS if getattr(function, key) is not None})
    if not callable(function):
        return function
    check_arguments(function, name, ", ".join([arguments, *(f"args[{k}]" for k in range(len(args)))]))

    def with_args(*given: Any) -> Any:
        return function(*given, *args)

    with_args.__name__ = str(getattr(function, "__name__", type(function).__name__))
    return with_args


def problem(acceleration: Acceleration | System, times: Sequence[Any], q: Any, v: Any, double: bool) -> System:
    """Return a System, made from a bare acceleration if need be, whose functions may return an array that they reuse.

    ``double`` says that the solution is computed with doubles. See :func:`bare`. Raises MethodError if the acceleration
    is not callable, takes other arguments, changes its arguments, fails at the start, or returns values that are not
    finite or have the wrong shape.
    """
    if not isinstance(acceleration, System):
        return bare(acceleration, times, q, v, double)
    functions = {name: getattr(acceleration, name) for name in ARGUMENTS if getattr(acceleration, name) is not None}
    for name, function in functions.items():
        check_arguments(function, name, ARGUMENTS[name])
    if isinstance(q, np.ndarray):
        with unchanged("The acceleration", q=q, v=v):
            for t in _moments(times):
                _at(acceleration.acceleration, t, q, v)
    copies: dict[str, Any] = {name: copying(function, double, name in SEVERAL) for name, function in functions.items()}
    return replace(acceleration, **copies)


def copying(
    function: Callable[..., Any], double: bool, several: bool = False, name: str = "The acceleration"
) -> Callable[..., Any]:
    """Return a user's function whose results are copied, see :func:`integrators.solving.values.own_copy`.

    ``several`` is True for a function that returns several values, ``name`` what errors call it.
    """
    if several:
        return lambda *arguments: [own_copy(value, double) for value in function(*arguments)]
    return lambda *arguments: filling(own_copy(function(*arguments), double, name), arguments[1], name)


def filling(value: Any, q: Any, name: str = "The acceleration") -> Any:
    """Return an acceleration in the shape of q, where it is one number for all components.

    Raises MethodError for another shape that does not fit q; ``name`` is what it calls the acceleration.
    """
    shape = np.shape(q)
    if np.shape(value) == shape:
        return value
    try:
        return np.broadcast_to(value, shape).copy()
    except ValueError:
        raise MethodError(misshapen(np.shape(value), shape, name)) from None


@contextmanager
def unchanged(function: str, **arrays: Any) -> Iterator[None]:
    """Restore arrays such as q and v, and raise MethodError if a function in this ``with`` block changes them in place.

    ``function`` is what the error calls it.
    """
    before = {name: x.copy() if isinstance(x, np.ndarray) else x for name, x in arrays.items()}
    yield
    for name, x in arrays.items():
        if isinstance(x, np.ndarray) and not np.array_equal(x, before[name]):
            x[...] = before[name]
            raise MethodError(f"{function} changes its argument {name} in place; it must leave {' and '.join(arrays)} "
                              "as they are, and may return an array of its own.")


def tried(function: Any, name: str, t: Any, double: bool, **arrays: Any) -> Callable[..., Any]:
    """Return a bare function of the time and of the state ``arrays``, such as q and v, whose results are copied.

    A function of floats stays as it is. ``name`` is what errors call it. Raises MethodError if it is not callable,
    takes other arguments, changes them, fails at the start, or returns values that are not finite or have the wrong
    shape.
    """
    arguments = ", ".join(["t", *arrays])
    if not callable(function):
        more = " or an integrators.System" if len(arrays) > 1 else ""
        raise MethodError(f"The problem must be a function {'a' if more else name}({arguments}){more}.")
    check_arguments(function, name, arguments)
    place = next(iter(arrays.values()))
    try:
        with np.errstate(all="ignore"), unchanged(name, **arrays):
            given = function(t, *arrays.values())
            first = own_copy(given, double, name)
            first = filling(first, place, name) if is_finite(first) else first
    except MethodError:
        raise
    except (ArithmeticError, TypeError, ValueError) as fault:
        raise MethodError(f"{name} fails at the start, t = {t}: {fault}.") from fault
    if not is_finite(first):
        raise MethodError(f"{name} at the start, t = {t}, must be finite numbers, not {shown(first)}.")
    # a function of floats does without the call that copies them
    return copying(function, double, name=name) if first is not given else function


@dataclass(frozen=True)
class Differences:
    """The ``jacobian`` of an acceleration, by central differences; ``by_q`` is False if it does not depend on q."""

    acceleration: Acceleration
    by_q: bool = True

    def __call__(self, t: Any, q: Any, v: Any) -> tuple[Any, Any]:
        a, dq, dv = self.acceleration, 1e-5 * (1 + abs(q)), 1e-5 * (1 + abs(v))
        return ((a(t, q + dq, v) - a(t, q - dq, v)) / (2 * dq) if self.by_q else v - v,
                (a(t, q, v + dv) - a(t, q, v - dv)) / (2 * dv))


def bare(acceleration: Acceleration, times: Sequence[Any], q: Any, v: Any, double: bool) -> System:
    """Make a System from an acceleration alone.

    Whether it depends on the velocity is probed near ``q`` and ``v``, at the first and the last time and evenly between
    them. The derivatives are central differences. Raises MethodError if the acceleration is not callable, takes other
    arguments, changes its arguments, fails at the start, or returns values that are not finite or have the wrong shape.
    """
    acceleration = tried(acceleration, "The acceleration", times[0], double, q=q, v=v)

    places = (q, q + like(q - q, 0.5772157))
    with unchanged("The acceleration", q=q, v=v):
        velocity_free = all(
            _ignores_velocity(acceleration, when, place, v) for when in _moments(times) for place in places)
    mean, by_end = averaged(acceleration)
    return System(
        acceleration, velocity_free=velocity_free, jacobian=Differences(acceleration), mean_acceleration=mean,
        mean_jacobian=by_end, taylor_coefficients=coefficients(acceleration),
    )


def _moments(times: Sequence[Any]) -> list[Any]:
    """Return the first time, the last one, and times evenly between them."""
    t, last = times[0], times[-1]
    return [t, *(t + (last - t) * k / PROBES for k in range(1, PROBES)), last]


def _at(acceleration: Acceleration, t: Any, q: Any, v: Any) -> Any:
    """Return the acceleration at a place where it is probed; nan if it fails there."""
    try:
        with np.errstate(all="ignore"):
            return acceleration(t, q, v)
    except (ArithmeticError, TypeError, ValueError):
        return math.nan


def _ignores_velocity(acceleration: Acceleration, t: Any, q: Any, v: Any) -> bool:
    """Return True if the acceleration at (t, q) is equal for four trial velocities, or not finite for all of them."""
    values: list[Any] = []
    zero = v - v
    for w in (v, v + like(zero, 0.7390851), -v - like(zero, 1.2020569), zero):
        values.append(_at(acceleration, t, q, w))
    exists = [is_finite(a) for a in values]
    return not any(exists) or (all(exists) and all(bool(np.all(values[0] == a)) for a in values))


def with_couplings(
    system: System, chosen: Method, asked: str | Method, times: Sequence[Any], q: Any, v: Any
) -> System:
    """Return a system whose ``jacobian`` knows the couplings of an array's components, if a method's formula uses it.

    Independent components keep the system as it is, and so do the implicit methods, which solve arrays by differences.
    ``asked`` is the name or the object by which the caller chose the method. Raises MethodError if the method, under
    that name, is for one degree of freedom and the acceleration couples components.
    """
    name = asked if isinstance(asked, str) else chosen.name
    alone = chosen.one_freedom(name)
    matters = alone or ("jacobian" in chosen.needs and not chosen.implicit)
    if not matters or not isinstance(q, np.ndarray) or not _couples(system.acceleration, times, q, v):
        return system
    if not alone:
        return replace(system, jacobian=lambda t, q, v: (Derivative(system, t, q, v), None))
    other = "rk4" if chosen.one_freedom(chosen.name) else chosen.name
    raise MethodError(
        f"{name} is defined here for one degree of freedom, or an array of independent ones, and this acceleration "
        f"couples components of q; use another method, such as {other}."
    )


def _couples(acceleration: Acceleration, times: Sequence[Any], q: Any, v: Any) -> bool:
    """Return True if the acceleration of a component depends on q or v of another one, near the given state.

    Each probe changes about half of the components and compares the acceleration of the others. The halves are those of
    the binary digits of the components' numbers, so that every pair of components is separated by some probe.
    """
    def values(t: Any, q: Any, v: Any) -> Any:
        return np.broadcast_to(_at(acceleration, t, q, v), np.shape(q))

    number = np.arange(np.size(q)).reshape(np.shape(q))
    digits = [(number >> k) % 2 == one for k in range(max(np.size(q) - 1, 0).bit_length()) for one in (0, 1)]
    for t in _moments(times):
        for place in (q, q + 0.5772157):
            before = values(t, place, v)
            for moved in digits:
                after = values(t, place + 0.3678794 * moved, v + 0.7390851 * moved)
                if np.any((before != after) & ~moved & np.isfinite(before) & np.isfinite(after)):
                    return True
    return False


def counted(system: System, calls: list[int], also: Sequence[str] = ()) -> System:
    """Return a copy of a system that counts calls of its forces and flows in ``calls[0]``.

    ``also`` names further functions to count. The calls in :class:`Differences` count, too.
    """

    def counting(function: Callable[..., Any] | None) -> Any:
        if function is None:
            return None

        def counting_call(*arguments: Any) -> Any:
            calls[0] += 1
            return function(*arguments)

        return counting_call

    names = ("acceleration", "force", "mean_acceleration", "exact_flow", "taylor_coefficients", *also)
    functions = {name: counting(getattr(system, name)) for name in names}
    if isinstance(system.jacobian, Differences):
        functions["jacobian"] = replace(system.jacobian, acceleration=functions["acceleration"])
    return replace(system, **functions)
