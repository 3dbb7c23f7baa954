"""Options that several commands share, each declared once: name, short form, type, unit, help; and their conversion.

A command gives its parameter one of the types below, as in ``angle: options.Angle = None``, and receives the converted
value: radians, lists of names, folders that can be written. An option means the same in every command that has it.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Sequence
from dataclasses import Field
from importlib import import_module
from inspect import Parameter, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from pendulum_env.cli.console import bar
from pendulum_env.common.checks import shown, warn
from pendulum_env.common.provenance import checked_folder
from pendulum_env.physics.angles import SEE
from pendulum_env.physics.damping import build_scene, parse_damping, parse_settings, typed, typed_values
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, one_of

if TYPE_CHECKING:
    from pendulum_env.lab.recording import Recording

SIMULATED = "No recording is given, so the simulated one of the package is used."
"""Sentence of commands that take a recording, for a run without one."""
ROUND = 0.05
"""Largest distance from a multiple of 5 degrees of an angle that was rounded to two or more digits [degrees]."""


def option(text: str, *names: str, **more: Any) -> Any:
    """Return an option with a help text; its names, if others than that of the parameter, and more as typer has it."""
    return typer.Option(*names, help=text, **more)


def flag(text: str, name: str) -> Any:
    """Return an option that takes no value; its name is given, as typer would add its opposite, --no-name."""
    return typer.Option(name, help=text)


def number(text: str, **more: Any) -> Any:
    """Return an option for a number."""
    return typer.Option(help=text, parser=real, **more)


def count(text: str) -> Any:
    """Return an option for a whole number."""
    return typer.Option(help=text, parser=whole)


def word(text: str, *names: str) -> Any:
    """Return an option for a word in any case."""
    return typer.Option(*names, help=text, callback=lower)


def words(text: str, *names: str, **more: Any) -> Any:
    """Return an option for several words in any case, with commas, or with the option repeated."""
    return typer.Option(*names, help=f"{text}, with commas, or repeat the option.", callback=_split, **more)


def real(text: Any) -> float:
    """Return the number in the text of an option; raise typer's error, which quotes it, for another text."""
    try:
        return float(text)
    except ValueError:
        pointed = re.fullmatch(r"[+-]?\d+,\d+", text)
        remedy = f"; write {text.replace(',', '.')}" if pointed else ", as 0.5 is"
        raise typer.BadParameter(f"{shown(text)} is not a number{remedy}.") from None


def whole(text: Any) -> int:
    """Return the whole number in the text of an option; raise typer's error, which quotes it, for another text."""
    try:
        return int(text)
    except ValueError:
        raise typer.BadParameter(f"{shown(text)} is not a whole number, as 100 is.") from None


def lower(value: str | None) -> str | None:
    """Return a word in lower case."""
    return None if value is None else value.lower()


def _split(values: Sequence[str] | None) -> list[str] | None:
    """Return the names in texts with commas, in lower case; a text that is a file's path is one name, as it stands."""
    if not values:
        return None
    return [name for text in values for name in (
        [text] if os.path.isfile(text) else [_scene(part.strip()) for part in text.split(",")])]


def _scene(name: Any) -> Any:
    """Return a name in lower case; None, and the path of a scene's file, as they stand."""
    return name if name is None or name.endswith(".json") else name.lower()


def _folder(path: Path | None) -> Path | None:
    """Return a folder for files after checking that it can be written; it is made with the first file."""

    return None if path is None else checked_folder(path)


def _degrees(value: float | None) -> float | None:
    """Return an angle of the command line, in degrees, in radians.

    Warn if the number, taken as radians, is a multiple of 5 degrees, as 0.0873 is.
    """
    if value is None:
        return None
    meant = math.degrees(value)
    if abs(value) < math.tau and abs(meant - 5.0 * round(meant / 5.0)) < ROUND and abs(meant) > 1.0:
        near = 5 * round(meant / 5.0)
        warn(f"Angles on the command line are in degrees: {value:g} rad would be {near} degrees; {SEE}.")
    return math.radians(value)


def degrees(text: str) -> Any:
    """Return an option for an angle in degrees, which the command receives in radians."""
    return number(text, callback=_degrees)


def _names(module: str, registry: str) -> Callable[[str], list[str]]:
    """Return the function by which a shell completes the last of several names, those of a registry in a module."""
    def complete(incomplete: str) -> list[str]:
        start, comma, last = incomplete.rpartition(",")
        return [f"{start}{comma}{name}" for name in getattr(import_module(module), registry)
                if name.startswith(last.lower())]

    return complete


def completing(module: str, registry: str) -> dict[str, Any]:
    """Return the argument of an option by which a shell completes the names of a registry in a module."""
    return {"autocompletion": _names(module, registry)}


_SCENES = completing("pendulum_env.physics.presets", "SCENES")
_METHODS = completing("integrators", "METHODS")
_ONE = option("Preset (lab-pendulum list scenes) or a scene's JSON file.", callback=_scene, **_SCENES)
_SEVERAL = words("Presets (lab-pendulum list scenes) or JSON files", "--scene", **_SCENES)
_NAMES = words("Names of methods (lab-pendulum list integrators)", "--integrators", "-i", **_METHODS)
_ANGLE = number("Release angle in degrees; if no default is shown, the scene's.", callback=_degrees)
_OUT = option("Folder for the files.", "--out", "-o", callback=_folder)

