"""The documentation site: all of its links lead somewhere, it asks nobody for anything, and its search finds."""

from __future__ import annotations

import http.server
import importlib
import importlib.util
import json
import os
import re
import subprocess
import threading
import zlib
from collections.abc import Iterator
from functools import partial
from html.parser import HTMLParser
from pathlib import Path
from types import ModuleType
from typing import Any
from urllib.parse import unquote, urlsplit

import numpy as np
import pytest
from beside import environment, once
from check_all import check_all
from in_browser import visited
from readme_code import READMES, ROOT, only
from scipy.stats import kstest, uniform

import pendulum_env
from pendulum_env.cli import COMMANDS
from pendulum_env.envs.limits import IDS
from pendulum_env.tasks import TASKS

SITE = ROOT / ".site"
ROOMS = ("integrators", "integrators.analysis", "pendulum_env.lab", "pendulum_env.bench", "pendulum_env.plots",
         "pendulum_env.render", "pendulum_env.physics.effects", "pendulum_env.physics.exact",
         *(f"pendulum_env.{name}" for name in dir(pendulum_env)
           if hasattr(getattr(pendulum_env, name, None), "__all__")))
"""Modules all of whose public names are in the reference."""
LOADED = {"script": "src", "img": "src", "iframe": "src", "source": "src", "video": "src", "embed": "src"}
"""Element -> its attribute that a browser loads at once; of a link it is its address, unless it is only named."""


@pytest.fixture(scope="module")
def builder() -> ModuleType:
    spec = importlib.util.spec_from_file_location("site_build", SITE / "build.py")
    assert spec
    assert spec.loader
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


def test_readme_names_the_command() -> None:
    assert only("(python .site/build.py out/site)", "the command")


def test_lists_name_sections_that_exist_and_each_but_once(builder: ModuleType) -> None:
    """What no list names is below its room's guide, and a guide that none names is the last of those by use."""
    rooms = {str(Path(path).parent): builder.sections(text) for path, text in builder.readmes().items()}
    there = {f"{room}/{builder.slug(title)}" for room, parts in rooms.items() for title, _ in parts[1:]}
    guides = {f"{room}/README" for room in rooms}
    others = {"examples/index", *(f"examples/{path.stem}" for path in (ROOT / "examples").glob("*.ipynb"))}
    named = [name for names in builder.placed().values() for name in names if name not in others]
    assert {*named} <= there | guides
    assert len({*named}) == len(named)


def test_links_of_readmes_become_those_of_pages(builder: ModuleType, tmp_path: Path) -> None:
    site, here = builder.Site(tmp_path), "pendulum_env/lab/README.md"
    assert site.target("../bench/README.md#the-page", here) == "/pendulum_env/bench/the-page.md"
    assert site.target("#with-clicks", here) == "/pendulum_env/lab/from-a-film.md#with-clicks"
    assert site.target("../../README.md#start", here) == "/index.md#start"
    assert site.target("../../examples/figures/fit.png", here) == "/examples/figures/fit.png"
    assert site.target("../../examples/01_first_rollout.py", here) == "/examples/01_first_rollout.md"
    assert site.relinked("[a](fitting) b\n```\n[c](nowhere)\n```\n", here) == "a b\n```\n[c](nowhere)\n```\n"
    assert site.target("../../CHANGELOG.md", here) == "/CHANGELOG.md"
    assert site.target("../../LICENSE", here) == "/LICENSE"
    for link, what in (("#nowhere", "heading"), ("nowhere.py", "file")):
        with pytest.raises(LookupError, match=rf"lab/README\.md links to {link}, and there is no such {what}"):
            site.target(link, here)


def test_a_picture_that_is_missing_is_named(builder: ModuleType) -> None:
    assert builder.picture("../../examples/figures/fit.png", "pendulum_env/lab/README.md").name == "fit.png"
    with pytest.raises(LookupError, match=r"lab/README\.md shows \.\./nowhere\.png, and there is no such file"):
        builder.picture("../nowhere.png", "pendulum_env/lab/README.md")


def test_a_section_is_a_page_whatever_stands_in_code(builder: ModuleType) -> None:
    text = "# Title\n\nIntro.\n\n## One `thing`\n\n```sh\n## no heading\n```\n\n### Part\n\n## Two\nend\n"
    assert builder.sections(text) == [
        ("Title", "\nIntro."), ("One `thing`", "\n```sh\n## no heading\n```\n\n### Part\n\n"), ("Two", "end\n")]
    assert builder.slug("One `thing`, or (two)") == "one-thing-or-two"


