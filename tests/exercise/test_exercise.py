"""Tests of the lab exercise's report: its numbers beside a script of their own, the key, bad input, the page."""

from __future__ import annotations

import html
import math
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from command_line import Here
from folder_contents import contents
from in_browser import opened
from scipy.integrate import solve_ivp

from pendulum_env.common.mathml import NotationError, mathml
from pendulum_env.exercise import figures, report
from pendulum_env.exercise.answers import Answers, earlier
from pendulum_env.exercise.figures import FIGURES
from pendulum_env.exercise.given import Given
from pendulum_env.exercise.language import language_of
from pendulum_env.exercise.values import values, with_error
from pendulum_env.exercise.worked import Worked, work_out
from pendulum_env.lab import Recording, measure
from pendulum_env.lab.recording import Filmed
from pendulum_env.plots.style import laid_out

pytest.importorskip("jinja2")


@pytest.fixture(scope="module")
def worked() -> Worked:
    return work_out(Given.of())


def test_sizes_in_other_units_are_asked_about() -> None:
    with pytest.warns(UserWarning, match=r"40 kg is unusual for a pendulum; 40 g would be mass=0\.04"):
        Given.of(mass=40.0)


def test_a_value_has_the_decimals_of_its_error(worked: Worked) -> None:
    assert with_error(57.74, 0.0039, "°") == "57.7400° ± 0.0039°"
    assert with_error(57.74, 0.39, "°") == "57.74° ± 0.39°"
    found = re.findall(r"(\d+\.\d+)° ± (\d+\.\d+)°", rendered(worked, True))
    assert len(found) == len(worked.recorded.readings.time)
    assert all(len(value.split(".")[1]) == len(error.split(".")[1]) for value, error in found)


@pytest.mark.quick("envelope")
@pytest.mark.parametrize("name", ["periods", "envelope"])
def test_legends_are_in_their_figure(worked: Worked, name: str) -> None:
    """Also with labels of twice the length, as another language may have; the slow test looks at all figures."""
    draw = next(one for one in FIGURES if one.__name__ == name)
    for times in (1, 2):
        figure = draw(worked, {key: text * times for key, text in LABELS.items()})
        figure.draw_without_rendering()
        box = figure.axes[0].get_legend().get_window_extent()
        assert 0.0 <= box.x0 < box.x1 <= figure.bbox.width
        assert box.y1 <= figure.bbox.height


@pytest.mark.slow
def test_all_legends_are_in_their_figures(worked: Worked) -> None:
    for draw in FIGURES:
        figure = draw(worked, LABELS)
        figure.draw_without_rendering()
        for legend in (*figure.legends, *(at.get_legend() for at in figure.axes)):
            box = None if legend is None else legend.get_window_extent()
            assert box is None or (box.x0 >= 0.0 and box.x1 <= figure.bbox.width and box.y1 <= figure.bbox.height)


@pytest.mark.slow
def test_a_page_may_end_between_the_rows_of_a_figure(worked: Worked) -> None:
    strips = figures.large_strips(worked, LABELS)
    with laid_out(strips):
        places, height = figures.cuts(strips), strips.bbox.height
        assert len(places) == len(strips.axes) - 1
        for place, upper, lower in zip(places, strips.axes, strips.axes[1:], strict=False):
            assert upper.get_tightbbox().y0 >= (1.0 - place) * height >= lower.get_tightbbox().y1  # type: ignore[union-attr]
    assert figures.cuts(figures.periods(worked, LABELS)) == [], "its rows share the axis of amplitudes"
    svg = '<svg width="9" viewBox="0 0 100 60" version="1.1"><g id="a"><path clip-path="url(#a)"/></g></svg>'
    page = str(report.inlined(svg, "n", "Figure 1", [0.25, 0.5]))
    assert re.findall('viewBox="([^"]*)"', page) == ["0 0.0 100.0 15.0", "0 15.0 100.0 15.0", "0 30.0 100.0 30.0"]
    assert page.count('<use href="#n-drawing"/>') == 2
    assert page.count('aria-label="Figure 1"') == page.count('id="n-drawing"') == page.count("url(#n-a)") == 1
    assert "<use" not in report.inlined(svg, "n", "Figure 1")


