"""Which cases the quick tests take: methods are many, and slow tests take them all.

Quick tests take three methods in every case; the other plain ones, and one of each further family, in every other case
or so, and of the rest one in twenty-four, in tests that need no scene, so that each is in many. In tests that run
methods in scenes only those of EVERYWHERE are quick, in some of the cases; in scenes that are not FAMILIAR only rk4.
Choices follow from names, so that a new entry changes no other entry's. Where whole combinations are many, tests take
enough of them to hold pairs of values, in which methods of one kind count as one; ``LAB_PENDULUM_GRID=full`` takes each
method for a kind of its own.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from heapq import heapify, heapreplace
from itertools import combinations, product
from typing import Any
from zlib import crc32

import pytest

import integrators
from pendulum_env import SCENES, Rollout, Scene, rollout
from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.machine import fitting
from pendulum_env.study import PLAIN

FITS = {(name, method) for name, scene in SCENES.items() for method in fitting(scene)}
"""Scenes and the methods that fit them."""
FULL = os.environ.get("LAB_PENDULUM_GRID") == "full"
"""Whether slow tests run each grid whole, rather than the pairs that it lists."""
TURNS, FEWER, OTHER = 24, 9, 2
ALWAYS = {"rk4", "symplectic_euler", "backward_euler"}
"""Methods that every quick test takes: an explicit, a symplectic and an implicit one."""
EVERYWHERE = (
    *sorted(PLAIN), "conformal_symplectic_euler", "dopri5", "gauss4",
    "discrete_gradient", "forest_ruth", "blanes_moan_srkn11b", "rkn43",
)
"""The plain methods, and one of each further family."""
IN_SCENES = (
    "test_batch_rollout", "test_breakaway", "test_compare", "test_cost", "test_engine", "test_env", "test_hard_cases",
    "test_ledger", "test_vector_env",
)
"""Files of tests that compile, or run, a method in many scenes."""
COMPILING = ("test_engine", "test_interpreted_and_compiled_give_the_same_bits")
"""A test that compiles each of its cases, a second or two each."""
COMPILED = {("lab", "rk4"), ("lab", "backward_euler"), ("sticky_bearing", "rk4"), ("windy", "rk4")}
"""Its quick cases: of each kind of step and of effect, one that has it."""
FAMILIAR = {"textbook", "vacuum", "exercise", "exercise_large", "lab", "sticky_bearing"}


def turn_of(text: str, turns: int) -> int:
    """Which turn a test, or a case of one, has: the same in every run."""
    return crc32(text.encode()) % turns


def chosen(names: Iterable[str], text: str) -> str:
    """Return the name that a text chooses; a new name changes no choice but those that it gets itself."""
    return min(names, key=lambda name: crc32(f"{text} {name}".encode()))


def familiar(scenes: Iterable[str]) -> list[Any]:
    """Return scenes for a test of each, in which those that are not FAMILIAR are slow."""
    return [pytest.param(name, marks=() if name in FAMILIAR else pytest.mark.slow) for name in scenes]


def quick(methods: Iterable[str], turn: int) -> list[str]:
    """Return those of EVERYWHERE, and of the others about one in twenty-four, for a test that takes many at once."""
    return [name for name in methods if name in EVERYWHERE or turn_of(name, TURNS) == turn]


def is_quick(file: str, test: str, case: str, params: Mapping[str, Any]) -> bool:
    """Whether quick tests take a case; those without a method's name among their parameters they always do."""
    named = names_in(params, integrators.METHODS)
    scenes = names_in(params, SCENES) - FAMILIAR
    if (file, test) == COMPILING:
        return (params["scene"], params["method"]) in COMPILED
    if named and scenes and file in IN_SCENES:
        return named <= {"rk4"}
    if not named or named <= ALWAYS:
        return True
    rest = "-".join(part for part in case.split("-") if part not in integrators.METHODS)
    if file not in IN_SCENES:
        return all(name in ALWAYS or turn_of(test + rest + name, OTHER) == 0 if name in EVERYWHERE else
                   turn_of(name, TURNS) == turn_of(test + rest, TURNS) for name in named)
    return named <= set(EVERYWHERE) and turn_of(test + rest, FEWER) == turn_of(str(sorted(named)), FEWER)


def names_in(params: Any, registry: Mapping[str, Any]) -> set[str]:
    """Names of a registry among a test's parameters, in tuples too, and of methods that stand there themselves."""
    if isinstance(params, str):  # most are, of tens of thousands
        return {params} if params in registry else set()
    if isinstance(params, integrators.Method):
        return names_in(params.name, registry)
    inner = params if isinstance(params, tuple) else params.values() if isinstance(params, Mapping) else ()
    return set().union(*(names_in(value, registry) for value in inner))


