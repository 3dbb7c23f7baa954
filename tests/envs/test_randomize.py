"""Tests of parameters that are drawn for every episode: their distributions, bits, saved states and refusals."""

from __future__ import annotations

import copy
import pickle
from types import SimpleNamespace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from scipy import stats
from vector_steps import MODES, same, side_by_side, vector

from pendulum_env import SCENES, LabPendulumEnv, LabPendulumVectorEnv, Recording, SceneError, fit
from pendulum_env.engine.each import Each
from pendulum_env.engine.machine import numbers_of
from pendulum_env.engine.random_streams import Streams
from pendulum_env.envs.randomize import OneStream, Randomization

RANGES: dict[str, Any] = {"length": (0.3, 0.4), "mass": ("log", 0.03, 0.05), "max_torque": [0.04, 0.05, 0.06]}
ZERO = np.zeros(1, np.float32)


def scatter(least: Any = (0.0, 0.0, 0.0)) -> Any:
    """Return an object with the distribution of a fit: three correlated parameters, the last one near its bound."""
    covariance = np.array([[4e-4, 1e-4, 0.0], [1e-4, 1e-4, -5e-5], [0.0, -5e-5, 1e-4]])
    return SimpleNamespace(scatter=SimpleNamespace(
        names=("length", "mass", "viscous_rate"), values=np.array([0.35, 0.04, 0.005]), covariance=covariance,
        least=np.array(least), rows=None))


def by_generator(source: np.random.Generator) -> dict[str, float]:
    """Draw by a generator in ways that take 32-bit halves of its numbers, too."""
    mass = 0.03 + 0.001 * float(source.integers(0, 20, dtype=np.int32))
    return {"length": source.triangular(0.3, 0.35, 0.4), "mass": mass}


# --- one environment and many ---------------------------------------------------------------------------------------


def compare(mode: str, steps: int = 40, **options: Any) -> None:
    """Compare a vector with single environments, which draw and restart often, in every bit and entry of info."""
    common = {"max_episode_steps": 13, "speed_limit": 0.6, "backend": "python", **options}
    theirs = gym.make_vec("LabPendulum-v0", num_envs=3, vectorization_mode="sync",
                          vector_kwargs={"autoreset_mode": mode}, **common)
    assert side_by_side(vector(3, autoreset_mode=mode, **common), theirs, mode, steps) >= 3


@pytest.mark.quick("ranges-NextStep", "gusts-SameStep", "errors-Disabled")
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("options", [
    {"randomize": RANGES}, {"randomize": by_generator, "diagnostics": ()},
    {"randomize": {"length": (0.3, 0.4)}, "scene": "windy", "task": "free"},
    {"randomize": [{"max_torque": (0.04, 0.06)}, by_generator], "diagnostics": ("energy", "error"), "substeps": 4},
], ids=["ranges", "function", "gusts", "errors"])
def test_environment_i_draws_what_the_single_one_draws(mode: str, options: dict[str, Any]) -> None:
    compare(mode, **options)


def test_streams_that_begin_anew_drop_what_was_drawn_ahead() -> None:
    """Check resets with a seed for some environments: the others go on with their own streams, as single ones do."""
    common: dict[str, Any] = {"randomize": RANGES, "backend": "python", "max_episode_steps": 13, "speed_limit": 0.5}
    mine = vector(3, autoreset_mode="SameStep", **common)
    theirs = gym.make_vec("LabPendulum-v0", num_envs=3, vectorization_mode="sync",
                          vector_kwargs={"autoreset_mode": "SameStep"}, **common)
    source, apart = np.random.default_rng(1), 0
    for seeds in (3, [None, 5, None], None, [7, None, 7], 9, [1, 2, None]):
        same(mine.reset(seed=seeds), theirs.reset(seed=seeds), str(seeds))
        for _ in range(16):
            actions = source.uniform(-1.2, 1.2, (3, 1)).astype(np.float32)
            found, wanted = mine.step(actions), theirs.step(actions)
            same(found, wanted, str(seeds))
            apart += 0 < (wanted[2] | wanted[3]).sum() < 3
    assert apart > 5


