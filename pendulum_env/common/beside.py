"""The package ``integrators``, installed beside ``pendulum_env``: whether ``import integrators`` finds it."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

OWN = Path(__file__).parents[2] / "integrators" / "__init__.py"
"""First file of our package ``integrators``; wheels and checkouts hold the two packages side by side."""
REINSTALL = "reinstall ours: pip install --force-reinstall --no-deps lab-pendulum"


def import_fault() -> str:
    """Return a sentence that says why ``import integrators`` finds no or another package, with the remedy; else "".

    Nothing is imported. A user's file of that name may come first in ``sys.path``; a distribution of that name may have
    overwritten our files or, when it was uninstalled, deleted them.
    """
    if not Path(__file__).is_file():  # in an archive or a frozen program there are no files to compare
        return ""
    if not OWN.is_file():
        return f"{OWN}, a file of lab-pendulum, is missing, as after another 'integrators' was uninstalled; {REINSTALL}"
    if b"from integrators.registry import" not in OWN.read_bytes():
        return f"{OWN} belongs to another distribution named 'integrators'; uninstall that one, then {REINSTALL}"
    try:
        spec = find_spec("integrators")
    except ValueError:  # a program made a module of that name itself
        return "The program made a module 'integrators' itself, which hides that of lab-pendulum; rename it."
    place = Path(spec.origin) if spec is not None and spec.origin else OWN
    if place.is_file() and place.samefile(OWN):
        return ""
    place = place.parent if place.name == OWN.name else place
    installed = place.parent.name in ("site-packages", "dist-packages")
    remedy = ("uninstall the distribution that it belongs to" if installed else
              f"rename it, for example to my_{place.name}, and in your imports too")
    return f"{place} hides the package 'integrators' of lab-pendulum, because Python looks there first; {remedy}."
