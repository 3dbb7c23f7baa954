"""Tests for leaks of memory, objects, threads and open files over many resets, frames, films and environments.

``LAB_PENDULUM_LEAKS=full`` takes a million resets and a hundred thousand frames, by default a fiftieth of them.
"""

from __future__ import annotations

import gc
import os
import threading
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import integrators
import pendulum_env
from pendulum_env import rollout
from pendulum_env.engine import threads
from pendulum_env.render import write_film

pytestmark = pytest.mark.slow

FULL = os.environ.get("LAB_PENDULUM_LEAKS") == "full"
RESETS, FRAMES = (1_000_000, 100_000) if FULL else (8_000, 2_000)
MEGABYTE = 2**20
CACHES = 2**12
"""Memory that may stay allocated once, such as the last step's results [bytes]."""
SMALL_ARRAYS = 5 * CACHES
"""Memory that may stay allocated if there are arrays of many small sizes, which NumPy caches [bytes]."""
OF_A_WINDOW = 256
"""Memory that pygame-ce leaks per opened and closed window [bytes]; about 200 in 2.5.0 and 2.5.8."""
PACKAGES = [str(Path(package.__file__).parent / "*") for package in (pendulum_env, integrators) if package.__file__]
PROCESS = Path("/proc/self")


@pytest.fixture(scope="module", autouse=True)
def from_here_on() -> None:
    """Exclude objects of other tests from garbage collection, which takes seconds for compiled programs."""
    gc.collect()
    gc.freeze()


