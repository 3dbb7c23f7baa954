"""Files from outside: the largest that are read, and one error for all that are damaged.

A damaged or malicious file must neither fill the memory nor end in an error of one of the many decoders: zip archives
alone raise errors of zlib, lzma, bz2, struct and zipfile. ``LAB_PENDULUM_LIMITS=off`` lifts the limits.
"""

from __future__ import annotations

import os
import re
import sys
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, NamedTuple
from xml.etree.ElementTree import Element, TreeBuilder, XMLParser
from xml.parsers import expat

from pendulum_env.lab.checked import RecordingError

VARIABLE = "LAB_PENDULUM_LIMITS"
"""Environment variable that lifts the limits of files if it is "off"."""
CHUNK = 2**20
"""Bytes of an archive's file that are looked at together."""


class Limits(NamedTuple):
    """Largest files that are read.

    Attributes:
        bytes: of a file, and of all that is read from an archive or a workbook once it is unpacked.
        rows: lines of a text, or rows of a sheet.
        columns: of a table.
        characters: of a line.
        cells: of a sheet from its first to its last row and column, empty ones included.
        entries: files in an archive.
        nesting: of the elements of a Tracker project in each other.
    """

    bytes: int = 2**28
    rows: int = 5_000_000
    columns: int = 1000
    characters: int = 100_000
    cells: int = 20_000_000
    entries: int = 10_000
    nesting: int = 100


LIFTED = Limits(*[sys.maxsize] * len(Limits()))


def limits() -> Limits:
    """Return the limits that hold now; RecordingError for a value of LAB_PENDULUM_LIMITS other than "on" and "off"."""
    named = os.environ.get(VARIABLE, "on")
    if named not in ("on", "off"):
        raise RecordingError(f"{VARIABLE} must be 'on' or 'off', not {named!r}")
    return LIFTED if named == "off" else Limits()


def check(name: str, what: str, size: int) -> None:
    """Raise RecordingError if a file has more ``what``, an attribute of Limits, than is allowed."""
    most = getattr(limits(), what)
    if size > most:
        raise RecordingError(f"{name}: expected at most {most} {what}, found more; for a file that you trust, set the "
                             f"environment variable {VARIABLE}=off")


def _read(file: IO[bytes]) -> bytes:
    """Return the bytes of an open file, or somewhat more of them than are allowed."""
    found, left = [], limits().bytes
    while left >= 0 and (chunk := file.read(CHUNK)):  # read(n) may take room for n bytes at once
        found.append(chunk)
        left -= len(chunk)
    return b"".join(found)


@contextmanager
def decoding(name: str, kind: str = "a recording's file") -> Iterator[None]:
    """Raise RecordingError in place of any error of a decoder, for a file that is damaged or of another kind.

    A decoder in Rust that gives up raises its own kind of BaseException, PanicException.
    """
    try:
        yield
    except RecordingError:
        raise
    except BaseException as error:
        if not isinstance(error, Exception) and type(error).__name__ != "PanicException":
            raise
        reason = f"{type(error).__name__}: {error}".splitlines()[0].rstrip(": ")[:200]
        raise RecordingError(f"{name}: expected {kind}, found binary data, or a damaged or encrypted file ({reason})"
                             ) from error


def contents(name: str) -> bytes:
    """Return the bytes of a file, which may also be a pipe; RecordingError for a file that cannot be read."""
    try:
        with Path(name).open("rb") as file:
            data = _read(file)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise RecordingError(f"{name}: expected a file that can be read: {reason}") from error
    check(name, "bytes", len(data))
    return data


def opened(name: str, file: Any) -> zipfile.ZipFile:
    """Return a zip archive after a check of the number of its entries."""
    archive = zipfile.ZipFile(file)
    check(name, "entries", len(archive.infolist()))
    return archive


def unpacked(name: str, archive: zipfile.ZipFile, entry: str) -> bytes:
    """Return the bytes of a file in an archive, whose size is not taken from the archive's own words."""
    with archive.open(entry) as file:
        data = _read(file)
    check(f"{name}/{entry}", "bytes", len(data))
    return data


