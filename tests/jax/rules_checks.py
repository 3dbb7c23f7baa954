"""Checks of what the twin promises beside values: closed forms, second derivatives, maps, memory, endings, refusals.

Run by test_twin.py in an environment that has JAX.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Callable, Iterator
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from given_effects import Rub
from jax.test_util import check_grads
from mp_steps import derivative
from mpmath import mp, mpf
from readme_code import block, method_of_readme

import integrators
import pendulum_env.jax as twin
from integrators import MethodError
from pendulum_env import SCENES, Scene, rollout
from pendulum_env.hard_cases.chaos import EXPONENTS, PERIOD
from pendulum_env.physics.units import SceneError

jax.config.update("jax_enable_x64", True)


@pytest.fixture(autouse=True)
def _forgetting() -> Iterator[None]:
    yield
    jax.clear_caches()


# --- closed forms -----------------------------------------------------------------------------------------------------


def test_derivatives_of_the_oscillator_are_those_of_its_solution() -> None:
    """Of ``q = a cos(w t) + v/w sin(w t)``, ``w = sqrt(g/L)``, by a, v and L: exact steps, 100 of them."""
    a, v, length, t = 0.3, -0.4, 0.5, 10.0
    gravity = SCENES["textbook"].gravity

    def angle(a: Any, v: Any, length: Any) -> Any:
        return twin.rollout("textbook", integrator="exact", angle=a, velocity=v, dt=0.1, steps=100, every=100,
                            length=length).angle[-1]

    w = math.sqrt(gravity / length)
    by_w = -a * t * math.sin(w * t) - v / w**2 * math.sin(w * t) + v * t / w * math.cos(w * t)
    wanted = (math.cos(w * t), math.sin(w * t) / w, by_w * (-0.5 * w / length))
    ours = jax.grad(angle, (0, 1, 2))(jnp.array(a), jnp.array(v), jnp.array(length))
    assert [float(one) for one in ours] == pytest.approx(wanted, rel=1e-11)


def test_work_heat_and_residual_have_derivatives() -> None:
    """Work less heat is the change of energy, and so are their derivatives; rk4 leaves a residual of its order."""
    def ledger(length: Any, gamma: Any) -> Any:
        run = twin.rollout("moon", angle=1.0, velocity=0.5, dt=0.01, every=100, length=length, gamma=gamma,
                           actions=jnp.linspace(-1.0, 1.0, 100))
        return jnp.stack([run.work[-1], run.heat[-1], run.energy[-1] - run.energy[0], run.energy_residual[-1]])

    gamma = SCENES["moon"].parameters()["gamma"]
    for slopes in jax.jacrev(ledger, (0, 1))(jnp.array(0.4), jnp.array(float(gamma))):  # type: ignore[arg-type]
        work, heat, change, residual = map(float, slopes)
        assert abs(heat) > 1e-9
        assert change - work + heat == pytest.approx(residual, abs=1e-13)
        assert abs(residual) < 1e-6 * abs(heat)


def test_derivatives_of_chaotic_runs_grow_as_the_lyapunov_exponent_says() -> None:
    """Of 64 runs of 60 periods of the drive after 10: the mean growth of the derivative by the start."""
    truth = EXPONENTS[1.5]
    runs, before, periods, steps = 64, 10, 60, 100

    def motion(angle: Any) -> Any:
        run = twin.rollout("chaotic", angle=angle, velocity=0.0, dt=PERIOD / steps, steps=(before + periods) * steps,
                           every=before * steps)
        return run.angle, run.velocity

    angles = jnp.linspace(-1.0, 1.0, runs)
    _, slopes = jax.jvp(motion, (angles,), (jnp.ones(runs),))
    size = np.log(np.hypot(*map(np.asarray, slopes)))
    exponent = float(np.mean(size[:, -1] - size[:, 1])) / (periods * PERIOD)
    assert exponent == pytest.approx(truth.value, abs=5.0 * truth.spread(runs * periods))


def test_friction_with_a_tanh_has_the_derivatives_of_its_closed_form() -> None:
    """``v = w asinh(sinh(v0/w) exp(-c t/w))`` by v0, c and w, saturated and near rest: differences of 40 digits."""
    def last(start: Any, c: Any, w: Any) -> Any:
        return twin.rollout(Scene(effects=(Rub(),)), integrator="rk4", angle=0.0, velocity=start, dt=1e-3, steps=400,
                            every=400, parameters={"rub_rate": c, "rub_width": w}).velocity[-1]

    def true(start: Any, c: Any, w: Any) -> Any:
        return w * mp.asinh(mp.sinh(start / w) * mp.exp(-c * mpf("0.4") / w))

    for start in (20.0, 0.3, 0.01, 0.0):  # the exponential of 2*20/0.05 is infinite
        given = (start, 0.5, 0.05)
        assert float(last(*map(jnp.array, given))) == pytest.approx(float(true(*map(mpf, given))), rel=1e-9)
        ours = jax.grad(last, (0, 1, 2))(*map(jnp.array, given))
        for k, one in enumerate(ours):
            at = [mpf(x) for x in given]
            (wanted,) = derivative(lambda x, at=at, k=k: [true(*at[:k], x, *at[k + 1:])], at[k])
            assert float(one) == pytest.approx(float(wanted), rel=1e-7, abs=1e-12)


# --- where derivatives end -------------------------------------------------------------------------------------------


def test_error_estimates_are_those_of_the_run_in_floats() -> None:
    """To rounding; and inf from the same record on in a chaotic run, with a warning."""
    given: dict[str, Any] = {"angle": 1.0, "velocity": 0.0, "dt": 0.1, "duration": 250.0, "every": 5}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        true = rollout("chaotic", integrator="rk4", backend="python", estimate_error=True, **given)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        ours = twin.rollout("chaotic", estimate_error=True, **given)
        jax.effects_barrier()
    assert any(re.match(r"Derivatives of a run of 'chaotic' mean nothing from t = [\d.]+ s, where its error_estimate "
                        "is inf", str(warning.message)) for warning in said)
    assert true.error_estimate is not None
    trusted = np.isfinite(true.error_estimate)
    assert 20 < np.count_nonzero(trusted) < len(trusted)
    assert np.isfinite(np.asarray(ours.error_estimate)).tolist() == trusted.tolist()
    assert np.asarray(ours.error_estimate)[trusted] == pytest.approx(true.error_estimate[trusted], rel=1e-3, abs=1e-13)


def test_an_error_estimate_holds_at_the_end_of_a_run_and_in_a_batch() -> None:
    """After a stop it repeats that of the last whole step; members of a batch have their own."""
    given: dict[str, Any] = {"angle": 3.0, "velocity": 0.0, "dt": 0.01, "speed_limit": 5.0}
    true = rollout("vacuum", duration=3.0, backend="python", estimate_error=True, **given)
    ours = twin.rollout("vacuum", steps=300, estimate_error=True, **given)
    assert true.error_estimate is not None
    assert len(true.angle) < 250
    assert float(ours.error_estimate[-1]) == pytest.approx(true.error_estimate[-1], rel=1e-3)
    single = [twin.rollout("lab", angle=angle, dt=0.02, steps=100, estimate_error=True).error_estimate
              for angle in (0.1, 1.0)]
    batch = twin.rollout("lab", angle=jnp.array([0.1, 1.0]), dt=0.02, steps=100, estimate_error=True)
    assert np.asarray(batch.error_estimate) == pytest.approx(np.asarray(single), rel=1e-6, abs=1e-15)


# --- derivatives of second order --------------------------------------------------------------------------------------


def ended(angle: Any, length: Any, method: str = "rk4", scene: str = "lab") -> Any:
    run = twin.rollout(scene, integrator=method, angle=angle, velocity=0.7, dt=0.25, steps=3, length=length)
    return run.angle[-1] + run.heat[-1]


@pytest.mark.parametrize("method", [
    "rk4", "velocity_verlet", "implicit_midpoint", "gauss4", "ab4", "pefrl"])
def test_second_derivatives_are_differences_of_first_ones(method: str) -> None:
    def result(values: Any) -> Any:
        return ended(*values, method)

    both = jax.jit(lambda values: (jax.grad(result)(values), jax.hessian(result)(values)))
    place, d = jnp.array([0.6, 0.4]), 1e-5
    for i, row in enumerate(both(place)[1]):
        after, before = (both(place.at[i].add(sign * d))[0] for sign in (1.0, -1.0))
        assert np.asarray(row) == pytest.approx(np.asarray((after - before) / (2.0 * d)), rel=1e-5, abs=1e-5)


def test_forward_and_reverse_derivatives_combine_in_every_order() -> None:
    """Each combination is a program of its own, so that one simple scene is enough beside the test above."""
    check_grads(jax.jit(partial(ended, scene="exercise")), (jnp.array(0.6), jnp.array(0.4)), order=2, atol=1e-5,
                rtol=1e-5)


def test_a_division_that_is_not_chosen_leaves_the_derivative_alone() -> None:
    """At rest at the bottom ``sin(x)/x if x != 0 else 1`` has 0/0 on the side that is not chosen."""
    def last(angle: Any) -> Any:
        return twin.rollout("vacuum", integrator="discrete_gradient", angle=angle, velocity=0.0, dt=0.01,
                           steps=20).angle[-1]

    slope = float(last(jnp.array(1e-5)) - last(jnp.array(-1e-5))) / 2e-5
    assert float(jax.grad(last)(0.0)) == pytest.approx(slope, rel=1e-8)


# --- maps, batches, types, memory -------------------------------------------------------------------------------------


def test_a_map_over_lengths_is_a_batch_and_its_single_runs() -> None:
    lengths = jnp.array([0.3, 0.4, 0.5])

    def run(length: Any) -> Any:
        return twin.rollout("lab", angle=0.5, dt=0.01, steps=50, length=length).angle

    mapped = jax.vmap(run)(lengths)
    assert np.asarray(mapped) == pytest.approx(np.asarray(run(lengths)), rel=1e-13)
    for length, angle in zip(lengths, mapped, strict=True):
        true = rollout("lab", angle=0.5, dt=0.01, duration=0.5, length=float(length), backend="python")
        assert np.asarray(angle) == pytest.approx(true.angle, rel=1e-12)


def test_the_step_and_the_actions_may_be_mapped() -> None:
    steps, actions = jnp.array([0.01, 0.02]), jnp.ones((2, 20)) * jnp.array([[0.5], [-0.5]])
    both = jax.vmap(lambda h, acting: twin.rollout("lab", dt=h, actions=acting).angle[-1])(steps, actions)
    one = twin.rollout("lab", dt=0.02, actions=actions[1]).angle[-1]
    assert float(both[1]) == pytest.approx(float(one), rel=1e-13)
    assert float(both[0]) != float(both[1])


def test_the_type_of_numbers_is_stated() -> None:
    assert twin.rollout("lab", steps=10).dtype == "float64"
    single = twin.rollout("lab", steps=10, dtype="float32")
    assert single.dtype == "float32"
    assert single.angle.dtype == jnp.float32
    assert np.asarray(single.angle) == pytest.approx(np.asarray(twin.rollout("lab", steps=10).angle), rel=1e-5)
    with pytest.raises(SceneError, match="no dtype 'float16'"):
        twin.rollout("lab", dtype="float16")


def test_memory_of_a_derivative_grows_with_the_square_root_of_the_steps() -> None:
    def memory(steps: int) -> int:
        def last(angle: Any) -> Any:
            return twin.rollout("lab", angle=angle, steps=steps, every=steps).angle[-1]

        analysis = jax.jit(jax.grad(last)).lower(jnp.array(0.5)).compile().memory_analysis()
        return int(analysis.temp_size_in_bytes)

    few, many = memory(4_000), memory(400_000)
    assert many < 20 * few  # ten times as much, and not a hundred times


def test_a_long_run_has_the_derivative_of_its_parts() -> None:
    """Parts of which only the first state is stored change nothing: 3000 steps at once, and three times 1000."""
    def final(angle: Any, velocity: Any, steps: int) -> Any:
        run = twin.rollout("vacuum", angle=angle, velocity=velocity, dt=0.01, steps=steps, every=steps // 2)
        return jnp.stack([run.angle[-1], run.velocity[-1]])

    start = (jnp.array(1.0), jnp.array(0.2))
    whole = jnp.stack(jax.jacrev(lambda a, v: final(a, v, 3000), (0, 1))(*start), axis=1)
    product, state = jnp.eye(2), jnp.stack(start)
    for _ in range(3):
        product = jax.jacrev(lambda x: final(x[0], x[1], 1000))(state) @ product
        state = final(state[0], state[1], 1000)
    assert np.asarray(whole) == pytest.approx(np.asarray(product), rel=1e-9)


# --- endings ----------------------------------------------------------------------------------------------------------


def test_a_slack_wire_ends_the_run_as_it_does_in_floats_without_a_derivative() -> None:
    scene = SCENES["exercise_large"]
    given = {"angle": 0.0, "velocity": 9.0, "dt": 0.01}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        true = rollout(scene, **given, duration=2.0, backend="python")  # type: ignore[arg-type]
    assert true.stop_reason == "slack"
    ours = twin.rollout(scene, **given, steps=200)  # type: ignore[arg-type]
    assert ours.stop_reason == "slack"
    assert float(ours.time[-1]) == pytest.approx(true.stop_time, rel=1e-10)
    assert float(ours.angle[-1]) == pytest.approx(true.angle[-1], rel=1e-10)

    def last(velocity: Any, steps: int) -> Any:
        return twin.rollout(scene, angle=0.0, velocity=velocity, dt=0.01, steps=steps).angle[-1]

    before = len(true.angle) - 3
    assert before > 10
    assert math.isnan(float(jax.grad(lambda velocity: last(velocity, 200))(jnp.array(9.0))))
    assert math.isfinite(float(jax.grad(lambda velocity: last(velocity, before))(jnp.array(9.0))))


def test_a_speed_limit_ends_the_run() -> None:
    ours = twin.rollout("vacuum", angle=3.0, velocity=0.0, dt=0.01, steps=300, speed_limit=5.0)
    true = rollout("vacuum", angle=3.0, velocity=0.0, dt=0.01, duration=3.0, speed_limit=5.0, backend="python")
    assert ours.stop_reason == true.stop_reason == "speed_limit"
    assert float(ours.time[-1]) == true.stop_time


def test_nonsense_diverges() -> None:
    assert twin.rollout("lab", integrator="forward_euler", dt=5.0, steps=400).stop_reason == "diverged"


# --- one entry is one entry -------------------------------------------------------------------------------------------


def test_a_new_effect_and_a_new_method_need_no_edit(tmp_path: Path) -> None:
    """The README's eddy brake and its method of third order, which the twin has never seen, with their derivatives."""
    found = re.search(r"(from dataclasses.*?)\n\nscene = ", block("adding an effect"), flags=re.S)
    assert found
    path = tmp_path / "brake.py"
    path.write_text(found[1].replace("import gymnasium as gym, pendulum_env\n", ""), encoding="utf-8")
    names: dict[str, Any] = {"__name__": "brake"}
    exec(compile(path.read_text(encoding="utf-8"), str(path), "exec", dont_inherit=True), names)
    brake = names["EddyBrake"]()
    scene = SCENES["vacuum"].with_effects([*SCENES["vacuum"].effects, brake])
    parameter = next(one.name for one in fields(brake) if isinstance(getattr(brake, one.name), float))
    given: dict[str, Any] = {"integrator": method_of_readme(), "angle": 1.0, "velocity": 0.3, "dt": 0.01}
    true = rollout(scene, duration=2.0, backend="python", **given)
    ours = twin.rollout(scene, steps=200, **given)
    assert np.asarray(ours.angle) == pytest.approx(true.angle, rel=1e-12, abs=1e-12)
    assert np.asarray(ours.heat) == pytest.approx(true.ledger.heat, rel=1e-12, abs=1e-15)
    assert true.ledger.heat[-1] > 0.0

    def last(value: Any) -> Any:
        return twin.rollout(scene, steps=200, every=200, **given, parameters={parameter: value}).angle[-1]

    value = getattr(brake, parameter)
    slope = jax.grad(last)(value)
    d = 1e-3 * value
    sides = [rollout(scene.replace(**{parameter: value + sign * d}), duration=2.0, backend="python", **given).angle[-1]
             for sign in (1.0, -1.0)]
    assert float(slope) == pytest.approx((sides[0] - sides[1]) / (2.0 * d), rel=1e-6)


