"""Choice of a method and its substeps for a requested accuracy: measured once, and then stored in the cache folder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, dataclass
from typing import Any

from integrators import Method
from pendulum_env.auto import store
from pendulum_env.auto.calibrate import AccuracyError, Choice, Chosen, calibrate
from pendulum_env.auto.costs import SHIPPED, measure
from pendulum_env.auto.search import Candidate
from pendulum_env.common.checks import warn
from pendulum_env.common.progress import Progress, late_bar
from pendulum_env.common.provenance import provenance
from pendulum_env.common.results import Columns, Result, columns_of, one_line
from pendulum_env.common.texts import Table
from pendulum_env.common.version import sources
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, boolean, function, number, several, shown, whole_number

__all__ = ["AccuracyError", "Choice", "Chosen", "choose", "settled"]

AUTO = "auto"
STEPS = 500
"""Control steps of an episode in the registered environment."""
TABLE = {"table": sorted(SHIPPED)}
"""The question under which a table of costs measured on this computer is stored, for these classes of methods."""
MOST_EPISODE = 10**7
"""Largest number of control steps in an episode for which a method can be chosen."""


def choose(
    scenes: Scene | Sequence[Scene],
    accuracy: float,
    dt: float = 0.02,
    steps: int = STEPS,
    *,
    recalibrate: bool = False,
    progress: Progress | None = None,
) -> Choice:
    """Return the cheapest method and substeps that keep the angle's error over an episode at most ``accuracy``.

    Every method that fits the scene runs probe episodes (given starts and motor torques), interpreted by Python, with
    as many substeps as the accuracy needs; the cost of a step is looked up in a table. Therefore every computer makes
    the same choice. It is stored in the cache folder.

    Args:
        scenes: a scene, or several scenes with the same effects for which one choice must be accurate.
        accuracy: largest error of the angle [rad].
        dt, steps: control step [s], and number of control steps in an episode.
        recalibrate: measure the table of step costs on this computer, store it, and choose again.
        progress: called with the fraction done; by default a bar appears if the choice takes long.

    Raises AccuracyError for a scene that clips the velocity, and for an accuracy that is not a finite number above
    zero, or that cannot be reached; the message gives the smallest accuracy that can be reached.
    """
    places = (scenes,) if isinstance(scenes, Scene) else several(scenes, "scenes", "scenes")
    for place in places:
        if not isinstance(place, Scene):
            raise SceneError(f"scenes must be a Scene or several, not {shown(place)}.")
        if any(effect.limit for effect in place.effects):
            raise AccuracyError(f"The scene '{place.name}' clips the velocity after every step, so that no motion is "
                                "the true one, and no method can be chosen by its accuracy; name a method and a step.")
    if not places:
        raise SceneError("scenes must hold at least one Scene, not none.")
    places = tuple(dict.fromkeys(places))
    limit = number(accuracy, "accuracy", above=0.0, unit="rad")
    step = number(dt, "dt", above=0.0, unit="s")
    count = whole_number(steps, "steps", MOST_EPISODE)
    told = None if progress is None else function(progress, "progress")
    if boolean(recalibrate, "recalibrate"):
        with _bar(told, "measuring the cost of steps") as tell:
            table = measure(tell)
        store.save(TABLE, table)
    else:
        table = store.load(TABLE)
    question = {
        "scenes": [scene.to_dict() for scene in places], "accuracy": limit, "dt": step, "steps": count,
        "sources": sources(), "table": None if table is None else sorted(table.items()),
    }
    stored = None if recalibrate else store.load(question)
    if stored is not None:
        others = tuple(Candidate(**one) for one in stored["others"])
        return Choice(**{**stored, "others": others, "limits": tuple(stored["limits"])})
    with _bar(told, f"choosing a method for {places[0].name}") as tell:
        choice = calibrate(places, limit, step, count, table or SHIPPED,
                           "measured here" if table else "shipped", tell)
    store.save(question, asdict(choice))
    return choice


def _bar(progress: Progress | None, title: str) -> AbstractContextManager[Progress]:
    return late_bar(title) if progress is None else nullcontext(progress)


def settled(
    scenes: Scene | Sequence[Scene], integrator: str | Method, accuracy: float | None, dt: float, steps: int | None,
    given: Mapping[str, Any],
) -> Choice:
    """Return the automatic choice for an environment with this accuracy [rad] and control step [s].

    ``given`` maps other keywords, such as substeps, to True if the user gave them, which raises AccuracyError. So does
    "auto" without an accuracy, and an accuracy without "auto". Warns of the cases in which the accuracy is not
    guaranteed.
    """
    if not isinstance(integrator, str) or integrator != AUTO:
        raise AccuracyError(
            f"accuracy goes with integrator='auto', not with {shown(integrator)}; leave it out, or use rtol."
        )
    if accuracy is None:
        raise AccuracyError("integrator='auto' needs an accuracy of the angle [rad], as in accuracy=1e-6.")
    for name in (name for name, there in given.items() if there):
        raise AccuracyError(f"integrator='auto' chooses the steps itself; leave out {name}.")
    choice = choose(scenes, accuracy, dt, STEPS if steps is None else steps)
    for sentence in choice.limits:
        warn(f"integrator='auto': {sentence}")
    return choice


COLUMNS = {"method": "", "substeps": "", "error_rad": "rad", "cost_rk4_steps": ""}
"""Columns of the table with their units."""


@dataclass(frozen=True, repr=False)
class Ranking(Result):
    """The method of an automatic choice and the next cheapest ones."""

    choice: Choice

    def __repr__(self) -> str:
        return one_line(self, f"{self.choice.method} with {self.choice.substeps} substeps")

    def origin(self) -> Mapping[str, str]:
        """Return accuracy [rad], control step [s] and length of an episode, with what computed the choice."""
        return provenance(Accuracy=self.choice.accuracy, ControlStep=self.choice.dt, Steps=self.choice.steps,
                          Costs=self.choice.table)

    def tables(self) -> Mapping[str, Columns]:
        """Return the methods, from the cheapest, with their substeps, largest error and cost."""
        one = self.choice
        return {"auto": columns_of(COLUMNS, [
            (one.method, one.substeps, one.error, one.cost),
            *((other.method, other.substeps, other.error, other.cost) for other in one.others)])}

    @property
    def table(self) -> Table:
        """Table of the methods."""
        return self.choice.ranking

    @property
    def text(self) -> str:
        """Reasons for the choice, and the cases in which the accuracy is not guaranteed."""
        return self.choice.why
