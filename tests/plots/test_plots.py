"""Test that figures show the given data in one style, and leave no settings changed."""

from __future__ import annotations

import io
import json
import math
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import matplotlib
import numpy as np
import pytest
from choice import turn_of
from figure_texts import dashes_of, left_title
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.text import Text

import integrators
from pendulum_env import plots
from pendulum_env.engine.machine import Machine
from pendulum_env.engine.rollout import rollout
from pendulum_env.physics import exact
from pendulum_env.physics.presets import SCENES
from pendulum_env.plots import series, style
from pendulum_env.plots.section import poincare
from pendulum_env.plots.titles import fitted, page
from pendulum_env.plots.titles import width as width_of
from pendulum_env.render import METHOD_COLOURS
from pendulum_env.study.compare import Truth
from pendulum_env.study.section import section

SHEET = ("forward_euler", "backward_euler", "symplectic_euler", "velocity_verlet", "rk4")
NINE = (*SHEET, "symplectic_euler_position_first", "conformal_symplectic_euler", "midpoint", "heun")
DRAWN = (plots.angle, plots.velocity, plots.phase, plots.energy, plots.energy_error)


def runs(*names, scene="exercise", duration=2.0, dt=0.05, **more):
    return {n: rollout(scene, integrator=n, duration=duration, dt=dt, backend="python", **more) for n in names}


@pytest.fixture(scope="module")
def sheet():
    return runs(*SHEET)


@pytest.fixture(scope="module")
def truth(sheet):
    run = sheet["rk4"]
    angle, velocity = exact.linear(run.time, run.angle[0], 0.0, run.scene.omega0)
    return Truth(run.time, angle, velocity, 0.0, "closed form", closed=True)


def curves(axes: Axes) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    return {line.get_label(): (np.asarray(line.get_xdata()), np.asarray(line.get_ydata())) for line in axes.lines}


def entries(axes: Axes) -> list[str]:
    legend = axes.get_legend()
    return [] if legend is None else [text.get_text() for text in legend.get_texts()]


@pytest.mark.parametrize("draw", DRAWN)
def test_a_figure_takes_axes_or_makes_its_own_and_shows_every_run(draw, sheet):
    axes = plots.figure()[1][0]
    assert draw(sheet, axes=axes) is axes
    own = draw(sheet)
    assert own is not axes
    for at in (axes, own):
        assert [name for name in entries(at) if name != "start"] == list(sheet)
        assert all(word in at.get_title("left") for word in ("exercise", "no damping", "5°", "dt = 0.05 s"))
        assert "[" in at.get_xlabel()
        assert at.get_ylabel()


def test_curves_are_the_data_in_the_units_of_the_axes(sheet, truth):
    shown = curves(plots.angle(sheet, exact=truth))
    for name, run in sheet.items():
        np.testing.assert_array_equal(shown[name][0], run.time)
        np.testing.assert_allclose(shown[name][1], np.degrees(run.angle), rtol=1e-15)
    np.testing.assert_allclose(shown["exact"][1], np.degrees(truth.angle), rtol=1e-15)
    numerical = replace(truth, closed=False)
    for draw in (plots.angle, plots.velocity, plots.phase):
        assert "reference" in curves(draw(sheet, exact=numerical))
    assert "reference" in plots.deviation(sheet, numerical).get_ylabel()
    x, y = curves(plots.phase(sheet, exact=truth))["rk4"]
    np.testing.assert_allclose(x, np.degrees(sheet["rk4"].angle), rtol=1e-15)
    np.testing.assert_array_equal(y, sheet["rk4"].velocity)
    np.testing.assert_array_equal(curves(plots.velocity(sheet))["rk4"][1], sheet["rk4"].velocity)
    error = curves(plots.energy_error(sheet))["forward_euler"][1]
    run = sheet["forward_euler"]
    np.testing.assert_allclose(error[1:], (run.energy / run.energy[0] - 1.0)[1:], rtol=1e-12)
    axes = plots.energy(sheet)
    assert axes.get_ylabel() == "energy [mJ]"
    np.testing.assert_allclose(curves(axes)["rk4"][1], 1e3 * sheet["rk4"].energy, rtol=1e-15)


