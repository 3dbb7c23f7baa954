"""Tests of the cache of compiled programs: many processes, damaged files, full disks, folders writable by others."""

from __future__ import annotations

import errno
import os
import pickle
import random
import shutil
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import llvmlite
import numba
import numpy as np
import pytest
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv
from numba.core import codegen
from planted import Planted
from small_caches import Start, posix, small, uncached

import integrators
from pendulum_env import SCENES
from pendulum_env.common import replacing, trust
from pendulum_env.engine import compiling, kernels
from pendulum_env.engine.generate import program


def listing(folder: Path) -> dict[str, tuple[int, int]]:
    """Return every file in a folder with the properties that change when it is rewritten."""
    stats = {str(path.relative_to(folder)): path.stat() for path in folder.rglob("*") if path.is_file()}
    return {name: (stat.st_ino, stat.st_mtime_ns) for name, stat in stats.items()}


@pytest.fixture
def warm(tmp_path: Path, start: Start) -> Path:
    """Return a cache folder with the source and the machine code of one program."""
    folder = tmp_path / "deep" / "cache"
    assert start(folder) == 2.5
    return folder


def only(folder: Path, pattern: str) -> Path:
    (path,) = folder.glob(pattern)
    return path


def test_a_warm_start_writes_nothing(warm: Path, start: Start) -> None:
    before = listing(warm)
    assert sorted(Path(name).suffix for name in before) == [".nbc", ".nbc", ".py", ".py"], "program and trial of numba"
    assert start(warm) == 2.5
    assert listing(warm) == before


def test_code_that_was_rewritten_in_another_way_is_not_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After an upgrade, and after one that folds otherwise, programs of the same text are compiled anew."""
    monkeypatch.setenv("LAB_PENDULUM_CACHE", str(tmp_path))
    found = program(SCENES["textbook"], integrators.get("symplectic_euler"), ())
    for _ in range(2):
        kernels.compiled(found.text, found.title)
    assert len(list(tmp_path.glob("*.py"))) == 1
    monkeypatch.setattr(kernels, "built", lambda: "99.0")
    kernels.compiled(found.text, found.title)
    assert len(list(tmp_path.glob("*.py"))) == 2
    monkeypatch.setattr(kernels, "rewriting", lambda: ("another",))
    kernels.compiled(found.text, found.title)
    assert len(list(tmp_path.glob("*.py"))) == 3


COMPILER = """
import sys
from pendulum_env import SCENES
from pendulum_env.engine.machine import Machine
machine = Machine(SCENES["textbook"], "symplectic_euler", backend="compiled")
machine.advance(machine.state(0.5, 0.0), 0.0, 0.004, 10)
print("numba.np.arraymath" in sys.modules)
if "numba.np.arraymath" in sys.modules:
    sys.exit()
import numba, numpy
print(numba.njit(lambda numbers: numpy.sort(numbers).mean())(numpy.arange(3.0)))
"""


@pytest.mark.slow
def test_a_warm_start_loads_no_compiler(tmp_path: Path) -> None:
    """And what a user compiles afterwards finds all of numba's implementations."""
    said = [subprocess.run([sys.executable, "-c", COMPILER], env={**os.environ, "LAB_PENDULUM_CACHE": str(tmp_path)},
                           capture_output=True, text=True, check=True).stdout.split() for _ in range(2)]
    assert said == [["True"], ["False", "1.0"]]


# --- damaged files --------------------------------------------------------------------------------------------------


DAMAGE: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda content: b"",
    "truncated": lambda content: content[: len(content) // 2],
    "one byte short": lambda content: content[:-1],
    "foreign": lambda content: b"\x80foreign" * 99,
    "one bit": lambda content: content[:300] + bytes([content[300] ^ 1]) + content[301:],
    "a hole": lambda content: content[:99] + bytes(99) + content[198:],
}


@pytest.mark.quick("one byte short-kernel_*.py", "one bit-kernel_*.nbc")
@pytest.mark.parametrize("pattern", ["kernel_*.py", "kernel_*.nbc"])
@pytest.mark.parametrize("damage", [
    pytest.param(one, marks=() if one in ("one bit", "one byte short") else pytest.mark.slow) for one in DAMAGE])
