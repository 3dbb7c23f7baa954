"""Files that a bench met and that were read or judged wrongly: each is read right, or refused with what reads it.

Files of the folder in LAB_PENDULUM_DATA have the truths of its README; the others have numbers of their own.
"""

from __future__ import annotations

import json
import math
import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bench_files import GRAVITY, Swing, let_go, quoted, workbook, zipped
from command_line import Here
from driven_truth import drawn, expected, recorded, text_of
from small_driven_fit import log_of

from pendulum_env.lab import DrivenLog, Recording, RecordingError, fit, fit_driven, measure, measure_gate
from pendulum_env.lab import quantities as declared
from pendulum_env.lab.fitting.errors import at_bound

DATA = os.environ.get("LAB_PENDULUM_DATA", "")
FAULTS = Path(DATA) / "faults"
real = pytest.mark.skipif(not DATA, reason="LAB_PENDULUM_DATA names no folder of real recordings")
T0 = math.tau * math.sqrt(0.5 / GRAVITY)


def table(folder: Path, header: str, *columns: Any, digits: str = ".5f") -> Path:
    path = folder / "file.csv"
    rows = "".join(",".join(f"{x:{digits}}" for x in row) + "\n" for row in zip(*columns, strict=True))
    path.write_text(f"{header}\n{rows}" if header else rows, encoding="utf-8")
    return path


def period(swing: Swing) -> float:
    return math.tau * math.sqrt(swing.length / GRAVITY)


def degrees(swing: Swing, time: np.ndarray) -> np.ndarray:
    return np.degrees(swing.at(time)[0])


# --- the shared files ------------------------------------------------------------------------------------------------

READ: dict[str, dict[str, Any]] = {
    "encoder_rows_at_changes": {}, "capstone_empty_last_column": {}, "x_y_and_dead_theta": {},
    "x_y_and_derivatives": {}, "times_rounded_to_tenths": {"rate": 40.0},
    "encoder_counts_12_bit": {"scale": 360 / 4096, "unit": "deg"},
}
REFUSED = {
    "times_rounded_to_tenths": "they look rounded to 0.1 s: if readings come at a constant rate, give rate=40)",
    "encoder_counts_12_bit": "give the size of one count: scale=360/4096, unit=deg for a magnetic encoder",
    "autocorrelation": "'Autocorrelation of sum' is a result calculated from a swing: export the readings",
    "period_against_length": "'length (m)' is a length: lab-pendulum measure reads lengths beside periods",
    "driven_without_viscous_friction": "is a log of a driven run; lab-pendulum fit reads it",
    "photogate_starts_blocked": "'Gate State' is a gate state: lab-pendulum measure reads photogates",
}


@pytest.mark.quick("x_y_and_derivatives", "encoder_counts_12_bit")
@real
@pytest.mark.parametrize("name", READ)
def test_a_shared_file_gives_its_truth(name: str) -> None:
    """T0 within four of its errors, and the first amplitude that of a release at 30 degrees."""
    sheet = measure(Recording.read(FAULTS / f"{name}.csv", **READ[name]))
    assert abs(sheet.small_period.value - T0) < 4.0 * sheet.small_period.error
    assert sheet.small_period.error < 1e-3 * T0
    assert math.degrees(sheet.points.amplitude[0]) == pytest.approx(29.0, abs=1.2)


@real
@pytest.mark.parametrize("name", REFUSED)
def test_a_shared_file_is_refused_with_the_remedy(name: str) -> None:
    with pytest.raises(RecordingError, match=re.escape(REFUSED[name])):
        Recording.read(FAULTS / f"{name}.csv")


REMEDIES = {
    "angles_scaled_by_3": ("scale", 1.5015, r"The angles are 1\.50\d+ ± 0\.00\d+ times too large: --free length,sc"),
    "one_outlier": ("outliers", 15.0, "One reading at 12.5 s is 15° off: --robust or --drop 12.45:12.55."),
}
"""Name of the fault, its size, and its sentence. The scale of the first file is 1.5015 by SciPy's fit, too, not 3."""


@pytest.mark.slow
@real
@pytest.mark.filterwarnings("ignore:The ", "ignore:One reading")
@pytest.mark.parametrize("name", [
    pytest.param(name, marks=() if name == "one_outlier" else pytest.mark.slow) for name in REMEDIES])
def test_a_shared_file_with_a_fault_names_the_remedy(name: str) -> None:
    kind, size, sentence = REMEDIES[name]
    found = fit(Recording.read(FAULTS / f"{name}.csv"), "linear+quadratic")
    (remedy,) = found.remedies
    assert remedy.name == kind
    assert abs(remedy.number.value - size) < 4.0 * remedy.number.error
    assert re.search(sentence, found.grade.text)
    assert found.grade.word != "usable"
    assert "swings grow" not in found.grade.text


