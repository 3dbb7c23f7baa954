"""Checks of the environment in JAX beside the one of ``gym.make``, and of its loops. Run by test_twin.py."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from types import SimpleNamespace
from typing import Any

import gymnasium as gym
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gymnasium.experimental.functional import FuncEnv
from scipy import stats

import pendulum_env.jax as twin
from pendulum_env import SCENES, Scene, Sensor, Task
from pendulum_env.engine.machine import numbers_of
from pendulum_env.envs.randomize import Joint
from pendulum_env.jax.env import drawn
from pendulum_env.physics.effects import Gravity, LinearDrag
from pendulum_env.physics.random import MOST
from pendulum_env.physics.units import SceneError
from pendulum_env.tasks import TASKS, TaskError

jax.config.update("jax_enable_x64", True)
START = {"angle": 3.0, "velocity": 0.4}
LIGHT: dict[str, Any] = {"integrator": "symplectic_euler", "diagnostics": ()}
"""Settings with a step that JAX compiles quickly."""


def spin(velocity: float, phi: float, angle_before: float) -> float:
    return velocity - 0.1 * phi**2 if angle_before > 3.0 else 0.5 * velocity


def spun(phi: float) -> bool:
    return phi > 1.0


@dataclass(frozen=True, repr=False)
class Stepped(LinearDrag):
    """A drag whose formula has a condition."""

    def coefficients(self, scene: Any) -> dict[str, float]:
        return {"linear_drag_rate": 0.1 if scene.body.length < 0.4 else 0.2}


def echo(action: float) -> float:
    return action


SPIN = Task("spin", spin, spun, start=lambda first, second, omega0: (first, omega0 * second))


def beside(keywords: dict[str, Any], steps: int = 80, ours: Any = None, state: Any = None) -> None:
    """AssertionError unless an episode with drawn actions is that of ``gym.make``."""
    ours = ours or twin.LabPendulum(**keywords)
    theirs = gym.make("pendulum_env:LabPendulum-v0", backend="python", max_episode_steps=-1, disable_env_checker=True,
                      **keywords)
    seen, info = theirs.reset(seed=1, options=dict(START))
    if state is None:
        state = ours.started(START["angle"], START["velocity"], rng=jax.random.key(0))
    if streams := ours.twin.program.shape.drawn:
        values = theirs.unwrapped.get_state()["state"]
        state = replace(state, values=tuple(jnp.asarray(values[i]) if name in streams else value for i, (name, value)
                                            in enumerate(zip(ours.twin.names, state.values, strict=False))))
    assert np.asarray(ours.observation(state)) == pytest.approx(seen, abs=1e-6)
    step = compiled(ours)
    source = np.random.default_rng(2)
    for _ in range(steps):
        action = source.uniform(-1.2, 1.2, 1).astype(np.float32)
        seen, reward, ended, _, info = theirs.step(action)
        state, observed, given, ends, told = step(state, action)
        assert observed.dtype == jnp.float32
        assert np.asarray(observed) == pytest.approx(seen, abs=1e-6)
        assert float(given) == pytest.approx(reward, rel=1e-10, abs=1e-12)
        assert bool(ends) == ended
        assert ("observed_angle" in told) == ("observed_angle" in info)
        for name in told:
            assert float(told[name]) == pytest.approx(info[name], rel=1e-9, abs=1e-12)
        if ended:
            break


@lru_cache(maxsize=1)
def compiled(env: Any) -> Any:
    """Return a control step and what is seen after it as one compiled function."""
    def step(state: Any, action: Any) -> Any:
        after = env.transition(state, action)
        return (after, env.observation(after), env.reward(state, action, after), env.terminal(after),
                env.state_info(after))

    return jax.jit(step)


@pytest.mark.parametrize("task", [*TASKS, SPIN], ids=lambda task: getattr(task, "name", task))
def test_a_task_is_that_of_gym_make(task: Any) -> None:
    beside({"task": task})


@pytest.mark.parametrize("keywords", [
    {"integrator": "ab4", "substeps": 12}, {"lag": 0.1, "substeps": 3}, {"scene": "lab_rod", "length": 0.5},
    {"task": "free", "speed_limit": 5.0}, {"integrator": "gauss4", "dt": 0.05},
    {"speed_limit": 5.0, "speed_penalty": 100.0, "reward_rate": True}, {"velocity_bound": 2.0},
    {"task": "balance", "speed_penalty": 100.0, "reward_rate": True, "velocity_bound": 1.0},
    {"scene": "gymnasium", "task": "gymnasium"},
], ids=str)
def test_other_settings_are_those_of_gym_make(keywords: dict[str, Any]) -> None:
    beside(keywords)


def test_it_is_gymnasiums_functional_interface() -> None:
    env = twin.LabPendulum()
    assert isinstance(env, FuncEnv)
    state = env.initial(jax.random.key(0))
    assert env.observation_space.contains(np.asarray(env.observation(state)))
    angles = jax.jit(jax.vmap(lambda key: env.state_info(env.initial(key))["angle"]))(
        jax.random.split(jax.random.key(1), 400))
    assert float(jnp.abs(angles).max()) <= 0.1
    assert float(jnp.std(angles)) == pytest.approx(0.1 / np.sqrt(3.0), rel=0.1)


def test_a_loop_in_gymnaxs_style_starts_again_within_the_step() -> None:
    """4 environments, episodes of 25 steps; observations after an end are those of a new start."""
    env = twin.LabPendulum(task="swing_up", max_steps=25, **LIGHT).gymnax()
    keys = jax.random.split(jax.random.key(0), 4)
    seen, state = jax.jit(jax.vmap(env.reset))(keys)
    assert seen.shape == (4, 3)

    def turn(carry: Any, key: Any) -> Any:
        state, _ = carry
        results = jax.vmap(env.step)(jax.random.split(key, 4), state, jnp.ones((4, 1)))
        seen, after, reward, done, info = results
        return (after, seen), (done, seen, reward, after.time, info["final_observation"])

    keys = jax.random.split(jax.random.key(1), 60)
    _, (done, seen, reward, time, final) = jax.jit(lambda carry: jax.lax.scan(turn, carry, keys))((state, seen))
    assert np.flatnonzero(np.asarray(done)[:, 0]).tolist() == [24, 49]
    assert bool(jnp.isfinite(reward).all())
    assert np.asarray(time)[24].tolist() == [0] * 4
    assert float(jnp.abs(jnp.arctan2(seen[24, :, 1], seen[24, :, 0])).max()) <= 0.1 + 1e-6
    assert float(jnp.abs(final[24] - seen[24]).max()) > 0.1


def test_dry_friction_may_be_smoothed() -> None:
    place = SCENES["motor_bench"]
    smooth = place.with_effects(effect.smoothed(0.05) for effect in place.effects)
    assert twin.LabPendulum(place, smooth=0.05).scene == smooth
    beside({"scene": smooth}, 20)


def test_a_new_start_within_the_step_has_a_key_of_its_own() -> None:
    """Where readings are noisy: the start is that of the second half of the step's key, and the step takes the first.
    """
    env = twin.LabPendulum(sensor=Sensor(noise=0.01), max_steps=1)
    loop, (first, second) = env.gymnax(), jax.random.split(key := jax.random.key(5))
    _, state = loop.reset(jax.random.key(4))
    _, new, _, done, info = loop.step(key, state, jnp.zeros(1))
    assert bool(done)
    for one, other in zip(jax.tree.leaves(new), jax.tree.leaves(env.initial(second)), strict=True):
        assert np.asarray(one).tolist() == np.asarray(other).tolist()
    after = env.observation(env.transition(state, jnp.zeros(1), first))
    assert np.asarray(info["final_observation"]) == pytest.approx(np.asarray(after), rel=1e-6)


def test_parameters_may_differ_between_environments() -> None:
    env = twin.LabPendulum()
    lengths = jnp.array([0.3, 0.5])
    params = jax.jit(jax.vmap(lambda length: env.get_default_params(length=length)))(lengths)
    assert np.asarray(params.omega0) == pytest.approx(
        [float(env.get_default_params(length=jnp.array(one)).omega0) for one in (0.3, 0.5)], rel=1e-14)
    states = jax.jit(jax.vmap(lambda p: env.transition(env.started(0.5, 0.0, None, p), jnp.zeros(1), None, p)))(params)
    assert float(states.values[1][0]) != float(states.values[1][1])


def test_the_return_has_a_derivative_by_the_actions() -> None:
    env = twin.LabPendulum()
    start = env.started(0.5, 0.0)

    @jax.jit
    def total(actions: Any) -> Any:
        def turn(state: Any, action: Any) -> Any:
            after = env.transition(state, action)
            return after, env.reward(state, action, after)

        return jax.lax.scan(turn, start, actions)[1].sum()

    actions = jnp.linspace(-0.5, 0.5, 10)
    slopes, d = jax.jit(jax.grad(total))(actions), 1e-5
    for i in (0, 9):
        nudge = jnp.zeros(10).at[i].set(d)
        truth = float(total(actions + nudge) - total(actions - nudge)) / (2 * d)
        assert float(slopes[i]) == pytest.approx(truth, rel=1e-6)


# --- sensors and delays ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("keywords", [
    {"action_delay": 0.012, "substeps": 5, "observation": "encoder"},
    {"observation": "history", "history": 3, "observation_delay": 0.04, "task": "balance", "action_delay": 0.04},
    {"sensor": Sensor(quantum=0.01, scale=1.1, offset=0.02, zero="at_start"), "observation_delay": 0.008, "substeps": 5,
     "speed_limit": 5.0},
    {"observation": "encoder", "sensor": {"quantum": 0.005, "rate": 200.0, "corner": 20.0}, "substeps": 8,
     "observation_delay": 0.01},
    {"observation": "encoder", "sensor": Sensor(rate=25.0, window=2.0), "substeps": 4, "observation_delay": 0.03,
     "lag": 0.05, "action_delay": 0.015},
    {"integrator": "ab2", "substeps": 12, "action_delay": 0.005},
    {"task": "track", "observation": "angle", "observation_delay": 0.02},
    {"observation": "encoder", "velocity_bound": 2.0}, {"observation": "history", "velocity_bound": 0.1},
    {"scene": "textbook", "task": "free", "observation": "history"},
    {"scene": "gymnasium", "task": "gymnasium", "observation": "encoder", "observation_delay": 0.05},
    {"scene": "windy", "task": "free", "sensor": {"scale": 0.9}, "action_delay": 0.02},
], ids=str)
def test_readings_and_delays_are_those_of_gym_make(keywords: dict[str, Any]) -> None:
    beside({**LIGHT, **keywords}, steps=30)


def test_drawn_delays_are_kept_for_an_episode_and_drawn_with_equal_chances() -> None:
    env = twin.LabPendulum(observation_delay=(0.0, 0.05), action_delay=(0.01, 0.03), substeps=2, **LIGHT)
    states = jax.jit(jax.vmap(lambda key: env.started(*START.values(), rng=key)))(
        jax.random.split(jax.random.key(3), 3000))
    seen = 2 * states.sensed.own["lag"] + 2 - states.sensed.own["late"]
    acts = states.sensed.acts_late
    for drawn_ones, low, high in ((seen, 0, 5), (acts, 1, 3)):
        values, counts = np.unique(np.asarray(drawn_ones), return_counts=True)
        assert values.tolist() == [*range(low, high + 1)]
        assert stats.chisquare(counts).pvalue > 1e-3
    assert abs(np.corrcoef(seen, acts)[0, 1]) < 4.0 / np.sqrt(3000.0)
    for i in np.unique(np.asarray(seen), return_index=True)[1]:
        fixed = {"observation_delay": int(seen[i]) * 0.01, "action_delay": int(acts[i]) * 0.01, "substeps": 2,
                 **LIGHT}
        beside(fixed, 12, env, jax.tree.map(lambda leaf, i=i: leaf[i], states))


def test_noise_and_lost_readings_have_their_distributions() -> None:
    """A bob at rest, seen by 3000 sensors: readings are Gaussian and independent, and lost ones repeat the last."""
    many, noise, lost = 3000, 0.01, 0.25
    sensor = Sensor(noise=noise, dropout=lost, offset=0.1)
    env = twin.LabPendulum("textbook", task="free", sensor=sensor, dtype="float32", **LIGHT)
    assert env.noisy

    @jax.vmap
    def angles(key: Any) -> Any:
        first, *later = jax.random.split(key, 4)
        state, rows = env.started(0.0, 0.0, rng=first), []
        for own in [None, *later]:
            state = state if own is None else env.transition(state, jnp.zeros(1), own)
            rows.append(env.state_info(state)["observed_angle"])
        return jnp.stack(rows)

    rows = np.asarray(jax.jit(angles)(jax.random.split(jax.random.key(5), many)))
    assert rows.dtype == "float32"
    repeats = np.diff(rows, axis=1) == 0.0
    assert abs(repeats.sum() - 3 * many * lost) < 4.0 * np.sqrt(3 * many * lost * (1.0 - lost))
    assert abs(np.corrcoef(repeats.T)[0, 1]) < 4.0 / np.sqrt(many)
    assert stats.kstest(rows[:, 0], stats.norm(0.1, noise).cdf).pvalue > 1e-3
    kept = ~repeats[:, 0]
    assert stats.kstest(rows[kept, 1], stats.norm(0.1, noise).cdf).pvalue > 1e-3
    assert abs(np.corrcoef(rows[kept, 0], rows[kept, 1])[0, 1]) < 4.0 / np.sqrt(kept.sum())


def test_a_reading_has_the_derivative_of_its_angle_and_a_rounded_one_none() -> None:
    """Noise is a constant for the derivative; a delayed action has that of the step in which it acts."""
    def seen(angle: Any, sensor: Any) -> Any:
        env = twin.LabPendulum(task="free", sensor=sensor, **LIGHT)
        return env.state_info(env.started(angle, 0.0, rng=jax.random.key(0)))["observed_angle"]

    value_and_slope = jax.jit(jax.value_and_grad(seen), static_argnums=1)
    assert float(value_and_slope(0.5, Sensor(noise=0.1, scale=1.1))[1]) == pytest.approx(1.1, rel=1e-14)
    assert value_and_slope(0.52, Sensor(quantum=0.1)) == (pytest.approx(0.5, rel=1e-14), 0.0)
    env = twin.LabPendulum(action_delay=0.03, substeps=2, **LIGHT)

    @jax.jit
    def last(actions: Any) -> Any:
        return jax.lax.scan(lambda state, action: (env.transition(state, action), None), env.started(0.5, 0.0),
                            actions)[0].values[env.twin.names.index("velocity")]

    actions, d = jnp.linspace(-0.5, 0.5, 4), 1e-5
    slopes = np.asarray(jax.jit(jax.grad(last))(actions))
    truth = [float(last(actions.at[i].add(d)) - last(actions.at[i].add(-d))) / (2 * d) for i in range(4)]
    assert slopes == pytest.approx(truth, rel=1e-6)
    assert slopes[3] == 0.0 != slopes[2]  # actions are one and a half control steps late


def test_options_that_are_off_take_no_arrays_and_no_random_numbers() -> None:
    env, key = twin.LabPendulum(), jax.random.key(0)
    state = env.started(0.5, 0.0)
    assert len(jax.tree.leaves(state)) == env.twin.size + 2
    assert "random" not in str(jax.make_jaxpr(env.transition)(state, jnp.zeros(1), key))
    assert str(jax.make_jaxpr(env.initial)(key)).count("random_bits") == 1
    late = twin.LabPendulum(action_delay=0.02)
    assert len(jax.tree.leaves(late.started(0.5, 0.0))) == env.twin.size + 2 + 3  # the last 3 actions


def test_noise_of_actions_is_normal_and_the_reward_counts_it() -> None:
    env = twin.LabPendulum(task=Task("echo", echo), action_noise=0.2, **LIGHT)
    keys = jax.random.split(jax.random.key(0), 4000)
    state = jax.vmap(env.initial)(keys)
    after = jax.jit(jax.vmap(env.transition, (0, None, 0)))(state, 0.1, keys)
    acted = np.asarray(jax.vmap(env.reward, (0, None, 0))(state, 0.1, after))
    assert stats.kstest(acted, stats.norm(0.1, 0.2).cdf).pvalue > 1e-3
    assert np.array_equal(acted, after.acted)
    still = jax.vmap(env.transition, (0, None, 0))(state, -9.0, keys)
    assert float(still.acted.min()) == -1.0


def test_a_loop_of_environments_with_everything_random_starts_again_within_the_step() -> None:
    ranges = {"length": (0.3, 0.4), "wind_speed": ("log", 1.0, 4.0), "gust_time": [0.25, 0.5]}
    env = twin.LabPendulum("windy", task="free", duration=0.2, randomize=[ranges, bootstrap()],
                           sensor={"noise": 0.01, "dropout": 0.1}, observation="encoder", action_delay=(0.0, 0.06),
                           observation_delay=(0.0, 0.04), **LIGHT).gymnax(split=True)
    seen, state = jax.jit(jax.vmap(env.reset))(jax.random.split(jax.random.key(0), 3))
    assert seen.shape == (3, *env.observation_space().shape)

    @jax.vmap
    def step(key: Any, state: Any) -> Any:
        return env.step(key, state, jnp.ones(1))

    def turn(state: Any, key: Any) -> Any:
        seen, after, _, terminated, truncated, info = step(jax.random.split(key, 3), state)
        return after, (after, seen, truncated & ~terminated, info["final_observation"])

    _, (states, seen, done, final) = jax.jit(lambda state, keys: jax.lax.scan(turn, state, keys))(
        state, jax.random.split(jax.random.key(1), 45))
    starts = np.flatnonzero(np.asarray(done)[:, 0])
    assert starts.tolist() == [9, 19, 29, 39]
    sensed = jax.tree.map(lambda leaf: np.asarray(leaf)[starts], states.sensed)
    assert not np.any(sensed.actions)
    readings = np.stack(sensed.rings["x"])
    assert (readings == readings[0]).all()
    assert not (seen[starts] == final[starts]).all(axis=-1).any()
    for values in (np.asarray(states.values[env.env.twin.names.index(env.env.twin.program.shape.drawn[0])])[starts],
                   np.asarray(states.params.omega0)[starts], readings[0]):
        assert np.unique(values).size == 12
    late = {*sensed.acts_late.ravel().tolist()}
    assert late <= {0, 1, 2, 3}
    assert len(late) > 1
    decay = states.params.numbers[env.env.twin.program.shape.params.index("gust_decay")]
    assert np.unique(decay).tolist() == [2.0, 4.0]
    assert bool(jnp.isfinite(seen).all())


@pytest.mark.parametrize(("words", "call"), [
    ("takes a key, as in started", lambda: twin.LabPendulum("windy", task="free").started(0.5, 0.0)),
    ("takes a key, as in started", lambda: twin.LabPendulum(action_delay=(0.0, 0.02)).started(0.5, 0.0)),
    ("takes a key, as in transition", lambda: (env := twin.LabPendulum(sensor={"noise": 0.1})).transition(
        env.initial(jax.random.key(0)), jnp.zeros(1))),
    ("takes a key, as in transition", lambda: (env := twin.LabPendulum(action_noise=0.1)).transition(
        env.initial(jax.random.key(0)), jnp.zeros(1))),
    ("unexpected keyword argument 'action_nois'; did you mean action_noise", lambda: twin.LabPendulum(action_nois=0.1)),
    ("random numbers of gusts need float64; .* or leave the effect out",
     lambda: twin.LabPendulum("windy", task="free", dtype="float32")),
    ("function of a NumPy generator as randomize has no twin in JAX, .*; give ranges or a fit",
     lambda: twin.LabPendulum(randomize=lambda source: {"length": source.uniform(0.3, 0.4)})),
    ("the scene 'lab' has no parameter 'lenght'; did you mean length",
     lambda: twin.LabPendulum(randomize={"lenght": (0.3, 0.4)})),
    ("Give duration or max_steps, not both", lambda: twin.LabPendulum(duration=1.0, max_steps=50)),
    ("duration=0.03 s is not a whole number of control steps", lambda: twin.LabPendulum(duration=0.03)),
    ("observation_delay must be a whole number of steps of 0.02 s", lambda: twin.LabPendulum(observation_delay=0.03)),
    ("length=0.[35].* calls for other formulas .* give the scene itself values within",
     lambda: twin.LabPendulum(Scene("stepped", effects=(Gravity(), Stepped(gamma=0.1))), task="free",
                              randomize={"length": (0.3, 0.5)})),
], ids=str)
def test_what_cannot_be_done_is_refused_in_a_sentence(words: str, call: Any) -> None:
    with pytest.raises((SceneError, TaskError), match=words):
        call()


# --- random parameters ------------------------------------------------------------------------------------------------

ROWS = np.array([[0.02, 1e-5], [0.03, 2e-5], [0.04, 3e-5], [0.05, 4e-5], [0.06, -1e-5]])
"""Rows of a bootstrap; the last one is below the bound of its second parameter."""


def bootstrap(rows: Any = ROWS) -> Any:
    """Return an object with rows of masses and bearing's viscosities, as a bootstrap or posterior has."""
    return SimpleNamespace(scatter=SimpleNamespace(
        names=("mass", "bearing_viscosity"), values=ROWS.mean(axis=0), covariance=np.cov(ROWS.T), least=np.zeros(2),
        rows=rows))


