"""What commands print on terminals of any width: no number cut, no line too long."""

from __future__ import annotations

import pytest

from pendulum_env.catalogue import Table
from pendulum_env.console import print_table, print_text
from pendulum_env.study.compare import compare
from pendulum_env.study.compare.drift import LEADING_ERROR


@pytest.mark.parametrize("width", [40, 60, 80, 120, 300])
def test_no_number_of_the_drift_table_is_cut_and_no_line_is_too_long(width, monkeypatch, capsys):
    table = compare("exercise", "forward_euler,symplectic_euler,rk4", duration=1.0).table
    monkeypatch.setenv("COLUMNS", str(width))
    print_table(table, below=LEADING_ERROR)
    said = capsys.readouterr().out
    assert max(map(len, said.splitlines())) <= width
    assert "…" not in said
    words = said.replace(":", "").split()
    assert all(word in words for row in (table.head, *table.rows) for cell in row for word in cell.split())
    assert (f"{LEADING_ERROR}:" in said) == (width < 200)  # a column of its own where there is room


def test_a_table_that_fits_is_whole(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "60")
    print_table(Table(("a", "b"), (("[1]", "x [rad]"), ("[bold]", "yy"))))
    lines = [line.strip() for line in capsys.readouterr().out.splitlines() if line.strip()]
    assert lines[0].split() == ["a", "b"]
    assert lines[2:] == ["[1]     x [rad]", "[bold]  yy"]


@pytest.mark.parametrize("width", [30, 80, 118, 400])
def test_text_is_no_wider_than_the_terminal_nor_than_a_line(width, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", str(width))
    print_text("seventeen words of text " * 40)
    lines = capsys.readouterr().out.splitlines()
    assert min(width, 118) - 12 < max(map(len, lines)) <= min(width, 118)
