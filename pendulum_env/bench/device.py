"""Devices: the motor and the angle sensor of a bench, which an environment opens, reads, writes, stops and closes."""

from __future__ import annotations

import math
import pickle
import select
import socket
import subprocess
import sys
import time
import weakref
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np

from pendulum_env.bench.firmware import TICK
from pendulum_env.bench.protocol import (
    BAUD,
    DRIVING,
    FULL,
    MICROS,
    SEQUENCES,
    STOPPED,
    TRIPPED,
    VERSION,
    Frame,
    Frames,
    encoded,
)
from pendulum_env.bench.sources.serial_port import library, received, refusal
from pendulum_env.common.checks import SceneError, file_path, nearest, shown, whole_number
from pendulum_env.engine.machine import find_method
from pendulum_env.envs.sensing import checked_delay
from pendulum_env.envs.settings import checked_sensor
from pendulum_env.physics.presets import find_scene
from pendulum_env.physics.sensor import Sensor
from pendulum_env.physics.units import Checked, setting, si

STATES = {STOPPED: "stopped", DRIVING: "driving", TRIPPED: "watchdog"}
"""States of a device, by the numbers of the protocol."""
TRIES = 3
"""Number of times that a question is sent until the device counts as lost."""
BOOT = 5.0
"""Time for which a board that was just opened is asked who it is [s]; an Uno restarts then, for two of them."""
START = 120.0
"""Time for which the process of a virtual board is waited for [s]; its program may have to be compiled."""
STEPS_PER_TURN = 2400
"""Counts per turn of the virtual board's encoder, as of the README's sketch."""


class DeviceError(SceneError):
    """A device that cannot be opened, does not answer, or answers nonsense, in one sentence with the remedy."""


class Reading(NamedTuple):
    """What a device reads at one moment of its clock.

    Attributes:
        time: time on the device's clock [s].
        angle: unwrapped angle [rad]; its zero is where the device began to count.
        drive: share of the motor's largest torque that acts.
        state: "driving", "stopped", or "watchdog", which has switched the motor off.
    """

    time: float
    angle: float
    drive: float
    state: str


class Device(ABC):
    """A bench's motor and angle sensor.

    A device of your own derives from this class and has these five methods; give it as
    ``gym.make("LabPendulumBench-v0", device=MyDevice())``. Whatever it is, it must switch its motor off by itself if no
    ``write`` comes for the time that ``open`` is given: programs are killed, and cables pulled.

    Class attributes:
        name: word before the colon in ``serial:/dev/ttyACM0``.
        about: one sentence for lists.
        place: what the text behind the colon is, for lists, "" if it takes none.
        real: True for one that moves something; the first motion is then to be confirmed.
        columns: titles of a log's columns after the time.
    """

    name: ClassVar[str] = "own"
    about: ClassVar[str] = "a device of your own"
    place: ClassVar[str] = ""
    real: ClassVar[bool] = True
    columns: ClassVar[tuple[str, ...]] = ("Angle (rad)", "Action")

    @abstractmethod
    def open(self, watchdog: float) -> None:
        """Connect, if it is not yet, with the motor off; from now on drives are obeyed.

        After the first ``write`` the device itself switches the motor off, and refuses further drives until it is
        opened again, whenever none has come for ``watchdog`` [s]. Raises DeviceError.
        """

    @abstractmethod
    def read(self) -> Reading:
        """Return what the device reads now; DeviceError if it does not answer."""

    @abstractmethod
    def write(self, share: float) -> None:
        """Let the motor give this share of its largest torque, from -1 to 1, until the next call."""

    @abstractmethod
    def stop(self) -> None:
        """Switch the motor off, and refuse drives until the device is opened again; DeviceError if it does not answer.
        """

    @abstractmethod
    def close(self) -> None:
        """Switch the motor off and disconnect; closing twice is allowed."""

    def now(self) -> float:
        """Return the time of the clock by which steps are made [s], one that never jumps."""
        return time.monotonic()

    def wait(self, until: float) -> None:
        """Return at a time of this clock [s], at once if it has passed."""
        left = until - time.monotonic()
        if left > 0.0:
            time.sleep(left)


class Line(Protocol):
    """A stream of bytes to a board and back; its methods raise OSError if it is cut."""

    def send(self, data: bytes) -> None:
        """Send bytes."""

    def receive(self, timeout: float) -> bytes:
        """Return the bytes that have come, waiting up to ``timeout`` [s] for the first."""

    def close(self) -> None:
        """Close it."""


