"""Tests of printing on terminals of any width: no number is cut, no line is too long."""

from __future__ import annotations

import runpy
import sys
from collections.abc import Mapping
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from pendulum_env import __version__
from pendulum_env.cli import app
from pendulum_env.cli.console import print_table, print_text
from pendulum_env.common.tables import Table
from pendulum_env.study.compare import compare
from pendulum_env.study.compare.drift import LEADING_ERROR


@pytest.fixture(scope="module")
def drift(all_interpreted):
    """A table of drifts: numbers, words and a column of long texts."""
    return compare("exercise", "forward_euler,symplectic_euler,rk4", duration=1.0).table


@pytest.mark.parametrize("width", [40, 60, 80, 120, 300])
def test_no_number_of_the_drift_table_is_cut_and_no_line_is_too_long(width, drift, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", str(width))
    print_table(drift, below=LEADING_ERROR)
    said = capsys.readouterr().out
    assert max(map(len, said.splitlines())) <= width
    assert "…" not in said
    words = said.replace(":", "").split()
    full = [column for column in zip(drift.head, *drift.rows, strict=True) if {*column[1:]} != {"-"}]
    assert all(word in words for column in full for cell in column for word in cell.split())
    assert (f"{LEADING_ERROR}:" in said) == (width < 200)  # a column of its own where there is room


def test_columns_that_are_empty_throughout_are_left_out(capsys):
    print_table(Table(("method", "drift", "stopped", "note"), (("rk4", "1e-9", "-", ""), ("heun", "-", "-", ""))))
    head, _, *rows = capsys.readouterr().out.split("\n")[1:5]
    assert head.split() == ["method", "drift"]
    assert [row.split() for row in rows] == [["rk4", "1e-9"], ["heun", "-"]]


def test_formulas_and_paragraphs_of_help_break_at_words(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "40")
    print_text("symplectic_euler: frequency +(omega0 h)^2/24, and more", 40)
    assert "(omega0 h)^2/24" in capsys.readouterr().out
    monkeypatch.setenv("COLUMNS", "80")
    told = CliRunner().invoke(app, ["cost", "--help"], terminal_width=80).output
    paragraph = told.partition("Methods run with")[2].partition("Options")[0].split("\n")[:-1]
    full = [line.rstrip() for line in paragraph if line.strip()]
    assert all(len(line) > 60 for line in full[1:-1]), "each line but the last is full"


def test_a_table_that_fits_is_whole(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "60")
    print_table(Table(("a", "b"), (("[1]", "x [rad]"), ("[bold]", "yy"))))
    lines = [line.split() for line in capsys.readouterr().out.splitlines() if line.strip()]
    assert lines[0] == ["a", "b"]
    assert lines[2:] == [["[1]", "x", "[rad]"], ["[bold]", "yy"]]


@pytest.mark.parametrize("width", [30, 80, 118, 400])
def test_text_is_no_wider_than_the_terminal_nor_than_a_line(width, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", str(width))
    print_text("seventeen words of text " * 40)
    lines = capsys.readouterr().out.splitlines()
    assert min(width, 118) - 12 < max(map(len, lines)) <= min(width, 118)


COMMANDS: Mapping[str, Any] = typer.main.get_command(app).commands  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", COMMANDS)
def test_no_word_of_a_help_text_is_lost(name):
    """Help texts contain no square brackets, which the printer would take for markup."""
    done = CliRunner().invoke(app, [name, "--help"], env={"COLUMNS": "4000", "TERM": "dumb"})
    assert done.exit_code == 0
    said = " ".join(done.stdout.split())
    command = COMMANDS[name]
    for text in (command.help, *(option.help for option in command.params)):
        for line in (text or "").replace("\b", "").splitlines():  # \\b: these lines are not wrapped
            assert " ".join(line.split()) in said


def test_the_package_runs_as_the_command(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["pendulum_env", "--version"])
    with pytest.raises(SystemExit) as stop:
        runpy.run_module("pendulum_env", run_name="__main__")
    assert not stop.value.code
    assert capsys.readouterr().out == f"lab-pendulum {__version__}\n"
