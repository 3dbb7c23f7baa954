"""The ``lab-pendulum`` program: studies from the command line, with one module for each command."""

from __future__ import annotations

import ast
import builtins
import sys
import traceback
import warnings
from collections.abc import Callable, Iterator, Mapping
from difflib import get_close_matches
from functools import cache
from importlib import import_module
from inspect import cleandoc
from pathlib import Path
from typing import Annotated, Any

import typer
import typer.core
import typer.main

from pendulum_env.cli.console import LINE, open_streams, say
from pendulum_env.common.texts import clean
from pendulum_env.common.version import software

NAME = "lab-pendulum"
"""Name of the program."""
COMMANDS = ("compare", "cost", "demo", "auto", "acquire", "track", "fit", "measure", "exercise", "show", "stress",
            "effects", "section", "code", "web", "record", "list")
"""Every command, in the order of the help: the function of this name in the module of this name, which is imported only
when the command is run."""

DEBUG = "--debug"
"""Option of all commands, which shows the traceback of an error."""
SAID = (ValueError, TypeError, OSError, RuntimeError)
"""Errors that are printed as one sentence, without a traceback."""


PLAIN: dict[str, Any] = {
    "pretty_exceptions_enable": False, "context_settings": {"help_option_names": ["-h", "--help"],
                                                               "max_content_width": LINE},
    "rich_markup_mode": None,  # with boxes, typer imports a third of a second of other packages
}
"""Settings of the program, and of each command."""


class Loaded(Mapping[str, Any]):
    """The commands as typer has them, each imported when it is looked up; ``others`` are those of this module."""

    def __init__(self, others: Mapping[str, Any]) -> None:
        self._others = others

    def __getitem__(self, name: str) -> Any:
        if name not in COMMANDS:
            return self._others[name]
        return typer.main.get_command(_alone(name, getattr(import_module(f"{__name__}.{name}"), _function(name))))

    def __iter__(self) -> Iterator[str]:
        yield from (*COMMANDS, *self._others)

    def __len__(self) -> int:
        return len(COMMANDS) + len(self._others)


class Commands(typer.core.TyperGroup):
    """The commands; an unknown option is answered with the nearest ones."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.commands = Loaded(self.commands)  # type: ignore[assignment]

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of the commands, without importing them."""
        return [*self.commands]  # list is here the module of that command, once it is imported

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the list of commands with the first sentences of their docstrings, which are read, not imported."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, _in_short(name)) for name in self.list_commands(ctx)])

    def invoke(self, ctx: Any) -> Any:
        """Run the command of a context."""
        try:
            return super().invoke(ctx)
        except Exception as error:
            if hasattr(error, "possibilities"):  # of an option that does not exist
                given = error.option_name.strip("-").rstrip("s")  # type: ignore[attr-defined]
                names = [name for one in error.ctx.command.get_params(ctx) for name in one.opts]  # type: ignore[attr-defined]
                error.possibilities = ([name for name in names if given in name]
                                       or get_close_matches(f"--{given}", names, n=3, cutoff=0.4))
            raise
        except SystemExit as error:  # no command of ours ends so, only the library rich where a pipe is closed
            if isinstance(error.__context__, BrokenPipeError):
                raise
            raise RuntimeError("Code of your own, such as a step, ended the command by sys.exit(), so that nothing "
                               "more was written; leave sys.exit() out.") from error


app = typer.Typer(
    cls=Commands,
    help="A university lab's pendulum: compare integrators, measure the cost of accuracy, film runs.",
    **PLAIN,
)


def _help(command: Callable[..., None]) -> str:
    """Return a command's docstring with each paragraph on one line, so that it is wrapped at the terminal's width.

    A paragraph that begins with "\\b" keeps its lines.
    """
    paragraphs = cleandoc(command.__doc__ or "").split("\n\n")
    return "\n\n".join(paragraph if paragraph.startswith("\b") else " ".join(paragraph.split())
                       for paragraph in paragraphs)