def test_a_damaged_file_is_made_anew(damage: str, pattern: str, warm: Path, start: Start) -> None:
    path = only(warm, pattern)
    whole = path.read_bytes()
    path.write_bytes(DAMAGE[damage](whole))
    assert path.read_bytes() != whole
    before = listing(warm)
    assert start(warm) == 2.5
    after = listing(warm)
    assert {name for name in after if after[name] != before.get(name)} == {path.name}, "only the damaged file is new"
    assert start(warm) == 2.5
    assert listing(warm) == after, "the new file is not whole"


@pytest.mark.slow
def test_every_flipped_byte_is_seen(warm: Path, start: Start) -> None:
    path = only(warm, "kernel_*.nbc")
    whole, source = path.read_bytes(), random.Random(1)
    for place in (0, 31, 32, len(whole) - 1, *(source.randrange(len(whole)) for _ in range(8))):
        damaged = bytearray(whole)
        damaged[place] ^= source.randrange(1, 256)
        path.write_bytes(damaged)
        assert start(warm) == 2.5
        assert path.read_bytes() != damaged, f"byte {place}"


def other_processor(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(codegen.JITCPUCodegen, "magic_tuple", lambda self: ("another", "processor", "+fast"))


OTHERS: dict[str, Callable[[pytest.MonkeyPatch], None]] = {
    "processor": other_processor,
    "numba": lambda patch: patch.setattr(numba, "__version__", "99.0"),
    "llvmlite": lambda patch: patch.setattr(llvmlite, "__version__", "99.0"),
    "package": lambda patch: patch.setattr(kernels, "built", lambda: "99.0"),
}


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:A program's arithmetic could not be written")  # that of whole numbers
@pytest.mark.parametrize("other", ["package", *(
    pytest.param(other, marks=pytest.mark.slow) for other in (*OTHERS, "program", "signature") if other != "package")])
def test_machine_code_of_something_else_is_not_taken(other: str, warm: Path, start: Start) -> None:
    """Each file is whole, but of another version, processor, program or signature, and copied over the right one."""
    path = only(warm, "kernel_*.nbc")
    with pytest.MonkeyPatch.context() as patch:
        OTHERS.get(other, lambda _: None)(patch)
        kernels.forget()
        x: Any = 2 if other == "signature" else 1.5
        kernels.functions(small(0.5 if other == "program" else 0.25), "compiled")["run"](x)
    (foreign,) = {*warm.glob("kernel_*.nbc")} - {path}
    shutil.copyfile(foreign, path)
    assert start(warm) == 2.5
    assert path.read_bytes() != foreign.read_bytes(), "the foreign code is taken"


# --- links ------------------------------------------------------------------------------------------------------------


@pytest.mark.quick("a file-kernel_*.py", "nothing-kernel_*.nbc")
@posix
@pytest.mark.parametrize("pattern", ["kernel_*.py", "kernel_*.nbc"])
@pytest.mark.parametrize("content", ["thesis", None], ids=["a file", "nothing"])
def test_a_link_in_a_files_place_is_not_followed(
    pattern: str, content: str | None, warm: Path, start: Start
) -> None:
    """Neither in writing, which would replace any file of the user by machine code, nor in reading."""
    path, mine = only(warm, pattern), warm.with_name("thesis.tex")
    if content:
        mine.write_text(content)
    path.unlink()
    path.symlink_to(mine)
    assert start(warm) == 2.5
    assert not path.is_symlink()
    assert (mine.read_text() if content else mine.exists()) == (content or False)
    whole, moved = path.read_bytes(), warm.with_name("elsewhere")
    path.rename(moved)
    path.symlink_to(moved)
    assert start(warm) == 2.5
    assert not path.is_symlink(), "what a link leads to is read"
    assert moved.read_bytes() == whole


@posix
def test_a_folder_that_became_a_link_is_checked_again(tmp_path: Path, start: Start) -> None:
    """Machine code is written with the first call, when the folder may have changed."""
    folder, shared = tmp_path / "cache", tmp_path / "shared"
    start(folder)
    shared.mkdir()
    shared.chmod(0o777)
    run = kernels.functions(small(0.5), "compiled")["run"]
    folder.rename(tmp_path / "before")
    folder.symlink_to(shared)
    with pytest.warns(UserWarning, match="other users can write to"):
        assert run(1.5) == 2.75
    assert not list(shared.iterdir())


@posix
def test_a_folder_behind_a_link_of_somebody_else_is_not_used(tmp_path: Path, start: Start) -> None:
    """Anybody can put a link into a folder such as /tmp, under the name that a user's cache will have."""
    if os.geteuid():
        pytest.skip("only root can give a link away")
    mine, link = tmp_path / "mine", tmp_path / "cache"
    mine.mkdir(mode=0o700)
    link.symlink_to(mine)
    os.chown(link, 12345, -1, follow_symlinks=False)
    assert uncached(link, start, f"{link} belongs to another user") == 2.5
    assert not list(mine.iterdir())


# --- folders that cannot be written ---------------------------------------------------------------------------------




def refuse(number: int) -> Callable[..., Any]:
    def refusing(*_: object, **__: object) -> Any:
        raise OSError(number, os.strerror(number))

    return refusing


@pytest.mark.quick("os-replace-28")
@pytest.mark.parametrize(("module", "name", "number"), [
    (os, "replace", errno.ENOSPC), (replacing, "_part", errno.EROFS), (replacing, "_part", errno.EACCES),
])
def test_what_cannot_be_written_is_compiled_uncached(
    module: Any, name: str, number: int, tmp_path: Path, start: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "cache"
    monkeypatch.setattr(module, name, refuse(number))
    assert uncached(folder, start, os.strerror(number)) == 2.5
    assert not list(folder.iterdir()), "something is left behind"


def test_a_file_in_the_folders_place(tmp_path: Path, start: Start) -> None:
    file = tmp_path / "file"
    file.write_text("mine")
    assert uncached(file, start, str(file)) == 2.5
    assert file.read_text() == "mine"


def test_a_warm_folder_is_read_without_writing(warm: Path, start: Start, monkeypatch: pytest.MonkeyPatch) -> None:
    """Check that a filled cache folder is read without a write, as on a read-only disk, and without a warning."""
    monkeypatch.setattr(replacing, "_part", refuse(errno.EROFS))
    monkeypatch.setattr(os, "replace", refuse(errno.EROFS))
    assert start(warm) == 2.5


FULL_DISK = """
import resource, sys, warnings
from dataclasses import replace
import integrators
from pendulum_env import SCENES
from pendulum_env.common import replacing
from pendulum_env.engine.generate import program
from pendulum_env.engine.kernels import functions

limit, *texts = sys.argv[1:]
resource.setrlimit(resource.RLIMIT_FSIZE, (int(limit), int(limit)))
pendulum = program(SCENES["textbook"], integrators.get("symplectic_euler"))
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    print(*(functions(replace(pendulum, text=text), "compiled")["run"](1.5) for text in texts))
print(*(warning.message for warning in caught), sep="\\n")
"""


@pytest.mark.slow
@posix
@pytest.mark.parametrize("kept", [[], [".py", ".py"]], ids=["nothing fits", "the texts fit"])
def test_a_disk_that_fills_up(kept: list[str], warm: Path) -> None:
    """Check that a program runs if the operating system stops a write to the cache half way, as on a full disk."""
    limit = 2 * only(warm, "kernel_*.py").stat().st_size if kept else 100
    assert limit < only(warm, "kernel_*.nbc").stat().st_size
    folder = warm.with_name("small")
    command = [sys.executable, "-c", FULL_DISK, str(limit), small().text, small(0.5).text]
    own = {**os.environ, "LAB_PENDULUM_CACHE": str(folder)}
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=own)
    results, *warned = done.stdout.splitlines()
    assert results == "2.5 2.75"
    assert len(warned) == 1
    assert os.strerror(errno.EFBIG) in warned[0]
    assert [path.suffix for path in folder.glob("kernel_*")] == kept


# --- whose folder it is ---------------------------------------------------------------------------------------------


@pytest.fixture
def planted(warm: Path, start: Start) -> Path:
    """Return a cache folder with a foreign file that has a machine code's name and a correct digest."""
    only(warm, "kernel_*.nbc").unlink()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compiling, "stored", lambda result: pickle.dumps(Planted(warm.with_name("trace"))))
        start(warm)
    return warm


