"""Frames of a pendulum with a moving pivot draw wheel, rod, bob and trail where the drives' formulas put them."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from pendulum_env import SCENES
from pendulum_env.engine.machine import Machine
from pendulum_env.films import picture
from pendulum_env.films import record as filming
from pendulum_env.physics.effects import VerticalDrive
from pendulum_env.render import Apparatus, View, frame
from pendulum_env.study.compare import compare, files

SHAKEN = Apparatus(0.353, 0.02, "rod", sway=(0.05, 0.1))
STILL = Apparatus(0.353, 0.02, "rod")
BLANK = np.zeros((80, 80, 3), dtype=np.uint8)


def centre(image: Any) -> Any:
    """Return the centroid (x, y) of the blue pixels in a frame with no other hue."""
    weight = np.maximum(image[..., 2].astype(float) - image[..., 0] - 20, 0)
    rows, columns = np.indices(weight.shape) + 0.5
    return np.array([(columns * weight).sum(), (rows * weight).sum()]) / weight.sum()


def bob(angle: float, x: float = 0.0, y: float = 0.0) -> Any:
    return centre(frame(SHAKEN, View(0.0, angle, pivot=(x, y))))


@cache
def scale() -> float:
    """Pixels a metre."""
    return float(bob(0.0)[1] - bob(math.pi)[1]) / 2 / SHAKEN.length


@pytest.mark.parametrize(("right", "up"), [(13, 0), (0, 25), (-8, -25)])
def test_wheel_rod_and_bob_go_with_the_pivot(right: int, up: int) -> None:
    """A pivot that moves by whole pixels moves the picture around it; the stand does not move."""
    x, y = right / scale(), up / scale()
    for angle in (0.0, 0.7):
        assert bob(angle, x, y) - bob(angle) == pytest.approx((right, -up), abs=0.1)
    rest, moved = (frame(SHAKEN, View(0.0, 0.7, pivot=away)).astype(int) for away in ((0.0, 0.0), (x, y)))
    column, row = np.round((bob(0.0) + bob(math.pi)) / 2).astype(int)
    assert np.abs(moved[row - up - 18 : row - up + 19, column + right - 20 : column + right + 21]
                  - rest[row - 18 : row + 19, column - 20 : column + 21]).max() <= 8
    assert np.array_equal(moved[:, :100], rest[:, :100])


def test_all_of_it_stays_in_the_frame() -> None:
    body = bob(math.pi, 0.0, 0.1)[1] - SHAKEN.bob_radius * scale()
    assert 0.0 < body - 1.5 * 21 < 0.1 * 500


def test_what_stands_still_is_drawn_as_ever() -> None:
    assert np.array_equal(frame(STILL, View(0.0, 0.5, pivot=(0.1, 0.1))), frame(STILL, View(0.0, 0.5)))


def test_the_trail_is_the_bobs_path_and_fades() -> None:
    """A bob that hangs below a pivot which moves to the right leaves a horizontal trail."""
    ways = np.linspace(-0.05, 0.05, 21)
    bare = frame(SHAKEN, View(0.0, 0.0, pivot=(0.05, 0.0)))
    drawn = frame(SHAKEN, View(0.0, 0.0, pivot=(0.05, 0.0), trail=(0.0,) * 20,
                               trail_pivots=tuple((x, 0.0) for x in ways[:-1])))
    ink = np.clip(bare.astype(float) - drawn, 0, None)[..., 0]
    x, y = bob(0.0, 0.05)
    assert np.average(np.arange(500) + 0.5, weights=ink.sum(axis=1)) == pytest.approx(y, abs=0.2)
    columns = np.nonzero(ink.sum(axis=0) > 1.0)[0]
    assert bob(0.0, -0.05)[0] < columns[0] < bob(0.0, -0.05)[0] + 15
    assert x - SHAKEN.bob_radius * scale() - 3 < columns[-1] < x
    strength = ink.max(axis=0)[columns[0] : columns[-1] - 2]
    assert np.all(np.diff(strength) >= -1.0)
    assert strength[-1] > 4.0 * strength[len(strength) // 4]


@pytest.mark.parametrize("angles", [(), (0.0,), (0.0, 40.0, -1e6, 1e9), tuple(range(100))])
def test_any_finite_trail_can_be_drawn(angles: tuple[float, ...]) -> None:
    away = tuple((0.01 * k, -1e3 * k) for k in range(len(angles)))
    assert frame(SHAKEN, View(0.0, 0.3, trail=angles, trail_pivots=away, torque_share=0.5, pivot=(9.0, 9.0))).any()


@pytest.mark.parametrize(("changes", "message"), [
    ({"pivot": (0.0, math.nan)}, "pivot must be finite"),
    ({"trail": (0.0, 0.1), "trail_pivots": ((0.0, math.inf), (0.0, 0.0))}, "pivot must be finite"),
    ({"trail": (0.0,), "trail_pivots": ((0.0, 0.0), (0.0, 0.0))}, "empty or one for each angle, not 2 of them"),
])
def test_a_bad_pivot_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        View(0.0, 0.0, **changes)


@pytest.mark.parametrize("sway", [(-0.1, 0.0), (0.0, math.inf)])
def test_a_bad_sway_is_refused(sway: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="sway must be two finite numbers of at least 0 m"):
        Apparatus(1.0, 0.1, sway=sway)


# --- from the scene to the frame -------------------------------------------------------------------------------------


def filmed(kind: str, folder: Path) -> None:
    """Film or step 0.5 s of a scene whose pivot is driven in both directions, with a position every 0.02 s."""
    place = SCENES["driven"].with_effects((*SCENES["driven"].effects, VerticalDrive(0.02, 7.0, 0.3)))
    if kind == "record":
        filming.record(Machine(place, "rk4"), folder / "film.gif", dt=0.01, duration=0.5, size=80)
    elif kind == "compare":
        list(files.pictures(compare(place, "rk4", dt=0.02, duration=0.5), 26))
    else:
        options: dict[str, Any] = {"scene": place, "task": "free", "substeps": 2, "render_mode": "rgb_array"}
        env: Any = gym.make_vec("LabPendulum-v0", num_envs=1, **options) if kind == "vector" else gym.make(
            "LabPendulum-v0", disable_env_checker=True, **options)
        env.reset(seed=0)
        for _ in range(25):
            env.step(np.zeros((1, 1) if kind == "vector" else 1, np.float32))
        env.render()


@pytest.mark.quick("single", "record")
@pytest.mark.usefixtures("interpreted")
@pytest.mark.parametrize("kind", ["single", "vector", "record", "compare"])
def test_the_pivot_is_where_the_drives_put_it(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Now and along the trail, 0.02 s apart, the pivot is at x = 5 mm cos(5 t), y = 20 mm cos(7 t + 0.3)."""
    shown: list[Any] = []
    for room, name in ((picture, "drawn"), (filming, "frame")):
        monkeypatch.setattr(room, name, lambda thing, view, *_, **_more: shown.append((thing, view)) or BLANK)
    monkeypatch.setattr(files, "side_by_side", lambda panels, **_: shown.append(panels[0]))
    filmed(kind, tmp_path)

    def pivot(time: float) -> Any:
        return pytest.approx((0.005 * math.cos(5.0 * time), 0.02 * math.cos(7.0 * time + 0.3)), abs=1e-15)

    thing, view = shown[-1]
    assert thing.sway == (0.005, 0.02)
    assert 0.47 < view.time < 0.51
    assert view.pivot == pivot(view.time)
    assert len(view.trail_pivots) == len(view.trail) >= 20
    for k, place in enumerate(reversed(view.trail_pivots)):
        assert place == pivot(view.time - 0.02 * k)


def test_where_no_pivot_moves_views_hold_none() -> None:
    assert picture.pivots(SCENES["windy"], 1.0, [0.5]) == {}
    assert picture.apparatus(SCENES["lab"]).sway == (0.0, 0.0)
