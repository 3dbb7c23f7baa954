"""The pendulum at equal accuracy: time per trajectory of this package beside scipy, heyoka, diffrax and MuJoCo.

The same scenes, records and error for all: the largest |angle - truth| over 201 common times, of all trajectories. Each
package runs in a venv (made by a first run, with pip) and a process of its own, all on one and the same processor with
one thread. For each line and accuracy the cheapest setting is found by a ladder of tolerances or steps, refined between
its rungs; then these are timed in turn, warm, and the shortest counts. Settings that would take longer than ``--limit``
are left out. Ours, too, is the best of several methods; the closed form stands apart.

Writes precision.csv, precision.md and precision.png; prints machine, versions, table and goals.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from against import choice, figure, report
from against.choice import Point
from against.own_lines import SEARCH
from against.problem import GAMMA, RECORDS, Problem
from against.truth import truth
from against.worker import CORE, SHORTEST
from machine import describe
from venvs import ONE_THREAD, Worker, python_of

from pendulum_env.common.provenance import output_folder, provenance, write_csv
from pendulum_env.engine.kernels import cache_folder

ONE_CORE = {**ONE_THREAD, "NUMBA_NUM_THREADS": "1"}


class Package(NamedTuple):
    """A package: what its venv holds, the smallest tolerance or longest step [s] of its ladder, its surroundings."""

    pins: tuple[str, ...]
    tolerance: float = 0.0
    step: float = 0.0
    surroundings: tuple[tuple[str, str], ...] = ()


PACKAGES = {
    "own": Package(("lab-pendulum", "numpy", "numba"), 1e-14, 0.34),
    "heyoka": Package(("heyoka==7.13.2", "numpy==2.4.6"), 3e-16),
    "diffrax": Package(
        ("diffrax==0.7.2", "jax==0.10.2", "jaxlib==0.10.2", "numpy==2.4.6"), 1e-15,
        surroundings=(("JAX_PLATFORMS", "cpu"),
                      ("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1")),
    ),
    "scipy": Package(("scipy==1.17.1", "numpy==2.4.6", "numba==0.68.1"), 3e-14),
    "mujoco": Package(("mujoco==4.0.0", "numpy==2.4.6"), step=0.1),
}  # fmt: skip
"""By the name of the file of their lines; the first is this one, in the Python that runs. Pins: Python 3.11 on."""

NEAR, FAR = 1.3, 4.0
"""Of our methods, those are timed that seem to take at most NEAR times the quickest's; what takes FAR is not tried."""
SHORT = (1e-3, 1e-6, 1e-10)
"""Accuracies of the shorter table."""
BUDGET = 1.0
"""A setting is timed again until all its runs took so long [s]."""
WORKER = Path(__file__).parent / "against" / "worker.py"


def started(names: Sequence[str], folder: Path, core: str) -> dict[str, Worker]:
    """The packages' processes."""
    found = {}
    for name in names:
        package = PACKAGES[name]
        own = name == "own"
        python = sys.executable if own else python_of(name, package.pins, folder)
        pins = ("numpy", "numba") if own else package.pins
        surroundings = {**ONE_CORE, **dict(package.surroundings), CORE: core}
        found[name] = Worker(name, python, WORKER, surroundings, " ".join(pins))
    return found


class Panel:
    """One problem, measured."""

    def __init__(self, problem: Problem, workers: dict[str, Worker], folder: Path, limit: float) -> None:
        self.problem, self.workers, self.limit = problem, workers, limit
        file, self.doubt = truth(problem, folder)
        self.truth = str(file)
        self.owner: dict[str, str] = {}

    def points(self, line: str, rivals: Sequence[Point] = ()) -> list[Point]:
        """The points of one line, each measured once; refined where they come near to the rivals', if there are any."""
        name, accuracies = self.owner[line], self.problem.accuracies
        limit = min([self.limit, *(FAR * best.time for best in [choice.cheapest(rivals, min(accuracies))] if best)])
        package, gap = PACKAGES[name], self.problem.duration / RECORDS
        whole = bool(package.step) and not line.endswith(", adaptive")
        rungs: Sequence[float] = [1] if line == report.EXACT else (
            choice.step_counts(gap, package.step) if whole else choice.tolerances(package.tolerance))

        def measure(setting: float) -> Point | None:
            found = self._ask(line, "measure", setting=int(setting) if whole else setting, whole=whole,
                              truth=self.truth, limit=limit)
            return None if found["error"] is None else Point(line, setting, found["error"], found["time"])

        points = choice.climb(measure, rungs, min(accuracies))
        if line == report.EXACT:
            return points
        return choice.refine(points, measure, choice.contested(points, rivals, accuracies, NEAR * NEAR), whole)

    def timed(self, points: Sequence[Point], repeats: int) -> list[Point]:
        """The points with the shortest time of further repeats, taken in turn."""
        best, spent = ({point: point.time for point in points} for _ in range(2))
        for _ in range(repeats):
            for point in points:
                if spent[point] > BUDGET:
                    continue
                runs = max(1, math.ceil(SHORTEST / best[point]))
                whole = point.setting == int(point.setting)
                once = self._ask(point.line, "time", setting=int(point.setting) if whole else point.setting, runs=runs)
                best[point], spent[point] = min(best[point], once), spent[point] + once * runs
        return [point._replace(time=best[point]) for point in points]

    def measured(self, repeats: int) -> list[Point]:
        """The points of all lines that are the cheapest for some accuracy, timed."""
        size = "one" if self.problem.size == 1 else "many"
        for name, worker in self.workers.items():
            self.owner |= {line: name for line, sizes in worker.hello["lines"].items() if size in sizes}
        kept: list[Point] = []
        ours: list[Point] = []
        for line in self.owner:
            if not self._ask(line, "fits", setting=0):
                continue
            if sys.stdout.isatty():
                print(f"  {line:40s}", end="\r", flush=True)
            found = self.points(line, ours if self.owner[line] == "own" else ())
            if line == report.EXACT:
                kept += found
            elif self.owner[line] == "own":
                ours += found
            else:
                kept += choice.chosen(found, self.problem.accuracies)
        return self.timed([*kept, *choice.chosen(ours, self.problem.accuracies, NEAR)], repeats)

    def _ask(self, line: str, what: str, **more: Any) -> Any:
        return self.workers[self.owner[line]].ask(what=what, problem=self.problem, line=line, **more)


