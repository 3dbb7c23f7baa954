r"""Text from outside the package (names of files, titles and notes of recordings, names of scenes), made safe to show.

Such a text becomes one printable line where it comes in, by :func:`clean`; where it goes out it is escaped for its
target: by :func:`for_csv` and :func:`for_markdown`, for HTML by ``integrators.html.text``, and for figures by
``pendulum_env.plots.titles.for_figure``. A text for a stream of another encoding than UTF-8 goes through
:func:`in_encoding`. A :class:`Table` of texts can be written as Markdown and as CSV.
"""

from __future__ import annotations

import codecs
import csv
import io
import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass

LONGEST = 100
"""Largest number of characters of a name, and of a value in an error message."""
NOTE = 1000
"""Largest number of characters of a note on how a recording was read."""
FORMULA = re.compile(r"[=@]|[+-].*(?:[|!]|[A-Za-z]\s*\()")
"""Beginning of a cell that a spreadsheet takes for a formula that calls a function or a program; numbers and formulas
of errors such as "+(omega0 h)^2/24" are none."""
MARKDOWN = re.compile(r"[\\|`$]|(?<=\S)\*|\*(?=\S)|<(?=[\w/!?])|\](?=[(\[:])|(?<!\w)_|_(?!\w)")
"""Characters with a meaning within a cell of a Markdown table. An asterisk or a "<" has none before and after a space,
a bracket where no link follows, and an underscore within a word."""

WORDS = {
    "²": "^2", "³": "^3", "±": "+-", "·": "*", "°": " deg", "—": "-", "…": "...", "→": "->", "←": "<-", "≤": "<=",
    "≥": ">=", "≈": "~", "≠": "!=", "∞": "inf", "∝": "~", "√": "sqrt", "½": "1/2", "¼": "1/4", "¾": "3/4",
    "‰": " per mille", "µ": "u", "“": '"', "”": '"', "„": '"', "•": "*", "∂": "d", "∫": "int", "ß": "ss", "æ": "ae",
    "Æ": "Ae", "ø": "o", "Ø": "O", "ł": "l", "Ł": "L", "\N{MULTIPLICATION SIGN}": "x", "\N{MINUS SIGN}": "-",
    "\N{EN DASH}": "-", "\N{LEFT SINGLE QUOTATION MARK}": "'", "\N{RIGHT SINGLE QUOTATION MARK}": "'",
}
"""Characters -> what stands for them in an encoding that lacks them. Greek letters become their names, lines of tables
and bars become -, | and +, and letters with accents lose them."""
LINES = {"HORIZONTAL": "-", "VERTICAL": "|"}
"""Words in the Unicode names of the characters that draw lines -> what stands for them."""


def shortened(text: str, most: int) -> str:
    """Return a text of at most ``most`` characters: of a longer one the beginning and the end, with dots between."""
    if len(text) <= most:
        return text
    end = min((most - 3) // 3, 24)  # the ending of a file's name and its number stay
    return f"{text[: most - 3 - end]}...{text[len(text) - end :]}"


def clean(text: str, most: int | None = LONGEST) -> str:
    """Return a text from outside as one line of printable characters, shortened to ``most``; None: any length.

    White space becomes a single space. Every other character that cannot be printed, such as one that moves a
    terminal's cursor, and bytes of a file's name that are not UTF-8 (surrogates), become U+FFFD.
    """
    if not text.isprintable():
        text = "".join(c if c.isprintable() else " " if c.isspace() else "\N{REPLACEMENT CHARACTER}" for c in text)
        text = " ".join(text.split())
    return text if most is None else shortened(text, most)


def listed(names: Sequence[str], most: int = LONGEST) -> str:
    """Return names with commas between them, in at most ``most`` characters: the first, and how many there are more."""
    for count in range(len(names), 0, -1):
        rest = f" and {len(names) - count} more" if count < len(names) else ""
        text = ", ".join(names[:count])
        if len(text) + len(rest) <= most or count == 1:
            return f"{shortened(text, most - len(rest))}{rest}"
    return ""


def for_csv(text: str) -> str:
    """Return a text as a cell in a CSV file that no spreadsheet runs: an apostrophe stands before a formula."""
    return f"'{text}" if FORMULA.match(text) else text


def for_markdown(text: str) -> str:
    """Return a text as a cell of a Markdown table: one line, its characters with a meaning behind a backslash."""
    return MARKDOWN.sub(lambda mark: f"\\{mark[0]}", " ".join(text.split()))


def in_encoding(text: str, encoding: str | None) -> str:
    """Return a text with words for the characters that an encoding lacks, such as "omega" for the letter.

    For an encoding that is unknown or None, the text is that for ASCII.
    """
    try:
        codec = codecs.lookup(encoding or "ascii")
        codec.encode(text)
    except LookupError:
        return in_encoding(text, "ascii")
    except UnicodeEncodeError:
        return "".join(c if _has(codec, c) else _word(c) for c in text)
    return text


def replaced(error: UnicodeError) -> tuple[str, int]:
    """Return the words for characters that a stream's encoding lacks, and where it goes on: a handler of errors."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(map(_word, error.object[error.start : error.end])), error.end


def _has(codec: codecs.CodecInfo, letter: str) -> bool:
    """Return True if an encoding has a character."""
    try:
        codec.encode(letter)
    except UnicodeEncodeError:
        return False
    return True


def _word(letter: str) -> str:
    """Return what stands for a character, in ASCII; a question mark for one that has nothing."""
    name = unicodedata.name(letter, "")
    if letter in WORDS:
        return WORDS[letter]
    if name.startswith("GREEK") and " LETTER " in name:
        word = name.split(" LETTER ")[1].split()[0].lower().replace("lamda", "lambda")
        return word.capitalize() if "CAPITAL" in name else word
    if name.startswith("BOX DRAWINGS"):
        kinds = [line for word, line in LINES.items() if word in name]
        return kinds[0] if len(kinds) == 1 else "+"
    plain = unicodedata.normalize("NFKD", letter).encode("ascii", "ignore").decode()
    return plain or "?"


@dataclass(frozen=True)
class Table:
    """A table of text: the heads of its columns, and its rows."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def markdown(self) -> str:
        """Return the table as Markdown."""
        lines = [self.head, tuple("---" for _ in self.head), *self.rows]
        return "\n".join(f"| {' | '.join(map(for_markdown, line))} |" for line in lines)

    def csv(self) -> str:
        """Return the table as CSV text; every line ends with a newline."""
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows([map(for_csv, line) for line in (self.head, *self.rows)])
        return text.getvalue()
