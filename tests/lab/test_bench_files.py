"""Files of recordings in the formats that students have, from a writer that does not know the readers: read right."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bench_files import BENCH_FILES, written
from readme_code import check_listed

from pendulum_env.lab import Recording, RecordingError, fit, measure, measure_gate
from pendulum_env.lab.containers import FORMATS as FILES
from pendulum_env.lab.driven.log import is_driven
from pendulum_env.lab.quantities import ANGLE, DISTANCE, FORCE, GATE, PERIOD, QUANTITIES, RATE, TRACK
from pendulum_env.study.lists.tables import TABLES

FORMATS = {one.name: one for one in BENCH_FILES}
REFUSED = {
    "acceleration across a rod": "'Acceleration x (m/s^2)' shows no gravity, so it is either across the rod",
    "acceleration without g": "'Linear Acceleration x (m/s^2)' is an acceleration without gravity",
    "nameless axes": "the axes x, y and z may be an angular velocity or an acceleration",
}
"""Ambiguous formats -> how they are refused."""
GATES = ("gate", "periods")
FITTED = {one.kind: one.name for one in reversed(BENCH_FILES)}
"""Kind of quantity -> its first format, which quick tests fit."""
FELT = [name for name, one in FORMATS.items() if one.kind == "acceleration"]
SWINGS = [name for name, one in FORMATS.items() if one.kind not in GATES and name not in REFUSED]


@pytest.mark.quick(
    "rotary sensor", "encoder changes", "phyphox gyroscope csv", "phyphox gyroscope zip", "phyphox gyroscope xls",
    "bare track", "tracker project", "ultrasonic distance", "clock times", "german decimal commas",
    "arduino with words between", "absolute rate"
)
@pytest.mark.parametrize("name", [name for name in SWINGS if name not in FELT])
def test_a_swing_is_read_with_its_period_and_size(name: str, tmp_path: Path) -> None:
    """The strongest frequency of the readings is the swing's, and half their range is its amplitude, roughly."""
    path, truth = written(name, tmp_path, 5)
    assert not is_driven(path)
    found = Recording.read(path)
    values, size = (found.angle, truth["amplitude"]) if found.rate is None else (
        found.rate, 2.0 * math.pi * truth["amplitude"] / truth["period"])
    time = np.linspace(found.time[0], found.time[-1], 4096)
    swing = np.interp(time, found.time, values)
    strength = np.abs(np.fft.rfft(swing - swing.mean(), 2**16))
    frequency = np.argmax(strength) / (2**16 * (time[1] - time[0]))
    assert frequency * truth["period"] == pytest.approx(1.0, abs=0.03)  # a swing of 37 degrees is 2.6 % slower
    assert np.ptp(values) / 2.0 == pytest.approx(size, rel=0.15)


@pytest.mark.quick("5-phyphox gyroscope csv", "5-rotary sensor")
@pytest.mark.filterwarnings("ignore:The fit is", "ignore:The fitted gamma holds",
                            r"ignore:.* readings? .* off")  # as lost readings that are written as 0
@pytest.mark.parametrize(("seed", "name"), [
    pytest.param(seed, name, marks=() if seed == 5 and name in FITTED.values() and name not in FELT else
                 pytest.mark.slow)
    for seed in (5, 6) for name in SWINGS])
def test_a_swing_is_read_and_fitted(name: str, seed: int, tmp_path: Path) -> None:
    """Length to 0.5 %, amplitude at the release to 5 %; and the file is not taken for a driven log."""
    path, truth = written(name, tmp_path, seed)
    assert not is_driven(path)
    found = fit(Recording.read(path), "linear", mass=1.0).parameters
    assert found["length"].value == pytest.approx(truth["length"], rel=5e-3)
    assert abs(found["angle"].value) == pytest.approx(truth["amplitude"], rel=0.05)