SceneName = Annotated[str, _ONE]
SceneOrNone = Annotated[str | None, _ONE]
SceneNames = Annotated[list[str], _SEVERAL]
SceneNamesOrNone = Annotated[list[str] | None, _SEVERAL]
Integrators = Annotated[list[str], _NAMES]
IntegratorsOrNone = Annotated[list[str] | None, _NAMES]
Damping = Annotated[str, word("scene, none, linear, linear+quadratic, linear:gamma=0.1, ...")]
Settings = Annotated[list[str] | None, option("A scene's parameter, as in --set length=0.5.", "--set")]
Angle = Annotated[float, _ANGLE]
AngleOrNone = Annotated[float | None, _ANGLE]
Velocity = Annotated[float | None, number("Release velocity in rad/s; by default the scene's.")]
Step = Annotated[float | None, number("The integrator's step in s; by default the scene's.")]
Duration = Annotated[float | None, number("Length of the run in s; if no default is shown, the scene's.")]
Rtol = Annotated[float | None, number("Relative tolerance; adaptive methods choose their steps within dt.")]
Atol = Annotated[float | None, number("Absolute tolerance; by default equal to --rtol.")]
Out = Annotated[Path, _OUT]
OutOrNone = Annotated[Path | None, _OUT]
OutFile = Annotated[Path, option("The file.", "--out", "-o")]
Svg = Annotated[bool, flag("Also write figures as SVG.", "--svg")]
Json = Annotated[bool, flag("Print the result as JSON, and nothing else.", "--json")]
Film = Annotated[bool, option("Make the film.")]
Theme = Annotated[str, word("Colours of the frames: light or dark.")]
Panels = Annotated[
    list[str], words("Parts of the frames, any of apparatus, energy, history, phase, residual", "--panels")]
File = Annotated[Path | None, option("File of a sensor's recording of a free swing.")]
Reading = Annotated[
    list[str] | None,
    option("A keyword of Recording.read for the recording's file, as in --read scale=0.99.", "--read")]
Columns = Annotated[
    str | None, option("Columns to read, by number from 1 or by name, as time=2,angle=5; angle may be rate (angular "
                       "velocity), acceleration, or x and y of a track.")]
Until = Annotated[float | None, number("Time in the file, in s, after which readings are left out.")]
Above = Annotated[str | None, option("Share of the first amplitude, as 5%, below which swings are left out.")]
Drop = Annotated[
    list[str] | None, option("Times in the file, in s, between which readings are left out, as 12.5:13.1.")]
Browser = Annotated[bool, option("Open the page in the browser; without, only its address is printed.")]
Length = Annotated[float | None, number("Measured distance from pivot to bob's centre in m.")]
LengthError = Annotated[float | None, number("Error of the measured length in m.")]
Mass = Annotated[float | None, number("Mass of the bob in kg.")]
Radius = Annotated[float | None, number("Radius of the bob in m.")]
Period = Annotated[float | None, number("Period of small swings in s, measured by hand.")]
Amplitudes = Annotated[
    str | None, option("Amplitudes read by hand, as \"0:30, 1.42:29.4\" in s and degrees (0:10cm along a ruler, with "
                       "--length), or a file of times and amplitudes.")]
Oscillations = Annotated[
    int | None, count("Number of oscillations over which the period is measured; by default all.")]


def scene_of(scene: str, damping: str, settings: Sequence[str] | None) -> Scene:
    """Return the scene that the command-line options --scene, --damping and --set describe."""

    return build_scene(scene, parse_damping(damping), parse_settings(settings or ()))


def recording_of(file: Path | None, read: Sequence[str] | None, **options: Any) -> Recording:
    """Return the recording in a file, read with keywords of ``Recording.read`` from --read and from other options.

    A film is tracked, with keywords of :func:`pendulum_env.lab.track`. Raises SceneError for options without a file,
    for unknown keywords, with the nearest, and for a keyword given twice.
    """
    from inspect import signature

    from pendulum_env.lab.film import is_film, track
    from pendulum_env.lab.recording import Recording

    film = file is not None and is_film(file)
    more = typed_values(read or (), "--read", "scale=0.99")
    known = [name for name in signature(track if film else Recording.read).parameters if name not in OWN]
    words = given(**options)
    for name in words:
        if film and name not in known:
            raise SceneError(f"--{name} is for files of readings, and {file} is a film; leave it out.")
    for name, value in more.items():
        if one_of(name, "keyword of --read", known) in words:
            raise SceneError(f"{name} is given twice, by --{name} and by --read.")
        words[name] = marks().get(value, value)
    if isinstance(words.get("scale"), str):
        words["scale"] = quotient(words["scale"])
    words |= {name: parts(words[name]) for name in LISTS if isinstance(words.get(name), str)}
    if file is None:
        raise SceneError("--read needs a recording; give a file.")
    if film:
        with bar("track") as progress:
            return track(file, **words, progress=progress)
    return Recording.read(file, **words)


