"""Test headers that name rates, sample numbers, rates of change or units of other quantities: read correctly or
refused."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pendulum_env.lab import Recording, RecordingError

TIME = np.arange(0.0, 20.0, 0.05)
DEGREES = np.round(40.0 * np.exp(-0.02 * TIME) * np.cos(4.0 * TIME), 3)
OTHER = np.gradient(DEGREES, TIME)


def table(header: str, *columns: Any, mark: str = ",") -> str:
    return header + "\n".join(mark.join(f"{x:.10g}" for x in row) for row in zip(*columns, strict=True)) + "\n"


def read(folder: Path, text: str, **options: Any) -> Recording:
    path = folder / "swing.txt"
    path.write_text(text, encoding="utf-8")
    return Recording.read(path, **options)


@pytest.mark.parametrize(
    ("header", "rate"),
    [
        ("rate: 0.5 kHz", 500.0),
        ("Sample Rate (run 2): 20 Hz", 20.0),
        ("rate: 2e1", 20.0),
        ("rate: 1,000 Hz", 1000.0),
        ("Abtastrate: 20,5 Hz", 20.5),
        ("at 20,5 Hz", 20.5),
        ("Baud rate 9600, sample rate 20 Hz", 20.0),
        ("sampling frequency [Hz]: 50", 50.0),
        ("100 samples per second", 100.0),
        ("a film of 240 fps", 240.0),
        ("sampling rate 1 kS/s", 1000.0),
        ("trigger 5 Hz, rate 20 Hz", 20.0),
        ("baud_rate, sample_rate\n9600, 20", 20.0),
        ("start_deg, sample_rate_kHz\n40, 0.02", 20.0),
    ],
)
def test_the_rate_in_other_words(tmp_path: Path, header: str, rate: float) -> None:
    found = read(tmp_path, table(f"{header}\n", DEGREES))
    np.testing.assert_allclose(found.time, np.arange(len(TIME)) / rate, rtol=1e-14)


@pytest.mark.parametrize("header", ["sample rate [ms]: 50", "rate: 50 ms", "Baud rate: 9600", "baud_rate, n\n9600, 4"])
def test_what_is_no_rate(tmp_path: Path, header: str) -> None:
    with pytest.raises(RecordingError, match="expected times, or a rate in the header, found neither"):
        read(tmp_path, table(f"{header}\n", DEGREES))


@pytest.mark.parametrize("name", ["theta_dot", "thetadot", "dtheta", "angular rate (deg)", "θ̇", "angle (1/s)"])
def test_a_rate_of_change_is_no_angle(tmp_path: Path, name: str) -> None:
    found = read(tmp_path, table(f"t,{name},theta (deg)\n", TIME, OTHER, DEGREES))
    np.testing.assert_allclose(np.degrees(found.angle), DEGREES, atol=1e-9)
    sentence = re.escape(f"expected an angle, the header names {name!r}; column 1 (t) begins with")
    with pytest.raises(RecordingError, match=sentence):
        read(tmp_path, table(f"t,{name}\n", TIME, OTHER))
    with pytest.raises(RecordingError, match="is a rate of change: choose it by columns='time=1,rate"):
        read(tmp_path, table(f"t,{name}\n", TIME, OTHER), columns=(1, 2))
    found = read(tmp_path, table(f"t,{name}\n", TIME, DEGREES), columns="time=1,angle=2", unit="deg")
    np.testing.assert_allclose(np.degrees(found.angle), DEGREES, atol=1e-9)


def test_a_slash_before_seconds_is_no_rate_of_change(tmp_path: Path) -> None:
    found = read(tmp_path, table("n;t / s;φ / °\n", np.arange(len(TIME)), TIME, DEGREES, mark=";"))
    np.testing.assert_allclose(found.time, TIME, atol=1e-9)
    np.testing.assert_allclose(np.degrees(found.angle), DEGREES, atol=1e-9)


def test_two_tracks_are_not_an_angle(tmp_path: Path) -> None:
    x, y = np.sin(np.radians(DEGREES)), -np.cos(np.radians(DEGREES))
    text = table("t,xA,yA,xB,yB\n".replace("A", " A").replace("B", " B"), TIME, x, y, x, y)
    with pytest.raises(RecordingError, match=r"expected an angle, or one track, the header names several columns x"):
        read(tmp_path, text)
    np.testing.assert_allclose(np.degrees(read(tmp_path, text, columns=(1, 4, 5)).angle), DEGREES, atol=1e-6)


def test_axes_of_a_gyroscope_are_no_track(tmp_path: Path) -> None:
    axes = (f"Gyroscope {axis} (rad/s)" for axis in "xyz")
    found = read(tmp_path, table(f"Time (s),{','.join(axes)}\n", TIME, 0.01 * DEGREES, 0.1 * DEGREES, 0.0 * DEGREES))
    assert found.rate is not None
    np.testing.assert_allclose(np.abs(found.rate), math.sqrt(0.0101) * np.abs(DEGREES), atol=1e-3)
    assert any(note.startswith("axis: the direction of the largest swing, 0.100 Gyro") for note in found.notes)


@pytest.mark.parametrize("names", ["frame,x,y", "frame,angle (deg)", "sample,theta"])
def test_counts_are_no_times(tmp_path: Path, names: str) -> None:
    x, y = np.sin(np.radians(DEGREES)), -np.cos(np.radians(DEGREES))
    columns = (np.arange(len(TIME)), *((x, y) if "x" in names else (DEGREES,)))
    text, first = table(f"{names}\n", *columns), names.split(",")[0]
    with pytest.raises(RecordingError, match=re.escape(f"expected times, the header names {first!r} (give rate=, the")):
        read(tmp_path, text)
    found = read(tmp_path, text, rate=20)
    np.testing.assert_allclose(found.time, TIME, atol=1e-9)
    np.testing.assert_allclose(np.degrees(found.angle), DEGREES, atol=1e-4)


@pytest.mark.parametrize("name", ["Angle (mrad)", "Angle (rev)", "turns", "Winkel (gon)", "Counts", "Potential (V)"])
def test_another_unit_is_not_taken_for_an_angle(tmp_path: Path, name: str) -> None:
    text = table(f"Time (s),{name}\n", TIME, DEGREES)
    with pytest.raises(RecordingError, match=re.escape(f"in degrees or radians, the header names {name!r}")):
        read(tmp_path, text)
    found = read(tmp_path, text, unit="rad", scale=0.001)
    np.testing.assert_allclose(found.angle, DEGREES / 1000, rtol=1e-12)


@pytest.mark.parametrize("header", ["counts_per_rev, sample_rate\n1200, 20\n",
                                    "# encoder counts at 20 Hz\nrate 20 Hz, counts\n"])
def test_counts_of_an_encoder_are_no_degrees(tmp_path: Path, header: str) -> None:
    text = header + "".join(f"{count:.0f}\n" for count in DEGREES * 1200 / 360)
    with pytest.raises(RecordingError, match="expected an angle in degrees or radians, the header names"):
        read(tmp_path, text)
    found = read(tmp_path, text, unit="deg", scale=360 / 1200)
    np.testing.assert_allclose(np.degrees(found.angle), DEGREES, atol=0.16)
    assert found.time[1] == pytest.approx(0.05)


@pytest.mark.parametrize("between", [" ", "   "])
def test_titles_with_units_over_columns_of_white_space(tmp_path: Path, between: str) -> None:
    header = between.join(("Time (s)", "Velocity (deg/s)", "Angle (deg)")) + "\n"
    found = read(tmp_path, table(header, TIME, OTHER, DEGREES, mark="  "))
    np.testing.assert_allclose(np.degrees(found.angle), DEGREES, atol=1e-9)


def test_a_title_with_another_separator_names_no_column(tmp_path: Path) -> None:
    found = read(tmp_path, table("Angle, Run 1\nTime (s)\tAngle (deg)\n", TIME, DEGREES, mark="\t"))
    np.testing.assert_allclose(found.time, TIME, atol=1e-9)


LONG = {
    "Vernier's text": "Vernier Format 2\nswing.cmbl 3/14/2025 10:01:11 .\nRun 1\n"
                      "Time\tVelocity\tAngle\nt\tω\tθ\ns\tdeg/s\tdeg\n\n",
    "a protocol": "Date: 2025-03-14\nStudent: A, B\nSensor: rotary\n\nTime (s)\tVelocity (deg/s)\tAngle (deg)\n",
}


@pytest.mark.parametrize("case", LONG)
def test_headers_of_several_lines(tmp_path: Path, case: str) -> None:
    found = read(tmp_path, table(LONG[case], TIME, OTHER, DEGREES, mark="\t"))
    np.testing.assert_allclose(found.time, TIME, atol=1e-9)
    np.testing.assert_allclose(np.degrees(found.angle), DEGREES, atol=1e-9)
    assert "unit: deg, as the header says" in found.notes


def test_empty_fields_at_the_end_of_a_line_are_missing_values(tmp_path: Path) -> None:
    """Fields are empty before a tracker sees the bob, and at the end of the shorter of two runs side by side."""
    x, y = np.sin(np.radians(DEGREES)), -np.cos(np.radians(DEGREES))
    lines = table("t\tx\ty\n", TIME, x, y, mark="\t").splitlines(keepends=True)
    found = read(tmp_path, "".join([lines[0], "0\t\t\n", "0.05\t1\t\n", *lines[3:]]))
    np.testing.assert_allclose(found.time, TIME[2:], atol=1e-9)
    runs = [f"{line.strip()},{line.strip() if i < 100 else ','}\n" for i, line in
            enumerate(table("", TIME, DEGREES).splitlines())]
    second = read(tmp_path, "".join(["t,a,t,a\n", *runs]), columns=(3, 4), unit="deg")
    np.testing.assert_allclose(second.time, TIME[:100], atol=1e-9)
    assert any(note.startswith("dropped: 300 lines without a finite time") for note in second.notes)
