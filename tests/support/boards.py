"""A board at a serial port, played by a pseudo-terminal behind a symbolic link."""

from __future__ import annotations

import os
import termios
import tty
from pathlib import Path


class Board:
    """What a program sends and sees at the other end of a port; unplugged and plugged in again at the same name."""

    def __init__(self, folder: Path) -> None:
        self.port = folder / "ttyBOARD"
        self.plug()

    def plug(self) -> None:
        """Appear as a new terminal."""
        self.far, self.near = os.openpty()
        tty.setraw(self.near)
        self.port.symlink_to(os.ttyname(self.near))

    def unplug(self) -> None:
        """Vanish, with all that was not read."""
        self.port.unlink()
        os.close(self.far)
        os.close(self.near)

    def send(self, *lines: str | bytes) -> None:
        """Send lines, or bytes as they are."""
        for line in lines:
            os.write(self.far, line if isinstance(line, bytes) else f"{line}\r\n".encode())

    @property
    def baud(self) -> int:
        """The rate that the other side has set."""
        speed = termios.tcgetattr(self.near)[4]
        return next(int(name[1:]) for name in dir(termios)
                    if name[0] == "B" and name[1:].isdigit() and getattr(termios, name) == speed)
