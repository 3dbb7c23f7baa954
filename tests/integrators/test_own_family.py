"""User-defined families of methods work everywhere in the package.

``Trigonometric`` is an exponential fit of the linearised pendulum; ``Leapfrog`` and ``TwoStep`` define only what a
class must. Truths are closed forms of the oscillator and scipy's DOP853 on the pendulum.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import Any, ClassVar

import gymnasium as gym
import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pendulum_env
from integrators import Method, MethodError, System, analysis, solve
from integrators.method import Notation, Polynomial, exact
from integrators.steps.terms import definition, increment
from pendulum_env import SCENES, Scene, rollout
from pendulum_env.physics.effects import Gravity, PeriodicTorque
from pendulum_env.study.lists.methods import entry, listing

# --- the families ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Trigonometric(Method):
    """Kicks by what is not linear, and between them the exact flow of ``q'' = -w**2 q``, w that of small swings.

    With ``g(t, q) = f(t, q) + w**2 q`` (Deuflhard 1979; Hairer, Lubich & Wanner 2006, section XIII.1.2)::

        p = v + h/2 g(t, q)     q1 = cos(w h) q + sin(w h)/w p     v1 = -w sin(w h) q + cos(w h) p + h/2 g(t + h, q1)
    """

    family: ClassVar[str] = "trigonometric"

    @property
    def needs(self) -> frozenset[str]:
        return frozenset({"acceleration", "velocity_free", "jacobian"})

    @property
    def evaluations(self) -> int:
        return 2

    @property
    def symplectic(self) -> bool:
        return True

    @property
    def symmetric(self) -> bool:
        return True

    @property
    def oscillation_limit(self) -> float:
        return math.inf

    def oscillator_matrix(self, terms: int) -> tuple[Polynomial, ...]:
        powers = [Fraction((-1) ** (k // 2), math.factorial(k)) for k in range(terms)]
        cos, sin = ([x * (k % 2 == odd) for k, x in enumerate(powers)] for odd in range(2))
        return tuple(cos), tuple(sin), tuple(-x for x in sin), tuple(cos)

    def write_step(self, notation: Notation) -> str:
        more, sums = notation.more, notation.quadratures
        half = f"{notation.number(Fraction(1, 2))}*h"
        begun, ended = ([f"{name}{i}" for name in sums] for i in range(2))
        lines = [
            f"slope, _ = jacobian(t, q - q, v - v{more})",
            "w = sqrt(abs(slope) + 1e-300)",
            *([f"{', '.join(['_', *begun])} = rates(t, q, v{more})"] if sums else []),
            f"p = v + {half}*(force(t, q{more}) + w*w*q)",
            "q_end = cos(w*h)*q + sin(w*h)/w*p",
            f"v_end = cos(w*h)*p - w*sin(w*h)*q + {half}*(force(t + h, q_end{more}) + w*w*q_end)",
            *([f"{', '.join(['_', *ended])} = rates(t + h, q_end, v_end{more})"] if sums else []),
        ]
        totals = [f"{half}*({x} + {y})" for x, y in zip(begun, ended, strict=True)]
        lines.append(f"return {', '.join(['q_end', 'v_end', *totals])}")
        return definition(f"step(t, q, v, h{more})", self.title, lines)


@dataclass(frozen=True, kw_only=True)
class Leapfrog(Method):
    """Leapfrog method: drift, kick, drift, with only the required properties."""

    family: ClassVar[str] = "leapfrog"

    @property
    def evaluations(self) -> int:
        return 1

    @property
    def symplectic(self) -> bool:
        return True

    @property
    def symmetric(self) -> bool:
        return True

    def write_step(self, notation: Notation) -> str:
        half = f"{notation.number(Fraction(1, 2))}*h"
        more = notation.more
        lines = [f"x = q + {half}*v", f"w = v + h*acceleration(t + {half}, x, v{more})", f"return x + {half}*w, w"]
        return definition(f"step(t, q, v, h{more})", self.title, lines)


class Wishful(Leapfrog):
    """Method with a need that no problem offers."""

    @property
    def needs(self) -> frozenset[str]:
        return frozenset({"acceleration", "a crystal ball"})


@dataclass(frozen=True, kw_only=True)
class TwoStep(Method):
    """Adams-Bashforth method of two steps, started with a backward step of Euler's method."""

    family: ClassVar[str] = "two-step"

    @property
    def evaluations(self) -> int:
        return 1

    @property
    def symplectic(self) -> bool:
        return False

    @property
    def symmetric(self) -> bool:
        return False

    @property
    def memory(self) -> tuple[str, ...]:
        return "v_old", "a_old"

    @property
    def one_step(self) -> bool:
        return False

    @property
    def characteristic(self) -> tuple[Polynomial, ...]:
        return exact(0, -1, 1), exact("1/2", "-3/2")

    def write_step(self, notation: Notation) -> str:
        more = notation.more
        begin = [f"a = acceleration(t, q, v{more})",
                 f"return v - h*a, acceleration(t - h, q - h*v, v - h*a{more})"]
        first = definition(f"begin(t, q, v, h{more})", "The slopes before.", begin)
        step = notation.new_step()
        step.line(f"a = acceleration(t, q, v{more})")
        ends = [step.end(y, increment(exact("3/2", "-1/2"), [slope, f"{slope}_old"]))
                for y, slope in (("q", "v"), ("v", "a"))]
        return f"{first}\n\n{step.source(self.title, ends, {'v_old': 'v', 'a_old': 'a'})}"


