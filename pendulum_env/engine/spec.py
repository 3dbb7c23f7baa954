"""The description of a run: checked in one place, warned of in one place, made ready in one place.

:func:`pendulum_env.rollout`, the environments, films and studies all describe their runs by a :class:`RunSpec`. A new
keyword that all of them take is a field with :func:`shared`, and a new warning is a function in :data:`BEFORE`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import Field, dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from integrators import Method
from integrators.solving.solve import MOST_STEPS
from pendulum_env.common.warn import warn
from pendulum_env.engine import limits, starts
from pendulum_env.engine.batch import Batch
from pendulum_env.engine.certified import CertifiedBatch, CertifiedMachine, CertifiedRuns, checked_estimate
from pendulum_env.engine.each import Each, checked_limit, limit_of
from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.machine import Machine, check_diagnostics, find_method
from pendulum_env.engine.runs import Plan, Runs
from pendulum_env.engine.streams import Streams
from pendulum_env.engine.validity import Validity
from pendulum_env.physics.damping import Damping, build_scene
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, number, truth, whole_number

Array = NDArray[np.float64]
TURNS = 2
"""Turns that a start may be away without a warning."""
RESOLVED = 0.5
"""Part of a drive's phase that a step may take [rad]."""
SceneLike = str | Scene | Mapping[str, object]
Choose = Callable[[Callable[[], Scene | Sequence[Scene]]], tuple[str | Method, int, bool]]
"""From the scenes, the method, the substeps, and whether both were chosen by measuring errors."""


def shared(default: Any, check: Callable[[Any], Any]) -> Any:
    """Return a field of RunSpec that every function with ``**parameters`` takes as a keyword, with its check."""
    return field(default=default, metadata={"shared": check})


