"""Test every figure function of the package: collected by signature, drawn, measured and saved.

``python tests/plots/test_figures.py`` makes the reference pictures anew.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import io
import json
import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch
from xml.etree import ElementTree

import matplotlib
import numpy as np
import pytest
from drawn_films import NAMES, draw
from figure_texts import cut_off, overlapping, written
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from normal_posterior import normal_posterior
from PIL import Image
from small_driven_fit import small_driven_fit
from stored import stored
from typer.testing import CliRunner

import pendulum_env
from integrators import METHODS
from pendulum_env import (
    SCENES,
    Recording,
    audit,
    basins,
    cli,
    cost,
    fit,
    growth,
    measure,
    plots,
    rollout,
    section,
    stress,
    transfer,
)
from pendulum_env.common.provenance import provenance
from pendulum_env.lab import follow, measure_amplitudes, measure_kater, measure_lengths
from pendulum_env.physics import exact
from pendulum_env.plots import titles
from pendulum_env.plots.style import blank, decades
from pendulum_env.study.compare import Truth

pytestmark = pytest.mark.usefixtures("all_interpreted")

ROOT = Path(pendulum_env.__file__).parent
PICTURES = Path(__file__).with_name("figure_pictures.json")
NO_FIGURES = {"plots.style.blank"}
"""Functions that return a figure without drawing anything in it."""
REPORTED = ("exercise.figures", "study.demo")
"""Modules whose figures are made for one report or for the tour; tests of these look at them."""
SHEET = ("forward_euler", "backward_euler", "symplectic_euler", "velocity_verlet", "rk4")
LONG = "a_scene_whose_name_is_as_long_as_names_may_be" * 2 + "_indeed"


def drawing(path: Path) -> str:
    """Return the name of a module whose source imports matplotlib, else ""."""
    names = ".".join(path.relative_to(ROOT).with_suffix("").parts)
    return names if "\nfrom matplotlib" in path.read_text(encoding="utf-8") else ""


def found() -> dict[str, Callable[..., Any]]:
    """Return every public function that returns Axes or a Figure, by its name in the package."""
    functions = {}
    for module in sorted({*filter(None, map(drawing, ROOT.rglob("*.py")))} - {*REPORTED}):
        room = importlib.import_module(f"pendulum_env.{module}")
        for name, entry in vars(room).items():
            if inspect.isfunction(entry) and entry.__module__ == room.__name__ and not name.startswith("_") and (
                    entry.__annotations__.get("return") in ("Axes", "Figure")):
                functions[f"{module}.{name}"] = entry
    return {name: entry for name, entry in functions.items() if name not in NO_FIGURES}


FUNCTIONS = found()


# --- what they are drawn from -----------------------------------------------------------------------------------------


@cache
def runs(scene: str = "exercise", **start: float) -> dict[str, Any]:
    place = replace(SCENES["exercise"], name=scene)
    return {name: rollout(place, integrator=name, duration=2.0, dt=0.05, backend="python", warn=False, **start)
            for name in SHEET}


@cache
def truth() -> Truth:
    run = runs()["rk4"]
    return Truth(run.time, *exact.linear(run.time, run.angle[0], 0.0, run.scene.omega0), 0.0, "closed form")


@cache
def cost_study() -> Any:
    return cost("vacuum", ["rk4", "heun"], duration=0.5, steps=[0.1, 0.05], repeats=1)


@cache
def growth_study() -> Any:
    return growth("vacuum", ["rk4", "forward_euler"], periods=5.0)


@cache
def audited() -> Any:
    return audit("lab", amplitude=0.3, tolerance=1e-2)


@cache
def matrix() -> Any:
    return stress(["upright for a moment"], SHEET)


@cache
def swing() -> Recording:
    time = np.linspace(0.0, 10.0, 201)
    return Recording(time, 0.2 * np.exp(-0.05 * time) * np.cos(5.0 * time), "swing.txt")


@cache
def fitted() -> Any:
    with patch.dict(os.environ, {"LAB_PENDULUM_BACKEND": "compiled"}):  # a fit takes minutes interpreted
        return fit(swing(), "linear", mass=0.1)


@cache
def sectioned(over: bool = False) -> Any:
    values = {"over": {"drive_torque": [0.9, 1.0, 1.1]}} if over else {"runs": 2}
    return section("chaotic", points=60, transient=2, steps=20, backend="python", **values)


@cache
def attracted() -> Any:
    return basins("chaotic", gamma=1.0, drive_torque=0.5, size=4, transient=4, steps=20, backend="python")


@cache
def transferred() -> Any:
    short = {"max_episode_steps": 5, "backend": "python", "warn": False}
    real = {**short, "gravity": 5.0, "length": 0.4}
    return transfer(lambda seen: np.sign(seen[:, 2:]), short, real, episodes=3)


@cache
def filmed() -> Any:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "swing.mp4"
        draw(replace(NAMES["plain"], seconds=5.0), path)
        return follow(path)


METHODS_SHOWN = tuple(METHODS[name] for name in SHEET)
TABLES = tuple(METHODS[name] for name in ("forward_euler", "backward_euler", "rk4"))
FROM: Mapping[str, Callable[[], tuple[Any, ...]]] = {
    "plots.energy.energy": lambda: (runs(),),
    "plots.energy.energy_error": lambda: (runs(),),
    "plots.energy.energy_residual": lambda: (runs(),),
    "plots.motion.angle": lambda: (runs(),),
    "plots.motion.velocity": lambda: (runs(),),
    "plots.motion.deviation": lambda: (runs(), truth()),
    "plots.motion.phase": lambda: (runs(),),
    "plots.motion.portraits": lambda: (runs(),),
    "plots.recorded.recorded": lambda: (fitted(),),
    "plots.filmed.draw": lambda: (filmed(),),
    "plots.driven.driven": lambda: (small_driven_fit("run.csv", "run2.csv"),),
    "plots.corner.corner": lambda: (normal_posterior(fitted()),),
    "plots.swing.measured": lambda: (measure(swing()),),
    "plots.swing.readings": lambda: (swing(),),
    "plots.by_hand.amplitudes_by_hand": lambda: (measure_amplitudes("0:30, 20:22.2, 30:19.4, 60:12.2"),),
    "plots.by_hand.lengths_by_hand": lambda: (measure_lengths(([0.2, 0.4, 0.8], [0.9, 1.26, 1.79])),),
    "plots.by_hand.kater_by_hand": lambda: (
        measure_kater(([0.0, 0.1, 0.2], [1.99, 2.0, 2.012], [1.97, 2.0, 2.032]), 1.0),),
    "plots.stability.regions": lambda: (TABLES,),
    "plots.stability.oscillation": lambda: (METHODS_SHOWN,),
    "plots.stability.damped": lambda: (METHODS_SHOWN[:3],),
    "plots.audit.draw": lambda: (audited(),),
    "plots.audit.changes": lambda: (audited(),),
    "plots.cost.draw": lambda: (cost_study(),),
    "plots.cost.draw_errors": lambda: (cost_study(),),
    "plots.cost.work_precision": lambda: (cost_study(),),
    "plots.growth.draw": lambda: (growth_study(),),
    "plots.growth.error_growth": lambda: (growth_study(),),
    "plots.hard_cases.draw": lambda: (matrix(),),
    "plots.section.draw": lambda: (attracted(),),
    "plots.section.poincare": lambda: (sectioned(),),
    "plots.section.bifurcation": lambda: (sectioned(over=True),),
    "plots.section.basins": lambda: (attracted(),),
    "plots.transfer.draw": lambda: (transferred(),),
}
"""Every figure function, and the arguments it is tested with."""
QUICK = ("plots.motion.phase", "plots.audit.changes")
"""Figure functions that are tested in every run; drawing one takes a fraction of a second."""
UNITLESS = (
    "λ", "lambda", "omega_0", "gamma h", "/ E$_0$", "/ the energy", "relative", "evaluations per", "after / before",
    "growth factor",
)
"""Texts in labels of axes that have no unit: ratios, counts, and steps in units of the problem's own time."""


