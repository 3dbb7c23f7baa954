"""The page of ``lab-pendulum acquire``: its document, its files, and the session behind it on this machine's server."""

from __future__ import annotations

import mimetypes
import re
import threading
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from html import escape
from pathlib import Path
from urllib.parse import quote

from integrators import METHODS
from pendulum_env.bench.server import Handler, filled, serving
from pendulum_env.bench.session import Beside, Session
from pendulum_env.bench.source import Source
from pendulum_env.common.texts import clean
from pendulum_env.common.version import software
from pendulum_env.engine.machine import fitting
from pendulum_env.physics.presets import PURPOSES, SCENES, find_scene
from pendulum_env.web.document import ASSETS as WEB
from pendulum_env.web.document import SHOWN_METHODS, titled

ASSETS = Path(__file__).with_name("assets")
"""Folder of the page's layout, styles and script."""
SCRIPTS = (WEB / "elements.js", WEB / "languages.js", WEB / "drawing.js", WEB / "plots.js", ASSETS / "server.js",
           ASSETS / "readings.js", ASSETS / "acquire.js")
"""Scripts of the page, in the order in which they stand in it; the first four are the lab's."""
STYLES = (WEB / "page.css", ASSETS / "layout.css", ASSETS / "acquire.css")
"""Styles of the page, those of the lab first."""


@dataclass
class Served:
    """A page that is being served.

    Attributes:
        address: its address, with the token.
        session: the acquisition behind it.
    """

    address: str
    session: Session


def serve(
    source: Source, *, out: Path, force: bool = False, scene: str = "lab", integrator: str = "rk4",
    open_browser: bool = True,
) -> None:
    """Serve the page of a source until Ctrl-C, and print its address.

    Args:
        source: the sensor, or what stands for one.
        out: file that the page's "Save" writes. Each run has a journal beside it, ``swing-run1.csv`` for ``swing.csv``,
            written as samples come; no journal replaces a file.
        force: True lets "Save" replace an existing ``out``.
        scene, integrator: simulation that the page offers beside the swing, a preset's name or a scene's JSON file, and
            a method's name.
        open_browser: False only prints the address.

    Raises SourceError if the source cannot be opened, SceneError and MethodError for unknown names.
    """
    with served(source, out=out, force=force, scene=scene, integrator=integrator) as page:
        print(f"The page is at {page.address} (Ctrl-C ends it).", flush=True)
        if open_browser:
            webbrowser.open(page.address)
        with suppress(KeyboardInterrupt):
            threading.Event().wait()
        session = page.session
    for path in dict.fromkeys([*session.journals, *session.saved]):
        print(f"wrote {clean(str(path), None)}")


@contextmanager
def served(
    source: Source, *, out: Path, force: bool = False, scene: str = "lab", integrator: str = "rk4",
) -> Iterator[Served]:
    """Serve the page within a ``with`` block; arguments and errors are those of :func:`serve`."""
    session = Session(source, Path(out), force, Beside(scene, integrator))
    session.open()
    try:
        with serving(session, AcquireHandler) as address:
            yield Served(address, session)
    finally:
        session.close()


class AcquireHandler(Handler):
    """Answers of the page's server: the document, the run's file and the report."""

    def document(self, nonce: str) -> str:
        """Return the page's HTML."""
        return document(self.session, nonce)

    @property
    def session(self) -> Session:
        """The session behind the page."""
        desk = self.server.desk
        assert isinstance(desk, Session)
        return desk

    def file(self, place: str) -> bool:
        """Answer a request for the run's file or the report; return False for another place."""
        session = self.session
        if place == "file" and session.file is not None:
            name = quote(session.saved[-1].name if session.saved else session.file.name, safe="")
            text = session.saved[-1].read_bytes() if session.saved else session.so_far()
            self.answer(text, "text/csv; charset=utf-8",
                        headers={"Content-Disposition": f"attachment; filename*=UTF-8''{name}"})
        elif (file := self._of_report(place)) is not None:
            kind = mimetypes.guess_type(file.name)[0] or "application/octet-stream"
            # its scripts run, but as those of a stranger, who cannot give orders here
            self.answer(file.read_bytes(), f"{kind}; charset=utf-8" if kind.startswith("text") else kind,
                        policy="sandbox allow-scripts allow-downloads allow-modals")
        else:
            return False
        return True

    def _of_report(self, place: str) -> Path | None:
        """Return the file of a report at a path such as report/1/report.html; None for any other."""
        found = re.fullmatch(r"report/(\d+)/([\w.-]+)", place)
        folder = self.session.folders.get(found[1]) if found else None
        file = folder / found[2] if folder is not None and found is not None else None
        return file if file is not None and file.is_file() else None


def document(session: Session, nonce: str) -> str:
    """Return the page's HTML; ``nonce`` marks its own style and script, and the browser runs no other."""
    beside = session.beside
    own = find_scene(beside.scene)
    scenes = {name: scene for name, scene in SCENES.items() if scene.omega0 > 0.0} | {beside.scene: own}
    shown = dict.fromkeys([*SHOWN_METHODS, beside.integrator])
    data = {
        "software": software(),
        "scenes": {name: {"about": PURPOSES.get(name, ""), "length": scene.body.reach,
                          "methods": [method for method in shown if method in set(fitting(scene))]}
                   for name, scene in scenes.items()},
        "methods": {name: titled(name) for name in shown if name in METHODS},
        "body": {"radius": own.body.radius, "reach": own.body.reach, "suspension": own.body.suspension,
                 "outline": own.body.outline},
    }
    return filled(ASSETS / "acquire.html", STYLES, SCRIPTS, data, nonce, software=escape(software()))


__all__ = ["Served", "serve", "served"]