COLUMNS = ("scene", "duration_s", "trajectories", "line", "setting", "largest_angle_error_rad",
           "time_per_trajectory_s", "truth_known_to_rad")


def write(
    found: dict[Problem, list[Point]], doubts: dict[Problem, float], said: str, remarks: str, folder: Path
) -> None:
    """The table of all points, the tables for people, and the figure."""
    facts = provenance(Machine=said, Method="the cheapest setting of each line for each accuracy")
    write_csv(folder / "precision.csv", COLUMNS, (
        (*problem, point.line, point.setting, point.error, point.time / problem.size, doubts[problem])
        for problem, points in found.items() for point in points
    ), facts)
    texts = [said, report.table(found), "Three accuracies:", report.table(found, SHORT), remarks]
    (folder / "precision.md").write_text("\n\n".join(texts) + "\n", encoding="utf-8")
    figure.save(found, folder / "precision.png", facts)


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description="Time per trajectory at equal accuracy, beside other packages.")
    parser.add_argument("--out", type=Path, default=Path("precision"), help="folder for table and figure")
    parser.add_argument("--envs", type=Path, default=cache_folder() / "peers", help="folder of the peers' venvs")
    parser.add_argument("--peers", nargs="*", default=list(PACKAGES)[1:], choices=list(PACKAGES)[1:])
    parser.add_argument("--scenes", nargs="+", default=list(GAMMA), choices=list(GAMMA))
    parser.add_argument("--durations", nargs="+", type=float, default=[20.0, 1000.0], help="[s]")
    parser.add_argument("--sizes", nargs="+", type=int, default=[1, 1024], help="trajectories")
    parser.add_argument("--limit", type=float, default=2.5, help="longest run that is tried [s]")
    parser.add_argument("--repeats", type=int, default=7, help="timings of each setting, if they are short")
    parser.add_argument("--quick", action="store_true", help="20 s, few repeats, short runs only: does it all work?")
    parser.add_argument("--search", action="store_true", help="try every explicit method of ours")
    asked = parser.parse_args(arguments)
    if asked.quick:
        asked.durations, asked.limit, asked.repeats = [20.0], 0.2, 2
    if asked.search:
        os.environ[SEARCH] = "1"
    folder = output_folder(asked.out)
    core = str(max(os.sched_getaffinity(0))) if hasattr(os, "sched_getaffinity") else ""
    workers = started(["own", *asked.peers], asked.envs, core)
    found: dict[Problem, list[Point]] = {}
    doubts: dict[Problem, float] = {}
    try:
        packages = {name: number for worker in workers.values() for name, number in worker.hello["versions"].items()
                    if name not in ("numpy", "numba", "jaxlib")}
        said = f"{describe(('numpy', 'numba'))}; {', '.join(f'{name} {number}' for name, number in packages.items())}"
        print(said, flush=True)
        for problem in (Problem(s, d, n) for s in asked.scenes for d in asked.durations for n in asked.sizes):
            panel = Panel(problem, workers, cache_folder() / "precision", asked.limit)
            found[problem], doubts[problem] = panel.measured(asked.repeats), panel.doubt
            print(f"{problem.title}: truth known to {panel.doubt:.1g} rad" + " " * 20)
            print(report.table({problem: found[problem]}), flush=True)
    except KeyboardInterrupt:
        print("interrupted: the panels that are done are written")
    finally:
        for worker in workers.values():
            worker.close()
    if found:
        remarks = "\n\n".join([report.limit_text(asked.limit), report.exact_text(found), *report.verdicts(found)])
        write(found, doubts, said, remarks, folder)
        print(remarks)


if __name__ == "__main__":
    main()
