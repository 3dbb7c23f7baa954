"""Tests that files which are read are never executed, whatever they contain."""

from __future__ import annotations

import ast
import json
import os
import pickle
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from planted import Planted, code
from syntax_trees import nodes_of

import integrators
import pendulum_env
from pendulum_env import SCENES, Scene, SceneError
from pendulum_env.engine.generate import batch_program, program
from pendulum_env.engine.growing_file import read

MAY_RUN = {
    "pendulum_env/bench/device.py": "pickles the caller's settings for the virtual board's process, which it starts",
    "pendulum_env/bench/virtual_board.py": "unpickles what the process that started it has just written to its input",
    "pendulum_env/cli/__init__.py": "imports the module of a command, one of the names in its own list",
    "pendulum_env/cli/options.py": "imports modules of the package that it names itself, whose names a shell completes",
    "pendulum_env/common/sources.py": "texts that the package has written: programs, judges of tasks, and functions "
                                      "written anew from a user's own; and a user's source is compared with its code",
    "pendulum_env/engine/kernels.py": "the package's own generated text; machine code from a folder of one's own",
    "pendulum_env/engine/compiling.py": "the package's own generated text, without its arithmetic",
    "integrators/analysis/multistep_linear.py": "the package's own generated text",
    "integrators/solving/stepper.py": "the package's own generated text",
    "integrators/families/taylor.py": "the package's own generated text",
    "integrators/solving/own.py": "the lines of a step that the caller of from_step has written",
    "pendulum_env/engine/code.py": "the package's own generated text",
    "pendulum_env/testing/contract.py": "pickles that it has just made of the caller's environment",
    "pendulum_env/study/sweep/study.py": "a pickle that it has just made of the exception that the caller's run raised",
}
"""Files of the package that execute or unpickle text, and the functions that do so."""
RUNS = {"eval", "exec", "compile", "__import__", "import_module", "system", "popen", "run_path", "run_module"}
UNPICKLES = {"pickle", "marshal", "shelve", "dill", "cloudpickle", "joblib", "yaml"}


# --- what the package calls -----------------------------------------------------------------------------------------


def dangerous(path: Path) -> set[str]:
    """Return the functions in a source file that execute or unpickle text."""
    found: set[str] = set()
    for node in nodes_of(path):
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            names = [alias.name for alias in node.names] + [getattr(node, "module", None) or ""]
            found |= {name for name in names if name.partition(".")[0] in UNPICKLES}
        elif isinstance(node, ast.Call):
            name = node.func.id if isinstance(node.func, ast.Name) else getattr(node.func, "attr", "")
            literal = all(isinstance(each, ast.Constant) for each in node.args)
            of_re = isinstance(node.func, ast.Attribute) and getattr(node.func.value, "id", "") == "re"
            found |= {name} if name in RUNS and not literal and not of_re else set()
            found |= {"allow_pickle"} if any(each.arg == "allow_pickle" and ast.unparse(each.value) != "False"
                                             for each in node.keywords) else set()
    return found


@pytest.mark.slow
def test_nothing_else_runs_text_or_unpickles() -> None:
    roots = [Path(package.__file__).parent for package in (pendulum_env, integrators) if package.__file__]
    found = {path.relative_to(root.parent).as_posix(): dangerous(path) for root in roots for path in root.rglob("*.py")}
    for own in ("pendulum_env/__init__", "pendulum_env/lab/__init__", "pendulum_env/common/results",
                "pendulum_env/common/saved", "pendulum_env/notebook", "pendulum_env/bench/__init__"):
        found[f"{own}.py"] -= {"import_module"}  # of the package's own public names, pandas and xarray
    assert {name for name, calls in found.items() if calls} == MAY_RUN.keys()


# --- what files say -------------------------------------------------------------------------------------------------


READING = """
import json, os, sys
from pathlib import Path
import numpy as np, pendulum_env
from pendulum_env import Recording, Scene, rollout
from pendulum_env.auto import store
from pendulum_env.engine.generate import batch_program, program
from pendulum_env.study.sweep.journal import Journal
import integrators

folder, seen = Path(sys.argv[1]), []

def hook(event, given):
    if event == "exec":
        name = getattr(given[0], "co_filename", "a text")
        if not name.startswith(("<lab-pendulum", "<frozen")) and not (os.path.isfile(name) and str(folder) not in name):
            seen.append((event, name))
    elif event in ("pickle.find_class", "os.system", "subprocess.Popen"):
        seen.append((event, str(given[0])))

sys.addaudithook(hook)

def tried(work):
    try:
        work()
    except Exception as error:
        print(type(error).__name__)

for path in sorted(folder.iterdir()):
    tried(lambda: Scene.load(path))
    tried(lambda: pendulum_env.load(path))
    tried(lambda: rollout(str(path), duration=0.01, backend="python"))
    tried(lambda: Recording.read(path))
    tried(lambda: np.load(path, mmap_mode="r"))
    tried(lambda: store.load({"table": 1}, path))
    tried(lambda: Journal(path, {"scene": "lab"}, ("scene",)))
print(json.dumps(seen))
exec("1")
print(len(seen))
"""






