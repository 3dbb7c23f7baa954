"""The class :class:`RunSpec`, the checked description of a run, and the warnings that are given before a run.

:func:`pendulum_env.rollout`, the environments, films and studies all describe their runs by a :class:`RunSpec`. To add
a keyword to all of them, add a field to :class:`pendulum_env.engine.settings.CommonSettings`; to add a warning, add a
sentence to the function of :data:`BEFORE` with its subject.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from integrators import Method
from integrators.solving.equal import MOST_STEPS
from pendulum_env.common.checks import warn
from pendulum_env.engine import limits, starts
from pendulum_env.engine.batch import Batch
from pendulum_env.engine.certificate import CertifiedBatch, CertifiedMachine, CertifiedRuns
from pendulum_env.engine.each import Each
from pendulum_env.engine.goal import SPAN, Goal
from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.limits import Validity
from pendulum_env.engine.machine import VELOCITY, Machine, check_diagnostics, find_method
from pendulum_env.engine.random_streams import Streams
from pendulum_env.engine.runs import RecordSchedule, Runs
from pendulum_env.engine.settings import CommonSettings, RunSettings, SceneLike
from pendulum_env.engine.shape import DIVERGED, STOP_REASONS
from pendulum_env.physics.angles import SEE
from pendulum_env.physics.damping import Damping, build_scene
from pendulum_env.physics.effects import Effect
from pendulum_env.physics.flow import still_torque
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, boolean, number, other_units, whole_number

Array = NDArray[np.float64]
TURNS = 2
"""Number of turns above which an initial angle causes a warning that it may be in degrees."""
RESOLVED = 0.5
"""Largest advance of a drive's phase in one step without a warning [rad]."""
INEXACT = 0.01
"""Largest relative error of the torque of all losses in moving air without a warning."""
Choose = Callable[[Callable[[], Scene | Sequence[Scene]]], tuple[str | Method, int, bool]]
"""Function that gets the scenes by a call of its argument, and chooses the method and the substeps.

It returns both, and True if they were chosen by measured errors.
"""


