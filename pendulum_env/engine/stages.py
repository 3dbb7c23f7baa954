"""Schedule of a method's step: its stages, between which a block computes its sines.

A step is a chain of operations, each of which waits for the one before. A processor therefore works on several
pendulums of a block at once, as far as it looks ahead: a few hundred instructions. A whole step is longer than that. So
a block takes each stage of a step in a loop of its own, and computes sines, cosines and powers in loops between the
stages. The operations, and so the bits, are the same.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import NamedTuple

from pendulum_env.common.sources import functions_of, names_in, parameters_of, parsed, statements_of

TURNED = frozenset({"sin", "cos"})
BETWEEN = TURNED | {"power"}
"""Functions that are computed between stages, for all pendulums of a block at once."""
FORCES = frozenset({"acceleration", "rates", "force", "jacobian"})
"""Functions of a program that compute a force or its slope; stages end with them where there is nothing in between."""
FEWEST = 2
"""Smallest number of forces for which stages end with them."""


NUMERIC = (ast.Assign, ast.Return, ast.Name, ast.Tuple, ast.Constant, ast.BinOp, ast.UnaryOp, ast.IfExp, ast.Compare,
           ast.Call, ast.Add, ast.Sub, ast.Mult, ast.Div, ast.USub, ast.cmpop, ast.expr_context)
"""Parts of a function that is written out: arithmetic, choices and calls without keywords."""


class StageValue(NamedTuple):
    """Value that is computed after a stage: ``name = function(argument, *constants)``."""

    name: str
    function: str
    argument: str
    constants: tuple[str, ...]


@dataclass(frozen=True)
class StepStage:
    """Part of a step, or of a function that it calls.

    Attributes:
        lines: its source lines.
        taken: names of the numbers that it takes from earlier stages.
        handed: names of the numbers that it hands to later stages, or to the values after it.
        values: what is computed after it.
    """

    lines: tuple[str, ...]
    taken: tuple[str, ...]
    handed: tuple[str, ...]
    values: tuple[StageValue, ...]


@dataclass(frozen=True)
class Schedule:
    """Stages of a step, and the source of functions that they call; no stages for a step that is taken as a whole.

    ``copies`` holds the results of the step that are copies of what it takes: (name of the result, name of the number).
    """

    stages: tuple[StepStage, ...] = ()
    functions: tuple[str, ...] = ()
    copies: tuple[tuple[str, str], ...] = ()


WHOLE = Schedule()
"""Schedule of a step that is taken as a whole."""


def scheduled(
    program: str, results: Iterable[str], same: Iterable[str], between: frozenset[str] = BETWEEN
) -> Schedule:
    """Return the schedule of the function ``step`` of a program; WHOLE if it is not straight-line, or has one stage.

    The functions that it calls are divided, too. The last stage assigns the step's results to the names ``results``.
    Other names that a stage assigns begin with "s", and are assigned once. ``same`` are the arguments that are the same
    for all pendulums: what follows from them alone is not handed on, so that a compiler can compute it before a loop.
    ``between`` are the functions that are computed between stages; without them a stage ends with a force.
    """
    functions = functions_of(program)
    same = frozenset(same)
    step = _StageWriter(functions, same, {"q"}, between)
    texts: list[str] = []
    for name in sorted({*names_in(functions["step"])} & {*functions}):
        if step.reaches(name):
            inside = _StageWriter(functions, same, parameters_of(functions[name]), between)
            inside.write(name, ("result",))
            levels = _levels(inside.lines, lambda line: line.value is not None)
            texts += step.call_in_stages(name, inside.scheduled(levels)) if max(levels, default=0) > 0 else []
    results = tuple(results)
    found, given = step.write("step", results), parameters_of(functions["step"])
    levels = _levels(step.lines, lambda line: line.value is not None)
    if max(levels, default=0) < 1:
        levels = _levels(step.lines, lambda line: not FORCES.isdisjoint(line.reads))
        if max(levels, default=0) < FEWEST:
            return WHOLE
    copies = ((name, value.id) for name, value in zip(results, found, strict=True)
              if isinstance(value, ast.Name) and value.id in given)
    return Schedule(step.scheduled(levels), tuple(texts), tuple(copies))


def rows_of(stages: Iterable[StepStage]) -> dict[str, int]:
    """Return the row of memory, from 0, of every number that a stage hands on, by register allocation.

    Two numbers share a row if neither is needed while the other is.
    """
    stages = tuple(stages)
    last = {name: number for number, stage in enumerate(stages) for name in stage.taken}
    for number, stage in enumerate(stages):
        last.update((value.argument, max(number + 1, last.get(value.argument, 0))) for value in stage.values)
    rows: dict[str, int] = {}
    used: dict[str, int] = {}
    for number, stage in enumerate(stages):
        used = {name: row for name, row in used.items() if last[name] > number}
        for name in (*stage.handed, *(value.name for value in stage.values)):
            rows[name] = used[name] = next(row for row in range(len(used) + 1) if row not in used.values())
    return rows


class _Line(NamedTuple):
    """A line of source, with the names that it reads and those that it assigns, and its value if it is one of BETWEEN.
    """

    text: str
    reads: set[str]
    stores: set[str]
    value: StageValue | None


class _StageWriter:
    """Writes the lines of a function: names are assigned once, values are computed once, sines have their own lines.

    Args:
        functions: the functions of the program.
        same: names of the arguments that are the same for all pendulums.
        stored: names of the arguments that lie in memory, so that a sine of one needs no copy of it.
        between: names of the functions that are computed between stages.

    Attributes:
        lines: the lines; none if the function is not straight-line.
        common: lines that follow from the arguments ``same`` alone.
    """

    def __init__(self, functions: Mapping[str, ast.FunctionDef], same: Iterable[str], stored: Iterable[str],
                 between: frozenset[str]) -> None:
        self.lines: list[_Line] = []
        self.common: list[_Line] = []
        self._functions, self._same, self._stored = functions, {*same, *functions}, {*stored}
        self._bodies = {name: _straight(node) for name, node in functions.items()}
        self._between, self._reach = between, dict.fromkeys(between, False)
        self._stages: dict[str, tuple[StepStage, ...]] = {}
        self._versions: dict[str, int] = {}
        self._names: dict[str, tuple[str, ...]] = {}  # source of a value -> names that hold it

    def write(self, function: str, results: tuple[str, ...]) -> list[ast.expr]:
        """Write the lines of a function, the last of which assigns its results to names; return these results."""
        if not self._bodies[function]:
            return []
        found = self._run(function, {})
        self._add(results, found)
        return found.elts if isinstance(found, ast.Tuple) else [found]

    def reaches(self, name: str) -> bool:
        """Return True for a straight-line function that calls one of ``between``, or another such function."""
        if name not in self._reach:
            called = {other for _, value in self._bodies.get(name, ()) for other in names_in(value)}
            self._reach[name] = bool(self._between & called) or any(map(self.reaches, called & {*self._bodies}))
        return self._reach[name]

    def scheduled(self, levels: list[int]) -> tuple[StepStage, ...]:
        """Return the stages of the lines, from the number of each line's stage."""
        stages: list[StepStage] = []
        known: set[str] = set()
        numbered = [*zip(self.lines, levels, strict=True)]
        for number in range(max(levels) + 1):
            part = [line for line, level in numbered if level == number and not line.value]
            values = tuple(line.value for line, level in numbered if level == number and line.value)
            wanted = {name for line, level in numbered if level > number for name in line.reads}
            wanted.update(value.argument for value in values)
            reads = {name for line in part for name in line.reads}
            before: list[str] = []
            for line in reversed(self.common):
                if not reads.isdisjoint(line.stores):
                    before.insert(0, line.text)
                    reads |= line.reads
            handed = wanted & {name for line in part for name in line.stores}
            stages.append(StepStage((*before, *(line.text for line in part)), tuple(sorted(reads & known)),
                                tuple(sorted(handed)), values))
            known |= handed | {value.name for value in values}
        return tuple(stages)

    def call_in_stages(self, name: str, stages: tuple[StepStage, ...]) -> list[str]:
        """Let calls of a function be written as its stages; return the source of the function for the last stage."""
        self._stages[name] = stages
        texts = [_function(name, number, stage, self._functions[name]) for number, stage in enumerate(stages)]
        made = functions_of("\n".join(texts[:-1]))
        self._bodies.update((one, _straight(node)) for one, node in made.items())
        return texts[-1:]

    def _run(self, function: str, scope: dict[str, ast.expr]) -> ast.expr:
        """Write the lines of a function, for arguments that are in the scope, and return its result."""
        for targets, value in self._bodies[function]:
            found: ast.expr = _Scoped(scope, self._called).visit(deepcopy(value))
            if not targets:
                return found
            scope.update(zip(targets, self._assigned(targets, found), strict=True))
        raise AssertionError(function)

    def _add(self, names: tuple[str, ...], expression: ast.expr, value: StageValue | None = None) -> None:
        """Append the line that assigns an expression to names."""
        line = _Line(f"{', '.join(names)} = {ast.unparse(expression)}", {*names_in(expression)}, set(names), value)
        if line.reads <= self._same:
            self.common.append(line)
            self._same |= line.stores
        else:
            self.lines.append(line)
            self._stored |= line.stores

    def _assigned(self, targets: tuple[str, ...], expression: ast.expr) -> list[ast.expr]:
        """Return what holds an expression's values, after a line that assigns them to new names if nothing holds them.
        """
        if isinstance(expression, (ast.Name, ast.Constant)):
            return [expression]
        text = ast.unparse(expression)
        if text not in self._names:
            self._names[text] = tuple(map(self._new, targets))
            self._add(self._names[text], expression)
        return [ast.Name(name) for name in self._names[text]]

    def _new(self, name: str) -> str:
        """Return a new name for a number of the step."""
        count = self._versions[name] = self._versions.get(name, 0) + 1
        return f"s_{name}" if count == 1 else f"s{count}_{name}"

    def _called(self, call: ast.Call) -> ast.expr:
        """Return a call as it is, or its value after the lines that compute it."""
        function = call.func.id if isinstance(call.func, ast.Name) else ""
        if function in self._between and all(isinstance(constant, ast.Constant) for constant in call.args[1:]):
            return self._computed(function, call.args[0], call.args[1:])
        if not self.reaches(function):
            return call
        parameters = parameters_of(self._functions[function])
        given = [self._assigned((name,), value)[0] for name, value in zip(parameters, call.args, strict=True)]
        scope = dict(zip(parameters, given, strict=True))
        if function not in self._stages:
            return self._run(function, scope)
        *stages, last = self._stages[function]
        for number, stage in enumerate(stages):
            if stage.handed:
                found = self._run(f"{function}_{number}", {**scope})
                scope.update(zip(stage.handed, found.elts if isinstance(found, ast.Tuple) else [found], strict=True))
            for name, other, argument, constants in stage.values:
                fixed = [ast.Constant(float(constant)) for constant in constants]
                scope[name] = self._computed(other, scope[argument], fixed)
        inputs = [scope[name] for name in _inputs(last, self._functions[function])]
        return ast.Call(ast.Name(f"{function}_{len(stages)}"), inputs, [])

    def _computed(self, function: str, value: ast.expr, constants: Sequence[ast.expr]) -> ast.expr:
        """Return the name of a value that is computed between stages, or a call if it is the same for all."""
        (argument,) = self._assigned(("x",), value)
        call = ast.Call(ast.Name(function), [argument, *constants], [])
        if self._same.issuperset(names_in(argument)):
            return call
        text = ast.unparse(call)
        if text not in self._names:
            assert isinstance(argument, ast.Name)
            if argument.id not in self._stored:
                copy = self._new("x")
                self._add((copy,), argument)
                argument = ast.Name(copy)
            self._names[text] = (self._new(function),)
            self._add(self._names[text], ast.Call(ast.Name(function), [argument, *constants], []),
                      StageValue(self._names[text][0], function, argument.id, tuple(map(ast.unparse, constants))))
        return ast.Name(self._names[text][0])


