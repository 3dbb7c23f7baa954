"""Test the reversible pendulum with the periods of bodies put together in closed form, and with Kater's result."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from command_line import Here

from pendulum_env.lab import KaterSheet, RecordingError, measure_kater
from pendulum_env.lab.kater import bessel, is_kater

GRAVITY, EDGES = 9.81, 1.0


def periods(x: np.ndarray, fixed: float = 1.4) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the periods about both edges, and the distance of the centre of mass from the first, of a uniform rod of 1
    kg and 1.3 m with its middle between the edges, a weight of 1 kg at x, and a fixed one 10 cm beyond the second edge.
    """
    whole = 2.0 + fixed
    centre = (0.5 * EDGES + x + fixed * 1.1) / whole
    rod = 1.3**2 / 12.0 + 0.25 * EDGES**2
    first = (rod + x**2 + fixed * 1.1**2) / (whole * GRAVITY * centre)
    second = (rod + (EDGES - x) ** 2 + fixed * 0.1**2) / (whole * GRAVITY * (EDGES - centre))
    return 2.0 * math.pi * np.sqrt(first), 2.0 * math.pi * np.sqrt(second), centre


X = np.linspace(0.88, 1.0, 8)


def test_exact_periods_give_gravity() -> None:
    """The curves are cubics, which fit to 1e-5; swings of 5 degrees are 1 + A²/16 + 11 A⁴/3072 as long."""
    first, second, centre = periods(X)
    sheet = measure_kater((X, first, second), EDGES)
    assert sheet.gravity.value == pytest.approx(GRAVITY, rel=2e-5)
    assert sheet.period.value == pytest.approx(2.0 * math.pi * math.sqrt(EDGES / GRAVITY), rel=1e-5)
    size = math.radians(5.0)
    longer = 1.0 + size**2 / 16.0 + 11.0 * size**4 / 3072.0
    swung = measure_kater((X, longer * first, longer * second), EDGES, amplitude=size)
    assert swung.gravity.value == pytest.approx(sheet.gravity.value, rel=1e-8)
    assert bessel(first, second, EDGES, centre) == pytest.approx(GRAVITY, rel=1e-12)


def test_katers_seconds_pendulum_gives_the_gravity_of_london() -> None:
    """39.13929 inches between edges about which it beats seconds (T = 2 s), in vacuo at the level of the sea: Kater's
    corrected result, after 39.13860 in Phil. Trans. R. Soc. 108, 33 (1818). Gravity in London is 9.812 m/s²."""
    x = np.array([0.0, 0.01, 0.02])
    sheet = measure_kater((x, 2.0 + 0.1 * (x - 0.01), 2.0 - 0.3 * (x - 0.01)), 39.13929 * 0.0254)
    assert sheet.period.value == pytest.approx(2.0, rel=1e-12)
    assert sheet.crossings[0].value == pytest.approx(0.01)
    assert sheet.gravity.value == pytest.approx(9.812, abs=5e-4)


def test_errors_of_a_crossing_are_those_of_simulated_tables() -> None:
    """Two straight lines: the error of the period is that of many tables, and the edges' error adds to that of g."""
    rng, x, sigma = np.random.default_rng(2), np.linspace(0.0, 0.1, 6), 1e-3
    first, second = 2.0 + 0.5 * (x - 0.06), 2.0 - 1.0 * (x - 0.06)
    sheets = [measure_kater((x, first + sigma * rng.standard_normal(6), second + sigma * rng.standard_normal(6)), EDGES,
                            edges_error=1e-3, period_error=sigma) for _ in range(150)]
    lines = [one for one in sheets if "straight line" in one.how[0]]
    spread = float(np.std([one.period.value for one in lines]))
    assert spread == pytest.approx(min(one.period.error for one in lines), rel=0.2)
    one = lines[0]
    relative = math.hypot(2.0 * one.period.error / one.period.value, 1e-3)
    assert one.gravity.error == pytest.approx(one.gravity.value * relative, rel=1e-9)


def written(path: Path, x: np.ndarray, head: str, times: float = 1.0) -> Path:
    first, second, _ = periods(X)
    path.write_text(head + "\n" + "".join(f"{100.0 * a},{times * b},{times * c}\n" for a, b, c in zip(
        x, first, second, strict=True)))
    return path


