"""Films last as long as they should, show the runs, and are complete or do not exist."""

from __future__ import annotations

import gc
import json
import math
import os
import re
import signal
import subprocess
import sys
import time
import warnings
import weakref
from types import SimpleNamespace
from typing import get_type_hints

import gymnasium as gym
import numpy as np
import pytest
from PIL import Image, ImageSequence
from typer.testing import CliRunner

from integrators import METHODS, from_step
from pendulum_env import SCENES, SceneError, cli, film, rollout
from pendulum_env.cli.record import record
from pendulum_env.engine.machine import offers
from pendulum_env.films import record as filming
from pendulum_env.films import runs as films
from pendulum_env.physics import exact
from pendulum_env.render import PANELS, THEMES, Apparatus, View, colour, frame, write_film
from pendulum_env.render import film as writer

WIRE = Apparatus(length=0.353, bob_radius=0.0107, suspension="wire", rod_radius=0.0002, title="exercise")


def pictures(count, size=(64, 64)):
    return [frame(WIRE, View(0.02 * index, 0.1 * index), size) for index in range(count)]


def gif_blocks(data):
    """Return delays [1/100 s] and comment of a gif from its bytes (GIF89a specification, sections 23 and 24)."""
    at = data.index(b"\x21\xfe") + 2
    comment = b""
    while data[at]:
        comment += data[at + 1:at + 1 + data[at]]
        at += 1 + data[at]
    marks = [at for at in range(len(data) - 7) if data[at:at + 3] == b"\x21\xf9\x04" and data[at + 7] == 0]
    return [int.from_bytes(data[at + 4:at + 6], "little") for at in marks], comment


def ffmpeg(path, *output):
    """Return ffmpeg's output for a film as bytes, and its messages about the film."""
    import imageio_ffmpeg

    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-hide_banner", "-i", path, *output, "-"]
    done = subprocess.run(command, capture_output=True, timeout=60, check=True)
    return done.stdout, done.stderr.decode()


TOO_MANY = [name for name, method in METHODS.items() if method.needs <= offers(SCENES["lab"])][:17]
"""One more than the methods that one film can show, all of which fit the scene "lab"."""


@pytest.mark.parametrize(("fps", "size"), [(50, (64, 64)), (30, (71, 53)), (100 / 3, (60, 62))])
def test_an_mp4_lasts_as_long_as_the_run_and_shows_it(tmp_path, fps, size):
    images = pictures(13, size)
    path = write_film(tmp_path / "swing.mp4", iter(images), fps, {"scene": "exercise", "title": "Swing"}, 13)
    width, height = (side + side % 2 for side in size)
    data, messages = ffmpeg(path, "-fps_mode", "passthrough", "-f", "rawvideo", "-pix_fmt", "rgb24")
    played = np.frombuffer(data, np.uint8).reshape(-1, height, width, 3)
    assert len(played) == 13
    for image, shown in zip(images, played, strict=True):
        assert np.abs(shown[:size[1], :size[0]].astype(int) - image).mean() < 4
    assert re.search(rf"h264.* yuv420p.* {width}x{height}", messages)
    assert float(re.search(r"([\d.]+) fps", messages)[1]) == pytest.approx(fps, abs=0.005)
    hours, minutes, seconds = re.search(r"Duration: (\d+):(\d+):([\d.]+)", messages).groups()
    assert (hours, minutes) == ("00", "00")
    assert float(seconds) == pytest.approx(13 / fps, abs=0.01)
    tags = ffmpeg(path, "-f", "ffmetadata")[0].decode().splitlines()
    assert {"title=Swing", 'comment={"scene": "exercise", "title": "Swing"}'} <= set(tags)


@pytest.mark.quick("33.333333333333336-3")
@pytest.mark.parametrize(("fps", "delay"), [(50, 2), (25, 4), (10, 10), (100 / 3, 3)])
def test_a_gif_keeps_its_delays_and_comment(tmp_path, fps, delay):
    path = write_film(tmp_path / "swing.gif", pictures(5), fps, {"scene": "exercise"})
    delays, comment = gif_blocks(path.read_bytes())
    assert delays == [delay] * 5
    assert json.loads(comment) == {"scene": "exercise"}


