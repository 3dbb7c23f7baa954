"""Parts of commands that stand alone."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pendulum_env.cli.console import bar, print_files, print_table, print_text
from pendulum_env.physics.scene import Scene


def show_growth(
    scene: Scene, integrators: Sequence[str] | None, angle: float | None, velocity: float | None, periods: float,
    out: Path, svg: bool = False,
) -> None:
    """``lab-pendulum cost --growth``: how errors grow over so many periods; angle [rad], velocity [rad/s]."""
    from pendulum_env.study.growth.files import write
    from pendulum_env.study.growth.study import growth, remarks, table

    with bar("growth") as progress:
        found = growth(scene, integrators, angle=angle, velocity=velocity, periods=periods, progress=progress)
    if not found.lines:
        raise KeyboardInterrupt
    paths = write(found, out, svg)
    print_text(remarks(found))
    print_table(table(found), "how errors grow")
    print_files(paths)


def show_stability(integrators: str, given: Sequence[str], out: Path) -> None:
    """``compare --stability``; ``given``: other options that were given, which is refused."""
    from pendulum_env.common.provenance import output_folder
    from pendulum_env.physics.units import SceneError
    from pendulum_env.study.stability import stability, write

    if given:
        option = {"settings": "set", "film": "film or --no-film"}.get(given[0], given[0])
        raise SceneError(f"--stability shows methods alone, and takes --integrators and --out; leave out --{option}.")
    found = stability(integrators)
    output_folder(out)
    with bar("stability") as progress:
        paths = write(found, out, progress=progress)
    print_table(found.table, below="leading error")
    print_text(found.notes)
    print_files(paths)
