"""Frames draw pendulum, trail, torque and energy bars at the right places and to scale."""

from __future__ import annotations

import dataclasses
import itertools
import json
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from check_all import check_all

from pendulum_env.render import (
    METHOD_COLOURS,
    Apparatus,
    FrameStyle,
    PastSamples,
    View,
    bars,
    colour,
    frame,
    panel,
    side_by_side,
    stage,
    stand,
    strip,
)
from pendulum_env.render import text as lettering
from pendulum_env.render.paint import bar, stroke
from pendulum_env.render.palette import ENERGY_COLOURS, OKABE_ITO, gradient, rgb

ROOT = Path(__file__).resolve().parents[2]
WIRE = Apparatus(length=0.353, bob_radius=0.0107, suspension="wire", rod_radius=0.0002, title="exercise")
ROD = Apparatus(length=0.353, bob_radius=0.0107, suspension="rod", rod_radius=0.002, title="lab")
SWING = View(12.34, 0.7, -1.2, 0.6, 0.031, 0.012, 0.004, 0.001, -0.002, (-0.4, -0.1, 0.2, 0.5), "rk4", 0.05)
SIZES = [120, 150, 200, 228, 251, 333, 500, 1000, 2000, (300, 700), (900, 500), (200, 2000), (2000, 200)]


def near(image, hexadecimal, reach=40):
    """Return rows and columns of the pixels within a distance of a colour."""
    return np.nonzero(np.abs(image.astype(int) - rgb(hexadecimal)).sum(axis=2) < reach)


def bob_at(angle, size=500, apparatus=WIRE):
    """Return the centroid (x, y) of the blue pixels in a frame with no other hue."""
    image = frame(apparatus, View(0.0, angle), size).astype(float)
    weight = np.maximum(image[..., 2] - image[..., 0] - 20, 0)
    rows, columns = np.indices(weight.shape) + 0.5
    return np.array([(columns * weight).sum(), (rows * weight).sum()]) / weight.sum()


def test_a_frame_is_a_fresh_contiguous_picture():
    def check(case):
        apparatus, size = case
        width, height = size if isinstance(size, tuple) else (size, size)
        image = frame(apparatus, SWING, size)
        assert image.shape == (height, width, 3)
        assert image.dtype == np.uint8
        assert image.flags.c_contiguous
        assert image.flags.writeable
        assert image.base is None

    check_all(itertools.product((WIRE, ROD), (50, 84, *SIZES)), check)


def test_equal_input_gives_equal_pixels_and_drawing_leaves_no_trace():
    first = frame(ROD, SWING)
    kept = first.copy()
    other = frame(ROD, View(1.0, -2.0, residual=0.5, work=0.0))
    other[:] = 0
    both = side_by_side([(ROD, SWING), (WIRE, SWING)], 200)
    beside = both.copy()
    both[:] = 0
    np.testing.assert_array_equal(side_by_side([(ROD, SWING), (WIRE, SWING)], 200), beside)
    again = frame(ROD, SWING)
    np.testing.assert_array_equal(again, kept)
    np.testing.assert_array_equal(first, kept)
    assert again is not first


@pytest.mark.parametrize("size", [200, 500, (900, 500), (300, 700)])
def test_the_bob_is_where_geometry_puts_it(size):
    down, right, up, left = (bob_at(k * math.pi / 2, size) for k in range(4))
    centre = (down + right + up + left) / 4
    arm = (down[1] - up[1]) / 2
    assert right[0] - left[0] == pytest.approx(2 * arm, abs=0.3)
    for angle in (-3.0, -2.2, -0.5, 0.1, 0.8, 1.9, 2.7, 7.0):
        expected = centre + arm * np.array([math.sin(angle), math.cos(angle)])
        assert np.abs(bob_at(angle, size) - expected).max() < 0.3
    width, height = size if isinstance(size, tuple) else (size, size)
    room = arm * (1 + WIRE.bob_radius / WIRE.length)
    assert room < min(centre[0], width - centre[0], centre[1], height - centre[1])


