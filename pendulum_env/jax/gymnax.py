"""gymnax's interface to the environment in JAX, for its wrappers and for loops in the style of PureJaxRL."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from functools import cache
from typing import Any, cast

import jax
import jax.numpy as jnp
import numpy as np
from gymnasium import spaces

LARGEST = float(np.finfo(np.float32).max)


class KeyedBox(spaces.Box):
    """Gymnasium's space of arrays within bounds, which also samples with a key of JAX, as gymnax's spaces do."""

    def sample(self, key: Any = None, *rest: Any, **more: Any) -> Any:  # type: ignore[override]
        """Return a random array, drawn by a key of JAX or, without one, by the space's own generator."""
        if not isinstance(key, jax.Array):
            return super().sample(key, *rest, **more)
        share = jax.random.uniform(key, self.shape)
        return ((1.0 - share)*self.low + share*self.high).astype(self.dtype)  # high - low may overflow

    def contains(self, x: Any) -> Any:
        """Return True for an array within the bounds; an array of JAX while JAX traces."""
        if not isinstance(x, jax.core.Tracer):
            return super().contains(np.asarray(x) if isinstance(x, jax.Array) else x)
        return jnp.all((x >= self.low) & (x <= self.high))


class KeyedDict:
    """A space of parts by name, which samples with a key of JAX, as gymnax's does; the parts are attributes of a state.

    Attributes:
        spaces: the space of each part.
    """

    def __init__(self, parts: Mapping[str, KeyedBox]) -> None:
        self.spaces = dict(parts)
        self.num_spaces = len(self.spaces)

    def sample(self, key: Any) -> dict[str, Any]:
        """Return a random value of each part, drawn by a key."""
        keys = jax.random.split(key, self.num_spaces)
        return {name: one.sample(own) for (name, one), own in zip(self.spaces.items(), keys, strict=True)}

    def contains(self, x: Any) -> Any:
        """Return True for a state of which every part is in its space."""
        inside = [jnp.all((jnp.asarray(part) >= one.low) & (jnp.asarray(part) <= one.high))
                  for name, one in self.spaces.items() for part in [getattr(x, name)]]
        return jnp.all(jnp.stack(inside))


@cache
def box_class(theirs: type | None) -> type[KeyedBox]:
    """Return the class of spaces, which is one of gymnax's, too, where gymnax is imported: its wrappers ask for it."""
    return KeyedBox if theirs is None else type("KeyedBox", (KeyedBox, theirs), {})


def keyed(space: spaces.Box) -> KeyedBox:
    """Return a space of Gymnasium as one that samples with a key."""
    theirs = getattr(sys.modules.get("gymnax.environments.spaces"), "Box", None)
    return box_class(theirs)(space.low, space.high, space.shape, cast(Any, space.dtype))


class Gymnax:
    """A LabPendulum with gymnax's interface: an episode that ends starts again within the step.

    ``reset(key, params)`` returns observation and state; ``step(key, state, action, params)`` returns observation,
    state, reward, done and info. The observation of a step that ends an episode is that of the new start; that of the
    end is ``info["final_observation"]``. gymnax's wrappers, such as its LogWrapper, take it: with ``split=True`` those
    of gymnax from version 1 on, else those before.

    Args:
        env: the environment, a :class:`pendulum_env.jax.LabPendulum`.
        split: True returns ``terminated, truncated`` in place of ``done``.
    """

    supports_transition_gradients = transition_gradients_enabled = True
    name = "LabPendulum-v0"
    num_actions = 1

    def __init__(self, env: Any, split: bool = False) -> None:
        self.env, self.split = env, split

    @property
    def default_params(self) -> Any:
        """Return the parameters of the scene, an EnvParams."""
        return self.env.default_params

    def with_transition_gradients(self) -> Gymnax:
        """Return this environment, whose steps always have derivatives."""
        return self

    def observation_space(self, params: Any = None) -> KeyedBox:
        """Return the space of observations."""
        return keyed(self.env.observation_space)

    def action_space(self, params: Any = None) -> KeyedBox:
        """Return the space of actions."""
        return keyed(self.env.action_space)

    def state_space(self, params: Any = None) -> KeyedDict:
        """Return the space of states: bounds of the program's values, of the stop code and of the control steps."""
        used = self.env.default_params if params is None else params
        longest = int(np.max(np.asarray(used.max_steps_in_episode)))
        sizes: dict[str, Any] = {
            "values": (-LARGEST, LARGEST, (self.env.twin.size,), np.float32), "stop": (0.0, 100.0, (), np.float32),
            "time": (0, longest, (), np.int32)}
        return KeyedDict({name: keyed(spaces.Box(*size)) for name, size in sizes.items()})

    def reset(self, key: Any, params: Any = None) -> tuple[Any, Any]:
        """Return the first observation and the state of a new episode."""
        state = self.env.initial(key, params)
        return self.env.observation(state, None, params), state

    reset_env = reset
    """As ``reset``; gymnax's own environments have one that is compiled and one that is not."""

    def get_obs(self, state: Any, params: Any = None, key: Any = None) -> Any:
        """Return the observation of a state."""
        return self.env.observation(state, key, params)

    def observe(self, key: Any, state: Any, action: Any = None, params: Any = None) -> Any:
        """Return the observation of a state, with the arguments of gymnax from version 1 on."""
        return self.env.observation(state, key, params)

    def is_terminated(self, state: Any, params: Any = None) -> Any:
        """Return True where the episode has ended before its time."""
        return self.env.terminal(state)

    def is_truncated(self, state: Any, params: Any = None) -> Any:
        """Return True where the time of the episode is up."""
        return self.env.truncated(state, params)

    def is_terminal(self, state: Any, params: Any = None) -> Any:
        """Return True where the episode has ended: for any reason or, with ``split``, before its time."""
        ended = self.is_terminated(state, params)
        return ended if self.split else ended | self.is_truncated(state, params)

    def discount(self, state: Any, params: Any = None) -> Any:
        """Return 0.0 where the episode has ended before its time, else 1.0, as ``info["discount"]``."""
        return jnp.where(self.is_terminated(state, params), 0.0, 1.0)

    def step_env(self, key: Any, state: Any, action: Any, params: Any = None) -> tuple[Any, ...]:
        """Return observation, state, reward, ``is_terminal`` and info of a step, without a new start at the end."""
        after = self.env.transition(state, action, key, params)
        reward = self.env.reward(state, action, after, None, params)
        seen = self.env.observation(after, None, params)
        return seen, after, reward, self.is_terminal(after, params), {"discount": self.discount(after, params)}

    def step(self, key: Any, state: Any, action: Any, params: Any = None) -> tuple[Any, ...]:
        """Return observation, state, reward, done (or terminated and truncated) and info of a control step."""
        stepping, starting = jax.random.split(key) if self.env.noisy else (key, key)
        final, after, reward, _, info = self.step_env(stepping, state, action, params)
        terminated, truncated = self.is_terminated(after, params), self.is_truncated(after, params)
        done = terminated | truncated
        new = self.env.initial(starting, params)
        state = jax.tree.map(lambda one, other: jnp.where(done, one, other), new, after)
        seen = self.env.observation(state, None, params)  # of the chosen state: twice as fast as choosing of two
        truncated = truncated & ~terminated
        info = {**info, "terminated": terminated, "truncated": truncated, "final_observation": final}
        ends = (terminated, truncated) if self.split else (done,)
        return (seen, state, reward, *ends, info)
