"""Tests of work-precision studies: measured orders, Pareto front, cheapest method, and journals."""

import csv
import math
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread
from matplotlib.text import Text
from PIL import Image

import integrators
from integrators import MethodError
from integrators.steps.estimates import has_estimates, order_of_estimate
from pendulum_env.common.provenance import OutputError
from pendulum_env.common.results import write
from pendulum_env.engine.generate import program
from pendulum_env.engine.kernels import interpreted
from pendulum_env.engine.machine import NOWHERE, UNSEEN, Machine, fitting
from pendulum_env.engine.rollout import rollout
from pendulum_env.physics.presets import SCENES
from pendulum_env.physics.units import SceneError
from pendulum_env.plots.cost import draw
from pendulum_env.study import PLAIN
from pendulum_env.study.cost import runs as cost_runs
from pendulum_env.study.cost import study as cost_plan
from pendulum_env.study.cost.points import CostPoint, CostStudy, pareto
from pendulum_env.study.cost.runs import SPARSE, Setting
from pendulum_env.study.cost.study import RECORDS, cost
from pendulum_env.truth.answer import Truth
from pendulum_env.truth.reference import StudyError, accelerations, phase_errors, reference

QUICK = {"duration": 2.0, "repeats": 1, "backend": "python"}


MEASURED = [*PLAIN, "implicit_midpoint", "forest_ruth"]
"""Methods that quick tests measure; the slow test measures all."""


@pytest.fixture(scope="module")
def vacuum() -> CostStudy:
    """Return a study of methods that fit the scene "vacuum", interpreted, over one period from 1 rad."""
    return cost("vacuum", MEASURED, tolerances=(), **QUICK)


def point(method: str, time: float, error: float, **more) -> CostPoint:
    usual = {"dt": 0.1, "steps": 10, "end_error": error, "energy_error": 0.0, "evaluations": 40.0}
    found = {"method": method, "angle_error": error, "times": (time,), "ns_per_second": time}
    return CostPoint(**{**usual, **found, **more})


def study(*points: CostPoint, estimate: float = 1e-14) -> CostStudy:
    reference = Truth(np.array([0.0, 1.0]), np.array([1.0, 0.5]), np.zeros(2), estimate, "by hand")
    return CostStudy(SCENES["vacuum"], 1.0, 0.0, 1.0, reference, points, 1)


# --- orders and errors ----------------------------------------------------------------------------------------------


# At these steps the next error term of these methods, of one order more, still dominates a very small leading one.
STEEPER = ("tsit5", "verner6", "verner7", "blanes_moan_srkn14a", "fine5")
# Errors of symmetric multistep methods (quinlan...) start far above their leading term, near their stability limits.
# From one step to the next errors of these methods fall by more than 2^8, so no two of them can be used.
TOO_STEEP = (
    "verner8", "verner9", "tsitouras10", "sofroniou_spaletta10", "dprkn8", "dprkn12", "taylor", "exact",
)


def check_slope(study, method):
    order = integrators.get(method).order
    if method in TOO_STEEP:
        assert math.isnan(study.slope(method))
    else:
        low = 0.3 if method == "yoshida8a" else 0.2  # its longest sub-steps, of twice the step, are still too long
        high = math.inf if method.startswith("quinlan") else 1.2 if method in STEEPER else 0.2
        assert order - low < study.slope(method) < order + high


@pytest.mark.parametrize("method", MEASURED)
def test_the_slope_is_the_declared_order(vacuum, method):
    check_slope(vacuum, method)


def test_steps_so_short_that_they_only_add_rounding_have_no_part_in_the_slope():
    errors = (1e-3, 1e-3 * 0.5**4, 1e-3 * 0.5**8, 2e-5, 4e-5, 8e-5, 16e-5)
    found = study(*(point("rk4", 2.0**i, error, dt=0.1 * 0.5**i) for i, error in enumerate(errors)))
    assert found.slope("rk4") == pytest.approx(4.0, rel=1e-12)


@pytest.mark.slow
def test_every_fitting_method_is_measured():
    full = cost("vacuum", tolerances=(), **QUICK)
    assert full.methods == tuple(fitting(SCENES["vacuum"]))
    assert full.complete
    for method in full.methods:
        check_slope(full, method)


