"""Compensated summation: exact error terms, agreement with steps in 36 digits, and the growth of energy errors."""

from __future__ import annotations

import math
import pickle
import sys
from collections.abc import Callable
from fractions import Fraction
from itertools import islice
from pathlib import Path
from typing import Any

import forty_digits
import gymnasium as gym
import mpmath
import numpy as np
import pytest
from choice import FITS
from forty_digits import mpf
from hypothesis import given
from hypothesis import strategies as st
from runge_kutta_truths import rounding

import integrators
import pendulum_env  # noqa: F401
from integrators import METHODS, Method, MethodError, Solution, System, unroll
from integrators.families.multistep import Started
from integrators.families.second_order import SecondOrder
from integrators.families.taylor import coefficients
from integrators.solving.stepper import stepper
from integrators.steps.compensated import added, scaled
from integrators.steps.terms import Notation, StepLines, definition, term
from pendulum_env import SCENES, Scene, rollout
from pendulum_env.engine.generate import batch_program, program
from pendulum_env.engine.machine import ANGLE, TURNS, VELOCITY, Machine
from pendulum_env.engine.wrap import half_turns, left_out, without_half_turns_kept
from pendulum_env.physics.effects import Gravity, Motor
from pendulum_env.physics.effects.coulomb_friction import dry_glide
from pendulum_env.study.growth import growth
from pendulum_env.truth.bounds import rounding_factor

REFUSED = {"exact": "it adds nothing up"} | {
    name: "it makes the velocity anew from earlier mean velocities, each rounded"
    for name, method in METHODS.items() if isinstance(method, SecondOrder) and len(method.means) > 1
}
"""Methods whose steps are not sums of the state and an increment -> the reason."""
SUMS = [name for name in METHODS if name not in REFUSED]

FINITE = st.floats(-1e100, 1e100, allow_subnormal=False).filter(lambda x: x == 0.0 or abs(x) > 1e-100)
DIGITS = 36
FINE = 1 + Fraction(1, 10**20)
"""Factor slightly above 1 for the longest step, so that rounding does not change the number of steps."""


# --- the parts --------------------------------------------------------------------------------------------------


@given(FINITE, FINITE)
def test_a_sum_is_its_two_parts_exactly(x: float, change: float) -> None:
    total, lost = added(x, 0.0, change, 0.0)
    assert Fraction(total) + Fraction(lost) == Fraction(x) + Fraction(change)
    assert total == x + change


