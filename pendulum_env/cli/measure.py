"""The command ``lab-pendulum measure``, which measures a recording without a fit, and the files of photogates."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from pendulum_env.cli import options
from pendulum_env.cli.console import print_files, print_table, print_text, shown_if_refused
from pendulum_env.cli.options import recording_of


def measure(
    file: Annotated[
        Path | None,
        typer.Argument(help="Recording of a swing, or states, passages or periods of a photogate; by default a "
                            "simulated recording."),
    ] = None,
    length: options.Length = None,
    length_error: options.LengthError = None,
    gravity: Annotated[float | None, options.number("Gravity in m/s²; by default 9.81.")] = None,
    radius: options.Radius = None,
    oscillations: options.Oscillations = None,
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

    Files of photogates give the period, the period at small amplitude and the length. With --length, both kinds of file
    give gravity, too, and a sentence if that cannot be; with --radius, swings give the Reynolds number. measured.csv
    has value, error and unit of each quantity.
    """
    from pendulum_env.common.provenance import output_folder, provenance, write_csv
    from pendulum_env.common.warn import warn
    from pendulum_env.lab.gates import is_gate, measure_gate
    from pendulum_env.lab.sheet import measure as run
    from pendulum_env.lab.simulated import FILE
    from pendulum_env.physics.units import SceneError, number, other_units

    if length_error is not None:
        if length is None:
            raise SceneError("--length-error needs --length; give the measured length.")
        number(length_error, "--length-error", above=0.0, unit="m")
    given: dict[str, Any] = {name: value for name, value in (("length", length), ("gravity", gravity))
                             if value is not None}
    choice = {"columns": columns, "until": until, "drop": ",".join(drop) if drop else None}
    chosen = bool(read) or above is not None or any(value is not None for value in choice.values())
    if file is not None and not chosen and is_gate(file):
        for name, value in (("radius", radius), ("oscillations", oscillations)):
            if value is not None:
                raise SceneError(f"--{name} is for recordings of a swing, and {file} is of a photogate; leave it out.")
        gate = measure_gate(file, length_error=length_error or 0.0, states=states, **given)
        path = output_folder(out) / "measured.csv"
        write_csv(path, gate.table.head, gate.table.rows, provenance())
        print_table(gate.table, f"{gate.source}: {len(gate.periods)} periods")
        print_text(gate.text)
    elif states is not None:
        raise SceneError("--states is for files with the states of a photogate; leave it out.")
    else:
        data = recording_of(FILE if file is None else file, read, **choice)
        given |= {} if radius is None else {"radius": radius}
        with shown_if_refused(lambda: print_text(data.text)):
            sheet = run(data, n=oscillations, above=above, length_error=length_error, **given)
        for sentence in other_units(sheet.scene.body, sheet.scene.gravity):
            warn(sentence)
        path = output_folder(out) / "measured.csv"
        write_csv(path, sheet.numbers.head, sheet.numbers.rows, provenance(notes=list(data.notes)))
        print_text(data.text if file is not None else f"{options.SIMULATED}\n{data.text}")
        print_table(sheet.table, "the lab sheet")
        print_text(sheet.text)
    print_files([path])
