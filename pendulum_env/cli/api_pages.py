"""Web pages of the API, made by pdoc: ``python -m pendulum_env.cli.api_pages out/api`` writes them.

Each module in PAGES has a page. The page shows the names in the module's ``__all__``, or without one the public names
that the module defines. Docstrings are Markdown with roles such as :func:`pendulum_env.rollout` and Google's sections.
"""

from __future__ import annotations

import ast
import inspect
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, get_type_hints

from pendulum_env.physics.units import SceneError

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
"""Modules that have a page, in the order of the index."""
WITH_EXTRAS: Mapping[str, str] = {"pendulum_env.jax": "jax"}
"""Further modules that have a page where a package of an extra is installed, and the package."""

USAGE = "Name the folder for the pages, as in: python -m pendulum_env.cli.api_pages out/api"
OF = r"(?:numpy\.|typing\.)?(\w+)"
ARRAY = re.compile(
    rf"numpy\.ndarray\[(?:tuple\[typing\.Any, \.\.\.\]|typing\.Any), numpy\.dtype\[{OF}\]\]|\bNDArray\[{OF}\]")
"""The type of an array as Python prints it, with any version of NumPy."""
UNION = re.compile(r"^(?:typing\.)?Union\[(.*)\]$")
LONGEST = 200
"""Of a dictionary whose text is longer than this, pages show the keys alone."""
EMPTY = '<main class="pdoc"></main>'
"""The middle of the first page as pdoc writes it."""


def write_pages(folder: Path, pages: Sequence[str] | None = None) -> list[Path]:
    """Write the API's HTML pages and a search index; return the paths of the modules' pages.

    There is one page for each module, by default all of PAGES and those of installed extras, and a first page.

    Raises SceneError where pdoc is not installed, OutputError where the folder cannot be written.
    """
    from pendulum_env.common.provenance import output_folder
    from pendulum_env.common.version import software

    try:
        import pdoc
    except ImportError:
        raise SceneError("The pages are made by pdoc, which is missing: pip install 'lab-pendulum[docs]'.") from None

    if pages is None:
        pages = (*PAGES, *(name for name, package in WITH_EXTRAS.items() if find_spec(package)))
    place = output_folder(folder)
    pdoc.render.configure(docformat="google", footer_text=software())
    modules = {name: pdoc.doc.Module(resolved(name)) for name in pages}
    for module in modules.values():
        for entry in entries(module):
            entry.docstring = (entry.docstring or inherited(entry)).replace("::\n", ":\n")
            if entry.kind == "function":
                entry.signature = short_signature(entry.signature)
            if entry.kind == "class":
                entry.bases = [(home, name, short_types(words)) for home, name, words in entry.bases]
            if entry.kind == "variable":
                entry.annotation_str = short_types(entry.annotation_str)
                entry.default_value_str = short_types(entry.default_value_str)
                if isinstance(value := entry.default_value, Mapping) and len(entry.default_value_str) > LONGEST:
                    entry.default_value_str = f"{{{', '.join(map(repr, value))}}}"
    written = []
    for name, module in modules.items():
        written.append(place / f"{name.replace('.', '/')}.html")
        written[-1].parent.mkdir(parents=True, exist_ok=True)
        written[-1].write_text(pdoc.render.html_module(module, modules), encoding="utf-8")
    contents = "\n".join(["# lab-pendulum", "", *(
        f"- [{name}]({name.replace('.', '/')}.html): {module.docstring.partition(chr(10))[0]}"
        for name, module in modules.items())])
    first = f'<main class="pdoc">{pdoc.render_helpers.to_html(contents)}</main>'
    index = pdoc.render.html_index(modules).replace(EMPTY, first)
    (place / "index.html").write_text(index, encoding="utf-8")
    (place / "search.js").write_text(pdoc.render.search_index(modules), encoding="utf-8")
    return written


