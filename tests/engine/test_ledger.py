"""Tests of the energy ledger: its residual, and its work and heats against a trajectory of high precision."""

from __future__ import annotations

import math
import re
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from choice import chosen, kind, rolled
from nystrom_truths import NYSTROM
from runge_kutta_truths import rounding
from scipy.integrate import solve_ivp
from splitting_truths import TRUTHS

import integrators
from pendulum_env import SCENES, Scene, rollout
from pendulum_env.engine.machine import fitting
from pendulum_env.physics.damping import with_damping
from pendulum_env.physics.energy import Ledger
from pendulum_env.truth.reference import reference

CASES: dict[str, tuple[Scene, dict[str, Any]]] = {
    "vacuum": (SCENES["vacuum"], {"angle": 1.0}),
    "linear": (SCENES["exercise_large"], {"angle": 1.0}),
    "motor and both drags": (SCENES["lab"], {"angle": 1.0, "control": 0.5}),
    "strong quadratic": (with_damping(SCENES["lab"], {"quadratic": {"c": 0.3}}), {"angle": 1.0, "control": 0.5}),
    "dry": (SCENES["sticky_bearing"], {"angle": 1.0, "control": 0.5}),
    "dry and strong": (SCENES["sticky_bearing"].replace(friction_torque=0.02), {"angle": 1.0, "control": 0.5}),
}
PAIRS = [(case, method) for case, (scene, _) in CASES.items() for method in fitting(scene)]
DAMPED = [(case, method) for case, method in PAIRS if case != "vacuum"]
BOOKED = [(case, method) for case, method in DAMPED
          if kind(method) == method or case == chosen([each for each, name in DAMPED if name == method], method)]
DURATION = 3.0
# These methods reach their order only at small steps: another error term hides the slope at larger ones.
COARSEST = {
    ("strong quadratic", "midpoint"): 0.005,
    ("strong quadratic", "heun"): 0.0025,
    ("strong quadratic", "ralston"): 0.0025,
    ("dry", "rk4_38"): 0.02,
    ("dry and strong", "heun"): 0.0025,
}


@lru_cache
def truth(case: str) -> dict[str, float]:
    """Return motion, work and heats from DOP853 at 1e-13, restarted at every zero of the velocity."""
    scene, start = CASES[case]
    angle, control = start["angle"], start.get("control", 0.0)
    inertia, k = scene.inertia, scene.coefficients
    linear, quadratic = k.get("linear_drag_rate", 0.0), k.get("quadratic_drag_rate", 0.0)
    drive, dry = control * k.get("motor_rate", 0.0), k.get("dry_limit", 0.0)

    def slope(t: float, y: Any, side: float) -> list[float]:
        q, v = y[0], y[1]
        a = drive - k["gravity_rate"] * np.sin(q) - linear * v - quadratic * side * v * v - side * dry
        return [v, a, drive * v, quadratic * side * v**3, linear * v * v, dry * side * v]

    def stopped(t: float, y: Any, side: float) -> float:
        return float(y[1])

    stopped.terminal = True  # type: ignore[attr-defined]
    t, y = 0.0, np.array([angle, 0.0, 0.0, 0.0, 0.0, 0.0])
    while t < DURATION:
        other = drive - k["gravity_rate"] * np.sin(y[0])
        if abs(other) <= dry:
            break
        side = np.sign(other)
        stopped.direction = -side  # type: ignore[attr-defined]
        run = solve_ivp(slope, (t, DURATION), y, "DOP853", args=(side,), rtol=1e-13, atol=1e-15, events=stopped)
        t, y = run.t[-1], run.y[:, -1]
        y[1] = 0.0 if run.status == 1 else y[1]
    names = ("work", "quadratic_drag", "linear_drag", "coulomb_friction")
    return {"angle": y[0], **{name: inertia * value for name, value in zip(names, y[2:], strict=True)}}


def runs(case: str, method: str, steps: tuple[float, ...]) -> list[Any]:
    scene, start = CASES[case]
    options = {"duration": DURATION, "diagnostics": ("energy", "heat_by_effect"), **start}
    return [rolled(scene, integrator=method, dt=h, **options) for h in steps]


def rounded(method: str, scene: Scene, h: float) -> float:
    """Return the allowed rounding error of a run with steps of ``h`` [s], relative to the energy."""
    chosen, steps = integrators.get(method), DURATION / h
    several = chosen.implicit or method in NYSTROM
    parts = len(chosen.flows) if method in TRUTHS else chosen.evaluations if several else 0
    parts += chosen.family == "Taylor"
    alike = 1e-16 if chosen.family == "exact" else 0.0
    return steps * (alike + rounding(chosen, scene.omega0 * h)) + 2e-16 * float(np.sqrt(parts * steps))


def kink(method: str, scene: Scene, h: float) -> float:
    """Return the error, relative to the energy, due to the jump in the second derivative of |v| v.

    The jump is at every turning point. A series continues the side on which its step began, and the jump stays in a
    multistep method's history for several steps.
    """
    chosen, rate = integrators.get(method), scene.coefficients.get("quadratic_drag_rate", 0.0)
    lasting = method in TRUTHS or chosen.family == "Taylor" or isinstance(chosen, integrators.Multistep)
    share = 0.1 if lasting else 1e-3 if chosen.implicit else 0.0
    return share * rate * (scene.omega0 * h) ** 3 if chosen.order > 4 else 0.0


