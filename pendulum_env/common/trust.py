"""Safe cache folders: the compiled code in them is only run if no other user can have written it, and what is written
there replaces no file outside the folder.
"""

from __future__ import annotations

import errno
import os
import stat
import sys
from collections.abc import Iterator
from pathlib import Path

from pendulum_env.common.replacing import replacing

OTHERS = stat.S_IWGRP | stat.S_IWOTH
"""Mode bits that let the group or all users write."""
OWN = 0o600
"""Permission bits of files that only this user may read and write, which :func:`own_bytes` accepts."""


def own_folder(path: Path) -> Path:
    """Return a folder with its links resolved, created if missing, after checking that only this user can write to it.

    Missing folders are created with access for this user only, whatever the umask is. The folder must belong to this
    user, and no other user may write to it. Its parent folders must belong to this user or to the system, and other
    users may write to them only with the sticky bit, as in ``/tmp``, which prevents them from replacing this user's
    files. The same holds of symbolic links on the way to the folder, which is why a link that another user has put into
    ``/tmp`` is not followed. Write permission for a group without other members is harmless. On Windows, which protects
    a user's folders by default, nothing is checked.

    Raises OSError for a folder that cannot be created, PermissionError for a folder to which other users can write.
    """
    for missing in [above for above in path.parents if not above.exists()][::-1]:
        missing.mkdir(mode=0o700, exist_ok=True)
    path.mkdir(mode=0o700, exist_ok=True)
    folder = path.resolve(strict=True)
    if sys.platform == "win32":
        return folder
    status = folder.stat()
    if status.st_uid != os.geteuid():
        raise PermissionError(errno.EPERM, "it belongs to another user")
    if status.st_mode & OTHERS and not shared_with_nobody(status):
        raise PermissionError(errno.EPERM, "other users can write to it")
    trusted = {os.geteuid(), 0, Path("/").stat().st_uid}
    for above in _passed(path.absolute()):
        status = above.lstat()
        if status.st_uid not in trusted:
            raise PermissionError(errno.EPERM, f"{above} belongs to another user")
        shared = status.st_mode & OTHERS and not status.st_mode & stat.S_ISVTX  # the bits of a link mean nothing
        if shared and not stat.S_ISLNK(status.st_mode) and not shared_with_nobody(status):
            raise PermissionError(errno.EPERM, f"other users can write to {above}")
    return folder


def _passed(path: Path) -> Iterator[Path]:
    """Yield all folders and links that the system passes through on its way to an absolute path, and the path."""
    for part in (*reversed(path.parents), path):
        yield part
        if part.is_symlink():
            yield from _passed(part.parent / part.readlink())


def own_bytes(path: Path) -> bytes:
    """Return the content of a file in a folder that :func:`own_folder` has checked.

    Raises PermissionError if another user owns the file or can write to it, because it may have been written before the
    folder was protected, and for a symbolic link or anything else that is not a regular file.
    """
    if not stat.S_ISREG(path.lstat().st_mode):
        raise PermissionError(errno.EPERM, f"{path} is not a regular file")
    with path.open("rb") as file:
        if sys.platform != "win32":
            status = os.fstat(file.fileno())
            if status.st_uid != os.geteuid() or status.st_mode & OTHERS:
                raise PermissionError(errno.EPERM, f"other users can write to {path}")
        return file.read()


def write_own(path: Path, content: bytes) -> None:
    """Write a file atomically, for this user only, in a folder that :func:`own_folder` checks again.

    A symbolic link in the file's place is replaced, and its target stays as it is.

    Raises OSError if the file cannot be written, PermissionError for a folder to which other users can write.
    """
    with replacing(own_folder(path.parent) / path.name, mode=OWN, follow=False) as temporary:
        temporary.write_bytes(content)


def shared_with_nobody(status: os.stat_result) -> bool:
    """Return True if a folder's write permission for its group lets no other user write to it.

    That is so if not all users may write, and the group is root's or has no member but this user.
    """
    import grp
    import pwd

    if status.st_mode & stat.S_IWOTH:
        return False
    try:
        group, me = grp.getgrgid(status.st_gid), pwd.getpwuid(os.geteuid()).pw_name
    except KeyError:
        return status.st_gid == 0
    return status.st_gid == 0 or (group.gr_name == me and {*group.gr_mem} <= {me})
