"""Lines of a board at a serial port: an encoder's counts, or angles, with or without times."""

from __future__ import annotations

import errno
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

from pendulum_env.bench.lines import LineSource
from pendulum_env.bench.source import NOTHING, Chunk, SourceError
from pendulum_env.physics.units import count, line, setting

USUAL = (115200, 9600, 57600, 38400, 19200, 230400, 250000, 500000, 1000000)
"""Rates [baud] that are tried in turn until text comes, each for ``TRIAL`` bytes."""
TRIAL = 100
NOISE = 0.2
"""Share of characters that are no text at which a rate is wrong."""
RETRY = 0.2
"""Seconds between attempts to open a port again."""
PATIENCE = 300.0
"""Seconds for which a port that is gone is waited for."""
SILENCE = 5.0
"""Seconds without a byte that are worth a note."""
MOST_NAMED = 6


def library() -> Any:
    """Return pyserial; SourceError says how to install it."""
    try:
        import serial
        import serial.tools.list_ports
    except ImportError as error:
        raise SourceError('serial: needs pyserial; install it with pip install "lab-pendulum[serial]"') from error
    if not hasattr(serial, "Serial"):  # the package "serial" of the registry is another one
        raise SourceError('serial: needs pyserial, but another package named serial is installed; remove it with '
                          'pip uninstall serial, then pip install --force-reinstall "lab-pendulum[serial]"')
    return serial


def port_name(value: Any, name: str) -> str:
    """Return the name of a port, or "" for the only one, after checking that it is one line of text."""
    return "" if value == "" else line(value, name)


def ports() -> Iterator[Any]:
    """Yield the ports of this computer, those of USB first; each has ``device``, ``description`` and ``hwid``."""
    found = library().tools.list_ports.comports()
    yield from sorted(found, key=lambda port: (port.vid is None, port.device))


def present() -> str:
    """Return a sentence's end with the ports of this computer."""
    named = [port.device if port.description in ("n/a", "") else f"{port.device} ({port.description})"
             for port in ports()]
    if not named:
        return "this computer has no serial port; plug the board in, with a cable that carries data"
    more = len(named) - MOST_NAMED
    return f"the ports here are {', '.join(named[:MOST_NAMED])}" + (f" and {more} more" if more > 0 else "")


def refusal(device: str, error: Exception) -> str:
    """Return why a port cannot be opened, and the remedy, without a full stop."""
    number, text = getattr(error, "errno", None), str(error)
    if os.path.isfile(device):
        return f"{device} is a file, not a serial port; --from replay:{device} plays a recording"
    if number in (errno.ENOENT, errno.ENODEV, errno.ENXIO) or "FileNotFoundError" in text:
        return f"there is no port {device}; {present()}"
    if number in (errno.EBUSY, errno.EAGAIN) or "PermissionError" in text:  # the second of Windows
        return (f"{device} is open in another program; close that first, for example the serial monitor of the Arduino "
                "IDE or another acquire")
    if number in (errno.EACCES, errno.EPERM):
        group = group_of(device)
        return f"you may not open {device}; " + (
            f"join its group with sudo usermod -a -G {group} $USER, then log out and in" if group != "root" else
            f"allow it with sudo chmod a+rw {device}")
    return f"{device} cannot be opened as a serial port ({' '.join(text.split())}); {present()}"


def group_of(device: str) -> str:
    """Return the group that may open a port, "dialout" where it cannot be told."""
    try:
        import grp

        return grp.getgrgid(os.stat(device).st_gid).gr_name
    except (ImportError, OSError, KeyError):
        return "dialout"


def identity_of(port: Any) -> tuple[Any, ...] | None:
    """Return what names a board of USB whatever its port is called; None for other ports."""
    return None if port.vid is None else (port.vid, port.pid, port.serial_number)


def identity(device: str) -> tuple[Any, ...] | None:
    """Return the same of the port with a name."""
    real = os.path.realpath(device)
    return next((identity_of(port) for port in ports() if port.device in (device, real)), None)


def received(link: Any, timeout: float) -> bytes:
    """Return the bytes that have come, waiting up to ``timeout`` for the first."""
    if link.timeout != timeout:  # setting it talks to the driver
        link.timeout = timeout
    first = bytes(link.read(1))
    return first + bytes(link.read(link.in_waiting)) if first else first