# --- the built site -------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built where the extra ``docs`` is installed, and with every way out of this machine closed."""
    (wanted,) = re.findall(r'^docs = \[(.+)\]', (ROOT / "pyproject.toml").read_text(encoding="utf-8"), flags=re.M)
    python = environment(tmp_path_factory, "docs", *json.loads(f"[{wanted}]"))
    closed = dict.fromkeys(("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY"), "http://127.0.0.1:9")

    def built(folder: Path) -> None:
        done = subprocess.run([python, SITE / "build.py", folder / "site"], cwd=ROOT, env={**os.environ, **closed},
                              check=False, capture_output=True, text=True, encoding="utf-8")
        assert done.returncode == 0, done.stderr[-5000:]

    return once(tmp_path_factory, "site", built) / "site"


class Page(HTMLParser):
    """Anchors of a page, its links, and what a browser loads with it."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.anchors, self.links, self.loaded = set[str](), list[str](), list[str]()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        self.anchors |= {name for name in (found.get("id"), found.get("name")) if name}
        if tag in LOADED and found.get(LOADED[tag]):
            self.loaded.append(found[LOADED[tag]] or "")
        if tag == "link" and found.get("rel") not in ("canonical", "index", "search", "next", "prev", "author"):
            self.loaded.append(found.get("href") or "")
        if tag == "a" and found.get("href"):
            self.links.append(found["href"] or "")


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, Page]:
    return {path: Page(path) for path in sorted(site.rglob("*.html")) if "_static" not in path.parts}


def problems(pages: dict[Path, Page], path: Path) -> list[str]:
    """Links of a page, and what it loads, that are not there; addresses elsewhere are not asked."""
    found = []
    for link in (*pages[path].links, *pages[path].loaded):
        address = urlsplit(link)
        if address.scheme or address.netloc:
            continue
        there = (path.parent / unquote(address.path)).resolve() if address.path else path
        anchor = unquote(address.fragment)
        if not there.is_file() or (anchor and there in pages and anchor not in pages[there].anchors):
            found.append(link)
    return found


@pytest.mark.slow
def test_every_link_and_anchor_leads_somewhere(pages: dict[Path, Page]) -> None:
    assert len(pages) > 150

    def check(path: Path) -> None:
        assert problems(pages, path) == []

    check_all(list(pages), check)


@pytest.mark.slow
def test_links_that_lead_nowhere_are_noticed(tmp_path: Path) -> None:
    (tmp_path / "a.html").write_text(
        '<p id="x"></p><a href="#y"></a><a href="b.html#x"></a><img src="c.png"><a href="#x">')
    (tmp_path / "b.html").write_text('<script src="http://example.com/"></script>')
    pages = {path: Page(path) for path in tmp_path.iterdir()}
    assert problems(pages, tmp_path / "a.html") == ["#y", "b.html#x", "c.png"]
    assert outside(pages[tmp_path / "b.html"]) == ["http://example.com/"]


def outside(page: Page) -> list[str]:
    """What a page loads from elsewhere."""
    return [link for link in page.loaded if urlsplit(link).netloc]


@pytest.mark.slow
def test_no_page_asks_another_address_for_anything(site: Path, pages: dict[Path, Page]) -> None:
    assert {path.name: outside(page) for path, page in pages.items() if outside(page)} == {}
    for path in site.rglob("*.css"):
        assert not re.search(r"(url\(|@import )[\"']?(https?:)?//", path.read_text(encoding="utf-8")), path


@pytest.mark.slow
def test_all_public_names_have_a_place_and_no_private_one(site: Path) -> None:
    _, _, text = (site / "objects.inv").read_bytes().partition(b"using zlib.\n")
    entries = [line.split() for line in zlib.decompress(text).decode().splitlines()]
    names = {words[0] for words in entries if words[1].startswith("py:")}
    assert not [name for name in names if re.search(r"\._(?!_)", name)]
    lasts = {name.rpartition(".")[2] for name in names}
    for room in ROOMS:
        module = importlib.import_module(room)
        public = {name for name in module.__all__ if not isinstance(getattr(module, name), ModuleType)}
        assert {name for name in public if f"{room}.{name}" not in names} <= lasts, room
    assert {f"pendulum_env.{name}" for name in pendulum_env.__all__
            if not isinstance(getattr(pendulum_env, name), ModuleType)} <= names
    assert "pendulum_env.jax.rollout" in names


@pytest.mark.slow
def test_each_entry_has_its_page(site: Path) -> None:
    for name in (*IDS, "LabPendulumBench-v0", *TASKS):
        text = (site / "environments" / f"{name}.html").read_text(encoding="utf-8")
        for title in ("Description", "Action space", "Observation space", "Starting state", "Episode end", "Arguments"):
            assert re.search(rf"<h2>{title}", text, flags=re.I), (name, title)
    for name in COMMANDS:
        assert "--help" in (site / "commands" / f"{name}.html").read_text(encoding="utf-8")
    shown = (site / "gallery.html").read_text(encoding="utf-8")
    for page in READMES.values():
        for picture in re.findall(r"^!\[[^\]]*\]\([^)]*?([\w-]+\.(?:png|gif))\)", page, flags=re.M):
            assert picture in shown


@pytest.mark.slow
@pytest.mark.parametrize("name", TASKS)
def test_a_start_that_a_page_calls_uniform_is_so(site: Path, name: str) -> None:
    """Kolmogorov's test of 2000 starts; a page may say in words where episodes start that are not uniform."""
    page = (site / "environments" / f"{name}.html").read_text(encoding="utf-8")
    text = " ".join(re.sub("<[^>]+>", "", page).split())
    found = re.search(r"from hanging in \[(.+?), (.+?)\] rad, the velocity in \[(.+?), (.+?)\] (omega0|rad)", text)
    if not found:
        assert ("The scene's usual run" if name == "free" else "At random: in one episode") in text
        return
    env = pendulum_env.LabPendulumVectorEnv(2000, task=name, backend="python")
    infos = env.reset(seed=0)[1]
    unit = float(env.unwrapped.scene.omega0) if found[5] == "omega0" else 1.0
    for values, low, high in ((infos["angle"], *found.groups()[:2]), (infos["velocity"] / unit, *found.groups()[2:4])):
        begin, wide = float(low), float(high) - float(low)
        assert np.ptp(values) == 0.0 if wide == 0.0 else kstest(values, uniform(begin, wide).cdf).pvalue > 1e-3


