"""Digests of the files that hold the expectations of hard cases, and the list of changes in the catalogue's README.

``python tests/support/expectations.py`` prints the rows that the list lacks; the author adds the reason.
"""

from __future__ import annotations

import ast
import hashlib
import re
from pathlib import Path

from readme_code import ROOT

from pendulum_env.hard_cases.run import GROUPS

FOLDER = ROOT / "pendulum_env" / "hard_cases"
FILES = ("case.py", *sorted(f"{group.__name__.rpartition('.')[2]}.py" for group in GROUPS))
"""Files with cases, bounds and allowed outcomes."""
TEXT = re.compile(r'f?"((?:[^"\\\n]|\\.)*)"')
ROW = re.compile(r"^\| (\w+\.py) \| `([0-9a-f]{12})` \| (.+) \|$", flags=re.M)


def digest(source: str) -> str:
    """Return a digest of a module's source without docstrings, sentences, comment lines and spacing.

    Sentences are strings with a space, names of cases included. The digest is the same in every version of Python.
    """
    lines = source.splitlines()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            for number in range(node.lineno - 1, node.end_lineno or node.lineno):
                lines[number] = ""
    bare = (TEXT.sub(lambda text: '""' if " " in text[1] else text[0], line)
            for line in lines if not line.lstrip().startswith("#"))
    code = re.sub('(?:f?"")+', '""', "".join("".join(line.split()) for line in bare))
    return hashlib.sha256(code.encode()).hexdigest()[:12]


def listed(page: str) -> dict[str, list[tuple[str, str]]]:
    """Return the rows of the list by file, each with its digest and reason, the oldest first."""
    rows: dict[str, list[tuple[str, str]]] = {}
    for name, value, reason in ROW.findall(page):
        rows.setdefault(name, []).append((value, reason))
    return rows


def lacking(folder: Path = FOLDER) -> list[str]:
    """Return the rows that the list lacks, with "..." in place of the reason."""
    rows = listed((folder / "README.md").read_text(encoding="utf-8"))
    now = {name: digest((folder / name).read_text(encoding="utf-8")) for name in FILES}
    return [f"| {name} | `{value}` | ... |" for name, value in now.items()
            if name not in rows or rows[name][-1][0] != value]


if __name__ == "__main__":
    print("\n".join(lacking()) or "The list is complete.")
