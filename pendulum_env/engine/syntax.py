"""Questions about the syntax tree of a program that each of its readers asks: for stages, LLVM, JavaScript and JAX."""

from __future__ import annotations

import ast

from pendulum_env.common.sources import parsed


def functions_of(text: str) -> dict[str, ast.FunctionDef]:
    """Return the functions of a program's text by name."""
    return {node.name: node for node in parsed(text).body if isinstance(node, ast.FunctionDef)}


def parameters_of(function: ast.FunctionDef) -> list[str]:
    """Return the names of a function's parameters."""
    return [parameter.arg for parameter in function.args.args]


def statements_of(function: ast.FunctionDef) -> list[ast.stmt]:
    """Return the statements of a function after its docstring."""
    return function.body if ast.get_docstring(function, clean=False) is None else function.body[1:]


def names_in(*nodes: ast.AST) -> list[str]:
    """Return the names in parts of a program, once for each place; those of called functions are included."""
    return [one.id for node in nodes for one in ast.walk(node) if isinstance(one, ast.Name)]


def names_read(*nodes: ast.AST) -> list[str]:
    """Return the names that parts of a program read, once for each place."""
    return [one.id for node in nodes for one in ast.walk(node)
            if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Load)]


def names_set(*nodes: ast.AST) -> list[str]:
    """Return the names that parts of a program set, once for each place; counters of loops are included."""
    return [one.id for node in nodes for one in ast.walk(node)
            if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store)]


def is_nan(node: ast.expr) -> bool:
    """Return True for ``float('nan')``, which programs write for the constant NAN."""
    match node:
        case ast.Call(func=ast.Name("float"), args=[ast.Constant("nan")]):
            return True
    return False
