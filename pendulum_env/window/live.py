"""Live window of an environment: shows its frames in real time and carries out a person's requests."""

from __future__ import annotations

from typing import Any

from pendulum_env.common.warn import warn
from pendulum_env.physics.units import SceneError
from pendulum_env.render import View, frame
from pendulum_env.render.layout import LEAST, MOST
from pendulum_env.render.notes import line_height, with_line, with_list
from pendulum_env.render.panel import staged
from pendulum_env.render.stand import Stand
from pendulum_env.render.view import between
from pendulum_env.window import screen
from pendulum_env.window.controls import KEYS, Controls, Grip, Switch, Wish
from pendulum_env.window.shown import Shown

FRAME = 1.0 / 60.0
"""Smallest time between frames [s]."""
LATE = 0.1
"""Delay [s] from which the window no longer tries to catch up with real time."""
HINTS = (
    "Space pause · S step · Tab integrator · drag the bob or type an angle · H keys",
    "Space pause · S step · Tab integrator · H keys", "Space pause · H keys", "H keys",
)
"""Hints on keys, of which the status line shows the longest that fits."""
MOUSE = ("press", "move", "release")
"""Events of :meth:`pendulum_env.window.screen.Screen.happened` that are handled with their time."""
START, METHOD = "start", "integrator"
"""Words in ``info["by_hand"]`` after a person has changed the start or the integrator."""


class FrameSchedule:
    """Schedule of the window's frames in real time; callers pass the present time of the clock [s].

    Each step begins at the scheduled end of the last step, so that delays do not add up.
    """

    def __init__(self) -> None:
        self._due = self._next = -1e300

    def frames(self, now: float, span: float) -> list[tuple[float, float]]:
        """Return the frames to show for a control step that lasts ``span`` [s] of real time.

        The step begins at the scheduled end of the last one, or at ``now`` [s]. A frame is a pair: the fraction of the
        step, and the time at which it is due. The last frame is at the step's end. A step longer than 1/60 s has
        several; a step has none if its frame would follow the last too soon.
        """
        start = self._due if self._due > now - LATE else now
        self._due = end = start + span
        if end < self._next:
            return []
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


