"""Test periods against lengths with closed forms, mpmath's elliptic integral, a shared file, and coverage of errors."""

from __future__ import annotations

import math
import os
from pathlib import Path

import mpmath
import numpy as np
import pytest
from command_line import Here

from pendulum_env.lab import RecordingError, measure_lengths
from pendulum_env.lab.lengths import is_lengths

GRAVITY = 9.81
LENGTH = np.array([0.20, 0.35, 0.50, 0.70, 0.90, 1.20])
DATA = os.environ.get("LAB_PENDULUM_DATA")


def periods(length: np.ndarray, degrees: float = 0.0, radius: float = 0.0) -> np.ndarray:
    """Return the periods of balls on strings, ``2 pi sqrt((L² + 2 a²/5)/(g L)) 2 K/pi``, in 40 digits."""
    with mpmath.workdps(40):
        longer = 2 * mpmath.ellipk(mpmath.sin(mpmath.radians(mpmath.mpf(degrees)) / 2) ** 2) / mpmath.pi
        return np.array([float(2 * mpmath.pi * mpmath.sqrt((one**2 + 0.4 * radius**2) / (GRAVITY * one)) * longer)
                         for one in length.tolist()])


def test_exact_periods_give_gravity_and_the_offset() -> None:
    """Lengths that were measured 12 mm too short, a ball of 3 cm radius, swings of 30 degrees."""
    times = periods(LENGTH, 30.0, 0.03)
    sheet = measure_lengths((LENGTH - 0.012, times), amplitude=math.radians(30.0), radius=0.03)
    assert sheet.gravity.value == pytest.approx(GRAVITY, rel=1e-9)
    assert sheet.offset.value == pytest.approx(0.012, rel=1e-6)
    assert "The lengths are too short by 11.99999" in sheet.text
    plain = measure_lengths((LENGTH, times), radius=0.03)
    assert plain.gravity.value == pytest.approx(GRAVITY / 1.0174088**2, rel=1e-5)  # the ratio of periods at 30 degrees
    small = measure_lengths((LENGTH, times), amplitude=math.radians(30.0))
    assert small.gravity.value != pytest.approx(GRAVITY, rel=1e-4)


def test_the_line_is_that_of_a_weighted_polynomial_fit() -> None:
    """NumPy's fit, with equal errors of all periods, and with an error of the length that is as large as theirs."""
    times = periods(LENGTH) + 0.01 * np.array([1, -1, 2, 0, -2, 1])
    found = measure_lengths((LENGTH, times), period_error=0.02)
    error = 2.0 * times * 0.02
    (slope, height), covariance = np.polyfit(LENGTH, times**2, 1, w=1.0 / error, cov="unscaled")
    assert found.gravity.value == pytest.approx(4.0 * math.pi**2 / slope, rel=1e-9)
    assert found.gravity.error == pytest.approx(found.gravity.value * math.sqrt(covariance[0, 0]) / slope, rel=1e-9)
    assert found.offset.value == pytest.approx(height / slope, rel=1e-9)
    slopes = np.array([-height / slope**2, 1.0 / slope])
    assert found.offset.error == pytest.approx(math.sqrt(slopes @ covariance @ slopes), rel=1e-9)
    both = measure_lengths((LENGTH, times), period_error=0.02, length_error=0.005)
    assert both.error == pytest.approx(np.hypot(error, both.line.slope * 0.005), rel=1e-6)


def test_a_students_table(tmp_path: Path, run_here: Here) -> None:
    """A table that a student handed in (coursehero.com, file p5dont6, table 4): 0.1 to 0.5 m, 20 vibrations twice. The
    slope by hand of their mean periods is 4.0 to 4.1 s²/m, so that g is 9.8 within its error; the lengths are short."""
    rows = [(0.10, 13.29), (0.10, 14.13), (0.20, 19.16), (0.20, 18.82), (0.30, 23.18), (0.30, 22.70), (0.40, 25.17),
            (0.40, 25.13), (0.50, 28.41), (0.50, 28.33)]
    (tmp_path / "t.csv").write_text("length (cm),20 T (s)\n" + "".join(f"{100 * a:g},{b}\n" for a, b in rows))
    code, printed, said = run_here("measure", "t.csv", "--out", "x")
    assert code == 0, said
    assert "Each time is that of 20 oscillations." in printed
    assert {path.name for path in (tmp_path / "x").iterdir()} == {"measured.csv", "lengths.csv", "lengths.png"}
    sheet = measure_lengths(tmp_path / "t.csv")
    length, period = (np.array(one) for one in zip(*rows, strict=True))
    slope, _ = np.polyfit(length, (period / 20.0) ** 2, 1)
    assert abs(sheet.gravity.value - 4.0 * math.pi**2 / slope) < sheet.gravity.error
    assert abs(sheet.gravity.value - 9.8) < 2.0 * sheet.gravity.error
    assert 0.05 < sheet.gravity.error < 0.6


