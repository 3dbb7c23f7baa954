"""Printing that commands share: messages, progress, tables, files."""

from __future__ import annotations

import codecs
import io
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pendulum_env.common.progress import Progress, progress_bar
from pendulum_env.common.texts import Table, clean, in_encoding, replaced

if TYPE_CHECKING:
    from warnings import WarningMessage

    from pendulum_env.common.results import Result

REPLACED = "lab-pendulum"
"""Name of the handler of characters that an output's encoding lacks."""
LINE = 118
"""Largest number of characters in a line of text."""
Column = tuple[str, ...]
"""Head and cells of a column of a table."""
BETWEEN = 3
"""Characters between two columns of a table: the library rich puts three up to version 14.1, later two."""
EMPTY = ("", "-")
"""Cells that stand for "no value"."""
NARROWEST = 20
"""Smallest number of columns; a terminal that reports fewer is treated as one with this number."""


def open_streams() -> None:
    """Make standard output and error print whatever text: in words what their encoding lacks.

    A stream that is closed, as by ``>&-``, is replaced by one that prints nothing, so that no file that a command opens
    takes its place; for the output, a warning says so.
    """
    codecs.register_error(REPLACED, replaced)
    closed = []
    for handle, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            closed.append(name)
            try:
                os.fstat(handle)
            except OSError:
                os.open(os.devnull, os.O_RDWR)  # takes the lowest free handle, which is the closed stream's own
            setattr(sys, name, open(handle, "w" if handle else "r", encoding="utf-8", closefd=False))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors=REPLACED)
    if "stdout" in closed:
        say("Warning: the standard output is closed, so nothing is printed.")


def printable(text: str, encoding: str | None = None) -> str:
    """Return a text as it can be printed: every line printable, and in words what the encoding lacks.

    The encoding is that of the standard output unless another is given.
    """
    lines = "\n".join(clean(line, None) for line in text.split("\n"))
    return in_encoding(lines, encoding or sys.stdout.encoding)


def say(text: str) -> None:
    """Print a message to stderr, on a terminal wrapped at its width."""
    text = printable(text, sys.stderr.encoding)
    if sys.stderr.isatty():
        from textwrap import fill

        text = "\n".join(fill(line, terminal_width(LINE), subsequent_indent="    ", break_long_words=False,
                              break_on_hyphens=False) for line in text.splitlines())
    print(text, file=sys.stderr)


def print_text(text: str, width: int = LINE, further: str = "    ") -> None:
    """Print a text, its lines wrapped at ``width`` or the terminal's width and continued behind ``further``.

    Short brackets, as in ``(omega0 h)^2``, are not broken.
    """
    import re
    from textwrap import fill

    room = min(width, terminal_width(width))
    for line in printable(text).splitlines():
        kept = re.sub(r"\([^()]{1,24}\)", lambda bracket: bracket[0].replace(" ", "\xa0"), line)
        whole = fill(kept, room, subsequent_indent=further, break_long_words=False, break_on_hyphens=False)
        print(whole.replace("\xa0", " "))


@contextmanager
def bar(title: str) -> Iterator[Progress]:
    """Show a progress bar in a ``with`` block; if interrupted, print that the files written so far are complete."""
    with progress_bar(title) as progress:
        try:
            yield progress
        except KeyboardInterrupt:
            say("Interrupted; files that were already written are complete.")
            raise


@contextmanager
def shown_if_refused(*shows: Callable[[], object]) -> Iterator[None]:
    """Print what was read of a file if the code in a ``with`` block refuses it, because that may explain why.

    Otherwise nothing is printed before all files are saved.
    """
    try:
        yield
    except ValueError:
        for show in shows:
            show()
        raise


def tell_of(warned: Iterable[WarningMessage], besides: str = "") -> None:
    """Print every warning of a fit but those in the text ``besides``, which is printed elsewhere."""
    for warning in warned:
        if issubclass(warning.category, UserWarning) and str(warning.message) not in besides:
            say(f"Warning: {warning.message}")


