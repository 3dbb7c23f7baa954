"""``lab-pendulum list``: scenes, integrators, effects and tasks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from pendulum_env.cli.console import print_table, print_text, terminal_width
from pendulum_env.cli.options import Damping, scene_of

if TYPE_CHECKING:
    from pendulum_env.physics.scene import Scene


def list_(
    what: Annotated[str | None, typer.Argument(help="scenes, integrators, effects or tasks; all by default.")] = None,
    scene: Annotated[
        str | None, typer.Option(help="Of scenes: what it is. Of integrators: which fit it, and why others do not.")
    ] = None,
    damping: Damping = "scene",
    csv: Annotated[bool, typer.Option(help="Print CSV, with all that is known of each.")] = False,
    markdown: Annotated[bool, typer.Option(help="Print Markdown, as in the READMEs.")] = False,
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


def print_listing(name: str) -> None:
    """All integrators or effects, as wide as the terminal is."""
    from integrators import METHODS
    from pendulum_env.physics.effects import EFFECTS
    from pendulum_env.study.lists import effects as effect_list
    from pendulum_env.study.lists import methods as method_list

    width = terminal_width()
    print(effect_list.listing(EFFECTS.values(), width) if name == "effects" else
          method_list.listing(METHODS.values(), width))


def print_scene(name: str, scene: Scene) -> None:
    """Of a list about one scene: the integrators that fit it and why others do not, or the scene in words."""
    from pendulum_env.study.lists.methods import fit_listing

    print_text(fit_listing(scene, terminal_width()) if name == "integrators" else scene.describe())
