"""Foreign programs in an environment of their own: they stay out of the package's dependencies.

CleanRL is single files to copy rather than a library, and its package does not fit beside this one: release 1.2.0
wants Python below 3.11, moviepy below 2 and pygame 2.1.0, and 0.4.8, which later Pythons get, imports the old ``gym``.
So its loop for continuous actions is written out here, on the same wrappers: of single environments, and of
the native vector, which needs no adapter. Adapters of the package have tests in tests/adapters.
"""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from beside import FOREIGN, environment
from readme_code import ROOT

from pendulum_env.controllers import evaluate

STABLE_BASELINES_CHECK = """
import os
import warnings
import gymnasium as gym
import integrators
import pendulum_env
from pendulum_env.engine.machine import fitting
from pendulum_env.tasks import TASKS
from stable_baselines3.common.env_checker import check_env

warnings.simplefilter("error")
warnings.filterwarnings("ignore", ".* restarts at every change of control", UserWarning)
warnings.filterwarnings("ignore", ".* of the phase of ", UserWarning)
warnings.filterwarnings("ignore", "Steps of .* are too long for ", UserWarning)
warnings.filterwarnings("ignore", "A step of .* turns the rod by up to ", UserWarning)
tasks, seen, full = list(TASKS), set(), os.environ.get("LAB_PENDULUM_GRID") == "full"
fitting_in = {name: fitting(scene) for name, scene in pendulum_env.SCENES.items()}
for j, integrator in enumerate(integrators.METHODS):
    places = [scene for scene, methods in fitting_in.items() if integrator in methods]
    if integrator != "rk4" and not full:
        places = [places[j % len(places)]]
    for i, scene in enumerate(places):
        # Tasks in turn; each is in every scene with rk4.
        for task in tasks if integrator == "rk4" else [tasks[(i + j) % len(tasks)]]:
            # Interpreted, which has the same bits, but for one: compiling them all takes minutes.
            backend = "compiled" if integrator == "rk4" else "python"
            env = gym.make("LabPendulum-v0", scene=scene, task=task, integrator=integrator, backend=backend)
            check_env(env.unwrapped, warn=True, skip_render_check=integrator != "rk4")
            seen.add((scene, task, integrator))
assert {pair[:2] for pair in seen} == {(scene, task) for scene in pendulum_env.SCENES for task in TASKS}
assert {pair[2] for pair in seen} == set(integrators.METHODS)
print(len(seen), "combinations of scene, task and method pass")
"""

STABLE_BASELINES_TRAIN = """
from stable_baselines3 import PPO
import pendulum_env
model = PPO("MlpPolicy", "LabPendulum-v0", n_steps=64, batch_size=64, device="cpu")
model.learn(128)
print("trained", model.num_timesteps)
"""

STABLE_BASELINES_VECTOR = """
import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv

same, apart = [
    make_vec_env("pendulum_env:LabPendulum-v0", 2, seed=1, env_kwargs={"task": "balance"}, vec_env_cls=kind)
    for kind in (DummyVecEnv, SubprocVecEnv)
]
assert np.array_equal(same.reset(), apart.reset())
same.action_space.seed(2)
falls = 0
for _ in range(200):
    action = np.array([same.action_space.sample() for _ in range(2)])
    obs, reward, done, infos = same.step(action)
    obs_apart, reward_apart, done_apart, infos_apart = apart.step(action)
    assert np.array_equal(obs, obs_apart) and np.array_equal(done, done_apart)
    assert np.array_equal(reward, reward_apart.astype(np.float32))
    for i in np.flatnonzero(done):
        assert infos[i]["stop_reason"] == infos_apart[i]["stop_reason"] == "fell"
        assert np.array_equal(infos[i]["terminal_observation"], infos_apart[i]["terminal_observation"])
        falls += 1
assert falls >= 4
for vector in (same, apart):
    model = PPO("MlpPolicy", vector, n_steps=64, batch_size=64, device="cpu").learn(256)
    vector.close()
print("trained", model.num_timesteps)
"""

