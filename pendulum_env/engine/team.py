"""Threads that share the steps of a vector of environments, and look out for the next step in between.

To wake a thread that sleeps takes some 50 µs, as long as a step of several thousand environments. The threads of a team
therefore do not sleep at the end of a step: for at most :data:`LIMIT` they read a number in memory again and again,
which changes when the next step begins. After that they sleep, and the next step wakes them.

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
"""Longest time for which the threads of a team look out for the next step before they sleep [s]."""
LOOKS = 20_000
"""Number of looks by which the time of one is measured."""

APART = 8
"""Distance of the numbers on a board, so that each has a cache line of 64 bytes of its own."""
TURN, DONE, FOUND, ACTION = 0, APART, 2 * APART, 3 * APART
"""Places on the board: number of the present step, of its blocks that are done, the sum of what the program returned
for them, and the address of the actions.
"""
FIRST = 4 * APART
"""Place on the board of the next block in the range of the first thread; those of the others follow."""

Board = NDArray[np.int64]

_LOOKED = "\n".join(indent(LOOKED, 2))
TEAM = f'''
from pendulum_env.engine.atomic import add, floats, load, store


@entry
def team(board, ends, me, seen, looks, state, o, {{given}}):
    """Take part in steps until the board stays as it is for ``looks`` looks; return the number of the last step.

    The first thread begins a step, and looks out for the end of the blocks that others have taken. If an action is not
    finite, it returns {REFUSED} instead.
    """
    count = len(ends) - 1
    if me == 0:
        action = floats(load(board, {ACTION}), size)
{_LOOKED}
        store(board, {DONE}, 0)
        store(board, {FOUND}, 0)
        for i in range(count):
            store(board, {FIRST} + {APART}*i, ends[i])
        add(board, {TURN}, 1)
    idle = 0
    while idle < looks:
        turn = load(board, {TURN})
        if turn == seen:
            idle += 1
            continue
        if turn < 0:
            break
        seen = turn
        idle = 0
        for k in range(count):
            i = (me + k) % count
            b = add(board, {FIRST} + {APART}*i, 1)
            while b < ends[i + 1]:
                action = floats(load(board, {ACTION}), size)
                add(board, {FOUND}, step_blocks(state, o, b, b + 1, {{taken}}))
                add(board, {DONE}, 1)
                b = add(board, {FIRST} + {APART}*i, 1)
        if me == 0:
            break
    if me == 0:
        while load(board, {DONE}) < ends[count] and idle < looks:
            idle += 1
    return seen
'''


def with_team(program: BatchProgram) -> BatchProgram:
    """Return the program with the function ``team``, in which threads share the blocks of a step."""
    lines = program.text.split("\n")
    step = next(node for node in parsed(program.text).body
                if isinstance(node, ast.FunctionDef) and node.name == "step_blocks")
    lines[step.decorator_list[0].lineno - 1] = "@inline"
    taken = [argument.arg for argument in step.args.args[4:]]
    given = [name for name in taken if name != "action"]
    team = TEAM.format(given=", ".join(given), taken=", ".join(taken))
    return replace(program, text="\n".join([*lines, team]), title=f"{program.title}-team")


@dataclass
class Seat:
    """Place of a thread in a team: a lock that it waits for when it sleeps, and True while it sleeps."""

    gate: threading.Lock
    asleep: bool = False


class Team:
    """Threads that share each step of the blocks of a batch.

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
        self._call: Callable[..., int] = functions(with_team(program), backend)["team"]
        self._ends = np.array([len(state) * i // count for i in range(count + 1)])
        self._board: Board = np.zeros(FIRST + APART * count, dtype=np.int64)
        self._board[FIRST::APART] = self._ends[1:]
        self._arguments = [(state, own, *arguments) for own in scratch]
        self._process, self._seats = os.getpid(), [Seat(threading.Lock()) for _ in scratch[1:]]
        looks = self._most = self._looks()
        for number, seat in enumerate(self._seats, 1):
            seat.gate.acquire()
            threading.Thread(target=_work, name="lab-pendulum team", daemon=True, args=(
                self._call, seat, self._board, (self._ends, number), looks, self._arguments[number])).start()
        weakref.finalize(self, _end, self._board, self._seats)

    def _looks(self) -> int:
        """Return the number of looks at the board that take LIMIT."""
        def look(count: int) -> float:
            begun = perf_counter()
            self._call(self._board, self._ends, 1, 0, count, *self._arguments[0])
            return perf_counter() - begun

        look(1)
        return int(LIMIT / (look(LOOKS) / LOOKS))

    @property
    def here(self) -> bool:
        """True in the process in which the threads were started; a forked process inherits none."""
        return self._process == os.getpid()

    def step(self, action: NDArray[np.float32]) -> int:
        """Take a step of all blocks with these actions, contiguous in memory; return what ``step_blocks`` returns."""
        self._board[ACTION] = action.ctypes.data
        for seat in self._seats:
            if seat.asleep:
                seat.asleep = False
                seat.gate.release()
        board = self._board
        if self._call(board, self._ends, 0, int(board[TURN]), self._most, *self._arguments[0]) == REFUSED:
            return REFUSED
        while board[DONE] < self._ends[-1]:  # another program has the core of a thread
            sleep(0)
        return int(board[FOUND])


def _work(call: Callable[..., int], seat: Seat, board: Board, place: tuple[Any, int], looks: int,
          arguments: tuple[Any, ...]) -> None:
    """Take part in the steps of a team until it ends; run in a thread of its own."""
    seen = 0
    while board[TURN] >= 0:
        seen = call(board, *place, seen, looks, *arguments)
        seat.asleep = True
        if board[TURN] >= 0:  # a team that ends later sees that this thread is asleep
            seat.gate.acquire()


def _end(board: Board, seats: Sequence[Seat]) -> None:
    """End the threads of a team."""
    board[TURN] = -1
    for seat in seats:
        if seat.asleep:
            seat.asleep = False
            seat.gate.release()