@pytest.mark.slow
def test_no_role_is_left_in_the_reference(site: Path) -> None:
    for path in (site / "reference").glob("*.html"):
        text = re.sub(r"<[^>]+>", "", path.read_text(encoding="utf-8"))
        assert not re.findall(r":(?:func|class|data|mod|meth|attr|exc):|``", text), path.name


# --- in a browser ---------------------------------------------------------------------------------------------------


class Silent(http.server.SimpleHTTPRequestHandler):
    """A server of files that says nothing."""

    def log_message(self, *_: Any) -> None: ...


@pytest.fixture(scope="module")
def address(site: Path) -> Iterator[str]:
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), partial(Silent, directory=str(site)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_address[1]}/"
    server.shutdown()
    server.server_close()


@pytest.mark.slow
def test_a_search_for_gyroscope_leads_to_how_a_phones_is_fitted(site: Path, address: str) -> None:
    (index,) = re.findall(r"Search\.setIndex\((.*)\)$", (site / "searchindex.js").read_text(encoding="utf-8"))
    found = json.loads(index)
    numbers = [found[terms]["gyroscop"] for terms in ("titleterms", "terms")]
    pages = {found["docnames"][i] for each in numbers for i in ([each] if isinstance(each, int) else each)}
    assert {"tutorials/gyroscope", "pendulum_env/lab/files-that-are-read"} <= pages
    with visited(address, viewport={"width": 1280, "height": 800}) as seen:
        seen.page.fill("input[name=q]", "gyroscope")
        seen.page.press("input[name=q]", "Enter")
        hits = seen.page.locator("#search-results li a")
        hits.first.wait_for(timeout=60_000)
        assert hits.first.inner_text() == "Fit a phone's gyroscope"
        hits.first.click()
        seen.page.wait_for_selector("text=The bias of the gyroscope is the parameter")


@pytest.mark.slow
def test_pages_fit_their_window(address: str) -> None:
    """On a phone, a laptop and a large screen, in light and dark, no page is wider than its window."""
    names = ("index", "gallery", "lab-page", "reference/environments", "environments/LabPendulum-v0",
             "commands/compare", "pendulum_env/lab/files-that-are-read", "examples/exercise", "tutorials/first-swing")
    with visited(address) as seen:
        for width, scheme in ((390, "light"), (1280, "dark"), (2560, "light"), (390, "dark")):
            seen.page.set_viewport_size({"width": width, "height": 900})
            seen.page.emulate_media(color_scheme=scheme)
            for name in names:
                seen.page.goto(f"{address}{name}.html")
                assert seen.page.evaluate("document.documentElement.scrollWidth") <= width, (name, width)