@given(FINITE, FINITE, st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_low_parts_are_added(x: float, change: float, lost: float, low: float) -> None:
    small = 2.0**-53 * max(abs(x), abs(change))
    total, rest = added(x, small * lost, change, small * low)
    exact = sum(map(Fraction, (x, small * lost, change, small * low)), Fraction(0))
    assert abs(Fraction(total) + Fraction(rest) - exact) <= 2.0**-103 * max(abs(x), abs(change))


@given(FINITE, FINITE)
def test_a_product_is_its_two_parts_exactly(factor: float, h: float) -> None:
    product, low = scaled(factor, 0.0, h)
    assert product == factor * h
    assert Fraction(product) + Fraction(low) == Fraction(factor) * Fraction(h)


@given(st.floats(-50.0, 50.0), st.floats(-1.0, 1.0))
def test_half_turns_take_nothing_away(angle: float, share: float) -> None:
    lost, halves = share * math.ulp(angle) / 2, half_turns(angle)
    tilt, kept = without_half_turns_kept(angle, lost, halves)
    with mpmath.workdps(50):
        assert abs(mpmath.mpf(angle) + lost - halves * mpmath.pi - tilt - kept) < 2.0**-100
        whole = tilt + 2.0 * math.pi * (0.5 * halves)
        rest = left_out(whole, tilt, kept, 0.5 * halves)
        assert abs(mpmath.mpf(tilt) + kept + halves * mpmath.pi - whole - rest) < 1e-23


# --- the source -------------------------------------------------------------------------------------------------


@pytest.mark.quick("rk4", "velocity_verlet", "gauss4", "dopri5", "rkn43")
@pytest.mark.parametrize("name", SUMS)
def test_off_it_leaves_no_trace(name: str) -> None:
    assert unroll(METHODS[name]) == unroll(METHODS[name], compensated=False)
    scene = SCENES["lab" if ("lab", name) in FITS else "vacuum"]
    text = program(scene, METHODS[name]).text + batch_program(scene, METHODS[name], (), frozenset()).text
    assert "lost_" not in text
    assert "added(" not in text


def body(name: str) -> list[str]:
    return [line.strip() for line in unroll(METHODS[name], compensated=True).splitlines()]


def test_source_of_a_splitting() -> None:
    lines = body("velocity_verlet")
    start = lines.index("def step(t, q, v, a, lost_q, lost_v, h):")
    assert lines[start + 2 :] == [
        "v, lost_v = added(v, lost_v, 0.5*h*a, 0.0)",
        "q, lost_q = added(q, lost_q, h*v, 0.0)",
        "a = force(t + h, q)",
        "v, lost_v = added(v, lost_v, 0.5*h*a, 0.0)",
        "return q, v, a, lost_q, lost_v",
    ]


def test_coefficients_have_low_parts() -> None:
    """The low parts of 1/3 and 2/3 are 2**-54/3 and its double; that of a whole number is 0."""
    third = float(Fraction(1, 3) - Fraction(1 / 3))
    text = unroll(METHODS["bs3"], compensated=True)
    assert f"{third!r}*a2" in text
    assert "0.75*a2)" in text


def test_which_methods_cannot_be_compensated() -> None:
    for name in REFUSED:
        with pytest.raises(MethodError, match=f"{name} cannot be compensated"):
            unroll(METHODS[name], compensated=True)


class TextStep(Method):
    """A method that writes the text of its step itself, without the operations of the notation."""

    def write_step(self, notation: Notation) -> str:
        return definition("step(t, q, v, h)", self.title, ["return q + h*v, v + h*acceleration(t, q, v)"])


class PlainLines(TextStep):
    """A method that asks for plain lines, as one does whose step is no sum of the old state and increments."""

    def write_step(self, notation: Notation) -> str:
        step = StepLines(notation)
        return step.source(self.title, [step.end("q", term(1, "h", "v")), "v"])


@pytest.mark.parametrize("kind", [TextStep, PlainLines])
def test_a_step_that_is_no_sum_is_refused(kind: type[Method]) -> None:
    method = kind(name="made_up", order=1, source="none", summary="none")
    assert "lost_q" not in unroll(method)
    with pytest.raises(MethodError, match="made_up cannot be compensated: its step does not add increments to"):
        unroll(method, compensated=True)


# --- every method follows itself --------------------------------------------------------------------------------


def soft_spring() -> System:
    """Return ``q'' = q**3/6 - q`` in basic arithmetic, so double precision differs from 36 digits by rounding alone."""

    def force(t: Any, q: Any) -> Any:
        return q * q * q / 6 - q

    return System(
        lambda t, q, v: force(t, q), force=force, velocity_free=True, jacobian=lambda t, q, v: (q * q / 2 - 1, 0),
        mean_acceleration=lambda t, q, v, s: (q * q * q + q * s * s) / 6 - q,
        mean_jacobian=lambda t, q, v, s: ((3 * q * q + s * s + 2 * q * s) / 6 - 1, 0),
        taylor_coefficients=coefficients(lambda t, q, v: force(t, q)),
    )


def followed(name: str, steps: int, compensated: bool = True, kind: Callable[[float], Any] = float) -> Solution:
    h = 2.0**-5
    times = [kind(k * h) for k in range(steps + 1)]
    longest = h if kind is float else kind(h) * FINE.numerator / FINE.denominator
    return integrators.solve(soft_spring(), kind(0.75), kind(0.5), times, method=name, h=longest,
                             compensated=compensated)


def distance(found: Solution, truth: Solution) -> float:
    """Return the largest difference in q and v, with the stored rounding errors added."""
    zero = np.zeros(len(found.q))
    parts = ((found.q, found.lost_q, truth.q), (found.v, found.lost_v, truth.v))
    return max(
        float(abs(mpmath.mpf(x) + rest - exact))
        for values, lost, exacts in parts
        for x, rest, exact in zip(values, zero if lost is None else lost, exacts, strict=True)
    )


@pytest.mark.parametrize("name", SUMS)
def test_every_method_follows_its_exact_self(name: str) -> None:
    """192 steps with exact coefficients in 36 digits: compensated runs agree within a unit in the last place."""
    with mpmath.workdps(DIGITS):
        truth = followed(name, 192, False, mpmath.mpf)
        plain, found = (distance(followed(name, 192, on), truth) for on in (False, True))
    method, rounds = METHODS[name], rounding(METHODS[name], 2.0**-5)
    # Multistep methods store their history of velocities and gains as doubles.
    remembers = isinstance(method, Started)
    allowed = 7e-16 if method.implicit and remembers else 2.2e-16
    assert found < allowed + 30.0 * max(0.0, rounds - 1e-16)
    assert found < plain / (1.0 if method.implicit and remembers else 2.0 if remembers else 4.0)


@pytest.mark.parametrize(("name", "steps"), [("kahan_li8", 4096), ("gauss8", 4096), ("rk4", 4096)])
@pytest.mark.slow
def test_for_thousands_of_steps(name: str, steps: int) -> None:
    with mpmath.workdps(DIGITS):
        truth = followed(name, steps, False, mpmath.mpf)
        plain, found = (distance(followed(name, steps, on), truth) for on in (False, True))
    assert found < 5e-15
    assert found < plain / 8.0


def test_what_was_lost_outlives_changes_of_the_step() -> None:
    """velocity_verlet's memory restarts when steps change from 1/32 to 1/64 and back; stored rounding errors remain."""
    times = [0.0]
    for _ in range(96):
        times += [times[-1] + 2.0**-5, times[-1] + 2.0**-5 + 2.0**-6]
    with mpmath.workdps(DIGITS):
        truth = integrators.solve(soft_spring(), mpmath.mpf(0.75), mpmath.mpf(0.5), list(map(mpmath.mpf, times)),
                                  method="velocity_verlet", h=mpmath.mpf(1) / 31)
        found = integrators.solve(soft_spring(), 0.75, 0.5, times, method="velocity_verlet", h=1 / 31, compensated=True)
        assert distance(found, truth) < 1e-16


@pytest.mark.parametrize("name", SUMS)
def test_order_is_not_spoiled(name: str) -> None:
    """In 36 digits compensation changes only the last digits, and adds them to the stored rounding errors."""
    with mpmath.workdps(DIGITS):
        plain, found = (followed(name, 6, on, mpmath.mpf) for on in (False, True))
        assert distance(found, plain) < 1e-33 * max(1.0, rounding(METHODS[name], 1.0) / 2.0**-52)
        assert all(abs(low) < 1e-35 for low in found.lost_q)


@pytest.mark.parametrize("name", ["symplectic_euler", "kahan_li6", "rk4", "dopri5", "gauss4", "discrete_gradient"])
def test_arrays_are_their_members(name: str) -> None:
    starts, times = np.array([[0.75, -0.5, 0.3], [0.5, 0.25, 1.0]]), [0.0, 0.5, 2.0]
    many = integrators.solve(soft_spring(), *starts, times, method=name, h=0.03, compensated=True)
    for i, (q, v) in enumerate(starts.T.tolist()):
        one = integrators.solve(soft_spring(), q, v, times, method=name, h=0.03, compensated=True)
        if METHODS[name].implicit:
            assert np.max(np.abs(many.q[:, i] - one.q)) < 1e-14
        else:
            assert [x.tolist() for x in (many.q[:, i], many.v[:, i], many.lost_q[:, i], many.lost_v[:, i])] == [
                x.tolist() for x in (one.q, one.v, one.lost_q, one.lost_v)]
    assert np.max(np.abs(many.lost_q)) <= 2.0**-53
    assert np.any(many.lost_q != 0.0)


def test_drag_is_an_increment_too() -> None:
    """A splitting with an exact drag flow has the same trajectory up to rounding."""
    system = System(lambda t, q, v: -q - v / 4, force=lambda t, q: -q,
                    dissipative_flow=lambda t, q, v, h: v * math.exp(-h / 4))
    plain, found = (integrators.solve(system, 1.0, 0.0, [0.0, 10.0], method="forest_ruth", h=0.05, compensated=on)
                    for on in (False, True))
    assert abs(found.q[-1] - plain.q[-1]) < 1e-14
    step, begin = stepper(METHODS["conformal_symplectic_euler"], system, compensated=True)
    _, v, *_, lost_v = step(0.0, 0.0, 1.0, *begin(0.0, 0.0, 1.0, 0.5), 0.0, 0.0, 0.5)
    assert v + lost_v == pytest.approx(math.exp(-0.125), rel=2e-16)


# --- in the engine ----------------------------------------------------------------------------------------------

ANSWERS = ("angle", "velocity", "lost_angle", "lost_velocity", "energy_residual")
BITS = [
    pytest.param("vacuum", "velocity_verlet", marks=pytest.mark.slow),
    *(pytest.param(scene, name, marks=pytest.mark.slow) for scene, name in (
        ("sticky_bearing", "velocity_verlet"), ("sticky_bearing", "midpoint"), ("lab", "conformal_symplectic_euler"),
        ("exercise_large", "symplectic_euler"), ("vacuum", "discrete_gradient"), ("textbook", "blanes_moan_srkn6b"),
        ("vacuum", "kahan_li6"), ("lab", "bs3"), ("vacuum", "implicit_midpoint"),
    )),
]


@pytest.mark.parametrize(("scene", "name"), BITS)
def test_interpreted_and_compiled_give_the_same_bits(scene: str, name: str) -> None:
    """For single runs and batches, through half turns, stops, kinks and a slack wire."""
    share = 0.25 if SCENES[scene].has("motor") else 0.0
    options: dict[str, Any] = {"integrator": name, "velocity": 6.0, "duration": 6.0, "dt": 0.02, "control": share}
    one, many = ([rollout(scene, angle=angle, backend=backend, compensated=True, **options)
                  for backend in ("python", "compiled")] for angle in (2.5, [2.5, 1.0]))
    whole = len(one[0].angle) - (one[0].stop_reason == "slack")  # a wire goes slack inside a step, which a batch lacks
    for answer in ANSWERS:
        python, compiled = (getattr(run, answer) for run in one)
        assert python.tobytes() == compiled.tobytes()
        both, them = (getattr(run, answer) for run in many)
        assert np.array_equal(both, them, equal_nan=True)
        assert np.array_equal(both[0, :whole], python[:whole])
    assert np.any(one[0].lost_angle != 0.0)


@pytest.mark.parametrize("name", ["midpoint", "velocity_verlet"])
def test_dry_friction_still_stops(name: str) -> None:
    """When dry friction stops the bob, the velocity and its stored rounding error are zero and stay so."""
    plain, run = (rollout("sticky_bearing", damping={"coulomb": {"friction_torque": 0.02}}, integrator=name, angle=1.0,
                          duration=6.0, dt=0.02, backend="python", compensated=on) for on in (False, True))
    resting = run.velocity == 0.0
    assert resting.sum() > 100
    assert not np.any(run.lost_velocity[resting])
    assert len(set(run.angle[resting][1:])) == 1
    assert run.angle[-1] == pytest.approx(plain.angle[-1], abs=1e-13)


def test_a_stop_within_a_kick_leaves_nothing() -> None:
    def kick(t: float, q: float, v: float, a: float, h: float) -> float:
        return dry_glide(v, a, 0.5, h)[0]

    space: dict[str, Any] = {"added": added, "scaled": scaled, "force": lambda t, q: -0.25, "kick": kick}
    exec(unroll(METHODS["symplectic_euler_position_first"], hooks={"kick": ()}, compensated=True, glides=True), space)
    assert space["step"](0.0, 1.0, 0.125, 0.0, 1e-18, 0.5)[1::2] == (0.0, 0.0)
    assert space["step"](0.0, 1.0, 2.0, 0.0, 1e-17, 0.5)[1::2] == (1.625, 1e-17)


def advanced(machine: Machine) -> dict[str, float]:
    """Return the state after some steps, by name."""
    state = machine.state(1.0, 3.0)
    assert machine.advance(state, 0.25, 0.02, 12) == 0
    return dict(zip(machine.names, state, strict=True))


PLACES = ("vacuum", "lab", "sticky_bearing")
RUNS = [(scene, name) for scene, name in sorted(FITS) if scene in PLACES and name in SUMS]


@pytest.mark.parametrize(("scene", "name"), RUNS)
def test_every_method_runs_compensated_where_it_runs(scene: str, name: str) -> None:
    """Interpreted, in every scene that the method fits, with nearly the plain motion and ledger."""
    machines = [Machine(SCENES[scene], name, backend="python", compensated=on) for on in (False, True)]
    plain, found = map(advanced, machines)
    gap = max(abs(plain[key] - found[key]) for key in plain)
    assert gap < 1e-13 + 300.0 * rounding(METHODS[name], 0.06)
    assert found["lost_q"] != 0.0
    assert advanced(pickle.loads(pickle.dumps(machines[1]))) == found


def driven_truth(name: str, controls: list[float], every: int, rate: float, push: float) -> tuple[Any, Any]:
    """Return q and v of the driven pendulum from (0.5, 5) after intervals of constant control, in 36 digits."""
    q, v = mpmath.mpf("0.5"), mpmath.mpf(5)
    h = mpmath.mpf(1) / 64
    for control in controls:
        force = lambda t, q, c=control: push * mpmath.mpf(c) - rate * mpmath.sin(q)  # noqa: E731
        system = System(lambda t, q, v, f=force: f(t, q), force=force, velocity_free=True)
        found = integrators.solve(system, q, v, [0, every * h], method=name, h=h * FINE.numerator / FINE.denominator)
        q, v = found.q[-1], found.v[-1]
    return q, v


def test_what_was_lost_outlives_half_turns_and_changes_of_control() -> None:
    """A rotating driven pendulum against 36 digits: memories restart at new controls, stored rounding errors do not."""
    scene = Scene("driven", effects=(Gravity(), Motor(max_torque=4.0)), gravity=4.0)
    rate, push = (scene.coefficients[name] for name in ("gravity_rate", "motor_rate"))
    controls = [0.5, -0.25, 0.125, 0.75] * 16
    with mpmath.workdps(DIGITS):
        q, v = driven_truth("velocity_verlet", controls, 5, rate, push)
        gaps = []
        for compensated in (False, True):
            machine = Machine(scene, "velocity_verlet", backend="python", compensated=compensated)
            state = machine.state(0.5, 5.0)
            for control in controls:
                machine.advance(state, control, 1.0 / 64, 5)
            found = dict(zip(machine.names, state, strict=True))
            angle = mpmath.mpf(state[ANGLE]) + 2 * mpmath.pi * state[TURNS] + found.get("lost_q", 0.0)
            velocity = mpmath.mpf(state[VELOCITY]) + found.get("lost_v", 0.0)
            gaps.append(max(abs(angle - q), abs(velocity - v)))
            assert state[TURNS] > 3
            if compensated:
                info = machine.info(state)
                assert abs(mpmath.mpf(info["angle"]) + info["lost_angle"] - angle) < 1e-24
    assert gaps[1] < 2e-15
    assert gaps[1] < gaps[0] / 10


def make(**options: Any) -> Any:
    return gym.make("LabPendulum-v0", backend="python", integrator="velocity_verlet", **options).unwrapped


def test_environments_resume_and_vectors_agree() -> None:
    env = make(compensated=True)
    env.reset(seed=3)
    actions = np.linspace(-1.0, 1.0, 8, dtype=np.float32)[:, None]
    infos = [env.step(action)[-1] for action in actions]
    assert {"lost_angle", "lost_velocity"} <= infos[0].keys()
    assert all(isinstance(info["lost_angle"], float) for info in infos)
    options = {"backend": "python", "integrator": "velocity_verlet", "compensated": True}
    vector = gym.make_vec("LabPendulum-v0", num_envs=2, **options)
    vector.reset(seed=3)
    for action, info in zip(actions, infos, strict=True):
        many = vector.step(np.repeat(action[None], 2, axis=0))[-1]
        assert {key: many[key][0] for key in info} == info
    saved = env.get_state()
    after = env.step(actions[0])[-1]
    other = make(compensated=True)
    other.reset()
    other.set_state(saved)
    assert other.step(actions[0])[-1] == after
    for wrong, state in ((make(), saved), (other, make().get_state())):
        wrong.reset()
        with pytest.raises(ValueError, match="state"):
            wrong.set_state(state)


# --- what cannot be ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("call", [
    lambda **options: integrators.solve(lambda t, q, v: -q, 1.0, 0.0, [0.0, 1.0], method="dop853", h=0.1, **options),
    lambda **options: rollout("vacuum", integrator="dop853", duration=0.1, backend="python", **options),
    lambda **options: gym.make("LabPendulum-v0", integrator="dop853", backend="python", **options),
], ids=["solve", "rollout", "gym"])
def test_refusals(call: Any) -> None:
    with pytest.raises(MethodError, match="compensated goes with steps of one length, not with rtol"):
        call(compensated=True, rtol=1e-8)
    with pytest.raises(MethodError, match="compensated must be True or False, not 'yes'"):
        call(compensated="yes")


