"""A board at a serial port, played by a pseudo-terminal behind a symbolic link."""

from __future__ import annotations

import os
import termios
import threading
import time
import tty
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from pendulum_env.bench.acquisition import Acquisition
from pendulum_env.bench.source import Source
from pendulum_env.lab import Recording


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

    def play(self, lines: Iterable[str], pace: float = 0.0) -> None:
        """Send lines from another thread once the port is open: for a second ``pace`` [s] apart, then as fast as
        they are taken.
        """
        closed = self.baud

        def playing() -> None:
            with suppress(OSError, termios.error):  # unplugged
                while self.baud == closed:  # opening sets the rate
                    time.sleep(0.01)
                time.sleep(0.05)
                for number, line in enumerate(lines):
                    self.send(line)
                    if number * pace < 1.0:
                        time.sleep(pace)

        threading.Thread(target=playing, daemon=True).start()

    @property
    def baud(self) -> int:
        """The rate that the other side has set."""
        speed = termios.tcgetattr(self.near)[4]
        return next(int(name[1:]) for name in dir(termios)
                    if name[0] == "B" and name[1:].isdigit() and getattr(termios, name) == speed)


def acquired(source: Source, path: Path, samples: int) -> Recording:
    """Return a recording of so many samples of a source, as its journal holds it."""
    acquisition = Acquisition(source)
    acquisition.open()
    acquisition.start(path)
    until = time.monotonic() + 20.0
    while acquisition.status.samples < samples:
        assert time.monotonic() < until, f"{acquisition.status} {source.notes}"
        acquisition.poll(0.05)
    acquisition.close()
    return Recording.read(path)
