"""Specialisation of plain Python functions, called templates, to the functions of a program (partial evaluation).

A template runs as it stands, on floats and tuples of floats. It is written once for all scenes: what a scene lacks is
an empty tuple, and its arguments after ``*`` are known before a program runs: switches, numbers of values, and
functions of the program. Specialised,

- what depends only on known values is done at once: an ``if`` leaves one branch, a loop over a tuple its turns;
- a tuple becomes its variables: ``lost1`` is ``lost_q1, lost_v1``, or nothing. A table names the variables of each;
- a function marked as :func:`spliced` stands in place of its call, with its own names for its variables;
- everything else stays: arithmetic with its order, choices, loops over ``range`` and ``while``, and calls.

A whole number with a name of its module, such as a stop code, becomes a double, as in users' functions.
"""

from __future__ import annotations

import ast
import builtins
import linecache
import operator
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from types import FunctionType
from typing import Any, TypeVar

from pendulum_env.common.sources import functions_of, names_in, names_set, statements_of
from pendulum_env.engine.reading import float_text

Template = Callable[..., Any]
F = TypeVar("F", bound=Template)
NOW = frozenset({len, zip, enumerate, reversed, tuple})
"""Functions of Python that are called at once where their arguments are tuples."""
FOLDED: Mapping[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Eq: operator.eq, ast.NotEq: operator.ne,
    ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge,
}
"""Operators on known values -> the function that computes them."""


class SpecialiseError(TypeError):
    """Error for a template that cannot be specialised; the message names its file and line."""


class Written(str):
    """The source of a function of a program, with its name and the names that it sets.

    ``sets`` holds those of its arguments and variables, once for each place, so that nobody need read the source for
    them again.
    """

    function: str
    sets: tuple[str, ...]


def spliced(function: F) -> F:
    """Mark a function as one whose statements stand in place of its call; it returns at its end."""
    vars(function)["spliced"] = True
    return function


class Names:
    """The table of a program's variables: name of a template's tuple -> the program's names for its entries.

    The name of an entry may be a tuple, too. A variable that is not in the table has its own name.

    Attributes:
        values: the names as known values of a template.
        texts: all names of each tuple.
        owners: a name -> the tuples that it is part of.
    """

    def __init__(self, table: Mapping[str, tuple[Any, ...]]) -> None:
        self.values = {one: _named(names) for one, names in table.items()}
        self.texts = {one: frozenset(flat(names)) for one, names in table.items()}
        self.owners: dict[str, list[str]] = {}
        for one, names in self.texts.items():
            for text in names:
                self.owners.setdefault(text, []).append(one)

    def value(self, one: str) -> Any:
        """Return a template's variable as the program's: a name, or a tuple of names."""
        return self.values[one] if one in self.values else name(one)

    def of(self, variables: Iterable[str]) -> set[str]:
        """Return the program's names of variables of a template."""
        return {text for one in variables for text in self.texts.get(one, (one,))}


@cache
def name(text: str) -> ast.Name:
    """Return a program's variable or function, as a known value of a template."""
    return ast.Name(text, ast.Load())


def specialised(
    template: Template, names: Names, known: Mapping[str, Any], decorator: str, title: str, bare: bool = False
) -> Written:
    """Write the source of the function of a program that a template becomes.

    Args:
        template: a function of the package.
        names: the program's names for tuples.
        known: values of the template's arguments after ``*``, and further ones.
        decorator: the line before the function.
        title: the function's name in the program.
        bare: True to leave out the first line of the template's docstring.

    Raises SpecialiseError for what has no meaning in a program.
    """
    node, body = _tree(template), _Body(template, names, _bound(template, known))
    given = [one.id for parameter in node.args.args for one in flat(names.value(parameter.arg))]
    said = "" if bare else (ast.get_docstring(node) or "").partition("\n")[0]
    lines = [*([f'"""{said}"""'] if said else []), *body.block(statements_of(node))]
    made = Written("\n".join([decorator, f"def {title}({', '.join(given)}):", *_indented(lines), ""]))
    made.function, made.sets = title, (*given, *body.sets)
    return made


def variables_of(template: Template) -> set[str]:
    """Return the arguments and variables of a template."""
    node = _tree(template)
    return {*(one.arg for one in node.args.args), *names_set(node)}


