"""README cannot rot: its code runs, and the commands and files that it names exist."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from readme_code import README, ROOT

from pendulum_env.cli import app

BLOCKS = re.findall(r"(?:<!-- ([\w ]+) -->\n)?```python\n(.*?)```", README, flags=re.S)
"""Marks and code."""


@pytest.mark.parametrize("block", [
    pytest.param(block, id=mark or str(i), marks=[pytest.mark.slow] if mark else [])
    for i, (mark, block) in enumerate(BLOCKS)])
def test_python_blocks_run(
    block: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From a file: the engine reads the source of an effect's functions. Marked ones have quick tests of their own."""
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "block.py"
    path.write_text(block, encoding="utf-8")
    exec(compile(block, str(path), "exec"), {})
    assert capsys.readouterr().out


def test_there_are_blocks_and_both_commands() -> None:
    assert sum(not mark for mark, _ in BLOCKS) >= 3
    for mark in ("main job", "tests"):
        assert re.search(rf"<!-- {mark} -->\n```sh\n.+\n```", README)


def test_links_and_places_exist() -> None:
    headings = re.findall(r"^#+ (.*)$", re.sub(r"```.*?```", "", README, flags=re.S), flags=re.M)
    anchors = {"#" + re.sub(r"[^\w -]", "", heading).lower().replace(" ", "-") for heading in headings}
    for target in re.findall(r"\]\((?!https?:)([^)]+)\)", README):
        assert target in anchors or (ROOT / target).exists(), target


def test_every_command_is_in_the_table_and_only_those() -> None:
    listed = set(re.findall(r"^\| `lab-pendulum (\w+)`", README, flags=re.M))
    assert listed == {command.name or getattr(command.callback, "__name__", "") for command in app.registered_commands}
