"""The API as web pages, by pdoc: ``python -m pendulum_env.cli.api_pages out/api`` writes them.

Pages are those of PAGES. On them is what a module's ``__all__`` names, or what it defines, but for names that begin
with an underscore. Docstrings are plain text with ``code``, roles such as :func:`pendulum_env.rollout`, and Google's
sections.
"""

from __future__ import annotations

import ast
import inspect
import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib import import_module
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any, get_type_hints

from pendulum_env.physics.units import SceneError

PAGES = (
    "pendulum_env",
    "pendulum_env.controllers",
    "pendulum_env.lab",
    "pendulum_env.lab.fitting.result",
    "pendulum_env.study.fit_report",
    "pendulum_env.plots",
    "pendulum_env.render",
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
    "pendulum_env.engine.certificate",
    "pendulum_env.engine.code",
    "pendulum_env.engine.result",
    "pendulum_env.engine.rollout",
    "pendulum_env.study.audit.study",
    "pendulum_env.study.compare",
    "pendulum_env.study.cost.study",
    "pendulum_env.study.growth.study",
    "pendulum_env.hard_cases.run",
    "pendulum_env.films.record",
    "pendulum_env.truth.answer",
    "pendulum_env.truth.reference",
    "pendulum_env.study.stability",
    "pendulum_env.study.sweep.study",
    "pendulum_env.study.audit.verdicts",
    "pendulum_env.tasks",
    "integrators",
    "integrators.analysis",
    "integrators.steps.compensated",
    "integrators.solving.dense",
    "integrators.analysis.linear",
    "integrators.method",
    "integrators.families.taylor",
)
"""Modules that have a page, in the order of the index."""

USAGE = "Name the folder for the pages, as in: python -m pendulum_env.cli.api_pages out/api"
CODE = re.compile(r"(``.+?``|`[^`]+`)", re.DOTALL)
SECTION = re.compile(r"[A-Z][A-Za-z ]+:$")
SPECIAL = re.compile(r"([*<])")
"""Marks that Markdown would take as its own outside code."""
OF = r"(?:numpy\.|typing\.)?(\w+)"
ARRAY = re.compile(
    rf"numpy\.ndarray\[(?:tuple\[typing\.Any, \.\.\.\]|typing\.Any), numpy\.dtype\[{OF}\]\]|\bNDArray\[{OF}\]")
"""An array's type, as one NumPy or another makes Python write it."""
UNION = re.compile(r"^(?:typing\.)?Union\[(.*)\]$")
LONGEST = 200
"""Longer values of tables are shown by their keys."""


def write_pages(folder: Path, pages: Sequence[str] = PAGES) -> list[Path]:
    """Write one HTML page for each module, an index and what their search needs; return the pages' paths.

    Raises SceneError where pdoc is not installed, OutputError where the folder cannot be written.
    """
    from pendulum_env.common.provenance import output_folder
    from pendulum_env.common.version import __version__

    try:
        import pdoc
    except ImportError:
        raise SceneError("The pages are made by pdoc, which is missing: pip install 'lab-pendulum[docs]'.") from None

    place = output_folder(folder)
    pdoc.render.configure(docformat="google", footer_text=f"lab-pendulum {__version__}")
    modules = {name: pdoc.doc.Module(resolved(name)) for name in pages}
    for module in modules.values():
        for entry in entries(module):
            entry.docstring = plain(entry.docstring or said_elsewhere(entry))
            if entry.kind == "function":
                entry.signature = in_short(entry.signature)
            if entry.kind == "class":
                entry.bases = [(home, name, shortened(words)) for home, name, words in entry.bases]
            if entry.kind == "variable":
                entry.annotation_str = shortened(entry.annotation_str)
                entry.default_value_str = shortened(entry.default_value_str)
                if isinstance(value := entry.default_value, Mapping) and len(entry.default_value_str) > LONGEST:
                    entry.default_value_str = f"{{{', '.join(map(repr, value))}}}"
    written = []
    for name, module in modules.items():
        written.append(place / f"{name.replace('.', '/')}.html")
        written[-1].parent.mkdir(parents=True, exist_ok=True)
        written[-1].write_text(pdoc.render.html_module(module, modules), encoding="utf-8")
    (place / "index.html").write_text(pdoc.render.html_index(modules), encoding="utf-8")
    (place / "search.js").write_text(pdoc.render.search_index(modules), encoding="utf-8")
    return written


