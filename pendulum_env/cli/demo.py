"""``lab-pendulum demo``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pendulum_env.cli.console import bar, print_text
from pendulum_env.cli.options import Out
from pendulum_env.common.progress import Progress

WIDTH = 78
"""Most characters in a line of the tour."""
FURTHER = (
    ("lab-pendulum compare", "more integrators on more scenes, side by side"),
    ("lab-pendulum cost", "work-precision diagrams of all methods"),
    ("lab-pendulum stress", "hard cases with known truths"),
    ("lab-pendulum effects", "which effects any scene calls for"),
    ("lab-pendulum fit FILE", "a recording of your own"),
    ("lab-pendulum record", "films of other runs"),
    ("lab-pendulum list", "scenes, integrators, effects, tasks"),
)
"""Commands that go further, and what they show."""


def demo(
    film: Annotated[bool, typer.Option(help="Film the last chapter.")] = True,
    out: Out = Path("out/demo"),
) -> None:
    """The two-minute tour: prints, plots and films one story, from three Euler methods to a swing-up."""
    from pendulum_env.study.demo.tour import Chapter
    from pendulum_env.study.demo.tour import demo as run

    told: list[Progress] = []
    chapters = run(out, film=film, progress=lambda done, what: told[-1](done, what))

    def next_one() -> Chapter | None:
        with bar("demo") as progress:
            told.append(progress)
            return next(chapters, None)

    for i, chapter in enumerate(iter(next_one, None), 1):
        print(f"{i}. {chapter.title}\n")
        print_text(chapter.text, WIDTH, "")
        print("")
        print_text(f"Wrote {', '.join(str(path) for path in chapter.files)}\n", WIDTH)
        print("")
    print("What goes further:\n")
    for command, what in FURTHER:
        print(f"  {command:23} {what}")