@pytest.mark.quick(
    "vacuum-rk4", "linear-symplectic_euler", "motor and both drags-rk4", "strong quadratic-backward_euler",
    "dry-gauss4", "dry and strong-forward_euler", "motor and both drags-velocity_verlet"
)
@pytest.mark.parametrize(("case", "method"), PAIRS)
def test_residual_shrinks_at_least_at_the_methods_order(case: str, method: str) -> None:
    order = integrators.get(method).order
    coarsest = COARSEST.get((case, method), 0.01)
    steps = (coarsest, coarsest / 2, coarsest / 4)
    rollouts = runs(case, method, steps)
    residuals = [float(np.max(np.abs(r.energy_residual))) for r in rollouts]
    slopes = np.log2(np.array(residuals[:-1]) / np.array(residuals[1:]))
    scene, h = CASES[case][0], steps[-1]
    left = (rounded(method, scene, h) + kink(method, scene, h)) * rollouts[-1].energy[0]
    assert slopes[-1] > order - 0.15 or residuals[-1] < 1e-15 + left, (residuals, slopes)


@pytest.mark.quick(
    "linear-symplectic_euler", "motor and both drags-velocity_verlet", "strong quadratic-forest_ruth", "dry-rk4",
    "dry and strong-backward_euler"
)
@pytest.mark.parametrize(("case", "method"), BOOKED)
def test_work_and_each_heat_are_true(case: str, method: str) -> None:
    """Check that the error of work and of every heat is within 3 (omega0 h)^order of the exchanged energies.

    In every case every kind of method, and every method in one case.
    """
    scene, wanted = CASES[case][0], truth(case)
    h = 0.001
    (r,) = runs(case, method, (h,))
    exchanged = r.energy[0] + sum(abs(value) for name, value in wanted.items() if name != "angle")
    own = 3.0 * (scene.omega0 * h) ** integrators.get(method).order
    # The factor exp(-gamma h) of a drag has the same rounding error in every step.
    alike = 5e-18 * len(getattr(integrators.get(method), "flows", ())) * DURATION / h
    allowed = exchanged * (own + 1e-12 + alike + rounded(method, scene, h) + kink(method, scene, h))
    assert abs(r.ledger.work[-1] - wanted["work"]) <= allowed
    for effect in scene.of_kind("dissipative"):
        assert abs(r.heat_by_effect[effect.name][-1] - wanted[effect.name]) <= allowed, effect.name


@pytest.mark.parametrize("method", fitting(SCENES["sticky_bearing"]))
def test_heat_never_falls_in_still_air(method: str) -> None:
    r = rolled("sticky_bearing", integrator=method, control=0.3, angle=1.5, duration=5.0, dt=0.002,
               diagnostics=("energy", "heat_by_effect"))
    for heat in (r.ledger.heat, *r.heat_by_effect.values()):
        assert np.min(np.diff(heat)) >= 0.0


@pytest.mark.slow
def test_numerical_growth_is_never_booked_as_heat_or_work() -> None:
    """Check that forward Euler's energy growth in an undriven scene is in the residual, not in work or heat."""
    r = rollout("exercise", integrator="forward_euler")
    assert np.all(r.ledger.work == 0.0)
    assert np.all(r.ledger.heat == 0.0)
    assert r.energy_residual[-1] == pytest.approx(r.energy[-1] - r.energy[0], rel=1e-12)


def test_the_ledger_adds_up() -> None:
    ledger = Ledger(kinetic=1.0, potential=2.0, work=0.75, heat=0.5, initial=2.5)
    assert ledger.energy - ledger.initial == ledger.work - ledger.heat + ledger.residual
    assert not ledger.absurd(1.0)
    assert Ledger(1000.0, 0.0, 0.0, 0.0, 1.0).absurd(1.0)


@pytest.mark.slow
def test_strong_quadratic_drag_costs_rk4_an_order() -> None:
    """Check that rk4 has order 3 with strong quadratic drag, whose second derivative jumps at v = 0."""
    scene = with_damping(SCENES["vacuum"], {"quadratic": {"c": 1.0}})
    errors = []
    for k in range(6):
        r = rollout(scene, angle=1.5, velocity=0.3, dt=0.05 / 2**k, every=2**k, duration=6.0, backend="python")
        errors.append(np.max(np.abs(r.angle - reference(scene, 1.5, 0.3, r.time).angle)))
    assert 2.7 < np.log2(errors[0] / errors[-1]) / 5 < 3.4


# --- what a residual says ---------------------------------------------------------------------------------------------


def test_a_motion_can_be_wrong_without_a_residual() -> None:
    """The implicit midpoint rule keeps a spring's energy to rounding, and turns by 2 atan(z/2) a step, not by z."""
    z, steps = 0.1, 200
    scene = SCENES["textbook"]
    run = rollout(scene, integrator="implicit_midpoint", angle=0.3, velocity=0.0, dt=z / scene.omega0,
                  duration=steps * z / scene.omega0, backend="python")
    phase = 2.0 * math.atan(0.5 * z)
    assert run.angle[-1] == pytest.approx(0.3 * math.cos(steps * phase), abs=1e-12)
    assert abs(run.angle[-1] - 0.3 * math.cos(steps * z)) > 1e-3
    assert np.abs(run.energy_residual).max() < 1e-13 * run.energy[0]


def test_no_text_takes_the_residual_for_the_error_of_the_motion() -> None:
    root = Path(__file__).resolve().parents[2]
    paths = [path for folder in ("integrators", "pendulum_env", "examples") for kind in ("*.py", "*.md")
             for path in (root / folder).rglob(kind)]
    claim = re.compile(r"residual[^.;|]{0,80}\b(integrator|method)'s\s+own\s+error")
    texts = {path: path.read_text(encoding="utf-8") for path in (root / "README.md", *paths)}
    assert [path.name for path, text in texts.items() if claim.search(text)] == []
