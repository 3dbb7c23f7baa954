"""The part of ``lab-pendulum fit`` for logs of driven runs: reading, fitting, printing and writing files."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pendulum_env.cli.console import bar, print_files, print_table, print_text, shown_if_refused, tell_of
from pendulum_env.cli.options import given
from pendulum_env.common.provenance import checked_folder
from pendulum_env.physics.damping import parse_settings, typed_values
from pendulum_env.physics.units import SceneError, one_of

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
    mass: float | None, settings: Sequence[str] | None, out: Path, svg: bool, details: bool,
) -> None:
    """Fit logs of driven runs together, write the files of the fit, and print the result.

    ``columns`` are the names of the drive's column by kind, ``read`` further keywords of ``DrivenLog.read`` as texts;
    ``mass`` [kg] and, as texts, ``settings`` are keywords of ``fit_driven``; with ``svg``, the figure is written as
    SVG, too; with ``details``, correlations are printed, and what the result is based on.
    """
    from inspect import signature

    from pendulum_env.lab.driven.fit import fit_driven
    from pendulum_env.lab.driven.log import DrivenLog
    from pendulum_env.study.fit_report import write

    if not files:
        raise SceneError("A drive's column needs a log of a driven run; give its file.")
    words = given(**columns, unit=unit)
    allowed = [name for name in signature(DrivenLog.read).parameters if name != "path"]
    for name, value in typed_values(read, "--read", "factor=-1").items():
        one_of(name, "keyword of --read for driven logs", allowed)
        words[name] = int(value) if isinstance(value, float) and name in ("time", "angle", *columns) else value
    keywords = [name for name, one in signature(fit_driven).parameters.items()
                if one.kind is one.KEYWORD_ONLY and name not in ("hold", "progress")]
    known = given(mass=mass) | parse_settings(settings or ())
    for name in known:
        one_of(name, "parameter of driven logs", keywords)
    checked_folder(out)
    logs = [DrivenLog.read(file, **words) for file in files]
    with warnings.catch_warnings(record=True) as warned, bar("fit") as progress:
        warnings.simplefilter("always", UserWarning)
        with shown_if_refused(lambda: show_logs(logs)):
            found = fit_driven(logs, progress=progress, **known)
    paths = write(found, None, out, svg)
    show_logs(logs)
    tell_of(warned, found.grade.text)
    print_table(found.detailed_table if details else found.table,
                "fitted numbers; r: correlations" if details else "fitted numbers")
    print_text("\n".join(filter(None, (found.text, found.details if details else "",
                                       f"Scene: {found.scene.equation()}"))))
    print_files(paths)
