"""What of the package is documented for users, and what its docstrings owe to a reader."""

from __future__ import annotations

import ast
import functools
import inspect
import re
import textwrap
from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Any

PAGES = (
    "pendulum_env",
    "pendulum_env.controllers",
    "pendulum_env.lab",
    "pendulum_env.bench",
    "pendulum_env.lab.fitting.result",
    "pendulum_env.study.fit_report",
    "pendulum_env.plots",
    "pendulum_env.render",
    "pendulum_env.physics.bodies",
    "pendulum_env.physics.body",
    "pendulum_env.physics.damping",
    "pendulum_env.physics.drag_laws",
    "pendulum_env.physics.effects",
    "pendulum_env.physics.energy",
    "pendulum_env.physics.exact",
    "pendulum_env.physics.flow",
    "pendulum_env.physics.medium",
    "pendulum_env.physics.presets",
    "pendulum_env.physics.units",
    "pendulum_env.auto.choice",
    "pendulum_env.common.saved",
    "pendulum_env.engine.certificate",
    "pendulum_env.engine.code",
    "pendulum_env.engine.result",
    "pendulum_env.engine.rollout",
    "pendulum_env.study.audit.study",
    "pendulum_env.study.compare",
    "pendulum_env.study.cost.study",
    "pendulum_env.study.basins",
    "pendulum_env.study.growth",
    "pendulum_env.study.section",
    "pendulum_env.hard_cases.run",
    "pendulum_env.films.record",
    "pendulum_env.truth.answer",
    "pendulum_env.truth.reference",
    "pendulum_env.study.stability",
    "pendulum_env.study.sweep.study",
    "pendulum_env.study.audit.verdicts",
    "pendulum_env.tasks",
    "pendulum_env.testing",
    "pendulum_env.web",
    "integrators",
    "integrators.analysis",
    "integrators.steps.compensated",
    "integrators.solving.dense",
    "integrators.analysis.linear",
    "integrators.method",
    "integrators.families.taylor",
)
"""Modules whose names are documented: those in ``__all__``, or all that a module defines."""
OURS = ("pendulum_env", "integrators")
PHYSICAL = {
    "time", "times", "angle", "velocity", "speed", "dt", "h", "duration", "omega0", "gamma", "amplitude", "length",
    "mass", "gravity", "radius", "thickness", "period", "rate", "speed_limit", "density", "viscosity", "temperature",
    "frequency", "level", "quantum", "noise", "jitter", "zero", "release", "span", "spans", "gap", "omega0_h",
    "gamma_h", "c", "tau", "friction_ratio", "tolerance", "accuracy",
}
"""Names of arguments that are physical numbers."""
UNIT = re.compile(
    r"\[[^\]]*(?<![A-Za-z])(s|ns|ms|rad|m|mm|kg|J|N|Hz|K|Pa|1|degrees?|inch|points|pixels)(?![A-Za-z])[^\]]*\]"
    r"|\b(seconds?|radians?|degrees?|SI units|dimensionless|metres?|relative|multiples of)\b")
"""A unit in brackets, or in words."""
REFERS = re.compile(
    r"\b[Aa]s (in |of )?:(func|class|meth):|\b(arguments|Keywords|Raises|others?) (are )?(those of|as) ")
"""Arguments that are another function's."""
CHECKERS = re.compile(
    r"^(number|whole_number|one_of|several|truth|function|file_path|checked_\w+|find_\w+|one_number)$")
"""Functions that refuse what cannot be."""
SAID = re.compile(r"[Rr]aise[sd]?\b|[Rr]efuse[sd]?\b|\b[A-Z]\w+Error\b|\bResetNeeded\b")
YEAR = re.compile(r"\b1[5-9]\d\d\b|\b20\d\d\b")