def test_the_bob_moves_by_fractions_of_a_pixel():
    angles = np.linspace(0.0, 0.02, 17)
    xs = np.array([bob_at(angle)[0] for angle in angles])
    line = np.polynomial.Polynomial.fit(angles, xs, 1)
    assert 2 < xs[-1] - xs[0] < 5
    assert np.abs(xs - line(angles)).max() < 0.03


def test_the_bob_is_drawn_to_scale():
    apparatus = Apparatus(length=1.0, bob_radius=0.12)
    image = frame(apparatus, View(0.0, 1.0), 800).astype(int)
    area = (image[..., 2] - image[..., 0] > 20).sum()
    arm = (bob_at(0.0, 800, apparatus)[1] - bob_at(math.pi, 800, apparatus)[1]) / 2
    assert area == pytest.approx(math.pi * (0.12 * arm) ** 2, rel=0.04)


def test_edges_are_antialiased():
    """A slanted wire covers an equal area in every row of pixels."""
    end = round(bob_at(0.3)[1]) - 12
    rows = frame(WIRE, View(0.0, 0.3))[end - 20:end].astype(float)
    rows[:, :100] = 255  # the stand
    ink = (255 - rows).sum(axis=(1, 2))
    assert ink.min() > 0
    assert np.ptp(ink) < 0.05 * ink.mean()


@pytest.mark.parametrize("ends", [(8.2, 3.1, 21.7, 30.4), (3.1, 8.2, 30.4, 21.7), (-4.0, 9.0, 50.0, 12.5)])
@pytest.mark.parametrize("colour", [rgb("#D55E00"), gradient("#000000", "#FFFFFF")])
def test_a_line_is_the_same_in_a_part_of_an_image_and_in_a_mirrored_one(ends, colour):
    whole = np.random.default_rng(0).integers(0, 256, (60, 70, 3)).astype(np.uint8)
    before, part = whole.copy(), (slice(7, 47), slice(9, 44))
    alone, mirrored = whole[part].copy(), whole[part].swapaxes(0, 1).copy()
    x0, y0, x1, y1 = ends
    stroke(alone, *ends, 3.4, colour)
    stroke(mirrored, y0, x0, y1, x1, 3.4, colour)
    stroke(whole[part], *ends, 3.4, colour)
    assert (alone != before[part]).any()
    np.testing.assert_array_equal(mirrored.swapaxes(0, 1), alone)
    np.testing.assert_array_equal(whole[part], alone)
    whole[part] = before[part]
    np.testing.assert_array_equal(whole, before)


def test_a_rod_is_thicker_than_a_wire():
    dark = [(frame(apparatus, View(0.0, 0.6)) < 230).all(axis=2).sum() for apparatus in (WIRE, ROD)]
    assert dark[1] > dark[0] + 150


def test_the_torque_arrow_turns_with_the_torque_and_grows_with_it():
    plain = frame(ROD, View(0.0, 0.0))
    np.testing.assert_array_equal(plain, frame(ROD, View(0.0, 0.0, torque_share=0.0)))
    changed = {}
    for share in (-1.0, -0.4, 0.4, 1.0):
        where = np.nonzero((frame(ROD, View(0.0, 0.0, torque_share=share)) != plain).any(axis=2))
        changed[share] = len(where[0])
        assert np.sign(where[1].mean() - bob_at(0.0, apparatus=ROD)[0]) == np.sign(share)
    assert changed[1.0] > 1.5 * changed[0.4]
    assert changed[-1.0] == pytest.approx(changed[1.0], rel=0.05)


