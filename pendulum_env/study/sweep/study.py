"""Sweeps over a grid of parameters, in one process, in several or on a cluster, with a file to continue from."""

from __future__ import annotations

import hashlib
import math
import pickle
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from itertools import islice, product
from pathlib import Path
from queue import Empty, SimpleQueue
from time import perf_counter
from typing import Any

from pendulum_env.common.progress import Progress, telling_of
from pendulum_env.common.provenance import output_folder, provenance, write_csv
from pendulum_env.common.shown import Displayed, one_line
from pendulum_env.common.tables import Table
from pendulum_env.physics.units import SceneError, boolean, file_path, function, several, shown, whole_number
from pendulum_env.study.sweep.journal import Journal, WrittenResults, plain, text_of
from pendulum_env.study.sweep.summary import UNITS, summary
from pendulum_env.truth.reference import StudyError

Point = dict[str, Any]
Run = Callable[[Point], Mapping[str, Any]]

Source = Generator[tuple[int, Callable[[], Any]], None, None]
"""Generator of pairs: the number of a point, and a function that returns its result."""

SAME = ("Software", "Run", "Shared", "Points", "Fingerprint")
"""Facts that a journal must share with the sweep that continues it."""
PATIENCE = 0.5
"""Longest uninterrupted wait for a result [s], so that Ctrl-C is noticed on every system."""
TASK, LEAST = 0.5, 0.05
"""Longest and shortest duration of a task of an executor [s] for which short points are put together.

A cluster's scheduler hands over some 400 tasks a second (``examples/benchmarks/cluster.py``).
"""


