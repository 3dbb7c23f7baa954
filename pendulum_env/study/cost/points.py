"""Results of a work-precision study: measured runs, their Pareto front, measured orders and recommendations."""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pendulum_env.common.provenance import provenance
from pendulum_env.common.results import Columns, Result, columns_of, one_line
from pendulum_env.common.texts import Table
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import number
from pendulum_env.study import PLAIN
from pendulum_env.study.cost.runs import energy_scale
from pendulum_env.truth.answer import Truth
from pendulum_env.truth.reference import StudyError

FLOOR = 10.0
"""Multiple of the reference solution's own error below which a measured error is unreliable and marked."""
FEW = 8
"""Number of lines in a diagram up to which the sentence on the cost of accuracy names them all."""
APART = 1.001
"""Smallest ratio of two steps that count as different."""
COLUMNS = {
    "series": "", "method": "", "dt_s": "s", "rtol": "", "span_s": "s", "steps": "", "force_evaluations": "",
    "angle_error_rad": "rad", "end_angle_error_rad": "rad", "phase_error_rad": "rad", "energy_error": "",
    "time_min_s": "s", "time_median_s": "s", "ns_per_simulated_second": "ns/s", "status": "", "pareto": "",
}
"""Columns of ``cost.csv`` with their units."""
ACCURACIES = tuple(10.0**-k for k in range(1, 13))
"""Angle errors for which the table names a method [rad]."""


