"""What is made once for all processes of a test session, such as environments beside the running one.

These have its packages and the checkout, and what they are to have more.
"""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
import time
import venv
from collections.abc import Callable
from pathlib import Path

import pytest
from readme_code import ROOT

FOREIGN = ("torch==2.13.0", "stable-baselines3>=2.3", "torchrl>=0.14", "minari[create,hdf5]>=0.5.3")
"""Packages of the environment "foreign": one release of torch with a CPU build, because others bring gigabytes of GPU
libraries, and programs that take it as it is."""

LONGEST = 1800.0
"""Time to wait for another process to make one [s]."""


def environment(folders: pytest.TempPathFactory, name: str, *wanted: str) -> Path:
    """Python of an environment that has these requirements, too: made once for all processes of a test session."""
    inside = "Scripts/python.exe" if sys.platform == "win32" else "bin/python"
    return once(folders, name, lambda folder: _make(folder, folder / inside, wanted)) / inside


def once(folders: pytest.TempPathFactory, name: str, make: Callable[[Path], None]) -> Path:
    """The folder ``name``, which ``make`` fills: once for all processes of a test session."""
    base = folders.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / name
    done = folder / "done"
    try:
        folder.mkdir()
    except FileExistsError:
        _await(done)
    else:
        try:
            make(folder)
            said = ""
        except BaseException as error:
            said = f"'{name}' could not be made: {error}"
            raise
        finally:
            (folder / "saying").write_text(said, encoding="utf-8")
            (folder / "saying").replace(done)
    if said := done.read_text(encoding="utf-8"):
        raise RuntimeError(said)
    return folder


def _make(folder: Path, python: Path, wanted: tuple[str, ...]) -> None:
    venv.create(folder, with_pip=True)
    told = subprocess.run([python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"], check=True,
                          capture_output=True, text=True)
    places = dict.fromkeys([sysconfig.get_path("purelib"), sysconfig.get_path("platlib"), str(ROOT)])
    (Path(told.stdout.strip()) / "beside.pth").write_text("\n".join(places) + "\n", encoding="utf-8")
    # Compiling all of torch would take longer than installing it.
    subprocess.run([python, "-m", "pip", "install", "-q", "--no-compile", *wanted], check=True)


def _await(done: Path) -> None:
    """Wait for the process that makes it."""
    begun = time.monotonic()
    while not done.exists():
        if time.monotonic() - begun > LONGEST:
            raise RuntimeError(f"{done.parent} is not there after {LONGEST:g} s.")
        time.sleep(0.1)
