"""Charts of studies of effects and of hard cases: marks of textbook formulas, and the blocks of the matrix."""

from __future__ import annotations

from typing import Any

import pytest
from matplotlib.colors import to_hex

from integrators import METHODS
from pendulum_env.hard_cases.case import ACCURATE, Finding
from pendulum_env.hard_cases.run import CASES, Matrix, MatrixEntry
from pendulum_env.physics.presets import SCENES
from pendulum_env.plots import audit as chart
from pendulum_env.plots import hard_cases
from pendulum_env.study.audit.verdicts import CALLED_FOR, Audit, AuditRow, off_by


def audited(loss: float) -> Audit:
    """Return an audit of two effects: drag whose formula for the period is 96 times off, and buoyancy."""
    drag = AuditRow("sphere_drag", True, period_change=-4.8e-4, amplitude_change=-0.26, period_predicted=-4.608e-2,
                    amplitude_predicted=-loss, verdict=CALLED_FOR)
    lift = AuditRow("buoyancy", True, period_change=0.071, amplitude_change=5.6e-4, period_predicted=0.064,
                    amplitude_predicted=0.0, verdict=CALLED_FOR)
    return Audit(SCENES["water"], 0.5, 1e-4, (drag, lift), 1e-9, 256, 5.0)


@pytest.mark.parametrize("loss", [0.44, 0.01])
def test_formulas_far_off_are_pale_and_strong_damping_is_the_reason(loss: float) -> None:
    given = audited(loss)
    assert off_by(given, given.rows[0], "period") == pytest.approx(96.0)
    axes = chart.changes(given)
    tones = {round(float(line.get_xdata()[0]), 6): to_hex(line.get_color()) for line in axes.lines  # type: ignore[index]
             if line.get_marker() == "D"}
    assert tones[0.04608] != tones[0.064]
    words = axes.get_legend().get_title().get_text().replace("\n", " ")  # type: ignore[union-attr]
    strong = f"here they give a loss of {100.0 * loss:.0f} % of the amplitude in each half swing"
    assert (strong in words, strong in given.text) == (loss > 0.1, loss > 0.1)


def test_a_motors_push_is_no_loss() -> None:
    rows = (AuditRow("motor", True, amplitude_change=-0.6, amplitude_predicted=-0.63, verdict=CALLED_FOR),
            AuditRow("linear_drag", True, amplitude_change=-0.005, amplitude_predicted=-0.006, verdict=CALLED_FOR))
    assert Audit(SCENES["lab"], 0.5, 1e-4, rows, 1e-9, 256, 5.0).loss == 0.006


@pytest.mark.slow
@pytest.mark.parametrize(("count", "in_blocks"), [
    (5, True), pytest.param(len(METHODS), False, marks=pytest.mark.slow)])
def test_the_matrix_of_few_methods_stands_in_blocks(count: int, in_blocks: bool) -> None:
    cases = tuple(case for case in CASES if not case.long)
    methods = tuple(METHODS.values())[:count]
    entries = tuple(MatrixEntry(case, methods[0], Finding(ACCURATE), True) for case in cases)
    figure: Any = hard_cases.draw(Matrix(cases, methods, entries))
    wide, high = figure.get_size_inches()
    assert (len(figure.axes) > 1) == in_blocks
    assert high < 1.6 * wide
    written = [tick.label1.get_text() for axes in figure.axes for tick in axes.yaxis.get_major_ticks()]
    assert written == [case.name for case in cases]
    assert sum(len(axes.patches) for axes in figure.axes) == len(cases)
    large = figure.axes[0]
    assert all(tick.label2.get_visible() for tick in large.yaxis.get_major_ticks()) != in_blocks
    assert all(tick.label1.get_visible() for tick in large.xaxis.get_major_ticks()) != in_blocks
    box, names = figure.bbox, [text for axes in figure.axes for text in (*axes.texts, *axes.get_yticklabels())]
    assert names
    for text in names:
        assert box.x0 <= text.get_window_extent().x0
        assert text.get_window_extent().x1 <= box.x1
        assert text.get_window_extent().y1 <= box.y1
