"""The catalogue of all hard cases in a fixed order, with the known failures, and the matrix of methods run in them.

The matrix has one entry for each pair of hard case and method that was run.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from difflib import get_close_matches
from itertools import groupby

import integrators as registry
from integrators import Method
from pendulum_env.common.progress import Progress, told_by, with_bar
from pendulum_env.common.provenance import provenance
from pendulum_env.common.results import Columns, Result, columns_of, one_line
from pendulum_env.common.texts import Table
from pendulum_env.engine.starts import listed_methods, none_twice
from pendulum_env.hard_cases import (
    actions,
    chaos,
    extremes,
    fast_drive,
    long_runs,
    magnitudes,
    near_top,
    non_smooth,
    resonance,
    reversal,
    step_limits,
    stiff_damping,
    switching,
)
from pendulum_env.hard_cases.case import OUTCOMES, Case, Finding, check_unique
from pendulum_env.physics.units import SceneError, boolean, one_of, several

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


GROUPS = (near_top, step_limits, stiff_damping, non_smooth, fast_drive, chaos, long_runs, magnitudes, actions, reversal,
          extremes, resonance, switching)
"""Modules of hard cases, one per group."""
CASES: tuple[Case, ...] = check_unique(tuple(case for group in GROUPS for case in group.CASES))
"""All hard cases; the command line, the tests and the documentation read this tuple."""
MOTIONS = {case.motion.name: case.motion for case in CASES if case.motion is not None}
"""Motions with predicted errors, by name."""
KNOWN_FAILURES: Mapping[tuple[str, str], str] = {
    pair: why for group in GROUPS for pair, why in getattr(group, "KNOWN", {}).items()
}
"""(case, method) -> reason why the outcome is not an allowed one, and what the method does instead."""


__all__ = ["Matrix", "MatrixEntry", "chosen_cases", "entry", "listing", "stress"]


def chosen_cases(names: str | Sequence[str] | None, scene: str | None, long: bool) -> tuple[Case, ...]:
    """Return the hard cases with these names or groups; None: all.

    Long cases are included only if ``long`` is True or their own name is given. With ``scene``, only cases of this
    scene are returned. Raises SceneError for unknown names, and if no case is left.
    """
    groups = [*dict.fromkeys(case.group for case in CASES)]
    known, given = [*groups, *(case.name for case in CASES)], [names] if isinstance(names, str) else names
    listed = groups if given is None else several(given, "cases", "names of cases")
    for name in listed:
        close = isinstance(name, str) and get_close_matches(name[:80], known, 1, 0.5)
        one_of(name, "hard case or group", known if close else groups)
    wanted = {*listed}
    if long is True and not wanted & {*groups}:
        raise SceneError("long adds the long cases of groups, and only single cases are named; leave long out.")
    if scene is not None:
        one_of(scene, "hard case with the scene", {case.scene.name for case in CASES})
    include_long = boolean(long, "long")
    chosen = tuple(case for case in CASES
                   if case.name in wanted or (case.group in wanted and (include_long or not case.long)))
    chosen = tuple(case for case in chosen if scene in (None, case.scene.name))
    if not chosen:
        raise SceneError("No hard case matches; leave out the scene, name other cases, or include long ones.")
    return chosen


@with_bar("stress")
def stress(
    cases: str | Sequence[str] | None = None,
    integrators: Iterable[str | Method] | None = None,
    *,
    scene: str | None = None,
    long: bool = False,
    progress: Progress | bool | None = None,
) -> Matrix:
    """Run methods in hard cases with known reference solutions and return the outcome of each pair.

    Args:
        cases: names of cases or of groups; by default all.
        integrators: names or methods, without repetition; by default all.
        scene: run only cases of this scene.
        long: True to include cases that take more than a few seconds per method; a case given by its own name always
            runs.
        progress: True shows a progress bar, False none; by default a notebook shows one for work over 1.5 s. A
            function is called with the fraction done and the present activity.

    Returns a Matrix with ``entries``, ``failures``, a ``table`` and a ``text``; :func:`write` saves it as a figure and
    a CSV file. KeyboardInterrupt ends the run early and returns the results so far.

    Raises SceneError or MethodError for unknown names.
    """
    chosen = chosen_cases(cases, scene, long)
    methods = [*registry.METHODS.values()] if integrators is None else none_twice(
        name if isinstance(name, Method) else registry.get(name) for name in listed_methods(integrators))
    pairs = [(case, method) for case in chosen for method in methods]
    tell, entries = told_by(progress), list[MatrixEntry]()
    with suppress(KeyboardInterrupt):
        for i, (case, method) in enumerate(pairs):
            tell(i / len(pairs), f"{case.name}: {method.name}")
            entries.append(entry(case, method))
        tell(1.0, "done")
    return Matrix(chosen, tuple(methods), tuple(entries), len(entries) == len(pairs))


def listing(cases: Iterable[Case]) -> str:
    """Return a text that lists hard cases by group: why each is hard, its reference solution and the source."""
    lines: list[str] = []
    for group, members in groupby(cases, key=lambda case: case.group):
        lines += ["", f"{group}:"] if lines else [f"{group}:"]
        for case in members:
            lines += [f"  {case.name}{' (long)' if case.long else ''}, scene {case.scene.name}. {case.why} "
                      f"Truth: {case.truth.rstrip('.')}. Source: {case.source.rstrip('.')}."]
    return "\n".join(lines)


def entry(case: Case, method: Method) -> MatrixEntry:
    """Run one hard case with one method and return the result."""
    finding = case.tried(method)
    known = KNOWN_FAILURES.get((case.name, method.name), "")
    return MatrixEntry(case, method, finding, case.as_expected(method, finding), known)
