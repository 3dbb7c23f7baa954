"""The command ``lab-pendulum acquire``: a sensor live, in a page of the browser or without one."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import Field
from inspect import Parameter, cleandoc
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Annotated, Any

from pendulum_env.bench.source import Source, settings_of
from pendulum_env.bench.sources import SOURCES, source_at
from pendulum_env.cli import options
from pendulum_env.cli.console import print_text, printable, terminal_width

if TYPE_CHECKING:
    from pendulum_env.bench.acquisition import Acquisition
    from pendulum_env.bench.running import Run

FILE = Path("swing.csv")
"""File of a run, if none is given; numbered if it exists."""
EVERY = 0.2
"""Time between two progress lines [s]."""
HELP = 78
"""Width of the list of sources in the help [characters]."""
OWN = ("scene", "integrator")
"""Settings of sources that are options of the command itself."""


def acquire(
    source: Annotated[str, options.option("Source, as virtual, replay:FILE or udp:PORT, from the list above.", "--from")
                      ] = "virtual",
    headless: Annotated[bool, options.flag("Record without a page, to the end of the source or Ctrl-C.", "--headless")
                        ] = False,
    duration: Annotated[float | None, options.number("Length of the run in s, with --headless.")] = None,
    out: Annotated[Path | None, options.option(f"File of the run; by default {FILE}, numbered if it exists.",
                                               "--out", "-o")] = None,
    force: Annotated[bool, options.flag("Replace the file if it exists.", "--force")] = False,
    zero: Annotated[bool, options.flag("Take the reading before the run as 0, for a bob that hangs at rest.",
                                       "--zero")] = False,
    reverse: Annotated[bool, options.flag("Reverse the direction of angles.", "--reverse")] = False,
    scene: Annotated[str | None, options.option("Scene of the virtual source, and of the simulation beside the swing: "
                                                "a preset or a scene's JSON file; by default lab.")] = None,
    integrators: options.IntegratorsOrNone = None,
    browser: options.Browser = True,
    **settings: Any,
) -> None:
    """Record a sensor, live: a page in the browser, or --headless. Samples are written to a file as they come.

    \b
    {sources}

    Options of one source alone are marked with its name. Angles on the command line are in degrees. The file is one
    that lab-pendulum fit reads, also while the run goes on or after it was cut off.
    """
    from pendulum_env.bench.journal import check_new, numbered
    from pendulum_env.bench.source import SourceError
    from pendulum_env.physics.units import number

    kind = SOURCES.get(source.partition(":")[0].strip().lower())
    given = {name: value for name, value in settings.items() if value is not None}
    integrator = None if integrators is None else options.one_method(integrators)
    own = {"scene": scene, "integrator": integrator}
    for name, value in own.items():
        if value is not None and kind is not None and (headless or name in settings_of(kind)):
            given[name] = value
    found = source_at(source, _converted(kind, given) if kind is not None else {})
    if not headless:
        for name, unwanted in (("duration", duration is not None), ("zero", zero), ("reverse", reverse)):
            if unwanted:
                raise SourceError(f"--{name} is for --headless; the page has buttons for it")
    place = out if out is not None else next(path for path in numbered(FILE) if not path.exists()) if headless else FILE
    if out is not None:
        check_new(place, force)
    if headless:
        span = None if duration is None else number(duration, "duration", above=0.0, unit="s")
        _headless(found, place, span, force, -1 if reverse else 1, zero)
        return
    from pendulum_env.bench.page import serve

    serve(found, out=place, force=force, scene=scene or "lab", integrator=integrator or "rk4", open_browser=browser)


def _headless(source: Source, path: Path, duration: float | None, force: bool, sign: int, zero: bool) -> None:
    """Record a run, with a line of progress on a terminal, and say what came."""
    from time import monotonic

    from pendulum_env.bench.running import in_short, record
    from pendulum_env.bench.source import SourceError

    line = sys.stderr.isatty()
    room, last = terminal_width() - 1, 0.0

    def tell(acquisition: Acquisition) -> None:
        nonlocal last
        if line and monotonic() - last >= EVERY:
            last = monotonic()
            text = printable(in_short(acquisition), sys.stderr.encoding)[:room]
            print(f"\r{text:{room}}", end="", file=sys.stderr, flush=True)

    try:
        run = record(source, path, duration=duration, force=force, sign=sign, zero=zero, tell=tell)
    finally:
        if line:
            print(f"\r{'':{room}}\r", end="", file=sys.stderr, flush=True)
    _said(run)
    if run.problem:
        raise SourceError(f"the run ended early: {run.problem}")


def _said(run: Run) -> None:
    """Print the file, counts and notes of a run."""
    status = run.status
    count = f"{status.samples} samples in {status.time:.4g} s, {status.lost or 'none'} lost"
    print_text(f"Wrote {run.path}: {count}.")
    for note in run.notes:
        print_text(f"  {note}", further="      ")
    if status.samples >= 3:
        print_text(f"lab-pendulum fit {run.path} fits it.")


def _converted(kind: type[Source], given: Mapping[str, Any]) -> dict[str, object]:
    """Return the values of options in the types of a source's settings; others stay, and are refused by the source."""
    fields = settings_of(kind)
    return {name: options.value_of(name, fields[name], value) if name in fields else value
            for name, value in given.items()}


def _by_option() -> dict[str, list[tuple[type[Source], Field[Any]]]]:
    """Return the settings of all sources by the names of their options, in the order of the sources."""
    found: dict[str, list[tuple[type[Source], Field[Any]]]] = {}
    for kind in SOURCES.values():
        for name, entry in settings_of(kind).items():
            if name not in OWN:
                found.setdefault(name, []).append((kind, entry))
    return found


def _option(name: str, entries: list[tuple[type[Source], Field[Any]]]) -> Parameter:
    """Return the option of a setting that one source or several have, as a parameter of the command."""
    texts: dict[str, list[str]] = {}
    for kind, entry in entries:
        texts.setdefault(options.about(entry), []).append(kind.name)
    text = " ".join(f"{', '.join(names)}: {about}." for about, names in texts.items())
    return options.of_setting(name, entries[0][1], text)


def _sources() -> str:
    """Return the list of sources for the help, one in each line."""
    room = max(len(kind.form()) for kind in SOURCES.values()) + 2
    return "\n".join(fill(f"{kind.form():{room}}{kind.about}", HELP, subsequent_indent=room * " ",
                          break_on_hyphens=False) for kind in SOURCES.values())


def _complete() -> None:
    """Give the command an option for each setting of a source, and its help the list of sources."""
    acquire.__doc__ = cleandoc(acquire.__doc__ or "").replace("{sources}", _sources())
    options.complete(acquire, [_option(name, entries) for name, entries in _by_option().items()])


_complete()
