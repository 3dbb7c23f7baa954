"""Poincaré sections of driven scenes: the states of many runs once per period of the drive, or at every passage.

The runs of one call are compiled together and advance in blocks (:mod:`pendulum_env.engine.runs`), so that 1e5 points
take seconds. For single events of single runs, located in any scene, see ``events`` of
:func:`pendulum_env.rollout`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import integrators
from integrators import Method
from pendulum_env.common.checks import float_array, one_of, shown
from pendulum_env.common.progress import Progress, part_of, told_by, with_bar
from pendulum_env.common.provenance import provenance
from pendulum_env.common.results import Column, Columns, Result, one_line
from pendulum_env.common.texts import Table
from pendulum_env.engine.generate import program
from pendulum_env.engine.kernels import Backend, interpreted
from pendulum_env.engine.motion import EVENTS, drive_rate, event_function
from pendulum_env.engine.settings import SceneLike
from pendulum_env.engine.spec import RunSpec, scene_and_shared
from pendulum_env.engine.starts import usual_start
from pendulum_env.engine.threads import MOST_THREADS, cores
from pendulum_env.physics.damping import Damping
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, naming_keywords, number, whole_number

__all__ = ["Section", "section"]

Array = NDArray[np.float64]

POINTS, RUNS, STEPS = 100_000, 512, 200
"""Defaults: number of points, number of runs, steps per period."""
TRANSIENT, LONG_TRANSIENT = 100, 500
"""Default periods before the first point of a run: of an attractor or basin, and over a parameter."""
MOST = 10_000_000
"""Largest number of points, runs, periods or steps."""
REPEATS = 16
"""Longest repetition that is recognised [periods of the drive]."""
SAME = 1e-4
"""Largest distance of two states of a motion that repeats [rad, and rad/s over the drive's rate]."""
WANTED = "A Poincaré section"
"""What needs one drive, for messages."""
ANGLE, VELOCITY = 0, 1
"""Places of the angle and the velocity among the recorded quantities of a batch."""
HALVINGS = 55
"""Number of times the interval of a passage, one step, is halved."""


@dataclass(frozen=True, repr=False)
class Section(Result):
    """Points of a Poincaré section. All arrays have one entry per point, grouped by run, in the order of time.

    Attributes:
        scene, method: the scene (of the first run) and the name of the method.
        event: "period" for a stroboscopic section, else the passage at which points were recorded.
        phase: phase of the drive at which a stroboscopic section was taken [rad]; nan for passages.
        transient, steps: periods of the drive before the first point, and steps per period.
        over: name of the parameter that differs between runs, "" if none does.
        value: value of that parameter; an empty array if there is none.
        run: index of the run.
        time: time of the point [s].
        drive: phase of the drive, from 0 to 2 pi [rad].
        angle: angle from -pi to pi [rad]; unwrapped in scenes of small angles.
        velocity: velocity [rad/s].
        stopped: number of runs that ended early, for example because they diverged.
    """

    scene: Scene
    method: str
    event: str
    phase: float
    transient: int
    steps: int
    over: str
    value: Array
    run: NDArray[np.intp]
    time: Array
    drive: Array
    angle: Array
    velocity: Array
    stopped: int = 0

    def __repr__(self) -> str:
        over = f" over {self.over}" if self.over else ""
        return one_line(self, f"{self.scene.name}, {self.method}, {len(self.angle)} points at {self.event}{over}")

    def origin(self) -> Mapping[str, str]:
        """Return scene, method, steps and transient, and at which event and phase the points were recorded."""
        return provenance(
            Scene=self.scene.to_dict(), Method=self.method, StepsPerPeriod=self.steps, TransientPeriods=self.transient,
            Event=self.event, Phase=None if math.isnan(self.phase) else self.phase, RunsEndedEarly=self.stopped)

    def tables(self) -> Mapping[str, Columns]:
        """Return the points; those of a section over a parameter with its values, as the table "bifurcation"."""
        columns = {"run": (self.run, ""), "time_s": (self.time, "s"), "drive_phase_rad": (self.drive, "rad"),
                   "angle_rad": (self.angle, "rad"), "velocity_rad_per_s": (self.velocity, "rad/s")}
        if self.over:
            columns = {self.over: (self.value, ""), **columns}
        return {"bifurcation" if self.over else "section": {
            name: Column(values.tolist(), unit) for name, (values, unit) in columns.items()}}

    def repetitions(self) -> dict[float, int]:
        """Return, for each value of ``over``, the number of drive periods after which the motion repeats.

        It is 0 for a motion that does not repeat within 16 periods to 1e-4 rad: chaos, or a transient that has not
        died out, as happens close to a period doubling. Values with fewer than 33 points are left out.
        Raises SceneError for a section that is not stroboscopic or has no ``over``.
        """
        if self.event != "period" or not self.over:
            raise SceneError("repetitions are known for a stroboscopic section over a parameter; give over=.")
        scale = drive_rate(self.scene, WANTED) if self.over != "drive_rate" else 1.0
        found = {}
        for value in np.unique(self.value):
            here = self.value == value
            states = state_points(self.angle[here], self.velocity[here] / scale)
            if len(states) > 2 * REPEATS:
                found[float(value)] = repetition(states)
        return found

    @property
    def table(self) -> Table:
        """Table of the repetitions: the ranges of ``over`` with equal numbers of periods, in ascending order."""
        rows: list[list[Any]] = []
        for value, count in self.repetitions().items():
            if rows and rows[-1][2] == count:
                rows[-1][1] = value
            else:
                rows.append([value, value, count])
        head = (f"{self.over} from", "to", "repeats after")
        return Table(head, tuple((f"{low:.7g}", f"{high:.7g}", _periods(count)) for low, high, count in rows))


def _periods(count: int) -> str:
    """Return the number of periods after which a motion repeats as text."""
    return f"{count} period{'s' * (count > 1)}" if count else "does not repeat"


def state_points(angle: Array, velocity: Array) -> Array:
    """Return states as points (cos angle, sin angle, velocity), whose distances do not depend on whole turns.

    The result has one more axis of length 3 at the end.
    """
    return np.stack([np.cos(angle), np.sin(angle), velocity], axis=-1)


def repetition(states: Array, most: int = REPEATS, same: float = SAME) -> int:
    """Return after how many states, an array (n, 3), the last 2 ``most`` + 1 repeat; 0 if not within ``most``."""
    last = states[-2 * most - 1 :]
    apart = [float(np.abs(last[k:] - last[:-k]).max()) for k in range(1, most + 1)]
    return next((k for k, distance in enumerate(apart, start=1) if distance < same), 0)


@with_bar("section")
def section(
    scene: SceneLike = "chaotic",
    *,
    integrator: str | Method = "rk4",
    damping: Damping = "scene",
    event: str = "period",
    phase: float = 0.0,
    over: Mapping[str, ArrayLike] | None = None,
    points: int = POINTS,
    runs: int | None = None,
    transient: int | None = None,
    steps: int = STEPS,
    angle: float | None = None,
    velocity: float | None = None,
    num_threads: int | None = None,
    backend: Backend = "auto",
    progress: Progress | bool | None = None,
    **parameters: Any,
) -> Section:
    """Return a Poincaré section of a scene with one periodic drive: of its attractor, or over a parameter.

    A stroboscopic section (Poincaré's map) has the states (angle, velocity) at the times ``t = (n + phase/(2 pi)) T``,
    with T the period of the drive. With ``event="bottom"``, "top" or "turning" it has the states at passages through
    the bottom or the top with positive velocity, or at turning points at which the velocity falls through zero. Of two
    passages within one step none is found. Passages are located on the quintic polynomial through the states and
    accelerations at both ends of the step, to rounding.

    Without ``over`` the runs start from angles evenly spread over one turn, so that every attractor with a large basin
    shows. With ``over={"drive_torque": values}`` one run for each value starts from ``angle`` and ``velocity``: a
    bifurcation diagram (Baker & Gollub 1996, Chaotic Dynamics, chapter 4; Taylor 2005, Classical Mechanics, section
    12.6).

    Args:
        scene: preset name, dict, Scene, or a scene's JSON file.
        integrator, damping, backend: as in :func:`pendulum_env.rollout`.
        event: "period", "bottom", "top" or "turning".
        phase: phase of a stroboscopic section [rad], from 0 to 2 pi, a whole number of steps.
        over: the name of one number of the scene, and its values.
        points: least number of points, over all runs; a run that ends early has fewer. With passages, the number of
            periods is that of a stroboscopic section.
        runs: number of runs without ``over``, 512 by default; 1 follows a single run from ``angle``.
        transient: periods of the drive before the first point of each run, by default 100, with ``over`` 500. Motions
            settle slowly near a period doubling: a transient that is too short shows the doubling too early.
        steps: steps of the method per period of the drive.
        angle, velocity: start [rad, rad/s]; by default the scene's usual start.
        num_threads: number of threads; None uses every core. The results are equal bit by bit.
        progress: True shows a progress bar, False none; by default a notebook shows one for work over 1.5 s. A
            function is called with the fraction done and a word for it.
        **parameters: single parameters of the scene, such as ``drive_torque=1.2``.

    Raises SceneError or MethodError for invalid arguments, for a scene with no drive or with several, and if there is
    not a single point.
    """
    with naming_keywords(section):
        name, values = _varied(over)
        place = checked_scene(scene, damping, {**parameters, **({name: float(values[0])} if name else {})})
        kind = _checked_event(event, place)
        if name and runs is not None:
            raise SceneError("over= takes one run for each value, so that runs= has no use; leave one of them out.")
        count = len(values) if name else whole_number(RUNS if runs is None else runs, "runs", MOST)
        kept = -(-whole_number(points, "points", MOST) // count)
        usual = LONG_TRANSIENT if name else TRANSIENT
        transient = whole_number(usual if transient is None else transient, "transient", MOST, least=0)
        steps = whole_number(steps, "steps", MOST)
        if kind != "period" and number(phase, "phase", unit="rad"):
            raise SceneError(f"phase is for event 'period', but points are recorded at '{kind}'; leave one out.")
        shift, tell = _whole_steps(phase, steps) if kind == "period" else 0, told_by(progress)
        first, speed = usual_start(place, angle, velocity)
        threads = cores() if num_threads is None else whole_number(num_threads, "num_threads", MOST_THREADS)
    length = (transient + kept - 1) * steps + shift if kind == "period" else (transient + kept) * steps
    spread = 2.0 * math.pi if place.periodic and not name else 0.0
    angles = first + spread * np.arange(count) / count

    def spec_of(part: slice, rate: float) -> RunSpec:
        """Return the description of some of the runs, whose drives have one rate [rad/s]."""
        h = 2.0 * math.pi / rate / steps
        own = {**parameters, name: values[part]} if name else parameters
        return RunSpec.of(scene, integrator, damping, own, angle=angles[part], velocity=speed, dt=h,
                          duration=max(length, 1) * h, every=math.gcd(shift, steps) if kind == "period" else 1,
                          diagnostics=(), backend=backend)

    spec = spec_of(slice(None), drive_rate(place, WANTED))
    rates: Array = np.broadcast_to(np.abs(np.asarray(spec.numbers[_beat(place)], dtype=np.float64)), count)
    if not rates.all():
        raise SceneError(f"{WANTED} needs a drive in every run; leave 0 out of the values of {name}.")
    parts = [slice(None)] if np.all(rates == rates[0]) else [slice(i, i + 1) for i in range(count)]
    columns: list[tuple[Any, ...]] = []
    stopped = 0
    for i, part in enumerate(parts):
        batch = spec if len(parts) == 1 else spec_of(part, float(rates[i]))
        if i == 0:
            batch.tell()
        simulated = batch.runs(threads)
        rows = simulated.rows(part_of(tell, i / len(parts), (i + 1) / len(parts)))
        found = _strobed(rows, batch, steps, transient, shift) if kind == "period" else _passed(
            rows, batch, steps, transient, kind)
        columns += [(np.arange(count)[part][which], *rest) for which, *rest in found]
        stopped += sum(reason != "" for reason in simulated.reasons)
    run, time, q, v = (np.concatenate(column) for column in zip(*columns, strict=True))
    if not len(run):
        raise SceneError(f"There are no points: {stopped} of {count} runs ended early"
                         + (", and no other run has such a passage." if kind != "period" else "."))
    order = np.lexsort((time, run))
    run, time, q, v = run[order].astype(np.intp), time[order], q[order], v[order]
    return Section(
        scene=place, method=spec.method.name, event=kind, phase=float(phase) if kind == "period" else math.nan,
        transient=transient, steps=steps, over=name, value=values[run] if name else np.empty(0), run=run, time=time,
        drive=np.remainder(rates[run] * time, 2.0 * math.pi), angle=wrapped(q) if place.periodic else q, velocity=v,
        stopped=stopped,
    )


def checked_scene(scene: SceneLike, damping: Damping, parameters: Mapping[str, Any]) -> Scene:
    """Return the scene of a section with its parameters set.

    Raises SceneError for a parameter with several values, and for a scene without a drive or with drives of several
    rates.
    """
    for name, value in parameters.items():
        if name != "effects" and np.ndim(value):
            raise SceneError(f"{name} must be one number; section(over={{'{name}': values}}) takes several.")
    place, _ = scene_and_shared(scene, damping, parameters)
    drive_rate(place, WANTED)
    return place


def _beat(scene: Scene) -> str:
    """Return the name of the coefficient with the drive's angular rate [rad/s]."""
    return next(effect.beat for effect in scene.effects if effect.beat and scene.coefficients[effect.beat])


def _varied(over: Any) -> tuple[str, Array]:
    """Return name and values of the parameter that differs between runs; "" and an empty array for None.

    Raises SceneError for anything but a mapping of one name to one or more finite numbers.
    """
    if over is None:
        return "", np.empty(0)
    form = "over must be a dict of one parameter and its values, as in {'drive_torque': [1.0, 1.1, 1.2]}"
    if not isinstance(over, Mapping) or len(over) != 1 or not all(isinstance(name, str) for name in over):
        raise SceneError(f"{form}, not {shown(over)}.")
    (name, given), = over.items()
    try:
        values = float_array(given).ravel()
    except TypeError:
        values = np.empty(0)
    if not 0 < len(values) <= MOST or not np.isfinite(values).all():
        raise SceneError(f"The values of {name} in over= must be one or more finite numbers, not {shown(given)}.")
    return name, values


def _checked_event(kind: str, scene: Scene) -> str:
    """Return the name of an event; SceneError if it has no meaning in a scene or cannot be located in a batch."""
    event_function(one_of(kind, "event", EVENTS), scene)
    rough = [effect.name for effect in scene.effects if effect.dry or effect.draws]
    if kind != "period" and rough:
        raise SceneError(f"A section where the pendulum passes an angle needs smooth torques, but the scene "
                         f"'{scene.name}' has {', '.join(rough)}; use event='period', or rollout(events='{kind}') for "
                         "single runs.")
    return kind


def _whole_steps(phase: Any, steps: int) -> int:
    """Return a phase of the drive, 0 to 2 pi [rad], as a number of steps.

    Raises SceneError unless it is a whole number.
    """
    part = number(phase, "phase", least=0.0, unit="rad") / (2.0 * math.pi) * steps
    if not part < steps or abs(part - round(part)) > 1e-6:
        near = min(round(part), steps - 1) * 2.0 * math.pi / steps if part < 1e9 else 0.0
        raise SceneError(f"phase must be below 2 pi and a whole number of steps of 2 pi/{steps} rad "
                         f"({360.0 / steps:g} degrees); the nearest is {near:.6g} rad ({math.degrees(near):g} "
                         "degrees).")
    return round(part)


def wrapped(angle: Array) -> Array:
    """Return angles from -pi to pi [rad], which differ from the given ones by whole turns."""
    return angle - 2.0 * math.pi * np.round(angle / (2.0 * math.pi))


Points = tuple[NDArray[np.intp], Array, Array, Array]
"""Points of a section: index of the run, time [s], angle [rad] and velocity [rad/s], arrays of one shape."""


def _strobed(rows: Iterator[Array], spec: RunSpec, steps: int, transient: int, shift: int) -> Iterator[Points]:
    """Yield the states at the wanted phase of the drive, from ``transient`` periods on.

    ``rows`` are the records of the runs, one array (times, quantities, runs) after the other; ``shift`` is the phase in
    steps.
    """
    assert spec.plan is not None
    marks, done = spec.plan.marks, 0
    for block in rows:
        for mark, row in zip(marks[done : done + len(block)].tolist(), block, strict=True):
            whole, rest = divmod(mark - shift, steps)
            if rest == 0 and whole >= transient:
                alive = np.flatnonzero(np.isfinite(row[ANGLE]) & np.isfinite(row[VELOCITY]))
                yield alive, np.full(len(alive), mark * spec.h), row[ANGLE, alive], row[VELOCITY, alive]
        done += len(block)


def _passed(rows: Iterator[Array], spec: RunSpec, steps: int, transient: int, kind: str) -> Iterator[Points]:
    """Yield the states at passages through the bottom or the top, or at turning points, after ``transient`` periods.

    The arguments are those of :func:`_strobed`, with a record of every step, and the name of the event.
    """
    accelerations = _accelerations(spec)
    last, done = np.empty((0, 2, math.prod(spec.shape))), 0
    for block in rows:
        states = np.concatenate([last, block[:, [ANGLE, VELOCITY]]])
        first, q, v = done - len(last), states[:, 0], states[:, 1]
        passes, target = _passages(q, v, kind, spec.scene.periodic)
        k, run = np.nonzero(passes & (np.arange(first, first + len(passes)) >= transient * steps)[:, None])
        t, ends = (first + k) * spec.h, [(q[k + i, run], v[k + i, run]) for i in (0, 1)]
        slopes = [accelerations(t + i * spec.h, *end, run) for i, end in enumerate(ends)]
        s, angle, velocity = _located(ends, slopes, spec.h, None if target is None else target[k, run])
        yield run, t + s * spec.h, angle, velocity
        last, done = states[-1:], done + len(block)


def _passages(q: Array, v: Array, kind: str, periodic: bool) -> tuple[NDArray[np.bool_], Array | None]:
    """Return in which steps of which runs there is a passage, and the angle there; None for turning points.

    ``q`` and ``v`` are arrays (times, runs) [rad, rad/s].
    """
    if kind == "turning":
        return (v[:-1] > 0.0) & (v[1:] <= 0.0), None
    place = math.pi if kind == "top" else 0.0
    turn = np.floor((q - place) / (2.0 * math.pi)) if periodic else np.where(q >= 0.0, 0.0, -1.0)
    return turn[1:] > turn[:-1], place + 2.0 * math.pi * turn[1:]


def _located(
    ends: list[tuple[Array, Array]], slopes: list[Array], h: float, target: Array | None
) -> tuple[Array, Array, Array]:
    """Return where in a step an angle is ``target``, or the velocity 0 for None: share of the step, angle, velocity.

    The motion is the quintic polynomial through angles, velocities and accelerations (``slopes``) at both ends (Hermite
    interpolation), whose error is of order h**6. The share is halved down to rounding.
    """
    ((q0, v0), (q1, v1)), (a0, a1) = ends, slopes
    rise, bend, more = q1 - q0 - h * v0 - 0.5 * h * h * a0, h * (v1 - v0 - h * a0), h * h * (a1 - a0)
    c = (q0, h * v0, 0.5 * h * h * a0, 10.0 * rise - 4.0 * bend + 0.5 * more, 7.0 * bend - 15.0 * rise - more,
         6.0 * rise - 3.0 * bend + 0.5 * more)

    def state(s: Array) -> tuple[Array, Array]:
        q = c[0] + s * (c[1] + s * (c[2] + s * (c[3] + s * (c[4] + s * c[5]))))
        return q, (c[1] + s * (2.0 * c[2] + s * (3.0 * c[3] + s * (4.0 * c[4] + s * 5.0 * c[5])))) / h

    low, high = np.zeros_like(q0), np.ones_like(q0)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        angle, velocity = state(middle)
        before = velocity > 0.0 if target is None else angle < target
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    return high, *state(high)


def _accelerations(spec: RunSpec) -> Callable[..., Array]:
    """Return the function (time, angle, velocity, run) -> acceleration [rad/s²] of arrays of one shape."""
    generated = program(spec.scene, integrators.get("rk4"), ())
    function = interpreted(generated.text, generated.title)["acceleration"]
    numbers = {**spec.numbers, "control": spec.control, "side": 1.0}
    extra = [np.broadcast_to(numbers.get(name, 0.0), math.prod(spec.shape)) for name in generated.shape.extra]
    each = np.frompyfunc(function, 3 + len(extra), 1)
    return lambda t, q, v, run: each(t, q, v, *(values[run] for values in extra)).astype(np.float64)
