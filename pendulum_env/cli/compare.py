"""The command ``lab-pendulum compare``: methods side by side on one scene, or their stability without a scene."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pendulum_env.cli import options
from pendulum_env.cli.console import bar, print_result
from pendulum_env.cli.options import given_by_user, recording_of, scene_of
from pendulum_env.common.progress import part_of
from pendulum_env.common.provenance import checked_folder
from pendulum_env.physics.units import SceneError
from pendulum_env.study import PLAIN


def compare(
    context: typer.Context,
    scene: options.SceneName = "exercise",
    integrators: options.Integrators = list(PLAIN),
    damping: options.Damping = "scene",
    angle: options.AngleOrNone = None,
    velocity: options.Velocity = None,
    dt: options.Step = None,
    duration: options.Duration = None,
    rtol: options.Rtol = None,
    atol: options.Atol = None,
    recording: options.File = None,
    film: options.Film = True,
    theme: options.Theme = "light",
    panels: options.Panels = ["apparatus", "energy"],
    stability: Annotated[
        bool, options.flag("Show the methods' stability regions, growth and phase error; no scene.", "--stability")
    ] = False,
    out: options.OutOrNone = None,
    as_json: options.Json = False,
    settings: options.Settings = None,
    read: options.Reading = None,
) -> None:
    """Run several integrators on one scene: curves, phase portrait, energy, drift table, CSV and a film side by side.

    With --rtol all methods must be adaptive, and dt is the time between records. --recording is plotted over the
    curves. With --stability no scene is run. The folder is out/compare, with --stability out/stability.
    """
    if stability:
        given = [name for name in context.params if name not in ("integrators", "stability", "out", "as_json")]
        show_stability(integrators, given_by_user(context, *given), checked_folder(out or "out/stability"), as_json)
        return

    from pendulum_env.films.look import checked_look
    from pendulum_env.study.compare import compare as run
    from pendulum_env.study.compare import write
    from pendulum_env.study.compare.drift import LEADING_ERROR

    folder, look = checked_folder(out or "out/compare"), checked_look(theme, panels, ("energy",), "")
    if not film and (given := given_by_user(context, "theme", "panels")):
        raise SceneError(f"{given[0]} is for the film, but --no-film makes no film; leave one of them out.")
    place = scene_of(scene, damping, settings)
    measured = recording_of(recording, read) if recording is not None or read else None
    with bar("compare") as progress:
        comparison = run(place, integrators, angle=angle, velocity=velocity, dt=dt, duration=duration, rtol=rtol,
                         atol=atol, recording=measured, progress=part_of(progress, 0.0, 0.3))
        paths = write(comparison, folder, film=film, theme=look.theme, panels=look.panels,
                      progress=part_of(progress, 0.3, 1.0))
    print_result(comparison, paths, as_json, before=comparison.text, below=LEADING_ERROR, after="")


def show_stability(integrators: list[str], given: list[str], out: Path, as_json: bool) -> None:
    """Run ``lab-pendulum compare --stability``; raise SceneError if other options, named in ``given``, were used too.
    """
    from pendulum_env.common.results import write
    from pendulum_env.study.stability import stability

    if given:
        raise SceneError(f"--stability runs no scene, and takes only --integrators and --out; leave out {given[0]}.")
    result = stability(integrators)
    with bar("stability") as progress:
        paths = write(result, out, progress=progress)
    print_result(result, paths, as_json, below="leading error")