def print_table(table: Table, title: str = "", below: str = "") -> None:
    """Print a table that fits the terminal, with no number or word cut, and without columns that are empty throughout.

    If the table is too wide, the column named ``below`` is printed as lines below the table, texts are wrapped, and
    columns that still do not fit follow in further parts, after the first column again.
    """
    from rich.console import Console

    console, lines = Console() if sys.stdout.isatty() else Console(width=terminal_width(160)), []
    columns = [tuple(map(printable, column)) for column in zip(table.head, *table.rows, strict=True)]
    columns = [column for i, column in enumerate(columns) if not i or not table.rows or {*column[1:]} - {*EMPTY}]
    if below and _room(columns) > console.width:
        lines = [f"{row}: {text}" for column in columns if column[0] == printable(below)
                 for row, text in zip(columns[0][1:], column[1:], strict=True)]
        columns = [column for column in columns if column[0] != printable(below)]
    for part in _parts(columns, console.width):
        console.print(_shown(part, printable(title), console.width))
        title = ""
    if lines:
        print_text("\n".join([f"{below}:", *lines]))
        print()


def _shown(columns: Sequence[Column], title: str, width: int) -> Any:
    """Return a table for the library rich to print, not wider than ``width``; the widest columns are wrapped first."""
    from rich import box
    from rich.markup import escape
    from rich.table import Table as Shown

    widths, least = _widths(columns), _widths(columns, words=True)
    while sum(widths) + BETWEEN * len(widths) > width and (
            free := [i for i in range(len(widths)) if widths[i] > least[i]]):
        widths[max(free, key=lambda i: widths[i])] -= 1
    shown = Shown(title=title or None, box=box.SIMPLE_HEAD, title_justify="left", collapse_padding=True, pad_edge=False)
    for (name, *_), room in zip(columns, widths, strict=True):
        shown.add_column(escape(name), width=room, overflow="fold")
    for row in zip(*(column[1:] for column in columns), strict=True):
        shown.add_row(*map(escape, row))
    return shown


def _widths(columns: Sequence[Column], words: bool = False) -> list[int]:
    """Return the widths of columns in characters: of the longest cells or, with ``words``, of the longest words.

    A column wrapped between words can be as narrow as its longest word; the first column is never wrapped.
    """
    from rich.cells import cell_len

    return [max(cell_len(part) for cell in column for part in (cell.split() or [""] if words and i else [cell]))
            for i, column in enumerate(columns)]


def _room(columns: Sequence[Column], words: bool = False) -> int:
    """Return the width in characters of a table of these columns, separators included; see :func:`_widths`."""
    return sum(_widths(columns, words)) + BETWEEN * len(columns)


def _parts(columns: Sequence[Column], width: int) -> Iterator[list[Column]]:
    """Split a table into parts no wider than ``width`` characters, each of which repeats the first column."""
    part = [columns[0]]
    for column in columns[1:]:
        if len(part) > 1 and _room([*part, column], words=True) > width:
            yield part
            part = [columns[0]]
        part.append(column)
    yield part


def print_result(
    result: Result, paths: Sequence[Path], as_json: bool = False, *, before: str = "", title: str | None = "",
    below: str = "", after: str | None = None, **more: Any,
) -> None:
    """Print a text, a result's table, another text and the names of its files; or all as JSON, and nothing else.

    Args:
        result, paths: the result of a study, and the files that were written.
        as_json: True prints only JSON: the result's, with "text", "files" and the keys ``more``.
        before, after: texts before and after the table; by default the result's own comes after it.
        title, below: see :func:`print_table`; None prints no table.
    """
    texts = (before, result.text if after is None else after)
    if as_json:
        print(result.to_json(text="\n".join(filter(None, texts)), files=[str(path) for path in paths], **more))
        return
    print_text(before)
    if title is not None:
        print_table(result.table, title, below)
    print_text(texts[1])
    if paths:
        print_files(paths)


def print_files(paths: Iterable[Path]) -> None:
    """Print the names of files that were written, and their folder."""
    paths = list(paths)
    count = "1 file" if len(paths) == 1 else f"{len(paths)} files"
    print_text(f"Wrote {count} to {paths[0].parent}: {', '.join(path.name for path in paths)}")


def terminal_width(otherwise: int = 100) -> int:
    """Return the terminal's width in characters, or ``otherwise`` if it is unknown."""
    from shutil import get_terminal_size

    return max(NARROWEST, get_terminal_size((otherwise, 24)).columns)
