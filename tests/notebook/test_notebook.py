"""Tests of how results show themselves: a line in a console, HTML in a notebook, figures, films, progress bars."""

from __future__ import annotations

import html
import math
import re
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from html.parser import HTMLParser
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import gymnasium as gym
import numpy as np
import pytest
from matplotlib._pylab_helpers import Gcf
from matplotlib.figure import Figure
from normal_posterior import normal_posterior
from small_driven_fit import small_driven_fit
from small_study import Speeds

import integrators
from pendulum_env import (
    SCENES,
    Recording,
    SceneError,
    audit,
    basins,
    compare,
    cost,
    film,
    fit,
    growth,
    measure,
    notebook,
    rollout,
    section,
    simplify,
    stress,
    sweep,
    transfer,
)
from pendulum_env.auto.choice import Ranking, choose
from pendulum_env.cli import console
from pendulum_env.common import progress
from pendulum_env.common.results import Result, columns_of
from pendulum_env.common.texts import Table
from pendulum_env.lab import measure_amplitudes, measure_kater, measure_lengths
from pendulum_env.notebook import CARDS, FIGURES
from pendulum_env.physics.equation import equation_mathml
from pendulum_env.study.stability import stability

EVIL = "<script>alert(1)</script> & more"
"""A name that would run as a script if HTML were not escaped."""


@cache
def swing() -> Recording:
    time = np.linspace(0.0, 10.0, 201)
    return Recording(time, 0.2 * np.exp(-0.05 * time) * np.cos(5.0 * time), EVIL)


def environment() -> Any:
    made = gym.make("LabPendulum-v0", backend="python").unwrapped
    made.reset(seed=0, options={"angle": 0.25, "velocity": 0.0})
    return made


PUSHED: dict[str, Any] = {"max_episode_steps": 5, "backend": "python", "warn": False}
SHORT: Mapping[str, Any] = {"duration": 1.0, "backend": "python"}
RESULTS: Mapping[str, tuple[Callable[[], Any], str]] = {
    "Scene": (lambda: replace(SCENES["lab"], name=EVIL), "length 0.353 m"),
    "Method": (lambda: integrators.get("rk4"), "Kutta 1901"),
    "LabPendulumEnv": (environment, "0.25 rad (14.32°), 0 rad/s"),
    "LabPendulumVectorEnv": (lambda: gym.make_vec(
        "LabPendulum-v0", num_envs=3, vectorization_mode="vector_entry_point", backend="python",
        length=[0.3, 0.4, 0.5]), "0.3 to 0.5, one for each"),
    "Rollout": (lambda: rollout(replace(SCENES["vacuum"], name=EVIL), angle=1.0, **SHORT), "1 rad (57.3°), 0 rad/s"),
    "batch": (lambda: rollout("vacuum", angle=[0.5, 1.0], **SHORT), "2, arrays of shape (2, 101)"),
    "Comparison": (lambda: compare(replace(SCENES["vacuum"], name=EVIL), "rk4,heun", angle=1.0, duration=1.0), "heun"),
    "CostStudy": (lambda: cost(replace(SCENES["vacuum"], name=EVIL), ["rk4", "heun"], steps=[0.1, 0.05], repeats=1,
                               **SHORT), "cheapest method"),
    "Growth": (lambda: growth(replace(SCENES["vacuum"], name=EVIL), ["rk4"], periods=2.0, backend="python"), "rk4"),
    "Audit": (lambda: audit("lab", amplitude=0.3, tolerance=1e-2), "small_angle_gravity"),
    "Simplification": (lambda: simplify("lab", amplitude=0.3, tolerance=1e-2).report, "quadratic_drag"),
    "Simplified": (lambda: simplify("lab", amplitude=0.3, tolerance=1e-2), "quadratic_drag"),
    "Solution": (lambda: integrators.solve(lambda t, q, v: -q, 1.0, 0.0, [0.0, 1.0], rtol=1e-6, method="dop853"),
                 "from 0 to 1"),
    "Stability": (lambda: stability("rk4,pefrl"), "longest stable step"),
    "Ranking": (lambda: Ranking(choose(SCENES["vacuum"], 1e-3, 0.02, 10)), "relative cost"),
    "Matrix": (lambda: stress(["upright for a moment"], ["rk4"]), "upright for a moment"),
    "Sweep": (lambda: sweep({"angle": [k / 100.0 for k in range(1, 21)]}, run=lambda point: {"twice": EVIL}), EVIL),
    "StudyResult": (lambda: Speeds(number=2)(), "The largest of all"),
    "Section": (lambda: section(points=40, runs=2, transient=2, steps=20, backend="python"), "40, at whole periods"),
    "Basins": (lambda: basins(size=3, transient=2, steps=20, backend="python"), "attractor"),
    "LabSheet": (lambda: measure(swing()), "period at small amplitude"),
    "AmplitudeSheet": (lambda: measure_amplitudes("0:30, 1.42:29.4, 2.84:28.8"), "dry friction"),
    "LengthSheet": (lambda: measure_lengths(([0.3, 0.6, 0.9], [1.1, 1.56, 1.9])), "gravity, offset 0"),
    "KaterSheet": (lambda: measure_kater(([0.0, 0.1, 0.2], [2.0, 2.01, 2.02], [1.99, 2.01, 2.03]), 1.0), "T1 = T2"),
    "Fit": (lambda: fit(swing(), "linear", mass=0.1), "linear_drag.gamma"),
    "DrivenFit": (lambda: small_driven_fit(EVIL), "max_torque"),
    "Posterior": (lambda: normal_posterior(fit(swing(), "linear", mass=0.1)), "Priors"),
    "Transfer": (lambda: transfer(lambda seen: seen[:, 2:] * 0.0, PUSHED, {**PUSHED, "gravity": 5.0}, episodes=2),
                 "gravity"),
    "Recording": (swing, "201 points in 10 s"),
}
"""What is shown -> function that makes one, and a text that must stand in its HTML."""
QUICK = ("Scene", "Method", "LabPendulumEnv", "batch", "Sweep")


