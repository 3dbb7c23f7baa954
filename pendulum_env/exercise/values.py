"""The numbers of the report: their text, and their table."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from pendulum_env.exercise.motion import STEP
from pendulum_env.exercise.worked import Worked
from pendulum_env.lab.amplitudes import NAMES
from pendulum_env.lab.measures import Measurement

POWERS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


class Value(NamedTuple):
    """A row of the table of numbers; ``answer`` marks numbers that a question asks for, which only the key shows."""

    part: str
    quantity: str
    value: float
    error: float | str
    unit: str
    answer: bool = False


def digits(value: float, figures: int = 4) -> str:
    """Return a number with a given number of significant figures, with a true minus sign, and very small or large ones
    as ``1.2 10⁻⁵`` with a multiplication sign."""
    if not math.isfinite(value):
        return str(value).replace("inf", "∞")
    power = math.floor(math.log10(abs(value))) if value else 0
    if -4 <= power < max(figures, 5):
        places = max(figures - 1 - power, 0)
        return f"{value:.{places}f}".replace("-", "\N{MINUS SIGN}")
    mantissa, exponent = f"{value:.{figures - 1}e}".split("e")
    return f"{mantissa}\N{MULTIPLICATION SIGN}10{str(int(exponent)).translate(POWERS)}".replace("-", "\N{MINUS SIGN}")


def fixed(value: float, places: int) -> str:
    """Return a number with a given number of decimal places and a true minus sign."""
    return f"{round(value, places) + 0.0:.{places}f}".replace("-", "\N{MINUS SIGN}")


def with_error(value: float, error: float, unit: str) -> str:
    """Return a value and its error, both with two figures of the error: 57.7400° ± 0.0039°."""
    return " ± ".join(f"{part}{unit}" for part in str(Measurement(value, error, "")).strip().split(" ± "))


def values(worked: Worked) -> Iterator[Value]:
    """Yield the numbers of the report, in its order."""
    given, small, large, friction = worked.given, worked.small, worked.large, worked.recorded
    for one in given.frequencies:
        yield measured("1.1", f"period of small swings, from the {one.how}", one.period)
        yield measured("1.1", f"Omega, from the {one.how}", one.value)
    mean = f"mean period of {given.sheet.oscillations} oscillations of the recording"
    yield measured("1.1", mean, given.sheet.period)
    yield Value("1.1", "mean amplitude of these oscillations", given.amplitude, "", "rad")
    steps = len(small.forward.time) - 1
    yield Value("1.2", "step", STEP, "", "s")
    yield Value("1.2", "energy of forward Euler at the end over its start", small.forward.ratio, "", "1")
    for one_step, unit in zip(small.one_step, ("rad", "rad/s"), strict=True):
        yield Value("1.4", f"error of one step at the {one_step.where}, computed minus exact", one_step.error, "", unit)
        yield Value("1.4", f"its leading term at the {one_step.where}", one_step.leading, "", unit, True)
    yield Value("1.4", "growth of the energy in one step, mean over the run", small.growth, "", "1")
    yield Value("1.4", "predicted growth of the energy in one step", (small.omega * STEP) ** 2, "", "1", True)
    yield Value("1.4", "predicted energy at the end", (1.0 + (small.omega * STEP) ** 2) ** steps, "", "1", True)
    for half in small.halved:
        yield Value("1.5", f"energy at the end over its start, dt = {half.dt:g} s", half.ratio, "", "1")
        yield Value("1.5", f"largest angle error in the first period, dt = {half.dt:g} s", half.error, "", "rad")
    for name, run in small.runs.items():
        yield Value("2.1", f"energy at the end over its start, {name}", run.ratio, "", "1")
        yield Value("2.1", f"smallest energy over its start, {name}", float(run.energy.min()), "", "1")
        yield Value("2.1", f"largest energy over its start, {name}", float(run.energy.max()), "", "1")
    yield Value("2.2", "smallest energy over its start in two minutes", float(large.run.energy.min()), "", "1")
    yield Value("2.2", "largest energy over its start in two minutes", float(large.run.energy.max()), "", "1")
    if large.own is not None:
        yield Value("2.2", "smallest energy over its start, own_step", float(large.own.energy.min()), "", "1")
        yield Value("2.2", "largest energy over its start, own_step", float(large.own.energy.max()), "", "1")
    for at in large.periods:
        name = f"amplitude {math.degrees(at.amplitude):.4g} degrees"
        yield Value("2.3", f"measured period, {name}", at.measured, "", "s")
        yield Value("2.3", f"period by the elliptic integral, {name}", at.exact, "", "s")
    for flow in friction.flows:
        where = f"{flow.whose}, amplitude {math.degrees(flow.amplitude):.4g} degrees"
        yield Value("2.4", f"speed at the bottom, {where}", flow.speed, "", "m/s")
        yield Value("2.4", f"Reynolds number, {where}", flow.reynolds, "", "1")
        yield Value("2.4", f"gamma by Stokes' law, {where}", flow.stokes, "", "1/s", True)
        yield Value("2.4", f"gamma by the drag of a sphere, {where}", flow.sphere, "", "1/s", True)
    for time, size, error in zip(*(x.tolist() for x in (friction.readings.time, friction.readings.amplitude,
                                                        friction.readings.error)), strict=True):
        yield Value("2.4", f"amplitude at {time:.4f} s", size, error, "rad")
    yield measured("2.4", "gamma from these amplitudes", friction.gamma)
    if given.amplitudes is None:
        yield measured("2.4", "gamma from the first third of all amplitudes", friction.early)
        yield measured("2.4", "gamma from the last third of all amplitudes", friction.late)
    else:
        for curve in given.amplitudes.envelopes:
            name, value = given.amplitudes.named(curve)
            yield measured("2.4", f"{NAMES[curve.law]}: {name}", value)
            yield Value("2.4", f"readings minus the envelope of {NAMES[curve.law]}, rms", given.amplitudes.rms(curve),
                        "", "rad")
    compared, by_hand = friction.compared, friction.by_hand
    if by_hand is not None:
        yield Value("2.6", "root mean square of reading minus simulated amplitude", by_hand.rms, "", "rad")
        yield Value("2.6", "largest difference", by_hand.largest, "", "rad")
        for after, amplitude in zip(by_hand.time.tolist(), by_hand.simulated.tolist(), strict=True):
            what = f"amplitude of the simulation {after:.4g} s after the first reading"
            yield Value("2.6", what, amplitude, "", "rad")
    else:
        yield Value("2.6", "root mean square of recording minus simulation", compared.rms, "", "rad")
        yield Value("2.6", "largest difference", compared.largest, "", "rad")
        for who, period in (("recording", compared.period_recorded), ("simulation", compared.period_simulated)):
            yield Value("2.6", f"mean period of {compared.cycles} oscillations, {who}", period, "", "s")
        for moment, seen, run_size in compared.amplitudes:
            yield Value("2.6", f"amplitude of the recording at {moment:.4g} s", seen, "", "rad")
            yield Value("2.6", f"amplitude of the simulation at {moment:.4g} s", run_size, "", "rad")
    if given.lengths is not None:
        yield measured("3", "gravity from T² against the length", given.lengths.gravity)
        yield measured("3", "offset of the length", given.lengths.offset)
        yield measured("3", "gravity from T² against the length, offset 0", given.lengths.through_origin)
    if given.kater is not None:
        yield measured("3", "period of the reversible pendulum", given.kater.period)
        yield measured("3", "distance of its knife edges", given.kater.edges)
        yield measured("3", "gravity from the reversible pendulum", given.kater.gravity)
    for reason in (compared if by_hand is None else by_hand).reasons:
        yield Value("2.6", f"largest difference due to: {reason.name}", reason.size, "", "rad", True)


def measured(part: str, quantity: str, one: Measurement) -> Value:
    """Return the row of a measured value."""
    return Value(part, quantity, one.value, one.error, one.unit)
