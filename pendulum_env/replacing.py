"""Files that are whole or not there: written under another name beside their place, then moved there.

A process that is killed leaves the other name behind, hidden and harmless: ``.<stem>-part-<8 letters><ending>``. The
next that writes the same file removes it.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from glob import escape
from pathlib import Path

MARK = "-part-"
FRESH = 60.0
"""Seconds since its last change for which a part is left alone: its writer may not have its lock yet."""


class OutputError(OSError):
    """A folder or file that cannot be written."""


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary path beside ``path``, with its ending, that takes its place on success and leaves no trace else.

    OutputError where the file cannot be written.
    """
    _clear(path)
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}{MARK}", suffix=path.suffix)
    except OSError as error:
        raise _unwritable(path, error) from None
    temporary = Path(name)
    try:
        try:
            _lock(handle)
            yield temporary
        finally:
            os.close(handle)
        temporary.chmod(0o644)
        try:
            os.replace(temporary, path)
        except OSError as error:
            raise _unwritable(path, error) from None
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def _unwritable(path: Path, error: OSError) -> OutputError:
    found = OutputError(f"The file {path} cannot be written: {error.strerror or error}.")
    found.strerror = error.strerror
    return found


def _lock(handle: int) -> None:
    """Mark a file as being written, for as long as this process has it open; OSError if another has.

    Where the system has no such locks, an open file cannot be removed.
    """
    try:
        import fcntl
    except ImportError:
        return
    fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _clear(path: Path) -> None:
    """Remove what killed processes left of this file."""
    for part in path.parent.glob(f".{escape(path.stem)}{MARK}????????{escape(path.suffix)}"):
        with suppress(OSError):
            if time.time() - part.stat().st_mtime > FRESH:
                handle = os.open(part, os.O_RDWR)
                try:
                    _lock(handle)
                finally:
                    os.close(handle)
                part.unlink()
