"""Tests of simplified scenes, and of the files of an audit."""

import csv
from dataclasses import fields

import numpy as np
import pytest
from audits import W, of
from PIL import Image
from scipy.integrate import solve_ivp

from pendulum_env.cli.console import print_table, print_text
from pendulum_env.common.results import write
from pendulum_env.physics import exact
from pendulum_env.physics.effects import BearingFriction, Gravity, LinearDrag, QuadraticDrag, SmallAngleGravity
from pendulum_env.physics.presets import SCENES
from pendulum_env.physics.units import SceneError
from pendulum_env.plots.audit import draw
from pendulum_env.study.audit.study import audit, simplify
from pendulum_env.study.audit.verdicts import NOT_JUDGED, Audit, AuditRow

# --- simplified scenes ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("duration", "within"), [(1.0, True), (60.0, False)])
def test_simplify_removes_what_is_negligible_and_says_what_that_does(duration, within):
    gamma, amplitude = 2e-3, 0.2
    scene = of(SmallAngleGravity(), LinearDrag(gamma=gamma))
    plain, report = simplify(scene, amplitude=amplitude, tolerance=2e-3, duration=duration, backend="python")
    assert [effect.name for effect in plain.effects] == ["small_angle_gravity"]
    assert report.removed == ("linear_drag",)
    time = np.linspace(0.0, duration, 20_001)
    gap = exact.linear(time, amplitude, 0.0, W, gamma)[0] - exact.linear(time, amplitude, 0.0, W)[0]
    assert report.error == pytest.approx(np.max(np.abs(gap)) / amplitude, rel=2e-3)
    assert report.within is within
    assert report.change == pytest.approx(1.0 - np.exp(-0.5 * gamma * np.pi / W), rel=1e-2), "after half a swing"
    assert f"period or amplitude changes by at most {report.change:.2g}: within the tolerance of 0.002." in report.text
    assert ("Such changes add up" in report.text) is not within


@pytest.mark.slow
def test_effects_that_matter_only_together_are_named():
    """Three losses change the amplitude by 0.7 times the tolerance each, together by 2.1 times the tolerance."""
    tolerance, amplitude = 1e-3, 0.2
    gamma = 0.7 * tolerance * 2.0 * W / np.pi
    scene = of(SmallAngleGravity(), LinearDrag(gamma=gamma), BearingFriction(bearing_viscosity=gamma),
               QuadraticDrag(c=0.7 * tolerance / (4.0 / 3.0 * amplitude)))
    _, report = simplify(scene, amplitude=amplitude, tolerance=tolerance, duration=1.0, backend="python")
    assert set(report.removed) == {"linear_drag", "bearing_friction", "quadratic_drag"}
    assert report.change == pytest.approx(2.1 * tolerance, rel=0.02)
    assert "NOT within the tolerance of 0.001: each effect alone is negligible, but not all of them" in report.text


def test_simplify_keeps_what_is_called_for():
    scene = of(SmallAngleGravity(), LinearDrag(gamma=0.5))
    plain, report = simplify(scene, amplitude=1.0, tolerance=1e-3, backend="python")
    assert plain == scene
    assert report.removed == ()
    assert report.error == 0.0
    assert "gravity" in report.audit.missing
    assert "Effects that matter but are not in the scene: " in report.text
    assert "gravity" in report.text.partition("not in the scene: ")[2]


def test_simplify_compares_over_the_usual_run_by_default():
    scene = of(Gravity(), LinearDrag(gamma=1e-7))
    _, report = simplify(scene, amplitude=0.2, tolerance=1e-3, backend="python")
    assert report.duration == scene.run.duration
    assert report.within


