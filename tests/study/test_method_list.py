"""Tests of ``lab-pendulum list integrators``: all methods, any width, and reasons why some do not fit a scene."""

from __future__ import annotations

import csv
import io
import math
import re
from dataclasses import replace

import pytest
from choice import familiar, quick
from readme_code import check_listed, check_table
from regenerate import alike
from typer.testing import CliRunner

from integrators import ALIASES, METHODS
from integrators.analysis import damping_limit, overdamping_limit, stability_limit
from integrators.method import NEEDS
from integrators.steps.estimates import has_estimates
from integrators.tables.limits import LIMITS
from pendulum_env import SCENES, cli
from pendulum_env.engine.machine import fitting
from pendulum_env.physics.damping import with_damping
from pendulum_env.physics.effects import EFFECTS
from pendulum_env.study.lists.methods import (
    NARROWEST,
    SOFT,
    WIDEST,
    computed_limits,
    entry,
    fit_listing,
    limits,
    listing,
    shown,
    unfit,
)
from pendulum_env.study.lists.tables import integrators_data


@pytest.fixture(scope="module")
def lists() -> dict[int, list[str]]:
    return {width: listing(METHODS.values(), width).splitlines() for width in (40, 80, 120, 500)}


@pytest.mark.parametrize("width", [40, 80, 120, 500])
def test_every_method_has_its_row_and_no_line_is_too_long(width: int, lists: dict[int, list[str]]) -> None:
    lines = lists[width]
    rows = {line.split()[0]: line.split()[1:] for line in lines if line.split()[:1] and line.split()[0] in METHODS
            and not line.startswith(" ")}
    assert set(rows) == set(METHODS)
    for name, cells in rows.items():
        found = entry(METHODS[name])
        assert cells == [str(found.order), str(found.evaluations), shown(found.oscillation_limit),
                         shown(found.damping_limit)]
    widest = max(len(line) for line in lines)
    assert widest <= min(max(width, NARROWEST), WIDEST) or widest == max(len(line) for line in lines if "----" in line)


def test_the_table_and_readme_have_them_too() -> None:
    check_table("integrators", METHODS)
    check_listed("integrators")


def test_all_of_it_is_there(lists: dict[int, list[str]]) -> None:
    said = " ".join(" ".join(lists[120]).split())
    for method in METHODS.values():
        assert method.source in said, method.name
        assert method.summary[1:] in said, method.name
    assert all(alias in said for alias in ALIASES)
    assert all(f"{need}: {NEEDS[need]}" in said for need in NEEDS if need != "acceleration"
               and any(need in method.needs for method in METHODS.values()))
    heads = [line for line in lists[120] if line.endswith("gamma h")]
    families = [line.split(",")[0] for line in heads]
    assert {family.lower() for family in families} == {method.family.lower() for method in METHODS.values()}
    assert sum(int(line.split("(")[1].split(")")[0]) for line in heads) == len(METHODS)


def test_limits_are_those_of_the_analysis() -> None:
    for name in ("rk4", "velocity_verlet", "gauss4"):
        found = entry(METHODS[name])
        assert (found.oscillation_limit, found.damping_limit) == (stability_limit(name), damping_limit(name))
    assert entry(METHODS["forest_ruth"]).damping_limit == overdamping_limit("forest_ruth", SOFT) < math.inf
    assert entry(METHODS["okunbor_skeel6"]).damping_limit is None
    assert [shown(x) for x in (None, math.inf, 0.0, 2.0 * math.sqrt(2.0))] == ["-", "any", "0", "2.828"]
    for name, method in METHODS.items():
        assert ("adaptive" in entry(method).structure) == has_estimates(method), name


def test_every_method_has_stored_limits() -> None:
    """A new method has none until ``python tests/support/regenerate.py`` has run."""
    assert list(LIMITS) == list(METHODS)


FEW = quick(METHODS, turn=5)


@pytest.mark.parametrize("names", [
    pytest.param(FEW, id="few"), pytest.param([name for name in METHODS if name not in FEW], id="others",
                                              marks=pytest.mark.slow)])
def test_stored_limits_are_what_the_analysis_computes(names: list[str]) -> None:
    assert [name for name in names if not all(map(alike, LIMITS[name], computed_limits(METHODS[name])))] == []


