"""Time per trajectory at equal accuracy: this package compared with scipy, heyoka, diffrax and MuJoCo.

All packages solve the same problems; the error is the largest |angle - truth| over 201 common times and all
trajectories. In the scene "mixed" these start from 1 to 179 degrees. Each package runs in its own venv (created by the
first run, with pip) and process, all on one processor core with one thread. For each solver and accuracy, a series of
tolerances or steps, refined by interpolation, gives the cheapest setting; these settings are then timed in turn, warm,
and the shortest time counts. Settings that would take longer than ``--limit`` are left out. This package is represented
by the best of several methods; the closed form is shown separately.

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
from against.problem import GAMMA, MIXED, RECORDS, Problem
from against.truth import truth
from against.worker import CORE, SHORTEST
from machine import describe
from venvs import ONE_THREAD, Worker, python_of

from pendulum_env.common.provenance import output_folder, provenance, write_csv
from pendulum_env.engine.kernels import cache_folder

ONE_CORE = {**ONE_THREAD, "NUMBA_NUM_THREADS": "1"}


class Package(NamedTuple):
    """Package to measure: contents of its venv, smallest tolerance or longest step [s], and environment variables."""

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
"""Packages by the name of their solver file; the first one is this package, in the running Python (3.11 or later)."""

NEAR, FAR = 1.3, 4.0
"""Methods of this package are timed if they take at most NEAR times the shortest, and left out beyond FAR times."""
SHORT = (1e-3, 1e-6, 1e-10)
"""Accuracies in the shorter table."""
BUDGET = 1.0
"""Total time of the runs of one setting [s] after which it is not timed again."""
WORKER = Path(__file__).parent / "against" / "worker.py"


def started(names: Sequence[str], folder: Path, core: str) -> dict[str, Worker]:
    """Start the worker process of each package."""
    workers = {}
    for name in names:
        package = PACKAGES[name]
        own = name == "own"
        python = sys.executable if own else python_of(name, package.pins, folder)
        pins = ("numpy", "numba") if own else package.pins
        surroundings = {**ONE_CORE, **dict(package.surroundings), CORE: core}
        workers[name] = Worker(name, python, WORKER, surroundings, " ".join(pins))
    return workers


class Panel:
    """Measurements of all packages on one problem."""

    def __init__(self, problem: Problem, workers: dict[str, Worker], folder: Path, limit: float) -> None:
        self.problem, self.workers, self.limit = problem, workers, limit
        file, self.doubt = truth(problem, folder)
        self.truth = str(file)
        self.owner: dict[str, str] = {}

    def points(self, line: str, rivals: Sequence[Point] = ()) -> list[Point]:
        """Measure the settings of one solver once each; refine them where they are nearly as fast as the rivals."""
        name, accuracies = self.owner[line], self.problem.accuracies
        limit = min([self.limit, *(FAR * best.time for best in [choice.cheapest(rivals, min(accuracies))] if best)])
        package, gap = PACKAGES[name], self.problem.duration / RECORDS
        whole = bool(package.step) and not line.endswith((report.ADAPTIVE, report.EVEN))
        rungs: Sequence[float] = [1] if line == report.EXACT else (
            choice.step_counts(gap, package.step) if whole else choice.tolerances(package.tolerance))

        def measure(setting: float) -> Point | None:
            answer = self._ask(line, "measure", setting=int(setting) if whole else setting, whole=whole,
                               truth=self.truth, limit=limit)
            return None if answer["error"] is None else Point(line, setting, answer["error"], answer["time"])

        points = choice.climb(measure, rungs, min(accuracies))
        if line == report.EXACT:
            return points
        return choice.refine(points, measure, choice.contested(points, rivals, accuracies, NEAR * NEAR), whole)

    def timed(self, points: Sequence[Point], repeats: int) -> list[Point]:
        """Time the points again in turn and return them with their shortest time."""
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
        """Measure all solvers and return the points that are the cheapest for some accuracy, timed."""
        size = "one" if self.problem.size == 1 else "many"
        for name, worker in self.workers.items():
            self.owner |= {line: name for line, sizes in worker.hello["lines"].items() if size in sizes}
        best: list[Point] = []
        ours: list[Point] = []
        for line in self.owner:
            if not self._ask(line, "fits", setting=0):
                continue
            if sys.stdout.isatty():
                print(f"  {line:40s}", end="\r", flush=True)
            own_steps = self.problem.scene == MIXED and line.endswith(report.ADAPTIVE)
            points = self.points(line, ours if self.owner[line] == "own" and not own_steps else ())
            if line == report.EXACT:
                best += points
            elif own_steps:
                best += choice.chosen(points, self.problem.accuracies)
            elif self.owner[line] == "own":
                ours += points
            else:
                best += choice.chosen(points, self.problem.accuracies)
        return self.timed([*best, *choice.chosen(ours, self.problem.accuracies, NEAR)], repeats)

    def _ask(self, line: str, what: str, **more: Any) -> Any:
        return self.workers[self.owner[line]].ask(what=what, problem=self.problem, line=line, **more)


COLUMNS = ("scene", "duration_s", "trajectories", "line", "setting", "largest_angle_error_rad",
           "time_per_trajectory_s", "truth_known_to_rad")


def write(
    results: dict[Problem, list[Point]], doubts: dict[Problem, float], machine: str, remarks: str, folder: Path
) -> None:
    """Write all points as CSV, the tables as Markdown, and the figure."""
    facts = provenance(Machine=machine, Method="the cheapest setting of each line for each accuracy")
    write_csv(folder / "precision.csv", COLUMNS, (
        (*problem, point.line, point.setting, point.error, point.time / problem.size, doubts[problem])
        for problem, points in results.items() for point in points
    ), facts)
    texts = [machine, report.table(results), "Three accuracies:", report.table(results, SHORT), remarks]
    (folder / "precision.md").write_text("\n\n".join(texts) + "\n", encoding="utf-8")
    figure.save(results, folder / "precision.png", facts)


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description="Compare time per trajectory at equal accuracy with other packages.")
    parser.add_argument("--out", type=Path, default=Path("precision"), help="folder for table and figure")
    parser.add_argument("--envs", type=Path, default=cache_folder() / "peers", help="folder of the peers' venvs")
    parser.add_argument("--peers", nargs="*", default=list(PACKAGES)[1:], choices=list(PACKAGES)[1:])
    parser.add_argument("--scenes", nargs="+", default=list(GAMMA), choices=list(GAMMA))
    parser.add_argument("--durations", nargs="+", type=float, default=[20.0, 1000.0], help="[s]")
    parser.add_argument("--sizes", nargs="+", type=int, default=[1, 1024], help="trajectories")
    parser.add_argument("--limit", type=float, default=2.5, help="longest run that is tried [s]")
    parser.add_argument("--repeats", type=int, default=7, help="timings of each setting, if they are fast")
    parser.add_argument("--quick", action="store_true",
                        help="only 20 s, few repeats and short runs, to check that everything works")
    parser.add_argument("--search", action="store_true", help="try every explicit method of this package")
    options = parser.parse_args(arguments)
    if options.quick:
        options.durations, options.limit, options.repeats = [20.0], 0.2, 2
    if options.search:
        os.environ[SEARCH] = "1"
    folder = output_folder(options.out)
    core = str(max(os.sched_getaffinity(0))) if hasattr(os, "sched_getaffinity") else ""
    workers = started(["own", *options.peers], options.envs, core)
    results: dict[Problem, list[Point]] = {}
    doubts: dict[Problem, float] = {}
    try:
        packages = {name: number for worker in workers.values() for name, number in worker.hello["versions"].items()
                    if name not in ("numpy", "numba", "jaxlib")}
        installed = ", ".join(f"{name} {number}" for name, number in packages.items())
        machine = f"{describe(('numpy', 'numba'))}; {installed}"
        print(machine, flush=True)
        for problem in (Problem(s, d, n) for s in options.scenes for d in options.durations for n in options.sizes):
            panel = Panel(problem, workers, cache_folder() / "precision", options.limit)
            results[problem], doubts[problem] = panel.measured(options.repeats), panel.doubt
            print(f"{problem.title}: reference solution known to {panel.doubt:.1g} rad" + " " * 20)
            print(report.table({problem: results[problem]}), flush=True)
    except KeyboardInterrupt:
        print("interrupted; the finished problems are written")
    finally:
        for worker in workers.values():
            worker.close()
    if results:
        remarks = "\n\n".join(filter(None, [report.limit_text(options.limit), report.exact_text(results),
                                            report.own_steps_text(results), *report.verdicts(results)]))
        write(results, doubts, machine, remarks, folder)
        print(remarks)


if __name__ == "__main__":
    main()
