"""Worker processes for other packages, each in its own venv, which answer requests as JSON lines."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
import venv
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import IO, Any

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""Environment variables for one thread in BLAS and OpenMP."""


def python_of(name: str, pins: Sequence[str], folder: Path) -> Path:
    """Return the Python of a venv in ``folder`` with these packages; the venv is created if it does not exist."""
    tag = hashlib.sha256(" ".join((sys.version, *pins)).encode()).hexdigest()[:8]
    home = folder.absolute() / f"{name}-{tag}"
    python = home / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
    finished = home / "finished"
    if not finished.exists():
        print(f"making {home} with {', '.join(pins)}", flush=True)
        venv.create(home, with_pip=True, clear=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", *pins], check=True)
        finished.touch()
    return python


class Worker:
    """Process that runs ``script name *more`` and answers requests until ``close``; it is idle in between.

    Attributes:
        hello: the first message of the process.
    """

    def __init__(
        self, name: str, python: str | Path, script: str | Path, surroundings: Mapping[str, str], *more: str
    ) -> None:
        self.name = name
        outside = {key: value for key, value in os.environ.items() if key not in ONE_THREAD}
        self._process = subprocess.Popen(
            [python, "-W", "ignore", script, name, *more],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env={**outside, **surroundings},
        )  # fmt: skip
        self.hello: Any = self._answer()

    def ask(self, **request: Any) -> Any:
        """Send a request and return the answer; raises RuntimeError if the process has ended."""
        requests: IO[str] = self._process.stdin  # type: ignore[assignment]
        requests.write(json.dumps(request) + "\n")
        requests.flush()
        return self._answer()

    def close(self) -> None:
        """Close stdin and wait for the process to end."""
        self._process.communicate()

    def _answer(self) -> Any:
        """Read the next message of the process."""
        answers: IO[str] = self._process.stdout  # type: ignore[assignment]
        line = answers.readline()
        if not line:
            raise RuntimeError(f"The process of {self.name} ended with {self._process.wait()} and gave no answer.")
        return json.loads(line)


def versions(pins: Sequence[str]) -> dict[str, str]:
    """Return the installed versions of the packages that pins name."""
    return {package: version(package) for package in (pin.split("==")[0] for pin in pins)}


def serve(hello: Any, answer: Callable[[dict[str, Any]], Any]) -> None:
    """Answer requests from stdin until it closes; output of libraries is redirected to stderr."""
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    print(json.dumps(hello), file=answers)
    for line in sys.stdin:
        print(json.dumps(answer(json.loads(line))), file=answers)