@dataclass(frozen=True, kw_only=True)
class RunSpec:
    """What is to run: one or many pendulums of a scene with a method, and what is computed beside the motion.

    Made by :meth:`of` for runs of a known length and by :meth:`of_episodes` for environments, which check everything.

    Attributes:
        scene: of the run; of many, of the first.
        integrator: the method's name, as it was asked for or chosen.
        method: the method.
        h: the integrator's step [s].
        each: scenes and numbers of many runs, None for one environment.
        shape: of a batch of runs; () for one.
        start: angles [rad] and velocities [rad/s], arrays of one shape; None where each episode has its own.
        plan: how many steps are taken and which are recorded; None where an environment is stepped.
        hold: steps in a control step.
        control: constant share of the motor's torque; an environment's changes with each control step.
        diagnostics: what is computed beside the motion.
        estimate_error: True for a second run at half the step, which tells the error of the first.
        speed_limit: |velocity| that ends a run [rad/s].
        backend, rtol, atol, compensated: as in :func:`pendulum_env.rollout`.
        seeds: of what is drawn at random, one for each run.
        formulas: what is to be said of formulas that do not hold, "" if all do.
        measured: True where method and step were chosen by measuring their errors.
        warn: False for no warnings before the run, nor of why it stopped.
        careful: True for a SceneError in place of each warning before the run, so that a doubtful one does not start.
    """

    scene: Scene
    integrator: str
    method: Method
    h: float
    each: Each | None = None
    shape: tuple[int, ...] = ()
    start: tuple[Array, Array] | None = None
    plan: Plan | None = None
    hold: int = 1
    control: float = 0.0
    diagnostics: tuple[str, ...] = ("energy",)
    estimate_error: bool = False
    speed_limit: float = math.inf
    backend: Backend = "auto"
    rtol: float | None = None
    atol: float | None = None
    compensated: bool = False
    seeds: Sequence[int] = (0,)
    formulas: str = ""
    measured: bool = False
    warn: bool = shared(True, lambda value: truth(value, "warn"))
    careful: bool = shared(False, lambda value: truth(value, "careful"))

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
        compensated: bool = False,
        estimate_error: bool = False,
        substeps: int = 1,
        seed: int = 0,
        **more: Any,
    ) -> RunSpec:
        """Return the description of a run, or of a batch of them, of a known length.

        Keywords are those of :func:`pendulum_env.rollout`; ``parameters`` are of the scene and shared keywords.

        Raises SceneError or MethodError for anything that cannot be.
        """
        given, own = parted({**(parameters or {}), **more})
        shape = starts.batch_shape(angle, velocity, given)
        flat = {name: starts.flat(value, name, shape) for name, value in given.items()}
        share, size = starts.checked_control(control), math.prod(shape)
        begun = (starts.given_start(angle, "angle", "rad", shape),
                 starts.given_start(velocity, "velocity", "rad/s", shape))
        validity = Validity(size, "run", *begun, control=share != 0.0)
        each = Each(scene, damping, math.inf, flat, size, "run", validity if own["warn"] or own["careful"] else None)
        place, usual = each.scene, each.scene.run
        h = number(usual.dt if dt is None else dt, "dt", above=0.0, unit="s")
        length = number(usual.duration if duration is None else duration, "duration", above=0.0, unit="s")
        steps, limit = starts.checked_steps(length, h), limit_of(speed_limit)
        start = starts.checked_start(place, usual.angle if angle is None else angle,
                                     usual.velocity if velocity is None else velocity)
        kept, hold = whole_number(every, "every"), whole_number(substeps, "substeps", MOST_STEPS)
        seeds = starts.checked_seeds(seed, size)
        asked, estimated = checked_estimate(diagnostics, estimate_error)
        method = find_method(integrator, place)
        return cls(
            scene=place, integrator=method.name, method=method, h=h, each=each, shape=shape, start=start,
            plan=Plan(h, steps, min(kept, steps)), hold=hold, control=share, diagnostics=asked,
            estimate_error=estimated, speed_limit=limit, backend=backend, rtol=rtol, atol=atol,
            compensated=compensated, seeds=seeds, formulas=validity.said, **own,
        )

    @classmethod
    def of_episodes(
        cls,
        scene: SceneLike,
        damping: Damping,
        parameters: Mapping[str, Any],
        *,
        dt: float,
        choose: Choose,
        size: int | None = None,
        diagnostics: Sequence[str] = ("energy",),
        speed_limit: Any = None,
        backend: Backend = "auto",
        rtol: float | None = None,
        atol: float | None = None,
        compensated: bool = False,
    ) -> RunSpec:
        """Return the description of an environment's runs or, with ``size``, of those of a vector of environments.

        Args:
            scene, damping, parameters, speed_limit: as in gym.make; of a vector also one for each environment.
            dt: control step [s].
            choose: returns method and substeps, from the scenes of the environments; called when these are checked.
            size: number of environments in a vector.
            diagnostics, backend, rtol, atol, compensated: as in gym.make.

        Raises SceneError or MethodError for anything that cannot be.
        """
        given, own = parted(parameters)
        validity = Validity() if size is None else Validity(size, "environment")
        wanted = own["warn"] or own["careful"]
        each, place = None, None
        if size is None:
            place = build_scene(scene, damping, given)
            if wanted:
                validity.look(place, (0,))
            limit = checked_limit(speed_limit, place)
        else:
            each = Each(scene, damping, speed_limit, given, size, validity=validity if wanted else None)
            place, limit = each.scene, math.inf
        integrator, substeps, measured = choose(each.corners if each else lambda: place)
        method, asked = find_method(integrator, place), check_diagnostics(diagnostics)
        return cls(
            scene=place, integrator=integrator if isinstance(integrator, str) and measured else method.name,
            method=method, h=dt / substeps, each=each, hold=substeps, diagnostics=asked,
            estimate_error="error" in asked, speed_limit=limit, backend=backend, rtol=rtol, atol=atol,
            compensated=compensated, formulas=validity.said, measured=measured, **own,
        )

    @classmethod
    def of_machine(cls, machine: Machine, **asked: Any) -> RunSpec:
        """Return the description of a run of a machine; ``asked`` are the other keywords of :meth:`of`."""
        given: dict[str, Any] = {**machine.tolerance, **asked}
        return cls.of(machine.scene, machine.method, backend=machine.backend, compensated=machine.compensated,
                      diagnostics=machine.diagnostics, substeps=machine.hold, **given)

    def with_method(self, method: Method) -> RunSpec:
        """Return the description of the same run by another method, of which nothing was measured."""
        return replace(self, integrator=method.name, method=method, measured=False)

    def one(self, place: int) -> RunSpec:
        """Return the description of the run at one place of many, without an estimate of its error."""
        assert self.each is not None
        return replace(self, scene=self.each.of(place), each=None, estimate_error=False)

    # --- what runs it -----------------------------------------------------------------------------------------------

    def machine(self) -> Machine:
        """Return what runs one pendulum; MethodError for a tolerance or compensation that the method does not have."""
        kind = CertifiedMachine if self.estimate_error and self.plan is None else Machine
        return kind(self.scene, self.method, self.diagnostics, self.backend, self.rtol, self.atol, self.compensated,
                    self.hold)

    def runs(self, num_threads: int | None = None) -> Runs:
        """Return what runs a batch of a known length."""
        assert self.each is not None
        assert self.plan is not None
        assert self.start is not None
        angle, velocity = (np.broadcast_to(values, self.shape).ravel() for values in self.start)
        self.each.numbers["speed_limit"] = self.speed_limit
        kind = CertifiedRuns if self.estimate_error else Runs
        return kind(
            self.each, self.method, self.diagnostics, self.backend, angle=angle, velocity=velocity, plan=self.plan,
            control=self.control, num_threads=num_threads, compensated=self.compensated, hold=self.hold,
            streams=Streams(self.seeds),
        )

    def batch(self, size: int, task: Any, most: float, num_threads: int | None = None) -> Batch:
        """Return what steps a vector of ``size`` environments, each for at most so many control steps."""
        assert self.each is not None
        kind = CertifiedBatch if self.estimate_error else Batch
        return kind(
            self.scene, self.method, self.diagnostics, self.backend, self.each.numbers, size=size, h=self.h,
            task=task, num_threads=num_threads, substeps=self.hold, most=most, compensated=self.compensated,
        )

    # --- warnings ---------------------------------------------------------------------------------------------------

    @property
    def numbers(self) -> Mapping[str, Any]:
        """Numbers of the scene or, of many, arrays of those that differ."""
        return self.scene.coefficients if self.each is None else self.each.numbers

    def tell(self, looks: Iterable[Callable[[RunSpec], Iterator[str]]] | None = None) -> None:
        """Warn before a run of what is likely not meant, and what to do about it; see :data:`BEFORE`.

        Raises SceneError instead if it is to be ``careful``.
        """
        if self.warn or self.careful:
            for look in BEFORE if looks is None else looks:
                self._say(look(self))

    def _say(self, sentences: Iterable[str]) -> None:
        for said in sentences:
            if self.careful:
                raise SceneError(said)
            warn(said)

    def tell_of_start(self, angle: Any, velocity: Any) -> tuple[Array, Array]:
        """Return a checked start of an episode, arrays [rad] and [rad/s]; warn of one in degrees."""
        start = starts.checked_start(self.scene, angle, velocity)
        if self.warn or self.careful:
            self._say(far_away(start[0]))
        return start

    def tell_of_slack(self, steps: float) -> None:
        """Warn that a wire has to push since so many steps; nothing for 0."""
        if steps:
            warn(f"The wire of the scene '{self.scene.name}' goes slack at {steps * self.h:g} s and would have to "
                 "push; the run goes on as with a rod, because slack='warn'.")

    def tell_of_stop(self, reason: str, state: Sequence[float], control: float | None = None) -> bool:
        """Warn, and return True, where a run stopped because no step was found; see :func:`limits.warn_of_stop`."""
        share = self.control if control is None else control
        return self.warn and limits.warn_of_stop(self.method, self.scene, reason, self.h, state, share)

    def tell_of_stops(
        self, reasons: Iterable[tuple[int, str]], state_of: Callable[[int], Sequence[float]],
        control_of: Callable[[int], float] | None = None,
    ) -> bool:
        """Do the same for many: the places and reasons of those that stopped, and what is known of each."""
        assert self.each is not None
        return self.warn and limits.warn_of_stops(self.method, reasons, self.h, self.each.of, state_of,
                                                  control_of or (lambda _: self.control))

    def tell_end(self, machine: Machine, state: Sequence[float], reason: str) -> None:
        """Warn after a run, with the state at its end, of why it stopped and of a wire that had to push."""
        if reason:
            self.tell_of_stop(reason, state)
        self.tell_of_slack(int(state[machine.kept["slackened"]]) if "slackened" in machine.kept else 0)


