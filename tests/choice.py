"""Which combinations the quick tests take: splittings, of which there are many, in turn; the slow ones take all.

So for implicit methods, whose steps take long to compile; mostly at half that rate.

Where whole combinations are many, quick tests take enough of them to hold every pair of values.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations, product
from typing import Any

import pytest
from implicit_truths import IN_TURN
from multistep_truths import ERRORS
from splitting_truths import TRUTHS

from pendulum_env import SCENES
from pendulum_env.engine.machine import fitting

FITS = {(name, method) for name, scene in SCENES.items() for method in fitting(scene)}
"""Scenes and the methods that fit them."""
TURNS = 8
ORDER = {name: i for i, name in enumerate((*TRUTHS, *IN_TURN, *ERRORS))}


def in_turn(methods: Iterable[str], turn: int) -> list[Any]:
    """All of these methods for one test; of the splittings every eighth, the others marked slow."""
    return [_param(name, quick=ORDER.get(name, turn) % _turns(name) == turn % _turns(name)) for name in methods]


def _turns(name: str) -> int:
    return 2 * TURNS if name in IN_TURN else TURNS


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
    """Pairs (case, method); of a splitting's cases one, another for the next one, the others marked slow.

    So of one implicit method.
    """
    place = {case: i for i, case in enumerate(cases)}

    def chosen(case: str, name: str) -> bool:
        turns = (ORDER[name] + turn) % len(cases) == place[case]
        return turns and (name not in IN_TURN or IN_TURN.index(name) == turn)

    return [_param(case, name, quick=name not in ORDER or chosen(case, name)) for case, name in pairs]


def pairs(axes: Sequence[Sequence[Any]]) -> list[tuple[Any, ...]]:
    """Combinations that hold every pair of values; the first two axes are scenes and methods that fit them.

    One or more for each scene and method: the rest is chosen for the most pairs that were not there before.
    """
    found: list[tuple[Any, ...]] = []
    seen: set[Any] = set()
    for method in axes[1]:
        places = [scene for scene in axes[0] if (scene, method) in FITS]
        rows = [(scene, method, *rest) for scene in places for rest in product(*axes[2:])]
        wanted = {pair for row in rows for pair in _pairs_of(row) if (1, method) in pair}
        while wanted - seen:
            best = max(rows, key=lambda row: (len((_pairs_of(row) & wanted) - seen), len(_pairs_of(row) - seen)))
            seen |= _pairs_of(best)
            found.append(best)
    return found


def _pairs_of(row: tuple[Any, ...]) -> set[tuple[tuple[int, Any], tuple[int, Any]]]:
    return set(combinations(enumerate(row), 2))


def check_pairs(found: Sequence[tuple[Any, ...]], axes: Sequence[Sequence[Any]]) -> None:
    """AssertionError unless every pair of values that fit is there."""
    for i, first in enumerate(axes):
        for j, second in enumerate(axes[i + 1 :], i + 1):
            wanted = {(a, b) for a in first for b in second if (i, j) != (0, 1) or (a, b) in FITS}
            assert {(row[i], row[j]) for row in found} == wanted


def _param(*values: str, quick: bool) -> Any:
    return pytest.param(*values, marks=[] if quick else [pytest.mark.slow])
