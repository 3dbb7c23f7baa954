"""The command ``lab-pendulum cost``: work-precision diagrams and, with ``--growth``, the growth of errors."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pendulum_env.cli import options
from pendulum_env.cli.console import bar, print_result
from pendulum_env.cli.options import scene_of
from pendulum_env.physics.units import number


def cost(
    scene: options.SceneName = "lab",
    integrators: options.IntegratorsOrNone = None,
    damping: options.Damping = "scene",
    angle: options.AngleOrNone = None,
    velocity: options.Velocity = None,
    duration: options.Duration = 20.0,
    repeats: Annotated[
        int, options.count("Number of timings of each run, half for long ones; the shortest counts.")] = 5,
    resume: Annotated[
        bool, options.flag("Continue an interrupted study from its files in the output folder.", "--resume")] = False,
    scheduler: Annotated[str | None, options.option("Run on a Dask cluster, scheduler tcp://HOST:PORT.")] = None,
    growth: Annotated[
        float | None, options.number("Also measure the growth of errors over this many periods, as in --growth 1e5.")
    ] = None,
    svg: options.Svg = False,
    out: options.Out = Path("out/cost"),
    as_json: options.Json = False,
    settings: options.Settings = None,
) -> None:
    """Draw a work-precision diagram, error against time, of the methods on a scene, and recommend methods.

    By default all methods that fit the scene are studied. Methods run with many steps and, if they estimate their
    error, with many tolerances. Each measurement is stored in cost.jsonl in the output folder: --resume continues an
    interrupted study; without it, the study starts from the beginning.
    """
    from pendulum_env.common.results import write
    from pendulum_env.study.cost.study import JOURNAL
    from pendulum_env.study.cost.study import cost as run
    from pendulum_env.study.growth import growth as run_growth
    from pendulum_env.study.growth import planned
    from pendulum_env.study.sweep.cluster import executor_at

    place = scene_of(scene, damping, settings)
    periods = None if growth is None else number(growth, "--growth", least=1.0, unit="periods")
    if periods is not None:
        planned(place, integrators, angle=angle, velocity=velocity, periods=periods)
    with executor_at(scheduler) as executor, bar("cost") as progress:
        study = run(place, integrators, angle=angle, velocity=velocity, duration=duration, repeats=repeats,
                    executor=executor, file=out / JOURNAL, resume=resume, progress=progress)
    if not study.points:
        raise KeyboardInterrupt
    paths, more, grown = [*write(study, out, svg), out / JOURNAL], dict[str, Any](), None
    try:
        if study.complete and periods is not None:
            with bar("growth") as progress:
                grown = run_growth(place, integrators, angle=angle, velocity=velocity, periods=periods,
                                   progress=progress)
            if not grown.lines:
                raise KeyboardInterrupt
            files = write(grown, out, svg)
            more["growth"] = grown.to_dict(text=grown.text, files=[str(path) for path in files])
    finally:  # whatever becomes of the second study, the first one's results are printed
        before = f"{place.name}: {place.equation()}\nReference solution: {study.reference.how}"
        if not study.complete:
            before += "\nInterrupted: the results so far follow; --resume continues the study."
        print_result(study, paths, as_json, before=before, title="for this accuracy, use", **more)
    if not study.complete:
        raise KeyboardInterrupt
    if grown is not None and not as_json:
        print_result(grown, files, before=grown.text, title="how errors grow", after="")
