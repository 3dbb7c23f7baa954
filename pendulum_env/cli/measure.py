"""The command ``lab-pendulum measure``: recordings without a fit, files of photogates, and tables by hand."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

import typer

from pendulum_env.cli import options
from pendulum_env.cli.console import print_files, print_table, print_text, shown_if_refused
from pendulum_env.cli.options import given, recording_of
from pendulum_env.common.checks import warn
from pendulum_env.common.provenance import output_folder, provenance, write_csv
from pendulum_env.physics.units import SceneError, number, other_units


def measure(
    file: Annotated[
        Path | None,
        typer.Argument(help="Recording of a swing; states, passages or periods of a photogate; or a table by hand; by "
                            "default a simulated recording."),
    ] = None,
    length: options.Length = None,
    length_error: options.LengthError = None,
    gravity: Annotated[float | None, options.number("Gravity in m/s²; by default 9.81.")] = None,
    radius: options.Radius = None,
    amplitudes: options.Amplitudes = None,
    amplitude_error: Annotated[float | None, options.number("Error of one of --amplitudes in degrees.")] = None,
    period: options.Period = None,
    oscillations: options.Oscillations = None,
    amplitude: Annotated[
        float | None, options.degrees("Amplitude of the swings of a table by hand in degrees; by default small.")
    ] = None,
    period_error: Annotated[float | None, options.number("Error of each period in a table by hand in s.")] = None,
    states: Annotated[
        str | None, options.word("Rows of a file with gate states: changes of the beam, or readings of it; by "
                                 "default inferred.")] = None,
    columns: options.Columns = None,
    until: options.Until = None,
    above: options.Above = None,
    drop: options.Drop = None,
    out: options.Out = Path("out/measure"),
    read: options.Reading = None,
) -> None:
    """Measure a free swing: period, amplitudes, decay, length and Reynolds number, with errors.

    Readings by hand give a figure, too. --amplitudes gives gamma and the law of the damping. A file with the titles
    "length (cm), 10 T (s)" gives g from T² against the length, with an offset of the length. A file with the titles
    "position (cm), T1 (s), T2 (s)", of a reversible pendulum, gives g; --length is then that between its knife edges.

    Files of photogates give the period, the period at small amplitude and the length. With --length, recordings and
    files of photogates give gravity, too, and a sentence if that cannot be; with --radius, swings give the Reynolds
    number. measured.csv has value, error and unit of each quantity.
    """
    if amplitudes is not None:
        from pendulum_env.lab.amplitudes import measure_amplitudes

        _useless("amplitudes that were read by hand", file=file, length_error=length_error, gravity=gravity,
                 radius=radius, oscillations=oscillations, states=states, columns=columns, until=until, above=above,
                 drop=drop, read=read)
        error = None if amplitude_error is None else number(amplitude_error, "--amplitude-error", above=0.0)
        by_hand = measure_amplitudes(amplitudes, length=length, period=period,
                                     error=None if error is None else math.radians(error))
        _write(by_hand, out, "amplitudes")
        return
    _useless("a file", amplitude_error=amplitude_error, period=period)
    if file is not None and not read and columns is None:
        from pendulum_env.lab.kater import is_kater, measure_kater
        from pendulum_env.lab.lengths import is_lengths, measure_lengths

        timed = given(oscillations=oscillations, period_error=period_error, amplitude=amplitude)
        if is_kater(file):
            _useless("a reversible pendulum", radius=radius, gravity=gravity, states=states, until=until, above=above,
                     drop=drop)
            if length is None:
                raise SceneError("A reversible pendulum needs the distance between its knife edges; give --length.")
            _write(measure_kater(file, length, edges_error=length_error, **timed), out, "kater")
            return
        if is_lengths(file):
            _useless("periods of several lengths", length=length, gravity=gravity, states=states, until=until,
                     above=above, drop=drop)
            _write(measure_lengths(file, **timed, **given(radius=radius, length_error=length_error)), out, "lengths")
            return
    _useless("this file", period_error=period_error, amplitude=amplitude)
    from pendulum_env.lab.gates import is_gate, measure_gate
    from pendulum_env.lab.sheet import measure as run
    from pendulum_env.lab.simulated import FILE

    if length_error is not None:
        if length is None:
            raise SceneError("--length-error needs --length; give the measured length.")
        number(length_error, "--length-error", above=0.0, unit="m")
    known, of_swing = given(length=length, gravity=gravity), given(radius=radius, oscillations=oscillations)
    choice = given(columns=columns, until=until, drop=",".join(drop) if drop else None)
    if file is not None and not (choice or read or above is not None) and is_gate(file):
        for name in of_swing:
            raise SceneError(f"--{name} is for recordings of a swing, and {file} is of a photogate; leave it out.")
        gate = measure_gate(file, length_error=length_error or 0.0, states=states, **known)
        table, numbers, facts = gate.table, gate.table, provenance()
        title, text, before = f"{gate.source}: {len(gate.periods)} periods", gate.text, ""
    elif states is not None:
        raise SceneError("--states is for files with the states of a photogate; leave it out.")
    else:
        data = recording_of(FILE if file is None else file, read, **choice)
        with shown_if_refused(lambda: print_text(data.text)):
            sheet = run(data, n=oscillations, above=above, length_error=length_error, **known, **given(radius=radius))
        for sentence in other_units(sheet.scene.body, sheet.scene.gravity):
            warn(sentence)
        table, numbers, facts = sheet.table, sheet.numbers, provenance(notes=list(data.notes))
        title, text = "the lab sheet", sheet.text
        before = data.text if file is not None else f"{options.SIMULATED}\n{data.text}"
    path = output_folder(out) / "measured.csv"
    write_csv(path, numbers.head, numbers.rows, facts)
    print_text(before)
    print_table(table, title)
    print_text(text)
    print_files([path])


def _useless(kind: str, **values: Any) -> None:
    """Raise SceneError for the first of some options that was given, but has no use for a kind of readings."""
    for name in given(**values):
        what = "The file" if name == "file" else f"--{name.replace('_', '-')}"
        raise SceneError(f"{what} has no use for {kind}; leave it out.")


def _write(sheet: Any, out: Path, name: str) -> None:
    """Write the numbers, the readings and the figure of a table by hand, and print the table and the sentences."""
    from pendulum_env.plots import save

    numbers, readings, facts = sheet.numbers, sheet.readings, provenance(readings=sheet.source)
    folder = output_folder(out)
    paths = [folder / "measured.csv", folder / f"{name}.csv"]
    for path, table in zip(paths, (numbers, readings), strict=True):
        write_csv(path, table.head, table.rows, facts)
    paths.append(save(sheet.plot(), folder / f"{name}.png", facts))
    print_table(sheet.table, f"{sheet.source}: {name} by hand")
    print_text(sheet.text)
    print_files(paths)