def test_a_fit_is_drawn_alike_by_single_and_vector() -> None:
    found = scatter()
    names = ("length", "mass", "gamma")
    found.scatter.names = names
    compare("NextStep", randomize=found, damping={"linear": {"gamma": 0.005}})


@pytest.mark.slow
def test_compiled_vector_draws_what_the_interpreted_single_one_draws() -> None:
    compare("SameStep", randomize=RANGES, backend="auto")


def test_many_restarts_at_once_have_the_numbers_of_scenes_built_one_by_one() -> None:
    """Check groups of environments, whose numbers are computed together, against a scene for each."""
    places, masses = np.arange(3, 43), np.linspace(0.02, 0.06, 50)
    each = Each("lab", "scene", None, {"mass": masses}, 50)
    lengths = np.random.default_rng(0).uniform(0.1, 2.0, 40)
    numbers = each.take(places, {"length": lengths})
    for i, place in enumerate(places):
        scene = SCENES["lab"].replace(mass=float(masses[place]), length=float(lengths[i]))
        expected = {**numbers_of(scene), "omega0": scene.omega0, "speed_limit": 100.0 * scene.omega0}
        assert {name: float(column[i]) for name, column in numbers.items()} == expected
        assert each.of(int(place)) == scene
    assert each.of(0) == SCENES["lab"].replace(mass=0.02)
    with pytest.raises(SceneError, match="In environment 4 of 50: length must be"):
        each.take(places, {"length": np.where(places == 4, -1.0, lengths)})


# --- what is drawn --------------------------------------------------------------------------------------------------


def draws(given: Any, count: int = 4000) -> dict[str, np.ndarray]:
    return Randomization(given).drawn(Streams(range(count)), np.arange(count), "python")


def test_ranges_have_their_distributions() -> None:
    """Check uniform and log-uniform draws by Kolmogorov and Smirnov's test, and choices by chi-squared."""
    drawn = draws(RANGES)
    assert stats.kstest(drawn["length"], stats.uniform(0.3, 0.1).cdf).pvalue > 0.01
    assert stats.kstest(drawn["mass"], stats.loguniform(0.03, 0.05).cdf).pvalue > 0.01
    values, counts = np.unique(drawn["max_torque"], return_counts=True)
    assert values.tolist() == RANGES["max_torque"]
    assert stats.chisquare(counts).pvalue > 0.01
    assert abs(np.corrcoef(drawn["length"], drawn["mass"])[0, 1]) < 0.05


@pytest.mark.slow
def test_a_fit_has_its_mean_and_covariance() -> None:
    """Check that the draws have the moments of the fit, and the normal distribution, if no bound is near."""
    found = scatter(least=(-np.inf,) * 3).scatter
    drawn = np.array(list(draws(SimpleNamespace(scatter=found), 20_000).values()))
    error = np.sqrt(np.diag(found.covariance) / 20_000)
    assert np.all(np.abs(drawn.mean(axis=1) - found.values) < 4.0 * error)
    sizes = np.sqrt(np.outer(np.diag(found.covariance), np.diag(found.covariance)))
    assert np.all(np.abs(np.cov(drawn) - found.covariance) < 4.0 * sizes * np.sqrt(2.0 / 20_000))
    for row, mean, variance in zip(drawn, found.values, np.diag(found.covariance), strict=True):
        assert stats.kstest(row, stats.norm(mean, np.sqrt(variance)).cdf).pvalue > 0.01


@pytest.mark.slow
def test_bounds_of_a_fit_hold() -> None:
    """Check that values below their bounds are drawn again: the last parameter has a truncated normal distribution."""
    found = scatter().scatter
    last = draws(SimpleNamespace(scatter=found), 4000)["viscous_rate"]
    assert last.min() >= 0.0
    # the bounds of the other two parameters are 4 and 17 standard deviations away, so that only this one's counts
    assert stats.kstest(last, stats.truncnorm(-0.5, np.inf, loc=0.005, scale=0.01).cdf).pvalue > 0.01
    found.values[2] = -1.0
    with pytest.raises(SceneError, match="none of 1000 draws of length, mass, viscous_rate is within the bounds"):
        draws(SimpleNamespace(scatter=found), 1)