class Board(Device):
    """A board that speaks the protocol of :mod:`pendulum_env.bench.protocol`, at the end of a line.

    Attributes:
        bad: number of its lines so far that were torn or garbled.
    """

    patience: ClassVar[float] = 0.03
    """Time for which an answer is waited for before the question is sent again [s]."""

    def __init__(self) -> None:
        self._line: Line | None = None
        self._sequence = 0
        self._frames = Frames()
        self._counts, self._wraps, self._micros = 0, 0, 0
        self._parting: Any = None

    @abstractmethod
    def connect(self) -> Line:
        """Return the line to the board, just opened; DeviceError if it cannot be."""

    @property
    def bad(self) -> int:
        """Number of the board's lines so far that were torn or garbled."""
        return self._frames.bad

    def open(self, watchdog: float) -> None:
        """Connect, ask the board who it is, and set its watchdog; DeviceError if it is none of ours."""
        patience = self.patience
        if self._line is None:
            self._line, self._frames, patience = self.connect(), Frames(), BOOT / 10
            self._parting = weakref.finalize(self, parted, self._line)  # also where a program ends without close()
        answer = self._asked("H", (max(1, round(1000.0 * watchdog)),), "I", 10, patience)
        if len(answer.numbers) != 3 or answer.numbers[0] != VERSION or answer.numbers[1] < 1:
            raise DeviceError(f"The board at {self} speaks another version of the protocol than {VERSION}; load the "
                              "sketch of this version.")
        self._counts = answer.numbers[1]

    def read(self) -> Reading:
        """Return angle, time, drive and state of the board."""
        return self._reading(self._asked("Q"))

    def write(self, share: float) -> None:
        """Send the drive; it is not answered, but the next reading shows it."""
        self._send(Frame("D", self._next(), (round(FULL * share),)))

    def stop(self) -> None:
        """Switch the motor off, and wait for the board to say so."""
        self._reading(self._asked("S"))

    def close(self) -> None:
        """Switch the motor off, if the board still listens, and close the line."""
        if self._line is not None:
            with suppress(SceneError):
                self.stop()
            self._line = None
            self._parting()

    def _next(self) -> int:
        self._sequence = (self._sequence + 1) % SEQUENCES
        return self._sequence

    def _send(self, frame: Frame) -> None:
        if self._line is None:
            raise DeviceError(f"The board at {self} is not open; reset() opens it.")
        try:
            self._line.send(encoded(frame))
        except OSError as error:
            raise self._lost() from error

    def _lost(self) -> DeviceError:
        return DeviceError(f"The line to the board at {self} is cut; its watchdog stops the motor. Look at the cable, "
                           "then reset().")

    def _asked(self, letter: str, numbers: tuple[int, ...] = (), wanted: str = "R", tries: int = TRIES,
               patience: float | None = None) -> Frame:
        """Send a question until its answer comes, which has its sequence number; DeviceError if none does."""
        for _ in range(tries):
            sequence = self._next()
            self._send(Frame(letter, sequence, numbers))
            until = self.now() + (self.patience if patience is None else patience)
            while (left := until - self.now()) > 0.0:
                for frame in self._heard(left):
                    if (frame.letter, frame.sequence) == (wanted, sequence):
                        return frame
        garbled = f", and sent {self.bad} garbled lines" if self.bad else ""
        raise DeviceError(f"The board at {self} does not answer{garbled}; its watchdog stops the motor. Look at cable, "
                          "supply and sketch, then reset().")

    def _heard(self, timeout: float) -> list[Frame]:
        assert self._line is not None
        try:
            return self._frames.feed(self._line.receive(timeout))
        except OSError as error:
            raise self._lost() from error

    def _reading(self, frame: Frame) -> Reading:
        if len(frame.numbers) != 4 or frame.numbers[3] not in STATES or abs(frame.numbers[2]) > FULL:
            raise DeviceError(f"The board at {self} answers nonsense: {frame.letter} {frame.numbers}; load the sketch "
                              "anew.")
        micros, count, drive, state = frame.numbers
        self._wraps += micros < self._micros - MICROS // 2
        self._micros = micros
        return Reading(1e-6 * (micros + MICROS * self._wraps), math.tau * count / self._counts, drive / FULL,
                       STATES[state])


