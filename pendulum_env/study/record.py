"""A rollout as a film: mp4 or gif, at true speed or in slow motion."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.engine.machine import ANGLE, TURNS, TWO_PI, Machine
from pendulum_env.engine.starts import checked_control, checked_start, checked_steps
from pendulum_env.engine.trajectory import simulate
from pendulum_env.physics.units import SceneError, file_path, number
from pendulum_env.picture import TRAIL_SECONDS, apparatus, view
from pendulum_env.progress import Progress, told_by
from pendulum_env.provenance import output_folder, provenance
from pendulum_env.render import frame, write_film

MOST_FRAMES = 200_000


def record(
    machine: Machine,
    path: str | Path,
    *,
    angle: float | None = None,
    velocity: float | None = None,
    duration: float | None = None,
    dt: float | None = None,
    control: float = 0.0,
    fps: float = 50.0,
    slow: float = 1.0,
    size: int = 500,
    progress: Progress | None = None,
) -> tuple[Path, str]:
    """Film a run of a machine; the film lasts the simulated time, times ``slow``, within one frame.

    Args:
        machine: scene and method.
        path: ending in .mp4 or .gif.
        angle, velocity, duration, dt: start and length of the run, by default the scene's usual run.
            The step is shortened so that every frame falls on a step; a machine with a tolerance takes it in several.
        control: constant share of the motor's torque.
        fps: frames per second; a gif takes 50 or 25.
        slow: slow-motion factor, at least 1 slows.
        size: of the square frames, in pixels.
        progress: called with the fraction done.

    Returns the path and the reason why the run stopped, "" if it did not. Raises SceneError for values out of range,
    OSError where the film cannot be written.
    """
    run, tell = machine.scene.run, told_by(progress)
    rate = number(fps, "fps", above=0.0, unit="1/s") * number(slow, "slow", above=0.0)
    rate = number(rate, "fps times slow", above=0.0, unit="1/s")
    length = number(run.duration if duration is None else duration, "duration", above=0.0, unit="s")
    wanted = number(run.dt if dt is None else dt, "dt", above=0.0, unit="s")
    if not length * rate < MOST_FRAMES + 0.5:
        raise SceneError(
            f"A film of {length * rate:.7g} frames is too long, at most {MOST_FRAMES}; shorten the duration or lower "
            "fps or slow."
        )
    frames = max(1, round(length * rate))
    every = checked_steps(1.0 / rate, wanted)
    h = 1.0 / rate / every
    checked_steps(frames / rate, h)
    share = checked_control(control)
    if share and not any(effect.controlled for effect in machine.scene.effects):
        raise SceneError(f"The scene '{machine.scene.name}' has no motor that takes a control; leave control out.")
    q, v = checked_start(
        machine.scene, run.angle if angle is None else angle, run.velocity if velocity is None else velocity
    )
    if q.ndim:
        raise SceneError("A film shows one run; angle and velocity must be numbers, not arrays.")
    states, reason = simulate(machine, float(q), float(v), h=h, rows=frames, every=every, control=share)
    target = file_path(path, "path")
    output_folder(target.parent)
    facts = provenance(scene=machine.scene.to_dict(), method=machine.label, dt=h, fps=fps, slow=slow,
                       **machine.tolerance)
    written = write_film(
        target, _frames(machine, states, h, rate, size, share), fps, metadata=facts, total=len(states),
        progress=lambda done, total: tell(done / len(states), "filming"),
    )
    return written, reason


def _frames(
    machine: Machine, states: NDArray[np.float64], h: float, rate: float, size: int, control: float
) -> Iterator[Any]:
    """The pictures of a run, one after the other."""
    thing = apparatus(machine.scene)
    initial = float(machine.ledger(states[0], 0.0).energy)
    angles = states[:, ANGLE] + TWO_PI * states[:, TURNS]
    length = max(1, math.ceil(TRAIL_SECONDS * rate))
    for i, state in enumerate(states):
        trail = tuple(float(value) for value in angles[max(0, i - length) : i])
        times = (k / rate for k in range(max(0, i - length), i))
        yield frame(thing, view(machine, state.tolist(), h, initial, control, trail, times), size=size)