@pytest.mark.parametrize(("fps", "nearest"), [(30, "100/3 or 25"), (60, "50"), (100, "50"), (24, "25 or 20")])
def test_a_gif_refuses_a_rate_it_can_not_play(tmp_path, fps, nearest):
    with pytest.raises(ValueError, match=f"not {fps}; the nearest: {nearest}$"):
        write_film(tmp_path / "swing.gif", pictures(2), fps)
    assert not list(tmp_path.iterdir())


def broken_frames(error):
    yield from pictures(3)
    raise error


@pytest.mark.parametrize("name", ["old.mp4", "old.gif"])
@pytest.mark.parametrize(("frames", "fps", "total", "error", "message"), [
    (lambda: broken_frames(RuntimeError("lost")), 50, None, RuntimeError, "lost"),
    (lambda: broken_frames(KeyboardInterrupt("stop")), 50, None, KeyboardInterrupt, "stop"),
    (lambda: [], 50, None, ValueError, "at least one frame, but there are 0"),
    (lambda: pictures(3), 50, 4, ValueError, "4 frames, but there are 3"),
    (lambda: pictures(3), 50, 2, ValueError, "2 frames, but there are more"),
    (lambda: [*pictures(2), *pictures(1, 50)], 50, None, ValueError, "frame 3 must have shape"),
    (lambda: [np.zeros((64, 64, 3))], 50, None, ValueError, "frame 1 must be a uint8 array"),
    (lambda: ["picture"], 50, None, ValueError, "not str"),
    (lambda: pictures(2), 0, None, ValueError, "fps must be finite and above 0, not 0"),
    (lambda: pictures(2), math.nan, None, ValueError, "fps must be finite"),
    (lambda: pictures(2), "50", None, ValueError, "fps must be finite and above 0, not .50."),
])
def test_a_film_that_fails_leaves_the_old_one(tmp_path, name, frames, fps, total, error, message):
    old = tmp_path / name
    old.write_bytes(b"the old film")
    with pytest.raises(error, match=message):
        write_film(old, frames(), fps, total=total)
    assert old.read_bytes() == b"the old film"
    assert list(tmp_path.iterdir()) == [old]


def test_an_encoder_that_fails_leaves_the_old_film(tmp_path, monkeypatch):
    import imageio_ffmpeg

    monkeypatch.setattr(imageio_ffmpeg, "get_ffmpeg_exe", lambda: sys.executable)
    old = tmp_path / "old.mp4"
    old.write_bytes(b"the old film")
    with pytest.raises(OSError, match="ffmpeg could not write the film: "):
        write_film(old, pictures(200), 50)
    assert old.read_bytes() == b"the old film"
    assert list(tmp_path.iterdir()) == [old]


def test_a_new_film_replaces_the_old_and_reports_progress(tmp_path):
    old = tmp_path / "old.gif"
    old.write_bytes(b"the old film")
    seen = []
    write_film(old, pictures(3), 50, total=3, progress=lambda done, total: seen.append((done, total)))
    assert old.read_bytes().startswith(b"GIF89a")
    assert seen == [(1, 3), (2, 3), (3, 3)]


def test_a_film_needs_a_known_ending_and_a_folder(tmp_path):
    with pytest.raises(ValueError, match=r"must end in \.mp4 or \.gif, not 'swing\.avi'"):
        write_film(tmp_path / "swing.avi", pictures(1), 50)
    with pytest.raises(OSError, match=r"can't write films into .*nowhere"):
        write_film(tmp_path / "nowhere" / "swing.mp4", pictures(1), 50)
    (tmp_path / "file").touch()
    with pytest.raises(OSError, match=r"can't write films into .*file"):
        write_film(tmp_path / "file" / "swing.mp4", pictures(1), 50)
    (tmp_path / "folder.gif").mkdir()
    with pytest.raises(IsADirectoryError, match="there is a folder of that name"):
        write_film(tmp_path / "folder.gif", pictures(1), 50)


# --- gifs, frame by frame ---------------------------------------------------------------------------------------------


def played(path):
    """Return frames and durations [ms] of a gif as Pillow reads them."""
    with Image.open(path) as image:
        return [(np.asarray(part.convert("RGB")), part.info["duration"]) for part in ImageSequence.Iterator(image)]


