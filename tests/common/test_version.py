"""The version: in a checkout git's, as the build tool has it in every state of a repository; else that of a build."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest
from readme_code import ROOT

import pendulum_env
from pendulum_env.common import version

AS_BUILT = ("pyproject.toml", ".gitattributes", ".git_archival.txt", "README.md")
"""Files that decide what the build tool says."""


def git(folder: Path, *words: str) -> str:
    who = {f"GIT_{role}_{what}": "a@example.org" for role in ("AUTHOR", "COMMITTER") for what in ("NAME", "EMAIL")}
    done = subprocess.run(["git", "-C", folder, *words], check=True, capture_output=True, text=True,
                          env={**os.environ, **who, "GIT_CONFIG_GLOBAL": os.devnull})
    return done.stdout.strip()


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    """A repository of two commits with the files that decide the version."""
    folder = tmp_path / "repository"
    folder.mkdir()
    for name in AS_BUILT:
        shutil.copy(ROOT / name, folder / name)
    git(folder, "init", "-q")
    git(folder, "add", ".")
    for text in ("first", "second"):
        git(folder, "commit", "-q", "--allow-empty", "-m", text)
    return folder


def built(folder: Path) -> str:
    """Return the version that the build tool gives a folder."""
    done = subprocess.run([sys.executable, "-m", "hatchling", "version"], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.parametrize(("state", "wanted"), [
    ("no tag", "0.1.dev2+g{commit}"), ("changed", "0.1.dev2+g{commit}.d"), ("tagged", "0.2.0"),
    ("tagged, changed", "0.2.1.dev0+g{commit}.d"), ("one ahead", "0.2.1.dev1+g{commit}"),
    ("candidate", "0.3.0rc1"), ("ahead of it", "0.3.0rc2.dev1+g{commit}"), ("other tags", "0.1.dev2+g{commit}")])
@pytest.mark.quick("no tag-0.1.dev2+g{commit}", "one ahead-0.2.1.dev1+g{commit}")
def test_a_checkout_has_the_version_that_a_build_of_it_would_have(repository: Path, state: str, wanted: str) -> None:
    if state in ("tagged", "tagged, changed", "one ahead"):
        git(repository, "tag", "v0.2.0")
    if state in ("candidate", "ahead of it"):
        git(repository, "tag", "-a", "v0.3.0rc1", "-m", "candidate")
    if state == "other tags":
        git(repository, "tag", "paper")
    if "ahead" in state:
        git(repository, "commit", "-q", "--allow-empty", "-m", "more")
    if "changed" in state:
        (repository / "README.md").write_text("Changed.")
    found = version.of_checkout(repository)
    begun = wanted.format(commit=git(repository, "rev-parse", "--short=9", "HEAD"))
    assert found[:len(begun)] == begun
    assert len(found) == len(begun) + (8 if begun.endswith(".d") else 0)
    assert built(repository) == found


def test_a_clone_of_a_tag_an_archive_of_it_and_files_alone_have_a_version(repository: Path, tmp_path: Path) -> None:
    """A shallow clone without tags, too; and nothing is taken for a checkout of this package that is none."""
    git(tmp_path, "clone", "-q", "--depth", "1", repository.as_uri(), "shallow")
    commit = git(repository, "rev-parse", "--short=9", "HEAD")
    assert version.of_checkout(tmp_path / "shallow") == built(tmp_path / "shallow") == f"0.1.dev1+g{commit}"
    git(repository, "tag", "v0.2.0")
    git(repository, "archive", "-o", str(tmp_path / "archive.tar"), "HEAD")
    with tarfile.open(tmp_path / "archive.tar") as archive:
        archive.extractall(tmp_path / "archive", filter="data")
    assert (built(tmp_path / "archive"), version.of_checkout(tmp_path / "archive")) == ("0.2.0", "")
    shutil.rmtree(repository / ".git")
    assert (built(repository), version.of_checkout(repository)) == (version.UNKNOWN, "")
    (tmp_path / "pyproject.toml").write_text('[project]\nname = "other"\n')
    git(tmp_path, "init", "-q")
    assert version.of_checkout(tmp_path) == ""


def test_git_of_a_hook_is_not_asked_about_its_own_repository(
    repository: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wanted = version.of_checkout(repository)
    monkeypatch.setenv("GIT_DIR", str(ROOT / "nowhere"))
    assert version.of_checkout(repository) == wanted != ""


def test_without_git_the_version_is_that_of_the_installation(
    repository: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", "")
    assert version.of_checkout(repository) == ""


def test_another_installation_s_version_is_not_taken_for_that_of_these_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As where a copy comes first in the path for imports."""
    monkeypatch.setattr(version, "__file__", str(tmp_path / "pendulum_env" / "common" / "version.py"))
    assert version.built.__wrapped__() == version.UNKNOWN


def test_the_version_is_an_attribute_that_is_found_when_asked_for() -> None:
    assert pendulum_env.__version__ == version.version()
    assert version.software() == f"lab-pendulum {version.version()}, sources {version.sources()}"
    asked = ("import sys, pendulum_env\n"
             "sys.exit('pendulum_env.common.version' in sys.modules or not pendulum_env.__version__)")
    assert subprocess.run([sys.executable, "-c", asked], cwd=ROOT, check=False).returncode == 0
