"""Files of Logger Pro (.cmbl, XML): the columns of each data set, with their names and units.

A data set has columns with ``DataObjectName``, ``ColumnUnits`` and ``ColumnCells``, a value in each line; cells that
are no number, such as "Z1 1:", stand for values that are missing. Built from descriptions of the format; no file of the
program itself was seen.
"""

from __future__ import annotations

from xml.etree.ElementTree import Element

from pendulum_env.lab.arrays import LEAST, Tables
from pendulum_env.lab.checked import RecordingError
from pendulum_env.lab.decoding import check, tree_of

MARK = "<ColumnCells>"
"""What stands in every file of Logger Pro with data, and in no other."""


def logger_pro_tables(name: str, text: str) -> Tables:
    """Return the table of every data set with numbers. Raises ParseError for text that is not XML, RecordingError for a
    column with more text than numbers."""
    tables: Tables = {}
    for number, data in enumerate(tree_of(name, text).iter("DataSet"), 1):
        titles, columns = list[str](), list[list[str]]()
        for column in data.findall("DataColumn"):
            title, unit = _text(column, "DataObjectName"), _text(column, "ColumnUnits")
            cells = [cell.strip() for cell in (column.findtext("ColumnCells") or "").strip("\n").split("\n")]
            values = [cell if _is_number(cell) else "" for cell in cells]
            if (found := sum(map(bool, values))) < LEAST:
                if sum(map(bool, cells)) >= LEAST:
                    raise RecordingError(f"{name}: column {title!r}: expected numbers with decimal points, found "
                                         f"{next(filter(None, cells))[:40]!r}; export the data as CSV")
                continue
            if 2 * found < sum(map(bool, cells)):
                raise RecordingError(f"{name}: column {title!r}: more than half of its cells are no numbers")
            titles.append(f"{title} ({unit})" if unit else title)
            columns.append(values)
        if columns:
            check(name, "columns", len(columns))
            rows = max(map(len, columns))
            whole = [[*column, *[""] * (rows - len(column))] for column in columns]
            tables[_text(data, "DataSetName") or f"data set {number}"] = titles, whole
    return tables


def _text(item: Element, key: str) -> str:
    """Return the text of a child, in one line."""
    return " ".join((item.findtext(key) or "").split())


def _is_number(cell: str) -> bool:
    """Return True for the text of a number."""
    try:
        float(cell)
    except ValueError:
        return False
    return "_" not in cell