def test_a_gif_shows_its_frames(tmp_path):
    """A gif has at most 256 colours; they also suit a last frame that is unlike all others."""
    images = [*pictures(6, (200, 200)), np.full((200, 200, 3), (10, 200, 30), np.uint8)]
    parts = played(write_film(tmp_path / "swing.gif", images, 20))
    assert [lasting for _, lasting in parts] == [50] * 7
    for image, (shown, _) in zip(images, parts, strict=True):
        assert np.abs(shown.astype(int) - image).mean() < 0.1
        assert (np.abs(shown.astype(int) - image).max(axis=2) > 16).mean() < 2e-3


def test_equal_frames_of_a_gif_are_one_that_lasts(tmp_path, monkeypatch):
    first, second = pictures(2)
    parts = played(write_film(tmp_path / "swing.gif", [first, first, second, first, first, first], 25))
    assert [lasting for _, lasting in parts] == [80, 40, 120]
    monkeypatch.setattr(writer, "LONGEST", 8)
    parts = played(write_film(tmp_path / "swing.gif", [first] * 6, 25))
    assert sum(lasting for _, lasting in parts) == 240
    assert max(lasting for _, lasting in parts) == 80


def test_a_gif_takes_frames_that_reuse_one_array(tmp_path):
    buffer = np.empty((64, 64, 3), np.uint8)

    def reused():
        for image in pictures(3):
            buffer[...] = image
            yield buffer

    parts = played(write_film(tmp_path / "swing.gif", reused(), 25))
    assert [lasting for _, lasting in parts] == [40, 40, 40]


@pytest.mark.quick("0-0", "20-58")
@pytest.mark.parametrize(("y", "x"), [(0, 0), (52, 60), (0, 60), (52, 0), (20, 3), (20, 58), (50, 30), (26, 26)])
def test_a_gif_shows_a_change_of_one_pixel_at_any_place(tmp_path, y, x):
    dark = np.zeros((53, 61, 3), np.uint8)
    light = dark.copy()
    light[y, x] = 255
    parts = played(write_film(tmp_path / "pixel.gif", [dark, light, dark, dark], 25))
    assert [lasting for _, lasting in parts] == [40, 40, 80]
    assert parts[1][0][y, x].tolist() == [255, 255, 255]


@pytest.mark.slow
@pytest.mark.parametrize("ending", [".mp4", ".gif"])
def test_a_film_in_the_making_holds_few_frames(tmp_path, ending):
    alive = []

    def fresh():
        for i in range(40):
            image = frame(WIRE, View(0.02 * i, 0.1 * i), 64)
            alive.append(weakref.ref(image))
            yield image
            del image
            if i == 30:
                gc.collect()
                assert sum(one() is not None for one in alive) < 6

    write_film(tmp_path / f"swing{ending}", fresh(), 50)


# --- runs -------------------------------------------------------------------------------------------------------------


def lasts(path):
    """Return the number of frames and the seconds that a film lasts, read from its file."""
    if path.suffix == ".gif":
        parts = played(path)
        return len(parts), sum(lasting for _, lasting in parts) / 1000
    data, messages = ffmpeg(path, "-fps_mode", "passthrough", "-f", "rawvideo", "-pix_fmt", "gray", "-vf", "scale=2:2")
    hours, minutes, seconds = re.search(r"Duration: (\d+):(\d+):([\d.]+)", messages).groups()
    return len(data) // 4, 3600 * int(hours) + 60 * int(minutes) + float(seconds)


@pytest.mark.quick("odd.mp4-24-3.3-0.31", "odd.gif-33.333333333333336-1.7-0.313")
@pytest.mark.usefixtures("interpreted")
@pytest.mark.parametrize(("name", "fps", "slow", "duration"), [
    ("true.mp4", 50, 1, 0.4), ("slow.mp4", 60, 4, 0.25), ("odd.mp4", 24, 3.3, 0.31), ("fast.mp4", 30, 0.5, 2.0),
    ("true.gif", 50, 1, 0.4), ("slow.gif", 25, 4, 0.25), ("odd.gif", 100 / 3, 1.7, 0.313),
])
def test_a_film_lasts_the_simulated_time_times_the_slow_motion_factor(tmp_path, name, fps, slow, duration):
    path, stopped = film("vacuum", tmp_path / name, duration=duration, fps=fps, slow=slow, size=64, angle=1.0)
    count, seconds = lasts(path)
    assert not stopped
    assert count == round(duration * slow * fps)
    assert abs(seconds - duration * slow) <= 1.0 / fps


