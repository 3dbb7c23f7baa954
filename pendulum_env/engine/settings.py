"""Settings of runs, each declared once, as a field of a frozen dataclass.

A field carries the default, the unit and the range of a setting, its meaning and, where it is not plain, its form in
JSON (:func:`pendulum_env.physics.units.setting`). From the fields come the signatures of environments (:func:`taking`),
the checks, the docstrings (:func:`documented`), the tables in READMEs and, by :func:`meaning`, the help of options.
"""

from __future__ import annotations

import inspect
import math
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import Field, dataclass, field, fields
from functools import wraps
from typing import Any, TypeVar, get_type_hints

from integrators import Method
from integrators.solving.equal import MOST_STEPS
from pendulum_env.engine.kernels import BACKENDS, Backend
from pendulum_env.engine.machine import DIAGNOSTICS, check_diagnostics
from pendulum_env.physics.damping import Damping
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import Checked, count, flag, setting, si

S = TypeVar("S")
SceneLike = str | Scene | Mapping[str, object]
"""Preset name, Scene, or scene as a dict."""
WIDTH = 120
"""Width of docstrings [characters]."""


@dataclass(frozen=True, kw_only=True, repr=False, eq=False)
class CommonSettings(Checked):
    """Settings that all functions with ``**parameters`` take beside a scene's parameters."""

    warn: bool = flag(True, "False turns off the warnings before a run and at its end")
    careful: bool = flag(False, "True raises a SceneError in place of a warning before a run")


@dataclass(frozen=True, repr=False, eq=False)
class FirstSetting(Checked):
    """The one setting that may be given without its name."""

    scene: SceneLike = setting("lab", "preset name, dict, Scene, or a scene's JSON file")


@dataclass(frozen=True, kw_only=True, repr=False, eq=False)
class SceneSettings(FirstSetting):
    """Settings of a run that the package and its twin in JAX have; and the scene's parameters by name."""

    integrator: str | Method | None = setting("rk4", "name of a method (lab-pendulum list), or a Method")
    damping: Damping = setting(
        "scene", 'losses in place of the scene\'s: "none", names as "linear+quadratic", or with numbers, as '
        '{"linear": {"gamma": 0.1}}')
    dt: float | None = si(None, "s", "the integrator's step", above=0.0, optional=True,
                          note="None for that of the scene's usual run")
    substeps: int = count(1, "the integrator's steps in a control step", MOST_STEPS,
                          note="the state of a lagging motor or of gusts changes once per control step")
    diagnostics: Sequence[str] = setting(
        ("energy",), "quantities computed beside the motion", lambda names, _: check_diagnostics(names),
        allowed=DIAGNOSTICS, note="() for none")
    speed_limit: Any = setting(math.inf, "|velocity| that ends a run", unit="rad/s", note="the speed is never clipped")
    parameters: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, repr=False, eq=False, kw_only=True)
class RunSettings(CommonSettings, SceneSettings):
    """Settings of a run that :func:`pendulum_env.rollout` and the environments share."""

    backend: Backend = setting("auto", "how the programs are run; all give the same bits", allowed=BACKENDS)
    rtol: float | None = setting(
        None, "relative tolerance, for a method that estimates its error, such as \"dop853\"",
        note="every step of the integrator is then divided so that the error of each part is below atol + rtol |y|")
    atol: float | None = setting(None, "absolute tolerance", unit="rad, rad/s", note="None for the number of rtol")
    compensated: bool = setting(
        False, "compensated summation, which carries the rounding error of each sum over to the next",
        note="info then has lost_angle and lost_velocity; not with rtol")


def declared(settings: type) -> Iterator[Field[Any]]:
    """Yield the fields of a class of settings that declare one."""
    return (entry for entry in fields(settings) if "doc" in entry.metadata)


def meaning(entry: Field[Any]) -> str:
    """Return what a setting means, with its unit, range, allowed words and note, for help texts."""
    about = entry.metadata
    unit, words = about.get("unit", "1"), about.get("allowed", ())
    limits = getattr(about.get("check"), "keywords", {})
    said = about["doc"] + (f" [{unit}]" if unit != "1" else "")
    said += f": {', '.join(words)}" if words and words != ("true", "false") else ""
    for end, text in (("above", "above"), ("least", "at least")):
        said += f", {text} {limits[end]:g}" if limits.get(end) is not None else ""
    return f"{said}; {about['note']}" if about["note"] else said


def described(settings: type, beside: type = object, form: str = "- `{name}` ({default!r})", hang: int = 2) -> str:
    """Return one paragraph ``name (default): meaning`` for each setting that another class does not declare alike.

    ``form`` is what stands before the meaning, ``hang`` the indentation of the lines after the first.
    """
    known = {} if beside is object else {entry.name: entry.metadata for entry in declared(beside)}
    return "\n".join(
        textwrap.fill(f"{form.format(name=entry.name, default=entry.default)}: {meaning(entry)}", WIDTH - 8,
                      subsequent_indent=" " * hang)
        for entry in declared(settings) if known.get(entry.name) != entry.metadata)


def documented(entry: Any, **texts: str) -> None:
    """Put texts in place of the lines ``{name}`` in the docstring of a class or function, at their indentation."""
    def filled(line: str) -> str:
        name = line.strip().strip("{}")
        return textwrap.indent(texts[name], line.partition("{")[0]) if line.strip() == f"{{{name}}}" else line

    entry.__doc__ = "\n".join(map(filled, (inspect.getdoc(entry) or "").split("\n")))


def signature_of(settings: type) -> inspect.Signature:
    """Return the signature of a method that takes settings as keywords, and ``**parameters``."""
    kinds, types = inspect.Parameter, get_type_hints(settings)
    own = [one.replace(annotation=types[one.name]) for one in inspect.signature(settings).parameters.values()]
    return inspect.Signature([
        kinds("self", kinds.POSITIONAL_OR_KEYWORD), *(one for one in own if one.name != "parameters"),
        kinds("parameters", kinds.VAR_KEYWORD, annotation=Any)])


def taking(settings: Callable[..., S]) -> Callable[[Callable[[Any, S], None]], Callable[..., None]]:
    """Return a decorator by which an ``__init__`` takes the fields of a class of settings as keywords.

    All other keywords are the scene's parameters. Type checkers see ``(...)``; ``help``, notebooks, and editors that
    ask the running program see the signature.
    """
    assert isinstance(settings, type)
    known = {entry.name for entry in fields(settings)} - {"parameters"}

    def decorated(begin: Callable[[Any, S], None]) -> Callable[..., None]:
        @wraps(begin)
        def init(self: Any, *given: Any, **keywords: Any) -> None:
            parameters = {name: keywords.pop(name) for name in [*keywords] if name not in known}
            begin(self, settings(*given, **keywords, parameters=parameters))

        init.__signature__ = signature_of(settings)  # type: ignore[attr-defined]
        return init

    return decorated
