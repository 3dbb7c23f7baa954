"""Every command that a README prints is run, as it stands or with what makes it shorter, and none is missing here."""

from __future__ import annotations

import importlib
import json
import math
import re
import shlex
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from check_all import check_all
from command_line import Here
from drawn_films import NAMES, draw
from PIL import Image
from readme_code import READMES, ROOT, without_code

from pendulum_env.lab.simulated import FILE

BLOCKS = [block for page in READMES.values() for block in re.findall(r"```sh\n(.*?)```", page, flags=re.S)]
INLINE = [" ".join(text.split()) for page in READMES.values() for text in re.findall(r"`([^`]+)`", without_code(page))]
COMMANDS = {text for text in INLINE if re.match(r"lab-pendulum \w+ .|python (examples|tests)/", text)} | {
    line for block in BLOCKS for line in block.splitlines() if "&&" not in line}
BY_HAND = {"lengths.csv": "length (cm),10 T (s)\n20,8.97\n40,12.69\n60,15.54\n80,17.94\n",
           "kater.csv": "position (cm),T1 (s),T2 (s)\n0,1.990,1.970\n10,2.001,2.001\n20,2.012,2.032\n",
           "cursor.csv": "time (s),amplitude (deg)\n0.60,-29.5\n4.22,-25.5\n7.83,-22.0\n11.42,-19.5\n15.00,-17.0\n",
           "phyphox.csv": '"Time (s)","Gyroscope x (rad/s)","Gyroscope y (rad/s)","Gyroscope z (rad/s)"\n' + "".join(
               f"{k / 50:E},0,0,{-2.6 * math.exp(-0.02 * k / 50) * math.sin(5.27 * k / 50):E}\n" for k in range(1000))}
"""Tables that commands read: by hand, and of a phone's gyroscope."""
PREPARED = "lab-pendulum fit swing.txt --length 0.65 --length-error 0.01 --mass 0.0415"
"""Makes what the comparison with a recording takes, beside the recording itself."""
SHORTER = {
    "lab-pendulum fit --mass 0.01 --radius 0.02 --effects linear+quadratic --read until=10.6 --posterior":
        "--walker-steps 30",
    "lab-pendulum list integrators": "", "lab-pendulum list integrators --all": "",
    "lab-pendulum list formats --all": "", "lab-pendulum list sources --all": "",
    "lab-pendulum list ids --all": "", "lab-pendulum list settings --all": "", "lab-pendulum list units --all": "",
    "lab-pendulum acquire --help": "",
    "lab-pendulum acquire": "--headless --duration 0.3",
    "lab-pendulum acquire --from bench": "--headless --duration 0.3",
    "lab-pendulum acquire --from virtual --headless --duration 30 --out swing.csv": "--duration 0.3",
    "lab-pendulum measure --oscillations 6": "",
    'lab-pendulum measure --amplitudes "0:30, 10:25.9, 20:22.2, 45:15.4"': "",
    "lab-pendulum measure lengths.csv": "", "lab-pendulum measure kater.csv --length 0.9938": "",
    "lab-pendulum code --integrators rk4 --scene exercise_large": "",
    "lab-pendulum code --integrators backward_euler --scene exercise": "",
    "lab-pendulum code --scene lab --integrators dop853 --language javascript": "",
    "lab-pendulum code --language engine": "",
    "lab-pendulum code --language engine --scene lab --integrators rk4": "",
    "lab-pendulum effects --scene lab --angle 30 --tolerance 1e-3": "",
    'lab-pendulum stress --cases "near the top" --integrators rk4,velocity_verlet,gauss4': "",
    "lab-pendulum compare --stability -i rk4,velocity_verlet,gauss4": "",
    "lab-pendulum auto --scene lab --accuracy 1e-6": "",
    "lab-pendulum fit --mass 0.01 --radius 0.02": "--effects quadratic",
    "lab-pendulum section --scene chaotic": "--points 1000 --transient 10 --steps-per-period 50",
    "lab-pendulum section --over drive_torque=1.06:1.087:540 --angle -90":
        "--over drive_torque=1.06:1.087:9 --points 180 --transient 10 --steps-per-period 50",
    "lab-pendulum section --basins 300 --set gamma=0.2 --set drive_torque=2 --set drive_rate=1 --velocities=-2:4":
        "--basins 9 --transient 5 --steps-per-period 50",
    "lab-pendulum section --basins 300 --set gamma=0.2 --set drive_torque=1.66 --set drive_rate=1":
        "--basins 9 --transient 5 --steps-per-period 50",
    "lab-pendulum web --out lab.html": "",
    "lab-pendulum web --scene all --integrators all --out everything.html": "--scene lab --integrators rk4",
    "lab-pendulum track swing.mp4 --length 0.353": "",
    "lab-pendulum fit swing.mp4 --mass 0.01 --radius 0.02": "--effects linear",
    "lab-pendulum exercise --recording swing.mp4": "",
    'lab-pendulum exercise --period 1.192 --length 0.353 --amplitudes "5:14.6cm, 14:10.7cm, 24:8.2cm, 43:5.3cm" '
    "--lengths lengths.csv": "",
    "lab-pendulum exercise --period 1.193 --period-error 0.002 --length 0.353 --amplitudes cursor.csv": "",
    "lab-pendulum exercise --recording phyphox.csv --length 0.353": "",
    PREPARED: "",
    'lab-pendulum exercise --recording swing.txt --length 0.353 --mass 0.04 --radius 0.0107 --name "Ada Lovelace"': "",
    "lab-pendulum compare --scene scene.json --recording swing.txt": "--integrators rk4 --duration 1",
    "lab-pendulum cost --scene vacuum --angle 57.3 --integrators velocity_verlet,rk4,dop853,exact --growth 1e5":
        "--integrators velocity_verlet --growth 300 --duration 2",
    "lab-pendulum record --scene exercise_large --damping none --set suspension=rod --angle 60 --integrators "
    "forward_euler,backward_euler,symplectic_euler --duration 5 --fps 20 --size 280 --out three_eulers.gif":
        "--duration 1",
    "lab-pendulum cost --scene exercise_large --angle 60 --integrators "
    "forward_euler,symplectic_euler,velocity_verlet,rk4,yoshida6a,kahan_li8,gauss4,dop853,verner9,taylor":
        "--integrators velocity_verlet,rk4,taylor --duration 2 --repeats 1",
}
"""Command -> the options that are added to it here, in place of those of the same name."""
ELSEWHERE = {
    "lab-pendulum track swing.mp4 --page": "bench/test_film_page.py",
    "lab-pendulum fit run1.csv run2.csv": "lab/test_driven.py",
    "lab-pendulum show --integrators forward_euler,symplectic_euler,rk4 --angle 45 --window 1600x900":
        "window/test_show.py",
    "lab-pendulum show --policy swing_up": "window/test_show.py",
    "python tests/support/guard.py": "engine/test_guard.py",
    "python tests/support/regenerate.py": "project/test_one_entry.py",
    "python tests/support/forty_digits.py": "hard_cases/test_predicted.py",
    "python tests/support/mutants.py": "hard_cases/test_predicted.py",
    "python tests/support/expectations.py": "hard_cases/test_expectations.py",
    "python tests/support/exponents.py": "hard_cases/test_hard_truths_chaos.py",
    "python tests/support/tolerances.py": "hard_cases/test_stress.py",
    "python tests/support/in_node.py": "engine/test_javascript.py",
    "lab-pendulum acquire --from serial:/dev/ttyUSB0 --counts 2400": "bench/test_serial_port.py",
    "lab-pendulum acquire --from serial:/dev/ttyACM0": "bench/test_serial_port.py",
    "lab-pendulum acquire --from bench:serial:/dev/ttyACM0 --scene my_bench.json": "bench/test_bench_source.py",
    "python tests/fuzzing/fuzz.py --seconds 60": "fuzzing/test_fuzz.py",
}
"""Command -> the file of tests that runs it."""
EXAMPLES = {command for command in COMMANDS if re.match(r"python examples/\d", command)}
"""Commands of examples, all of which test_examples.py runs, in a folder of their own."""
BENCHMARKS = {command for command in COMMANDS if command.startswith("python examples/")} - EXAMPLES


