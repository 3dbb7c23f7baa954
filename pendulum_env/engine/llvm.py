"""Arithmetic of a program, and its loops over blocks of pendulums, written as instructions of LLVM.

numba needs some 0.6 ms for every operation, because it finds the types of each. In a generated program there is little
to find: nearly all that it computes is a number or a truth value. So functions with nothing but arithmetic, choices,
calls of each other and loops ``for i in range(U(n))`` over elements of arrays are written here, statement by statement,
as the same operations in the same order: the bits of a result stay the same. In all other functions this is done with
statements that follow each other. numba compiles what is left, such as loops that end early.

Loops ``for i in lanes(n)`` over elements of blocks are written with vectors: an operation then computes a number for
each of several pendulums, for twice as many as fill a register of the processor, so that it always has two independent
operations to work on. See :mod:`pendulum_env.engine.lanes`.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping, Sequence, Set
from itertools import count
from typing import Any, NamedTuple

from numba import TypingError, types
from numba.core import cgutils  # loops; numba has no public way to write them
from numba.core.cgutils import (
    ir,  # that of llvmlite, on which numba is built, and which the package does not name itself
)
from numba.extending import intrinsic

from pendulum_env.common.sources import is_nan, names_read, names_set, parameters_of, parsed, statements_of
from pendulum_env.engine import lanes
from pendulum_env.engine.lanes import element, spread

__all__ = ["CALL", "WRITTEN", "LlvmFunction", "LlvmProgram", "LlvmWriter", "instructions"]

CALL = "_instructions"
"""Name of :func:`instructions` in a program."""
LEAST = 2
"""Statements in a row that have fewer operations are left to numba."""
NUMBER, TRUTH, WHOLE = ir.DoubleType(), ir.IntType(1), ir.IntType(64)
KINDS = {types.float64: NUMBER, types.boolean: TRUTH, types.int64: WHOLE, types.uint64: WHOLE}
"""Types of numba -> those of LLVM."""
RESULTS = {NUMBER: types.float64, TRUTH: types.boolean, WHOLE: types.int64}
SINGLE, BYTE = ir.FloatType(), ir.IntType(8)
ELEMENTS = {types.float64: NUMBER, types.float32: SINGLE, types.boolean: BYTE}
"""Types of the elements of an array -> those of LLVM, in memory."""
OPERATIONS = {ast.Add: "fadd", ast.Sub: "fsub", ast.Mult: "fmul", ast.Div: "fdiv", ast.BitAnd: "and_", ast.BitOr: "or_"}
SIGNS = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
ELEMENTARY = {"abs": "llvm.fabs", "sqrt": "llvm.sqrt"}
CHOSEN = {"max": ">", "min": "<"}
"""Functions of numbers -> how a later number must compare with the result so far to take its place, as in Python."""


class LlvmFunction(NamedTuple):
    """Function of a program that is written as instructions, or statements in a row that are made a function.

    ``results`` are the values that it returns, as a tuple or, if it is ``single``, as one value. ``kind`` is the name
    of its decorator: "inline", "separate", if its arrays never overlap, or "apart", if it should not be inlined.
    """

    name: str
    parameters: tuple[str, ...]
    body: tuple[ast.stmt, ...]
    results: tuple[ast.expr, ...]
    single: bool
    kind: str


class LlvmProgram:
    """A program in two parts: ``text``, which numba compiles, and functions that :func:`instructions` writes.

    Args:
        text: source of the program.
        entry: name of the function that Python calls.
        given: types of the arguments of that function, in numba.
        width: number of elements of a vector.
    """

    def __init__(self, text: str, entry: str, given: Sequence[Any], width: int = 1) -> None:
        tree = parsed(text)
        self._entry, self._given, self.width = entry, given, width
        self._shapes: Mapping[str, int] = {}
        self.functions: dict[str, LlvmFunction] = {}
        self.constants: dict[str, float] = {}
        self._whole: Set[str] = frozenset()
        tree.body = [node for node in tree.body if not self._takes(node)]
        calls = _Numbered(self)
        self.text = ast.unparse(ast.fix_missing_locations(calls.visit(tree)))
        self._numbers = tuple(calls.numbers.values())

    def forget(self) -> None:
        """Forget the program's functions, once it has been compiled."""
        for number in self._numbers:
            WRITTEN.pop(number, None)

    def _takes(self, node: ast.stmt) -> bool:
        """Return True for a function that is written as a whole; of any other, take the statements in a row."""
        match node:
            case ast.Assign(targets=[ast.Name(id=name)], value=value):
                constant = _constant(value)
                if constant is not None:
                    self.constants[name] = constant
            case ast.FunctionDef():
                self._whole, self._shapes = _whole_numbers(node), {}
                if node.name == self._entry:
                    self._shapes = {name: kind.ndim if _can_be_read(kind) else 0
                                    for name, kind in zip(parameters_of(node), self._given, strict=True)
                                    if isinstance(kind, types.Array)}
                found = self._function(node)
                if found is None:
                    _Rows(node, self).replace()
                    return False
                self.functions[found.name] = found
                return True
        return False

    def _function(self, node: ast.FunctionDef) -> LlvmFunction | None:
        """Return a function that can be written as instructions as a whole, else None."""
        decorators = [one.id for one in node.decorator_list if isinstance(one, ast.Name)]
        if decorators not in (["inline"], ["separate"], ["apart"]) or node.args.defaults:
            return None
        parameters, body = tuple(parameters_of(node)), statements_of(node)
        results: tuple[ast.expr, ...] = ()
        single = False
        match body[-1]:
            case ast.Return(value=ast.Tuple(elts=elements)):
                body, results = body[:-1], tuple(elements)
            case ast.Return(value=ast.expr() as value):
                body, results, single = body[:-1], (value,), True
        known = {*parameters, *self.constants}
        if all(self.line(one, known) for one in body) and all(self.value(one, known) for one in results):
            return LlvmFunction(node.name, parameters, tuple(body), results, single, decorators[0])
        return None

    def line(self, line: ast.stmt, known: set[str]) -> bool:
        """Return True if a statement can be written as instructions; add the names that it sets to ``known``."""
        match line:
            case ast.Assign(targets=[ast.Tuple(elts=targets)], value=ast.Tuple() | ast.Call() as value):
                good = self.values(value, known)
            case ast.Assign(targets=[target], value=value):
                targets, good = [target], self.value(value, known)
            case ast.Expr(value=ast.Call(func=ast.Name(id=name)) as call):
                return name in self.functions and not self.functions[name].results and self._called(call, known)
            case ast.For(target=ast.Name(id=name), iter=ast.Call() as call, orelse=[]) if (size := _size(call)):
                inside = {*known, name}
                return size in known and known.isdisjoint(names_set(line)) and all(
                    self.line(one, inside) for one in line.body)
            case _:
                return False
        for target in targets:
            match target:
                case ast.Name(id=name) if name not in self.functions:
                    known.add(name)
                case ast.Subscript() if self._element(target, known):
                    pass
                case _:
                    return False
        return good

    def values(self, node: ast.expr, known: Set[str]) -> bool:
        """Return True if a tuple, or a call with several results, can be written as instructions."""
        match node:
            case ast.Tuple(elts=elements):
                return all(self.value(one, known) for one in elements)
            case ast.Call(func=ast.Name(id=name)):
                return name in self.functions and not self.functions[name].single and self._called(node, known)
        return False

    def value(self, node: ast.expr, known: Set[str]) -> bool:
        """Return True if an expression can be written as instructions, with these names."""
        match node:
            case ast.Name(id=name):
                return name in known and name not in self._whole
            case ast.Constant(value=value):
                return isinstance(value, (float, bool))
            case ast.BinOp(left=left, op=op, right=right):
                return type(op) in OPERATIONS and self.value(left, known) and self.value(right, known)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return self.value(operand, known)
            case ast.Compare(left=left, ops=[op], comparators=[right]):
                return type(op) in SIGNS and self.value(left, known) and self.value(right, known)
            case ast.IfExp(test=test, body=body, orelse=other):
                unread = (_elements(body) | _elements(other)) - _elements(test)  # both are computed in any case
                return not unread and all(self.value(one, known) for one in (test, body, other))
            case ast.Subscript():
                return self._element(node, known)
            case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]) if name in ELEMENTARY:
                return self.value(argument, known)
            case ast.Call(func=ast.Name(id=name), args=[_, _, *_] as parts, keywords=[]) if name in CHOSEN:
                return all(self.value(one, known) for one in parts)
            case ast.Call(func=ast.Name(id=name)):
                return name in self.functions and self.functions[name].single and self._called(node, known)
        return False

    def _called(self, call: ast.Call, known: Set[str]) -> bool:
        """Return True for a call with a value, an array or a place for every parameter."""
        assert isinstance(call.func, ast.Name)
        return not call.keywords and len(call.args) == len(self.functions[call.func.id].parameters) and all(
            self.value(one, known) or _given(one, known) for one in call.args)

    def _element(self, node: ast.Subscript, known: Set[str]) -> bool:
        """Return True for an element of an array of one or two dimensions."""
        places = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        if not isinstance(node.value, ast.Name) or node.value.id not in known:
            return False
        return self._shapes.get(node.value.id, len(places)) == len(places) <= 2 and all(
            _place(one, known) for one in places)


