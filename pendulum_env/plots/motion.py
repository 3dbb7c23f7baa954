"""Figures of one or more runs: angle, velocity, phase portrait, and deviation from the exact motion."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pendulum_env.plots.series import (
    DENSE,
    ExactMotion,
    FloatArray,
    ShownRecord,
    Span,
    bounds,
    check,
    crowded,
    dense,
    joined,
    peaks,
    periods,
    swing,
    swings,
    turning,
    whole,
    within,
)
from pendulum_env.plots.style import ALONE, Look, logarithmic, looks, panel
from pendulum_env.plots.titles import describe, fitted, footnote, for_figure, legend, named, over_time, page
from pendulum_env.render.palette import INK

if TYPE_CHECKING:
    from pendulum_env.engine.rollout import Rollout

EXACT: dict[str, Any] = {"color": "#CCCCCC", "linewidth": 6.0, "solid_capstyle": "butt", "zorder": 1.5}
RECORDING: dict[str, Any] = {"color": INK, "marker": "o", "markersize": 2.6, "linestyle": "none", "zorder": 3.0}
EXTREMES = {"angle": "between turning points", "velocity": "between extremes"}
"""Label of the axis if bands between the extremes of curves are drawn, because these have too many swings."""
THIN, BAND = 0.8, 0.3
"""Width of curves with many swings, and opacity of the band between the extremes of a curve with too many."""
NOTE_SIZE, NOTE_EDGE = 10.0, 50.0
"""Font size of the note beside phase portraits, and width of a portrait that its text leaves free [points]."""
PORTRAIT, CELL, COLUMNS = (7.2, 6.8), (3.7, 3.5), 3
"""Size of a phase portrait, and of each of several in one figure [inch], and the number of these in a row."""
BEYOND, TURNING = 5.0, 100.0
"""Largest extent of the axes, as a multiple of the usual reach of the curves; the second value holds for angles of
pendulums that turn over, because these drift apart for good."""
LEAST_ERROR = 1e-14
"""Distances from the exact angle below this [degrees] are not drawn."""


def angle(
    runs: Mapping[str, Rollout],
    *,
    exact: ExactMotion | None = None,
    recording: ShownRecord | None = None,
    span: Span | None = None,
    axes: Axes | None = None,
) -> Axes:
    """Draw the angle [degrees] of every run against time [s].

    Over more than 15 (DENSE) swings curves are thin and solid; over more than 150 (CROWDED) each is a band between its
    turning points, unless some maxima lie below some minima, as in gusts.

    Args:
        runs: rollouts by their labels.
        exact: exact motion, drawn wide and grey behind the runs; labelled "reference" if it has an attribute
            ``closed`` that is False.
        recording: recording of a real pendulum, drawn as dots.
        span: time to show [s]; by default all of it.
        axes: axes to draw into; by default those of a new figure.

    Raises ValueError for runs that cannot be drawn.
    """
    return _over_time(runs, "angle", math.degrees(1.0), "angle [degrees]", exact, recording, span, axes)


def velocity(
    runs: Mapping[str, Rollout],
    *,
    exact: ExactMotion | None = None,
    span: Span | None = None,
    axes: Axes | None = None,
) -> Axes:
    """Draw the angular velocity [rad/s] of every run against time [s]; arguments as of :func:`angle`.

    Raises ValueError for runs that cannot be drawn.
    """
    return _over_time(runs, "velocity", 1.0, "velocity [rad/s]", exact, None, span, axes)


def _over_time(
    runs: Mapping[str, Rollout],
    name: str,
    factor: float,
    label: str,
    exact: ExactMotion | None,
    recording: ShownRecord | None,
    span: Span | None,
    axes: Axes | None,
) -> Axes:
    """Draw the attribute ``name`` of every run, such as "angle", times ``factor``, against time [s]; see :func:`angle`.
    """
    heights: dict[str, FloatArray] = {}
    with over_time(runs, span, axes) as (at, shown):
        many = crowded(runs, shown) and all(
            swings(getattr(run, name)[within(run.time, shown)]) for run in runs.values())
        thin = {"linewidth": THIN, "linestyle": "-"} if dense(runs, shown) and not many else {}

        def curve(motion: Any, key: str, label: str, style: dict[str, Any]) -> None:
            part = within(motion.time, shown)
            time, values = motion.time[part], factor * getattr(motion, name)[part]
            heights[key] = values
            if many:
                time, values = turning(time, values)
                at.fill(*_outline(time, values), color=style["color"], alpha=BAND, linewidth=0.0,
                        zorder=style["zorder"])
            at.plot(time, values, label=label, **{**style, **thin})

        if exact is not None:
            curve(exact, "exact", _word(exact), EXACT)
        for key, look in looks(runs).items():
            curve(runs[key], key, named(key, runs[key]), look.line)
            if runs[key].stop_reason and shown[0] <= runs[key].time[-1] <= shown[1]:
                at.plot(runs[key].time[-1], factor * getattr(runs[key], name)[-1], "x", color=look.colour, mew=2)
        if recording is not None:
            time, values = _seen(recording, shown, many)
            at.plot(time, factor * values, label=for_figure(recording.source), **RECORDING)
        _cut(at, heights, _first_swing(runs, name, factor), _most(runs) if name == "angle" else BEYOND)
        at.set_ylabel(f"{label}\n{EXTREMES[name]}" if many else label)
    return at


def deviation(
    runs: Mapping[str, Rollout], exact: ExactMotion, *, span: Span | None = None, axes: Axes | None = None
) -> Axes:
    """Draw the deviation of the angle from the exact motion [degrees] against time [s], on a logarithmic axis.

    The largest value in each half swing is drawn. ``exact`` must have the times of the runs, as far as they go; other
    arguments as of :func:`angle`. Raises ValueError for runs that cannot be drawn.
    """
    with over_time(runs, span, axes) as (at, _):
        for key, look in looks(runs).items():
            run, count = runs[key], min(len(runs[key].time), len(exact.time))
            time = run.time[:count]
            shared = np.isclose(time, exact.time[:count], rtol=1e-12, atol=0.0)  # no stop between steps
            error = np.degrees(np.abs(run.angle[:count] - exact.angle[:count]))
            time, error = peaks(time[shared], error[shared], run.velocity[:count][shared], 0.5 * swing(runs))
            at.plot(time, np.where(error > LEAST_ERROR, error, math.nan), label=named(key, run), **look.line)
        logarithmic(at)
        at.set_ylabel(f"|angle \N{MINUS SIGN} {_word(exact)}| [degrees]\nlargest in each half swing")
    return at


def phase(
    runs: Mapping[str, Rollout],
    *,
    exact: ExactMotion | None = None,
    note: str = "",
    spans: Sequence[Span] = (),
    axes: Axes | None = None,
) -> Axes:
    """Draw the phase portrait, velocity [rad/s] against angle [degrees], with the exact orbit behind the runs.

    The start is marked. ``note`` is a text below the portrait, for example on why the orbit is an ellipse; ``spans``
    are the parts of the time to show [s], by default all of it; other arguments as of :func:`angle`. Raises ValueError
    for runs that cannot be drawn.
    """
    check(runs)
    with panel(axes, PORTRAIT) as at:
        gap = _orbits(at, runs, exact, spans)
        at.set(xlabel="angle [degrees]", ylabel="velocity [rad/s]", title=describe(runs))
        if note := "\n".join(part for part in (note, _left_out(gap)) if part):
            at.annotate(note, (0.0, 0.0), (0.0, -40.0), "axes fraction", "offset points", va="top", color=INK,
                        annotation_clip=False)
        legend(at)
    return at


def portraits(
    runs: Mapping[str, Rollout],
    *,
    exact: ExactMotion | None = None,
    note: str = "",
    spans: Sequence[Span] = (),
    figure: Figure | None = None,
) -> Figure:
    """Draw the phase portrait of every run into axes of its own, so that no method hides another.

    All axes have the exact orbit behind the run and the start marked, and their own limits. ``figure`` is drawn into
    and resized, by default a new one; other arguments as of :func:`phase`. A single run gets one large portrait.
    Raises ValueError for runs that cannot be drawn.
    """
    check(runs)
    if len(runs) == 1:
        with page(PORTRAIT, figure) as drawing:
            phase(runs, exact=exact, note=note, spans=spans, axes=drawing.subplots())
        return drawing
    columns = 2 if len(runs) in (2, 4) else COLUMNS
    rows = -(-len(runs) // columns)
    spare = columns * rows - len(runs)
    with page((CELL[0] * columns, CELL[1] * rows + (0.4 if spare else 1.3)), figure, describe(runs)) as drawing:
        places = list(drawing.subplots(rows, columns, squeeze=False).flat)
        gap = 1
        for at, (key, run), look in zip(places, runs.items(), looks(runs).values(), strict=False):
            gap = max(gap, _orbits(at, {key: run}, exact, spans, look))
            at.set(xlabel="angle [degrees]", ylabel="velocity [rad/s]")
            at.set_title(named(key, run), loc="left", color=look.colour, fontsize=11)
        for at in places[len(runs):]:
            at.set_axis_off()
        behind = f"Grey: {_word(exact)} motion. " if exact is not None else ""
        text = "\n".join(part for part in (f"{behind}Black dot: start.", _left_out(gap), note) if part)
        if spare:
            room = 72.0 * CELL[0] - NOTE_EDGE
            places[len(runs)].text(0.0, 1.0, fitted(text, NOTE_SIZE, room), va="top", fontsize=NOTE_SIZE, color=INK)
        else:
            footnote(drawing, text, NOTE_SIZE)
    return drawing


def _orbits(
    at: Axes, runs: Mapping[str, Rollout], exact: ExactMotion | None, spans: Sequence[Span], own: Look | None = None
) -> int:
    """Draw the orbits of a phase portrait, the exact one first, and the start of the first run.

    ``own`` is the style of a run that is alone in its axes, but not in the figure. Of many swings, every n-th period is
    drawn, so that neighbouring turns of a spiral stay apart; this n is returned.
    """
    shown = tuple(spans) or (whole(runs),)
    lines = {key: look.solid for key, look in looks(runs).items()}
    if own is not None:
        lines = dict.fromkeys(runs, {"color": own.colour, "linewidth": ALONE, "zorder": 3.0} | own.edge(ALONE))
    thin = {"linewidth": THIN, "marker": ""} if sum(last - first for first, last in shown) > DENSE * swing(runs) else {}
    wide: dict[str, FloatArray] = {}
    high: dict[str, FloatArray] = {}
    gaps = []

    def orbit(motion: Any, key: str, label: str, style: dict[str, Any]) -> None:
        parts = [within(motion.time, span) for span in shown]
        gap, parts = periods(motion.velocity, parts)
        gaps.append(gap)
        wide[key] = joined(np.degrees(motion.angle[part]) for part in parts)
        high[key] = joined(motion.velocity[part] for part in parts)
        at.plot(wide[key], high[key], label=label, **style)

    most = _most(runs)
    if exact is not None:
        orbit(exact, "exact", _word(exact), EXACT | ({"linewidth": 2.5 * THIN} if thin else {}))
        most = TURNING if _reach(bounds(exact.angle)) > math.pi else BEYOND
    for key, line in lines.items():
        orbit(runs[key], key, named(key, runs[key]), line | thin)
    first = next(iter(runs.values()))
    at.plot(math.degrees(first.angle[0]), float(first.velocity[0]), "o", color=INK, ms=6, label="start", zorder=4)
    at.margins(0.05)
    _cut(at, high, _first_swing(runs, "velocity", 1.0))
    _cut(at, wide, _first_swing(runs, "angle", math.degrees(1.0)), most, across=True)
    return max(gaps)


def _left_out(gap: int) -> str:
    """Return the sentence that only every n-th period is drawn, ``gap`` being n; "" if all are."""
    return f"One period in {gap} is drawn." if gap > 1 else ""


def _outline(time: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the outline of a band between the two parts of a curve, its maxima and its minima, from :func:`turning`.
    """
    gap = int(np.argmax(np.isnan(values))) if np.isnan(values).any() else len(values)
    return (np.concatenate((time[:gap], time[:gap:-1])), np.concatenate((values[:gap], values[:gap:-1])))


