"""The errors that a function of the package can raise, read from its text and from the functions that it uses.

A name in a function's text leads to the function, class or error that it stands for. An attribute leads to every method
and property of the package with its name, because the text does not tell the object's class. So the result can hold an
error too many, but an error that it lacks is raised within DEPTH calls only by Python itself or by another package.
"""

from __future__ import annotations

import ast
import builtins
import functools
import inspect
import pkgutil
import re
from collections.abc import Iterable, Iterator, Mapping
from importlib import import_module
from types import ModuleType
from typing import Any

import numpy as np

import integrators
import pendulum_env

DEPTH = 8
"""How many calls deep errors are looked for."""
CLAIM = re.compile(r"\b[Rr]aises?\s((?:[^.`]|`[^`]*`|\.(?=\w))*)")
"""A sentence that says what is raised, up to its end."""
ERROR = re.compile(r"\b[A-Z]\w+\b")
FOREIGN = {name for kind in (dict, list, tuple, set, str, bytes, float, np.ndarray, re.Pattern) for name in dir(kind)}
"""Attributes that objects of Python and NumPy have, too: they lead nowhere."""
ELSEWHERE = ("pendulum_env.adapters.", "pendulum_env.jax")
"""Beginnings of the names of modules that need a program in an environment of its own."""
Place = tuple[str, str]
"""A module and the qualified name of a function or a class in it."""
Caught = tuple[type[BaseException], ...]


@functools.cache
def errors() -> dict[str, type[BaseException]]:
    """Return the error classes of Python, and those that the package uses, by name."""
    used = {value.__name__: value for text in _texts().values() for value, _ in text.used if _is_error(value)}
    return used | {name: one for name, one in vars(builtins).items() if _is_error(one)}


def claimed(text: str) -> set[str]:
    """Return the names of the errors that a docstring says are raised."""
    known = errors()
    return {name for sentence in CLAIM.findall(text) for name in ERROR.findall(sentence) if name in known}


def can_raise(entry: Any, owner: type | None = None) -> set[type[BaseException]]:
    """Return the errors that a function, any method of a class, or a method in any subclass can raise."""
    places = {*_places_of(entry)}
    if inspect.isclass(entry):
        places |= {place for base in entry.__mro__ for place in _texts() if place[0] == base.__module__
                   and place[1].startswith(f"{base.__qualname__}.")}
    elif owner is not None:
        name = _function_name(entry)
        related = [other for other in _classes() if owner in other.__mro__ or other in owner.__mro__]
        places |= {(other.__module__, f"{other.__qualname__}.{name}") for other in related} & _texts().keys()
    return set().union(*(_raised()[place] for place in places))


def _function_name(entry: Any) -> str:
    inner = getattr(entry, "fget", None) or getattr(entry, "func", None) or getattr(entry, "__func__", None) or entry
    return str(inner.__name__)


@functools.cache
def _classes() -> tuple[type, ...]:
    return tuple({value for module in modules().values() for value in vars(module).values() if inspect.isclass(value)})


@functools.cache
def modules() -> dict[str, ModuleType]:
    """Return every module of the package by name, but those whose programs are in environments of their own."""
    found = {}
    for package in (integrators, pendulum_env):
        for one in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if not one.name.endswith("__main__") and not one.name.startswith(ELSEWHERE):
                found[one.name] = import_module(one.name)
        found[package.__name__] = package
    return found


def _is_error(value: object) -> bool:
    return inspect.isclass(value) and issubclass(value, BaseException)


class _Text:
    """The names and attributes in a function's or a class's text, each with the errors that are caught around it."""

    def __init__(self, module: ModuleType, node: ast.AST) -> None:
        self.module, self.names = module, dict(vars(module))
        self.used: list[tuple[Any, Caught]] = []
        self.attributes: list[tuple[str, Caught]] = []
        for part in ast.walk(node):
            if isinstance(part, ast.ImportFrom) and (part.module or "").startswith(("pendulum_env", "integrators")):
                home = import_module(str(part.module))
                self.names |= {alias.asname or alias.name: getattr(home, alias.name, None) for alias in part.names}
        for part in ast.iter_child_nodes(node):
            self._read(part, ())

    def _read(self, node: ast.AST, caught: Caught) -> None:
        if isinstance(node, ast.Try):
            own = caught + tuple(error for handler in node.handlers if not _raises_again(handler)
                                 for error in self._classes(handler.type))
            for part in node.body:
                self._read(part, own)
            for part in (*node.orelse, *node.finalbody, *(x for handler in node.handlers for x in handler.body)):
                self._read(part, caught)
        elif isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("isinstance", "issubclass"):
            self._read(node.args[0], caught)
        elif isinstance(node, ast.Name):
            self.used.append((self._value(node), caught))
        elif isinstance(node, ast.Attribute):
            value = self._value(node)
            if value is not None:
                self.used.append((value, caught))
            else:
                self.attributes.append((node.attr, caught))
                self._read(node.value, caught)
        elif isinstance(node, ast.AnnAssign):
            for part in (node.value, node.target):
                if part is not None:
                    self._read(part, caught)
        elif isinstance(node, ast.arguments):
            for part in (*node.defaults, *filter(None, node.kw_defaults)):
                self._read(part, caught)
        elif isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            for part in (node.args, *node.body, *node.decorator_list):
                self._read(part, caught)
        else:
            for part in ast.iter_child_nodes(node):
                self._read(part, caught)

    def _value(self, node: ast.AST) -> Any:
        if isinstance(node, ast.Name):
            return self.names.get(node.id, getattr(builtins, node.id, None))
        if isinstance(node, ast.Attribute):
            owner = self._value(node.value)
            if inspect.ismodule(owner) or inspect.isclass(owner):
                return inspect.getattr_static(owner, node.attr, None)
        return None

    def _classes(self, node: ast.AST | None) -> Caught:
        if node is None:
            return (BaseException,)
        parts = node.elts if isinstance(node, ast.Tuple) else [node]
        values = [self._value(part) for part in parts]
        flat = [one for value in values for one in (value if isinstance(value, tuple) else (value,))]
        return tuple(one for one in flat if _is_error(one))


