"""Tests of sweeps: order of the grid, journals from which a second run continues, and executors that fail."""

import csv
import json
import math
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
import tracemalloc
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
from small_sweep import GRID, ROWS, add

import pendulum_env
from pendulum_env import SCENES, SceneError, sweep
from pendulum_env.common import provenance, version
from pendulum_env.common.provenance import OutputError
from pendulum_env.engine.rollout import rollout
from pendulum_env.study.sweep.study import TASK
from pendulum_env.truth.reference import StudyError


def scaled(point, k):
    return {"scaled": k * point["a"]}


def late(point):
    """Run a point so that the first points take longest."""
    time.sleep(0.001 * (120 - point["a"] * 30 - point["b"]))
    return add(point)


def fatal(point):
    """Run a point that kills its process the first time."""
    flag = Path(point["folder"], "killed")
    if point["a"] == 7 and not flag.exists():
        flag.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return {"square": point["a"] ** 2}


def lines_of(path):
    return [json.loads(line) for line in path.read_text().splitlines()]


def stop_after(count):
    """Return a function that raises KeyboardInterrupt after a number of rows."""
    seen = []

    def on_row(point, row):
        seen.append(point)
        if len(seen) == count:
            raise KeyboardInterrupt

    return on_row


# --- points and results ---------------------------------------------------------------------------------------------


def test_points_are_all_combinations_in_order():
    found = sweep(GRID, run=add)
    assert found.complete
    assert list(found.rows) == ROWS
    assert found.columns == ("a", "b", "sum")
    assert found.column("sum") == [11, 21, 12, 22, 13, 23]
    assert sweep([{"a": row["a"], "b": row["b"]} for row in ROWS], run=add).rows == found.rows
    assert sweep({"a": [1, 2, 3]}, run=add, b=20).column("sum") == [21, 22, 23]


def test_results_come_in_the_grid_s_order_whatever_is_finished_first():
    finished = []
    with ThreadPoolExecutor(6) as executor:
        found = sweep(GRID, executor, run=late, on_row=lambda point, row: finished.append(row["sum"]))
    assert list(found.rows) == ROWS
    assert finished != found.column("sum")
    assert sorted(finished) == sorted(found.column("sum"))


def test_values_of_numpy_and_scenes_are_points_too():
    found = sweep({"a": np.linspace(0.0, 1.0, 3), "b": np.arange(2)}, run=add)
    assert found.column("sum") == [0.0, 1.0, 0.5, 1.5, 1.0, 2.0]
    named = sweep({"scene": ["vacuum"]}, backend="python", duration=0.1)
    given = sweep({"scene": [SCENES["vacuum"]]}, backend="python", duration=0.1)
    assert given.points[0]["scene"] == SCENES["vacuum"].to_dict()
    assert given.results == named.results


def test_by_default_a_point_is_a_rollout():
    """Compare with the textbook pendulum, angle cos(omega0 t) with constant energy."""
    found = sweep({"angle": [0.1, 0.2]}, scene="textbook", integrator="exact", duration=1.0, dt=0.01, backend="python")
    omega0 = math.sqrt(9.81)
    for row in found.rows:
        assert row["end_angle"] == pytest.approx(row["angle"] * math.cos(omega0), rel=1e-12)
        assert row["end_velocity"] == pytest.approx(-row["angle"] * omega0 * math.sin(omega0), rel=1e-11)
        assert row["end_energy"] == pytest.approx(0.5 * 9.81 * row["angle"] ** 2, rel=1e-12)
        assert row["largest_angle"] == row["angle"]
        assert row["end_time"] == pytest.approx(1.0)
        assert (row["steps"], row["rejected"], row["stop_reason"], row["work"]) == (100, 0, "", 0.0)
        assert abs(row["largest_energy_residual"]) < 1e-14


