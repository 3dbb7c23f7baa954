"""Loops over pixels: compiled and interpreted they paint the same, what the formulas say, and nothing outside."""

from __future__ import annotations

import math
import os
import random
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pendulum_env.engine import kernels
from pendulum_env.render import Apparatus, View, frame, paint, pixels
from pendulum_env.render.curves import fading, graph
from pendulum_env.render.layout import Box
from pendulum_env.render.palette import gradient, rgb
from pendulum_env.render.stand import HEAD, Ring

HIGH, WIDE = 47, 61
COLOUR, WHITE = rgb("#D55E00"), np.full(3, 200, np.float32)
WIDTHS = (0.4, 1.0, 2.6, 9.0)


def paper(seed: int) -> Any:
    """An image of random colours."""
    return np.random.default_rng(seed).integers(0, 256, (HIGH, WIDE, 3)).astype(np.uint8)


def black(high: int = HIGH, wide: int = WIDE) -> Any:
    return np.zeros((high, wide, 3), np.uint8)


def shapes(image: Any, seed: int) -> None:
    """Paint one of each shape into an image, at random places in it and beside it."""
    r = random.Random(seed)

    def place() -> tuple[float, float]:
        """A place near the image or, in one of ten times, far away."""
        if r.random() < 0.1:
            return r.choice((-1e30, -1e5, 20.0, 1e19)), r.choice((-1e30, 10.0, 1e5, 1e30))
        return r.uniform(-30, WIDE + 30), r.uniform(-30, HIGH + 30)

    paint.stroke(image, *place(), *place(), r.choice(WIDTHS), r.choice((COLOUR, gradient("#123456", "#FFEEDD"))))
    paint.ball(image, *place(), r.choice((2.5, 7.3, 30.0)), COLOUR)
    paint.disc(image, *place(), r.choice((2.5, 7.3, 30.0)), COLOUR, r.random())
    for wide in (r.uniform(0, WIDE), 0.3):
        left, top = r.uniform(-20, WIDE + 9), r.randrange(-9, HIGH)
        paint.bar(image, left, top, left + wide, top + r.randrange(20), COLOUR)
    if r.random() < 0.1:
        paint.bar(image, r.choice((-math.inf, -1e30, 3.2)), 2, r.choice((math.inf, 1e19, 1e30, 5.7)), 4, COLOUR)
    middle = r.uniform(-30, WIDE + 30), r.uniform(-30, HIGH + 30)
    ring = Ring(*middle, r.uniform(3, 40), r.uniform(1, 5), image.shape[:2], 9.0)
    ring.trail(image, [r.uniform(-9, 9) for _ in range(r.randint(2, 9))], 0.6, COLOUR)
    ring.arrow(image, r.uniform(-9, 9), r.uniform(-2, 2), 0.3, COLOUR)
    path = np.array([(*place(), r.choice((r.random(), math.nan))) for _ in range(8)])
    fading(image, path, r.choice(WIDTHS), COLOUR)
    (left, top), (right, bottom) = place(), place()
    xs = np.sort([place()[0] for _ in range(6)])
    graph(image, Box(left, top, right, bottom), xs, np.array([place()[1] for _ in xs]), r.choice(WIDTHS), COLOUR,
          r.choice((0.0, 1.2)), r.choice((None, rgb("#123456"))))


@pytest.fixture
def by_python(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Any]:
    """A function that calls another one with loops that Python runs."""
    def call(function: Callable[..., Any], *given: Any) -> Any:
        with monkeypatch.context() as patch:
            patch.setenv(kernels.VARIABLE, "python")
            assert paint.loops().line is pixels.line
            return function(*given)

    return call


