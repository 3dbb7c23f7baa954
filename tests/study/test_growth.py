"""Tests of error growth: laws of known series, methods compared with theory, and files."""

import csv
import math
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from stored import stored

import integrators
from integrators import MethodError
from pendulum_env import growth
from pendulum_env.common.results import write
from pendulum_env.engine.machine import fitting
from pendulum_env.physics.presets import SCENES
from pendulum_env.physics.units import SceneError
from pendulum_env.plots.cost import ERRORS, FEW, draw, draw_errors, leading
from pendulum_env.plots.growth import LAW_COLOURS, error_growth
from pendulum_env.plots.growth import draw as draw_growth
from pendulum_env.plots.style import distinct
from pendulum_env.study import PLAIN
from pendulum_env.study.cost.points import CostPoint, CostStudy
from pendulum_env.study.growth import ROWS, Growth
from pendulum_env.study.growth_laws import EPSILON, KINDS, Law, law_of, rounding_of
from pendulum_env.truth.answer import Truth
from pendulum_env.truth.long_runs import Pair, cut_at_turns, followers, long_truth
from pendulum_env.truth.reference import StudyError, reference

TIME = 10.0 ** np.arange(0.0, 5.01, 0.1)
SIDE = {"backend": "python", "angle": 2.0}
FAST = ("forward_euler", "backward_euler", "velocity_verlet", "rk4", "exact")


def law(error, *, size=1.0, steps=256.0, phase=None, floor=0.0, stopped=math.inf):
    return law_of(TIME, np.broadcast_to(error, TIME.shape), floor=floor, steps=steps * TIME, phase=phase, size=size,
                  stopped=stopped)


# --- laws -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("error", "kind", "slope"),
    [
        (1e-3 * TIME**0, "bounded", 0.0),
        (1e-7 * TIME, "linear", 1.0),
        (1e-12 * TIME**2, "quadratic", 2.0),
        (1e-17 * TIME**3, "faster", 3.0),
        (1e-2 / TIME, "decaying", -1.0),
        (1e-5 + 1e-7 * TIME, "linear", None),
        (1e-9 * TIME + 1e-13 * TIME**2, "quadratic", None),
        (1e-9 * TIME + 1e-18 * TIME**3, "quadratic", 2.0),
        (np.abs(1e-9 * TIME - 4e-14 * TIME**2) + 1e-6, "quadratic", None),
        (1e-4 * (1.0 + 0.3 * np.sin(7.0 * TIME)), "bounded", None),
        (3e-16 * np.sqrt(256.0 * TIME), "round-off", 0.5),
    ],
)
def test_laws_of_powers(error, kind, slope):
    found = law(error)
    assert found.kind == kind
    assert found.kind in KINDS
    assert slope is None or found.slope == pytest.approx(slope, abs=1e-9)
    assert found.lost == math.inf
    assert found.text() == (f"{kind}, as t^{slope}" if kind == "round-off" else kind)


def test_an_exponential_is_told_from_every_power():
    error = np.where(TIME < 200.0, 1e-9 * np.exp(0.15 * np.minimum(TIME, 200.0)), math.nan)
    assert law(error, size=1e9).kind == "exponential"
    assert law(error, size=1e9, stopped=200.0).text() == "exponential, diverged at 200"


def test_saturation_is_lost_and_not_bounded():
    found = law(np.minimum(1e-3 * TIME, 1.0 + 0.3 * np.cos(TIME)))
    assert found.kind == "linear"
    assert found.lost == pytest.approx(500.0, rel=1e-9), "where it passes half the motion, between two looks"
    assert found.text() == "linear, lost at 500"
    assert law(np.minimum(1e-5 * TIME**2, 1.9)).kind == "quadratic"
    assert law(np.full(TIME.shape, 0.9)).kind == "lost"
    assert law(np.where(TIME < 3.0, 0.2, 1.0)).kind == "lost"


