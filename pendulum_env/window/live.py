"""A pendulum in its window: frames in time with the clock, and a person's wishes carried out."""

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
"""Time between frames, at least [s]."""
LATE = 0.1
"""A window that is so late does not catch up [s]."""
HINTS = (
    "Space pause · S step · Tab integrator · drag the bob or type an angle · H keys",
    "Space pause · S step · Tab integrator · H keys", "Space pause · H keys", "H keys",
)
"""Of these, the window's line shows the longest that has room."""
MOUSE = ("press", "move", "release")
"""What takes the time, too, of what :meth:`pendulum_env.window.screen.Screen.happened` tells."""
START, METHOD = "start", "integrator"
"""What ``info["by_hand"]`` says."""


class Pace:
    """When frames are due: simulated time against the clock, which callers read.

    Steps follow each other without rounding errors adding up.
    """

    def __init__(self) -> None:
        self._due = self._next = -1e300

    def frames(self, now: float, span: float) -> list[tuple[float, float]]:
        """Return the frames of a step that takes ``span`` [s] of the clock, from ``now`` or the last step's end on.

        Each is (share of the step, time when it is due): the last at the end of the step; more before it where the
        step is longer than FRAME; none where frames would follow each other faster.
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
        """When the last step ends."""
        return self._due

    def hold(self, now: float) -> None:
        """Let the schedule begin anew: time was held until now."""
        self._due = self._next = now


class Live:
    """The window of an environment with ``render_mode="human"``; it opens with the first reset.

    ``reset`` and ``step`` show a frame, and ``step`` returns when its time has passed on the clock, at the speed that
    was chosen; a program that computes for longer than that is not waited for. A step carries out what a person has
    asked for, then holds the action for ``dt``; it waits before that while time is held: in a pause, until the person
    goes on or takes one step, and while the bob is in the person's hand. In such a step ``info["by_hand"]`` is "start"
    where the state was set (the time and the ledger begin anew there, as in a reset), "integrator" where the method
    was changed (both go on), or "start, integrator". TimeLimit counts steps as ever.

    When the window has been closed, later steps go on without it, unpaced, after one warning.

    Attributes:
        open: False after the window was closed.
        push: what the arrow keys ask of the motor, for programs that hand it to ``step``.
        start: where the last run started, as ``reset`` takes it.
        controls: what the person has asked for; see :class:`pendulum_env.window.controls.Controls`.
        size: width and height of the frame [px].
        screen: the window itself; None while it is not open.

    Raises WindowError from the first reset where no window can be opened; warns where nobody can see it.
    """

    screen: screen.Screen | None = None

    def __init__(self, shown: Shown) -> None:
        self.controls = Controls()
        self._pendulum, self._pace = shown, Pace()
        self._start = (0.0, 0.0)
        self._wishes: list[Wish] = []
        self._done: list[str] = []
        self._shown: View | None = None
        self._drawn: View | None = None
        self._warned = False

    def __getstate__(self) -> dict[str, Any]:
        """A copy has a window of its own; what it shows is handed to it anew, by :meth:`show`."""
        own = {name: value for name, value in vars(self).items() if name not in ("screen", "_pendulum")}
        return {**own, "_wishes": [], "_pace": Pace()}

    def show(self, shown: Shown) -> None:
        """Show this pendulum from now on."""
        self._pendulum = shown

    @property
    def open(self) -> bool:
        return self.controls.open

    @property
    def push(self) -> float:
        """Share of the motor's torque that the keys Left and Right ask for: -1, 0 or 1."""
        return self.controls.push

    @property
    def start(self) -> dict[str, float]:
        """Where the last run started, as ``reset`` takes it."""
        return dict(zip(("angle", "velocity"), self._start, strict=True))

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the frame in the window [px]."""
        if self.screen is None:
            return self._pendulum.size
        width, height = self.screen.size
        return _clamped(width), _clamped(height - line_height(_clamped(width)))

    def grip(self) -> Grip | None:
        """Return where the bob can be taken in the frame that is shown; None where no frame shows it."""
        if self._drawn is None:
            return None
        panels = staged(self._pendulum.apparatus, self._drawn, self.size, self._pendulum.look).panels
        at = next((panel for panel in panels if isinstance(panel, Stand)), None)
        return None if at is None else Grip(*at.places(self._drawn), at.bob)

    # --- what the environment calls -----------------------------------------------------------------------------

    def began(self, angle: float, velocity: float) -> None:
        """The environment has started from here [rad, rad/s]."""
        self._start = angle, velocity
        self.look()

    def attend(self) -> None:
        """Before a step: carry out what was asked for; wait while time is held."""
        if not self.open:
            self._warn_once()
            return
        self._listen()
        self._carry_out()
        held = self.controls.waits
        while self.controls.waits:
            self.look()
            screen.sleep(FRAME)
            self._listen()
            self._carry_out()
        if held:
            self._pace.hold(screen.now())
        self.controls.steps = max(0, self.controls.steps - 1)

    def present(self, info: dict[str, Any]) -> None:
        """After a step: its frames, each at its time, and what was done by hand."""
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
        """Show the present state."""
        if self.open:
            self._shown = self._pendulum.view()
            self._draw(self._shown)

    def close(self) -> None:
        """Close the window; it opens again with the next reset unless a person has closed it."""
        if self.screen is not None:
            self.screen.close()
            self.screen = None

    # --- parts --------------------------------------------------------------------------------------------------

    def _warn_once(self) -> None:
        if not self._warned:
            self._warned = True
            warn("The window was closed; the environment goes on without it, as fast as it can.")

    def _at(self, share: float, first: View | None) -> View:
        """Return the view at a share of the step from ``first``; its end where ``first`` is not the step's start."""
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
        self.controls.close()
        self.close()

    def _listen(self) -> None:
        """Take in what happened to the window."""
        if self.screen is None:
            return
        for what, *said in self.screen.happened():
            more = (screen.now(),) if what in MOUSE else ()
            grip = (self.grip(),) if what == "press" else ()
            self._wishes += getattr(self.controls, what)(*said, *more, *grip) or ()
        if not self.open:
            self._gone()

    def _carry_out(self) -> None:
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
        """Another method from the same state."""
        controls, machine = self.controls, self._pendulum.another(by)
        if machine is None:
            controls.message = "no other integrator fits"
            return
        if machine.compiled:
            controls.message = f"making {machine.method.name}"
            self.look()
        self._pendulum.take(machine)
        controls.message = ""
        self._done.append(METHOD)
        self.look()


def _clamped(side: int) -> int:
    return min(max(side, LEAST), MOST)
