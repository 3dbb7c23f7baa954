"""Output files of sections: a figure, and a CSV table of the points or of the starts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pendulum_env.common.provenance import output_folder, provenance, write_csv
from pendulum_env.study.section.basins import Basins
from pendulum_env.study.section.study import Section


def write(result: Section | Basins, folder: str | Path, svg: bool = False) -> list[Path]:
    """Write a figure (PNG, with ``svg`` also SVG) and a CSV table into a folder; return the paths.

    The name of the files is section, bifurcation (a section over a parameter) or basins. Raises OutputError if a file
    cannot be written.
    """
    from pendulum_env.plots.section import draw
    from pendulum_env.plots.style import save_all

    place = output_folder(folder)
    facts = provenance(Scene=result.scene.to_dict(), Method=result.method, StepsPerPeriod=result.steps,
                       TransientPeriods=result.transient, **_facts(result))
    name, columns, rows = _table(result)
    pictures, table = save_all(draw(result), place / name, facts, svg), place / f"{name}.csv"
    write_csv(table, columns, rows, facts)
    return [*pictures, table]


def _facts(result: Section | Basins) -> dict[str, Any]:
    """Return what the origin in a file says beside scene and steps."""
    if isinstance(result, Section):
        return {"Event": result.event, "Phase": None if np.isnan(result.phase) else result.phase,
                "RunsEndedEarly": result.stopped}
    return {"Attractors": [states.tolist() for states in result.attractors]}


def _table(result: Section | Basins) -> tuple[str, Sequence[str], Iterable[Sequence[Any]]]:
    """Return the name of the files, and the columns and rows of the table."""
    if isinstance(result, Section):
        columns = {"run": result.run, "time_s": result.time, "drive_phase_rad": result.drive,
                   "angle_rad": result.angle, "velocity_rad_per_s": result.velocity}
        if result.over:
            columns = {result.over: result.value, **columns}
        name = "bifurcation" if result.over else "section"
        return name, tuple(columns), zip(*(values.tolist() for values in columns.values()), strict=True)
    angle, velocity = np.meshgrid(result.angle, result.velocity)
    rows = zip(angle.ravel().tolist(), velocity.ravel().tolist(), result.which.ravel().tolist(), strict=True)
    return "basins", ("angle_rad", "velocity_rad_per_s", "attractor"), rows
