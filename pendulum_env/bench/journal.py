"""Journals: text files of samples, written as they come and readable at any time by ``Recording.read``."""

from __future__ import annotations

from pathlib import Path

from pendulum_env.bench.source import FloatArray, Source
from pendulum_env.common.provenance import provenance


class Journal:
    """A text file of one run: comments, a line of titles, then one line for each sample, flushed at least each second.
    """

    def __init__(self, path: Path, source: Source, *, force: bool = False) -> None:
        self.path = path
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = path.open("w" if force else "x", encoding="utf-8", newline="\n")
        facts = provenance(source=repr(source))
        comments = [f"# {name}: {' '.join(str(fact).split())}" for name, fact in facts.items()]
        self._file.write("\n".join([*comments, "\t".join(("Time (s)", *source.columns)), ""]))
        self._file.flush()

    def write(self, time: FloatArray, values: FloatArray) -> None:
        """Append samples: times [s], shape ``(samples,)``, and readings, shape ``(samples, columns)``."""
        rows = zip(time.tolist(), values.tolist(), strict=True)
        self._file.write("".join(f"{t:.6f}\t" + "\t".join(f"{v:.10g}" for v in row) + "\n" for t, row in rows))
        self._file.flush()

    def close(self) -> None:
        """Close the file; closing twice is allowed."""
        self._file.close()