@cache
def made(name: str) -> Any:
    return RESULTS[name][0]()


class Page(HTMLParser):
    """Reads HTML: its text, its tags and attributes; elements that are not closed are an error."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.text, self.open, self.tags = "", [], []
        self.feed(text)
        self.close()
        assert not self.open, self.open

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in ("img", "br", "hr"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def names(quick: tuple[str, ...] = QUICK) -> list[Any]:
    return [pytest.param(name, marks=[] if name in quick else pytest.mark.slow) for name in RESULTS]


# --- every result -----------------------------------------------------------------------------------------------------


def test_every_card_is_tested() -> None:
    """Results of studies that have no card of their own have that of their base."""
    own = set(CARDS) - {"Filmed", "Result"}
    assert set(RESULTS) - {"Method", "Solution", "batch"} == own | {
        one.__name__ for one in Result.__subclasses__()
        if one.__module__.startswith("pendulum_env.") and not one.__subclasses__()}


@pytest.mark.parametrize("name", names())
def test_a_notebook_shows_it(name: str) -> None:
    result, text = made(name), RESULTS[name][1]
    page = Page(result._repr_html_())
    assert text in page.text
    assert "script" not in [tag for tag, _ in page.tags]
    pictures = [values["src"] for tag, values in page.tags if tag == "img"]
    assert len(pictures) == (type(result).__name__ in FIGURES and name != "batch")
    assert all(source.startswith("data:image/svg+xml;base64,") for source in pictures)
    assert any(tag in ("table", "p") for tag, _ in page.tags)


@pytest.mark.parametrize("name", [one for one in names() if one.values[0] not in ("Scene",)])
def test_a_console_shows_one_line(name: str) -> None:
    line = repr(made(name))
    assert "\n" not in line
    assert len(line) <= 80
    assert line.startswith(f"<{type(made(name)).__name__}: ")


def test_a_scenes_line_is_code_that_makes_it_again() -> None:
    assert "\n" not in repr(SCENES["driven"])
    assert repr(SCENES["driven"]).startswith("Scene(name='driven', ")


@pytest.mark.slow
@pytest.mark.parametrize(("name", "kind", "label"), [
    ("Rollout", None, "angle [degrees]"), ("Rollout", "velocity", "velocity [rad/s]"), ("Rollout", "energy", "energy"),
    ("Comparison", None, "angle [degrees]"), ("Comparison", "energy", "energy"),
])
def test_plot_draws_what_it_is_asked_for_and_pyplot_does_not_know_it(name: str, kind: str | None, label: str) -> None:
    drawn = made(name).plot(kind)
    assert isinstance(drawn, Figure)
    assert drawn.axes[0].get_ylabel().startswith(label)
    assert not Gcf.figs
    assert Page(drawn._repr_html_()).tags[0][0] == "img"


def test_plot_names_the_kinds_that_there_are() -> None:
    run = rollout("vacuum", angle=1.0, **SHORT)
    with pytest.raises(SceneError, match=r"no figure of a Rollout called 'fase'; did you mean phase\?"):
        run.plot("fase")
    with pytest.raises(SceneError, match="a single run, not a batch of 2 runs"):
        made("batch").plot()


@pytest.mark.slow
def test_a_large_figure_is_shown_as_png(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pendulum_env.plots.style.HEAVY", 1000)
    shown = rollout("vacuum", angle=1.0, **SHORT).plot()._repr_html_()
    assert 'src="data:image/png;base64,iVBORw0KGgo' in shown  # the eight bytes that begin every PNG


def test_a_long_table_says_how_much_of_it_is_shown() -> None:
    page = Page(made("Sweep")._repr_html_())
    assert [tag for tag, _ in page.tags].count("tr") == 13
    assert "The first 12 of 20 rows; all are in .rows." in page.text


def test_a_new_study_has_a_table_a_card_and_a_command_without_an_entry(capsys: pytest.CaptureFixture[str]) -> None:
    """Its results need their tables only; a figure would be an entry of FIGURES."""
    class Speeds(Result):
        times = 1

        def origin(self) -> Mapping[str, str]:
            return {"Software": "mine"}

        def tables(self) -> Mapping[str, Any]:
            return {"speeds": columns_of({"angle_rad": "rad", "speed": "m/s", "note": ""},
                                         [(0.5, 1.23456789, EVIL), (1.0, math.nan, None), (2.0, 3, "")] * self.times)}

    found = Speeds()
    assert found.table == Table(("angle_rad [rad]", "speed [m/s]", "note"),
                                (("0.5", "1.235", EVIL), ("1", "-", "-"), ("2", "3", "-")))
    assert not found.pictures()
    with pytest.raises(SceneError, match="There is no figure of a Speeds; its numbers are in its table"):
        found.plot()
    page = Page(found._repr_html_())
    assert "1.235" in page.text
    assert "script" not in [tag for tag, _ in page.tags]
    found.times = 7
    assert "The first 12 of 21 rows; all are in .table." in Page(found._repr_html_()).text
    console.print_result(found, [])
    assert "1.235" in capsys.readouterr().out


# --- equations and methods --------------------------------------------------------------------------------------------


def written(equation: str) -> list[str]:
    """Return the rows of an equation in MathML as text, powers with ^ and fractions' parts in order."""
    tree = ElementTree.fromstring(html.unescape(equation_mathml(equation)))
    for power in tree.iter("msup"):
        power[0].tail = "^"
    plain = {"\N{NO-BREAK SPACE}": "", "\N{MINUS SIGN}": "-", "\N{PRIME}": "'", "\N{DOUBLE PRIME}": "''",
             "\N{MULTIPLICATION SIGN}": "x"}
    return ["".join(plain.get(letter, letter) for letter in "".join(row.itertext())) for row in tree.iter("mtr")]