def test_the_distance_from_the_exact_motion_is_the_largest_in_each_half_swing(sheet, truth):
    run = sheet["rk4"]
    time, error = curves(plots.deviation(sheet, truth))["rk4"]
    size = round(math.pi / run.scene.omega0 / 0.05)
    distance = np.degrees(np.abs(run.angle - truth.angle))
    assert error[0] == distance[:size].max()
    assert error[-1] == distance[size * (len(error) - 1):].max()
    assert np.all(np.diff(time) > 0.0)


def test_a_method_has_its_own_colour_unless_one_before_has_it():
    every = list(integrators.METHODS)
    own = {name: plots.colours([name])[name] for name in (*every, "nobody")}
    assert set(own.values()) == set(METHOD_COLOURS)
    assert plots.colours(every) == {name: own[name] for name in every}  # once all eight are taken, they are used again
    assert len(set(plots.colours(SHEET).values())) == len(SHEET)
    alike = [name for name in every if own[name] == own["rk4"]][:8]
    assert len(alike) == 8
    assert set(plots.colours(alike).values()) == set(METHOD_COLOURS)
    for name in (*every, "nobody"):
        assert plots.colours([name, "rk4"])[name] == own[name]
        assert (plots.colours(["rk4", name])[name] == own[name]) is (own[name] != own["rk4"] or name == "rk4")
    drawn = runs("rk4", "midpoint")
    assert own["rk4"] == own["midpoint"]
    for draw in DRAWN:
        seen = {line.get_label(): to_hex(line.get_color()).upper() for line in draw(drawn).lines}
        assert {name: seen[name] for name in drawn} == plots.colours(drawn)


@pytest.mark.slow
@pytest.mark.parametrize("draw", DRAWN)
def test_methods_of_one_colour_have_dashes_or_marks_of_their_own_whatever_else_is_drawn(draw):
    """A method that is alone is solid; beside another method, it looks as it does among all."""
    def marked(drawn):
        shown = {line.get_label(): line for line in draw(drawn).lines}
        return {name: (to_hex(line.get_color()), str(dashes_of(line)), line.get_marker())
                for name, line in shown.items() if name in drawn}

    every = runs(*integrators.METHODS, duration=0.2)
    together = marked(every)
    assert len(set(together.values())) == len(every) > len(METHOD_COLOURS)
    alone = [name for name in every if turn_of(name, len(DRAWN)) == DRAWN.index(draw)]  # of each figure another part
    for name in alone:
        other = next(other for other in ("rk4", "heun") if other != name)
        assert marked({name: every[name], other: every[other]})[name] == together[name]
        tone, dashes, mark = marked({name: every[name]})[name]
        assert (tone, dashes, mark in ("", "None")) == (together[name][0], "None", True)


def test_two_runs_of_one_method_share_its_colour_and_differ_in_dashes():
    twice = {f"dt {dt}": runs("rk4", dt=dt, duration=0.2)["rk4"] for dt in (0.05, 0.1)}
    first, second = style.looks(twice).values()
    assert first.colour == second.colour == plots.colours(["rk4"])["rk4"]
    assert first.dashes != second.dashes
    assert first.mark != second.mark


