"""Train agents of Stable-Baselines3 with the settings of ``settings/``, or with its defaults, and judge them.

    python examples/learning/stable_baselines.py agents.jsonl --ids LabPendulum-v0 --seeds 0 1 2 3 4 5 6 7 8 9

needs ``pip install ".[sb3]" pyyaml``. It trains ten agents with PPO and appends a line of JSON for each: return of 100
episodes that no training has seen, the fraction of them that end upright, steps, seconds, versions, settings. An agent
that has a line is not trained again, so that the command can be stopped and repeated. ``--defaults`` takes the
library's own settings and one environment, with our number of steps; ``--change gae_lambda=1.0`` changes one of our
settings. Last, and alone without ``--ids``, comes the table of all lines.
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
from pendulum_env.controllers import evaluate, load, swing_up

SETTINGS, EPISODES, FIRST = Path(__file__).parent / "settings", 100, 10**6  # FIRST: seed of the episodes that judge
RESCALED = {"gymnasium.wrappers.RescaleObservation": {"min_obs": -1.0, "max_obs": 1.0}}
JUDGED = {"velocity_bound", "randomize"}  # keywords that are kept when a policy is judged; the others are the id's own
NEAR = 0.05  # solved: at most so much below the controller


def settings_of(algorithm, name):
    """Return RL Zoo's settings of an environment, as its YAML has them."""
    return yaml.safe_load((SETTINGS / f"{algorithm}.yml").read_text(encoding="utf-8"))[name]


def played(name, choose, **keywords):
    """Return what a policy earns in EPISODES whole episodes, and where it ends upright, or at its reference."""
    env = gym.make_vec(name, EPISODES, vectorization_mode="vector_entry_point", diagnostics=(), **keywords)
    return evaluate(choose, env, FIRST)


def scaled(env):
    """Return a vector of Stable-Baselines3 as RescaleObservation makes single environments, and the factors."""
    from stable_baselines3.common.vec_env import VecEnvWrapper

    scale = 1.0 / env.observation_space.high

    class Scaled(VecEnvWrapper):
        def reset(self):
            return scale * self.venv.reset()

        def step_wait(self):
            seen, rewards, over, infos = self.venv.step_wait()
            for i in np.flatnonzero(over):
                infos[i]["terminal_observation"] = scale * infos[i]["terminal_observation"]
            return scale * seen, rewards, over, infos

    return Scaled(env, gym.spaces.Box(-1.0, 1.0, scale.shape)), scale


def trained(algorithm, name, seed, given, defaults):
    """Train an agent and return its policy, a function from observations to actions."""
    import stable_baselines3
    import torch
    from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

    from pendulum_env.adapters.sb3 import LabPendulumVecEnv

    torch.set_num_threads(1)
    own, spec, scale = dict(given), gym.spec(name), np.float32(1.0)
    steps = own.pop("n_timesteps")
    if defaults:
        own = {"policy": "MlpPolicy"}
    keywords = {"max_episode_steps": spec.max_episode_steps, **spec.kwargs, **own.pop("env_kwargs", {})}
    env = VecMonitor(LabPendulumVecEnv(own.pop("n_envs", 1), diagnostics=(), **keywords))
    if wrapper := own.pop("env_wrapper", None):
        assert wrapper == RESCALED, wrapper
        env, scale = scaled(env)
    if normal := own.pop("normalize", None):
        env = VecNormalize(env, **normal, gamma=own.get("gamma", 0.99))
    for key, value in own.items():
        if isinstance(value, str) and value.startswith("lin_"):  # RL Zoo's word for a rate that falls to 0
            own[key] = lambda left, first=float(value[4:]): first * left
    model = getattr(stable_baselines3, algorithm.upper())(env=env, seed=seed, device="cpu", **own)
    model.learn(steps)
    return lambda seen: model.predict(scale * seen, deterministic=True)[0]


