"""Photogates: the small-amplitude period, and g or the length, from gate states, passages or periods."""

from __future__ import annotations

import math
import os
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.results import Displayed, one_line
from pendulum_env.common.saved import Savable
from pendulum_env.lab.checked import FloatArray, RecordingError, file_name, known, numbers, one_number
from pendulum_env.lab.columns import described
from pendulum_env.lab.containers import text_of
from pendulum_env.lab.fitting.statistics import correlation_time
from pendulum_env.lab.measures import FromFile, Measurement, doubt_of_gravity, doubt_of_length
from pendulum_env.lab.quantities import AMPLITUDE, ANGLE, GATE, LENGTH, PERIOD, TIME
from pendulum_env.lab.table import TextTable
from pendulum_env.physics import exact

if TYPE_CHECKING:
    from pendulum_env.common.texts import Table

FEWEST = 4
"""Fewest periods from which the decay of the amplitude can be found."""
UNSEEN = math.radians(10.0)
"""Amplitude [rad] up to which the error of T0 covers periods that show no amplitude."""
_ANGLES = re.compile("angle|winkel", re.IGNORECASE)
STATES = ("changes", "readings")
"""Meanings of the rows of a file with gate states."""
REPEATED, EVEN = 0.1, 0.05
"""Largest share of repeated states among changes, and largest relative spread of the time steps of readings."""
GRAVITY = 9.81
"""Gravity [m/s²] unless it is given."""


@dataclass(frozen=True, eq=False, repr=False)
class GateSheet(FromFile, Savable, Displayed):
    """Periods measured with a photogate, and what follows from them; :func:`measure_gate` returns it.

    Attributes:
        source: name of the file or other source.
        periods: period of each cycle [s]; cycles may overlap by half.
        amplitudes: amplitude of each cycle [rad], given or from the decay of the periods; nan where unknown.
        period: mean period [s].
        small_period: period at small amplitude [s].
        length: length of the point pendulum with this period [m], with the given gravity.
        gravity: gravity [m/s²] at the given length; None if no length was given.
        how: sentences on how the periods and the amplitudes were found.
    """

    source: str
    periods: FloatArray
    amplitudes: FloatArray
    period: Measurement
    small_period: Measurement
    length: Measurement
    gravity: Measurement | None
    how: tuple[str, ...]

    def __repr__(self) -> str:
        return one_line(self, f"{self.source}, {len(self.periods)} periods, T0 = {self.small_period}")

    @property
    def table(self) -> Table:
        """Table of the sheet: one row per quantity, with value, standard error and unit."""
        from pendulum_env.common.texts import Table

        rows = [("mean period T", self.period), ("small-amplitude period T0", self.small_period),
                ("length, from T0 and g", self.length)]
        rows += [("g, from T0 and the length", self.gravity)] if self.gravity is not None else []
        return Table(("quantity", "value", "error", "unit"),
                     tuple((name, f"{one.value:.7g}", f"{one.error:.2g}", one.unit) for name, one in rows))

    @property
    def text(self) -> str:
        """The sheet's sentences on how the periods and the amplitudes were found, one per line."""
        return "\n".join(self.how)


def measure_gate(
    path: str | os.PathLike[str], *, gravity: float = GRAVITY, length: float | None = None, length_error: float = 0.0,
    states: str | None = None,
) -> GateSheet:
    """Measure the period of a pendulum from the file of a photogate at the bottom of its swing.

    ``T = T0 / agm(1, cos(A/2))`` is the period at the amplitude A (Carvalhaes & Suppes 2008, Am. J. Phys. 76, 1150),
    and ``T0 = 2 pi sqrt(L/g)``. T0 is fitted by least squares to all periods. Their amplitudes are those of the file,
    else proportional to 1/(time in the beam), else exponential in time, if the periods show it; otherwise T0 is the
    mean period, and its error covers amplitudes up to 10 degrees, ``T A²/16``.

    Args:
        path: a text file of one of four kinds: times and gate states (1: blocked); times of passages, one per line;
            periods, one per line; or amplitudes [degrees, or rad by its title] and periods.
        gravity: gravity [m/s²], for the length.
        length, length_error: measured length and its error [m], for the gravity.
        states: the meaning of a row of a file with gate states: "changes", the beam was blocked or freed at this time,
            or "readings", the beam was read at this time; None: changes if the states alternate, readings if most rows
            repeat the state before.

    Raises RecordingError for another file, for less than two periods, for invalid numbers, and for states that may be
    changes or readings.
    """
    if states is not None:
        known(states, "states", STATES)
    name = file_name(path)
    text, notes = text_of(name)
    table = TextTable(name, text)
    titles = [" ".join(title).lower() for title in table.titles]
    if table.width == 1:
        sheet = _of_list(name, _columns(table, 0)[:, 0], " ".join(table.header).lower())
    elif any(map(PERIOD.names, titles)):
        sheet = _of_table(table, titles)
    elif any(map(GATE.names, titles)) or _two_states(table):
        sheet = _of_states(name, _columns(table, *_state_columns(titles)), states)
    else:
        raise RecordingError(f"{name}: expected gate states, passages or periods of a photogate; "
                             f"{described(table, titles)}")
    return _with_size(replace(sheet, source=Path(name).name, how=(*notes, *sheet.how)), gravity, length, length_error)


