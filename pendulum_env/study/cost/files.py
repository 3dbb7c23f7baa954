"""Output files of a work-precision study: diagrams of error over computing time, and a CSV table of all runs."""

from __future__ import annotations

from pathlib import Path

from pendulum_env.common.provenance import output_folder, provenance, write_csv
from pendulum_env.study.cost.points import CostStudy
from pendulum_env.study.cost.runs import energy_scale

JOURNAL = "cost.jsonl"
"""Name of the journal in the folder, to which each measurement is written, and from which a study continues."""
COLUMNS = (
    "series", "method", "dt_s", "rtol", "span_s", "steps", "force_evaluations", "angle_error_rad",
    "end_angle_error_rad", "phase_error_rad", "energy_error", "time_min_s", "time_median_s", "ns_per_simulated_second",
    "status", "pareto",
)


def write(study: CostStudy, folder: str | Path, svg: bool = False) -> list[Path]:
    """Write the diagrams ``cost.png`` and ``cost_errors.png`` (with ``svg`` as SVG too) and ``cost.csv``; return paths.

    The diagrams show the errors of the runs over computing time and over force evaluations. Runs that ended early are
    in the table only. The head of the table names the unit of the energy errors. Raises OutputError if a file cannot be
    written.
    """
    from pendulum_env.plots.cost import draw, draw_errors
    from pendulum_env.plots.style import save_all

    place, front = output_folder(folder), set(study.front)
    facts = provenance(
        Scene=study.scene.to_dict(), Angle=study.angle, Velocity=study.velocity, Duration=study.duration,
        Reference=study.reference.how, ReferenceError=study.reference.error_estimate, Repeats=study.repeats,
        Complete=study.complete, Method=", ".join(study.methods), LeftOut=study.left_out,
        EnergyError=f"largest energy residual over {energy_scale(study.scene, (1.0,))[1]}",
        Machine="; ".join(study.machines), Versions="; ".join(study.versions),
    )
    table = place / "cost.csv"
    pictures = [*save_all(draw(study), place / "cost", facts, svg),
                *save_all(draw_errors(study), place / "cost_errors", facts, svg)]
    write_csv(table, COLUMNS, (
        (p.series, p.method, p.dt, p.rtol, p.span, p.steps, p.evaluations, p.angle_error, p.end_error, p.phase_error,
         p.energy_error, p.time, p.time_median, p.ns_per_second, p.stop_reason or ("floor" if p.floor else "ok"),
         int(p in front))
        for p in study.points
    ), facts)
    return [*pictures, table]
