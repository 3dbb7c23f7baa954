"""Motion between the steps of a run: its dense output, and the events found on it.

Each step of a run, fixed or adaptive, becomes one curve or several (:mod:`integrators.solving.dense`), of the order
that the method declares. A step in which dry friction stops the bob becomes several pieces, which end where the
velocity becomes zero and where the bob breaks away; pieces are located by dop853 (Dormand & Prince 1980), and the last
one ends at the state that the method has computed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

import integrators
from integrators import Event, System
from integrators.solving.adaptive import March, checked
from integrators.solving.dense import Curve, DenseOutput, Recorder
from integrators.solving.events import Ended, Watch, checked_events
from integrators.solving.stepper import stepper
from pendulum_env.engine.generate import program
from pendulum_env.engine.kernels import interpreted
from pendulum_env.engine.machine import ANGLE, INDEX, TURNS, UNSEEN, VELOCITY, Machine, motion_of
from pendulum_env.engine.runs import RecordSchedule
from pendulum_env.engine.shape import STOP_REASONS
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, nearest, shown

Array = NDArray[np.float64]
EVENTS: Mapping[str, str] = {
    "turning": "turning point: the velocity changes its sign",
    "bottom": "passage through the bottom: sin(angle/2) changes its sign, or the angle in scenes of small angles",
    "top": "passage through the top: cos(angle/2) changes its sign; needs torques that are periodic in the angle",
    "period": "whole period of the drive: sin(Omega t/2) changes its sign; needs one drive",
}
"""Names of events that ``events=`` takes, and their meanings."""
MOST_PIECES = 100
"""Maximum number of pieces of one step under dry friction; the rest of the step is one piece."""
HALVINGS = 200, 100
"""Most halvings of an interval that holds a stop, and of one that holds a breakaway; some 55 reach rounding."""
LOOKS = 16
"""Times in a step at which the torques on a bob at rest are compared with the limit of dry friction."""


def named_events(events: Any, scene: Scene) -> tuple[Event, ...]:
    """Return the events of a run: names of :data:`EVENTS`, functions g(t, angle, velocity), or Events of either.

    Raises SceneError for an unknown name or one that has no meaning in the scene, and for an event with an action,
    MethodError for anything else that is not an event.
    """
    several = isinstance(events, (list, tuple))
    found = checked_events([_named(event, scene) for event in events] if several else _named(events, scene))
    for event in found:
        if event.action is not None:
            raise SceneError(f"Event {event.name} has an action, which a run of a scene does not take; "
                             "integrators.solve takes actions.")
    return found


def _named(event: Any, scene: Scene) -> Any:
    """Return an event whose function is given by its name as an Event of that function; others unchanged."""
    if isinstance(event, Event) and isinstance(event.function, str):
        return Event(event_function(event.function, scene), event.direction, event.terminal, event.action)
    return event_function(event, scene) if isinstance(event, str) else event


def drive_rate(scene: Scene, wanted: str) -> float:
    """Return the angular rate [rad/s] of the only periodic drive of a scene; ``wanted`` is what needs it.

    Raises SceneError for a scene without a drive, or with drives of several rates.
    """
    rates = {scene.coefficients[effect.beat] for effect in scene.effects if effect.beat} - {0.0}
    if len(rates) != 1:
        raise SceneError(f"{wanted} needs one drive, but the scene '{scene.name}' has {len(rates)}.")
    return abs(rates.pop())


def event_function(name: str, scene: Scene) -> Any:
    """Return the function g(t, angle, velocity) of an event's name; its changes of sign are the events.

    turning: the velocity. bottom: sin(angle/2), or the angle where the torque is not periodic. top: cos(angle/2).
    period: sin(Omega t/2) with the drive's angular rate Omega, zero at the start of each of its periods (a
    stroboscopic section). Raises SceneError for other names, for "top" where there is none, and for "period" without
    exactly one drive.
    """
    if name not in EVENTS:
        raise SceneError(f"There is no event {shown(name)}{nearest(name, EVENTS)}")
    half = 0.5 * drive_rate(scene, "The event 'period'") if name == "period" else 0.0
    if name == "top" and not scene.periodic:
        raise SceneError(f"The event 'top' needs torques that are periodic in the angle; those of '{scene.name}' are "
                         "not.")

    functions = {
        "turning": lambda t, angle, velocity: velocity,
        "bottom": lambda t, angle, velocity: math.sin(0.5 * angle) if scene.periodic else angle,
        "top": lambda t, angle, velocity: math.cos(0.5 * angle),
        "period": lambda t, angle, velocity: math.sin(half * t),
    }
    return functions[name]


def trace(
    machine: Machine, state: Any, plan: RecordSchedule, control: float, speed_limit: float, events: tuple[Event, ...],
    dense: bool,
) -> tuple[Array, str, dict[str, Any]]:
    """Return the recorded states and the stop reason of a run with events, and the fields of a Rollout that they give.

    The run begins at ``state``, which is changed to the final state. The states are those of a run without events, bit
    for bit, and the other arguments are those of :func:`pendulum_env.engine.runs.recorded`. The fields are the events'
    times and states and, if ``dense``, the dense output; the stop reason is "event" at a terminal event, and the fields
    then hold its time as "stop_time" [s].
    """
    h, steps = plan.h, plan.steps
    watch = Watch(events, float(np.finfo(float).eps))
    curves = Curves(machine, h, control, watch, dense)
    rows, code, reason, fields = [], 0, "", dict[str, Any]()
    out = np.empty((2, machine.width))
    for k in range(1, steps + 1):
        before = state.copy()
        code = machine.run(state, machine.parameters, control, h, 1, 1, speed_limit, out, UNSEEN)
        if k == 1:
            rows.append(out[0].copy())
        try:
            if math.isfinite(state[ANGLE]) and math.isfinite(state[VELOCITY]):
                curves.step(before, state)
        except Ended as end:
            reason, stopped = "event", float(end.t)
            fields["stop_time"] = stopped
            part = stopped - before[INDEX] * h
            state[:] = before
            if part > 0.0:
                machine.run(state, machine.parameters, control, part, 1, 1, math.inf, out, UNSEEN)
            reached = machine.state(end.q, end.v)
            for i in (ANGLE, TURNS, VELOCITY):
                state[i] = reached[i]
            state[INDEX] = stopped / h
            if state[INDEX] != rows[-1][INDEX]:
                rows.append(np.array(state[: machine.width]))
            break
        if (code or k % plan.every == 0 or k == steps) and state[INDEX] > before[INDEX]:
            rows.append(out[1].copy())
        if code:
            reason = STOP_REASONS.get(code, "")
            break
    fields |= zip(("t_events", "angle_events", "velocity_events"), watch.columns(), strict=True)
    return np.array(rows), reason, {**fields, "dense": curves.output(state) if dense else None}


class Curves:
    """The motion within each step of a run, as curves (polynomials of time) that are added step by step.

    Args:
        machine: simulates the run.
        h: the step [s].
        control: constant fraction of the motor's torque.
        watch: looks for events on every curve.
        keep: True keeps the curves for dense output.
    """

    def __init__(self, machine: Machine, h: float, control: float, watch: Watch, keep: bool) -> None:
        self.machine, self.h, self.scene = machine, h, machine.scene
        self._dry = any(effect.dry for effect in machine.scene.effects)
        method = integrators.get("dop853") if self._dry else machine.method
        with_stages = bool(machine.tolerance) or method.dense is not None
        own = with_stages and (method.implicit or "taylor" in method.needs)  # these call more than the acceleration
        generated = program(machine.scene, method if own else integrators.get("rk4"), ())
        functions = interpreted(generated.text, generated.title)
        self._acceleration = functions["acceleration"]
        self._jacobian, self._series = functions.get("jacobian"), functions.get("series")
        values = {**machine.scene.coefficients, "control": control, "side": 1.0}
        self._names, self._extra = generated.shape.extra, [values.get(name, 0.0) for name in generated.shape.extra]
        self._remembered = [(i, machine.names.index(name)) for i, name in enumerate(self._names)
                            if name in generated.shape.remembered]
        self._side: tuple[float, ...] = ()
        self._limit = next((machine.scene.coefficients[effect.dry] for effect in machine.scene.effects if effect.dry),
                           0.0)
        self._recorder = Recorder(method, self.slope, 0.0, watch.step, keep)
        if self._dry:
            self._recorder.method = machine.method
        self._staged = self._recorder.extension is not None
        adaptive = bool(machine.tolerance)
        self._step = None
        if self._staged or adaptive:
            self._step, self._begin = stepper(method, self._system(), 0.0, adaptive, self._staged)
        self._first: Any = None

    def slope(self, t: float, q: float, v: float) -> float:
        """Return the acceleration [rad/s²] with the torques of the present step; friction acts against ``side``."""
        return float(self._acceleration(t, q, v, *self._extra, *self._side))

    def _system(self) -> System:
        """Return the equation of motion with what the method needs of it."""
        jacobian, series = self._jacobian, self._series

        def taylor_coefficients(t: float, q: float, v: float, order: int) -> list[float]:
            assert series is not None
            terms = series(t, q, v, *self._extra)  # those of q from order 2, then those of v, one order further
            return [q, v, *terms[: order - 2], terms[-1] / order]

        return System(
            self.slope, jacobian=None if jacobian is None else lambda t, q, v: jacobian(t, q, v, *self._extra),
            taylor_coefficients=None if series is None else taylor_coefficients)

    def step(self, before: Any, after: Any) -> None:
        """Add the curves of one step between two states of the machine; raises Ended at a terminal event."""
        for i, place in self._remembered:
            self._extra[i] = float(after[place])
        t, h = float(before[INDEX]) * self.h, float(after[INDEX] - before[INDEX]) * self.h
        if h == 0.0:
            return
        start, end = motion_of(before), motion_of(after)
        if self._dry:
            self._pieces(t, h, start, end)
        elif self.machine.tolerance:
            tolerance = checked(self.machine.method, self.machine.tolerance["rtol"], self.machine.tolerance["atol"])
            assert self._step is not None
            march = March(self.machine.method, self._step, self.slope, tolerance, t, *start, self._first,
                          self._recorder)
            march.through([t, t + h], 0.0, [])
            self._first = march.h
        else:
            self._add(t, h, start, end)

    def output(self, state: Any) -> DenseOutput:
        """Return the dense output of all steps added so far, which end at a state of the machine."""
        return self._recorder.output(float(state[INDEX]) * self.h, *motion_of(state))

    def _add(self, t: float, h: float, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Add one curve between two states (angle, velocity)."""
        if self._step is None:
            self._recorder.add(t, h, start, end, (), (self.slope(t, *start), self.slope(t + h, *end)))
        else:
            self._recorder.add(t, h, start, end, self._step(t, *start, *self._begin(t, *start, h), h))

    def _pieces(self, t: float, h: float, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Add the pieces of one step under dry friction, between stops and breakaways."""
        stop, (q, v) = t + h, start
        for _ in range(MOST_PIECES):
            direction = math.copysign(1.0, v)
            if v == 0.0:
                self._side = (0.0,)
                if abs(other := self.slope(t, q, 0.0)) <= self._limit:
                    until = self._breakaway(t, q, stop)
                    if until >= stop:
                        break
                    self._still(t, until - t, q)
                    t = until
                    other = self.slope(t, q, 0.0)
                direction = math.copysign(1.0, other)
            self._side = (direction,)
            part = self._until_stop(t, q, v, stop - t, direction)
            if part is None:
                break
            where = self._one(t, q, v, part)[0]
            self._add(t, part, (q, v), (where, 0.0))
            t, q, v = t + part, where, 0.0
        if stop - t > 0.0:
            if v == 0.0 and end[1] == 0.0:
                self._still(t, stop - t, q)
            else:
                self._add(t, stop - t, (q, v), end)
        self._side = ()

    def _one(self, t: float, q: float, v: float, h: float) -> tuple[float, float]:
        """Return the state after one step of dop853."""
        assert self._step is not None
        after = self._step(t, q, v, *self._begin(t, q, v, h), h)
        return float(after[0]), float(after[1])

    def _still(self, t: float, h: float, q: float) -> None:
        """Add a piece at rest."""
        self._recorder.put(Curve(t, h, q, 0.0, (0.0,), (0.0,)))

    def _until_stop(self, t: float, q: float, v: float, h: float, direction: float) -> float | None:
        """Return the time after which the velocity becomes zero, within ``h``; None if it does not."""
        if not direction * self._one(t, q, v, h)[1] < 0.0:
            return None
        return _edge(0.0, h, lambda part: direction * self._one(t, q, v, part)[1] > 0.0, HALVINGS[0])

    def _breakaway(self, t: float, q: float, end: float) -> float:
        """Return the time at which the torques on a bob at rest exceed the limit of dry friction, at most ``end``."""
        low = t
        for k in range(1, LOOKS + 1):
            high = t + (end - t) * k / LOOKS if k < LOOKS else end
            if abs(self.slope(high, q, 0.0)) > self._limit:
                return _edge(low, high, lambda at: abs(self.slope(at, q, 0.0)) <= self._limit, HALVINGS[1])
            low = high
        return math.inf


def _edge(low: float, high: float, before: Callable[[float], bool], halvings: int) -> float:
    """Return the first time at which ``before`` is False, between two times, by at most so many ``halvings``."""
    for _ in range(halvings):
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        low, high = (middle, high) if before(middle) else (low, middle)
    return high