def is_gate(path: str | os.PathLike[str]) -> bool:
    """Return True if the titles of a file, or its single column without a rate, show that a photogate wrote it."""
    try:
        table = TextTable(str(path), text_of(str(path))[0])
    except RecordingError:
        return False
    titles = [" ".join(title) for title in table.titles]
    if table.width == 1:
        return table.rate is None and "angle" not in " ".join(table.header).lower()
    if any(map(ANGLE.names, titles)):
        amplitudes = [title for title in titles if "amplitud" in title.lower()]
        return bool(amplitudes) and any(map(PERIOD.names, titles)) and not _ANGLES.search(" ".join(titles))
    return any("state" in title.lower() for title in titles) or (not any(titles) and _two_states(table))


def _columns(table: TextTable, *places: int) -> FloatArray:
    """Return the rows of a table with numbers in some columns."""
    values, _ = table.values(places, "numbers")
    return values[np.isfinite(values).all(axis=1)]


def _state_columns(titles: list[str]) -> tuple[int, int]:
    """Return the numbers of the columns of the times and the states of the beam."""
    state = next((i for i, title in enumerate(titles) if GATE.names(title) and not TIME.names(title)), 1)
    return next((i for i, title in enumerate(titles) if TIME.names(title) and i != state), 0), state


def _two_states(table: TextTable) -> bool:
    """Return True if the second column of a table with two columns holds nothing but 0 and 1."""
    return table.width == 2 and {fields[1] for _, fields in table.rows if len(fields) > 1} == {"0", "1"}


def _of_table(table: TextTable, titles: list[str]) -> GateSheet:
    """Return the sheet of a table with amplitudes and periods."""
    at = next(i for i, title in enumerate(titles) if PERIOD.names(title))
    sized = [i for i, title in enumerate(titles) if AMPLITUDE.names(title) and i != at]
    other = next((title for title in titles if LENGTH.names(title)), "")
    if other or not sized:
        wrong = LENGTH if other else PERIOD
        raise RecordingError(f"{table.name}: {wrong.refusal(other or titles[at])}")
    values = _columns(table, sized[0], at)
    degrees = "rad" not in titles[sized[0]]
    sizes = np.radians(values[:, 0]) if degrees else values[:, 0]
    how = f"Amplitudes are those of the file, in {'degrees' if degrees else 'rad'}."
    return _decaying(table.name, values[:, 1], np.arange(float(len(values))), sizes, (how,), given=True)


def _of_list(name: str, values: FloatArray, header: str) -> GateSheet:
    """Return the sheet of a list of passages, which increase, or of periods, which do not."""
    spread = np.diff(values)
    if "period" not in header and len(values) > 2 and (spread > 0.0).all() and values[-1] > 3.0 * abs(values[0]):
        return _of_passages(name, values, None)
    half = "half" in header
    periods = 2.0 * values if half else values
    times = np.concatenate([[0.0], np.cumsum(periods[:-1])]) + 0.5 * periods
    return _decaying(name, periods, times, None, ("Each line is the time of half a swing." if half else
                                                  "Each line is one period.",))


