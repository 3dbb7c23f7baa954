"""What users write, names, sources, equations and docstrings, is data in every text that is generated."""

from __future__ import annotations

import ast
import re
import subprocess
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass, replace
from html import unescape
from pathlib import Path
from typing import Any

import pytest

import integrators
from integrators.families.runge_kutta import RungeKutta
from integrators.steps.terms import docstring
from pendulum_env import Scene, rollout
from pendulum_env.engine.code import code
from pendulum_env.engine.generate import program
from pendulum_env.engine.javascript import javascript
from pendulum_env.physics.effects import Effect, Gravity
from pendulum_env.physics.equation import equation_mathml, equation_text
from pendulum_env.physics.units import SceneError
from pendulum_env.web import document

TEXTS = (
    'Smith 2001, "On methods"', 'three """ of them', 'at the end"', '"', "it's ''' so", "a \\ b \\n \\u00zz \\",
    "two\nlines\n@inline\ndef step(): pass", "def step(t): return step(t)", "*/ alert(1) /*", "// x",
    "</script><script>alert(1)</script><!--", "{} {0} {x} {{y}} {own_rate!r:zz} {", "100 % %s %(a)s %",
    "tab\t nul\0 cr\r esc\x1b sep\u2028 half\ud800 é", "$x^2$ \\frac{a}{b} & # _ ~ ^ | ( ) ) |theta",
    "a_ b__c _d a_bc ' ^",
)
"""Texts that would end a literal, a comment, a script, a formula or a template."""


def pull(angle: float, own_rate: float) -> float:
    return -own_rate*angle


def energy(angle: float, own_rate: float) -> float:
    return 0.5*own_rate*angle*angle


def scene_with(text: str, name: str = "own", coefficient: str = "own_rate", memory: tuple[str, ...] = ()) -> Scene:
    @dataclass(frozen=True)
    class Own(Effect):
        """A spring."""

        def coefficients(self, scene: Any) -> Mapping[str, float]:
            return {"own_rate": 2.5, coefficient: 2.5}

    values = {"name": name, "kind": "conservative", "periodic": False, "equation": f"- {{own_rate:.3g}} theta {text}",
              "source": text, "__doc__": text, "torque": staticmethod(pull), "potential": staticmethod(energy),
              "memory": memory}
    for key, value in values.items():
        setattr(Own, key, value)
    return Scene("own", effects=(Gravity(), Own()))


def method_with(text: str) -> RungeKutta:
    heun = integrators.get("heun")
    assert isinstance(heun, RungeKutta)
    return replace(heun, name="own_heun", source=text, summary=text, aliases=())


PLAIN = scene_with("x")


@pytest.mark.parametrize("text", TEXTS)
def test_a_docstring_holds_any_text(text: str) -> None:
    source = f"def f():\n    {docstring(text)}\n"
    source.encode()  # no halves of pairs
    found = ast.parse(source)
    assert len(found.body) == 1
    node = found.body[0]
    assert isinstance(node, ast.FunctionDef)
    assert ast.get_docstring(node, clean=False) == text


@pytest.mark.quick("Smith 2001, \"On methods\"", "at the end\"", "100 % %s %(a)s %")
@pytest.mark.parametrize("text", TEXTS)
def test_programs_move_as_without_the_text(text: str) -> None:
    scene, method = scene_with(text), method_with(text)
    given: dict[str, Any] = {"duration": 0.1, "backend": "python"}
    for angle in (0.4, [0.4, -0.2]):
        found = rollout(scene, integrator=method, angle=angle, **given)
        assert found.angle.tolist() == rollout(PLAIN, integrator="heun", angle=angle, **given).angle.tolist()
    plain, usual = (ast.parse(code(*pair)) for pair in ((scene, method), (PLAIN, "heun")))
    assert ast.dump(plain) == ast.dump(usual)  # the text is in comments


@pytest.mark.slow
def test_javascript_and_pages_hold_any_text(tmp_path: Path) -> None:
    """Node reads every module, which throws unless it prints one number; pages have as many scripts as without."""
    for number, text in enumerate(TEXTS):
        module = javascript(program(scene_with(text), method_with(text)))
        (tmp_path / f"{number}.mjs").write_text(module, encoding="utf-8")
    methods = [replace(method_with(text), name=f"own_{i}") for i, text in enumerate(TEXTS)]
    usual, page = document.page(["vacuum"], ["heun"]), document.page(["vacuum"], methods)
    assert all(f"own {i}" in page for i in range(len(TEXTS)))
    for mark in ("<script", "</script", "<!--"):
        assert page.lower().count(mark) == usual.lower().count(mark)
    lines = [f"import * as m{i} from './{i}.mjs'; if (typeof m{i}.run !== 'function') throw 1;"
             for i in range(len(TEXTS))]
    (tmp_path / "all.mjs").write_text("\n".join([*lines, "console.log(1)"]))
    done = subprocess.run(["node", "all.mjs"], cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False)
    assert (done.stdout, done.stderr) == ("1\n", "")


@pytest.mark.quick("Smith 2001, \"On methods\"", "at the end\"", "100 % %s %(a)s %", "a_ b__c _d a_bc ' ^")
@pytest.mark.parametrize("text", TEXTS)
def test_equations_are_latex_and_mathml(text: str) -> None:
    """Matplotlib's parser reads the LaTeX, except for \\&, which it does not know; an XML parser reads the MathML."""
    from matplotlib.mathtext import MathTextParser

    scene = scene_with(text)
    assert scene.equation().isprintable()
    MathTextParser("path").parse(f"${scene.equation(True)}$".replace(r"\&", "&"))
    made = equation_mathml(scene.equation())
    ET.fromstring(re.sub(r"&\w+;", lambda found: found[0] if found[0] in ("&lt;", "&gt;", "&amp;", "&quot;") else
                         unescape(found[0]), made))
    assert "<script" not in scene._repr_html_().lower()
    assert "<script" not in method_with(text)._repr_html_().lower()


def test_braces_are_coefficients_or_text() -> None:
    scene = scene_with("{own_rate} {{own_rate}} {other:.3f} {own_rate:.1f} {own_rate:q} {}")
    assert scene.equation().endswith("2.5 theta 2.5 {own_rate} {other:.3f} 2.5 {own_rate:q} {}")
    assert equation_text(scene.effects).endswith("own_rate theta own_rate {own_rate} other own_rate own_rate {}")


@pytest.mark.parametrize("name", ["", "own rate", 'a"b', "2nd", "lambda", "a-b", "a\nb", None, "</script>"])
def test_names_in_programs_must_be_names(name: Any) -> None:
    with pytest.raises(SceneError, match="The name of the effect Own must be a name in Python, such as cubic_drag"):
        scene_with("x", name=name)
    with pytest.raises(SceneError, match="The name of a coefficient of own must be a name in Python"):
        scene_with("x", coefficient=name)
    with pytest.raises(SceneError, match="A name in the memory of own must be a name in Python"):
        scene_with("x", memory=(name,))
    if name not in ("own rate", 'a"b', "2nd", "lambda", "a-b", "</script>"):
        with pytest.raises(integrators.MethodError, match="A method's name must be one line of printable text, not "):
            replace(method_with("x"), name=name)
