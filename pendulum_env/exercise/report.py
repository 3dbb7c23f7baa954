"""The report as one HTML file that needs nothing else, its figures as PNG and SVG, and its numbers as CSV."""

from __future__ import annotations

import math
import re
import shutil
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial
from itertools import count, pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from pendulum_env.common.mathml import mathml
from pendulum_env.common.progress import Progress, told_by, with_bar
from pendulum_env.common.provenance import output_folder, provenance, write_csv
from pendulum_env.common.replacing import replacing
from pendulum_env.exercise.answers import Answers, earlier
from pendulum_env.exercise.figures import STRIPS, SWINGS, USUAL_SWINGS, WIDEST, WIDTH, cuts, figures_of
from pendulum_env.exercise.language import ENGLISH, TEXTS, Language, language_of
from pendulum_env.exercise.programs import data_tables, program_names, programs
from pendulum_env.exercise.values import digits, fixed, values, with_error
from pendulum_env.exercise.worked import Worked
from pendulum_env.lab.measures import percent
from pendulum_env.physics.units import SceneError, line
from pendulum_env.plots.style import laid_out, save_all

if TYPE_CHECKING:
    from jinja2 import Environment

REPORT = "report.html"
"""Name of the report's file."""
DROPPED = re.compile(r"<\?xml.*?\?>|<!DOCTYPE.*?>|<metadata>.*?</metadata>", re.S)
"""Parts of an SVG file that have no place inside a page."""
IDENTIFIER = re.compile(r'(\bid="|href="#|url\(#)')
"""What stands before a name that is unique in one SVG, but not in a page with several."""


@dataclass(frozen=True)
class Drawing:
    """A figure in the page: its number, and its SVG element as text."""

    number: int
    svg: Any


def need_jinja() -> None:
    """Raise SceneError with a sentence on how to install jinja2, if it is missing."""
    try:
        import jinja2  # noqa: F401
    except ImportError:
        missing = "The report is made by jinja2, which is missing: pip install 'lab-pendulum[exercise]'."
        raise SceneError(missing) from None


@with_bar("report")
def write(
    worked: Worked, folder: str | Path, *, name: str = "", key: bool = False, language: str = ENGLISH,
    progress: Progress | bool | None = None,
) -> list[Path]:
    """Write the report of a worked exercise, and return the paths of the files.

    ``report.html`` is complete in itself; every figure is also written as PNG and SVG, the numbers as ``numbers.csv``
    and the curves as ``small_angles.csv``, ``large_angle.csv``, ``damped.csv`` and ``recording.csv``, or
    ``amplitudes.csv`` of readings by hand. The programs behind the figures, ``part_1_2.py`` and so on, run alone;
    :mod:`pendulum_env.exercise.programs` writes them.
    Everything is made in a temporary folder first, so that an error or Ctrl-C leaves earlier files unchanged. What a
    student typed into an earlier ``report.html`` of the folder, and saved, is in the new one, too.

    Args:
        worked: the exercise worked out.
        folder: folder for the files.
        name: the student's name, printed at the top and on every page.
        key: True fills every blank with the answer; without it no answer is in the file.
        language: code of the language of the report and its figures, "en" or "de"; tables and the comments of programs
            are in English.
        progress: True shows a progress bar, False none; by default a notebook shows one for work over 1.5 s. A
            function is called with the fraction done and the present activity.

    Raises SceneError if jinja2 is missing, for an unknown language, if the name is not one line, or if the folder's
    report has answers that the key would lose, or that are another student's; OutputError if the folder cannot be
    written.
    """
    need_jinja()
    owner, texts = named(name), language_of(language)
    tell, place = told_by(progress), output_folder(folder)
    kept = earlier(place / REPORT, owner, key)
    source = worked.given.recording.source + (" (simulated)" if worked.given.simulated else "")
    facts = provenance(scene="exercise", method=list(worked.small.runs), dt=worked.small.forward.dt,
                       omega=worked.given.omega.value.value, recording=source)
    with TemporaryDirectory() as temporary:
        made = Path(temporary)
        paths = [made / REPORT, *tables(worked, key, made, facts)]
        drawn = figures_of(worked)
        figures: dict[str, Drawing] = {}
        for i, draw in enumerate(drawn):
            tell(i / len(drawn), f"drawing {draw.__name__.replace('_', ' ')}")
            figure = texts.localised(draw(worked, texts.figures))
            with laid_out(figure):
                paths += save_all(figure, made / draw.__name__, {**facts, "Title": draw.__name__})
                edges = cuts(figure)
            svg = paths[-1].read_text(encoding="utf-8")
            title = f"{texts.say('figure')} {i + 1}"
            figures[draw.__name__] = Drawing(i + 1, inlined(svg, draw.__name__, title, edges))
        for file, text in programs(worked, texts.figures, environment(texts)):
            paths.append(made / file)
            paths[-1].write_text(text, encoding="utf-8")
        tell(1.0, "writing the report")
        paths[0].write_text(page(worked, figures, owner, key, facts, kept, language), encoding="utf-8")
        return [moved(path, place / path.name) for path in paths]


def named(name: str) -> str:
    """Return the student's name, or "" for none; raises SceneError unless it is one line of text."""
    return line(name, "--name") if name != "" else ""


def moved(made: Path, target: Path) -> Path:
    """Copy a finished file to its place, whole or not at all; return the place."""
    with replacing(target) as part:
        shutil.copyfile(made, part)
    return target


# --- the page -------------------------------------------------------------------------------------------------------


