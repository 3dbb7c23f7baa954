"""Long runs in pieces of bounded work, so that Ctrl-C ends them: Python looks at signals between compiled calls only.

How many steps a piece has is measured as the run goes on, so that a piece takes about MOMENT whatever a step costs.
Pieces change no bit: all that a step takes from the step before is in the state.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import perf_counter
from typing import Any

import numpy as np

from pendulum_env.engine.shape import OK, PAUSED, SLACK, STATE

NOWHERE = np.empty((0, 0))
"""What ``run`` records into where nothing is recorded."""
UNREAD = np.empty(0, dtype=np.float32)
"""What ``run`` puts an observation into that is not wanted: it reports nothing then."""

MOMENT = 0.05
"""Wall time of a piece [s]: a tenth of what Ctrl-C may take, and 10 000 times what it costs to begin one."""
FEW = 2**12
"""Steps of the first piece of a run."""
LEAST, MOST = 2**4, 2**26
GROWTH = 8
"""How many times as much work as the piece before a piece may have."""
TAKEN = STATE.index("index")


class Pace:
    """Amount of work in a piece: as many units as take about MOMENT together, from LEAST to MOST.

    A unit is a step of a single run, a try of an adaptive one, or a step of a block of runs.
    """

    def __init__(self, units: int = FEW) -> None:
        self.units = units

    def learn(self, units: float, seconds: float) -> None:
        """Adapt to the time that a piece took; a piece cut short by the end of a row or a run teaches nothing."""
        if 2.0 * units >= self.units:
            fitting = units * MOMENT / max(seconds, 1e-9)
            self.units = int(max(LEAST, min(fitting, GROWTH * self.units, MOST)))


def run_in_pieces(
    call: Callable[[int, int, Any, Any], int], pace: Pace, work: Sequence[int], state: Any, before: Any, rows: int,
    every: int, out: Any, seen: Any,
) -> int:
    """Take ``rows`` times ``every`` steps, with the bits of one call of ``run``; return why they ended.

    An interruption, such as KeyboardInterrupt, leaves the state as it was before.

    Args:
        call: ``run`` on the state, for ``rows, every, out, seen``; it may return PAUSED after any part of the work.
        pace: bounds the work of a call, and learns from it.
        work: places in the state that count the units of work.
        state: advanced in place, perhaps in part already since ``before``, the state at the beginning.
        out, seen: as for ``run``.
    """
    records, total, code = len(out) > 0, rows * every, OK
    done = int(state[TAKEN] - before[TAKEN])
    last = np.empty((1, out.shape[1])) if records else NOWHERE

    def look(into: Any, told: Any) -> int:
        """Record and report the state; the run has diverged where its ledger is nonsense."""
        found = call(0, 0, into, told)
        return code if code > SLACK else found or code

    try:
        if records and not done:
            look(out[:1], UNREAD)
        while done < total and code in (OK, PAUSED):
            row, within = divmod(done, every)
            whole = 0 if within else min(rows - row, pace.units // every)
            already, begun = sum(state[place] for place in work), perf_counter()
            if whole:
                code = call(whole, every, out[row : row + whole + 1] if records else NOWHERE, UNREAD)
            else:
                code = call(1, min(every - within, pace.units), NOWHERE, UNREAD)
            seconds = perf_counter() - begun
            pace.learn(pace.units if code == PAUSED else sum(state[place] for place in work) - already, seconds)
            done = int(state[TAKEN] - before[TAKEN])
            ended = code not in (OK, PAUSED) or done % every == 0
            if records and not whole and ended and done > row * every:
                code = look(last, UNREAD)
                out[row + 1] = last[0]
        return look(NOWHERE, seen)
    except BaseException:
        state[:] = before
        raise
