"""The page: one HTML file that computes scenes and methods in the browser, to the bits of Python, and asks for nothing.

It holds the generated programs as JavaScript, deflated, the formulas of their parameters, and a checksum of what each
of them computes in Python, with which the page compares its own numbers.
"""

from __future__ import annotations

import base64
import inspect
import json
import math
import re
import zlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, fields
from html import escape
from os import PathLike
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from integrators import METHODS, Method, analysis, get
from pendulum_env.common.languages import tables
from pendulum_env.common.progress import Progress, told_by, with_bar
from pendulum_env.common.replacing import replacing
from pendulum_env.common.version import software
from pendulum_env.engine.generate import program
from pendulum_env.engine.javascript import javascript, translated
from pendulum_env.engine.machine import Machine, fitting, offers
from pendulum_env.engine.random_streams import Streams
from pendulum_env.engine.shape import STOP_REASONS
from pendulum_env.engine.spec import RunSpec
from pendulum_env.engine.wrap import half_turns, without_half_turns
from pendulum_env.physics.equation import equation_mathml, equation_text
from pendulum_env.physics.presets import PURPOSES, SCENES
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, one_of
from pendulum_env.render.palette import ENERGY_COLOURS, METHOD_COLOURS, THEMES, Theme, hue, place
from pendulum_env.web.formulas import NumberSetting, explicit, formulas_of
from pendulum_env.web.links import LONGEST, MOST_PENDULUMS, NUMBER_FORM, SHORTEST, VERSION

ASSETS = Path(__file__).with_name("assets")
"""Folder of the page's layout, styles and scripts."""
SCRIPTS = ("machine.js", "elements.js", "languages.js", "drawing.js", "measuring.js", "plots.js",
           "recording.js", "lab.js")
"""Scripts of the page, in the order in which they stand in it."""
SHOWN_SCENES = ("exercise", "exercise_large", "lab", "vacuum", "driven", "chaotic", "kapitza")
"""Scenes of the page, unless others are asked for."""
SHOWN_METHODS = ("forward_euler", "backward_euler", "symplectic_euler", "velocity_verlet", "rk4", "dop853", "gauss4",
                 "yoshida6a", "kahan_li8", "discrete_gradient", "taylor")
"""Methods of the page, unless others are asked for."""
ACCURATE = ("exact", "taylor", "dop853", "rk4")
"""Methods of the accurate solution; the first that fits a scene is taken."""
FIRST = ("forward_euler", "backward_euler", "symplectic_euler")
"""Methods that the page shows first, in the first scene."""
MOST_READINGS = 3000
"""Largest number of readings of a recording that the page holds."""
TORQUES, STEPS = (0.0, 0.5, -1.0, 0.25, 1.0, -0.125), 40
"""The check of a program: shares of the motor's torque, a call of its function each, and steps in a call."""
NUMBER = 1.10001
"""First of the numbers that mark the places of coefficients while an equation is written."""
DESCRIBED = {
    "diverged": "its energy is absurd, its numbers are no longer finite, or an implicit step had no solution; with "
                "shorter steps it lasts longer",
    "slack": "the wire is slack, and the bob would fly freely; begin at a smaller angle, or take a scene with a rod",
    "step_too_short": "no step is short enough",
}
"""Stop reason -> what the page says of it."""


class TimedAngles(Protocol):
    """Arrays of time [s] and angle [rad] of one length."""

    time: Any
    angle: Any


@with_bar("web page")
def write(
    path: str | PathLike[str], scenes: Iterable[str] | None = None, integrators: Iterable[str | Method] | None = None,
    *, recording: TimedAngles | None = None, progress: Progress | bool | None = None,
) -> Path:
    """Write the page and return its path.

    Args:
        path: the file, which ends in ".html".
        scenes: names of presets; None: SHOWN_SCENES.
        integrators: names of methods; None: SHOWN_METHODS. A scene offers those that fit it.
        recording: a :class:`pendulum_env.Recording`, or another object with arrays ``time`` [s] and ``angle`` [rad],
            which is drawn over the angles.
        progress: True shows a progress bar, False none; by default a notebook shows one. A function is called with the
            fraction done and the present activity.

    An older file at the path is replaced only by a complete one. Raises SceneError for unknown scenes or another
    ending, MethodError for unknown methods, OSError where the file cannot be written.
    """
    target = Path(path)
    if target.suffix != ".html":
        raise SceneError(f"The page's name must end in .html, not {target.name!r}.")
    with replacing(target) as part:
        part.write_text(page(scenes, integrators, recording=recording, tell=told_by(progress)), encoding="utf-8")
    return target


