"""Two-minute tour in five chapters, each with computed numbers and a figure: from Euler methods to a swing-up."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pendulum_env import plots
from pendulum_env.common.progress import Progress, told_by
from pendulum_env.common.provenance import output_folder, provenance
from pendulum_env.controllers import SwingUp
from pendulum_env.engine.kernels import Backend, resolve
from pendulum_env.engine.machine import ANGLE, NOWHERE, TURNS, TWO_PI, UNSEEN, VELOCITY, Machine
from pendulum_env.engine.rollout import rollout
from pendulum_env.engine.spec import RunSpec
from pendulum_env.films.orbit import curves
from pendulum_env.films.picture import TRAIL_SECONDS, Facts, apparatus, view
from pendulum_env.films.reel import motion
from pendulum_env.lab.fitting.fit import fit
from pendulum_env.lab.simulated import SCENE, simulated_recording, true_scene
from pendulum_env.physics.effects import Motor
from pendulum_env.physics.energy import Ledger
from pendulum_env.physics.units import SceneError, boolean
from pendulum_env.plots import audit, recorded
from pendulum_env.plots import cost as diagrams
from pendulum_env.render import FrameStyle, PastSamples, frame, write_film
from pendulum_env.study.audit.study import simplify
from pendulum_env.study.cost.points import CostStudy
from pendulum_env.study.cost.study import cost

Array = NDArray[np.float64]

METHOD = "rk4"
"""Integrator of the swing-up."""
DT = 0.02
"""Control step, and time between frames of the film [s]."""
LONGEST = 40.0
"""Longest time until the bob is upright [s]."""
HELD = 3.0
"""Time for which the bob is held upright at the end [s]."""
NEAR = 0.1
"""Angle from upright within which the bob counts as upright [rad]."""
SIZE = (900, 560)
"""Size of the film [pixels]."""
LOOK = FrameStyle(panels=("apparatus", "phase", "history"))


@dataclass(frozen=True, eq=False)
class Swung:
    """Run of a pendulum under a controller, with the state at every control step.

    Attributes:
        machine: compiled program of the scene with a method, which simulated the run.
        states: state vectors at the start and after each control step, shape (n, width).
        shares: motor torque in the control step after each state, as a fraction of the largest, shape (n,); 0 in the
            last.
        settled: time from which the bob stayed upright [s]; inf if it never did.
    """

    machine: Machine
    states: Array
    shares: Array
    settled: float

    @property
    def time(self) -> Array:
        """Times of the start and of the end of each control step [s]."""
        return DT * np.arange(len(self.states), dtype=np.float64)

    @property
    def angle(self) -> Array:
        """Angle from the downward vertical, with full turns counted, at the start and after each control step [rad]."""
        return np.asarray(self.states[:, ANGLE] + TWO_PI * self.states[:, TURNS])

    @property
    def initial(self) -> float:
        """Energy at the start of the run [J]."""
        return float(self.machine.ledger(self.states[0], 0.0).energy)

    @property
    def ledger(self) -> Ledger:
        """Energies, work and heat at the start and after each control step [J]."""
        return self.machine.ledger(self.states, self.initial)

    @property
    def swings(self) -> int:
        """Number of turning points before the bob stayed upright."""
        moving = self.states[self.time <= self.settled, VELOCITY]
        return int(np.count_nonzero(moving[1:] * moving[:-1] < 0.0))

    @property
    def motor_torque(self) -> float:
        """Largest torque of the motor [N m]."""
        return float(next(effect.max_torque for effect in self.machine.scene.effects if isinstance(effect, Motor)))

    @property
    def weight_torque(self) -> float:
        """Torque of the weight with the pendulum horizontal [N m]."""
        return self.machine.scene.restoring

    @property
    def facts(self) -> dict[str, Any]:
        """Origin of the run (scene, method, step, controller), written into the head of output files."""
        return {"scene": self.machine.scene.to_dict(), "method": self.machine.label, "dt": DT, "controller": "SwingUp"}


def swung_up(scene: str = "lab", *, longest: float = LONGEST, backend: Backend = "auto") -> Swung:
    """Swing the bob up from rest with :class:`pendulum_env.controllers.SwingUp`, and hold it up for three seconds.

    The run ends after ``longest`` seconds if the bob never stays upright. Raises SceneError for a scene without motor.
    """
    machine = RunSpec.of(scene, METHOD, backend=backend).machine()
    controller = SwingUp(machine.scene, DT)
    state, seen = machine.state(0.0, 0.0), UNSEEN.copy()

    def advance(share: float, steps: int) -> None:
        machine.run(state, machine.parameters, share, DT, 1, steps, math.inf, NOWHERE, seen)
        rows.append(np.array(state))

    rows: list[Array] = []
    shares: list[float] = []
    upright = 0
    advance(0.0, 0)
    while len(shares) < round(longest / DT) and upright < HELD / DT:
        shares.append(float(controller(seen)[0]))
        advance(shares[-1], 1)
        off = abs(math.remainder(motion(state, DT)[1] - math.pi, TWO_PI))
        upright = upright + 1 if off < NEAR else 0
    settled = (len(rows) - upright) * DT if upright >= HELD / DT else math.inf
    return Swung(machine, np.array(rows)[:, : machine.width], np.array([*shares, 0.0]), settled)


def draw(run: Swung) -> Figure:
    """Draw a figure of a run's angle, motor torque, energy, work and heat over time."""
    from matplotlib.ticker import MultipleLocator

    from pendulum_env.plots import figure, styled
    from pendulum_env.render.palette import ENERGY_COLOURS, FAINT_INK, INK, OKABE_ITO

    drawing, (upper, middle, lower) = figure(3, sharex=True, height_ratios=(1.3, 0.7, 1.0))
    ledger, time, degrees = run.ledger, run.time, np.degrees(run.angle)
    title = f"{run.machine.scene.name} · swing-up from rest · dt = {DT:g} s · {run.machine.label}"
    with styled():
        upper.plot(time, degrees, color=OKABE_ITO["blue"])
        upper.yaxis.set_major_locator(MultipleLocator(90.0))
        for top in range(-180, round(float(np.max(np.abs(degrees)))) + 1, 360):
            if np.min(degrees) - 1.0 < top:
                upper.axhline(top, color=FAINT_INK, linewidth=0.9, linestyle=(0, (4, 3)), zorder=1.2)
        upper.set(ylabel="angle [degrees]", title=title)
        middle.step(time, run.shares, where="post", color=OKABE_ITO["vermillion"])
        middle.set(ylabel="torque / largest", ylim=(-1.1, 1.1))
        lower.plot(time, 1e3 * (ledger.energy - ledger.energy[0]), label="energy", color=INK)
        for name, values in (("work", ledger.work), ("heat", ledger.heat)):
            lower.plot(time, 1e3 * values, label=name, color=ENERGY_COLOURS[name])
        lower.set(xlabel="time [s]", ylabel="since the start [mJ]", xlim=(0.0, float(time[-1])))
        lower.legend(loc="lower right", bbox_to_anchor=(1.0, 0.08), ncols=3)
    return drawing


