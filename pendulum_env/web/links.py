"""Links of the page: the whole state of a run as the part of an address behind "#", and the run that it describes."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any
from urllib.parse import unquote

from integrators import get
from pendulum_env.engine.spec import RunSpec
from pendulum_env.engine.starts import checked_steps
from pendulum_env.physics.presets import SCENES
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, one_of, shown
from pendulum_env.web.formulas import explicit, settings_of, with_settings

VERSION = "1"
"""Version of the form of links; a link of another version is refused."""
MOST_PENDULUMS = 4
"""Largest number of pendulums side by side."""
NUMBER_FORM = r"[+-]?([0-9]+[.]?[0-9]*|[.][0-9]+)([eE][+-]?[0-9]+)?"
"""Numbers in links, for Python's and JavaScript's regular expressions: no spaces, no 0x10, no 1_0, no nan."""
SHORTEST, LONGEST = 1e-6, 10.0
"""Smallest and largest step of a link [s]."""
USUAL_DURATION = 10.0
"""Length of a run whose link does not say how long it is [s]."""
START = ("angle", "velocity")
"""Entries of a link that are the start [rad, rad/s]."""


def read_link(text: str, pendulum: int = 1) -> RunSpec:
    """Return the run that a link of the page describes.

    ``pendulum_env.engine.rollout.run(read_link(text))`` computes the bits that the page showed, unless the motor's
    torque was changed during the run: as many whole steps as end by the link's ``time``, at least one.

    Args:
        text: the address, or only the part behind "#", such as ``v=1&scene=lab&methods=rk4:0.01,heun:0.02``, then
            ``angle`` [rad], ``velocity`` [rad/s], ``time`` [s], ``control`` (share of the motor's
            torque), and numbers of the scene in SI units, such as ``body.length=0.4`` or ``effects.1.gamma=0.02``.
            Start and numbers are those of all pendulums; ``2.body.length=0.5`` is that of the second one alone.
        pendulum: which of the pendulums side by side, counted from 1.

    Raises SceneError for a link of another version, an unknown entry, scene or number, with the nearest known name, and
    MethodError for a method that does not fit the scene.
    """
    if not isinstance(text, str):
        raise SceneError(f"A link must be text, not {shown(text)}.")
    pairs = [part.partition("=") for part in text.rpartition("#")[2].split("&") if part]
    entries = {decoded(name): decoded(value) for name, _, value in pairs}
    if len(entries) < len(pairs):
        raise SceneError("The link gives an entry twice.")
    if entries.pop("v", None) != VERSION:
        raise SceneError(f"The link does not begin with v={VERSION}; it is of another version, or no link of the page.")
    scene = explicit(SCENES[one_of(entries.pop("scene", ""), "scene", SCENES)])
    methods = [part.rpartition(":") for part in entries.pop("methods", "").split(",")]
    if not 1 <= len(methods) <= MOST_PENDULUMS or not all(name for name, _, _ in methods):
        raise SceneError(f"A link needs methods=, 1 to {MOST_PENDULUMS} methods with their steps, as in rk4:0.01.")
    if pendulum not in range(1, len(methods) + 1):
        raise SceneError(f"pendulum must be from 1 to {len(methods)}, as many as the link has, not {shown(pendulum)}.")
    name, _, step = methods[pendulum - 1]
    time, control = (number_in(entries.pop(entry, str(usual)), entry) for entry, usual in (
        ("time", USUAL_DURATION), ("control", 0.0)))
    every = [_of_one(entries, k, len(methods)) for k in range(len(methods) + 1)]  # first what all share
    for own in every:  # a link is wrong as a whole, whichever of its pendulums is wrong
        with_numbers(scene, {name: number for name, number in own.items() if name not in START})
    numbers = {**dict(zip(START, (scene.run.angle, scene.run.velocity), strict=True)), **every[pendulum]}
    angle, velocity = (numbers.pop(entry) for entry in START)
    time, dt = max(time, 0.0), number_in(step, f"the step of {name}")
    if not SHORTEST <= dt <= LONGEST:
        raise SceneError(f"In the link, the step of {name} must be from {SHORTEST:g} to {LONGEST:g} s, "
                         f"not {shown(step)}.")
    if not abs(control) <= 1.0 or (control and not scene.has("motor")):
        raise SceneError("In the link, control must be from -1 to 1, in a scene with a motor.")
    changed = with_numbers(scene, numbers)
    checked_steps(time, dt)
    steps = max(1, math.floor(time / dt + 1e-9))
    return RunSpec.of(changed, name, angle=angle, velocity=velocity, dt=dt, duration=steps * dt, control=control,
                      warn=False)


def link_of(
    scene: str, integrators: Sequence[str], *, angle: float | None = None, velocity: float | None = None,
    dt: float | None = None, **numbers: float,
) -> str:
    """Return the link, from "v=" on, of a scene with methods and a start.

    Args:
        scene: name of a preset.
        integrators: names of one to four methods.
        angle, velocity, dt: start [rad, rad/s] and step [s]; by default those of the scene's usual run.
        numbers: numbers of the scene by name, such as ``length=0.4`` or ``gamma=0.02``.

    Raises SceneError and MethodError as :func:`read_link` does.
    """
    place = explicit(SCENES[one_of(scene, "scene", SCENES)])
    usual, settings = place.run, {setting.label: setting for setting in settings_of(place)}
    step = usual.dt if dt is None else dt
    entries: dict[str, Any] = {
        "v": VERSION, "scene": scene, "methods": ",".join(f"{get(name).name}:{step!r}" for name in integrators),
        "angle": usual.angle if angle is None else float(angle),
        "velocity": usual.velocity if velocity is None else float(velocity),
        **{settings[one_of(name, "number of the scene", settings)].name: float(value)
           for name, value in numbers.items()},
    }
    text = "&".join(f"{name}={value}" for name, value in entries.items())
    for pendulum in range(1, max(1, len(integrators)) + 1):
        read_link(text, pendulum)
    return text


def _of_one(entries: dict[str, str], pendulum: int, count: int) -> dict[str, float]:
    """Return the start and the numbers of one of ``count`` pendulums: its own, and those of all that it has not."""
    shared, own = {}, {}
    for entry, text in entries.items():
        whose, dot, name = entry.partition(".")
        if not (dot and re.fullmatch("[1-9]", whose) and int(whose) <= count):
            shared[entry] = number_in(text, entry)
        elif int(whose) == pendulum:
            own[name] = number_in(text, entry)
    return shared | own


def decoded(part: str) -> str:
    """Return a part of a link with its percent signs read, as in %20; SceneError where one stands for no character."""
    try:
        if not re.search("%(?![0-9a-fA-F]{2})", part):
            return unquote(part, errors="strict")
    except UnicodeDecodeError:
        pass
    raise SceneError(f"In the link, {shown(part)} is no part of an address: a percent sign is written %25.")


def with_numbers(scene: Scene, numbers: dict[str, float]) -> Scene:
    """Return a scene with other values of the numbers named; SceneError for an unknown name, with the nearest."""
    settings = settings_of(scene)
    known = {setting.name: setting for setting in settings}
    for name in numbers:
        one_of(name, "number of the scene", known)
    return with_settings(scene, settings, [numbers.get(setting.name, setting.value) for setting in settings])


def number_in(text: str, name: str) -> float:
    """Return the finite number that a link's entry gives; SceneError for any other text."""
    value = float(text) if re.fullmatch(NUMBER_FORM, text) else math.nan
    if not math.isfinite(value):
        raise SceneError(f"In the link, {name} must be a finite number, not {shown(text)}.")
    return value
