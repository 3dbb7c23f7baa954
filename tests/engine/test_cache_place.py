"""Tests of the cache folder's location: from the environment variable, in the home folder, or none."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest
from small_caches import posix, small, uncached

from pendulum_env.auto import store
from pendulum_env.engine import kernels


def nowhere(*_: object) -> Any:
    raise RuntimeError("Could not determine home directory.")


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="these systems have folders of their own")
@pytest.mark.parametrize("named", [None, "", "relative/cache"])
def test_the_folder_of_the_xdg_rules(named: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("LAB_PENDULUM_CACHE", raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    if named is not None:
        monkeypatch.setenv("XDG_CACHE_HOME", named)
    assert kernels.cache_folder() == tmp_path / ".cache" / "lab-pendulum"
    monkeypatch.setattr(Path, "home", nowhere)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "own"))
    assert kernels.cache_folder() == tmp_path / "own" / "lab-pendulum"


@posix
def test_a_tilde_is_the_home_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("LAB_PENDULUM_CACHE", "~/cache")
    assert kernels.cache_folder() == tmp_path / "cache"


@posix
def test_without_a_home_nothing_is_cached(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.delenv("LAB_PENDULUM_CACHE", raising=False)
    monkeypatch.setattr(Path, "home", nowhere)
    kernels.forget()
    assert uncached(Path(), lambda _: kernels.functions(small(), "compiled")["run"](1.5), "no home folder") == 2.5
    kernels.forget()
    assert store.load({"table": 1}) is None
    assert not store.save({"table": 1}, 2.5)


def test_a_relative_folder_stays_where_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Check that a relative cache folder is resolved at once: machine code is written later, perhaps after a chdir."""
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("LAB_PENDULUM_CACHE", "cache")
    kernels.forget()
    run = kernels.functions(small(), "compiled")["run"]
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert run(1.5) == 2.5
    assert sorted(path.suffix for path in (tmp_path / "cache").glob("kernel_*")) == [".nbc", ".py"]
    assert not list((tmp_path / "elsewhere").iterdir())
