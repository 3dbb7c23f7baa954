"""Output files of the hard cases: the matrix as a figure, and a CSV table with a row for each case and method."""

from __future__ import annotations

import math
from pathlib import Path

from pendulum_env.common.provenance import output_folder, provenance, write_csv
from pendulum_env.hard_cases.matrix import Matrix

COLUMNS = ("group", "case", "scene", "method", "outcome", "as_expected", "error", "tolerance", "stop_time_s", "note",
           "known_failure")


def write(matrix: Matrix, folder: str | Path, svg: bool = False) -> list[Path]:
    """Write the matrix of hard cases to ``stress.png`` and ``stress.csv`` in a folder; with ``svg`` also as SVG.

    Returns the paths. Raises OutputError if a file cannot be written.
    """
    from pendulum_env.plots.hard_cases import draw
    from pendulum_env.plots.style import save_all

    place = output_folder(folder)
    facts = provenance(Cases=len(matrix.cases), Methods=len(matrix.methods), Combinations=len(matrix.entries),
                       Complete=matrix.complete)
    table = place / "stress.csv"
    write_csv(table, COLUMNS, (
        (e.case.group, e.case.name, e.case.scene.name, e.method.name, e.finding.outcome, int(e.expected),
         *("" if math.isnan(x) else x for x in (e.finding.error, e.finding.tolerance, e.finding.stop_time)),
         e.finding.note, e.known)
        for e in matrix.entries
    ), facts)
    return [*save_all(draw(matrix), place / "stress", facts, svg), table]
