"""Train PPO to swing up: ``python 11_train_swing_up.py FOLDER STEPS``, after ``pip install 'lab-pendulum[sb3]'``."""

import sys
from pathlib import Path

import numpy as np

from pendulum_env import LabPendulumEnv, plots, render

try:
    import torch
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import VecEnvWrapper, VecMonitor

    from pendulum_env.adapters.sb3 import LabPendulumVecEnv
except ModuleNotFoundError as missing:
    sys.exit(f"{missing.name} is not installed; this example needs: pip install 'lab-pendulum[sb3]'")

SCALE = np.array([1.0, 1.0, 0.1], dtype=np.float32)  # scales the observations for the network


class Scaled(VecEnvWrapper):  # scales observations and rewards, and keeps the returns of the episodes
    def reset(self):
        self.returns = []
        return SCALE * self.venv.reset()

    def step_wait(self):
        seen, reward, over, infos = self.venv.step_wait()
        for i in np.flatnonzero(over):
            infos[i]["terminal_observation"] = SCALE * infos[i]["terminal_observation"]
            self.returns.append(infos[i]["episode"]["r"])
        return SCALE * seen, 0.01 * reward, over, infos


def trained(task, steps, seed, **keywords):
    torch.set_num_threads(1)
    (env := Scaled(VecMonitor(LabPendulumVecEnv(64, task=task, diagnostics=(), **keywords)))).seed(seed)
    more = {"use_sde": True, "sde_sample_freq": 8, "device": "cpu"}  # state-dependent noise changes slowly
    model = PPO("MlpPolicy", env, lambda left: 1e-3 * max(left, 0.02), 64, 1024, seed=seed, **more).learn(steps)
    return lambda seen: model.predict(SCALE * seen, deterministic=True)[0], env.returns


if __name__ == "__main__":
    folder, steps = Path(*sys.argv[1:2]), int(sys.argv[2]) if len(sys.argv) > 2 else 500_000
    folder.mkdir(parents=True, exist_ok=True)
    policy, returns = trained("swing_up", steps, seed=1)
    drawn, (axes,) = plots.figure()
    axes.plot(32_000 * np.arange(1, len(returns) // 64 + 1), np.mean(np.reshape(returns, (-1, 64)), 1), marker=".")
    axes.set(xlabel="steps", ylabel="return, mean of 64 episodes", title="PPO on swing_up, lab, dt = 0.02 s, rk4")
    drawn.savefig(folder / "learning_curve.png")
    env = LabPendulumEnv(render_mode="rgb_array", render_size=300)
    seen, frames = env.reset(seed=1)[0], []
    for _ in range(500):
        frames.append(env.render())
        seen = env.step(policy(seen))[0]
    render.write_film(folder / "swing_up.mp4", frames[::2], 25.0)
    print(f"the last 64 episodes return {np.mean(returns[-64:]):.0f}; film and learning curve are in {folder}")
    assert np.mean(returns[-64:]) > (-1000.0 if steps >= 500_000 else -6000.0)
