"""Observations by a sensor, and delayed actions: readings, velocities computed from them, and delays.

The usual program advances the motion, one part of a control step after the other: after each part some environments
change to the next action, and some are read. A small program, generated here, takes the readings and returns them
later. Readings are kept in *slots*, which all environments share: every ``spacing`` integration steps the next slot is
written, and after the last slot the first. A delayed observation comes from an earlier slot. An episode begins with its
first reading in all slots.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.engine import report, wrap
from pendulum_env.engine.elementwise import Kernel, kernel
from pendulum_env.engine.kernels import Backend, functions
from pendulum_env.engine.shape import indent, joined
from pendulum_env.physics import elementary
from pendulum_env.physics.random import next_uniform, normal, started
from pendulum_env.physics.sensor import rounded, taken
from pendulum_env.physics.units import SceneError

Array = NDArray[np.float64]
Places = NDArray[np.intp]

KINDS = {"full": 3, "angle": 2, "encoder": 3, "history": 2}
"""Kinds of observation -> number of entries: cosine, sine and perhaps velocity, or for each reading cosine and sine."""
SEEDS = ("a0", "a1", "a2", "b0", "b1", "b2")
"""Names of the six numbers of the random generator of a sensor's noise; see :mod:`pendulum_env.physics.random`."""
NUMBERS = ("scale", "offset", "noise", "quantum", "dropout", "gain", "between", "span")
"""Arguments of the programs: a sensor's numbers, the filter's gain, and the times between two readings and over the
window of the velocity [s]."""
TURNED = "q + 6.283185307179586*turns"
"""Source of the unwrapped angle of the motion [rad]."""
SCRATCH = ("x0", "y0", "w0", "x1", "y1", "w1", "x_old", "y_old", "cosine", "sine", "angle")
"""Names of the intermediate values of the programs."""

UNFIT = "sensing in a state to restore must hold the readings and actions that get_state returned."


