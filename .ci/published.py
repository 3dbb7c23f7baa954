"""What publishing needs of persons, which stands once, in pyproject.toml, and every place that is made from it.

Metadata of the package: urls, authors, and README with absolute links, since an index shows it without the repository.
Texts in files: what stands between the marks ``given NAME`` and ``end``. ``python .ci/published.py`` writes those, and
names what has not been given yet; with ``--whole`` that is an error, as it is before a release.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

ROOT = Path(__file__).resolve().parents[1]
GIVEN = ("address", "site", "authors", "contact")
"""Settings that a person gives, in the table ``tool.hatch.metadata.hooks.custom``."""
LINK = re.compile(r"(!\[[^\]]*\]|\])\((?!https?:|mailto:)([^)\s]+)\)")
"""A picture, or the end of a link, that leads to a file of the project or to a heading."""
MARKED = re.compile(r"(<!-- given (\w+) -->\n).*?(<!-- end -->)", flags=re.S)
"""A text that is made from the settings, and its name."""


def absolute(page: str, address: str, version: str) -> str:
    """Return README with links into the repository at ``address``: of the release's tag, else of the newest commit.

    Pictures lead to files as they are, links to pages; those to headings, too, because an index gives them no anchors.
    Without an address the page stays as it is.
    """
    if not address:
        return page
    at = f"v{version}" if re.fullmatch(r"[\d.]+(rc\d+)?", version) else "HEAD"

    def led(found: re.Match[str]) -> str:
        before, target = found.groups()
        kind = "raw" if before.startswith("!") else "blob"
        return f"{before}({address}/{kind}/{at}/{'README.md' if target.startswith('#') else ''}{target})"

    parts = re.split(r"(^```.*?^```$)", page, flags=re.S | re.M)  # every second one is code
    return "".join(part if i % 2 else LINK.sub(led, part) for i, part in enumerate(parts))


def urls(address: str, site: str) -> dict[str, str]:
    """Return the addresses that an index shows; none without that of the repository."""
    if not address:
        return {}
    shown = {"Repository": address, "Changelog": f"{address}/blob/HEAD/CHANGELOG.md", "Issues": f"{address}/issues"}
    return {"Homepage": site or address, **({"Documentation": site} if site else {}), **shown}


def texts(given: Mapping[str, Any]) -> dict[str, str]:
    """Return the texts between marks, by their names."""
    address, authors, contact = given["address"], given["authors"], given["contact"]
    author = " and ".join(authors) or "{the LabPendulum developers}"
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    year = re.findall(r"^#{2,3} .*\b(20\d\d)-\d\d-\d\d", changes, flags=re.M)[0]
    fields = {"author": author, "title": "{LabPendulum}: a university lab's pendulum as a {Gymnasium} environment",
              "year": year, **({"url": address} if address else {})}
    cite = ", ".join(f"{name} = {{{text}}}" for name, text in fields.items())
    form = "the form *Report a vulnerability* under the tab *Security* of the repository"
    return {
        "citation": f"```bibtex\n@software{{lab_pendulum, {cite}}}\n```\n",
        "clone": f"```sh\ngit clone {address or 'ADDRESS'} lab-pendulum && cd lab-pendulum\n```\n",
        "security": f"Report it by {form}" + (f", or to <{contact}>.\n" if contact else ".\n"),
        "conduct": f"Write to <{contact}>.\n" if contact else f"Write to the maintainers by {form}.\n",
    }


def filled(page: str, given: Mapping[str, Any]) -> str:
    """Return a page with the texts of the settings between its marks."""
    made = texts(given)
    return MARKED.sub(lambda found: found[1] + made[found[2]] + found[3], page)


def pages() -> list[Path]:
    """Return the files with marks: the front page and those that a forge shows."""
    return [path for path in (ROOT / "README.md", *sorted((ROOT / ".github").glob("*.md")))
            if MARKED.search(path.read_text(encoding="utf-8"))]


class Metadata(MetadataHookInterface):
    """Fields of the package's metadata that are made from the settings."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Set urls, authors and README."""
        address = self.config["address"].rstrip("/")
        page = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        metadata["readme"] = {"content-type": "text/markdown", "text": absolute(page, address, metadata["version"])}
        metadata["urls"] = urls(address, self.config["site"])
        metadata["authors"] = [{"name": name} for name in self.config["authors"]]


def settings() -> dict[str, Any]:
    """Return the settings in pyproject.toml."""
    if sys.version_info >= (3, 11):
        import tomllib
    else:  # hatchling needs it there
        import tomli as tomllib
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    return {name: project["tool"]["hatch"]["metadata"]["hooks"]["custom"][name] for name in GIVEN}


def main() -> int:
    given = settings()
    for path in pages():
        page = path.read_text(encoding="utf-8")
        if (new := filled(page, given)) != page:
            path.write_text(new, encoding="utf-8")
            print(f"{path.relative_to(ROOT)} has what was given.")
    missing = [name for name, value in given.items() if not value]
    if missing:
        print(f"Not given yet in pyproject.toml, [tool.hatch.metadata.hooks.custom]: {', '.join(missing)}.")
    return 1 if missing and "--whole" in sys.argv else 0


if __name__ == "__main__":
    sys.exit(main())