@pytest.mark.quick("angle-9")
@pytest.mark.quick("energy-9")
@pytest.mark.parametrize("count", [9, *(pytest.param(count, marks=pytest.mark.slow) for count in (1, 2))])
@pytest.mark.parametrize("draw", DRAWN)
def test_one_method_stands_in_the_title_and_more_in_a_legend_that_fits(draw, count):
    names = NINE[:count]
    drawn = runs(*names, scene="exercise_large", duration=0.2)
    axes = draw({Machine(run.scene, name, backend="python").label: run for name, run in drawn.items()})
    axes.figure.canvas.draw()
    if count == 1:
        assert names[0] in axes.get_title("left")
    legend = axes.get_legend()
    if legend is not None:
        inside, whole = legend.get_window_extent(), axes.figure.bbox
        assert inside.x1 <= whole.x1
        assert inside.y1 <= whole.y1
        assert inside.y0 >= axes.bbox.y1 - 1
    assert axes.bbox.height > 0.35 * axes.figure.bbox.height
    assert axes.bbox.width > 0.75 * axes.figure.bbox.width


def test_exploding_energy_gets_a_logarithmic_axis_and_tame_energy_none(sheet):
    assert plots.energy(runs("rk4", "velocity_verlet")).get_yscale() == "linear"
    wild = plots.energy(runs("forward_euler", "rk4", duration=6.0))
    assert wild.get_yscale() == "log"
    initial = 1e3 * float(sheet["rk4"].energy[0])
    assert wild.get_ylim()[1] <= 1e6 * initial * 1.01
    assert plots.energy(runs("rk4", angle=0.0)).get_ylim()[1] > 0.0


@pytest.mark.parametrize("draw", [*DRAWN, lambda given: plots.deviation(given, None)])
def test_what_is_no_single_run_is_refused_in_words(draw):
    single, batch = (rollout("vacuum", angle=angle, duration=0.1, backend="python") for angle in (0.1, [0.1, 0.2]))
    for given, words in (({}, "not an empty one"), (single, "not Rollout"), ({"many": batch}, "'many' is a batch")):
        with pytest.raises(ValueError, match=words):
            draw(given)


def test_energy_that_a_drive_brings_is_on_the_axis():
    driven = runs("rk4", "gauss4", scene="lab", angle=1e-6, control=1.0)
    axes = plots.energy(driven)
    assert axes.get_ylabel() == "energy [mJ]"
    for run in driven.values():
        assert 1e3 * run.energy.max() < axes.get_ylim()[1] < 2e3 * run.energy.max()


def test_a_runaway_curve_does_not_flatten_the_others():
    wild = runs("forward_euler", "velocity_verlet", "rk4", duration=10.0)
    reach = np.degrees(np.abs(wild["forward_euler"].angle).max())
    limit = plots.angle(wild).get_ylim()[1]
    assert 5.0 * 5.0 <= limit < 0.2 * reach
    assert plots.phase(wild).get_xlim()[1] < 0.2 * reach


@pytest.mark.quick("1-True")
@pytest.mark.parametrize("given", [True, False])
@pytest.mark.parametrize("dead", [1, 2])
def test_the_motion_is_not_cut_off_where_most_methods_have_died(given, dead):
    """Backward Euler and bdf2 lose their swing, but the last swings of a good method are like its first."""
    known = runs(*("backward_euler", "bdf2")[:dead], "velocity_verlet", scene="textbook", angle=0.1, duration=60.0)
    good = known["velocity_verlet"]
    rate = good.scene.omega0
    moved = exact.linear(good.time, 0.1, 0.0, rate)
    truth = Truth(good.time, *moved, 0.0, "closed form", closed=True) if given else None
    assert abs(known["backward_euler"].angle[good.time > 50.0]).max() < 0.01
    for draw, size in ((plots.angle, math.degrees(0.1)), (plots.velocity, 0.1 * rate)):
        low, high = draw(known, exact=truth, span=(54.0, 60.0)).get_ylim()
        assert low < -0.99 * size
        assert 0.99 * size < high < 1.2 * size
    axes = plots.phase(known, exact=truth, spans=[(54.0, 60.0)])
    assert axes.get_xlim()[1] > 0.99 * math.degrees(0.1)
    assert axes.get_ylim()[1] > 0.99 * 0.1 * rate


