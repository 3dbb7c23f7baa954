"""Worker process of one package: it prepares solvers, measures their errors and times them.

precision.py runs it as ``worker.py NAME PACKAGES``; it imports only the module of that name, and so only that package.
"""

from __future__ import annotations

import math
import os
import sys
import time
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np
from venvs import serve, versions

from against.problem import Array, Problem, Solver, largest_error

SHARES = (0.02, 0.1)
"""Fractions of a run that are done first, to compile and to predict the time of the complete run."""
SHORTEST = 1e-3
"""Minimum duration of a timing [s]; short runs are repeated."""
CORE = "PRECISION_CORE"
"""Environment variable with the number of the processor core for all workers."""


@lru_cache(maxsize=2)
def _truth(file: str) -> Array:
    return np.asarray(np.load(file))


def _timed(solver: Solver, setting: Any, duration: float, runs: int = 1) -> tuple[float, Array]:
    """Return the mean wall time of some runs [s], and the angles of the last one."""
    begun = time.perf_counter()
    for _ in range(runs):
        angles = solver(setting, duration)
    return (time.perf_counter() - begun) / runs, angles


def _expected(solver: Solver, setting: Any, duration: float, whole: bool, limit: float) -> float:
    """Predict the time of a run [s] from shorter runs.

    The work is proportional to the number of steps, or to the duration for a tolerance; each run has a fixed overhead.
    """
    work, times = [], []
    for share in SHARES:
        part = (max(1, int(share * setting)), duration) if whole else (setting, share * duration)
        work.append(part[0] / setting if whole else share)
        _timed(solver, *part)
        times.append(_timed(solver, *part)[0])
        most = times[-1] / work[-1]
        if most <= limit:
            return most
        if times[-1] > limit:
            return times[-1]
    per_work = (times[1] - times[0]) / (work[1] - work[0]) if work[1] > work[0] else 0.0
    return times[1] + max(0.0, per_work) * (1.0 - work[1])


def main(name: str, pins: list[str]) -> None:
    """Serve requests for one package until stdin closes."""
    if os.environ.get(CORE) and hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {int(os.environ[CORE])})
    module = import_module(f"against.{name}_lines")
    prepared: dict[tuple[str, Problem], Solver] = {}

    def answer(request: dict[str, Any]) -> Any:
        problem, line, setting = Problem(*request["problem"]), request["line"], request["setting"]
        if request["what"] == "fits":
            return not hasattr(module, "fits") or module.fits(line, problem)
        if (line, problem) not in prepared:
            prepared[line, problem] = module.LINES[line](problem)
        solver, duration = prepared[line, problem], problem.duration
        if request["what"] == "time":
            return _timed(solver, setting, duration, request["runs"])[0]
        expected = _expected(solver, setting, duration, request["whole"], request["limit"])
        if expected > request["limit"]:
            return {"time": expected, "error": None}
        once, angles = _timed(solver, setting, duration)
        if once < SHORTEST:  # a single short run, cold, would leave the choice of settings to chance
            once = _timed(solver, setting, duration, math.ceil(SHORTEST / once))[0]
        return {"time": once, "error": largest_error(angles, _truth(request["truth"]))}

    each = {
        line: [size for size in ("one", "many")
               if not (size == "many" and line in getattr(module, "ALONE", ()))
               and not (size == "one" and line in getattr(module, "TOGETHER", ()))]
        for line in module.LINES
    }
    serve({"versions": versions(pins), "lines": each}, answer)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2].split())
