"""Test ``lab-pendulum fit``: its output, the files it writes, their use elsewhere, and its error messages.

Quick tests do not fit: they pass on a Fit object with the known true values of a simulated recording.
"""

from __future__ import annotations

import csv
import json
import math
import shlex
import warnings
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from command_line import Here, table
from folder_contents import contents
from matplotlib.image import imread
from virtual_swings import recorded, swing

from pendulum_env import Scene, plots
from pendulum_env.lab import Recording, measure
from pendulum_env.lab.fitting import fit as fitting
from pendulum_env.lab.fitting.grade import Fault
from pendulum_env.lab.fitting.model import Model
from pendulum_env.lab.fitting.result import Fit, FitComparison
from pendulum_env.lab.fitting.shooting import FitSolution, jacobian
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import Gravity, LinearDrag
from pendulum_env.physics.medium import air
from pendulum_env.physics.units import SceneError
from pendulum_env.plots import recorded as figure
from pendulum_env.study import fit_report as report
from pendulum_env.study.compare import Comparison, compare
from pendulum_env.study.fit_report import against_told, to_lay_over, write

LENGTH, GAMMA, START, ZERO, NOISE = 0.1, 0.2, 0.6, 0.03, 2e-3
TRUE = Scene("true", Body(length=LENGTH, mass=0.05, radius=0.01), air(20.0), (Gravity(), LinearDrag(gamma=GAMMA)))


@lru_cache
def virtual() -> Recording:
    time = np.arange(501) / 100.0
    return recorded(time, swing(time, START, length=LENGTH, gamma=GAMMA), noise=NOISE, zero=ZERO, seed=1)


def measured_file(folder: Path) -> None:
    """Write a recording of 0.65 m in degrees, and periods of 1.5 s."""
    time = np.arange(1000) / 50.0
    angles = 20.0 * np.cos(math.sqrt(9.81 / 0.65) * time) + 0.05 * np.random.default_rng(0).standard_normal(1000)
    (folder / "swing.txt").write_text("Time (s)\tAngle (deg)\n" + "".join(
        f"{t:.3f}\t{x:.3f}\n" for t, x in zip(time, angles, strict=True)))
    (folder / "periods.txt").write_text("Period (s)\n1.500\n1.501\n1.499\n1.500\n")


def test_measure_gives_gravity_with_a_length(tmp_path: Path, run_here: Here) -> None:
    measured_file(tmp_path)
    code, printed, said = run_here("measure", "swing.txt", "--length", "0.65", "--length-error", "0.0065", "--out", "x")
    assert code == 0, said
    (row,) = (row for row in table(tmp_path / "x" / "measured.csv")[1] if row["quantity"] == "gravity")
    assert float(row["error"]) == pytest.approx(0.01 * float(row["value"]), rel=0.1)
    assert "With the given length of 0.65 m, g = " in printed
    for file in ("swing.txt", "periods.txt"):
        _, printed, _ = run_here("measure", file, "--length", "6.5", "--out", "x")
        assert "the length or the time base is wrong" in printed


@pytest.mark.parametrize(("words", "said"), [
    (["swing.txt", "--length-error", "0.01"], "--length-error needs --length"),
    (["swing.txt", "--length", "0.65", "--length-error", "0"], "--length-error must be"),
    (["periods.txt", "--radius", "0.01"], "--radius is for recordings of a swing, and periods.txt is of a photogate"),
    (["periods.txt", "--oscillations", "2"], "--oscillations is for recordings of a swing"),
])
def test_measure_refuses_options_without_a_use(
    words: list[str], said: str, tmp_path: Path, run_here: Here
) -> None:
    measured_file(tmp_path)
    before = contents(tmp_path)
    code, _, error = run_here("measure", *words)
    assert code == 2
    assert said in error
    assert contents(tmp_path) == before


