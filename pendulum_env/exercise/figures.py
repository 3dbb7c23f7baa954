"""The figures of the report; each function draws one from the worked exercise."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator
from matplotlib.transforms import Bbox

from pendulum_env.exercise.motion import OWN, Array, ExerciseMotion
from pendulum_env.exercise.recorded import FIRST_SWINGS
from pendulum_env.exercise.small_angles import ANGLE
from pendulum_env.exercise.worked import Worked
from pendulum_env.lab.measures import crossings
from pendulum_env.lab.turning import CLEAR
from pendulum_env.physics import exact
from pendulum_env.plots.by_hand import amplitudes_by_hand, kater_by_hand, lengths_by_hand
from pendulum_env.plots.motion import EXACT
from pendulum_env.plots.recorded import READING
from pendulum_env.plots.series import Span, within
from pendulum_env.plots.style import LINES, blank, legend_above, looks_of, styled
from pendulum_env.render.palette import FAINT_INK, INK, OKABE_ITO

Labels = Mapping[str, str]
"""Texts in figures, by name, in the language of the report."""
WIDTH = 8.0
"""Width of every figure [inch]; on paper it is 170 mm."""
STRIPS = 10
"""Largest number of strips that a run is cut into; more do not fit on a page."""
USUAL_STRIPS = 6
"""Largest number of strips of a run whose swings need no more."""
SWINGS = 30.0
"""Largest number of swings in a strip."""
USUAL_SWINGS = 8.0
"""Number of swings in a strip of a short run."""
STRIP = 0.72
"""Height of a strip [inch]."""
LOWEST = 2.2
"""Least height of all strips together [inch]."""
ENDS = 8.0
"""Number of swings at the start and at the end that are shown enlarged."""
WIDEST = 6.0
"""Phase plots at small angles reach up to this multiple of the exact orbit, which would be a dot in larger ones."""
DOTS = 60.0
"""Largest number of readings drawn per period."""
SIGN = OKABE_ITO["vermillion"]
"""Colour of the note that a recording is simulated."""
LOW, HIGH = 1e-3, 1e3
"""Ends of the logarithmic axis of energies over the initial energy."""


def colour(name: str) -> str:
    """Return a method's colour; the student's own step has one that no Euler method has."""
    return OKABE_ITO["reddish_purple"] if name == OWN else looks_of({name: name})[name].colour


def line(run: ExerciseMotion, width: float = 1.3) -> dict[str, Any]:
    """Return the style of a run's curve."""
    return {"color": colour(run.method), "linewidth": width}


def true_ellipse(omega: float, angle: float) -> tuple[Array, Array]:
    """Return the exact orbit at small angles as arrays of angle [degrees] and velocity [rad/s]."""
    phase = np.linspace(0.0, math.tau, 400)
    return np.degrees(angle) * np.cos(phase), -omega * angle * np.sin(phase)


def spans(end: float, swing: float) -> list[Span]:
    """Return the spans of time [s] of the strips of a run that ends at ``end``, whose period is ``swing`` [s].

    The strips cover the whole run or, where that would put too many swings on one, its beginning and its end.
    """
    if end <= STRIPS * SWINGS * swing:
        count = max(1, min(USUAL_STRIPS, math.ceil(end / (USUAL_SWINGS * swing))), math.ceil(end / (SWINGS * swing)))
        edges = np.linspace(0.0, end, count + 1).tolist()
        return list(pairwise(edges))
    part, half = SWINGS * swing, STRIPS // 2
    first = [(k * part, (k + 1) * part) for k in range(half)]
    return first + [(end - (half - k) * part, end - (half - k - 1) * part) for k in range(half)]


def strips(parts: Sequence[Span], reach: float, below: str, labels: Labels) -> tuple[Figure, list[Axes]]:
    """Return a figure with one strip for each span of time; angles up to ``reach`` [degrees] fit into it."""
    drawing = blank((WIDTH, 0.5 + max(STRIP * len(parts), LOWEST)))
    with styled():
        rows = list(drawing.subplots(len(parts), 1, squeeze=False)[:, 0])
        for at, span in zip(rows, parts, strict=True):
            at.set(xlim=span, ylim=(-1.08 * reach, 1.08 * reach))
        rows[-1].set_xlabel(below)
        rows[0].set_title(labels["angle"], loc="right", fontsize=10)
    return drawing, rows