@pytest.mark.parametrize(("scene", "rows"), [
    ("exercise_large", ["θ''=-27.762sin(θ)-0.02θ'"]),
    ("clock_bob", ["θ''=-9.87044sin(θ)-5.80016x10⁻⁵θ'"]),
    ("driven", ["θ''=-27.7904sin(θ)-0.100314θ'-0.000879082speedslip+0.354108cos(5t)cos(θ)", "slip=θ'-ucos(θ)",
                "speed^2=slip^2+(usin(θ))^2", "u=0.0708215sin(5t)"]),
])
def test_equations_are_mathml(scene: str, rows: list[str]) -> None:
    assert written(SCENES[scene].equation()) == rows


def test_the_equation_of_every_scene_is_mathml() -> None:
    assert [name for name, scene in SCENES.items() if not written(scene.equation())[0].startswith("θ''=")] == []


def test_a_small_tableau_is_shown() -> None:
    page = Page(integrators.get("heun")._repr_html_())
    assert "ca1a20" in page.text.replace(" ", "")
    assert page.text.replace(" ", "").endswith("11b1/21/2")
    assert "a1" not in Page(integrators.get("dop853")._repr_html_()).text


def test_fingerprints_tell_methods_of_one_name_apart() -> None:
    rk4 = integrators.get("rk4")
    other = replace(rk4, b=("1/8", "3/8", "3/8", "1/8"), dense=None)  # type: ignore[call-arg]
    assert repr(other) == repr(rk4)
    assert other.fingerprint != rk4.fingerprint == replace(rk4).fingerprint


# --- films ------------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_film_has_a_player_and_a_large_one_a_link(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    options = {"duration": 0.2, "size": 64, "backend": "python"}
    made = film("vacuum", tmp_path / "a b.mp4", **options)
    path, stopped = made
    assert (path, stopped) == (tmp_path / "a b.mp4", {})
    tags = Page(made._repr_html_()).tags
    (player,) = [values for tag, values in tags if tag == "video"]
    assert player["src"].startswith("data:video/mp4;base64,")
    assert "controls" in player
    gif = film("vacuum", tmp_path / "b.gif", fps=25, **options)
    assert any(tag == "img" and values["src"].startswith("data:image/gif;base64,R0lG")
               for tag, values in Page(gif._repr_html_()).tags)
    monkeypatch.setattr(notebook, "LARGEST", 100)
    (link,) = [values for tag, values in Page(made._repr_html_()).tags if tag == "a"]
    assert link["href"] == (tmp_path / "a b.mp4").as_posix()
    path.unlink()
    assert "no longer there" in made._repr_html_()