def lines_of(template: Template, names: Names, known: Mapping[str, Any]) -> list[str]:
    """Return the source lines of a spliced function, which set the variables that it returns."""
    body = _Body(template, names, _bound(template, known), spliced=True)
    body.targets = {*names.owners}
    return body.block(statements_of(_tree(template)))


def flat(value: Any) -> list[Any]:
    """Return the entries of nested tuples; of another value, itself."""
    if not isinstance(value, tuple):
        return [value]
    parts = list[Any]()
    for part in value:
        if isinstance(part, tuple):
            parts += flat(part)
        else:
            parts.append(part)
    return parts


@cache
def _tree(template: Template) -> ast.FunctionDef:
    """Return the syntax tree of a template, of which the lines of the function alone are read, not its file."""
    code = template.__code__
    lines = linecache.getlines(code.co_filename)[code.co_firstlineno - 1:]
    body = next(i for i, line in enumerate(lines) if line.startswith("def ")) + 1
    end = next((i for i, line in enumerate(lines[body:], body) if line[0] not in " )\n"), len(lines))
    return functions_of("".join(lines[:end]))[template.__name__]


def _bound(template: Template, known: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments of a template after ``*``; functions have their own names if no others are known."""
    bound = {}
    for one in _tree(template).args.kwonlyargs:
        own = isinstance(one.annotation, ast.Name) and one.annotation.id == "Function"
        bound[one.arg] = known.get(one.arg, name(one.arg)) if own else known[one.arg]
    return bound


def _indented(lines: list[str]) -> list[str]:
    return [f"    {line}" for line in lines or ["pass"]]


def _expression(value: Any) -> ast.expr:
    """Return a value as the syntax tree of an expression."""
    if isinstance(value, Stale):
        raise _LostError(value.name)
    if isinstance(value, tuple):
        return ast.Tuple([_expression(one) for one in flat(value)], ast.Load())
    return value if isinstance(value, ast.expr) else ast.Constant(value)


class _LostError(Exception):
    """Raised where a part of a stale value is read, with the name of the variable."""


@dataclass(frozen=True, eq=False)
class Stale:
    """A value that was set from variables of the program which have changed since: the program has lost it."""

    name: str


class _Body:
    """The statements of one template, and what is known in them.

    Attributes:
        known: name of a variable -> its value, if that is known or has another name in the program.
        sets: names of the program's variables that were set, once for each place.
        depth: number of choices and loops of the program around a statement.
        ended: True after a return, break or continue.
        result: what a spliced function returns.
        targets: names of the program that a statement sets from a call; ``aims`` are the template's variables for them.
        reads: variable -> a value, and the names in it.
    """

    def __init__(self, template: Template, names: Names, known: Mapping[str, Any], spliced: bool = False) -> None:
        assert isinstance(template, FunctionType)
        self.template, self.names, self.known, self.spliced = template, names, dict(known), spliced
        self.local = frozenset((*template.__code__.co_varnames, *template.__code__.co_cellvars))
        self.depth, self.ended = 0, False
        self.result: Any = None
        self.lines, self.sets, self.targets = list[str](), list[str](), set[str]()
        self.aims: Collection[str] = ()
        self.reads = dict[str, tuple[Any, set[str]]]()

    @cached_property
    def everything(self) -> set[str]:
        """Return the names of all of the program's variables that the template has."""
        return self.names.of(self.local)

    def error(self, node: ast.AST, why: str) -> SpecialiseError:
        """Return an error that names the line of the template."""
        code = self.template.__code__
        line = code.co_firstlineno - 1 + getattr(node, "lineno", 1)
        return SpecialiseError(f"{code.co_filename}, line {line}: {self.template.__name__} {why}.")

    # --- statements -------------------------------------------------------------------------------------------------

    def block(self, body: list[ast.stmt]) -> list[str]:
        """Return the source lines of statements, up to the first that ends them."""
        outer, self.lines = self.lines, []
        for node in body:
            last = isinstance(node, ast.Return) and isinstance(node.value, ast.Call)
            self.targets, self.aims = (self.everything, self.local) if last else (set(), ())
            try:
                self.statement(node)
            except _LostError as lost:
                raise self.error(node, f"reads a part of {lost}, which was set from variables that have changed since"
                                 ) from None
            if self.ended:
                break
        lines, self.lines = self.lines, outer
        return lines

    def inside(self, body: list[ast.stmt]) -> list[str]:
        """Return the source lines of statements within a choice or a loop of the program."""
        self.depth += 1
        lines = self.block(body)
        self.depth -= 1
        return _indented(lines)

    def statement(self, node: ast.stmt) -> None:
        """Append the source lines that a statement becomes."""
        match node:
            case ast.Assign(targets=[target], value=value) | ast.AnnAssign(target=target, value=value) if value:
                if isinstance(value, ast.Call):
                    self.aims = _targets(target)
                    self.targets = {one.id for one in flat(self.place(target)) if isinstance(one, ast.Name)}
                self.assign(target, self.value(value))
            case ast.If():
                test = _chosen(self.value(node.test))
                if not isinstance(test, ast.expr):
                    self.lines += self.block(node.body if test else node.orelse)
                    return
                self.choice(test, node)
            case ast.For(iter=ast.Call(func=ast.Name("range")), target=ast.Name(counter)):
                self.sets.append(counter)
                self.loop(f"for {counter} in {written(self.expression(node.iter))}:", node)
            case ast.For():
                for turn in self.value(node.iter):
                    self.bind(node.target, turn)
                    self.lines += self.block(node.body)
            case ast.While():
                self.loop("while {}:", node)
            case ast.Return():
                self.returned(node)
            case ast.Break() | ast.Continue():
                self.lines.append(type(node).__name__.lower())
                self.ended = True
            case ast.Expr(value=ast.Call() as call):
                if self.value(call) is not None:
                    raise self.error(node, "computes what nothing reads")
            case _:
                raise self.error(node, f"has the statement {ast.unparse(node)}, which programs do not have")

    def choice(self, test: ast.expr, node: ast.If) -> None:
        """Append the source lines of a choice of the program; both ways begin with what is known before it."""
        before, self.lines = {**self.known}, [*self.lines, f"if {written(test)}:", *self.inside(node.body)]
        first, self.ended = None if self.ended else self.known, False
        self.known = before
        other = self.inside(node.orelse) if node.orelse else []
        if self.ended and first is not None:
            self.known, self.ended = first, False
        elif first is not None:
            for one in {*self.known, *first}:
                own = self.names.value(one)
                self.known[one] = _merged(one, self.known.get(one, own), first.get(one, own))
        if not node.orelse:
            return
        if isinstance(node.orelse[0], ast.If) and all(one.startswith(("     ", "    if", "    el")) for one in other):
            self.lines += [f"el{other[0][4:]}", *(one[4:] for one in other[1:])]
        else:
            self.lines += ["else:", *other]

    def loop(self, head: str, node: ast.For | ast.While) -> None:
        """Append the source lines of a loop of the program; what it changes is no longer known from before."""
        targets = _set_in(node)
        for one in targets & self.known.keys():
            if not _same(self.names.value(one), self.known[one]):
                self.known[one] = Stale(one)
        self.changed(self.names.of(targets), targets)
        if isinstance(node, ast.While):
            head = head.format(written(_expression(self.alone(node.test))))
        self.lines += [head, *self.inside(node.body)]
        self.ended = False
        self.known.update({one: Stale(one) for one in targets & self.known.keys()})
        if node.orelse:
            self.lines += ["else:", *self.inside(node.orelse)]
            self.ended = False

    def returned(self, node: ast.Return) -> None:
        value = () if node.value is None else self.value(node.value)
        self.ended = True
        if self.spliced:
            if self.depth:
                raise self.error(node, "is spliced, but returns before its end")
            self.result = value
            return
        parts = flat(value)
        alone = len(parts) == 1 and (isinstance(node.value, ast.Tuple) or not isinstance(value, tuple))
        self.lines.append(f"return {written(_expression(parts[0] if alone else tuple(parts)), bare=True)}")

    def assign(self, target: ast.expr, value: Any) -> None:
        """Append the source lines of an assignment, or note what is known."""
        places = self.place(target)
        if isinstance(value, ast.expr):
            for one in _targets(target):
                self.known.pop(one, None)
            several = isinstance(value, ast.Call) and isinstance(value.func, ast.Name) and value.func.id == "tuple"
            if several:
                value = value.args[0]  # type: ignore[attr-defined]
            alone = isinstance(places, tuple) and len(flat(places)) == 1 and not several
            self.store(target, [(flat(places)[0] if alone else places, value)])
        elif isinstance(target, ast.Tuple):
            if len(target.elts) != len(value):
                raise self.error(target, f"has {len(target.elts)} names for {len(value)} values")
            pairs = [*zip(target.elts, value, strict=True)]
            self.store(target, [both for one, part in pairs for both in self.settled(one, part)])
        else:
            self.store(target, self.settled(target, value))

    def settled(self, target: ast.expr, value: Any) -> list[tuple[Any, Any]]:
        """Return the pairs of places and values that a target takes in a program; note what is known."""
        places = self.place(target)
        if isinstance(target, ast.Tuple):
            return [both for one, part in zip(target.elts, value, strict=True) for both in self.settled(one, part)]
        if isinstance(target, ast.Name):
            self.known.pop(target.id, None)
            if target.id in self.names.values and not isinstance(value, ast.expr):
                return [*self.matched(target, places, value)]
            if isinstance(value, (bool, str, int, tuple)) or value is None:
                self.known[target.id] = value
                return []
        return [(places, _expression(value))]

    def matched(self, target: ast.Name, places: tuple[Any, ...], values: tuple[Any, ...]) -> Iterator[tuple[Any, Any]]:
        """Yield each of a tuple's places with its value."""
        if len(places) != len(values):
            raise self.error(target, f"sets {target.id}, {len(places)} variables, to {len(values)} values")
        for place, value in zip(places, values, strict=True):
            if isinstance(place, tuple) and isinstance(value, tuple):
                yield from self.matched(target, place, value)
            else:
                yield place, value

    def store(self, node: ast.expr, pairs: list[tuple[Any, Any]]) -> None:
        """Append one assignment for every pair of a place, which may be a tuple, and a value."""
        new = set[str]()
        pairs = [(place, value) for place, value in pairs if not _same(place, value)]
        for place, value in pairs:
            if new and new & _read(value):
                raise self.error(node, f"sets {min(new)} and reads it in the same statement")
            self.sets += (names := [one.id for one in flat(place) if isinstance(one, ast.Name)])
            new.update(names)
            self.lines.append(f"{written(_expression(place), bare=True)} = {written(_expression(value), bare=True)}")
        self.changed(new, _targets(node))

    def changed(self, new: set[str], targets: Collection[str]) -> None:
        """Note that variables of the program have changed, by an assignment to these variables of the template.

        What was set from them before, or has them as a part, is stale there.
        """
        if not new:
            return
        for one, value in self.known.items():
            if one not in targets and isinstance(value, (tuple, ast.expr)) and new & self.reading(one, value):
                self.known[one] = _aged(one, value, new)
        for text in new:
            for one in (text, *self.names.owners.get(text, ())):
                if one in self.local and one not in self.known and one not in targets:
                    self.known[one] = _aged(one, self.names.value(one), new)

    def reading(self, one: str, value: Any) -> set[str]:
        """Return the program's names in the value of a variable, which are found once."""
        if one not in self.reads or self.reads[one][0] is not value:
            self.reads[one] = (value, _read(value))
        return self.reads[one][1]

    def bind(self, target: ast.expr, value: Any) -> None:
        """Note the value of a template's variable, without a statement of the program."""
        if isinstance(target, ast.Tuple):
            for one, part in zip(target.elts, value, strict=True):
                self.bind(one, part)
        elif isinstance(target, ast.Name):
            self.known[target.id] = value

    def place(self, target: ast.expr) -> Any:
        """Return the variable, or entry of an array, in which a target lives; of several a tuple."""
        match target:
            case ast.Name(one):
                return self.names.value(one)
            case ast.Tuple(parts):
                return tuple(map(self.place, parts))
            case ast.Subscript():
                return ast.Subscript(self.expression(target.value), self.expression(target.slice), ast.Store())
        raise self.error(target, f"assigns to {ast.unparse(target)}")

    # --- values -----------------------------------------------------------------------------------------------------

    def expression(self, node: ast.expr) -> ast.expr:
        return _expression(self.value(node))

    def value(self, node: ast.expr) -> Any:
        """Return the value of an expression: known, a tuple of values, or a program's expression."""
        if isinstance(node, ast.Name):  # the most frequent first, which is faster than to match
            return self.look_up(node.id, node)
        if isinstance(node, ast.Constant):
            return node if isinstance(node.value, (float, bool)) else node.value
        if isinstance(node, ast.Attribute):
            return getattr(self.value(node.value), node.attr)
        match node:
            case ast.Call():
                return self.call(node)
            case ast.Tuple(parts):
                return tuple(one for part in parts for one in (
                    self.value(part.value) if isinstance(part, ast.Starred) else (self.value(part),)))
            case ast.BinOp(left, operation, right):
                return self.combined(node, operation, self.value(left), self.value(right))
            case ast.UnaryOp(operation, operand):
                value = self.value(operand)
                if isinstance(value, ast.expr):
                    return ast.UnaryOp(operation, value)
                return not value if isinstance(operation, ast.Not) else -value
            case ast.BoolOp():
                return self.joined(node)
            case ast.Compare(left, [operation], [right]):
                a, b = self.value(left), self.value(right)
                if isinstance(a, ast.expr) or isinstance(b, ast.expr):
                    return ast.Compare(_expression(a), [operation], [_expression(b)])
                return FOLDED[type(operation)](a, b)
            case ast.Compare():
                return ast.Compare(self.expression(node.left), node.ops, [*map(self.expression, node.comparators)])
            case ast.IfExp(test, body, other):
                found = self.value(test)
                if not isinstance(found, ast.expr):
                    return self.value(body if found else other)
                return ast.IfExp(found, _expression(self.alone(body)), _expression(self.alone(other)))
            case ast.Subscript():
                return self.entry(node)
            case ast.GeneratorExp(elt, loops):
                own = {one for loop in loops for one in _targets(loop.target)}
                outside = {one: self.known[one] for one in own & self.known.keys()}
                values = tuple(self.turns(elt, loops))
                for one in own:
                    self.known.pop(one, None)
                self.known |= outside  # a comprehension's variables are its own
                return values
        raise self.error(node, f"has the expression {ast.unparse(node)}, which programs do not have")

    def alone(self, node: ast.expr) -> Any:
        """Return the value of an expression that is not always computed, or again: no statement can stand before it."""
        count, value = len(self.lines), self.value(node)
        if len(self.lines) > count:
            raise self.error(node, "splices statements into a condition or a loop's test")
        return value

    def look_up(self, one: str, node: ast.AST) -> Any:
        """Return the value of a name: of the template, or from outside, where numbers are doubles."""
        if one in self.known:
            if isinstance(value := self.known[one], Stale):
                raise self.error(node, f"reads {one}, which was set from variables that have changed since")
            return value
        if one in self.local:
            return self.names.value(one)
        outside = {one: vars(builtins)[one]} if one in vars(builtins) else {}
        if one not in self.template.__globals__ and not outside:
            raise self.error(node, f"uses {one}, which is not defined")
        value = self.template.__globals__.get(one, outside.get(one))
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            return ast.Constant(float(value))
        return value

    def combined(self, node: ast.AST, operation: ast.operator, a: Any, b: Any) -> Any:
        """Return ``a + b`` and the like; ``a & True`` is a."""
        if isinstance(a, ast.expr) or isinstance(b, ast.expr):
            if isinstance(operation, ast.BitAnd) and isinstance(b, ast.Constant) and b.value is True:
                return a
            return ast.BinOp(_expression(a), operation, _expression(b))
        return FOLDED[type(operation)](a, b)

    def joined(self, node: ast.BoolOp) -> Any:
        """Return the value of ``and`` or ``or``, without the parts that are known."""
        ends, left = isinstance(node.op, ast.Or), list[ast.expr]()
        for one in node.values:
            value = _chosen(self.alone(one) if left else self.value(one))
            if isinstance(value, ast.expr):
                left.append(value)
            elif bool(value) is ends:
                return ends if not left else ast.BoolOp(node.op, [*left, ast.Constant(ends)])
        return ast.BoolOp(node.op, left) if len(left) > 1 else left[0] if left else not ends

    def entry(self, node: ast.Subscript) -> Any:
        """Return an entry of a tuple or an array; a slice of an array, which has known ends, as a tuple of entries."""
        whole, place = self.value(node.value), node.slice
        if isinstance(place, ast.Slice):
            ends = slice(*(None if end is None else self.value(end) for end in (place.lower, place.upper)))
            if not isinstance(whole, ast.expr):
                return whole[ends]
            return tuple(ast.Subscript(whole, ast.Constant(i), ast.Load()) for i in range(ends.start or 0, ends.stop))
        if isinstance(whole, ast.expr):
            return ast.Subscript(whole, self.expression(place), ast.Load())
        return whole[self.value(place)]

    def turns(self, element: ast.expr, loops: list[ast.comprehension]) -> Iterator[Any]:
        """Yield the values of a comprehension over tuples."""
        if not loops:
            yield self.value(element)
            return
        for one in self.value(loops[0].iter):
            self.bind(loops[0].target, one)
            if all(self.value(test) for test in loops[0].ifs):
                yield from self.turns(element, loops[1:])

    def call(self, node: ast.Call) -> Any:
        """Return the value of a call: at once, by splicing, or as a call of the program."""
        function = self.value(node.func)
        given = [one for part in node.args for one in (
            self.value(part.value) if isinstance(part, ast.Starred) else (self.value(part),))]
        named = {one.arg: self.value(one.value) for one in node.keywords if one.arg}
        if _of_record(function):
            return function(*given, **named)
        if function in NOW and not any(isinstance(one, ast.expr) for one in given):
            made = function(*given, **{one: value.value for one, value in named.items()})  # zip(..., strict=True)
            return made if function is len else tuple(made)
        if getattr(function, "spliced", False):
            return self.splice(node, function, given, named)
        if isinstance(function, (str, type(None))) or named:
            raise self.error(node, f"calls {ast.unparse(node.func)}, which is no function of a program")
        called = function if isinstance(function, ast.expr) else name(function.__name__)
        return ast.Call(called, [_expression(one) for one in flat(tuple(given))], [])

    def splice(self, node: ast.Call, function: FunctionType, given: list[Any], named: Mapping[str, Any]) -> Any:
        """Append the statements of a function in place of its call, and return what it returns."""
        taken = dict(zip(function.__code__.co_varnames, given, strict=False))
        body, targets = _Body(function, self.names, {**taken, **named}, spliced=True), self.targets
        self.lines += body.block(statements_of(_tree(function)))
        stored = {*body.sets}
        if lost := (stored & self.everything) - targets:
            raise self.error(node, f"calls {function.__name__}, which would change {min(lost)}")
        self.changed(stored, self.aims)
        self.sets += body.sets
        return body.result


def _of_record(function: Any) -> bool:
    """Return True for a NamedTuple, and for a method of one that makes another."""
    if isinstance(function, type):
        return hasattr(function, "_fields") and not issubclass(function, ast.AST)
    return getattr(function, "__name__", "") in ("_make", "_replace")


def _read(value: Any) -> set[str]:
    """Return the names of the program's variables and functions in a value."""
    if isinstance(value, ast.Name):
        return {value.id}
    if isinstance(value, tuple):
        return {one for part in value for one in _read(part)}
    return {*names_in(value)} if isinstance(value, ast.expr) else set()


@cache
def _set_in(node: ast.AST) -> frozenset[str]:
    """Return the names that a loop of a template sets."""
    return frozenset(names_set(node))


def _targets(target: ast.expr) -> list[str]:
    """Return the variables of a template in a target."""
    if isinstance(target, ast.Tuple):
        return [one for part in target.elts for one in _targets(part)]
    return [target.id] if isinstance(target, ast.Name) else []


def _aged(one: str, value: Any, new: set[str]) -> Any:
    """Return a value of a variable, stale where it reads names that have changed."""
    if isinstance(value, Stale):
        return value
    if isinstance(value, tuple):
        return _like(value, [_aged(one, part, new) for part in value])
    return Stale(one) if isinstance(value, ast.expr) and _read(value) & new else value


def _merged(one: str, a: Any, b: Any) -> Any:
    """Return the value that a variable has after a choice, stale where the two ways differ."""
    if isinstance(a, tuple) and isinstance(b, tuple) and len(a) == len(b):
        return _like(a, [_merged(one, *both) for both in zip(a, b, strict=True)])
    return a if a is b or _same(a, b) or (not isinstance(a, ast.expr) and a == b) else Stale(one)


def _like(whole: tuple[Any, ...], parts: Iterable[Any]) -> Any:
    """Return parts as a tuple, or a NamedTuple, as the whole is."""
    return type(whole)(*parts) if hasattr(whole, "_fields") else tuple(parts)


def _named(names: Any) -> Any:
    """Return a tuple of names, or a NamedTuple, as the program's variables."""
    return _like(names, map(_named, names)) if isinstance(names, tuple) else name(names)


def _chosen(value: Any) -> Any:
    """Return True or False that stands in a template as a known value: in a condition it chooses."""
    return value.value if isinstance(value, ast.Constant) and isinstance(value.value, bool) else value


def _same(place: Any, value: Any) -> bool:
    """Return True if a value is already in its place."""
    if isinstance(place, tuple) and isinstance(value, tuple):
        return len(place) == len(value) and all(map(_same, place, value))
    return isinstance(place, ast.Name) and isinstance(value, ast.Name) and place.id in (value.id, "_")


# --- the text of expressions ------------------------------------------------------------------------------------------

SIGNS: Mapping[type, tuple[str, int]] = {
    ast.Or: (" or ", 2), ast.And: (" and ", 3), ast.Not: ("not ", 4), ast.BitOr: (" | ", 6), ast.BitAnd: (" & ", 7),
    ast.Add: (" + ", 8), ast.Sub: (" - ", 8), ast.Mult: ("*", 9), ast.Div: ("/", 9), ast.FloorDiv: ("//", 9),
    ast.Mod: (" % ", 9), ast.USub: ("-", 10), ast.Eq: ("==", 5), ast.NotEq: ("!=", 5), ast.Lt: ("<", 5),
    ast.LtE: ("<=", 5), ast.Gt: (">", 5), ast.GtE: (">=", 5),
}
"""Operator -> its text and how tightly it binds."""


def written(node: ast.expr, least: int = 0, bare: bool = False) -> str:
    """Write an expression as the package does, ``0.5*(q + q1)``; ``least`` is how tightly it has to bind.

    A tuple has no parentheses if it is ``bare``.
    """
    text, binds = _text(node)
    if isinstance(node, ast.Tuple) and not bare:
        return f"({text})"
    return f"({text})" if binds < least else text


def _text(node: ast.expr) -> tuple[str, int]:
    """Write an expression, and tell how tightly it binds."""
    if isinstance(node, ast.Name):
        return node.id, 12
    match node:
        case ast.Constant(value=float() as number):
            return _number(number), 12
        case ast.Constant():
            return repr(node.value), 12
        case ast.BinOp(left, ast.BitOr(), right):  # with parentheses around "and", which few know by heart
            first = 6 if isinstance(left, ast.BinOp) and isinstance(left.op, ast.BitOr) else 8
            return f"{written(left, first)} | {written(right, 8)}", 6
        case ast.BinOp(left, operation, right):
            sign, binds = SIGNS[type(operation)]
            return f"{written(left, binds)}{sign}{written(right, binds + 1)}", binds
        case ast.UnaryOp(operation, operand):
            sign, binds = SIGNS[type(operation)]
            return f"{sign}{written(operand, binds)}", binds
        case ast.BoolOp(operation, parts):
            sign, binds = SIGNS[type(operation)]
            return sign.join(written(one, binds + 1) for one in parts), binds
        case ast.Compare():
            compared = (f" {SIGNS[type(sign)][0]} {written(one, 6)}" for sign, one in zip(
                node.ops, node.comparators, strict=True))
            return f"{written(node.left, 6)}{''.join(compared)}", 5
        case ast.IfExp(test, body, other):
            return f"{written(body, 2)} if {written(test, 2)} else {written(other, 2)}", 1
        case ast.Call(function, given):
            return f"{written(function, 12)}({', '.join(written(one) for one in given)})", 12
        case ast.Subscript(whole, place):
            return f"{written(whole, 12)}[{written(place, bare=True)}]", 12
        case ast.Tuple(parts):
            return ", ".join(map(written, parts)) + ("," if len(parts) == 1 else ""), 12
    raise TypeError(f"A program cannot have the expression {ast.unparse(node)}.")


def _number(number: float) -> str:
    """Write a float as a person does: 8e8, 1e-9, 1e150."""
    text = float_text(number)
    digits, _, exponent = text.partition("e")
    if exponent:
        return f"{digits}e{int(exponent)}"
    digits = text.removesuffix(".0").rstrip("0")
    zeros = len(text) - 2 - len(digits)
    return f"{digits}e{zeros}" if text.endswith(".0") and zeros > 5 else text
