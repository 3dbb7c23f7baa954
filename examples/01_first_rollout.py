"""A first episode: a free swing in vacuum, with the final angle compared with the exact solution."""

import gymnasium as gym
import numpy as np

import pendulum_env  # noqa: F401  (the import registers LabPendulum-v0)
from pendulum_env.physics import exact

env = gym.make("LabPendulum-v0", scene="vacuum", integrator="rk4", task="free", dt=0.02)
observation, info = env.reset(seed=0, options={"angle": 1.0, "velocity": 0.0})
for _ in range(100):
    observation, reward, terminated, truncated, info = env.step(np.zeros(1, dtype=np.float32))

angle, _ = exact.pendulum(info["time"], 1.0, 0.0, env.unwrapped.omega0)
error = abs(info["angle"] - angle)
print(f"after {info['time']:.2f} s: angle {info['angle']:+.6f} rad, exact {angle:+.6f}, error {error:.1e}")
assert error < 1e-6
