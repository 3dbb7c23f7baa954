"""Tests of compound pendulums in frames: their parts are drawn to scale, at their places."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from pendulum_env import SCENES, Scene
from pendulum_env.films.picture import apparatus
from pendulum_env.physics.bodies import Disc, Kater, Rod
from pendulum_env.physics.body import Body, RigidBody
from pendulum_env.render import Apparatus, FrameStyle, View, frame

SIZE, ANGLE = 400, 2.2
TONE = "#00C000"


def painted(body: RigidBody, angle: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the pixels (x right, y down) of the accent colour below the header, in a frame of the apparatus alone."""
    drawn = dataclasses.replace(apparatus(Scene(body=body)), title="")
    image = frame(drawn, View(0.0, angle, accent=TONE), SIZE, FrameStyle(panels=("apparatus",))).astype(int)
    rows, columns = np.nonzero((image[..., 1] > image[..., 0] + 60) & (image[..., 1] > image[..., 2] + 60))
    keep = rows > 0.08 * SIZE  # the header has a mark of the colour
    return columns[keep] + 0.5, rows[keep] + 0.5


def along(body: RigidBody) -> tuple[np.ndarray, np.ndarray]:
    """Return the places of a body's pixels along and across its axis, from the pivot, in pixels.

    The pivot is in the middle between a ball at the bottom and one at the top.
    """
    x, y = painted(body, ANGLE)
    (x0, low), (_, high) = (np.mean(painted(Body(length=1.0, radius=0.05), angle), axis=1) for angle in (0.0, math.pi))
    dx, dy = x - x0, y - 0.5 * (low + high)
    return dx * math.sin(ANGLE) + dy * math.cos(ANGLE), dx * math.cos(ANGLE) - dy * math.sin(ANGLE)


def test_a_rod_is_drawn_from_its_upper_to_its_lower_end() -> None:
    """A third of the rod is above the pivot: half as long in the picture as the part below."""
    down, aside = along(Rod(length=0.9, width=0.02, overhang=0.3))
    assert -down.min() / down.max() == pytest.approx(0.5, abs=0.02)
    assert np.ptp(aside) / down.max() == pytest.approx(0.02 / 0.6, abs=0.012)


@pytest.mark.parametrize("centre", [0.03, 0.1, 0.4])
def test_a_disc_is_drawn_to_scale(centre: float) -> None:
    """The ratio of its centre's distance to its radius is that of the body; the wheel's cap may hide a part of it."""
    down, aside = along(Disc(radius=0.1, centre=centre))
    radius = 0.5 * np.ptp(aside)
    assert (down.max() - radius) / radius == pytest.approx(centre / 0.1, abs=0.05)


def test_katers_balls_are_drawn_to_scale() -> None:
    """Bob and counterweight are at their places, inverted as from the other knife edge."""
    body = Kater(length=0.8, bob_position=1.0, radius=0.1, counterweight_position=0.5, counterweight_radius=0.05)
    for inverted in (False, True):
        down, aside = along(dataclasses.replace(body, inverted=inverted))
        balls = [(0.8 - 1.0, 0.1), (0.8 - 0.5, 0.05)] if inverted else [(1.0, 0.1), (0.5, 0.05)]
        scale = np.ptp(aside) / 0.2
        for place, radius in balls:
            near = np.abs(down - place * scale) < 1.2 * radius * scale
            assert down[near].mean() == pytest.approx(place * scale, abs=1.5)
            assert np.count_nonzero(near) == pytest.approx(math.pi * (radius * scale) ** 2, rel=0.25)


@pytest.mark.parametrize("name", ["rod", "kater", "torsion"])
@pytest.mark.parametrize("angle", [0.0, 1.0, 4.0])
def test_presets_fit_into_the_picture(name: str, angle: float) -> None:
    """Nothing of the pendulum reaches the picture's edge."""
    x, y = painted(SCENES[name].body, angle)
    assert len(x)
    assert x.min() > 3.0
    assert max(x.max(), y.max()) < SIZE - 3.0


@pytest.mark.parametrize("wrong", [("cube", 0.0, 0.0, 1.0), ("bar", 0.0, math.nan, 1.0)])
def test_unknown_parts_are_refused(wrong: tuple[str, float, float, float]) -> None:
    with pytest.raises(ValueError, match="a part of the outline must be bar, ball or plate"):
        Apparatus(1.0, 0.1, outline=(wrong,))


def test_an_outline_has_no_large_picture() -> None:
    with pytest.raises(ValueError, match="None with a sway or an outline"):
        Apparatus(1.0, 0.1, swing=0.2, outline=(("bar", 0.0, 1.0, 0.01),))
