"""Experiments of phyphox with data (.phyphox, XML): the tables that phyphox would export.

phyphox (Staacks et al. 2018, Phys. Educ. 53, 045009) keeps values in containers; a saved state has them in the
attribute ``init``. A set of its export names the containers of a table, and their titles. Built from the app's sources;
no file of a phone was seen.
"""

from __future__ import annotations

from pendulum_env.lab.arrays import LEAST, Tables
from pendulum_env.lab.checked import RecordingError
from pendulum_env.lab.decoding import check, tree_of

MARK = "<phyphox"
"""First element of an experiment of phyphox."""


def phyphox_tables(name: str, text: str) -> Tables:
    """Return the table of every set of the export that has data.

    Raises ParseError for text that is not XML, RecordingError for an experiment without data, and for a table whose
    columns have different lengths.
    """
    root = tree_of(name, text)
    values = {(one.text or "").strip(): [part.strip() for part in one.get("init", "").split(",") if part.strip()]
              for one in root.iter("container")}
    tables: Tables = {}
    for number, each in enumerate(root.iter("set"), 1):
        titles, columns = list[str](), list[list[str]]()
        for one in each.findall("data"):
            column, unit = values.get((one.text or "").strip(), []), one.get("unit", "")
            if column:
                title = one.get("name", "")
                titles.append(f"{title} ({unit})" if unit and "(" not in title else title)
                columns.append(column)
        lengths = {len(column) for column in columns}
        if max(lengths, default=0) < LEAST:
            continue
        title = each.get("name") or f"set {number}"
        if len(lengths) > 1:
            raise RecordingError(f"{name}: {title}: expected columns of one length, found {min(lengths)} to "
                                 f"{max(lengths)} values; export the data in phyphox as CSV")
        check(name, "columns", len(columns))
        tables[title] = titles, columns
    if not tables:
        raise RecordingError(f"{name}: this phyphox experiment holds no data; in phyphox choose Save experiment state "
                             "after the measurement, or Export data as CSV")
    return tables
