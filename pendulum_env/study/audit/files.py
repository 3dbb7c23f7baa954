"""Files of an audit: a bar chart, and a CSV table with a row for each effect."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from pendulum_env.common.provenance import output_folder, provenance, write_csv
from pendulum_env.study.audit.swing import METHOD
from pendulum_env.study.audit.verdicts import Audit, AuditRow


def write(found: Audit, folder: str | Path, svg: bool = False) -> list[Path]:
    """Write the bar chart ``effects.png`` (with ``svg`` also as SVG) and ``effects.csv``; return the paths.

    The chart shows the relative changes that each effect of the audit causes.

    Raises OutputError if a file cannot be written.
    """
    from pendulum_env.plots.audit import draw
    from pendulum_env.plots.style import save_all

    place = output_folder(folder)
    facts = provenance(
        Scene=found.scene.to_dict(), Method=METHOD, Amplitude=found.amplitude, Tolerance=found.tolerance,
        StepsPerPeriod=found.steps, IntegrationError=found.integration_error,
    )
    table = place / "effects.csv"
    names = [entry.name for entry in dataclasses.fields(AuditRow)]
    pictures = save_all(draw(found), place / "effects", facts, svg)
    write_csv(table, names, ([getattr(one, name) for name in names] for one in found.rows), facts)
    return [*pictures, table]