class _Scoped(ast.NodeTransformer):
    """Replaces names by what they stand for in a scope, and calls by what ``call`` returns for them."""

    def __init__(self, scope: Mapping[str, ast.expr], call: Callable[[ast.Call], ast.expr]) -> None:
        self.scope, self.call = scope, call

    def visit_Name(self, node: ast.Name) -> ast.expr:
        return self.scope.get(node.id, node)

    def visit_Call(self, node: ast.Call) -> ast.expr:
        node.args = [self.visit(argument) for argument in node.args]
        return self.call(node)

    def visit_IfExp(self, node: ast.IfExp) -> ast.AST:
        """Leave the calls in a choice, which may not be valid where the other choice is taken."""
        return _Scoped(self.scope, lambda call: call).generic_visit(node)


def _levels(lines: list[_Line], ends: Callable[[_Line], bool]) -> list[int]:
    """Return the number of the stage of every line: the last possible one, -1 for lines that nothing needs.

    Where a stage ends with a line, lines which need its result are in later stages.
    """
    earliest: dict[str, int] = {}
    last = 0
    for line in lines:
        last = max((earliest.get(name, 0) for name in line.reads), default=0)
        earliest.update(dict.fromkeys(line.stores, last + ends(line)))
    latest = dict.fromkeys(lines[-1].stores, last) if lines else {}
    levels: list[int] = []
    for line in reversed(lines):
        level = min((latest[name] for name in line.stores if name in latest), default=-1)
        level -= bool(levels) and level > 0 and ends(line)
        levels.append(level)
        latest.update((name, min(level, latest.get(name, level))) for name in line.reads if level >= 0)
    return levels[::-1]


