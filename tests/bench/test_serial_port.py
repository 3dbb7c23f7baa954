"""Boards at serial ports, played by pseudo-terminals, with what goes wrong on real ones."""

from __future__ import annotations

import errno
import os
import re
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import serial
import serial.tools.list_ports
from boards import Board, acquired
from command_line import Here

from pendulum_env import SCENES, rollout
from pendulum_env.bench.source import SourceError
from pendulum_env.bench.sources import serial_port
from pendulum_env.bench.sources.serial_port import SerialPort
from pendulum_env.lab import Recording, fit

TITLES = "Time (us)\tCounts"
PERIOD = 10_000
"""Microseconds between lines of a board."""


@pytest.fixture
def board(tmp_path: Path) -> Iterator[Board]:
    """A board that is plugged in."""
    played = Board(tmp_path)
    yield played
    if played.port.is_symlink():
        played.unplug()


@pytest.fixture
def opened() -> Iterator[Any]:
    """Function that opens a source, which is closed after the test."""
    sources: list[SerialPort] = []

    def opening(board: Board, **settings: Any) -> SerialPort:
        source = SerialPort(port=str(board.port), **settings)
        source.open()
        sources.append(source)
        return source

    yield opening
    for source in sources:
        source.close()


def collect(source: SerialPort, samples: int, most: float = 5.0) -> tuple[np.ndarray | None, np.ndarray, int]:
    """Return times, readings, and the number of lost samples once at least so many samples have come."""
    chunks, until = [], time.monotonic() + most
    while sum(len(chunk.values) for chunk in chunks) < samples:
        assert time.monotonic() < until, f"only {sum(len(chunk.values) for chunk in chunks)} of {samples} samples came"
        chunks.append(source.read(0.05))
    values = np.concatenate([chunk.values[:, 0] for chunk in chunks if len(chunk.values)])
    times = [chunk.time for chunk in chunks if len(chunk.values)]
    return (None if times[0] is None else np.concatenate(times)), values, sum(chunk.lost for chunk in chunks)


def counts(numbers: range, start: int = 0) -> list[str]:
    """Return lines of a board: time [us] and a count that is the line's number."""
    return [f"{start + PERIOD * n}\t{n}" for n in numbers]


def test_counts_become_degrees_at_the_boards_times(board: Board, opened: Any) -> None:
    source = opened(board, counts=2400)
    board.send(TITLES, *counts(range(200), start=1_000_000))
    at, values, lost = collect(source, 200)
    assert at == pytest.approx(1.0 + 0.01 * np.arange(200), abs=1e-9)
    assert values == pytest.approx(0.15 * np.arange(200), abs=1e-9)
    assert lost == 0
    assert source.columns == ("Angle (deg)",)


def test_a_first_line_of_which_the_head_is_missing_is_dropped(board: Board, opened: Any) -> None:
    source = opened(board, counts=2400, time_unit="us")
    board.send(b"0\t4\r\n", *counts(range(5, 100)))  # the end of a line "40000\t4"
    at, values, lost = collect(source, 95)
    assert values == pytest.approx(0.15 * np.arange(5, 100))
    assert at == pytest.approx(0.01 * np.arange(5, 100), abs=1e-9)
    assert lost == 0


def test_messages_of_a_start_and_garbage_are_no_samples(board: Board, opened: Any) -> None:
    source = opened(board, counts=2400)
    board.send(b"\x00\xff\xfe\x80rst cause:2, boot mode:(3,6)\r\n", "ets Jan  8 2013", "load 0x40100000, len 1024", "",
               "Encoder 1.0 ready", TITLES)
    board.send(*counts(range(50)), b"\xf0\x9f\x00\r\n", "# counts missed: 3", *counts(range(51, 100)))
    at, values, lost = collect(source, 99)
    assert values == pytest.approx(0.15 * np.delete(np.arange(100), 50))
    assert at == pytest.approx(0.01 * np.delete(np.arange(100), 50))
    assert lost == 1
    assert any("counts missed: 3" in note for note in source.notes)


def test_lines_arrive_in_pieces(board: Board, opened: Any) -> None:
    source = opened(board, counts=2400)
    text = "".join(f"{line}\r\n" for line in [TITLES, *counts(range(60))]).encode()
    kept: list[np.ndarray] = []
    for begin in range(0, len(text), 7):
        board.send(text[begin:begin + 7])
        kept.append(source.read(0.05).values)
    assert np.concatenate(kept)[:, 0] == pytest.approx(0.15 * np.arange(60))