def test_nothing_is_said_of_errors_below_the_floor():
    assert law(1e-7 * TIME, floor=1.0).kind == "not known"
    assert law(np.where(TIME > 1e4, 1e-7 * TIME, 1e-9), floor=1e-4).kind == "linear"
    assert law(math.nan, stopped=2.0) == Law("diverged", math.nan, math.inf, 2.0)


def test_rounding_of_each_step_adds_up_as_brouwer_says():
    """A random walk with steps of EPSILON stays below the random bound; steps in one direction reach the other bound.
    """
    steps = np.array([1e2, 1e4])
    walks = np.abs(np.cumsum(np.random.default_rng(0).choice([-EPSILON, EPSILON], (100, 10_000)), axis=1))
    random, one_way = rounding_of(steps, None)
    rms = np.sqrt(np.mean(walks[:, [99, 9999]] ** 2, axis=0))
    assert np.all((0.5 * random < rms) & (rms < 1.2 * random))
    assert one_way == pytest.approx(EPSILON * steps, rel=0.05)
    assert rounding_of(steps, 6.0 * steps)[0] == pytest.approx(random * (4.0 + 0.75 * steps))


# --- errors against formulas ----------------------------------------------------------------------------------------


def test_forward_euler_s_energy_on_the_oscillator_is_the_formula_s():
    """Each step multiplies the energy by 1 + omega0² h², which is exponential growth."""
    found = growth("textbook", ["forward_euler"], periods=100.0, evaluations_per_period=256.0, backend="python")
    (line,) = found.lines
    factor = 1.0 + SCENES["textbook"].omega0 ** 2 * line.dt**2
    expected = factor ** np.round(found.time * 256.0) - 1.0
    got = line.energy_error[np.isfinite(line.energy_error)]
    assert got == pytest.approx(expected[: len(got)], rel=1e-9)
    assert line.energy.kind == line.angle.kind == "exponential"
    assert line.stop_reason == "diverged"


def test_verlet_s_angle_on_the_oscillator_is_the_formula_s():
    """From rest the angle is A cos(n w h) with cos(w h) = 1 - (omega0 h)²/2: early by omega0³ h²/24 per second."""
    found = growth("textbook", ["velocity_verlet"], periods=1000.0, evaluations_per_period=64.0, backend="python")
    (line,) = found.lines
    x = SCENES["textbook"].omega0 * line.dt
    rate = math.acos(1.0 - 0.5 * x * x)
    stride = 64 // ROWS
    for time, error in zip(found.time, line.angle_error, strict=True):
        end = round(64.0 * time)
        n = np.arange(end % stride, end + 1, stride)[-math.ceil(64 / stride):]
        expected = np.max(np.abs(np.cos(n * rate) - np.cos(n * x)))
        assert error == pytest.approx(found.scene.run.angle * expected, rel=0.15)
    assert line.angle.text().startswith("linear, lost at")
    assert line.energy.kind == "bounded"


# --- methods against theory -----------------------------------------------------------------------------------------