def write_swing(run: Swung, path: Path, tell: Progress) -> Path:
    """Write the film of a swing-up at true speed, and return its path."""
    return write_film(path, pictures(run), 1.0 / DT, metadata=provenance(**run.facts), total=len(run.states),
                      progress=lambda done, total: tell(done / len(run.states), "filming the swing-up"))


def pictures(run: Swung) -> Iterator[Any]:
    """Yield the frames of the film of a swing-up, one for every control step."""
    machine, trail = run.machine, math.ceil(TRAIL_SECONDS / DT)
    thing, facts = apparatus(machine.scene), Facts.of(machine)
    ledger, time, angle = run.ledger, run.time, run.angle
    behind = curves(machine.scene, float(np.max(ledger.potential)))
    columns = {"time": time, "angle": angle, "velocity": run.states[:, VELOCITY], "kinetic": ledger.kinetic,
               "potential": ledger.potential, "heat": ledger.heat, "work": ledger.work, "residual": ledger.residual}
    for i, state in enumerate(run.states):
        first = max(0, i - trail)
        past = PastSamples(**{name: values[:i] for name, values in columns.items()})
        shown = view(machine, state.tolist(), DT, run.initial, float(run.shares[max(0, i - 1)]),
                     tuple(angle[first:i].tolist()), time[first:i].tolist(), facts=facts, past=past, curves=behind)
        yield frame(thing, shown, size=SIZE, look=LOOK)


