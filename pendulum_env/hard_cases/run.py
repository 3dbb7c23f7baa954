"""Methods tried in hard cases: choose the cases, run each pair, collect what became of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from itertools import groupby

import integrators as registry
from integrators import Method
from pendulum_env.common.progress import Progress, telling_of
from pendulum_env.engine.starts import listed_methods, none_twice
from pendulum_env.hard_cases.case import Case
from pendulum_env.hard_cases.catalogue import CASES, KNOWN_FAILURES
from pendulum_env.hard_cases.files import write
from pendulum_env.hard_cases.matrix import Entry, Matrix
from pendulum_env.physics.units import SceneError, one_of, several, truth

__all__ = ["Entry", "Matrix", "chosen_cases", "entry", "listing", "stress", "write"]


def chosen_cases(names: str | Sequence[str] | None, scene: str | None, long: bool) -> tuple[Case, ...]:
    """Cases by their names or their groups', all by default; long ones only where named themselves, or with ``long``.

    ``scene`` leaves those of this scene. Raises SceneError for unknown names, and where no case is left.
    """
    groups = [*dict.fromkeys(case.group for case in CASES)]
    known, given = [*groups, *(case.name for case in CASES)], [names] if isinstance(names, str) else names
    listed = groups if given is None else several(given, "cases", "names of cases")
    for name in listed:
        close = isinstance(name, str) and get_close_matches(name[:80], known, 1, 0.5)
        one_of(name, "hard case or group", known if close else groups)
    wanted = {*listed}
    if scene is not None:
        one_of(scene, "hard case with the scene", {case.scene.name for case in CASES})
    every = truth(long, "long")
    found = tuple(case for case in CASES if case.name in wanted or (case.group in wanted and (every or not case.long)))
    found = tuple(case for case in found if scene in (None, case.scene.name))
    if not found:
        raise SceneError("No hard case is left to run; leave out the scene, name other cases, or allow long ones.")
    return found


def stress(
    cases: str | Sequence[str] | None = None,
    integrators: Iterable[str | Method] | None = None,
    *,
    scene: str | None = None,
    long: bool = False,
    progress: Progress | bool = False,
) -> Matrix:
    """Try methods in hard cases with known truths: what becomes of each pair.

    Args:
        cases: names of cases or of groups; by default all.
        integrators: names or methods, none twice; by default all.
        scene: only cases of this scene.
        long: with those that take more than a few seconds per method; a case that is named itself always runs.
        progress: True shows a bar; or what is called with the fraction done and what is being done.

    Returns a Matrix: its ``entries``, those of them that are ``failures``, a ``table`` and a ``text``;
    :func:`write` makes a figure and a CSV of it. KeyboardInterrupt ends it early, with what was found.

    Raises SceneError or MethodError for unknown names.
    """
    found = chosen_cases(cases, scene, long)
    methods = [*registry.METHODS.values()] if integrators is None else none_twice(
        name if isinstance(name, Method) else registry.get(name) for name in listed_methods(integrators))
    with telling_of(progress, "stress") as tell:
        return _tried(found, methods, tell)


def _tried(cases: tuple[Case, ...], methods: Sequence[Method], tell: Progress) -> Matrix:
    entries: list[Entry] = []
    total = len(cases) * len(methods)
    try:
        for case in cases:
            for method in methods:
                tell(len(entries) / total, f"{case.name}: {method.name}")
                entries.append(entry(case, method))
        tell(1.0, "done")
    except KeyboardInterrupt:
        return Matrix(cases, tuple(methods), tuple(entries), False)
    return Matrix(cases, tuple(methods), tuple(entries))


def listing(cases: Iterable[Case]) -> str:
    """What the cases are, in words: of each why it is hard, its truth and the source of that."""
    lines: list[str] = []
    for group, members in groupby(cases, key=lambda case: case.group):
        lines += ["", f"{group}:"] if lines else [f"{group}:"]
        for case in members:
            lines += [f"  {case.name}{' (long)' if case.long else ''}, scene {case.scene.name}. {case.why} "
                      f"Truth: {case.truth.rstrip('.')}. Source: {case.source.rstrip('.')}."]
    return "\n".join(lines)


def entry(case: Case, method: Method) -> Entry:
    """One case tried with one method."""
    finding = case.tried(method)
    known = KNOWN_FAILURES.get((case.name, method.name), "")
    return Entry(case, method, finding, case.as_expected(method, finding), known)