def first_line(archive: zipfile.ZipFile, entry: str) -> str:
    """Return the first line of a text in an archive, cut off after the characters that a line may have."""
    with archive.open(entry) as file:
        return file.readline(int(min(limits().characters, 2**20))).decode("utf-8-sig", "replace")


def check_text(name: str, text: str) -> None:
    """Raise RecordingError for a text with too many lines, too long ones, or too many columns."""
    check(name, "rows", text.count("\n"))
    most = limits()
    for line in text.splitlines():
        if len(line) >= min(2 * most.columns, most.characters):  # a column takes two characters
            check(name, "characters", len(line))
            if not line.lstrip().startswith("#"):
                check(name, "columns", max(len(line.split(mark)) for mark in ("\t", ";", ",", None)))


_REFERENCE = re.compile(rb"""[\s"']r\s*=\s*["']([A-Za-z]*)(\d+)["']""")
"""The place of a cell in a sheet of a workbook (.xlsx), such as r="B12", or of a row."""


def check_workbook(name: str, archive: zipfile.ZipFile) -> None:
    """Raise RecordingError for a workbook whose sheets are too large: readers allocate all cells up to the last one."""
    left = limits().bytes
    for entry in archive.infolist():
        size = _Opened()
        with archive.open(entry) as file:
            rest = b""
            while chunk := file.read(CHUNK):
                left -= len(chunk)
                check(name, "bytes", limits().bytes - left)
                if entry.filename == "content.xml":
                    size.feed(chunk)
                elif entry.filename.lower().endswith(".xml"):
                    for letters, row in _REFERENCE.findall(rest + chunk):
                        size.reach(int(row[:12]), _column(letters))
                    rest = chunk[-64:]
        for what, found in (("rows", size.rows), ("columns", size.columns), ("cells", size.rows * size.columns)):
            check(f"{name}/{entry.filename}", what, found)


def _column(letters: bytes) -> int:
    """Return the number of a column, from 1 on, for its letters, such as b"XFD"; 0 for no letters."""
    number = 0
    for letter in letters[:8].upper():
        number = 26 * number + letter - 64
    return number


class _Opened:
    """Rows and columns of a sheet up to the last cell with a value, of OpenDocument sheets by their repetitions."""

    def __init__(self) -> None:
        self.rows = self.columns = self._row = self._column = 0
        self._repeated = 1
        self._parser = expat.ParserCreate()
        self._parser.StartElementHandler = self._start

    def reach(self, row: int, column: int) -> None:
        """Take note of a cell with a value."""
        self.rows, self.columns = max(self.rows, row), max(self.columns, column)

    def feed(self, chunk: bytes) -> None:
        """Read on in the sheets of a document (.ods)."""
        self._parser.Parse(chunk)

    def _start(self, element: str, given: dict[str, str]) -> None:
        if element == "table:table":
            self._row = self._column = 0
        elif element == "table:table-row":
            self._row, self._column = self._row + self._repeated * (self._row > 0), 0
            self._repeated = int(given.get("table:number-rows-repeated", "1")[:12])
            self._row = self._row or 1
        elif element in ("table:table-cell", "table:covered-table-cell"):
            self._column += int(given.get("table:number-columns-repeated", "1")[:12])
            if "office:value-type" in given:
                self.reach(self._row + self._repeated - 1, self._column)


class _Nested(TreeBuilder):
    """A builder of trees of XML that refuses elements nested too deeply, which take minutes to search."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self._name, self._depth, self._most = name, 0, limits().nesting

    def start(self, tag: Any, attrs: Any, /) -> Element:
        """Open an element."""
        self._depth += 1
        if self._depth > self._most:
            check(self._name, "nesting", self._depth)
        return super().start(tag, attrs)

    def end(self, tag: Any, /) -> Element:
        """Close an element."""
        self._depth -= 1
        return super().end(tag)


def tree_of(name: str, text: str) -> Element:
    """Return the tree of a text of XML; Python's parser opens no files and no addresses."""
    parser = XMLParser(target=_Nested(name))
    parser.feed(text)
    found: Element = parser.close()
    return found