def judged(algorithm, name, seed, changes, defaults):
    """Train and judge an agent; return what its line says of it."""
    import stable_baselines3
    import torch

    given = {**settings_of(algorithm, name), **changes}
    begun, worked = time.perf_counter(), time.process_time()
    policy = trained(algorithm, name, seed, given, defaults)
    took = {"seconds": time.perf_counter() - begun, "processor_seconds": time.process_time() - worked}
    earned = played(name, policy, **{} if defaults else kept(given))
    versions = {"python": platform.python_version(), "lab-pendulum": pendulum_env.__version__, "numpy": np.__version__,
                "stable-baselines3": stable_baselines3.__version__, "torch": torch.__version__}
    return {"return": earned.returns.mean(), "upright": earned.reached.mean(), "steps": given["n_timesteps"], **took,
            "versions": versions, "settings": given}


def kept(given):
    """Return the keywords of a judge's environment."""
    return {key: value for key, value in given.get("env_kwargs", {}).items() if key in JUDGED}


def goal(name):
    """Return what the package's controller earns in the same episodes; of track, which it cannot play, its policy."""
    if "Track" in name:
        return played(name, load("track"), **kept(settings_of("ppo", name))).returns.mean()
    controller = swing_up(gym.make_vec(name, EPISODES, vectorization_mode="vector_entry_point"))
    return played(name, controller, **kept(settings_of("ppo", name))).returns.mean()


def table(lines):
    """Return the rows of a table of all agents, one for each environment, algorithm and settings."""
    rows = ["| environment | agent | solved | return, mean (worst) | controller | upright | steps | processor time |",
            "| --- | --- | --- | --- | --- | --- | --- | --- |"]
    goals = {name: goal(name) for name in {one["id"] for one in lines}}
    for key in dict.fromkeys((one["id"], one["algorithm"], one["what"]) for one in lines):
        found = [one for one in lines if (one["id"], one["algorithm"], one["what"]) == key]
        earned = [one["return"] for one in found]
        least = goals[key[0]] - NEAR * abs(goals[key[0]])
        fine = [one["return"] >= least and ("Track" in key[0] or one["upright"] == 1.0) for one in found]
        digits = 2 if "Track" in key[0] else 0
        up = "" if "Track" in key[0] else f"{np.mean([one['upright'] for one in found]):.0%}"
        took = np.median([one["processor_seconds"] for one in found])
        rows.append(f"| `{key[0]}` | {key[1].upper()}, {key[2]} | {sum(fine)} of {len(found)} | "
                    f"{np.mean(earned):.{digits}f} ({min(earned):.{digits}f}) | {goals[key[0]]:.{digits}f} | {up} | "
                    f"{found[0]['steps']:,} | {took:.0f} s |")
    return "\n".join(rows)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("file", type=Path, help="file of the agents' lines")
    parser.add_argument("--algorithms", nargs="*", default=["ppo"], choices=("ppo", "sac"))
    parser.add_argument("--ids", nargs="*", default=[], help="environments to train in")
    parser.add_argument("--seeds", type=int, nargs="*", default=[0])
    parser.add_argument("--defaults", action="store_true", help="the library's settings, not ours")
    parser.add_argument("--change", nargs="*", default=[], help="NAME=VALUE, in YAML, in place of one of our settings")
    options = parser.parse_args()
    if options.defaults and options.change:
        parser.error("--defaults takes none of our settings, so that --change has nothing to change; give one of them.")
    changes = {key: yaml.safe_load(value) for key, value in (one.split("=", 1) for one in options.change)}
    what = "defaults" if options.defaults else " ".join(options.change) or "ours"
    for algorithm, name, seed in [(a, n, s) for a in options.algorithms for n in options.ids for s in options.seeds]:
        key = {"algorithm": algorithm, "id": name, "what": what, "seed": seed}
        if not any({**one, **key} == one for one in lines_of(options.file)):
            line = {**key, **judged(algorithm, name, seed, changes, options.defaults)}
            with options.file.open("a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")
            print(*key.values(), f"return {line['return']:.1f}, {line['upright']:.0%} upright", flush=True)
    print(table(lines_of(options.file)))


def lines_of(path):
    """Return what the lines of a file say; nothing if there is none."""
    return [json.loads(one) for one in path.read_text(encoding="utf-8").splitlines()] if path.exists() else []


if __name__ == "__main__":
    main()
