"""A progress bar for long work."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext

from pendulum_env.common.checks import function

Progress = Callable[[float, str], None]
"""Called with the fraction done and what is being done."""

LATE = 1.5
"""Work that has taken so long deserves a bar [s]."""


def told_by(progress: Progress | None) -> Progress:
    """What is told of progress: a function as it is, nobody for None; SceneError for anything else."""
    return _nobody if progress is None else function(progress, "progress")


def telling_of(progress: Progress | bool | None, title: str) -> AbstractContextManager[Progress]:
    """The same where True shows a bar of this title, and False nothing."""
    if progress is True:
        return progress_bar(title)
    return nullcontext(told_by(None if progress is False else progress))


def _nobody(_done: float, _what: str) -> None:
    pass


@contextmanager
def progress_bar(title: str) -> Iterator[Progress]:
    """A bar on standard error, gone when done."""
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (TextColumn(title), BarColumn(), TextColumn("{task.description}"), TimeRemainingColumn())
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=1.0)
        yield lambda done, what: bar.update(task, completed=done, description=what)


@contextmanager
def late_bar(title: str) -> Iterator[Progress]:
    """The same, but only once the work has taken long."""
    begun = time.monotonic()
    shown: list[Progress] = []
    with ExitStack() as stack:

        def tell(done: float, what: str) -> None:
            if not shown and time.monotonic() - begun > LATE:
                shown.append(stack.enter_context(progress_bar(title)))
            for bar in shown:
                bar(done, what)

        yield tell
