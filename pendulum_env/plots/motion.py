"""Figures of one or more runs: angle, velocity, phase portrait, and deviation from the exact motion."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes

from pendulum_env.plots.series import (
    ExactMotion,
    FloatArray,
    Record,
    Span,
    bounds,
    check,
    dense,
    joined,
    largest,
    swing,
    swings,
    turning,
    whole,
    within,
)
from pendulum_env.plots.style import figure, looks, styled
from pendulum_env.plots.titles import describe, legend, named
from pendulum_env.render.palette import INK

if TYPE_CHECKING:
    from pendulum_env.engine.rollout import Rollout

EXACT: dict[str, Any] = {"color": "#CCCCCC", "lw": 6.0, "solid_capstyle": "butt", "zorder": 1.5}
RECORDING: dict[str, Any] = {"color": INK, "marker": "o", "markersize": 2.6, "linestyle": "none", "zorder": 3.0}
EXTREMES = {"angle": "turning points", "velocity": "extremes"}
"""Label of the axis if only the extremes of a curve are drawn, because it has many swings."""
BEYOND, TURNING = 5.0, 100.0
"""Largest extent of the axes, as a multiple of the usual reach of the curves; the second value holds for angles of
pendulums that turn over, because these drift apart for good."""
LEAST_ERROR = 1e-14
"""Distances from the exact angle below this [degrees] are not drawn."""


def angle(
    runs: Mapping[str, Rollout],
    *,
    exact: ExactMotion | None = None,
    recording: Record | None = None,
    span: Span | None = None,
    axes: Axes | None = None,
) -> Axes:
    """Draw the angle [degrees] of every run against time [s]; over many swings, curves through the turning points.

    If some maxima lie below some minima, as in gusts, the full curves are drawn in any case.

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
    recording: Record | None,
    span: Span | None,
    axes: Axes | None,
) -> Axes:
    """Draw the attribute ``name`` of every run, such as "angle", times ``factor``, against time [s]; see :func:`angle`.
    """
    check(runs)
    at = _axes(axes)
    span = span or whole(runs)
    many = dense(runs, span) and all(swings(getattr(run, name)[within(run.time, span)]) for run in runs.values())
    heights: dict[str, Span] = {}

    def curve(motion: Any, key: str) -> tuple[FloatArray, FloatArray]:
        part = within(motion.time, span)
        time, values = motion.time[part], factor * getattr(motion, name)[part]
        heights[key] = bounds(values)
        return turning(time, values) if many else (time, values)

    with styled():
        if exact is not None:
            at.plot(*curve(exact, "exact"), label=_word(exact), **EXACT)
        for key, look in looks(runs).items():
            at.plot(*curve(runs[key], key), label=named(key, runs[key]), **look.line)
            if runs[key].stop_reason and span[0] <= runs[key].time[-1] <= span[1]:
                at.plot(runs[key].time[-1], factor * getattr(runs[key], name)[-1], "x", color=look.colour, mew=2)
        if recording is not None:
            time, values = _seen(recording, span, many)
            at.plot(time, factor * values, label=recording.source, **RECORDING)
        _cut(at, heights, _first_swing(runs, name, factor), _most(runs) if name == "angle" else BEYOND)
        label += f"\n{EXTREMES[name]}" if many else ""
        at.set(xlabel="time [s]", ylabel=label, xlim=span, title=describe(runs))
        legend(at)
    return at


