"""A fuzzer: damaged files for every reader, odd values for functions, odd words for the command line.

``python tests/fuzzing/fuzz.py --seconds 60 --seed 1`` runs until the time is up; every case is drawn from the seed and
its number, so that ``--case 17`` repeats one. A case is a find if it ends with an error that the package does not
declare as its own, or if reading a file takes longer than 20 s. Finds are printed; inputs of readers are written to
the folder ``--keep``. The exit code is 1 if there are finds.

Everything happens in a new folder, which is the home folder, too. An audit hook of Python refuses, and reports, every
write to a file elsewhere, every removal of one, and every program that is started but the encoder of films.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import linecache
import os
import random
import shutil
import signal
import sys
import tempfile
import time
import traceback
import warnings
import zipfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))
sys.dont_write_bytecode = True
os.environ.update(LAB_PENDULUM_BACKEND="python", SDL_VIDEODRIVER="dummy", MPLBACKEND="agg", COLUMNS="100")

SAVED = tuple((Path(__file__).parents[1] / "common" / "version_1").resolve().iterdir())
"""Files of saved results."""
SLOW = 20
"""Seconds after which reading a file counts as a find; other cases are given up after as many."""
WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC
PATHS = {"os.remove": 1, "os.rename": 2, "os.rmdir": 1, "os.mkdir": 1, "os.link": 2, "os.symlink": 2, "os.chmod": 1,
         "os.chown": 1, "os.truncate": 1, "shutil.rmtree": 1}
"""Audit events that change files -> number of their arguments that are paths."""
STARTS = {"subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "socket.connect"}
SHARES = {"reader": 6, "function": 3, "command": 2}
"""Kinds of cases, and how often they are drawn."""
IGNORED = ("acquire", "show", "demo", "web")
"""Commands that are not run: a page and a window that wait for a person, a tour of minutes, and a page for a browser.

Every option of acquire is spoilt in tests/cli/test_keyword_options.py.
"""


class Escape(BaseException):
    """A write outside of the fuzzer's folder, or a program that was about to start."""


class TimeUp(BaseException):
    """A case that takes too long."""


class Case:
    """One case: what it is, and what its input was."""

    def __init__(self, seed: int, number: int) -> None:
        self.source, self.label, self.data = random.Random(f"{seed} {number}"), "", b""


# --- inputs -----------------------------------------------------------------------------------------------------------


def corpus() -> dict[str, list[bytes]]:
    """Return small whole files for every reader, by the readers' names."""
    import json

    import numpy as np
    from archives import TABLE, archive, ods, xlsx
    from bench_files import BENCH_FILES
    from old_workbook import old_workbook

    from pendulum_env import SCENES

    folder, swings = Path("whole"), [TABLE.encode(), archive({"swing.csv": TABLE}), xlsx(), ods(),
                                     old_workbook([("one", [(0.1 * i, (-1.0) ** i) for i in range(9)])])]
    folder.mkdir()
    for i, one in enumerate(BENCH_FILES[::6]):  # all of them would take a minute
        path = folder / f"{i}{one.suffix}"
        one.write(path, np.random.default_rng(i))
        content = path.read_bytes()
        swings.append(content if content[:4] in (b"PK\x03\x04", b"\xd0\xcf\x11\xe0") or b"<?xml" in content[:9]
                      else b"".join(content.splitlines(keepends=True)[:60]))
    log = "time (s),angle (rad),action\n" + "".join(
        f"{0.1 * i:.1f},{np.sin(0.3 * i):.4f},{0.5 * (-1) ** (i // 7)}\n" for i in range(60))
    array = io.BytesIO()
    np.save(array, np.zeros(5, [("time", float), ("angle", float)]))
    return {"Recording.read": swings, "DrivenLog.read": [log.encode(), *swings], "gate": swings,
            "Scene.load": [json.dumps(scene.to_dict()).encode() for scene in SCENES.values()],
            "load": [path.read_bytes() for path in SAVED], "result.json": [member(path) for path in SAVED],
            "by hand": [head + b"".join(b"\n%d,%d.5,%d" % (10 * i, 9 - i, 2 + i) for i in range(6)) for head in (
                b"time (s),amplitude (deg),n", b"length (cm),10 T (s),error", b"x (cm),T1 (s),T2 (s)",
                b"h1 (cm),50 T1 (s),50 T2 (s)")],
            "rollout file": [array.getvalue()], "journal": [b'{"sweep": {"scene": "lab"}}\n{"point": {}, "row": []}\n']}