@dataclass(frozen=True, repr=False, eq=False)
class SerialPort(LineSource):
    """Lines that a board sends by a serial port, through pyserial: time and angle, counts, or an angle alone.

    A port that is unplugged is opened again once it is back. Times are those of the board; of lines without them, the
    host's.
    """

    name: ClassVar[str] = "serial"
    about: ClassVar[str] = "lines of a board at a serial port, such as an Arduino with an encoder"
    address: ClassVar[str] = "port"
    place: ClassVar[str] = "PORT"
    extra: ClassVar[str] = "serial"
    tested: ClassVar[str] = "pseudo-terminals, both sketches in a simulated Uno; no real board"

    port: str = setting("", "port, such as /dev/ttyUSB0 or COM3", port_name, note="empty: the only one of USB")
    baud: int | None = count(None, "bits per second", 10_000_000, note="None: the first usual rate that gives text")
    _kept: dict[str, Any] = field(default_factory=dict, init=False, repr=False)

    @property
    def notes(self) -> tuple[str, ...]:
        """What was inferred from the lines, and what happened to the port."""
        return (*self._kept["notes"], *self._kept["reader"].notes) if self._kept else ()

    @property
    def problem(self) -> str:
        """Why no sample comes, as far as it is known."""
        kept = self._kept
        if not kept or kept["samples"]:
            return ""
        return kept["reader"].problem or (
            f"{kept['device']} is open but silent; check that its sketch runs and prints lines of numbers")

    def open(self) -> None:
        """Open the port; SourceError names the ports that exist, or says what else is wrong with it."""
        library()
        device = self.port or self._only()
        self._kept.update(notes=[], reader=self.reader(torn=True), link=None, gone=0.0, gap=False, trial=0,
                          bytes=0, noise=0, silent=False, samples=0)
        self._kept.pop("first", None)
        try:
            self._connect(device)
        except (OSError, ValueError) as error:
            raise SourceError(f"serial: {refusal(device, error)}") from error

    def _only(self) -> str:
        """Return the one port of USB."""
        found = [port.device for port in ports() if port.vid is not None]
        if len(found) == 1:
            return str(found[0])
        which = "several ports are there" if found else "no board is plugged in by USB"
        raise SourceError(f"serial: {which}; name the port as in serial:/dev/ttyUSB0 or serial:COM3; {present()}")

    def _connect(self, device: str) -> None:
        """Open a port by its name; OSError or ValueError for one that cannot be."""
        kept = self._kept
        rate = self.baud or USUAL[kept["trial"] % len(USUAL)]
        kept["link"] = library().Serial(device, rate, timeout=0.1, exclusive=True)
        kept.update(device=device, heard=time.monotonic(), identity=identity(device))

    def read(self, timeout: float = 0.1) -> Chunk:
        """Return the samples of the lines that have come; none while the port is gone."""
        kept = self._kept
        if kept["link"] is None:
            self._seek(timeout)
            return NOTHING
        try:
            data = received(kept["link"], timeout)
        except OSError:  # of pyserial, too
            self._lose()
            return NOTHING
        now = time.monotonic()
        if not data:
            self._listen(now)
            return NOTHING
        kept["heard"] = now
        chunk: Chunk = kept["reader"].feed(data, now)
        if chunk.time is None and len(chunk.values):
            chunk = self._untimed(chunk, now)
        kept["samples"] += len(chunk.values)
        if not kept["samples"]:
            self._judge(data)
        return chunk

    def _untimed(self, chunk: Chunk, now: float) -> Chunk:
        """Return a chunk without times with the number of samples that were lost while the port was gone.

        Their number is that of a gap as long, at the rate at which samples came before.
        """
        kept = self._kept
        lost = 0
        if kept["gap"]:
            passed = kept["last"] - kept["first"]
            lost = round(kept["samples"] / passed * (now - kept["last"])) if passed else 0
        else:
            kept.setdefault("first", now)
        kept.update(last=now, gap=False)
        return replace(chunk, lost=chunk.lost + lost)

    def _listen(self, now: float) -> None:
        """Note once that nothing comes."""
        kept = self._kept
        if now - kept["heard"] > SILENCE and not kept["silent"]:
            kept["silent"] = True
            kept["notes"].append(f"nothing has come from {kept['device']} for {SILENCE:g} s; is the sketch running?")

    def _judge(self, data: bytes) -> None:
        """Set another rate if what comes is no text; SourceError if nothing of it can be read."""
        kept = self._kept
        text = data.decode("utf-8", "replace")
        kept["bytes"] += len(text)
        kept["noise"] += sum(letter == "\ufffd" or (letter < " " and letter not in "\t\r\n") for letter in text)
        if kept["bytes"] < TRIAL:
            return
        if kept["noise"] < NOISE * kept["bytes"]:
            if kept["reader"].problem:
                raise SourceError(f"serial: {kept['reader'].problem}; send lines of numbers, such as 12340 56")
            return
        if self.baud is not None:
            raise SourceError(f"serial: {kept['device']} sends no text at {self.baud} baud; leave out --baud to find "
                              "the rate, or give that of the sketch's Serial.begin")
        kept["trial"] += 1
        if kept["trial"] >= 2 * len(USUAL):
            raise SourceError(f"serial: {kept['device']} sends no text at any of {', '.join(map(str, USUAL))} baud; "
                              "give --baud, the rate of the sketch's Serial.begin")
        rate = USUAL[kept["trial"] % len(USUAL)]
        kept.update(bytes=0, noise=0, reader=self.reader(torn=True))
        kept["notes"][:] = [f"rate: {rate} baud, as others gave no text"]
        kept["link"].baudrate = rate

    def _lose(self) -> None:
        """Close a port that does not answer any more."""
        kept = self._kept
        self.close()
        kept.update(gone=time.monotonic(), gap=kept["samples"] > 0)
        kept["reader"].broken()
        kept["notes"].append(f"{kept['device']} is gone; plug it in again to go on")

    def _seek(self, timeout: float) -> None:
        """Open a port again that was gone, if it is back; SourceError once it has been gone for ``PATIENCE``."""
        kept = self._kept
        time.sleep(min(timeout, RETRY))
        away = time.monotonic() - kept["gone"]
        if away > PATIENCE:
            raise SourceError(f"serial: {kept['device']} has been gone for {away:.0f} s; plug it in and start again")
        try:
            self._connect(self._moved())
        except (OSError, ValueError):  # not there yet, or not ours yet
            return
        kept["notes"].append(f"{kept['device']} is back after {away:.1f} s")

    def _moved(self) -> str:
        """Return the name of the port now: a board may come back under another one."""
        kept = self._kept
        known = kept["identity"]
        if known is None or os.path.exists(kept["device"]):
            return str(kept["device"])
        same = [port.device for port in ports() if identity_of(port) == known]
        return str(same[0] if len(same) == 1 else kept["device"])

    def close(self) -> None:
        """Close the port."""
        link = self._kept.get("link")
        if link is not None:
            self._kept["link"] = None
            link.close()
