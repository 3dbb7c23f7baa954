"""Tests of the warning about formulas that do not hold at a run's speed: once per run, with the effect's name."""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Callable
from functools import partial
from typing import Any

import gymnasium as gym
import mpmath
import numpy as np
import pytest

import pendulum_env
from pendulum_env import SCENES, Scene, rollout
from pendulum_env.engine.limits import beyond
from pendulum_env.physics.body import Body
from pendulum_env.physics.drag_laws import LAWS
from pendulum_env.physics.effects import (
    AddedMass,
    Effect,
    Gravity,
    Gusts,
    HorizontalDrive,
    LinearDrag,
    Motor,
    QuadraticDrag,
    SphereDrag,
    Wind,
    WireDrag,
)
from pendulum_env.physics.medium import Medium, air
from pendulum_env.physics.scene import Run

OIL = Medium("oil", density=1000.0, viscosity=0.1)
BALL = Body(length=1.0, mass=10.0, radius=0.05)
"""Bob whose Reynolds number in OIL is 1000 times its speed [m/s]."""
FAST, SLOW = 2.0 * math.asin(0.3 / math.sqrt(9.81)), 1e-4 / math.sqrt(9.81)
"""Initial angles with speeds of 0.6 m/s and 1e-4 m/s at the bottom: 2 sqrt(g/L) L sin(A/2)."""


run = partial(rollout, backend="python")


def ball(*effects: Any, angle: float = FAST) -> Scene:
    return Scene("ball", BALL, OIL, (Gravity(), *effects), 9.81, Run(angle=angle, duration=0.1))


STOKES, STEADY = ball(LinearDrag()), ball(QuadraticDrag(drag_coefficient=0.45))


def texts(make: Any) -> list[str]:
    """Return the texts of the warnings of a call."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        make()
    assert all(entry.category is UserWarning for entry in caught)
    return [str(entry.message) for entry in caught]


def test_a_rollout_warns_once_and_says_what_is_done() -> None:
    (text,) = texts(lambda: run(STOKES))
    assert text == (
        "In the scene 'ball', up to 0.6 m/s at the bottom, formulas do not hold: linear_drag (Re reaches 600, but "
        "Stokes' law holds up to Re = 1; it is used all the same, and the drag is too small)."
    )
    assert texts(lambda: run(STOKES, warn=False)) == []


def test_the_warning_points_to_the_caller() -> None:
    with pytest.warns(UserWarning, match="linear_drag") as caught:
        run(STOKES)
    assert caught[0].filename == __file__


def test_it_is_the_given_start_that_counts() -> None:
    """Check that the warning depends on the given start: at Re = 0.1 Stokes' law holds, at 600 a constant C_d does."""
    assert texts(lambda: run(STOKES, angle=SLOW)) == []
    assert texts(lambda: run(STEADY)) == []
    (text,) = texts(lambda: run(STEADY, angle=SLOW))
    assert "quadratic_drag (Re reaches only 0.1, " in text
    assert texts(lambda: run(STEADY, angle=SLOW, velocity=-0.6)) == []
    assert len(texts(lambda: run(STOKES, angle=SLOW, velocity=-0.6))) == 1


def test_every_effect_that_does_not_hold_is_in_one_warning() -> None:
    scene = ball(AddedMass(boundary_layer=True), SphereDrag("schiller_naumann"), WireDrag())
    text, steps = texts(lambda: run(scene, velocity=1e5))
    assert "are too long for rk4" in steps
    assert [text.count(f"{name} (") for name in ("added_mass", "sphere_drag", "wire_drag")] == [1, 1, 1]
    assert f"fitted up to Re = {LAWS['schiller_naumann'].most:g}; its formula is used all the same" in text