def at_truth(recording: Recording, damping: str = "linear") -> Fit:
    """Return a Fit with the true parameter values, which a least-squares fit would reach up to its errors."""
    free = recording.released()
    model = Model.of(TRUE, (damping,), free.time)
    values = np.array([START, 0.0, ZERO, LENGTH, GAMMA])
    angle, velocity = model.motion(values)
    residual = free.angle - angle[0]
    return Fit(free, FitSolution(model, values, residual, jacobian(model, values), velocity[0], 5.0), NOISE)


class Another(Fit):
    """A Fit with the parameters of another model."""

    @property
    def damping(self) -> str:
        return "another"


def shifted(fit: Fit) -> Fit:
    """Return a copy of a fit with clearly larger residuals."""
    off = replace(fit.solution, values=fit.values * [1.0, 1.0, 1.0, 1.0, 1.3], residual=1.0 + fit.residual)
    return Another(fit.recording, off, NOISE)


@pytest.fixture(scope="module")
def found() -> Iterator[Fit]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("LAB_PENDULUM_BACKEND", "python")
        yield at_truth(virtual())


def write_swing(folder: Path) -> None:
    """Write a recording into a folder, as swing.txt."""
    made = virtual()
    lines = [f"{t:.6f}\t{math.degrees(x):.9f}\n" for t, x in zip(made.time, made.angle, strict=True)]
    (folder / "swing.txt").write_text("time [s]\tangle [deg]\n" + "".join(lines))


