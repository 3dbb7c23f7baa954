"""The Arduino sketches of the README: compiled for an Uno, and run in a simulated one with a pendulum on its shaft.

They need the system packages of ``PACKAGES`` and are skipped without them.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from boards import Board, acquired
from readme_code import READMES

from pendulum_env import SCENES, rollout
from pendulum_env.bench.sources.serial_port import SerialPort
from pendulum_env.lab import fit

PACKAGES = "gcc-avr avr-libc arduino-core-avr simavr libsimavr-dev"
ARDUINO = Path("/usr/share/arduino/hardware/arduino/avr")
UNO = ("-mmcu=atmega328p", "-DF_CPU=16000000L", "-DARDUINO=10819", "-DARDUINO_AVR_UNO", "-DARDUINO_ARCH_AVR",
       "-DDECIMAL_DIG=__DECIMAL_DIG__",  # which this compiler's float.h has in C only, and the core's String needs
       *(f"-I{ARDUINO / folder}" for folder in (
           "cores/arduino", "variants/standard", "libraries/Wire/src", "libraries/Wire/src/utility")))
FLAGS = ("-Os", "-ffunction-sections", "-fdata-sections", *UNO)
CPP = ("avr-g++", "-std=gnu++11", "-fpermissive", "-fno-exceptions", "-fno-threadsafe-statics", *FLAGS)
COUNTS, GAMMA = 2400, 0.05
LEVELS = ((1, 1), (1, 0), (0, 0), (0, 1))
"""Levels of the channels, count after count; both are high at count 0, as the internal pull-ups leave them."""

pytestmark = pytest.mark.slow


def sketch(name: str) -> str:
    """Return the text of a sketch of the README."""
    return re.findall(rf"<!-- sketch {name} -->\n```cpp\n(.*?)```", READMES["pendulum_env/bench/README.md"],
                      flags=re.S)[0]


@pytest.fixture(scope="session")
def core(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Compiled files of the Arduino core and the Wire library."""
    if not shutil.which("avr-g++") or not shutil.which("simavr") or not (ARDUINO / "libraries/Wire").is_dir():
        pytest.skip(f"compiling sketches needs the system packages {PACKAGES}")
    folder = tmp_path_factory.mktemp("core")
    sources = {language: [path for place in ("cores/arduino", "libraries/Wire/src", "libraries/Wire/src/utility")
                          for path in sorted((ARDUINO / place).glob(f"*.{language}"))] for language in ("c", "cpp")}
    subprocess.run(["avr-gcc", "-std=gnu11", "-w", *FLAGS, "-c", *sources["c"]], cwd=folder, check=True)
    subprocess.run([*CPP, "-w", "-c", *sources["cpp"]], cwd=folder, check=True)
    return sorted(folder.glob("*.o"))


