"""Controls of the window: translate keys and mouse events into requests, independently of pygame."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise

MINUS = "\N{MINUS SIGN}"
SPEEDS = (("1/10", 0.1), ("1/4", 0.25), ("1/2", 0.5), ("1/1", 1.0), ("2x", 2.0))
"""Playback speeds: label, and simulated seconds per second of real time."""
REAL_TIME = 3
"""Index of real time in SPEEDS."""

RECENT = 0.1
"""Time over which the mouse's velocity is averaged [s]; a mouse that has not moved for longer is at rest."""
NEAR = 12.0
"""Largest distance from the bob at which the mouse can grip it [px]."""
LONGEST = 12
"""Largest number of characters of a typed angle."""


@dataclass(frozen=True)
class Start:
    """Request of the person at the window to restart from an angle [rad] and a velocity [rad/s].

    Without an angle, the run restarts from where the last one started.
    """

    angle: float | None = None
    velocity: float = 0.0


@dataclass(frozen=True)
class Switch:
    """Request of a person at the window: change the integrator.

    ``to`` is its name, or the number of places by which it comes later in the list of integrators.
    """

    to: str | int


@dataclass(frozen=True)
class NewStep:
    """Request of a person at the window: restart from the last start with ``factor`` times the step."""

    factor: float


@dataclass(frozen=True)
class PressWatch:
    """Request of a person at the window: start the stopwatch, stop it, or set it to zero, in this order."""


@dataclass(frozen=True)
class TakePicture:
    """Request of a person at the window: save a picture of the window."""


Wish = Start | Switch | NewStep | PressWatch | TakePicture


@dataclass(frozen=True)
class Grip:
    """Position of the pendulum in the window, in pixels: the pivot, the bob's centre, and the bob's radius.

    It decides whether the mouse grips the bob.
    """

    pivot: tuple[float, float]
    bob: tuple[float, float]
    radius: float

    def holds(self, x: float, y: float) -> bool:
        """Return True if the mouse at (x, y) [px] is near enough to the bob to grip it."""
        return math.hypot(x - self.bob[0], y - self.bob[1]) <= self.radius + NEAR

    def angle(self, x: float, y: float) -> float:
        """Return the angle of the line from the pivot to (x, y) [px], from the downward vertical [rad]."""
        return math.atan2(x - self.pivot[0], y - self.pivot[1])


