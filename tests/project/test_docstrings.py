"""Every public name says what it is: with units, shapes, the errors it raises, and the source of its formula."""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping
from importlib import import_module
from typing import Any

import pytest
from docstrings import (
    PAGES,
    REFERS,
    SAID,
    UNIT,
    YEAR,
    attribute,
    docstring,
    function_of,
    physical,
    public,
    raised,
    units_of_fields,
)
from errors_raised import can_raise, claimed, errors

import integrators
import pendulum_env
from pendulum_env import lab
from pendulum_env.physics import exact
from pendulum_env.physics.drag_laws import LAWS
from pendulum_env.physics.effects import EFFECTS

ENTRIES = {label: (entry, owner) for label, entry, owner in public()}

SPOKEN_FOR = ("pendulum_env.physics.exact",)
"""Modules that say once for all what units their functions take, and what they raise."""
UNITLESS: Mapping[str, str] = {
    "pendulum_env.lab.Circle": "in the unit of its points, as it says",
    "pendulum_env.testing.VectorCheck": "a level of checks is a name",
    **dict.fromkeys(("integrators.Method.settled_memory", "integrators.StepSizeError", "integrators.solve",
                     "integrators.solving.dense.Recorder.curve",
                     "integrators.solving.dense.Recorder.joined",
                     "integrators.solving.dense.Recorder.failed"), "time and state are in units of the caller's"),
    "integrators.Nystrom": "c are the places of stages in a step, pure numbers of a table",
    "integrators.solving.dense.Recorder": "zero is the state's own zero, with its type and shape",
    "integrators.steps.compensated.scaled": "a product of two numbers, whatever they are",
}
"""Names with physical numbers and without units, and why."""
SILENT: Mapping[str, str] = {}
"""Names that raise and do not say so, and why."""
SHAPE = re.compile(r"\b(shapes?|arrays?|each|every|points?|rows?|matrix|Times)\b|\(n,")
"""Words that say what an array is an array of."""
OWN_FORMULAS: Mapping[str, str] = {
    "decay_rate": "a least-squares line through logarithms, written out",
    "fit": "least squares of what a scene, whose effects have sources, does",
    "fit_driven": "least squares of what a scene, whose effects have sources, does",
    "fit_circle": "the definition of least squares",
    "measure": "puts together what other functions measure",
    "period": "a mean of differences, with its error by propagation",
    "track_angle": "the definition of an angle",
    "turning_points": "a definition",
    "Losses": "a result of losses, which has the source",
    "VirtualSensor": "rounding and sampling, written out",
}
"""Measures on recordings whose formulas are their definitions."""
DERIVED: Mapping[str, str] = {
    "coulomb_turning_points_linear": "as coulomb_turning_points, which has the source",
    "flight": "derived in the docstring; a test compares it with the parabola in short steps",
    "drag_only": "a separated equation, written out",
    "period_rotation": "as period, which has the source",
}
"""Closed forms whose derivation is in the docstring."""


def said_of(label: str) -> str:
    entry, owner = ENTRIES[label]
    return docstring(entry, owner) or attribute(owner, label.rpartition(".")[2])


def around(label: str) -> str:
    """What the class of a name says, and the page where that speaks for all that is on it."""
    owner = ENTRIES[label][1]
    page = max((page for page in PAGES if label.startswith(f"{page}.")), key=len)
    classes = [base.__doc__ or "" for base in owner.__mro__[:-1]] if owner is not None else []
    return "\n".join([*classes, import_module(page).__doc__ or "" if page in SPOKEN_FOR else ""])


def test_what_users_import_is_among_them() -> None:
    known = [entry for entry, _ in ENTRIES.values()]
    for room in (pendulum_env, integrators, lab, exact):
        own = [getattr(room, name) for name in room.__all__]
        assert [one for one in own if (inspect.isroutine(one) or inspect.isclass(one)) and one not in known] == []
    assert {"pendulum_env.LabPendulumEnv.step", "integrators.Method.write_step"} <= set(ENTRIES)


def test_every_name_has_a_docstring() -> None:
    assert [label for label in ENTRIES if not said_of(label).strip()] == []


def test_every_constant_has_one() -> None:
    """A string below it, where it is defined."""
    bare = []
    for page in ("pendulum_env", "integrators", "pendulum_env.plots", "pendulum_env.render",
                 "pendulum_env.physics.effects", "pendulum_env.tasks"):
        module = import_module(page)
        for name in getattr(module, "__all__", ()):
            value = getattr(module, name)
            if callable(value) or inspect.ismodule(value):
                continue
            homes = [source for home in PLACES if (source := inspect.getsource(import_module(home)))]
            found = re.compile(rf'^{name}\b[^\n]*= (?:[^\n]|\n(?!\n|\w))*\n+"""', re.M)
            if not any(found.search(source) for source in homes):
                bare.append(f"{page}.{name}")
    assert bare == []


