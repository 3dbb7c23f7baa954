"""Storage of answers that take long to compute as JSON files in the cache folder, each with its question and a digest.

Files are checked when read and written atomically; without a cache folder the answer is computed again.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pendulum_env.common.trust import own_bytes, own_folder, write_own
from pendulum_env.engine.kernels import cache_folder


def load(question: Mapping[str, Any], path: Path | None = None) -> Any:
    """Return the stored answer to a question, which is read from a file in the cache folder, or from ``path``.

    The result is None if the file does not exist, holds an answer to another question, was changed, or could have been
    written by another user.
    """
    try:
        path = path or _file(question)
        stored = json.loads(own_bytes(own_folder(path.parent) / path.name))
        return stored["answer"] if stored["digest"] == _digest(question, stored["answer"]) else None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def save(question: Mapping[str, Any], answer: Any, path: Path | None = None) -> bool:
    """Write the answer to a question to its file in the cache folder, or to ``path``, atomically.

    Returns False if there is no cache folder, or if it cannot be written to or belongs to another user.
    """
    stored = {"question": question, "answer": answer, "digest": _digest(question, answer)}
    try:
        write_own(path or _file(question), json.dumps(stored, indent=1).encode())
    except OSError:
        return False
    return True


def _file(question: Mapping[str, Any]) -> Path:
    return cache_folder() / f"auto_{_digest(question)[:24]}.json"


def _digest(*values: Any) -> str:
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()
