"""The window itself: pygame-ce's, imported when the first one opens."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from pendulum_env.common.warn import warn
from pendulum_env.render.paint import Image

if TYPE_CHECKING:
    import pygame

OPEN: list[Screen] = []
"""Windows that are open; they share one queue of events."""

VARIABLE = "SDL_VIDEODRIVER"
UNSEEN = ("dummy", "offscreen")
"""Video drivers of SDL that show nothing; the second is what it takes by itself where there is no display."""
INSTEAD = f"take render_mode='rgb_array', or set {VARIABLE}=dummy for a window that is not meant to be seen."
NONE = f"render_mode='human' cannot open a window here ({{}}); {INSTEAD}"
LEAST = (240, 240)
"""A window can be made so small [px]."""


class WindowError(RuntimeError):
    """No window can be opened."""


now: Callable[[], float] = time.perf_counter
sleep: Callable[[float], None] = time.sleep


class Screen:
    """One window of a size in pixels, that can be resized; ``window`` is pygame's.

    Raises WindowError where none can be opened; warns where nobody can see it.
    """

    def __init__(self, title: str, size: tuple[int, int]) -> None:
        module = _pygame()
        if not seen():
            driver = module.display.get_driver()
            warn(f"There is no display, and SDL's driver '{driver}' opens windows that nobody sees; {INSTEAD}")
        try:
            self.window = module.Window(title, size, resizable=True)
        except module.error as error:
            raise WindowError(NONE.format(error)) from None
        self.window.minimum_size = (min(size[0], LEAST[0]), min(size[1], LEAST[1]))
        self._heard: list[tuple[Any, ...]] = []
        OPEN.append(self)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [px]."""
        width, height = self.window.size
        return int(width), int(height)

    def present(self, picture: Image) -> bool:
        """Show a picture of the window's size; False if the window is gone, as after pygame.quit()."""
        import pygame

        try:
            painted = pygame.image.frombuffer(picture, picture.shape[1::-1], "RGB")  # type: ignore[arg-type]
            self.window.get_surface().blit(painted, (0, 0))
            self.window.flip()
        except pygame.error:
            return False
        return True

    def hear(self, said: tuple[Any, ...]) -> None:
        """Keep an event of this window until :meth:`happened` is called."""
        self._heard.append(said)

    def happened(self) -> list[tuple[Any, ...]]:
        """Return what happened to this window since the last call: names of methods of Controls, and what they take.

        What happened to other windows is kept for them.
        """
        import pygame

        try:
            events = pygame.event.get()
        except pygame.error:  # somebody called pygame.quit()
            return [("close",)]
        for event in events:
            said, window = _in_words(event), getattr(event, "window", None)
            for screen in OPEN if said else ():
                if screen.window is window or event.type == pygame.QUIT:
                    screen.hear(said)
        found, self._heard = self._heard, []
        return found

    def close(self) -> None:
        """Close the window."""
        import pygame

        if self in OPEN:
            OPEN.remove(self)
        with suppress(pygame.error):  # somebody called pygame.quit()
            self.window.destroy()


def _in_words(event: pygame.event.Event) -> tuple[Any, ...]:
    """An event as the name of a method of Controls and what it takes; nothing for one that means nothing here."""
    import pygame

    if event.type in (pygame.KEYDOWN, pygame.KEYUP):
        name = pygame.key.name(event.key)
        if event.type == pygame.KEYUP:
            return "key_up", name
        return "key", name, getattr(event, "unicode", ""), bool(getattr(event, "mod", 0) & pygame.KMOD_SHIFT)
    if event.type in (pygame.MOUSEBUTTONDOWN, pygame.MOUSEBUTTONUP):
        what = "press" if event.type == pygame.MOUSEBUTTONDOWN else "release"
        return (what, *event.pos) if event.button == 1 else ()
    if event.type == pygame.MOUSEMOTION:
        return "move", *event.pos
    if event.type == pygame.WINDOWFOCUSLOST:
        return ("leave",)
    return ("close",) if event.type in (pygame.WINDOWCLOSE, pygame.QUIT) else ()


def seen() -> bool:
    """True if windows can be seen, or are not meant to be; WindowError where none can be opened."""
    driver = _pygame().display.get_driver()
    return driver not in UNSEEN or os.environ.get(VARIABLE, "") == driver


def _pygame() -> Any:
    """pygame with a display."""
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    import pygame

    try:
        if not pygame.display.get_init():
            pygame.display.init()
    except pygame.error as error:
        raise WindowError(NONE.format(error)) from None
    return pygame
