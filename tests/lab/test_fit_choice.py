"""Test the choice of the damping model: the right one is chosen if the data suffice, and the report says so."""

from __future__ import annotations

import math
from itertools import combinations

import pytest
from virtual_swings import MASS, even, recorded, swing

from pendulum_env import rollout
from pendulum_env.lab import Recording
from pendulum_env.lab.fitting.candidates import candidates, geometric, program, shapes
from pendulum_env.lab.fitting.fit import fit
from pendulum_env.lab.fitting.result import Fit, FitComparison, envelope_misfit
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import DAMPINGS, FiniteBob, Gravity, SphereDrag
from pendulum_env.physics.medium import VACUUM, air
from pendulum_env.physics.scene import Scene

TENTH = math.radians(0.1)
BOB = Scene("bob", Body(length=0.5, mass=MASS, radius=0.02), air(20.0), (Gravity(),))


def test_shapes_are_those_of_the_torques() -> None:
    """The torques -gamma v and -(b/I) v have one shape; every damping with a fitted parameter belongs to one shape."""
    assert dict(shapes()) == {"linear": ("linear", "bearing"), "quadratic": ("quadratic",), "coulomb": ("coulomb",)}
    assert {name for names in shapes().values() for name in names} == {n for n, e in DAMPINGS.items() if e.fitted}


def test_candidates() -> None:
    """Candidates are all sums of three shapes, and for a known bob in air, but not in vacuum, also its calculated drag.
    """
    sums = [names for count in range(4) for names in combinations(("linear", "quadratic", "coulomb"), count)]
    own = candidates(BOB, False)
    assert sorted(own) == sorted(sums)
    known = candidates(BOB, True)
    drag = [set(names) for names in known if "sphere_drag" in names]
    assert known[:len(sums)] == own
    assert drag == [{"sphere_drag"}, {"sphere_drag", "linear"}, {"sphere_drag", "coulomb"},
                    {"sphere_drag", "linear", "coulomb"}]
    assert geometric(BOB.replace(thickness=1e-3)) == ("sphere_drag", "wire_drag")
    assert candidates(BOB.replace(medium=VACUUM), True) == own


def test_few_programs_serve_all() -> None:
    """Two programs serve all sums of dampings, without and with dry friction, and two those with calculated drag."""
    assert {frozenset(program(BOB, names)) for names in candidates(BOB, False)} == {
        frozenset({"linear", "quadratic"}), frozenset({"linear", "quadratic", "coulomb"})}
    known = candidates(BOB, True)
    assert len({frozenset(program(BOB, names)) for names in known}) == 4
    assert all(("coulomb" in program(BOB, names)) == ("coulomb" in names) for names in known)


@pytest.fixture(scope="module")
def smooth() -> Fit:
    """Return a comparison of fits without dry friction to a swing with linear damping."""
    models = ["none", "linear", "quadratic", "linear+quadratic"]
    time = even(20.0, 50.0)
    seen = recorded(time, swing(time, 0.6, length=0.5, gamma=0.05), noise=TENTH)
    return fit(seen, models, length=0.4, mass=MASS)


def test_the_comparison_tells(smooth: Fit) -> None:
    comparison = smooth.comparison
    assert comparison is not None
    assert smooth.damping == comparison.best.damping == "linear"
    assert set(comparison.ruled_out) == {"none", "quadratic"}
    assert comparison.needless == ("linear+quadratic",)
    assert not {*comparison.alike, *comparison.unlikely}
    assert comparison.delta_bic[0] == 0.0
    assert list(comparison.delta_bic[:2]) == sorted(comparison.delta_bic[:2])
    assert comparison.text.startswith(
        f"{smooth.grade.text} Damping: linear fits best; it rules out quadratic and no damping.")
    assert "The dampings linear and bearing have torques of the same shape" in comparison.text
    assert smooth.grade.text.endswith("The fit is usable.")
    head, rows = comparison.table.head, comparison.table.rows
    assert [row[0] for row in rows] == [one.damping for one in comparison.fits]
    assert all(len(row) == len(head) for row in rows)
    assert rows[0][-1] == "best"


def test_the_criterion_by_hand(smooth: Fit) -> None:
    """Compare with n' ln(RSS ratio) + dk ln n', where n' is that of the model with the least squares (Schwarz 1978)."""
    comparison = smooth.comparison
    assert comparison is not None
    squares = {one.damping: float(one.residual @ one.residual) for one in comparison.fits}
    least = comparison[min(squares, key=lambda name: squares[name])]
    n = len(least.residual) / least.correlation_time
    for one, delta in zip(comparison.fits, comparison.delta_bic, strict=True):
        own = n * math.log(squares[one.damping] / squares["linear"]) + (len(one.names) - 5) * math.log(n)
        assert delta == pytest.approx(own, rel=1e-9, abs=1e-9)


def test_the_spread_between_models_is_part_of_the_uncertainty(smooth: Fit) -> None:
    comparison = smooth.comparison
    assert comparison is not None
    both = FitComparison(comparison.fits, (0.0, *(3.0 for _ in comparison.fits[1:])))
    lengths = [one.parameters["length"].value for one in both.fits if not one.solution.lost]
    assert both.spread("length") == max(abs(value - lengths[0]) for value in lengths) > 0.0
    own, whole = both.best.parameters["length"].error, both.measured("length").error
    assert whole == pytest.approx(math.hypot(own, both.spread("length")))


