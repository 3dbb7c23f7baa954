"""The command ``lab-pendulum list``, which prints tables of scenes, integrators, effects, sources, ids and more."""

from __future__ import annotations

from typing import Annotated

import typer

from integrators import METHODS
from pendulum_env.cli import options
from pendulum_env.cli.console import print_table, print_text, printable, terminal_width
from pendulum_env.cli.options import scene_of
from pendulum_env.physics.effects import EFFECTS
from pendulum_env.physics.units import SceneError, one_of, shown

SCREEN = 80
"""Width for which a list is made that fits one screen, if the terminal's width is unknown."""


def list_(
    what: Annotated[
        str | None, typer.Argument(callback=options.lower, help="scenes, integrators, effects, bodies, tasks, "
                                   "policies, events, formats, sources, units, ids, settings; all by default.")
    ] = None,
    scene: options.SceneOrNone = None,
    damping: options.Damping = "scene",
    whole: Annotated[bool, options.flag("Print lists in full, with descriptions and sources.", "--all")] = False,
    csv: Annotated[bool, options.flag("Print CSV, with all columns.", "--csv")] = False,
    markdown: Annotated[bool, options.flag("Print tables in Markdown.", "--markdown")] = False,
) -> None:
    """List scenes, integrators, effects, bodies, tasks, policies, events, formats of recordings, live sources, units,
    environments' ids and settings.

    A list fits one screen; --all prints more. --scene describes one scene or, after integrators, lists those that
    suit it.
    """
    from pendulum_env.envs.settings import ids_table, settings_table
    from pendulum_env.study.lists import methods
    from pendulum_env.study.lists.tables import TABLES, brief, effect_listing, integrators_data, names_of

    tables = {**TABLES, "ids": ids_table, "settings": settings_table}

    if csv and markdown:
        raise SceneError("--csv and --markdown cannot be combined; leave one of them out.")
    if csv and what is None:
        raise SceneError(f"--csv prints one list at a time; name one of {', '.join(tables)}.")
    if scene is None and damping != "scene":
        raise SceneError("--damping needs --scene; give a scene.")
    if scene is not None and (what not in ("integrators", "scenes") or csv or markdown):
        either = " or ".join(f"lab-pendulum list {name} --scene {shown(scene)}" for name in ("integrators", "scenes"))
        raise SceneError(f"--scene works for two lists, without --csv or --markdown: {either}.")
    width = terminal_width(SCREEN)
    for name in tables if what is None else (one_of(what, "list of", tables),):
        if scene is not None:
            place = scene_of(scene, damping, None)
            print_text(place.describe() if name == "scenes" else methods.fit_listing(place, terminal_width(), whole))
        elif csv:
            print((integrators_data() if name == "integrators" else tables[name]()).csv(), end="")
        elif markdown:
            print(f"### {name}\n\n{tables[name]().markdown()}\n")
        elif what is None and not whole:  # the table of all integrators takes a while
            names = METHODS if name == "integrators" else (row[0] for row in tables[name]().rows)
            print(printable(names_of(name, names, width)))
        elif not whole:
            print(printable(brief(name, tables[name](), width)))
        elif name == "integrators":
            print(methods.listing(METHODS.values(), terminal_width()))
        elif name == "effects":
            print(effect_listing(EFFECTS.values(), terminal_width()))
        else:
            print_table(tables[name](), name)
    if scene is None and not (whole or csv or markdown):
        print(f"More: lab-pendulum list {what or 'scenes'}{' --all' if what else ', or --all of all lists'}")