# --- refusals ---------------------------------------------------------------------------------------------------------


def kinked(theta: Any, omega: Any, dt: Any, acceleration: Callable[..., Any]) -> Any:
    change = dt * acceleration(theta)
    omega = omega + change if theta > 0.0 else change + omega
    return theta + dt * omega, omega


@pytest.mark.parametrize(("words", "scene", "keywords"), [
    ("coulomb_friction has no twin in JAX: .* have no derivative; smooth it, as with smooth=0.01 .rad/s., leave it out",
     "sticky_bearing", {}),
    ("smooth is for dry friction, which the scene 'lab' does not have; leave it out", "lab", {"smooth": 0.01}),
    ("smooth must be a finite number of at least 1e-09 .rad/s., not 0", "sticky_bearing", {"smooth": 0.0}),
    ("estimate_error must be True or False, not 1", "lab", {"estimate_error": 1}),
    ("compensated has no twin in JAX, whose compiler may .* sums; leave it out, or use pendulum_env.rollout",
     "lab", {"compensated": True}),
    ("rtol has no twin in JAX, where the number of steps must be known", "lab", {"rtol": 1e-9}),
    ("no parameter 'lenght'; did you mean length", "lab", {"lenght": jnp.array(1.0)}),
    ("no parameter 'lenght'; did you mean length", "lab", {"lenght": 1.0}),
    ("mass must be a finite number above 0", "lab", {"mass": jnp.array(-1.0)}),
    ("every must divide the number of steps, 10, in JAX", "lab", {"steps": 10, "every": 3}),
    ("Give duration or steps, not both", "lab", {"steps": 10, "duration": 1.0}),
    ("With dt as an array, give steps", "lab", {"dt": jnp.array(0.01)}),
    ("actions give the length of the run", "lab", {"actions": jnp.ones(3), "steps": 3}),
    ("actions must be an array with one number per control step", "lab", {"actions": 1.0}),
    ("has different formulas for the values of density|needs different formulas for the values of density", "lab",
     {"density": jnp.array([0.0, 1.2])}),
])
def test_what_cannot_be_done_is_refused_in_a_sentence(words: str, scene: str, keywords: dict[str, Any]) -> None:
    with pytest.raises((SceneError, MethodError), match=words):
        twin.rollout(scene, **keywords)


