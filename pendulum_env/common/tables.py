"""Tables of text that can be written as Markdown and CSV."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass

from pendulum_env.common.texts import for_csv, for_markdown


@dataclass(frozen=True)
class Table:
    """A table of text: the heads of its columns, and its rows."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def markdown(self) -> str:
        """Return the table as Markdown."""
        lines = [self.head, tuple("---" for _ in self.head), *self.rows]
        return "\n".join(f"| {' | '.join(map(for_markdown, line))} |" for line in lines)

    def csv(self) -> str:
        """Return the table as CSV text; every line ends with a newline."""
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows([map(for_csv, line) for line in (self.head, *self.rows)])
        return text.getvalue()
