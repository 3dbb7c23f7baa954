"""Frames between this computer and the board of a bench with a motor; the room's README explains them for firmware.

A frame is one line of ASCII, ``body*CRC``: the body is a letter, a sequence number and whole numbers, separated by
spaces; the CRC is that of XMODEM (polynomial 0x1021, begun with 0) over the body, as four hexadecimal digits.
"""

from __future__ import annotations

import re
from binascii import crc_hqx
from typing import NamedTuple

VERSION = 1
"""Number of this protocol, which a board tells in its answer to ``H``."""
BAUD = 500_000
"""Rate of the serial line [bits/s], which an Uno makes exactly."""
FULL = 1000
"""Drive of the largest torque."""
SEQUENCES = 65_536
"""Sequence numbers run from 0 to this less one, and begin again."""
LONGEST = 64
"""Longest frame [bytes], without the line's end."""
MICROS = 2**32
"""Count of microseconds at which a board's clock begins again at 0."""
STOPPED, DRIVING, TRIPPED = range(3)
"""States of a board: drives are refused; drives are obeyed; the watchdog has switched the motor off."""

_BODY = re.compile(r"([A-Z]) (\d{1,5})((?: -?\d{1,10})*)")


class Frame(NamedTuple):
    """What a frame says: its letter, its sequence number and its whole numbers."""

    letter: str
    sequence: int
    numbers: tuple[int, ...] = ()


def encoded(frame: Frame) -> bytes:
    """Return a frame as the bytes of its line."""
    body = " ".join(map(str, (frame.letter, frame.sequence, *frame.numbers))).encode()
    return b"%s*%04X\n" % (body, crc_hqx(body, 0))


def decoded(line: bytes) -> Frame | None:
    """Return the frame of a line without its end; None for a line that is torn, garbled or no frame."""
    body, star, crc = line.strip(b"\r").rpartition(b"*")
    if not star or len(line) > LONGEST or len(crc) != 4 or crc != b"%04X" % crc_hqx(body, 0):
        return None
    found = _BODY.fullmatch(body.decode("ascii", "replace"))
    if found is None:
        return None
    return Frame(found[1], int(found[2]), tuple(map(int, found[3].split())))


class Frames:
    """Frames in a stream of bytes: :meth:`feed` it what came, again and again.

    Attributes:
        bad: number of lines so far that were torn or garbled. Comments, lines that begin with #, are passed over.
    """

    def __init__(self) -> None:
        self.bad = 0
        self._rest = b""

    def feed(self, data: bytes) -> list[Frame]:
        """Return the frames whose lines end in ``data``."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > LONGEST:  # noise without an end; the line that it begins is garbled anyway
            self._rest = self._rest[-LONGEST:]
        found = [decoded(line) for line in lines if line.strip() and not line.startswith(b"#")]
        self.bad += found.count(None)
        return [frame for frame in found if frame is not None]
