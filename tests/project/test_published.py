"""What is published: README as an index shows it, what persons give, and a release rehearsed as CONTRIBUTING says."""

from __future__ import annotations

import importlib.util
import os
import re
import shlex
import shutil
import socket
import subprocess
import sys
import textwrap
import zipfile
from pathlib import Path
from typing import Any

import pytest
from readme_code import README, ROOT, only, without_code

ADDRESS = "https://example.org/somebody/lab-pendulum"
GIVEN: dict[str, Any] = {"address": ADDRESS, "site": "https://example.org/pages", "contact": "somebody@example.org",
                         "authors": ["Ada Lovelace", "Emmy Noether"]}
"""What a person could give."""
CONTRIBUTING = (ROOT / ".github" / "CONTRIBUTING.md").read_text(encoding="utf-8")
OLDEST, NEWEST = 10, 14
"""Minor versions of the Pythons that pyproject.toml names."""


@pytest.fixture(scope="module")
def published() -> Any:
    """The module .ci/published.py, which the build tool loads by its path, too."""
    spec = importlib.util.spec_from_file_location("published", ROOT / ".ci" / "published.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def links(page: str) -> list[tuple[bool, str]]:
    """Return whether it is a picture, and the target, of each link."""
    return [(mark == "!", target) for mark, target in re.findall(r"(!?)\[[^\]]*\]\(([^)]+)\)", without_code(page))]


@pytest.mark.parametrize(("version", "at"), [
    ("0.2.0", "v0.2.0"), ("1.0.0rc1", "v1.0.0rc1"), ("0.2.1.dev3+g1a2b", "HEAD")])
def test_each_link_of_the_published_page_leads_to_a_file(published: Any, version: str, at: str) -> None:
    """Pictures to files as they are, links to pages of the repository, and headings to headings of README."""
    before, after = links(README), links(published.absolute(README, ADDRESS, version))
    assert len(after) == len(before) > 40
    for (picture, old), (still, new) in zip(before, after, strict=True):
        assert picture == still
        if re.match("https?:", old):
            assert new == old
            continue
        start = f"{ADDRESS}/{'raw' if picture else 'blob'}/{at}/"
        assert new.startswith(start)
        name, _, heading = new.removeprefix(start).partition("#")
        assert (ROOT / name).is_file(), new
        assert heading == old.partition("#")[2]
    assert sum(picture for picture, _ in after) == 4


def test_code_of_the_published_page_is_that_of_readme(published: Any) -> None:
    def code(page: str) -> list[str]:
        return re.findall(r"^```.*?^```$", page, flags=re.S | re.M)

    page = published.absolute(f"{README}\n```python\nfound[0](1)\n```\n", ADDRESS, "0.2.0")
    assert code(page) == [*code(README), "```python\nfound[0](1)\n```"]
    assert published.absolute(README, "", "0.2.0") == README


def test_every_place_has_what_was_given_and_nothing_else_needs_it(published: Any) -> None:
    """As it is now, and with everything given; nowhere else stands an address or a name of this project."""
    assert {*published.GIVEN} == {*GIVEN}
    for path in published.pages():
        page = path.read_text(encoding="utf-8")
        assert published.filled(page, published.settings()) == page, f"{path}: run python .ci/published.py"
    whole = {path.name: published.filled(path.read_text(encoding="utf-8"), GIVEN) for path in published.pages()}
    assert {*whole} == {"README.md", "CODE_OF_CONDUCT.md", "CONTRIBUTING.md", "SECURITY.md"}
    cited = re.search(r"@software\{.*\}\n", whole["README.md"])
    assert cited
    assert "author = {Ada Lovelace and Emmy Noether}" in cited[0]
    assert f"url = {{{ADDRESS}}}" in cited[0]
    assert cited[0].count("{") == cited[0].count("}")
    assert f"git clone {ADDRESS} " in whole["CONTRIBUTING.md"]
    assert all(f"<{GIVEN['contact']}>" in whole[name] for name in ("CODE_OF_CONDUCT.md", "SECURITY.md"))
    marks = {name for page in whole.values() for _, name, _ in published.MARKED.findall(page)}
    assert marks == {*published.texts(GIVEN)}
    folders = (".ci", ".github", "examples", "integrators", "pendulum_env", "tests")
    files = [*ROOT.glob("*.*"), *(path for folder in folders for path in (ROOT / folder).rglob("*.*"))]
    found = [(path, text) for path in files if path.suffix in (".md", ".toml", ".yml", ".py", ".html", ".js", ".j2")
             for text in re.findall(r"https?://\S*lab-?pendulum\S*", path.read_text(encoding="utf-8"))
             if path.name not in ("published.py", "pyproject.toml", "test_published.py")]
    assert [pair for pair in found if "pypi.org" not in pair[1]] == []


def test_links_of_the_pages_that_a_forge_shows_lead_to_files() -> None:
    pages = [*(ROOT / ".github").glob("*.md")]
    assert len(pages) == 3
    for path in pages:
        for _, target in links(path.read_text(encoding="utf-8")):
            name = target.partition("#")[0]
            assert target.startswith("https:") or (path.parent / name).is_file(), (path.name, target)


def test_addresses_that_an_index_shows_are_made_from_one(published: Any) -> None:
    assert published.urls("", "") == {}
    assert {*published.urls(ADDRESS, "")} == {"Homepage", "Repository", "Changelog", "Issues"}
    assert all(text.startswith("https://example.org/") for text in published.urls(ADDRESS, GIVEN["site"]).values())


def test_pythons_that_are_named_are_those_that_are_released_and_tested() -> None:
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert re.findall(r"Python :: 3\.(\d+)", project) == [str(minor) for minor in range(OLDEST, NEWEST + 1)]
    assert f'requires-python = ">=3.{OLDEST}"' in project
    release = (ROOT / ".github" / "workflows" / "release.yml").read_text(encoding="utf-8")
    assert f'python: ["3.{OLDEST}", "3.{NEWEST}"]' in release


def pythons() -> list[str]:
    """Return the interpreters of this machine that the package names, from the oldest on; at least the running one."""
    own, found = Path.home() / ".pyenv" / "versions", {}
    for minor in range(OLDEST, NEWEST + 1):
        for path in (shutil.which(f"python3.{minor}"), *sorted(own.glob(f"3.{minor}.*/bin/python"))):
            if path and not subprocess.run([path, "-c", "import venv, ensurepip"], capture_output=True).returncode:
                found[minor] = str(path)
                break
    return [*found.values()] or [sys.executable]


def git(folder: Path, *words: str) -> None:
    who = [word for name in ("user.name", "user.email") for word in ("-c", f"{name}=a@example.org")]
    subprocess.run(["git", "-C", folder, *who, *words], check=True)


@pytest.fixture(scope="module")
def given(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A clone of this checkout in which a person has given everything, as CONTRIBUTING says."""
    if not (ROOT / ".git").exists():
        pytest.skip("a release is made from a checkout")
    folder = tmp_path_factory.mktemp("given") / "lab-pendulum"
    git(ROOT, "clone", "-q", str(ROOT), str(folder))
    project = (folder / "pyproject.toml").read_text(encoding="utf-8")
    for name, value in GIVEN.items():
        project, count = re.subn(rf"^{name} = \S+", f"{name} = {value!r}", project, flags=re.M)
        assert count == 1, name
    (folder / "pyproject.toml").write_text(project, encoding="utf-8")
    subprocess.run([sys.executable, ".ci/published.py", "--whole"], cwd=folder, check=True)
    git(folder, "commit", "-qam", "Addresses")
    return folder


def test_the_steps_of_a_release_are_a_list() -> None:
    """Each begins a line: once a paragraph was wrapped over two of them."""
    steps = re.findall(r"^(\d)\. \*\*(\w+)", CONTRIBUTING.partition("## Make a release")[2], flags=re.MULTILINE)
    assert steps == [("1", "Number"), ("2", "CHANGELOG"), ("3", "Check"), ("4", "Rehearse"), ("5", "Tag"),
                     ("6", "Approve")]


def quiet() -> dict[str, str]:
    """Return the environment without settings of the tests, and without files of bytecode, which take pip a minute."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("TWINE_", "PYTHON", "LAB_"))}
    return {**kept, "PIP_NO_COMPILE": "1", "PIP_DISABLE_PIP_VERSION_CHECK": "1"}


@pytest.fixture(scope="module")
def rehearsed(given: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The folder in which a release was rehearsed by CONTRIBUTING's own commands, on the oldest Python here, and what
    they printed.
    """
    folder = tmp_path_factory.mktemp("rehearsed")
    (block,) = re.findall(r"<!-- rehearsal -->\n +```sh\n(.*?)\n +```", CONTRIBUTING, flags=re.S)
    script = textwrap.dedent(block)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    for old, new in (("../lab-pendulum", str(given)), ("8765", str(port)), ("python3 ", f"{pythons()[0]} ")):
        assert old in script
        script = script.replace(old, new)
    done = subprocess.run(["bash", "-euo", "pipefail", "-c", f"trap 'kill $(jobs -p) 2>/dev/null || :' EXIT\n{script}"],
                          cwd=folder, env=quiet(), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return folder, done.stdout


def run_main_job(scripts: Path, folder: Path) -> None:
    """Run README's first command as installed, for a second of the pendulum's time; each file names the version."""
    job = shlex.split(only(r"<!-- main job -->\n```sh\n.*?&& \.venv/bin/lab-pendulum (.*?)\n```", "the main job"))
    ran = subprocess.run([scripts / "lab-pendulum", *job, "--duration", "1"], cwd=folder, env=quiet(),
                         capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    made = [*(folder / "out" / "compare").iterdir()]
    assert {path.suffix for path in made} >= {".png", ".csv", ".mp4"}
    assert all(b"lab-pendulum 0.2.0" in path.read_bytes() for path in made)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="the rehearsal is written for bash")
def test_a_release_is_rehearsed_to_an_index_and_works_from_there(rehearsed: tuple[Path, str], tmp_path: Path) -> None:
    folder, printed = rehearsed
    assert re.search(r"lab-pendulum 0\.2\.0, sources [0-9a-f]{12}\n$", printed)
    assert printed.count("PASSED") == 2
    (wheel,) = (folder / "index").glob("lab_pendulum-0.2.0-*.whl")
    head, _, page = zipfile.ZipFile(wheel).read("lab_pendulum-0.2.0.dist-info/METADATA").decode().partition("\n\n")
    assert f"Project-URL: Repository, {ADDRESS}\n" in head
    assert "Author: Ada Lovelace, Emmy Noether\n" in head
    assert f"({ADDRESS}/raw/v0.2.0/examples/figures/three_eulers.gif)" in page
    run_main_job(folder / "clean" / "bin", tmp_path)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="the rehearsal is written for bash")
def test_the_archive_works_on_the_newest_python(rehearsed: tuple[Path, str], tmp_path: Path) -> None:
    """Of those here; the wheel was installed on the oldest."""
    (archive,) = (rehearsed[0] / "index").glob("lab_pendulum-0.2.0.tar.gz")
    subprocess.run([pythons()[-1], "-m", "venv", tmp_path / "clean"], check=True)
    subprocess.run([tmp_path / "clean" / "bin" / "pip", "install", "-q", archive], check=True, env=quiet())
    run_main_job(tmp_path / "clean" / "bin", tmp_path)
