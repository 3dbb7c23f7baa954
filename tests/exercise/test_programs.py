"""The programs that the exercise writes run without the package, and compute the numbers of its report.

Truths are the report's numbers and curves, closed forms of the Euler methods, SciPy's elliptic integral and DOP853.
"""

from __future__ import annotations

import csv
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipk

from pendulum_env.exercise import report
from pendulum_env.exercise.figures import FIGURES
from pendulum_env.exercise.given import Given, by_hand
from pendulum_env.exercise.language import language_of
from pendulum_env.exercise.programs import program_names, programs
from pendulum_env.exercise.values import values
from pendulum_env.exercise.worked import Worked, work_out
from pendulum_env.lab import Recording

pytest.importorskip("jinja2")

OMEGA, GAMMA, START = 5.3, 0.06, math.radians(25.0)
"""Angular frequency [rad/s], damping rate [1/s] and release angle of the recorded pendulum."""
LABELS = language_of("en").figures
ALONE = """
import runpy, sys
sys.modules["pendulum_env"] = sys.modules["integrators"] = sys.modules["scipy"] = None
for program in sys.argv[1:]:
    runpy.run_path(program, run_name="__main__")
    import matplotlib.pyplot
    matplotlib.pyplot.close("all")
"""
"""Runs programs where importing the package or SciPy is an error."""
MINE = "omega = omega + acceleration(theta, omega)*dt\ntheta = theta + omega*dt"


def swing() -> Recording:
    """Return a swing with linear drag, integrated by SciPy, with the noise of a sensor."""
    time = np.arange(0.0, 40.0, 0.02)
    run = solve_ivp(lambda _t, y: [y[1], -OMEGA * OMEGA * math.sin(y[0]) - GAMMA * y[1]], (0.0, 40.0), [START, 0.0],
                    t_eval=time, method="DOP853", rtol=1e-10, atol=1e-11)
    noise = np.random.default_rng(5).normal(0.0, math.radians(0.05), len(time))
    return Recording(time, run.y[0] + noise, "integrated by SciPy")


class Done:
    """A worked exercise, and the folder in which its programs ran."""

    def __init__(self, worked: Worked, folder: Path) -> None:
        self.worked, self.folder = worked, folder
        for name, text in programs(worked, LABELS, report.environment(language_of("en"))):
            (folder / name).write_text(text, encoding="utf-8")
        for _ in report.tables(worked, False, folder, {"Command": "none"}):
            pass
        names = program_names(worked)
        done = subprocess.run([sys.executable, "-I", "-c", ALONE, *(str(folder / name) for name in names)], cwd=folder,
                              capture_output=True, text=True, env={"MPLBACKEND": "agg", "MPLCONFIGDIR": str(folder)})
        assert done.returncode == 0, done.stderr
        self.parts: dict[str, dict[str, float]] = {}
        self.numbers: dict[str, float] = {}
        for name in names:
            with (folder / name.replace(".py", "_numbers.csv")).open(encoding="utf-8", newline="") as file:
                found = {row["quantity"]: float(row["value"]) for row in csv.DictReader(file)}
            self.parts[name[5:-3].replace("_", ".")] = found
            self.numbers |= found

    def curves(self, part: str) -> dict[str, np.ndarray]:
        """Return the columns of a part's curves by their titles."""
        path = self.folder / f"part_{part}_curves.csv"
        titles = path.read_text(encoding="utf-8").split("\n")[0].split(",")
        return dict(zip(titles, np.loadtxt(path, delimiter=",", skiprows=1).T, strict=True))


@pytest.fixture(scope="module")
def worked() -> Worked:
    return work_out(Given.of(recording=swing(), length=0.353), step=MINE)


@pytest.fixture(scope="module")
def done(worked: Worked, tmp_path_factory: pytest.TempPathFactory) -> Done:
    return Done(worked, tmp_path_factory.mktemp("programs"))


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Done:
    return Done(work_out(Given.of()), tmp_path_factory.mktemp("simulated"))


def check_numbers(done: Done) -> None:
    """Check that the programs' numbers are those of the report."""
    known = {(row.part.replace("1.5", "1.4"), row.quantity): row.value for row in values(done.worked)}
    known["2.2", "period, mean of the run"] = done.worked.large.period
    known["2.4", "error of this gamma"] = done.worked.recorded.gamma.error
    known["2.5", "energy of the damped run at the end over its start"] = done.worked.recorded.damped.ratio
    for part, numbers in done.parts.items():
        for name, value in numbers.items():
            if (part, name) in known:
                tolerance = 1e-6 if "measured period" in name else 1e-8
                assert value == pytest.approx(known[part, name], rel=tolerance), (part, name)
            else:
                assert name.endswith("by the mean amplitude"), (part, name)
    for start in ("error of one step", "growth", "energy at the end", "largest angle error", "largest energy",
                  "measured period", "period by the elliptic", "speed", "Reynolds", "gamma from these", "root mean",
                  "largest difference", "mean period of"):
        assert any(name.startswith(start) for name in done.numbers), start


