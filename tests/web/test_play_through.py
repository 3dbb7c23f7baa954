"""A whole visit to the page by the keyboard alone and by touch alone, on a phone's screen, upright and on its side; in
Firefox by scripts."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import pytest
from in_browser import opened
from in_firefox import asked

from pendulum_env.web import read_link, write

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("interpreted")]
START = "v=1&scene=vacuum&methods=rk4:0.01&angle=0.5&velocity=0"
SIZES = {"upright": {"width": 390, "height": 844}, "on its side": {"width": 844, "height": 390}}
REACHABLE = """(() => {
    const one = document.getElementById(%r), box = one.getBoundingClientRect();
    const [x, y] = [box.left + box.width / 2, box.top + box.height / 2], at = document.elementFromPoint(x, y);
    return { x, y, free: one.contains(at), above: box.top < innerHeight / 2 };
})()"""
"""Script that returns where the middle of a control is on the screen, and whether nothing lies on it."""


class Person(Protocol):
    """Somebody at the page: what they can do there."""

    def ask(self, script: str) -> Any:
        """Return a script's value; no act of the person."""

    def press(self, name: str) -> None:
        """Press a button."""

    def slide(self, name: str) -> None:
        """Move a slider to the right."""

    def choose_another(self, name: str) -> None:
        """Choose another entry of a list."""

    def write(self, name: str, text: str) -> None:
        """Write into a field."""

    def start_elsewhere(self) -> None:
        """Give the last pendulum another start."""


class AtKeyboard:
    """Somebody with a keyboard alone; `press_key` and `ask` are the browser's."""

    def __init__(self, press_key: Callable[[str], None], ask: Callable[[str], Any]) -> None:
        self.press_key, self.ask = press_key, ask

    def reach(self, name: str) -> None:
        """Go to a control by the Tab key, and see it there."""
        for _ in range(80):
            if self.ask("document.activeElement.id") == name:
                break
            self.press_key("Tab")
        assert self.ask("document.activeElement.id") == name
        assert self.ask(REACHABLE % name)["free"], f"{name} has the focus and lies under something"

    def press(self, name: str) -> None:
        self.reach(name)
        self.press_key("Enter")

    def slide(self, name: str) -> None:
        self.reach(name)
        for _ in range(10):
            self.press_key("ArrowRight")

    def choose_another(self, name: str) -> None:
        self.reach(name)
        self.press_key("ArrowDown")

    def write(self, name: str, text: str) -> None:
        self.press_key("Shift+Tab")  # a field is entered anew, so that what is in it is chosen
        self.reach(name)
        for letter in [*text, "Tab"]:
            self.press_key(letter)

    def start_elsewhere(self) -> None:
        self.write("angle", "20")


class WithFinger:
    """Somebody with one finger on Chromium's page, and the keyboard of the screen."""

    def __init__(self, page: Any) -> None:
        self.page, self.ask = page, page.evaluate
        self.touch = page.context.new_cdp_session(page)

    def move(self, *points: tuple[float, float]) -> None:
        """Put the finger down, move it, and lift it."""
        for i, (x, y) in enumerate(points):
            kind = "touchStart" if i == 0 else "touchMove"
            self.touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [{"x": x, "y": y}]})
            self.page.wait_for_timeout(20)
        self.touch.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
        self.page.wait_for_timeout(50)

    def reach(self, name: str) -> tuple[float, float]:
        """Scroll with the finger until nothing lies on a control; return where it is."""
        for _ in range(60):
            before, at = None, self.ask(REACHABLE % name)
            while at != before:  # the page glides on after a swipe
                self.page.wait_for_timeout(100)
                before, at = at, self.ask(REACHABLE % name)
            if at["free"]:
                return at["x"], at["y"]
            width, height = (self.ask(f"inner{side}") for side in ("Width", "Height"))
            x, y, step = width - 4, 0.62 * height, 0.15 * height  # beside all sliders
            self.move((x, y), *((x, y + (step if at["above"] else -step) * part / 4) for part in (1, 2, 3, 4)))
        raise AssertionError(f"{name} cannot be reached")

    def press(self, name: str) -> None:
        self.move(self.reach(name))

    def slide(self, name: str) -> None:
        x, y = self.reach(name)
        self.move((x, y), (x + 10, y), (x + 20, y))

    def choose_another(self, name: str) -> None:
        self.reach(name)  # the list itself is the phone's
        self.page.locator(f"#{name}").select_option(index=1)

    def write(self, name: str, text: str) -> None:
        self.press(name)
        self.page.keyboard.press("Control+a")
        self.page.keyboard.type(text)
        self.page.keyboard.press("Enter")

    def start_elsewhere(self) -> None:
        seen = "LabPendulum.seen(LabPendulum.lab.lanes.at(-1))"
        at = self.ask(seen)
        side = (at["bob"]["x"] - 15, at["bob"]["y"])
        self.move((at["bob"]["x"], at["bob"]["y"]), side, side)


