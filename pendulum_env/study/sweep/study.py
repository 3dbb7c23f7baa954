"""Sweeps over a grid of parameters, in one process, in several or on a cluster, with a file to continue from."""

from __future__ import annotations

import hashlib
import json
import math
import pickle
import platform
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from itertools import islice, product
from pathlib import Path
from queue import Empty, SimpleQueue
from time import perf_counter
from typing import Any

from pendulum_env.common.progress import Progress, telling_of
from pendulum_env.common.provenance import output_folder, provenance, write_csv
from pendulum_env.common.results import Columns, Result, columns_of, one_line
from pendulum_env.common.texts import Table, clean
from pendulum_env.common.version import sources
from pendulum_env.physics.units import SceneError, boolean, file_path, function, one_of, several, shown, whole_number
from pendulum_env.study.sweep.journal import Journal, WrittenResults, plain, text_of
from pendulum_env.study.sweep.summary import SUMMARY, UNITS, summary
from pendulum_env.truth.reference import StudyError

Point = dict[str, Any]
Run = Callable[[Point], Mapping[str, Any]]

Source = Generator[tuple[int, Callable[[], Any]], None, None]
"""Generator of pairs: the number of a point, and a function that returns its result, or the Exception of its run."""

SAME = ("Sources", "Run", "Shared", "Points", "Fingerprint")
"""Facts that a journal must share with the sweep that continues it."""
ON_ERROR = ("raise", "record")
ERROR = "error"
"""Column of the reasons of points that failed."""
PATIENCE = 0.5
"""Longest uninterrupted wait for a result [s], so that Ctrl-C is noticed on every system."""
TASK, LEAST = 0.5, 0.05
"""Longest and shortest duration of a task of an executor [s] for which short points are put together.

A cluster's scheduler hands over some 400 tasks a second (``examples/benchmarks/cluster.py``).
"""