@dataclass(frozen=True)
class Plan:
    """Times of readings and of delayed actions, in whole integration steps.

    Attributes:
        kind: one of KINDS.
        history: number of readings in an observation of the kind "history", else 1.
        substeps: integration steps of a control step.
        spacing: integration steps between two slots; it divides ``substeps``.
        every: number of slots from one reading to the next; above 1 only if a control step has one slot.
        follows: True if each reading is taken exactly the observation delay before its observation; False if the sensor
            has a rate of its own.
        window: number of readings from which a velocity is computed.
        filtered: True if the velocity is that of a filter.
        ideal: True if angles are seen exactly, without a sensor.
        noisy, dropping, rounding, zeroed: True for a sensor with noise, dropout, a quantum, the zero "at_start".
        seen_late: smallest and largest observation delay, drawn for every episode if they differ.
        acts_late: smallest and largest action delay.
        numbers: values of NUMBERS.
    """

    kind: str
    history: int
    substeps: int
    spacing: int
    every: int
    follows: bool
    window: int
    filtered: bool
    ideal: bool
    noisy: bool
    dropping: bool
    rounding: bool
    zeroed: bool
    seen_late: tuple[int, int]
    acts_late: tuple[int, int]
    numbers: tuple[float, ...]

    @property
    def random(self) -> bool:
        """Return True if the observation delay differs between episodes."""
        return self.seen_late[0] < self.seen_late[1]

    @property
    def swift(self) -> bool:
        """Return True if observations hold a velocity."""
        return self.kind in ("full", "encoder")

    @property
    def width(self) -> int:
        """Return the number of entries of an observation."""
        return KINDS[self.kind] * self.history

    @property
    def draws(self) -> bool:
        """Return True if the sensor draws random numbers."""
        return self.noisy or self.dropping

    @property
    def slots(self) -> int:
        """Return the number of slots."""
        steps = (self.history - 1) * self.substeps // self.spacing
        return 1 + max(self.window * self.every, self.lag(self.seen_late[1])[0] + steps)

    def lag(self, delay: int) -> tuple[int, int]:
        """Return the number of slots by which an observation is late, and the step after which its slot is written.

        ``delay`` is the observation delay in integration steps; the step is counted within a control step.
        """
        if self.follows:
            return delay // self.substeps, self.substeps - delay % self.substeps
        return -(-delay // self.spacing), self.substeps

    @property
    def readings(self) -> tuple[int, ...]:
        """Return the steps of a control step after which a slot is written, in some environment at least."""
        if not self.follows:
            return tuple(range(self.spacing, self.substeps + 1, self.spacing))
        low, high = self.seen_late
        return tuple(sorted({self.lag(delay)[1] for delay in range(low, min(high, low + self.substeps) + 1)}))

    @property
    def changes(self) -> tuple[int, ...]:
        """Return the steps of a control step after which an action arrives, in some environment at least; 0 is left
        out.
        """
        low, high = self.acts_late
        return tuple(sorted({delay % self.substeps for delay in range(low, min(high, low + self.substeps) + 1)} - {0}))

    def parts(self, remembers: bool) -> tuple[tuple[int, int, int, bool], ...]:
        """Return the parts of a control step: begin, end, steps of a new action (0 for the old one), True to read.

        ``remembers`` is True for scenes with effects that have a state, such as a lagging motor: where actions arrive
        within a control step, it is advanced in every integration step.
        """
        single = remembers and bool(self.changes)
        ends = {*self.readings, *self.changes, self.substeps} | ({*range(1, self.substeps)} if single else set())
        begins = {0, *self.changes}
        parts, begin = [], 0
        for end in sorted(ends):
            hold = 1 if single else self.substeps if begin in begins else 0
            parts.append((begin, end, hold, end in self.readings))
            begin = end
        return tuple(parts)


@dataclass(frozen=True)
class MotionFields:
    """Layout of the environments' motion in memory.

    Attributes:
        width: number of environments in a block: BLOCK, or 1 for the state of a single environment.
        angle, turns, velocity: indices of these fields.
        periodic: True if the angle is that from the nearer of bottom and top.
    """

    width: int
    angle: int
    turns: int
    velocity: int
    periodic: bool


# --- the program ----------------------------------------------------------------------------------------------------


class Text:
    """Writer of the program of a plan: fields of its memory, and the source of its functions.

    A slot holds a reading ``x`` and a velocity ``w``; without a sensor, ``x`` is the angle from the nearer of bottom
    and top, and ``y`` its turns. In the source ``x1`` is the new reading, and ``x0`` that in the slot before.
    """

    def __init__(self, plan: Plan, place: MotionFields) -> None:
        self.plan, self.place = plan, place
        self.parts = ("x", "y") if plan.ideal else ("x",)
        self.rings = (*self.parts, *(("w",) if plan.swift else ()))
        own = (*(("lag", "late") if plan.random else ()), *(("zero",) if plan.zeroed else ()),
               *(SEEDS if plan.draws else ()), *(("count",) if plan.every > 1 else ()))
        self.fields = (*own, *(f"{ring}{slot}" for ring in self.rings for slot in range(plan.slots)))

    def at(self, name: str) -> str:
        """Return the source of a field of environment ``i``."""
        return f"o[i + U({self.fields.index(name) * self.place.width})]"

    def slot(self, ring: str, slot: str) -> str:
        """Return the source of environment ``i``'s entry of a ring in the slot with the source ``slot``."""
        return f"o[i + U({self.start(ring, slot)})]"

    def start(self, ring: str, slot: str) -> str:
        """Return the source of the index at which a block's entries of a ring in a slot begin."""
        first = self.fields.index(f"{ring}0")
        return f"{self.place.width}*({first} + {slot})"

    def scratch(self, name: str) -> str:
        """Return the source of an intermediate value of environment ``i``, in an array with constant places.

        Loops whose places are constant compile to SIMD code, and those with dynamic slots do not: they only copy.
        """
        return f"t[i + U({SCRATCH.index(name) * self.place.width})]"

    def copied_in(self, rings: Iterable[str], slot: str, mark: str) -> list[str]:
        """Return the source lines that copy a slot's entries, such as ``x``, into the scratch, as ``x{mark}``."""
        lines = []
        for ring in rings:
            lines += [f"start = {self.start(ring, slot)}", "for i in range(U(n)):",
                      f"    {self.scratch(ring + mark)} = o[i + U(start)]"]
        return lines

    def whole(self, x: str, y: str) -> str:
        """Return the source of the unwrapped angle of a reading [rad]."""
        return f"{x} + 6.283185307179586*{y}" if self.plan.ideal else x

    @property
    def uniforms(self) -> tuple[str, ...]:
        """Return the names of the uniform random numbers that a reading takes."""
        return (*(("u1", "u2") if self.plan.noisy else ()), *(("u3",) if self.plan.dropping else ()))

    @property
    def windowed(self) -> tuple[str, ...]:
        """Return the parts of the reading at the begin of the window that a new reading needs."""
        return self.parts if self.plan.kind == "encoder" and not self.plan.filtered else ()

    @property
    def past(self) -> tuple[str, ...]:
        """Return the rings of which a new reading needs the entry in the slot before."""
        plan = self.plan
        kept = plan.every > 1 or plan.dropping
        slow = plan.every > 1 or (plan.dropping and plan.kind == "full")
        return (*(self.parts if kept or plan.filtered else ()),
                *(("w",) if plan.swift and (slow or plan.filtered) else ()))

    @property
    def counted(self) -> tuple[str, ...]:
        """Return the name of the number of slots since the last reading, if not every slot has one."""
        return ("count",) if self.plan.every > 1 else ()

    @property
    def needed(self) -> tuple[str, ...]:
        """Return the arguments of ``sampled``: the motion, and what a new reading needs beside it."""
        return ("q", "turns", "v", *(("zero",) if self.plan.zeroed else ()), *self.uniforms,
                *(f"{ring}0" for ring in self.past), *(f"{ring}_old" for ring in self.windowed), *self.counted,
                *NUMBERS)

    @property
    def started(self) -> tuple[str, ...]:
        """Return the results of ``first``: entries of the rings, and the sensor's zero."""
        return (*(f"{ring}1" for ring in self.rings), *(("zero",) if self.plan.zeroed else ()))

    @property
    def written(self) -> tuple[str, ...]:
        """Return the results of ``sampled``: entries of the rings, and the number of slots since the last reading."""
        return (*(f"{ring}1" for ring in self.rings), *self.counted)

    def reading(self) -> list[str]:
        """Return the source lines that take a reading of the motion."""
        if self.plan.ideal:
            return ["x1 = q", "y1 = turns"]
        zero = "zero" if self.plan.zeroed else "0.0"
        return [f"x1 = taken({TURNED}, {zero}, scale, offset)",
                *(["x1 = x1 + noise*normal(u1, u2)"] if self.plan.noisy else []),
                *(["x1 = rounded(x1, quantum)"] if self.plan.rounding else [])]

    def speed(self) -> list[str]:
        """Return the source lines that compute the velocity ``w1`` of a new reading."""
        if self.plan.kind == "full":
            return ["w1 = v"]
        new = self.whole("x1", "y1")
        if self.plan.filtered:
            return [f"w1 = w0 + gain*((({new}) - ({self.whole('x0', 'y0')}))/between - w0)"]
        return [f"w1 = (({new}) - ({self.whole('x_old', 'y_old')}))/span"]

    def rules(self) -> list[str]:
        """Write the sources of the functions of one environment, without memory: ``first``, ``sampled``, ``shown``,
        and ``bounded``.

        ``first`` takes the first reading of an episode and ``sampled`` each other one. A lost reading is replaced by
        the one before, from which an encoder computes its velocity; a lost reading of the kind "full" loses the
        velocity, too. ``shown`` returns cosine, sine and angle of a reading, ``bounded`` its velocity as a float32.
        """
        plan = self.plan
        first = [*([f"zero = {TURNED}"] if plan.zeroed else []), *self.reading(),
                 *(["w1 = v" if plan.kind == "full" else "w1 = 0.0"] if plan.swift else [])]
        idle = ["count > 0.0"] if plan.every > 1 else []
        lost = ["u3 < dropout"] if plan.dropping else []
        kept = " or ".join([*idle, *lost])
        slow = " or ".join([*idle, *(lost if plan.kind == "full" else [])])
        lines = self.reading()
        if idle:
            lines += ["count = count + 1.0", f"count = 0.0 if count >= {plan.every}.0 else count"]
        lines += [f"{name}1 = {name}0 if {kept} else {name}1" for name in self.parts if kept]
        lines += self.speed() if plan.swift else []
        lines += [f"w1 = w0 if {slow} else w1"] if plan.swift and slow else []
        if plan.ideal and self.place.periodic:
            turned = ["tilt = x", "side = side_of(y)"]
        else:
            turned = ["halves = half_turns(x)",
                      f"tilt = max(-{report.RESOLVED}, min({report.RESOLVED}, without_half_turns(x, halves)))",
                      "side = side_of(0.5*halves)"]
        turned += ["half = sin(0.5*tilt)"]
        seen = f"side*(1.0 - 2.0*half*half), side*(2.0*half*cos(0.5*tilt)), {self.whole('x', 'y')}"
        bounded = f"max(-{report.FASTEST}, min({report.FASTEST}, w))"
        begun = ("q", "turns", "v", *self.uniforms, *NUMBERS)
        return [_inlined("first", begun, first, joined(self.started)),
                _inlined("sampled", self.needed, lines, joined(self.written)),
                _inlined("shown", self.parts, turned, seen), _inlined("bounded", ("w",), [], bounded)]

    def drawn(self) -> list[str]:
        """Return the source lines that draw the random numbers of a reading from an environment's generator."""
        if not self.plan.draws:
            return []
        return [*(f"{name} = {self.at(name)}" for name in SEEDS),
                *(f"{joined(SEEDS)}, {name} = next_uniform({joined(SEEDS)})" for name in self.uniforms)]

    def motion(self) -> list[str]:
        """Return the source lines that name the motion of environment ``i``."""
        place = self.place
        return [f"{name} = s[i + U({field * place.width})]" for name, field in (
            ("q", place.angle), ("turns", place.turns), ("v", place.velocity))]

    def sample(self) -> str:
        """Write the source of ``sample``: write the slot ``now`` of all environments of a range of blocks.

        ``before`` is the slot before it and ``old`` the one at the begin of the window. With random observation delays
        only those environments are read that are due after this step of the control step.
        """
        plan = self.plan
        lines = [*self.motion(), *([f"zero = {self.at('zero')}"] if plan.zeroed else []), *self.drawn(),
                 *(f"{ring}0 = {self.scratch(f'{ring}0')}" for ring in self.past),
                 *(f"{ring}_old = {self.scratch(f'{ring}_old')}" for ring in self.windowed),
                 *(f"{name} = {self.at(name)}" for name in self.counted),
                 f"{joined(self.written)} = sampled({joined(self.needed)})"]
        stores = {self.scratch(f"{ring}1"): f"{ring}1" for ring in self.rings}
        stores |= {self.at(name): name for name in (*(SEEDS if plan.draws else ()), *self.counted)}
        lines += [f"mine = {self.at('late')} == event"] if plan.random else []
        lines += [f"{to} = {value} if mine else {to}" if plan.random else f"{to} = {value}"
                  for to, value in stores.items()]
        back = []
        for ring in self.rings:
            back += [f"start = {self.start(ring, 'now')}", "for i in range(U(n)):",
                     f"    o[i + U(start)] = {self.scratch(f'{ring}1')}"]
        return self._over_blocks(
            "sample", f"state, memory, t, first_block, last_block, size, now, before, old, event, {joined(NUMBERS)}", [
                "s = state[b]", *self.copied_in(self.past, "before", "0"),
                *self.copied_in(self.windowed, "old", "_old"),
                *self.copied_in(self.rings if plan.random else (), "now", "1"),
                "for i in range(U(n)):", *indent(lines, 1), *back])

    def give(self) -> str:
        """Write the source of ``give``: observations and observed angles, from slots ``lag`` behind ``now``."""
        plan, width = self.plan, self.place.width
        steps, entries = plan.substeps // plan.spacing, KINDS[plan.kind]
        lag = f"int({self.at('lag')})" if plan.random else "lag"
        lines = [f"seen = observation[{width}*b:{width}*b + n]", f"angle = observed[{width}*b:{width}*b + n]"]
        for k in range(plan.history):
            last = k == plan.history - 1
            back = [f"at = now - {lag} - {(plan.history - 1 - k) * steps}", f"at = at + {plan.slots} if at < 0 else at"]
            rings = self.rings if last else self.parts
            if plan.random:
                lines += ["for i in range(U(n)):", *indent(back, 1),
                          *(f"    {self.scratch(f'{ring}1')} = {self.slot(ring, 'at')}" for ring in rings)]
            else:
                lines += [*back, *self.copied_in(rings, "at", "1")]
            one = [f"{name} = {self.scratch(f'{name}1')}" for name in self.parts]
            one += [f"cosine, sine, whole = shown({joined(self.parts)})",
                    f"{self.scratch('cosine')} = cosine", f"{self.scratch('sine')} = sine"]
            one += [f"{self.scratch('angle')} = whole"] if last else []
            lines += ["for i in range(U(n)):", *indent(one, 1), "for i in range(U(n)):",
                      f"    seen[i, {entries * k}] = {self.scratch('cosine')}",
                      f"    seen[i, {entries * k + 1}] = {self.scratch('sine')}"]
        if plan.swift:
            lines += ["for i in range(U(n)):", f"    seen[i, 2] = bounded({self.scratch('w1')})"]
        lines += ["for i in range(U(n)):", f"    angle[i] = {self.scratch('angle')}"]
        return self._over_blocks("give", "observation, observed, memory, t, first_block, last_block, size, now, lag",
                                 lines)

    def begin(self) -> str:
        """Write the source of ``begin``: the first reading of the environments ``places``, written to all slots."""
        plan, width = self.plan, self.place.width
        stores = (*(("zero",) if plan.zeroed else ()), *(SEEDS if plan.draws else ()))
        lines = [
            *self.motion(), *self.drawn(),
            f"{joined(self.started)} = first({joined(('q', 'turns', 'v', *self.uniforms, *NUMBERS))})",
            *(f"{self.at(name)} = {name}" for name in stores), *(f"{self.at(name)} = 0.0" for name in self.counted),
            f"for slot in range({plan.slots}):",
            *indent([f"{self.slot(ring, 'slot')} = {ring}1" for ring in self.rings], 1),
        ]
        return "\n".join(["@entry", f"def begin(state, memory, places, {joined(NUMBERS)}):",
                          "    for k in range(len(places)):",
                          f"        s = state[places[k]//{width}]", f"        o = memory[places[k]//{width}]",
                          f"        i = U(places[k] % {width})", *indent(lines, 2), "    return 0", ""])

    def _over_blocks(self, name: str, arguments: str, lines: Iterable[str]) -> str:
        """Write the source of a function that runs ``lines`` for a range of blocks of ``n`` environments, or fewer."""
        width = self.place.width
        return "\n".join(["@entry", f"def {name}({arguments}):", "    for b in range(first_block, last_block):",
                          "        o = memory[b]", f"        n = min({width}, size - {width}*b)",
                          *indent(lines, 2), "    return 0", ""])

    def program(self, memory: bool = True) -> Kernel:
        """Return the program; without ``memory`` only the functions of one environment."""
        plan = self.plan
        called: list[Callable[..., Any]] = [
            taken, wrap.half_turns, wrap.without_half_turns, wrap.side_of, elementary.sin, elementary.cos,
            *([next_uniform] if plan.draws else []), *([normal] if plan.noisy else []),
            *([rounded] if plan.rounding else [])]
        loops = [self.sample(), self.give(), self.begin(), PICK] if memory else []
        return kernel(called, [*self.rules(), *loops], f"{plan.kind} sensing")


def _inlined(name: str, arguments: Sequence[str], lines: Iterable[str], result: str) -> str:
    """Write the source of an inlined function."""
    return "\n".join(["@inline", f"def {name}({joined(arguments)}):", *indent([*lines, f"return {result}"], 1), ""])


PICK = """@entry
def pick(queue, whole, part, row, begun, out):
    for i in range(len(out)):
        k = row - whole[i] - (1 if begun < part[i] else 0)
        out[i] = queue[k + len(queue) if k < 0 else k, i]
    return 0
"""
"""Source of ``pick``: the action of every environment from the rows of a queue, for random delays."""


# --- the memory -----------------------------------------------------------------------------------------------------


class Sensing:
    """Readings and delayed actions of ``size`` environments, or of one.

    Args:
        plan: times of readings and delayed actions.
        place: layout of the motion in memory.
        size: number of environments.
        remembers: True for scenes with effects that have a state; see :meth:`Plan.parts`.
        backend: backend of the programs.
        num_threads: number of threads.

    Attributes:
        parts: parts of a control step; see :meth:`Plan.parts`.
    """

    def __init__(
        self, plan: Plan, place: MotionFields, size: int, remembers: bool, backend: Backend, num_threads: int = 1
    ) -> None:
        self.plan, self.place, self.size, self.backend, self.num_threads = plan, place, size, backend, num_threads
        self.parts = plan.parts(remembers)
        self._fields = Text(plan, place).fields
        self._memory = np.zeros((-(-size // place.width), len(self._fields) * place.width))
        self._scratch = [np.empty(len(SCRATCH) * place.width) for _ in range(num_threads)]
        self._now = 0
        self._lag = plan.lag(plan.seen_late[0])[0]
        self._queue: NDArray[Any] = np.zeros((plan.acts_late[1] // plan.substeps + 2, size), np.float32)
        self._row = 0
        self._whole, self._part = np.zeros(size, dtype=np.int64), np.zeros(size, dtype=np.int64)
        self._set_late(slice(None), plan.acts_late[0])
        self._load()

    def _load(self) -> None:
        found = functions(Text(self.plan, self.place).program(), self.backend)
        self._sample, self._give, self._begin, self._pick = (
            found[name] for name in ("sample", "give", "begin", "pick"))

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes to pickle, without the compiled functions."""
        return {name: value for name, value in vars(self).items()
                if name not in ("_sample", "_give", "_begin", "_pick")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore pickled attributes and load the compiled functions."""
        vars(self).update(state)
        self._load()

    def begin(
        self, state: Any, which: Places, seen: Places | None, acts: Places | None, seeds: Iterable[Array]
    ) -> None:
        """Begin new episodes of the environments ``which``, whose motion in ``state`` is that of the start.

        Args:
            state: blocks of the motion.
            which: indices of the environments.
            seen, acts: their observation and action delays in integration steps; None for fixed delays.
            seeds: for each of SEEDS random numbers in [0, 1), if the sensor draws random numbers.
        """
        if seen is not None:
            lags, events = np.divmod(seen, self.plan.substeps)
            if self.plan.follows:
                self._set("lag", which, lags)
                self._set("late", which, self.plan.substeps - events)
            else:
                self._set("lag", which, -(-seen // self.plan.spacing))
                self._set("late", which, np.full(len(which), self.plan.substeps))
        if acts is not None:
            self._set_late(which, acts)
        for name, uniform in zip(SEEDS, seeds, strict=False):
            self._set(name, which, started(uniform))
        self._queue[:, which] = 0.0
        with np.errstate(all="ignore"):
            self._begin(state, self._memory, which, *self.plan.numbers)

    def _set_late(self, which: Any, steps: Any) -> None:
        """Set the action delays of the environments ``which`` [integration steps]."""
        self._whole[which], self._part[which] = np.divmod(steps, self.plan.substeps)

    def _set(self, name: str, which: Places, values: NDArray[Any]) -> None:
        """Set a field of the environments ``which``."""
        width = self.place.width
        self._memory[which // width, self._fields.index(name) * width + which % width] = values

    def act(self, actions: NDArray[Any]) -> None:
        """Put the actions of a control step into the queue."""
        if actions.dtype != self._queue.dtype and actions.dtype == np.float64:
            self._queue = self._queue.astype(np.float64)
        self._row = (self._row + 1) % len(self._queue)
        self._queue[self._row] = actions

    def acting(self, begun: int) -> NDArray[Any]:
        """Return the actions that act in a part of a control step that begins after ``begun`` integration steps."""
        low, high = self.plan.acts_late
        if low == high:
            back = low // self.plan.substeps + (begun < low % self.plan.substeps)
            return np.asarray(self._queue[self._row - back])
        out = np.empty(self.size, self._queue.dtype)
        self._pick(self._queue, self._whole, self._part, self._row, begun, out)
        return out

    def turn(self, end: int) -> tuple[int, int, int]:
        """Turn to the next slot, if it is time after ``end`` integration steps of a control step.

        Return the slots to write, before it and at the begin of the window, for :meth:`sample`.
        """
        slots = self.plan.slots
        if not self.plan.follows or end == self.plan.readings[0]:
            self._now = (self._now + 1) % slots
        return self._now, (self._now - 1) % slots, (self._now - self.plan.window * self.plan.every) % slots

    def sample(
        self, state: Any, slots: tuple[int, int, int], end: int, thread: int = 0, first: int = 0,
        last: int | None = None,
    ) -> None:
        """Take the readings that are due after ``end`` integration steps of a control step, in a range of blocks.

        ``slots`` are those that :meth:`turn` returned; ``thread`` is the number of the calling thread.
        """
        with np.errstate(all="ignore"):
            self._sample(state, self._memory, self._scratch[thread], first, len(self._memory) if last is None else last,
                         self.size, *slots, float(end), *self.plan.numbers)

    def give(
        self, observation: NDArray[np.float32], observed: Array, thread: int = 0, first: int = 0,
        last: int | None = None,
    ) -> None:
        """Write observations, shape ``(size, width)`` or wider, and observed angles [rad], shape ``(size,)``."""
        with np.errstate(all="ignore"):
            self._give(observation, observed, self._memory, self._scratch[thread], first,
                       len(self._memory) if last is None else last, self.size, self._now, self._lag)

    # --- saved states -----------------------------------------------------------------------------------------------

    def saved(self) -> dict[str, Any]:
        """Return everything that differs between episodes, for one environment, as plain numbers."""
        return {"readings": self._memory[0].tolist(), "slot": self._now, "actions": self._queue[:, 0].tolist(),
                "row": self._row, "late": int(self._whole[0] * self.plan.substeps + self._part[0])}

    def checked(self, saved: Any) -> Sensing:
        """Return a copy with the numbers of :meth:`saved`; SceneError if they do not fit this environment."""
        try:
            whole, part = divmod(int(saved["late"]), self.plan.substeps)
            given = {"readings": [saved["readings"]], "actions": [[float(value)] for value in saved["actions"]],
                     "whole": [whole], "part": [part], "slot": saved["slot"], "row": saved["row"]}
        except (TypeError, ValueError, LookupError, OverflowError):
            given = None
        return self.checked_of_all(given)

    def saved_of_all(self) -> dict[str, Any]:
        """Return everything that differs between episodes, for all environments, as arrays and whole numbers."""
        return {"readings": self._memory.copy(), "actions": self._queue.copy(), "whole": self._whole.copy(),
                "part": self._part.copy(), "slot": self._now, "row": self._row}

    def checked_of_all(self, saved: Any) -> Sensing:
        """Return a copy with the numbers of :meth:`saved_of_all`; SceneError if they do not fit these environments."""
        other, own = copied(self), self.saved_of_all()
        try:
            kinds = {name: getattr(value, "dtype", np.int64) for name, value in own.items()} | {"actions": None}
            given = {name: np.array(saved[name], dtype=kind, order="C") for name, kind in kinds.items()}
            good = bool(all(given[name].shape == np.shape(value) for name, value in own.items())
                        and given["actions"].dtype in (np.float32, np.float64)
                        and np.isfinite(given["readings"]).all() and (np.abs(given["actions"]) <= 1.0).all()
                        and 0 <= given["slot"] < self.plan.slots and 0 <= given["row"] < len(self._queue))
            late = given["whole"] * self.plan.substeps + given["part"]
            low, high = self.plan.acts_late
            good = good and bool((late >= low).all() and (late <= high).all() and (given["part"] >= 0).all())
            if good and "lag" in self._fields:
                width, place = self.place.width, self._fields.index("lag")
                lags = given["readings"][:, place * width : (place + 1) * width].ravel()[: self.size]
                good = bool((lags >= 0).all() and (lags < self.plan.slots).all() and (lags % 1 == 0).all())
        except (TypeError, ValueError, LookupError, OverflowError):
            good = False
        if not good:
            raise SceneError(UNFIT)
        other._memory, other._queue = given["readings"], given["actions"]
        other._whole, other._part = given["whole"], given["part"]
        other._now, other._row = int(given["slot"]), int(given["row"])
        return other


def copied(sensing: Sensing) -> Sensing:
    """Return a copy of a Sensing with memory of its own."""
    other = Sensing.__new__(Sensing)
    own: Mapping[str, Any] = {name: value.copy() if isinstance(value, np.ndarray) else value
                              for name, value in vars(sensing).items()}
    vars(other).update(own)
    return other


def gain_of(corner: float | None, between: float) -> float:
    """Return the gain of a first-order filter with a corner frequency [Hz] for readings ``between`` seconds apart."""
    return 0.0 if corner is None else 1.0 - elementary.exp(-2.0 * math.pi * corner * between)