def test_the_envelope_says_more_than_the_rms(smooth: Fit) -> None:
    """Quadratic instead of linear damping is off by several times the noise in the amplitudes."""
    comparison = smooth.comparison
    assert comparison is not None
    assert envelope_misfit(comparison["linear"]) < 1.5 * TENTH
    assert envelope_misfit(comparison["quadratic"]) > 3.0 * envelope_misfit(comparison["linear"])


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:The fit is (not )?usable")
def test_a_light_ball_calls_for_its_own_drag() -> None:
    """Fit a ball of 5 g and 2 cm in air, whose C_d(Re) is between linear and quadratic drag.

    The best model has the calculated drag and no fitted damping parameter; models with such parameters are behind. If
    the drag is not calculated, the best model needs two dampings.
    """
    ball = BOB.replace(mass=0.005)
    ball = ball.with_effects((*ball.effects, FiniteBob(), SphereDrag()))
    run = rollout(ball, integrator="rk4", angle=0.7, velocity=0.0, duration=60.0, dt=0.002, every=10, diagnostics=())
    seen = recorded(run.time, run.angle, noise=TENTH)
    found = fit(seen, scene=ball, length=0.48)
    comparison = found.comparison
    assert comparison is not None
    assert found.damping == "sphere_drag"
    close = {*comparison.needless, *comparison.alike}
    assert {"sphere_drag+linear", "sphere_drag+coulomb", "sphere_drag+linear+coulomb"} <= close
    assert {"linear", "quadratic", "coulomb", "none"} <= set(comparison.ruled_out)
    assert abs(found.parameters["length"].value - 0.5) < 4.0 * found.parameters["length"].error
    plain = fit(seen, length=0.48, mass=0.005)
    assert len(plain.model.damping) > 1


# --- when the data can tell -----------------------------------------------------------------------------------------

TRUE: dict[str, dict[str, float]] = {
    "linear": {"gamma": 0.03},
    "quadratic": {"c": 0.03},
    "coulomb": {"friction": 1.2e-3},
    "linear+quadratic": {"gamma": 0.02, "c": 0.015},
    "linear+coulomb": {"gamma": 0.02, "friction": 5e-4},
    "quadratic+coulomb": {"c": 0.02, "friction": 4e-4},
}
SENSORS = ((0.6, 0.05, 0.0), (0.5, 0.0, 0.1), (0.15, 0.05, 0.25), (0.1, 1.0, 0.0))
"""Amplitude [rad], noise [degrees] and quantum [degrees] of the simulated sensors."""
CERTAIN = 33.0
"""Expected difference of the criteria E for which E - 4 sqrt(E) > 10, as its scatter is 2 sqrt(E)."""
LINEAR = 500.0
"""Largest expected difference for which 2 sqrt(E) is its scatter: misfits below the noise of 1000 readings."""


def study(model: str, angle: float, noise: float, quantum: float, seed: int) -> tuple[dict[str, float], FitComparison]:
    """Return the expected difference of the criterion for every model that lacks a true damping, and the comparison of
    fits."""
    time = even(25.0, 40.0)
    clean = swing(time, angle, length=0.5, **TRUE[model])
    sigma = math.hypot(math.radians(noise), math.radians(quantum) / math.sqrt(12.0))
    own = set(model.split("+"))
    wrong = ["+".join(names) or "none" for names in candidates(BOB, False) if not own <= set(names)]
    truth = fit(Recording(time, clean, "clean"), wrong, length=0.5, mass=MASS).comparison
    seen = recorded(time, clean, noise=math.radians(noise), quantum=math.radians(quantum), seed=seed)
    found = fit(seen, length=0.5, mass=MASS).comparison
    assert truth is not None
    assert found is not None
    n, expected = len(time), {}
    for one in truth.fits:
        more = len(one.model.damping) - len(own)
        expected[one.damping] = n * math.log1p((one.rms / sigma) ** 2) + more * math.log(n)
    return expected, found


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:The fit is (not )?usable")
def test_the_right_model_is_chosen_where_the_data_can_tell() -> None:
    """Check the choice of the model on 24 recordings.

    The right model is never ruled out. A wrong model that should be 33 behind is always ruled out, and every wrong
    model is as far behind as expected, within 4 standard deviations. If all wrong models should be ruled out, the right
    one is best in 9 of 10 cases, else alike. Linear damping and quadratic plus Coulomb damping are nearly the same.
    """
    certain_count, best, verdicts = 0, [], []
    for i, model in enumerate(TRUE):
        for j, (angle, noise, quantum) in enumerate(SENSORS):
            expected, found = study(model, angle, noise, quantum, 10 * i + j)
            verdict = {one.damping: word for one, word in zip(found.fits, found.verdicts, strict=True)}
            behind = {one.damping: delta for one, delta in zip(found.fits, found.delta_bic, strict=True)}
            for wrong, size in expected.items():
                if not found[wrong].solution.lost and size < LINEAR:
                    off = behind[wrong] - behind[model] - size
                    assert abs(off) < 4.0 * math.sqrt(4.0 * max(size, 0.0) + 9.0), (model, angle, wrong, off, size)
            certain = [wrong for wrong, size in expected.items() if size > CERTAIN]
            certain_count += len(certain)
            assert all(verdict[wrong] == "ruled out" for wrong in certain), (model, angle, verdict)
            verdicts.append(verdict[model])
            if len(certain) == len(expected):
                best.append(found.best.damping == model)
                assert verdict[model] in ("best", "alike"), (model, angle, verdict)
    assert "ruled out" not in verdicts
    assert certain_count > 60
    assert len(best) >= 5
    assert sum(best) >= 0.9 * len(best)
