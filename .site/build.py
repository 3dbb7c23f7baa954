"""Build the documentation site: ``python .site/build.py out/site``. See README.md beside this file.

``stage`` writes the sources that Sphinx reads. Of a room's README each section is a page of its own, so that a search
leads to it. Links between READMEs, to examples and to files hold on the site. Pages of environments, commands
and public names are made from what the package declares.
"""

from __future__ import annotations

import ast
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path, PurePosixPath
from posixpath import normpath

from PIL import Image

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
FOLDERS = ("integrators", "pendulum_env", "examples", "tests")
"""Folders whose READMEs become pages; the front page is the site's first one."""
LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\((?!\w+:)([^)\s]+)\)")
"""A link or a picture of Markdown whose target is no address: the mark of a picture, text, target."""
PICTURE = re.compile(r"^!\[([^\]]*)\]\(([^)]+)\)\n(?:\n\*(.*?)\*\n)?", flags=re.S | re.M)
"""A picture in a README: what it shows, its file, and the caption, if there is one."""
MADE = re.compile(r"\s*\w+ by\s+`lab-pendulum [^`]*`\.?\s*$")
"""The end of a caption that gives the command, which the gallery shows below the picture."""
TITLES = {
    "three_eulers": "Three Euler methods", "fit": "A recording and its fit", "corner": "What a fit leaves open",
    "acquire": "A sensor, live", "track": "A film, and the swing in it", "track_page": "Clicks on a film",
    "learning": "What policies learn of their integrator", "learning_swing_up": "Ten policies learn to swing up",
    "learning_balance": "Ten policies learn to balance", "learning_track": "Ten policies learn to follow a swing",
    "energy": "Energy of five integrators", "cost": "What accuracy costs",
    "precision": "Accuracy beside other libraries", "gradients": "Derivatives, and what they cost",
}
"""Figure of a README -> its title in the gallery; without one, the first words of what it shows."""
FRONT = {"Tutorials": "tutorials", "How-to": "how-to", "Environments": "environments/index", "Reference": "reference",
         "Gallery": "gallery"}
"""Links below the title of the first page, and their pages."""
EXAMPLE = re.compile(r"examples/[0-9]\w*\.py")
"""Path of an example, which has a page."""


def readmes() -> dict[str, str]:
    """Return the text of every room's README, by its path below the project's folder."""
    paths = [path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("README.md"))]
    return {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in paths}


def outside_code(change: Callable[[str], str], text: str) -> str:
    """Return a text in which all but the blocks of code is changed."""
    parts = re.split(r"(^```.*?^```$)", text, flags=re.S | re.M)
    return "".join(part if i % 2 else change(part) for i, part in enumerate(parts))


def slug(heading: str) -> str:
    """Return the anchor of a heading, as GitHub and MyST make it."""
    return re.sub(r"[^\w -]", "", heading).strip().lower().replace(" ", "-")


def sections(text: str) -> list[tuple[str, str]]:
    """Return the sections of a README, title and text below it; the first is what stands above all others."""
    marked = outside_code(lambda part: re.sub(r"^## ", "\0", part, flags=re.M), text)
    first, *rest = marked.split("\0")
    title, _, intro = first.strip().removeprefix("# ").partition("\n")
    return [(title, intro), *((part.partition("\n")[0].strip(), part.partition("\n")[2]) for part in rest)]