EULERS = ("forward_euler", "backward_euler", "symplectic_euler")
"""Methods of the chapter on energy."""
PRICED = ("symplectic_euler", "rk4", "dop853")
"""Methods of the chapter on the cost of accuracy."""
ERRORS = (1e-2, 1e-4, 1e-6, 1e-8)
"""Angle errors [rad] for which the tour gives the cost."""
STEPS = tuple(0.25 / 2**k for k in range(13))
"""Steps of the chapter on the cost of accuracy [s]."""
INTERPRETED = STEPS[:7]
"""Steps of the chapter on the cost of accuracy for the slow interpreted backend [s]."""
UNITS = ((1e6, "ms"), (1e3, "µs"), (1.0, "ns"))
"""Units of the printed times, in ns."""
EXPLODES, DIES = 2.0, 0.5
"""Final energy over initial energy above which a method "explodes", and below which it "dies"."""
DAMPING = "linear+quadratic"
"""Damping model that is fitted to the recording."""


@dataclass(frozen=True)
class Chapter:
    """Chapter of the two-minute tour of the package: heading, text and files.

    Attributes:
        title: heading of the chapter.
        text: paragraphs with computed numbers.
        files: paths of the files written.
    """

    title: str
    text: str
    files: tuple[Path, ...]


def demo(
    folder: str | Path, *, film: bool = True, progress: Progress | None = None, backend: Backend = "auto"
) -> Iterator[Chapter]:
    """Run the tour of the package, and yield each chapter when its files are written.

    The chapters are: the lab exercise with three Euler methods, ``exercise.png``; the cost of accuracy,
    ``accuracy.png``; the effects that matter for a pendulum in water, ``effects.png``; the fit of a simulated
    recording, ``fit.png``; a controller that swings the bob up, ``swing_up.png``, with its film ``swing_up.mp4``.

    Args:
        folder: folder for the files.
        film: False leaves out the film.
        progress: called with the fraction done and the present activity.
        backend: "auto", "compiled" or "python".

    Raises OutputError where the folder cannot be written, SceneError or EngineError for an invalid argument.
    """
    tell, filmed = told_by(progress), boolean(film, "film")
    resolve(backend)
    place = output_folder(folder)
    chapters: tuple[tuple[Callable[..., Chapter], float], ...] = (
        (exercise, 0.1), (accuracy, 0.2), (effects, 0.45), (recording, 0.55),
        (partial(swinging, film=filmed), 1.0),
    )
    return _chapters(chapters, place, tell, backend)


def _chapters(
    chapters: tuple[tuple[Callable[..., Chapter], float], ...], place: Path, tell: Progress, backend: Backend
) -> Iterator[Chapter]:
    begun = 0.0
    for chapter, ended in chapters:
        def share(done: float, what: str, low: float = begun, high: float = ended) -> None:
            tell(low + (high - low) * done, what)

        yield chapter(place, share, backend)
        begun = ended


