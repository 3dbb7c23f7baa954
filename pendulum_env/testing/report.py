"""Outcomes of the checks of a vector environment, and their table."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass

WIDTH = 80
"""Number of columns of a report."""


@dataclass(frozen=True)
class VectorCheck:
    """One check of a vector environment.

    Attributes:
        level: "contract", "NextStep", "SameStep", "Disabled" or "equality".
        name: what was checked, such as "seeds".
        outcome: "passed", "failed" or "skipped".
        said: what was wanted and what came instead, or why the check was skipped.
    """

    level: str
    name: str
    outcome: str
    said: str = ""


@dataclass(frozen=True)
class VectorReport:
    """Outcomes of all checks of a vector environment; ``print`` shows them as a table of at most 80 columns.

    Attributes:
        title: text that names the vector environment.
        checks: all checks, in the order in which they were made.
    """

    title: str
    checks: tuple[VectorCheck, ...]

    @property
    def passed(self) -> tuple[VectorCheck, ...]:
        """Checks that the vector environment passed."""
        return self._with("passed")

    @property
    def failed(self) -> tuple[VectorCheck, ...]:
        """Checks that the vector environment failed; ``said`` has what was wanted and what came instead."""
        return self._with("failed")

    @property
    def skipped(self) -> tuple[VectorCheck, ...]:
        """Checks that were not possible; ``said`` has why."""
        return self._with("skipped")

    def _with(self, outcome: str) -> tuple[VectorCheck, ...]:
        return tuple(check for check in self.checks if check.outcome == outcome)

    def __str__(self) -> str:
        counts = ", ".join(f"{len(self._with(outcome))} {outcome}" for outcome in ("passed", "failed", "skipped"))
        lines = textwrap.wrap(f"{self.title}: {counts}", WIDTH)
        widths = [max((len(text) for text in column), default=0) for column in zip(
            *((check.level, check.name, check.outcome) for check in self.checks), strict=True)]
        for check in self.checks:
            cells = (check.level, check.name, check.outcome.upper() if check.outcome == "failed" else check.outcome)
            head = "  ".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True))
            lines += textwrap.wrap(f"{head}  {check.said}".rstrip(), WIDTH, subsequent_indent=" " * (len(head) + 2),
                                   replace_whitespace=False, drop_whitespace=True)
        return "\n".join(lines)