OWN = Trigonometric(name="deuflhard", order=2, source="Deuflhard 1979, ZAMP 30, 177", summary="fit of small swings")
LEAPFROG = Leapfrog(name="my_leapfrog", order=2, source="Verlet 1967, Phys. Rev. 159, 98", summary="drift, kick, drift")
TWO = TwoStep(name="my_ab2", order=2, source="Bashforth & Adams 1883", summary="two slopes")
FAMILIES = (OWN, LEAPFROG, TWO)
pytestmark = pytest.mark.usefixtures("all_interpreted")
BACKENDS = ["python", pytest.param("compiled", marks=pytest.mark.slow)]
ANGLE, END = 1.0, 2.0
"""Initial angle at rest [rad], and time of the comparison [s]."""
DRIVEN = Scene("driven without drag", effects=(Gravity(), PeriodicTorque(drive_torque=0.3, drive_rate=2.0)))


def true_end(omega0: float) -> float:
    """Return the pendulum's angle at END, by scipy."""
    run = solve_ivp(lambda t, y: [y[1], -omega0**2 * math.sin(y[0])], (0.0, END), [ANGLE, 0.0], method="DOP853",
                    rtol=1e-13, atol=1e-14)
    return float(run.y[0, -1])


# --- solve ----------------------------------------------------------------------------------------------------------


@pytest.mark.quick("0.7")
@pytest.mark.parametrize("h", [0.01, 0.7, 13.0])
def test_a_fit_of_the_oscillator_does_not_err_on_it(h: float) -> None:
    """theta = q cos(w t) + v/w sin(w t) (Landau & Lifshitz 1976, section 21), in floats, arrays and 40 digits."""
    end = 26.0
    for q, v in ((0.3, -0.8), (np.array([0.3, 2.0]), np.array([-0.8, 0.0]))):
        found = solve(lambda t, q, v: -2.25 * q, q, v, [0.0, end], method=OWN, h=h)
        assert found.q[-1] == pytest.approx(q * math.cos(1.5 * end) + v / 1.5 * math.sin(1.5 * end), abs=1e-7 * h)
    with mpmath.workdps(40):
        square = mpmath.mpf("2.25")
        spring = System(lambda t, q, v: -square * q, velocity_free=True, jacobian=lambda t, q, v: (-square, 0))
        exactly = solve(spring, mpmath.mpf("0.3"), mpmath.mpf("-0.8"), [0, mpmath.mpf(end)], method=OWN, h=h)
        truth = mpmath.mpf("0.3") * mpmath.cos(1.5 * end) - mpmath.mpf("0.8") / 1.5 * mpmath.sin(1.5 * end)
        assert abs(exactly.q[-1] - truth) < mpmath.mpf(10) ** -35


@pytest.mark.parametrize("method", FAMILIES, ids=lambda method: method.name)
def test_dense_output_comes_by_itself(method: Method) -> None:
    found = solve(lambda t, q, v: -q, 1.0, 0.0, [0.0, 3.0], method=method, h=0.003, dense=True)
    assert found(1.2345) == pytest.approx((math.cos(1.2345), -math.sin(1.2345)), abs=2e-5)
    assert found.steps == 1000


