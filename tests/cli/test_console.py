"""Tests of printing on terminals of any width: no number is cut, no line is too long."""

from __future__ import annotations

import io
import os
import runpy
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import typer
from choice import FULL, chosen, turn_of
from drawn_films import NAMES, draw
from typer.testing import CliRunner

from pendulum_env import __version__, cli
from pendulum_env.cli import app
from pendulum_env.cli.console import print_table, print_text
from pendulum_env.common.texts import Table
from pendulum_env.common.version import sources
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
    assert all(word in words for column in full for cell in column for word in cell.replace(":", "").split())
    assert (f"{LEADING_ERROR}:" in said) == (width < 200)  # a column of its own where there is room
    assert words.count(LEADING_ERROR.split()[0]) == 1


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


# --- encodings and closed streams ----------------------------------------------------------------------------------

ENCODINGS = ("gbk", "cp932", "cp1250", "cp1251", "cp437")
SHORT: Mapping[str, str] = {
    "compare": "--scene exercise --integrators forward_euler,rk4 --duration 0.5 --no-film",
    "cost": "--scene vacuum --integrators rk4,heun --duration 1 --repeats 1 --growth 2",
    "demo": "--no-film",
    "auto": "--scene vacuum --accuracy 1e-3 --duration 0.2",
    "acquire": "--headless --duration 0.2 --rate 50", "fit": "--effects linear --mass 0.01 --radius 0.02",
    "measure": "", "track": "swing.mp4",
    "exercise": "",
    "show": "--help",
    "stress": "--cases upright_for_a_moment --integrators rk4",
    "effects": "--scene textbook --angle 30 --tolerance 1e-2 --out out/effects",
    "section": "--points 50 --transient 2 --steps-per-period 20",
    "code": "--scene lab --integrators rk4",
    "web": "--scene vacuum --integrators rk4 --out lab.html",
    "record": "--duration 0.2 --size 100 --out out/film.gif",
    "list": "", "help": "",
}
"""Options of a short run of every command."""


def words_of(name: str) -> list[str]:
    return [name, *(word.replace("upright_for_a_moment", "upright for a moment") for word in SHORT[name].split())]


@pytest.mark.quick("gbk")
@pytest.mark.parametrize("encoding", [
    pytest.param(name, marks=() if name in ("gbk", "cp437") else pytest.mark.slow) for name in ENCODINGS])