def member(path: Path) -> bytes:
    """Return the JSON text of a saved result's file."""
    with zipfile.ZipFile(path) as archive:
        return archive.read("result.json")


def with_text(path: Path) -> Path:
    """Return the path of a saved result's file with the JSON text at a path, and with whole arrays."""
    made = path.with_name(f"{path.name}.zip")
    with zipfile.ZipFile(made, "w") as archive:
        archive.writestr("result.json", path.read_bytes())
        for saved in SAVED:
            with zipfile.ZipFile(saved) as whole:
                for name in set(whole.namelist()) - {"result.json", *archive.namelist()}:
                    archive.writestr(name, whole.read(name))
    return made


def readers() -> dict[str, tuple[Callable[[Path], Any], tuple[type[Exception], ...]]]:
    """Return the package's readers of files, each with the errors that it declares."""
    from pendulum_env import Recording, Scene, SceneError, load
    from pendulum_env.engine.growing_file import read
    from pendulum_env.lab import (
        DrivenLog,
        RecordingError,
        measure_amplitudes,
        measure_gate,
        measure_kater,
        measure_lengths,
    )
    from pendulum_env.study.sweep.journal import Journal

    def by_hand(path: Path) -> None:
        for read_table in (measure_amplitudes, measure_lengths, lambda path: measure_kater(path, 1.0)):
            with contextlib.suppress(RecordingError):
                print(read_table(path).text, file=io.StringIO())

    return {
        "Recording.read": (Recording.read, (RecordingError,)), "DrivenLog.read": (DrivenLog.read, (RecordingError,)),
        "gate": (measure_gate, (RecordingError,)), "Scene.load": (Scene.load, (SceneError,)),
        "by hand": (by_hand, (RecordingError,)),
        "load": (load, (SceneError,)), "result.json": (lambda path: load(with_text(path)), (SceneError,)),
        "rollout file": (read, (ValueError, OSError, EOFError)),
        "journal": (lambda path: Journal(path, {"scene": "lab"}, ("scene",)), (ValueError, OSError)),
    }


TOKENS = (b"nan", b"1e999", b"-", b";", b",", b"\t", b"\n", b'"', b"\xff", b"9" * 400, b"1:2:3", b"2024-13-45 25:61:61",
          b"12:34:56", b"#", b"run 99", b"Run " + b"9" * 5000, b"Hz", b"rate: 0 Hz", b"{", b"[" * 2000, b"null", b"<a>",
          "\N{MINUS SIGN}1".encode(), "²".encode(), "\N{ARABIC-INDIC DIGIT ONE}".encode(), b"rad", b"deg", b"\r",
          b"\x0c", b"time:1", b"0x10", b"1_0")
"""What is put into files of text."""


def spoilt(data: bytes, source: random.Random) -> bytes:
    """Return a file's bytes with up to three damages, some of which are words put into texts."""
    from archives import damaged

    for _ in range(source.randint(1, 3)):
        if source.random() < 0.6:
            place = source.randrange(len(data) + 1)
            left = source.choice((0, 0, 1, 5))
            data = data[:place] + source.choice(TOKENS) + data[place + left :]
        else:
            data = damaged(data, source) or b"0"
    return data


# --- cases ------------------------------------------------------------------------------------------------------------


def of_reader(case: Case, files: dict[str, list[bytes]], number: int) -> None:
    """Read a damaged file."""
    name = case.source.choice([*files])
    read, declared = readers()[name]
    case.data = spoilt(case.source.choice(files[name]), case.source)
    suffix = case.source.choice((".csv", ".txt", ".zip", ".xlsx", ".trk", ".json"))
    path = Path(f"input_{number}{suffix}")
    path.write_bytes(case.data)
    case.label = f"{name} of {len(case.data)} bytes"
    with contextlib.suppress(*declared):
        read(path)


def odd(source: random.Random) -> Any:
    """Return an odd value."""
    from keyword_kinds import VALUES

    return source.choice([*VALUES.values(), "rk4", "lab", "linear", 0.01, 1e-3, 3, -0.0, [1.0, 2.0], (0.1,),
                          {"linear": 1}])


