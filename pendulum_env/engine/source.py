"""Copies of the source of Python functions, and of the functions that they call, for generated programs."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterable, Iterator
from functools import cache, lru_cache
from symtable import symtable
from types import CodeType, FunctionType
from typing import Any

from pendulum_env.common.sources import names_set, parsed, source_of
from pendulum_env.engine.reading import ProgramError, Reader, arguments, float_text
from pendulum_env.engine.specialise import Written

Plain = Callable[..., Any]
"""A function made with def, of floats, whose source can be copied into a program."""
TEXT = "_text"
"""Name in a program's module of its text, whose arithmetic may be written as instructions of LLVM."""
_CALL = re.compile(r"(\w+)\(")
_DEFINED = re.compile(r"^def (\w+)", re.MULTILINE)


@cache
def text_of(function: Plain) -> str:
    """Return the text of a function of the package, or of one that was read, without decorators and type annotations.

    Annotations are left out because programs cannot resolve their names.
    """
    source = source_of(function, check=False)
    header = ast.arguments(posonlyargs=[], args=[ast.arg(one) for one in arguments(function)], kwonlyargs=[],
                           kw_defaults=[], defaults=source.node.args.defaults)
    return f"def {function.__name__}({ast.unparse(header)}):\n{source.body_text()}"


def names_of(code: CodeType) -> Iterator[str]:
    """Yield the names that a function's code takes from its module or from Python itself, and those of attributes.

    A comprehension has code of its own up to Python 3.11, and a lambda or a function inside the function always.
    """
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from names_of(constant)


def called_in(text: str, functions: Iterable[Plain]) -> list[Plain]:
    """Return those of the given functions that a source text calls by name."""
    names = set(_CALL.findall(text))
    return [function for function in functions if function.__name__ in names]


def with_callees(functions: Iterable[Plain]) -> list[FunctionType]:
    """Return the functions and all Python functions that they call, each once; called functions come first.

    In place of a user's function stands the one that was read (:mod:`pendulum_env.engine.reading`), under its name.
    """
    given = tuple(function for function in functions if isinstance(function, FunctionType))
    kept = _kept(given)
    if not kept or not kept[0].unchanged():
        kept[:] = _read(given)
    return [*kept[1]]


@lru_cache(maxsize=512)
def _kept(given: tuple[FunctionType, ...]) -> list[Any]:
    """Return the list in which the results of :func:`_read` are kept for some functions, at first an empty one."""
    return []


def _read(given: tuple[FunctionType, ...]) -> tuple[Reader, list[FunctionType]]:
    """Return the reader of functions, and the functions and all that they call."""
    reader = Reader(taken=[function.__name__ for function in given])
    ordered: list[FunctionType] = []

    def visit(function: FunctionType) -> None:
        """Append a function to the list ``ordered`` after all functions that it calls."""
        if function in ordered:
            return
        for name in names_of(function.__code__):
            if isinstance(called := function.__globals__.get(name), FunctionType):
                visit(called)
        ordered.append(function)

    for function in given:
        visit(reader.plain(function, "formula"))
    return reader, ordered


def check_names(pieces: Iterable[str], coefficients: Iterable[str]) -> None:
    """Check that in a generated program the names of coefficients stand for nothing but these coefficients.

    The name may only be an argument, or be assigned once, where arguments are unpacked. Raises ProgramError otherwise,
    since the program would compute with a wrong number, and for two functions of the same name. ``pieces`` are the
    texts of the program.
    """
    names = set(coefficients)
    taken, defined = names & {"control", "side", "direction"}, list[str]()
    for piece in pieces:
        if isinstance(piece, Written):
            defined.append(piece.function)
            taken |= {name for name in names if piece.sets.count(name) > 1}
            continue
        for block in blocks_of(piece):
            functions, wrong = _checked(block, words_of(block) & names)
            defined += functions
            taken |= wrong
    for name in defined:
        if defined.count(name) > 1:
            raise ProgramError(f"Two functions of the generated program have the name {name}; rename one of them.")
    taken |= names & {*defined}
    if taken:
        raise taken_names(taken)


@lru_cache(maxsize=4096)
def _checked(block: str, names: frozenset[str]) -> tuple[tuple[str, ...], frozenset[str]]:
    """Return the names of the functions in a part of a program, and those of ``names`` that it uses otherwise."""
    if not names and len(defined := _DEFINED.findall(block)) == 1:
        return tuple(defined), frozenset()
    try:
        tables = symtable(block, "<program>", "exec").get_children()
    except SyntaxError as error:  # a coefficient that is an argument twice
        twice = {name for name in names if f"'{name}'" in str(error)}
        if not twice:
            raise
        return (), frozenset(twice)
    taken: set[str] = set()
    starts = [table.get_lineno() - 1 for table in tables]
    for table, start, end in zip(tables, starts, [*starts[1:], None], strict=True):
        own = {name for name in names.intersection(table.get_identifiers()) if table.lookup(name).is_assigned()}
        twice = {name for name in own if table.lookup(name).is_parameter()}
        if own - twice:
            # A decorator in the line before stands with the function before, and is dropped.
            lines = block.split("\n")[start:end]
            stored = names_set(parsed("\n".join(line for line in lines if not line.startswith("@"))))
            twice |= {name for name in own if stored.count(name) > 1}
        taken |= twice
    return tuple(table.get_name() for table in tables), frozenset(taken)


def blocks_of(text: str) -> tuple[str, ...]:
    """Return the parts of a program, all of them but the first a function, which many programs share."""
    blocks = tuple(re.split(r"\n\n+(?=@|def )", text))
    whole = all(block.count(quotes) % 2 == 0 for block in blocks for quotes in ('"""', "'''"))
    return blocks if whole else (text,)


@lru_cache(maxsize=4096)
def words_of(block: str) -> frozenset[str]:
    """Return all words in a part of a program, among them all names."""
    return frozenset(re.findall(r"\w+", block))


def taken_names(names: set[str]) -> ProgramError:
    """Return the error that names of coefficients stand for something else in a program."""
    return ProgramError(f"The coefficient name {min(names)} is already used in the generated program; choose a longer "
                        "name, such as cubic_drag_rate.")


def constants_of(functions: Iterable[FunctionType]) -> dict[str, float]:
    """Return the floats of modules of the package that functions use, a dict by name."""
    return {name: value for function in functions for name in names_of(function.__code__)
            if isinstance(value := function.__globals__.get(name), float)}


def constants_text(functions: Iterable[FunctionType]) -> str:
    """Write the source of the module-level floats that functions use, one line for each."""
    return "".join(f"{name} = {float_text(value)}\n" for name, value in constants_of(functions).items())


def copied(functions: Iterable[FunctionType], decorator: str = "@inline\n") -> str:
    """Write the source of copies of functions."""
    return "\n\n".join(f"{decorator}{text_of(function)}" for function in functions)


def decorated(text: str, decorator: str) -> str:
    """Return the source of functions, such as a method's step, each with a decorator in the line before it."""
    lines = text.split("\n")
    for node in reversed(parsed(text).body):
        if isinstance(node, ast.FunctionDef):
            lines.insert(node.lineno - 1, decorator)
    return "\n".join(lines)
