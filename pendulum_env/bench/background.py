"""Reading a device in a thread of its own, so that a slow answer delays nobody."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from queue import Empty, SimpleQueue
from threading import Event, Thread
from typing import Any

import numpy as np

from pendulum_env.bench.source import NOTHING, Chunk, Source, SourceError

PATIENCE = 60.0
"""Longest time in which a device must open, as a search by Bluetooth takes seconds [s]."""
FAREWELL = 5.0
"""Longest time for closing a device [s]."""


class Background:
    """A thread that opens a device, reads it again and again, and closes it; what it read waits for :meth:`read`.

    ``begin``, ``step`` and ``end`` run in that thread only, as libraries with an event loop want. An error of
    ``begin`` is raised by :meth:`open`, one of ``step`` by :meth:`read` after the samples that came before it.
    """

    def __init__(self, begin: Callable[[], None], step: Callable[[], Chunk], end: Callable[[], None]) -> None:
        self._begin, self._step, self._end = begin, step, end
        self._chunks: SimpleQueue[Chunk] = SimpleQueue()
        self._opened, self._over = Event(), Event()
        self._error: Exception | None = None
        self._begun = False
        self._thread = Thread(target=self._run, daemon=True)

    def open(self) -> None:
        """Open the device and begin to read; raises the error of ``begin``, SourceError after a minute."""
        self._thread.start()
        if not self._opened.wait(PATIENCE):
            self._over.set()
            raise SourceError(f"The device did not open within {PATIENCE:g} s; switch it off and on, and try again")
        if not self._begun and self._error is not None:
            raise self._error

    def read(self, timeout: float) -> Chunk:
        """Return what was read since the last call, waiting up to ``timeout`` [s] for the first sample."""
        try:
            chunks = [self._chunks.get(timeout=0.0 if self._error else timeout)]
        except Empty:
            if self._error is not None:
                raise self._error from None
            return NOTHING
        while not self._chunks.empty():
            chunks.append(self._chunks.get_nowait())
        return joined(chunks)

    def wait(self, seconds: float) -> bool:
        """Wait in ``step``; return True at once when the device is to be closed."""
        return self._over.wait(seconds)

    def close(self) -> None:
        """Close the device; closing twice is allowed."""
        self._over.set()
        if self._thread.is_alive():
            self._thread.join(FAREWELL)

    def _run(self) -> None:
        try:
            self._begin()
            self._begun = True
            self._opened.set()
            while not self._over.is_set():
                chunk = self._step()
                if len(chunk.values) or chunk.lost:
                    self._chunks.put(chunk)
        except Exception as error:  # it belongs to the thread that reads
            self._error = error
        finally:
            self._opened.set()
            self._end()


@dataclass(frozen=True, repr=False, eq=False)
class ThreadedSource(Source):
    """A source whose device is opened by :meth:`_begin`, read by :meth:`_step` and closed by :meth:`_end`, all in one
    thread of their own; what they know of it is in ``_state``.
    """

    _state: dict[str, Any] = field(default_factory=dict, init=False, repr=False)

    @property
    def notes(self) -> tuple[str, ...]:
        """What was found of the device."""
        return tuple(self._state.get("said", ()))

    @property
    def problem(self) -> str:
        """Why no sample comes."""
        return str(self._state.get("problem", ""))

    def open(self) -> None:
        """Connect; SourceError says what is missing and the remedy."""
        self._state.clear()
        self._state.update(said=[], problem="", thread=Background(self._begin, self._step, self._end))
        self._state["thread"].open()

    def read(self, timeout: float = 0.1) -> Chunk:
        """Return the samples that have come since the last call."""
        chunk: Chunk = self._state["thread"].read(timeout)
        return chunk

    def close(self) -> None:
        """Disconnect; closing twice is allowed."""
        thread = self._state.get("thread")
        if thread is not None:
            thread.close()

    def _pause(self, seconds: float) -> bool:
        """Wait in ``_step``; return True at once when the device is to be closed."""
        over: bool = self._state["thread"].wait(seconds)
        return over

    @abstractmethod
    def _begin(self) -> None:
        """Connect; SourceError says what is missing and the remedy."""

    @abstractmethod
    def _step(self) -> Chunk:
        """Return the samples that came, perhaps none, soon; SourceError if the device is lost for good."""

    @abstractmethod
    def _end(self) -> None:
        """Disconnect, also after an error of the other two; raise nothing."""


def joined(chunks: Sequence[Chunk]) -> Chunk:
    """Return chunks, one after the other, as one."""
    if len(chunks) == 1:
        return chunks[0]
    full = [chunk for chunk in chunks if len(chunk.values)] or [chunks[0]]
    times = [chunk.time for chunk in full if chunk.time is not None]
    return Chunk(np.concatenate([chunk.values for chunk in full]), np.concatenate(times) if times else None,
                 sum(chunk.lost for chunk in chunks))
