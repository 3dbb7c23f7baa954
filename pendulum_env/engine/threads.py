"""Division of work over several threads; each runs a function on some blocks of pendulums, without Python's lock."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from functools import lru_cache
from itertools import pairwise

MOST_THREADS = 1024
"""Largest number of threads that can be requested."""
LARGE = 0.8
"""Fraction of the blocks that is divided into one large range per thread; the rest is divided into small ranges."""
BLOCKS_EACH = 16
"""Minimum number of blocks per thread: handing work to a thread costs as much as some 2000 steps."""


def cores() -> int:
    """Return the number of processor cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def usual(blocks: int) -> int:
    """Return the default number of threads for ``blocks`` blocks of environments: one for few, all cores for many."""
    return max(1, min(cores(), blocks // BLOCKS_EACH))


def spread(work: Callable[[int, int, int], None], blocks: int, threads: int, most: int) -> None:
    """Call ``work(thread, first, last)`` in ``threads`` threads, until all blocks of environments are done.

    The arguments first and last are a range of blocks. The calling thread is one of the threads. Every thread works on
    one large range and then takes small ones: waking a thread takes as long as some thousand steps, and the threads
    that are awake then take more of the small ranges. No range has more than ``most`` blocks. If the calling thread is
    interrupted, the others finish their present ranges and take no more.
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
        """Call ``work`` on ranges of blocks, one after the other, until no range is left."""
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
    """Return this process's pool of ``threads`` threads. A forked process inherits no threads and gets its own pool."""
    return ThreadPoolExecutor(threads, thread_name_prefix="lab-pendulum")
