"""Arrays of NumPy (.npz, .npy) and of MATLAB (.mat) as tables: vectors of one length, and matrices with as many rows.

Nothing is ever unpickled: a pickle may run any program. Arrays of objects are refused.
"""

from __future__ import annotations

import io
import math
import warnings
import zipfile
from collections.abc import Mapping
from typing import Any

import numpy as np

from pendulum_env.lab.checked import RecordingError
from pendulum_env.lab.decoding import check, unpacked

Tables = dict[str, tuple[list[str], list[list[str]]]]
"""Name of a table -> the titles of its columns, and their values as text; "" stands for a missing value."""
LEAST = 3
"""Fewest values of a vector that may be a column."""
_NUMBERS = ("double", "single", "logical", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)))
"""Classes of MATLAB's variables that are arrays of numbers."""
MATLAB = b"MATLAB 5.0"
"""First bytes of a MATLAB file of versions 5 to 7."""
_HDF5 = (b"MATLAB 7.3", b"\x89HDF\r\n\x1a\n")
"""First bytes of a MATLAB file of version 7.3, and of other files in its format."""
NUMPY = b"\x93NUMPY"
"""First bytes of an array of NumPy."""


def numpy_tables(name: str, archive: zipfile.ZipFile) -> Tables:
    """Return the tables in an archive of NumPy (.npz). Raises RecordingError for arrays of objects and damaged ones."""
    return tables_of(name, {entry.removesuffix(".npy"): array_in(f"{name}/{entry}", unpacked(name, archive, entry))
                            for entry in archive.namelist()})


def array_in(name: str, data: bytes) -> Any:
    """Return the array in the bytes of a NumPy file (.npy) after a check of its size; RecordingError for objects."""
    file = io.BytesIO(data)
    version = np.lib.format.read_magic(file)
    header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, kind = header(file)
    if kind.hasobject:
        raise RecordingError(f"{name}: expected an array of numbers, found one of Python objects, which are not read, "
                             "as they could run a program; save numbers, as np.savez('swing.npz', t=t, angle=angle)")
    if math.prod(shape) * kind.itemsize != len(data) - file.tell():
        raise RecordingError(f"{name}: expected {math.prod(shape)} values of {kind.itemsize} bytes, found "
                             f"{len(data) - file.tell()} bytes: the file is damaged")
    check(name, "cells", math.prod(shape))
    return np.load(io.BytesIO(data), allow_pickle=False)


def matlab_tables(name: str, data: bytes) -> Tables:
    """Return the tables in a MATLAB file. Raises RecordingError for a file of version 7.3, and for one without numbers.
    """
    if data.startswith(_HDF5):
        raise RecordingError(f"{name}: this MATLAB file is of version 7.3, which is not read; save it in MATLAB by "
                             "save('swing.mat', 't', 'angle', '-v7')")
    from scipy.io import loadmat, whosmat

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of variables that no recording needs
        file: Any = io.BytesIO(data)  # SciPy takes files, too, which its types leave out
        found = whosmat(file)
        numbers = [title for title, _, kind in found if kind in _NUMBERS]
        check(name, "cells", sum(math.prod(shape) for _, shape, kind in found if kind in _NUMBERS))
        if not numbers:
            others = ", ".join(f"{title} ({kind})" for title, _, kind in found) or "nothing"
            raise RecordingError(f"{name}: expected vectors of numbers, found {others}; save them by themselves, as "
                                 "save('swing.mat', 't', 'angle', '-v7')")
        file.seek(0)
        values = loadmat(file, variable_names=numbers)
    return tables_of(name, {title: values[title] for title in numbers})


def tables_of(name: str, arrays: Mapping[str, Any]) -> Tables:
    """Return the tables that arrays make: vectors and matrices of one number of rows belong to one table.

    A matrix of two or three long rows is turned. The columns of a single matrix without vectors have no titles. Raises
    RecordingError for complex numbers.
    """
    columns: dict[int, dict[str, Any]] = {}
    matrices: dict[int, int] = {}
    for title, array in _plain(arrays).items():
        if np.iscomplexobj(array):
            raise RecordingError(f"{name}: expected real numbers, found complex ones in {title}")
        if not (np.issubdtype(array.dtype, np.number) or array.dtype == np.bool_) or array.size < LEAST:
            continue
        if array.size == max(array.shape):
            columns.setdefault(array.size, {})[title] = array.ravel()
        elif array.ndim == 2:
            upright = array.T if array.shape[0] <= LEAST < array.shape[1] else array
            rows, count = upright.shape
            if rows >= LEAST:
                check(name, "columns", count)
                matrices[rows] = matrices.get(rows, 0) + 1
                columns.setdefault(rows, {}).update({f"{title} {k + 1}": upright[:, k] for k in range(count)})
    tables: Tables = {}
    for rows, found in columns.items():
        names = ", ".join(dict.fromkeys(title.rpartition(" ")[0] or title for title in found))
        alone = matrices.get(rows) == 1 and "," not in names
        tables[names] = [] if alone else list(found), [[repr(x) for x in one.tolist()] for one in found.values()]
    return tables


def _plain(arrays: Mapping[str, Any]) -> dict[str, Any]:
    """Return arrays, with those of records as one array for each field."""
    found: dict[str, Any] = {}
    for title, array in arrays.items():
        if array.dtype.names and array.ndim == 1:
            found |= {field: array[field] for field in array.dtype.names}
        else:
            found[title] = array
    return found