def test_a_step_written_in_the_notation_can_be_compensated() -> None:
    """600 compensated steps on a soft spring stay much nearer to those in 36 digits than plain steps do."""
    angles = {}
    with mpmath.workdps(36):
        for number, compensated in ((mpmath.mpf, False), (float, False), (float, True)):
            h = number(2.0**-5)
            times = [k * h for k in range(601)]
            run = solve(lambda t, q, v: q * q * q / 6 - q, number(0.75), number(0.5), times, method=TWO,
                        h=h * (1 + number(2.0**-40)), compensated=compensated)
            lost = run.lost_q if run.lost_q is not None else np.zeros(601)
            angles[number, compensated] = [mpmath.mpf(q) + rest for q, rest in zip(run.q, lost, strict=True)]
        truth = angles[mpmath.mpf, False]
        plain, better = (max(abs(q - exactly) for q, exactly in zip(angles[float, on], truth, strict=True))
                         for on in (False, True))
    assert better < plain / 4
    with pytest.raises(MethodError, match="deuflhard cannot be compensated: its step does not add increments to"):
        solve(lambda t, q, v: -q, 1.0, 0.0, [0.0, 1.0], method=OWN, h=0.1, compensated=True)


# --- runs and environments ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("method", FAMILIES, ids=lambda method: method.name)
def test_a_rollout_shows_the_order_on_the_pendulum(method: Method, backend: Any) -> None:
    truth = true_end(SCENES["vacuum"].omega0)
    errors = [rollout("vacuum", integrator=method, angle=ANGLE, velocity=0.0, dt=dt, duration=END,
                      backend=backend).angle[-1] - truth for dt in (0.02, 0.01, 0.005)]
    for long, short in pairwise(errors):
        assert math.log2(long / short) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("method", [OWN, TWO], ids=lambda method: method.name)
def test_interpreted_compiled_batch_and_environments_have_the_same_bits(method: Method, backend: Any) -> None:
    keywords: dict[str, Any] = {"integrator": method, "dt": 0.02, "duration": 1.0, "velocity": 0.0}
    starts = np.array([ANGLE, 0.5, -0.2])
    one, other = (rollout("vacuum", angle=ANGLE, backend=way, **keywords) for way in ("python", backend))
    many = rollout("vacuum", angle=starts, backend=backend, **keywords)
    np.testing.assert_array_equal(one.angle, other.angle)
    np.testing.assert_array_equal(one.angle, many.angle[0])
    env = gym.make("LabPendulum-v0", scene="vacuum", integrator=method, task="free", dt=0.02, backend=backend)
    env.reset(seed=0, options={"angle": ANGLE, "velocity": 0.0})
    vec = gym.make_vec("LabPendulum-v0", num_envs=3, scene="vacuum", integrator=method, task="free", dt=0.02,
                       backend=backend)
    vec.reset(seed=0, options={"angle": starts, "velocity": 0.0})
    for _ in range(50):
        info = env.step(env.action_space.sample())[4]
        infos = vec.step(vec.action_space.sample())[4]
    assert info["angle"] == one.angle[-1]
    np.testing.assert_array_equal(infos["angle"], many.angle[:, -1])


def test_work_rides_along_in_the_family_that_has_a_rule_for_it() -> None:
    """The ledger closes to order 2 while a torque drives the pendulum."""
    runs = [rollout(DRIVEN, integrator=OWN, angle=0.3, velocity=0.0, dt=dt, duration=END) for dt in (0.02, 0.01)]
    long, short = (np.max(np.abs(run.energy_residual)) for run in runs)
    assert math.log2(long / short) == pytest.approx(2.0, abs=0.1)


def test_what_it_needs_is_asked_of_the_scene() -> None:
    with pytest.raises(MethodError, match="deuflhard needs forces free of the velocity, which the scene 'lab' does"):
        rollout("lab", integrator=OWN)
    with pytest.raises(MethodError, match="deuflhard does not estimate its error"):
        rollout("vacuum", integrator=OWN, rtol=1e-6)
    with pytest.raises(MethodError, match="my_ab2 needs forces without dry friction"):
        rollout("sticky_bearing", integrator=TWO, diagnostics=())
    with pytest.raises(MethodError, match="my_leapfrog: its step does not integrate work, heat"):
        rollout("lab", integrator=LEAPFROG)
    found = rollout("lab", integrator=LEAPFROG, diagnostics=(), dt=0.001, duration=END)
    ours = rollout("lab", integrator="dop853", diagnostics=(), dt=0.01, duration=END)
    assert found.angle[-1] == pytest.approx(ours.angle[-1], abs=1e-4), "drag at the start of a step: of order 1"
    with pytest.raises(MethodError, match="needs a crystal ball, which this problem does not offer"):
        solve(lambda t, q, v: -q, 1.0, 0.0, [0.0, 1.0], method=Wishful(**vars(LEAPFROG)), h=0.1)


