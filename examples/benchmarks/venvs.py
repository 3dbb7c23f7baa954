"""Other people's packages, each in a venv and a process of its own, which answers requests of JSON lines."""

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
    """Python of the venv in ``folder`` that holds these packages, made if it is not there yet."""
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
    """A process that runs ``script name *more`` and answers, alive until ``close``; it idles in between.

    Attributes:
        hello: what it said first.
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
        """The answer to a request; RuntimeError where the process ended instead."""
        requests: IO[str] = self._process.stdin  # type: ignore[assignment]
        requests.write(json.dumps(request) + "\n")
        requests.flush()
        return self._answer()

    def close(self) -> None:
        """End the process."""
        self._process.communicate()

    def _answer(self) -> Any:
        answers: IO[str] = self._process.stdout  # type: ignore[assignment]
        line = answers.readline()
        if not line:
            raise RuntimeError(f"The process of {self.name} ended with {self._process.wait()} and gave no answer.")
        return json.loads(line)


def versions(pins: Sequence[str]) -> dict[str, str]:
    """Versions of the packages that pins name, as installed."""
    return {package: version(package) for package in (pin.split("==")[0] for pin in pins)}


def serve(hello: Any, answer: Callable[[dict[str, Any]], Any]) -> None:
    """Be such a process until stdin closes. Only answers go to stdout: what libraries print goes to stderr."""
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    print(json.dumps(hello), file=answers)
    for line in sys.stdin:
        print(json.dumps(answer(json.loads(line))), file=answers)
