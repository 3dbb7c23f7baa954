"""Results that show themselves, and their figures and tables of columns with units: as files, as JSON, for pandas.

A class of results gives its origin, its tables and the names of its figures; all that can be done with them is here. It
declares its line of text in ``__repr__``; its HTML and its figures are entries of :mod:`pendulum_env.notebook`. That
room knows all results, and is loaded when the first of them is shown, so that no result knows how it is drawn.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from pendulum_env.common.checks import SceneError, one_of, shown
from pendulum_env.common.progress import Progress, told_by
from pendulum_env.common.provenance import output_folder, write_csv
from pendulum_env.common.saved import Savable, origin_of
from pendulum_env.common.texts import Table, clean

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


STYLE = "pendulum_env.plots.style"
"""Module with the function ``save_all``, which saves a figure."""


class Column(NamedTuple):
    """Values of one quantity, one for each row of a table, with its unit; "" for texts, counts and pure numbers."""

    values: Sequence[Any]
    unit: str = ""


Columns = Mapping[str, Column]
"""A table: name of each column -> its values with their unit."""


def columns_of(units: Mapping[str, str], rows: Iterable[Sequence[Any]]) -> Columns:
    """Return a table of rows, whose cells have the order of ``units``: name of each column -> its unit."""
    cells = [*zip(*rows, strict=True)] or [()] * len(units)
    return {name: Column(values, unit) for (name, unit), values in zip(units.items(), cells, strict=True)}


class Result(Plotted):
    """Base of results that have tables and figures.

    A class of results defines :meth:`origin` and :meth:`tables`, and :meth:`pictures` if it writes several figures. Its
    figures are entries of ``pendulum_env.notebook``. Commands print ``table`` and ``text``; a notebook shows
    the equation of ``scene``, if there is one, ``table``, ``text`` and the usual figure.

    Attributes:
        complete: False if the study was interrupted, so that results are missing.
        titled: True if figures are always saved as SVG, too, with their name as the origin's "Title".
    """

    complete: bool = True
    titled: bool = False

    @property
    def table(self) -> Table:
        """Table of the result, as short texts; by default its main table."""
        columns = self._table(None)
        head = tuple(f"{name} [{one.unit}]" if one.unit else name for name, one in columns.items())
        return Table(head, tuple(zip(*(map(_short, one.values) for one in columns.values()), strict=True)))

    @property
    def text(self) -> str:
        """Sentences on the result, below its table; "" if there are none."""
        return ""

    def origin(self) -> Mapping[str, str]:
        """Return what the result comes from (scene, methods, version, ...), for the head of its files."""
        raise NotImplementedError

    def tables(self) -> Mapping[str, Columns]:
        """Return the tables, by the names of their CSV files without ending; the first is the result's main table."""
        raise NotImplementedError

    def pictures(self) -> Mapping[str, str]:
        """Return the kind of each figure, as of :meth:`plot`, by the names of their files without ending.

        By default it is the usual figure, which is named as the main table, or none for a result without figures.
        """
        return dict(zip(self.tables(), [*import_module(ROOM).figures(self)][:1], strict=False))

    def grid(self) -> Sequence[str]:
        """Return the columns of the main table whose values, in every combination, number its rows; none by default."""
        return ()

    def to_dict(self, **more: Any) -> dict[str, Any]:
        """Return the tables as data of JSON's types.

        The keys are "result" (the class), "complete", "provenance" (see :meth:`origin`) and "tables": for each table
        its "units" and its "columns", which are lists by name. ``more`` are further keys. nan and empty cells of
        numbers are None, an infinite number is the text "inf" or "-inf".
        """
        tables = {name: {"units": {key: one.unit for key, one in table.items()},
                         "columns": {key: [_json(value) for value in _cells(one)] for key, one in table.items()}}
                  for name, table in self.tables().items()}
        return {"result": type(self).__name__, "complete": self.complete, "provenance": origin_of(self),
                "tables": tables, **_json(more)}

    def to_json(self, **more: Any) -> str:
        """Return the tables as JSON text, see :meth:`to_dict`; None is null."""
        return json.dumps(self.to_dict(**more), allow_nan=False)

    def to_pandas(self, table: str | None = None) -> Any:
        """Return a table as a ``pandas.DataFrame``: the main one, or that of a name.

        Empty cells are nan in columns of numbers and "" in those of texts. Units and origin are in its ``attrs``.
        Raises SceneError for an unknown table, or if pandas is not installed.
        """
        pandas, columns = _library("pandas"), self._table(table)
        frame = pandas.DataFrame({name: _cells(one) for name, one in columns.items()})
        frame.attrs.update(units={name: one.unit for name, one in columns.items()}, provenance=origin_of(self))
        return frame

    def to_xarray(self, table: str | None = None) -> Any:
        """Return a table as an ``xarray.Dataset``: the main one, or that of a name.

        Its dimensions are the quantities of :meth:`grid`, if the table is the main one and has every combination of
        their values once, as in ``data.sel({"method": "rk4"})``; else there is one, "row".
        Units and origin are in ``attrs``. Raises SceneError for an unknown table, or if xarray is not installed.
        """
        xarray, frame = _library("xarray"), self.to_pandas(table)
        units, main = frame.attrs["units"], table in (None, next(iter(self.tables())))
        ends = {name: frame[name].unique() for name in (self.grid() if main else ()) if name in frame}
        whole = (ends and not frame.duplicated([*ends]).any() and bool(frame[[*ends]].notna().all(axis=None))
                 and len(frame) == math.prod(map(len, ends.values())))
        if whole:
            data = xarray.Dataset.from_dataframe(frame.set_index([*ends])).sel(ends)  # in the order of the rows
        else:
            data = xarray.Dataset.from_dataframe(frame.rename_axis("row" if "row" not in frame else "row number"))
        for name, unit in units.items():
            if unit:
                data[name].attrs["units"] = unit
        data.attrs.update(origin_of(self))
        return data

    def _table(self, name: str | None) -> Columns:
        tables = self.tables()
        return tables[next(iter(tables)) if name is None else one_of(name, "table", tables)]


