"""Tests of ``lab-pendulum``: files written, text printed, and errors."""

from __future__ import annotations

import hashlib
import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import pytest
import typer
from command_line import Here, table
from folder_contents import contents

from pendulum_env import SCENES, cli
from pendulum_env.cli import console
from pendulum_env.common import version
from pendulum_env.common.progress import Progress
from pendulum_env.common.texts import for_csv
from pendulum_env.envs.limits import IDS
from pendulum_env.study.compare import Comparison
from pendulum_env.study.lists.tables import TABLES


def run(*words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run a command in a process of its own, interpreted."""
    return subprocess.run([sys.executable, "-m", "pendulum_env", *words], capture_output=True, text=True, cwd=cwd,
                          env={**os.environ, "COLUMNS": "200", "LAB_PENDULUM_BACKEND": "python"})






@pytest.mark.slow
def test_compare_does_the_exercise(tmp_path: Path, run_here: Here) -> None:
    code, printed, said = run_here(
        "compare", "--scene", "exercise", "--damping", "none", "--integrators", "forward_euler,symplectic_euler",
        "--dt", "0.01", "--duration", "0.1", "--out", "results")
    assert code == 0, said
    assert "forward_euler" in printed
    written = {path.name for path in (tmp_path / "results").iterdir()}
    assert {"angle.png", "velocity.png", "phase.png", "energy.png", "comparison.csv", "drift.csv",
            "comparison.mp4"} <= written
    facts, rows = table(tmp_path / "results" / "drift.csv")
    assert facts["Software"].startswith("lab-pendulum ")
    assert "compare" in facts["Command"]
    assert [row["method"] for row in rows] == ["forward_euler", "symplectic_euler"]
    assert set(os.listdir(tmp_path)) == {"results"}


@pytest.mark.slow
def test_compare_takes_a_scene_file_and_numbers_of_damping(
    tmp_path: Path, run_here: Here, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Comparison, "pictures", lambda comparison: {})
    SCENES["exercise_large"].save(tmp_path / "mine.json")
    code, _, said = run_here("compare", "--scene", "mine.json", "--damping", "linear:gamma=0.3", "--integrators", "rk4",
                             "--angle", "20", "--duration", "3", "--set", "length=0.5", "--no-film", "--out", "x")
    assert code == 0, said
    scene = json.loads(table(tmp_path / "x" / "drift.csv")[0]["scene"])
    assert scene["body"]["length"] == 0.5
    assert {"effect": "linear_drag", "gamma": 0.3, "boundary_layer": False} in scene["effects"]
    assert not (tmp_path / "x" / "comparison.mp4").exists()


@pytest.mark.slow
def test_compare_lays_a_recording_over_the_curves(
    tmp_path: Path, run_here: Here, recordings: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Comparison, "pictures", lambda comparison: {"angle": "angle"})
    code, printed, said = run_here(
        "compare", "--scene", "exercise_large", "--set", "length=0.663", "--set", "mass=0.0415", "--integrators", "rk4",
        "--duration", "20", "--no-film", "--recording", str(recordings / "video_decay_65cm.txt"), "--out", "x")
    assert code == 0, said
    assert "Reynolds number" in printed
    assert (tmp_path / "x" / "angle.png").exists()


@pytest.mark.slow
def test_cost_effects_record_and_list(tmp_path: Path, run_here: Here) -> None:
    code, printed, said = run_here("cost", "--scene", "vacuum", "--integrators", "rk4,velocity_verlet", "--duration",
                                   "2", "--repeats", "1", "--growth", "2", "--out", "c")
    assert code == 0, said
    assert "Each further digit costs" in printed
    assert "angle error grows" in printed
    written = {path.name for path in (tmp_path / "c").iterdir()}
    assert {"cost.png", "cost_errors.png", "cost.csv", "cost.jsonl", "growth.png", "growth.csv"} <= written
    code, printed, said = run_here("effects", "--scene", "textbook", "--angle", "30", "--tolerance", "1e-2",
                                   "--out", "e")
    assert code == 0, said
    assert any(line.split()[:1] == ["(gravity)"] and "matters" in line for line in printed.splitlines())
    assert "Simplified equation" not in printed
    code, _, said = run_here("record", "--scene", "lab", "--duration", "0.4", "--size", "120", "--out", "f/film.gif")
    assert code == 0, said
    assert (tmp_path / "f" / "film.gif").stat().st_size > 0
    assert "| coulomb_friction |" in run_here("list", "effects", "--markdown")[1]
    assert run_here("--version")[1].startswith("lab-pendulum ")


BAD = {
    "scene": (["compare", "--scene", "exercize"], "did you mean exercise"),
    "integrator": (["compare", "--integrators", "rk5"], "did you mean rk4"),
    "the same twice": (["compare", "--integrators", "rk4,rk4"], "twice"),
    "damping": (["compare", "--damping", "quad"], "did you mean quadratic"),
    "damping number": (["compare", "--damping", "linear:gamma=x"], "gamma must be a finite number"),
    "parameter": (["compare", "--set", "lenght=1"], "did you mean length"),
    "parameter without =": (["compare", "--set", "length"], "name=value"),
    "dt": (["compare", "--dt", "0"], "dt must be a finite number above 0"),
    "duration nan": (["compare", "--duration", "nan"], "duration must be"),
    "recording": (["compare", "--recording", "none.txt"], "none.txt"),
    "malformed recording": (["compare", "--recording", "bad.txt"], "line 4"),
    "cost method": (["cost", "--integrators", "verlett"], "did you mean"),
    "tolerance": (["effects", "--tolerance", "0"], "tolerance must be"),
    "film": (["record", "--out", "film.avi"], ".mp4 or .gif"),
    "gif rate": (["record", "--duration", "0.1", "--fps", "60", "--out", "film.gif"], "50"),
    "cost method twice": (["cost", "--integrators", "rk4,rk4"], "rk4 is named twice"),
    "cost scheduler": (["cost", "--scheduler", "nowhere"], "Dask"),
    "cost too long": (["cost", "--duration", "1e18"], "too long for this study"),
    "dt tiny": (["compare", "--dt", "1e-300"], "take longer steps"),
    "dt below all": (["compare", "--dt", "1e-320"], "Error: "),
    "duration huge": (["compare", "--duration", "1e18"], "a shorter run"),
    "length huge": (["compare", "--set", "length=1e200"], "moment of inertia"),
    "effects a number": (["compare", "--set", "effects=5"], "must be a list of effects, not 5.0"),
    "name a number": (["compare", "--set", "name=5"], "name must be text, not 5.0"),
    "damping none and more": (["compare", "--damping", "none+linear"], "damping='none' cannot be combined"),
    "number of no damping": (["compare", "--scene", "lab", "--damping", "quadratic", "--set", "gamma=1"], "leaves out"),
    "film's control": (["record", "--control", "5"], "control must be between -1 and 1"),
    "film's angle": (["record", "--angle", "1e300"], "angle must be between"),
    "film's dt": (["record", "--dt", "1e-320"], "take longer steps"),
    "list": (["list", "integrator"], "did you mean integrators"),
    "folder": (["compare", "--integrators", "rk4", "--duration", "1", "--out", "file/x"], "cannot be written"),
}


@pytest.mark.parametrize("words", [
    ["cost", "--growth", "1e12"], ["cost", "--scene", "windy", "--growth", "10"],
    ["cost", "--integrators", "rk4", "--repeats", "0"], ["section", "--points", "0"], ["section", "--over", "x=0:1:2"],
    ["stress", "--cases", "none of these"], ["exercise", "--length", "-1"],
    ["effects", "--tolerance", "0", "--out", "e"], ["compare", "--duration", "-1"],
    ["record", "--out", "file/film.gif"], ["compare", "--out", "o" * 300], ["compare", "--stability", "-i", "rk5"],
    ["auto", "--duration", "0"],
], ids=" ".join)
def test_everything_is_checked_before_anything_is_made_or_computed(
    words: list[str], tmp_path: Path, run_here: Here, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Kinds of refusals that once came late; every option of every command is in test_keyword_options.py."""
    told: list[float] = []
    monkeypatch.setattr(console, "progress_bar", lambda _: nullcontext(lambda done, _: told.append(done)))
    (tmp_path / "file").write_text("kept")
    before = contents(tmp_path)
    code, printed, said = run_here(*words)
    assert (code, printed) == (2, "")
    assert said.count("Error: ") == 1
    assert contents(tmp_path) == before
    assert not any(told)


@pytest.mark.parametrize(("error", "said"), [
    (ValueError("a fault of mine"), "Error: a fault of mine"),
    (SystemExit(0), "ended the command by sys.exit(), so that nothing more was written")])
def test_a_command_of_ones_own_that_fails_says_so_and_where_with_debug(
    error: BaseException, said: str, run_here: Here, monkeypatch: pytest.MonkeyPatch
) -> None:
    def mine(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("pendulum_env.web.document.write", mine)
    code, _, told = run_here("web", "--out", "a.html")
    assert code == 2
    assert said in told
    assert "Traceback" not in told
    if isinstance(error, ValueError):
        code, _, told = run_here("--debug", "web", "--out", "a.html")
        assert code == 2
        assert "in mine" in told
        assert told.strip().endswith(said)
        assert "Traceback" not in run_here("--debug", "web", "--help")[2]


@pytest.mark.slow
def test_a_step_that_exits_is_refused_before_the_report(tmp_path: Path, run_here: Here) -> None:
    (tmp_path / "step.py").write_text("import sys\nsys.exit(0)\n")
    code, _, said = run_here("exercise", "--own-step", "step.py")
    assert code == 2
    assert "The step failed with SystemExit" in said
    assert {path.name for path in tmp_path.iterdir()} == {"step.py"}


TYPED = ("scene",)
"""Cases that run as a process of their own; the others call the command's function."""


@pytest.mark.parametrize("case", [pytest.param(case, marks=[pytest.mark.slow] if "scheduler" in case else [])
                                  for case in BAD])
def test_bad_input_one_sentence_no_traceback_files_as_they_were(
    case: str, tmp_path: Path, run_here: Here
) -> None:
    words, said = BAD[case]
    (tmp_path / "bad.txt").write_text("time\tangle\n0.0\t1.0\n0.1\t0.9\n0.2\tx\n0.3\t0.7\n")
    (tmp_path / "file").write_text("kept")
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    if case in TYPED:
        done = run(*words, cwd=tmp_path)
        code, told = done.returncode, done.stderr
    else:
        code, _, told = run_here(*words)
    assert code == 2
    assert "Traceback" not in told
    assert said in told
    assert len(told.strip().splitlines()) == 1
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()} == before


@pytest.mark.parametrize(
    ("error", "said"),
    [(OverflowError("range"), "Error: a number is too large or too small to compute with (range)"),
     (ZeroDivisionError("by zero"), "(by zero)"), (MemoryError(), "not enough memory")],
)
def test_what_no_check_foresaw_ends_with_one_sentence(
    error: Exception, said: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(**_: object) -> None:
        raise error

    monkeypatch.setattr(cli, "app", fail)
    with pytest.raises(SystemExit) as stop:
        cli.main()
    assert stop.value.code == 2
    assert said in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals differ")
def test_interrupted_films_leave_the_old_one(tmp_path: Path) -> None:
    film = tmp_path / "film.mp4"
    film.write_bytes(b"old")
    process = subprocess.Popen(
        [sys.executable, "-m", "pendulum_env", "record", "--duration", "1000", "--out", str(film)],
        stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True,
        # A process started in the background ignores interrupts, and its children would too.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
    deadline = time.monotonic() + 60.0
    # Not before frames are written: Python ignores an interrupt that falls into a callback of an import.
    while not any(part.stat().st_size for part in tmp_path.iterdir() if part != film) and time.monotonic() < deadline:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Interrupted" in said
    assert film.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["film.mp4"]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals differ")
def test_an_interrupt_within_exec_ends_with_the_exit_code(tmp_path: Path) -> None:
    """Python itself ends with a signal then, though the interrupt was handled: dataclasses and namedtuples use exec."""
    (tmp_path / "interrupted.py").write_text("""
import sys
from pendulum_env import cli
def app(**_):
    try:
        exec("raise KeyboardInterrupt")
    except KeyboardInterrupt:
        return 130
cli.app = app
cli.main()
""")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}
    assert subprocess.run([sys.executable, "-m", "interrupted"], env=environment, timeout=60).returncode == 130


@pytest.mark.slow
def test_a_warning_is_one_sentence_said_once(tmp_path: Path) -> None:
    done = run("compare", "--scene", "kapitza", "--dt", "0.01", "--duration", "0.1", "--no-film", "--out", "results",
               "--integrators", "rk4,heun", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (warning,) = [line for line in done.stderr.splitlines() if "arning" in line]
    assert warning.startswith("Warning: A step of 0.01 s covers 1 rad of the phase of vertical_drive, ")


OPTIONS: Mapping[str, Any] = typer.main.get_command(cli.app).commands  # type: ignore[attr-defined]
ELSE = {"--out": "a folder or, of commands that write one file, it", "-o": "the same", "--scene": "one or several",
        "--language": "of a program, or of a report's sentences",
        "--period-error": "of the given period, or of each period in a table by hand",
        **dict.fromkeys(("--angle", "--columns", "--duration", "--policy", "--rate", "--seed", "--unit"),
                        "the same of a source of acquire, whose help names the sources that have it")}
"""Options of two help texts -> the reason."""
PLURALS = {"--angle": "angles of a source of acquire", "--amplitude": "--amplitudes are readings by hand",
           "--length": "--lengths is a table of periods against lengths"}
"""Options beside which there is one with an s -> the reason."""


def test_an_option_means_the_same_in_every_command() -> None:
    """One help text and one short form for each name; and no command takes a plural beside a singular."""
    declared: dict[str, set[tuple[object, ...]]] = {}
    for command in OPTIONS.values():
        for one in command.params:
            if one.param_type_name == "option" and one.name != "help":
                for name in one.opts:
                    declared.setdefault(name, set()).add((*one.opts, one.help))
    assert {name for name, meanings in declared.items() if len(meanings) > 1} - {*ELSE} == set()
    assert {name for name in declared if f"{name}s" in declared} <= {*PLURALS}
    for names, short in (("--out", "-o"), ("--integrators", "-i")):
        assert all(short in one.opts for command in OPTIONS.values() for one in command.params if names in one.opts)


@pytest.mark.parametrize(("words", "said"), [
    ("compare --dt 0,01", "'0,01' is not a number; write 0.01."),
    ("compare --dt soon", "'soon' is not a number, as 0.5 is."),
    ("section --points 1,5", "'1,5' is not a whole number, as 100 is."),
    ("code --integrator rk4", "No such option: --integrator (Possible options: --integrators)"),
    ("web --scenes all", "--scene)"), ("exercise --step mine.py", "--own-step)"),
    ("section --steps 20", "--steps-per-period)"), ("fit --steps 20", "--walker-steps)"),
    ("effects --amplitude 3", "--angle"), ("kode", "Did you mean 'code'"), ("help kode", "Did you mean 'code'"),
    ("compare -i zzz", "There is no integrator 'zzz'; there are "),
    ("cost --scene zzz", f"; there are {len(SCENES)}, such as "),
    ("code -i rk4,heun", "runs one integrator, not rk4, heun"),
])
def test_an_error_quotes_what_was_typed_and_names_the_nearest(words: str, said: str, run_here: Here) -> None:
    code, printed, told = run_here(*words.split())
    assert (code, printed) == (2, "")
    assert said in told
    assert told.startswith("Error: ")
    assert told.count("\n") == 1, "one sentence, without a box"
    assert len(told) < 700, "no list of a hundred names"


def test_names_have_any_case_and_paths_their_own(tmp_path: Path, run_here: Here) -> None:
    plain = run_here("code", "--scene", "vacuum", "--integrators", "rk4")
    assert plain[0] == 0
    assert run_here("code", "--scene", "VACUUM", "-i", "RK4", "--language", "Plain") == plain
    SCENES["vacuum"].save(tmp_path / "Mine.json")
    assert run_here("code", "--scene", "Mine.json", "-i", "Rk4", "--damping", "None") == plain
    assert run_here("list", "TASKS") == run_here("list", "tasks")


def test_help_in_three_ways(run_here: Here) -> None:
    whole, one = run_here("--help"), run_here("code", "--help")
    assert run_here("-h") == run_here("help") == whole
    assert run_here("code", "-h") == run_here("help", "code") == one
    assert "Usage: lab-pendulum code [OPTIONS]" in one[1]
    assert [code for code, _, _ in (whole, one)] == [0, 0]
    assert all(name in whole[1] for name in (*cli.COMMANDS, "--install-completion", "--debug"))


@pytest.mark.slow
@pytest.mark.parametrize(("words", "own"), [
    ("list", 1), *(pytest.param(words, 0, marks=pytest.mark.slow) for words in ("--help", "--version"))])
def test_a_short_answer_waits_for_no_import(words: str, own: int) -> None:
    """Beyond what Gymnasium and typer import, help imports no command, and a list nothing that computes or draws."""
    done = subprocess.run([sys.executable, "-c", f"""
import sys
import gymnasium, typer
before = {{name.partition(".")[0] for name in sys.modules}}
from pendulum_env import cli
sys.argv = ["lab-pendulum", "{words}"]
try:
    cli.main()
finally:
    loaded = {{name.partition(".")[0] for name in sys.modules}} - before - {{*sys.stdlib_module_names}}
    print(*loaded, *(name for name in sys.modules if name.startswith("pendulum_env.")), file=sys.stderr)
"""], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    loaded = {*done.stderr.split()}
    assert not {"rich", "numba", "llvmlite", "scipy", "matplotlib", "pygame", "PIL", "imageio_ffmpeg"} & loaded
    assert len({f"pendulum_env.cli.{name}" for name in cli.COMMANDS} & loaded) == own
    assert ("integrators" in loaded) == bool(own)


def test_debug_stands_before_or_behind_a_command(run_here: Here) -> None:
    for words in (("--debug", "code", "-i", "zzz"), ("code", "-i", "zzz", "--debug")):
        code, printed, told = run_here(*words)
        assert (code, printed) == (2, "")
        assert told.startswith("Traceback")
        assert "There is no integrator 'zzz'" in told.splitlines()[-1]
        assert "Error: There" in told.splitlines()[-1], "the error itself, no sentence behind it"
    assert run_here("code", "-i", "zzz")[2].startswith("Error: ")


def test_the_version_has_a_digest_of_the_sources(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The same for the same files, wherever they are and however their lines end; another for another byte."""
    house = tmp_path / "house"
    for name in ("integrators", "pendulum_env/common"):
        (house / name).mkdir(parents=True)
    for name in ("integrators", "pendulum_env"):
        (house / name / "a.py").write_bytes(b"x = 1\n")
    monkeypatch.setattr(version, "__file__", str(house / "pendulum_env" / "common" / "version.py"))
    digest = version.sources.__wrapped__  # not the cached one
    first = digest()
    assert first == hashlib.sha256(b"".join(name + b"/a.py\0x = 1\n" for name in (b"integrators", b"pendulum_env"))
                                   ).hexdigest()[:12]
    (house / "integrators" / "a.py").write_bytes(b"x = 1\r\n")
    assert digest() == first
    (house / "integrators" / "a.py").write_bytes(b"x = 2\n")
    assert digest() != first


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="shells differ")
@pytest.mark.parametrize(("typed", "shown"), [
    ("lab-pendulum cost -i rk4,dop8", "rk4,dop853"), *(pytest.param(*more, marks=pytest.mark.slow) for more in (
        ("lab-pendulum se", "section"), ("lab-pendulum code --scene exercise_l", "exercise_large"),
        ("lab-pendulum web --o", "--out")))])
def test_a_shell_completes_commands_options_scenes_and_methods(typed: str, shown: str) -> None:
    words = typed.split()
    environment = {"_LAB_PENDULUM_COMPLETE": "complete_bash", "COMP_WORDS": typed, "COMP_CWORD": str(len(words) - 1)}
    done = subprocess.run([sys.executable, "-m", "pendulum_env"], env={**os.environ, **environment}, text=True,
                          capture_output=True, timeout=60)
    assert done.stdout.split() == [shown], done.stderr


@pytest.mark.slow
def test_the_completion_of_a_shell_is_printed() -> None:
    undetected = {**os.environ, "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"}
    done = subprocess.run([sys.executable, "-m", "pendulum_env", "--show-completion", "bash"], text=True,
                          capture_output=True, timeout=60, env=undetected)
    assert "complete -o default -F _lab_pendulum_completion lab-pendulum" in done.stdout, done.stderr


@pytest.mark.parametrize("words", [
    "measure", pytest.param("compare --duration 0.2 -i rk4 --no-film", marks=pytest.mark.slow),
    "record --duration 0.1 --size 64", "code", "list",
    "web --scene vacuum -i rk4"])
def test_success_is_silent_on_stderr(words: str, run_here: Here) -> None:
    code, printed, told = run_here(*words.split())
    assert (code, told) == (0, "")
    assert ("No recording is given, so the simulated one" in printed) == (words == "measure")


@pytest.mark.parametrize("name", [name for name, command in OPTIONS.items() if any(
    "--out" in one.opts for one in command.params) and name not in ("acquire", "record", "web")])
def test_a_folder_that_cannot_be_is_refused_alike(name: str, tmp_path: Path, run_here: Here) -> None:
    (tmp_path / "file").write_text("kept")
    code, printed, told = run_here(name, "-o", "file/x")
    assert (code, printed, told) == (2, "", "Error: The output folder file/x cannot be written: Not a directory.\n")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize("what", ["", *TABLES, "ids", "settings", "integrators --scene lab", "scenes --scene lab"])
def test_a_list_is_one_screen_and_all_of_it_more(what: str, run_here: Here, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    code, printed, _ = run_here("list", *what.split())
    assert code == 0
    lines = printed.splitlines()
    assert len(lines) < 24
    assert max(map(len, lines)) <= 80
    if what == "ids":
        assert [line.split()[0] for line in lines[:-1]] == list(IDS)
    if what in TABLES:
        assert all(row[0] in " ".join(printed.split()) for row in TABLES[what]().rows)
    if what != "scenes --scene lab":
        assert len(run_here("list", *what.split(), "--all")[1]) > len(printed)
        assert "--all" in lines[-1]


# --- results as JSON --------------------------------------------------------------------------------------------------

JSON: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "compare": ("--scene exercise --integrators forward_euler,rk4 --dt 0.05 --duration 4 --no-film --out out",
                ("comparison", "drift")),
    "compare --stability": ("--integrators rk4,velocity_verlet --out out", ("stability",)),
    "cost": ("--scene vacuum --integrators heun --duration 0.1 --repeats 1 --growth 1 --out out", ("cost",)),
    "effects": ("--scene textbook --angle 30 --tolerance 1e-2 --out out", ("effects",)),
    "section": ("--points 50 --transient 2 --steps-per-period 20 --out out", ("section",)),
    "section --over drive_torque=1:1.1:3": ("--points 120 --transient 2 --steps-per-period 20 --out out",
                                            ("bifurcation",)),
    "section --basins 5": ("--transient 2 --steps-per-period 20 --out out", ("basins",)),
    "stress": ("--cases upright_for_a_moment --integrators rk4,heun --out out", ("stress",)),
    "auto": ("--scene vacuum --accuracy 1e-3 --duration 0.2", ()),
}
"""Commands of studies -> options of a short run, and the tables that it writes."""


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace the drawing of figures, which takes seconds."""
    monkeypatch.setattr("pendulum_env.notebook.figure_of", lambda *_: None)
    monkeypatch.setattr("pendulum_env.plots.style.save_all", lambda *_: [])


def numbers(cells: Iterable[Any]) -> list[Any]:
    """Return cells of a CSV file, or values of JSON, as numbers where they are numbers; None for a missing one."""
    def one(cell: Any) -> Any:
        try:
            value = float(cell)
        except (TypeError, ValueError):
            return cell or None
        return None if math.isnan(value) else value

    return [one(cell if not isinstance(cell, bool) else str(cell)) for cell in cells]


@pytest.mark.quick("compare", "effects", "stress")
@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("name", [
    pytest.param(name, marks=pytest.mark.slow if name == "section --basins 5" else ()) for name in JSON])
def test_json_is_all_that_is_printed_and_has_the_numbers_of_the_files(
    name: str, tmp_path: Path, run_here: Here
) -> None:
    words = [*name.split(), *(word.replace("upright_for_a_moment", "upright for a moment")
                              for word in JSON[name][0].split())]
    code, printed, _ = run_here(*words, "--json")
    assert code == 0
    result = json.loads(printed)
    assert printed.count("\n") == 1
    assert result["complete"] is True
    assert result["provenance"]["Software"].startswith("lab-pendulum ")
    assert all((tmp_path / path).is_file() for path in result["files"])
    assert {Path(path).stem for path in result["files"] if path.endswith(".csv")} == set(JSON[name][1])
    for stem in JSON[name][1]:
        facts, rows = table(tmp_path / "out" / f"{stem}.csv")
        columns = result["tables"][stem]["columns"]
        assert list(columns) == list(rows[0])
        assert list(result["tables"][stem]["units"]) == list(columns)
        for column, values in columns.items():
            written = [for_csv(value) if isinstance(value, str) else value for value in values]
            assert numbers(written) == numbers(row[column] for row in rows), column
        assert {key: facts[key] for key in result["provenance"]} == result["provenance"]
    if name == "effects":
        assert result["simplification"]["removed"] == []
        assert result["simplification"]["within"] is True
    if name == "cost":
        _, rows = table(tmp_path / "out" / "growth.csv")
        errors = result["growth"]["tables"]["growth"]["columns"]["angle_error_rad"]
        assert numbers(errors) == [float(row["angle_error_rad"]) for row in rows]
    if name.split()[0] in ("compare", "effects", "stress", "auto"):  # others take long, or print times
        code, plain, _ = run_here(*words)
        assert code == 0
        assert all(" ".join(line.split()) in " ".join(plain.split()) for line in result["text"].splitlines())


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(("command", "options", "column"), [
    ("stress", "--cases upright_for_a_moment --integrators rk4,heun", "outcome"),
    ("cost", "--scene vacuum --integrators rk4,heun --duration 1 --repeats 1", "angle_error_rad"),
])
def test_after_an_interrupt_json_is_that_of_the_results_so_far(
    command: str, options: str, column: str, run_here: Here, monkeypatch: pytest.MonkeyPatch
) -> None:
    @contextmanager
    def bar(_title: str) -> Iterator[Progress]:
        def tell(done: float, _activity: str) -> None:
            if done > 0.4:
                raise KeyboardInterrupt
        yield tell

    monkeypatch.setattr(console, "progress_bar", bar)
    words = [word.replace("upright_for_a_moment", "upright for a moment") for word in options.split()]
    code, printed, _ = run_here(command, *words, "--json", "--out", "out")
    assert code == 130
    result = json.loads(printed)
    assert result["complete"] is False
    assert result["provenance"]["Complete"] == "false"
    assert 0 < len(result["tables"][command]["columns"][column]) < (2 if command == "stress" else 60)


def test_a_list_of_cases_is_no_result(run_here: Here) -> None:
    code, printed, said = run_here("stress", "--list", "--json")
    assert (code, printed) == (2, "")
    assert "leave out --json" in said
