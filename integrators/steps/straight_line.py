"""Straight-line source of recorded operations: one short line for each value that a person would give a name.

A step that was run with recording numbers (:mod:`integrators.steps.tracing`) is a list of elementary operations. Here
it becomes source again, with the operations in their order, so that the source computes the same bits. Calls of the
problem's functions, values that are used several times, and the results have lines of their own; everything else is
written where it is used, and so is a call with simple arguments whose result is used once. A line takes the name of an
old value where that value is not needed any more::

    omega = omega + dt*acceleration(theta, omega)
    theta = theta + dt*omega
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import Any

from integrators.steps.tracing import Symbol, Trace

SUM, PRODUCT, POWER, ATOM = range(4)
"""Binding strength of an expression's outermost operation, the weakest first."""
SIGNS = {"add": ("+", SUM), "sub": ("-", SUM), "mul": ("*", PRODUCT), "div": ("/", PRODUCT)}
"""Operation of two numbers -> its sign in the source, and its binding strength."""


class Record(Trace):
    """A trace that records equal constants only once, so that equal operations with them are recorded only once too."""

    def __init__(self) -> None:
        super().__init__()
        self._constants: dict[Any, Symbol] = {}

    def leaf(self, name: str, value: Any = None) -> Symbol:
        if name != "steady":
            return super().leaf(name, value)
        if value not in self._constants:
            self._constants[value] = super().leaf(name, value)
        return self._constants[value]