def write(result: Result, folder: str | Path, svg: bool = False, *, progress: Progress | None = None) -> list[Path]:
    """Write the figures (PNG, with ``svg`` also SVG) and the tables (CSV) of a result into a folder; return the paths.

    Every file begins with, or contains, the result's origin. Other files in the folder stay unchanged. Raises
    SceneError for what is no result, and OutputError if a file cannot be written.
    """
    if not isinstance(result, Result):
        raise SceneError(f"write takes the result of a study, such as compare or cost, not {shown(result)}.")
    place, tell, origin, pictures = output_folder(folder), told_by(progress), origin_of(result), result.pictures()
    paths: list[Path] = []
    for i, (name, kind) in enumerate(pictures.items()):
        tell(i / len(pictures), f"drawing {name}")
        figure = import_module(ROOM).figure_of(result, kind)
        facts = {**origin, "Title": name} if result.titled else origin
        paths += import_module(STYLE).save_all(figure, place / name, facts, svg or result.titled)
    for name, table in result.tables().items():
        paths.append(place / f"{name}.csv")
        write_csv(paths[-1], tuple(table), zip(*(one.values for one in table.values()), strict=True), origin)
    tell(1.0, "written")
    return paths


def _cells(column: Column) -> list[Any]:
    """Return the values of a column, with its empty cells, None or "", alike: nan in a column with a number or without
    any value, "" beside texts, else None.
    """
    values = [_plain(value) for value in _plain(column.values)]
    there = [value for value in values if not _is_empty(value)]
    numbers = any(isinstance(value, (int, float)) and not isinstance(value, bool) for value in there)
    texts = any(isinstance(value, str) for value in there or values)
    empty = math.nan if numbers or not (there or texts) else "" if texts else None
    return [empty if _is_empty(value) else value for value in values]


def _short(value: Any) -> str:
    """Return a cell of a table as short text, "-" for a missing one."""
    missing = _is_empty(value) or value != value  # nan
    return "-" if missing else f"{value:.4g}" if isinstance(value, float) else str(value)


def _is_empty(value: Any) -> bool:
    return value is None or (isinstance(value, str) and not value)


def _plain(values: Any) -> Any:
    """Return an array or a number of NumPy as Python's lists and numbers; others as they are."""
    return values.tolist() if hasattr(values, "tolist") else values


def _json(value: Any) -> Any:
    value = _plain(value)
    if isinstance(value, (list, tuple)):
        return [_json(part) for part in value]
    if isinstance(value, Mapping):
        return {str(name): _json(part) for name, part in value.items()}
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else str(value)
    return value if value is None or isinstance(value, (bool, int, float)) else str(value)


def _library(name: str) -> Any:
    try:
        return import_module(name)
    except ImportError:
        raise SceneError(f'This needs {name}, which is not installed: pip install "lab-pendulum[{name}]".') from None
