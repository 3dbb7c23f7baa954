"""What was chosen and what it promises: the answer of an automatic choice, as data."""

from __future__ import annotations

from dataclasses import dataclass

from integrators import MethodError
from pendulum_env.auto.search import Found
from pendulum_env.common.tables import Table


class AccuracyError(MethodError):
    """An accuracy that cannot be, or that nothing can keep."""


class Chosen(str):
    """A method's name; ``why`` says why it was chosen, ``choice`` has the numbers."""

    why: str = ""
    choice: Choice


@dataclass(frozen=True)
class Choice:
    """What was chosen, and what it promises.

    For starts of the scene's usual run and of the tasks, and torques decided beforehand, the angle's error stays at
    most ``accuracy`` at the end of each control step up to ``horizon``, as long as a small error has not grown more
    than ``growth``-fold. That is measured, not proven: ``error`` is a quarter of the accuracy at most, so that of other
    episodes about one in ``4 tried`` may be worse. It holds for open-loop torques: a policy that holds the bob upright
    hides errors that grow as
    exp(omega0 t).

    Attributes:
        method, substeps: what to run.
        accuracy: asked for [rad]; ``dt``, ``steps``: control step [s], and how many make an episode.
        error: the largest of all probe episodes [rad].
        horizon: time up to which the accuracy holds [s]; inf for whole episodes.
        growth: of a small error, up to which it is promised; ``share``: part of the episodes where it grows further.
        judged, tried: probe episodes that methods ran, the most sensitive of those tried.
        cost: of a control step, in steps of rk4, by ``table``: "shipped" or "measured here".
        others: what costs up to a quarter more: method, substeps, error and cost of each.
        limits: sentences on what is not promised.
    """

    method: str
    substeps: int
    accuracy: float
    dt: float
    steps: int
    error: float
    horizon: float
    growth: float
    share: float
    judged: int
    tried: int
    cost: float
    table: str
    others: tuple[Found, ...]
    limits: tuple[str, ...]

    @property
    def why(self) -> str:
        """Why it was chosen, in a sentence or two, and what is not promised."""
        span = min(self.horizon, self.dt * self.steps)
        plural = "s" * (self.substeps > 1)
        said = (
            f"{self.method} with {self.substeps} substep{plural} errs by at most {self.error:.2g} rad over {span:g} s "
            f"in {self.judged} probe episodes, the most sensitive of {self.tried}, where {self.accuracy:g} is asked "
            f"for; it costs {self.cost:.3g} steps of rk4 a control step by the table {self.table}"
        )
        if self.share:
            said += (f"; in {100.0 * self.share:.2g} % of these, errors grow more than {self.growth:.1g}-fold, beyond "
                     "which nothing is promised")
        if self.others:
            one = self.others[0]
            said += f", and the next best, {one.method} with {one.substeps}, {one.cost / self.cost:.2f} times as much"
        return " ".join([f"{said}.", *self.limits])

    @property
    def ranking(self) -> Table:
        """What was chosen and what comes next, as a table."""
        rows = [(self.method, self.substeps, self.error, self.cost),
                *((one.method, one.substeps, one.error, one.cost) for one in self.others)]
        head = ("method", "substeps", "worst probe error / rad", "cost / rk4 steps", "relative cost")
        return Table(head, tuple((name, str(n), f"{error:.1e}", f"{cost:.3g}", f"{cost / self.cost:.2f}")
                                 for name, n, error, cost in rows))

    @property
    def name(self) -> Chosen:
        """The method's name, which knows why."""
        chosen = Chosen(self.method)
        chosen.why, chosen.choice = self.why, self
        return chosen
