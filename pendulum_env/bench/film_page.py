"""The page of ``lab-pendulum track --page``: a film, clicks on bob and pivot, the track over it, stretches left out.

The desk behind it tracks in a thread of its own, so that the film can be looked at meanwhile, and stays until the page
says "Go on". Places are in pixels of the film as it is shown, times in seconds of the film.
"""

from __future__ import annotations

import json
import math
import queue
import re
import threading
import webbrowser
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from pendulum_env.bench.page import ASSETS
from pendulum_env.bench.server import Handler, filled, serving
from pendulum_env.bench.session import OrderError, sentence
from pendulum_env.common.texts import clean
from pendulum_env.common.version import software
from pendulum_env.lab.checked import RecordingError, spans
from pendulum_env.lab.film import FilmTrack, follow
from pendulum_env.lab.film.frames import Film, Shots
from pendulum_env.physics.units import one_of
from pendulum_env.web.document import ASSETS as WEB

SCRIPTS = (WEB / "elements.js", WEB / "languages.js", WEB / "drawing.js", WEB / "plots.js", ASSETS / "server.js",
           ASSETS / "film.js")
"""Scripts of the page, in the order in which they stand in it; the first four are the lab's."""
STYLES = (WEB / "page.css", ASSETS / "layout.css", ASSETS / "film.css")
"""Styles of the page, those of the lab first."""
SETTINGS = ("bob", "pivot", "length", "until", "drop", "rate")
"""Arguments of :func:`pendulum_env.lab.follow` that the page sets."""
NEWS = 0.01
"""Least share of the work after which progress is told."""
_WAITING = 2000  # events that a page may leave unread


@dataclass
class ServedFilm:
    """A film's page that is being served: its address, with the token, and the desk behind it."""

    address: str
    desk: FilmDesk


def serve(path: Path, *, open_browser: bool = True, **settings: Any) -> tuple[FilmTrack, dict[str, Any]]:
    """Serve the page of a film until "Go on" or Ctrl-C; return its last track and the settings that made it.

    ``settings`` are those of :func:`pendulum_env.lab.follow` with which the page begins; ``open_browser=False`` only
    prints the address. Raises RecordingError for a file that is no film, and if the page is left without a track.
    """
    with served(path, **settings) as page:
        print(f"The page is at {page.address} (Ctrl-C ends it).", flush=True)
        if open_browser:
            webbrowser.open(page.address)
        with suppress(KeyboardInterrupt):
            page.desk.over.wait()
        found, used = page.desk.found, page.desk.used
    if found is None:
        raise RecordingError(f"{path.name}: the page was left before the bob was tracked; nothing is written")
    return found, used


@contextmanager
def served(path: Path, **settings: Any) -> Iterator[ServedFilm]:
    """Serve the page within a ``with`` block; arguments and errors are those of :func:`serve`."""
    desk = FilmDesk(path, settings)
    with serving(desk, FilmHandler) as address:
        yield ServedFilm(address, desk)


