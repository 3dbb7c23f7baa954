"""Tests of the page of track: its frames, who is refused, and in a real browser what a student does with it."""

from __future__ import annotations

import csv
import json
import math
import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from asked_pages import asked, ordered, when
from drawn_films import GRAVITY, NAMES, Truth, draw
from in_browser import OVERLAPPING, SMALLEST, Opened, at_widths, until, visited
from scipy.optimize import least_squares

from pendulum_env.bench.film_page import ServedFilm, document, served
from pendulum_env.lab import RecordingError

DESK = "LabPendulum.desk"
TWO = replace(NAMES["two"], seconds=8.0)
"""Two pendulums beside each other; the left one swings farther, so it is the one that is followed unless one clicks."""
OTHER_PIVOT = (TWO.pivot[0] + 190.0, TWO.pivot[1])
OTHER_PERIOD = math.tau / (1.19 * math.sqrt(GRAVITY / TWO.length))
"""The right pendulum: its pivot [pixels] and period [s]; it is drawn as A cos(2 pi t/T + 1)."""


def other_bob(at: float) -> tuple[float, float]:
    """Place of the right pendulum's bob at a time, as it is drawn."""
    angle = 0.5 * math.radians(TWO.amplitude) * math.cos(math.tau / OTHER_PERIOD * at + 1.0)
    radius = TWO.radius / 1.19**2
    return OTHER_PIVOT[0] + radius * math.sin(angle), OTHER_PIVOT[1] + radius * math.cos(angle)


def period_of(t: Any, angle: Any) -> float:
    """Period of the cosine that fits angles best."""
    def away(p: Any) -> Any:
        return p[0] + p[1] * np.cos(math.tau / p[2] * t) + p[3] * np.sin(math.tau / p[2] * t) - angle

    return float(least_squares(away, [0.0, 0.1, 1.02 * OTHER_PERIOD, 0.1]).x[2])


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Truth]:
    """The film of two pendulums, whose name is hostile."""
    path = tmp_path_factory.mktemp("films") / "<img src=x onerror=alert(2)>.mp4"
    return path, draw(TWO, path)


@pytest.fixture
def page(two: tuple[Path, Truth]) -> Iterator[ServedFilm]:
    with served(two[0]) as page:
        yield page


def test_others_are_refused(page: ServedFilm) -> None:
    order = json.dumps({"what": "track"}).encode()
    for path, headers in (("/frame/1.0", {}), ("/abc/frame/1.0", {}), ("frame/1.0", {"Host": "evil.example:80"}),
                          ("frame/1.0", {"Sec_Fetch_Site": "cross-site"}), ("", {"Origin": "http://evil.example"})):
        assert asked(page, path, **headers)[0] == 403, path
    assert asked(page, "do", "POST", order, Content_Type="application/json", Origin="null")[0] == 403
    for path in ("x", "frame/", "frame/x", "frame/-1", "frame/../../etc/passwd", "frame/1e400", "file"):
        assert asked(page, path)[0] == 404, path
    assert page.desk.found is None


@pytest.mark.slow
def test_a_frame_is_the_one_of_its_time(page: ServedFilm, two: tuple[Path, Truth]) -> None:
    """The bob of a frame, by the centroid of what is dark, is where it was drawn at that time; in any order."""
    import cv2

    truth = two[1]
    for k in (0, 1, 100, 101, 160, 30, len(truth.time) - 1, 0):
        code, text = asked(page, f"frame/{truth.time[k]:.4f}")
        assert code == 200
        picture = cv2.imdecode(np.frombuffer(text, np.uint8), cv2.IMREAD_GRAYSCALE)
        assert picture is not None
        y, x = np.mgrid[: picture.shape[0], : picture.shape[1]]
        dark = (picture < 90) & (np.hypot(x - truth.x[k], y - truth.y[k]) < 1.5 * TWO.bob)
        assert (x[dark].mean(), y[dark].mean()) == pytest.approx((truth.x[k], truth.y[k]), abs=0.5)