def test_of_a_batch_the_first_is_named() -> None:
    angles = [SLOW, SLOW, FAST, FAST]
    (text,) = texts(lambda: run(STOKES, angle=angles))
    assert text.startswith("In run 2 of 4, in the scene 'ball', up to 0.6 m/s")
    (text,) = texts(lambda: run(STEADY, angle=np.array(angles).reshape(2, 2), velocity=0.0))
    assert text.startswith("In run 0 of 4, ")
    assert texts(lambda: run(STOKES, angle=[SLOW, -SLOW])) == []
    (text,) = texts(lambda: run(STOKES, length=[0.5, 1.0]))
    assert text.startswith("In run 0 of 2, ")
    (text,) = texts(lambda: run(STOKES, angle=SLOW, radius=[0.05, 0.06, 0.6, 0.7]))
    assert text.startswith("In run 2 of 4, ")
    assert texts(lambda: run(STOKES, angle=SLOW, radius=[0.05, 0.06, 0.6, 0.7], warn=False)) == []


def test_environments_warn_when_made() -> None:
    (text,) = texts(lambda: pendulum_env.LabPendulumEnv(STOKES, backend="python", task="free"))
    assert text.startswith("In the scene 'ball', up to 0.6 m/s")
    (text,) = texts(lambda: pendulum_env.LabPendulumVectorEnv(3, STOKES, backend="python", task="free"))
    assert text.startswith("In the scene 'ball', up to 0.6 m/s")
    slow = ball(LinearDrag(), angle=SLOW)

    def with_radii(*radii: float) -> list[str]:
        return texts(lambda: pendulum_env.LabPendulumVectorEnv(3, slow, backend="python", task="free", radius=radii))

    (text,) = with_radii(0.05, 0.7, 0.8)
    assert text.startswith("In environment 1 of 3, in the scene 'ball', up to 0.0001")
    assert with_radii(0.05, 0.06, 0.07) == []


def test_steps_and_resets_say_nothing_more() -> None:
    with pytest.warns(UserWarning, match="linear_drag"):
        env = pendulum_env.LabPendulumEnv(STOKES, backend="python", task="free")

    def episode() -> None:
        env.reset(options={"angle": 1.0})
        env.step(np.zeros(1, dtype=np.float32))

    assert texts(episode) == []


def test_where_a_drive_may_make_it_faster_only_what_no_speed_helps_is_told() -> None:
    """Check that with a motor or a wind only formulas are named that fail at all higher speeds, too."""
    for drive in (Motor(), Wind(1.0)):
        steady, stokes = (ball(drag, drive) for drag in (QuadraticDrag(drag_coefficient=0.45), LinearDrag()))
        assert beyond(steady, 1e-4, control=True) == ""
        assert beyond(stokes, 0.6, control=True).startswith("linear_drag (Re reaches 600")
        assert beyond(steady, 1e3, control=True).startswith("quadratic_drag (Re reaches even 1e+06")
    idle = ball(QuadraticDrag(drag_coefficient=0.45), Motor(), angle=SLOW)
    assert len(texts(lambda: run(idle))) == 1
    assert texts(lambda: run(idle, control=0.1)) == []
    assert texts(lambda: pendulum_env.LabPendulumEnv(idle, backend="python", task="free")) == []


