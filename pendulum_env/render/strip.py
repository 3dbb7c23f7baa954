"""The panels "history" and "residual", energies and the residual over the last ten seconds, and a tile of angles."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from pendulum_env.render.bars import energy_scale, joules
from pendulum_env.render.curves import graph
from pendulum_env.render.layout import Box
from pendulum_env.render.paint import Floats, Image, bar, disc
from pendulum_env.render.palette import ENERGY_COLOURS, Theme, rgb
from pendulum_env.render.text import LEAST_SIZE, MINUS, measure, write
from pendulum_env.render.view import View

Floats64 = NDArray[np.float64]

WINDOW = 10.0
"""Time that a plot covers [s]; the present is at its right end."""
REACH = (0.25, 1.15)
"""Ends of the axis of energies over time, as multiples of the scale of the energy bars."""
LEAST_SHARE = 0.2
"""Energies that stay below this share of the energy bars' scale are plotted on a smaller scale."""
RUNAWAY = 3.0
"""Limit of the axis of angles, as a multiple of the median of the pendulums' largest angles."""
_WIDEST = f"{MINUS}888 mJ"


def round_up(value: float, steps: tuple[float, ...] = (1.0, 2.0, 5.0)) -> float:
    """Return the next larger of the numbers ..., 1, 2, 5, 10, 20, ...; 1 for 0, negative and infinite values and nan.

    steps: the numbers from 1 to below 10 to round to, ascending; 1, 2 and 5 by default.
    """
    if not (0 < value < math.inf):
        return 1.0
    power = 10.0 ** math.floor(math.log10(value))
    if not power:
        return value
    return next((step * power for step in steps if value <= step * power * (1 + 1e-9)), 10.0 * power)


def letters(font: int) -> int:
    """Return the font size [px] of text in a frame's panels, smaller than the frame's main font size ``font``."""
    return max(LEAST_SIZE, round(0.82 * font))


class Strip:
    """A plot over the last ten seconds, with a title above it and a scale at its right, if there is room."""

    def __init__(self, area: Box, font: int, theme: Theme, lettered: bool, reach: tuple[float, float],
                 heads: int = 1, widest: str = _WIDEST) -> None:
        self.font, self.theme = letters(font), theme
        self.high = measure("0", self.font)[1]
        self.titled = lettered and area.height > 2.5 * self.high
        top = round(area.top + (heads * self.high if self.titled else 0))
        labels = measure(widest, self.font)[0] + round(0.4 * self.font)
        self.scaled = self.titled and area.width > 2.5 * labels
        right = round(area.right - (labels if self.scaled else 0))
        self.area, self.plot = area, Box(round(area.left), top, right, max(round(area.bottom), top + 2))
        self.line = max(1.2, 0.09 * font)
        self.unit = self.plot.height / sum(reach)
        self.zero = self.plot.bottom - reach[0] * self.unit
        self.rule = max(1, round(font / 16))

    def ground(self, image: Image, title: str) -> None:
        """Paint the plot's background, and its title if it fits."""
        plot, theme = self.plot, self.theme
        bar(image, plot.left, int(plot.top), plot.right, int(plot.bottom), rgb(theme.track))
        if self.titled and measure(title, self.font)[0] <= self.area.width:
            y = self.area.top + self.high / 2
            write(image, title, plot.left, y, self.font, theme.ink, (0.0, 0.5), theme.paper)

    def zero_line(self, image: Image, zero: float) -> None:
        """Paint the horizontal line at the value 0 of a plot, at the height ``zero`` [px]."""
        top = round(zero - self.rule / 2)
        bar(image, self.plot.left, top, self.plot.right, top + self.rule, rgb(self.theme.rule))

    def label(self, image: Image, text: str, y: float) -> None:
        """Write a value of the scale at the right of the plot, at a height [px] that is limited to the plot."""
        if self.scaled:
            half = self.high / 2
            y = min(max(y, self.plot.top + half), self.plot.bottom - half)
            write(image, text, self.area.right, y, self.font, self.theme.faint_ink, (1.0, 0.5), self.theme.paper)

    def curves(self, image: Image, view: View, series: Mapping[str, Floats64], scale: float, zero: float,
               unit: float) -> None:
        """Draw the graphs of energies over time, of :func:`recent`, into the plot.

        The value 0 J is at the height `zero` [px]; `scale` [J] is `unit` pixels above it.
        """
        plot, casing = self.plot, rgb(self.theme.casing)
        xs = plot.right - (view.time - _times(view)) * (plot.width / WINDOW)
        part, dot = image[int(plot.top):int(plot.bottom), :int(plot.right)], 1.1 * self.line
        for name, values in series.items():
            with np.errstate(over="ignore"):
                shares = (values / scale).clip(-1e3, 1e3)
            ys, tone = (zero - shares * unit).clip(plot.top - 9.0, plot.bottom + 9.0), rgb(ENERGY_COLOURS[name])
            if len(ys) == len(xs):
                graph(image, plot, xs, ys, self.line, tone, self.line * 0.35, casing)
            y = min(max(float(ys[-1]), plot.top), plot.bottom)
            disc(part, plot.right - dot, y - int(plot.top), dot, tone)


