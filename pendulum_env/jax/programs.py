"""Generated programs as functions on JAX arrays: every statement of a program is carried out on arrays or tracers.

A program is Python on floats (:mod:`pendulum_env.engine.generate`). JAX cannot trace it as it stands, because its
conditions and loops depend on numbers. Here its syntax tree is walked while JAX traces:

- arithmetic is that of arrays of any shape, element by element; elementary functions are those of
  :mod:`pendulum_env.jax.elementary`;
- ``a if condition else b`` and ``if`` compute both sides and choose; a division on a side that is not chosen divides
  by 1, so that its derivative cannot become nan. An ``if`` with a loop inside becomes ``lax.cond``;
- a loop of a fixed number of turns becomes a ``fori_loop``; one that may end early becomes a ``while_loop``, which has
  no derivatives: its results are constants for the derivative;
- a function that solves a stage (:data:`integrators.steps.newton.SOLVING`) is such a loop; two steps of Newton's method
  from its roots then carry the derivatives, which are those of the implicit function theorem up to order 3;
- adding and subtracting a large constant is rounding to a multiple of a power of two, with derivative 0.
"""

from __future__ import annotations

import ast
import operator
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property, lru_cache, reduce
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax

from integrators.steps.newton import REFINING, SOLVING
from pendulum_env.common.sources import functions_of, is_nan, names_set, parameters_of, parsed
from pendulum_env.engine.reading import ProgramError
from pendulum_env.jax.elementary import ELEMENTARY

Names = dict[str, Any]
STEPS = 2
"""Number of Newton steps that carry the derivatives of a root: after n steps, those of orders below 2**n are exact."""
ROUNDED = 2.0**51
"""Smallest constant whose addition and subtraction round: 1.5 * 2**52 rounds to integers, its double to even ones."""
WHOLE = 1.5 * 2.0**52


class _Conditions(threading.local):
    """Conditions under which the present expression of a thread is chosen, from the outermost to the innermost."""

    def __init__(self) -> None:
        self.all: list[Any] = []


CHOSEN = _Conditions()

OPERATORS: Mapping[type[ast.AST], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Lt: operator.lt, ast.LtE: operator.le,
    ast.Gt: operator.gt, ast.GtE: operator.ge, ast.Eq: operator.eq, ast.NotEq: operator.ne,
    ast.BitAnd: operator.and_, ast.BitOr: operator.or_,
}


@dataclass(frozen=True)
class Later:
    """The number of steps taken, known to be above 0, so that the program's lines for the first step fall away."""

    value: Any


@dataclass(frozen=True)
class Unchanged:
    """The control, with the knowledge that it is the one for which the present history was computed."""

    value: Any


def bare(value: Any) -> Any:
    """Return a number without what is known of it."""
    return value.value if isinstance(value, (Later, Unchanged)) else value


def fixed(value: Any) -> bool:
    """Return True if a value is known while JAX traces: a number or a truth value of Python."""
    return isinstance(value, (bool, int, float))


def choose(condition: Any, one: Any, other: Any) -> Any:
    """Return ``one`` where a condition holds and ``other`` elsewhere; numbers, or tuples of them."""
    if fixed(condition):
        return one if condition else other
    if isinstance(one, tuple):
        return tuple(choose(condition, a, b) for a, b in zip(one, other, strict=True))
    one, other = bare(one), bare(other)
    return one if one is other else jnp.where(condition, one, other)


def either(one: Any, other: Any) -> Any:
    """Return ``one or other`` of conditions."""
    if fixed(one):
        return True if one else other
    if fixed(other):
        return True if other else one
    return one | other


def negated(condition: Any) -> Any:
    """Return ``not condition``."""
    return not condition if fixed(condition) else ~condition


@contextmanager
def under(condition: Any) -> Iterator[None]:
    """Take a condition as one under which expressions are chosen."""
    CHOSEN.all.append(condition)
    try:
        yield
    finally:
        CHOSEN.all.pop()


def quotient(one: Any, other: Any) -> Any:
    """Return ``one / other``; where the result is not chosen, ``one / 1``."""
    if fixed(other) or not (masks := [mask for mask in CHOSEN.all if not fixed(mask)]):
        return one / other
    return one / jnp.where(reduce(operator.and_, masks), other, 1.0)