def _raises_again(handler: ast.ExceptHandler) -> bool:
    """Whether a handler raises the error that it has caught: it then catches nothing."""
    return any(isinstance(part, ast.Raise) and (part.exc is None or getattr(part.exc, "id", 0) == handler.name)
               for part in ast.walk(handler))


@functools.cache
def _tree(module: ModuleType) -> ast.Module:
    return ast.parse(inspect.getsource(module))


def _definitions(module: ModuleType) -> Iterator[tuple[str, ast.AST]]:
    """Each function, method and class of a module; a class's text is what stands outside of its methods."""
    def inside(owner: ast.AST, prefix: str) -> Iterator[tuple[str, ast.AST]]:
        for node in ast.iter_child_nodes(owner):
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
                yield prefix + node.name, node
            elif isinstance(node, ast.ClassDef):
                yield from inside(node, f"{prefix}{node.name}.")
                rest = [part for part in node.body if not isinstance(part, (ast.FunctionDef, ast.ClassDef))]
                yield prefix + node.name, ast.Module(rest, [])
            elif isinstance(node, (ast.If, ast.Try)):
                yield from inside(node, prefix)

    yield from inside(_tree(module), "")


@functools.cache
def _texts() -> dict[Place, _Text]:
    return {(name, label): _Text(module, node) for name, module in modules().items()
            for label, node in _definitions(module)}


@functools.cache
def _imported() -> Mapping[str, set[str]]:
    """The modules that each module imports, or that those import: others have no objects that it could use."""
    near: dict[str, set[str]] = {}
    for name, module in modules().items():
        near[name] = {name}
        for node in ast.walk(_tree(module)):
            if isinstance(node, ast.ImportFrom):
                near[name] |= {home for home in (node.module, *(f"{node.module}.{one.name}" for one in node.names))
                               if home in modules()}
    for middle in near:  # Warshall 1962
        for one in near.values():
            if middle in one:
                one |= near[middle]
    return near


@functools.cache
def _methods() -> Mapping[str, list[Place]]:
    """Places of the methods and properties of all classes, by their name."""
    found: dict[str, list[Place]] = {}
    for module, label in _texts():
        owner, _, name = label.rpartition(".")
        if owner and name not in FOREIGN:
            found.setdefault(name, []).append((module, label))
    return found


def _places_of(value: Any, deep: bool = True) -> Iterator[Place]:
    """The places where a value's text stands: of a class those that make an object, of a table those of its entries."""
    if isinstance(value, (staticmethod, classmethod)):
        value = value.__func__
    if isinstance(value, functools.partial):
        value = value.func
    if isinstance(value, property):
        value = value.fget
    if isinstance(value, functools.cached_property):
        value = value.func
    if inspect.isclass(value):
        for base in value.__mro__:
            for label in (base.__qualname__, *(f"{base.__qualname__}.__{part}__" for part in (
                    "init", "post_init", "new", "call", "enter"))):
                if (base.__module__, label) in _texts():
                    yield base.__module__, label
    elif not inspect.ismodule(value) and callable(value) and hasattr(inspect.unwrap(value), "__qualname__"):
        value = inspect.unwrap(value)
        place = (str(getattr(value, "__module__", "")), str(value.__qualname__).split(".<locals>")[0])
        if place in _texts():
            yield place
    elif deep and isinstance(value, (dict, tuple, list)):
        for entry in tuple(value.values() if isinstance(value, dict) else value):
            yield from _places_of(entry, False)


@functools.cache
def _raised() -> dict[Place, set[type[BaseException]]]:
    """What each place can raise, found call by call."""
    own: dict[Place, set[type[BaseException]]] = {}
    edges: dict[Place, list[tuple[Place, Caught]]] = {}
    for place, text in _texts().items():
        own[place] = {value for value, caught in text.used if _is_error(value) and not issubclass(value, (*caught,))}
        called = [(other, caught) for value, caught in text.used if not _is_error(value) for other in _places_of(value)]
        near = _imported()[place[0]]
        called += [(other, caught) for name, caught in text.attributes for other in _methods().get(name, ())
                   if other[0] in near]
        edges[place] = list(dict.fromkeys(called))
    found = own
    for _ in range(DEPTH):
        found = {place: own[place].union(*(_passing(found[other], caught) for other, caught in edges[place]))
                 for place in own}
    return found


def _passing(raised: Iterable[type[BaseException]], caught: Caught) -> set[type[BaseException]]:
    return {error for error in raised if not issubclass(error, caught)}