@pytest.mark.quick("3.0-1.0")
@pytest.mark.parametrize(("start", "share"), [(0.0, 1.0), (2.0, -0.3), (3.0, 1.0), (-3.0, -1.0), (7.0, 0.3)])
def test_the_torque_arrow_begins_at_the_rod_and_its_tip_is_where_its_size_puts_it(start, share):
    """The arrow of the largest torque spans 120 degrees, and its area does not depend on where it begins."""
    at = Apparatus(length=0.353, bob_radius=0.0107, suspension="wire")
    plain, drawn = (frame(at, View(0.0, start, torque_share=part), 900).astype(int) for part in (None, share))
    x, y = (bob_at(0.0, 900, at) + bob_at(math.pi, 900, at)) / 2
    rows, columns = np.nonzero(np.abs(drawn - plain).sum(axis=2) > 150)
    turned = (np.arctan2(columns + 0.5 - x, rows + 0.5 - y) - start) * np.sign(share)
    turned = np.degrees((turned + 1.0) % (2 * math.pi) - 1.0)
    assert turned.min() > -1.0
    assert turned.max() == pytest.approx(120 * abs(share), abs=1.5)
    middle = drawn[rows, columns][(turned > 4) & (turned < 20 * abs(share))]
    assert (np.abs(middle - rgb(OKABE_ITO["bluish_green"])).sum(axis=1) < 3).mean() > 0.7


def test_a_trail_over_the_top_is_seen_on_both_sides():
    over = tuple(np.linspace(2.6, 3.6, 21))
    for turns in (0, -1, 3):
        path = tuple(angle + 2 * math.pi * turns for angle in over)
        plain, traced = (frame(WIRE, View(0.0, path[-1], trail=trail)) for trail in ((), path))
        columns = np.nonzero((plain != traced).any(axis=2))[1] - bob_at(math.pi)[0]
        assert columns.min() < -60
        assert columns.max() > 50


def test_the_trail_fades_with_age():
    path = tuple(np.linspace(-1.0, 1.0, 21))
    plain = frame(WIRE, View(0.0, 1.0)).astype(int)
    traced = frame(WIRE, View(0.0, 1.0, trail=path)).astype(int)
    strength = []
    for angle in (-0.9, -0.5, 0.0, 0.5, 0.8):
        x, y = bob_at(angle).astype(int)
        strength.append(np.abs(traced - plain)[y, x].sum())
    assert strength == sorted(strength)
    assert strength[0] < 0.3 * strength[-1]


@pytest.mark.parametrize("trail", [(0.0,), (0.5, 0.5, 0.5), (0.0, 40.0, -1e6, 1e9), tuple(range(300))])
def test_any_finite_trail_can_be_drawn(trail):
    assert frame(WIRE, View(0.0, 0.5, trail=trail), 200).any()


def energies(**changes):
    values = {"kinetic": 0.0, "potential": 0.0, "heat": 0.0, "residual": 0.0, "energy_scale": 1.0} | changes
    return frame(WIRE, View(0.0, 0.0, **values))


@pytest.mark.parametrize("name", ["kinetic", "potential", "heat", "work", "residual"])
def test_a_bar_is_as_long_as_its_energy(name):
    lengths = []
    for value in (0.25, 0.5, 1.0):
        rows, columns = near(energies(**{name: value}), ENERGY_COLOURS[name], 5)
        lengths.append(np.ptp(columns[rows == rows.min()]) + 1)
    assert lengths[:2] == pytest.approx([lengths[2] / 4, lengths[2] / 2], abs=1)
    assert lengths[2] > 100


