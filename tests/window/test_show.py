"""Tests of ``lab-pendulum show`` with an invisible video driver: keys are posted, states and frames read back."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import Here
from fake_clock import Clock
from PIL import Image
from readme_code import READMES

from pendulum_env import SCENES, LabPendulumEnv, rollout
from pendulum_env.controllers import load
from pendulum_env.engine import kernels
from pendulum_env.engine.machine import Machine
from pendulum_env.envs import switch
from pendulum_env.render.notes import Sheet
from pendulum_env.window import live, screen
from pendulum_env.window.controls import KEYS, METHOD_KEYS

pygame = pytest.importorskip("pygame")
pytestmark = pytest.mark.usefixtures("all_interpreted")

Steps = list[tuple[LabPendulumEnv, float, dict[str, Any]]]
Windows = list[live.Live]


def key(name: str, down: bool = True, shift: bool = False) -> Callable[[], None]:
    """Return a function that sends a key to the only open window."""

    def post() -> None:
        (window,) = screen.OPEN
        code = pygame.key.key_code(name)
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN if down else pygame.KEYUP, key=code, window=window.window,
                                             mod=pygame.KMOD_SHIFT if shift else 0))

    return post


def point(x: float, y: float) -> Callable[[], None]:
    """Return a function that moves the mouse in the only open window."""

    def post() -> None:
        (window,) = screen.OPEN
        pygame.event.post(pygame.event.Event(pygame.MOUSEMOTION, pos=(round(x), round(y)), rel=(0, 0),
                                             buttons=(0, 0, 0), window=window.window))

    return post


def nothing() -> None:
    pass


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch) -> Steps:
    """Return the environment, the action and the info of each step."""
    found: Steps = []
    own = LabPendulumEnv.step

    def step(env: Any, action: Any) -> Any:
        result = own(env, action)
        found.append((env, float(action[0]), result[4]))
        return result

    monkeypatch.setattr(LabPendulumEnv, "step", step)
    return found


@pytest.fixture
def windows(monkeypatch: pytest.MonkeyPatch) -> Windows:
    """Return the windows that were made."""
    found: Windows = []
    own = live.Live.restart

    def restart(window: live.Live, *start: Any) -> None:
        if window not in found:
            found.append(window)
        own(window, *start)

    monkeypatch.setattr(live.Live, "restart", restart)
    return found


def test_settings_of_environments_may_be_set(clock: Clock, run_here: Here, steps: Steps) -> None:
    clock.plan = [nothing, nothing, key("q")]
    code, _, wrong = run_here("show", "--set", "action_noise=0.2", "--set", "length=0.5", "--window", "200",
                              "--angle", "0", "--dt", "0.02")
    assert code == 0, wrong
    assert {(env.action_noise, env.length, push) for env, push, _ in steps} == {(0.2, 0.5, 0.0)}
    assert steps[-1][2]["angle"] != 0.0  # moved by the noise alone
    code, _, wrong = run_here("show", "--set", "action_nois=0.2")
    assert code == 2
    assert "action_nois" in wrong


def test_the_arrow_keys_push(clock: Clock, run_here: Here, steps: Steps) -> None:
    clock.plan = [nothing, key("right"), nothing, key("right", False), nothing, key("q")]
    code, said, wrong = run_here("show", "--angle", "0", "--window", "200", "--dt", "0.02")
    assert (code, said) == (0, "")
    assert "Error" not in wrong
    pushes = [push for _, push, _ in steps]
    assert sorted(set(pushes)) == [0.0, 1.0]
    assert pushes[0] == pushes[-1] == 0.0
    assert steps[0][2]["angle"] == 0.0
    assert steps[-1][2]["angle"] > 0.0
    assert screen.OPEN == []


def test_a_policy_catches_the_bob_until_a_person_pushes(clock: Clock, run_here: Here, steps: Steps) -> None:
    """Check the actions against those in an environment of the task, and the motion against the top."""
    clock.plan = [nothing] * 80 + [key("left")] + [nothing] * 10 + [key("q")]
    code, said, wrong = run_here("show", "--policy", "swing_up", "--angle", "168", "--velocity", "0", "--window", "200")
    assert (code, said) == (0, ""), wrong
    policy, env, taken = load("swing_up"), LabPendulumEnv(task="swing_up", backend="python"), [*steps]
    seen, _ = env.reset(options={"angle": math.radians(168.0), "velocity": 0.0})
    for shown, push, info in taken[:60]:
        action = policy(seen)
        seen, *_, wanted = env.step(action)
        assert (shown.dt, push, info["angle"]) == (0.02, action[0], wanted["angle"])
    assert abs(taken[60][2]["angle"] - math.pi) < 0.1
    assert [push for _, push, _ in taken[-5:]] == [-1.0] * 5
    assert taken[-1][2]["angle"] < taken[-8][2]["angle"]


def test_a_policy_starts_as_its_task_does_and_needs_a_motor(clock: Clock, run_here: Here, steps: Steps) -> None:
    clock.plan = [nothing] * 3 + [key("q")]
    assert run_here("show", "--policy", "balance", "--window", "200", "-i", "rk4,heun")[0] == 0
    assert {env.task.name for env, _, _ in steps} == {"balance"}
    assert {env.integrator for env, _, _ in steps} == {"rk4", "heun"}
    assert all(abs(info["angle"] - math.pi) < 0.15 for _, _, info in steps)
    clock.plan = [nothing] * 3 + [key("q")]
    assert run_here("show", "--policy", "track", "--window", "200")[0] == 0
    assert steps[-1][0].task.name == "track"
    for words, told in ((["--policy", "swingup"], "did you mean swing_up?"),
                        (["--policy", "swing_up", "--scene", "vacuum"], "'vacuum' has no motor"),
                        (["--policy", "swing_up", "--set", "observation=angle"], "leave --set observation out")):
        code, _, wrong = run_here("show", *words)
        assert code == 2
        assert told in wrong


@pytest.mark.slow
def test_methods_side_by_side_start_together_and_follow_their_own_method(
    clock: Clock, run_here: Here, steps: Steps
) -> None:
    """Check every pendulum against a rollout of its method: one clock, one start, one step."""
    names = ["forward_euler", "symplectic_euler", "rk4"]
    clock.plan = [nothing] * 20 + [key("q")]
    code, _, _ = run_here("show", "--scene", "vacuum", "-i", ",".join(names), "--angle", "46", "--dt", "0.02",
                          "--window", "600x400")
    assert code == 0
    for name in names:
        own = [info for env, _, info in steps if env.integrator == name]
        wanted = rollout("vacuum", integrator=name, angle=math.radians(46), velocity=SCENES["vacuum"].run.velocity,
                         dt=0.02, duration=0.02 * len(own), backend="python")
        assert len(own) > 15
        np.testing.assert_array_equal([info["angle"] for info in own], wanted.angle[1:])
        np.testing.assert_array_equal([info["time"] for info in own], wanted.time[1:])


@pytest.mark.slow
def test_the_methods_of_the_keys_are_ready_before_the_window_opens(
    clock: Clock, run_here: Here, monkeypatch: pytest.MonkeyPatch, steps: Steps
) -> None:
    """Check that each program has run, which compiles it, before the window opens; and that the keys run it later."""
    compiled: list[tuple[str, int]] = []
    own = Machine.__init__

    def made(machine: Machine, *arguments: Any, **more: Any) -> None:
        own(machine, *arguments, **more)
        entry, name = machine.entry, machine.method.name

        def run(*numbers: Any) -> Any:
            compiled.append((name, len(screen.OPEN)))
            return entry(*numbers)

        machine.entry = machine.direct = run

    monkeypatch.setattr(Machine, "__init__", made)
    clock.plan = [key(digit) for digit in "12345"] + [nothing, key("q")]
    assert run_here("show", "--window", "200", "--dt", "0.02")[0] == 0
    assert list(dict.fromkeys(env.integrator for env, _, _ in steps[:1])) == ["rk4"]
    assert {name for name, windows in compiled if not windows} == set(METHOD_KEYS.values())
    assert {name for name, windows in compiled if windows} == set(METHOD_KEYS.values())


@pytest.mark.slow
def test_a_key_never_waits_for_the_compiler(
    clock: Clock, run_here: Here, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Check with numba: a method of a key is compiled when its key is pressed, any other one is interpreted."""
    monkeypatch.setenv("LAB_PENDULUM_BACKEND", "compiled")
    monkeypatch.setenv("LAB_PENDULUM_CACHE", str(tmp_path))
    kernels.forget()  # no other test has compiled any
    monkeypatch.setattr(import_module("pendulum_env.cli.show"), "METHOD_KEYS", {"5": "rk4"})
    taken: list[tuple[str, bool, bool]] = []

    def carried(old: Machine, values: Any, machine: Machine, *more: Any) -> Any:
        taken.append((machine.method.name, machine.ready, machine.compiled))
        return switch.carried(old, values, machine, *more)

    monkeypatch.setattr("pendulum_env.envs.env.carried", carried)
    clock.plan = [key("5"), nothing, key("4"), nothing, key("q")]
    run_here("show", "--scene", "vacuum", "-i", "symplectic_euler", "--dt", "0.02", "--window", "200")
    assert taken == [("rk4", True, True), ("velocity_verlet", True, False)]


