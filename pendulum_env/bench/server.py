"""A page in the browser of this machine alone: the server, who may ask it, and the events and orders of a page.

The address holds a random token. A request is answered only with the token, under the name 127.0.0.1 or localhost (a
foreign name that resolves to this machine is refused), and, where the browser names an origin, from this page. What
happens goes to the page as server-sent events, orders come back as JSON. Whose page it is has a desk and a handler.
"""

from __future__ import annotations

import hmac
import json
import queue
import re
import secrets
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, Protocol
from urllib.parse import unquote

from pendulum_env.bench.session import sentence
from pendulum_env.web.document import variables

HOST = "127.0.0.1"
"""The only address at which the server listens."""
LONGEST = 65_536
"""Largest order that is read [bytes]."""
QUIET = 5.0
"""Time [s] without events after which a comment is sent, so that a closed page is noticed."""


class Desk(Protocol):
    """What stands behind a page: it carries out orders, and gives each open page a queue of events as JSON.

    None in a queue ends the page. ``close`` ends all of them.
    """

    def do(self, what: str, wanted: Mapping[str, Any]) -> dict[str, Any]:
        """Carry out an order of the page and return the answer; an error is said on the page."""

    def listen(self) -> queue.Queue[str | None]:
        """Return a queue of events for one page, which begins with all that a new page needs."""

    def leave(self, page: queue.Queue[str | None]) -> None:
        """Forget a page that was closed."""

    def close(self) -> None:
        """End the work and all pages."""


@contextmanager
def serving(desk: Desk, handler: type[Handler]) -> Iterator[str]:
    """Serve a desk's page within a ``with`` block, which yields its address; at the end the desk is closed."""
    server = Server(desk, handler)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True)
    thread.start()
    try:
        yield f"http://{HOST}:{server.server_port}/{server.token}/"
    finally:
        desk.close()
        server.shutdown()
        server.server_close()
        thread.join()


class Server(ThreadingHTTPServer):
    """The server of one desk, on a free port of this machine."""

    daemon_threads = True
    block_on_close = False

    def __init__(self, desk: Desk, handler: type[Handler]) -> None:
        super().__init__((HOST, 0), handler)
        self.desk, self.token = desk, secrets.token_urlsafe(24)
        names = (f"{HOST}:{self.server_port}", f"localhost:{self.server_port}")
        self.hosts, self.origins = names, tuple(f"http://{name}" for name in names)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of pages that were closed while something was sent to them."""


class Handler(BaseHTTPRequestHandler):
    """Answers of a page's server: who may ask, events and orders; a page's own handler has the document and its files.
    """

    server: Server
    server_version, sys_version = "LabPendulum", ""
    disable_nagle_algorithm = True
    timeout = 30.0  # for a request that never comes
    pictures = "data:"  # from where pictures may come

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
            refused = "The address needs the token that lab-pendulum printed."
        else:
            return unquote(place)
        self.answer(refused.encode(), "text/plain; charset=utf-8", HTTPStatus.FORBIDDEN)
        return None

    def do_GET(self) -> None:
        """Answer a request for the page, its events, or one of its files."""
        place = self._place()
        if place is None:
            return
        if place == "":
            nonce = secrets.token_urlsafe(16)
            policy = (f"default-src 'none'; script-src 'nonce-{nonce}'; style-src 'nonce-{nonce}'; connect-src 'self'; "
                      f"img-src {self.pictures}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'")
            self.answer(self.document(nonce).encode(), "text/html; charset=utf-8", policy=policy)
        elif place == "events":
            self._events()
        elif not self.file(place):
            self.answer(b"There is no such place.", "text/plain; charset=utf-8", HTTPStatus.NOT_FOUND)

    def document(self, nonce: str) -> str:
        """Return the page's HTML; ``nonce`` marks its own style and script, and the browser runs no other."""
        raise NotImplementedError

    def file(self, place: str) -> bool:
        """Answer a request for a file of the page; return False if there is none at the place."""
        return False

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
            self._json(self.server.desk.do(what, wanted))
        except Exception as error:  # said on the page, which stays alive
            self._json({"error": sentence(error)})

    def _events(self) -> None:
        """Send events until the page is closed."""
        page = self.server.desk.listen()
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
            self.server.desk.leave(page)

    def _json(self, answer: dict[str, Any], status: HTTPStatus = HTTPStatus.OK) -> None:
        self.answer(json.dumps(answer).encode(), "application/json", status)

    def answer(
        self, body: bytes, kind: str, status: HTTPStatus = HTTPStatus.OK, *, policy: str = "default-src 'none'",
        headers: dict[str, str] | None = None,
    ) -> None:
        """Send an answer of a type, under a policy that by default lets nothing of it run."""
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


def filled(layout: Path, styles: tuple[Path, ...], scripts: tuple[Path, ...], data: Mapping[str, Any], nonce: str,
           **texts: str) -> str:
    """Return a page's HTML from its layout, whose places ``{{style}}``, ``{{script}}``, ``{{data}}``, ``{{nonce}}`` and
    those of other texts are filled."""
    parts = {
        **texts, "nonce": nonce,
        "style": "\n".join([variables(), *(path.read_text(encoding="utf-8") for path in styles)]),
        "script": "\n".join(path.read_text(encoding="utf-8") for path in scripts),
        "data": json.dumps(data, allow_nan=False).replace("<", "\\u003c"),
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], layout.read_text(encoding="utf-8"))
