"""The vector environment beside others: paired repeats in turn, each ratio the median over the pairs.

The peers run in venvs of their own (see peers.py), which a first run makes with pip. While one side is timed the
others idle. "cores" is processor time over wall time: if it is well below the threads of both sides, something else was
using the machine.

Ours takes the physics that the peers have, gravity and a motor and no losses; lines without a goal show the full
`lab` scene, fresh arrays in every step (copy) and gymnax's own autoreset. Actions are sampled once, outside the timed
steps. Every side starts new episodes within them: ours after 500 steps, gymnax and EnvPool after 200, CartPole when
the pole falls. Compiling is never timed.
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

import pendulum_env  # noqa: F401
from pendulum_env.engine.kernels import cache_folder

LARGE, SMALL = 65_536, 1024
STEPS = {LARGE: 600, SMALL: 6000}
SIZES = (65_536, 131_072, 262_144)
WARM_STEPS = 20
MOST_BYTES = 200

LIKE = {"scene": "lab", "damping": "none"}
FULL = {"scene": "lab"}
EULER = {"integrator": "symplectic_euler", "diagnostics": ()}
RK4 = {"integrator": "rk4", "diagnostics": ("energy",)}


class Side(NamedTuple):
    """One side of a pair: environments, steps of a repeat, and what runs it."""

    name: str
    num_envs: int
    steps: int
    time: Callable[[], Timing]

    def measure(self) -> tuple[float, float]:
        """Nanoseconds per environment step, and cores kept busy."""
        found = self.time()
        return 1e9 * found.wall / (self.num_envs * self.steps), found.cpu / found.wall


class Ours(NamedTuple):
    """A vector environment of this package."""

    num_envs: int
    how: dict[str, Any]
    threads: int
    physics: dict[str, Any] = LIKE
    copy: bool = False

    @property
    def name(self) -> str:
        shown = "energies" if self.how["diagnostics"] else "no diagnostics"
        threads = f"{self.threads} thread{'s' * (self.threads > 1)}"
        scene = "" if self.physics is LIKE else ", full lab scene"
        return f"{self.num_envs} {self.how['integrator']}, {shown}, {threads}{scene}{', copy' * self.copy}"

    def make(self) -> gym.vector.VectorEnv:
        return gym.make_vec(
            "LabPendulum-v0", self.num_envs, vectorization_mode="vector_entry_point",
            num_threads=self.threads, copy=self.copy, **self.how, **self.physics,
        )  # fmt: skip

    def run(self, steps: int) -> Run:
        """A repeat of ``steps`` steps, ready to be timed."""
        env, actions = self.make(), sampled_actions(self.num_envs)
        env.reset(seed=0)
        stepping(env, actions, WARM_STEPS)()
        return stepping(env, actions, steps)

    def side(self) -> Side:
        steps = STEPS[self.num_envs]
        run = self.run(steps)
        return Side(self.name, self.num_envs, steps, lambda: timed(run))


class Against(NamedTuple):
    """A peer's form of running."""

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
    """A line of the table: ours must be at least ``goal`` times as fast as the other; no goal is for information."""

    ours: Ours
    other: Against | Ours
    goal: float | None = None


GYMNAX = Against("gymnax", "Pendulum, step_env", LARGE, 600)
GYMNAX_STEP = Against("gymnax", "Pendulum, step", LARGE, 600)
CART_POLE = Against("gymnasium", "CartPoleVectorEnv", SMALL, 3000)
ENVPOOL = Against("envpool", "Pendulum", SMALL, 600)
PEERS = (GYMNAX, GYMNAX_STEP, CART_POLE, ENVPOOL)

ROWS = (
    Row(Ours(LARGE, EULER, 2), GYMNAX, 4.0),
    Row(Ours(LARGE, RK4, 2), GYMNAX, 1.3),
    Row(Ours(SMALL, RK4, 1), CART_POLE, 5.0),
    Row(Ours(SMALL, RK4, 1), ENVPOOL, 50.0),
    Row(Ours(LARGE, EULER, 2), Ours(LARGE, EULER, 1), 1.7),
    Row(Ours(LARGE, RK4, 2), Ours(LARGE, RK4, 1), 1.7),
    Row(Ours(LARGE, EULER, 2), GYMNAX_STEP),
    Row(Ours(LARGE, RK4, 2), GYMNAX_STEP),
    *(Row(Ours(LARGE, how, 2, physics, copy), GYMNAX) for how in (EULER, RK4) for physics, copy in
      ((LIKE, True), (FULL, False), (FULL, True))),
    *(Row(Ours(SMALL, RK4, 1, physics, copy), CART_POLE) for physics, copy in
      ((LIKE, True), (FULL, False), (FULL, True))),
)  # fmt: skip


