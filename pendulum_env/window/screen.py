"""Window of pygame-ce, which is imported when the first window opens."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from pendulum_env.common.checks import warn
from pendulum_env.render.paint import Image

if TYPE_CHECKING:
    import pygame

OPEN: list[Screen] = []
"""Open windows, which share pygame's one queue of events."""

VARIABLE = "SDL_VIDEODRIVER"
"""Environment variable that chooses SDL's video driver."""
UNSEEN = ("dummy", "offscreen")
"""Video drivers of SDL that show nothing; "offscreen" is its default on a machine without display."""
INSTEAD = f"use render_mode='rgb_array', or set {VARIABLE}=dummy for an invisible window."
NONE = f"render_mode='human' cannot open a window here ({{}}); {INSTEAD}"
LEAST = (240, 240)
"""Smallest size of a window [px]."""


class WindowError(RuntimeError):
    """Error of a window that cannot be opened."""


now: Callable[[], float] = time.perf_counter
sleep: Callable[[float], None] = time.sleep


class Screen:
    """Resizable window of pygame-ce with a title and a size in pixels; ``window`` is pygame's own object.

    Raises WindowError if no window can be opened; warns if the window is not visible.
    """

    def __init__(self, title: str, size: tuple[int, int]) -> None:
        module = _pygame()
        if not seen():
            driver = module.display.get_driver()
            warn(f"There is no display, and windows of SDL's driver '{driver}' are invisible; {INSTEAD}")
        try:
            self.window = module.Window(title, size, resizable=True)
        except module.error as error:
            raise WindowError(NONE.format(error)) from None
        self.window.minimum_size = (min(size[0], LEAST[0]), min(size[1], LEAST[1]))
        self._heard: list[tuple[Any, ...]] = []
        OPEN.append(self)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the window [px]."""
        width, height = self.window.size
        return int(width), int(height)

    def present(self, picture: Image) -> bool:
        """Show a picture of the window's size; return False if the window no longer exists (after pygame.quit())."""
        import pygame

        try:
            painted = pygame.image.frombuffer(picture, picture.shape[1::-1], "RGB")  # type: ignore[arg-type]
            self.window.get_surface().blit(painted, (0, 0))
            self.window.flip()
        except pygame.error:
            return False
        return True

    def hear(self, event: tuple[Any, ...]) -> None:
        """Store an event of this window, given as method name and arguments, until :meth:`happened` returns it."""
        self._heard.append(event)

    def happened(self) -> list[tuple[Any, ...]]:
        """Return the events of this window since the last call, as names of methods of Controls with their arguments.

        Events of other windows of this process are stored for these windows.
        """
        import pygame

        try:
            events = pygame.event.get()
        except pygame.error:  # the program called pygame.quit()
            return [("close",)]
        for event in events:
            call, window = _call_of(event), getattr(event, "window", None)
            for screen in OPEN if call else ():
                if screen.window is window or event.type == pygame.QUIT:
                    screen.hear(call)
        heard, self._heard = self._heard, []
        return heard

    def close(self) -> None:
        """Close the window."""
        import pygame

        if self in OPEN:
            OPEN.remove(self)
        with suppress(pygame.error):  # the program called pygame.quit()
            self.window.destroy()


def _call_of(event: pygame.event.Event) -> tuple[Any, ...]:
    """Return the name of the Controls method that handles an event of pygame, and its arguments; () for other events.
    """
    import pygame

    if event.type in (pygame.KEYDOWN, pygame.KEYUP):
        name = pygame.key.name(event.key)
        if event.type == pygame.KEYUP:
            return "key_up", name
        return "key", name, getattr(event, "unicode", ""), bool(getattr(event, "mod", 0) & pygame.KMOD_SHIFT)
    if event.type in (pygame.MOUSEBUTTONDOWN, pygame.MOUSEBUTTONUP):
        name = "press" if event.type == pygame.MOUSEBUTTONDOWN else "release"
        return (name, *event.pos) if event.button == 1 else ()
    if event.type == pygame.MOUSEMOTION:
        return "move", *event.pos
    if event.type == pygame.WINDOWFOCUSLOST:
        return ("leave",)
    return ("close",) if event.type in (pygame.WINDOWCLOSE, pygame.QUIT) else ()


def seen() -> bool:
    """Return True if windows can be seen, or are invisible because the user chose a display driver without screen.

    Raises WindowError if no window can be opened.
    """
    driver = _pygame().display.get_driver()
    return driver not in UNSEEN or os.environ.get(VARIABLE, "") == driver


def _pygame() -> Any:
    """Import pygame, initialise its display and return it; raises WindowError if that fails."""
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    import pygame

    try:
        if not pygame.display.get_init():
            pygame.display.init()
    except pygame.error as error:
        raise WindowError(NONE.format(error)) from None
    return pygame