def public() -> Iterator[tuple[str, Any, Any]]:
    """Label, object and the class that it belongs to, None for none, of all that is documented."""
    seen: set[int] = set()
    for page in PAGES:
        module = import_module(page)
        names = getattr(module, "__all__", None)
        for name in vars(module) if names is None else names:
            entry = getattr(module, name)
            own = getattr(entry, "__module__", "") == page or names is not None
            if name.startswith("_") or not own or not (inspect.isclass(entry) or inspect.isfunction(entry)):
                continue
            if id(entry) in seen or not entry.__module__.startswith(OURS):
                continue
            seen.add(id(entry))
            yield f"{page}.{name}", entry, None
            if inspect.isclass(entry):
                for part in members(entry):
                    yield f"{page}.{name}.{part}", vars(entry)[part], entry


def members(owner: type) -> list[str]:
    """Names of the methods and properties that a class itself defines."""
    kinds = (classmethod, staticmethod, property, functools.cached_property)
    return [name for name, value in vars(owner).items()
            if not name.startswith("_") and (inspect.isfunction(value) or isinstance(value, kinds))]


def function_of(entry: Any) -> Callable[..., Any] | None:
    """The function behind a method, a property or a decorated function; a class's ``__init__`` where it has one."""
    if inspect.isclass(entry):
        made = vars(entry).get("__init__") or vars(entry).get("__post_init__")
        return made if inspect.isfunction(made) and made.__qualname__ != "__create_fn__.<locals>.__init__" else None
    found = getattr(entry, "fget", None) or getattr(entry, "func", None) or getattr(entry, "__func__", None) or entry
    return inspect.unwrap(found) if callable(found) else None


def docstring(entry: Any, owner: type | None) -> str:
    """What is said of it: of a method, where its class says nothing, what the class does that it is from."""
    if inspect.isclass(entry):
        made = vars(entry).get("__init__")
        return (vars(entry).get("__doc__") or "") + "\n" + (getattr(made, "__doc__", "") or "")
    found = getattr(entry, "__doc__", "") or getattr(function_of(entry), "__doc__", "") or ""
    if not found and owner is not None:
        name = getattr(function_of(entry), "__name__", "")
        found = next((said for base in owner.__mro__[1:] if (said := inspect.getdoc(vars(base).get(name)))), "")
    return found


def attribute(owner: Any, name: str) -> str:
    """What the docstrings of a class's base classes say of an attribute; "" where none does."""
    item = re.compile(rf"^ {{4}}(?:\w+, )*{name}(?:, \w+)*: (.+(?:\n {{8}}.*)*)", re.MULTILINE)
    for base in getattr(owner, "__mro__", ())[1:]:
        if match := item.search(inspect.getdoc(base) or ""):
            return inspect.cleandoc(f"\n        {match[1]}")
    return ""


def units_of_fields(entry: Any) -> set[str]:
    """Fields of a dataclass that have their unit in their metadata."""
    return {name for name, field in getattr(entry, "__dataclass_fields__", {}).items() if "unit" in field.metadata}


def tree(function: Callable[..., Any]) -> ast.AST | None:
    try:
        return ast.parse(textwrap.dedent(inspect.getsource(function)))
    except (OSError, TypeError, SyntaxError):
        return None


def raised(function: Callable[..., Any]) -> set[str]:
    """Names of the errors that it raises itself, and of the functions that check for it."""
    found = tree(function)
    if found is None:
        return set()
    names: set[str] = set()
    for node in ast.walk(found):
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
            names.add(getattr(node.exc.func, "id", getattr(node.exc.func, "attr", "")))
        if isinstance(node, ast.Call) and CHECKERS.match(name := getattr(node.func, "id", "")):
            names.add(name)
    return names - {"AttributeError", "NotImplementedError", "KeyboardInterrupt"}


def physical(function: Callable[..., Any]) -> list[str]:
    """Its arguments that are physical numbers."""
    try:
        found = inspect.signature(function).parameters
    except (TypeError, ValueError):
        return []
    return [name for name in found if name in PHYSICAL]
