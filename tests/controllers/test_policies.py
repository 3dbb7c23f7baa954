"""Tests of learnt policies: the stored networks, their cards beside episodes played here, files, and thresholds."""

from __future__ import annotations

import json
import math
import pickle
import re
import runpy
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from readme_code import ROOT

import pendulum_env
from pendulum_env import SceneError
from pendulum_env.controllers import POLICIES, Policy, RandomPolicy, evaluate, load, swing_up
from pendulum_env.envs.limits import IDS

BEST = {"swing_up": 0.0, "balance": 500.0, "track": 0.0}
"""Task -> the return that no episode exceeds."""
INFINITE = pytest.mark.filterwarnings("ignore:.*Box observation space m(in|ax)imum value is -?infinity:UserWarning")


def vector(name: str, count: int, **how: Any) -> Any:
    return gym.make_vec(name, count, **{"diagnostics": (), "backend": "python" if count < 50 else "auto", **how})


def small(**more: Any) -> Policy:
    """Return a policy whose actions can be computed by hand: tanh(2 tanh(0.5 sine + velocity / 10) + 0.25)."""
    return Policy(**{"layers": [(np.array([[0.0], [0.5], [1.0]]), np.zeros(1)), (np.array([[2.0]]), np.array([0.25]))],
                     "scale": np.array([1.0, 1.0, 0.1]), "card": {"task": "swing_up"}, **more})


# --- the policies of the package --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", POLICIES)
@INFINITE
def test_a_policy_earns_what_its_card_says(name: str) -> None:
    """Check 20 episodes, of other seeds than the card's, against the card and the random policy."""
    policy = load(name)
    found = policy.card["evaluation"]
    env = vector(policy.card["id"], 20)
    assert (policy.card["task"], env.unwrapped.task.name) == (name, name)
    assert (found["integrator"], found["dt"]) == (str(env.unwrapped.integrator), env.unwrapped.dt)
    played = evaluate(policy, env, 10**7)
    error = found["return"]["sd"] / math.sqrt(20.0)
    assert abs(played.returns.mean() - found["return"]["mean"]) < 4.0 * error
    assert played.reached.all()
    assert played.returns.mean() > env.spec.reward_threshold
    random = evaluate(RandomPolicy(), env, 10**7)
    assert abs(random.returns.mean() / found["random"] - 1.0) < 0.3
    lost = [BEST[name] - one for one in (played.returns.min(), random.returns.mean())]
    assert 0.0 < lost[0] < 0.2 * lost[1]


@pytest.mark.parametrize("name", POLICIES)
def test_the_card_is_of_many_episodes_and_says_where_the_policy_comes_from(name: str) -> None:
    policy = load(name)
    found, training = policy.card["evaluation"], policy.card["training"]
    assert found["episodes"] == 1000
    assert found["reached"] == 1.0
    assert found["return"]["worst"] < found["return"]["mean"]
    if "controller" in found:
        assert found["return"]["mean"] > found["controller"] - 0.05 * abs(found["controller"])
    assert (ROOT / training["program"]).suffix == ".py"
    assert training["steps"] > 10**5
    text = str(policy)
    for word in (name, policy.card["id"], "seed", f"{found['return']['mean']:.5g}", "rk4"):
        assert word in text
    assert max(map(len, text.splitlines())) <= 100
    path = ROOT / "pendulum_env" / "controllers" / "policies" / f"{name}.npz"
    assert path.stat().st_size < 100_000
    assert json.loads(json.dumps(policy.card)) == policy.card


@pytest.mark.parametrize("name", POLICIES)
def test_the_table_of_policies_is_that_of_their_cards(name: str) -> None:
    text = (ROOT / "pendulum_env" / "envs" / "README.md").read_text(encoding="utf-8")
    row = next(line for line in text.splitlines() if line.startswith(f"| {name} | LabPendulum"))
    returns = load(name).card["evaluation"]["return"]
    assert row.endswith(f"| {returns['mean']:.5g} ± {returns['sd']:.2g} |")


