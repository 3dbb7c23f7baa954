"""Simulation, bench, fit, simulation: a controller from nominal numbers runs on a bench with others, and learns them.

The bench is a process in real time, at whose scene this program does not look before its last lines. The controller
gives the torque that its scene needs, and little feedback. A bench of your own is ``device="serial:/dev/ttyACM0"``.
"""

import math

import gymnasium as gym
import numpy as np

from pendulum_env import SCENES, Sensor
from pendulum_env.bench import VirtualBoard
from pendulum_env.lab import DrivenLog, fit_driven
from pendulum_env.tasks import Task

RUNS, STEPS = 3, 300
NOMINAL = SCENES["motor_bench"]
HIDDEN = NOMINAL.replace(length=0.56, friction_torque=0.06, bearing_viscosity=0.05, max_torque=1.2, lag=0.02)


def aim(time):
    return (0.22 * math.sin(1.4 * time) + 0.09 * math.sin(5.5 * time)) * math.tanh(0.1 * time * time)


def action(scene, late, time, angle):  # the torque for the aim at the time when it will act
    has = {"lag": 0.0, **scene.parameters()}
    before, there, after = (aim(max(time + late + has["lag"] + step, 0.0)) for step in (-0.01, 0.0, 0.01))
    rate, rise = (after - before) / 0.02, (after - 2.0 * there + before) / 0.01**2
    torque = scene.inertia * rise + scene.restoring * math.sin(there)
    torque += has["bearing_viscosity"] * rate + has["friction_torque"] * math.tanh(rate / 0.05)
    return np.array([torque / has["max_torque"] + 0.1 * (aim(time) - angle)], dtype=np.float32)


def runs(env, scene, late):
    returns, logs = [], []
    while len(returns) < RUNS:
        (_, info), total, lost, ended = env.reset(), 0.0, False, False
        while not (lost or ended):
            _, reward, lost, ended, info = env.step(action(scene, late, info["time"], info["angle"]))
            total += reward
        if not info["stop_reason"]:  # else a busy computer left the bench alone for too long
            returns.append(total)
            logs.append(DrivenLog.read(env.unwrapped.log))
    print(f"returns {np.mean(returns):.3f} ± {np.std(returns, ddof=1) / math.sqrt(RUNS):.3f}")
    return np.mean(returns), logs


def main():
    bench = VirtualBoard(HIDDEN, sensor=Sensor(quantum=math.tau / 2400, noise=0.0005), action_delay=0.012)
    task = Task("follow", lambda error: -error * error, reference=aim, start={"angle": 0.0})
    env = gym.make("LabPendulumBench-v0", device=bench, scene=NOMINAL, task=task, warn=False, max_episode_steps=STEPS)
    before, logs = runs(env, NOMINAL, 0.0)
    found = fit_driven(logs, mass=NOMINAL.body.mass)
    after, _ = runs(env, found.scene, found.settings["action_delay"])
    env.close()
    nominal, hidden = NOMINAL.parameters(), HIDDEN.parameters()
    for name in ("length", "bearing_viscosity", "friction_torque", "max_torque"):
        print(f"{name}: nominal {nominal[name]}, fitted {found.parameters[name]}, hidden {hidden[name]}")
    assert after > 0.5 * before, (before, after)


if __name__ == "__main__":
    main()