@dataclass(frozen=True, repr=False)
class Sweep(Displayed):
    """Results of a sweep, with the combination of parameters (the point) that each belongs to.

    Attributes:
        points: combinations of parameters, dicts of keywords, in the order of the grid.
        results: result of each point, in the order of the points; None where an interrupted sweep has none. With
            ``in_memory=False`` each is read from the file when it is asked for.
        shared: keywords that all runs share.
        facts: origin of the results, written into the head of output files.
        complete: False if the sweep was interrupted.
    """

    points: tuple[Point, ...]
    results: Sequence[Point | None]
    shared: Point
    facts: Mapping[str, str]
    complete: bool = True

    def __repr__(self) -> str:
        return one_line(self, f"{sum(result is not None for result in self.results)} of {len(self.points)} points, "
                        f"columns {', '.join(self.columns)}")

    def __iter__(self) -> Iterator[Point]:
        """Yield finished runs in the order of the grid, each as one dict of its parameters and its results."""
        for point, result in zip(self.points, self.results, strict=True):
            if result is not None:
                yield {**point, **result}

    @property
    def rows(self) -> tuple[Point, ...]:
        """Finished runs in the order of the grid, each as one dict of its parameters and its results."""
        return tuple(self)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns of the result table: first the parameters, then the results."""
        names: dict[str, None] = {}
        for part in (self.points, self.results):
            names.update(dict.fromkeys(name for values in part for name in values or ()))
        return tuple(names)

    def column(self, name: str) -> list[Any]:
        """Return one parameter or result of all finished runs as a list; None for a run without such a value.

        Raises StudyError for a name that is neither a parameter nor a result.
        """
        if not isinstance(name, str) or name not in self.columns:
            raise StudyError(f"There is no column {shown(name)}; the columns are {', '.join(self.columns)}.")
        return [row.get(name) for row in self]

    @property
    def table(self) -> Table:
        """Table of the parameters and results of all finished runs as text, with numbers to six digits."""
        columns = self.columns
        return Table(columns, tuple(tuple(map(_cell, self._cells(row, columns))) for row in self))

    def write(self, path: str | Path) -> Path:
        """Write parameters and results of all finished runs as a CSV file; raises OutputError on failure."""
        place = file_path(path, "path")
        output_folder(place.parent)
        facts, columns = {**self.facts, "Complete": text_of(self.complete)}, self.columns
        write_csv(place, columns, (self._cells(row, columns) for row in self), facts)
        return place

    @staticmethod
    def _cells(row: Point, columns: Sequence[str]) -> list[Any]:
        values = [row.get(name, "") for name in columns]
        return [text_of(value) if isinstance(value, (dict, list)) else value for value in values]


def _cell(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def sweep(
    grid: Mapping[str, Iterable[Any]] | Iterable[Mapping[str, Any]],
    executor: Executor | None = None,
    *,
    run: Run | None = None,
    file: str | Path | None = None,
    progress: Progress | bool | None = None,
    on_row: Callable[[Point, Point], None] | None = None,
    work: Callable[[Point], float] | None = None,
    in_flight: int = 256,
    per_task: int | None = None,
    name: str = "",
    anew: bool = False,
    in_memory: bool = True,
    **shared: Any,
) -> Sweep:
    """Run a function for every point (combination of values) of a grid of parameters and return all results.

    Args:
        grid: dict of keyword -> list of values, of which all combinations are run, the last keyword changing fastest;
            or a list of points, each a dict of keywords, without repetition. Values are JSON's types or scenes.
        executor: executor of the runs: None for this process, a ``ProcessPoolExecutor``, Dask's
            ``Client.get_executor()`` or any other of ``concurrent.futures``. It is not shut down.
        run: function from a point (a dict) to a dict of numbers and texts; for an executor with other processes it
            must be importable from a module. By default :func:`pendulum_env.study.sweep.summary.summary`, which takes
            keywords of ``rollout`` and returns numbers that describe the run.
        file: journal to which each result is written as soon as it is known, one JSON line each, after a first line
            that describes the sweep. If the file exists, the sweep continues it: points in it are not run again.
        progress: True shows a progress bar, False none; by default a notebook shows one for work over 1.5 s. A
            function is called with the fraction done and the present activity.
        on_row: called with each point that is run now and its result.
        work: function that estimates the work of a point, for the fraction done; by default all points are equal.
        in_flight: largest number of tasks submitted to the executor at a time.
        per_task: number of points in a task of the executor, which are lost with it where a process dies. By default
            one, or of short points as many as take 0.05 to 0.5 s: a share 1/in_flight of those that are left, so that
            all processes end at the same time (guided self-scheduling; Polychronopoulos & Kuck 1987, IEEE Trans.
            Comput. C-36, 1425).
        name: name of ``run`` in the file, by default its own with the arguments that ``functools.partial`` bound. A
            change of its code, or of variables that it closes over, is not noticed.
        anew: True empties the file first, even if it belongs to another sweep.
        in_memory: False keeps no result in memory once it is in the file, for results larger than memory; the sweep's
            ``results`` are then read from the file when they are asked for, and iterating over the sweep yields its
            rows one by one.
        **shared: keywords that all points share, such as ``scene="lab"``.

    Returns a :class:`Sweep` in the grid's order. KeyboardInterrupt ends the sweep early: finished results are returned,
    and ``complete`` is False.

    Raises StudyError for an invalid grid, a file of another sweep (left unchanged), a point that fails, or an executor
    that breaks down; results finished before are in the file. Raises OutputError for a file that cannot be written.
    """
    for keyword, given in (("run", run), ("on_row", on_row), ("work", work)):
        if given is not None:
            function(given, keyword)
    if not (executor is None or isinstance(executor, Executor)):
        raise SceneError(f"executor must be an Executor of concurrent.futures or None, not {shown(executor)}.")
    if not isinstance(name, str):
        raise SceneError(f"name must be text, not {shown(name)}.")
    reporting, empty, kept = telling_of(progress, "sweep"), boolean(anew, "anew"), boolean(in_memory, "in_memory")
    if not kept and file is None:
        raise StudyError("A sweep with in_memory=False has its results in a file; give one, such as file='a.jsonl'.")
    called = summary if run is None else run
    points, common = points_of(grid, shared), plain(shared, "A keyword")
    whole_number(in_flight, "in_flight")
    if per_task is not None:
        whole_number(per_task, "per_task")
    keys = keys_of(points)
    prints = hashlib.sha256("\n".join([text_of(common, sort=True), *sorted(keys)]).encode()).hexdigest()
    known_as = name or _name(called, file is not None)
    facts = provenance(Run=known_as, Points=str(len(points)), Shared=text_of(common, sort=True),
                       Fingerprint=prints[:32], **({"Units": UNITS} if called is summary else {}))
    journal = None if file is None else Journal(file, facts, SAME, empty, kept)
    results: list[Any] = [None if journal is None else journal.done.get(key) for key in keys]
    weights = [1.0 if work is None else work(point) for point in points]

    def keep(i: int, returned: Any) -> None:
        if results[i] is None:
            result = _checked(returned, points[i])
            results[i] = result if journal is None else journal.add(points[i], result)
            if on_row is not None:
                on_row(points[i], result)

    try:
        with reporting as tell:
            _run_missing(points, common, called, executor, results, weights, keep, tell, in_flight, per_task)
    finally:
        if journal is not None:
            journal.close()
    found = WrittenResults(journal, points, results) if journal is not None and not kept else tuple(results)
    return Sweep(tuple(points), found, common, facts, None not in results)


def _run_missing(
    points: list[Point], common: Point, run: Run, executor: Executor | None, results: list[Any],
    weights: list[float], keep: Callable[[int, Any], None], tell: Progress, in_flight: int,
    per_task: int | None,
) -> None:
    """Run all combinations of parameters that have no result yet, and store their results.

    On a KeyboardInterrupt the function stores the finished results and returns without an error.
    """
    total, waiting = sum(weights) or 1.0, dict[Future[Any], list[int]]()
    todo = [i for i, result in enumerate(results) if result is None]
    done = sum(weights) - sum(weights[i] for i in todo)
    tasks = ((i, {**common, **points[i]}) for i in todo)
    source = _here(run, tasks) if executor is None else _elsewhere(
        executor, run, tasks, len(todo), waiting, in_flight, per_task)
    try:
        with closing(source):
            for i, ask in source:
                tell(min(done / total, 1.0 - 1e-9), ", ".join(f"{name} {_cell(x)}" for name, x in points[i].items()))
                keep(i, _result_of(ask, points[i], i, len(points)))
                done += weights[i]
        tell(1.0, "done")
    except (KeyboardInterrupt, StudyError, BrokenExecutor) as end:
        for future, places in waiting.items():
            if future.done() and not future.cancelled() and future.exception() is None:
                for i, result in zip(places, future.result()[0], strict=False):  # shorter if one of them failed
                    keep(i, result)
        if isinstance(end, KeyboardInterrupt):
            return
        if isinstance(end, StudyError):
            raise
        known = sum(result is not None for result in results)
        raise StudyError(
            f"The executor broke down with {known} of {len(points)} points finished, perhaps because a process was "
            f"killed or out of memory ({end}); with a file, repeat the sweep with a new executor to continue it."
        ) from end


def _here(run: Run, tasks: Iterator[tuple[int, Point]]) -> Source:
    for i, arguments in tasks:
        yield i, partial(run, arguments)


def _elsewhere(
    executor: Executor, run: Run, tasks: Iterator[tuple[int, Point]], left: int, waiting: dict[Future[Any], list[int]],
    most: int, per_task: int | None,
) -> Source:
    """Run the points of a sweep in an executor, and yield them in the order in which they finish.

    Each of ``tasks``, of which ``left`` are left, is a pair of a point's index and the arguments of ``run``.
    ``waiting`` holds what is submitted, at most ``most`` at a time; what is left over at the end is cancelled.
    """
    finished: SimpleQueue[Future[Any]] = SimpleQueue()
    taken, seconds = 0, math.inf
    try:
        while True:
            while left and len(waiting) < most:
                rate = taken / seconds
                short = max(1, int(LEAST * rate), min(left // most, int(TASK * rate)))
                some = list(islice(tasks, short if per_task is None else per_task))
                left -= len(some)
                future = executor.submit(_several, run, [arguments for _, arguments in some])
                waiting[future] = [i for i, _ in some]
                future.add_done_callback(finished.put)
            if not waiting:
                return
            future = _next(finished)
            places, outcome = waiting[future], _outcome(future)
            if outcome is None:
                yield places[0], future.result
            else:
                results, failure, spent = outcome
                taken, seconds = taken + len(results), max(spent, 1e-9) + (seconds if taken else 0.0)
                for i, result in zip(places, results, strict=False):
                    yield i, partial(_returned, result)
                if failure is not None:
                    yield places[len(results)], partial(_raised, failure)
            del waiting[future]
    finally:
        for future in waiting:
            future.cancel()


def _several(run: Run, points: Sequence[Point]) -> tuple[list[Any], Exception | None, float]:
    """Run several points in an executor; return their results, the exception that ended them, and the time [s]."""
    results: list[Any] = []
    begun = perf_counter()
    for point in points:
        try:
            results.append(run(point))
        except Exception as failure:
            return results, _sendable(failure), perf_counter() - begun
    return results, None, perf_counter() - begun


def _sendable(failure: Exception) -> Exception:
    """Return an exception that can be sent to another process: itself, or one with its name and its message."""
    try:
        pickle.loads(pickle.dumps(failure))
    except Exception:
        return RuntimeError(f"{type(failure).__name__}: {failure}")
    return failure


def _outcome(future: Future[Any]) -> tuple[list[Any], Exception | None, float] | None:
    """Return what :func:`_several` returned, None if the task itself failed or was cancelled."""
    failed = future.cancelled() or future.exception() is not None
    return None if failed else future.result()


def _returned(result: Any) -> Any:
    return result


def _raised(failure: Exception) -> Any:
    raise failure


def _next(finished: SimpleQueue[Future[Any]]) -> Future[Any]:
    while True:
        try:
            return finished.get(timeout=PATIENCE)
        except Empty:
            continue


def _result_of(ask: Callable[[], Any], point: Point, i: int, count: int) -> Any:
    """Return the result of one task of a sweep, by calling ``ask``.

    If the task failed or was cancelled, StudyError is raised, with the combination of parameters in its message.
    """
    try:
        return ask()
    except BrokenExecutor:
        raise
    except CancelledError as error:
        raise StudyError(
            f"The executor cancelled point {i + 1} of {count}, {shown(point)}; repeat the sweep with another executor."
        ) from error
    except Exception as error:
        raise StudyError(
            f"Point {i + 1} of {count}, {shown(point)}, failed with {type(error).__name__}: {error}"
        ) from error


def _checked(returned: Any, point: Point) -> Point:
    if not isinstance(returned, Mapping):
        raise StudyError(f"run must return a dict of numbers, not {shown(returned)}.")
    for name in returned:
        if name in point:
            raise StudyError(f"run returns {shown(name)}, which is also a keyword of the points; rename one of them.")
    result: Point = plain(returned, "The result of run")
    return result


def _name(run: Run, kept: bool) -> str:
    """Return the name of a sweep's function with its module, such as "package.module.name".

    For a journal (``kept``) the arguments bound by ``functools.partial`` are appended. Raises StudyError for a lambda
    in a journal, because its name does not identify it.
    """
    inner: Any = run.func if isinstance(run, partial) else run
    name = f"{inner.__module__}.{getattr(inner, '__qualname__', type(inner).__qualname__)}"
    if kept and name.endswith("<lambda>"):
        raise StudyError(
            "A sweep with a journal file needs a named function as run, not a lambda; use def, or give name=."
        )
    if not isinstance(run, partial) or not kept:
        return name
    bound = [plain(list(run.args), "An argument of run"), plain(run.keywords, "An argument of run")]
    return f"{name} {text_of(bound, sort=True)}"


# --- the points ------------------------------------------------------------------------------------------------------


def points_of(grid: Any, shared: Mapping[str, Any]) -> list[Point]:
    """Return all combinations of parameter values in a grid, as dicts; StudyError for an invalid or empty grid."""
    if isinstance(grid, Mapping):
        for name, values in grid.items():
            try:
                several(values, f"The grid's {name!r}", "values")
            except SceneError as error:
                raise StudyError(str(error)) from None
        points: list[Any] = [dict(zip(grid, values, strict=True)) for values in product(*grid.values())]
    else:
        try:
            points = [*several(grid, "grid", "points")]
        except SceneError:
            points = [grid]
    if not points or points == [{}]:
        raise StudyError("The grid has no points; a sweep needs at least one.")
    for point in points:
        if not isinstance(point, Mapping):
            raise StudyError(f"A grid is a dict of lists or a list of keyword dicts, and cannot hold {shown(point)}.")
        for name in point:
            if name in shared:
                raise StudyError(f"{name} is given as a keyword of all points and also in the grid; give it only once.")
    return [plain(point, "A point") for point in points]


def keys_of(points: list[Point]) -> list[str]:
    """Return a JSON text that identifies each combination of parameters; raises StudyError if two are equal."""
    seen: dict[str, int] = {}
    for i, point in enumerate(points):
        other = seen.setdefault(text_of(point, sort=True), i)
        if other != i:
            raise StudyError(f"Points {other + 1} and {i + 1} are equal, {shown(point)}; remove one of them.")
    return list(seen)