def test_pendulums_that_turn_over_and_drift_apart_are_all_shown():
    wild = runs("rk4", "forward_euler", scene="chaotic", duration=200.0)
    last = {name: np.degrees(run.angle[run.time > 190.0]) for name, run in wild.items()}
    assert np.abs(last["rk4"]).min() > 5.0 * np.abs(last["forward_euler"]).max()
    low, high = plots.angle(wild, span=(190.0, 200.0)).get_ylim()
    left, right = plots.phase(wild, spans=[(190.0, 200.0)]).get_xlim()
    for values in last.values():
        assert max(low, left) <= values.min()
        assert values.max() <= min(high, right)


def test_a_long_run_shows_the_angle_at_all_times_and_only_a_crowded_one_the_turning_points():
    long = runs("rk4", duration=20.0, dt=0.02)
    axes = plots.angle(long)
    assert "turning" not in axes.get_ylabel()
    np.testing.assert_allclose(curves(axes)["rk4"][1], np.degrees(long["rk4"].angle), rtol=1e-15)
    assert axes.lines[0].get_linestyle() == "-"
    near = plots.angle(long, span=(18.0, 20.0))
    assert near.get_xlim() == (18.0, 20.0)
    assert len(curves(near)["rk4"][0]) == pytest.approx(101, abs=2)
    crowded = runs("rk4", duration=200.0, dt=0.04)
    axes = plots.angle(crowded)
    assert "between turning points" in axes.get_ylabel()
    _, shown = curves(axes)["rk4"]
    np.testing.assert_allclose(np.abs(shown[np.isfinite(shown)]), 5.0, atol=0.05)
    (band,) = axes.patches
    low, high = band.get_path().vertices[:, 1].min(), band.get_path().vertices[:, 1].max()
    assert (low, high) == (pytest.approx(-5.0, abs=0.05), pytest.approx(5.0, abs=0.05))


@pytest.mark.parametrize("name", ["velocity_verlet", "rk4"])
def test_a_logarithmic_axis_has_two_tick_labels_and_no_comb(name):
    """Verlet's error of the energy has the same largest value, A^2 (omega0 h)^2 / 4 of E0, in each half swing."""
    long = runs(name, duration=60.0, dt=0.02)
    run = long[name]
    for axes in (plots.energy_error(long), plots.deviation(long, Truth(
            run.time, *exact.linear(run.time, run.angle[0], 0.0, run.scene.omega0), 0.0, "closed form"))):
        low, high = axes.get_ylim()
        assert sum(low <= tick <= high for tick in axes.get_yticks()) >= 2
        assert axes.get_xlim() == (0.0, 60.0)
    if name == "velocity_verlet":
        shown = curves(plots.energy_error(long))[name][1]
        limit = (run.scene.omega0 * 0.02) ** 2 / 4.0
        np.testing.assert_allclose(shown, limit, rtol=0.01)


def test_swings_that_take_longer_than_small_ones_leave_no_comb():
    """From 170 degrees a period is 2.4 times that of small swings; its half swings have one largest error each."""
    wide = runs("velocity_verlet", scene="vacuum", angle=math.radians(170.0), duration=60.0, dt=0.01)
    shown = curves(plots.energy_error(wide))["velocity_verlet"][1]
    assert shown.max() < 1.1 * shown.min()


def test_the_wobble_of_a_symplectic_method_is_visible_beside_runaways(sheet):
    """Symplectic Euler keeps v^2 + omega0^2 q^2 - h omega0^2 q v: its energy swings by omega0 h / 2 of E0."""
    drawn = runs(*SHEET, duration=6.0, dt=0.01)
    axes = plots.energy_residual(drawn)
    assert axes.get_yscale() == "linear"
    size = 50.0 * drawn["rk4"].scene.omega0 * 0.01
    shown = curves(axes)["symplectic_euler"][1]
    assert (shown.max(), -shown.min()) == (pytest.approx(size, rel=0.05), pytest.approx(size, rel=0.05))
    assert shown.max() < axes.get_ylim()[1] < 1.3 * shown.max()
    assert curves(axes)["forward_euler"][1].max() > 100.0 > axes.get_ylim()[1]