@pytest.mark.slow
def test_digits_choose_the_method_under_the_mouse(clock: Clock, run_here: Here, steps: Steps) -> None:
    """Check three pendulums in a row: a digit changes that under the mouse, and without a mouse the first."""
    clock.plan = [nothing, key("2"), nothing, point(550, 100), key("1"), nothing, nothing, key("q")]
    run_here("show", "-i", "forward_euler,symplectic_euler,rk4", "--dt", "0.02", "--window", "600x400")
    envs = list(dict.fromkeys(env for env, _, _ in steps))
    assert [env.integrator for env in envs] == ["backward_euler", "symplectic_euler", "forward_euler"]


@pytest.mark.slow
def test_d_halves_the_step_and_restarts(clock: Clock, run_here: Here, steps: Steps, windows: Windows) -> None:
    clock.plan = [nothing] * 4 + [key("d"), nothing, nothing, key("d", shift=True), nothing,
                                  key("d", shift=True), nothing, key("q")]
    run_here("show", "-i", "forward_euler,rk4", "--angle", "30", "--dt", "0.02", "--window", "400x300")
    runs = [[(env.dt, info["time"]) for env, _, info in steps if env is one]
            for one in dict.fromkeys(env for env, _, _ in steps)]
    assert [run[0][0] for run in runs] == [0.02, 0.02, 0.01, 0.01, 0.02, 0.02, 0.04, 0.04]
    for run in runs:
        assert [time for _, time in run] == pytest.approx([dt * (n + 1) for n, (dt, _) in enumerate(run)])
    assert windows[0].start["angle"] == pytest.approx(math.radians(30.0))