@dataclass(frozen=True)
class CostPoint:
    """Measured run of one method at one step, or at one tolerance.

    Attributes:
        method: name of the method.
        dt: step [s]; for an adaptive run its mean step.
        rtol: tolerance of an adaptive run; None for a run with equal steps.
        span: time between the records at which steps of an adaptive run have to end [s], the ``dt`` of a rollout that
            repeats the run; nan for equal steps.
        steps: number of steps of the run.
        angle_error: largest difference to the reference solution over the run [rad]; nan if the run ended early.
        end_error: difference to the reference solution at the end [rad].
        phase_error: largest error along the motion, the time by which the run is early or late, times omega0 [rad];
            nan without a restoring torque, or where the error is more than a quarter of the motion.
        energy_error: largest |energy residual|, over the energy at the start in conservative scenes and over ``m g L``
            in others (without gravity over the energy at the start, or the largest energy where that is 0).
        evaluations: force evaluations; for implicit methods counted in their Newton iterations, for adaptive runs with
            rejected steps; nan for a Taylor series or a closed form. The search of Runge-Kutta methods for the turning
            points under dry friction is not counted, but it is in the times.
        times: wall times of the run, one per timing [s], without compilation.
        ns_per_second: shortest wall time, in ns per simulated second.
        floor: True if the angle error is at most ten times the error of the reference solution itself, and so perhaps
            smaller than measured.
        stop_reason: why the run ended early ("diverged", "slack"), else "".
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
        """Return True if all fields are equal, counting nan as equal to nan (dataclasses do so until Python 3.12)."""
        return type(other) is type(self) and [*vars(self).values()] == [*vars(other).values()]

    @property
    def series(self) -> str:
        """Name of the line in the work-precision diagram with this run, for example "rk4" or "dop853, adaptive"."""
        return self.method if self.rtol is None else f"{self.method}, adaptive"

    @property
    def setting(self) -> str:
        """Step or tolerance of the run as text, such as "steps of 0.01 s" or "rtol = 1e-06"."""
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


@dataclass(frozen=True, repr=False)
class CostStudy(Result):
    """Result of a work-precision study.

    Attributes:
        scene, angle, velocity, duration: scene, start and length of the runs [rad, rad/s, s].
        reference: reference solution from which the errors are computed.
        points: measured runs (method, step, errors, times), method by method, from long steps to short ones.
        repeats: number of timings of each run; long ones are timed half as often.
        complete: False if the study was interrupted, so that some runs are missing.
        left_out: sentence on steps that were left out to save time; "" if there were none.
        machines, versions: processors and package versions of the timings; several where workers of a cluster differ.
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

    def __repr__(self) -> str:
        return one_line(self, f"{self.scene.name}, {self.duration:g} s: {len(self.methods)} methods, "
                        f"{len(self.points)} runs")

    def origin(self) -> Mapping[str, str]:
        """Return scene, start, reference, methods and computers, and the unit of energy errors."""
        return provenance(
            Scene=self.scene.to_dict(), Angle=self.angle, Velocity=self.velocity, Duration=self.duration,
            Reference=self.reference.how, ReferenceError=self.reference.error_estimate, Repeats=self.repeats,
            Complete=self.complete, Method=", ".join(self.methods), LeftOut=self.left_out,
            EnergyError=f"largest energy residual over {energy_scale(self.scene, (1.0,))[1]}",
            Machine="; ".join(self.machines), Versions="; ".join(self.versions),
        )

    def tables(self) -> Mapping[str, Columns]:
        """Return the table of all runs, also of those that ended early."""
        front = set(self.front)
        return {"cost": columns_of(COLUMNS, (
            (p.series, p.method, p.dt, p.rtol, p.span, p.steps, p.evaluations, p.angle_error, p.end_error,
             p.phase_error, p.energy_error, p.time, p.time_median, p.ns_per_second,
             p.stop_reason or ("floor" if p.floor else "ok"), int(p in front))
            for p in self.points))}

    def pictures(self) -> Mapping[str, str]:
        """Return the names of the files of the two diagrams: error over time, errors over evaluations and steps."""
        return {"cost": "time", "cost_errors": "errors"}

    @property
    def table(self) -> Table:
        """Table of the fastest method, its step or tolerance and its time for each accuracy reached."""
        rows = []
        for accuracy in ACCURACIES:
            try:
                best = self.best(accuracy)
            except StudyError:
                break
            error, price = f"{best.angle_error:.1e}", f"{best.ns_per_second:,.0f}"
            rows.append((f"{accuracy:.0e}", best.method, best.setting, error, price))
        head = ("angle error below [rad]", "cheapest method", "with", "its error [rad]", "ns per simulated second")
        return Table(head, tuple(rows))

    @property
    def text(self) -> str:
        """Sentences on the cost of each further digit, and on steps that were left out."""
        return "\n".join(filter(None, (self.sentence(), self.left_out)))

    @property
    def methods(self) -> tuple[str, ...]:
        """Names of the methods measured in the study, in the order in which they were given."""
        return tuple(dict.fromkeys(point.method for point in self.points))

    @property
    def series(self) -> tuple[str, ...]:
        """Names of the lines in the work-precision diagram, such as "rk4" and "dop853, adaptive", in order."""
        return tuple(dict.fromkeys(point.series for point in self.points))

    def of(self, series: str) -> tuple[CostPoint, ...]:
        """Return the runs that form one line of the work-precision diagram, without runs that ended early.

        The name of a line is that of a method for runs with equal steps, and "NAME, adaptive" for runs with a
        tolerance.
        """
        return tuple(point for point in self.points if point.series == series and not point.stop_reason)

    @property
    def front(self) -> tuple[CostPoint, ...]:
        """Pareto front: the measured runs for which no other run is both faster and more accurate.

        Errors too small to be told from that of the reference solution count as equal, see :meth:`known_error`. Runs
        with errors as large as the motion are left out.
        """
        largest = float(np.max(np.abs(self.reference.angle)))
        candidates = [p for p in self.points if not p.stop_reason and p.angle_error < largest]
        return tuple(candidates[i] for i in pareto([(point.time, self.known_error(point)) for point in candidates]))

    def known_error(self, point: CostPoint) -> float:
        """Return a run's angle error [rad], but at least ten times the error of the reference solution."""
        return max(point.angle_error, FLOOR * self.reference.error_estimate)

    def slope(self, series: str) -> float:
        """Return the measured order of a method: the median slope of log(error) over log(step) between successive runs.

        Only runs with errors between 3 % of the largest angle (above, the leading error term does not dominate) and 100
        times the reference solution's error count, and only steps down to that with the smallest error (below, rounding
        dominates). For an adaptive run the step is the mean step; at loose tolerances, where the records limit steps,
        steps may be equal, and such pairs of runs do not count. The slope is nan with fewer than two such runs.
        """
        top = 0.03 * float(np.max(np.abs(self.reference.angle)))
        points = self.of(series)
        least = min(range(len(points)), key=lambda i: points[i].angle_error, default=-1)
        good = [p for p in points[:least + 1] if 100.0 * self.reference.error_estimate < p.angle_error < top]
        slopes = [math.log(p.angle_error / q.angle_error) / math.log(p.dt / q.dt)
                  for p, q in pairwise(good) if p.dt > APART * q.dt]
        return statistics.median(slopes) if slopes else math.nan

    def digit_cost(self, series: str) -> float:
        """Return the factor in computing time for one more correct decimal digit of a method's result.

        It is ``10**(1/p)`` with the method's measured order p, and nan if no order could be measured.
        """
        slope = self.slope(series)
        return 10.0 ** (1.0 / slope) if slope > 0.0 else math.nan

    def sentence(self) -> str:
        """Return a sentence on the factor in time that each further decimal digit costs, cheapest method first.

        In a diagram with more than eight lines, only methods on the Pareto front and common methods are named.
        """
        front = {point.series for point in self.front}
        named = [name for name in self.series if len(self.series) <= FEW or name in front or name in PLAIN]
        known = sorted((cost, name) for name in named if math.isfinite(cost := self.digit_cost(name)))
        if not known:
            return (
                "The cost of a further digit is not known, because no method has two runs with small enough errors; "
                "use shorter steps."
            )
        costs = ", ".join(f"{cost:.{3 if cost < 2.0 else 2}g}x with {short(name)}" for cost, name in known)
        return f"Each further digit costs {costs}."

    def best(self, accuracy: float) -> CostPoint:
        """Return the fastest run with an angle error of at most ``accuracy`` [rad], the reference's own error included.

        Raises SceneError for an accuracy that is not above 0, StudyError with the most accurate run if none reaches it.
        """
        wanted = number(accuracy, "accuracy", above=0.0, unit="rad")
        ended = [point for point in self.points if not point.stop_reason]
        if not ended:
            raise StudyError("No run reached its end; use shorter steps or a gentler start.")
        own = self.reference.error_estimate
        good = [point for point in ended if point.angle_error + own <= wanted]
        if not good:
            near = min(ended, key=lambda point: point.angle_error)
            raise StudyError(
                f"No run reached an accuracy of {wanted:g} rad; the best reached {near.angle_error + own:.2g} rad, "
                f"{near.method} with {near.setting}."
            )
        return min(good, key=lambda point: point.time)


def pareto(points: Sequence[tuple[float, float]]) -> list[int]:
    """Return the indices of the pairs on the Pareto front of pairs of numbers, sorted by the first number.

    A pair is on the front if no other pair is smaller in one number and not larger in the other.
    """
    front: list[int] = []
    least = math.inf
    for i in sorted(range(len(points)), key=lambda i: points[i]):
        if points[i][1] < least or (front and points[i] == points[front[-1]]):
            front.append(i)
            least = points[i][1]
    return front


def short(series: str) -> str:
    """Return the name of a line in a work-precision diagram with ", adaptive" changed to " (adaptive)"."""
    return series.replace(", adaptive", " (adaptive)")