def test_each_method_has_its_own_phase_portrait(sheet, truth):
    figure = plots.portraits(sheet, exact=truth, note="a note")
    shown = [axes for axes in figure.axes if axes.axison]
    assert [axes.get_title("left") for axes in shown] == list(sheet)
    for axes, (name, run) in zip(shown, sheet.items(), strict=True):
        drawn = curves(axes)
        assert set(drawn) == {"exact", name, "start"}
        np.testing.assert_array_equal(drawn[name][1], run.velocity)
        assert to_hex(axes.lines[1].get_color()).upper() == plots.colours([name])[name]
    (spare,) = [axes for axes in figure.axes if not axes.axison]
    assert "a note" in spare.texts[0].get_text()
    assert len(plots.portraits({"rk4": sheet["rk4"]}).axes) == 1


def test_a_damped_portrait_shows_turns_of_the_whole_spiral_and_no_empty_axis():
    """Of 84 periods, every third is drawn, so that turns stay apart; a runaway's axes end where its curve does."""
    damped = runs("rk4", damping={"linear": {"gamma": 0.05}}, duration=100.0, dt=0.02)
    axes = plots.phase(damped)
    x = curves(axes)["rk4"][0]
    pieces = np.split(x, np.flatnonzero(np.isnan(x)))
    assert 20 <= len(pieces) <= 30
    reach = np.array([np.nanmax(piece) for piece in pieces])
    assert (np.diff(reach) < 0.0).all()
    assert reach[0] > 4.7
    assert reach[-1] < 5.0 * math.exp(-0.025 * 90.0)
    assert "One period in 3 is drawn." in axes.texts[0].get_text()
    wild = runs("rk4", "forward_euler", scene="lab", angle=math.radians(60.0), duration=40.0, dt=0.01)
    turned = plots.phase(wild, spans=[(0.0, 6.0), (34.0, 40.0)])
    inside = [np.abs(x[np.isfinite(x) & (np.abs(x) <= 300.0)]).max() for x, _ in curves(turned).values()]
    assert turned.get_xlim()[1] < 1.2 * max(inside)


def test_a_run_that_stops_says_so():
    stopped = runs("forward_euler", "rk4", scene="exercise_large", duration=6.0)
    reason, end = stopped["forward_euler"].stop_reason, stopped["forward_euler"].time[-1]
    assert reason == "slack"
    axes = plots.angle(stopped)
    assert f"forward_euler (slack, {end:.3g} s)" in entries(axes)
    later = plots.angle(stopped, span=(end + 1.0, 6.0))
    assert curves(later)[f"forward_euler (slack, {end:.3g} s)"][0].size == 0


def test_pieces_of_curves():
    time = np.linspace(0.0, 10.0, 1001)
    at, shown = series.turning(time, np.cos(2.0 * np.pi * time))
    gap = int(np.flatnonzero(np.isnan(at))[0])
    np.testing.assert_allclose(at[:gap], np.arange(1, 10), atol=0.011)
    np.testing.assert_allclose(at[gap + 1:], np.arange(10) + 0.5, atol=0.011)
    np.testing.assert_allclose(shown[gap + 1:], -1.0, atol=1e-3)
    np.testing.assert_array_equal(series.turning(time, time)[1], time)
    at, shown = series.peaks(time, time, -np.sin(2.0 * np.pi * time), 0.5)
    assert len(at) == 20 - 1
    np.testing.assert_allclose(shown[:-1], 0.5 * np.arange(1, 19), atol=0.011)
    assert shown[-1] == 10.0
    np.testing.assert_allclose(series.peaks(time, time, 1.0 + time, 0.5)[1][:-1], 0.5 * np.arange(1, 20), atol=0.011)
    np.testing.assert_array_equal(series.peaks(time, time, time, math.inf)[1], time)
    assert len(series.peaks(time, time, np.sin(60.0 * np.pi * time), 1.0 / 60.0)[0]) <= series.PEAKS
    assert series.periods(np.cos(2.0 * np.pi * time), [slice(0, 1001)]) == (1, [slice(0, 1001)])
    assert series.within(time, (2.0, 3.0)) == slice(199, 302)
    assert series.within(time, (11.0, 12.0)) == slice(0, 0)
    assert series.bounds(np.array([2.0, math.nan, math.inf])) == (0.0, 2.0)