class ByScript:
    """Somebody who tells a browser's elements what happens to them: a script's events, for Firefox's page."""

    def __init__(self, ask: Callable[[str], Any]) -> None:
        self.ask = ask

    def press(self, name: str) -> None:
        self.ask(f"document.getElementById({name!r}).click()")

    def write(self, name: str, text: str) -> None:
        self.ask(f"""((one, value) => {{ one.value = value;
            for (const kind of ["input", "change"]) one.dispatchEvent(new Event(kind));
        }})(document.getElementById({name!r}), {text!r})""")

    def slide(self, name: str) -> None:
        self.write(name, "0.1")

    def choose_another(self, name: str) -> None:
        self.write(name, self.ask(f"document.getElementById({name!r}).options[1].value"))

    def start_elsewhere(self) -> None:
        self.ask("""(() => { const canvas = [...document.querySelectorAll("#pendulums canvas")].at(-1);
            const { x, y } = LabPendulum.seen(LabPendulum.lab.lanes.at(-1)).bob;
            canvas.setPointerCapture = () => {};
            for (const [kind, clientX] of [["down", x], ["move", x - 15], ["up", x - 15]]) {
                canvas.dispatchEvent(new PointerEvent(`pointer${kind}`, { clientX, clientY: y })); } })()""")


def wait(person: Person, script: str) -> None:
    """Wait until a script is true."""
    end = time.monotonic() + 30
    while not person.ask(script):
        assert time.monotonic() < end, (script, person.ask("document.activeElement.outerHTML"))
        time.sleep(0.05)


def play_through(person: Person) -> None:
    """Do what a class does, and find each thing done; in the end Python reads the link."""
    ask, press = person.ask, person.press
    wait(person, "LabPendulum.lab.checked !== null && LabPendulum.lab.lanes.length === 1")
    wait(person, "LabPendulum.lab.playing && LabPendulum.lab.time > 0")
    press("play")
    wait(person, "!LabPendulum.lab.playing")
    if ask("document.getElementById('tab-controls').checkVisibility()"):
        press("tab-controls")
    person.slide("setting-0-slider")
    wait(person, "LabPendulum.lab.lanes[0].values[0] > 1")
    length = ask("LabPendulum.lab.lanes[0].values[0]")
    assert length < 2.5
    press("add")
    wait(person, "LabPendulum.lab.lanes.length === 2")
    press("whose-2")
    person.write("setting-0", "0.5")
    wait(person, "LabPendulum.lab.lanes[1].values[0] === 0.5")
    assert ask("LabPendulum.lab.lanes[0].values[0]") == length
    person.choose_another("method-1")
    wait(person, "LabPendulum.lab.lanes[1].method !== 'rk4'")
    method = ask("LabPendulum.lab.lanes[1].method")
    person.start_elsewhere()
    wait(person, "LabPendulum.lab.lanes[1].angle !== 0.5")
    first, second = ask("LabPendulum.lab.lanes.map((lane) => lane.angle)")
    assert first == 0.5
    assert 0.05 < second < 0.49
    press("watch")
    press("play")
    wait(person, "LabPendulum.lab.time > 0.5")
    press("watch")
    stopped = ask("document.getElementById('watch').textContent")
    press("play")
    assert float(stopped.removesuffix(" s")) > 0.4
    assert ask("LabPendulum.lab.time") > 0.5
    press("link")
    link = ask("document.getElementById('text').value")
    for i, (name, metres, angle) in enumerate((("rk4", length, first), (method, 0.5, second)), 1):
        spec = read_link(link, i)
        assert spec.start is not None
        assert (spec.method.name, spec.scene.body.reach, float(spec.start[0])) == (name, metres, angle)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("page") / "lab.html", ["vacuum"], ["rk4", "velocity_verlet", "gauss4"])


@pytest.mark.parametrize("size", SIZES)
def test_by_keyboard_alone(size: str, file: Path) -> None:
    with opened(file, viewport=SIZES[size]) as seen:
        seen.page.evaluate(f"location.hash = {START!r}")
        play_through(AtKeyboard(seen.page.keyboard.press, seen.page.evaluate))


@pytest.mark.parametrize("size", SIZES)
def test_by_touch_alone(size: str, file: Path) -> None:
    with opened(file, viewport=SIZES[size], has_touch=True, is_mobile=True) as seen:
        seen.page.evaluate(f"location.hash = {START!r}")
        play_through(WithFinger(seen.page))


def test_by_script_in_firefox(file: Path, tmp_path: Path) -> None:
    with asked(file, tmp_path) as page:
        page.evaluate(f"location.hash = {START!r}")
        play_through(ByScript(page.evaluate))
