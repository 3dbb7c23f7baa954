"""A script run on a page in Debian's Firefox, through its own remote protocol (WebDriver BiDi)."""

from __future__ import annotations

import asyncio
import json
import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

FIREFOX = shutil.which("firefox-esr") or shutil.which("firefox")
LISTENING = re.compile(r"WebDriver BiDi listening on (ws://\S+)")


def evaluated(file: Path, script: str, profile: Path, wanted: str, seconds: float = 120.0) -> str:
    """Open a file, and evaluate a script that returns a text, until a pattern is found in it; return the text.

    Without Firefox or websockets the test counts as skipped.
    """
    if FIREFOX is None:
        pytest.skip("there is no firefox")
    pytest.importorskip("websockets")
    command = [FIREFOX, "--headless", "--no-remote", "--remote-debugging-port=0", "--profile", str(profile)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                               env={**os.environ, "HOME": str(profile)})
    try:
        assert process.stderr is not None
        address = next(found[1] for line in process.stderr if (found := LISTENING.search(line)))
        return asyncio.run(asyncio.wait_for(_asked(address, file.as_uri(), script, wanted), seconds))
    finally:
        process.kill()
        process.communicate()


async def _asked(address: str, page: str, script: str, wanted: str) -> str:
    import websockets

    async with websockets.connect(f"{address}/session", max_size=None) as socket:
        count = 0

        async def call(method: str, **parameters: Any) -> Any:
            nonlocal count
            count += 1
            await socket.send(json.dumps({"id": count, "method": method, "params": parameters}))
            while True:
                answer = json.loads(await socket.recv())
                if answer.get("id") == count:
                    assert answer["type"] == "success", answer
                    return answer["result"]

        await call("session.new", capabilities={})
        place = (await call("browsingContext.getTree"))["contexts"][0]["context"]
        await call("browsingContext.navigate", context=place, url=page, wait="complete")
        while True:
            result = await call("script.evaluate", expression=script, target={"context": place}, awaitPromise=False)
            text = str(result["result"].get("value"))
            if re.search(wanted, text):
                return text
            await asyncio.sleep(0.5)