@dataclass
class Exits:
    """Where a block of statements was left early: conditions, and the returned value."""

    returned: Any = False
    value: Any = None
    broken: Any = False
    continued: Any = False

    @property
    def left(self) -> Any:
        return either(either(self.returned, self.broken), self.continued)

    def joined(self, other: Exits, condition: Any) -> Exits:
        """Return these exits under a condition, and ``other`` elsewhere."""
        values = (self.value, other.value)
        value = choose(condition, *values) if None not in values else values[0] if values[1] is None else values[1]
        parts = [choose(condition, getattr(self, name), getattr(other, name))
                 for name in ("returned", "broken", "continued")]
        return Exits(parts[0], value, *parts[1:])


@lru_cache(maxsize=256)
def functions(text: str) -> Functions:
    """Return the functions of a program's text on JAX arrays."""
    return Functions(text)


@dataclass(frozen=True)
class Functions:
    """The functions of a program, called by name: ``functions(text).call("step", t, q, v, h, ...)``."""

    text: str = field(repr=False)

    @cached_property
    def tree(self) -> ast.Module:
        return parsed(self.text)

    @cached_property
    def named(self) -> dict[str, ast.FunctionDef]:
        """Return the syntax trees of the functions by name."""
        return functions_of(self.text)

    @cached_property
    def constants(self) -> Names:
        """Return the program's constants by name."""
        names: Names = {}
        for node in self.tree.body:
            if isinstance(node, ast.Assign):
                self._assign(node.targets[0], self._value(node.value, {}), names)
        return names

    def entries_read(self, name: str, array: str) -> frozenset[int]:
        """Return the indices of the entries that a function reads of an array, by constants."""
        return frozenset(
            node.slice.value for node in ast.walk(self.named[name])
            if isinstance(node, ast.Subscript) and isinstance(node.ctx, ast.Load) and isinstance(node.value, ast.Name)
            and node.value.id == array and isinstance(node.slice, ast.Constant) and isinstance(node.slice.value, int))

    @cached_property
    def looping(self) -> frozenset[str]:
        """Return the names of the functions that have loops, or call a function that does."""
        names = {name for name, node in self.named.items() if any(isinstance(part, ast.For) for part in ast.walk(node))}
        while more := {name for name, node in self.named.items() if name not in names and names & called(node)}:
            names |= more
        return frozenset(names)

    def call(self, name: str, *arguments: Any) -> Any:
        """Return the results of a function of the program."""
        solves = name.startswith(SOLVING)
        if solves and (refining := REFINING + name.removeprefix(SOLVING)) in self.named:
            roots = self._run(name, tuple(map(lax.stop_gradient, map(bare, arguments))))
            for _ in range(STEPS):
                roots = self._run(refining, (*arguments, *(roots if isinstance(roots, tuple) else (roots,))))
            return roots
        return self._run(name, arguments)

    def _run(self, name: str, arguments: Sequence[Any]) -> Any:
        node = self.named[name]
        given = parameters_of(node)
        left_out = node.args.defaults[len(node.args.defaults) - (len(given) - len(arguments)):]
        arguments = (*arguments, *(self._value(one, {}) for one in left_out if len(given) > len(arguments)))
        names = dict(zip(given, arguments, strict=True))
        _, exits = self._block(node.body, names)
        return exits.value

    # --- statements -------------------------------------------------------------------------------------------------

    def _block(self, body: Sequence[ast.stmt], names: Names) -> tuple[Names, Exits]:
        """Return the names after a block of statements, and where it was left early."""
        for place, statement in enumerate(body):
            names, exits = self._statement(statement, names)
            if exits.left is True:
                return names, exits
            if exits.left is not False:
                goes_on = negated(exits.left)
                with under(goes_on):
                    rest, further = self._block(body[place + 1:], dict(names))
                return merged(exits.left, names, rest), exits.joined(further, exits.left)
        return names, Exits()

    def _statement(self, node: ast.stmt, names: Names) -> tuple[Names, Exits]:
        if isinstance(node, ast.Assign):
            value = self._value(node.value, names)
            for target in node.targets:
                self._assign(target, value, names)
        elif isinstance(node, ast.Return):
            return names, Exits(returned=True, value=self._value(node.value, names) if node.value else ())
        elif isinstance(node, ast.If):
            return self._if(node, names)
        elif isinstance(node, ast.For):
            return self._for(node, names)
        elif isinstance(node, ast.Break):
            return names, Exits(broken=True)
        elif isinstance(node, ast.Continue):
            return names, Exits(continued=True)
        elif not isinstance(node, ast.Expr):
            raise unknown(node, "the statement")
        return names, Exits()

    def _assign(self, target: ast.expr, value: Any, names: Names) -> None:
        if isinstance(target, ast.Name):
            names[target.id] = value
        elif isinstance(target, ast.Tuple):
            for part, one in zip(target.elts, value, strict=True):
                self._assign(part, one, names)
        elif isinstance(target, ast.Subscript):
            self._value(target.value, names)[self._value(target.slice, names)] = value
        else:
            raise unknown(target, "the assignment to")

    def _if(self, node: ast.If, names: Names) -> tuple[Names, Exits]:
        condition = self._value(node.test, names)
        if fixed(condition):
            return self._block(node.body if condition else node.orelse, names)
        heavy = any(calls & self.looping for calls in map(called, [*node.body, *node.orelse]))
        leaves = any(isinstance(part, (ast.Return, ast.Break, ast.Continue)) for part in ast.walk(node))
        if heavy and not leaves and jnp.ndim(condition) == 0:
            return self._cond(condition, node, names), Exits()
        with under(condition):
            one, exits = self._block(node.body, dict(names))
        with under(negated(condition)):
            other, others = self._block(node.orelse, dict(names))
        return merged(condition, one, other), exits.joined(others, condition)

    def _cond(self, condition: Any, node: ast.If, names: Names) -> Names:
        """Return the names after an ``if`` of which only the chosen side is computed, where JAX can do that."""
        sides = [node.body, node.orelse]
        kept = [name for name in dict.fromkeys(names_set(*node.body, *node.orelse))
                if all(name in names or name in names_set(*side) for side in sides)]

        def side(body: Sequence[ast.stmt]) -> tuple[Any, ...]:
            after, _ = self._block(body, dict(names))
            return tuple(after[name] for name in kept)

        forms = [jax.eval_shape(lambda body=body: tuple(map(jnp.asarray, map(bare, side(body))))) for body in sides]
        alike = [(jnp.result_type(a, b), jnp.broadcast_shapes(a.shape, b.shape)) for a, b in zip(*forms, strict=True)]

        def branch(body: Sequence[ast.stmt]) -> Callable[[], tuple[Any, ...]]:
            return lambda: tuple(jnp.broadcast_to(jnp.asarray(bare(value), kind), shape)
                                 for value, (kind, shape) in zip(side(body), alike, strict=True))

        values = lax.cond(condition, branch(node.body), branch(node.orelse))
        return {**names, **dict(zip(kept, values, strict=True))}

    def _for(self, node: ast.For, names: Names) -> tuple[Names, Exits]:
        """Return the names after a loop; its first turn is taken before, so that all names of a turn are known."""
        turns = self._turns(node, names)
        counter = node.target.id  # type: ignore[attr-defined]
        if turns < 1:
            return names, Exits()
        ends = any(isinstance(part, (ast.Break, ast.Return)) for part in ast.walk(node))
        if ends and turns > 1:
            names = {name: stopped(value) for name, value in names.items()}
        names, exits = self._block(node.body, {**names, counter: 0})
        if turns > 1:
            names, exits = (self._while if ends else self._repeat)(node, counter, turns, names, exits)
        return names, Exits(exits.returned, exits.value)

    def _turns(self, node: ast.For, names: Names) -> int:
        call = node.iter
        if not (isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "range"
                and len(call.args) == 1 and isinstance(node.target, ast.Name) and not node.orelse):
            raise unknown(node, "the loop")
        turns = self._value(call.args[0], names)
        if not isinstance(turns, int):
            raise unknown(node, "the number of turns of the loop")
        return turns

    def _repeat(self, node: ast.For, counter: str, turns: int, names: Names, exits: Exits) -> tuple[Names, Exits]:
        """Return the names after all turns but the first of a loop that always takes all of them."""
        kept = [name for name in dict.fromkeys(names_set(*node.body)) if name in names]
        start = alike([names[name] for name in kept])

        def turn(i: Any, values: Any) -> Any:
            after, _ = self._block(node.body, {**names, **dict(zip(kept, values, strict=True)), counter: i})
            return like([after[name] for name in kept], start)

        values = lax.fori_loop(1, turns, turn, start)
        return {**names, **dict(zip(kept, values, strict=True))}, Exits()

    def _while(self, node: ast.For, counter: str, turns: int, names: Names, exits: Exits) -> tuple[Names, Exits]:
        """Return the names after all turns but the first of a loop that may end early, without derivatives."""
        kept = [name for name in dict.fromkeys(names_set(*node.body)) if name in names]
        single = exits.value is not None and not isinstance(exits.value, tuple)
        value = () if exits.value is None else (exits.value,) if single else exits.value
        masks = [mask for mask in CHOSEN.all if not fixed(mask)]
        start = alike([*(names[name] for name in kept), *value])
        size = len(kept)
        shape = jnp.broadcast_shapes(*(jnp.shape(one) for one in start))
        returned, broken = (jnp.broadcast_to(jnp.asarray(mask), shape) for mask in (exits.returned, exits.broken))

        def going(state: Any) -> Any:
            i, _, returned, broken = state
            return (i < turns) & jnp.any(reduce(operator.and_, masks, ~(returned | broken)))

        def turn(state: Any) -> Any:
            i, old, returned, broken = state
            with under(live := ~(returned | broken)):
                after, exits = self._block(
                    node.body, {**names, **dict(zip(kept, old[:size], strict=True)), counter: i})
            new = [choose(live, stopped(after[name]), one) for name, one in zip(kept, old[:size], strict=True)]
            results = old[size:]
            if exits.value is not None:
                given = exits.value if isinstance(exits.value, tuple) else (exits.value,)
                now = live & exits.returned
                results = [choose(now, stopped(one), before) for one, before in zip(given, results, strict=True)]
            return (i + 1, like([*new, *results], start), returned | (live & exits.returned),
                    broken | (live & exits.broken))

        _, values, returned, broken = lax.while_loop(going, turn, (1, start, returned, broken))
        results = tuple(values[size:])
        result = None if not results else results[0] if single else results
        return {**names, **dict(zip(kept, values[:size], strict=True))}, Exits(returned, result, broken)

    # --- expressions ------------------------------------------------------------------------------------------------

    def _value(self, node: ast.expr, names: Names) -> Any:
        """Return the value of an expression."""
        if isinstance(node, ast.Name):
            return names[node.id] if node.id in names else self.constants[node.id]
        if isinstance(node, ast.Constant):
            return node.value
        if isinstance(node, ast.BinOp):
            return self._operation(node, names)
        if isinstance(node, ast.Call):
            return self._call(node, names)
        if isinstance(node, ast.Tuple):
            return tuple(self._value(part, names) for part in node.elts)
        if isinstance(node, ast.UnaryOp):
            value = bare(self._value(node.operand, names))
            return -value if isinstance(node.op, ast.USub) else negated(value)
        if isinstance(node, ast.Compare):
            return self._comparison(node, names)
        if isinstance(node, ast.BoolOp):
            return self._condition(node, names)
        if isinstance(node, ast.IfExp):
            condition = self._value(node.test, names)
            if fixed(condition):
                return self._value(node.body if condition else node.orelse, names)
            with under(condition):
                one = self._value(node.body, names)
            with under(negated(condition)):
                other = self._value(node.orelse, names)
            return choose(condition, one, other)
        if isinstance(node, ast.Subscript):
            return self._value(node.value, names)[self._value(node.slice, names)]
        raise unknown(node, "the expression")

    def _operation(self, node: ast.BinOp, names: Names) -> Any:
        left, right = node.left, node.right
        if isinstance(node.op, ast.Sub) and isinstance(right, ast.Constant) and isinstance(left, ast.BinOp):
            large = right.value
            rounds = isinstance(left.op, ast.Add) and isinstance(left.right, ast.Constant) and left.right.value == large
            if rounds and isinstance(large, float) and large > ROUNDED:
                unit = large / WHOLE
                return jnp.round(bare(self._value(left.left, names)) / unit) * unit
        one, other = bare(self._value(left, names)), bare(self._value(right, names))
        if isinstance(node.op, ast.Div):
            return quotient(one, other)
        if type(node.op) not in OPERATORS:
            raise unknown(node, "the operator of")
        return OPERATORS[type(node.op)](one, other)

    def _comparison(self, node: ast.Compare, names: Names) -> Any:
        values = [self._value(part, names) for part in (node.left, *node.comparators)]
        result: Any = True
        for one, kind, other in zip(values, node.ops, values[1:], strict=False):
            if isinstance(one, Later) and isinstance(kind, ast.Eq) and fixed(other) and other == 0.0:
                holds: Any = False
            elif isinstance(one, Unchanged) and one is other:
                holds = isinstance(kind, (ast.Eq, ast.LtE, ast.GtE))
            else:
                holds = OPERATORS[type(kind)](bare(one), bare(other))
            result = holds if result is True else result & holds
        return result

    def _condition(self, node: ast.BoolOp, names: Names) -> Any:
        conjunction = isinstance(node.op, ast.And)
        result: Any = conjunction
        for part in node.values:
            value = self._value(part, names)
            if fixed(value):
                if bool(value) != conjunction:
                    return not conjunction
            else:
                result = value if fixed(result) else result & value if conjunction else result | value
        return result

    def _call(self, node: ast.Call, names: Names) -> Any:
        name = node.func.id if isinstance(node.func, ast.Name) and not node.keywords else ""
        if is_nan(node):
            return float("nan")
        values = [self._value(part, names) for part in node.args]
        if name in ELEMENTARY:
            return ELEMENTARY[name](*map(bare, values))
        if name in self.named:
            return self.call(name, *values)
        values = [bare(value) for value in values]
        if name == "abs":
            return abs(values[0])
        if name in ("min", "max") and len(values) == 2:
            return choose(values[1] < values[0] if name == "min" else values[1] > values[0], values[1], values[0])
        if name == "len":
            return len(values[0])
        if name == "int":
            return values[0]
        raise unknown(node, "the call")


