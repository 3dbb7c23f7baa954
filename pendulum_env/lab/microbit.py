"""Logs of a micro:bit (MY_DATA.HTM): the tables of comma-separated values behind the page.

Behind ``UBIT_LOG_FS_V_002`` the file says in hexadecimal numbers where its data begin; they end at the first byte 0xFF.
A line of titles begins a new table whenever the program adds a column. Built from the sources of the micro:bit's log
(CODAL) and of its viewer; no file of a device was seen.
"""

from __future__ import annotations

from pendulum_env.lab.arrays import Tables
from pendulum_env.lab.checked import RecordingError

MARK = b"UBIT_LOG_FS_V_"
"""What stands before the addresses in a log."""
_HEADER = 0x800
"""Bytes before the mark, from whose end on the addresses count."""
_PLACE = slice(29, 39)
"""Where behind the mark the address of the data stands."""
_END = b"\xff\x00"
"""Bytes with which unused memory is filled."""


def microbit_tables(name: str, data: bytes) -> Tables:
    """Return the tables of a micro:bit's log; RecordingError for one without data, or with a damaged address."""
    mark = data.rindex(MARK)
    try:
        start = mark + int(data[mark:][_PLACE], 16) - _HEADER
    except ValueError:
        raise RecordingError(f"{name}: expected the address of the data of a micro:bit's log, found none: the file is "
                             "damaged; copy MY_DATA.HTM from the micro:bit again, or download the CSV from its page"
                             ) from None
    end = min((place for byte in _END if (place := data.find(bytes([byte]), start)) >= 0), default=len(data))
    tables: Tables = {}
    for line in data[max(start, 0):end].decode("utf-8", "replace").splitlines() if start > mark else []:
        fields = [field.strip() for field in line.split(",")]
        if not line.strip():
            continue
        if not any(map(_is_number, fields)):
            tables.setdefault(", ".join(fields), (fields, [[] for _ in fields]))
            current = tables[", ".join(fields)][1]
        elif tables and len(fields) <= len(current):
            for column, value in zip(current, [*fields, *[""] * (len(current) - len(fields))], strict=True):
                column.append(value)
        else:
            raise RecordingError(f"{name}: expected {len(current) if tables else 'titles before'} values in a line of "
                                 f"the log, found {line[:60]!r}")
    found = {title: table for title, table in tables.items() if table[1][0]}
    if not found:
        raise RecordingError(f"{name}: this log of a micro:bit holds no data; copy MY_DATA.HTM again after the "
                             "micro:bit was unplugged and plugged in")
    return found


def _is_number(field: str) -> bool:
    """Return True for the text of a number."""
    try:
        float(field)
    except ValueError:
        return False
    return True
