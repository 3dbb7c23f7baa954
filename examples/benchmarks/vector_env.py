"""Speed of the vector environment compared with other packages: paired repeats in turn, median ratio over the pairs.

The peers run in their own venvs (see peers.py), which the first run creates with pip. While one side is timed, the
others are idle. "cores" is processor time divided by wall time: if it is well below the number of threads, something
else was using the machine.

This package simulates the physics that the peers have: gravity and a motor, without losses. Lines without a goal show
the full `lab` scene, new arrays in every step (copy) and gymnax's own autoreset. Actions are sampled once, outside the
timed steps. New episodes start within them: after 500 steps here, after 200 for gymnax and EnvPool, and for CartPole
when the pole falls. Compilation is not timed.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import statistics
import subprocess
import sys
import tracemalloc
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from machine import describe
from peers import PINS, Peer, Run, Timing, stepping, timed

from pendulum_env import Task
from pendulum_env.engine.kernels import cache_folder

LARGE, SMALL = 65_536, 1024
STEPS = {LARGE: 600, SMALL: 6000}
SIZES = (65_536, 131_072, 262_144)
WARM_STEPS = 20
MOST_BYTES = 200


def same_reward(phi: float, speed: float, action: float) -> float:
    """The reward of swing_up, as a user writes it."""
    return -(phi**2 + 0.1 * speed**2 + 0.001 * action**2)


OWN_TASK = {"task": Task("own", same_reward, start={"angle": (-0.1, 0.1), "speed": (-0.05, 0.05)})}
NOTHING: dict[str, Any] = {}
LIKE = {"scene": "lab", "damping": "none"}
FULL = {"scene": "lab"}
EULER = {"integrator": "symplectic_euler", "diagnostics": ()}
RK4 = {"integrator": "rk4", "diagnostics": ("energy",)}


class Side(NamedTuple):
    """One side of a comparison: name, number of environments, steps per repeat, and function that times a repeat."""

    name: str
    num_envs: int
    steps: int
    time: Callable[[], Timing]

    def measure(self) -> tuple[float, float]:
        """Time one repeat; return nanoseconds per environment step, and the number of busy cores."""
        timing = self.time()
        return 1e9 * timing.wall / (self.num_envs * self.steps), timing.cpu / timing.wall


class Ours(NamedTuple):
    """Settings of a vector environment of this package."""

    num_envs: int
    how: dict[str, Any]
    threads: int
    physics: dict[str, Any] = LIKE
    copy: bool = False
    more: dict[str, Any] = NOTHING

    @property
    def name(self) -> str:
        shown = "energies" if self.how["diagnostics"] else "no diagnostics"
        threads = f"{self.threads} thread{'s' * (self.threads > 1)}"
        scene = "" if self.physics is LIKE else ", full lab scene"
        task = ", a task of one's own" if self.more else ""
        return f"{self.num_envs} {self.how['integrator']}, {shown}, {threads}{scene}{', copy' * self.copy}{task}"

    def make(self) -> gym.vector.VectorEnv:
        return gym.make_vec(
            "LabPendulum-v0", self.num_envs, vectorization_mode="vector_entry_point",
            num_threads=self.threads, copy=self.copy, **self.how, **self.physics, **self.more,
        )  # fmt: skip

    def run(self, steps: int) -> Run:
        """Return a repeat of ``steps`` steps, ready to be timed."""
        env, actions = self.make(), sampled_actions(self.num_envs)
        env.reset(seed=0)
        stepping(env, actions, WARM_STEPS)()
        return stepping(env, actions, steps)

    def side(self) -> Side:
        steps = STEPS[self.num_envs]
        run = self.run(steps)
        return Side(self.name, self.num_envs, steps, lambda: timed(run))


class Against(NamedTuple):
    """A way to run a peer, with its number of environments and steps."""

    peer: str
    form: str
    num_envs: int
    steps: int

    def side(self, peers: dict[str, Peer]) -> Side:
        return Side(
            f"{self.peer} {self.form}", self.num_envs, self.steps,
            lambda: peers[self.peer].time(self.form, self.num_envs, self.steps),
        )  # fmt: skip


class Row(NamedTuple):
    """Line of the table: this package must be ``goal`` times as fast as the other side; None: for information only."""

    ours: Ours
    other: Against | Ours
    goal: float | None = None


GYMNAX = Against("gymnax", "Pendulum, step_env", LARGE, 600)
GYMNAX_STEP = Against("gymnax", "Pendulum, step", LARGE, 600)
CART_POLE = Against("gymnasium", "CartPoleVectorEnv", SMALL, 3000)
ENVPOOL = Against("envpool", "Pendulum", SMALL, 600)
PEERS = (GYMNAX, GYMNAX_STEP, CART_POLE, ENVPOOL)

ROWS = (
    Row(Ours(LARGE, EULER, 2), GYMNAX, 6.0),
    Row(Ours(LARGE, RK4, 2), GYMNAX, 1.3),
    Row(Ours(SMALL, RK4, 1), CART_POLE, 5.0),
    Row(Ours(SMALL, RK4, 1), ENVPOOL, 75.0),
    Row(Ours(LARGE, EULER, 2), Ours(LARGE, EULER, 1), 1.6),
    Row(Ours(LARGE, RK4, 2), Ours(LARGE, RK4, 1), 1.8),
    *(Row(Ours(size, how, 1, more=OWN_TASK), Ours(size, how, 1), 0.9) for size in (LARGE, SMALL)
      for how in (EULER, RK4)),
    Row(Ours(LARGE, EULER, 2), GYMNAX_STEP),
    Row(Ours(LARGE, RK4, 2), GYMNAX_STEP),
    *(Row(Ours(LARGE, how, 2, physics, copy), GYMNAX) for how in (EULER, RK4) for physics, copy in
      ((LIKE, True), (FULL, False), (FULL, True))),
    *(Row(Ours(SMALL, RK4, 1, physics, copy), CART_POLE) for physics, copy in
      ((LIKE, True), (FULL, False), (FULL, True))),
)  # fmt: skip


def sampled_actions(num_envs: int) -> np.ndarray:
    """Return one random action per environment, shape (num_envs, 1)."""
    return np.random.default_rng(0).uniform(-1, 1, (num_envs, 1)).astype(np.float32)


def verdict(met: bool, goal: str) -> str:
    return f"goal {goal}: {'met' if met else 'MISSED'}"


def compare(row: Row, peers: dict[str, Peer], repeats: int) -> str:
    """Time both sides of a row in turn and return its line of text."""
    ours, other = row.ours.side(), row.other.side() if isinstance(row.other, Ours) else row.other.side(peers)
    sides = (other, ours)
    for side in sides:
        side.time()
    pairs = [tuple(side.measure() for side in sides) for _ in range(repeats)]
    ratio = statistics.median(theirs[0] / own[0] for theirs, own in pairs)
    spans = [(f"{side.name} {statistics.median(pair[i][0] for pair in pairs):.1f} ns on "
              f"{statistics.median(pair[i][1] for pair in pairs):.2f} cores") for i, side in enumerate(sides)]
    goal = "" if row.goal is None else f" ({verdict(ratio >= row.goal, f'{row.goal:g}')})"
    return f"{ratio:6.2f} times{goal}: {spans[1]}; {spans[0]}"


def peers_only(peers: dict[str, Peer], repeats: int) -> None:
    """Time only the peers, in turn, and print the results."""
    sides = [against.side(peers) for against in PEERS]
    for side in sides:
        side.time()
    measured = [[side.measure() for side in sides] for _ in range(repeats)]
    for side, repeated in zip(sides, zip(*measured, strict=True), strict=True):
        times, cores = zip(*repeated, strict=True)
        print(f"{side.name:28s} {side.num_envs:6d} envs {statistics.median(times):8.1f} ns an env step "
              f"({min(times):.1f} to {max(times):.1f}), {statistics.median(cores):.2f} cores")


# --- memory -----------------------------------------------------------------------------------------------------


def held(traced: bool) -> int:
    """Return the memory of this process [bytes]: counted by tracemalloc, or resident (Linux)."""
    if traced:
        return tracemalloc.get_traced_memory()[0]
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def occupy(num_envs: int, traced: bool) -> None:
    """Print the memory that ``num_envs`` environments add to this process, which has compiled and run others before."""
    Ours(SMALL, RK4, 2).run(1)()
    actions = sampled_actions(num_envs)
    if traced:
        tracemalloc.start()
    before = held(traced)
    env = Ours(num_envs, RK4, 2).make()
    env.reset(seed=0)
    stepping(env, actions, WARM_STEPS)()
    print(held(traced) - before)


def memory(traced: bool) -> str:
    """Measure bytes per environment in new processes with three sizes, with rk4, energies and copy=False."""
    sums = []
    for size in SIZES:
        command = [sys.executable, __file__, "--occupy", str(size), *["--traced"] * traced]
        sums.append(int(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout))
    each = [count / size for count, size in zip(sums, SIZES, strict=True)]
    grown = [(sums[i + 1] - sums[i]) / (SIZES[i + 1] - SIZES[i]) for i in range(len(SIZES) - 1)]
    worst, uneven = max(each), max(grown) / min(grown) - 1
    goal = verdict(worst < MOST_BYTES and uneven < 0.05, f"under {MOST_BYTES}, linear within 5 %")
    shown = ", ".join(f"{count:.0f} of {size}" for count, size in zip(each, SIZES, strict=True))
    return (f"{worst:6.0f} bytes per environment, {'arrays and objects' if traced else 'resident'} ({goal}): {shown}; "
            f"growth is even within {100 * uneven:.1f} %")


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description="Compare the vector environment with gymnax, Gymnasium and EnvPool.")
    parser.add_argument("--envs", type=Path, default=cache_folder() / "peers", help="folder of the peers' venvs")
    parser.add_argument("--repeats", type=int, default=15, help="number of pairs for each ratio")
    parser.add_argument("--peers-only", action="store_true", help="time only the peers")
    parser.add_argument("--goals", action="store_true", help="only the lines that have a goal")
    parser.add_argument("--occupy", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--traced", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.occupy:
        return occupy(options.occupy, options.traced)
    print(describe())
    peers = {name: Peer(name, options.envs) for name in PINS}
    try:
        for name, peer in peers.items():
            print(f"{name}: {', '.join(f'{package} {number}' for package, number in peer.versions.items())}")
        if options.peers_only:
            return peers_only(peers, options.repeats)
        for row in (row for row in ROWS if row.goal is not None or not options.goals):
            print(compare(row, peers, options.repeats), flush=True)
        for traced in (False, True):
            if traced or sys.platform == "linux":
                print(memory(traced), flush=True)
    finally:
        for peer in peers.values():
            peer.close()


if __name__ == "__main__":
    main()