def _of_states(name: str, rows: FloatArray, states: str | None) -> GateSheet:
    """Return the sheet of times and states of the beam, blocked (1) or free (0); see :func:`measure_gate`."""
    time, blocked = rows[:, 0], rows[:, 1] > 0.5
    begins, ends = (np.flatnonzero(change) + 1 for change in (~blocked[:-1] & blocked[1:], blocked[:-1] & ~blocked[1:]))
    kind = states or _kind_of_states(name, time, blocked)
    if kind == "changes":  # the row before the one that frees the beam is that which blocked it
        return _of_passages(name, 0.5 * (time[ends - 1] + time[ends]), time[ends] - time[ends - 1])
    ends = ends[ends > min(begins, default=len(time))]  # a block that lasts from before the first reading has no begin
    begins = begins[: len(ends)]
    return _of_passages(name, 0.5 * (time[begins] + time[ends - 1]), time[ends] - time[begins])


def _kind_of_states(name: str, time: FloatArray, blocked: NDArray[np.bool_]) -> str:
    """Return "changes" or "readings", whichever the rows of a file with gate states are.

    Changes alternate, in all rows but a few (REPEATED) that were lost. Most readings repeat the state before, or come
    at a constant rate (EVEN). Raises RecordingError where both or neither can be.
    """
    repeated, steps = float(np.mean(blocked[1:] == blocked[:-1])), np.diff(time)
    even = float(np.ptp(steps)) <= EVEN * float(np.median(steps))
    changes, readings = repeated <= REPEATED, repeated >= 0.5 or even
    if changes != readings:
        return "changes" if changes else "readings"
    raise RecordingError(f"{name}: the rows may be changes of the beam or readings of it, as {repeated:.0%} of them "
                         f"repeat the state before{' at a constant rate' if even else ''}; give states=changes or "
                         "states=readings (--states)")


def _of_passages(name: str, times: FloatArray, spans: FloatArray | None) -> GateSheet:
    """Return the sheet of successive passages through a gate near the bottom, two in each period.

    A gate beside the bottom makes the two halves of a period unequal, so that only whole periods are taken.
    """
    if len(times) < 5:
        raise RecordingError(f"{name}: expected at least 5 passages of the gate, found {len(times)}")
    usual, crossed = float(np.median(times[2:] - times[:-2])), None
    if spans is not None and (spans > 0.0).all():
        crossed = np.sin(np.minimum(math.pi / usual * spans, 0.5 * math.pi))  # half the width over the amplitude
        # Drag makes the second half of a span longer, so that its middle is late by gamma span²/8; gamma = 2 decay.
        times = times - 0.25 * _decay(times, 1.0 / crossed) * spans**2
    periods, middle = times[2:] - times[:-2], times[1:-1]
    whole = np.abs(periods / usual - 1.0) < 0.2
    relative = None if crossed is None else np.median(crossed) / crossed[1:-1][whole]
    lost = np.count_nonzero(~whole)
    how = ["Each period lasts from one passage to the next but one."]
    how += [f"{lost} periods left out, as passages are missing or double."] if lost else []
    return _decaying(name, periods[whole], middle[whole], relative, tuple(how))


