"""Frames of the bench's protocol: the check that they carry, what is torn, and what a firmware answers."""

from __future__ import annotations

import re

import numpy as np
import pytest
from readme_code import READMES
from simulated_board import Bob, SimulatedBoard

from pendulum_env.bench.firmware import Firmware
from pendulum_env.bench.protocol import DRIVING, SEQUENCES, STOPPED, TRIPPED, Frame, Frames, decoded, encoded


def xmodem(data: bytes) -> int:
    """The CRC bit by bit, as the sketch has it from avr-libc's documentation."""
    crc = 0
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1) ^ 0x1021 if crc & 0x8000 else crc << 1
            crc &= 0xFFFF
    return crc


def test_the_check_is_the_published_one() -> None:
    assert xmodem(b"123456789") == 0x31C3  # the check value of CRC-16/XMODEM in catalogues
    assert encoded(Frame("D", 17, (-250,))) == b"D 17 -250*%04X\n" % xmodem(b"D 17 -250")


@pytest.mark.parametrize("frame", [
    Frame("H", 1, (60,)), Frame("Q", 65535), Frame("R", 0, (2**32 - 1, -2**31, -1000, 2))])
def test_a_frame_is_read_as_it_was_written(frame: Frame) -> None:
    line = encoded(frame)
    assert decoded(line[:-1]) == frame
    assert Frames().feed(line[:3]) == []
    stream = Frames()
    assert [*stream.feed(b"# Hello\r\n\r\n" + line[:3]), *stream.feed(line[3:])] == [frame]
    assert stream.bad == 0


def test_no_single_garbled_byte_and_no_torn_line_is_taken_for_a_frame() -> None:
    line = encoded(Frame("D", 17, (-250,)))[:-1]
    for place in range(len(line)):
        for byte in range(256):
            if byte != line[place]:
                assert decoded(line[:place] + bytes([byte]) + line[place + 1:]) is None
        assert decoded(line[:place]) is None
        assert decoded(line[place + 1:]) is None
    noise = np.random.default_rng(0).integers(0, 256, 100_000, dtype=np.uint8).tobytes()
    stream = Frames()
    assert stream.feed(noise) == []
    assert stream.bad > 100
    assert stream.feed(b"\n" + line + b"\n") == [Frame("D", 17, (-250,))]


def firmware() -> Firmware:
    return Firmware(Bob())


def asked(board: Firmware, letter: str, *numbers: int, at: float) -> tuple[int, ...]:
    """The numbers of the answer to a frame."""
    answers = Frames().feed(board.receive(encoded(Frame(letter, 5, numbers)), at))
    assert all(answer.sequence == 5 for answer in answers)
    return answers[0].numbers if answers else ()


def test_the_pages_example_is_a_frame() -> None:
    found = re.search(r"For example `(.*?)`", READMES["pendulum_env/bench/README.md"])
    assert found
    assert decoded(found[1].encode()) == Frame("D", 17, (-250,))


def test_a_firmware_obeys_from_its_greeting_to_a_stop() -> None:
    board = firmware()
    assert asked(board, "D", 500, at=0.01) == ()
    assert asked(board, "Q", at=0.02)[2:] == (0, STOPPED)
    assert asked(board, "H", 60, at=0.03)[::2] == (1, 60)
    assert asked(board, "D", 1500, at=0.04) == ()
    assert asked(board, "Q", at=0.05)[2:] == (1000, DRIVING)  # never beyond the largest torque
    assert asked(board, "S", at=0.06)[2:] == (0, STOPPED)
    assert asked(board, "D", 500, at=0.07) == ()
    assert asked(board, "Q", at=0.08)[2:] == (0, STOPPED)
    for nonsense in (Frame("H", 1, (0,)), Frame("H", 1, (1001,)), Frame("D", 1), Frame("Q", 1, (3,)), Frame("X", 1)):
        assert board.receive(encoded(nonsense), 0.09) == b""


def test_the_watchdog_stops_the_motor_at_its_own_time_and_for_good() -> None:
    board = firmware()
    told: list[tuple[float, int, int]] = []
    vars(board)["_tell"] = lambda *change: told.append(change)
    asked(board, "H", 60, at=0.010)
    asked(board, "D", 500, at=0.100)
    asked(board, "D", 500, at=0.155)
    assert asked(board, "Q", at=5.0)[2:] == (0, TRIPPED)  # questions do not feed it, and come late
    assert told[-1] == pytest.approx((0.155 + 0.060, 0, TRIPPED))
    asked(board, "D", 500, at=5.1)
    assert asked(board, "Q", at=5.2)[2:] == (0, TRIPPED)
    asked(board, "H", 60, at=5.3)
    assert asked(board, "Q", at=9.0)[2:] == (0, DRIVING)  # it waits for the first drive


def test_sequence_numbers_and_the_clock_begin_again() -> None:
    board = SimulatedBoard()
    board.open(0.06)
    vars(board)["_sequence"] = SEQUENCES - 1
    vars(board.firmware)["_ticks"] = (2**32 // 1000) - 10
    before = board.read()
    board.wait(board.firmware.time + 0.05)
    after = board.read()
    assert before.time == pytest.approx(2**32 * 1e-6, abs=0.02)
    assert after.time - before.time == pytest.approx(board.firmware.time - before.time, abs=1e-5)
    assert after.time > before.time
