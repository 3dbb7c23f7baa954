"""What a person waits for: commands, figures, films, frames and first uses, beside the state before a change.

``--against COMMIT`` clones that commit into a temporary folder; then this state and that one run in turn, each in new
processes with caches and byte code of their own. "Cold" rows begin with no compiled programs, all others run once
before they are timed. Every number is a median, every ratio the median of pairs in turn. The goals of times are ratios,
too: those on two cores of a Zen 5 when they were set. ``--rows help,make`` takes some rows alone, ``--cpu`` measures
processor time, for a machine that is not alone (threads need one that is). Run it by hand.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")

import argparse
import shlex
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from machine import describe

ROOT = Path(__file__).resolve().parents[2]
COMPARE = ("compare --scene exercise --damping none --integrators forward_euler,backward_euler,symplectic_euler,"
           "velocity_verlet,rk4 --dt 0.01 --duration 10")
COST = ("cost --scene exercise_large --angle 60 --integrators "
        "forward_euler,symplectic_euler,velocity_verlet,rk4,yoshida6a,kahan_li8,gauss4,dop853,verner9,taylor")
FRAMES, STEPS, LARGE = 60, 100, 65_536
CPU = "FELT_CPU"
"""Environment variable that says to measure processor time."""


def clock() -> float:
    """Return the time of day or, with --cpu, the processor time of this process and of those that it has run [s]."""
    return time.process_time() + sum(os.times()[2:4]) if CPU in os.environ else time.perf_counter()


# --- what a new process measures ---------------------------------------------------------------------------------


def first_step() -> float:
    """Return the time from ``gym.make`` to the first step [s]; both packages are imported before."""
    import gymnasium as gym
    import numpy as np

    import pendulum_env  # noqa: F401

    begun = clock()
    env = gym.make("LabPendulum-v0")
    env.reset(seed=0)
    env.step(np.zeros(1, np.float32))
    return clock() - begun


def first_frame() -> float:
    """Return the time of the first frame of all [s], after one step."""
    env, actions = drawn("LabPendulum-v0")
    env.step(actions[0])
    begun = clock()
    env.render()
    return clock() - begun


def frames(*panels: str) -> float:
    """Return the time of a frame of 500 x 500 pixels with these panels [us], the median of several series."""
    env, actions = drawn("LabPendulum-v0", task="free", render_panels=panels)
    return statistics.median([us_per_frame(env, actions) for _ in range(8)][1:])


def beside_pendulum_v1(*panels: str) -> float:
    """Return how many times as fast as Gymnasium's Pendulum-v1 a frame with these panels is, timed in turn."""
    ours, theirs = drawn("LabPendulum-v0", task="free", render_panels=panels), drawn("Pendulum-v1")
    pairs = [(us_per_frame(*theirs), us_per_frame(*ours)) for _ in range(8)]
    return statistics.median(their / our for their, our in pairs[1:])


def drawn(name: str, **keywords: Any) -> tuple[Any, Any]:
    """Return an environment whose frames are drawn, after a reset, and actions for a series of frames."""
    import gymnasium as gym
    import numpy as np

    import pendulum_env  # noqa: F401

    env = gym.make(name, render_mode="rgb_array", **keywords).unwrapped
    env.reset(seed=0)
    return env, np.random.default_rng(0).uniform(-1, 1, (FRAMES, 1)).astype(np.float32)


def us_per_frame(env: Any, actions: Any) -> float:
    """Return the mean time of ``render()`` [us], each after a step that is not timed."""
    taken = 0.0
    for action in actions:
        env.step(action)
        begun = clock()
        env.render()
        taken += clock() - begun
    return 1e6 * taken / len(actions)


