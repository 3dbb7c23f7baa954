"""Test tracks of a filmed bob: fitted circles against exact points and scipy's minimum, angles against the truth."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pendulum_env.lab import Recording, RecordingError, fit_circle, track_angle

TIME = np.arange(0.0, 20.0, 1 / 30)
SWING = math.radians(40.0) * np.exp(-0.02 * TIME) * np.cos(4.0 * TIME) + 0.05
PIVOT, RADIUS = (312.0, 95.0), 240.0


def track(
    angle: Any = SWING, *, down: bool = True, noise: float = 0.0, seed: int = 0
) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Return x and y [px] of a bob about PIVOT, in an image whose y axis points down or up."""
    rng = np.random.default_rng(seed)
    side = RADIUS * np.cos(angle) * (1 if down else -1)
    x, y = PIVOT[0] + RADIUS * np.sin(angle), PIVOT[1] + side
    return x + noise * rng.standard_normal(len(x)), y + noise * rng.standard_normal(len(x))


def film(path: Path, header: str, *columns: Any, separator: str = ",") -> Path:
    path.write_text(header + "".join(separator.join(f"{value:.10g}" for value in row) + "\n"
                                     for row in zip(*columns, strict=True)))
    return path


@pytest.mark.parametrize("arc", [5.0, 40.0, 170.0, 360.0])
def test_a_circle_through_its_points_is_found(arc: float) -> None:
    x, y = track(np.radians(arc) * np.linspace(-0.5, 0.5, 50))
    found = fit_circle(x, y)
    assert (found.x, found.y, found.radius) == pytest.approx((*PIVOT, RADIUS), rel=1e-7)
    assert found.rms < 1e-8


@pytest.mark.quick("80.0")
@pytest.mark.parametrize("arc", [25.0, 80.0, 200.0])
def test_the_circle_lies_within_its_error_and_is_the_nearest(arc: float) -> None:
    """Over 200 noisy tracks, the centre is off by its standard error along the less certain axis, and no other circle
    is nearer."""
    pulls, bias = [], []
    for seed in range(200):
        x, y = track(np.radians(arc / 2) * np.cos(TIME[:300]), noise=0.7, seed=seed)
        found = fit_circle(x, y)
        pulls.append((found.y - PIVOT[1]) / found.error)
        bias.append(found.radius / RADIUS - 1)

    def distances(a: float, b: float) -> float:
        away = np.hypot(x - a, y - b)
        return float(away.std())

    best = distances(found.x, found.y)
    assert best == pytest.approx(found.rms, rel=1e-9)
    for a, b in ((1e-3, 0.0), (-1e-3, 0.0), (0.0, 1e-3), (0.0, -1e-3)):
        assert distances(found.x + a, found.y + b) > best
    assert 0.85 < math.sqrt(np.mean(np.square(pulls))) < 1.15
    assert abs(np.mean(bias)) < 3 * np.std(bias) / math.sqrt(200) + 5e-4


@pytest.mark.parametrize("down", [True, False])
@pytest.mark.parametrize("amplitude", [2.0, 40.0, 120.0, 172.0])
def test_the_angle_is_from_straight_down_whichever_way_y_points(down: bool, amplitude: float) -> None:
    """Simulate a bob with v² proportional to cos(angle) - cos(amplitude), as under gravity, released at the side."""
    from scipy.special import ellipj, ellipk

    k = math.sin(math.radians(amplitude) / 2)
    angle = 2 * np.arcsin(k * ellipj(3.0 * TIME + ellipk(k * k), k * k)[0])
    x, y = track(angle, down=down, noise=0.01)
    found, notes = track_angle(x, y)
    error = 2e-3 if amplitude < 10 else 1e-3
    np.testing.assert_allclose(found, angle, atol=error)
    assert f"y axis: points {'down' if down else 'up'}, inferred: the bob hangs below the pivot" in notes


def test_pivot_and_axis_are_told() -> None:
    x, y = track()
    found, notes = track_angle(x, y, pivot=PIVOT)
    np.testing.assert_allclose(found, SWING, atol=1e-14)
    assert notes[0] == "pivot: (312, 95), as given"
    over, notes = track_angle(x, y, pivot=PIVOT, y_axis="up")
    np.testing.assert_allclose(np.abs(over), math.pi - np.abs(SWING), atol=1e-14)
    assert "y axis: points up, as given" in notes


