"""What became of methods in hard cases: one entry for each pair, together a matrix."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from integrators import Method
from pendulum_env.common.tables import Table
from pendulum_env.hard_cases.case import OUTCOMES, Case, Finding


@dataclass(frozen=True)
class Entry:
    """One case with one method.

    Attributes:
        expected: True if the outcome was written down for this kind of method.
        known: why a failure is known, "" where there is none.
    """

    case: Case
    method: Method
    finding: Finding
    expected: bool
    known: str = ""


@dataclass(frozen=True)
class Matrix:
    """What was found; ``complete`` is False if it was interrupted."""

    cases: tuple[Case, ...]
    methods: tuple[Method, ...]
    entries: tuple[Entry, ...]
    complete: bool = True

    @property
    def failures(self) -> tuple[Entry, ...]:
        """Outcomes that were not written down and are not known failures."""
        return tuple(entry for entry in self.entries if not (entry.expected or entry.known))

    @property
    def outdated(self) -> tuple[Entry, ...]:
        """Known failures that did not fail."""
        return tuple(entry for entry in self.entries if entry.expected and entry.known)

    @property
    def table(self) -> Table:
        """Per case: how many methods had each outcome, how many failed."""
        rows = []
        for case in self.cases:
            own = [entry for entry in self.entries if entry.case is case]
            counts = Counter(entry.finding.outcome for entry in own)
            failed = sum(not entry.expected for entry in own)
            rows.append((case.group, case.name, *(str(counts[name] or "-") for name in OUTCOMES), str(failed or "-")))
        return Table(("group", "case", *OUTCOMES, "not as expected"), tuple(rows))

    @property
    def text(self) -> str:
        """How many combinations ran, and each failure in a line."""
        size = f"{len(self.cases)} cases and {len(self.methods)} methods"
        lines = [f"{len(self.entries)} of {len(self.cases) * len(self.methods)} combinations of {size} ran; "
                 f"{len(self.failures)} failed{'.' if self.complete else '; interrupted before the end.'}"]
        for entry in self.failures:
            found, may = entry.finding, " or ".join(sorted(entry.case.may(entry.method)))
            what = f"{entry.case.name}, {entry.method.name}: {found.outcome} instead of {may}"
            lines.append(f"{what}; {found.note}." if found.note else f"{what}.")
        known = [entry for entry in self.entries if entry.known and not entry.expected]
        lines += [f"Known: {entry.case.name}, {entry.method.name}: {entry.known}" for entry in known]
        lines += [f"Known, but it did not fail: {entry.case.name}, {entry.method.name}." for entry in self.outdated]
        return "\n".join(lines)
