"""Files for records larger than memory: a NumPy file that grows row by row and can be read at any time.

The ``.npy`` file has a structured type. Every entry is a recorded time, with "time" and arrays over all runs by name.
``numpy.load(path, mmap_mode="r")["angle"]`` maps the angles without loading the file. The scene and the method are in
``<name>.npy.json``.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from io import FileIO
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.replacing import OutputError, replacing


class GrowingFile:
    """A file of a batch's records, open for writing, which is a valid file at any time, even if the process is killed.

    A killed process leaves a file with the records appended so far. The number of records is in the file's header;
    bytes after these records are not part of the array.

    Args:
        path: path that ends in ".npy"; an existing file is replaced.
        names: names of the recorded quantities.
        shape: shape of the batch of runs.
        facts: scene, method and version, for the JSON file beside the records.

    Raises OutputError if the file cannot be written, also during a later write, for example to a full disk.
    """

    def __init__(self, path: Path, names: Sequence[str], shape: tuple[int, ...], facts: Mapping[str, Any]) -> None:
        self.path, self._names = path, tuple(names)
        self._type = np.dtype([("time", np.float64), *((name, np.float64, shape) for name in names)])
        self._count = 0
        about = path.with_name(f"{path.name}.json")
        with self._named_errors(), replacing(about) as facts_file:
            facts_file.write_text(json.dumps(dict(facts), indent=2) + "\n", encoding="utf-8")
            with replacing(path) as temporary:
                with temporary.open("wb") as file:
                    self._head(file)
                about.resolve().unlink(missing_ok=True)  # a symbolic link is kept, its target removed
        with self._named_errors():
            self._file = path.open("r+b", buffering=0)

    def append(self, time: NDArray[np.float64], values: NDArray[np.float64]) -> None:
        """Append records to the file: times [s], shape ``(rows,)``, and values, shape ``(rows, names, runs)``."""
        rows = np.empty(len(time), dtype=self._type)
        rows["time"] = time
        for i, name in enumerate(self._names):
            rows[name] = values[:, i].reshape(rows[name].shape)
        with self._named_errors():
            self._file.seek(0, 2)
            left = rows.view(np.uint8).data
            while left:
                left = left[self._file.write(left) :]
            self._count += len(time)
            self._head(self._file)

    @contextmanager
    def _named_errors(self) -> Iterator[None]:
        """Return a context manager that turns an OSError into an OutputError with the file's name."""
        try:
            yield
        except OutputError:
            raise
        except OSError as error:
            raise OutputError(f"The file {self.path} cannot be written: {error.strerror or error}.") from None

    def _head(self, file: BinaryIO | FileIO) -> None:
        """Write the file's header with the present number of records, for which NumPy leaves space."""
        described = {"descr": np.lib.format.dtype_to_descr(self._type), "fortran_order": False, "shape": (self._count,)}
        file.seek(0)
        np.lib.format.write_array_header_2_0(file, described)
        file.flush()

    def __enter__(self) -> GrowingFile:
        """Return this open file, at the start of a ``with`` block."""
        return self

    def __exit__(self, *reason: object) -> None:
        """Close the file of records, at the end of a ``with`` block."""
        with self._named_errors():
            self._file.close()


def read(path: Path) -> NDArray[Any]:
    """Return the records of a file as a memory-mapped structured array, one entry per recorded time.

    Raises OSError for a file that cannot be read, ValueError for another one than of records.
    """
    try:
        records: NDArray[Any] = np.load(path, mmap_mode="r")
    except OSError:
        raise
    except Exception as error:  # NumPy's reader of headers raises errors of Python's parser, among others
        raise ValueError(f"The file {path} holds no records: {error}.") from None
    return records