class Site:
    """The sources of the site in a folder, and where what a link names is to be found there."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.rooms = {path: sections(text) for path, text in readmes().items()}
        others = (ROOT / "CHANGELOG.md", HERE / "README.md", *sorted((ROOT / ".github").glob("*.md")))
        self.others = {path: path.removesuffix(".md").lstrip(".").replace("/", "-")
                       for path in (each.relative_to(ROOT).as_posix() for each in others)}
        self.anchors = {(path, anchor): place for path, parts in self.rooms.items()
                        for anchor, place in self._anchors(path, parts)}

    @staticmethod
    def _anchors(path: str, parts: list[tuple[str, str]]) -> Iterator[tuple[str, str]]:
        """Yield each heading's anchor in a README, and the page and anchor that it has on the site."""
        yield "", f"/{path}"
        room = PurePosixPath(path).parent
        for title, text in parts[1:]:
            page = f"/{room}/{slug(title)}.md"
            yield slug(title), page
            for heading in re.findall(r"^###+ (.*)$", re.sub(r"^```.*?^```$", "", text, flags=re.S | re.M), flags=re.M):
                yield slug(heading), f"{page}#{slug(heading)}"

    def target(self, link: str, source: str) -> str:
        """Return where a link of the README ``source`` leads on the site: to a page, to a file, or, as of a folder, "".

        Raises LookupError for a heading or a file that does not exist.
        """
        name, _, anchor = link.partition("#")
        path = normpath(f"{PurePosixPath(source).parent}/{name}") if name else source
        if path in self.rooms or f"{path}/README.md" in self.rooms:
            place = self.anchors.get((path if path in self.rooms else f"{path}/README.md", anchor))
            if place is None:
                raise LookupError(f"{source} links to {link}, and there is no such heading.")
            return place
        if path == "README.md":
            return f"/index.md{'#' * bool(anchor)}{anchor}"
        if EXAMPLE.fullmatch(path):
            return f"/{path.removesuffix('.py')}.md"
        if path in self.others:
            return f"/{self.others[path]}.md"
        if path.startswith("_static/") or path.endswith((".png", ".gif", ".ipynb", ".md")):
            return f"/{path}"  # Sphinx says so if it is not there
        if not (ROOT / path).exists():
            raise LookupError(f"{source} links to {link}, and there is no such file.")
        if (ROOT / path).is_dir():
            return ""
        (self.folder / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / path, self.folder / path)
        return f"/{path}"

    def relinked(self, text: str, source: str) -> str:
        """Return a README's text with links that hold on the site."""
        def linked(found: re.Match[str]) -> str:
            target = self.target(found[3], source)
            return f"{found[1]}[{found[2]}]({target})" if target else found[2]

        return outside_code(lambda part: LINK.sub(linked, part), text)

    def write(self, page: str, text: str) -> None:
        """Write a page, given by its path on the site; ``.md`` may be left out."""
        path = self.folder / (page if page.endswith(".rst") else f"{page.removesuffix('.md')}.md")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")

    # --- pages from READMEs -----------------------------------------------------------------------------------------

    def guides(self, placed: set[str]) -> None:
        """Write the pages of all rooms; sections that no list of ours has ``placed`` are below their room's page."""
        titles = [title for parts in self.rooms.values() for title, _ in parts]
        for path, parts in self.rooms.items():
            room = str(PurePosixPath(path).parent)
            rest = []
            for title, text in parts[1:]:
                short = titles.count(title) > 1 or len(title.split()) < 3
                name = f"{room}/{slug(title)}"
                lifted = outside_code(lambda part: re.sub(r"^#(#{2,} )", r"\1", part, flags=re.M), text)
                self.write(name, f"# {title}{f' ({PurePosixPath(room).name})' * short}\n{self.relinked(lifted, path)}")
                rest += [f"/{name}"] * (name not in placed)
            self.write(f"{room}/README", f"# {parts[0][0]}\n{self.relinked(parts[0][1], path)}\n{toctree(rest)}")

    def front(self, names: list[str]) -> None:
        """Write the first page: the front page, with the site's contents."""
        text = (ROOT / "README.md").read_text(encoding="utf-8")
        title, _, rest = self.relinked(text, "README.md").partition("\n")
        links = " · ".join(f"[{name}](/{page}.md)" for name, page in FRONT.items())
        self.write("index", f"{title}\n\n{links}\n{rest}\n{toctree(names, 'hidden')}")

    def gallery(self) -> None:
        """Draw the gallery's own figures, and add those of READMEs, each with the command that it says made it."""
        entries, front = dict[str, str](), (ROOT / "README.md").read_text(encoding="utf-8")
        for path, text in {"README.md": front, **readmes()}.items():
            title, place = (self.rooms[path][0][0], path) if path in self.rooms else ("the front page", "index.md")
            for alt, file, caption in PICTURE.findall(text):
                name, says = PurePosixPath(file).stem, MADE.sub("", caption) or f"{alt}."
                entries.setdefault(name, "\n\n".join((
                    f"## {TITLES.get(name) or re.split('[,:]', alt)[0]}", self.relinked(f"![{alt}]({file})", path),
                    self.relinked(says, path),
                    f"```sh\n{command(picture(file, path))}\n```",
                    f"From [{title}](/{place}).", "")))
        own = (HERE / "pages" / "gallery.md").read_text(encoding="utf-8")
        self.write("gallery", self.relinked(own, "README.md") + "".join(entries.values()))
        drawn = self.folder / "_static" / "drawn"
        drawn.mkdir()
        for words in re.findall(r"^lab-pendulum (.*)$", own, flags=re.M):
            program = [sys.executable, "-c", "from pendulum_env.cli import main; main()"]
            subprocess.run([*program, *shlex.split(words)], cwd=drawn, check=True, stdout=subprocess.DEVNULL)

    def examples(self) -> None:
        """Write a page for each example, and the list of them."""
        paths = sorted((ROOT / "examples").glob("[0-9]*.py"))
        for path in paths:
            text = path.read_text(encoding="utf-8")
            says = re.split(r"[:.](?=\s|$)", ast.get_docstring(ast.parse(text)) or "")[0]
            self.write(f"examples/{path.stem}",
                       f"# {says}\n\n`python examples/{path.name}`\n\n````python\n{text}````\n")
        head = "# Examples\n\nShort programs, each of which runs headless and checks its result.\n\n"
        self.write("examples/index", head + toctree([f"/examples/{path.stem}" for path in paths]))