TORCHRL = """
import gymnasium as gym
import numpy as np
import torch
import pendulum_env
from torchrl.data import Unbounded
from torchrl.envs import GymEnv, default_info_dict_reader
from torchrl.envs.utils import check_env_specs

NAMES = ("time", "energy", "work", "heat", "energy_residual")

class Floats(default_info_dict_reader):
    def __call__(self, info, tensordict):
        # TorchRL's own reader takes NumPy's numbers only.
        return super().__call__({name: np.asarray(info[name]) for name in NAMES}, tensordict)

for task in ("free", "swing_up", "balance"):
    env = GymEnv("LabPendulum-v0", task=task, max_episode_steps=60)
    env.set_info_dict_reader(Floats(NAMES, [Unbounded((), dtype=torch.float64)] * len(NAMES)))
    check_env_specs(env)
    torch.manual_seed(1)
    env.set_seed(3)
    rolled = env.rollout(100)
    plain = gym.make("LabPendulum-v0", task=task, max_episode_steps=60)
    plain.reset(seed=3)
    observation, _ = plain.reset()
    for row in rolled:
        assert np.array_equal(row["observation"].numpy(), observation)
        observation, reward, terminated, truncated, info = plain.step(row["action"].numpy())
        after = row["next"]
        assert np.array_equal(after["observation"].numpy(), observation)
        assert after["reward"].item() == np.float32(reward)
        assert (after["terminated"].item(), after["truncated"].item()) == (terminated, truncated)
        assert all(after[name].item() == info[name] for name in NAMES)
    assert terminated if task == "balance" else truncated
    print(task, "rolled", len(rolled))
"""

CLEANRL_STYLE = """
import gymnasium as gym
import numpy as np
import torch
from torch import nn
from torch.distributions import Normal
import pendulum_env

ENVS, STEPS, UPDATES, EPOCHS, BATCHES, EPISODE = 2, 128, 2, 4, 4, 50
GAMMA, LAMBDA, CLIP = 0.99, 0.95, 0.2

def single():
    env = gym.make("LabPendulum-v0", max_episode_steps=EPISODE)
    env = gym.wrappers.FlattenObservation(env)
    env = gym.wrappers.RecordEpisodeStatistics(env)
    env = gym.wrappers.ClipAction(env)
    env = gym.wrappers.NormalizeObservation(env)
    env = gym.wrappers.TransformObservation(env, lambda seen: np.clip(seen, -10, 10), env.observation_space)
    env = gym.wrappers.NormalizeReward(env, gamma=GAMMA)
    return gym.wrappers.TransformReward(env, lambda reward: np.clip(reward, -10, 10))

def of_singles():
    return gym.vector.SyncVectorEnv([single] * ENVS, autoreset_mode=gym.vector.AutoresetMode.SAME_STEP)

def native():
    many = gym.wrappers.vector
    envs = gym.make_vec("LabPendulum-v0", num_envs=ENVS, max_episode_steps=EPISODE, autoreset_mode="SameStep")
    # Wrappers of observations refuse this mode, because they would leave final_obs as it is.
    envs = many.ClipAction(many.RecordEpisodeStatistics(envs))
    return many.TransformReward(many.NormalizeReward(envs, gamma=GAMMA), lambda reward: np.clip(reward, -10, 10))

def network(gain):
    layers = [nn.Linear(3, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, 1)]
    for layer, scale in zip(layers[::2], (2**0.5, 2**0.5, gain)):
        nn.init.orthogonal_(layer.weight, scale)
        nn.init.zeros_(layer.bias)
    return nn.Sequential(*layers)

class Agent(nn.Module):
    def __init__(self):
        super().__init__()
        self.critic, self.actor = network(1.0), network(0.01)
        self.log_std = nn.Parameter(torch.zeros(1, 1))

    def forward(self, seen, action=None):
        policy = Normal(self.actor(seen), self.log_std.exp().expand(len(seen), 1))
        action = policy.sample() if action is None else action
        return action, policy.log_prob(action).sum(1), self.critic(seen).flatten()

torch.manual_seed(1)
envs = VECTOR()
agent = Agent()
optimizer = torch.optim.Adam(agent.parameters(), lr=3e-4, eps=1e-5)
start = nn.utils.parameters_to_vector(agent.parameters()).detach().clone()
seen, done = torch.tensor(envs.reset(seed=1)[0], dtype=torch.float32), torch.zeros(ENVS)
returns, lengths = [], []
for update in range(UPDATES):
    rows = []
    for step in range(STEPS):
        with torch.no_grad():
            action, log_prob, value = agent(seen)
        after, reward, terminated, truncated, infos = envs.step(action.numpy())
        rows.append((seen, action, log_prob, value, torch.tensor(reward, dtype=torch.float32), done))
        seen, done = torch.tensor(after, dtype=torch.float32), torch.tensor(terminated | truncated).float()
        if "final_info" in infos:  # the vector's own wrapper puts its episodes beside it
            last = infos if "episode" in infos else infos["final_info"]
            episode, ended = last["episode"], infos["_final_info"]
            returns += list(episode["r"][ended])
            lengths += list(episode["l"][ended])
    observations, actions, log_probs, values, rewards, dones = (torch.stack(column) for column in zip(*rows))
    with torch.no_grad():
        ahead, going, advantage = agent.critic(seen).flatten(), 1.0 - done, 0.0
        advantages = torch.zeros_like(rewards)
        for t in reversed(range(STEPS)):
            advantage = rewards[t] + GAMMA * ahead * going - values[t] + GAMMA * LAMBDA * going * advantage
            advantages[t], ahead, going = advantage, values[t], 1.0 - dones[t]
    batch = [column.flatten(0, 1) for column in (observations, actions, log_probs, advantages, advantages + values)]
    for epoch in range(EPOCHS):
        for chunk in torch.randperm(ENVS * STEPS).chunk(BATCHES):
            observation, action, old, gain, target = (column[chunk] for column in batch)
            _, new, value = agent(observation, action)
            ratio, gain = (new - old).exp(), (gain - gain.mean()) / (gain.std() + 1e-8)
            policy_loss = -torch.min(gain * ratio, gain * ratio.clamp(1 - CLIP, 1 + CLIP)).mean()
            loss = policy_loss + 0.25 * ((value - target) ** 2).mean()
            assert torch.isfinite(loss)
            optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(agent.parameters(), 0.5)
            optimizer.step()
envs.close()
assert lengths == [EPISODE] * (ENVS * (UPDATES * STEPS // EPISODE)), lengths
assert all(-(np.pi**2 + 1.0) * EPISODE < total < 0.0 for total in returns), returns
assert (nn.utils.parameters_to_vector(agent.parameters()) - start).norm() > 0.01
print("trained", ENVS * STEPS * UPDATES)
"""

