"""The words of the report and of the page in each language: one file a language, ``words/en.json`` and so on."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

WORDS = Path(__file__).with_name("words")
"""Folder of the languages' files: the decimal sign, the report's labels and sentences, and the page from English."""


def tables() -> dict[str, dict[str, Any]]:
    """Return every language's words, by the language's code, such as "de"; the page's own words are English."""
    return {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in sorted(WORDS.glob("*.json"))}
