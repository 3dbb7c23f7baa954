"""The tour in two minutes: one pendulum, five things that the package does with it, each with its numbers and a figure.

Every number of the texts is computed when the tour runs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pendulum_env.common.progress import Progress, told_by
from pendulum_env.common.provenance import output_folder, provenance
from pendulum_env.engine.kernels import Backend, resolve
from pendulum_env.physics.units import SceneError, truth

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pendulum_env.study.cost.points import CostStudy

EULERS = ("forward_euler", "backward_euler", "symplectic_euler")
PRICED = ("symplectic_euler", "rk4", "dop853")
"""Methods of which the tour tells what accuracy costs,"""
ERRORS = (1e-2, 1e-4, 1e-6, 1e-8)
"""and the angle errors [rad] it is told for."""
STEPS = tuple(0.25 / 2**k for k in range(13))
"""Their steps [s],"""
INTERPRETED = STEPS[:7]
"""and those of them that do not take long without a compiler."""
UNITS = ((1e6, "ms"), (1e3, "µs"), (1.0, "ns"))
"""Of times [ns]."""
EXPLODES, DIES = 2.0, 0.5
"""Energies above and below these multiples of the initial one."""
DAMPING = "linear+quadratic"
"""Of the model that is fitted to the recording."""


@dataclass(frozen=True)
class Chapter:
    """One part of the tour.

    Attributes:
        title: what it is about.
        text: paragraphs, with the numbers that were found.
        files: what was written.
    """

    title: str
    text: str
    files: tuple[Path, ...]


def demo(
    folder: str | Path, *, film: bool = True, progress: Progress | None = None, backend: Backend = "auto"
) -> Iterator[Chapter]:
    """The tour, chapter by chapter: each is yielded when its files are written, whole or not at all.

    The exercise with three Euler methods, ``exercise.png``; what accuracy costs, ``accuracy.png``; which effects a
    pendulum in water calls for, ``effects.png``; a simulated recording fitted, ``fit.png``; a controller that swings
    the bob up, ``swing_up.png``, and its film ``swing_up.mp4``.

    Args:
        folder: for the files.
        film: False leaves the film out.
        progress: called with the fraction done and what is being done.
        backend: "auto", "compiled" or "python".

    Raises OutputError where the folder cannot be written, SceneError or EngineError for arguments that cannot be.
    """
    tell, filmed = told_by(progress), truth(film, "film")
    resolve(backend)
    place = output_folder(folder)
    told: tuple[tuple[Callable[..., Chapter], float], ...] = (
        (exercise, 0.1), (accuracy, 0.2), (effects, 0.45), (recording, 0.55),
        (partial(swinging, film=filmed), 1.0),
    )
    return _chapters(told, place, tell, backend)


def _chapters(
    told: tuple[tuple[Callable[..., Chapter], float], ...], place: Path, tell: Progress, backend: Backend
) -> Iterator[Chapter]:
    begun = 0.0
    for chapter, ended in told:
        def share(done: float, what: str, low: float = begun, high: float = ended) -> None:
            tell(low + (high - low) * done, what)

        yield chapter(place, share, backend)
        begun = ended


def exercise(place: Path, tell: Progress, backend: Backend) -> Chapter:
    """What becomes of the energy in ten seconds under three Euler methods."""
    from pendulum_env import plots
    from pendulum_env.engine.rollout import rollout

    runs = {}
    for i, name in enumerate(EULERS):
        tell(i / 4.0, f"the exercise, {name}")
        runs[name] = rollout("exercise", damping="none", integrator=name, dt=0.01, duration=10.0, backend=backend)
    first = next(iter(runs.values()))
    tell(0.75, "drawing the exercise")
    made, rows = plots.figure(2)
    plots.angle(runs, axes=rows[0])
    plots.energy(runs, axes=rows[1])
    rows[1].set_title("", loc="left")
    if (legend := rows[1].get_legend()) is not None:
        legend.remove()
    body, start = first.scene.body, math.degrees(first.scene.run.angle)
    lines = [
        f"A bob of {1000.0 * body.mass:g} g hangs on a {body.suspension} of {body.length:g} m and is let go from "
        f"{start:.2g}°. Nothing takes its energy, so it ought to swing for ever. Three ways to take steps of "
        f"{first.dt:g} s, and what each has made of the energy after {first.time[-1]:g} s:",
        *(f"  {name:17} {ratio_text(run.energy[-1] / run.energy[0])}" for name, run in runs.items()),
        "The third differs from the first in one thing: it moves the bob with the new velocity, not the old one.",
    ]
    files = (_save(made, place / "exercise.png", scene=first.scene.to_dict(), method=list(runs), dt=first.dt),)
    return Chapter("Three ways to take a step", "\n".join(lines), files)


def ratio_text(ratio: float) -> str:
    """An energy over that of the start, and what that means."""
    said = "explodes" if ratio > EXPLODES else "dies" if ratio < DIES else "holds"
    return f"{said}: {ratio:.3g} times the energy it began with"


def accuracy(place: Path, tell: Progress, backend: Backend) -> Chapter:
    """The time per simulated second of three methods, for several errors."""
    from pendulum_env.plots.cost import draw
    from pendulum_env.study.cost.study import cost

    steps = STEPS if resolve(backend) == "compiled" else INTERPRETED
    study = cost("vacuum", PRICED, duration=10.0, steps=steps, tolerances=(), repeats=3, backend=backend,
                 progress=lambda done, what: tell(0.9 * done, f"what accuracy costs, {what}"))
    if not study.complete:
        raise KeyboardInterrupt
    tell(0.9, "drawing what accuracy costs")
    head = "".join(f"{f'1e{round(math.log10(error))} rad':>12}" for error in ERRORS)
    rows = [f"  {name:17}" + "".join(f"{price_text(study, name, error):>12}" for error in ERRORS) for name in PRICED]
    lines = [
        f"Let go from {study.angle:g} rad in vacuum, where the motion is known in closed form. What a simulated second "
        f"costs on this machine, if the angle may be off by so much within {study.duration:g} s:",
        f"  {'':17}{head}", *rows,
        study.sentence() + (f" A dash: even steps of {steps[-1]:.1g} s are too long." if "-" in "".join(rows) else ""),
    ]
    files = (_save(draw(study), place / "accuracy.png", scene=study.scene.to_dict(), method=list(PRICED)),)
    return Chapter("What accuracy costs", "\n".join(lines), files)


def price_text(study: CostStudy, method: str, error: float) -> str:
    """Time per simulated second of the cheapest run of a method with at most this error [rad]."""
    own = study.reference.error_estimate
    times = [point.ns_per_second for point in study.of(method) if point.angle_error + own <= error]
    least = min(times, default=math.inf)
    unit, name = next(((unit, name) for unit, name in UNITS if least >= unit), UNITS[-1])
    return f"{least / unit:.{0 if least >= 10.0 * unit else 1}f} {name}" if times else "-"


def effects(place: Path, tell: Progress, backend: Backend) -> Chapter:
    """Which effects a pendulum in water calls for."""
    from pendulum_env.plots.audit import draw
    from pendulum_env.study.audit.simplification import simplify

    amplitude, tolerance = math.radians(30.0), 0.003
    scene, report = simplify("water", amplitude, tolerance, backend=backend,
                             progress=lambda done, what: tell(0.95 * done, f"effects in water, {what}"))
    tell(0.95, "drawing the effects")
    full = report.audit.scene
    rows = {row.effect: row for row in report.audit.rows}
    lines = [
        f"The same ball in water, let go from {math.degrees(amplitude):.3g}°. Of the {len(full.effects)} effects in "
        f"that scene, which change the period or the amplitude by more than {100.0 * tolerance:g} %?",
        *(f"  {effect.name:17} period {_change(rows[effect.name].period_change)}, amplitude "
          f"{_change(rows[effect.name].amplitude_change)}  {rows[effect.name].verdict}" for effect in full.effects),
        f"{report.text} What is left is simulated, and nothing else: an effect that is not in a scene costs nothing.",
    ]
    files = (_save(draw(report.audit), place / "effects.png", scene=full.to_dict(), simplified=scene.to_dict()),)
    return Chapter("Only the effects that matter", "\n".join(lines), files)


def _change(value: float) -> str:
    return f"{100.0 * value:+7.2f} %" if math.isfinite(value) else f"{'-':>9}"


def recording(place: Path, tell: Progress, backend: Backend) -> Chapter:
    """Length and drag of the simulated recording, found again."""
    from pendulum_env.lab.fitting.fit import fit
    from pendulum_env.lab.simulated import SCENE, simulated_recording, true_scene
    from pendulum_env.plots import save
    from pendulum_env.plots.recorded import recorded
    from pendulum_env.study.fit_report import facts

    del backend
    swing, true = simulated_recording(), true_scene()
    found = fit(swing, DAMPING, mass=SCENE["mass"], radius=SCENE["radius"],
                progress=lambda done, what: tell(0.8 * done, f"fitting a recording, {what}"))
    tell(0.8, "drawing the fit")
    gamma = next(one for name, one in found.parameters.items() if name.endswith("gamma"))
    length = found.parameters["length"]
    lines = [
        f"A sensor's file of {len(swing.time)} readings in steps of {math.degrees(swing.quantum):.2g}°. It comes with "
        "the package and is simulated, so that what a fit ought to find is known. The whole swing is fitted at once:",
        f"  length  {length}, made with {true.body.length:g} m",
        f"  gamma   {gamma}, made with {SCENE['gamma']:g} 1/s",
        f"What the fit leaves over is {math.degrees(found.rms):.2g}° rms, as one reading scatters "
        f"({math.degrees(found.noise):.2g}°). With a file of your own: lab-pendulum fit FILE.",
    ]
    files = (save(recorded(found), place / "fit.png", {**facts(found), "Title": f"fit of {swing.source}"}),)
    return Chapter("From a recording to its pendulum", "\n".join(lines), files)


def swinging(place: Path, tell: Progress, backend: Backend, film: bool) -> Chapter:
    """A controller takes the bob to the top with a motor too weak to lift it, and holds it there."""
    from pendulum_env.study.demo.swing import draw, swung_up, write_swing

    tell(0.0, "swinging up")
    run = swung_up(backend=backend)
    files = [_save(draw(run), place / "swing_up.png", **run.facts)]
    if film:
        files.append(write_swing(run, place / "swing_up.mp4", lambda done, what: tell(0.05 + 0.95 * done, what)))
    tell(1.0, "done")
    if math.isinf(run.settled):
        raise SceneError(f"The controller did not swing the bob up within {run.time[-1]:g} s.")
    share, end = run.motor_torque / run.weight_torque, run.ledger
    lines = [
        f"The lab's motor gives {run.motor_torque:g} N m, {100.0 * share:.0f} % of what it takes to hold the bob "
        "sideways: it has to pump. A controller of energies does so until it is near the top, where a linear one takes "
        "over.",
        f"  turned round {run.swings} times, upright from {run.settled:.1f} s on",
        f"  work of the motor {1e3 * end.work[-1]:.1f} mJ, of which {1e3 * end.heat[-1]:.1f} mJ went into heat",
        f"  error of the integrator {abs(1e3 * end.residual[-1]):.1g} mJ, from a ledger of its own",
        "The film is at true speed." if film else "Without --no-film it is filmed.",
    ]
    return Chapter("A weak motor and a controller", "\n".join(lines), tuple(files))


def _save(made: Figure, path: Path, **known: Any) -> Path:
    from pendulum_env.plots import save

    return save(made, path, {**provenance(**known), "Title": path.stem})
