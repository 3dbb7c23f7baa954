"""Short functions of a program, written in place of their calls before numba compiles it.

numba takes some 10 ms for every function, however short. A function that is one expression is therefore written where
it is called, with the arguments in place of its parameters: the same operations in the same order, so the same bits.
"""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Mapping
from copy import deepcopy

from pendulum_env.engine.source import PARSING
from pendulum_env.engine.stages import NUMERIC

MOST = 40
"""A function that is called several times is folded if its operations times its calls are at most this many.

Comparisons and choices do not count.
"""


def folded(text: str) -> str:
    """Return a program in which functions of one expression are written in place of their calls, where they can be.

    A function stays if it is long and called often. A call stays if it names its arguments or leaves some out, if an
    argument that the function takes twice is more than a name or a number, or if a name means something else there.
    """
    with PARSING:
        tree = ast.parse(text)
    functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
    calls = Counter(node.func.id for node in ast.walk(tree) if isinstance(node, ast.Call)
                    and isinstance(node.func, ast.Name))
    short: dict[str, tuple[list[str], ast.expr]] = {}
    for function in functions:
        names = {node.id for node in ast.walk(function) if isinstance(node, ast.Name)
                 and isinstance(node.ctx, ast.Store)}
        parameters = [parameter.arg for parameter in function.args.args]
        _Folded(short, names.union(parameters)).visit(function)
        result = _result(function)
        if result is not None:
            operations = sum(isinstance(node, (ast.operator, ast.unaryop, ast.Call)) for node in ast.walk(result))
            if operations * calls[function.name] <= MOST or calls[function.name] == 1:
                short[function.name] = parameters, result
    used = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    tree.body = [node for node in tree.body if not (isinstance(node, ast.FunctionDef) and node.name in short)
                 or node.name in used]
    return ast.unparse(tree)


def _result(function: ast.FunctionDef) -> ast.expr | None:
    """Return the expression that an inlined function is, None if it is more than one."""
    inlined = [node.id for node in function.decorator_list if isinstance(node, ast.Name)] == ["inline"]
    last = function.body[-1]
    only = len(function.body) == 1 + (ast.get_docstring(function) is not None)
    if inlined and only and isinstance(last, ast.Return) and all(isinstance(node, NUMERIC) for node in ast.walk(last)):
        return last.value
    return None


class _Folded(ast.NodeTransformer):
    """Writes the functions ``short`` in place of their calls in a function with the local names ``names``."""

    def __init__(self, short: Mapping[str, tuple[list[str], ast.expr]], names: set[str]) -> None:
        self.short, self.names = short, names

    def visit_Call(self, call: ast.Call) -> ast.expr:
        self.generic_visit(call)
        if not isinstance(call.func, ast.Name) or call.func.id not in self.short:
            return call
        parameters, result = self.short[call.func.id]
        if call.keywords or len(call.args) != len(parameters) or any(isinstance(x, ast.Starred) for x in call.args):
            return call
        taken = Counter(node.id for node in ast.walk(result) if isinstance(node, ast.Name))
        twice = any(taken[name] > 1 and not isinstance(value, (ast.Name, ast.Constant))
                    for name, value in zip(parameters, call.args, strict=True))
        if twice or not self.names.isdisjoint({call.func.id, *taken}.difference(parameters)):
            return call
        put: ast.expr = _Put(dict(zip(parameters, call.args, strict=True))).visit(deepcopy(result))
        return put


class _Put(ast.NodeTransformer):
    """Puts arguments in place of the names of parameters."""

    def __init__(self, arguments: Mapping[str, ast.expr]) -> None:
        self.arguments = arguments

    def visit_Name(self, name: ast.Name) -> ast.expr:
        return deepcopy(self.arguments.get(name.id, name))
