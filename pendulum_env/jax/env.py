"""The environment LabPendulum as pure functions of JAX arrays: Gymnasium's functional interface, and that of gymnax."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from gymnasium import spaces
from gymnasium.experimental.functional import FuncEnv

from integrators import Method
from pendulum_env.common.version import REGISTERED
from pendulum_env.engine.each import checked_limit, frequency
from pendulum_env.engine.goal import goal_text
from pendulum_env.engine.machine import check_diagnostics, find_method
from pendulum_env.engine.shape import HOLD
from pendulum_env.envs.randomize import CHOICE, LOG, Range
from pendulum_env.envs.settings import usual
from pendulum_env.jax.parameters import numbers, on_arrays, traced, with_parameters
from pendulum_env.jax.programs import functions
from pendulum_env.jax.run import Twin, check_fits, kind_of, twin
from pendulum_env.physics.damping import Damping, build_scene
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, number, whole_number
from pendulum_env.tasks import USUAL_TASK, Task, find_task

FELL = 4.0
"""Stop code of an episode whose task is lost."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class EnvParams:
    """What differs between environments of one program: numbers, and the length of an episode.

    Attributes:
        numbers: the numbers of the program, in its order.
        omega0: angular frequency of small swings [1/s].
        speed_limit: |velocity| that ends an episode [rad/s].
        max_steps_in_episode: control steps in an episode.
    """

    numbers: tuple[Any, ...]
    omega0: Any
    speed_limit: Any
    max_steps_in_episode: Any


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class EnvState:
    """The state of an episode.

    Attributes:
        values: the state of the program.
        stop: code of the stop reason, 0 while the episode goes on.
        time: control steps taken.
        params: numbers drawn for this episode; None without ``randomize``.
    """

    values: tuple[Any, ...]
    stop: Any
    time: Any
    params: EnvParams | None


