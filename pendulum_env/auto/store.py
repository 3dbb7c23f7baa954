"""Storage of earlier choices of ``integrator="auto"`` in the cache folder, as JSON files.

Files are checked when read and written atomically; without a cache folder the choice is measured again.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pendulum_env.common.trust import own_bytes, own_folder, write_own
from pendulum_env.engine.kernels import cache_folder

TABLE = "auto_costs.json"


def file_of(key: Mapping[str, Any]) -> Path | None:
    """Return the path of the file for the choice with these settings (``key``); None without a cache folder."""
    text = json.dumps(key, sort_keys=True)
    return _in_cache(f"auto_{hashlib.sha256(text.encode()).hexdigest()[:24]}.json")


def _in_cache(name: str) -> Path | None:
    """Return the path of a file in the cache folder; None if there is no such folder."""
    try:
        return cache_folder() / name
    except OSError:
        return None


def load(path: Path | None, key: Mapping[str, Any]) -> Any:
    """Return the result stored in a file, if it was stored for these settings (``key``), else None.

    The result is also None for a file that does not exist, is damaged, or could have been written by another user.
    """
    if path is None:
        return None
    try:
        stored = json.loads(own_bytes(own_folder(path.parent) / path.name))
        return stored["answer"] if stored["question"] == json.loads(json.dumps(key)) else None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def save(path: Path | None, key: Mapping[str, Any], answer: Any) -> bool:
    """Write a result for these settings (``key``) to a file of the cache, atomically.

    Returns False if there is no cache folder, or if it cannot be written to or belongs to another user.
    """
    if path is None:
        return False
    try:
        write_own(path, json.dumps({"question": key, "answer": answer}, indent=1).encode())
    except OSError:
        return False
    return True


def load_table(classes: Mapping[str, Any]) -> dict[str, tuple[float, float]] | None:
    """Return the stored table of step costs measured on this computer; None if there is none or it is not valid.

    The table has two finite numbers, fixed cost and cost per evaluation, for each class of methods.
    """
    stored = load(_in_cache(TABLE), {"table": 1})
    try:
        table = {str(name): (float(fixed), float(slope)) for name, (fixed, slope) in stored.items()}
    except (AttributeError, TypeError, ValueError):
        return None
    valid = all(math.isfinite(fixed) and fixed >= 0.0 and 0.0 < slope < math.inf for fixed, slope in table.values())
    return table if valid and table.keys() == classes.keys() else None


def save_table(table: Mapping[str, tuple[float, float]]) -> bool:
    """Store the table of step costs measured on this computer in the cache folder."""
    return save(_in_cache(TABLE), {"table": 1}, table)