# --- progress ---------------------------------------------------------------------------------------------------------


class Outputs:
    """Stands for IPython.display: keeps what the last output shows."""

    def __init__(self) -> None:
        self.shown: list[str] = []

    def html(self, text: str) -> str:
        return text

    HTML = html

    def display(self, text: str, display_id: bool) -> SimpleNamespace:
        assert display_id
        self.shown.append(text)
        return SimpleNamespace(update=self.shown.append)


@pytest.fixture
def outputs(monkeypatch: pytest.MonkeyPatch) -> Outputs:
    kept = Outputs()
    monkeypatch.setattr(progress, "in_notebook", lambda: True)
    monkeypatch.setitem(sys.modules, "IPython.display", kept)  # type: ignore[arg-type]
    monkeypatch.setattr(progress, "OFTEN", 0.0)
    monkeypatch.setattr(progress, "_LINES", {})
    return kept


def test_a_long_study_shows_a_bar_in_a_notebook_and_leaves_a_line(
    outputs: Outputs, monkeypatch: pytest.MonkeyPatch
) -> None:
    sweep({"a": [1, 2]}, run=lambda point: {})
    assert not outputs.shown  # it took less than 1.5 s
    monkeypatch.setattr(progress, "LATE", 0.0)
    sweep({"a": [1, 2]}, run=lambda point: {}, progress=False)
    assert not outputs.shown
    sweep({"a": [1, 2]}, run=lambda point: {})
    assert any('<progress value="0.5' in text for text in outputs.shown)
    assert re.fullmatch(r"<small>sweep took \d\.\d s</small>", outputs.shown[-1])


def test_the_line_counts_the_time_before_the_bar(outputs: Outputs) -> None:
    with progress.progress_bar("work", time.monotonic() - 60.0):
        pass
    assert outputs.shown[-1].startswith("<small>work took 60.")


def test_bars_of_one_title_share_the_line_of_their_cell(outputs: Outputs, monkeypatch: pytest.MonkeyPatch) -> None:
    def work(title: str, seconds: float) -> None:
        with progress.progress_bar(title, time.monotonic() - seconds):
            pass

    shell = SimpleNamespace(execution_count=3, kernel=True)
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
    displayed: list[str] = []
    monkeypatch.setattr(outputs, "display", lambda text, display_id: (
        displayed.append(text), SimpleNamespace(update=outputs.shown.append))[1])
    for title, seconds in (("8 runs", 20.0), ("8 runs", 40.0), ("8 runs", 60.0), ("a study", 5.0), ("8 runs", 7.0)):
        work(title, seconds)
    shell.execution_count = 4
    work("8 runs", 8.0)
    ended = [re.sub("<.*?>", "", text) for text in outputs.shown if "progress" not in text]
    assert ended == ["8 runs took 20.0 s", "8 runs took 40.0 s, the last of 2, which took 60.0 s",
                     "8 runs took 60.0 s, the last of 3, which took 120.0 s", "a study took 5.0 s",
                     "8 runs took 7.0 s", "8 runs took 8.0 s"]
    assert len(displayed) == 4


@pytest.mark.parametrize("study", [
    pytest.param(lambda **more: compare("vacuum", "rk4", angle=1.0, duration=1.0, **more), marks=pytest.mark.slow),
    lambda **more: growth("vacuum", ["rk4"], periods=2.0, backend="python", **more),
])
def test_studies_name_their_bar(study: Callable[..., Any], outputs: Outputs, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "LATE", 0.0)
    study()
    assert re.match("<small>(compare|growth) took", outputs.shown[-1])
    outputs.shown.clear()
    study(progress=False)
    assert not outputs.shown


def test_an_interrupted_study_says_so(outputs: Outputs) -> None:
    def work() -> None:
        with progress.progress_bar("work <b>") as tell:
            tell(0.5, EVIL)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        work()
    assert outputs.shown[-1].startswith("<small>work &lt;b&gt; stopped after 0.")
    assert not any("<script" in text for text in outputs.shown)


def test_a_console_shows_no_bar_unless_asked(capfd: pytest.CaptureFixture[str]) -> None:
    assert not progress.in_notebook()
    sweep({"a": [1, 2]}, run=lambda point: {})
    assert capfd.readouterr() == ("", "")


@pytest.mark.slow
def test_showing_nothing_loads_nothing() -> None:
    code = ("import sys, pendulum_env; repr(pendulum_env.SCENES['lab']); pendulum_env.SCENES['lab']._repr_html_();"
            "print([m for m in ('matplotlib', 'IPython', 'jinja2', 'moviepy', 'tqdm') if m in sys.modules])")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
