"""Records larger than memory: a NumPy file that grows row by row and can be read at any time.

One ``.npy`` of a structured type: each entry is an instant, with "time" and arrays of all runs by name.
``numpy.load(path, mmap_mode="r")["angle"]`` reads it without loading it. The scene and the method stand beside it,
in ``<name>.npy.json``.
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


class Stream:
    """A file of records, open for writing: valid at any moment, also where the process was killed, with what was
    appended until then; what stands behind the records that its header counts is no part of it.

    Args:
        path: ends in ".npy"; an existing file is replaced.
        names: of what is kept of each run.
        shape: of the runs.
        facts: provenance, for the JSON file.

    Raises OutputError where it cannot be written, also in the middle, as on a full disk.
    """

    def __init__(self, path: Path, names: Sequence[str], shape: tuple[int, ...], facts: Mapping[str, Any]) -> None:
        self.path, self._names = path, tuple(names)
        self._type = np.dtype([("time", np.float64), *((name, np.float64, shape) for name in names)])
        self._count = 0
        about = path.with_name(f"{path.name}.json")
        with self._saying(), replacing(about) as written:
            written.write_text(json.dumps(dict(facts), indent=2) + "\n", encoding="utf-8")
            with replacing(path) as temporary:
                with temporary.open("wb") as file:
                    self._head(file)
                about.resolve().unlink(missing_ok=True)  # a link stays
        with self._saying():
            self._file = path.open("r+b", buffering=0)

    def append(self, time: NDArray[np.float64], values: NDArray[np.float64]) -> None:
        """Add instants: times ``(rows,)`` and values ``(rows, names, runs)``."""
        rows = np.empty(len(time), dtype=self._type)
        rows["time"] = time
        for i, name in enumerate(self._names):
            rows[name] = values[:, i].reshape(rows[name].shape)
        with self._saying():
            self._file.seek(0, 2)
            left = rows.view(np.uint8).data
            while left:
                left = left[self._file.write(left) :]
            self._count += len(time)
            self._head(self._file)

    @contextmanager
    def _saying(self) -> Iterator[None]:
        """OutputError, with the file's name, for what the system says."""
        try:
            yield
        except OutputError:
            raise
        except OSError as error:
            raise OutputError(f"The file {self.path} cannot be written: {error.strerror or error}.") from None

    def _head(self, file: BinaryIO | FileIO) -> None:
        """Write the header again: NumPy leaves room in it for a first axis that grows."""
        described = {"descr": np.lib.format.dtype_to_descr(self._type), "fortran_order": False, "shape": (self._count,)}
        file.seek(0)
        np.lib.format.write_array_header_2_0(file, described)
        file.flush()

    def __enter__(self) -> Stream:
        return self

    def __exit__(self, *reason: object) -> None:
        with self._saying():
            self._file.close()


def read(path: Path) -> NDArray[Any]:
    """The records of a file, mapped rather than loaded."""
    found: NDArray[Any] = np.load(path, mmap_mode="r")
    return found