def _size(call: ast.Call) -> str:
    """Return the name of the number of turns of a loop over ``range(U(n))`` or ``lanes(n)``, else ""."""
    match call:
        case ast.Call(func=ast.Name("range"), args=[ast.Call(func=ast.Name("U"), args=[ast.Name(id=size)])]):
            return size
        case ast.Call(func=ast.Name(lanes.NAME), args=[ast.Name(id=size)]):
            return size
    return ""


def _elements(node: ast.expr) -> set[str]:
    """Return the sources of the elements of arrays that an expression reads."""
    return {ast.unparse(one) for one in ast.walk(node) if isinstance(one, ast.Subscript)}


def _constant(node: ast.expr) -> float | None:
    """Return the number of a constant of a program, such as ``100.0``, ``-1.0`` and ``float('nan')``, else None."""
    match node:
        case ast.Constant(value=float(number)):
            return number
        case ast.UnaryOp(op=ast.USub(), operand=ast.Constant(value=float(number))):
            return -number
    return math.nan if is_nan(node) else None


def _given(node: ast.expr, known: Set[str]) -> bool:
    """Return True for an argument that is a name, a whole number such as ``3``, or a place such as ``U(3)``."""
    return not isinstance(node, ast.BinOp) and _place(node, known)


def _place(node: ast.expr, known: Set[str]) -> bool:
    """Return True for a place in an array: a whole number, a name, or a sum of them. Places are never negative."""
    match node:
        case ast.Name(id=name):
            return name in known
        case ast.Constant(value=value):
            return type(value) is int and value >= 0
        case ast.Call(func=ast.Name("U"), args=[ast.Constant(value=int())]):
            return True
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            return _place(left, known) and _place(right, known)
    return False