def page(
    scenes: Iterable[str] | None = None, integrators: Iterable[str | Method] | None = None, *,
    recording: TimedAngles | None = None, tell: Progress = lambda done, text: None,
) -> str:
    """Return the page's HTML; the arguments are those of :func:`write`.

    Raises SceneError for unknown scenes, MethodError for unknown methods.
    """
    shown = SHOWN_SCENES if scenes is None else tuple(dict.fromkeys(scenes))
    methods = list(dict.fromkeys(map(method_named, SHOWN_METHODS if integrators is None else integrators)))
    if not shown or not methods:
        raise SceneError("The page needs at least one scene and one method.")
    chosen = {name: explicit(SCENES[one_of(name, "scene", SCENES)]) for name in shown}
    texts: dict[str, int] = {}
    scene_data = {}
    for i, (name, scene) in enumerate(chosen.items()):
        tell(i / len(chosen), name)
        scene_data[name] = scene_of(scene, methods, texts)
    data: dict[str, Any] = {
        "version": VERSION, "software": software(), "most": MOST_PENDULUMS, "scenes": scene_data,
        "methods": {method.name: method_of(method) for method in methods},
        "aliases": {alias: method.name for method in methods for alias in method.aliases},
        "number": NUMBER_FORM, "shortest": SHORTEST, "longest": LONGEST,
        "stops": {code: DESCRIBED.get(name, name) for code, name in STOP_REASONS.items()},
        "first": [name for name in FIRST if name in {method.name for method in methods}] or [methods[0].name],
        "texts": {code: words["page"] for code, words in tables().items() if "page" in words},
        "recording": None if recording is None else readings(recording),
        "check": {"torques": TORQUES, "steps": STEPS},
    }
    programs = json.dumps(list(texts), ensure_ascii=True)
    packed = base64.b64encode(zlib.compress(programs.encode(), 9)).decode()
    read = {name: (ASSETS / name).read_text(encoding="utf-8") for name in ("lab.html", "page.css", "lab.css", *SCRIPTS)}
    parts = {
        "style": f"{variables()}\n{read['page.css']}{read['lab.css']}",
        "script": "\n".join([*(translated(inspect.getsource(one)) for one in (half_turns, without_half_turns)),
                             *(read[name] for name in SCRIPTS)]),
        "data": json.dumps(data, ensure_ascii=True, allow_nan=False).replace("<", "\\u003c"),
        "programs": packed,
        "software": escape(data["software"]),
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], read["lab.html"])


def readings(recording: TimedAngles) -> list[list[float]]:
    """Return times [s] from the first reading on and angles [degrees] of a recording, at most MOST_READINGS of each."""
    every = max(1, math.ceil(len(recording.time) / MOST_READINGS))
    time, angle = (np.asarray(values, dtype=float)[::every] for values in (recording.time, recording.angle))
    return [np.round(time - time[0], 6).tolist(), np.round(np.degrees(angle), 6).tolist()]


def method_named(name: str | Method) -> Method:
    """Return the method of this name; MethodError for an unknown one, with the nearest."""
    return name if isinstance(name, Method) else get(name)


# --- scenes and methods -----------------------------------------------------------------------------------------------


def scene_of(scene: Scene, methods: Sequence[Method], texts: dict[str, int]) -> dict[str, Any]:
    """Return what the page needs of a scene; new programs are added to ``texts``, text -> its number."""
    fits = set(fitting(scene))
    offered = offers(scene)
    shown = [method for method in methods if method.needs <= offered]
    if not shown:
        raise SceneError(f"None of the methods fits the scene '{scene.name}'; there are {', '.join(sorted(fits))}.")
    accurate = next(name for name in ACCURATE if name in fits)
    programs = {}
    for method in dict.fromkeys([*shown, get(accurate)]):
        text = javascript(program(scene, method, ("energy",), False, False))
        programs[method.name] = {"program": texts.setdefault(text, len(texts)), **run_of(scene, method)}
    formulas = formulas_of(scene, {name for one in programs.values() for name in one["numbers"]})
    names = list(formulas.results)
    kinds = {effect.name: effect.kind for effect in scene.effects}
    beat = next((effect.beat for effect in scene.effects if effect.beat), "")
    return {
        "about": PURPOSES[scene.name],
        "equation": equation(scene), "programs": programs, "shown": [method.name for method in shown],
        "accurate": accurate, "settings": [setting(one, kinds) for one in formulas.settings], "names": names,
        "formulas": formulas.javascript(names), "beat": beat, "motor": any(e.name == "motor" for e in scene.effects),
        "periodic": scene.periodic, "run": asdict(scene.run),
        "radius": scene.body.radius, "reach": scene.body.reach, "suspension": scene.body.suspension,
        "outline": scene.body.outline,
    }