@pytest.mark.slow
def test_a_real_fit_and_its_bootstrap_can_be_drawn_from() -> None:
    time = np.arange(0.0, 12.0, 0.05)
    swing = np.exp(-0.05 * time) * np.cos(5.2 * time) * 0.2
    noise = 0.002 * np.random.default_rng(0).standard_normal(len(time))
    found = fit(Recording(time, swing + noise, "swing"), effects="linear", mass=0.04)
    names = found.scatter.names
    assert {*names} == {"length", "linear_drag.gamma"}
    for source in (found, found.bootstrap(5)):
        env = gym.make("LabPendulum-v0", scene=found.scene, task="free", randomize=source, backend="python")
        drawn = env.reset(seed=1)[1]["parameters"]
        assert tuple(drawn) == names
        assert abs(drawn["length"] - found.scene.body.reach) < 6.0 * found.parameters["length"].error
    assert any(np.allclose([drawn[name] for name in names], row) for row in source.scatter.rows)


def test_a_function_gets_the_environments_own_generator() -> None:
    env = LabPendulumEnv(randomize=by_generator, backend="python")
    _, info = env.reset(seed=5)
    assert info["parameters"] == by_generator(np.random.default_rng(5))


# --- what follows from it -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("task", ["swing_up", "balance"])
def test_an_episode_is_that_of_a_plain_environment_with_the_drawn_values(task: str) -> None:
    """Check speed limit, task scales and derived coefficients: all follow from the drawn scene."""
    env = LabPendulumEnv(randomize=RANGES, task=task, damping="quadratic", backend="python")
    env.reset(seed=2)
    _, info = env.reset()
    plain = LabPendulumEnv(task=task, damping="quadratic", backend="python", **info["parameters"])
    assert (env.omega0, env.speed_limit) == (plain.omega0, plain.speed_limit)
    assert env.episode_scene == plain.scene
    start = {"angle": 0.4, "velocity": 0.3}
    env.reset(options={**info["parameters"], **start})
    plain.reset(options=start)
    for k in range(20):
        action = np.array([np.sin(0.3 * k)], np.float32)
        same(env.step(action), plain.step(action), f"step {k}")


@pytest.mark.parametrize("mode", MODES)
def test_ranges_of_zero_width_are_a_plain_environment(mode: str) -> None:
    """Check that fixed values take no random number, and change no bit of an environment made with them."""
    fixed = {"length": (0.4, 0.4), "mass": ("log", 0.03, 0.03), "max_torque": [0.06]}
    values = {"length": 0.4, "mass": 0.03, "max_torque": 0.06}
    common: dict[str, Any] = {"max_episode_steps": 7, "backend": "python", "autoreset_mode": mode}
    mine, theirs = vector(3, randomize=fixed, **common), vector(3, **values, **common)
    for env in (mine, theirs):
        env.reset(seed=4)
    for k in range(20):
        actions = np.random.default_rng(k).uniform(-1, 1, (3, 1)).astype(np.float32)
        found, wanted = mine.step(actions), theirs.step(actions)
        found[4].pop("parameters", None)
        found[4].pop("_parameters", None)
        same(found, wanted, f"step {k}")
        over = wanted[2] | wanted[3]
        if mode == "Disabled" and over.any():
            mine.reset(options={"reset_mask": over})
            theirs.reset(options={"reset_mask": over})


def test_a_seed_repeats_draws_and_episodes_differ() -> None:
    env = LabPendulumEnv(randomize=RANGES, backend="python")
    first = [env.reset(seed=s)[1]["parameters"] for s in (0, 0, None)]
    assert first[0] == first[1] != first[2]
    assert env.scene.body.reach == 0.353


