"""Panels show the right values at the right places, in any combination and at any size."""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import Any

import numpy as np
import pytest
from check_all import check_all
from lettering import inked, overlaps

from pendulum_env import SCENES
from pendulum_env.films import orbit
from pendulum_env.physics import exact
from pendulum_env.render import (
    PANELS,
    THEMES,
    Apparatus,
    FrameStyle,
    Orbits,
    PastSamples,
    View,
    bars,
    frame,
    side_by_side,
    stage,
)
from pendulum_env.render.curves import graph
from pendulum_env.render.layout import Box
from pendulum_env.render.palette import ENERGY_COLOURS, rgb
from pendulum_env.render.stage import Place
from pendulum_env.render.strip import WINDOW, round_up
from pendulum_env.render.text import mask

ROD = Apparatus(length=0.353, bob_radius=0.0107, suspension="rod", rod_radius=0.002, title="lab")
OMEGA = 5.0
SUBSETS = [names for count in range(1, 6) for names in itertools.combinations(PANELS, count)]
SIZES: list[Any] = [200, 260, 500, (900, 500), (500, 900), (200, 2000), (2000, 200), 2000]


def past(end: float = 12.0, dt: float = 0.02, amplitude: float = 0.8) -> PastSamples:
    """Return samples of a swing with losses that ends at the time ``end`` [s]."""
    time = np.arange(0.0, end, dt)
    angle, velocity = amplitude * np.cos(OMEGA * time), -amplitude * OMEGA * np.sin(OMEGA * time)
    heat = 0.02 * (1 - np.exp(-0.1 * time))
    return PastSamples(time, angle, velocity, 0.03 * np.sin(OMEGA * time) ** 2, 0.03 * np.cos(OMEGA * time) ** 2, heat,
                0.01 * np.sin(time), 1e-6 * np.sin(time))


CURVES = Orbits((np.array([[0.0, 1.0], [1.0, 0.0]]),), (np.array([[-3.0, 1.0], [3.0, 1.0]]),), velocity_reach=12.0)
BUSY = View(1234.56, -3.0, -88.88, 1.0, -0.888, 1e-9, 1e30, 0.5, -math.inf, (), "midpoint " * 6, 1.0, past=past(1234.5),
            curves=CURVES)

WORDY = Orbits((), (), 1.23e-7, 1.23e-12, periodic=False, notes=("orbit without losses and drives", "ideal orbit"))
TINY: dict[str, Any] = {"angle": 0.0, "velocity": 0.0, "past": None}


@pytest.mark.slow
def test_a_panel_is_one_entry_of_one_registry(monkeypatch: pytest.MonkeyPatch) -> None:
    """A new entry is accepted, gets an area, and is drawn there, without a line elsewhere."""
    mine = dataclasses.replace(PANELS["history"], what="a panel of one's own", room=(6.0, 3.0))
    monkeypatch.setattr(stage, "PANELS", {**PANELS, "mine": mine})
    stage.stage.cache_clear()
    alone, shown = (frame(ROD, BUSY, 500, FrameStyle("light", ("apparatus", *more))) for more in ((), ("mine",)))
    assert not np.array_equal(alone, shown)