def page(
    worked: Worked, figures: dict[str, Drawing], name: str, key: bool, facts: dict[str, str],
    answers: Answers | None = None, language: str = ENGLISH,
) -> str:
    """Return the report's HTML, with what was typed into an earlier report in its blanks."""
    numbers, sections, kept = count(1), count(1), Answers() if answers is None else answers
    template = environment(language_of(language)).get_template(f"{REPORT}.j2")
    return template.render(
        worked=worked, figures=figures, name=name, key=key, kept=kept, facts=facts, language=language,
        next_question=lambda: next(numbers), next_section=lambda: next(sections), sqrt=math.sqrt, exp=math.exp,
        log=math.log, sin=math.sin, atan=math.atan, pi=math.pi, programs=program_names(worked),
        whole_swings=STRIPS * SWINGS, strip_swings=USUAL_SWINGS, widest_energy=WIDEST**2,
    )


@cache
def environment(language: Language) -> Environment:
    """Return the environment in which the templates are rendered, with a language's sentences and filters for numbers
    and equations."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup, escape

    def text_of(source: Any) -> str:
        return str(source.unescape() if isinstance(source, Markup) else source)

    found = Environment(loader=FileSystemLoader(TEXTS), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
                        lstrip_blocks=True, finalize=language.shown)
    found.globals["say"] = language.say
    found.filters |= {
        "n": lambda *number: language.numeral(digits(*number)),
        "deg": math.degrees,
        "median": lambda values: float(np.median(values)),
        "f": lambda *number: language.numeral(fixed(*number)),
        "short": lambda number: language.numeral(f"{number:g}"),
        "with_error": lambda *measured: language.numeral(with_error(*measured)),
        "percent": lambda share: language.numeral(percent(share)),
        "m": lambda source: Markup(mathml(text_of(source))),
        "equations": lambda source: Markup(mathml(text_of(source), block=True)),
        "css": lambda source: Markup(escape(css_text(source))),
    }
    return found


def css_text(text: str) -> str:
    """Return a text as it stands between quotation marks in CSS, with every unusual character as an escape."""
    return "".join(letter if letter.isalnum() or letter in " .,-" else f"\\{ord(letter):x} " for letter in text)


def inlined(svg: str, name: str, title: str, cuts: Sequence[float] = ()) -> Any:
    """Return an SVG file's element for a page: as wide as the text, with a title for screen readers, and with names of
    its own that begin with ``name``.

    With ``cuts``, shares of its height, it is in parts one below the other, between which a page may end: the first
    holds the drawing, the others show it again, each through a window of its own."""
    from markupsafe import Markup

    bare = DROPPED.sub("", svg).strip()
    points, height = (float(x) for x in re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)', bare).groups())  # type: ignore[union-attr]
    share = 100.0 * points / (72.0 * WIDTH)
    own = IDENTIFIER.sub(lambda found: f"{found[1]}{name}-", bare)
    spaces = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
    edges = [0.0, *(round(height * cut, 2) for cut in cuts), height]
    head, *others = (f'<svg viewBox="0 {top} {points} {round(low - top, 2)}" style="width: {share:.0f}%"'
                     for top, low in pairwise(edges))
    whole = f'{head} role="img" aria-label="{title}" {spaces}><g id="{name}-drawing">'
    first = re.sub(r"<svg [^>]*>", whole, own, count=1).removesuffix("</svg>") + "</g></svg>"
    return Markup("\n".join([first, *(f'{other} aria-hidden="true"><use href="#{name}-drawing"/></svg>'
                                      for other in others)]))


# --- the tables -----------------------------------------------------------------------------------------------------


def tables(worked: Worked, key: bool, folder: Path, facts: dict[str, str]) -> Iterator[Path]:
    """Write the CSV files into a folder, and yield their paths; predicted numbers are written only with the key."""
    small, compared, by_hand = worked.small.runs, worked.recorded.compared, worked.recorded.by_hand
    save = partial(csv_file, folder, facts)
    yield save("numbers.csv", ("part", "quantity", "value", "error", "unit"),
               [row[:-1] for row in values(worked) if key or not row.answer])
    first = next(iter(small.values()))
    yield save("small_angles.csv",
               ("time_s", *(f"{name}_{what}" for name in small for what in ("angle_rad", "velocity_rad_s", "energy"))),
               columns(first.time, *(x for run in small.values() for x in (run.angle, run.velocity, run.energy))))
    for name, run in (("large_angle.csv", worked.large.run), ("damped.csv", worked.recorded.damped)):
        yield save(name, ("time_s", "angle_rad", "velocity_rad_s", "energy"),
                   columns(run.time, run.angle, run.velocity, run.energy))
    if by_hand is None:
        yield save("recording.csv", ("time_s", "recorded_rad", "simulated_rad"),
                   columns(compared.time, compared.recorded, compared.simulated))
    else:
        yield save("amplitudes.csv", ("time_s", "read_rad", "error_rad", "simulated_rad"),
                   columns(by_hand.time, np.abs(by_hand.angle), by_hand.error, by_hand.simulated))
    for name, titles, series in data_tables(worked):
        yield save(name, titles, columns(*series))


def csv_file(folder: Path, facts: dict[str, str], name: str, head: tuple[str, ...], rows: Iterable[Any]) -> Path:
    """Write one CSV file with its origin, and return its path."""
    write_csv(folder / name, head, rows, facts)
    return folder / name


def columns(*arrays: Any) -> Iterator[tuple[float, ...]]:
    """Return the rows of a table whose columns are the given arrays."""
    return zip(*(np.asarray(array).tolist() for array in arrays), strict=True)
