"""Vectors of LLVM: loops over blocks of pendulums that compute the numbers of several pendulums at once.

A loop ``for i in lanes(n)`` runs from 0 to n - 1, as ``range(n)`` does. It may run further, up to a whole number of
vectors: the fields of a block have room for that, and nothing reads what lies beyond n. In arrays of other names, such
as the user's, no element beyond n is read or written.
"""

from __future__ import annotations

import ast
from collections.abc import Sequence
from typing import Any, NamedTuple

from numba.core.cgutils import ir

NAME = "lanes"
"""Name of the function in a program whose numbers such a loop runs over."""
ROOMY = frozenset(("s", "o", "w", "a"))
"""Names of arrays whose elements are the fields of blocks, with room for whole vectors."""
REGISTERS = {"+avx512f": 8, "+avx": 4}
"""Features of a processor -> numbers of type float64 in a register; 2 without them."""
LARGEST = 2 * max(REGISTERS.values())
"""Largest number of elements of a vector."""
SINGLE, NUMBER, PLACE = ir.FloatType(), ir.DoubleType(), ir.IntType(32)


def width(features: str) -> int:
    """Return the number of elements of a vector for a processor with these features, a text such as "+avx,+avx2".

    It is twice that of a register: while one half waits for its result, the processor works on the other.
    """
    given = features.split(",")
    return 2 * next((count for feature, count in REGISTERS.items() if feature in given), 2)


class Lane(NamedTuple):
    """The loop in vectors that is being written: the name of its index, and the elements of a vector that count, as a
    vector of truth values, or None if all do.
    """

    name: str
    mask: Any


class Row(NamedTuple):
    """Statements that set all columns of row ``i`` of an array to ``values``: ``seen[i, 0] = x``, ``seen[i, 1] = y``.

    The array must have as many columns.
    """

    array: str
    values: list[ast.expr]


def arrays(loop: ast.For) -> set[str]:
    """Return the names of the arrays whose elements a loop reads or writes."""
    elements = [node.value for node in ast.walk(loop) if isinstance(node, ast.Subscript)]
    return {array.id for array in elements if isinstance(array, ast.Name)}


def fits(loop: ast.For) -> bool:
    """Return True for a loop over ``lanes(n)`` whose index only says which element of a field, or which row, is meant.

    Then the elements of a vector lie next to each other in memory.
    """
    match loop:
        case ast.For(target=ast.Name(id=index), iter=ast.Call(func=ast.Name(id=name))) if name == NAME:
            lines = rows(loop.body, index)
        case _:
            return False
    parts = [part for line in lines for part in (line.values if isinstance(line, Row) else [line])]
    nodes = [node for part in parts for node in ast.walk(part)]
    names = [node.id for node in nodes if isinstance(node, ast.Name)]
    meant = sum(isinstance(node, ast.Subscript) and along(node, index) for node in nodes)
    whole_rows = {line.array for line in lines if isinstance(line, Row)}  # nothing else uses their elements
    return (names.count(index) == meant and whole_rows.isdisjoint(names)
            and not any(isinstance(line, ast.For) for line in lines))


def along(node: ast.Subscript, index: str) -> bool:
    """Return True for an element such as ``s[i + U(176)]`` or ``info[3, i]``, the next of which lies next to it."""
    places = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
    return [sum(isinstance(part, ast.Name) and part.id == index for part in ast.walk(place)) for place in places] == [
        *[0] * (len(places) - 1), 1]


def rows(body: Sequence[ast.stmt], index: str) -> list[ast.stmt | Row]:
    """Return the statements of a loop; those that set the columns of a row, from the first, are put together."""
    found: list[ast.stmt | Row] = []
    for line in body:
        match line:
            case ast.Assign(targets=[ast.Subscript(value=ast.Name(id=array), slice=ast.Tuple(elts=[
                    ast.Name(id=name), ast.Constant(value=int(column))]))], value=value) if name == index:
                last = found[-1] if found else None
                if column == 0:
                    found.append(Row(array, [value]))
                    continue
                if isinstance(last, Row) and last.array == array and column == len(last.values):
                    last.values.append(value)
                    continue
        found.append(line)
    return found


# --- instructions -----------------------------------------------------------------------------------------------------


def element(kind: Any) -> Any:
    """Return the type of the elements of a vector; of any other type, that type."""
    return kind.element if isinstance(kind, ir.VectorType) else kind


