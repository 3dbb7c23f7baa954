"""A study of growing errors as a table, a figure and a CSV file."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from pendulum_env.common.provenance import output_folder, provenance, write_csv
from pendulum_env.common.tables import Table
from pendulum_env.study.energy_scale import energy_scale
from pendulum_env.study.growth.study import Growth

AT = (10.0, 1e3, 1e5)
"""Times whose errors stand in the table [periods]."""
COLUMNS = (
    "method", "dt_s", "force_evaluations_per_period", "time_periods", "angle_error_rad", "angle_floor_rad",
    "energy_error", "angle_error_grows", "energy_error_grows", "status",
)


def table(study: Growth) -> Table:
    """Each method: how its errors grow, and what they are after 10, 1000 and 100 000 periods."""
    places = [int(np.argmin(np.abs(np.log(study.time / at)))) for at in AT if at <= 1.01 * study.time[-1]]
    head = ["method", "angle error grows", "energy error grows"]
    head += [f"{what} at {study.time[i]:.3g}" for what in ("angle [rad]", "energy") for i in places]
    rows = tuple(
        (line.label, line.angle.text(), line.energy.text(),
         *(_cell(values[i], floor[i]) for values, floor in (
             (line.angle_error, line.floor), (line.energy_error, np.zeros_like(study.time))) for i in places))
        for line in study.lines
    )
    return Table(tuple(head), rows)


def _cell(value: float, floor: float) -> str:
    if not math.isfinite(value):
        return "-"
    return f"{value:.1e}" if value > floor else f"<{floor:.0e}"


def remarks(study: Growth) -> str:
    """What the truth is and how far it goes, what a period is, and what was the same for all."""
    said = [f"Truth: {study.how}. Times are in periods of small swings, {study.period:.4g} s; lost: the error is half "
            "as large as the motion."]
    if math.isfinite(study.died):
        said.append(f"The motion has died out at {study.died:.3g} periods, and the study ends there.")
    if math.isfinite(study.horizon):
        said.append(f"Beyond {study.horizon:.3g} periods the angle is not known: there the solutions that serve as "
                    "truth part, as neighbouring motions do.")
    if not study.complete:
        said.append("Interrupted: what was measured until then follows.")
    return " ".join(said)


def write(study: Growth, folder: str | Path, svg: bool = False) -> list[Path]:
    """Write ``growth.png``, with ``svg`` as SVG too, and ``growth.csv``, a row for each method and time.

    OutputError if it cannot.
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