def names(quick: Iterable[str] = QUICK) -> list[Any]:
    return [pytest.param(name, marks=[] if name in quick else pytest.mark.slow) for name in FUNCTIONS]


@cache
def drawn(name: str) -> Any:
    return FUNCTIONS[name](*FROM[name]())


def figure_of(made: Any) -> Figure:
    return made if isinstance(made, Figure) else made.figure


# --- one contract ---------------------------------------------------------------------------------------------------


def test_every_figure_function_is_here() -> None:
    assert set(FROM) == set(FUNCTIONS)
    assert {*PICTURED} <= set(FROM)


def test_no_module_uses_pyplot_and_none_that_draws_figures_shows() -> None:
    for path in sorted(ROOT.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        for node in ast.walk(ast.parse(text)) if "pyplot" in text or ".show" in text else ():
            called = node.func.attr if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) else ""
            imported = [node.module or "", *(alias.name for alias in node.names)] if isinstance(
                node, ast.ImportFrom) else [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            assert not any("pyplot" in name for name in imported), path
            assert called != "show" or "matplotlib" not in text, path


@pytest.mark.quick("plots.motion.phase")
@pytest.mark.parametrize("name", names())
def test_it_draws_into_what_it_is_given_and_returns_it_and_changes_no_setting(name: str) -> None:
    function, before = FUNCTIONS[name], matplotlib.rcParams.copy()
    whole = function.__annotations__["return"] == "Figure"
    keyword = "figure" if whole else "axes"
    assert inspect.signature(function).parameters[keyword].default is None
    assert isinstance(drawn(name), Figure if whole else Axes)
    given: Any = Figure() if whole else plots.figure()[1][0]
    assert function(*FROM[name](), **{keyword: given}) is given
    if whole:
        assert tuple(given.get_size_inches()) == tuple(drawn(name).get_size_inches())
        assert len(given.axes) == len(drawn(name).axes)
    assert matplotlib.rcParams.copy() == before


@pytest.mark.quick("plots.motion.phase")
@pytest.mark.parametrize("name", names())
def test_its_axes_say_what_they_show_and_in_which_unit(name: str) -> None:
    made = figure_of(drawn(name))
    shown = [axes for axes in made.axes if axes.axison]
    assert shown
    for axes in shown:
        for axis in (axes.xaxis, axes.yaxis):
            label, named = axis.get_label_text(), [text.get_text() for text in axis.get_ticklabels()]
            words = any(text[:1].isalpha() or text[:1] == "(" for text in named)
            shared = name == "plots.stability.damped" or (name, axis.axis_name) == ("plots.stability.oscillation", "x")
            empty = not len(axis.get_ticklocs()) or not any(text.strip() for text in named)
            assert label or words or shared or empty, (axes.get_title("left"), axis.axis_name)
            assert not label or "[" in label or any(known in label for known in UNITLESS), label


@pytest.mark.parametrize("name", names())
def test_curves_that_are_several_have_a_legend(name: str) -> None:
    made = figure_of(drawn(name))
    legends = [*made.legends, *(axes.get_legend() for axes in made.axes if axes.get_legend() is not None)]
    labels = {str(line.get_label()) for axes in made.axes for line in axes.lines}
    labels = {label for label in labels if not label.startswith("_")}
    alone = name in (  # their legends belong to a whole figure, or titles take their place
        "plots.cost.work_precision", "plots.growth.error_growth", "plots.motion.portraits")
    assert legends or alone or len(labels) < 2
    for legend in legends:
        texts = [text.get_text() for text in legend.get_texts()]
        assert len(set(texts)) == len(texts)


@pytest.mark.quick("plots.motion.phase")
@pytest.mark.parametrize("name", names())
def test_no_text_is_cut_off_or_lies_on_another(name: str) -> None:
    made = figure_of(drawn(name))
    texts = written(made)
    assert len(texts) > 5
    assert not cut_off(made, texts)
    assert not overlapping(texts)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "columns"), [
    ("plots.motion.angle", 1), *(pytest.param(name, 2, marks=pytest.mark.slow) for name in (
        "plots.motion.angle", "plots.motion.phase", "plots.energy.energy_error"))])
