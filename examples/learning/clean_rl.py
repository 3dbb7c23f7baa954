"""Run CleanRL's own PPO with flags that solve the swing-up, and judge its agent in ``LabPendulum-v0``.

    python examples/learning/clean_rl.py cleanrl/ppo_continuous_action.py agents.jsonl --seeds 1 2 3

runs the program of a copy of CleanRL, which is not part of this package, with FLAGS, and appends a line of JSON for
each seed: return of 100 episodes that no training has seen, the fraction of them that end upright, seconds, versions.
A seed that has a line with the same flags is not trained again. Other flags, if there are any, go to CleanRL in place
of FLAGS.
Needs ``pip install ".[sb3]" tyro tensorboard`` (sb3 brings torch).
"""

import argparse
import json
import os
import platform
import runpy
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

import gymnasium as gym
import numpy as np

import pendulum_env
from pendulum_env.controllers import evaluate

ID, EPISODES, FIRST = "LabPendulum-v0", 100, 10**6  # FIRST: seed of the episodes that judge
FLAGS = ["--env-id", "pendulum_env:LabPendulumAnywhere-v0", "--gamma", "0.95", "--learning-rate", "1e-3",
         "--ent-coef", "0.02", "--total-timesteps", "300000"]


def trained(program, seed, flags):
    """Run the program and return its policy, a function from observations of many pendulums to their actions."""
    import torch

    torch.set_num_threads(1)
    sys.argv = [program.name, "--seed", str(seed), *flags]
    names = runpy.run_path(str(program), run_name="__main__")
    agent, envs = names["agent"].cpu(), names["envs"].envs
    normal = [running(env) for env in envs]
    mean, variance = (np.mean([getattr(one, name) for one in normal], axis=0) for name in ("mean", "var"))

    def policy(seen):
        x = np.clip((seen - mean) / np.sqrt(variance + 1e-8), -10.0, 10.0)
        with torch.no_grad():
            return agent.actor_mean(torch.as_tensor(x, dtype=torch.float32)).numpy().clip(-1.0, 1.0)

    return policy


def running(env):
    """Return the running mean and variance of the observations of one environment."""
    while not isinstance(env, gym.wrappers.NormalizeObservation):
        env = env.env
    return env.obs_rms


def judged(program, seed, flags):
    """Train and judge an agent; return what its line says of it."""
    import torch

    begun, worked = time.perf_counter(), time.process_time()
    policy = trained(program, seed, flags)
    took = {"seconds": time.perf_counter() - begun, "processor_seconds": time.process_time() - worked}
    earned = evaluate(policy, gym.make_vec(ID, EPISODES, diagnostics=()), FIRST)
    versions = {"python": platform.python_version(), "lab-pendulum": pendulum_env.__version__,
                "gymnasium": gym.__version__, "torch": torch.__version__}
    return {"algorithm": "cleanrl", "id": ID, "flags": flags, "seed": seed, "return": earned.returns.mean(),
            "upright": earned.reached.mean(), **took, "versions": versions}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("program", type=Path, help="cleanrl/ppo_continuous_action.py of your copy of CleanRL")
    parser.add_argument("file", type=Path, help="file of the agents' lines")
    parser.add_argument("--seeds", type=int, nargs="*", default=[1])
    options, flags = parser.parse_known_args()
    flags = flags or FLAGS
    program, file, home = options.program.resolve(), options.file.resolve(), Path.cwd()
    if not program.is_file():
        parser.error(f"there is no file {options.program}; give ppo_continuous_action.py of your copy of CleanRL.")
    lines = [json.loads(one) for one in file.read_text().splitlines()] if file.exists() else []
    # CleanRL is written for Gymnasium 0.29, whose wrapper did not ask for the space that its function leads to.
    gym.wrappers.TransformObservation = partial(gym.wrappers.TransformObservation, observation_space=None)
    for seed in options.seeds:
        if any((one["seed"], one["flags"]) == (seed, flags) for one in lines):
            continue
        with tempfile.TemporaryDirectory() as folder:  # the program writes its curves into runs/
            os.chdir(folder)
            try:
                line = judged(program, seed, flags)
            finally:
                os.chdir(home)
        with file.open("a") as out:
            out.write(json.dumps(line) + "\n")
        print(f"seed {seed}: return {line['return']:.1f}, {line['upright']:.0%} upright, "
              f"{line['seconds']:.0f} s", flush=True)


if __name__ == "__main__":
    main()