def by_hand() -> dict[str, list[float]]:
    """The exercise's loops, written out: energies over the first one, 10 s in steps of 0.01 s from 5 degrees."""
    square, dt, angle = 9.8 / 0.353, 0.01, math.radians(5.0)
    energies = {}
    for name in ("forward_euler", "backward_euler", "symplectic_euler"):
        theta, omega, found = angle, 0.0, [1.0]
        for _ in range(1000):
            if name == "forward_euler":
                theta, omega = theta + dt * omega, omega - dt * square * theta
            elif name == "backward_euler":
                shrink = 1.0 + square * dt * dt
                theta, omega = (theta + dt * omega) / shrink, (omega - dt * square * theta) / shrink
            else:
                omega -= dt * square * theta
                theta += dt * omega
            found.append((omega**2 + square * theta**2) / (square * angle**2))
        energies[name] = found
    return energies


def test_energies_are_those_of_the_loops_written_out(worked: Worked) -> None:
    assert worked.given.omega.period.value == pytest.approx(1.1925, abs=5e-5)
    truth = by_hand()
    for name, run in worked.small.runs.items():
        assert run.energy == pytest.approx(truth[name], rel=1e-9)
    ratios = {name: run.ratio for name, run in worked.small.runs.items()}
    assert ratios["forward_euler"] == pytest.approx(16.0, abs=0.05)
    assert ratios["backward_euler"] == pytest.approx(0.0625, abs=5e-5)
    assert ratios["symplectic_euler"] == pytest.approx(1.0267, abs=5e-5)


def test_the_dashed_energy_shows_that_friction_takes_nothing_at_the_turning_points(worked: Worked) -> None:
    """It falls all the time, and at the turning points slowly; the energy with the usual step does neither."""
    fine, usual = ((run, -np.diff(run.energy)) for run in (worked.recorded.fine, worked.recorded.damped))
    for (run, loss), falls in ((fine, True), (usual, False)):
        speed = np.abs(run.velocity[1:]) / np.max(np.abs(run.velocity))
        assert (float(loss.min()) >= 0.0) is falls
        assert bool(0.0 < loss[speed < 0.2].mean() < 0.25 * loss[speed > 0.8].mean()) is falls
    within = worked.small.runs["symplectic_euler"].energy
    assert 0.974 < within.min() < within.max() < 1.0271


def test_errors_periods_and_reynolds_numbers_are_those_of_formulas(worked: Worked) -> None:
    from scipy.special import ellipk

    for one in worked.small.one_step:
        assert one.error > 0.0  # computed minus exact: forward Euler's orbit grows
        assert one.error / one.leading == pytest.approx(1.0, abs=3e-4)
    for one_period in worked.large.periods:
        true = 4.0 * ellipk(math.sin(0.5 * one_period.amplitude) ** 2) / worked.large.omega
        assert one_period.measured == pytest.approx(true, rel=1.3e-4)
    first, second = (flow.reynolds for flow in worked.recorded.flows[:2])
    assert (first, second) == (pytest.approx(1370.0, rel=0.01), pytest.approx(230.0, rel=0.01))


def recorded_swing(rng: np.random.Generator, sign: float) -> tuple[Recording, float]:
    """A swing of ``theta'' = -Omega² sin(theta) - gamma theta'`` integrated by SciPy, with a sensor's noise; Omega."""
    omega, gamma, angle = rng.uniform(4.0, 7.0), rng.uniform(0.01, 0.12), math.radians(rng.uniform(8.0, 60.0))
    time = np.arange(0.0, 30.0, 1.0 / rng.uniform(25.0, 100.0))
    run = solve_ivp(lambda _t, y: [y[1], -omega * omega * math.sin(y[0]) - gamma * y[1]], (0.0, 30.0),
                    [sign * angle, 0.0], t_eval=time, method="DOP853", rtol=1e-9, atol=1e-10)
    noise = math.radians(10.0 ** rng.uniform(-1.3, -0.3))
    return Recording(time, run.y[0] + noise * rng.standard_normal(len(time)), "simulated by SciPy"), omega