@pytest.mark.skipif(not DATA, reason="LAB_PENDULUM_DATA names no folder of recordings")
def test_the_shared_table_gives_its_gravity() -> None:
    path = Path(str(DATA)) / "faults" / "period_against_length.csv"
    sheet = measure_lengths(path)
    assert abs(sheet.gravity.value - GRAVITY) < 2.0 * sheet.gravity.error
    assert abs(sheet.offset.value) < 2.0 * sheet.offset.error
    assert sheet.gravity.error < 0.1


def test_titles_say_units_numbers_and_errors(tmp_path: Path) -> None:
    times, path = periods(LENGTH, 20.0), tmp_path / "a.csv"
    first = measure_lengths((LENGTH, times), amplitude=math.radians(20.0), length_error=0.002, period_error=0.001)
    cells = [f"{100 * a},0.2,{t * 10},0.01,20\n" for a, t in zip(LENGTH, times, strict=True)]
    for head in ("L (cm),error (cm),10 T (s),error (s),amplitude (deg)",
                 "Länge [cm],Fehler,Zeit für 10 Schwingungen [s],Fehler,Amplitude [°]",
                 "length (cm),uncertainty,time of 10 oscillations (s),+-,amplitude (deg)"):
        path.write_text(f"{head}\n{''.join(cells)}", encoding="utf-8")
        assert is_lengths(path)
        sheet = measure_lengths(path)
        assert sheet.gravity.value == pytest.approx(first.gravity.value, rel=1e-12)
        assert sheet.error == pytest.approx(first.error, rel=1e-9)
    rows = "".join(f"{a};{25 * t}\n" for a, t in zip(LENGTH, times, strict=True))
    path.write_text("L (m);t (s)\n" + rows.replace(".", ","))
    assert measure_lengths(path, oscillations=25, amplitude=math.radians(20.0)).gravity.value == pytest.approx(GRAVITY)
    for head in ("L (m),t1 (s),t2 (s),t3 (s)", "L (m),10 T (s),10 T (s),10 T (s)", "L (m),t10 (s),T (s),T2 (s2)"):
        number = 1.0 if "t1 " in head else 10.0
        path.write_text(head + "\n" + "".join(f"{a},{number * t},{number * t},{number * t}\n" for a, t in zip(
            LENGTH, times, strict=True)))
        sheet = measure_lengths(path, amplitude=math.radians(20.0))
        assert len(sheet.length) == (6 if "T2" in head else 18)
        assert sheet.gravity.value == pytest.approx(GRAVITY)
    for head in ("time (s),angle (deg),length (m)", "amplitude (deg),period (s),x", "time (s),angle (deg),x"):
        path.write_text(f"{head}\n1,2,3\n4,5,6\n")
        assert not is_lengths(path)


