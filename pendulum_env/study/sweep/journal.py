"""Journal of a sweep: a file with one JSON line per result, from which an interrupted sweep continues."""

from __future__ import annotations

import errno
import io
import json
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from weakref import WeakSet

from pendulum_env.common.provenance import OutputError, output_folder
from pendulum_env.common.replacing import lock, replacing
from pendulum_env.physics.units import file_path, shown
from pendulum_env.truth.reference import StudyError

HEAD = "sweep"
"""Key of a journal's first line, which describes the sweep and its origin."""
BEYOND = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}
"""Texts that stand in a journal for numbers that JSON cannot express."""


class OtherSweepError(StudyError):
    """Error raised when a sweep is to continue a journal file that another sweep wrote."""


def plain(value: Any, what: str) -> Any:
    """Return ``value`` converted to JSON's types; ``what`` describes the value in the error message.

    Numbers of numpy become Python's, arrays and tuples become lists, and objects with ``to_dict``, such as a scene,
    become dicts. Raises StudyError if a value has another type.
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
    raise StudyError(f"{what} must hold only JSON's types (numbers, texts, lists, dicts), not {shown(value)}.")


def text_of(value: Any, sort: bool = False) -> str:
    """Return a value of JSON types as JSON text; with ``sort``, sorted by key, so that equal values give equal text."""
    return json.dumps(_written(value), sort_keys=sort, allow_nan=False)


def _written(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _written(part) for name, part in value.items()}
    if isinstance(value, list):
        return [_written(part) for part in value]
    return value if not isinstance(value, float) or math.isfinite(value) else str(value)


class Journal:
    """Open journal of a :func:`pendulum_env.study.sweep.study.sweep`: a file with one JSON line per result.

    Args:
        path: the file, created if it does not exist or is empty.
        facts: description of the sweep (function, keywords, versions), which is written into the first line.
        same: names of those facts that must be equal to the ones in the file if an existing file is continued.
        anew: True empties an existing file, unless another process is writing it.
        in_memory: False keeps the places of results in the file in place of the results; see :class:`WrittenResults`.

    Attributes:
        done: results that the file had when it was opened, by the JSON text of their combination of parameters.
        failed: reasons of points that failed, likewise.
        head: the file's first line.

    An incomplete last line is cut off. Raises StudyError for a file that is not the journal of this sweep, which is
    left unchanged, or that another process is writing; OutputError for a file that cannot be read or written.
    """

    def __init__(self, path: str | Path, facts: Mapping[str, str], same: Sequence[str], anew: bool = False,
                 in_memory: bool = True) -> None:
        self.path, self._in_memory = file_path(path, "file"), in_memory
        self.done: dict[str, Any] = {}
        self.failed: dict[str, str] = {}
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
            self.head = b""
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

    def add(self, point: Any, result: Any, kind: str = "result") -> Any:
        """Append a combination of parameters and its result to the file at once; raises OutputError on failure.

        ``kind`` is "result", or "error" for the reason of a point that failed. Return the result, or its place in the
        file if results are not kept in memory.
        """
        line = text_of({"point": point, kind: result}).encode() + b"\n"
        try:
            place = self._file.tell()
            while line:
                line = line[self._file.write(line) :]
        except OSError as error:
            raise self._unwritable(error) from None
        return result if self._in_memory else place

    def close(self) -> None:
        """Close the file, which also releases its lock."""
        self._file.close()

    def _unwritable(self, error: OSError) -> OutputError:
        if isinstance(error, OutputError):
            return error
        return OutputError(f"The file {self.path} cannot be written: {error.strerror or error}.")

    def _lock(self) -> None:
        """Lock the journal file against other writers; raises StudyError if another process has locked it."""
        try:
            lock(self._file.fileno())
        except OSError as error:
            if error.errno not in (errno.EACCES, errno.EAGAIN):
                raise
            raise StudyError(f"Another process is writing {self.path}; wait for it, or give another file.") from None

    def _read(self, facts: Mapping[str, str], same: Sequence[str]) -> int:
        """Read the results of the journal file into ``done``, and return the length of its complete lines [bytes]."""
        self._file.seek(0)
        reader = io.BufferedReader(self._file)
        end, number, line = 0, 0, reader.readline()
        while line:
            after = reader.readline()
            try:
                if not line.endswith(b"\n"):
                    raise ValueError
                entry = json.loads(line)
                if number == 0:
                    self._check(entry[HEAD], facts, same)
                    self.head = line
                elif "error" in entry:
                    self.failed[text_of(entry["point"], sort=True)] = str(entry["error"])
                else:
                    result, key = plain(entry["result"], "A result"), text_of(entry["point"], sort=True)
                    self.done.setdefault(key, result if self._in_memory else end)
                    self.failed.pop(key, None)  # a later trial has succeeded
            except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as fault:
                if isinstance(fault, StudyError):
                    raise
                if number == 0:
                    raise StudyError(
                        f"The file {self.path} is not the journal of a sweep; give another file name."
                    ) from None
                if not after:
                    break
                raise StudyError(f"Line {number + 1} of {self.path} is damaged; delete the line to continue.") from None
            end, number, line = end + len(line), number + 1, after
        reader.detach()
        return end

    def _check(self, head: Any, facts: Mapping[str, str], same: Sequence[str]) -> None:
        for name in same:
            if head.get(name) != facts[name]:
                if name == "Sources":
                    raise OtherSweepError(
                        f"The file {self.path} was written by other sources of this package, {head.get(name)} and not "
                        f"{facts[name]}, which may give other results; the file is left unchanged. Give another file "
                        "name; anew=True empties this one and begins again.")
                raise OtherSweepError(
                    f"The file {self.path} belongs to another sweep, {_difference(name, head.get(name), facts[name])}; "
                    "the file is left unchanged. Give another file name."
                )


class WrittenResults(Sequence[Any]):
    """Results of a sweep that stay in its journal, and are read when they are asked for.

    Args:
        journal: the journal.
        points: combinations of parameters in the order of the results.
        places: for each point the place of its line in the file [bytes], None without a result.

    Reading raises StudyError if the file is gone, or is no longer that of the sweep.
    """

    def __init__(self, journal: Journal, points: Sequence[Any], places: Sequence[int | None]) -> None:
        self._path, self._head = journal.path.absolute(), journal.head
        self._points, self._places = points, places

    def __len__(self) -> int:
        return len(self._places)

    def __getitem__(self, i: Any) -> Any:
        if isinstance(i, slice):
            return [self[k] for k in range(*i.indices(len(self)))]
        with self._opened() as file:
            return self._at(file, i)

    def __iter__(self) -> Iterator[Any]:
        with self._opened() as file:
            for i in range(len(self)):
                yield self._at(file, i)

    def _opened(self) -> io.BufferedReader:
        try:
            file = self._path.open("rb")
        except OSError as error:
            raise StudyError(f"The results in {self._path} cannot be read: {error.strerror or error}.") from None
        if file.readline() != self._head:
            file.close()
            raise self._changed()
        return file

    def _at(self, file: io.BufferedReader, i: int) -> Any:
        place = self._places[i]
        if place is None:
            return None
        file.seek(place)
        try:
            entry = json.loads(file.readline())
            if entry["point"] != json.loads(text_of(self._points[i])):
                raise ValueError
            return plain(entry["result"], "A result")
        except (ValueError, KeyError, TypeError, RecursionError):
            raise self._changed() from None

    def _changed(self) -> StudyError:
        return StudyError(f"The file {self._path} was changed after the sweep; run the sweep again.")


_OPEN: WeakSet[Journal] = WeakSet()


def _leave_to_parent() -> None:
    """Close all open journals in a forked child process.

    Otherwise the child would hold the locks on the files after its parent is killed.
    """
    for journal in list(_OPEN):
        journal.close()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_leave_to_parent)


def _difference(name: str, theirs: Any, ours: str) -> str:
    """Return the difference between the same entry of two sweeps' descriptions, in words.

    ``name`` is the entry, ``theirs`` its value in the journal file and ``ours`` that of the present sweep. If both are
    JSON dicts, only the first key that differs is described.
    """
    try:
        one, other = json.loads(theirs), json.loads(ours)
        key = next(key for key in {**other, **one} if one.get(key) != other.get(key))
        return f"with {key} {shown(one.get(key))} instead of {shown(other.get(key))}"
    except (ValueError, TypeError, AttributeError, StopIteration):
        return f"with {name} {shown(theirs)} instead of {shown(ours)}"
