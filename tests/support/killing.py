"""A program that writes files over and over, and kills itself with SIGKILL before each of its file operations in turn.

``python tests/support/killing.py JOB FOLDER``: after each kill it looks at what is there, then does the job again,
undisturbed. It prints how many kills there were, and fails where a file was neither as before nor as
after, or a part was left.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import sys
import traceback
from collections.abc import Callable
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

import integrators
from pendulum_env import SCENES, rollout
from pendulum_env.auto import store
from pendulum_env.common.provenance import write_csv
from pendulum_env.engine import kernels, runs
from pendulum_env.engine.generate import program
from pendulum_env.render import write_film
from pendulum_env.study.sweep.journal import HEAD, Journal

OPERATIONS = ("open", "os.rename", "os.remove", "os.mkdir", "os.chmod", "os.truncate")
"""Audit events of what changes files, or may."""
SMALL = "@inline\ndef square(x):\n    return x*x\n\n\n@entry\ndef run(x):\n    return square(x) + 0.25\n"
ANGLES = np.array([0.1, 0.2])
Look = Callable[[Path, dict[str, bytes], dict[str, bytes]], None]


def table(folder: Path, anew: bool) -> None:
    write_csv(folder / "table.csv", ("a", "b"), [(i, anew) for i in range(50)], {"Seed": "1"})


def scene(folder: Path, anew: bool) -> None:
    SCENES["water" if anew else "lab"].save(folder / "scene.json")


def film(folder: Path, anew: bool) -> None:
    write_film(folder / "film.gif", (np.full((20, 20, 3), 40 * i + anew, np.uint8) for i in range(4)), 25)


def choice(folder: Path, anew: bool) -> None:
    os.environ["LAB_PENDULUM_CACHE"] = str(folder)
    assert store.save({"table": 1}, {"rk4": [1.0, 2.0 + anew]})


def kernel(folder: Path, anew: bool) -> None:
    if anew:
        os.environ["LAB_PENDULUM_CACHE"] = str(folder)
        small = replace(program(SCENES["textbook"], integrators.get("symplectic_euler")), text=SMALL, title="small")
        assert kernels.functions(small, "compiled")["run"](1.5) == 2.5


def records(folder: Path, anew: bool) -> None:
    """Some rows at a time; that its header is written again counts as an operation, before and after."""
    runs.CHUNK = 8 * len(ANGLES) * 4
    write = np.lib.format.write_array_header_2_0

    def told(*arguments: Any) -> None:
        sys.audit("open", folder)
        write(*arguments)
        sys.audit("open", folder)

    np.lib.format.write_array_header_2_0 = told
    rollout("vacuum", angle=ANGLES + 0.5 * anew, duration=0.15, dt=0.01, backend="python", file=folder / "runs.npy",
            progress=lambda *_: None)


def journal(folder: Path, anew: bool) -> None:
    book = Journal(folder / "sweep.jsonl", {"scene": "lab"}, ("scene",))
    try:
        for point in ([1, 2] if anew else [0]):
            if str(point) not in book.done:
                book.add(point, {"error": 0.5 * point})
    finally:
        book.close()


def old_or_new(folder: Path, before: dict[str, bytes], after: dict[str, bytes]) -> None:
    """Each file is as it was before or as it is when all is done; none that was there is gone."""
    there = visible(folder)
    assert before.keys() <= there.keys() <= after.keys(), there.keys()
    assert all(content in (before.get(name), after[name]) for name, content in there.items())


def rows_so_far(folder: Path, before: dict[str, bytes], after: dict[str, bytes]) -> None:
    """The old records or the first of the new, beside what says of them, or nothing, where they come from."""
    found = np.load(folder / "runs.npy")
    complete = np.load(folder.with_name("after") / "runs.npy")
    about = visible(folder).get("runs.npy.json")
    if (folder / "runs.npy").read_bytes() == before["runs.npy"]:
        assert about in (None, before["runs.npy.json"])
    else:
        assert len(found) <= len(complete)
        assert found.tobytes() == complete[: len(found)].tobytes()
        assert about in (None, after["runs.npy.json"])


def lines_so_far(folder: Path, before: dict[str, bytes], after: dict[str, bytes]) -> None:
    text = (folder / "sweep.jsonl").read_bytes()
    assert text.startswith(before["sweep.jsonl"])
    assert after["sweep.jsonl"].startswith(text)
    assert HEAD in json.loads(text.splitlines()[0])


JOBS: dict[str, tuple[Callable[[Path, bool], None], Look]] = {
    "table": (table, old_or_new), "scene": (scene, old_or_new), "film": (film, old_or_new),
    "choice": (choice, old_or_new), "kernel": (kernel, old_or_new), "records": (records, rows_so_far),
    "journal": (journal, lines_so_far),
}


def visible(folder: Path) -> dict[str, bytes]:
    """What a user sees in a folder."""
    return {path.name: path.read_bytes() for path in folder.iterdir() if not path.name.startswith(".")}


def in_a_child(work: Callable[[], Any]) -> bool:
    """True if a child process did the work, False if it was killed; a failure of it ends this program."""
    process = os.fork()
    if process == 0:
        try:
            work()
        except BaseException:
            traceback.print_exc()
            os._exit(3)
        os._exit(0)
    _, status = os.waitpid(process, 0)
    assert os.WIFSIGNALED(status) or status == 0
    return status == 0


def kill_before(operation: int, folder: Path) -> None:
    """Kill this process before it does this operation on a file of the folder."""
    left = count(operation - 1, -1)

    def seen(event: str, arguments: tuple[Any, ...]) -> None:
        about = [os.fsdecode(each) for each in arguments if isinstance(each, (str, bytes, os.PathLike))]
        if event in OPERATIONS and any(str(folder) in each for each in about) and next(left) == 0:
            os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(seen)


def old(folder: Path, job: Callable[[Path, bool], None]) -> Path:
    """A folder as the job found it: an earlier result of its own, and something of somebody else's."""
    folder.mkdir(mode=0o700)
    (folder / "neighbour.txt").write_text("mine")
    assert in_a_child(lambda: job(folder, False))
    return folder


def main(name: str, place: Path) -> int:
    job, look = JOBS[name]
    folder = old(place / "work", job)  # always at one place, which stands in compiled programs
    before = visible(folder)
    assert in_a_child(lambda: job(folder, True))
    whole = visible(folder)
    folder.rename(place / "after")
    for operation in count(1):
        old(folder, job)

        def disturbed(operation: int = operation) -> None:
            kill_before(operation, folder)
            job(folder, True)

        if in_a_child(disturbed):
            return operation - 1
        look(folder, before, whole)
        assert (folder / "neighbour.txt").read_text() == "mine"
        for part in folder.glob(".*"):
            os.utime(part, (1e9, 1e9))
        assert in_a_child(lambda: job(folder, True))
        assert visible(folder).keys() == whole.keys()
        assert all(visible(folder)[each] == whole[each] for each in whole if each.endswith((".csv", ".npy", ".gif")))
        assert not [*folder.glob(".*")], "a part is left behind"
        shutil.rmtree(folder)
    raise AssertionError


if __name__ == "__main__":
    print(main(sys.argv[1], Path(sys.argv[2])))