X, Y = track()
FILMS: dict[str, tuple[str, tuple[Any, ...], dict[str, Any]]] = {
    "t, x, y": ("t,x,y\n", (TIME, X, Y), {}),
    "Tracker": ("mass A,,\nt,x,y\n", (TIME, X, Y), {}),
    "units": ("Time (s),x (px),y (px)\n", (TIME, X, Y), {}),
    "x first": ("x,y,t\n", (X, Y, TIME), {}),
    "further columns": ("t,x,y,r\n", (TIME, X, Y, Y), {}),
    "told": ("", (TIME, X, Y), {"columns": "xy"}),
    "told by number": ("", (Y, TIME, X), {"columns": (2, 3, 1)}),
    "told by name": ("clock,right,below\n", (TIME, X, Y), {"columns": ("clock", "right", "below")}),
    "frames": ("frame,x,y\n", (np.arange(len(TIME)), X, Y), {"rate": 30}),
    "no time": ("x,y\n", (X, Y), {"rate": 30}),
    "no time or names": ("", (X, Y), {"rate": 30, "columns": "xy"}),
}


@pytest.mark.parametrize("form", FILMS)
@pytest.mark.parametrize("separator", [",", "\t", ";"])
def test_films_are_read(tmp_path: Path, form: str, separator: str) -> None:
    header, columns, options = FILMS[form]
    path = film(tmp_path / "film.csv", header.replace(",", separator), *columns, separator=separator)
    found = Recording.read(path, **options)
    np.testing.assert_allclose(found.time, TIME, atol=1e-9)
    np.testing.assert_allclose(found.angle, SWING, atol=1e-8)
    assert any(note.startswith("pivot: (312, 95) ±") for note in found.notes)
    assert any(note.startswith("columns: ") for note in found.notes)


def test_an_angle_in_the_file_is_preferred_to_its_track(tmp_path: Path) -> None:
    path = film(tmp_path / "film.csv", "t,x,y,theta (rad)\n", TIME, X, Y, SWING)
    found = Recording.read(path)
    np.testing.assert_allclose(found.angle, SWING, atol=1e-9)
    assert "columns: 1 (t), 4 (theta (rad)), as the header names them" in found.notes


def test_a_bob_that_goes_over_the_top_is_followed(tmp_path: Path) -> None:
    turning = 4.0 * TIME + 0.8 * np.sin(4.0 * TIME)
    found = Recording.read(film(tmp_path / "film.csv", "t,x,y\n", TIME, *track(turning)))
    np.testing.assert_allclose(found.angle, turning, atol=1e-6)
    assert found.angle[-1] > 70


def test_a_gap_at_the_top_tears_no_track(tmp_path: Path) -> None:
    rising = 2.0 + 0.08 * TIME
    keep = np.abs(rising - math.pi) > 0.2
    path = film(tmp_path / "film.csv", "t,x,y\n", TIME[keep], *(values[keep] for values in track(rising)))
    found = Recording.read(path, pivot=PIVOT, y_axis="down")
    np.testing.assert_allclose(found.angle, rising[keep], atol=1e-9)
    assert "turns: unknown across 1 gap, the smallest number is assumed" in found.notes


BAD: dict[str, tuple[Any, Any, dict[str, Any], str]] = {
    "a line": (TIME, 2 * TIME, {}, "lie on a line or in one place"),
    "one place": (0 * TIME, 0 * TIME, {}, "lie on a line or in one place"),
    "short arc": (*track(SWING / 100, noise=0.5), {}, "too short to find its pivot .*give pivot=.x, y."),
    "pivot on the track": (X, Y, {"pivot": (X[3], Y[3])}, "must not pass through the pivot"),
    "pivot of one number": (X, Y, {"pivot": 3.0}, r"pivot must be \(x, y\), two numbers .* got 3.0"),
    "pivot of text": (X, Y, {"pivot": "ab"}, r"pivot must be \(x, y\), two numbers .* got 'ab'"),
    "pivot nowhere": (X, Y, {"pivot": (0.0, math.nan)}, "pivot must be"),
    "unknown axis": (X, Y, {"y_axis": "left"}, "y_axis must be 'up' or 'down', got 'left'"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_track_that_shows_no_angle_is_refused(tmp_path: Path, case: str) -> None:
    x, y, options, message = BAD[case]
    with pytest.raises(RecordingError, match=message):
        Recording.read(film(tmp_path / "film.csv", "t,x,y\n", TIME, x, y), **options)
    with pytest.raises(RecordingError, match=message):
        track_angle(x, y, **options)


def test_a_pivot_belongs_to_a_track(tmp_path: Path) -> None:
    path = film(tmp_path / "swing.csv", "", TIME, SWING)
    with pytest.raises(RecordingError, match="y_axis is for x-y tracks; columns='xy' reads one"):
        Recording.read(path, y_axis="up")
    with pytest.raises(RecordingError, match="a pivot is for x-y tracks; columns='xy' reads one"):
        Recording.read(path, pivot=(0, 0))
    with pytest.raises(RecordingError, match=r"expected three columns, t, x and y .* found 2"):
        Recording.read(path, columns="xy")
