"""Modules of plain loops are compiled by numba, with a cache on disk, or run by Python."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from pendulum_env.engine import kernels
from pendulum_env.engine.kernels import plain_functions

TEXT = '''"""Loops."""

from math import sqrt

__all__ = ["total"]

STEP = 0.25


def root(x):
    return sqrt(x) + STEP


def total(values):
    """Return the sum of the roots."""
    found = 0.0
    for k in range(len(values)):
        found += root(values[k])
    return found
'''
VALUES = np.array([1.0, 4.0, 9.0])


def written(folder: Path, text: str) -> ModuleType:
    """The module with this text, in a file ``loops_of_a_test.py``."""
    file = folder / "loops_of_a_test.py"
    file.write_text(text)
    spec = spec_from_file_location("somewhere.loops_of_a_test", file)
    assert spec
    assert spec.loader
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A cache folder of the test's own."""
    monkeypatch.setenv("LAB_PENDULUM_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv(kernels.VARIABLE, raising=False)
    kernels.forget()
    yield tmp_path / "cache"
    kernels.forget()


def test_only_what_a_module_offers_is_compiled_and_cached(tmp_path: Path, folder: Path) -> None:
    module = written(tmp_path, TEXT)
    loops = plain_functions(module)
    assert [*vars(loops)] == ["total"]
    assert loops.total(VALUES) == module.total(VALUES) == 6.75
    assert len(loops.total.signatures) == 1
    (file,) = folder.glob("loops_*")
    assert file.name.startswith("loops_of_a_test_")
    assert ".total." in file.name
    assert file.suffix == ".nbc"


def test_the_next_process_takes_the_machine_code_of_the_same_text(tmp_path: Path, folder: Path) -> None:
    plain_functions(written(tmp_path, TEXT)).total(VALUES)
    (file,) = folder.glob("loops_*")
    before = file.stat().st_mtime_ns
    kernels.forget()
    again = plain_functions(written(tmp_path, TEXT)).total
    assert again(VALUES) == 6.75
    assert sum(again.stats.cache_hits.values()) == 1
    assert file.stat().st_mtime_ns == before
    kernels.forget()
    assert plain_functions(written(tmp_path, TEXT.replace("0.25", "0.5"))).total(VALUES) == 7.5
    assert len(list(folder.glob("loops_*"))) == 2


def test_damaged_machine_code_is_compiled_again(tmp_path: Path, folder: Path) -> None:
    plain_functions(written(tmp_path, TEXT)).total(VALUES)
    (file,) = folder.glob("loops_*")
    file.write_bytes(file.read_bytes()[:-1])
    kernels.forget()
    again = plain_functions(written(tmp_path, TEXT)).total
    assert again(VALUES) == 6.75
    assert not again.stats.cache_hits
    kernels.forget()
    repaired = plain_functions(written(tmp_path, TEXT)).total
    assert repaired(VALUES) == 6.75
    assert repaired.stats.cache_hits


def test_without_a_cache_everything_works_with_a_warning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: Path
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("LAB_PENDULUM_CACHE", str(tmp_path / "file"))
    with pytest.warns(UserWarning, match="cannot be cached"):
        assert plain_functions(written(tmp_path, TEXT)).total(VALUES) == 6.75


@pytest.mark.parametrize("missing", [False, True])
def test_python_runs_them_where_asked_for_and_where_numba_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: Path, missing: bool
) -> None:
    module = written(tmp_path, TEXT)
    if missing:
        monkeypatch.setitem(sys.modules, "numba", None)
        with pytest.warns(UserWarning, match="numba cannot be imported"):
            loops = plain_functions(module)
    else:
        monkeypatch.setenv(kernels.VARIABLE, "python")
        loops = plain_functions(module)
    assert loops.total is module.total
    assert not folder.exists()


def test_the_environment_variable_counts_at_every_call(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: Path
) -> None:
    module = written(tmp_path, TEXT)
    for backend in ("python", "auto", "python"):
        monkeypatch.setenv(kernels.VARIABLE, backend)
        assert (plain_functions(module).total is module.total) == (backend == "python")


def test_a_function_is_compiled_when_patience_ends_or_its_machine_code_is_stored(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: Path
) -> None:
    """The clock is the test's own: every call of Python's takes a second."""
    monkeypatch.setattr(kernels, "process_time", iter(range(100)).__next__)
    module = written(tmp_path, TEXT)
    patient = plain_functions(module, 2.0)
    for calls, files in enumerate((0, 0, 0, 1, 1)):
        assert patient.total(VALUES) == 6.75
        assert len(list(folder.glob("loops_*"))) == files, calls
    kernels.forget()
    assert plain_functions(module, 2.0).total.stats.cache_hits == {}, "loaded at its first call, as it is stored"
    monkeypatch.setenv(kernels.VARIABLE, "compiled")
    assert plain_functions(module, 2.0).total.signatures == []