def planted_files(folder: Path, trace: Path) -> None:
    """Return files of every kind that is read, with code wherever text may stand."""
    folder.mkdir(mode=0o700)
    text = code(trace)
    escaped = f'"""\n{text}\n"""'
    lab = SCENES["lab"].to_dict()
    scenes = {
        "name": {**lab, "name": escaped}, "medium": {**lab, "medium": {**lab["medium"], "name": escaped}},
        "number": {**lab, "gravity": text}, "effect": {**lab, "effects": [{"effect": text}]},
        "key": {**lab, text: 1.0}, "body": {**lab, "body": {**lab["body"], "suspension": text}},
        "choice": {"question": {"table": 1}, "answer": text}, "journal": {"sweep": {"scene": text}},
    }
    for name, content in scenes.items():
        (folder / f"{name}.json").write_text(json.dumps(content))
    (folder / "recording.csv").write_text(f"{text};{text}\n0.0;{text}\n0.1;1.0\n0.2;2.0\n0.3;1.0\n")
    (folder / "recording.txt").write_text(f"# {escaped}\n0 1\n0.1 2\n0.2 1\n0.3 2\n")
    (folder / "pickle.json").write_bytes(pickle.dumps(Planted(trace)))
    np.save(folder / "objects.npy", np.array([Planted(trace)], dtype=object), allow_pickle=True)
    run = Path(__file__).parent / "version_1" / "rollout.npz"
    with zipfile.ZipFile(run) as archive:
        whole = {name: archive.read(name) for name in archive.namelist()}
    result = json.loads(whole["result.json"])
    angle = result["result"]["angle"]
    planted = {
        "pickled": {**whole, "angle.npy": (folder / "objects.npy").read_bytes()},
        **{f"said_{i}": {**whole, "result.json": json.dumps({**result, "result": {**result["result"], **part}})}
           for i, part in enumerate((
               {"$class": text}, {"angle": {**angle, "dtype": text}}, {"angle": {**angle, "dtype": "|O"}},
               {"angle": {**angle, "$array": text}}, {"method": {"$method": text, "fingerprint": text}},
               {"ledger": {"$class": "Path.touch", "self": str(trace)}}, {"dt": {"$number": 1, "dtype": text}},
               {"dt": {"$float": text}}, {text: 1}, {"dt": {"$same": text}}))},
    }
    for name, members in planted.items():
        with zipfile.ZipFile(folder / f"{name}.zip", "w") as archive:
            for member, data in members.items():
                archive.writestr(member, data)


def test_what_files_say_is_not_run(tmp_path: Path) -> None:
    """Check with Python's audit events that reading a file executes, imports and starts nothing."""
    trace = tmp_path / "trace"
    planted_files(tmp_path / "files", trace)
    own = {**os.environ, "LAB_PENDULUM_CACHE": str(tmp_path / "files")}
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", READING, tmp_path / "files"], capture_output=True,
                          text=True, env=own)
    assert done.returncode == 0, done.stderr
    *refused, seen, found = done.stdout.splitlines()
    assert json.loads(seen) == []
    assert found == "1", "the hook does not tell of what is run"
    assert {"SceneError", "RecordingError", "StudyError", "ValueError"} <= {*refused}
    assert not trace.exists()


def test_names_from_a_file_stay_out_of_programs(tmp_path: Path) -> None:
    """Check that the names of a scene and a medium do not occur in generated programs."""
    lab, escaped = SCENES["lab"].to_dict(), '"""; raise SystemExit; """'
    named = Scene.from_dict({**lab, "name": escaped, "medium": {**lab["medium"], "name": "x' + code"}})
    for method in ("rk4", "velocity_verlet"):
        chosen = integrators.get(method)
        assert program(named, chosen).text == program(SCENES["lab"], chosen).text
        many = (chosen, ("energy",), frozenset({"inertia"}))
        assert batch_program(named, *many).text == batch_program(SCENES["lab"], *many).text
    with pytest.raises(SceneError):
        Scene.from_dict({**lab, "effects": [{"effect": "gravity", "__class__": "os.system"}]})


def test_a_path_with_nul_is_refused() -> None:
    """Check that a path with a NUL character is refused with an error that names the path."""
    for work in (Scene.load, SCENES["lab"].save):
        with pytest.raises(SceneError, match="characters without NUL"):
            work("lab.json\0.txt")


def test_records_with_objects_are_refused(tmp_path: Path) -> None:
    trace = tmp_path / "trace"
    np.save(tmp_path / "objects.npy", np.array([Planted(trace)], dtype=object), allow_pickle=True)
    with pytest.raises(ValueError, match=r"[Oo]bject"):
        read(tmp_path / "objects.npy")
    assert not trace.exists()
