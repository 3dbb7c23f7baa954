"""The page of ``lab-pendulum acquire``: a server for this machine alone, and the file that it gives to the browser.

The address holds a random token. A request is answered only with the token, under the name 127.0.0.1 or localhost (a
foreign name that resolves to this machine is refused), and, where the browser names an origin, from this page. Samples
and state go to the page as server-sent events, orders come back as JSON.
"""

from __future__ import annotations

import hmac
import json
import mimetypes
import queue
import re
import secrets
import threading
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from html import escape
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

from integrators import METHODS
from pendulum_env.bench.session import Beside, Session, sentence
from pendulum_env.bench.source import Source
from pendulum_env.common.texts import clean
from pendulum_env.common.version import __version__
from pendulum_env.engine.machine import fitting
from pendulum_env.physics.presets import PURPOSES, SCENES, find_scene
from pendulum_env.web.document import ASSETS as WEB
from pendulum_env.web.document import SHOWN_METHODS, titled, variables

ASSETS = Path(__file__).with_name("assets")
"""Folder of the page's layout, styles and script."""
SCRIPTS = (WEB / "elements.js", WEB / "drawing.js", WEB / "plots.js", ASSETS / "readings.js", ASSETS / "acquire.js")
"""Scripts of the page, in the order in which they stand in it; the first three are the lab's."""
STYLES = (WEB / "lab.css", ASSETS / "acquire.css")
"""Styles of the page, those of the lab first."""
HOST = "127.0.0.1"
"""The only address at which the server listens."""
LONGEST = 65_536
"""Largest order that is read [bytes]."""
QUIET = 5.0
"""Time [s] without events after which a comment is sent, so that a closed page is noticed."""


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
        server = Server(session)
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True)
        thread.start()
        try:
            yield Served(f"http://{HOST}:{server.server_port}/{server.token}/", session)
        finally:
            session.close()
            server.shutdown()
            server.server_close()
            thread.join()
    finally:
        session.close()