MINARI = """
import warnings
import gymnasium as gym
import minari
import numpy as np
from pendulum_env import SCENES

warnings.simplefilter("error", UserWarning)
warnings.filterwarnings("ignore", "`(code_permalink|author|author_email|eval_env|description)` is set to None")
env = gym.make("LabPendulum-v0", scene=SCENES["lab"].replace(length=0.4), task="balance", dt=0.01, max_episode_steps=60)
collector, random = minari.DataCollector(env, record_infos=True), np.random.default_rng(0)
for seed in range(3):
    collector.reset(seed=seed)
    over = False
    while not over:
        *_, terminated, truncated, info = collector.step(random.uniform(-1.0, 1.0, 1).astype(np.float32))
        over = terminated or truncated
collector.create_dataset("pendulum/balance-v0", algorithm_name="random")

data = minari.load_dataset("pendulum/balance-v0")
again, reasons = data.recover_environment(), []
assert again.unwrapped.scene == env.unwrapped.scene
assert again.spec.max_episode_steps == 60
for episode in data.iterate_episodes():
    observation, info = again.reset(seed=int(episode.id))
    assert np.array_equal(observation, episode.observations[0])
    for i, action in enumerate(episode.actions):
        observation, reward, terminated, truncated, info = again.step(action)
        assert np.array_equal(observation, episode.observations[i + 1])
        assert (reward, terminated, truncated) == (
            episode.rewards[i], episode.terminations[i], episode.truncations[i])
        assert info["energy"] == episode.infos["energy"][i + 1]
    reasons.append(info["stop_reason"])
assert terminated or truncated
print("recovered", reasons)
"""

