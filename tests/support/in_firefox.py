"""A page in Debian's Firefox, driven through its own remote protocol (WebDriver BiDi)."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

FIREFOX = shutil.which("firefox-esr") or shutil.which("firefox")
LISTENING = re.compile(r"WebDriver BiDi listening on (ws://\S+)")


@dataclass
class Asked:
    """A page in Firefox: what a script returns there.

    Its window is not the active one, so that keys by the protocol press no button and end no field.
    """

    socket: Any
    place: str = ""
    count: int = field(default=0)

    def call(self, method: str, **parameters: Any) -> Any:
        """Return the result of a command of the protocol."""
        self.count += 1
        self.socket.send(json.dumps({"id": self.count, "method": method, "params": parameters}))
        while (answer := json.loads(self.socket.recv(timeout=120))).get("id") != self.count:
            pass
        assert answer["type"] == "success", answer
        return answer["result"]

    def evaluate(self, script: str) -> Any:
        """Return the value of a script, by way of JSON."""
        result = self.call("script.evaluate", expression=f"JSON.stringify([{script}])", awaitPromise=False,
                           target={"context": self.place})
        assert result["type"] == "success", result
        return json.loads(result["result"]["value"])[0]


@contextmanager
def asked(file: Path, profile: Path) -> Iterator[Asked]:
    """Open a file in Firefox, with a folder for its profile.

    Without Firefox or websockets the test counts as skipped.
    """
    if FIREFOX is None:
        pytest.skip("there is no firefox")
    client = pytest.importorskip("websockets.sync.client")
    command = [FIREFOX, "--headless", "--no-remote", "--remote-debugging-port=0", "--profile", str(profile)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                               env={**os.environ, "HOME": str(profile)})
    try:
        assert process.stderr is not None
        address = next(found[1] for line in process.stderr if (found := LISTENING.search(line)))
        with client.connect(f"{address}/session", max_size=None) as socket:
            page = Asked(socket)
            page.call("session.new", capabilities={})
            page.place = page.call("browsingContext.getTree")["contexts"][0]["context"]
            page.call("browsingContext.navigate", context=page.place, url=file.as_uri(), wait="complete")
            yield page
    finally:
        process.kill()
        process.communicate()


def evaluated(file: Path, script: str, profile: Path, wanted: str, seconds: float = 120.0) -> str:
    """Open a file, and evaluate a script that returns a text, until a pattern is found in it; return the text."""
    with asked(file, profile) as page:
        end = time.monotonic() + seconds
        while not re.search(wanted, text := str(page.evaluate(script))):
            assert time.monotonic() < end, f"{wanted} was not found in {text}"
            time.sleep(0.5)
        return text