class LabPendulum(FuncEnv[Any, Any, Any, Any, Any, Any, Any]):
    """LabPendulum in JAX: pure functions of a state, an action, a random key and parameters.

    The functions are those of ``gymnasium.experimental.functional.FuncEnv``: ``initial``, ``transition``,
    ``observation``, ``reward``, ``terminal``, ``state_info``. Observation, reward and endings are those of
    ``gym.make("LabPendulum-v0")``; random numbers are JAX's. ``gymnax()`` returns an adapter with gymnax's ``reset``
    and ``step``.

    Args:
        scene, integrator, damping, task, dt, substeps, diagnostics, speed_limit: as in ``gym.make``.
        max_steps: control steps in an episode.
        randomize: parameters drawn for every episode by name, as in ``gym.make``: ``(low, high)``, ``("log", low,
            high)`` or a list of values.
        dtype: "float32" or "float64"; by default float64 where JAX has it enabled.
        **parameters: parameters of the scene, such as ``length=0.5``.

    Raises SceneError, MethodError or TaskError for invalid arguments, and for what has no twin: dry friction,
    steps that call Python.
    """

    def __init__(
        self,
        scene: str | Scene | Mapping[str, object] = "lab",
        *,
        integrator: str | Method | None = None,
        damping: Damping = "scene",
        task: str | Task = USUAL_TASK,
        dt: float | None = None,
        substeps: int = 1,
        diagnostics: Sequence[str] = ("energy",),
        speed_limit: float | None = None,
        max_steps: int | None = None,
        randomize: Mapping[str, Any] | None = None,
        dtype: str | None = None,
        **parameters: Any,
    ) -> None:
        self.kind = kind_of(dtype)
        integrator, dt = usual(scene, integrator, dt)
        self.scene = with_parameters(build_scene(scene, damping, {}), parameters)
        self.task = find_task(task)
        self.method = find_method(integrator, self.scene)
        check_fits(self.scene, self.method, self.kind)
        self.dt = number(dt, "dt", above=0.0, unit="s")
        self.substeps = whole_number(substeps, "substeps")
        self.h = self.dt / self.substeps
        steps = self.task.steps(self.dt) if max_steps is None else whole_number(max_steps, "max_steps")
        self.max_steps = REGISTERED if steps is None else steps
        self._limit = speed_limit
        self.ranges = [Range.of(name, given) for name, given in (randomize or {}).items()]
        self.twin: Twin = twin(self.scene, self.method, check_diagnostics(diagnostics))
        if self.twin.program.shape.drawn:
            raise SceneError("gusts have no twin in the environment in JAX; leave the effect out, as in "
                             "scene.with_effects(...), or use gym.make_vec.")
        for one in self.ranges:
            with_parameters(self.scene, {one.name: one.values[0]})
        self._judge = functions(goal_text(self.task.goal))
        entries = 3 if self.task.goal.reference is None else 7
        top = np.array([1.0, 1.0, np.finfo(np.float32).max, *[1.0] * (entries - 3)], dtype=np.float32)
        self.observation_space = spaces.Box(-top, top, dtype=np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (1,), np.float32)
        self.default_params: EnvParams
        super().__init__()

    # --- parameters -------------------------------------------------------------------------------------------------

    def get_default_params(self, **parameters: Any) -> EnvParams:
        """Return the parameters of the environments, with other values of the scene's parameters, such as ``length=x``.

        Values may be arrays of JAX; ``jax.vmap`` over the result runs environments that differ.

        Raises SceneError for invalid parameters.
        """
        place = with_parameters(self.scene, parameters)
        values = {HOLD[0]: float(self.substeps), **numbers(place)}
        limit = checked_limit(self._limit, place)
        return EnvParams(
            tuple(jnp.asarray(values[name], self.kind) for name in self.twin.parameters),
            jnp.asarray(traced(frequency(place)), self.kind), jnp.asarray(traced(limit), self.kind),
            jnp.asarray(self.max_steps))

    def _drawn(self, key: Any) -> EnvParams:
        """Return the parameters of an episode, drawn by a key."""
        values = {}
        for one, own in zip(self.ranges, jax.random.split(key, len(self.ranges)), strict=True):
            low, high = one.values[0], one.values[-1]
            if one.kind == CHOICE:
                values[one.name] = jax.random.choice(own, jnp.asarray(one.values, self.kind))
            else:
                u = jax.random.uniform(own, dtype=self.kind)
                values[one.name] = low + (high - low) * u
                if one.kind == LOG:
                    values[one.name] = low * jnp.exp(u * math.log(high / low))
        return self.get_default_params(**values)

    def _of(self, state: EnvState | None, params: EnvParams | None) -> EnvParams:
        if state is not None and state.params is not None:
            return state.params
        own: EnvParams = self.default_params
        return own if params is None else params

    # --- Gymnasium's functional interface ---------------------------------------------------------------------------

    def initial(self, rng: Any, params: EnvParams | None = None) -> EnvState:
        """Return the state at the start of an episode, drawn by a key as the task says."""
        drawing, starting = jax.random.split(rng) if self.ranges else (None, rng)
        own = self._drawn(drawing) if self.ranges else None
        used = own or self._of(None, params)
        angle: Any
        velocity: Any
        if self.task.draws:
            first, second = jax.random.uniform(starting, (2,), dtype=self.kind)
            begin = self.task.goal.begin
            if begin is None:
                angle, velocity = self.task.starts(first, second, used.omega0)
            else:
                given = {"first": first, "second": second, "omega0": used.omega0}
                angle, velocity = on_arrays(begin)(*(given[name] for name in begin.__code__.co_varnames[
                    : begin.__code__.co_argcount]))
        else:
            angle, velocity = self.scene.run.angle, self.scene.run.velocity
        return self.started(angle, velocity, used if own else None, used)

    def started(self, angle: Any, velocity: Any, own: EnvParams | None = None, params: EnvParams | None = None,
                ) -> EnvState:
        """Return the state at the start of an episode from an angle [rad] and a velocity [rad/s]."""
        used = own or self._of(None, params)
        values = self.twin.start(angle, velocity, used.numbers, {}, self.kind)
        return EnvState(values, jnp.zeros_like(values[1]), jnp.zeros(values[1].shape, jnp.int32), own)

    def transition(self, state: EnvState, action: Any, rng: Any = None, params: EnvParams | None = None) -> EnvState:
        """Return the state after one control step of a constant action, which is clipped to [-1, 1]."""
        used, share, shape = self._of(state, params), self._share(action), self.twin.program.shape
        carry = (state.values, state.stop)
        plain = not shape.memory and not shape.remembered
        carry = self.twin.step(carry, used.numbers, share, self.h, used.speed_limit, known=plain)
        if self.substeps > 1:
            def turn(_: Any, carry: Any) -> Any:
                return self.twin.step(carry, used.numbers, share, self.h, used.speed_limit, known=not shape.remembered)

            carry = jax.lax.fori_loop(1, self.substeps, turn, carry)
        values, stop = carry
        _, lost = self._judged(state, values, share, used)
        stop = jnp.where((stop == 0.0) & lost, FELL, stop)
        return replace(state, values=values, stop=stop, time=state.time + 1)

    def observation(self, state: EnvState, rng: Any = None, params: EnvParams | None = None) -> Any:
        """Return cosine and sine of the angle and the velocity, float32; with a reference four more entries."""
        used = self._of(state, params)
        seen = self._reports(state.values, used)
        sign = -1.0 if self.task.goal.upright else 1.0
        entries = [sign * seen["cosine"], sign * seen["sine"], seen["rate"]]
        if self.task.goal.reference is not None:
            entries += self._judge.call("ahead", state.values[0], self.h, self.dt)
        return jnp.stack([jnp.asarray(entry, jnp.float32) for entry in entries], axis=-1)

    def reward(self, state: EnvState, action: Any, next_state: EnvState, rng: Any = None,
               params: EnvParams | None = None) -> Any:
        """Return the task's reward of the control step from a state to the next."""
        reward, _ = self._judged(state, next_state.values, self._share(action), self._of(state, params))
        return reward

    def terminal(self, state: EnvState, rng: Any = None, params: EnvParams | None = None) -> Any:
        """Return True where the episode has ended before its time: speed limit, divergence, slack wire, lost task."""
        return state.stop != 0.0

    def state_info(self, state: EnvState, params: EnvParams | None = None) -> dict[str, Any]:
        """Return time, unwrapped angle, velocity and the reported quantities, such as the energy ledger [J]."""
        seen = self._reports(state.values, self._of(state, params))
        return {name: value for name, value in seen.items() if name in self.twin.program.shape.info}

    def truncated(self, state: EnvState, params: EnvParams | None = None) -> Any:
        """Return True where the time of the episode is up."""
        return state.time >= self._of(state, params).max_steps_in_episode

    def gymnax(self, split: bool = False) -> Gymnax:
        """Return an adapter with gymnax's ``reset(key, params)`` and ``step(key, state, action, params)``.

        ``split=True`` returns ``terminated, truncated`` in place of ``done``, as gymnax does from version 1.
        """
        return Gymnax(self, split)

    # --- parts ------------------------------------------------------------------------------------------------------

    def _share(self, action: Any) -> Any:
        action = jnp.asarray(action, self.kind)
        return jnp.clip(action[..., 0] if action.ndim and action.shape[-1] == 1 else action, -1.0, 1.0)

    def _reports(self, values: Any, used: EnvParams) -> dict[str, Any]:
        """Return the observation and the entries of ``info`` of a state of the program, by name."""
        reports: dict[str, Any]
        _, _, reports = self.twin.run(values, used.numbers, 0.0, self.h, steps=0, report=True)
        return reports

    def _judged(self, state: EnvState, values: Any, share: Any, used: EnvParams) -> Any:
        """Return reward and loss of a control step that led to a state of the program."""
        names = self.twin.names
        place = {name: values[names.index(name)] for name in ("index", "angle", "turns", "velocity")}
        phi = self._reports(values, used)["phi"]
        goal, before = self.task.goal, []
        if goal.before:
            earlier = self._reports(state.values, used)
            turned = state.values[names.index("angle")] + 2.0 * math.pi * state.values[names.index("turns")]
            known = {"phi_before": earlier["phi"], "angle_before": turned,
                     "velocity_before": state.values[names.index("velocity")]}
            before = [known[name] for name in goal.before]
        reward, lost = self._judge.call("judge", *place.values(), phi, share, used.omega0, self.h, *before)
        shape = jnp.shape(place["angle"])
        return jnp.broadcast_to(jnp.asarray(reward, self.kind), shape), jnp.broadcast_to(jnp.asarray(lost, bool), shape)