@dataclass(frozen=True, repr=False)
class Sweep(Result):
    """Results of a sweep, with the combination of parameters (the point) that each belongs to.

    Attributes:
        points: combinations of parameters, dicts of keywords, in the order of the grid.
        results: result of each point, in the order of the points; None where the point failed, or an interrupted sweep
            has none. With ``in_memory=False`` each is read from the file when it is asked for.
        shared: keywords that all runs share.
        facts: origin of the results, written into the head of output files.
        complete: False if the sweep was interrupted.
        failed: reason of each point that failed, by its index, with ``on_error="record"``. In rows, tables and files it
            is the column "error".
    """

    points: tuple[Point, ...]
    results: Sequence[Point | None]
    shared: Point
    facts: Mapping[str, str]
    complete: bool = True
    failed: Mapping[int, str] = field(default_factory=dict)

    def __repr__(self) -> str:
        finished = sum(result is not None for result in self.results)
        failed = f" ({len(self.failed)} failed)" if self.failed else ""
        return one_line(self, f"{finished} of {len(self.points)} points{failed}, columns {', '.join(self.columns)}")

    def __iter__(self) -> Iterator[Point]:
        """Yield finished runs in the order of the grid, each as one dict of its parameters and its results, or of its
        parameters and the reason why it failed.
        """
        for i, (point, result) in enumerate(zip(self.points, self.results, strict=True)):
            if i in self.failed:
                yield {**point, ERROR: self.failed[i]}
            elif result is not None:
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
        return (*names, ERROR) if self.failed else tuple(names)

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

    @property
    def stem(self) -> str:
        """Name of the file of the table, without ending."""
        return "sweep"

    def units(self) -> Mapping[str, str]:
        """Return the units of the columns that are known: those of a summary of runs, and those of a saved Study."""
        given = self.facts.get("Units", "{}")
        return SUMMARY if given == UNITS else json.loads(given)

    def origin(self) -> Mapping[str, str]:
        """Return what the runs have in common, and what computed them."""
        return {**self.facts, "Complete": text_of(self.complete)}

    def tables(self) -> Mapping[str, Columns]:
        """Return the table of the parameters and results of all finished runs."""
        names, units = self.columns, self.units()
        return {self.stem: columns_of({name: units.get(name, "") for name in names},
                                      (self._cells(row, names) for row in self))}

    def grid(self) -> Sequence[str]:
        """Return the parameters that differ between the points."""
        first = self.points[0]
        return [name for name in first if any(point.get(name) != first[name] for point in self.points)]

    def write(self, path: str | Path) -> Path:
        """Write parameters and results of all finished runs as a CSV file; raises OutputError on failure."""
        place, columns = file_path(path, "path"), self.columns
        output_folder(place.parent)
        write_csv(place, columns, (self._cells(row, columns) for row in self), self.origin())
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
    on_error: str = "raise",
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
            change of its code, or of variables that it closes over, is not noticed; one of this package's code is:
            the file of other sources is refused.
        anew: True empties the file first, even if it belongs to another sweep.
        in_memory: False keeps no result in memory once it is in the file, for results larger than memory; the sweep's
            ``results`` are then read from the file when they are asked for, and iterating over the sweep yields its
            rows one by one.
        on_error: what becomes of a point for which ``run`` raises an exception; the others are run in any case. "raise"
            raises StudyError at the end, and a sweep that continues the file tries the point again. "record" keeps the
            reason as the point's ``error``, in the file too.
        **shared: keywords that all points share, such as ``scene="lab"``.

    Returns a :class:`Sweep` in the grid's order. KeyboardInterrupt ends the sweep early: finished results are returned,
    and ``complete`` is False.

    Raises StudyError for an invalid grid, a file of another sweep or of other sources (left unchanged), points that
    failed, or an executor that breaks down; finished results are in the file. Raises OutputError for a file that cannot
    be written.
    """
    for keyword, given in (("run", run), ("on_row", on_row), ("work", work)):
        if given is not None:
            function(given, keyword)
    if not (executor is None or isinstance(executor, Executor)):
        raise SceneError(f"executor must be an Executor of concurrent.futures or None, not {shown(executor)}.")
    if not isinstance(name, str):
        raise SceneError(f"name must be text, not {shown(name)}.")
    recording = one_of(on_error, "on_error", ON_ERROR) == "record"
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
    failed: dict[int, str] = {}
    if journal is not None and recording:
        failed = {i: journal.failed[key] for i, key in enumerate(keys) if key in journal.failed}
    weights = [1.0 if work is None else work(point) for point in points]
    failures: dict[int, Exception] = {}

    def keep(i: int, returned: Any) -> None:
        if results[i] is not None or i in failed:
            return
        if isinstance(returned, Exception):
            failures[i] = returned
            if recording:
                failed[i] = clean(f"{type(returned).__name__}: {returned}", None)
                if journal is not None:
                    journal.add(points[i], failed[i], ERROR)
            return
        result = _checked(returned, points[i])
        if recording and ERROR in result:
            raise StudyError(f"run returns {ERROR!r}, the column of points that failed; rename it.")
        results[i] = result if journal is None else journal.add(points[i], result)
        if on_row is not None:
            on_row(points[i], result)

    todo = [i for i, result in enumerate(results) if result is None and i not in failed]
    try:
        with reporting as tell:
            _run_missing(points, common, called, executor, todo, weights, keep, tell, in_flight, per_task)
    finally:
        if journal is not None:
            journal.close()
    complete = all(result is not None or i in failed or i in failures for i, result in enumerate(results))
    if failures and not recording and complete:
        raise _of_failures(failures, points) from failures[min(failures)]
    found = WrittenResults(journal, points, results) if journal is not None and not kept else tuple(results)
    return Sweep(tuple(points), found, common, facts, complete, failed)


def _of_failures(failures: Mapping[int, Exception], points: Sequence[Point]) -> StudyError:
    """Return the error that names the first point that failed, and the number of the others."""
    i = min(failures)
    others = f"; {len(failures) - 1} other points failed, too." if len(failures) > 1 else ""
    said = f"{type(failures[i]).__name__}: {failures[i]}"
    return StudyError(f"Point {i + 1} of {len(points)}, {shown(points[i])}, failed with "
                      f"{said.rstrip('.') if others else said}{others}")


def _run_missing(
    points: list[Point], common: Point, run: Run, executor: Executor | None, todo: Sequence[int],
    weights: list[float], keep: Callable[[int, Any], None], tell: Progress, in_flight: int,
    per_task: int | None,
) -> None:
    """Run the points ``todo``, and store their results or the exceptions that they raised.

    On a KeyboardInterrupt the function stores what is finished and returns without an error.
    """
    total, waiting = sum(weights) or 1.0, dict[Future[Any], list[int]]()
    done = sum(weights) - sum(weights[i] for i in todo)
    finished = len(points) - len(todo)
    tasks = ((i, {**common, **points[i]}) for i in todo)
    source = _here(run, tasks) if executor is None else _elsewhere(
        executor, run, tasks, len(todo), waiting, in_flight, per_task)
    try:
        with closing(source):
            for i, ask in source:
                tell(min(done / total, 1.0 - 1e-9), ", ".join(f"{name} {_cell(x)}" for name, x in points[i].items()))
                returned = ask()
                if isinstance(returned, CancelledError):
                    raise StudyError(f"The executor cancelled point {i + 1} of {len(points)}, {shown(points[i])}; "
                                     "repeat the sweep with another executor.") from returned
                keep(i, returned)
                done, finished = done + weights[i], finished + 1
        tell(1.0, "done")
    except (KeyboardInterrupt, StudyError, BrokenExecutor) as end:
        for future, places in waiting.items():
            if future.done() and not future.cancelled() and future.exception() is None:
                for i, returned in zip(places, future.result()[0], strict=True):
                    keep(i, returned)
                    finished += 1
        if isinstance(end, KeyboardInterrupt):
            return
        if isinstance(end, StudyError):
            raise
        raise StudyError(
            f"The executor broke down with {finished} of {len(points)} points finished, perhaps because a process was "
            f"killed or out of memory ({end}); with a file, repeat the sweep with a new executor to continue it."
        ) from end


def _here(run: Run, tasks: Iterator[tuple[int, Point]]) -> Source:
    for i, arguments in tasks:
        yield i, partial(_one, run, arguments)


def _elsewhere(
    executor: Executor, run: Run, tasks: Iterator[tuple[int, Point]], left: int, waiting: dict[Future[Any], list[int]],
    most: int, per_task: int | None,
) -> Source:
    """Run the points of a sweep in an executor, and yield them in the order in which they finish.

    Each of ``tasks``, of which ``left`` are left, is a pair of a point's index and the arguments of ``run``.
    ``waiting`` holds what is submitted, at most ``most`` at a time; what is left over at the end is cancelled. If a
    task of several points is itself lost, for example because they killed a cluster's worker, each is tried alone.
    """
    finished: SimpleQueue[Future[Any]] = SimpleQueue()
    arguments: dict[int, Point] = {}
    alone: list[int] = []
    taken, seconds = 0, math.inf

    def submit(some: list[int]) -> None:
        future = executor.submit(_several, run, [arguments[i] for i in some], sources())
        waiting[future] = some
        future.add_done_callback(finished.put)

    try:
        while True:
            while alone and len(waiting) < most:
                submit([alone.pop()])
            while left and len(waiting) < most:
                rate = taken / seconds
                short = max(1, int(LEAST * rate), min(left // most, int(TASK * rate)))
                some = dict(islice(tasks, short if per_task is None else per_task))
                left -= len(some)
                arguments.update(some)
                submit([*some])
            if not waiting:
                return
            future = _next(finished)
            places, lost = waiting[future], CancelledError() if future.cancelled() else future.exception()
            if lost is None:
                results, spent = future.result()
                taken, seconds = taken + len(results), max(spent, 1e-9) + (seconds if taken else 0.0)
                for i, result in zip(places, results, strict=True):
                    yield i, partial(_returned, result)
            elif isinstance(lost, (BrokenExecutor, KeyboardInterrupt, OtherSourcesError)):
                raise lost
            elif len(places) > 1 and not isinstance(lost, CancelledError):
                alone.extend(places)
            else:
                yield places[0], partial(_returned, lost)
            for i in set(places).difference(alone):
                del arguments[i]
            del waiting[future]
    finally:
        for future in waiting:
            future.cancel()


class OtherSourcesError(StudyError):
    """Error of a worker with other sources of this package."""


def _several(run: Run, points: Sequence[Point], expected: str) -> tuple[list[Any], float]:
    """Run several points in an executor; return what :func:`_one` returns for each, and the time [s].

    Raises OtherSourcesError if the worker's sources do not have the ``expected`` digest.
    """
    if sources() != expected:
        raise OtherSourcesError(f"A worker on {platform.node()} has other sources of this package, {sources()} and not "
                                f"{expected}, which may give other results; install the same version there, and start "
                                "the worker again.")
    begun = perf_counter()
    results = [_one(run, point) for point in points]
    return [_sendable(one) if isinstance(one, Exception) else one for one in results], perf_counter() - begun


def _one(run: Run, point: Point) -> Any:
    """Return the result of a point, or the exception that ``run`` raised."""
    try:
        return run(point)
    except BrokenExecutor:
        raise
    except Exception as failure:
        return failure


def _sendable(failure: Exception) -> Exception:
    """Return an exception that can be sent to another process: itself, or one with its name and its message."""
    try:
        pickle.loads(pickle.dumps(failure))
    except Exception:
        return RuntimeError(f"{type(failure).__name__}: {failure}")
    return failure


def _returned(result: Any) -> Any:
    return result


def _next(finished: SimpleQueue[Future[Any]]) -> Future[Any]:
    while True:
        try:
            return finished.get(timeout=PATIENCE)
        except Empty:
            continue


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