CLEANRL_PROGRAM = """
import sys
import gymnasium as gym
import numpy as np
import torch

class Agent(torch.nn.Module):
    def __init__(self):
        super().__init__()
        self.actor_mean = torch.nn.Linear(3, 1, bias=False)

def single():
    env = gym.wrappers.NormalizeObservation(gym.make(sys.argv[sys.argv.index("--env-id") + 1]))
    return gym.wrappers.TransformObservation(env, lambda seen: np.clip(seen, -10, 10))  # as for Gymnasium 0.29

if __name__ == "__main__":
    open("curves", "w").close()
    envs, agent = gym.vector.SyncVectorEnv([single]), Agent()
    normal = envs.envs[0].env.obs_rms
    normal.mean, normal.var = np.array([0.5, 0.0, 1.0]), np.array([1.0, 4.0, 0.25])
    agent.actor_mean.weight.data = torch.tensor([[0.1, 0.2, -0.3]]) * float(sys.argv[sys.argv.index("--seed") + 1])
    envs.close()
"""

SCRIPTS = {
    "stable-baselines3 checks": (STABLE_BASELINES_CHECK, "combinations"),
    "stable-baselines3 trains": (STABLE_BASELINES_TRAIN, "trained 128"),
    "stable-baselines3 vectors": (STABLE_BASELINES_VECTOR, "trained 256"),
    "torchrl rolls out": (TORCHRL, "balance rolled"),
    "cleanrl's loop trains": (CLEANRL_STYLE.replace("VECTOR", "of_singles"), "trained 512"),
    "cleanrl's loop trains on the native vector": (CLEANRL_STYLE.replace("VECTOR", "native"), "trained 512"),
}
"""Script and what it says at its end, by what it does."""


@pytest.fixture(scope="session")
def foreign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Python of an environment with the package and the foreign programs."""
    return environment(tmp_path_factory, "foreign", *FOREIGN)


@pytest.mark.slow
@pytest.mark.parametrize("name", SCRIPTS)
def test_foreign_programs(foreign: Path, name: str, tmp_path: Path) -> None:
    """Stable-Baselines3 checks each method in one scene; LAB_PENDULUM_GRID=full: in every scene that it fits."""
    script, said = SCRIPTS[name]
    done = subprocess.run([foreign, "-c", script], capture_output=True, text=True, cwd=tmp_path)
    print(done.stdout)
    assert done.returncode == 0, done.stderr
    assert said in done.stdout


@pytest.mark.slow
def test_cleanrls_agent_is_judged_as_it_saw_the_world(foreign: Path, tmp_path: Path) -> None:
    """With a program in place of CleanRL's, whose agents are known: its normalisation belongs to the policy."""
    (tmp_path / "program.py").write_text(CLEANRL_PROGRAM, encoding="utf-8")
    example = ROOT / "examples" / "learning" / "clean_rl.py"
    command = [foreign, example, "program.py", "lines.jsonl", "--seeds", "1", "2"]
    for _ in range(2):  # the second time nothing is left to do
        done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    lines = [json.loads(line) for line in (tmp_path / "lines.jsonl").read_text(encoding="utf-8").splitlines()]
    assert [line["seed"] for line in lines] == [1, 2]
    assert {path.name for path in tmp_path.iterdir()} == {"program.py", "lines.jsonl"}
    for line in lines:
        def policy(seen: Any, seed: int = line["seed"]) -> Any:
            x = ((seen - [0.5, 0.0, 1.0]) / [1.0, 2.0, 0.5]).clip(-10.0, 10.0)
            return (seed * (x @ [0.1, 0.2, -0.3])).clip(-1.0, 1.0)[:, None].astype(np.float32)

        found = evaluate(policy, gym.make_vec("LabPendulum-v0", 100, diagnostics=()), 10**6)
        assert line["return"] == pytest.approx(found.returns.mean(), rel=1e-6)


@pytest.mark.slow
def test_minari_recovers_the_environment_of_a_data_set(
        foreign: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Check that the environment that a data set describes repeats its observations, rewards and energies."""
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    done = subprocess.run([foreign, "-c", MINARI], capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "recovered ['', 'fell', 'fell']" in done.stdout  # one truncated, two terminated


@pytest.mark.slow
def test_example_that_trains(foreign: Path, tmp_path: Path) -> None:
    """With a budget too small to learn anything: two points of the curve, and a film of ten seconds."""
    example = ROOT / "examples" / "11_train_swing_up.py"
    done = subprocess.run([foreign, example, tmp_path, "65536"], capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "the last 64 episodes return -" in done.stdout
    assert (tmp_path / "learning_curve.png").stat().st_size > 10_000
    assert (tmp_path / "swing_up.mp4").stat().st_size > 10_000
