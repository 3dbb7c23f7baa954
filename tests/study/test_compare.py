"""Tests of comparisons: runs, drift table, figures, tables and film."""

from __future__ import annotations

import contextlib
import csv
import json
import math
import subprocess

import gymnasium
import numpy as np
import pytest
from choice import EVERYWHERE
from matplotlib.colors import to_hex
from scipy.interpolate import CubicHermiteSpline
from typer.testing import CliRunner

from integrators import METHODS, MethodError
from pendulum_env import LabPendulumVectorEnv, cli, cost, film, growth
from pendulum_env.common.provenance import OutputError
from pendulum_env.engine import timing
from pendulum_env.engine.machine import Machine
from pendulum_env.engine.rollout import rollout
from pendulum_env.lab import Recording
from pendulum_env.physics import exact
from pendulum_env.physics.effects import LinearDrag
from pendulum_env.physics.presets import SCENES
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError
from pendulum_env.render import FrameStyle, colour
from pendulum_env.study.compare import Comparison, amplitude_and_phase, compare, files, true_motion, write
from pendulum_env.study.compare import comparison as comparing
from pendulum_env.truth import reference as truths

pytestmark = pytest.mark.usefixtures("all_interpreted")

SHEET = "forward_euler,backward_euler,symplectic_euler,velocity_verlet,rk4"
FIGURES = ("angle", "velocity", "phase", "energy")


@pytest.fixture(scope="module")
def exercise():
    return compare("exercise", SHEET, damping="none", dt=0.01, duration=10.0)


def row(comparison, method):
    return next(entry for entry in comparison.drift if entry.method.startswith(method))


# --- physics --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["forward_euler", "backward_euler"])
def test_euler_changes_the_energy_by_exactly_its_factor_in_every_step(exercise, method):
    run, h = exercise.runs[method], exercise.dt
    spring = run.scene.gravity / run.scene.body.length
    factor = (1.0 + spring * h * h) ** (1 if method == "forward_euler" else -1)
    steps = run.energy[1:] / run.energy[:-1]
    np.testing.assert_allclose(steps, factor, rtol=1e-15)
    assert len(steps) == 1000
    assert run.energy[-1] / run.energy[0] == pytest.approx(factor**1000, rel=2e-13)
    assert row(exercise, method).energy_end == pytest.approx(factor**1000 - 1.0, rel=2e-13)


def eigenvalue(method, z):
    """Return growth factor and angle of one step with omega0 h = z on the oscillator, computed from the method."""
    cosine = 1.0 - z * z / 2.0
    number = {
        "forward_euler": 1.0 + 1j * z,
        "backward_euler": 1.0 / (1.0 - 1j * z),
        "symplectic_euler": cosine + 1j * math.sqrt(1.0 - cosine * cosine),
        "velocity_verlet": cosine + 1j * math.sqrt(1.0 - cosine * cosine),
        "rk4": 1.0 + 1j * z - z * z / 2.0 - 1j * z**3 / 6.0 + z**4 / 24.0,
    }[method]
    return abs(number), math.atan2(number.imag, number.real)


@pytest.mark.parametrize("method", SHEET.split(","))
def test_amplitude_and_phase_errors_are_those_of_the_methods_eigenvalues(exercise, method):
    omega0, h = exercise.scene.omega0, exercise.dt
    growth, turn = eigenvalue(method, omega0 * h)
    omega, found = turn / h, row(exercise, method)
    # crossings of cos(omega t) and cos(omega0 t) at (k + 1/2) pi; symplectic Euler starts half a step off
    early = 0.5 * h if method == "symplectic_euler" else 0.0
    last = math.floor(min(omega, omega0) * 10.0 / math.pi - 0.5)
    crossed = (last + 0.5) * math.pi / omega - early
    assert found.phase == pytest.approx((last + 0.5) * math.pi - omega0 * crossed, rel=5e-3, abs=2e-8)
    crest = last * math.pi / omega / h
    start = 1.0 / math.cos(0.5 * turn) if early else 1.0
    assert found.amplitude == pytest.approx(start * growth**crest - 1.0, rel=6e-3, abs=1e-12)


