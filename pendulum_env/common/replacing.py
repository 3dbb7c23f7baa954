"""Atomic writing of files: into a temporary file in the same folder, which then replaces the target.

A process that is killed leaves its temporary file behind, ``.<stem>.lab-pendulum-<8 hex><ending>``, hidden. The next
process that writes the same file removes it.
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
"""Part of the names of temporary files."""
STEM = 160
"""Largest number of bytes of the target's name in the name of a temporary file."""
FRESH = 60.0
"""Age [s] below which a temporary file is not removed, because its writer may not have locked it yet."""
STALE = 86400.0
"""Age [s] below which a temporary file is not removed on a file system without locks."""
NO_LOCKS = {errno.ENOSYS, errno.EOPNOTSUPP, errno.ENOTSUP, errno.ENOLCK, errno.EINVAL}
"""Error numbers by which a file system says that it has no locks."""


class OutputError(OSError):
    """Error of a folder or file that cannot be written."""


@contextmanager
def replacing(path: Path, mode: int | None = None, follow: bool = True) -> Iterator[Path]:
    """Yield a temporary path in the folder of ``path``; afterwards the temporary file replaces ``path``.

    If the body of the ``with`` block raises, the temporary file is removed and ``path`` stays unchanged. The new file
    gets the permission bits ``mode``, by default those of the file that it replaces, or those of the umask. The target
    of a symbolic link is replaced, not the link; with ``follow=False`` the link.

    Raises OutputError if the file cannot be written, or ``path`` is not a regular file, for example a device or a pipe.
    """
    target = Path(os.path.realpath(path)) if follow else path
    bits = _mode(path, target) if mode is None else mode
    _clear(target.parent, path)
    try:
        handle, temporary = _part(target.parent, path, 0o666 if bits is None else bits | stat.S_IRUSR | stat.S_IWUSR)
    except OSError as error:
        raise _unwritable(path, error) from None
    try:
        try:
            lock(handle)
            yield temporary
        finally:
            os.close(handle)
        try:
            if bits is not None:
                temporary.chmod(bits)
            os.replace(temporary, target)
        except OSError as error:
            raise _unwritable(path, error) from None
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def _mode(path: Path, target: Path) -> int | None:
    """Return the permission bits of an existing file, or None if there is no file.

    Raises OutputError for anything that is not a regular file.
    """
    try:
        mode = target.stat().st_mode
    except FileNotFoundError:
        return None
    except OSError as error:
        raise _unwritable(path, error) from None
    if stat.S_ISDIR(mode):
        raise _unwritable(path, IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR)))
    if not stat.S_ISREG(mode):
        raise _unwritable(path, OSError(errno.EINVAL, f"{path.name} is not a regular file"))
    return stat.S_IMODE(mode) & 0o777


def _part(folder: Path, path: Path, mode: int) -> tuple[int, Path]:
    """Create a temporary file in ``folder``, from which ``path`` is written; return its open handle and its path."""
    while True:
        temporary = folder / f".{_stem(path)}{MARK}{secrets.token_hex(4)}{path.suffix}"
        with suppress(FileExistsError):
            return os.open(temporary, os.O_RDWR | os.O_CREAT | os.O_EXCL, mode), temporary


def _stem(path: Path) -> str:
    """Return the part of a temporary file's name that is its target's, short enough for a target of 255 bytes."""
    return os.fsdecode(os.fsencode(path.stem)[:STEM])


def _unwritable(path: Path, error: OSError) -> OutputError:
    failure = OutputError(f"The file {path} cannot be written: {error.strerror or error}.")
    failure.strerror = error.strerror
    return failure


def lock(handle: int) -> bool:
    """Lock an open file until it is closed; raises OSError if another process holds the lock.

    Return False if the file system has no locks. Return True on Windows without a lock: no other process can remove an
    open file there.
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
    """Remove temporary files of ``path`` that killed processes left behind."""
    for part in folder.glob(f".{escape(_stem(path))}{MARK}{'[0-9a-f]' * 8}{escape(path.suffix)}"):
        with suppress(OSError):
            status = part.lstat()
            age = time.time() - status.st_mtime
            if stat.S_ISREG(status.st_mode) and age > FRESH:
                handle = os.open(part, os.O_RDWR)
                try:
                    dead = lock(handle) or age > STALE
                finally:
                    os.close(handle)
                if dead:
                    part.unlink()
