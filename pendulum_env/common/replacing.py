"""Files that are whole or not there: written under another name beside their place, then moved there.

A process that is killed leaves the other name behind, hidden and harmless: ``.<stem>.lab-pendulum-<8 hex><ending>``.
The next that writes the same file removes it.
"""

from __future__ import annotations

import errno
import os
import secrets
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from glob import escape
from pathlib import Path

MARK = ".lab-pendulum-"
FRESH = 60.0
"""Seconds since its last change for which a part is left alone: its writer may not have its lock yet."""
STALE = 86400.0
"""The same where the file system has no locks, so that nothing else says whether a part has a writer."""
NO_LOCKS = {errno.ENOSYS, errno.EOPNOTSUPP, errno.ENOTSUP, errno.ENOLCK, errno.EINVAL}
"""What file systems answer that have no locks."""


class OutputError(OSError):
    """A folder or file that cannot be written."""


@contextmanager
def replacing(path: Path, mode: int | None = None) -> Iterator[Path]:
    """A temporary path beside ``path``, with its ending, that takes its place on success and leaves no trace else.

    The file has this mode; by default that of the file that it replaces, or what the umask leaves of a new one. Where
    ``path`` is a symbolic link, what it points to is replaced.

    OutputError where the file cannot be written, or where there is something else than a file: a device, a pipe.
    """
    target = Path(os.path.realpath(path))
    kept = _mode(path, target) if mode is None else mode
    _clear(target.parent, path)
    try:
        handle, temporary = _part(target.parent, path, 0o666 if kept is None else kept | stat.S_IRUSR | stat.S_IWUSR)
    except OSError as error:
        raise _unwritable(path, error) from None
    try:
        try:
            lock(handle)
            yield temporary
        finally:
            os.close(handle)
        try:
            if kept is not None:
                temporary.chmod(kept)
            os.replace(temporary, target)
        except OSError as error:
            raise _unwritable(path, error) from None
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def _mode(path: Path, target: Path) -> int | None:
    """The mode of the file that is there, None if there is none; OutputError for anything but a file."""
    try:
        found = target.stat().st_mode
    except FileNotFoundError:
        return None
    except OSError as error:
        raise _unwritable(path, error) from None
    if stat.S_ISDIR(found):
        raise _unwritable(path, IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR)))
    if not stat.S_ISREG(found):
        raise _unwritable(path, OSError(errno.EINVAL, f"{path.name} is a device, a pipe or the like, not a file"))
    return stat.S_IMODE(found) & 0o777


def _part(folder: Path, path: Path, mode: int) -> tuple[int, Path]:
    """A new file, open, and its path."""
    while True:
        temporary = folder / f".{path.stem}{MARK}{secrets.token_hex(4)}{path.suffix}"
        with suppress(FileExistsError):
            return os.open(temporary, os.O_RDWR | os.O_CREAT | os.O_EXCL, mode), temporary


def _unwritable(path: Path, error: OSError) -> OutputError:
    found = OutputError(f"The file {path} cannot be written: {error.strerror or error}.")
    found.strerror = error.strerror
    return found


def lock(handle: int) -> bool:
    """Mark a file as being written, for as long as it is open here; OSError if that is so elsewhere.

    False where the file system has no locks. True on Windows, which has none either: an open file cannot be removed.
    """
    try:
        import fcntl
    except ImportError:
        return True
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno not in NO_LOCKS:
            raise
        return False
    return True


def _clear(folder: Path, path: Path) -> None:
    """Remove what killed processes left of this file."""
    for part in folder.glob(f".{escape(path.stem)}{MARK}{'[0-9a-f]' * 8}{escape(path.suffix)}"):
        with suppress(OSError):
            found = part.lstat()
            age = time.time() - found.st_mtime
            if stat.S_ISREG(found.st_mode) and age > FRESH:
                handle = os.open(part, os.O_RDWR)
                try:
                    dead = lock(handle) or age > STALE
                finally:
                    os.close(handle)
                if dead:
                    part.unlink()