class Server(ThreadingHTTPServer):
    """The server of one session, on a free port of this machine."""

    daemon_threads = True
    block_on_close = False

    def __init__(self, session: Session) -> None:
        super().__init__((HOST, 0), Handler)
        self.session, self.token = session, secrets.token_urlsafe(24)
        names = (f"{HOST}:{self.server_port}", f"localhost:{self.server_port}")
        self.hosts, self.origins = names, tuple(f"http://{name}" for name in names)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of pages that were closed while something was sent to them."""


class Handler(BaseHTTPRequestHandler):
    """Answers of the page's server."""

    server: Server
    server_version, sys_version = "LabPendulum", ""
    disable_nagle_algorithm = True
    timeout = 30.0  # for a request that never comes

    def log_message(self, format: str, *args: Any) -> None:
        """Write no lines about requests to the terminal."""

    def _place(self) -> str | None:
        """Return the path behind the token; None, after the answer, for a request that is refused."""
        host, origin, site = (self.headers.get(name) for name in ("Host", "Origin", "Sec-Fetch-Site"))
        token, _, place = self.path.split("?")[0].removeprefix("/").partition("/")
        if host not in self.server.hosts:
            refused = "This server answers under the name 127.0.0.1 only."
        elif (origin is not None and origin not in self.server.origins) or site not in (None, "none", "same-origin"):
            refused = "Other pages may not use this server."
        elif not hmac.compare_digest(token.encode("utf-8", "replace"), self.server.token.encode()):
            refused = "The address needs the token that lab-pendulum acquire printed."
        else:
            return unquote(place)
        self._answer(refused.encode(), "text/plain; charset=utf-8", HTTPStatus.FORBIDDEN)
        return None

    def do_GET(self) -> None:
        """Answer a request for the page, its events, the run's file, or the report."""
        place = self._place()
        if place is None:
            return
        session = self.server.session
        if place == "":
            nonce = secrets.token_urlsafe(16)
            policy = (f"default-src 'none'; script-src 'nonce-{nonce}'; style-src 'nonce-{nonce}'; connect-src 'self'; "
                      "img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'")
            self._answer(document(session, nonce).encode(), "text/html; charset=utf-8", policy=policy)
        elif place == "events":
            self._events()
        elif place == "file" and session.file is not None:
            name = quote(session.saved[-1].name if session.saved else session.file.name, safe="")
            text = session.saved[-1].read_bytes() if session.saved else session.so_far()
            self._answer(text, "text/csv; charset=utf-8",
                         headers={"Content-Disposition": f"attachment; filename*=UTF-8''{name}"})
        elif (file := self._of_report(place)) is not None:
            kind = mimetypes.guess_type(file.name)[0] or "application/octet-stream"
            # its scripts run, but as those of a stranger, who cannot give orders here
            self._answer(file.read_bytes(), f"{kind}; charset=utf-8" if kind.startswith("text") else kind,
                         policy="sandbox allow-scripts allow-downloads allow-modals")
        else:
            self._answer(b"There is no such place.", "text/plain; charset=utf-8", HTTPStatus.NOT_FOUND)

    def do_POST(self) -> None:
        """Carry out an order of the page."""
        place = self._place()
        if place is None:
            return
        try:
            length = int(self.headers.get("Content-Length", ""))
            if place != "do" or not 0 < length <= LONGEST:
                raise ValueError
            if self.headers.get("Content-Type", "").split(";")[0] != "application/json":
                raise ValueError
            order = json.loads(self.rfile.read(length))
            what, wanted = order.pop("what"), order
        except (ValueError, KeyError, AttributeError, TypeError):
            self._json({"error": "This is no order; an order is JSON with a \"what\"."}, HTTPStatus.BAD_REQUEST)
            return
        try:
            self._json(self.server.session.do(what, wanted))
        except Exception as error:  # said on the page, which stays alive
            self._json({"error": sentence(error)})

    def _events(self) -> None:
        """Send events until the page is closed."""
        page = self.server.session.listen()
        self.send_response(HTTPStatus.OK)
        self._headers({"Content-Type": "text/event-stream", "X-Accel-Buffering": "no"})
        try:
            while True:
                try:
                    event = page.get(timeout=QUIET)
                except queue.Empty:
                    self.wfile.write(b": quiet\n\n")
                    continue
                if event is None:
                    return
                self.wfile.write(f"data: {event}\n\n".encode())
        except OSError:
            pass  # the page was closed
        finally:
            self.server.session.leave(page)

    def _of_report(self, place: str) -> Path | None:
        """Return the file of a report at a path such as report/1/report.html; None for any other."""
        found = re.fullmatch(r"report/(\d+)/([\w.-]+)", place)
        folder = self.server.session.folders.get(found[1]) if found else None
        file = folder / found[2] if folder is not None and found is not None else None
        return file if file is not None and file.is_file() else None

    def _json(self, answer: dict[str, Any], status: HTTPStatus = HTTPStatus.OK) -> None:
        self._answer(json.dumps(answer).encode(), "application/json", status)

    def _answer(
        self, body: bytes, kind: str, status: HTTPStatus = HTTPStatus.OK, *, policy: str = "default-src 'none'",
        headers: dict[str, str] | None = None,
    ) -> None:
        self.send_response(status)
        self._headers({"Content-Type": kind, "Content-Length": str(len(body)), "Content-Security-Policy": policy,
                       **(headers or {})})
        self.wfile.write(body)

    def _headers(self, own: dict[str, str]) -> None:
        for name, value in {**own, "Cache-Control": "no-store", "Referrer-Policy": "no-referrer",
                            "X-Content-Type-Options": "nosniff", "X-Frame-Options": "DENY",
                            "Cross-Origin-Resource-Policy": "same-origin"}.items():
            self.send_header(name, value)
        self.end_headers()


def document(session: Session, nonce: str) -> str:
    """Return the page's HTML; ``nonce`` marks its own style and script, and the browser runs no other."""
    beside = session.beside
    own = find_scene(beside.scene)
    scenes = {name: scene for name, scene in SCENES.items() if scene.omega0 > 0.0} | {beside.scene: own}
    shown = dict.fromkeys([*SHOWN_METHODS, beside.integrator])
    software = f"LabPendulum {__version__}"
    data = {
        "software": software,
        "scenes": {name: {"about": PURPOSES.get(name, ""), "length": scene.body.reach,
                          "methods": [method for method in shown if method in set(fitting(scene))]}
                   for name, scene in scenes.items()},
        "methods": {name: titled(name) for name in shown if name in METHODS},
        "body": {"radius": own.body.radius, "reach": own.body.reach, "suspension": own.body.suspension,
                 "outline": own.body.outline},
    }
    parts = {
        "style": "\n".join([variables(), *(path.read_text(encoding="utf-8") for path in STYLES)]),
        "script": "\n".join(path.read_text(encoding="utf-8") for path in SCRIPTS),
        "data": json.dumps(data, allow_nan=False).replace("<", "\\u003c"),
        "nonce": nonce, "software": escape(software),
    }
    text = (ASSETS / "acquire.html").read_text(encoding="utf-8")
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], text)


__all__ = ["Served", "serve", "served"]
