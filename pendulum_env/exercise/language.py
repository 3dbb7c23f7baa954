"""The languages of the report: the texts of each, and the form of its numbers.

A table holds the sign between a number's whole part and its decimals, the labels of the figures, and the sentences of
the report. In a sentence ``{name}`` is a value that the report sets in, and an equation stands between dollar signs, as
:mod:`pendulum_env.common.mathml` reads it. A file beside the others, with the same names, is another language.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure
from matplotlib.text import Text

from pendulum_env.common.checks import one_of
from pendulum_env.common.languages import WORDS, tables
from pendulum_env.common.mathml import mathml
from pendulum_env.lab.measures import Measurement
from pendulum_env.plots.style import Rewritten, plain

if TYPE_CHECKING:
    from markupsafe import Markup

TEXTS = Path(__file__).with_name("texts")
"""Folder of the report's templates, and of those of the programs."""
LANGUAGES = tuple(tables())
"""Codes of the languages that have a file."""
ENGLISH = "en"
"""Language of a report for which none is chosen."""
POINT = re.compile(r"(?<=\d)\.(?=\d)")
"""Point between the digits of a number."""
ENDS = re.compile(r"(<math>(?:(?!</math>).)*</math>[.,;:)]+)")
"""An equation and the signs behind it, which stay on its line."""
VALUE = re.compile(r"\{(\w+)\}")
"""Place of a value in a sentence."""


@dataclass(frozen=True, eq=False)
class Language:
    """The texts of one language.

    Attributes:
        code: code of the language, such as "en", as HTML names it.
        decimal: sign between the whole part of a number and its decimals.
        figures: labels in figures, by name.
        report: sentences of the report, by name.
    """

    code: str
    decimal: str
    figures: Mapping[str, str]
    report: Mapping[str, str]

    def numeral(self, text: str) -> str:
        """Return a number's text, such as ``1.50 ± 0.02 s``, with the language's decimal sign; within Matplotlib's
        formulas in braces, because a comma has a space there."""
        return POINT.sub(f"{{{self.decimal}}}" if text.startswith("$") else self.decimal, text)

    def shown(self, value: Any) -> Any:
        """Return a measurement or a number as it stands in the report; other values as they are."""
        if isinstance(value, Measurement):
            return self.numeral(str(value).removesuffix(" 1"))
        return self.numeral(str(value)) if isinstance(value, float) else value

    def say(self, name: str, /, **values: Any) -> Markup:
        """Return a sentence as HTML, with its values and equations; KeyError if it or a value of it is missing."""
        from markupsafe import Markup, escape

        parts = self.report[name].split("$")
        for k in range(len(parts)):
            parts[k] = mathml(parts[k]) if k % 2 else VALUE.sub(
                lambda found: str(escape(self.shown(values[found[1]]))), parts[k])
        return Markup(ENDS.sub(r'<span class="whole">\1</span>', "".join(parts)))

    def localised(self, drawing: Figure) -> Figure:
        """Return a figure whose numbers have the language's decimal sign, those of its axes, too."""
        if self.decimal != ".":
            for text in drawing.findobj(Text):
                text.set_text(self.numeral(text.get_text()))
            for at in drawing.axes:
                for axis in (at.xaxis, at.yaxis):
                    usual = axis.get_major_formatter()
                    axis.set_major_formatter(Rewritten(usual, lambda label: self.numeral(plain(label))))
        return drawing


def language_of(code: str) -> Language:
    """Return the texts of a language by its code; SceneError that lists the languages if there is no such one."""
    one_of(code, "language of the report", LANGUAGES)
    return _read(WORDS / f"{code}.json")


@cache
def _read(path: Path) -> Language:
    """Return the texts of a file, one object for all who ask, for which its templates are compiled once."""
    table = json.loads(path.read_text(encoding="utf-8"))
    return Language(path.stem, table["decimal"], table["figures"], table["report"])
