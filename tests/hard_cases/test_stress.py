"""The catalogue of hard cases: its table, each case, and ``lab-pendulum stress``.

Quick tests run rk4 in every short case, and each method in one case; slow ones every short case with every second
method; ``lab-pendulum stress`` runs all.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tolerances
from choice import FULL, chosen, turn_of
from matplotlib.image import imread
from readme_code import READMES
from tolerances import unexplained

import integrators
import pendulum_env
from pendulum_env import cli
from pendulum_env.engine import rollout as engine
from pendulum_env.engine.machine import fitting
from pendulum_env.hard_cases import case as case_module
from pendulum_env.hard_cases import magnitudes, run
from pendulum_env.hard_cases.case import (
    ACCURATE,
    DIVERGED,
    OUTCOMES,
    REFUSED,
    WRONG,
    Bound,
    Case,
    Finding,
    always,
    check_unique,
)
from pendulum_env.hard_cases.run import CASES, KNOWN_FAILURES
from pendulum_env.physics.presets import SCENES
from pendulum_env.physics.units import SceneError
from pendulum_env.plots import hard_cases as matrix_figure

METHODS = integrators.METHODS
SHORT = tuple(case for case in CASES if not case.long)
NAMES = [case.name for case in SHORT]
LIGHT = [method for method in METHODS.values() if method.evaluations == 1 and not method.implicit]
"""Methods with one force per step, with which each case runs fast."""
FIRST = tuple({case.group: case for case in reversed(SHORT)}.values())
"""One case of each group."""
EASY = next(case for case in CASES if case.name == "upright for a moment")
"""Case of a hundred steps, in which every method runs fast."""
FAILING = next(case for case in CASES if (case.name, "newmark_linear") in KNOWN_FAILURES)
"""A case in which a method fails, for a reason that the catalogue gives."""


def by_name(name: str) -> Case:
    """Return the case of a name."""
    return next(case for case in CASES if case.name == name)


# --- the table itself ------------------------------------------------------------------------------------------------


def test_the_table_says_what_each_case_is() -> None:
    for case in CASES:
        for text in (case.group, case.name, case.why, case.truth, case.source, case.scene.name):
            assert text.strip(), case.name
        assert "TODO" not in case.truth + case.source
    assert len({case.name for case in CASES}) == len(CASES)
    assert not {case.name for case in CASES} & {case.group for case in CASES}
    with pytest.raises(SceneError, match="Two hard cases"):
        check_unique((*CASES, CASES[0]))


@pytest.mark.parametrize("name", METHODS)
def test_every_method_has_its_expectation_in_every_case(name: str) -> None:
    for case in CASES:
        may = case.may(METHODS[name])
        assert may, case.name
        assert may <= {*OUTCOMES} - {WRONG}, case.name


def test_some_method_fits_every_case() -> None:
    assert [case.name for case in CASES if not fitting(case.scene)] == []


@pytest.mark.slow
def test_every_method_runs_unless_some_are_named() -> None:
    found = run.stress(EASY.name)
    assert [(entry.case, entry.method) for entry in found.entries] == [(EASY, method) for method in METHODS.values()]
    assert not found.failures, found.text


def test_every_case_is_chosen_and_the_methods_that_are_named_run() -> None:
    assert run.chosen_cases(None, None, True) == CASES
    assert run.chosen_cases(None, None, False) == SHORT
    pairs = [(case, METHODS[name]) for case in (EASY, FAILING) for name in ("newmark_linear", "rk4")]
    found = run.stress([FAILING.name, EASY.name], integrators=["newmark_linear", "rk4"])
    assert [(entry.case, entry.method) for entry in found.entries] == pairs
    assert [row[:2] for row in found.table.rows] == [(case.group, case.name) for case in (EASY, FAILING)]


def test_known_failures_are_of_the_table_and_say_why() -> None:
    for (case, method), why in KNOWN_FAILURES.items():
        assert case in {case.name for case in CASES}
        assert method in METHODS
        assert why.strip()


@pytest.mark.parametrize("cases", [FIRST, pytest.param(SHORT, marks=pytest.mark.slow)], ids=["some", "all"])
def test_no_truth_comes_from_what_is_tested(cases: tuple[Case, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    """Every run is falsified, each by another amount: no case may accept such a run as accurate."""
    lies, made = 0, engine.rollout

    def lying(*arguments: Any, **options: Any) -> Any:
        nonlocal lies
        lies += 1
        told, size = made(*arguments, **options), 0.3 + 0.01 * lies
        ledger = replace(told.ledger, heat=told.ledger.heat + size * told.ledger.energy[..., :1] + size)
        return replace(told, angle=1.3 * told.angle + size, velocity=1.3 * told.velocity + size, ledger=ledger)

    monkeypatch.setattr(case_module, "rollout", lying)
    for cached in ("unit_run", "unit_finding"):
        monkeypatch.setattr(magnitudes, cached, getattr(magnitudes, cached).__wrapped__)
    believed, elsewhere = [], []
    for case in cases:
        before = lies
        with np.errstate(all="ignore"):
            found = case.tried(next(method for method in LIGHT if method.name in fitting(case.scene))).outcome
        elsewhere += [case.name] if lies == before else []
        believed += [case.name] if lies > before and found == ACCURATE else []
    assert not believed
    print(f"{len(cases) - len(elsewhere)} of {len(CASES)} cases were lied to; without a single rollout: {elsewhere}")


# --- cases and methods -----------------------------------------------------------------------------------------------


def failures(pairs: Any) -> str:
    """Return unexpected outcomes, known failures that did not happen, and loose tolerances, one line each."""
    entries = tuple(run.entry(case, method) for case, method in pairs)
    found = run.Matrix(tuple({id(e.case): e.case for e in entries}.values()), tuple(METHODS.values()), entries)
    lines = found.text.splitlines()[1:] if found.failures or found.outdated else []
    return "\n".join([*lines, *(line for one in entries for line in unexplained(one))])


@pytest.mark.slow
def test_a_case_of_each_group() -> None:
    cases = [(case, METHODS[chosen((method.name for method in LIGHT), case.name)]) for case in FIRST]
    said = failures(cases)
    assert not said, said


@pytest.mark.slow
def test_rk4_in_every_short_case() -> None:
    said = failures((case, METHODS["rk4"]) for case in SHORT)
    assert not said, said


LOW = ("forward_euler", "backward_euler", "velocity_verlet", "heun")
"""Methods of order 1 and 2, whose tolerances are the largest."""


@pytest.mark.slow
def test_methods_of_low_order_in_cases_of_friction_and_in_some_others() -> None:
    """Their tolerances are the widest. Cases of friction take two methods, others one; slow tests take more."""
    pairs = [(case, METHODS[name]) for case in SHORT if case.group == "non-smooth"
             for name in ("forward_euler", "velocity_verlet")]
    others = [case for case in SHORT if case.group in ("near the top", "magnitudes", "switching", "step limits")]
    pairs += [(case, METHODS[LOW[turn_of(case.name, 4)]]) for case in others if turn_of(case.name, 3) == 0]
    said = failures(pairs)
    assert not said, said


def test_the_command_prints_each_tolerance_as_a_share(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(tolerances, "CASES", (EASY, by_name("NaN")))
    monkeypatch.setattr(sys, "argv", ["tolerances.py", "rk4"])
    tolerances.main()
    assert capsys.readouterr().out.splitlines() == [
        "near the top: upright for a moment", "   3.2e-16 = 1e-15/3.1 of the motion (rk4)",
        "actions: NaN: nothing may differ", "1 tolerances; 0 above 10% of what they bound, 0 of them without a reason."]


def test_a_loose_tolerance_needs_a_reason() -> None:
    loose = Finding(ACCURATE, 0.1, 0.2, bounds=(Bound("the way", 0.2, 1.0), Bound("the rest", 0.1, 1.0)))
    lines = unexplained(run.entry(made("loose", loose), METHODS["rk4"]))
    assert lines == ["loose, rk4:      0.2 = 0.2/1 of the way, and no reason"]
    wide = replace(loose, bounds=(Bound("it", 9.0, 1.0, "why"),))
    assert not unexplained(run.entry(made("wide", wide), METHODS["rk4"]))
    assert len(unexplained(run.entry(made("silent", Finding(ACCURATE, 0.1, 0.2)), METHODS["rk4"]))) == 1


@pytest.mark.slow
@pytest.mark.quick("half a swing more")
@pytest.mark.parametrize("short", [-1, 1], ids=["half a swing less", "half a swing more"])
def test_heat_of_another_way_is_refused(short: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Friction to rest takes its limit times the way; a way that is a half swing longer or shorter is another one.

    The last half swing leads from 0.18 rad on one side to 0.02 rad on the other.
    """
    case, ran = by_name("Coulomb friction to rest, small angles"), engine.rollout

    def other(*arguments: Any, **options: Any) -> Any:
        told = ran(*arguments, **options)
        return replace(told, ledger=replace(told.ledger, heat=told.ledger.heat * (1.0 + short * 0.2 / 2.72)))

    monkeypatch.setattr(case_module, "rollout", other)
    for name in (*LOW, "rk4"):
        found = case.tried(METHODS[name])
        assert (found.outcome, found.note) == (WRONG, "its heat is not friction times the distance"), name


