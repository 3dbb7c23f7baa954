"""Which method and how many substeps: measured on probe episodes once, kept, and said why."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from integrators import METHODS, Method, MethodError
from pendulum_env.auto import store
from pendulum_env.auto.costs import SHIPPED, measure
from pendulum_env.common.progress import Progress, late_bar
from pendulum_env.common.warn import warn
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, function, number, several, shown, truth, whole_number

if TYPE_CHECKING:
    from pendulum_env.auto.search import Found
    from pendulum_env.common.tables import Table

AUTO = "auto"
STEPS = 500
"""Control steps of an episode, as registered."""
MOST_SUBSTEPS = 10**6
"""No choice that was kept has more."""
MOST_EPISODE = 10**7
"""Control steps of an episode that can be probed."""
OFTEN = 0.05
"""A part of the episodes that cannot be kept to the accuracy, from which on a warning says so."""


class AccuracyError(MethodError):
    """An accuracy that cannot be, or that nothing can keep."""


class Chosen(str):
    """A method's name; ``why`` says why it was chosen, ``choice`` has the numbers."""

    why: str = ""
    choice: Choice


@dataclass(frozen=True)
class Choice:
    """What was chosen, and what it promises.

    For starts of the scene's usual run and of the tasks, and torques decided beforehand, the angle's error stays at
    most ``accuracy`` at the end of each control step up to ``horizon``, as long as a small error has not grown more
    than ``growth``-fold. That is measured, not proven: ``error`` is a quarter of the accuracy at most, so that of other
    episodes about one in ``4 tried`` may be worse. It holds for open-loop torques: a policy that holds the bob upright
    hides errors that grow as
    exp(omega0 t).

    Attributes:
        method, substeps: what to run.
        accuracy: asked for [rad]; ``dt``, ``steps``: control step [s], and how many make an episode.
        error: the largest of all probe episodes [rad].
        horizon: time up to which the accuracy holds [s]; inf for whole episodes.
        growth: of a small error, up to which it is promised; ``share``: part of the episodes where it grows further.
        judged, tried: probe episodes that methods ran, the most sensitive of those tried.
        cost: of a control step, in steps of rk4, by ``table``: "shipped" or "measured here".
        others: what costs up to a quarter more: method, substeps, error and cost of each.
        limits: sentences on what is not promised.
    """

    method: str
    substeps: int
    accuracy: float
    dt: float
    steps: int
    error: float
    horizon: float
    growth: float
    share: float
    judged: int
    tried: int
    cost: float
    table: str
    others: tuple[Found, ...]
    limits: tuple[str, ...]

    @property
    def why(self) -> str:
        """Why it was chosen, in a sentence or two, and what is not promised."""
        span = min(self.horizon, self.dt * self.steps)
        plural = "s" * (self.substeps > 1)
        said = (
            f"{self.method} with {self.substeps} substep{plural} errs by at most {self.error:.2g} rad over {span:g} s "
            f"in {self.judged} probe episodes, the most sensitive of {self.tried}, where {self.accuracy:g} is asked "
            f"for; it costs {self.cost:.3g} steps of rk4 a control step by the table {self.table}"
        )
        if self.share:
            said += (f"; in {100.0 * self.share:.2g} % of these, errors grow more than {self.growth:.1g}-fold, beyond "
                     "which nothing is promised")
        if self.others:
            one = self.others[0]
            said += f", and the next best, {one.method} with {one.substeps}, {one.cost / self.cost:.2f} times as much"
        return " ".join([f"{said}.", *self.limits])

    @property
    def ranking(self) -> Table:
        """What was chosen and what comes next, as a table."""
        from pendulum_env.common.tables import Table

        rows = [(self.method, self.substeps, self.error, self.cost),
                *((one.method, one.substeps, one.error, one.cost) for one in self.others)]
        head = ("method", "substeps", "worst probe error / rad", "cost / rk4 steps", "relative cost")
        return Table(head, tuple((name, str(n), f"{error:.1e}", f"{cost:.3g}", f"{cost / self.cost:.2f}")
                                 for name, n, error, cost in rows))

    @property
    def name(self) -> Chosen:
        """The method's name, which knows why."""
        chosen = Chosen(self.method)
        chosen.why, chosen.choice = self.why, self
        return chosen


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
        from pendulum_env.auto.calibrate import calibrate

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
    from pendulum_env.auto.search import Found

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
