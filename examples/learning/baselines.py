"""Train agents of Stable-Baselines3 with the settings of ``settings/``, or with its defaults, and judge them.

    python examples/learning/baselines.py agents.jsonl --algorithms ppo --ids LabPendulum-v0 --seeds 10

trains ten agents, needs ``pip install ".[sb3]" pyyaml``, and appends a line of JSON for each: return of 100 episodes that
no training has seen, how many of them end upright, steps, seconds, versions. An agent that has a line is not trained
again, so that the command can be stopped and repeated. ``--defaults`` takes the library's own settings, with the number
of environments and steps of ours; ``--change gae_lambda=0.95`` changes one setting of ours. Without ``--ids`` the command
prints the table of all lines.
"""

import argparse
import json
import platform
import time
from pathlib import Path

import gymnasium as gym
import numpy as np
import yaml

import pendulum_env
from pendulum_env.controllers import swing_up

SETTINGS, EPISODES, FIRST = Path(__file__).parent / "settings", 100, 10**6  # FIRST: seed of the first episode to judge
RESCALED = {"gymnasium.wrappers.RescaleObservation": {"min_obs": -1.0, "max_obs": 1.0}}
JUDGED = {"velocity_bound", "randomize"}  # keywords that are kept when a policy is judged; others are the id's own
UPRIGHT, NEAR = 0.2, 0.05  # upright: at most so far from the top [rad]; solved: at most so much below the controller


def settings_of(algorithm, name):
    """Return RL Zoo's settings of an environment, as its YAML has them."""
    return yaml.safe_load((SETTINGS / f"{algorithm}.yml").read_text(encoding="utf-8"))[name]


def played(name, choose, **keywords):
    """Return the returns of EPISODES whole episodes, and the distances from the top at their ends."""
    env = gym.make_vec(name, EPISODES, vectorization_mode="vector_entry_point", diagnostics=(), **keywords)
    seen, _ = env.reset(seed=FIRST)
    top = 1.0 if "Gymnasium" in name else -1.0  # cosine there, as the id observes it
    total, going, away = np.zeros(EPISODES), np.ones(EPISODES, bool), np.zeros(EPISODES)
    while going.any():
        seen, reward, lost, late, _ = env.step(choose(seen))
        total += reward * going
        going &= ~(lost | late)
        away = np.where(going | (lost | late) & (away == 0.0), np.arccos(np.clip(top * seen[:, 0], -1.0, 1.0)), away)
    return total, away


def trained(algorithm, name, seed, given, defaults):
    """Return a policy, and the numbers of environments and steps."""
    import stable_baselines3
    import torch
    from stable_baselines3.common.vec_env import VecEnvWrapper, VecMonitor, VecNormalize

    from pendulum_env.adapters.sb3 import LabPendulumVecEnv

    class Scaled(VecEnvWrapper):
        def __init__(self, venv, scale):
            super().__init__(venv, gym.spaces.Box(-1.0, 1.0, venv.observation_space.shape))
            self.scale = scale

        def reset(self):
            return self.scale * self.venv.reset()

        def step_wait(self):
            seen, rewards, over, infos = self.venv.step_wait()
            for i in np.flatnonzero(over):
                infos[i]["terminal_observation"] = self.scale * infos[i]["terminal_observation"]
            return self.scale * seen, rewards, over, infos

    torch.set_num_threads(1)
    own = dict(given)
    count, steps, policy = own.pop("n_envs", 1), int(float(own.pop("n_timesteps"))), own.pop("policy")
    spec, normal = gym.spec(name), own.pop("normalize", None)
    keywords = {"max_episode_steps": spec.max_episode_steps, **spec.kwargs, **own.pop("env_kwargs", {})}
    env = VecMonitor(LabPendulumVecEnv(1 if defaults else count, diagnostics=(), **keywords))
    wrapped = own.pop("env_wrapper", None)
    if defaults:
        own, normal, wrapped = {}, None, None
    scale = np.float32(1.0)
    if wrapped:  # Gymnasium's RescaleObservation to [-1, 1], for a whole vector
        assert wrapped == RESCALED, wrapped
        scale = 1.0 / env.observation_space.high
        env = Scaled(env, scale)
    if normal:
        env = VecNormalize(env, **normal, gamma=own.get("gamma", 0.99))
    for key, value in own.items():
        if isinstance(value, str) and value.startswith("lin_"):  # as RL Zoo reads it: falls to 0
            own[key] = lambda left, first=float(value[4:]): first * left
    model = getattr(stable_baselines3, algorithm.upper())(policy, env, seed=seed, device="cpu", **own)
    model.learn(steps)
    scaled = env.normalize_obs if normal else np.asarray
    return lambda seen: model.predict(scaled(scale * seen), deterministic=True)[0]


def judged(algorithm, name, seed, changes, defaults):
    """Train and judge an agent; return its line."""
    given = {**settings_of(algorithm, name), **changes}
    begun, worked = time.perf_counter(), time.process_time()
    policy = trained(algorithm, name, seed, given, defaults)
    took = {"seconds": time.perf_counter() - begun, "processor_seconds": time.process_time() - worked}
    keywords = {key: given["env_kwargs"][key] for key in JUDGED & {*given["env_kwargs"]}}
    earned, away = played(name, policy, **keywords)
    return {"return": earned.mean(), "upright": float((away < UPRIGHT).mean()), "steps": int(float(given["n_timesteps"])),
            **took, "versions": versions(), "settings": given}


def versions():
    """Return the versions of what trains."""
    import stable_baselines3
    import torch

    return {"python": platform.python_version(), "lab-pendulum": pendulum_env.__version__, "numpy": np.__version__,
            "stable-baselines3": stable_baselines3.__version__, "torch": torch.__version__, "machine": platform.machine()}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("file", type=Path, help="file of the agents' lines")
    parser.add_argument("--algorithms", nargs="*", default=["ppo"], choices=("ppo", "sac"))
    parser.add_argument("--ids", nargs="*", default=[], help="environments to train in")
    parser.add_argument("--seeds", type=int, nargs="*", default=[0])
    parser.add_argument("--defaults", action="store_true")
    parser.add_argument("--change", nargs="*", default=[], help="NAME=VALUE, in YAML, in place of our settings")
    options = parser.parse_args()
    changes = {key: yaml.safe_load(value) for key, value in (one.split("=", 1) for one in options.change)}
    what = "defaults" if options.defaults else " ".join(options.change) or "ours"
    lines = [json.loads(one) for one in options.file.read_text().splitlines()] if options.file.exists() else []
    done = {(one["algorithm"], one["id"], one["what"], one["seed"]) for one in lines}
    for algorithm in options.algorithms:
        for name in options.ids:
            for seed in options.seeds:
                key = algorithm, name, what, seed
                if key in done:
                    continue
                line = dict(zip(("algorithm", "id", "what", "seed"), key)) | judged(
                    algorithm, name, seed, changes, options.defaults)
                with options.file.open("a") as file:
                    file.write(json.dumps(line) + "\n")
                print(*key, f"{line['return']:.1f}", line["upright"], f"{line['seconds']:.0f} s", flush=True)


if __name__ == "__main__":
    main()
