"""Controls of the window: translate keys and mouse events into requests, independently of pygame."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from itertools import pairwise

MINUS = "\N{MINUS SIGN}"
SPEEDS = (("1/10", 0.1), ("1/4", 0.25), ("1/2", 0.5), ("1/1", 1.0), ("2x", 2.0))
"""Playback speeds: label, and simulated seconds per second of real time."""
REAL_TIME = 3
"""Index of real time in SPEEDS."""

KEYS = (
    ("Space", "pause, continue"),
    ("S", "one control step"),
    ("Up, Down", "faster, slower: " + ", ".join(label for label, _ in SPEEDS)),
    ("Tab, Shift+Tab", "next, previous integrator that fits the scene"),
    ("digits, Enter", "start at rest from this angle in degrees"),
    ("R", "restart from the last start"),
    ("mouse", "drag the bob; released, it keeps the mouse's velocity"),
    ("Left, Right", "push with the motor (lab-pendulum show)"),
    ("H", "this list"),
    ("Q", "close the window"),
)
"""Keys and their functions, as the window lists them."""

RECENT = 0.1
"""Time over which the mouse's velocity is averaged [s]; a mouse that has not moved for longer is at rest."""
NEAR = 12.0
"""Largest distance from the bob at which the mouse can grip it [px]."""
LONGEST = 12
"""Largest number of characters of a typed angle."""


@dataclass(frozen=True)
class Start:
    """Request of a person at the window: restart from an angle [rad] and a velocity [rad/s].

    Without an angle the restart is from where the last run started.
    """

    angle: float | None = None
    velocity: float = 0.0


@dataclass(frozen=True)
class Switch:
    """Request of a person at the window: change to the integrator ``by`` places later in the list of integrators."""

    by: int


Wish = Start | Switch


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
        typed: angle being typed [degrees].
        message: error message shown in the window.
        listed: True while the list of keys is shown.
        push: fraction of the motor's torque that the keys Left and Right request.
        grip: position of pivot and bob while the mouse holds the bob; else None.
    """

    open: bool = True
    paused: bool = False
    steps: int = 0
    speed: int = REAL_TIME
    typed: str = ""
    message: str = ""
    listed: bool = False
    grip: Grip | None = None
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
        if self.typed:
            parts.append(f"Enter starts at {self.typed.replace('-', MINUS)}°")
        return " · ".join([*parts, self.message] if self.message else parts)

    # --- keys ---------------------------------------------------------------------------------------------------

    def key(self, name: str, text: str = "", shift: bool = False) -> list[Wish]:
        """Handle a pressed key, given by its name, its typed text and Shift; return the requests that it makes."""
        self.message = ""
        if name in ("left", "right"):
            self._down.add(name)
        elif name in ("up", "down"):
            self.speed = min(max(self.speed + (1 if name == "up" else -1), 0), len(SPEEDS) - 1)
        elif name == "space":
            self.paused, self.steps = not self.paused, 0
        elif name == "s":
            self.paused, self.steps = True, self.steps + 1
        elif name == "tab":
            return [Switch(-1 if shift else 1)]
        elif name == "r":
            return [Start()]
        elif name == "h":
            self.listed = not self.listed
        elif name == "q":
            self.close()
        elif name == "escape":
            self.typed, self.listed = "", False
        elif name == "backspace":
            self.typed = self.typed[:-1]
        elif name in ("return", "enter"):
            return self._entered()
        else:
            self._type(text.replace(",", "."))
        return []

    def key_up(self, name: str) -> None:
        """Handle a released key: end the torque that Left and Right request."""
        self._down.discard(name)

    def _type(self, text: str) -> None:
        """Append a typed character to the start angle, if it can be part of a number."""
        fits = (text == "-" and not self.typed) or (text == "." and "." not in self.typed)
        if len(self.typed) < LONGEST and (fits or (len(text) == 1 and text in "0123456789")):
            self.typed += text

    def _entered(self) -> list[Wish]:
        """Return the request to start at the typed angle, as a list that is empty if no angle was typed."""
        typed, self.typed = self.typed, ""
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
        if grip is None or not grip.holds(x, y):
            return []
        self.grip = grip
        self._path.clear()
        return self.move(x, y, now)

    def move(self, x: float, y: float, now: float) -> list[Wish]:
        """Handle a mouse movement; a bob that the mouse holds follows it, with velocity 0."""
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
