"""Tests of render_theme, render_panels and render_mode in gym.make and make_vec, lists of frames, and tiles."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from lettering import inked

from pendulum_env import LabPendulumEnv, LabPendulumVectorEnv, SceneError
from pendulum_env.films import picture, reel
from pendulum_env.render import PANELS, THEMES, FrameStyle, View, stage

pytestmark = pytest.mark.usefixtures("interpreted")
ALL = tuple(PANELS)
ENERGIES = ("kinetic", "potential", "heat", "work", "residual")
IN_INFO = ("kinetic_energy", "potential_energy", "heat", "work", "energy_residual")


def push(*shape: int) -> Any:
    return np.full(shape or 1, 0.7, dtype=np.float32)


def single(**keywords: Any) -> LabPendulumEnv:
    return LabPendulumEnv(render_mode="rgb_array", render_size=200, **keywords)


def vector(**keywords: Any) -> LabPendulumVectorEnv:
    return LabPendulumVectorEnv(render_mode="rgb_array", **{"num_envs": 3, "render_size": 200, **keywords})


def shown(env: Any, monkeypatch: pytest.MonkeyPatch) -> list[View]:
    """Collect the views that render() draws."""
    views: list[View] = []
    with monkeypatch.context() as patch:
        patch.setattr(picture, "drawn", lambda _, view, *_more: views.append(view))
        env.render()
    return views


def test_theme_and_panels_reach_the_frame() -> None:
    pictures = []
    for keywords in ({}, {"render_theme": "dark"}, {"render_panels": ("phase",)}, {"render_panels": ["energy"]}):
        env = single(**keywords)
        env.reset(seed=0)
        env.step(push())
        pictures.append(env.render())
        many = vector(num_envs=1, **keywords)
        many.reset(seed=0)
        many.step(push(1, 1))
        np.testing.assert_array_equal(many.render()[0], pictures[-1])  # type: ignore[index]
    assert len({image.tobytes() for image in pictures}) == 4  # type: ignore[union-attr]
    assert pictures[1][0, 100].tolist() == [0x14, 0x17, 0x1B]  # type: ignore[index]
    assert THEMES["dark"].paper == "#14171B"


@pytest.mark.parametrize(("keywords", "message"), [
    ({"render_theme": "drak"}, "There is no render_theme 'drak'; did you mean dark?"),
    ({"render_theme": None}, "There is no render_theme None; there are light, dark."),
    ({"render_panels": ("fase",)}, "There is no panel in render_panels 'fase'; did you mean phase?"),
    ({"render_panels": "phase"}, "render_panels must be a list of panels .apparatus, energy, .*, not 'phase'."),
    ({"render_panels": ()}, "render_panels must be one or more of .*, not none."),
    ({"render_panels": ("phase", "phase")}, "not one of them twice."),
    ({"render_panels": ("residual",), "diagnostics": ()}, 'The panel "residual" needs the diagnostic "energy"'),
    ({"render_panels": ("history",), "diagnostics": ("tension",)}, 'The panel "history" needs the diagnostic'),
])
def test_settings_that_cannot_be_are_refused(keywords: dict[str, Any], message: str) -> None:
    for make in (LabPendulumEnv, LabPendulumVectorEnv):
        with pytest.raises(SceneError, match=message):
            make(**keywords)


@pytest.mark.parametrize("kind", ["single", "vector"])
def test_the_past_is_what_info_said(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    env: Any = single(render_panels=ALL) if kind == "single" else vector(render_panels=ALL)
    _, info = env.reset(seed=3)
    told = [info]
    for _ in range(20):
        told.append(env.step(push() if kind == "single" else push(3, 1))[-1])
    for place, view in enumerate(shown(env, monkeypatch)):
        assert view.past is not None
        assert view.curves is not None
        assert view.curves.separatrix
        for name, entry in (("time", "time"), ("angle", "angle"), ("velocity", "velocity"),
                            *zip(ENERGIES, IN_INFO, strict=True)):
            wanted = [float(info[entry] if kind == "single" else info[entry][place]) for info in told]
            np.testing.assert_allclose(getattr(view.past, name), wanted, rtol=0.0, atol=1e-14)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_a_vectors_past_begins_with_each_episode(mode: str, monkeypatch: pytest.MonkeyPatch) -> None:
    env = vector(render_panels=("phase", "history"), max_episode_steps=5, autoreset_mode=mode)
    env.reset(seed=0)
    for step in range(12):
        _, _, _, over, info = env.step(push(3, 1))
        if mode == "Disabled" and over.any():
            _, info = env.reset(options={"reset_mask": over})
        for place, view in enumerate(shown(env, monkeypatch)):
            assert view.past is not None
            assert view.past.time[0] == 0.0, step
            assert view.past.time[-1] == view.time == info["time"][place]
            assert len(view.past.time) == round(view.time / 0.02) + 1


@pytest.mark.quick("panels0-kept0", "panels1-kept1")
@pytest.mark.parametrize(("panels", "kept"), [
    (("apparatus",), {"trail"}), (("energy",), set()), (("phase",), {"past"}), (ALL, {"trail", "past"})])
def test_panels_that_are_not_shown_keep_nothing(panels: tuple[str, ...], kept: set[str],
                                                monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[str] = []
    monkeypatch.setattr(stage, "PANELS", {name: replace(
        entry, made=lambda at, name=name, entry=entry: made.append(name) or entry.made(at))
        for name, entry in PANELS.items()})
    worked_out: list[Any] = []
    monkeypatch.setattr(picture, "curves", lambda *given, make=picture.curves: worked_out.append(given) or make(*given))
    found: list[Any] = []
    ledger = picture.Machine.ledger
    monkeypatch.setattr(picture.Machine, "ledger", lambda self, *given: found.append(1) or ledger(self, *given))
    stage.stage.cache_clear()
    reels: list[reel.Reel] = []
    begun = reel.Reel.__init__
    monkeypatch.setattr(reel.Reel, "__init__", lambda self, *given: (reels.append(self), begun(self, *given))[1])
    for env, action in ((single(render_panels=panels), push()), (vector(render_panels=panels), push(3, 1))):
        env.reset(seed=0)
        for _ in range(3):
            env.step(action)
        assert {name for name in ("trail", "past") if getattr(reels[-1], name) is not None} == kept
        env.render()
    stage.stage.cache_clear()
    assert set(made) == set(panels)
    assert bool(worked_out) == ("phase" in panels)
    assert bool(found) == bool({"energy", "history", "residual"} & set(panels))


def test_without_a_render_mode_nothing_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reel.Reel, "keep", lambda *_: pytest.fail("kept"))
    env, many = LabPendulumEnv(render_panels=ALL), LabPendulumVectorEnv(num_envs=2, render_panels=ALL)
    for one, action in ((env, push()), (many, push(2, 1))):
        one.reset(seed=0)
        one.step(action)


def test_a_past_is_as_long_as_its_window_and_no_longer() -> None:
    for dt in (0.02, 0.001):
        kept = reel.Reel(FrameStyle("light", ("phase",)), dt, False)
        kept.begin((0.0, 0.0, 0.0), {})
        for step in range(1, round(21.0 / dt)):
            kept.keep((step * dt, 0.0, 0.0), {})
        found = kept.past_of()
        assert found is not None
        assert 10.0 <= found.time[-1] - found.time[0] < 10.1
        assert len(found.time) <= reel.MOST + 2


def test_the_past_is_part_of_the_state() -> None:
    env, other = single(render_panels=ALL), single(render_panels=ALL)
    env.reset(seed=1)
    for _ in range(10):
        env.step(push())
    other.set_state(env.get_state())
    for _ in range(3):
        np.testing.assert_array_equal(env.render(), other.render())
        env.step(push())
        other.step(push())
    single(render_panels=("apparatus",)).set_state(env.get_state())
    saved = env.get_state()
    for spoilt in ({"past": [[1.0]]}, {"past": 5}, {"past": [[float("nan")] * 8]}, {"seen": 0.5},
                   {"past": saved["past"][::-1]}):
        with pytest.raises(SceneError, match="past in a state to restore"):
            other.set_state({**saved, **spoilt})


def test_rgb_array_list_is_gymnasiums() -> None:
    """Check that render() returns all frames since the reset or the last render(), beginning with the reset's."""
    plain = gym.make("LabPendulum-v0", render_mode="rgb_array", render_size=120)
    listed = gym.make("LabPendulum-v0", render_mode="rgb_array_list", render_size=120)
    assert listed.render_mode == "rgb_array_list"
    assert "rgb_array_list" in listed.metadata["render_modes"]
    assert listed.metadata["render_fps"] == 50
    for env in (plain, listed):
        env.reset(seed=0)
    wanted = [plain.render()]
    for _ in range(4):
        for env in (plain, listed):
            env.step(push())
        wanted.append(plain.render())
    found: Any = listed.render()
    assert isinstance(found, list)
    np.testing.assert_array_equal(found, wanted)
    assert listed.render() == []
    listed.step(push())
    listed.reset()
    assert len(listed.render()) == 1  # type: ignore[arg-type]