def test_the_document_holds_nothing_from_outside() -> None:
    text = document("n0nce")
    tags = re.findall(r"<(?:script|style)\b[^>]*>", text)
    assert len(tags) == 3
    assert all('nonce="n0nce"' in tag for tag in tags)
    rest = re.sub(r"<script.*?</script>", "", text, flags=re.S)
    assert not re.search(r"\son\w+=|javascript:|style=\"|https?://", rest)


@pytest.mark.slow
def test_orders_track_stop_and_go_on(page: ServedFilm) -> None:
    desk = page.desk
    assert ordered(page, "track") == {}
    assert "is being tracked" in ordered(page, "track").get("error", "")
    ordered(page, "stop")
    when(lambda: desk.work is None)
    assert desk.problem.startswith("Stopped") or (desk.found is not None and not desk.found.complete)
    assert "order" in ordered(page, "fly")["error"]
    assert ordered(page, "track", bob=[470.0, 10.0]) == {}
    when(lambda: desk.work is None)
    assert "nothing swings through" in desk.problem
    assert not desk.over.is_set()
    bob = other_bob(0.0)
    assert ordered(page, "go", bob=bob, pivot=OTHER_PIVOT, drop=[[3.0, 3.5]]) == {}  # tracks first
    when(desk.over.is_set)
    found = desk.found
    assert found is not None
    assert desk.used == {"bob": list(bob), "pivot": list(OTHER_PIVOT), "drop": [[3.0, 3.5]]}
    assert not np.any((found.time >= 3.0) & (found.time <= 3.5))
    assert period_of(found.time, found.angle) == pytest.approx(OTHER_PERIOD, rel=3e-4)


def test_what_is_no_film_is_refused_before_a_page_opens(tmp_path: Path) -> None:
    (tmp_path / "notes.mp4").write_text("no film")
    with pytest.raises(RecordingError, match="expected a film"), served(tmp_path / "notes.mp4"):
        raise AssertionError


# --- in a browser -----------------------------------------------------------------------------------------------------


def ready(seen: Opened) -> None:
    until(seen, f"{DESK}.state && document.getElementById('frame').naturalWidth > 0")


def clicked(seen: Opened, place: tuple[float, float]) -> None:
    """Click on the film at a place [pixels of the film]."""
    box = seen.page.locator("#frame").bounding_box()
    size = box["width"] / TWO.size[0]
    seen.page.mouse.click(box["x"] + (place[0] + 0.5) * size, box["y"] + (place[1] + 0.5) * size)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C reaches no single process there")
def test_clicks_choose_the_other_pendulum_and_the_command_goes_on(two: tuple[Path, Truth], tmp_path: Path) -> None:
    words = [sys.executable, "-m", "pendulum_env", "track"]
    with subprocess.Popen([*words, str(two[0]), "--page", "--no-browser", "--no-film", "--out", "paged"], cwd=tmp_path,
                          stdout=subprocess.PIPE, text=True, encoding="utf-8",
                          preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)) as running:
        assert running.stdout is not None
        address = re.search(r"http://127\.0\.0\.1:\d+/\S+", running.stdout.readline())
        assert address
        with visited(address[0], viewport={"width": 1280, "height": 860}) as seen:
            ready(seen)
            clicked(seen, other_bob(0.0))
            clicked(seen, OTHER_PIVOT)
            seen.page.click("#track")
            until(seen, f"{DESK}.track && !{DESK}.state.work || {DESK}.state.problem")
            box = seen.page.locator("#plot-angle").bounding_box()
            area = seen.page.evaluate(f"{DESK}.frame")
            end = seen.page.evaluate(f"{DESK}.state.end")
            from_, to = (box["x"] + area["x"] + area["w"] * at / end for at in (3.0, 3.5))
            seen.page.mouse.move(from_, box["y"] + 50)
            seen.page.mouse.down()
            seen.page.mouse.move(to, box["y"] + 60, steps=4)
            seen.page.mouse.up()
            dropped = seen.page.evaluate(f"{DESK}.drop")
            assert dropped[0] == pytest.approx([3.0, 3.5], abs=0.02)
            seen.page.click("#go")
            until(seen, f"{DESK}.state.over")
            assert "can be closed" in seen.page.inner_text("#message")
        said = running.stdout.read()
    assert running.returncode == 0
    with (tmp_path / "paged" / "track.csv").open(encoding="utf-8") as file:
        rows = list(csv.reader(line for line in file if not line.startswith("#")))[1:]
    t, angle = np.array(rows, float)[:, :2].T
    assert period_of(t, angle) == pytest.approx(OTHER_PERIOD, rel=3e-4)
    assert not np.any((t > dropped[0][0]) & (t < dropped[0][1]))
    command = re.search("Without the page: lab-pendulum track (.*)", said)
    assert command
    again = [*words, *shlex.split(command[1]), "--no-film", "--out", "plain"]
    subprocess.run(again, cwd=tmp_path, check=True, stdout=subprocess.DEVNULL)
    lines = [[line for line in (tmp_path / folder / "track.csv").read_text(encoding="utf-8").splitlines()
              if not line.startswith("#")] for folder in ("paged", "plain")]
    assert lines[0] == lines[1]