def exercise(place: Path, tell: Progress, backend: Backend) -> Chapter:
    """Return the tour's chapter on the energy under three Euler methods, and write its figure."""
    runs = {}
    for i, name in enumerate(EULERS):
        tell(i / 4.0, f"the exercise, {name}")
        runs[name] = rollout("exercise", damping="none", integrator=name, dt=0.01, duration=10.0, backend=backend)
    first = next(iter(runs.values()))
    tell(0.75, "drawing the exercise")
    figure, rows = plots.figure(2)
    plots.angle(runs, axes=rows[0])
    plots.energy(runs, axes=rows[1])
    rows[1].set_title("", loc="left")
    if (legend := rows[1].get_legend()) is not None:
        legend.remove()
    body, start = first.scene.body, math.degrees(first.scene.run.angle)
    lines = [
        f"A bob of {1000.0 * body.mass:g} g hangs on a {body.suspension} of {body.reach:g} m and is let go from "
        f"{start:.2g}°. Without friction it should swing for ever. The energy after {first.time[-1]:g} s, with three "
        f"integrators and steps of {first.dt:g} s:",
        *(f"  {name:17} {ratio_text(run.energy[-1] / run.energy[0])}" for name, run in runs.items()),
        "symplectic_euler differs from forward_euler in one thing: it computes the new angle from the new velocity "
        "instead of the old one.",
    ]
    files = (_save(figure, place / "exercise.png", scene=first.scene.to_dict(), method=list(runs), dt=first.dt),)
    return Chapter("Three ways to take a step", "\n".join(lines), files)


def ratio_text(ratio: float) -> str:
    """Return a ratio of final to initial energy in words, as "explodes: 4.2 times the initial energy"."""
    verdict = "explodes" if ratio > EXPLODES else "dies" if ratio < DIES else "holds"
    return f"{verdict}: {ratio:.3g} times the initial energy"


def accuracy(place: Path, tell: Progress, backend: Backend) -> Chapter:
    """Return the tour's chapter on the computing time that three methods need for an accuracy, and write its figure."""
    steps = STEPS if resolve(backend) == "compiled" else INTERPRETED
    study = cost("vacuum", PRICED, duration=10.0, steps=steps, tolerances=(), repeats=3, backend=backend,
                 progress=lambda done, what: tell(0.9 * done, f"cost of accuracy, {what}"))
    if not study.complete:
        raise KeyboardInterrupt
    tell(0.9, "drawing the cost of accuracy")
    head = "".join(f"{f'1e{round(math.log10(error))} rad':>12}" for error in ERRORS)
    rows = [f"  {name:17}" + "".join(f"{price_text(study, name, error):>12}" for error in ERRORS) for name in PRICED]
    lines = [
        f"Released from {study.angle:g} rad in vacuum, where the motion is known in closed form. Computing time per "
        f"simulated second on this machine, for several largest errors of the angle within {study.duration:g} s:",
        f"  {'':17}{head}", *rows,
        study.sentence() + (f" A dash means that even steps of {steps[-1]:.1g} s are too long for this accuracy."
                            if "-" in "".join(rows) else ""),
    ]
    files = (_save(diagrams.draw(study), place / "accuracy.png", scene=study.scene.to_dict(), method=list(PRICED)),)
    return Chapter("What accuracy costs", "\n".join(lines), files)


def price_text(study: CostStudy, method: str, error: float) -> str:
    """Return the computing time per simulated second of the fastest run accurate enough, as text such as "3.1 µs".

    Runs of ``method`` with an angle error of at most ``error`` [rad] count; "-" if there is none.
    """
    own = study.reference.error_estimate
    times = [point.ns_per_second for point in study.of(method) if point.angle_error + own <= error]
    least = min(times, default=math.inf)
    unit, name = next(((unit, name) for unit, name in UNITS if least >= unit), UNITS[-1])
    return f"{least / unit:.{0 if least >= 10.0 * unit else 1}f} {name}" if times else "-"


