"""The command ``lab-pendulum stress``, which runs hard cases with every method."""

from __future__ import annotations

from typing import Annotated

import typer

from pendulum_env.cli import options
from pendulum_env.cli.console import bar, print_result, print_text
from pendulum_env.cli.options import given_by_user
from pendulum_env.common.provenance import checked_folder
from pendulum_env.physics.units import SceneError


def stress(
    context: typer.Context,
    scene: options.SceneOrNone = None,
    integrators: options.IntegratorsOrNone = None,
    cases: Annotated[
        list[str] | None,
        options.option("A hard case or group; repeat the option for more; by default all short.")] = None,
    long: Annotated[bool, options.flag("Also run the hard cases that take long.", "--long")] = False,
    show: Annotated[
        bool, options.flag("Only list the cases: why each is hard, the true result and its source.", "--list")] = False,
    svg: options.Svg = False,
    out: options.OutOrNone = None,
    as_json: options.Json = False,
) -> None:
    """Run hard cases with known true results with every method; the outcomes are a matrix, PNG and CSV.

    The folder is out/stress. --scene runs only the cases of that scene.

    accurate: the error is as small as the method's order allows. stable: bounded and of the right kind, not accurate.
    diverged: the run stopped and reported it, with its last finite state. refused: the scene lacks a function that the
    method needs, and an error said so. wrong: finite and false, which is always a failure. The allowed outcomes of each
    kind of method follow from theory; any other outcome is a failure, with exit code 1 unless its reason is known.
    """
    from pendulum_env.common.results import write
    from pendulum_env.hard_cases.run import chosen_cases, listing
    from pendulum_env.hard_cases.run import stress as run

    if show:
        if unused := given_by_user(context, "integrators", "svg", "out", "as_json"):
            raise SceneError(f"--list runs no method and writes no file; leave out {unused[0]}.")
        print_text(listing(chosen_cases(cases, scene, long)))
        return
    folder = checked_folder(out or "out/stress")
    with bar("stress") as progress:
        matrix = run(cases, integrators, scene=scene, long=long, progress=progress)
    if not matrix.entries:
        raise KeyboardInterrupt
    paths = write(matrix, folder, svg)
    print_result(matrix, paths, as_json, title="outcome of every method in every case")
    if not matrix.complete:
        raise KeyboardInterrupt
    if matrix.failures:
        raise typer.Exit(1)