SHARED: Mapping[str, Field[Any]] = {entry.name: entry for entry in fields(RunSpec) if "shared" in entry.metadata}
"""Keywords that every function with ``**parameters`` takes beside the scene's parameters."""


def parted(parameters: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the scene's parameters, and the shared keywords among them, checked and with their defaults."""
    own = {name: entry.metadata["shared"](parameters.get(name, entry.default)) for name, entry in SHARED.items()}
    return {name: value for name, value in parameters.items() if name not in SHARED}, own


def scene_and_shared(scene: SceneLike, damping: Damping, parameters: Mapping[str, Any]) -> tuple[Scene, dict[str, Any]]:
    """Return the scene with these parameters, and the shared keywords among them."""
    given, own = parted(parameters)
    return build_scene(scene, damping, given), own


# --- what is to be said before a run ----------------------------------------------------------------------------------


def far_away(angle: Array) -> Iterator[str]:
    """The furthest of these angles [rad] is more than TURNS turns away."""
    if np.abs(angle).max() > TURNS * math.tau:
        far = float(angle.flat[np.argmax(np.abs(angle))])
        yield (f"Angles are in radians: a start from {far:g} rad is {far / math.tau:.3g} turns away; {far:g} degrees "
               f"would be {math.radians(far):.4g} rad.")


def in_degrees(spec: RunSpec) -> Iterator[str]:
    """A start is so many turns away that it is likely in degrees."""
    if spec.start is not None:
        yield from far_away(spec.start[0])


def outside_formulas(spec: RunSpec) -> Iterator[str]:
    """A formula of an effect does not hold at the speed that the start leads to."""
    if spec.formulas:
        yield spec.formulas


def long_steps(spec: RunSpec) -> Iterator[str]:
    """Steps are too long for the method to be stable."""
    if spec.rtol is None and not spec.measured:
        given = [] if spec.start is None else [float(np.max(np.abs(values))) for values in spec.start]
        scenes = (spec.scene,) if spec.each is None else spec.each.swiftest()
        yield from limits.too_long(spec.method, scenes, spec.h, *given)


def long_for_drives(spec: RunSpec) -> Iterator[str]:
    """Steps are too long for the frequency of a drive: they take more than RESOLVED of its phase each."""
    if spec.rtol is not None or spec.measured:
        return
    for effect in spec.scene.effects:
        phase = spec.h * float(np.max(np.abs(spec.numbers[effect.beat]))) if effect.beat else 0.0
        if phase > RESOLVED:
            yield (
                f"A step of {spec.h:g} s takes {phase:.2g} rad of the phase of {effect.name}; its motion needs steps "
                f"of {starts.at_most(spec.h * RESOLVED / phase)} s or less, as by {math.ceil(phase / RESOLVED)} times "
                "as many substeps."
            )


def restarts(spec: RunSpec) -> Iterator[str]:
    """A method with a memory begins anew so often, at each control step, that it is hardly itself."""
    method = spec.method
    if spec.plan is None and method.begun_by and spec.hold < starts.fewest_substeps(method, spec.scene):
        yield (
            f"{method.name} restarts at every change of control with {method.past} step{'s' * (method.past > 1)} of "
            f"{method.begun_by.name} {'forwards' if method.forwards else 'backwards'}, and a control step has "
            f"{spec.hold}: take substeps={starts.ENOUGH * method.past} or more, or a one-step method."
        )


def unused_control(spec: RunSpec) -> Iterator[str]:
    """A control is given and there is no motor that takes it."""
    if spec.control and not any(effect.controlled for effect in spec.scene.effects):
        yield (f"The scene '{spec.scene.name}' has no motor, so that control={spec.control:g} does nothing; leave it "
               "out, or add a motor, as in the scene 'lab'.")


OF_METHOD = (restarts, long_steps)
"""Of the sentences before a run, those that depend on the method."""
BEFORE: tuple[Callable[[RunSpec], Iterator[str]], ...] = (
    in_degrees, outside_formulas, long_steps, long_for_drives, restarts, unused_control)
"""All that is looked at before a run: each yields sentences to warn with."""