def effects(place: Path, tell: Progress, backend: Backend) -> Chapter:
    """Return the tour's chapter on the effects that matter for a pendulum in water, and write its figure."""
    amplitude, tolerance = math.radians(30.0), 0.003
    scene, report = simplify("water", amplitude, tolerance, backend=backend,
                             progress=lambda done, what: tell(0.95 * done, f"effects in water, {what}"))
    tell(0.95, "drawing the effects")
    full = report.audit.scene
    rows = {row.effect: row for row in report.audit.rows}
    lines = [
        f"A pendulum in water, released from {math.degrees(amplitude):.3g}°. Which of its {len(full.effects)} effects "
        f"change the period or the amplitude by more than {100.0 * tolerance:g} %?",
        *(f"  {effect.name:17} period {_change(rows[effect.name].period_change)}, amplitude "
          f"{_change(rows[effect.name].amplitude_change)}  {rows[effect.name].verdict}" for effect in full.effects),
        f"{report.text} Effects left out of a scene cost no computing time.",
    ]
    files = (_save(audit.draw(report.audit), place / "effects.png", scene=full.to_dict(), simplified=scene.to_dict()),)
    return Chapter("Only the effects that matter", "\n".join(lines), files)


def _change(value: float) -> str:
    return f"{100.0 * value:+7.2f} %" if math.isfinite(value) else f"{'-':>9}"


def recording(place: Path, tell: Progress, _backend: Backend) -> Chapter:
    """Return the tour's chapter on the fit of length and drag to a simulated recording, and write its figure."""
    record, true = simulated_recording(), true_scene()
    result = fit(record, DAMPING, mass=SCENE["mass"], radius=SCENE["radius"],
                progress=lambda done, what: tell(0.8 * done, f"fitting a recording, {what}"))
    tell(0.8, "drawing the fit")
    gamma = next(one for name, one in result.parameters.items() if name.endswith("gamma"))
    length = result.parameters["length"]
    lines = [
        f"A sensor's file with {len(record.time)} readings, rounded to {math.degrees(record.quantum):.2g}°. It comes "
        "with the package and is simulated, so that the true values are known. The fit of the whole swing gives:",
        f"  length  {length}, true value {true.body.reach:g} m",
        f"  gamma   {gamma}, true value {SCENE['gamma']:g} 1/s",
        f"The residual of the fit is {math.degrees(result.rms):.2g}° rms, the error of a reading "
        f"{math.degrees(result.noise):.2g}°. With a file of your own: lab-pendulum fit FILE, and for the whole lab "
        "report: lab-pendulum exercise --recording FILE.",
    ]
    files = (plots.save(recorded.recorded(result), place / "fit.png",
                        {**result.origin(), "Title": f"fit of {record.source}"}),)
    return Chapter("From a recording to its pendulum", "\n".join(lines), files)


def swinging(place: Path, tell: Progress, backend: Backend, film: bool) -> Chapter:
    """Return the tour's chapter on a swing-up with a weak motor, and write its figure and film."""
    tell(0.0, "swinging up")
    run = swung_up(backend=backend)
    files = [_save(draw(run), place / "swing_up.png", **run.facts)]
    if film:
        files.append(write_swing(run, place / "swing_up.mp4", lambda done, what: tell(0.05 + 0.95 * done, what)))
    tell(1.0, "done")
    if math.isinf(run.settled):
        raise SceneError(f"The controller did not swing the bob up within {run.time[-1]:g} s; its motor may be weak.")
    share, end = run.motor_torque / run.weight_torque, run.ledger
    lines = [
        f"The lab's motor gives {run.motor_torque:g} N m, {100.0 * share:.0f} % of the torque that holds the pendulum "
        "horizontal, so it cannot lift the bob at once. An energy controller increases the swing until the bob is near "
        "the top, where a linear controller holds it.",
        f"  {run.swings} turning points, upright from {run.settled:.1f} s on",
        f"  work of the motor {1e3 * end.work[-1]:.1f} mJ, of which {1e3 * end.heat[-1]:.1f} mJ became heat",
        f"  error in the energy balance {abs(1e3 * end.residual[-1]):.1g} mJ",
        "The film runs at the true speed of the pendulum." if film else "To write a film too, leave out --no-film.",
    ]
    return Chapter("A weak motor and a controller", "\n".join(lines), tuple(files))


def _save(figure: Figure, path: Path, **origin: Any) -> Path:
    return plots.save(figure, path, {**provenance(**origin), "Title": path.stem})