def resolved(name: str) -> Any:
    """Import a module and resolve its lazy names and the types of its named tuples, which pdoc cannot do."""
    module = import_module(name)
    for public in getattr(module, "__all__", ()):
        vars(module).setdefault(public, getattr(module, public))
    for value in list(vars(module).values()):
        if inspect.isclass(value) and issubclass(value, tuple) and hasattr(value, "_fields"):
            value.__new__.__annotations__ = get_type_hints(value)
    return module


def entries(namespace: Any) -> Iterator[Any]:
    """Yield a pdoc module or class and all its members, without submodules."""
    yield namespace
    for member in getattr(namespace, "own_members", ()):
        if member.kind != "module":
            yield from entries(member)


class ShortType:
    """A type annotation that prints as a given text, for signatures in the web pages."""

    def __init__(self, text: str) -> None:
        self.text = text

    def __repr__(self) -> str:
        return self.text


def short_types(text: str) -> str:
    """Return a text with the types of arrays written as NDArray[...] and ArrayLike, as in the source code."""
    from numpy.typing import ArrayLike

    for written in (inspect.formatannotation(ArrayLike), repr(ArrayLike)):  # by itself, and within another type
        inner = UNION.sub(r"\1", written)
        named = re.sub(rf"\b(?:typing\.)?Union\[{re.escape(inner)}(, NoneType)?\]",
                       lambda match: "ArrayLike | None" if match[1] else "ArrayLike", text)
        text = named.replace(inner, "ArrayLike")
    return ARRAY.sub(lambda match: f"NDArray[{match[1] or match[2]}]", text)


def short_signature(signature: inspect.Signature) -> inspect.Signature:
    """Return a signature with the types of arrays written as NDArray[...] and ArrayLike."""
    def short(annotation: Any) -> Any:
        text = short_types(long := inspect.formatannotation(annotation))
        return annotation if text == long else ShortType(text)

    parameters = [one.replace(annotation=short(one.annotation)) for one in signature.parameters.values()]
    return signature.replace(parameters=parameters, return_annotation=short(signature.return_annotation))


def inherited(entry: Any) -> str:
    """Return the description of a pdoc entry that has no docstring.

    It comes from the metadata of a dataclass's field, from a base class, or from the module that a constant comes from.
    """
    *classes, name = entry.qualname.split(".")
    if not classes:
        return constant(sys.modules[entry.modulename], name) if entry.kind == "variable" else ""
    owner = vars(sys.modules[entry.modulename]).get(classes[0])
    field = getattr(owner, "__dataclass_fields__", {}).get(name)
    if field is None or not field.metadata:
        return attribute(owner, name)
    unit = field.metadata.get("unit", "")
    return sentence(field.metadata.get("doc", "") + (f" [{unit}]" if unit not in ("", "1") else ""))


def attribute(owner: Any, name: str) -> str:
    """Return the description of an attribute from the docstrings of a class's base classes; "" where none describes it.
    """
    item = re.compile(rf"^ {{4}}(?:\w+, )*{name}(?:, \w+)*: (.+(?:\n {{8}}.*)*)", re.MULTILINE)
    for base in getattr(owner, "__mro__", ())[1:]:
        if match := item.search(inspect.getdoc(base) or ""):
            return sentence(inspect.cleandoc(f"\n        {match[1]}"))
    return ""


def sentence(text: str) -> str:
    """Return a text with a capital at its beginning and a full stop at its end."""
    return text[:1].upper() + text[1:].rstrip(".") + "." if text else ""


def constant(module: Any, name: str) -> str:
    """Return the docstring of a constant that a module imports from another module; "" where there is none."""
    import pdoc

    for node in ast.walk(ast.parse(inspect.getsource(module))):
        if isinstance(node, ast.ImportFrom) and name in (alias.name for alias in node.names):
            origin = import_module("." * node.level + (node.module or ""), module.__package__)
            return str(pdoc.doc.Module(origin).members[name].docstring)
    return ""


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(USAGE)
    print(f"Wrote {len(write_pages(Path(sys.argv[1])))} pages to {sys.argv[1]}; begin with index.html.")
