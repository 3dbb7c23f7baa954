"""Parts of files and of recordings that few formats have: each was read wrong by a broken reader that no test saw."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bench_files import GRAVITY, let_go, written
from old_workbook import old_workbook
from scipy.special import ellipk

from pendulum_env.lab import Recording, RecordingError, measure, measure_gate
from pendulum_env.lab.fitting.shooting import calmed
from pendulum_env.lab.inertial import felt


def test_runs_are_told_apart_by_titles_that_are_repeated(tmp_path: Path) -> None:
    time = np.arange(600) / 30.0
    first, second = (np.degrees(let_go(0.6, 0.03, start, 21.0).at(time)[0]) for start in (0.4, 0.2))
    rows = "".join(f"{t:.4f},{a:.4f},{t:.4f},{b:.4f}\n" for t, a, b in zip(time, first, second, strict=True))
    (tmp_path / "runs.csv").write_text("Time (s),Angle (deg),Time (s),Angle (deg)\n" + rows)
    for run, angle in ((1, first), (2, second)):
        found = Recording.read(tmp_path / "runs.csv", run=run)
        np.testing.assert_allclose(np.degrees(found.angle), angle, atol=1e-4)
        assert any(note.startswith(f"run: {run} of 1, 2") for note in found.notes)


@pytest.mark.quick("ultrasonic distance")
@pytest.mark.parametrize("name", ["sideways position", "ultrasonic distance"])
def test_a_displacement_gives_the_angle_before_any_fit(name: str, tmp_path: Path) -> None:
    """A fit with scale and zero free would correct a wrong length."""
    path, truth = written(name, tmp_path)
    assert measure(Recording.read(path)).points.amplitude[0] == pytest.approx(truth["amplitude"], rel=0.04)


@pytest.mark.slow
def test_a_gate_may_be_read_at_a_constant_rate(tmp_path: Path) -> None:
    """A row for each reading of the beam: the passage is in the middle of the readings that are blocked."""
    swing = let_go(0.7, 0.02, 0.5, 40.0)
    time = np.arange(80_000) / 2000.0
    blocked = np.abs(swing.length * np.sin(swing.at(time)[0]) - 0.002) < 0.006
    rows = "".join(f"{t:.4f},{state:d}\n" for t, state in zip(time, blocked, strict=True))
    (tmp_path / "gate.csv").write_text("Time (s),GateState\n" + rows)
    sheet = measure_gate(tmp_path / "gate.csv")
    assert sheet.small_period.value == pytest.approx(2.0 * math.pi * math.sqrt(0.7 / GRAVITY), rel=3e-4)
    cycles = sheet.periods
    crossings = time[:-1][np.diff(np.sign(swing.at(time)[0])) != 0]
    assert cycles[:5] == pytest.approx(crossings[2:7] - crossings[:5], abs=1.5e-3)


@pytest.mark.parametrize(("format_name", "options", "said"), [
    ("bare track", {"unit": "deg"}, "unit is for angles and angular velocities, but x and y of a track are read"),
    ("phyphox acceleration", {"unit": "rad"}, "but an acceleration is read"),
    ("clock times", {"time_unit": "ms"}, "time_unit is for a column of times, but times of day are read"),
    ("two runs", {"run": 2, "columns": (1, 2)}, "run and columns both choose columns"),
])
def test_settings_without_a_use_are_refused(
    format_name: str, options: dict[str, Any], said: str, tmp_path: Path
) -> None:
    path, _ = written(format_name, tmp_path)
    with pytest.raises(RecordingError, match=said):
        Recording.read(path, **options)


@pytest.mark.quick("3.0")
@pytest.mark.parametrize("degrees", [3.0, 6.0, 9.5])
def test_periods_that_show_no_amplitude_have_an_error_that_covers_it(degrees: float, tmp_path: Path) -> None:
    """Periods by the complete elliptic integral, timed to a millisecond: their mean is up to 8 errors off."""
    true, rng = 1.5, np.random.default_rng(2)
    size = math.radians(degrees) * np.exp(-0.01 * true * np.arange(40))
    periods = true * 2.0 / math.pi * ellipk(np.sin(size / 2.0) ** 2) + 1e-3 * rng.standard_normal(40)
    (tmp_path / "periods.txt").write_text("Period (s)\n" + "".join(f"{one:.5f}\n" for one in periods))
    sheet = measure_gate(tmp_path / "periods.txt")
    assert sheet.small_period.value == sheet.period.value
    assert abs(sheet.small_period.value - true) < sheet.small_period.error < 3e-3 * true
    assert sheet.small_period.error > 1.5 * math.radians(9.9) ** 2 / 16.0
    assert np.isnan(sheet.amplitudes).all()
    assert "covers amplitudes up to 10 degrees" in sheet.text


def test_the_sheet_of_a_workbook_has_at_least_three_rows_of_numbers(tmp_path: Path) -> None:
    pytest.importorskip("python_calamine")
    head = ("Time (s)", "Angle (deg)")
    swing: list[tuple[str | float, ...]] = [head, (0.0, 20.0), (0.5, -19.0), (1.0, 18.0)]
    (tmp_path / "book.xls").write_bytes(old_workbook([("settings", [head, (1.0, 2.0), (3.0, 4.0)]), ("swing", swing)]))
    found = Recording.read(tmp_path / "book.xls")
    np.testing.assert_allclose(np.degrees(found.angle), [20.0, -19.0, 18.0])
    assert "workbook: sheet swing is read" in found.notes


def test_a_refusal_says_whether_angles_are_in_degrees(tmp_path: Path) -> None:
    rows = "".join(f"{i / 10},{i % 7},{40 * math.cos(i):.3f},{0.7 * math.sin(i):.4f}\n" for i in range(60))
    (tmp_path / "odd.csv").write_text("time,speed,A,B\n" + rows)
    with pytest.raises(RecordingError) as caught:
        Recording.read(tmp_path / "odd.csv")
    _, first, second = str(caught.value).rsplit("; ", 3)[:3]
    assert "3 (A) begins with 40.000" in first
    assert "(an angle in degrees, " in first
    assert "(an angle in radians or degrees, " in second


def test_accelerations_in_g_may_exceed_2_g(tmp_path: Path) -> None:
    """Their mean is 1 g without any unit in the titles, though a wide swing reaches 2.5 g at the bottom."""
    swing = let_go(0.6, 0.05, 1.3, 30.0)
    time = np.arange(3000) / 100.0
    angle, rate, _ = swing.at(time)
    along = np.cos(angle) + swing.length * rate**2 / GRAVITY
    assert along.max() > 2.3
    rows = "".join(f"{t:.3f},{g:.5f},0.001,0.002\n" for t, g in zip(time, along, strict=True))
    (tmp_path / "unit.csv").write_text("t,ax,ay,az\n" + rows)
    found = Recording.read(tmp_path / "unit.csv")
    assert found.force is not None
    assert any(note.startswith("acceleration: in g") for note in found.notes)
    np.testing.assert_allclose(found.force, 9.80665 * along, atol=0.03)


def test_the_amplitude_of_a_swing_that_decays_quickly_is_that_at_its_time() -> None:
    """Of a phone on a string, 28 % smaller in every swing, the estimated angle follows the motion at all times."""
    swing = let_go(0.8, 0.35, 0.9, 14.0)
    time = np.arange(1400) / 100.0
    angle, rate, turn = swing.at(time)
    along = GRAVITY * np.cos(angle) + swing.length * rate**2
    across = GRAVITY * np.sin(angle) + swing.length * turn
    noise = 0.01 * np.random.default_rng(2).standard_normal((len(time), 2))
    found = felt(time, np.stack([along, across], axis=1) + noise, ["y", "x"], False, swing.length)
    off = np.abs(np.abs(found.angle) - np.abs(angle[:len(found.angle)]))
    assert np.quantile(off[time[:len(off)] < 6.0], 0.9) < 0.05


def test_the_axis_of_an_accelerometer_is_that_of_the_swing_and_not_of_the_hand() -> None:
    """Before the release, a hand holds the phone askew by 0.4 rad for 4 s; the axis is that of the force afterwards."""
    swing = let_go(0.8, 0.02, 0.5, 34.0, 4.0)
    time = np.arange(3400) / 100.0
    angle, rate, turn = swing.at(time)
    along = np.where(time < 4.0, GRAVITY * math.cos(0.4), GRAVITY * np.cos(angle) + 0.8 * rate**2)
    aside = np.where(time < 4.0, GRAVITY * math.sin(0.4), 0.0)
    across = np.where(time < 4.0, 0.0, GRAVITY * np.sin(angle) + 0.8 * turn)
    noise = 0.01 * np.random.default_rng(1).standard_normal((len(time), 3))
    found = felt(time, np.stack([aside, along, across], axis=1) + noise, ["x", "y", "z"], False, None)
    share = [float(word.split()[0]) for word in found.notes[0].split(";")[0].split(", ")[1:]]
    np.testing.assert_allclose(share, [0.0, 1.0, 0.0], atol=3e-3)


# --- readings that are left out --------------------------------------------------------------------------------------


def test_runs_of_wrong_readings_are_found_among_many_spikes() -> None:
    """With every tenth reading far off, steps between good readings are counted per reading."""
    time = np.arange(900) / 30.0
    clean = let_go(0.5, 0.03, 0.4, 31.0).at(time)[0]
    seen = clean.copy()
    seen[5::10] += 1.0
    step = float(np.max(np.abs(np.diff(clean))))
    at = int(np.argmin(np.abs(time - 20.0)))
    wrong = slice(at, at + 8)
    seen[wrong] = clean[wrong] + 5.0 * step
    found = calmed(Recording(time, seen, "spoilt")).angle
    np.testing.assert_allclose(found, clean, atol=2.0 * step)


def test_lost_readings_are_found_near_the_bottom_too(tmp_path: Path) -> None:
    """Readings of exactly 0 are lost where the angle jumps by 4 times the usual step or more, and stay below."""
    time = np.arange(1500) / 50.0
    angle = np.degrees(let_go(0.5, 0.02, 0.5, 31.0).at(time)[0])
    usual = float(np.quantile(np.abs(np.diff(angle)), 0.95))
    for low, high, lost in ((4.2, 5.8, True), (2.2, 3.8, False)):
        ends = np.abs(np.stack([angle[:-4], angle[4:]])) / usual
        least, most = ends.min(axis=0), ends.max(axis=0)
        at = int(np.flatnonzero((least > low) & (least < high) & (most < 20.0))[0])
        seen = angle.copy()
        seen[at + 1:at + 4] = 0.0
        path = tmp_path / f"{lost}.csv"
        path.write_text("t (s),angle (deg)\n" + "".join(f"{t:.3f},{a:.4f}\n" for t, a in zip(time, seen, strict=True)))
        found = Recording.read(path)
        assert len(found.time) == len(time) - 3 * lost