def run_of(scene: Scene, method: Method) -> dict[str, Any]:
    """Return what the page needs to run a scene's program with a method, and the checksum of its check."""
    machine = RunSpec.of(scene, method, backend="python", warn=False).machine()
    return {
        "numbers": list(machine.numbers), "parameters": [float(value) for value in machine.parameters],
        "names": list(machine.names), "start": started(machine)[6:], "sum": checksum(machine),
    }


def setting(one: NumberSetting, kinds: Mapping[str, str]) -> dict[str, Any]:
    """Return what the page needs of a number that can be set; ``kinds`` are those of the scene's effects."""
    return {
        "name": one.name, "label": one.label.replace("_", " "), "about": one.about, "value": one.value,
        "unit": one.unit.replace("^2", "²").replace("^3", "³"), "least": None if math.isinf(one.least) else one.least,
        "exclusive": one.exclusive, "effect": one.effect.replace("_", " "), "kind": kinds.get(one.effect, ""),
    }


def method_of(method: Method) -> dict[str, Any]:
    """Return what the page needs of a method."""
    try:
        limit = float(analysis.stability_limit(method))
    except (ValueError, NotImplementedError):
        limit = math.inf
    return {
        "title": titled(method.name), "order": "exact" if method.order is None else str(method.order),
        "summary": method.summary, "source": method.source, "limit": limit if math.isfinite(limit) else None,
        "hue": hue(place(method.name, list(METHODS)))[0],
    }


def titled(name: str) -> str:
    """Return a method's name as people write it, such as "forward Euler"."""
    return re.sub("euler|verlet|gauss|taylor|yoshida|kahan|simpson|lobatto|radau", lambda found: found[0].capitalize(),
                  name.replace("_", " "))


def started(machine: Machine) -> list[float]:
    """Return the state at the start of the scene's usual run, with the random numbers of seed 0."""
    streams = Streams((0,))
    drawn = [float(streams.uniform(np.arange(1))[0]) for _ in machine.drawn]
    run = machine.scene.run
    return [float(value) for value in machine.state(run.angle, run.velocity, drawn)]


def checksum(machine: Machine) -> int:
    """Return the CRC-32 of the bits of all states in a short run, interpreted in Python: energies and sums included."""
    state, total = started(machine), 0
    for torque in TORQUES:
        rows = np.zeros((STEPS + 1, len(state)))
        code = machine.entry(state, machine.parameters, torque, machine.scene.run.dt, STEPS, 1, math.inf, rows,
                             [0.0, 0.0, 0.0])
        total = zlib.crc32(np.vstack([rows, state]).astype("<f8").tobytes() + bytes([int(code)]), total)
    return total


def equation(scene: Scene) -> str:
    """Return the equation of motion as MathML; elements with ``data-number`` take the values of coefficients."""
    numbers = {name: NUMBER + 0.00011 * i for i, name in enumerate(scene.coefficients)}
    text = equation_mathml(equation_text(scene.effects, numbers))
    for name, value in numbers.items():
        text = text.replace(f"<mn>{value:.6g}</mn>", f'<mn data-number="{name}"></mn>')
    return text


# --- colours ----------------------------------------------------------------------------------------------------------


def variables() -> str:
    """Return the colours of frames and figures as variables of CSS, for light and dark."""
    light, dark = (_variables(THEMES[name]) for name in ("light", "dark"))
    return (f":root {{\n{light}\n}}\n"
            f"@media screen and (prefers-color-scheme: dark) {{\n:root:not(.paper) {{\n{dark}\n}}\n}}")


def _variables(theme: Theme) -> str:
    own = {field.name: getattr(theme, field.name) for field in fields(theme)}
    colours = {name: value for name, value in own.items() if isinstance(value, str) and value.startswith("#")}
    colours |= {f"energy_{name}": value for name, value in ENERGY_COLOURS.items()}
    colours |= {f"hue_{i}": theme.accent(value) for i, value in enumerate(METHOD_COLOURS)}
    return "\n".join(f"  --{name.replace('_', '-')}: {value};" for name, value in colours.items())


__all__ = ["SHOWN_METHODS", "SHOWN_SCENES", "page", "write"]
