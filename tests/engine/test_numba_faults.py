"""Tests of a numba that cannot be imported, or whose private names have gone: Python runs all, with one warning."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_caches import posix

from pendulum_env import rollout
from pendulum_env.engine import compiling, kernels
from pendulum_env.engine.kernels import EngineError
from pendulum_env.render import Apparatus, View, frame

SCRIPT = Path(__file__).parents[1] / "support" / "without_names.py"


@pytest.fixture(autouse=True)
def fresh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv("LAB_PENDULUM_CACHE", str(tmp_path / "cache"))
    kernels.forget()
    yield
    kernels.forget()


def motion_and_frame() -> tuple[bytes, bytes]:
    motion = rollout("vacuum", integrator="forward_euler", duration=0.05)
    picture = frame(Apparatus(length=0.353, bob_radius=0.0107, suspension="wire"), View(time=0.0, angle=0.5), size=64)
    return motion.angle.tobytes(), picture.tobytes()


def check_python(match: str) -> None:
    """Check that programs and frames are interpreted, with one warning, and have the bits of compiled ones."""
    with pytest.warns(UserWarning, match=match) as caught:
        fallen_back = motion_and_frame()
    assert kernels.resolve() == "python"
    assert len(caught) == 1
    with pytest.raises(EngineError, match=match):
        kernels.resolve("compiled")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("LAB_PENDULUM_BACKEND", "python")
        assert motion_and_frame() == fallen_back


class Failing:
    """A finder of modules that raises an error for numba, as a broken installation does."""

    def __init__(self, error: Exception) -> None:
        self.error = error

    def find_spec(self, name: str, *_: object) -> Any:
        if name == "numba":
            raise self.error
        return None


@pytest.mark.parametrize("error", [
    ImportError("Numba needs NumPy 2.5 or less"),
    OSError("Could not find/load shared object file 'libllvmlite.so'"),
    SystemError("initialization of _internal failed without raising an exception"),
    AttributeError("module 'numpy' has no attribute 'long'"),
    ValueError("numpy.dtype size changed"),
], ids=lambda error: type(error).__name__)
def test_numba_that_fails_at_import(error: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "numba")
    monkeypatch.setattr(sys, "meta_path", [Failing(error), *sys.meta_path])
    check_python(rf"numba cannot be imported \({type(error).__name__}: ")


def test_a_trial_that_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    """A name that has gone where the first program is compiled."""
    monkeypatch.delattr(compiling, "load_array_functions")
    check_python("numba .* cannot compile this package's programs")


def test_a_trial_with_another_result(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernels, "TRIAL", kernels.TRIAL.replace("*0.25", "*0.2500001"))
    check_python("computes 2.7500002 in a trial whose result is 2.75")


def test_the_trial_is_made_once(tmp_path: Path) -> None:
    assert kernels.resolve() == "compiled"
    (code,) = (tmp_path / "cache").glob("trial_*.nbc")
    before = code.stat().st_mtime_ns
    kernels.forget()
    assert kernels.resolve() == "compiled"
    assert code.stat().st_mtime_ns == before


NOT_NEEDED = ("numba.core.cgutils", "numba.core.types:unliteral", "numba.types:unliteral", "numba:types")
"""Names that only the writing of instructions needs, so that numba compiles the arithmetic without them; and
``numba:types``, beside which numba has a module of this name.
"""


def without(*names: str) -> list[list[str]]:
    """Return name, backend, number of warnings and digest of runs without these names of numba; all if none is given.
    """
    done = subprocess.run([sys.executable, SCRIPT, *names], capture_output=True, text=True, check=True,
                          env={name: value for name, value in os.environ.items() if name != kernels.VARIABLE})
    return [line.split(maxsplit=4) for line in done.stdout.splitlines()]


def check_without(*names: str) -> list[str]:
    """Check runs without these names of numba, and return the names."""
    (first, backend, warned, digest), *lines = without(*names)
    assert (first, backend, warned) == ("nothing", "compiled", "0")
    for name, *found in lines:
        if name.startswith(NOT_NEEDED) and found[0] == "compiled":
            assert int(found[1]) <= 1, found
            assert found[2] == digest, name
        else:
            assert found[:3] == ["python", "1", digest], (name, found)
            assert "cannot compile this package's programs" in found[3]
    return [line[0] for line in lines]


@pytest.mark.slow
@posix
def test_a_few_private_names_that_have_gone() -> None:
    names = ["numba.core.serialize:dumps", "numba.core.codegen:JITCodeLibrary._finalize_dynamic_globals"]
    assert check_without(*names) == names


@posix
@pytest.mark.slow
def test_every_private_name_that_has_gone() -> None:
    """Also every name that a line of the package imports from numba, found here by its words alone."""
    folder = Path(str(kernels.__file__)).parents[1]
    wanted = {f"{module}:{name.strip()}" for file in folder.rglob("*.py")
              for module, names in re.findall(r"^\s*from (numba\S*) import (\([^)]*\)|.*)",
                                              re.sub("#.*", "", file.read_text("utf-8")), re.MULTILINE)
              for name in names.strip("()").split(",") if name.strip()}
    assert {"numba.core:compiler", "numba.core.cgutils:ir", "numba.extending:intrinsic"} <= wanted <= {*check_without()}


@pytest.mark.slow
def test_compiled_bits_are_those_of_python(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the tests above compare with: compiled programs and frames have the bits of interpreted ones."""
    compiled = motion_and_frame()
    monkeypatch.setenv("LAB_PENDULUM_BACKEND", "python")
    assert motion_and_frame() == compiled
    assert np.any(np.frombuffer(compiled[1], np.uint8))
