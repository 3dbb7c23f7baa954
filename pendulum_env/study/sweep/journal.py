"""Results as they come: one JSON line each, in a file that a later run goes on with."""

from __future__ import annotations

import errno
import json
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from weakref import WeakSet

from pendulum_env.common.provenance import OutputError, output_folder
from pendulum_env.common.replacing import lock, replacing
from pendulum_env.physics.units import file_path, shown
from pendulum_env.truth.reference import StudyError

HEAD = "sweep"
"""Key of the first line, which says where the file comes from and what it is of."""
BEYOND = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}
"""What stands in a file for numbers that JSON does not have."""


class OtherSweepError(StudyError):
    """A file that is of another sweep than the one that is to go on with it."""


def plain(value: Any, what: str) -> Any:
    """``value`` in JSON's own types; StudyError if it cannot be.

    Numbers of numpy become Python's, arrays and tuples lists, and what has ``to_dict``, such as a scene, its dict.
    """
    if hasattr(value, "to_dict"):
        value = value.to_dict()
    if hasattr(value, "tolist"):
        value = value.tolist()
    if value is None or isinstance(value, (bool, int, float)):
        return value
    if isinstance(value, str):
        return BEYOND.get(value, value)
    if isinstance(value, Mapping) and all(isinstance(name, str) for name in value):
        return {name: plain(part, what) for name, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(part, what) for part in value]
    raise StudyError(f"{what} must be of numbers, texts, lists and dicts of them, as JSON is, not {shown(value)}.")


def text_of(value: Any, sort: bool = False) -> str:
    """The JSON line of what :func:`plain` gave; sorted, equal values have equal texts."""
    return json.dumps(_written(value), sort_keys=sort, allow_nan=False)


def _written(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _written(part) for name, part in value.items()}
    if isinstance(value, list):
        return [_written(part) for part in value]
    return value if not isinstance(value, float) or math.isfinite(value) else str(value)


class Journal:
    """A file of results, open for more; see :func:`pendulum_env.study.sweep.study.sweep` for what is in it.

    Args:
        path: the file; a new one is made where there is none, or an empty one.
        facts: its first line.
        same: names of those facts that a file to go on with must share.
        anew: True empties a file that is there, unless another process is writing it.

    Attributes:
        done: the results that it had, by the text of their points.

    A last line that was not written to its end is cut off. Raises StudyError for a file of something else, which is
    left as it was, or one that another process is writing; OutputError for one that cannot be read or written.
    """

    def __init__(self, path: str | Path, facts: Mapping[str, str], same: Sequence[str], anew: bool = False) -> None:
        self.path = file_path(path, "file")
        self.done: dict[str, Any] = {}
        output_folder(self.path.parent)
        try:
            if not self.path.exists() or self.path.stat().st_size == 0:
                with replacing(self.path) as temporary:
                    temporary.write_bytes(text_of({HEAD: dict(facts)}).encode() + b"\n")
            self._file = self.path.open("r+b", buffering=0)
        except OSError as error:
            raise self._unwritable(error) from None
        _OPEN.add(self)
        try:
            self._lock()
            if anew:
                self._file.truncate(0)
                self._file.write(text_of({HEAD: dict(facts)}).encode() + b"\n")
            end = self._read(facts, same)
            self._file.truncate(end)
            self._file.seek(end)
        except OSError as error:
            self._file.close()
            raise self._unwritable(error) from None
        except BaseException:
            self._file.close()
            raise

    def add(self, point: Any, result: Any) -> None:
        """One more line, written at once; OutputError if it cannot be."""
        line = text_of({"point": point, "result": result}).encode() + b"\n"
        try:
            while line:
                line = line[self._file.write(line) :]
        except OSError as error:
            raise self._unwritable(error) from None

    def close(self) -> None:
        self._file.close()

    def _unwritable(self, error: OSError) -> OutputError:
        if isinstance(error, OutputError):
            return error
        return OutputError(f"The file {self.path} cannot be written: {error.strerror or error}.")

    def _lock(self) -> None:
        """Not while another process, or another journal of this one, has it; where there are no locks, nothing."""
        try:
            lock(self._file.fileno())
        except OSError as error:
            if error.errno not in (errno.EACCES, errno.EAGAIN):
                raise
            raise StudyError(f"Another process is writing the file {self.path}; wait, or take another.") from None

    def _read(self, facts: Mapping[str, str], same: Sequence[str]) -> int:
        """Fill ``done``; the length of what is whole."""
        self._file.seek(0)
        end, lines = 0, self._file.read().splitlines(keepends=True)
        for number, line in enumerate(lines):
            try:
                if not line.endswith(b"\n"):
                    raise ValueError
                entry = json.loads(line)
                if number == 0:
                    self._check(entry[HEAD], facts, same)
                else:
                    self.done.setdefault(text_of(entry["point"], sort=True), plain(entry["result"], "A result"))
            except (ValueError, KeyError, TypeError) as fault:
                if isinstance(fault, StudyError):
                    raise
                if number == 0:
                    raise StudyError(
                        f"The file {self.path} is of another kind, not of a sweep; take another name."
                    ) from None
                if number == len(lines) - 1:
                    break
                raise StudyError(f"Line {number + 1} of {self.path} is damaged; remove it to go on.") from None
            end += len(line)
        return end

    def _check(self, head: Any, facts: Mapping[str, str], same: Sequence[str]) -> None:
        for name in same:
            if head.get(name) != facts[name]:
                raise OtherSweepError(
                    f"The file {self.path} is of another sweep, {_difference(name, head.get(name), facts[name])}; it "
                    "is left as it was."
                )


_OPEN: WeakSet[Journal] = WeakSet()


def _leave_to_parent() -> None:
    """In a process that was forked, such as one of a pool: it must not hold the lock when its parent is killed."""
    for journal in list(_OPEN):
        journal.close()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_leave_to_parent)


def _difference(name: str, theirs: Any, ours: str) -> str:
    """In what a fact of two files differs; one that is a JSON dict by its first key that does."""
    try:
        one, other = json.loads(theirs), json.loads(ours)
        key = next(key for key in {**other, **one} if one.get(key) != other.get(key))
        return f"with {key} {shown(one.get(key))} where this has {shown(other.get(key))}"
    except (ValueError, TypeError, AttributeError, StopIteration):
        return f"with {name} {shown(theirs)} where this has {shown(ours)}"
