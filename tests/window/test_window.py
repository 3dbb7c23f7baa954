"""Tests of render_mode="human" with an invisible video driver and a simulated clock: keys, mouse and timing."""

from __future__ import annotations

import copy
import json
import math
import pickle
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from fake_clock import DT, Clock, shown
from gymnasium.utils.env_checker import check_env
from gymnasium.utils.passive_env_checker import env_render_passive_checker
from PIL import Image

from pendulum_env import LabPendulumEnv, LabPendulumVectorEnv
from pendulum_env.engine.certificate import CertifiedMachine
from pendulum_env.engine.machine import ANGLE, INDEX, TURNS, TWO_PI, VELOCITY, Machine
from pendulum_env.physics.units import SceneError
from pendulum_env.render import View
from pendulum_env.render.view import between
from pendulum_env.window import live, screen
from pendulum_env.window.controls import (
    KEYS,
    SPEEDS,
    Controls,
    Grip,
    NewStep,
    PressWatch,
    Start,
    Switch,
    TakePicture,
    keys_in_words,
)
from pendulum_env.window.live import FRAME, LATE, FrameSchedule, Stopwatch

pygame = pytest.importorskip("pygame")


def post(env: Any, kind: int, **said: Any) -> None:
    pygame.event.post(pygame.event.Event(kind, window=env.window.screen.window, **said))


def press(env: Any, name: str, text: str = "", mod: int = 0) -> None:
    post(env, pygame.KEYDOWN, key=pygame.key.key_code(name), unicode=text, mod=mod)


def mouse(env: Any, kind: int, at: tuple[float, float], **said: Any) -> None:
    post(env, kind, pos=tuple(map(round, at)), **said)


def step(env: Any, push: float = 0.0) -> dict[str, Any]:
    info: dict[str, Any] = env.step(np.array([push], dtype=np.float32))[4]
    return info


def bare(info: dict[str, Any]) -> dict[str, Any]:
    """Return info without the entry that only windows add."""
    return {name: value for name, value in info.items() if name != "by_hand"}


def picture(env: Any) -> Any:
    return pygame.surfarray.array3d(env.window.screen.window.get_surface()).swapaxes(0, 1)


# --- the model alone ------------------------------------------------------------------------------------------------


def test_speeds_have_ends() -> None:
    controls = Controls()
    found = []
    for name in ["up", "up", *["down"] * 6]:
        controls.key(name)
        found.append(controls.rate)
    assert found == [2.0, 2.0, 1.0, 0.5, 0.25, 0.1, 0.1, 0.1]
    assert controls.status() == "speed 1/10"
    assert [rate for _, rate in SPEEDS] == [0.1, 0.25, 0.5, 1.0, 2.0]


@pytest.mark.parametrize(("typed", "degrees"), [
    ("30", 30.0), ("-12.5", -12.5), ("7,25", 7.25), (".5", 0.5), ("1-2", 12.0), ("--3", -3.0), ("1.2.3", 1.23),
    ("12<0", 10.0), ("x4", 4.0),
])
def test_typed_angles(typed: str, degrees: float) -> None:
    controls = Controls()
    controls.key("a", "a")
    for text in typed:
        assert controls.key("backspace" if text == "<" else text, "" if text == "<" else text) == []
    assert controls.key("return") == [Start(math.radians(degrees))]
    assert controls.typed == ""
    assert controls.key("enter") == []


def test_what_is_no_angle_is_said() -> None:
    controls = Controls()
    controls.key("a", "a")
    for text in "-.":
        controls.key(text, text)
    assert "Enter" in controls.status()
    assert controls.key("return") == []
    assert "is not a number of degrees" in controls.status()
    controls.key("h")
    assert controls.status() == ""
    controls.key("a", "a")
    for text in "1" * 100:
        controls.key(text, text)
    assert len(controls.typed) == 12
    controls.key("escape")
    assert (controls.typing, controls.typed, controls.listed) == (False, "", False)
    assert controls.key("return") == []


def test_letters_that_mean_something() -> None:
    controls = Controls()
    assert controls.key("tab") == [Switch(1)]
    assert controls.key("tab", shift=True) == [Switch(-1)]
    assert controls.key("r") == [Start()]
    controls.key("left")
    assert controls.push == -1.0
    controls.key("right")
    assert controls.push == 0.0
    controls.key_up("left")
    assert controls.push == 1.0
    controls.leave()
    assert controls.push == 0.0
    controls.key("space")
    assert controls.waits
    controls.key("s")
    assert not controls.waits
    controls.key("q")
    assert not controls.open