# --- the walk of the energy -------------------------------------------------------------------------------------


@pytest.fixture
def benchmark(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "examples" / "benchmarks"))
    import rounding as module
    yield module
    sys.modules.pop("rounding"), sys.modules.pop("machine")


@pytest.mark.slow
def test_energy_walks_less(benchmark: Any) -> None:
    """24 pendulums, 10 000 steps of kahan_li8 with omega0 h = 0.05 by `solve` on arrays; 2500 of the plain ones."""
    system = System(lambda t, q, v: -np.sin(q), force=lambda t, q: -np.sin(q), velocity_free=True)
    angles, walked = benchmark.starts(24), []
    for compensated, end in ((False, 125.0), (True, 500.0)):
        found = integrators.solve(system, angles, 0.0 * angles, [0.0, end], method="kahan_li8", h=0.05,
                                  compensated=compensated)
        lost = (found.lost_q, found.lost_v) if compensated else (0.0 * found.q, 0.0 * found.q)
        errors = benchmark.errors_of(*(values.T for values in (found.q, found.v, *lost)))
        walked.append(benchmark.rms(errors)[-1])
    assert 5e-15 < walked[0] < 5e-14
    assert walked[1] < 1e-15


@pytest.mark.slow
def test_energy_walks_no_faster_than_the_square_root(benchmark: Any) -> None:
    """The compiled run over 100 000 steps."""
    found = {}
    for compensated in (False, True):
        counts, errors = benchmark.energy_errors(compensated, benchmark.starts(64), 10**5, rows=200)
        found[compensated] = errors
    assert benchmark.slope(counts, found[True]) - 2.0 * benchmark.scatter(counts, found[True]) <= 0.5
    assert benchmark.rms(found[True])[-1] < benchmark.rms(found[False])[-1] / 30.0


