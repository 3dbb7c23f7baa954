"""What accuracy costs: measured orders, the Pareto front, the cheapest method, and files that stay valid."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest
from choice import quick
from matplotlib.image import imread
from PIL import Image

import integrators
from integrators import MethodError
from pendulum_env.engine.machine import fitting
from pendulum_env.physics.presets import SCENES
from pendulum_env.physics.units import SceneError
from pendulum_env.provenance import OutputError
from pendulum_env.study.cost import cost, write
from pendulum_env.study.cost_plot import draw
from pendulum_env.study.cost_points import CostPoint, CostStudy, pareto
from pendulum_env.study.reference import Reference, StudyError

QUICK = {"duration": 2.0, "repeats": 1, "backend": "python"}


MEASURED = quick(fitting(SCENES["vacuum"]), turn=7)


@pytest.fixture(scope="module")
def vacuum() -> CostStudy:
    """Methods that fit, interpreted, over one period from 1 rad."""
    return cost("vacuum", MEASURED, **QUICK)


def point(method: str, time: float, error: float, **more) -> CostPoint:
    usual = {"dt": 0.1, "steps": 10, "end_error": error, "energy_error": 0.0, "evaluations": 40.0}
    found = {"method": method, "angle_error": error, "times": (time,), "ns_per_second": time}
    return CostPoint(**{**usual, **found, **more})


def study(*points: CostPoint, estimate: float = 1e-14) -> CostStudy:
    reference = Reference(np.array([1.0, 0.5]), np.zeros(2), estimate, "by hand")
    return CostStudy(SCENES["vacuum"], 1.0, 0.0, 1.0, reference, points, 1)


# --- orders and errors ----------------------------------------------------------------------------------------------


# On this ladder their next error terms, of one order more, still rule: the leading ones are uncommonly small.
STEEPER = ("tsit5", "verner6", "verner7", "blanes_moan_srkn14a", "fine5")
# Errors of symmetric multistep methods (quinlan...) fall from far above their leading term, near their short limits.
# From one rung to the next their errors fall by more than 2^8, from 3 % to the reference's own: no two lie between.
TOO_STEEP = (
    "verner8", "verner9", "tsitouras10", "sofroniou_spaletta10", "dprkn8", "dprkn12", "taylor", "exact",
)


def check_slope(study, method):
    order = integrators.get(method).order
    if method in TOO_STEEP:
        assert math.isnan(study.slope(method))
    else:
        low = 0.3 if method == "yoshida8a" else 0.2  # its steps of twice the whole are still too long there
        high = math.inf if method.startswith("quinlan") else 1.2 if method in STEEPER else 0.2
        assert order - low < study.slope(method) < order + high


@pytest.mark.parametrize("method", MEASURED)
def test_the_slope_is_the_declared_order(vacuum, method):
    check_slope(vacuum, method)


@pytest.mark.slow
def test_every_fitting_method_is_measured():
    full = cost("vacuum", **QUICK)
    assert full.methods == tuple(fitting(SCENES["vacuum"]))
    assert full.complete
    for method in full.methods:
        check_slope(full, method)


def test_a_further_digit_costs_ten_to_the_inverse_order(vacuum):
    assert vacuum.digit_cost("rk4") == pytest.approx(10 ** (1 / 4), rel=0.05)
    assert vacuum.digit_cost("forward_euler") == pytest.approx(10.0, rel=0.15)
    said = vacuum.sentence()
    assert "1.78x with rk4, " in said
    assert said.index("velocity_verlet") < said.index("forward_euler")


def test_energy_errors_of_the_euler_methods_are_those_of_the_formula():
    """Forward Euler multiplies the energy by 1 + omega0² h² each step, backward Euler divides by it."""
    found = cost("textbook", ["forward_euler", "backward_euler"], **QUICK)
    for p in found.points:
        growth = (1.0 + 9.81 * p.dt**2) ** p.steps
        expected = growth - 1.0 if p.method == "forward_euler" else 1.0 - 1.0 / growth
        assert p.energy_error == pytest.approx(expected, rel=1e-9)


def test_end_errors_are_those_of_the_recursion():
    """One step of forward Euler on the textbook pendulum multiplies theta - i v/omega0 by 1 + i omega0 h."""
    found = cost("textbook", ["forward_euler"], steps=[0.01], **QUICK)
    (p,) = found.points
    omega0 = math.sqrt(9.81)
    exact, got = 0.1 * math.cos(2.0 * omega0), (0.1 * (1.0 + 1j * omega0 * p.dt) ** p.steps).real
    assert p.end_error == pytest.approx(abs(got - exact), rel=1e-9)
    assert p.angle_error >= p.end_error


def test_steps_are_rounded_down_to_fit_and_end_where_the_run_ends():
    found = cost("vacuum", ["rk4"], steps=[0.3, 0.01], **QUICK)
    assert [p.dt <= wanted for p, wanted in zip(found.points, (0.3, 0.01), strict=True)] == [True, True]
    for p in found.points:
        assert p.dt * p.steps == pytest.approx(2.0, rel=1e-14)


def test_evaluations(vacuum):
    for method in ("rk4", "velocity_verlet", "heun"):
        for p in vacuum.of(method):
            assert p.evaluations == p.steps * integrators.get(method).evaluations
    for p in vacuum.of("implicit_midpoint"):
        assert 2.0 <= p.evaluations / p.steps <= 8.0


def test_errors_within_the_reference_s_own_are_marked_and_kept_out_of_the_front():
    found = cost("vacuum", ["rk4"], steps=[1e-2, 2.5e-4], **QUICK)
    assert [p.floor for p in found.points] == [False, True]
    assert found.points[0] in found.front
    assert found.points[1] not in found.front


def test_times_have_one_entry_per_repeat():
    found = cost("vacuum", ["rk4"], steps=[0.01, 0.02], duration=0.5, repeats=3, backend="python")
    for p in found.points:
        assert len(p.times) == 3
        assert 0.0 < p.time <= p.time_median
        assert p.ns_per_second == pytest.approx(p.time * 1e9 / 0.5)


# --- choosing -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("points", "front"),
    [
        ([], []),
        ([(1, 1)], [0]),
        ([(1, 3), (2, 2), (3, 1)], [0, 1, 2]),
        ([(3, 1), (2, 2), (1, 3)], [2, 1, 0]),
        ([(1, 3), (2, 3), (3, 1), (3, 2), (4, 4)], [0, 2]),
        ([(1, 3), (1, 2)], [1]),
        ([(1, 1), (1, 1), (2, 1)], [0, 1]),
    ],
)
def test_pareto_front_of_points_by_hand(points, front):
    assert pareto(points) == front


def test_the_front_ignores_errors_as_large_as_the_motion():
    wild, good = point("forward_euler", 1.0, 3.0), point("rk4", 2.0, 1e-3)
    assert study(wild, good).front == (good,)


def test_best_is_the_cheapest_that_is_accurate_enough():
    points = [point("a", 5.0, 1e-8), point("b", 2.0, 1e-5), point("c", 9.0, 1e-9), point("d", 1.0, 1e-2)]
    assert study(*points).best(1e-5 + 1e-9).method == "b"
    assert study(*points).best(1e-7).method == "a"


def test_best_adds_the_reference_s_own_error():
    with pytest.raises(StudyError, match=r"best reached 3e-08 rad, a with steps of 0\.1 s"):
        study(point("a", 5.0, 1e-8), estimate=2e-8).best(1e-8)


def test_best_names_what_was_reached_where_nothing_is_good_enough():
    points = [point("a", 5.0, 1e-8, dt=0.125), point("b", 9.0, math.nan, stop_reason="diverged")]
    with pytest.raises(StudyError, match=r"No run is known to be within 1e-12 rad; the best reached 1e-08 rad, a with"):
        study(*points).best(1e-12)


@pytest.mark.parametrize("accuracy", [0.0, -1.0, math.nan, math.inf, "fine"])
def test_best_refuses_senseless_accuracies(accuracy):
    with pytest.raises(SceneError, match="accuracy must be a finite number above 0"):
        study(point("a", 1.0, 1e-3)).best(accuracy)


def test_best_of_nothing_but_diverged_runs():
    with pytest.raises(StudyError, match="No run reached its end"):
        study(point("a", 1.0, math.nan, stop_reason="diverged")).best(1e-3)


def test_slope_needs_two_good_points():
    assert math.isnan(study(point("a", 1.0, 1e-3)).slope("a"))
    assert "No method" in study(point("a", 1.0, 1e-3)).sentence()


def test_slope_leaves_out_errors_before_the_leading_term_rules_and_near_round_off():
    errors = [0.5, 0.5, 0.5, 0.5, 0.5, 1e-2, 1e-4, 1e-6, 1e-13, 1e-13, 1e-13, 1e-13, 1e-13]
    points = [point("a", 1.0, error, dt=10.0**-k) for k, error in enumerate(errors)]
    assert study(*points).slope("a") == pytest.approx(2.0, rel=1e-12)


# --- running --------------------------------------------------------------------------------------------------------


def test_an_interrupted_study_keeps_what_it_has(tmp_path):
    seen: list[CostPoint] = []

    def impatient(fraction: float, what: str) -> None:
        assert 0.0 <= fraction <= 1.0
        if len(seen) == 3:
            raise KeyboardInterrupt

    found = cost("vacuum", ["rk4", "heun"], progress=impatient, on_point=seen.append, **QUICK)
    assert not found.complete
    assert sorted(found.points, key=seen.index) == seen
    assert len(found.points) == 3
    assert "# Complete: false" in write(found, tmp_path)[1].read_text()


def test_a_study_interrupted_at_once_can_still_be_written(tmp_path):
    def impatient(fraction: float, what: str) -> None:
        raise KeyboardInterrupt

    found = cost("vacuum", ["rk4"], progress=impatient, **QUICK)
    assert found.points == ()
    picture, table = write(found, tmp_path)
    assert picture.is_file()
    assert table.is_file()


def test_progress_ends_at_one():
    told: list[float] = []
    cost("vacuum", ["rk4"], steps=[0.1, 0.01], duration=1.0, repeats=2, backend="python",
         progress=lambda fraction, what: told.append(fraction))
    assert told == sorted(told)
    assert told[-1] == 1.0
    assert max(told[:-1]) < 1.0


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"integrators": ["rk5"]}, MethodError, "rk4"),
        ({"scene": "vacum"}, SceneError, "vacuum"),
        ({"repeats": 0}, SceneError, "repeats must be a whole number from 1"),
        ({"steps": []}, StudyError, "at least one step"),
        ({"steps": [3.0]}, StudyError, "none longer than the run of 2 s"),
        ({"steps": [-0.1]}, SceneError, "each step must be a finite number above 0"),
        ({"integrators": ["rk4", "heun", "rk4"]}, MethodError, "rk4 is named twice"),
        ({"integrators": []}, MethodError, "At least one"),
        ({"steps": [1e-320]}, SceneError, "takes inf steps"),
        ({"duration": 1e18}, StudyError, "too long for this study"),
        ({"angle": 1e300}, SceneError, "angle must be within"),
        ({"damping": "quadratic", "gamma": 1.0}, SceneError, "no parameter 'gamma'"),
        ({"angle": 0.0}, StudyError, "Nothing moves"),
        ({"angle": math.nan}, SceneError, "angle must be a finite number"),
        ({"lenght": 2.0}, SceneError, "did you mean length"),
    ],
)
def test_bad_input_gives_one_clear_error(arguments, error, message):
    with pytest.raises(error, match=message):
        cost(**{"scene": "vacuum", **QUICK, **arguments})


# --- files ----------------------------------------------------------------------------------------------------------


@pytest.fixture
def rough() -> CostStudy:
    """Steps of which the longest diverges: forward Euler at omega0 h = 3 multiplies the energy by 10."""
    return cost("textbook", ["forward_euler", "rk4"], steps=[1.0, 0.01], duration=10.0, repeats=1, backend="python")


def test_diverged_runs_are_in_the_table_only(rough, tmp_path: Path):
    lost = [p for p in rough.points if p.stop_reason]
    assert [(p.method, p.stop_reason) for p in lost] == [("forward_euler", "diverged"), ("rk4", "diverged")]
    _, table = write(rough, tmp_path)
    lines = table.read_text().splitlines()
    head = [line for line in lines if line.startswith("# ")]
    assert {"Software", "Scene", "Machine", "Versions", "Reference"} <= {line[2:].split(":")[0] for line in head}
    rows = list(csv.DictReader(lines[len(head):]))
    assert [row["status"] for row in rows] == ["diverged", "ok", "diverged", "ok"]
    assert [float(row["dt_s"]) for row in rows] == [p.dt for p in rough.points]
    left, right = draw(rough).axes
    drawn = [y for line in (*left.lines, *right.lines) for y in line.get_ydata() if line.get_label() != "Pareto front"]
    kept = {p.angle_error for p in rough.points if not p.stop_reason}
    assert kept <= set(drawn)


def test_the_picture_knows_where_it_comes_from(rough, tmp_path):
    picture, _ = write(rough, tmp_path)
    with Image.open(picture) as image:
        assert "lab-pendulum" in image.info["Software"]
        assert "textbook" in image.info["Scene"]
    assert imread(picture).std() > 0.01


def test_a_folder_that_cannot_be_written_is_said(rough, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be written"):
        write(rough, tmp_path / "file")