def like(kind: Any, other: Any) -> Any:
    """Return the type ``other``, or that of vectors of it if ``kind`` is one of vectors."""
    return ir.VectorType(other, kind.count) if isinstance(kind, ir.VectorType) else other


def spread(builder: Any, values: Sequence[Any]) -> list[Any]:
    """Return values as vectors, in all elements of which a single value is repeated, if one of them is a vector."""
    count = next((value.type.count for value in values if isinstance(value.type, ir.VectorType)), 0)
    return [repeated(builder, value, count) for value in values] if count else [*values]


def repeated(builder: Any, value: Any, count: int) -> Any:
    """Return a vector in all elements of which a value is repeated; a vector as it is."""
    if isinstance(value.type, ir.VectorType):
        return value
    kind = ir.VectorType(value.type, count)
    if isinstance(value, ir.Constant):
        return ir.Constant(kind, [value.constant] * count)
    first = builder.insert_element(ir.Constant(kind, ir.Undefined), value, PLACE(0))
    return builder.shuffle_vector(first, first, ir.Constant(ir.VectorType(PLACE, count), [0] * count))


def counting(builder: Any, rest: Any, count: int) -> Any:
    """Return the vector of truth values whose first ``rest`` elements are true."""
    places = ir.Constant(ir.VectorType(rest.type, count), [*range(count)])
    return builder.icmp_unsigned("<", places, repeated(builder, rest, count))


def load(builder: Any, start: Any, count: int, mask: Any) -> Any:
    """Return the vector that begins at an address; elements beyond the mask are 0, and are not read."""
    kind = ir.VectorType(start.type.pointee, count)
    address = builder.bitcast(start, ir.PointerType(kind))
    if mask is None:
        found = builder.load(address)
        found.align = _size(kind.element)
        return found
    function = _masked(builder, "load", kind, kind, [ir.PointerType(kind), PLACE, mask.type, kind])
    return builder.call(function, [address, PLACE(_size(kind.element)), mask, ir.Constant(kind, None)])


def store(builder: Any, value: Any, start: Any, mask: Any) -> None:
    """Write a vector to memory from an address on; elements beyond the mask are not written."""
    kind = value.type
    address = builder.bitcast(start, ir.PointerType(kind))
    if mask is None:
        builder.store(value, address).align = _size(kind.element)
        return
    function = _masked(builder, "store", kind, ir.VoidType(), [kind, ir.PointerType(kind), PLACE, mask.type])
    builder.call(function, [value, address, PLACE(_size(kind.element)), mask])


def interleaved(builder: Any, vectors: Sequence[Any]) -> Any:
    """Return one vector of the first elements of some vectors, then of their second elements, and so on."""
    columns, count = len(vectors), vectors[0].type.count
    parts = [*vectors]
    while len(parts) > 1:
        if len(parts) % 2:
            parts.append(ir.Constant(parts[0].type, ir.Undefined))
        size = parts[0].type.count
        parts = [_shuffled(builder, one, other, [*range(2 * size)])
                 for one, other in zip(parts[::2], parts[1::2], strict=True)]
    return _shuffled(builder, parts[0], parts[0], [column * count + row for row in range(count)
                                                   for column in range(columns)])


def each_repeated(builder: Any, mask: Any, times: int) -> Any:
    """Return a vector of truth values with every element repeated."""
    return _shuffled(builder, mask, mask, [place // times for place in range(times * mask.type.count)])


def _shuffled(builder: Any, one: Any, other: Any, places: Sequence[int]) -> Any:
    return builder.shuffle_vector(one, other, ir.Constant(ir.VectorType(PLACE, len(places)), [*places]))


def _size(kind: Any) -> int:
    """Return the size of a type of array elements in bytes."""
    return 8 if kind == NUMBER else 4 if kind == SINGLE else 1


def _masked(builder: Any, what: str, kind: Any, result: Any, given: Sequence[Any]) -> Any:
    """Return LLVM's function that loads or stores a part of a vector."""
    letter = {8: "f64", 4: "f32", 1: "i8"}[_size(kind.element)]
    name = f"llvm.masked.{what}.v{kind.count}{letter}.p0v{kind.count}{letter}"
    return builder.module.declare_intrinsic(name, (), ir.FunctionType(result, given))