def _decaying(
    name: str, periods: FloatArray, times: FloatArray, relative: FloatArray | None, how: tuple[str, ...],
    given: bool = False,
) -> GateSheet:
    """Return the sheet of periods whose amplitudes A are unknown, or sin(A/2) but for a factor (``relative``).

    With ``given``, ``relative`` are amplitudes at the release, which are a little larger than those of the whole cycle,
    by a factor that is fitted.
    """
    from scipy.optimize import least_squares

    if len(periods) < 2:
        raise RecordingError(f"{name}: expected at least 2 periods, found {len(periods)}")
    if given:
        flat = _fitted(name, periods, np.asarray(relative), how)
    else:
        unknown = (*how, "The periods show no amplitude: T0 is their mean, and its error covers amplitudes up to "
                   f"{math.degrees(UNSEEN):g} degrees. If they were larger, give them in a column 'Amplitude (deg)'.")
        flat = _fitted(name, periods, np.zeros(len(periods)), unknown)
        longer = float(exact.period(UNSEEN, math.tau)) - 1.0
        small = flat.small_period
        error = math.hypot(small.error, longer * small.value)
        flat = replace(flat, amplitudes=np.full(len(periods), math.nan), small_period=replace(small, error=error))
    if len(periods) < FEWEST:
        return flat
    since = (times - times[0]) / max(float(times[-1] - times[0]), 1e-300)

    def sizes(x: FloatArray) -> FloatArray:
        if relative is None:
            return np.asarray(np.clip(x[1] * np.exp(-x[2] * since), 0.0, 3.0))
        return np.asarray(np.clip(x[1] * relative, 0.0, 3.0) if given else
                          2.0 * np.arcsin(np.clip(0.5 * x[1] * relative, 0.0, 0.999)))

    def miss(x: FloatArray) -> FloatArray:
        return np.asarray(exact.period(sizes(x), math.tau / x[0]) - periods) / float(np.mean(periods))

    start = [float(periods.min()), 0.4, *([1.0] if relative is None else [])]
    bounds = ([0.5 * start[0], 1e-3, 0.0][: len(start)], [1.5 * start[0], 2.9, 50.0][: len(start)])
    found = least_squares(miss, start, bounds=bounds, x_scale=[0.01 * start[0], 0.1, 1.0][: len(start)])
    count, own = len(periods), float(np.sum(found.fun**2))
    rest = float(np.sum((periods / periods.mean() - 1.0) ** 2))
    # Bayesian information criterion: the amplitude must explain more than its one or two parameters (Schwarz 1978).
    if not count * math.log(max(rest, 1e-300) / max(own, 1e-300)) > (len(start) - 1) * math.log(count) + 6.0:
        return flat
    slopes = np.asarray(found.jac)
    covariance = np.linalg.pinv(slopes.T @ slopes) * own / max(count - len(start), 1) * max(
        correlation_time(np.asarray(found.fun)), 1.0)
    what = "exponential in time" if relative is None else "in proportion to the speed in the beam"
    first, last = (math.degrees(sizes(found.x)[i]) for i in (0, -1))
    size = f"The amplitude falls from {first:.3g} to {last:.3g} degrees, {what}, as the periods show."
    if given:
        size = f"The mean amplitudes of the cycles are {found.x[1]:.3g} times these, as the periods show."
    small = Measurement(float(found.x[0]), math.sqrt(float(covariance[0, 0])), "s")
    if not given:  # drag lengthens the period of a harmonic oscillator by sqrt(1 + (d/omega0)²)
        small = small / math.hypot(1.0, _decay(times, sizes(found.x)) * small.value / math.tau)
    return replace(flat, amplitudes=sizes(found.x), small_period=small, how=(*how, size))


def _decay(times: FloatArray, sizes: FloatArray) -> float:
    """Return the rate d [1/s] of amplitudes that decay as exp(-d t), by a straight line through their logarithms."""
    return -float(np.polyfit(times - times.mean(), np.log(np.maximum(sizes, 1e-12)), 1)[0])


def _fitted(name: str, periods: FloatArray, sizes: FloatArray, how: tuple[str, ...]) -> GateSheet:
    """Return the sheet of periods with known amplitudes; T0 is the mean of the periods corrected for them."""
    if len(periods) < 2:
        raise RecordingError(f"{name}: expected at least 2 periods, found {len(periods)}")
    if not ((periods > 0.0).all() and (sizes >= 0.0).all() and (sizes < math.pi).all()):
        raise RecordingError(f"{name}: periods must be above 0 s, and amplitudes from 0 to below 180 degrees")
    count = len(periods)
    small = periods / np.asarray(exact.period(sizes, math.tau))
    mean, error = float(np.mean(periods)), float(np.std(periods, ddof=1)) / math.sqrt(count)
    value, own = float(np.mean(small)), float(np.std(small, ddof=1)) / math.sqrt(count)
    unknown = Measurement(math.nan, math.nan, "m")
    return GateSheet(name, numbers(periods, "periods"), sizes, Measurement(mean, error, "s"),
                     Measurement(value, own, "s"), unknown, None, how)


def _with_size(sheet: GateSheet, gravity: float, length: float | None, length_error: float) -> GateSheet:
    """Return a sheet with the length that follows from T0 and gravity, and gravity from T0 and a given length."""
    gravity = one_number(gravity, "gravity", above=0.0, unit="m/s^2")
    own = one_number(length_error, "length_error", least=0.0, unit="m")
    small, error = sheet.small_period.value, sheet.small_period.error
    reach = gravity * (small / math.tau) ** 2
    value, doubt = None, doubt_of_length(small, reach)
    if length is not None:
        known = one_number(length, "length", above=0.0, unit="m")
        result = known * (math.tau / small) ** 2
        value = Measurement(result, result * math.hypot(2.0 * error / small, own / known), "m/s^2")
        doubt = doubt_of_gravity(result, gravity)
    return replace(sheet, how=(*sheet.how, *doubt), gravity=value,
                   length=Measurement(reach, 2.0 * reach * error / small, "m"))