def test_digits_choose_methods_except_in_an_angle() -> None:
    """Check the keys 1 to 5 in the order of the issue; on French keyboards a digit needs Shift, and has its text."""
    methods = ["forward_euler", "backward_euler", "symplectic_euler", "velocity_verlet", "rk4"]
    controls = Controls()
    assert [controls.key(digit, digit) for digit in "12345"] == [[Switch(name)] for name in methods]
    for name, text in (("&", "1"), ("[1]", "1"), ("1", "")):
        assert controls.key(name, text, shift=name == "&") == [Switch("forward_euler")]
    assert controls.key("6", "6") == controls.key("0", "0") == []
    controls.key("a", "a")
    assert controls.key("4", "4") == controls.key("5", "5") == []
    assert controls.key("enter") == [Start(math.radians(45.0))]
    assert controls.key("4", "4") == [Switch("velocity_verlet")]


def test_one_table_of_keys_serves_all() -> None:
    """Check that each key of the table acts on controls alone, that none is named twice, and that help prints all."""
    names = [name for key in KEYS for name in key.names]
    assert len(names) == len(set(names))
    for name in names:
        for typing in (False, True):
            assert isinstance(Controls(typing=typing).key(name, name if len(name) == 1 else ""), list)
    for key in KEYS:
        assert f"{key.shown}: {key.does}" in keys_in_words()
    said = " ".join(key.shown for key in KEYS).replace(",", "").lower().split()
    assert {name for name in names if name not in "12345"} - {"return", "escape"} <= set(said)
    assert Controls().key("d") == [NewStep(0.5)]
    assert Controls().key("d", shift=True) == [NewStep(2.0)]
    assert (Controls().key("t"), Controls().key("p")) == ([PressWatch()], [TakePicture()])


def test_the_stopwatch_starts_stops_and_clears() -> None:
    watch = Stopwatch()
    assert watch.reading(3.0) == ""
    watch.press(3.0)
    assert watch.reading(4.25) == "stopwatch 1.25 s"
    watch.press(5.5)
    assert watch.reading(9.0) == "stopwatch 2.50 s"
    watch.press(9.0)
    assert watch.reading(9.5) == ""


GRIP = Grip((100.0, 100.0), (100.0, 180.0), 8.0)


def test_the_bob_can_be_taken_near_it() -> None:
    for x, taken in ((100.0, True), (119.0, True), (121.0, False)):
        assert bool(Controls().press(x, 180.0, 0.0, GRIP)) == taken
    assert Controls().press(100.0, 180.0, 0.0, None) == []
    assert Controls().move(1.0, 1.0, 0.0) == Controls().release(1.0, 1.0, 0.0) == []


@pytest.mark.parametrize(("wait", "velocity"), [(0.0, 5.0), (0.2, 0.0)])
def test_a_throw_has_the_mouse_s_angular_velocity(wait: float, velocity: float) -> None:
    """Check a throw with 5 rad/s across the top, where the angle jumps, and one with the mouse at rest."""
    controls = Controls()
    controls.press(100.0, 180.0, 0.0, GRIP)
    assert controls.waits
    for i in range(1, 61):
        angle = math.pi + 0.2 + 5.0 * (i / 60 - 1.0)
        found = controls.move(100.0 + 80.0 * math.sin(angle), 100.0 + 80.0 * math.cos(angle), i / 60)
        assert isinstance(found[0], Start)
        assert found[0].angle == pytest.approx(math.remainder(angle, 2 * math.pi), abs=1e-12)
    end = math.pi + 0.2
    (start,) = controls.release(100.0 + 80.0 * math.sin(end), 100.0 + 80.0 * math.cos(end), 1.0 + wait)
    assert isinstance(start, Start)
    assert start.velocity == pytest.approx(velocity, abs=1e-9)
    assert not controls.waits


def test_the_pace_keeps_up_and_does_not_catch_up() -> None:
    pace = FrameSchedule()
    times = [pace.frames(10.0 + 0.02 * i, 0.02) for i in range(50)]
    assert [round(frames[-1][1], 9) for frames in times] == [round(10.02 + 0.02 * i, 9) for i in range(50)]
    assert pace.frames(50.0, 0.02) == [(1.0, 50.02)]
    slow = FrameSchedule().frames(0.0, 0.2)
    assert [share for share, _ in slow] == pytest.approx([k / 12 for k in range(1, 13)])
    assert [due for _, due in slow] == pytest.approx([k / 60 for k in range(1, 13)])
    held = FrameSchedule()
    held.frames(0.0, 0.02)
    held.hold(0.05)
    assert held.frames(0.06, 0.02) == [(1.0, pytest.approx(0.07))]
    assert LATE > FRAME


