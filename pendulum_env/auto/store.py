"""What was found before, kept in the cache folder as JSON: read with care, written whole, never needed."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import integrators
from pendulum_env import engine, physics, truth
from pendulum_env.common.replacing import replacing
from pendulum_env.common.trust import OWN, own_bytes, own_folder
from pendulum_env.engine.kernels import cache_folder

TABLE = "auto_costs.json"


@cache
def sources() -> str:
    """A digest of names, sizes and times of all files that a choice follows from."""
    rooms = [integrators, engine, physics, truth]
    folders = [Path(room.__file__).parent for room in rooms if room.__file__] + [Path(__file__).parent]
    found = []
    for folder in folders:
        for path in sorted(folder.rglob("*.py")):
            about = path.stat()
            found.append((path.name, about.st_size, about.st_mtime_ns))
    return hashlib.sha256(repr(found).encode()).hexdigest()[:24]


def file_of(key: Mapping[str, Any]) -> Path | None:
    """Where the answer to a question is kept; None if nowhere."""
    text = json.dumps(key, sort_keys=True)
    return _kept(f"auto_{hashlib.sha256(text.encode()).hexdigest()[:24]}.json")


def _kept(name: str) -> Path | None:
    try:
        return cache_folder() / name
    except OSError:
        return None


def load(path: Path | None, key: Mapping[str, Any]) -> Any:
    """The answer kept in a file, if it is to this question.

    None for a file that is not there, is damaged, or that somebody else could have written.
    """
    if path is None:
        return None
    try:
        found = json.loads(own_bytes(own_folder(path.parent) / path.name))
        return found["answer"] if found["question"] == json.loads(json.dumps(key)) else None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def save(path: Path | None, key: Mapping[str, Any], answer: Any) -> bool:
    """Keep an answer, whole or not at all; False where the folder cannot be written, or is not this user's own."""
    if path is None:
        return False
    try:
        with replacing(own_folder(path.parent) / path.name, mode=OWN) as temporary:
            temporary.write_text(json.dumps({"question": key, "answer": answer}, indent=1), encoding="utf-8")
    except OSError:
        return False
    return True


def load_table(classes: Mapping[str, Any]) -> dict[str, tuple[float, float]] | None:
    """The costs that were measured on this machine: two finite numbers for each of these classes; None without."""
    found = load(_kept(TABLE), {"table": 1})
    try:
        table = {str(name): (float(beside), float(each)) for name, (beside, each) in found.items()}
    except (AttributeError, TypeError, ValueError):
        return None
    sound = all(math.isfinite(beside) and beside >= 0.0 and 0.0 < each < math.inf for beside, each in table.values())
    return table if sound and table.keys() == classes.keys() else None


def save_table(table: Mapping[str, tuple[float, float]]) -> bool:
    """Keep measured costs."""
    return save(_kept(TABLE), {"table": 1}, table)