def _whole_numbers(function: ast.FunctionDef) -> Set[str]:
    """Return the local names that are whole numbers: counts, places in arrays, and what is computed of these."""
    found: set[str] = set()
    lines: list[tuple[str, ast.expr]] = []
    for node in ast.walk(function):
        match node:
            case ast.For(target=ast.Name(id=name), iter=ast.Call(func=ast.Name("range" | lanes.NAME))):
                found.add(name)
            case ast.Assign(targets=[ast.Name(id=name)], value=value) | ast.AugAssign(
                    target=ast.Name(id=name), value=value):
                lines.append((name, value))
            case ast.Call(func=ast.Name("range" | "U" | lanes.NAME), args=parts):
                found.update(one.id for one in parts if isinstance(one, ast.Name))
            case ast.Subscript(slice=places):
                found.update(names_read(places))
    before = -1
    while len(found) > before:
        before = len(found)
        found.update(name for name, value in lines if _is_whole(value, found))
    return found


def _is_whole(node: ast.expr, known: Set[str]) -> bool:
    """Return True for an expression whose value is a whole number."""
    match node:
        case ast.Constant(value=value):
            return type(value) is int
        case ast.Name(id=name):
            return name in known
        case ast.Call(func=ast.Name("len" | "int" | "U")):
            return True
        case ast.Call(func=ast.Name("min" | "max"), args=parts):
            return all(_is_whole(one, known) for one in parts)
        case ast.BinOp(left=one, right=other) | ast.IfExp(body=one, orelse=other):
            return _is_whole(one, known) and _is_whole(other, known)
    return False


