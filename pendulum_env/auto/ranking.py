"""The methods among which ``integrator="auto"`` chose, as the result of a study."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pendulum_env.auto.choice import Choice
from pendulum_env.common.provenance import provenance
from pendulum_env.common.results import Columns, Result, columns_of, one_line
from pendulum_env.common.texts import Table

COLUMNS = {"method": "", "substeps": "", "error_rad": "rad", "cost_rk4_steps": ""}
"""Columns of the table with their units."""


@dataclass(frozen=True, repr=False)
class Ranking(Result):
    """The method of an automatic choice and the next cheapest ones."""

    choice: Choice

    def __repr__(self) -> str:
        return one_line(self, f"{self.choice.method} with {self.choice.substeps} substeps")

    def origin(self) -> Mapping[str, str]:
        """Return accuracy [rad], control step [s] and length of an episode, with what computed the choice."""
        return provenance(Accuracy=self.choice.accuracy, ControlStep=self.choice.dt, Steps=self.choice.steps,
                          Costs=self.choice.table)

    def tables(self) -> Mapping[str, Columns]:
        """Return the methods, from the cheapest, with their substeps, largest error and cost."""
        one = self.choice
        return {"auto": columns_of(COLUMNS, [
            (one.method, one.substeps, one.error, one.cost),
            *((other.method, other.substeps, other.error, other.cost) for other in one.others)])}

    @property
    def table(self) -> Table:
        """Table of the methods."""
        return self.choice.ranking

    @property
    def text(self) -> str:
        """Reasons for the choice, and the cases in which the accuracy is not guaranteed."""
        return self.choice.why
