"""Test the report of the exercise with readings by hand: amplitudes, periods against lengths, a reversible pendulum."""

from __future__ import annotations

import csv
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import Here
from folder_contents import contents
from scipy.integrate import solve_ivp

from pendulum_env.exercise import report
from pendulum_env.exercise.figures import BY_HAND, envelope, figures_of, readings
from pendulum_env.exercise.given import Given, by_hand
from pendulum_env.exercise.language import language_of
from pendulum_env.exercise.values import values
from pendulum_env.exercise.worked import Worked, work_out
from pendulum_env.lab import measure_amplitudes

pytest.importorskip("jinja2")

READINGS = "0:30, 10:25.9, 20:22.2, 30:19.1, 45:15.4, 60:12.2"
GRAVITY = 9.81
LABELS = language_of("en").figures


def tables(folder: Path) -> tuple[Path, Path]:
    """Write the periods of five lengths, 5 mm too short, and those of a reversible pendulum of 1 m, two lines."""
    lengths, kater, period = folder / "lengths.csv", folder / "kater.csv", 2.0 * math.pi / math.sqrt(GRAVITY)
    lengths.write_text("length (cm),10 T (s)\n" + "".join(
        f"{100 * one - 0.5},{10 * period * math.sqrt(one):.3f}\n" for one in (0.2, 0.4, 0.6, 0.8, 1.0)))
    kater.write_text("position (cm),T1 (s),T2 (s)\n" + "".join(
        f"{x},{period + 0.002 * (x - 12):.6f},{period - 0.005 * (x - 12):.6f}\n" for x in (0, 5, 10, 15, 20)))
    return lengths, kater


@pytest.fixture(scope="module")
def worked(tmp_path_factory: pytest.TempPathFactory) -> Worked:
    lengths, kater = tables(tmp_path_factory.mktemp("tables"))
    return work_out(by_hand(Given.of(period=1.19), READINGS, lengths, kater, "1.0000+-0.0002"))


def page(worked: Worked, key: bool) -> str:
    """The page without its figures."""
    drawn = {draw.__name__: report.Drawing(i + 1, "") for i, draw in enumerate(figures_of(worked))}
    facts = {"Software": "x", "Sources": "s", "Python": "y", "Command": "z"}
    return " ".join(report.page(worked, drawn, "", key, facts).split())


def test_the_numbers_are_those_of_measure_and_the_truth(worked: Worked) -> None:
    """The readings are those of gamma = 0.03/s, rounded to 0.1 degrees."""
    found = {row.quantity: row for row in values(worked)}
    gamma = found["gamma from these amplitudes"]
    assert gamma.value == measure_amplitudes(READINGS).decay.value == pytest.approx(0.03, abs=2 * float(gamma.error))
    assert float(gamma.error) < 0.001
    damped = worked.recorded.damped
    assert damped.energy[-1] == pytest.approx(math.exp(-gamma.value * damped.time[-1]), rel=0.05)
    assert "gamma from the first third of all amplitudes" not in found
    assert found["linear drag: gamma"].value == pytest.approx(0.03, rel=0.03)
    assert found["gravity from T² against the length"].value == pytest.approx(GRAVITY, rel=2e-3)
    assert found["offset of the length"].value == pytest.approx(0.005, rel=0.1)
    assert found["gravity from the reversible pendulum"].value == pytest.approx(GRAVITY, rel=1e-5)
    assert found["gravity from the reversible pendulum"].error == pytest.approx(GRAVITY * 2e-4, rel=0.01)


def test_readings_stand_beside_the_simulation_of_their_swing(worked: Worked) -> None:
    """The truth is SciPy's turning points; symplectic Euler errs there by less than 0.02 degrees."""
    beside, omega, gamma = worked.recorded.by_hand, worked.given.omega.value.value, worked.recorded.gamma.value
    assert beside is not None

    def turns(_t: float, y: np.ndarray) -> float:
        return float(y[1])

    run = solve_ivp(lambda _t, y: [y[1], -omega * omega * math.sin(y[0]) - gamma * y[1]], (0.0, 62.0),
                    [math.radians(30.0), 0.0], events=turns, rtol=1e-9, atol=1e-10)
    at, size = run.t_events[0], np.abs(run.y_events[0][:, 0])
    true = np.interp([0.0, 10.0, 20.0, 30.0, 45.0, 60.0], at, size)
    np.testing.assert_allclose(beside.simulated, true, atol=math.radians(0.02))
    read = np.radians([30.0, 25.9, 22.2, 19.1, 15.4, 12.2])
    assert beside.rms == pytest.approx(float(np.sqrt(np.mean((read - true) ** 2))), abs=math.radians(0.02))
    assert {one.name for one in beside.reasons} == {"law", "gamma", "first", "reading"}