@dataclass(frozen=True, kw_only=True)
class RunSpec(CommonSettings):
    """The checked description of a run, a batch of runs, or the runs of an environment.

    Create it with :meth:`of` for runs of a known length and with :meth:`of_episodes` for environments; both check all
    arguments.

    Attributes:
        scene: scene of the run, for a batch that of the first run.
        integrator: the method's name, as given or chosen.
        method: the integration method.
        h: the integrator's step [s].
        each: scenes and parameter values of many runs; None for a single run and for one environment.
        shape: shape of a batch; () for a single run.
        start: initial angles [rad] and velocities [rad/s], arrays of one shape; None for environments.
        plan: the steps to take and to record; None for environments.
        hold: number of steps per control step.
        control: constant fraction of the motor's torque, -1 to 1; not used by environments.
        diagnostics: names of the quantities computed beside the motion.
        estimate_error: True for an error estimate from a second run at half the step.
        speed_limit: |velocity| that ends a run [rad/s].
        backend, rtol, atol, even_steps, compensated: as in :func:`pendulum_env.rollout`.
        seeds: seeds of the random numbers, one per run.
        formulas: a warning about effects' formulas that do not hold at the run's speeds, "" if all do.
        measured: True if method and step were chosen by measured errors, as integrator="auto" does.
        others: further scenes that episodes of an environment may have.

    The settings of all runs, ``warn`` and ``careful``, are those of
    :class:`pendulum_env.engine.settings.CommonSettings`.
    """

    scene: Scene
    integrator: str
    method: Method
    h: float
    each: Each | None = None
    shape: tuple[int, ...] = ()
    start: tuple[Array, Array] | None = None
    plan: RecordSchedule | None = None
    hold: int = 1
    control: float = 0.0
    diagnostics: tuple[str, ...] = ("energy",)
    estimate_error: bool = False
    speed_limit: float = math.inf
    backend: Backend = "auto"
    rtol: float | None = None
    atol: float | None = None
    even_steps: bool = False
    compensated: bool = False
    seeds: Sequence[int] = (0,)
    formulas: str = ""
    measured: bool = False
    others: tuple[Scene, ...] = ()

    # --- checks -----------------------------------------------------------------------------------------------------

    @classmethod
    def of(
        cls,
        scene: SceneLike = "lab",
        integrator: str | Method = "rk4",
        damping: Damping = "scene",
        parameters: Mapping[str, Any] | None = None,
        *,
        angle: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        duration: float | None = None,
        dt: float | None = None,
        every: int = 1,
        control: float = 0.0,
        diagnostics: Sequence[str] = ("energy",),
        speed_limit: float = math.inf,
        backend: Backend = "auto",
        rtol: float | None = None,
        atol: float | None = None,
        even_steps: bool = False,
        compensated: bool = False,
        estimate_error: bool = False,
        substeps: int = 1,
        seed: int = 0,
        **more: Any,
    ) -> RunSpec:
        """Return the checked description of a run, or of a batch of runs, of a known length.

        The keywords are those of :func:`pendulum_env.rollout`; ``parameters`` holds the scene's parameters and the
        shared keywords.

        Raises SceneError or MethodError for invalid arguments.
        """
        given, own = parted({**(parameters or {}), **more})
        shape = starts.batch_shape(angle, velocity, given)
        flat = {name: starts.flat(value, name, shape) for name, value in given.items()}
        share, size = starts.checked_control(control), math.prod(shape)
        initial = (starts.given_start(angle, "angle", "rad", shape),
                   starts.given_start(velocity, "velocity", "rad/s", shape))
        validity = Validity(size, "run", *initial, control=share != 0.0) if own["warn"] or own["careful"] else None
        each = Each(scene, damping, math.inf, flat, size, "run", validity) if shape else None
        built = each.scene if each else _looked_at(build_scene(scene, damping, flat), validity)
        usual = built.run
        h = number(usual.dt if dt is None else dt, "dt", above=0.0, unit="s")
        length = number(usual.duration if duration is None else duration, "duration", above=0.0, unit="s")
        steps, limit = starts.checked_steps(length, h), starts.checked_limit(speed_limit)
        start = starts.checked_start(built, usual.angle if angle is None else angle,
                                     usual.velocity if velocity is None else velocity)
        stride, hold = whole_number(every, "every"), whole_number(substeps, "substeps", MOST_STEPS)
        seeds = starts.checked_seeds(seed, size)
        names = check_diagnostics(diagnostics)
        estimated = boolean(estimate_error, "estimate_error") or "error" in names
        method = find_method(integrator, built)
        even_steps = boolean(even_steps, "even_steps")
        if even_steps and (shape or estimated):
            why = "is for single runs" if shape else "cannot be combined with an error estimate"
            raise SceneError(f"even_steps {why}; leave it out.")
        return cls(
            scene=built, integrator=method.name, method=method, h=h, each=each, shape=shape, start=start,
            plan=RecordSchedule(h, steps, min(stride, steps)), hold=hold, control=share,
            diagnostics=tuple(name for name in names if name != "error"), estimate_error=estimated, speed_limit=limit,
            backend=backend, rtol=rtol, atol=atol, even_steps=even_steps, compensated=compensated, seeds=seeds,
            formulas=validity.warning if validity else "", **own,
        )

    @classmethod
    def of_episodes(
        cls, given: RunSettings, *, dt: float, choose: Choose, size: int | None = None,
        others: Callable[[Scene], Sequence[Scene]] | None = None,
    ) -> RunSpec:
        """Return the checked description of the runs of an environment or, with ``size``, of a vector of environments.

        Args:
            given: settings of the environment; in a vector, the scene's parameters and speed_limit may also be
                sequences with one value per environment.
            dt: control step [s].
            choose: function that returns method and substeps for the scenes; it is called after the scenes were
                checked.
            size: number of environments in a vector.
            others: function that returns, for the scene of an environment, further scenes that its episodes may have.

        Raises SceneError or MethodError for invalid arguments.
        """
        validity = Validity(size or 1, "environment") if given.warn or given.careful else None
        names, parameters = tuple(given.diagnostics), given.parameters
        watched = not {"tension", "flow"}.isdisjoint(names)
        each = None if size is None else Each(given.scene, given.damping, given.speed_limit, parameters, size,
                                              validity=validity, watched=watched)
        built = each.scene if each else _looked_at(build_scene(given.scene, given.damping, parameters), validity)
        bases = each.corners() if each and others else [built]
        further = tuple(_looked_at(other, validity) for base in bases for other in others(base)) if others else ()
        if each:
            each.vary(further)
        limit = math.inf if each else starts.checked_limit(given.speed_limit, built)
        scenes = each.corners if each else lambda: built
        integrator, substeps, measured = choose((lambda: [*bases, *further]) if further else scenes)
        method = find_method(integrator, built)
        return cls(
            scene=built, integrator=integrator if isinstance(integrator, str) and measured else method.name,
            method=method, h=dt / substeps, each=each, hold=substeps, diagnostics=names,
            estimate_error="error" in names, speed_limit=limit, backend=given.backend, rtol=given.rtol,
            atol=given.atol, compensated=given.compensated, formulas=validity.warning if validity else "",
            measured=measured, others=further, warn=given.warn, careful=given.careful,
        )

    @classmethod
    def of_machine(cls, machine: Machine, **options: Any) -> RunSpec:
        """Return the checked description of a run with a machine's scene, method and settings.

        ``options`` are other keywords of :meth:`of`.
        """
        given: dict[str, Any] = {**machine.tolerance, "even_steps": machine.even_steps, **options}
        return cls.of(machine.scene, machine.method, backend=machine.backend, compensated=machine.compensated,
                      diagnostics=machine.diagnostics, substeps=machine.hold, **given)

    def with_method(self, method: Method) -> RunSpec:
        """Return a copy of this description with another method, without the mark ``measured`` of an automatic choice.
        """
        return replace(self, integrator=method.name, method=method, measured=False)

    def one(self, index: int) -> RunSpec:
        """Return the description of the single run with index ``index`` of a batch, without an error estimate."""
        assert self.each is not None
        return replace(self, scene=self.each.of(index), each=None, estimate_error=False)

    def alone(self, index: int) -> RunSpec:
        """Return the description of the single run with index ``index`` of a batch, as a run without warnings."""
        assert self.start is not None
        start = tuple(np.broadcast_to(values, self.shape).ravel()[index] for values in self.start)
        return replace(self.one(index), shape=(), start=start, seeds=(self.seeds[index],), warn=False, careful=False)

    # --- runners ----------------------------------------------------------------------------------------------------

    def machine(self) -> Machine:
        """Return a Machine for a single run.

        Raises MethodError for a tolerance or compensation that the method does not support.
        """
        kind = CertifiedMachine if self.estimate_error and self.plan is None else Machine
        return kind(self.scene, self.method, self.diagnostics, self.backend, self.rtol, self.atol, self.compensated,
                    self.hold, self.even_steps)

    def runs(self, num_threads: int | None = None) -> Runs:
        """Return the Runs (simulator of a batch) for runs of a known length."""
        assert self.each is not None
        assert self.plan is not None
        assert self.start is not None
        angle, velocity = (np.broadcast_to(values, self.shape).ravel() for values in self.start)
        self.each.numbers["speed_limit"] = self.speed_limit
        kind = CertifiedRuns if self.estimate_error else Runs
        return kind(
            self.each, self.method, self.diagnostics, self.backend, angle=angle, velocity=velocity, plan=self.plan,
            control=self.control, num_threads=num_threads, compensated=self.compensated, hold=self.hold,
            streams=Streams(self.seeds), rtol=self.rtol, atol=self.atol,
        )

    def batch(self, size: int, goal: Goal, most: float, num_threads: int | None = None) -> Batch:
        """Return the Batch that simulates ``size`` environments with episodes of at most ``most`` control steps."""
        assert self.each is not None
        kind = CertifiedBatch if self.estimate_error else Batch
        numbers = {**self.each.numbers, SPAN: self.h * self.hold}
        return kind(
            self.scene, self.method, self.diagnostics, self.backend, numbers, size=size, h=self.h,
            goal=goal, num_threads=num_threads, substeps=self.hold, most=most, compensated=self.compensated,
            rtol=self.rtol, atol=self.atol,
        )

    # --- warnings ---------------------------------------------------------------------------------------------------

    @property
    def numbers(self) -> Mapping[str, Any]:
        """Return the scene's parameters by name; in a batch, those that differ between runs are arrays."""
        return self.scene.coefficients if self.each is None else self.each.numbers

    def tell(self, sentences: Iterable[str] | None = None) -> None:
        """Emit every text in ``sentences`` as a warning, by default all that is known before a run, see :data:`BEFORE`.

        If the run has ``careful=True``, a SceneError with the first of these texts is raised instead.
        """
        if self.warn or self.careful:
            for sentence in chain.from_iterable(look(self) for look in BEFORE) if sentences is None else sentences:
                if self.careful:
                    raise SceneError(sentence)
                warn(sentence)

    def tell_of_start(self, angle: Any, velocity: Any) -> tuple[Array, Array]:
        """Return the checked initial angle [rad] and velocity [rad/s] of an episode.

        Warn if the angle is likely in degrees.
        """
        start = starts.checked_start(self.scene, angle, velocity)
        self.tell(far_away(start[0]))
        return start

    def tell_of_task(self, task: Any) -> None:
        """Warn if no task was chosen, and the usual one, swing_up, cannot be solved, as the scene has no motor."""
        idle = task is None and not any(effect.controlled for effect in self.scene.effects)
        if idle:
            self.tell([f"The scene '{self.scene.name}' has no motor, so that the usual task, swing_up, cannot be "
                       "solved; choose task='free', or a scene with a motor, such as 'lab'."])

    def turning_speed(self) -> float:
        """Return the |velocity| from which a step turns the rod too far [rad/s]; inf if no warning of it is wanted.

        No warning is wanted with tolerances, which divide such steps.
        """
        if not self.warn or self.rtol is not None:
            return math.inf
        return limits.turning_speed(self.method, self.scene, self.h)

    def tell_of_turns(self, speed: float) -> None:
        """Warn that a step turned the rod too far if ``speed``, the largest |velocity| [rad/s], was too high.

        Nothing more is said if a warning before the run said it, or said that the steps are too long to be stable.
        """
        if speed > self.turning_speed() and not any(long_steps(self)):
            warn(limits.turning_warning(self.scene, self.h, speed, f"the run has reached {speed:.3g} rad/s"))

    def tell_of_slack(self, slackened: float) -> None:
        """Warn that the wire went slack after ``slackened - 1`` steps; do nothing if ``slackened`` is 0."""
        if slackened:
            warn(f"The wire of the scene '{self.scene.name}' goes slack at {(slackened - 1.0) * self.h:g} s; the run "
                 "continues as if the bob hung on a rod, which can push, because slack='warn'.")

    def tell_of_stop(self, reason: str, state: Sequence[float], control: float | None = None) -> bool:
        """Warn if a run stopped because the equation of an implicit step was not solved or a tolerance not met.

        Return True if there was such a warning. See :func:`limits.warn_of_stop`.
        """
        share = self.control if control is None else control
        return self.warn and limits.warn_of_stop(self.method, self.scene, reason, self.h, state, share)

    def tell_of_stops(
        self, reasons: Iterable[tuple[int, str]], state_of: Callable[[int], Sequence[float]],
        control_of: Callable[[int], float] | None = None,
    ) -> bool:
        """Warn if a run of a batch stopped because an implicit equation was not solved or a tolerance not met.

        Return True if there was such a warning. ``reasons`` are pairs of a run's index and its stop reason;
        ``state_of`` and ``control_of`` return the last state and the control of the run with an index. See
        :func:`limits.warn_of_stops`.
        """
        assert self.each is not None
        return self.warn and limits.warn_of_stops(self.method, reasons, self.h, self.each.of, state_of,
                                                  control_of or (lambda _: self.control))

    def tell_end(self, machine: Machine, states: Array, state: Sequence[float], reason: str) -> None:
        """Emit the warnings that are known at the end of a run.

        They are those of a step that failed, of steps that turned the rod too far, and of a wire that went slack.
        ``states`` are the recorded states of the run, ``state`` is the last one with all its entries.
        """
        if reason:
            self.tell_of_stop(reason, state)
        if reason != STOP_REASONS[DIVERGED]:
            self.tell_of_turns(float(np.max(np.abs(states[:, VELOCITY]))))
        if "slackened" in machine.kept:
            self.tell_of_slack(float(state[machine.kept["slackened"]]))