def picture(file: str, source: str) -> Path:
    """Return the path of a picture that the README ``source`` shows; LookupError if there is none."""
    path = ROOT / normpath(PurePosixPath(source).parent / file)
    if not path.is_file():
        raise LookupError(f"{source} shows {file}, and there is no such file.")
    return path


def command(picture: Path) -> str:
    """Return the command that a picture says it was made by."""
    with Image.open(picture) as opened:
        info = opened.info
    made: str = (json.loads(info["comment"]) if "comment" in info else info)["Command"]
    script, _, options = made.partition(" ")
    found = [path.relative_to(ROOT) for path in (ROOT / "examples").rglob("*.py") if path.name == script]
    return f"python {found[0].as_posix()} {options}" if found else made


def toctree(names: list[str], *options: str) -> str:
    """Return a list of pages, as MyST writes it."""
    lines = [":maxdepth: 1", *(f":{option}:" for option in options), "", *names]
    return "```{toctree}\n" + "\n".join(lines) + "\n```\n" if names else ""


def placed() -> dict[str, list[str]]:
    """Return the sections of READMEs that the pages in ``pages`` list, by the page."""
    name = re.compile(rf"^/((?:{'|'.join(FOLDERS)})/[\w/-]+)$", flags=re.M)
    return {path.stem: name.findall(path.read_text(encoding="utf-8")) for path in sorted((HERE / "pages").glob("*.md"))}


def stage(folder: Path) -> None:
    """Write all that Sphinx reads into a folder."""
    from generated import pages

    from pendulum_env import web

    shutil.copytree(HERE / "static", folder / "_static")
    shutil.copytree(ROOT / "examples" / "figures", folder / "examples" / "figures")
    for book in (ROOT / "examples").glob("*.ipynb"):
        shutil.copy(book, folder / "examples")
    site = Site(folder)
    named = {name for names in placed().values() for name in names}
    for path in (HERE / "pages").rglob("*.md"):
        text = site.relinked(path.read_text(encoding="utf-8"), "README.md")
        more = {"how-to.md": [each.removesuffix(".md") for each in site.rooms if each.removesuffix(".md") not in named],
                "maintainers.md": site.others.values()}
        name = path.relative_to(HERE / "pages").as_posix()
        site.write(name, text + toctree([f"/{each}" for each in more.get(name, ())]))
    site.guides(named)
    site.front(["tutorials", "how-to", "environments/index", "reference", "explanation", "gallery", "lab-page",
                "maintainers"])
    site.gallery()
    site.examples()
    for source, name in site.others.items():
        text = site.relinked((ROOT / source).read_text(encoding="utf-8"), source)
        site.write(name, "---\nnosearch: true\n---\n\n" * (source == "CHANGELOG.md") + text)
    for page, text in pages():
        site.write(page, text)
    web.write(folder / "_static" / "lab.html")


def build(place: Path, *options: str) -> int:
    """Build the site in a folder; return Sphinx's exit code, which is not 0 if it warns of anything."""
    from sphinx.cmd.build import main

    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary) / "sources"
        stage(folder)
        return main(["-q", "-W", "--keep-going", "-j", "2", "-c", str(HERE), "-d", f"{temporary}/trees",
                     "-D", f"html_static_path={folder}/_static", *options, str(folder), str(place)])


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit("Name the folder for the pages, as in: python .site/build.py out/site")
    sys.path.insert(0, str(HERE))
    os.environ["PYTHONWARNINGS"] = "ignore"
    sys.exit(build(Path(sys.argv[1]), *sys.argv[2:]))