@pytest.mark.slow
def test_drawing_and_saving_change_no_setting_and_load_no_pyplot(tmp_path):
    code = (
        "import sys\nimport matplotlib\nbefore = matplotlib.rcParams.copy()\n"
        "from pendulum_env import plots\nfrom pendulum_env.engine.rollout import rollout\n"
        "runs = {'rk4': rollout('textbook', duration=0.1, backend='python')}\n"
        "for draw in (plots.angle, plots.velocity, plots.phase, plots.energy, plots.energy_error):\n"
        "    made = draw(runs).figure\n"
        "plots.save(made, sys.argv[1])\n"
        "print(matplotlib.rcParams.copy() == before, 'matplotlib.pyplot' in sys.modules, 'tkinter' in sys.modules)"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "energy.png")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True", "False", "False"]


@pytest.mark.slow
def test_a_style_of_the_users_leaves_figures_as_they_are(sheet, tmp_path):
    def pictures(name):
        drawn = plots.angle({"rk4": sheet["rk4"]}).figure
        drawn.savefig(tmp_path / f"{name}.png", dpi=50)
        return (tmp_path / f"{name}.png").read_bytes(), drawn._repr_html_()

    plain = pictures("plain")
    with matplotlib.style.context("dark_background"):
        assert pictures("styled") == plain


@pytest.mark.slow
def test_saved_figures_carry_their_facts(sheet, tmp_path):
    from PIL import Image

    figure = plots.energy(sheet).figure
    facts = {"Software": "lab-pendulum 1", "scene": "exercise — 5°"}
    picture = plots.save(figure, tmp_path / "energy.png", facts)
    with Image.open(picture) as image:
        assert {key: image.info[key] for key in facts} == facts
        assert image.size[0] == 1200
    drawing = plots.save(figure, tmp_path / "energy.svg", facts)
    described = ElementTree.parse(drawing).getroot().find(".//{http://purl.org/dc/elements/1.1/}description")
    assert json.loads(described.text) == facts
    first = drawing.read_bytes()
    assert plots.save(figure, drawing, facts).read_bytes() == first


@pytest.mark.slow
def test_a_figure_is_laid_out_once_and_drawn_once_for_each_file(sheet, tmp_path, monkeypatch):
    """The PNG is that of Matplotlib, which lays out for every file; the figure keeps its layout and its resolution."""
    figure = plots.angle(sheet).figure
    drawn, laid, layout, dpi = [], [], figure.get_layout_engine(), figure.dpi
    alone = plots.save(figure, tmp_path / "alone.png").read_bytes()
    draw, execute = style.Figure.draw, type(layout).execute
    monkeypatch.setattr(style.Figure, "draw", lambda *given: drawn.append(1) or draw(*given))
    monkeypatch.setattr(type(layout), "execute", lambda *given: laid.append(1) or execute(*given))
    png, svg = plots.save_all(figure, tmp_path / "angle", {})
    assert (len(drawn), len(laid)) == (2, 1)
    assert png.read_bytes() == alone
    assert b"<svg" in svg.read_bytes()
    assert figure.get_layout_engine() is layout
    assert figure.dpi == dpi