@pytest.mark.slow
def test_numbers_are_those_of_the_report(done: Done) -> None:
    check_numbers(done)
    assert "mean period of 6 oscillations of the recording" in done.numbers
    assert "energy at the end over its start, own_step" in done.numbers


@pytest.mark.slow
def test_numbers_with_the_simulated_recording_are_those_of_the_report(simulated: Done) -> None:
    check_numbers(simulated)
    text = (simulated.folder / "part_2_6.py").read_text(encoding="utf-8")
    assert "# The recording is simulated." in text
    assert "part_1_1.py" not in program_names(simulated.worked)


@pytest.mark.slow
def test_curves_are_those_of_the_report(done: Done) -> None:
    worked = done.worked
    runs = [("1_2", "", worked.small.forward), ("2_2", "", worked.large.run), ("2_5", "", worked.recorded.damped),
            *(("2_1", f"{name}_", run) for name, run in worked.small.runs.items())]
    for part, start, run in runs:
        curves = done.curves(part)
        for name, truth in (("angle_rad", run.angle), ("velocity_rad_s", run.velocity), ("energy", run.energy)):
            np.testing.assert_allclose(curves[start + name], truth, rtol=1e-8, atol=1e-8 * np.max(np.abs(truth)))
    np.testing.assert_allclose(done.curves("2_6")["simulated_rad"], worked.recorded.compared.simulated, atol=1e-8)
    np.testing.assert_allclose(done.curves("2_6")["recorded_rad"], worked.recorded.compared.recorded, atol=1e-12)


@pytest.mark.slow
def test_the_euler_methods_are_their_closed_forms(done: Done) -> None:
    """Forward Euler multiplies energy by 1 + (Omega dt)**2 in a step, backward Euler divides it by that."""
    factor = (1.0 + (done.worked.small.omega * 0.01) ** 2) ** 1000
    assert done.numbers["energy at the end over its start, forward_euler"] == pytest.approx(factor, rel=1e-10)
    assert done.numbers["energy at the end over its start, backward_euler"] == pytest.approx(1.0 / factor, rel=1e-10)
    curves, z = done.curves("2_1"), done.worked.small.omega * 0.01
    step = np.array([[1.0 - z * z, 0.01], [-z * z / 0.01, 1.0]])  # (theta, omega) of symplectic Euler, by hand
    state = np.array([math.radians(5.0), 0.0])
    for angle, velocity in zip(curves["symplectic_euler_angle_rad"], curves["symplectic_euler_velocity_rad_s"],
                               strict=True):
        assert (angle, velocity) == (pytest.approx(state[0], abs=1e-12), pytest.approx(state[1], abs=1e-12))
        state = step @ state


@pytest.mark.slow
def test_periods_runs_and_damping_are_those_of_scipy(done: Done) -> None:
    curves = done.curves("2_3")
    true = 4.0 * ellipk(np.sin(0.5 * np.radians(curves["amplitude_deg"])) ** 2) / done.worked.small.omega
    np.testing.assert_allclose(curves["elliptic_s"], true, rtol=1e-12)
    np.testing.assert_allclose(curves["period_s"], true, rtol=2e-4)
    assert done.numbers["Omega, by the mean amplitude"] == pytest.approx(OMEGA, rel=5e-4)
    assert done.numbers["gamma from these amplitudes"] == pytest.approx(GAMMA, rel=0.02)
    damped, gamma = done.curves("2_5"), done.worked.recorded.gamma.value
    omega = done.worked.small.omega
    truth = solve_ivp(lambda _t, y: [y[1], -omega * omega * math.sin(y[0]) - gamma * y[1]], (0.0, 5.0),
                      [math.radians(30.0), 0.0], t_eval=damped["time_s"][:500], method="DOP853", rtol=1e-9, atol=1e-11)
    ahead = 0.6 * omega * 0.01 * math.radians(30.0)  # the method is half a step ahead
    np.testing.assert_allclose(damped["angle_rad"][:500], truth.y[0], atol=ahead)


@pytest.mark.slow
def test_every_figure_of_the_report_is_drawn_by_a_program(done: Done) -> None:
    drawn = [path.stem.split("_", 3)[3] for path in done.folder.glob("part_*.png")]
    assert sorted(drawn) == sorted(draw.__name__ for draw in FIGURES)
    assert min(path.stat().st_size for path in done.folder.glob("part_*.png")) > 5000


def test_programs_are_readable(worked: Worked) -> None:
    """No line is too long for a screen, and the loops are those that a student knows."""
    written = dict(programs(worked, LABELS, report.environment(language_of("en"))))
    assert set(written) == set(program_names(worked))
    assert max(len(line) for text in written.values() for line in text.split("\n")) <= 120
    text = written["part_2_1.py"]
    assert "theta, omega = np.linalg.solve(system, (theta, omega))" in text
    assert "        omega = omega + dt*acceleration(theta)\n        theta = theta + dt*omega\n" in text
    assert "pendulum_env" not in "".join(written.values())


