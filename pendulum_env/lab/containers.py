"""The text of a recording's file: plain text, or the table in an archive, a workbook, or a file of another program.

Journals of live acquisitions are plain text that may end in the middle of a line, because a run was cut off.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from pendulum_env.lab import arrays, logger_pro, microbit, phyphox
from pendulum_env.lab.checked import RecordingError, chosen
from pendulum_env.lab.decoding import (
    check,
    check_text,
    check_workbook,
    contents,
    decoding,
    first_line,
    opened,
    unpacked,
)
from pendulum_env.lab.quantities import ANGLE, CORRELATION, DISTANCE, FORCE, GATE, PERIOD, RATE, TRACK
from pendulum_env.physics.units import shown

MARK = "# LabPendulum journal, written as samples came"
"""First line of a journal."""
NOTED = "# note: "
"""Beginning of the comments of a journal that belong to the notes of its recording."""


def is_journal(data: bytes) -> bool:
    """Return True if the bytes of a file are those of a journal."""
    return data.startswith(MARK.encode())


def whole_lines(data: bytes) -> tuple[bytes, list[str]]:
    """Return a journal up to its last whole line, and its notes.

    A line without an end was cut off with the power or the process, perhaps within a number: it is no sample. After the
    power failed, blocks may be filled with zeros; what follows them is left out, too. Of notes with the same words
    before the colon the last one counts.
    """
    end = data.find(b"\0")
    whole = data[:end if end >= 0 else None]
    whole = whole[:whole.rfind(b"\n") + 1]
    lines = whole.decode("utf-8", "replace").splitlines()
    notes = {line.removeprefix(NOTED).partition(":")[0]: line.removeprefix(NOTED)
             for line in lines if line.startswith(NOTED)}
    cut = ["journal: its last line was cut off, and is left out"] if len(whole) < len(data) else []
    return whole, [*cut, *notes.values()]


_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f]")
_OLD_WORKBOOK = b"\xd0\xcf\x11\xe0"
"""First bytes of a workbook of Excel 97 (.xls)."""
_TABLES = (".csv", ".txt", ".tsv", ".dat")
_META = re.compile(r"(?:^|/)(?:meta|__MACOSX)/|(?:^|/)\.", re.IGNORECASE)
"""Names in archives of files that describe the device, such as those of phyphox."""
SENSED = (ANGLE, RATE, FORCE, DISTANCE, TRACK, GATE, PERIOD)
"""Quantities of which a sensor gives readings."""
_LEAST = 3
"""Fewest rows of numbers of a sheet that holds a recording."""


class FileFormat(NamedTuple):
    """A format of files that are not plain tables of text, as a row of the table of formats.

    Attributes:
        name: the format, with the program or device that writes it.
        endings: endings of its files' names; what a file is, its first bytes say.
        reading: how it is read, and what is refused.
    """

    name: str
    endings: str
    reading: str

    @property
    def cells(self) -> tuple[str, str, str, str]:
        """Row of the table of formats, under the titles quantity, words, units, and how it is read."""
        return self.name, self.endings, "-", self.reading


UNSEEN = "built from its description, never seen from a real device"
"""What the row of a format says of which no file of the device or program was at hand."""
FORMATS = (
    FileFormat("archive", ".zip", "the table with a sensor's readings; part= chooses another one"),
    FileFormat("workbook", ".xlsx, .xls, .ods", "the sheet with a sensor's readings; part= chooses another one; needs "
               "pip install 'lab-pendulum[sheets]'"),
    FileFormat("Tracker project", ".trk", "the track of the point mass; of several, part= chooses one"),
    FileFormat("Logger Pro", ".cmbl", "the columns of the data set, with their names and units; of several data sets, "
               f"part= chooses one; refused: columns of text ({UNSEEN})"),
    FileFormat("phyphox with data", ".phyphox", "the table that phyphox would export, with a sensor's readings; "
               f"refused: an experiment without data: save its state after the measurement ({UNSEEN})"),
    FileFormat("micro:bit log", "MY_DATA.HTM, .csv", "the table of the log; acc x, acc y, acc z in milli-g are an "
               "acceleration; of several tables, part= chooses one; refused: a log without data: unplug the micro:bit, "
               f"plug it in and copy the file again ({UNSEEN})"),
    FileFormat("MATLAB", ".mat", "vectors of one length are columns, named as the variables; refused: version 7.3, "
               "structures and tables: save the vectors by save('swing.mat', 't', 'angle', '-v7')"),
    FileFormat("NumPy", ".npz, .npy", "arrays of one length are columns, named as the arrays; refused: arrays of "
               "Python objects, which are never unpickled: save numbers"),
)
"""The formats of files that are not plain tables of text."""


def text_of(name: str, part: str | None = None) -> tuple[str, list[str]]:
    """Return the text of a file with a table, and notes on where the table was.

    A text may be UTF-16 with a byte-order mark, UTF-8, or else Latin-1 (older sensor software). Of a zip archive the
    table of numbers is read, as phyphox exports it; of a workbook (.xlsx, .xls) the sheet; of a Tracker project (.trk)
    the track of a point mass, in metres; :data:`FORMATS` are all formats. Of several tables, such as phyphox's Raw
    Data, Autocorrelation and Resonance, it is the one whose titles name the readings of a sensor.

    Args:
        name: the file's name.
        part: name of the file in an archive, of the sheet, or of the track; None: the only one with numbers, or with
            the readings of a sensor.

    Raises RecordingError for a file that cannot be read, is empty, damaged or larger than
    :class:`pendulum_env.lab.decoding.Limits`, holds other binary data or several tables, and if
    python-calamine and xlrd, which read workbooks, are not installed.
    """
    with decoding(name):
        text, notes = _text(name, contents(name), part)
    check_text(name, text)
    return text, notes


def _text(name: str, data: bytes, part: str | None) -> tuple[str, list[str]]:
    """Return the text with a table that the bytes of a file hold, and notes on where the table was."""
    if data[:4] == b"PK\x03\x04":
        return _unpacked(name, data, part)
    if data[:4] == _OLD_WORKBOOK:
        return _sheet(name, data, part)
    if data.startswith(arrays.NUMPY):
        return _chosen(name, arrays.tables_of(name, {"array": arrays.array_in(name, data)}), part, "NumPy")
    if data.startswith(arrays.MATLAB) or name.lower().endswith(".mat"):
        return _chosen(name, arrays.matlab_tables(name, data), part, "MATLAB")
    if microbit.MARK in data:
        return _chosen(name, microbit.microbit_tables(name, data), part, "micro:bit")
    notes: list[str] = []
    if is_journal(data):
        data, notes = whole_lines(data)
    text = decoded(name, data)
    if text.lstrip()[:5] == "<?xml" and "cabrillo.tracker" in text:
        from pendulum_env.lab.tracker import track_table

        return track_table(name, text, part)
    if text.lstrip().startswith("<"):
        if logger_pro.MARK in text:
            return _chosen(name, logger_pro.logger_pro_tables(name, text), part, "Logger Pro")
        if phyphox.MARK in text:
            return _chosen(name, phyphox.phyphox_tables(name, text), part, "phyphox")
    if part is not None:
        raise RecordingError(f"{name}: part={shown(part)} is for archives, workbooks and projects; this is a file of "
                             "text")
    return text, notes


def decoded(name: str, data: bytes) -> str:
    """Return the text that bytes hold; RecordingError if there is none, or for binary data."""
    try:
        text = data.decode("utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    if not text.strip():
        raise RecordingError(f"{name}: expected lines with a time [s] and an angle, the file is empty")
    if _CONTROL.search(text):
        raise RecordingError(f"{name}: expected a text file, found binary data")
    return text


def _unpacked(name: str, data: bytes, part: str | None) -> tuple[str, list[str]]:
    """Return the text of the table in a zip archive, which may be a workbook, and a note on its name."""
    archive = opened(name, io.BytesIO(data))
    names = archive.namelist()
    if "xl/workbook.xml" in names or "content.xml" in names:
        check_workbook(name, archive)
        return _sheet(name, data, part)
    if names and all(entry.endswith(".npy") for entry in names):
        return _chosen(name, arrays.numpy_tables(name, archive), part, "NumPy")
    tables = [entry for entry in names if entry.lower().endswith(_TABLES) and not _META.search(entry)]
    readings = [entry for entry in tables if _of_a_sensor(re.split(r"[\t;,]", first_line(archive, entry)))]
    entry = chosen(name, "table", tables, part, readings)
    note = f"archive: {entry} is read{_besides(entry, tables, part)}"
    return decoded(f"{name}/{entry}", unpacked(name, archive, entry)), [note]


def _sheet(name: str, data: bytes, part: str | None) -> tuple[str, list[str]]:
    """Return the sheet of a workbook as text with tabs between columns, and a note on its name."""
    try:
        sheets = _old_sheets(name, data) if data[:4] == _OLD_WORKBOOK else _sheets(name, data)
    except ImportError:
        raise RecordingError(f"{name}: reading a workbook needs python-calamine and xlrd; pip install "
                             "'lab-pendulum[sheets]', or save the sheet as CSV") from None
    tables = [title for title, rows in sheets.items() if _numeric(rows) >= _LEAST]
    readings = [title for title in tables if _of_a_sensor(map(_cell, sheets[title][0]))]
    entry = chosen(name, "sheet", tables, part, readings)
    return _tabbed(map(_cell, row) for row in sheets[entry]), [
        f"workbook: sheet {entry} is read{_besides(entry, tables, part)}"]


def _sheets(name: str, data: bytes) -> dict[str, list[list[Any]]]:
    """Return the rows of each sheet of a workbook (.xlsx, .ods) by the sheet's name."""
    from python_calamine import CalamineWorkbook

    book = CalamineWorkbook.from_filelike(io.BytesIO(data))
    check(name, "entries", len(book.sheet_names))
    return {title: book.get_sheet_by_name(title).to_python() for title in book.sheet_names}


