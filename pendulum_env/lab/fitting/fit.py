"""From a recording to the scene that follows it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from os import PathLike
from typing import Any

import numpy as np

from pendulum_env.common.progress import Progress, telling_of
from pendulum_env.common.warn import warn
from pendulum_env.lab.fitting.candidates import AUTO, Names, asked_for, program
from pendulum_env.lab.fitting.model import GRAVITY, LENGTH, SCALE, Model
from pendulum_env.lab.fitting.result import Comparison, Fit
from pendulum_env.lab.fitting.shooting import solve_all
from pendulum_env.lab.fitting.start import Measured, growth
from pendulum_env.lab.recording import Recording, RecordingError
from pendulum_env.lab.sheet import apparatus
from pendulum_env.physics.effects import DAMPINGS
from pendulum_env.physics.flow import swing_loss
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, naming_keywords, nearest, several, shown

BOB = ("radius", "mass")
"""What makes the drag on a bob known, in a medium that is."""
GROWS = 0.005
"""Share of the largest swing that one must have grown by over an earlier one to be warned of."""
LEAST_REST = 1e-3
"""Share of a recording that a rest at its end must last to be looked at."""


def fit(
    recording: Recording,
    effects: str | Sequence[str] = AUTO,
    *,
    scene: str | Scene | Mapping[str, object] | PathLike[str] | None = None,
    free: Sequence[str] = (LENGTH,),
    progress: Progress | bool = False,
    **parameters: Any,
) -> Fit:
    """Fit a scene's numbers to a recording, by least squares of the whole trajectory.

    ``angle_i = zero + scale theta(t_i)``: fitted are the start, the sensor's zero, what is ``free``, and the dampings'
    numbers. Several models are compared; the best by the Bayesian information criterion is returned, its ``comparison``
    tells of all.

    Args:
        recording: as read; it is cut at the release, and a period after the readings have stopped to change: those of
            a bob at rest are all the same one, rounded the same way.
        effects: "auto" for all sums of dampings that a recording can tell apart, and C_d(Re) where radius and mass are
            told or a scene is given; one model, dampings joined by "+" as ``damping=`` takes them; or a list of models
            to compare.
        scene: what hangs there, in what; its own damping is left out. By default a pendulum in air that is told only
            by ``parameters``.
        free: what is fitted beside the start and the dampings' numbers: positive numbers of the scene, such as
            "length" or "gravity" (of which the recording determines the ratio), and "scale", the sensor's, which the
            dependence of the period on the amplitude tells: swings of some 30 degrees or more; () for none of them.
        progress: True shows a bar; or what is called with the fraction done and a word for it.
        **parameters: what is known of the scene, such as ``length=0.65, mass=0.0415``.

    Warns where the best model does not follow all swings, where swings grow, which no damping makes them do, and where
    a number of the damping is that of a mass that nobody told, or all of a length neither told nor fitted. Raises
    RecordingError for what is no recording of a free swing of at least three turning points below half a turn,
    SceneError for names and values that cannot be.
    """
    if not isinstance(recording, Recording):
        raise RecordingError(f"recording must be a Recording, as Recording.read makes one, got {shown(recording)}")
    with naming_keywords(fit):
        place = apparatus(scene, parameters)
    if not place.of_kind("conservative") or not place.omega0 > 0.0:
        raise SceneError(f"The scene '{place.name}' has nothing that pulls the bob back, so nothing in it swings.")
    known = scene is not None or all(name in parameters for name in BOB)
    names = _checked(free, place)
    wanted = asked_for(effects, place, known)
    free_swing = recording.released()
    swing = _moving(free_swing)
    models = [_model(place, damping, swing, names) for damping in wanted]
    sigma = max(swing.noise, 1e-12 * float(np.ptp(swing.angle)))
    with telling_of(progress, "fit") as telling:
        solutions = solve_all(models, swing, sigma, telling)
    rest = float(free_swing.time[-1] - swing.time[-1])
    fits = [Fit(swing, solution, sigma, rest=rest) for solution in solutions]
    comparison = Comparison.of(fits)
    best = comparison.fits[0]
    if best.solution.lost:
        warn(f"{best.damping} follows the recording only until {best.solution.followed:.4g} s; no number of this fit "
             "means anything.")
    grown, when = growth(Measured.of(swing).points)
    if grown > GROWS:
        warn(f"the swings grow by {100.0 * grown:.3g} % of the largest up to {when:.4g} s: driven, pushed, not one "
             "swing alone or with bad readings; dampings only take energy, so no number of this fit means anything.")
    if scene is None and "mass" not in parameters:
        _warn_of_mass(best)
    if scene is None and LENGTH not in parameters and LENGTH not in names:
        warn(f"the length is taken to be {place.body.length:g} m, as it is neither told nor fitted; give length=.")
    return replace(best, comparison=comparison) if len(fits) > 1 else best


def _moving(swing: Recording) -> Recording:
    """The swing without the readings at its end that are all the same, but for a period of them."""
    changes = np.flatnonzero(swing.angle != swing.angle[-1])
    if not len(changes):
        return swing
    rest = float(swing.time[changes[-1]])
    if swing.time[-1] - rest <= (swing.time[-1] - swing.time[0]) * LEAST_REST:
        return swing
    keep = swing.time <= rest + Measured.of(swing).period
    if keep.all():
        return swing
    said = f"rest: from {rest:.4g} s on the reading stays the same, {np.count_nonzero(~keep)} readings left out"
    return replace(swing, time=swing.time[keep], angle=swing.angle[keep], notes=(*swing.notes, said))


def _checked(free: Sequence[str], place: Scene) -> tuple[str, ...]:
    """What is free; SceneError unless these are different positive numbers of the scene, or "scale"."""
    bare = place.with_effects(effect for effect in place.effects if effect.kind != "dissipative")
    allowed = [name for name, value in bare.parameters().items()
               if isinstance(value, (int, float)) and not isinstance(value, bool) and value > 0.0]
    names = several(free, "free", "names")
    for name in names:
        if not isinstance(name, str) or name not in (*allowed, SCALE):
            raise SceneError(f"free has {shown(name)}, which is no positive number of the scene"
                             f"{nearest(name, [*allowed, SCALE])}")
    if len(set(names)) < len(names):
        raise SceneError(f"free={shown(free)} names one number twice.")
    if LENGTH in names and GRAVITY in names:
        raise SceneError("free cannot have both length and gravity: a recording determines their ratio.")
    return names


def _model(place: Scene, damping: Names, swing: Recording, free: tuple[str, ...]) -> Model:
    """The model with these dampings; RecordingError for fewer readings than it has numbers."""
    found = Model.of(place, damping, swing.time, free, program(place, damping))
    if len(swing.time) <= len(found.names):
        what = f"{len(found.names)} numbers needs more readings than the {len(swing.time)} from the release on"
        raise RecordingError(f"{swing.source}: a fit of {what}")
    return found


def _warn_of_mass(best: Fit) -> None:
    """Say it where a damping's number would be another with another mass."""
    place = best.scene
    other = place.replace(mass=2.0 * place.body.mass)
    for name in best.model.damping:
        effect = next(effect for effect in place.effects if effect.damping == name)
        if DAMPINGS[name].fitted and swing_loss(effect, place, 0.1) != swing_loss(effect, other, 0.1):
            warn(f"{effect.fitted} is that of a bob of {place.body.mass:g} kg, as no mass is told; give mass=.")