def test_titles_of_long_names_go_on_in_further_lines(name: str, columns: int) -> None:
    drawn = runs(LONG[:100], angle=-1.23456, velocity=-0.98765)
    made = blank((8.0 * columns, 4.5))
    places = made.subplots(1, columns, squeeze=False)[0]
    for axes in places:
        FUNCTIONS[name](drawn, axes=axes)
        title = axes.get_title("left")
        assert LONG[:100] in title.replace("\n", "")
        assert "\N{MINUS SIGN}70.74°, \N{MINUS SIGN}0.9877 rad/s" in title.replace("\n", " ")
        assert "dt = 0.05 s" in title
    texts = written(made)
    assert not cut_off(made, texts)
    assert not overlapping(texts)


@pytest.mark.slow
@pytest.mark.parametrize("count", [12, 40])
def test_growth_of_many_methods_has_room_for_their_names(count: int) -> None:
    made = FUNCTIONS["plots.growth.draw"](growth("vacuum", stored("methods")[:count], periods=1.0))
    texts = written(made)
    assert not cut_off(made, texts)
    assert not overlapping(texts)
    assert all(axes.bbox.height > 0.6 * made.bbox.height for axes in made.axes)


def test_lines_are_as_long_as_there_is_room() -> None:
    text = "one two · three four · five"
    assert titles.fitted(text, 12.0, 1e3) == text
    for room in (150.0, 80.0, 30.0):
        lines = titles.fitted(text, 12.0, room).split("\n")
        assert all(titles.width(line, 12.0) <= room for line in lines)
        assert "".join(lines).replace(" ", "").replace("·", "") == "onetwothreefourfive"
    assert titles.fitted(text, 12.0, titles.width("one two · three", 12.0)) == "one two\nthree four\nfive"
    assert titles.width("", 12.0) == 0.0


