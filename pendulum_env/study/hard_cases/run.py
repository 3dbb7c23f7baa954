"""Cases times methods: what became of each pair, as a matrix, a table and a CSV file."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import integrators
from integrators import Method, MethodError
from pendulum_env.catalogue import Table
from pendulum_env.engine.starts import listed_methods, none_twice
from pendulum_env.physics.units import one_of, several, truth
from pendulum_env.progress import Progress, told_by
from pendulum_env.provenance import output_folder, provenance, write_csv
from pendulum_env.study.hard_cases.case import OUTCOMES, Case, Finding
from pendulum_env.study.hard_cases.catalogue import CASES
from pendulum_env.study.hard_cases.known_failures import KNOWN_FAILURES

COLUMNS = ("group", "case", "scene", "method", "outcome", "as_expected", "error", "tolerance", "stop_time_s", "note",
           "known_failure")


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
        return "\n".join(lines)


def chosen_cases(names: Sequence[str] | None, long: bool) -> tuple[Case, ...]:
    """Cases by their names or their groups'; all of them, or all short ones, by default. SceneError if unknown."""
    if names is None:
        return tuple(case for case in CASES if long or not case.long)
    groups, single = {case.group for case in CASES}, {case.name for case in CASES}
    for name in several(names, "cases", "names of hard cases"):
        one_of(name, "hard case or group", groups | single)
    return tuple(case for case in CASES if case.name in names or case.group in names)


def stress(
    cases: Sequence[str] | None = None,
    integrators_: Iterable[str | Method] | None = None,
    *,
    scene: str | None = None,
    long: bool = False,
    progress: Progress | None = None,
) -> Matrix:
    """Try methods in hard cases.

    Args:
        cases: names of cases or of groups; by default all.
        integrators_: names or methods; by default all.
        scene: only cases of this scene.
        long: with those that take more than a few seconds per method.
        progress: called with the fraction done and what is being done.

    KeyboardInterrupt ends it early, with what was found. Raises SceneError or MethodError for unknown names.
    """
    found = chosen_cases(cases, truth(long, "long") or cases is not None)
    if scene is not None:
        scenes = {case.scene.name for case in CASES}
        one_of(scene, "hard case with the scene", scenes)
        found = tuple(case for case in found if case.scene.name == scene)
    chosen = [*integrators.METHODS.values()] if integrators_ is None else none_twice(
        name if isinstance(name, Method) else integrators.get(name) for name in listed_methods(integrators_))
    if not found:
        raise MethodError("No hard case is left to run; leave out --scene or name other cases.")
    entries: list[Entry] = []
    tell, total = told_by(progress), len(found) * len(chosen)
    try:
        for case in found:
            for method in chosen:
                tell(len(entries) / total, f"{case.name}: {method.name}")
                entries.append(entry(case, method))
        tell(1.0, "done")
    except KeyboardInterrupt:
        return Matrix(found, tuple(chosen), tuple(entries), False)
    return Matrix(found, tuple(chosen), tuple(entries))


def entry(case: Case, method: Method) -> Entry:
    """One case tried with one method."""
    finding = case.tried(method)
    known = KNOWN_FAILURES.get((case.name, method.name), "")
    return Entry(case, method, finding, case.as_expected(method, finding), known)


def write(matrix: Matrix, folder: str | Path) -> tuple[Path, Path]:
    """Write ``stress.png`` and ``stress.csv``; OutputError if it cannot."""
    from pendulum_env.plots.style import save
    from pendulum_env.study.hard_cases.matrix_plot import draw

    place = output_folder(folder)
    facts = provenance(Cases=len(matrix.cases), Methods=len(matrix.methods), Combinations=len(matrix.entries),
                       Complete=matrix.complete)
    table = place / "stress.csv"
    write_csv(table, COLUMNS, (
        (e.case.group, e.case.name, e.case.scene.name, e.method.name, e.finding.outcome, int(e.expected),
         e.finding.error, e.finding.tolerance, "" if math.isnan(e.finding.stop_time) else e.finding.stop_time,
         e.finding.note, e.known)
        for e in matrix.entries
    ), facts)
    return save(draw(matrix), place / "stress.png", facts), table