@pytest.mark.slow
def test_a_step_too_long_or_too_short_stays(clock: Clock, run_here: Here, windows: Windows) -> None:
    said: list[str] = []
    for dt, shift, frames in (("0.0000501", False, 2), ("0.9", True, 80)):
        clock.plan = [key("d", shift=shift), *[nothing] * frames, lambda: said.append(windows[-1].controls.message),
                      key("q")]
        run_here("show", "--dt", dt, "--window", "200", "--scene", "vacuum")
    assert said == ["dt stays 5.01e-05 s: here it can be 5e-05 to 1 s.", "dt stays 0.9 s: here it can be 5e-05 to 1 s."]


@pytest.mark.slow
def test_the_stopwatch_counts_the_pendulum_s_time(clock: Clock, run_here: Here, windows: Windows) -> None:
    """Check a stop after 10 steps in slow motion: the reading is the time of the pendulum, and a restart clears it."""
    read: list[str] = []

    def look() -> None:
        read.append(windows[0].watch.reading(99.0))

    clock.plan = [key("space"), key("t"), *([key("s"), nothing] * 10), key("t"), nothing, look, key("r"), nothing, look,
                  key("q")]
    run_here("show", "--dt", "0.02", "--window", "200")
    assert read == ["stopwatch 0.20 s", ""]


def test_a_picture_is_saved_in_the_folder_asked_for(
    clock: Clock, run_here: Here, tmp_path: Path
) -> None:
    clock.plan = [key("p"), nothing, key("q")]
    run_here("show", "-i", "rk4,heun", "--dt", "0.02", "--window", "400x300", "--out", str(tmp_path / "shots"))
    (file,) = (tmp_path / "shots").iterdir()
    with Image.open(file) as found:
        assert found.size == (400, 300)
        assert json.loads(found.text["method"]) == ["rk4", "heun"]
        assert json.loads(found.text["scene"])["name"] == "lab"
        assert found.text["dt"] == "0.02"