class _Rows:
    """Replaces statements in a row by calls, in a function of which a part is left to numba."""

    def __init__(self, function: ast.FunctionDef, program: LlvmProgram) -> None:
        self.function, self.program, self.numbers = function, program, count()
        self.local = {*parameters_of(function), *names_set(function)}
        self.reads = names_read(function)
        self.outside = self._read_outside(function, frozenset())

    def replace(self) -> None:
        """Replace the statements of the function."""
        self.function.body = self._block(self.function.body)

    def _taken(self, line: ast.stmt) -> bool:
        """Return True for a statement that can be in a row. In every turn, a loop must set its names before it reads
        them.
        """
        inside = names_set(line) if isinstance(line, ast.For) else ()
        return self.program.line(line, self.local.union(self.program.constants).difference(inside))

    def _read_outside(self, node: ast.AST, inside: frozenset[str]) -> Set[str]:
        """Return the names that are read elsewhere than in loops which set them before."""
        if isinstance(node, ast.For) and self._taken(node):
            inside = inside.union(names_set(node))
        found = {node.id} if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load) else set()
        return found.difference(inside).union(*(self._read_outside(one, inside) for one in ast.iter_child_nodes(node)))

    def _block(self, body: Sequence[ast.stmt]) -> list[ast.stmt]:
        """Return the statements of a block, in which those in a row are replaced."""
        done: list[ast.stmt] = []
        row: list[ast.stmt] = []
        for line in body:
            inside = names_set(line) if isinstance(line, ast.For) else ()
            if self.outside.isdisjoint(inside) and self._taken(line):
                row.append(line)
                continue
            done += self._call(row)
            row = []
            for block in ("body", "orelse"):
                if getattr(line, block, None):
                    setattr(line, block, self._block(getattr(line, block)))
            done.append(line)
        return done + self._call(row)

    def _call(self, row: list[ast.stmt]) -> list[ast.stmt]:
        """Return statements in a row as the call of a function made of them; as they are, if they are few."""
        operations = sum(isinstance(node, (ast.operator, ast.Compare, ast.IfExp, ast.Call, ast.Subscript))
                         for line in row for node in ast.walk(line))
        if operations < LEAST:
            return row
        given: dict[str, None] = {}
        made: dict[str, None] = {}
        for line in row:
            stored = names_set(line)
            inside = stored if isinstance(line, ast.For) else ()  # a loop keeps its names to itself
            given.update(dict.fromkeys(name for name in names_read(line)
                                       if name in self.local and name not in made and name not in inside))
            made.update(dict.fromkeys(name for name in stored if name not in inside))
        here = [name for line in row for name in names_read(line)]
        wanted = [name for name in made if name in given or self.reads.count(name) > here.count(name)]
        name = f"_{self.function.name}_{next(self.numbers)}"
        results = tuple(ast.Name(one, ast.Load()) for one in wanted)
        self.program.functions[name] = LlvmFunction(name, tuple(given), tuple(row), results, len(wanted) == 1, "inline")
        call = ast.Call(ast.Name(name, ast.Load()), [ast.Name(one, ast.Load()) for one in given], [])
        if not wanted:
            return [ast.Expr(call)]
        targets: list[ast.expr] = [ast.Name(one, ast.Store()) for one in wanted]
        return [ast.Assign([targets[0] if len(targets) == 1 else ast.Tuple(targets, ast.Store())], call)]