def cuts(drawing: Figure) -> list[float]:
    """Return where a figure that is laid out may be cut between its rows, as shares of its height from the top; none if
    rows share an axis of time, whose numbers are below the last."""
    rows: dict[int, list[Axes]] = {}
    for at in drawing.axes:
        spec = at.get_subplotspec()
        rows.setdefault(spec.rowspan.start if spec is not None else 0, []).append(at)
    first, *others = (rows[k][0] for k in sorted(rows))
    if not others or first.get_shared_x_axes().joined(first, others[0]):
        return []
    boxes = [Bbox.union([box for at in rows[k] if (box := at.get_tightbbox())]) for k in sorted(rows)]
    return [1.0 - 0.5 * (upper.y0 + lower.y1) / drawing.bbox.height for upper, lower in pairwise(boxes)]


def signed(drawing: Figure, worked: Worked, labels: Labels) -> Figure:
    """Return the figure of a recording, with a note if the recording is simulated."""
    if worked.given.simulated:
        with styled():
            drawing.suptitle(labels["simulated"], x=0.99, ha="right", fontsize=10, color=SIGN, weight="bold")
    return drawing


def few(time: Array, part: slice, period: float) -> slice:
    """Return a slice of readings thinned so that at most DOTS of them are drawn per period [s]."""
    usual = float(np.median(np.diff(time)))
    return slice(part.start, part.stop, max(1, math.ceil(period / usual / DOTS)))


def above(at: Axes, columns: int = 3) -> None:
    """Draw a legend above the axes, in so many columns at most as fit into the figure."""
    legend_above(at, columns, fontsize=10)


# --- Part 1 ---------------------------------------------------------------------------------------------------------


def frequency(worked: Worked, labels: Labels) -> Figure:
    """Draw the oscillations of the recording that the period is averaged over, with their zero crossings."""
    sheet = worked.given.sheet
    swing = sheet.recording
    ends = crossings(swing.time, swing.angle, level=CLEAR * swing.noise)[: sheet.oscillations + 1]
    part = within(swing.time, (0.0, float(ends[-1]) + 0.5 * sheet.period.value))
    part = few(swing.time, part, sheet.period.value)
    drawing = blank((WIDTH, 2.9))
    with styled():
        at = drawing.subplots()
        at.plot(swing.time[part], np.degrees(swing.angle[part]), color=INK, marker=".", markersize=3.0, linewidth=0.7,
                label=recording_label(worked, labels))
        at.plot(ends, np.zeros(len(ends)), "o", color=SIGN, label=labels["crossing"], zorder=3)
        at.axhline(0.0, color=FAINT_INK, linewidth=0.8)
        at.set(xlabel=labels["since_release"], ylabel=labels["angle"])
        above(at)
    return signed(drawing, worked, labels)


def forward(worked: Worked, labels: Labels) -> Figure:
    """Draw angle, angular velocity and energy of forward Euler against time, with the exact motion."""
    run = worked.small.forward
    angle, velocity = exact.linear(run.time, ANGLE, 0.0, worked.small.omega)
    drawing = blank((WIDTH, 5.4))
    with styled():
        rows = drawing.subplots(3, 1)
        for at, true, own, label in ((rows[0], np.degrees(angle), np.degrees(run.angle), "angle"),
                                     (rows[1], velocity, run.velocity, "velocity"),
                                     (rows[2], np.ones(len(run.time)), run.energy, "energy")):
            at.plot(run.time, true, label=labels["exact"], **{**EXACT, "linewidth": 3.5})
            at.plot(run.time, own, label=labels[run.method], **line(run))
            at.set_ylabel(labels[label], fontsize=9)
            at.set_xlim(0.0, float(run.time[-1]))
        if run.ratio > HIGH / 10.0:
            rows[2].set_yscale("log")
        else:
            rows[2].set_ylim(bottom=0.0)
        rows[2].set_xlabel(labels["time"])
        above(rows[0])
    return drawing