# Tolerated differences between the order and the slope of adaptive runs against their mean step. Their useful steps are
# longer, where the next error terms matter more; from order 6 on so much that the slope is only near the order.
ADAPTED = {
    "bs3": 0.05, "sdirk4": 0.1, "radau5": 0.15, "rkn43": 0.15, "fine5": 0.2, "dopri5": 0.25, "fine4": 0.35,
    "dop853": 0.35, "tsit5": 0.5, "verner6": 0.6, "dprkn8": 0.6, "dprkn6": 0.7, "verner9": 1.2, "verner7": 2.0,
    "verner8": 2.1, "dprkn12": 3.5, "taylor": 5.5,
}


def check_adapted(methods):
    found = cost("vacuum", methods, steps=[0.1], tolerances=[10.0**-k for k in range(2, 14)],
                 **{**QUICK, "duration": 8.0})
    for method in methods:
        order, points = integrators.get(method).order, found.of(f"{method}, adaptive")
        assert found.slope(f"{method}, adaptive") == pytest.approx(order, abs=ADAPTED[method])
        assert [p.rtol for p in points] == sorted((p.rtol for p in points), reverse=True)
        assert all(p.dt == pytest.approx(8.0 / p.steps, rel=1e-12) for p in points)


@pytest.mark.slow
def test_the_slope_of_adapted_steps_is_the_order_too():
    check_adapted(["bs3", "dopri5", "rkn43"])


@pytest.mark.slow
def test_the_slope_of_every_method_s_adapted_steps():
    able = [name for name, method in integrators.METHODS.items() if has_estimates(method)]
    assert sorted(able) == sorted(ADAPTED)
    check_adapted(able)


def test_errors_go_with_the_tolerance_to_the_power_that_the_estimate_says():
    """A step has the error rtol = C h^k, with k the order of the estimate, and the run C h^p, so rtol^(p/k)."""
    given = {"steps": [0.1], "tolerances": [1e-7, 1e-9], **QUICK, "duration": 8.0}
    found = cost("vacuum", ["bs3", "rkn43"], **given)
    for method in found.methods:
        power = integrators.get(method).order / order_of_estimate(integrators.get(method))
        loose, tight = found.of(f"{method}, adaptive")
        assert math.log10(loose.angle_error / tight.angle_error) == pytest.approx(2.0 * power, abs=0.1)


def test_a_further_digit_costs_ten_to_the_inverse_order(vacuum):
    assert vacuum.digit_cost("rk4") == pytest.approx(10 ** (1 / 4), rel=0.05)
    assert vacuum.digit_cost("forward_euler") == pytest.approx(10.0, rel=0.15)
    said = vacuum.sentence()
    assert "1.78x with rk4, " in said
    assert said.index("velocity_verlet") < said.index("forward_euler")


@pytest.mark.slow
def test_energy_errors_of_the_euler_methods_are_those_of_the_formula():
    """Forward Euler multiplies the energy by 1 + omega0² h² in each step; backward Euler divides it by that."""
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


@pytest.mark.parametrize("method", ["dopri5", "fine4", "rkn43"])
def test_evaluations_of_adapted_steps_are_those_that_are_made(method):
    found = cost("vacuum", [method], steps=[0.1], tolerances=[1e-6], **QUICK)
    (p,) = found.of(f"{method}, adaptive")
    machine = Machine(SCENES["vacuum"], method, (), "python", rtol=1e-6)
    made, calls = program(SCENES["vacuum"], machine.method, (), True), []
    plain = interpreted(made.text, made.title)
    names = ("acceleration", "force")

    def counted(name):
        return lambda *arguments: calls.append(name) or plain[name](*arguments)

    run = interpreted(made.text, made.title, {name: counted(name) for name in names if name in plain})["run"]
    records = round(2.0 / (2.0 * math.pi / math.sqrt(9.81)) * RECORDS / SPARSE + 0.5)
    state = machine.state(1.0, 0.0)
    run(state, machine.parameters, 0.0, 2.0 / records, 1, records, math.inf, NOWHERE, UNSEEN)
    assert p.evaluations == len(calls)
    assert p.steps == state[machine.kept["taken"]]


def test_errors_within_the_reference_s_own_are_marked():
    found = cost("vacuum", ["rk4"], steps=[1e-2, 2.5e-4], **QUICK)
    assert [p.floor for p in found.points] == [False, True]


def test_errors_within_the_reference_s_reach_are_alike_on_the_front():
    """An error below 1e-13 rad, ten times the reference solution's own, counts as 1e-13 rad."""
    points = [point("a", 1.0, 1e-6), point("b", 3.0, 2e-15, floor=True), point("c", 2.0, 9e-14, floor=True),
              point("d", 4.0, 0.0, floor=True), point("e", 5.0, 3e-13)]
    assert study(*points, estimate=1e-14).front == (points[0], points[2])