def sampled_actions(num_envs: int) -> np.ndarray:
    """One action per environment, shape (num_envs, 1)."""
    return np.random.default_rng(0).uniform(-1, 1, (num_envs, 1)).astype(np.float32)


def verdict(met: bool, goal: str) -> str:
    return f"goal {goal}: {'met' if met else 'MISSED'}"


def compare(row: Row, peers: dict[str, Peer], repeats: int) -> str:
    """Time both sides in turn and give the row's line."""
    ours, other = row.ours.side(), row.other.side() if isinstance(row.other, Ours) else row.other.side(peers)
    sides = (other, ours)
    for side in sides:
        side.time()
    pairs = [tuple(side.measure() for side in sides) for _ in range(repeats)]
    ratio = statistics.median(theirs[0] / own[0] for theirs, own in pairs)
    spans = [(f"{side.name} {statistics.median(pair[i][0] for pair in pairs):.1f} ns on "
              f"{statistics.median(pair[i][1] for pair in pairs):.2f} cores") for i, side in enumerate(sides)]
    said = "" if row.goal is None else f" ({verdict(ratio >= row.goal, f'{row.goal:g}')})"
    return f"{ratio:6.2f} times{said}: {spans[1]}; {spans[0]}"


def peers_only(peers: dict[str, Peer], repeats: int) -> None:
    """Time the peers alone, in turn."""
    sides = [against.side(peers) for against in PEERS]
    for side in sides:
        side.time()
    found = [[side.measure() for side in sides] for _ in range(repeats)]
    for side, repeated in zip(sides, zip(*found, strict=True), strict=True):
        times, cores = zip(*repeated, strict=True)
        print(f"{side.name:28s} {side.num_envs:6d} envs {statistics.median(times):8.1f} ns an env step "
              f"({min(times):.1f} to {max(times):.1f}), {statistics.median(cores):.2f} cores")


# --- memory -----------------------------------------------------------------------------------------------------


def held(traced: bool) -> int:
    """Bytes of this process: those that tracemalloc counts, or those resident (Linux tells)."""
    if traced:
        return tracemalloc.get_traced_memory()[0]
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def occupy(num_envs: int, traced: bool) -> None:
    """Print what ``num_envs`` environments add to this process, which has compiled and run a few before."""
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
    """Bytes per environment from fresh processes of three sizes, rk4 and energies, copy=False."""
    sums = []
    for size in SIZES:
        command = [sys.executable, __file__, "--occupy", str(size), *["--traced"] * traced]
        sums.append(int(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout))
    each = [count / size for count, size in zip(sums, SIZES, strict=True)]
    grown = [(sums[i + 1] - sums[i]) / (SIZES[i + 1] - SIZES[i]) for i in range(len(SIZES) - 1)]
    worst, uneven = max(each), max(grown) / min(grown) - 1
    said = verdict(worst < MOST_BYTES and uneven < 0.05, f"under {MOST_BYTES}, linear within 5 %")
    shown = ", ".join(f"{count:.0f} of {size}" for count, size in zip(each, SIZES, strict=True))
    return (f"{worst:6.0f} bytes an environment, {'arrays and objects' if traced else 'resident'} ({said}): {shown}; "
            f"growth is even within {100 * uneven:.1f} %")


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description="The vector environment beside gymnax, Gymnasium and EnvPool.")
    parser.add_argument("--envs", type=Path, default=cache_folder() / "peers", help="folder of the peers' venvs")
    parser.add_argument("--repeats", type=int, default=7, help="pairs behind each ratio")
    parser.add_argument("--peers-only", action="store_true", help="time the peers alone")
    parser.add_argument("--occupy", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--traced", action="store_true", help=argparse.SUPPRESS)
    asked = parser.parse_args(arguments)
    if asked.occupy:
        return occupy(asked.occupy, asked.traced)
    print(describe())
    peers = {name: Peer(name, asked.envs) for name in PINS}
    try:
        for name, peer in peers.items():
            print(f"{name}: {', '.join(f'{package} {number}' for package, number in peer.versions.items())}")
        if asked.peers_only:
            return peers_only(peers, asked.repeats)
        for row in ROWS:
            print(compare(row, peers, asked.repeats), flush=True)
        for traced in (False, True):
            if traced or sys.platform == "linux":
                print(memory(traced), flush=True)
    finally:
        for peer in peers.values():
            peer.close()


if __name__ == "__main__":
    main()
