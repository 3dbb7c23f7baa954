"""Tests of events and dense output of rollouts, against closed forms, references and runs with shorter steps."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import mpmath
import numpy as np
import pytest
from choice import FITS, chosen

import integrators
from integrators import Event, MethodError
from pendulum_env import SCENES, Scene, SceneError, rollout
from pendulum_env.engine.motion import EVENTS
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import CoulombFriction, Gravity
from pendulum_env.physics.flow import quality_factor
from pendulum_env.truth.pieces import extrapolated, path, problem_of

pytestmark = pytest.mark.usefixtures("all_interpreted")
QUARTER = float(mpmath.ellipk(mpmath.sin(mpmath.mpf("0.5")) ** 2))
"""Quarter of a period from 1 rad, in units of 1/omega0."""
CASES = sorted({(chosen([scene for scene in SCENES if (scene, method) in FITS], method), method)
                for method in integrators.METHODS} | {(scene, "rk4") for scene in SCENES})
"""Each method in one scene, and rk4 in each scene; other pairs share all that is tested here."""


@pytest.mark.parametrize("method", ["dop853", *(
    pytest.param(name, marks=pytest.mark.slow) for name in ("verner9", "gauss6"))])
def test_turning_points_and_passages_are_the_elliptic_integrals(method: str) -> None:
    run = rollout("vacuum", integrator=method, angle=1.0, velocity=0.0, dt=0.005, duration=6.0,
                  events=["turning", Event("bottom", direction=-1)])  # type: ignore[arg-type]
    quarter = QUARTER / SCENES["vacuum"].omega0
    assert run.t_events[0] == pytest.approx(2 * quarter * np.arange(1, len(run.t_events[0]) + 1), rel=1e-13)
    assert run.t_events[1] == pytest.approx(quarter * (4 * np.arange(len(run.t_events[1])) + 1), rel=1e-13)


@pytest.mark.slow
def test_tops_and_periods() -> None:
    spun = rollout("vacuum", integrator="dop853", angle=0.0, velocity=15.0, dt=0.005, duration=2.0,
                   events=("top", "bottom"))
    omega0 = SCENES["vacuum"].omega0
    turn = 4.0 / 15.0 * float(mpmath.ellipk((2.0 * omega0 / 15.0) ** 2))  # time of a whole turn
    assert spun.t_events[0] == pytest.approx(turn * (np.arange(len(spun.t_events[0])) + 0.5), rel=1e-12)
    assert spun.t_events[1] == pytest.approx(turn * np.arange(1, len(spun.t_events[1]) + 1), rel=1e-12)
    driven = rollout("driven", duration=20.0, events="period")
    period = 2.0 * math.pi / 5.0  # the scene's horizontal_rate [rad/s]
    assert driven.t_events[0] == pytest.approx(period * np.arange(1, len(driven.t_events[0]) + 1), rel=1e-13)


def fastest(place: Scene) -> float:
    """Return the largest rate of a scene: of its swing, its drives and its damping [1/s]."""
    rates = [place.coefficients[effect.beat] for effect in place.effects if effect.beat]
    return max(place.omega0, place.omega0 / quality_factor(place, place.run.angle + 0.1), *rates)


@pytest.mark.quick(
    "lab-rk4", "windy-rk4", "kapitza-gauss8", "vacuum-forest_ruth", "driven-tsit5", "gymnasium-rkn43",
    "sticky_bearing-rk4", "rod-generalized_alpha", "chaotic-backward_euler"
)
@pytest.mark.parametrize(("scene", "method"), CASES)
@pytest.mark.filterwarnings("ignore")
def test_the_motion_between_steps_is_that_of_shorter_steps(scene: str, method: str) -> None:
    """A run of dop853 with a quarter of the step is the truth; records keep their bits.

    An event where the angle passes that of the truth in the middle of a step is found at the time of that record. Of
    the steps in the middle of the run it is the one with the largest velocity, far from the turning point.
    """
    place, tried = SCENES[scene], integrators.get(method)
    h, start = 0.05 / fastest(place), (place.run.angle + 0.1, place.run.velocity + 0.2 * place.omega0)
    options: dict[str, Any] = {"angle": start[0], "velocity": start[1], "duration": 10 * h, "backend": "python",
                               "seed": 3}
    plain = rollout(place, integrator=method, dt=h, substeps=10, **options)
    truth = rollout(place, integrator="dop853", dt=h / 4, substeps=40, **options)

    middle = max(range(10, 34, 4), key=lambda record: abs(float(truth.velocity[record])))

    def passing(t: float, angle: float, velocity: float) -> float:
        return angle - float(truth.angle[middle])

    run = rollout(place, integrator=method, dt=h, substeps=10, dense=True, events=["turning", passing], **options)
    assert run.angle.tolist() == plain.angle.tolist()
    assert run.energy_residual.tolist() == plain.energy_residual.tolist()
    at_records = run(run.time)
    assert at_records[0] == pytest.approx(plain.angle, abs=1e-14)
    angle, velocity = run(truth.time)
    size = abs(start[0]) + abs(start[1]) / place.omega0 + 0.1
    allowed = 4.0 * size * 0.05 ** min(tried.order, tried.dense_order) + (3e-5 if place.has("wire_drag") else 1e-8)
    assert abs(angle - truth.angle).max() < allowed
    assert abs(velocity - truth.velocity).max() < allowed * fastest(place) * 5.0
    assert abs(run.t_events[1] - truth.time[middle]).min() < 2.0 * allowed / abs(truth.velocity[middle])


@pytest.mark.slow
@pytest.mark.parametrize("method", ["rk4", "velocity_verlet", "dop853"])
def test_dry_friction_in_pieces_between_stops(method: str) -> None:
    """The stops of a plain bearing's swing, and the state between, against a reference in pieces."""
    scene = SCENES["sticky_bearing"]
    times = np.linspace(0.0, 8.0, 641)[1:-1]
    truth = np.array(path(problem_of(scene), extrapolated(), (0.3, 0.0), times))
    errors = []
    for h in (0.04, 0.02):
        run = rollout(scene, integrator=method, angle=0.3, velocity=0.0, dt=h, duration=8.0, dense=True)
        angle, velocity = run(times)
        errors.append((abs(angle - truth[:, 0]).max(), abs(velocity - truth[:, 1]).max()))
        ends = run.dense.curves  # type: ignore[union-attr]
        assert all(late.t > early.t for early, late in pairwise(ends))
    order = min(integrators.get(method).order, 4)
    assert errors[1][0] < 2.0**-order * 1.6 * errors[0][0] + 1e-8
    assert errors[1][1] < 2.0**-order * 1.6 * errors[0][1] + 1e-7