@pytest.mark.quick("lab", "windy", "driven", "kapitza", "torsion")
@pytest.mark.parametrize("name", SCENES)
def test_no_preset_warns_in_its_usual_run(name: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run(name, duration=SCENES[name].run.dt)
        gym.make("LabPendulum-v0", scene=name, backend="python", task="free", substeps=4)
        gym.make_vec("LabPendulum-v0", num_envs=2, scene=name, backend="python", task="free", substeps=4)


def test_an_audit_says_it_in_its_table_alone() -> None:
    """Check that an audit reports a formula that does not hold in its table and gives no warning for its runs."""
    audits = []
    options = {"amplitude": FAST, "tolerance": 1e-2, "backend": "python"}
    assert texts(lambda: audits.append(pendulum_env.audit(STOKES, effects=["linear_drag"], **options))) == []
    (row,) = audits[0].rows
    assert row.verdict == "outside its validity"
    assert "Stokes' law holds up to Re = 1" in row.note


def test_a_drag_coefficient_of_another_run_is_told() -> None:
    """Check the warning about a C_d from another Re: 0.40 at 2600, 0.7 to 0.8 at 230 (Clift, Grace & Weber 1978)."""
    def at(degrees: float, damping: Any) -> list[str]:
        return texts(lambda: pendulum_env.rollout("exercise", damping=damping, angle=math.radians(degrees), dt=0.01,
                                                 duration=0.01, backend="python"))

    (text,) = at(60.0, "quadratic")
    assert re.search(r"C_d = 0\.7\d is that of Re = 23\d\.\d in .* usual run, and at Re = 26\d\d C_d is 0\.4", text)
    assert text.endswith("give drag_coefficient or use sphere_drag).")
    assert at(60.0, {"quadratic": {"drag_coefficient": 0.4}}) == at(60.0, "sphere_drag") == []
    (text,) = at(5.0, "quadratic")  # below where C_d is steady, as before
    assert "nearly constant only from Re = 500" in text


def test_a_bob_at_rest_is_not_judged() -> None:
    assert texts(lambda: run(STEADY, angle=0.0)) == []


# --- wire drag in moving air ------------------------------------------------------------------------------------------


@pytest.mark.quick("motion1")
@pytest.mark.parametrize("motion", [(Wind(2.5),), (Wind(-1.0), Gusts(0.5)), (HorizontalDrive(0.05, 30.0),)])
def test_the_size_of_the_error_of_wire_drag_in_moving_air_is_named(motion: tuple[Effect, ...]) -> None:
    """The truth is the torque of a uniform flow on each piece of a resting wire, added up by mpmath's quadrature."""
    body = Body(0.4, 0.03, 0.01, thickness=0.001)
    wind = 2.5 if motion == (Wind(2.5),) else 1.5
    rho, nu = air(20.0).density, air(20.0).viscosity / air(20.0).density

    def moment(share: Callable[[Any], Any]) -> float:
        """Return the torque over rho d u**2/2, where the air moves at ``share(s)`` times u at the distance s."""
        def piece(s: Any) -> Any:
            reynolds = wind * share(s) * body.diameter / nu
            return s * share(s) ** 2 * (1 + 10 / mpmath.cbrt(reynolds) ** 2)

        return float(mpmath.quad(piece, [0, mpmath.mpf(0.4)]))

    used = moment(lambda s: s / 0.4)
    factor = moment(lambda s: 1) / used
    (text,) = texts(lambda: run(Scene("wired", body, air(20.0), (Gravity(), WireDrag(), *motion))))
    assert f"air of {wind:.3g} m/s, the true torque of wire_drag is {factor:.3g} times that of the formula" in text
    assert f"losses together {factor:.3g} times" in text
    assert WireDrag().understated(Scene("wired", body, air(20.0), (Gravity(), WireDrag())), wind / 0.4) == (
        pytest.approx(factor, rel=1e-12))
    # With a second loss, of the bob, the error is a smaller part of all losses.
    both = (Gravity(), WireDrag(), QuadraticDrag(drag_coefficient=0.45), *motion)
    (text,) = texts(lambda: run(Scene("wired", body, air(20.0), both)))
    wire, bob = used * rho * body.diameter / 2 * wind**2, 0.45 * rho / 2 * math.pi * 0.01**2 * wind**2 * 0.4
    assert f"losses together {1 + (factor - 1) * wire / (wire + bob):.3g} times" in text


def test_wire_drag_in_still_air_and_beside_large_losses_is_no_cause_for_a_warning() -> None:
    body = Body(0.4, 0.03, 0.05, thickness=1e-4)
    assert texts(lambda: run(Scene("still", body, air(20.0), (Gravity(), WireDrag())))) == []
    loss = QuadraticDrag(drag_coefficient=0.45)
    assert texts(lambda: run(Scene("bob", body, air(20.0), (Gravity(), loss, WireDrag(), Wind(2.5))))) == []