def of_function(case: Case) -> None:
    """Call a public function with one to three keywords spoilt."""
    import gymnasium as gym
    from keyword_kinds import VALUES

    import integrators
    from pendulum_env import LabPendulumEnv, LabPendulumVectorEnv, Scene, audit, rollout, simplify

    source = case.source
    functions: dict[str, tuple[Callable[..., Any], dict[str, Any], tuple[str, ...]]] = {
        "rollout": (rollout, {"scene": "lab", "duration": 0.05, "dt": 0.01},
                    ("scene", "integrator", "angle", "velocity", "duration", "dt", "damping", "rtol", "atol", "control",
                     "length", "gravity", "diagnostics", "every", "speed_limit", "events", "compensated")),
        "LabPendulumEnv": (lambda **given: LabPendulumEnv(**given).reset(seed=0), {"dt": 0.01},
                           ("scene", "integrator", "damping", "dt", "substeps", "task", "rtol", "accuracy", "mass",
                            "speed_limit", "render_mode", "render_size", "diagnostics", "randomize", "sensor")),
        "LabPendulumVectorEnv": (lambda **given: LabPendulumVectorEnv(**given).reset(seed=0), {"num_envs": 2},
                                 ("num_envs", "scene", "integrator", "length", "dt", "substeps", "task", "randomize",
                                  "num_threads", "diagnostics", "speed_limit")),
        "reset": (lambda **given: LabPendulumEnv().reset(**given), {}, ("seed", "options")),
        "step": (lambda action=0.0: (env := LabPendulumEnv(), env.reset(seed=0), env.step(action)), {}, ("action",)),
        "Scene.from_dict": (lambda **given: Scene.from_dict({**Scene.from_dict({"name": "a"}).to_dict(), **given}), {},
                            ("name", "body", "medium", "effects", "gravity", "run")),
        "audit": (audit, {"scene": "vacuum", "amplitude": 0.1, "tolerance": 0.1},
                  ("scene", "amplitude", "tolerance", "effects")),
        "simplify": (simplify, {"scene": "vacuum", "amplitude": 0.1, "tolerance": 0.1},
                     ("scene", "amplitude", "tolerance", "duration", "complete")),
        "solve": (lambda **given: integrators.solve(lambda t, q, v: -q, **given),
                  {"q": 1.0, "v": 0.0, "times": [0.0, 0.1], "method": "rk4", "h": 0.05},
                  ("q", "v", "times", "method", "h", "rtol", "dense")),
    }
    name = source.choice([*functions])
    function, given, keywords = functions[name]
    changed = {key: odd(source) for key in source.sample(keywords, min(len(keywords), source.randint(1, 3)))}
    names = {id(value): name for name, value in VALUES.items()}
    case.label = f"{name}({', '.join(f'{key}={names.get(id(value)) or value}' for key, value in changed.items())})"
    try:
        function(**{**given, **changed})
    except (gym.error.Error, MemoryError, OSError):
        pass
    except (ValueError, TypeError, RuntimeError) as error:
        own = type(error).__module__.partition(".")[0] in ("pendulum_env", "integrators")
        asked = linecache.getline(*_last(error)).lstrip().startswith("raise ")
        if not own and not asked:
            raise


def _last(error: BaseException) -> tuple[str, int]:
    """Return the file and the line that raised an error."""
    last = traceback.extract_tb(error.__traceback__)[-1]
    return last.filename, last.lineno or 0


def of_command(case: Case) -> None:
    """Run a command with odd words; it must end with exit code 0, 1 or 2, and without a traceback."""
    import typer

    from pendulum_env import cli

    source = case.source
    commands: dict[str, Any] = typer.main.get_command(cli.app).commands  # type: ignore[attr-defined]
    name = source.choice([name for name in commands if name not in IGNORED])
    words = [name]
    values = ("", "x", "nan", "inf", "-1", "0", "1e308", "5e-324", "lab", "rk4", "vacuum", "a,b", "=", "length=", "1:2",
              "0.1", "9" * 400, "linear", "\N{GREEK SMALL LETTER THETA}", "\ud800", "missing.csv", "swing.csv",
              "scene.json", "none", "--", "0.01", "1", "2", "[1,2]", "{}", "null")
    for parameter in source.sample(commands[name].params, min(len(commands[name].params), source.randint(1, 4))):
        word = source.choice(values)
        if parameter.param_type_name == "option":
            words += [source.choice(parameter.opts)] + ([] if parameter.is_flag else [word])
        else:
            words.append(word)
    if any("--out" in each.opts for each in commands[name].params) and not {"--out", "-o"} & {*words}:
        words += ["--out", "out"]
    case.label = f"lab-pendulum {' '.join(map(ascii, words))}"
    before, sys.argv = sys.argv, ["lab-pendulum", *words]
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(said):
            cli.main()
    except SystemExit as end:
        if end.code not in (None, 0, 1, 2):
            raise AssertionError(f"exit code {end.code}") from None
    finally:
        sys.argv = before
    if "TimeUp" in said.getvalue():  # the alarm came within a callback of LLVM, which prints it and goes on
        raise TimeUp
    if "Traceback" in said.getvalue():
        raise AssertionError(said.getvalue()[-2000:])