class Live:
    """Window of an environment with ``render_mode="human"``, which opens with the first reset.

    ``reset`` and ``step`` show a frame. ``step`` returns when ``dt`` has passed in real time, at the chosen playback
    speed, or at once if the program is late. Before a step, the person's requests are carried out, and the environment
    waits during a pause (until the person continues or takes a single step) and while the mouse holds the bob. After
    a request, ``info["by_hand"]`` of the step is "start" if the state was set (time, work and heat then begin at 0, as
    in a reset), "integrator" if the method was changed (time, work and heat continue), or "start, integrator".
    Gymnasium's TimeLimit counts steps as usual.

    After the window was closed, the environment warns once and continues without it, as fast as it can.

    Attributes:
        open: False after the window was closed.
        push: motor torque that the arrow keys request, for programs that pass it to ``step``.
        start: start of the last run, as options of ``reset``.
        controls: state of the controls; see :class:`pendulum_env.window.controls.Controls`.
        size: width and height of the frame [px].
        screen: window of pygame; None while it is not open.

    Raises WindowError at the first reset if no window can be opened; warns if the window is not visible.
    """

    screen: screen.Screen | None = None

    def __init__(self, shown: Shown) -> None:
        self.controls = Controls()
        self._pendulum, self._pace = shown, FrameSchedule()
        self._start = (0.0, 0.0)
        self._wishes: list[Wish] = []
        self._done: list[str] = []
        self._shown: View | None = None
        self._drawn: View | None = None
        self._warned = False

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes for a copy or a pickle, which needs :meth:`show` to get a window of its own."""
        own = {name: value for name, value in vars(self).items() if name not in ("screen", "_pendulum")}
        return {**own, "_wishes": [], "_pace": FrameSchedule()}

    def show(self, shown: Shown) -> None:
        """Show another pendulum in this window, given by its interface for windows."""
        self._pendulum = shown

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
    def size(self) -> tuple[int, int]:
        """Width and height of the frame in the window [px]."""
        if self.screen is None:
            return self._pendulum.size
        width, height = self.screen.size
        return _clamped(width), _clamped(height - line_height(_clamped(width)))

    def grip(self) -> Grip | None:
        """Return the bob's position in the shown frame, at which the mouse can grip it; None if no panel shows it."""
        if self._drawn is None:
            return None
        panels = staged(self._pendulum.apparatus, self._drawn, self.size, self._pendulum.look).panels
        at = next((panel for panel in panels if isinstance(panel, Stand)), None)
        return None if at is None else Grip(*at.places(self._drawn), at.bob)

    # --- called by the environment -----------------------------------------------------------------------------

    def began(self, angle: float, velocity: float) -> None:
        """Remember the start of an episode [rad, rad/s], to which the key R returns, and show it."""
        self._start = angle, velocity
        self.look()

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

    def present(self, info: dict[str, Any]) -> None:
        """Show the frames of a finished control step, each at its time.

        Changes that the person made are added to ``info``.
        """
        if self._done:
            info["by_hand"] = ", ".join(name for name in (START, METHOD) if name in self._done)
            self._done = []
        if not self.open:
            return
        frames = self._pace.frames(screen.now(), self._pendulum.dt / self.controls.rate)
        first, self._shown = self._shown, self._pendulum.view() if frames else None
        for share, due in frames:
            screen.sleep(max(0.0, due - screen.now()))
            self._draw(self._at(share, first))
            self._listen()
            if self.controls.waits or not self.open:
                break

    def look(self) -> None:
        """Show the present state of the pendulum in the window."""
        if self.open:
            self._shown = self._pendulum.view()
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

    def _at(self, share: float, first: View | None) -> View:
        """Return the drawing data at a fraction of the last control step, between its start ``first`` and its end.

        If ``first`` is not the state one step earlier, the result is the state at the step's end.
        """
        last = self._shown
        assert last is not None
        known = first is not None and 0.5 < (last.time - first.time) / self._pendulum.dt < 1.5
        return between(first, last, share) if known and first is not None else last

    def _draw(self, view: View) -> None:
        apparatus, look, controls = self._pendulum.apparatus, self._pendulum.look, self.controls
        if self.screen is None:
            width, height = self._pendulum.size
            self.screen = screen.Screen(f"LabPendulum: {apparatus.title}", (width, height + line_height(width)))
        self._drawn = view
        picture = frame(apparatus, view, size=self.size, look=look)
        if controls.listed:
            picture = with_list(picture, KEYS, look.theme)
        if not self.screen.present(with_line(picture, controls.status(), HINTS, look.theme)):
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
            grip = (self.grip(),) if event == "press" else ()
            self._wishes += getattr(self.controls, event)(*arguments, *time, *grip) or ()
        if not self.open:
            self._gone()

    def _carry_out(self) -> None:
        """Carry out the collected requests of the person: restart, or change the integrator."""
        wishes, self._wishes = self._wishes, []
        for wish in wishes if self.open else ():
            if isinstance(wish, Switch):
                self._switch(wish.by)
                continue
            start = self._start if wish.angle is None else (wish.angle, wish.velocity)
            try:
                self._pendulum.start(*start)
            except SceneError as error:
                self.controls.message = str(error)
                continue
            self._done.append(START)

    def _switch(self, by: int) -> None:
        """Change to the integrator ``by`` places later in the list, and continue from the present state."""
        controls, machine = self.controls, self._pendulum.another(by)
        if machine is None:
            controls.message = "no other integrator fits the scene"
            return
        if machine.compiled:
            controls.message = f"compiling {machine.method.name}"
            self.look()
        self._pendulum.take(machine)
        controls.message = ""
        self._done.append(METHOD)
        self.look()


def _clamped(side: int) -> int:
    return min(max(side, LEAST), MOST)