def two_threads(integrator: str, *diagnostics: str) -> float:
    """Return how many times as fast as with one thread 65 536 environments step with two, in turn."""
    import gymnasium as gym
    import numpy as np

    import pendulum_env  # noqa: F401

    actions = np.random.default_rng(0).uniform(-1, 1, (LARGE, 1)).astype(np.float32)
    envs = [gym.make_vec("LabPendulum-v0", LARGE, num_threads=threads, copy=False, integrator=integrator,
                         diagnostics=diagnostics) for threads in (1, 2)]

    def taken(env: Any) -> float:
        begun = clock()
        for _ in range(STEPS):
            env.step(actions)
        return clock() - begun

    for env in envs:
        env.reset(seed=0)
        taken(env)
    pairs = [[taken(env) for env in envs] for _ in range(9)]
    return statistics.median(one / two for one, two in pairs)


# --- the table ---------------------------------------------------------------------------------------------------


class Row(NamedTuple):
    """Line of the table.

    Attributes:
        what: what a person waits for.
        work: the words of a command, which is timed as a whole, or a function, which a new process calls with
            ``arguments`` and which returns the number.
        was, goal: the number when the goal was set, and the goal.
        unit: unit of the numbers; "times" says that more is better.
        cold: begin with an empty cache.
    """

    what: str
    work: str | Callable[..., float]
    was: float
    goal: float
    unit: str = "s"
    cold: bool = False
    arguments: tuple[str, ...] = ()


PANELS = ("apparatus", "energy", "history", "phase", "residual")
ROWS = {
    "help": Row("lab-pendulum --help", "--help", 0.55, 0.3),
    "version": Row("lab-pendulum --version", "--version", 0.38, 0.3),
    "list": Row("lab-pendulum list", "list", 0.55, 0.3),
    "main": Row("the main job: five integrators, four figures as PNG and SVG, a film", f"{COMPARE} --out main",
                7.8, 3.0),
    "main_no_film": Row("the main job without a film", f"{COMPARE} --no-film --out main_no_film", 3.2, 1.5),
    "fit": Row("fit of the packaged recording, all models, figures", "fit --mass 0.01 --radius 0.02 --out fit",
               5.6, 2.0),
    "fit_cold": Row("the fit, cold", "fit --mass 0.01 --radius 0.02 --out fit", 7.7, 3.0, cold=True),
    "exercise": Row("exercise", "exercise --out exercise", 5.1, 2.5),
    "effects": Row("effects", "effects", 2.1, 1.2),
    "effects_cold": Row("effects, cold", "effects", 4.4, 2.5, cold=True),
    "web": Row("web", "web --out lab.html", 2.3, 1.0),
    "cost": Row("cost of ten methods on exercise_large", f"{COST} --out cost", 2.0, 1.0),
    "all_panels": Row("a frame with all five panels, beside Pendulum-v1's", beside_pendulum_v1, 1.7, 5.0, "times",
                      arguments=PANELS),
    "history": Row("a frame of the panel history", frames, 643.0, 150.0, "us", arguments=("history",)),
    "phase": Row("a frame of the panel phase", frames, 518.0, 150.0, "us", arguments=("phase",)),
    "make": Row("gym.make to the first step", first_step, 0.37, 0.25),
    "make_cold": Row("gym.make to the first step, cold", first_step, 0.70, 0.5, cold=True),
    "first_frame": Row("the first frame ever, cold", first_frame, 1.2, 0.4, cold=True),
    "threads_euler": Row("65 536 environments, two threads beside one, symplectic Euler",
                         two_threads, 1.33, 1.8, "times", arguments=("symplectic_euler",)),
    "threads_rk4": Row("65 536 environments, two threads beside one, RK4 with energies",
                       two_threads, 1.60, 1.8, "times", arguments=("rk4", "energy")),
}
"""Rows by their names. That of ``cost`` has no time from before: its goal is half."""