@pytest.mark.slow
def test_the_keyboard_alone(page: ServedFilm) -> None:
    with visited(page.address, viewport={"width": 1280, "height": 860}) as seen:
        ready(seen)
        keys = seen.page.keyboard

        def to(name: str) -> None:
            """Press Tab until an element has the focus, which must be seen."""
            for _ in range(60):
                keys.press("Tab")
                if seen.page.evaluate("document.activeElement.id") == name:
                    assert seen.page.evaluate("getComputedStyle(document.activeElement).outlineStyle") == "solid"
                    return
            raise AssertionError(f"Tab does not reach {name}")

        seen.page.evaluate("document.activeElement.blur()")
        keys.press(".")
        assert seen.page.evaluate(f"{DESK}.time") == pytest.approx(1.0 / TWO.fps)
        to("stage")
        for _ in range(12):
            keys.press("ArrowRight")
        keys.press("Shift+ArrowDown")
        keys.press("Enter")
        width, height = TWO.size
        assert seen.page.evaluate(f"{DESK}.places.bob") == [width / 2 + 12 * width / 60, height / 2 + 1]
        for name, value in zip(("bob-x", "bob-y"), other_bob(0.0), strict=True):
            to(name)
            keys.press("Control+a")
            keys.type(f"{value:.1f}")
        to("track")
        keys.press("Enter")
        until(seen, f"{DESK}.track && !{DESK}.state.work || {DESK}.state.problem")
        to("from")
        keys.type("1")
        to("to")
        keys.type("1.5")
        to("drop")
        keys.press("Enter")
        assert seen.page.evaluate(f"{DESK}.drop") == [[1, 1.5]]
        to("go")
        keys.press("Enter")
        until(seen, f"{DESK}.state.over")
    assert page.desk.found is not None
    assert period_of(page.desk.found.time, page.desk.found.angle) == pytest.approx(OTHER_PERIOD, rel=3e-4)


@pytest.mark.slow
def test_the_page_fits_every_width(page: ServedFilm) -> None:
    """Each in light or in dark, as the page of ``acquire``."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright")
    ordered(page, "track", drop=[[1.0, 1.5]])
    when(lambda: page.desk.found)
    with visited(page.address) as seen:
        seen.page.on("dialog", lambda dialog: seen.errors.append(dialog.message))
        for width in at_widths(seen):
            ready(seen)
            until(seen, f"{DESK}.track")
            seen.page.click("#more summary")
            assert "<img" in seen.page.inner_text("#source")
            assert seen.page.evaluate("document.documentElement.scrollWidth <= innerWidth"), width
            assert seen.page.evaluate(SMALLEST) >= 12.0, width
            assert seen.page.evaluate(OVERLAPPING) == [], width
            found = axe.Axe().run(seen.page)
            assert found.violations_count == 0, (width, found.generate_report())