@pytest.mark.parametrize("name", names(QUICK[:1]))
def test_both_formats_keep_where_it_comes_from(name: str, tmp_path: Path) -> None:
    facts = provenance(scene=SCENES["lab"].to_dict(), method="rk4", dt=0.01)
    png, svg = plots.save_all(figure_of(drawn(name)), tmp_path / "a.b", facts)
    assert (png.name, svg.name) == ("a.b.png", "a.b.svg")
    with Image.open(png) as image:
        assert {key: image.info[key] for key in facts} == facts
    described = ElementTree.parse(svg).getroot().find(".//{http://purl.org/dc/elements/1.1/}description")
    assert described is not None
    assert json.loads(described.text or "") == facts


@pytest.mark.parametrize(("low", "high"), [(2e-5, 3e-5), (9e-5, 2e-4), (1e-5, 1.1e-5), (1e-6, 1e-3), (3e-7, 2e-6)])
def test_axes_of_work_have_two_powers_of_ten(low: float, high: float) -> None:
    """Axes with two powers of ten or more have powers of ten as tick labels, which have enough space."""
    first, last = decades(low, high)
    assert first <= low < high <= last
    assert np.floor(np.log10(last) + 1e-9) > np.ceil(np.log10(first) - 1e-9)


@pytest.mark.parametrize(("words", "stems"), [
    (["stress", "--cases", "upright for a moment", "--integrators", "rk4"], ["stress"]),
    (["cost", "--scene", "vacuum", "--integrators", "rk4", "--duration", "0.1", "--repeats", "1", "--growth", "1"],
     ["cost", "cost_errors", "growth"]),
    (["effects", "--scene", "vacuum", "--tolerance", "0.1", "--duration", "1"], ["effects"]),
    (["fit", "--effects", "linear"], ["fit"]),
])
@pytest.mark.slow
def test_commands_write_svg_where_they_are_asked_to(
    words: list[str], stems: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if words[0] == "fit":
        monkeypatch.setenv("LAB_PENDULUM_BACKEND", "compiled")  # a fit takes minutes interpreted
    for more in ([], ["--svg"]) if words[0] == "stress" else (["--svg"],):
        folder = tmp_path / f"out{len(more)}"
        done = CliRunner().invoke(cli.app, [*words, *more, "--out", str(folder)])
        assert done.exit_code == 0, done.exception
        endings = {".png", ".svg"} if more else {".png"}
        pictures = {path.name for path in folder.iterdir() if path.suffix in (".png", ".svg")}
        assert pictures == {f"{stem}{ending}" for stem in stems for ending in endings}


def test_svg_without_a_folder_is_refused() -> None:
    done = CliRunner().invoke(cli.app, ["effects", "--svg"])
    assert "--svg needs --out" in str(done.exception)


# --- pictures -------------------------------------------------------------------------------------------------------

PICTURED = ("plots.motion.angle", "plots.motion.phase", "plots.energy.energy_error", "plots.stability.regions",
            "plots.stability.damped", "plots.hard_cases.draw")
"""Figure functions whose pictures do not depend on the machine."""
GRAIN = 24
"""Number of cells along either side of a reference picture."""
CLOSE = 6.0
"""Largest change of a cell's mean brightness, of 255."""


def coarse(name: str) -> Any:
    """Return the mean brightness of GRAIN x GRAIN cells of a figure at 50 dots per inch."""
    file = io.BytesIO()
    figure_of(FUNCTIONS[name](*FROM[name]())).savefig(file, dpi=50)
    grey = Image.open(file).convert("L")
    return np.asarray(grey.resize((GRAIN, GRAIN), Image.Resampling.BOX))


@pytest.mark.parametrize("name", [PICTURED[0], *(pytest.param(name, marks=pytest.mark.slow) for name in PICTURED[1:])])
def test_it_looks_as_it_did(name: str) -> None:
    """Pictures agree up to CLOSE in the matplotlib version they were made with; other versions place letters
    differently."""
    kept = json.loads(PICTURES.read_text())
    if matplotlib.__version__.rpartition(".")[0] != kept["matplotlib"]:
        pytest.skip(f"the pictures are of matplotlib {kept['matplotlib']}")
    away = coarse(name).astype(float) - np.array(kept["pictures"][name])
    assert np.abs(away).max() <= CLOSE