def test_a_list_takes_stored_limits_only_for_the_method_that_they_are_of(monkeypatch: pytest.MonkeyPatch) -> None:
    rk4, namesake = METHODS["rk4"], replace(METHODS["heun"], name="rk4")
    monkeypatch.setattr("pendulum_env.study.lists.methods.LIMITS", {"rk4": (1.25, 1.5)})
    assert limits(rk4) == (1.25, 1.5)
    assert limits(namesake) == (0.0, 2.0)
    assert limits(replace(METHODS["heun"], name="mine")) == limits(METHODS["heun"]) == (0.0, 2.0)


def test_csv_can_be_read_back() -> None:
    rows = list(csv.DictReader(io.StringIO(integrators_data().csv())))
    assert [row["name"] for row in rows] == list(METHODS)
    for row, method in zip(rows, METHODS.values(), strict=True):
        assert float(row["oscillation_limit"]) == entry(method).oscillation_limit
        assert tuple(filter(None, row["aliases"].split(", "))) == method.aliases
        assert {*filter(None, row["needs"].split(", ")), "acceleration"} == method.needs
        assert row["family"] == method.family


@pytest.mark.parametrize("name", familiar(SCENES))
def test_a_scenes_list_is_what_fits_it_and_says_why_others_do_not(name: str) -> None:
    scene = SCENES[name]
    refused = unfit(scene)
    assert set(refused) == set(METHODS) - set(fitting(scene))
    for method, why in refused.items():
        assert any(words in why for words in NEEDS.values()), method
        assert any(effect.name in why for effect in scene.effects), method
    said = fit_listing(scene, 80)
    assert said.startswith(f"{len(fitting(scene))} of {len(METHODS)} integrators fit the scene {name}, ")
    for method in METHODS:
        starts = any(line.startswith(f"{method} ") for line in said.splitlines())
        assert starts == (method not in refused)
    assert all(method in said.split("do not fit")[-1] or "do not fit" in said for method in refused)


def test_the_effects_that_stand_in_the_way_are_named_and_only_those() -> None:
    lab, sticky = SCENES["lab"], SCENES["sticky_bearing"]
    assert unfit(lab)["okunbor_skeel6"] == (
        "forces free of the velocity, which quadratic_drag, linear_drag do not offer")
    assert unfit(sticky)["forest_ruth"].endswith(", which coulomb_friction does not offer")
    assert "okunbor_skeel6" not in unfit(replace(lab, effects=lab.effects[:1]))
    assert unfit(SCENES["driven"])["taylor"].endswith(", which quadratic_drag, horizontal_drive together do not offer")


def run(*words: str) -> tuple[int, str, object]:
    done = CliRunner().invoke(cli.app, ["list", *words], env={"COLUMNS": "80"})
    return done.exit_code, done.stdout, done.exception


def test_the_command() -> None:
    code, said, _ = run("integrators", "--scene", "lab", "--all")
    assert code == 0
    fits = len(fitting(SCENES["lab"]))
    assert said.startswith(f"{fits} of {len(METHODS)} integrators fit the scene lab, ")
    reason = "methods do not fit: they need forces free of the velocity, which quadratic_drag,"
    assert reason in " ".join(said.split())
    code, said, _ = run("integrators", "--scene", "exercise", "--damping", "none", "--all")
    assert f"{len(METHODS)} of {len(METHODS)} integrators fit" in said
    assert "\nSplitting, explicit (" in said
    code, said, _ = run("scenes", "--scene", "lab", "--damping", "linear")
    assert said.split() == with_damping(SCENES["lab"], "linear").describe().split()
    code, said, _ = run("effects", "--all")
    assert code == 0
    for name, effect in EFFECTS.items():
        assert re.search(rf"^{name}(, damping={effect.damping})?$", said, flags=re.M)
    assert max(map(len, said.splitlines())) <= 80
    code, said, _ = run("effects", "--csv")
    assert said.splitlines()[0].startswith("effect,kind,damping=")


@pytest.mark.parametrize(("words", "said"), [
    (["integrators", "--scene", "labb"], "did you mean lab"),
    (["--scene", "lab"], "lab-pendulum list integrators --scene 'lab' or"),
    (["effects", "--scene", "lab"], "--scene works for two lists"),
    (["integrators", "--damping", "none"], "--damping needs --scene"),
    (["integrators", "--csv", "--markdown"], "leave one of them out"),
    (["--csv"], "one list at a time"),
    (["integrator"], "did you mean integrators"),
])
def test_what_it_refuses(words: list[str], said: str) -> None:
    code, _, error = run(*words)
    assert code == 1
    assert said in str(error)
