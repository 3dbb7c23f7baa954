"""Train PPO to swing up: ``python 11_train_swing_up.py FOLDER STEPS``, after ``pip install stable-baselines3``."""

import sys
from pathlib import Path

import numpy as np

from pendulum_env import LabPendulumEnv, LabPendulumVectorEnv, plots, render

try:
    import torch
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import VecEnv
except ModuleNotFoundError as missing:
    sys.exit(f"{missing.name} is not installed; this example needs: pip install stable-baselines3")

SCALE = np.array([1.0, 1.0, 0.1], dtype=np.float32)  # scales the observations for the network


class Pendulums(VecEnv):  # adapts the vector environment to Stable-Baselines3, with scaled rewards
    def __init__(self, count, task):
        self.env = LabPendulumVectorEnv(
            count, task=task, max_episode_steps=500, autoreset_mode="SameStep", diagnostics=())
        self.total, self.returns = np.zeros(count), []
        super().__init__(count, self.env.single_observation_space, self.env.single_action_space)

    def step_async(self, actions):
        seen, reward, ended, late, info = self.env.step(actions)
        over, infos, self.total = ended | late, [{} for _ in reward], self.total + reward
        for i in np.flatnonzero(over):
            infos[i] = {"terminal_observation": SCALE * info["final_obs"][i], "TimeLimit.truncated": bool(late[i])}
        self.returns, self.total = self.returns + self.total[over].tolist(), np.where(over, 0.0, self.total)
        self.result = SCALE * seen, 0.01 * reward, over, infos

    reset, step_wait = (lambda self: SCALE * self.env.reset(seed=self._seeds[0])[0]), (lambda self: self.result)
    env_is_wrapped = close = lambda self, *_, **__: [None] * self.num_envs
    env_method, get_attr, set_attr = None, lambda self, name, indices=None: [getattr(self.env, name)] * self.num_envs, (
        lambda self, name, value, indices=None: setattr(self.env, name, value))  # settings cannot be set


def trained(task, steps, seed):
    torch.set_num_threads(1)
    (env := Pendulums(64, task)).seed(seed)
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
