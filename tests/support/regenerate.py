"""Add new methods, scenes, effects and tasks to the tables in READMEs and to the facts that tests have stored.

``python tests/support/regenerate.py`` adds; it changes nothing that is there. If a row, a digest or a picture has to
change, delete it first, by hand, so that the change shows in the commit; the command then makes it anew.
"""

from __future__ import annotations

import json
import math
import re
import sys
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import guard
import matplotlib
from choice import chosen
from coefficients import COEFFICIENTS, checked, digest
from leading_error_truths import LEADING_ERRORS
from readme_code import PATHS, ROOT, listed
from same_bits import GROUPS
from same_bits import STORED as DIGESTS
from splitting_truths import TRUTHS
from step_limit_truths import DRAG_LIMIT, OSCILLATOR_LIMIT
from stored import ENTRIES

from integrators import METHODS
from integrators.tables.limits import LIMITS
from pendulum_env import SCENES
from pendulum_env.engine.machine import fitting
from pendulum_env.physics.effects import EFFECTS
from pendulum_env.study.lists.methods import computed_limits
from pendulum_env.tasks import TASKS

LIMITS_FILE = ROOT / "integrators" / "tables" / "limits.py"
FIGURE_TESTS = ROOT / "tests" / "plots"
CONTRACT = ROOT / "tests" / "integrators"
TABLE = re.compile(r"(?<=<!-- list )(\w+)( -->\n\n)(.*?)(?=\n\n<!-- end -->)", flags=re.S)
"""A table in a README: its name, the rest of its mark, its rows."""

Names = dict[str, list[str]]


class RefusedError(Exception):
    """An entry that is stored would have to change."""


def texts() -> dict[Path, str]:
    """Return the new texts of all READMEs, tables of entries included."""
    return {path: TABLE.sub(lambda found, path=path: table(path, found), path.read_text(encoding="utf-8"))
            for path in PATHS}


def table(path: Path, found: re.Match[str]) -> str:
    """Return a table with its mark; RefusedError if a row that is there is not in the new one."""
    rows = listed(found[1]).markdown()
    for row in found[3].splitlines():
        if row not in rows.splitlines():
            raise RefusedError(f"The row '{row[:60]}...' in {path.relative_to(ROOT)} is not what the package says now; "
                               "delete it there if that is meant.")
    return f"{found[1]}{found[2]}{rows}"


def entries() -> Names:
    """Return entries.json with new names at the end of its lists; RefusedError for a stored name that is gone."""
    now: dict[str, Iterable[str]] = {
        "methods": METHODS, "scenes": SCENES, "effects": EFFECTS, "tasks": TASKS,
        "leading_errors": [name for name in METHODS if name in LEADING_ERRORS or name in TRUTHS],
        "step_limits": [name for name in METHODS if name in OSCILLATOR_LIMIT and name in DRAG_LIMIT],
    }
    kept: Names = json.loads(ENTRIES.read_text(encoding="utf-8")) if ENTRIES.exists() else {}
    for kind, names in kept.items():
        for name in names:
            if name not in now[kind]:
                raise RefusedError(f"'{name}' is gone from {kind}; delete it in tests/entries.json if that is meant.")
    return {kind: list(dict.fromkeys([*kept.get(kind, ()), *names])) for kind, names in now.items()}


def limits() -> str:
    """Return limits.py with the limits of new methods; RefusedError for a method that is gone, or for other limits."""
    if gone := LIMITS.keys() - METHODS.keys():
        raise RefusedError(f"'{min(gone)}' is gone from METHODS; delete it in {LIMITS_FILE.relative_to(ROOT)}.")
    rows = {}
    for name, method in METHODS.items():
        found = computed_limits(method)
        rows[name] = LIMITS.get(name, found)
        if not all(map(alike, rows[name], found)):
            raise RefusedError(f"The limits of '{name}' in {LIMITS_FILE.relative_to(ROOT)} are {rows[name]}, and now "
                               f"{found} is computed; delete that line if this is meant.")
    head, _, rest = LIMITS_FILE.read_text(encoding="utf-8").partition("= {\n")
    lines = (f'    "{name}": ({one!r}, {other!r}),\n' for name, (one, other) in rows.items())
    return f"{head}= {{\n{''.join(lines)}}}\n{rest.partition('}' + chr(10))[2]}"