@pytest.mark.slow
@pytest.mark.parametrize(("number", "low", "high"), [(4, 0.3, 1.7), (100, 0.86, 1.14)])
def test_omega_of_a_recording_is_right_within_its_error(number: int, low: float, high: float) -> None:
    """Released to either side in turn. The error is neither too small nor too large; and ``measure`` quotes the same
    period.
    """
    rng, pulls = np.random.default_rng(7), []
    for k in range(number):
        swing, omega = recorded_swing(rng, (-1.0) ** k)
        given = Given.of(recording=swing)
        pulls.append((given.omega.value.value - omega) / given.omega.value.error)
    assert low < math.sqrt(np.mean(np.square(pulls))) < high
    assert abs(np.mean(pulls)) < 4.0 / math.sqrt(number)
    assert np.abs(pulls).max() < 4.0
    assert measure(swing, n=6).small_period == given.omega.period


@pytest.mark.slow
def test_the_report_says_how_a_recording_was_filmed() -> None:
    swing, _ = recorded_swing(np.random.default_rng(3), 1.0)
    filmed = Filmed(frames=400, readings=377, rate=29.97, streak=6.4, off=0.31, roll=math.radians(-2.25))
    film = replace(swing, error=np.full(len(swing.time), math.radians(0.012)), filmed=filmed)
    pages = [" ".join(html.unescape(rendered(work_out(Given.of(recording=one)), False)).split())
             for one in (film, swing)]
    for said in ("found in 377 of 400 frames (94.2 %), 30.0 each second", "error of 0.012°", "turned by 2.25°",
                 "to 0.31 pixels", "a streak of up to 6.4 pixels"):
        assert said in pages[0]
    assert "is a film" not in pages[1]


@pytest.mark.parametrize("degrees", [30.0, -30.0])
def test_omega_is_right_from_both_sides_without_noise(degrees: float) -> None:
    """Both halves of a swing are taken with their own amplitude: the period over pairs of other ones is 7e-4 off."""
    time = np.arange(0.0, 20.0, 0.01)
    run = solve_ivp(lambda _t, y: [y[1], -5.269**2 * math.sin(y[0]) - 0.1 * y[1]], (0.0, 20.0),
                    [math.radians(degrees), 0.0], t_eval=time, method="DOP853", rtol=1e-10, atol=1e-12)
    assert Given.of(recording=Recording(time, run.y[0], "exact")).omega.value.value == pytest.approx(5.269, rel=3e-5)


def test_wrong_amplitudes_count_in_the_error_of_omega() -> None:
    """Amplitudes that are read 5 % too small leave the period at small amplitude too large, most of all in the first
    oscillations; the drift over the run shows it, and the error covers it."""
    rng, scale = np.random.default_rng(3), 0.95
    swing, omega = recorded_swing(rng, 1.0)
    while np.max(np.abs(swing.angle)) < 0.7:
        swing, omega = recorded_swing(rng, 1.0)
    good, wrong = (Given.of(recording=Recording(swing.time, size * swing.angle, "x")).omega.value
                   for size in (1.0, scale))
    assert abs(good.value - omega) < 3.0 * good.error
    assert abs(wrong.value - omega) > 5.0 * good.error
    assert abs(wrong.value - omega) < 2.0 * wrong.error


MINE = """
def step(theta, omega, dt, acceleration):
    middle = theta + 0.5*dt*omega
    omega = omega + dt*acceleration(middle, omega)
    return middle + 0.5*dt*omega, omega
"""
"""A student's step: half a step of the angle, one of the velocity, half a step of the angle."""


