"""The command ``lab-pendulum exercise``, which writes the report of the lab exercise."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from integrators import from_step
from pendulum_env.cli import options
from pendulum_env.cli.console import bar, print_files, print_text
from pendulum_env.cli.options import recording_of
from pendulum_env.physics.units import SceneError, shown

if TYPE_CHECKING:
    from integrators.families.own_step import OwnStep


def exercise(
    recording: options.File = None,
    period: options.Period = None,
    period_error: Annotated[float | None, options.number("Error of the period in s.")] = None,
    length: options.Length = None,
    length_error: options.LengthError = None,
    mass: options.Mass = None,
    radius: options.Radius = None,
    amplitudes: options.Amplitudes = None,
    lengths: Annotated[Path | None, options.option(
        "Table by hand of periods against lengths, with the titles \"length (cm), 10 T (s)\".")] = None,
    kater: Annotated[Path | None, options.option(
        "Table by hand of a reversible pendulum, with the titles \"position (cm), T1 (s), T2 (s)\".")] = None,
    knife_edges: Annotated[str | None, options.option(
        "Distance of the knife edges of --kater in m, with its error or without, as 0.9938 or 0.9938+-0.0002.")] = None,
    name: Annotated[str, options.option("The student's name, printed on every page.")] = "",
    key: Annotated[bool, options.flag("Fill the blanks with the answers, for the teacher.", "--key")] = False,
    language: Annotated[str, options.option(
        "Language of the report and of its figures: en or de (tables and programs' comments are in English).")] = "en",
    own_step: Annotated[
        Path | None,
        options.option("Python file of your own step, which runs beside the three Euler methods: its lines, as "
                       "theta = theta + omega*dt, or def step(theta, omega, dt, acceleration).")] = None,
    out: options.Out = Path("out/exercise"),
    read: options.Reading = None,
) -> None:
    """Answer the lab exercise: one HTML report to print and hand in, its figures as PNG and SVG, its numbers as CSV.

    The angular frequency comes from --recording, else from --period, else from --length and g; an error that is not
    given is half a unit of the last digit. The damping and the comparison need a recording; without --recording they
    use a simulated one, and every page that shows it says so, or --amplitudes that were read by hand.
    --lengths and --kater add sections on gravity. Each question has a blank for the student's own words; --key fills it
    in for the teacher. The programs behind the figures, one a part, run with NumPy and Matplotlib alone and compute the
    same numbers. The page keeps what is typed into it, and its button Save writes that into the
    file. A new report in the same folder keeps saved answers.
    """
    from pendulum_env.exercise.answers import earlier
    from pendulum_env.exercise.given import Given, by_hand
    from pendulum_env.exercise.language import language_of
    from pendulum_env.exercise.report import REPORT, named, need_jinja, write
    from pendulum_env.exercise.worked import work_out

    need_jinja()
    language_of(language)
    kept = earlier(out / REPORT, named(name), key)
    data = recording_of(recording, read) if recording is not None or read else None
    given = Given.of(recording=data, period=period, period_error=period_error, length=length,
                     length_error=length_error, mass=mass, radius=radius)
    given = by_hand(given, amplitudes, lengths, kater, knife_edges)
    own = None if own_step is None else step_in(own_step)
    with bar("exercise") as progress:
        worked = work_out(given, lambda done, text: progress(0.3 * done, text), step=own)
        paths = write(worked, out, name=name, key=key, language=language,
                      progress=lambda done, text: progress(0.3 + 0.7 * done, text))
    if given.simulated and worked.recorded.by_hand is None:
        what = "the comparison uses" if given.amplitudes is not None else "the damping and the comparison use"
        print_text(f"Without --recording, {what} the simulated recording of the package.")
    print_text(f"Omega = {given.omega.value}, from the {given.omega.how}. Open {paths[0]} in a browser, and print it "
               "from there.")
    if kept.number:
        print_text(f"The {kept.number} answers of the earlier report are in the new one.")
    if own is not None:
        print_text(f"Your step {own.summary}.")
    print_files(paths)


def step_in(file: Path) -> OwnStep:
    """Return the step in a Python file as a method; SceneError for a file that cannot be read, MethodError for a step
    that is none."""

    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not text in UTF-8"
        raise SceneError(f"The file {shown(str(file))} of the step cannot be read: {reason}.") from None
    return from_step(text)
