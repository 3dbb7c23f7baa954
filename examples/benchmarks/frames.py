"""Time of one frame compared with Gymnasium's Pendulum-v1, both unwrapped, timed in turn.

Only render() is timed, after one step each. Goals: a 500 x 500 frame of the apparatus at least 5 times as fast, and one
with energy bars, the default, 6 times. No display is needed.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")

import statistics
import time

import gymnasium as gym
import numpy as np
from machine import describe

import pendulum_env  # noqa: F401

FRAMES, REPEATS = 60, 9
APPARATUS = ("apparatus",)
KINDS = {
    "apparatus": {"render_panels": APPARATUS},
    "apparatus, dark": {"render_panels": APPARATUS, "render_theme": "dark"},
    "apparatus, energy (the default)": {},
    "energy": {"render_panels": ("energy",)},
    "history": {"render_panels": ("history",)},
    "phase": {"render_panels": ("phase",)},
    "residual": {"render_panels": ("residual",)},
    "all five": {"render_panels": ("apparatus", "energy", "history", "phase", "residual")},
    "apparatus, 200 x 200": {"render_panels": APPARATUS, "render_size": 200},
    "apparatus, 1000 x 1000": {"render_panels": APPARATUS, "render_size": 1000},
}
"""Kind of frame, 500 x 500 by default -> keywords of gym.make."""


def us_per_frame(env: gym.Env, actions: list[np.ndarray]) -> float:
    """Return the mean wall time of render() [us], each after a step that is not timed."""
    taken = 0.0
    for action in actions:
        env.step(action)
        begun = time.perf_counter()
        env.render()
        taken += time.perf_counter() - begun
    return 1e6 * taken / len(actions)


def main() -> None:
    print(describe(("gymnasium", "numpy", "pygame-ce")))
    actions = list(np.random.default_rng(0).uniform(-1, 1, (FRAMES, 1)).astype(np.float32))
    envs = {name: gym.make("LabPendulum-v0", task="free", render_mode="rgb_array", **keywords).unwrapped
            for name, keywords in KINDS.items()}
    peer = gym.make("Pendulum-v1", render_mode="rgb_array").unwrapped
    times: dict[str, list[float]] = {name: [] for name in envs}
    theirs: dict[str, list[float]] = {name: [] for name in envs}
    for env in (*envs.values(), peer):
        env.reset(seed=0)
        us_per_frame(env, actions)
    for _ in range(REPEATS):
        for name, env in envs.items():
            times[name].append(us_per_frame(env, actions))
            theirs[name].append(us_per_frame(peer, actions))
    for name, found in times.items():
        ratio = statistics.median(their / our for our, their in zip(found, theirs[name], strict=True))
        print(f"{name:32s} {statistics.median(found):8.0f} us a frame, {ratio:5.2f} times as fast as Pendulum-v1")
    every = statistics.median(taken for found in theirs.values() for taken in found)
    print(f"{'Pendulum-v1':32s} {every:8.0f} us a frame")


if __name__ == "__main__":
    main()