@pytest.mark.slow
def test_an_own_step_runs_beside_the_three_methods() -> None:
    worked = work_out(Given.of(), step=MINE)
    square, dt = 9.8 / 0.353, 0.01
    runs = ((worked.small.runs["own_step"], 5.0, 1000, lambda x: x, lambda x: 0.5 * x * x),
            (worked.large.own, 30.0, 12000, math.sin, lambda x: 1.0 - math.cos(x)))
    for run, degrees, steps, slope, height in runs:
        theta, omega = math.radians(degrees), 0.0
        start, ratios = square * height(theta), [1.0]
        for _ in range(steps):
            theta += 0.5 * dt * omega
            omega -= dt * square * slope(theta)
            theta += 0.5 * dt * omega
            ratios.append((0.5 * omega * omega + square * height(theta)) / start)
        assert run is not None
        assert run.energy == pytest.approx(ratios, rel=1e-8)
    page = " ".join(rendered(worked, False).split())
    assert "Your step equals no method of the package." in page
    assert "divided by 4.00: its observed order is 2.00" in page
    assert page.count("your step") >= 3
    assert [row.quantity for row in values(worked)].count("largest energy over its start, own_step") == 2


@pytest.mark.slow
def test_an_own_step_is_named_by_what_it_does() -> None:
    worked = work_out(Given.of(), step="theta, omega = theta + dt*omega, omega + dt*acceleration(theta, omega)")
    assert "Your step gives the same numbers as the method <code>forward_euler</code>" in rendered(worked, False)
    assert worked.small.runs["own_step"].ratio == pytest.approx(worked.small.forward.ratio, rel=1e-12)


LABELS = language_of("en").figures
DRAWINGS = {draw.__name__: report.Drawing(i + 1, "") for i, draw in enumerate(FIGURES)}
"""The figures of a page, without what they draw."""
FACTS = {"Software": "x", "Sources": "s", "Python": "y", "Command": "z"}


def rendered(worked: Worked, key: bool, name: str = "") -> str:
    """The page without its figures."""
    return report.page(worked, DRAWINGS, name, key, FACTS)


def sentences(page: str) -> Iterator[str]:
    for answer in re.findall(r'<div class="key">(.*?)</div>\s*</div>', page, flags=re.S):
        for part in re.findall(r"<p>(.*?)</p>|<math display=\"block\">(.*?)</math>", answer, flags=re.S):
            yield " ".join("".join(part).split())


