"""What all tests share: seeds, skips, and programs compiled once for all processes."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy: threads that wait for each other take half the time

import pytest
from bench_clock import bench_clock
from choice import is_quick
from command_line import run_here
from fake_clock import clock
from hypothesis import HealthCheck, settings
from only_new import NEW
from small_caches import start

__all__ = ["bench_clock", "clock", "run_here", "start"]  # fixtures of several tests

settings.register_profile("same", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("same")
if os.environ.pop("PYTHONDONTWRITEBYTECODE", None):  # each file compiled once, but not by each of hundreds of processes
    sys.dont_write_bytecode = False
    sys.pycache_prefix = str(Path(__file__).parents[1] / ".pytest_cache" / "bytecode")  # nothing stays beside the files
    os.environ["PYTHONPYCACHEPREFIX"] = sys.pycache_prefix
os.environ.setdefault("SDL_VIDEODRIVER", "dummy")  # windows that nobody sees, of Gymnasium's checkers too


@pytest.fixture(scope="session")
def recordings() -> Path:
    """Folder of real recordings, which are no part of the package."""
    folder = os.environ.get("LAB_PENDULUM_DATA")
    if not folder:
        pytest.skip("LAB_PENDULUM_DATA does not name a folder of recordings")
    return Path(folder)


@pytest.fixture
def interpreted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs that ask for no backend are interpreted, in processes too: the same bits, and sooner where steps are few."""
    monkeypatch.setenv("LAB_PENDULUM_BACKEND", "python")


@pytest.fixture(scope="module")
def all_interpreted() -> Iterator[None]:
    """The same for a whole file, fixtures of its own included."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("LAB_PENDULUM_BACKEND", "python")
        yield


@pytest.fixture
def no_remedies(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fits look for no fault of their recording: most of their time, which changes nothing if there is none."""
    monkeypatch.setattr("pendulum_env.lab.fitting.fit.remedies_of", lambda *_: ())


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Tens of thousands of cases stay to the end: no search for garbage goes through them, then or later."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.collect()
        gc.freeze()
        gc.enable()
        gc.set_threshold(100_000, 20, 20)  # compiling makes many objects, and little garbage


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Half of the tests in a row for each of two processes: a file's fixtures and programs are made in one of them."""
    from xdist.scheduler import WorkStealingScheduling

    return WorkStealingScheduling(config, log) if config.getoption("dist") == "load" else None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[Any]) -> None:
    """Mark the cases that quick tests leave out; a test that names its quick cases must have each of them."""
    named: dict[Any, set[str]] = {}
    for item in items:
        case = getattr(item, "callspec", None)
        if not case:
            continue
        mark = item.get_closest_marker("quick")
        if mark:
            named.setdefault((item.parent, item.originalname), set(mark.args)).discard(case.id)
            takes = case.id in mark.args or any(name in case.id for name in NEW)
        else:
            takes = is_quick(item.path.stem, item.originalname, case.id, case.params)
        if not takes:
            item.add_marker(pytest.mark.slow)
    missing = {f"{where.name}::{test}": sorted(rest) for (where, test), rest in named.items() if rest}
    if missing and not any("::" in word for word in config.args):  # where one case is asked for, others do not count
        raise pytest.UsageError(f"no such case, which the mark quick names: {missing}")