def test_a_thousandth_of_the_heat_is_not_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    """The heat of these methods errs by less than a hundredth of that."""
    case, ran = by_name("Coulomb friction to rest, small angles"), engine.rollout

    def less(*arguments: Any, **options: Any) -> Any:
        told = ran(*arguments, **options)
        return replace(told, ledger=replace(told.ledger, heat=told.ledger.heat * 0.999))

    monkeypatch.setattr(case_module, "rollout", less)
    for name in ("velocity_verlet", "heun", "rk4", "gauss4", "dop853"):
        assert case.tried(METHODS[name]).outcome == WRONG, name


@pytest.mark.slow
@pytest.mark.parametrize("case", SHORT, ids=NAMES)
def test_all_methods(case: Case) -> None:
    """Each case runs about every ninth of the methods; long runs, which compile each, about every 16th.

    So each method is in about 17 cases. ``LAB_PENDULUM_GRID=full`` runs all of them, as ``lab-pendulum stress`` does.
    """
    apart = 1 if FULL else 16 if case.group == "long runs" else 9
    tried = [method for name, method in METHODS.items() if turn_of(f"{case.name} {name}", apart) == 0]
    said = failures((case, method) for method in tried)
    print(f"{len(tried)} of {len(METHODS)} methods")
    assert not said, said