def warnings_of(run):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        run()
    return [str(one.message) for one in caught]


@pytest.mark.quick("exercise_large-rk4-goes slack-keywords0", "lab-rk4--keywords5")
@pytest.mark.usefixtures("interpreted")
@pytest.mark.parametrize(("scene", "integrator", "words", "keywords"), [
    ("exercise_large", "rk4", "goes slack", {"slack": "warn", "angle": 2.0, "duration": 1.0}),
    pytest.param("lab", "gauss4", "Newton's method found no solution", {"dt": 50.0, "duration": 50.0, "angle": 3.0},
                 marks=pytest.mark.slow),
    ("kapitza", "rk4", "of the phase of vertical_drive", {"dt": 0.02, "duration": 1.0}),
    ("lab", "forward_euler", "are too long", {"dt": 0.2, "duration": 1.0}),
    ("lab", "rk4", "formulas do not hold", {"angle": 0.02, "duration": 1.0}),
    ("lab", "rk4", "", {"duration": 1.0}),
])
def test_a_film_warns_as_a_rollout_does(tmp_path, scene, integrator, words, keywords):
    warned = warnings_of(lambda: rollout(scene, integrator=integrator, **keywords))
    assert warnings_of(lambda: film(scene, tmp_path / "warned.gif", integrator, size=64, fps=2, **keywords)) == warned
    assert any(words in one for one in warned) if words else not warned


@pytest.mark.usefixtures("interpreted")
def test_a_stop_beyond_the_last_frame_is_not_told(tmp_path):
    filmed = film("lab", tmp_path / "short.gif", "rk4", dt=100.0, duration=1.0, size=64, fps=10, control=0.0)
    assert not filmed.stopped


@pytest.fixture
def shown(monkeypatch):
    """Record, instead of drawing frames, the list of (apparatus, view) pairs of each."""
    seen = []
    blank = np.zeros((64, 64, 3), np.uint8)
    monkeypatch.setattr(filming, "frame", lambda thing, view, **_: seen.append([(thing, view)]) or blank)
    monkeypatch.setattr(filming, "side_by_side", lambda pairs, *_, **__: seen.append(list(pairs)) or blank)
    return seen


@pytest.mark.usefixtures("interpreted")
@pytest.mark.parametrize(("scene", "angle", "control", "large"), [
    ("vacuum", 5.0, 0.0, True), ("vacuum", 29.0, 0.0, True), ("vacuum", 31.0, 0.0, False), ("lab", 5.0, 0.0, True),
    ("lab", 5.0, 0.1, False), ("kapitza", 5.0, 0.0, False),
])
def test_small_swings_are_drawn_large(tmp_path, shown, scene, angle, control, large):
    """The arc of the largest swing of all runs fits; a motor's torque and a moving pivot need the full circle."""
    film(scene, tmp_path / "x.mp4", "rk4,heun", duration=0.4, fps=10, angle=math.radians(angle), control=control,
         dt=0.02 if scene != "kapitza" else 0.001, warn=False)
    swings = {apparatus.swing for pairs in shown for apparatus, _ in pairs}
    angles = [abs(view.angle) for pairs in shown for _, view in pairs]
    assert swings == ({max(angles)} if large else {None})


@pytest.mark.usefixtures("interpreted")
def test_a_step_of_ones_own_is_filmed_beside_the_method_that_it_equals(tmp_path, shown):
    """The exercise's three lines are symplectic Euler, so both bobs move alike, each under its own name."""
    own = from_step("omega = omega + dt * acceleration(theta, omega)\ntheta = theta + dt * omega")
    film("exercise", tmp_path / "x.mp4", [own, "symplectic_euler", "forward_euler"], damping="none", duration=2.0,
         fps=10)
    captions = [view.caption for _, view in shown[0]]
    assert captions == [own.name, "symplectic_euler", "forward_euler"]
    assert own.name not in METHODS
    for first, same, other in shown[1:]:
        assert first[1].angle == pytest.approx(same[1].angle, abs=1e-12)
        assert first[1].angle != other[1].angle
    assert len(shown) == 20