def test_every_command_is_here() -> None:
    assert {*SHORTER, *ELSEWHERE} == COMMANDS - BENCHMARKS - EXAMPLES
    assert all((ROOT / shlex.split(command)[1]).is_file() for command in EXAMPLES)
    assert all((ROOT / "tests" / name).exists() for name in ELSEWHERE.values())


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("film") / "swing.mp4"
    draw(replace(NAMES["plain"], seconds=6.0), path)
    return path


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("command", [command for command in SHORTER if command != PREPARED])
def test_it_runs(
    command: str, tmp_path: Path, film: Path, run_here: Here, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In this process, which has imported all; compiled, where that is the usual.

    The command that PREPARED names runs before the one that takes what it makes.
    """
    monkeypatch.delenv("LAB_PENDULUM_BACKEND")

    def run(command: str) -> None:
        code, printed, said = run_here(*shlex.split(command)[1:])
        assert code == 0, said
        assert printed

    shorter = SHORTER[command]
    shutil.copy(FILE, tmp_path / "swing.txt")
    if "swing.mp4" in command:
        shutil.copy(film, tmp_path)
    for name, text in BY_HAND.items():
        (tmp_path / name).write_text(text)
    if "scene.json" in command:
        run(PREPARED)
        shutil.copy(tmp_path / "out" / "fit" / "scene.json", tmp_path)
    for name in re.findall(r"--\S+", shorter):
        command = re.sub(rf" {name}[ =]\S+", "", command)
    run(f"{command} {shorter}")


@pytest.mark.slow
def test_benchmarks_are_there_and_find_what_they_import(monkeypatch: pytest.MonkeyPatch) -> None:
    """What they measure takes minutes each, so they are not run here; what needs JAX, tests/jax imports and runs."""
    def check(path: Path) -> None:
        with monkeypatch.context() as patch:
            patch.syspath_prepend(str(path.parent))
            assert importlib.import_module(path.stem).__doc__

    paths = dict.fromkeys(ROOT / shlex.split(command)[1] for command in sorted(BENCHMARKS))
    check_all([path for path in paths if "\nimport jax\n" not in path.read_text(encoding="utf-8")], check)


def test_each_picture_is_what_a_command_of_a_readme_draws() -> None:
    """By what it says of itself; no path of the machine that drew it is in there."""
    said = " ".join(" ".join(page.split()) for page in READMES.values())

    def check(path: Path) -> None:
        with Image.open(path) as picture:
            info = picture.info
        command = json.loads(info["comment"])["Command"] if path.suffix == ".gif" else info["Command"]
        assert path.name in said
        assert command in said

    check_all(sorted((ROOT / "examples" / "figures").iterdir()), check)