def test_state_copies_and_pickles_keep_the_drawn_values() -> None:
    env = LabPendulumEnv(randomize=RANGES, backend="python")
    env.reset(seed=6)
    env.step(ZERO)
    saved, others = env.get_state(), [copy.deepcopy(env), pickle.loads(pickle.dumps(env))]
    fresh = LabPendulumEnv(randomize=RANGES, backend="python")
    fresh.reset(seed=9)
    fresh.set_state(saved)
    plain = LabPendulumEnv(backend="python")
    plain.set_state(saved)
    for other in (*others, fresh, plain):
        twin = copy.deepcopy(env)
        for _ in range(3):
            same(other.step(ZERO), twin.step(ZERO))
        if other is not plain:
            same(other.reset(), twin.reset())
    assert plain.reset()[1].get("parameters") is None
    with pytest.raises(SceneError, match="parameters in a state to restore: the scene 'lab' has no parameter 'lenght'"):
        env.set_state({**saved, "parameters": {"lenght": 0.3}})
    with pytest.raises(SceneError, match="velocity"):
        env.set_state({**saved, "parameters": {"length": 0.31}, "state": [*saved["state"][:3], 1e200,
                                                                         *saved["state"][4:]]})
    assert env.get_state()["parameters"] == saved["parameters"]


def test_pickled_vectors_keep_the_drawn_values() -> None:
    env = vector(20, randomize=RANGES, backend="python", max_episode_steps=4)
    env.reset(seed=6)
    actions = np.full((20, 1), 0.5, np.float32)
    env.step(actions)
    other = pickle.loads(pickle.dumps(env))
    for _ in range(8):
        same(other.step(actions), env.step(actions))
    same(other.episode_parameters, env.episode_parameters)


@pytest.mark.parametrize("given", [None, RANGES])
def test_options_set_parameters_for_one_episode(given: Any) -> None:
    """Check in a single and in a vector environment that the episode after it has the usual parameters again."""
    common: dict[str, Any] = {"randomize": given, "backend": "python", "max_episode_steps": 3}
    env, single = vector(3, autoreset_mode="SameStep", **common), gym.make("LabPendulum-v0", **common)
    lengths = np.array([0.5, 0.6, 0.7])
    _, infos = env.reset(seed=3, options={"length": lengths, "angle": 0.2})
    _, info = single.reset(seed=4, options={"length": 0.6, "angle": 0.2})
    assert infos["parameters"]["length"].tolist() == lengths.tolist()
    assert info["parameters"]["length"] == 0.6
    plain = gym.make("LabPendulum-v0", backend="python", length=0.6)
    if given is None:
        plain.reset(seed=4, options={"angle": 0.2})
    for _ in range(3):
        found, wanted = env.step(np.full((3, 1), 0.7, np.float32)), single.step(np.full(1, 0.7, np.float32))
        if given is None:
            same(wanted[:2], plain.step(np.full(1, 0.7, np.float32))[:2])
    assert found[3].all()
    same(found[4]["final_obs"][1], wanted[0])
    observation, info = single.reset()
    same(found[0][1], observation)
    if given is None:
        assert "parameters" not in info
        assert np.isnan(env.episode_parameters["length"]).all()
    else:
        assert 0.3 <= info["parameters"]["length"] <= 0.4
        assert found[4]["parameters"]["length"][1] == info["parameters"]["length"]


def test_options_of_some_environments_leave_the_others_as_they_are() -> None:
    env, twin = vector(3, backend="python"), vector(3, backend="python")
    for one in (env, twin):
        one.reset(seed=1)
        one.step(np.zeros((3, 1), np.float32))
    mask = np.array([False, True, False])
    env.reset(options={"reset_mask": mask, "length": 0.8, "lag": 0.0})
    twin.reset(options={"reset_mask": mask})
    for _ in range(3):
        found, wanted = (one.step(np.full((3, 1), 0.3, np.float32))[0] for one in (env, twin))
        same(found[::2], wanted[::2])
        assert not np.array_equal(found[1], wanted[1])


