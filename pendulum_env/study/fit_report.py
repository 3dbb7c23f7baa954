"""Report of a fit to a recording: tables, sentences and files."""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pendulum_env.common.checks import warn
from pendulum_env.common.progress import Progress, told_by
from pendulum_env.common.provenance import output_folder, write_csv
from pendulum_env.common.replacing import replacing
from pendulum_env.lab.checked import side
from pendulum_env.lab.driven.result import DrivenFit
from pendulum_env.lab.fitting.base import FitResult
from pendulum_env.lab.fitting.model import LENGTH, SCALE
from pendulum_env.lab.fitting.posterior import Posterior
from pendulum_env.lab.fitting.result import Fit, against, measured
from pendulum_env.lab.sheet import LabSheet
from pendulum_env.physics.units import SceneError, shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CsvTable = tuple[Sequence[str], Iterable[Sequence[Any]]]
"""The head and the rows of a table."""
AGREEMENT = ((2.0, "agrees with"), (3.0, "is in tension with"), (math.inf, "contradicts"))
"""Largest difference in standard deviations, and the words for it."""


def against_told(found: Fit, told: float, error: float | None = None) -> str:
    """Return a sentence that compares the fitted length with a given length [m], in standard deviations.

    The standard deviation of the difference includes the given ``error`` [m], the error of the fit and the spread of
    the models that fit about as well. Without an error, the sentence gives the relative difference, or is "" if no
    length was fitted. Raises SceneError for an error where no length was fitted.
    """
    if error is None:
        if LENGTH not in found.names:
            return ""
        off = found.parameters[LENGTH].value / told - 1.0
        return (f"Length: fitted {measured(found, LENGTH)}, given {told:g} m: {abs(off):.1%} "
                f"{'above' if off > 0.0 else 'below'}; state its error with --length-error.")
    needs_length(found.model.free)
    away = against(found, {LENGTH: (told, error)})[LENGTH]
    return (f"Length: fitted {measured(found, LENGTH)}, given {told:g} ± {error:g} m: {abs(away):.1f} sigma "
            f"{'above' if away > 0.0 else 'below'}; the fit {_agreement(away)} the given length.")


def needs_length(free: Sequence[str]) -> None:
    """Raise SceneError unless the length is among the fitted parameters, with which a measured one is compared."""
    if LENGTH not in free:
        names = ", ".join(free) or "nothing"
        raise SceneError(f"--length-error is for a fitted length, but the fitted parameters are: {names}.")


def against_track(found: Fit) -> str:
    """Return a sentence that compares the radius of a track with the fitted length; "" without either.

    If the unit of the track is not known, the sentence gives the length of that unit.
    """
    radius = found.recording.radius
    if radius is None or LENGTH not in found.names:
        return ""
    length = measured(found, LENGTH)
    if radius.unit != "m":
        scale = length.value / radius.value
        return (f"Track: its radius is {radius}; with the fitted length, {length}, one unit of the track is "
                f"{scale:.4g} m ({1.0 / scale:.5g} units are 1 m).")
    away = (radius.value - length.value) / math.hypot(radius.error, length.error)
    hint = "" if abs(away) < AGREEMENT[0][0] else (
        f"; either the scale of the film is {abs(radius.value / length.value - 1.0):.2%} too "
        f"{'large' if away > 0.0 else 'small'}, or gravity or the bob differ from those of the scene")
    return (f"Track: its radius {radius} {_agreement(away)} the fitted length {length} ({abs(away):.1f} sigma "
            f"{'above' if away > 0.0 else 'below'}){hint}.")


def _agreement(away: float) -> str:
    return next(word for most, word in AGREEMENT if abs(away) < most)


