"""Which method and how many substeps: measured on probe episodes once, kept, and said why."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from integrators import METHODS, Method
from pendulum_env.auto import store
from pendulum_env.auto.calibrate import calibrate
from pendulum_env.auto.costs import SHIPPED, measure
from pendulum_env.auto.promise import AccuracyError, Choice, Chosen
from pendulum_env.auto.search import Found
from pendulum_env.common.progress import Progress, late_bar
from pendulum_env.common.warn import warn
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, function, number, several, shown, truth, whole_number

__all__ = ["AccuracyError", "Choice", "Chosen", "choose", "settled"]

AUTO = "auto"
STEPS = 500
"""Control steps of an episode, as registered."""
MOST_SUBSTEPS = 10**6
"""No choice that was kept has more."""
MOST_EPISODE = 10**7
"""Control steps of an episode that can be probed."""


def choose(
    scenes: Scene | Sequence[Scene],
    accuracy: float,
    dt: float = 0.02,
    steps: int = STEPS,
    *,
    recalibrate: bool = False,
    progress: Progress | None = None,
) -> Choice:
    """The cheapest method and substeps that keep the angle's error over an episode at most ``accuracy``.

    Every method that fits runs probe episodes, interpreted, with as many substeps as it needs; what a step costs is
    looked up in a table. The same is chosen on every machine, and kept in the cache folder.

    Args:
        scenes: a scene, or several with the same effects that one choice has to serve.
        accuracy: [rad].
        dt, steps: control step [s], and how many make an episode.
        recalibrate: measure the table of costs anew on this machine, keep it, and choose anew.
        progress: called with the fraction done; by default a bar appears where it takes long.

    Raises AccuracyError for an accuracy that is no finite number above zero, or below what can be kept: it says the
    least that can be promised.
    """
    places = (scenes,) if isinstance(scenes, Scene) else several(scenes, "scenes", "scenes")
    for place in places:
        if not isinstance(place, Scene):
            raise SceneError(f"scenes must be a Scene or several, not {shown(place)}.")
    if not places:
        raise SceneError("scenes must hold at least one Scene, not none.")
    places = tuple(dict.fromkeys(places))
    wanted = number(accuracy, "accuracy", above=0.0, unit="rad")
    step = number(dt, "dt", above=0.0, unit="s")
    count = whole_number(steps, "steps", MOST_EPISODE)
    if progress is not None:
        function(progress, "progress")
    if truth(recalibrate, "recalibrate"):
        found = _measured(progress)
    table = found if recalibrate else store.load_table(SHIPPED)
    key = {
        "scenes": [scene.to_dict() for scene in places], "accuracy": wanted, "dt": step, "steps": count,
        "sources": store.sources(), "table": None if table is None else sorted(table.items()),
    }
    path = store.file_of(key)
    kept = None if recalibrate else _read(store.load(path, key), (wanted, step, count))
    if kept is None:
        words = "shipped" if table is None else "measured here"
        if progress is None:
            with late_bar(f"choosing a method for {places[0].name}") as tell:
                kept = calibrate(places, wanted, step, count, table or SHIPPED, words, tell)
        else:
            kept = calibrate(places, wanted, step, count, table or SHIPPED, words, progress)
        store.save(path, key, asdict(kept))
    return kept


def _measured(progress: Progress | None) -> dict[str, tuple[float, float]]:
    """The table of this machine, measured and kept."""
    if progress is None:
        with late_bar("measuring what steps cost") as tell:
            table = measure(tell)
    else:
        table = measure(progress)
    store.save_table(table)
    return table


def _read(found: Any, question: tuple[float, float, int]) -> Choice | None:
    """A choice that was kept, for this accuracy, dt and steps; None for one that cannot be."""
    try:
        others = tuple(Found(str(o["method"]), int(o["substeps"]), float(o["error"]), float(o["cost"]))
                       for o in found["others"])
        choice = Choice(**{**found, "others": others, "limits": tuple(map(str, found["limits"]))})
        sound = choice.method in METHODS and type(choice.substeps) is int and 0 < choice.substeps <= MOST_SUBSTEPS
        sound &= (choice.accuracy, choice.dt, choice.steps) == question and isinstance(found["limits"], list)
        sound &= 0.0 <= choice.error <= choice.accuracy and 0.0 < choice.cost < math.inf and choice.horizon > 0.0
        sound &= math.isfinite(choice.growth) and 0.0 <= choice.share <= 1.0 and type(choice.judged) is int
        return choice if sound and choice.why else None
    except (KeyError, TypeError, ValueError, AttributeError, ArithmeticError):
        return None


def settled(
    scenes: Scene | Sequence[Scene], integrator: str | Method, accuracy: float | None, dt: float, steps: int | None,
    given: Mapping[str, Any],
) -> Choice:
    """The choice for an environment with this accuracy [rad] and control step [s].

    ``given``: other keywords -> True if they were given, which is refused.

    Warns of what is not promised. Raises AccuracyError for "auto" without an accuracy, or the other way round.
    """
    if not isinstance(integrator, str) or integrator != AUTO:
        raise AccuracyError(
            f"accuracy goes with integrator='auto', not with {shown(integrator)}: drop it, or take rtol."
        )
    if accuracy is None:
        raise AccuracyError("integrator='auto' needs an accuracy of the angle [rad], as in accuracy=1e-6.")
    for name in (name for name, there in given.items() if there):
        raise AccuracyError(f"integrator='auto' chooses the steps itself; leave out {name}.")
    choice = choose(scenes, accuracy, dt, STEPS if steps is None else steps)
    for said in choice.limits:
        warn(f"integrator='auto': {said}")
    return choice
