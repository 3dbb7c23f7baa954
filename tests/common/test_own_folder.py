"""Tests that compiled programs and choices of auto are read only from a folder that no other user can change."""

from __future__ import annotations

import hashlib
import os
import pickle
import subprocess
import sys
from pathlib import Path

import pytest
from planted import Planted, code

from pendulum_env.auto import store
from pendulum_env.common import trust
from pendulum_env.common.trust import own_bytes, own_folder

posix = pytest.mark.skipif(sys.platform == "win32", reason="folders have owners and modes on POSIX only")


@pytest.fixture
def deep(tmp_path: Path) -> Path:
    folder = tmp_path / "above" / "cache"
    folder.mkdir(parents=True, mode=0o700)
    folder.chmod(0o700)
    return folder


@posix
@pytest.mark.parametrize(("mode", "why"), [
    (0o755, ""), (0o700, ""), (0o1777, ""), (0o1775, ""),
    (0o777, "other users can write to"), (0o757, "other users can write to"),
])
def test_folders_above(mode: int, why: str, deep: Path) -> None:
    """A user who can write to a parent folder can replace this one, unless a sticky bit prevents it."""
    deep.parent.chmod(mode)
    if why:
        with pytest.raises(PermissionError, match=f"{why} {deep.parent}"):
            own_folder(deep)
    else:
        assert own_folder(deep) == deep.resolve()


@posix
@pytest.mark.parametrize(("group", "members", "id", "fine"), [
    ("ann", [], 1000, True), ("ann", ["ann"], 1000, True), ("root", [], 0, True),
    ("ann", ["ann", "bob"], 1000, False), ("students", ["ann"], 1000, False), ("students", [], 1000, False),
])
def test_a_group_of_ones_own(
    group: str, members: list[str], id: int, fine: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Some systems give each user a group of their own, which can write to the user's files."""
    import grp
    import pwd

    monkeypatch.setattr(grp, "getgrgid", lambda _: grp.struct_group((group, "x", id, members)))
    monkeypatch.setattr(pwd, "getpwuid", lambda _: pwd.struct_passwd(("ann", "x", 1000, 1000, "", "/", "/bin/sh")))
    assert trust.shared_with_nobody(os.stat_result((0o40775, 0, 0, 1, 1000, id, 0, 0, 0, 0))) is fine
    assert not trust.shared_with_nobody(os.stat_result((0o40777, 0, 0, 1, 1000, id, 0, 0, 0, 0)))


@posix
@pytest.mark.parametrize("alone", [True, False])
def test_a_folder_of_a_group_of_ones_own(alone: bool, deep: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Check a folder that the user's own group can write to."""
    monkeypatch.setattr(trust, "shared_with_nobody", lambda found: alone)
    deep.chmod(0o775)
    if alone:
        assert own_folder(deep) == deep.resolve()
    else:
        with pytest.raises(PermissionError, match="other users can write to it"):
            own_folder(deep)


@posix
def test_folders_that_are_made_are_the_users_own(deep: Path) -> None:
    """Check new folders under every umask; an existing folder keeps its mode."""
    before = os.umask(0o002)
    try:
        made = own_folder(deep / "new" / "home" / "cache")
    finally:
        os.umask(before)
    assert [each.stat().st_mode & 0o777 for each in (made, *made.parents[:2])] == [0o700] * 3


@posix
def test_a_folder_above_of_somebody_else(deep: Path) -> None:
    if os.geteuid():
        pytest.skip("only root can give a folder away")
    os.chown(deep.parent, 12345, -1)
    with pytest.raises(PermissionError, match=f"{deep.parent} belongs to another user"):
        own_folder(deep)


@posix
def test_a_link_in_the_path_is_followed_once(deep: Path, tmp_path: Path) -> None:
    """Check that the resolved folder is returned, so that the owner of a link cannot redirect later access."""
    link = tmp_path / "link"
    link.symlink_to(deep.parent)
    assert own_folder(link / "cache") == deep.resolve()
    assert link.name not in own_folder(link / "cache").parts
    deep.chmod(0o777)
    with pytest.raises(PermissionError):
        own_folder(link / "cache")


@posix
def test_a_file_that_others_could_write_is_not_read(deep: Path) -> None:
    path = deep / "file"
    path.write_bytes(b"whole")
    path.chmod(0o644)
    assert own_bytes(path) == b"whole"
    path.chmod(0o664)
    with pytest.raises(PermissionError):
        own_bytes(path)
    if not os.geteuid():
        path.chmod(0o644)
        os.chown(path, 12345, -1)
        with pytest.raises(PermissionError):
            own_bytes(path)


COMPILING = """
import sys, warnings
from dataclasses import replace
import integrators
from pendulum_env import SCENES
from pendulum_env.engine.generate import program
from pendulum_env.engine.kernels import functions

text = "@entry\\ndef run(x):\\n    return 2.0*x + " + sys.argv[1] + "\\n"
pendulum = program(SCENES["textbook"], integrators.get("symplectic_euler"))
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    for more in ("", "# another\\n"):
        made = replace(pendulum, text=text + more, title="small")
        print(functions(made, "compiled")["run"](1.5), functions(made, "python")["run"](1.5))
print(*(warning.message for warning in caught), sep="\\n")
"""


def compiled(folder: Path) -> list[str]:
    done = subprocess.run([sys.executable, "-c", COMPILING, "0.25"], capture_output=True, text=True, check=True,
                          env={**os.environ, "LAB_PENDULUM_CACHE": str(folder)})
    results, warned = done.stdout.splitlines()[:2], [line for line in done.stdout.splitlines()[2:] if line]
    assert results == ["3.25 3.25"] * 2
    return warned


@posix
@pytest.mark.slow
def test_a_cache_that_somebody_else_could_exchange(deep: Path, tmp_path: Path) -> None:
    """Check that an unsafe cache folder, or a single unsafe file, is neither read nor written, with one warning."""
    assert compiled(deep) == []
    trace = tmp_path / "trace"
    content = pickle.dumps(Planted(trace))
    for path in deep.glob("*.nbc"):
        path.write_bytes(hashlib.sha256(content).digest() + content)
    for path in deep.glob("*.py"):
        path.write_text(code(trace))
    before = {path.name: path.stat().st_mtime_ns for path in deep.iterdir()}
    deep.parent.chmod(0o777)
    (warned,) = compiled(deep)
    assert f"other users can write to {deep.parent}" in warned
    assert before == {path.name: path.stat().st_mtime_ns for path in deep.iterdir()}
    deep.parent.chmod(0o755)
    for path in deep.iterdir():
        path.chmod(0o666)
    assert compiled(deep) == []
    assert not trace.exists()


@posix
def test_a_kept_choice_that_somebody_else_could_write(deep: Path) -> None:
    path = deep / "auto_costs.json"
    assert store.save({"table": 1}, 2.5, path)
    assert store.load({"table": 1}, path) == 2.5
    deep.chmod(0o777)
    assert store.load({"table": 1}, path) is None
    assert not store.save({"table": 1}, 3.5, path)
    deep.chmod(0o700)
    assert store.load({"table": 1}, path) == 2.5