def _old_sheets(name: str, data: bytes) -> dict[str, list[list[Any]]]:
    """Return the rows of each sheet of a workbook of Excel 97 to 2003 (.xls) by the sheet's name.

    xlrd reads it, since calamine takes memory for all cells up to the farthest before anybody can look: 13 GB for a
    file of 6 kB with one damaged cell. To xlrd a cell beyond column 256 or row 65536 is an error.
    """
    import xlrd

    book = xlrd.open_workbook(file_contents=data, logfile=io.StringIO(), on_demand=True, ragged_rows=True)
    check(name, "entries", book.nsheets)

    def value(cell: Any) -> Any:
        if cell.ctype == xlrd.XL_CELL_DATE:
            return xlrd.xldate_as_datetime(cell.value, book.datemode)
        return "" if cell.ctype == xlrd.XL_CELL_ERROR else cell.value

    return {sheet.name: [[value(cell) for cell in sheet.row(i)] for i in range(sheet.nrows)] for sheet in book.sheets()}


def _chosen(
    name: str, tables: Mapping[str, tuple[list[str], list[list[str]]]], part: str | None, program: str
) -> tuple[str, list[str]]:
    """Return one of several tables of titles and columns as text with tabs, and a note on its name."""
    readings = [title for title, (titles, _) in tables.items() if _of_a_sensor(titles)]
    entry = chosen(name, "table", list(tables), part, readings)
    titles, columns = tables[entry]
    check(name, "rows", max(map(len, columns)))
    head = [titles] if any(titles) else []
    return _tabbed([*head, *zip(*columns, strict=True)]), [
        f"{program}: {entry} {'are' if ', ' in entry else 'is'} read{_besides(entry, list(tables), part)}"]


