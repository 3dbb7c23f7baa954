"""Files of a comparison of integrators: figures, CSV tables and a film."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pendulum_env.common import results
from pendulum_env.common.progress import Progress, told_by
from pendulum_env.common.provenance import output_folder
from pendulum_env.films.look import checked_look
from pendulum_env.films.orbit import curves
from pendulum_env.films.picture import apparatus
from pendulum_env.films.runs import Track, at_times, drawn_large, instants, strip_span
from pendulum_env.physics.units import SceneError, boolean, shown
from pendulum_env.render import FrameStyle, side_by_side, write_film
from pendulum_env.render.panel import PLAIN
from pendulum_env.render.stage import DEFAULT
from pendulum_env.study.compare.comparison import Comparison

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FPS = 50
"""Frames per second of the film."""
FILM_SECONDS = 20.0
"""Longest part of a run that the film shows [s]."""
SHOWN = 5.0
"""Number of periods at either end of a long run that figures show enlarged."""
SOON = 0.5
"""Largest share of the amplitude left at the end of a run whose orbit looks like a spiral."""


def write(
    comparison: Comparison,
    folder: str | Path,
    *,
    film: bool = True,
    theme: str = "light",
    panels: Sequence[str] = DEFAULT,
    progress: Progress | None = None,
) -> list[Path]:
    """Write the figures (PNG and SVG), two CSV tables and a film of a comparison, and return their paths.

    Figures are ``angle``, ``velocity``, ``phase`` and ``energy``. ``comparison.csv`` has time [s], then angle [rad],
    velocity [rad/s], energy and residual [J] of each method; ``drift.csv`` is the drift table; ``comparison.mp4`` shows
    the first 20 s at true speed, with the ``theme`` and ``panels`` of :mod:`pendulum_env.render`. Other files in the
    folder stay unchanged. Raises SceneError for an unknown theme or panel, OutputError if the folder cannot be written,
    OSError if the film cannot be written.
    """
    if not isinstance(comparison, Comparison):
        raise SceneError(f"comparison must be a Comparison, the result of compare, not {shown(comparison)}.")
    tell, look = told_by(progress), checked_look(theme, panels, ("energy",), "")
    if boolean(film, "film"):
        place, count = output_folder(folder), math.floor(min(comparison.duration, FILM_SECONDS) * FPS + 1e-9) + 1
        with ThreadPoolExecutor(1, "figures") as beside:  # a film waits for ffmpeg, which is a process of its own
            drawn = beside.submit(results.write, comparison, place)
            filmed = write_film(
                place / "comparison.mp4", pictures(comparison, count, look), FPS, metadata=comparison.origin(),
                total=count, progress=lambda done, total: tell(done / count, "filming"),
            )
            paths = [*drawn.result(), filmed]
    else:
        paths = results.write(comparison, folder, progress=tell)
    tell(1.0, "written")
    return paths


def figure_of(comparison: Comparison, name: str) -> Figure:
    """Return one of the figures of a comparison: "angle", "velocity", "phase" or "energy".

    Figures of a long run have additional axes that enlarge its first and its last periods.
    """
    from pendulum_env import plots

    runs, recording = comparison.runs, comparison.recording
    exact = comparison.truth if comparison.truth.known else None
    end = max(float(run.time[-1]) for run in runs.values()) or max(run.dt for run in runs.values())
    period = 2.0 * math.pi / comparison.scene.omega0 if comparison.scene.omega0 else math.inf
    full, first, last = (0.0, end), (0.0, min(end, SHOWN * period)), (end - SHOWN * period, end)
    spans = [first, full, last] if end > plots.DENSE * period else [full]

    if name == "phase":
        return plots.portraits(runs, exact=exact, note=_note(comparison))
    if name == "angle":
        drawn, rows = plots.figure(len(spans) + (exact is not None))
        for axes, span in zip(rows, spans, strict=False):
            plots.angle(runs, exact=exact, recording=recording, span=span, axes=axes)
        if exact is not None:
            plots.deviation(runs, exact, axes=rows[-1])
    elif name == "velocity":
        drawn, rows = plots.figure(len(spans))
        for axes, span in zip(rows, spans, strict=True):
            plots.velocity(runs, exact=exact, span=span, axes=axes)
    else:
        drawn, rows = plots.figure(3)
        plots.energy(runs, axes=rows[0])
        plots.energy_residual(runs, span=spans[0], axes=rows[1])  # of a long run the first swings, as of the angle
        plots.energy_error(runs, axes=rows[2])
    _trim(rows)
    return drawn


def _trim(rows: list[Any]) -> None:
    """Remove titles and legends of all axes but the topmost one of a figure."""
    for axes in rows[1:]:
        axes.set_title("", loc="left")
        if axes.get_legend() is not None:
            axes.get_legend().remove()


def _note(comparison: Comparison) -> str:
    """Return the sentences below the phase portraits that explain the shape of the orbit; "" if there are none."""
    scene = comparison.scene
    if any(effect.torque and not effect.controlled for effect in scene.of_kind("drive")):
        return "The drive does work, so the orbit need not close, and need not end at rest."
    if scene.of_kind("dissipative"):
        return _losses(comparison)
    if not scene.omega0:
        return ""
    if scene.has("small_angle_gravity") or (scene.has("fibre") and not scene.has("gravity")):
        amplitude = math.degrees(math.hypot(comparison.angle, comparison.velocity / scene.omega0))
        where = "under a fibre, at any angle," if scene.has("fibre") else "at small angles"
        return (f"Why an ellipse? The energy is constant,\nand {where} that reads\n"
                r"$\theta^2/A^2+v^2/(\omega_0{}A)^2=1$;"
                f"\nhere $A={amplitude:.3g}$ degrees and $\\omega_0={scene.omega0:.4g}$ rad/s.")
    if not scene.has("gravity"):
        return ""
    return ("Without losses the energy is constant:\n"
            r"$v^2/2+\omega_0^2\,(1-\cos\theta)$ keeps its value,"
            f"\n$\\omega_0={scene.omega0:.4g}$ rad/s;\nonly at small angles is that an ellipse.")


def _losses(comparison: Comparison) -> str:
    """Return the note below the phase portrait of a scene with losses, by their kind and by how far the run goes.

    With linear drag the bob swings only if gamma < 2 omega0; otherwise it creeps back to rest.
    """
    scene = comparison.scene
    if not (scene.omega0 and scene.of_kind("conservative")):
        return "Without a restoring torque, losses slow the bob down until it stops."
    if moving := scene.of_kind("medium"):
        if any(effect.draws for effect in moving):
            return "Losses turn the closed orbit into a spiral,\nbut gusts keep the bob from coming to rest."
        return "Losses turn the closed orbit into a spiral\ntowards the angle at which the wind holds the bob."
    gamma, limit = scene.coefficients.get("linear_drag_rate", 0.0), 2.0 * scene.omega0
    if gamma >= limit:
        return ("Overdamped: the drag is so strong that the bob does not swing, but creeps back to rest\n"
                rf"($\gamma={gamma:.4g}$ 1/s, at least $2\,\omega_0={limit:.4g}$ 1/s).")
    longest = max(comparison.runs.values(), key=lambda run: (len(run.time), run.method.order))
    size, part = np.abs(longest.angle), max(1, len(longest.angle) // 10)
    if np.max(size[-part:]) > SOON * np.max(size[:part]):
        return "Losses make the orbit shrink: the start of a spiral towards rest."
    return "Losses turn the closed orbit into a spiral towards rest."


def pictures(comparison: Comparison, count: int, look: FrameStyle = PLAIN) -> Iterator[Any]:
    """Yield the frames of a film that shows all runs side by side at true speed, with 50 frames per second."""
    from pendulum_env import plots

    scene, runs = comparison.scene, comparison.runs
    part = f", the first {FILM_SECONDS:g} s of {comparison.duration:g} s" if comparison.duration > FILM_SECONDS else ""
    thing = dataclasses.replace(apparatus(scene), title=f"{scene.name}, {comparison.stepping}{part}")
    tones = plots.colours([run.method.name for run in runs.values()])
    scale = float(next(iter(runs.values())).energy[0]) or None
    time, works = np.arange(count) / FPS, any(run.ledger.work.any() for run in runs.values())
    tracks = [Track(scene, thing, label, at_times(run, time, works), accent=tones[run.method.name], energy_scale=scale,
                    end=float(run.time[-1]) if run.stop_reason else math.inf, reason=str(run.stop_reason),
                    curves=curves(scene, float(run.energy[0])) if "curves" in look.needs else None)
              for label, run in runs.items()]
    for panels in instants(drawn_large(tracks), time, "past" in look.needs or len(tracks) > 1):
        yield side_by_side(panels, look=look, strip=strip_span(time))