class _Numbered(ast.NodeTransformer):
    """Writes calls of :func:`instructions` in place of those of a program's functions, each with a number; and for
    numba, ``range(U(n))`` in place of ``lanes(n)``.
    """

    def __init__(self, program: LlvmProgram) -> None:
        self.program, self.writer = program, LlvmWriter(program)
        self.numbers: dict[str, int] = {}

    def visit_Call(self, call: ast.Call) -> ast.expr:
        self.generic_visit(call)
        match call:
            case ast.Call(func=ast.Name(lanes.NAME), args=[size]):
                return ast.Call(ast.Name("range", ast.Load()), [ast.Call(ast.Name("U", ast.Load()), [size], [])], [])
        if not isinstance(call.func, ast.Name) or call.func.id not in self.program.functions:
            return call
        name = call.func.id
        if name not in self.numbers:
            self.numbers[name] = next(_NUMBERS)
            WRITTEN[self.numbers[name]] = self.writer, self.program.functions[name]
        parameters = self.program.functions[name].parameters
        named = {one.arg: one.value for one in call.keywords}
        given = [*call.args, *(named[name] for name in parameters[len(call.args):])]
        return ast.Call(ast.Name(CALL, ast.Load()),
                        [ast.Constant(self.numbers[name]), ast.Tuple(given, ast.Load())], [])