def test_numpys_truth_is_taken() -> None:
    switch: Any = np.bool_(True)
    for angle in (0.3, [0.3, 0.4]):
        plain, found = (rollout("vacuum", angle=angle, duration=0.1, backend="python", compensated=compensated)
                        for compensated in (True, switch))
        assert found.lost_angle is not None
        assert np.array_equal(found.lost_angle, np.asarray(plain.lost_angle))
    lines = [growth("vacuum", ["rk4"], periods=1.0, backend="python", compensated=compensated).lines[0]
             for compensated in (True, switch)]
    assert np.array_equal(lines[0].angle_error, lines[1].angle_error)


# --- every kind of method beside its formula in 40 digits ------------------------------------------------------------

ONE_OF_A_KIND = ("rk4", "kahan_li6", "nystrom4", "ab4", "bdf3", "stoermer5", "chin4a")
"""Of each kind whose steps are quick in 40 digits."""
STEP, COUNT = 2.0**-5, 128


@pytest.mark.parametrize("name", [
    pytest.param(name, marks=() if name in ONE_OF_A_KIND else pytest.mark.slow) for name in SUMS])
def test_compensated_steps_are_those_of_the_formula_in_forty_digits(name: str) -> None:
    """The sums of angle and remainder are off by the rounding of the increments only, some units of 2^-53.

    The formulas are computed from the tables in :mod:`forty_digits`. Rounding of a stage grows with the sum of its
    coefficients; BDF methods add up old states in each step, which rounds them anew.
    """
    method = METHODS[name]
    scene = SCENES["vacuum"].replace(gravity=1.0)
    run = rollout(scene, integrator=method, dt=STEP, duration=STEP * COUNT, every=COUNT, angle=1.0, velocity=0.25,
                  compensated=True, backend="python", warn=False)
    walk = forty_digits.steps(method, forty_digits.EQUATIONS["pendulum"], mpf(0), mpf(1), mpf(0.25), mpf(STEP))
    *_, (angle, velocity) = islice(walk, COUNT)
    assert run.lost_angle is not None
    assert run.lost_velocity is not None
    off = max(abs(float(mpf(float(kept[-1])) + mpf(float(lost[-1])) - true)) for kept, lost, true in (
        (run.angle, run.lost_angle, angle), (run.velocity, run.lost_velocity, velocity)))
    units = 12.0 if name.startswith("bdf") else 4.0 + 2.0 * rounding_factor(method)
    assert off < units * 2.0**-53