# Hairer, Lubich & Wanner 2006, IX.8, X.3, XI.3: structure-preserving methods: angle errors linear, energy bounded.
KEEPS, LOSES = ("linear", "bounded"), ("quadratic", "linear")
ONE = "its bounded error of order 1 still hides what is linear, of order 2"
HIDDEN = "the linear part is only just coming out of the bounded one"
BELOW = "within what rounding makes of the truth"
EXACT = "its own error is below rounding"
LOST = "at this cost it is lost before the quadratic part rules"
CROSSES = "linear and quadratic parts of opposite sign cancel within the decade before it is lost"
SLOW = "the linear part of its energy error comes out of the bounded one later"
EXCEPTIONS = {
    "symplectic_euler": (("decaying", "bounded"), ONE), "conformal_symplectic_euler": (("decaying", "bounded"), ONE),
    "symplectic_euler_position_first": (("bounded", "bounded"), ONE),
    "blanes_moan_srkn6b": (("bounded", "bounded"), HIDDEN), "quinlan8b": (("round-off", "bounded"), BELOW),
    "discrete_gradient": (("linear", "round-off"), "it keeps the energy itself"),
    "exact": (("round-off", "round-off"), EXACT), "taylor": (("round-off", "round-off"), EXACT),
    "quinlan_tremaine10": (("round-off", "round-off"), EXACT),
    "quinlan_tremaine12": (("round-off", "round-off"), EXACT),
    "quinlan_tremaine14": (("round-off", "round-off"), EXACT),
    "forward_euler": (("lost", "linear"), LOST), "backward_euler": (("lost", "lost"), LOST),
    "sdirk2": (("linear", "linear"), LOST), "bdf2": (("linear", "linear"), LOST), "bdf5": (("linear", "linear"), LOST),
    "hht_alpha": (("linear", "linear"), LOST),
    "hht_alpha_mean_force": (("linear", "linear"), LOST),
    "midpoint": (("faster", "linear"), CROSSES), "ralston": (("faster", "linear"), CROSSES),
    "generalized_alpha": (("quadratic", "bounded"), SLOW),
    "generalized_alpha_mean_force": (("linear", "bounded"), SLOW),
}


def laws_of(line):
    return line.angle.kind, line.energy.kind


def check(line):
    method = integrators.get(line.method)
    usual = KEEPS if method.symplectic or method.symmetric else LOSES
    assert laws_of(line) == EXCEPTIONS.get(line.method, (usual, ""))[0], line.method


@pytest.fixture(scope="module")
def few() -> Growth:
    return growth("vacuum", FAST, periods=200.0, evaluations_per_period=64.0, **SIDE)


@pytest.mark.parametrize(("name", "laws"), [
    ("forward_euler", ("lost", "lost")), ("backward_euler", ("lost", "lost")), ("velocity_verlet", KEEPS),
    ("rk4", LOSES), ("exact", ("round-off", "round-off")),
])
def test_errors_grow_as_theory_says(few, name, laws):
    assert laws_of(few.lines[FAST.index(name)]) == laws


def test_all_take_the_same_evaluations(few):
    for line in few.lines:
        assert line.evaluations == pytest.approx(64.0, rel=0.05 if integrators.get(line.method).implicit else 1e-12)


@pytest.mark.slow
def test_every_method_s_errors_grow_as_theory_says():
    found = growth("vacuum", periods=200.0, evaluations_per_period=256.0, **SIDE)
    assert [line.method for line in found.lines] == list(fitting(SCENES["vacuum"]))
    for line in found.lines:
        check(line)
    text = {line.method: line for line in found.lines}
    assert text["backward_euler"].energy.lost < 3.0


@pytest.mark.slow
def test_a_hundred_thousand_periods():
    """Run some 50 million steps, after which the linear part of an Euler method's error dominates."""
    found = growth("vacuum", ["symplectic_euler", "velocity_verlet", "dop853", "forward_euler"], periods=1e5)
    laws = {line.method: laws_of(line) for line in found.lines}
    assert laws["symplectic_euler"] == laws["velocity_verlet"] == KEEPS
    assert laws["dop853"] == LOSES
    assert laws["forward_euler"][1] == "diverged"
    assert 1e3 < found.lines[1].angle.lost < 1e4


# --- the truth ------------------------------------------------------------------------------------------------------


def quiet(_done: float, _what: str) -> None: ...


def test_the_pair_is_the_closed_form_within_its_own_error():
    scene = SCENES["vacuum"]
    period = 2.0 * math.pi / scene.omega0
    marks = period * np.array([1.0, 3.0, 8.0])
    pair = Pair(scene, 1.0, 0.5, marks, period, "python", quiet)
    times = np.sort(np.concatenate([mark - period * np.array([0.9, 0.5, 0.123, 0.0]) for mark in marks]))
    found = pair.at(times)
    true = long_truth(scene, 1.0, 0.5, marks, period, "python", quiet).at(times)
    assert np.all(np.abs(found.angle - true.angle) <= found.error)
    assert found.error_estimate < 3e-13
    assert found.velocity == pytest.approx(true.velocity, abs=1e-12)


