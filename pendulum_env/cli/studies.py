"""The command of a study: its options are the settings of the study, which are declared once, as its fields."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from inspect import cleandoc
from typing import TYPE_CHECKING, Annotated, Any

from pendulum_env.cli import options
from pendulum_env.cli.console import bar, print_result, say
from pendulum_env.common.provenance import checked_folder
from pendulum_env.physics.units import SceneError

if TYPE_CHECKING:
    from pendulum_env.study.study import Study

TAKEN = ("out", "resume", "record", "record_errors", "svg", "as_json", "json", "help")
"""Names of options that every study's command has."""


def command_of(kind: type[Study]) -> Callable[..., None]:
    """Return the command of a study, a function with an option for each of its settings, for typer."""
    kind.check()
    settings = {entry.name: entry for entry in fields(kind) if entry.init}  # type: ignore[arg-type]
    if taken := [name for name in settings if name in TAKEN]:
        raise SceneError(f"A setting of the study {kind.name} cannot be called {taken[0]}, as the commands of all "
                         "studies have that option; give it another name.")

    def command(
        out: options.OutOrNone = None,
        resume: Annotated[bool, options.flag("Continue an interrupted study from its journal in the folder.",
                                             "--resume")] = False,
        record: Annotated[bool, options.flag("Keep the reason of a point that fails in its row, and go on.",
                                             "--record-errors")] = False,
        svg: options.Svg = False,
        as_json: options.Json = False,
        **given: Any,
    ) -> None:
        from pendulum_env.common.results import write
        from pendulum_env.study.sweep.journal import OtherSweepError
        from pendulum_env.truth.reference import StudyError

        study = kind(**{name: options.value_of(name, settings[name], value) for name, value in given.items()
                        if value is not None})
        folder = checked_folder(out or f"out/{kind.name}")
        try:
            with bar(kind.name) as progress:
                found = study(file=folder / f"{kind.name}.jsonl", anew=not resume, progress=progress,
                              on_error="record" if record else "raise")
        except OtherSweepError as error:
            raise StudyError(f"{error} To begin again in this folder, leave --resume out.") from None
        if not found.rows:
            say("Interrupted before the first point was done.")
            raise KeyboardInterrupt
        paths = write(found, folder, svg)
        print_result(found, paths, as_json, title=found.title)
        if not found.complete:
            say("--resume continues the study; without it, it begins again.")
            raise KeyboardInterrupt

    about = cleandoc(kind.__doc__ or "")
    command.__doc__ = (f"{about}\n\nThe files are written to out/{kind.name}, or to the folder of --out. Angles on the "
                       "command line are in degrees.")
    options.complete(command, [options.of_setting(name, entry, f"{options.about(entry)}.")
                               for name, entry in settings.items()])
    return command


def run_command(kind: type[Study]) -> None:
    """Run the command of a study of your own, with the options of the command line, as ``lab-pendulum`` runs its own.

    It is for the end of a file with a study: ``if __name__ == "__main__": run_command(LargestSpeed)``.
    """
    from pendulum_env.cli import run_alone

    run_alone(command_of(kind))
