"""Requests and orders to a page of this machine alone, as its browser makes them, or as a stranger would."""

from __future__ import annotations

import http.client
import json
import time
from collections.abc import Callable
from typing import Any, Protocol
from urllib.parse import urlsplit


class HasAddress(Protocol):
    """A page that is being served at an address, which ends in its token and a slash."""

    address: str


def asked(
    page: HasAddress, path: str = "", method: str = "GET", body: bytes | None = None, **headers: str,
) -> tuple[int, bytes]:
    """Ask the page's server; headers are named with underscores, and ``path`` stands for what follows the token."""
    parts = urlsplit(page.address)
    connection = http.client.HTTPConnection(parts.hostname or "", parts.port, timeout=60)
    own = {name.replace("_", "-"): value for name, value in headers.items()}
    try:
        connection.request(method, path if path.startswith("/") else parts.path + path, body, own)
        answer = connection.getresponse()
        return answer.status, answer.read()
    finally:
        connection.close()


def ordered(page: HasAddress, what: str, **wanted: Any) -> dict[str, Any]:
    """Give an order as the page does; returns the answer."""
    body = json.dumps({"what": what, **wanted}).encode()
    origin = page.address[:page.address.rindex("/", 0, -1)]
    code, text = asked(page, "do", "POST", body, Content_Type="application/json", Origin=origin)
    assert code == 200, text
    return dict(json.loads(text))


def when(true: Callable[[], Any], seconds: float = 20.0) -> Any:
    """Wait until something is true, and return it."""
    end = time.monotonic() + seconds
    while not (value := true()):
        assert time.monotonic() < end
        time.sleep(0.01)
    return value