def one_method(names: Sequence[str]) -> str:
    """Return the one method that is named; SceneError for several."""

    if len(names) > 1:
        raise SceneError(f"This command runs one integrator, not {', '.join(names)}; name one.")
    return names[0]


def given(**values: Any) -> dict[str, Any]:
    """Return the options that were given, those that are not None."""
    return {name: value for name, value in values.items() if value is not None}


def given_by_user(context: typer.Context, *names: str) -> list[str]:
    """Return those of some parameters' options that were given on the command line, as --length-error or --no-film."""
    sources = {one: context.get_parameter_source(one.name) for one in context.command.params if one.name in names}
    typed = (one for one, source in sources.items() if source and source.name == "COMMANDLINE")
    return [max(one.secondary_opts if one.secondary_opts and context.params[one.name] is False else one.opts, key=len)
            for one in typed]


def of_setting(name: str, entry: Field[Any], text: str) -> Parameter:
    """Return the option of a setting, a field of a dataclass, as a parameter of a command; ``text`` is its help."""
    kind, names = str(entry.type), f"--{name.replace('_', '-')}"
    if "bool" in kind:
        return Parameter(name, Parameter.KEYWORD_ONLY, default=None,
                         annotation=Annotated[bool | None, option(text, f"{names}/--no-{names[2:]}")])
    metavar = next((f"<{word}>" for word in ("float", "int") if word in kind), "<str>")
    return Parameter(name, Parameter.KEYWORD_ONLY, default=None,
                     annotation=Annotated[str | None, option(text, names, metavar=metavar)])


def about(entry: Field[Any]) -> str:
    """Return the meaning, the words allowed, the unit and the default of a setting, for the help."""
    text, note, default = str(entry.metadata.get("doc", entry.name)), str(entry.metadata.get("note", "")), entry.default
    allowed = [named(word) for word in entry.metadata.get("allowed", ()) if "bool" not in str(entry.type)]
    unit = entry.metadata.get("unit", "1")
    text += f": {', '.join(allowed)}" if allowed else ""
    text = text.rstrip(",") + {"1": "", "rad": ", in degrees"}.get(unit, f", in {unit}")
    if default is None:
        return text + (f"; by default {note.removeprefix('None:').strip()}" if note else "")
    if isinstance(default, float):
        default = f"{math.degrees(default) if unit == 'rad' else default:.4g}"
    return f"{text}; by default {default}" + (f" ({note.replace('None:', 'none:')})" if note else "")


def value_of(name: str, entry: Field[Any], text: Any) -> object:
    """Return the value of a setting for the text of its option; angles are in degrees on the command line."""
    if isinstance(text, str) and text.lower() == "none" and entry.metadata.get("optional"):
        return None
    kind = str(entry.type)
    try:
        if "float" in kind:
            return math.radians(real(text)) if entry.metadata.get("unit") == "rad" else real(text)
        if "int" in kind:
            return whole(text)
    except typer.BadParameter as error:
        raise typer.BadParameter(str(error), param_hint=f"--{name.replace('_', '-')}") from None
    mark = marks().get(text, text)
    return mark if mark in entry.metadata.get("allowed", ()) else text


def complete(command: Callable[..., None], more: Sequence[Parameter]) -> None:
    """Give a command that takes ``**settings`` an option for each of them; typer reads the signature."""
    hints = get_type_hints(command, include_extras=True)
    own = [parameter.replace(annotation=hints[name], kind=Parameter.KEYWORD_ONLY)
           for name, parameter in signature(command).parameters.items()
           if parameter.kind is not Parameter.VAR_KEYWORD]
    parameters = [*own, *more]
    command.__signature__ = signature(command).replace(parameters=parameters)  # type: ignore[attr-defined]
    command.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}


def quotient(text: str) -> float | str:
    """Return the number that a text such as "360/4096" or "0.99" stands for; any other text unchanged."""
    try:
        above, _, below = text.partition("/")
        return float(above) / float(below or 1.0)
    except (ValueError, ZeroDivisionError):
        return text


LISTS = ("columns", "pivot", "bob")
"""Keywords of Recording.read and of track that take several values, separated by commas."""
OWN = ("path", "progress")
"""Parameters of these that are no options."""


def marks() -> dict[Any, str]:
    """Return separators and decimal marks by their names, such as "tab", as a tab cannot be typed as a value."""
    from pendulum_env.lab.table import DECIMALS, SEPARATORS

    return {name: mark for marks in (SEPARATORS, DECIMALS) for mark, name in marks.items()}


def named(word: str) -> str:
    """Return the name of a separator or decimal mark, and any other word as it stands."""
    return next((name for name, mark in marks().items() if mark == word), word)


def parts(value: Any) -> Any:
    """Return numbers and names separated by commas as a list, whole numbers as ints; other texts, such as
    "time=2,angle=5", unchanged."""

    if isinstance(value, str) and ("," not in value or "=" in value):
        return value
    parts = [typed(part) for part in str(value).split(",")]
    return [int(part) if isinstance(part, float) and part.is_integer() else part for part in parts]
