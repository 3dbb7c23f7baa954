"""What a person asks of the window: keys and mouse in, wishes out. Plain numbers and texts, no pygame."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from itertools import pairwise

MINUS = "\N{MINUS SIGN}"
SPEEDS = (("1/10", 0.1), ("1/4", 0.25), ("1/2", 0.5), ("1/1", 1.0), ("2x", 2.0))
"""Label and simulated seconds per second of the clock."""
REAL_TIME = 3
"""Place of true speed among SPEEDS."""

KEYS = (
    ("Space", "pause, go on"),
    ("S", "one control step"),
    ("Up, Down", "faster, slower: " + ", ".join(label for label, _ in SPEEDS)),
    ("Tab, Shift+Tab", "next, previous integrator that fits the scene"),
    ("digits, Enter", "start at rest from this angle in degrees"),
    ("R", "start again as before"),
    ("mouse", "drag the bob; it keeps the mouse's motion, or rests"),
    ("Left, Right", "push with the motor (lab-pendulum show)"),
    ("H", "this list"),
    ("Q", "close the window"),
)
"""What each key does, as the window's list shows it."""

RECENT = 0.1
"""A mouse that has not moved for so long rests [s]; its velocity is the mean over that time."""
NEAR = 12.0
"""The bob can be taken from so many pixels around it."""
LONGEST = 12
"""Characters of a typed angle, at most."""


@dataclass(frozen=True)
class Start:
    """Start anew from this angle [rad] and velocity [rad/s]; of neither, as before."""

    angle: float | None = None
    velocity: float = 0.0


@dataclass(frozen=True)
class Switch:
    """Take the integrator that comes so many places later."""

    by: int


Wish = Start | Switch


@dataclass(frozen=True)
class Grip:
    """Where the bob can be taken, in pixels: the pivot, the bob's centre and its radius."""

    pivot: tuple[float, float]
    bob: tuple[float, float]
    radius: float

    def holds(self, x: float, y: float) -> bool:
        """True if a mouse at (x, y) takes the bob."""
        return math.hypot(x - self.bob[0], y - self.bob[1]) <= self.radius + NEAR

    def angle(self, x: float, y: float) -> float:
        """The angle at which the line from the pivot goes through (x, y) [rad], from the downward vertical."""
        return math.atan2(x - self.pivot[0], y - self.pivot[1])


@dataclass
class Controls:
    """The state of the window's controls.

    Attributes:
        open: False when the window is to close.
        paused: time is held.  steps: so many control steps are let through then.
        speed: place among SPEEDS.
        typed: an angle being typed [degrees].  message: what could not be done.
        listed: the list of keys is shown.
        push: share of the motor's torque that Left and Right ask for.
        grip: of the bob while it is held; None else.
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
        """True while time is held: in a pause, and while the bob is in a hand."""
        return self.open and (self.grip is not None or (self.paused and not self.steps))

    @property
    def rate(self) -> float:
        """Simulated seconds per second of the clock."""
        return SPEEDS[self.speed][1]

    @property
    def push(self) -> float:
        return float("right" in self._down) - float("left" in self._down)

    def status(self) -> str:
        """What the window's line says: the pause or speed, and what is typed or could not be done."""
        parts = ["paused"] if self.paused else []
        if self.speed != REAL_TIME:
            parts.append(f"speed {SPEEDS[self.speed][0]}")
        if self.typed:
            parts.append(f"start at {self.typed.replace('-', MINUS)}° with Enter")
        return " · ".join([*parts, self.message] if self.message else parts)

    # --- keys ---------------------------------------------------------------------------------------------------

    def key(self, name: str, text: str = "", shift: bool = False) -> list[Wish]:
        """A key goes down: its name, the text it types, and whether Shift is held."""
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
        """A key comes up."""
        self._down.discard(name)

    def _type(self, text: str) -> None:
        fits = (text == "-" and not self.typed) or (text == "." and "." not in self.typed)
        if len(self.typed) < LONGEST and (fits or (len(text) == 1 and text in "0123456789")):
            self.typed += text

    def _entered(self) -> list[Wish]:
        typed, self.typed = self.typed, ""
        if not typed:
            return []
        if not any(map(str.isdigit, typed)):
            self.message = f"{typed} is no angle"
            return []
        return [Start(math.radians(float(typed)))]

    # --- mouse --------------------------------------------------------------------------------------------------

    def press(self, x: float, y: float, now: float, grip: Grip | None) -> list[Wish]:
        """The mouse's button goes down at (x, y) [px] and a time [s]; ``grip``: where the bob is, None if unseen."""
        if grip is None or not grip.holds(x, y):
            return []
        self.grip = grip
        self._path.clear()
        return self.move(x, y, now)

    def move(self, x: float, y: float, now: float) -> list[Wish]:
        """The mouse moves; the bob in its hand follows it at rest."""
        if self.grip is None:
            return []
        angle = self.grip.angle(x, y)
        while self._path and self._path[0][0] < now - RECENT:
            self._path.popleft()
        self._path.append((now, angle))
        return [Start(angle)]

    def release(self, x: float, y: float, now: float) -> list[Wish]:
        """The button comes up: the bob starts at the mouse's angle, with its angular velocity or at rest."""
        if self.grip is None:
            return []
        angle = self.grip.angle(x, y)
        recent = [(time, place) for time, place in self._path if time >= now - RECENT]
        self.grip = None
        self._path.clear()
        if not recent or not now > recent[0][0]:
            return [Start(angle)]
        places = [place for _, place in recent] + [angle]
        way = math.fsum(math.remainder(b - a, 2.0 * math.pi) for a, b in pairwise(places))
        return [Start(angle, way / (now - recent[0][0]))]

    def hold(self, why: str) -> None:
        """Pause by itself."""
        self.paused, self.steps, self.message = True, 0, why

    def leave(self) -> None:
        """The window is no longer in front: keys come up unseen, and the bob is let go where it is."""
        self.grip = None
        self._down.clear()

    def close(self) -> None:
        """The window is to close; nothing waits for it any more."""
        self.open, self.grip = False, None
        self._down.clear()
