"""The notebooks of the examples run from end to end, and what they show is right."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import pytest

nbclient = pytest.importorskip("nbclient")
nbformat = pytest.importorskip("nbformat")
pytest.importorskip("ipykernel")
pytest.importorskip("ipywidgets")

FOLDER = Path(__file__).parents[2] / "examples"
NAMES = ("exercise", "learning")
UPLOADED = """
import pathlib
from types import SimpleNamespace
content = memoryview(pathlib.Path({path!r}).read_bytes())
upload = SimpleNamespace(value=(SimpleNamespace(name="swing.txt", content=content),))
"""
"""Code that stands for a user who has uploaded a file, as FileUpload of ipywidgets 8 keeps it."""


def stored(name: str) -> Any:
    return nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)


def run(book: Any, folder: Path) -> Any:
    """Run a notebook in a folder; an error in a cell is an error here."""
    client = nbclient.NotebookClient(book, timeout=600, resources={"metadata": {"path": str(folder)}})
    return client.execute()


def text_of(book: Any) -> str:
    """Return what a notebook printed."""
    return "".join(one["text"] for cell in book.cells if cell.cell_type == "code" for one in cell.outputs
                   if one.output_type == "stream" and one.name == "stdout")


def shown(book: Any, begin: str) -> list[Any]:
    """Return what the cell whose last line begins with a text shows, without what it prints: texts by MIME type."""
    (cell,) = [cell for cell in book.cells if cell.cell_type == "code"
               and cell.source.splitlines()[-1].startswith(begin)]
    return [one.data for one in cell.outputs if one.output_type != "stream"]


@pytest.mark.parametrize("name", NAMES)
def test_notebooks_are_stored_without_outputs(name: str) -> None:
    book = json.loads((FOLDER / f"{name}.ipynb").read_text(encoding="utf-8"))
    code = [cell for cell in book["cells"] if cell["cell_type"] == "code"]
    assert code
    assert not any(cell["outputs"] or cell["execution_count"] for cell in code)


@pytest.mark.slow
def test_the_exercise_runs_and_answers(tmp_path: Path) -> None:
    book = run(stored("exercise"), tmp_path)
    text = text_of(book)
    assert not [one for cell in book.cells if cell.cell_type == "code" for one in cell.outputs
                if one.output_type == "stream" and one.name == "stderr"]
    # Energy ratios of the Euler methods: (1 + (omega h)**2)**(+-n), see the 30 lines in test_exercise.py.
    omega = float(re.search(r"Omega = ([\d.]+)", text)[1])  # type: ignore[index]
    grown = (1.0 + (omega * 0.01) ** 2) ** 1000
    ratios = [float(one) for one in re.findall(r"_euler ([\d.]+)", text)]
    assert ratios[0] == pytest.approx(grown, rel=0.01)  # with the scene's omega0, which differs in the fourth digit
    assert ratios[1] == pytest.approx(1.0 / grown, rel=0.01)
    assert 0.974 < ratios[2] < 1.0271
    assert "equals forward_euler" in text
    # The period at amplitude A is that at 0 over the arithmetic-geometric mean of 1 and cos(A/2).
    for degrees, seen in re.findall(r"(\d+)°: T = ([\d.]+) s", text):
        a, b = 1.0, math.cos(math.radians(float(degrees)) / 2.0)
        for _ in range(6):
            a, b = (a + b) / 2.0, math.sqrt(a * b)
        assert float(seen) == pytest.approx(2.0 * math.pi / omega / a, rel=3e-4)
    live = re.search(r"acquired: length ([\d.]+) ± ([\d.]+) m, in the scene ([\d.]+) m", text)
    assert live is not None
    assert abs(float(live[1]) - float(live[3])) < 4.0 * float(live[2]) < 2e-3
    assert (tmp_path / "report" / "report.html").is_file()
    (plot,) = shown(book, "eulers.plot(")  # once
    assert plot["text/html"].startswith("<img ")
    assert "data:video/mp4;base64," in shown(book, "     dt=0.01, fps=25, size=240)")[-1]["text/html"]
    (card,) = shown(book, "small")
    assert "<math" in card["text/html"]


@pytest.mark.slow
def test_the_exercise_takes_an_uploaded_recording(tmp_path: Path) -> None:
    rows = "".join(f"{0.02 * k:.2f}\t{0.3 * math.exp(-0.02 * k * 0.02) * math.cos(0.1 * k):.9f}\n" for k in range(1500))
    (tmp_path / "mine.txt").write_text(f"time (s)\tangle (rad)\n{rows}", encoding="utf-8")
    book = stored("exercise")
    last = next(i for i, cell in enumerate(book.cells) if cell.source.endswith("\nsheet"))
    book.cells = book.cells[: last + 1]
    place = next(i for i, cell in enumerate(book.cells) if cell.source.startswith("if upload.value"))
    book.cells.insert(place, nbformat.v4.new_code_cell(UPLOADED.format(path=str(tmp_path / "mine.txt"))))
    (sheet,) = shown(run(book, tmp_path), "sheet")
    assert "Measured on swing.txt" in sheet["text/html"]
    period = float(re.search(r"period T</td><td[^>]*>([\d.]+)", sheet["text/html"])[1])  # type: ignore[index]
    assert period == pytest.approx(2.0 * math.pi / 5.0, rel=1e-4)  # the cosine's


@pytest.mark.slow
def test_learning_runs_and_learns(tmp_path: Path) -> None:
    book = run(stored("learning"), tmp_path)
    text = text_of(book)
    earned = float(re.search(r"controller earns (-[\d.]+)", text)[1])  # type: ignore[index]
    assert -700.0 < earned < -400.0  # SwingUp earns about -555, see LabPendulumEnv; hanging still earns about -4900
    means = [float(one) for one in re.findall(r"mean return +(-?[\d.]+)", text)]
    assert means[0] < 100.0
    assert means[-1] > 195.0  # of at most 200
    (vector,) = shown(book, "vector")
    assert "1024 environments" in vector["text/html"]
    (figure,) = shown(book, "figure")
    assert figure["text/html"].startswith("<img ")
    assert any("image/png" in one for one in shown(book, "Image.fromarray"))
