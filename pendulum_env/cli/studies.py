"""The command of a study: its options are the settings of the study, which are declared once, as its fields."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from inspect import cleandoc
from typing import TYPE_CHECKING, Annotated, Any

from pendulum_env.cli import options
from pendulum_env.cli.console import bar, print_result
from pendulum_env.common.provenance import checked_folder

if TYPE_CHECKING:
    from pendulum_env.study.study import Study


def command_of(kind: type[Study]) -> Callable[..., None]:
    """Return the command of a study, a function with an option for each of its settings, for typer."""
    settings = {entry.name: entry for entry in fields(kind)}  # type: ignore[arg-type]

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

        study = kind(**{name: options.value_of(name, settings[name], value) for name, value in given.items()
                        if value is not None})
        folder = checked_folder(out or f"out/{kind.name}")
        with bar(kind.name) as progress:
            found = study(file=folder / f"{kind.name}.jsonl", anew=not resume, progress=progress,
                          on_error="record" if record else "raise")
        if not found.rows:
            raise KeyboardInterrupt
        paths = write(found, folder, svg)
        print_result(found, paths, as_json, title=found.title)
        if not found.complete:
            raise KeyboardInterrupt

    command.__doc__ = f"{cleandoc(kind.__doc__ or '')}\n\nThe folder is out/{kind.name}."
    options.complete(command, [options.of_setting(name, entry, f"{options.about(entry)}.")
                               for name, entry in settings.items()])
    return command


def run_command(kind: type[Study]) -> None:
    """Run the command of a study of your own, with the options of the command line, as ``lab-pendulum`` runs its own.

    It is for the end of a file with a study: ``if __name__ == "__main__": run_command(LargestSpeed)``.
    """
    from pendulum_env.cli import run_alone

    run_alone(command_of(kind))