def _function(name: str, number: int, stage: StepStage, whole: ast.FunctionDef) -> str:
    """Write the source of the function that computes stage ``number`` of the function ``whole``."""
    head = f"def {name}_{number}({', '.join(_inputs(stage, whole))}):"
    lines, result = [*stage.lines], ", ".join(stage.handed)
    if lines and not result:
        result = lines.pop().removeprefix("result = ")
    return "\n    ".join([f"@inline\n{head}", *lines, f"return {result}"]) + "\n"


def _inputs(stage: StepStage, whole: ast.FunctionDef) -> list[str]:
    """Return the names of the arguments of the function that computes a stage of the function ``whole``."""
    read = names_in(parsed("\n".join(stage.lines)))
    return [*(name for name in parameters_of(whole) if name in read), *stage.taken]


def _straight(function: ast.FunctionDef) -> list[tuple[tuple[str, ...], ast.expr]]:
    """Return the assignments of a function, and its result without names; nothing if it has other parts than NUMERIC.

    Truth values have no names there either, because stages hand on numbers only.
    """
    lines: list[tuple[tuple[str, ...], ast.expr]] = []
    for node in statements_of(function):
        if not all(isinstance(part, NUMERIC) for part in ast.walk(node)):
            return []
        if isinstance(node, ast.Return) and node.value:
            lines.append(((), node.value))
        elif isinstance(node, ast.Assign) and len(node.targets) == 1 and not isinstance(node.value, ast.Compare):
            target = node.targets[0]
            names = target.elts if isinstance(target, ast.Tuple) else [target]
            lines.append((tuple(name.id for name in names if isinstance(name, ast.Name)), node.value))
            if len(lines[-1][0]) < len(names):
                return []
        else:
            return []
    return lines