@pytest.mark.slow
def test_a_run_that_ends_begins_again_in_a_pause(clock: Clock, run_here: Here, steps: Steps) -> None:
    clock.plan = [nothing] * 60 + [key("q")]
    code, printed, wrong = run_here("show", "--scene", "vacuum", "--damping", "linear:gamma=100", "--integrators",
                              "forward_euler", "--dt", "0.1", "--velocity", "1", "--window", "200")
    assert (code, wrong) == (0, "")
    assert "forward_euler stopped at " in printed
    ended = next(i for i, (_, _, info) in enumerate(steps) if info["stop_reason"])
    assert [info["time"] for _, _, info in steps[ended + 1:]] == [0.1]


@pytest.mark.slow
def test_beside_a_run_that_ended_the_others_go_on(clock: Clock, run_here: Here, steps: Steps, windows: Windows) -> None:
    stopped: list[list[bool]] = []
    clock.plan = [nothing] * 60 + [lambda: stopped.append([view.stopped for view in windows[0].drawn]), key("q")]
    run_here("show", "--scene", "vacuum", "--damping", "linear:gamma=100", "-i", "forward_euler,backward_euler",
             "--dt", "0.1", "--velocity", "1", "--window", "400x300")
    last = {env.integrator: info for env, _, info in steps}
    assert last["forward_euler"]["stop_reason"]
    assert last["backward_euler"]["stop_reason"] == ""
    assert last["backward_euler"]["time"] > last["forward_euler"]["time"] + 0.1
    assert stopped == [[True, False]]


@pytest.mark.parametrize(("words", "said"), [
    (("--theme", "drak"), "dark"), (("--panels", "apparatus,phse"), "phase"), (("--window", "3"), "--window"),
    (("--window", ""), "1600x900"),
    (("--window", "800y600"), "1600x900"), (("--integrators", "rk5"), "rk4"), (("--panels", ""), "panel"),
    (("-i", "rk4,rk4"), "twice"), (("-i", "rk4,heun,midpoint,dopri5,rk4_38,dop853,bs3"), "1 to 6"),
])
def test_what_cannot_be_is_refused(run_here: Here, words: tuple[str, ...], said: str) -> None:
    code, _, wrong = run_here("show", *words)
    assert code == 2
    assert wrong.startswith("Error: ")
    assert said in wrong
    assert screen.OPEN == []


def test_it_needs_a_display(clock: Clock, run_here: Here, monkeypatch: pytest.MonkeyPatch) -> None:
    screen.seen()  # opens the display with SDL_VIDEODRIVER=dummy, which conftest sets
    monkeypatch.setattr(screen, "UNSEEN", ("dummy",))
    monkeypatch.setenv("SDL_VIDEODRIVER", "")
    code, _, wrong = run_here("show")
    assert code == 2
    assert "There is no display" in wrong


def test_help_lists_every_key(run_here: Here) -> None:
    lines = [line.strip() for line in run_here("show", "--help")[1].splitlines()]
    for one in KEYS:
        assert f"{one.shown}: {one.does}" in lines


# --- type that the back row can read ----------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [1, 2, 3, 4, 6])
@pytest.mark.parametrize("size", [(800, 600), (1600, 900), (1280, 1024), (1920, 1080)])
def test_the_type_grows_with_the_window_and_leaves_room_for_the_pendulums(size: tuple[int, int], count: int) -> None:
    """Check sizes of type against the height of the picture.

    dt and the readings of up to three pendulums are at least 1/30 of the height, twice the 1/60 that a text needs at
    a distance of six heights (letters of 10 minutes of arc). Frames keep half the height of their panel.
    """
    sheet = Sheet(*size, count, 2 if count == 1 else 3)
    assert sheet.status_font >= size[1] / 30
    assert sheet.reading_font >= size[1] / (30 if count <= 3 else 40)
    assert sheet.frame[1] >= 0.5 * sheet.panel[1]
    places = [sheet.corner(place) for place in range(count)]
    assert len(set(places)) == count
    for place, (x, y) in enumerate(places):
        assert x + sheet.panel[0] <= size[0]
        assert y + sheet.panel[1] <= size[1] - sheet.status_height
        assert sheet.place(x + 1, y + 1) == place


def test_the_readme_lists_every_key() -> None:
    page = READMES["pendulum_env/envs/README.md"]
    table = page.partition("<!-- keys -->\n")[2].partition("\n<!-- end -->")[0]
    assert table.splitlines()[2:] == [f"| {one.shown} | {one.does} |" for one in KEYS]
