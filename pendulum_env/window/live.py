"""An environment in its window: frames in time with the clock, and a person's wishes carried out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pendulum_env.common.warn import warn
from pendulum_env.engine.limits import warn_of_long_steps
from pendulum_env.engine.starts import warn_of_restarts
from pendulum_env.envs.settings import Settings, one_start
from pendulum_env.films.picture import Camera
from pendulum_env.physics.units import SceneError
from pendulum_env.render import View, frame
from pendulum_env.render.layout import LEAST, MOST
from pendulum_env.render.notes import line_height, with_line, with_list
from pendulum_env.render.panel import staged
from pendulum_env.render.stand import Stand
from pendulum_env.render.view import between
from pendulum_env.window import screen
from pendulum_env.window.controls import KEYS, Controls, Grip, Switch, Wish
from pendulum_env.window.pace import FRAME, Pace
from pendulum_env.window.switch import carried, following

if TYPE_CHECKING:
    from pendulum_env.envs.env import LabPendulumEnv

HINTS = (
    "Space pause · S step · Tab integrator · drag the bob or type an angle · H keys",
    "Space pause · S step · Tab integrator · H keys", "Space pause · H keys", "H keys",
)
"""Of these, the window's line shows the longest that has room."""
MOUSE = ("press", "move", "release")
"""What takes the time, too, of what :meth:`pendulum_env.window.screen.Screen.happened` tells."""
START, METHOD = "start", "integrator"
"""What ``info["by_hand"]`` says."""


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

    Raises WindowError from the first reset where no window can be opened; warns where nobody can see it.
    """

    def __init__(self, env: LabPendulumEnv, made: Settings) -> None:
        self.controls = Controls()
        self._env, self._made, self._pace = env, made, Pace()
        self._screen: screen.Screen | None = None
        self._start = (0.0, 0.0)
        self._wishes: list[Wish] = []
        self._done: list[str] = []
        self._shown: View | None = None
        self._drawn: View | None = None
        self._warned = False

    def __getstate__(self) -> dict[str, Any]:
        """A copy has a window of its own."""
        return {**vars(self), "_screen": None, "_wishes": [], "_pace": Pace()}

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
        frames = self._pace.frames(screen.now(), self._made.dt / self.controls.rate)
        first, self._shown = self._shown, self._view() if frames else None
        for share, due in frames:
            screen.sleep(max(0.0, due - screen.now()))
            self._draw(self._at(share, first))
            self._listen()
            if self.controls.waits or not self.open:
                break

    def look(self) -> None:
        """Show the present state."""
        if self.open:
            self._shown = self._view()
            self._draw(self._shown)

    def close(self) -> None:
        """Close the window; it opens again with the next reset unless a person has closed it."""
        if self._screen is not None:
            self._screen.close()
            self._screen = None

    # --- parts --------------------------------------------------------------------------------------------------

    def _warn_once(self) -> None:
        if not self._warned:
            self._warned = True
            warn("The window was closed; the environment goes on without it, as fast as it can.")

    def _at(self, share: float, first: View | None) -> View:
        """The view at a share of the step from ``first``; its end where that is not known, or not its start."""
        last = self._shown
        assert last is not None
        known = first is not None and 0.5 < (last.time - first.time) / self._made.dt < 1.5
        return between(first, last, share) if known and first is not None else last

    def _view(self) -> View:
        env = self._env
        assert env._camera is not None
        return env._camera.view(env._state, env._share, env._reel.trail or (), env._reel.past_of())

    def _size(self) -> tuple[int, int]:
        """Of the frame in the window."""
        if self._screen is None:
            return self._made.render_size
        width, height = self._screen.size
        return _clamped(width), _clamped(height - line_height(_clamped(width)))

    def _draw(self, view: View) -> None:
        camera, look, controls = self._env._camera, self._made.look, self.controls
        assert camera is not None
        if self._screen is None:
            width, height = self._made.render_size
            self._screen = screen.Screen(f"LabPendulum: {self._env.scene.name}", (width, height + line_height(width)))
        self._drawn = view
        picture = frame(camera.apparatus, view, size=self._size(), look=look)
        if controls.listed:
            picture = with_list(picture, KEYS, look.theme)
        if not self._screen.present(with_line(picture, controls.status(), HINTS, look.theme)):
            self._gone()

    def _gone(self) -> None:
        self.controls.close()
        self.close()

    def _grip(self) -> Grip | None:
        """Where the bob is in the frame that is shown."""
        camera, view = self._env._camera, self._drawn
        if camera is None or view is None:
            return None
        panels = staged(camera.apparatus, view, self._size(), self._made.look).panels
        at = next((panel for panel in panels if isinstance(panel, Stand)), None)
        return None if at is None else Grip(*at.places(view), at.bob)

    def _listen(self) -> None:
        """Take in what happened to the window."""
        if self._screen is None:
            return
        for what, *said in self._screen.happened():
            more = (screen.now(),) if what in MOUSE else ()
            grip = (self._grip(),) if what == "press" else ()
            self._wishes += getattr(self.controls, what)(*said, *more, *grip) or ()
        if not self.open:
            self._gone()

    def _carry_out(self) -> None:
        wishes, self._wishes = self._wishes, []
        for wish in wishes if self.open else ():
            if isinstance(wish, Switch):
                self._switch(wish.by)
                continue
            angle, velocity = self._start if wish.angle is None else (wish.angle, wish.velocity)
            try:
                start = one_start(self._env.scene, angle, velocity)
            except SceneError as error:
                self.controls.message = str(error)
                continue
            self._env._start(*start)
            self._done.append(START)

    def _switch(self, by: int) -> None:
        """Another method from the same state."""
        env, controls = self._env, self.controls
        machine = following(env._machine, by)
        if machine is None:
            controls.message = "no other integrator fits"
            return
        if machine.compiled:
            controls.message = f"making {machine.method.name}"
            self.look()
        warn_of_restarts(machine.method, env.scene, env.substeps)
        if not machine.tolerance:
            warn_of_long_steps(machine.method, (env.scene,), env._h)
        values = [float(value) for value in env._state]
        env._state = carried(env._machine, values, machine, env._share, env._h)
        env._machine, env.integrator = machine, machine.method.name
        env._slackened = machine.kept.get("slackened", 0)
        env._made_for = {**env._made_for, "integrator": machine.method.name}
        env._camera, controls.message = Camera(machine, env._h, self._made), ""
        self._done.append(METHOD)
        self.look()


def _clamped(side: int) -> int:
    return min(max(side, LEAST), MOST)
