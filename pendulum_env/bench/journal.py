"""Journals: text files of samples, written as they come and readable at any time by ``Recording.read``."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Protocol

from pendulum_env.bench.source import FloatArray, SourceError
from pendulum_env.common.provenance import checked_folder, provenance
from pendulum_env.common.texts import NOTE, clean
from pendulum_env.lab.containers import MARK, NOTED

SYNCED = 1.0
"""Time between two orders to the system to bring the file to the disk [s]; see :class:`Journal`."""


class Titled(Protocol):
    """What gives samples, whose repr stands in the file."""

    @property
    def columns(self) -> tuple[str, ...]:
        """Titles of the columns after the time, with units."""


class Journal:
    """A text file of one run: comments, a line of titles, then one line for each sample.

    Every sample is handed to the system at once, so that it outlives this process, and brought to the disk each second,
    so that it outlives the computer's power. A disk that is full leaves whole lines only. Values are separated by
    commas in a file that ends in .csv, else by tabs.

    Raises FileExistsError if the file exists; with ``force`` it is replaced by the first sample.
    """

    def __init__(self, path: Path, source: Titled, *, force: bool = False) -> None:
        self.path = path
        self._mark = "," if path.suffix.lower() == ".csv" else "\t"
        facts = provenance(source=repr(source), began=datetime.now().astimezone().isoformat(timespec="seconds"))
        comments = [MARK, *(f"# {name}: {' '.join(str(fact).split())}" for name, fact in facts.items())]
        self._head = "\n".join([*comments, self._mark.join(("Time (s)", *source.columns)), ""])
        self._handle, self._end = -1, 0
        self._over = threading.Event()
        self._syncing: threading.Thread | None = None
        path.parent.mkdir(parents=True, exist_ok=True)
        if not (force and path.exists()):
            self._open(os.O_EXCL)
        elif not os.access(path, os.W_OK):
            raise PermissionError(13, "Permission denied", str(path))

    def _open(self, more: int) -> None:
        """Open the file and write its head."""
        self._handle = os.open(self.path, os.O_WRONLY | os.O_CREAT | getattr(os, "O_BINARY", 0) | more, 0o666)
        try:
            self._append(self._head)
        except OSError:
            self.close()
            raise
        self._syncing = threading.Thread(target=self._sync, daemon=True, name="bench-journal")
        self._syncing.start()

    def _sync(self) -> None:
        """Bring the file to the disk each second; a slow disk holds up nobody but this thread."""
        while not self._over.wait(SYNCED):
            with contextlib.suppress(OSError):
                os.fsync(self._handle)

    @property
    def open(self) -> bool:
        """True while the file is open."""
        return self._handle >= 0

    def write(self, time: FloatArray, values: FloatArray) -> None:
        """Append samples: times [s], shape ``(samples,)``, and readings, shape ``(samples, columns)``.

        Raises OSError if the disk is full; the file then ends with the last sample that had room.
        """
        rows = zip(time.tolist(), values.tolist(), strict=True)
        self._append("".join(f"{t:.6f}{self._mark}" + self._mark.join(f"{v:.10g}" for v in row) + "\n"
                             for t, row in rows))

    def note(self, text: str) -> None:
        """Append a comment that ``Recording.read`` puts into the recording's notes; a later one with the same words
        before the colon replaces it."""
        if self._handle >= 0:
            self._append(f"{NOTED}{clean(text, NOTE)}\n")

    def _append(self, text: str) -> None:
        """Write lines; on an error cut a line that was begun."""
        if self._handle < 0:
            self._open(os.O_TRUNC)
        left = memoryview(text.encode())
        try:
            while left:
                left = left[os.write(self._handle, left):]
        except OSError:
            written = text.encode()[:len(text.encode()) - len(left)]
            self._end += written.rfind(b"\n") + 1
            with contextlib.suppress(OSError):  # a device, which has no length
                os.ftruncate(self._handle, self._end)
            raise
        self._end += len(text.encode())

    def close(self) -> None:
        """Close the file; closing twice is allowed."""
        self._over.set()
        if self._syncing is not None:
            self._syncing.join()
            self._syncing = None
        handle, self._handle = self._handle, -1
        if handle >= 0:
            try:
                os.fsync(handle)
            except OSError:  # a device, or a disk that is full: what could be written is written
                pass
            finally:
                os.close(handle)


def numbered(path: Path, word: str = "") -> Iterator[Path]:
    """Yield names beside a path: swing-run1.csv, swing-run2.csv, ...; without a word swing.csv, swing-2.csv, ..."""
    if not word:
        yield path
    for i in range(1 if word else 2, 100_000):
        yield path.with_name(f"{path.stem}-{word}{i}{path.suffix}")


def check_new(path: Path, force: bool) -> None:
    """Check, before anything is opened, that a run may be written to a file.

    Raises SourceError for a folder and, without ``force``, an existing file; OutputError for a folder that cannot be
    written to.
    """
    if path.is_dir():
        raise SourceError(f"{path} is a folder; give a file's name, as {path / 'swing.csv'}")
    if path.exists() and not force:
        raise SourceError(f"{path} exists already; choose another name, or replace it by --force")
    checked_folder(path.parent)