# --- what is made of it ----------------------------------------------------------------------------------------------


def made(name: str, finding: Finding | BaseException, group: str = "made up", scene: str = "vacuum",
         long: bool = False) -> Case:
    """Return a hard case with a given outcome, in which only ACCURATE is allowed."""

    def attempt(_: Any) -> Finding:
        if isinstance(finding, BaseException):
            raise finding
        return finding

    return Case(name, group, "why", "a truth", "a source", SCENES[scene], always(ACCURATE), attempt, long)


GOOD, BAD = made("good", Finding(ACCURATE, 1e-9, 1e-6)), made("bad, too", Finding(WRONG, 1.0, 1e-6, "it lies"))


def test_a_refusal_is_right_only_for_an_unmet_need() -> None:
    refusing = made("refusing", Finding(REFUSED), scene="sticky_bearing")
    rk4, verlet, lacking = METHODS["rk4"], METHODS["velocity_verlet"], METHODS["nystrom4"]
    assert not refusing.as_expected(rk4, refusing.tried(rk4))
    assert not lacking.needs <= verlet.needs
    found = refusing.tried(lacking)
    assert (found.outcome, refusing.as_expected(lacking, found)) == (REFUSED, True)
    assert "needs" in found.note


def test_a_crash_is_a_finding() -> None:
    found = made("crash", ZeroDivisionError("by zero")).tried(METHODS["rk4"])
    assert (found.outcome, found.note) == (WRONG, "ZeroDivisionError: by zero")


def test_choosing_cases() -> None:
    def names(*arguments: Any) -> list[str]:
        return [case.name for case in run.chosen_cases(*arguments)]

    group = [case.name for case in CASES if case.group == "step limits"]
    long = [case.name for case in CASES if case.group == "step limits" and case.long]
    assert long
    assert names("step limits", None, True) == group
    assert names("step limits", None, False) == [name for name in group if name not in long]
    assert names([*long, "near the top"], None, False) == [
        case.name for case in CASES if case.name in long or case.group == "near the top"]
    assert names(None, "textbook", True) == [case.name for case in CASES if case.scene.name == "textbook"]
    for arguments, words in (
        (["near the topp", None, False], "did you mean near the top"), ((None, "vacum", False), "mean vacuum"),
        (("near the top", "textbook", False), "No hard case matches"),
    ):
        with pytest.raises(SceneError, match=words):
            run.chosen_cases(*arguments)
    with pytest.raises(integrators.MethodError, match="did you mean rk4"):
        run.stress(integrators=["rk5"])
    assert pendulum_env.stress is run.stress


