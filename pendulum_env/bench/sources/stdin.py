"""Samples in lines of the standard input, as of a program that prints them."""

from __future__ import annotations

import os
import queue
import sys
import threading
import time
from dataclasses import dataclass, field
from typing import Any, ClassVar

from pendulum_env.bench.lines import LineReader, LineSource
from pendulum_env.bench.source import Chunk, SourceError


@dataclass(frozen=True, repr=False, eq=False)
class Stdin(LineSource):
    """Lines of the standard input, to its end: ``my_program | lab-pendulum acquire --from stdin``."""

    name: ClassVar[str] = "stdin"
    about: ClassVar[str] = "lines or JSON that another program prints"
    tested: ClassVar[str] = "as is"

    _kept: dict[str, Any] = field(default_factory=dict, init=False, repr=False)

    @property
    def notes(self) -> tuple[str, ...]:
        """What was inferred of the lines."""
        reader: LineReader | None = self._kept.get("reader")
        return () if reader is None else tuple(reader.notes)

    @property
    def problem(self) -> str:
        """Why nothing has come, as far as it is known."""
        reader: LineReader | None = self._kept.get("reader")
        return reader.problem if reader is not None else ""

    def open(self) -> None:
        """Begin to read in a thread, because not every system can wait for a pipe with a timeout."""
        try:
            handle = sys.stdin.fileno()
        except (AttributeError, OSError, ValueError):
            raise SourceError("the standard input is closed; pipe a program into this command") from None
        parts: queue.Queue[tuple[bytes, float]] = queue.Queue(1000)

        def listen() -> None:
            data = b"-"
            while data:
                try:
                    data = os.read(handle, 65536)
                except OSError:
                    data = b""
                parts.put((data, time.monotonic()))

        self._kept.update(reader=self.reader(), parts=parts, ended=False)
        threading.Thread(target=listen, daemon=True, name="bench-stdin").start()

    def read(self, timeout: float = 0.1) -> Chunk | None:
        """Return the samples in the lines that have come; None after the end of the input."""
        kept = self._kept
        if kept["ended"]:
            return None
        try:
            data, at = kept["parts"].get(timeout=timeout)
        except queue.Empty:
            data, at = b"", time.monotonic()
            chunk: Chunk = kept["reader"].feed(data, at)
            return chunk
        kept["ended"] = not data
        chunk = kept["reader"].feed(data, at) if data else kept["reader"].end(at)
        return chunk

    def close(self) -> None:
        """Do nothing; the thread ends with the input."""