def test_compiled_and_interpreted_loops_paint_the_same(
    by_python: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Interpreted loops also find an index that is too large, as Python checks it."""
    def painted() -> list[Any]:
        images = [paper(seed) for seed in range(20)]
        for seed, image in enumerate(images):
            shapes(image, seed)
        return images

    monkeypatch.setenv(kernels.VARIABLE, "compiled")  # which has no patience
    one, two = painted(), by_python(painted)
    for seed, (compiled, plain) in enumerate(zip(one, two, strict=True)):
        np.testing.assert_array_equal(compiled, plain, err_msg=str(seed))
    assert sum((image != paper(seed)).any() for seed, image in enumerate(one)) > 17


def test_the_shapes_call_every_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    called = set()
    for name, loop in vars(paint.loops()).items():
        def noted(*given: Any, name: str = name, loop: Any = loop) -> Any:
            called.add(name)
            return loop(*given)

        monkeypatch.setattr(paint.loops(), name, noted)
    for seed in range(9):
        shapes(paper(seed), seed)
    assert called == set(pixels.__all__)


def test_a_frame_is_the_same_where_python_runs_the_loops(by_python: Callable[..., Any]) -> None:
    view = View(1.0, 0.7, -1.2, 0.6, 0.03, 0.01, 0.004, 0.001, -0.002, (-0.4, -0.1, 0.2, 0.5), "rk4", 0.05)
    apparatus = Apparatus(0.353, 0.0107, "rod", 0.002)
    np.testing.assert_array_equal(frame(apparatus, view, 200), by_python(frame, apparatus, view, 200))


@pytest.mark.slow
def test_no_index_is_out_of_bounds(tmp_path: Path) -> None:
    """numba checks the indices of loops that it compiles with NUMBA_BOUNDSCHECK."""
    code = ("import sys; sys.path.insert(0, sys.argv[1]); import test_pixels as t\n"
            "for seed in range(200): t.shapes(t.paper(seed), seed)")
    settings = {"NUMBA_BOUNDSCHECK": "1", "LAB_PENDULUM_CACHE": str(tmp_path), kernels.VARIABLE: "compiled"}
    run = subprocess.run([sys.executable, "-c", code, str(Path(__file__).parent)], env={**os.environ, **settings},
                         capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    assert len(list(tmp_path.glob("pixels_*.nbc"))) >= len(pixels.__all__)


@pytest.mark.parametrize("angles", [
    (0.0, math.nan, 1.0), (math.nan, math.nan), (0.0, math.inf), (-math.inf, math.inf), (1e308, 1.7e308), (0.0, 1e16),
])
def test_a_trail_without_places_is_not_painted(angles: tuple[float, ...], by_python: Callable[..., Any]) -> None:
    def painted() -> Any:
        image = black()
        Ring(20.0, 20.0, 10.0, 3.0, (HIGH, WIDE)).trail(image, angles, 0.5, COLOUR)
        return image

    assert not painted().any()
    assert not by_python(painted).any()


@pytest.mark.parametrize("start", [math.nan, math.inf, -1e16, 1.7e308])
def test_an_arrow_without_a_place_is_not_painted(start: float) -> None:
    image = black()
    Ring(20.0, 20.0, 10.0, 3.0, (HIGH, WIDE)).arrow(image, start, 0.5, 0.1, COLOUR)
    assert not image.any()


def test_unknown_values_of_a_graph_are_left_out(by_python: Callable[..., Any]) -> None:
    def painted() -> Any:
        image = black()
        xs = np.arange(0.0, WIDE, 5.0)
        graph(image, Box(0, 0, WIDE, HIGH), xs, np.where((xs > 18) & (xs < 22), math.nan, 15.2), 2.0, WHITE)
        return image

    image = painted()
    np.testing.assert_array_equal(image, by_python(painted))
    shown = image[..., 0].sum(axis=0) / 200
    assert not shown[17:23].any()
    np.testing.assert_allclose(shown[[5, 10, 30, 50]], 2.0, atol=0.02)


@pytest.mark.parametrize("radius", [2.5, 7.3, 15.0])
def test_a_ball_covers_its_area(radius: float) -> None:
    image = np.full((HIGH, WIDE, 3), 255, np.uint8)
    paint.ball(image, 30.2, 22.9, radius, np.zeros(3, np.float32))
    edge = np.hypot(*(np.indices((HIGH, WIDE)) + 0.5 - np.array([22.9, 30.2])[:, None, None])) - radius
    assert (image[edge > 0.51] == 255).all()
    assert (image[edge < 0.49] < 255).all()


@pytest.mark.slow
def test_nothing_outside_an_image_is_painted() -> None:
    """Compiled loops do not check indices: the image is a part of a larger one here."""
    for seed in range(100):
        around = np.full((HIGH + 40, WIDE + 40, 3), 7, np.uint8)
        inside = around[20:-20, 20:-20]
        inside[...] = paper(seed)
        alone = paper(seed)
        shapes(inside, seed)
        shapes(alone, seed)
        np.testing.assert_array_equal(inside, alone, err_msg=str(seed))
        inside[...] = 7
        assert (around == 7).all(), seed


def test_distances_are_rounded_once() -> None:
    """The shade of a ball is chosen by a distance in single precision; a finer table shows its last bits."""
    shades = np.random.default_rng(1).integers(0, 256, (2**20, 3)).astype(np.float32)
    for k in range(5):
        x, y, radius = 20.3 + k / 7, 22.1 + k / 11, 17.0 + k
        image = np.zeros((HIGH, WIDE, 3), np.uint8)
        paint.loops().ball(image, 0, 0, WIDE, HIGH, x, y, radius, shades)
        rows, columns = (np.indices((HIGH, WIDE)) + 0.5).astype(np.float32)
        dx, dy = columns - np.float32(x), rows - np.float32(y)
        right, down = dx + np.float32(0.36 * radius), dy + np.float32(0.40 * radius)
        far = np.sqrt(right.astype(float) ** 2 + down.astype(float) ** 2).astype(np.float32)
        index = (far * np.float32(2**20 / (3 * radius))).astype(int)
        whole = np.hypot(dx, dy) < radius - 0.6
        np.testing.assert_array_equal(image[whole], shades.take(index, axis=0, mode="clip")[whole].astype(np.uint8))


@pytest.mark.parametrize("ends", [(9.2, 5.1, 14.7, 40.4), (50.3, 33.3, 7.1, 30.2), (30.0, 4.0, 30.0, 44.0)])
@pytest.mark.parametrize("width", WIDTHS)
def test_a_line_covers_its_area(ends: tuple[float, ...], width: float) -> None:
    image = np.zeros((HIGH, WIDE, 3), np.uint8)
    paint.stroke(image, *ends, width, WHITE)
    area = width * np.hypot(ends[2] - ends[0], ends[3] - ends[1])
    assert image[..., 0].sum() / 200 == pytest.approx(area, rel=0.02)


def test_an_arrow_covers_its_area() -> None:
    """That of its shaft: here it has next to no head."""
    for start, sweep in ((0.3, 1.1), (3.0, 0.7), (-1.0, -1.3)):
        image = np.zeros((HIGH, WIDE, 3), np.uint8)
        Ring(30.0, 23.0, 18.0, 3.0, (HIGH, WIDE)).arrow(image, start, sweep, 1e-6, WHITE)
        assert image[..., 0].sum() / 200 == pytest.approx(18.0 * abs(sweep) * 3.0, rel=0.02)


def test_the_head_of_an_arrow_covers_its_area() -> None:
    """Its head is a triangle, on a large circle, with half its width over its length HEAD; the shaft ends in it."""
    image, length = black(60, 90), 12.0
    Ring(45.0, 200.0, 170.0, 2.0, (60, 90), 9.0).arrow(image, math.pi - 0.2, 0.35, length / 170.0, WHITE)
    area = (0.35 * 170.0 - length) * 2.0 + HEAD * length**2
    assert image[..., 0].sum() / 200 == pytest.approx(area, rel=0.02)


def test_a_trail_shows_its_newest_passage() -> None:
    """It is as opaque as the path's straight lines in time between the angles, at each angle."""
    bins = 5000
    strength = np.zeros(bins, np.float32)
    path, fade = np.array([0.1, 1.3, 0.4, 0.9]), np.array([0.0, 0.2, 0.5, 0.6])
    low, high = paint.loops().passages(strength, path, np.empty(3), fade)
    assert (low, high) == (0.1, 1.3)
    angles = np.arange(bins) * 2 * np.pi / bins
    newest = np.select(
        [(angles > 0.4) & (angles < 0.9), (angles >= 0.9) & (angles < 1.3), (angles > 0.1) & (angles <= 0.4)],
        [0.5 + 0.1 * (angles - 0.4) / 0.5, 0.2 + 0.3 * (1.3 - angles) / 0.9, 0.2 * (angles - 0.1) / 1.2])
    inner = np.abs(angles[:, None] - path).min(axis=1) > 0.003
    np.testing.assert_allclose(strength[inner], newest[inner], atol=1e-3)
    assert strength[round(0.9 * bins / (2 * np.pi))] == strength.max() == np.float32(0.6)


def test_steps_of_more_than_a_turn_are_cut_to_one() -> None:
    """Beyond a turn only the newest turn is visible, and the newest angle stays where it is."""
    path, sizes = np.array([0.0, 100.0, 100.5, -1e6]), np.empty(3)
    low, high = paint.loops().passages(np.zeros(99, np.float32), path, sizes, np.array([0.0, 0.1, 0.2, 0.3]))
    turn = 2 * np.pi
    np.testing.assert_allclose(sizes, [turn, 0.5, turn])
    np.testing.assert_allclose(path + 1e6, [-0.5, turn - 0.5, turn, 0.0], atol=1e-9)
    assert (low, high) == (path.min(), path.max())


def test_other_sizes_are_refused() -> None:
    ring = Ring(20.0, 20.0, 10.0, 2.0, (HIGH, WIDE))
    for painted in (lambda image: ring.trail(image, (0.0, 1.0), 0.5, COLOUR),
                    lambda image: ring.arrow(image, 0.0, 1.0, 0.1, COLOUR)):
        with pytest.raises(ValueError, match=r"images of the shape \(47, 61\), not \(46, 61\)"):
            painted(paper(0)[1:])
    with pytest.raises(ValueError, match="cover must have the shape"):
        paint.blend(paper(0), np.zeros((HIGH, WIDE - 1), np.float32), COLOUR)


def test_a_graph_stays_in_its_box_and_between_its_ends() -> None:
    image = black()
    xs, ys = np.array([10.0, 20.0, 30.0, 40.0]), np.array([20.0, 80.0, -40.0, 25.0])
    graph(image, Box(5, 12, 55, 30), xs, ys, 3.0, WHITE)
    rows, columns = image[..., 0].nonzero()
    assert (rows.min(), rows.max()) == (12, 29)
    assert (columns.min(), columns.max()) == (8, 41)


@pytest.mark.parametrize("box", [Box(-8, -5, 50, 40), Box(12, 9, WIDE + 9, HIGH + 7)])
def test_a_graph_whose_box_leaves_the_image_is_that_of_a_larger_image(box: Box) -> None:
    whole, part = black(HIGH + 40, WIDE + 40), black()
    xs, ys = np.array([-20.0, 10.0, 33.0, 90.0]), np.array([10.0, 30.0, 5.0, 44.0])
    graph(part, box, xs, ys, 2.6, WHITE)
    graph(whole, Box(box.left + 20, box.top + 20, box.right + 20, box.bottom + 20), xs + 20, ys + 20, 2.6, WHITE)
    assert np.abs(part.astype(int) - whole[20:-20, 20:-20]).max() <= 1
    assert part.any()


@pytest.mark.parametrize(("width", "opacity"), [(0.4, 0.4), (1.0, 1.0), (3.0, 1.0)])
def test_a_level_graph_covers_its_thickness(width: float, opacity: float) -> None:
    """Lines thinner than a pixel are fainter, so that they do not look like wider ones."""
    image = black()
    graph(image, Box(0, 0, WIDE, HIGH), np.array([-9.0, WIDE + 9.0]), np.full(2, 20.3), width, WHITE)
    np.testing.assert_allclose(image[:, :, 0].sum(axis=0) / 200, width * opacity, atol=0.02)


@pytest.mark.parametrize("width", WIDTHS)
def test_a_path_covers_what_is_near_it(width: float) -> None:
    """Half a pixel more than half its width, by the distance of a pixel's centre from the straight line."""
    source = np.random.default_rng(1)
    ys, xs = np.mgrid[:HIGH, :WIDE] + 0.5
    for _ in range(8):
        (x0, y0), (x1, y1) = source.uniform((-20, -20), (WIDE + 20, HIGH + 20), (2, 2))
        share = ((xs - x0) * (x1 - x0) + (ys - y0) * (y1 - y0)) / ((x1 - x0) ** 2 + (y1 - y0) ** 2)
        along = np.clip(share, 0.0, 1.0)
        away = np.hypot(xs - x0 - along * (x1 - x0), ys - y0 - along * (y1 - y0))
        cover = np.clip(width / 2 + 0.5 - away, 0.0, min(1.0, width))
        image = black()
        fading(image, np.array([(x0, y0, 1.0), (x1, y1, 1.0)]), width, WHITE)
        np.testing.assert_allclose(image, (200 * cover)[..., None].repeat(3, axis=2), rtol=0, atol=1.01)


def test_a_path_fades_evenly_and_its_stronger_part_is_visible() -> None:
    image = black()
    fading(image, np.array([(10.0, 20.0, 0.0), (50.0, 20.0, 1.0)]), 3.0, WHITE)
    shown = image[19, 12:48, 0] / 200
    np.testing.assert_allclose(shown, (np.arange(12, 48) + 0.5 - 10) / 40, atol=0.02)
    for first, second in ((0.3, 0.8), (0.8, 0.3)):
        image = black()
        fading(image, np.array([(5.0, 20.5, first), (55.0, 20.5, first), (math.nan,) * 3, (30.5, 5.0, second),
                                (30.5, 40.0, second)]), 3.0, WHITE)
        shown = [image[y, x, 0] / 200 for x, y in ((10, 20), (30, 10), (30, 20))]
        assert shown == pytest.approx([first, second, 0.8], abs=0.01)