def test_a_bob_that_sticks_rests_and_turns_where_friction_says() -> None:
    """Without gravity's curvature: q'' = -omega0² q -+ f, each half swing shorter by 2 f/omega0² (Coulomb)."""
    body = Body(length=1.0, mass=1.0, radius=0.01)
    scene = Scene(body=body, effects=(Gravity(), CoulombFriction(friction_torque=0.2)))
    run = rollout(scene, integrator="dop853", angle=0.05, velocity=0.0, dt=0.01, duration=6.0, dense=True,
                  events="turning")
    assert run(5.9)[1] == 0.0
    assert abs(run(5.9)[0]) <= 0.2 / scene.omega0**2 / scene.inertia + 1e-6
    assert run(5.5) == run(5.9)
    assert len(run.t_events[0]) <= 2


def test_a_terminal_event_ends_the_run_there() -> None:
    quarter = QUARTER / SCENES["vacuum"].omega0
    run = rollout("vacuum", integrator="dop853", angle=1.0, velocity=0.0, dt=0.01, duration=9.0, every=30,
                  events=Event("bottom", terminal=2), dense=True)  # type: ignore[arg-type]
    assert run.stop_reason == "event"
    assert run.stop_time == run.time[-1] == run.t_events[0][-1] == pytest.approx(3 * quarter, rel=1e-13)
    assert (run.angle[-1], run.velocity[-1]) == (run.angle_events[0][-1], run.velocity_events[0][-1])
    assert abs(run.energy_residual[-1]) < 1e-13
    with pytest.raises(MethodError, match="is not between"):
        run(run.stop_time + 0.1)
    for length in (0.2, 0.3, 0.4, 0.5):
        short = rollout("lab", angle=0.5, length=length, velocity=0.0, dt=0.01, duration=3.0,
                        events=Event("bottom", terminal=2))  # type: ignore[arg-type]
        assert short.stop_time == short.time[-1] == short.t_events[0][-1]
    lossy = rollout("lab", angle=1.0, velocity=0.0, dt=0.01, duration=9.0, events=Event("turning", terminal=3),
                    diagnostics=("heat_by_effect",))  # type: ignore[arg-type]
    assert abs(lossy.energy_residual[-1]) < 1e-8
    assert lossy.ledger.heat[-1] == pytest.approx(sum(heat[-1] for heat in lossy.heat_by_effect.values()))


