"""Many small cases in one test: each is checked, and those that fail are named together."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterable
from typing import Any

import pytest


def check_all(cases: Iterable[Any], check: Callable[[Any], object]) -> None:
    """Call ``check(case)`` for every case; AssertionError that names all cases that fail, each with its reason.

    For cases of milliseconds, of which pytest's and xdist's own time for each test would be most.
    """
    cases, failed = list(cases), []
    assert cases, "there is no case to check"
    for case in cases:
        try:
            check(case)
        except (Exception, pytest.fail.Exception) as error:
            place = traceback.extract_tb(error.__traceback__)[-1]
            failed.append(f"{case!r}: {type(error).__name__}: {error} ({place.filename}:{place.lineno}, {place.line})")
    assert not failed, f"{len(failed)} of {len(cases)} cases fail:\n" + "\n".join(failed)