def resolved(name: str) -> Any:
    """A module with its lazy names and its named tuples' types in place, which pdoc does not find by itself."""
    module = import_module(name)
    for public in getattr(module, "__all__", ()):
        vars(module).setdefault(public, getattr(module, public))
    for value in list(vars(module).values()):
        if inspect.isclass(value) and issubclass(value, tuple) and hasattr(value, "_fields"):
            value.__new__.__annotations__ = get_type_hints(value)
    return module


def entries(namespace: Any) -> Iterator[Any]:
    """A pdoc module or class, and all that is in it."""
    yield namespace
    for member in getattr(namespace, "own_members", ()):
        if member.kind != "module":
            yield from entries(member)


class Words:
    """A type in words of its own."""

    def __init__(self, words: str) -> None:
        self.words = words

    def __repr__(self) -> str:
        return self.words


def shortened(text: str) -> str:
    """The types in a text, arrays and what makes them by the names that code has for them."""
    from numpy.typing import ArrayLike

    inner = UNION.sub(r"\1", inspect.formatannotation(ArrayLike))
    named = re.sub(rf"\b(?:typing\.)?Union\[{re.escape(inner)}(, NoneType)?\]",
                   lambda found: "ArrayLike | None" if found[1] else "ArrayLike", text)
    return ARRAY.sub(lambda found: f"NDArray[{found[1] or found[2]}]", named.replace(inner, "ArrayLike"))


def in_short(signature: inspect.Signature) -> inspect.Signature:
    """The same with the types of arrays shortened."""
    def words(annotation: Any) -> Any:
        short = shortened(long := inspect.formatannotation(annotation))
        return annotation if short == long else Words(short)

    parts = [one.replace(annotation=words(one.annotation)) for one in signature.parameters.values()]
    return signature.replace(parameters=parts, return_annotation=words(signature.return_annotation))


def said_elsewhere(entry: Any) -> str:
    """What is said elsewhere of an entry without a docstring: a field's metadata, a base class, where it is defined."""
    *classes, name = entry.qualname.split(".")
    if not classes:
        return constant(sys.modules[entry.modulename], name) if entry.kind == "variable" else ""
    owner = vars(sys.modules[entry.modulename]).get(classes[0])
    field = getattr(owner, "__dataclass_fields__", {}).get(name)
    if field is None or not field.metadata:
        return attribute(owner, name)
    unit = field.metadata.get("unit", "")
    said = field.metadata.get("doc", "") + (f" [{unit}]" if unit not in ("", "1") else "")
    return sentence(said)


def attribute(owner: Any, name: str) -> str:
    """What the classes that a class is of say of an attribute, in a section of their docstrings."""
    item = re.compile(rf"^ {{4}}(?:\w+, )*{name}(?:, \w+)*: (.+(?:\n {{8}}.*)*)", re.MULTILINE)
    for base in getattr(owner, "__mro__", ())[1:]:
        if match := item.search(inspect.getdoc(base) or ""):
            return sentence(inspect.cleandoc(f"\n        {match[1]}"))
    return ""


def sentence(said: str) -> str:
    """A few words as a sentence."""
    return said[:1].upper() + said[1:].rstrip(".") + "." if said else ""


def constant(module: Any, name: str) -> str:
    """The docstring of a constant that a module has from another one; "" where there is none."""
    import pdoc

    for node in ast.walk(ast.parse(inspect.getsource(module))):
        if isinstance(node, ast.ImportFrom) and name in (alias.name for alias in node.names):
            origin = import_module("." * node.level + (node.module or ""), module.__package__)
            return str(pdoc.doc.Module(origin).members[name].docstring)
    return ""


def plain(docstring: str) -> str:
    """A docstring in which Markdown finds no marks of its own: stars and angles outside code are taken as they are."""
    blocks = groupby(_marked(docstring.replace("::\n", ":\n").split("\n")), key=itemgetter(0))
    return "\n".join(text if code else _escaped(text) for code, lines in blocks
                     for text in ["\n".join(line for _, line in lines)])


def _marked(lines: Iterable[str]) -> Iterator[tuple[bool, str]]:
    """Lines, and whether they are code: set in, but not below a section's head, or typed into Python."""
    section = False
    for line in lines:
        if line and not line[0].isspace():
            section = bool(SECTION.match(line))
        yield line.startswith(">>> ") or (line.startswith("    ") and not section), line


def _escaped(text: str) -> str:
    return "".join(part if i % 2 else SPECIAL.sub(r"\\\1", part) for i, part in enumerate(CODE.split(text)))


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(USAGE)
    print(f"Wrote {len(write_pages(Path(sys.argv[1])))} pages to {sys.argv[1]}; begin with index.html.")
