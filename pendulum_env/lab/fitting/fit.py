"""Fit the parameters of a scene to a recording, with one damping model or several for comparison."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from inspect import signature
from os import PathLike
from typing import Any, NamedTuple

import numpy as np

from pendulum_env.common.checks import warn
from pendulum_env.common.progress import Progress, telling_of
from pendulum_env.lab.checked import Drop, side
from pendulum_env.lab.fitting.candidates import AUTO, Names, models_of, program
from pendulum_env.lab.fitting.grade import EXCESS, as_fault, of_swings
from pendulum_env.lab.fitting.model import GRAVITY, LENGTH, SCALE, Model
from pendulum_env.lab.fitting.priors import priors_of
from pendulum_env.lab.fitting.remedies import JUMP, OUTLIERS, SUBTRACTED, Remedy, remedies_of, repaired
from pendulum_env.lab.fitting.result import Fit, FitComparison
from pendulum_env.lab.fitting.shooting import FitSolution, calmed, pulled, released, solve_all
from pendulum_env.lab.fitting.start import Measured
from pendulum_env.lab.measures import doubt_of_length
from pendulum_env.lab.noise import scatter_level
from pendulum_env.lab.recording import Recording, RecordingError, part_of
from pendulum_env.lab.sheet import apparatus
from pendulum_env.physics.body import Body
from pendulum_env.physics.damping import NONE, with_damping
from pendulum_env.physics.effects import DAMPINGS
from pendulum_env.physics.flow import swing_loss
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, boolean, naming_keywords, nearest, other_units, several, shown

BOB = ("radius", "mass")
"""Parameters that must be given for the drag on the bob to be known, in a known medium."""
MOST_JUMPS = 4
"""Largest number of fits, after each of which but the last a jump of the zero may be subtracted."""
HALF = 0.5
"""Share of the residuals that a jump may leave at most, unless it leaves only noise."""
LEAST_REST = 1e-3
"""Shortest rest at the end of a recording, as a share of its duration, that is left out of the fit."""


def fit(
    recording: Recording,
    effects: str | Sequence[str] = AUTO,
    *,
    scene: str | Scene | Mapping[str, object] | PathLike[str] | None = None,
    free: Sequence[str] | None = None,
    until: float | None = None,
    above: float | str | None = None,
    drop: Drop | None = None,
    robust: bool = False,
    jumps: bool = True,
    progress: Progress | bool | None = None,
    **parameters: Any,
) -> Fit:
    """Fit the parameters of a scene to a recording, by least squares of the whole trajectory.

    The model is ``angle_i = zero + scale theta(t_i)``, for a gyroscope ``rate_i = zero + scale theta'(t_i)``, and for
    an accelerometer ``force_i = zero + scale force(t_i)``, with the bias as zero. Fitted are the start, the sensor's
    zero, the parameters in ``free``, those of the dampings, and an accelerometer's distance from the pivot and tilt.
    With several models, the best by the Bayesian information criterion is returned, and its ``comparison`` lists all of
    them.

    Args:
        recording: the recording as read. It is cut at the release, and one period after the readings have stopped to
            change, because equal readings of a bob at rest give no new information.
        effects: "auto" for all sums of dampings that a recording can tell apart, and also for drag C_d(Re) if radius
            and mass, or a scene, are given; one model, with dampings joined by "+" as in ``damping=``; or a list of
            models to compare.
        scene: the pendulum and its surroundings, without the scene's own damping; by default a pendulum in air with
            the given ``parameters``.
        free: parameters to fit besides the start and the dampings: positive parameters of the scene, such as "length"
            or "gravity" (a recording determines only their ratio), and "scale", that of the sensor. By default the
            length, and the scale of a displacement; of other bodies than a bob or a rod, the measure of theirs that
            sets the period. The scale follows from the dependence of the period on the amplitude and needs swings of
            about 30 degrees or more. () for none.
        until: time of the recording [s] after which readings are left out.
        above: share of the first amplitude, such as 0.05 or "5%", below which swings are left out.
        drop: times of the recording [s] between which readings are left out: "12.5:13.1", (12.5, 13.1), or several.
        robust: True lets readings that are far off count less, by the soft L1 loss. Their weights follow from the model
            with the most dampings, after jumps are subtracted; see :mod:`pendulum_env.lab.fitting.shooting`.
        jumps: True subtracts jumps of the sensor's zero that explain a misfit and lower the Bayesian information
            criterion by 10 or more, with a note on each in the recording of the fit; False leaves them in.
        progress: True shows a progress bar, False none; by default a notebook shows one for work over 1.5 s. A
            function is called with the fraction done and the present activity.
        **parameters: known parameters of the scene, such as ``length=0.65, mass=0.0415``.

    The ``grade`` of a fit says whether the model follows the recording, which of its ``remedies`` would explain a
    misfit, and whether the fit is usable. Warns with the grade's verdict if the best model does not follow all swings,
    or if swings grow or stay equal, which damping cannot cause; with the remedy if single angles are far off; if a
    fitted damping parameter depends on a mass that is not given; and if the length is neither given nor fitted. Raises
    RecordingError unless ``recording`` is a Recording of a free swing below half a turn, with at least three turning
    points and more readings than fitted parameters; SceneError for invalid names and values.
    """
    if not isinstance(recording, Recording):
        raise RecordingError(f"recording must be a Recording, for example from Recording.read, got {shown(recording)}")
    level = boolean(jumps, "jumps")
    place, names, wanted, steady = planned(recording, effects, scene, free, robust, parameters)
    for sentence in other_units(place.body, place.gravity):
        warn(sentence)
    recording = recording.kept(until=until, drop=drop)
    free_swing = released(recording, above) if steady else recording.released().kept(above=above)
    swing = free_swing if steady else _moving(free_swing)
    models = [_model(place, damping, swing, names) for damping in wanted]
    sigma = max(swing.reading_noise, 1e-12 * float(np.ptp(swing.readings)))
    with telling_of(progress, "fit") as telling:
        most = max(models, key=lambda model: len(model.numbers))
        calm, tried = (calmed(swing), [most]) if steady else (swing, models)  # jumps first, then readings are pulled
        subtracted: tuple[Remedy, ...] = ()
        for _ in range(MOST_JUMPS):
            measured = Measured.of(calm)
            solutions = solve_all(tried, calm, measured, sigma, telling)
            richest = max(solutions, key=lambda one: (not one.lost, len(one.values)))
            remedies = remedies_of(richest, calm, measured, sigma)
            if not level or swing.indirect or not _is_jump(remedies, calm, richest, sigma):
                break
            jump = replace(remedies[0], option=SUBTRACTED)
            subtracted += (jump,)
            calm, swing = (repaired(one, (jump,), jump.sentence) for one in (calm, swing))
        if steady:
            swing = pulled(swing, solutions[0])
            sigma, measured = max(swing.reading_noise, 1e-12 * float(np.ptp(swing.readings))), Measured.of(swing)
            solutions = solve_all(models, swing, measured, sigma, telling)
            remedies = tuple(one for one in remedies if one.name != OUTLIERS)
    rest = float(free_swing.time[-1] - swing.time[-1])
    damped = not place.medium.empty and any(wanted)
    points = Measured.of(repaired(swing, remedies)).points if remedies else measured.points
    found, left_out = side("the check of the swings' decay",
                           lambda: of_swings(points, math.tau / measured.period, damped))
    faults = tuple([as_fault(left_out)] if found is None else found)
    if any(fault.serious for fault in faults):  # a drive is no fault of the readings
        remedies = tuple(one for one in remedies if one.name in (JUMP, OUTLIERS))
    fits = [Fit(swing, solution, sigma, rest=rest, faults=faults, remedies=remedies, subtracted=subtracted)
            for solution in solutions]
    comparison = FitComparison.of(fits)
    best = comparison.fits[0]
    if faults or best.solution.lost:
        warn(best.grade.verdict)
    elif any(one.name == OUTLIERS for one in remedies) and not swing.indirect:
        warn(" ".join(best.grade.remedies))
    if scene is None and "mass" not in parameters:
        _warn_of_mass(best)
    if LENGTH in names and LENGTH not in parameters:
        for sentence in doubt_of_length(math.tau / best.scene.omega0, best.parameters[LENGTH].value):
            warn(sentence)
    if scene is None and LENGTH not in parameters and LENGTH not in names:
        warn(f"the length is taken to be {place.body.reach:g} m, as it is neither given nor fitted; give length=.")
    return replace(best, comparison=comparison) if len(fits) > 1 else best


def _is_jump(remedies: Sequence[Remedy], swing: Recording, solution: FitSolution, sigma: float) -> bool:
    """Return True if a jump alone explains a misfit: it leaves noise, or less than half of the residuals.

    In residuals that wander, steps explain a little, and must not be subtracted.
    """
    if not remedies or remedies[0].name != JUMP or any(one.instead for one in remedies):
        return False
    noise = max(scatter_level(swing.time, solution.residual), sigma)
    before = math.sqrt(float(np.mean(solution.residual**2)))
    return remedies[0].left < max(EXCESS * noise, HALF * before)


class FitPlan(NamedTuple):
    """What is fitted: the scene without damping, the free parameters, the models of damping, and whether robustly."""

    place: Scene
    free: tuple[str, ...]
    models: list[Names]
    steady: bool

    def check_priors(self, recording: Recording, priors: Mapping[str, Any]) -> None:
        """Raise SceneError for a prior that no model of the plan can have; see :func:`priors.priors_of`."""
        models = [_unchecked(self.place, damping, recording, self.free) for damping in self.models]
        most = max(models, key=lambda model: len(model.names))
        for key, entry in priors.items():
            able = (model for model in models
                    if key in model.names or key in (name.rpartition(".")[2] for name in model.names))
            priors_of(next(able, most), {key: entry})


def planned(
    recording: Recording, effects: str | Sequence[str], scene: Any, free: Sequence[str] | None, robust: bool,
    parameters: Mapping[str, Any],
) -> FitPlan:
    """Check the arguments of :func:`fit`, and return what it is to fit; nothing is computed yet.

    Raises the errors of :func:`fit` for invalid names and values.
    """
    with naming_keywords(fit):
        place = apparatus(scene, parameters)
    if not place.of_kind("conservative") or not place.omega0 > 0.0:
        raise SceneError(f"The scene '{place.name}' has no restoring force, so it cannot swing; add gravity.")
    known = scene is not None or all(name in parameters for name in BOB)
    usual = (place.body.fitted, *([SCALE] if recording.displaced else []))
    names = _checked(usual if free is None else free, place)
    steady = boolean(robust, "robust")
    wanted = models_of(effects, place, known)
    if not isinstance(place.body, Body) and all(_undetermined(place, damping, names) for damping in wanted):
        raise SceneError(f"free cannot have {' and '.join(name for name in names if name != SCALE)} together: a free "
                         f"swing of the body '{place.body.shape}' shows only a quotient of them, in its period; "
                         "measure all but one of them.")
    return FitPlan(place, names, wanted, steady)


def _moving(swing: Recording) -> Recording:
    """Return a free swing without the equal readings of a bob at rest at its end, except for one period of them."""
    changes = np.flatnonzero(swing.readings != swing.readings[-1])
    if not len(changes):
        return swing
    rest = float(swing.time[changes[-1]])
    if swing.time[-1] - rest <= (swing.time[-1] - swing.time[0]) * LEAST_REST:
        return swing
    keep = swing.time <= rest + Measured.of(swing).period
    if keep.all():
        return swing
    note = f"rest: from {rest:.4g} s on the reading does not change, {np.count_nonzero(~keep)} readings left out"
    return part_of(swing, keep, note)


def _checked(free: Sequence[str], place: Scene) -> tuple[str, ...]:
    """Return the names of the free parameters; SceneError unless they are positive parameters of the scene or "scale",
    without repetition and without length and gravity together."""
    bare = place.with_effects(effect for effect in place.effects if effect.kind != "dissipative")
    allowed = [name for name, value in bare.parameters().items()
               if isinstance(value, (int, float)) and not isinstance(value, bool) and value > 0.0]
    names = several(free, "free", "names")
    for name in names:
        if not isinstance(name, str) or name not in (*allowed, SCALE):
            raise SceneError(f"free has {shown(name)}, which is not a positive parameter of the scene"
                             f"{nearest(name, [*allowed, SCALE])}")
    if len(set(names)) < len(names):
        raise SceneError(f"free={shown(free)} names a parameter twice.")
    if LENGTH in names and GRAVITY in names:
        raise SceneError("free cannot have both length and gravity: a recording determines only their ratio.")
    return names


def _undetermined(place: Scene, damping: Names, free: Names) -> bool:
    """Return True if a free swing cannot tell several free parameters of a scene apart.

    That is so if the coefficients of the equation of motion, without those of fitted dampings, change by them in fewer
    ways than there are parameters.
    """
    names = [name for name in free if name != SCALE]
    own: dict[str, dict[str, float]] = {name: {} for name in damping if not DAMPINGS[name].fitted}
    scene = with_damping(place, own or NONE)
    torques = [effect.torque for effect in scene.effects if effect.torque and not effect.controlled]
    used = {name for torque in torques for name in signature(torque).parameters}

    def logarithms(place: Scene) -> Any:
        return np.log([abs(value) for name, value in place.coefficients.items() if name in used and value])

    slopes = [logarithms(scene.replace(**{name: float(scene.parameters()[name]) * 1.0001}))  # type: ignore[arg-type]
              - logarithms(scene) for name in names]
    return len(names) > 1 and int(np.linalg.matrix_rank(1e4 * np.array(slopes), tol=1e-3)) < len(names)


def _model(place: Scene, damping: Names, swing: Recording, free: tuple[str, ...]) -> Model:
    """Return the model of a swing with the given dampings; RecordingError for too few readings to fit its parameters.
    """
    model = _unchecked(place, damping, swing, free)
    if len(swing.time) <= len(model.names):
        problem = f"{len(model.names)} parameters needs more readings than the {len(swing.time)} from the release on"
        raise RecordingError(f"{swing.source}: a fit of {problem}")
    return model


def _unchecked(place: Scene, damping: Names, swing: Recording, free: tuple[str, ...]) -> Model:
    """Return the model of a swing with the given dampings, which may have too few readings for it."""
    return Model.of(place, damping, swing.time, free, program(place, damping), rate=swing.rate is not None,
                    mount=swing.mount)


def _warn_of_mass(best: Fit) -> None:
    """Warn for every fitted damping parameter that depends on the mass of the bob, if no mass was given."""
    place = best.scene
    other = place.replace(mass=2.0 * place.body.mass)
    for name in best.model.damping:
        effect = next(effect for effect in place.effects if effect.damping == name)
        if DAMPINGS[name].fitted and swing_loss(effect, place, 0.1) != swing_loss(effect, other, 0.1):
            warn(f"The fitted {effect.fitted} holds for a bob of {place.body.mass:g} kg, an assumed mass; give mass=.")
