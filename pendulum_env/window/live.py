"""Live window of one pendulum or several: shows their frames in real time and carries out a person's requests."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from integrators import MethodError
from pendulum_env.common.checks import warn
from pendulum_env.common.provenance import output_folder, provenance
from pendulum_env.common.replacing import replacing
from pendulum_env.physics.units import SceneError
from pendulum_env.render import Apparatus, View, frame
from pendulum_env.render.bars import joules
from pendulum_env.render.notes import Sheet, sheet_around, with_list
from pendulum_env.render.paint import Image
from pendulum_env.render.panel import staged
from pendulum_env.render.stand import Stand
from pendulum_env.render.strip import shared_scale
from pendulum_env.render.view import between
from pendulum_env.window import screen
from pendulum_env.window.controls import KEYS, Controls, Grip, NewStep, PressWatch, Switch, TakePicture, Wish
from pendulum_env.window.shown import Shown

FRAME = 1.0 / 60.0
"""Smallest time between frames [s]."""
LATE = 0.25
"""Delay [s] from which the window no longer tries to catch up with real time."""
HINTS = (
    "Space pause · 1 to 5 integrators · D smaller dt · R restart · H keys",
    "Space pause · 1 to 5 integrators · H keys", "Space pause · H keys", "H keys",
)
"""Hints on keys, of which the status line shows the longest that fits."""
FOLDER = Path("out/show")
"""Folder of saved pictures."""
NAME = 200
"""Largest number of bytes of a saved picture's name; file systems allow 255, with the ending."""
MOUSE = ("press", "move", "release")
"""Events of :meth:`pendulum_env.window.screen.Screen.happened` that are handled with their time."""
START, METHOD = "start", "integrator"
"""Words in ``info["by_hand"]`` after a person has changed the start or the integrator."""


class FrameSchedule:
    """Schedule of the window's frames in real time; callers pass the present time of the clock [s].

    Each step begins at the scheduled end of the last step, so that delays do not add up.
    """

    def __init__(self) -> None:
        self._due = self._next = self._last = -1e300

    def frames(self, now: float, span: float) -> list[tuple[float, float]]:
        """Return the frames to show for a control step that lasts ``span`` [s] of real time.

        The step begins at the scheduled end of the last one, or at ``now`` [s]. A frame is a pair: the fraction of the
        step, and the time at which it is due. The last frame is at the step's end. A step longer than 1/60 s has
        several; a step has none if its frame would follow the last too soon, or if the window is late: then steps
        without frames catch up with real time, for at most ``LATE``.
        """
        start = self._due if self._due > now - LATE else now
        self._due = end = start + span
        if end < self._next or (end < now < self._last + LATE):
            return []
        self._last = now
        self._next = max(self._next, start) + FRAME if span < FRAME else end
        count = max(1, round(span / FRAME))
        return [(k / count, start + span * k / count) for k in range(1, count + 1)]

    @property
    def due(self) -> float:
        """Scheduled end of the last control step [s], on the clock."""
        return self._due

    def hold(self, now: float) -> None:
        """Restart the schedule at ``now`` [s], after the simulation has waited."""
        self._due = self._next = now


class Stopwatch:
    """Stopwatch on the pendulum's own time, so that slow motion and pauses do not falsify it."""

    def __init__(self) -> None:
        self._start: float | None = None
        self._stop: float | None = None

    def press(self, time: float) -> None:
        """Start the stopwatch at ``time`` [s], stop it, or set it to zero, in this order."""
        if self._start is None:
            self._start = time
        elif self._stop is None:
            self._stop = time
        else:
            self._start = self._stop = None

    def reading(self, time: float) -> str:
        """Return the reading at ``time`` [s] as text; "" before the stopwatch has started."""
        if self._start is None:
            return ""
        return f"stopwatch {(time if self._stop is None else self._stop) - self._start:.2f} s"


