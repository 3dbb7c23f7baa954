"""Pool of threads that share the steps of a vector of environments and spin-wait for the next step in between.

To wake a thread that sleeps takes some 50 µs, as long as a step of several thousand environments. The workers of a
spinning pool therefore do not sleep at the end of a step: for at most :data:`LIMIT` they read a number in memory again
and again, which changes when the next step begins. After that they sleep, and the next step wakes them.

Every thread has a range of blocks of its own, which stay in its core's cache from step to step, and takes them one by
one; a thread that is done helps the others. So a step does not wait for a thread that is still asleep.
"""

from __future__ import annotations

import ast
import os
import threading
import weakref
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from time import perf_counter, sleep
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.sources import parsed
from pendulum_env.engine.blocks import LOOKED, REFUSED
from pendulum_env.engine.generate import BatchProgram
from pendulum_env.engine.kernels import functions
from pendulum_env.engine.shape import indent

LIMIT = 1e-3
"""Longest time for which workers spin-wait for the next step before they sleep [s]."""
TRIED = 20_000
"""Number of spins by which the time of one is measured."""

APART = 8
"""Distance of the numbers of a queue, so that each has a cache line of 64 bytes of its own."""
TURN, DONE, FOUND, ACTION = 0, APART, 2 * APART, 3 * APART
"""Indices in the queue: number of the present step, of its blocks that are done, the sum of what the program returned
for them, and the address of the actions.
"""
FIRST = 4 * APART
"""Index in the queue of the next block in the range of the first worker; those of the others follow."""

Queue = NDArray[np.int64]

_LOOKED = "\n".join(indent(LOOKED, 2))
SHARED = f'''
from pendulum_env.engine.atomic import add, floats, load, store


@entry
def share_steps(queue, ends, me, seen, spins, state, o, {{given}}):
    """Take part in steps until the queue stays as it is for ``spins`` spins; return the number of the last step.

    The first worker begins a step, and spin-waits for the end of the blocks that others have taken. If an action is not
    finite, it returns {REFUSED} instead.
    """
    count = len(ends) - 1
    if me == 0:
        action = floats(load(queue, {ACTION}), size)
{_LOOKED}
        store(queue, {DONE}, 0)
        store(queue, {FOUND}, 0)
        for i in range(count):
            store(queue, {FIRST} + {APART}*i, ends[i])
        add(queue, {TURN}, 1)
    idle = 0
    while idle < spins:
        turn = load(queue, {TURN})
        if turn == seen:
            idle += 1
            continue
        if turn < 0:
            break
        seen = turn
        idle = 0
        for k in range(count):
            i = (me + k) % count
            b = add(queue, {FIRST} + {APART}*i, 1)
            while b < ends[i + 1]:
                action = floats(load(queue, {ACTION}), size)
                add(queue, {FOUND}, step_blocks(state, o, b, b + 1, {{taken}}))
                add(queue, {DONE}, 1)
                b = add(queue, {FIRST} + {APART}*i, 1)
        if me == 0:
            break
    if me == 0:
        while load(queue, {DONE}) < ends[count] and idle < spins:
            idle += 1
    return seen
'''


def with_shared_steps(program: BatchProgram) -> BatchProgram:
    """Return the program with the function ``share_steps``, in which workers share the blocks of a step."""
    lines = program.text.split("\n")
    step = next(node for node in parsed(program.text).body
                if isinstance(node, ast.FunctionDef) and node.name == "step_blocks")
    lines[step.decorator_list[0].lineno - 1] = "@inline"
    taken = [argument.arg for argument in step.args.args[4:]]
    given = [name for name in taken if name != "action"]
    shared = SHARED.format(given=", ".join(given), taken=", ".join(taken))
    return replace(program, text="\n".join([*lines, shared]), title=f"{program.title}-shared")


@dataclass
class Worker:
    """Worker of a spinning pool: a lock that its thread waits for when it sleeps, and True while it sleeps."""

    gate: threading.Lock
    asleep: bool = False

    def wake(self) -> None:
        """Wake the worker's thread if it sleeps."""
        if self.asleep:
            self.asleep = False
            self.gate.release()


class SpinningPool:
    """Workers, each a thread, that share each step of the blocks of a batch.

    Args:
        program: the batch's program.
        backend: its backend.
        state: array of the blocks.
        scratch: for each thread, an array of the results of a block.
        arguments: all further arguments of the program's ``step_blocks`` but the actions, the same in every step.
    """

    def __init__(self, program: BatchProgram, backend: Any, state: NDArray[np.float64],
                 scratch: Sequence[NDArray[np.float64]], arguments: tuple[Any, ...]) -> None:
        count = len(scratch)
        self._call: Callable[..., int] = functions(with_shared_steps(program), backend)["share_steps"]
        self._ends = np.array([len(state) * i // count for i in range(count + 1)])
        self._queue: Queue = np.zeros(FIRST + APART * count, dtype=np.int64)
        self._queue[FIRST::APART] = self._ends[1:]
        self._arguments = [(state, own, *arguments) for own in scratch]
        self._process, self._workers = os.getpid(), [Worker(threading.Lock()) for _ in scratch[1:]]
        spins = self._most = self._spins()
        for number, worker in enumerate(self._workers, 1):
            worker.gate.acquire()
            threading.Thread(target=_work, name="lab-pendulum spinning", daemon=True, args=(
                self._call, worker, self._queue, (self._ends, number), spins, self._arguments[number])).start()
        weakref.finalize(self, _end, self._queue, self._workers)

    def _spins(self) -> int:
        """Return the number of spins that take LIMIT."""
        def spin(count: int) -> float:
            begun = perf_counter()
            self._call(self._queue, self._ends, 1, 0, count, *self._arguments[0])
            return perf_counter() - begun

        spin(1)
        return int(LIMIT / (spin(TRIED) / TRIED))

    @property
    def here(self) -> bool:
        """True in the process in which the threads were started; a forked process inherits none."""
        return self._process == os.getpid()

    def step(self, action: NDArray[np.float32]) -> int:
        """Take a step of all blocks with these actions, contiguous in memory; return what ``step_blocks`` returns."""
        self._queue[ACTION] = action.ctypes.data
        for worker in self._workers:
            worker.wake()
        queue = self._queue
        if self._call(queue, self._ends, 0, int(queue[TURN]), self._most, *self._arguments[0]) == REFUSED:
            return REFUSED
        while queue[DONE] < self._ends[-1]:  # another program has the core of a thread
            sleep(0)
        return int(queue[FOUND])


def _work(call: Callable[..., int], worker: Worker, queue: Queue, share: tuple[Any, int], spins: int,
          arguments: tuple[Any, ...]) -> None:
    """Take part in the steps of a pool until it ends; run in a thread of its own."""
    seen = 0
    while queue[TURN] >= 0:
        seen = call(queue, *share, seen, spins, *arguments)
        worker.asleep = True
        if queue[TURN] >= 0:  # a pool that ends later sees that this thread is asleep
            worker.gate.acquire()


def _end(queue: Queue, workers: Sequence[Worker]) -> None:
    """End the threads of a pool."""
    queue[TURN] = -1
    for worker in workers:
        worker.wake()
