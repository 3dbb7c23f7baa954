"""What a cost study found: one point per method and step, and what follows from them."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pendulum_env.common.tables import Table
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import number
from pendulum_env.study import PLAIN
from pendulum_env.truth.answer import Truth
from pendulum_env.truth.reference import StudyError

FLOOR = 10.0
"""An error within this many times the reference's own is not known, and marked."""
FEW = 8
"""So many lines can all be named in it."""
APART = 1.001
"""Steps that differ by less are taken for one."""
ACCURACIES = tuple(10.0**-k for k in range(1, 13))
"""Angle errors for which :func:`recommendations` names a method [rad]."""


@dataclass(frozen=True)
class CostPoint:
    """One method at one step, or at one tolerance.

    Attributes:
        method: its name.
        dt: step [s]; with a tolerance, the mean of those that were taken.
        rtol: the tolerance of a run with adapted steps; None for steps of one length.
        span: time after which adapted steps are cut [s], ``dt`` of a rollout that is to repeat the run; nan without.
        steps: taken over the whole run.
        angle_error: the largest difference to the reference over the run [rad]; nan if it did not reach the end.
        end_error: the same at the end [rad].
        phase_error: the largest part of the error along the motion: by how much the run is early or late, times omega0
            [rad]; nan without a restoring torque, or where the error is more than a quarter of the motion.
        energy_error: the largest |energy residual|: over the energy at the start where the scene keeps energy, over
            ``m g L`` elsewhere; without gravity there over the energy at the start, or the largest where that is 0.
        evaluations: of the force; for implicit methods counted in their Newton sweeps, with a tolerance those of steps
            tried in vain too; nan where a step takes a series or a closed form in place of them. What Runge-Kutta
            methods spend on finding the turning points under dry friction is not in it, but it is in the times.
        times: wall time of the whole run, once per repeat [s]; compilation is not in it.
        ns_per_second: the shortest of them, in ns per simulated second.
        floor: the error is within FLOOR times the reference's own estimate: it may be smaller than it seems.
        stop_reason: why it ended early ("diverged", "slack"), else "".
    """

    method: str
    dt: float
    steps: int
    angle_error: float
    end_error: float
    energy_error: float
    evaluations: float
    times: tuple[float, ...]
    ns_per_second: float
    floor: bool = False
    stop_reason: str = ""
    rtol: float | None = None
    phase_error: float = math.nan
    span: float = math.nan

    def __eq__(self, other: object) -> bool:
        """True for equal numbers, nan beside nan too, of which dataclasses say otherwise from Python 3.13 on."""
        return type(other) is type(self) and [*vars(self).values()] == [*vars(other).values()]

    @property
    def series(self) -> str:
        """Which line of the diagram it is on: the method's name, and "adaptive" beside it with a tolerance."""
        return self.method if self.rtol is None else f"{self.method}, adaptive"

    @property
    def setting(self) -> str:
        """Its step or tolerance in words."""
        if self.rtol is None:
            return f"steps of {self.dt:.3g} s"
        return f"rtol = {self.rtol:.2g}" + (f" in spans of {self.span:.3g} s" if math.isfinite(self.span) else "")

    @property
    def time(self) -> float:
        """Shortest wall time of the run [s]."""
        return min(self.times, default=math.nan)

    @property
    def time_median(self) -> float:
        """Median wall time of the run [s]."""
        return statistics.median(self.times) if self.times else math.nan