@dataclass
class Controls:
    """State of the controls of a pendulum's window: pause, speed, typed angle, pressed keys, mouse.

    Attributes:
        open: False when the window is to close.
        paused: True while the simulation is paused.
        steps: number of control steps that the person has requested during the pause.
        speed: index of the playback speed in SPEEDS.
        typing: True while a start angle is being typed.
        typed: start angle typed so far [degrees].
        message: error message shown in the window.
        listed: True while the list of keys is shown.
        push: fraction of the motor's torque that the keys Left and Right request.
        grip: position of pivot and bob while the mouse holds the bob; else None.
        pointer: place of the mouse in the window [px].
    """

    open: bool = True
    paused: bool = False
    steps: int = 0
    speed: int = REAL_TIME
    typing: bool = False
    typed: str = ""
    message: str = ""
    listed: bool = False
    grip: Grip | None = None
    pointer: tuple[float, float] = (0.0, 0.0)
    _down: set[str] = field(default_factory=set)
    _path: deque[tuple[float, float]] = field(default_factory=deque)

    @property
    def waits(self) -> bool:
        """True while the simulation waits: in a pause, and while the mouse holds the bob."""
        return self.open and (self.grip is not None or (self.paused and not self.steps))

    @property
    def rate(self) -> float:
        """Simulated seconds per second of real time."""
        return SPEEDS[self.speed][1]

    @property
    def push(self) -> float:
        """Fraction of the motor's torque that the keys Left and Right request: -1, 0 or 1."""
        return float("right" in self._down) - float("left" in self._down)

    def status(self) -> str:
        """Return the text of the window's status line: pause or speed, a typed angle, an error message."""
        parts = ["paused"] if self.paused else []
        if self.speed != REAL_TIME:
            parts.append(f"speed {SPEEDS[self.speed][0]}")
        if self.typing:
            parts.append(f"start at {self.typed.replace('-', MINUS)}_° (Enter)")
        return " · ".join([*parts, self.message] if self.message else parts)

    # --- keys ---------------------------------------------------------------------------------------------------

    def key(self, name: str, text: str = "", shift: bool = False) -> list[Wish]:
        """Handle a pressed key, given by its name, its typed text and Shift; return the requests that it makes."""
        self.message = ""
        if self.typing and self._type(text.replace(",", ".")):
            return []
        name = text if text in METHOD_KEYS else name
        key = BY_NAME.get(name)
        return (key.press(self, name, shift) if key else None) or []

    def key_up(self, name: str) -> None:
        """Handle a released key: end the torque that Left and Right request."""
        self._down.discard(name)

    def push_while_down(self, name: str) -> None:
        """Request a torque of the motor until the key is released."""
        self._down.add(name)

    def change_speed(self, by: int) -> None:
        """Choose a faster (1) or slower (-1) playback speed, if there is one."""
        self.speed = min(max(self.speed + by, 0), len(SPEEDS) - 1)

    def pause(self) -> None:
        """Pause, or continue after a pause."""
        self.paused, self.steps = not self.paused, 0

    def single_step(self) -> None:
        """Request one control step, followed by a pause."""
        self.paused, self.steps = True, self.steps + 1

    def begin_typing(self) -> None:
        """Let the next keys type a start angle."""
        self.typing, self.typed = True, ""

    def escape(self) -> None:
        """End the typing of an angle without a request, and hide the list of keys."""
        self.typing, self.typed, self.listed = False, "", False

    def show_keys(self) -> None:
        """Show or hide the list of keys."""
        self.listed = not self.listed

    def _type(self, text: str) -> bool:
        """Append a typed character to the start angle; return True if it can be part of a number."""
        digit = len(text) == 1 and text in "0123456789"
        fits = digit or (text == "-" and not self.typed) or (text == "." and "." not in self.typed)
        if fits and len(self.typed) < LONGEST:
            self.typed += text
        return digit or text in ("-", ".")

    def erase(self) -> None:
        """Delete the last character of the typed angle."""
        self.typed = self.typed[:-1]

    def enter(self) -> list[Wish]:
        """Return the request to start at the typed angle, as a list that is empty if no angle was typed."""
        typed, self.typing, self.typed = self.typed, False, ""
        if not typed:
            return []
        if not any(map(str.isdigit, typed)):
            self.message = f"{typed} is not a number of degrees"
            return []
        return [Start(math.radians(float(typed)))]

    # --- mouse --------------------------------------------------------------------------------------------------

    def press(self, x: float, y: float, now: float, grip: Grip | None) -> list[Wish]:
        """Handle a mouse button pressed at (x, y) [px] and time ``now`` [s]; return the requests that it makes.

        ``grip`` is the position of the bob, None if no panel shows it.
        """
        self.pointer = x, y
        if grip is None or not grip.holds(x, y):
            return []
        self.grip = grip
        self._path.clear()
        return self.move(x, y, now)

    def move(self, x: float, y: float, now: float) -> list[Wish]:
        """Handle a mouse movement; a bob that the mouse holds follows it, with velocity 0."""
        self.pointer = x, y
        if self.grip is None:
            return []
        angle = self.grip.angle(x, y)
        while self._path and self._path[0][0] < now - RECENT:
            self._path.popleft()
        self._path.append((now, angle))
        return [Start(angle)]

    def release(self, x: float, y: float, now: float) -> list[Wish]:
        """Handle a released mouse button: the bob starts at the mouse's angle with the mouse's angular velocity."""
        if self.grip is None:
            return []
        angle = self.grip.angle(x, y)
        recent = [(time, place) for time, place in self._path if time >= now - RECENT]
        self.grip = None
        self._path.clear()
        if not recent or not now > recent[0][0]:
            return [Start(angle)]
        places = [place for _, place in recent] + [angle]
        turned = math.fsum(math.remainder(b - a, 2.0 * math.pi) for a, b in pairwise(places))
        return [Start(angle, turned / (now - recent[0][0]))]

    def hold(self, why: str) -> None:
        """Pause the simulation and show the reason in the status line."""
        self.paused, self.steps, self.message = True, 0, why

    def leave(self) -> None:
        """Handle the loss of the keyboard focus: release all keys and the bob."""
        self.grip = None
        self._down.clear()

    def close(self) -> None:
        """Mark the window as to be closed, and let the simulation continue without it."""
        self.open, self.grip = False, None
        self._down.clear()


