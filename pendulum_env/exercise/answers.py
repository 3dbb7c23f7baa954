"""What a student typed into a report: read from its file, so that a later report in the same place keeps it."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from uuid import uuid4

from pendulum_env.physics.units import SceneError

NAME = "name"
"""Name of the blank for the student's name."""
NEW_LINES = ("br", "div", "p", "li")
"""Elements in which browsers put a new line of typed text."""
EMPTY = ("br", "hr", "img", "input", "wbr")
"""Elements without an end tag."""

FIGURE = re.compile("<svg.*?</svg>", re.S)
"""A figure, in which nothing can be typed; figures are 98 % of a page."""


@dataclass(frozen=True)
class Answers:
    """The texts typed into a report.

    Attributes:
        report: identity of the report, under which the student's browser keeps what was typed.
        saved: time at which the page was saved [ms since 1970], as text; "" if it never was.
        texts: typed text of every blank that has one, by the blank's name: a question's number, "name" or "date".
    """

    report: str = field(default_factory=lambda: uuid4().hex)
    saved: str = ""
    texts: dict[str, str] = field(default_factory=dict)

    @property
    def number(self) -> int:
        """Number of questions that have an answer."""
        return sum(name.isdigit() for name in self.texts)


class _Typed(HTMLParser):
    """Collects the identity of a report, the time of saving and the typed texts."""

    def __init__(self) -> None:
        super().__init__()
        self.report, self.saved, self.texts = "", "", dict[str, str]()
        self.blank, self.depth = "", 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        if tag == "html":
            self.report, self.saved = given.get("data-report", ""), given.get("data-saved", "")
        elif self.blank:
            self.depth += tag not in EMPTY
            if tag in NEW_LINES and self.texts[self.blank]:
                self.texts[self.blank] += "\n"
        elif given.get("data-answer"):
            self.blank, self.depth = given["data-answer"], 1
            self.texts[self.blank] = ""

    def handle_endtag(self, tag: str) -> None:
        if self.blank and tag not in EMPTY:
            self.depth -= 1
            self.blank = self.blank if self.depth else ""

    def handle_data(self, data: str) -> None:
        if self.blank:
            self.texts[self.blank] += data


def earlier(file: Path, name: str = "", key: bool = False) -> Answers:
    """Return what was typed into the report that a new one replaces; new answers if the file holds none.

    ``name``: the student's name, or "" if it is not given again; ``key``: True if the new report is the teacher's key.

    Raises SceneError for a report with answers that the new one would lose or give to another student.
    """
    try:
        text = file.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return Answers()
    typed = _Typed()
    typed.feed(FIGURE.sub("", text))
    if not typed.report:
        return Answers()
    texts = {at: text for at, words in typed.texts.items() if (text := words.strip())}
    found = Answers(typed.report, typed.saved, texts)
    owner = found.texts.get(NAME, "")
    another = name not in ("", owner) and owner != ""
    if found.number and (key or another):
        whose = f" of {owner}" if owner else ""
        why = "the teacher's key has no room for them" if key else f"this report is {name}'s"
        raise SceneError(f"{file} holds {found.number} answers{whose}, and {why}; choose another folder with --out.")
    return Answers() if another else found
