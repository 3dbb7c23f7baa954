"""Tests of reports on scenes with drives, or with several models of one effect."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from pendulum_env import SCENES, SceneError, audit, compare, cost, plots, rollout
from pendulum_env.cli.console import LINE, print_text
from pendulum_env.engine.machine import Machine
from pendulum_env.films.record import record
from pendulum_env.physics.damping import build_scene
from pendulum_env.plots import series
from pendulum_env.study.audit.cases import cases
from pendulum_env.study.audit.verdicts import (
    CALLED_FOR,
    NEGLIGIBLE,
    NOT_SIMULATED,
    Audit,
    AuditRow,
    Simplification,
)
from pendulum_env.study.compare import files

pytestmark = pytest.mark.usefixtures("all_interpreted")


def audit_of(scene: str, *rows: AuditRow) -> Audit:
    return Audit(SCENES[scene], 0.2, 1e-3, rows, 0.0, 128, 1.0)


def test_sizes_have_no_sign_and_formulas_stand_beside_what_they_predict() -> None:
    pushed = AuditRow("vertical_drive", True, "", 2.0, angle_change=0.5, verdict=CALLED_FOR)
    known = AuditRow("wire_flexure", False, "", 0.2, period_predicted=-0.1, verdict=NOT_SIMULATED)
    table = audit_of("kapitza", pushed, known).table
    assert table.head == ("effect", "number", "angle", "ns/step", "verdict")
    assert table.rows[0][2] == "5.0e-1"
    swinging = AuditRow("gravity", True, "", 0.1, period_change=0.01, verdict=CALLED_FOR)
    assert audit_of("kapitza", swinging, known).table.head[2:4] == ("period", "formula")


def test_models_of_one_thing_are_named_together() -> None:
    names = ("finite_bob", "quadratic_drag", "sphere_drag")
    found = audit_of("kapitza", *(AuditRow(name, False, verdict=CALLED_FOR) for name in names))
    said = Simplification(found, (), (), 1.0, 0.0, 0.0, True).text
    assert "Effects that matter but are not in the scene: finite_bob, sphere_drag or quadratic_drag." in said


def test_a_case_asks_only_for_what_nothing_gives() -> None:
    reasons = {case.name: case.reason for case in cases(SCENES["driven"], ["motor", "vertical_drive"])}
    assert reasons == {"motor": "needs max_torque", "vertical_drive": "needs vertical_amplitude, vertical_rate"}


def test_a_bob_held_fast_is_outside_no_formula() -> None:
    found = audit("sticky_bearing", amplitude=0.002, tolerance=1e-2, effects=["quadratic_drag", "coulomb_friction"],
                  backend="python")
    assert [row.verdict for row in found.rows] == [NEGLIGIBLE, CALLED_FOR]


def test_text_is_folded(capsys: pytest.CaptureFixture[str]) -> None:
    text = f"{SCENES['windy'].equation()}, {SCENES['driven'].equation()}\n\nshort"
    print_text(text)
    printed = capsys.readouterr().out
    assert max(map(len, printed.splitlines())) <= LINE
    assert printed.split() == text.split()
    assert printed.endswith("\n\nshort\n")


@pytest.mark.slow
def test_cost_of_a_scene_that_is_driven_from_rest() -> None:
    found = cost("driven", ["rk4"], duration=1.0, repeats=1, backend="python")
    assert found.points[-1].angle_error < 1e-6
    assert all(math.isfinite(point.energy_error) for point in found.points)


@pytest.mark.slow
def test_film_of_a_comparison_shows_the_work_of_a_drive(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[Any] = []
    monkeypatch.setattr(files, "side_by_side", lambda panels, **_: shown.append(panels))
    for scene in ("driven", "vacuum"):
        list(files.pictures(compare(scene, "rk4", duration=0.5), 20))
    assert shown[19][0][1].work > 0.0
    assert shown[-1][0][1].work is None


@pytest.mark.slow
def test_figures_of_driven_scenes_promise_no_rest() -> None:
    said = {scene: " ".join(text.get_text() for text in compare(
        scene, "rk4", duration=0.1).plot("phase").axes[0].texts) for scene in ("driven", "windy")}
    assert "The drive does work" in said["driven"]
    assert "spiral" not in said["driven"]
    assert "gusts keep the bob from coming to rest" in said["windy"]


@pytest.mark.slow
def test_an_energy_of_nothing_has_no_shares_and_irregular_curves_no_turning_points() -> None:
    driven, windy = ({scene: rollout(scene, dt=0.04, duration=400.0, warn=False)} for scene in ("driven", "windy"))
    assert plots.energy(driven).get_ylabel() == "energy [mJ]"
    assert plots.energy_error(driven).get_ylabel().startswith("|energy residual| [J]")
    assert plots.energy_error(windy).get_ylabel().startswith("|energy residual| / E$_0$")
    for draw, what in ((plots.angle, "turning points"), (plots.velocity, "extremes")):
        assert what in draw(driven).get_ylabel()
        assert what not in draw(windy).get_ylabel()
        assert len(draw(windy).lines[0].get_xdata()) == 10001


def test_what_swings_has_all_its_highs_above_its_lows() -> None:
    time = np.linspace(0.0, 60.0, 6001)
    assert series.swings(np.exp(-0.02 * time) * np.cos(5.0 * time))
    assert series.swings(time)
    assert not series.swings(np.cos(5.0 * time) + 3.0 * np.sin(0.2 * time))


def test_no_truth_and_no_losses_are_said_plainly() -> None:
    said = compare("windy", "rk4", duration=0.1).text
    assert "which depend on a seed: it has no unique motion.\n" in said
    assert "Reynolds number at the bottom, without losses: 2558" in said


def test_a_film_takes_a_control_only_with_a_motor(tmp_path: Any) -> None:
    with pytest.raises(SceneError, match="'water' has no motor"):
        record(Machine(SCENES["water"], "rk4", backend="python"), tmp_path / "x.gif", control=0.5, duration=0.1)


def test_flags_may_come_from_numpy() -> None:
    layered = build_scene("clock_bob", "scene", {"added_mass.boundary_layer": np.bool_(False)})
    assert [effect.boundary_layer for effect in layered.effects if effect.name == "added_mass"] == [False]
    with pytest.raises(SceneError, match="boundary_layer must be True or False"):
        build_scene("clock_bob", "scene", {"added_mass.boundary_layer": np.array([True])})


def test_drag_without_a_medium_says_what_to_do() -> None:
    with pytest.raises(SceneError, match="no sphere_drag in vacuum; leave out this effect, or give the scene a medium"):
        build_scene("moon", "sphere_drag")
