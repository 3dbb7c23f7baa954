"""Tests of the page: what its file holds, and in a real browser what a person does with it."""

from __future__ import annotations

import base64
import json
import math
import re
import sys
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import Here
from folder_contents import contents
from in_browser import Opened, opened
from in_firefox import evaluated
from link_cases import LINKS as GRAMMAR
from scipy.integrate import solve_ivp
from scipy.special import ellipk

import integrators
import pendulum_env
from pendulum_env import SCENES, rollout
from pendulum_env.engine.machine import fitting
from pendulum_env.engine.rollout import run
from pendulum_env.lab.simulated import simulated_recording
from pendulum_env.web import document, page, read_link, write
from pendulum_env.web.document import ASSETS, SHOWN_METHODS, SHOWN_SCENES
from pendulum_env.web.formulas import explicit

pytestmark = pytest.mark.usefixtures("interpreted")


def part(text: str, name: str) -> str:
    found = re.search(rf'id="{name}">(.*?)</script>', text, flags=re.S)
    assert found
    return found[1]


# --- the file ---------------------------------------------------------------------------------------------------------


def test_a_small_page_holds_what_it_shows() -> None:
    text = page(["kapitza", "exercise"], ["rk4", "verlet", "velocity_verlet"])
    data = json.loads(part(text, "data"))
    programs = json.loads(zlib.decompress(base64.b64decode(part(text, "programs"))))
    assert list(data["scenes"]) == ["kapitza", "exercise"]
    assert list(data["methods"]) == ["rk4", "velocity_verlet"]
    for place in data["scenes"].values():
        assert set(place["shown"]) == {"rk4", "velocity_verlet"}
        assert place["accurate"] in place["programs"]
        for one in place["programs"].values():
            assert "export function run" in programs[one["program"]]
    assert not re.search(r'(src|href)="', text)
    assert "{{" not in text
    assert "http://" not in re.sub("http://www.w3.org", "", text)


