"""A process that stands for a board: the simulated firmware in real time, behind a local connection of bytes.

:class:`pendulum_env.bench.device.VirtualBoard` starts it with its settings, pickled, at its input.
"""

from __future__ import annotations

import pickle
import select
import signal
import socket
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

from pendulum_env.bench.firmware import Firmware, Plant, Tell

LOOK = 0.002
"""Longest time between two looks at the line [s]."""
HELD_UP = 0.005
"""Time after the last look [s] beyond which this process counts as held up by others: drives that came since count as
come at this time, so that they feed the watchdog as they would that of a board with a processor of its own."""
AFTER = 0.5
"""Time for which the board goes on after its line is cut [s], as a real one would."""


class Wanted(NamedTuple):
    """Settings of the process: port of this computer to connect to, keywords of the plant, file of the firmware's log.
    """

    port: int
    keywords: dict[str, Any]
    angle: float
    velocity: float
    seed: int
    log: str | None


@contextmanager
def telling(path: str | None) -> Iterator[Tell]:
    """Yield the function that writes the firmware's log: time [s], drive and state at every change."""
    if path is None:
        yield lambda time, drive, state: None
        return
    with Path(path).open("w", encoding="ascii", buffering=1) as file:
        file.write("time,drive,state\n")
        yield lambda time, drive, state: file.write(f"{time:.3f},{drive},{state}\n")


def run(wanted: Wanted) -> None:
    """Be the board until its line is cut, and a little longer."""
    plant = Plant(wanted.keywords, wanted.angle, wanted.velocity, wanted.seed)
    Plant(wanted.keywords).step(0.0)  # compiles before the clock runs
    with telling(wanted.log) as tell, socket.create_connection(("127.0.0.1", wanted.port), timeout=10.0) as line:
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        firmware = Firmware(plant, tell)
        began = last = time.monotonic()
        with suppress(OSError):  # the other side was killed
            while True:
                ready = select.select([line], [], [], LOOK)[0]
                now = time.monotonic()
                if ready:
                    data = line.recv(4096)
                    if not data:
                        break
                    line.sendall(firmware.receive(data, min(now, last + HELD_UP) - began, now - began))
                firmware.go_on(now - began)
                last = now
        firmware.go_on(last + AFTER - began)


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the program that drives the board
    run(pickle.load(sys.stdin.buffer))