@pytest.mark.slow
def test_titles_say_units_and_numbers(tmp_path: Path, run_here: Here) -> None:
    first, second, centre = periods(X)
    true = measure_kater((X, first, second), EDGES)
    for head, times in (("position (cm),T1 (s),T2 (s)", 1.0), ("x (cm),50 T1 (s),50 T_2 (s)", 50.0)):
        path = written(tmp_path / "k.csv", X, head, times)
        assert is_kater(path)
        assert measure_kater(path, EDGES).gravity.value == pytest.approx(true.gravity.value, rel=1e-9)
    code, printed, said = run_here("measure", "k.csv", "--length", "1", "--length-error", "0.001", "--out", "x")
    assert code == 0, said
    assert "With L = 1.0000 ± 0.0010 m between the knife edges, g = 9.8" in printed
    assert {one.name for one in (tmp_path / "x").iterdir()} == {"measured.csv", "kater.csv", "kater.png"}
    code, _, said = run_here("measure", "k.csv")
    assert code == 2
    assert "needs the distance between its knife edges; give --length" in said
    sheet = measure_kater(written(tmp_path / "b.csv", centre, "h1 (cm),T1 (s),T2 (s)"), EDGES, edges_error=1e-3)
    assert sheet.gravity.value == pytest.approx(GRAVITY, rel=1e-9)
    assert sheet.gravity.error == pytest.approx(GRAVITY * 1e-3, rel=0.3)  # of T1² = T2², it is exactly this share
    assert not sheet.crossings
    for text in ("time (s),angle (deg)\n1,2\n", "length (m),T (s)\n1,2\n"):
        path.write_text(text)
        assert not is_kater(path)


LINES = (np.array([0.0, 0.1, 0.2]), np.array([2.0, 2.1, 2.2]), np.array([2.2, 2.1, 2.0]))


@pytest.mark.parametrize(("table", "keywords", "said"), [
    ((LINES[0], LINES[1], LINES[1] + 0.1), {}, "T1 and T2 do not become equal between 0 and 0.2 m, T2 stays longer"),
    ((LINES[0][:2], LINES[1][:2], LINES[2][:2]), {}, "at least 3 different positions, there are 2"),
    ((LINES[0], LINES[1], -LINES[2]), {}, "periods must be from 0.001 to 10000 s"),
    ((LINES[0], LINES[1]), {}, "table must be a file, or positions and both periods"),
    ((LINES[0], LINES[1], LINES[2][:2]), {}, "finite arrays of one length"),
    (LINES, {"edges": 0.0}, "edges must be"), (LINES, {"edges_error": 2.0}, "edges_error must be below edges"),
    (LINES, {"period_error": 3.0}, "errors must be above 0 and below their values"),
])
def test_bad_tables_are_refused_in_one_sentence(
    table: tuple[np.ndarray, ...], keywords: dict[str, float], said: str
) -> None:
    with pytest.raises(RecordingError) as found:
        measure_kater(table, **{"edges": 1.0, **keywords})  # type: ignore[arg-type]
    assert said in str(found.value)
    assert "\n" not in str(found.value)


def test_two_crossings_agree_or_are_refused() -> None:
    """Equal periods with the centre of mass midway between the edges say nothing of gravity (Rossi & Zaninetti, Cent.
    Eur. J. Phys. 3, 636, 2005); here the second crossing has another period."""
    x = np.linspace(0.0, 1.0, 11)
    curve = 2.0 + 0.2 * (x - 0.5) ** 2
    agreed = measure_kater((x, curve, curve + 0.5 * (x - 0.3) * (x - 0.7)), EDGES)
    assert [one.value for one in agreed.crossings] == pytest.approx([0.3, 0.7])
    assert agreed.period.value == pytest.approx(2.008, rel=1e-9)
    tilted = curve + 0.3 * x
    with pytest.raises(RecordingError, match=r"equal at 0\.3 m and 0\.7 m, with different periods; leave out the rows"):
        measure_kater((x, tilted, tilted + 0.5 * (x - 0.3) * (x - 0.7)), EDGES)


def pull(sheet: KaterSheet) -> tuple[bool, bool]:
    row = {row[0]: row for row in sheet.numbers.rows}["gravity"]
    return abs(sheet.gravity.value - GRAVITY) < sheet.gravity.error, float(row[3]) < GRAVITY < float(row[4])


@pytest.mark.slow
@pytest.mark.parametrize("told", [False, True])
@pytest.mark.parametrize("way", ["crossing", "Bessel"])
def test_errors_hold_in_68_and_95_percent(way: str, told: bool, tmp_path: Path) -> None:
    """300 tables of 8 positions, times of 50 periods by a stopwatch that errs by 0.05 s."""
    rng, seen = np.random.default_rng(told), []
    first, second, centre = periods(X)
    for _ in range(300):
        times = [50.0 * one + 0.05 * rng.standard_normal(8) for one in (first, second)]
        at, head = (X, "x (m)") if way == "crossing" else (centre, "h1 (m)")
        path = tmp_path / "k.csv"
        path.write_text(f"{head},50 T1 (s),50 T2 (s)\n" + "".join(f"{a!r},{b!r},{c!r}\n" for a, b, c in zip(
            at.tolist(), *(one.tolist() for one in times), strict=True)))
        seen.append(pull(measure_kater(path, EDGES, period_error=0.001 if told else None)))
    inside, in95 = (float(np.mean(one)) for one in zip(*seen, strict=True))
    assert 0.6 < inside < (0.8 if told else 0.76)
    assert in95 > 0.92
