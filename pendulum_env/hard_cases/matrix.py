"""Matrix of results: one entry for each pair of hard case and method that was run."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from integrators import Method
from pendulum_env.common.provenance import provenance
from pendulum_env.common.results import Columns, Result, columns_of, one_line
from pendulum_env.common.texts import Table
from pendulum_env.hard_cases.case import OUTCOMES, Case, Finding

COLUMNS = {
    "group": "", "case": "", "scene": "", "method": "", "outcome": "", "as_expected": "", "error": "", "tolerance": "",
    "stop_time_s": "s", "note": "", "known_failure": "",
}
"""Columns of ``stress.csv`` with their units; each case has units of its own for error and tolerance."""


@dataclass(frozen=True)
class MatrixEntry:
    """Result of one hard case with one method.

    Attributes:
        case, method: the pair.
        finding: the outcome with its error.
        expected: True if the outcome is allowed for this method.
        known: reason of a known failure, "" if there is none.
    """

    case: Case
    method: Method
    finding: Finding
    expected: bool
    known: str = ""


@dataclass(frozen=True, repr=False)
class Matrix(Result):
    """Matrix of results of methods in hard cases.

    Attributes:
        cases, methods: all cases and methods of the run.
        entries: one entry for each pair that was run.
        complete: False if the run was interrupted.
    """

    cases: tuple[Case, ...]
    methods: tuple[Method, ...]
    entries: tuple[MatrixEntry, ...]
    complete: bool = True

    def __repr__(self) -> str:
        return one_line(self, f"{len(self.cases)} cases, {len(self.methods)} methods, {len(self.failures)} failures")

    def origin(self) -> Mapping[str, str]:
        """Return the numbers of cases, methods and combinations, with what ran them."""
        return provenance(Cases=len(self.cases), Methods=len(self.methods), Combinations=len(self.entries),
                          Complete=self.complete)

    def tables(self) -> Mapping[str, Columns]:
        """Return the outcome of every method in every case."""
        return {"stress": columns_of(COLUMNS, (
            (e.case.group, e.case.name, e.case.scene.name, e.method.name, e.finding.outcome, int(e.expected),
             *(None if math.isnan(x) else x for x in (e.finding.error, e.finding.tolerance, e.finding.stop_time)),
             e.finding.note, e.known)
            for e in self.entries))}

    def grid(self) -> Sequence[str]:
        """Return the columns that number the rows."""
        return ("case", "method")

    @property
    def failures(self) -> tuple[MatrixEntry, ...]:
        """Results whose outcome is not allowed for the method, without known failures."""
        return tuple(entry for entry in self.entries if not (entry.expected or entry.known))

    @property
    def outdated(self) -> tuple[MatrixEntry, ...]:
        """Results listed as known failures whose outcome is now allowed, so that the list must be shortened."""
        return tuple(entry for entry in self.entries if entry.expected and entry.known)

    @property
    def table(self) -> Table:
        """Table with one row per hard case: the number of methods with each outcome, and of failures."""
        rows = []
        for case in self.cases:
            own = [entry for entry in self.entries if entry.case is case]
            counts = Counter(entry.finding.outcome for entry in own)
            failed = sum(not entry.expected for entry in own)
            rows.append((case.group, case.name, *(str(counts[name] or "-") for name in OUTCOMES), str(failed or "-")))
        return Table(("group", "case", *OUTCOMES, "not as expected"), tuple(rows))

    @property
    def text(self) -> str:
        """Text with the number of case and method pairs that ran, followed by one line for each failure."""
        size = f"{len(self.cases)} cases and {len(self.methods)} methods"
        lines = [f"{len(self.entries)} of {len(self.cases) * len(self.methods)} combinations of {size} ran; "
                 f"{len(self.failures)} failed{'.' if self.complete else '; interrupted before the end.'}"]
        for entry in self.failures:
            finding, may = entry.finding, " or ".join(sorted(entry.case.may(entry.method)))
            line = f"{entry.case.name}, {entry.method.name}: {finding.outcome} instead of {may}"
            lines.append(f"{line}; {finding.note}." if finding.note else f"{line}.")
        known = [entry for entry in self.entries if entry.known and not entry.expected]
        lines += [f"Known failure: {entry.case.name}, {entry.method.name}: {entry.known}" for entry in known]
        lines += [f"Known failure that did not fail: {entry.case.name}, {entry.method.name}; take it off the list."
                  for entry in self.outdated]
        return "\n".join(lines)
