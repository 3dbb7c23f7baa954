"""Real time of ``LabPendulumBench-v0`` on the virtual bench: jitter and missed steps at 100 and 500 Hz.

``python examples/benchmarks/bench_clock.py`` makes 10 000 steps at each rate, in two minutes, and prints, by the clock
of the device, which counts milliseconds, the deviations of the readings' times from even ones, how late actions were
sent, and the steps that were left out. An episode that the watchdog ends is begun again and counted.
"""

from __future__ import annotations

import argparse
import math

import gymnasium as gym
import numpy as np

import pendulum_env

STEPS, RATES = 10_000, (100.0, 500.0)


def measured(rate: float, steps: int) -> str:
    """Return the row of the table for a rate [Hz]."""
    env = gym.make("LabPendulumBench-v0", device="virtual", task="free", dt=1.0 / rate, warn=False,
                   max_episode_steps=-1, speed_limit=math.inf, turn_limit=1e9)
    times: list[np.ndarray] = []
    late: list[float] = []
    missed = stopped = 0
    while len(late) < steps:
        env.reset()
        seen = []
        over = False
        while not over and len(late) < steps:
            action = np.full(1, math.sin(0.01 * len(late)), np.float32)
            *_, terminated, truncated, info = env.step(action)
            seen.append((info["time"], len(seen) + 1 + info["missed"]))
            late.append(info["time_late"])
            over = terminated or truncated
        missed, stopped = missed + info["missed"], stopped + over
        kept = seen[:-1] if over else seen
        if kept:
            at, step = np.array(kept).T
            times.append(at - step / rate)
    env.close()
    off = 1e3 * np.concatenate([part - np.median(part) for part in times]).round(6)
    late_ms = 1e3 * np.array(late)
    return (f"| {rate:g} Hz | {len(late)} | {np.std(off):.2g} ms | {np.percentile(np.abs(off), 99):.2g} ms | "
            f"{np.abs(off).max():.2g} ms | {np.median(late_ms):.2g} ms | {missed} | {stopped} |")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=STEPS, help=f"steps at each rate; {STEPS} by default")
    steps = parser.parse_args().steps
    print(f"lab-pendulum {pendulum_env.__version__}\n")
    print("| rate | steps | jitter | 99 % within | largest | action late, median | left out | stops by watchdog |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for rate in RATES:
        print(measured(rate, steps), flush=True)


if __name__ == "__main__":
    main()
