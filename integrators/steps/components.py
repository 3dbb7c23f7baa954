"""Steps on arrays of a few components, written out for each: Python is faster with numbers than with short arrays.

The operations are those of the step on whole arrays, in the same order, and so are all bits.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable
from typing import Any

import numpy as np

from integrators.method import MethodError
from integrators.solving.values import misshapen

FEW = 8
"""Largest number of components that are written out. From about twenty on whole arrays are as fast."""
NAME = re.compile(r"(?<![\w.])[a-z_]\w*", re.IGNORECASE)
"""A name in a formula, and not the exponent of a number."""
CALLED = frozenset({"acceleration", "force"})
"""Functions that a step may call on arrays; their first argument is the time."""


def written_out(source: str, count: int) -> ast.Module | None:
    """Return the syntax tree of a step's source with ``step`` written out for ``count`` components.

    ``step`` is to be straight-line: sums of products, and calls of the functions in :data:`CALLED`. None for others.
    The tree calls ``parts``, from an array to its components, and ``joined``, back again; see :func:`functions`.
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


def functions(shape: tuple[int, ...]) -> dict[str, Callable[..., Any]]:
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
