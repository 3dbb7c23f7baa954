"""The Arduino sketches of the README: compiled for an Uno, and run in a simulated one with a pendulum on its shaft.

They need the system packages of ``PACKAGES`` and are skipped without them.
"""

from __future__ import annotations

import math
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from boards import Board, acquired
from readme_code import READMES

from pendulum_env import SCENES, rollout
from pendulum_env.bench.protocol import BAUD, DRIVING, STOPPED, TRIPPED, VERSION, Frame, decoded, encoded
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
    return built(sketch(request.param), core, tmp_path)


def built(text: str, core: list[Path], tmp_path: Path) -> Path:
    """The program of a sketch."""
    (tmp_path / "sketch.cpp").write_text(text, encoding="utf-8")
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


# --- the bench with a motor -------------------------------------------------------------------------------------------

BYTE = 1e6 * 10 / BAUD
"""Time of a byte on the line, with its start and stop bits [us]."""
Event = tuple[float, str, int]


@pytest.fixture(scope="session")
def uno_bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Program that runs an Uno with bytes coming to its serial port and pulses to its pins."""
    if not shutil.which("gcc") or not Path("/usr/include/simavr").is_dir():
        pytest.skip(f"running the bench's sketch needs gcc and the system packages {PACKAGES}")
    program = tmp_path_factory.mktemp("uno") / "bench"
    subprocess.run(["gcc", "-O1", "-Wall", "-Werror", "-o", program, Path(__file__).with_name("uno_bench.c"),
                    "-lsimavr"], check=True)
    return program


class Heard:
    """What a simulated Uno sent and did: frames with their times, and drives of its motor with theirs [s].

    Drives that last less than 20 us, while one pin after the other changes, are left out.
    """

    def __init__(self, program: Path, firmware: Path, events: list[Event], seconds: float) -> None:
        script = "".join(f"{round(at)} {kind} {value}\n" for at, kind, value in sorted(events, key=lambda e: e[0]))
        (firmware.parent / "script").write_text(script)
        done = subprocess.run([program, firmware, "script", str(round(1000 * seconds))], cwd=firmware.parent,
                              capture_output=True, text=True, check=True)
        lines = [line.split(" ", 2) for line in done.stdout.splitlines() if re.match(r"\d+ [LM] ", line)]
        self.frames = [(1e-6 * int(at), decoded(text.encode())) for at, kind, text in lines if kind == "L"]
        moves = [(1e-6 * int(at), text) for at, kind, text in lines if kind == "M"]
        settled = [one for one, after in zip(moves, [*moves[1:], (math.inf, "")], strict=True)
                   if after[0] > one[0] + 2e-5]
        self.drives = [one for one, before in zip(settled, [(0.0, "0"), *settled], strict=False) if one[1] != before[1]]

    def readings(self) -> list[tuple[float, tuple[int, ...]]]:
        """Times of arrival, and the numbers of all readings."""
        return [(at, frame.numbers) for at, frame in self.frames if frame is not None and frame.letter == "R"]


def sent(at: float, data: bytes | Frame) -> list[Event]:
    """A frame, or bytes as they are, on the line from a time [s] on."""
    line = encoded(data) if isinstance(data, Frame) else data
    return [(1e6 * at + BYTE * (k + 1), "s", byte) for k, byte in enumerate(line)]


START = 0.05
"""Time at which the sketch is surely running [s]."""


@pytest.mark.parametrize("firmware", ["bench"], indirect=True)
def test_the_benchs_sketch_speaks_the_protocol_and_counts(uno_bench: Path, firmware: Path) -> None:
    time, angle = swing()
    count = np.rint(angle * COUNTS / (2.0 * np.pi)).astype(int)
    levels = [(1e6 * time[at] + 1.0, letter, LEVELS[count[at] % 4][k]) for at in (0, *np.nonzero(np.diff(count))[0] + 1)
              for k, letter in enumerate("ab")]
    events = levels + sent(START, Frame("H", 1, (60,)))
    asked = START + 0.01 * np.arange(1, 300)
    for k, at in enumerate(asked):
        events += sent(at, Frame("D", k, (300 * (-1) ** k,))) + sent(at + 0.002, Frame("Q", 60_000 + k))
    heard = Heard(uno_bench, firmware, events, asked[-1] + 0.02)
    assert all(frame is not None for _, frame in heard.frames)
    assert heard.frames[0][1] == Frame("I", 1, (VERSION, COUNTS, 60))
    assert [frame.sequence for _, frame in heard.frames[1:] if frame] == [60_000 + k for k in range(len(asked))]
    for (at, (micros, counted, drive, state)), k in zip(heard.readings(), range(len(asked)), strict=True):
        assert (drive, state) == (300 * (-1) ** k, DRIVING)
        assert 0.0 <= at - 1e-6 * micros < 0.002  # with the line's time
        near = np.searchsorted(time, 1e-6 * micros) + np.arange(8)  # the sketch's clock starts a little late
        assert count[near].min() <= counted <= count[near].max()
    assert {text for _, text in heard.drives} == {"76", "-76", "0"}
    answer = max(at - (asked[k] + 0.002) for k, (at, _) in enumerate(heard.readings()))
    assert answer < 0.003  # of a question that takes 0.3 ms, and an answer of 0.7 ms


@pytest.mark.parametrize("firmware", ["bench"], indirect=True)
def test_the_benchs_watchdog_in_simulated_cycles(uno_bench: Path, firmware: Path) -> None:
    """Off within its time of the last drive, up to a millisecond of its clock; questions do not feed it; H arms it."""
    events = sent(START, Frame("H", 1, (60,)))
    fed = START + np.array([0.0, 0.02, 0.04, 0.06]) + 0.01
    for k, at in enumerate(fed):
        events += sent(at, Frame("D", k, (1000 - k,)))
    for k in range(30):
        events += sent(fed[-1] + 0.003 + 0.01 * k, Frame("Q", k))
    late = fed[-1] + 0.4
    events += sent(late, Frame("D", 9, (500,))) + sent(late + 0.01, Frame("Q", 90))
    events += sent(late + 0.02, Frame("H", 9, (60,))) + sent(late + 0.2, Frame("Q", 91))
    events += sent(late + 0.21, Frame("D", 9, (-500,))) + sent(late + 0.22, Frame("S", 92))
    events += sent(late + 0.23, Frame("D", 9, (500,))) + sent(late + 0.24, Frame("Q", 93))
    heard = Heard(uno_bench, firmware, events, late + 0.3)
    off = [at for at, text in heard.drives if text == "0"]
    arrived = fed[-1] + 1e-6 * BYTE * len(encoded(Frame("D", 3, (997,))))
    assert 0.058 < off[0] - arrived < 0.0615
    assert heard.drives[-2][1] == "-127"
    assert 0.009 < off[1] - (late + 0.21) < 0.0115
    assert len(off) == 2
    states = {frame.sequence: frame.numbers[2:] for _, frame in heard.frames if frame and frame.letter == "R"}
    assert states[0] == (997, DRIVING)
    assert states[29] == (0, TRIPPED)
    assert states[90] == (0, TRIPPED)
    assert states[91] == (0, DRIVING)
    assert states[92] == states[93] == (0, STOPPED)


@pytest.mark.parametrize("firmware", ["bench"], indirect=True)
def test_the_benchs_sketch_passes_over_garbled_lines(uno_bench: Path, firmware: Path) -> None:
    good, events = encoded(Frame("D", 5, (800,))), sent(START, Frame("H", 1, (200,)))
    wrong = [good[:place] + bytes([good[place] ^ 1]) + good[place + 1:] for place in range(len(good) - 1)]
    wrong += [good[3:], good[:-3] + b"\n", b"D 5 800\n", b"\n", b"x" * 200 + b"\n", encoded(Frame("D", 5)),
              encoded(Frame("D", 5, (800, 1))), encoded(Frame("H", 5, (1001,))), encoded(Frame("Q", 5, (1,)))]
    for k, line in enumerate(wrong):
        events += sent(START + 0.01 * (k + 1), line)
    end = START + 0.01 * (len(wrong) + 1)
    events += sent(end, Frame("Q", 7)) + sent(end + 0.01, Frame("D", 5, (800,))) + sent(end + 0.02, Frame("Q", 8))
    heard = Heard(uno_bench, firmware, events, end + 0.03)
    assert [numbers[2:] for at, numbers in heard.readings() if at > end] == [(0, DRIVING), (800, DRIVING)]
    assert len(heard.readings()) == 2
    assert [text for _, text in heard.drives] == ["204"]


def test_the_benchs_watchdog_acts_though_the_sketch_hangs(uno_bench: Path, core: list[Path], tmp_path: Path) -> None:
    hanging = sketch("bench").replace("void loop() {", "void loop() {\n  if (millis() > 100) for (;;) ;")
    firmware = built(hanging, core, tmp_path)
    events = sent(START, Frame("H", 1, (60,)))
    for k in range(30):
        events += sent(START + 0.01 * (k + 1), Frame("D", k, (500,)))
    heard = Heard(uno_bench, firmware, events, 0.5)
    assert [text for _, text in heard.drives] == ["127", "0"]
    assert heard.drives[-1][0] < 0.100 + 0.0615 + 0.005
