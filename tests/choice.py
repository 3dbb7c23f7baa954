"""Which combinations the quick tests take: splittings, of which there are many, in turn; the slow ones take all."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import pytest
from splitting_truths import TRUTHS

TURNS = 8
ORDER = {name: i for i, name in enumerate(TRUTHS)}


def in_turn(methods: Iterable[str], turn: int) -> list[Any]:
    """All of these methods for one test; of the splittings every eighth, the others marked slow."""
    return [_param(name, quick=ORDER.get(name, turn) % TURNS == turn % TURNS) for name in methods]


def quick(methods: Iterable[str], turn: int) -> list[str]:
    """Those of :func:`in_turn` that quick tests take."""
    return [param.values[0] for param in in_turn(methods, turn) if not param.marks]


def few(pairs: Iterable[tuple[str, ...]], turn: int) -> list[Any]:
    """Tuples that end with a method, for tests that compile: of every eighth splitting one, the others marked slow."""
    places: dict[str, int] = {}
    found = []
    for pair in pairs:
        name = pair[-1]
        places[name] = places.get(name, -1) + 1
        first = name in ORDER and ORDER[name] % TURNS == turn % TURNS and places[name] == ORDER[name] // TURNS
        found.append(_param(*pair, quick=name not in ORDER or first))
    return found


def spread(cases: Sequence[str], pairs: Iterable[tuple[str, str]], turn: int = 0) -> list[Any]:
    """Pairs (case, method); of a splitting's cases one, another for the next one, the others marked slow."""
    place = {case: i for i, case in enumerate(cases)}
    return [
        _param(case, name, quick=name not in ORDER or (ORDER[name] + turn) % len(cases) == place[case])
        for case, name in pairs
    ]


def _param(*values: str, quick: bool) -> Any:
    return pytest.param(*values, marks=[] if quick else [pytest.mark.slow])
