"""Tests of the tour: its numbers, its layout at 80 columns, and interruptions."""

from __future__ import annotations

import json
import math
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from command_line import Here
from matplotlib.figure import Figure
from PIL import Image

import pendulum_env
from pendulum_env import SCENES, controllers
from pendulum_env.cli.demo import WIDTH
from pendulum_env.physics import exact
from pendulum_env.study import demo as tour
from pendulum_env.study.demo import DT, HELD, NEAR, SIZE, Chapter, Swung, demo, draw, pictures, swung_up

NAMES = ("exercise", "accuracy", "effects", "recording", "swinging")


def silent(done: float, what: str) -> None:
    assert 0.0 <= done <= 1.0
    assert what


@pytest.fixture(scope="module")
def run() -> Swung:
    return swung_up(backend="python")


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Replace the chapters by short ones that write a tiny file; return the list of chapters that ran."""
    told: list[str] = []

    def chapter(name: str) -> Any:
        def made(place: Path, tell: Any, backend: str, film: bool = True) -> Chapter:
            tell(0.0, name)
            tell(1.0, name)
            told.append(f"{name} {film}")
            path = place / f"{name}.txt"
            path.write_text(name)
            return Chapter(name.title(), f"{name} " * 30 + "\n  a row  1\n" + "last.", (path,))
        return made

    for name in NAMES:
        monkeypatch.setattr(tour, name, chapter(name))
    return told


@pytest.mark.slow
def test_euler_methods_are_told_by_the_closed_form(tmp_path: Path) -> None:
    chapter = tour.exercise(tmp_path, silent, "python")
    omega0 = SCENES["exercise"].omega0
    for name, word in (("forward_euler", "explodes"), ("backward_euler", "dies")):
        factor = exact.euler_energy_factor(omega0, 0.01, name, 1000)
        assert f"{name:17} {word}: {factor:.3g} times" in chapter.text
    ratio = float(re.search(r"symplectic_euler  holds: (\S+) times", chapter.text)[1])  # type: ignore[index]
    assert abs(ratio - 1.0) < omega0 * 0.01
    (path,) = chapter.files
    assert Image.open(path).text["Title"] == "exercise"  # type: ignore[attr-defined]


def test_verdicts() -> None:
    assert [tour.ratio_text(value).split(":")[0] for value in (16.0, 2.0, 1.0, 0.5, 0.06)] == [
        "explodes", "holds", "holds", "holds", "dies"]


def test_prices_are_the_cheapest_that_are_accurate_enough() -> None:
    class Point:
        def __init__(self, error: float, ns: float) -> None:
            self.angle_error, self.ns_per_second = error, ns

    class Study:
        reference = type("Reference", (), {"error_estimate": 1e-9})

        def of(self, method: str) -> list[Point]:
            return [Point(1e-2, 900.0), Point(1e-4, 2600.0), Point(1e-6, 26_000.0), Point(2e-6, 3.1e6)]

    said = [tour.price_text(Study(), "rk4", error) for error in (0.1, 1e-3, 1e-5, 1e-6)]  # type: ignore[arg-type]
    assert said == ["900 ns", "2.6 µs", "26 µs", "-"]


@pytest.mark.slow
def test_the_swing_is_that_of_the_environment(run: Swung) -> None:
    env = gym.make("LabPendulum-v0", dt=DT, backend="python", max_episode_steps=10_000)
    observation, info = env.reset(seed=0, options={"angle": 0.0, "velocity": 0.0})
    controller = controllers.swing_up(env)
    for i in range(len(run.states) - 1):
        action = controller(observation)
        assert action[0] == run.shares[i]
        observation, _, terminated, _, info = env.step(action)
        assert not terminated
        assert (info["angle"], info["work"]) == (run.angle[i + 1], run.ledger.work[i + 1])


def test_the_swing_ends_upright(run: Swung) -> None:
    off = np.abs(np.remainder(run.angle, 2.0 * math.pi) - math.pi)
    assert np.all(off[run.time >= run.settled - 1e-9] < NEAR)
    assert off[run.time < run.settled - 1e-9][-1] >= NEAR
    assert run.time[-1] - run.settled == pytest.approx(HELD - DT)
    scene = SCENES["lab"]
    assert run.weight_torque == pytest.approx(scene.body.mass * scene.gravity * scene.body.length)
    assert run.motor_torque < run.weight_torque
    assert run.swings >= 1


def test_the_figure_shows_angle_torque_and_ledger_over_time(run: Swung) -> None:
    turned, pushed, joules = draw(run).axes
    ledger = run.ledger
    drawn = ((turned, [np.degrees(run.angle)]), (pushed, [run.shares]),
             (joules, [1e3 * (ledger.energy - ledger.energy[0]), 1e3 * ledger.work, 1e3 * ledger.heat]))
    for axes, wanted in drawn:
        for line, values in zip(axes.lines, wanted, strict=False):
            np.testing.assert_array_equal(line.get_xdata(), run.time)
            np.testing.assert_array_equal(line.get_ydata(), values)
    assert [line.get_label() for line in joules.lines] == ["energy", "work", "heat"]


@pytest.mark.slow
def test_a_swing_that_never_settles_says_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    short_one = swung_up(longest=1.0, backend="python")
    assert math.isinf(short_one.settled)
    monkeypatch.setattr("pendulum_env.study.demo.swung_up", lambda **_: short_one)
    with pytest.raises(pendulum_env.SceneError, match="did not swing the bob up within 1 s"):
        tour.swinging(tmp_path, silent, "python", film=False)


def test_frames_show_the_swing(run: Swung) -> None:
    shown = [next(pictures(Swung(run.machine, run.states[i:i + 1], run.shares[i:i + 1], 0.0))) for i in (0, 150)]
    assert all(picture.shape == (SIZE[1], SIZE[0], 3) for picture in shown)
    assert (shown[0] != shown[1]).any()


def test_the_command_reads_well(short: list[str], run_here: Here, tmp_path: Path) -> None:
    code, printed, said = run_here("demo", "--no-film", "--out", "d")
    assert code == 0, said
    assert short == [f"{name} {name != 'swinging'}" for name in NAMES]
    assert max(map(len, printed.splitlines())) <= WIDTH
    assert "  a row  1\n" in printed
    for i, name in enumerate(NAMES, 1):
        assert f"\n{i}. {name.title()}\n" in f"\n{printed}"
        assert f"Wrote d/{name}.txt" in printed.replace("\\", "/")
    assert printed.endswith("Further commands: lab-pendulum help\n")


def test_an_interruption_leaves_what_was_told(short: list[str], tmp_path: Path) -> None:
    def stop(done: float, what: str) -> None:
        if what == "effects":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        list(demo(tmp_path, progress=stop))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["accuracy.txt", "exercise.txt"]


def test_an_interrupted_figure_leaves_the_old_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    (tmp_path / "exercise.png").write_bytes(b"old")
    monkeypatch.setattr(Figure, "savefig", stop)
    with pytest.raises(KeyboardInterrupt):
        next(demo(tmp_path, backend="python"))
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"exercise.png": b"old"}


def test_progress_goes_forwards(short: list[str], tmp_path: Path) -> None:
    seen: list[float] = []
    list(demo(tmp_path, progress=lambda done, what: seen.append(done)))
    assert seen[0] == 0.0
    assert seen[1:-1:2] == seen[2:-1:2]
    assert seen[1::2] == sorted(set(seen[1::2]))
    assert seen[-1] == 1.0


@pytest.mark.slow
def test_the_whole_tour(tmp_path: Path) -> None:
    """Run the whole tour with its film in a process without a display."""
    environment = {key: value for key, value in os.environ.items() if key != "DISPLAY"}
    done = subprocess.run([sys.executable, "-W", "error", "-W", "ignore::DeprecationWarning", "-m", "pendulum_env",
                           "demo", "--out", "d"], cwd=tmp_path,
                          capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    assert max(map(len, done.stdout.splitlines())) <= 80
    names = {path.name for path in (tmp_path / "d").iterdir()}
    assert names == {"exercise.png", "accuracy.png", "effects.png", "fit.png", "swing_up.png", "swing_up.mp4"}
    assert all(name in done.stdout for name in names)
    for name in names - {"swing_up.mp4"}:
        facts = Image.open(tmp_path / "d" / name).text  # type: ignore[attr-defined]
        assert "demo" in facts["Command"]
        assert json.loads(facts["scene"])
    for what, true in (("length", 0.353), ("gamma", 0.03)):
        value, error = map(float, re.search(rf"{what} +(\S+) ± (\S+) ", done.stdout).groups())  # type: ignore[union-attr]
        assert abs(value - true) < 4.0 * error
    words = " ".join(done.stdout.split())
    assert re.search(r"rms, the error of a reading \S+°\. .* lab-pendulum exercise --recording FILE\.", words)
    assert re.search(r"buoyancy .* matters\n", done.stdout)
    assert re.search(r"finite_bob .* negligible\n", done.stdout)
    rows = dict(re.findall(r"^  (symplectic_euler|rk4|dop853) +(.*)$", done.stdout.split("What accuracy costs")[1],
                           flags=re.M))
    assert rows["symplectic_euler"].count("-") == 2
    assert rows["dop853"].count("-") == 0
    from imageio_ffmpeg import count_frames_and_secs

    settled = float(re.search(r"upright from (\S+) s on", done.stdout)[1])  # type: ignore[index]
    _, seconds = count_frames_and_secs(str(tmp_path / "d" / "swing_up.mp4"))
    assert seconds == pytest.approx(settled + HELD, abs=2.5 * DT + 0.05)