def test_a_step_that_calls_python_is_refused() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        own = integrators.from_step(kinked)
    with pytest.raises(MethodError, match="kinked calls the Python function own_step, which JAX cannot trace"):
        twin.rollout("vacuum", integrator=own)


def test_a_parameter_without_a_number_is_refused_while_tracing() -> None:
    def last(c: Any) -> Any:
        return twin.rollout("lab", steps=10, c=c).angle[-1]

    with pytest.raises(SceneError, match=r"The parameter c of the scene 'lab' is None, .* give the scene one first"):
        jax.grad(last)(0.1)


def test_a_parameter_has_its_full_name_too() -> None:
    def last(length: Any, name: str) -> Any:
        return twin.rollout("lab", steps=10, **{name: length}).angle[-1]

    short, full = (float(jax.grad(last)(0.4, name)) for name in ("length", "body.length"))
    assert short == full
    with pytest.raises(SceneError, match=r"no parameter .body\.lenght.; did you mean body\.length"):
        jax.grad(last)(0.4, "body.lenght")


@pytest.mark.parametrize("name", ["lag", "ramp", "dead_zone"])
def test_a_parameter_that_zero_turns_off_is_refused_while_tracing(name: str) -> None:
    """A motor with no lag has another program than one that lags: a derivative at 0 would be that of nothing."""
    def last(value: Any) -> Any:
        return twin.rollout("lab", actions=jnp.ones(20), **{name: value}).angle[-1]

    with pytest.raises(SceneError, match=f"The parameter {name} of the scene 'lab' is 0, where other formulas hold"):
        jax.jit(last)(0.3)


def test_a_parameter_that_is_zero_like_any_other_value_is_traced() -> None:
    def last(phase: Any) -> Any:
        return twin.rollout("chaotic", steps=20, drive_phase=phase).angle[-1]

    d = 1e-5
    slope = (float(last(jnp.array(d))) - float(last(jnp.array(-d)))) / (2.0 * d)
    assert float(jax.jit(jax.grad(last))(0.0)) == pytest.approx(slope, rel=1e-6)