def test_the_command_chooses_the_best_and_computes_its_card(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """With trainings that are there already: a policy of the package, and one that lets the bob fall."""
    bare = {name: value for name, value in load("balance").card.items() if name != "evaluation"}
    good = Policy(load("balance").layers, load("balance").scale, bare)
    idle = Policy([(np.zeros((3, 1)), np.zeros(1))], np.ones(3), {**bare, "training": {"seed": 1}})
    for seed, policy in enumerate((good, idle)):
        policy.save(tmp_path / f"balance_{seed}.npz")
    monkeypatch.setattr("sys.argv", ["policies.py", str(tmp_path), "--tasks", "balance", "--seeds", "0", "1",
                                     "--episodes", "20", "--out", str(tmp_path / "new")])
    runpy.run_path(str(ROOT / "examples" / "learning" / "policies.py"), run_name="__main__")
    found = load(tmp_path / "new" / "balance.npz")
    assert {name: value for name, value in found.card.items() if name != "evaluation"} == bare
    env = vector("LabPendulumBalance-v0", 20)
    card, first = found.card["evaluation"], found.card["evaluation"]["seeds"][0]
    assert (card["episodes"], card["seeds"]) == (20, [first, first + 19])
    returns = evaluate(good, env, first).returns
    assert card["return"] == pytest.approx(
        {"mean": returns.mean(), "sd": returns.std(ddof=1), "worst": returns.min()}, rel=1e-6)
    assert card["random"] == pytest.approx(evaluate(RandomPolicy(), env, first).returns.mean())
    assert card["controller"] == pytest.approx(evaluate(swing_up(env), env, first).returns.mean())
    assert str(found) in capsys.readouterr().out


# --- the network ------------------------------------------------------------------------------------------------------


def test_an_action_is_that_of_the_formula() -> None:
    policy, seen = small(), np.array([[0.6, 0.8, 3.0], [1.0, 0.0, -20.0]], np.float32)
    wanted = [math.tanh(2.0 * math.tanh(0.5 * y + 0.1 * v) + 0.25) for _, y, v in seen.tolist()]
    assert policy(seen)[:, 0] == pytest.approx(wanted, rel=1e-6)
    assert policy(seen).dtype == np.float32
    assert policy(seen[0]).shape == (1,)
    assert policy(seen[0]) == pytest.approx(policy(seen)[0], rel=1e-6)
    assert pickle.loads(pickle.dumps(policy))(seen).tolist() == policy(seen).tolist()
    assert repr(policy) == "<Policy: swing_up, 3 -> 1 -> 1>"


@pytest.mark.parametrize("name", POLICIES)
def test_the_layers_are_computed_as_in_double_precision(name: str) -> None:
    policy = load(name)
    seen = np.random.default_rng(0).uniform(-1.0, 1.0, (100, len(policy.scale)))
    seen[:, 2] *= 12.0
    x = seen * policy.scale.astype(float)
    for weights, bias in policy.layers:
        x = np.array([[math.tanh(sum(a * w for a, w in zip(row, column, strict=True)) + b)
                       for column, b in zip(weights.T.tolist(), bias.tolist(), strict=True)] for row in x.tolist()])
    assert np.abs(policy(seen) - x).max() < 2e-5


def test_a_finite_observation_has_a_finite_action() -> None:
    largest = float(np.finfo(np.float32).max)
    for name in ("swing_up", "balance"):
        action = load(name)(np.array([[1.0, 0.0, largest], [1.0, 0.0, -largest]], np.float32))
        assert np.isfinite(action).all()
        assert np.abs(action).max() <= 1.0


@pytest.mark.parametrize("seen", [np.zeros(4), np.zeros((2, 7)), np.array([1.0, 0.0, math.nan]), "text", [[]]])
def test_a_wrong_observation_is_refused(seen: Any) -> None:
    with pytest.raises(ValueError, match="Observations must "):
        load("swing_up")(seen)


# --- files ------------------------------------------------------------------------------------------------------------


def test_a_saved_policy_is_loaded_again(tmp_path: Path) -> None:
    policy = small(card={"task": "swing_up", "id": "LabPendulum-v0", "training": {"steps": 3}})
    path = policy.save(tmp_path / "mine.npz")
    for again in (load(path), load(str(path)), pendulum_env.load(path)):
        assert again.card == policy.card
        assert [one.tolist() for pair in again.layers for one in pair] == [
            one.tolist() for pair in policy.layers for one in pair]
        assert again([1.0, 0.0, 0.5]) == policy([1.0, 0.0, 0.5])


def test_names_and_files_that_are_none_are_refused_in_one_sentence(tmp_path: Path) -> None:
    good = small().save(tmp_path / "good.npz").read_bytes()
    (tmp_path / "cut.npz").write_bytes(good[:-100])
    (tmp_path / "text.npz").write_text("no")
    np.savez(tmp_path / "arrays.npz", weights_0=np.zeros((3, 1)))
    pendulum_env.rollout("vacuum", duration=0.1, backend="python").save(tmp_path / "run.npz")
    refused_files = {"nowhere": "No such file", "cut": "cannot be read", "text": "cannot be read",
                     "arrays": "not a file that save wrote", "run": "has a Rollout, not a policy"}
    for given, told in (("swingup", "There is no policy 'swingup'; did you mean swing_up?"),
                        (3, "policy must be a path"),
                        *((tmp_path / f"{name}.npz", told) for name, told in refused_files.items())):
        with pytest.raises(SceneError, match=re.escape(told)) as refused:
            load(given)
        assert "\n" not in str(refused.value)


@pytest.mark.parametrize(("wrong", "told"), [
    ({"layers": []}, "at least one layer"),
    ({"layers": [(np.zeros((3, 2)), np.zeros(2))]}, "the last has one output"),
    ({"layers": [(np.zeros((4, 1)), np.zeros(1))]}, "Layer 0 has 3 inputs"),
    ({"layers": [(np.zeros((3, 2)), np.zeros(2)), (np.zeros((3, 1)), np.zeros(1))]}, "Layer 1 has 2 inputs"),
    ({"layers": [(np.full((3, 1), math.nan), np.zeros(1))]}, "must be finite"),
    ({"layers": 3}, "pairs of arrays"), ({"layers": [("a", "b")]}, "pairs of arrays"),
    ({"scale": 1.0}, "Layer 0"), ({"card": "swing_up"}, "card must be a dict"),
])
def test_a_network_that_is_none_is_refused(wrong: dict[str, Any], told: str) -> None:
    with pytest.raises(SceneError, match=told):
        small(**wrong)


# --- evaluations ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@INFINITE
def test_an_evaluation_is_of_whole_first_episodes(mode: str) -> None:
    """Check against single environments, whose episodes are lost at different times."""
    found = evaluate(RandomPolicy(3), vector("LabPendulumBalance-v0", 6, autoreset_mode=mode), 40)
    policy, seen, envs = RandomPolicy(3), [], []
    for k in range(6):
        envs.append(gym.make("LabPendulumBalance-v0", backend="python", diagnostics=()))
        seen.append(envs[-1].reset(seed=40 + k)[0])
    returns, steps, over = np.zeros(6), np.zeros(6, int), np.zeros(6, bool)
    while not over.all():
        actions = policy(np.stack(seen))
        for k in np.flatnonzero(~over):
            seen[k], reward, lost, late, _ = envs[k].step(actions[k])
            returns[k], steps[k], over[k] = returns[k] + reward, steps[k] + 1, lost or late
    assert (found.returns == returns).all()
    assert (found.steps == steps).all()
    assert len({*steps.tolist()}) > 1
    assert not found.reached.any()


@INFINITE
def test_reached_is_upright_or_the_reference() -> None:
    def still(seen: Any) -> Any:
        return np.zeros((len(seen), 1), np.float32)

    for name, wanted in (("LabPendulum-v0", False), ("LabPendulumTrack-v0", True)):
        assert evaluate(still, vector(name, 3, max_episode_steps=2)).reached.tolist() == [wanted] * 3
    env = vector("LabPendulumDmControl-v0", 40, max_episode_steps=2, diagnostics=("energy",))  # from all angles
    near = evaluate(still, env, 7).reached
    env.reset(seed=7)
    angle = [env.step(still(near))[4]["angle"] for _ in range(2)][1]
    assert near.tolist() == [abs(math.remainder(one - math.pi, math.tau)) < 0.2 for one in angle.tolist()]
    assert near.any()
    env = vector("LabPendulumBalance-v0", 3, max_episode_steps=2)
    assert evaluate(still, env).reached.all()
    env = vector("LabPendulumBalance-v0", 3, max_episode_steps=50, speed_limit=0.6)  # its end is no fall
    found = evaluate(still, env)
    assert found.steps.max() < 50
    assert not found.reached.any()
    for mode in ("NextStep", "SameStep"):  # at the end the reference is 0.5 rad; the next episode begins near it
        env = vector("LabPendulumTrack-v0", 3, max_episode_steps=50, autoreset_mode=mode)
        assert not evaluate(still, env).reached.any()


def test_an_evaluation_refuses_what_is_no_vector() -> None:
    for env in (None, gym.make("LabPendulum-v0", backend="python"), gym.make_vec("CartPole-v1", 2)):
        with pytest.raises(SceneError, match="env must be a vector of LabPendulum"):
            evaluate(RandomPolicy(), env)
    with pytest.raises(SceneError, match="never end"):
        evaluate(RandomPolicy(), vector("LabPendulum-v0", 2, max_episode_steps=-1))


@pytest.mark.slow
@pytest.mark.parametrize("name", IDS)
@INFINITE
def test_a_threshold_is_a_little_below_the_reference(name: str) -> None:
    """By 5 %, or by two standard errors of a mean of 100 episodes where these are more."""
    env = vector(name, 1000)
    policy = load("track") if name == "LabPendulumTrack-v0" else swing_up(env)
    returns = evaluate(policy, env, 5 * 10**6).returns
    below = max(0.05 * abs(returns.mean()), 2.0 * returns.std() / 10.0)
    assert gym.spec(name).reward_threshold == pytest.approx(returns.mean() - below, rel=0.01)
