"""A task of one's own: swing up, rewarded for approaching the energy of the top, by potential-based shaping.

This shaping (Ng, Harada & Russell 1999) rewards a step by the change of a function of the state. Here it is
the distance of the energy from that of the top, so that the return is this distance at the start less that at the end.
"""

import math

import gymnasium as gym
import numpy as np

import pendulum_env

OMEGA0 = pendulum_env.SCENES["lab"].omega0


def missing(phi, velocity):  # energy that is missing at the top, in units of m g L; 0 for a bob that just reaches it
    return abs(math.cos(phi) + 0.5 * (velocity / OMEGA0) ** 2 - 1.0)


def shaped(phi, velocity, phi_before, velocity_before):
    return missing(phi_before, velocity_before) - missing(phi, velocity)


task = pendulum_env.Task("pump", shaped, start={"angle": (-0.1, 0.1), "speed": (-0.05, 0.05)}, duration=8.0)
env = gym.make_vec("LabPendulum-v0", num_envs=256, task=task, max_episode_steps=400)
controller, total = pendulum_env.controllers.swing_up(env), np.zeros(256)
observation, infos = env.reset(seed=0)
wanted = np.array([missing(a - math.pi, v) for a, v in zip(infos["angle"], infos["velocity"], strict=True)])
for _ in range(400):
    observation, reward, _, truncated, infos = env.step(controller(observation))
    total += reward

print(f"{task.name}: mean return {total.mean():.4f}, energy that was missing {wanted.mean():.4f} m g L")
assert truncated.all()
assert np.allclose(total, wanted, atol=1e-3)  # all of it was supplied: the bobs stand upright

one = gym.make("LabPendulum-v0", task=task, max_episode_steps=400)  # the same bits in a single environment
one.reset(seed=0)
vector = gym.make_vec("LabPendulum-v0", num_envs=1, task=task, max_episode_steps=400)
vector.reset(seed=0)
push = np.ones(1, dtype=np.float32)
assert one.step(push)[1] == vector.step(push[None])[1][0]