@pytest.mark.slow
@pytest.mark.parametrize("size", [200, *(pytest.param(size, marks=pytest.mark.slow) for size in (500, (900, 500)))])
def test_texts_of_any_panels_neither_overlap_nor_leave_the_frame(size: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    for names in SUBSETS:
        view = BUSY if size == 500 else dataclasses.replace(BUSY, curves=WORDY, **TINY)
        texts = inked(monkeypatch, lambda names=names, view=view: frame(ROD, view, size, FrameStyle("light", names)))
        assert not overlaps(texts), names
        assert "t = 1234.56 s" in [text for text, *_ in texts]


@pytest.mark.quick("500")
@pytest.mark.parametrize("size", [280, 320, 500])
def test_bars_have_names_and_graphs_scales_beside_all_other_panels(size: int, monkeypatch: pytest.MonkeyPatch) -> None:
    texts = [text for text, *_ in inked(monkeypatch, lambda: frame(ROD, BUSY, size, FrameStyle("light", (*PANELS,))))]
    assert set(texts) >= set(ENERGY_COLOURS)
    assert sum(text.endswith("J") for text in texts) >= 2, texts


@pytest.mark.parametrize("size", range(14, 60, 5))
def test_a_degree_sign_is_a_ring(size: int) -> None:
    cover = mask("°", size)
    rows, columns = (np.flatnonzero(cover.max(axis=axis) > 0) for axis in (1, 0))
    ring = cover[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    assert ring.shape[0] == ring.shape[1] < 0.5 * size
    middle = ring.shape[0] // 2
    assert ring[middle, middle] < 60 < 100 < min(ring[0].max(), ring[-1].max(), ring[:, 0].max(), ring[:, -1].max())
    assert rows[0] == np.flatnonzero(mask("0", size).max(axis=1) > 127)[0]


@pytest.mark.quick("curves0-history")
@pytest.mark.parametrize("name", PANELS)
@pytest.mark.parametrize("curves", [CURVES, WORDY])
def test_texts_of_a_panel_of_any_area_neither_overlap_nor_leave_it(
    name: str, curves: Orbits, monkeypatch: pytest.MonkeyPatch
) -> None:
    view = dataclasses.replace(BUSY, curves=curves, **(TINY if curves is WORDY else {}))
    for wide, high in itertools.product((30, 60, 90, 120, 150, 200, 300), (10, 30, 35, 40, 45, 50, 60, 80, 120, 200)):
        area, image = Box(200, 200, 200 + wide, 200 + high), np.zeros((600, 800, 3), dtype=np.uint8)
        at = Place(area, 15, THEMES["light"], image.shape[:2], ROD, bars.rows(view), True, (name,))

        def draw(at: Place = at, image: Any = image) -> None:
            panel = PANELS[name].made(at)
            panel.still(image)
            panel.moving(image, view, rgb("#0072B2"))

        texts = inked(monkeypatch, draw)
        assert not overlaps(texts), area
        for text, left, top, right, bottom in texts:
            assert area.left - 1 <= left < right <= area.right + 1, (text, area)
            assert area.top - 5 <= top < bottom <= area.bottom + 5, (text, area)


@pytest.mark.slow
@pytest.mark.parametrize("size", SIZES)
def test_texts_of_any_panels_in_any_order_neither_overlap_nor_leave_the_frame(
    size: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    orders = [order for names in SUBSETS for order in itertools.permutations(names)]
    for names in orders if size == 260 else [*SUBSETS, *(names[::-1] for names in SUBSETS)]:
        texts = inked(monkeypatch, lambda names=names: frame(ROD, BUSY, size, FrameStyle("dark", names)))
        assert not overlaps(texts), names


def test_a_frame_is_a_fresh_contiguous_picture_of_its_size() -> None:
    def check(case: tuple[Any, tuple[str, ...], str]) -> None:
        size, names, theme = case
        width, height = size if isinstance(size, tuple) else (size, size)
        look = FrameStyle(theme, names)
        image = frame(ROD, BUSY, size, look)
        assert image.shape == (height, width, 3)
        assert image.dtype == np.uint8
        assert image.flags.c_contiguous
        assert image.flags.writeable
        assert image.base is None
        np.testing.assert_array_equal(image, frame(ROD, BUSY, size, look))

    check_all(itertools.product((50, 100, 130, 200, 333, (300, 700), (700, 300)), (
        ("apparatus",), ("phase",), ("residual", "history"), tuple(PANELS)), THEMES), check)


def test_the_order_of_names_is_that_of_the_panels(monkeypatch: pytest.MonkeyPatch) -> None:
    def tops(*names: str) -> dict[str, int]:
        texts = inked(monkeypatch, lambda: frame(ROD, BUSY, (400, 900), FrameStyle("light", names)))
        return {text.split(",")[0]: top for text, _, top, *_ in texts}

    above, below = tops("history", "residual"), tops("residual", "history")
    assert above["energy"] < above["residual"]
    assert below["energy"] > below["residual"]


def test_small_frames_leave_out_what_cannot_be_read_but_never_the_apparatus() -> None:
    alone, all_of_it = (frame(ROD, BUSY, 130, FrameStyle("light", names)) for names in (("apparatus",), tuple(PANELS)))
    hues = [rgb(ENERGY_COLOURS[name]) for name in ("potential", "residual")]
    assert not any((np.abs(all_of_it - hue).sum(axis=2) < 5).any() for hue in hues)
    assert (np.abs(all_of_it[20:] - rgb("#0072B2")).sum(axis=2) < 90).any()
    np.testing.assert_array_equal(frame(ROD, BUSY, 84, FrameStyle("light", tuple(PANELS))), frame(ROD, BUSY, 84))
    assert alone.shape == all_of_it.shape


# --- curves over time ------------------------------------------------------------------------------------------------


def line_of(image: Any, name: str) -> tuple[Any, Any]:
    """Return the columns with the hue of an energy in a picture, and the mean row of that hue in each."""
    rows, columns = np.nonzero(np.abs(image[110:].astype(float) - rgb(ENERGY_COLOURS[name])).sum(axis=2) < 12)
    where = np.unique(columns)
    return where, np.array([rows[columns == column].mean() + 0.5 for column in where])


def strip(name: str, values: Any, now: float, size: Any = (1400, 800), **more: Any) -> Any:
    """Draw a frame of the panel "history" or "residual" in which all but one energy are 0."""
    time = np.arange(0.0, 12.0, 0.02)
    zero, entry = np.zeros(len(time)), "residual" if name == "residual" else "kinetic"
    arrays = dict.fromkeys(("kinetic", "potential", "heat", "residual"), zero) | {entry: values(time)}
    view = View(12.0, 0.0, past=PastSamples(time, zero, zero, **arrays), **({"residual": 0.0} | {entry: now}), **more)
    return frame(ROD, view, size, FrameStyle("light", (name,)))


def test_a_strip_shows_the_last_ten_seconds_to_scale() -> None:
    """A ramp that begins 5 s before the shown instant begins in the middle of the plot and is straight."""
    rising, level = (strip("history", values, now, energy_scale=10.0) for values, now in (
        (lambda t: 2.0 + 0.6 * np.maximum(0.0, t - 7.0), 5.0), (lambda t: 0.0 * t + 5.0, 5.0)))
    columns, rows = line_of(level, "kinetic")
    assert np.ptp(rows[5:-9]) < 0.6
    left, right, half = columns[0], columns[-1], rows[20]
    columns, rows = line_of(rising, "kinetic")
    assert rows[columns > left + 0.98 * (right - left)].min() == pytest.approx(half, abs=4)
    within = (columns > left + 0.55 * (right - left)) & (columns < left + 0.95 * (right - left))
    line = np.polynomial.Polynomial.fit(columns[within], rows[within], 1)
    assert np.abs(line(columns[within]) - rows[within]).max() < 0.8
    base = rows[columns < left + 0.4 * (right - left)].mean()
    start = left + (right + 1 - left) * (7.0 - (12.0 - WINDOW)) / WINDOW
    assert line(start) == pytest.approx(base, abs=1.0)


def test_a_residuals_sign_is_seen() -> None:
    gained, lost = (line_of(strip("residual", lambda t, s=sign: 0.0 * t + s, sign), "residual")[1][9]
                    for sign in (0.8, -0.8))
    zero = line_of(strip("residual", lambda t: 0.0 * t, 0.0, residual_scale=1.0), "residual")[1][9]
    assert gained < zero - 50
    assert lost == pytest.approx(2 * zero - gained, abs=1.5)


def test_the_residuals_scale_is_a_round_number_that_holds_it(monkeypatch: pytest.MonkeyPatch) -> None:
    for largest, label in ((1.3e-6, "+2.00 µJ"), (0.4, "+500 mJ"), (5.0, "+5.00 J"), (0.0, "+1.00 J")):
        texts = inked(monkeypatch, lambda large=largest: strip("residual", lambda t: 0.0 * t - large, 0.0))
        assert label in [text for text, *_ in texts]
    for value in (1e-300, 3e-17, 0.02, 1.0, 1.01, 4.99, 1e300):
        assert value <= round_up(value) * (1 + 1e-9) <= 2.5 * value * (1 + 1e-9)


@pytest.mark.parametrize("width", [1.4, 2.0, 3.3])
def test_lines_are_equally_thick_in_every_direction(width: float) -> None:
    """The painted area over the length of a line is its width, for any slope and any position within the pixels."""
    for slope in (0.0, 0.13, 0.5, 1.0, 2.5):
        for shift in (0.0, 0.3, 0.77):
            image = np.full((300, 90, 3), 255, dtype=np.uint8)
            xs = np.array([-10.0, 100.0])
            graph(image, Box(0, 0, 90, 300), xs, 20.0 + shift + slope * (xs + 10.0), width, np.zeros(3, np.float32))
            ink = (255.0 - image[:, 20:70, 0]).sum() / 255.0
            assert ink == pytest.approx(50.0 * math.hypot(1.0, slope) * width, rel=0.03)


@pytest.mark.parametrize("values", [math.inf, -math.inf, 1e300, 1e-300])
@pytest.mark.parametrize("name", ["history", "residual"])
def test_any_energy_can_be_drawn(name: str, values: float) -> None:
    assert strip(name, lambda t: 0.0 * t + values, values, 300).any()


# --- the phase portrait ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("angle", "velocity"), [(1.0, 0.0), (3.0, 0.0), (0.3, -4.0), (0.0, 15.0), (1.0, -14.0)])
@pytest.mark.parametrize("kind", ["vacuum", "textbook"])
def test_the_exact_motion_stays_on_the_orbit(kind: str, angle: float, velocity: float) -> None:
    """Points of the exact motion lie on the orbit that the portrait draws, and points of the orbit on the motion."""
    scene = SCENES[kind]
    rates = scene.coefficients
    omega0 = math.sqrt(rates.get("gravity_rate", 0.0) or rates["spring_rate"])
    pendulum = kind == "vacuum"
    height = 1 - math.cos(angle) if pendulum else angle**2 / 2
    energy = scene.inertia * (velocity**2 / 2 + omega0**2 * height)
    curves = orbit.curves(scene, energy)
    times = np.linspace(0.0, 3.0, 200)
    moved = (exact.pendulum if pendulum else exact.linear)(times, angle, velocity, omega0)
    lines = np.vstack(curves.orbit)
    angles = np.asarray(moved[0])
    if pendulum:
        angles = (angles + math.pi) % (2 * math.pi) - math.pi
    starts, spans = lines[:-1], np.diff(lines, axis=0)
    for point in np.stack((angles, moved[1]), axis=1):
        along = np.clip(((point - starts) * spans).sum(axis=1) / np.maximum((spans**2).sum(axis=1), 1e-300), 0.0, 1.0)
        assert np.hypot(*(starts + along[:, None] * spans - point).T).min() < 2e-3 * curves.velocity_reach
    assert np.abs(lines[:, 0]).max() <= curves.angle_reach * (1 + 1e-12)
    assert np.abs(lines[:, 1]).max() < curves.velocity_reach
    assert bool(curves.separatrix) == curves.periodic == pendulum


def test_the_separatrix_is_the_orbit_of_the_energy_at_the_top() -> None:
    scene = SCENES["vacuum"]
    top = orbit.curves(scene, 2.0 * scene.inertia * scene.coefficients["gravity_rate"])
    for line, border in zip(top.orbit, top.separatrix, strict=True):
        np.testing.assert_allclose(line, border, atol=1e-6)
    assert not orbit.curves(scene, 0.0).orbit


def dot(angle: float, velocity: float, **more: Any) -> Any:
    """Return the centre (x, y) of the blue dot that marks the shown instant in a phase portrait."""
    image = frame(ROD, View(1.0, angle, velocity, curves=Orbits(velocity_reach=10.0), **more), (440, 500),
                  FrameStyle("light", ("phase",))).astype(float)
    weight = np.maximum(image[..., 2] - image[..., 0] - 60, 0)
    weight[:40] = 0
    rows, columns = np.indices(weight.shape) + 0.5
    return np.array([(columns * weight).sum(), (rows * weight).sum()]) / weight.sum()


def test_the_present_is_where_angle_and_velocity_put_it() -> None:
    middle, right, up = dot(0.0, 0.0), dot(1.5, 0.0), dot(0.0, 5.0)
    assert right[1] == pytest.approx(middle[1], abs=0.1)
    assert up[0] == pytest.approx(middle[0], abs=0.1)
    assert right[0] > middle[0]
    assert up[1] < middle[1]
    for angle, velocity in ((-0.7, 2.0), (2.9, -9.0), (1.5 + 2 * math.pi, 0.0)):
        turned = (angle + math.pi) % (2 * math.pi) - math.pi
        expected = middle + (right - middle) * turned / 1.5 + (up - middle) * velocity / 5.0
        assert np.abs(dot(angle, velocity) - expected).max() < 0.2


@pytest.mark.parametrize(("changes", "message"), [
    ({"angle": np.zeros(3)}, "of one length"), ({"time": np.array([0.0, math.nan])}, "the past's time must be finite"),
    ({"heat": np.zeros(5)}, "of one length")])
def test_a_bad_past_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        PastSamples(**{"time": np.zeros(2), "angle": np.zeros(2), "velocity": np.zeros(2), **changes})


@pytest.mark.parametrize(("arguments", "message"), [
    (("lihgt",), "a theme must be one of light, dark, not 'lihgt'; did you mean 'light'"),
    (("dark", ("aparatus",)), "a panel must be one of .*, not 'aparatus'; did you mean 'apparatus'"),
    (("dark", ()), "panels must be one or more of .*, not none"),
    (("dark", ("phase", "phase")), "not one of them twice"), (("dark", "phase"), "panels must be a sequence of names"),
    (("dark", (3,)), "a panel must be one of"), ((None,), "a theme must be one of")])
def test_a_look_that_cannot_be_is_refused(arguments: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        FrameStyle(*arguments)


def test_tiles_may_have_clocks_of_their_own(monkeypatch: pytest.MonkeyPatch) -> None:
    pairs = [(ROD, View(2.0, 0.1)), (ROD, View(1.0, 0.1))]
    texts = inked(monkeypatch, lambda: side_by_side(pairs, 300, look=FrameStyle("dark"), own_clocks=True))
    assert sorted(text for text, *_ in texts if text.startswith("t =")) == ["t = 1.00 s", "t = 2.00 s"]