def parted(line: Line) -> None:
    """Tell a board to stop, without waiting for its answer, and close the line."""
    with suppress(OSError):
        line.send(encoded(Frame("S", 0)))
    with suppress(OSError):
        line.close()


class SerialLine:
    """A serial port, through pyserial."""

    def __init__(self, port: str, baud: int) -> None:
        self._port = library().Serial(port, baud, timeout=0.1, write_timeout=0.1, exclusive=True)

    def send(self, data: bytes) -> None:
        """Send bytes."""
        self._port.write(data)

    def receive(self, timeout: float) -> bytes:
        """Return the bytes that have come."""
        return received(self._port, timeout)

    def close(self) -> None:
        """Close the port."""
        self._port.close()


class SerialBoard(Board):
    """A board at a serial port, such as an Arduino with the README's sketch, through pyserial."""

    name = "serial"
    about = "a board with the README's sketch at a serial port"
    place = "PORT"

    def __init__(self, port: str, baud: int = BAUD) -> None:
        super().__init__()
        if not port:
            raise DeviceError("serial needs the name of a port, as serial:/dev/ttyACM0 or serial:COM3.")
        self.port, self.baud = port, baud

    def __repr__(self) -> str:
        return f"serial:{self.port}"

    def connect(self) -> Line:
        """Open the port; DeviceError names those that exist."""
        try:
            return SerialLine(self.port, self.baud)
        except (OSError, ValueError) as error:
            raise DeviceError(f"serial: {refusal(self.port, error)}") from error


class SocketLine:
    """A connection to another process of this computer."""

    def __init__(self, link: socket.socket) -> None:
        self._link = link
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def send(self, data: bytes) -> None:
        """Send bytes."""
        self._link.sendall(data)

    def receive(self, timeout: float) -> bytes:
        """Return the bytes that have come."""
        if not select.select([self._link], [], [], timeout)[0]:
            return b""
        data = self._link.recv(4096)
        if not data:
            raise ConnectionError("the process has ended")
        return data

    def close(self) -> None:
        """Close the connection."""
        self._link.close()


def checked_late(value: Any, name: str) -> Any:
    """Return a delay of the virtual board [s], or its range; SceneError for one that is not whole milliseconds."""
    checked_delay(value, name, TICK, 1)
    return value


@dataclass(repr=False, eq=False)
class Hung(Checked):
    """The one setting of a virtual board that may be given without its name."""

    scene: Any = setting("lab", "what swings: a preset's name, a dict, a Scene, or a scene's JSON file",
                         lambda value, name: find_scene(value))


