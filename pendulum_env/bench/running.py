"""One run of a source from its start to its end: :func:`acquire`, and :func:`record`, which writes its file."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from pendulum_env.bench.acquisition import Acquisition, Status
from pendulum_env.bench.journal import check_new
from pendulum_env.bench.source import Source, SourceError, name_and_unit
from pendulum_env.bench.sources import source_at
from pendulum_env.common.checks import boolean, file_path, number, shown, warn
from pendulum_env.common.progress import Progress, telling_of

if TYPE_CHECKING:
    from pendulum_env.lab.recording import Recording

SILENT = 10.0
"""Time without a sample after which a source counts as silent [s]."""
TURN = 0.1
"""Longest time for which samples are waited for at once [s]."""


@dataclass(frozen=True)
class Run:
    """A run that has ended.

    Attributes:
        path: its file, which holds all samples that came.
        status: its counts.
        notes: what was inferred of the source, its clock, and losses.
        columns: titles of the readings.
        problem: why it ended early, "" if it did not.
    """

    path: Path
    status: Status
    notes: tuple[str, ...]
    columns: tuple[str, ...]
    problem: str = ""


def record(
    source: Source, path: Path, *, duration: float | None = None, force: bool = False, sign: int = 1,
    zero: bool = False, tell: Callable[[Acquisition], object] | None = None,
) -> Run:
    """Record a run of a source to a file until its duration [s] is over, the source ends, or Ctrl-C.

    A run that ends early, because the source or the disk is lost, keeps what came, and the result names the reason.
    Arguments are those of :func:`acquire`; ``tell`` is called with the acquisition about ten times a second.

    Raises SourceError if the file exists already, if the source cannot be opened, and if no sample comes.
    """
    check_new(path, force)
    acquisition, problem = Acquisition(source, sign=sign), ""
    acquisition.open()
    try:
        try:
            if zero:
                _await(acquisition, lambda status: math.isfinite(status.reading), tell)
                acquisition.set_zero()
            acquisition.start(path, force=force, duration=math.inf if duration is None else duration)
            _await(acquisition, lambda status: status.samples > 0, tell)
            _follow(acquisition, duration, tell)
        except KeyboardInterrupt:
            pass  # what came is kept
        except SourceError as error:
            problem = str(error)
        except FileExistsError:
            raise SourceError(f"{path} exists already; choose another name, or replace it by --force") from None
        except OSError as error:
            problem = f"{path} cannot be written further: {error.strerror or error}"
    finally:
        status, notes, columns = acquisition.status, acquisition.notes, source.columns
        try:
            acquisition.close()
        except OSError as error:  # of the last notes, on a full disk
            problem = problem or f"{path} cannot be written further: {error.strerror or error}"
    if not status.samples:
        if path.exists() and not force:
            path.unlink()
        raise SourceError(problem or f"{source.name} ended before a sample came")
    return Run(path, status, notes, columns, problem)


def _await(
    acquisition: Acquisition, come: Callable[[Status], bool], tell: Callable[[Acquisition], object] | None
) -> None:
    """Take samples until the first has come; SourceError if there is none for so long that none will come."""
    until = time.monotonic() + SILENT
    while not come(acquisition.status) and acquisition.poll(TURN):
        if tell is not None:
            tell(acquisition)
        if time.monotonic() > until and not come(acquisition.status):
            source = acquisition.source
            why = source.problem or "check that it is switched on and sends"
            raise SourceError(f"no sample came from {source.name} in {SILENT:g} s; {why}")


def _follow(
    acquisition: Acquisition, duration: float | None, tell: Callable[[Acquisition], object] | None
) -> None:
    """Take samples until the run has its duration [s] or the source ends; SourceError if it falls silent for good."""
    began = last = time.monotonic()
    while not acquisition.status.full:
        before = acquisition.status.samples
        if not acquisition.poll(TURN):
            return
        if tell is not None:
            tell(acquisition)
        now = time.monotonic()
        last = now if acquisition.status.samples > before else last
        if duration is not None and now - last > SILENT and now - began > duration:
            raise SourceError(f"{acquisition.source.name} fell silent {now - last:.0f} s ago")


def acquire(
    source: str | Source = "virtual", duration: float | None = None, *, out: Any = None, force: bool = False,
    sign: int = 1, zero: bool = False, progress: Progress | bool | None = None, **options: Any,
) -> Recording:
    """Record a run of a sensor and return its :class:`pendulum_env.Recording`.

    Without a duration, and at any time before, Ctrl-C (in a notebook, Interrupt) ends the run, and what came is
    returned. A run that ends early for another reason, such as a cable that was pulled, returns what came, with a
    warning.

    Args:
        source: address of a source, such as "virtual", "serial:/dev/ttyUSB0" or "udp:5005"; see
            :data:`pendulum_env.bench.SOURCES`. Or a source of your own.
        duration: length of the run on the source's clock [s]; None: to the end of the source.
        out: file to which samples are written as they come, and which stays; None: no file stays.
        force: True replaces ``out`` if it exists, with the first sample.
        sign: 1, or -1 to reverse the direction.
        zero: True takes the reading before the run as 0, for a bob that hangs at rest.
        progress: as for other long calls: True shows a bar, False none; None shows one in a notebook.
        **options: settings of the source, by the names of its options: ``acquire("virtual", 10, noise=0.0)``.

    Raises SourceError for an unknown source or setting, a file that exists, a source that cannot be opened, and if no
    sample comes; RecordingError for fewer than 3 samples.
    """
    from pendulum_env.lab.recording import Recording

    span = None if duration is None else number(duration, "duration", above=0.0, unit="s")
    if isinstance(source, Source):
        if options:
            raise SourceError(f"settings are given to the source itself, not beside it: {', '.join(options)}")
    elif isinstance(source, str):
        source = source_at(source, options)
    else:
        raise SourceError(f"source must be an address such as 'udp:5005', or a Source, not {shown(source)}")
    if not isinstance(sign, int) or isinstance(sign, bool) or sign not in (1, -1):
        raise SourceError(f"sign must be 1 or -1, not {shown(sign)}")
    boolean(force, "force")
    boolean(zero, "zero")
    path = None if out is None else file_path(out, "out")

    def recorded(place: Path) -> Recording:
        with telling_of(progress, "acquire") as show:
            def tell(acquisition: Acquisition) -> None:
                show(0.0 if span is None else min(acquisition.status.time / span, 1.0), in_short(acquisition))

            run = record(source, place, duration=span, force=force, sign=sign, zero=zero, tell=tell)
        if run.problem:
            warn(f"The run ended early: {run.problem}.")
        return Recording.read(place)

    if path is not None:
        return recorded(path)
    with TemporaryDirectory() as folder:
        return recorded(Path(folder) / f"{source.name}.csv")


def in_short(acquisition: Acquisition) -> str:
    """Return the counts, the rate, the reading and the losses of a run in a few words."""
    status = acquisition.status
    name, unit = name_and_unit(acquisition.source.columns[0])
    unit = {"deg": "°", "rad": " rad"}.get(unit, f" {unit}" if unit else "")
    rate = f"{status.rate:.4g} per s" if math.isfinite(status.rate) else "no rate yet"
    reading = f"{name.lower()} {status.reading:+.2f}{unit}" if math.isfinite(status.reading) else ""
    parts = (f"{status.time:.1f} s", f"{status.samples} samples", rate, reading, f"{status.lost} lost")
    return ", ".join(filter(None, parts))
