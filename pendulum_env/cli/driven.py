"""The part of ``lab-pendulum fit`` for logs of driven runs: reading, fitting, printing and writing files."""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pendulum_env.cli.console import bar, print_files, print_table, print_text, shown_if_refused, tell_of

if TYPE_CHECKING:
    from pendulum_env.lab.driven.log import DrivenLog


def is_driven_fit(files: Sequence[Path], columns: Mapping[str, str | None]) -> bool:
    """Return True for logs of driven runs: a column of the drive is given, or the header of every file names one."""
    from pendulum_env.lab.driven.log import is_driven

    return any(value is not None for value in columns.values()) or (bool(files) and all(map(is_driven, files)))


def show_logs(logs: Iterable[DrivenLog]) -> None:
    """Print what was read."""
    for log in logs:
        print_text(log.text)


def fit_logs(
    files: Sequence[Path], columns: Mapping[str, str | None], read: Sequence[str], unit: str | None,
    given: Mapping[str, Any], settings: Sequence[str] | None, out: Path, svg: bool,
) -> None:
    """Fit logs of driven runs together, print the result, and write parameters, residuals, figure, settings and scene.

    ``columns`` are the names of the drive's column by kind, ``read`` further keywords of ``DrivenLog.read`` as texts;
    ``given`` and, as texts, ``settings`` are keywords of ``fit_driven``; with ``svg``, the figure is written as
    SVG, too.
    """
    from inspect import signature

    from pendulum_env.common.provenance import checked_folder, output_folder, provenance, write_csv
    from pendulum_env.common.replacing import replacing
    from pendulum_env.lab.driven.fit import fit_driven
    from pendulum_env.lab.driven.log import DrivenLog
    from pendulum_env.physics.damping import parse_settings, typed_values
    from pendulum_env.physics.units import SceneError, nearest, shown
    from pendulum_env.plots.driven import driven
    from pendulum_env.study.fit_report import drawn

    if not files:
        raise SceneError("A drive's column needs a log of a driven run; give its file.")
    options: dict[str, Any] = {**{name: value for name, value in columns.items() if value is not None},
               **({} if unit is None else {"unit": unit})}
    allowed = [name for name in signature(DrivenLog.read).parameters if name != "path"]
    for name, value in typed_values(read, "--read", "factor=-1").items():
        if name not in allowed:
            raise SceneError(f"--read has no keyword {shown(name)} for driven logs{nearest(name, allowed)}")
        options[name] = int(value) if isinstance(value, float) and name in ("time", "angle", *columns) else value
    keywords = [name for name, one in signature(fit_driven).parameters.items()
                if one.kind is one.KEYWORD_ONLY and name not in ("hold", "progress")]
    known = {**{name: value for name, value in given.items() if value is not None}, **parse_settings(settings or ())}
    for name in known:
        if name not in keywords:
            raise SceneError(f"--set has no parameter {shown(name)} for driven logs{nearest(name, keywords)}")
    checked_folder(out)
    logs = [DrivenLog.read(file, **options) for file in files]
    with warnings.catch_warnings(record=True) as warned, bar("fit") as progress:
        warnings.simplefilter("always", UserWarning)
        with shown_if_refused(lambda: show_logs(logs)):
            found = fit_driven(logs, progress=progress, **known)
    folder = output_folder(out)
    origin = provenance(recording=[log.source for log in logs], notes=[note for log in logs for note in log.notes],
                        grade=found.grade.text, scene=found.scene.to_dict())
    paths = [folder / name for name in ("parameters.csv", "residuals.csv", "bench.json", "scene.json")]
    names = ("parameter", "value", "error", "low", "high", "unit", *(f"correlation_{name}" for name in found.names))
    write_csv(paths[0], names, ((name, one.value, one.error, *found.interval(name), one.unit, *row) for (name, one), row
                                in zip(found.parameters.items(), found.correlations.tolist(), strict=True)), origin)
    windows = found.solution.windows
    write_csv(paths[1], ("log", "window", "time_s", "recorded_rad", "residual_rad"), (
        (windows.logs[place.log].source, number, float(windows.logs[place.log].time[place.first + k]),
         float(windows.angle[part][k]), float(found.solution.residual[part][k]))
        for number, (place, part) in enumerate(zip(windows.places, windows.slices, strict=True))
        for k in range(place.last - place.first)), origin)
    with replacing(paths[2]) as temporary:
        temporary.write_text(json.dumps({**found.to_dict(), "provenance": origin}, indent=2) + "\n", encoding="utf-8")
    found.scene.save(paths[3], provenance=origin)
    title = {**origin, "Title": f"fit of {found.source}"}
    paths += drawn(lambda: driven(found), folder / "fit", title, svg)
    show_logs(logs)
    tell_of(warned, found.grade.text)
    print_table(found.table, "fitted parameters; r: correlations")
    print_text(found.text)
    print_files(paths)