def test_output_has_the_terminals_encoding(
    encoding: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Lists, a table of numbers with errors, and a warning; what the encoding lacks is said in words."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("LAB_PENDULUM_BACKEND", "python")
    printed = {}
    for words in (["list", "tasks", "--markdown"], ["measure"], ["measure", "\u6446\u00fc.txt"], ["fit", "--help"]):
        streams = [io.BytesIO(), io.BytesIO()]
        for name, stream in zip(("stdout", "stderr"), streams, strict=True):
            monkeypatch.setattr(sys, name, io.TextIOWrapper(stream, encoding=encoding, write_through=True))
        monkeypatch.setattr(sys, "argv", ["lab-pendulum", *words])
        with pytest.raises(SystemExit) as stop:
            cli.main()
        out, said = (stream.getvalue().decode(encoding) for stream in streams)
        assert "Traceback" not in said
        printed[words[-1]] = stop.value.code or 0, out, said
    assert [code for code, _, _ in printed.values()] == [0, 0, 2, 0]
    square = "²" if "²".encode(encoding, "ignore") else "^2"
    assert f"phi{square} + 0.1 (velocity/omega0){square}" in printed["--markdown"][1]
    sign = "±" if "±".encode(encoding, "ignore") else "+-"
    assert f"1.201845 {sign} 0.000027 s" in printed["measure"][1]
    rows = [line for line in printed["measure"][1].splitlines() if line.startswith("|")]
    assert len({*map(len, rows)}) == 1, "words are as long as their column has room for"
    assert "Error: " in printed["\u6446\u00fc.txt"][2]


def in_a_process(name: str, folder: Path, out: Any, **settings: str) -> tuple[int, bytes, bytes, set[str]]:
    """Run a command; return its exit code, what it printed and said, and the names of the files that it wrote."""
    folder.mkdir()
    if name == "track":
        draw(replace(NAMES["plain"], seconds=4.0), folder / "swing.mp4")
    done = subprocess.run([sys.executable, "-m", "pendulum_env", *words_of(name)], cwd=folder, stdout=out,
                          stderr=subprocess.PIPE, env={**os.environ, "COLUMNS": "100", **settings}, timeout=600)
    return done.returncode, done.stdout, done.stderr, {str(path.relative_to(folder)) for path in folder.rglob("*")}


def without_origin(folder: Path) -> list[str]:
    """Return the files in a folder that lack the version, but for a commit, or the digest of the sources."""
    wanted = (f"lab-pendulum {__version__.partition('+')[0]}".encode(), sources().encode())
    return [str(path.relative_to(folder)) for path in folder.rglob("*")
            if path.is_file() and not all(text in path.read_bytes() for text in wanted)]


ON_A_FULL_DISK = {name for name in SHORT if name != "demo" and (FULL or turn_of(name, 3) == 1)}
"""All but the tour with LAB_PENDULUM_GRID=full; the tour prints each chapter when its files are written."""


@pytest.mark.slow
@pytest.mark.parametrize("name", SHORT)
def test_every_command_prints_in_an_encoding_after_its_files_are_saved(name: str, tmp_path: Path) -> None:
    """In one that its name chooses. Each file names version and sources, but for the film that a command was given. A
    full disk behind the standard output, where nothing can be printed, costs no file: of one command in three, because
    all print by the same functions.
    """
    encoding = chosen(ENCODINGS, name)
    code, out, said, files = in_a_process(name, tmp_path / encoding, subprocess.PIPE, PYTHONIOENCODING=encoding)
    assert code == 0, said
    assert out.decode(encoding)
    assert b"Traceback" not in said
    assert [path for path in without_origin(tmp_path / encoding) if path != "swing.mp4"] == []
    if name in ON_A_FULL_DISK and Path("/dev/full").exists():
        with open("/dev/full", "w") as full:
            code, _, said, saved = in_a_process(name, tmp_path / "full", full, PYTHONUNBUFFERED="1")
        assert saved == files, said
        assert b"Traceback" not in said


def test_every_command_has_a_short_run_and_every_encoding_a_command() -> None:
    assert set(SHORT) == set(COMMANDS)
    assert {chosen(ENCODINGS, name) for name in SHORT} == set(ENCODINGS)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="shells differ")
@pytest.mark.parametrize("closed", [">&-", "<&- >&- 2>&-"])
def test_closed_streams_are_no_error(closed: str, tmp_path: Path) -> None:
    """Nothing is printed, a warning says so where it can, and no file that is written takes a stream's place."""
    done = subprocess.run(["sh", "-c", f'exec "$@" {closed}', "sh", sys.executable, "-m", "pendulum_env", "measure"],
                          cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "measure" / "measured.csv").read_text(encoding="utf-8").startswith("# Software: ")
    warned = "the standard output is closed, so nothing is printed" in done.stderr
    assert warned == (closed == ">&-")
    assert done.stdout == ""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="shells differ")
def test_a_pipe_that_is_closed_is_no_error() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run([sys.executable, "-m", "pendulum_env", "list", "events", "--all"], stdout=writing,
                          stderr=subprocess.PIPE, text=True, timeout=60)
    os.close(writing)
    assert done.stderr == ""


COMMANDS: Mapping[str, Any] = typer.main.get_command(app).commands  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", COMMANDS)
def test_no_word_of_a_help_text_is_lost(name):
    """Help texts contain no square brackets, which the printer would take for markup."""
    done = CliRunner().invoke(app, [name, "--help"], env={"COLUMNS": "4000", "TERM": "dumb"})
    assert done.exit_code == 0
    said = "".join(done.stdout.split())  # lines are also broken at hyphens
    command = COMMANDS[name]
    for text in (command.help, *(option.help for option in command.params)):
        for line in (text or "").replace("\b", "").splitlines():  # \\b: these lines are not wrapped
            assert "".join(line.split()) in said


def test_the_package_runs_as_the_command(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["pendulum_env", "--version"])
    with pytest.raises(SystemExit) as stop:
        runpy.run_module("pendulum_env", run_name="__main__")
    assert not stop.value.code
    assert capsys.readouterr().out == f"lab-pendulum {__version__}, sources {sources()}\n"