def _alone(name: str | None, command: Callable[..., None]) -> typer.Typer:
    """Return the program of a command alone, called ``name``."""
    alone = typer.Typer(add_completion=False, **PLAIN)
    alone.command(name=name, help=_help(command))(command)
    return alone


def _function(name: str) -> str:
    """Return the name of a command's function: its own or, if that is one of Python's, with an underscore."""
    return f"{name}_" if hasattr(builtins, name) else name


def _in_short(name: str) -> str:
    """Return the first paragraph of a command's docstring."""
    path = Path(__file__) if name not in COMMANDS else Path(__file__).with_name(f"{name}.py")
    found = next(node for node in ast.parse(path.read_text(encoding="utf-8")).body
                 if isinstance(node, ast.FunctionDef) and node.name == _function(name))
    return " ".join((ast.get_docstring(found) or "").partition("\n\n")[0].split())


@app.command("help")
def help_(
    context: typer.Context, command: Annotated[str | None, typer.Argument(help="A command; by default all.")] = None,
) -> None:
    """Show the help of a command, or the list of all commands."""
    words = [] if command is None else [command[:80]]  # an error quotes it
    app(args=[*words, "--help"], prog_name=NAME, standalone_mode=False)


def main() -> None:
    """Run the ``lab-pendulum`` command line.

    Errors of input end with one sentence and exit code 2, or with a traceback if ``--debug`` is given before or behind
    the command; each warning is printed once, as a sentence.
    """
    _run(app, NAME, ["--help"])


def run_alone(command: Callable[..., None]) -> None:
    """Run a command on its own, with the options of the command line, as :func:`main` runs those of the program."""
    _run(_alone(None, command), Path(sys.argv[0]).name, [])


def _run(program: typer.Typer, name: str, otherwise: list[str]) -> None:
    """Run a program with the words of the command line, or ``otherwise`` without any, and exit with its code."""
    open_streams()
    words = [word for word in sys.argv[1:] if word != DEBUG]
    try:
        with warnings.catch_warnings():
            print_once = cache(lambda text: say(f"Warning: {text}"))
            warnings.showwarning = lambda text, *_: print_once(str(text))
            try:
                code = program(args=words or otherwise, prog_name=name, standalone_mode=False)
            finally:
                # Python ends with a signal, not with the app's exit code, if an interrupt passed through a text that
                # exec ran, as in the import of a dataclass. The next exec makes it forget that.
                exec("")
    except Exception as error:
        if (said := _sentence(error)) is None:
            raise
        if len(words) < len(sys.argv) - 1:
            traceback.print_exc()
        else:
            say(f"Error: {clean(said, None)}")
        code = 2
    sys.exit(code)


def _sentence(error: Exception) -> str | None:
    """Return what is printed of an error; None for one that is a fault of the program."""
    if hasattr(error, "format_message"):  # of options that cannot be read
        text, place = error.format_message(), getattr(error, "ctx", None)
        stop = "" if text[-1:] in ".?" else "."
        return f"{text}{stop}" if place is None else f"{text}{stop} See {place.command_path} -h."
    if isinstance(error, ArithmeticError):
        return f"a number is too large or too small to compute with ({error}); check the values of the options."
    if isinstance(error, MemoryError):
        return "not enough memory; use fewer or longer steps, or a shorter run."
    return str(error) if isinstance(error, SAID) else None


def _version(wanted: bool) -> None:
    """Print the version, with a digest of the sources, and exit, if ``--version`` is given."""
    if wanted:
        print(software())
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True,
                           help="Print the version and a digest of the sources, and stop.")
    ] = False,
    debug: Annotated[
        bool, typer.Option(DEBUG, help="Show the traceback of an error in place of a sentence, before or behind a "
                           "command.")
    ] = False,
) -> None: ...


if __name__ == "__main__":
    main()