def test_sections_questions_and_answers_are_there(worked: Worked) -> None:
    blank, key = page(worked, False), page(worked, True)
    for text in ("6 amplitudes that were read by hand", "from the amplitudes read by hand, from rest at 30°",
                 "2.6 Readings and simulation", "All 6 amplitudes differ by", "first and last of your readings",
                 "3.1 T² against the length", "3.2 The reversible pendulum", "is that of the amplitudes read by hand"):
        assert text in blank
        assert text in key
    assert key.count('class="key"') == blank.count('class="blank"') == 18
    for answer in ("The closest envelope is that of linear drag", "every length is too short by",
                   "the distance of the edges should be measured better first"):
        assert answer in key
        assert answer not in blank
    assert "<p></p>" not in key.replace(" ", "")
    assert "imulated recording" not in key
    plain = page(work_out(Given.of()), True)
    assert "Part 3" not in plain
    assert plain.count('class="key"') == 16


@pytest.mark.slow
def test_bessels_formula_has_its_own_words(tmp_path: Path) -> None:
    (tmp_path / "b.csv").write_text("h1 (cm),T1 (s),T2 (s)\n85,2.0061,2.0062\n86,2.0062,2.0061\n")
    filled = page(work_out(by_hand(Given.of(), kater=tmp_path / "b.csv", edges="1.000")), True)
    assert "Bessel's formula gives" in filled
    assert "3.1 The reversible pendulum" in filled
    assert "period of a point pendulum of length L" in filled
    assert "A weight is moved" not in filled


@pytest.mark.quick("readings", "kater")
@pytest.mark.parametrize("draw", [envelope, readings, *BY_HAND])
def test_figures_have_their_legend_and_no_title(worked: Worked, draw: Any) -> None:
    figure = draw(worked, LABELS)
    figure.draw_without_rendering()
    box = figure.axes[0].get_legend().get_window_extent()
    assert 0.0 <= box.x0 < box.x1 <= figure.bbox.width
    assert box.y1 <= figure.bbox.height
    assert figure.get_suptitle() == ""
    other = draw(worked, {name: f"<{name}> {{}}" for name in LABELS})
    texts = [at.get_xlabel() + at.get_ylabel() for at in other.axes]
    assert all("<" in text for text in texts), "texts are those of the labels"


@pytest.mark.slow
def test_the_command_writes_figures_and_numbers(tmp_path: Path, run_here: Here) -> None:
    tables(tmp_path)
    code, printed, said = run_here("exercise", "--period", "1.19", "--amplitudes", READINGS, "--lengths", "lengths.csv",
                                   "--kater", "kater.csv", "--knife-edges", "1.000", "--out", "x")
    assert code == 0, said
    assert "simulated recording" not in printed
    made = {path.name for path in (tmp_path / "x").iterdir()}
    assert {"envelope.png", "readings.png", "amplitudes.csv", "lengths.svg", "kater.png", "kater.svg"} <= made
    assert not {"recording.csv", "beside.png"} & made
    text = (tmp_path / "x" / "numbers.csv").read_text(encoding="utf-8")
    rows = [row for row in csv.reader(text.splitlines()) if len(row) == 5]
    edges = next(row for row in rows if row[1] == "distance of its knife edges")
    assert float(edges[3]) == pytest.approx(0.0005)
    text = (tmp_path / "x" / "report.html").read_text(encoding="utf-8")
    assert len(re.findall("<figure ", text)) == 13
    assert "imulated recording" not in text


@pytest.mark.parametrize(("words", "said"), [
    (["--amplitudes", "0:30, 1:29"], "at least 3 amplitudes"),
    (["--lengths", "none.csv"], "none.csv: expected a file that can be read"),
    (["--kater", "kater.csv"], "--kater and --knife-edges need each other"),
    (["--knife-edges", "1"], "--kater and --knife-edges need each other"),
    (["--kater", "kater.csv", "--knife-edges", "one"], "--knife-edges must be a distance in m, with its error or"),
    (["--kater", "kater.csv", "--knife-edges", "0"], "edges must be"),
    (["--lengths", "kater.csv"], "expected a column with lengths"),
])
def test_bad_tables_end_in_a_sentence_with_files_as_they_were(
    words: list[str], said: str, tmp_path: Path, run_here: Here
) -> None:
    tables(tmp_path)
    before = contents(tmp_path)
    code, _, told = run_here("exercise", *words)
    assert code == 2, told
    assert said in told
    assert len(told.strip().splitlines()) == 1
    assert contents(tmp_path) == before