@pytest.mark.parametrize("huge", [3.0, 1e12, 1e300, math.inf])
def test_an_energy_beyond_the_axis_is_capped_with_an_arrow_head(huge):
    tone = ENERGY_COLOURS["kinetic"]
    beyond = []
    for value in (1.0, huge):
        image = energies(kinetic=value)
        rows, columns = near(image, tone)
        end, thick = columns.max(), np.ptp(rows) + 1
        ahead = image[rows.min():rows.max() + 1, end + 2:end + 2 + thick // 2]
        beyond.append((end, len(near(ahead, "#222222")[0])))
    (full, plain), (capped, headed) = beyond
    assert full < capped < 500
    assert plain == 0
    assert headed > 8


def test_a_negative_residual_is_hollow_and_left_of_zero():
    tone = ENERGY_COLOURS["residual"]
    gained, lost = (near(energies(residual=value), tone) for value in (0.2, -0.2))
    assert lost[1].max() <= gained[1].min()
    assert len(lost[0]) < 0.7 * len(gained[0])


@pytest.mark.parametrize("values", [(-0.23, -0.49), (-0.5, -1.0)])
def test_negative_energies_up_to_the_scale_have_bars_of_their_own_lengths(values):
    tone = ENERGY_COLOURS["residual"]
    short, long = (np.ptp(near(energies(residual=value), tone, 5)[1]) + 1 for value in values)
    assert long / short == pytest.approx(values[1] / values[0], rel=0.05)


def past_of(size: float, residual: float) -> View:
    """Return a view at 10 s of a swing of ``size`` degrees, with a constant residual [J]."""
    time = np.linspace(0.0, 10.0, 501)
    angle, level = np.radians(size) * np.cos(5.0 * time), np.full(501, residual)
    zero = 0.0 * time
    past = PastSamples(time[:-1], *(values[:-1] for values in (angle, zero, zero, zero, zero, zero, level)))
    return View(10.0, float(angle[-1]), residual=residual, past=past, energy_scale=1.0)


def test_residuals_side_by_side_share_one_scale(monkeypatch):
    panels = [(WIRE, past_of(5.0, residual)) for residual in (0.2, 1e-8)]
    look = FrameStyle("light", ("apparatus", "energy", "residual"))
    texts = [box[0] for box in lettered(monkeypatch, lambda: side_by_side(panels, 360, look=look))]
    assert texts.count("+200 mJ") == 2
    assert "10.0 nJ" in texts
    assert strip.shared_scale([view for _, view in panels]) == 0.2
    assert strip.shared_scale([past_of(5.0, 1e6), past_of(5.0, 1e-8)]) == 1.0
    alone = [box[0] for box in lettered(monkeypatch, lambda: frame(*panels[1], 360, look))]
    assert "+10.0 nJ" in alone


def test_the_empty_tile_shows_the_angles_of_all(monkeypatch):
    """In a film of five, a swing of 5 degrees takes a third of the height of the sixth tile or more."""
    panels = [(WIRE, past_of(size, 0.0)) for size in (5.0, 5.0, 5.0, 4.0, 60.0)]
    texts = [box[0] for box in lettered(monkeypatch, lambda: side_by_side(panels, 300))]
    assert {"angle, last 10 s", "15°", "0°"} <= set(texts)
    image = side_by_side(panels, 300)
    tile = image[-300:, 600:]
    rows, _ = near(tile, METHOD_COLOURS[2], 30)
    assert np.ptp(rows) > 60
    full = [box[0] for box in lettered(monkeypatch, lambda: side_by_side(panels[:4], 300))]
    assert "angle, last 10 s" not in full
    assert side_by_side(panels, 300, strip=10.0).shape == image.shape
    apart = [box[0] for box in lettered(monkeypatch, lambda: side_by_side(panels, 300, own_clocks=True))]
    assert "angle, last 10 s" not in apart


@pytest.mark.parametrize("count", [2, 3, 4])
def test_the_strip_below_shows_the_angles_of_all(monkeypatch, count):
    """In a film of 2 to 4, swings of 5 to 2 degrees have 65 to 25 px of the strip's 120 px."""
    panels = [(WIRE, past_of(5.0 - i, 0.0)) for i in range(count)]
    texts = [box[0] for box in lettered(monkeypatch, lambda: side_by_side(panels, 300, strip=10.0))]
    assert texts.count("angle, last 10 s") == 1
    assert "5°" in texts
    image, plain = side_by_side(panels, 300, strip=10.0), side_by_side(panels, 300)
    assert len(image) == len(plain) + 120
    np.testing.assert_array_equal(image[:len(plain)], plain)
    for i in range(count):
        rows, _ = near(image[len(plain):], METHOD_COLOURS[i], 30)
        assert np.ptp(rows) > 13 * (5 - i)
    without = [(WIRE, View(0.0, 0.1)) for _ in range(count)]
    assert len(side_by_side(without, 300, strip=10.0)) == len(plain)


def test_the_strip_of_angles_grows_from_the_left_and_then_moves_on():
    """At 2 s of 10 s the curve takes the first fifth of the plot; in a strip of 2 s it takes the whole, as after 10 s.
    """
    def columns(time, span):
        times = np.linspace(0.0, time, 201)
        angle = np.radians(20.0) * np.cos(5.0 * times)
        view = View(time, float(angle[-1]), past=PastSamples(times[:-1], angle[:-1], 0.0 * times[:-1]))
        image = side_by_side([(WIRE, view)] * 2, 300, strip=span)
        return near(image[-120:], METHOD_COLOURS[1], 60)[1]

    whole = columns(10.0, 10.0)
    assert np.ptp(columns(2.0, 10.0)) == pytest.approx(np.ptp(whole) / 5.0, rel=0.05)
    assert abs(columns(2.0, 10.0).min() - whole.min()) < 3
    for time, span in ((2.0, 2.0), (15.0, 10.0)):
        assert np.ptp(columns(time, span)) == pytest.approx(np.ptp(whole), rel=0.02)


@pytest.mark.parametrize(("size", "swing"), [
    (200, 0.0), (333, math.radians(30.0)), (500, math.radians(5.0)), ((300, 700), math.radians(30.0)),
    ((900, 500), math.radians(5.0)),
])
def test_a_small_swing_is_drawn_with_true_angles_and_a_longer_pendulum(size, swing):
    """The bob's path in pixels is an arc of the angle itself, longer than in the full circle and inside the picture."""
    large = dataclasses.replace(WIRE, swing=swing)
    low, right, left = (bob_at(angle, size, large) for angle in (0.0, swing, -swing))
    plain = np.ptp([bob_at(angle, size)[1] for angle in (0.0, math.pi)]) / 2
    view = View(0.0, 0.0)
    at = panel.staged(large, view, panel.frame_size(size, "size"), FrameStyle()).panels[0]
    assert at.arm > 1.3 * plain
    assert right - low == pytest.approx([at.arm * math.sin(swing), at.arm * (math.cos(swing) - 1.0)], abs=0.6)
    assert left - low == pytest.approx([-at.arm * math.sin(swing), at.arm * (math.cos(swing) - 1.0)], abs=0.6)
    assert at.bob == pytest.approx(max(2.5, at.arm * WIRE.bob_radius / WIRE.length))
    assert at.body.top < at.y
    assert at.y + at.arm + at.bob < at.body.bottom
    assert at.x + at.arm * math.sin(swing) + at.bob < at.body.right


@pytest.mark.parametrize("size", [200, 333, 500, (300, 700), (900, 500)])
def test_the_degree_scale_of_a_small_swing_stays_inside_its_panel(monkeypatch, size):
    large, look = dataclasses.replace(WIRE, swing=0.3), FrameStyle("light", ("apparatus", "energy", "phase"))
    boxes = lettered(monkeypatch, lambda: frame(large, View(0.0, 0.1, residual=0.0), size, look))
    at = panel.staged(large, View(0.0, 0.1, residual=0.0), panel.frame_size(size, "size"), look).panels[0]
    scale = [box for box in boxes if box[0] in (f"{lettering.MINUS}10°", "0°", "10°", "30°", f"{lettering.MINUS}30°")]
    assert "0°" in [box[0] for box in scale]
    for _, left, top, right, bottom in scale:
        assert at.body.left <= left < right <= at.body.right
        assert at.body.top <= top < bottom <= at.body.bottom
    blank = np.full((*reversed(panel.frame_size(size, "size")), 3), 255, np.uint8)
    at.still(blank)
    outside = np.ones(blank.shape[:2], bool)
    outside[round(at.body.top):round(at.body.bottom), round(at.body.left):round(at.body.right)] = False
    assert (blank[outside] == 255).all()


def test_bars_appear_only_when_asked_for():
    view = View(0.0, 0.0, kinetic=1.0)
    assert bars.rows(view) == ()
    assert bars.rows(View(0.0, 0.0, residual=0.0)) == ("kinetic", "potential", "heat", "residual")
    assert bars.rows(View(0.0, 0.0, residual=0.0, work=0.0)) == (
        "kinetic", "potential", "heat", "work", "residual")
    assert not len(near(frame(WIRE, view), ENERGY_COLOURS["kinetic"])[0])


@pytest.mark.parametrize(("value", "text"), [
    (0.0, "0 J"), (1.0, "1.00 J"), (0.0123456, "12.3 mJ"), (0.9996, "1.00 J"), (-2.5e-7, "-250 nJ"),
    (999.6, "1.00 kJ"), (3e200, "3e200 J"), (4.2e-18, "4.20 aJ"), (4.2e-21, "4e-21 J"),
    (math.inf, "inf J"), (-math.inf, "-inf J"),
])
def test_energies_are_written_with_three_digits(value, text):
    assert bars.joules(value) == text.replace("-", "\N{MINUS SIGN}")


def lettered(monkeypatch, draw):
    """Return the boxes of all texts that a drawing function writes, as (text, left, top, right, bottom)."""
    boxes = []

    def spy(image, text, x, y, size, tone, anchor=(0.0, 0.5), paper="#FFFFFF"):
        wide, high = lettering.measure(text, size)
        left, top = round(x - anchor[0] * wide), round(y - anchor[1] * high)
        boxes.append((text, left, top, left + wide, top + high))
        assert left >= 0
        assert top >= 0
        assert left + wide <= image.shape[1]
        assert top + high <= image.shape[0]

    for module in (panel, stand, bars, strip):
        monkeypatch.setattr(module, "write", spy)
    stage.stage.cache_clear()
    draw()
    stage.stage.cache_clear()
    return [box for box in boxes if box[0]]


@pytest.mark.quick("200", "500", "size10")
@pytest.mark.parametrize("size", SIZES)
def test_texts_neither_overlap_nor_leave_the_frame(monkeypatch, size):
    view = View(1234.56, -3.0, -88.88, 1.0, -0.888, 1e-9, 1e30, 0.5, -math.inf, (), "midpoint " * 6, 1.0)
    boxes = lettered(monkeypatch, lambda: frame(ROD, view, size))
    assert len(boxes) >= (7 if min(frame(ROD, view, size).shape[:2]) < 200 else 11)
    for (a, *one), (b, *two) in itertools.combinations(boxes, 2):
        shared_x = min(one[2], two[2]) - max(one[0], two[0])
        shared_y = min(one[3], two[3]) - max(one[1], two[1])
        assert shared_x <= 0 or shared_y <= 0.3 * min(one[3] - one[1], two[3] - two[1]), (a, b)


@pytest.mark.quick("300", "500")
@pytest.mark.parametrize("size", [300, 500, 1000, 2000])
def test_the_scale_is_labelled_with_zero_at_the_bottom(monkeypatch, size):
    boxes = {box[0]: box for box in lettered(monkeypatch, lambda: frame(ROD, View(0.0, 0.0), size))}
    at = {text: (left + right, top + bottom) for text, left, top, right, bottom in boxes.values()}
    labels = [f"{degrees}°".replace("-", "\N{MINUS SIGN}") for degrees in range(-150, 181, 30)]
    assert set(labels) <= set(at)
    assert at["90°"][0] > at["0°"][0] > at["\N{MINUS SIGN}90°"][0]
    assert at["0°"][1] > at["30°"][1] > at["90°"][1] > at["180°"][1]


def test_small_frames_show_the_pendulum_alone(monkeypatch):
    assert not lettered(monkeypatch, lambda: frame(ROD, SWING, 84))


@pytest.mark.parametrize("count", range(1, 10))
def test_panels_fill_a_grid_under_one_clock(monkeypatch, count):
    panels = [(WIRE, View(2.5, 0.1, residual=0.0, caption=f"method {index}")) for index in range(count)]
    image = side_by_side(panels, (240, 220))
    rows, columns = image.shape[0] // 220, image.shape[1] // 240
    assert 0 <= rows * columns - count < max(rows, 2)
    assert columns >= rows
    texts = [box[0] for box in lettered(monkeypatch, lambda: side_by_side(panels, (240, 220)))]
    assert texts.count("t = 2.50 s") == 1
    assert texts.count("exercise") == 1
    assert [text for text in texts if text.startswith("method")] == [f"method {i}" for i in range(count)]
    cells = image[image.shape[0] - rows * 220:]
    for index in range(count):
        cell = cells[index // columns * 220:, index % columns * 240:][:220, :240]
        assert len(near(cell, colour(index))[0]) > 40
    assert side_by_side(panels, 150, columns=count).shape[1] == 150 * count


def test_a_stopped_panel_says_so_and_may_lag_behind(monkeypatch):
    panels = [(WIRE, View(2.0, 0.1)), (WIRE, View(1.0, 0.1, stopped=True))]
    texts = [box[0] for box in lettered(monkeypatch, lambda: side_by_side(panels, 300))]
    assert "t = 2.00 s" in texts
    assert "stopped at 1.00 s" in texts
    with pytest.raises(ValueError, match=r"1\.0 s beside one at 2\.0 s must be marked stopped"):
        side_by_side([(WIRE, View(2.0, 0.1)), (WIRE, View(1.0, 0.1))])


def test_colours_are_those_of_okabe_and_ito():
    published = {(0, 114, 178), (213, 94, 0), (0, 158, 115), (204, 121, 167), (230, 159, 0), (86, 180, 233),
                 (240, 228, 66), (0, 0, 0)}
    assert {tuple(rgb(tone).astype(int).tolist()) for tone in OKABE_ITO.values()} == published
    assert set(METHOD_COLOURS) == set(OKABE_ITO.values())
    assert len(METHOD_COLOURS) == len(published)
    assert [colour(index) for index in range(8)] == list(METHOD_COLOURS)
    for turn in range(1, 8):
        shared = [colour(8 * turn + place) for place in range(8)]
        assert sorted(shared) == sorted(METHOD_COLOURS)
        assert all(tone != first for tone, first in zip(shared, METHOD_COLOURS, strict=True))


@pytest.mark.parametrize(("size", "error"), [
    (49, ValueError), (0, ValueError), (-5, ValueError), ((500, 20), ValueError), ((1, 2, 3), ValueError),
    (10**6, ValueError), (True, ValueError), (500.0, TypeError), ("500", TypeError), (None, TypeError),
])
def test_a_bad_size_is_refused(size, error):
    with pytest.raises(error, match="size must be"):
        frame(WIRE, SWING, size)
    with pytest.raises(error, match="panel_size must be"):
        side_by_side([(WIRE, SWING)], size)


@pytest.mark.parametrize(("changes", "message"), [
    ({"angle": math.nan}, "angle must be finite, not nan"),
    ({"time": math.inf}, "time must be finite, not inf"),
    ({"velocity": math.nan}, "velocity must be finite"),
    ({"trail": (0.0, math.nan)}, "trail must be finite"),
    ({"trail": (math.inf, -math.inf)}, "trail must be finite"),
    ({"pivot": (0.0, -math.inf)}, "pivot must be finite"),
    ({"trail": (0.0,), "trail_pivots": ((0.0, math.nan),)}, "pivot must be finite"),
    ({"trail": (0.0,), "trail_pivots": ((0.0, 0.0), (0.0, 0.0))}, "trail_pivots must be empty or one for each angle"),
    ({"torque_share": 1.5}, "torque_share must be None or within -1 to 1, not 1.5"),
    ({"torque_share": math.nan}, "torque_share"),
    ({"heat": math.nan}, "heat must be a number of joules, not nan"),
    ({"energy_scale": 0.0}, "energy_scale must be None or finite and above 0 J"),
    ({"accent": "blue"}, "a colour is a string like"),
])
def test_a_bad_view_is_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        View(**{"time": 0.0, "angle": 0.0, **changes})


@pytest.mark.parametrize(("changes", "message"), [
    ({"length": 0.0}, "length must be a finite number above 0 m"),
    ({"bob_radius": math.nan}, "bob_radius"),
    ({"rod_radius": -1.0}, "rod_radius must be a finite number at least 0 m"),
    ({"suspension": "rope"}, "suspension must be one of rod, wire, not 'rope'"),
    ({"swing": 1.6}, "swing must be None or from 0 to below pi / 2"),
    ({"swing": -0.1}, "swing must be None or from 0 to below pi / 2"),
    ({"swing": 0.1, "sway": (0.0, 0.1)}, "swing must be None .* with a sway"),
])
def test_a_bad_apparatus_is_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        Apparatus(**{"length": 1.0, "bob_radius": 0.1, **changes})


@pytest.mark.parametrize("columns", [0, -1, 1.5, True])
def test_bad_columns_and_no_panels_are_refused(columns):
    with pytest.raises(ValueError, match="columns must be None or a whole number above 0"):
        side_by_side([(WIRE, SWING)], columns=columns)
    with pytest.raises(ValueError, match="at least one"):
        side_by_side([])


def test_fonts_survive_somebody_quitting_pygame():
    import pygame

    before = frame(WIRE, SWING, 300)
    pygame.quit()
    lettering.piece.cache_clear()
    np.testing.assert_array_equal(frame(WIRE, SWING, 300), before)
    pygame.font.quit()
    pygame.font.init()
    lettering.piece.cache_clear()
    np.testing.assert_array_equal(frame(WIRE, SWING, 300), before)


def test_a_view_of_large_numbers_is_not_refused():
    assert View(1e308, 1e308, -1e308, trail=(1e308, 1.5e308)).time == 1e308


@pytest.mark.parametrize(("under", "colour"), [(0, 255), (255, 0), (100, 180)])
@pytest.mark.parametrize(("overhang", "changed"), [(1 / 513, False), (0.5, True)])
def test_an_end_of_a_bar_that_nobody_sees_is_not_painted(under, colour, overhang, changed):
    """A share of 1 / 512 of a pixel changes it by less than half a step of 255."""
    image, tone = np.full((6, 20, 3), under, np.uint8), np.full(3, colour, np.float32)
    bar(image, 8.0 - overhang, 1, 12.0 + overhang, 5, tone)
    assert (image[1:5, 8:12] == colour).all()
    assert (image[1:5, [7, 12]] != under).all() == changed
    image[1:5, 7:13] = under
    assert (image == under).all()


@pytest.mark.slow
def test_frames_need_no_display_and_the_import_no_pygame():
    script = """
import sys
import pendulum_env.render as render
assert not {"pygame", "PIL", "imageio_ffmpeg", "moviepy", "matplotlib"} & set(sys.modules)
view = render.View(1.0, 0.5, residual=0.1, torque_share=0.3, trail=(0.1, 0.2), caption="rk4")
image = render.frame(render.Apparatus(1.0, 0.1), view)
import pygame
assert not pygame.display.get_init()
assert pygame.display.get_surface() is None
print(int(image.sum()))
"""
    kept = ("PATH", "SYSTEMROOT", "LD_LIBRARY_PATH")
    clean = {name: os.environ[name] for name in kept if name in os.environ}
    done = subprocess.run([sys.executable, "-c", script], env=clean | {"PYTHONPATH": str(ROOT)},
                          capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    view = View(1.0, 0.5, residual=0.1, torque_share=0.3, trail=(0.1, 0.2), caption="rk4")
    assert json.loads(done.stdout) == int(frame(Apparatus(1.0, 0.1), view).sum())
