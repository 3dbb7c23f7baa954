"""Results that show themselves: one line of text in a console, HTML in a notebook, a figure by ``plot``.

A class declares its line in ``__repr__``; its HTML and its figures are entries of :mod:`pendulum_env.notebook`. That
room knows all results, and is loaded when the first of them is shown, so that no result knows how it is drawn.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

from pendulum_env.common.saved import Savable
from pendulum_env.common.texts import clean

ROOM = "pendulum_env.notebook"
"""Module with the functions ``html_of`` and ``figure_of``, which show every result of the package."""
WIDTH = 80
"""Largest number of characters of a line."""


def html_of(result: object) -> str:
    """Return a result of the package as HTML."""
    return str(import_module(ROOM).html_of(result))


class Displayed:
    """Base of objects that notebooks show as HTML."""

    def _repr_html_(self) -> str:
        """Return the object as HTML, which notebooks show."""
        return html_of(self)


class Plotted(Savable, Displayed):
    """Base of results that can be drawn and saved."""

    def plot(self, kind: str | None = None) -> Any:
        """Draw the result; return a ``matplotlib.figure.Figure``, which a notebook shows when it ends a cell.

        Args:
            kind: which of the result's figures; None for its usual one. An unknown kind raises SceneError, which names
                all of them.

        pyplot does not know the figure, so that it is shown only once. ``figure.savefig("name.png")`` writes a file.
        """
        return import_module(ROOM).figure_of(self, kind)


def one_line(result: object, text: str) -> str:
    """Return the line ``<Class: text>`` for a result, shortened to 80 characters."""
    line = f"<{type(result).__name__}: {clean(text, None)}>"
    return line if len(line) <= WIDTH else f"{line[: WIDTH - 4]}...>"
