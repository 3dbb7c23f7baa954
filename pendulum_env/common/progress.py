"""Progress bars and progress callbacks of long computations."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext

from pendulum_env.common.checks import function

Progress = Callable[[float, str], None]
"""Progress callback, called with the fraction done (0 to 1) and a text on the present activity."""

LATE = 1.5
"""Time after which :func:`late_bar` shows its bar [s]."""


def told_by(progress: Progress | None) -> Progress:
    """Return a progress callback: the given function or, for None, a function that does nothing.

    Raises SceneError for anything else.
    """
    return _ignore if progress is None else function(progress, "progress")


def telling_of(progress: Progress | bool | None, title: str) -> AbstractContextManager[Progress]:
    """Return a context manager that yields a progress callback.

    It shows a bar with this title if ``progress`` is True, does nothing for False and None, and is ``progress`` itself
    if that is a function.
    """
    if progress is True:
        return progress_bar(title)
    return nullcontext(told_by(None if progress is False else progress))


def _ignore(_done: float, _activity: str) -> None:
    pass


@contextmanager
def progress_bar(title: str) -> Iterator[Progress]:
    """Show a progress bar on standard error, which disappears at the end; yield its callback."""
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (TextColumn(title), BarColumn(), TextColumn("{task.description}"), TimeRemainingColumn())
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=1.0)
        yield lambda done, activity: bar.update(task, completed=done, description=activity)


@contextmanager
def late_bar(title: str) -> Iterator[Progress]:
    """Yield a progress callback that shows a progress bar only if the work takes longer than 1.5 s."""
    begun = time.monotonic()
    bars: list[Progress] = []
    with ExitStack() as stack:

        def tell(done: float, activity: str) -> None:
            if not bars and time.monotonic() - begun > LATE:
                bars.append(stack.enter_context(progress_bar(title)))
            for bar in bars:
                bar(done, activity)

        yield tell
