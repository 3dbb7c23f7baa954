"""Digests of the coefficients of methods, so that quick tests evaluate order conditions of changed tables only.

The conditions of all tables take 17 s in exact arithmetic. ``coefficients.json`` holds for each method the digest of a
table whose conditions held; ``python tests/support/regenerate.py`` adds new methods after it has checked them.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

from integrators import Method

COEFFICIENTS = Path(__file__).resolve().parents[1] / "integrators" / "coefficients.json"


def numbers(value: Any) -> Iterator[str]:
    """Yield all numbers of a nested value as text, with the brackets of tuples; texts and functions are left out."""
    if isinstance(value, (Fraction, int, float)):
        yield str(value)
    elif is_dataclass(value) and not isinstance(value, type):
        for field in fields(value):
            yield from numbers(getattr(value, field.name))
    elif isinstance(value, (tuple, list)):
        yield "("
        for one in value:
            yield from numbers(one)
        yield ")"


def digest(method: Method) -> str:
    """Return a digest of all coefficients of a method, those of its estimates and of its dense output included."""
    stated = (method, method.tableau, method.nystrom_tableau, method.sub_flows, method.characteristic, method.dense)
    return hashlib.sha256(" ".join(numbers(stated)).encode()).hexdigest()[:16]


def checked() -> dict[str, str]:
    """Return the stored digests by the name of the method."""
    found: dict[str, str] = json.loads(COEFFICIENTS.read_text(encoding="utf-8"))
    return found