def test_numbers_at_ticks_are_text_with_raised_exponents_and_axes_keep_their_formatters() -> None:
    drawing, (linear, powers) = style.figure(2)
    linear.set(xlim=(-1.0, 1.0), ylim=(0.0, 3e-7))
    powers.set(yscale="log", ylim=(1e-12, 10.0))
    every = linear.xaxis, linear.yaxis, powers.yaxis
    usual = [axis.get_major_formatter() for axis in every]
    drawing.savefig(io.BytesIO())
    assert [axis.get_major_formatter() for axis in every] == usual
    labels = {tick.label1.get_text() for axis in every for tick in axis.majorTicks}
    assert {"\N{MINUS SIGN}1.00", "10⁻¹²", "10⁰"} <= labels
    assert not any("$" in label for label in labels)
    assert linear.yaxis.get_offset_text().get_text().startswith("$"), "the factor of an axis is mathematics"


def test_a_figure_that_cannot_be_saved_leaves_the_old_one(sheet, tmp_path, monkeypatch):
    target = tmp_path / "angle.png"
    target.write_text("old")
    figure = plots.angle(sheet).figure
    with pytest.raises(ValueError, match=r"\.png or \.svg, not 'angle\.pdf'"):
        plots.save(figure, tmp_path / "angle.pdf")

    def fails(path, **_options):
        path.write_text("half")
        raise RuntimeError("full")

    monkeypatch.setattr(figure, "savefig", fails)
    with pytest.raises(RuntimeError, match="full"):
        plots.save(figure, target)
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("angle.png", "old")]


def test_a_long_title_goes_on_in_a_second_line_and_stays_in_the_figure() -> None:
    scene = SCENES["exercise"].replace(name="fitted to a long recording.txt")
    run = rollout(scene, damping={"linear": {"gamma": 0.01}, "quadratic": {"c": 0.01}}, angle=0.7, velocity=-0.2707,
                  duration=0.1, dt=0.01, backend="python")
    axes = plots.angle({"rk4": run})
    title, figure = left_title(axes), axes.figure
    figure.draw_without_rendering()
    assert title.get_text().count("\n") == 1
    assert "\N{MINUS SIGN}0.2707 rad/s" in title.get_text()
    assert title.get_window_extent().x1 <= figure.bbox.x1


@pytest.mark.parametrize("text", ["one · two", "one two three"])
def test_a_text_that_is_as_wide_as_its_room_stays_in_one_line(text):
    room = width_of(text, 9.0)
    assert fitted(text, 9.0, room) == text
    assert fitted(f"{text} · four", 9.0, room) == f"{text}\nfour"
    assert "\n" in fitted(text, 9.0, room - 0.01)


def test_a_page_has_the_title_and_the_note_that_it_was_given() -> None:
    for title, note in (("Motion", "rk4"), ("Motion", ""), ("", "rk4"), ("", "")):
        with page((4.0, 3.0), None, title, note) as drawing:
            drawing.subplots()
        found = [text.get_text() for text in drawing.findobj(Text) if text.axes is None and text.get_text()]
        assert sorted(found) == sorted(filter(None, (title, note)))


@pytest.mark.quick("period-angle [rad]-velocity [rad/s]")
@pytest.mark.parametrize(("event", "across", "up"), [
    ("period", "angle [rad]", "velocity [rad/s]"),
    ("bottom", "phase of the drive [rad]", "velocity [rad/s]"),
    ("turning", "phase of the drive [rad]", "angle [rad]"),
])
def test_a_section_names_what_its_points_are(event: str, across: str, up: str) -> None:
    """Velocities at turning points are 0, and so are angles at the bottom: neither is drawn."""
    points = section("chaotic", points=4, transient=0, steps=40, event=event, backend="python")
    axes = poincare(points)
    assert (axes.get_xlabel(), axes.get_ylabel()) == (across, up)