def resident() -> int:
    """Return the resident memory of this process [bytes], 0 if the system does not report it."""
    try:
        return int((PROCESS / "statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, AttributeError):
        return 0


def handles() -> tuple[int, int, int]:
    """Return the numbers of open files, system threads and Python threads, as far as the system reports them."""
    there = PROCESS.exists()
    counts = [len(os.listdir(PROCESS / name)) if there else 0 for name in ("fd", "task")]
    return counts[0], counts[1], threading.active_count()


def ours() -> int:
    """Return the memory that Python allocated for lines of this package and of these tests [bytes]."""
    files = (*PACKAGES, __file__)
    kept = tracemalloc.take_snapshot().filter_traces([tracemalloc.Filter(True, file) for file in files])
    return sum(each.size for each in kept.traces)


def grows(work: Callable[[int], Any], count: int, name: str, most: float = 2.0, kept: int = CACHES) -> None:
    """Check that ``count`` repetitions of an action leak nothing.

    After the first third, resident memory may grow by ``most`` MB, the memory of the package's lines by ``kept`` bytes,
    the objects by a few, and open files and threads not at all. Objects and the memory of the package's lines are
    measured over another tenth of the repetitions, because that makes Python several times slower.
    """
    for i in range(count // 3):
        work(i)
    gc.collect()
    memory, before = resident(), handles()
    for i in range(count // 3, count):
        work(i)
    gc.collect()
    grown = (resident() - memory) / MEGABYTE
    tracemalloc.start()
    try:
        for i in range(8):
            work(i)
        gc.collect()
        given, objects = ours(), len(gc.get_objects())  # the first filtering compiles patterns, which stay allocated
        some = max(20, min(count // 10, 2000))
        for i in range(some):
            work(i)
        gc.collect()
        more = len(gc.get_objects()) - objects
        traced = ours() - given
    finally:
        tracemalloc.stop()
    print(f"\n{name}: {count}; from a third on {grown:+.2f} MB resident; "
          f"over {some} more {more:+d} objects, {traced:+d} bytes; open files, threads {before} -> {handles()}")
    assert handles() == before
    assert grown < most
    assert more <= 4
    assert traced < 16 * some + kept


def test_a_leak_would_be_seen() -> None:
    kept: list[Any] = []
    with pytest.raises(AssertionError):
        grows(lambda i: kept.append([i] * 8), 3000, "kept lists")
    with pytest.raises(AssertionError):
        grows(lambda i: kept.append(open(os.devnull)), 30, "open files")  # noqa: SIM115
    for file in kept[-100:]:
        if hasattr(file, "close"):
            file.close()
    with pytest.raises(AssertionError):
        grows(lambda i: kept.append(np.ones(4096)), 3000, "kept arrays")


@pytest.mark.parametrize("backend", ["compiled", "python"])
@pytest.mark.parametrize("scene", ["lab", "windy"])
def test_resets(scene: str, backend: str) -> None:
    """Check that resets of a single environment, with one step after every reset, leak nothing."""
    env = gym.make("LabPendulum-v0", scene=scene, backend=backend, substeps=2)
    action = np.zeros(1, dtype=np.float32)
    env.reset(seed=0)

    def once(i: int) -> None:
        env.reset(seed=i if i % 7 == 0 else None)
        env.step(action)

    grows(once, RESETS // 16, f"resets, {scene}, {backend}")
    env.close()


@pytest.mark.parametrize("mode", ["NextStep", "Disabled"])
def test_resets_of_a_vector(mode: str) -> None:
    """Check that resets of a vector (all environments, some, and by autoreset) leak nothing."""
    env: Any = gym.make_vec("LabPendulum-v0", num_envs=300, scene="lab", max_episode_steps=2, backend="compiled",
                            autoreset_mode=mode)
    actions, some = np.zeros((300, 1), dtype=np.float32), np.arange(300) % 2 == 0
    env.reset(seed=0)

    def once(i: int) -> None:
        if mode == "Disabled":
            env.reset(options={"reset_mask": some.copy()})
            env.reset(seed=i)
        env.step(actions)

    grows(once, RESETS * 3 // 8 // 150, f"steps of 300 environments, {mode}")
    env.close()


@pytest.mark.parametrize("vector", [False, True])
def test_frames(vector: bool) -> None:
    options: dict[str, Any] = {"render_mode": "rgb_array", "render_size": 64, "backend": "python"}
    env: Any = gym.make_vec("LabPendulum-v0", num_envs=4, **options) if vector else gym.make(
        "LabPendulum-v0", **options)
    action = np.zeros((4, 1) if vector else 1, dtype=np.float32)
    env.reset(seed=0)

    def once(i: int) -> None:
        if i % 100 == 0:
            env.reset(seed=i)
        env.step(action)
        env.render()

    name = f"frames, {'vector' if vector else 'single'}"
    grows(once, FRAMES // (8 if vector else 2), name, most=4.0, kept=SMALL_ARRAYS)
    env.close()


def test_lives(monkeypatch: pytest.MonkeyPatch) -> None:
    """Check that environments that are created, rendered in a dummy window and closed leak nothing."""
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")

    def once(i: int) -> None:
        mode = ("human", "rgb_array", None)[i % 3]
        scene = ("textbook", "vacuum", "exercise", "exercise_large", "lab")[i % 5]
        env = gym.make("LabPendulum-v0", scene=scene, render_mode=mode, render_size=64, backend="python", dt=1e-3)
        env.reset(seed=i)
        env.step(np.zeros(1, dtype=np.float32))
        if mode:
            env.render()
        env.close()

    grows(once, FRAMES // 100, "lives", most=4.0, kept=2 * CACHES + OF_A_WINDOW * max(20, FRAMES // 1000) // 3)


def test_films_and_files(tmp_path: Path) -> None:
    frames = [np.full((32, 32, 3), 20 * i, dtype=np.uint8) for i in range(8)]
    angles = np.linspace(0.1, 0.5, 5)

    def once(i: int) -> None:
        write_film(tmp_path / f"film{('.mp4', '.gif')[i % 2]}", frames, 25)
        with pytest.raises(ValueError, match="like the first"):
            write_film(tmp_path / f"bad{('.mp4', '.gif')[i % 2]}", [frames[0], frames[0][:9]], 25)
        rollout("vacuum", angle=angles, duration=0.1, backend="python", file=tmp_path / "runs.npy")

    grows(once, FRAMES // 200, "films and files", most=4.0)
    assert {path.name for path in tmp_path.iterdir()} == {"film.mp4", "film.gif", "runs.npy", "runs.npy.json"}


def test_threads_of_batches() -> None:
    """Check that batches keep at most a few thread pools, one per number of threads."""
    angles = np.linspace(0.1, 0.5, 2000)

    def once(i: int) -> None:
        rollout("vacuum", angle=angles, duration=0.1, backend="compiled", num_threads=1 + i % 3)

    grows(once, 300, "batches", most=4.0)
    assert threads.pool.cache_info().currsize <= threads.pool.cache_info().maxsize  # type: ignore[operator]