def _looked_at(scene: Scene, validity: Validity | None) -> Scene:
    """Return a scene whose formulas were checked for one run, if there is a check."""
    if validity:
        validity.look(scene, (0,))
    return scene


def parted(parameters: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Separate keyword arguments into a scene's parameters and the keywords that all runs share, such as ``warn``.

    The shared keywords are checked and complete, with defaults where they are missing.
    """
    names = [entry.name for entry in fields(CommonSettings)]
    own = CommonSettings(**{name: parameters[name] for name in names if name in parameters})
    return {name: value for name, value in parameters.items() if name not in names}, vars(own)


def scene_and_shared(scene: SceneLike, damping: Damping, parameters: Mapping[str, Any]) -> tuple[Scene, dict[str, Any]]:
    """Return the scene with its parameters set, and the keywords that all runs share, such as ``warn``.

    Both are taken from ``parameters``; ``damping`` is applied to the scene first.
    """
    given, own = parted(parameters)
    return build_scene(scene, damping, given), own


# --- warnings before a run --------------------------------------------------------------------------------------------


def far_away(angle: Array) -> Iterator[str]:
    """Yield a warning if an initial angle [rad] is likely in degrees.

    That is so if it is more than two turns from the bottom, or if all angles are round numbers beyond the top, as 5.0
    and 7.5 are. Angles that are a whole number of degrees were converted; they are only said to be far away.
    """
    far = float(angle.flat[np.argmax(np.abs(angle))])
    turns, degrees = abs(far) / math.tau, math.degrees(far)
    beyond = bool(np.all((np.abs(angle) > math.pi) & (angle * 2.0 == np.round(angle * 2.0))))
    if turns > TURNS and abs(degrees - round(degrees)) < 1e-12 * abs(degrees):
        yield f"An initial angle of {degrees:.10g} degrees is {turns:.3g} turns from the bottom."
    elif turns > TURNS or beyond:
        yield (f"Angles are in radians: an initial angle of {far:g} rad is {turns:.3g} turns from the bottom; {far:g} "
               f"degrees would be {math.radians(far):.4g} rad; {SEE}.")


def strange_numbers(spec: RunSpec) -> Iterator[str]:
    """Yield a warning for every number that is likely in other units, or that does nothing.

    These are an initial angle in degrees, sizes of the bob and gravity in centimetres, millimetres or grams, and a
    control in a scene without a motor.
    """
    scene = spec.scene
    if spec.start is not None:
        yield from far_away(spec.start[0])
    yield from other_units(scene.body, scene.gravity)
    if spec.control and not any(effect.controlled for effect in scene.effects):
        yield (f"The scene '{scene.name}' has no motor, so that control={spec.control:g} does nothing; leave it "
               "out, or add a motor, as in the scene 'lab'.")


def doubtful_formulas(spec: RunSpec) -> Iterator[str]:
    """Yield a warning if a formula of an effect does not hold at the speeds of the run, or not in moving air.

    The latter is said if a formula for still air makes the torque of all losses wrong by over INEXACT.
    """
    if spec.formulas:
        yield spec.formulas
    scene = spec.scene
    loose = [effect for effect in scene.effects if type(effect).understated is not Effect.understated]
    moved = [name for name in ("wind_rate", "gust_size", "vertical_sway", "horizontal_sway") if name in spec.numbers]
    slip = sum(float(np.max(np.abs(spec.numbers[name]))) for name in moved)
    total = sum(still_torque(effect, scene.coefficients, 0.0, slip) for effect in scene.of_kind("dissipative"))
    for effect in loose if slip else ():
        factor = effect.understated(scene, slip)
        share = 1.0 + (factor - 1.0) * still_torque(effect, scene.coefficients, 0.0, slip) / total
        if share > 1.0 + INEXACT:
            yield (f"In the scene '{scene.name}', {effect.name} assumes that the air's speed grows from 0 at the pivot "
                   f"to its value at the bob. On a pendulum at rest in air of {slip * scene.body.reach:.3g} m/s, the "
                   f"true torque of {effect.name} is {factor:.3g} times that of the formula, and the true torque of "
                   f"all losses together {share:.3g} times.")


def long_steps(spec: RunSpec) -> Iterator[str]:
    """Yield warnings if the steps are too long for the method to be stable, or turn the rod too far; see :mod:`limits`.
    """
    if spec.rtol is None and not spec.measured:
        largest = [] if spec.start is None else [float(np.max(np.abs(values))) for values in spec.start]
        scenes = (spec.scene,) if spec.each is None else spec.each.swiftest()
        yield from limits.too_long(spec.method, (*scenes, *spec.others), spec.h, *largest)


def coarse_steps(spec: RunSpec) -> Iterator[str]:
    """Yield warnings of steps that do not resolve a drive, and of control steps too short for a multistep method.

    A step advances the phase of a drive by at most 0.5 rad (RESOLVED) without a warning. The method starts anew after
    every change of control.
    """
    for effect in spec.scene.effects if spec.rtol is None and not spec.measured else ():
        phase = spec.h * float(np.max(np.abs(spec.numbers[effect.beat]))) if effect.beat else 0.0
        if phase > RESOLVED:
            yield (
                f"A step of {spec.h:g} s covers {phase:.2g} rad of the phase of {effect.name}, too much to resolve its "
                f"motion; take steps of {starts.at_most(spec.h * RESOLVED / phase)} s or less "
                f"({math.ceil(phase / RESOLVED)} times as many substeps)."
            )
    method = spec.method
    if spec.plan is None and method.begun_by and spec.hold < starts.fewest_substeps(method, spec.scene):
        yield (
            f"{method.name} restarts at every change of control, by {method.past} step{'s' * (method.past > 1)} of "
            f"{method.begun_by.name} {'forwards' if method.forwards else 'backwards'} in time, but a control step has "
            f"only {spec.hold} substep{'s' * (spec.hold > 1)}; take substeps={starts.ENOUGH * method.past} or more, or "
            "a one-step method."
        )


BEFORE: tuple[Callable[[RunSpec], Iterator[str]], ...] = (strange_numbers, doubtful_formulas, long_steps, coarse_steps)
"""All warnings before a run: functions of a RunSpec that yield sentences, one function for each subject."""