class LlvmWriter:
    """Writes functions of a program into modules of LLVM."""

    def __init__(self, program: LlvmProgram) -> None:
        self.functions, self.constants, self.width = program.functions, program.constants, program.width
        self._lane: lanes.Lane | None = None
        self._results: dict[str, list[Any]] = {}
        self._trial = ir.Module()

    def function(self, module: Any, function: LlvmFunction, kinds: Sequence[Any]) -> Any:
        """Return the function of a module for parameters of these types; write it, if it is not there."""
        name = f"{function.name}.{' '.join(map(str, kinds))}"
        if name in module.globals:
            return module.globals[name]
        results = self.results(function, kinds)
        kind = ir.VoidType() if not results else results[0] if function.single else ir.LiteralStructType(results)
        written = ir.Function(module, ir.FunctionType(kind, kinds), name)
        written.linkage = "internal"
        written.attributes.add("noinline" if function.kind == "apart" else "alwaysinline")
        if function.kind == "separate":
            for argument in written.args:
                if isinstance(argument.type, ir.PointerType):
                    argument.add_attribute("noalias")
        builder = ir.IRBuilder(written.append_basic_block())
        found = self._body(builder, function, written.args)
        if function.single:
            builder.ret(found[0])
        elif found:
            builder.ret(_together(builder, kind, found))
        else:
            builder.ret_void()
        return written

    def results(self, function: LlvmFunction, kinds: Sequence[Any]) -> list[Any]:
        """Return the types of a function's results, for parameters of these types, from a trial that nothing uses."""
        name = f"trial of {function.name}.{' '.join(map(str, kinds))}"
        if name not in self._results:
            written = ir.Function(self._trial, ir.FunctionType(ir.VoidType(), kinds), name)
            found = self._body(ir.IRBuilder(written.append_basic_block()), function, written.args)
            self._results[name] = [one.type for one in found]
        return self._results[name]

    def _body(self, builder: Any, function: LlvmFunction, given: Sequence[Any]) -> list[Any]:
        """Write the statements of a function and return its results."""
        values = dict(zip(function.parameters, given, strict=True))
        outside, self._lane = self._lane, None
        self._lines(builder, function.body, values)
        results = [self._value(builder, one, values) for one in function.results]
        self._lane = outside
        return results

    def _lines(self, builder: Any, body: Sequence[ast.stmt], values: dict[str, Any]) -> None:
        """Write statements; put the names that they set into ``values``."""
        for line in lanes.rows(body, self._lane.name) if self._lane else body:
            match line:
                case lanes.Row():
                    self._set_row(builder, line, values)
                case ast.Expr(value=ast.Call() as call):
                    self._called(builder, call, values)
                case ast.For(target=ast.Name(id=name), iter=ast.Call() as call):
                    count = values[_size(call)]
                    if self.width > 1 and lanes.fits(line):
                        self._in_vectors(builder, line, count, values)
                        continue
                    with cgutils.for_range(builder, count) as loop:
                        self._lines(builder, line.body, {**values, name: loop.index})
                case ast.Assign(targets=[ast.Tuple(elts=targets)], value=value):
                    for target, one in zip(targets, self._several(builder, value, values), strict=True):
                        self._set(builder, target, one, values)
                case ast.Assign(targets=[target], value=value):
                    self._set(builder, target, self._value(builder, value, values), values)

    def _in_vectors(self, builder: Any, loop: ast.For, count: Any, values: dict[str, Any]) -> None:
        """Write a loop that computes with vectors; the last takes only the elements of some arrays that are there."""
        assert isinstance(loop.target, ast.Name)
        name, step = loop.target.id, WHOLE(self.width)
        whole = lanes.arrays(loop) <= lanes.ROOMY
        end = count if whole else builder.and_(count, WHOLE(-self.width))
        with cgutils.for_range_slice(builder, WHOLE(0), end, step) as (index, _):
            self._lane = lanes.Lane(name, None)
            self._lines(builder, loop.body, {**values, name: index})
        if not whole:
            with builder.if_then(builder.icmp_signed("<", end, count)):
                self._lane = lanes.Lane(name, lanes.counting(builder, builder.sub(count, end), self.width))
                self._lines(builder, loop.body, {**values, name: end})
        self._lane = None

    def _set_row(self, builder: Any, row: lanes.Row, values: dict[str, Any]) -> None:
        """Write the assignments to the columns of rows of an array, which lie one after the other in memory."""
        assert self._lane is not None
        start = builder.extract_value(values[row.array], 0)
        kind = start.type.pointee
        columns = [lanes.repeated(builder, _stored(builder, self._value(builder, node, values), kind, node), self.width)
                   for node in row.values]
        start = builder.gep(start, [builder.mul(values[self._lane.name], WHOLE(len(columns)))])
        mask = self._lane.mask
        lanes.store(builder, lanes.interleaved(builder, columns), start,
                    None if mask is None else lanes.each_repeated(builder, mask, len(columns)))

    def _mask(self, node: ast.Subscript) -> Any:
        """Return the elements that count of a vector in an array, or None if all do."""
        assert self._lane is not None
        assert isinstance(node.value, ast.Name)
        return None if node.value.id in lanes.ROOMY else self._lane.mask

    def _set(self, builder: Any, target: ast.expr, value: Any, values: dict[str, Any]) -> None:
        """Write the assignment of a value to a name or to an element of an array."""
        match target:
            case ast.Name(id=name):
                values[name] = value
            case ast.Subscript():
                address = self._address(builder, target, values)
                kind = address.type.pointee
                value = _stored(builder, value, kind, target)
                if self._lane is not None and lanes.along(target, self._lane.name):
                    lanes.store(builder, lanes.repeated(builder, value, self.width), address, self._mask(target))
                else:
                    builder.store(value, address)

    def _several(self, builder: Any, node: ast.expr, values: Mapping[str, Any]) -> list[Any]:
        """Write a tuple, or a call with several results, and return its values."""
        if isinstance(node, ast.Tuple):
            return [self._value(builder, one, values) for one in node.elts]
        made = self._called(builder, node, values)
        return [builder.extract_value(made, place) for place in range(len(made.type.elements))]

    def _called(self, builder: Any, call: Any, values: Mapping[str, Any]) -> Any:
        """Write the call of a function and return what it returns."""
        function = self.functions[call.func.id]
        given = [self._place(builder, one, values) if _given(one, values.keys()) else self._value(builder, one, values)
                 for one in call.args]
        return builder.call(self.function(builder.module, function, [one.type for one in given]), given)

    def _value(self, builder: Any, node: ast.expr, values: Mapping[str, Any]) -> Any:
        """Write an expression and return its value."""
        match node:
            case ast.Name(id=name):
                return values[name] if name in values else NUMBER(self.constants[name])
            case ast.Constant(value=bool(truth)):
                return TRUTH(truth)
            case ast.Constant(value=number):
                return NUMBER(number)
            case ast.UnaryOp(operand=operand):
                return builder.fneg(_number(builder, self._value(builder, operand, values), operand))
            case ast.BinOp(left=left, op=op, right=right):
                kind = TRUTH if isinstance(op, (ast.BitAnd, ast.BitOr)) else NUMBER
                return getattr(builder, OPERATIONS[type(op)])(*self._both(builder, left, right, kind, values))
            case ast.Compare(left=left, ops=[op], comparators=[right]):
                one, other = self._both(builder, left, right, None, values)
                compare = builder.fcmp_unordered if isinstance(op, ast.NotEq) else builder.fcmp_ordered
                if element(one.type) == TRUTH:
                    compare = builder.icmp_unsigned
                return compare(SIGNS[type(op)], one, other)
            case ast.IfExp(test=test, body=body, orelse=other):
                true, false = (self._value(builder, one, values) for one in (body, other))
                if element(true.type) != element(false.type):
                    true, false = _number(builder, true, body), _number(builder, false, other)
                return builder.select(*spread(builder, [self._value(builder, test, values), true, false]))
            case ast.Call(func=ast.Name(id=name), args=[argument]) if name in ELEMENTARY:
                value = _number(builder, self._value(builder, argument, values), argument)
                kind = f"v{value.type.count}f64" if value.type != NUMBER else "f64"
                function = builder.module.declare_intrinsic(
                    f"{ELEMENTARY[name]}.{kind}", (), ir.FunctionType(value.type, [value.type]))
                return builder.call(function, [value])
            case ast.Call(func=ast.Name(id=name), args=[first, *rest]) if name in CHOSEN:
                one = _number(builder, self._value(builder, first, values), first)
                for node in rest:
                    other = _number(builder, self._value(builder, node, values), node)
                    one, other = spread(builder, [one, other])
                    one = builder.select(builder.fcmp_ordered(CHOSEN[name], other, one), other, one)
                return one
            case ast.Subscript():
                address = self._address(builder, node, values)
                if self._lane is not None and lanes.along(node, self._lane.name):
                    found = lanes.load(builder, address, self.width, self._mask(node))
                else:
                    found = builder.load(address)
                if element(found.type) == SINGLE:
                    return builder.fpext(found, lanes.like(found.type, NUMBER))
                return builder.trunc(found, lanes.like(found.type, TRUTH)) if element(found.type) == BYTE else found
        return self._called(builder, node, values)

    def _both(self, builder: Any, left: ast.expr, right: ast.expr, kind: Any, values: Mapping[str, Any]) -> list[Any]:
        """Write two operands of this type and return their values; a whole number beside a number becomes one.

        If no type is given, two truth values are operands, too.
        """
        found = [self._value(builder, one, values) for one in (left, right)]
        if kind is None:
            kind = TRUTH if all(element(one.type) == TRUTH for one in found) else NUMBER
        if kind == NUMBER and any(element(one.type) == NUMBER for one in found):
            found = [_number(builder, one, node) for one, node in zip(found, (left, right), strict=True)]
        if any(element(one.type) != kind for one in found):
            raise TypingError(f"{ast.unparse(left)} and {ast.unparse(right)} must be of type {kind}, not "
                              f"{found[0].type} and {found[1].type}.")
        return spread(builder, found)

    def _address(self, builder: Any, node: ast.Subscript, values: Mapping[str, Any]) -> Any:
        """Write the address of an element of an array and return it."""
        assert isinstance(node.value, ast.Name)
        array = values[node.value.id]
        if not isinstance(node.slice, ast.Tuple):
            return builder.gep(array, [self._place(builder, node.slice, values)])
        row, column = (self._place(builder, one, values) for one in node.slice.elts)
        start, width = (builder.extract_value(array, place) for place in (0, 1))
        return builder.gep(start, [builder.add(builder.mul(row, width), column)])

    def _place(self, builder: Any, node: ast.expr, values: Mapping[str, Any]) -> Any:
        """Write a place in an array and return it."""
        match node:
            case ast.Name(id=name):
                return values[name]
            case ast.Call(args=[one]):
                return self._place(builder, one, values)
            case ast.BinOp(left=left, right=right):
                return builder.add(self._place(builder, left, values), self._place(builder, right, values))
        assert isinstance(node, ast.Constant)
        return WHOLE(node.value)


