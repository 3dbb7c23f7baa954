"""Clocks of live samples: stamps of the computer's clock with their jitter, and the rate of a device's clock."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from pendulum_env.bench.source import FloatArray

WINDOW = 1.0
"""Time over which the rate of samples is measured [s]."""
GAP = 5.0
"""A step of time stamps beyond this many usual ones is a gap, and no jitter."""
LEAST = 60.0
"""Time after which the device's clock is compared with the computer's [s]."""
FEW = 20
"""Fewest steps of time stamps from which a jitter is given."""


class Rate:
    """Number of samples per second over the last second, by their own times."""

    def __init__(self) -> None:
        self._seen: deque[tuple[float, int]] = deque()
        self._count = 0

    def add(self, at: FloatArray) -> float:
        """Add times [s]; return the rate [1/s], nan for less than two samples."""
        self._count += len(at)
        self._seen.append((float(at[-1]), self._count))
        while len(self._seen) > 2 and self._seen[1][0] <= at[-1] - WINDOW:
            self._seen.popleft()
        (first, before), (last, count) = self._seen[0], self._seen[-1]
        if last > first:
            return (count - before) / (last - first)
        return (len(at) - 1) / float(at[-1] - at[0]) if len(at) > 1 and at[-1] > at[0] else math.nan


class Stamps:
    """Times of samples without a clock of their own, by the computer's; several that came at once are spread evenly.

    ``usual`` is the mean step [s]. The jitter is ``std(t_(k+1) - t_k) / sqrt(2)``, that of independent deviations from
    even times.
    """

    def __init__(self) -> None:
        self.last, self.usual = -math.inf, math.nan
        self._count, self._mean, self._squares = 0, 0.0, 0.0

    def of(self, count: int, now: float) -> FloatArray:
        """Return the times [s] of ``count`` samples that were read at ``now``.

        Of several that are the first ever, only the last one gets a time, as nobody knows when the others came.
        """
        if self.last == -math.inf:
            self.last = now
            return np.array([now])
        step = max(now - self.last, 1e-6) / count
        if count > 1 and math.isfinite(self.usual):  # after a gap they came at their usual rate
            step = min(step, 1.5 * self.usual)
        at = np.asarray(now - step * np.arange(count - 1, -1, -1))
        for each in [float(at[0]) - self.last, *[step] * (count - 1)]:
            self._add(each)
        self.last = now
        return at

    def _add(self, step: float) -> None:
        if self._count >= FEW and step > GAP * self.usual:
            return
        self._count += 1
        before = self._mean
        self._mean += (step - before) / self._count
        self._squares += (step - before) * (step - self._mean)
        self.usual = self._mean

    @property
    def note(self) -> str:
        """Sentence on the jitter, "" before it is known."""
        if self._count < FEW:
            return ""
        jitter = math.sqrt(self._squares / self._count / 2.0)
        return (f"jitter: {1e3 * jitter:.3g} ms, standard deviation of the computer's times about even steps of "
                f"{1e3 * self.usual:.4g} ms")


class Drift:
    """Rate of a device's clock against the computer's: the slope of the line through the pairs of their times.

    A sample is read some time after its own; the scatter of these delays gives the slope's error.
    """

    def __init__(self) -> None:
        self._first: tuple[float, float] | None = None
        self._sums = np.zeros(6)
        self._span = 0.0

    def add(self, device: float, host: float) -> None:
        """Add the time of a sample on the device's clock, and that of its arrival on the computer's [s]."""
        if self._first is None:
            self._first = device, host
        # the difference of the clocks, which is small, against the time keeps the digits
        x = host - self._first[1]
        y = (device - self._first[0]) - x
        self._sums += (1.0, x, y, x * x, x * y, y * y)
        self._span = x

    @property
    def slope(self) -> tuple[float, float]:
        """Relative difference of the device's clock and its standard error; nan before it is known."""
        n, sx, sy, sxx, sxy, syy = self._sums.tolist()
        if n < FEW or self._span < LEAST:
            return math.nan, math.nan
        across = sxx - sx * sx / n
        slope = (sxy - sx * sy / n) / across
        rest = max(syy - sy * sy / n - slope * slope * across, 0.0)
        return slope, math.sqrt(rest / (n - 2.0) / across)

    @property
    def note(self) -> str:
        """Sentence on the device's clock, "" in the first minute."""
        slope, error = self.slope
        if not math.isfinite(slope):
            return ""
        if abs(slope) <= 3.0 * error:
            return f"clock: the device's agrees with the computer's within {3e6 * error:.2g} parts per million"
        word = "fast" if slope > 0.0 else "slow"
        return (f"clock: the device's is {word} by {1e6 * abs(slope):.3g} ± {1e6 * error:.2g} parts per million by the "
                "computer's; times are the device's")
