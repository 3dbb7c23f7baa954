"""Work in several threads: functions that let go of the interpreter, over ranges of blocks."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from functools import lru_cache
from itertools import pairwise

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


def spread(work: Callable[[int, int, int], None], blocks: int, threads: int, most: int) -> None:
    """``work(thread, first, last)`` over all blocks, in ``threads`` threads of which this is one.

    Each has a large piece, and takes a small one when it is done: waking another thread takes as long as some
    thousand steps, and who wakes late leaves more to the others. No piece has more than ``most`` blocks. Where this
    thread is interrupted, the others end the pieces that they have, and take no more.
    """
    count = max(1, min(threads, blocks))
    if count == 1 and blocks <= most:
        work(0, 0, blocks)
        return
    middle = int(LARGE * blocks)
    ends = [int(LARGE * blocks * i / count) for i in range(count)]
    ends += [middle + (blocks - middle) * i // count for i in range(count + 1)]
    left = deque((start, min(start + most, end)) for first, end in pairwise(ends) for start in range(first, end, most))

    def take(thread: int) -> None:
        while left:
            try:
                piece = left.popleft()
            except IndexError:  # another thread was quicker
                return
            work(thread, *piece)

    others: list[Future[None]] = []
    try:
        for thread in range(1, count):
            others.append(pool(os.getpid(), count - 1).submit(take, thread))
        take(0)
        for other in others:
            other.result()
    except BaseException:
        left.clear()
        wait(others)
        raise


@lru_cache(maxsize=8)
def pool(process: int, threads: int) -> ThreadPoolExecutor:
    """Threads of this process: a forked one inherits none, and makes its own."""
    return ThreadPoolExecutor(threads, thread_name_prefix="lab-pendulum")