def test_times_have_one_entry_per_repeat():
    found = cost("vacuum", ["rk4"], steps=[0.01, 0.02], duration=0.5, repeats=3, backend="python")
    for p in found.points:
        assert len(p.times) == 3
        assert 0.0 < p.time <= p.time_median
        assert p.ns_per_second == pytest.approx(p.time * 1e9 / 0.5)


# --- phase and energy -----------------------------------------------------------------------------------------------


def test_phase_error_of_the_implicit_midpoint_rule():
    """Each step turns (omega0 q, v) by 2 atan(omega0 h/2) without changing its length, so the error is a sine."""
    found = cost("textbook", ["implicit_midpoint"], steps=[0.1, 0.05], **QUICK)
    for p in found.points:
        x = math.sqrt(9.81) * p.dt
        assert p.phase_error == pytest.approx(math.sin(p.steps * (x - 2.0 * math.atan(x / 2.0))), rel=1e-9)


def test_phase_error_of_velocity_verlet():
    """Each step advances the phase by 2 asin(omega0 h/2); its ellipse deviates by less than (omega0 h)²/8."""
    found = cost("textbook", ["velocity_verlet"], steps=[0.1, 0.05, 0.01], **{**QUICK, "duration": 20.0})
    for p in found.points:
        x = math.sqrt(9.81) * p.dt
        assert p.phase_error == pytest.approx(p.steps * (2.0 * math.asin(x / 2.0) - x), abs=x * x / 8.0)
        assert p.phase_error > x * x


def test_phase_errors_by_hand():
    """The run is late by 0.01 rad on a circle, and 1 % too large, which is no phase error."""
    turn = np.linspace(0.0, 3.0, 7)
    truth = Truth(turn, np.cos(turn), -2.0 * np.sin(turn), 0.0, "by hand")
    late = 1.01 * np.cos(turn - 0.01), -2.02 * np.sin(turn - 0.01)
    found = phase_errors(2.0, truth, -4.0 * truth.angle, *late)
    assert found == pytest.approx(np.full(7, -1.01 * math.sin(0.01)), rel=1e-12)


def test_where_nothing_moves_there_is_no_phase():
    truth = Truth(np.arange(3.0), np.array([1.0, 0.0, 1e-5]), np.array([0.0, 3.0, 0.0]), 0.0, "by hand")
    found = phase_errors(1.0, truth, np.array([-1.0, 0.0, -1e-5]), truth.angle + 0.1, truth.velocity)
    assert found[:2] == pytest.approx([0.0, 0.1 / 3.0])
    assert math.isnan(found[2])
    assert np.isnan(phase_errors(0.0, truth, truth.velocity, truth.angle, truth.velocity)).all()


@pytest.mark.quick("vacuum", "driven")
@pytest.mark.parametrize("scene", ["vacuum", "exercise_large", "sticky_bearing", "driven", "kapitza"])
def test_accelerations_are_the_slope_of_the_reference_s_velocity(scene):
    """Compare with central differences of a reference solution at times 2e-5 s apart, except at turning points."""
    place, h = SCENES[scene], 2e-5
    middle = np.linspace(0.05, 0.95, 10)
    times = np.ravel(np.column_stack([middle - h, middle, middle + h]))
    truth = reference(place, 1.0, 0.3, times)
    pull = accelerations(place, times, truth)[1::3]
    slope = (truth.velocity[2::3] - truth.velocity[::3]) / (2.0 * h)
    smooth = np.sign(truth.velocity[2::3]) == np.sign(truth.velocity[::3])
    assert smooth.sum() >= 8
    assert pull[smooth] == pytest.approx(slope[smooth], rel=1e-4, abs=1e-4)


def test_a_bob_that_sticks_does_not_accelerate():
    place = SCENES["sticky_bearing"]
    still = Truth(np.zeros(2), np.array([1e-6, 1.0]), np.zeros(2), 0.0, "by hand")
    found = accelerations(place, [0.0, 0.0], still)
    assert found[0] == 0.0
    assert found[1] < 0.0