class StraightLine:
    """Writer of the source lines of recorded operations.

    Attributes:
        trace: the recorded operations.
        leaves: index of a given number (a leaf) in the trace -> its name in the source.
        states: names of the leaves that change from step to step; values that depend on them get lines if they are used
            more than once.
        called: name of an operation that calls a function of the problem -> base of the names of its results.
        value: function that returns a constant as source text, with its binding strength.
        bases: name of another operation -> base of the names of its results; by default "k".
        forms: name of a function -> the form of its call in the source, such as ``np.sin({})``; by default ``sin({})``.
    """

    def __init__(
        self, trace: Trace, leaves: Mapping[int, str], states: Collection[str], called: Mapping[str, str],
        value: Callable[[Any], tuple[str, int]], forms: Mapping[str, str] | None = None,
        bases: Mapping[str, str] | None = None,
    ) -> None:
        self.trace, self.leaves, self.states, self.called = trace, dict(leaves), frozenset(states), called
        self.value, self.forms, self.bases = value, forms or {}, bases or {}
        self._names: dict[int, str] = {}

    def assignments(self, ends: Mapping[str, Symbol]) -> list[tuple[str, str]]:
        """Return the names and sources of the values after which the variables ``ends`` hold their recorded values.

        Operations on which no end depends are left out.
        """
        places = {name: end.place for name, end in ends.items()}
        lines = self._write(list(places.values()), {place: name for name, place in places.items()})
        moved = {name: self._text(place)[0] for name, place in places.items()}
        moved = {name: text for name, text in moved.items() if name != text}
        return [*lines, *([(", ".join(moved), ", ".join(moved.values()))] if moved else [])]

    def result(self, value: Symbol) -> tuple[list[tuple[str, str]], str]:
        """Return the names and sources of the values that a recorded value needs, and its own source."""
        lines = self._write([value.place], {})
        return lines, self._text(value.place)[0]

    def _write(self, ends: Sequence[int], wanted: Mapping[int, str]) -> list[tuple[str, str]]:
        """Return the names and sources of all values that get a line; ``wanted`` maps operations to required names."""
        named = self._named(ends, wanted)
        last = self._last_uses(named, ends)
        bases = {place: wanted.get(place) or self._base(place) for place in named}
        numbered = self._crowded(named, last, bases, set(self.leaves.values()))
        held = {name: place for place, name in self.leaves.items()}
        self._names = dict(self.leaves)
        lines = []
        for place in named:
            text = self._text(place, expand=True)[0]
            free = {name for name, owner in held.items() if last.get(owner, -1) <= place}
            name = self._free_name(bases[place], bases[place] in numbered, held, free)
            lines.append((name, text))
            held[name] = place
            self._names[place] = name
        return lines

    # --- which values get lines, and their names ----------------------------------------------------------------------

    def _named(self, ends: Sequence[int], wanted: Collection[int]) -> list[int]:
        """Return the operations on which ``ends`` depend that get a line of their own, in their order."""
        operations = self.trace.operations
        needed, uses, open_ = set(ends), Counter(ends), list(dict.fromkeys(ends))
        while open_:
            for operand in operations[open_.pop()].operands:
                uses[operand] += 1
                if operand not in needed:
                    needed.add(operand)
                    open_.append(operand)
        moving = {place for place, name in self.leaves.items() if name in self.states}
        named: list[int] = []
        for place in sorted(needed - set(self.leaves)):
            operation = operations[place]
            if not moving.isdisjoint(operation.operands) or operation.name in self.called:
                moving.add(place)
            if not operation.operands and operation.name not in self.called:
                continue
            given = {*named, *self.leaves}
            shared = uses[place] > 1 and place in moving and not self._short(place, given)
            simple = uses[place] == 1 and all(self._short(operand, given) for operand in operation.operands)
            if place in wanted or shared or (operation.name in self.called and not simple):
                named.append(place)
        return named

    def _short(self, place: int, named: Collection[int]) -> bool:
        """Return True for a product of names and numbers, which needs no line of its own even if it is used twice."""
        operation = self.trace.operations[place]
        if operation.name not in ("mul", "div", "neg"):
            return place in named or operation.name == "steady"
        return all(self._short(operand, named) for operand in operation.operands)

    def _last_uses(self, named: Sequence[int], ends: Sequence[int]) -> dict[int, int]:
        """Return, for leaves and named values, the named value in whose line they are used last."""
        kept, last, after = {*named, *self.leaves}, {}, len(self.trace.operations)
        for place, open_ in (*((place, list(self.trace.operations[place].operands)) for place in named),
                             (after, list(ends))):
            while open_:
                operand = open_.pop()
                if operand in kept:
                    last[operand] = place
                else:
                    open_ += self.trace.operations[operand].operands
        return last

    def _base(self, place: int) -> str:
        """Return the base of a value's name: that of its operation, or of the state to which its other terms add."""
        operation = self.trace.operations[place]
        known = {**self.bases, **self.called}
        if operation.name in known:
            return known[operation.name]
        while operation.name in ("add", "sub"):
            place = operation.operands[0]
            operation = self.trace.operations[place]
        base = self.leaves.get(place) or self.called.get(operation.name, "")
        return base if base in self.states else "k"

    def _crowded(
        self, named: Sequence[int], last: Mapping[int, int], bases: Mapping[int, str], given: Collection[str]
    ) -> set[str]:
        """Return the bases of names, apart from given names, of which two values are needed at the same time."""
        crowded = set()
        for i, place in enumerate(named):
            for later in named[i + 1 :]:
                if bases[later] == bases[place] and later < last.get(place, -1):
                    crowded.add(bases[place])
        return {base for base in crowded if base not in given}

    @staticmethod
    def _free_name(base: str, numbered: bool, held: Mapping[str, int], free: Collection[str]) -> str:
        """Return the first name with this base whose value, if it has one, is not needed any more."""
        for name in _candidates(base, numbered):
            if name not in held or name in free:
                return name
        raise AssertionError

    # --- expressions --------------------------------------------------------------------------------------------------

    def _text(self, place: int, expand: bool = False) -> tuple[str, int]:
        """Return the source of a value and its binding strength; a named value is its name unless ``expand``."""
        if place in self._names and not expand:
            return self._names[place], ATOM
        operation = self.trace.operations[place]
        if operation.name == "steady":
            return self.value(operation.value)
        parts = [self._text(operand) for operand in operation.operands]
        if operation.name in SIGNS:
            return self._binary(operation.name, *parts)
        if operation.name == "neg":
            text, strength = parts[0]
            return (f"-({text})", PRODUCT) if strength == SUM else (f"-{text}", PRODUCT)
        if operation.name == "power":
            base, exponent = (text if strength == ATOM and not text.startswith("-") else f"({text})"
                              for text, strength in parts)
            return f"{base}**{exponent}", POWER
        form = self.forms.get(operation.name, f"{operation.name}({{}})")
        return form.format(", ".join(text for text, _ in parts)), ATOM

    @staticmethod
    def _binary(name: str, left: tuple[str, int], right: tuple[str, int]) -> tuple[str, int]:
        """Return the source of a sum or product, with the brackets that keep the order of the operations."""
        sign, strength = SIGNS[name]
        if name == "mul" and "1.0" in (left[0], right[0]):
            return right if left[0] == "1.0" else left
        if name == "mul" and left[0] == "-1.0":
            return f"-{right[0]}" if right[1] > SUM else f"-({right[0]})", PRODUCT
        first = left[0] if left[1] >= strength else f"({left[0]})"
        if name in ("add", "sub") and right[0].startswith("-") and right[1] > SUM:
            return f"{first} {'-' if name == 'add' else '+'} {right[0][1:]}", SUM
        second = right[0] if right[1] > strength and not right[0].startswith("-") else f"({right[0]})"
        return (f"{first} {sign} {second}" if strength == SUM else f"{first}{sign}{second}"), strength


def _candidates(base: str, numbered: bool) -> Iterator[str]:
    """Yield names for values with this base: ``a1, a2, ...`` if numbered, else ``a, a_2, a_3, ...``."""
    number = 1
    while True:
        yield f"{base}{number}" if numbered else base if number == 1 else f"{base}_{number}"
        number += 1