def test_progress_rises_to_one_and_an_interruption_keeps_what_ran() -> None:
    told: list[tuple[float, str]] = []
    run.stress(EASY.name, ["rk4", "heun"], progress=lambda done, what: told.append((done, what)))
    assert told == [(0.0, f"{EASY.name}: rk4"), (0.5, f"{EASY.name}: heun"), (1.0, "done")]

    def stop(done: float, what: str) -> None:
        if done >= 0.5:
            raise KeyboardInterrupt

    found = run.stress(EASY.name, ["rk4", "heun"], progress=stop)
    assert ([entry.method.name for entry in found.entries], found.complete) == (["rk4"], False)
    assert "interrupted before the end" in found.text


def matrix(*entries: tuple[Case, str, str]) -> run.Matrix:
    """A matrix of cases, each with the name of a method and why a failure of it is known."""
    tried = [(case, METHODS[name], case.tried(METHODS[name]), known) for case, name, known in entries]
    return run.Matrix(
        tuple({case.name: case for case, _, _ in entries}.values()),
        tuple({name: METHODS[name] for _, name, _ in entries}.values()),
        tuple(run.MatrixEntry(case, method, finding, case.as_expected(method, finding), known)
              for case, method, finding, known in tried))


def test_failures_are_told_from_known_ones() -> None:
    worse = made("worse", Finding(DIVERGED))
    found = matrix((GOOD, "rk4", "old"), (GOOD, "heun", ""), (BAD, "rk4", ""), (BAD, "heun", ""),
                   (worse, "rk4", "a reason"), (worse, "heun", ""))
    assert [(e.case.name, e.method.name) for e in found.failures] == [
        ("bad, too", "rk4"), ("bad, too", "heun"), ("worse", "heun")]
    assert [(e.case.name, e.method.name) for e in found.outdated] == [("good", "rk4")]
    assert found.text.splitlines() == [
        "6 of 6 combinations of 3 cases and 2 methods ran; 3 failed.",
        "bad, too, rk4: wrong instead of accurate; it lies.", "bad, too, heun: wrong instead of accurate; it lies.",
        "worse, heun: diverged instead of accurate.", "Known failure: worse, rk4: a reason",
        "Known failure that did not fail: good, rk4; take it off the list.",
    ]
    assert found.table.rows[1] == ("made up", "bad, too", "-", "-", "-", "-", "2", "2")


