"""The page's languages: complete tables, and a page that says nothing in another language."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from in_browser import opened
from page_texts import sentences, tables

from pendulum_env.web import write

OWN = {".", "English"}
"""Entries that are no English: the decimal point, and the language's own name."""
SAME = {"CSV", "Jupiter", "Link", "Mars", "PNG", "Planet X", "Python", "c"}
"""Words that other languages may write as English does."""


@pytest.mark.slow
@pytest.mark.parametrize("language", tables())
def test_a_table_has_every_sentence(language: str) -> None:
    table = tables()[language]
    assert set(table) - OWN == sentences()
    assert set(table) >= OWN
    for english, words in table.items():
        if english not in OWN:
            assert words.count("{}") == english.count("{}"), english
            assert words.strip(), english
            assert words != english or english in SAME, english
            assert re.match(" |, |", words)[0] == re.match(" |, |", english)[0], english  # type: ignore[index]
            assert words.endswith(".") is english.endswith("."), english


@pytest.mark.slow
@pytest.mark.parametrize("language", tables())
def test_a_page_in_another_language_says_nothing_in_english(language: str, tmp_path: Path) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright")
    path = write(tmp_path / "lab.html")
    alone = {text for text in sentences() - SAME if "{}" not in text and len(text) > 3}
    with opened(path, locale=f"{language}-XX" if language != "de" else "de-DE", reduced_motion="reduce",
                viewport={"width": 1400, "height": 900}) as seen:
        page = seen.page
        page.wait_for_function("LabPendulum.lab.checked !== null", timeout=120_000)
        assert page.get_attribute("html", "lang") == language
        for scene in page.eval_on_selector_all("#scene option", "(all) => all.map((one) => one.value)"):
            page.select_option("#scene", scene)
            page.evaluate("LabPendulum.advance(1), LabPendulum.show()")
            shown = page.evaluate("""() => [...document.querySelectorAll("body *")].filter((x) => x.checkVisibility()
                && !x.closest("#equation, #software, #language, h1")).flatMap((x) => [
                ...[...x.childNodes].filter((n) => n.nodeType === 3).map((n) => n.textContent),
                x.getAttribute("aria-label") ?? "", x.title ?? ""]).map((text) => text.trim()).filter(Boolean)""")
            assert not alone & set(shown)
        assert re.search(r"\d,\d", page.inner_text("#pendulums"))
        assert not re.search(r"\d\.\d", page.inner_text("#pendulums"))
        found = axe.Axe().run(page)
        assert found.violations_count == 0, found.generate_report()
        page.focus("#language")
        page.select_option("#language", "en")
        assert page.inner_text("#restart") == "Restart"
        assert re.search(r"\d\.\d", page.inner_text("#pendulums"))
        assert page.evaluate("document.activeElement.id") == "language"