def test_the_report_names_the_programs(worked: Worked) -> None:
    drawings = {draw.__name__: report.Drawing(i + 1, "") for i, draw in enumerate(FIGURES)}
    facts = {"Software": "x", "Sources": "s", "Python": "y", "Command": "z"}
    page = report.page(worked, drawings, "", False, facts)
    assert all(page.count(f"<code>{name}</code>") == 1 for name in program_names(worked))
    assert "part_1_1.py" in page


@pytest.mark.slow
def test_the_program_of_a_recording_with_a_gap_does_not_count_its_oscillations_wrongly() -> None:
    """Readings miss for one oscillation among the first six, which the report counts all the same."""
    whole = swing()
    kept = (whole.time < 2.0) | (whole.time > 3.4)
    worked = work_out(Given.of(recording=Recording(whole.time[kept], whole.angle[kept], "with a gap")))
    assert worked.given.sheet.period.value == pytest.approx(2.0 * math.pi / OMEGA, rel=0.02)
    assert "part_1_1.py" not in program_names(worked)


@pytest.mark.slow
@pytest.mark.parametrize("step", ["if theta > 3: theta -= 2*math.pi\n" + MINE])
def test_a_step_of_one_s_own_that_branches_is_left_out(step: str) -> None:
    text = dict(programs(work_out(Given.of(), step=step), LABELS, report.environment(language_of("en"))))["part_2_1.py"]
    assert "own_step" not in text
    assert "def symplectic_euler(" in text


# --- readings by hand -----------------------------------------------------------------------------------------------

READ = "0:30, 10:25.9, 20:22.2, 30:19.1, 45:15.4, 60:12.2"
"""Amplitudes read by hand, those of gamma = 0.03/s."""
GRAVITY = 9.81


def tables(folder: Path, centre: bool) -> tuple[Path, Path]:
    """Write the periods of five lengths, 5 mm too short, and of a reversible pendulum of 1 m: two curves that cross
    twice, or a centre of mass at 0.3 m with a radius of gyration of 0.44 m."""
    lengths, kater, period = folder / "lengths.csv", folder / "kater.csv", 2.0 * math.pi / math.sqrt(GRAVITY)
    lengths.write_text("length (cm),10 T (s)\n" + "".join(
        f"{100 * one - 0.5},{10 * period * math.sqrt(one):.3f}\n" for one in (0.2, 0.4, 0.6, 0.8, 1.0)))
    if centre:
        rows = [(h, *(period * math.sqrt((0.44**2 + x * x) / x) for x in (h, 1.0 - h))) for h in (0.28, 0.3, 0.32)]
        kater.write_text("h1 (m),T1 (s),T2 (s)\n" + "".join(f"{h},{a:.7f},{b:.7f}\n" for h, a, b in rows))
    else:
        bend = [0.0001 * (x - 4) * (x - 16) for x in range(0, 21, 2)]
        kater.write_text("position (cm),T1 (s),T2 (s)\n" + "".join(
            f"{2 * k},{period + one:.7f},{period - 2 * one:.7f}\n" for k, one in enumerate(bend)))
    return lengths, kater


@pytest.mark.slow
@pytest.mark.parametrize("centre", [False, True])
def test_programs_of_readings_by_hand(centre: bool, tmp_path: Path) -> None:
    """The truths are the formulas that the tables were written from, and the report."""
    lengths, kater = tables(tmp_path, centre)
    worked = work_out(by_hand(Given.of(period=1.19), READ, lengths, kater, "1.0000"))
    done = Done(worked, tmp_path)
    known = {row.quantity: row.value for row in values(worked)}
    for name in ("gamma from these amplitudes", "gravity from T² against the length", "offset of the length",
                 "gravity from T² against the length, offset 0", "period of the reversible pendulum",
                 "gravity from the reversible pendulum"):
        assert done.numbers[name] == pytest.approx(known[name], rel=1e-8), name
    assert done.numbers["gamma from these amplitudes"] == pytest.approx(0.03, rel=0.02)
    assert done.numbers["gravity from T² against the length"] == pytest.approx(GRAVITY, rel=2e-3)
    assert done.numbers["gravity from the reversible pendulum"] == pytest.approx(GRAVITY, rel=1e-5)
    starts = "root mean square of reading", "largest difference", "amplitude of the simulation"
    compared = [name for name in known if name.startswith(starts) and "due to" not in name]
    assert len(compared) == 2 + len(worked.recorded.readings.time)
    for name in compared:
        assert done.numbers[name] == pytest.approx(known[name], rel=1e-8, abs=1e-12), name
    drawn = {path.stem.split("_", 3)[3] for path in tmp_path.glob("part_*.png")}
    assert {"lengths", "kater", "envelope", "readings"} <= drawn
    assert "half_swings" not in (tmp_path / "part_2_4.py").read_text(encoding="utf-8")