@pytest.mark.quick("driven-3e-10")
@pytest.mark.parametrize(("name", "most"), [("lab", 1e-13), ("driven", 3e-10)])
def test_the_pair_is_the_reference_of_other_studies(name, most):
    """Check that the kink of quadratic drag costs no accuracy, since steps are cut at turning points."""
    scene = SCENES[name]
    period = 2.0 * math.pi / scene.omega0
    pair = Pair(scene, scene.run.angle, scene.run.velocity, np.array([period, 2.0 * period]), period, "python", quiet)
    times = period * np.linspace(1.05, 1.95, 5)
    true = reference(scene, scene.run.angle, scene.run.velocity, times)
    found = pair.at(times)
    assert np.all(np.abs(found.angle - true.angle) <= found.error + true.error_estimate)
    assert found.error_estimate < most


def test_the_two_followers_are_different_methods_of_high_order():
    for scene in SCENES.values():
        first, second = followers(scene)
        assert first.name != second.name
        assert min(first.order, second.order) >= 8
    assert cut_at_turns(SCENES["lab"]).has("coulomb_friction")
    assert cut_at_turns(SCENES["exercise_large"]) is SCENES["exercise_large"]


@pytest.mark.slow
def test_chaos_has_a_horizon():
    found = growth("chaotic", ["rk4", "dop853"], periods=300.0)
    assert 10.0 < found.horizon < 100.0
    assert all(line.angle.kind == "exponential" for line in found.lines)
    assert all(np.all(np.isnan(line.angle_error[found.time > found.horizon])) for line in found.lines)
    assert "errors of the angle end there" in found.text
    assert "not known" in [text.get_text() for text in draw_growth(found).axes[0].texts]


@pytest.mark.slow
def test_a_damped_motion_dies_out_and_its_errors_with_it():
    found = growth("lab", ["rk4", "velocity_verlet"], periods=1e5)
    assert 1e3 < found.died < 1e4
    assert found.time[-1] == found.died
    assert {laws_of(line) for line in found.lines} == {("decaying", "bounded")}
    assert "died out" in found.text


# --- running --------------------------------------------------------------------------------------------------------


def test_times_go_to_the_end_and_those_close_to_it_are_left_out():
    found = growth("vacuum", ["exact"], periods=2.1, **SIDE)
    assert found.time == pytest.approx([1.0, 10.0**0.1, 10.0**0.2, 2.1])
    assert np.all(np.isfinite(found.lines[0].angle_error))


def test_steps_longer_than_from_one_time_to_the_next():
    found = growth("vacuum", ["exact"], periods=3.0, evaluations_per_period=1.0, **SIDE)
    assert found.lines[0].dt == pytest.approx(found.period)
    assert np.all(found.lines[0].angle_error < 1e-13)


def test_one_step_for_all():
    found = growth("vacuum", ["rk4", "heun"], step=0.05, periods=3.0, **SIDE)
    assert [line.dt for line in found.lines] == [0.05, 0.05]
    assert [line.evaluations * 0.05 / found.period for line in found.lines] == pytest.approx([4.0, 2.0])


@pytest.mark.slow
def test_an_interrupted_study_keeps_what_it_has(tmp_path):
    told: list[float] = []

    def impatient(done: float, what: str) -> None:
        told.append(done)
        if what == "heun" and done > 0.6:
            raise KeyboardInterrupt

    found = growth("vacuum", ["rk4", "heun", "midpoint"], periods=20.0, evaluations_per_period=64.0,
                   progress=impatient, **SIDE)
    assert not found.complete
    assert [line.method for line in found.lines] == ["rk4", "heun"]
    kept = np.isfinite(found.lines[1].angle_error)
    assert kept[0]
    assert not kept[-1]
    assert told == sorted(told)
    assert "# Complete: false" in write(found, tmp_path)[1].read_text()


