"""Reference solutions of studies against closed forms, energy integrals and mpmath's Taylor series."""

import math
from dataclasses import replace

import mpmath
import numpy as np
import pytest

from pendulum_env.auto.probes import CHECK
from pendulum_env.physics import exact
from pendulum_env.physics.effects import CoulombFriction, Gravity, LinearDrag, QuadraticDrag, SmallAngleGravity
from pendulum_env.physics.presets import SCENES
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError
from pendulum_env.truth.pieces import doubled, extrapolated, problem_of
from pendulum_env.truth.reference import StudyError, reference

VACUUM = SCENES["vacuum"]
TIMES = np.linspace(0.0, 10.0, 81)


def of(*effects) -> Scene:
    """Return the scene `vacuum` (1 m, 1 kg, g = 9.81) with other effects."""
    return VACUUM.with_effects(effects)


def numerical(*effects) -> Scene:
    """Return the motion without a closed form, by adding a quadratic drag of zero."""
    return of(*effects, QuadraticDrag(c=0.0))


@pytest.mark.parametrize(
    ("scene", "expected", "how"),
    [
        (SCENES["textbook"], lambda w: exact.linear(TIMES, 1.2, -0.3, w), "harmonic oscillator"),
        (of(SmallAngleGravity(), LinearDrag(gamma=0.7)), lambda w: exact.linear(TIMES, 1.2, -0.3, w, 0.7), "harmonic"),
        (VACUUM, lambda w: exact.pendulum(TIMES, 1.2, -0.3, w), "elliptic"),
        (of(LinearDrag(gamma=0.7)), lambda w: exact.linear(TIMES, 1.2, -0.3, 0.0, 0.7), "harmonic"),
    ],
)
def test_closed_forms_are_used_where_they_hold(scene, expected, how):
    found = reference(scene, 1.2, -0.3, TIMES)
    angle, velocity = expected(math.sqrt(9.81))
    np.testing.assert_allclose(found.angle, angle, rtol=0, atol=found.error_estimate)
    np.testing.assert_allclose(found.velocity, velocity, rtol=0, atol=5 * found.error_estimate)
    assert how in found.how
    assert found.error_estimate < 1e-13


def test_drag_alone_has_its_closed_form():
    found = reference(of(LinearDrag(gamma=0.4), QuadraticDrag(c=0.3)), 0.5, 20.0, TIMES)
    way, speed = exact.drag_only(TIMES, 20.0, 0.4, 0.3)
    np.testing.assert_array_equal(found.angle, 0.5 + way)
    np.testing.assert_array_equal(found.velocity, speed)


@pytest.mark.quick("libration", "damped")
@pytest.mark.parametrize(
    ("effects", "start", "expected"),
    [
        ((Gravity(),), (1.0, 0.0), lambda w: exact.pendulum(TIMES, 1.0, 0.0, w)),
        ((Gravity(),), (0.3, 9.0), lambda w: exact.pendulum(TIMES, 0.3, 9.0, w)),
        ((SmallAngleGravity(), LinearDrag(gamma=0.5)), (0.4, 0.1), lambda w: exact.linear(TIMES, 0.4, 0.1, w, 0.5)),
        ((SmallAngleGravity(), LinearDrag(gamma=500.0)), (0.4, 3.0), lambda w: exact.linear(TIMES, 0.4, 3.0, w, 500.0)),
    ],
    ids=["libration", "rotation", "damped", "overdamped"],
)
def test_the_numerical_solution_reproduces_closed_forms(effects, start, expected):
    found = reference(numerical(*effects), *start, TIMES)
    error = np.max(np.abs(found.angle - expected(math.sqrt(9.81))[0]))
    assert error <= 2e-13 * max(1.0, float(np.max(np.abs(found.angle))))
    assert error <= 10.0 * found.error_estimate
    assert "Gragg" in found.how
    assert "Dormand" in found.how


def half_swings(velocity: np.ndarray) -> np.ndarray:
    """Return the number of the half swing to which each time belongs."""
    return np.concatenate(([0, 0], np.cumsum(velocity[1:-1] * velocity[2:] < 0.0)))


@pytest.mark.slow
def test_quadratic_drag_keeps_its_energy_integral_in_every_half_swing():
    c, w2 = 0.4, 9.81
    found = reference(of(Gravity(), QuadraticDrag(c=c)), 2.5, 0.0, TIMES)
    turns = [2.5]
    for _ in range(10):
        turns.append(exact.quadratic_turning_point(turns[-1], c))

    def integral(angle: float, velocity: float, sign: float) -> float:
        """Return an integral of motion, constant while v has the sign of -``sign`` (Mungan & Lipscombe 2013)."""
        drag = 2.0 * c * sign
        fall = math.exp(-drag * angle)
        return fall * (0.5 * velocity**2 - w2 * (math.cos(angle) + drag * math.sin(angle)) / (1.0 + drag**2))

    swings = half_swings(found.velocity)
    assert swings[-1] >= 8
    for k, angle, velocity in zip(swings, found.angle, found.velocity, strict=True):
        sign = math.copysign(1.0, turns[k])
        assert integral(angle, velocity, sign) == pytest.approx(integral(turns[k], 0.0, sign), abs=2e-12)


