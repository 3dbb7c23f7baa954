"""Folders whose files may be run: this user's own, in which nobody else can put or exchange anything."""

from __future__ import annotations

import errno
import os
import stat
import sys
from pathlib import Path

OTHERS = stat.S_IWGRP | stat.S_IWOTH
OWN = 0o600
"""The mode of what :func:`own_bytes` is to read, whatever the umask is."""


def own_folder(path: Path) -> Path:
    """The folder with this path, made if need be, and without links in its path.

    What is missing of it, folders above included, is made for this user alone, whatever the umask is. It must belong to
    this user, and nobody else may write to it; of the folders above, each must belong to this user or to the system,
    and others may write to it only where its sticky bit keeps them from exchanging what is not theirs, as in ``/tmp``.
    A group in which nobody else is may write to any. On Windows, where a user's folders are protected by default,
    nothing is checked.

    Raises OSError for a folder that cannot be had, PermissionError for one of which that is not so.
    """
    for missing in [above for above in path.parents if not above.exists()][::-1]:
        missing.mkdir(mode=0o700, exist_ok=True)
    path.mkdir(mode=0o700, exist_ok=True)
    folder = path.resolve(strict=True)
    if sys.platform == "win32":
        return folder
    found = folder.stat()
    if found.st_uid != os.geteuid():
        raise PermissionError(errno.EPERM, "it belongs to another user")
    if found.st_mode & OTHERS and not shared_with_nobody(found):
        raise PermissionError(errno.EPERM, "other users can write to it")
    trusted = {os.geteuid(), 0, Path("/").stat().st_uid}
    for above in folder.parents:
        found = above.stat()
        if found.st_uid not in trusted:
            raise PermissionError(errno.EPERM, f"{above} belongs to another user")
        if found.st_mode & OTHERS and not found.st_mode & stat.S_ISVTX and not shared_with_nobody(found):
            raise PermissionError(errno.EPERM, f"other users can write to {above}")
    return folder


def own_bytes(path: Path) -> bytes:
    """What a file of :func:`own_folder` holds; PermissionError if somebody else wrote it, or could have.

    That may be one from a time when others could write to its folder.
    """
    with path.open("rb") as file:
        if sys.platform != "win32":
            found = os.fstat(file.fileno())
            if found.st_uid != os.geteuid() or found.st_mode & OTHERS:
                raise PermissionError(errno.EPERM, f"other users can write to {path}")
        return file.read()


def shared_with_nobody(found: os.stat_result) -> bool:
    """True if only its group may write to a folder, and that is root's, or this user's own with nobody else in it."""
    import grp
    import pwd

    if found.st_mode & stat.S_IWOTH:
        return False
    try:
        group, me = grp.getgrgid(found.st_gid), pwd.getpwuid(os.geteuid()).pw_name
    except KeyError:
        return found.st_gid == 0
    return found.st_gid == 0 or (group.gr_name == me and {*group.gr_mem} <= {me})