@pytest.mark.parametrize("drawing", [0.03, 0.12])
def test_a_slow_computer_shows_fewer_frames_in_real_time(drawing: float) -> None:
    """Check steps of 10 ms with frames that take longer to draw: time stays real, and frames are as many as fit."""
    pace, now, drawn = FrameSchedule(), 5.0, 0
    for _ in range(1000):
        frames = pace.frames(now, 0.01)
        for _, due in frames:
            now = max(now, due) + drawing
            drawn += 1
    assert now - 5.0 == pytest.approx(10.0, abs=drawing)
    assert drawn == pytest.approx(10.0 / drawing, rel=0.35)


def test_of_short_steps_not_all_are_shown() -> None:
    pace = FrameSchedule()
    seen = [frames for i in range(1000) if (frames := pace.frames(0.001 * i, 0.001))]
    assert len(seen) == 60
    assert all(len(frames) == 1 and frames[0][0] == 1.0 for frames in seen)


# --- the window -----------------------------------------------------------------------------------------------------


def test_it_is_an_environment_as_gymnasium_wants_it(clock: Clock) -> None:
    env = gym.make("LabPendulum-v0", render_mode="human", backend="python", render_size=120)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check_env(env.unwrapped)
        env.reset(seed=0)
        assert env_render_passive_checker(env.unwrapped) is None
    assert [str(one.message) for one in caught] == []
    assert env.unwrapped.render_mode == "human"
    assert env.metadata["render_modes"] == ["rgb_array", "human"]
    assert env.render() is None  # type: ignore[func-returns-value]
    env.close()


def test_a_step_takes_its_time_on_the_clock(clock: Clock) -> None:
    env = shown()
    step(env)
    begin = clock.time
    for _ in range(25):
        step(env)
    assert clock.time - begin == pytest.approx(25 * DT, abs=1e-9)
    for name, rate in (("down", 0.5), ("down", 0.25), ("down", 0.1)):
        press(env, name)
        step(env)
        begin = clock.time
        for _ in range(5):
            step(env)
        assert clock.time - begin == pytest.approx(5 * DT / rate, abs=1e-9)
    for _ in range(4):
        press(env, "up")
    step(env)
    begin = clock.time
    step(env)
    assert clock.time - begin == pytest.approx(DT / 2, abs=FRAME)


def test_between_two_views_the_motion_is_the_cubic() -> None:
    """Check the interpolation: exact for cubic angles, linear for energies, and None stays None."""
    cubic = np.polynomial.Polynomial([0.3, -2.0, 1.5, 4.0])
    first, last = (View(time=t, angle=cubic(t), velocity=cubic.deriv()(t), kinetic=t, torque_share=share,
                        pivot=(0.0, 2.0 * t), trail=(0.1,) * round(10 * t))
                   for t, share in ((0.5, 0.1), (0.9, 0.4)))
    assert between(first, last, 1.0) is last
    for share in (0.0, 0.25, 0.5, 0.9):
        found, time = between(first, last, share), 0.5 + 0.4 * share
        for name, value in {"time": time, "angle": cubic(time), "velocity": cubic.deriv()(time), "kinetic": time,
                            "torque_share": 0.4, "pivot": (0.0, 2.0 * time)}.items():
            assert getattr(found, name) == pytest.approx(value, rel=1e-13)
        assert found.trail == first.trail
        assert found.residual is None