def _tabbed(rows: Iterable[Iterable[str]]) -> str:
    """Return rows as text with tabs between columns."""
    lines = io.StringIO()
    csv.writer(lines, delimiter="\t", lineterminator="\n").writerows(rows)
    return lines.getvalue()


def _of_a_sensor(titles: Iterable[str]) -> bool:
    """Return True if the titles of a table name readings of a sensor, and nothing that was calculated from them."""
    names = list(titles)
    return any(quantity.names(title) for title in names for quantity in SENSED) and not any(
        map(CORRELATION.names, names))


def _besides(entry: str, tables: Sequence[str], part: str | None) -> str:
    """Return why one of several tables was read without being given, "" for a given or an only one."""
    others = [table for table in tables if table != entry]
    if part is not None or not others:
        return ""
    return f", which has the sensor's readings (part= chooses {' or '.join(others)})"


def _numeric(rows: Iterable[Sequence[Any]]) -> int:
    """Return the number of rows with at least one number and no text."""
    return sum(any(isinstance(cell, (int, float)) for cell in row)
               and not any(isinstance(cell, str) and cell for cell in row) for row in rows)


def _cell(value: Any) -> str:
    """Return a cell of a workbook as text; numbers keep all digits."""
    return value.isoformat() if hasattr(value, "isoformat") else repr(value) if isinstance(value, float) else str(value)