@pytest.mark.quick("5-gate states", "5-periods")
@pytest.mark.parametrize("name", [name for name, one in FORMATS.items() if one.kind in GATES])
@pytest.mark.parametrize("seed", [5, pytest.param(6, marks=pytest.mark.slow)])
def test_a_photogate_gives_the_period_at_small_amplitude(name: str, seed: int, tmp_path: Path) -> None:
    path, truth = written(name, tmp_path, seed)
    assert not is_driven(path)
    sheet = measure_gate(path, length=truth["length"], length_error=1e-3)
    assert sheet.small_period.value == pytest.approx(truth["period"], rel=1.5e-3)
    assert sheet.length.value == pytest.approx(truth["length"], rel=3e-3)
    assert sheet.gravity is not None
    assert sheet.gravity.value == pytest.approx(9.81, rel=3e-3)
    assert sheet.period.value > sheet.small_period.value
    assert [row[3] for row in sheet.table.rows] == ["s", "s", "m", "m/s^2"]


@pytest.mark.quick("nameless axes")
@pytest.mark.parametrize("name", REFUSED)
def test_an_ambiguous_format_is_refused(name: str, tmp_path: Path) -> None:
    path, _ = written(name, tmp_path)
    assert FORMATS[name].ambiguous
    assert not is_driven(path)
    with pytest.raises(RecordingError, match=re.escape(REFUSED[name])):
        Recording.read(path)


KINDS = {"angle": ANGLE, "rate": RATE, "acceleration": FORCE, "track": TRACK, "distance": DISTANCE, "gate": GATE,
         "periods": PERIOD}
"""Kind of a format -> the quantity that its row in the table of formats has."""


def test_the_table_of_formats_is_made_from_the_declaration() -> None:
    check_listed("formats")
    rows = TABLES["formats"]().rows
    assert rows == (*(quantity.cells for quantity in QUANTITIES), *(file.cells for file in FILES))
    assert {one.kind for one in BENCH_FILES} == set(KINDS)
    assert all(quantity.reading and quantity.cells in rows for quantity in KINDS.values())


# --- what a reader says, and what a person chooses -------------------------------------------------------------------


def test_a_gyroscope_is_fitted_by_its_own_readings(tmp_path: Path) -> None:
    """The bias is a fitted number, and residuals are angular velocities."""
    path, truth = written("phyphox gyroscope csv", tmp_path)
    recording = Recording.read(path)
    assert recording.rate is not None
    found = fit(recording, "linear", mass=1.0)
    assert found.parameters["zero"].unit == "rad/s"
    assert abs(found.parameters["zero"].value) == pytest.approx(abs(truth["zero"]), abs=3e-3)  # other axes add
    assert found.degrees == "degrees/s"
    assert found.rms < 1e-2
    np.testing.assert_allclose(found.residual + found.model.angles(found.values)[0], found.recording.rate, atol=1e-12)
    error = found.parameters["length"]
    assert abs(error.value - truth["length"]) < 5.0 * error.error + 1e-4 * truth["length"]


@pytest.mark.quick("5-phone on a rod")
@pytest.mark.parametrize(("seed", "name"), [
    pytest.param(seed, name, marks=() if seed == 5 and name in ("phyphox acceleration", "phone on a rod")
                 else pytest.mark.slow) for seed in (5, 6) for name in FELT if name in SWINGS])
def test_an_accelerometer_gives_period_amplitude_and_its_own_distance(name: str, seed: int, tmp_path: Path) -> None:
    path, truth = written(name, tmp_path, seed)
    recording = Recording.read(path)
    sheet = measure(recording)
    assert sheet.small_period.value == pytest.approx(truth["period"], rel=2e-3)
    assert sheet.points.amplitude[0] == pytest.approx(truth["amplitude"], rel=0.06)
    found = fit(recording, "linear", mass=1.0)
    distance, length = found.parameters["sensor_distance"], found.parameters["length"]
    assert abs(distance.value - truth.get("reach", truth["length"])) < 4.0 * distance.error
    assert abs(length.value - truth["length"]) < 4.0 * length.error
    assert (found.degrees, found.parameters["zero"].unit) == ("m/s²", "m/s^2")
    assert found.rms == pytest.approx(0.02, rel=0.05)  # the noise that the writer adds
    np.testing.assert_allclose(found.residual + found.model.angles(found.values)[0], found.recording.force, atol=1e-12)


