"""What commands print: messages, progress, tables, files."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from pendulum_env.progress import Progress, progress_bar

if TYPE_CHECKING:
    from pendulum_env.catalogue import Table
    from pendulum_env.physics.scene import Scene


LINE = 118
"""Most characters in a line of text."""


def say(text: str) -> None:
    print(text, file=sys.stderr)


def print_text(text: str, width: int = LINE, further: str = "    ") -> None:
    """Lines no wider than that; what goes on is set in."""
    from textwrap import fill

    for line in text.splitlines():
        print(fill(line, width, subsequent_indent=further, break_long_words=False, break_on_hyphens=False))


@contextmanager
def bar(title: str) -> Iterator[Progress]:
    """A progress bar that says what an interruption leaves."""
    with progress_bar(title) as found:
        try:
            yield found
        except KeyboardInterrupt:
            say("Interrupted; files that were finished are whole.")
            raise


def print_table(table: Table, title: str = "") -> None:
    from rich import box
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table as Shown

    console = Console() if sys.stdout.isatty() else Console(width=160)
    shown = Shown(title=title or None, box=box.SIMPLE_HEAD, title_justify="left")
    for i, name in enumerate(table.head):
        shown.add_column(escape(name), no_wrap=i == 0)
    for row in table.rows:
        shown.add_row(*row)
    console.print(shown)


def print_files(paths: Iterable[Path]) -> None:
    paths = list(paths)
    print_text(f"Wrote {len(paths)} files to {paths[0].parent}: {', '.join(path.name for path in paths)}")


def print_listing(name: str) -> None:
    """All integrators or effects, as wide as the terminal is."""
    from integrators import METHODS
    from pendulum_env import effect_list, method_list
    from pendulum_env.physics.effects import EFFECTS

    width = _width()
    print(effect_list.listing(EFFECTS.values(), width) if name == "effects" else
          method_list.listing(METHODS.values(), width))


def print_scene(name: str, scene: Scene) -> None:
    """Of a list about one scene: the integrators that fit it and why others do not, or the scene in words."""
    from pendulum_env.method_list import fit_listing

    print_text(fit_listing(scene, _width()) if name == "integrators" else scene.describe())


def _width() -> int:
    from shutil import get_terminal_size

    return get_terminal_size((100, 24)).columns