def test_dry_friction_stops_at_the_exact_angle_and_stays():
    tau = 0.03
    turns = exact.coulomb_turning_points(1.5, tau, 100)
    scene = of(Gravity(), CoulombFriction(friction_torque=tau * 9.81))
    late = np.linspace(60.0, 61.0, 5)
    found = reference(scene, 1.5, 0.0, late)
    np.testing.assert_allclose(found.angle, turns[-1], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(found.velocity, 0.0)
    assert found.error_estimate < 1e-11


def test_dry_friction_holds_a_bob_released_within_its_limit():
    scene = of(SmallAngleGravity(), CoulombFriction(friction_torque=9.81))
    found = reference(scene, 0.99, 0.0, TIMES)
    np.testing.assert_array_equal(found.angle, 0.99)


@pytest.mark.slow
def test_the_lab_against_a_taylor_series_in_22_digits():
    lab = SCENES["lab"]
    values = lab.coefficients
    g, gamma, c = values["gravity_rate"], values["linear_drag_rate"], values["quadratic_drag_rate"]
    with mpmath.workdps(22):
        path = mpmath.odefun(
            lambda t, y: [y[1], -g * mpmath.sin(y[0]) - gamma * y[1] + c * y[1] ** 2],  # the bob falls: |v| v = -v²
            0, [mpmath.mpf(0.75), mpmath.mpf(0)],
        )
        truth = [float(path(mpmath.mpf(t))[0]) for t in (0.25, 0.5)]
    found = reference(lab, 0.75, 0.0, [0.25, 0.5])
    np.testing.assert_allclose(found.angle, truth, rtol=0, atol=3e-15)


@pytest.mark.parametrize("times", [[], [-1.0, 1.0], [1.0, 0.5], [0.0, math.nan], [[0.0, 1.0]]])
def test_times_must_increase_from_zero(times):
    with pytest.raises(StudyError, match="times of a reference solution"):
        reference(VACUUM, 1.0, 0.0, times)


def test_a_start_must_be_finite():
    with pytest.raises(SceneError, match="angle must be a finite number"):
        reference(VACUUM, math.nan, 0.0, TIMES)


def test_a_bob_balanced_on_the_top_of_friction_is_no_trouble():
    """A bob that friction just holds does not move: its velocity stays zero, and so does the error."""
    found = reference(replace(numerical(Gravity()), gravity=0.0), 1.0, 0.0, TIMES)
    np.testing.assert_array_equal(found.angle, 1.0)


@pytest.mark.parametrize("time", [2.0, 4.0])
def test_next_to_the_top_the_tilt_keeps_its_digits(time):
    """float(pi) is 1.2246e-16 below pi: tilt'' + gamma tilt' = omega0² tilt; r and s solve x² + gamma x = omega0²."""
    lab = SCENES["lab"]
    gamma = lab.coefficients["linear_drag_rate"]
    root = math.sqrt(0.25 * gamma**2 + lab.omega0**2)
    r, s = -0.5 * gamma + root, -0.5 * gamma - root
    tilt = 1.2246467991473532e-16 * (r * math.exp(s * time) - s * math.exp(r * time)) / (r - s)
    found = reference(lab, math.pi, 0.0, [time])
    assert math.pi - found.angle[0] == pytest.approx(tilt, rel=1e-6, abs=1e-15)
    assert found.error_estimate < 1e-13


@pytest.mark.parametrize("how", ["extrapolated", "doubled"])
@pytest.mark.parametrize(("start", "end"), [((0.3, 9.0), 5.0), ((1.0, 5.0), 5.0), ((-2.9, 6.0), 1.0)])
def test_both_ways_to_advance_keep_to_their_agreement_over_long_spans(how, start, end):
    """Spans of several turns are halved until two results agree to 1e-13 or 1e-14; Jacobi's functions give the truth.

    With an agreement of 1e-12 the velocity would be off by 5e-13, with 1e-9 by 3e-10.
    """
    scene = of(Gravity())
    advance = extrapolated() if how == "extrapolated" else doubled(scene, CHECK)
    angle, velocity = advance(problem_of(scene), 0.0, start, end, 1.0)
    true_angle, true_velocity = exact.pendulum(end, *start, math.sqrt(9.81))
    assert angle == pytest.approx(true_angle, rel=1e-13)
    assert velocity == pytest.approx(true_velocity, abs=3e-13)
