"""The environment LabPendulum as pure functions of JAX arrays: Gymnasium's functional interface, and that of gymnax."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any, ClassVar, TypeVar, cast

import jax
import jax.numpy as jnp
import numpy as np
from gymnasium.experimental.functional import FuncEnv

from pendulum_env.common.many import twin_of
from pendulum_env.engine.goal import goal_text
from pendulum_env.engine.machine import find_method
from pendulum_env.engine.settings import described, documented, taking
from pendulum_env.engine.starts import checked_limit, frequency
from pendulum_env.envs.limits import REGISTERED
from pendulum_env.envs.randomize import Function, Joint, Randomization, Range, randomization
from pendulum_env.envs.sensing import OBSERVED, plan_of
from pendulum_env.envs.settings import UNBOUNDED, EpisodeSettings, acting, spaces_of, task_of, usual
from pendulum_env.jax.gymnax import Gymnax
from pendulum_env.jax.parameters import numbers, on_arrays, with_parameters
from pendulum_env.jax.programs import functions
from pendulum_env.jax.run import Twin, check_fits, kind_of, smoothed, twin
from pendulum_env.jax.sensing import TwinSensing
from pendulum_env.physics import random
from pendulum_env.physics.damping import build_scene
from pendulum_env.physics.units import SceneError, count, naming_keywords, nearest, setting, shown
from pendulum_env.tasks.task import earlier, steps_of

LONGEST = 2**31 - 1
"""Most control steps in an episode: they are counted in 32 bits."""
FELL = 4.0
"""Stop code of an episode whose task is lost."""


R = TypeVar("R", bound="Replaced")


class Replaced:
    """A dataclass with ``replace``, as gymnax's have it.

    Attributes:
        remedy: sentence for those who look for other fields.
    """

    remedy: ClassVar[str]

    def replace(self: R, **changes: Any) -> R:
        """Return the same with other values of some fields; SceneError for other names."""
        known = [field.name for field in fields(cast(Any, self))]
        for name in changes:
            if name not in known:
                raise SceneError(f"{type(self).__name__} has no field {shown(name)}{nearest(name, known)} "
                                 f"{self.remedy}")
        return cast(R, replace(cast(Any, self), **changes))


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class EnvParams(Replaced):
    """What differs between environments of one program: numbers, and the length of an episode.

    Attributes:
        numbers: the numbers of the program, in its order.
        omega0: angular frequency of small swings [1/s].
        speed_limit: |velocity| that ends an episode [rad/s].
        max_steps_in_episode: control steps in an episode.
    """

    remedy = "Parameters of the scene, such as length, are those of get_default_params(length=x)."
    numbers: tuple[Any, ...]
    omega0: Any
    speed_limit: Any
    max_steps_in_episode: Any


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class EnvState(Replaced):
    """The state of an episode.

    Attributes:
        values: the state of the program.
        stop: code of the stop reason, 0 while the episode goes on.
        time: control steps taken.
        params: numbers drawn for this episode; None without ``randomize``.
        sensed: a :class:`pendulum_env.jax.sensing.SensedState`, readings and actions on their way; None without a
            sensor, delays, or another kind of observation.
        acted: the last action, as settings such as ``action_noise`` have changed it; None without them.
    """

    remedy = "To start elsewhere, use started(angle, velocity)."
    values: tuple[Any, ...]
    stop: Any
    time: Any
    params: EnvParams | None
    sensed: Any = None
    acted: Any = None


@dataclass(frozen=True, kw_only=True, repr=False, eq=False)
class TwinSettings(EpisodeSettings):
    """Settings of :class:`LabPendulum`."""

    max_steps: int | None = count(None, "control steps in an episode, in place of duration", LONGEST)
    smooth: float | None = setting(
        None, "velocity over which dry friction is smoothed", unit="rad/s", note="as in pendulum_env.jax.rollout")
    dtype: Any = setting(None, '"float32", "float64", or JAX\'s type of this name',
                         note="None for float64 where JAX has it enabled")


class LabPendulum(FuncEnv[Any, Any, Any, Any, Any, Any, Any]):
    """LabPendulum in JAX: pure functions of a state, an action, a random key and parameters.

    The functions are those of ``gymnasium.experimental.functional.FuncEnv``: ``initial``, ``transition``,
    ``observation``, ``reward``, ``terminal``, ``state_info``. Observation, reward and endings are those of
    ``gym.make("LabPendulum-v0")``; random numbers are JAX's. ``gymnax()`` returns an adapter with gymnax's ``reset``
    and ``step``.

    Keywords are those of ``gym.make``, but for backends, tolerances, compensated sums and frames, and:

    {arguments}

    A draw from a bootstrap or posterior is one of its rows. Delays that are drawn, and the first reading, take the key
    of ``initial``; later noise takes that of ``transition``. The derivative of a reading rounded to a quantum is 0, as
    that of ``jnp.round``, so that learning by gradients needs a sensor without quantum, such as one with the noise
    ``quantum / sqrt(12)`` in its place.

    Attributes:
        noisy: True if ``transition`` needs a key, because the sensor or the action draws random numbers.

    Raises SceneError, MethodError or TaskError for invalid arguments, and for what has no twin: dry friction
    without ``smooth``, steps that call Python, functions of a NumPy generator in ``randomize``, gusts in float32.
    """

    @taking(TwinSettings)
    def __init__(self, given: TwinSettings) -> None:
        self._settings, self.kind = given, kind_of(given.dtype)
        integrator, self.dt = usual(given)
        with naming_keywords(type(self)):
            self.scene = with_parameters(smoothed(build_scene(given.scene, given.damping, {}), given.smooth),
                                         given.parameters)
        self.task, self.method = task_of(given), find_method(integrator, self.scene)
        check_fits(self.scene, self.method, self.kind)
        self.substeps, self.h = given.substeps, self.dt / given.substeps
        steps = given.max_steps
        if steps is None:
            steps = self.task.steps(self.dt) if given.duration is None else steps_of(given.duration, self.dt)
        elif given.duration is not None:
            raise SceneError("Give duration or max_steps, not both.")
        self.max_steps = int(REGISTERED) if steps is None else steps
        self.twin: Twin = twin(self.scene, self.method, tuple(given.diagnostics))
        self._judge = functions(goal_text(self.task.goal))
        plan = plan_of(given, self.h, self.substeps)
        remembers = bool(self.twin.program.shape.remembered)
        self._hold = 1 if plan is not None and remembers and plan.changes else self.substeps
        self._sensing = None if plan is None else TwinSensing(plan, self.scene.periodic, remembers, self.kind)
        self._acts = acting(given)
        self.noisy = bool(self._acts) or (plan is not None and plan.draws)
        self._bound = given.velocity_bound
        self.observation_space, self.action_space = spaces_of(self._bound, self.task, plan)
        self._bounded = self._bound < UNBOUNDED and (plan is None or bool(plan.swift))
        self._penalty, self._rate = given.speed_penalty, self.dt if given.reward_rate else 1.0
        self._randomization = randomization(given.randomize)
        if self._randomization:
            self._check_draws(self._randomization)
        self.default_params: EnvParams
        super().__init__()

    # --- parameters -------------------------------------------------------------------------------------------------

    def get_default_params(self, **parameters: Any) -> EnvParams:
        """Return the parameters of the environments, with other values of the scene's parameters, such as ``length=x``.

        Values may be arrays of JAX; ``jax.vmap`` over the result runs environments that differ.

        Raises SceneError for invalid parameters.
        """
        place = with_parameters(self.scene, parameters)
        limit = checked_limit(self._settings.speed_limit, place)
        return EnvParams(
            self.twin.parameters(numbers(place), self._hold, self.kind),
            jnp.asarray(twin_of(frequency(place)), self.kind), jnp.asarray(twin_of(limit), self.kind),
            jnp.asarray(self.max_steps))

    def _drawn(self, key: Any, draws: Randomization) -> EnvParams:
        """Return the parameters of an episode, drawn by a key."""
        values: dict[str, Any] = {}
        first, others = jax.random.split(key)
        uniform = jax.random.uniform(first, (len(draws.parts),), self.kind)
        for i, part in enumerate(draws.parts):
            values |= drawn(part, uniform[i], jax.random.fold_in(others, i))
        return self.get_default_params(**values)

    def _check_draws(self, draws: Randomization) -> None:
        """Raise SceneError for draws that are invalid, or whose numbers JAX does not compute as the package does.

        While JAX traces, conditions in formulas are decided at the scene's own values.
        """
        scenes, trials, wide = draws.scenes(self.scene), draws.trials(), self.kind == np.float64
        jax.eval_shape(lambda: self._drawn(jax.random.key(0), draws))
        columns = {name: jnp.asarray([trial[name] for trial in trials], self.kind) for name in draws.names}
        found = jax.jit(jax.vmap(lambda values: self.get_default_params(**values).numbers))(columns)
        for i, (values, place) in enumerate(zip(trials, scenes, strict=True)):
            exact = self.twin.parameters(numbers(place), self._hold, self.kind)
            if not np.allclose([float(column[i]) for column in found], [float(value) for value in exact],
                               rtol=1e-6 if wide else 1e-3, atol=1e-30, equal_nan=True):
                label = ", ".join(f"{name}={value:.6g}" for name, value in values.items())
                raise SceneError(f"randomize: {label} calls for other formulas than the values of the scene "
                                 f"'{self.scene.name}', at which JAX traces; give the scene itself values within the "
                                 "ranges, or narrower ranges.")

    def _of(self, state: EnvState | None, params: EnvParams | None) -> EnvParams:
        if state is not None and state.params is not None:
            return state.params
        own: EnvParams = self.default_params
        return own if params is None else params

    # --- Gymnasium's functional interface ---------------------------------------------------------------------------

    def initial(self, rng: Any, params: EnvParams | None = None) -> EnvState:
        """Return the state at the start of an episode, drawn by a key as the task says."""
        drawing, starting = jax.random.split(rng) if self._randomization else (None, rng)
        own = self._drawn(drawing, self._randomization) if self._randomization else None
        used = own or self._of(None, params)
        begin = 2 if self.task.draws else 0
        count = begin + self._draws
        uniform: Any = jax.random.uniform(starting, (count,), dtype=self.kind) if count else None
        angle: Any
        velocity: Any
        if self.task.draws:
            formula = self.task.goal.begin
            if formula is None:
                angle, velocity = self.task.starts(uniform[0], uniform[1], used.omega0)
            else:
                given = {"first": uniform[0], "second": uniform[1], "omega0": used.omega0}
                angle, velocity = on_arrays(formula)(*(given[name] for name in formula.__code__.co_varnames[
                    : formula.__code__.co_argcount]))
        else:
            angle, velocity = self.scene.run.angle, self.scene.run.velocity
        return self._begun(angle, velocity, own, used, uniform[begin:] if self._draws else None)

    def started(self, angle: Any, velocity: Any, own: EnvParams | None = None, params: EnvParams | None = None,
                rng: Any = None) -> EnvState:
        """Return the state at the start of an episode from an angle [rad] and a velocity [rad/s].

        A scene with gusts, noise or drawn delays needs a key, ``rng``.
        """
        if self._draws and rng is None:
            raise SceneError("The start of an episode with gusts, noise or drawn delays takes a key, as in "
                             "started(angle, velocity, rng=jax.random.key(0)).")
        form = jnp.broadcast_shapes(jnp.shape(angle), jnp.shape(velocity))
        uniform = jax.random.uniform(rng, (self._draws, *form), self.kind) if self._draws else None
        return self._begun(angle, velocity, own, own or self._of(None, params), uniform)

    def _begun(self, angle: Any, velocity: Any, own: EnvParams | None, used: EnvParams, uniform: Any) -> EnvState:
        """Return the state at the start of an episode from random numbers in [0, 1) along a first axis."""
        names = self.twin.program.shape.drawn
        stream = {name: random.started(uniform[i]) for i, name in enumerate(names)}
        values = self.twin.start(angle, velocity, used.numbers, stream, self.kind)
        rest = uniform[len(names):] if self._draws else None
        sensed = None if self._sensing is None else self._sensing.begin(self.twin.motion(values), rest)
        return EnvState(values, jnp.zeros_like(values[1]), jnp.zeros(values[1].shape, jnp.int32), own, sensed,
                        jnp.zeros_like(values[1]) if self._acts else None)

    def transition(self, state: EnvState, action: Any, rng: Any = None, params: EnvParams | None = None) -> EnvState:
        """Return the state after one control step of a constant action, which is clipped to [-1, 1].

        A sensor that draws random numbers, and noise of actions, need a key, ``rng``.
        """
        used, share = self._of(state, params), self._share(action)
        carry, sensed = (state.values, state.stop), state.sensed
        if self.noisy and rng is None:
            raise SceneError("A control step with random numbers, of a sensor or of the action, takes a key, as in "
                             "transition(state, action, jax.random.key(0)).")
        acted = state.acted
        if self._acts:
            rng, own = jax.random.split(rng)
            acted = share = self._acted(share, state.stop.shape, own)
        if self._sensing is None:
            values, stop = self._advanced(carry, used, share, self.substeps)
        else:
            (values, stop), sensed = self._sensing.step(
                carry, sensed, share, rng, lambda carry, share, steps: self._advanced(carry, used, share, steps),
                lambda carry: self.twin.motion(carry[0]))
            share = self._sensing.acting(sensed, share, self._sensing.last)
        _, lost = self._judged(state, values, share, used)
        stop = jnp.where((stop == 0.0) & lost, FELL, stop)
        return replace(state, values=values, stop=stop, time=state.time + 1, sensed=sensed, acted=acted)

    def observation(self, state: EnvState, rng: Any = None, params: EnvParams | None = None) -> Any:
        """Return cosine and sine of the angle and the velocity, float32; with a reference four more entries.

        Other kinds of ``observation`` have entries of their own, as in ``gym.make``.
        """
        if self._sensing is not None and self._sensing.reads:
            entries, _ = self._sensing.give(state.sensed)
        else:
            seen = self._reports(state.values, self._of(state, params))
            entries = [seen["cosine"], seen["sine"], seen["rate"]]
        if self._bounded:
            entries = [*entries[:2], jnp.clip(entries[2], -self._bound, self._bound), *entries[3:]]
        if self.task.goal.upright:
            turned = len(entries) // 2 * 2
            entries = [*(-entry for entry in entries[:turned]), *entries[turned:]]
        if self.task.goal.reference is not None:
            entries += self._judge.call("ahead", state.values[0], self.h, self.dt)
        return jnp.stack([jnp.asarray(entry, jnp.float32) for entry in entries], axis=-1)

    def reward(self, state: EnvState, action: Any, next_state: EnvState, rng: Any = None,
               params: EnvParams | None = None) -> Any:
        """Return the task's reward of the control step from a state to the next, for the action that acts.

        With ``reward_rate`` it is a rate per second, times ``dt``. ``speed_penalty`` is subtracted where the episode
        ends in this step, unless because the task is lost.
        """
        share = next_state.acted if self._acts else self._share(action)
        if self._sensing is not None:
            share = self._sensing.acting(next_state.sensed, share, self._sensing.last)
        reward, _ = self._judged(state, next_state.values, share, self._of(state, params))
        if self._rate != 1.0:
            reward = reward * self._rate
        if self._penalty:
            ends = (state.stop == 0.0) & (next_state.stop != 0.0) & (next_state.stop != FELL)
            reward = jnp.where(ends, reward - self._penalty, reward)
        return reward

    def terminal(self, state: EnvState, rng: Any = None, params: EnvParams | None = None) -> Any:
        """Return True where the episode has ended before its time: speed limit, divergence, slack wire, lost task."""
        return state.stop != 0.0

    def state_info(self, state: EnvState, params: EnvParams | None = None) -> dict[str, Any]:
        """Return time, unwrapped angle, velocity and the reported quantities, such as the energy ledger [J].

        With a sensor, a delay or another kind of observation, ``observed_angle`` is the angle in the observation [rad].
        """
        seen = self._reports(state.values, self._of(state, params))
        info = {name: value for name, value in seen.items() if name in self.twin.program.shape.info}
        if self._sensing is not None:
            turned = self.twin.turned(state.values)
            info[OBSERVED] = self._sensing.give(state.sensed)[1] if self._sensing.reads else turned
        return info

    def truncated(self, state: EnvState, params: EnvParams | None = None) -> Any:
        """Return True where the time of the episode is up."""
        return state.time >= self._of(state, params).max_steps_in_episode

    def gymnax(self, split: bool = False) -> Gymnax:
        """Return an adapter with gymnax's interface: ``reset(key, params)``, ``step(key, state, action, params)`` and
        the rest.

        ``split=True`` returns ``terminated, truncated`` in place of ``done``, as gymnax does from version 1.
        """
        return Gymnax(self, split)

    # --- parts ------------------------------------------------------------------------------------------------------

    @property
    def _draws(self) -> int:
        """Return the number of random numbers at the start of an episode beside those of angle and velocity."""
        return len(self.twin.program.shape.drawn) + (0 if self._sensing is None else self._sensing.draws)

    def _advanced(self, carry: Any, used: EnvParams, share: Any, steps: int) -> Any:
        """Return state and stop code after integration steps of an action, the first of which may be a new one."""
        shape = self.twin.program.shape
        plain = not shape.memory and not shape.remembered
        carry = self.twin.step(carry, used.numbers, share, self.h, used.speed_limit, known=plain)
        if steps > 1:
            def turn(_: Any, carry: Any) -> Any:
                return self.twin.step(carry, used.numbers, share, self.h, used.speed_limit, known=not shape.remembered)

            carry = jax.lax.fori_loop(1, steps, turn, carry)
        return carry

    def _share(self, action: Any) -> Any:
        action = jnp.asarray(action, self.kind)
        return jnp.clip(action[..., 0] if action.ndim and action.shape[-1] == 1 else action, -1.0, 1.0)

    def _acted(self, share: Any, shape: tuple[int, ...], key: Any) -> Any:
        """Return the actions that settings such as ``action_noise`` make of others, with random numbers of a key."""
        for place, (function, value) in enumerate(self._acts):
            first, second = jax.random.uniform(jax.random.fold_in(key, place), (2, *shape), self.kind)
            share = jnp.clip(on_arrays(function)(jnp.broadcast_to(share, shape), value, first, second), -1.0, 1.0)
        return share

    def _reports(self, values: Any, used: EnvParams) -> dict[str, Any]:
        """Return the observation and the entries of ``info`` of a state of the program, by name."""
        reports: dict[str, Any]
        _, _, reports = self.twin.run(values, used.numbers, 0.0, self.h, steps=0, report=True)
        return reports

    def _judged(self, state: EnvState, values: Any, share: Any, used: EnvParams) -> Any:
        """Return reward and loss of a control step that led to a state of the program."""
        phi, before = self._reports(values, used)["phi"], dict[str, Any]()
        if names := self.task.goal.before:
            before = earlier(names, self._reports(state.values, used)["phi"], *self.twin.motion(state.values))
        reward, lost = self._judge.call("judge", values[0], *self.twin.motion(values), phi, share, used.omega0, self.h,
                                        *before.values())
        shape = jnp.shape(values[0])
        return jnp.broadcast_to(jnp.asarray(reward, self.kind), shape), jnp.broadcast_to(jnp.asarray(lost, bool), shape)


documented(LabPendulum, arguments=described(TwinSettings, EpisodeSettings))


# --- random parameters ------------------------------------------------------------------------------------------------


def drawn(part: Range | Joint | Function, uniform: Any, key: Any) -> dict[str, Any]:
    """Return the parameters of an episode by name, drawn from a part of a randomisation.

    A fit gives a row of its bootstrap or posterior, or a draw from its covariance; those below a bound are left out.

    Args:
        part: parameters that are drawn together.
        uniform: a random number in [0, 1).
        key: a key, where one number is not enough.

    Raises SceneError for a function of a NumPy generator.
    """
    if isinstance(part, Function):
        raise SceneError("A function of a NumPy generator as randomize has no twin in JAX, which cannot trace it; give "
                         "ranges or a fit, or call the function and pass get_default_params(...) of its values.")
    array = partial(jnp.asarray, dtype=uniform.dtype)
    if isinstance(part, Range):
        return {part.name: array(part.values[0]) if part.fixed else part.at(uniform, jnp.exp, array)}
    if part.rows is not None:
        rows = array(part.rows[np.all(part.rows >= part.least, axis=1)])
        row = rows[(uniform * len(rows)).astype(int).clip(0, len(rows) - 1)]
    else:
        values, least, spread = map(array, (part.values, part.least, part.spread))

        def again(carry: Any) -> Any:
            key, own = jax.random.split(carry[0])
            return key, values + jax.random.normal(own, values.shape, values.dtype) @ spread

        none = jnp.full_like(values, jnp.nan)  # below any bound
        _, row = jax.lax.while_loop(lambda carry: ~jnp.all(carry[1] >= least), again, (key, none))
    return dict(zip(part.names, row, strict=True))