class Gymnax:
    """A LabPendulum with gymnax's interface: an episode that ends starts again within the step.

    ``reset(key, params)`` returns observation and state; ``step(key, state, action, params)`` returns observation,
    state, reward, done and info. The observation of a step that ends an episode is that of the new start; that of the
    end is ``info["final_observation"]``.

    Args:
        env: the environment.
        split: True returns ``terminated, truncated`` in place of ``done``.
    """

    def __init__(self, env: LabPendulum, split: bool = False) -> None:
        self.env, self.split = env, split

    @property
    def name(self) -> str:
        """Return the environment's name."""
        return "LabPendulum-v0"

    @property
    def num_actions(self) -> int:
        """Return the number of an action's entries."""
        return 1

    @property
    def default_params(self) -> EnvParams:
        """Return the parameters of the scene."""
        own: EnvParams = self.env.default_params
        return own

    def observation_space(self, params: EnvParams | None = None) -> spaces.Box:
        """Return the space of observations."""
        return self.env.observation_space  # type: ignore[return-value]

    def action_space(self, params: EnvParams | None = None) -> spaces.Box:
        """Return the space of actions."""
        return self.env.action_space  # type: ignore[return-value]

    def reset(self, key: Any, params: EnvParams | None = None) -> tuple[Any, EnvState]:
        """Return the first observation and the state of a new episode."""
        state = self.env.initial(key, params)
        return self.env.observation(state, None, params), state

    def step_env(self, key: Any, state: EnvState, action: Any, params: EnvParams | None = None) -> tuple[Any, ...]:
        """Return the results of a step without a new start at the end of an episode."""
        after = self.env.transition(state, action, key, params)
        reward = self.env.reward(state, action, after, None, params)
        return (self.env.observation(after, None, params), after, reward, self.env.terminal(after),
                self.env.truncated(after, params))

    def step(self, key: Any, state: EnvState, action: Any, params: EnvParams | None = None) -> tuple[Any, ...]:
        """Return observation, state, reward, done (or terminated and truncated) and info of a control step."""
        final, after, reward, terminated, truncated = self.step_env(key, state, action, params)
        done = terminated | truncated
        new = self.env.initial(key, params)  # the step itself draws nothing
        state = jax.tree.map(lambda one, other: jnp.where(done, one, other), new, after)
        seen = self.env.observation(state, None, params)  # of the chosen state: twice as fast as choosing of two
        truncated = truncated & ~terminated
        info = {"discount": jnp.where(terminated, 0.0, 1.0), "terminated": terminated, "truncated": truncated,
                "final_observation": final}
        ends = (terminated, truncated) if self.split else (done,)
        return (seen, state, reward, *ends, info)
