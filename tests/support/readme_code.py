"""README's code, run as readers would, and its tables."""

from __future__ import annotations

import contextlib
import io
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from pendulum_env.study.lists.tables import find_table

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def block(mark: str) -> str:
    """README's code behind a mark."""
    found = re.search(rf"<!-- {mark} -->\n```python\n(.*?)```", README, flags=re.S)
    assert found, mark
    return found[1]


def run(code: str, folder: Path) -> tuple[dict[str, Any], list[str]]:
    """The names that code leaves, and what it prints; from a file, where the engine finds its functions' source."""
    names: dict[str, Any] = {}
    path = folder / "readme.py"
    path.write_text(code, encoding="utf-8")
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(compile(code, str(path), "exec"), names)
    return names, printed.getvalue().splitlines()


def check_numbers(mark: str, least: int, folder: Path) -> None:
    """AssertionError unless code prints what its comments say, in so many lines at the least."""
    said = re.findall(r"^print\(.*\)  # (.*)$", block(mark), flags=re.M)
    assert len(said) >= least
    assert run(block(mark), folder)[1] == said


def check_table(name: str, registry: Iterable[str]) -> None:
    """AssertionError unless a list has a full row for each of a registry, in its order."""
    table = find_table(name)
    assert [row[0] for row in table.rows] == list(registry)
    assert all(len(row) == len(table.head) and all(row) for row in table.rows)


def check_listed(name: str) -> None:
    """AssertionError unless ``lab-pendulum list NAME --markdown`` prints what stands between README's marks."""
    found = re.search(rf"<!-- list {name} -->\n\n(.*?)\n\n<!-- end -->", README, flags=re.S)
    assert found, f"README has no table marked '{name}'"
    assert found[1] == find_table(name).markdown()
