"""Workbooks of Excel 97 to 2003 (.xls), written from the published formats, without knowing how they are read.

The container is a compound file (Microsoft, [MS-CFB]): sectors of 512 bytes with a table of the next sector of each.
The only stream in it is the workbook in BIFF8 records (Microsoft, [MS-XLS]).
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from datetime import datetime, timedelta

Row = Sequence[str | float | datetime]
MAGIC = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
SECTOR = 512
FREE, END, FAT = 0xFFFFFFFF, 0xFFFFFFFE, 0xFFFFFFFD
BOF, EOF, CODEPAGE, BOUNDSHEET, DIMENSIONS, NUMBER, LABEL, XF = 0x809, 0x0A, 0x42, 0x85, 0x200, 0x203, 0x204, 0xE0
GLOBALS, SHEET = 0x0005, 0x0010


def old_workbook(sheets: Sequence[tuple[str, Sequence[Row]]]) -> bytes:
    """The bytes of a workbook of these sheets."""
    return compound(biff(sheets))


def record(kind: int, data: bytes) -> bytes:
    """A record of BIFF8."""
    return struct.pack("<HH", kind, len(data)) + data


def begin(kind: int) -> bytes:
    """The record with which the globals or a sheet begin."""
    return record(BOF, struct.pack("<HHHHII", 0x0600, kind, 0x0DBB, 0x07CC, 0, 6))


def text(value: str, size: str) -> bytes:
    """A string: the number of characters as one or two bytes, 1 for two bytes a character, and the characters."""
    return struct.pack(f"<{size}B", len(value), 1) + value.encode("utf-16-le")


def cells(rows: Sequence[Row]) -> bytes:
    """A sheet of numbers, texts and dates, which are days since the end of 1899 in the format of dates."""
    wide = max(map(len, rows))
    found = [begin(SHEET), record(DIMENSIONS, struct.pack("<IIHHH", 0, len(rows), 0, wide, 0))]
    for i, row in enumerate(rows):
        for j, value in enumerate(row):
            date = isinstance(value, datetime)
            place = struct.pack("<HHH", i, j, date)
            if isinstance(value, datetime):
                value = (value - datetime(1899, 12, 30)) / timedelta(days=1)
            found.append(record(LABEL, place + text(value, "H")) if isinstance(value, str)
                         else record(NUMBER, place + struct.pack("<d", value)))
    return b"".join([*found, record(EOF, b"")])


def biff(sheets: Sequence[tuple[str, Sequence[Row]]]) -> bytes:
    """The stream of a workbook: its globals with the place of each sheet, then the sheets."""
    bodies = [cells(rows) for _, rows in sheets]
    formats = [record(XF, struct.pack("<HH16s", 0, number, b"")) for number in (0, 22)]  # general; date and time

    def front(places: Sequence[int]) -> bytes:
        names = [record(BOUNDSHEET, struct.pack("<IH", place, 0) + text(name, "B"))
                 for place, (name, _) in zip(places, sheets, strict=True)]
        return b"".join([begin(GLOBALS), record(CODEPAGE, struct.pack("<H", 1200)), *formats, *names, record(EOF, b"")])

    place = len(front([0] * len(sheets)))
    places = []
    for body in bodies:
        places.append(place)
        place += len(body)
    return front(places) + b"".join(bodies)


def compound(stream: bytes) -> bytes:
    """A compound file whose only stream is "Workbook"; a stream shorter than 4096 bytes is filled up with zeros."""
    stream = stream.ljust(4096, b"\0")
    stream = stream.ljust(-(-len(stream) // SECTOR) * SECTOR, b"\0")
    count = len(stream) // SECTOR
    tables = 1
    while tables * (SECTOR // 4) < tables + 1 + count:
        tables += 1
    chain = [FAT] * tables + [END] + [tables + 2 + i for i in range(count)]
    chain[-1] = END
    chain += [FREE] * (tables * SECTOR // 4 - len(chain))
    head = struct.pack("<8s16sHHHHHHIIIIIIIIII", MAGIC, b"", 0x3E, 3, 0xFFFE, 9, 6, 0, 0, 0, tables,
                        tables, 0, 4096, END, 0, END, 0)
    places = [*range(tables), *([FREE] * (109 - tables))]
    entries = [entry("Root Entry", 5, END, 0, 1), entry("Workbook", 2, tables + 1, len(stream), FREE)]
    folder = b"".join(entries).ljust(SECTOR, b"\0")
    return head + struct.pack("<109I", *places) + struct.pack(f"<{len(chain)}I", *chain) + folder + stream


def entry(name: str, kind: int, first: int, size: int, child: int) -> bytes:
    """An entry of the compound file's folder."""
    title = name.encode("utf-16-le")
    return struct.pack("<64sHBBIII16sIQQIQ", title, len(title) + 2, kind, 1, FREE, FREE, child, b"", 0, 0, 0, first,
                       size)