@pytest.mark.slow
def test_a_board_that_is_unplugged_goes_on_when_it_is_back(board: Board, opened: Any) -> None:
    source = opened(board, counts=2400)
    board.send(TITLES, *counts(range(100), start=50_000_000))
    first = collect(source, 100)
    board.unplug()
    gone = time.monotonic()
    while time.monotonic() < gone + 0.6:
        assert not len(source.read(0.05).values)
    assert source.notes[0].endswith("is gone; plug it in again to go on")
    board.plug()
    while not any("is back" in note for note in source.notes):
        source.read(0.05)
    board.send(b"garb\xffage", "", TITLES, *counts(range(100)))  # which starts again: its supply was the cable
    second = collect(source, 100)
    assert first[0] is not None
    assert second[0] is not None
    gap = second[0][0] - first[0][-1]
    assert gap == pytest.approx(time.monotonic() - gone, abs=0.3)
    assert second[0] - second[0][0] == pytest.approx(0.01 * np.arange(100), abs=1e-9)
    assert second[1] == pytest.approx(0.15 * np.arange(100))
    assert second[2] == pytest.approx(gap / 0.01, abs=2)
    said = "\n".join(source.notes)
    assert re.search(r"ttyBOARD is back after 0\.[5-9] s", said)
    assert "clock: the device began again at 50.990 s, and counts from where the bob was then; continued by" in said


def test_a_board_with_its_own_supply_keeps_its_clock(board: Board, opened: Any) -> None:
    source = opened(board, counts=2400)
    board.send(TITLES, *counts(range(100)))
    collect(source, 100)
    board.unplug()
    began = time.monotonic()
    source.read(0.05)
    board.plug()
    while not any("is back" in note for note in source.notes):
        source.read(0.05)
    later = round((time.monotonic() - began) / 0.01)
    board.send("23\t4", *counts(range(100 + later, 200 + later)))
    at, values, lost = collect(source, 100)
    assert at is not None
    assert at[0] == pytest.approx(0.01 * (100 + later))
    assert values[0] == pytest.approx(0.15 * (100 + later))
    assert lost == later
    assert "began again" not in "\n".join(source.notes)


def test_a_clock_that_disagrees_after_a_gap_is_not_believed(board: Board, opened: Any) -> None:
    """The board is away for a moment, and its clock is 3 s further: it has restarted some time ago."""
    source = opened(board, counts=2400)
    board.send(TITLES, *counts(range(100)))
    collect(source, 100)
    board.unplug()
    began = time.monotonic()
    source.read(0.05)
    board.plug()
    while not any("is back" in note for note in source.notes):
        source.read(0.05)
    board.send("23\t4", *counts(range(100), start=4_000_000))
    at, values, _ = collect(source, 100)
    assert at is not None
    assert at[0] - 0.99 == pytest.approx(time.monotonic() - began, abs=0.15)
    assert at - at[0] == pytest.approx(0.01 * np.arange(100))
    assert values == pytest.approx(0.15 * np.arange(100))
    assert "began again" in "\n".join(source.notes)


def test_letters_beyond_ascii_are_no_noise(board: Board, opened: Any) -> None:
    source = opened(board)
    board.send(*["° µ ° µ ° µ ° µ Größe: °"] * 10, "Zeit (µs);Winkel (°)")
    source.read(0.05)
    board.send(*(f"{PERIOD * n};{n}°" for n in range(50)))
    collect(source, 50)
    assert board.baud == 115200
    assert not any(note.startswith("rate:") for note in source.notes)


@pytest.mark.slow
def test_lines_without_times_count_what_a_gap_has_lost(board: Board, opened: Any) -> None:
    source = opened(board)
    board.send("garbage?", *["7.5"] * 3)
    collect(source, 3)
    time.sleep(0.5)
    board.send(*["7.5"] * 97)  # 100 in half a second
    at, values, lost = collect(source, 97)
    assert at is None
    assert {*values} == {7.5}
    assert lost == 0
    board.unplug()
    began = time.monotonic()
    while time.monotonic() < began + 0.5:
        source.read(0.05)
    board.plug()
    while not any("is back" in note for note in source.notes):
        source.read(0.05)
    board.send("5", "7.5", "7.5")
    assert 80 < collect(source, 1)[2] < 220


def test_text_without_numbers_is_an_error(board: Board, opened: Any) -> None:
    source = opened(board)
    board.send(*["Encoder is ready"] * 60)
    with pytest.raises(SourceError, match=r"\d+ lines came without a sample, such as 'Encoder is ready'; send lines"):
        collect(source, 1)


def test_silence_is_noted(board: Board, opened: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serial_port, "SILENCE", 0.1)
    source = opened(board)
    for _ in range(8):
        source.read(0.05)
    assert [*source.notes] == [f"nothing has come from {board.port} for 0.1 s; is the sketch running?"]


