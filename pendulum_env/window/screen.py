"""The window itself: pygame-ce's, imported when the first one opens."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from pendulum_env.render.paint import Image

if TYPE_CHECKING:
    import pygame

_OPEN: dict[int, Screen] = {}
"""Windows that are open, by pygame's number; they share one queue of events."""

VARIABLE = "SDL_VIDEODRIVER"
UNSEEN = ("dummy", "offscreen")
"""Video drivers of SDL that show nothing; the second is what it takes by itself where there is no display."""
LEAST = (240, 240)
"""A window can be made so small [px]."""


class WindowError(RuntimeError):
    """There is no display to open a window on."""


now: Callable[[], float] = time.perf_counter
sleep: Callable[[float], None] = time.sleep


class Screen:
    """One window of a size in pixels, that can be resized.

    Raises WindowError where there is no display.
    """

    def __init__(self, title: str, size: tuple[int, int]) -> None:
        module = _pygame()
        self._window = module.Window(title, size, resizable=True)
        self._window.minimum_size = (min(size[0], LEAST[0]), min(size[1], LEAST[1]))
        self._heard: list[tuple[Any, ...]] = []
        _OPEN[self._window.id] = self

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [px]."""
        width, height = self._window.size
        return int(width), int(height)

    def show(self, picture: Image) -> bool:
        """Show a picture of the window's size; False if the window is gone, as after pygame.quit()."""
        import pygame

        try:
            surface = self._window.get_surface()
            width, height = (min(a, b) for a, b in zip(surface.get_size(), picture.shape[1::-1], strict=True))
            part = surface.subsurface((0, 0, width, height))
            pygame.surfarray.blit_array(part, picture[:height, :width].swapaxes(0, 1))
            self._window.flip()
        except pygame.error:
            return False
        return True

    def happened(self) -> list[tuple[Any, ...]]:
        """What happened to this window since it was last asked: names of methods of Controls, and what they take.

        What happened to other windows is kept for them.
        """
        import pygame

        try:
            events = pygame.event.get()
        except pygame.error:  # somebody called pygame.quit()
            return [("close",)]
        for event in events:
            window = getattr(event, "window", None)
            owners = list(_OPEN.values()) if event.type == pygame.QUIT else [_OPEN.get(getattr(window, "id", -1))]
            said = _in_words(event)
            for owner in owners if said else ():
                if owner is not None:
                    owner._heard.append(said)
        found, self._heard = self._heard, []
        return found

    def close(self) -> None:
        """Close the window."""
        import pygame

        _OPEN.pop(next((key for key, screen in _OPEN.items() if screen is self), -1), None)
        try:
            self._window.destroy()
        except pygame.error:  # somebody called pygame.quit()
            pass


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


def _pygame() -> Any:
    """pygame with a display that can be seen, or that a person has asked not to be seen."""
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    import pygame

    began = not pygame.display.get_init()
    try:
        if began:  # each init keeps two more objects
            pygame.display.init()
        driver, why = pygame.display.get_driver(), "there is no display"
    except pygame.error as error:
        driver, why = "", str(error)
    if not driver or (driver in UNSEEN and os.environ.get(VARIABLE, "") != driver):
        if driver and began:
            pygame.display.quit()
        raise WindowError(
            f"render_mode='human' cannot open a window here ({why}); take render_mode='rgb_array', or set {VARIABLE}="
            "dummy for a window that nobody sees."
        )
    return pygame