def test_the_specification_as_json_draws_alike() -> None:
    """Check that tuples, which JSON makes lists of, stay ranges."""
    env = gym.make("LabPendulum-v0", randomize=RANGES, backend="python")
    assert env.spec is not None
    other = gym.make(gym.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    same(other.reset(seed=3), env.reset(seed=3))
    assert LabPendulumEnv(randomize=np.array([{"length": [0.3, 0.4]}]).item(), backend="python").reset(seed=0)[1][
        "parameters"]["length"] in (0.3, 0.4)


@pytest.mark.filterwarnings("error")
def test_gymnasiums_checker_passes() -> None:
    check_env(LabPendulumEnv(randomize=RANGES, backend="python", velocity_bound=50.0), skip_render_check=True)


def test_frames_show_the_drawn_length() -> None:
    short, long = (LabPendulumEnv(randomize={"length": [value]}, render_mode="rgb_array", render_size=80,
                                  backend="python", length=1.0) for value in (0.2, 1.0))
    plain = LabPendulumEnv(render_mode="rgb_array", render_size=80, backend="python", length=0.2)
    frames = []
    for env in (short, long, plain):
        env.reset(seed=0, options={"angle": 0.7, "velocity": 0.0})
        frames.append(env.render())
    assert np.array_equal(frames[0], frames[2])
    env = vector(2, randomize={"length": (0.2, 1.0)}, render_mode="rgb_array", render_size=80, backend="python")
    for seed in (0, None):  # the second episode has another length
        _, infos = env.reset(seed=seed, options={"angle": 0.7, "velocity": 0.0})
        plain = LabPendulumEnv(render_mode="rgb_array", render_size=80, backend="python",
                               length=float(infos["parameters"]["length"][1]))
        plain.reset(options={"angle": 0.7, "velocity": 0.0})
        found = env.render()
        assert found is not None
        assert np.array_equal(found[1], plain.render())


# --- refusals -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("given", "words"), [
    ({"length": (0.4, 0.3)}, "randomize: length must have the lower end first"),
    ({"length": ("log", 0.0, 0.3)}, "ends above 0"),
    ({"length": ("logg", 0.1, 0.3)}, "did you mean log"),
    ({"length": (0.1, 0.2, 0.3)}, "must be \\(low, high\\)"),
    ({"length": 0.3}, "must be \\(low, high\\)"),
    ({"length": []}, "must be \\(low, high\\)"),
    ({"length": (0.1, float("nan"))}, "finite"),
    ({"lenght": (0.3, 0.4)}, "has no parameter 'lenght'; did you mean length"),
    ({"viscous_rate": (0.3, 0.4)}, "has no parameter 'viscous_rate'"),
    ({"length": (-0.3, 0.4)}, "length=-0.3 cannot be drawn: length must be a finite number above 0"),
    ({"run.angle": (0.3, 0.4)}, "has no parameter 'run.angle'"),
    ({"suspension": (0.3, 0.4)}, "not a number"),
    ({"lag": (0.01, 0.4)}, "another program"),
    ({}, "must name parameters"), (3.0, "must be a dict"), ("length", "must be a dict"),
    ([{"length": (0.3, 0.4)}, {"length": (0.3, 0.4)}], "each of them once"),
    (lambda source: 3.0, "must return a dict of parameters"),
    (lambda source: {"lenght": 3.0}, "did you mean length"),
    (lambda source: {"length": "long"}, "finite number"),
])
@pytest.mark.parametrize("kind", [LabPendulumEnv, LabPendulumVectorEnv])
def test_what_cannot_be_drawn_is_refused(kind: Any, given: Any, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        kind(randomize=given, backend="python")


def test_options_that_cannot_be_are_refused_and_change_nothing() -> None:
    env, many = LabPendulumEnv(backend="python", randomize=RANGES), vector(2, backend="python", randomize=RANGES)
    env.reset(seed=1)
    many.reset(seed=1)
    before, others = env.get_state(), many.episode_parameters
    for options, words in (({"lenght": 0.3}, "did you mean length"), ({"length": -1.0}, "length must be"),
                           ({"length": None}, "length must be"), ({"lag": 0.3}, "another program")):
        with pytest.raises(SceneError, match=words):
            env.reset(seed=2, options=options)
        with pytest.raises(SceneError, match=words):
            many.reset(seed=2, options=options)
    with pytest.raises(SceneError, match="one for each of 2 environments"):
        many.reset(options={"length": [0.3, 0.4, 0.5]})
    same(env.get_state(), before)
    same(many.episode_parameters, others)


def test_a_source_of_one_environment_is_the_generator_itself() -> None:
    source = OneStream(np.random.default_rng(3))
    assert source.uniform(np.arange(2)).tolist() == np.random.default_rng(3).random(2).tolist()
