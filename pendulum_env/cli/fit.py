"""The command ``lab-pendulum fit``, which fits a scene to a recording."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pendulum_env.cli import options
from pendulum_env.cli.console import bar, print_files, print_table, print_text, printable, shown_if_refused, tell_of
from pendulum_env.cli.options import given, given_by_user, recording_of
from pendulum_env.common.checks import warn
from pendulum_env.common.progress import Progress
from pendulum_env.physics.damping import parse_settings, typed
from pendulum_env.physics.units import SceneError, number, shown, whole_number

if TYPE_CHECKING:
    from pendulum_env.lab.fitting.posterior import Posterior
    from pendulum_env.lab.fitting.result import Fit
    from pendulum_env.lab.recording import Recording
    from pendulum_env.lab.sheet import LabSheet


def fit(
    context: typer.Context,
    files: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[FILE]...", help="Recording: a text file of times and angles, or of a track; by "
                       "default a simulated one. Several logs of driven runs are fitted together."),
    ] = None,
    effects: Annotated[str, options.word("Dampings to fit, as quadratic+coulomb; auto tries all sums.")] = "auto",
    scene: options.SceneOrNone = None,
    length: options.Length = None,
    length_error: options.LengthError = None,
    mass: options.Mass = None,
    radius: options.Radius = None,
    suspension: Annotated[str | None, options.word("Suspension of the bob: rod or wire.")] = None,
    free: Annotated[
        str | None,
        options.option("Parameters to fit besides damping: length (by default) or gravity, inertia or centre of a "
                       "measured body, the sensor's scale; '' for none.")] = None,
    unit: Annotated[str | None, options.word("Unit of the angles: deg or rad; by default inferred.")] = None,
    rate: Annotated[float | None, options.number("Readings per second, in place of a column of times.")] = None,
    scale: Annotated[str | None, options.option("Factor for the file's angles, as 0.99 or 360/4096.")] = None,
    oscillations: options.Oscillations = None,
    posterior: Annotated[
        bool, options.flag("Also sample the posterior distribution of the parameters (emcee).", "--posterior")] = False,
    walker_steps: Annotated[
        int | None, options.count("Steps of the posterior's 32 walkers; by default 1500.")] = None,
    seed: Annotated[int | None, options.count("Seed of the posterior's random numbers; by default 0.")] = None,
    prior: Annotated[
        list[str] | None,
        options.option("Prior of a parameter, as length=0.64:0.66, gamma=log:0.01:0.1, length=normal:0.65:0.01.")
    ] = None,
    columns: options.Columns = None,
    until: options.Until = None,
    above: options.Above = None,
    drop: options.Drop = None,
    robust: Annotated[
        bool, options.flag("Let readings that are far off count less (soft L1).", "--robust")] = False,
    no_jumps: Annotated[
        bool, options.flag("Leave jumps of the sensor's zero in; by default they are subtracted where that explains "
                           "the readings clearly better.", "--no-jumps")] = False,
    action: Annotated[
        str | None,
        options.option("Column of the action in logs of driven runs, by name or number; by default as titled.")
    ] = None,
    torque: Annotated[str | None, options.option("Column of the torque in logs of driven runs.")] = None,
    current: Annotated[str | None, options.option("Column of the motor's current in logs of driven runs.")] = None,
    details: Annotated[
        bool, options.flag("Also print the lab sheet, every model, correlations, chi² and how the errors were "
                           "calculated.", "--details")] = False,
    svg: options.Svg = False,
    out: options.Out = Path("out/fit"),
    settings: options.Settings = None,
    read: options.Reading = None,
) -> None:
    """Fit a recording of a free swing: period and decay with errors, and the scene and damping that match it.

    Release and equilibrium are determined from the recording, and every inferred setting is printed. The quantities of
    the lab sheet are measured first: period, amplitudes, decay, length. Then the whole trajectory is fitted; with auto,
    by every damping; without --scene, for a bob in air. A measured length with its error is compared with the fitted
    one. The result is printed as a table of the fitted numbers and a few sentences; --details adds what they are based
    on. The report, the tables and scene.json, which gym.make and compare accept, are written to the output folder.
    With --posterior, posterior.csv, posterior.zip and the corner figure are written, too. Logs of driven runs, with an
    action, torque or current beside the angle, are fitted for motor, friction, delay and sensor.
    """
    from pendulum_env.cli.driven import fit_logs, is_driven_fit
    from pendulum_env.lab.checked import check_half_turn, side
    from pendulum_env.lab.fitting.fit import fit as run
    from pendulum_env.lab.fitting.fit import planned
    from pendulum_env.lab.fitting.remedies import repaired
    from pendulum_env.lab.fitting.shooting import calmed
    from pendulum_env.lab.sheet import measure
    from pendulum_env.lab.simulated import FILE
    from pendulum_env.study.fit_report import (
        against_told,
        against_track,
        needs_length,
        to_lay_over,
        write,
        write_posterior,
    )

    drive = {"action": action, "torque": torque, "current": current}
    if is_driven_fit(files or (), drive):
        shared = ("files", *drive, "unit", "mass", "details", "svg", "out", "settings", "read")
        if unused := given_by_user(context, *(name for name in context.params if name not in shared)):
            raise SceneError(f"{unused[0]} is for free swings, and these are logs of driven runs; --read until=60 "
                             "leaves out what comes later, and --set inertia=0.1 sets what is known.")
        fit_logs(files or (), drive, read or (), unit, mass, settings, out, svg, details)
        return
    if files is not None and len(files) > 1:
        raise SceneError("Several files are fitted together only if they are logs of driven runs; give one recording.")
    file = files[0] if files else None
    known = _known(given(length=length, mass=mass, radius=radius, suspension=suspension), settings)
    if length_error is not None and "length" not in known:
        raise SceneError("--length-error needs --length; give the measured length.")
    if length_error is not None:
        number(length_error, "--length-error", above=0.0, unit="m")
    sampling = _sampling(posterior, walker_steps, seed, prior)
    part = 0.9 if sampling is None else 0.3
    place = FILE if file is None else file
    words = given(unit=unit, rate=rate, scale=scale, columns=columns, until=until,
                  drop=",".join(drop) if drop else None, jumps=False if no_jumps else None)
    data = recording_of(place, read, **words)
    names = None if free is None else tuple(name for part in free.split(",") if (name := part.strip()))
    plan = planned(data, effects, scene, names, robust, known)
    if sampling is not None:
        plan.check_priors(data, sampling["priors"])
    if length_error is not None:
        needs_length(plan.free)

    def measured(recording: Recording) -> LabSheet:
        return measure(recording, n=oscillations, scene=scene, above=above, length_error=length_error, **known)

    with shown_if_refused(lambda: print_text(data.text)):
        swing = data.released()  # without a swing, there is nothing to fit either
        if not robust:  # a robust fit bears single readings far off
            check_half_turn(swing.centred().angle, f"{data.source}: a fit needs")
        calm = calmed(data) if robust else data
        sheet, no_sheet = (measured(calm), "") if oscillations is not None else side("the lab sheet",
                                                                                     lambda: measured(calm))

    def show_measured(whole: bool = True) -> None:
        print_text(data.text if file is not None else f"{options.SIMULATED}\n{data.text}")
        if sheet is not None:
            if whole:
                print_table(sheet.table, "the lab sheet")
            print_text(sheet.text if whole else sheet.text.partition("\n")[0])

    with warnings.catch_warnings(record=True) as warned, bar("fit") as progress:
        warnings.simplefilter("always", UserWarning)
        with shown_if_refused(show_measured, lambda: tell_of(warned)):
            best = run(data, effects, scene=scene, free=names, above=above, robust=robust, jumps=not no_jumps,
                       progress=lambda done, text: progress(part * done, text), **known)
            if (best.remedies or best.subtracted) and not robust:  # the sheet of the swing without jumps and outliers
                whole, _ = side("the lab sheet", lambda: measured(repaired(best.recording, best.remedies)))
                sheet = whole or sheet
            found = _sampled(best, sampling, lambda done, text: progress(part + (0.9 - part) * done, text))
        verdict = against_told(best, known["length"], length_error) if "length" in known else ""
        paths = write(best, sheet, out, svg, progress=lambda done, text: progress(0.9 + 0.1 * done, text))
        if found is not None:
            paths[-1:-1] = write_posterior(found, out, svg)
    show_measured(details)
    tell_of(warned, best.grade.text if sheet is None else f"{best.grade.text}\n{sheet.text}")
    if details and best.comparison is not None:
        print_table(best.comparison.table, "damping models, the best first")
    title = f"fitted numbers, {best.damping} damping"
    print_table(best.detailed_table if details else best.table, f"{title}; r: correlations" if details else title)
    assumed = "" if scene or "radius" in known else (
        f"Radius: assumed to be {best.scene.body.radius:g} m, which Reynolds numbers depend on; give --radius.")
    scene_line = f"Scene: {best.scene.equation()}"
    more, track = [text or left_out for text, left_out in (
        side("the details of the fit", lambda: best.details if details else ""),
        side("the radius of the track", lambda: against_track(best)))]
    usable = [more, verdict, track, assumed]
    lines = [best.text, *(usable if best.grade.usable else []), scene_line, no_sheet]
    print_text("\n".join(line for line in lines if line))
    if found is not None:
        print_table(found.table, f"posterior, {best.damping} damping")
        print_text(found.text)
    print_files(paths)
    reading = [*(f"{name}={'false' if value is False else value}" for name, value in words.items()), *(read or ())]
    print_text("To compare the recording with other methods, run:")
    print(printable(to_lay_over(best, place, paths[-1], reading)))


def _sampling(
    posterior: bool, steps: int | None, seed: int | None, prior: Sequence[str] | None
) -> dict[str, Any] | None:
    """Return the keywords of ``Fit.posterior`` that the options give, None without --posterior.

    Raises SceneError for options that need --posterior.
    """
    from pendulum_env.lab.fitting.posterior import needs_emcee

    for name, value in {"walker-steps": steps, "seed": seed, "prior": prior or None}.items():
        if value is not None and not posterior:
            raise SceneError(f"--{name} needs --posterior.")
    if not posterior:
        return None
    needs_emcee()
    if steps is not None:
        whole_number(steps, "--walker-steps")
    priors = {}
    for text in prior or ():
        name, mark, form = text.partition("=")
        if not mark:
            raise SceneError(f"--prior needs a name and a range, as length=0.64:0.66, not {shown(text)}.")
        priors[name] = tuple(typed(part) for part in form.split(":"))
    return {"steps": 1500 if steps is None else steps, "seed": seed or 0, "priors": priors}


def _sampled(best: Fit, sampling: Mapping[str, Any] | None, progress: Progress) -> Posterior | None:
    """Return the posterior of a fit; None if it is not wanted or not possible, with a warning that says why."""
    from pendulum_env.lab.checked import side

    if sampling is None:
        return None
    found, left_out = side("the posterior", lambda: best.posterior(**sampling, progress=progress))
    if found is None:
        warn(left_out)
    return found


def _known(measures: Mapping[str, Any], settings: list[str] | None) -> dict[str, Any]:
    """Return the scene's parameters from options and from --set; SceneError for a parameter given twice."""

    more = parse_settings(settings or ())
    for name in measures:
        if name in more:
            raise SceneError(f"{name} is given twice, by --{name} and by --set.")
    return {**measures, **more}
