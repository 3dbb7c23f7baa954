"""The command ``lab-pendulum fit``, which fits a scene to a recording."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from pendulum_env.cli.console import bar, print_files, print_table, print_text, say
from pendulum_env.cli.options import Out, Reading, Settings, Svg, recording_of


def fit(
    files: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[FILE]...", help="Recording: a text file of times and angles, or of a track; by "
                       "default a simulated one. Several logs of driven runs are fitted together."),
    ] = None,
    effects: Annotated[
        str,
        typer.Option("--effects", "--damping", help="Dampings to fit, as quadratic+coulomb; auto tries all sums."),
    ] = "auto",
    scene: Annotated[
        str | None, typer.Option(help="Preset or JSON file of a scene with body and medium; by default a bob in air.")
    ] = None,
    length: Annotated[float | None, typer.Option(help="Measured distance from pivot to bob's centre, in m.")] = None,
    length_error: Annotated[
        float | None, typer.Option(help="Error of the measured length, in m; the fitted length is compared with it.")
    ] = None,
    mass: Annotated[float | None, typer.Option(help="Mass of the bob in kg.")] = None,
    radius: Annotated[float | None, typer.Option(help="Radius of the bob in m.")] = None,
    suspension: Annotated[str | None, typer.Option(help="Suspension of the bob: rod or wire.")] = None,
    free: Annotated[
        str | None,
        typer.Option(help="Parameters to fit besides damping: length (by default) or gravity, inertia or centre of a "
                     "measured body, the sensor's scale; '' for none.")
    ] = None,
    unit: Annotated[str | None, typer.Option(help="Unit of the angles: deg or rad; by default inferred.")] = None,
    rate: Annotated[float | None, typer.Option(help="Readings per second, in place of a column of times.")] = None,
    scale: Annotated[float | None, typer.Option(help="Factor for the file's angles, as 0.99.")] = None,
    oscillations: Annotated[
        int | None, typer.Option(help="Number of oscillations over which the period is measured; by default all.")
    ] = None,
    action: Annotated[
        str | None,
        typer.Option(help="Column of the action in logs of driven runs, by name or number; by default as titled.")
    ] = None,
    torque: Annotated[str | None, typer.Option(help="Column of the torque in logs of driven runs.")] = None,
    current: Annotated[str | None, typer.Option(help="Column of the motor's current in logs of driven runs.")] = None,
    svg: Svg = False,
    out: Out = Path("out/fit"),
    settings: Settings = None,
    read: Reading = None,
) -> None:
    """Fit a recording of a free swing: period and decay with errors, and the scene and damping that match it.

    Release and equilibrium are determined from the recording, and every inferred setting is printed. The quantities of
    the lab sheet are measured first: period, amplitudes, decay, length. Then the whole trajectory is fitted; with auto,
    by every damping. The report, the tables and scene.json, which gym.make and compare accept, are written to the
    output folder. Logs of driven runs, with an action, torque or current beside the angle, are fitted for motor,
    friction, delay and sensor.
    """
    from pendulum_env.cli.driven import fit_logs, is_driven_fit
    from pendulum_env.common.provenance import output_folder
    from pendulum_env.lab.fitting.fit import fit as run
    from pendulum_env.lab.recording import RecordingError
    from pendulum_env.lab.sheet import measure
    from pendulum_env.lab.simulated import FILE
    from pendulum_env.physics.units import SceneError, number
    from pendulum_env.study.fit_report import against_told, goodness, parameter_table, to_lay_over, write

    drive = {"action": action, "torque": torque, "current": current}
    if is_driven_fit(files or (), drive):
        fit_logs(files or (), drive, read or (), unit, {"mass": mass}, settings, out)
        return
    if files is not None and len(files) > 1:
        raise SceneError("Several files are fitted together only if they are logs of driven runs; give one recording.")
    file = files[0] if files else None
    options = {"length": length, "mass": mass, "radius": radius, "suspension": suspension}
    known = _known({name: value for name, value in options.items() if value is not None}, settings)
    if length_error is not None and "length" not in known:
        raise SceneError("--length-error needs --length; give the measured length.")
    if length_error is not None:
        number(length_error, "--length-error", above=0.0, unit="m")
    place = FILE if file is None else file
    data = recording_of(place, read, unit=unit, rate=rate, scale=scale)
    names = None if free is None else tuple(name for part in free.split(",") if (name := part.strip()))
    print_text(data.text)
    sheet = measure(data, n=oscillations, scene=scene, **known)
    print_table(sheet.table, "the lab sheet")
    print_text(sheet.text)
    output_folder(out)
    with warnings.catch_warnings(record=True) as warned, bar("fit") as progress:
        warnings.simplefilter("always", UserWarning)
        try:
            best = run(data, effects, scene=scene, free=names, progress=lambda done, text: progress(0.9 * done, text),
                       **known)
        except (SceneError, RecordingError):
            tell_of(warned)
            raise
        verdict = against_told(best, known["length"], length_error) if "length" in known else ""
        paths = write(best, sheet, out, svg, progress=lambda done, text: progress(0.9 + 0.1 * done, text))
    tell_of(warned, best.grade.text)
    if best.comparison is not None:
        print_table(best.comparison.table, "damping models, the best first")
        if best.grade.usable:
            print_text(best.comparison.text)
    print_table(parameter_table(best), f"fitted parameters, {best.damping} damping; r: correlations")
    assumed = "" if scene or "radius" in known else (
        f"Radius: assumed to be {best.scene.body.radius:g} m, which Reynolds numbers depend on; give --radius.")
    scene_line = f"Scene: {best.scene.equation()}"
    lines = (goodness(best), verdict, assumed, scene_line) if best.grade.usable else (scene_line, best.grade.text)
    print_text("\n".join(line for line in lines if line))
    print_files(paths)
    given = {"unit": unit, "rate": rate, "scale": scale}
    reading = [*(f"{name}={value}" for name, value in given.items() if value is not None), *(read or ())]
    print_text("To compare the recording with other methods, run:")
    print(to_lay_over(best, place, paths[-1], reading))


def tell_of(warned: Iterable[warnings.WarningMessage], besides: str = "") -> None:
    """Print every warning of a fit but the text ``besides``, which is printed elsewhere."""
    for warning in warned:
        if issubclass(warning.category, UserWarning) and str(warning.message) != besides:
            say(f"Warning: {warning.message}")


def _known(options: Mapping[str, Any], settings: list[str] | None) -> dict[str, Any]:
    """Return the scene's parameters from options and from --set; SceneError for a parameter given twice."""
    from pendulum_env.physics.damping import parse_settings
    from pendulum_env.physics.units import SceneError

    more = parse_settings(settings or ())
    for name in options:
        if name in more:
            raise SceneError(f"{name} is given twice, by --{name} and by --set.")
    return {**options, **more}