def rolled(scene: str | Scene, *, integrator: str, dt: float, duration: float, **options: Any) -> Rollout:
    """A rollout by the backend that is sooner done where nothing is compiled yet; both give the same bits."""
    chosen = integrators.get(integrator)
    work = duration / dt * chosen.evaluations * (30 if chosen.implicit else 1)
    sooner: Backend = "python" if work < 4e5 else "compiled"
    return rollout(scene, **{"integrator": integrator, "dt": dt, "duration": duration, "backend": sooner, **options})


@cache
def kind(name: str) -> str:
    """Return the first method whose program is written like this one's: of the same class, with the same needs.

    It is the method itself if grids are to be FULL.
    """
    def written(method: integrators.Method) -> Any:
        return type(method), method.implicit, method.needs, method.name if FULL else ""

    wanted = written(integrators.METHODS[name])
    return next(each for each, method in integrators.METHODS.items() if written(method) == wanted)


def shared_out(methods: Iterable[str], values: Sequence[str]) -> list[tuple[str, str]]:
    """Return methods with values: the first method of each kind with all, others with the one that their name chooses.
    """
    return [(name, value) for name in methods for value in values
            if name not in integrators.METHODS or kind(name) == name or chosen(values, name) == value]


def pairs(axes: Sequence[Sequence[Any]]) -> list[tuple[Any, ...]]:
    """Combinations that hold every pair of values and every method; in pairs, methods of one kind are one value.

    The first two axes are scenes and methods that fit them. Combinations of each method are chosen for the most pairs
    that were not there before; then those of one method in each scene, for pairs of other values that still lack.
    """
    fits = {scene: [method for method in axes[1] if (scene, method) in FITS] for scene in axes[0]}
    found: list[tuple[Any, ...]] = []
    seen: set[Any] = set()
    for method in axes[1]:
        places = [scene for scene in axes[0] if method in fits[scene]]
        rows = [(scene, method, *rest) for scene in places for rest in product(*axes[2:])]
        found += _covering(rows, seen, {(1, kind(method)), method})
    rows = [(scene, method, *rest) for scene in axes[0] for method in fits[scene][:1] for rest in product(*axes[2:])]
    return found + _covering(rows, seen)


def _covering(rows: Sequence[tuple[Any, ...]], seen: set[Any], of: set[Any] | None = None) -> list[tuple[Any, ...]]:
    """Return rows that hold every pair that the rows hold, or those with a value of some; their pairs become seen."""
    held = [pairs_of(row) for row in rows]
    wanted = {pair for own in held for pair in own if of is None or not of.isdisjoint(pair)}
    ranks = [_rank(own, wanted, seen, i) for i, own in enumerate(held)]
    heapify(ranks)
    found = []
    while wanted - seen:
        best = ranks[0][-1]
        rank = _rank(held[best], wanted, seen, best)
        if rank == heapreplace(ranks, rank):  # ranks only fall, so it is still the first
            seen |= held[best]
            found.append(rows[best])
    return found


def _rank(own: set[Any], wanted: set[Any], seen: set[Any], place: int) -> tuple[int, int, int]:
    """What sorts rows: how many pairs one adds of those wanted, how many at all, and its place."""
    new = own - seen
    return -len(new & wanted), -len(new), place


def pairs_of(row: tuple[Any, ...]) -> set[tuple[Any, ...]]:
    """Pairs of values of a combination, with its method as its kind, and the method itself."""
    scene, method, *rest = row
    return {*combinations(enumerate((scene, kind(method), *rest)), 2), (method,)}


def check_pairs(found: Sequence[tuple[Any, ...]], axes: Sequence[Sequence[Any]]) -> None:
    """AssertionError unless every method is there and every pair of values that fit, where a method counts as its kind.
    """
    assert {method for _, method, *_ in found} == set(axes[1])
    alike = [(scene, kind(method), *rest) for scene, method, *rest in found]
    wanted = {(scene, kind(method)) for scene, method in product(*axes[:2]) if (scene, method) in FITS}
    assert {(scene, method) for scene, method, *_ in alike} == wanted
    values = [axes[0], {kind(method) for method in axes[1]}, *axes[2:]]
    for (i, first), (j, second) in combinations(enumerate(values), 2):
        if (i, j) != (0, 1):
            assert {(row[i], row[j]) for row in alike} == set(product(first, second))