def alike(one: float | None, other: float | None) -> bool:
    """Return True for limits that agree to 1e-9: the last digits of roots are those of a machine's linear algebra."""
    return one == other if one is None or other is None else math.isclose(one, other, rel_tol=1e-9)


def digests() -> dict[str, Any]:
    """Return same_bits.json with a sample of each method and each scene; those that are there stay."""
    kept = json.loads(DIGESTS.read_text(encoding="utf-8"))
    for group in ("motion", "environment"):
        have = kept["digests"][group]
        methods = {sample.split("/")[1] for sample in have}
        wanted = [f"{chosen([name for name in SCENES if method in fitting(SCENES[name])], method)}/{method}"
                  for method in METHODS if method not in methods]
        wanted += [f"{scene}/rk4" for scene in SCENES]
        run: Callable[[str], str] = next(iter(GROUPS[group].values()))
        have |= {sample: run(sample) for sample in wanted if sample not in have}
    return kept


def coefficients() -> str:
    """Return coefficients.json with the digests of new methods, whose order conditions must hold."""
    sys.path.insert(0, str(CONTRACT))
    from test_integrators_contract import check_dense_conditions, check_order_conditions

    kept = checked() if COEFFICIENTS.exists() else {}
    for name, method in METHODS.items():
        if name not in kept:
            check_order_conditions(method)
            check_dense_conditions(method)
        if kept.setdefault(name, digest(method)) != digest(method):
            raise RefusedError(f"The coefficients of '{name}' are not those whose order conditions were checked; "
                               f"delete its line in {COEFFICIENTS.relative_to(ROOT)} if that is meant.")
    if gone := kept.keys() - METHODS.keys():
        raise RefusedError(f"'{min(gone)}' is gone from METHODS; delete it in {COEFFICIENTS.relative_to(ROOT)}.")
    return json.dumps(kept, indent=1) + "\n"


def pictures() -> tuple[Path, str]:
    """Return where coarse pictures of figures are stored, and them as text, with those of new functions."""
    sys.path.insert(0, str(FIGURE_TESTS))
    from test_figures import PICTURED, PICTURES, coarse

    kept = json.loads(PICTURES.read_text(encoding="utf-8"))
    missing = [name for name in PICTURED if name not in kept["pictures"]]
    if missing and matplotlib.__version__.rpartition(".")[0] != kept["matplotlib"]:
        raise RefusedError(f"Pictures are of matplotlib {kept['matplotlib']}, which has to draw {missing[0]}, too.")
    kept["pictures"] |= {name: coarse(name).tolist() for name in missing}
    return PICTURES, re.sub(r' ("[a-z_]+\.)', r"\n\1", json.dumps(kept)) + "\n" if missing else PICTURES.read_text()


def main() -> int:
    """Write what is new, everything or nothing; the exit code is 1, with a sentence, if an entry would change."""
    warnings.simplefilter("ignore")
    try:
        made = {**texts(), ENTRIES: json.dumps(entries(), indent=1) + "\n"}
        made[COEFFICIENTS] = coefficients()
        made[LIMITS_FILE] = limits()
        made |= [pictures()]
        made[DIGESTS] = json.dumps(digests(), indent=1) + "\n"
        made[guard.STORED] = json.dumps(guard.with_new(), indent=1) + "\n"
    except RefusedError as error:
        print(error, file=sys.stderr)
        return 1
    for path, text in made.items():
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
            print(f"{path.relative_to(ROOT)} has new entries.")
    return 0


if __name__ == "__main__":
    sys.exit(main())
