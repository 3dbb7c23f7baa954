"""Speed-up by two threads beside that by two separate processes, which share no work: what the machine's cores allow.

In turn, 65 536 environments take steps with one thread, with two threads, and as two halves, each in a process on a
core of its own: the halves one after the other, then at the same time. The processes' speed-up is the sum over both of
the time that a half takes alone over the time that it takes beside the other. Linux only.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import multiprocessing
import statistics
from multiprocessing.connection import Connection
from typing import Any

from machine import describe
from peers import timed
from vector_env import EULER, LARGE, RK4, Ours

STEPS = 300
KINDS = {"rk4, energies": RK4, "symplectic Euler, no diagnostics": EULER}


def half(core: int, how: dict[str, Any], line: Connection) -> None:
    """Step half of the environments on one core whenever asked to, and send back the wall time [s]."""
    os.sched_setaffinity(0, {core})
    run = Ours(LARGE // 2, how, 1).run(STEPS)
    while line.recv():
        line.send(timed(run).wall)


def main() -> None:
    parser = argparse.ArgumentParser(description="Compare two threads with two processes.")
    parser.add_argument("--repeats", type=int, default=25, help="number of turns")
    repeats = parser.parse_args().repeats
    print(describe())
    spawn, cores = multiprocessing.get_context("spawn"), sorted(os.sched_getaffinity(0))[:2]
    for name, how in KINDS.items():
        one, two = (Ours(LARGE, how, threads).run(STEPS) for threads in (1, 2))
        lines = []
        for core in cores:
            here, there = spawn.Pipe()
            spawn.Process(target=half, args=(core, how, there), daemon=True).start()
            lines.append(here)

        def times(asked: list[Connection]) -> list[float]:
            for line in asked:
                line.send(True)
            return [line.recv() for line in asked]

        times(lines)
        found: list[tuple[float, float]] = []
        for _ in range(repeats):
            threads = timed(one).wall / timed(two).wall
            alone, together = [times([line])[0] for line in lines], times(lines)
            found.append((threads, sum(a / b for a, b in zip(alone, together, strict=True))))
        for line in lines:
            line.send(False)
        threads, processes = map(statistics.median, zip(*found, strict=True))
        share = statistics.median(a / b for a, b in found)
        print(f"{name}: two threads {threads:.2f} times as fast as one, two processes {processes:.2f} times; in turn, "
              f"threads reach {share:.2f} of the processes' speed-up")


if __name__ == "__main__":
    main()
