"""Names that must stay: methods, scenes, effects and tasks, and the methods that have truths of the literature."""

from __future__ import annotations

import json
from pathlib import Path

ENTRIES = Path(__file__).resolve().parents[1] / "entries.json"


def stored(kind: str) -> tuple[str, ...]:
    """Return the names of one kind in entries.json, which ``regenerate.py`` adds to and never takes from."""
    return tuple(json.loads(ENTRIES.read_text(encoding="utf-8"))[kind])