@real
@pytest.mark.slow
def test_a_wrong_scale_makes_the_shared_fit_not_usable(
    run_here: Here, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The command says the remedy, and nothing about damping; with the remedy, the fit is usable."""
    monkeypatch.setenv("LAB_PENDULUM_BACKEND", "compiled")  # a fit takes minutes interpreted
    words = ("fit", str(FAULTS / "angles_scaled_by_3.csv"), "--out", str(tmp_path / "out"))
    said = " ".join(run_here(*words)[1].split())
    assert "The model linear does not follow the recording: its residual is 3.33° rms, 14 times the error" in said
    assert "The best model" not in said
    assert "The fit is not usable, because the model does not follow the recording." in said
    assert "The fit is usable." in " ".join(run_here(*words, "--free", "length,scale")[1].split())


@real
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:The ", "ignore:One reading")
def test_the_shared_jump_is_subtracted_unless_it_shall_stay(
    run_here: Here, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LAB_PENDULUM_BACKEND", "compiled")  # a fit takes minutes interpreted
    path = FAULTS / "zero_jumps_once.csv"
    found = fit(Recording.read(path), "linear+quadratic")
    (jump,) = found.subtracted
    assert abs(jump.number.value - 1.5) < 3.0 * jump.number.error
    assert jump.at == pytest.approx(17.5, abs=0.03)
    assert math.degrees(found.rms) == pytest.approx(0.2, abs=0.01)
    assert found.grade.word == "usable"
    gamma, c = found.parameters["linear_drag.gamma"], found.parameters["quadratic_drag.c"]
    assert abs(gamma.value - 0.03) < 3.0 * gamma.error
    assert abs(c.value - 0.02) < 3.0 * c.error
    words = ("fit", str(path), "--effects", "linear+quadratic", "--out", str(tmp_path / "out"))
    said = " ".join(run_here(*words, "--no-jumps")[1].split())
    assert "The zero jumps by 1.52° at 17.5 s: --until 17.5." in said
    said = " ".join(run_here(*words)[1].split())
    assert "The zero jumps by 1.52° at 17.5 s: subtracted (--no-jumps leaves it in)." in said


@real
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:The ", "ignore:One reading")
@pytest.mark.parametrize("name", READ)
def test_a_shared_file_that_is_read_right_needs_no_remedy(name: str) -> None:
    found = fit(Recording.read(FAULTS / f"{name}.csv", **READ[name]), "linear+quadratic")
    assert (found.remedies, found.subtracted, found.grade.word) == ((), (), "usable")


@real
def test_shared_amplitudes_by_hand_are_named() -> None:
    with pytest.raises(RecordingError, match="look like amplitudes that were noted by hand"):
        measure(Recording.read(FAULTS / "amplitudes_by_hand.csv"))


@real
def test_the_shared_photogate_that_starts_blocked_gives_its_period() -> None:
    sheet = measure_gate(FAULTS / "photogate_starts_blocked.csv", length=0.6, length_error=1e-4)
    assert abs(sheet.small_period.value - 1.553893) < 4.0 * sheet.small_period.error + 5e-7
    assert sheet.gravity is not None
    assert sheet.gravity.value == pytest.approx(GRAVITY, abs=1e-5)
    with pytest.raises(RecordingError, match="'length \\(m\\)' is a length"):
        measure_gate(FAULTS / "period_against_length.csv")


@pytest.mark.slow
@real
def test_the_shared_bench_without_viscous_friction_has_a_scene() -> None:
    found = fit_driven(DrivenLog.read(FAULTS / "driven_without_viscous_friction.csv"), inertia=0.18)
    moment, dry = found.parameters["moment"], found.parameters["friction_torque"]
    assert abs(moment.value * GRAVITY - 3.6) < 4.0 * moment.error * GRAVITY
    assert abs(dry.value - 0.15) < 4.0 * dry.error
    assert found.at_bound == ("bearing_viscosity",)
    check_at_bound(found)


# --- encoders that write a row for each change -----------------------------------------------------------------------


def rows_at_changes(swing: Swing, quantum: float, until: float, tick: float = 5e-4) -> tuple[np.ndarray, np.ndarray]:
    time = np.arange(0.0, until, tick)
    count = np.round(degrees(swing, time) / quantum).astype(int)
    rows = np.flatnonzero(np.diff(count, prepend=count[0] - 1))
    return time[rows], quantum * count[rows]


@pytest.mark.quick("0.36-1.0")
@pytest.mark.parametrize(("quantum", "side"), [(0.1, -1.0), (0.36, 1.0), (1.0, -1.0), (2.0, 1.0)])
def test_an_encoder_that_writes_changes_is_measured_for_every_quantum(
    quantum: float, side: float, tmp_path: Path
) -> None:
    """The period and the amplitudes, without a gap at the turning points and without the lag of half a step."""
    swing = let_go(0.44, 0.04, side * math.radians(26.3), 22.0)
    time, angle = rows_at_changes(swing, quantum, 22.0)
    found = Recording.read(table(tmp_path, "time (s),angle (deg)", time, angle, digits=".4f"))
    assert not any(note.startswith("gaps") for note in found.notes)
    assert any(note.startswith("encoder: a row for each change") for note in found.notes)
    sheet = measure(found)
    assert abs(sheet.small_period.value - period(swing)) < 3.0 * sheet.small_period.error
    assert sheet.small_period.value == pytest.approx(period(swing), rel=2e-4)
    size = np.degrees(np.abs(swing.at(sheet.points.time + (found.released().release or 0.0))[0]))
    assert np.degrees(sheet.points.amplitude) == pytest.approx(size, abs=0.6 * quantum)
    assert sheet.cycles is not None
    assert sheet.cycles.left_out == 0


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:The fitted gamma holds")
def test_an_encoder_that_writes_changes_is_fitted(tmp_path: Path) -> None:
    swing = let_go(0.44, 0.04, math.radians(26.3), 22.0)
    time, angle = rows_at_changes(swing, 0.36, 22.0)
    found = fit(Recording.read(table(tmp_path, "time (s),angle (deg)", time, angle, digits=".4f")), "linear", mass=1.0)
    length, gamma = found.parameters["length"], found.parameters["linear_drag.gamma"]
    assert length.value == pytest.approx(0.44, abs=1e-5)
    assert abs(length.value - 0.44) < 3.0 * length.error
    assert abs(gamma.value - 0.04) < 3.0 * gamma.error


def test_a_gap_in_the_rows_of_changes_is_still_a_gap(tmp_path: Path) -> None:
    swing = let_go(0.44, 0.04, math.radians(26.3), 22.0)
    time, angle = rows_at_changes(swing, 0.36, 22.0)
    keep = (time < 6.1) | (time > 7.9)
    found = Recording.read(table(tmp_path, "time (s),angle (deg)", time[keep], angle[keep], digits=".4f"))
    assert any(note.startswith("gaps: 1 longer") for note in found.notes)


def test_equal_steps_of_a_sampled_sensor_are_no_changes(tmp_path: Path) -> None:
    swing = let_go(0.44, 0.04, math.radians(4.0), 12.0)
    time = np.arange(0.0, 12.0, 0.02)
    angle = 0.5 * np.round(degrees(swing, time) / 0.5)
    found = Recording.read(table(tmp_path, "time (s),angle (deg)", time, angle))
    assert not any(note.startswith("encoder") for note in found.notes)
    np.testing.assert_allclose(np.degrees(found.angle), angle, atol=1e-9)


# --- photogates ------------------------------------------------------------------------------------------------------


def passages(swing: Swing, width: float, until: float) -> tuple[np.ndarray, np.ndarray]:
    time = np.arange(0.0, until, 1e-4)
    inside = width / 2.0 - np.abs(swing.length * np.sin(swing.at(time)[0]))
    at = np.flatnonzero(np.sign(inside[1:]) != np.sign(inside[:-1]))
    return time[at] + 1e-4 * inside[at] / (inside[at] - inside[at + 1]), (inside[at + 1] > 0.0).astype(int)


@pytest.mark.quick("0-7.0-0.025")
@pytest.mark.parametrize(("amplitude", "width"), [(7.0, 0.025), (-33.0, 0.008)])
@pytest.mark.parametrize("first", [0, 1])
def test_a_gate_is_read_whichever_state_is_first(amplitude: float, first: int, width: float, tmp_path: Path) -> None:
    """A wide bob at a small amplitude, too; T0 is that without drag."""
    swing = let_go(0.7, 0.03, math.radians(amplitude), 40.0)
    time, state = (one[first:] for one in passages(swing, width, 40.0))
    assert state[0] == 1 - first
    noisy = time + 1e-5 * np.random.default_rng(3).standard_normal(len(time))
    sheet = measure_gate(table(tmp_path, "Time (s),Gate State", noisy, state, digits=".6f"))
    assert sheet.small_period.value == pytest.approx(period(swing), rel=6e-5)
    assert abs(sheet.small_period.value - period(swing)) < 4.0 * sheet.small_period.error


@pytest.mark.slow
@pytest.mark.parametrize("header", ["Time (s),Gate State", "Counter,Time (s),GateState", ""])
def test_readings_of_a_gate_may_begin_blocked(header: str, tmp_path: Path) -> None:
    swing = let_go(0.7, 0.02, 0.4, 30.0)
    time = np.arange(60_000) / 2000.0
    blocked = np.abs(swing.length * np.sin(swing.at(time)[0])) < 0.006
    start = int(np.flatnonzero(blocked)[3])
    columns = [time[start:], blocked[start:].astype(int)]
    columns = [np.arange(len(columns[0])), *columns] if "Counter" in header else columns
    path = tmp_path / "gate.csv"
    path.write_text((f"{header}\n" if header else "") + "".join(
        ",".join(f"{x:g}" for x in row) + "\n" for row in zip(*columns, strict=True)))
    small = measure_gate(path).small_period
    assert abs(small.value - period(swing)) < 3.0 * small.error
    assert small.value == pytest.approx(period(swing), rel=6e-4)


def test_states_that_may_be_changes_or_readings_are_refused(tmp_path: Path, run_here: Here) -> None:
    """An alternating state at a constant rate, and one of which a third repeats the row before."""
    time = 0.37 * np.arange(60)
    path = table(tmp_path, "Time (s),GateState", time, np.arange(60) % 2, digits="g")
    with pytest.raises(RecordingError, match=r"may be changes of the beam or readings.*states=readings \(--states\)"):
        measure_gate(path)
    assert measure_gate(path, states="changes").period.value == pytest.approx(1.48)
    code, _, said = run_here("measure", str(path), "--out", str(tmp_path / "out"))
    assert code == 2
    assert "--states" in said
    assert run_here("measure", str(path), "--states", "readings", "--out", str(tmp_path / "out"))[0] == 0
    uneven = np.cumsum(np.tile([0.05, 0.9, 0.4], 20))
    with pytest.raises(RecordingError, match="as 34% of them repeat the state before; give states="):
        measure_gate(table(tmp_path, "Time (s),GateState", uneven, np.tile([1, 0, 0], 20), digits="g"))
    with pytest.raises(RecordingError, match="states must be 'changes' or 'readings', got 'change'"):
        measure_gate(path, states="change")
    table(tmp_path, "t,angle (deg)", time, np.cos(time))
    assert "--states is for files with the states of a photogate" in run_here(
        "measure", str(path), "--states", "changes", "--out", str(tmp_path / "out"))[2]


def test_an_amplitude_is_no_length_and_may_be_in_any_column(tmp_path: Path) -> None:
    size = np.radians([40.0, 34.0, 28.0, 22.0, 16.0, 10.0])
    ideal = 1.5 / np.array([_agm(math.cos(a / 2.0)) for a in size])
    path = table(tmp_path, "no,Amplitude (deg),Period (s)", np.arange(6), np.degrees(size), ideal)
    assert measure_gate(path).small_period.value == pytest.approx(1.5, rel=1e-4)
    for title in ("length (m)", "L", "Länge (cm)"):
        path = table(tmp_path, f"{title},Period (s)", np.linspace(0.2, 1.2, 6), 2.0 * np.sqrt(np.linspace(0.2, 1.2, 6)))
        for read in (measure_gate, Recording.read):
            with pytest.raises(RecordingError, match="is a length: lab-pendulum measure reads lengths beside periods"):
                read(path)


def _agm(b: float) -> float:
    a = 1.0
    for _ in range(6):
        a, b = 0.5 * (a + b), math.sqrt(a * b)
    return a


# --- titles and columns ----------------------------------------------------------------------------------------------

SWING = let_go(0.6, 0.03, math.radians(25.0), 20.0)
TIME = np.arange(0.0, 20.0, 0.025)
ANGLE = SWING.at(TIME)[0]
SPEED = SWING.at(TIME)[1]


def check_read(path: Path, angle: np.ndarray = ANGLE, **options: Any) -> Recording:
    found = Recording.read(path, **options)
    np.testing.assert_allclose(found.angle, angle, atol=2e-5)
    return found


def test_an_empty_last_column_keeps_all_titles(tmp_path: Path) -> None:
    rows = "".join(f"{t:.4f},{w:.5f},{a:.5f},\n" for t, w, a in zip(TIME, SPEED, ANGLE, strict=True))
    head = "Time (s),Angular Velocity (rad/s),Angle (rad),Time in Gate (s)\n"
    (tmp_path / "one.csv").write_text(head + rows)
    check_read(tmp_path / "one.csv")
    (tmp_path / "short.csv").write_text(head + rows.replace(",\n", "\n"))  # rows without the empty field
    check_read(tmp_path / "short.csv")


def test_an_empty_column_at_the_end_of_the_last_run_keeps_the_runs(tmp_path: Path) -> None:
    rows = "".join(f"{t:.4f},{a:.5f},,{t:.4f},{0.5 * a:.5f},\n" for t, a in zip(TIME, ANGLE, strict=True))
    head = ",".join(f"{title} Run #{run}" for run in (1, 2) for title in ("Time (s)", "Angle (rad)", "Gate (s)"))
    (tmp_path / "runs.csv").write_text(f"{head}\n{rows}")
    check_read(tmp_path / "runs.csv", run=1)
    check_read(tmp_path / "runs.csv", 0.5 * ANGLE, run=2)


def test_titles_may_be_fewer_than_columns(tmp_path: Path) -> None:
    check_read(table(tmp_path, "Angle (rad),Time (s)", ANGLE, TIME, np.arange(len(TIME))))
    rows = "".join(f"{i},{t:.4f},{a:.5f}\n" for i, (t, a) in enumerate(zip(TIME, ANGLE, strict=True), 1))
    (tmp_path / "names.csv").write_text(f"Time (s),Angle (rad)\n{rows}")
    check_read(tmp_path / "names.csv")
    (tmp_path / "text.csv").write_text("Ball, string, 3 m, made by A\n" + rows.replace("\n", ",0\n"))
    with pytest.raises(RecordingError):  # no title: the first two columns are a count and the time
        measure(Recording.read(tmp_path / "text.csv"))


def test_dead_columns_are_passed_over(tmp_path: Path) -> None:
    x, y, zero = 0.6 * np.sin(ANGLE), -0.6 * np.cos(ANGLE), 0.0 * TIME
    found = check_read(table(tmp_path, "time,x,y,theta", TIME, x, y, zero, digits=".7f"))
    assert "columns: 4 (theta) left out, as it does not change" in found.notes
    check_read(table(tmp_path, "time,theta,phi,angle (rad)", TIME, zero, zero + 3.0, ANGLE))
    found = Recording.read(table(tmp_path, "time,theta (rad),Gyroscope y (rad/s)", TIME, zero, SPEED))
    assert found.rate is not None
    (tmp_path / "empty.csv").write_text("t,angle 1 (rad),angle 2 (rad)\n" + "".join(
        f"{t:.4f},,{a:.6f}\n" for t, a in zip(TIME, ANGLE, strict=True)))
    check_read(tmp_path / "empty.csv")
    with pytest.raises(RecordingError):
        measure(Recording.read(table(tmp_path, "time,theta", TIME, zero)))


def test_an_x_that_increases_is_the_time_of_a_plot(tmp_path: Path) -> None:
    zero = 0.0 * TIME
    check_read(table(tmp_path, "X,Y,X',Y'", TIME, ANGLE, zero + 0.01, zero + 0.003))
    check_read(table(tmp_path, "X,Y", TIME, ANGLE))
    with pytest.raises(RecordingError, match="expected times beside x and y, found none; give rate="):
        Recording.read(table(tmp_path, "x,y", 0.6 * np.sin(ANGLE), -0.6 * np.cos(ANGLE)))


NUMBERS: dict[str, tuple[str, tuple[Any, ...], str, dict[str, Any]]] = {
    "milli-g": ("", (TIME, 1000.0 * (np.cos(ANGLE) + 0.6 / GRAVITY * SPEED**2)),
                "for an acceleration choose by columns='time=1,acceleration=2'", {"columns": "time=1,acceleration=2"}),
    "m/s²": ("t,value", (TIME, GRAVITY * np.cos(ANGLE) + 0.6 * SPEED**2),
             "may be an acceleration in m/s² or an angle", {"columns": "time=1,acceleration=2"}),
    "counts": ("millis,raw", (1e3 * TIME, np.round(512.0 + np.degrees(ANGLE) * 1024 / 360)),
               "scale=360/4096, unit=deg", {"scale": 360 / 1024, "unit": "deg"}),
    "wide counts": ("t,value", (TIME, np.round(np.degrees(ANGLE) * 20000 / 360)),
                    "which swing by more than a turn", {"scale": 360 / 20000, "unit": "deg"}),
    "states": ("t,value", (TIME, (ANGLE > 0.0).astype(int)), "holds nothing but 0 and 1", {}),
    "three axes": ("", (TIME, 1000.0 * np.sin(ANGLE), 0.0 * TIME + 3.0, 1000.0 * np.cos(ANGLE)),
                   "as three axes of an acceleration in mg are", {}),
}


@pytest.mark.parametrize("name", NUMBERS)
def test_numbers_that_are_no_angle_are_refused_with_what_reads_them(name: str, tmp_path: Path) -> None:
    header, columns, words, options = NUMBERS[name]
    path = table(tmp_path, header, *columns, digits=".8g")
    with pytest.raises(RecordingError, match=re.escape(words)):
        Recording.read(path)
    if options:
        sheet = measure(Recording.read(path, **options))
        assert sheet.small_period.value == pytest.approx(period(SWING), rel=2e-3)


def test_a_bob_that_rotates_before_it_swings_is_no_fault(tmp_path: Path) -> None:
    spun = np.concatenate([np.linspace(-1000.0, 0.0, 60, endpoint=False), np.degrees(ANGLE)])
    found = Recording.read(table(tmp_path, "t,value", 0.025 * np.arange(len(spun)), spun))
    assert np.degrees(found.angle[0]) == pytest.approx(-1000.0)


def test_a_unit_or_a_title_that_names_an_angle_is_believed(tmp_path: Path) -> None:
    far = np.degrees(ANGLE) + 1000.0
    for header, options in (("t,value", {"unit": "deg"}), ("t,angle", {}), ("t,value (deg)", {})):
        found = Recording.read(table(tmp_path, header, TIME, far), **options)
        np.testing.assert_allclose(np.degrees(found.angle), far, atol=1e-4)


@pytest.mark.parametrize(("decimals", "rate"), [(1, 40.0), (1, 15.0), (0, 8.0)])
def test_times_that_are_rounded_give_the_rate_to_ask_for(decimals: int, rate: float, tmp_path: Path) -> None:
    time = np.arange(300) / rate
    angle = degrees(let_go(0.6, 0.03, 0.4, 40.0), time)
    path = table(tmp_path, "time (s),angle (deg)", time, angle)
    path.write_text("time (s),angle (deg)\n" + "".join(
        f"{t:.{decimals}f},{a:.4f}\n" for t, a in zip(time, angle, strict=True)))
    clause = f"if readings come at a constant rate, give rate={rate:g}"
    if rate == 15.0:  # a third of the rows repeat a time, and are dropped
        assert any(clause in note for note in Recording.read(path).notes)
    else:
        with pytest.raises(RecordingError, match=re.escape(clause)):
            Recording.read(path)
    np.testing.assert_allclose(Recording.read(path, rate=rate).time, time, atol=1e-9)


def test_a_quotient_is_a_scale_on_the_command_line(tmp_path: Path, run_here: Here) -> None:
    path = table(tmp_path, "millis,raw", 1e3 * TIME, np.round(2048.0 + np.degrees(ANGLE) * 4096 / 360), digits="g")
    read = ("--read", "scale=360/4096", "--read", "unit=deg")
    assert run_here("measure", str(path), *read, "--out", str(tmp_path / "out"))[0] == 0
    (row,) = re.findall("^period at small amplitude T0,([^,]*),", (tmp_path / "out" / "measured.csv").read_text(), re.M)
    assert float(row) == pytest.approx(period(SWING), rel=1e-3)
    code, _, said = run_here("fit", str(path), "--scale", "360/0", "--unit", "deg", "--out", str(tmp_path / "out"))
    assert code == 2
    assert "scale must be a finite number other than 0, got '360/0'" in said


# --- archives --------------------------------------------------------------------------------------------------------


def pendulum_export() -> list[tuple[str, list[tuple[Any, ...]]]]:
    """The tables of phyphox's experiment Pendulum: rates, their autocorrelation, and a resonance curve."""
    zero = 0.0 * TIME
    raw = zip(TIME.tolist(), zero.tolist(), (SPEED + 0.01).tolist(), zero.tolist(), strict=True)
    lags = (0.02 * np.arange(250)).tolist()
    shifted = [("Time shift (s)", "Autocorrelation of sum"), *((t, math.cos(4.0 * t)) for t in lags)]
    return [("Autocorrelation", shifted),
            ("Raw Data", [("Time (s)", *(f"Rotation {axis} (rad/s)" for axis in "xyz")), *raw]),
            ("Resonance", [("Frequency (Hz)", "Rel. amplitude (a.u.)"), *((0.6 + t, 1.0 - t) for t in lags[:9])])]


@pytest.mark.parametrize("kind", ["zip", "xlsx"])
def test_the_part_with_the_sensor_is_read_and_said(kind: str, tmp_path: Path) -> None:
    path = tmp_path / f"export.{kind}"
    if kind == "xlsx":
        pytest.importorskip("python_calamine")
        workbook(path, pendulum_export())
    else:
        zipped(path, [(f"{name}.csv", "\n".join([quoted(rows[0]), *(",".join(f"{x:.8e}" for x in row) for row in
                                                                 rows[1:]), ""])) for name, rows in pendulum_export()])
    ending = ".csv" if kind == "zip" else ""
    found = Recording.read(path)
    assert found.rate is not None
    assert any(f"Raw Data{ending} is read, which has the sensor's readings (part= chooses Autocorrelation{ending} or "
               f"Resonance{ending})" in note for note in found.notes)
    assert measure(found).small_period.value == pytest.approx(period(SWING), rel=1e-4)
    for part, title in (("Autocorrelation", "Autocorrelation of sum"), ("Resonance", "Frequency (Hz)")):
        with pytest.raises(RecordingError, match=re.escape(f"{title!r} is a result calculated from a swing")):
            Recording.read(path, part=part + ending)


# --- one declaration -------------------------------------------------------------------------------------------------

TITLES = {
    declared.NO_FORCE: ("Linear Acceleration x (m/s^2)", "User acceleration y"),
    declared.LENGTH: ("length (m)", "L"), declared.CORRELATION: ("Autocorrelation", "Spectrum", "Frequency (Hz)"),
    declared.COUNTS: ("counts", "ticks"), declared.OTHER_ANGLE: ("A (mrad)", "turns"),
    declared.OTHER_UNIT: ("Potential (V)", "A (px)"), declared.PERIOD: ("Period (s)",),
    declared.GATE: ("Gate State",), declared.RAW: ("raw", "ADC", "angle (12-bit)"),
}
"""Quantities that are refused -> titles that name them."""


@pytest.mark.parametrize("quantity", TITLES, ids=lambda quantity: quantity.name)
def test_a_title_of_another_quantity_is_refused_by_its_declaration(
    quantity: declared.Quantity, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The sentence has the remedy of the declaration, and follows it when it changes."""
    for title in TITLES[quantity]:
        path = table(tmp_path, f"Time (s),{title}", TIME, 30.0 * ANGLE)
        with pytest.raises(RecordingError, match=re.escape(quantity.remedy)) as caught:
            Recording.read(path)
        assert title in str(caught.value)
    monkeypatch.setitem(vars(quantity), "remedy", "turn it upside down")
    with pytest.raises(RecordingError, match="turn it upside down"):
        Recording.read(path)
    assert "turn it upside down" in quantity.cells[3]


def test_every_refused_quantity_is_tried_or_has_a_place_of_its_own() -> None:
    refused = {quantity.name for quantity in declared.QUANTITIES if not quantity.reading}
    own = {declared.COUNT.name, declared.RATE_OF_CHANGE.name, declared.OTHER.name, declared.GYROSCOPE.name}
    assert refused <= {quantity.name for quantity in TITLES} | own


# --- side quantities -------------------------------------------------------------------------------------------------

SIDE = {
    "pendulum_env.lab.sheet.corrected_periods": "Left out: the periods of single cycles, because it fails here.",
    "pendulum_env.lab.sheet.losses": "Left out: the loss per half swing, because it fails here.",
    "pendulum_env.lab.sheet.envelope_rate": "Left out: the lab sheet, because it fails here.",
    "pendulum_env.lab.fitting.fit.of_swings": "left out: the check of the swings' decay, because it fails here",
    "pendulum_env.lab.fitting.result.of_misfit": "left out: the noise of the readings, because it fails here",
    "pendulum_env.lab.fitting.result.reading_error": "left out: the noise of the readings, because it fails here",
    "pendulum_env.plots.recorded.recorded": "Left out: the figure fit.png, because it fails here.",
    "pendulum_env.study.fit_report.against_track": "Left out: the radius of the track, because it fails here.",
    "pendulum_env.lab.fitting.result.chi_squared_p": "Left out: the details of the fit, because it fails here.",
}
"""Function that is made to fail -> what the text says."""


ERRORS = (ValueError, ZeroDivisionError, np.linalg.LinAlgError)
"""Errors of a check of values, of a division and of linear algebra."""


@pytest.mark.slow
@pytest.mark.parametrize(("name", "error"), [(name, ERRORS[i % 3]) for i, name in enumerate(SIDE)])
def test_no_side_quantity_ends_a_fit(
    name: str, error: type[Exception], tmp_path: Path, run_here: Here, monkeypatch: pytest.MonkeyPatch
) -> None:
    time = np.arange(0.0, 12.0, 0.05)
    noise = 0.05 * np.random.default_rng(1).standard_normal(len(time))
    path = table(tmp_path, "t (s),angle (deg)", time, degrees(SWING, time) + noise)

    def fails(*_: Any, **__: Any) -> Any:
        raise error("it fails here")

    monkeypatch.setattr(name, fails)
    code, out, said = run_here("fit", str(path), "--effects", "linear", "--mass", "1", "--details", "--out",
                               str(tmp_path / "out"))
    text = re.sub(r"\s+", " ", out + said)
    assert code == 0, text
    assert SIDE[name] in text
    scene = json.loads((tmp_path / "out" / "scene.json").read_text())
    assert scene["body"]["length"] == pytest.approx(0.6, rel=2e-3)


@pytest.mark.parametrize("name", ["fit.of_swings", "result.of_misfit", "result.reading_error"])
@pytest.mark.filterwarnings("ignore:The fit")
def test_a_check_that_fails_is_an_exception_of_the_grade(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    time = np.arange(0.0, 9.0, 0.1)
    angle = SWING.at(time)[0] + 1e-3 * np.random.default_rng(1).standard_normal(len(time))

    def fails(*_: Any) -> Any:
        raise ZeroDivisionError("it fails here")

    monkeypatch.setattr(f"pendulum_env.lab.fitting.{name}", fails)
    found = fit(Recording(time, angle, "swing"), "linear", mass=1.0)
    assert re.search("usable, except that left out: the .*, because it fails here", found.grade.text)


def test_a_measurement_goes_on_without_the_periods_of_cycles(monkeypatch: pytest.MonkeyPatch) -> None:
    recording = Recording(TIME, ANGLE, "swing")
    whole = measure(recording)

    def fails(*_: Any) -> Any:
        raise RecordingError("it fails here")

    monkeypatch.setattr("pendulum_env.lab.sheet.corrected_periods", fails)
    part = measure(recording)
    assert part.cycles is None
    assert part.small_period.value == pytest.approx(whole.small_period.value, rel=1e-4)
    assert not any("single cycles" in row[0] for row in part.table.rows)
    assert "Left out: the periods of single cycles, because it fails here." in part.text
    with pytest.raises(RecordingError, match="500 full oscillations"):  # what was asked for is no side quantity
        measure(recording, n=500)


@pytest.mark.slow
@pytest.mark.filterwarnings("default:Left out")
def test_a_driven_fit_goes_on_without_its_figure(
    tmp_path: Path, run_here: Here, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: Any) -> Any:
        raise ValueError("it fails here")

    monkeypatch.setenv("LAB_PENDULUM_BACKEND", "compiled")  # a driven fit takes minutes interpreted
    monkeypatch.setattr("pendulum_env.plots.driven.driven", fails)
    log = recorded(drawn(0, "torque"), 0, "torque")
    (tmp_path / "log.csv").write_text(text_of(log, "t, action, angle", "torque"))
    code, out, said = run_here("fit", str(tmp_path / "log.csv"), "--out", str(tmp_path / "out"))
    assert code == 0
    assert "Left out: the figure fit.png, because it fails here." in re.sub(r"\s+", " ", out + said)
    assert (tmp_path / "out" / "bench.json").exists()


# --- bounds ----------------------------------------------------------------------------------------------------------


def check_at_bound(found: Any) -> None:
    """AssertionError unless a fit with viscosity at its bound has texts, a scene, samples and an environment."""
    assert re.search(r"bearing_viscosity: 0 \(at its bound\), below [\d.e-]+ N m s with 95 %\.", found.text)
    (row,) = [row for row in found.table.rows if row[0] == "bearing_viscosity"]
    assert re.fullmatch(r"0 \(at its bound\), below [\d.e-]+ with 95 %", row[1])
    one = found.parameters["bearing_viscosity"]
    assert one.value == 0.0 < one.error
    limit = found.to_dict()["parameters"]["bearing_viscosity"]["below"]
    assert 1.6 * one.error < limit < 2.0 * one.error * (1.0 + 5.0 / found.solution.freedom)
    assert found.interval("bearing_viscosity").low == 0.0
    assert [value for name, value in found.scene.parameters().items() if name.endswith("bearing_viscosity")] == [0.0]
    assert found.environment["scene"] == found.scene
    assert len(found.sample(5)["length"]) == 5


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["torque", "action"])
@pytest.mark.parametrize("seed", range(4))
def test_benches_without_viscous_friction_have_files(
    seed: int, kind: str, tmp_path: Path, run_here: Here, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LAB_PENDULUM_BACKEND", "compiled")  # a fit takes a minute interpreted
    truth = drawn(seed, kind, viscous=0.0)
    log = recorded(truth, seed, kind)
    found = fit_driven(DrivenLog(log["time"], log["angle"], log["drive"], kind), mass=truth["mass"])
    for name, value in expected(truth, kind).items():
        one = found.parameters[name]
        assert one.value >= 0.0 or name in ("zero", "delay")
        assert abs(one.value - value) < 4.0 * one.error + 1e-12, name
    if found.at_bound:
        check_at_bound(found)
    (tmp_path / "log.csv").write_text(text_of(log, "t, action, angle", kind))
    code, out, _ = run_here("fit", str(tmp_path / "log.csv"), "--mass", str(truth["mass"]), "--read", "unit=rad",
                            "--out", str(tmp_path / "out"))
    assert code == 0
    assert ("at its bound" in out) == bool(found.at_bound)
    assert {path.name for path in (tmp_path / "out").iterdir()} >= {"scene.json", "bench.json", "parameters.csv"}


@pytest.mark.slow
def test_a_bench_without_viscous_friction_is_at_its_bound() -> None:
    truth = drawn(2, "torque", viscous=0.0)
    log = recorded(truth, 2, "torque")
    found = fit_driven(DrivenLog(log["time"], log["angle"], log["drive"], "torque"), mass=truth["mass"])
    assert found.at_bound == ("bearing_viscosity",)
    check_at_bound(found)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:The fitted gamma holds")
def test_a_drag_of_a_free_swing_is_at_its_bound_too() -> None:
    """A swing with linear drag alone, fitted with quadratic drag, too: half of such fits are at the bound of c."""
    time = np.arange(0.0, 20.0, 0.05)
    source, seen = np.random.default_rng(4), 0
    for _ in range(5):
        angle = SWING.at(time)[0] + 2e-3 * source.standard_normal(len(time))
        found = fit(Recording(time, angle, "swing"), "linear+quadratic", mass=1.0)
        assert found.at_bound == tuple(name for name in at_bound(found.solution) if name == "quadratic_drag.c")
        if found.at_bound:
            seen += 1
            assert re.fullmatch(r"0 \(at its bound\), below [\d.e-]+ 1/rad with 95 %",
                                found.parameter_text("quadratic_drag.c"))
    assert 0 < seen < 5


# --- a bob that rotates ----------------------------------------------------------------------------------------------


def test_a_driven_bob_that_rotates_is_read_in_radians(tmp_path: Path) -> None:
    log = log_of({"stiffness": 20.0, "viscous": 0.2, "dry": 0.4, "drive": 60.0, "lag": 0.05, "delay": 0.02,
                  "zero": 0.03, "mass": 0.3, "quantum": math.tau / 4096, "noise": 0.001, "rate": 50.0,
                  "duration": 12.0, "torque_noise": 0.0}, seed=1)
    assert np.ptp(log.angle) > 220.0
    path = table(tmp_path, "t,action,angle", log.time, log.drive, log.angle)
    found = DrivenLog.read(path)
    np.testing.assert_allclose(found.angle, log.angle, atol=1e-5)
    assert any(note.startswith("unit: rad, inferred") for note in found.notes)
    wrong = DrivenLog.read(path, unit="deg")
    with pytest.raises(RecordingError):
        fit_driven(wrong, mass=0.3)