def _word(exact: ExactMotion) -> str:
    """Return the legend text of an exact motion: "exact" or, if it is a numerical reference solution, "reference"."""
    return "exact" if getattr(exact, "closed", True) else "reference"


def _seen(recording: ShownRecord, span: Span, many: bool) -> tuple[FloatArray, FloatArray]:
    """Return times and angles of a recording in a span of time [s]; if swings are ``many``, only its turning points."""
    from pendulum_env.lab.turning import extremes

    part = within(recording.time, span)
    time, values = recording.time[part], recording.angle[part]
    if not many or len(time) < 5:
        return time, values
    indices = extremes(time, values)
    return time[indices], values[indices]


def _first_swing(runs: Mapping[str, Rollout], name: str, factor: float) -> float:
    """Return the largest absolute value of every run in its first period, and of these the smallest, to scale an axis.
    """
    span = 0.0, swing(runs)
    return min(_reach(bounds(factor * getattr(run, name)[within(run.time, span)])) for run in runs.values())


def _most(runs: Mapping[str, Rollout]) -> float:
    """Return how far an angle axis extends, as a multiple of the runs' usual reach: TURNING (100) if the median run
    turns over, else BEYOND (5). The reach of a run is its largest absolute value.
    """
    reach = sorted(_reach(bounds(run.angle)) for run in runs.values())
    return TURNING if reach[(len(reach) - 1) // 2] > math.pi else BEYOND


def _reach(span: Span) -> float:
    """Return the largest absolute value of a range (low, high)."""
    return max(-span[0], span[1])


def _cut(at: Axes, drawn: Mapping[str, FloatArray], first: float, most: float = BEYOND, across: bool = False) -> None:
    """Limit an axis to ``most`` times the usual reach, so that runaway curves do not flatten the others.

    The reach of a curve is its largest absolute value, and the usual reach that of the median curve, so up to half of
    the curves may run away. It is at least that of the exact motion or, without one, of the ``first`` swing, so that
    most curves may die away. ``drawn`` has the values of every curve; ``across`` selects the horizontal axis. The axis
    ends at the last value within the limits, so that no part of it is empty.
    """
    reach = sorted(size for values in drawn.values() if (size := _reach(bounds(values))) > 0.0)
    if not reach:
        return
    usual = max(reach[(len(reach) - 1) // 2], _reach(bounds(drawn["exact"])) if "exact" in drawn else first)
    if reach[-1] > (limit := most * usual):
        values = np.concatenate(list(drawn.values()))
        low, high = bounds(values[np.abs(values) <= limit])
        margin = 0.05 * (high - low)
        (at.set_xlim if across else at.set_ylim)(low - margin, high + margin)