@pytest.mark.usefixtures("interpreted")
def test_slow_motion_shows_the_motion_between_the_steps(tmp_path, shown):
    """Frames 1/240 s apart agree with the exact motion, though the scene's usual step is 10 ms."""
    film("vacuum", tmp_path / "x.mp4", duration=0.25, fps=60, slow=4, angle=1.0, velocity=0.5)
    times = np.arange(60) / 240
    angle, velocity = exact.pendulum(times, 1.0, 0.5, SCENES["vacuum"].omega0)
    assert SCENES["vacuum"].run.dt > 1 / 240
    for i, ((thing, view),) in enumerate(shown):
        assert view.time == pytest.approx(times[i], abs=1e-15)
        assert view.angle == pytest.approx(angle[i], abs=1e-7)
        assert view.velocity == pytest.approx(velocity[i], abs=1e-6)
        assert thing.title == "vacuum, 4 times slower"
    assert len(shown) == 60


@pytest.mark.usefixtures("interpreted")
@pytest.mark.parametrize(("fps", "slow", "dt"), [(50, 1, 0.05), (60, 4, 0.05), (24, 1.7, 0.013), (10, 1, 0.03)])
def test_slow_motion_changes_no_step(tmp_path, shown, fps, slow, dt):
    """Forward Euler has the same error at all frames per second: frames equal the run where they meet its steps."""
    film("vacuum", tmp_path / "x.mp4", "forward_euler", duration=1.0, fps=fps, slow=slow, dt=dt, angle=0.5)
    run = rollout("vacuum", integrator="forward_euler", duration=1.0 + dt, dt=dt, angle=0.5)
    met = 0
    for ((_, view),) in shown:
        step = round(view.time / dt)
        if abs(view.time - step * dt) < 1e-12:
            assert (view.angle, view.velocity) == pytest.approx((run.angle[step], run.velocity[step]), abs=1e-13)
            met += 1
        low = int(view.time / dt + 1e-9)
        assert abs(view.angle - np.interp(view.time, run.time, run.angle)) <= dt**2 * 4.0
        assert min(run.velocity[low:low + 2]) - 0.1 < view.velocity < max(run.velocity[low:low + 2]) + 0.1
    assert met > 1 or dt == 0.013


def test_between_states_nothing_overshoots_and_all_is_finite():
    zero, still = np.zeros(2), np.array([0.0, 1.0])
    ledger = SimpleNamespace(kinetic=np.array([1.0, math.inf]), potential=zero, heat=zero, work=zero,
                             residual=np.array([math.inf, -math.inf]))
    at = np.linspace(0.0, 1.5, 16)

    def seen(angle, velocity):
        return SimpleNamespace(time=still, angle=np.array(angle), velocity=np.array(velocity), ledger=ledger)

    series = films.at_times(seen([0.0, 0.1], [1.0, 0.0]), at, True)
    assert np.all(np.diff(series["angle"]) >= 0.0)
    assert np.all(series["angle"][10:] == 0.1)
    assert not any(np.isnan(values).any() for values in series.values())
    series = films.at_times(seen([0.0, 1e308], [1e308, -1e308]), at, True)
    assert np.isfinite(series["angle"]).all()


def test_energies_between_states_are_on_a_straight_line():
    at, names = np.linspace(0.0, 1.5, 16), ("kinetic", "potential", "heat", "work", "residual")
    ledger = SimpleNamespace(**dict.fromkeys(names, np.array([1.0, 3.0])))
    run = SimpleNamespace(time=np.array([0.0, 1.0]), angle=np.zeros(2), velocity=np.zeros(2), ledger=ledger)
    series = films.at_times(run, at, True)
    for name in names:
        np.testing.assert_allclose(series[name], np.minimum(1.0 + 2.0 * at, 3.0), rtol=1e-15)