@pytest.mark.slow
def test_the_distance_of_an_accelerometer_is_known(tmp_path: Path) -> None:
    """Then an acceleration across the rod alone is read, and less is fitted to one along it."""
    path, truth = written("acceleration across a rod", tmp_path)
    found = fit(Recording.read(path, sensor=truth["reach"]), "linear", mass=1.0)
    assert "sensor_distance" not in found.names
    length, angle = found.parameters["length"], found.parameters["angle"]
    assert abs(length.value - truth["length"]) < 4.0 * length.error
    assert abs(angle.value) == pytest.approx(truth["amplitude"], rel=5e-3)
    path, truth = written("phone on a rod", tmp_path)
    both = [fit(Recording.read(path, sensor=sensor), "linear", mass=1.0).parameters["angle"]
            for sensor in (None, truth["reach"])]
    assert both[1].error < 0.7 * both[0].error
    assert both[1].value == pytest.approx(both[0].value, abs=5.0 * both[0].error)
    with pytest.raises(RecordingError, match="this file has no acceleration"):
        Recording.read(written("rotary sensor", tmp_path)[0], sensor=0.3)


@pytest.mark.slow
def test_axes_without_a_name_are_read_by_choice(tmp_path: Path) -> None:
    path, truth = written("nameless axes", tmp_path)
    found = fit(Recording.read(path, columns="time=2,rate=4"), "linear", mass=1.0).parameters
    assert found["length"].value == pytest.approx(truth["length"], rel=1e-3)
    path, truth = written("acceleration along the string", tmp_path)
    for columns in (None, "time=1,acceleration=2"):
        assert Recording.read(path, columns=columns).force is not None


REFUSALS = {
    "imagej": (" ,Track,Slice,X,Y\n" + "".join(f"{i},1,{i},{640 + 9 * (i % 7)},{50 - i % 5}\n" for i in range(1, 40)),
               "column 1 counts the readings (give rate="),
    "clock": ("t (s),angle (deg)\n" + "".join(f"{i if i < 500 else i - 400},{i % 9}\n" for i in range(1000)),
              "if the clock began again, leave one part out by until="),
    "words": ("t,angle (deg)\n" + "".join(f"{i},{i % 9}\nhello\n" for i in range(100)), "found 'hello'"),
    "raw": ("millis,ax,ay,az\n" + "".join(f"{i},{300 * (i % 7)},{16384 - i % 9},{i % 5}\n" for i in range(300)),
            "expected at least two swings of the acceleration"),
    "columns": ("n,time,KE,GateState\n" + "".join(f"{i},{i / 100},{i % 7},{i % 2}\n" for i in range(60)),
                "1 (n) begins with 0, 1, 2 (a counter of readings, or a time); 2 (time) begins with 0.0, 0.01, 0.02 "
                "(a time); 3 (KE) begins with 0, 1, 2 (no angle); 4 (GateState) begins with 0, 1, 0 (a gate state)"),
}


@pytest.mark.parametrize("name", REFUSALS)
def test_odd_files_are_refused_in_a_sentence(name: str, tmp_path: Path) -> None:
    text, problem = REFUSALS[name]
    (tmp_path / "odd.csv").write_text(text)
    with pytest.raises(RecordingError, match=re.escape(problem)):
        Recording.read(tmp_path / "odd.csv")


def test_a_run_is_chosen_and_the_others_are_named(tmp_path: Path) -> None:
    path, _ = written("two runs", tmp_path)
    first, second = Recording.read(path), Recording.read(path, run=2)
    assert any(note.startswith("run: 1 of 1, 2, the first") for note in first.notes)
    assert any(note.startswith("run: 2 of 1, 2, as given") for note in second.notes)
    assert len(first.time) != len(second.time)
    with pytest.raises(RecordingError, match="there is no run 3; there are 1, 2"):
        Recording.read(path, run=3)


