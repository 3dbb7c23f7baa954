"""What a Dask cluster costs a sweep: overhead of a point and of a task, and what a cluster of 100 workers would do.

Measured on a cluster of two processes on this machine, whose scheduler and client share its cores. Points that only
wait stand for points that compute, so that many workers fit on few cores: 100 threads of the two processes wait at
once, for which scheduler and client do the work that they do for 100 workers elsewhere. The model is

    time = max(points duration/workers (1 + w/(points per task duration)), s tasks),

with the time s that scheduler and client, one after the other, spend on each task, and w, which a worker waits between
two of its tasks. It breaks where a task takes less than s workers: then the scheduler is always busy, and workers wait.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import math
import time

from machine import describe

from pendulum_env import sweep
from pendulum_env.study.sweep.study import TASK

LONG = 200
"""Number of points by which the wait between tasks is measured."""
ROWS = ((2000, 1e-3), (2000, 1e-2), (4000, 0.1), (1000, 0.5))
"""Number of points and the duration of one [s]."""


def waited(point: dict[str, float]) -> dict[str, float]:
    """Wait as long as a point of this duration would compute."""
    time.sleep(point["duration"])
    return {"done": 1.0}


def seconds(executor: object, count: int, duration: float, per_task: int | None) -> float:
    """Return the wall time of a sweep of ``count`` points [s]."""
    grid = [{"number": float(i), "duration": duration} for i in range(count)]
    begun = time.perf_counter()
    found = sweep(grid, executor, run=waited, per_task=per_task, progress=False)  # type: ignore[arg-type]
    assert found.complete
    return time.perf_counter() - begun


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--workers", type=int, default=100, help="number of threads that wait as workers do")
    workers = parser.parse_args().workers
    from distributed import Client, LocalCluster

    print(describe(("distributed",)))
    options = {"n_workers": 2, "processes": True, "host": "127.0.0.1", "dashboard_address": None}
    with LocalCluster(threads_per_worker=1, **options) as cluster, Client(cluster, set_as_default=False) as client:
        executor = client.get_executor(pure=False)
        seconds(executor, 100, 0.0, 1)
        each = seconds(executor, 2000, 0.0, 1) / 2000
        together = seconds(executor, 20_000, 0.0, None) / 20_000
        wait = max(0.0, seconds(executor, LONG, 0.05, 1) * 2 / LONG - 0.05)
    print(f"two processes: {1e3 * each:.2f} ms a point that does nothing, a task each; {1e3 * together:.3f} ms, points "
          f"put together; between two tasks of 0.05 s a worker waits {1e3 * wait:.1f} ms")
    print(f"the scheduler's limit: {1.0 / each:.0f} tasks a second; {TASK / each:.0f} workers with tasks of {TASK} s")
    with (LocalCluster(threads_per_worker=math.ceil(workers / 2), **options) as cluster,
          Client(cluster, set_as_default=False) as client):
        executor = client.get_executor(pure=False)
        seconds(executor, 4 * workers, 0.01, 1)
        for count, duration in ROWS:
            alone = count * duration / workers
            model = max(alone * (1.0 + wait / duration), each * count)
            one = seconds(executor, count, duration, 1)
            several = seconds(executor, count, duration, None)
            print(f"{workers} workers, {count} points of {duration:g} s: a task each {one:.2f} s, model {model:.2f}, "
                  f"put together {several:.2f}; without any overhead {alone:.2f}", flush=True)


if __name__ == "__main__":
    main()
