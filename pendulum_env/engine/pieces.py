"""Division of long runs into short calls, so that Ctrl-C works: Python handles signals only between compiled calls.

One such call is named a piece. The number of steps per piece is adapted during the run, so that a piece takes about
0.05 s (MOMENT) however expensive a step is. The division does not change a single bit of the results, because the state
holds all that a step needs from the step before.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np

from pendulum_env.engine.shape import OK, PAUSED, SLACK, STATE

NOWHERE = np.empty((0, 0))
"""Empty array for the argument ``out`` of ``run``: no records."""
UNREAD = np.empty(0, dtype=np.float32)
"""Empty array for the argument ``seen`` of ``run``: no observation and no reported quantities."""

MOMENT = 0.05
"""Target wall time of one call of a program [s]: a tenth of the allowed delay of Ctrl-C, 10 000 times a call's cost."""
FEW = 2**12
"""Number of steps in the first call of a program for a run; the numbers in later calls are adapted."""
LEAST, MOST = 2**4, 2**26
"""Smallest and largest number of steps in one call of a program."""
GROWTH = 8
"""Largest ratio of the numbers of steps in two successive calls of a program."""
TAKEN = STATE.index("index")
"""Index in the state of the number of steps taken."""


@dataclass
class Pace:
    """Limit of the work in one compiled call, adapted to the speed so that a call takes about 0.05 s.

    Short calls let Ctrl-C interrupt a run. The limit ``units`` counts steps of a single run, attempts of an adaptive
    step, or steps of a block of runs, of which ``share`` are advanced by one thread.
    """

    units: int = FEW
    share: float = 1.0

    @property
    def steps(self) -> int:
        """Return the largest number of steps of all blocks in one call; 0 if one step takes longer."""
        return int(self.units / self.share)

    def learn(self, units: float, seconds: float) -> None:
        """Adapt the limit of the work per call, after ``units`` steps or attempts took ``seconds``.

        Calls with less than half the limit do not count.
        """
        if 2.0 * units >= self.units:
            target = units * MOMENT / max(seconds, 1e-9)
            self.units = int(max(LEAST, min(target, GROWTH * self.units, MOST)))


def run_in_pieces(
    call: Callable[[int, int, Any, Any], int], pace: Pace, work: Sequence[int], state: Any, rows: int, every: int,
    out: Any, seen: Any,
) -> int:
    """Advance a state by ``rows`` times ``every`` steps in several calls of a program, and return the stop code.

    The result is equal, bit for bit, to that of a single call. An interruption, such as KeyboardInterrupt, restores the
    state at the begin.

    Args:
        call: function of ``rows, every, out, seen`` that calls ``run``; it may return PAUSED after part of the work.
        pace: limit of the work per call, which is adapted.
        work: indices of the state's entries that count steps, or attempts of adaptive steps.
        state: the state, advanced in place.
        out, seen: as for ``run``.
    """
    before, records, total, code = state.copy(), len(out) > 0, rows * every, OK
    last = np.empty((1, out.shape[1])) if records else NOWHERE

    def report(records: Any, observation: Any) -> int:
        """Write the present state to ``records`` and its observation to ``observation``, without a step.

        Return the stop code, which becomes DIVERGED if the energy residual is absurdly large.
        """
        checked = call(0, 0, records, observation)
        return code if code > SLACK else checked or code

    try:
        if total <= pace.units and (code := call(rows, every, out, seen)) != PAUSED:
            return code
        taken = float(state[TAKEN] - before[TAKEN])
        if records and not taken:
            report(out[:1], UNREAD)
        while taken < total and code in (OK, PAUSED):
            row, within = divmod(int(taken), every)
            complete = 0 if within else min(rows - row, pace.units // every)
            already, begun = sum(state[place] for place in work), perf_counter()
            if complete:
                code = call(complete, every, out[row : row + complete + 1] if records else NOWHERE, UNREAD)
            else:
                code = call(1, min(every - within, pace.units), NOWHERE, UNREAD)
            seconds = perf_counter() - begun
            pace.learn(pace.units if code == PAUSED else sum(state[place] for place in work) - already, seconds)
            taken = float(state[TAKEN] - before[TAKEN])
            ended = code not in (OK, PAUSED) or taken % every == 0
            if records and not complete and ended and taken > row * every:
                code = report(last, UNREAD)
                out[row + 1] = last[0]
        return report(NOWHERE, seen)
    except BaseException:
        state[:] = before
        raise