@pytest.fixture
def firmware(core: list[Path], tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    """A sketch compiled as the Arduino IDE does, but with every warning an error."""
    (tmp_path / "sketch.cpp").write_text(sketch(request.param), encoding="utf-8")
    subprocess.run([*CPP, "-Wall", "-Wextra", "-Werror", "-include", "Arduino.h", "-c", "sketch.cpp"], cwd=tmp_path,
                   check=True)
    subprocess.run(["avr-gcc", "-Os", "-mmcu=atmega328p", "-Wl,--gc-sections", "sketch.o", *core, "-lm", "-o",
                    "sketch.elf"], cwd=tmp_path, check=True)
    return tmp_path / "sketch.elf"


def swing(turns: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Return times [s] and angles [rad], one each 0.1 ms, of the bob that hangs for half a second and then swings.

    With ``turns`` it goes over the top several times, both ways.
    """
    time = np.arange(0.0, 10.0, 1e-4)
    if turns:
        return time, 15.0 * np.sin(np.maximum(time - 0.5, 0.0)) ** 2 - 12.0 * np.sin(np.maximum(time - 6.0, 0.0)) ** 2
    motion = rollout("lab", angle=1.0, velocity=0.0, duration=9.5, dt=1e-4, diagnostics=(),
                     damping={"linear": {"gamma": GAMMA}})
    lifted = 1.0 - np.cos(np.linspace(0.0, np.pi / 2, 2000))
    return time, np.concatenate([np.zeros(3000), lifted, motion.angle])[:len(time)]


def pulses(time: np.ndarray, count: np.ndarray) -> str:
    """Return the levels of an encoder's channels as a file of simavr's input, a VCD; its times are in microseconds."""
    lines = ["$timescale 1us $end", "$var wire 1 a iogD_2 $end", "$var wire 1 b iogD_3 $end", "$enddefinitions $end"]
    for at in (0, *np.nonzero(np.diff(count))[0] + 1, len(time) - 1):
        a, b = LEVELS[count[at] % 4]
        lines.append(f"#{round(1e6 * time[at]) + 1}\n{a}a\n{b}b")
    return "\n".join(lines) + "\n"


def printed_by(firmware: Path, time: np.ndarray, count: np.ndarray) -> str:
    """Return what a sketch prints at these pulses, with a dot for each control character, as simavr shows it."""
    (firmware.parent / "pulses.vcd").write_text(pulses(time, count))
    done = subprocess.run(["simavr", "-m", "atmega328p", "-f", "16000000", "-i", "pulses.vcd", firmware.name],
                          cwd=firmware.parent, capture_output=True, text=True, check=True)
    return done.stdout + done.stderr


@pytest.mark.parametrize("firmware", ["encoder"], indirect=True)
def test_the_encoders_sketch_follows_50000_counts_a_second_and_says_when_it_cannot(firmware: Path) -> None:
    for step, followed in ((20e-6, True), (15e-6, False)):
        time, count = np.append(0.1 + step * np.arange(20_001), 0.1 + step * 20_000 + 0.1), np.arange(20_002)
        count[-1] = 20_000
        printed = printed_by(firmware, time, count)
        assert (re.findall(r"\d+\.(\d+)\.\.", printed)[-1] == "20000") is followed
        assert ("# counts missed: " in printed) is not followed


@pytest.mark.parametrize("turns", [False, True])
@pytest.mark.parametrize("firmware", ["encoder"], indirect=True)
def test_the_encoders_sketch_counts_every_pulse(firmware: Path, turns: bool) -> None:
    time, angle = swing(turns)
    count = np.rint(angle * COUNTS / (2.0 * np.pi)).astype(int)
    assert np.abs(np.diff(count)).max() == 1
    printed = printed_by(firmware, time, count)
    assert "Time (us).Counts.." in printed
    assert "missed" not in printed
    pairs = re.findall(r"(\d+)\.(-?\d+)\.\.", printed)
    sent = np.array(pairs, dtype=int)
    assert len(sent) > 950
    assert np.abs(np.diff(sent[:, 0]) - 10_000).max() <= 20  # 100 lines a second, and stamps of the moment of the count
    at = np.searchsorted(time, 1e-6 * sent[:, 0])
    late = np.arange(5)  # the clock of a sketch starts some 0.3 ms after power comes
    seen = count[np.minimum(at[:, None] + late, len(count) - 1)]
    assert np.all((seen.min(axis=1) <= sent[:, 1]) & (sent[:, 1] <= seen.max(axis=1)))
    assert np.ptp(sent[:, 1]) >= 0.9 * np.ptp(count)
    board = Board(firmware.parent)
    board.play(["", "Time (us)\tCounts", *map("\t".join, pairs)])
    recording = acquired(SerialPort(port=str(board.port), counts=COUNTS), firmware.parent / "swing.txt", len(sent))
    assert np.rint(recording.angle * COUNTS / (2.0 * np.pi)).astype(int).tolist() == sent[:, 1].tolist()
    assert np.diff(recording.time) == pytest.approx(1e-6 * np.diff(sent[:, 0]), abs=2e-6)
    if not turns:
        found = fit(recording, "linear", scene="lab").parameters
        for name, truth in (("length", SCENES["lab"].body.length), ("linear_drag.gamma", GAMMA)):
            assert abs(found[name].value - truth) < 4.0 * found[name].error
        assert found["length"].error < 1e-5


@pytest.fixture(scope="session")
def uno_with_as5600(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Program that runs an Uno with an AS5600 on its bus."""
    if not shutil.which("gcc") or not Path("/usr/include/simavr").is_dir():
        pytest.skip(f"running the AS5600's sketch needs gcc and the system packages {PACKAGES}")
    program = tmp_path_factory.mktemp("uno") / "as5600"
    subprocess.run(["gcc", "-O1", "-Wall", "-Werror", "-o", program, Path(__file__).with_name("as5600.c"), "-lsimavr"],
                   check=True)
    return program


@pytest.mark.parametrize("firmware", ["as5600"], indirect=True)
def test_the_as5600s_sketch_goes_on_after_a_turn(uno_with_as5600: Path, firmware: Path) -> None:
    _, angle = swing(turns=True)
    steps = np.rint(angle[::10] * 4096 / (2.0 * np.pi)).astype(int)
    raw = (steps + 4000) % 4096  # where the magnet was glued on
    (firmware.parent / "angles").write_text("\n".join(map(str, raw)))
    done = subprocess.run([uno_with_as5600, firmware, "angles"], cwd=firmware.parent, capture_output=True, text=True,
                          check=True)
    lines = done.stdout.splitlines()
    start = lines.index("Time (us)\tAngle (deg)")
    sent = np.array([line.split("\t") for line in lines[start + 1:]], dtype=float)
    assert len(sent) > 950
    assert not [line for line in lines if line.startswith("#")]
    at = (sent[:, 0] / 1000).astype(int)[:, None] + np.arange(4)
    seen = steps[np.minimum(at, len(steps) - 1)] * (360.0 / 4096)
    assert np.all((seen.min(axis=1) - 0.006 <= sent[:, 1]) & (sent[:, 1] <= seen.max(axis=1) + 0.006))
    assert sent[:, 1].max() > 800.0
    board = Board(firmware.parent)
    board.play(lines[start - 1:])
    recording = acquired(SerialPort(port=str(board.port)), firmware.parent / "swing.txt", len(sent))
    assert np.degrees(recording.angle) == pytest.approx(sent[:, 1], abs=1e-6)


@pytest.mark.parametrize("firmware", ["as5600"], indirect=True)
def test_the_as5600s_sketch_says_that_no_sensor_answers(uno_with_as5600: Path, firmware: Path) -> None:
    (firmware.parent / "angles").write_text("-1\n" * 200)
    done = subprocess.run([uno_with_as5600, firmware, "angles"], cwd=firmware.parent, capture_output=True, text=True,
                          check=True)
    said = [line for line in done.stdout.splitlines() if line.startswith("# ")]
    assert said
    assert {*said} == {"# The AS5600 does not answer; look at SDA, SCL, 3.3 V and GND."}