def test_no_answer_stands_in_the_page_without_the_key(worked: Worked) -> None:
    assert "your step" not in rendered(worked, True)
    filled, blank = rendered(worked, True), " ".join(rendered(worked, False).split())
    answers = [text for text in sentences(filled) if len(text) > 40 and not text.startswith("<span")]
    assert len(answers) > 20
    assert [text for text in answers if text in blank] == []
    questions = filled.count('class="asked"')
    assert filled.count('class="key"') == questions == blank.count('class="blank"')
    assert 'class="key"' not in blank
    assert "gradient(" not in blank  # printed as bars of any height
    boxes = [int(height) // 8 for height in re.findall(r'min-height: (\d+)mm', blank)]
    assert blank.count("<i></i>") == sum(boxes) >= 4 * questions


@pytest.mark.slow
def test_the_page_says_that_the_recording_is_simulated_and_needs_nothing_else(worked: Worked) -> None:
    for key in (True, False):
        page = rendered(worked, key, 'Ada "L" <b>')
        assert page.count("The recording is simulated.") > 10
        assert "Ada &#34;L&#34; &lt;b&gt;" in page
        assert "<b>\"; font" not in page
        assert page.count("<script") == (0 if key else 1)
        assert not re.search(r'(src|href)="(?!#)', page)


@pytest.mark.parametrize("block", [False, True])
def test_equations_are_well_formed(block: bool) -> None:
    found = html.unescape(mathml('Omega &= sqrt{frac{g}{L}} = 5 "rad/s"' if block else "theta''_1^2", block))
    assert ElementTree.fromstring(found).tag == "math"
    for wrong in ("omgea", "frac{1}", "{1", "1}"):
        with pytest.raises(NotationError):
            mathml(wrong, block)


WILD = """
k = acceleration(theta, omega)
theta, omega = theta + dt*omega, omega + dt*k + dt*dt*k**5
"""
"""A step that follows the equation as dt goes to 0, and explodes where accelerations are large."""
BAD = {
    "period 0": (["--period", "0"], "--period must be a finite number above 0"),
    "period in ms": (["--period", "1190"], "it must be from 0.3 to 10 s"),
    "length in cm": (["--period", "1.19", "--length", "35.3"], "lengths in m from the pivot"),
    "length of 692 m": (["--length", "692"], "from 0.3 to 10 s. Lengths are in m"),
    "time base": (["--recording", "slow.txt"], "--read rate=100 or time_unit=ms sets the time base"),
    "both": (["--period", "1.19", "--recording", "swing.txt"], "leave one of them out"),
    "error alone": (["--length-error", "0.1"], "--length-error needs --length"),
    "no swing": (["--recording", "still.txt"], "still.txt"),
    "degrees as radians": (["--recording", "swing.txt", "--read", "unit=rad"], "add --read unit=deg"),
    "no file": (["--recording", "none.txt"], "none.txt"),
    "folder": (["--out", "file/x"], "cannot be written"),
    "name": (["--name", "a\nb"], "--name must be one line"),
    "no step": (["--own-step", "none.py"], "The file 'none.py' of the step cannot be read: No such file"),
    "step without acceleration": (["--own-step", "still.py"], "The step never calls acceleration"),
    "step that explodes": (["--own-step", "wild.py"], "do not stay finite for 10 s with steps of 0.01 s"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_ends_in_a_sentence_with_files_as_they_were(case: str, tmp_path: Path, run_here: Here) -> None:
    words, said = BAD[case]
    times = [0.02 * i for i in range(600)]
    (tmp_path / "still.txt").write_text("".join(f"{t:.2f}\t0.0\n" for t in times))
    (tmp_path / "swing.txt").write_text("".join(f"{t:.2f}\t{20 * math.cos(5.27 * t):.3f}\n" for t in times))
    (tmp_path / "slow.txt").write_text("".join(f"{20 * t:.2f}\t{20 * math.cos(5.27 * t):.3f}\n" for t in times))
    (tmp_path / "still.py").write_text("theta = theta + omega*dt")
    (tmp_path / "wild.py").write_text(WILD)
    (tmp_path / "file").write_text("kept")
    (tmp_path / "out" / "exercise").mkdir(parents=True)
    (tmp_path / "out" / "exercise" / "report.html").write_text("kept")
    before = contents(tmp_path)
    code, _, told = run_here("exercise", *words)
    assert code == 2, told
    assert said in told
    assert len(told.strip().splitlines()) == 1
    assert contents(tmp_path) == before


def test_interrupted_writing_leaves_earlier_files(
    worked: Worked, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    (tmp_path / "report.html").write_text("kept")
    monkeypatch.setattr(figures, "FIGURES", (stop,))
    before = contents(tmp_path)
    with pytest.raises(KeyboardInterrupt):
        report.write(worked, tmp_path)
    assert contents(tmp_path) == before


CTRL_C = """
import functools, os, signal, sys
from pendulum_env.cli import main
from pendulum_env.exercise import figures

@functools.wraps(figures.FIGURES[2])
def interrupted(*given):
    os.kill(os.getpid(), signal.SIGINT)
    return interrupted.__wrapped__(*given)

figures.FIGURES = (*figures.FIGURES[:2], interrupted, *figures.FIGURES[3:])
sys.argv = ["lab-pendulum", "exercise", "--out", "x"]
main()
"""
"""The command, which sends itself SIGINT while it draws the third figure."""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals differ")
def test_ctrl_c_leaves_earlier_files_as_they_were(tmp_path: Path) -> None:
    (tmp_path / "x").mkdir()
    for name in ("report.html", "numbers.csv", "forward.png"):
        (tmp_path / "x" / name).write_text("kept")
    before = contents(tmp_path)
    done = subprocess.run([sys.executable, "-c", CTRL_C], cwd=tmp_path, capture_output=True, text=True, timeout=300,
                          preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler))
    assert done.returncode == 130, done.stderr
    assert "Interrupted" in done.stderr
    assert contents(tmp_path) == before


def test_without_jinja_the_command_says_what_to_install(run_here: Here, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "jinja2", None)
    code, _, told = run_here("exercise")
    assert code == 2
    assert "pip install 'lab-pendulum[exercise]'" in told


SMALLEST_TEXT = """
Math.min(...[...document.querySelectorAll('p, td, th, li, figcaption, footer, code')]
    .map(x => parseFloat(getComputedStyle(x).fontSize)))
"""
"""Script that returns the size of the smallest text of a page outside its figures [CSS pixels]."""
WIDTHS = "[...document.querySelectorAll('figure svg')].map(x => x.getBoundingClientRect().width)"
KINDS = {
    "simulated": [], "encoder": ["--recording", "encoder_short_rod_45deg.txt", "--read", "scale=0.99"],
    "video": ["--recording", "video_decay_65cm.txt", "--length", "0.65", "--mass", "0.0415"],
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_the_report_prints_from_a_browser(kind: str, tmp_path: Path, run_here: Here, request: Any) -> None:
    """Without Chromium the files alone are checked, and the test then counts as skipped."""
    words = KINDS[kind]
    if words:
        words = [words[0], str(request.getfixturevalue("recordings") / words[1]), *words[2:]]
    code, _, told = run_here("exercise", *words, "--key", "--out", "x")
    assert code == 0, told
    page = (tmp_path / "x" / "report.html").read_text(encoding="utf-8")
    names = re.findall(r'\bid="([^"]+)"', page)
    assert len(names) == len(set(names))
    assert ("The recording is simulated" in page) == (kind == "simulated")
    assert len(list((tmp_path / "x").glob("*.svg"))) == page.count("<figure ") == (13 if kind == "simulated" else 14)
    with opened(tmp_path / "x" / "report.html", viewport={"width": 1000, "height": 800}) as seen:
        wide = seen.page.evaluate("[document.documentElement.scrollWidth, innerWidth]")
        small = seen.page.evaluate(SMALLEST_TEXT)
        figures = seen.page.evaluate(WIDTHS)
        seen.page.set_viewport_size({"width": 390, "height": 800})
        narrow = seen.page.evaluate("[document.documentElement.scrollWidth, innerWidth]")
        seen.page.set_viewport_size({"width": 1000, "height": 800})
        printed = seen.page.pdf(format="A4")
    assert wide[0] <= wide[1]
    assert narrow == [390, 390]
    assert small >= 12.0
    assert min(figures) > 360.0  # the smallest takes three fifths of the page
    assert 12 <= len(re.findall(rb"/Type\s*/Page\b", printed)) <= 22


def typed_into(page: Any, name: str, text: str) -> None:
    """Type a text into a blank of a report in a browser, key by key."""
    page.locator(f'[data-answer="{name}"]').click()
    page.keyboard.type(text)


def shown_in(page: Any, *names: str) -> list[str]:
    return [page.locator(f'[data-answer="{name}"]').inner_text() for name in names]


TYPED = {"4": "The tangent lies outside\nthe ellipse & <b>every</b> step.", "7": "E grows", "date": "28 November"}
"""Texts typed into a report, by the name of the blank."""


@pytest.mark.slow
def test_what_a_student_types_stays(
    worked: Worked, tmp_path: Path, run_here: Here, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Over a reload, over saving into the file, and over a new run of the command, with the name at every foot."""
    assert run_here("exercise", "--out", "x")[0] == 0
    place = tmp_path / "x" / "report.html"
    fresh, context = place.read_text(encoding="utf-8"), {"accept_downloads": True}
    with opened(place, **context) as seen:
        page = seen.page
        page.add_init_script("delete window.showSaveFilePicker")  # as in browsers that cannot write into a file
        page.reload()
        assert page.locator(".blank [contenteditable]").count() == page.locator(".asked").count() > 10
        for name, text in {**TYPED, "name": "Ada"}.items():
            typed_into(page, name, text)
        page.keyboard.press("Enter")  # a name is one line
        page.reload()
        assert shown_in(page, *TYPED, "name", "5") == [*TYPED.values(), "Ada", ""]
        assert 'content: "\\41 \\64 \\61 "' in page.locator("#footer").text_content()
        assert place.read_text(encoding="utf-8") == fresh
        assert run_here("exercise", "--period", "1.2", "--out", "x")[0] == 0  # nothing is saved in the file yet
        page.reload()
        assert shown_in(page, *TYPED, "name") == [*TYPED.values(), "Ada"]
        with page.expect_download() as download:
            page.get_by_role("button", name="Save").click()
        assert download.value.suggested_filename == "report.html"
        download.value.save_as(place)
    _, printed, _ = run_here("exercise", "--out", "x")
    assert "The 2 answers of the earlier report are in the new one." in printed
    with opened(place) as seen:  # a browser that has kept nothing
        assert shown_in(seen.page, *TYPED, "name", "5") == [*TYPED.values(), "Ada", ""]
    kept = place.read_bytes()
    for words, said in ((["--key"], "holds 2 answers of Ada, and the teacher's key has no room"),
                        (["--name", "Bob"], "holds 2 answers of Ada, and this report is Bob's")):
        code, _, error = run_here("exercise", *words, "--out", "x")
        assert (code, place.read_bytes()) == (2, kept)
        assert said in error


CHOSEN = """
window.showSaveFilePicker = async wanted => ({createWritable: async () => ({
    write: async text => { window.written = (window.written || []).concat(text); }, close: async () => {} })});
"""
"""A browser that writes into a file which the student chose."""
OLDER = """localStorage.setItem(Object.keys(localStorage)[0], '{"time": 1, "texts": {"1": "old"}}')"""
"""Puts other answers into the browser, of an earlier time than the file's."""


@pytest.mark.slow
def test_save_writes_the_page_into_a_chosen_file(worked: Worked, tmp_path: Path) -> None:
    """The saved page is the page with its answers, and shows them in another browser that has older ones."""
    place = tmp_path / "report.html"
    place.write_text(rendered(worked, False), encoding="utf-8")
    with opened(place) as seen:
        seen.page.add_init_script(CHOSEN)
        seen.page.reload()
        for text in ("first", " and last"):
            typed_into(seen.page, "1", text)
            seen.page.get_by_role("button", name="Save").click()
            seen.page.get_by_text("Saved into the file.").wait_for()
        first, last = seen.page.evaluate("window.written")
        place.write_text(last, encoding="utf-8")
        seen.page.evaluate(OLDER)
        seen.page.reload()
        assert shown_in(seen.page, "1") == ["first and last"]
    assert earlier(place).texts == {"1": "first and last"}
    assert earlier(place).report in first
    assert last.startswith("<!DOCTYPE html>")


def test_answers_are_read_from_a_page_as_browsers_save_it(tmp_path: Path) -> None:
    """Browsers write typed lines as elements of their own, or as breaks."""
    (tmp_path / "report.html").write_text(
        '<html data-report="r" data-saved="5"><p><span data-answer="name"> Ada </span></p><svg id="a"></svg>'
        '<div data-answer="1">one<div>two &lt; <b>three</b></div><br>four</div><div data-answer="2"><br></div>'
        '<div data-answer="3">last<img src="#">.</div>after<svg id="b">\n<g></svg>', encoding="utf-8")
    found = earlier(tmp_path / "report.html")
    assert (found.report, found.saved, found.number) == ("r", "5", 2)
    assert found.texts == {"name": "Ada", "1": "one\ntwo < three\nfour", "3": "last."}
    assert earlier(tmp_path / "report.html", "Ada") == found
    assert earlier(tmp_path / "none.html").texts == {}


def test_a_new_report_has_the_saved_answers_in_its_blanks(worked: Worked) -> None:
    kept = Answers("r", "5", {"name": "Ada", "date": "today", "2": "a < b\nc"})
    page = report.page(worked, DRAWINGS, "", False, FACTS, kept)
    assert '<html lang="en" data-report="r" data-saved="5">' in page
    assert 'mm">a &lt; b\nc</div>' in page
    assert re.search(r'data-answer="name"[^>]*>Ada<', page)
    assert re.search(r'data-answer="date"[^>]*>today<', page)
