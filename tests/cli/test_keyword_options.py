"""Tests of every option of every command with invalid texts: one sentence, exit code 2, unchanged files.

The kinds of values are those of keywords with the same name, see keyword_kinds.py.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import typer
from check_all import check_all
from command_line import Here
from folder_contents import contents
from keyword_kinds import KIND_OF, KINDS

from pendulum_env.cli import app, console
from pendulum_env.common.progress import Progress

TEXTS = {
    "empty": "", "word": "x", "long": "9" * 5000, "nan": "nan", "inf": "inf", "-inf": "-inf", "beyond": "1e400",
    "negative": "-1", "zero": "0", "half": "0.5",
}
"""Texts to type, by the names of the corresponding values in the tests of keywords."""
OPTIONS: Mapping[str, str] = {
    "recording": "none of these", "settings": "none of these", "read": "none of these", "file": "none of these",
    "files": "none of these", "torque": "none of these", "current": "none of these", "prior": "none of these",
    "effects": "word", "free": "names or none", "oscillations": "count", "length_error": "positive",
    "gravity": "positive", "amplitudes": "none of these", "amplitude_error": "none of these",
    "lengths": "none of these", "kater": "none of these", "knife_edges": "none of these",
    "growth": "one and more", "panels": "word", "what": "word", "scene": "word",
    "damping": "word", "over": "none of these", "basins": "count", "transient": "count or none", "phase": "number",
    "period": "positive", "own_step": "none of these", "walker_steps": "count", "steps_per_period": "count",
    "control_step": "positive", "command": "word", "window": "count", "integrators": "word",
    "period_error": "none of these", "amplitude": "none of these", "name": "short text", "wait": "wait",
    **dict.fromkeys(("speed", "policy", "counts", "baud", "patience", "channel", "clock", "bind"), "none of these"),
}
"""Kinds of the values of options that are not keywords, or whose text is of another kind than the keyword.

Options of other sources than the usual one, such as ``--baud``, are refused whatever their value.
"""
AS_TEXT = {**KINDS, "names or none": ({"empty"}, set()), "short text": (set(TEXTS) - {"long"}, set())}
UNSPOILT = {"scheduler": "asks a network", "version": "takes nothing", "out": "an empty one is the folder one is in"}


def options() -> list[tuple[str, Any]]:
    """Return each command's options and arguments that take a value."""
    commands: Mapping[str, Any] = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    return [(name, option) for name, command in commands.items() for option in command.params
            if option.name not in {"help", *UNSPOILT} and not getattr(option, "is_flag", False)]


@pytest.fixture
def computed(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Return the fractions done that commands tell their progress bars, which stay empty until something is computed.
    """
    told: list[float] = []

    @contextmanager
    def bar(_title: str) -> Iterator[Progress]:
        yield lambda done, _activity: told.append(done) if done > 0.0 else None

    monkeypatch.setattr(console, "progress_bar", bar)
    return told


PAIRS, QUICK = options(), "list"


def test_every_option_is_covered() -> None:
    assert [(command, option.name) for command, option in PAIRS if option.name not in {*OPTIONS, *KIND_OF}] == []
    assert set(OPTIONS) <= {option.name for _, option in PAIRS}


@pytest.mark.parametrize("command", [
    pytest.param(command, marks=[] if command == QUICK else [pytest.mark.slow])
    for command in dict.fromkeys(command for command, _ in PAIRS)])
def test_what_cannot_be_is_refused(command: str, tmp_path: Path, run_here: Here, computed: list[float]) -> None:
    (tmp_path / "kept").write_text("kept")
    before = contents(tmp_path)

    def check(case: tuple[Any, str, str]) -> None:
        option, _, text = case
        flag = [max(option.opts, key=len)] if option.param_type_name == "option" else []
        code, _, said = run_here(command, *flag, text)
        assert code == 2, said
        assert "Traceback" not in said
        assert "Error" in said
        assert len(said) < 3000
        assert contents(tmp_path) == before
        assert computed == [], said

    refused = {option: set(TEXTS).difference(*AS_TEXT[OPTIONS.get(option.name) or KIND_OF[option.name]])
               for of, option in PAIRS if of == command}
    check_all([(option, word, TEXTS[word]) for option, words in refused.items() for word in TEXTS if word in words],
              check)
