"""Origin of output files (version, command, settings), written into each file so that it can be reproduced."""

from __future__ import annotations

import csv
import json
import platform
import shlex
import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

from pendulum_env.common.checks import file_path
from pendulum_env.common.replacing import OutputError, replacing
from pendulum_env.common.texts import clean, for_csv
from pendulum_env.common.version import __version__

__all__ = ["OutputError", "output_folder", "provenance", "write_csv"]


def provenance(**facts: Any) -> dict[str, str]:
    """Return package version, command line, Python version and the given facts (scene, method, dt, ...) as texts."""
    command = shlex.join([Path(sys.argv[0]).name, *sys.argv[1:]])
    base = {"Software": f"lab-pendulum {__version__}", "Command": command, "Python": platform.python_version()}
    texts = {name: value if isinstance(value, str) else json.dumps(value) for name, value in facts.items()}
    return {name: clean(text, None) for name, text in {**base, **texts}.items()}


def output_folder(path: str | Path) -> Path:
    """Return the path of an output folder, created if missing; raises OutputError if it cannot be written to."""
    folder = file_path(path, "folder")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OutputError(f"The output folder {folder} cannot be written: {error.strerror or error}.") from None
    return folder


def write_csv(path: Path, columns: Sequence[str], rows: Iterable[Sequence[Any]], facts: Mapping[str, str]) -> None:
    """Write a CSV file whose first lines, marked by "# ", give its origin; no incomplete file is left on failure."""
    with replacing(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        file.writelines(f"# {name}: {clean(value, None)}\n" for name, value in facts.items())
        csv.writer(file).writerows([for_csv(cell) if isinstance(cell, str) else cell for cell in row]
                                   for row in chain([columns], rows))
