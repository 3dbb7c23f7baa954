"""``lab-pendulum stress``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from pendulum_env.cli.console import bar, print_files, print_table, print_text
from pendulum_env.cli.options import Out, Svg


def stress(
    scene: Annotated[str | None, typer.Option(help="Only the cases of this scene.")] = None,
    integrators: Annotated[str | None, typer.Option(help="Names with commas between; by default all.")] = None,
    cases: Annotated[
        list[str] | None, typer.Option(help="A case or a group of them, one each time; by default all short ones.")
    ] = None,
    long: Annotated[bool, typer.Option("--long", help="Also the cases that take long with each method.")] = False,
    show: Annotated[
        bool, typer.Option("--list", help="Run nothing: each case, why it is hard, its truth and the truth's source.")
    ] = False,
    svg: Svg = False,
    out: Out = Path("out/stress"),
) -> None:
    """Hard cases with known truths, tried with every method: what becomes of each, as a matrix, PNG and CSV.

    accurate: the truth is met to what the method's order leaves. stable: bounded and of the right kind, not accurate.
    diverged: the run stopped and said so, its last finite state kept. refused: the scene lacks what the method declares
    that it needs. wrong: finite and false, which is always a failure. What each kind of method may do was written down
    before; a failure is any other outcome, and ends the command with exit code 1 unless its reason is known.
    """
    from pendulum_env.common.provenance import output_folder
    from pendulum_env.hard_cases.run import chosen_cases, listing, write
    from pendulum_env.hard_cases.run import stress as run

    names = _split(integrators)
    if show:
        print_text(listing(chosen_cases(cases, scene, long)))
        return
    output_folder(out)
    with bar("stress") as progress:
        found = run(cases, names, scene=scene, long=long, progress=progress)
    if not found.entries:
        raise KeyboardInterrupt
    paths = write(found, out, svg)
    print_table(found.table, "what became of the methods, case by case")
    print_text(found.text)
    print_files(paths)
    if not found.complete:
        raise KeyboardInterrupt
    if found.failures:
        raise typer.Exit(1)


def _split(names: str | None) -> Sequence[str] | None:
    return None if names is None else [name for part in names.split(",") if (name := part.strip())]
