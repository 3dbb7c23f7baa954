"""Last chapter of the tour: a controlled swing-up, its figure and its film."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.progress import Progress
from pendulum_env.common.provenance import provenance
from pendulum_env.controllers import SwingUp
from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.machine import ANGLE, NOWHERE, TURNS, TWO_PI, UNSEEN, VELOCITY, Machine
from pendulum_env.engine.spec import RunSpec
from pendulum_env.films.orbit import curves
from pendulum_env.films.picture import TRAIL_SECONDS, Facts, apparatus, view
from pendulum_env.films.reel import motion
from pendulum_env.physics.effects import Motor
from pendulum_env.physics.energy import Ledger
from pendulum_env.render import FrameStyle, PastSamples, frame, write_film

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
