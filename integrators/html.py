"""HTML for notebooks: a titled block with tables. It has no scripts, and the page's own colours, light or dark."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from html import escape

BLOCK = "overflow-x: auto; max-width: 100%"
"""Style of a block: wide tables scroll inside it."""
CELL = "text-align: left; vertical-align: top; padding: 0.1em 0.8em 0.1em 0; font-size: inherit"
"""Style of a table's cells."""
WHOLE = 30
"""Number of characters up to which a cell is not broken into lines."""
ROWS = 12
"""Largest number of rows of a table that are shown."""


def text(words: str) -> str:
    """Return a text as HTML in which nothing is markup, and no notebook takes what stands between two ``$`` for
    mathematics; U+FFFD stands for bytes that are not UTF-8 (surrogates)."""
    plain = words.encode("utf-16", "surrogatepass").decode("utf-16", "replace")
    # MathJax joins no text across elements, so that a $ or a backslash within one begins and ends no formula.
    return re.sub(r"[$\\]", r"<span>\g<0></span>", escape(plain))


def block(title: str, *parts: str) -> str:
    """Return a block of HTML with a title, which is escaped, and parts, which are HTML; empty parts are left out."""
    return f'<div style="{BLOCK}"><div><b>{text(title)}</b></div>{"".join(filter(None, parts))}</div>'


def words(paragraphs: str) -> str:
    """Return a text as paragraphs of HTML, one for each line; "" for an empty text."""
    lines = (line.strip() for line in paragraphs.splitlines())
    return "".join(f'<p style="margin: 0.3em 0; max-width: 50em">{text(line)}</p>' for line in lines if line)


def facts(pairs: Iterable[tuple[str, str]]) -> str:
    """Return a table of two columns, name and value, without the pairs whose value is empty."""
    return table((), [pair for pair in pairs if pair[1]], most=None)


def table(head: Sequence[str], rows: Sequence[Sequence[str]], most: int | None = ROWS, rest: str = "") -> str:
    """Return a table of texts, which are escaped.

    Of more than ``most`` rows (None: of any number) only the first are shown, and a line below says how many there are;
    ``rest`` says where the others can be read.
    """
    cut = rows if most is None or len(rows) <= most else rows[:most]
    top = f"<thead><tr>{_cells('th', head)}</tr></thead>" if head else ""
    body = "".join(f"<tr>{_cells('td', row)}</tr>" for row in cut)
    left = f"The first {len(cut)} of {len(rows)} rows{f'; {rest}' if rest else ''}." if len(cut) < len(rows) else ""
    return f'<table style="border-collapse: collapse">{top}<tbody>{body}</tbody></table>{words(left)}'


def _cells(tag: str, texts: Iterable[str]) -> str:
    """Return the cells of one row of a table; ``tag`` is "td", or "th" for cells of the head."""
    styles = ((cell, f"{CELL}; white-space: {'nowrap' if len(cell) <= WHOLE else 'normal'}") for cell in texts)
    return "".join(f'<{tag} style="{style}">{text(cell)}</{tag}>' for cell, style in styles)
