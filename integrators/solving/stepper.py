"""Interpreted step functions of a method on a system, in the system's number type.

Steps on arrays of a few components are written out for each component, because Python is faster with numbers than with
short arrays. The operations are those of the step on whole arrays, in the same order, and so are all bits.
"""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Callable
from fractions import Fraction
from functools import lru_cache
from types import CodeType
from typing import Any

import numpy as np

from integrators.method import NEEDS, Method, MethodError, System
from integrators.registry import fitting
from integrators.solving.values import is_double, misshapen
from integrators.steps import tracing
from integrators.steps.arrays import stage_solver
from integrators.steps.compensated import added, scaled, stepping
from integrators.steps.unroll import unroll

FEW = 8
"""Largest number of components that are written out. From about twenty on whole arrays are as fast."""
NAME = re.compile(r"(?<![\w.])[a-z_]\w*", re.IGNORECASE)
"""A name in a formula, and not the exponent of a number."""
CALLED = frozenset({"acceleration", "force"})
"""Functions that a step may call on arrays; their first argument is the time."""


def written_out(source: str, count: int) -> ast.Module | None:
    """Return the syntax tree of a step's source with ``step`` written out for ``count`` components.

    ``step`` is to be straight-line: sums of products, and calls of the functions in :data:`CALLED`. None for others.
    The tree calls ``parts``, from an array to its components, and ``joined``, back again; see
    :func:`component_functions`.
    """
    tree = ast.parse(source)
    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and node.name == "step":
            arrays = {one.arg for one in node.args.args} - {"t", "h"}
            lines = [f"{_names(one, count)} = parts({one})" for one in sorted(arrays)]
            try:
                lines += [line for one in node.body for line in _lines(one, arrays, count)]
            except _UnfitError:
                return None
            node.body = ast.parse("\n".join(lines)).body
    return tree


def component_functions(shape: tuple[int, ...]) -> dict[str, Callable[..., Any]]:
    """Return the functions ``parts`` and ``joined`` of a step on arrays of this shape, by name."""

    def parts(values: Any) -> list[Any]:
        if np.shape(values) != shape:
            raise MethodError(misshapen(np.shape(values), shape))
        found: list[Any] = values.ravel().tolist()
        return found

    def joined(*values: Any) -> Any:
        return np.array(values).reshape(shape)

    return {"parts": parts, "joined": (lambda *values: np.array(values)) if len(shape) == 1 else joined}


class _UnfitError(Exception):
    """Raised where a step is not straight-line."""


def _names(one: str, count: int) -> str:
    return "".join(f"{one}_{k}, " for k in range(count))


def _texts(node: ast.expr, arrays: set[str], count: int) -> list[str]:
    """Return the source texts of an expression for each component, which calls nothing."""
    if any(isinstance(one, ast.Call) for one in ast.walk(node)):
        raise _UnfitError
    text = NAME.sub(lambda one: f"{one[0]}_#" if one[0] in arrays else one[0], ast.unparse(node))
    return [text.replace("#", str(k)) for k in range(count)]


def _is_array(node: ast.expr, arrays: set[str]) -> bool:
    return any(isinstance(one, ast.Name) and one.id in arrays for one in ast.walk(node))


def _value(node: ast.expr, arrays: set[str], count: int) -> str:
    """Return the source text of a value: an array is joined of its components, and so are those in a tuple."""
    if isinstance(node, ast.Tuple):
        return "(" + "".join(f"{_value(one, arrays, count)}, " for one in node.elts) + ")"
    if not _is_array(node, arrays):
        return ast.unparse(node)
    return f"joined({', '.join(_texts(node, arrays, count))})"


def _lines(node: ast.stmt, arrays: set[str], count: int) -> list[str]:
    """Return the source lines of a statement; the array that it sets is added to ``arrays``."""
    match node:
        case ast.Expr(ast.Constant()):
            return [ast.unparse(node)]
        case ast.Return(ast.expr() as value):
            return [f"return {_value(value, arrays, count)}"]
        case ast.Assign([ast.Name(one)], ast.Call(ast.Name(function), given, []) as call) if function in CALLED:
            texts = [_value(value, arrays, count) for value in given]
            if any(isinstance(part, ast.Call) for value in call.args for part in ast.walk(value)):
                raise _UnfitError
            arrays.add(one)
            return [f"{_names(one, count)} = parts({function}({', '.join(texts)}))"]
        case ast.Assign([ast.Name(one)], value) if _is_array(value, arrays):
            texts = _texts(value, arrays, count)
            arrays.add(one)
            return [f"{one}_{k} = {text}" for k, text in enumerate(texts)]
    raise _UnfitError


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
        few = np.size(like) if arrays and long and np.size(like) <= FEW else 0
        exec(_program(method, bool(hooks), few, **options), namespace)
        namespace |= component_functions(np.shape(like)) if few else {}
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
    tree = written_out(source, few) if few else None
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