def forward_phase(worked: Worked, labels: Labels) -> Figure:
    """Draw the phase plot of forward Euler, with the exact orbit."""
    drawing = blank((0.6 * WIDTH, 0.5 * WIDTH))
    with styled():
        at = drawing.subplots()
        orbit(at, worked.small.forward, true_ellipse(worked.small.omega, ANGLE), labels)
        reach_of([at], [worked.small.forward], worked.small.omega)
        above(at)
    return drawing


def orbit(at: Axes, run: ExerciseMotion, true: tuple[Array, Array], labels: Labels, width: float = 1.0) -> None:
    """Draw the phase plot of a run, with an exact orbit in degrees and rad/s."""
    at.plot(*true, label=labels["exact"], **{**EXACT, "linewidth": 4.0})
    at.plot(np.degrees(run.angle), run.velocity, label=labels[run.method], **line(run, width))
    at.plot(math.degrees(run.angle[0]), run.velocity[0], "o", color=INK, markersize=5, label=labels["start"], zorder=4)
    at.margins(0.05)
    at.set(xlabel=labels["angle"], ylabel=labels["velocity"])


def halved(worked: Worked, labels: Labels) -> Figure:
    """Draw the energy of forward Euler with the step, half of it, and so on."""
    drawing = blank((WIDTH, 3.0))
    with styled():
        at = drawing.subplots()
        for k, run in enumerate(worked.small.halves):
            at.plot(run.time, run.energy, color=colour(run.method), linestyle=LINES[k][0], linewidth=2.0 - 0.25 * k,
                    label=labels["step"].format(f"{run.dt:g}"))
        at.set_yscale("log")
        plain(at)
        at.set(xlabel=labels["time"], ylabel=labels["energy"], xlim=(0.0, float(run.time[-1])))
        above(at, 4)
    return drawing


def plain(at: Axes) -> None:
    """Write the numbers of a logarithmic axis without powers of ten, if they are neither very small nor very large."""
    low, high = at.get_ylim()
    if low > LOW and high < HIGH:
        subs = (1.0, 2.0, 5.0) if high < 100.0 * low else (1.0,)
        at.yaxis.set_major_locator(LogLocator(subs=subs))
        at.yaxis.set_major_formatter(FuncFormatter(lambda value, _place: f"{value:g}"))
        at.yaxis.set_minor_locator(NullLocator())


# --- Part 2 ---------------------------------------------------------------------------------------------------------


def eulers(worked: Worked, labels: Labels) -> Figure:
    """Draw energy and phase plot of the three Euler methods side by side, and of the student's own step beside them."""
    small = worked.small
    drawing = blank((WIDTH, 4.8))
    with styled():
        grid = drawing.subplots(2, len(small.runs))
        for at, low, run in zip(grid[0], grid[1], small.runs.values(), strict=True):
            at.plot(run.time, np.ones(len(run.time)), **{**EXACT, "linewidth": 3.5})
            at.plot(run.time, run.energy, **line(run))
            at.set_title(labels[run.method], fontsize=11)
            at.set(xlabel=labels["time"], xlim=(0.0, float(run.time[-1])))
            at.set_yscale("log")
            orbit(low, run, true_ellipse(small.omega, ANGLE), labels, 0.9)
            low.set(ylabel="")
        least = min(float(run.energy.min()) for run in small.runs.values())
        most = max(float(run.energy.max()) for run in small.runs.values())
        for at in grid[0]:
            at.set_ylim(0.8 * least, 1.25 * most)
            plain(at)
        grid[0, 0].set_ylabel(labels["energy"])
        grid[1, 0].set_ylabel(labels["velocity"])
        reach_of(grid[1], list(small.runs.values()), small.omega)
    return drawing


def reach_of(axes: Iterable[Axes], runs: Sequence[ExerciseMotion], omega: float) -> None:
    """Give phase plots at small angles equal axes that hold all runs or, if one is too large, the exact orbit WIDEST
    times.
    """
    wide = min(1.1 * max(math.degrees(np.max(np.abs(run.angle))) for run in runs), WIDEST * math.degrees(ANGLE))
    high = min(1.1 * max(float(np.max(np.abs(run.velocity))) for run in runs), WIDEST * omega * ANGLE)
    for at in axes:
        at.set(xlim=(-wide, wide), ylim=(-high, high))