def test_the_rate_is_found(board: Board, opened: Any) -> None:
    """A board that sends at 57600; what another rate reads of it is no text."""
    source = opened(board, counts=2400)
    noise = np.random.default_rng(0)
    sent = 0
    for _ in range(200):
        if board.baud == 57600:
            board.send(*counts(range(sent, sent + 10)))
            sent += 10
        else:
            board.send(noise.integers(0, 256, 200, dtype=np.uint8).tobytes())
        if len(source.read(0.02).values):
            break
    assert sent
    assert any("57600 baud" in note for note in source.notes)


def test_a_rate_that_is_given_is_not_left(board: Board, opened: Any) -> None:
    source = opened(board, baud=9600)
    assert board.baud == 9600
    noise = np.random.default_rng(0)
    board.send(noise.integers(128, 256, 1000, dtype=np.uint8).tobytes())
    with pytest.raises(SourceError, match=r"sends no text at 9600 baud; leave out --baud"):
        collect(source, 1)


def test_a_port_that_is_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ports = [known_port("/dev/ttyS0"), known_port("/dev/ttyUSB0", "USB Serial", 0x1A86)]
    monkeypatch.setattr(serial.tools.list_ports, "comports", lambda: ports)
    with pytest.raises(SourceError) as said:
        SerialPort(port="/dev/ttyUSB7").open()
    assert str(said.value) == ("serial: there is no port /dev/ttyUSB7; the ports here are /dev/ttyUSB0 (USB Serial), "
                               "/dev/ttyS0")
    monkeypatch.setattr(serial.tools.list_ports, "comports", list)
    with pytest.raises(SourceError, match="this computer has no serial port; plug the board in"):
        SerialPort(port="/dev/ttyUSB7").open()


def known_port(device: str, description: str = "n/a", vid: int | None = None) -> Any:
    """Return a port as pyserial lists it."""
    from serial.tools.list_ports_common import ListPortInfo

    port = ListPortInfo(device)
    port.description, port.vid, port.pid, port.serial_number = description, vid, vid, device if vid else None
    return port


def test_without_a_name_the_only_port_of_usb_is_taken(board: Board, monkeypatch: pytest.MonkeyPatch) -> None:
    ports = [known_port("/dev/ttyS0"), known_port(str(board.port), "Arduino", 0x2341)]
    monkeypatch.setattr(serial.tools.list_ports, "comports", lambda: ports)
    source = SerialPort()
    source.open()
    source.close()
    ports.append(known_port("/dev/ttyUSB0", "USB Serial", 0x1A86))
    with pytest.raises(SourceError, match=r"several ports are there; name the port as in .*ttyBOARD \(Arduino\)"):
        SerialPort().open()
    del ports[1:]
    with pytest.raises(SourceError, match=r"no board is plugged in by USB.*the ports here are /dev/ttyS0"):
        SerialPort().open()


def test_a_port_that_another_program_has(board: Board, opened: Any) -> None:
    opened(board)
    with pytest.raises(SourceError, match=r"ttyBOARD is open in another program; close that first"):
        opened(board)


def test_a_file_is_no_port(tmp_path: Path) -> None:
    path = tmp_path / "swing.csv"
    path.write_text("0 1\n")
    with pytest.raises(SourceError, match=r"is a file, not a serial port; --from replay:.*swing.csv plays a recording"):
        SerialPort(port=str(path)).open()
    assert path.read_text() == "0 1\n"
    with pytest.raises(SourceError, match="cannot be opened as a serial port"):
        SerialPort(port="/dev/null").open()


@pytest.mark.skipif(os.name != "posix", reason="groups of devices")
def test_a_port_without_permission(board: Board, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: Any, **__: Any) -> None:
        raise serial.SerialException(errno.EACCES, f"could not open port {board.port}: [Errno 13] Permission denied")

    monkeypatch.setattr(serial, "Serial", refused)
    remedies = {"dialout": "join its group with sudo usermod -a -G dialout ", "root": "allow it with sudo chmod "}
    for group, remedy in remedies.items():
        monkeypatch.setattr(serial_port, "group_of", lambda _, group=group: group)
        with pytest.raises(SourceError, match=f"you may not open .*ttyBOARD; {remedy}"):
            SerialPort(port=str(board.port)).open()


def test_windows_words() -> None:
    def of_windows(text: str) -> serial.SerialException:
        return serial.SerialException(f"could not open port 'COM3': {text}")

    denied = serial_port.refusal("COM3", of_windows("PermissionError(13, 'Access is denied.', None, 5)"))
    assert "open in another program" in denied
    missing = serial_port.refusal("COM3", of_windows("FileNotFoundError(2, 'The system cannot find ...', None, 2)"))
    assert missing.startswith("there is no port COM3; ")