class FilmDesk:
    """A film, the settings with which it was tracked last, and the track.

    Attributes:
        found: the track; None before the first.
        used: the settings that made it, without those that are None.
        work: fraction of the tracking that is done, and the present activity; None if nothing is tracked.
        over: set when the page says "Go on".
    """

    def __init__(self, path: Path, settings: Mapping[str, Any]) -> None:
        self.path = path
        self.settings = _given(settings)
        if self.settings["drop"] is not None:
            self.settings["drop"] = spans(self.settings["drop"])
        self.found: FilmTrack | None = None
        self.used: dict[str, Any] = {}
        self.over = threading.Event()
        self.problem = ""
        self.work: tuple[float, str] | None = None
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._lock = threading.Lock()
        self.pages: list[queue.Queue[str | None]] = []
        self._open()

    def _open(self) -> None:
        self.film = Film(str(self.path), rate=self.settings["rate"])
        self.shots = Shots(self.film)

    # --- orders and events --------------------------------------------------------------------------------------------

    def do(self, what: str, wanted: Mapping[str, Any]) -> dict[str, Any]:
        """Carry out an order of the page: "track", "stop" or "go"; raises SceneError for one that cannot be."""
        orders: dict[str, Callable[[], None]] = {
            "track": lambda: self._track(wanted, False), "stop": self._stop.set, "go": lambda: self._go(wanted)}
        orders[one_of(what, "order", orders)]()
        return {}

    def _track(self, wanted: Mapping[str, Any], going: bool) -> None:
        """Begin to track with the page's settings; ``going`` goes on when it is done."""
        with self._lock:
            if self.work is not None:
                raise OrderError("The film is being tracked; stop it first.")
            before = self.settings
            self.settings = _given(wanted)
            try:
                if self.settings["rate"] != before["rate"]:
                    self._open()
            except RecordingError:
                self.settings = before
                raise
            self.work, self.problem = (0.0, "begins"), ""
            self._stop.clear()
            self._thread = threading.Thread(target=self._follow, args=(going,), daemon=True, name="film-track")
        self._thread.start()

    def _go(self, wanted: Mapping[str, Any]) -> None:
        """Go on with the track, after tracking again if the settings are no longer those that made it."""
        if self.found is None or _without_none(_given(wanted)) != self.used:
            self._track(wanted, True)
            return
        self.over.set()
        self._tell(self._state())

    def _follow(self, going: bool) -> None:
        used = _without_none(self.settings)
        try:
            self.found, self.used = follow(self.path, progress=self._heard, **used), used
            self._tell(self._tracked())
            if going and self.found.complete:
                self.over.set()
        except KeyboardInterrupt:
            self.problem = "Stopped before enough of the film was tracked."
        except Exception as error:  # said on the page, which stays alive
            self.problem = sentence(error)
        self.work = None
        self._tell(self._state())

    def _heard(self, done: float, text: str) -> None:
        if self._stop.is_set():
            raise KeyboardInterrupt  # which keeps what was tracked, as Ctrl-C does
        before = self.work
        self.work = (done, text)
        if before is None or not before[0] <= done < before[0] + NEWS or text.split()[-1:] != before[1].split()[-1:]:
            self._tell(self._state())

    def _tell(self, event: Mapping[str, Any]) -> None:
        text = json.dumps(event, allow_nan=False)
        for page in list(self.pages):
            with suppress(queue.Full):
                page.put_nowait(text)

    def listen(self) -> queue.Queue[str | None]:
        """Return a queue of events for one page, which begins with the state and the track."""
        page: queue.Queue[str | None] = queue.Queue(_WAITING)
        page.put(json.dumps(self._state()))
        if self.found is not None:
            page.put(json.dumps(self._tracked()))
        self.pages.append(page)
        return page

    def leave(self, page: queue.Queue[str | None]) -> None:
        """Forget a page that was closed."""
        with suppress(ValueError):
            self.pages.remove(page)

    def close(self) -> None:
        """Stop tracking and end all pages."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(timeout=5.0)
        for page in self.pages:
            with suppress(queue.Full):
                page.put_nowait(None)

    # --- what the page shows ------------------------------------------------------------------------------------------

    def _state(self) -> dict[str, Any]:
        work = None if self.work is None else {"done": round(self.work[0], 3), "text": clean(self.work[1])}
        return {"kind": "state", "name": clean(self.film.name), "size": self.film.size, "step": self.film.step,
                "end": self.film.length / self.film.slower or self.film.count * self.film.step, "work": work,
                "settings": self.settings, "used": self.used, "problem": clean(self.problem, 500),
                "over": self.over.is_set()}

    def _tracked(self) -> dict[str, Any]:
        found = self.found
        assert found is not None
        rounded = {name: np.round(values, digits).tolist() for name, values, digits in (
            ("t", found.time, 6), ("y", np.degrees(found.angle), 5), ("px", found.x, 2), ("py", found.y, 2),
            ("off", np.hypot(found.x - found.pivot[0], found.y - found.pivot[1]) - found.radius.value, 3),
            ("missing", found.missing, 6))}
        return {"kind": "track", **rounded, "pivot": found.pivot, "radius": found.radius.value, "bob": found.bob,
                "arc": [float(found.angle.min()) + found.roll, float(found.angle.max()) + found.roll],
                "rows": [[clean(str(cell)) for cell in row] for row in found.table.rows],
                "text": [clean(line, 500) for line in (*found.verdict, *found.notes)]}


def _given(wanted: Mapping[str, Any]) -> dict[str, Any]:
    """Return the page's settings; those that are empty are None."""
    return {name: wanted.get(name) or None for name in SETTINGS}


def _without_none(settings: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in settings.items() if value is not None}


class FilmHandler(Handler):
    """Answers of the page's server: the document, and frames of the film at ``frame/SECONDS``."""

    pictures = "data: 'self'"

    @property
    def desk(self) -> FilmDesk:
        """The desk behind the page."""
        desk = self.server.desk
        assert isinstance(desk, FilmDesk)
        return desk

    def document(self, nonce: str) -> str:
        """Return the page's HTML."""
        return document(nonce)

    def file(self, place: str) -> bool:
        """Answer a request for a frame; return False for another place."""
        wanted = re.fullmatch(r"frame/(\d{1,6}(?:\.\d{1,9})?)", place)
        if not wanted or not math.isfinite(float(wanted[1])):
            return False
        self.answer(self.desk.shots.at(float(wanted[1]))[1], "image/jpeg")
        return True


def document(nonce: str) -> str:
    """Return the page's HTML; ``nonce`` marks its own style and script, and the browser runs no other."""
    return filled(ASSETS / "film.html", STYLES, SCRIPTS, {}, nonce, software=escape(software()))


__all__ = ["FilmDesk", "ServedFilm", "serve", "served"]
