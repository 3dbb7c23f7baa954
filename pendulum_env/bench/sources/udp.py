"""Samples in datagrams of the network: lines of text or JSON."""

from __future__ import annotations

import errno
import socket
import time
from dataclasses import dataclass, field
from typing import Any, ClassVar

from pendulum_env.bench.lines import LineReader, LineSource
from pendulum_env.bench.source import Chunk, SourceError
from pendulum_env.physics.units import setting, shown

ROOM = 1 << 20
"""Bytes that the system is asked to keep while they are not read."""
MOST = 500
"""Largest number of datagrams that are read at once."""


@dataclass(frozen=True, repr=False, eq=False)
class Udp(LineSource):
    """Datagrams at a port, of one sample each (or of several lines); those of the first machine that sends, alone."""

    name: ClassVar[str] = "udp"
    about: ClassVar[str] = "lines or JSON by the network; from this machine alone unless --bind"
    address: ClassVar[str] = "port"
    place: ClassVar[str] = "PORT"
    tested: ClassVar[str] = "as is"

    port: Any = setting(None, "number of the port, 1 to 65535", optional=True)
    bind: str = setting("127.0.0.1", "address of this machine at which it listens; 0.0.0.0 for all its networks")
    _kept: dict[str, Any] = field(default_factory=dict, init=False, repr=False)

    @property
    def notes(self) -> tuple[str, ...]:
        """What was inferred of the lines, and from where they come."""
        reader: LineReader | None = self._kept.get("reader")
        return () if reader is None else (*reader.notes, *self._kept["said"])

    @property
    def problem(self) -> str:
        """Why nothing has come, as far as it is known."""
        reader: LineReader | None = self._kept.get("reader")
        return reader.problem if reader is not None else ""

    def open(self) -> None:
        """Listen at the port; SourceError if it is taken or not allowed."""
        text = str(self.port)
        if not text.isdecimal() or not 0 < int(text) < 65536:
            raise SourceError(f"udp needs the number of a port, as udp:5005, not {shown(self.port)}")
        kind = socket.AF_INET6 if ":" in self.bind else socket.AF_INET
        port = socket.socket(kind, socket.SOCK_DGRAM)
        try:
            port.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, ROOM)
            port.bind((self.bind, int(text)))
        except OSError as error:
            port.close()
            why = {errno.EADDRINUSE: f"port {text} is used by another program; end it, or choose another port",
                   errno.EACCES: f"port {text} needs an administrator's rights; choose one from 1024 on",
                   errno.EADDRNOTAVAIL: f"{self.bind} is no address of this machine; 0.0.0.0 stands for all of them",
                   }.get(error.errno or 0, f"{self.bind} and port {text} cannot be used ({error.strerror or error}); "
                                           "--bind takes an address of this machine, such as 0.0.0.0")
            raise SourceError(f"udp: {why}") from None
        self._kept.update(socket=port, reader=self.reader(), sender=None, said=[])

    def read(self, timeout: float = 0.1) -> Chunk:
        """Return the samples in the datagrams that have come."""
        kept, port = self._kept, self._kept["socket"]
        data = bytearray()
        port.settimeout(max(timeout, 1e-3))
        for _ in range(MOST):
            try:
                datagram, sender = port.recvfrom(65535)
            except (TimeoutError, BlockingIOError):
                break
            except ConnectionError:  # Windows reports so that an answer of ours was not taken
                continue
            port.settimeout(0.0)
            if kept["sender"] is None:
                kept["sender"] = sender[0]
                kept["said"].append(f"sender: {sender[0]}")
            if sender[0] == kept["sender"]:
                data += datagram if datagram.endswith(b"\n") else datagram + b"\n"
            elif len(kept["said"]) == 1:
                kept["said"].append(f"left out: what {sender[0]} sends, as {kept['sender']} was first")
        chunk: Chunk = kept["reader"].feed(bytes(data), time.monotonic())
        return chunk

    def close(self) -> None:
        """Free the port; closing twice is allowed."""
        if "socket" in self._kept:
            self._kept["socket"].close()
