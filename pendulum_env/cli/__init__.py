"""``lab-pendulum``: the studies from the command line."""

from __future__ import annotations

import math
import sys
import warnings
from functools import cache
from pathlib import Path
from typing import Annotated

import typer

from pendulum_env.cli.auto import auto
from pendulum_env.cli.console import bar, print_files, print_listing, print_scene, print_table, print_text, say
from pendulum_env.cli.demo import demo
from pendulum_env.cli.fit import fit
from pendulum_env.cli.options import (
    Angle,
    Atol,
    Damping,
    Duration,
    Out,
    Panels,
    Reading,
    Rtol,
    SceneName,
    Settings,
    Step,
    Svg,
    Theme,
    Velocity,
    radians,
    recording_of,
    scene_of,
    split,
)
from pendulum_env.cli.record import record
from pendulum_env.cli.show import show
from pendulum_env.cli.stress import stress
from pendulum_env.study import PLAIN

NAME = "lab-pendulum"
"""Of the program."""

app = typer.Typer(
    help="A university lab's pendulum: compare integrators, measure what accuracy costs, film it.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


def main() -> None:
    """Run the command line; errors of input end with one sentence and exit code 2, warnings are sentences said once."""
    try:
        with warnings.catch_warnings():
            said = cache(lambda text: say(f"Warning: {text}"))
            warnings.showwarning = lambda text, *_: said(str(text))
            app(prog_name=NAME)
    except (ValueError, TypeError, OSError, RuntimeError) as error:
        say(f"Error: {error}")
    except ArithmeticError as error:
        say(f"Error: a number is too large or too small to compute with ({error}).")
    except MemoryError:
        say("Error: this does not fit into memory; take fewer or longer steps, or a shorter run.")
    else:
        return
    sys.exit(2)


@app.command()
def compare(
    context: typer.Context,
    scene: SceneName = "exercise",
    integrators: Annotated[
        list[str], typer.Option("--integrators", "-i", help="Names of methods, with commas between or one each time.")
    ] = [",".join(PLAIN)],  # noqa: B006, B008
    damping: Damping = "scene",
    angle: Angle = None,
    velocity: Velocity = None,
    dt: Step = None,
    duration: Duration = None,
    rtol: Rtol = None,
    atol: Atol = None,
    recording: Annotated[Path | None, typer.Option(help="A sensor's recording to lay over the curves.")] = None,
    film: Annotated[bool, typer.Option(help="Film the pendulums side by side.")] = True,
    theme: Theme = "light",
    panels: Panels = "apparatus,energy",
    stability: Annotated[
        bool, typer.Option("--stability", help="The methods alone: stability regions, growth, phase error, limits.")
    ] = False,
    out: Annotated[Path | None, typer.Option(help="Folder for the files, out/compare or out/stability.")] = None,
    settings: Settings = None,
    read: Reading = None,
) -> None:
    """Several integrators on one scene: curves, phase portrait, energy, drift table, CSV and a film side by side.

    With --rtol all methods must be adaptive, and dt is the time between records. With --stability no scene is run.
    """
    names = ",".join(integrators)
    if stability:
        given = [name for name in context.params if name not in ("integrators", "stability", "out")]
        from pendulum_env.cli.parts import show_stability

        show_stability(names, [name for name in given if _is_given(context, name)], out or Path("out/stability"))
        return

    from pendulum_env.common.provenance import output_folder
    from pendulum_env.envs.settings import checked_look
    from pendulum_env.physics.units import SceneError
    from pendulum_env.study.compare import compare as run
    from pendulum_env.study.compare import write
    from pendulum_env.study.compare.drift import LEADING_ERROR

    folder, look = out or Path("out/compare"), checked_look(theme, split(panels), ("energy",), "")
    if not film and (given := [name for name in ("theme", "panels") if _is_given(context, name)]):
        raise SceneError(f"--{given[0]} is the film's, and --no-film makes none.")
    place = scene_of(scene, damping, settings)
    measured = recording_of(recording, read) if recording is not None or read else None
    with bar("compare") as progress:
        found = run(place, names, angle=radians(angle), velocity=velocity, dt=dt, duration=duration, rtol=rtol,
                    atol=atol, recording=measured, progress=lambda done, what: progress(0.3 * done, what))
        output_folder(folder)
        paths = write(found, folder, film=film, theme=look.theme, panels=look.panels,
                      progress=lambda done, what: progress(0.3 + 0.7 * done, what))
    print_text(found.text)
    print_table(found.table, below=LEADING_ERROR)
    print_files(paths)


def _is_given(context: typer.Context, name: str) -> bool:
    """True if an option stands on the command line."""
    source = context.get_parameter_source(name)
    return source is not None and source.name == "COMMANDLINE"


@app.command()
def cost(
    scene: SceneName = "lab",
    integrators: Annotated[str | None, typer.Option(help="Names with commas between; by default all that fit.")] = None,
    damping: Damping = "scene",
    angle: Angle = None,
    velocity: Velocity = None,
    duration: Duration = 20.0,
    repeats: Annotated[int, typer.Option(help="Timings of each run; the shortest counts.")] = 5,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the journal in the output folder.")] = False,
    scheduler: Annotated[str | None, typer.Option(help="A Dask scheduler that runs it, tcp://HOST:PORT.")] = None,
    growth: Annotated[
        float | None, typer.Option(help="Also follow the errors over so many periods, as in --growth 1e5.")
    ] = None,
    svg: Svg = False,
    out: Out = Path("out/cost"),
    settings: Settings = None,
) -> None:
    """Work-precision diagram: error against time for the methods on a scene, and which to use.

    Steps and, for methods that estimate their error, tolerances. Each measurement goes to cost.jsonl in the output
    folder, which stays there: --resume goes on with a study that was interrupted; without, it starts anew.
    """
    from pendulum_env.common.provenance import output_folder
    from pendulum_env.physics.units import number
    from pendulum_env.study.cost.files import JOURNAL, write
    from pendulum_env.study.cost.points import recommendations
    from pendulum_env.study.cost.study import cost as run
    from pendulum_env.study.sweep.cluster import executor_at

    place = scene_of(scene, damping, settings)
    names = None if integrators is None else [name for part in integrators.split(",") if (name := part.strip())]
    periods = None if growth is None else number(growth, "--growth", least=1.0, unit="periods")
    output_folder(out)
    with executor_at(scheduler) as executor, bar("cost") as progress:
        study = run(place, names, angle=radians(angle), velocity=velocity, duration=duration, repeats=repeats,
                    executor=executor, file=out / JOURNAL, resume=resume, progress=progress)
    if not study.points:
        raise KeyboardInterrupt
    paths = write(study, out, svg)
    print_text(f"{place.name}: {place.equation()}\nTruth: {study.reference.how}")
    if not study.complete:
        print("Interrupted: what was measured until then follows; --resume goes on.")
    print_table(recommendations(study), "for this accuracy, use")
    print_text("\n".join(line for line in (study.sentence(), study.left_out) if line))
    print_files((*paths, out / JOURNAL))
    if not study.complete:
        raise KeyboardInterrupt
    if periods is not None:
        from pendulum_env.cli.parts import show_growth

        show_growth(place, names, radians(angle), velocity, periods, out, svg)


app.command()(demo)
app.command()(auto)
app.command()(fit)
app.command()(show)
app.command()(stress)


@app.command()
def effects(
    scene: SceneName = "lab",
    amplitude: Annotated[float, typer.Option(help="Release angle in degrees.")] = 30.0,
    tolerance: Annotated[float, typer.Option(help="Relative change of period or amplitude that matters.")] = 1e-4,
    damping: Damping = "scene",
    duration: Duration = None,
    complete: Annotated[bool, typer.Option("--complete", help="Add what the scene calls for and lacks.")] = False,
    svg: Svg = False,
    out: Annotated[Path | None, typer.Option(help="Folder for a bar chart and a CSV; none by default.")] = None,
    settings: Settings = None,
) -> None:
    """Which effects a scene calls for, of all that are known: what each changes, by simulation, and what it costs."""
    from pendulum_env.common.provenance import output_folder
    from pendulum_env.physics.units import SceneError
    from pendulum_env.study.audit.simplification import simplify
    from pendulum_env.study.audit.study import write
    from pendulum_env.study.audit.verdicts import remarks, verdicts

    place = scene_of(scene, damping, settings)
    if svg and out is None:
        raise SceneError("--svg goes with --out, which is missing.")
    if out is not None:
        output_folder(out)
    with bar("effects") as progress:
        plain, report = simplify(place, amplitude=math.radians(amplitude), tolerance=tolerance, duration=duration,
                                 complete=complete, progress=progress)
    print_text(f"{place.name}: {place.equation()}, from {amplitude:g}°, tolerance {tolerance:g}")
    print_table(verdicts(report.audit))
    print_text(f"{remarks(report.audit)}\n\n{report.text}")
    if plain.effects != place.effects:
        print_text(f"What is left: {plain.equation()}")
    if out is not None:
        print_files(write(report.audit, out, svg))


app.command()(record)


@app.command(name="list")
def list_(
    what: Annotated[str | None, typer.Argument(help="scenes, integrators, effects or tasks; all by default.")] = None,
    scene: Annotated[
        str | None, typer.Option(help="Of scenes: what it is. Of integrators: which fit it, and why others do not.")
    ] = None,
    damping: Damping = "scene",
    csv: Annotated[bool, typer.Option(help="Print CSV, with all that is known of each.")] = False,
    markdown: Annotated[bool, typer.Option(help="Print Markdown, as in the README.")] = False,
) -> None:
    """Scenes, integrators, effects and tasks, read off the registries; --scene says more of one scene."""
    from pendulum_env.physics.units import SceneError, shown
    from pendulum_env.study.lists.tables import TABLES, find_table, integrators_data

    if csv and markdown:
        raise SceneError("--csv and --markdown are two forms of a list; ask for one.")
    if csv and what is None:
        raise SceneError(f"--csv takes one list at a time: {', '.join(TABLES)}.")
    if scene is None and damping != "scene":
        raise SceneError("--damping goes with --scene, which is missing.")
    if scene is not None and (what not in ("integrators", "scenes") or csv or markdown):
        either = " or ".join(f"lab-pendulum list {name} --scene {shown(scene)}" for name in ("integrators", "scenes"))
        raise SceneError(f"--scene goes with one of two lists, without --csv or --markdown: {either}.")
    for name in TABLES if what is None else (what,):
        if scene is not None:
            print_scene(name, scene_of(scene, damping, None))
        elif name in ("integrators", "effects") and not (csv or markdown):
            print_listing(name)
        elif csv:
            print((integrators_data() if name == "integrators" else find_table(name)).csv(), end="")
        elif markdown:
            print(f"### {name}\n\n{find_table(name).markdown()}\n")
        else:
            print_table(find_table(name), name)


def _version(wanted: bool) -> None:
    if wanted:
        from pendulum_env import __version__

        print(f"lab-pendulum {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and stop.")
    ] = False,
) -> None: ...


if __name__ == "__main__":
    main()