def deviation(
    runs: Mapping[str, Rollout], exact: ExactMotion, *, span: Span | None = None, axes: Axes | None = None
) -> Axes:
    """Draw the deviation of the angle from the exact motion [degrees] against time [s], on a logarithmic axis.

    The largest value in every half swing is drawn. ``exact`` must have the times of the runs, as far as they go; other
    arguments as of :func:`angle`. Raises ValueError for runs that cannot be drawn.
    """
    check(runs)
    at = _axes(axes)
    span = span or whole(runs)
    with styled():
        for key, look in looks(runs).items():
            run, count = runs[key], min(len(runs[key].time), len(exact.time))
            time = run.time[:count]
            shared = np.isclose(time, exact.time[:count], rtol=1e-12, atol=0.0)  # no stop between steps
            error = np.degrees(np.abs(run.angle[:count] - exact.angle[:count]))
            time, error = largest(time[shared], error[shared], 0.5 * swing(runs))
            at.plot(time, np.where(error > LEAST_ERROR, error, math.nan), label=named(key, run), **look.line)
        at.set_yscale("log")
        at.minorticks_off()
        label = f"|angle \N{MINUS SIGN} {_word(exact)}| [degrees]\nlargest in each half swing"
        at.set(xlabel="time [s]", ylabel=label, xlim=span, title=describe(runs))
        legend(at)
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
    at = _axes(axes, size=(7.2, 6.8))
    shown = tuple(spans) or (whole(runs),)
    wide: dict[str, Span] = {}
    high: dict[str, Span] = {}

    def orbit(motion: Any, key: str) -> tuple[FloatArray, FloatArray]:
        parts = [within(motion.time, span) for span in shown]
        x = joined(np.degrees(motion.angle[part]) for part in parts)
        y = joined(motion.velocity[part] for part in parts)
        wide[key], high[key] = bounds(x), bounds(y)
        return x, y

    with styled():
        if exact is not None:
            at.plot(*orbit(exact, "exact"), label=_word(exact), **EXACT)
        for key, look in looks(runs).items():
            at.plot(*orbit(runs[key], key), label=named(key, runs[key]), **look.solid)
        first = next(iter(runs.values()))
        at.plot(math.degrees(first.angle[0]), float(first.velocity[0]), "o", color=INK, ms=6, label="start", zorder=4)
        at.margins(0.05)
        _cut(at, high, _first_swing(runs, "velocity", 1.0))
        _cut(at, wide, _first_swing(runs, "angle", math.degrees(1.0)), _most(runs), across=True)
        at.set(xlabel="angle [degrees]", ylabel="velocity [rad/s]", title=describe(runs))
        if note:
            at.annotate(note, (0.0, 0.0), (0.0, -40.0), "axes fraction", "offset points", va="top", color=INK,
                        annotation_clip=False)
        legend(at)
    return at


def _axes(axes: Axes | None, **options: Any) -> Axes:
    """Return the given axes to draw into or, for None, those of a new figure with the ``options`` of :func:`figure`."""
    return axes if axes is not None else figure(**options)[1][0]


def _word(exact: ExactMotion) -> str:
    """Return the legend text of an exact motion: "exact" or, if it is a numerical reference solution, "reference"."""
    return "exact" if getattr(exact, "closed", True) else "reference"


def _seen(recording: Record, span: Span, many: bool) -> tuple[FloatArray, FloatArray]:
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


def _cut(at: Axes, spread: Mapping[str, Span], first: float, most: float = BEYOND, across: bool = False) -> None:
    """Limit an axis to ``most`` times the usual reach, so that runaway curves do not flatten the others.

    The reach of a curve is its largest absolute value, and the usual reach that of the median curve, so up to half of
    the curves may run away. It is at least that of the exact motion or, without one, of the ``first`` swing, so that
    most curves may die away. ``spread`` gives the lowest and highest value of every curve; ``across`` selects the
    horizontal axis.
    """
    reach = sorted(size for span in spread.values() if (size := _reach(span)) > 0.0)
    if not reach:
        return
    usual = max(reach[(len(reach) - 1) // 2], _reach(spread["exact"]) if "exact" in spread else first)
    if reach[-1] > (limit := most * usual):
        low = max(min(low for low, _ in spread.values()), -limit)
        high = min(max(high for _, high in spread.values()), limit)
        margin = 0.05 * (high - low)
        (at.set_xlim if across else at.set_ylim)(low - margin, high + margin)