def to_lay_over(found: Fit, file: str | Path, scene: Path, read: Sequence[str] = ()) -> str:
    """Return the shell command that compares integrators on the fitted scene with the recording.

    ``read`` are options for reading the file, texts such as ``scale=0.5``, which the command repeats as ``--read``.
    """
    options = dict(entry.split("=", 1) for entry in read)
    if SCALE in found.names:
        options[SCALE] = f"{float(options.get(SCALE, 1.0)) / found.parameters[SCALE].value:.6g}"
    words = [word for name, value in options.items() for word in ("--read", f"{name}={value}")]
    return shlex.join(["lab-pendulum", "compare", "--scene", str(scene), "--recording", str(file), *words])


def write(
    found: FitResult, sheet: LabSheet | None, folder: str | Path, svg: bool = False, *, progress: Progress | None = None
) -> list[Path]:
    """Write ``fit.png`` (with ``svg`` also as SVG), CSV tables and ``scene.json`` of a fit, and return the paths.

    ``parameters.csv`` has each fitted number with error and correlations, ``residuals.csv`` time [s], reading and
    residual, in the unit of the readings; ``models.csv`` is the comparison of models, where there is one;
    ``scene.json`` is a scene for ``gym.make("LabPendulum-v0", scene=...)``. Of a fit to logs of driven runs,
    ``bench.json`` are the settings of an environment. With a lab sheet, ``measured.csv`` is the sheet, and
    ``amplitudes.csv`` has time [s], amplitude and its error [rad] of each half swing. Other files in the folder stay
    unchanged.

    A figure that cannot be drawn is left out, with a warning. Raises OutputError where the folder cannot be written.
    """
    if not isinstance(sheet, (LabSheet, type(None))):
        raise SceneError(f"sheet must be a LabSheet, the result of measure, not {shown(sheet)}.")
    tell, place, origin = told_by(progress), output_folder(folder), found.origin()
    tables: dict[str, CsvTable] = {}
    if sheet is not None:
        points = sheet.points
        tables["measured"] = sheet.numbers.head, sheet.numbers.rows
        tables["amplitudes"] = ("time_s", "amplitude_rad", "error_rad"), zip(
            *(column.tolist() for column in (points.time, points.amplitude, points.error)), strict=True)
    for name, columns in found.tables().items():
        tables[name] = tuple(columns), zip(*(one.values for one in columns.values()), strict=True)
    paths = [place / f"{name}.csv" for name in tables]
    for path, (head, rows) in zip(paths, tables.values(), strict=True):
        write_csv(path, head, rows, origin)
    tell(0.2, "drawing")
    paths += drawn(found.plot, place / "fit", {**origin, "Title": f"fit of {found.source}"}, svg)
    if isinstance(found, DrivenFit):
        paths.append(place / "bench.json")
        with replacing(paths[-1]) as temporary:
            temporary.write_text(json.dumps(found.to_dict(provenance=origin), indent=2) + "\n", encoding="utf-8")
    paths.append(place / "scene.json")
    found.scene.save(paths[-1], origin)
    tell(1.0, "written")
    return paths


def drawn(figure: Callable[[], Figure], path: Path, origin: dict[str, str], svg: bool) -> list[Path]:
    """Draw and save a figure of a fit and return the paths; a figure that cannot be drawn is left out, with a warning.

    Raises OutputError where the folder cannot be written.
    """
    from pendulum_env import plots

    made, left_out = side(f"the figure {path.name}.png", figure)
    if made is None:
        warn(left_out)
        return []
    return plots.save_all(made, path, origin, svg)


def write_posterior(found: Posterior, folder: str | Path, svg: bool = False) -> list[Path]:
    """Write ``posterior.csv``, ``posterior.zip`` and ``corner.png`` (with ``svg`` also as SVG); return the paths.

    See :meth:`pendulum_env.lab.fitting.posterior.Posterior.save`. Raises OutputError where the folder cannot be
    written.
    """
    from pendulum_env.plots.corner import corner

    place, origin = output_folder(folder), found.fit.origin(seed=found.seed)
    paths = [found.save(place / f"posterior.{ending}") for ending in ("csv", "zip")]
    title = {**origin, "Title": f"posterior of {found.fit.recording.source}"}
    return [*paths, *drawn(lambda: corner(found), place / "corner", title, svg)]
