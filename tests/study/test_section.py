"""Tests of Poincaré sections, against closed forms and SciPy; doublings and attractors against published ones."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import Here, table
from scipy.integrate import solve_ivp

from pendulum_env import SCENES, Scene, SceneError, basins, rollout, section
from pendulum_env.common.results import write
from pendulum_env.physics.effects import LinearDrag, PeriodicTorque, SmallAngleGravity

PERIOD = 3.0 * math.pi
"""Period of the drive of the scene chaotic [s]."""
ACCURATE: dict[str, Any] = {"integrator": "dop853", "backend": "python"}


def peer(start: tuple[float, float], times: Any, strength: float = 1.5, **more: Any) -> Any:
    """Return SciPy's solution of theta'' = -sin(theta) - theta'/2 + strength cos(2t/3) (Baker & Gollub 1996)."""
    return solve_ivp(lambda t, y: (y[1], -math.sin(y[0]) - 0.5 * y[1] + strength * math.cos(2.0 * t / 3.0)),
                     (times[0], times[-1]), start, method="DOP853", rtol=1e-13, atol=1e-14, **more)


def apart(angle: Any, other: Any) -> Any:
    """Return the size of the difference of two angles, without whole turns."""
    return np.abs(np.remainder(np.asarray(angle) - other + math.pi, 2.0 * math.pi) - math.pi)


@pytest.mark.slow
def test_the_section_of_a_linear_oscillator_is_its_steady_state() -> None:
    """q = A cos(Omega t - delta), A = f/|w0² - Omega² + i gamma Omega| (Landau & Lifshitz, Mechanics, section 26)."""
    scene = Scene("linear", effects=(SmallAngleGravity(), LinearDrag(gamma=1.5), PeriodicTorque(
        drive_torque=0.4, drive_rate=2.0)))
    numbers = scene.coefficients
    response = numbers["drive_strength"] / complex(scene.omega0**2 - 4.0, 1.5 * 2.0)
    for phase in (0.0, 0.5 * math.pi):
        found = section(scene, phase=phase, runs=2, points=4, transient=20, steps=40, **ACCURATE)
        turned = response * complex(math.cos(phase), math.sin(phase))
        assert found.angle == pytest.approx([turned.real] * 4, abs=1e-12)
        assert found.velocity == pytest.approx([(2j * turned).real] * 4, abs=1e-12)
        assert found.drive == pytest.approx([phase] * 4, abs=1e-9)
        assert found.time == pytest.approx(math.pi * (np.array([20, 21, 20, 21]) + phase / (2.0 * math.pi)), rel=1e-13)


@pytest.mark.slow
def test_points_of_an_attractor_follow_each_other_as_scipy_says() -> None:
    found = section("chaotic", runs=3, points=9, transient=4, steps=100, **ACCURATE)
    for i in (0, 1, 3, 4, 6, 7):
        assert found.run[i] == found.run[i + 1]
        end = peer((found.angle[i], found.velocity[i]), (found.time[i], found.time[i] + PERIOD)).y[:, -1]
        assert found.time[i + 1] == pytest.approx(found.time[i] + PERIOD, rel=1e-13)
        assert apart(found.angle[i + 1], end[0]) < 1e-9
        assert found.velocity[i + 1] == pytest.approx(end[1], abs=1e-9)


@pytest.mark.parametrize(("event", "function", "direction"), [
    ("turning", lambda t, y: y[1], -1),
    pytest.param("bottom", lambda t, y: math.sin(0.5 * y[0]), 0, marks=pytest.mark.slow),
    pytest.param("top", lambda t, y: math.cos(0.5 * y[0]), 0, marks=pytest.mark.slow)])
def test_passages_are_the_events_of_scipy(event: str, function: Any, direction: int) -> None:
    function.direction = direction
    true = peer((0.2, 3.0), (0.0, 4 * PERIOD), events=function)
    times, states = true.t_events[0], true.y_events[0]
    upward = states[:, 1] > 0.0 if event != "turning" else np.ones(len(times), bool)
    found = section("chaotic", event=event, angle=0.2, velocity=3.0, runs=1, points=4, transient=0, steps=300,
                    **ACCURATE)
    assert len(found.time) == np.count_nonzero(upward) > 0
    assert found.time == pytest.approx(times[upward], abs=2e-9)
    assert apart(found.angle, states[upward, 0]).max() < 2e-9
    assert found.velocity == pytest.approx(states[upward, 1], abs=2e-8)
    assert found.drive == pytest.approx(np.remainder(times[upward] * 2.0 / 3.0, 2.0 * math.pi), abs=2e-9)


def test_runs_are_those_of_rollout_bit_for_bit() -> None:
    options: dict[str, Any] = {"dt": PERIOD / 50, "every": 50, "duration": 5 * PERIOD, "backend": "python"}
    found = section("chaotic", over={"gamma": [0.4, 0.5]}, points=6, transient=3, steps=50, backend="python")
    assert found.value.tolist() == [0.4] * 3 + [0.5] * 3
    for gamma in (0.4, 0.5):
        run, here = rollout("chaotic", gamma=gamma, **options), found.value == gamma
        assert found.velocity[here].tolist() == run.velocity[3:].tolist()
        assert apart(found.angle[here], run.angle[3:]).max() < 1e-14
    rates = section("chaotic", over={"drive_rate": [0.5, 0.8]}, points=4, transient=2, steps=50, backend="python")
    for rate in (0.5, 0.8):
        h = 2.0 * math.pi / rate / 50
        run = rollout("chaotic", drive_rate=rate, dt=h, every=50, duration=150 * h, backend="python")
        assert rates.velocity[rates.value == rate].tolist() == run.velocity[2:].tolist()


@pytest.mark.slow
def test_periods_double_where_taylor_says() -> None:
    """Taylor 2005, Classical Mechanics, section 12.4: 1.0663, 1.0793, 1.0821, 1.0827, with Feigenbaum's number 4.669.

    His units: omega = 2 pi, omega0 = 1.5 omega, beta = omega0/4, which in time units of 1/omega0 is the scene chaotic.
    """
    published = (1.0663, 1.0793, 1.0821, 1.0827)
    room = (3e-4, 2e-4, 1.2e-4, 6e-5)
    values = [value + sign * by for value, by in zip(published, room, strict=True) for sign in (-1, 1)]
    found = section("chaotic", over={"drive_torque": values}, points=40 * 8, transient=4000, angle=-0.5 * math.pi)
    counts = [found.repetitions()[value] for value in values]
    assert counts == [1, 2, 2, 4, 4, 8, 8, 16]


@pytest.mark.slow
@pytest.mark.parametrize(("scene", "states"), [
    ({"gamma": 0.2, "drive_torque": 2.0}, [[(-0.471, 2.037)], [(-0.477, -0.609)]]),
    ({"gamma": 0.2, "drive_torque": 1.66}, 3),
])
def test_attractors_of_the_forced_pendulum_are_the_published_ones(scene: Any, states: Any) -> None:
    """Grebogi, Ott & Yorke 1987, Science 238, 632: two fixed points; Kennedy & Yorke 1991, Physica D 51, 213: Wada."""
    found = basins("chaotic", drive_rate=1.0, size=24, velocities=(-2.0, 4.0), transient=150, steps=100, **scene)
    if isinstance(states, int):
        assert len(found.attractors) == states
        return
    assert [np.round(here, 2).tolist() for here in found.attractors] == [
        np.round(there, 2).tolist() for there in states]
    for start in ((5, 5), (20, 3), (11, 17)):
        end = peer_two(found.angle[start[1]], found.velocity[start[0]], 60 * 2.0 * math.pi)
        own = found.attractors[found.which[start] - 1][0]
        assert apart(own[0], end[0]) < 1e-3
        assert own[1] == pytest.approx(end[1], abs=1e-3)


def peer_two(angle: float, velocity: float, end: float) -> Any:
    """Return SciPy's final state of theta'' + 0.2 theta' + sin(theta) = 2 cos(t)."""
    return solve_ivp(lambda t, y: (y[1], -math.sin(y[0]) - 0.2 * y[1] + 2.0 * math.cos(t)), (0.0, end),
                     (angle, velocity), method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]


@pytest.mark.slow
def test_basins_of_a_motion_with_one_attractor_are_one() -> None:
    scene = Scene("linear", effects=(SmallAngleGravity(), LinearDrag(gamma=1.5), PeriodicTorque(
        drive_torque=0.4, drive_rate=2.0)))
    found = basins(scene, size=3, transient=10, steps=30, backend="python")
    assert found.which.tolist() == [[1] * 3] * 3
    assert len(found.attractors) == found.share(1) == 1
    fast = basins("chaotic", size=2, velocities=(1.0, 2.0), transient=0, steps=20, backend="python")
    assert fast.which.tolist() == [[0, 0], [0, 0]]
    assert fast.attractors == ()
    assert fast.velocity.tolist() == [1.25, 1.75]


@pytest.mark.parametrize(("options", "said"), [
    ({"scene": "lab"}, "A Poincaré section needs one drive, but the scene 'lab' has 0"),
    ({"event": "botom"}, "There is no event 'botom'; did you mean bottom"),
    ({"phase": 0.1}, "phase must be below 2 pi and a whole number of steps of 2 pi/200 rad"),
    ({"phase": 7.0}, "phase must be below 2 pi"),
    ({"phase": 0.5 * math.pi, "event": "bottom"}, "phase is for event 'period', but points are recorded at 'bottom'"),
    ({"over": {"drive_torque": []}}, "The values of drive_torque in over= must be one or more finite numbers"),
    ({"over": {"drive_torque": [1.0], "gamma": [1.0]}}, "over must be a dict of one parameter and its values"),
    ({"over": {"drive_torqe": [1.0, 1.1]}}, "drive_torqe"),
    ({"over": {"drive_rate": [1.0, 0.0]}}, "needs a drive in every run"),
    ({"over": {"gamma": [1.0]}, "runs": 3}, "over= takes one run for each value"),
    ({"gamma": [0.1, 0.2]}, "gamma must be one number; section"),
    ({"event": "top", "drive_torque": 0.01, "runs": 1, "points": 2, "transient": 0, "steps": 20},
     "There are no points: 0 of 1 runs ended early, and no other run has such a passage"),
    ({"points": 0}, "points must be a whole number from 1"),
    ({"scene": SCENES["chaotic"].replace(effects=[*SCENES["chaotic"].effects, {"effect": "coulomb_friction",
      "friction_torque": 0.1}]), "event": "bottom"},
     "A section where the pendulum passes an angle needs smooth torques"),
])
def test_bad_input_is_refused_in_a_sentence(options: dict[str, Any], said: str) -> None:
    with pytest.raises((SceneError, ValueError), match=said):
        section(**{"backend": "python", **options})


@pytest.mark.parametrize(("options", "said"), [
    ({"velocities": (2.0, 1.0)}, "velocities must be two numbers .rad/s., the lowest first, not 2 and 1"),
    ({"angles": 3.0}, "angles must be two numbers"), ({"scene": "vacuum"}, "needs one drive"),
    ({"size": 0}, "size must be a whole number"),
])
def test_bad_basins_are_refused_in_a_sentence(options: dict[str, Any], said: str) -> None:
    with pytest.raises(SceneError, match=said):
        basins(**{"backend": "python", **options})


def test_repetitions_are_of_stroboscopic_sections_over_a_parameter() -> None:
    found = section("chaotic", over={"drive_torque": [0.9, 1.15]}, points=70, transient=12, steps=24, backend="python")
    assert found.repetitions() == {0.9: 1, 1.15: 0}
    assert found.table.rows == (("0.9", "0.9", "1 period"), ("1.15", "1.15", "does not repeat"))
    with pytest.raises(SceneError, match="give over="):
        section("chaotic", runs=1, points=2, transient=0, steps=10, backend="python").repetitions()


@pytest.mark.slow
def test_an_interruption_leaves_files_as_they_were(tmp_path: Path) -> None:
    small: dict[str, Any] = {"runs": 2, "points": 4, "transient": 1, "steps": 20, "backend": "python"}
    write(section("chaotic", **small), tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert set(before) == {"section.png", "section.csv"}

    def stop(_done: float, _word: str) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write(section("chaotic", progress=stop, **small), tmp_path)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


SHORT = ("--transient", "1", "--steps-per-period", "20", "--points", "40")


@pytest.mark.slow
@pytest.mark.usefixtures("all_interpreted")
@pytest.mark.parametrize(("words", "stem", "columns", "rows"), [
    (["--event", "bottom"], "section", ["run", "time_s", "drive_phase_rad", "angle_rad", "velocity_rad_per_s"], None),
    (["--over", "drive_torque=0.9:1.0:2"], "bifurcation", ["drive_torque", "run", "time_s", "drive_phase_rad",
                                                          "angle_rad", "velocity_rad_per_s"], 40),
    (["--basins", "3", "--velocities=-1:1"], "basins", ["angle_rad", "velocity_rad_per_s", "attractor"], 9),
])
def test_the_command_writes_a_figure_and_a_table(
    words: list[str], stem: str, columns: list[str], rows: int | None, tmp_path: Path, run_here: Here
) -> None:
    short = SHORT[:4] if "--basins" in words else SHORT
    code, printed, said = run_here("section", *short, *words, "--set", "gamma=1.0", "--out", "x")
    assert code == 0, said
    assert "theta''" in printed
    assert {path.name for path in (tmp_path / "x").iterdir()} == {f"{stem}.png", f"{stem}.csv"}
    facts, written = table(tmp_path / "x" / f"{stem}.csv")
    assert "section" in facts["Command"]
    assert facts["Method"] == '"rk4"' or facts["Method"] == "rk4"
    assert list(written[0]) == columns
    assert rows is None or len(written) == rows


@pytest.mark.parametrize(("words", "said"), [
    (["--over", "drive_torque=1:2"], "--over needs name=first:last:count"),
    (["--over", "drive_torque=1:2:2.5"], "The count of --over must be a whole number"),
    (["--basins", "3", "--velocities", "1"], "--velocities needs lowest:highest"),
    (["--basins", "3", "--over", "gamma=1:2:3"], "--over and --basins cannot be combined"),
    (["--basins", "3", "--angle", "20"], "--angle and --basins cannot be combined"),
    (["--velocities", "1:2"], "--velocities is for --basins"),
])
def test_the_command_refuses_in_a_sentence(words: list[str], said: str, tmp_path: Path, run_here: Here) -> None:
    code, _, error = run_here("section", *words, "--out", "x")
    assert code == 2
    assert said in error
    assert not (tmp_path / "x").exists()
