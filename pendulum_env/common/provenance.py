"""Origin of output files (version, command, settings), written into each file so that it can be reproduced."""

from __future__ import annotations

import csv
import json
import platform
import shlex
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import Any

from pendulum_env.common.checks import file_path
from pendulum_env.common.replacing import OutputError, replacing
from pendulum_env.common.texts import clean, for_csv
from pendulum_env.common.version import NAME, sources, version

__all__ = ["OutputError", "checked_folder", "output_folder", "provenance", "write_csv"]


def provenance(**facts: Any) -> dict[str, str]:
    """Return package version, digest of its sources, command line, Python version and the given facts as texts.

    Facts are what describes the file: scene, method, dt, ...
    """
    command = shlex.join([Path(sys.argv[0]).name, *sys.argv[1:]])
    base = {"Software": f"{NAME} {version()}", "Sources": sources(), "Command": command,
            "Python": platform.python_version()}
    texts = {name: value if isinstance(value, str) else json.dumps(value) for name, value in facts.items()}
    return {name: clean(text, None) for name, text in {**base, **texts}.items()}


def checked_folder(path: str | Path) -> Path:
    """Return the path of an output folder that can be written to, or be created; nothing is created yet.

    Raises OutputError for any other path, and SceneError for none. A command checks its folder before it computes, and
    creates it, by :func:`output_folder`, only with its first file.
    """
    folder = file_path(path, "folder")
    with _writable(folder):
        for place in (folder, *folder.absolute().parents):
            try:
                place.lstat()
            except (FileNotFoundError, NotADirectoryError):
                continue
            with tempfile.TemporaryFile(dir=place):
                break
    return folder


def output_folder(path: str | Path) -> Path:
    """Return the path of an output folder, created if missing; raises OutputError if it cannot be written to."""
    folder = checked_folder(path)
    with _writable(folder):
        folder.mkdir(parents=True, exist_ok=True)
    return folder


@contextmanager
def _writable(folder: Path) -> Iterator[None]:
    """Raise OutputError for an error of the operating system in the ``with`` block."""
    try:
        yield
    except OSError as error:
        raise OutputError(f"The output folder {folder} cannot be written: {error.strerror or error}.") from None


def write_csv(path: Path, columns: Sequence[str], rows: Iterable[Sequence[Any]], facts: Mapping[str, str]) -> None:
    """Write a CSV file whose first lines, marked by "# ", give its origin; no incomplete file is left on failure."""
    with replacing(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        file.writelines(f"# {name}: {clean(value, None)}\n" for name, value in facts.items())
        csv.writer(file).writerows([for_csv(cell) if isinstance(cell, str) else cell for cell in row]
                                   for row in chain([columns], rows))