def test_a_summary_counts_the_steps_and_the_energy_of_its_run():
    given = {"scene": "exercise", "integrator": "dopri5", "rtol": 1e-6, "duration": 1.0, "dt": 0.5, "angle": 1.0}
    (row,) = sweep([given], backend="python").rows
    run = rollout(**given, backend="python")
    assert (row["steps"], row["rejected"]) == (run.steps, run.rejected)
    assert row["end_energy"] - run.energy[0] == pytest.approx(row["work"] - row["heat"], abs=1e-6)
    assert row["largest_energy_residual"] == np.max(np.abs(run.energy_residual))


def test_the_table_and_the_csv_say_what_they_are(tmp_path):
    found = sweep(GRID, run=add)
    assert found.table.head == ("a", "b", "sum")
    assert found.table.rows[1] == ("1", "20", "21")
    lines = found.write(tmp_path / "made" / "sweep.csv").read_text().splitlines()
    head = [line for line in lines if line.startswith("# ")]
    assert {"Software", "Command", "Run", "Points", "Complete"} <= {line[2:].split(":")[0] for line in head}
    assert "# Complete: true" in head
    rows = list(csv.DictReader(lines[len(head):]))
    assert [int(row["sum"]) for row in rows] == found.column("sum")
    rolled = sweep({"angle": [0.1]}, scene="textbook", duration=0.1, backend="python").write(tmp_path / "b.csv")
    assert "# Units: times s" in rolled.read_text()


# --- one file -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("workers", [0, 3])
def test_an_interrupted_sweep_goes_on_with_its_file(tmp_path, workers):
    path, called = tmp_path / "new" / "sweep.jsonl", []

    def run(point):
        called.append(point)
        return add(point)

    def swept(**more):
        if not workers:
            return sweep(GRID, run=run, file=path, **more)
        with ThreadPoolExecutor(workers) as executor:
            return sweep(GRID, executor, run=run, file=path, in_flight=2, per_task=1, **more)

    first = swept(on_row=stop_after(3))
    assert not first.complete
    kept = len(first.rows)
    assert 3 <= kept < len(ROWS)
    assert all(row in ROWS for row in first.rows)
    assert len(lines_of(path)) == 1 + kept
    called.clear()
    second = swept()
    assert second.complete
    assert list(second.rows) == ROWS
    assert len(called) == len(ROWS) - kept
    head, *entries = lines_of(path)
    assert "Software" in head["sweep"]
    assert sorted((e["point"]["a"], e["point"]["b"]) for e in entries) == [(r["a"], r["b"]) for r in ROWS]
    called.clear()
    assert swept().rows == second.rows
    assert not called


def test_a_torn_last_line_is_dropped_wherever_it_was_torn(tmp_path):
    path = tmp_path / "sweep.jsonl"
    sweep(GRID, run=add, file=path)
    whole = path.read_bytes()
    last = len(whole) - len(whole.splitlines(keepends=True)[-1])
    for cut in range(last, len(whole)):
        path.write_bytes(whole[:cut])
        assert list(sweep(GRID, run=add, file=path).rows) == ROWS
        assert path.read_bytes() == whole


def test_a_torn_line_is_gone_even_if_nothing_is_added(tmp_path):
    def at_once(done, what):
        raise KeyboardInterrupt

    path = tmp_path / "sweep.jsonl"
    sweep(GRID, run=add, file=path)
    whole = path.read_bytes()
    short = whole[: len(whole) - len(whole.splitlines(keepends=True)[-1])]
    path.write_bytes(whole[:-5])
    assert not sweep(GRID, run=add, file=path, progress=at_once).complete
    assert path.read_bytes() == short


