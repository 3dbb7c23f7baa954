"""What the page says in English: the sentences of its scripts and layout, and the words that Python gives it."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser

import pendulum_env.web.document as document
from pendulum_env.common import languages

SAID = re.compile(r'\bt\("((?:[^"\\]|\\.)*)"')
CAPTION = re.compile(r'^  \w+: "([^"]+)",$', re.M)
LABEL = re.compile(r'label: "([^"]+)"')
LISTED = re.compile(r"const (?:STACK|PLANETS) = ([^;]+);|const names = (\[[^;]+);|shown: (\{[^}]+\})")


class Words(HTMLParser):
    """The texts, labels and titles of the layout."""

    def __init__(self) -> None:
        super().__init__()
        self.found: set[str] = set()
        self.inside: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in ("meta", "input"):
            self.inside.append("h1" if ("id", "software") in attrs else tag)  # what no language changes
        self.found |= {str(text) for name, text in attrs if name in ("aria-label", "title")}

    def handle_endtag(self, tag: str) -> None:
        if tag == "p" and self.inside[-1:] == ["h1"]:
            self.inside.pop()
        elif tag in self.inside:
            while self.inside.pop() != tag:
                pass

    def handle_data(self, data: str) -> None:
        if data.strip() and "body" in self.inside and not {"script", "style", "h1"} & {*self.inside}:
            self.found.add(data.strip())


def sentences() -> set[str]:
    """Return all texts that a page of the usual scenes and methods may show."""
    page = document.page()
    words = Words()
    words.feed(page)
    data = json.loads(re.findall(r'id="data">(.*?)</script>', page, flags=re.S)[0])
    scripts = "\n".join((document.ASSETS / name).read_text(encoding="utf-8") for name in document.SCRIPTS)
    found = words.found | {text.replace('\\"', '"') for text in SAID.findall(scripts)}
    found |= {*CAPTION.findall(scripts), *LABEL.findall(scripts)}
    for parts in LISTED.findall(scripts):
        text = "".join(parts)
        found |= {*re.findall(r'"(\w+)"', text), *re.findall(r"(\w+): (?:[\d.]+|true|false)", text)}
    for place in data["scenes"].values():
        found.add(place["about"])
        for setting in place["settings"]:
            found |= {setting["label"], setting["about"], *([setting["effect"]] if setting["effect"] else [])}
    for method in data["methods"].values():
        found |= {method["title"], method["summary"]}
    found |= {"exact", *data["stops"].values()}
    return found


def tables() -> dict[str, dict[str, str]]:
    """Return the page's languages: code -> table from English."""
    return {code: words["page"] for code, words in languages.tables().items() if "page" in words}