@pytest.mark.quick("493")
@posix
@pytest.mark.parametrize("mode", [0o700, 0o750, 0o755])
def test_a_folder_that_others_can_only_read_is_used(mode: int, planted: Path, start: Start) -> None:
    """Check that code in a folder that others can only read is run; the next tests rely on this visible effect."""
    planted.chmod(mode)
    assert start(planted) == 2.5
    assert planted.with_name("trace").exists()


@posix
@pytest.mark.parametrize("mode", [
    0o777, *(pytest.param(mode, marks=pytest.mark.slow) for mode in (0o775, 0o722, 0o702, 0o1777))])
def test_a_folder_that_others_can_write_to_is_not_used(
    mode: int, planted: Path, start: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Check that a folder that others can write to is not used, even with a sticky bit."""
    monkeypatch.setattr(trust, "shared_with_nobody", lambda path: False)
    before = listing(planted)
    planted.chmod(mode)
    assert uncached(planted, start, "other users can write to it") == 2.5
    assert listing(planted) == before
    assert not planted.with_name("trace").exists()


@posix
def test_a_folder_of_somebody_else_is_not_used(planted: Path, start: Start, monkeypatch: pytest.MonkeyPatch) -> None:
    before, me = listing(planted), os.geteuid()
    monkeypatch.setattr(os, "geteuid", lambda: me + 1)
    assert uncached(planted, start, "it belongs to another user") == 2.5
    assert listing(planted) == before
    assert not planted.with_name("trace").exists()


@posix
def test_a_new_folder_is_the_users_own(tmp_path: Path, start: Start) -> None:
    """Check that new cache folders and files belong to the user only, and are usable again, under any umask."""
    folder = tmp_path / "new" / "home" / "cache"
    mask = os.umask(0)
    try:
        assert start(folder) == 2.5
        before = listing(folder)
        assert start(folder) == 2.5
    finally:
        os.umask(mask)
    assert listing(folder) == before
    assert [each.stat().st_mode & 0o777 for each in (folder, *folder.parents[:2])] == [0o700] * 3
    assert {path.stat().st_mode & 0o777 for path in folder.iterdir()} == {0o600}


# --- many processes at once -----------------------------------------------------------------------------------------


@pytest.mark.slow
def test_four_processes_share_a_cold_cache(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Check that four processes that start at once with an empty cache give the motions of successive environments."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("LAB_PENDULUM_CACHE", str(folder))
    make = partial(gym.make, "pendulum_env:LabPendulum-v0", integrator="symplectic_euler", backend="compiled")
    one_by_one = SyncVectorEnv([partial(make, backend="python")] * 4)
    at_once = AsyncVectorEnv([make] * 4, context="spawn")
    try:
        expected, _ = one_by_one.reset(seed=1)
        observed, _ = at_once.reset(seed=1)
        assert len(np.unique(observed[:, 0])) == 4
        assert np.array_equal(observed, expected)
        at_once.action_space.seed(2)
        for _ in range(50):
            action = at_once.action_space.sample()
            for got, wanted in zip(at_once.step(action)[:4], one_by_one.step(action)[:4], strict=True):
                assert np.array_equal(got, wanted)
    finally:
        at_once.close()
        one_by_one.close()
    assert sorted(path.suffix for path in folder.glob("kernel_*")) == [".nbc", ".py"]
    assert "cannot be cached" not in capfd.readouterr().err
    before = listing(folder)
    kernels.forget()
    make().reset()
    assert listing(folder) == before, "what four processes left behind does not serve the fifth"