# --- lists ----------------------------------------------------------------------------------------------------------


def test_it_stands_in_lists_beside_ours() -> None:
    text = listing([OWN, LEAPFROG, TWO])
    assert "Trigonometric, explicit, for velocity-free forces (1)" in text
    assert (entry(OWN).oscillation_limit, entry(OWN).damping_limit) == (math.inf, None)
    assert entry(LEAPFROG).oscillation_limit == pytest.approx(2.0, rel=1e-12)
    assert (entry(TWO).oscillation_limit, entry(TWO).damping_limit) == (0.0, pytest.approx(1.0, rel=1e-9))
    found = pendulum_env.compare("vacuum", integrators=[OWN, "rk4"], angle=ANGLE, dt=0.01, duration=END)
    assert set(found.runs) == {"deuflhard", "rk4"}
    study = pendulum_env.cost("vacuum", integrators=[OWN, "rk4"], angle=ANGLE, duration=END, steps=[0.02], repeats=1)
    assert {point.method for point in study.points} == {"deuflhard", "rk4"}


# --- analysis -------------------------------------------------------------------------------------------------------


def test_the_fit_is_a_rotation() -> None:
    for z in (0.1, 1.3, 7.0):
        turned = [[math.cos(z), math.sin(z)], [-math.sin(z), math.cos(z)]]
        np.testing.assert_allclose(analysis.amplification(OWN, z), turned, atol=1e-14)
    np.testing.assert_allclose(analysis.spectral_radii(OWN, [0.1, 1.3, 7.0]), 1.0, rtol=1e-14)
    assert analysis.stability_limit(OWN) == math.inf
    error = analysis.leading_error(OWN)
    assert error.angle is error.velocity is error.amplitude is error.frequency is None
    np.testing.assert_allclose(analysis.oscillation_errors(OWN, [0.1, 1.0]), 0.0, atol=1e-15)


@pytest.mark.parametrize("method", FAMILIES, ids=lambda method: method.name)
def test_orders_are_measured(method: Method) -> None:
    assert analysis.observed_order(method) == pytest.approx(2.0, abs=0.1)
    assert (analysis.area_order(method) == math.inf) == method.symplectic


def test_a_step_on_power_series_answers_where_the_family_does_not() -> None:
    """For Verlet sin(phi/2) = z/2 (Hairer, Lubich & Wanner 2006, I.1), so phi/z = 1 + z**2/24 up to z = 2."""
    error = analysis.leading_error(LEAPFROG)
    assert error.amplitude is None
    assert error.frequency is not None
    assert (error.frequency.coefficient, error.frequency.power) == (Fraction(1, 24), 2)
    assert analysis.stability_limit(LEAPFROG) == pytest.approx(2.0, rel=1e-12)
    assert analysis.spectral_radius(LEAPFROG, 2.1) > 1.0 > analysis.spectral_radius(LEAPFROG, 1.9) - 1e-12


def test_a_method_of_two_steps_answers_by_its_polynomials() -> None:
    """Adams-Bashforth: error constant 5/12; no growth under drag up to 1 (Hairer & Wanner 1996, V.1)."""
    assert analysis.error_constant(TWO) == Fraction(5, 12)
    assert analysis.damping_limit(TWO) == pytest.approx(1.0, rel=1e-9)
    assert analysis.stability_limit(TWO) == 0.0
    assert analysis.order_residuals(TWO) == (0.0, 0.0, 5 / 12)
    z = 0.3  # the roots of x**2 - x = i z (3 x - 1)/2
    largest = max(abs(np.roots([1.0, -1.0 - 1.5j * z, 0.5j * z])))
    assert analysis.spectral_radius(TWO, z) == pytest.approx(largest, rel=1e-12)


@pytest.mark.parametrize("question", [
    analysis.order_residuals, analysis.order_conditions, analysis.nystrom_conditions, analysis.dense_conditions,
    analysis.error_constant, analysis.stability_angle, analysis.damping_limit])
def test_without_an_answer_analysis_says_so(question: Any) -> None:
    with pytest.raises(MethodError, match="deuflhard"):
        question(OWN)