def test_a_missing_library_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "serial", None)
    with pytest.raises(SourceError, match=r'needs pyserial; install it with pip install "lab-pendulum\[serial\]"'):
        SerialPort(port="/dev/ttyUSB0").open()
    monkeypatch.setitem(sys.modules, "serial", type(sys)("serial"))
    monkeypatch.setitem(sys.modules, "serial.tools", type(sys)("serial.tools"))
    monkeypatch.setitem(sys.modules, "serial.tools.list_ports", type(sys)("serial.tools.list_ports"))
    with pytest.raises(SourceError, match="another package named serial is installed"):
        SerialPort(port="/dev/ttyUSB0").open()


def test_a_board_that_comes_back_under_another_name_is_found(
    board: Board, opened: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    ports = [known_port(str(board.port), "Arduino", 0x2341)]
    monkeypatch.setattr(serial.tools.list_ports, "comports", lambda: ports)
    source = opened(board, counts=2400)
    board.send(TITLES, *counts(range(50)))
    collect(source, 50)
    board.unplug()
    other = Board(tmp_path / "2") if (tmp_path / "2").mkdir() is None else board
    ports[0].device = str(other.port)
    until = time.monotonic() + 3.0
    while not any("is back" in note for note in source.notes):
        assert time.monotonic() < until
        source.read(0.05)
    other.send("", TITLES, *counts(range(50)))
    collect(source, 50)
    other.unplug()


def test_a_port_that_stays_away_is_an_error(board: Board, opened: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serial_port, "PATIENCE", 0.3)
    source = opened(board)
    board.unplug()
    with pytest.raises(SourceError, match=r"has been gone for \d s; plug it in and start again"):
        collect(source, 1)
    source.close()
    source.close()


@pytest.mark.parametrize("counts_given", [True, False])
def test_the_commands_of_the_readme_record_a_board(
    board: Board, run_here: Here, tmp_path: Path, counts_given: bool,
) -> None:
    board.play([TITLES, *counts(range(120))] if counts_given else ["Time (us)\tAngle (deg)", *counts(range(120))])
    options = ["--counts", "2400"] if counts_given else []
    code, printed, said = run_here("acquire", "--from", f"serial:{board.port}", *options, "--headless", "--duration",
                                   "1", "--out", str(tmp_path / "swing.csv"))
    assert code == 0, said
    assert "101 samples in 1 s" in printed
    recording = Recording.read(tmp_path / "swing.csv")
    assert np.degrees(recording.angle) == pytest.approx((0.15 if counts_given else 1.0) * np.arange(101))


def test_counts_are_not_taken_for_degrees(board: Board, run_here: Here) -> None:
    board.play([TITLES, *counts(range(120))])
    code, _, said = run_here("acquire", "--from", f"serial:{board.port}", "--headless", "--duration", "1")
    assert code == 2
    assert "'Counts' is a count of an encoder; give the counts in one turn, as --counts 2400" in said


BOARDS: dict[str, tuple[str, str, float, dict[str, Any]]] = {
    "an encoder's counts": (TITLES, "{us}\t{counts}", 0.0, {"counts": 2400}),
    "milliseconds and degrees, with decimal commas": ("Sensor 7", "{ms};{degrees}", 0.01, {}),
}
"""Board -> its first line, the form of the others, their pace in the first second, and the source's settings."""


@pytest.mark.slow
@pytest.mark.parametrize("kind", [
    pytest.param(kind, marks=() if kind == "an encoder's counts" else pytest.mark.slow) for kind in BOARDS])
def test_a_recording_of_a_board_fits_the_scene_behind_it(kind: str, board: Board, tmp_path: Path) -> None:
    """Within 4 standard errors, which are 5 millionths of the length; one microsecond counter overflows on the way."""
    first, form, pace, settings = BOARDS[kind]
    motion = rollout("lab", angle=0.6, velocity=0.0, duration=20.0, dt=0.01, diagnostics=(),
                     damping={"linear": {"gamma": 0.05}})
    lines = [form.format(us=(round(1e6 * at) + 4_290_000_000) % 2**32, ms=round(1e3 * at) + 77,
                         counts=round(shown / 0.15), degrees=f"{shown:.2f}".replace(".", ","))
             for at, shown in zip(motion.time, np.degrees(motion.angle), strict=True)]
    board.play([first, *lines], pace)
    recording = acquired(SerialPort(port=str(board.port), **settings), tmp_path / "swing.txt", len(lines))
    assert len(recording.time) == len(lines)
    assert recording.time - recording.time[0] == pytest.approx(motion.time, abs=1e-6)
    found = fit(recording, "linear", scene="lab").parameters
    for name, truth in (("length", SCENES["lab"].body.length), ("linear_drag.gamma", 0.05)):
        assert abs(found[name].value - truth) < 4.0 * found[name].error
    assert found["length"].error < 5e-6 * SCENES["lab"].body.length