METHOD_KEYS = {
    "1": "forward_euler", "2": "backward_euler", "3": "symplectic_euler", "4": "velocity_verlet", "5": "rk4",
}
"""Keys that choose an integrator, and its name."""

Press = Callable[[Controls, str, bool], list[Wish] | None]


@dataclass(frozen=True)
class Key:
    """A row of the table of keys.

    Attributes:
        shown: the keys as the list of keys names them.
        does: what they do, for the same list.
        names: names of these keys in pygame; empty for the mouse.
        press: function that carries out a press, from the controls, the key's name, and True with Shift; it returns
            the requests that the press makes, None for none.
    """

    shown: str
    does: str
    names: tuple[str, ...] = ()
    press: Press = lambda controls, name, shift: None


def _asks(wish: Wish, with_shift: Wish | None = None) -> Press:
    """Return a press that makes one request, or another one with Shift."""
    return lambda controls, name, shift: [with_shift if shift and with_shift is not None else wish]


KEYS = (
    Key("Space", "pause, continue", ("space",), lambda controls, name, shift: controls.pause()),
    Key("S", "one control step", ("s",), lambda controls, name, shift: controls.single_step()),
    Key("R", "restart from the last start", ("r",), _asks(Start())),
    Key("Up, Down", "faster, slower: " + ", ".join(label for label, _ in SPEEDS), ("up", "down"),
        lambda controls, name, shift: controls.change_speed(1 if name == "up" else -1)),
    Key("1 to 5", ", ".join(METHOD_KEYS.values()), tuple(METHOD_KEYS),
        lambda controls, name, shift: [Switch(METHOD_KEYS[name])]),
    Key("Tab, Shift+Tab", "next, previous integrator that fits the scene", ("tab",), _asks(Switch(1), Switch(-1))),
    Key("D, Shift+D", "restart with half, twice the step dt (lab-pendulum show)", ("d",),
        _asks(NewStep(0.5), NewStep(2.0))),
    Key("A", "type a start angle in degrees", ("a",), lambda controls, name, shift: controls.begin_typing()),
    Key("Enter", "start at rest from the typed angle", ("return", "enter"),
        lambda controls, name, shift: controls.enter()),
    Key("Backspace, Esc", "correct, cancel the typed angle", ("backspace", "escape"),
        lambda controls, name, shift: controls.erase() if name == "backspace" else controls.escape()),
    Key("mouse", "drag the bob; released, it keeps the mouse's velocity"),
    Key("Left, Right", "push with the motor (lab-pendulum show)", ("left", "right"),
        lambda controls, name, shift: controls.push_while_down(name)),
    Key("T", "stopwatch: start, stop, set to zero", ("t",), _asks(PressWatch())),
    Key("P", "save a picture of the window as PNG", ("p",), _asks(TakePicture())),
    Key("H", "this list", ("h",), lambda controls, name, shift: controls.show_keys()),
    Key("Q", "close the window", ("q",), lambda controls, name, shift: controls.close()),
)
"""The keys and their functions: the window acts on this table, lists it, and ``lab-pendulum show --help`` prints it."""

BY_NAME = {name: key for key in KEYS for name in key.names}
"""Rows of the table by the names of their keys in pygame."""


def keys_in_words() -> str:
    """Return the table of keys with a line for each key, for the command line's help."""
    return "\n".join(f"{key.shown}: {key.does}" for key in KEYS)
