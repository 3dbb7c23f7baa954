"""Readings of a sensor and delayed actions as pure functions of arrays.

The rules of a reading are functions of the program of :mod:`pendulum_env.engine.sensing`, and its plan says when
readings are taken and actions arrive. Here slots and actions move up by one place when a new one comes, so that the
newest is always the last, and random numbers come from keys. They are tuples of arrays, which move without a copy: a
step with a sensor takes half the time of one that writes into arrays of slots.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import groupby
from typing import Any

import jax
import jax.numpy as jnp

from pendulum_env.engine.machine import ANGLE, TURNS, VELOCITY
from pendulum_env.engine.sensing import NUMBERS, MotionFields, Plan, Text
from pendulum_env.envs.sensing import delays
from pendulum_env.jax.programs import Functions, choose, functions


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class SensedState:
    """Readings and actions of an episode that are still to be seen, or to act.

    Attributes:
        rings: entries of the slots by name, tuples with the newest last; empty where observations show the true
            motion.
        own: other numbers of the episode by name: the sensor's zero, the slots since the last reading and, for a random
            observation delay, ``lag`` and ``late`` as :meth:`pendulum_env.engine.sensing.Plan.lag` returns them.
        actions: actions, the newest last; empty without an action delay.
        acts_late: random action delay [integration steps]; None for a fixed one.
    """

    rings: dict[str, tuple[Any, ...]]
    own: dict[str, Any]
    actions: tuple[Any, ...]
    acts_late: Any


class TwinSensing:
    """Readings and delayed actions of environments in JAX.

    Args:
        plan: times of readings and delayed actions.
        periodic: True if the angle is that from the nearer of bottom and top.
        remembers: True for scenes with effects that have a state; see :meth:`Plan.parts`.
        kind: type of numbers.

    Attributes:
        reads: True if observations differ from the true motion at their time.
        acts: True if actions arrive late.
        draws: number of random numbers at the start of an episode.
    """

    def __init__(self, plan: Plan, periodic: bool, remembers: bool, kind: Any) -> None:
        self.plan, self.kind = plan, kind
        self.reads = not (plan.kind == "full" and plan.ideal and plan.follows and plan.seen_late == (0, 0))
        self.acts = plan.acts_late != (0, 0)
        self._text = Text(plan, MotionFields(1, ANGLE, TURNS, VELOCITY, periodic))
        self._numbers = dict(zip(NUMBERS, plan.numbers, strict=True))
        self._parts = plan.parts(remembers)
        self._varies = plan.acts_late[0] < plan.acts_late[1]
        self.draws = int(plan.random) + int(self._varies) + len(self._text.uniforms)

    @property
    def last(self) -> int:
        """Return the integration steps of a control step after which the last action arrives."""
        return self._parts[-1][0]

    @cached_property
    def _rules(self) -> Functions:
        return functions(self._text.program(memory=False).text)

    # --- the course of an episode -----------------------------------------------------------------------------------

    def begin(self, motion: Any, uniform: Any) -> SensedState:
        """Return the state at the start of an episode from angle, turns and velocity, and as many random numbers in
        [0, 1) as ``draws`` along a first axis.
        """
        plan, form = self.plan, jnp.shape(motion[0])
        seen, acts = int(plan.random), int(plan.random) + int(self._varies)
        rings: dict[str, tuple[Any, ...]] = {}
        own: dict[str, Any] = {}
        if self.reads:
            known = {**_named(motion), **self._chances(uniform[acts:] if self._text.uniforms else ())}
            entries = self._called("first", ("q", "turns", "v", *self._text.uniforms, *NUMBERS), self._text.started,
                                   known, form)
            rings = {name: (entries[f"{name}1"],) * plan.slots for name in self._text.rings}
            own = {name: jnp.zeros(form, self.kind) for name in self._text.counted}
            if plan.zeroed:
                own["zero"] = entries["zero"]
            if plan.random:
                late = delays(plan.seen_late, uniform[0])
                own["lag"], own["late"] = (jnp.broadcast_to(one, form) for one in plan.lag(late))
        queue = (jnp.zeros(form, self.kind),) * (plan.acts_late[1] // plan.substeps + 2 if self.acts else 0)
        return SensedState(rings, own, queue, delays(plan.acts_late, uniform[seen]) if self._varies else None)

    def step(self, carry: Any, sensed: SensedState, share: Any, key: Any, run: Callable[[Any, Any, int], Any],
             motion_of: Callable[[Any], Any]) -> tuple[Any, SensedState]:
        """Return the motion and the readings after a control step.

        Args:
            carry: the motion.
            sensed: readings and actions before the step.
            share: the action.
            key: key that draws the sensor's noise.
            run: function of the motion, an action and a number of integration steps, which advances the motion.
            motion_of: function that returns angle, turns and velocity of the motion.
        """
        if self.acts:
            new = jnp.broadcast_to(jnp.asarray(share, self.kind), sensed.actions[0].shape)
            sensed = replace(sensed, actions=(*sensed.actions[1:], new))

        def part(i: Any, both: Any, begin: int, steps: int, reads: bool) -> Any:
            """Return the motion and the readings after the part that begins ``i * steps`` after ``begin``."""
            carry, sensed = both
            carry = run(carry, self.acting(sensed, share, begin + i * steps), steps)
            if reads and self.reads:
                sensed = self._sampled(sensed, motion_of(carry), begin + (i + 1) * steps, key)
            return carry, sensed

        both: Any = (carry, sensed)
        for (steps, reads), alike in groupby(self._parts, key=lambda one: (one[1] - one[0], one[3])):
            begins = [begin for begin, *_ in alike]
            turn = partial(part, begin=begins[0], steps=steps, reads=reads)
            both = turn(0, both) if len(begins) == 1 else jax.lax.fori_loop(0, len(begins), turn, both)
        return both  # type: ignore[no-any-return]

    def acting(self, sensed: SensedState, share: Any, begun: Any) -> Any:
        """Return the action that acts in a part of a control step that begins after ``begun`` integration steps."""
        if not self.acts:
            return share
        late = self.plan.acts_late[0] if sensed.acts_late is None else sensed.acts_late
        whole, part = late // self.plan.substeps, late % self.plan.substeps
        return _entry(sensed.actions, len(sensed.actions) - 1 - whole - choose(begun < part, 1, 0))

    def give(self, sensed: SensedState) -> tuple[list[Any], Any]:
        """Return the entries of the observation, and the unwrapped angle that it shows [rad]."""
        plan, text = self.plan, self._text
        lag = sensed.own["lag"] if plan.random else plan.lag(plan.seen_late[0])[0]
        entries: list[Any] = []
        angle: Any = None
        for k in reversed(range(plan.history)):
            place = plan.slots - 1 - lag - k * (plan.substeps // plan.spacing)
            cosine, sine, angle = self._rules.call("shown", *(_entry(sensed.rings[name], place) for name in text.parts))
            entries += [cosine, sine]
        if plan.swift:
            entries.append(self._rules.call("bounded", _entry(sensed.rings["w"], place)))
        return entries, angle

    # --- parts ------------------------------------------------------------------------------------------------------

    def _sampled(self, sensed: SensedState, motion: Any, end: Any, key: Any) -> SensedState:
        """Return the readings with those that are due after ``end`` integration steps of a control step."""
        plan, text, form = self.plan, self._text, jnp.shape(motion[0])
        moves = not plan.follows or end == plan.readings[0]
        before = {name: choose(moves, ring[1:], ring[:-1]) for name, ring in sensed.rings.items()}
        if key is not None and len(plan.readings) > 1:
            key = jax.random.fold_in(key, end)
        names = text.uniforms
        known = {**_named(motion), **sensed.own,
                 **{f"{name}0": before[name][-1] for name in text.past},
                 **{f"{name}_old": before[name][-plan.window * plan.every] for name in text.windowed},
                 **self._chances(jax.random.uniform(key, (len(names), *form), self.kind) if names else ())}
        results = self._called("sampled", text.needed, text.written, known, form)
        mine = sensed.own["late"] == end if plan.random else True
        rings = {name: (*before[name], choose(mine, results[f"{name}1"], ring[-1]))
                 for name, ring in sensed.rings.items()}
        own = {name: choose(mine, results[name], sensed.own[name]) for name in text.counted}
        return replace(sensed, rings=rings, own={**sensed.own, **own})

    def _called(self, name: str, arguments: tuple[str, ...], results: tuple[str, ...], known: dict[str, Any], form: Any,
                ) -> dict[str, Any]:
        """Return the results of a function of the program by name, from its arguments by name."""
        known = {**self._numbers, **known}
        values = self._rules.call(name, *(known[one] for one in arguments))
        values = values if isinstance(values, tuple) else (values,)
        return {one: jnp.broadcast_to(jnp.asarray(value, self.kind), form)
                for one, value in zip(results, values, strict=True)}

    def _chances(self, uniform: Any) -> dict[str, Any]:
        """Return the random numbers of a reading by name, above 0 and up to 1, from those in [0, 1)."""
        return {name: 1.0 - one for name, one in zip(self._text.uniforms, uniform, strict=True)}


def _named(motion: Any) -> dict[str, Any]:
    """Return angle, turns and velocity by their names in the program."""
    return dict(zip(("q", "turns", "v"), motion, strict=True))


def _entry(values: tuple[Any, ...], place: Any) -> Any:
    """Return the entry at a place, which may be an array: a place for each environment."""
    if isinstance(place, int):
        return values[place]
    place = jnp.broadcast_to(place, values[0].shape)
    return jnp.take_along_axis(jnp.stack(values), place[None], axis=0)[0]