def large_strips(worked: Worked, labels: Labels) -> Figure:
    """Draw the angle over two minutes at large angles, in strips."""
    return run_in_strips(worked.large.run, worked.large.period, labels)


def run_in_strips(run: ExerciseMotion, period: float, labels: Labels) -> Figure:
    """Draw the angle of a run over time in strips; ``period`` is that of its swings [s]."""
    parts = spans(float(run.time[-1]), period)
    drawing, rows = strips(parts, math.degrees(np.max(np.abs(run.angle))), labels["time"], labels)
    with styled():
        for at, span in zip(rows, parts, strict=True):
            part = within(run.time, span)
            at.plot(run.time[part], np.degrees(run.angle[part]), **line(run, 1.1))
    return drawing


def large_energy(worked: Worked, labels: Labels) -> Figure:
    """Draw energy and phase plot of the two minutes at large angles."""
    large = worked.large
    angle, velocity = exact.pendulum(np.linspace(0.0, large.exact, 600), float(large.run.angle[0]), 0.0, large.omega)
    return energy_and_phase(large.run, large.period, (np.degrees(angle), velocity), labels)


def damped_energy(worked: Worked, labels: Labels) -> Figure:
    """Draw energy and phase plot of the damped run; the exact orbit without friction is behind it."""
    large = worked.large
    angle, velocity = exact.pendulum(np.linspace(0.0, large.exact, 600), float(large.run.angle[0]), 0.0, large.omega)
    drawing = energy_and_phase(worked.recorded.damped, large.period, (np.degrees(angle), velocity), labels)
    first, fine = drawing.axes[1], worked.recorded.fine
    low, high = first.get_ylim()
    first.plot(fine.time, fine.energy, color=INK, linewidth=1.1, linestyle=(0, (4, 2)))
    first.set(ylim=(min(low, 0.99 * float(fine.energy.min())), high))
    return drawing


def energy_and_phase(run: ExerciseMotion, period: float, true: tuple[Array, Array], labels: Labels) -> Figure:
    """Draw the energy of a run over its whole length and over its first swings, and the phase plot with an exact orbit.

    ``period`` is that of the swings [s].
    """
    drawing = blank((WIDTH, 3.1))
    with styled():
        whole, first, phase = drawing.subplots(1, 3, width_ratios=(1.0, 1.0, 1.15))
        for at, end in ((whole, float(run.time[-1])), (first, min(FIRST_SWINGS * period, float(run.time[-1])))):
            part = within(run.time, (0.0, end))
            at.plot(run.time[part], np.ones(len(run.time[part])), **{**EXACT, "linewidth": 3.0})
            at.plot(run.time[part], run.energy[part], **line(run, 0.7 if at is whole else 1.3))
            at.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
            low, high = float(run.energy[part].min()), float(run.energy[part].max())
            at.set(xlabel=labels["time"], xlim=(0.0, end), ylim=(low - 0.2 * (high - low), high + 0.2 * (high - low)))
        whole.set_ylabel(labels["energy"], fontsize=9)
        orbit(phase, run, true, labels, 0.5)
        drawing.legend(*phase.get_legend_handles_labels(), loc="outside upper right", ncols=3, fontsize=10)
    return drawing


def periods(worked: Worked, labels: Labels) -> Figure:
    """Draw the period against the amplitude, beside the elliptic integral, its series and the period of small swings;
    below, the relative difference of the simulated period from the elliptic integral."""
    large = worked.large
    size = np.radians(np.linspace(0.5, 155.0, 300))
    rest = math.tau / large.omega
    drawing = blank((WIDTH, 3.8))
    with styled():
        at, below = drawing.subplots(2, 1, sharex=True, height_ratios=(2.2, 1.0))
        at.plot(np.degrees(size), exact.period(size, large.omega), label=labels["elliptic"],
                **{**EXACT, "linewidth": 4.0})
        at.plot(np.degrees(size), rest * (1.0 + size**2 / 16.0), color=FAINT_INK, linestyle=LINES[1][0],
                label=labels["series"])
        at.axhline(rest, color=FAINT_INK, linestyle=LINES[2][0], label=labels["small"])
        amplitudes = [math.degrees(one.amplitude) for one in large.periods]
        mark = {"color": colour(large.run.method), "linestyle": "none", "marker": "o", "markersize": 6}
        at.plot(amplitudes, [one.measured for one in large.periods], label=labels["simulation"], **mark)
        at.set(ylabel=labels["period"], xlim=(0.0, 158.0))
        above(at, 4)
        below.plot(amplitudes, [100.0 * (one.measured / one.exact - 1.0) for one in large.periods], **mark)
        below.axhline(0.0, color=FAINT_INK, linewidth=0.8)
        below.set(xlabel=labels["amplitude"], ylabel=labels["period_error"])
    return drawing