def test_the_leading_error_term_predicts_the_table(exercise):
    assert row(exercise, "velocity_verlet").leading_error.endswith("frequency: +(omega0 h)^2/24 of its value")
    predicted = (exercise.scene.omega0 * 0.01) ** 2 / 24.0 * exercise.scene.omega0 * 10.0
    assert row(exercise, "velocity_verlet").phase == pytest.approx(predicted, rel=0.06)


def test_runs_are_those_of_rollout(exercise):
    for name, run in exercise.runs.items():
        alone = rollout("exercise", integrator=name, duration=10.0)
        np.testing.assert_array_equal(run.angle, alone.angle)
        np.testing.assert_array_equal(run.energy, alone.energy)


@pytest.mark.parametrize("shift", [-0.7, 0.3, 40.0])
def test_errors_of_shifted_and_scaled_swings(shift):
    time = np.arange(4001) * 0.01
    wanted = 2.0 * math.pi
    rate = wanted + shift / 40.0
    amplitude, phase = amplitude_and_phase(time, 1.01 * np.cos(rate * time), np.cos(wanted * time))
    assert amplitude == pytest.approx(0.01, rel=1e-7)
    last = math.floor(min(rate, wanted) * 40.0 / math.pi - 0.5)
    assert phase == pytest.approx(shift / 40.0 * (last + 0.5) * math.pi / rate, rel=1e-5)


def test_there_is_no_error_where_none_makes_sense():
    time = np.arange(1001) * 0.01
    true = np.cos(2.0 * math.pi * time)
    nothing = (None, None)
    assert amplitude_and_phase(time, true, true) == (0.0, 0.0)
    assert amplitude_and_phase(time[:95], true[:95], true[:95]) == nothing
    assert amplitude_and_phase(time[:135], true[:135], true[:135]) == (0.0, 0.0)
    assert amplitude_and_phase(time, true, np.full_like(true, math.nan)) == nothing
    assert amplitude_and_phase(time[::40], true[::40], true[::40]) == nothing
    assert amplitude_and_phase(time, 0.3 * time, true) == nothing
    over = np.where(time < 3.0, true, true[300] + 5.0 * (time - 3.0))
    assert amplitude_and_phase(time, over, true) == nothing
    rest = np.where(time < 3.0, true, 0.1)
    assert amplitude_and_phase(time, rest, rest) == nothing
    assert amplitude_and_phase(time[:1], true[:1], true[:1]) == nothing


# --- truth ----------------------------------------------------------------------------------------------------------


def test_closed_forms_are_the_truth_where_there_are_any(exercise):
    time = np.arange(101) * 0.02
    angle, _ = exact.pendulum(time, 1.0, 0.5, SCENES["vacuum"].omega0)
    np.testing.assert_array_equal(true_motion(SCENES["vacuum"], 1.0, 0.5, time).angle, angle)
    assert "closed form" in exercise.truth.how
    assert exercise.truth.error < 1e-12


