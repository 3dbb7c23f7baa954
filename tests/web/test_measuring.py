"""Ruler, protractor and arrows of force on the page: true to the drawing's scale and to the closed forms."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from in_browser import Opened, opened

from pendulum_env import SCENES
from pendulum_env.web import write

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("interpreted")]
LENGTH = SCENES["vacuum"].body.reach
GRAVITY = 9.7
NUMBERS = """() => {
    const found = {}, canvas = document.querySelector("#pendulums canvas"), c = canvas.getContext("2d");
    c.fillText = (text, x, y) => { if (/^\\d+$/.test(text)) found[text] = [x, y]; };
    LabPendulum.show();
    delete c.fillText;
    return found;
}"""
"""Script that returns where the first picture has whole numbers [CSS pixels]."""


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("page") / "lab.html", ["vacuum", "kapitza"], ["rk4"])


@pytest.fixture
def still(file: Path) -> Iterator[Opened]:
    """A page whose pendulum waits at 0.5 rad."""
    with opened(file, reduced_motion="reduce", viewport={"width": 1400, "height": 1000}) as seen:
        begin(seen, f"v=1&scene=vacuum&methods=rk4:0.001&angle=0.5&velocity=0&gravity={GRAVITY}")
        yield seen


def begin(seen: Opened, link: str) -> None:
    seen.page.evaluate(f"location.hash = {link!r}")
    seen.page.wait_for_function(f"LabPendulum.linkText(false).includes({link.split('&')[2]!r})")


def read(seen: Opened, name: str) -> float:
    """Return the number that stands behind a word below the first pendulum."""
    text = seen.page.locator(f"#pendulums .{name} + dd").first.inner_text().replace("\N{MINUS SIGN}", "-")
    return float(re.fullmatch(r"(-?[\d.]+)( cm|°)", text)[1])  # type: ignore[index]


def where(seen: Opened) -> dict[str, Any]:
    found: dict[str, Any] = seen.page.evaluate("LabPendulum.seen(LabPendulum.lab.lanes[0])")
    return found


@pytest.mark.parametrize("degrees", [4, 30, 170])
def test_centimetres_of_the_ruler_are_those_of_the_drawing(degrees: int, still: Opened) -> None:
    """The swing of 4 degrees is drawn larger than that of 170, and the ruler with it."""
    still.page.check("#show-ruler")
    still.page.fill("#angle", str(degrees))
    still.page.press("#angle", "Enter")
    at = where(still)
    drawn = math.hypot(at["bob"]["x"] - at["x"], at["bob"]["y"] - at["y"])
    numbers = still.page.evaluate(NUMBERS)
    assert len(numbers) > 1
    first, last = min(numbers, key=int), max(numbers, key=int)
    apart = math.dist(numbers[first], numbers[last])
    assert apart / (int(last) - int(first)) == pytest.approx(drawn / (100 * LENGTH), rel=1e-6)


def test_the_ruler_is_put_by_arrow_keys_and_read(still: Opened) -> None:
    page = still.page
    assert page.is_hidden("#tool-down")
    assert page.locator("#pendulums .ruler").first.is_hidden()
    page.check("#show-ruler")
    assert read(still, "ruler") == pytest.approx(100 * LENGTH * math.cos(0.5), abs=0.051)
    page.focus("#tool-down")
    for _ in range(7):
        page.keyboard.press("ArrowRight")
    assert page.evaluate("LabPendulum.lab.tools.down") == pytest.approx(0.007)
    assert page.get_attribute("#tool-down", "aria-valuetext") == "0.7 cm"
    assert read(still, "ruler") == pytest.approx(100 * LENGTH * math.cos(0.5) - 0.7, abs=0.051)
    page.fill("#tool-across", "10")
    page.fill("#tool-turned", "0")
    assert read(still, "ruler") == pytest.approx(100 * LENGTH * math.sin(0.5) - 10, abs=0.051)
    page.fill("#angle", "-20")
    page.press("#angle", "Enter")
    wanted = -100 * LENGTH * math.sin(math.radians(20)) - 10
    assert read(still, "ruler") == pytest.approx(wanted, abs=0.051)
    page.click("#play")
    page.click("#play")
    label = page.get_attribute("#pendulums canvas", "aria-label")
    assert "on the ruler" in label
    assert "on the ruler" in page.text_content("#spoken")


def test_ruler_and_hand_are_dragged_and_the_bob_stays(still: Opened) -> None:
    page = still.page
    page.check("#show-ruler")
    page.check("#show-protractor")
    at = where(still)
    scale = math.hypot(at["bob"]["x"] - at["x"], at["bob"]["y"] - at["y"]) / LENGTH
    tools = page.evaluate("LabPendulum.lab.tools")

    def drag(start: tuple[float, float], end: tuple[float, float]) -> dict[str, float]:
        page.mouse.move(*start)
        page.mouse.down()
        page.mouse.move(*end, steps=3)
        page.mouse.up()
        found: dict[str, float] = page.evaluate("LabPendulum.lab.tools")
        return found

    zero = (at["x"] + scale * tools["across"], at["y"] + scale * tools["down"] + 5)
    moved = drag(zero, (zero[0] - 120, zero[1] - 30))
    assert moved["across"] == pytest.approx(tools["across"] - 120 / scale, abs=1e-9)
    assert moved["down"] == pytest.approx(tools["down"] - 30 / scale, abs=1e-9)
    start = (at["x"] + scale * moved["across"], at["y"] + scale * moved["down"])
    turned = drag((start[0], start[1] + scale * moved["long"]), (start[0] + 100, start[1] + 100))
    assert turned["turned"] == 45
    tip = 0.8 * LENGTH * scale
    hand = math.radians(tools["hand"])
    held = drag((at["x"] + tip * math.sin(hand), at["y"] + tip * math.cos(hand)), (at["x"] - 100, at["y"] + 100))
    assert held["hand"] == -45
    assert page.get_attribute("#tool-hand", "aria-valuetext") == "\N{MINUS SIGN}45.0°"
    assert page.evaluate("LabPendulum.lab.lanes[0].angle") == 0.5
    assert read(still, "protractor") == pytest.approx(math.degrees(0.5), abs=0.051)


@pytest.mark.parametrize("time", [0.0, 0.3, 0.83])
def test_what_is_no_weight_is_the_pull_of_the_rod(time: float, still: Opened) -> None:
    """Without drag all other forces are the rod's: m (g cos(angle) + L velocity²), along it."""
    still.page.wait_for_function(f"(LabPendulum.advance({time}), LabPendulum.lab.time === {time})")
    motion, angle, velocity = still.page.evaluate(
        "(({ motion, machine: { last } }) => [motion, last.angle, last.velocity])(LabPendulum.lab.lanes[0])")
    pull = GRAVITY * math.cos(angle) + LENGTH * velocity**2
    assert motion["weight"] == GRAVITY
    assert motion["pull"] == pytest.approx([-pull * math.sin(angle), -pull * math.cos(angle)], abs=0.003 * GRAVITY)


def test_a_shaken_pivot_adds_its_acceleration_to_the_pull(still: Opened) -> None:
    """At the highest point of its pivot, hanging straight down: pull / m = g - amplitude rate²."""
    begin(still, "v=1&scene=kapitza&methods=rk4:0.0005&angle=0&velocity=0")
    values = {one["name"]: one["value"] for one in still.page.evaluate(
        "JSON.parse(document.getElementById('data').textContent).scenes.kapitza.settings")}
    amplitude, rate = (next(value for name, value in values.items() if name.endswith(f"vertical_{what}"))
                       for what in ("amplitude", "rate"))
    pull = still.page.evaluate("LabPendulum.lab.lanes[0].motion.pull")
    assert pull == pytest.approx([0.0, -(values["gravity"] - amplitude * rate**2)], rel=1e-6, abs=1e-6)