def envelope(worked: Worked, labels: Labels) -> Figure:
    """Draw the amplitudes of the recording on a logarithmic axis, the readings, and the exponential through them; or
    the amplitudes read by hand with the envelopes of three laws."""
    if worked.given.amplitudes is not None:
        return amplitudes_by_hand(worked.given.amplitudes, words=labels)
    friction = worked.recorded
    points, readings = friction.points, friction.readings
    size = np.log(readings.amplitude)
    middle = float(np.mean(size + 0.5 * friction.gamma.value * readings.time))
    at_all = np.linspace(0.0, float(points.time[-1]), 50)
    drawing = blank((WIDTH, 3.0))
    with styled():
        at = drawing.subplots()
        at.plot(points.time, np.degrees(points.amplitude), markersize=3.4, label=labels["all_amplitudes"],
                **{**READING, "color": FAINT_INK})
        at.plot(readings.time, np.degrees(readings.amplitude), "o", markersize=9, markerfacecolor="none",
                markeredgewidth=1.8, color=SIGN, label=labels["readings"])
        at.plot(at_all, np.degrees(np.exp(middle - 0.5 * friction.gamma.value * at_all)), color=OKABE_ITO["blue"],
                linewidth=1.4, label=labels["line"])
        at.set_yscale("log")
        at.yaxis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0)))
        at.yaxis.set_major_formatter(FuncFormatter(lambda value, _place: f"{value:g}"))
        at.yaxis.set_minor_locator(NullLocator())
        at.set(xlabel=labels["since_release"], ylabel=labels["amplitude"], xlim=(0.0, float(points.time[-1]) * 1.02))
        above(at)
    return signed(drawing, worked, labels)


def damped_strips(worked: Worked, labels: Labels) -> Figure:
    """Draw the angle of the damped run, in strips."""
    return run_in_strips(worked.recorded.damped, worked.large.period, labels)


def recording_label(worked: Worked, labels: Labels) -> str:
    """Return the legend's text for the recording."""
    return labels["simulated_recording" if worked.given.simulated else "recording"]


def beside(worked: Worked, labels: Labels) -> Figure:
    """Draw the first and the last swings of the recording, left, and of its simulation, right, on equal axes."""
    compared = worked.recorded.compared
    end = float(compared.time[-1])
    length = ENDS * compared.period_recorded
    parts = [(0.0, length), (end - length, end)] if end > 2.0 * length else [(0.0, end)]
    drawing = blank((WIDTH, 0.6 + 1.7 * len(parts)))
    model = compared.model
    with styled():
        grid = drawing.subplots(len(parts), 2, sharey="row", squeeze=False)
        for row, span in zip(grid, parts, strict=True):
            part = few(compared.time, within(compared.time, span), compared.period_recorded)
            own = within(model.time, span)
            row[0].plot(compared.time[part], np.degrees(compared.recorded[part]), color=INK, marker=".", markersize=3.0,
                        linewidth=0.6)
            row[1].plot(model.time[own], np.degrees(model.angle[own]), **line(model, 1.3))
            row[0].set_ylabel(labels["angle"])
            for at in row:
                at.set_xlim(span)
        for at, title in zip(grid[0], (recording_label(worked, labels), labels["simulation"]), strict=True):
            at.set_title(title, fontsize=11)
        for at in grid[-1]:
            at.set_xlabel(labels["since_turn"])
    return signed(drawing, worked, labels)


