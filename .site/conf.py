"""Sphinx's settings, and how it reads this project's docstrings."""

from __future__ import annotations

import re
import sys
import textwrap
from dataclasses import MISSING
from typing import Any

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from generated import MOCKED
from sphinx.application import Sphinx
from sphinx.errors import PycodeError
from sphinx.pycode import ModuleAnalyzer

import pendulum_env

project = "LabPendulum"
release = pendulum_env.__version__
html_title = "LabPendulum"
copyright = f"the authors of LabPendulum, MIT licence; version {release}"
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
html_theme = "furo"
html_css_files = ["site.css"]
html_copy_source = False
html_math_renderer = "mathml"
default_role = "code"
smartquotes = False
toc_object_entries = False  # names have headings; with entries, every page takes a second
suppress_warnings = ["ref.python"]  # of names in types that two classes have
python_maximum_signature_line_length = 88
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
autodoc_mock_imports = MOCKED
napoleon_numpy_docstring = False
napoleon_use_ivar = True
myst_heading_anchors = 4
myst_enable_extensions = ["dollarmath"]
nb_execution_mode = "force"
nb_execution_timeout = 600
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_ipywidgets_js: dict[str, Any] = {}
nb_mime_priority_overrides = [("html", "application/vnd.jupyter.widget-view+json", None)]
nb_merge_streams = True


def read_docstring(app: Sphinx, what: str, name: str, value: Any, options: Any, lines: list[str]) -> None:
    """Turn the Markdown in a docstring into what Sphinx reads; a constant says what stands below it in its module."""
    if what == "data":
        lines[:] = constant(name.rpartition(".")[2], value)
    text, found = "\n".join(lines), list[str]()
    if text.startswith("## Description"):  # of an environment, which has a page of its own
        text = text.split("\n\n")[1] + "\n\nSee :doc:`/environments/index`."
    text = "".join(part if i % 2 else re.sub(r"([*|])|(?<=\w)(_)(?=\W|$)", r"\\\g<0>", part)
                   for i, part in enumerate(re.split(r"(```.+?```|``.+?``|`[^`]+`_?)", text, flags=re.S)))
    text = re.sub(r"^```(\w+)\n(.*?)\n```$", lambda block: f".. code-block:: {block[1]}\n\n" + textwrap.indent(
        block[2], "    "), text, flags=re.S | re.M)
    before = ""
    for line in text.split("\n"):
        if re.match(r"\s*(- |\\\* )", line) and before.strip() and not re.match(r"\s*(- |\\\* |  )", before):
            found.append("")
        found.append(re.sub(r"^(\s*)\\\* ", r"\1* ", line))
        before = line
    lines[:] = [*found, *(settings(value) if what in ("class", "exception") else ())]


def settings(value: Any) -> list[str]:
    """Return the table of a class's fields that say of themselves what they mean."""
    fields = [each for each in getattr(value, "__dataclass_fields__", {}).values() if each.metadata.get("doc")]
    if not fields:
        return []
    found = ["", ".. list-table::", "   :header-rows: 1", "", "   * - setting", "     - default", "     - meaning"]
    for each in fields:
        given = each.default is not MISSING and not each.metadata.get("optional")
        unit = each.metadata.get("unit", "1")
        meaning = re.sub(r"([*|`_\\])", r"\\\1", each.metadata["doc"]) + (f" [{unit}]" if unit not in ("", "1") else "")
        found += [f"   * - ``{each.name}``", f"     - {f'``{each.default!r}``' if given else '-'}", f"     - {meaning}"]
    return [*found, ""]


def constant(name: str, value: Any) -> list[str]:
    """Return the lines below a constant in the module that defines it."""
    for module, contents in list(sys.modules.items()):
        if module.startswith(("pendulum_env", "integrators")) and vars(contents).get(name) is value:
            try:
                found = ModuleAnalyzer.for_module(module).find_attr_docs()
            except PycodeError:
                continue
            if ("", name) in found:
                return list(found["", name])
    return []


def show_math(translator: Any, node: nodes.Element) -> None:
    """Write a formula as MathML, which browsers show without a script."""
    block = isinstance(node, nodes.math_block)
    translator.body.append(tex2mathml(node.astext(), as_block=block))
    raise nodes.SkipNode


def setup(app: Sphinx) -> None:
    """Register what is above."""
    app.connect("autodoc-process-docstring", read_docstring, priority=100)
    app.add_html_math_renderer("mathml", (show_math, None), (show_math, None))
