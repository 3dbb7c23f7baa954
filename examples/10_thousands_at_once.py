"""Test a controller designed for a length of 0.353 m on 2048 pendulums of different lengths at once."""

import time

import gymnasium as gym
import numpy as np

import pendulum_env

COUNT, STEPS = 2048, 200
lengths = np.linspace(0.2, 0.6, COUNT)
how = {"integrator": "velocity_verlet", "dt": 0.04, "diagnostics": ()}
controller = pendulum_env.controllers.SwingUp("lab", dt=0.04)

env = gym.make_vec("LabPendulum-v0", COUNT, vectorization_mode="vector_entry_point", length=lengths, **how)
observation, _ = env.reset(seed=0)
began = time.perf_counter()
for _ in range(STEPS):
    observation, *_ = env.step(controller(observation))
took = time.perf_counter() - began
print(f"{COUNT * STEPS} steps in {took:.2f} s, {1e9 * took / (COUNT * STEPS):.0f} ns per step with the controller")

fallen = lengths[observation[:, 0] > np.cos(np.pi - 0.1)]
longest = fallen[fallen > 0.353].min()
print(f"after {STEPS * 0.04:g} s {COUNT - len(fallen)} pendulums are upright, with all from 0.2 m to {longest:.3f} m")
assert fallen.min() > 0.353
assert 0.4 < longest < 0.5

place = COUNT // 3
one = gym.make("LabPendulum-v0", length=float(lengths[place]), **how)
alone, _ = one.reset(seed=place)
for _ in range(STEPS):
    alone, *_ = one.step(controller(alone))
print(f"pendulum {place} alone ends at {alone.tolist()}, bit-identical to its end in the batch")
assert np.array_equal(alone, observation[place])