def overlaid(worked: Worked, labels: Labels) -> Figure:
    """Draw the recording and its simulation over each other, in strips."""
    compared = worked.recorded.compared
    parts = spans(float(compared.time[-1]), compared.period_recorded)
    reach = math.degrees(max(np.max(np.abs(compared.recorded)), np.max(np.abs(compared.model.angle))))
    drawing, rows = strips(parts, reach, labels["since_turn"], labels)
    with styled():
        for at, span in zip(rows, parts, strict=True):
            part = few(compared.time, within(compared.time, span), compared.period_recorded)
            own = within(compared.model.time, span)
            at.plot(compared.model.time[own], np.degrees(compared.model.angle[own]), label=labels["simulation"],
                    **line(compared.model, 1.3))
            at.plot(compared.time[part], np.degrees(compared.recorded[part]), markersize=2.4,
                    label=recording_label(worked, labels), **READING)
        above(rows[0])
    return signed(drawing, worked, labels)


def difference(worked: Worked, labels: Labels) -> Figure:
    """Draw the difference of recording and simulation against time."""
    compared = worked.recorded.compared
    drawing = blank((WIDTH, 2.7))
    with styled():
        at = drawing.subplots()
        at.plot(compared.time, np.degrees(compared.difference), color=INK, linewidth=0.8)
        at.axhline(0.0, color=FAINT_INK, linewidth=0.8)
        at.set(xlabel=labels["since_turn"], ylabel=labels["difference"], xlim=(0.0, float(compared.time[-1])))
    return signed(drawing, worked, labels)


def readings(worked: Worked, labels: Labels) -> Figure:
    """Draw the simulation of the swing that amplitudes were read from, with the readings; below, the readings minus the
    simulated amplitudes, with the error of a reading."""
    beside = worked.recorded.by_hand
    assert beside is not None
    size, error, model = np.degrees(np.abs(beside.angle)), np.degrees(beside.error), beside.model
    drawing = blank((WIDTH, 4.4))
    with styled():
        at, below = drawing.subplots(2, 1, sharex=True, height_ratios=(2.0, 1.0))
        at.plot(model.time, np.degrees(model.angle), label=labels["simulation"], **line(model, 0.7))
        at.errorbar(beside.time, np.degrees(beside.angle), error, color=INK, marker="o", markersize=4.5,
                    linestyle="none", label=labels["readings"], zorder=3.0)
        at.set_ylabel(labels["angle"])
        above(at)
        below.errorbar(beside.time, size - np.degrees(beside.simulated), error, color=INK, marker="o", markersize=4.0,
                       linestyle="none", elinewidth=0.8)
        below.axhline(0.0, color=FAINT_INK, linewidth=0.8)
        below.set(xlabel=labels["since_reading"], ylabel=labels["off_simulation"], xlim=(0.0, float(model.time[-1])))
    return drawing


def lengths(worked: Worked, labels: Labels) -> Figure:
    """Draw T² against the length with its straight line, and the residuals."""
    assert worked.given.lengths is not None
    return lengths_by_hand(worked.given.lengths, words=labels)


def kater(worked: Worked, labels: Labels) -> Figure:
    """Draw both periods of the reversible pendulum against the position of the weight, and where they cross."""
    assert worked.given.kater is not None
    return kater_by_hand(worked.given.kater, words=labels)


def figures_of(worked: Worked) -> list[Callable[[Worked, Labels], Figure]]:
    """Return the figures of a report in its order: those of the exercise that its measurements allow, then those of
    tables by hand."""
    left_out = [frequency] if worked.given.simulated else []
    own = []
    if worked.recorded.by_hand is not None:
        left_out, own = [*left_out, beside, overlaid, difference], [readings]
    tables = [draw for draw in BY_HAND if getattr(worked.given, draw.__name__) is not None]
    return [*(draw for draw in FIGURES if draw not in left_out), *own, *tables]


BY_HAND: tuple[Callable[[Worked, Labels], Figure], ...] = (lengths, kater)
"""The figures of tables by hand; each is named as its function and as the attribute of ``Given`` that it draws."""


FIGURES: tuple[Callable[[Worked, Labels], Figure], ...] = (
    frequency, forward, forward_phase, halved, eulers, large_strips, large_energy, periods, envelope, damped_strips,
    damped_energy, beside, overlaid, difference,
)
"""The figures, in the order of the report; each is named as its function."""
