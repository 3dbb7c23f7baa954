"""``lab-pendulum``: the studies from the command line."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pendulum_env.progress import Progress, progress_bar

if TYPE_CHECKING:
    from pendulum_env.catalogue import Table
    from pendulum_env.physics.scene import Scene

app = typer.Typer(
    help="A university lab's pendulum: compare integrators, measure what accuracy costs, film it.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


SceneName = Annotated[str, typer.Option(help="Preset (lab-pendulum list scenes) or a scene's JSON file.")]
Integrator = Annotated[str, typer.Option(help="Name of a method (lab-pendulum list integrators).")]
Damping = Annotated[str, typer.Option(help="scene, none, linear, linear+quadratic, linear:gamma=0.1, ...")]
Angle = Annotated[float | None, typer.Option(help="Release angle in degrees; by default the scene's.")]
Velocity = Annotated[float | None, typer.Option(help="Release velocity in rad/s; by default the scene's.")]
Step = Annotated[float | None, typer.Option(help="The integrator's step in s; by default the scene's.")]
Duration = Annotated[float | None, typer.Option(help="Length of the run in s; by default the scene's.")]
Out = Annotated[Path, typer.Option(help="Folder for the files.")]
Settings = Annotated[list[str] | None, typer.Option("--set", help="A scene's parameter, as in --set length=0.5.")]


def main() -> None:
    """Run the command line; errors of input end with one sentence and exit code 2."""
    try:
        app()
    except (ValueError, TypeError, OSError, RuntimeError) as error:
        _say(f"Error: {error}")
    except ArithmeticError as error:
        _say(f"Error: a number is too large or too small to compute with ({error}).")
    except MemoryError:
        _say("Error: this does not fit into memory; take fewer or longer steps, or a shorter run.")
    else:
        return
    sys.exit(2)


def _say(text: str) -> None:
    print(text, file=sys.stderr)


@contextmanager
def _progress(title: str) -> Iterator[Progress]:
    """A progress bar that says what an interruption leaves."""
    with progress_bar(title) as bar:
        try:
            yield bar
        except KeyboardInterrupt:
            _say("Interrupted; files that were finished are whole.")
            raise


def _print_table(table: Table, title: str = "") -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table as Shown

    console = Console() if sys.stdout.isatty() else Console(width=160)
    shown = Shown(title=title or None, box=box.SIMPLE_HEAD, title_justify="left")
    for i, name in enumerate(table.head):
        shown.add_column(name, no_wrap=i == 0)
    for row in table.rows:
        shown.add_row(*row)
    console.print(shown)


def _print_files(paths: Iterable[Path]) -> None:
    paths = list(paths)
    print(f"Wrote {len(paths)} files to {paths[0].parent}: {', '.join(path.name for path in paths)}")


def _radians(degrees: float | None) -> float | None:
    return None if degrees is None else math.radians(degrees)


def _parameters(settings: Sequence[str] | None) -> dict[str, Any]:
    """``--set name=value`` as keyword arguments; a value that is no number stays text."""
    from pendulum_env.physics.units import SceneError

    found: dict[str, Any] = {}
    for setting in settings or ():
        name, equals, value = setting.partition("=")
        if not equals:
            raise SceneError(f"--set takes name=value, as in --set length=0.5, not {setting!r}.")
        try:
            found[name.strip()] = float(value)
        except ValueError:
            found[name.strip()] = value.strip()
    return found


def _scene(scene: str, damping: str, settings: Sequence[str] | None) -> Scene:
    from pendulum_env.physics.damping import build_scene, parse_damping

    return build_scene(scene, parse_damping(damping), _parameters(settings))


@app.command()
def compare(
    scene: SceneName = "exercise",
    integrators: Annotated[str, typer.Option(help="Names of methods, with commas between.")] = (
        "forward_euler,backward_euler,symplectic_euler,velocity_verlet,rk4"
    ),
    damping: Damping = "scene",
    angle: Angle = None,
    velocity: Velocity = None,
    dt: Step = None,
    duration: Duration = None,
    recording: Annotated[Path | None, typer.Option(help="A sensor's recording to lay over the curves.")] = None,
    film: Annotated[bool, typer.Option(help="Film the pendulums side by side.")] = True,
    out: Out = Path("out/compare"),
    settings: Settings = None,
) -> None:
    """Several integrators on one scene: curves, phase portrait, energy, drift table, CSV and a film side by side."""
    from pendulum_env.catalogue import Table
    from pendulum_env.lab.recording import Recording
    from pendulum_env.provenance import output_folder
    from pendulum_env.study.compare import compare as run
    from pendulum_env.study.compare import write

    place = _scene(scene, damping, settings)
    measured = None if recording is None else Recording.read(recording)
    with _progress("compare") as progress:
        found = run(place, integrators, angle=_radians(angle), velocity=velocity, dt=dt, duration=duration,
                    recording=measured, progress=lambda done, what: progress(0.3 * done, what))
        output_folder(out)
        paths = write(found, out, film=film, progress=lambda done, what: progress(0.3 + 0.7 * done, what))
    print(found.text)
    _print_table(Table(found.header, found.cells))
    _print_files(paths)


@app.command()
def cost(
    scene: SceneName = "lab",
    integrators: Annotated[str | None, typer.Option(help="Names with commas between; by default all that fit.")] = None,
    damping: Damping = "scene",
    angle: Angle = None,
    velocity: Velocity = None,
    duration: Duration = 20.0,
    repeats: Annotated[int, typer.Option(help="Timings of each run; the shortest counts.")] = 5,
    out: Out = Path("out/cost"),
    settings: Settings = None,
) -> None:
    """Work-precision diagram: error against time for the methods on a scene, and which to use."""
    from pendulum_env.provenance import output_folder
    from pendulum_env.study.cost import cost as run
    from pendulum_env.study.cost import write
    from pendulum_env.study.tables import recommendations

    place = _scene(scene, damping, settings)
    names = None if integrators is None else [name.strip() for name in integrators.split(",")]
    output_folder(out)
    with _progress("cost") as progress:
        study = run(place, names, angle=_radians(angle), velocity=velocity, duration=duration, repeats=repeats,
                    progress=progress)
    if not study.points:
        raise KeyboardInterrupt
    paths = write(study, out)
    print(f"{place.name}: {place.equation()}\nTruth: {study.reference.how}")
    if not study.complete:
        print("Interrupted: what was measured until then follows.")
    _print_table(recommendations(study), "for this accuracy, use")
    print(study.sentence())
    _print_files(paths)


@app.command()
def effects(
    scene: SceneName = "lab",
    amplitude: Annotated[float, typer.Option(help="Release angle in degrees.")] = 30.0,
    tolerance: Annotated[float, typer.Option(help="Relative change of period or amplitude that matters.")] = 1e-4,
    damping: Damping = "scene",
    out: Annotated[Path | None, typer.Option(help="Folder for a bar chart and a CSV; none by default.")] = None,
    settings: Settings = None,
) -> None:
    """Which effects a scene calls for: how much each changes the motion, by simulation, and what each costs."""
    from pendulum_env.provenance import output_folder
    from pendulum_env.study.audit import simplify, write
    from pendulum_env.study.tables import verdicts

    place = _scene(scene, damping, settings)
    if out is not None:
        output_folder(out)
    with _progress("effects") as progress:
        _, report = simplify(place, amplitude=math.radians(amplitude), tolerance=tolerance, progress=progress)
    print(f"{place.name}: {place.equation()}, from {amplitude:g}°, tolerance {tolerance:g}")
    _print_table(verdicts(report.audit))
    print(report.text)
    if out is not None:
        _print_files(write(report.audit, out))


@app.command()
def record(
    scene: SceneName = "lab",
    integrator: Integrator = "rk4",
    damping: Damping = "scene",
    angle: Angle = None,
    velocity: Velocity = None,
    dt: Step = None,
    duration: Duration = 10.0,
    control: Annotated[float, typer.Option(help="Constant share of the motor's torque, -1 to 1.")] = 0.0,
    fps: Annotated[float, typer.Option(help="Frames per second; a gif takes 50 or 25.")] = 50.0,
    slow: Annotated[float, typer.Option(help="Slow-motion factor.")] = 1.0,
    size: Annotated[int, typer.Option(help="Side of the square frames in pixels.")] = 500,
    out: Annotated[Path, typer.Option(help="The film, ending in .mp4 or .gif.")] = Path("out/pendulum.mp4"),
    settings: Settings = None,
) -> None:
    """Film a run at true speed or in slow motion."""
    from pendulum_env.engine.machine import Machine
    from pendulum_env.study.record import record as run

    machine = Machine(_scene(scene, damping, settings), integrator)
    with _progress("record") as progress:
        path, reason = run(machine, out, angle=_radians(angle), velocity=velocity, duration=duration, dt=dt,
                           control=control, fps=fps, slow=slow, size=size, progress=progress)
    if reason:
        print(f"The run stopped early: {reason}.")
    print(f"Wrote {path}")


@app.command(name="list")
def list_(
    what: Annotated[str | None, typer.Argument(help="scenes, integrators, effects or tasks; all by default.")] = None,
    scene: Annotated[
        str | None, typer.Option(help="Of integrators: which fit this scene, and why the others do not.")
    ] = None,
    damping: Damping = "scene",
    csv: Annotated[bool, typer.Option(help="Print CSV, with all that is known of each.")] = False,
    markdown: Annotated[bool, typer.Option(help="Print Markdown, as in the README.")] = False,
) -> None:
    """Scenes, integrators, effects and tasks, read off the registries; --scene says which integrators fit."""
    from pendulum_env.catalogue import TABLES, find_table, integrators_data
    from pendulum_env.physics.units import SceneError

    if csv and markdown:
        raise SceneError("--csv and --markdown are two forms of a list; ask for one.")
    if csv and what is None:
        raise SceneError(f"--csv takes one list at a time: {', '.join(TABLES)}.")
    if scene is None and damping != "scene":
        raise SceneError("--damping goes with --scene, which is missing.")
    if scene is not None and (what != "integrators" or csv or markdown):
        raise SceneError("--scene goes with 'lab-pendulum list integrators', without --csv or --markdown.")
    place = None if scene is None else _scene(scene, damping, None)
    for name in TABLES if what is None else (what,):
        if name == "integrators" and not (csv or markdown):
            _print_integrators(place)
            continue
        table = integrators_data() if csv and name == "integrators" else find_table(name)
        if csv:
            print(table.csv(), end="")
        elif markdown:
            print(f"### {name}\n\n{table.markdown()}\n")
        else:
            _print_table(table, name)


def _print_integrators(scene: Scene | None) -> None:
    """The integrators as wide as the terminal, or those that fit a scene, and why others do not."""
    from shutil import get_terminal_size

    from integrators import METHODS
    from pendulum_env.method_list import fit_listing, listing

    width = get_terminal_size((100, 24)).columns
    print(listing(METHODS.values(), width) if scene is None else fit_listing(scene, width))


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