@pytest.mark.slow
@pytest.mark.parametrize(("scene", "unit"), [("vacuum", "the energy at the start"), ("lab", "m g L")])
def test_energy_errors_are_in_units_of(scene, unit, tmp_path):
    found = cost(scene, ["heun"], angle=1.2, steps=[0.02], **QUICK)
    (p,) = found.points
    every = p.steps // (len(found.reference.angle) - 1)
    run = rollout(scene, integrator="heun", angle=1.2, dt=p.dt, duration=2.0, every=every, backend="python")
    body = SCENES[scene].body
    scale = {"m g L": body.mass * 9.81 * body.length, "the energy at the start": run.energy[0]}[unit]
    assert p.energy_error == pytest.approx(np.max(np.abs(run.energy_residual)) / scale, rel=1e-12)
    assert f"# EnergyError: largest energy residual over {unit}" in write(found, tmp_path)[-1].read_text()


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
    with pytest.raises(StudyError, match="No run reached an accuracy of 1e-12 rad; the best reached 1e-08 rad, a with"):
        study(*points).best(1e-12)


@pytest.mark.parametrize("accuracy", [0.0, -1.0, math.nan, math.inf, "fine"])
def test_best_refuses_senseless_accuracies(accuracy):
    with pytest.raises(SceneError, match="accuracy must be a finite number above 0"):
        study(point("a", 1.0, 1e-3)).best(accuracy)


def test_best_of_nothing_but_diverged_runs():
    with pytest.raises(StudyError, match="No run reached its end"):
        study(point("a", 1.0, math.nan, stop_reason="diverged")).best(1e-3)


def test_steps_with_a_tolerance_are_named_by_it():
    adapted = [point("b", 2.0, 1e-5, rtol=1e-6, dt=0.1), point("b", 3.0, 1e-6, rtol=1e-7, dt=0.01)]
    found = study(point("a", 5.0, 1e-8), *adapted)
    assert found.series == ("a", "b, adaptive")
    assert found.best(1e-4).setting == "rtol = 1e-06"
    assert ("1e-05", "b", "rtol = 1e-07", "1.0e-06", "3") in found.table.rows
    with pytest.raises(StudyError, match=r"b with rtol = 1e-07"):
        study(*adapted).best(1e-9)


def test_a_sentence_about_many_methods_names_the_front_and_the_plain_ones():
    names = ["rk4", *"abcdefgh"]
    points = [point(name, 10.0 * i + k, 10.0 ** (-4 * k), dt=10.0**-k)
              for i, name in enumerate(reversed(names)) for k in (1, 2)]
    assert study(*points).sentence() == "Each further digit costs 1.78x with h, 1.78x with rk4."
    assert study(*points[:4]).sentence() == "Each further digit costs 1.78x with g, 1.78x with h."


def test_steps_that_are_all_cut_to_one_length_have_no_slope():
    points = [point("a", 1.0, 10.0**-k, dt=max(0.1, 10.0**-k), rtol=10.0**-k) for k in (2, 3, 4)]
    assert math.isnan(study(*points).slope("a, adaptive"))


def test_slope_needs_two_good_points():
    assert math.isnan(study(point("a", 1.0, 1e-3)).slope("a"))
    assert "no method has two runs" in study(point("a", 1.0, 1e-3)).sentence()


def test_slope_leaves_out_errors_before_the_leading_term_rules_and_near_round_off():
    errors = [0.5, 0.5, 0.5, 0.5, 0.5, 1e-2, 1e-4, 1e-6, 1e-13, 1e-13, 1e-13, 1e-13, 1e-13]
    points = [point("a", 1.0, error, dt=10.0**-k) for k, error in enumerate(errors)]
    assert study(*points).slope("a") == pytest.approx(2.0, rel=1e-12)


# --- running --------------------------------------------------------------------------------------------------------


@pytest.mark.slow
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
    assert "# Complete: false" in write(found, tmp_path)[-1].read_text()


@pytest.mark.slow
def test_a_study_interrupted_at_once_can_still_be_written(tmp_path):
    def impatient(fraction: float, what: str) -> None:
        raise KeyboardInterrupt

    found = cost("vacuum", ["rk4"], progress=impatient, **QUICK)
    assert found.points == ()
    assert all(path.is_file() for path in write(found, tmp_path))


def without_times(found: CostStudy) -> list[CostPoint]:
    return [replace(p, times=(), ns_per_second=0.0) for p in found.points]