@pytest.mark.parametrize(("text", "keywords", "said"), [
    ("length (m),T (s)\n0.2,0.9\n0.4,1.3\n", {}, "at least 3 different lengths, there are 2"),
    ("length (m),T (s)\n0.2,0.9\n0.2,1.3\n0.4,1.4\n", {}, "at least 3 different lengths, there are 2"),
    ("length (m),T (s)\n0.2,0.9\n0.4,x\n0.6,1.5\n", {}, "line 3: expected a number, found '0.4 x'"),
    ("length (m),T (s)\n0.2,0.9\n0.4,0\n0.6,1.5\n", {}, "periods must be from 0.001 to 10000 s, got 0"),
    ("length (m),T (s)\n0.2,0.9\n-0.4,1\n0.6,1.5\n", {}, "lengths must be from 0.001 to 10000 m, got -0.4"),
    ("length (m),T (s)\n0.2,1.9\n0.4,1\n0.6,0.5\n", {}, "T² does not grow with the length"),
    ("length (m),mass (g)\n0.2,0.9\n0.4,1\n0.6,1.5\n", {}, "expected a column with periods or times of several"),
    ("length (m),T (s)\n0.2,0.9\n0.4,1.3\n0.6,1.5\n", {"amplitude": 3.2}, "from 0 to below 180 degrees"),
    ("length (m),T (s)\n0.2,0.9\n0.4,1.3\n0.6,1.5\n", {"radius": 0.0}, "radius must be"),
])
def test_bad_tables_are_refused_in_one_sentence(
    text: str, keywords: dict[str, float], said: str, tmp_path: Path
) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(RecordingError) as found:
        measure_lengths(tmp_path / "a.csv", **keywords)
    assert said in " ".join(str(found.value).split())
    assert "\n" not in str(found.value)


def test_wrong_units_and_one_wrong_timing_are_named(tmp_path: Path) -> None:
    times, path = periods(LENGTH), tmp_path / "a.csv"
    path.write_text("length,T (s)\n" + "".join(f"{100 * a},{t}\n" for a, t in zip(LENGTH, times, strict=True)))
    assert "This g cannot be: the lengths are in cm, and the title must say so." in measure_lengths(path).text
    path.write_text("length (m),time (s)\n" + "".join(f"{a},{20 * t}\n" for a, t in zip(LENGTH, times, strict=True)))
    assert "the times are those of 20 oscillations" in measure_lengths(path).text
    path.write_text("length (m),T (s)\n" + "".join(f"{a},{3 * t}\n" for a, t in zip(LENGTH, times, strict=True)))
    assert "This g is 0.111 times 9.81 m/s²: name the units" in measure_lengths(path).text
    wrong = times * (1.0 + 0.05 * (np.arange(6) == 3)) + 1e-4 * np.array([1, -1, 1, 1, -1, 0])
    assert "The period at 0.7 m is farthest from the line" in measure_lengths((LENGTH, wrong)).text


def test_the_error_is_at_least_that_of_rounding(tmp_path: Path) -> None:
    """Times that lie on the line exactly are as good as their last digit, 0.1 s over sqrt(12)."""
    (tmp_path / "a.csv").write_text("length (m),10 T (s)\n0.1,10.0\n0.4,20.0\n0.9,30.0\n")
    sheet = measure_lengths(tmp_path / "a.csv")
    known = measure_lengths((np.array([0.1, 0.4, 0.9]), np.array([1.0, 2.0, 3.0])), period_error=0.01 / math.sqrt(12.0))
    assert sheet.gravity.error == pytest.approx(known.gravity.error, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(("number", "told", "low", "high"), [(6, False, 0.62, 0.75), (3, False, 0.62, 0.75),
                                                             (15, False, 0.62, 0.75), (6, True, 0.66, 0.82)])
def test_errors_hold_in_68_and_95_percent(number: int, told: bool, low: float, high: float) -> None:
    """400 tables: times of 10 periods by a stopwatch that errs by 0.1 s, lengths by a ruler that errs by 1 mm and by
    8 mm in common; the errors are known to the student ("told"), or follow from the scatter."""
    rng, inside, in95, offset = np.random.default_rng(number + told), 0, 0, 0
    errors = {"length_error": 0.001, "period_error": 0.01} if told else {}
    true = np.linspace(0.2, 1.2, number)
    exact = periods(true)
    for _ in range(400):
        table = (true - 0.008 + 0.001 * rng.standard_normal(number), exact + 0.01 * rng.standard_normal(number))
        sheet = measure_lengths(table, **errors)
        inside += abs(sheet.gravity.value - GRAVITY) < sheet.gravity.error
        offset += abs(sheet.offset.value - 0.008) < sheet.offset.error
        rows = {row[0]: row for row in sheet.numbers.rows}
        in95 += float(rows["gravity"][3]) < GRAVITY < float(rows["gravity"][4])
    assert low < inside / 400 < high
    assert low < offset / 400 < high
    assert 0.925 < in95 / 400 <= 1.0