@pytest.mark.usefixtures("interpreted")
@pytest.mark.parametrize(("theme", "dt"), [pytest.param("dark", 0.02, marks=pytest.mark.slow), ("light", 0.5)])
def test_a_films_frames_are_the_environments(tmp_path, monkeypatch, theme, dt):
    """At control steps, frames of a film and of an environment are equal in every pixel, also after more than 10 s."""
    taken = []
    monkeypatch.setattr(filming, "write_film", lambda path, frames, *_, **__: taken.extend(frames) or path)
    start = {"angle": 1.0, "velocity": 0.5}
    film("lab", tmp_path / "x.mp4", "rk4", duration=22 * dt, dt=dt / 8, fps=1 / dt, theme=theme,
         panels=tuple(PANELS), size=200, **start)
    env = gym.make("LabPendulum-v0", task="free", dt=dt, substeps=8, render_mode="rgb_array", render_size=200,
                   render_theme=theme, render_panels=tuple(PANELS))
    env.reset(seed=0, options=start)
    for i, image in enumerate(taken):
        if i:
            env.step(np.zeros(1, np.float32))
        if i % 7 == 0:
            np.testing.assert_array_equal(image, env.render())
    assert len(taken) == 22


@pytest.mark.usefixtures("interpreted")
def test_a_run_that_ends_early_stands_still_and_says_so(tmp_path, shown):
    path, stopped = film("exercise_large", tmp_path / "x.mp4", "forward_euler,rk4", dt=0.04, duration=4.0, fps=25)
    end = rollout("exercise_large", integrator="forward_euler", dt=0.04, duration=4.0).stop_time
    assert stopped == {"forward_euler": f"slack at {end:.3g} s"}
    assert 0.0 < end < 3.0
    assert len(shown) == 100
    for i, ((_, first), (_, second)) in enumerate(shown):
        assert second.time == i / 25
        assert not second.stopped
        assert first.stopped == (i / 25 > end)
        assert first.caption == ("forward_euler: slack" if first.stopped else "forward_euler")
    still = [first for (_, first), _ in shown if first.stopped]
    assert {(view.time, view.angle, view.trail) for view in still} == {(end, still[0].angle, still[0].trail)}
    assert len(still[0].trail) > 10
    alone = film("exercise_large", path, "forward_euler", dt=0.04, duration=4.0, fps=25, size=64)
    assert alone.stopped == stopped
    assert len(shown) == 100 + sum(not first.stopped for (_, first), _ in shown[:100]) + 1


@pytest.mark.usefixtures("interpreted")
def test_methods_have_the_colours_of_figures_and_scenes_their_own_names(tmp_path, shown):
    film("vacuum", tmp_path / "x.mp4", ["rk4", METHODS["heun"]], duration=0.02, slow=2)
    (drawn,) = {tuple((view.caption, view.accent, thing.title) for thing, view in each) for each in shown}
    tones = {name: colour(list(METHODS).index(name)) for name in ("rk4", "heun")}
    assert drawn == tuple((name, tone, "vacuum, dt = 0.01 s, 2 times slower") for name, tone in tones.items())
    shown.clear()
    film("vacuum", tmp_path / "x.mp4", ["symplectic_euler", "gauss4", "rk4", "midpoint"], duration=0.02)
    assert len({view.accent for _, view in shown[0]}) == 4
    shown.clear()
    short = SCENES["lab"].replace(length=0.2)
    film(["lab", short, "water"], tmp_path / "x.mp4", "rk4", duration=0.02)
    assert [(view.caption, view.accent, thing.title) for thing, view in shown[0]] == [
        (name, None, "dt = 0.01 s") for name in ("lab · rk4", "lab (2) · rk4", "water · rk4")]
    assert [thing.length for thing, _ in shown[0]] == [
        scene.body.length for scene in (SCENES["lab"], short, SCENES["water"])]