@pytest.mark.quick("2")
@pytest.mark.parametrize("count", [1, 2, 9])
def test_tiles_are_the_frames_of_the_first_environments(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    env = vector(num_envs=5, render_theme="dark", scene="lab", length=np.linspace(0.2, 0.4, 5))
    env.reset(seed=0)
    env.step(push(5, 1))
    image: Any = env.render_tiles(count)
    many = min(count, 5)
    rows, columns = image.shape[0] // 200, image.shape[1] // 200
    assert rows * columns >= many > (rows - 1) * columns
    frames: Any = env.render()
    for place in range(many):
        tile = image[image.shape[0] - 200 * rows:][place // columns * 200:, place % columns * 200:][30:200, 5:200]
        body = frames[place][30:200, 5:200]
        bob = (np.abs(body[..., 2].astype(int) - body[..., 0]) > 60) & (body[..., 0] < 60)
        assert bob.any()
        assert (np.abs(tile.astype(int) - body).sum(axis=2) > 30).mean() < 0.05
    assert env.render_tiles(4, columns=4).shape[1] == 800  # type: ignore[union-attr]
    texts = [text for text, *_ in inked(monkeypatch, lambda: env.render_tiles(count))]
    assert texts.count("t = 0.02 s") == 1
    assert texts.count("rk4") == many


@pytest.mark.slow
def test_a_vectors_frames_are_those_of_single_environments_to_the_last_pixel() -> None:
    keywords: dict[str, Any] = {"task": "balance", "render_mode": "rgb_array", "render_panels": ("apparatus",),
                                "render_size": 200, "backend": "python"}
    vector, singles = LabPendulumVectorEnv(3, **keywords), [LabPendulumEnv(**keywords) for _ in range(3)]
    vector.reset(seed=5)
    for i, single in enumerate(singles):
        single.reset(seed=5 + i)
    for actions in np.random.default_rng(0).uniform(-1.0, 1.0, (5, 3, 1)).astype(np.float32):
        assert not vector.step(actions)[2].any()
        for single, action, frame in zip(singles, actions, vector.render(), strict=True):  # type: ignore[arg-type]
            single.step(action)
            np.testing.assert_array_equal(frame, single.render())


def test_tiles_have_their_own_clocks_where_times_differ(monkeypatch: pytest.MonkeyPatch) -> None:
    env = vector(autoreset_mode="Disabled")
    env.reset(seed=0)
    env.step(push(3, 1))
    env.reset(options={"reset_mask": np.array([False, True, False])})
    texts = [text for text, *_ in inked(monkeypatch, env.render_tiles)]
    assert sorted(text for text in texts if text.startswith("t =")) == ["t = 0.00 s", "t = 0.02 s", "t = 0.02 s"]


def test_tiles_need_a_render_mode_a_reset_and_numbers() -> None:
    with pytest.warns(UserWarning, match="draws nothing without render_mode"):
        assert LabPendulumVectorEnv().render_tiles() is None
    env = vector()
    with pytest.raises(gym.error.ResetNeeded, match="before the first render"):
        env.render_tiles()
    env.reset(seed=0)
    for wrong in ({"count": 0}, {"count": 2.5}, {"columns": 0}, {"columns": "two"}):
        with pytest.raises(SceneError, match=next(iter(wrong))):
            env.render_tiles(**wrong)


def test_gymnasiums_recorder_takes_a_vectors_frames(tmp_path: Any) -> None:
    pytest.importorskip("moviepy")
    if not hasattr(gym.wrappers.vector, "RecordVideo"):
        pytest.skip("this version of Gymnasium records no vectors")
    env: Any = gym.make_vec("LabPendulum-v0", num_envs=2, render_mode="rgb_array", render_size=64)
    recorded = gym.wrappers.vector.RecordVideo(env, str(tmp_path / "films"), episode_trigger=lambda number: number == 0)
    recorded.reset(seed=0)
    for _ in range(3):
        recorded.step(push(2, 1))
    assert len(recorded.recorded_frames) == 4
    assert recorded.recorded_frames[0].shape in ((128, 64, 3), (64, 128, 3))
    assert recorded.frames_per_sec == 50
    recorded.recorded_frames = []
    recorded.recording = False
    recorded.close()
