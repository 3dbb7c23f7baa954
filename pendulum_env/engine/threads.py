"""Work in several threads: functions that let go of the interpreter, over ranges of blocks."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from functools import lru_cache
from itertools import pairwise
from threading import Lock

MOST_THREADS = 1024
LARGE = 0.8
"""Share of the blocks that is cut into one piece for each thread; the rest is cut into as many again."""
BLOCKS_EACH = 16
"""Blocks that are worth a thread of their own: handing one over costs as much as some 2000 steps."""


def cores() -> int:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def usual(blocks: int) -> int:
    """Threads for so many blocks: every core for many, one for few."""
    return max(1, min(cores(), blocks // BLOCKS_EACH))


def spread(work: Callable[[int, int, int], None], blocks: int, threads: int) -> None:
    """``work(thread, first, last)`` over all blocks, in ``threads`` threads of which this is one.

    Each has a large piece, and takes a small one when it is done: waking another thread takes as long as some
    thousand steps, and who wakes late leaves more to the others.
    """
    count = max(1, min(threads, blocks))
    if count == 1:
        work(0, 0, blocks)
        return
    ends = [int(LARGE * blocks * i / count) for i in range(count)]
    middle = int(LARGE * blocks)
    ends += [middle + (blocks - middle) * i // count for i in range(count + 1)]
    left, lock = iter([*pairwise(ends)]), Lock()

    def take(thread: int) -> None:
        while True:
            with lock:
                piece = next(left, None)
            if piece is None:
                return
            work(thread, *piece)

    workers = pool(os.getpid(), count - 1)
    others: list[Future[None]] = [workers.submit(take, thread) for thread in range(1, count)]
    try:
        take(0)
    finally:
        for other in others:
            other.result()


@lru_cache(maxsize=8)
def pool(process: int, threads: int) -> ThreadPoolExecutor:
    """Threads of this process: a forked one inherits none, and makes its own."""
    return ThreadPoolExecutor(threads, thread_name_prefix="lab-pendulum")