@pytest.mark.slow
def test_the_numerical_truth_agrees_with_an_integration_of_the_written_equation():
    from scipy.integrate import solve_ivp

    scene, time = SCENES["lab"], np.arange(151) * 0.02
    c, spring = scene.coefficients["quadratic_drag_rate"], scene.gravity / scene.body.length

    def rates(_, y):
        return [y[1], -spring * math.sin(y[0]) - 0.02 * y[1] - c * abs(y[1]) * y[1]]

    found = true_motion(scene, 0.5, 0.0, time)
    other = solve_ivp(rates, (0.0, 3.0), [0.5, 0.0], "DOP853", time, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(found.angle, other.y[0], rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(found.velocity, other.y[1], rtol=0.0, atol=1e-9)
    assert found.error < 1e-10
    assert "confirmed" in found.how


@pytest.mark.slow
def test_two_solutions_that_disagree_are_no_truth(monkeypatch):
    honest = truths.reference

    def wrong(scene, angle, velocity, time):
        return honest(scene, angle + 1e-4, velocity, time)

    monkeypatch.setattr(truths, "reference", wrong)
    found = compare("lab", ["rk4"], duration=3.0)
    assert not found.truth.known
    assert "differ by" in found.truth.how
    assert found.drift[0].amplitude is None
    assert found.table.rows[0][3:5] == ("-", "-")


def test_the_truth_ends_where_a_wire_goes_slack():
    scene = SCENES["exercise_large"].with_effects(SCENES["vacuum"].effects)
    time = np.arange(101) * 0.01
    found = true_motion(scene, 0.5, 8.9, time)
    height = np.cos(found.angle)
    tension = 8.9**2 - scene.omega0**2 * (2.0 * math.cos(0.5) - 3.0 * height)
    assert np.isfinite(found.angle).any()
    assert np.isnan(found.angle).any()
    assert np.nanmin(tension) > 0.0
    assert np.isfinite(true_motion(scene.replace(suspension="rod"), 0.5, 8.9, time).angle).all()


# --- the table ------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_with_losses_the_energy_columns_are_the_ledgers_residual(exercise):
    assert exercise.energy_name == "relative energy error"
    damped = compare("exercise_large", "velocity_verlet,rk4", duration=3.0)
    assert damped.energy_name == "ledger residual / E0"
    assert "ledger residual / E0, end" in damped.table.head
    assert list(damped.runs) == ["velocity_verlet + exact drag flow", "rk4"]
    for entry, run in zip(damped.drift, damped.runs.values(), strict=True):
        relative = run.energy_residual / run.energy[0]
        assert entry.energy_end == relative[-1]
        assert entry.energy_most == np.abs(relative).max()
        assert abs(run.energy[-1] / run.energy[0] - 1.0) > 30 * entry.energy_most
    assert all(len(cells) == len(damped.table.head) for cells in damped.table.rows)
    assert compare("exercise", "rk4", angle=0.0, duration=0.5).drift[0].energy_end is None


def test_a_step_is_timed_warm_and_over_the_steps_it_took(monkeypatch):
    ticks, events = iter([0, 900e-9, 1000e-9, 1400e-9] * 10), []

    def clock():
        events.append("clock")
        return next(ticks)

    monkeypatch.setattr(timing, "perf_counter", clock)
    machine = Machine(SCENES["exercise"], "rk4", backend="python")
    advance = machine.advance
    machine.advance = lambda *given: (events.append("advance"), advance(*given))
    assert timing.step_times({"rk4": machine}, 0.1, 0.0, 0.01, 100, rounds=7)["rk4"] == pytest.approx(4e-9)
    assert events[:4] == ["advance", "clock", "advance", "clock"]


@pytest.mark.slow
def test_runs_that_diverge_or_hardly_start_still_make_a_table():
    wild = compare("exercise", "forward_euler,rk4", dt=0.4, duration=120.0)
    assert row(wild, "forward_euler").stop.startswith("diverged at ")
    assert row(wild, "rk4").amplitude is None
    short = compare("exercise", "forward_euler,rk4", dt=0.01, duration=0.01)
    assert [entry.phase for entry in short.drift] == [None, None]
    for case in (wild, short):
        assert all(all(cells) for cells in case.table.rows)
        assert {name for name in case.pictures() if case.plot(name)} == set(FIGURES)
    loose = compare("exercise_large", "rk4", angle=2.2)
    assert loose.drift[0].stop.startswith("slack at ")
    assert loose.drift[0].amplitude is None
    assert {name for name in loose.pictures() if loose.plot(name)} == set(FIGURES)


def test_long_runs_are_thinned(monkeypatch):
    monkeypatch.setattr(comparing, "ROWS", 400)
    thinned = compare("exercise", "velocity_verlet", dt=0.01, duration=10.0)
    run = thinned.runs["velocity_verlet"]
    assert len(run.time) == 335
    assert run.time[1] == pytest.approx(0.03)
    monkeypatch.undo()
    whole = compare("exercise", "velocity_verlet", dt=0.01, duration=10.0)
    assert thinned.drift[0].phase == pytest.approx(whole.drift[0].phase, rel=1e-3)


@pytest.mark.parametrize(
    ("integrators", "said"),
    [
        ("rk4,velocity_verlett", "velocity_verlet"),
        ("rk4,velocity_verlet,rk4", "rk4 is named twice"),
        (["rk4", "rk4"], "named twice"),
        ([], "At least one"),
        ("", "no integrator ''"),
    ],
)
def test_methods_that_are_unknown_or_named_twice_are_refused(integrators, said):
    with pytest.raises(MethodError, match=said):
        compare("exercise", integrators)


@pytest.mark.parametrize("bad", [{"dt": 0.0}, {"duration": math.nan}, {"angle": "a"}, {"velocity": math.inf},
                                 {"damping": "linaer"}, {"lenght": 1.0}, {"angle": [0.1, 0.2]}])
def test_values_that_cannot_be_are_refused(bad):
    with pytest.raises(SceneError):
        compare("exercise", "rk4", **bad)


def test_the_text_says_what_the_reynolds_number_means():
    large = compare("exercise_large", "rk4", duration=0.1)
    scene = large.scene
    speed = math.sqrt(2.0 * 9.8 * 0.353 * (1.0 - math.cos(math.radians(30.0))))
    reynolds = scene.medium.density * speed * 2.0 * 0.0107 / scene.medium.viscosity
    assert f"Reynolds number at the bottom, without losses: {reynolds:.0f} in air" in large.text
    assert "drag is quadratic" in large.text
    assert "24.7 times too little" in large.text
    assert scene.equation() in large.text
    assert "creeping" in compare("exercise", "rk4", damping="linear", duration=0.1, angle=1e-4).text
    assert "Reynolds" not in compare("exercise", "rk4", duration=0.1).text
    assert "Reynolds" not in compare("vacuum", "rk4", duration=0.1).text


def test_it_says_how_wrong_small_angle_gravity_is():
    """Compare with the series of the period, 1 + A²/16 + 11 A⁴/3072 + 173 A⁶/737280 (Nelson & Olsson 1986).

    At 60 degrees the period is 7.3 % longer.
    """
    assert "period is 7.3% longer" in compare("exercise", "rk4", duration=0.1, angle=math.radians(60.0)).text
    swing = 0.5
    series = swing**2 / 16 + 11 * swing**4 / 3072 + 173 * swing**6 / 737280
    moving = compare("textbook", "rk4", duration=0.1, angle=0.3, velocity=0.4 * SCENES["textbook"].omega0)
    assert f"a real pendulum's period is {series:.1%} longer from {math.degrees(swing):.4g}°" in moving.text
    assert "go over the top" in compare("textbook", "rk4", duration=0.1, angle=3.9).text
    for scene, angle in (("exercise", 0.35), ("vacuum", 2.0)):
        assert "Small-angle" not in compare(scene, "rk4", duration=0.1, angle=angle).text


@pytest.mark.parametrize("angle", [90, -90.0])
def test_a_start_that_is_likely_in_degrees_is_warned_of(angle, tmp_path):
    env = gymnasium.make("LabPendulum-v0", disable_env_checker=True)
    vector = LabPendulumVectorEnv(2)
    for start in (lambda: compare("vacuum", "rk4", angle=angle, duration=0.1),
                  lambda: rollout("vacuum", angle=[0.1, angle], duration=0.1),
                  lambda: film("vacuum", tmp_path / "far.gif", angle=angle, duration=0.1, size=64),
                  lambda: growth("vacuum", "rk4", angle=angle, periods=1.0, backend="python"),
                  lambda: cost("vacuum", "rk4", angle=angle, duration=0.1, steps=[0.05], repeats=1, backend="python"),
                  lambda: env.reset(options={"angle": angle}),
                  lambda: vector.reset(options={"angle": [0.1, angle]})):
        words = rf"in radians: .*; {angle:g} degrees would be {math.radians(angle):.4g}"
        with pytest.warns(UserWarning, match=words), contextlib.suppress(ValueError):
            start()
    compare("vacuum", "rk4", angle=12.4, duration=0.1)
    env.reset(options={"angle": 12.4})


@pytest.fixture
def no_figures(monkeypatch):
    """Replace the drawing of figures, which takes seconds, in tests of something else."""
    monkeypatch.setattr(Comparison, "pictures", lambda comparison: {})


@pytest.mark.usefixtures("no_figures")
def test_progress_rises_to_one(tmp_path):
    told: list[float] = []
    small = compare("exercise", "rk4", duration=0.1, progress=lambda done, what: told.append(done))
    assert told[0] == 0.0
    assert told == sorted(told)
    assert told[-1] == 1.0
    told.clear()
    write(small, tmp_path, progress=lambda done, what: told.append(done))
    assert told == sorted(told)
    assert told[-1] == 1.0


# --- a recording ----------------------------------------------------------------------------------------------------


def swing(offset=0.1, held=1.0, gamma=0.02):
    """Return a synthetic recording with 100 readings per second: the bob is held at 0.4 rad for a while, then released.
    """
    time = np.arange(0.0, 20.0, 0.01)
    free, _ = exact.linear(np.maximum(time - held, 0.0), 0.4, 0.0, SCENES["exercise"].omega0, gamma)
    return Recording(time, free + offset, "made.txt")


def test_a_run_starts_from_the_recordings_turning_point_and_follows_it():
    made = swing()
    found = compare("exercise", "rk4", damping={"linear": {"gamma": 0.02}}, recording=made)
    half = math.pi / math.sqrt(found.scene.omega0**2 - 0.01**2)
    sizes = 0.4 * np.exp(-0.01 * half * np.arange(3))
    assert np.abs(abs(found.angle) - sizes).min() < 1e-3
    assert found.recording.angle[0] == found.angle
    assert found.recording.time[0] == 0.0
    assert np.all(np.diff(found.recording.time) > 0.0)
    assert found.velocity == 0.0
    assert found.duration == found.recording.time[-1] > 15.0
    assert found.drift[0].recording < 2e-3
    assert "made.txt" in found.text
    assert "from recording, rms [rad]" in found.table.head
    other = compare("exercise", "rk4", damping="none", recording=made, angle=0.3, duration=5.0)
    assert (other.angle, other.duration) == (0.3, 5.0)
    assert other.drift[0].recording > 0.02


def test_a_recording_released_on_the_other_side_is_said_to_be():
    whole = swing()
    seen = whole.time > 1.0 + math.pi / math.sqrt(SCENES["exercise"].omega0**2 - 0.01**2) - 0.05
    made = Recording(whole.time[seen], whole.angle[seen], "made.txt")
    usual = compare("exercise", "rk4", damping={"linear": {"gamma": 0.02}}, recording=made)
    turned = compare("exercise", "rk4", damping={"linear": {"gamma": 0.02}}, recording=made, angle=-usual.angle)
    assert "other side" not in usual.text
    assert f"--read scale=-1 on the command line, or start the runs from {math.degrees(usual.angle):.4g}" in turned.text
    assert turned.drift[0].recording > 0.2, "they swing in opposite directions"
    upright = Recording(made.time, -made.angle, "made.txt")
    mended = compare("exercise", "rk4", damping={"linear": {"gamma": 0.02}}, recording=upright, angle=-usual.angle)
    assert "other side" not in mended.text
    assert mended.drift[0].recording < 2e-3


@pytest.mark.parametrize("held", [0.0, 1.0])
def test_a_recording_released_on_the_same_side_is_laid_on_the_run(held):
    """Also where its first turning point with readings on both sides is on the other side."""
    found = compare("exercise", "rk4", damping={"linear": {"gamma": 0.02}}, recording=swing(held=held), angle=0.4)
    assert found.recording.angle[0] > 0.38
    assert "other side" not in found.text
    assert found.drift[0].recording < 0.05


def test_a_turning_point_at_a_reading_is_there_once():
    time = np.arange(40 * 64) / 64
    found = comparing.aligned(Recording(time, 0.4 * np.cos(0.5 * math.pi * time), "made.txt"))
    assert "2 s in the file" in found.notes[-1]
    assert found.time[:3].tolist() == [0.0, 1 / 64, 2 / 64]
    assert found.angle[0] == pytest.approx(-0.4, rel=1e-9)


@pytest.mark.slow
def test_real_recordings_can_be_compared_with(recordings):
    for name, length, first in (("video_decay_65cm.txt", 0.65, -39.0), ("encoder_short_rod_45deg.txt", 0.09, -64.0)):
        recording = Recording.read(recordings / name)
        found = compare("exercise_large", "rk4", length=length, recording=recording, duration=1.0)
        assert math.degrees(found.angle) == pytest.approx(first, abs=0.1)
        assert found.recording.angle[1] == pytest.approx(found.angle, abs=0.02)
        assert found.drift[0].recording < 0.25


# --- files ----------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_files_carry_the_data_and_where_they_come_from(exercise, tmp_path):
    from PIL import Image

    other = tmp_path / "mine.txt"
    other.write_text("kept")
    paths = write(exercise, tmp_path / "new" / "out", film=False)
    folder = tmp_path / "new" / "out"
    wanted = [f"{name}.{ending}" for name in FIGURES for ending in ("png", "svg")] + ["comparison.csv", "drift.csv"]
    assert [path.name for path in paths] == wanted
    assert sorted(path.name for path in folder.iterdir()) == sorted(wanted)
    assert other.read_text() == "kept"
    for name in FIGURES:
        with Image.open(folder / f"{name}.png") as image:
            assert json.loads(image.info["scene"])["name"] == "exercise"
            assert (image.info["dt"], image.info["Title"]) == ("0.01", name)
    lines = (folder / "comparison.csv").read_text().splitlines()
    comments = [line for line in lines if line.startswith("# ")]
    assert any(line.startswith("# Software: lab-pendulum") for line in comments)
    table = list(csv.DictReader(lines[len(comments):]))
    assert len(table) == 1001
    for name, run in exercise.runs.items():
        for column, values in (("angle_rad", run.angle), ("velocity_rad_per_s", run.velocity), ("energy_J", run.energy),
                               ("residual_J", run.energy_residual)):
            np.testing.assert_array_equal([float(line[f"{name}_{column}"]) for line in table], values)
    lines = (folder / "drift.csv").read_text().splitlines()
    rows = list(csv.DictReader(line for line in lines if not line.startswith("# ")))
    assert [line["method"] for line in rows] == SHEET.split(",")
    assert float(rows[0]["relative_energy_error_end"]) == exercise.drift[0].energy_end
    assert float(rows[3]["phase_error_rad"]) == exercise.drift[3].phase


@pytest.mark.slow
def test_cells_after_a_runs_end_are_empty():
    stopped = compare("exercise_large", "forward_euler,rk4", dt=0.05, duration=4.0)
    end = len(stopped.runs["forward_euler"].time)
    motions, drifts = stopped.tables().values()
    assert motions["forward_euler_angle_rad"].values[end - 1] == stopped.runs["forward_euler"].angle[-1]
    assert motions["forward_euler_angle_rad"].values[end] is None
    assert motions["rk4_angle_rad"].values[-1] == stopped.runs["rk4"].angle[-1]
    assert list(drifts)[1] == "ledger_residual_over_E0_end"
    assert drifts["stop"].values[1] == ""


@pytest.mark.slow
def test_the_film_has_the_colours_of_the_figures(monkeypatch):
    seen = []
    monkeypatch.setattr(files, "side_by_side", lambda panels, **_: seen.append(panels))
    shown = EVERYWHERE[:9]
    small = compare("exercise", shown, duration=0.1)
    list(files.pictures(small, 1))
    film = {view.caption: view.accent for _, view in seen[0]}
    for figure in map(small.plot, FIGURES):
        lines = {line.get_label(): to_hex(line.get_color()).upper() for axes in figure.axes for line in axes.lines}
        assert {name: lines[name] for name in shown} == film


DISSIPATION = {
    "linear": (0.02, "spiral towards rest"),
    "just below the limit": (2.0 * math.sqrt(9.81 / 0.353) * (1.0 - 1e-9), "spiral towards rest"),
    "critical": (2.0 * math.sqrt(9.81 / 0.353) * (1.0 + 1e-9), "does not swing, but creeps back to rest"),
    "overdamped": (5000.0, "does not swing, but creeps back to rest"),
}


@pytest.mark.quick("linear", "overdamped")
@pytest.mark.parametrize("case", DISSIPATION)
def test_the_portrait_says_what_the_losses_do(case):
    """The oscillator theta'' + gamma theta' + omega0² theta = 0 swings for gamma < 2 omega0.

    Source: Landau & Lifshitz 1976, section 25.
    """
    gamma, words = DISSIPATION[case]
    text = portrait(compare("lab", "implicit_midpoint", gamma=gamma, duration=0.1))
    assert words in text
    assert ("spiral" in text) == (gamma < 2.0 * SCENES["lab"].omega0)
    assert ("creeps" in text) == (f"{gamma:.4g}" in text)


def test_a_run_that_is_over_at_once_has_no_reference_solution():
    found = compare("exercise_large", "rk4", angle=2.1, duration=1.0)
    assert "Reference solution: none: The wire goes slack at 0 s, at 120.3°." in found.text
    assert "rk4: The wire goes slack at 0 s" in found.text


@pytest.mark.slow
def test_a_ring_is_not_called_a_spiral():
    """In 5 s the amplitude falls by 10 % with gamma = 0.04/s, and to a third with 0.48/s."""
    short, long = (portrait(compare("exercise_large", "rk4", dt=0.04, duration=5.0, gamma=gamma))
                   for gamma in (0.04, 0.48))
    assert "shrink: the start of a spiral" in short
    assert "turn the closed orbit into a spiral" in long


def test_the_portrait_of_a_bob_that_nothing_pulls_back():
    free = Scene(effects=(LinearDrag(gamma=1.0),))
    assert "slow the bob down" in portrait(compare(free, "rk4", velocity=1.0, duration=0.1))
    still = compare("lab", "rk4", damping={"linear": {"gamma": 1.0}}, duration=0.1)
    assert "spiral" in portrait(still)


def portrait(comparison):
    return " ".join(text.get_text() for text in files.figure_of(comparison, "phase").axes[0].texts)


def test_the_text_of_a_start_at_rest_has_no_reynolds_number():
    """The scene's drag belongs to its usual run and does not change with the start of a comparison."""
    still = compare("lab", "rk4", angle=0.0, duration=0.1)
    assert "Reynolds" not in still.text
    assert still.scene.equation() in still.text
    assert "Reynolds" not in compare(SCENES["exercise_large"].replace(viscosity=0.0), "rk4", duration=0.1).text


@pytest.mark.slow
def test_the_film_shows_all_runs_at_true_speed(monkeypatch):
    seen = []
    monkeypatch.setattr(files, "side_by_side", lambda panels, **_: seen.append(panels))
    long = compare("exercise_large", "forward_euler,velocity_verlet,rk4", dt=0.04, duration=30.0)
    list(files.pictures(long, 1001))
    assert len(seen) == 1001
    stop = float(long.runs["forward_euler"].time[-1])
    for i in (0, 7, 600, 1000):
        for k, (label, run) in enumerate(long.runs.items()):
            thing, view = seen[i][k]
            assert thing.title == "exercise_large, dt = 0.04 s, the first 20 s of 30 s"
            assert view.accent == colour(list(METHODS).index(run.method.name))
            assert view.energy_scale == run.energy[0]
            assert view.stopped == (k == 0 and i / 50 > stop)
            assert view.caption.startswith(label)
            if not view.stopped:
                assert view.time == i / 50
                cubic = CubicHermiteSpline(run.time, run.angle, run.velocity)
                assert view.angle == pytest.approx(float(cubic(i / 50)), rel=1e-12, abs=1e-15)
                assert view.velocity == pytest.approx(float(cubic(i / 50, 1)), rel=1e-12, abs=1e-14)
                total = np.interp(i / 50, run.time, run.energy)
                assert view.kinetic + view.potential == pytest.approx(float(total), rel=1e-9)
    assert "slack" in seen[1000][0][1].caption
    assert seen[1000][0][1].time == stop


@pytest.mark.usefixtures("no_figures")
def test_the_film_has_the_panels_and_the_theme_that_are_asked_for(monkeypatch):
    seen = []
    monkeypatch.setattr(files, "side_by_side", lambda panels, **look: seen.append((panels, look)))
    found = compare("exercise_large", "rk4,heun", duration=0.1)
    asked = FrameStyle("dark", ("apparatus", "phase", "residual"))
    list(files.pictures(found, 3, asked))
    assert [look for _, look in seen] == [{"look": asked, "strip": 2 / 50}] * 3
    for (_, view), run in zip(seen[-1][0], found.runs.values(), strict=True):
        np.testing.assert_allclose(view.past.residual, np.interp((0.0, 0.02), run.time, run.ledger.residual), rtol=1e-9)
        assert view.curves.orbit
    seen.clear()
    list(files.pictures(found, 1, FrameStyle()))
    assert all(view.past is not None and view.curves is None for _, view in seen[0][0])


def test_what_the_film_cannot_show_is_refused_before_anything_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for words, said in ((["--theme", "drak"], "did you mean dark"), (["--panels", "phsae"], "did you mean phase"),
                        (["--no-film", "--theme", "dark"], "--theme is for the film")):
        done = CliRunner().invoke(cli.app, ["compare", *words])
        assert said in str(done.exception)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_the_film_plays(tmp_path):
    import imageio_ffmpeg

    small = compare("exercise", "rk4,velocity_verlet", duration=0.2)
    path = write(small, tmp_path)[-1]
    assert path.name == "comparison.mp4"
    count, seconds = imageio_ffmpeg.count_frames_and_secs(path)
    assert count == 11
    assert seconds == pytest.approx(0.22, abs=0.03)
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-i", str(path)]
    said = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "lab-pendulum" in said.stderr


@pytest.mark.usefixtures("no_figures")
def test_what_cannot_be_written_changes_nothing(exercise, tmp_path, monkeypatch):
    blocked = tmp_path / "file"
    blocked.write_text("here")
    with pytest.raises(OutputError, match="cannot be written"):
        write(exercise, blocked)
    assert blocked.read_text() == "here"
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "comparison.mp4").write_text("old film")

    def fails(*_, **__):
        raise RuntimeError("no picture")

    monkeypatch.setattr(files, "side_by_side", fails)
    with pytest.raises(RuntimeError, match="no picture"):
        write(exercise, folder)
    assert (folder / "comparison.mp4").read_text() == "old film"
    assert not [path for path in folder.iterdir() if path.name.startswith(".")]