def test_an_interrupted_and_resumed_study_equals_an_uninterrupted_one(tmp_path):
    given = {"scene": "exercise", "integrators": ["heun", "bs3", "symplectic_euler"], "duration": 1.0, "repeats": 3,
             "backend": "python", "tolerances": [1e-2, 1e-4], "steps": [0.1, 0.05]}
    whole, path = cost(**given), tmp_path / "cost.jsonl"
    parts, entries = 0, 0

    def impatient(fraction, what):
        nonlocal entries
        entries += 1
        if entries == 7:
            raise KeyboardInterrupt

    while not (found := cost(**given, file=path, progress=impatient)).complete:
        parts, entries = parts + 1, 0
        lines = len(path.read_text().splitlines())
        assert lines == 1 + 6 * parts
        path.write_bytes(path.read_bytes() + b'{"point": {"meth')
    assert parts == 3
    assert repr(without_times(found)) == repr(without_times(whole))
    assert [len(p.times) for p in found.points] == [3] * len(whole.points)
    again = cost(**given, file=path, on_point=lambda p: pytest.fail("measured again"))
    assert again.points == found.points
    before = path.read_bytes()
    with pytest.raises(StudyError, match=r"with duration 1\.0 instead of 2\.0; .* resume=False .* leave out --resume"):
        cost(**{**given, "duration": 2.0}, file=path)
    assert path.read_bytes() == before
    assert cost(**{**given, "duration": 2.0}, file=path, resume=False).complete


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals differ")
def test_an_interrupted_command_leaves_files_and_resumes(tmp_path):
    words = [sys.executable, "-m", "pendulum_env", "cost", "--scene", "vacuum", "--integrators", "rk4,dopri5",
             "--duration", "20", "--repeats", "9", "--out", str(tmp_path)]
    # Started in the background, a shell's children ignore interrupts, and would hand that on.
    process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True,
                               preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
    journal, deadline = tmp_path / "cost.jsonl", time.monotonic() + 60.0
    while not (journal.exists() and journal.read_bytes().count(b"\n") > 30) and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    said, _ = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "--resume continues" in said
    assert "# Complete: false" in (tmp_path / "cost.csv").read_text()
    kept = journal.read_bytes()
    assert subprocess.run([*words, "--resume", "--angle", "20"], capture_output=True).returncode == 2
    assert journal.read_bytes() == kept
    done = subprocess.run([*words, "--resume"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "Interrupted" not in done.stdout
    assert journal.read_bytes().startswith(kept)
    lines = (tmp_path / "cost.csv").read_text().splitlines()
    rows = csv.DictReader(line for line in lines if not line.startswith("# "))
    whole = cost("vacuum", ["rk4", "dopri5"], duration=20.0, repeats=1)
    assert [(row["series"], float(row["angle_error_rad"])) for row in rows] == [
        (p.series, p.angle_error) for p in whole.points]


def test_repeats_go_round_all_runs_in_turn():
    setting = Setting(SCENES["vacuum"], 1.0, 0.0, 2.0, 21, "python")
    plan = cost_plan.CostPlan(setting, [integrators.get("rk4"), integrators.get("bs3")], [1, 2], [1e-2, 1e-3], 2)
    once = [("rk4", 1), ("bs3", 1), ("bs3", 1e-2), ("rk4", 2), ("bs3", 2), ("bs3", 1e-3)]
    found = [(p["repeat"], p["method"], p.get("substeps") or p["rtol"]) for p in plan.points]
    assert found == [(repeat, *run) for repeat in (0, 1) for run in once]
    assert [rung.method for rung in plan.rungs] == ["rk4"] * 2 + ["bs3"] * 4


@pytest.mark.parametrize(("repeats", "half"), [
    (5, 2), *(pytest.param(repeats, 1, marks=pytest.mark.slow) for repeats in (1, 2, 3))])
def test_long_runs_are_timed_half_as_often_and_the_figure_says_so(monkeypatch, repeats, half):
    monkeypatch.setattr(cost_plan, "LONG", 200)  # force evaluations: of rk4, 50 steps
    found = cost("vacuum", ["rk4"], steps=[0.1, 0.05, 0.025], duration=2.0, repeats=repeats, backend="python")
    assert [len(p.times) for p in found.points] == [half if p.steps * 4 >= cost_plan.LONG else repeats
                                                   for p in found.points]
    assert len({p.steps * 4 >= cost_plan.LONG for p in found.points}) == 2
    note = " ".join(text.get_text() for text in draw(found).figure.findobj(Text)).replace("\n", " ")
    assert f"the shortest of {repeats if half == repeats else f'{half} to {repeats}'} timings" in note


def test_times_of_runs_with_records_are_those_of_runs_without(monkeypatch):
    """A long run is timed while its records are made: the clock, of which one tick passes per look, says so."""
    ticks = iter(range(10_000))
    monkeypatch.setattr(cost_runs, "perf_counter", lambda: float(next(ticks)))
    monkeypatch.setattr(cost_runs, "_timed", lambda *given: pytest.fail("timed once more"))
    assert cost("vacuum", ["rk4"], steps=[0.1], duration=0.5, repeats=1, backend="python").points[0].times == (1.0,)


def test_long_work_is_left_out_and_said(monkeypatch):
    monkeypatch.setattr(cost_plan, "MOST_WORK", {"python": 1500.0})
    found = cost("vacuum", ["heun", "rk4", "gauss4"], tolerances=(), duration=2.0, repeats=1, backend="python")
    counts = {name: [p.steps for p in found.of(name)] for name in found.series}
    assert counts == {"heun": [16, 32, 64, 128, 256, 512], "rk4": [16, 32, 64, 128, 256], "gauss4": [16, 32, 64]}
    said = "The shortest step is 0.0039 s; to save time there are none below 0.031 s with gauss4; none below "
    assert found.left_out == said + "0.0078 s with rk4."


def test_methods_of_one_s_own_are_measured(tmp_path):
    mine = replace(integrators.get("rk4"), name="mine", aliases=())
    given = {"steps": [0.1], **QUICK, "file": tmp_path / "cost.jsonl"}
    own = cost("vacuum", ["rk4", mine], **given)
    assert own.methods == ("rk4", "mine")
    assert own.points[0].angle_error == own.points[1].angle_error
    other = replace(integrators.get("heun"), name="mine", aliases=())
    with pytest.raises(StudyError, match="another sweep"):
        cost("vacuum", ["rk4", other], **given)


def test_there_are_no_tolerances_under_dry_friction_or_beside_steps():
    found = cost("sticky_bearing", ["dopri5"], steps=[0.1], **QUICK)
    assert found.series == ("dopri5",)
    found = cost("sticky_bearing", ["dopri5"], duration=0.05, repeats=1, backend="python")
    assert found.series == ("dopri5",)


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
        ({"integrators": ["rk4"], "tolerances": [1e-3]}, MethodError, "rk4 does not estimate its error"),
        ({"integrators": ["dopri5"], "tolerances": [1e-16]}, MethodError, "rtol must be at least 1.8e-15"),
        ({"integrators": ["dopri5"], "tolerances": [0.0]}, MethodError, "rtol must be a finite number above zero"),
        ({"scene": "sticky_bearing", "integrators": ["dopri5"], "tolerances": [1e-3]}, MethodError, "dry friction"),
        ({"scene": "vacuum", "integrators": ["boris"]}, MethodError, "There is no integrator"),
        ({"steps": [1e-320]}, SceneError, "takes inf steps"),
        ({"duration": 1e18}, StudyError, "too long for this study"),
        ({"angle": 1e300}, SceneError, "angle must be between"),
        ({"damping": "quadratic", "gamma": 1.0}, SceneError, "no parameter 'gamma'"),
        ({"angle": 0.0}, StudyError, "stays at rest"),
        ({"angle": math.nan}, SceneError, "angle must be a finite number"),
        ({"lenght": 2.0}, SceneError, "did you mean length"),
    ],
)
def test_bad_input_gives_one_clear_error(arguments, error, message):
    with pytest.raises(error, match=message):
        cost(**{"scene": "vacuum", **QUICK, **arguments})


# --- files ----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def rough() -> CostStudy:
    """Return a study with a step at which forward Euler diverges: at omega0 h = 3 it multiplies the energy by 10."""
    return cost("textbook", ["forward_euler", "rk4"], steps=[1.0, 0.01], duration=10.0, repeats=1, backend="python")


@pytest.fixture(scope="module")
def rough_files(rough, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return write(rough, tmp_path_factory.mktemp("rough"))


@pytest.mark.slow
def test_diverged_runs_are_in_the_table_only(rough, rough_files):
    lost = [p for p in rough.points if p.stop_reason]
    assert [(p.method, p.stop_reason) for p in lost] == [("forward_euler", "diverged"), ("rk4", "diverged")]
    *_, table = rough_files
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


def test_the_picture_knows_where_it_comes_from(rough_files):
    picture, *_ = rough_files
    with Image.open(picture) as image:
        assert "lab-pendulum" in image.info["Software"]
        assert "textbook" in image.info["Scene"]
    assert imread(picture).std() > 0.01


def test_a_folder_that_cannot_be_written_is_said(rough, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be written"):
        write(rough, tmp_path / "file")
