"""Every README of the project, its code, run as readers would, and its tables."""

from __future__ import annotations

import contextlib
import io
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any, cast

from integrators import RungeKutta
from integrators.method import exact
from pendulum_env.common.texts import Table
from pendulum_env.envs.settings import settings_table
from pendulum_env.study.lists.tables import TABLES

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("examples", "integrators", "pendulum_env", "tests")
PATHS = (ROOT / "README.md", *sorted(path for folder in FOLDERS for path in (ROOT / folder).rglob("README.md")))
"""Files: the front page, and the pages of the rooms."""
READMES = {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in PATHS}
"""Path below the project's folder -> text."""
README = READMES["README.md"]
"""The front page."""


def only(pattern: str, what: str) -> str:
    """Return what a pattern's one group matches in the READMEs; AssertionError unless it matches exactly once."""
    found = [text for page in READMES.values() for text in re.findall(pattern, page, flags=re.S)]
    assert len(found) == 1, f"{len(found)} READMEs have {what}, not 1."
    return str(found[0])


def block(mark: str) -> str:
    """Return the code behind a mark."""
    return only(rf"<!-- {mark} -->\n```python\n(.*?)```", f"code marked '{mark}'")


def table(mark: str) -> str:
    """Return the table between a mark and the mark of its end."""
    return only(rf"<!-- {mark} -->\n\n(.*?)\n\n<!-- end -->", f"a table marked '{mark}'")


def without_code(page: str) -> str:
    """Return a page's text outside of its blocks of code."""
    return re.sub(r"^```.*?^```$", "", page, flags=re.S | re.M)


def run(code: str, folder: Path) -> tuple[dict[str, Any], list[str]]:
    """The names that code leaves, and what it prints; from a file, where the engine finds its functions' source."""
    names: dict[str, Any] = {}
    path = folder / "readme.py"
    path.write_text(code, encoding="utf-8")
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(compile(code, str(path), "exec"), names)
    return names, printed.getvalue().splitlines()


def method_entry() -> str:
    """Return the table entry of the method that a README adds as an example."""
    entry = re.search(r"= (RungeKutta\(\n.*?\n\))\n", block("adding a method"), flags=re.S)
    assert entry
    return entry[1]


def method_of_readme() -> RungeKutta:
    """Return the method that a README adds as an example."""
    return cast(RungeKutta, eval(method_entry(), {"RungeKutta": RungeKutta, "exact": exact}))


def check_numbers(mark: str, least: int, folder: Path) -> None:
    """AssertionError unless code prints what its comments say, in so many lines at the least."""
    said = re.findall(r"^print\(.*\)  # (.*)$", block(mark), flags=re.M)
    assert len(said) >= least
    assert run(block(mark), folder)[1] == said


def check_table(name: str, registry: Iterable[str]) -> None:
    """AssertionError unless a list has a full row for each of a registry, in its order."""
    found = TABLES[name]()
    assert [row[0] for row in found.rows] == list(registry)
    assert all(len(row) == len(found.head) and all(row) for row in found.rows)


def listed(name: str) -> Table:
    """Return the table between the marks ``list NAME`` and ``end`` of a README."""
    return settings_table() if name == "settings" else TABLES[name]()


def check_listed(name: str) -> None:
    """AssertionError unless the table that the package makes stands between the marks of a README."""
    assert table(f"list {name}") == listed(name).markdown()