# --- running ----------------------------------------------------------------------------------------------------------


@contextlib.contextmanager
def within(seconds: int) -> Iterator[None]:
    """Raise TimeUp in the body after so many seconds, where the system has alarms."""
    def stop(*_: object) -> None:
        raise TimeUp

    if hasattr(signal, "SIGALRM"):
        signal.signal(signal.SIGALRM, stop)
        signal.alarm(seconds)
    try:
        yield
    finally:
        if hasattr(signal, "SIGALRM"):
            signal.alarm(0)


def guard(folder: Path) -> Callable[[], None]:
    """Refuse, from now on, to change files outside of a folder and to start programs; return a function that ends it.

    The encoder of films may start, since ``compare --film`` draws one.
    """
    import imageio_ffmpeg

    ended: list[bool] = []
    encoder = imageio_ffmpeg.get_ffmpeg_exe()

    def inside(path: Any) -> bool:
        if isinstance(path, int):
            return True
        place = os.path.realpath(os.fsdecode(path))
        return place.startswith((str(folder) + os.sep, "/dev/null")) or place == str(folder)

    def hook(event: str, given: tuple[Any, ...]) -> None:
        if ended:
            return
        if event == "open" and isinstance(given[2], int) and given[2] & WRITES and not inside(given[0]):
            raise Escape(f"{given[0]} is opened for writing")
        if event in PATHS and not all(inside(path) for path in given[: PATHS[event]] if path is not None):
            raise Escape(f"{event} of {given[: PATHS[event]]}")
        if event in STARTS and given[0] != encoder:
            raise Escape(f"{event} of {given[:2]}")

    sys.addaudithook(hook)
    return lambda: ended.append(True)


def fault(case: Case, files: dict[str, list[bytes]], number: int, only: Sequence[str]) -> str:
    """Run a case and return what is wrong, "" if nothing is."""
    kind = case.source.choices([*only], [SHARES[name] for name in only])[0]
    try:
        with within(SLOW), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if kind == "reader":
                of_reader(case, files, number)
            elif kind == "function":
                of_function(case)
            else:
                of_command(case)
    except TimeUp:
        return f"more than {SLOW} s" if kind == "reader" else ""
    except KeyboardInterrupt:
        raise
    except BaseException:
        return traceback.format_exc(limit=-4)
    return ""


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=60.0, help="time after which no further case begins")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--case", type=int, help="the only case to run")
    parser.add_argument("--cases", type=int, default=10**9, help="largest number of cases")
    parser.add_argument("--only", nargs="+", choices=SHARES, default=[*SHARES], help="kinds of cases")
    parser.add_argument("--keep", type=Path, help="folder for inputs of readers that are finds")
    given = parser.parse_args()
    keep = given.keep.resolve() if given.keep else None
    if keep:
        keep.mkdir(parents=True, exist_ok=True)
    finds, number = [], -1
    place = Path(tempfile.mkdtemp(prefix="fuzzing-")).resolve()
    os.environ.update(HOME=str(place), XDG_CACHE_HOME=str(place / "cache"), LAB_PENDULUM_CACHE=str(place / "cache"),
                      MPLCONFIGDIR=str(place / "matplotlib"), TMPDIR=str(place))
    tempfile.tempdir = str(place)
    os.chdir(place)
    try:
        files = corpus()
        Path("swing.csv").write_bytes(files["Recording.read"][0])
        Path("scene.json").write_bytes(files["Scene.load"][0])
        import matplotlib.pyplot  # noqa: F401  looks for its fonts with programs, before that is refused

        from pendulum_env.common.version import version

        version()  # asks git once, for the same reason

        end, begun = guard(place), time.monotonic()
        for number in [given.case] if given.case is not None else range(given.cases):
            if time.monotonic() - begun > given.seconds:
                break
            case = Case(given.seed, number)
            wrong = fault(case, files, number, given.only)
            if wrong:
                finds.append((number, case.data))
                print(f"--- case {number}, {case.label}\n{wrong}", flush=True)
            for left in place.glob("input_*"):
                left.unlink()
        end()
    finally:
        os.chdir(place.parent)
        print(f"{number + 1 if given.case is None else 1} cases with seed {given.seed}, {len(finds)} finds")
        shutil.rmtree(place, ignore_errors=True)
    sys.exit(1 if finds else 0)


if __name__ == "__main__":
    main()
