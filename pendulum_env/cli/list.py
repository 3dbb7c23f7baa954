"""The command ``lab-pendulum list``: scenes, integrators, effects, bodies, tasks, events and formats."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from pendulum_env.cli.console import print_table, print_text, terminal_width
from pendulum_env.cli.options import Damping, scene_of

if TYPE_CHECKING:
    from pendulum_env.physics.scene import Scene


def list_(
    what: Annotated[
        str | None, typer.Argument(help="scenes, integrators, effects, bodies, tasks, events, formats; all by default.")
    ] = None,
    scene: Annotated[
        str | None, typer.Option(help="Describe this scene or, after integrators, list those suitable for it.")
    ] = None,
    damping: Damping = "scene",
    csv: Annotated[bool, typer.Option(help="Print CSV, with all columns.")] = False,
    markdown: Annotated[bool, typer.Option(help="Print tables in Markdown.")] = False,
) -> None:
    """List scenes, integrators, effects, bodies, tasks, events, and formats of recordings.

    --scene describes one scene or shows which integrators suit it.
    """
    from pendulum_env.physics.units import SceneError, shown
    from pendulum_env.study.lists.tables import TABLES, find_table, integrators_data

    if csv and markdown:
        raise SceneError("--csv and --markdown cannot be combined; leave one of them out.")
    if csv and what is None:
        raise SceneError(f"--csv prints one list at a time; name one of {', '.join(TABLES)}.")
    if scene is None and damping != "scene":
        raise SceneError("--damping needs --scene; give a scene.")
    if scene is not None and (what not in ("integrators", "scenes") or csv or markdown):
        either = " or ".join(f"lab-pendulum list {name} --scene {shown(scene)}" for name in ("integrators", "scenes"))
        raise SceneError(f"--scene works for two lists, without --csv or --markdown: {either}.")
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


def print_listing(name: str) -> None:
    """Print the list of all integrators or all effects, fitted to the terminal's width."""
    from integrators import METHODS
    from pendulum_env.physics.effects import EFFECTS
    from pendulum_env.study.lists import effects as effect_list
    from pendulum_env.study.lists import methods as method_list

    width = terminal_width()
    print(effect_list.listing(EFFECTS.values(), width) if name == "effects" else
          method_list.listing(METHODS.values(), width))


def print_scene(name: str, scene: Scene) -> None:
    """Print a description of a scene or, if ``name`` is "integrators", which integrators suit it and why."""
    from pendulum_env.study.lists.methods import fit_listing

    print_text(fit_listing(scene, terminal_width()) if name == "integrators" else scene.describe())
