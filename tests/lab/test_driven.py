"""Logs of driven runs: reading, fitting, predicting. The truth is simulated by an equation of motion of its own."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from command_line import Here
from driven_truth import LAYOUTS, by_scipy, drawn, expected, fine_steps, motion, recorded, steps, text_of
from PIL import Image
from scipy.optimize import least_squares
from small_driven_fit import BENCH, log_of, small_driven_fit

from pendulum_env import SCENES, LabPendulumEnv, LabPendulumVectorEnv
from pendulum_env.lab import DrivenFit, DrivenLog, RecordingError, fit_driven
from pendulum_env.lab.driven.drive import mean_drive
from pendulum_env.lab.driven.log import is_driven
from pendulum_env.lab.driven.problem import DrivenResiduals
from pendulum_env.lab.driven.windows import RATES, Windows
from pendulum_env.physics.units import SceneError

REAL = os.environ.get("LAB_PENDULUM_DATA")
NAMES = ("driven_bench_planned.csv", "driven_bench_energy_shaping.csv")


def small() -> DrivenFit:
    return small_driven_fit("log 0", "log 1")


# --- the simulation -------------------------------------------------------------------------------------------------


def test_the_truth_is_that_of_scipy() -> None:
    truth = {**BENCH, "dry": 0.0, "delay": 0.0}
    command = steps(np.random.default_rng(1), 2.0, 0.02, 0.5, 0.3)
    command[0] = 0.0  # both start with the lag at rest
    fine, _ = motion(truth, command, 0.02, 80)
    assert fine[::80] == pytest.approx(by_scipy(truth, command, 0.02), abs=1e-6)


@pytest.mark.parametrize("dry", [0.0, 0.4, 3.0])
def test_windows_simulate_the_truth(dry: float) -> None:
    truth, tick = {**BENCH, "dry": dry}, 0.02
    command = steps(np.random.default_rng(2), 5.0, tick, 0.5, 0.5)
    fine, _ = motion(truth, command, tick, 80)
    time = np.arange(len(command)) * tick
    log = DrivenLog(time, fine[np.arange(len(command)) * 80] + truth["zero"], command)
    windows = Windows.of((log,), 100.0, math.sqrt(truth["stiffness"]))
    rates = np.array([[truth[name] for name in RATES]])
    shown = windows.angles(rates, np.array([[[truth["zero"], 0.0]]]))[0]
    assert shown == pytest.approx(windows.angle, abs=3e-5)
    assert np.ptp(shown) > 0.1


def test_the_mean_drive_is_the_mean_of_the_lagged_drive() -> None:
    source = np.random.default_rng(3)
    time = np.cumsum(source.uniform(0.5, 1.5, 40)) * 0.02
    drive, lag, delay = source.uniform(-1.0, 1.0, 40), 0.05, 0.013
    grid = np.arange(0.0, 0.5, 1e-5)
    held = drive[np.clip(np.searchsorted(time, grid - delay, side="right") - 1, 0, 39)]
    state = np.empty_like(grid)
    state[0] = drive[0]
    for i in range(len(grid) - 1):
        state[i + 1] = held[i] + (state[i] - held[i]) * math.exp(-1e-5 / lag)
    edges = np.arange(0.0, 0.45, 0.03)
    mean = [state[(grid >= first) & (grid < last)].mean() for first, last in pairwise(edges)]
    assert mean_drive(time, drive, edges, delay, lag) == pytest.approx(mean, abs=2e-4)


# --- fits -----------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_small_fit_finds_the_bench() -> None:
    found, true = small(), expected(BENCH, "action")
    assert set(found.names) == set(true)
    for name, value in true.items():
        one = found.parameters[name]
        assert abs(one.value - value) < 4.0 * one.error, name
        low, high = found.interval(name, 0.999)
        assert low <= value <= high, name
    assert found.parameters["max_torque"].error < 0.01 * true["max_torque"]
    assert found.grade.usable


@pytest.mark.slow
def test_eliminated_starts_are_fitted_too() -> None:
    """SciPy's least squares over the numbers and the starts of all windows ends at the same numbers, to 2e-3 of the
    errors, with the same errors."""
    found = small()
    solution, free = found.solution, list(found.solution.free)
    windows, scale = solution.windows, np.sqrt(np.diag(solution.covariance))
    count = len(free)

    def missed(changes: np.ndarray) -> np.ndarray:
        rates = solution.rates.copy()
        rates[free] += changes[:count] * scale
        starts = solution.starts + 1e-3 * changes[count:].reshape(-1, 2)
        return windows.angle - windows.angles(rates[None], starts[None])[0]

    def slopes(changes: np.ndarray) -> np.ndarray:
        return np.stack([(missed(changes + step) - missed(changes - step)) / 0.2
                         for step in 0.1 * np.eye(len(changes))], axis=1)

    assert found.at_bound == ()
    problem = DrivenResiduals(windows, solution.rates, solution.free, solution.starts)
    assert np.all(problem.weights(solution.residual**2)[0] == 1.0)
    full = least_squares(missed, np.zeros(count + 2 * len(windows.places)), slopes, max_nfev=5)
    assert np.abs(full.x[:count]).max() < 2e-3
    own = problem.slopes(solution.rates[free], central=True) * scale
    covariance = np.linalg.inv(full.jac.T @ full.jac)[:count, :count]
    np.testing.assert_allclose(np.sqrt(np.diag(np.linalg.inv(own.T @ own))), np.sqrt(np.diag(covariance)), rtol=0.02)
    assert float(solution.residual @ solution.residual) < 2.0 * full.cost * (1.0 + 1e-6)


@pytest.mark.slow
def test_a_fit_of_logs_is_a_result() -> None:
    """Its tables are those of its files: one row for each parameter, and one for each reading of the windows."""
    found = small()
    tables = found.tables()
    assert list(tables["parameters"])[:6] == ["parameter", "value", "error", "low", "high", "unit"]
    assert len(tables["residuals"]["residual_rad"].values) == len(found.residual)
    assert found.to_pandas().attrs["units"]["value"] == ""
    assert found.at_bound == tuple(name for name in found.names if found.parameters[name].value == 0.0)


def test_settings_are_those_of_the_sensor() -> None:
    settings = small().settings
    sensor = settings["sensor"]
    assert sensor["quantum"] == pytest.approx(BENCH["quantum"], rel=1e-3)
    assert sensor["noise"] == pytest.approx(BENCH["noise"], rel=0.15)
    assert sensor["offset"] == pytest.approx(BENCH["zero"], abs=2e-3)
    assert sensor["rate"] == pytest.approx(BENCH["rate"])
    assert settings["action_delay"] == pytest.approx(BENCH["delay"], abs=3e-3)
    assert json.loads(json.dumps(small().to_dict()))["sensor"] == sensor


@pytest.mark.slow
def test_the_scene_moves_as_the_bench_in_an_environment() -> None:
    truth, tick = {**BENCH, "delay": 0.0, "lag": 0.05}, 0.02
    scene = small().scene
    env = LabPendulumEnv(scene, dt=tick, substeps=4, task="free")
    env.reset(options={"angle": 0.0, "velocity": 0.0})
    command = steps(np.random.default_rng(5), 3.0, tick, 0.5, 0.4)
    command[0] = 0.0
    fine, _ = motion(truth, command, tick, 80)
    angles = [env.step(np.array([u], dtype=np.float32))[4]["angle"] for u in command]
    assert angles == pytest.approx(fine[80::80][: len(angles)], abs=0.02)
    assert np.ptp(fine) > 0.5


def test_samples_scatter_as_the_fit_says() -> None:
    drawn_scenes = small().sample(400, seed=1)
    assert drawn_scenes["scene"] == small().scene
    length = small().parameters["length"]
    assert drawn_scenes["length"].std() == pytest.approx(length.error, rel=0.2)
    assert drawn_scenes["max_torque"].shape == (400,)
    assert (drawn_scenes["lag"] >= 0.0).all()


@pytest.mark.slow
def test_an_environment_has_the_benchs_sensor_and_delay() -> None:
    """The delay is that of the bench, within its error and a quarter for rounding, in whole integration steps."""
    keywords = small().environment
    env = LabPendulumEnv(**keywords)
    delay = small().parameters["delay"]
    assert abs(keywords["action_delay"] - BENCH["delay"]) < 4.25 * delay.error
    steps_late = keywords["action_delay"] * keywords["substeps"] / keywords["dt"]
    assert steps_late == pytest.approx(round(steps_late))
    assert abs(keywords["action_delay"] - delay.value) <= 0.25 * delay.error
    assert keywords["dt"] == pytest.approx(1.0 / BENCH["rate"])
    assert keywords["sensor"].quantum == small().quantum
    info = env.reset(seed=3)[1]
    most = small().quantum + 5.0 * small().noise + 2e-3
    assert abs(info["observed_angle"] - info["angle"] - BENCH["zero"]) < most


def test_episodes_draw_their_bench_from_the_fit() -> None:
    found = small()
    env = LabPendulumVectorEnv(500, found.scene, randomize=found, backend="python", warn=False)
    drawn = env.reset(seed=1)[1]["parameters"]
    for name in ("length", "max_torque"):
        one = found.parameters[name]
        assert drawn[name].mean() == pytest.approx(one.value, abs=5.0 * one.error / math.sqrt(500)), name
        assert drawn[name].std() == pytest.approx(one.error, rel=0.2), name


def test_a_prediction_is_open_loop() -> None:
    log = log_of(BENCH, 2)
    later = DrivenLog(log.time, np.where(log.time > 1.0, 0.0, log.angle), log.drive)
    one, other = (small().predict(each, 0.5, 3.0) for each in (log, later))
    assert one.angle == pytest.approx(other.angle)  # readings after the start do not matter
    assert one.error_after(1.0) < 0.03
    with pytest.raises(RecordingError, match="lasts 3"):
        one.error_after(5.0)


def test_a_prediction_needs_readings() -> None:
    with pytest.raises(RecordingError, match="too few readings"):
        small().predict(log_of(BENCH), start=1.0, duration=0.001)


@pytest.mark.slow
def test_a_bench_without_delay_and_lag_can_be_drawn() -> None:
    """Both are fitted at their bound 0, and stay there: the draws scatter less than with an unknown delay."""
    prompt = {**BENCH, "lag": 0.0, "delay": 0.0}
    found = fit_driven([log_of(prompt), log_of(prompt, 1)], mass=BENCH["mass"])
    lengths = found.sample(200)["length"]
    assert 0.3 < np.std(lengths) / found.parameters["length"].error < 1.1


@pytest.mark.slow
@pytest.mark.parametrize("known", [{"inertia": 0.0721}, {"moment": 0.147}])
def test_a_known_inertia_sets_the_scale_of_a_torque(known: dict[str, float]) -> None:
    truth = {**BENCH, "delay": -0.01, "torque_noise": 0.03, "rate": 100.0, "zero": 0.0}
    log = log_of(truth, 3, "torque")
    wrong = DrivenLog(log.time, log.angle, 2.0 * log.drive, "torque")  # a torque that reads twice what acts
    true = expected(truth, "torque")
    found = fit_driven(wrong, **{name: true[name] for name in known})
    scale = found.parameters["torque_scale"]
    assert abs(scale.value - 0.5) < 4.0 * scale.error < 0.05
    assert fit_driven(wrong).parameters["inertia"].value == pytest.approx(2.0 * true["inertia"], rel=0.05)
    assert "in units of the log's torque" in fit_driven(wrong).limits


@pytest.mark.slow
def test_a_push_by_hand_is_left_out_and_named() -> None:
    truth = {**BENCH, "noise": 0.0005}
    logs = [log_of(truth, seed) for seed in (4, 5)]
    first, second = logs[0].between(0.0, 3.0), logs[0].between(3.02, 8.0)
    gap = 1.0  # a push that no drive explains: the bob is somewhere else at once
    angle = np.concatenate([first.angle, second.angle + gap])
    pushed = DrivenLog(np.concatenate([first.time, second.time]), angle - gap * (angle > 9.0),
                       np.concatenate([first.drive, second.drive]))
    jumped = DrivenLog(pushed.time, np.where(pushed.time < 3.4, pushed.angle, pushed.angle - gap), pushed.drive)
    found = fit_driven([jumped, logs[1]], mass=0.3)
    assert any(begin < 3.4 and end > 3.0 for log, begin, end in found.solution.lost if log == 0)
    assert "left out" in found.grade.text
    length = found.parameters["length"]
    assert abs(length.value - expected(truth, "action")["length"]) < 4.0 * length.error


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["action", "torque"])
def test_intervals_hold_in_a_part_of_the_coverage_study(kind: str) -> None:
    """The whole study is examples/benchmarks/driven_coverage.py."""
    off = []
    for seed in range(300, 306):
        truth = drawn(seed, kind)
        logs = [log_of(truth, 10_000 * number + seed, kind) for number in range(2)]
        found = fit_driven(logs, **({"mass": truth["mass"]} if kind == "action" else {}))
        true = expected(truth, kind)
        off += [(one.value - true[name]) / one.error for name, one in found.parameters.items()]
    assert np.sqrt(np.mean(np.square(off))) < 1.6
    assert np.mean(np.abs(off) < 2.0) > 0.8


# --- reading --------------------------------------------------------------------------------------------------------


@pytest.mark.quick("t, action, angle-torque", "bench-action")
@pytest.mark.parametrize("kind", ["action", "torque"])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_layouts_are_read(layout: str, kind: str, tmp_path: Path) -> None:
    truth = {**BENCH, "quantum": 0.0, **({"torque_noise": 0.02} if kind == "torque" else {})}
    log, path = recorded(truth, 6, kind), tmp_path / "log.csv"
    path.write_text(text_of(log, layout, kind), encoding="utf-8")
    read = DrivenLog.read(path)
    assert read.kind == kind
    assert is_driven(path)
    for name in ("time", "angle", "drive"):
        assert getattr(read, name) == pytest.approx(log[name], abs=1e-8, rel=1e-8), name
    assert any("columns" in note for note in read.notes)


def test_a_current_has_a_motor_constant(tmp_path: Path) -> None:
    log, path = recorded({**BENCH, "torque_noise": 0.02}, 6, "torque"), tmp_path / "log.csv"
    rows = np.stack([log["time"], np.degrees(log["angle"]), 1e3 * log["drive"] / 0.5], axis=1)
    np.savetxt(path, rows, delimiter=",", header="time (s),angle (deg),motor current (mA)", comments="")
    read = DrivenLog.read(path)
    assert (read.kind, read.unit) == ("current", "A")
    assert read.drive == pytest.approx(log["drive"] / 0.5)
    assert DrivenLog.read(path, factor=-1.0).drive == pytest.approx(-read.drive)


def test_columns_can_be_chosen(tmp_path: Path) -> None:
    log, path = recorded(BENCH, 6, "action"), tmp_path / "log.txt"
    np.savetxt(path, np.stack([log["drive"], log["time"], log["angle"]], axis=1))
    read = DrivenLog.read(path, action=1, time=2, angle=3, unit="rad")
    assert read.angle == pytest.approx(log["angle"])
    with pytest.raises(RecordingError, match="expected an action, torque or current beside the angle, found none"):
        DrivenLog.read(path)


GOOD = {"time": np.arange(50) * 0.02, "angle": np.sin(np.arange(50) * 0.1), "drive": np.cos(np.arange(50) * 0.3)}


@pytest.mark.parametrize(("changed", "said"), [
    ({"drive": np.full(50, 0.3)}, "the action is 0.3 in every reading.*cannot be told from the sensor's zero"),
    ({"drive": 2.0 * GOOD["drive"]}, r"within ±1, but reaches 2;? ?.*torque= or\s+current="),
    ({"time": GOOD["time"][::-1]}, "times must increase, but 0.96 s follows 0.98 s"),
    ({"time": GOOD["time"][:20], "angle": GOOD["angle"][:20], "drive": GOOD["drive"][:20]}, "at least 30 readings, "
     "found 20"),
    ({"angle": GOOD["angle"][:-1]}, "must have one length, found 50, 49 and 50"),
    ({"angle": np.where(GOOD["time"] > 0.5, np.nan, GOOD["angle"])}, "angle must be an array of finite numbers"),
    ({"kind": "voltage"}, "kind must be 'torque' or 'current' or 'action'"),
])
def test_bad_logs_are_refused(changed: dict[str, object], said: str) -> None:
    with pytest.raises(RecordingError, match=said):
        DrivenLog(**{**GOOD, **changed})  # type: ignore[arg-type]


@pytest.mark.parametrize(("titles", "options", "said"), [
    ("time (s),angle (rad),torque (lb ft)", {}, "the torque is in 'lb ft', expected one of nm"),
    ("time (s),angle (rad),torque (N m),current (A)", {}, "one drive, found torque in column 3 .* and current"),
    ("time (s),angle (rad),torque", {"torque": "tork"}, "there is no column 'tork' for torque=.*torque"),
    ("time (s),angle (rad),torque", {"torque": 3, "action": 3}, "give one of action, torque and current"),
    ("time (s),angle (rad),torque", {"torque": 9}, "a column for torque= is given by its name, or a number from 1 to"),
    ("time (s),angle (rad),torque", {"torque": "²"}, "there is no column '²' for torque="),
    ("time (s),angle (rad),torque command", {}, "expected one drive, found torque in column 3 .* and action in column"),
    ("time (s),velocity (rad/s),torque", {}, "expected one column of the angle, found none"),
    ("time (s),angle (rad),torque", {"factor": 0.0}, "factor must not be 0"),
    ("time (s),angle (rad),torque", {"unit": "turns"}, "unit must be 'deg' or 'rad'"),
])
def test_bad_files_are_refused(titles: str, options: dict[str, object], said: str, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    columns = [GOOD["time"], GOOD["angle"], GOOD["drive"], GOOD["drive"]][: titles.count(",") + 1]
    np.savetxt(path, np.stack(columns, axis=1), delimiter=",", header=titles, comments="")
    with pytest.raises(RecordingError, match=said):
        DrivenLog.read(path, **options)  # type: ignore[arg-type]


def test_an_angle_without_a_unit_must_fit_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log, path = recorded({**BENCH, "duration": 4.0, "quantum": 0.0}, 7, "action"), tmp_path / "log.csv"
    log["angle"] *= 9.0 / np.abs(log["angle"]).max()
    monkeypatch.setattr("pendulum_env.lab.driven.log.misfit", lambda log: 1.0)
    path.write_text(text_of(log, "t, action, angle", "action"), encoding="utf-8")
    words = 'may be in radians, of a bob that rotates, or in degrees; give unit="rad"'
    with pytest.raises(RecordingError, match=words):
        DrivenLog.read(path)


def test_bad_arguments_of_a_fit_are_refused() -> None:
    log = log_of(BENCH)
    for options, said in (({"mass": 1.0, "inertia": 1.0}, "one of inertia, moment and mass"),
                          ({"hold": {"visco": 0.0}}, "There is no hold 'visco'.*viscous"),
                          ({"hold": {"drive": -1.0}}, r"hold\['drive'\]"),
                          ({"hold": 3}, "hold must be a dict"), ({"gravity": 0.0}, "gravity")):
        with pytest.raises(SceneError, match=said):
            fit_driven(log, **options)  # type: ignore[arg-type]
    with pytest.raises(RecordingError, match="one kind of drive"):
        fit_driven([log, DrivenLog(log.time, log.angle, log.drive, "torque")])
    with pytest.raises(RecordingError, match="logs must be one or several DrivenLogs"):
        fit_driven([])
    with pytest.raises(RecordingError, match="factor=-1"):
        fit_driven(DrivenLog(log.time, log.angle, -log.drive))
    with pytest.raises(RecordingError, match="a fit needs logs of at least"):
        fit_driven(log.between(0.0, 1.0))


# --- how it is shown --------------------------------------------------------------------------------------------------


def test_the_figure_has_recordings_models_residuals_and_drives() -> None:
    found = small()
    drawn = found.plot()
    assert len(drawn.axes) == 3 * len(found.logs)
    wanted = math.hypot(BENCH["noise"], BENCH["quantum"] / math.sqrt(12.0))  # without torques missing from the logs
    for log, (angle, residual, drive) in zip(found.logs, np.reshape(np.array(drawn.axes), (-1, 3)), strict=True):
        seen, model = angle.lines
        np.testing.assert_allclose(np.radians(seen.get_ydata()), log.angle, rtol=1e-15)
        np.testing.assert_array_equal(seen.get_xdata(), log.time)
        place = np.isfinite(model.get_xdata())
        at = np.searchsorted(log.time, model.get_xdata()[place])
        assert len(at) > 0.9 * len(log.time)
        rest = residual.lines[0].get_ydata()[place]
        np.testing.assert_allclose(seen.get_ydata()[at] - model.get_ydata()[place], rest, atol=1e-9)
        assert math.radians(np.std(rest)) == pytest.approx(wanted, rel=0.1)
        np.testing.assert_array_equal(drive.lines[0].get_ydata(), log.drive)
        assert (drive.get_ylabel(), drive.lines[0].get_drawstyle()) == ("action [1]", "steps-post")
        assert angle.get_xlim() == residual.get_xlim() == drive.get_xlim() == (log.time[0], log.time[-1])


def test_the_figure_shades_what_is_left_out() -> None:
    found = small()
    lost = replace(found, solution=replace(found.solution, lost=((1, 2.0, 2.5), (1, 4.0, 4.2))))
    first, _, _, second, below, drive = lost.plot().axes
    assert not [patch for patch in first.patches if patch.get_label() == "left out"]
    for panel in (second, below, drive):
        spans = [patch.get_extents().transformed(panel.transData.inverted()).intervalx for patch in panel.patches[-2:]]
        np.testing.assert_allclose(spans, ((2.0, 2.5), (4.0, 4.2)))


# --- command line ---------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_command_fits_several_logs(tmp_path: Path) -> None:
    for seed in range(2):
        (tmp_path / f"{seed}.csv").write_text(text_of(recorded(BENCH, seed, "action"), "degrees", "action"))
    run = subprocess.run([sys.executable, "-m", "pendulum_env", "fit", "0.csv", "1.csv", "--mass", "0.3", "--out", "o"],
                         cwd=tmp_path, capture_output=True, text=True, check=True)
    assert "max_torque" in run.stdout
    written = json.loads((tmp_path / "o" / "bench.json").read_text())
    assert written["parameters"]["length"]["value"] == pytest.approx(9.81 / BENCH["stiffness"], rel=1e-3)
    assert set(written["sensor"]) == {"quantum", "noise", "offset", "scale", "rate"}
    with Image.open(tmp_path / "o" / "fit.png") as image:
        assert image.info["recording"] == '["0.csv", "1.csv"]'
    env = LabPendulumEnv(str(tmp_path / "o" / "scene.json"))
    assert env.scene.omega0 == pytest.approx(math.sqrt(BENCH["stiffness"]), rel=1e-3)


@pytest.mark.parametrize(("words", "said"), [
    (("--torque", "2"), "needs a log of a driven run"),
    (("log.csv", "log.csv", "--read", "fctor=2"), "no keyword of --read for driven logs 'fctor'; did you mean factor"),
    (("log.csv", "--until", "60"), "--until is for free swings, and these are logs of driven runs"),
    (("log.csv", "--posterior"), "--posterior is for free swings"),
    (("log.csv", "--set", "length=2"), "no parameter of driven logs 'length'"),
    (("log.csv", "swing.csv"), "Several files are fitted together only if they are logs of driven runs"),
])
def test_the_command_refuses(words: tuple[str, ...], said: str, run_here: Here) -> None:
    Path("log.csv").write_text(text_of(recorded({**BENCH, "duration": 2.0}, 0, "action"), "degrees", "action"))
    Path("swing.csv").write_text("time (s),angle (deg)\n" + "".join(f"{0.1 * i},{math.cos(i)}\n" for i in range(40)))
    code, _, told = run_here("fit", *words)
    assert code
    assert said in " ".join(told.split())


# --- the real bench -------------------------------------------------------------------------------------------------


@lru_cache
def bench_fits() -> tuple[DrivenFit, DrivenFit, DrivenFit]:
    logs = [DrivenLog.read(Path(REAL or "") / name) for name in NAMES]
    return fit_driven(logs), fit_driven(logs[0]), fit_driven(logs[1])


@pytest.mark.slow
@pytest.mark.skipif(not REAL, reason="needs the real logs in LAB_PENDULUM_DATA")
def test_both_runs_of_the_real_bench_agree_and_predict_each_other() -> None:
    both, planned, shaped = bench_fits()
    for name, one in planned.parameters.items():
        other = shaped.parameters[name]
        assert abs(one.value - other.value) < 3.0 * math.hypot(one.error, other.error), name
    for found, log in ((planned, shaped.logs[0]), (shaped, planned.logs[0])):
        ahead = found.predict(log, duration=3.2)
        assert ahead.error_after(1.0) < 0.05
        assert ahead.error_after(3.0) < 0.2
    assert any(begin < 16.1 and end > 15.8 for log, begin, end in both.solution.lost if log == 1)  # a push by hand


@pytest.mark.slow
@pytest.mark.skipif(not REAL, reason="needs the real logs in LAB_PENDULUM_DATA")
def test_the_preset_is_what_the_real_logs_say() -> None:
    both, scene = bench_fits()[0], SCENES["motor_bench"]
    mass, length = scene.parameters()["mass"], scene.parameters()["length"]
    values = {"length": length, "inertia": mass * length**2, "moment": mass * length,  # type: ignore[operator]
              "bearing_viscosity": scene.parameters()["bearing_viscosity"],
              "friction_torque": scene.parameters()["friction_torque"]}
    for name, value in values.items():
        one = both.parameters[name]
        assert abs(one.value - value) < 2.0 * one.error, name  # type: ignore[operator]


@pytest.mark.slow
@pytest.mark.skipif(not REAL, reason="needs the real logs in LAB_PENDULUM_DATA")
def test_the_motion_of_the_real_bench_rules_the_published_identification_out() -> None:
    both = bench_fits()[0]
    stiffness = both.solution.rates[0]
    error = math.sqrt(both.solution.covariance[0, 0])
    geometry, identification = 9.81 * 0.304 / 0.1396, 9.81 * 0.1022 / 0.0626
    assert stiffness - identification > 8.0 * error
    assert abs(stiffness - geometry) < 0.7 * (stiffness - identification)
    dry = both.solution.rates[2]
    assert 0.184 / 0.0626 - dry > 8.0 * math.sqrt(both.solution.covariance[2, 2])


def test_fine_steps_are_short_enough() -> None:
    for seed in range(3):
        truth = drawn(seed, "action")
        assert fine_steps(truth) * truth["rate"] * math.tau / math.sqrt(truth["stiffness"]) >= 4000.0
