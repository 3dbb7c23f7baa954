"""Support for old module paths, which still work, with a DeprecationWarning that names the new path."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from types import CodeType, ModuleType
from typing import Any


class OldPath:
    """Import loader that loads a module under the path that it had before it moved."""

    def __init__(self, new: str) -> None:
        self.new = new
        self.spec: ModuleSpec | None = None

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """Import a moved module from its new path and warn the caller of the old path.

        Both paths then name one module object, as do both paths of the modules that a moved package has imported.
        """
        warnings.warn(f"{spec.name} has moved to {self.new}.", DeprecationWarning, stacklevel=2)
        module = import_module(self.new)
        self.spec = module.__spec__
        for name, part in list(sys.modules.items()):
            if name.startswith(f"{self.new}."):
                sys.modules.setdefault(f"{spec.name}{name.removeprefix(self.new)}", part)
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Restore the ``__spec__`` of a moved module, which the import system replaced by that of the old path."""
        module.__spec__ = self.spec

    def get_code(self, name: str) -> CodeType | None:
        """Return the code of a moved module, which ``python -m`` with the old path runs."""
        warnings.warn(f"{name} has moved to {self.new}.", DeprecationWarning, stacklevel=2)
        spec = find_spec(self.new)
        loader: Any = spec.loader if spec else None
        code: CodeType | None = loader.get_code(self.new) if loader else None
        return code


class OldPaths:
    """Import finder that maps old module paths to new ones; it is asked only for modules that no other finder knows."""

    def __init__(self, moved: Mapping[str, str]) -> None:
        self.moved = moved

    def find_spec(self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None,
                  ) -> ModuleSpec | None:
        """Return the import spec for an old module path, or None; the import system passes ``path`` and ``target``."""
        new = self.moved.get(name)
        # Python asks for no base class of a loader; importing importlib.abc would take a tenth of the package's import
        return None if new is None else ModuleSpec(name, OldPath(new))  # type: ignore[arg-type]


def keep_old_paths(moved: Mapping[str, str]) -> None:
    """Make every old module path (a key of the mapping) import the module at its new path (the value)."""
    sys.meta_path.append(OldPaths(moved))


MOVED = {f"integrators.{old}": f"integrators.{new}" for old, new in {
    "adams": "families.adams",
    "adaptive": "solving.adaptive",
    "backward_differences": "families.backward_differences",
    "compensated": "steps.compensated",
    "dense": "solving.dense",
    "energy_preserving": "families.energy_preserving",
    "estimates": "steps.estimates",
    "exact_flow": "families.exact_flow",
    "force_gradient": "families.force_gradient",
    "linear": "analysis.linear",
    "local_error": "analysis.local_error",
    "nystrom": "families.nystrom",
    "second_order": "families.second_order",
    "solving.arrays": "steps.arrays",
    "stability": "analysis.stability",
    "stepper": "solving.stepper",
    "structural": "families.structural",
    "taylor": "families.taylor",
    "trees": "analysis.trees",
}.items()}
"""Module paths of version 0.1 that users may have in scripts, notebooks and pickles -> paths of the modules now."""

FAMILIES = {
    "integrators.method": {
        **dict.fromkeys(("Embedded", "Extension", "RungeKutta"), "integrators.families.runge_kutta"),
        **dict.fromkeys(("DRAG", "DRIFT", "KICK", "PUSH", "Splitting"), "integrators.families.splitting"),
    },
}
"""Module -> {name that it held in version 0.1: module that holds the name now}."""


def names_of_before(module: str) -> Callable[[str], Any]:
    """Return a module's ``__getattr__``, which imports moved names from their new modules and warns the caller."""

    def moved_name(name: str) -> Any:
        new = FAMILIES[module].get(name)
        if new is None:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        warnings.warn(f"{module}.{name} has moved to {new}.", DeprecationWarning, stacklevel=2)
        return getattr(import_module(new), name)

    return moved_name