PLACES = ("pendulum_env", "integrators.registry", "pendulum_env.plots.style", "pendulum_env.plots.series",
          "pendulum_env.render.palette", "pendulum_env.render.stage",
          "pendulum_env.physics.effects", "pendulum_env.physics.presets", "pendulum_env.tasks",
          "pendulum_env.tasks.task")
"""Modules that define them."""


def test_physical_numbers_have_units() -> None:
    """In brackets or in words: where the name is explained, in its class, or once for its module."""
    missing = {}
    for label, (entry, _) in ENTRIES.items():
        function = function_of(entry)
        if inspect.isclass(entry):
            numbers = [name for name in physical(entry) if name not in units_of_fields(entry)]
        else:
            numbers = physical(function) if function is not None else []
        said = said_of(label)
        if numbers and not UNIT.search(said + around(label)) and not REFERS.search(said) and not inherited(label):
            missing[label] = numbers
    assert {label: names for label, names in missing.items() if label not in UNITLESS} == {}
    assert set(UNITLESS) <= set(missing)


def inherited(label: str) -> bool:
    """True for a method that a base class explains, with units."""
    name, owner = label.rpartition(".")[2], ENTRIES[label][1]
    bases = owner.__mro__[1:-1] if owner is not None else ()
    return any(UNIT.search(inspect.getdoc(vars(base)[name]) or "") for base in bases if name in vars(base))


@pytest.mark.slow
def test_errors_are_named() -> None:
    """Of what raises, or has its arguments checked, itself."""
    missing = {}
    for label, (entry, owner) in ENTRIES.items():
        function = function_of(entry)
        if function is None:
            continue
        said, more = said_of(label), "" if owner is not None else around(label)
        errors = raised(function)
        if errors and not SAID.search(said + more):
            missing[label] = errors
    assert {label: names for label, names in missing.items() if label not in SILENT} == {}
    assert set(SILENT) <= set(missing)


def false_claims(entries: Mapping[str, tuple[Any, type | None]]) -> dict[str, set[str]]:
    """Return the errors that docstrings name after "Raises" and that cannot be raised; subclasses of them can."""
    found: dict[str, set[str]] = {}
    for label, (entry, owner) in entries.items():
        possible = can_raise(entry, owner)
        for name in claimed(docstring(entry, None)):
            if not any(issubclass(error, errors()[name]) for error in possible):
                found.setdefault(label, set()).add(name)
    return found


@pytest.mark.slow
def test_errors_that_are_named_can_be_raised() -> None:
    assert false_claims(ENTRIES) == {}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["KeyError", "RecordingError", "ResetNeeded", "StudyError", "WindowError"])
def test_an_error_that_cannot_be_raised_is_noticed(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """For the functions that most others are built on."""
    for entry in (pendulum_env.rollout, integrators.solve):
        monkeypatch.setattr(entry, "__doc__", f"{entry.__doc__}\n\n    Raises {name} for another scene.")
        assert false_claims({"it": (entry, None)}) == {"it": {name}}


def test_arrays_say_what_they_are() -> None:
    """Of functions that return arrays."""
    bare = []
    for label, (entry, owner) in ENTRIES.items():
        function = function_of(entry)
        returned = str(getattr(function, "__annotations__", {}).get("return", ""))
        if function is None or inspect.isclass(entry) or not re.search(r"NDArray|Array\b|ndarray", returned):
            continue
        if not SHAPE.search(said_of(label) + (around(label) if owner is not None else "")):
            bare.append(label)
    assert bare == []


def test_tables_have_their_sources() -> None:
    known: list[tuple[str, Any]] = [*integrators.METHODS.items(), *EFFECTS.items(), *LAWS.items()]
    assert [name for name, entry in known if not YEAR.search(entry.source)] == []


def test_closed_forms_have_their_sources() -> None:
    bare = {name for name in exact.__all__ if not YEAR.search(getattr(exact, name).__doc__)}
    assert bare == set(DERIVED)


def test_measures_have_their_sources() -> None:
    """Those with a formula, in words of mathematics, in their docstring; units in brackets are none."""
    texts = {name: re.sub(r"\[[^]=]*\]", "", getattr(lab, name).__doc__ or "") for name in lab.__all__}
    formulas = {name for name, text in texts.items() if re.search(r"[=√]|\*\*|²", text)}
    bare = {name for name in formulas if not YEAR.search(getattr(lab, name).__doc__)}
    assert bare == set(OWN_FORMULAS)
