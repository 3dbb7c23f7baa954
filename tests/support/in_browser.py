"""A page in a real browser, Chromium, driven by playwright, with every request to anywhere refused."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from itertools import cycle
from pathlib import Path
from typing import Any

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
QUIET = ("--no-sandbox", "--disable-gpu", "--disable-background-networking")
SMALLEST = """
Math.min(...[...document.querySelectorAll("body *")].filter((x) => x.checkVisibility() && x.childNodes.length
    && [...x.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim()) && !x.closest("script, style")).map(
    (x) => parseFloat(getComputedStyle(x).fontSize)))
"""
"""Script that returns the size of the smallest text of the page [CSS pixels]."""
OVERLAPPING = """
(() => { const shown = [...document.querySelectorAll("button, input, select, output, a, td, p, label")].filter(
      (x) => x.checkVisibility() && x.textContent.trim() + (x.value ?? "") !== "");
    const boxes = shown.map((x) => [x, x.getBoundingClientRect()]), found = [];
    for (const [a, p] of boxes) for (const [b, q] of boxes) {
        if (a === b || a.contains(b) || b.contains(a) || a.closest("#transport") || b.closest("#transport")) continue;
        const w = Math.min(p.right, q.right) - Math.max(p.left, q.left);
        const h = Math.min(p.bottom, q.bottom) - Math.max(p.top, q.top);
        if (w > 2 && h > 2) found.push(`${a.id || a.textContent} on ${b.id || b.textContent}`); }
    return found; })()
"""
"""Script that returns the pairs of controls and texts that lie on each other."""


@dataclass
class Opened:
    """A file in the browser: playwright's page, what it asked the network for, and its errors."""

    page: Any
    asked: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)


def opened(file: Path, **options: Any) -> AbstractContextManager[Opened]:
    """Open a file from disk; ``options`` are those of a browser context, such as ``viewport``.

    Without Chromium or playwright the test counts as skipped. In the end the page must have asked for nothing and have
    had no errors.
    """
    address = file.as_uri()
    return visited(address, lambda url: url.split("#")[0].split("?")[0] == address, **options)


@contextmanager
def visited(address: str, own: Callable[[str], bool] | None = None, **options: Any) -> Iterator[Opened]:
    """Open a page at an address as :func:`opened` does; it may ask only for what is ``own``, by default what is below
    its address.
    """
    allowed = (lambda url: url.startswith(address)) if own is None else own
    if CHROMIUM is None:
        pytest.skip("there is no chromium")
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=list(QUIET))
        try:
            page = browser.new_context(**options).new_page()
            seen = Opened(page)

            def answer(route: Any) -> None:
                if allowed(route.request.url):
                    route.continue_()
                    return
                seen.asked.append(route.request.url)
                route.abort()

            page.route("**/*", answer)
            page.on("pageerror", lambda error: seen.errors.append(str(error)))
            page.on("console", lambda line: seen.errors.append(line.text) if line.type == "error" else None)
            page.goto(address)
            yield seen
        finally:
            browser.close()
    assert seen.asked == []
    assert seen.errors == []


def at_widths(seen: Opened) -> Iterator[int]:
    """Open the page again at every width [CSS pixels] from a phone's to a screen's, in light and dark by turns."""
    schemes = cycle(("light", "dark"))
    for width in (320, 360, 768, 1000, 1280, 2560):
        seen.page.set_viewport_size({"width": width, "height": 800})
        seen.page.emulate_media(color_scheme=next(schemes))
        seen.page.reload()
        yield width


def until(seen: Opened, script: str, seconds: float = 120.0) -> Any:
    """Return a script's value once it is true; also on pages whose policy forbids the evaluation of texts, which
    playwright's own waiting needs.
    """
    end = time.monotonic() + seconds
    while not (value := seen.page.evaluate(script)):
        assert time.monotonic() < end, f"still not true: {script}"
        seen.page.wait_for_timeout(50)
    return value
