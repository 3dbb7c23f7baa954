"""Work in several threads: functions that let go of the interpreter, over ranges of blocks."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from functools import lru_cache

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
    """``work(part, first, last)`` for ``threads`` ranges of all blocks, one of them in this thread."""
    parts = max(1, min(threads, blocks))
    if parts == 1:
        work(0, 0, blocks)
        return
    ends = [blocks * part // parts for part in range(parts + 1)]
    pool = _pool(os.getpid(), parts - 1)
    others: list[Future[None]] = [pool.submit(work, part, ends[part], ends[part + 1]) for part in range(1, parts)]
    try:
        work(0, ends[0], ends[1])
    finally:
        for other in others:
            other.result()


@lru_cache(maxsize=8)
def _pool(process: int, threads: int) -> ThreadPoolExecutor:
    """Threads of this process: a forked one inherits none, and makes its own."""
    return ThreadPoolExecutor(threads, thread_name_prefix="lab-pendulum")