def test_a_version_of_the_same_sources_goes_on_with_a_journal(tmp_path):
    """A commit that changes no source renames the version of a checkout."""
    path = tmp_path / "sweep.jsonl"
    done = sweep(GRID, run=add, file=path)
    path.write_text(path.read_text().replace("lab-pendulum 0", "lab-pendulum 9"))
    assert sweep(GRID, run=add, file=path).rows == done.rows


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace("add", "sub"), "belongs to another sweep, with Run 'small_sweep.sub' instead"),
        (lambda text: text.replace('"Points": "6"', '"Points": "7"'), "with Points '7' instead of '6'"),
        (lambda text: "angle,velocity\n1.0,2.0\n", "not the journal of a sweep"),
        (lambda text: "no line's end", "not the journal of a sweep"),
        (lambda text: '{"other": 1}\n', "not the journal of a sweep"),
        (lambda text: text.replace('{"point": {"a": 1, "b": 20}', '{"point"'), "Line 3 of .* is damaged"),
    ],
)
def test_files_that_are_not_of_this_sweep_are_refused_and_left_alone(tmp_path, change, message):
    path = tmp_path / "sweep.jsonl"
    sweep(GRID, run=add, file=path)
    changed = change(path.read_text())
    path.write_text(changed)
    with pytest.raises(StudyError, match=message):
        sweep(GRID, run=add, file=path)
    assert path.read_text() == changed


def test_a_sweep_of_other_values_is_another(tmp_path):
    path = tmp_path / "sweep.jsonl"
    sweep(GRID, run=add, file=path, c=1)
    for grid, c, said in (({**GRID, "b": [10, 30]}, 1, "Fingerprint"), (GRID, 2, "with c 1 instead of 2")):
        with pytest.raises(StudyError, match=said):
            sweep(grid, run=add, file=path, c=c)
    assert list(sweep(GRID, run=add, file=path, c=1).rows) == ROWS


def test_a_function_with_other_arguments_bound_to_it_is_another(tmp_path):
    path = tmp_path / "sweep.jsonl"
    assert sweep({"a": [1, 2]}, run=partial(scaled, k=10), file=path).column("scaled") == [10, 20]
    with pytest.raises(StudyError, match="another sweep"):
        sweep({"a": [1, 2]}, run=partial(scaled, k=20), file=path)
    assert sweep({"a": [1, 2]}, run=partial(scaled, k=20), file=path, anew=True).column("scaled") == [20, 40]
    with pytest.raises(StudyError, match="not a lambda"):
        sweep({"a": [1]}, run=lambda point: {"b": 1}, file=tmp_path / "other.jsonl")
    assert not (tmp_path / "other.jsonl").exists()


def test_numbers_that_json_lacks_survive(tmp_path):
    def run(point):
        return {"nan": math.nan, "many": [math.inf, -math.inf], "one": np.float64(0.1), "less": -0.0}

    path = tmp_path / "sweep.jsonl"
    first = sweep({"a": [math.inf, 1e-300]}, run=run, file=path)
    again = sweep({"a": [math.inf, 1e-300]}, run=run, file=path)
    assert repr(again.rows) == repr(first.rows)
    assert first.rows[0]["many"] == [math.inf, -math.inf]
    for line in path.read_text().splitlines():
        json.loads(line, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))