@pytest.mark.slow
def test_the_error_of_a_simplified_scene_is_that_of_another_program():
    """Compare with scipy's DOP853 on the lab scene with and without quadratic drag, for 5 s."""
    scene, amplitude, duration = SCENES["lab"], 0.5, 5.0
    plain, report = simplify(scene, amplitude=amplitude, tolerance=2e-3, duration=duration, backend="python")
    assert report.removed == ("quadratic_drag",)
    assert not plain.has("quadratic_drag")
    rate, c = 9.81 / 0.353, scene.coefficients["quadratic_drag_rate"]
    time = np.linspace(0.0, duration, 4001)
    angles = [
        solve_ivp(lambda _, y, c=c: (y[1], -rate * np.sin(y[0]) - 0.02 * y[1] - c * abs(y[1]) * y[1]), (0.0, duration),
                  (amplitude, 0.0), "DOP853", time, rtol=1e-11, atol=1e-12).y[0]
        for c in (c, 0.0)
    ]
    assert report.error == pytest.approx(np.max(np.abs(angles[0] - angles[1])) / amplitude, rel=2e-3)
    assert not report.within


def test_simplify_checks_its_duration():
    with pytest.raises(SceneError, match="duration must be a finite number above 0"):
        simplify("vacuum", amplitude=0.2, tolerance=1e-3, duration=0.0, backend="python")


# --- files ----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def bearing() -> Audit:
    return audit("sticky_bearing", amplitude=0.5, tolerance=1e-3, backend="python")


@pytest.mark.slow
def test_files(bearing, tmp_path):
    picture, table = write(bearing, tmp_path)
    lines = table.read_text().splitlines()
    head = [line for line in lines if line.startswith("# ")]
    assert any(line.startswith("# Tolerance: 0.001") for line in head)
    rows = list(csv.DictReader(lines[len(head):]))
    assert [row["effect"] for row in rows] == [row.effect for row in bearing.rows]
    assert [row["verdict"] for row in rows] == [row.verdict for row in bearing.rows]
    assert list(rows[0]) == [field.name for field in fields(AuditRow)]
    with Image.open(picture) as image:
        assert "sticky_bearing" in image.info["Scene"]


@pytest.mark.slow
def test_the_chart_has_the_bars_the_formulas_and_the_tolerance(bearing):
    made = draw(bearing)
    (axes,) = made.axes
    low = axes.get_xlim()[0]
    ends = sorted(bar.get_x() + bar.get_width() for bar in axes.patches)
    shown = [row for row in bearing.rows if row.verdict != NOT_JUDGED]
    sizes = [abs(value) for row in shown for value in (row.period_change, row.amplitude_change)]
    assert ends == pytest.approx(sorted(size for size in sizes if size > low))
    marks = [line.get_xdata()[0] for line in axes.lines if line.get_marker() == "D"]
    formulas = [abs(value) for row in shown for value in (row.period_predicted, row.amplitude_predicted)]
    assert sorted(marks) == pytest.approx(sorted(value for value in formulas if value > low))
    assert any(set(line.get_xdata()) == {bearing.tolerance} for line in axes.lines)
    labels = [row.effect if row.present else f"({row.effect})" for row in shown]
    assert [label.get_text() for label in axes.get_yticklabels()] == labels
    said = axes.get_legend().get_title().get_text()
    assert all((row.effect in said.replace("\n", " ")) == (row.verdict == NOT_JUDGED) for row in bearing.rows)


def test_the_table_has_all_and_fits(bearing, capsys, monkeypatch):
    table = bearing.table
    names = [row.effect if row.present else f"({row.effect})" for row in bearing.rows]
    assert [row[0] for row in table.rows] == names
    assert "angle" not in table.head
    monkeypatch.setenv("COLUMNS", "120")
    print_table(table)
    print_text(bearing.text)
    printed = capsys.readouterr().out.splitlines()
    assert max(map(len, (line.rstrip() for line in printed))) <= 120
    for row, name in zip(bearing.rows, names, strict=True):
        assert any(line.split()[:1] == [name] and line.rstrip().endswith(row.verdict) for line in printed)
        assert row.note.split(":")[0][:40] in " ".join(" ".join(printed).split())
