"""The API pages are built without a warning and show all public names, no private ones, and readable docstrings."""

from __future__ import annotations

import html
import importlib.util
import inspect
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from beside import environment
from check_all import check_all
from keyword_table import ROOMS
from numpy.typing import ArrayLike, NDArray
from readme_code import ROOT, only

import pendulum_env
from pendulum_env import plots
from pendulum_env.cli import api_pages
from pendulum_env.cli.api_pages import PAGES, resolved, short_signature, short_types
from pendulum_env.physics.units import SceneError


def test_every_room_has_a_page() -> None:
    assert {room.__name__ for room in (*ROOMS.values(), plots)} <= set(PAGES)
    assert len(set(PAGES)) == len(PAGES)


def test_lazy_names_are_resolved() -> None:
    assert set(pendulum_env.__all__) <= set(vars(resolved("pendulum_env")))
    assert vars(pendulum_env)["rollout"] is pendulum_env.rollout


def test_types_of_named_tuples_are_in_place() -> None:
    """The types of a named tuple's fields are resolved, as pdoc would warn of names that it cannot find."""
    types = resolved("pendulum_env.films.record").Filmed.__new__.__annotations__
    assert types == {"path": Path, "stopped": dict[str, str]}


def test_types_of_arrays_are_short() -> None:
    text = str(short_signature(inspect.signature(resolved_types))).replace("bool_", "bool")
    assert text == ("(a: NDArray[float64] | None, *, b: tuple[NDArray[bool], int] = (), c: ArrayLike, "
                    "d: ArrayLike | None = None) -> NDArray[Any]")
    assert short_types("numpy.ndarray[typing.Any, numpy.dtype[numpy.float64]]") == "NDArray[float64]"
    assert short_types("dict[str, NDArray[numpy.float64]]") == "dict[str, NDArray[float64]]"


def resolved_types(a: Any, *, b: Any = (), c: Any, d: Any = None) -> Any: ...


resolved_types.__annotations__ = {
    "a": NDArray[np.float64] | None, "b": tuple[NDArray[np.bool_], int], "c": ArrayLike, "d": ArrayLike | None,
    "return": NDArray[Any]}


def test_a_missing_tool_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pdoc", None)
    with pytest.raises(SceneError, match=r"pdoc, which is missing: pip install 'lab-pendulum\[docs\]'"):
        api_pages.write_pages(tmp_path / "api")
    assert not (tmp_path / "api").exists()


def test_readme_names_the_command() -> None:
    assert only("(python -m pendulum_env.cli.api_pages out/api)", "the command")


@pytest.fixture(scope="session")
def python(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Return a Python that has this environment's packages and those of the extra ``docs``."""
    if importlib.util.find_spec("pdoc"):
        return sys.executable
    (wanted,) = re.findall(r'^docs = \["(.+)"\]', (ROOT / "pyproject.toml").read_text(encoding="utf-8"), flags=re.M)
    return str(environment(tmp_path_factory, "docs", wanted))


@pytest.fixture(scope="module")
def pages(python: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pages")
    words = [python, "-W", "error", "-W", "ignore::DeprecationWarning", "-m", "pendulum_env.cli.api_pages"]
    done = subprocess.run([*words, str(folder / "api")], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert done.stdout.startswith(f"Wrote {len(PAGES)} pages")
    return folder / "api"


def text_of(pages: Path, name: str) -> str:
    return (pages / f"{name.replace('.', '/')}.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_pages_have_all_public_names_and_no_private_ones(pages: Path) -> None:
    def check(name: str) -> None:
        shown = re.findall(r'<section id="([^"]+)"', text_of(pages, name))
        rooms = {"adapters", "controllers", "tasks", "testing", "web"}
        assert set(getattr(import_module(name), "__all__", ())) - rooms <= set(shown)
        assert shown
        assert not [one for one in shown if any(re.match(r"_(?!_init__$)", part) for part in one.split("."))]

    check_all(PAGES, check)


@pytest.mark.slow
def test_docstrings_are_rendered_as_they_are_meant(pages: Path) -> None:
    """No role, double backtick or stray emphasis is visible, and a role that names an object on a page is a link."""
    def check(docstring: str) -> None:
        text = html.unescape(re.sub(r"<[^>]+>", "", docstring))
        assert not re.search(r":(func|class|data|mod|meth|attr|exc):|``", text), text
        assert "<em>" not in docstring, text
        assert r"\*" not in text, text
        assert r"\<" not in text, text
        assert "::\n" not in text, text
        for target in re.findall(r"<code>((?:pendulum_env|integrators)\.[\w.]+)(?:\(\))?</code>", docstring):
            module, _, last = target.rpartition(".")
            public = module in PAGES and last in getattr(import_module(module), "__all__", ())
            assert not public, f"{target} is no link"

    check_all([docstring for name in PAGES for docstring in re.findall(
        r'<div class="docstring">(.*?)</div>', text_of(pages, name), flags=re.S)], check)


@pytest.mark.slow
def test_fields_have_their_units_and_constants_their_words(pages: Path) -> None:
    text = html.unescape(re.sub(r"<[^>]+>", "", text_of(pages, "pendulum_env")))
    assert "Integrator's step [s]." in text
    assert "The scenes that come with the package, by name." in text
    assert "mappingproxy" not in text
    assert "numpy.ndarray[" not in text
    assert "numpy._typing" not in text
    assert "NDArray[float64]" in text
    assert 'href="pendulum_env/physics/effects.html' in text_of(pages, "pendulum_env")


@pytest.mark.slow
def test_the_first_page_lists_every_module_with_its_first_sentence(pages: Path) -> None:
    (main,) = re.findall(r"<main.*?</main>", (pages / "index.html").read_text(encoding="utf-8"), flags=re.S)
    entries = re.findall(r'<li><a href="([^"]+)">(.+?)</a>: (.+?)</li>', main, flags=re.S)
    assert [name for _, name, _ in entries] == list(PAGES)
    assert all((pages / link).exists() for link, _, _ in entries)
    sentences = {name: html.unescape(re.sub(r"<[^>]+>", "", text)) for _, name, text in entries}
    assert sentences["pendulum_env"] == (pendulum_env.__doc__ or "").partition("\n")[0]
