"""Journals of live acquisitions: files that may end in the middle of a line, because a run was cut off."""

from __future__ import annotations

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