@dataclass(repr=False, eq=False, kw_only=True)
class VirtualBoard(Hung, Board):
    """A simulated bench in a process of its own, in real time: serial protocol, firmware and watchdog of a real one.

    Its scene is integrated in steps of a millisecond. Raises SceneError for an invalid value.

    Attributes:
        process: the process, None before the first opening.
    """

    name: ClassVar[str] = "virtual"
    about: ClassVar[str] = "a simulated bench in real time, in a process of its own; works everywhere"
    place: ClassVar[str] = "SCENE"
    real: ClassVar[bool] = False
    patience: ClassVar[float] = 1.0

    sensor: Any = setting(None, "how the angle is read: a Sensor, or a dict of its values", checked_sensor,
                          optional=True, note="None: an encoder with 2400 counts in a turn")
    observation_delay: float | Sequence[float] = setting(0.0, "delay of readings", checked_late, unit="s",
                                                         note="whole milliseconds; (low, high) is drawn")
    action_delay: float | Sequence[float] = setting(0.0, "delay of actions", checked_late, unit="s",
                                                    note="as of readings")
    integrator: str = setting("rk4", "method that integrates it")
    angle: float = si(0.0, "rad", "angle at which the board is switched on")
    velocity: float = si(0.0, "rad/s", "velocity then")
    seed: int = setting(0, "seed of the noise and of gusts", lambda value, name: whole_number(value, name, least=0))
    log: Any = setting(None, "file to which the firmware writes time, drive and state at every change", file_path,
                       optional=True, note="None for none")

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        find_method(self.integrator, self.scene)
        Board.__init__(self)
        self.process: subprocess.Popen[bytes] | None = None
        self._finish: Any = None

    def __str__(self) -> str:
        return f"virtual ({self.scene.name})"

    def connect(self) -> Line:
        """Start the process and wait for it; DeviceError if it does not start."""
        from pendulum_env.bench.virtual_board import Wanted

        self._end()
        with socket.create_server(("127.0.0.1", 0)) as server:
            keywords = {"scene": self.scene, "integrator": self.integrator, "action_delay": self.action_delay,
                        "observation_delay": self.observation_delay,
                        "sensor": self.sensor or Sensor(quantum=math.tau / STEPS_PER_TURN)}
            wanted = Wanted(server.getsockname()[1], keywords, self.angle, self.velocity, self.seed, self.log)
            try:
                told = pickle.dumps(wanted)
            except (pickle.PicklingError, AttributeError, TypeError) as error:
                raise DeviceError(f"The virtual board's settings cannot be handed to its process ({error}); define the "
                                  "scene's own effects in a module.") from None
            process = subprocess.Popen([sys.executable, "-m", "pendulum_env.bench.virtual_board"],
                                       stdin=subprocess.PIPE, stderr=subprocess.PIPE)
            self.process = process
            assert process.stdin is not None
            assert process.stderr is not None
            with suppress(OSError), process.stdin as pipe:
                pipe.write(told)
            until = time.monotonic() + START
            while not select.select([server], [], [], 0.05)[0]:
                if process.poll() is not None:
                    raise DeviceError(f"The virtual board has not started: {self._last_words() or 'it said nothing'}.")
                if time.monotonic() > until:
                    process.kill()
                    ended(process)
                    raise DeviceError(f"The virtual board has not started within {START:g} s; try again when the "
                                      "computer is less busy.")
            self._finish = weakref.finalize(self, ended, process)
            return SocketLine(server.accept()[0])

    def close(self) -> None:
        """Cut the line; the process ends by itself."""
        super().close()
        self._end()

    def _lost(self) -> DeviceError:
        words = self._last_words()
        return DeviceError(f"The virtual board has ended: {words}.") if words else super()._lost()

    def _last_words(self) -> str:
        """Return the last line that the process wrote before it ended, "" if it did not end by itself."""
        assert self.process is not None
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(1.0)
        if not self.process.returncode:
            return ""
        stream, lines = self.process.stderr, list[str]()
        if stream is not None and not stream.closed:
            lines = stream.read().decode("utf-8", "replace").strip().splitlines()
        ended(self.process)
        return lines[-1].rpartition("Error: ")[2].rstrip(".") if lines else ""

    def _end(self) -> None:
        if self._finish is not None:
            self._finish()


def ended(process: subprocess.Popen[bytes]) -> None:
    """Wait for the process of a virtual board, whose line is cut, to end, and end it if it does not."""
    try:
        process.wait(5.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    if process.stderr is not None:
        process.stderr.close()


DEVICES: Mapping[str, type[Device]] = {kind.name: kind for kind in (VirtualBoard, SerialBoard)}
"""Name -> class of a device."""


def forms() -> Iterator[str]:
    """Yield the forms of the devices' addresses, such as "serial:PORT"."""
    for kind in DEVICES.values():
        yield f"{kind.name}:{kind.place}" if kind.real else f"{kind.name}[:{kind.place}]"


def device_at(address: Any, scene: Any = "lab", **keywords: Any) -> Device:
    """Return the device at an address such as "virtual", "virtual:truth.json" or "serial:/dev/ttyACM0", not opened yet.

    ``scene`` and ``keywords`` are of the virtual one, where its address names no other scene. A device is returned as
    it is. Raises DeviceError for another name.
    """
    given = " and ".join(word for word, value in keywords.items() if np.any(value))
    if isinstance(address, Device):
        if given:
            raise DeviceError(f"{given} cannot be chosen beside a device; give it to the device itself.")
        return address
    if not isinstance(address, str):
        raise DeviceError(f"device must be an address, as {' or '.join(forms())}, or a Device, not {shown(address)}.")
    name, _, place = address.partition(":")
    if name == VirtualBoard.name:
        return VirtualBoard(place or scene, **keywords)
    if given:
        raise DeviceError(f"{given} cannot be chosen, as a real bench has its own; leave it out.")
    if name == SerialBoard.name:
        return SerialBoard(place)
    raise DeviceError(f"There is no device {shown(address)}{nearest(name, DEVICES)}")