def test_draws_from_a_posterior_are_its_rows_and_gusts_begin_at_whole_numbers_with_equal_chances() -> None:
    env, many = twin.LabPendulum("windy", task="free", randomize=bootstrap(), **LIGHT), 2000
    states = jax.jit(jax.vmap(env.initial))(jax.random.split(jax.random.key(7), many))
    for name in env.twin.program.shape.drawn:
        stream = np.asarray(states.values[env.twin.names.index(name)])
        assert (stream == np.round(stream)).all()
        assert stats.kstest(stream, stats.uniform(1.0, MOST).cdf).pvalue > 1e-4
    found = np.stack(states.params.numbers, axis=1)
    known = [numbers_of(SCENES["windy"].replace(mass=mass, bearing_viscosity=c)) for mass, c in ROWS[:4]]
    known = [{"hold": 1.0, **one} for one in known]
    rows = np.array([[one[name] for name in env.twin.program.shape.params] for one in known])
    near = np.all(np.abs(found[:, None] - rows) <= 1e-12 * np.abs(rows), axis=2)
    assert (near.sum(axis=1) == 1).all()
    assert stats.chisquare(near.sum(axis=0)).pvalue > 1e-3


def test_draws_from_a_covariance_are_normal_above_their_bounds() -> None:
    covariance = np.array([[4e-4, 1e-4], [1e-4, 1e-4]])
    given = SimpleNamespace(names=("length", "c"), values=np.array([0.35, 0.005]), covariance=covariance, rows=None,
                            least=np.array([-np.inf, 0.0]))
    keys = jax.random.split(jax.random.key(9), 4000)

    @jax.jit
    def many(least: Any) -> Any:
        joint = Joint(given)
        joint.least = least
        return jax.vmap(lambda key: drawn(joint, jnp.zeros(()), key))(keys)

    bounded, unbounded = many(given.least), many(np.full(2, -np.inf))
    assert float(bounded["c"].min()) >= 0.0
    assert stats.kstest(bounded["c"], stats.truncnorm(-0.5, np.inf, loc=0.005, scale=0.01).cdf).pvalue > 1e-3
    assert stats.kstest(unbounded["length"], stats.norm(0.35, 0.02).cdf).pvalue > 1e-3
    correlation = np.corrcoef(unbounded["length"], unbounded["c"])[0, 1]
    assert correlation == pytest.approx(0.5, abs=4.0 * 0.75 / np.sqrt(4000.0))