def test_a_file_that_cannot_be_written_is_said(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be written"):
        sweep(GRID, run=add, file=tmp_path / "file" / "sweep.jsonl")
    with pytest.raises(OutputError, match="cannot be written"):
        sweep(GRID, run=add, file=tmp_path)


# --- executors ------------------------------------------------------------------------------------------------------


class Watched(Executor):
    """Thread pool that counts its waiting tasks, and that breaks down or cancels a task at a given number."""

    def __init__(self, inner, breaks=math.inf, gives_up=math.inf):
        self.inner, self.breaks, self.gives_up = inner, breaks, gives_up
        self.waiting = self.most = self.count = 0

    def submit(self, fn, /, *args, **kwargs):
        self.count += 1
        if self.count == self.breaks:
            raise BrokenExecutor("it is gone")
        if self.count == self.gives_up:
            lost = Future()
            lost.cancel()
            return lost
        self.waiting += 1
        self.most = max(self.most, self.waiting)
        future = self.inner.submit(fn, *args, **kwargs)
        future.add_done_callback(self._finished)
        return future

    def _finished(self, future):
        self.waiting -= 1


class AtOnce(Executor):
    """Executor that runs each task at once in the calling thread."""

    def submit(self, fn, /, *args, **kwargs):
        future = Future()
        future.set_result(fn(*args, **kwargs))
        return future


def test_what_was_finished_but_not_yet_asked_for_is_kept(tmp_path):
    with pytest.raises(StudyError, match="broke down with 3 of 6 points finished"):
        sweep(GRID, Watched(AtOnce(), breaks=4), run=add, file=tmp_path / "sweep.jsonl")
    assert [entry["result"]["sum"] for entry in lines_of(tmp_path / "sweep.jsonl")[1:]] == [11, 21, 12]
    found = sweep(GRID, AtOnce(), run=add, in_flight=4, on_row=stop_after(1))
    assert not found.complete
    assert list(found.rows) == ROWS[:4]


def test_a_bounded_number_of_tasks_waits():
    with ThreadPoolExecutor(2) as inner:
        executor = Watched(inner)
        found = sweep({"a": range(40)}, executor, run=lambda point: {"square": point["a"] ** 2}, in_flight=3,
                      per_task=1)
    assert found.column("square") == [a * a for a in range(40)]
    assert executor.count == 40
    assert 1 <= executor.most <= 3


def double(point):
    return {"double": 2 * point["a"]}


def long(point):
    time.sleep(1.1 * TASK)
    return double(point)


@pytest.mark.parametrize(("run", "count", "options", "least", "most"), [
    (double, 1000, {"in_flight": 32}, 33, 200),  # one point in each of the first tasks, then many
    pytest.param(long, 24, {"in_flight": 8}, 24, 24, marks=pytest.mark.slow),
    (double, 1000, {"per_task": 7}, 143, 143),
])
def test_short_points_share_a_task(run, count, options, least, most):
    with ThreadPoolExecutor(8) as inner:
        executor = Watched(inner)
        found = sweep({"a": range(count)}, executor, run=run, **options)
    assert found.column("double") == [2 * a for a in range(count)]
    assert least <= executor.count <= most


def test_all_points_of_a_task_but_one_that_fails_are_kept(tmp_path):
    path = tmp_path / "sweep.jsonl"

    def run(point):
        return {"inverse": 1 / (point["a"] - 5)}

    with ThreadPoolExecutor(1) as executor, pytest.raises(StudyError, match="Point 6 of 9"):
        sweep({"a": range(9)}, executor, run=run, file=path, in_flight=1, per_task=8)
    assert [entry["point"]["a"] for entry in lines_of(path)[1:]] == [0, 1, 2, 3, 4, 6, 7, 8]


@pytest.mark.parametrize(
    ("faults", "message"),
    [
        ({"breaks": 4}, "broke down with 3 of 6 points finished"),
        ({"gives_up": 4}, "cancelled point 4 of 6"),
    ],
)
def test_what_was_done_before_an_executor_broke_down_is_in_the_file(tmp_path, faults, message):
    path = tmp_path / "sweep.jsonl"
    with ThreadPoolExecutor(1) as inner:
        with pytest.raises(StudyError, match=message):
            sweep(GRID, Watched(inner, **faults), run=add, file=path, in_flight=1, per_task=1)
        assert [entry["result"] for entry in lines_of(path)[1:]] == [{"sum": row["sum"]} for row in ROWS[:3]]
        fresh = Watched(inner)
        assert list(sweep(GRID, fresh, run=add, file=path).rows) == ROWS
    assert fresh.count == 3


@pytest.mark.parametrize("threads", [0, 1])
def test_a_point_that_fails_is_named_after_all_others_are_done(tmp_path, threads):
    path = tmp_path / "sweep.jsonl"

    def run(point):
        return {"inverse": 1 / (point["a"] - 2)}

    said = "Point 3 of 4, {'a': 2}, failed with ZeroD"
    with ThreadPoolExecutor(1) as executor, pytest.raises(StudyError, match=said):
        sweep({"a": [0, 1, 2, 3]}, executor if threads else None, run=run, file=path, in_flight=1)
    assert [entry["point"]["a"] for entry in lines_of(path)[1:]] == [0, 1, 3]
    with pytest.raises(StudyError, match=said):  # the point alone is tried again
        sweep({"a": [0, 1, 2, 3]}, run=run, file=path)
    assert len(lines_of(path)) == 4


def inverse(point):
    if point["a"] in (2, 5):
        raise ValueError(f"no inverse\nof {point['a']}")
    return {"inverse": 1.0 / (1.0 + point["a"])}


@pytest.mark.parametrize("threads", [0, 1, 3])
@pytest.mark.parametrize("in_memory", [True, False])
def test_points_that_fail_are_recorded_with_their_reason(tmp_path, threads, in_memory):
    """In the rows, the table, the CSV and the journal; a sweep that continues runs neither them nor the others."""
    path, grid = tmp_path / "sweep.jsonl", {"a": range(7)}
    options = {"run": inverse, "file": path, "in_memory": in_memory}
    with ThreadPoolExecutor(max(threads, 1)) as pool:
        found = sweep(grid, pool if threads else None, on_error="record", **options)
    reasons = {2: "ValueError: no inverse of 2", 5: "ValueError: no inverse of 5"}
    rows = [{"a": a, "error": reasons[a]} if a in reasons else {"a": a, "inverse": 1.0 / (1.0 + a)} for a in range(7)]
    assert (list(found), dict(found.failed), found.complete) == (rows, reasons, True)
    assert found.column("error") == [reasons.get(a) for a in range(7)]
    assert [cells[-1] for cells in found.table.rows] == [reasons.get(a, "") for a in range(7)]
    assert "2 failed" in repr(found)
    table = list(csv.DictReader(line for line in found.write(tmp_path / "sweep.csv").read_text().splitlines()
                                if not line.startswith("#")))
    assert [row["error"] for row in table] == [reasons.get(a, "") for a in range(7)]
    written = {entry["point"]["a"]: entry["error"] for entry in lines_of(path)[1:] if "error" in entry}
    assert written == reasons
    again = sweep(grid, on_error="record", **{**options, "run": lambda point: 1 / 0}, name=found.facts["Run"])
    assert list(again) == rows
    tried = []
    whole = sweep(grid, on_error="raise", **{**options, "run": lambda point: tried.append(point) or {"inverse": 9.0}},
                  name=found.facts["Run"])
    assert (tried, whole.failed) == ([{"a": 2}, {"a": 5}], {})
    assert whole.column("inverse") == [9.0 if a in reasons else 1.0 / (1.0 + a) for a in range(7)]


def test_a_task_that_is_lost_costs_only_the_point_that_loses_it():
    """Such as one that kills a cluster's worker: the other points of its task are tried alone."""
    class Losing(AtOnce):
        def submit(self, fn, /, *args, **kwargs):
            future = Future()
            if {"a": 3} in args[1]:
                future.set_exception(RuntimeError("the worker died"))
            else:
                future.set_result(fn(*args, **kwargs))
            return future

    found = sweep({"a": range(6)}, Losing(), run=double, per_task=4, on_error="record")
    assert found.failed == {3: "RuntimeError: the worker died"}
    assert found.column("double") == [2 * a if a != 3 else None for a in range(6)]


def test_other_sources_do_not_continue_a_file(tmp_path, monkeypatch):
    path = tmp_path / "sweep.jsonl"
    sweep(GRID, run=add, file=path, on_row=stop_after(2))
    before = path.read_bytes()
    monkeypatch.setattr(provenance, "sources", lambda: "0123456789ab")
    own = version.sources()
    with pytest.raises(StudyError, match=f"other sources of this package, {own} and not 0123456789ab.*anew=True"):
        sweep(GRID, run=add, file=path)
    assert path.read_bytes() == before
    assert list(sweep(GRID, run=add, file=path, anew=True)) == ROWS


def test_a_worker_with_other_sources_is_refused_before_its_first_point(monkeypatch):
    tried = []

    class Elsewhere(AtOnce):
        def submit(self, fn, /, run, points, expected):
            future = Future()
            try:
                future.set_result(fn(run, points, "0123456789ab"))  # what another machine's sources give
            except Exception as error:
                future.set_exception(error)
            return future

    for on_error in ("raise", "record"):
        with pytest.raises(StudyError, match=f"A worker on .* has other sources .*{version.sources()} and not 01234"):
            sweep(GRID, Elsewhere(), run=lambda point: tried.append(point) or {}, on_error=on_error)
    assert tried == []


@pytest.mark.slow
def test_a_pool_whose_process_is_killed_goes_on_from_its_file(tmp_path):
    grid, path = {"a": list(range(20))}, tmp_path / "sweep.jsonl"
    with (
        ProcessPoolExecutor(2, get_context("spawn")) as pool,
        pytest.raises(StudyError, match="The executor broke down with"),
    ):
        sweep(grid, pool, run=fatal, file=path, in_flight=4, folder=str(tmp_path))
    done = [entry["point"]["a"] for entry in lines_of(path)[1:]]
    assert 7 not in done
    assert len(set(done)) == len(done)
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        found = sweep(grid, pool, run=fatal, file=path, folder=str(tmp_path))
    assert found.complete
    assert found.rows == sweep(grid, run=fatal, folder=str(tmp_path)).rows
    assert sorted(entry["point"]["a"] for entry in lines_of(path)[1:]) == grid["a"]


@pytest.fixture
def cluster():
    """Yield the address of a Dask cluster of two processes on this machine."""
    distributed = pytest.importorskip("distributed")
    options = {"n_workers": 2, "threads_per_worker": 1, "processes": True, "host": "127.0.0.1"}
    with distributed.LocalCluster(**options, dashboard_address=None) as found:
        yield found


@pytest.mark.slow
def test_a_cluster_whose_worker_is_killed_loses_nothing_and_does_nothing_twice(tmp_path, cluster):
    from distributed import Client

    grid = {"angle": np.linspace(0.1, 3.0, 15), "integrator": ["rk4", "velocity_verlet"]}
    common = {"scene": "exercise", "duration": 20.0, "dt": 0.005, "backend": "python"}
    path, killed = tmp_path / "sweep.jsonl", []
    with Client(cluster, set_as_default=False) as client:
        pids = client.run(os.getpid)

        def on_row(point, row):
            if len(lines_of(path)) == 6 and not killed:
                killed.append(next(iter(pids.values())))
                os.kill(killed[0], signal.SIGKILL)

        found = sweep(grid, client.get_executor(), file=path, on_row=on_row, **common)
        assert killed
        assert killed[0] not in client.run(os.getpid).values()
    assert found.complete
    assert found.rows == sweep(grid, **common).rows
    done = [(entry["point"]["angle"], entry["point"]["integrator"]) for entry in lines_of(path)[1:]]
    assert sorted(done) == sorted((point["angle"], point["integrator"]) for point in found.points)


@pytest.mark.slow
def test_a_cost_study_on_a_cluster_is_that_of_one_process(cluster, tmp_path):
    from pendulum_env.study.sweep.cluster import executor_at

    given = {"scene": "vacuum", "integrators": ["rk4", "dopri5"], "duration": 4.0, "repeats": 2, "backend": "python"}
    with executor_at(cluster.scheduler_address) as executor:
        found = pendulum_env.cost(**given, executor=executor, file=tmp_path / "cost.jsonl")
    plain = pendulum_env.cost(**given)
    known = ("series", "dt", "rtol", "steps", "angle_error", "phase_error", "energy_error", "evaluations")
    for mine, other in zip(found.points, plain.points, strict=True):
        assert [getattr(mine, name) for name in known] == [getattr(other, name) for name in known]
        assert len(mine.times) == 2


@contextmanager
def scheduler_at(port):
    """Run a Dask scheduler and a worker in processes of their own; yield the scheduler's process and its executor."""
    from pendulum_env.study.sweep.cluster import executor_at

    address = f"tcp://127.0.0.1:{port}"
    words = (["dask_scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-show"],
             ["dask_worker", address, "--nthreads", "1"])
    paths = os.pathsep.join(sys.path)
    started = [subprocess.Popen([sys.executable, "-m", f"distributed.cli.{name}", *rest, "--no-dashboard"],
                                stderr=subprocess.DEVNULL, env={**os.environ, "PYTHONPATH": paths})
               for name, *rest in words]
    try:
        with ExitStack() as stack:
            found = None
            while found is None:
                with suppress(StudyError):  # until scheduler and worker are there
                    found = stack.enter_context(executor_at(address))
            yield started[0], found
    finally:
        for process in started:
            process.kill()
            process.wait()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_scheduler_that_is_killed_and_started_again_loses_nothing(tmp_path):
    pytest.importorskip("distributed")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    grid, path, said = {"a": range(30), "b": [1]}, tmp_path / "sweep.jsonl", []
    with scheduler_at(port) as (process, executor):
        def on_row(point, row):
            if point["a"] == 10:
                process.kill()

        try:
            sweep(grid, executor, run=add, file=path, per_task=1, on_row=on_row, in_flight=4)
        except StudyError as error:
            said.append(str(error))
    kept = [entry["point"]["a"] for entry in lines_of(path)[1:]]
    assert "repeat the sweep with" in said[0]
    assert {*range(9)} <= {*kept} < {*range(30)}
    with scheduler_at(port) as (_, executor):
        found = sweep(grid, executor, run=add, file=path)
    assert found.rows == sweep(grid, run=add).rows
    assert sorted(entry["point"]["a"] for entry in lines_of(path)[1:]) == [*range(30)]


@pytest.mark.slow
def test_a_scheduler_that_does_not_answer_is_said(monkeypatch):
    pytest.importorskip("distributed")
    from pendulum_env.study.sweep import cluster

    monkeypatch.setattr(cluster, "PATIENCE", 1)
    for address in ("tcp://127.0.0.1:9", "nowhere:at:all"):
        with pytest.raises(StudyError, match="No Dask scheduler answers at"), cluster.executor_at(address):
            pass


def test_a_scheduler_without_dask_is_said(monkeypatch):
    from pendulum_env.study.sweep.cluster import executor_at

    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(StudyError, match=r"pip install \"lab-pendulum\[dask\]\""), executor_at("tcp://127.0.0.1:8786"):
        pass


# --- results that stay in the file ------------------------------------------------------------------------------------


def test_results_that_stay_in_the_file_are_the_same(tmp_path):
    usual = sweep(GRID, run=add, file=tmp_path / "a.jsonl")
    first = sweep(GRID, run=add, file=tmp_path / "b.jsonl", in_memory=False, on_row=stop_after(3))
    assert not first.complete
    assert list(first.results) == [*usual.results[:3], None, None, None]
    with ThreadPoolExecutor(2) as executor:
        found = sweep(GRID, executor, run=add, file=tmp_path / "b.jsonl", in_memory=False)
    assert found.complete
    assert found.rows == tuple(found) == usual.rows
    assert tuple(found.results) == usual.results
    assert (found.results[4], len(found.results), *found.results[1:3]) == (
        usual.results[4], len(usual.results), *usual.results[1:3])
    assert found.column("sum") == usual.column("sum")
    assert repr(found) == repr(usual)
    texts = [one.write(tmp_path / "c.csv").read_text() for one in (found, usual)]
    assert texts[0] == texts[1]


@pytest.mark.slow
def test_results_that_stay_in_the_file_take_no_memory(tmp_path):
    path, size = tmp_path / "large.jsonl", 1500

    def series(point):
        return {"values": [point["a"] + i / size for i in range(size)]}

    def peak(**options):
        tracemalloc.start()
        found = sweep({"a": range(100)}, run=series, file=path, **options)
        last = sum(row["values"][-1] for row in found)
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most, last

    least, one = peak(in_memory=False)
    again, two = peak(in_memory=False)  # all results are in the file by now
    most, three = peak()
    assert one == two == three
    assert max(least, again) < 0.1 * most


def same_length(point):
    return {"sum": 1 + point["a"] + point["b"]}


class UnsentError(Exception):
    """An exception that cannot be sent to another process."""

    def __init__(self, one, two):
        super().__init__("of no use elsewhere")
        self.lock = threading.Lock()


def unsent(point):
    if point["a"] == 2:
        raise UnsentError(1, 2)
    return double(point)


def test_an_exception_that_cannot_be_sent_names_its_point():
    said = "Point 3 of 9, {'a': 2}, failed with RuntimeError: UnsentError: of no use elsewhere"
    with ThreadPoolExecutor(1) as executor, pytest.raises(StudyError, match=re.escape(said)):
        sweep({"a": range(9)}, executor, run=unsent, per_task=4)


def test_a_file_that_is_gone_or_changed_after_the_sweep_is_said(tmp_path):
    path = tmp_path / "a.jsonl"
    found = sweep(GRID, run=add, file=path, in_memory=False)
    usual = path.read_bytes()
    *lines, last = usual.splitlines(keepends=True)
    sweep(GRID, run=same_length, file=path, anew=True, name=found.facts["Run"][:-1] + "s")  # results in the same places
    changed = [path.read_bytes(), b"another text", lines[0] + last + b"".join(lines[1:]), lines[0] + usual[40:]]
    for text in changed:
        path.write_bytes(text)
        with pytest.raises(StudyError, match="was changed after the sweep"):
            list(found.results)
    path.unlink()
    with pytest.raises(StudyError, match="cannot be read: No such file"):
        list(found)
    with pytest.raises(StudyError, match="has its results in a file; give one"):
        sweep(GRID, run=add, in_memory=False)


# --- bad input ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"grid": {}}, "has no points"),
        ({"grid": []}, "has no points"),
        ({"grid": {"a": []}}, "has no points"),
        ({"grid": {"a": 1.0}}, "'a' must be a list of values"),
        ({"grid": {"a": "lab"}}, "'a' must be a list of values"),
        ({"grid": "lab"}, "a dict of lists or a list of keyword dicts"),
        ({"grid": [1, 2]}, "and cannot hold 1"),
        ({"grid": {"a": [1, 2, 1]}}, "Points 1 and 3 are equal"),
        ({"grid": {"a": [object()]}}, "A point must hold only JSON's types"),
        ({"grid": {"a": [1]}, "a": 2}, "a is given as a keyword of all points and also in the grid"),
        ({"grid": {"a": [1]}, "in_flight": 0}, "in_flight must be a whole number from 1"),
        ({"grid": {"a": [1]}, "on_error": "ignore"}, "There is no on_error 'ignore'; there are raise, record"),
        ({"grid": {"a": [1]}, "run": lambda point: {"error": 1.0}, "on_error": "record"}, "rename it"),
        ({"grid": {"a": [1]}, "run": lambda point: 3.0}, "must return a dict of numbers, not 3"),
        ({"grid": {"a": [1]}, "run": lambda point: {"a": 3.0}}, "also a keyword of the points"),
        ({"grid": {"a": [1]}, "run": lambda point: {"b": object()}}, "The result of run must hold only JSON's types"),
        ({"grid": {"integrator": ["rk5"]}, "run": None}, "MethodError: There is no integrator 'rk5'; did you mean rk4"),
        (
            {"grid": {"angle": [[0.1, 0.2]]}, "scene": "vacuum", "run": None, "backend": "python", "duration": 0.1},
            "a sweep is one run",
        ),
    ],
)
def test_bad_input_gives_one_clear_error(arguments, message):
    with pytest.raises((StudyError, SceneError), match=message):
        sweep(**{"run": add, "b": 1, **arguments} if "run" not in arguments else arguments)


def test_a_column_that_is_not_there_is_said():
    with pytest.raises(StudyError, match="There is no column 'c'; the columns are a, b, sum"):
        sweep(GRID, run=add).column("c")


def test_progress_ends_at_one_and_weighs_the_work():
    told = []
    sweep({"a": [1, 2, 7]}, run=lambda point: {}, progress=lambda done, what: told.append((done, what)),
          work=lambda point: point["a"])
    assert told == [(0.0, "a 1"), (0.1, "a 2"), (pytest.approx(0.3), "a 7"), (1.0, "done")]
