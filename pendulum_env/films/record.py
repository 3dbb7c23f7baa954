"""Films of runs as mp4 or gif, at true speed, slow motion or time lapse, of one run or of several side by side."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from integrators import METHODS, Method
from pendulum_env.common.progress import Progress, told_by, with_bar
from pendulum_env.common.provenance import checked_folder, output_folder, provenance
from pendulum_env.common.results import html_of
from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.machine import Machine
from pendulum_env.engine.spec import RunSpec, parted
from pendulum_env.engine.starts import checked_control, checked_steps, listed_methods
from pendulum_env.films.look import checked_look, checked_size
from pendulum_env.films.runs import NEAR, Track, drawn_large, instants, strip_span, track_of
from pendulum_env.physics.damping import Damping, build_scene
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, file_path, naming_keywords, number, several
from pendulum_env.render import FrameStyle, frame, palette, side_by_side, write_film
from pendulum_env.render.film import check_film
from pendulum_env.render.stage import DEFAULT

SceneLike = str | Scene | Mapping[str, object]

MOST_FRAMES = 200_000
"""Largest number of frames in a film."""
SLOWEST, FASTEST = 0.01, 1000.0
"""Smallest and largest number of frames per second in a film."""
MOST_PANELS = 16
"""Largest number of pendulums side by side."""


class Filmed(NamedTuple):
    """The path of a film, and the runs in it that stopped early. A notebook displays it as a player.

    Attributes:
        path: path of the film.
        stopped: caption -> reason and time of the end, for runs that ended early, as in "slack at 1.23 s".
    """

    path: Path
    stopped: dict[str, str]

    def _repr_html_(self) -> str:
        """Return a player of the film as HTML, with the film itself up to 5 MB, otherwise with a link to the file."""
        return html_of(self)


@with_bar("film")
def film(
    scenes: SceneLike | Sequence[SceneLike],
    path: str | Path,
    integrators: str | Method | Sequence[str | Method] = "rk4",
    *,
    damping: Damping = "scene",
    rtol: float | None = None,
    atol: float | None = None,
    backend: Backend = "auto",
    theme: str = "light",
    panels: Sequence[str] = DEFAULT,
    progress: Progress | bool | None = None,
    angle: float | None = None,
    velocity: float | None = None,
    duration: float | None = None,
    dt: float | None = None,
    control: float = 0.0,
    fps: float = 50.0,
    slow: float = 1.0,
    size: int | tuple[int, int] = 500,
    **parameters: Any,
) -> Filmed:
    """Write a film of one run, or of runs of several scenes and methods side by side::

        film("lab", "swing.mp4", slow=4.0, theme="dark", panels=("apparatus", "energy", "phase"))
        film("exercise", "euler.mp4", "forward_euler,symplectic_euler", duration=5.0, angle=1.0)

    The frames look like those that an environment renders, but where all swings stay below 30 degrees, the pendulum is
    drawn about twice as long and not with its full circle. Below several runs a strip shows their angles over the last
    ten seconds. To film an agent in an environment, use
    ``gymnasium.wrappers.RecordVideo``.

    Args:
        scenes: preset name, dict, Scene or a scene's JSON file; a list of them is shown side by side.
        path: path of the film, ending in .mp4 or .gif.
        integrators: names of methods, one string with commas between them, or one Method; every scene runs with each.
        damping: as :func:`pendulum_env.rollout`'s, of every scene.
        rtol, atol, backend: as :func:`pendulum_env.rollout`'s.
        theme, panels: as ``render_theme`` and ``render_panels`` of gym.make.
        progress: True shows a progress bar, False none; by default a notebook shows one for work over 1.5 s. A
            function is called with the fraction done and the present activity.
        angle, velocity, duration, dt, control, fps, slow, size: as :func:`record`'s.
        **parameters: as :func:`pendulum_env.rollout`'s, of every scene.

    Returns the path and the runs that stopped early. Warns as :func:`pendulum_env.rollout` does. Raises SceneError,
    MethodError or ValueError for invalid arguments, OSError where the film cannot be written.
    """
    listed = (scenes,) if isinstance(scenes, str | Scene | Mapping) else several(scenes, "scenes", "scenes")
    given, shared = parted(parameters)
    with naming_keywords(film):
        places = [build_scene(scene, damping, given) for scene in listed]
    specs = [RunSpec.of(place, method, backend=backend, rtol=rtol, atol=atol, **shared)
             for place in places for method in listed_methods(integrators)]
    return record([spec.machine() for spec in specs], path, angle=angle, velocity=velocity, duration=duration, dt=dt,
                  control=control, fps=fps, slow=slow, size=size, theme=theme, panels=panels, progress=progress,
                  **shared)


def record(
    machines: Machine | Sequence[Machine],
    path: str | Path,
    *,
    angle: float | None = None,
    velocity: float | None = None,
    duration: float | None = None,
    dt: float | None = None,
    control: float = 0.0,
    fps: float = 50.0,
    slow: float = 1.0,
    size: int | tuple[int, int] = 500,
    theme: str = "light",
    panels: Sequence[str] = DEFAULT,
    progress: Progress | bool | None = None,
    **shared: Any,
) -> Filmed:
    """Simulate and film one run or several; the film lasts ``duration`` times ``slow``, to within one frame.

    A run that ends early stands still from then on, and its caption says so.

    Args:
        machines: one machine (compiled program of a scene with a method), or several, which are shown side by side
            under one clock.
        path: path of the film, ending in .mp4 or .gif.
        angle, velocity: start [rad, rad/s]; by default that of the scene's usual run.
        duration: simulated time [s]; by default that of the usual run, or of the longest of several usual runs.
        dt: step of the integrator [s]; by default that of the usual run. Between steps, frames show the cubic Hermite
            interpolant of angles and velocities. An adaptive method divides dt into shorter steps that end at frames.
        control: constant torque over the motor's largest torque.
        fps: frames per second, 0.01 to 1000; a gif takes 100/n, n a whole number from 2 to 10000.
        slow: slow-motion factor; 4 is four times slower than true speed, 0.5 twice as fast.
        size: size of the frames in pixels, or (width, height); of several runs, the size of each.
        theme, panels: style of the frames, names from THEMES and PANELS of :mod:`pendulum_env.render`.
        progress: function that is called with the fraction done and the current task.
        **shared: keywords of all runs, such as ``warn=False``; see
            :class:`pendulum_env.engine.settings.CommonSettings`.

    Returns the path and the runs that stopped early. Warns as :func:`pendulum_env.rollout` does. Raises SceneError or
    ValueError for values out of range, OSError where the film cannot be written.
    """
    tell, look = told_by(progress), checked_look(theme, panels, ("energy",), "")
    listed = [machines] if isinstance(machines, Machine) else [*machines]
    if not 0 < len(listed) <= MOST_PANELS:
        raise SceneError(f"A film shows 1 to {MOST_PANELS} runs side by side, not {len(listed)}.")
    captions = _captions(listed)
    target = file_path(path, "path")
    checked_folder(target.parent)
    rate = number(fps, "fps", above=0.0, unit="1/s") * number(slow, "slow", above=0.0)
    rate = number(rate, "fps times slow", above=0.0, unit="1/s")
    usual = max(machine.scene.run.duration for machine in listed)
    length = number(usual if duration is None else duration, "duration", above=0.0, unit="s")
    if not length * rate < MOST_FRAMES + 0.5:
        raise SceneError(
            f"A film of {length * rate:.7g} frames is too long, at most {MOST_FRAMES}; use a shorter duration, "
            "or lower fps or slow."
        )
    if not SLOWEST <= fps <= FASTEST:
        raise SceneError(f"fps must be within {SLOWEST:g} and {FASTEST:g} 1/s, not {fps:g}.")
    side = checked_size(size, "size")
    time = np.arange(max(1, round(length * rate))) / rate
    specs = [_described(machine, dt, rate, len(time), control, angle=angle, velocity=velocity, **shared)
             for machine in listed]
    try:
        check_film(target, fps)
    except ValueError as error:
        raise SceneError(f"A{str(error)[1:]}.") from None
    speed = f"{slow:g} times slower" if slow > 1.0 else f"{1.0 / slow:.3g} times faster" if slow < 1.0 else ""
    alike = {machine.scene.name for machine in listed} if len(_scenes(listed)) == 1 else ()
    title = ", ".join((*alike, *_steps_in_title(listed, specs), *([speed] if speed else [])))
    tones = _tones(listed)
    tracks = [track_of(spec, machine, time, look, label=caption, title=title, accent=tone)
              for spec, machine, caption, tone in zip(specs, listed, captions, tones, strict=True)]
    output_folder(target.parent)
    scenes = [machine.scene.to_dict() for machine in listed]
    steps = [spec.h for spec in specs]
    facts = provenance(scene=_one(scenes), method=_one([machine.label for machine in listed]), dt=_one(steps), fps=fps,
                       slow=slow, **listed[0].tolerance)
    written = write_film(
        target, _frames(tracks, time, side, look), fps, metadata=facts, total=len(time),
        progress=lambda done, total: tell(done / len(time), "filming" if done < len(time) else "writing"),
    )
    return Filmed(written, {
        track.label: f"{track.reason} at {track.end:.3g} s" for track in tracks if track.end < time[-1]})


def _described(machine: Machine, dt: Any, rate: float, count: int, control: Any, **more: Any) -> RunSpec:
    """Return the specification of the run that gives a film's ``count`` frames; SceneError for invalid values."""
    scene = machine.scene
    h, every = _stepping(number(scene.run.dt if dt is None else dt, "dt", above=0.0, unit="s"), rate, count, machine)
    if checked_control(control) and not any(effect.controlled for effect in scene.effects):
        raise SceneError(f"The scene '{scene.name}' has no motor to control; leave control out.")
    spec = RunSpec.of_machine(machine, dt=h, duration=count / rate, every=every, control=control, **more)
    if spec.shape:
        raise SceneError("A film shows one run per method; angle and velocity must be single numbers, not arrays.")
    return spec