def _number(builder: Any, value: Any, node: ast.expr) -> Any:
    """Return a value as a number; whole numbers and truth values become one. Messages show the source ``node``."""
    if value.type == WHOLE:
        return builder.sitofp(value, NUMBER)
    if element(value.type) == TRUTH:
        return builder.uitofp(value, lanes.like(value.type, NUMBER))
    if element(value.type) != NUMBER:
        raise TypingError(f"{ast.unparse(node)} must be a number, not {value.type}.")
    return value


def _stored(builder: Any, value: Any, kind: Any, node: ast.expr) -> Any:
    """Return a value as one of this type in memory. Messages show the source ``node``."""
    if kind == BYTE:
        return builder.zext(value, lanes.like(value.type, kind))
    value = _number(builder, value, node)
    return builder.fptrunc(value, lanes.like(value.type, kind)) if kind == SINGLE else value


def _together(builder: Any, kind: Any, values: Sequence[Any]) -> Any:
    """Write a structure of values and return it."""
    made = ir.Constant(kind, ir.Undefined)
    for place, value in enumerate(values):
        made = builder.insert_value(made, value, place)
    return made


_NUMBERS = count()
WRITTEN: dict[int, tuple[LlvmWriter, LlvmFunction]] = {}
"""Functions of the programs that are being compiled, by their numbers, none of which is used twice."""


