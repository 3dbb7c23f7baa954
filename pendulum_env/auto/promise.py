"""The result of ``integrator="auto"``: the chosen method, its measured accuracy, and the limits of this accuracy."""

from __future__ import annotations

from dataclasses import dataclass

from integrators import MethodError
from pendulum_env.auto.search import Candidate
from pendulum_env.common.tables import Table


class AccuracyError(MethodError):
    """Error of a requested accuracy that is not a positive number, or that no method can reach."""


class Chosen(str):
    """The name of an automatically chosen method, as text.

    ``why`` gives the reasons for the choice in words, ``choice`` the measured numbers.
    """

    why: str = ""
    choice: Choice


@dataclass(frozen=True)
class Choice:
    """An automatically chosen method with its substeps, and the accuracy for which it was chosen.

    For starts of the scene's usual run and of the tasks, and torques that do not depend on the motion, the angle's
    error stays at most ``accuracy`` at the end of each control step up to ``horizon``, as long as a small error has not
    grown more than ``growth``-fold. This statement is measured, not proven: ``error`` is at most a quarter of the
    accuracy, so about one in ``4 tried`` other episodes may be worse. It holds for open-loop torques: a policy that
    holds the bob upright hides errors that grow as exp(omega0 t).

    Attributes:
        method, substeps: the chosen method and its steps in a control step.
        accuracy: the requested accuracy [rad]; ``dt``, ``steps``: control step [s], and control steps in an episode.
        error: the largest error in all probe episodes, the runs in which methods were compared [rad].
        horizon: time up to which the accuracy holds [s]; inf for whole episodes.
        growth: growth of a small error up to which the accuracy holds; ``share``: share of episodes with larger growth.
        judged, tried: number of probe episodes that methods ran, and number of episodes from which these were selected
            as the most sensitive to errors.
        cost: cost of a control step, in units of a step of rk4; ``table`` is the origin of the costs, "shipped" or
            "measured here".
        others: the methods that cost up to a quarter more: method, substeps, error and cost of each.
        limits: sentences on the cases in which the accuracy is not guaranteed.
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
    others: tuple[Candidate, ...]
    limits: tuple[str, ...]

    @property
    def why(self) -> str:
        """Return the reasons for the automatic choice, and the cases in which the accuracy is not guaranteed, as text.
        """
        span = min(self.horizon, self.dt * self.steps)
        plural = "s" * (self.substeps > 1)
        reasons = (
            f"{self.method} with {self.substeps} substep{plural} has an error of at most {self.error:.2g} rad over "
            f"{span:g} s in {self.judged} test episodes, the most sensitive of {self.tried}; the requested accuracy is "
            f"{self.accuracy:g} rad; a control step costs {self.cost:.3g} steps of rk4 by the table {self.table}"
        )
        if self.share:
            reasons += (f"; in {100.0 * self.share:.2g} % of these, errors grow more than {self.growth:.1g}-fold, and "
                        "the accuracy may not be reached")
        if self.others:
            one = self.others[0]
            reasons += (f"; the next best method, {one.method} with {one.substeps}, costs {one.cost / self.cost:.2f} "
                        "times as much")
        return " ".join([f"{reasons}.", *self.limits])

    @property
    def ranking(self) -> Table:
        """Return the chosen method and the next cheapest ones as a table, with substeps, error and cost."""
        rows = [(self.method, self.substeps, self.error, self.cost),
                *((one.method, one.substeps, one.error, one.cost) for one in self.others)]
        head = ("method", "substeps", "worst probe error / rad", "cost / rk4 steps", "relative cost")
        return Table(head, tuple((name, str(n), f"{error:.1e}", f"{cost:.3g}", f"{cost / self.cost:.2f}")
                                 for name, n, error, cost in rows))

    @property
    def name(self) -> Chosen:
        """Return the chosen method's name, a text with the reasons for the choice in its attribute ``why``."""
        chosen = Chosen(self.method)
        chosen.why, chosen.choice = self.why, self
        return chosen