def _stepping(dt: float, rate: float, count: int, machine: Machine) -> tuple[float, int]:
    """Return the step [s] and the number of steps between recorded states, for a film of ``count`` frames.

    If a step ends at every frame's instant, the states at these instants are recorded. Otherwise the state after every
    step is recorded; of a very long run fewer, but at least one for every frame.
    """
    every = checked_steps(1.0 / rate, dt)
    if machine.tolerance or abs(every * dt * rate - 1.0) < NEAR:
        return 1.0 / rate / every, every
    return dt, min(max(1, every - 1), -(-checked_steps(count / rate, dt) // MOST_FRAMES))


def _steps_in_title(machines: Sequence[Machine], specs: Sequence[RunSpec]) -> list[str]:
    """Return the step or tolerance of several runs as text for the film's title, in a list of one.

    The list is empty if the steps differ, or if there is only one run.
    """
    steps = {f"rtol = {machine.tolerance['rtol']:g}" if machine.tolerance else f"dt = {spec.h:.6g} s"
             for machine, spec in zip(machines, specs, strict=True)}
    return [*steps] if len(steps) == 1 < len(machines) else []


def _scenes(machines: Sequence[Machine]) -> list[Scene]:
    """Return the scenes of a list of machines (scene and method), each scene once, in order of appearance."""
    scenes: list[Scene] = []
    for machine in machines:
        scenes += [machine.scene] if machine.scene not in scenes else []
    return scenes


def _captions(machines: Sequence[Machine]) -> list[str]:
    """Return a caption for every run of a film: the name of its method, and that of its scene if there are several.

    Raises SceneError if two runs have the same caption.
    """
    scenes, called = _scenes(machines), []
    for i, scene in enumerate(scenes):
        before = sum(other.name == scene.name for other in scenes[:i])
        called.append(f"{scene.name} ({before + 1})" if before else scene.name)
    captions = [f"{called[scenes.index(machine.scene)]} · {machine.label}" if len(scenes) > 1 else machine.label
                for machine in machines]
    for i, caption in enumerate(captions):
        if caption in captions[:i]:
            raise SceneError(f"{caption} is listed twice; a film can show a method in a scene only once.")
    return captions


def _tones(machines: Sequence[Machine]) -> list[str | None]:
    """Return the colours of the bobs of several runs: those that a figure of these methods has.

    If all methods are equal, each colour is None, which stands for the default.
    """
    if len({machine.method.name for machine in machines}) == 1:
        return [None] * len(machines)
    places = [palette.place(machine.method.name, list(METHODS)) for machine in machines]
    tones = palette.colours(places)
    return [tones[place] for place in places]


def _one(values: list[Any]) -> Any:
    """Return the first value if all values are equal, otherwise the list of values."""
    return values[0] if all(value == values[0] for value in values) else values


def _frames(tracks: Sequence[Track], time: NDArray[np.float64], size: tuple[int, int],
            look: FrameStyle) -> Iterator[Any]:
    """Yield the frames of a film one after the other; when all runs have stopped, their last frame is repeated."""
    last: Any = None
    for shown in instants(drawn_large(tracks), time, "past" in look.needs or len(tracks) > 1):
        if last is None or shown is not last[0]:
            last = shown, (side_by_side(shown, size, look=look, strip=strip_span(time)) if len(shown) > 1 else
                           frame(*shown[0], size=size, look=look))
        yield last[1]