@dataclass(frozen=True)
class CostStudy:
    """What was measured.

    Attributes:
        scene, angle, velocity, duration: the run [rad, rad/s, s].
        reference: what the errors are against.
        points: in the order of the methods, then from long steps to short ones.
        repeats: timings that were asked for.
        complete: False if it was interrupted; what had been measured is there.
        left_out: steps that were left out for the time they would take, as a sentence; "" if none were.
        machines, versions: what the times are of; several where workers of a cluster differ.
    """

    scene: Scene
    angle: float
    velocity: float
    duration: float
    reference: Truth
    points: tuple[CostPoint, ...]
    repeats: int
    complete: bool = True
    left_out: str = ""
    machines: tuple[str, ...] = ()
    versions: tuple[str, ...] = ()

    @property
    def methods(self) -> tuple[str, ...]:
        """Names of the methods that have points, in order."""
        return tuple(dict.fromkeys(point.method for point in self.points))

    @property
    def series(self) -> tuple[str, ...]:
        """Names of the lines that have points, in order: see :attr:`CostPoint.series`."""
        return tuple(dict.fromkeys(point.series for point in self.points))

    def of(self, series: str) -> tuple[CostPoint, ...]:
        """The points of one line that reached the end; a method's name is the line of its steps of one length."""
        return tuple(point for point in self.points if point.series == series and not point.stop_reason)

    @property
    def front(self) -> tuple[CostPoint, ...]:
        """The Pareto front: points that no other beats in both time and error.

        Errors within the reference's reach count as all of it; those as large as the motion itself take no part.
        """
        largest = float(np.max(np.abs(self.reference.angle)))
        known = [p for p in self.points if not p.stop_reason and p.angle_error < largest]
        return tuple(known[i] for i in pareto([(point.time, self.known_error(point)) for point in known]))

    def known_error(self, point: CostPoint) -> float:
        """The angle error that is known of a point [rad]: no smaller than the reference's reach."""
        return max(point.angle_error, FLOOR * self.reference.error_estimate)

    def slope(self, series: str) -> float:
        """Measured order: median slope of log error over log step between neighbours; nan with fewer than two.

        Between errors of 3 % of the largest angle, where the leading term begins to rule, and 100 times the
        reference's own error, down to the line's smallest: beyond it shorter steps only add rounding. With tolerances
        the mean step counts, and the slope is the method's order too: as the tolerance shrinks, the steps do alike all
        over the swing, and each goes on with the better result.
        """
        top = 0.03 * float(np.max(np.abs(self.reference.angle)))
        found = self.of(series)
        least = min(range(len(found)), key=lambda i: found[i].angle_error, default=-1)
        good = [p for p in found[:least + 1] if 100.0 * self.reference.error_estimate < p.angle_error < top]
        return statistics.median(slopes) if (slopes := _slopes(good)) else math.nan

    def digit_cost(self, series: str) -> float:
        """By how much each further decimal digit multiplies the time: ``10**(1/slope)``."""
        slope = self.slope(series)
        return 10.0 ** (1.0 / slope) if slope > 0.0 else math.nan

    def sentence(self) -> str:
        """The cost of accuracy, cheapest digits first: of all lines if they are few, else of front and PLAIN ones."""
        front = {point.series for point in self.front}
        named = [name for name in self.series if len(self.series) <= FEW or name in front or name in PLAIN]
        known = sorted((cost, name) for name in named if math.isfinite(cost := self.digit_cost(name)))
        if not known:
            return "No method has two errors small enough to say what a further digit costs."
        said = ", ".join(f"{_times(cost)} with {short(name)}" for cost, name in known)
        return f"Each further digit costs {said}."

    def best(self, accuracy: float) -> CostPoint:
        """The cheapest run whose angle error, with the reference's own added, is at most ``accuracy`` [rad].

        Raises SceneError for an accuracy that is not above 0, StudyError naming the best there is if none reaches it.
        """
        wanted = number(accuracy, "accuracy", above=0.0, unit="rad")
        ended = [point for point in self.points if not point.stop_reason]
        if not ended:
            raise StudyError("No run reached its end, so none can be named; take shorter steps or a gentler start.")
        own = self.reference.error_estimate
        good = [point for point in ended if point.angle_error + own <= wanted]
        if not good:
            near = min(ended, key=lambda point: point.angle_error)
            raise StudyError(
                f"No run is known to be within {wanted:g} rad; the best reached {near.angle_error + own:.2g} rad, "
                f"{near.method} with {near.setting}."
            )
        return min(good, key=lambda point: point.time)


def recommendations(study: CostStudy) -> Table:
    """For each accuracy that was reached, the cheapest method with its step or tolerance, and what it costs."""
    rows = []
    for accuracy in ACCURACIES:
        try:
            best = study.best(accuracy)
        except StudyError:
            break
        error, price = f"{best.angle_error:.1e}", f"{best.ns_per_second:,.0f}"
        rows.append((f"{accuracy:.0e}", best.method, best.setting, error, price))
    head = ("angle error below [rad]", "cheapest method", "with", "its error [rad]", "ns per simulated second")
    return Table(head, tuple(rows))


def pareto(points: Sequence[tuple[float, float]]) -> list[int]:
    """Indices of the points that no other is at most equal to in both and below in one, by their first value."""
    found: list[int] = []
    least = math.inf
    for i in sorted(range(len(points)), key=lambda i: points[i]):
        if points[i][1] < least or (found and points[i] == points[found[-1]]):
            found.append(i)
            least = points[i][1]
    return found


def _times(cost: float) -> str:
    return f"{cost:.3g}x" if cost < 2.0 else f"{cost:.2g}x"


def short(series: str) -> str:
    return series.replace(", adaptive", " (adaptive)")


def _slopes(points: Sequence[CostPoint]) -> list[float]:
    """Between neighbours whose steps differ: loose tolerances can give steps that are all cut to one length."""
    pairs = [(p, q) for p, q in pairwise(points) if p.dt > APART * q.dt]
    return [math.log(p.angle_error / q.angle_error) / math.log(p.dt / q.dt) for p, q in pairs]
