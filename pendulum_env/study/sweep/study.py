"""Many runs, one for each point of a grid: in this process, in several, or on a cluster; in one file to go on with."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from itertools import islice, product
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

from pendulum_env.common.progress import Progress, telling_of
from pendulum_env.common.provenance import output_folder, provenance, write_csv
from pendulum_env.common.tables import Table
from pendulum_env.physics.units import SceneError, file_path, function, several, shown, truth, whole_number
from pendulum_env.study.sweep.journal import Journal, plain, text_of
from pendulum_env.study.sweep.summary import UNITS, summary
from pendulum_env.truth.reference import StudyError

Point = dict[str, Any]
Run = Callable[[Point], Mapping[str, Any]]

Source = Generator[tuple[int, Callable[[], Any]], None, None]
"""Numbers of points, and what to call for what they give."""

SAME = ("Software", "Run", "Shared", "Points", "Fingerprint")
"""What a file must have in common with the sweep that goes on with it."""
PATIENCE = 0.5
"""Waiting for results is looked up from so often [s], so that Ctrl-C is heard on every system."""


@dataclass(frozen=True)
class Sweep:
    """What a sweep found.

    Attributes:
        points: in the grid's order.
        results: of each point, in the same order; None where it is not known, after an interruption.
        shared: keywords of all points.
        facts: where it comes from, for files.
        complete: False if it was interrupted.
    """

    points: tuple[Point, ...]
    results: tuple[Point | None, ...]
    shared: Point
    facts: Mapping[str, str]
    complete: bool = True

    @property
    def rows(self) -> tuple[Point, ...]:
        """Each point that was finished, with its result, in the grid's order."""
        pairs = zip(self.points, self.results, strict=True)
        return tuple({**point, **result} for point, result in pairs if result is not None)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names that occur in the rows: those of points, then those of results."""
        names: dict[str, None] = {}
        for part in (self.points, self.results):
            names.update(dict.fromkeys(name for values in part for name in values or ()))
        return tuple(names)

    def column(self, name: str) -> list[Any]:
        """One value per row, None where a row has none; StudyError for a name that no row has."""
        if not isinstance(name, str) or name not in self.columns:
            raise StudyError(f"There is no column {shown(name)}; there are {', '.join(self.columns)}.")
        return [row.get(name) for row in self.rows]

    @property
    def table(self) -> Table:
        """The rows as text, numbers to six digits."""
        return Table(self.columns, tuple(tuple(map(_cell, self._cells(row, ""))) for row in self.rows))

    def write(self, path: str | Path) -> Path:
        """Write the rows as CSV behind lines that say where they come from; OutputError if it cannot be written."""
        place = file_path(path, "path")
        output_folder(place.parent)
        facts = {**self.facts, "Complete": text_of(self.complete)}
        write_csv(place, self.columns, (self._cells(row, "") for row in self.rows), facts)
        return place

    def _cells(self, row: Point, missing: str) -> list[Any]:
        values = [row.get(name, missing) for name in self.columns]
        return [text_of(value) if isinstance(value, (dict, list)) else value for value in values]


def _cell(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def sweep(
    grid: Mapping[str, Iterable[Any]] | Iterable[Mapping[str, Any]],
    executor: Executor | None = None,
    *,
    run: Run | None = None,
    file: str | Path | None = None,
    progress: Progress | bool = False,
    on_row: Callable[[Point, Point], None] | None = None,
    work: Callable[[Point], float] | None = None,
    in_flight: int = 256,
    name: str = "",
    anew: bool = False,
    **shared: Any,
) -> Sweep:
    """Run every point of a grid, anywhere, and keep what each gives.

    Args:
        grid: keyword -> list of its values, whose combinations are the points, the last keyword changing fastest; or
            the points themselves, each a dict of keywords, none twice. Values are what JSON can hold, or scenes.
        executor: what runs them: None for this process, a ``ProcessPoolExecutor``, Dask's ``Client.get_executor()``
            or any other of ``concurrent.futures``. It is not shut down.
        run: from a point, a dict, to a dict of numbers and texts; with an executor of other processes a function of a
            module, so that these can import it. By default :func:`pendulum_env.study.sweep.summary.summary`: the point
            holds keywords of ``rollout``, and the numbers are those of one run.
        file: results go to this file as they come, one JSON line each behind a first line that says what it is of. If
            it is there already, the sweep goes on with it: points that it holds are not run again.
        progress: True shows a bar; or what is called with the fraction done and what is being done.
        on_row: called with each point that was run now and its result.
        work: about how much work a point is, for the fraction done; by default all are alike.
        in_flight: tasks that the executor has at a time, at most.
        name: of ``run`` in the file, in place of its own and of what ``functools.partial`` bound to it. A change inside
            it, or in what it closes over, is not noticed.
        anew: True empties the file first, of whatever sweep it is.
        **shared: keywords that all points have, such as ``scene="lab"``.

    Returns a Sweep, in the grid's order whatever the order of completion. KeyboardInterrupt ends it early: what was
    finished is there, and ``complete`` is False.

    Raises StudyError for a grid that cannot be, a file of another sweep (left as it was), a point that fails, or an
    executor that breaks down; what was finished before is in the file. OutputError for a file that cannot be written.
    """
    for what, given in (("run", run), ("on_row", on_row), ("work", work)):
        if given is not None:
            function(given, what)
    if not (executor is None or isinstance(executor, Executor)):
        raise SceneError(f"executor must be one of concurrent.futures, such as a process pool, not {shown(executor)}.")
    if not isinstance(name, str):
        raise SceneError(f"name must be text, not {shown(name)}.")
    telling, empty = telling_of(progress, "sweep"), truth(anew, "anew")
    called = summary if run is None else run
    points, common = points_of(grid, shared), plain(shared, "A keyword")
    whole_number(in_flight, "in_flight")
    keys = keys_of(points)
    prints = hashlib.sha256("\n".join([text_of(common, sort=True), *sorted(keys)]).encode()).hexdigest()
    known_as = name or _name(called, file is not None)
    facts = provenance(Run=known_as, Points=str(len(points)), Shared=text_of(common, sort=True),
                       Fingerprint=prints[:32], **({"Units": UNITS} if called is summary else {}))
    journal = None if file is None else Journal(file, facts, SAME, empty)
    results: list[Point | None] = [None if journal is None else journal.done.get(key) for key in keys]
    weights = [1.0 if work is None else work(point) for point in points]

    def keep(i: int, found: Any) -> None:
        if results[i] is None:
            result = _checked(found, points[i])
            if journal is not None:
                journal.add(points[i], result)
            results[i] = result
            if on_row is not None:
                on_row(points[i], result)

    try:
        with telling as tell:
            _swept(points, common, called, executor, results, weights, keep, tell, in_flight)
    finally:
        if journal is not None:
            journal.close()
    return Sweep(tuple(points), tuple(results), common, facts, None not in results)


def _swept(
    points: list[Point], common: Point, run: Run, executor: Executor | None, results: list[Point | None],
    weights: list[float], keep: Callable[[int, Any], None], tell: Progress, in_flight: int,
) -> None:
    """Run what has no result yet, until KeyboardInterrupt."""
    total, waiting = sum(weights) or 1.0, dict[Future[Any], int]()
    todo = [i for i, result in enumerate(results) if result is None]
    done = sum(weights) - sum(weights[i] for i in todo)
    tasks = ((i, {**common, **points[i]}) for i in todo)
    source = _here(run, tasks) if executor is None else _elsewhere(executor, run, tasks, waiting, in_flight)
    try:
        with closing(source):
            for i, ask in source:
                tell(min(done / total, 1.0 - 1e-9), ", ".join(f"{name} {_cell(x)}" for name, x in points[i].items()))
                keep(i, _asked(ask, points[i], i, len(points)))
                done += weights[i]
        tell(1.0, "done")
    except (KeyboardInterrupt, StudyError, BrokenExecutor) as end:
        for future, i in waiting.items():
            if future.done() and not future.cancelled() and future.exception() is None:
                keep(i, future.result())
        if isinstance(end, KeyboardInterrupt):
            return
        if isinstance(end, StudyError):
            raise
        known = sum(result is not None for result in results)
        raise StudyError(
            f"The executor broke down with {known} of {len(points)} points finished, as when a process is killed or "
            f"out of memory ({end}); with a file, the same sweep with a new executor goes on from there."
        ) from end


def _here(run: Run, tasks: Iterator[tuple[int, Point]]) -> Source:
    for i, arguments in tasks:
        yield i, partial(run, arguments)


def _elsewhere(
    executor: Executor, run: Run, tasks: Iterator[tuple[int, Point]], waiting: dict[Future[Any], int], most: int
) -> Source:
    """Points in the order in which they are finished; ``waiting`` holds those that were handed out."""
    finished: SimpleQueue[Future[Any]] = SimpleQueue()
    try:
        while True:
            for i, arguments in islice(tasks, most - len(waiting)):
                future = executor.submit(run, arguments)
                waiting[future] = i
                future.add_done_callback(finished.put)
            if not waiting:
                return
            future = _next(finished)
            yield waiting[future], future.result
            del waiting[future]
    finally:
        for future in waiting:
            future.cancel()


def _next(finished: SimpleQueue[Future[Any]]) -> Future[Any]:
    while True:
        try:
            return finished.get(timeout=PATIENCE)
        except Empty:
            continue


def _asked(ask: Callable[[], Any], point: Point, i: int, count: int) -> Any:
    """What a point gives; StudyError that names it if it fails."""
    try:
        return ask()
    except BrokenExecutor:
        raise
    except CancelledError as error:
        raise StudyError(f"The executor gave up point {i + 1} of {count}, {shown(point)}.") from error
    except Exception as error:
        said = f"{type(error).__name__}: {error}"
        raise StudyError(f"Point {i + 1} of {count}, {shown(point)}, failed with {said}") from error


def _checked(found: Any, point: Point) -> Point:
    if not isinstance(found, Mapping):
        raise StudyError(f"run must return a dict of numbers, not {shown(found)}.")
    for name in found:
        if name in point:
            raise StudyError(f"run returns {shown(name)}, which is a keyword of the points already; rename it.")
    result: Point = plain(found, "What run returns")
    return result


def _name(run: Run, kept: bool) -> str:
    """Where a function is to be found, and what is bound to it; ``kept``: in a file, so that it must be told apart."""
    inner: Any = run.func if isinstance(run, partial) else run
    name = f"{inner.__module__}.{getattr(inner, '__qualname__', type(inner).__qualname__)}"
    if kept and name.endswith("<lambda>"):
        raise StudyError("With a file, run must be a function with a name, not a lambda; or give name=.")
    if not isinstance(run, partial) or not kept:
        return name
    bound = [plain(list(run.args), "An argument of run"), plain(run.keywords, "An argument of run")]
    return f"{name} {text_of(bound, sort=True)}"


# --- the points ------------------------------------------------------------------------------------------------------


def points_of(grid: Any, shared: Mapping[str, Any]) -> list[Point]:
    """The points of a grid; StudyError for none, or what is no grid."""
    if isinstance(grid, Mapping):
        for name, values in grid.items():
            try:
                several(values, f"The grid's {name!r}", "values")
            except SceneError as error:
                raise StudyError(str(error)) from None
        found: list[Any] = [dict(zip(grid, values, strict=True)) for values in product(*grid.values())]
    else:
        try:
            found = [*several(grid, "grid", "points")]
        except SceneError:
            found = [grid]
    if not found or found == [{}]:
        raise StudyError("A sweep needs at least one point, not none.")
    for point in found:
        if not isinstance(point, Mapping):
            raise StudyError(f"A grid is a dict of lists, or a list of dicts; it cannot hold {shown(point)}.")
        for name in point:
            if name in shared:
                raise StudyError(f"{name} is a keyword of all points, and of one as well; leave one out.")
    return [plain(point, "A point") for point in found]


def keys_of(points: list[Point]) -> list[str]:
    """The text of each point; StudyError if two are alike."""
    seen: dict[str, int] = {}
    for i, point in enumerate(points):
        other = seen.setdefault(text_of(point, sort=True), i)
        if other != i:
            raise StudyError(f"Points {other + 1} and {i + 1} are alike, {shown(point)}; each can be there once.")
    return list(seen)
