"""The command ``lab-pendulum demo``, a guided tour of the package."""

from __future__ import annotations

from pathlib import Path

from pendulum_env.cli import options
from pendulum_env.cli.console import bar, print_text
from pendulum_env.common.progress import Progress

WIDTH = 78
"""Largest number of characters in a line of the tour."""


def demo(
    film: options.Film = True,
    out: options.Out = Path("out/demo"),
) -> None:
    """Show the package in two minutes: print, plot and film one story, from three Euler methods to a swing-up."""
    from pendulum_env.study.demo import Chapter
    from pendulum_env.study.demo import demo as run

    bars: list[Progress] = []
    chapters = run(out, film=film, progress=lambda done, text: bars[-1](done, text))

    def next_one() -> Chapter | None:
        with bar("demo") as progress:
            bars.append(progress)
            return next(chapters, None)

    for i, chapter in enumerate(iter(next_one, None), 1):
        print(f"{i}. {chapter.title}\n")
        print_text(chapter.text, WIDTH, "")
        print("")
        print_text(f"Wrote {', '.join(str(path) for path in chapter.files)}\n", WIDTH)
        print("")
    print("Further commands: lab-pendulum help")
