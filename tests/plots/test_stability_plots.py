"""Test that figures of methods show the computed analysis, for one method or all, and that files state their origin."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import numpy as np
import pytest
from figure_texts import left_title
from matplotlib.colors import to_hex
from matplotlib.contour import QuadContourSet
from matplotlib.figure import Figure
from PIL import Image
from stored import stored
from typer.testing import CliRunner

from integrators import METHODS, MethodError
from integrators.analysis import oscillation_errors, spectral_radii, stability_limit
from pendulum_env import cli, plots
from pendulum_env.plots import stability as figures
from pendulum_env.plots.style import looks_of
from pendulum_env.study import stability as study

SHEET = [METHODS[name] for name in ("forward_euler", "backward_euler", "symplectic_euler", "velocity_verlet", "rk4")]
RK = [SHEET[0], SHEET[1], SHEET[4]]


def texts(figure: Figure) -> list[str]:
    """Return the entries of the legend below a figure."""
    (legend,) = figure.legends
    return [text.get_text() for text in legend.get_texts()]


def overlaps(figure: Figure) -> list[tuple[str, str]]:
    """Return pairs of titles, labels and legends that overlap."""
    figure.canvas.draw()
    renderer = figure.canvas.get_renderer()
    boxes = {f"legend {i}": text.get_window_extent(renderer) for legend in figure.legends
             for i, text in enumerate([legend.get_title(), *legend.get_texts()]) if text.get_text()}
    for i, axes in enumerate(figure.axes):
        for part in (axes.xaxis.label, axes.yaxis.label, left_title(axes)):
            if axes.axison and part.get_text():
                boxes[f"{i} {part.get_text()}"] = part.get_window_extent(renderer)
    names = list(boxes)
    return [(a, b) for i, a in enumerate(names) for b in names[i + 1:] if boxes[a].overlaps(boxes[b])]


@pytest.mark.slow
def test_regions_are_where_the_factor_is_at_most_one() -> None:
    made = figures.regions(RK)
    assert [axes.get_title("left") for axes in made.axes] == [
        "explicit: stable where shaded", "explicit, per force evaluation", "implicit: stable where shaded"]
    curves = [child for axes in made.axes for child in axes.get_children()
              if isinstance(child, QuadContourSet) and not child.filled]
    reach = [(path.vertices[:, 0].min(), path.vertices[:, 0].max(), path.vertices[:, 1].max())
             for path in (curve.get_paths()[0] for curve in curves)]
    expected = [(-2, 0, 1), (-2.785294, None, None), (-2, 0, 1), (-2.785294 / 4, None, None), (0, 2, 1)]
    for found, wanted in zip(reach, expected, strict=True):
        assert all(y is None or x == pytest.approx(y, abs=0.02) for x, y in zip(found, wanted, strict=True))
    for axes in made.axes:
        assert axes.get_aspect() == 1.0
        assert r"\lambda h" in axes.get_xlabel()
    assert texts(made) == ["forward_euler (order 1, 1 force)", "backward_euler (order 1, 1 force)",
                           "rk4 (order 4, 4 forces)"]
    assert not overlaps(made)
    with pytest.raises(MethodError, match="symplectic_euler: only Runge-Kutta tables have a stability function"):
        figures.regions(SHEET)


@pytest.mark.slow
def test_curves_of_oscillation_are_the_analysis_and_end_at_the_limit() -> None:
    made = figures.oscillation(SHEET)
    grown, grown_size, turned, turned_size = made.axes
    tones = plots.colours([method.name for method in SHEET])
    for method in SHEET:
        limit = stability_limit(method)
        look = looks_of({one.name: one.name for one in SHEET})[method.name]
        for axes, part in ((turned, 1), (turned_size, 1)):
            (line,) = [x for x in axes.lines if to_hex(x.get_color()).upper() == tones[method.name]
                       and x.get_linewidth() == look.width and x.get_marker() != "x"]
            x, y = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
            kept = np.isfinite(y)
            found = oscillation_errors(method, x[kept])[part]
            np.testing.assert_allclose(y[kept], found if axes is turned else np.abs(found), rtol=1e-12)
            assert x[kept].max() == (limit if 0.0 < limit < math.inf else x.max())
        crosses = [x for x in grown.lines if x.get_marker() == "x"
                   and to_hex(x.get_color()).upper() == tones[method.name]]
        assert [tuple(cross.get_xydata()[0]) for cross in crosses] == (
            [(limit, pytest.approx(1.0, abs=1e-9))] if 0.0 < limit < math.inf else [])
    assert grown_size.get_yscale() == turned_size.get_xscale() == "log"
    assert texts(made)[:2] == ["forward_euler (grows at any step)", "backward_euler (no limit)"]
    assert r"\leq 2.828" in texts(made)[-1]
    assert not overlaps(made)


@pytest.mark.slow
def test_the_exact_method_has_one_map() -> None:
    """The map of the exact motion is its own, and no second one."""
    drawn = figures.damped([METHODS["rk4"], METHODS["exact"]])
    assert [axes.get_title("left") for axes in drawn.axes if axes.get_title("left")] == ["exact", "rk4"]


@pytest.mark.slow
def test_maps_are_the_growth_and_mark_where_it_is_unstable() -> None:
    made = figures.damped(SHEET)
    names = [axes.get_title("left") for axes in made.axes if axes.get_title("left")]
    assert names == ["exact", *(method.name for method in SHEET)]
    for axes, method in zip(made.axes[1:], SHEET, strict=False):
        (image,) = [child for child in axes.get_children() if type(child).__name__ == "QuadMesh"]
        corner = image.get_coordinates()
        radii = spectral_radii(method, corner[..., 0], corner[..., 1])
        shown = np.ma.masked_invalid(image.get_array().reshape(radii.shape))
        stable = radii <= figures.STABLE
        assert np.array_equal(~np.ma.getmaskarray(shown), stable)
        np.testing.assert_allclose(shown.compressed(), radii[stable])
    exact = figures.exact_growth(np.array([1.0, 1.0]), np.array([0.4, 2.5]))
    assert exact == pytest.approx([math.exp(-0.2), math.exp(-0.5)])
    assert not overlaps(made)


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 2, 12, 23])
def test_any_number_of_methods(count: int) -> None:
    names = [METHODS[name] for name in stored("methods")]
    tables = [method for method in names if method.family == "Runge-Kutta"][:count]
    dragged = [method for method in names if "velocity_free" not in method.needs][:count]
    for draw, methods in ((figures.regions, tables), (figures.oscillation, names[:count]), (figures.damped, dragged)):
        made = draw(methods)
        assert not overlaps(made)
        assert made.get_figheight() < 25.0


def test_many_methods_are_several_figures() -> None:
    found = study.stability(METHODS.values())
    names = list(found.pictures())
    assert len(names) == len(set(names))
    assert {name.split("_")[0] for name in names} == {"regions", "oscillation", "damping"}
    parts = study.split_evenly(list(METHODS.values()), 12)
    assert [method for part in parts for method in part] == list(METHODS.values())
    assert max(map(len, parts)) <= 12
    assert study.split_evenly([], 12) == []


def test_the_table_says_limits_and_what_is_left_out() -> None:
    assert [m.name for m in study.stability("rk4,pefrl,discrete_gradient").drawable] == ["rk4", "discrete_gradient"]
    found = study.stability("rk4, okunbor_skeel6,gauss4")
    assert found.rows[0][:5] == ["rk4", 4, 4, pytest.approx(8**0.5), pytest.approx(8**0.5 / 4)]
    assert found.table.rows[1][5:7] == ("-", "-")
    assert found.table.rows[2][3:5] == ("any", "-")
    assert "Not in the maps of damping, because they cannot integrate drag: okunbor_skeel6." in found.text
    assert "because they have no stability function: okunbor_skeel6." in found.text
    for bad, said in (("rk5", "did you mean"), ("rk4,rk4", "named twice"), ([], "At least one")):
        with pytest.raises(MethodError, match=said):
            study.stability(bad)


@pytest.mark.slow
@pytest.mark.parametrize("whole", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_the_command_writes_figures_and_a_table_with_their_origin(
    whole: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Quick tests draw only one of the three figures, because drawing takes seconds."""
    if not whole:
        monkeypatch.setattr(study.Stability, "pictures", lambda found: {"oscillation": "oscillation"})
    done = CliRunner().invoke(
        cli.app, ["compare", "--stability", "-i", "rk4", "-i", "velocity_verlet", "--out", str(tmp_path / "s")])
    assert done.exit_code == 0, done.exception
    written = {path.name for path in (tmp_path / "s").iterdir()}
    names = ("regions", "oscillation", "damping") if whole else ("oscillation",)
    assert written == {"stability.csv", *(f"{name}.{ending}" for name in names for ending in ("png", "svg"))}
    assert "velocity_verlet" in done.stdout
    with Image.open(tmp_path / "s" / "oscillation.png") as image:
        assert json.loads(image.info["integrators"]) == ["rk4", "velocity_verlet"]
        assert image.info["Software"].startswith("lab-pendulum ")
    lines = (tmp_path / "s" / "stability.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0].startswith("# Software: lab-pendulum")
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    assert float(rows[0]["omega0_h_limit"]) == pytest.approx(8**0.5)
    assert float(rows[1]["gamma_h_limit"]) == math.inf


@pytest.mark.parametrize(("words", "said"), [
    (["--dt", "0.1"], "leave out --dt"), (["--set", "length=1"], "leave out --set"), (["--rtol", "1e-6"], "--rtol"),
    (["--no-film"], "--no-film"), (["--scene", "lab"], "leave out --scene"), (["-i", "rk5"], "did you mean"),
])
def test_options_of_a_scene_are_refused(words: list[str], said: str, tmp_path: Path) -> None:
    done = CliRunner().invoke(cli.app, ["compare", "--stability", *words, "--out", str(tmp_path / "s")])
    assert done.exit_code == 1
    assert said in str(done.exception)
    assert not (tmp_path / "s").exists()
