"""Coverage of the intervals of driven fits: how often they contain the true parameters of simulated logs.

Two logs of each bench are fitted together. Length, friction, motor, lag, delay, zero, sensor, rate and duration are
drawn at random, from fixed seeds, by ``tests/support/driven_truth.py``, which has its own equation of motion. The kinds
of log are "action", the command of a motor that lags and is late, with the mass given, and "torque", the torque that
acts, recorded late and with white noise. ``--fixed`` holds settings at a value, such as ``noise=0`` for an encoder
without noise. For each parameter, the benchmark prints the share of runs whose 95 % and 68 % intervals contain the true
value, the root mean square of (fitted - true) / error, and the median relative error.

    python examples/benchmarks/driven_coverage.py [--runs 300] [--kinds action torque] [--jobs 2] [--file rows.jsonl]

95 % intervals should contain the true value in 90 to 99 % of 300 runs. With ``--file`` an interrupted study continues
where it stopped.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
import warnings
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
from machine import describe

from pendulum_env import sweep
from pendulum_env.lab import DrivenLog, RecordingError, fit_driven
from pendulum_env.physics.damping import parse_settings

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))
from support.driven_truth import drawn, expected, recorded

KINDS = ("action", "torque")
GOAL = (0.90, 0.99)
LEVELS = (0.95, 0.68)
LOGS = 2
"""Number of logs that are fitted together."""


def one(point: Mapping[str, Any]) -> dict[str, Any]:
    """Run one fit; return for each parameter its deviation in errors, its relative error, and the interval tests."""
    kind, seed = point["kind"], point["seed"]
    truth = drawn(seed, kind, **point["fixed"])
    logs = []
    for number in range(LOGS):
        log = recorded(truth, 10_000 * number + seed, kind)
        logs.append(DrivenLog(log["time"], log["angle"], log["drive"], kind, f"log {number}"))
    row: dict[str, Any] = {f"setting {name}": value for name, value in truth.items()}
    begun = time.perf_counter()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            found = fit_driven(logs, **({"mass": truth["mass"]} if kind == "action" else {}))
    except RecordingError as error:
        return {**row, "failed": str(error)}
    row |= {"seconds": time.perf_counter() - begun, "freedom": found.solution.freedom, "lost": len(found.solution.lost)}
    true = expected(truth, kind)
    for name, measured in found.parameters.items():
        row[f"{name} deviation"] = (measured.value - true[name]) / measured.error
        row[f"{name} error"] = measured.error / abs(true[name]) if true[name] else math.nan
        for level in LEVELS:
            low, high = found.interval(name, level)
            row[f"{name} {level:g}"] = bool(low <= true[name] <= high)
    return row


def shares(rows: Sequence[Mapping[str, Any]]) -> list[tuple[str, int, float, float, float, float]]:
    """Return for each parameter: name, runs, coverage of both intervals, rms deviation, median relative error."""
    good = [row for row in rows if not row.get("failed")]
    names = [key.removesuffix(" deviation") for key, value in good[0].items() if key.endswith(" deviation")
             and value is not None] if good else []
    return [(name, len(good), *(float(np.mean([row[f"{name} {level:g}"] for row in good])) for level in LEVELS),
             float(np.sqrt(np.mean([row[f"{name} deviation"] ** 2 for row in good]))),
             float(np.nanmedian([row[f"{name} error"] or math.nan for row in good]))) for name in names]


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description="Measure how often intervals of driven fits contain the true values.")
    parser.add_argument("--runs", type=int, default=300, help="benches of each kind")
    parser.add_argument("--kinds", nargs="+", default=list(KINDS), choices=KINDS, help="kinds of log")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--file", default=None, help="file for results; an interrupted study continues from it")
    parser.add_argument("--fixed", nargs="+", default=[], help="settings to hold fixed, as name=value")
    options = parser.parse_args(arguments)
    print(describe(("numpy", "scipy", "numba")), flush=True)
    fixed = parse_settings(options.fixed)
    points = [{"kind": kind, "seed": seed, "fixed": fixed} for kind in options.kinds for seed in range(options.runs)]
    with ProcessPoolExecutor(options.jobs) if options.jobs > 1 else nullcontext() as executor:
        study = sweep(points, executor, run=one, file=options.file, progress=True)
    outside = 0
    print(f"{'kind':10s}{'parameter':20s}{'runs':>5s}{'95 %':>8s}{'68 %':>8s}{'rms':>8s}{'error':>10s}")
    for kind in options.kinds:
        rows = [row for row in study.rows if row["kind"] == kind]
        for name, count, most, middle, rms, error in shares(rows):
            off = not GOAL[0] <= most <= GOAL[1]
            outside += off
            print(f"{kind:10s}{name:20s}{count:5d}{most:8.1%}{middle:8.1%}{rms:8.3f}{error:10.2g}"
                  f"{'  outside' if off else ''}")
        failed = [row["failed"] for row in rows if row.get("failed")]
        seconds = [row["seconds"] for row in rows if not row.get("failed")]
        print(f"{kind}: {len(failed)} refused{f', the first: {failed[0]}' if failed else ''}; "
              f"{np.median(seconds):.2g} s a fit (median), {np.max(seconds):.2g} s at most")
    print(f"{outside} parameters outside of {GOAL[0]:.0%} to {GOAL[1]:.0%}")


if __name__ == "__main__":
    main()
