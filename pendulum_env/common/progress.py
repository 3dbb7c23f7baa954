"""Progress bars and progress callbacks of long computations."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from functools import wraps
from html import escape
from importlib import import_module
from typing import Any, ParamSpec, TypeVar

from pendulum_env.common.checks import function

P = ParamSpec("P")
T = TypeVar("T")

Progress = Callable[[float, str], None]
"""Progress callback, called with the fraction done (0 to 1) and a text on the present activity."""

LATE = 1.5
"""Time after which :func:`late_bar` shows its bar [s]."""
OFTEN = 0.1
"""Shortest time between two updates of a bar in a notebook [s]."""


def told_by(progress: Progress | bool | None) -> Progress:
    """Return a progress callback: the given function or, for None, a function that does nothing.

    Raises SceneError for anything else.
    """
    return _ignore if progress is None else function(progress, "progress")


def part_of(tell: Progress, begin: float, end: float) -> Progress:
    """Return the callback of a part of the work: its fractions 0 to 1 are ``begin`` to ``end`` of the whole."""
    return lambda done, activity: tell(begin + (end - begin) * done, activity)


def telling_of(progress: Progress | bool | None, title: str) -> AbstractContextManager[Progress]:
    """Return a context manager that yields a progress callback.

    True shows a bar with this title, False none. None shows it in a notebook, if the work takes longer than 1.5 s, and
    nowhere else. A function is the callback itself.
    """
    if progress is True:
        return progress_bar(title)
    if progress is None and in_notebook():
        return late_bar(title)
    return nullcontext(told_by(None if progress is False else progress))


def with_bar(title: str) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Return a decorator for functions whose keyword ``progress`` is as for :func:`telling_of`.

    The decorated function is given a callback in its place.
    """
    def decorated(run: Callable[P, T]) -> Callable[P, T]:
        @wraps(run)
        def shown(*args: P.args, **keywords: P.kwargs) -> T:
            with telling_of(keywords.get("progress"), title) as tell:  # type: ignore[arg-type]
                return run(*args, **{**keywords, "progress": tell})  # type: ignore[arg-type]

        return shown

    return decorated


def in_notebook() -> bool:
    """Return True in a Jupyter kernel, such as those of JupyterLab, VS Code and Colab."""
    return getattr(_shell(), "kernel", None) is not None


def _shell() -> Any:
    """Return IPython's shell; None outside of it."""
    return getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()


def _ignore(_done: float, _activity: str) -> None:
    pass


@contextmanager
def progress_bar(title: str, begun: float | None = None) -> Iterator[Progress]:
    """Show a progress bar; yield its callback. ``begun`` is the time at which the work began, by default now [s].

    In a terminal the bar is on standard error and disappears at the end; in a notebook it becomes a line with the time;
    elsewhere, as in a pipe, nothing is shown.
    """
    if in_notebook():
        with notebook_bar(title, time.monotonic() if begun is None else begun) as tell:
            yield tell
        return
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (TextColumn(title), BarColumn(), TextColumn("{task.description}"), TimeRemainingColumn())
    console = Console(stderr=True)
    with Bar(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("", total=1.0)
        yield lambda done, activity: bar.update(task, completed=done, description=activity)


_LINES: dict[tuple[int, str], tuple[Any, list[float]]] = {}
"""The last finished line of a notebook, by its cell and title: the output, and the times of its runs [s]."""


@contextmanager
def notebook_bar(title: str, begun: float) -> Iterator[Progress]:
    """Show a progress bar below a notebook's cell, without widgets; yield its callback.

    At the end a line with the time takes its place, because an output that was emptied would leave a gap. Bars of one
    title in one cell share the line, which then counts them.
    """
    page = import_module("IPython.display")
    last = time.monotonic()
    cell = (getattr(_shell(), "execution_count", 0), title)
    output, times = _LINES.get(cell) or (page.display(page.HTML(_bar(title, 0.0, "")), display_id=True), [])
    _LINES.clear()

    def tell(done: float, activity: str) -> None:
        nonlocal last
        if time.monotonic() - last >= OFTEN:
            last = time.monotonic()
            output.update(page.HTML(_bar(title, done, activity)))

    word = "stopped after"
    try:
        yield tell
        word = "took"
    finally:
        times.append(time.monotonic() - begun)
        often = f", the last of {len(times)}, which took {math.fsum(times):.1f} s" if len(times) > 1 else ""
        output.update(page.HTML(f"<small>{escape(title)} {word} {times[-1]:.1f} s{often}</small>"))
        _LINES[cell] = output, times


def _bar(title: str, done: float, activity: str) -> str:
    """Return a progress bar as HTML."""
    return (f'<small>{escape(title)} <progress value="{min(max(done, 0.0), 1.0):.3f}"></progress> '
            f"{escape(activity)}</small>")


@contextmanager
def late_bar(title: str) -> Iterator[Progress]:
    """Yield a progress callback that shows a progress bar only if the work takes longer than 1.5 s."""
    begun = time.monotonic()
    bars: list[Progress] = []
    with ExitStack() as stack:

        def tell(done: float, activity: str) -> None:
            if not bars and time.monotonic() - begun > LATE:
                bars.append(stack.enter_context(progress_bar(title, begun)))
            for bar in bars:
                bar(done, activity)

        yield tell