class Live:
    """Window of an environment with ``render_mode="human"``, or of several pendulums side by side under one clock.

    The window of an environment opens with its first reset. ``reset`` and ``step`` show a frame. ``step`` returns when
    ``dt`` has passed in real time, at the chosen playback speed, or at once if the program is late. Before a step, the
    person's requests are carried out, and the environment waits during a pause (until the person continues or takes a
    single step) and while the mouse holds the bob. After a request, ``info["by_hand"]`` of the step is "start" if the
    state was set (time, work and heat then begin at 0, as in a reset), "integrator" if the method was changed (time,
    work and heat continue), or "start, integrator"; without a request, and after a reset, it is "". Gymnasium's
    TimeLimit counts steps as usual.

    After the window was closed, the environment warns once and continues without it, as fast as it can.

    Of several pendulums, all have the same ``dt`` and start together; the keys of integrators change the pendulum under
    the mouse.

    Args:
        shown: interfaces of the pendulums.
        size: width and height of the window [px]; by default those of one pendulum's frame with its status line.
        new_step: function that returns the interfaces of the pendulums with ``factor`` times the step, not yet started;
            it raises SceneError for a step that is not allowed. None where the step is fixed.

    Attributes:
        open: False after the window was closed.
        push: motor torque that the arrow keys request, for programs that pass it to ``step``.
        start: start of the last run, as options of ``reset``.
        controls: state of the controls; see :class:`pendulum_env.window.controls.Controls`.
        size: width and height of a pendulum's frame [px].
        watch: the stopwatch.
        drawn: drawing data of the pendulums in the last picture.
        folder: folder of saved pictures.
        screen: window of pygame; None while it is not open.

    Raises WindowError at the first reset if no window can be opened; warns if the window is not visible.
    """

    screen: screen.Screen | None = None

    def __init__(self, *shown: Shown, size: tuple[int, int] | None = None,
                 new_step: Callable[[float], Sequence[Shown]] | None = None) -> None:
        self.controls, self.watch, self.folder = Controls(), Stopwatch(), FOLDER
        self._pendulums, self._pace = shown, FrameSchedule()
        self._window_size, self._new_step = size, new_step
        self._start = (0.0, 0.0)
        self._wishes: list[Wish] = []
        self._done: list[str] = []
        self._shown: list[View] | None = None
        self.drawn: list[View] = []
        self._picture: Image | None = None
        self._warned = False

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes for a copy or a pickle, which needs :meth:`show` to get a window of its own."""
        own = {name: value for name, value in vars(self).items() if name not in ("screen", "_pendulums")}
        return {**own, "_wishes": [], "_pace": FrameSchedule(), "_picture": None}

    def show(self, *shown: Shown) -> None:
        """Show other pendulums in this window, given by their interfaces for windows."""
        self._pendulums, self._shown, self.drawn = shown, None, []

    @property
    def open(self) -> bool:
        """True until the window is closed."""
        return self.controls.open

    @property
    def push(self) -> float:
        """Fraction of the motor's torque that the keys Left and Right request: -1, 0 or 1."""
        return self.controls.push

    @property
    def start(self) -> dict[str, float]:
        """Start of the last run, as options of ``reset``: angle [rad] and velocity [rad/s]."""
        return dict(zip(("angle", "velocity"), self._start, strict=True))

    @property
    def sheet(self) -> Sheet:
        """Division of the window into frames, readings and status line."""
        count, readings = len(self._pendulums), len(_readings(self.drawn)[0]) if self.drawn else 0
        if self.screen is not None:
            return Sheet(*self.screen.size, count, readings)
        if self._window_size is not None:
            return Sheet(*self._window_size, count, readings)
        return sheet_around(self._pendulums[0].size, readings)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the frame of a pendulum in the window [px]."""
        return self.sheet.frame

    def grip(self, place: int = 0) -> Grip | None:
        """Return the position of a pendulum's bob, at which the mouse can grip it; None if no panel shows it.

        ``place`` is the pendulum's index.
        """
        if place >= len(self.drawn):
            return None
        view, shown, sheet = self.drawn[place], self._pendulums[place], self.sheet
        panels = staged(self._apparatus(shown), view, sheet.frame, shown.look).panels
        at = next((panel for panel in panels if isinstance(panel, Stand)), None)
        if at is None:
            return None
        x, y = sheet.corner(place)
        pivot, bob = ((x + own[0], y + own[1]) for own in at.places(view))
        return Grip(pivot, bob, at.bob)

    # --- called by the environment -----------------------------------------------------------------------------

    def began(self, angle: float, velocity: float) -> None:
        """Remember the start of an episode [rad, rad/s], to which the key R returns, and show it."""
        self._start, self.watch = (angle, velocity), Stopwatch()
        self.look()

    def restart(self, angle: float | None = None, velocity: float = 0.0) -> None:
        """Restart all pendulums from an angle [rad] and a velocity [rad/s], or from the last start without an angle.

        Raises SceneError for a start that is not allowed.
        """
        start = self._start if angle is None else (angle, velocity)
        for pendulum in self._pendulums:
            pendulum.start(*start)
        self.began(*start)

    def attend(self) -> None:
        """Carry out the requests that the person made at the window, before a step, and wait during a pause."""
        if not self.open:
            self._warn_once()
            return
        self._listen()
        self._carry_out()
        waited = self.controls.waits
        while self.controls.waits:
            self.look()
            screen.sleep(FRAME)
            self._listen()
            self._carry_out()
        if waited:
            self._pace.hold(screen.now())
        self.controls.steps = max(0, self.controls.steps - 1)

    def present(self, info: dict[str, Any] | None = None) -> None:
        """Show the frames of a finished control step, each at its time.

        Changes that the person made are added to ``info``.
        """
        if info is not None:
            info["by_hand"] = ", ".join(name for name in (START, METHOD) if name in self._done)
        self._done = []
        if not self.open:
            return
        frames = self._pace.frames(screen.now(), self._pendulums[0].dt / self.controls.rate)
        first, self._shown = self._shown, self._views() if frames else None
        for share, due in frames:
            if share < 1.0 and screen.now() > due + FRAME:  # late: only the last frame is shown
                continue
            screen.sleep(max(0.0, due - screen.now()))
            self._draw(self._at(share, first))
            self._listen()
            if self.controls.waits or not self.open:
                break

    def look(self) -> None:
        """Show the present state of the pendulums in the window."""
        if self.open:
            self._shown = self._views()
            self._draw(self._shown)

    def close(self) -> None:
        """Close the window, which opens again with the next reset unless a person has closed it for good."""
        if self.screen is not None:
            self.screen.close()
            self.screen = None

    # --- parts --------------------------------------------------------------------------------------------------

    def _warn_once(self) -> None:
        if not self._warned:
            self._warned = True
            warn("The window was closed; the environment continues without it, as fast as it can.")

    def _views(self) -> list[View]:
        """Return the drawing data of the present states."""
        return [pendulum.view() for pendulum in self._pendulums]

    def _at(self, share: float, first: list[View] | None) -> list[View]:
        """Return the drawing data at a fraction of the last control step, between its start ``first`` and its end.

        Where ``first`` is not the state one step earlier, the result is the state at the step's end.
        """
        assert self._shown is not None
        if first is None or len(first) != len(self._shown):
            return self._shown
        dt = self._pendulums[0].dt
        return [between(before, last, share) if 0.5 < (last.time - before.time) / dt < 1.5 else last
                for before, last in zip(first, self._shown, strict=True)]

    def _apparatus(self, shown: Shown) -> Apparatus:
        """Return the apparatus to draw; several pendulums have the scene's name in the window's title only."""
        return shown.apparatus if len(self._pendulums) == 1 else replace(shown.apparatus, title="")

    def _draw(self, views: list[View]) -> None:
        """Draw the window's picture, and show it; the window opens with the first picture."""
        if len(views) > 1 and "residual" in self._pendulums[0].look.panels:
            views = [replace(view, residual_scale=shared_scale(views)) for view in views]
        self.drawn = views
        sheet, controls = self.sheet, self.controls
        if self.screen is None:
            self.screen = screen.Screen(f"LabPendulum: {self._pendulums[0].apparatus.title}",
                                        (sheet.width, sheet.height))
            sheet = self.sheet
        theme, time = self._pendulums[0].look.theme, max(view.time for view in views)
        name = _name(views[0]) if len(views) == 1 else ""
        parts = (name, f"dt = {self._pendulums[0].dt:g} s", self.watch.reading(time), controls.status())
        frames = [frame(self._apparatus(shown), view, size=sheet.frame, look=shown.look)
                  for shown, view in zip(self._pendulums, views, strict=True)]
        self._picture = picture = sheet.picture(frames, _readings(views),
                                                " · ".join(filter(None, parts)), HINTS, theme)
        if controls.listed:
            picture = with_list(picture, [(key.shown, key.does) for key in KEYS], theme)
        if not self.screen.present(picture):
            self._gone()

    def _gone(self) -> None:
        """Close the window for good, after the person has closed it; no later reset opens it."""
        self.controls.close()
        self.close()

    def _listen(self) -> None:
        """Handle the window's keyboard and mouse events since the last call, and collect the requests that they make.
        """
        if self.screen is None:
            return
        for event, *arguments in self.screen.happened():
            time = (screen.now(),) if event in MOUSE else ()
            grip = (self.grip(self.sheet.place(*arguments)),) if event == "press" else ()
            self._wishes += getattr(self.controls, event)(*arguments, *time, *grip) or ()
        if not self.open:
            self._gone()

    def _carry_out(self) -> None:
        """Carry out the collected requests of the person."""
        wishes, self._wishes = self._wishes, []
        for wish in wishes if self.open else ():
            try:
                if isinstance(wish, Switch):
                    self._switch(wish.to)
                elif isinstance(wish, NewStep):
                    self._change_step(wish.factor)
                elif isinstance(wish, PressWatch):
                    self.watch.press(max(view.time for view in self._views()))
                elif isinstance(wish, TakePicture):
                    self.controls.message = f"saved {self.save_picture()}"
                else:
                    self.restart(wish.angle, wish.velocity)
                    self._done.append(START)
            except (SceneError, MethodError, OSError) as error:
                self.controls.message = str(error)

    def _switch(self, to: str | int) -> None:
        """Change the integrator of the pendulum under the mouse, and continue from the present state."""
        controls = self.controls
        pendulum = self._pendulums[self.sheet.place(*controls.pointer)]
        machine = pendulum.another(to)
        if machine is None:
            controls.message = f"{to} already runs" if isinstance(to, str) else "no other integrator fits the scene"
            return
        if not machine.ready:
            controls.message = f"compiling {machine.method.name}"
            self.look()
        pendulum.take(machine)
        controls.message = ""
        self._done.append(METHOD)
        self.look()

    def _change_step(self, factor: float) -> None:
        """Restart from the last start with ``factor`` times the step."""
        if self._new_step is None:
            self.controls.message = "dt is fixed here; lab-pendulum show can change it"
            return
        self.show(*self._new_step(factor))
        self._pace.hold(screen.now())
        self.restart()

    def save_picture(self) -> Path:
        """Save the window's picture as PNG into ``folder``, with its provenance; return the path of the new file.

        No file is replaced. Raises OutputError if the file cannot be written.
        """
        import PIL.Image  # loaded with the first picture: starts of the package do without
        from PIL.PngImagePlugin import PngInfo

        if self._picture is None:
            self.look()
        assert self._picture is not None
        facts = [pendulum.facts() for pendulum in self._pendulums]
        one = {name: values[0] if all(value == values[0] for value in values) else values
               for name in facts[0] for values in [[fact[name] for fact in facts]]}
        time, (angle, velocity) = max(view.time for view in self.drawn), self._start
        methods = [str(fact["method"]).split()[0] for fact in facts]
        name = re.sub(r"[^\w.-]+", "_", f"{self._pendulums[0].apparatus.title}_{'_'.join(methods)}_{time:.2f}s")
        name = name.encode()[:NAME].decode(errors="ignore")
        folder, count = output_folder(self.folder), 1
        while (path := folder / f"{name}{f'_{count}' if count > 1 else ''}.png").exists():
            count += 1
        texts = PngInfo()
        for key, text in provenance(**one, time=time, start_angle=angle, start_velocity=velocity).items():
            texts.add_text(key, text)
        with replacing(path) as temporary:
            PIL.Image.fromarray(self._picture).save(temporary, "png", pnginfo=texts)
        return path


def _name(view: View) -> str:
    """Return the name of a pendulum's integrator, without notes such as "+ exact drag flow"."""
    return view.caption.partition(" ")[0]


def _readings(views: Sequence[View]) -> list[list[str]]:
    """Return the readings of every pendulum: energy and residual, if they are known, and its method beside others."""
    if views[0].residual is None:
        return [[_name(view)] if len(views) > 1 else [] for view in views]
    return [([_name(view)] if len(views) > 1 else []) + [
        f"energy {joules(view.kinetic + view.potential)}", f"residual {joules(view.residual or 0.0)}"]
        for view in views]
