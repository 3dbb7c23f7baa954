"""A progress bar for long work."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

Progress = Callable[[float, str], None]
"""Called with the fraction done and what is being done."""

LATE = 1.5
"""Work that has taken so long deserves a bar [s]."""


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
