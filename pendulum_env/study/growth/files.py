"""Output files of a study of error growth: a figure, and a CSV table with a row for each method and time."""

from __future__ import annotations

import math
from pathlib import Path

from pendulum_env.common.provenance import output_folder, provenance, write_csv
from pendulum_env.study.cost.runs import energy_scale
from pendulum_env.study.growth.study import Growth

COLUMNS = (
    "method", "dt_s", "force_evaluations_per_period", "time_periods", "angle_error_rad", "angle_floor_rad",
    "energy_error", "angle_error_grows", "energy_error_grows", "status",
)


def write(study: Growth, folder: str | Path, svg: bool = False) -> list[Path]:
    """Write the figure ``growth.png`` (with ``svg`` also as SVG) and the errors as ``growth.csv``; return the paths.

    Raises OutputError if a file cannot be written.
    """
    from pendulum_env.plots.growth import draw
    from pendulum_env.plots.style import save_all

    place = output_folder(folder)
    facts = provenance(
        Scene=study.scene.to_dict(), Angle=study.angle, Velocity=study.velocity, Periods=float(study.time[-1]),
        Period=study.period, Truth=study.how, Complete=study.complete,
        EnergyError=f"|energy residual| over {energy_scale(study.scene, (1.0,))[1]}",
        Method=", ".join(line.method for line in study.lines),
    )
    pictures, rows = save_all(draw(study), place / "growth", facts, svg), place / "growth.csv"
    write_csv(rows, COLUMNS, (
        (line.method, line.dt, line.evaluations, time, angle, floor, energy, line.angle.kind, line.energy.kind,
         line.stop_reason if math.isnan(energy) else "floor" if angle <= floor else "ok")
        for line in study.lines
        for time, angle, floor, energy in zip(
            study.time, line.angle_error, line.floor, line.energy_error, strict=True)
    ), facts)
    return [*pictures, rows]