@pytest.mark.usefixtures("interpreted")
@pytest.mark.parametrize(("changes", "message"), [
    ({"theme": "drak"}, "There is no theme 'drak'; did you mean dark"),
    ({"panels": ("phsae",)}, "no panel in panels 'phsae'; did you mean phase"),
    ({"panels": ()}, "panels must be one or more"),
    ({"scenes": []}, "1 to 16 runs side by side, not 0"),
    ({"scenes": ["lab", "lab"]}, "rk4 is listed twice"),
    ({"scenes": ["lab", "lba"]}, "lba"),
    ({"integrators": "rk4,rk5"}, "rk5"),
    ({"integrators": TOO_MANY}, "1 to 16 runs side by side, not 17"),
    ({"fps": 1e-3}, "fps must be within 0.01 and 1000 1/s, not 0.001"),
    ({"fps": 60, "path": "x.gif"}, "A gif's fps must be 100/n.*not 60; the nearest: 50"),
    ({"path": "x.avi"}, r"must end in \.mp4 or \.gif, not 'x\.avi'"),
    ({"size": 20}, "size must be 50 to 8192"),
    ({"lenght": 0.5}, "did you mean length"),
])
def test_what_cannot_be_filmed_is_refused_before_anything_runs(tmp_path, monkeypatch, changes, message):
    def runs(*_, **__):
        raise AssertionError

    monkeypatch.setattr(filming, "track_of", runs)
    monkeypatch.chdir(tmp_path)
    given = {"scenes": "lab", "path": "x.mp4", "integrators": "rk4", **changes}
    with pytest.raises(ValueError, match=message):
        film(given.pop("scenes"), given.pop("path"), given.pop("integrators"), **given)
    assert issubclass(SceneError, ValueError)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.usefixtures("interpreted")
def test_the_command_films_scenes_and_methods_side_by_side(tmp_path):
    words = ["record", "--scene", "exercise_large,vacuum", "-i", "forward_euler", "--integrators", "rk4",
             "--dt", "0.04", "--duration", "3", "--fps", "5", "--size", "120", "--theme", "dark",
             "--panels", "apparatus, phase"]
    done = CliRunner().invoke(cli.app, [*words, "--out", str(tmp_path / "x.gif")])
    assert done.exit_code == 0, done.exception
    assert "exercise_large · forward_euler stopped early: slack at" in done.stdout
    (image, _), *rest = played(tmp_path / "x.gif")
    assert image.shape[1] == 240
    assert 240 + 0.4 * 120 < image.shape[0] < 240 + 0.4 * 120 + 60
    assert image.mean() < 80
    facts = json.loads(gif_blocks((tmp_path / "x.gif").read_bytes())[1])
    assert facts["Software"].startswith("lab-pendulum")
    assert json.loads(facts["method"]) == ["forward_euler", "rk4"] * 2
    assert [scene["name"] for scene in json.loads(facts["scene"])] == ["exercise_large"] * 2 + ["vacuum"] * 2
    assert json.loads(facts["dt"]) == 0.04
    assert rest


def test_the_help_names_every_theme_and_panel():
    hints = get_type_hints(record, include_extras=True)
    assert all(name in hints["theme"].__metadata__[0].help for name in THEMES)
    assert all(name in hints["panels"].__metadata__[0].help for name in PANELS)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals differ")
def test_ctrl_c_at_a_terminal_reaches_the_encoder_too_and_leaves_the_old_film(tmp_path):
    """Ctrl-C in a terminal interrupts all processes of its foreground group, so also ffmpeg."""
    old = tmp_path / "film.mp4"
    old.write_bytes(b"old")
    words = [sys.executable, "-m", "pendulum_env", "record", "--duration", "1000", "--out", str(old)]
    process = subprocess.Popen(words, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True,
                               start_new_session=True, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
    deadline = time.monotonic() + 60.0
    while time.monotonic() < deadline and not any(
            one.stat().st_size for one in tmp_path.iterdir() if one.name.startswith(".")):
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)
    _, output = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Interrupted" in output
    assert os.listdir(tmp_path) == ["film.mp4"]
    assert old.read_bytes() == b"old"


@pytest.mark.usefixtures("interpreted")
@pytest.mark.slow
def test_gymnasiums_recorder_films_an_episode_at_true_speed(tmp_path):
    env = gym.make("LabPendulum-v0", render_mode="rgb_array", render_size=100, dt=0.05, render_theme="dark",
                   render_panels=("apparatus", "phase"))
    env = gym.wrappers.RecordVideo(env, str(tmp_path / "films"), episode_trigger=lambda _: True, disable_logger=True)
    env.reset(seed=0)
    for _ in range(20):
        env.step(env.action_space.sample())
    env.close()
    (path,) = (tmp_path / "films").glob("*.mp4")
    count, seconds = lasts(path)
    assert count == 21
    assert abs(seconds - 20 * 0.05) <= 0.05 + 0.01  # ffmpeg reports hundredths of a second