class Tree(NamedTuple):
    """A state of the project, and the folder of what it writes and keeps."""

    root: Path
    folder: Path

    def measure(self, row: Row, cache: Path) -> float:
        """Return the number of a row, from a new process."""
        environment = {**os.environ, "PYTHONPATH": str(self.root), "LAB_PENDULUM_CACHE": str(cache),
                       "PYTHONPYCACHEPREFIX": str(self.folder / "bytecode"), "PYTHONDONTWRITEBYTECODE": ""}
        if isinstance(row.work, str):
            words = ["-m", "pendulum_env", *shlex.split(row.work)]
        else:
            words = [__file__, "--measure", row.work.__name__, *row.arguments]
        begun = clock()
        done = subprocess.run([sys.executable, *words], cwd=self.folder, env=environment, capture_output=True,
                              text=True)
        taken = clock() - begun
        if done.returncode:
            raise SystemExit(f"In {self.root}, {shlex.join(words)} failed:\n{done.stderr}")
        return taken if isinstance(row.work, str) else float(done.stdout)

    def number(self, row: Row) -> float:
        """Return the number of a row with this state's own cache or, if the row is cold, with an empty one."""
        if not row.cold:
            return self.measure(row, self.folder / "cache")
        with TemporaryDirectory(dir=self.folder) as cache:
            return self.measure(row, Path(cache))


def clone(commit: str, folder: Path) -> Path:
    """Return the folder of a clone of this project at a commit."""
    place = folder / "project"
    subprocess.run(["git", "clone", "--quiet", "--no-checkout", str(ROOT), str(place)], check=True)
    named = subprocess.run(["git", "rev-parse", "--verify", f"{commit}^{{commit}}"], cwd=ROOT, check=True,
                           capture_output=True, text=True).stdout.strip()
    subprocess.run(["git", "checkout", "--quiet", "--detach", named], cwd=place, check=True)
    return place


def line(row: Row, trees: list[Tree], repeats: int) -> str:
    """Measure all states of the project in turn, and return the line of a row."""
    for tree in trees:  # writes byte code and, unless the row is cold, fills the cache
        tree.number(row)
    pairs = [[tree.number(row) for tree in trees] for _ in range(repeats)]
    medians = [statistics.median(found) for found in zip(*pairs, strict=True)]
    shown = " | ".join(f"{median:.3g} {row.unit}" for median in medians)
    if len(trees) == 1:
        return f"| {row.what} | {shown} | {row.was:g} | {row.goal:g} {row.unit} |"
    ratio, share = statistics.median(now / before for before, now in pairs), row.goal / row.was
    met, goal = ((medians[1] >= row.goal, f"{row.goal:g} times") if row.unit == "times" else
                 (ratio <= share, f"{share:.2f} of the time"))
    return f"| {row.what} | {shown} | {ratio:.2f} | {goal}: {'met' if met else 'MISSED'} |"


def main() -> None:
    parser = argparse.ArgumentParser(description="Time what a person waits for.")
    parser.add_argument("--against", metavar="COMMIT", help="commit to compare with; without it, this state alone")
    parser.add_argument("--rows", default=",".join(ROWS), help=f"rows to measure, of {', '.join(ROWS)}; default all")
    parser.add_argument("--cpu", action="store_true", help="measure processor time: on a machine that is not alone")
    parser.add_argument("--repeats", type=int, default=5, help="number of pairs of each row")
    parser.add_argument("--measure", nargs="+", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.measure:
        name, *arguments = options.measure
        print(globals()[name](*arguments))
        return
    if options.cpu:
        os.environ[CPU] = "1"
    names = options.rows.split(",")
    if unknown := [name for name in names if name not in ROWS]:
        parser.error(f"no row {unknown[0]!r}; there are {', '.join(ROWS)}")
    with TemporaryDirectory() as here, TemporaryDirectory() as there:
        trees = [Tree(ROOT, Path(here))]
        if options.against:
            trees.insert(0, Tree(clone(options.against, Path(there)), Path(there)))
        print(describe())
        heads = ("before", "now", "ratio", "goal") if options.against else ("now", "when the goal was set", "goal")
        print(f"| what a person waits for | {' | '.join(heads)} |\n| --- |{' --- |' * len(heads)}")
        for name in names:
            print(line(ROWS[name], trees, options.repeats), flush=True)


if __name__ == "__main__":
    main()