CHOSEN: list[tuple[Any, str]] = [
    ("time=2,angle=4", ""), ("angle=4", "columns must include the time"),
    ("time=2,speed=4", "must name time and angle, rate, acceleration or x and y"), ((2, 4), ""),
]


@pytest.mark.parametrize(("columns", "problem"), CHOSEN)
def test_columns_are_chosen_by_kind(columns: Any, problem: str, tmp_path: Path) -> None:
    path, _ = written("counter first", tmp_path)
    if problem:
        with pytest.raises(RecordingError, match=problem):
            Recording.read(path, columns=columns)
    else:
        np.testing.assert_array_equal(Recording.read(path, columns=columns).angle, Recording.read(path).angle)


@pytest.mark.slow
def test_readings_are_left_out_on_request(tmp_path: Path) -> None:
    path, _ = written("rotary sensor", tmp_path)
    whole, part = Recording.read(path), Recording.read(path, until=20.0, drop="12.5:13.1")
    assert part.time[-1] <= 20.0 < whole.time[-1]
    assert not np.any((part.time >= 12.5) & (part.time <= 13.1))
    assert {note.split(":")[0] for note in part.notes if note.endswith("left out, as given")} == {"until", "drop"}
    for wrong in ("13:12", "x", (1.0,), 3.0):
        with pytest.raises(RecordingError, match="drop must be two times"):
            Recording.read(path, drop=wrong)  # type: ignore[arg-type]
    with pytest.raises(RecordingError, match="must leave at least 3 readings"):
        Recording.read(path, until=-1.0)


def test_parts_of_archives_are_named_and_chosen(tmp_path: Path) -> None:
    path, _ = written("phyphox gyroscope xlsx", tmp_path)
    with pytest.raises(RecordingError, match=r"there is no sheet 'x'; there are "):
        Recording.read(path, part="x")
    path, _ = written("rotary sensor", tmp_path)
    with pytest.raises(RecordingError, match="this is a file of text"):
        Recording.read(path, part="x")


TRK = """<?xml version="1.0" encoding="UTF-8"?>
<object class="org.opensourcephysics.cabrillo.tracker.TrackerPanel">{}</object>"""


@pytest.mark.parametrize(("inside", "problem"), [
    ("<broken>", "damaged or encrypted file .ParseError"), ("", "expected a point mass with numbers, found none"),
    ('<object class="org.PointMass"><property name="name" type="string">a</property></object>',
     "expected the time between frames"),
    ('<object class="org.PointMass"><property name="name">a</property></object>'
     '<object class="org.PointMass"><property name="name">b</property></object>', "found a, b; choose one by part="),
])
def test_a_tracker_project_without_a_track_is_refused(inside: str, problem: str, tmp_path: Path) -> None:
    (tmp_path / "bad.trk").write_text(TRK.format(inside))
    with pytest.raises(RecordingError, match=problem):
        Recording.read(tmp_path / "bad.trk")


def test_milliseconds_without_a_title_are_said_and_may_be_overridden(tmp_path: Path) -> None:
    path, _ = written("bare milliseconds", tmp_path)
    found = Recording.read(path)
    assert any(re.match(r"time: in ms, as a swing would last .* s in seconds", note) for note in found.notes)
    assert Recording.read(path, time_unit="s").time[-1] == pytest.approx(1e3 * found.time[-1])


GATE_FAULTS = {
    "t,angle\n0,1\n1,2\n2,1\n": "expected gate states, passages or periods",
    "Period (s)\n1.2\n": "expected at least 2 periods, found 1",
    "Time (s),GateState\n0,0\n1,1\n1.1,0\n": "expected at least 5 passages",
    "Amplitude (deg),Period (s)\n10,-1\n20,1\n": "periods must be above 0 s",
}


@pytest.mark.parametrize("text", GATE_FAULTS)
def test_files_that_are_no_gate_are_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "gate.csv").write_text(text)
    with pytest.raises(RecordingError, match=GATE_FAULTS[text]):
        measure_gate(tmp_path / "gate.csv")
