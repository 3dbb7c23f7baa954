"""The class :class:`Study`: settings, points and what is computed at each; the rest is the same for all studies."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, field, fields, is_dataclass
from inspect import cleandoc
from pathlib import Path
from typing import Any, ClassVar

from pendulum_env.common.progress import Progress
from pendulum_env.common.provenance import provenance
from pendulum_env.common.results import one_line
from pendulum_env.common.saved import save
from pendulum_env.common.texts import Table
from pendulum_env.physics.units import Checked, SceneError, shown
from pendulum_env.study.sweep.study import ERROR, Point, Sweep, sweep
from pendulum_env.truth.reference import StudyError


class Study(Checked):
    """Base of a study: a frozen dataclass whose fields are its settings, with points and what is computed at each.

    A study of your own defines ``name``, ``columns``, :meth:`points` and :meth:`run`, and :meth:`draw` if it has a
    figure. Its fields come from ``si``, ``count``, ``choice``, ``flag`` or ``setting`` of
    :mod:`pendulum_env.physics.units`: default, unit and meaning are written once, for checks, messages and the options
    of its command (:func:`pendulum_env.cli.studies.run_command`). ``examples/20_your_own_study.py`` is a whole one.

    Calling a study runs it, and returns a :class:`StudyResult`.

    Attributes:
        name: name of the study's files and of its command.
        columns: name of each column of the result -> its unit, "" for texts, counts and pure numbers. First come the
            keys of a point, then those of what :meth:`run` returns.
    """

    name: ClassVar[str]
    columns: ClassVar[Mapping[str, str]]

    @classmethod
    def check(cls) -> None:
        """Raise SceneError for a class that lacks what a study needs, or has what cannot be, with the remedy."""
        lacks = [name for name in ("name", "columns") if not hasattr(cls, name)]
        lacks += [name for name in ("points", "run") if getattr(cls, name) is getattr(Study, name)]
        if lacks:
            raise SceneError(f"The study {cls.__name__} lacks {', '.join(lacks)}, which its class must define.")
        if not is_dataclass(cls):
            raise SceneError(f"The study {cls.__name__} must be a dataclass; write @dataclass(frozen=True) above it.")
        if not isinstance(cls.name, str) or not re.fullmatch(r"[A-Za-z0-9_-]{1,80}", cls.name):
            raise SceneError("The name of a study, which is that of its files, is made of letters, digits, - and _, "
                             f"not {shown(cls.name)}.")

    def points(self) -> Iterable[Mapping[str, Any]]:
        """Return the points of the study, dicts of numbers and texts without repetition, in the order of the rows."""
        raise NotImplementedError

    def run(self, point: Point) -> Mapping[str, Any]:
        """Return what is computed at a point: a dict of numbers and texts, with the keys that ``columns`` names."""
        raise NotImplementedError

    def work(self, point: Point) -> float:
        """Return an estimate of the work at a point, in any unit, from which the fraction done is computed."""
        return 1.0

    def draw(self, found: StudyResult) -> Any:
        """Return the figure of a result, such as one of ``pendulum_env.plots.figure``; SceneError if there is none.

        Numbers of points that failed are nan, see :meth:`StudyResult.column`.
        """
        raise SceneError(f"The study {self.name} has no figure; define its method draw.")

    @classmethod
    def has_figure(cls) -> bool:
        """Return True if the study draws a figure."""
        return cls.draw is not Study.draw

    def text(self, found: StudyResult) -> str:
        """Return a sentence or two on a result; "" by default."""
        return ""

    def __call__(
        self,
        executor: Executor | None = None,
        *,
        file: str | Path | None = None,
        anew: bool = False,
        on_error: str = "raise",
        progress: Progress | bool | None = None,
        on_row: Callable[[Point, Point], None] | None = None,
    ) -> StudyResult:
        """Run the study at all its points, and return the result.

        Args:
            executor, file, anew, on_error, progress, on_row: see :func:`pendulum_env.sweep`: an executor, a journal
                from which an interrupted study continues, what becomes of a point that fails, and the progress.

        The journal of other settings is refused; a change of the study's code is not noticed, so begin again then.
        KeyboardInterrupt ends the study early: the result has the points so far, and its ``complete`` is False.

        Raises SceneError for a class that is no study, and StudyError as :func:`pendulum_env.sweep` does, also where a
        point and its result have other columns than ``columns`` names.
        """
        self.check()
        settings = ", ".join(f"{entry.name}={getattr(self, entry.name)!r}"  # defaults, too, which may change
                             for entry in fields(self))  # type: ignore[arg-type]
        made = sweep([*self.points()], executor, run=self._run, name=f"{self.name}({settings})", file=file, anew=anew,
                     on_error=on_error, progress=progress, on_row=on_row, work=self.work)
        return StudyResult(made.points, made.results, made.shared, made.facts, made.complete, made.failed, study=self)

    def _run(self, point: Point) -> Mapping[str, Any]:
        result = self.run(point)
        given = [*point, *result] if isinstance(result, Mapping) else []
        if given and {*given} != {*self.columns}:
            raise SceneError(f"The study {self.name} has the columns {', '.join(self.columns)}, but a point and its "
                             f"result have {', '.join(given)}; they must agree.")
        return result


@dataclass(frozen=True, repr=False)
class StudyResult(Sweep):
    """Result of a :class:`Study`: a :class:`pendulum_env.Sweep` that knows its study, with units and a figure."""

    study: Study = field(kw_only=True)

    def __repr__(self) -> str:
        return one_line(self, f"{self.study!r}, {sum(1 for _ in self)} of {len(self.points)} points")

    @property
    def title(self) -> str:
        """First line of the study's docstring, without a full stop."""
        return cleandoc(type(self.study).__doc__ or self.study.name).partition("\n")[0].rstrip(".")

    @property
    def text(self) -> str:
        """What the study says of the result, and that it was interrupted, if it was."""
        stopped = "" if self.complete else f"Interrupted: {len(self.rows)} of {len(self.points)} points are done."
        return "\n".join(filter(None, (self._asked("text"), stopped)))

    def drawn(self) -> Any:
        """Return the study's figure of the result."""
        return self._asked("draw")

    def _asked(self, method: str) -> Any:
        """Return what a method of the study makes of the result; StudyError that names the method if it fails."""
        try:
            return getattr(self.study, method)(self)
        except (SceneError, AssertionError):
            raise
        except Exception as error:
            raise StudyError(f"The method {method} of the study {self.study.name} failed with {type(error).__name__}: "
                             f"{error}.") from error

    @property
    def table(self) -> Table:
        """Table of all finished points as text, with units in its heads and numbers to six digits."""
        made, units = super().table, self.units()
        return Table(tuple(f"{name} [{units[name]}]" if units.get(name) else name for name in made.head), made.rows)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns: those that the study declares, and "error" if a point failed."""
        return (*self.study.columns, *([ERROR] if self.failed else []))

    def column(self, name: str) -> list[Any]:
        """Return one column of all finished points as a list; nan for what a point that failed does not have.

        Raises StudyError for a name that is no column.
        """
        empty = None if name == ERROR else math.nan
        return [empty if value is None else value for value in super().column(name)]

    @property
    def stem(self) -> str:
        """Name of the study's files, without ending."""
        return self.study.name

    def units(self) -> Mapping[str, str]:
        """Return the unit of each column."""
        return self.study.columns

    def origin(self) -> Mapping[str, str]:
        """Return the settings of the study, the units of its columns, and what computed it."""
        settings = {entry.name: getattr(self.study, entry.name) for entry in fields(self.study)}  # type: ignore[arg-type]
        texts = {name: value if isinstance(value, str) else json.dumps(value, default=_as_data)
                 for name, value in settings.items()}
        return provenance(**{"Study": self.title, **texts, "Units": dict(self.units()), "Complete": self.complete})

    def save(self, path: str | Path) -> Path:
        """Write rows, units and settings of the study as a file; ``pendulum_env.load`` returns them as a Sweep.

        The class of a study of one's own is not kept. See :meth:`pendulum_env.common.saved.Savable.save`.
        """
        return save(Sweep(self.points, self.results, self.shared, self.origin(), self.complete, self.failed), path)



def _as_data(value: Any) -> Any:
    """Return a setting as data: a scene or another object with ``to_dict`` by that, any other by its repr."""
    return value.to_dict() if hasattr(value, "to_dict") else repr(value)