def test_progress_ends_at_one():
    told: list[float] = []
    growth("vacuum", ["rk4"], periods=2.0, progress=lambda done, _: told.append(done), **SIDE)
    assert told == sorted(told)
    assert told[-1] == 1.0
    assert max(told[:-1]) < 1.0


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"integrators": ["rk5"]}, MethodError, "rk4"),
        ({"integrators": []}, MethodError, "At least one"),
        ({"scene": "vacum"}, SceneError, "vacuum"),
        ({"periods": 0.5}, SceneError, "periods must be a finite number of at least 1"),
        ({"periods": math.inf}, SceneError, "periods must be a finite number"),
        ({"periods": 1e12}, SceneError, "more than the 1e"),
        ({"evaluations_per_period": 0.0}, SceneError, "evaluations_per_period must be a finite number above 0"),
        ({"step": 100.0}, SceneError, "The step of rk4, 100 s, is longer than a period, 2.01 s"),
        ({"evaluations_per_period": 0.1}, SceneError, "longer than a period"),
        ({"step": -1.0}, SceneError, "step must be a finite number above 0"),
        ({"step": 0.1, "evaluations_per_period": 64.0}, SceneError, "both determine the step"),
        ({"angle": 0.0}, StudyError, "stays at rest"),
        ({"scene": "windy"}, StudyError, "gusts"),
        ({"gravity": 0.0}, StudyError, "no restoring torque and so no period"),
        ({"compensated": True, "integrators": ["exact"]}, MethodError, "ompensated"),
    ],
)
def test_bad_input_gives_one_clear_error(arguments, error, message):
    with pytest.raises(error, match=message):
        growth(**{"scene": "vacuum", "integrators": ["rk4"], "backend": "python", **arguments})


# --- files ----------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_table_and_the_files(few, tmp_path):
    shown = few.table
    assert [row[:3] for row in shown.rows] == [
        (line.label, line.angle.text(), line.energy.text()) for line in few.lines]
    assert shown.head[3:] == ("angle [rad] at 10", "energy at 10")
    picture, rows = write(few, tmp_path)
    with Image.open(picture) as image:
        assert "vacuum" in image.info["Scene"]
    lines = rows.read_text().splitlines()
    body = list(csv.DictReader(line for line in lines if not line.startswith("# ")))
    assert len(body) == len(few.lines) * len(few.time)
    found = [float(row["angle_error_rad"]) for row in body if row["method"] == "rk4"]
    assert found == few.lines[FAST.index("rk4")].angle_error.tolist()


@pytest.mark.slow
def test_the_figure_has_every_method_and_a_colour_for_each_law(few):
    assert set(LAW_COLOURS) == set(KINDS)
    left, right, beside = draw_growth(few).axes
    for axes in (left, right):
        assert {line.get_label() for line in axes.lines} >= {line.label for line in few.lines}
    assert len(beside.get_legend().get_texts()) == len(few.lines)
    crowd = replace(few, lines=few.lines * 20)
    words = " ".join(text.get_text() for text in draw_growth(crowd).axes[2].texts)
    assert all(line.method in words for line in few.lines)
    assert error_growth(few, "energy").get_xscale() == "log"


@pytest.mark.slow
def test_the_command_writes_beside_the_others(few, tmp_path, monkeypatch, run_here):
    """Run `cost --growth`, and check what it writes and prints after the first study."""
    asked = {}
    monkeypatch.setattr("pendulum_env.study.growth.growth", lambda *given, **more: asked.update(more) or few)
    monkeypatch.setattr("pendulum_env.study.cost.study.cost", lambda *_, **__: many(3))
    code, printed, _ = run_here("cost", "--scene", "vacuum", "-i", "rk4", "--growth", "200", "-o", ".")
    assert code == 0
    assert asked["periods"] == 200.0
    assert {path.name for path in tmp_path.iterdir()} == {
        "cost.png", "cost_errors.png", "cost.csv", "growth.png", "growth.csv"}
    assert "quadratic, lost at" in printed