@pytest.fixture
def type_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Any:
    """Run ``lab-pendulum stress`` with these arguments; return exit code, output and error output."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")

    def typed(*words: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["lab-pendulum", "stress", *words])
        with pytest.raises(SystemExit) as stop:
            cli.main()
        return int(stop.value.code or 0), *capsys.readouterr()

    return typed


def rows(path: Path) -> tuple[dict[str, str], list[dict[str, str]]]:
    lines = path.read_text(encoding="utf-8").splitlines()
    facts = dict(line[2:].split(": ", 1) for line in lines if line.startswith("# "))
    return facts, list(csv.DictReader(line for line in lines if not line.startswith("# ")))


def test_the_command_writes_a_table_and_a_figure(tmp_path: Path, type_it: Any) -> None:
    code, printed, said = type_it("--cases", EASY.name, "--integrators", "rk4, radau5,ab3", "--out", "x")
    assert code == 0, said
    assert "3 of 3 combinations of 1 cases and 3 methods ran; 0 failed." in printed
    facts, found = rows(tmp_path / "x" / "stress.csv")
    assert facts["Command"].startswith("lab-pendulum stress")
    assert [(row["method"], row["outcome"], row["as_expected"]) for row in found] == [
        ("rk4", ACCURATE, "1"), ("radau5", ACCURATE, "1"), ("ab3", ACCURATE, "1")]
    assert 0.0 <= float(found[0]["error"]) <= float(found[0]["tolerance"])
    assert found[0]["stop_time_s"] == ""
    assert imread(tmp_path / "x" / "stress.png").ndim == 3


def test_failures_end_it_with_a_code_unless_they_are_known(type_it: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    words = ("--cases", FAILING.name, "--integrators", "newmark_linear")
    code, printed, _ = type_it(*words)
    assert code == 0
    why = KNOWN_FAILURES[FAILING.name, "newmark_linear"]
    assert f"Known failure: {FAILING.name}, newmark_linear: {why}" in " ".join(printed.split())
    monkeypatch.setattr(run, "KNOWN_FAILURES", {})
    code, printed, _ = type_it(*words)
    assert code == 1
    assert f"{FAILING.name}, newmark_linear: wrong instead of " in " ".join(printed.split())
    code, printed, said = type_it("--cases", "step limit")
    assert (code, printed) == (2, "")
    assert said.strip() == "Error: There is no hard case or group 'step limit'; did you mean step limits?"


def test_an_interruption_leaves_whole_files(tmp_path: Path, type_it: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """The interruption comes from the bar, as from a key that is pressed while the second method runs."""
    @contextmanager
    def interrupting(_: str) -> Iterator[Any]:
        def tell(done: float, what: str) -> None:
            if done > 0.0:
                raise KeyboardInterrupt
        yield tell

    monkeypatch.setattr(sys.modules["pendulum_env.cli.stress"], "bar", interrupting)
    code, printed, _ = type_it("--cases", EASY.name, "--integrators", "rk4,heun")
    assert code not in (0, 1, 2)
    assert "interrupted before the end" in printed
    facts, found = rows(tmp_path / "out" / "stress" / "stress.csv")
    assert facts["Complete"] == "false"
    assert [(row["case"], row["method"]) for row in found] == [(EASY.name, "rk4")]
    assert imread(tmp_path / "out" / "stress" / "stress.png").ndim == 3
    assert {path.name for path in (tmp_path / "out" / "stress").iterdir()} == {"stress.csv", "stress.png"}


def test_the_list_of_cases_runs_nothing(tmp_path: Path, type_it: Any) -> None:
    code, printed, _ = type_it("--list", "--cases", "near the top")
    assert code == 0
    assert not list(tmp_path.iterdir())
    words = printed.split()
    near = [case for case in CASES if case.group == "near the top" and not case.long]
    assert words.count("Truth:") == words.count("Source:") == len(near)


@pytest.mark.parametrize(("words", "said"), [
    (["--list", "--svg"], "--list runs no method and writes no file; leave out --svg"),
    (["--list", "--integrators", "rk4"], "leave out --integrators"),
    (["--list", "--out", "x"], "leave out --out"),
    (["--long", "--cases", EASY.name], "long adds the long cases of groups"),
])
def test_options_without_a_use_are_refused(words: list[str], said: str, tmp_path: Path, type_it: Any) -> None:
    code, _, error = type_it(*words)
    assert code == 2
    assert said in error
    assert not (tmp_path / "x").exists()


def test_the_figure_has_a_cell_a_mark_and_an_outline_for_each() -> None:
    methods = ("velocity_verlet", "rk4", "heun")
    cases = [made(outcome, Finding(outcome)) for outcome in OUTCOMES]
    found = matrix(*((case, name, "a reason" if (case.name, name) == (WRONG, "rk4") else "")
                     for case in cases for name in methods))
    figure = matrix_figure.draw(found)
    (axes,) = figure.axes
    cells = [patch for patch in axes.patches if patch.get_fill()]
    outlines = [patch for patch in axes.patches if not patch.get_fill()]
    assert len(cells) == len(found.entries)
    assert len(outlines) == sum(not entry.expected for entry in found.entries)
    assert sum(patch.get_linestyle() != "-" and patch.get_linestyle() != "solid" for patch in outlines) == 1
    assert [label.get_text() for label in axes.get_xticklabels()] == [*methods]
    assert [label.get_text() for label in axes.get_yticklabels()] == list(OUTCOMES)
    assert {"splitting", "Runge-Kutta", "made up"} <= {text.get_text() for text in axes.texts}


def test_outcomes_can_be_told_apart_without_colours() -> None:
    marks = [mark for _, _, mark, _ in matrix_figure.LOOKS.values()]
    assert len(set(marks)) == len(OUTCOMES) == len(matrix_figure.LOOKS)


def luminance(tone: str) -> float:
    """Relative luminance of sRGB (IEC 61966-2-1)."""
    parts = np.array([int(tone[i : i + 2], 16) / 255.0 for i in (1, 3, 5)])
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def test_marks_stand_out_from_their_cells() -> None:
    """Markers have a contrast of at least 3 with their cells (WCAG 2.1, 1.4.11)."""
    for tone, ink, mark, _ in matrix_figure.LOOKS.values():
        light, dark = sorted((luminance(tone), luminance(ink)), reverse=True)
        assert not mark or (light + 0.05) / (dark + 0.05) >= 3.0, tone


def test_the_documents_name_it_and_its_words() -> None:
    assert "stress" in pendulum_env.__all__
    section = READMES["pendulum_env/study/README.md"].split("\n## Hard cases\n")[1].split("\n## ")[0]
    assert "`pendulum_env.stress(" in section
    help_text = import_module("pendulum_env.cli.stress").stress.__doc__ or ""
    for outcome in OUTCOMES:
        assert f"*{outcome}*" in section
        assert f"{outcome}:" in help_text