def merged(condition: Any, one: Names, other: Names) -> Names:
    """Return the names of two courses of a program, with the values that a condition chooses."""
    both: Names = {}
    for name in {**one, **other}:
        if name not in one or name not in other:
            both[name] = one.get(name, other.get(name))
        elif one[name] is other[name] or isinstance(one[name], list):
            both[name] = one[name]
        else:
            both[name] = choose(condition, one[name], other[name])
    return both


def called(node: ast.AST) -> set[str]:
    """Return the names of the functions that a part of a program calls."""
    return {part.func.id for part in ast.walk(node) if isinstance(part, ast.Call) and isinstance(part.func, ast.Name)}


def stopped(value: Any) -> Any:
    """Return a value as a constant for derivatives."""
    return value if fixed(value) or isinstance(value, (list, tuple)) else lax.stop_gradient(bare(value))


def alike(values: Sequence[Any]) -> list[Any]:
    """Return values as arrays of one shape, numbers in one type: as a loop carries them."""
    arrays = [jnp.asarray(bare(value)) for value in values]
    numbers = [array for array in arrays if array.dtype != jnp.bool_]
    kind = jnp.result_type(float, *numbers)
    shape = jnp.broadcast_shapes(*(array.shape for array in arrays))
    return [jnp.broadcast_to(array if array.dtype == jnp.bool_ else array.astype(kind), shape) for array in arrays]


def like(values: Sequence[Any], start: Sequence[Any]) -> list[Any]:
    """Return values in the types and shapes of others."""
    return [jnp.broadcast_to(jnp.asarray(bare(value)).astype(one.dtype), one.shape)
            for value, one in zip(values, start, strict=True)]


def unknown(node: ast.AST, what: str) -> ProgramError:
    return ProgramError(f"The twin in JAX cannot carry out {what} '{ast.unparse(node)}' of the program.")