def test_slow_motion_shows_what_is_between_the_steps(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    env = shown()
    for _ in range(3):
        press(env, "down")
    step(env)
    seen: list[tuple[float, float]] = []
    own = live.frame

    def drawn(apparatus: Any, view: View, **more: Any) -> Any:
        seen.append((clock.time, view.time))
        return own(apparatus, view, **more)

    monkeypatch.setattr(live, "frame", drawn)
    begin = clock.time
    step(env)
    step(env)
    assert [time - begin for time, _ in seen] == pytest.approx([k / 60 for k in range(1, 25)])
    assert [time for _, time in seen] == pytest.approx([DT + k / 600 for k in range(1, 25)])
    assert seen[11][1] == 2 * DT
    later = env.get_state()
    env.reset()
    env.set_state(later)
    seen.clear()
    step(env)
    assert {time for _, time in seen} == {env.get_state()["state"][INDEX] * DT}


@pytest.mark.parametrize("speed", [1.0, 0.1])
def test_the_window_changes_nothing(clock: Clock, speed: float) -> None:
    env, unseen = shown(), LabPendulumEnv(scene="lab", task="free", backend="python", dt=DT)
    unseen.reset(seed=1, options={"angle": 0.5})
    env.window.controls.speed = [rate for _, rate in SPEEDS].index(speed)
    for i in range(8):
        push = math.sin(i)
        assert bare(step(env, push)) == step(unseen, push)


def test_the_frame_is_that_of_rgb_array(clock: Clock) -> None:
    """Check the frame above the status line; in slow motion the last frame of a step shows its end."""
    env, other = shown(), LabPendulumEnv(scene="lab", task="free", backend="python", dt=DT, render_size=300,
                                         render_mode="rgb_array")
    other.reset(seed=1, options={"angle": 0.5})
    for name in (None, "down"):
        if name:
            press(env, name)
        step(env, 0.3)
        step(other, 0.3)
        frame = other.render()
        np.testing.assert_array_equal(picture(env)[:300], frame)
        assert picture(env).shape[0] > 300


def test_a_pause_holds_time_until_it_ends(clock: Clock) -> None:
    env = shown()
    step(env)
    before = env.get_state()["state"]
    press(env, "space")
    seen: list[bool] = []
    clock.plan = [lambda: seen.append(env.get_state()["state"] == before)] * 30 + [lambda: press(env, "space")]
    begin = clock.time
    info = step(env)
    assert seen == [True] * 30
    assert clock.time - begin == pytest.approx(31 * FRAME + DT, abs=1e-9)
    assert info["time"] == pytest.approx(2 * DT)
    assert info["by_hand"] == ""


def test_the_keys_of_info_do_not_depend_on_the_step(clock: Clock) -> None:
    env = LabPendulumEnv(scene="lab", task="free", backend="python", dt=DT, render_mode="human", render_size=120)
    _, first = env.reset(seed=1)
    assert first["by_hand"] == ""
    press(env, "r")
    infos = [first, *(step(env) for _ in range(3))]
    assert [info["by_hand"] for info in infos] == ["", "start", "", ""]
    assert len({tuple(info) for info in infos}) == 1


def test_single_steps_take_one_control_step_each(clock: Clock) -> None:
    env, unseen = shown(), LabPendulumEnv(scene="lab", task="free", backend="python", dt=DT)
    unseen.reset(seed=1, options={"angle": 0.5})
    press(env, "space")
    for _ in range(3):
        clock.plan = [lambda: None] * 4 + [lambda: press(env, "s")]
        begin = clock.time
        assert bare(step(env)) == step(unseen)
        assert clock.time - begin == pytest.approx(5 * FRAME + DT, abs=1e-9)
    for _ in range(2):
        press(env, "s")
    begin = clock.time
    assert [bare(step(env)), bare(step(env))] == [step(unseen), step(unseen)]
    assert clock.time - begin < 2 * DT + 1e-9
    assert env.window.controls.waits


@pytest.mark.parametrize("angle", [0.0, 0.7, -2.0, 3.0])
def test_a_dragged_bob_is_at_the_mouse_s_angle(clock: Clock, angle: float) -> None:
    env = shown(render_size=500)
    step(env, 0.5)
    grip = env.window.grip()
    x, y = (round(place + 150 * turned) for place, turned in zip(grip.pivot, (math.sin(angle), math.cos(angle)),
                                                                  strict=True))
    wanted = math.atan2(x - grip.pivot[0], y - grip.pivot[1])
    seen: list[tuple[float, float, float]] = []

    def look() -> None:
        state = env.get_state()["state"]
        seen.append((state[ANGLE] + TWO_PI * state[TURNS], state[VELOCITY], state[INDEX] * DT))

    mouse(env, pygame.MOUSEBUTTONDOWN, grip.bob, button=1)
    mouse(env, pygame.MOUSEMOTION, (x, y), rel=(0, 0), buttons=(1, 0, 0))
    clock.plan = [look] * 8 + [lambda: mouse(env, pygame.MOUSEBUTTONUP, (x, y), button=1)]
    info = step(env, 0.7)
    assert env.get_state()["action"] == pytest.approx(0.7)
    assert seen == [(pytest.approx(wanted, abs=1e-15), 0.0, 0.0)] * 8
    assert info["by_hand"] == "start"
    other = LabPendulumEnv(scene="lab", task="free", backend="python", dt=DT)
    other.reset(seed=1, options={"angle": wanted})
    assert bare(info) == step(other, 0.7)
    assert step(env)["by_hand"] == ""


def test_a_bob_let_go_in_motion_keeps_it(clock: Clock) -> None:
    env = shown(render_size=500)
    grip = env.window.grip()
    angles = [0.5 + 0.05 * i for i in range(8)]
    places = [(grip.pivot[0] + 150 * math.sin(angle), grip.pivot[1] + 150 * math.cos(angle)) for angle in angles]
    mouse(env, pygame.MOUSEBUTTONDOWN, grip.bob, button=1)
    clock.plan = [lambda at=at: mouse(env, pygame.MOUSEMOTION, at, rel=(0, 0), buttons=(1, 0, 0)) for at in places]
    clock.plan.append(lambda: mouse(env, pygame.MOUSEBUTTONUP, places[-1], button=1))
    step(env)
    assert env.window.start["angle"] == pytest.approx(angles[-1], abs=0.01)
    assert env.window.start["velocity"] == pytest.approx(0.05 / FRAME * 6 / 7, rel=0.2)


def test_a_bob_is_let_go_where_another_window_comes_in_front(clock: Clock) -> None:
    env = shown(render_size=500)
    mouse(env, pygame.MOUSEBUTTONDOWN, env.window.grip().bob, button=1)
    clock.plan = [lambda: None, lambda: post(env, pygame.WINDOWFOCUSLOST)]
    assert step(env)["time"] == pytest.approx(DT)
    mouse(env, pygame.MOUSEMOTION, (10, 10), rel=(0, 0), buttons=(0, 0, 0))
    assert step(env)["by_hand"] == ""


def test_a_press_beside_the_bob_does_nothing(clock: Clock) -> None:
    env = shown()
    grip = env.window.grip()
    mouse(env, pygame.MOUSEBUTTONDOWN, grip.pivot, button=1)
    mouse(env, pygame.MOUSEBUTTONDOWN, grip.bob, button=3)
    mouse(env, pygame.MOUSEMOTION, (10, 10), rel=(0, 0), buttons=(1, 0, 0))
    assert step(env)["by_hand"] == ""
    phase = shown(render_panels=("phase",))
    assert phase.window.grip() is None
    mouse(phase, pygame.MOUSEBUTTONDOWN, (150, 150), button=1)
    assert step(phase)["by_hand"] == ""


def test_a_typed_angle_starts_there_and_r_again(clock: Clock) -> None:
    env = shown()
    step(env)
    for text in "a-20.5":
        press(env, text, text)
    press(env, "return")
    info = step(env)
    other = LabPendulumEnv(scene="lab", task="free", backend="python", dt=DT)
    other.reset(options={"angle": math.radians(-20.5)})
    wanted = {**step(other), "by_hand": "start"}
    assert info == wanted
    step(env)
    press(env, "r")
    assert step(env) == wanted
    for text in "a99999999999":
        press(env, text, text)
    press(env, "return")
    assert step(env)["by_hand"] == ""
    assert "angle must be between" in env.window.controls.status()


def machine_of(env: Any, more: dict[str, Any]) -> Machine:
    """Return the machine of an environment with these keywords, for the names of its state."""
    asked = more.get("diagnostics", ("energy",))
    kind = CertifiedMachine if "error" in asked else Machine
    return kind(env.scene, env.integrator, asked, "python", more.get("rtol"), None,
                more.get("compensated", False), env.substeps)


def recorded(env: Any, more: dict[str, Any]) -> tuple[str, ...]:
    """Return the names of the numbers of a state that do not depend on the method."""
    machine = machine_of(env, more)
    return tuple(machine.names[: machine.width])


@pytest.mark.quick("lab-more0", "sticky_bearing-more3")
@pytest.mark.parametrize(("scene", "more"), [
    ("lab", {"diagnostics": ("heat_by_effect", "tension")}), ("textbook", {}), ("windy", {}), ("sticky_bearing", {}),
    ("lab", {"compensated": True}), ("lab", {"integrator": "dopri5", "rtol": 1e-6}),
    ("vacuum", {"diagnostics": ("energy", "error")}),
    *(pytest.param(*more, marks=pytest.mark.slow) for more in (
        ("lab", {}), ("kapitza", {}), ("exercise", {}), ("exercise", {"integrator": "velocity_verlet"}),
        ("vacuum", {"integrator": "velocity_verlet"}), ("lab", {"diagnostics": ()}))),
])
def test_another_integrator_goes_on_from_the_same_bits(clock: Clock, scene: str, more: dict[str, Any]) -> None:
    """Check for every method that a change keeps state and energies, and that the next step is the new method's."""
    env = shown(scene=scene, substeps=2, render_size=120, **more)
    for i in range(5):
        step(env, math.sin(i))
    for _ in range(5):
        before = dict(zip(recorded(env, more), env.get_state()["state"], strict=False))
        own = env.integrator
        press(env, "tab")
        env.window.attend()
        assert env.integrator != own
        assert dict(zip(recorded(env, more), env.get_state()["state"], strict=False)) == before
        assert env.get_state()["state"][machine_of(env, more).names.index("initial")] > 0.0
        info = step(env, 0.5)
        assert info["by_hand"] == "integrator"
        if "energy_residual" in info:
            assert abs(info["energy_residual"]) < 0.2 * info["energy"]
    press(env, "tab", mod=pygame.KMOD_SHIFT)
    last = env.integrator
    step(env)
    press(env, "tab")
    step(env)
    assert env.integrator == last


@pytest.mark.parametrize(("scene", "integrator", "more"), [
    ("vacuum", "velocity_verlet", {}), ("exercise", "velocity_verlet", {}), ("lab", "dopri5", {}),
    ("driven", "dopri5", {}), ("kapitza", "velocity_verlet", {}), ("windy", "dopri5", {}),
    ("sticky_bearing", "dopri5", {}), ("lab", "dopri5", {"compensated": True}),
    ("vacuum", "velocity_verlet", {"diagnostics": ("energy", "error")}),
])
def test_there_and_back_is_as_if_nothing_was(
    clock: Clock, scene: str, integrator: str, more: dict[str, Any]
) -> None:
    """Check that changing the method and back restarts its history with equal values, up to rounding of the time."""
    options = {"scene": scene, "integrator": integrator, "substeps": 3, "render_size": 120, **more}
    env, twin = shown(**options), shown(**options)
    for one in (env, twin):
        for i in range(4):
            step(one, 0.1 * i)
    press(env, "tab")
    press(env, "tab", mod=pygame.KMOD_SHIFT)
    found, wanted = step(env, 0.3), bare(step(twin, 0.3))
    assert found.pop("by_hand") == "integrator"
    if "error_estimate" in found:
        assert (found.pop("error_estimate"), math.isfinite(wanted.pop("error_estimate"))) == (math.inf, True)
    assert found.pop("stop_reason") == wanted.pop("stop_reason") == ""
    driven = scene in ("driven", "kapitza")
    assert found == (pytest.approx(wanted, rel=1e-11, abs=1e-14) if driven else wanted)
    assert env.get_state()["made_for"] == twin.get_state()["made_for"]


@pytest.mark.parametrize("more", [{}, {"rtol": 1e-12}, {"compensated": True}])
def test_a_new_method_is_the_method_of_that_name(clock: Clock, more: dict[str, Any]) -> None:
    """Check that, in a scene independent of time, the next step is that of an environment which starts there."""
    env = shown(scene="vacuum", integrator="dopri5" if "rtol" in more else "rk4", render_size=120, **more)
    for _ in range(5):
        before, state = step(env), env.get_state()["state"]
        lost = state[machine_of(env, more).names.index("lost_q")] if "compensated" in more else 0.0
        press(env, "tab")
        found = step(env)
        fresh = LabPendulumEnv(scene="vacuum", task="free", backend="python", dt=DT, integrator=env.integrator, **more)
        fresh.reset(options={name: before[name] for name in ("angle", "velocity")})
        wanted = step(fresh)
        if lost:
            assert found["angle"] == pytest.approx(wanted["angle"], rel=1e-14)
        else:
            assert (found["angle"], found["velocity"]) == (wanted["angle"], wanted["velocity"])
        assert found["time"] == pytest.approx(before["time"] + DT)


def test_a_state_is_of_the_method_that_runs(clock: Clock) -> None:
    env = shown()
    unseen = {name: LabPendulumEnv(scene="lab", task="free", backend="python", dt=DT, integrator=name)
              for name in ("rk4", "rk4_38")}
    press(env, "tab")
    step(env, 0.5)
    assert env.integrator == "rk4_38"
    with pytest.raises(SceneError, match="another integrator"):
        unseen["rk4"].set_state(env.get_state())
    unseen["rk4_38"].set_state(env.get_state())
    assert step(unseen["rk4_38"], 0.5) == bare(step(env, 0.5))


def test_where_no_other_method_fits_it_says_so(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    env = shown()
    monkeypatch.setattr("pendulum_env.envs.switch.fitting", lambda scene: {})
    press(env, "tab")
    assert step(env)["by_hand"] == ""
    assert env.window.controls.status() == "no other integrator fits the scene"


def test_a_digit_changes_to_its_method_without_a_wait(clock: Clock) -> None:
    env = shown(integrator="rk4")
    for digit, name in zip("12345", ("forward_euler", "backward_euler", "symplectic_euler", "velocity_verlet", "rk4"),
                           strict=True):
        press(env, digit, digit)
        assert step(env)["by_hand"] == "integrator"
        assert env.integrator == name
    press(env, "5", "5")
    assert step(env)["by_hand"] == ""
    assert env.window.controls.status() == "rk4 already runs"


def test_a_method_that_does_not_fit_is_named_with_the_reason(clock: Clock) -> None:
    env = shown(integrator="dopri5", rtol=1e-6)
    press(env, "1", "1")
    assert step(env)["by_hand"] == ""
    assert env.integrator == "dopri5"
    assert "forward_euler" in env.window.controls.status()


def test_the_step_of_an_environment_stays(clock: Clock) -> None:
    env = shown()
    press(env, "d")
    assert step(env)["time"] == pytest.approx(DT)
    assert "lab-pendulum show" in env.window.controls.status()


def test_a_saved_picture_is_the_window_s_with_its_provenance(
    clock: Clock, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Check the file with Pillow: the pixels of the window, the scene and the method; a second picture has a name."""
    monkeypatch.setattr("sys.argv", ["lab-pendulum", "show", "--note=Ω ж"])
    env = shown(integrator="symplectic_euler")
    env.window.folder = tmp_path / "new"
    step(env)
    press(env, "p")
    env.window.attend()
    press(env, "p")
    env.window.attend()
    files = sorted((tmp_path / "new").iterdir())
    assert [file.name for file in files] == ["lab_symplectic_euler_0.02s.png", "lab_symplectic_euler_0.02s_2.png"]
    assert env.window.controls.message == f"saved {files[1]}"
    with Image.open(files[0]) as found:
        facts = found.text
        env.window.controls.message = ""
        env.window.look()
        np.testing.assert_array_equal(np.asarray(found), picture(env))
    assert json.loads(facts["scene"]) == env.scene.to_dict()
    assert (facts["method"], float(facts["dt"]), float(facts["time"])) == ("symplectic_euler", DT, DT)
    assert float(facts["start_angle"]) == 0.5
    assert facts["Software"].startswith("lab-pendulum ")
    assert facts["Command"] == "lab-pendulum show '--note=Ω ж'"  # outside Latin-1


def test_a_picture_that_cannot_be_written_is_said(clock: Clock, tmp_path: Path) -> None:
    env = shown()
    (tmp_path / "file").write_text("kept")
    env.window.folder = tmp_path / "file"
    press(env, "p")
    step(env)
    assert "cannot be written" in env.window.controls.status()
    assert (tmp_path / "file").read_text() == "kept"


# --- the end of windows ---------------------------------------------------------------------------------------------


def no_window(env: Any, kind: str) -> None:
    if kind == "key":
        press(env, "q")
    elif kind == "cross":
        post(env, pygame.WINDOWCLOSE)
    else:
        pygame.quit()


@pytest.mark.parametrize("kind", ["key", "cross", "pygame.quit"])
@pytest.mark.parametrize("paused", [False, True])
def test_a_closed_window_stays_closed_and_nothing_waits(clock: Clock, kind: str, paused: bool) -> None:
    env = shown()
    if paused:
        press(env, "space")
        clock.plan = [lambda: no_window(env, kind)]
    else:
        no_window(env, kind)
    step(env)
    assert not env.window.open
    sleeps = clock.sleeps
    with pytest.warns(UserWarning, match="window was closed") as caught:
        step(env)
    assert caught[0].filename == __file__
    for _ in range(3):
        step(env)
    env.reset()
    env.render()
    assert clock.sleeps == sleeps
    assert env.window.screen is None
    env.close()


def test_close_closes_and_a_reset_opens_again(clock: Clock) -> None:
    env = shown()
    assert len(screen.OPEN) == 1
    env.close()
    env.close()
    assert screen.OPEN == []
    env.reset()
    assert len(screen.OPEN) == 1
    step(env)


def test_two_windows_hear_what_is_theirs(clock: Clock) -> None:
    one, two = shown(), shown(scene="vacuum")
    press(two, "space")
    press(one, "down")
    step(one)
    assert (one.window.controls.rate, one.window.controls.paused) == (0.5, False)
    clock.plan = [lambda: press(one, "down"), lambda: press(two, "s")]
    step(two)
    assert (two.window.controls.rate, two.window.controls.paused) == (1.0, True)
    step(one)
    assert one.window.controls.rate == 0.25
    post(one, pygame.WINDOWCLOSE)
    step(one)
    assert (one.window.open, two.window.open) == (False, True)
    (left,) = screen.OPEN
    assert left is two.window.screen
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    step(two)
    assert not two.window.open


@pytest.mark.parametrize("size", [(640, 400), (240, 700), (300, 241), (60, 60)])
def test_a_frame_is_drawn_as_large_as_the_window(clock: Clock, size: tuple[int, int]) -> None:
    env = shown()
    env.window.screen.window.size = size
    step(env)
    seen = picture(env)
    assert seen.shape[1::-1] == env.window.screen.size == tuple(max(side, least) for side, least in zip(
        size, screen.LEAST, strict=True))
    other = LabPendulumEnv(scene="lab", task="free", backend="python", dt=DT, render_mode="rgb_array",
                           render_size=env.window.size)
    other.reset(options={"angle": 0.5})
    step(other)
    wanted: Any = other.render()
    rows = min(len(wanted), len(seen))
    np.testing.assert_array_equal(seen[:rows], wanted[:rows])
    assert rows >= min(50, size[1])


def test_the_list_of_keys_comes_and_goes(clock: Clock) -> None:
    env = shown()
    press(env, "space")
    step_pictures: list[Any] = []
    clock.plan = [lambda: step_pictures.append(picture(env)), lambda: press(env, "h"), lambda: None,
                  lambda: step_pictures.append(picture(env)), lambda: press(env, "h"), lambda: None,
                  lambda: step_pictures.append(picture(env)), lambda: press(env, "space")]
    step(env)
    first, listed, last = step_pictures
    np.testing.assert_array_equal(first, last)
    assert (first != listed).any(axis=2).mean() > 0.05


def test_keys_let_go_while_another_window_is_in_front(clock: Clock) -> None:
    env = shown()
    press(env, "right")
    step(env)
    assert env.window.push == 1.0
    post(env, pygame.WINDOWFOCUSLOST)
    step(env)
    assert env.window.push == 0.0
    press(env, "left")
    post(env, pygame.KEYUP, key=pygame.K_RIGHT)
    step(env)
    assert env.window.push == -1.0


def test_copies_have_windows_of_their_own(clock: Clock) -> None:
    env = shown()
    step(env)
    for other in (copy.deepcopy(env), pickle.loads(pickle.dumps(env))):
        assert step(other) == step(copy.deepcopy(env))
        assert other.window.screen is not env.window.screen
        other.close()


def test_an_action_that_is_refused_waits_for_nothing(clock: Clock) -> None:
    env = shown()
    press(env, "space")
    sleeps = clock.sleeps
    with pytest.raises(ValueError, match="action"):
        step(env, math.nan)
    assert clock.sleeps == sleeps


def test_an_interruption_ends_a_pause(clock: Clock) -> None:
    env = shown()

    def interrupt() -> None:
        raise KeyboardInterrupt

    press(env, "space")
    clock.plan = [lambda: None, interrupt]
    with pytest.raises(KeyboardInterrupt):
        step(env)
    press(env, "space")
    assert step(env)["time"] == pytest.approx(DT)


def test_a_vector_has_no_window() -> None:
    with pytest.raises(SceneError, match="render_tiles"):
        LabPendulumVectorEnv(2, render_mode="human")
    modes = ["rgb_array", "rgb_array_list"]
    assert LabPendulumVectorEnv.metadata["render_modes"] == modes
    assert LabPendulumVectorEnv(2, backend="python").metadata["render_modes"] == modes


UNSEEN = """
import os, sys
for name in ("SDL_VIDEODRIVER", "DISPLAY", "WAYLAND_DISPLAY"): os.environ.pop(name, None)
if sys.argv[1:]: os.environ["SDL_VIDEODRIVER"] = sys.argv[1]
from pendulum_env import LabPendulumEnv
for mode in (None, "rgb_array"):
    env = LabPendulumEnv(render_mode=mode, backend="python"); env.reset(); env.step([0.0]); env.close()
assert "pygame" not in sys.modules and "pendulum_env.window.live" not in sys.modules
env = LabPendulumEnv(render_mode="human", backend="python")
assert "pygame" not in sys.modules
for _ in range(2):
    try: env.reset()
    except RuntimeError as error: print(type(error).__name__, error)
env.close()
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="other systems have a display")
@pytest.mark.parametrize(("driver", "said"), [
    ("", "UserWarning: There is no display"),
    ("wayland", "WindowError render_mode='human' cannot open a window here"),
    ("nothing", "WindowError render_mode='human' cannot open a window here"), ("dummy", ""), ("offscreen", ""),
])
def test_without_a_display_it_says_what_to_do(driver: str, said: str) -> None:
    """Check the warning of an invisible driver; an environment without a window needs no display."""
    result = subprocess.run([sys.executable, "-c", UNSEEN, *([driver] if driver else [])], capture_output=True,
                            text=True, check=True)
    lines = [line for line in (result.stdout + result.stderr).splitlines() if "human" in line or "display" in line]
    assert len(lines) == (2 if "Error" in said else bool(said))
    for line in lines:
        assert said in line
        assert "use render_mode='rgb_array', or set SDL_VIDEODRIVER=dummy" in line


@pytest.mark.slow
def test_the_compiled_backend_switches_too(clock: Clock) -> None:
    env, twin = shown(backend="compiled", render_size=120), shown(render_size=120)
    for _ in range(3):
        for one in (env, twin):
            press(one, "tab")
        assert step(env, 0.5) == step(twin, 0.5)