class History(Strip):
    """The panel "history" of a frame: kinetic and potential energy, heat and work over the last ten seconds.

    The axis has the scale of the energy bars. If the energies exceed this scale or stay below a fifth of it, the axis
    has a round scale of its own.
    """

    def __init__(self, area: Box, font: int, theme: Theme, lettered: bool, names: tuple[str, ...],
                 legend: bool) -> None:
        self.names = tuple(name for name in names or ("kinetic", "potential") if name != "residual")
        size = letters(font)
        self.side, gap = round(0.5 * size), 0.7 * size
        self.wide = [measure(name, size)[0] + 1.3 * self.side + gap for name in self.names]
        whole, high = sum(self.wide) - gap, measure("0", size)[1]
        beside = measure(self.title, size)[0] + gap + whole <= area.width
        below = not beside and whole <= area.width and area.height > 5 * high
        super().__init__(area, font, theme, lettered, REACH, 2 if legend and below else 1)
        self.legend = legend and self.titled and (beside or below)
        columns = np.arange(int(self.plot.left), int(self.plot.right))
        self.dashes = columns[(columns - columns[:1]) // max(2, round(0.16 * self.font)) % 2 == 0]
        self.key = (area.right - whole if beside else area.left, area.top + (0.5 if beside else 1.5) * high)

    @property
    def title(self) -> str:
        """Title above the plot of the energies."""
        return f"energy, last {WINDOW:g} s"

    def still(self, image: Image) -> None:
        """Paint the background of the plot of energies, and a legend of their colours."""
        self.ground(image, self.title)
        left, y = self.key
        for name, wide in zip(self.names, self.wide, strict=True) if self.legend else ():
            top = round(y - self.side / 2)
            bar(image, left, top, left + self.side, top + self.side, rgb(ENERGY_COLOURS[name]))
            write(image, name, left + 1.3 * self.side, y, self.font, self.theme.ink, (0.0, 0.5), self.theme.paper)
            left += wide

    def moving(self, image: Image, view: View, tone: Floats) -> None:
        """Paint the graphs of the energies up to the shown instant, and the scale of the axis; ``tone`` is not used."""
        series = {name: recent(view, name) for name in self.names if getattr(view, name) is not None}
        scale, zero, unit = self.axis(view, series.values())
        self.zero_line(image, zero)
        level = round(zero - unit)
        image[level:level + self.rule, self.dashes] = rgb(self.theme.rule)
        self.curves(image, view, series, scale, zero, unit)
        self.label(image, joules(scale), zero - unit)
        if unit == self.unit or self.plot.height > 3 * self.high:
            self.label(image, "0 J", zero)
        if unit != self.unit and self.plot.height > 2 * self.high:
            self.label(image, joules(-scale), zero + unit)

    def axis(self, view: View, series: Iterable[Floats64]) -> tuple[float, float, float]:
        """Return the scale of the energy axis [J], the height of 0 J [px], and the distance between the two [px].

        The scale is the energy at which the axis has its dashed line.
        """
        scale, energies = energy_scale(view), np.concatenate([[0.0], *series])
        energies = energies[np.isfinite(energies)]
        most, least = float(energies.max()), float(energies.min())
        far = max(most, -least)
        if far and (most > REACH[1] * scale or least < -REACH[0] * scale or far < LEAST_SHARE * scale):
            scale = round_up(far)
        if least >= -REACH[0] * scale:
            return scale, self.zero, self.unit
        return scale, self.plot.middle[1], self.plot.height / (2 * REACH[1])


class Residual(Strip):
    """The panel "residual" of a frame: the residual of the energy balance over the last ten seconds, and its value."""

    title = f"residual, last {WINDOW:g} s"

    def __init__(self, area: Box, font: int, theme: Theme, lettered: bool) -> None:
        super().__init__(area, font, theme, lettered, (1.1, 1.1))

    def still(self, image: Image) -> None:
        """Paint the background of the plot of the residual, its title and its line at 0 J."""
        self.ground(image, self.title)
        self.zero_line(image, self.zero)
        if self.plot.height > 3 * self.high:
            self.label(image, "0 J", self.zero)

    def moving(self, image: Image, view: View, tone: Floats) -> None:
        """Paint the graph of the residual up to the shown instant, and the scale of the axis; ``tone`` is not used."""
        series = recent(view, "residual")
        scale = view.residual_scale or round_up(_largest(series))
        if view.residual is not None:
            self.curves(image, view, {"residual": series}, scale, self.zero, self.unit)
            value, head = joules(view.residual), measure(self.title, self.font)[0]
            if self.titled and head + self.font + measure(value, self.font)[0] <= self.area.width:
                write(image, value, self.area.right, self.area.top + self.high / 2, self.font, self.theme.ink,
                      (1.0, 0.5), self.theme.paper)
        self.label(image, f"+{joules(scale)}", self.zero - self.unit)
        if self.plot.height > 2 * self.high:
            self.label(image, f"{MINUS}{joules(scale)}", self.zero + self.unit)


def shared_scale(views: Sequence[View]) -> float:
    """Return one limit for the residuals of several views [J], so that equal heights mean equal energies.

    It holds the largest residual, but is at most the next round number above the energy scale of the bars, so that a
    method that diverges leaves its own plot and does not flatten the others'.
    """
    return round_up(min(max(map(largest, views)), max(map(energy_scale, views))))


def largest(view: View) -> float:
    """Return the largest finite |residual| of the energy balance [J] in the ten seconds that a plot covers."""
    return _largest(recent(view, "residual"))


def _largest(values: Floats64) -> float:
    """Return the largest finite absolute value, 0 if there is none."""
    sizes = np.abs(values)
    return float(sizes[np.isfinite(sizes)].max(initial=0.0))


def _times(view: View) -> Floats64:
    """Return the times [s] of the last ten seconds, up to the shown instant."""
    if view.past is None:
        return np.array([view.time])
    times = np.append(view.past.time, view.time)
    return times[_within(times, view.time)]


def recent(view: View, name: str) -> Floats64:
    """Return the values [J] of one energy at :func:`_times` or, without those before, at the shown instant alone."""
    past, now = view.past, getattr(view, name)
    before = None if past is None else getattr(past, name)
    if past is None or before is None or now is None:
        return np.array([0.0 if now is None else now])
    return np.append(before[_within(past.time, view.time)], now)


def _within(times: Floats64, now: float) -> slice:
    """Return the slice of ascending times that a plot of the last ten seconds covers, and one time before them."""
    return slice(max(0, int(times.searchsorted(now - WINDOW)) - 1), len(times))


def angles(image: Image, area: Box, views: Sequence[View], tones: Sequence[str], font: int, theme: Theme,
           span: float = WINDOW) -> None:
    """Paint the angles of several pendulums over the last ``span`` seconds into an area, each in its colour.

    Until ``span`` seconds have passed, the curves grow from the left edge; then the plot moves on, with the present at
    its right edge.
    The axis fits the swings, so that a small one is visible, too; curves beyond 3 (RUNAWAY) times the median of the
    largest angles leave it. The first pendulum has the widest line, so that equal motions do not hide each other.
    """
    plot = Strip(area, font, theme, True, (1.1, 1.1), widest=f"{MINUS}100°")
    plot.ground(image, f"angle, last {span:.3g} s")
    series = []
    for view in views:
        past = view.past
        times = np.append(past.time if past else [], view.time)
        values = np.degrees(np.append(past.angle if past else [], view.angle))
        keep = _within(times, view.time)
        series.append((times[keep], values[keep]))
    now = max(view.time for view in views)
    reach = sorted(float(np.abs(values).max()) for _, values in series)
    limit = round_up(min(reach[-1], RUNAWAY * reach[len(reach) // 2]), (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0))
    plot.zero_line(image, plot.zero)
    for i, ((times, values), tone) in enumerate(zip(series, tones, strict=True)):
        xs = plot.plot.left + (times - max(0.0, now - span)) * (plot.plot.width / span)
        ys = np.clip(plot.zero - values / limit * plot.unit, plot.plot.top - 9.0, plot.plot.bottom + 9.0)
        wide = plot.line * (1.0 + 0.8 * (len(views) - 1 - i))
        graph(image, plot.plot, xs, ys, wide, rgb(tone))
        if plot.plot.top < ys[-1] < plot.plot.bottom:
            disc(image, min(float(xs[-1]), plot.plot.right - wide), float(ys[-1]), 1.1 * wide, rgb(tone))
    for text, y in ((f"{limit:g}°", -plot.unit), ("0°", 0.0), (f"{MINUS}{limit:g}°", plot.unit)):
        plot.label(image, text, plot.zero + y)