BAD = {
    "scene": (["--scene", "labb"], "did you mean lab"), "method": (["--integrators", "rk5"], "did you mean"),
    "ending": (["--out", "x.txt"], "must end in .html"), "folder": (["--out", "none/x.html"], "cannot be written"),
    "no fit": (["--scene", "water", "--integrators", "velocity_verlet"], "None of the methods fits"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_ends_in_a_sentence(case: str, tmp_path: Path, run_here: Here) -> None:
    words, said = BAD[case]
    (tmp_path / "lab.html").write_text("kept")
    before = contents(tmp_path)
    code, _, told = run_here("web", *words)
    assert code == 2, told
    assert said in told
    assert contents(tmp_path) == before


@pytest.mark.slow
def test_the_usual_page_is_small(tmp_path: Path) -> None:
    assert write(tmp_path / "lab.html").stat().st_size < 600_000


# --- in a browser -----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("page") / "lab.html")


@pytest.fixture
def lab(file: Path) -> Iterator[Opened]:
    """The usual page, wide, once it has checked its bits."""
    with opened(file, viewport={"width": 1400, "height": 1000}) as seen:
        wait_for_check(seen)
        yield seen


def wait_for_check(seen: Opened) -> str:
    seen.page.wait_for_function("/checked \\(|differs/.test(document.getElementById('check').textContent)")
    return str(seen.page.inner_text("#check"))


def do(seen: Opened, script: str) -> Any:
    return seen.page.evaluate(script)


def advance(seen: Opened, time: float) -> None:
    """Move the clock of a page that stands still to a time [s]."""
    seen.page.wait_for_function(f"(LabPendulum.advance({time}), LabPendulum.lab.time === {time})", timeout=120_000)


@pytest.mark.slow
def test_the_browsers_bits_are_pythons(lab: Opened) -> None:
    programs = json.loads(lab.page.inner_html("#data"))["scenes"]
    assert list(programs) == list(SHOWN_SCENES)
    count = sum(len(place["programs"]) for place in programs.values())
    assert lab.page.inner_text("#check") == f"same bits as Python: checked ({count} programs)"
    assert {name for place in programs.values() for name in place["shown"]} == set(SHOWN_METHODS)


@pytest.mark.slow
def test_firefoxs_bits_are_pythons(file: Path, tmp_path: Path) -> None:
    script = "document.getElementById('check').textContent"
    said = evaluated(file, script, tmp_path, r"checked \(|differs")
    assert said.startswith("same bits as Python: checked (")


@pytest.mark.slow
def test_one_altered_constant_is_noticed(file: Path, tmp_path: Path) -> None:
    text = file.read_text(encoding="utf-8")
    packed = part(text, "programs")
    programs = json.loads(zlib.decompress(base64.b64decode(packed)))
    place = next(i for i, one in enumerate(programs) if "0.16666666666666666" in one and "rk4" in one)
    programs[place] = programs[place].replace("0.16666666666666666", "0.16666666666666669", 1)
    again = base64.b64encode(zlib.compress(json.dumps(programs).encode())).decode()
    (tmp_path / "lab.html").write_text(text.replace(packed, again), encoding="utf-8")
    with opened(tmp_path / "lab.html") as seen:
        said = wait_for_check(seen)
    assert said.startswith("differs from Python: ")
    assert "with rk4" in said


READ = """
LabPendulum.lab.lanes.map(({ method, dt, machine: { last } }) => [method, dt, last.time, last.angle, last.velocity,
    last.kinetic_energy, last.potential_energy, last.work, last.heat, last.energy_residual])
"""
"""Script that returns the present state of every pendulum."""
LINKS = (
    "v=1&scene=lab&methods=rk4:0.01,velocity_verlet:0.05,gauss4:0.1,dop853:0.2&angle=2.5&velocity=-1&body.length=0.41"
    "&body.mass=0.055&gravity=9.79&effects.1.c=0.0123&effects.2.gamma=0.07",
    "v=1&scene=kapitza&methods=symplectic_euler:0.001,taylor:0.002&angle=3&velocity=0.1&effects.2.vertical_rate=120.5",
    "v=1&scene=exercise_large&methods=forward_euler:0.01,kahan_li8:0.02&angle=0.5&velocity=0&effects.1.gamma=0.5",
    "v=1&scene=chaotic&methods=rk4:0.02,discrete_gradient:0.01&angle=0.2&velocity=0.3&effects.2.drive_torque=1.07",
    "v=1&scene=lab&methods=rk4:0.013,velocity_verlet:0.0317&angle=-3&velocity=4&control=0.75",
    "v=1&scene=lab&methods=rk4:0.01,rk4:0.01,gauss4:0.02&angle=1&2.angle=-0.5&2.velocity=3&2.body.length=0.5"
    "&3.body.mass=0.2&3.effects.2.gamma=0.5&effects.1.c=0.02",
)


@pytest.mark.slow
@pytest.mark.parametrize("link", LINKS)
def test_a_link_gives_the_same_bits_here_and_there(link: str, file: Path) -> None:
    same_bits(file, link)


EVERYTHING = {
    "windy": "v=1&scene=windy&methods=rk4:0.007&angle=1&velocity=0.5",  # gusts: random numbers of seed 0
    "sticky_bearing": "v=1&scene=sticky_bearing&methods=rk4:0.01,gauss4:0.02&angle=1.5&velocity=-3",
    "kater": "v=1&scene=kater&methods=velocity_verlet:0.011&angle=0.4&velocity=0",
}


@pytest.fixture(scope="module")
def other(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("page") / "lab.html", [*EVERYTHING, "rod", "torsion"])


@pytest.mark.slow
@pytest.mark.parametrize("scene", EVERYTHING)
def test_links_of_other_scenes(scene: str, other: Path) -> None:
    same_bits(other, EVERYTHING[scene])


def same_bits(file: Path, link: str) -> None:
    with opened(file, reduced_motion="reduce") as seen:
        do(seen, f"location.hash = {link!r}")
        seen.page.wait_for_function(f"LabPendulum.linkText(false).includes({link.split('&')[2]!r})")
        advance(seen, 2.995)
        shown = do(seen, READ)
        text = do(seen, "LabPendulum.linkText()")
    for i, (method, _, *state) in enumerate(shown, 1):
        wanted = run(read_link(text, i))
        ledger = wanted.ledger
        columns = (wanted.time, wanted.angle, wanted.velocity, ledger.kinetic, ledger.potential, ledger.work,
                   ledger.heat, ledger.residual)
        assert wanted.method.name == method
        assert [float(column[-1]).hex() for column in columns] == [float(number).hex() for number in state], method


@pytest.mark.slow
def test_what_a_person_does(lab: Opened) -> None:
    page = lab.page
    assert page.inner_text("#play") == "Pause"
    page.keyboard.press("Space")
    assert page.inner_text("#play") == "Play"
    page.keyboard.press("r")
    page.keyboard.press(".")
    assert page.inner_text("#clock") == "0.01 s"
    where = do(lab, "LabPendulum.seen(LabPendulum.lab.lanes[0])")
    page.mouse.click(where["x"] + 80, where["y"])  # far from the bob: nothing
    assert page.input_value("#angle") == "5"
    page.mouse.move(where["bob"]["x"], where["bob"]["y"])
    page.mouse.down()
    for _ in range(2):  # the picture of a larger swing hangs lower: the pivot moves as it is drawn
        where = do(lab, "LabPendulum.seen(LabPendulum.lab.lanes[0])")
        page.mouse.move(where["x"] + 80, where["y"])
    page.mouse.up()
    assert page.input_value("#angle") == "90"
    assert "small angles only" in page.inner_text("#message")
    assert page.is_hidden("#torque")
    page.fill("#angle", "30")
    page.press("#angle", "Enter")
    assert do(lab, "LabPendulum.lab.lanes[0].angle") == pytest.approx(0.5235987755982988, abs=1e-15)
    page.fill("#angle", "1e9")
    page.press("#angle", "Enter")
    assert "from -360 to 360" in page.inner_text("#message")
    assert page.input_value("#angle") == "30"
    page.select_option("#scene", "lab")
    assert page.is_visible("#torque")
    page.fill("#torque", "0.5")
    assert do(lab, "LabPendulum.lab.torque") == 0.5
    page.locator("#lanes select").first.select_option("rk4")
    assert page.locator("#pendulums figcaption").first.inner_text().startswith("rk4")
    page.click("#add")
    assert page.locator("#pendulums canvas").count() == 4
    assert page.is_disabled("#add")
    page.locator("#lanes button").first.click()
    assert page.locator("#pendulums canvas").count() == 3
    setting = page.locator("#body-settings input[type=number]").first
    setting.fill("-1")
    setting.press("Enter")
    assert "length must be a number above 0" in page.inner_text("#message")
    assert setting.input_value() == "0.353"
    page.click("#link")
    assert page.input_value("#text") == page.url.rpartition("/")[2]
    assert (read_link(page.url, 1).scene.name, read_link(page.url, 1).control) == ("lab", 0.5)
    advance(lab, 1.234)
    page.click("#whose-2")
    page.fill("#setting-0", "0.5")
    page.press("#setting-0", "Enter")
    assert do(lab, "LabPendulum.lab.lanes.map((lane) => lane.values[0])") == [0.353, 0.5, 0.353]
    assert "length 0.5 m" in page.locator("#pendulums figcaption").nth(1).inner_text()
    assert "pendulum 2 alone" in page.inner_text("#whose-hint")
    advance(lab, 1.234)
    page.click("#python")
    code = page.input_value("#text")
    assert code.count("read_link(link, ") == 3
    done: dict[str, Any] = {}
    exec(code, done)
    last = do(lab, "LabPendulum.lab.lanes.map(({ machine: { last } }) => [last.time, last.angle, last.energy])")
    assert last == [[float(column[-1]) for column in (one.time, one.angle, one.energy)]
                    for one in (done[f"run{i}"] for i in (1, 2, 3))]
    for button in ("#csv", "#png"):
        with page.expect_download() as got:
            page.click(button)
        assert Path(got.value.path()).stat().st_size > 200


@pytest.mark.slow
def test_a_pendulum_that_diverges_leaves_the_others_running(file: Path) -> None:
    with opened(file, reduced_motion="reduce") as seen:
        do(seen, "location.hash = 'v=1&scene=vacuum&methods=forward_euler:1.5,rk4:0.01&angle=2&velocity=9'")
        seen.page.wait_for_function("LabPendulum.lab.lanes.length === 2")
        advance(seen, 400)
        assert do(seen, "LabPendulum.lab.lanes[1].steps") == 40000
        said = re.search("forward Euler stopped at ([0-9.]+) s", seen.page.inner_text("#message"))
        link = do(seen, "LabPendulum.linkText()")
        states = do(seen, "LabPendulum.lab.lanes.map((lane) => [lane.machine.last.angle, lane.machine.last.velocity])")
        kept = do(seen, "LabPendulum.lab.lanes[1].history.rows.length")
    assert all(abs(number) < 1e300 for row in states for number in row)
    assert kept <= 3001
    assert said
    assert float(said[1]) == pytest.approx(run(read_link(link, 1)).stop_time, abs=0.006)


@pytest.mark.slow
def test_a_stop_adds_to_what_is_said_and_moves_no_button_of_a_phone(file: Path) -> None:
    now = """(LabPendulum.show(), [document.querySelector("#play").getBoundingClientRect().top,
        document.querySelector("#message").textContent, document.querySelector("dt.period + dd").textContent])"""
    with opened(file, reduced_motion="reduce", viewport={"width": 390, "height": 844}) as seen:
        begun = do(seen, now)
        do(seen, "location.hash = 'v=1&scene=exercise&methods=forward_euler:0.02,rk4:0.01&angle=1&velocity=0'")
        seen.page.wait_for_function("LabPendulum.lab.lanes.length === 2")
        advance(seen, 3.0)
        warned = do(seen, now)
        advance(seen, 400)
        stopped = do(seen, now)
    assert begun[1] == ""
    assert "for small angles only" in warned[1]
    assert stopped[1].startswith(warned[1] + " forward Euler stopped at ")
    assert {begun[0], warned[0]} == {stopped[0]}
    assert (warned[2].endswith(" s"), stopped[2]) == (True, "\N{EN DASH}")


@pytest.mark.slow
def test_poincare_points_are_the_states_after_whole_periods(file: Path) -> None:
    """Beside DOP853 with two hundred steps a period; the page's step divides no period."""
    link = "v=1&scene=driven&methods=dop853:0.013&angle=0.5&velocity=1"
    with opened(file, reduced_motion="reduce") as seen:
        do(seen, f"location.hash = {link!r}")
        seen.page.wait_for_function("LabPendulum.lab.lanes.length === 1")
        advance(seen, 60)
        points = do(seen, "LabPendulum.lab.lanes[0].section")
        period = do(seen, "LabPendulum.lab.lanes[0].period")
    rate = explicit(SCENES["driven"]).coefficients["horizontal_rate"]
    assert period == pytest.approx(2 * math.pi / rate)
    assert len(points) == math.floor(60 / period) > 10
    finer = link.replace("dop853:0.013", f"dop853:{period / 200!r}")
    wanted = run(read_link(f"{finer}&time={(len(points) + 0.5) * period}"))
    angle = np.degrees(wanted.angle[200::200])[:len(points)]
    assert np.array(points)[:, 0] == pytest.approx(angle - 360 * np.round(angle / 360), abs=1e-5)
    assert np.array(points)[:, 1] == pytest.approx(wanted.velocity[200::200][:len(points)], abs=1e-5)


@pytest.mark.slow
def test_rigid_bodies_are_drawn_as_they_are(other: Path) -> None:
    """A torsion disc, seen from above, lies around its axis; a bob does not."""
    script = """() => { const { lab } = LabPendulum, canvas = document.querySelector("#pendulums canvas");
        const { width } = canvas, share = canvas.height / width, c = canvas.getContext("2d");
        const above = c.getImageData(0.45 * width, 0.12 * width, 0.1 * width, 0.25 * width).data;
        const [r, g, b] = lab.lanes[0].colour.match(/[0-9A-F]{2}/gi).map((two) => parseInt(two, 16));
        let count = 0;
        for (let i = 0; i < above.length; i += 4) count += above[i] === r && above[i + 1] === g && above[i + 2] === b;
        return count; }"""
    with opened(other, reduced_motion="reduce") as seen:
        found = {}
        for scene in ("torsion", "windy"):
            do(seen, f"location.hash = 'v=1&scene={scene}&methods=rk4:0.01&angle=0&velocity=0'")
            seen.page.wait_for_function(f"LabPendulum.lab.scene === {scene!r}")
            found[scene] = do(seen, script)
    assert found["torsion"] > 1000
    assert found["windy"] == 0


BAD_LINKS = {
    "v=7&scene=lab": "not of version 1", "v=1&scene=nowhere&methods=rk4:0.01": "no scene 'nowhere'",
    "v=1&scene=lab&methods=rk5:0.01": "no method 'rk5'", "v=1&scene=lab&methods=rk4:0": "from 0.000001 to 10 s",
    "v=1&scene=lab": "names no methods", "v=1&scene=lab&methods=rk4:0.01&angle=1&angle=2": "an entry twice",
    "v=1&scene=exercise&methods=rk4:0.01&control=1": "in a scene with a motor",
    "v=1&scene=lab&methods=rk4:0.01&angle=left": "angle must be a finite number",
    "v=1&scene=lab&methods=rk4:0.01&body.length=-3": "body.length must be above 0",
    "v=1&scene=lab&methods=rk4:0.01&colour=1": "no number 'colour'",
}


@pytest.mark.slow
def test_bad_links_end_in_a_sentence_on_the_page(file: Path) -> None:
    with opened(file) as seen:
        for link, words in BAD_LINKS.items():
            seen.page.goto(file.as_uri())  # afresh, without the last message
            assert seen.page.inner_text("#message") == ""
            do(seen, f"location.hash = {link!r}")
            seen.page.wait_for_function("document.getElementById('message').textContent !== ''")
            assert words in seen.page.inner_text("#message")
            assert do(seen, "LabPendulum.lab.lanes.length") == 3


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page of few programs."""
    return write(tmp_path_factory.mktemp("page") / "lab.html", ["exercise", "lab", "kapitza"], ["rk4", "forward_euler"])


@pytest.mark.slow
def test_the_page_and_python_read_links_alike(small: Path) -> None:
    script = """(links) => links.map((link) => [LabPendulum.readLink(link),
        LabPendulum.lab.lanes.map((lane) => [lane.method, lane.dt, lane.angle, lane.velocity, lane.values[0]])])"""
    with opened(small, reduced_motion="reduce") as seen:
        found = seen.page.evaluate(script, list(GRAMMAR))
    for (link, good), (said, lanes) in zip(GRAMMAR.items(), found, strict=True):
        assert (said == "") is good, (link, said)
        if good:
            specs = [read_link(link, i) for i in range(1, len(lanes) + 1)]
            assert [[spec.method.name, spec.h, *map(float, spec.start), spec.scene.body.reach]  # type: ignore[arg-type]
                    for spec in specs] == lanes, link
        else:
            assert said.startswith("The link cannot be used: ")


@pytest.mark.slow
def test_focus_torque_theme_and_address(small: Path) -> None:
    """A person at the keyboard loses neither focus nor run nor motor; a link does not tell where the file lies."""
    with opened(small, reduced_motion="reduce", viewport={"width": 1400, "height": 1000}) as seen:
        wait_for_check(seen)
        page = seen.page

        def focused() -> str:
            return str(do(seen, "document.activeElement.id"))

        page.select_option("#scene", "lab")
        page.click("#add")
        for control in ("method-0", "step-0", "step-0-slider", "setting-0", "setting-0-slider", "angle", "velocity",
                        "torque"):
            page.focus(f"#{control}")
            before = do(seen, "LabPendulum.lab.torque")
            page.keyboard.press("ArrowRight" if "slider" in control or control == "torque" else "ArrowUp")
            page.keyboard.press("Enter")
            page.wait_for_timeout(20)
            assert focused() == control
            assert (do(seen, "LabPendulum.lab.torque") == before) is (control != "torque")
        page.focus("#remove-1")
        page.keyboard.press("Enter")
        assert focused() in ("add", "remove-0")
        do(seen, "LabPendulum.lab.torque = 0, document.activeElement.blur(), LabPendulum.advance(0.5)")
        for lost in ("window.dispatchEvent(new Event('blur'))", "document.getElementById('angle').focus()"):
            page.keyboard.down("ArrowRight")
            assert do(seen, "LabPendulum.lab.torque") == 1
            do(seen, lost)
            assert do(seen, "LabPendulum.lab.torque") == 0
            page.keyboard.up("ArrowRight")
            do(seen, "document.activeElement.blur()")
        page.click("#link")
        assert "pushed during this run" in page.inner_text("#message")
        assert page.input_value("#text").startswith("lab.html#v=1&scene=lab")
        assert "/" not in page.input_value("#text")
        time = do(seen, "LabPendulum.lab.time")
        paper = "getComputedStyle(document.documentElement).getPropertyValue('--paper')"
        white = do(seen, paper)
        page.emulate_media(color_scheme="dark")
        page.wait_for_timeout(50)
        assert do(seen, paper) != white
        assert do(seen, "LabPendulum.lab.time") == time
        do(seen, "window.dispatchEvent(new Event('beforeprint'))")
        assert do(seen, paper) == white
        corner = "[...document.getElementById('plot-angle').getContext('2d').getImageData(80, 20, 1, 1).data]"
        do(seen, "window.dispatchEvent(new Event('afterprint'))")
        assert do(seen, paper) != white
        assert len(do(seen, corner)) == 4
        do(seen, "location.hash = '%'")
        page.wait_for_function("document.getElementById('message').textContent.includes('no part of an address')")


@pytest.mark.slow
def test_what_a_class_measures(small: Path) -> None:
    """The gravity of planet X from a period, as 4 pi² L / T²; the period of a large swing; bars, arrows and axes."""
    with opened(small, reduced_motion="reduce", viewport={"width": 1400, "height": 1000}) as seen:
        page = seen.page
        do(seen, "location.hash = 'v=1&scene=exercise&methods=rk4:0.01&angle=0.08'")
        page.wait_for_function("LabPendulum.lab.lanes.length === 1 && LabPendulum.lab.lanes[0].method === 'rk4'")
        period = page.locator("#pendulums .period + dd")
        page.click("#planet-x")
        hidden = do(seen, "LabPendulum.lab.lanes[0].values[2]")
        assert page.input_value("#setting-2") == ""
        assert str(hidden) not in page.inner_text("#controls") + page.inner_text("#pendulums")
        assert "?" in page.inner_text("#equation")
        page.click("#watch")
        advance(seen, 30)
        do(seen, "LabPendulum.show()")
        seconds = float(period.inner_text().removesuffix(" s"))
        assert 0.353 * (2 * math.pi / seconds) ** 2 == pytest.approx(hidden, rel=1e-4)
        assert page.inner_text("#watch") == "30.00 s"
        page.click("#watch")
        advance(seen, 31)
        do(seen, "LabPendulum.show()")
        assert page.inner_text("#watch") == "30.00 s"
        page.click("#planet-x")
        assert float(page.input_value("#setting-2")) == hidden
        page.click("#planet-Moon")
        assert do(seen, "LabPendulum.lab.lanes[0].values[2]") == 1.62
        link = "v=1&scene=lab&methods=rk4:0.01&angle=2&effects.1.c=0&effects.2.gamma=0"
        do(seen, f"location.hash = {link!r}")
        page.wait_for_function("LabPendulum.lab.scene === 'lab'")
        advance(seen, 20)
        do(seen, "LabPendulum.show()")
        swing = do(seen, "LabPendulum.lab.lanes[0].swing")
        assert swing == pytest.approx(4 * float(ellipk(math.sin(1.0) ** 2)) / SCENES["lab"].omega0, rel=2e-6)
        page.fill("#angle", "90")
        page.press("#angle", "Enter")
        advance(seen, 5)
        wanted = [4 * float(ellipk(math.sin(math.radians(degrees) / 2) ** 2)) for degrees in (math.degrees(2), 90.0)]
        swings = do(seen, "LabPendulum.lab.lanes[0].swings")  # of both starts
        assert swings[0] == pytest.approx([math.degrees(2), wanted[0] / SCENES["lab"].omega0], rel=1e-4)
        assert swings[-1] == pytest.approx([90, wanted[1] / SCENES["lab"].omega0], rel=1e-4)
        do(seen, "LabPendulum.show()")
        last = re.search(r"; rk4 ([\d.]+)°, ([\d.]+) s$", page.get_attribute("#plot-period", "aria-label"))
        assert last
        assert [float(number) for number in last.groups()] == pytest.approx(swings[-1], rel=1e-4)
        pale = do(seen, "LabPendulum.periods(LabPendulum.lab.lanes[0], 120)")
        for degrees, seconds in pale:
            longer = 4 * float(ellipk(math.sin(math.radians(degrees) / 2) ** 2))
            assert seconds == pytest.approx(longer / SCENES["lab"].omega0, rel=1e-9)
        page.fill("#setting-0", "0.5")
        page.press("#setting-0", "Enter")
        assert do(seen, "LabPendulum.lab.lanes[0].swings") == []
        advance(seen, 1.1)
        do(seen, "LabPendulum.show()")
        still = do(seen, "document.querySelector('#pendulums canvas').toDataURL()")
        for name in ("velocity", "acceleration", "force", "ruler", "protractor"):
            page.check(f"#show-{name}")
            assert still != (still := do(seen, "document.querySelector('#pendulums canvas').toDataURL()"))
        for axis, name in (("x", "time"), ("y", "potential"), ("y", "distance")):
            before = do(seen, "document.getElementById('plot-free').toDataURL()")
            page.select_option(f"#free-{axis}", name)
            assert before != do(seen, "document.getElementById('plot-free').toDataURL()")


FILES = {
    "Time (s);Angle (deg)\n" + "\n".join(f"{t / 10:.1f};{t},5".replace(".", ",") for t in range(30)): (
        [0.0, 2.9], [0.5, 29.5]),
    "# a sensor\nt,x,theta [rad]\n" + "\n".join(f"{2 + t / 10},7,{t / 100}" for t in range(30)): (
        [0.0, 2.9], [0.0, math.degrees(0.29)]),
    "\n".join(f"{t} {t / 100}" for t in range(30)): ([0.0, 29.0], [0.0, math.degrees(0.29)]),
    "\n".join(f"{t}\t{2 * t}" for t in range(30)): ([0.0, 29.0], [0.0, 58.0]),
    "time,angle\n" + "\n".join(f"{t},{t}" for t in range(5)): "fewer than 20 lines",
    "\n".join(f"{t % 7},{t}" for t in range(30)): "times do not increase",
    "<html>" * 300: "fewer than 20 lines",
}
"""Texts of recordings: first and last time [s] and angle [degrees] that the page reads, or words of its refusal."""


@pytest.mark.slow
def test_a_dropped_recording_is_read_and_fitted(small: Path, tmp_path: Path) -> None:
    """Beside SciPy's motion: length, drag and zero within four errors, and errors of the size that the noise gives."""
    length, gamma, zero, noise = 0.45, 0.08, -1.2, 0.3
    time = np.arange(0.0, 30.0, 0.05)
    omega = SCENES["exercise_large"].omega0 * math.sqrt(SCENES["exercise_large"].body.reach / length)
    truth = solve_ivp(lambda t, y: [y[1], -omega**2 * math.sin(y[0]) - gamma * y[1]], (0.0, 30.0), [0.7, 0.0],
                      t_eval=time, rtol=1e-10, atol=1e-12).y[0]
    noisy = np.degrees(truth) + zero + np.random.default_rng(3).normal(0.0, noise, len(time))
    path = write(tmp_path / "lab.html", ["exercise_large"], ["rk4"])
    with opened(path, reduced_motion="reduce") as seen:
        page = seen.page
        assert page.is_disabled("#fit")

        def give(text: str) -> str:
            (tmp_path / "r.csv").write_text(text, encoding="utf-8")
            do(seen, "document.getElementById('fitted').textContent = ''")
            page.set_input_files("#file", [])
            page.set_input_files("#file", str(tmp_path / "r.csv"))
            page.wait_for_function("document.getElementById('fitted').textContent !== ''")
            return str(page.inner_text("#fitted"))

        for text, wanted in FILES.items():
            said = give(text)
            if isinstance(wanted, str):
                assert wanted in said
                continue
            found = do(seen, "LabPendulum.lab.recording.map((column) => [column[0], column.at(-1)])")
            assert [list(map(float, row)) for row in found] == [pytest.approx(row) for row in wanted], text[:40]
        give("\n".join(f"{t / 20} {5 * math.sin(5 * t / 20)}" for t in range(50)))
        page.click("#fit")
        assert page.inner_text("#fitted") == "The recording cannot be fitted: it has fewer than three whole swings."
        give("time,angle [deg]\n" + "\n".join(f"{t:.3f},{a:.5f}" for t, a in zip(time, noisy, strict=True)))
        page.click("#fit")
        said = page.inner_text("#fitted").replace("\N{MINUS SIGN}", "-")
        values = {name: (float(value), float(error)) for name, value, error in re.findall(
            r"(length|gamma) ([-\d.]+) ± ([\d.]+)", said)}
        for name, right, expected in (("length", length, 1e-4), ("gamma", gamma, 1e-3)):
            value, error = values[name]
            assert abs(value - right) < 4 * error, said
            assert 0.1 * expected < error < 3 * expected, said
        assert float(re.search("zero of the sensor, ([-\\d.]+)°", said)[1]) == pytest.approx(zero, abs=0.1)  # type: ignore[index]
        assert float(re.search("Scatter ([\\d.]+)°", said)[1]) == pytest.approx(noise, abs=0.03)  # type: ignore[index]
        assert do(seen, "LabPendulum.lab.lanes[0].values[0]") == pytest.approx(values["length"][0], abs=1e-4)
        page.click("#forget")
        assert page.is_disabled("#fit")


WORDS_CUT = """() => {
    const cut = [], contexts = [...document.querySelectorAll("canvas")].map((canvas) => canvas.getContext("2d"));
    for (const c of contexts) {
        c.fillText = (text, x, y) => {
            const { actualBoundingBoxLeft: l, actualBoundingBoxRight: r, actualBoundingBoxAscent: a,
                actualBoundingBoxDescent: d } = c.measureText(text);
            const m = c.getTransform(), { width, height } = c.canvas;
            for (const [u, v] of [[x - l, y - a], [x + r, y + d]]) {
                const [p, q] = [m.a * u + m.c * v + m.e, m.b * u + m.d * v + m.f];
                if (p < -1 || q < -1 || p > width + 1 || q > height + 1) cut.push([text, p, q]);
            }
            CanvasRenderingContext2D.prototype.fillText.call(c, text, x, y);
        };
    }
    LabPendulum.show();
    for (const c of contexts) delete c.fillText;
    return cut;
}"""
"""Script that draws the page and returns the words that do not lie within their canvas."""


@pytest.mark.slow
def test_no_word_is_cut_in_any_canvas(small: Path) -> None:
    link = "v=1&scene=lab&methods=rk4:0.01{}&angle={}&velocity=0"
    with opened(small, reduced_motion="reduce") as seen:
        for pendulums, angle in ((1, 0.5), (2, 3.0), (4, 0.5)):
            do(seen, f"location.hash = {link.format(',forward_euler:0.01' * (pendulums - 1), angle)!r}")
            seen.page.wait_for_function(f"LabPendulum.lab.lanes.length === {pendulums}")
            do(seen, "Object.assign(LabPendulum.lab.shown, { force: true, ruler: true, protractor: true })")
            advance(seen, 2)
            for width in (280, 320, 360, 480, 600, 700, 840, 901, 1024, 1280, 1600):
                seen.page.set_viewport_size({"width": width, "height": 800})
                assert seen.page.evaluate(WORDS_CUT) == [], (pendulums, width)


@pytest.mark.slow
def test_a_swing_about_the_top_is_one_curve(small: Path) -> None:
    """Kapitza's pendulum swings about 180 degrees: its phase portrait is not split there."""
    with opened(small, reduced_motion="reduce") as seen:
        do(seen, "location.hash = 'v=1&scene=kapitza&methods=rk4:0.0005&angle=3&velocity=0'")
        seen.page.wait_for_function("LabPendulum.lab.scene === 'kapitza'")
        advance(seen, 3)
        ranges = do(seen, "LabPendulum.show(), LabPendulum.lab.phaseRange")
    assert 120 < ranges[0] < 178 < 182 < ranges[1] < 240


SMALLEST = """
Math.min(...[...document.querySelectorAll("body *")].filter((x) => x.checkVisibility() && x.childNodes.length
    && [...x.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim())
    && !x.closest("math, script, style")).map((x) => parseFloat(getComputedStyle(x).fontSize)))
"""
"""Script that returns the size of the smallest text of the page [CSS pixels]."""


@pytest.mark.slow
@pytest.mark.parametrize("width", [320, 700, 1024, 2560])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_fits_every_width(width: int, scheme: str, file: Path) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright")
    with opened(file, viewport={"width": width, "height": 800}, color_scheme=scheme, reduced_motion="reduce") as seen:
        wait_for_check(seen)
        assert seen.page.inner_text("#play") == "Play"
        do(seen, "document.querySelectorAll('#shown input').forEach((box) => box.checked || box.click())")
        for controls in (False, True):
            if width < 900:
                seen.page.click("#tab-controls" if controls else "#tab-plots")
            assert do(seen, "document.documentElement.scrollWidth <= innerWidth")
            assert do(seen, SMALLEST) >= 12.0
            found = axe.Axe().run(seen.page)
            assert found.violations_count == 0, found.generate_report()


@pytest.mark.slow
def test_every_scene_with_every_method_has_pythons_bits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All programs that fit, 300 steps each, in this browser; the whole page stays small."""
    monkeypatch.setattr(document, "STEPS", 50)
    file = write(tmp_path / "all.html", SCENES, integrators.METHODS)
    assert file.stat().st_size < 4_000_000
    count = sum(len(set(fitting(scene)) & set(integrators.METHODS)) for scene in SCENES.values())
    with opened(file, reduced_motion="reduce") as seen:
        seen.page.set_default_timeout(300_000)
        assert wait_for_check(seen) == f"same bits as Python: checked ({count} programs)"


@pytest.mark.slow
def test_an_hour_does_not_fill_the_memory(file: Path) -> None:
    with opened(file, reduced_motion="reduce") as seen:
        wait_for_check(seen)
        sizes = []
        for hour in (0.5, 1.0):
            advance(seen, 3600 * hour)
            seen.page.request_gc()
            sizes.append(do(seen, "performance.memory.usedJSHeapSize"))
        assert do(seen, "Math.max(...LabPendulum.lab.lanes.map((lane) => lane.history.rows.length))") <= 3001
    assert sizes[1] < 1.5 * sizes[0] + 2e6


@pytest.mark.slow
def test_a_recording_from_the_other_side_is_said(tmp_path: Path) -> None:
    swing = rollout("lab", angle=0.6, duration=20.0, backend="python")
    write(tmp_path / "lab.html", ["lab"], ["rk4"], recording=swing)
    first = math.degrees(0.6)
    with opened(tmp_path / "lab.html", reduced_motion="reduce") as seen:
        for angle, said in ((-first, True), (1.02 * first, False), (first + 20, True)):
            seen.page.fill("#angle", str(angle))
            seen.page.press("#angle", "Enter")
            assert ("The recording begins at" in seen.page.inner_text("#message")) is said


@pytest.mark.slow
def test_touch_on_a_phone(file: Path) -> None:
    with opened(file, viewport={"width": 360, "height": 740}, has_touch=True, is_mobile=True,
                reduced_motion="reduce") as seen:
        wait_for_check(seen)
        where = do(seen, "LabPendulum.seen(LabPendulum.lab.lanes[0])")
        seen.page.touchscreen.tap(where["bob"]["x"] + 18, where["bob"]["y"])
        assert 0.15 < do(seen, "LabPendulum.lab.lanes[0].angle") < 0.4
        seen.page.tap("#play")
        seen.page.wait_for_function("LabPendulum.lab.time > 0.3")
        seen.page.tap("#tab-controls")
        assert seen.page.is_visible("#scene")


# --- in a notebook ----------------------------------------------------------------------------------------------------

HARNESS = """<!DOCTYPE html><html><body><div id="here"></div><script type="module">
const values = {{values}};
const model = { get: (name) => values[name], set: (name, value) => { values[name] = value; }, save_changes: () => {
  globalThis.saved = (globalThis.saved ?? 0) + 1; } };
globalThis.values = values;
{{script}}
globalThis.stop = render({ model, el: document.getElementById("here") });
</script></body></html>"""
"""A page that does what a notebook does with a widget."""


@pytest.mark.slow
def test_the_widget_and_python_share_a_link(tmp_path: Path) -> None:
    pytest.importorskip("anywidget")
    swing = simulated_recording()
    made = pendulum_env.web.widget("lab", ["rk4", "forward_euler"], length=0.4, angle=0.5, recording=swing)
    assert made.spec(2).scene.body.length == 0.4
    values = json.dumps({"page": made.page, "link": made.link, "height": made.height}).replace("</", "<\\/")
    script = (ASSETS / "widget.js").read_text(encoding="utf-8").replace("export default { render };", "")
    (tmp_path / "x.html").write_text(HARNESS.replace("{{script}}", script).replace("{{values}}", values))
    with opened(tmp_path / "x.html", reduced_motion="reduce") as seen:
        frame = next(one for one in seen.page.frames if one != seen.page.main_frame)
        frame.wait_for_function("globalThis.LabPendulum && LabPendulum.lab.lanes.length === 2")
        assert frame.evaluate("LabPendulum.lab.lanes[0].values[0]") == 0.4
        frame.fill("#angle", "90")
        frame.press("#angle", "Enter")
        seen.page.wait_for_function("values.link.includes('angle=1.57')")
        assert read_link(do(seen, "values.link"), 1).scene.body.length == 0.4
        do(seen, "(values.link = values.link.replace('scene=lab', 'scene=vacuum').replace(/&body.*/, '')), 0")
        frame.wait_for_function("LabPendulum.lab.scene === 'vacuum'")
        shown = frame.evaluate("JSON.parse(document.getElementById('data').textContent).recording[0].length")
    assert 100 < shown <= 3000


@pytest.mark.slow
def test_a_widget_says_what_belongs_where_no_notebook_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("anywidget")
    display = pytest.importorskip("IPython.display")
    shown: list[Any] = []
    monkeypatch.setattr(display, "display", lambda one, **more: shown.append(one))
    made = pendulum_env.web.widget("exercise", ["rk4"], angle=0.5)
    made._ipython_display_()
    line, page = shown
    assert f"#{made.link}".replace("&", "&amp;") in line.data
    assert "application/vnd.jupyter.widget-view+json" in page


def test_without_anywidget_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "anywidget", None)
    monkeypatch.delitem(sys.modules, "pendulum_env.web.lab_widget", raising=False)
    with pytest.raises(ImportError, match=r"pip install 'lab-pendulum\[notebook\]'"):
        pendulum_env.web.widget()


def test_one_program_for_pages_of_your_own() -> None:
    assert pendulum_env.web.javascript("lab", "rk4") == pendulum_env.code("lab", "rk4", "javascript")