@pytest.fixture
def asked(found: Fit, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[dict[str, Any]]:
    """Put a recording into the folder, replace ``fit`` by a stand-in, and return the list of arguments it is called
    with."""
    write_swing(tmp_path)
    calls: list[dict[str, Any]] = []

    def fit(recording: Recording, effects: str = "auto", **options: Any) -> Fit:
        calls.append({"recording": recording, "effects": effects, **options})
        warnings.warn("nobody told the mass", UserWarning, stacklevel=1)
        best = replace(found, recording=replace(found.recording, source=recording.source))
        if effects != "auto":
            return best
        return replace(best, comparison=FitComparison.of((best, shifted(best))))

    monkeypatch.setattr(fitting, "fit", fit)
    return calls


def test_it_prints_and_writes_all(
    asked: list[dict[str, Any]], tmp_path: Path, run_here: Here, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(figure, "recorded", lambda found: plots.figure(size=(1.0, 1.0))[0])
    code, printed, said = run_here("fit", "swing.txt", "--length", "0.105", "--length-error", "0.004", "--mass", "0.05",
                                   "--set", "radius=0.01", "--details", "--out", "x")
    assert code == 0, said
    for words in ("unit: deg, as the header says", "quality factor", "Reynolds number",
                  "Damping: linear fits best", "delta BIC", "linear_drag.gamma", "r gamma",
                  "chi² =", "runs test", "1.2 sigma below",
                  "theta'' = -98.1 sin(theta) - 0.2 theta'", "Wrote 7 files to x", "--scene x/scene.json"):
        assert words in printed, words
    own = [line for line in said.splitlines() if line.strip() and "deprecated" not in line]  # of old matplotlib
    assert own == ["Warning: nobody told the mass"]
    (call,) = asked
    assert (call["effects"], call["free"], call["length"], call["mass"], call["radius"]) == (
        "auto", None, 0.105, 0.05, 0.01)
    assert {path.name for path in (tmp_path / "x").iterdir()} == {
        "measured.csv", "amplitudes.csv", "parameters.csv", "residuals.csv", "models.csv", "fit.png", "scene.json"}


def test_without_details_a_result_is_sentences_and_a_table(
    asked: list[dict[str, Any]], run_here: Here, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(figure, "recorded", lambda found: plots.figure(size=(1.0, 1.0))[0])
    code, printed, said = run_here("fit", "swing.txt", "--mass", "0.05", "--radius", "0.01", "--out", "x")
    assert code == 0, said
    for words in ("oscillations of", "linear_drag.gamma", "The fit is usable.", "Damping: linear fits best",
                  "theta'' = -98.1 sin(theta)"):
        assert words in printed, words
    for words in ("quality factor", "delta BIC", "r gamma", "chi²", "runs", "Newey"):
        assert words not in printed, words


def test_no_verdict_follows_a_fit_that_is_not_usable(
    found: Fit, asked: list[dict[str, Any]], run_here: Here, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The grade is said once, and no model, length or pattern is judged beside it."""
    monkeypatch.setattr(figure, "recorded", lambda found: plots.figure(size=(1.0, 1.0))[0])
    bad = replace(found, faults=(Fault("the pendulum is driven", True),))
    bad = replace(bad, comparison=FitComparison.of((bad, shifted(bad))))
    monkeypatch.setattr(fitting, "fit", lambda *_words, **_options: warnings.warn(bad.grade.text, stacklevel=1) or bad)
    code, printed, said = run_here("fit", "swing.txt", "--length", "0.105", "--length-error", "0.004", "--out", "x")
    assert code == 0, said
    assert (printed + said).count("The fit is not usable, because the pendulum is driven.") == 1
    for words in ("Damping:", "verdict", "ruled out", "sigma", "runs test"):
        assert words not in printed, words


@pytest.mark.parametrize(("told", "said"), [(0.2, "given 0.2 m: 50.0% below;"), (0.08, "given 0.08 m: 25.0% above;")])
def test_a_length_that_is_told_is_compared(found: Fit, told: float, said: str) -> None:
    assert said in report.against_told(found, told)


@pytest.mark.slow
def test_what_was_told_is_set_against_the_fit_and_what_was_not_is_said(
    asked: list[dict[str, Any]], run_here: Here
) -> None:
    _, printed, _ = run_here("fit", "swing.txt", "--length", "0.2", "--effects", "linear", "--out", "x")
    assert asked[0]["effects"] == "linear"
    assert "given 0.2 m: 50.0% below; state its error with --length-error" in printed
    assert "Radius: assumed to be" in printed
    _, printed, _ = run_here("fit", "swing.txt", "--radius", "0.01", "--effects", "linear", "--out", "x")
    assert "--length-error" not in printed
    assert "Radius" not in printed


def test_what_was_inferred_is_said_before_a_file_is_refused(tmp_path: Path, run_here: Here) -> None:
    time = np.arange(0.0, 20.0, 0.02)
    rows = [f"{t:.3f} {4.0 * math.cos(5.2 * t):.4f}" for t in time]  # degrees, but no header says so
    (tmp_path / "bare.txt").write_text("time angle\n" + "\n".join(rows) + "\n")
    code, printed, said = run_here("fit", "bare.txt", "--effects", "linear", "--out", "x")
    assert code != 0
    assert "unit: rad, inferred" in printed
    assert said.startswith("Error: ")


@pytest.mark.slow
@pytest.mark.usefixtures("interpreted")
def test_a_length_neither_told_nor_fitted_is_warned_of() -> None:
    with pytest.warns(UserWarning, match=r"the length is taken to be .* m, as it is neither given nor fitted"):
        fitting.fit(virtual(), "linear", free=("gravity",), mass=0.05)
    fitting.fit(virtual(), "linear", free=("gravity",), mass=0.05, length=0.1)


@pytest.mark.slow
def test_files_say_where_they_come_from(found: Fit, tmp_path: Path) -> None:
    write(found, measure(virtual(), radius=0.01), tmp_path)
    for name in ("measured", "amplitudes", "parameters", "residuals"):
        facts, _ = table(tmp_path / f"{name}.csv")
        assert facts["recording"] == "virtual"
        assert facts["Software"].startswith("lab-pendulum ")
    assert not (tmp_path / "models.csv").exists()
    assert b"virtual" in (tmp_path / "fit.png").read_bytes()
    origin = json.loads((tmp_path / "scene.json").read_text())["provenance"]
    assert origin["damping"] == "linear"
    assert origin["grade"].endswith(". The fit is usable.")
    rows = table(tmp_path / "residuals.csv")[1]
    columns = {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}
    np.testing.assert_array_equal(columns["time_s"], found.recording.time)
    np.testing.assert_allclose(columns["recorded_rad"] - columns["model_rad"], columns["residual_rad"], atol=1e-15)
    assert np.std(columns["residual_rad"]) == pytest.approx(NOISE, rel=0.1)
    numbers = {row["parameter"]: row for row in table(tmp_path / "parameters.csv")[1]}
    assert float(numbers["length"]["value"]) == LENGTH
    assert numbers["length"]["unit"] == "m"
    assert float(numbers["angle"]["correlation_angle"]) == pytest.approx(1.0)
    sizes = [float(row["amplitude_rad"]) for row in table(tmp_path / "amplitudes.csv")[1]]
    half = math.pi / math.sqrt(98.1 - GAMMA**2 / 4.0)
    assert sizes[-10] / sizes[-1] == pytest.approx(math.exp(GAMMA / 2.0 * 9.0 * half), rel=0.02)


@pytest.mark.slow
def test_the_scene_is_what_gym_takes_and_compare_lays_on_the_recording(
    found: Fit, asked: list[dict[str, Any]], tmp_path: Path, run_here: Here,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found.scene.save(tmp_path / "scene.json")
    env = gym.make("LabPendulum-v0", scene=str(tmp_path / "scene.json"), task="free", backend="python")
    assert env.reset(seed=0)[1]["angle"] == pytest.approx(START)
    again = compare(str(tmp_path / "scene.json"), "rk4", recording=virtual())
    assert (again.angle, again.velocity, again.duration) == (START, 0.0, pytest.approx(5.0))
    assert again.drift[0].recording == pytest.approx(NOISE, rel=0.1)
    assert np.abs(np.interp(again.recording.time, *motion(again)) - again.recording.angle).max() < 5.0 * NOISE
    monkeypatch.setattr(Comparison, "pictures", lambda comparison: {})
    code, printed, said = run_here("compare", "--scene", "scene.json", "--integrators", "rk4", "--no-film",
                                   "--recording", "swing.txt", "--read", "scale=-1", "--angle",
                                   str(-math.degrees(START)), "--out", "y")
    assert code == 0, said
    assert "time zero: the release" in printed
    assert float(table(tmp_path / "y" / "drift.csv")[1][0]["recording_rms_rad"]) == pytest.approx(NOISE, rel=0.1)


def motion(comparison: Any) -> tuple[Any, Any]:
    (run,) = comparison.runs.values()
    return run.time, run.angle


@pytest.mark.slow
def test_another_scene_starts_where_the_recording_turns() -> None:
    scene = TRUE.replace(run={"angle": START, "velocity": 0.0, "duration": 4.0})
    other = compare(scene, "rk4", recording=virtual())
    assert other.angle == pytest.approx(-START * math.exp(-GAMMA / 4.0 * 0.634), abs=0.01)


# --- printed text ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("told", "error", "said"), [
    (LENGTH + 0.015, 0.006, "2.5 sigma below; the fit is in tension"),
    (LENGTH + 0.006, 0.006, "1.0 sigma below; the fit agrees"),
    (LENGTH - 0.03, 0.006, "5.0 sigma above; the fit contradicts")])
def test_a_told_length_is_set_against_the_fitted_one(found: Fit, told: float, error: float, said: str) -> None:
    assert found.parameters["length"].error < 1e-2 * error
    assert said in against_told(found, told, error)


def test_a_length_that_was_not_fitted_has_nothing_to_be_set_against(found: Fit) -> None:
    other = replace(found, solution=replace(found.solution, model=replace(found.model, names=("angle", "velocity",
                                                                       "zero", "gravity", "linear_drag.gamma"))))
    with pytest.raises(SceneError, match="the fitted parameters are: gravity"):
        against_told(other, 0.1, 0.01)


def test_details_say_whether_a_pattern_is_left(found: Fit) -> None:
    assert "as often as by chance" in found.details
    wave = found.residual + 5e-3 * np.sin(found.recording.time)
    off = replace(found, solution=replace(found.solution, residual=wave))
    assert "has a pattern" in off.details
    assert "p < 1e-06" in off.details


def test_the_command_that_follows_takes_the_scale(found: Fit) -> None:
    assert to_lay_over(found, "a.txt", Path("x/scene.json")) == (
        "lab-pendulum compare --scene x/scene.json --recording a.txt")
    model = replace(found.model, names=("angle", "velocity", "zero", "scale", "linear_drag.gamma"))
    values = np.array([START, 0.0, ZERO, 1.01, GAMMA])
    scaled = replace(found, solution=replace(found.solution, model=model, values=values))
    assert to_lay_over(scaled, "a.txt", Path("s.json")).endswith("--read scale=0.990099")
    assert to_lay_over(scaled, "a b.txt", Path("s.json"), ["scale=-2", "unit=deg"]).endswith(
        "--recording 'a b.txt' --read scale=-1.9802 --read unit=deg")


def test_the_parameter_table_has_a_row_and_a_column_for_each(found: Fit) -> None:
    assert found.table.head == ("parameter", "value", "unit")
    made = found.detailed_table
    assert [row[0] for row in made.rows] == list(found.names)
    assert made.head[3:] == ("r angle", "r velocity", "r zero", "r length", "r gamma")
    assert all(row[3 + i] == "+1.00" for i, row in enumerate(made.rows))


# --- the figure ------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_figure_shows_each_part_in_degrees(found: Fit) -> None:
    drawn = figure.recorded(replace(found, comparison=FitComparison.of((found, shifted(found)))))
    whole, residual, first, last, envelope, phase = drawn.axes
    assert whole.get_xlim() == (0.0, pytest.approx(5.0))
    band = residual.patches[0].get_path().get_extents(residual.patches[0].get_patch_transform())
    assert (band.y0, band.y1) == pytest.approx((-math.degrees(found.noise), math.degrees(found.noise)))
    assert first.get_xlim()[1] < last.get_xlim()[0]
    assert all("[degrees]" in at.get_ylabel() for at in (whole, first, last, residual, envelope))
    assert all(at.get_xlabel() for at in drawn.axes)
    reading, model = whole.get_lines()[:2]
    assert np.max(reading.get_ydata()) == pytest.approx(math.degrees(START), rel=0.02)
    assert np.max(model.get_ydata()) == pytest.approx(math.degrees(START), rel=1e-3)
    assert envelope.get_yscale() == "log"
    assert len(envelope.get_legend().get_texts()) == 3
    decay = np.log(envelope.get_lines()[1].get_ydata())
    time = envelope.get_lines()[1].get_xdata()
    assert np.polyfit(time, decay, 1)[0] == pytest.approx(-GAMMA / 2.0, rel=0.03)
    assert phase.get_ylabel() == "velocity [rad/s]"
    readings = phase.get_lines()[0].get_xydata()
    assert np.abs(readings[:, 1]).max() == pytest.approx(2.0 * math.sqrt(98.1) * math.sin(START / 2.0), rel=0.06)


@pytest.mark.slow
def test_no_two_models_have_the_same_line(found: Fit) -> None:
    """Colours begin again with the sixth model after the best one; then dash patterns differ."""
    drawn = figure.recorded(replace(found, comparison=FitComparison.of((found,) * 12)))
    lines = [line for line in drawn.axes[4].get_lines() if line.get_linestyle() != "None"]
    looks = {(line.get_color(), line.get_linewidth()) for line in lines}  # each pattern has a width of its own
    assert len(looks) == len(lines) == 12


def test_slopes_are_those_of_a_cubic() -> None:
    time = np.cumsum(np.random.default_rng(0).uniform(0.01, 0.03, 60))
    where = np.array([0, 1, 20, 58, 59])
    np.testing.assert_allclose(figure.slopes(time, 1.0 + 2.0 * time - 3.0 * time**3, where, 0.1),
                               2.0 - 9.0 * time[where] ** 2, rtol=1e-8)


# --- refusals --------------------------------------------------------------------------------------------------------

BAD = {
    "no file": (["none.txt"], "none.txt"),
    "malformed": (["bad.txt"], "line 4"),
    "too short": (["short.txt"], "short.txt"),
    "unit": (["swing.txt", "--unit", "grad"], "unit must be"),
    "scale": (["swing.txt", "--scale", "0"], "scale must be"),
    "rate": (["swing.txt", "--rate", "-1"], "rate must be"),
    "told twice": (["swing.txt", "--length", "1", "--set", "length=2"], "length is given twice"),
    "read twice": (["swing.txt", "--scale", "1", "--read", "scale=2"], "scale is given twice"),
    "read": (["swing.txt", "--read", "colums=1,2"], "did you mean columns"),
    "read without a value": (["swing.txt", "--read", "rate"], "--read needs name=value, as in --read scale=0.99"),
    "read one twice": (["swing.txt", "--read", "zero=1", "--read", "zero=2"], "--read gives zero twice"),
    "parameter": (["swing.txt", "--set", "lenght=1"], "did you mean length"),
    "length": (["swing.txt", "--length", "-1"], "length must be"),
    "error without length": (["swing.txt", "--length-error", "0.1"], "needs --length"),
    "error": (["swing.txt", "--length", "1", "--length-error", "0"], "--length-error must be"),
    "oscillations": (["swing.txt", "--oscillations", "500"], "500 full oscillations"),
    "scene": (["swing.txt", "--scene", "exercize"], "did you mean exercise"),
    "suspension": (["swing.txt", "--suspension", "chain"], "suspension"),
    "folder": (["swing.txt", "--out", "swing.txt/x"], "cannot be written"),
    "effects": (["swing.txt", "--effects", "liner"], "did you mean linear"),
    "free": (["swing.txt", "--free", "lenght"], "did you mean length"),
    "error of a length that is not fitted": (
        ["swing.txt", "--length", "0.1", "--length-error", "0.01", "--free", ""], "the fitted parameters are: nothing"),
    "prior": (["swing.txt", "--posterior", "--prior", "gama=0:1"], "did you mean gamma"),
    "range of a prior": (["swing.txt", "--posterior", "--prior", "gamma=1:0"], "upper end of the prior of gamma"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_sentence_and_leaves_files_as_they_were(
    case: str, asked: list[dict[str, Any]], tmp_path: Path, run_here: Here
) -> None:
    words, expected = BAD[case]
    (tmp_path / "bad.txt").write_text("time\tangle\n0.0\t1.0\n0.1\t0.9\n0.2\tx\n0.3\t0.7\n")
    (tmp_path / "short.txt").write_text("".join(f"{i / 10}\t{i}\n" for i in range(20)))
    before = contents(tmp_path)
    code, _, said = run_here("fit", *words, *(() if "--out" in words else ("--out", "x")))
    assert code == 2
    assert not asked, "refused before it is fitted"
    assert expected in said
    assert len(said.strip().splitlines()) == 1
    assert contents(tmp_path) == before


def test_numbers_in_other_units_are_said_also_where_the_fit_fails(tmp_path: Path, run_here: Here) -> None:
    write_swing(tmp_path)
    code, _, said = run_here("fit", "swing.txt", "--mass", "40", "--radius", "1.07")
    assert code == 2
    assert "40 g would be mass=0.04" in said
    assert "1.07 cm would be radius=0.0107" in said


def test_compare_reads_no_recording_that_is_missing(tmp_path: Path, run_here: Here) -> None:
    code, _, said = run_here("compare", "--read", "scale=2")
    assert code == 2
    assert "--read needs a recording" in said


def test_how_a_file_is_read_can_be_told(
    asked: list[dict[str, Any]], tmp_path: Path, run_here: Here, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines = (tmp_path / "swing.txt").read_text().splitlines()[1:]
    (tmp_path / "other.txt").write_text("".join(f"7,{line.replace(chr(9), ',')}\n" for line in lines))
    monkeypatch.setattr(report, "write", lambda *_words, **_options: [tmp_path / "x"])
    code, printed, said = run_here("fit", "other.txt", "--effects", "linear", "--read", "columns=2,3", "--unit", "deg",
                                   "--read", "separator=comma", "--scale", "2", "--out", "x")
    assert code == 0, said
    assert asked[0]["recording"].angle[0] == pytest.approx(2.0 * virtual().angle[0], abs=1e-6)
    assert "models" not in printed
    assert "--read unit=deg --read scale=2 --read columns=2,3 --read separator=comma" in " ".join(printed.split())


def test_the_command_that_follows_is_one_line_to_copy(
    asked: list[dict[str, Any]], tmp_path: Path, run_here: Here, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Folding the printed command would split it, and change white space in names."""
    scene = tmp_path / "a  folder with a name that is longer than a line of the printed text, by far" / "scene.json"
    (tmp_path / "swing.txt").rename(tmp_path / "my  swing's.txt")
    monkeypatch.setattr(report, "write", lambda *_words, **_options: [scene])
    _, printed, said = run_here("fit", "my  swing's.txt", "--effects", "linear", "--out", "x")
    command = next(line for line in printed.splitlines() if line.startswith("lab-pendulum compare"))
    assert shlex.split(command)[2:] == ["--scene", str(scene), "--recording", "my  swing's.txt"], said


def test_a_folder_that_can_not_be_written_is_said_before_the_fit(
    asked: list[dict[str, Any]], run_here: Here
) -> None:
    code, _, said = run_here("fit", "swing.txt", "--out", "swing.txt")
    assert code == 2
    assert "cannot be written" in said
    assert not asked


def test_an_interrupted_fit_leaves_no_files(
    asked: list[dict[str, Any]], tmp_path: Path, run_here: Here, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(*_words: Any, **_options: Any) -> Fit:
        raise KeyboardInterrupt

    before = contents(tmp_path)
    monkeypatch.setattr(fitting, "fit", stop)
    code, _, said = run_here("fit", "swing.txt", "--out", "x")
    assert code == 130
    assert "Interrupted" in said
    assert contents(tmp_path) == before


# --- real fits --------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_film_from_the_command_line(
    tmp_path: Path, recordings: Path, run_here: Here, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LAB_PENDULUM_BACKEND", "compiled")
    code, printed, said = run_here(
        "fit", str(recordings / "video_decay_65cm.txt"), "--length", "0.65", "--length-error", "0.01", "--mass",
        "0.0415", "--suspension", "wire", "--effects", "quadratic+coulomb", "--out", "x")
    assert code == 0, said
    assert "1.2 sigma above" in printed
    scene = Scene.load(tmp_path / "x" / "scene.json")
    assert scene.body.length == pytest.approx(0.6634, abs=5e-4)
    assert imread(tmp_path / "x" / "fit.png").shape[0] > 1000
    with (tmp_path / "x" / "residuals.csv").open() as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("# ")))
    rest = np.array([float(row["residual_rad"]) for row in rows])
    assert len(rest) == 2330
    assert math.degrees(math.sqrt(np.mean(rest**2))) < 0.48
    monkeypatch.setattr(Comparison, "pictures", lambda comparison: {})
    laid = compare(scene, "dop853", recording=Recording.read(recordings / "video_decay_65cm.txt"))
    assert laid.drift[0].recording is not None
    assert math.degrees(laid.drift[0].recording) < 0.5