@intrinsic(prefer_literal=True)
def instructions(typing: Any, number: Any, given: Any) -> Any:
    """Return the results of a program's function to code that numba compiles.

    ``number`` is that of the function, and ``given`` a tuple of its arguments: float64, truth values, int64 or uint64,
    and arrays of float64, float32 or truth values of one or two dimensions, whose elements lie in the order of C.
    Elements of type float32 are read as float64, and results of whole numbers are int64.

    Raises TypingError for other types.
    """
    if not isinstance(number, types.IntegerLiteral):
        raise TypingError("The number of a function must be known.")
    writer, function = WRITTEN[number.literal_value]
    kinds = [_kind(one, f"{function.name}, {name}") for name, one in zip(function.parameters, given, strict=True)]
    found = []
    for kind in writer.results(function, kinds):
        if kind not in RESULTS:
            raise TypingError(f"{function.name} cannot return {kind}.")
        found.append(RESULTS[kind])
    if function.single:
        return found[0](number, given), _write
    result: Any = types.Tuple(found) if found else types.none  # type: ignore[attr-defined]
    return result(number, given), _write


def _write(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    """Write the call of a function whose number and types of arguments are in the signature; return its results."""
    number, given = signature.args
    writer, function = WRITTEN[number.literal_value]
    arguments = []
    for place, kind in enumerate(given):
        value = builder.extract_value(values[1], place)
        if isinstance(kind, types.Array):
            array = context.make_array(kind)(context, builder, value)
            value = array.data
            if kind.ndim == 2:
                value = _together(builder, _kind(kind, ""), [value, builder.extract_value(array.shape, 1)])
        arguments.append(value)
    made = builder.call(writer.function(builder.module, function, [one.type for one in arguments]), arguments)
    if not function.results:
        return context.get_dummy_value()
    if function.single:
        return made
    return context.make_tuple(builder, signature.return_type,
                              [builder.extract_value(made, place) for place in range(len(function.results))])


def _can_be_read(array: Any) -> bool:
    """Return True for the type of an array whose elements can be read and written here."""
    return array.layout == "C" and array.dtype in ELEMENTS


def _kind(kind: Any, what: str) -> Any:
    """Return the type in LLVM for a type of numba; ``what`` names the argument in the message of an error."""
    kind = types.unliteral(kind)  # type: ignore[attr-defined]
    if kind in KINDS:
        return KINDS[kind]
    if isinstance(kind, types.Array) and kind.ndim <= 2 and _can_be_read(kind):
        start = ir.PointerType(ELEMENTS[kind.dtype])
        return start if kind.ndim == 1 else ir.LiteralStructType([start, WHOLE])
    raise TypingError(f"{what}: instructions cannot be written for {kind}.")
