"""Time of `import pendulum_env` compared with `import gymnasium`, in new interpreters in turn, as a ratio of medians.

Goal: at most 1.3.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import time

from machine import describe

REPEATS = 15


def seconds(statement: str) -> float:
    """Return the wall time of a new interpreter that runs one statement [s]."""
    begun = time.perf_counter()
    subprocess.run([sys.executable, "-c", statement], check=True)
    return time.perf_counter() - begun


def main() -> None:
    print(describe())
    statements = ("pass", "import gymnasium", "import pendulum_env")
    times: dict[str, list[float]] = {statement: [] for statement in statements}
    for statement in statements:
        seconds(statement)
    for _ in range(REPEATS):
        for statement in statements:
            times[statement].append(seconds(statement))
    base = statistics.median(times["pass"])
    for statement in statements[1:]:
        cost = statistics.median(times[statement]) - base
        print(f"{statement:22s} {1e3 * cost:6.0f} ms beyond a bare interpreter")
    pairs = zip(times["import pendulum_env"], times["import gymnasium"], strict=True)
    ratio = statistics.median((ours - base) / (theirs - base) for ours, theirs in pairs)
    print(f"ratio {ratio:.2f} (goal: at most 1.3)")


if __name__ == "__main__":
    main()