# --- work-precision diagrams of many methods ------------------------------------------------------------------------


def many(count: int) -> CostStudy:
    """Return a study with lines of increasing cost, of which the first ones form the Pareto front."""
    names = stored("methods")[:count]
    points = tuple(
        CostPoint(name, 0.1**k, 10, 10.0**-k, 10.0**-k, 10.0**-k, 40.0 * 2**k, (1e-3 * 2**k * (1.0 + i),),
                  1e3 * 2**k * (1.0 + i), phase_error=10.0**-k)
        for i, name in enumerate(names) for k in (2, 5, 8))
    truth = Truth(np.arange(2.0), np.ones(2), np.zeros(2), 1e-14, "by hand")
    return CostStudy(SCENES["vacuum"], 1.0, 0.0, 1.0, truth, points, 1)


def test_few_lines_are_all_in_colour_and_of_many_the_plain_ones_and_the_front():
    few = many(FEW)
    both = replace(few, points=tuple(replace(p, rtol=rtol) for p in few.points for rtol in (None, 1e-6)))
    for study in (few, both):
        assert leading(study) == study.series
        assert "all others" not in {text.get_text() for text in draw(study).legends[0].get_texts()}
    crowd = many(60)
    cheap = replace(crowd.points[-1], times=(1e-9,), ns_per_second=1e-6)
    chosen = leading(replace(crowd, points=(*crowd.points[:-1], cheap)))
    assert {"rk4", "symplectic_euler", cheap.method} <= set(chosen)
    assert len(chosen) <= FEW


def test_of_a_long_front_those_that_hold_most_of_it_are_in_colour():
    crowd, errors = many(60), 10.0 ** -np.array([1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.7, 1.8, 11.0])
    names = [name for name in crowd.series if name not in PLAIN][-len(errors):]
    front = tuple(replace(crowd.of(name)[0], angle_error=error, times=(1e-9 * (1.0 + i),))
                  for i, (name, error) in enumerate(zip(names, errors.tolist(), strict=True)))
    chosen = leading(replace(crowd, points=(*crowd.points, *front)))
    assert names[-1] in chosen
    assert len(chosen) == FEW
    assert not set(names) <= set(chosen)


def test_grey_lines_have_no_entry_and_adapted_ones_are_dashed():
    crowd = many(60)
    adapted = [replace(p, rtol=1e-6, times=(p.time / 100.0,)) for p in crowd.of("rk4")]
    crowd = replace(crowd, points=(*crowd.points, *adapted))
    made = draw(crowd)
    entries = {text.get_text().partition("\n")[0]: line
               for text, line in zip(made.legends[0].get_texts(), made.legends[0].get_lines(), strict=True)}
    assert entries.keys() == {*leading(crowd), "Pareto front", "all others"}
    assert entries["rk4, adaptive"].get_linestyle() == "--"
    assert entries["rk4, adaptive"].get_color() == entries["rk4"].get_color()
    assert all(len(axes.lines) >= 61 for axes in made.axes)


def test_errors_side_by_side_where_there_are_any():
    assert len(draw_errors(many(3)).axes) == len(ERRORS)
    bare = replace(many(3), points=tuple(replace(p, phase_error=math.nan) for p in many(3).points))
    assert [axes.get_title("left") for axes in draw_errors(bare).axes] == ["angle", "energy"]


def test_no_colour_is_there_twice():
    for names in (integrators.METHODS, reversed(integrators.METHODS)):
        tones = distinct(list(names)[:FEW])
        assert len(set(tones.values())) == FEW