def test_a_run_that_ends_by_slack_has_its_motion_up_to_there() -> None:
    options: dict[str, Any] = {"integrator": "dop853", "angle": 0.0, "dt": 0.01, "duration": 2.0}
    for velocity in (9.0, 10.0):
        plain = rollout("exercise_large", velocity=velocity, **options)
        run = rollout("exercise_large", velocity=velocity, events="top", dense=True, **options)
        assert (plain.stop_reason, plain.stop_time) == (run.stop_reason, run.stop_time)
        assert run.stop_reason == "slack"
        assert run.angle.tolist() == plain.angle.tolist()
        assert run(run.stop_time) == (run.angle[-1], run.velocity[-1])
    over = rollout("exercise_large", angle=math.pi, velocity=0.1, dt=0.01, duration=1.0, dense=True)
    assert (over.stop_reason, over.stop_time, len(over.time)) == ("slack", 0.0, 1)


@pytest.mark.slow
def test_batches_have_the_events_of_their_single_runs() -> None:
    angles, lengths = np.array([[0.5, 1.0], [2.0, 3.0]]), np.array([[0.2, 0.3], [0.4, 0.5]])
    options: dict[str, Any] = {"velocity": 0.0, "dt": 0.01, "duration": 3.0, "every": 9,
                               "events": [Event("bottom", terminal=2), "turning"]}
    batch = rollout("lab", angle=angles, length=lengths, **options)
    assert batch.t_events[0].shape == (2, 2)
    for place in np.ndindex(2, 2):
        alone = rollout("lab", angle=float(angles[place]), length=float(lengths[place]), **options)
        assert batch.t_events[0][place].tolist() == alone.t_events[0].tolist()
        assert batch.velocity_events[1][place].tolist() == alone.velocity_events[1].tolist()
        assert batch.stop_time[place] == alone.stop_time  # type: ignore[index]
        before = batch.time <= alone.stop_time
        assert batch.angle[place][before].tolist() == alone.angle[: before.sum()].tolist()
        assert np.isnan(batch.angle[place][~before]).all()


@pytest.mark.parametrize(("options", "said"), [
    ({"events": "botom"}, "There is no event 'botom'; did you mean bottom"),
    ({"events": "period"}, "The event 'period' needs one drive, but the scene 'lab' has 0"),
    ({"events": "top", "scene": "exercise"}, "The event 'top' needs torques that are periodic in the angle"),
    ({"events": lambda t, angle, velocity: math.nan}, "must return one finite real number, not nan"),
    ({"events": 7}, "events must be functions g"),
    ({"dense": 1}, "dense must be True or False, not 1"),
    ({"dense": True, "angle": np.zeros(3)}, "dense=True is for single runs"),
    ({"events": Event("top", terminal=True), "estimate_error": True},  # type: ignore[arg-type]
     "estimate_error cannot be combined with an event that ends the run"),
])
def test_bad_input_is_refused_in_a_sentence(options: dict[str, Any], said: str) -> None:
    with pytest.raises((SceneError, MethodError), match=said):
        rollout(**{"scene": "lab", "duration": 0.1, **options})


@pytest.mark.parametrize("function", ["bottom", lambda t, angle, velocity: angle])
def test_actions_are_refused(function: Any) -> None:
    event = Event(function, action=lambda t, angle, velocity: (angle, -velocity))
    with pytest.raises(SceneError, match=r"has an action, which a run of a scene does not take"):
        rollout("vacuum", dt=0.01, duration=0.1, events=[event])


def test_every_event_name_is_documented() -> None:
    assert all(f'"{name}"' in str(rollout.__doc__) for name in EVENTS)
    with pytest.raises(MethodError, match="pass dense=True to rollout"):
        rollout("lab", duration=0.1)(0.05)
